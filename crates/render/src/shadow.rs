//! Shadows: maps of what is nearest to the sun, and to each of many places of the sky.
//!
//! A map is a raster of depths, seen from infinitely far away in one direction. A point is in shadow if the map holds something nearer than it
//! there. The sun has one map, about as fine as the picture; the sky has [`PLACES`], coarse ones, and the part of the sky that a point sees is the mean over
//! them. Maps are rastered by rules without chance and read in the same way by every thread.
//!
//! **Errors.** The edge of a shadow is smooth over three cells of the map, and a shadow begins up to [`SLOPE`] cells behind what casts it (the
//! price of no self-shadowing on slopes). The cell of the sun's map is a pixel of the picture, or a [`FINEST`]th of the scene where that is more; that
//! of the sky's maps is a [`COARSE`]th of the scene, so crevices narrower than a fiftieth of the scene are not darkened. Small pictures have
//! fewer and coarser maps of the sky ([`Fineness`]). Ground of soil may reach far beyond what stands on it: then the sun has a second map, of
//! that alone, and so has the sky.

mod open_sky;

use std::sync::{Mutex, PoisonError};

use super::casters::{Batch, Casters, Reach};
use super::mapping::{Cut, Pinned};
use dlsys_geometry::scene::Vector;
pub(super) use open_sky::OpenSky;

/// Places of the sky from which light comes; fewer where there are more triangles than [`MANY`].
const FEW_PLACES: usize = 24;
const MANY: usize = 500_000;
/// Cells along the larger side of the maps.
const FINEST: f64 = 3072.0;
const LEAST: f64 = 256.0;
const COARSE: f64 = 128.0;
/// How much is computed of the light of the sky, by the pixels along the larger side of the picture.
const FINENESSES: [Fineness; 3] = [
    Fineness { pixels: 220.0, places: 32, cells: COARSE / 2.0, floor: 128 },
    Fineness { pixels: 440.0, places: 64, cells: COARSE * 0.75, floor: 224 },
    Fineness { pixels: f64::INFINITY, places: 128, cells: COARSE, floor: 320 },
];
/// The sun has a second map if that is so many times as fine.
const FINER: f64 = 1.5;
/// Cells of the coarse map by which the finer one reaches beyond what stands on the ground.
const EDGE: f64 = 3.5;
/// The maps of the sky leave out ground that reaches so many times as far as what stands on it, but for a rim, in parts of the
/// larger side, in which its shadows fade.
const FURTHER: f64 = 2.0;
const RIM: f64 = 0.15;
/// Bias of depths, in cells: on a surface that faces the light, and at most.
const BIAS: f32 = 1.0;
const SLOPE: f32 = 8.0;

/// How much is computed of the light of the sky.
#[derive(Clone, Copy)]
pub(super) struct Fineness {
    /// Of pictures that have no more pixels along their larger side than this.
    pixels: f64,
    /// Places of the sky.
    places: usize,
    /// Cells along the larger side of each map.
    cells: f64,
    /// Places along a side of the floor.
    floor: usize,
}

impl Fineness {
    /// Of a picture of so many pixels along its larger side.
    pub(super) fn of(pixels: f64) -> Fineness {
        let [.., finest] = FINENESSES;
        FINENESSES.into_iter().find(|fineness| pixels <= fineness.pixels).unwrap_or(finest)
    }
}

/// The vertices of a batch in a map, by coordinate: many are placed at once.
#[derive(Default)]
struct Placed {
    at: [Vec<f32>; 3],
    /// The first column and row whose middles are not before it, in the upper and the lower half of the bits.
    cells: Vec<u32>,
}

impl Placed {
    /// Places vertices, given the function of each coordinate, in a map of this size.
    fn fill(&mut self, [x, y, z]: &[Vec<f32>; 3], along: impl Fn(usize, [f32; 3]) -> f32, size: [usize; 2]) {
        for (k, at) in self.at.iter_mut().enumerate() {
            at.clear();
            at.extend(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| along(k, [x, y, z])));
        }
        let [right, up, _] = &self.at;
        // Maps have fewer than 2^16 cells on a side.
        let [width, height] = size.map(|side| side as f32);
        // In this form, as 32-bit integers, several are computed at once.
        let cell = |at: f32, side: f32| {
            let at = if at + 0.5 > 0.0 { at + 0.5 } else { 0.0 };
            (if at < side { at } else { side }) as i32
        };
        self.cells.clear();
        let cells = right.iter().zip(up).map(|(x, y)| (cell(*x, width) << 16 | cell(*y, height)) as u32);
        self.cells.extend(cells);
    }

    /// Whether a triangle may cover the middle of a cell. Most are smaller than a cell and do not: then there is no middle of a column, or none of
    /// a row, between its corners.
    fn may_cover(&self, corners: &[u32; 3]) -> bool {
        let [p, q, r] = corners.map(|v| self.cells[v as usize]);
        let apart = (p ^ q) | (p ^ r);
        apart >> 16 != 0 && apart & 0xffff != 0
    }

    fn at(&self, corners: &[u32; 3]) -> [[f32; 3]; 3] {
        corners.map(|v| self.at.each_ref().map(|at| at[v as usize]))
    }
}

/// Depths towards a light.
struct Map {
    /// To the right, up, and towards the light.
    axes: [Vector; 3],
    middle: Vector,
    low: [f64; 2],
    /// Cells in a scene unit.
    scale: f64,
    size: [usize; 2],
    /// In cells, greater being nearer to the light.
    depths: Vec<f32>,
    /// Cells at the border in which shadows fade.
    rim: f32,
}

impl Map {
    /// Of light from a direction on a box, with so many cells for a scene unit, as far as `most` cells on a side allow; nothing is in it.
    /// Batches are relative to `middle`.
    fn new(middle: Vector, [centre, half]: Reach, towards: Vector, scale: f64, most: f64) -> Map {
        let towards = towards.normalize();
        let aside = if towards.y.abs() < 0.9 { Vector::y() } else { Vector::z() };
        let right = aside.cross(&towards).normalize();
        let axes = [right, towards.cross(&right), towards];
        let reach = [0, 1].map(|k: usize| axes[k].abs().dot(&half));
        let larger = (2.0 * reach[0].max(reach[1])).max(f64::MIN_POSITIVE);
        let scale = (larger * scale).clamp(LEAST.min(most), most) / larger;
        // Two cells all round.
        let size = reach.map(|reach| (2.0 * reach * scale).ceil() as usize + 4);
        let low = [0, 1].map(|k| axes[k].dot(&(centre - middle)) - reach[k] - 2.0 / scale);
        let depths = vec![f32::NEG_INFINITY; size[0] * size[1]];
        Map { axes, middle, low, scale, size, depths, rim: 0.0 }
    }

    /// Adds triangles and thin stems. `placed` is memory.
    fn add(&mut self, batch: &Batch, placed: &mut Placed) {
        let Map { axes, low, scale, .. } = *self;
        let scaled = axes.map(|axis| [axis.x, axis.y, axis.z].map(|x| (x * scale) as f32));
        let from = [(low[0] * scale) as f32, (low[1] * scale) as f32, 0.0];
        let along = |k: usize, [x, y, z]: [f32; 3]| {
            let [right, up, towards] = scaled[k];
            right * x + up * y + towards * z - from[k]
        };
        let place = |p: &[f32; 3]| [0, 1, 2].map(|k| along(k, *p));
        placed.fill(&batch.vertices, along, self.size);
        for corners in &batch.triangles {
            if placed.may_cover(corners) {
                self.fill(placed.at(corners), |_| true);
            }
        }
        for (corners, places, texture) in &batch.cut {
            let corners = placed.at(corners);
            let pinned = [0, 1, 2].map(|k| Pinned {
                at: [corners[k][0].into(), corners[k][1].into()],
                place: places[k],
                magnification: 1.0,
            });
            if let Some(cut) = Cut::new(texture, pinned, 1) {
                self.fill(corners, |at| cut.is_drawn(at.map(f64::from)));
            }
        }
        for ([a, b], radii) in &batch.lines {
            let [a, b] = [place(a), place(b)];
            let radii = radii.map(|radius| (radius * scale as f32).max(0.5));
            self.line([a, b], radii);
        }
    }

    /// Cells to the right and up, and depth, of a point relative to the middle.
    fn place(&self, p: Vector) -> [f32; 3] {
        let at = |k: usize, low: f64| ((self.axes[k].dot(&p) - low) * self.scale) as f32;
        [at(0, self.low[0]), at(1, self.low[1]), at(2, 0.0)]
    }

    /// A thin stem as two triangles that face the light.
    fn line(&mut self, [a, b]: [[f32; 3]; 2], radii: [f32; 2]) {
        let (x, y) = (b[0] - a[0], b[1] - a[1]);
        let length = x.hypot(y).max(1e-6);
        let (x, y) = (x / length, y / length);
        let corner = |p: [f32; 3], r: f32, ahead: f32, side: f32| {
            [p[0] + r * (x * ahead - y * side), p[1] + r * (y * ahead + x * side), p[2]]
        };
        let [p, q] = [corner(a, radii[0], -0.7, 1.0), corner(a, radii[0], -0.7, -1.0)];
        let [s, t] = [corner(b, radii[1], 0.7, 1.0), corner(b, radii[1], 0.7, -1.0)];
        self.fill([p, q, t], |_| true);
        self.fill([p, t, s], |_| true);
    }

    /// Keeps the nearest of a triangle in each cell whose middle it covers, if it `is_drawn` there; on its edge counts as within.
    fn fill(&mut self, [p, q, r]: [[f32; 3]; 3], is_drawn: impl Fn([f32; 2]) -> bool) {
        let range = |k: usize| {
            let low = p[k].min(q[k]).min(r[k]) + 0.5;
            let high = p[k].max(q[k]).max(r[k]) + 0.5;
            (low.max(0.0) as usize, (high.max(0.0) as usize).min(self.size[k]))
        };
        let ((left, right), (bottom, top)) = (range(0), range(1));
        if left >= right || bottom >= top {
            return;
        }
        let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let scale = 1.0 / area;
        let slope = [
            ((q[2] - p[2]) * (r[1] - p[1]) - (r[2] - p[2]) * (q[1] - p[1])) * scale,
            ((r[2] - p[2]) * (q[0] - p[0]) - (q[2] - p[2]) * (r[0] - p[0])) * scale,
        ];
        let (least, most) = (p[2].min(q[2]).min(r[2]), p[2].max(q[2]).max(r[2]));
        for row in bottom..top {
            let y = row as f32 + 0.5;
            for column in left..right {
                let x = column as f32 + 0.5;
                let side = |a: [f32; 3], b: [f32; 3]| {
                    ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) * scale
                };
                if side(p, q) < 0.0 || side(q, r) < 0.0 || side(r, p) < 0.0 {
                    continue;
                }
                if !is_drawn([x, y]) {
                    continue;
                }
                let depth = p[2] + slope[0] * (x - p[0]) + slope[1] * (y - p[1]);
                let held = &mut self.depths[row * self.size[0] + column];
                *held = held.max(depth.clamp(least, most));
            }
        }
    }

    /// Where a point on a surface whose lit side has this normal is in the map: the cell whose middle is to its left and below, the part of
    /// a cell from there, and its depth; `None` outside of the map.
    fn cell(&self, at: Vector, normal: Vector, around: i32) -> Option<([usize; 2], [f32; 2], f32)> {
        let cos = normal.dot(&self.axes[2]).clamp(0.05, 1.0);
        let slope = ((1.0 - cos * cos).sqrt() / cos) as f32;
        // Off the surface by a cell, so that it does not hide itself where it bends.
        let [x, y, depth] = self.place(at - self.middle + normal * (1.0 / self.scale));
        let depth = depth + (BIAS * (1.0 + slope)).min(SLOPE);
        let (x, y) = (x - 0.5, y - 0.5);
        // Within the map towards zero is down.
        let (column, row) = (x as i32, y as i32);
        let is_within =
            |x: f32, at: i32, side: usize| x >= 0.0 && at >= around && at < side as i32 - around - 1;
        (is_within(x, column, self.size[0]) && is_within(y, row, self.size[1])).then_some((
            [column as usize, row as usize],
            [x - column as f32, y - row as f32],
            depth,
        ))
    }

    /// The part of the light that comes to a point on a surface whose lit side has this normal, from 0 to 1: the mean over a square of
    /// three by three cells; `None` outside of the map.
    fn visible(&self, at: Vector, normal: Vector) -> Option<f64> {
        let ([left, bottom], [u, v], depth) = self.cell(at, normal, 1)?;
        // Four by four cells, those at the rim by the part that the square covers.
        let (across, along) = ([1.0 - u, 1.0, 1.0, u], [1.0 - v, 1.0, 1.0, v]);
        let mut sum = 0.0;
        for (j, along) in along.into_iter().enumerate() {
            let start = (bottom - 1 + j) * self.size[0] + left - 1;
            for (held, across) in self.depths[start..start + 4].iter().zip(across) {
                sum += if *held > depth { 0.0 } else { across * along };
            }
        }
        Some(f64::from(sum) / 9.0)
    }

    /// The same over a square of one cell.
    fn roughly_visible(&self, at: Vector, normal: Vector) -> f64 {
        let Some(([left, bottom], [u, v], depth)) = self.cell(at, normal, 0) else { return 1.0 };
        let start = bottom * self.size[0] + left;
        let open = |k: usize| if self.depths[k] > depth { 0.0 } else { 1.0 };
        let row = |start: usize| open(start) * (1.0 - u) + open(start + 1) * u;
        let part = row(start) * (1.0 - v) + row(start + self.size[0]) * v;
        if self.rim == 0.0 {
            return part.into();
        }
        let inside = |at: usize, side: usize| at.min(side - at) as f32;
        let from_border = inside(left, self.size[0]).min(inside(bottom, self.size[1]));
        (1.0 - (1.0 - part) * (from_border / self.rim).min(1.0)).into()
    }
}

/// The maps of a frame.
pub(super) struct Maps {
    /// The finer one first.
    sun: Vec<Map>,
    sky: Vec<Map>,
}

impl Maps {
    /// Maps of the sun, if there is one in this direction, with so many cells for a scene unit, and of the sky.
    pub(super) fn new(
        casters: &Casters,
        sun: Option<Vector>,
        scale: f64,
        fineness: Fineness,
        threads: usize,
    ) -> Maps {
        let (around, core) = (casters.around(), casters.core());
        let places = if casters.count() > MANY { FEW_PLACES } else { fineness.places };
        let [middle, _] = around;
        let larger = |[_, half]: Reach| half.max();
        let is_far = larger(around) > FURTHER * larger(core);
        let sky = (0..places).map(|i| {
            let rim = if is_far { RIM * larger(core) } else { 0.0 };
            let within = if is_far { [core[0], core[1].add_scalar(rim)] } else { around };
            let mut map = Map::new(middle, within, place_of_sky(i, places), 0.0, fineness.cells);
            map.rim = (rim * map.scale) as f32;
            map
        });
        // The sun's maps are the largest, and first.
        let of_sun = sun.map(|sun| {
            let whole = Map::new(middle, around, sun, scale, FINEST);
            // What is beyond the finer map is in the shadow of ground alone: the edges of other shadows are wider in the coarse one.
            let wide = [core[0], core[1].add_scalar(EDGE / whole.scale)];
            let close = (core != around).then(|| Map::new(middle, wide, sun, scale, FINEST));
            close.filter(|close| close.scale > FINER * whole.scale).into_iter().chain([whole]).collect()
        });
        let mut maps: Vec<Map> = of_sun.unwrap_or_default();
        let suns = maps.len();
        maps.extend(sky);
        casters.each_batch(|batch| {
            let next = Mutex::new(maps.iter_mut());
            let work = || {
                let take = || next.lock().unwrap_or_else(PoisonError::into_inner).next();
                let mut placed = Placed::default();
                while let Some(map) = take() {
                    map.add(batch, &mut placed);
                }
            };
            std::thread::scope(|scope| {
                (1..threads).for_each(|_| drop(scope.spawn(work)));
                work();
            });
        });
        let sky = maps.split_off(suns);
        Maps { sun: maps, sky }
    }

    /// The part of the sun's light that comes to a point on a surface whose lit side has this normal.
    pub(super) fn sun(&self, at: Vector, normal: Vector) -> f64 {
        self.sun.iter().find_map(|map| map.visible(at, normal)).unwrap_or(1.0)
    }

    /// The light of the sky on the side of a surface with this normal, and what of it comes from one surface to the next: 1 on the open ground.
    pub(super) fn sky(&self, at: Vector, normal: Vector) -> f64 {
        let free = 0.5 + 0.5 * normal.y;
        let part = self.seen_sky(at, normal) / free.max(1e-3);
        free.max(1e-3) * thrown(part)
    }

    /// The light that comes from the sky itself.
    fn seen_sky(&self, at: Vector, normal: Vector) -> f64 {
        let light = self.sky.iter().map(|map| {
            let cos = normal.dot(&map.axes[2]);
            if cos > 0.0 { cos * map.roughly_visible(at, normal) } else { 0.0 }
        });
        // The mean cosine over the places is a half.
        2.0 * light.sum::<f64>() / self.sky.len().max(1) as f64
    }
}

/// The strength of the sky's light at a place from which this part of the sky is seen, past surfaces that throw half of their light back (Jimenez et al.
/// 2016, *Practical realtime strategies for accurate indirect occlusion*, a fit of path tracing by albedo). Strengths multiply encoded colours, which are
/// about square roots of light: so in deep shade. In slight shade the part itself is the strength, which shows where things touch.
pub(super) fn thrown(part: f64) -> f64 {
    if part >= 1.0 {
        return part;
    }
    let light = part.max(((0.688 * part - 1.756) * part + 2.068) * part).max(0.0);
    part + (light.sqrt() - part) * (1.0 - part).powi(2)
}

/// The direction towards a place of the sky: evenly spread, along a spiral at golden angles (Vogel 1979).
fn place_of_sky(i: usize, count: usize) -> Vector {
    const GOLDEN: f64 = 2.399_963_229_728_653;
    let up = (i as f64 + 0.5) / count as f64;
    let (sin, cos) = (GOLDEN * i as f64).sin_cos();
    let flat = (1.0 - up * up).sqrt();
    Vector::new(flat * sin, up, flat * cos)
}
