//! What sticks to bodies as triangles: on each patch a block of its volume, narrower outside than at the body.

use crate::coat::Coats;
use crate::tile::QUANTA;
use crate::{Ground, Mesh, Vector};

/// The length of the outer sides of a block, in those at the body.
const OUTER: f64 = 0.6;
/// Its height, in layers of its volume: the volume of a frustum with these sides is (1 + s + s²)/3 of that of a prism.
const HIGH: f64 = 3.0 / (1.0 + OUTER + OUTER * OUTER);
/// Thinnest layer that is drawn, in columns.
const FILM: f64 = 1e-3;

impl Ground {
    /// What sticks to bodies, where they are at the last tick: a block for each patch of them. It is empty if nothing does.
    pub fn clods(&self) -> Mesh {
        let mut mesh = Mesh::default();
        for coats in self.coats.values() {
            let outward = coats.outward();
            for (corners, volume) in coats.patches() {
                self.clod(corners, volume, outward, &mut mesh);
            }
        }
        mesh
    }

    fn clod(&self, [a, b, c]: [Vector; 3], volume: i64, outward: f64, mesh: &mut Mesh) {
        let across = (b - a).cross(&(c - a));
        let (twice, cell) = (across.norm(), self.cell());
        let layer = volume as f64 / QUANTA * cell.powi(3) / (0.5 * twice);
        if !(layer >= FILM * cell && layer.is_finite()) {
            return;
        }
        let up = across * (outward * HIGH * layer / twice);
        let middle = (a + b + c) / 3.0;
        // Counterclockwise from outside.
        let base = if outward > 0.0 { [a, b, c] } else { [a, c, b] };
        let top = base.map(|corner| middle + (corner - middle) * OUTER + up);
        let first = mesh.points.len() as u32;
        mesh.points.extend(base.into_iter().chain(top));
        let mut add = |corners: [u32; 3]| mesh.triangles.push(corners.map(|corner| first + corner));
        for n in 0..3 {
            let next = (n + 1) % 3;
            add([n, next, next + 3]);
            add([n, next + 3, n + 3]);
        }
        add([3, 4, 5]);
    }
}

impl Coats {
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

    /// A block that has been in the ground: what is drawn lies outside of it and has the volume of what sticks to it, whichever way its triangles go round.
    #[test]
    fn blocks_lie_outside_of_a_body_and_have_the_volume_of_what_sticks_to_it() -> Result<(), Error> {
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
            // Of open blocks: with the triangle at the body, each is closed.
            let six = |a: Vector, b: Vector, c: Vector| a.dot(&b.cross(&c)) / 6.0;
            let mut volume = 0.0;
            for corners in &mesh.triangles {
                let [a, b, c] = corners.map(|n| mesh.points[n as usize] - middle);
                volume += six(a, b, c);
            }
            for block in mesh.points.chunks(6) {
                let [a, b, c] = [block[0], block[1], block[2]].map(|point| point - middle);
                volume -= six(a, b, c);
                assert!((block[3] - middle).norm() > (block[0] - middle).norm());
            }
            assert!(ground.sticking() > 5e-5, "{}", ground.sticking());
            assert!((volume / ground.sticking() - 1.0).abs() < 1e-3, "{volume} {}", ground.sticking());
        }
        Ok(())
    }
}
