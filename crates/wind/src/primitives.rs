//! Simple large-scale flows that are added to the mean wind: the primitives of Stam and Fiume 1993 (section 2: "simple wind field
//! primitives", section 6: "directional, spherical, and exponentially decaying fields"; Wejchert and Haumann 1991).

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use crate::description::positive;
use crate::{Error, Signal};

/// A part of the large-scale wind. Lengths are in metres, times in seconds.
#[derive(Debug)]
pub enum Flow {
    /// The same velocity everywhere, in m/s.
    Uniform([Signal; 3]),
    /// Air that appears at a point and leaves in all directions: S/(4π(r² + c²)) m/s at the distance r, times exp(-r/R). A
    /// negative strength is a sink.
    Source {
        /// The volume S of air in m³/s.
        strength: Signal,
        /// The point, in metres.
        at: [Signal; 3],
        /// The length R of decay in metres; none: no decay.
        decay: Option<f64>,
        /// The radius c of the core in metres, within which the speed falls to 0.
        core: f64,
    },
    /// Air that circles around an axis: Γρ/(2π(ρ² + c²)) m/s at the distance ρ from the axis, times exp(-ρ/R). Positive
    /// circulation turns with the right hand around the axis. It is free of divergence.
    Vortex {
        /// The circulation Γ in m²/s.
        circulation: Signal,
        /// A point of the axis, in metres.
        at: [Signal; 3],
        /// The direction of the axis, of any length but 0.
        axis: [Signal; 3],
        /// The length R of decay in metres; none: no decay.
        decay: Option<f64>,
        /// The radius c of the core in metres, within which the speed falls to 0.
        core: f64,
    },
}

impl Flow {
    /// A source that does not move, with a core of 0.1 m.
    pub fn source(strength: impl Into<Signal>, at: Vector3<f64>, decay: Option<f64>) -> Flow {
        let at = fixed(at);
        Flow::Source { strength: strength.into(), at, decay, core: 0.1 }
    }

    /// A vortex that does not move, with a core of 0.1 m.
    pub fn vortex(
        circulation: impl Into<Signal>,
        at: Vector3<f64>,
        axis: Vector3<f64>,
        decay: Option<f64>,
    ) -> Flow {
        let (at, axis) = (fixed(at), fixed(axis));
        Flow::Vortex { circulation: circulation.into(), at, axis, decay, core: 0.1 }
    }

    /// All signals with their names.
    fn signals(&self) -> Vec<(&'static str, &Signal)> {
        match self {
            Flow::Uniform([x, y, z]) => {
                vec![("the x component", x), ("the y component", y), ("the z component", z)]
            }
            Flow::Source { strength, at: [x, y, z], .. } => {
                vec![
                    ("the strength", strength),
                    ("the x coordinate", x),
                    ("the y coordinate", y),
                    ("the z coordinate", z),
                ]
            }
            Flow::Vortex { circulation, at: [x, y, z], axis: [u, v, w], .. } => vec![
                ("the circulation", circulation),
                ("the x coordinate", x),
                ("the y coordinate", y),
                ("the z coordinate", z),
                ("the x component of the axis", u),
                ("the y component of the axis", v),
                ("the z component of the axis", w),
            ],
        }
    }

    /// An error if a value is out of range, or lacks the period. Flows are counted from 0 here and from 1 in messages.
    pub(crate) fn check(&self, index: usize, period: Option<f64>) -> Result<(), Error> {
        self.is_flow(index, period).map_err(|error| Error::Flow { index, error: Box::new(error) })
    }

    fn is_flow(&self, index: usize, period: Option<f64>) -> Result<(), Error> {
        for (name, signal) in self.signals() {
            let name = || format!("{name} of flow {}", index + 1);
            if let Signal::Constant(_) = signal {
                signal.finite_at(0.0, name)?;
            }
            if let Some(period) = period {
                signal.check_period(period, name)?;
            }
        }
        match self {
            Flow::Uniform(_) => Ok(()),
            Flow::Source { decay, core, .. } => check_lengths(*decay, *core),
            Flow::Vortex { decay, core, axis, .. } => {
                // An axis that moves is looked at when it is needed.
                if let [Signal::Constant(x), Signal::Constant(y), Signal::Constant(z)] = *axis {
                    direction(Vector3::new(x, y, z), index, 0.0)?;
                }
                check_lengths(*decay, *core)
            }
        }
    }

    /// The flow at an instant.
    pub(crate) fn at(&self, time: f64, index: usize) -> Result<Primitive, Error> {
        self.primitive(time, index).map_err(|error| Error::Flow { index, error: Box::new(error) })
    }

    fn primitive(&self, time: f64, index: usize) -> Result<Primitive, Error> {
        let value =
            |name: &str, signal: &Signal| signal.finite_at(time, || format!("{name} of flow {}", index + 1));
        let vector = |name: &str, [x, y, z]: &[Signal; 3]| {
            Ok::<_, Error>(Vector3::new(value(name, x)?, value(name, y)?, value(name, z)?))
        };
        // Without decay the rate is 0.
        let rate = |decay: &Option<f64>| decay.map_or(0.0, |length| 1.0 / length);
        Ok(match self {
            Flow::Uniform(velocity) => Primitive::Uniform(vector("the velocity", velocity)?),
            Flow::Source { strength, at, decay, core } => Primitive::Source {
                strength: value("the strength", strength)? / (4.0 * PI),
                at: vector("the position", at)?,
                rate: rate(decay),
                core: core * core,
            },
            Flow::Vortex { circulation, at, axis, decay, core } => Primitive::Vortex {
                strength: value("the circulation", circulation)? / (2.0 * PI),
                at: vector("the position", at)?,
                axis: direction(vector("the axis", axis)?, index, time)?,
                rate: rate(decay),
                core: core * core,
            },
        })
    }
}

/// Numbers that do not depend on time.
fn fixed(vector: Vector3<f64>) -> [Signal; 3] {
    [vector.x.into(), vector.y.into(), vector.z.into()]
}

/// The direction of the axis of a flow at an instant, of length 1.
fn direction(axis: Vector3<f64>, index: usize, time: f64) -> Result<Vector3<f64>, Error> {
    // Divided by its largest component, so that no square overflows or vanishes.
    let largest = axis.amax();
    if largest == 0.0 { Err(Error::Axis { flow: index + 1, time }) } else { Ok((axis / largest).normalize()) }
}

fn check_lengths(decay: Option<f64>, core: f64) -> Result<(), Error> {
    if let Some(length) = decay {
        positive("the length of decay of a flow", length)?;
    }
    positive("the radius of the core of a flow", core)
}

/// A flow at an instant.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Primitive {
    Uniform(Vector3<f64>),
    /// `strength` is per 4π, `core` squared, `rate` the inverse of the length of decay.
    Source {
        strength: f64,
        at: Vector3<f64>,
        rate: f64,
        core: f64,
    },
    /// `strength` is per 2π, `core` squared, `rate` the inverse of the length of decay.
    Vortex {
        strength: f64,
        at: Vector3<f64>,
        axis: Vector3<f64>,
        rate: f64,
        core: f64,
    },
}

impl Primitive {
    pub(crate) fn velocity(&self, x: Vector3<f64>) -> Vector3<f64> {
        match *self {
            Primitive::Uniform(velocity) => velocity,
            Primitive::Source { strength, at, rate, core } => {
                let r = x - at;
                let (square, distance) = (r.norm_squared(), r.norm());
                if distance == 0.0 {
                    return Vector3::zeros();
                }
                r * (strength * libm::exp(-distance * rate) / (distance * (square + core)))
            }
            Primitive::Vortex { strength, at, axis, rate, core } => {
                let around = axis.cross(&(x - at));
                let square = around.norm_squared();
                around * (strength * libm::exp(-square.sqrt() * rate) / (square + core))
            }
        }
    }

    /// The derivatives of the velocity: row i, column j is ∂u_i/∂x_j.
    pub(crate) fn gradient(&self, x: Vector3<f64>) -> Matrix3<f64> {
        match *self {
            Primitive::Uniform(_) => Matrix3::zeros(),
            Primitive::Source { strength, at, rate, core } => {
                let r = x - at;
                let (square, distance) = (r.norm_squared(), r.norm());
                if distance == 0.0 {
                    return Matrix3::zeros();
                }
                let factor = strength * libm::exp(-distance * rate) / (distance * (square + core));
                let slope = -factor * (rate + 1.0 / distance + 2.0 * distance / (square + core));
                Matrix3::identity() * factor + r * r.transpose() * (slope / distance)
            }
            Primitive::Vortex { strength, at, axis, rate, core } => {
                let r = x - at;
                let around = axis.cross(&r);
                let (square, distance) = (around.norm_squared(), around.norm());
                let factor = strength * libm::exp(-distance * rate) / (square + core);
                let turning = axis.cross_matrix() * factor;
                if distance == 0.0 {
                    return turning;
                }
                let slope = -factor * (rate + 2.0 * distance / (square + core));
                let outward = (r - axis * axis.dot(&r)) / distance;
                turning + around * outward.transpose() * slope
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn primitives() -> Vec<Primitive> {
        let at = Vector3::new(0.5, 1.0, -2.0);
        let axis = Vector3::new(1.0, 2.0, -0.5);
        [
            Flow::source(3.0, at, Some(2.0)),
            Flow::source(-3.0, at, None),
            Flow::vortex(2.0, at, axis, Some(1.5)),
            Flow::vortex(2.0, at, axis, None),
        ]
        .iter()
        .map(|flow| flow.at(0.0, 0).unwrap())
        .collect()
    }

    #[test]
    fn gradients_are_those_of_the_velocities() {
        for primitive in primitives() {
            let x = Vector3::new(1.1, 0.3, -1.2);
            let gradient = primitive.gradient(x);
            for j in 0..3 {
                let step = Vector3::ith(j, 1e-5);
                let difference = (primitive.velocity(x + step) - primitive.velocity(x - step)) / 2e-5;
                assert!((difference - gradient.column(j)).norm() < 1e-8, "{primitive:?}");
            }
        }
    }

    #[test]
    fn a_source_sends_its_volume_through_every_sphere_and_a_vortex_nothing_anywhere() {
        let primitives = primitives();
        // Without decay and far from the core, 4πr² times the radial velocity.
        let x = Vector3::new(0.5, 1.0, 98.0);
        let u = primitives[1].velocity(x);
        assert!((u.z * 4.0 * PI * 1e4 + 3.0).abs() < 1e-4);
        for vortex in &primitives[2..] {
            assert!(vortex.gradient(Vector3::new(2.0, 0.1, 3.0)).trace().abs() < 1e-16);
        }
        // Γ around the axis.
        let u = primitives[3].velocity(Vector3::new(0.5, 1.0, -2.0) + Vector3::new(2.0, -1.0, 0.0) * 10.0);
        assert!((u.norm() * 2.0 * PI * 500f64.sqrt() - 2.0).abs() < 1e-4);
    }
}
