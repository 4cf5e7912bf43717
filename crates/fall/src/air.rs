//! Air and gravity: what acts on bodies from outside.

use crate::Vector;

/// Velocity of the air.
///
/// Every closure `Fn(Vector, f64) -> Vector` is a wind. It must be a pure function, or falls are none.
pub trait Wind {
    /// Velocity in m/s at a point (world coordinates, m) and a time (s).
    fn velocity(&self, point: Vector, time: f64) -> Vector;
}

impl<F: Fn(Vector, f64) -> Vector> Wind for F {
    fn velocity(&self, point: Vector, time: f64) -> Vector {
        self(point, time)
    }
}

/// Air that does not move.
#[derive(Clone, Copy, Debug, Default)]
pub struct Still;

impl Wind for Still {
    fn velocity(&self, _: Vector, _: f64) -> Vector {
        Vector::zeros()
    }
}

/// Constants of the surroundings, and coefficients of the forces of the air. Those of plates are measured and computed by Andersen, Pesavento
/// and Wang (2005) at Reynolds numbers of some 10³.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Gravitational acceleration, in m/s², along -y.
    pub gravity: f64,
    /// Density of the air, in kg/m³.
    pub density: f64,
    /// Drag coefficient of a plate broadside on (A + B = 2.4).
    pub broadside: f64,
    /// Drag coefficient of a plate edge-on (A - B = 0.4).
    pub edgewise: f64,
    /// Coefficient C_T of the circulation by translation (1.2).
    pub lift: f64,
    /// Coefficient C_R of the circulation by rotation, in parts of π (1).
    pub rotation: f64,
    /// Coefficients μ₁ and μ₂ of the damping of rotation (0.2, 0.2).
    pub damping: [f64; 2],
    /// Drag coefficient of lumps (0.47: a ball at Reynolds numbers from 10³ to 10⁵).
    pub lump: f64,
}

impl Default for Air {
    fn default() -> Air {
        Air {
            gravity: 9.81,
            density: 1.2,
            broadside: 2.4,
            edgewise: 0.4,
            lift: 1.2,
            rotation: 1.0,
            damping: [0.2, 0.2],
            lump: 0.47,
        }
    }
}
