//! The elements of a scene: segments of stems, polygons, placed surfaces.

use std::sync::Arc;

use super::{MaterialId, Mesh, OwnerId, PatchSet, Point, Vector};

/// The width of a line.
///
/// A model that sets no widths must be visible at any scale, and one scene does not show it: a growing
/// plant is small at first. So a default width is a *style*, to be resolved when the bounds of the whole
/// animation are known (see [`Bounds::default_width`](super::Bounds::default_width)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Width {
    /// This many times the default width.
    Default(f64),
    /// In scene units.
    Set(f64),
}

impl Width {
    /// The width in scene units, given the default width.
    pub fn resolve(self, default: f64) -> f64 {
        match self {
            Width::Default(factor) => factor * default,
            Width::Set(width) => width,
        }
    }

    /// The width times a factor.
    pub fn scaled(self, by: f64) -> Width {
        match self {
            Width::Default(factor) => Width::Default(factor * by),
            Width::Set(width) => Width::Set(width * by),
        }
    }
}

/// A straight piece of a stem.
#[derive(Clone, Debug)]
pub struct Segment {
    /// Middle of its first end.
    pub start: Point,
    /// Middle of its second end.
    pub end: Point,
    /// Unit vector from `start` to `end`; kept, because the difference of two near points has few digits.
    pub direction: Vector,
    /// Unit vector across the segment, from which a tube's cross-section is counted.
    pub across: Vector,
    /// Widths (diameters) at the start and at the end.
    pub widths: [Width; 2],
    /// Index of the cross-section among the [contours of the scene](super::Scene::contours); `None` is a circle.
    pub contour: Option<u32>,
    /// Material of the whole segment.
    pub material: MaterialId,
    /// The module that drew it.
    pub owner: OwnerId,
    /// Index of the segment that this one continues: it precedes this one on the same axis and ends exactly
    /// where this one starts. No two segments continue the same one.
    pub follows: Option<usize>,
    /// Index of the segment at whose end the branch begins of which this is the first one.
    pub grows_from: Option<usize>,
}

/// A filled outline, of at least three distinct vertices. It need not be flat or convex.
#[derive(Clone, Debug)]
pub struct Polygon {
    /// Corners in order, the first not repeated.
    pub vertices: Vec<Point>,
    /// Material of the whole polygon.
    pub material: MaterialId,
    /// The module that opened it.
    pub owner: OwnerId,
}

/// A mesh in its place.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The mesh, shared by all surfaces of one shape.
    pub mesh: Arc<Mesh>,
    /// What `mesh` is a preview of, if the surface is curved: the mesh of the right accuracy is made when a
    /// frame is written (see [`Scene::tessellated`](super::Scene::tessellated)).
    pub patches: Option<Arc<PatchSet>>,
    /// A mesh with the same faces that stays the same, if the vertices of `mesh` move by themselves, as those of a sheet do.
    pub rest: Option<Arc<Mesh>>,
    /// Where it is placed.
    pub placement: Placement,
    /// Stands in for the materials of those faces that take a colour.
    pub tint: Option<MaterialId>,
    /// The module that drew it.
    pub owner: OwnerId,
}

/// Position, orientation and size of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Where the origin of the mesh comes to lie, in scene units.
    pub origin: Point,
    /// Unit vectors that the mesh's first, second and third axis turn to.
    pub axes: [Vector; 3],
    /// Lengths of one unit of the mesh along its first, second and third axis, in scene units; positive.
    pub scales: [f64; 3],
}

impl Placement {
    /// A placement with one scale for all axes.
    pub fn uniform(origin: Point, axes: [Vector; 3], scale: f64) -> Placement {
        Placement { origin, axes, scales: [scale; 3] }
    }

    /// True if all axes have the same scale.
    pub fn is_uniform(&self) -> bool {
        self.scales.iter().all(|scale| *scale == self.scales[0])
    }

    /// The largest of the scales: no length of the mesh is enlarged more.
    pub fn largest(&self) -> f64 {
        self.scales.into_iter().fold(0.0, f64::max)
    }

    /// The place of a point of the mesh in the scene.
    pub fn point(&self, p: Point) -> Point {
        let [x, y, z] = self.scales;
        if self.is_uniform() {
            return self.origin + x * self.turned(p.coords);
        }
        self.origin + self.turned(Vector::new(x * p.x, y * p.y, z * p.z))
    }

    /// The places of the corners of an upright box, given two opposite ones.
    pub fn corners(&self, [low, high]: [Point; 2]) -> [Point; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
            let side = |k: usize| if i >> k & 1 == 0 { low[k] } else { high[k] };
            self.point(Point::new(side(0), side(1), side(2)))
        })
    }

    /// A unit normal of the mesh as a unit normal in the scene. Normals transform by the inverse of the scales.
    pub fn normal(&self, n: Vector) -> Vector {
        if self.is_uniform() {
            return self.turned(n);
        }
        let largest = self.largest();
        let [x, y, z] = self.scales.map(|scale| scale / largest);
        let scaled = Vector::new(n.x * y * z, n.y * x * z, n.z * x * y);
        self.turned(scaled.try_normalize(1e-300).unwrap_or(n))
    }

    /// The placement in a scene of a thing that has this placement in a plant; the plant has the `outer` placement in the scene, with
    /// the same scale along all axes.
    pub fn within(&self, outer: &Placement) -> Placement {
        Placement {
            origin: outer.point(self.origin),
            axes: self.axes.map(|axis| outer.turned(axis)),
            scales: self.scales.map(|scale| scale * outer.largest()),
        }
    }

    /// A direction of the mesh in the scene, of the same length.
    pub fn turned(&self, v: Vector) -> Vector {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The normal of a plane stays at a right angle to it when the plane is stretched.
    #[test]
    fn normals_transform_by_the_inverse() {
        let axes = [Vector::y(), -Vector::x(), Vector::z()];
        let place = Placement { origin: Point::new(1.0, 2.0, 3.0), axes, scales: [4.0, 0.5, 3.0] };
        let (u, v) = (Vector::new(1.0, 2.0, -1.0), Vector::new(0.5, -1.0, 3.0));
        let normal = place.normal(u.cross(&v).normalize());
        let moved = |w: Vector| place.point(Point::from(w)) - place.origin;
        assert!((normal.norm() - 1.0).abs() < 1e-12);
        assert!(normal.dot(&moved(u)).abs() < 1e-12 && normal.dot(&moved(v)).abs() < 1e-12);
        assert!(normal.dot(&moved(u).cross(&moved(v))) > 0.0, "it stays on the same side");
        assert_eq!((place.largest(), place.is_uniform()), (4.0, false));
    }
}
