//! Position and attitude of a body, and their rates.

use nalgebra::{Quaternion, SVector};

use crate::error::check;
use crate::{Attitude, Error, Vector};

/// Where a body is, how it is turned, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Centre of mass, in m.
    pub position: Vector,
    /// Velocity of the centre of mass, in m/s.
    pub velocity: Vector,
    /// Turns vectors from the axes of the body (chord, span, normal of a plate) to those of the world.
    pub attitude: Attitude,
    /// Angular velocity about the axes of the body, in rad/s.
    pub spin: Vector,
}

/// Position, velocity, attitude and spin in one vector.
pub(crate) type Packed = SVector<f64, 13>;

impl Motion {
    /// At rest at a place, with the normal of a plate upward.
    pub fn at(position: Vector) -> Motion {
        Motion { position, velocity: Vector::zeros(), attitude: level(), spin: Vector::zeros() }
    }

    /// A vector of the body's axes in those of the world.
    pub fn turned(&self, vector: Vector) -> Vector {
        self.attitude * vector
    }

    /// Angular velocity about the axes of the world, in rad/s.
    pub fn world_spin(&self) -> Vector {
        self.attitude * self.spin
    }

    /// Place of a point of the body, in m.
    pub fn point(&self, point: Vector) -> Vector {
        self.position + self.turned(point)
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let quaternion = self.attitude.coords;
        let parts = [self.position, self.velocity, self.spin];
        for value in parts.iter().flat_map(|part| part.iter()).chain(quaternion.iter()) {
            check("a component of the motion at release", *value, true, "a finite number")?;
        }
        Ok(())
    }

    pub(crate) fn pack(&self) -> Packed {
        let mut packed = Packed::zeros();
        packed.fixed_rows_mut::<3>(0).copy_from(&self.position);
        packed.fixed_rows_mut::<3>(3).copy_from(&self.velocity);
        packed.fixed_rows_mut::<4>(6).copy_from(&self.attitude.coords);
        packed.fixed_rows_mut::<3>(10).copy_from(&self.spin);
        packed
    }

    pub(crate) fn unpack(packed: &Packed) -> Motion {
        Motion {
            position: packed.fixed_rows::<3>(0).into_owned(),
            velocity: packed.fixed_rows::<3>(3).into_owned(),
            attitude: unit(Quaternion { coords: packed.fixed_rows::<4>(6).into_owned() }),
            spin: packed.fixed_rows::<3>(10).into_owned(),
        }
    }
}

/// The attitude with the chord along x, the span along -z and the normal along y.
fn level() -> Attitude {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    unit(Quaternion::new(half, -half, 0.0, 0.0))
}

/// A quaternion of length 1.
fn unit(quaternion: Quaternion<f64>) -> Attitude {
    Attitude::new_unchecked(quaternion / quaternion.norm())
}

/// The attitude after a turn about an axis of the body, by a rotation vector in rad.
pub(crate) fn turn(attitude: Attitude, by: Vector) -> Attitude {
    let angle = by.norm();
    let half = angle / 2.0;
    // sin(x)/x near 0.
    let factor = if half < 1e-4 { 0.5 - half * half / 12.0 } else { libm::sin(half) / angle };
    let vector = by * factor;
    let turn = Quaternion::new(libm::cos(half), vector.x, vector.y, vector.z);
    unit(attitude.into_inner() * turn)
}

/// The rotation vector in rad, about axes of the body, that leads from one attitude to another by less than half a turn.
pub(crate) fn between(from: Attitude, to: Attitude) -> Vector {
    let turn = from.into_inner().conjugate() * to.into_inner();
    let (scalar, vector) = if turn.w < 0.0 { (-turn.w, -turn.imag()) } else { (turn.w, turn.imag()) };
    let sine = vector.norm();
    let factor = if sine < 1e-6 { 2.0 / scalar } else { 2.0 * libm::atan2(sine, scalar) / sine };
    vector * factor
}
