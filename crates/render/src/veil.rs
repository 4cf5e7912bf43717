//! Gas in front of a picture, from fewer rays than pixels.
//!
//! A ray through gas costs as much as it passes blobs, and what neighbouring rays give differs little where blobs are many pixels large. So a picture is divided
//! into tiles. A tile has rays at the nodes of a lattice, as coarse as the smallest blob in front of it allows, and cubics between them; these are compared
//! with rays at some pixels, and where they are wrong by more than [`WRONG`], the lattice gets finer, down to a ray for each pixel.
//! A surface behind all gas of its tile is seen through the same rays; one within the gas has a ray of its own.
//!
//! A tile is made when the first of its pixels is needed. It depends on nothing but the scene and the camera, so pictures do not depend on threads.

use std::sync::OnceLock;

use dlsys_geometry::scene::Point;

use super::haze::{Haze, Through};
use super::lens::Lens;

/// Pixels along the side of a tile.
const TILE: usize = 64;
/// Cells along the side of the coarsest and of the finest lattice of a tile.
const CELLS: [usize; 2] = [4, 32];
/// Largest difference from a ray at the pixels that are compared: a quarter of a step of a channel, for light and for what passes.
const WRONG: f64 = 0.25 / 255.0;
/// The finest lattice has cells of two pixels; smaller blobs than this, in pixels, get a ray for each pixel.
const SMALLEST: f64 = 2.0;
/// Cells in which a tile is compared with rays, as parts of its side: no two in a row or column of the coarsest lattice.
const COMPARED: [[f64; 2]; 8] =
    [[0.1, 0.35], [0.4, 0.1], [0.65, 0.6], [0.9, 0.85], [0.15, 0.9], [0.35, 0.65], [0.6, 0.15], [0.85, 0.4]];

/// The gas in front of a picture.
pub(super) struct Veil<'a> {
    haze: &'a Haze,
    lens: &'a Lens,
    columns: usize,
    tiles: Vec<Tile>,
}

/// A part of a picture.
struct Tile {
    /// The standard deviation of the smallest blob in front of it, in pixels; infinite if there is no gas.
    smallest: f64,
    /// Depths, as the camera projects them, between which all gas lies.
    depths: [f64; 2],
    lattice: OnceLock<Lattice>,
}

/// What the rays at the nodes of a tile give.
struct Lattice {
    /// Cells along a side; 0 if each pixel has its own ray.
    cells: usize,
    /// Row by row, from a cell before the tile to a cell behind it.
    nodes: Vec<Through>,
}

impl<'a> Veil<'a> {
    pub(super) fn new(haze: &'a Haze, lens: &'a Lens) -> Veil<'a> {
        let [columns, rows] = lens.size.map(|side| side.div_ceil(TILE));
        let empty = || Tile {
            smallest: f64::INFINITY,
            depths: [f64::INFINITY, f64::NEG_INFINITY],
            lattice: OnceLock::new(),
        };
        let mut tiles: Vec<Tile> = std::iter::repeat_with(empty).take(columns * rows).collect();
        for (centre, deviation, reach) in haze.balls() {
            if lens.misses(centre, reach) {
                continue;
            }
            let [across, down] = lens.pixels(centre, reach).map(|[low, high]| (low / TILE, high / TILE));
            let pixels = deviation * lens.scale_at(centre);
            let depths = lens.depths(centre, reach);
            for row in down.0..=down.1.min(rows - 1) {
                for tile in &mut tiles[row * columns..][across.0..=across.1.min(columns - 1)] {
                    tile.smallest = tile.smallest.min(pixels);
                    tile.depths = [tile.depths[0].min(depths[0]), tile.depths[1].max(depths[1])];
                }
            }
        }
        Veil { haze, lens, columns, tiles }
    }

    /// A colour, times its opacity, and its opacity, behind the gas, at a pixel: far away, or on a surface that is seen at this depth, as the camera projects
    /// it.
    pub(super) fn over(&self, pixel: [usize; 2], depth: Option<f64>, behind: [u8; 4]) -> [u8; 4] {
        let tile = &self.tiles[pixel[1] / TILE * self.columns + pixel[0] / TILE];
        let is_behind = depth.is_none_or(|depth| depth <= tile.depths[0]);
        if tile.smallest == f64::INFINITY || depth.is_some_and(|depth| depth >= tile.depths[1]) {
            return behind;
        }
        let lattice = is_behind.then(|| tile.lattice.get_or_init(|| self.lattice(pixel, tile.smallest)));
        let through = match lattice.filter(|lattice| lattice.cells > 0) {
            Some(lattice) => lattice.at(pixel.map(|at| (at % TILE) as f64 + 0.5)),
            None => {
                let middle = pixel.map(|at| at as f64 + 0.5);
                self.haze.through(self.seen(middle, depth.unwrap_or(0.0)), depth.is_some())
            }
        };
        through.over(behind)
    }

    /// The point that is seen at a place of the picture in pixels.
    fn seen(&self, [x, y]: [f64; 2], depth: f64) -> Point {
        let at = self.lens.at([x, y]);
        Point::new(at.x, at.y, depth)
    }

    /// The lattice of the tile of a pixel.
    fn lattice(&self, pixel: [usize; 2], smallest: f64) -> Lattice {
        let corner = pixel.map(|at| (at / TILE * TILE) as f64);
        let ray = |[x, y]: [f64; 2]| self.haze.through(self.seen([corner[0] + x, corner[1] + y], 0.0), false);
        let [mut cells, finest] = CELLS;
        // A cell is no larger than the standard deviation of the smallest blob.
        while (TILE / cells) as f64 > smallest && cells < finest {
            cells *= 2;
        }
        while smallest >= SMALLEST && cells <= finest {
            let side = (TILE / cells) as f64;
            let places = || (0..cells + 3).map(|k| (k as f64 - 1.0) * side);
            let nodes = places().flat_map(|y| places().map(move |x| [x, y])).map(ray).collect();
            let lattice = Lattice { cells, nodes };
            // The middles of cells, where cubics are furthest from the nodes.
            let middle = |part: f64| ((part * cells as f64).floor() + 0.5) * side;
            let is_right = |at: &[f64; 2]| {
                let at = at.map(middle);
                lattice.at(at).distance(&ray(at)) <= WRONG
            };
            if COMPARED.iter().all(is_right) {
                return lattice;
            }
            cells *= 2;
        }
        Lattice { cells: 0, nodes: Vec::new() }
    }
}

impl Lattice {
    /// Between nodes, at a place in pixels from the corner of the tile: cubics through four nodes along each axis (Catmull and Rom).
    fn at(&self, at: [f64; 2]) -> Through {
        let side = (TILE / self.cells) as f64;
        let [(column, across), (row, down)] = at.map(|at| {
            let cell = ((at / side) as usize).min(self.cells - 1);
            (cell, weights(at / side - cell as f64))
        });
        let width = self.cells + 3;
        let mut sum = Through::NOTHING;
        for (k, down) in down.into_iter().enumerate() {
            let nodes = &self.nodes[(row + k) * width + column..];
            for (node, across) in nodes.iter().zip(across) {
                sum.add(node, down * across);
            }
        }
        sum.within_bounds()
    }
}

/// Weights of four nodes in a row, for a place in parts of the way from the second to the third.
fn weights(s: f64) -> [f64; 4] {
    [
        s * (-0.5 + s * (1.0 - 0.5 * s)),
        1.0 + s * s * (1.5 * s - 2.5),
        s * (0.5 + s * (2.0 - 1.5 * s)),
        s * s * (0.5 * s - 0.5),
    ]
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::haze::Around;
    use crate::{Survey, View};
    use dlsys_geometry::scene::{Blob, Color, Gas, Scene, Vector};

    /// A few large blobs to the left, many small ones to the right, all in the depth from -1 to 1.
    fn scene() -> Scene {
        let draw = |n: u64, k: u64| {
            let bits = (n * 7 + k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((bits ^ (bits >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let blobs = (0..240).map(|n| {
            let x = 4.0 * draw(n, 0) - 2.0;
            let size = if x < 0.0 { 0.3 } else { 0.03 + 0.1 * draw(n, 1) };
            let centre = Point::new(x, 3.0 * draw(n, 2), 1.4 * draw(n, 3) - 0.7);
            Blob { centre, deviation: size * (0.8 + 0.4 * draw(n, 4)), mass: size, key: n }
        });
        let gas = Gas {
            name: Arc::from("smoke"),
            color: Color { red: 220, green: 180, blue: 90 },
            albedo: 0.8,
            glow: 0.3,
            area: 0.2,
            size: 0.1,
            blobs: blobs.collect(),
        };
        let mut scene = Scene::default();
        scene.gases.push(gas);
        scene
    }

    /// Rays at lattices differ from a ray for each pixel by a step of a channel at most, far away, on surfaces within the gas, and behind it.
    #[test]
    fn pictures_are_those_of_a_ray_for_each_pixel() {
        let scene = scene();
        for field in [None, Some(50.0)] {
            let survey = Survey::new(View::FRONT);
            let mut survey = field.map_or(survey.clone(), |field| survey.with_perspective(field));
            survey.add(&scene);
            let fit = survey.fit();
            let [left, bottom, width, height] = fit.picture.area;
            let scale = 400.0 / width.max(height);
            let size = [width, height].map(|side| (side * scale).ceil() as u32);
            let lens = Lens::new(&fit, size, [scale, -left * scale, (bottom + height) * scale]);
            let sun = Some(Vector::new(1.0, 2.0, 1.0).normalize());
            let around = Around { sun, tint: None, is_flat: false, visible: &|_| 1.0 };
            let haze = Haze::new(&scene, fit.camera, &around, 1).expect("a gas");
            let veil = Veil::new(&haze, &lens);
            let near = fit.camera.project(Point::new(0.0, 1.5, 0.2)).z;
            let far = fit.camera.project(Point::new(0.0, 1.5, -50.0)).z;
            let mut worst = [0; 3];
            for (k, depth) in [None, Some(near), Some(far)].into_iter().enumerate() {
                for row in 0..lens.size[1] {
                    for column in (0..lens.size[0]).step_by(3) {
                        let behind = [90, 160, 230, 255];
                        let seen = veil.seen([column, row].map(|at| at as f64 + 0.5), depth.unwrap_or(0.0));
                        let exact = haze.through(seen, depth.is_some()).over(behind);
                        let shown = veil.over([column, row], depth, behind);
                        for (a, b) in exact.into_iter().zip(shown) {
                            worst[k] = worst[k].max(a.abs_diff(b));
                        }
                    }
                }
            }
            assert!(worst[0] <= 1 && worst[1] == 0 && worst[2] <= 1, "{worst:?}");
            let cells = |tile: &Tile| tile.lattice.get().map_or(0, |lattice| lattice.cells);
            let coarse = veil.tiles.iter().filter(|tile| (1..=16).contains(&cells(tile))).count();
            assert!(coarse > veil.tiles.len() / 4, "{coarse} of {} tiles", veil.tiles.len());
        }
    }

    #[test]
    fn cubics_pass_through_nodes_and_have_the_slope_of_parabolas() {
        for (s, expected) in [(0.0, [0.0, 1.0, 0.0, 0.0]), (1.0, [0.0, 0.0, 1.0, 0.0])] {
            assert_eq!(weights(s), expected);
        }
        for s in [0.0, 0.25, 0.5, 0.9] {
            let value = |of: fn(f64) -> f64| -> f64 {
                weights(s).iter().zip([-1.0, 0.0, 1.0, 2.0]).map(|(w, x)| w * of(x)).sum()
            };
            assert!((value(|_| 1.0) - 1.0).abs() < 1e-15);
            assert!((value(|x| x * x - 3.0 * x) - (s * s - 3.0 * s)).abs() < 1e-15);
        }
    }
}
