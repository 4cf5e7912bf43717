//! One step of ROS2 with contacts and free solids.

use crate::contact::{Contact, Impact, Moving};
use crate::elastic::{Assembly, Weights};
use crate::matrix::Blocks;
use crate::solve::{Bodies, Free, Scratch, System};
use crate::{Drive, Matrix, Place, Push, Rejection, Settings, Sheet, Solid, State, Vector, Wind};

/// γ of ROS2: 1 - 1/√2.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// Residual of the systems of both stages, relative to the right-hand side, and of the system that weighs the error.
const ACCURACY: f64 = 1e-10;
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
    numbers: Vec<Option<usize>>,
    free: Vec<Free>,
    stiffness: Blocks,
    blocks: Blocks,
    scratch: Scratch,
    forces: Vec<Vector>,
    right: Vec<Vector>,
    bent: Vec<Vector>,
    first: Vec<Vector>,
    second: Vec<Vector>,
    middle: State,
    contacts: Vec<Contact>,
    late: Vec<Contact>,
    places: Vec<Place>,
    /// The state at the start, after impacts.
    start: State,
    impacts: Vec<Impact>,
    /// How far each solid and the sheet may move relative to each other, in m.
    margins: Vec<f64>,
    pub pushes: Vec<Push>,
    pub depths: Vec<f64>,
    pub iterations: u64,
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
fn places(solids: &[Solid], time: f64, bodies: &[Place], out: &mut Vec<Place>) {
    out.clear();
    let mut bodies = bodies.iter();
    for solid in solids {
        out.extend(match solid.drive {
            Drive::Guided(path) => Some(path(time)),
            Drive::Free { .. } => bodies.next().copied(),
        });
    }
}

/// The largest speed of a solid by its spin. A floor does not turn.
fn turning(solid: &Solid, spin: Vector) -> f64 {
    if solid.shape.is_flat() { 0.0 } else { spin.norm() * solid.shape.reach() }
}

/// The inertia about the axes of the world.
fn inertia(solid: &Solid, place: &Place) -> Option<Free> {
    let Drive::Free { mass, inertia } = solid.drive else { return None };
    let axes = place.attitude.to_rotation_matrix().into_inner();
    Some(Free { mass, inertia: axes * Matrix::from_diagonal(&Vector::from(inertia)) * axes.transpose() })
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
        before: &State,
        after: &mut State,
    ) -> Result<(), Rejection> {
        let curb = GAMMA * (0.5 - GAMMA) * h * h;
        self.assemble(around, time, h, before);
        self.first = self.solve(around, h, ACCURACY)?;
        // The second stage has the contacts of both.
        self.middle(around, h, before);
        self.late = self.mid_forces(around, time, h);
        join(&mut self.contacts, &self.late);
        self.differ(around, h, curb);
        self.second = self.solve(around, h, ACCURACY)?;
        self.push(around, h, curb);
        self.finish(around, h, before, after);
        Ok(())
    }

    /// Impulses of impacts, on a copy of the state.
    fn strike(&mut self, around: Around, h: f64, before: &State) {
        let Around { sheet, solids, .. } = around;
        self.pushes.clear();
        self.pushes.resize(solids.len(), Push::default());
        self.start.clone_from(before);
        let Workspace { start: state, places, numbers, free, impacts, margins, pushes, .. } = self;
        let mut moving = Moving { sheet, state, places, numbers, free };
        impacts.clear();
        for (index, solid) in solids.iter().enumerate() {
            moving.find((index, solid), (margins[index], h), impacts);
        }
        moving.settle(impacts, pushes);
    }

    /// Solves the system of the step with the contacts of the stage for `right`.
    fn solve(&mut self, around: Around, h: f64, accuracy: f64) -> Result<Vec<Vector>, Rejection> {
        let (sheet, step) = (around.sheet, GAMMA * h);
        let system = System {
            pattern: &sheet.pattern,
            blocks: &self.blocks,
            pinned: &sheet.pinned,
            contacts: &self.contacts,
            numbers: &self.numbers,
            free: &self.free,
            weights: (step * step, step),
        };
        let mut x = Vec::new();
        let solved =
            system.solve(&self.right, &mut x, &mut self.scratch, (accuracy, around.settings.iterations));
        let iterations = solved.map_err(|iterations| Rejection::Unsolved { iterations })?;
        self.iterations += iterations as u64;
        Ok(x)
    }

    /// The right-hand side of the second stage, from the forces in the middle and the first stage.
    fn differ(&mut self, around: Around, h: f64, curb: f64) {
        let (sheet, points) = (around.sheet, around.sheet.len());
        self.right.clear();
        self.right.extend(self.forces.iter().map(|force| force * h));
        self.bent.resize(points, Vector::zeros());
        self.stiffness.multiply(&sheet.pattern, &self.first[..points], &mut self.bent);
        for k in 0..points {
            self.right[k] -= self.first[k] * sheet.masses[k] + self.bent[k] * curb;
        }
        for (number, free) in self.free.iter().enumerate() {
            let start = points + 2 * number;
            self.right[start] -= self.first[start] * free.mass;
            self.right[start + 1] -= free.inertia * self.first[start + 1];
        }
        let bodies = Bodies { points, numbers: &self.numbers };
        bodies.resist(&self.contacts, |contact| contact.stiffness * curb, &self.first, &mut self.right);
    }

    /// Sizes, free solids, and whether contacts can be found in a step of this length.
    fn begin(&mut self, around: Around, time: f64, h: f64, before: &State) -> Result<(), Rejection> {
        let Around { sheet, solids, .. } = around;
        places(solids, time, &before.bodies, &mut self.places);
        self.numbers.clear();
        self.free.clear();
        for (solid, place) in solids.iter().zip(&self.places) {
            let free = inertia(solid, place);
            self.numbers.push(free.map(|_| self.free.len()));
            self.free.extend(free);
        }
        self.margins.clear();
        for (index, (solid, place)) in solids.iter().zip(&self.places).enumerate() {
            let radius = solid.shape.radius();
            let now = before.velocities.iter().map(|v| (v - place.velocity).norm_squared());
            let later = match solid.drive {
                Drive::Guided(path) => {
                    let end = path(time + h);
                    (end.velocity - place.velocity)
                        .norm()
                        .max((end.position - place.position).norm() / h - place.velocity.norm())
                        + turning(solid, end.spin)
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

    /// Forces and matrices of the first stage.
    fn assemble(&mut self, around: Around, time: f64, h: f64, before: &State) {
        let Around { sheet, solids, wind, settings } = around;
        let (points, step) = (sheet.len(), GAMMA * h);
        let (x, v) = (&before.positions, &before.velocities);
        self.forces.clear();
        self.forces.resize(points + 2 * self.free.len(), Vector::zeros());
        self.stiffness.clear(&sheet.pattern);
        self.blocks.clear(&sheet.pattern);
        for (block, mass) in self.blocks.diagonal.iter_mut().zip(&sheet.masses) {
            *block = Matrix::from_diagonal_element(*mass);
        }
        let weights = Weights { delay: sheet.tissue.delay(), stiffness: step * step, damping: step };
        let mut assembly =
            Assembly { forces: &mut self.forces, stiffness: &mut self.stiffness, step: &mut self.blocks };
        sheet.assemble_elastic(x, v, &weights, &mut assembly);
        sheet.assemble_loads(&settings.air, wind, time, (x, v), &weights, &mut assembly);
        // Contacts at the places that are predicted for the stage.
        let middle = &mut self.middle;
        middle.positions.clear();
        middle.positions.extend(x.iter().zip(v).map(|(x, v)| x + v * step));
        middle.bodies.clear();
        middle
            .bodies
            .extend(before.bodies.iter().map(|body| body.after(body.velocity * step, body.spin * step)));
        places(solids, time + step, &middle.bodies, &mut self.places);
        self.contacts.clear();
        for (index, solid) in solids.iter().enumerate() {
            let place = &self.places[index];
            sheet.contacts((index, solid), place, &middle.positions, v, &mut self.contacts);
        }
        let contacts = std::mem::take(&mut self.contacts);
        self.act(settings, &contacts, before);
        self.contacts = contacts;
        self.bent.resize(points, Vector::zeros());
        self.stiffness.multiply(&sheet.pattern, v, &mut self.bent);
        self.right.clear();
        self.right.extend(self.forces.iter().map(|force| force * h));
        for (right, bent) in self.right.iter_mut().zip(&self.bent) {
            *right -= bent * (step * h);
        }
    }

    /// Adds forces of contacts, and of weight and gyration on free solids.
    fn act(&mut self, settings: &Settings, contacts: &[Contact], state: &State) {
        let points = self.forces.len() - 2 * self.free.len();
        for (number, (free, body)) in self.free.iter().zip(&state.bodies).enumerate() {
            let start = points + 2 * number;
            self.forces[start] = settings.air.gravity * free.mass;
            self.forces[start + 1] = -body.spin.cross(&(free.inertia * body.spin));
        }
        for contact in contacts {
            contact.spread(&contact.force, &mut self.forces);
            if let Some(number) = self.numbers[contact.solid] {
                let start = points + 2 * number;
                self.forces[start] -= contact.force;
                self.forces[start + 1] -= contact.arm.cross(&contact.force);
            }
        }
    }

    /// The predicted state in the middle of the step.
    fn middle(&mut self, around: Around, h: f64, before: &State) {
        let points = around.sheet.len();
        let ways = |v: Vector, k: Vector| (v * h + k * (GAMMA * h)) * 0.5;
        let (middle, first) = (&mut self.middle, &self.first);
        middle.positions.clear();
        middle.velocities.clear();
        for (k, gain) in first[..points].iter().enumerate() {
            let v = before.velocities[k];
            let held = around.sheet.pinned[k];
            let way = if held { Vector::zeros() } else { ways(v, *gain) };
            middle.positions.push(before.positions[k] + way);
            middle.velocities.push(v + gain * 0.5);
        }
        middle.bodies.clear();
        for (number, body) in before.bodies.iter().enumerate() {
            let [push, turn] = [0, 1].map(|k| first[points + 2 * number + k]);
            let mut moved = body.after(ways(body.velocity, push), ways(body.spin, turn));
            moved.velocity += push * 0.5;
            moved.spin += turn * 0.5;
            middle.bodies.push(moved);
        }
    }

    /// Forces in the middle of the step; returns the contacts there.
    fn mid_forces(&mut self, around: Around, time: f64, h: f64) -> Vec<Contact> {
        let Around { sheet, solids, wind, settings } = around;
        let middle = std::mem::take(&mut self.middle);
        let (x, v) = (&middle.positions, &middle.velocities);
        let mut late = std::mem::take(&mut self.late);
        late.clear();
        places(solids, time + 0.5 * h, &middle.bodies, &mut self.places);
        for (index, solid) in solids.iter().enumerate() {
            sheet.contacts((index, solid), &self.places[index], x, v, &mut late);
        }
        self.forces.iter_mut().for_each(|force| *force = Vector::zeros());
        let (start, turned) = (self.free.clone(), self.turned(solids));
        self.free = turned;
        sheet.elastic_forces(x, v, &mut self.forces[..sheet.len()]);
        sheet.loads(&settings.air, wind, time + 0.5 * h, x, v, &mut self.forces[..sheet.len()]);
        self.act(settings, &late, &middle);
        // The spin changes by the inertia in the middle, but the matrix has that of the start.
        for (number, (now, then)) in self.free.iter().zip(&start).enumerate() {
            let moment = &mut self.forces[sheet.len() + 2 * number + 1];
            if let Some(inverse) = now.inertia.try_inverse().filter(|_| now.inertia != then.inertia) {
                *moment = then.inertia * (inverse * *moment);
            }
        }
        self.free = start;
        self.middle = middle;
        late
    }

    fn turned(&self, solids: &[Solid]) -> Vec<Free> {
        solids.iter().zip(&self.places).filter_map(|(solid, place)| inertia(solid, place)).collect()
    }

    /// Impulses on the solids: those that the contacts gave to the sheet, with the other sign.
    fn push(&mut self, around: Around, h: f64, curb: f64) {
        let points = around.sheet.len();
        let step = GAMMA * h;
        let mut add = |contact: &Contact, impulse: Vector| {
            let moment = contact.arm.cross(&impulse);
            self.pushes[contact.solid] += Push { impulse: -impulse, moment: -moment };
        };
        for contact in &self.late {
            add(contact, contact.force * h);
        }
        let bodies = Bodies { points, numbers: &self.numbers };
        for contact in &self.contacts {
            let [first, second] = [&self.first, &self.second].map(|x| bodies.relative(contact, x));
            let block = contact.stiffness * (step * step) + contact.damping * step;
            add(contact, -(block * second) - contact.stiffness * (first * curb));
        }
    }

    /// The state at the end.
    fn finish(&self, around: Around, h: f64, before: &State, after: &mut State) {
        let (points, step) = (around.sheet.len(), GAMMA * h);
        let (first, second) = (&self.first, &self.second);
        let way =
            |v: Vector, k: usize| v * h + (first[k] + second[k]) * step + first[k] * (h * (0.5 - GAMMA));
        after.positions.clear();
        after.velocities.clear();
        for k in 0..points {
            let (x, v) = (before.positions[k], before.velocities[k]);
            let held = around.sheet.pinned[k];
            after.positions.push(if held { x } else { x + way(v, k) });
            after.velocities.push(if held { Vector::zeros() } else { v + first[k] + second[k] });
        }
        after.bodies.clear();
        for (number, body) in before.bodies.iter().enumerate() {
            let start = points + 2 * number;
            let mut moved = body.after(way(body.velocity, start), way(body.spin, start + 1));
            moved.velocity += first[start] + second[start];
            moved.spin += first[start + 1] + second[start + 1];
            after.bodies.push(moved);
        }
    }

    /// Depths at the end, whether they and the relative motion are allowed, and the estimate of the error.
    fn measure(
        &mut self,
        around: Around,
        (time, h): (f64, f64),
        before: &State,
        after: &State,
    ) -> Result<Found, Rejection> {
        let found = self.estimate(around, h)?;
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
            if depth > solid.allowed_depth() {
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
    fn estimate(&mut self, around: Around, h: f64) -> Result<Found, Rejection> {
        let Around { sheet, settings, .. } = around;
        let points = sheet.len();
        let mut found = Found { displacement: 0.0, point: 0 };
        let way = |k: usize| (self.second[k] * (GAMMA * h) + self.first[k] * (h * (0.5 - GAMMA))).norm();
        (0..points).for_each(|k| found.meet(way(k), k));
        (0..self.free.len()).for_each(|number| found.meet(way(points + 2 * number), points + number));
        if settings.fixed || !found.displacement.is_finite() {
            return Ok(found);
        }
        self.right.clear();
        self.right.extend(self.second.iter().zip(&sheet.masses).map(|(z, mass)| z * *mass));
        for (number, free) in self.free.iter().enumerate() {
            let [push, turn] = [0, 1].map(|k| self.second[points + 2 * number + k]);
            self.right.extend([push * free.mass, free.inertia * turn]);
        }
        let error = self.solve(around, h, ROUGH)?;
        for (k, value) in error[..points].iter().enumerate() {
            found.meet(value.norm() * settings.longest, k);
        }
        for number in 0..self.free.len() {
            found.meet(error[points + 2 * number].norm() * settings.longest, points + number);
        }
        Ok(found)
    }
}

/// Adds those of `late` whose solid and element are not in `contacts`. Both are sorted by solid and element.
fn join(contacts: &mut Vec<Contact>, late: &[Contact]) {
    let key = |contact: &Contact| (contact.solid, contact.element);
    let known = contacts.len();
    for contact in late {
        if contacts[..known].binary_search_by_key(&key(contact), key).is_err() {
            contacts.push(contact.clone());
        }
    }
    contacts.sort_by_key(key);
}
