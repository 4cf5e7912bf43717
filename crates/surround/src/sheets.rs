//! The sheets of a model at any time: flexible surfaces and nets, the same bits whatever is asked for, in whatever order.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dlsys_diagnostic::Span;
use dlsys_geometry::scene::{
    MaterialId, Mesh, Placement, Point, Scene, Segment, SheetKey, SheetPlace, Surface, Vector, Width,
};
use dlsys_geometry::turtle;
use dlsys_model::{self as model, Model};
use dlsys_sheet::{Counts, State};
use dlsys_sim::{Settings, Simulation};

use crate::Error;
use crate::coupled;
use crate::hanging::{Hanging, TICK, matched};
use crate::marks::{Marks, Recent};
use crate::mire::Mire;
use crate::motion::MOST_TICKS;
use crate::place::Place;
use crate::sampler::Sampler;
use crate::tracks::Tick;
use crate::weather::Weather;

/// Most points of the ticks that are kept for times that come a little late, and of marks.
const MOST_KEPT: usize = 2_000_000;
const MOST_MARKED: usize = 2_000_000;

/// The sheets of a model.
pub struct Sheets<'m> {
    model: &'m Model,
    settings: Settings,
    place: Place,
    /// The faces of each that is declared, in the shape of its file; `None` for one of cords alone.
    rests: Vec<Option<Arc<Mesh>>>,
    runs: Mutex<Runs<'m>>,
}

struct Runs<'m> {
    start: Hanging<'m>,
    present: Option<Hanging<'m>>,
    past: Recent<Arc<Tick>>,
    marks: Marks<Hanging<'m>>,
    spent: Duration,
}

impl<'m> Sheets<'m> {
    /// The sheets of the model of a scene; `None` if nothing places one.
    ///
    /// # Errors
    /// A wind without meaning, or the first instant fails.
    pub fn new(model: &'m Model, settings: Settings) -> Result<Option<Sheets<'m>>, Error> {
        if !turtle::drapes(model) {
            return Ok(None);
        }
        Sheets::and_soil(model, settings)
    }

    /// The same, also if only soil pushes solids; `None` if nothing does.
    ///
    /// # Errors
    /// As of [`Sheets::new`], and a ground whose values are out of range.
    pub(crate) fn and_soil(model: &'m Model, settings: Settings) -> Result<Option<Sheets<'m>>, Error> {
        let place = Place::of_scene(&model.scenery);
        let Some(start) = first(model, settings, place)? else { return Ok(None) };
        let (past, marks) = (Recent::new(MOST_KEPT), Marks::new(MOST_MARKED));
        let runs = Runs { start, present: None, past, marks, spent: Duration::ZERO };
        let rests = model.scenery.sheets.iter().map(|sheet| at_rest(sheet)).collect();
        let settings = logged(settings);
        Ok(Some(Sheets { model, settings, place, rests, runs: Mutex::new(runs) }))
    }

    /// Draws the sheets that a scene places, as they are at a time of the model. They follow what is drawn there.
    ///
    /// # Errors
    /// The growth up to that time fails; a sheet cannot be followed; there are too many ticks or points, or the wind has no value.
    pub fn draw(&self, time: f64, scene: &mut Scene) -> Result<(), Error> {
        if scene.sheets.is_empty() {
            return Ok(());
        }
        let seconds = self.place.seconds(time).max(0.0);
        let tick = self.tick(time, seconds)?;
        let Some(part) = tick.part(seconds) else { return Ok(()) };
        let known: Vec<SheetKey> = part.tracks.iter().map(|track| track.hung.key).collect();
        let places = scene.sheets.clone();
        for (place, known) in places.iter().zip(matched(&places, &known, &part.descent)) {
            let state = known.and_then(|track| part.tracks[track].at(seconds));
            self.add(place, state, scene);
        }
        Ok(())
    }

    /// Work of the solver in the run that is at present the latest.
    pub fn counts(&self) -> Counts {
        let runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        runs.present.as_ref().map_or_else(Counts::default, Hanging::counts)
    }

    /// The tick within which a time lies; a time at the end of a tick belongs to that.
    fn tick(&self, time: f64, seconds: f64) -> Result<Arc<Tick>, Error> {
        let number = ((seconds / TICK).ceil() - 1.0).max(0.0);
        self.tick_of(number, time)
    }

    /// The tick of a number, for a time of the model.
    pub(crate) fn tick_of(&self, number: f64, time: f64) -> Result<Arc<Tick>, Error> {
        if number > MOST_TICKS {
            let second = self.place.units.time;
            return Err(Error::TooLong { most: MOST_TICKS, time, seconds: second, span: self.span() });
        }
        let number = number as u64;
        let mut runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        let runs = &mut *runs;
        if let Some(tick) = runs.past.get(number) {
            return Ok(Arc::clone(tick));
        }
        let begun = Instant::now();
        let limit = self.settings.max_seconds;
        let left = Duration::try_from_secs_f64(limit).unwrap_or(Duration::MAX).saturating_sub(runs.spent);
        let deadline = limit.is_finite().then(|| begun.checked_add(left)).flatten();
        let done = self.go_to(runs, number, deadline);
        runs.spent += begun.elapsed();
        match done {
            Err(Error::OutOfTime { time, span, .. }) => Err(Error::OutOfTime { limit, time, span }),
            done => done,
        }
    }

    fn go_to(&self, runs: &mut Runs<'m>, number: u64, deadline: Option<Instant>) -> Result<Arc<Tick>, Error> {
        let mut present = match runs.present.take() {
            Some(present) if present.number <= number => present,
            _ => {
                runs.past.clear();
                runs.marks.before(number).unwrap_or(&runs.start).clone()
            }
        };
        present.give_up_at(deadline);
        loop {
            let tick = Arc::new(present.tick()?);
            runs.past.add(tick.number, Arc::clone(&tick), tick.size());
            if tick.failed.is_none() {
                runs.marks.set(present.number, &present, Hanging::size);
            }
            if let Some(error) = tick.failed.as_ref().filter(|_| tick.number < number) {
                return Err(error.clone());
            }
            if tick.number == number {
                // Nothing comes after a failure.
                runs.present = tick.failed.is_none().then_some(present);
                return Ok(tick);
            }
            if deadline.is_some_and(|deadline| Instant::now() > deadline) {
                let time = self.place.time_at(present.begin());
                return Err(Error::OutOfTime { limit: f64::NAN, time, span: self.span() });
            }
        }
    }

    /// The declaration of the first sheet.
    fn span(&self) -> Span {
        let scenery = &self.model.scenery;
        let sheet = scenery.sheets.first().map(|sheet| sheet.span);
        sheet.or(scenery.bed.as_ref().map(|bed| bed.span)).unwrap_or_default()
    }

    /// Draws a sheet: faces as one surface, cords as stems. Without a state it has the shape of its file.
    fn add(&self, place: &SheetPlace, state: Option<State>, scene: &mut Scene) {
        let declared = &self.model.scenery.sheets[place.sheet];
        let metre = self.place.units.length;
        let points: Vec<Point> = match state {
            Some(state) => state.positions.iter().map(|point| Point::from(point / metre)).collect(),
            None => declared.points.iter().map(|point| place.placement.point(Point::from(*point))).collect(),
        };
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        if let Some(rest) = &self.rests[place.sheet] {
            let mesh = Arc::new(rest.moved(points.clone()));
            let placement = Placement::uniform(Point::origin(), axes, 1.0);
            let (tint, owner, rest) = (place.tint, place.owner, Some(Arc::clone(rest)));
            scene.surfaces.push(Surface { mesh, patches: None, rest, placement, tint, owner });
        }
        let tissue = &self.model.scenery.tissues[declared.tissue];
        let width = Width::Set(tissue.thickness / metre);
        let first = scene.segments.len();
        for [from, to] in &declared.cords {
            let (start, end) = (points[*from], points[*to]);
            let Some(direction) = (end - start).try_normalize(0.0) else { continue };
            let last = scene.segments[first..].last().filter(|last| last.end == start);
            // Along a cord the cross-section does not turn.
            let beside = last.map_or(axes[direction.iamin()], |last| last.across);
            let across = beside - direction * beside.dot(&direction);
            let across = across.try_normalize(1e-9).unwrap_or_else(|| {
                let other = axes[direction.iamin()];
                (other - direction * other.dot(&direction)).normalize()
            });
            let follows = last.map(|_| scene.segments.len() - 1);
            scene.segments.push(Segment {
                start,
                end,
                direction,
                across,
                widths: [width; 2],
                contour: None,
                material: place.tint.unwrap_or(MaterialId::STEM),
                owner: place.owner,
                follows,
                grows_from: None,
            });
        }
    }
}

/// Settings of a growth whose productions are known.
fn logged(settings: Settings) -> Settings {
    Settings { log: true, transitions: false, ..settings }
}

/// The sheets of a model at the first tick; `None` if nothing places one, and no soil bears solids whose rules read that.
pub(crate) fn first<'m>(
    model: &'m Model,
    settings: Settings,
    place: Place,
) -> Result<Option<Hanging<'m>>, Error> {
    let settings = logged(settings);
    let mire = Mire::new(model, place, settings)?;
    if !turtle::drapes(model) && mire.is_none() {
        return Ok(None);
    }
    // Forces of sheets on solids are computed here.
    let growth = match model.reads_force() {
        true => Simulation::new(model, settings)?,
        false => coupled::start(model, settings, place)?,
    };
    let wind = Arc::new(Sampler::new(Weather::around_bodies(&model.scenery)?, place));
    Ok(Some(Hanging::new(model, (growth, place), wind, settings.bending.tolerance).on(mire)))
}

/// The faces of a sheet as triangles.
fn at_rest(sheet: &model::Sheet) -> Option<Arc<Mesh>> {
    let fan = |face: &Vec<usize>| {
        (2..face.len()).map(|k| [face[0], face[k - 1], face[k]].map(|i| i as u32)).collect::<Vec<_>>()
    };
    let triangles = sheet.faces.iter().flat_map(fan).map(|corners| (corners, MaterialId::PETAL));
    let points = sheet.points.iter().map(|point| Point::from(*point)).collect();
    (!sheet.faces.is_empty()).then(|| Arc::new(Mesh::of_triangles(points, &[], triangles)))
}
