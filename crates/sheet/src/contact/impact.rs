//! Impacts: what would meet within a step is slowed down at its beginning, so far that it meets at its end.
//!
//! The impulses are those of the non-smooth contact dynamics method (Jean, Comput. Methods Appl. Mech. Eng. 177, 1999): each contact in turn gets
//! the impulse that satisfies its law, which is `n·u ≥ -g/h` for the gap g at the start of a step of length h, and friction within its cone.
//! Each impulse is a step down of the kinetic energy within the bounds, so no energy is created, and nothing rebounds by the stiffness of a contact
//! that a step cannot resolve.

use super::{Grip, Push, Solid, distinct};
use crate::solve::Free;
use crate::{Matrix, Place, Sheet, State, Vector};

/// Largest number of sweeps over all contacts, and the change of velocities, in parts of the largest one, at which they end.
const SWEEPS: usize = 200;
const ACCURACY: f64 = 1e-6;

/// A contact that may be struck.
#[derive(Clone, Debug)]
pub(crate) struct Impact {
    solid: usize,
    points: [usize; 3],
    weights: [f64; 3],
    normal: Vector,
    /// From the origin of the solid.
    arm: Vector,
    /// The least velocity along the normal, in m/s.
    least: f64,
    friction: f64,
    /// Velocity along the normal by an impulse along it, and a bound of that along the surface, in 1/kg.
    response: [f64; 2],
    pressure: f64,
    drag: Vector,
}

/// What impulses and impulsive moments do to a solid.
struct Agility {
    light: Matrix,
    agile: Matrix,
}

/// Solids and sheet before and after impulses.
pub(crate) struct Moving<'a> {
    pub sheet: &'a Sheet,
    /// Velocities change.
    pub state: &'a mut State,
    /// The solids at the start. Velocities change.
    pub places: &'a mut [Place],
    pub numbers: &'a [Option<usize>],
    pub free: &'a [Free],
}

impl Moving<'_> {
    /// Inverse of the mass of a point; 0 if it is pinned.
    fn lightness(&self, point: usize) -> f64 {
        if self.sheet.pinned[point] { 0.0 } else { 1.0 / self.sheet.masses[point] }
    }

    /// Inverse of mass and inertia of a solid, if forces move it.
    fn agility(&self, solid: usize) -> Option<Agility> {
        let free = &self.free[self.numbers[solid]?];
        Some(match free.root {
            Some(root) => Agility { light: root * root, agile: Matrix::zeros() },
            None => {
                let light = Matrix::from_diagonal_element(1.0 / free.mass);
                Agility { light, agile: free.inertia.try_inverse().unwrap_or_else(Matrix::zeros) }
            }
        })
    }

    fn relative(&self, impact: &Impact) -> Vector {
        let v = &self.state.velocities;
        let element: Vector = (0..3).map(|k| v[impact.points[k]] * impact.weights[k]).sum();
        element - self.places[impact.solid].velocity_at(&impact.arm)
    }

    fn strike(&mut self, impact: &Impact, impulse: &Vector) {
        for k in 0..3 {
            let point = impact.points[k];
            let gain = impulse * (impact.weights[k] * self.lightness(point));
            self.state.velocities[point] += gain;
        }
        let Some(number) = self.numbers[impact.solid] else { return };
        let Some(Agility { light, agile }) = self.agility(impact.solid) else { return };
        let (place, body) = (&mut self.places[impact.solid], &mut self.state.bodies[number]);
        let turn = agile * impact.arm.cross(impulse);
        place.velocity -= light * impulse;
        place.spin -= turn;
        body.velocity -= self.free[number].root.map_or_else(|| light * impulse, |root| root * impulse);
        body.spin -= turn;
    }

    /// Finds contacts with a solid whose gap is below `margin`, for a step of length `h`.
    pub fn find(&self, (index, solid): (usize, &Solid), (margin, h): (f64, f64), found: &mut Vec<Impact>) {
        let place = &self.places[index];
        let Grip { friction, .. } = solid.grip;
        let agile = self.agility(index);
        self.sheet.elements(solid.shape, |_, points, _| {
            let corners = points.map(|point| self.state.positions[point]);
            let near = self.sheet.near(solid.shape, place, (&corners, distinct(&points)), margin);
            let Some(gap) = near.filter(|gap| gap.width <= margin) else { return };
            let weights = gap.weights;
            let point: Vector = (0..3).map(|k| corners[k] * weights[k]).sum();
            let arm = point - place.position;
            let own: f64 = (0..3).map(|k| weights[k] * weights[k] * self.lightness(points[k])).sum();
            let mut response = [own; 2];
            if let Some(Agility { light, agile }) = &agile {
                let turn = arm.cross(&gap.normal);
                response[0] += gap.normal.dot(&(light * gap.normal)) + turn.dot(&(agile * turn));
                response[1] += light.norm() + agile.trace() * arm.norm_squared();
            }
            let least = -gap.width.max(0.0) / h;
            let (normal, pressure, drag) = (gap.normal, 0.0, Vector::zeros());
            // Between what cannot move, nothing can be changed.
            if response[0] > 0.0 {
                let impact = Impact {
                    solid: index,
                    points,
                    weights,
                    normal,
                    arm,
                    least,
                    friction,
                    response,
                    pressure,
                    drag,
                };
                found.push(impact);
            }
        });
    }

    /// Strikes all contacts, and adds what the solids get to `pushes`.
    pub fn settle(&mut self, impacts: &mut [Impact], pushes: &mut [Push]) {
        let approach =
            |moving: &Self, impact: &Impact| impact.least - moving.relative(impact).dot(&impact.normal);
        let scale = impacts.iter().map(|impact| approach(&*self, impact)).fold(0.0, f64::max);
        if scale <= 0.0 {
            return;
        }
        for _ in 0..SWEEPS {
            let mut changed = 0.0_f64;
            for impact in &mut *impacts {
                changed = changed.max(self.correct(impact));
            }
            if changed <= ACCURACY * scale {
                break;
            }
        }
        for impact in impacts {
            let impulse = impact.normal * impact.pressure + impact.drag;
            let moment = impact.arm.cross(&impulse);
            pushes[impact.solid] += Push { impulse: -impulse, moment: -moment };
        }
    }

    /// Changes the impulse of a contact so that it satisfies its law, the others as they are; returns the change of its velocity.
    fn correct(&mut self, impact: &mut Impact) -> f64 {
        let short = impact.least - self.relative(impact).dot(&impact.normal);
        let pressure = (impact.pressure + short / impact.response[0]).max(0.0);
        let change = pressure - impact.pressure;
        if change != 0.0 {
            impact.pressure = pressure;
            let impulse = impact.normal * change;
            self.strike(impact, &impulse);
        }
        if impact.friction > 0.0 && (pressure > 0.0 || impact.drag != Vector::zeros()) {
            let relative = self.relative(impact);
            let along = relative - impact.normal * relative.dot(&impact.normal);
            let mut drag = impact.drag - along / impact.response[1];
            let (size, limit) = (drag.norm(), impact.friction * pressure);
            if size > limit {
                drag *= limit / size;
            }
            let impulse = drag - impact.drag;
            impact.drag = drag;
            self.strike(impact, &impulse);
        }
        change.abs() * impact.response[0]
    }
}
