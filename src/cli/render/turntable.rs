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

/// Whether the plant of these frames stands still while the camera turns.
pub fn stands(times: &[f64]) -> bool {
    times.len() > 1 && times.first() == times.last()
}

/// When each frame of a plant that stands still ends, in seconds; none of one that grows.
pub fn ends(times: &[f64], fps: Option<f64>) -> Option<Vec<f64>> {
    let rate = fps.unwrap_or(RATE);
    stands(times).then(|| (1..=times.len()).map(|frame| frame as f64 / rate).collect())
}

/// The way of the camera.
#[derive(Clone, Copy, Debug)]
pub struct Orbit {
    degrees: f64,
    pace: Pace,
}

#[derive(Clone, Copy, Debug)]
enum Pace {
    /// Even in time: from this time on, all of the way in so long a time.
    Time(f64, f64),
    /// By frame, of so many.
    Frames(f64),
}

impl Orbit {
    /// The way over these frames; none without `--orbit`. The camera turns evenly in time, and the last frame lasts as long as the one before.
    pub fn new(args: &RenderArgs, times: &[f64]) -> Option<Orbit> {
        let degrees = args.orbit?;
        let pace = match times {
            [first, .., last] if last > first => {
                let before = times[times.len() - 2];
                Pace::Time(*first, 2.0 * last - before - first)
            }
            _ => Pace::Frames(times.len() as f64),
        };
        Some(Orbit { degrees, pace })
    }

    /// The angle at a time, in degrees; where the plant stands still, at a frame, or in parts of one after it.
    pub fn angle(&self, frame: f64, time: f64) -> f64 {
        self.degrees
            * match self.pace {
                Pace::Time(first, span) => (time - first) / span,
                Pace::Frames(count) => frame / count,
            }
    }
}

/// The writer of a frame, as the camera sees it from this angle.
pub fn turned(writer: &FrameWriter, angle: Option<f64>) -> Cow<'_, FrameWriter> {
    match angle {
        None => Cow::Borrowed(writer),
        Some(degrees) => {
            let mut turned = writer.clone();
            turned.fit = writer.fit.clone().turned(degrees);
            Cow::Owned(turned)
        }
    }
}
