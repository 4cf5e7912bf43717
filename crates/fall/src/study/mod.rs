//! Exact cases, as rows of a table. Each is computed at three tolerances or steps; the order is that of the error from one row to the next.

use dlsys_wind::study::Convergence;

use crate::Error;

mod contact;
mod courses;
mod flight;
mod landing;
mod passes;
mod planar;
mod soil;

pub use contact::{bounce_on_plate, carry, moving_plate, parabola, slope};
pub use flight::{broadside, broadside_steps, flutter, terminal_speed, tumble};
pub use landing::{RandomLanding, bounce, contact_energy, random_landing, roll, slide, slide_in_air};
pub use passes::{RandomContact, random_contact};
pub use planar::{Planar, planar_flutter, planar_tumble};
pub use soil::{RandomHills, random_hills, roll_on_soil, slope_of_soil};

/// A case: computes its rows.
pub type Case = fn() -> Result<Vec<Convergence>, Error>;

/// The exact cases.
pub const EXACT_CASES: [Case; 17] = [
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
    parabola,
    moving_plate,
    bounce_on_plate,
    carry,
    slope,
    roll_on_soil,
    slope_of_soil,
];

/// The tolerances of the study. A step of an eighth has an error of 1/512, and lengths of steps are powers of 2.
const TOLERANCES: [f64; 3] = [1e-2, 1e-4, 1e-6];
