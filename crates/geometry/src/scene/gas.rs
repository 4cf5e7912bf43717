//! Gases in a scene: blobs as Gaussians, and the places where they begin.

use std::sync::Arc;

use super::{Color, Point};
use crate::turtle::Origin;

/// A source of gas: the module that draws it, and its number among the sources of that module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SourceKey {
    /// [`Lineage::id`](dlsys_tree::Lineage::id) of the module.
    pub module: u64,
    /// From 0, in the order of drawing.
    pub number: u32,
}

/// A place where blobs of a gas begin (`@S`).
#[derive(Clone, Copy, Debug)]
pub struct GasSource {
    /// Its identity.
    pub key: SourceKey,
    /// The module that draws it.
    pub origin: Origin,
    /// Number of the gas among those of the model, from 0.
    pub gas: usize,
    /// Its centre.
    pub at: Point,
    /// Blobs in a unit of time of the model, 0 or greater.
    pub rate: f64,
    /// Blobs begin within this distance of the centre, in scene units.
    pub radius: f64,
}

/// A blob of gas: a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// Its centre.
    pub centre: Point,
    /// Its standard deviation along each axis, in scene units.
    pub deviation: f64,
    /// Its mass in parts of that of a new blob.
    pub mass: f64,
    /// A number that it has as long as it lasts, and no other blob.
    pub key: u64,
}

/// A gas with its blobs at an instant.
#[derive(Clone, Debug)]
pub struct Gas {
    /// Its name in the model.
    pub name: Arc<str>,
    /// The colour that it has in full light.
    pub color: Color,
    /// The part of what is taken from light that is scattered, 0 to 1; the rest is absorbed.
    pub albedo: f64,
    /// The light that it emits where it lets none through and scatters none, in parts of full light.
    pub glow: f64,
    /// The area that a new blob hides from light, in square scene units: extinction times mass.
    pub area: f64,
    /// The standard deviation of a new blob, in scene units.
    pub size: f64,
    /// In the order of their births.
    pub blobs: Vec<Blob>,
}

impl Gas {
    /// A blob counts for the extent of a scene as long as a ray through its middle loses at least this part of what it loses in a new one.
    const SEEN: f64 = 0.1;

    /// The optical depth of a ray through the middle of a blob.
    pub fn depth(&self, blob: &Blob) -> f64 {
        self.area * blob.mass / (std::f64::consts::TAU * blob.deviation * blob.deviation)
    }

    /// The blobs that count for the extent of a scene, as balls: centre and radius.
    pub fn seen(&self) -> impl Iterator<Item = (Point, f64)> {
        let share = |blob: &Blob| blob.mass * (self.size / blob.deviation).powi(2);
        let seen = self.blobs.iter().filter(move |blob| share(blob) >= Gas::SEEN);
        seen.map(|blob| (blob.centre, 1.5 * blob.deviation))
    }
}
