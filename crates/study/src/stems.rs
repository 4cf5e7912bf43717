//! Error of drawn positions against work, for the methods by which stems that bend are advanced.
//!
//! All runs have the same growth and the same clock; they differ in the method and the tolerance of bending.

use std::time::Instant;

use dlsys_geometry::scene::{Point, Scene};
use dlsys_geometry::turtle;
use dlsys_session::Session;
use dlsys_sim::{BendMethod, BendSettings, Settings, Simulation, brief};
use dlsys_surround::{Effort, Motion, Passive, Place, Weather};
use dlsys_tree::ModuleString;

use super::allowance::{Allowance, Purse, Stopwatch};
use super::points::Share;
use super::table::Table;

/// Tolerances of a study.
const TOLERANCES: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// The reference.
const REFERENCE: BendSettings = BendSettings { method: BendMethod::Ros34Pw2, tolerance: 1e-8 };
/// The part of the time for the study that its first run may take, where it may end at an earlier time.
const FIRST: f64 = 0.08;
/// Most points of a frame that are compared.
const MOST_POINTS: usize = 2000;

/// A run of a model with stems that bend.
#[derive(Clone, Debug)]
pub struct StemPoint {
    /// Method and tolerance.
    pub bending: BendSettings,
    /// The outcome; the reason why there is none otherwise.
    pub result: Result<StemOutcome, String>,
}

/// Error and work of a run.
#[derive(Clone, Copy, Debug)]
pub struct StemOutcome {
    /// Largest distance of a drawn point from its place in the reference, at any of the times, relative to the extent of the drawing.
    pub error: f64,
    /// Seconds for the motion of the stems.
    pub seconds: f64,
    /// Ticks, steps, and stems times steps.
    pub effort: Effort,
}

/// The methods side by side on a model.
#[derive(Clone, Debug)]
pub struct StemStudy {
    /// The runs, method by method.
    pub points: Vec<StemPoint>,
    /// With which the runs are compared: the tightest that came to the end.
    pub reference: BendSettings,
    /// Its work.
    pub effort: Effort,
    /// Number of times at which points are compared.
    pub times: usize,
    /// The last of them.
    pub last: f64,
}

/// Some drawn points at each time, and the work.
struct Track {
    frames: Vec<Vec<Point>>,
    seconds: f64,
    /// With growth and drawing.
    wall: f64,
    effort: Effort,
}

/// Runs a model with each method at each tolerance. `None` if no stems of the model bend. Each method has an equal part of the time that is allowed; runs
/// that would take longer are left out.
///
/// # Errors
/// The reason why no run comes to the last time.
pub fn stem_study(
    session: &Session,
    times: &[f64],
    settings: Settings,
    allowance: Allowance,
    say: &mut dyn FnMut(&str),
) -> Result<Option<StemStudy>, String> {
    if !turtle::bends(&session.model) || times.is_empty() {
        return Ok(None);
    }
    let purse = Purse::open(allowance);
    let mut share = Share::new(allowance.all, BendMethod::NAMED.len());
    let (mut times, mut first, mut tracks) = (times, purse.first(FIRST), Vec::new());
    for (_, method) in BendMethod::NAMED {
        let (begun, finest) = (purse.spent(), (REFERENCE.method == method).then_some(REFERENCE.tolerance));
        let within = begun + share.next();
        // The run before took so long.
        let mut before: Option<(f64, f64)> = None;
        for tolerance in TOLERANCES.into_iter().chain(finest) {
            let bending = BendSettings { method, tolerance };
            say(&format!("{} at {tolerance:e}", method.name()));
            // With order 2, and the better orders are for small tolerances.
            let more = |(known, seconds): (f64, f64)| seconds * (known / tolerance).sqrt();
            let fits = before.map_or(Ok(()), |before| purse.fits(more(before), within));
            let settings = Settings { bending, ..settings };
            let track = fits.and_then(|()| track(session, times, settings, (allowance.run, first.take())));
            if let Ok(track) = &track {
                times = &times[..track.frames.len()];
                // What is left out is judged from the last that was not.
                before = Some((tolerance, track.wall));
            }
            tracks.push((bending, track));
        }
        share.spend(purse.spent() - begun);
    }
    // The finest of the run of the highest order that came to its end.
    let rank = |bending: &BendSettings| (-bending.tolerance, bending.method == REFERENCE.method);
    let good = tracks.iter().filter_map(|(bending, track)| Some((bending, track.as_ref().ok()?)));
    let best = good.filter(|(bending, _)| bending.method != BendMethod::Euler).max_by(|a, b| {
        let (a, b) = (rank(a.0), rank(b.0));
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    });
    let Some((&reference, best)) = best else {
        let why = tracks.into_iter().find_map(|(_, track)| track.err());
        return Err(why.unwrap_or_default());
    };
    let points = (tracks.iter())
        .filter(|(bending, _)| *bending != REFERENCE && *bending != reference)
        .map(|(bending, track)| {
            let result = track.as_ref().map_err(String::clone);
            let outcome = |track: &Track| StemOutcome {
                error: relative_distance(&track.frames, &best.frames),
                seconds: track.seconds,
                effort: track.effort,
            };
            StemPoint { bending: *bending, result: result.map(outcome) }
        })
        .collect();
    let last = times.last().copied().unwrap_or(0.0);
    Ok(Some(StemStudy { points, reference, effort: best.effort, times: times.len(), last }))
}

/// A run. Its motion is timed; growth on the way to the frames and drawing are not. It takes at most `limit` seconds, and ends at an earlier time where it has
/// taken `enough`.
fn track(
    session: &Session,
    times: &[f64],
    settings: Settings,
    (limit, enough): (f64, Option<f64>),
) -> Result<Track, String> {
    let stopwatch = Stopwatch::start(enough);
    let model = &session.model;
    let fault = |error: dlsys_surround::Error| error.diagnostic().message;
    let weather = Weather::of(model, settings).map_err(fault)?;
    let place = Place::of_scene(&model.scenery);
    let begun = Instant::now();
    let motion =
        Motion::new(model, settings, weather, place, Passive::of(settings.bending)).map_err(fault)?;
    let motion = motion.ok_or("the model has no tissues")?;
    let mut seconds = begun.elapsed().as_secs_f64();
    let mut simulation = Simulation::new(model, settings).map_err(|error| error.diagnostic().message)?;
    let mut string = ModuleString::default();
    let mut scene = turtle::blank(model);
    let mut frames = Vec::with_capacity(times.len());
    for &time in times {
        simulation.at(time, &mut string).map_err(|error| error.diagnostic().message)?;
        let begun = Instant::now();
        let bent = motion.at(&string).map_err(fault)?;
        seconds += begun.elapsed().as_secs_f64();
        if seconds > limit {
            return Err(format!("longer than {} s", brief(limit, 3)));
        }
        scene.clear();
        turtle::draw_bent(model, &string, &bent, &mut scene).map_err(|error| error.to_string())?;
        frames.push(points(&scene));
        if stopwatch.is_enough(frames.len()) {
            break;
        }
    }
    Ok(Track { frames, seconds, wall: stopwatch.seconds(), effort: motion.effort() })
}

/// Points of a drawing: ends of stems, corners of polygons, places of surfaces and patches.
fn points(scene: &Scene) -> Vec<Point> {
    let stems = scene.segments.iter().map(|segment| segment.end);
    let polygons = scene.polygons.iter().flat_map(|polygon| polygon.vertices.iter().copied());
    let surfaces = scene.surfaces.iter().map(|surface| surface.placement.origin);
    let all: Vec<Point> = stems.chain(polygons).chain(surfaces).collect();
    let stride = all.len().div_ceil(MOST_POINTS).max(1);
    all.into_iter().step_by(stride).collect()
}

/// The largest distance of two points of a frame, relative to the extent of the whole.
pub(crate) fn relative_distance(frames: &[Vec<Point>], reference: &[Vec<Point>]) -> f64 {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for point in reference.iter().flatten() {
        for axis in 0..3 {
            (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
        }
    }
    let mut extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    if extent == 0.0 {
        // A single point: relative to its way from the origin.
        extent = low.iter().map(|x| x.abs()).fold(0.0, f64::max);
    }
    let pairs = frames.iter().zip(reference).flat_map(|(a, b)| a.iter().zip(b));
    let most = pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    if most == 0.0 { 0.0 } else { most / extent }
}

/// The study as a table for a terminal.
pub fn stem_table(study: &StemStudy) -> String {
    let BendSettings { method, tolerance } = study.reference;
    let mut out = format!(
        "\nstems that bend, at {} times, against {} at {tolerance:e} ({} ticks of the clock)\n",
        study.times,
        method.name(),
        study.effort.ticks
    );
    let mut table = Table::default();
    let heads = ["method", "tolerance", "error", "time", "steps", "stems times steps", "ms a step", ""];
    table.push(heads.map(str::to_owned));
    for StemPoint { bending, result } in &study.points {
        let mut row: [String; 8] = Default::default();
        row[0] = bending.method.name().to_owned();
        row[1] = format!("{:e}", bending.tolerance);
        match result {
            Ok(StemOutcome { error, seconds, effort }) => {
                row[2] = format!("{error:.1e}");
                row[3] = format!("{} s", brief(*seconds, 3));
                row[4] = effort.steps.to_string();
                row[5] = effort.stem_steps.to_string();
                row[6] = brief(seconds * 1e3 / effort.steps.max(1) as f64, 3);
            }
            Err(why) => row[7].clone_from(why),
        }
        table.push(row);
    }
    table.write("", &mut out);
    out
}

/// The study as CSV.
pub fn stem_csv(study: &StemStudy) -> String {
    let mut out = "method,tolerance,error,seconds,ticks,steps,stem_steps\n".to_owned();
    for StemPoint { bending, result } in &study.points {
        out += &format!("{},{:e}", bending.method.name(), bending.tolerance);
        out += &match result {
            Ok(StemOutcome { error, seconds, effort: Effort { ticks, steps, stem_steps, .. } }) => {
                format!(",{error:e},{seconds},{ticks},{steps},{stem_steps}\n")
            }
            Err(_) => ",,,,,\n".to_owned(),
        };
    }
    out
}
