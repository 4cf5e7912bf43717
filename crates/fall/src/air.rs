//! Air and gravity: what acts on bodies from outside.

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
