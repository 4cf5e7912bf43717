//! Contact of convex solids with points, cords and faces: one mechanism for balls, hulls, and floors, guided or free.
//!
//! What would meet within a step is stopped by impulses at its beginning, without rebound. What touches presses by a contact: a stiff spring across the gap at its narrowest place, with damping and friction. It is evaluated where implicit steps need it: at the
//! places that points and solids will have after a part of the step. So steps
//! are as long as motion allows, not as short as the stiffness of the contact requires.

mod grip;
mod impact;
mod led;

use crate::error::check;
use crate::{Error, Matrix, Sheet, Vector};
pub use dlsys_solid::{Gap, Place, Shape};
pub use grip::Grip;
pub(crate) use grip::press;
pub(crate) use impact::{Impact, Moving};
pub use led::Led;

/// What moves a solid.
#[derive(Clone, Copy)]
pub enum Drive<'a> {
    /// A path: the place at each time in s. Velocities must be the derivatives of the places.
    Guided(&'a dyn Fn(f64) -> Place),
    /// The forces on it. Its place is in the state.
    Free {
        /// Mass in kg.
        mass: f64,
        /// Moments of inertia about its axes, through the centre of mass, in kg m².
        inertia: [f64; 3],
    },
    /// A path that is computed elsewhere, and what forces add to it. The deviation is in the state.
    Led(Led<'a>),
}

/// A solid that a sheet meets.
#[derive(Clone, Copy)]
pub struct Solid<'a> {
    /// Its shape.
    pub shape: &'a Shape,
    /// What moves it.
    pub drive: Drive<'a>,
    /// Forces of contacts.
    pub grip: Grip,
}

impl<'a> Solid<'a> {
    /// A solid on a path.
    pub fn guided(shape: &'a Shape, path: &'a dyn Fn(f64) -> Place) -> Solid<'a> {
        Solid { shape, drive: Drive::Guided(path), grip: Grip::default() }
    }

    /// A solid whose motion is computed elsewhere, with what forces add to it.
    pub fn led(shape: &'a Shape, led: Led<'a>) -> Solid<'a> {
        Solid { shape, drive: Drive::Led(led), grip: Grip::default() }
    }

    /// A free ball of homogeneous material with a mass in kg.
    pub fn free_ball(shape: &'a Shape, mass: f64) -> Solid<'a> {
        let inertia = 0.4 * mass * shape.radius() * shape.radius();
        Solid { shape, drive: Drive::Free { mass, inertia: [inertia; 3] }, grip: Grip::default() }
    }

    /// The same with other forces of contacts.
    pub fn with(self, grip: Grip) -> Solid<'a> {
        Solid { grip, ..self }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        self.grip.check()?;
        if let Drive::Free { mass, inertia } = self.drive {
            check("a mass of a solid (kg)", mass, mass > 0.0, "more than 0")?;
            for moment in inertia {
                check("a moment of inertia (kg m²)", moment, moment > 0.0, "more than 0")?;
            }
        }
        Ok(())
    }

    /// True if forces move it, so that the state has a place for it.
    pub(crate) fn is_free(&self) -> bool {
        !matches!(self.drive, Drive::Guided(_))
    }

    /// The force of what is no sheet on its unknowns, in N: weight, or minus the force with which its path was computed.
    pub(crate) fn load(&self, time: f64, gravity: &Vector) -> Vector {
        match self.drive {
            Drive::Guided(_) => Vector::zeros(),
            Drive::Free { mass, .. } => gravity * mass,
            Drive::Led(led) => -led.root() * led.assumed(time),
        }
    }

    /// The depth at which contacts are infinitely stiff, in m.
    fn depth(&self) -> f64 {
        self.shape.radius() / 2.0
    }

    /// The largest depth after a step, in m.
    pub(crate) fn allowed_depth(&self) -> f64 {
        0.8 * self.depth()
    }
}

/// What a sheet did to a solid in a step: the impulse in N s, and the impulsive moment about its origin in N m s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    /// Impulse in N s.
    pub impulse: Vector,
    /// Impulsive moment about the origin of the solid (its centre of mass, if it is free), in N m s.
    pub moment: Vector,
}

impl std::ops::AddAssign for Push {
    fn add_assign(&mut self, other: Push) {
        self.impulse += other.impulse;
        self.moment += other.moment;
    }
}

/// A place where an element touches a solid.
#[derive(Clone, Debug)]
pub(crate) struct Contact {
    pub solid: usize,
    /// Number of the element: faces first, cords next, then points.
    pub element: usize,
    pub points: [usize; 3],
    pub weights: [f64; 3],
    /// From the origin of the solid.
    pub arm: Vector,
    pub depth: f64,
    /// Force on the element in N.
    pub force: Vector,
    /// Minus the derivatives of the force by the relative place and velocity.
    pub stiffness: Matrix,
    pub damping: Matrix,
    /// Energy of the spring in J.
    pub energy: f64,
}

impl Contact {
    /// Relative motion of the element and the solid: of values of points, and of the solid and its turn.
    pub fn relative(&self, x: &[Vector], solid: Option<(Vector, Vector)>) -> Vector {
        let element: Vector = (0..3).map(|k| x[self.points[k]] * self.weights[k]).sum();
        match solid {
            Some((way, turn)) => element - way - turn.cross(&self.arm),
            None => element,
        }
    }

    /// Adds a force to the points.
    pub fn spread(&self, force: &Vector, forces: &mut [Vector]) {
        for k in 0..3 {
            forces[self.points[k]] += force * self.weights[k];
        }
    }
}

impl Sheet {
    /// The contacts with a solid at a place. `x` and `v` are the places and velocities of the points.
    pub(crate) fn contacts(
        &self,
        (index, solid): (usize, &Solid),
        place: &Place,
        x: &[Vector],
        v: &[Vector],
        found: &mut Vec<Contact>,
    ) {
        self.elements(solid.shape, |element, points, unit| {
            let corners = points.map(|point| x[point]);
            let Some(gap) = self.near(solid.shape, place, (&corners, distinct(&points)), 0.0) else { return };
            let depth = -gap.width;
            if depth <= 0.0 {
                return;
            }
            let weights = gap.weights;
            let point: Vector = (0..3).map(|k| corners[k] * weights[k]).sum();
            let velocity: Vector = (0..3).map(|k| v[points[k]] * weights[k]).sum();
            let arm = point - place.position;
            let relative = velocity - place.velocity_at(&arm);
            let unit = unit * solid.grip.stiffness;
            let (force, stiffness, damping, energy) = law(solid, unit, &gap.normal, depth, &relative);
            let contact = Contact {
                solid: index,
                element,
                points,
                weights,
                arm,
                depth,
                force,
                stiffness,
                damping,
                energy,
            };
            found.push(contact);
        });
    }

    /// Calls `act` with each element that a solid may touch: its number, its points (repeated if there are fewer than three), and its stiffness in N/m.
    fn elements(&self, shape: &Shape, mut act: impl FnMut(usize, [usize; 3], f64)) {
        let (faces, cords) = (self.faces.len(), self.cords.len());
        let sheet = self.tissue.stiffness * self.tissue.thickness;
        if shape.is_flat() {
            for point in 0..self.len() {
                act(faces + cords + point, [point; 3], sheet);
            }
            return;
        }
        for (index, points) in self.faces.iter().enumerate() {
            act(index, *points, sheet);
        }
        for (index, cord) in self.cords.iter().enumerate() {
            let [a, b] = cord.points;
            act(faces + index, [a, b, b], cord.stiffness);
        }
    }

    /// The gap to the surface of an element, if it may be narrower than `within`.
    fn near(
        &self,
        shape: &Shape,
        place: &Place,
        (corners, count): (&[Vector; 3], usize),
        within: f64,
    ) -> Option<Gap> {
        if !self.is_near(shape, place, corners, within) {
            return None;
        }
        let gap = shape.gap(place, &corners[..count]);
        Some(Gap { width: gap.width - 0.5 * self.tissue.thickness, ..gap })
    }

    /// Whether the balls around a solid and around an element are nearer than `within`.
    fn is_near(&self, shape: &Shape, place: &Place, corners: &[Vector; 3], within: f64) -> bool {
        let middle = corners.iter().sum::<Vector>() / 3.0;
        let size = corners.iter().map(|corner| (corner - middle).norm()).fold(0.0, f64::max);
        let half = 0.5 * self.tissue.thickness;
        (middle - place.position).norm() - size <= shape.reach() + half + within
    }

    /// The largest motion relative to a solid between two states, in m, of the corners of all elements that are nearer than `within` in one of them.
    pub(crate) fn relative_motion(&self, shape: &Shape, ends: [(&Place, &[Vector]); 2], within: f64) -> f64 {
        let [(start, x), (end, y)] = ends;
        let turn = end.attitude * start.attitude.inverse();
        let way = end.position - start.position;
        let mut most = 0.0_f64;
        self.elements(shape, |_, points, _| {
            let is_near = |(place, x): (&Place, &[Vector])| {
                let corners = points.map(|point| x[point]);
                self.is_near(shape, place, &corners, within)
            };
            if ends.into_iter().any(is_near) {
                for point in points {
                    // The solid ends at its reach, and so does what its turn moves.
                    let arm = x[point] - start.position;
                    let arm = arm * (shape.reach() / arm.norm().max(shape.reach()));
                    most = most.max((y[point] - x[point] - way - (turn * arm - arm)).norm());
                }
            }
        });
        most
    }

    /// The narrowest gap to a solid, in m; `most` if it is wider.
    pub(crate) fn narrowest(&self, shape: &Shape, place: &Place, x: &[Vector], most: f64) -> f64 {
        let mut least = most;
        self.elements(shape, |_, points, _| {
            let corners = points.map(|point| x[point]);
            if let Some(gap) = self.near(shape, place, (&corners, distinct(&points)), least) {
                least = least.min(gap.width);
            }
        });
        least
    }
}

/// Number of different points: the last one is repeated.
fn distinct(points: &[usize; 3]) -> usize {
    match points {
        [a, b, _] if a == b => 1,
        [_, b, c] if b == c => 2,
        _ => 3,
    }
}

/// Force on an element, minus its derivatives by the relative place and by the relative velocity, and energy.
fn law(
    solid: &Solid,
    unit: f64,
    normal: &Vector,
    depth: f64,
    relative: &Vector,
) -> (Vector, Matrix, Matrix, f64) {
    let Grip { friction, creep, damping, .. } = solid.grip;
    let [press, slope, energy] = press(depth, solid.depth()).map(|value| value * unit);
    let opening = relative.dot(normal);
    let factor = (1.0 - damping * opening).max(0.0);
    let pressure = press * factor;
    let along = relative - normal * opening;
    let drag = friction * pressure / along.norm().max(creep);
    let line = normal * normal.transpose();
    let resisting = if factor > 0.0 { press * damping } else { 0.0 };
    let force = normal * pressure - along * drag;
    (force, line * (slope * factor), line * resisting + (Matrix::identity() - line) * drag, energy)
}
