//! Forces and torques of air and weight, and the accelerations that they cause.

use std::f64::consts::PI;

use nalgebra::Matrix3;

use crate::motion::Packed;
use crate::{Air, Body, Error, Ground, Motion, Shape, Vector, Wind};

/// A body in the air: constants that follow from both.
#[derive(Clone, Debug)]
pub(crate) struct Dynamics {
    shape: Shape,
    air: Air,
    mass: f64,
    /// Weight less buoyancy, in N.
    weight: f64,
    /// Mass of the air that moves with the body: of a plate along its normal, of a lump in all directions.
    pub(crate) added: f64,
    /// Moments of inertia with those of the air.
    inertia: Vector,
    area: f64,
    half_chord: f64,
    /// Half-extents across the axes of rotation.
    arms: Vector,
    /// The speed U of Andersen, Pesavento and Wang, in m/s.
    speed: f64,
    ground: Option<Ground>,
    /// Thickness of the layer of air that rests on the ground, in m: the wind is whole at twice this height.
    layer: f64,
}

impl Dynamics {
    pub(crate) fn new(body: &Body, air: Air, ground: Option<Ground>) -> Dynamics {
        let half_chord = body.half_chord();
        let weight = body.heaviness(&air) * air.gravity;
        let [a, b, c] = body.half;
        let mut inertia = body.inertia();
        let (added, arms) = match body.shape {
            Shape::Plate => {
                // π ρ a² for each unit of the span, area/2a.
                let added = PI / 2.0 * air.density * half_chord * body.area;
                inertia += Vector::new(b * b, a * a, 0.0) * (added / 8.0);
                (added, Vector::new(b, a, half_chord))
            }
            Shape::Lump => (air.density * body.volume / 2.0, Vector::new(b.max(c), a.max(c), a.max(b))),
        };
        let speed = if air.density > 0.0 {
            libm::sqrt(2.0 * weight.abs() / (PI * air.density * body.area))
        } else {
            0.0
        };
        Dynamics {
            shape: body.shape,
            air,
            mass: body.mass,
            weight,
            added,
            inertia,
            area: body.area,
            half_chord,
            arms,
            speed,
            ground,
            layer: body.reach(),
        }
    }

    /// Puts a floor below the body: air sticks to it.
    pub(crate) fn stand_on(&mut self, ground: Ground) {
        self.ground = Some(ground);
    }

    /// Time in s in which the body falls its half chord.
    pub(crate) fn moment(&self) -> f64 {
        // A body without weight or without air has no terminal speed; gravity then sets the scale.
        let free = libm::sqrt(self.air.gravity * self.half_chord);
        let speed = self.speed.max(free);
        if speed > 0.0 { self.half_chord / speed } else { 1.0 }
    }

    /// Kinetic energy in J, with that of the air that moves with the body; the air is taken as still.
    pub(crate) fn kinetic_energy(&self, motion: &Motion) -> f64 {
        let moving = match self.shape {
            Shape::Plate => {
                self.mass * motion.velocity.norm_squared()
                    + self.added * square(motion.velocity.dot(&normal(motion)))
            }
            Shape::Lump => (self.mass + self.added) * motion.velocity.norm_squared(),
        };
        let turning = self.inertia.dot(&motion.spin.component_mul(&motion.spin));
        0.5 * (moving + turning)
    }

    /// Potential energy in J, from height 0.
    pub(crate) fn potential_energy(&self, motion: &Motion) -> f64 {
        self.weight * motion.position.y
    }

    /// Weight less buoyancy, in N.
    pub(crate) fn weight(&self) -> f64 {
        self.weight
    }

    /// Change of velocity by an impulse in N s.
    pub(crate) fn pushed(&self, motion: &Motion, impulse: Vector) -> Vector {
        match self.shape {
            Shape::Plate => {
                let normal = normal(motion);
                let along = normal.dot(&impulse);
                (impulse - normal * along) / self.mass + normal * (along / (self.mass + self.added))
            }
            Shape::Lump => impulse / (self.mass + self.added),
        }
    }

    /// The inverses of mass and of inertia in the axes of the world: velocity by an impulse at the centre of mass (N s), angular velocity by an
    /// impulsive moment (N m s).
    pub(crate) fn inverse_inertia(&self, motion: &Motion) -> (Matrix3<f64>, Matrix3<f64>) {
        let turn = motion.attitude.to_rotation_matrix().into_inner();
        let light = match self.shape {
            Shape::Plate => {
                let normal = turn.column(2);
                let along = 1.0 / (self.mass + self.added) - 1.0 / self.mass;
                Matrix3::identity() / self.mass + normal * normal.transpose() * along
            }
            Shape::Lump => Matrix3::identity() / (self.mass + self.added),
        };
        let agile =
            turn * Matrix3::from_diagonal(&self.inertia.map(|inertia| 1.0 / inertia)) * turn.transpose();
        (light, agile)
    }

    /// Velocity of the air at the body. Air sticks to the ground: a body that touches it feels no wind, and comes to rest.
    fn wind(&self, motion: &Motion, time: f64, wind: &impl Wind) -> Result<Vector, Error> {
        let share = match self.ground {
            None => 1.0,
            Some(ground) => {
                let x = ((motion.position.y - ground.height) / self.layer - 1.0).clamp(0.0, 1.0);
                x * x * (3.0 - 2.0 * x)
            }
        };
        if share == 0.0 {
            return Ok(Vector::zeros());
        }
        let velocity = wind.velocity(motion.position, time) * share;
        if velocity.iter().all(|value| value.is_finite()) {
            return Ok(velocity);
        }
        Err(Error::Wind { time, at: motion.position.into() })
    }

    /// Acceleration of the centre of mass (axes of the world) and of the spin (axes of the body).
    pub(crate) fn accelerations(
        &self,
        motion: &Motion,
        time: f64,
        wind: &impl Wind,
    ) -> Result<(Vector, Vector), Error> {
        let relative = motion.velocity - self.wind(motion, time, wind)?;
        let (force, torque) = match self.shape {
            Shape::Plate => self.on_plate(motion, &relative),
            Shape::Lump => self.on_lump(motion, &relative),
        };
        let force = force - Vector::y() * self.weight;
        let angular = torque.component_div(&self.inertia) + self.gyroscopic(motion);
        Ok((self.pushed(motion, force), angular))
    }

    /// Angular acceleration of free rotation.
    fn gyroscopic(&self, motion: &Motion) -> Vector {
        -motion.spin.cross(&motion.spin.component_mul(&self.inertia)).component_div(&self.inertia)
    }

    /// The spin after a time, by Euler's method. Free rotation keeps its energy, which the method alone does not.
    pub(crate) fn spun(&self, motion: &Motion, angular: Vector, h: f64) -> Vector {
        let energy = |spin: &Vector| self.inertia.dot(&spin.component_mul(spin));
        let driven = motion.spin + (angular - self.gyroscopic(motion)) * h;
        let spin = motion.spin + angular * h;
        let (wanted, found) = (energy(&driven), energy(&spin));
        if found > wanted { spin * libm::sqrt(wanted / found) } else { spin }
    }

    /// Force (axes of the world) and torque (axes of the body) of the air on a plate.
    fn on_plate(&self, motion: &Motion, relative: &Vector) -> (Vector, Vector) {
        let Air { broadside, edgewise, lift, rotation, damping, .. } = self.air;
        let normal = normal(motion);
        let along = normal.dot(relative);
        let across = relative - normal * along;
        let speed = relative.norm();
        // Rotation of the plate out of its plane.
        let planar = Vector::new(motion.spin.x, motion.spin.y, 0.0);
        let tilting = motion.turned(planar);
        let turning = tilting.cross(&normal);
        let mut force = -(turning * along + normal * turning.dot(relative)) * self.added;
        force += tilting.cross(relative) * (2.0 * rotation * self.added);
        if speed > 0.0 {
            let scale = self.added / (PI * self.half_chord);
            // |v|² C(angle), with C between those edge-on and broadside.
            let mean = (broadside + edgewise) / 2.0;
            let half = (broadside - edgewise) / 2.0;
            let drag = mean * speed - half * (across.norm_squared() - along * along) / speed;
            force -= relative * (scale * drag);
            let circulation = 2.0 * lift * scale * along / speed;
            force += (across * along - normal * across.norm_squared()) * circulation;
        }
        let munk = motion.attitude.inverse_transform_vector(&across.cross(&normal)) * (-self.added * along);
        let pace = damping[0] * self.speed / self.half_chord;
        let tilt = pace + damping[1] * planar.norm();
        // Rotation in the plane meets friction only, as translation edge-on does.
        let friction = if broadside > 0.0 { edgewise / broadside } else { 0.0 };
        let spinning = friction * (pace + damping[1] * motion.spin.z.abs());
        let arms = self.arms.component_mul(&self.arms);
        let resisted = Vector::new(tilt * motion.spin.x, tilt * motion.spin.y, spinning * motion.spin.z);
        (force, munk - resisted.component_mul(&arms) * self.added)
    }

    /// Force (axes of the world) and torque (axes of the body) of the air on a lump.
    fn on_lump(&self, motion: &Motion, relative: &Vector) -> (Vector, Vector) {
        let speed = relative.norm();
        let pressure = 0.5 * self.air.density * self.area;
        let arm = self.arms.max();
        let friction = pressure * SKIN * arm * arm * (speed + arm * motion.spin.norm());
        (-relative * (pressure * self.air.lump * speed), -motion.spin * friction)
    }

    /// Derivative of the state.
    pub(crate) fn derivative(&self, packed: &Packed, time: f64, wind: &impl Wind) -> Result<Packed, Error> {
        let motion = Motion::unpack(packed);
        let (acceleration, angular) = self.accelerations(&motion, time, wind)?;
        let spin = nalgebra::Quaternion::from_imag(motion.spin);
        let turning = motion.attitude.into_inner() * spin * 0.5;
        let mut derivative = Packed::zeros();
        derivative.fixed_rows_mut::<3>(0).copy_from(&motion.velocity);
        derivative.fixed_rows_mut::<3>(3).copy_from(&acceleration);
        derivative.fixed_rows_mut::<4>(6).copy_from(&turning.coords);
        derivative.fixed_rows_mut::<3>(10).copy_from(&angular);
        Ok(derivative)
    }
}

/// Friction coefficient of a lump that rotates, relative to its area and the speed of its surface. A choice: no reference is known for bodies that
/// travel and rotate at these Reynolds numbers.
const SKIN: f64 = 0.05;

fn normal(motion: &Motion) -> Vector {
    motion.turned(Vector::z())
}

fn square(value: f64) -> f64 {
    value * value
}
