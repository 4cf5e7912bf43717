//! Air and gravity: what acts on segments and plates from outside.

use crate::{Matrix, Vector};

/// Constants of the surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Gravitational acceleration, in m/s².
    pub gravity: Vector,
    /// Density of the air, in kg/m³.
    pub density: f64,
    /// Drag coefficient of a cylinder across the flow (1.1: Reynolds numbers from 10³ to 10⁵).
    pub cylinder: f64,
    /// Drag coefficient of a plate along its normal (1.2: flat plates broadside on).
    pub normal: f64,
    /// Friction coefficient of a plate along its surface, both sides together (0.1: Reynolds numbers of some 10³).
    pub tangential: f64,
}

impl Default for Air {
    fn default() -> Air {
        Air {
            gravity: Vector::new(0.0, -9.81, 0.0),
            density: 1.2,
            cylinder: 1.1,
            normal: 1.2,
            tangential: 0.1,
        }
    }
}

impl Air {
    /// Drag on a piece of a cylinder with a unit tangent that moves with `velocity` relative to the air, in N:
    /// `-½ ρ C d l |v_n| v_n`, where v_n is the velocity across the tangent.
    pub(crate) fn cylinder_drag(&self, area: f64, tangent: &Vector, velocity: &Vector) -> Vector {
        let across = velocity - tangent * tangent.dot(velocity);
        across * (-0.5 * self.density * self.cylinder * area * across.norm())
    }

    /// Minus the derivative of [`cylinder_drag`](Air::cylinder_drag) by the velocity: symmetric, not negative.
    pub(crate) fn cylinder_damping(&self, area: f64, tangent: &Vector, velocity: &Vector) -> Matrix {
        let across = velocity - tangent * tangent.dot(velocity);
        let speed = across.norm();
        let coefficient = 0.5 * self.density * self.cylinder * area;
        if speed <= 0.0 {
            return Matrix::zeros();
        }
        let mut damping = Matrix::from_diagonal_element(coefficient * speed);
        damping -= tangent * (tangent * (coefficient * speed)).transpose();
        damping + across * (across * (coefficient / speed)).transpose()
    }

    /// Force on a plate that moves with `velocity` relative to the air, in N:
    /// `-½ ρ A |v| (C_n (n·v) n + C_t (v - (n·v) n))`, the law of a face of O'Brien, Zordan and Hodgins with its two coefficients in
    /// terms of drag coefficients.
    pub(crate) fn plate_drag(&self, area: f64, normal: &Vector, velocity: &Vector) -> Vector {
        let along = normal * normal.dot(velocity);
        let scale = -0.5 * self.density * area * velocity.norm();
        (along * self.normal + (velocity - along) * self.tangential) * scale
    }

    /// A symmetric matrix in the place of minus the derivative of [`plate_drag`](Air::plate_drag), which is not symmetric.
    /// It is exact for flow along the normal and along the surface.
    pub(crate) fn plate_damping(&self, area: f64, normal: &Vector, velocity: &Vector) -> Matrix {
        let speed = velocity.norm();
        if speed <= 0.0 {
            return Matrix::zeros();
        }
        let scale = 0.5 * self.density * area * speed;
        let cosine = normal.dot(velocity) / speed;
        let across = velocity - normal * (cosine * speed);
        let mut damping = Matrix::from_diagonal_element(scale * self.tangential);
        let along = scale * (self.normal * (1.0 + cosine * cosine) - self.tangential);
        damping += normal * (normal * along).transpose();
        damping + across * (across * (scale * self.tangential / (speed * speed))).transpose()
    }
}
