//! Sheets that hang in a scene, from tick to tick: where modules place them, and how they move among the solids of the model.
//!
//! ```text
//! growth ──string at instants of the tick──▶ turtle ──births, solids──▶ solver (sheet, wind) ──▶ states at its steps
//! ```
//!
//! Where rules read the forces on solids, a tick is gone through in parts, both ways: `leading.rs`.
//!
//! A sheet begins at the birth of its module, at rest in the shape of its file, where the turtle stands then. It hangs on the descent of its
//! module: a production that places it again changes nothing.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Instant;

use dlsys_geometry::scene::{Point, Scene, SheetKey, SheetPlace};
use dlsys_geometry::turtle;
use dlsys_model::{Model, Tissue};
use dlsys_sheet::{
    self as sheet, Counts, Mesh, Place as Stand, Settings, Shape, Sheet, Solid, Solver, State, Step, Vector,
};
use dlsys_sim::{Passed, Simulation};
use dlsys_tree::ModuleString;
use dlsys_wind::Draw;

use crate::descent::Descent;
use crate::leading::Leading;
use crate::line::{Exerted, Line};
use crate::mire::Mire;
use crate::paths::{INSTANTS, Meets, Path, Watch};
use crate::place::Place;
use crate::sampler::{Gusts, Sampler};
use crate::tracks::{Hung, Part, Passage, Tick, Track};
use crate::{Error, MOST_SHEET_POINTS};

/// Seconds from one tick of the sheets to the next. A power of 2, so that its multiples are exact.
pub const TICK: f64 = 1.0 / 64.0;

/// Largest speed along each axis, in m/s, with which points begin, at random: a sheet in an upright plane would not leave it otherwise, and a flag would
/// stand out in still air for ever. Nobody sees it: it moves a point by some micrometres.
const TREMBLE: f64 = 1e-4;

/// A sheet where a part of a tick begins.
#[derive(Clone)]
pub(crate) struct Hanger {
    pub(crate) hung: Arc<Hung>,
    pub(crate) state: State,
    /// The means of those of its track before.
    pub(crate) forces: Vec<(u64, Line)>,
}

/// What growth does from one tick to the next.
#[derive(Clone, Default)]
pub(crate) struct View {
    pub(crate) paths: Vec<Path>,
    pub(crate) births: Vec<Arc<Hung>>,
    pub(crate) descent: Descent,
    /// The sheets of the string at the next tick, if they may have changed.
    next: Option<Vec<SheetPlace>>,
    /// The strings at the beginning and at the end, where soil bears solids.
    pub(crate) strings: [ModuleString; 2],
    pub(crate) failed: Option<Error>,
}

/// The sheets of a model at a tick, and its growth up to there.
#[derive(Clone)]
pub(crate) struct Hanging<'m> {
    pub(crate) model: &'m Model,
    pub(crate) place: Place,
    pub(crate) growth: Simulation<'m>,
    /// The number of the present tick.
    pub(crate) number: u64,
    /// In the order of their births.
    pub(crate) hung: Vec<Hanger>,
    /// Where rules read the forces on solids.
    leading: Option<Leading>,
    /// The soil that bears them then.
    pub(crate) mire: Option<Mire<'m>>,
    /// Parts have the ways of solids.
    notes: bool,
    /// The kinds that place sheets.
    drapers: Arc<[bool]>,
    /// A drawing that places a sheet may do so at one time and not at another.
    chooses: bool,
    wind: Arc<Sampler<'static>>,
    pub(crate) solver: Solver,
    pub(crate) scene: Scene,
}

impl<'m> Hanging<'m> {
    /// The sheets at the first tick, with a tolerance relative to the extent of a sheet.
    pub(crate) fn new(
        model: &'m Model,
        (growth, place): (Simulation<'m>, Place),
        wind: Arc<Sampler<'static>>,
        tolerance: f64,
    ) -> Hanging<'m> {
        let drapers: Arc<[bool]> = turtle::kinds_that_drape(model).into();
        let chooses =
            model.kinds.iter().any(|(id, kind)| drapers[id.index()] && kind.interpretation.is_some());
        let tolerance = tolerance.clamp(1e-12, 0.1);
        let solver = Solver::new(Settings { tolerance, longest: TICK, ..Settings::default() });
        let (hung, scene) = (Vec::new(), turtle::blank(model));
        let leading = model.reads_force().then(Leading::default);
        let notes = false;
        Hanging {
            model,
            place,
            growth,
            number: 0,
            hung,
            leading,
            mire: None,
            notes,
            drapers,
            chooses,
            wind,
            solver,
            scene,
        }
    }

    /// The same on soil that bears solids.
    pub(crate) fn on(self, mire: Option<Mire<'m>>) -> Hanging<'m> {
        Hanging { mire, ..self }
    }

    /// The same with solids on other ways: those of growth under no force, or, with this, under the forces of sheets. Parts have the ways of solids.
    pub(crate) fn noted(self, leading: Option<Leading>) -> Hanging<'m> {
        let mire = self.mire.filter(|_| leading.is_some());
        Hanging { leading, mire, notes: true, ..self }
    }

    /// What solids are under the forces of sheets, if they are.
    pub(crate) fn leading(&self) -> Option<&Leading> {
        self.leading.as_ref()
    }

    /// Sets when the solver gives up.
    pub(crate) fn give_up_at(&mut self, deadline: Option<Instant>) {
        self.solver.deadline = deadline;
    }

    /// Work of the solver so far.
    pub(crate) fn counts(&self) -> Counts {
        self.solver.counts()
    }

    /// Points of all sheets at the tick.
    pub(crate) fn points(&self) -> usize {
        self.hung.iter().map(|hanger| hanger.hung.made.len()).sum()
    }

    /// The size of a copy: points of sheets, and columns of soil.
    pub(crate) fn size(&self) -> usize {
        self.points() + self.mire.as_ref().map_or(0, Mire::stored)
    }

    /// Seconds at the beginning of the present tick.
    pub(crate) fn begin(&self) -> f64 {
        self.number as f64 * TICK
    }

    /// Goes on to the next tick, with solids on the ways on which growth leads them.
    ///
    /// # Errors
    /// A drawing fails, or a sheet cannot be followed.
    pub(crate) fn tick(&mut self) -> Result<Tick, Error> {
        let mut tick = Tick { number: self.number, ..Tick::default() };
        let (mut begin, end) = (self.begin(), self.begin() + TICK);
        while begin < end && tick.failed.is_none() {
            let (part, failed) = match self.leading.take() {
                None => self.one_way((begin, end - begin))?,
                Some(mut leading) => {
                    let gone = self.both_ways(begin, &mut leading);
                    self.leading = Some(leading);
                    gone?
                }
            };
            begin = part.end;
            tick.parts.push(part);
            tick.failed = failed;
        }
        self.number += 1;
        Ok(tick)
    }

    /// Goes on through a span (beginning and length, in s) in which nothing pushes solids.
    pub(crate) fn one_way(&mut self, span: (f64, f64)) -> Result<(Part, Option<Error>), Error> {
        let mut growth = self.growth.clone();
        let view = self.look(&mut growth, span, None)?;
        let tracks = self.solve(&view, span)?;
        self.end(span, (view, growth), tracks, (BTreeMap::new(), &[]))
    }

    /// Lets growth go on through a span (beginning and length, in s), with these forces on solids, and draws what sheets need on the way. Growth may fail there,
    /// after a time that is asked for.
    ///
    /// # Errors
    /// A drawing fails, or a sheet cannot be made.
    pub(crate) fn look(
        &mut self,
        growth: &mut Simulation<'m>,
        (begin, length): (f64, f64),
        exerted: Option<&Exerted>,
    ) -> Result<View, Error> {
        let mut view = View::default();
        let mut watch = Watch::default();
        let (mut string, mut scene) = (ModuleString::default(), std::mem::take(&mut self.scene));
        let mut seen = false;
        for (instant, part) in INSTANTS.into_iter().enumerate() {
            let time = self.place.time_at(begin + length * part);
            match self.pass(growth, time, (&mut string, &mut scene), &mut view) {
                Ok(changed) => seen |= changed,
                Err(error @ Error::Growth(_)) => {
                    view.failed = Some(error);
                    break;
                }
                Err(error) => return Err(error),
            }
            let around = (self.model, &self.place);
            watch.note((instant, &string), around, (&view.descent, Meets::Sheets), &mut scene)?;
            if self.mire.is_some() && matches!(instant, 0 | 3) {
                view.strings[instant / 3].clone_from(&string);
            }
            if let Some(exerted) = exerted.filter(|_| instant == 0)
                && let Err(error) = exerted.act(growth, (begin, length), &self.place)
            {
                view.failed = Some(error);
                break;
            }
        }
        view.paths = watch.paths(begin, length);
        if view.failed.is_none() && (seen || self.chooses) {
            scene.clear();
            turtle::draw(self.model, &string, &mut scene)?;
            self.find_new((&scene, begin + length), &mut view)?;
            view.next = Some(std::mem::take(&mut scene.sheets));
        }
        self.scene = scene;
        Ok(view)
    }

    /// Lets growth go on to a time, with a stop at each production that may place a sheet. True if there were productions.
    fn pass(
        &mut self,
        growth: &mut Simulation<'m>,
        time: f64,
        (string, scene): (&mut ModuleString, &mut Scene),
        view: &mut View,
    ) -> Result<bool, Error> {
        let mut changed = false;
        let mut look = |now: f64, growth: &mut Simulation<'m>, view: &mut View| {
            growth.at(now, string)?;
            scene.clear();
            turtle::draw(self.model, string, scene)?;
            self.find_new((scene, self.place.seconds(now)), view)
        };
        if self.number == 0 && time <= self.place.time_at(0.0) {
            growth.at(time, &mut ModuleString::default())?;
            view.descent.add(self.model, &growth.take_events());
            look(time, growth, view)?;
            return Ok(true);
        }
        while growth.pass_some(time, usize::MAX, true)? != Passed::All {
            let events = growth.take_events();
            changed |= !events.is_empty();
            view.descent.add(self.model, &events);
            let places_one = |event: &dlsys_sim::Event| {
                let successors = &self.model.rules[event.rule].produces[event.clause].outcome.successors;
                successors.iter().any(|string| string.kinds().any(|kind| self.drapers[kind.index()]))
            };
            if events.iter().any(places_one) {
                look(growth.reached(), growth, view)?;
            }
        }
        growth.at(time, string)?;
        let events = growth.take_events();
        view.descent.add(self.model, &events);
        Ok(changed || !events.is_empty())
    }

    /// Adds the sheets of a drawing at a time in s that are not known.
    fn find_new(&self, (scene, now): (&Scene, f64), view: &mut View) -> Result<(), Error> {
        let known = self.hung.iter().map(|hanger| hanger.hung.key);
        let known: Vec<SheetKey> = known.chain(view.births.iter().map(|hung| hung.key)).collect();
        let matched = matched(&scene.sheets, &known, &view.descent);
        for place in scene.sheets.iter().zip(matched).filter(|(_, known)| known.is_none()).map(|pair| pair.0)
        {
            let points = self.points() + view.births.iter().map(|hung| hung.made.len()).sum::<usize>();
            view.births.push(Arc::new(self.hang(place, now, points)?));
        }
        Ok(())
    }

    /// A new sheet where the turtle stands, at a time in s; `before` is the number of points of those that are there.
    fn hang(&self, place: &SheetPlace, now: f64, before: usize) -> Result<Hung, Error> {
        let scenery = &self.model.scenery;
        let declared = &scenery.sheets[place.sheet];
        let span = || place.origin.span(self.model).unwrap_or(declared.span);
        let time = self.place.time_at(now);
        if before + declared.points.len() > MOST_SHEET_POINTS {
            return Err(Error::TooManySheets { most: MOST_SHEET_POINTS, time, span: span() });
        }
        let metre = self.place.units.length;
        let at =
            |point: &[f64; 3]| self.place.point(place.placement.point(Point::from(*point)).coords * metre);
        let points = declared.points.iter().map(at).collect();
        let mesh = Mesh { points, faces: declared.faces.clone(), cords: declared.cords.clone() };
        let made = Sheet::new(&mesh, &material(&scenery.tissues[declared.tissue]), |_| false);
        let made =
            made.map_err(|error| Error::Sheet { name: declared.name.clone(), error, time, span: span() })?;
        let made = Arc::new(made.pinned_at(&declared.pinned));
        Ok(Hung { key: place.key, origin: place.origin, sheet: place.sheet, made, begin: now })
    }

    /// The sheets in the order in which they are followed, with those that are born in a view.
    pub(crate) fn hangers(&self, view: &View) -> Vec<Hanger> {
        let born = |hung: &Arc<Hung>| {
            let mut state = State::at_rest(&hung.made);
            let pinned = &self.model.scenery.sheets[hung.sheet].pinned;
            let draw = Draw::new(hung.key.module).of(hung.key.number.into());
            for (point, velocity) in
                state.velocities.iter_mut().enumerate().filter(|(point, _)| !pinned[*point])
            {
                let part = |axis| 2.0 * draw.of(point as u64).of(axis).unit() - 1.0;
                *velocity = Vector::new(part(0), part(1), part(2)) * TREMBLE;
            }
            Hanger { hung: hung.clone(), state, forces: Vec::new() }
        };
        self.hung.iter().cloned().chain(view.births.iter().map(born)).collect()
    }

    /// The height of the ground, if there is one, where solids that stand still are.
    pub(crate) fn floor(&self) -> Option<Stand> {
        self.place.ground.map(|height| Stand::at(Vector::new(0.0, height, 0.0)))
    }

    /// Follows all sheets through a span.
    pub(crate) fn solve(&mut self, view: &View, (begin, length): (f64, f64)) -> Result<Vec<Track>, Error> {
        let ways: Vec<_> = view.paths.iter().map(|path| |time: f64| path.place(time)).collect();
        let mut solids: Vec<Solid> =
            view.paths.iter().zip(&ways).map(|(path, way)| Solid::guided(&path.shape, way)).collect();
        let floor = Shape::half_space();
        let below = self.floor();
        let ground = move |_: f64| below.unwrap_or(Stand::at(Vector::zeros()));
        if below.is_some() {
            solids.push(Solid::guided(&floor, &ground));
        }
        let span = begin..begin + length;
        self.hangers(view)
            .into_iter()
            .map(|hanger| self.follow(hanger, &solids, span.clone(), |_| ()))
            .collect()
    }

    /// Follows a sheet through a span of seconds.
    pub(crate) fn follow(
        &mut self,
        Hanger { hung, mut state, .. }: Hanger,
        solids: &[Solid],
        span: std::ops::Range<f64>,
        mut observe: impl FnMut(&Step),
    ) -> Result<Track, Error> {
        let from = hung.begin.max(span.start);
        let mut steps = vec![(from, state.clone())];
        let mut impulses = vec![Vector::zeros(); solids.len()];
        if from < span.end {
            let wind = Gusts(&self.wind);
            let note = |step: &Step| {
                steps.push((step.to, step.after.clone()));
                impulses.iter_mut().zip(step.pushes).for_each(|(sum, push)| *sum += push.impulse);
                observe(step);
            };
            let done = self.solver.advance(&hung.made, &mut state, from..span.end, solids, &wind, note);
            done.map_err(|error| self.failed(&hung, error))?;
        }
        let pushes = impulses.into_iter().enumerate().filter(|(_, impulse)| *impulse != Vector::zeros());
        Ok(Track { hung, steps, forces: Vec::new(), pushes: pushes.collect() })
    }

    /// A sheet that cannot be followed.
    fn failed(&self, hung: &Hung, error: sheet::Error) -> Error {
        let declared = &self.model.scenery.sheets[hung.sheet];
        let time = self.place.time_at(self.begin());
        if let sheet::Error::OutOfTime { .. } = error {
            return Error::OutOfTime { limit: f64::NAN, time, span: declared.span };
        }
        let span = hung.origin.span(self.model).unwrap_or(declared.span);
        self.wind.failure().unwrap_or(Error::Sheet { name: declared.name.clone(), error, time, span })
    }

    /// The next tick begins, or the next part of one. Also returns why growth fails before, if it does.
    pub(crate) fn end(
        &mut self,
        (begin, length): (f64, f64),
        (view, growth): (View, Simulation<'m>),
        tracks: Vec<Track>,
        (forces, of_soil): (BTreeMap<u64, Line>, &[(u64, Line)]),
    ) -> Result<(Part, Option<Error>), Error> {
        let last = |track: &Track| {
            let (_, state) = track.steps.last()?;
            let mean = |(module, line): &(u64, Line)| (*module, Line::constant(line.mean(length)));
            let forces = track.forces.iter().map(mean).collect();
            // Solids that are led begin anew.
            let state = state.clone().with(Vec::new());
            Some(Hanger { hung: track.hung.clone(), state, forces })
        };
        let mut hung: Vec<Hanger> = tracks.iter().filter_map(last).collect();
        if let Some(places) = &view.next {
            let mut here: Vec<Hanger> = Vec::with_capacity(places.len());
            let known: Vec<SheetKey> = hung.iter().map(|hanger| hanger.hung.key).collect();
            for (place, known) in places.iter().zip(matched(places, &known, &view.descent)) {
                let Some(before) = known.map(|known| &hung[known]) else { continue };
                let Hung { sheet, ref made, begin, .. } = *before.hung;
                let made = Arc::clone(made);
                let next = Arc::new(Hung { key: place.key, origin: place.origin, sheet, made, begin });
                here.push(Hanger { hung: next, ..before.clone() });
            }
            hung = here;
        }
        self.hung = hung;
        self.growth = growth;
        if let Some(mire) = self.mire.as_mut().filter(|_| view.failed.is_none()) {
            let at_end = (&view.strings[1], begin + length);
            mire.go_on(at_end, (&view.descent, of_soil), length, &mut self.scene)?;
        }
        let ends = [begin, begin + length];
        let passage = |path: &Path| {
            let (origin, size) = (path.origin, 2.0 * path.shape.reach());
            Passage { origin, size, ends: ends.map(|time| path.place(time)) }
        };
        let passages = if self.notes { view.paths.iter().map(passage).collect() } else { Vec::new() };
        let part = Part { end: begin + length, tracks, descent: view.descent, forces, passages };
        Ok((part, view.failed))
    }
}

/// For each place of a sheet the number of the sheet that hangs there: that of its module, or of one before it. Where a production has made two of a
/// module, the first goes on with its sheets, and the others have new ones.
pub(crate) fn matched(places: &[SheetPlace], known: &[SheetKey], descent: &Descent) -> Vec<Option<usize>> {
    let mut free: HashMap<SheetKey, usize> = known.iter().copied().zip(0..).collect();
    let mut found: Vec<Option<usize>> = places.iter().map(|place| free.remove(&place.key)).collect();
    for (place, found) in places.iter().zip(&mut found).filter(|(_, found)| found.is_none()) {
        let mut line = descent.line(place.key.module).skip(1);
        *found = line.find_map(|module| free.remove(&SheetKey { module, ..place.key }));
    }
    found
}

/// The material of a tissue of constant stiffness.
pub(crate) fn material(tissue: &Tissue) -> sheet::Tissue {
    let stiffness = tissue.stiffness.eval_one(&[0.0]);
    sheet::Tissue {
        damping: tissue.damping,
        ..sheet::Tissue::new(stiffness, tissue.density, tissue.thickness)
    }
}
