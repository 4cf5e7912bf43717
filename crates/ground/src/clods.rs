//! What sticks to bodies as triangles: a sheet over the body, as high at each corner of its patches as what sticks around it makes it.
//!
//! A patch gives each of its corners a third of its volume; the height there is the volume over a third of the area around. So the volume under the sheet is that of
//! what sticks, but for the bend of the body, and the sheet comes down to the body at the edge.

use std::collections::BTreeMap;

use crate::coat::Coats;
use crate::tile::QUANTA;
use crate::{Ground, Mesh, Vector};

/// Thinnest layer that is drawn, in columns.
const FILM: f64 = 1e-3;
/// Corners that are nearer to each other than this are one, in columns: a body may have several points in one place.
const SAME: f64 = 1e-5;

/// The place of a corner.
type Place = [i64; 3];

/// What sticks around a corner: its volume in m³, the area of all patches around in m², and the sum of their normals by area.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    volume: f64,
    area: f64,
    normal: Vector,
}

impl Corner {
    /// From the body to the sheet.
    fn rise(&self) -> Vector {
        self.normal.try_normalize(0.0).unwrap_or_default() * (self.volume / self.area)
    }
}

impl Ground {
    /// What sticks to bodies, where they are at the last tick: a sheet for each. It is empty if nothing does.
    pub fn clods(&self) -> Mesh {
        let mut mesh = Mesh::default();
        for coats in self.coats.values() {
            coats.sheet(self.cell(), &mut mesh);
        }
        mesh
    }
}

/// The place of a corner on columns of a width.
fn place(corner: &Vector, cell: f64) -> Place {
    [0, 1, 2].map(|n| (corner[n] / (SAME * cell)).round() as i64)
}

impl Coats {
    /// Adds the sheet of what sticks to a body on columns of a width.
    fn sheet(&self, cell: f64, mesh: &mut Mesh) {
        let (corners, outward) = (self.corners(cell), self.outward());
        let mut numbers: BTreeMap<Place, u32> = BTreeMap::new();
        for patch in self.all().filter(|patch| is_under(patch, &corners, cell)) {
            let [a, b, c] = patch.map(|corner| {
                let place = place(&corner, cell);
                *numbers.entry(place).or_insert_with(|| {
                    mesh.points.push(corner + corners.get(&place).map_or_else(Vector::zeros, Corner::rise));
                    mesh.points.len() as u32 - 1
                })
            });
            // Counterclockwise from outside.
            mesh.triangles.push(if outward > 0.0 { [a, b, c] } else { [a, c, b] });
        }
    }

    /// The corners around which enough sticks to be drawn.
    fn corners(&self, cell: f64) -> BTreeMap<Place, Corner> {
        let mut corners: BTreeMap<Place, Corner> = BTreeMap::new();
        for (patch, volume) in self.patches() {
            let third = volume as f64 / QUANTA * cell.powi(3) / 3.0;
            for corner in &patch {
                corners.entry(place(corner, cell)).or_default().volume += third;
            }
        }
        let outward = self.outward();
        for patch in self.all() {
            let [a, b, c] = patch;
            let third = (b - a).cross(&(c - a)) * (outward / 6.0);
            for corner in &patch {
                if let Some(corner) = corners.get_mut(&place(corner, cell)) {
                    corner.area += third.norm();
                    corner.normal += third;
                }
            }
        }
        corners.retain(|_, corner| corner.area > 0.0 && corner.volume >= FILM * cell * corner.area);
        corners
    }

    /// 1, or -1 if the triangles of the body go round the other way.
    fn outward(&self) -> f64 {
        let first = self.points.first().copied().unwrap_or_default();
        let volume: f64 = (self.triangles.iter())
            .map(|corners| {
                let [a, b, c] = corners.map(|n| self.points[n as usize] - first);
                a.dot(&b.cross(&c))
            })
            .sum();
        if volume < 0.0 { -1.0 } else { 1.0 }
    }
}

/// True for a patch of which a corner is higher than the body.
fn is_under(patch: &[Vector; 3], corners: &BTreeMap<Place, Corner>, cell: f64) -> bool {
    patch.iter().any(|corner| corners.contains_key(&place(corner, cell)))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

    /// A ball that has been in the ground: what is drawn lies outside of it and has the volume of what sticks to it, whichever way its triangles go round.
    #[test]
    fn sheets_lie_outside_of_a_body_and_have_the_volume_of_what_sticks_to_it() -> Result<(), Error> {
        for inside_out in [false, true] {
            let description = Description {
                cell: 0.01,
                extent: Extent::around(40),
                soil: Soil { stick: 0.002, ..Soil::snow() },
                bed: Relief::Level(-0.3),
                depth: Relief::Level(0.3),
            };
            let mut ground = Ground::new(description, Settings::default())?;
            assert!(ground.clods().triangles.is_empty());
            let (points, triangles) = crate::study::sphere(Vector::new(0.003, 0.02, 0.001), 0.1, 24);
            let triangles: Arc<[[u32; 3]]> = match inside_out {
                true => triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect(),
                false => triangles,
            };
            ground.advance(&[], &[Body::still(1, "a ball", triangles, points)])?;
            let mesh = ground.clods();
            let middle = Vector::new(0.003, 0.02, 0.001);
            let volume = |corners: [Vector; 3]| {
                let [a, b, c] = corners.map(|corner| corner - middle);
                a.dot(&b.cross(&c)) / 6.0
            };
            let risen: f64 = mesh.triangles.iter().map(|t| volume(t.map(|n| mesh.points[n as usize]))).sum();
            let (coats, cell) = (ground.coats.values().next().expect("a coat"), 0.01);
            let corners = coats.corners(cell);
            let flat = coats.all().filter(|patch| super::is_under(patch, &corners, cell)).map(volume);
            let found = risen - flat.sum::<f64>().abs();
            for corner in corners.values() {
                assert!(corner.rise().norm() > 0.0 && corner.rise().norm() < 0.01);
            }
            assert!(ground.sticking() > 5e-5, "{}", ground.sticking());
            assert!((found / ground.sticking() - 1.0).abs() < 0.04, "{found} {}", ground.sticking());
        }
        Ok(())
    }
}
