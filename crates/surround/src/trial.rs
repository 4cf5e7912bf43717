//! Trials of coupling: a model's solids among its sheets, once as growth leads them and once pushed by the sheets, observed from tick to tick.
//!
//! ```text
//! Ways::Own     growth under no force      ──paths──▶ sheets      one-way, whatever rules read
//! Ways::Pushed  growth under their forces  ◀──────▶  sheets       two-way: rules read forces, or a mass is given
//! ```

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use dlsys_geometry::turtle;
use dlsys_model::{KindId, Model};
use dlsys_sheet::{Counts, Matrix, Vector};
use dlsys_sim::Settings;
use dlsys_tree::Lineage;

use crate::Error;
use crate::descent::Descent;
use crate::hanging::{Hanging, TICK};
use crate::leading::Leading;
use crate::motion::MOST_TICKS;
use crate::place::Place;
use crate::sheets;
use crate::tracks::{Passage, Tick, Track};

/// On which ways solids go.
#[derive(Clone, Debug, PartialEq)]
pub enum Ways {
    /// Those of growth; rules that read forces read 0.
    Own,
    /// Those of growth under the forces of sheets. Kinds whose rules read none may have masses in kg: to their ways is added what the forces do to such a mass.
    Pushed(BTreeMap<KindId, f64>),
}

/// A solid in a tick, in SI units and along the axes of the scene.
#[derive(Clone, Debug)]
pub struct SolidSeen {
    /// The kind of its module at the beginning of the tick.
    pub kind: KindId,
    /// That module.
    pub lineage: Lineage,
    /// Twice the largest distance of a point of it from its centre, in m.
    pub size: f64,
    /// Its centre at the beginning and at the end, in m.
    pub places: [Vector; 2],
    /// Its velocity at the beginning and at the end, in m/s.
    pub velocities: [Vector; 2],
    /// The impulse (N s) of each declared sheet that touched it, by their numbers.
    pub impulses: BTreeMap<usize, Vector>,
    /// Its inverse mass in 1/kg, if sheets push it.
    pub light: Option<Matrix>,
}

/// The sheets of one declaration in a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct SheetSeen {
    /// Number of those that hang.
    pub count: usize,
    /// The mass of all, in kg.
    pub mass: f64,
    /// The largest stretch of an edge or a cord at the end of the tick: its length relative to that in the file, less 1.
    pub stretch: f64,
}

/// What happens in a tick.
#[derive(Clone, Debug, Default)]
pub struct TrialTick {
    /// Its beginning and its end, in s.
    pub span: [f64; 2],
    /// The solids that are there at its beginning.
    pub solids: Vec<SolidSeen>,
    /// By the number of the declaration.
    pub sheets: Vec<SheetSeen>,
}

/// A run of a model with its sheets, from t = 0 on.
pub struct Trial<'m> {
    model: &'m Model,
    place: Place,
    hanging: Hanging<'m>,
    limit: f64,
    spent: Duration,
}

impl<'m> Trial<'m> {
    /// At t = 0. `None` if the model places no sheet.
    ///
    /// # Errors
    /// A wind without meaning, or the first instant fails.
    pub fn new(model: &'m Model, settings: Settings, ways: Ways) -> Result<Option<Trial<'m>>, Error> {
        let place = Place::of_scene(&model.scenery);
        if !turtle::drapes(model) {
            return Ok(None);
        }
        let Some(hanging) = sheets::first(model, settings, place)? else { return Ok(None) };
        let leading = match ways {
            Ways::Own => None,
            Ways::Pushed(masses) => Some(Leading::with(masses)),
        };
        let (limit, spent) = (settings.max_seconds, Duration::ZERO);
        Ok(Some(Trial { model, place, hanging: hanging.noted(leading), limit, spent }))
    }

    /// Goes on to the next tick, if it begins before a time of the model.
    ///
    /// # Errors
    /// Growth fails, a sheet cannot be followed, or solids and sheets both ways; there are too many ticks, or they take too long.
    pub fn tick(&mut self, until: f64) -> Result<Option<TrialTick>, Error> {
        let begin = self.hanging.begin();
        if begin >= self.place.seconds(until) {
            return Ok(None);
        }
        let span = self.model.scenery.sheets.first().map(|sheet| sheet.span).unwrap_or_default();
        let time = self.place.time_at(begin);
        if self.hanging.number as f64 > MOST_TICKS {
            return Err(Error::TooLong { most: MOST_TICKS, time, seconds: self.place.units.time, span });
        }
        let begun = Instant::now();
        let left =
            Duration::try_from_secs_f64(self.limit).unwrap_or(Duration::MAX).saturating_sub(self.spent);
        let deadline = self.limit.is_finite().then(|| begun.checked_add(left)).flatten();
        self.hanging.give_up_at(deadline);
        let tick = self.hanging.tick();
        self.spent += begun.elapsed();
        if self.spent.as_secs_f64() > self.limit {
            return Err(Error::OutOfTime { limit: self.limit, time, span });
        }
        let tick = tick?;
        match tick.failed {
            Some(error) => Err(error),
            None => Ok(Some(self.seen(&tick))),
        }
    }

    /// Seconds of computing so far.
    pub fn spent(&self) -> f64 {
        self.spent.as_secs_f64()
    }

    /// Work of the solver of sheets so far.
    pub fn counts(&self) -> Counts {
        self.hanging.counts()
    }

    fn seen(&self, tick: &Tick) -> TrialTick {
        let begin = tick.number as f64 * TICK;
        let mut solids: Vec<SolidSeen> = Vec::new();
        // Numbers of the solids by the modules that draw them at the beginning of the present part.
        let mut numbers: BTreeMap<u64, usize> = BTreeMap::new();
        let mut before = &Descent::default();
        for part in &tick.parts {
            let mut next = BTreeMap::new();
            let mut here = Vec::with_capacity(part.passages.len());
            for Passage { origin, size, ends } in &part.passages {
                let module = origin.lineage.id;
                let known = before.line(module).find_map(|id| numbers.get(&id)).copied();
                let number = known.unwrap_or_else(|| {
                    solids.push(SolidSeen {
                        kind: origin.kind,
                        lineage: origin.lineage,
                        size: *size,
                        places: ends.map(|end| end.position),
                        velocities: ends.map(|end| end.velocity),
                        impulses: BTreeMap::new(),
                        light: None,
                    });
                    solids.len() - 1
                });
                let solid = &mut solids[number];
                (solid.places[1], solid.velocities[1]) = (ends[1].position, ends[1].velocity);
                next.insert(module, number);
                here.push(number);
            }
            for track in &part.tracks {
                for (path, impulse) in &track.pushes {
                    // Beyond the solids there is the floor.
                    let Some(&number) = here.get(*path) else { continue };
                    *solids[number].impulses.entry(track.hung.sheet).or_default() += impulse;
                }
            }
            (numbers, before) = (next, &part.descent);
        }
        if let Some(leading) = self.hanging.leading() {
            for (module, number) in &numbers {
                solids[*number].light = leading.masses.get(module).copied();
            }
        }
        let mut sheets = vec![SheetSeen::default(); self.model.scenery.sheets.len()];
        for track in tick.parts.last().iter().flat_map(|part| &part.tracks) {
            let seen = &mut sheets[track.hung.sheet];
            seen.count += 1;
            seen.mass += track.hung.made.masses().iter().sum::<f64>();
            seen.stretch = seen.stretch.max(self.stretch(track));
        }
        TrialTick { span: [begin, begin + TICK], solids, sheets }
    }

    /// The largest stretch at the end of a track.
    fn stretch(&self, track: &Track) -> f64 {
        let Some((_, state)) = track.steps.last() else { return 0.0 };
        let (made, declared) = (&track.hung.made, &self.model.scenery.sheets[track.hung.sheet]);
        let faces = made.triangles().iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let edges = faces.chain(declared.cords.iter().copied());
        let length = |points: &[Vector], [a, b]: [usize; 2]| (points[a] - points[b]).norm();
        let stretch = |edge| length(&state.positions, edge) / length(made.rest(), edge) - 1.0;
        edges.map(stretch).filter(|stretch| stretch.is_finite()).fold(0.0, f64::max)
    }
}
