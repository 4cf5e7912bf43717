//! The surface as triangles: every column where the ground is uneven, few where it is flat, and no cracks between.
//!
//! A tile is divided into squares of 1, 2, 4 ... columns. Where a square meets a tile with smaller ones, it gets their corners too, and becomes a fan
//! around its middle.

use std::collections::{BTreeMap, HashMap};
use std::sync::PoisonError;

use crate::tile::{Key, QUANTA};
use crate::{Ground, Piece, Vector};

/// A surface of triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Points in m.
    pub points: Vec<Vector>,
    /// How far what is seen at the first points has slid, in m along x and z; empty where that is not followed. It is not of the points after these.
    pub slid: Vec<[f64; 2]>,
    /// Triangles as numbers of points, counterclockwise as seen from above.
    pub triangles: Vec<[u32; 3]>,
}

/// How far an untouched surface may lie beside the triangles that stand for it, in columns.
const FLAT: f64 = 0.02;

/// A body nearer above a column than this presses on it, in quanta.
const TOUCHING: i64 = 1 << 30;
/// Columns around one.
const AROUND: [(i32, i32); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

impl Mesh {
    /// Adds another mesh.
    pub fn append(&mut self, other: &Mesh) {
        let first = self.points.len() as u32;
        if !other.slid.is_empty() {
            self.slid.resize(self.points.len(), [0.0; 2]);
            self.slid.extend(&other.slid);
        }
        self.points.extend(&other.points);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|n| first + n)));
    }
}

/// A mesh in the making.
pub(crate) struct Weaver<'a> {
    ground: &'a Ground,
    mesh: Mesh,
    /// The columns of its points, and their numbers.
    columns: Vec<(i32, i32)>,
    numbers: HashMap<(i32, i32), u32>,
}

impl Ground {
    /// The surface, from the first to the last column along each axis.
    pub fn mesh(&self) -> Mesh {
        let squares = self.squares();
        let mut weaver = Weaver::new(self);
        for (key, size) in &squares {
            weaver.tile(&squares, *key, *size);
        }
        weaver.mesh
    }

    /// The height at which a column is drawn: under a body that presses on it, up to the ground beside the body, so that the surface closes with the
    /// body. The difference is within the body.
    pub(crate) fn shown(&self, i: i32, k: i32) -> i64 {
        let top = self.top(i, k);
        let (i, k) = self.extent().mirrored(i, k);
        let roof = self.roof((i, k));
        if roof == i64::MAX || roof - top > TOUCHING {
            return top;
        }
        let lid = self.floors.get(&(i, k)).and_then(|floors| floors.iter().find(|floor| floor.base >= roof));
        let free = |(di, dk): &(i32, i32)| self.roof((i + di, k + dk)) == i64::MAX;
        let beside = AROUND.iter().filter(|at| free(at)).map(|(di, dk)| self.top(i + di, k + dk)).max();
        let most = lid.map_or(top, |lid| roof + (lid.base - roof) / 2);
        beside.map_or(top, |beside| beside.min(most).max(top))
    }

    /// First and last corner of the squares of a tile along x and z.
    fn corners(&self, (p, q): Key) -> [[i32; 2]; 2] {
        let (side, extent) = (self.setup.side, self.extent());
        let range = |at: i32, [from, to]: [i32; 2]| [(at * side).max(from), (at * side + side).min(to)];
        [range(p, extent.x), range(q, extent.z)]
    }

    /// The size of the squares of each tile.
    pub(crate) fn squares(&self) -> BTreeMap<Key, i32> {
        let (side, extent) = (self.setup.side, self.extent());
        let tiles = |[from, to]: [i32; 2]| from.div_euclid(side)..=(to - 1).max(from).div_euclid(side);
        let keys = tiles(extent.x).flat_map(|p| tiles(extent.z).map(move |q| (p, q)));
        keys.map(|key| (key, self.square_size(key))).collect()
    }

    /// The largest size of squares that divides a tile and follows its surface.
    fn square_size(&self, key: Key) -> i32 {
        let stored = (0..4).any(|n| self.tiles.contains_key(&(key.0 + n % 2, key.1 + n / 2)));
        if stored {
            return self.size_of(key, true);
        }
        // What falls everywhere does not change it.
        let mut known = self.setup.squares.lock().unwrap_or_else(PoisonError::into_inner);
        *known.entry(key).or_insert_with(|| self.size_of(key, false))
    }

    fn size_of(&self, key: Key, stored: bool) -> i32 {
        let [x, z] = self.corners(key);
        let even = self.setup.description.bed.is_level() && self.setup.description.depth.is_level();
        let room = if stored { 0.0 } else { FLAT * QUANTA };
        let mut size = self.setup.side;
        while size > 1 {
            let divides = (x[1] - x[0]) % size == 0 && (z[1] - z[0]) % size == 0;
            if divides && (even && !stored || self.follows(x, z, size, room)) {
                return size;
            }
            size /= 2;
        }
        1
    }

    /// Whether the surface lies within some quanta of squares of a size.
    fn follows(&self, x: [i32; 2], z: [i32; 2], size: i32, room: f64) -> bool {
        let part = |n: i32| f64::from(n) / f64::from(size);
        (z[0]..z[1]).step_by(size as usize).all(|k| {
            (x[0]..x[1]).step_by(size as usize).all(|i| {
                let corner = |di: i32, dk: i32| self.top(i + di, k + dk) as f64;
                let [a, b, c, d] = [corner(0, 0), corner(size, 0), corner(0, size), corner(size, size)];
                (0..=size).all(|dk| {
                    (0..=size).all(|di| {
                        let (u, v) = (part(di), part(dk));
                        let plane = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
                        (corner(di, dk) - plane).abs() <= room
                    })
                })
            })
        })
    }

    /// The size of the squares on the other side of the edge of a square; its own within a tile.
    fn size_beside(&self, squares: &BTreeMap<Key, i32>, key: Key, size: i32, (i, k): (i32, i32)) -> i32 {
        let other = self.setup.place(i, k).0;
        if other == key { size } else { squares.get(&other).copied().unwrap_or(size) }
    }
}

impl<'a> Weaver<'a> {
    pub fn new(ground: &'a Ground) -> Weaver<'a> {
        Weaver { ground, mesh: Mesh::default(), columns: Vec::new(), numbers: HashMap::new() }
    }

    /// The squares of a tile.
    pub fn tile(&mut self, squares: &BTreeMap<Key, i32>, key: Key, size: i32) {
        let ground = self.ground;
        let [x, z] = ground.corners(key);
        for k in (z[0]..z[1]).step_by(size as usize) {
            for i in (x[0]..x[1]).step_by(size as usize) {
                self.square((i, k), size, |(i, k)| ground.size_beside(squares, key, size, (i, k)));
            }
        }
    }

    /// What has been woven, without the heights.
    pub fn piece(self) -> Piece {
        Piece { columns: self.columns, triangles: self.mesh.triangles }
    }

    /// The number of the point of a column.
    fn point(&mut self, (i, k): (i32, i32)) -> u32 {
        let (ground, columns) = (self.ground, &mut self.columns);
        let Mesh { points, slid, .. } = &mut self.mesh;
        *self.numbers.entry((i, k)).or_insert_with(|| {
            let cell = ground.cell();
            let height = ground.shown(i, k) as f64 / QUANTA * cell;
            columns.push((i, k));
            points.push(Vector::new(f64::from(i) * cell, height, f64::from(k) * cell));
            if ground.setup.settings.slides {
                slid.push(ground.slid(i, k));
            }
            points.len() as u32 - 1
        })
    }

    /// Triangles of a square from a column on; `beside` is the size of the squares at a column.
    fn square(&mut self, (i, k): (i32, i32), size: i32, beside: impl Fn((i32, i32)) -> i32) {
        let half = size / 2;
        // Corners counterclockwise from above, and a column beyond each of the edges that begin there.
        let corners = [(i, k), (i, k + size), (i + size, k + size), (i + size, k)];
        let beyond = [(i - 1, k + half), (i + half, k + size), (i + size, k + half), (i + half, k - 1)];
        let mut rim = Vec::new();
        for n in 0..4 {
            let (from, to) = (corners[n], corners[(n + 1) % 4]);
            let step = beside(beyond[n]).min(size);
            for m in 0..size / step {
                let along = |from: i32, to: i32| from + (to - from) / size * step * m;
                rim.push((along(from.0, to.0), along(from.1, to.1)));
            }
        }
        if rim.len() == 4 {
            let [a, b, c, d] = corners.map(|corner| self.point(corner));
            // The shorter diagonal, so that ridges and valleys are not cut.
            let drop = |from: u32, to: u32| {
                let height = |n: u32| self.mesh.points[n as usize].y;
                (height(from) - height(to)).abs()
            };
            let halves =
                if drop(a, c) <= drop(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            self.mesh.triangles.extend(halves);
            return;
        }
        let middle = self.point((i + half, k + half));
        let rim: Vec<u32> = rim.into_iter().map(|column| self.point(column)).collect();
        for (n, from) in rim.iter().enumerate() {
            self.mesh.triangles.push([middle, *from, rim[(n + 1) % rim.len()]]);
        }
    }
}
