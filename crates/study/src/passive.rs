//! Error of drawn positions against work, for what falls and for sheets in the scene of a model.
//!
//! All runs have the same growth; they differ in the tolerance. Flights are integrated by one explicit pair and sheets by one implicit
//! method, whose alternatives stand side by side in `dlsys report --surroundings`.

use std::time::Instant;

use dlsys_geometry::scene::{Point, Scene};
use dlsys_geometry::turtle;
use dlsys_session::{Nursery, Session};
use dlsys_sim::{BendSettings, Settings, brief};
use dlsys_tree::ModuleString;

use super::allowance::{Allowance, Purse, Stopwatch};
use super::stems::relative_distance;
use super::table::Table;

/// Tolerances of a study, and that of the reference.
const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];
const REFERENCE: f64 = 1e-6;
/// The part of the time for the study that its first run may take, where it may end at an earlier time.
const FIRST: f64 = 0.1;
/// How much longer a run takes than the one with ten times the tolerance, at least.
const MORE: f64 = 1.5;
/// Most points of a surface that are compared.
const MOST_OF_A_SURFACE: usize = 64;

/// A run of a scene.
#[derive(Clone, Debug)]
pub struct PassivePoint {
    /// The tolerance.
    pub tolerance: f64,
    /// Largest distance of a drawn point from its place in the reference, at any of the times, relative to the extent of the drawing, and the seconds for
    /// motion and drawing; the reason why there is none otherwise.
    pub result: Result<(f64, f64), String>,
}

/// The tolerances side by side on a scene.
#[derive(Clone, Debug)]
pub struct PassiveStudy {
    /// The runs, from the coarsest on.
    pub points: Vec<PassivePoint>,
    /// The tolerance of the run with which they are compared: the tightest that came to the end.
    pub reference: f64,
    /// Its seconds.
    pub seconds: f64,
    /// Number of times at which points are compared.
    pub times: usize,
    /// The last of them.
    pub last: f64,
}

/// Runs a scene at each tolerance. `None` if nothing in it falls, and no sheet hangs. Runs that would take longer than what is allowed are left out.
///
/// # Errors
/// The reason why no run comes to the last time.
pub fn passive_study(
    session: &Session,
    times: &[f64],
    settings: Settings,
    allowance: Allowance,
    say: &mut dyn FnMut(&str),
) -> Result<Option<PassiveStudy>, String> {
    let model = &session.model;
    let is_passive = turtle::lets_go(model) || !model.scenery.sheets.is_empty();
    if times.is_empty() || !is_passive {
        return Ok(None);
    }
    let purse = Purse::open(allowance);
    let (mut times, mut first) = (times, purse.first(FIRST));
    let mut tracks = Vec::new();
    for tolerance in TOLERANCES.into_iter().chain([REFERENCE]) {
        say(&format!("tolerance {tolerance:e}"));
        let settings = Settings { bending: BendSettings { tolerance, ..settings.bending }, ..settings };
        let track = match tracks.last() {
            // A run takes no less time than a coarser one.
            Some((_, Err(why))) => Err(String::clone(why)),
            // With one run there is nothing to compare.
            Some((_, Ok(Track { wall, .. }))) if tracks.len() > 1 => purse
                .fits(MORE * wall, allowance.all)
                .and_then(|()| track(session, times, settings, (allowance.run, None))),
            _ => track(session, times, settings, (allowance.run, first.take())),
        };
        if let Ok(track) = &track {
            times = &times[..track.frames.len()];
        }
        tracks.push((tolerance, track));
    }
    let finest = tracks.iter().rev().find_map(|(tolerance, track)| Some((*tolerance, track.as_ref().ok()?)));
    let Some((reference, best)) = finest else {
        let why = tracks.into_iter().find_map(|(_, track)| track.err());
        return Err(why.unwrap_or_default());
    };
    let compared = |track: &Track| {
        let alike = track.frames.iter().zip(&best.frames).all(|(a, b)| a.len() == b.len());
        match alike {
            true => Ok((relative_distance(&track.frames, &best.frames), track.seconds)),
            false => Err("what is drawn differs in number".to_owned()),
        }
    };
    let last = times.last().copied().unwrap_or(0.0);
    let points = (tracks.iter())
        .filter(|(tolerance, _)| *tolerance != reference && *tolerance != REFERENCE)
        .map(|(tolerance, track)| {
            let result = track.as_ref().map_err(String::clone).and_then(compared);
            PassivePoint { tolerance: *tolerance, result }
        })
        .collect();
    Ok(Some(PassiveStudy { points, reference, seconds: best.seconds, times: times.len(), last }))
}

/// Some drawn points at each time, and the work.
struct Track {
    frames: Vec<Vec<Point>>,
    seconds: f64,
    /// With growth.
    wall: f64,
}

/// A run. Motion and drawing are timed; growth on the way to the frames is not. It takes at most `limit` seconds, and ends at an earlier time where it has
/// taken `enough`.
fn track(
    session: &Session,
    times: &[f64],
    settings: Settings,
    (limit, enough): (f64, Option<f64>),
) -> Result<Track, String> {
    let stopwatch = Stopwatch::start(enough);
    let settings = Settings { max_seconds: settings.max_seconds.min(limit), ..settings };
    let nursery = Nursery::new(&session.model, settings).without_gases().without_ground();
    let mut simulation = session.simulate(settings).map_err(|error| error.diagnostic().message)?;
    let (mut string, mut scene, mut seconds) = (ModuleString::default(), nursery.blank(), 0.0);
    let mut frames = Vec::with_capacity(times.len());
    for &time in times {
        simulation.at(time, &mut string).map_err(|error| error.diagnostic().message)?;
        scene.clear();
        let begun = Instant::now();
        nursery.draw(&string, &mut scene).map_err(|error| error.diagnostic().message)?;
        seconds += begun.elapsed().as_secs_f64();
        if seconds > limit {
            return Err(format!("longer than {} s", brief(limit, 3)));
        }
        frames.push(points(&scene));
        if stopwatch.is_enough(frames.len()) {
            break;
        }
    }
    Ok(Track { frames, seconds, wall: stopwatch.seconds() })
}

/// Points of a drawing: ends of stems, corners of polygons, and corners of surfaces, of large ones some.
fn points(scene: &Scene) -> Vec<Point> {
    let mut all: Vec<Point> =
        scene.segments.iter().flat_map(|segment| [segment.start, segment.end]).collect();
    all.extend(scene.polygons.iter().flat_map(|polygon| polygon.vertices.iter().copied()));
    for surface in &scene.surfaces {
        let vertices = &surface.mesh.vertices;
        let stride = vertices.len().div_ceil(MOST_OF_A_SURFACE).max(1);
        all.extend(vertices.iter().step_by(stride).map(|vertex| surface.placement.point(*vertex)));
    }
    all
}

/// The study as a table for a terminal.
pub fn passive_table(study: &PassiveStudy) -> String {
    let PassiveStudy { reference, seconds, times, points, .. } = study;
    let mut out = format!(
        "\nwhat falls and hangs, at {times} times, against {reference:e} ({} s)\n",
        brief(*seconds, 3)
    );
    let mut table = Table::default();
    table.push(["tolerance", "error", "time", ""].map(str::to_owned));
    for PassivePoint { tolerance, result } in points {
        let [error, time, why] = match result {
            Ok((error, seconds)) => {
                [format!("{error:.1e}"), format!("{} s", brief(*seconds, 3)), String::new()]
            }
            Err(why) => [String::new(), String::new(), why.clone()],
        };
        table.push([format!("{tolerance:e}"), error, time, why]);
    }
    table.write("", &mut out);
    out
}

/// The study as CSV.
pub fn passive_csv(study: &PassiveStudy) -> String {
    let mut out = "tolerance,error,seconds\n".to_owned();
    for PassivePoint { tolerance, result } in &study.points {
        out += &match result {
            Ok((error, seconds)) => format!("{tolerance:e},{error:e},{seconds}\n"),
            Err(_) => format!("{tolerance:e},,\n"),
        };
    }
    out
}
