//! What is to be seen, without a file format: segments, polygons and surfaces, each of a material and of a
//! module.
//!
//! ```text
//! turtle ──▶ Scene { segments, polygons, surfaces } ──▶ export
//! ```
//!
//! - [`Segment`]: a straight piece of a stem. Segments that continue one another form tubes.
//! - [`Polygon`]: a filled outline. [`Surface`]: a [`Mesh`] placed in space; many share one mesh.
//! - [`Owner`]: the module that drew something. Its name lasts from frame to frame.
//! - [`Bounds`]: how much space a scene, or all scenes of an animation, take up.
//!
//! Lengths are in *scene units*, the units of the model. The axes: `+X` right, `+Y` up, `+Z` towards the
//! viewer of the front view.

mod bounds;
mod degrees;
mod element;
mod material;
mod mesh;

pub use bounds::Bounds;
pub use degrees::sin_cos_degrees;
pub use element::{Placement, Polygon, Segment, Surface, Width};
pub use material::{Color, Material, MaterialId, Palette};
pub use mesh::{Face, Mesh};

use std::sync::Arc;

use crate::structure::Lineage;

/// A point, in scene units.
pub type Point = nalgebra::Point3<f64>;
/// A direction or displacement, in scene units.
pub type Vector = nalgebra::Vector3<f64>;

/// The module that drew an element of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Owner {
    /// Name of the module's kind, as in the model: `F_i`, `@L`.
    pub name: Arc<str>,
    /// Who the module is.
    pub lineage: Lineage,
}

/// An [`Owner`] of a [`Scene`], by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OwnerId(u32);

impl OwnerId {
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Everything that is to be seen at one instant.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub palette: Palette,
    owners: Vec<Owner>,
    pub segments: Vec<Segment>,
    pub polygons: Vec<Polygon>,
    pub surfaces: Vec<Surface>,
}

impl Scene {
    /// Takes everything out, keeping the palette and the memory.
    pub fn clear(&mut self) {
        self.owners.clear();
        self.segments.clear();
        self.polygons.clear();
        self.surfaces.clear();
    }

    /// True if there is nothing to be seen.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty() && self.polygons.is_empty() && self.surfaces.is_empty()
    }

    /// Visits points that enclose everything that is to be seen, each with the width of the line there; corners of
    /// what is not a line have the width 0.
    pub fn each_point(&self, mut visit: impl FnMut(Point, Width)) {
        for segment in &self.segments {
            visit(segment.start, segment.widths[0]);
            visit(segment.end, segment.widths[1]);
        }
        let corners = self.polygons.iter().flat_map(|polygon| polygon.vertices.iter().copied());
        let surfaces = self
            .surfaces
            .iter()
            .flat_map(|surface| surface.mesh.vertices.iter().map(|&v| surface.placement.point(v)));
        corners.chain(surfaces).for_each(|point| visit(point, Width::Set(0.0)));
    }

    /// Enters a module that draws something. Modules are entered in string order, each once.
    pub fn add_owner(&mut self, owner: Owner) -> OwnerId {
        self.owners.push(owner);
        OwnerId((self.owners.len() - 1) as u32)
    }

    pub fn owner(&self, id: OwnerId) -> &Owner {
        &self.owners[id.index()]
    }

    /// The modules that drew something, in string order.
    pub fn owners(&self) -> &[Owner] {
        &self.owners
    }
}
