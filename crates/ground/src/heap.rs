//! Material that lies on bodies, as triangles: a sheet over each body's floors that thins out over bare ones and ends where it is a film, with walls down
//! to the body at its edges.

use std::collections::{BTreeSet, HashMap};

use crate::load::Floor;
use crate::tile::QUANTA;
use crate::{Ground, Mesh, Vector};

/// Floors of a body beside each other are parts of one surface up to this difference of their heights, in quanta.
const STEP: i64 = 3 << 32;
/// Parts of a cell by which offsets are counted.
const LATTICE: f64 = 65_536.0;
/// Thickness from which on material is drawn, in quanta: a fiftieth of a cell.
const FILM: f64 = 0.02 * QUANTA;
/// Columns around a corner, from the column before it along both axes.
const AROUND: [(i32, i32); 4] = [(0, 0), (1, 0), (1, 1), (0, 1)];

/// A corner between four columns: its place in m on top of what lies there and on the body, and the thickness between them in quanta.
#[derive(Clone, Copy)]
struct Corner {
    top: Vector,
    bottom: Vector,
    thickness: f64,
}

impl Corner {
    fn is_drawn(&self) -> bool {
        self.thickness >= FILM
    }

    /// The place between a corner that is drawn and one that is not at which the film begins.
    fn rim(a: &Corner, b: &Corner) -> Corner {
        let (thin, thick) = if a.is_drawn() { (b, a) } else { (a, b) };
        let part = (FILM - thin.thickness) / (thick.thickness - thin.thickness);
        let between = |from: Vector, to: Vector| from + (to - from) * part;
        Corner {
            top: between(thin.top, thick.top),
            bottom: between(thin.bottom, thick.bottom),
            thickness: FILM,
        }
    }

    /// The parts of a line from corner to corner that are drawn.
    fn drawn(from: &Corner, to: &Corner) -> Option<[Corner; 2]> {
        match (from.is_drawn(), to.is_drawn()) {
            (true, true) => Some([*from, *to]),
            (true, false) => Some([*from, Corner::rim(from, to)]),
            (false, true) => Some([Corner::rim(from, to), *to]),
            (false, false) => None,
        }
    }
}

impl Ground {
    /// The surface of what lies on bodies. It is empty if nothing does.
    pub fn heaps(&self) -> Mesh {
        let mut mesh = Mesh::default();
        let mut numbers: HashMap<[u64; 3], u32> = HashMap::new();
        let mut number = |mesh: &mut Mesh, point: Vector| {
            *numbers.entry([point.x, point.y, point.z].map(f64::to_bits)).or_insert_with(|| {
                mesh.points.push(point);
                mesh.points.len() as u32 - 1
            })
        };
        let loaded = self.floors.iter().filter(|(_, floors)| floors.iter().any(|floor| floor.load > 0));
        let around =
            |(i, k): (i32, i32)| (-1..=1).flat_map(move |di| (-1..=1).map(move |dk| (i + di, k + dk)));
        let near: BTreeSet<(i32, i32)> = loaded.flat_map(|(column, _)| around(*column)).collect();
        for (i, k) in near {
            for floor in self.floors.get(&(i, k)).into_iter().flatten() {
                // Counterclockwise from above: x to the right, z towards the viewer.
                let corners = [(i - 1, k - 1), (i - 1, k), (i, k), (i, k - 1)];
                let corners = corners.map(|first| self.corner(floor, first));
                let sides = [0, 1, 2, 3].map(|n| Corner::drawn(&corners[n], &corners[(n + 1) % 4]));
                let mut outline: Vec<u32> = Vec::new();
                for end in sides.iter().flatten().flatten() {
                    let end = number(&mut mesh, end.top);
                    if outline.last() != Some(&end) {
                        outline.push(end);
                    }
                }
                for n in 2..outline.len() {
                    mesh.triangles.push([outline[0], outline[n - 1], outline[n]]);
                }
                // Beyond each of the edges that begin at these corners.
                let beyond = [(i - 1, k), (i, k + 1), (i + 1, k), (i, k - 1)];
                for (side, column) in sides.iter().zip(beyond) {
                    let Some([from, to]) = side.filter(|_| self.beside(floor, column).is_none()) else {
                        continue;
                    };
                    let [a, b, c, d] =
                        [from.top, from.bottom, to.bottom, to.top].map(|at| number(&mut mesh, at));
                    mesh.triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        mesh.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        mesh
    }

    /// The floor of the same body over a column that continues a floor.
    fn beside(&self, floor: &Floor, column: (i32, i32)) -> Option<&Floor> {
        let own = self.floors.get(&column)?.iter().filter(|other| other.body == floor.body);
        own.min_by_key(|other| (other.base - floor.base).abs())
            .filter(|other| (other.base - floor.base).abs() <= STEP)
    }

    /// The corner behind a column, of the surface that a floor is a part of: the mean of the four floors around it, those without load included.
    fn corner(&self, floor: &Floor, (i, k): (i32, i32)) -> Corner {
        let (mut base, mut load, mut offset) = (0_i128, 0_i128, [0_i128; 2]);
        let (mut count, mut loaded) = (0, 0);
        for (di, dk) in AROUND {
            let Some(other) = self.beside(floor, (i + di, k + dk)) else { continue };
            base += i128::from(other.base);
            count += 1;
            if other.load > 0 {
                load += i128::from(other.load);
                offset = [0, 1].map(|n| offset[n] + i128::from(other.offset[n]));
                loaded += 1;
            }
        }
        let cell = self.cell();
        // The floor itself is one of them.
        let base = base as f64 / f64::from(count.max(1));
        let aside = offset.map(|offset| offset as f64 / f64::from(loaded.max(1)) / LATTICE);
        let at = |height: f64| {
            Vector::new(
                (f64::from(i) + 0.5 + aside[0]) * cell,
                height / QUANTA * cell,
                (f64::from(k) + 0.5 + aside[1]) * cell,
            )
        };
        // Towards the rim, where floors are missing or bare, it thins out.
        let thickness = load as f64 / 4.0;
        Corner { top: at(base + thickness), bottom: at(base), thickness }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::{Body, Description, Extent, Ground, Place, Pour, Relief, Settings, Soil, Vector};

    /// Snow on a square shelf: the sheet over it lies between shelf and summit, and its volume is about that of the load.
    #[test]
    fn what_lies_on_a_shelf_is_a_sheet_of_its_volume() {
        let description = Description {
            cell: 0.01,
            extent: Extent::around(40),
            soil: Soil { repose: 35.0, inner: 60.0, ..Soil::snow() },
            bed: Relief::Level(0.0),
            depth: Relief::Level(0.0),
        };
        let mut ground = Ground::new(description, Settings::default()).expect("a ground");
        let corner = |x: f64, z: f64| Vector::new(x, 0.3, z);
        let points: Arc<[Vector]> =
            [corner(-0.1, -0.1), corner(-0.1, 0.1), corner(0.1, 0.1), corner(0.1, -0.1)].into();
        let mut shelf = Body::still(1, "Leaf", [[0, 1, 2], [0, 2, 3]].into(), points);
        shelf.shelf = true;
        assert!(ground.heaps().triangles.is_empty());
        for _ in 0..240 {
            ground
                .advance(&[Pour { id: 1, place: Place::Everywhere, rate: 0.01 }], &[shelf.clone()])
                .expect("a tick");
        }
        let mesh = ground.heaps();
        let summit = mesh.points.iter().map(|p| p.y).fold(0.0, f64::max);
        assert!(mesh.points.iter().all(|p| p.y >= 0.3) && summit > 0.31 && summit < 0.33, "{summit}");
        // Above the shelf, the volume under the triangles.
        let volume: f64 = (mesh.triangles.iter())
            .map(|corners| {
                let [a, b, c] = corners.map(|n| mesh.points[n as usize]);
                let plan = ((b.x - a.x) * (c.z - a.z) - (b.z - a.z) * (c.x - a.x)) / -2.0;
                plan * ((a.y + b.y + c.y) / 3.0 - 0.3)
            })
            .sum();
        assert!((volume / ground.carried() - 1.0).abs() < 0.02, "{volume} {}", ground.carried());
    }
}
