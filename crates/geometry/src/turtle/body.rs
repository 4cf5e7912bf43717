//! Bodies that press into the ground, and shelves that carry what falls on them: the drawing of each module as triangles, as it is seen.
//!
//! Stems are prisms with closed ends, balls and surfaces the meshes that they are. Triangles of a module have the same numbers at all times, unless
//! it draws other elements or patches grow by far.

use dlsys_model::{KindId, Model};

use super::skeleton::{Origin, Recorder};
use crate::scene::{Point, Scene, Segment, Surface};

/// What a module draws, as triangles.
#[derive(Clone, Debug)]
pub struct DrawnBody {
    /// The module.
    pub origin: Origin,
    /// It carries only, and does not press.
    pub is_shelf: bool,
    /// Corners, in scene units.
    pub points: Vec<Point>,
    /// Triangles as numbers of points, counterclockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Sides of a round stem.
const SIDES: usize = 12;

impl DrawnBody {
    pub(super) fn new(origin: Origin, model: &Model) -> DrawnBody {
        let is_solid = model.scenery.solids.iter().any(|(kind, _)| *kind == origin.kind);
        DrawnBody { origin, is_shelf: !is_solid, points: Vec::new(), triangles: Vec::new() }
    }

    /// Adds a stem: of a shelf, too, its whole surface.
    fn add_segment(&mut self, segment: &Segment, contours: &[Vec<[f64; 2]>]) {
        let radii = segment.widths.map(|width| width.resolve(0.0) / 2.0);
        if radii == [0.0; 2] {
            return;
        }
        let (u, v) = (segment.across, segment.direction.cross(&segment.across));
        let round: Vec<[f64; 2]>;
        let outline = match segment.contour.and_then(|contour| contours.get(contour as usize)) {
            Some(outline) => &outline[..],
            None => {
                let turn = |side: usize| {
                    let (sin, cos) = crate::scene::sin_cos_degrees(360.0 * side as f64 / SIDES as f64);
                    [cos, sin]
                };
                round = (0..SIDES).map(turn).collect();
                &round[..]
            }
        };
        let count = outline.len() as u32;
        let first = self.points.len() as u32;
        for (end, radius) in [segment.start, segment.end].into_iter().zip(radii) {
            self.points.extend(outline.iter().map(|[x, y]| end + (u * *x + v * *y) * radius));
        }
        for side in 0..count {
            let next = (side + 1) % count;
            let [a, b, c, d] = [side, next, count + next, count + side].map(|corner| first + corner);
            self.triangles.extend([[a, b, c], [a, c, d]]);
        }
        // Fans close the ends: triangles that lie over each other count with their signs.
        for side in 1..count - 1 {
            self.triangles.push([first, first + side + 1, first + side]);
            self.triangles.push([count, count + side, count + side + 1].map(|corner| first + corner));
        }
    }

    fn add_surface(&mut self, surface: &Surface) {
        let first = self.points.len() as u32;
        let place = &surface.placement;
        self.points.extend(surface.mesh.vertices.iter().map(|vertex| place.point(*vertex)));
        self.triangles
            .extend(surface.mesh.faces.iter().map(|face| face.corners.map(|corner| first + corner)));
    }

    /// Adds a polygon as a fan: where it is not convex, triangles that lie over each other count with their signs.
    fn add_polygon(&mut self, vertices: &[Point]) {
        let first = self.points.len() as u32;
        self.points.extend(vertices);
        let corners = 1..(vertices.len() as u32).saturating_sub(1);
        self.triangles.extend(corners.map(|corner| [first, first + corner, first + corner + 1]));
    }
}

impl Recorder {
    /// The bodies and shelves, with their triangles. Patches are within `accuracy` of theirs.
    pub(super) fn finish_bodies(self, scene: &Scene, model: &Model, accuracy: f64) -> Vec<DrawnBody> {
        let mut bodies: Vec<DrawnBody> =
            self.solids.iter().map(|solid| DrawnBody::new(solid.origin, model)).collect();
        for (carrier, segment) in self.segments.iter().zip(&scene.segments) {
            if let Some(body) = carrier.solid {
                bodies[body].add_segment(segment, &scene.contours);
            }
        }
        for (carrier, surface) in self.surfaces.iter().zip(&scene.surfaces) {
            if let Some(body) = carrier.solid {
                bodies[body].add_surface(surface);
            }
        }
        for (carrier, polygon) in self.polygons.iter().zip(&scene.polygons) {
            if let Some(body) = carrier.solid {
                bodies[body].add_polygon(&polygon.vertices);
            }
        }
        for (carrier, patch) in self.patches.iter().zip(&scene.patches) {
            if let Some(body) = carrier.solid {
                bodies[body].add_surface(&patch.surface(accuracy));
            }
        }
        bodies.retain(|body| !body.triangles.is_empty());
        bodies
    }
}

/// The kinds of a model that are solid or shelves, by [`KindId::index`].
pub(super) fn kinds(model: &Model) -> Vec<bool> {
    let mut kinds = vec![false; model.kinds.len()];
    for (kind, _) in model.scenery.solids.iter().chain(&model.scenery.shelves) {
        kinds[KindId::index(*kind)] = true;
    }
    kinds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::turtle;
    use dlsys_diagnostic::Span;
    use dlsys_tree::{Lineage, ModuleString};

    /// Volume within triangles, by the divergence theorem; and whether each edge has a triangle on either side.
    fn volume(body: &DrawnBody) -> (f64, bool) {
        let of = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| body.points[corner as usize].coords);
            a.dot(&b.cross(&c)) / 6.0
        };
        let key = |corner: u32| body.points[corner as usize].coords.map(|x| (x * 1e9).round() as i64);
        let mut edges = std::collections::HashMap::new();
        for [a, b, c] in &body.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((key(*from), key(*to))).or_insert(0) += 1;
                *edges.entry((key(*to), key(*from))).or_insert(0) -= 1;
            }
        }
        (body.triangles.iter().map(of).sum(), edges.values().all(|count| *count == 0))
    }

    #[test]
    fn stems_and_balls_are_closed_bodies_of_their_volume() {
        let mut model = Model::default();
        let mut string = ModuleString::default();
        for (place, (name, parameters)) in
            [("!", &[0.2][..]), ("F", &[1.0]), ("+", &[30.0]), ("@O", &[0.5]), ("f", &[1.0])]
                .iter()
                .enumerate()
        {
            let kind = model.kinds.intern(name, parameters.len());
            string.push(kind, parameters.iter().copied(), 0.5, Lineage::of_axiom(place));
            if *name == "F" || *name == "@O" {
                model.scenery.solids.push((kind, Span::default()));
            }
        }
        let mut scene = Scene::default();
        let bodies = turtle::bodies(&model, &string, None, 0.01, &mut scene).expect("drawable");
        assert_eq!(bodies.len(), 2);
        let round = std::f64::consts::PI;
        for (body, exact, most) in [(&bodies[0], round * 0.01, 0.05), (&bodies[1], round * 0.125 / 6.0, 0.02)]
        {
            let (volume, is_closed) = volume(body);
            assert!(is_closed && !body.is_shelf);
            assert!((volume / exact - 1.0).abs() < most, "{volume} {exact}");
        }
    }
}
