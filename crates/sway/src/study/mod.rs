//! Exact cases and hard cases, as rows of a table: what `dlsys report --surroundings` prints.
//!
//! Each case is computed at three resolutions or tolerances; the order is that of the error from one row to the next.

use crate::{Air, Error, Load, Segment, Settings, Skeleton, Vector, upright};

mod hard;
mod motion;
mod random;
mod statics;
mod vibration;

pub use hard::{HardCase, hard_cases};
pub use motion::{
    WorkRow, angular_momentum, decrement, energy_balance, flywheels, methods, pendulum_on_a_cart,
    shaken_cantilever, splitting,
};
pub use random::{RandomCase, random_case};
pub use statics::{elastica, end_load, greenhill, greenhill_settles, uniform_load};
pub use vibration::{cantilever_modes, cone_modes, hanging_chain};

/// One line of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The case and its quantity, with its unit.
    pub case: &'static str,
    /// Number of segments, steps, or tolerance: what is refined.
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

/// Rows of one case from (resolution, value) pairs. Resolutions above 1 are counts; below 1 tolerances or steps.
pub(crate) fn rows(case: &'static str, expected: f64, found: &[(f64, f64)]) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for &(resolution, value) in found {
        let scale = if expected == 0.0 { 1.0 } else { expected.abs() };
        let error = (value - expected).abs() / scale;
        let order = rows.last().and_then(|before| {
            let finer = (resolution / before.resolution).ln().abs();
            (error > 1e-12 && before.error > 1e-12).then(|| (before.error / error).ln() / finer)
        });
        rows.push(Row { case, resolution, value, expected, error, order });
    }
    rows
}

/// A case: computes its rows.
pub type Case = fn() -> Result<Vec<Row>, Error>;

/// The exact cases.
pub const EXACT_CASES: [Case; 15] = [
    end_load,
    uniform_load,
    elastica,
    greenhill,
    greenhill_settles,
    cantilever_modes,
    cone_modes,
    hanging_chain,
    decrement,
    energy_balance,
    splitting,
    shaken_cantilever,
    pendulum_on_a_cart,
    angular_momentum,
    flywheels,
];

/// A straight stem of `n` equal segments, clamped upright or along +x at the origin, with sag and without drag.
pub(crate) fn stem(n: usize, length: f64, diameter: f64, stiffness: f64, density: f64, up: bool) -> Skeleton {
    let mut skeleton = Skeleton::new();
    let mut parent = None;
    for _ in 0..n {
        let mut segment = Segment::solid(parent, length / n as f64, diameter, stiffness, density);
        segment.drag_diameter = 0.0;
        if parent.is_none() && up {
            segment.joint.rotation = upright();
        }
        parent = Some(skeleton.push(segment));
    }
    skeleton
}

/// The same with a load at its end.
pub(crate) fn loaded_stem(n: usize, length: f64, diameter: f64, stiffness: f64, mass: f64) -> Skeleton {
    let mut skeleton = stem(n, length, diameter, stiffness, 0.0, false);
    skeleton.load(Load::point(1.0, mass));
    skeleton
}

/// Settings without weight.
pub(crate) fn weightless() -> Settings {
    Settings { air: Air { gravity: Vector::zeros(), ..Air::default() }, ..Settings::default() }
}

/// EI of a round section.
pub(crate) fn rigidity(diameter: f64, stiffness: f64) -> f64 {
    stiffness * std::f64::consts::PI * diameter.powi(4) / 64.0
}
