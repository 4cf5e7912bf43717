//! Exact cases, as rows of a table. Each is computed at three tolerances, steps or resolutions; the order is that of the error from one row to the next.

use dlsys_wind::study::Convergence;

use crate::{Error, Settings};

mod collision;
mod hard;
mod methods;
mod motion;
mod net;
mod random;
mod speed;
mod statics;

pub use collision::{collision, floor, trampoline};
pub use hard::{HardCase, hard_cases};
pub use methods::{METHOD_CASES, MethodCase, Work, methods};
pub use motion::{fall, pendulum, vibration};
pub use net::{Catch, Coupling, catch, hoop_net, throw_steps};
pub use random::{RandomPass, random_pass};
pub use speed::{Pace, pace, paces};
pub use statics::{cantilever, hanging_cord, membrane, stretch, stretched_cord};

/// A case: computes its rows.
pub type Case = fn() -> Result<Vec<Convergence>, Error>;

/// The exact cases.
pub const EXACT_CASES: [Case; 11] = [
    stretch,
    stretched_cord,
    hanging_cord,
    membrane,
    cantilever,
    vibration,
    pendulum,
    fall,
    collision,
    trampoline,
    floor,
];

/// The tolerances of the study.
const TOLERANCES: [f64; 3] = [1e-3, 1e-4, 1e-5];
/// With a tighter one, for errors that fall by less than the tolerance.
const TIGHT: [f64; 4] = [1e-3, 1e-4, 1e-5, 1e-6];

/// Settings with steps of one length (s), or with a tolerance and a longest step.
fn fixed(step: f64) -> Settings {
    Settings { longest: step, fixed: true, ..Settings::default() }
}

/// Settings with a tolerance.
fn within(tolerance: f64) -> Settings {
    Settings { tolerance, ..Settings::default() }
}
