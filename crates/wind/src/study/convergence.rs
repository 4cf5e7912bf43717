//! Exact cases at several resolutions: rows of tables about what moves in the air.

/// One line of a study: an exact case at one resolution.
#[derive(Clone, Debug, PartialEq)]
pub struct Convergence {
    /// The case and its quantity, with its unit.
    pub case: &'static str,
    /// A number of parts or steps, a length of a step (s), or a tolerance: what is refined.
    pub resolution: f64,
    /// Computed value.
    pub value: f64,
    /// Exact value.
    pub expected: f64,
    /// Error relative to the exact value; absolute where that is 0.
    pub error: f64,
    /// Order of convergence from the row before to this one; none in the first row of a case, or where errors are rounding.
    pub order: Option<f64>,
}

impl Convergence {
    /// Rows of one case from (resolution, value) pairs.
    pub fn rows(case: &'static str, expected: f64, found: &[(f64, f64)]) -> Vec<Convergence> {
        let mut rows: Vec<Convergence> = Vec::new();
        for &(resolution, value) in found {
            let scale = if expected == 0.0 { 1.0 } else { expected.abs() };
            let error = (value - expected).abs() / scale;
            let order = rows.last().and_then(|before| {
                let finer = (resolution / before.resolution).ln().abs();
                (error > 1e-12 && before.error > 1e-12).then(|| (before.error / error).ln() / finer)
            });
            rows.push(Convergence { case, resolution, value, expected, error, order });
        }
        rows
    }
}
