//! Exact cases and hard cases, as rows of a table: what `dlsys report --surroundings` prints.
//!
//! Each case is computed at three resolutions or tolerances; the order is that of the error from one row to the next.

use dlsys_wind::study::Convergence;

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

/// A case: computes its rows.
pub type Case = fn() -> Result<Vec<Convergence>, Error>;

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
