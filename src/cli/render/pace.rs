//! How fast a film is: `--fps`, `--speed` and `--step`, of which two say the third.

use super::film::usage;
use super::{Failure, ModelRun, turntable};
use crate::cli::args::RenderArgs;
use crate::cli::shared::Rate;
use crate::sim::brief;

/// Seconds of a film of one frame.
const STILL: f64 = 1.0;
/// A film of fewer frames a second looks like slides.
const SLOW: f64 = 10.0;
/// Frames in a second that are proposed then.
const USUAL: f64 = 25.0;

/// What says the time between frames of a film if `--step` does not.
pub fn of(args: &RenderArgs) -> Option<Rate> {
    args.fps.map(|frames| Rate { frames, speed: args.speed })
}

/// Refuses flags that contradict each other.
pub fn agree(args: &RenderArgs) -> Result<(), Failure> {
    let (Some(fps), Some(speed)) = (args.fps, args.speed) else { return Ok(()) };
    if args.shared.at.as_ref().is_some_and(|at| at.len() > 1) {
        return Err(usage(
            "with --fps each of the times of --at is seen equally long, whatever --speed says; leave one of the two out",
        ));
    }
    match args.shared.step {
        Some(step) if (speed - fps * step).abs() > 1e-6 * speed => Err(usage(format!(
            "with --step {step} and --fps {fps} the speed is {}, and --speed says {speed}; leave one of the three out",
            brief(fps * step, 6)
        ))),
        _ => Ok(()),
    }
}

/// When each frame ends, in seconds; the last one lasts as long as the one before.
pub fn ends(args: &RenderArgs, run: &ModelRun) -> Vec<f64> {
    let times = &run.times;
    if let Some(ends) = turntable::ends(times, args.fps) {
        return ends;
    }
    let evenly = |frame: f64| (1..=times.len()).map(|k| k as f64 * frame).collect();
    let seconds = match (args.speed, args.fps, args.shared.step) {
        (Some(speed), ..) => 1.0 / speed,
        (None, Some(fps), None) if args.shared.at.is_some() && times.len() > 1 => return evenly(1.0 / fps),
        (None, Some(fps), Some(step)) => 1.0 / (fps * step),
        _ => run.session.model.scenery.units.time,
    };
    let first = times.first().copied().unwrap_or(0.0);
    let mut ends: Vec<f64> = times.iter().skip(1).map(|t| (t - first) * seconds).collect();
    let last = match &times[..] {
        [.., before, last] => (2.0 * last - before - first) * seconds,
        _ => STILL,
    };
    ends.push(last);
    ends
}

/// Frames in a second, if there are several.
pub fn rate(ends: &[f64]) -> Option<f64> {
    let last = ends.last().filter(|last| **last > 0.0 && ends.len() > 1)?;
    Some(ends.len() as f64 / last)
}

/// A rate as people read it.
pub fn rounded(rate: f64) -> String {
    brief(rate, if rate < 10.0 { 2 } else { 3 })
}

/// A line about a film that looks like slides, and the flags that change that.
pub fn remark(args: &RenderArgs, run: &ModelRun, ends: &[f64]) -> String {
    let slow = rate(ends).filter(|rate| *rate < SLOW && args.fps.is_none() && run.times.len() > 2);
    let Some(rate) = slow else { return String::new() };
    let advice = match (&args.shared.at, args.shared.step) {
        (Some(_), _) => format!("`--fps {USUAL}` shows so many of these times a second"),
        (None, Some(_)) => {
            format!("`--fps {USUAL}` plays these frames faster, and without --step makes more of them")
        }
        (None, None) => {
            let speed = args.speed.unwrap_or(1.0 / run.session.model.scenery.units.time);
            let faster = rounded(speed * USUAL / rate);
            format!("`--fps {USUAL}` makes more frames, `--speed {faster}` plays these faster")
        }
    };
    format!("  slides rather than a film: {advice}\n")
}
