//! The region of each cell of a raster: the module, the material and the shade of the nearest triangle there.

use std::collections::{HashMap, HashSet};

use super::regions::{COVERED, NOTHING, Regions, Sample};
use crate::formats::png::Lit;
use crate::raster::SIXTEEN;
use crate::raster::cells::{self, Nearest};
use crate::triangles::Triangles;
use dlsys_geometry::scene::{MaterialId, OwnerId};

/// Shades between black and a colour as it is.
const SHADES: f64 = 20.0;

/// A region: cells of one module, one material and one shade.
pub struct Shade {
    pub owner: OwnerId,
    pub material: MaterialId,
    /// The shade, in steps of 1/[`SHADES`].
    step: i32,
    /// The sum of the strengths of light in its cells, and their number.
    sum: f64,
    count: usize,
}

impl Shade {
    fn key(&self) -> (OwnerId, MaterialId, i32) {
        (self.owner, self.material, self.step)
    }

    /// The mean strength of light in its cells.
    pub fn strength(&self) -> f64 {
        self.sum / self.count as f64
    }
}

/// A module and a material.
pub type Item = (OwnerId, MaterialId);

/// The number of the nearest triangle in the middle of each cell plus 1, or 0; and its depth.
pub fn nearest(mesh: &Triangles, lit: &Lit, [width, height]: [usize; 2]) -> Nearest<1> {
    let count = mesh.faces.len();
    cells::nearest(&cells::MIDDLE, [width, height], count, |n| lit.corners(n), width * height, |cell| cell)
}

/// The raster of regions, and their shades by number. Regions are painted in the order of modules, materials and shades; `strokes` are the
/// items that will be drawn over them.
pub fn label(
    mesh: &Triangles,
    lit: &Lit,
    numbers: &[[u32; 1]],
    [width, height]: [usize; 2],
    strokes: &HashSet<Item>,
) -> (Regions, Vec<Shade>) {
    let corners = |n: usize| lit.corners(n);
    // Regions are numbered as they are found, then in the order of painting.
    let mut weights = cells::Weights::default();
    let mut shades: Vec<Shade> = Vec::new();
    let mut known: HashMap<(OwnerId, MaterialId, i32), u32> = HashMap::new();
    let mut last = None;
    let mut labels = vec![NOTHING; numbers.len()];
    let strengths = strengths(lit, numbers, width);
    let mut at_strokes = (usize::MAX, false);
    for (cell, label) in labels.iter_mut().enumerate() {
        let Some(n) = (numbers[cell][0] as usize).checked_sub(1) else { continue };
        if at_strokes.0 != n {
            at_strokes = (n, strokes.contains(&(mesh.faces[n].owner, mesh.faces[n].material)));
        }
        if at_strokes.1 {
            *label = COVERED;
            continue;
        }
        let strength = f64::from(strengths[cell]);
        let (owner, material) = (mesh.faces[n].owner, mesh.faces[n].material);
        let step = step_of(strength);
        let key = (owner, material, step);
        let number = match last {
            Some((same, number)) if same == key => number,
            _ => *known.entry(key).or_insert_with(|| {
                shades.push(Shade { owner, material, step, sum: 0.0, count: 0 });
                shades.len() as u32 - 1
            }),
        };
        last = Some((key, number));
        let shade = &mut shades[number as usize];
        (shade.sum, shade.count) = (shade.sum + strength, shade.count + 1);
        *label = number;
    }
    let mut order: Vec<u32> = (0..shades.len() as u32).collect();
    order.sort_by_key(|number| shades[*number as usize].key());
    let mut ranks = vec![0; order.len()];
    order.iter().zip(0..).for_each(|(number, rank)| ranks[*number as usize] = rank);
    labels.iter_mut().filter(|label| **label < COVERED).for_each(|label| *label = ranks[*label as usize]);
    shades.sort_by_key(Shade::key);

    let (items, of_item) = items(&shades);
    let (places, chosen) = edges(&labels, &items, &shades, width);
    let place = |cell: usize| places[cell] as usize;
    let seen = cells::nearest(&SIXTEEN, [width, height], mesh.faces.len(), corners, chosen, place).numbers;
    let sample = |number: u32, cell: usize, weights: &mut cells::Weights| {
        let Some(n) = (number as usize).checked_sub(1) else { return Sample { item: NOTHING, step: 0 } };
        let item = (mesh.faces[n].owner, mesh.faces[n].material);
        match of_item.get(&item) {
            Some(&item) => {
                let weights = weights.at(n, || corners(n), [cell % width, cell / width]);
                Sample { item, step: step_of(lit.strength(n, weights)) }
            }
            None => Sample { item: if strokes.contains(&item) { COVERED } else { NOTHING }, step: 0 },
        }
    };
    let cells = (0..labels.len()).filter(|cell| place(*cell) < chosen);
    let mut samples = Vec::with_capacity(chosen);
    for (cell, numbers) in cells.zip(&seen) {
        let mut last = (numbers[0], sample(numbers[0], cell, &mut weights));
        samples.push(numbers.map(|number| {
            if last.0 != number {
                last = (number, sample(number, cell, &mut weights));
            }
            last.1
        }));
    }
    let least = shades.iter().map(|shade| (f64::from(shade.step) - 0.5) / SHADES).collect();
    let steps = shades.iter().map(|shade| shade.step).collect();
    (Regions { width, height, labels, places, samples, items, steps, strengths, least }, shades)
}

/// The strengths of light in the middles of cells. Between two cells of one triangle it is their mean.
fn strengths(lit: &Lit, numbers: &[[u32; 1]], width: usize) -> Vec<f32> {
    let mut weights = cells::Weights::default();
    let mut strengths = vec![0.0_f32; numbers.len()];
    let exact = |cell: usize, n: u32, weights: &mut cells::Weights| {
        let n = n as usize - 1;
        lit.strength(n, weights.at(n, || lit.corners(n), [cell % width, cell / width])) as f32
    };
    // Rows with even numbers first, then those between.
    for (first, apart) in [(0, 1), (width, width)] {
        for row in (first..numbers.len()).step_by((2 * width).max(1)) {
            for offset in [0, 1] {
                // Of an even row every second cell lies between two; of an odd row all do.
                for cell in (row + offset..row + width).step_by(2) {
                    let n = numbers[cell][0];
                    if n == 0 {
                        continue;
                    }
                    let is_between = apart > 1 || offset == 1;
                    let after = cell + apart;
                    let both = is_between
                        && (apart > 1 || after < row + width)
                        && after < numbers.len()
                        && numbers[cell - apart][0] == n
                        && numbers[after][0] == n;
                    strengths[cell] = match both {
                        true => (strengths[cell - apart] + strengths[after]) / 2.0,
                        false => exact(cell, n, &mut weights),
                    };
                }
            }
        }
    }
    strengths
}

/// The shade of a strength of light.
fn step_of(strength: f64) -> i32 {
    (strength * SHADES).round() as i32
}

/// The item (module and material) of each region, by number in the order of painting; and the number of each item.
fn items(shades: &[Shade]) -> (Vec<u32>, HashMap<Item, u32>) {
    let mut numbers: HashMap<Item, u32> = HashMap::new();
    let number = |shade: &Shade| {
        let next = numbers.len() as u32;
        *numbers.entry((shade.owner, shade.material)).or_insert(next)
    };
    let items = shades.iter().map(number).collect();
    (items, numbers)
}

/// For each cell beside one of another item, or of a shade that is not the next one, its number among these cells, else a number that is greater than any; and their
/// count.
fn edges(labels: &[u32], items: &[u32], shades: &[Shade], width: usize) -> (Vec<u32>, usize) {
    let item = |label: u32| items.get(label as usize).copied();
    let step = |label: u32| shades.get(label as usize).map_or(0, |shade| shade.step);
    let mut places = vec![u32::MAX; labels.len()];
    let mut mark = |a: usize, b: usize| {
        // Most neighbours are of one region.
        let [p, q] = [labels[a], labels[b]];
        if p != q && (item(p) != item(q) || step(p).abs_diff(step(q)) > 1) {
            (places[a], places[b]) = (0, 0);
        }
    };
    for cell in 0..labels.len() {
        if cell % width > 0 {
            mark(cell - 1, cell);
        }
        if cell >= width {
            mark(cell - width, cell);
        }
    }
    let mut count = 0;
    for place in places.iter_mut().filter(|place| **place == 0) {
        *place = count;
        count += 1;
    }
    (places, count as usize)
}
