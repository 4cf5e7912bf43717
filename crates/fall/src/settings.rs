//! Settings of a fall.

use crate::error::check;
use crate::{Air, Error};

/// How a fall is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Largest error of a step: of the position relative to the largest half-extent of the body, of the attitude in radians. Errors of rates count
    /// as the displacement that they make while the body falls its half chord.
    pub tolerance: f64,
    /// Longest step H in s; it is rounded down to a power of 2. Steps have the length H/2^m and end at multiples of it, so bodies read the
    /// wind at the same instants.
    pub longest: f64,
    /// Largest m.
    pub deepest: u32,
    /// Largest number of steps of one fall.
    pub steps: u64,
    /// Air and gravity.
    pub air: Air,
    /// Whether steps are of one length H in flight, whatever their error. For measurements of order.
    pub fixed: bool,
}

impl Default for Settings {
    /// A tolerance of 1e-3, steps of 1/32 s at most, and ten million of them.
    fn default() -> Settings {
        Settings {
            tolerance: 1e-3,
            longest: 1.0 / 32.0,
            deepest: 30,
            steps: 10_000_000,
            air: Air::default(),
            fixed: false,
        }
    }
}

impl Settings {
    /// Checks ranges, and rounds the longest step.
    pub(crate) fn checked(mut self) -> Result<Settings, Error> {
        let Settings { tolerance, longest, deepest, air, .. } = self;
        check("a tolerance", tolerance, (1e-12..=0.1).contains(&tolerance), "1e-12 to 0.1")?;
        check("a longest step (s)", longest, (1e-9..=1.0).contains(&longest), "1e-9 to 1")?;
        check("a largest level", f64::from(deepest), deepest <= 40, "at most 40")?;
        let Air { gravity, density, broadside, edgewise, lift, rotation, damping, lump } = air;
        let coefficients = [broadside, edgewise, lift, rotation, damping[0], damping[1], lump];
        for value in [gravity, density].into_iter().chain(coefficients) {
            check("a constant of the air", value, value >= 0.0, "0 or more")?;
        }
        if !self.fixed {
            // Powers of 2 have exact multiples.
            let exponent = libm::floor(libm::log2(longest));
            self.longest = libm::exp2(exponent);
        }
        Ok(self)
    }
}
