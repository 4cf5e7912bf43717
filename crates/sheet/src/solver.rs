//! The solver: steps on a global grid, of controlled error.

use crate::contact::Contact;
use crate::step::{Around, Workspace};
use crate::{Drive, Energy, Error, Push, Rejection, Settings, Sheet, Solid, State, Step, Vector, Wind};

/// Advances states. Holds working memory only: results do not depend on what it did before.
#[derive(Clone, Debug, Default)]
pub struct Solver {
    /// How it works.
    pub settings: Settings,
    /// When it stops with [`Error::OutOfTime`], if ever.
    pub deadline: Option<std::time::Instant>,
    work: Workspace,
    trial: State,
    counts: Counts,
}

/// What a solver has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Steps accepted.
    pub steps: u64,
    /// Steps rejected.
    pub rejected: u64,
    /// Iterations of linear systems.
    pub iterations: u64,
}

impl Solver {
    /// A solver with settings.
    pub fn new(settings: Settings) -> Solver {
        Solver { settings, ..Solver::default() }
    }

    /// What it did since it was made.
    pub fn counts(&self) -> Counts {
        Counts { iterations: self.work.iterations(), ..self.counts }
    }

    /// Advances a state over a span of time (s), shows each accepted step to `observe`, and returns what the sheet did to each solid in sum. Divided by
    /// the time, these are the mean force and moment.
    ///
    /// Steps have the length H/2^m and end at multiples of it, or at that of the span, so their ends depend on the settings, the span and
    /// the state only.
    ///
    /// # Errors
    ///
    /// [`Error::Value`] if a value is out of range, [`Error::State`] if the state does not fit, [`Error::Step`] if the shortest step is too long for the
    /// tolerance or for the contacts, [`Error::Steps`] if there are too many, [`Error::Solve`] if a linear system is not solved, [`Error::OutOfTime`]
    /// after the deadline. The state is then that of the last accepted step.
    pub fn advance(
        &mut self,
        sheet: &Sheet,
        state: &mut State,
        span: std::ops::Range<f64>,
        solids: &[Solid],
        wind: &dyn Wind,
        mut observe: impl FnMut(&Step<'_>),
    ) -> Result<Vec<Push>, Error> {
        let settings = self.settings;
        let around = Around { sheet, solids, wind, settings: &settings };
        let (from, to) = (span.start, span.end);
        check(around, state, from)?;
        let mut pushes = vec![Push::default(); solids.len()];
        let tried = |counts: Counts| counts.steps + counts.rejected;
        let spans = ((to - from) / settings.longest).ceil().max(1.0);
        let limit = tried(self.counts).saturating_add((settings.most as f64 * spans) as u64);
        let mut time = from;
        // The last one, if the steps become too many.
        let mut cause = Rejection::None;
        while time < to {
            let end = self.step(around, state, (time, to), &mut cause)?;
            if tried(self.counts) > limit {
                return Err(Error::Steps { time, step: end - time, most: settings.most, cause });
            }
            if self.deadline.is_some_and(|deadline| std::time::Instant::now() > deadline) {
                return Err(Error::OutOfTime { time });
            }
            let (made, depths) = (&self.work.pushes, &self.work.depths);
            observe(&Step { from: time, to: end, before: state, after: &self.trial, pushes: made, depths });
            pushes.iter_mut().zip(made).for_each(|(sum, push)| *sum += *push);
            std::mem::swap(state, &mut self.trial);
            time = end;
        }
        Ok(pushes)
    }

    /// One accepted step, at most to `limit`; the new state is in `trial`. Returns its end.
    fn step(
        &mut self,
        around: Around,
        state: &State,
        (time, limit): (f64, f64),
        cause: &mut Rejection,
    ) -> Result<f64, Error> {
        let Settings { longest, deepest, fixed, tolerance, .. } = self.settings;
        let mut level = if fixed { 0 } else { state.level.min(deepest) };
        loop {
            let length = longest / f64::from(level).exp2();
            let end = next_time(time, length, limit);
            let h = end - time;
            let found = self.work.step(around, (time, h), state, &mut self.trial);
            let allowed = tolerance * around.sheet.extent();
            let by = match found {
                Ok(found) => {
                    let excess = found.displacement / allowed;
                    if excess <= 1.0 || fixed && excess.is_finite() {
                        self.counts.steps += 1;
                        self.trial.level = self.next_level(level, excess, end);
                        return Ok(end);
                    }
                    *cause = Rejection::Error { point: found.point, excess };
                    deeper(excess)
                }
                Err(rejection) => {
                    *cause = rejection;
                    let by = match rejection {
                        Rejection::Fast { solid, moved } => {
                            (moved / around.solids[solid].shape.radius()).log2()
                        }
                        _ => 1.0,
                    };
                    by.ceil().clamp(1.0, 8.0) as u32
                }
            };
            self.counts.rejected += 1;
            let unsolved =
                if let Rejection::Unsolved { iterations } = *cause { Some(iterations) } else { None };
            if level >= deepest || time + 0.5 * h <= time {
                return Err(match unsolved {
                    Some(iterations) => Error::Solve { time, step: h, iterations },
                    None => Error::Step { time, step: h, cause: *cause },
                });
            }
            level = (level + by).min(deepest);
        }
    }

    /// The level of the next step: one less if the error leaves room for it and the grid of longer steps has a point at `end`.
    fn next_level(&self, level: u32, excess: f64, end: f64) -> u32 {
        if self.settings.fixed || level == 0 || excess * 6.4 >= 1.0 {
            return level;
        }
        let longer = self.settings.longest / f64::from(level - 1).exp2();
        let aligned =
            (end / longer).fract() == 0.0 || next_time(end, longer, f64::INFINITY) - end > 0.5 * longer;
        if aligned { level - 1 } else { level }
    }

    /// Energies of a state at a time (s). Solids that are led have none: their mass is not known here.
    pub fn energy(&self, sheet: &Sheet, state: &State, time: f64, solids: &[Solid]) -> Energy {
        let gravity = self.settings.air.gravity;
        let mut energy = Energy { elastic: sheet.elastic_energy(&state.positions), ..Energy::default() };
        for k in 0..sheet.len() {
            let mass = sheet.masses[k];
            energy.weight -= mass * gravity.dot(&state.positions[k]);
            if !sheet.pinned[k] {
                energy.kinetic += 0.5 * mass * state.velocities[k].norm_squared();
            }
        }
        let mut bodies = state.bodies.iter();
        let mut contacts: Vec<Contact> = Vec::new();
        for (index, solid) in solids.iter().enumerate() {
            let place = match solid.drive {
                Drive::Guided(path) => path(time),
                Drive::Free { mass, inertia } => {
                    let Some(body) = bodies.next() else { continue };
                    let spin = body.attitude.inverse_transform_vector(&body.spin);
                    energy.weight -= mass * gravity.dot(&body.position);
                    energy.kinetic += 0.5 * mass * body.velocity.norm_squared();
                    energy.kinetic += 0.5 * spin.component_mul(&spin).dot(&Vector::from(inertia));
                    *body
                }
                Drive::Led(led) => {
                    let Some(body) = bodies.next() else { continue };
                    led.place(time, body)
                }
            };
            sheet.contacts((index, solid), &place, &state.positions, &state.velocities, &mut contacts);
        }
        energy.contact = contacts.iter().map(|contact| contact.energy).sum();
        energy
    }
}

/// How many levels deeper a step with too large an error is tried again: 1 to 4.
fn deeper(excess: f64) -> u32 {
    if !excess.is_finite() {
        return 4;
    }
    (excess.log2() / 2.0).ceil().clamp(1.0, 4.0) as u32
}

fn check(around: Around, state: &State, time: f64) -> Result<(), Error> {
    let Around { sheet, solids, settings, .. } = around;
    settings.check()?;
    let (points, bodies) = (sheet.len(), solids.iter().filter(|solid| solid.is_free()).count());
    let short = state.positions.len().min(state.velocities.len());
    if short != points || state.positions.len() != points || state.velocities.len() != points {
        return Err(Error::State { what: "points", state: short, expected: points });
    }
    if state.bodies.len() != bodies {
        return Err(Error::State { what: "free bodies", state: state.bodies.len(), expected: bodies });
    }
    for body in &state.bodies {
        body.check()?;
    }
    for solid in solids {
        solid.check()?;
        match solid.drive {
            Drive::Guided(path) => path(time).check()?,
            Drive::Led(led) => led.path(time).check()?,
            Drive::Free { .. } => {}
        }
    }
    Ok(())
}

/// The first multiple of `length` after `time`, at most `limit`. A step to it is not shorter than a millionth of `length` because of rounding.
fn next_time(time: f64, length: f64, limit: f64) -> f64 {
    let mut end = ((time / length).floor() + 1.0) * length;
    if end - time < 1e-6 * length {
        end += length;
    }
    if limit - end < 1e-6 * length { limit } else { end }
}
