//! Sheets, soil and solids both ways: a part of a tick is gone through until growth and the mechanics of the sheets and the soil agree on it.
//!
//! ```text
//!    growth under forces F ──▶ paths of the solids
//!      ▲                          │
//!      │                          ▼
//!    forces, linear in time ◀── sheets and soil, with solids that are led: on their paths, free to deviate by their mass
//! ```
//!
//! Equations of motion stand in the rules of the model; of them, the mechanics gets the inverse of the mass, which is measured: growth goes on under a small force
//! more along each axis, and the way that it makes more is F h²/2m. With that, contacts are solved as for free solids, implicitly and with equal and opposite
//! impulses. Growth under the forces that result ends where the mechanics has the solid, to rounding if its equations are linear. If not, the way under the new
//! forces is the next path. A part is accepted if both agree at its end, and, within the tolerance, on the way; if they do not get there, it is halved.

use std::collections::BTreeMap;
use std::time::Instant;

use dlsys_geometry::turtle::Origin;
use dlsys_ground::Bearing;
use dlsys_model::KindId;
use dlsys_sheet::{Led, Matrix, Place as Stand, Shape, Solid, Step, Vector};
use dlsys_sim::Simulation;

use crate::Error;
use crate::afloat::Afloat;
use crate::descent::Descent;
use crate::error::CouplingFault;
use crate::hanging::{Hanger, Hanging, TICK, View};
use crate::line::{Exerted, Line};
use crate::masses::Body;
use crate::mire::{self, Deviation};
use crate::paths::{INSTANTS, Path};
use crate::tracks::{Part, Track};

/// Most halvings of a tick.
const DEEPEST: u32 = 14;
/// Most times that growth goes through a part.
const PASSES: usize = 8;
/// Most times that all sheets are gone through, where several push one solid.
const ROUNDS: usize = 12;
/// How far the ends may be apart, and what counts as no change of a force, in parts of what is allowed on the way.
const NEAR: f64 = 0.1;
const SAME: f64 = 0.01;
/// The next part is longer if the distance on the way is below this part of what is allowed.
const ROOM: f64 = 0.15;
/// A body that touches soil within this many seconds of the beginning or the end of a part does so there.
const SOON: f64 = 1e-7;
/// What goes on from part to part.
#[derive(Clone, Default)]
pub(crate) struct Leading {
    /// The inverse masses (1/kg) of solids that have been measured, by their modules.
    pub(crate) masses: BTreeMap<u64, Matrix>,
    /// Productions of the part before.
    pub(crate) descent: Descent,
    /// m of the length TICK/2^m.
    level: u32,
    /// When the part ends at the latest, in s: where a body touches soil, so that the force begins with a part.
    cut: Option<f64>,
    /// Solids whose equations read no force, and which sheets push all the same.
    pub(crate) afloat: Afloat,
}

impl Leading {
    /// With masses in kg of solids whose equations read no force, by their kinds.
    pub(crate) fn with(masses: BTreeMap<KindId, f64>) -> Leading {
        Leading { afloat: Afloat::new(masses), ..Leading::default() }
    }

    /// The inverse mass of a module that has been measured, there or as the one that it replaced.
    pub(crate) fn known(&self, module: u64) -> Option<Matrix> {
        self.descent.line(module).find_map(|id| self.masses.get(&id)).copied()
    }
}

/// What one sheet does under forces of others, or the soil: the track of a sheet, the force on each body, and how that makes them deviate.
struct Pushed {
    track: Option<Track>,
    forces: Vec<Line>,
    deviations: Vec<Deviation>,
}

/// All sheets of a span, and the soil, that agree with one another: tracks of sheets, forces by what pushes (first the soil) and body, deviations by body.
struct Solved {
    tracks: Vec<Track>,
    forces: Vec<Vec<Line>>,
    deviations: Vec<Deviation>,
}

/// A span in which soil may bear bodies: how, for each body whose rules read forces, and the distance that is allowed on the way, in m.
struct Borne {
    bearings: Vec<Option<Bearing>>,
    allowed: f64,
}

/// A part that is accepted, why growth fails in it, and how far both ways are apart, in parts of what is allowed.
type Accepted = (Part, Option<Error>, f64);

impl<'m> Hanging<'m> {
    /// Goes through the next part of a tick, from a time in s on.
    pub(crate) fn both_ways(
        &mut self,
        begin: f64,
        leading: &mut Leading,
    ) -> Result<(Part, Option<Error>), Error> {
        loop {
            let whole = TICK / f64::from(leading.level).exp2();
            let cut = leading.cut.take().filter(|cut| cut - begin < whole);
            let length = cut.map_or_else(|| self.length_from(begin, whole), |cut| cut - begin);
            if self.solver.deadline.is_some_and(|deadline| Instant::now() > deadline) {
                let span = self.model.scenery.solids.first().map(|(_, span)| *span).unwrap_or_default();
                return Err(Error::OutOfTime { limit: f64::NAN, time: self.place.time_at(begin), span });
            }
            match self.attempt((begin, length), leading)? {
                Ok((part, failed, apart)) => {
                    // Ticks of soil are on a grid of their own.
                    let aligned = self.mire.is_some()
                        || ((begin + length - self.begin()) / (2.0 * length)).fract() == 0.0;
                    if leading.level > 0 && aligned && apart < ROOM {
                        leading.level -= 1;
                    }
                    leading.afloat.go_on(&part.passages, (&part.forces, &leading.descent), part.end - begin);
                    leading.descent = part.descent.clone();
                    return Ok((part, failed));
                }
                Err(_) if leading.cut.is_some() => (),
                Err(error) if leading.level == DEEPEST => return Err(error),
                Err(_) => leading.level += 1,
            }
        }
    }

    /// The length of a part from a time in s on, at most as long as this: up to the next tick, also one of the soil.
    fn length_from(&self, begin: f64, most: f64) -> f64 {
        let Some(mire) = &self.mire else { return most };
        let stop = (self.begin() + TICK).min(mire.next_tick());
        // No sliver is left over.
        if begin + most * (1.0 + 1e-6) < stop {
            return most;
        }
        let length = stop - begin;
        [length, length.next_up(), length.next_down()]
            .into_iter()
            .find(|length| begin + length == stop)
            .unwrap_or(length)
    }

    /// Tries a span. The inner error is that it is too long.
    fn attempt(&mut self, span: (f64, f64), leading: &mut Leading) -> Result<Result<Accepted, Error>, Error> {
        // The forces of the part before are the first guess.
        let mut guess: BTreeMap<u64, Line> = BTreeMap::new();
        let in_soil = self.mire.iter().flat_map(|mire| mire.forces());
        for (module, line) in self.hung.iter().flat_map(|hanger| &hanger.forces).chain(in_soil) {
            let sum = guess.entry(*module).or_default();
            *sum = sum.plus(line);
        }
        let (mut growth, mut view) = self.led(span, (&guess, &leading.descent), leading)?;
        let readers: Vec<(usize, u64)> = {
            let all = view.paths.iter().enumerate().filter(|(_, path)| self.pushes(path, leading));
            all.map(|(i, path)| (i, path.origin.lineage.id)).collect()
        };
        let Some(&(first, _)) = readers.first() else {
            let tracks = self.solve(&view, span)?;
            let (part, failed) = self.end(span, (view, growth), tracks, (BTreeMap::new(), &[]))?;
            return Ok(Ok((part, failed, 0.0)));
        };
        let mut given = {
            let exerted = Exerted { forces: &guess, since: &leading.descent };
            let lines = readers.iter().map(|(_, module)| (*module, exerted.on(*module)));
            lines.filter(|(_, line)| *line != Line::default()).collect()
        };
        let mut bodies = self.weigh(&readers, (&view, span), &given, (leading, false))?;
        let mut shares = self.shares(&view, &bodies, &leading.descent);
        let borne = self.borne((&view, span.0), &bodies)?;
        let mut worst = (f64::INFINITY, 0.0);
        let touches = bodies
            .iter()
            .zip(&borne.bearings)
            .filter_map(|(body, bearing)| mire::touch(bearing.as_ref()?, &view.paths[body.path], span));
        let touch = touches.filter(|touch| touch * span.1 > SOON).fold(f64::INFINITY, f64::min);
        if touch < 1.0 && touch * span.1 < span.1 - SOON {
            leading.cut = Some(span.0 + touch * span.1);
            let fault = CouplingFault::Apart { by: f64::NAN, allowed: f64::NAN, step: span.1 };
            return Ok(Err(self.fails(&view.paths[first].origin, span.0, fault)));
        }
        for pass in 0..PASSES {
            let solved = match self.go_around((&view, span), (&bodies, &borne), &shares)? {
                Ok(solved) => solved,
                Err(apart) => {
                    worst = apart.unwrap_or(worst);
                    break;
                }
            };
            let forces = total(&solved.forces, &bodies);
            let of_soil = of_soil(&solved.forces, &bodies);
            if forces.is_empty() && given.is_empty() {
                let (part, failed) = self.end(span, (view, growth), solved.tracks, (forces, &of_soil))?;
                return Ok(Ok((part, failed, 0.0)));
            }
            let (next_growth, next) = self.led(span, (&forces, &Descent::default()), leading)?;
            let allowed = self.allowed(&solved.tracks, &borne);
            let [at_end, between] = distances([&view, &next], &bodies, &solved.deviations, span);
            let agrees = view.births.len() == next.births.len() && at_end <= NEAR * allowed;
            if agrees && between <= allowed || next.failed.is_some() {
                let apart = at_end.max(between) / allowed;
                let (part, failed) =
                    self.end(span, (next, next_growth), solved.tracks, (forces, &of_soil))?;
                return Ok(Ok((part, failed, apart)));
            }
            worst = (at_end.max(between), allowed);
            if agrees {
                // A line is too little for what happens in the span.
                break;
            }
            (given, shares, view, growth) = (forces, solved.forces, next, next_growth);
            shares.resize(1 + self.hung.len() + view.births.len(), vec![Line::default(); bodies.len()]);
            if pass == 0 {
                bodies = self.weigh(&readers, (&view, span), &given, (leading, true))?;
            }
        }
        let (by, allowed) = worst;
        let fault = CouplingFault::Apart { by, allowed, step: span.1 };
        Ok(Err(self.fails(&view.paths[first].origin, span.0, fault)))
    }

    /// Growth through a span, under forces on modules before some productions.
    pub(crate) fn led(
        &mut self,
        span: (f64, f64),
        (forces, since): (&BTreeMap<u64, Line>, &Descent),
        leading: &Leading,
    ) -> Result<(Simulation<'m>, View), Error> {
        let mut growth = self.growth.clone();
        let exerted = Exerted { forces, since };
        let mut view = self.look(&mut growth, span, self.model.reads_force().then_some(&exerted))?;
        leading.afloat.deviate(&mut view.paths, span.1, &exerted, &leading.descent);
        Ok((growth, view))
    }

    /// Whether sheets push a solid: the rules of its module read the force on it, or its mass is given.
    fn pushes(&self, path: &Path, leading: &Leading) -> bool {
        let kind = path.origin.kind;
        self.model.kinds.get(kind).reads_force() || leading.afloat.light(kind).is_some()
    }

    /// The first guess of the force of the soil, and of each sheet, on each body.
    fn shares(&self, view: &View, bodies: &[Body], since: &Descent) -> Vec<Vec<Line>> {
        let on = |forces: &[(u64, Line)], body: &Body| {
            let find = |id: u64| forces.iter().find(|(module, _)| *module == id).map(|(_, line)| *line);
            since.line(body.module).find_map(find).unwrap_or_default()
        };
        let on_all = |forces: &[(u64, Line)]| bodies.iter().map(|body| on(forces, body)).collect();
        let soil = on_all(self.mire.as_ref().map_or(&[], |mire| mire.forces()));
        std::iter::once(soil).chain(self.hangers(view).iter().map(|hanger| on_all(&hanger.forces))).collect()
    }

    /// How soil bears the bodies whose rules read forces, in a span from a time in s on.
    fn borne(&mut self, (view, begin): (&View, f64), bodies: &[Body]) -> Result<Borne, Error> {
        let mut borne = Borne { bearings: bodies.iter().map(|_| None).collect(), allowed: f64::INFINITY };
        let Some(mire) = &mut self.mire else { return Ok(borne) };
        let reads = |body: &&Body| self.model.kinds.get(view.paths[body.path].origin.kind).reads_force();
        let place = |body: &Body| (body.module, view.paths[body.path].place(begin).position);
        let readers: Vec<(u64, Vector)> = bodies.iter().filter(reads).map(place).collect();
        let mut found = mire.bearings(&view.strings[0], &readers, &mut self.scene)?.into_iter();
        for (body, bearing) in bodies.iter().zip(&mut borne.bearings).filter(|(body, _)| reads(body)) {
            *bearing = found.next().flatten();
            if bearing.is_some() {
                let size = 2.0 * view.paths[body.path].shape.reach();
                borne.allowed = borne.allowed.min(self.solver.settings.tolerance * size);
            }
        }
        Ok(borne)
    }

    /// The distance that is allowed on the way, in m.
    fn allowed(&self, tracks: &[Track], borne: &Borne) -> f64 {
        let extent = |track: &Track| track.hung.made.extent();
        let pushing = tracks.iter().filter(|track| !track.forces.is_empty()).map(extent);
        let least = pushing.fold(f64::INFINITY, f64::min);
        let least = if least.is_finite() { least } else { tracks.iter().map(extent).fold(1.0, f64::min) };
        (self.solver.settings.tolerance * least).min(borne.allowed)
    }

    /// Goes through the soil and all sheets under the forces of all others, until none changes any more. `shares` are the forces under which growth has found the paths.
    /// The inner error is that they come to no end, or by how much the steps in soil differ, and what is allowed.
    fn go_around(
        &mut self,
        (view, span): (&View, (f64, f64)),
        (bodies, borne): (&[Body], &Borne),
        shares: &[Vec<Line>],
    ) -> Result<Result<Solved, Option<(f64, f64)>>, Error> {
        let hangers = self.hangers(view);
        let extent = hangers.iter().map(|hanger| hanger.hung.made.extent()).fold(f64::INFINITY, f64::min);
        let same = SAME * (self.solver.settings.tolerance * extent).min(borne.allowed);
        let is_same = |a: &[Line], b: &[Line]| {
            bodies.iter().zip(a.iter().zip(b)).all(|(body, (a, b))| {
                let [impulse, integral] = a.minus(b).moments(span.1);
                (body.light * impulse).norm() * span.1 + (body.light * integral).norm() <= same
            })
        };
        // The soil, and the sheets.
        let mut all: Vec<Option<(Pushed, Vec<Line>)>> = (0..=hangers.len()).map(|_| None).collect();
        for _ in 0..ROUNDS {
            let mut changed = false;
            for k in 0..all.len() {
                let mut others = vec![Line::default(); bodies.len()];
                for (j, other) in all.iter().enumerate().filter(|(j, _)| *j != k) {
                    let Some((pushed, _)) = other else { continue };
                    for (b, sum) in others.iter_mut().enumerate() {
                        *sum = sum.plus(&pushed.forces[b].minus(&shares[j][b]));
                    }
                }
                if !all[k].as_ref().is_some_and(|(_, then)| is_same(then, &others)) {
                    let pushed = match k.checked_sub(1) {
                        Some(n) => self.push((&hangers[n], &shares[k]), (view, span), bodies, &others)?,
                        None => match sink(view, span, (bodies, borne), [&shares[k], &others]) {
                            Ok(pushed) => pushed,
                            Err(apart) => return Ok(Err(Some((apart, borne.allowed)))),
                        },
                    };
                    all[k] = Some((pushed, others));
                    changed = true;
                }
            }
            if !changed {
                let mut solved = Solved {
                    tracks: Vec::new(),
                    forces: Vec::new(),
                    deviations: vec![Deviation::default(); bodies.len()],
                };
                for (Pushed { track, forces, deviations }, _) in all.into_iter().flatten() {
                    solved.tracks.extend(track);
                    solved.forces.push(forces);
                    for (sum, one) in solved.deviations.iter_mut().zip(deviations) {
                        sum.ways.iter_mut().zip(one.ways).for_each(|(sum, way)| *sum += way);
                        sum.velocity += one.velocity;
                    }
                }
                return Ok(Ok(solved));
            }
        }
        Ok(Err(None))
    }

    /// Follows a sheet through a span. `share` is its force in the paths, and `others` what other sheets do beyond theirs.
    fn push(
        &mut self,
        (hanger, share): (&Hanger, &[Line]),
        (view, (begin, length)): (&View, (f64, f64)),
        bodies: &[Body],
        others: &[Line],
    ) -> Result<Pushed, Error> {
        let body_of = |path: usize| bodies.iter().position(|body| body.path == path);
        let way = |(index, path): (usize, &'_ Path)| {
            let more = body_of(index).map(|b| (bodies[b].light, others[b]));
            let path = path.clone();
            move |time: f64| {
                let place = path.place(time);
                let Some((light, line)) = &more else { return place };
                let [impulse, integral] = line.moments(time - begin);
                let position = place.position + light * integral;
                Stand { position, velocity: place.velocity + light * impulse, ..place }
            }
        };
        let ways: Vec<_> = view.paths.iter().enumerate().map(way).collect();
        let mut leds = Vec::with_capacity(bodies.len());
        let mut solids = Vec::with_capacity(view.paths.len() + 1);
        for (index, path) in view.paths.iter().enumerate() {
            solids.push(match body_of(index) {
                None => Solid::guided(&path.shape, &ways[index]),
                Some(b) => {
                    let led = Led::new(&ways[index], &bodies[b].light);
                    let led = led.map_err(|_| self.fails(&path.origin, begin, CouplingFault::NoMass))?;
                    let led = led.assuming(begin, share[b].force, share[b].rate);
                    leds.push(led);
                    Solid::led(&path.shape, led)
                }
            });
        }
        let floor = Shape::half_space();
        let below = self.floor();
        let ground = move |_: f64| below.unwrap_or(Stand::at(Vector::zeros()));
        if below.is_some() {
            solids.push(Solid::guided(&floor, &ground));
        }
        let mut hanger = hanger.clone();
        hanger.state.bodies = vec![Led::start(); bodies.len()];
        let end = begin + length;
        let mut pushed = vec![[Vector::zeros(); 2]; bodies.len()];
        let note = |step: &Step| {
            for (sum, body) in pushed.iter_mut().zip(bodies) {
                let impulse = step.pushes[body.path].impulse;
                sum[0] += impulse;
                sum[1] += impulse * (end - 0.5 * (step.from + step.to));
            }
        };
        let mut track = self.follow(hanger, &solids, begin..end, note)?;
        let mut forces = vec![Line::default(); bodies.len()];
        let mut deviations = vec![Deviation::default(); bodies.len()];
        for (b, led) in leds.iter().enumerate() {
            let last = track.steps.last().map(|(_, state)| state.bodies[b]).unwrap_or(Led::start());
            let deviation = &mut deviations[b];
            for (way, part) in deviation.ways.iter_mut().zip(&INSTANTS[1..]) {
                let state = track.at(begin + length * part);
                *way = state.map_or(Vector::zeros(), |state| led.root() * state.bodies[b].position);
            }
            deviation.velocity = led.root() * last.velocity;
            // What nothing touches is under no force, exactly.
            if pushed[b] != [Vector::zeros(); 2] {
                let [impulse, integral] = share[b].moments(length);
                let beyond = led.effect(&last, [pushed[b][0] - impulse, pushed[b][1] - integral]);
                forces[b] = Line::through([impulse + beyond[0], integral + beyond[1]], length);
            }
        }
        let acting = bodies.iter().zip(&forces).filter(|(_, line)| **line != Line::default());
        track.forces = acting.map(|(body, line)| (body.module, *line)).collect();
        Ok(Pushed { track: Some(track), forces, deviations })
    }

    /// A coupling that fails at a time in s.
    pub(crate) fn fails(&self, origin: &Origin, begin: f64, fault: CouplingFault) -> Error {
        let time = self.place.time_at(begin);
        let kind = self.model.kinds.get(origin.kind).name.clone();
        let mut declared = self.model.scenery.solids.iter();
        let declared = || declared.find(|(kind, _)| *kind == origin.kind).map(|(_, span)| *span);
        let span = origin.span(self.model).or_else(declared).unwrap_or_default();
        Error::Coupling { kind, lineage: origin.lineage, time, fault, span }
    }
}

/// What soil does to bodies in a span. The error is by how much its steps differ, in m.
fn sink(
    view: &View,
    span: (f64, f64),
    (bodies, borne): (&[Body], &Borne),
    [shares, others]: [&[Line]; 2],
) -> Result<Pushed, f64> {
    let mut pushed = Pushed { track: None, forces: Vec::new(), deviations: Vec::new() };
    for (b, body) in bodies.iter().enumerate() {
        let (line, deviation) = match &borne.bearings[b] {
            Some(bearing) => {
                let on = (body, &view.paths[body.path]);
                mire::sink(bearing, on, span, (&shares[b], &others[b]), borne.allowed)?
            }
            // It has left the soil, as far as it was in it.
            None => mire::released((body, span.1), &shares[b]),
        };
        pushed.forces.push(line);
        pushed.deviations.push(deviation);
    }
    Ok(pushed)
}

/// The forces of the soil that are not 0, by modules.
fn of_soil(forces: &[Vec<Line>], bodies: &[Body]) -> Vec<(u64, Line)> {
    let all = bodies.iter().zip(forces.first().into_iter().flatten());
    all.filter(|(_, line)| **line != Line::default()).map(|(body, line)| (body.module, *line)).collect()
}

/// The sum of the forces of all sheets and of the soil on each body, of those that are not 0.
fn total(forces: &[Vec<Line>], bodies: &[Body]) -> BTreeMap<u64, Line> {
    let sum = |b: usize| forces.iter().fold(Line::default(), |sum, of_sheet| sum.plus(&of_sheet[b]));
    let all = bodies.iter().enumerate().map(|(b, body)| (body.module, sum(b)));
    all.filter(|(_, line)| *line != Line::default()).collect()
}

/// How far growth under new forces is from where the sheets have the bodies: at the end of the span, with what the difference of velocities makes in as long,
/// and on the way, in m. Of a body that is gone then, its way in the span stands for that on the way.
fn distances(
    [view, next]: [&View; 2],
    bodies: &[Body],
    deviations: &[Deviation],
    (begin, length): (f64, f64),
) -> [f64; 2] {
    let (mut at_end, mut between) = (0.0_f64, 0.0_f64);
    for (body, deviation) in bodies.iter().zip(deviations) {
        let (Some(path), Some(other)) = (view.paths.get(body.path), next.paths.get(body.path)) else {
            return [f64::INFINITY; 2];
        };
        if other.is_gone {
            // Nothing is known of where it would be, so its way is to be short.
            between = between.max(path.place(begin).velocity.norm() * length);
            continue;
        }
        for (way, part) in deviation.ways.iter().zip(&INSTANTS[1..]) {
            let time = begin + length * part;
            let (here, there) = (path.place(time), other.place(time));
            let apart = (there.position - here.position - way).norm();
            if *part < 1.0 {
                between = between.max(apart);
            } else {
                let faster = (there.velocity - here.velocity - deviation.velocity).norm();
                at_end = at_end.max(apart).max(faster * length);
            }
        }
    }
    // A distance that is no number is none that is allowed.
    [at_end, between].map(|distance| if distance.is_nan() { f64::INFINITY } else { distance })
}
