//! The part of the sky that is seen from places of the floor.
//!
//! Each map of the sky stands for a part of it as wide as the angle to the next one, so what is high above the floor has a soft shadow in its
//! light, and what touches the floor has a sharp one: the shadow of each map on the floor is blurred by the distance of what casts it, in
//! [layers](LAYERS) of twice the distance each. Without that, the shadows of single maps would be seen as spots.
//!
//! ```text
//! depths of a map ─distances from the floor─▶ layers of covered cells ─blurred, added─▶ Shade ─sum over the sky, on a grid─▶ OpenSky
//! ```

use super::{BIAS, Fineness, Map, Maps, SLOPE};
use crate::casters::Reach;
use dlsys_geometry::scene::Vector;
use dlsys_threads::each;

/// Layers by distance along the light, in cells: up to 2, 4, 8 and so on.
const LAYERS: usize = 9;
/// Half of the width of a blur, in parts of the distance over which it acts and of the angle between neighbouring maps. Each acts twice.
const SPREAD: f64 = 0.8;
/// Least half width of a blur, in cells, which is none, and the greatest.
const LEAST: f64 = 0.5;
const MOST: f64 = 16.0;

/// The part of the sky that is seen from places of the floor, on a grid: it changes slowly.
pub(crate) struct OpenSky {
    low: [f64; 2],
    /// Cells in a scene unit.
    scale: f64,
    /// Places along a side of the grid.
    side: usize,
    /// By row.
    parts: Vec<f32>,
}

impl OpenSky {
    /// How far the grid reaches beyond the box around everything, in parts of its height.
    const BEYOND: f64 = 1.5;

    /// Of a floor at this height, below a box with all that casts shadows.
    pub(crate) fn new(
        maps: &Maps,
        [middle, half]: Reach,
        height: f64,
        fineness: Fineness,
        threads: usize,
    ) -> OpenSky {
        let reach = half.x.max(half.z) + OpenSky::BEYOND * (middle.y + half.y - height).max(0.0);
        let reach = if reach > 0.0 { reach } else { 1.0 };
        let low = [middle.x - reach, middle.z - reach];
        let side = fineness.floor;
        let scale = (side - 1) as f64 / (2.0 * reach);
        let count = maps.sky.len();
        let shades = each(threads, count, |i| Shade::new(&maps.sky[i], height, count));
        let row = |row: usize| {
            let first = Vector::new(low[0], height, low[1] + row as f64 / scale);
            let mut open = vec![0.0_f32; side];
            for shade in &shades {
                shade.add(first, 1.0 / scale, &mut open);
            }
            // The mean cosine over the places is a half.
            open.iter_mut().for_each(|part| *part = (*part * 2.0 / count.max(1) as f32).min(1.0));
            open
        };
        OpenSky { low, scale, side, parts: each(threads, side, row).concat() }
    }

    /// The part at a place; 1 beyond the grid, to which it rises at the rim.
    pub(crate) fn at(&self, place: Vector) -> f64 {
        let [x, z] = [(place.x - self.low[0]) * self.scale, (place.z - self.low[1]) * self.scale];
        let last = (self.side - 1) as f64;
        let rim = x.min(z).min(last - x).min(last - z) / (0.2 * last);
        if rim.is_nan() || rim <= 0.0 {
            return 1.0;
        }
        let [column, row] = [x, z].map(|x| (x as usize).min(self.side - 2));
        let (u, v) = (x - column as f64, z - row as f64);
        let value = |column: usize, row: usize| f64::from(self.parts[row * self.side + column]);
        let line = |row: usize| value(column, row) * (1.0 - u) + value(column + 1, row) * u;
        let part = line(row) * (1.0 - v) + line(row + 1) * v;
        1.0 - (1.0 - part) * rim.min(1.0)
    }
}

/// The shadow on the floor in the light of one map, in its cells and some around them.
struct Shade<'m> {
    map: &'m Map,
    /// Cells on each side that the map does not have.
    pad: usize,
    size: [usize; 2],
    /// The part of the light that does not come through.
    dark: Vec<f32>,
}

impl Shade<'_> {
    /// Of one of so many maps.
    fn new(map: &Map, height: f64, count: usize) -> Shade<'_> {
        let angle = (2.0 / count.max(1) as f64).sqrt();
        let radius = |layer: usize| (SPREAD * angle * 1.5 * (layer as f64).exp2()).clamp(LEAST, MOST);
        let layers = covered(map, height);
        let widest = layers.iter().rposition(|cells| !cells.is_empty()).map_or(LEAST, radius);
        let pad = reach(widest);
        let size = map.size.map(|side| side + 2 * pad);
        let mut dark = vec![0.0; size[0] * size[1]];
        for (layer, cells) in layers.iter().enumerate().filter(|(_, cells)| !cells.is_empty()) {
            let blur = Blur::of(cells, map.size[0], radius(layer));
            let [left, bottom] = blur.low.map(|low| (low + pad as i64) as usize);
            for (row, values) in blur.values.chunks_exact(blur.size[0]).enumerate() {
                let start = (bottom + row) * size[0] + left;
                dark[start..start + values.len()].iter_mut().zip(values).for_each(|(sum, x)| *sum += x);
            }
        }
        dark.iter_mut().for_each(|part| *part = part.min(1.0));
        Shade { map, pad, size, dark }
    }

    /// Adds the light of the map on places of the floor at this distance along x, times the cosine at which it comes.
    fn add(&self, first: Vector, step: f64, open: &mut [f32]) {
        let cos = self.map.axes[2].y as f32;
        let place = |at: Vector| self.map.place(at - self.map.middle);
        let [from, to] = [place(first), place(first + Vector::x() * step)];
        let shift = self.pad as f32 - 0.5;
        let [width, height] = self.size.map(|side| (side - 1) as f32);
        for (i, sum) in open.iter_mut().enumerate() {
            let [x, y] = [0, 1].map(|k| from[k] + (to[k] - from[k]) * i as f32 + shift);
            let is_within = x >= 0.0 && y >= 0.0 && x < width && y < height;
            let dark = if is_within { self.between(x, y) } else { 0.0 };
            *sum += cos * (1.0 - dark);
        }
    }

    fn between(&self, x: f32, y: f32) -> f32 {
        let (column, row) = (x as usize, y as usize);
        let (u, v) = (x - column as f32, y - row as f32);
        let start = row * self.size[0] + column;
        let line = |start: usize| self.dark[start] * (1.0 - u) + self.dark[start + 1] * u;
        line(start) * (1.0 - v) + line(start + self.size[0]) * v
    }
}

/// The cells of a map in which something is above a floor, by layer.
fn covered(map: &Map, height: f64) -> Vec<Vec<u32>> {
    let mut layers = vec![Vec::new(); LAYERS];
    let [right, up, towards] = map.axes;
    let cos = towards.y.max(1e-9);
    let slope = (1.0 - cos * cos).max(0.0).sqrt() / cos;
    let bias = f64::from(BIAS * (1.0 + slope as f32)).min(SLOPE.into());
    for (number, depth) in map.depths.iter().enumerate().filter(|(_, depth)| depth.is_finite()) {
        let at = |k: usize, cell: usize| (cell as f64 + 0.5) / map.scale + map.low[k];
        let (u, v) = (at(0, number % map.size[0]), at(1, number / map.size[0]));
        // The floor is as far towards the light as this.
        let floor = (height - map.middle.y - right.y * u - up.y * v) / cos * map.scale;
        let distance = f64::from(*depth) - floor;
        if distance > bias {
            layers[(distance.max(1.0).log2() as usize).min(LAYERS - 1)].push(number as u32);
        }
    }
    layers
}

/// How many cells a blur reaches on each side.
fn reach(radius: f64) -> usize {
    2 * (radius - LEAST).ceil() as usize
}

/// Covered cells, blurred by two means over a square.
struct Blur {
    /// The first column and row.
    low: [i64; 2],
    size: [usize; 2],
    values: Vec<f32>,
}

impl Blur {
    fn of(cells: &[u32], width: usize, radius: f64) -> Blur {
        let place = |cell: &u32| [*cell as usize % width, *cell as usize / width];
        let (mut least, mut most) = ([usize::MAX; 2], [0; 2]);
        for at in cells.iter().map(place) {
            least = [0, 1].map(|k| at[k].min(least[k]));
            most = [0, 1].map(|k| at[k].max(most[k]));
        }
        let reach = reach(radius);
        let [across, along] = [0, 1].map(|k| most[k] - least[k] + 1 + 2 * reach);
        let mut values = vec![0.0; across * along];
        for [column, row] in cells.iter().map(place) {
            values[(row - least[1] + reach) * across + column - least[0] + reach] = 1.0;
        }
        if radius > LEAST {
            mean_twice(&mut values, across, radius);
            values = transposed(&values, across);
            mean_twice(&mut values, along, radius);
            values = transposed(&values, along);
        }
        Blur { low: least.map(|low| low as i64 - reach as i64), size: [across, along], values }
    }
}

/// Replaces each value of rows by the mean over the cells around it, half of which have this width, twice.
fn mean_twice(values: &mut [f32], width: usize, radius: f64) {
    let mut sums = vec![0.0_f32; width + 1];
    let (from, scale) = ((0.5 - radius) as f32, (0.5 / radius) as f32);
    for row in values.chunks_exact_mut(width) {
        for _ in 0..2 {
            for (i, value) in row.iter().enumerate() {
                sums[i + 1] = sums[i] + value;
            }
            let sum_to = |x: f32| {
                let x = x.clamp(0.0, width as f32);
                let cell = (x as usize).min(width - 1);
                sums[cell] + (sums[cell + 1] - sums[cell]) * (x - cell as f32)
            };
            for (i, value) in row.iter_mut().enumerate() {
                let low = i as f32 + from;
                *value = (sum_to(low + 2.0 * radius as f32) - sum_to(low)) * scale;
            }
        }
    }
}

/// Rows as columns.
fn transposed(values: &[f32], width: usize) -> Vec<f32> {
    (0..width).flat_map(|column| values.iter().skip(column).step_by(width).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A blur moves light and makes none, has no edge, and one of the least width is none.
    #[test]
    fn a_blur_keeps_the_sum_and_has_no_edge() {
        let cells: Vec<u32> =
            (0..40).flat_map(|row| (0..9).map(move |column| row * 50 + 20 + column)).collect();
        for radius in [0.5, 0.8, 3.3, 16.0] {
            let blur = Blur::of(&cells, 50, radius);
            let sum: f64 = blur.values.iter().map(|x| f64::from(*x)).sum();
            assert!((sum - 360.0).abs() < 0.01, "{radius}: {sum}");
            let steps = blur.values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
            assert!(f64::from(steps) < 1e-6 + 0.5 / radius, "{radius}: {steps}");
        }
        assert_eq!(Blur::of(&cells, 50, LEAST).values, [1.0; 360]);
    }
}
