//! Settings of a solver.

use crate::error::check;
use crate::{Air, Error};

/// How a state is advanced where nothing begins or ends to touch; there, both are steps of backward Euler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Two stages, of order 2 and L-stable (Alexander 1977).
    #[default]
    Sdirk2,
    /// Two steps of backward Euler, of order 1: for comparison.
    Euler,
}

/// How a solver works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The method.
    pub method: Method,
    /// Largest error of a step: displacement of any point relative to the extent of the sheet. The error of the velocity counts as the
    /// displacement that it makes in the longest step.
    pub tolerance: f64,
    /// Longest step H, in s. Steps have the length H/2^m and end at multiples of it.
    pub longest: f64,
    /// Largest m.
    pub deepest: u32,
    /// Largest number of steps tried in a time of H.
    pub most: u64,
    /// Largest number of iterations for a linear system.
    pub iterations: usize,
    /// Air and gravity.
    pub air: Air,
    /// Whether steps are of one length H, whatever their error. They are shorter where contacts require that. For measurements of order.
    pub fixed: bool,
}

impl Default for Settings {
    /// A tolerance of 1e-3 and steps of 1/60 s at most.
    fn default() -> Settings {
        Settings {
            method: Method::default(),
            tolerance: 1e-3,
            longest: 1.0 / 60.0,
            deepest: 24,
            most: 50_000,
            iterations: 20_000,
            air: Air::default(),
            fixed: false,
        }
    }
}

impl Settings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let Settings { tolerance, longest, deepest, air, .. } = *self;
        check("a tolerance", tolerance, (1e-12..=0.1).contains(&tolerance), "1e-12 to 0.1")?;
        check("a longest step (s)", longest, (1e-9..=10.0).contains(&longest), "1e-9 to 10")?;
        check("a largest level", f64::from(deepest), deepest <= 40, "at most 40")?;
        for value in [air.density, air.cylinder, air.normal, air.tangential] {
            check("a constant of the air", value, value >= 0.0, "0 or more")?;
        }
        for value in air.gravity.iter() {
            check("a gravity (m/s²)", *value, true, "a finite number")?;
        }
        Ok(())
    }
}
