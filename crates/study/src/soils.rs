//! Error of the ground of a scene against work, by the size of columns and by the length of a tick.
//!
//! All runs have the same growth. They are compared at places of one grid, those where the material has moved: with the run with columns half as wide, and with the one with the shortest ticks.

use std::time::Instant;

use dlsys_model::Model;
use dlsys_session::Session;
use dlsys_sim::{Settings, brief};
use dlsys_surround::{GROUND_TICKS, Motion, Passive, Place, Terrain, Weather};

use super::allowance::{Allowance, Purse, Stopwatch};
use super::table::Table;

/// Widths of columns, in those of the scene, from the coarsest on; the last one is that of the reference.
const CELLS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];
/// Ticks in a second, in those of a scene, likewise.
const TICKS: [f64; 4] = [0.25, 0.5, 1.0, 4.0];
/// The part of the time for the study that its first run may take, where it may end at an earlier time.
const FIRST: f64 = 0.06;
/// Most places along an axis at which runs are compared.
const PLACES: f64 = 200.0;
/// The material has moved where the height has changed by more than this part of a column of the scene.
const MOVED: f64 = 0.02;

/// A run.
#[derive(Clone, Debug)]
pub struct SoilPoint {
    /// Width of a column, in units of the model, and ticks in a second.
    pub cell: f64,
    /// See `cell`.
    pub ticks: f64,
    /// What came out; the reason why nothing did otherwise.
    pub result: Result<SoilOutcome, String>,
}

/// What a run of a ground gives.
#[derive(Clone, Copy, Debug)]
pub struct SoilOutcome {
    /// Volume that is elsewhere than in the reference, as a part of what has moved there: half the mean difference of heights by the mean change of height.
    pub misplaced: f64,
    /// Largest difference of heights, in units of the model.
    pub height: f64,
    /// Mean difference of slopes, in degrees, over two columns of the coarsest run.
    pub slope: f64,
    /// What the volume has changed by without being poured, in parts of quanta.
    pub imbalance: i128,
    /// Columns that were computed, and the seconds that this took.
    pub updates: u64,
    /// See `updates`.
    pub seconds: f64,
}

/// Sizes of columns and ticks side by side on a scene.
#[derive(Clone, Debug)]
pub struct SoilStudy {
    /// By the size of columns, from the coarsest on, with the ticks of the scene; and by ticks, with the columns of the scene. The last one of each is the reference.
    pub by_cell: Vec<SoilPoint>,
    /// See `by_cell`.
    pub by_tick: Vec<SoilPoint>,
    /// Number of times and of places at which heights are compared.
    pub times: usize,
    /// The last of the times.
    pub last: f64,
    /// See `times`.
    pub places: usize,
}

/// Heights at the places of a grid, at each time.
#[derive(Clone)]
struct Track {
    heights: Vec<Vec<f64>>,
    imbalance: i128,
    updates: u64,
    seconds: f64,
}

/// The places at which heights are compared: square, in rows along x.
#[derive(Clone, Copy)]
struct Places {
    low: [f64; 2],
    step: f64,
    counts: [usize; 2],
}

impl Places {
    fn all(self) -> impl Iterator<Item = [f64; 2]> {
        let Places { low, step, counts } = self;
        let at =
            move |n: usize| [low[0] + step * (n % counts[0]) as f64, low[1] + step * (n / counts[0]) as f64];
        (0..counts[0] * counts[1]).map(at)
    }
}

/// Runs a scene with columns and ticks of several sizes. `None` if its ground is rigid, if it has none, or if rules read its heights or forces, so that growth would be another one.
/// Runs that would take longer than what is allowed are left out.
///
/// # Errors
/// The reason why the scene as it is does not come to the last time.
pub fn soil_study(
    session: &Session,
    times: &[f64],
    settings: Settings,
    allowance: Allowance,
    say: &mut dyn FnMut(&str),
) -> Result<Option<SoilStudy>, String> {
    let model = &session.model;
    let Some(bed) = &model.scenery.bed else { return Ok(None) };
    let reads = model.scenery.heights.is_some() || model.reads_force();
    if times.is_empty() || reads {
        return Ok(None);
    }
    let cell = bed.cell;
    let purse = Purse::open(allowance);
    let settings = Settings { max_seconds: settings.max_seconds.min(allowance.run), ..settings };
    // Where anything has moved by the last time.
    say(&format!("columns of {}", brief(cell, 3)));
    let (count, places) = moved(model, times, settings, purse.first(FIRST))?;
    let (Some(places), times) = (places, &times[..count]) else { return Ok(None) };
    let mut known = Vec::new();
    let mut run = |cells: f64, ticks: f64| -> Result<Track, String> {
        let is_known = |(run, _): &&([f64; 2], Track)| *run == [cells, ticks];
        if let Some((_, track)) = known.iter().find(is_known) {
            return Ok(Track::clone(track));
        }
        // In proportion to the columns and to the ticks, from the run that is as it is declared, which is the first.
        if let Some((_, Track { seconds, .. })) = known.first() {
            purse.fits(seconds * ticks / (cells * cells), allowance.all)?;
        }
        let (wide, often) = (cell * cells, GROUND_TICKS * ticks);
        say(&format!("columns of {}, {} ticks a second", brief(wide, 3), brief(often, 4)));
        let mut model = model.clone();
        if let Some(bed) = &mut model.scenery.bed {
            bed.cell = wide;
        }
        let track = track(&model, (times, places), (settings, often), allowance.run)?;
        known.push(([cells, ticks], track.clone()));
        Ok(track)
    };
    // The references last, which take longest.
    let as_declared = run(1.0, 1.0);
    let mut by_cell = CELLS.map(|cells| (cell * cells, GROUND_TICKS, Err(String::new())));
    let mut by_tick = TICKS.map(|ticks| (cell, GROUND_TICKS * ticks, Err(String::new())));
    for n in 0..CELLS.len() {
        by_cell[n].2 = if CELLS[n] == 1.0 { as_declared.clone() } else { run(CELLS[n], 1.0) };
        by_tick[n].2 = if TICKS[n] == 1.0 { as_declared.clone() } else { run(1.0, TICKS[n]) };
    }
    let first: Vec<f64> = places.all().map(|[x, z]| bed.surface(x, z)).collect();
    let compared = |tracks: [(f64, f64, Result<Track, String>); 4]| -> Vec<SoilPoint> {
        // The finest that came to the end.
        let finest = tracks.iter().rposition(|(.., track)| track.is_ok());
        let points = tracks.iter().map(|(cell, ticks, track)| {
            let reference = finest.and_then(|finest| tracks[finest].2.as_ref().ok());
            let result = match (track, reference) {
                (Ok(track), Some(reference)) => Ok(outcome(track, reference, &first, places)),
                (Err(why), _) => Err(why.clone()),
                (Ok(_), None) => Err(String::new()),
            };
            SoilPoint { cell: *cell, ticks: *ticks, result }
        });
        points.collect()
    };
    let count = places.counts[0] * places.counts[1];
    Ok(Some(SoilStudy {
        by_cell: compared(by_cell),
        by_tick: compared(by_tick),
        times: times.len(),
        last: times.last().copied().unwrap_or(0.0),
        places: count,
    }))
}

/// The ground of a model and the motion of its stems.
fn passive(
    model: &Model,
    settings: Settings,
    ticks: f64,
) -> Result<(Terrain<'_>, Option<Motion<'_>>), String> {
    let fault = |error: dlsys_surround::Error| error.diagnostic().message;
    let terrain = Terrain::with_ticks(model, settings, (1, ticks)).map_err(fault)?;
    let weather = Weather::of(model, settings).map_err(fault)?;
    let place = Place::of_scene(&model.scenery);
    let motion =
        Motion::new(model, settings, weather, place, Passive::of(settings.bending)).map_err(fault)?;
    Ok((terrain.ok_or("the ground is rigid")?, motion))
}

/// The places around all that differs from the surface at the beginning at the last time; none if nothing does. Where it takes longer than `enough`
/// seconds to come there, that is an earlier one: returns also the number of times up to it.
fn moved(
    model: &Model,
    times: &[f64],
    settings: Settings,
    enough: Option<f64>,
) -> Result<(usize, Option<Places>), String> {
    let Some(bed) = &model.scenery.bed else { return Ok((0, None)) };
    let stopwatch = Stopwatch::start(enough);
    let (terrain, motion) = passive(model, settings, GROUND_TICKS)?;
    let fault = |error: dlsys_surround::Error| error.diagnostic().message;
    let (mut count, mut extent) = (0, None);
    for &time in times {
        extent = terrain.moved(time, motion.as_ref()).map_err(fault)?;
        count += 1;
        // What has not moved yet is no study.
        if extent.is_some() && stopwatch.is_enough(count) {
            break;
        }
    }
    let Some([low, high]) = extent else { return Ok((count, None)) };
    let long = (high[0] - low[0]).max(high[1] - low[1]);
    let step = bed.cell.max(long / (PLACES - 1.0));
    let counts = [0, 1].map(|axis| ((high[axis] - low[axis]) / step).floor() as usize + 1);
    Ok((count, Some(Places { low, step, counts })))
}

/// A run. What it takes is timed; growth is a part of that.
fn track(
    model: &Model,
    (times, places): (&[f64], Places),
    (settings, ticks): (Settings, f64),
    limit: f64,
) -> Result<Track, String> {
    let fault = |error: dlsys_surround::Error| error.diagnostic().message;
    let (terrain, motion) = passive(model, settings, ticks)?;
    let (mut seconds, mut heights) = (0.0, Vec::with_capacity(times.len()));
    let (mut imbalance, mut updates) = (0, 0);
    for &time in times {
        let begun = Instant::now();
        let report = terrain.report(time, motion.as_ref()).map_err(fault)?;
        seconds += begun.elapsed().as_secs_f64();
        if seconds > limit {
            return Err(format!("longer than {} s", brief(limit, 3)));
        }
        (imbalance, updates) = (imbalance + report.imbalance.abs(), report.updates);
        let all = places.all().map(|place| terrain.height(time, place, motion.as_ref()).map_err(fault));
        heights.push(all.collect::<Result<Vec<f64>, String>>()?);
    }
    Ok(Track { heights, imbalance, updates, seconds })
}

/// A run against the reference.
fn outcome(track: &Track, reference: &Track, first: &[f64], places: Places) -> SoilOutcome {
    let (mut apart, mut changed, mut height) = (0.0, 0.0, 0.0_f64);
    let (mut turned, mut count) = (0.0, 0_usize);
    for (run, best) in track.heights.iter().zip(&reference.heights) {
        for n in 0..first.len() {
            let by = (run[n] - best[n]).abs();
            (apart, changed, height) = (apart + by, changed + (best[n] - first[n]).abs(), height.max(by));
            if let (Some(a), Some(b)) = (slope(run, n, places), slope(best, n, places)) {
                let moved = (best[n] - first[n]).abs() > MOVED * places.step;
                turned += if moved { (a - b).abs() } else { 0.0 };
                count += usize::from(moved);
            }
        }
    }
    SoilOutcome {
        misplaced: if changed > 0.0 { 0.5 * apart / changed } else { 0.0 },
        height,
        slope: turned / count.max(1) as f64,
        imbalance: track.imbalance,
        updates: track.updates,
        seconds: track.seconds,
    }
}

/// The angle of the surface at a place, in degrees, over four places along each axis; none at the edge.
fn slope(heights: &[f64], n: usize, places: Places) -> Option<f64> {
    /// Places to each side.
    const SIDE: usize = 2;
    let [columns, rows] = places.counts;
    let (i, k) = (n % columns, n / columns);
    if i < SIDE || k < SIDE || i + SIDE >= columns || k + SIDE >= rows {
        return None;
    }
    let wide = 2.0 * SIDE as f64 * places.step;
    let along = (heights[n + SIDE] - heights[n - SIDE]) / wide;
    let across = (heights[n + SIDE * columns] - heights[n - SIDE * columns]) / wide;
    Some(along.hypot(across).atan().to_degrees())
}

/// The study as two tables for a terminal.
pub fn soil_table(study: &SoilStudy) -> String {
    let mut out =
        format!("\nground, at {} times and {} places where it has changed\n", study.times, study.places);
    for (name, points) in [("columns", &study.by_cell), ("ticks a second", &study.by_tick)] {
        let reference = points.iter().rposition(|point| point.result.is_ok());
        let mut table = Table::default();
        let heads = [name, "misplaced", "height", "slope", "volume", "column updates", "time", ""];
        table.push(heads.map(str::to_owned));
        for (number, point) in points.iter().enumerate() {
            let size = if name == "columns" { brief(point.cell, 3) } else { brief(point.ticks, 4) };
            let blank = [const { String::new() }; 3];
            let (errors, work, note) = match &point.result {
                Ok(SoilOutcome { misplaced, height, slope, imbalance, updates, seconds }) => {
                    let errors =
                        [format!("{misplaced:.1e}"), format!("{height:.1e}"), format!("{slope:.2}°")];
                    let work =
                        [imbalance.to_string(), updates.to_string(), format!("{} s", brief(*seconds, 3))];
                    match Some(number) == reference {
                        true => (blank, work, "the reference".to_owned()),
                        false => (errors, work, String::new()),
                    }
                }
                Err(why) => (blank.clone(), blank, why.clone()),
            };
            let ([misplaced, height, slope], [volume, updates, time]) = (errors, work);
            table.push([size, misplaced, height, slope, volume, updates, time, note]);
        }
        table.write("  ", &mut out);
    }
    out
}

/// The study as CSV.
pub fn soil_csv(study: &SoilStudy) -> String {
    let mut out = "by,cell,ticks,misplaced,height,slope,volume,updates,seconds\n".to_owned();
    for (name, points) in [("cell", &study.by_cell), ("tick", &study.by_tick)] {
        for SoilPoint { cell, ticks, result } in points {
            out += &match result {
                Ok(SoilOutcome { misplaced, height, slope, imbalance, updates, seconds }) => format!(
                    "{name},{cell},{ticks},{misplaced:e},{height:e},{slope:e},{imbalance},{updates},{seconds}\n"
                ),
                Err(_) => format!("{name},{cell},{ticks},,,,,,\n"),
            };
        }
    }
    out
}
