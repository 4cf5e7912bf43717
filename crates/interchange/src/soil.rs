//! Ground that gives way, followed through its ticks: the surface as pieces whose triangles stay the same, and at frames what lies on bodies, and particles as points.
//!
//! Between two ticks points move straight, where pictures have the tick before.

use std::collections::HashMap;

use dlsys_geometry::scene::Scene;
use dlsys_session::{Nursery, Quilt};

use crate::gases::{GasFrame, GasTrack, OF_A_POINT};
use crate::sample::Sampler;
use crate::track::Tracks;
use crate::{Error, Options};

/// The name of particles in files.
const PARTICLES: &str = "ground.particles";

/// Ticks that are nearer to a frame than this part of the way to the next tick are that frame.
const NEAR: f64 = 1e-3;

/// Adds the ground to the tracks of a run, at the ascending times of the frames and at the ticks between them. Samples that are as near to the straight
/// way between others as `thin`, in metres, are left out. Returns the particles at the frames, if there are any.
///
/// # Errors
/// The ground fails, there are too many numbers, or `progress` stops the work.
pub(crate) fn follow(
    nursery: &Nursery<'_>,
    (sampler, thin): (Sampler, f64),
    frames: &[f64],
    options: &Options,
    tracks: &mut Tracks,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<GasTrack>, Error> {
    let (Some(&first), Some(&last)) = (frames.first(), frames.last()) else { return Ok(None) };
    let Some(quilt) = nursery.quilt(last)? else { return Ok(None) };
    let (mut scene, births) = (nursery.blank(), HashMap::new());
    let (mut loads, mut before) = (None, None);
    let color = scene.palette.get(quilt.material()).color;
    let mut particles = GasTrack { name: PARTICLES.to_owned(), gas: None, color, frames: Vec::new() };
    let mut numbers = 0;
    for (time, is_frame) in moments(frames, &nursery.ticks(first, last)) {
        if !progress(time) {
            return Err(Error::Stopped { time });
        }
        scene.clear();
        nursery.draw_quilt(time, &quilt, &mut scene)?;
        if is_frame {
            let seconds = (time - first) * options.seconds;
            particles.frames.push(points(&scene, &quilt, (seconds, sampler.metres)));
            numbers += OF_A_POINT * particles.frames.last().map_or(0, |frame| frame.points.len());
        }
        scene.surfaces.retain(|surface| !quilt.is_particle(surface));
        // What lies on bodies has other triangles at each time.
        let lies = scene.surfaces.iter().position(|surface| surface.rest.is_none());
        let drawn = lies.map(|place| scene.surfaces.remove(place));
        if is_frame {
            loads = drawn;
        }
        scene.surfaces.extend(loads.clone());
        tracks.add(&sampler.sample(time, &scene), before, &births, thin);
        before = Some(time);
        if tracks.size + numbers > options.limits.numbers {
            return Err(Error::TooLarge { time, limit: options.limits.numbers });
        }
    }
    tracks.finish(thin);
    Ok(Some(particles).filter(|_| numbers > 0))
}

/// The particles in a scene, at some seconds of the animation.
fn points(scene: &Scene, quilt: &Quilt, (seconds, metres): (f64, f64)) -> GasFrame {
    let mut frame = GasFrame { seconds, points: Vec::new(), widths: Vec::new() };
    for particle in scene.surfaces.iter().filter(|surface| quilt.is_particle(surface)) {
        let at = particle.placement.origin;
        frame.points.push([at.x, at.y, at.z].map(|x| (x * metres) as f32));
        // Of a ball of the same volume.
        let width = particle.placement.largest() * metres * (6.0 / std::f64::consts::PI).cbrt();
        frame.widths.push(width as f32);
    }
    frame
}

/// Frames, and the ticks between them that are not near to one, in order; whether each is a frame.
fn moments(frames: &[f64], ticks: &[f64]) -> Vec<(f64, bool)> {
    let step = ticks.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let is_near = |tick: &f64| {
        let next = frames.partition_point(|frame| frame < tick);
        let beside = frames[next.saturating_sub(1)..frames.len().min(next + 1)].iter();
        beside.map(|frame| (frame - tick).abs()).fold(f64::INFINITY, f64::min) <= NEAR * step
    };
    let between = ticks.iter().filter(|tick| !is_near(tick)).map(|tick| (*tick, false));
    let mut all: Vec<(f64, bool)> = frames.iter().map(|frame| (*frame, true)).chain(between).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

#[cfg(test)]
mod tests {
    use super::moments;

    #[test]
    fn ticks_at_frames_are_those_frames() {
        let ticks = [0.1, 0.2 + 1e-12, 0.3, 0.4];
        let all = moments(&[0.0, 0.2, 0.35], &ticks);
        assert_eq!(all, [(0.0, true), (0.1, false), (0.2, true), (0.3, false), (0.35, true), (0.4, false)]);
    }
}
