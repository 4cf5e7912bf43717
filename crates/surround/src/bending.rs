//! Stems that bend: their motion from tick to tick of a global clock, over a structure that productions change.
//!
//! At a tick `t_n` the skeleton of the present string takes over the strains of the one before, by descent: a stem that is there
//! still, or whose module has replaced one outside brackets, has the strain of that one, turned by the roll between their frames.
//! Strain is intensive (radians per length), so a division changes neither shape nor velocity. Then the stems are advanced to the
//! next tick, while growth goes on at its present rates.

use std::ops::Deref;
use std::sync::Arc;

use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle::{self, PartKey, Pose, Stem, StemKey, Strains};
use dlsys_model::Model;
use dlsys_sway::{self as sway, Solver, State, Vector, Wind, hermite};
use dlsys_tree::ModuleString;

use crate::between;
use crate::body::{Body, kept, roll, rolled};
use crate::classes::{ByModes, Modal};
use crate::descent::Descent;
use crate::flights::Flown;
use crate::place::Place;
use crate::sampler::{Breeze, Sampler};
use crate::{CLOCK, Error, FailedStem};

/// The strains of all stems at an instant within a tick.
#[derive(Clone, Debug)]
struct Knot {
    /// In s.
    time: f64,
    strain: Vec<Vector>,
    rate: Vec<Vector>,
}

impl Knot {
    fn new(time: f64, state: &State) -> Knot {
        Knot { time, strain: state.strain.clone(), rate: state.rate.clone() }
    }
}

/// The foot of a stem that gives way, where it stands on what does not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The kind of the module that draws the stem.
    pub kind: dlsys_model::KindId,
    /// The elastic moment in N m that the stem and all that it carries pass on beyond that at rest.
    pub moment: f64,
    /// The bending strain there, without unit.
    pub strain: f64,
}

/// The motion of the stems from one tick to the next. Times are in s.
#[derive(Clone, Debug)]
pub(crate) struct Tick {
    body: Arc<Body>,
    /// In the order of time, from the tick to the next; none where nothing has moved.
    knots: Vec<Knot>,
}

impl Tick {
    /// Of nothing that gives way.
    pub(crate) fn still() -> Tick {
        Tick { body: Arc::default(), knots: Vec::new() }
    }

    /// The strain of a stem and its rate at a time within the tick, per metre.
    fn strain(&self, stem: usize, time: f64) -> (Vector, Vector) {
        let after = self.knots.partition_point(|knot| knot.time <= time);
        let of = |knot: &Knot| (knot.time, knot.strain[stem], knot.rate[stem]);
        match (after.checked_sub(1).map(|i| &self.knots[i]), self.knots.get(after)) {
            (Some(before), Some(after)) => hermite(time, of(before), of(after)),
            (Some(knot), None) | (None, Some(knot)) => (knot.strain[stem], knot.rate[stem]),
            (None, None) => (Vector::zeros(), Vector::zeros()),
        }
    }

    /// The ends of all stems at the tick, and points beyond the centres of what they carry, in m.
    pub(crate) fn points(&self) -> Vec<Vector> {
        let skeleton = &self.body.skeleton;
        let strain: &[Vector] = self.knots.first().map_or(&[], |knot| &knot.strain);
        let pose = sway::Pose::new(skeleton, strain);
        let mut points = Vec::new();
        for stem in 0..skeleton.len() {
            points.push(pose.point(stem, 1.0));
            // What a section carries is one load, but each organ has plates of its own.
            let loads = skeleton.loads(stem).iter().map(|load| (load.at, load.centre));
            let plates = skeleton.plates(stem).chunk_by(|a, b| (a.at, a.centre) == (b.at, b.centre));
            for (at, centre) in loads.chain(plates.map(|plates| (plates[0].at, plates[0].centre))) {
                let section = pose.at(stem, at);
                points.push(section.origin + section.axes * centre * 2.0);
            }
        }
        points
    }

    /// The feet of stems at the tick.
    pub(crate) fn feet(&self) -> Vec<Foot> {
        let Body { skeleton, stems, .. } = &*self.body;
        let strain = |stem: usize| self.knots.first().map_or(Vector::zeros(), |knot| knot.strain[stem]);
        let roots = skeleton.segments().iter().enumerate().filter(|(_, segment)| segment.parent.is_none());
        let foot = |(stem, segment): (usize, &sway::Segment)| {
            let (origin, strain) = (stems[stem].origin, strain(stem));
            Foot {
                kind: origin.kind,
                moment: segment.rigidity().component_mul(&strain).norm(),
                strain: strain.y.hypot(strain.z) * segment.diameter / 2.0,
            }
        };
        roots.map(foot).collect()
    }

    /// Number of strains that are kept.
    pub(crate) fn size(&self) -> usize {
        self.body.stems.len() * (1 + self.knots.len())
    }

    /// The largest bending strain of the stems of a module at a time, without unit: curvature times half the diameter. `depth` is the
    /// number of brackets around the module.
    pub(crate) fn largest(&self, module: u64, depth: usize, descent: &Descent, time: f64) -> f64 {
        let mut largest = 0.0_f64;
        for module in descent.line(module) {
            let stems = (0..).map_while(|number| self.body.numbers.get(&StemKey { module, number }));
            let mut known = false;
            for &stem in stems.filter(|stem| self.body.stems[**stem].depth == depth) {
                let (strain, _) = self.strain(stem, time);
                let radius = self.body.skeleton.segments()[stem].diameter / 2.0;
                largest = largest.max(strain.y.hypot(strain.z) * radius);
                known = true;
            }
            if known {
                break;
            }
        }
        largest
    }

    /// The strain that a stem of a later string has at a time: its own, or that of the stem of the module from which its module
    /// descends. `None` for what is new.
    fn inherited(&self, stem: &Stem, descent: &Descent, time: f64) -> Option<(Vector, Vector)> {
        for module in descent.line(stem.key.module) {
            let known = (0..=stem.key.number)
                .rev()
                .find_map(|number| self.body.numbers.get(&StemKey { module, number }));
            let Some(&known) = known else { continue };
            let before = &self.body.stems[known];
            let (strain, rate) = self.strain(known, time);
            let kept = kept(before.width, stem.width);
            let (strain, rate) = (strain * kept, rate * kept);
            if module == stem.key.module {
                // The stem itself; one more of the same module is new.
                return (before.key == stem.key).then_some((strain, rate));
            }
            // A module that a production puts into a bracket begins anew.
            let angle = roll(before, stem);
            return (before.depth == stem.depth).then(|| (rolled(strain, angle), rolled(rate, angle)));
        }
        None
    }
}

/// The strains of a string, and where the parts are that it has let go, for the turtle.
#[derive(Clone, Debug)]
pub struct BentStems {
    tick: Arc<Tick>,
    /// In s.
    time: f64,
    /// Metres in a unit of length.
    metre: f64,
    /// The stems of the string with their strains per metre, if there are some that the tick does not know.
    new: Option<std::collections::HashMap<StemKey, Vector>>,
    /// Where the parts are that have been let go.
    pub(crate) flown: Flown,
}

impl BentStems {
    /// No strain anywhere.
    pub(crate) fn at_rest() -> BentStems {
        let tick = Arc::new(Tick::still());
        BentStems { tick, time: 0.0, metre: 1.0, new: None, flown: Flown::default() }
    }

    /// Adds the strains of stems that are not in the skeleton, by descent. True if there are any.
    pub(crate) fn take_over<'a>(&mut self, stems: impl Iterator<Item = &'a Stem>, descent: &Descent) -> bool {
        let mut any = false;
        for stem in stems.filter(|stem| !self.tick.body.numbers.contains_key(&stem.key)) {
            if let Some((strain, _)) = self.tick.inherited(stem, descent, self.time) {
                self.new.get_or_insert_default().insert(stem.key, strain);
                any = true;
            }
        }
        any
    }
}

impl Strains for BentStems {
    fn strain(&self, stem: StemKey, width: f64) -> Vector {
        let frozen = self.flown.frozen.get(&stem).filter(|(since, _)| *since <= self.time);
        if let Some((_, strain)) = frozen {
            return *strain;
        }
        let new = self.new.as_ref().and_then(|new| new.get(&stem).copied());
        // One that has just been let go is none of the stems of its string.
        let known = || {
            let number = *self.tick.body.numbers.get(&stem)?;
            Some(self.tick.strain(number, self.time).0 * kept(self.tick.body.stems[number].width, width))
        };
        new.or_else(known).unwrap_or_else(Vector::zeros) * self.metre
    }

    fn flight(&self, part: PartKey) -> Option<Pose> {
        self.flown.poses.get(&part).copied()
    }
}

/// Work of the surroundings so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Ticks of the clock.
    pub ticks: u64,
    /// Steps of the solver that were accepted.
    pub steps: u64,
    /// Sum of the number of stems over these steps.
    pub stem_steps: u64,
    /// Ticks in which the stems moved by modes, which are no steps of the solver.
    pub by_modes: u64,
}

/// The stems of a model in motion.
#[derive(Clone)]
pub(crate) struct Bending<'w, M> {
    model: M,
    place: Place,
    wind: Arc<Sampler<'w>>,
    solver: Solver,
    tolerance: f64,
    state: State,
    modal: Option<Modal>,
    /// The body at the last tick.
    body: Arc<Body>,
    /// The string at the last tick.
    string: ModuleString,
    /// The string alone decides the drawing.
    timeless: bool,
    scene: Scene,
    pub(crate) effort: Effort,
}

impl<'w, M: Deref<Target = Model>> Bending<'w, M> {
    pub(crate) fn new(
        model: M,
        wind: Arc<Sampler<'w>>,
        place: Place,
        settings: sway::Settings,
    ) -> Bending<'w, M> {
        Bending {
            place,
            wind,
            solver: Solver::new(place.settings(settings)),
            tolerance: settings.tolerance,
            state: State::default(),
            modal: None,
            body: Arc::default(),
            string: ModuleString::default(),
            timeless: turtle::is_timeless(&model) && is_constant(&model),
            scene: turtle::blank(&model),
            effort: Effort::default(),
            model,
        }
    }

    /// Moves by modes where it does not grow, if its tissues keep their stiffness.
    pub(crate) fn by_modes(self, modes: Option<ByModes>) -> Bending<'w, M> {
        let modes = modes.filter(|_| is_constant(&self.model));
        Bending { modal: modes.map(Modal::new), ..self }
    }

    /// Drops what is known of the wind at the last instants.
    pub(crate) fn forget_wind(&self) {
        self.wind.forget();
    }

    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    /// Sets when the solver gives up.
    pub(crate) fn give_up_at(&mut self, deadline: Option<std::time::Instant>) {
        self.solver.deadline = deadline;
    }

    pub(crate) fn place(&self) -> &Place {
        &self.place
    }

    fn body(&mut self, string: &ModuleString) -> Result<Body, Error> {
        if self.model.scenery.tissues.is_empty() {
            return Ok(Body::default());
        }
        let noted = turtle::skeleton(&self.model, string, &mut self.scene)?;
        Body::new(noted, &self.model, (self.place.units.length, string.time))
    }

    /// The motion from the tick of this number, with the string at that time, to the next. `before` is the tick before, with the
    /// productions since then, and the string a little earlier than this one, for the rates of growth, unless there was a production
    /// in between.
    pub(crate) fn advance(
        &mut self,
        number: u64,
        string: &ModuleString,
        before: Option<(&Tick, &Descent, Option<&ModuleString>)>,
    ) -> Result<Tick, Error> {
        let [from, to] = [number, number + 1].map(|n| n as f64 * CLOCK);
        let body = match before {
            None => Arc::new(self.body(string)?),
            Some((.., earlier)) => self.moved(string, earlier)?,
        };
        self.string.clone_from(string);
        let mut state = State::at_rest(&body.skeleton);
        state.level = self.state.level;
        if let Some((tick, descent, _)) = before {
            for (i, stem) in body.stems.iter().enumerate() {
                if let Some(inherited) = tick.inherited(stem, descent, from) {
                    (state.strain[i], state.rate[i]) = inherited;
                }
            }
        }
        self.effort.ticks += 1;
        let mut knots = Vec::new();
        if self.is_due(&body, &state) {
            knots.push(Knot::new(from, &state));
            let modal = self.modal.as_mut();
            if modal.is_some_and(|modal| {
                modal.advance(&body, &mut state, (from, to), &*self.wind, &mut self.solver)
            }) {
                knots.push(Knot::new(to, &state));
                self.effort.by_modes += 1;
            } else {
                self.solve(&body, &mut state, (from, to), &mut knots)?;
            }
        }
        (self.body, self.state) = (Arc::clone(&body), state);
        Ok(Tick { body, knots })
    }

    /// Advances a state by a tick, with controlled error.
    fn solve(
        &mut self,
        body: &Body,
        state: &mut State,
        (from, to): (f64, f64),
        knots: &mut Vec<Knot>,
    ) -> Result<(), Error> {
        let mut given = f64::NAN;
        let moves = body.moves();
        let mut growth = |time: f64, out: &mut sway::Skeleton| {
            if !out.is_empty() && (!moves || time == given) {
                return false;
            }
            given = time;
            body.later(time - from, out);
            true
        };
        let mut note = |step: &sway::Step<'_>| knots.push(Knot::new(step.to, step.after));
        let done = match between::serves(self.tolerance, body.stems.len()) {
            true => self.solver.advance(state, from, to, &mut growth, &Breeze(&self.wind), &mut note),
            false => self.solver.advance(state, from, to, &mut growth, &*self.wind, &mut note),
        };
        done.map_err(|error| self.wind.failure().unwrap_or_else(|| self.failure(body, error, from)))?;
        let steps = knots.len() as u64 - 1;
        (self.effort.steps, self.effort.stem_steps) =
            (self.effort.steps + steps, self.effort.stem_steps + steps * body.stems.len() as u64);
        Ok(())
    }

    /// The body of a string with the motion that growth prescribes, from the string a little earlier, unless there was a production in between.
    /// What is drawn from equal strings is not drawn again.
    fn moved(&mut self, string: &ModuleString, earlier: Option<&ModuleString>) -> Result<Arc<Body>, Error> {
        let is_known = self.timeless && string.has_same_modules(&self.string);
        let stands = self.timeless && earlier.is_some_and(|earlier| earlier.has_same_modules(string));
        if is_known && stands && self.body.stands() {
            return Ok(Arc::clone(&self.body));
        }
        let mut body = if is_known { self.body.unmoved() } else { self.body(string)? };
        match earlier {
            Some(_) if stands => body.stand(),
            Some(earlier) => {
                let seconds = (string.time - earlier.time) * self.place.units.time;
                body.move_from(&self.body(earlier)?, seconds);
            }
            // A production in between may be a jump, which is no motion.
            None => body.move_as(&self.body),
        }
        body.accelerate_from(&self.body, CLOCK);
        Ok(Arc::new(body))
    }

    /// False if stems at rest stay at rest: no wind, no weight that is not balanced, no motion of growth.
    fn is_due(&self, body: &Body, state: &State) -> bool {
        let zero = Vector::zeros();
        !body.stems.is_empty()
            && (self.wind.blows()
                || body.moves()
                || body.skeleton.segments().iter().any(|segment| segment.sag)
                || state.strain.iter().chain(&state.rate).any(|value| *value != zero))
    }

    /// The error of a tick that begins at a time in s.
    fn failure(&self, body: &Body, error: sway::Error, from: f64) -> Error {
        let (at, seconds) = match error {
            sway::Error::Step { segment, time, .. } | sway::Error::Steps { segment, time, .. } => {
                (Some(segment), time)
            }
            sway::Error::Value { segment, .. } | sway::Error::Equilibrium { segment, .. } => {
                (Some(segment), from)
            }
            _ => (None, from),
        };
        let describe = |segment: usize| {
            let (stem, part) = (body.stems.get(segment)?, body.skeleton.segments().get(segment)?);
            let tissue = &self.model.scenery.tissues[stem.tissue];
            let place = stem.start.coords * self.place.units.length;
            Some(Box::new(FailedStem {
                kind: self.model.kinds.get(stem.origin.kind).name.clone(),
                lineage: stem.origin.lineage,
                drawn: stem.origin.span(&self.model),
                length: part.length,
                width: part.diameter,
                stiffness: tissue.stiffness.eval_one(&[self.place.time_at(seconds)]),
                tissue: tissue.span,
                wind: self.wind.velocity(place, seconds).norm(),
            }))
        };
        Error::Bending {
            stem: at.and_then(describe),
            time: self.place.time_at(seconds),
            tolerance: self.tolerance,
            error,
        }
    }
}

/// True if no tissue of a model becomes softer or stiffer in time.
fn is_constant(model: &Model) -> bool {
    model.scenery.tissues.iter().all(|tissue| tissue.is_constant())
}

/// The strains of a string at a time within a tick, from the productions since then.
pub(crate) fn bent(
    tick: &Arc<Tick>,
    descent: &Descent,
    bending: &Bending<'_, impl Deref<Target = Model>>,
    string: &ModuleString,
    scene: &mut Scene,
) -> Result<BentStems, Error> {
    let time = bending.place().seconds(string.time);
    let metre = bending.place().units.length;
    let mut stems = BentStems { tick: tick.clone(), time, metre, new: None, flown: Flown::default() };
    if !descent.is_empty() && !bending.model().scenery.tissues.is_empty() {
        let noted = turtle::skeleton(bending.model(), string, scene)?;
        let strain = |stem: &Stem| tick.inherited(stem, descent, time).map(|(strain, _)| (stem.key, strain));
        stems.new = Some(noted.stems.iter().filter_map(strain).collect());
    }
    Ok(stems)
}
