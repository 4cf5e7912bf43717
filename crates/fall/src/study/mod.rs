//! Exact cases, as rows of a table. Each is computed at three tolerances or steps; the order is that of the error from one row to the next.

use crate::Error;

mod flight;
mod landing;
mod planar;

pub use flight::{broadside, broadside_steps, flutter, terminal_speed, tumble};
pub use landing::{RandomLanding, bounce, contact_energy, random_landing, roll, slide, slide_in_air};
pub use planar::{Planar, planar_flutter, planar_tumble};

/// One line of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The case and its quantity, with its unit.
    pub case: &'static str,
    /// Tolerance, or length of a step in s: what is refined.
    pub resolution: f64,
    /// Computed value.
    pub value: f64,
    /// Exact value.
    pub expected: f64,
    /// Error relative to the exact value; absolute where that is 0.
    pub error: f64,
    /// Order of the error in the resolution, from the row before to this one; none in the first row of a case, or where errors are
    /// rounding.
    pub order: Option<f64>,
}

/// Rows of one case from (resolution, value) pairs.
fn rows(case: &'static str, expected: f64, found: &[(f64, f64)]) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for &(resolution, value) in found {
        let scale = if expected == 0.0 { 1.0 } else { expected.abs() };
        let error = (value - expected).abs() / scale;
        let order = rows.last().and_then(|before| {
            let finer = (before.resolution / resolution).ln();
            (error > 1e-12 && before.error > 1e-12).then(|| (before.error / error).ln() / finer)
        });
        rows.push(Row { case, resolution, value, expected, error, order });
    }
    rows
}

/// A case: computes its rows.
pub type Case = fn() -> Result<Vec<Row>, Error>;

/// The exact cases.
pub const EXACT_CASES: [Case; 10] = [
    terminal_speed,
    broadside,
    broadside_steps,
    flutter,
    tumble,
    bounce,
    slide,
    slide_in_air,
    roll,
    contact_energy,
];

/// The tolerances of the study. A step of an eighth has an error of 1/512, and lengths of steps are powers of 2.
const TOLERANCES: [f64; 3] = [1e-2, 1e-4, 1e-6];
