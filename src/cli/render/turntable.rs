//! `--orbit`: the camera goes round the plant while it grows, or while it stands still.

use std::borrow::Cow;

use crate::cli::args::RenderArgs;
use crate::render::FrameWriter;

/// Frames of a plant that stands still.
const FRAMES: usize = 120;
/// Of these, frames in a second of a film.
const RATE: f64 = 25.0;

/// A single time as often as there are frames.
pub fn repeat(args: &RenderArgs, times: &mut Vec<f64>) {
    if let (Some(_), &[time]) = (args.orbit, &times[..]) {
        times.resize(args.orbit_frames.unwrap_or(FRAMES), time);
    }
}

/// When each frame of a plant that stands still ends, in seconds; none of one that grows.
pub fn ends(times: &[f64]) -> Option<Vec<f64>> {
    let stands = times.len() > 1 && times.first() == times.last();
    stands.then(|| (1..=times.len()).map(|frame| frame as f64 / RATE).collect())
}

/// The angle of each frame, in degrees; none without `--orbit`. The camera turns evenly in time, and the last frame lasts as long as the one before.
pub fn angles(args: &RenderArgs, times: &[f64]) -> Vec<f64> {
    let Some(degrees) = args.orbit else { return Vec::new() };
    let count = times.len();
    match times {
        [first, .., before, last] if last > first => {
            let span = 2.0 * last - before - first;
            times.iter().map(|time| degrees * ((time - first) / span)).collect()
        }
        [first, last] if last > first => vec![0.0, degrees / 2.0],
        _ => (0..count).map(|frame| degrees * (frame as f64 / count as f64)).collect(),
    }
}

/// The writer of a frame, as the camera sees it from its angle.
pub fn turned<'w>(writer: &'w FrameWriter, angles: &[f64], frame: usize) -> Cow<'w, FrameWriter> {
    match angles.get(frame) {
        None => Cow::Borrowed(writer),
        Some(degrees) => {
            Cow::Owned(FrameWriter { fit: writer.fit.clone().turned(*degrees), ..writer.clone() })
        }
    }
}
