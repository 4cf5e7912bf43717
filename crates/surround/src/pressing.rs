//! Bodies that press into the ground from one tick to the next: which of them is which, and how it has moved.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use dlsys_geometry::turtle::DrawnBody;
use dlsys_ground as ground;
use nalgebra::Vector3;

use crate::descent::Descent;

/// A body at a tick, in SI.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// Its identity among bodies: that of the first module that drew it.
    id: u64,
    /// The module that draws it here.
    module: u64,
    name: String,
    is_shelf: bool,
    triangles: Arc<[[u32; 3]]>,
    /// Where it was at the tick before; where it is, if it was not there.
    from: Arc<[Vector3<f64>]>,
    points: Arc<[Vector3<f64>]>,
}

impl Placed {
    /// The body on its way to here.
    pub(crate) fn moving(&self) -> ground::Body {
        ground::Body {
            id: self.id,
            name: self.name.clone(),
            triangles: Arc::clone(&self.triangles),
            from: Arc::clone(&self.from),
            to: Arc::clone(&self.points),
            shelf: self.is_shelf,
        }
    }

    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    pub(crate) fn module(&self) -> u64 {
        self.module
    }

    pub(crate) fn is_shelf(&self) -> bool {
        self.is_shelf
    }

    pub(crate) fn triangles(&self) -> &Arc<[[u32; 3]]> {
        &self.triangles
    }

    pub(crate) fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Whether it goes on as a drawing with these triangles and points: of the same shape, and not further away than it is large. What a production
    /// puts elsewhere, as a foot for its next step, has not moved through what is between.
    fn goes_on_as(&self, triangles: &[[u32; 3]], points: &[Vector3<f64>]) -> bool {
        if *self.triangles != *triangles || self.points.len() != points.len() {
            return false;
        }
        let (low, high) = points.iter().fold(
            (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)),
            |(low, high), point| (low.inf(point), high.sup(point)),
        );
        let way = self.points.iter().zip(points).map(|(from, to)| (to - from).norm()).fold(0.0, f64::max);
        way <= (high - low).norm()
    }
}

/// Drawn bodies in their order, each with what it was at the tick before: of its module, or of the one from which that descends.
pub(crate) fn placed(
    drawn: Vec<DrawnBody>,
    past: &[Placed],
    descent: &Descent,
    metre: f64,
    name: impl Fn(&DrawnBody) -> String,
) -> Vec<Placed> {
    let known: HashMap<u64, &Placed> = past.iter().map(|body| (body.module, body)).collect();
    let mut taken = HashSet::new();
    let mut all = Vec::with_capacity(drawn.len());
    for body in drawn {
        let module = body.origin.lineage.id;
        let points: Arc<[Vector3<f64>]> = body.points.iter().map(|point| point.coords * metre).collect();
        let before = descent.line(module).find_map(|module| known.get(&module).copied());
        // Of several that descend from one, the first goes on.
        let before = before.filter(|before| taken.insert(before.id));
        let same = before.filter(|before| before.goes_on_as(&body.triangles, &points));
        let from = same.map_or_else(|| Arc::clone(&points), |before| Arc::clone(&before.points));
        let (id, triangles) = match (same, before) {
            (Some(same), _) => (same.id, Arc::clone(&same.triangles)),
            // It has changed its shape where it is: what lies on it stays.
            (None, Some(before)) if before.module == module => (before.id, body.triangles.as_slice().into()),
            _ => (module, body.triangles.as_slice().into()),
        };
        let name = name(&body);
        all.push(Placed { id, module, name, is_shelf: body.is_shelf, triangles, from, points });
    }
    all
}
