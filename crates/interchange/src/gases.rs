//! Points at the frames of an animation: the blobs of gases, and particles of soil.

use std::sync::Arc;

use dlsys_geometry::scene::Color;
use dlsys_session::{Nursery, Session};
use dlsys_sim::Settings;
use dlsys_tree::ModuleString;

use crate::{Error, Options};

/// A gas, or the particles of the ground, at all frames.
#[derive(Debug)]
pub(crate) struct GasTrack {
    /// Its name in files.
    pub(crate) name: String,
    /// The name of the gas, if it is one.
    pub(crate) gas: Option<Arc<str>>,
    pub(crate) color: Color,
    pub(crate) frames: Vec<GasFrame>,
}

/// The blobs of a gas, or particles, at a frame.
#[derive(Debug)]
pub(crate) struct GasFrame {
    /// Seconds of the animation.
    pub(crate) seconds: f64,
    /// Their middles, in metres.
    pub(crate) points: Vec<[f32; 3]>,
    /// Twice the standard deviations of blobs, and diameters of particles, in metres.
    pub(crate) widths: Vec<f32>,
}

/// Numbers of a point.
pub(crate) const OF_A_POINT: usize = 4;

/// Follows the gases of a run through the frames at these ascending times.
///
/// # Errors
/// The run, its drawing or its gases fail, there are too many numbers, or `progress` stops the work.
pub(crate) fn follow(
    session: &Session,
    settings: Settings,
    times: &[f64],
    options: &Options,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vec<GasTrack>, Error> {
    let nursery = Nursery::new(&session.model, settings).without_ground().with_threads(options.threads);
    let mut simulation = session.simulate(settings)?;
    let (mut scene, mut string) = (nursery.blank(), ModuleString::default());
    let mut tracks: Vec<GasTrack> = Vec::new();
    let (first, mut numbers) = (times.first().copied().unwrap_or(0.0), 0);
    for &time in times {
        if !progress(time) {
            return Err(Error::Stopped { time });
        }
        simulation.at(time, &mut string)?;
        scene.clear();
        nursery.draw(&string, &mut scene)?;
        for (number, gas) in scene.gases.iter().enumerate() {
            if tracks.len() == number {
                let (name, gas_name) = (format!("gas.{}", gas.name), Some(Arc::clone(&gas.name)));
                tracks.push(GasTrack { name, gas: gas_name, color: gas.color, frames: Vec::new() });
            }
            numbers += OF_A_POINT * gas.blobs.len();
            if numbers > options.limits.numbers {
                return Err(Error::TooLarge { time, limit: options.limits.numbers });
            }
            let metres = options.metres;
            let point = |at: &dlsys_geometry::scene::Point| [at.x, at.y, at.z].map(|x| (x * metres) as f32);
            tracks[number].frames.push(GasFrame {
                seconds: (time - first) * options.seconds,
                points: gas.blobs.iter().map(|blob| point(&blob.centre)).collect(),
                widths: gas.blobs.iter().map(|blob| (2.0 * blob.deviation * metres) as f32).collect(),
            });
        }
    }
    Ok(tracks)
}
