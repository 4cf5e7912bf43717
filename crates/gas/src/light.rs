//! How a gas looks, and the lights that shine on it.

use crate::error::check;
use crate::{Error, Vector};

/// Optical properties of a gas. Colours are linear, red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Extinction κ_t in m²/kg: a column of density ρ ds weakens light by e^(-κ_t ∫ρ ds).
    pub extinction: f64,
    /// The part Ω of what is taken from light that is scattered, 0 to 1, for each colour. The rest is absorbed.
    pub albedo: [f64; 3],
    /// Self-emission Q: the radiance of a gas that lets no light through and scatters none.
    pub glow: [f64; 3],
}

/// A light far away, or from all sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// From one direction; the gas shades itself.
    Distant {
        /// Towards the light, of length 1.
        towards: Vector,
        /// Radiance of gas that scatters all of it and is in no shadow. The phase function is constant, as in the pictures of the paper.
        colour: [f64; 3],
    },
    /// From all sides, without shadow.
    Ambient([f64; 3]),
}

impl Look {
    /// # Errors
    ///
    /// A value out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        check("an extinction (m²/kg)", self.extinction, self.extinction >= 0.0, "0 or more")?;
        for value in self.albedo {
            check("an albedo", value, (0.0..=1.0).contains(&value), "0 to 1")?;
        }
        for value in self.glow {
            check("a glow", value, value >= 0.0, "0 or more")?;
        }
        Ok(())
    }
}

impl Light {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let (Light::Distant { colour, .. } | Light::Ambient(colour)) = self;
        for value in colour {
            check("a colour of a light", *value, *value >= 0.0, "0 or more")?;
        }
        if let Light::Distant { towards, .. } = self {
            let length = towards.norm();
            check("the length of a direction towards a light", length, (length - 1.0).abs() < 1e-6, "1")?;
        }
        Ok(())
    }
}
