//! Exact cases, as rows of a table. Each is computed at three tolerances, ticks or resolutions; the order is that of the error from one row to the next.

use dlsys_wind::study::Convergence;

use crate::Error;

mod motion;
mod optics;
mod speed;

pub use motion::{Turns, decay, fall, gust, rotation, rotation_ticks, spreading, strain, strain_ticks};
pub use optics::{light, random_smoke, transmittance};
pub use speed::{Speed, pace, speeds};

/// A case: computes its rows.
pub type Case = fn() -> Result<Vec<Convergence>, Error>;

/// The exact cases.
pub const EXACT_CASES: [Case; 10] =
    [spreading, decay, fall, gust, strain, strain_ticks, rotation, rotation_ticks, transmittance, light];
