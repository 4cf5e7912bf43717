//! Blobs of gases with their light, for players that draw them one by one.

use dlsys_geometry::scene::{Point, Scene};

use super::Fit;
use super::lighting::Lighting;

/// A blob in the light of its scene.
///
/// In front of what has the colour c, it shows, at r standard deviations from its middle, c e^-τ + light (1 - e^-τ) with τ = depth e^(-r²/2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Puff {
    /// See [`Blob::key`](dlsys_geometry::scene::Blob::key).
    pub key: u64,
    /// Its centre.
    pub centre: Point,
    /// Its standard deviation, in scene units.
    pub deviation: f64,
    /// The optical depth of a ray through its middle.
    pub depth: f64,
    /// What it scatters and emits towards the viewer where it lets no light through, by channel: 1 is full light.
    pub light: [f64; 3],
}

/// Shadows on gas are as fine as in a picture of so many pixels.
const PIXELS: f64 = 600.0;

/// The blobs of a scene, gas by gas, in the light that pictures have: behind other blobs, and in the shadow of the plant where a sun is declared. The light does not
/// depend on the number of threads.
pub fn puffs(scene: &Scene, fit: &Fit, threads: usize) -> Vec<Puff> {
    if scene.gases.iter().all(|gas| gas.blobs.is_empty()) {
        return Vec::new();
    }
    let scale = PIXELS / if fit.extent > 0.0 { fit.extent } else { 1.0 };
    let lighting = Lighting::new(scene, fit, scale, threads, None, None);
    let Some(haze) = lighting.haze() else { return Vec::new() };
    let blobs = scene.gases.iter().flat_map(|gas| gas.blobs.iter().map(move |blob| (gas, blob)));
    let lit = blobs.zip(haze.colours()).map(|((gas, blob), light)| Puff {
        key: blob.key,
        centre: blob.centre,
        deviation: blob.deviation,
        depth: gas.depth(blob),
        light,
    });
    lit.collect()
}
