//! One step: two stages, of second order or as two steps of backward Euler, with impacts before them.
//!
//! The second order is that of Alexander's method (*Diagonally implicit Runge-Kutta methods for stiff ODEs*, SIAM J. Numer. Anal. 14, 1977): with
//! `s = γh` and γ = 1 - 1/√2,
//!
//! ```text
//! first stage:   x̂ = x₀,                 v̂ = v₀                    → x₁, v₁ at t + γh
//! second stage:  x̂ = x₀ + (1 - γ) h v₁,  v̂ = v₀ + (1 - γ)/γ (v₁ - v₀)  → x', v' at t + h
//! ```
//!
//! The base of the second stage continues what the first one began. That is wrong where a contact begins or ends: what the first stage stopped would
//! come back with 1.4 times its speed. There the second stage is backward Euler from the first one, `x̂ = x₁, v̂ = v₁, s = (1 - γ) h`: as the first stage is
//! backward Euler too, nothing but the second stage is computed again.

use crate::contact::{Contact, Impact, Moving};
use crate::solve::Free;
use crate::stage::{Base, Newton, touching};
use crate::{Drive, Matrix, Method, Place, Push, Rejection, Settings, Sheet, Solid, State, Vector, Wind};

/// γ: 1 - 1/√2.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// Residual of the system that weighs the error.
const ROUGH: f64 = 1e-3;

/// What surrounds a sheet.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    pub sheet: &'a Sheet,
    pub solids: &'a [Solid<'a>],
    pub wind: &'a dyn Wind,
    pub settings: &'a Settings,
}

/// Working memory of steps.
#[derive(Clone, Debug, Default)]
pub(crate) struct Workspace {
    newton: Newton,
    places: Vec<Place>,
    /// The state at the start, after impacts.
    start: State,
    /// The state after the first stage.
    middle: State,
    base: Base,
    /// Strains at the start, and after the first stage.
    strains: [Vec<f64>; 2],
    /// Whether both stages are steps of backward Euler.
    euler: bool,
    /// Contacts at one time, and what touches at the start, after the first and after the second stage.
    contacts: Vec<Contact>,
    touching: [Vec<(usize, usize)>; 3],
    impacts: Vec<Impact>,
    changes: Vec<Vector>,
    /// How far each solid and the sheet may move relative to each other, in m.
    margins: Vec<f64>,
    pub pushes: Vec<Push>,
    pub depths: Vec<f64>,
}

/// The largest error of a step: displacement in m, not a number if anything is not finite, and where.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub displacement: f64,
    pub point: usize,
}

impl Found {
    /// Takes a displacement into account. The first that is not a number stays.
    fn meet(&mut self, displacement: f64, point: usize) {
        if !self.displacement.is_nan() && (displacement.is_nan() || displacement > self.displacement) {
            *self = Found { displacement, point };
        }
    }
}

/// The place of each solid.
pub(crate) fn places(solids: &[Solid], time: f64, bodies: &[Place], out: &mut Vec<Place>) {
    out.clear();
    let mut bodies = bodies.iter();
    for solid in solids {
        out.extend(match solid.drive {
            Drive::Guided(path) => Some(path(time)),
            Drive::Free { .. } => bodies.next().copied(),
            Drive::Led(led) => bodies.next().map(|deviation| led.place(time, deviation)),
        });
    }
}

/// By how much a path is faster in a step of length h, or at its end, than at its beginning.
fn later(solid: &Solid, [start, end]: [Place; 2], h: f64) -> f64 {
    let faster = (end.velocity - start.velocity).norm();
    faster.max((end.position - start.position).norm() / h - start.velocity.norm()) + turning(solid, end.spin)
}

/// The largest speed of a solid by its spin. A floor does not turn.
fn turning(solid: &Solid, spin: Vector) -> f64 {
    if solid.shape.is_flat() { 0.0 } else { spin.norm() * solid.shape.reach() }
}

/// The inertia about the axes of the world.
pub(crate) fn inertia(solid: &Solid, place: &Place) -> Option<Free> {
    match solid.drive {
        Drive::Guided(_) => None,
        Drive::Led(led) => Some(Free { mass: 1.0, inertia: Matrix::identity(), root: Some(led.root()) }),
        Drive::Free { mass, inertia } => {
            let axes = place.attitude.to_rotation_matrix().into_inner();
            let inertia = axes * Matrix::from_diagonal(&Vector::from(inertia)) * axes.transpose();
            Some(Free { mass, inertia, root: None })
        }
    }
}

impl Workspace {
    /// A step of length `h` from `before` to `after`.
    pub fn step(
        &mut self,
        around: Around,
        (time, h): (f64, f64),
        before: &State,
        after: &mut State,
    ) -> Result<Found, Rejection> {
        self.begin(around, time, h, before)?;
        self.strike(around, h, before);
        let start = std::mem::take(&mut self.start);
        let found = self.stages(around, (time, h), &start, after);
        self.start = start;
        found?;
        self.measure(around, (time, h), before, after)
    }

    /// Both stages, from the state after impacts.
    fn stages(
        &mut self,
        around: Around,
        (time, h): (f64, f64),
        start: &State,
        after: &mut State,
    ) -> Result<(), Rejection> {
        let Around { sheet, solids, .. } = around;
        let (first, second) = (GAMMA * h, (1.0 - GAMMA) * h);
        self.contacts.clear();
        for (index, solid) in solids.iter().enumerate() {
            let place = &self.places[index];
            sheet.contacts((index, solid), place, &start.positions, &start.velocities, &mut self.contacts);
        }
        touching(&self.contacts, &mut self.touching[0]);
        sheet.strains(&start.positions, &mut self.strains[0]);
        let base = &mut self.base;
        base.positions.clone_from(&start.positions);
        base.velocities.clone_from(&start.velocities);
        base.bodies.clone_from(&start.bodies);
        base.strains.clone_from(&self.strains[0]);
        base.momenta.clear();
        base.momenta
            .extend(self.newton.free.iter().zip(&start.bodies).map(|(free, body)| free.inertia * body.spin));
        let momenta = base.momenta.clone();
        let middle = &mut self.middle;
        middle.clone_from(start);
        self.newton.solve(around, (time + first, first), base, middle)?;
        self.newton.touching(&mut self.touching[1]);
        let pushed = self.pushes.clone();
        self.newton.push(sheet.len(), first, second, &mut self.pushes);
        sheet.strains(&middle.positions, &mut self.strains[1]);
        let turned: Vec<Vector> = middle
            .bodies
            .iter()
            .zip(&self.newton.free)
            .map(|(body, free)| free.inertia * body.spin)
            .collect();
        self.euler = around.settings.method == Method::Euler || self.touching[0] != self.touching[1];
        if !self.euler {
            let gain = (1.0 - GAMMA) / GAMMA;
            for k in 0..sheet.len() {
                let (x, v, w) = (start.positions[k], start.velocities[k], middle.velocities[k]);
                base.positions[k] = x + w * second;
                base.velocities[k] = v + (w - v) * gain;
            }
            for (number, base) in base.bodies.iter_mut().enumerate() {
                let (body, moved) = (&start.bodies[number], &middle.bodies[number]);
                *base = body.after(moved.velocity * second, moved.spin * second);
                base.velocity = body.velocity + (moved.velocity - body.velocity) * gain;
            }
            for (base, (then, now)) in base.momenta.iter_mut().zip(momenta.iter().zip(&turned)) {
                *base = then + (now - then) * gain;
            }
            for (base, (then, now)) in
                base.strains.iter_mut().zip(self.strains[0].iter().zip(&self.strains[1]))
            {
                *base = then + (now - then) * gain;
            }
            after.clone_from(middle);
            self.newton.solve(around, (time + h, first), base, after)?;
            self.newton.touching(&mut self.touching[2]);
            self.euler = self.touching[2] != self.touching[1];
            if !self.euler {
                self.newton.push(sheet.len(), first, first, &mut self.pushes);
                return Ok(());
            }
        }
        base.positions.clone_from(&middle.positions);
        base.velocities.clone_from(&middle.velocities);
        base.bodies.clone_from(&middle.bodies);
        base.momenta = turned;
        base.strains.clone_from(&self.strains[1]);
        // The push of the first stage counts for its own length.
        let share = first / second;
        for (push, before) in self.pushes.iter_mut().zip(&pushed) {
            push.impulse = before.impulse + (push.impulse - before.impulse) * share;
            push.moment = before.moment + (push.moment - before.moment) * share;
        }
        after.clone_from(middle);
        self.newton.solve(around, (time + h, second), base, after)?;
        self.newton.touching(&mut self.touching[2]);
        self.newton.push(sheet.len(), second, second, &mut self.pushes);
        // What no contact touches falls as from rest: the place is exact.
        let untouched = |solid: usize| self.touching[1..].iter().flatten().all(|contact| contact.0 != solid);
        for (solid, number) in self.newton.numbers.iter().enumerate() {
            if let Some(number) = number.filter(|_| untouched(solid)) {
                let body = &start.bodies[number];
                let mean = |part: f64| {
                    let load = solids[solid].load(time + part * h, &around.settings.air.gravity);
                    load / self.newton.free[number].mass
                };
                // A load that is linear in time counts as in its first third.
                let fall = mean(1.0 / 3.0) * (0.5 * h * h);
                after.bodies[number].position = body.position + body.velocity * h + fall;
                after.bodies[number].velocity = body.velocity + mean(0.5) * h;
            }
        }
        Ok(())
    }

    /// Impulses of impacts, on a copy of the state.
    fn strike(&mut self, around: Around, h: f64, before: &State) {
        let Around { sheet, solids, .. } = around;
        self.pushes.clear();
        self.pushes.resize(solids.len(), Push::default());
        self.start.clone_from(before);
        let Workspace { start: state, places, newton, impacts, margins, pushes, .. } = self;
        let Newton { numbers, free, .. } = newton;
        let mut moving = Moving { sheet, state, places, numbers, free };
        impacts.clear();
        for (index, solid) in solids.iter().enumerate() {
            moving.find((index, solid), (margins[index], h), impacts);
        }
        moving.settle(impacts, pushes);
    }

    /// Sizes, free solids, and whether contacts can be found in a step of this length.
    fn begin(&mut self, around: Around, time: f64, h: f64, before: &State) -> Result<(), Rejection> {
        let Around { sheet, solids, .. } = around;
        places(solids, time, &before.bodies, &mut self.places);
        let Newton { numbers, free, .. } = &mut self.newton;
        numbers.clear();
        free.clear();
        for (solid, place) in solids.iter().zip(&self.places) {
            let found = inertia(solid, place);
            numbers.push(found.map(|_| free.len()));
            free.extend(found);
        }
        self.margins.clear();
        for (index, (solid, place)) in solids.iter().zip(&self.places).enumerate() {
            let radius = solid.shape.radius();
            let now = before.velocities.iter().map(|v| (v - place.velocity).norm_squared());
            let later = match solid.drive {
                Drive::Guided(path) => later(solid, [*place, path(time + h)], h),
                Drive::Led(led) => {
                    later(solid, [time, time + h].map(|time| led.path(time)), h)
                        + (led.root() * solid.load(time, &Vector::zeros())).norm() * h
                }
                Drive::Free { .. } => around.settings.air.gravity.norm() * h,
            };
            let speed = now.fold(0.0, f64::max).sqrt() + turning(solid, place.spin) + later.max(0.0);
            let moved = speed * h;
            self.margins.push(moved);
            if moved > radius && moved > sheet.narrowest(solid.shape, place, &before.positions, moved) {
                return Err(Rejection::Fast { solid: index, moved });
            }
        }
        Ok(())
    }

    /// Depths at the end, whether they and the relative motion are allowed, and the estimate of the error.
    fn measure(
        &mut self,
        around: Around,
        (time, h): (f64, f64),
        before: &State,
        after: &State,
    ) -> Result<Found, Rejection> {
        let found = self.estimate(around, h, after)?;
        if found.displacement.is_nan() {
            return Ok(found);
        }
        let Around { sheet, solids, .. } = around;
        self.depths.clear();
        let mut start = Vec::new();
        places(solids, time, &before.bodies, &mut start);
        places(solids, time + h, &after.bodies, &mut self.places);
        let mut ends = Vec::new();
        for (index, solid) in solids.iter().enumerate() {
            let place = &self.places[index];
            ends.clear();
            sheet.contacts((index, solid), place, &after.positions, &after.velocities, &mut ends);
            let depth = ends.iter().map(|contact| contact.depth).fold(0.0, f64::max);
            self.depths.push(depth);
            // What gets deeper fast must not use up the room that is left: shorter steps have impacts more often.
            let touching = self.contacts.iter().filter(|contact| contact.solid == index);
            let known = touching.map(|contact| contact.depth).fold(0.0, f64::max);
            let allowed = solid.allowed_depth();
            let is_fast = depth > 0.5 * allowed && depth - known > 0.2 * (allowed - known).max(0.0);
            if depth > allowed || is_fast && depth > known {
                return Err(Rejection::Deep { solid: index, depth });
            }
            let radius = solid.shape.radius();
            if radius.is_infinite() {
                continue;
            }
            // Less than the smallest width of the solid: what was on one side is not on the other now.
            let states = [(&start[index], &before.positions[..]), (place, &after.positions[..])];
            let moved = sheet.relative_motion(solid.shape, states, radius);
            if moved > 1.5 * radius {
                return Err(Rejection::Fast { solid: index, moved });
            }
        }
        Ok(found)
    }

    /// The difference to the result of order 1. That of velocities passes the matrix once more: what is stiff would be overestimated.
    fn estimate(&mut self, around: Around, h: f64, after: &State) -> Result<Found, Rejection> {
        let Around { sheet, settings, .. } = around;
        let points = sheet.len();
        let (first, second) = (GAMMA * h, (1.0 - GAMMA) * h);
        let euler = self.euler;
        let mut found = Found { displacement: 0.0, point: 0 };
        // Differences of places and of velocities, from velocities at the start, in the middle and at the end.
        let errors = |v: Vector, w: Vector, u: Vector| {
            if euler {
                let way = (w - v) * (0.5 * first) + (u - w) * (0.5 * second);
                (way, ((u - w) / second - (w - v) / first) * (0.5 * h))
            } else {
                let gain = 1.0 / GAMMA;
                ((u - w) * first, u - v - (w - v) * gain)
            }
        };
        self.changes.clear();
        for k in 0..points {
            let (way, change) =
                errors(self.start.velocities[k], self.middle.velocities[k], after.velocities[k]);
            found.meet(way.norm(), k);
            self.changes.push(change);
        }
        let bodies = self.start.bodies.iter().zip(&self.middle.bodies).zip(&after.bodies);
        for (number, ((v, w), u)) in bodies.enumerate() {
            let (way, change) = errors(v.velocity, w.velocity, u.velocity);
            found.meet(self.newton.free[number].way(&way).norm(), points + number);
            self.changes.extend([change, errors(v.spin, w.spin, u.spin).1]);
        }
        if settings.fixed || !found.displacement.is_finite() {
            return Ok(found);
        }
        // Where solids touch, velocities of points jump, and no step is short enough for them; they count as what they move in the step itself.
        let touching = self.touching.iter().any(|contacts| !contacts.is_empty());
        let span = if touching { h } else { settings.longest };
        let length = if euler { second } else { first };
        self.newton.smooth(around, length, &mut self.changes, ROUGH)?;
        for (k, value) in self.changes[..points].iter().enumerate() {
            found.meet(value.norm() * span, k);
        }
        for number in 0..self.start.bodies.len() {
            let change = self.newton.free[number].way(&self.changes[points + 2 * number]);
            found.meet(change.norm() * settings.longest, points + number);
        }
        Ok(found)
    }

    /// Iterations of linear systems so far.
    pub fn iterations(&self) -> u64 {
        self.newton.iterations
    }
}
