//! The region of each cell of a raster: the module, the material and the shade of the nearest triangle there.

use std::collections::{HashMap, HashSet};

use super::memory::{Rasters, filled};
use super::regions::{COVERED, NOTHING, Regions, Sample};
use super::scarce;
use super::tones::{MOST, Tones};
use crate::formats::png::Lit;
use crate::raster::cells::{self, Given, Nearest};
use crate::raster::{Pattern, SIXTEEN};
use crate::triangles::Triangles;
use dlsys_geometry::scene::{MaterialId, OwnerId};

/// Shades between black and a colour as it is; and of what is so large in the picture that the steps between shades would show.
const SHADES: u8 = 20;
const FINE_SHADES: u8 = 60;
/// What covers so many pixels is large.
const LARGE: f64 = 10_000.0;
/// Of so many rows and columns one each is looked at to tell what is large, and what is less wide than so many of those is not: in gaps between
/// other things no steps show.
const APART: usize = 4;
const WIDE: usize = 8;

/// A region: cells of one item and one shade, or a few shades next to one another.
#[derive(Clone)]
pub struct Shade {
    pub item: Item,
    /// The shades, in steps of one over the item's shades: the darkest and the lightest; 0 for all of a stem that is painted with a gradient.
    pub step: i32,
    pub last: i32,
    /// The sum of the strengths of light in its cells, and their number.
    sum: f64,
    pub count: usize,
}

impl Shade {
    /// So many cells of a strength of light, of one step.
    pub fn new(item: Item, step: i32, strength: f64, count: usize) -> Shade {
        Shade { item, step, last: step, sum: strength * count as f64, count }
    }

    fn key(&self) -> (Item, i32) {
        (self.item, self.step)
    }

    /// Takes in lighter shades of its item.
    pub fn add(&mut self, lighter: &Shade) {
        self.last = lighter.last;
        (self.sum, self.count) = (self.sum + lighter.sum, self.count + lighter.count);
    }

    /// The mean strength of light in its cells.
    pub fn strength(&self) -> f64 {
        self.sum / self.count as f64
    }
}

/// A module and a material.
pub type Look = (OwnerId, MaterialId);

/// What is painted at once: all of one look, or of that a segment which is painted with a gradient, or one tone of its picture.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Item {
    pub look: Look,
    pub stem: Option<u32>,
    pub tone: u8,
    /// Shades between black and the colour as it is.
    shades: u8,
}

impl Item {
    /// All of a look.
    pub fn of(look: Look) -> Item {
        Item { look, stem: None, tone: 0, shades: SHADES }
    }

    /// The shade of a strength of light.
    fn step(&self, strength: f64) -> i32 {
        (strength * f64::from(self.shades)).round() as i32
    }
}

/// The stems that are not painted by their shades: the looks that will be drawn as strokes over everything else, and the segments that
/// are painted with gradients.
#[derive(Default)]
pub struct Stems {
    pub strokes: HashSet<Look>,
    pub gradients: HashSet<u32>,
}

impl Stems {
    /// The item of a triangle; `None` if that is a part of a stroke.
    fn item(&self, mesh: &Triangles, n: usize) -> Option<Item> {
        let face = &mesh.faces[n];
        let look = (face.owner, face.material);
        let segment = mesh.segments.get(face.surface as usize).copied().flatten();
        let stem = segment.filter(|segment| self.gradients.contains(segment));
        let is_shown = segment.is_none() || !self.strokes.contains(&look);
        is_shown.then_some(Item { stem, ..Item::of(look) })
    }
}

/// The number of the nearest triangle in the middle of each cell plus 1, or 0; and its depth.
pub fn nearest(mesh: &Triangles, lit: &Lit, size: [usize; 2], rasters: &mut Rasters) -> Nearest<1> {
    let cells = size[0] * size[1];
    let numbers = filled(&mut rasters.numbers, cells, [0]);
    let empty = Nearest { numbers, depths: filled(&mut rasters.depths, cells, [f32::NEG_INFINITY]) };
    cells::in_middles(
        size,
        &Given { count: mesh.faces.len(), corners: |n| lit.snapped(n), cut: |n| lit.cut(n, 1) },
        empty,
    )
}

/// The raster of regions, and their shades by number. Regions are painted in the order of modules, materials and shades.
/// A pixel of the page is so many cells; of cells finer than pixels edges have fewer samples.
pub fn label(
    mesh: &Triangles,
    lit: &Lit,
    numbers: &[[u32; 1]],
    [width, height]: [usize; 2],
    (stems, tones): (&Stems, &Tones),
    (is_fine, per_pixel): (bool, f64),
    rasters: &mut Rasters,
) -> (Regions, Vec<Shade>) {
    // Regions are numbered as they are found, then in the order of painting.
    let mut shades: Vec<Shade> = Vec::new();
    let mut known: HashMap<(Item, i32), u32> = HashMap::new();
    let mut last = None;
    let mut labels = filled(&mut rasters.labels, numbers.len(), NOTHING);
    let mut item_of: Vec<Option<Item>> = (0..mesh.faces.len()).map(|n| stems.item(mesh, n)).collect();
    shade_finely(mesh, &mut item_of, numbers, width, (per_pixel * LARGE) as usize);
    let has_shades = |n: usize| item_of[n].is_some_and(|item| item.stem.is_none());
    let strengths = filled(&mut rasters.strengths, numbers.len(), 0.0);
    let strengths = lit_cells(lit, numbers, width, has_shades, strengths);
    for (cell, label) in labels.iter_mut().enumerate() {
        let Some(n) = (numbers[cell][0] as usize).checked_sub(1) else { continue };
        let Some(mut item) = item_of[n] else {
            *label = COVERED;
            continue;
        };
        let weights = || cells::weights(lit.corners(n), [cell % width, cell / width]);
        if let Some(color) = lit.pictured(n, weights) {
            item.tone = tones.nearest(item.look.1, color);
        }
        let strength = f64::from(strengths[cell]);
        let step = item.step(strength);
        let key = (item, step);
        let number = match last {
            Some((same, number)) if same == key => number,
            _ => *known.entry(key).or_insert_with(|| {
                shades.push(Shade::new(item, step, 0.0, 0));
                shades.len() as u32 - 1
            }),
        };
        last = Some((key, number));
        let shade = &mut shades[number as usize];
        (shade.sum, shade.count) = (shade.sum + strength, shade.count + 1);
        *label = number;
    }
    clear_rim(&mut labels, width);
    let mut order: Vec<u32> = (0..shades.len() as u32).collect();
    order.sort_by_key(|number| shades[*number as usize].key());
    shades.sort_by_key(Shade::key);
    let (shades, of_shade) = scarce::merged(shades, per_pixel);
    let mut ranks = vec![0; order.len()];
    order.iter().zip(of_shade).for_each(|(number, rank)| ranks[*number as usize] = rank);
    labels.iter_mut().filter(|label| **label < COVERED).for_each(|label| *label = ranks[*label as usize]);

    let (items, of_item) = items(&shades);
    let empty = filled(&mut rasters.places, labels.len(), 0);
    let (places, chosen) = edges(&labels, &items, &shades, width, empty);
    let at_edges =
        Edges { lit, numbers, width, height, places: &places, count: chosen, tones, of_item: &of_item };
    // Faces of one item follow one another.
    let mut last = (None, NOTHING);
    let face_items: Vec<FaceItem> = (item_of.iter())
        .map(|item| {
            let Some(known) = item else {
                return FaceItem { item: None, number: COVERED, has_shades: false };
            };
            if last.0 != *item {
                // Of a picture any tone that there is.
                let mut toned = (0..MOST as u8).map(|tone| of_item.get(&Item { tone, ..*known }));
                last = (*item, toned.find_map(|number| number.copied()).unwrap_or(NOTHING));
            }
            FaceItem { item: *item, number: last.1, has_shades: known.stem.is_none() }
        })
        .collect();
    let samples = match is_fine {
        true => at_edges.samples(&cells::EIGHT, &face_items),
        false => at_edges.samples(&SIXTEEN, &face_items),
    };
    let per_cell = if is_fine { cells::EIGHT.len() } else { SIXTEEN.len() };
    let least =
        shades.iter().map(|shade| (f64::from(shade.step) - 0.5) / f64::from(shade.item.shades)).collect();
    let steps = shades.iter().map(|shade| shade.step).collect();
    let means = shades.iter().map(Shade::strength).collect();
    (Regions { width, labels, places, samples, per_cell, items, steps, strengths, least, means }, shades)
}

/// Gives more shades to the looks of surfaces that cover more than so many cells each. Triangles of one look follow one another, and so do
/// those of one surface.
fn shade_finely(
    mesh: &Triangles,
    items: &mut [Option<Item>],
    numbers: &[[u32; 1]],
    width: usize,
    large: usize,
) {
    let mut covered = vec![0; items.len() + 1];
    // Nothing is no surface.
    let surface = |number: u32| Some(mesh.faces[(number as usize).checked_sub(1)?].surface);
    let mut run: Vec<u32> = Vec::new();
    for row in numbers.chunks(width).step_by(APART) {
        run.clear();
        run.extend(row.iter().step_by(APART).map(|[number]| *number));
        let wide = run.chunk_by(|a, b| surface(*a) == surface(*b)).filter(|run| run.len() >= WIDE);
        wide.flatten().for_each(|number| covered[*number as usize] += APART * APART);
    }
    let mut first = 0;
    for run in items.chunk_by_mut(|a, b| a.map(|item| item.look) == b.map(|item| item.look)) {
        let mut largest = 0;
        for surface in mesh.faces[first..first + run.len()].chunk_by(|a, b| a.surface == b.surface) {
            // Those of no triangle come before all others.
            let cells: usize = covered[first + 1..].iter().take(surface.len()).sum();
            first += surface.len();
            largest = cells.max(largest);
        }
        if largest > large {
            run.iter_mut().flatten().for_each(|item| item.shades = FINE_SHADES);
        }
    }
}

/// The item of a triangle without its tone, the number of that with some tone, and whether it has shades.
struct FaceItem {
    item: Option<Item>,
    number: u32,
    has_shades: bool,
}

/// Cells at the edges of items and at creases: those that have a place, from 1 to `count`.
struct Edges<'a> {
    lit: &'a Lit<'a>,
    /// The nearest triangle in the middle of each cell, by number plus 1.
    numbers: &'a [[u32; 1]],
    width: usize,
    height: usize,
    places: &'a [u32],
    count: usize,
    tones: &'a Tones,
    of_item: &'a HashMap<Item, u32>,
}

impl Edges<'_> {
    /// What is seen at the samples of these cells, one cell after another.
    fn samples<const N: usize>(&self, pattern: &Pattern<N>, items: &[FaceItem]) -> Vec<Sample> {
        // Cells without a place come after all others.
        let place = |cell: usize| (self.places[cell] as usize).wrapping_sub(1);
        let corners = |n: usize| self.lit.corners(n);
        let mut in_front = vec![false; items.len() + 1];
        self.numbers.iter().for_each(|[number]| in_front[*number as usize] = true);
        let triangles =
            Given { count: items.len(), corners: |n| self.lit.snapped(n), cut: |n| self.lit.cut(n, N) };
        let size = [self.width, self.height];
        let seen =
            cells::at_samples(pattern, size, &triangles, (self.count, place), |n| in_front[n + 1]).numbers;
        let sample = |number: u32, cell: usize| {
            let Some(n) = (number as usize).checked_sub(1) else { return Sample { item: NOTHING, step: 0 } };
            let FaceItem { number: item, has_shades, .. } = items[n];
            if item >= COVERED || !has_shades {
                return Sample { item, step: 0 };
            }
            let weights = cells::weights(corners(n), [cell % self.width, cell / self.width]);
            let strength = self.lit.strength(n, weights);
            let step = items[n].item.map_or(0, |item| item.step(strength));
            Sample { item: self.toned(n, &items[n], weights), step }
        };
        let mut samples = Vec::with_capacity(self.count * N);
        let mut known: Vec<(u32, Sample)> = Vec::with_capacity(N);
        let cells = (0..self.places.len()).filter(|cell| place(*cell) < self.count);
        for (cell, numbers) in cells.zip(&seen) {
            known.clear();
            samples.extend(numbers.map(|number| match known.iter().find(|known| known.0 == number) {
                Some(&(_, sample)) => sample,
                None => {
                    known.push((number, sample(number, cell)));
                    known[known.len() - 1].1
                }
            }));
        }
        samples
    }
}

impl Edges<'_> {
    /// The number of the item of a triangle at a place between its corners: of those of its tones that there are the nearest.
    fn toned(&self, n: usize, own: &FaceItem, weights: [f64; 3]) -> u32 {
        let Some((item, color)) = own.item.zip(self.lit.pictured(n, || weights)) else { return own.number };
        let tone = self.tones.nearest(item.look.1, color);
        self.of_item.get(&Item { tone, ..item }).copied().unwrap_or(own.number)
    }
}

/// Leaves the cells around a raster empty: none of them is in the picture.
fn clear_rim(labels: &mut [u32], width: usize) {
    let last = labels.len().saturating_sub(width);
    labels[last..].fill(NOTHING);
    for row in labels.chunks_mut(width) {
        (row[0], row[width - 1]) = (NOTHING, NOTHING);
    }
    labels[..width].fill(NOTHING);
}

/// The strengths of light in the middles of cells whose triangles have shades; they are 0 before. Between two cells of one triangle it is their mean.
fn lit_cells(
    lit: &Lit,
    numbers: &[[u32; 1]],
    width: usize,
    has_shades: impl Fn(usize) -> bool,
    mut strengths: Vec<f32>,
) -> Vec<f32> {
    let height = numbers.len() / width.max(1);
    // Rows with even numbers first, then those between.
    for first in [0, 1] {
        for y in (first..height).step_by(2) {
            let apart = if first == 0 { 1 } else { width };
            for offset in [0, 1] {
                // Of an even row every second cell lies between two; of an odd row all do.
                for x in (offset..width).step_by(2) {
                    let cell = y * width + x;
                    let n = numbers[cell][0];
                    if n == 0 || !has_shades(n as usize - 1) {
                        continue;
                    }
                    let is_between = match first {
                        0 => offset == 1 && x + 1 < width,
                        _ => y + 1 < height,
                    };
                    let both = is_between && numbers[cell - apart][0] == n && numbers[cell + apart][0] == n;
                    strengths[cell] = match both {
                        true => (strengths[cell - apart] + strengths[cell + apart]) / 2.0,
                        false => {
                            let n = n as usize - 1;
                            lit.strength(n, cells::weights(lit.corners(n), [x, y])) as f32
                        }
                    };
                }
            }
        }
    }
    strengths
}

/// The item (module and material) of each region, by number in the order of painting; and the number of each item.
fn items(shades: &[Shade]) -> (Vec<u32>, HashMap<Item, u32>) {
    let mut numbers: HashMap<Item, u32> = HashMap::new();
    let number = |shade: &Shade| {
        let next = numbers.len() as u32;
        *numbers.entry(shade.item).or_insert(next)
    };
    let items = shades.iter().map(number).collect();
    (items, numbers)
}

/// For each cell beside one of another item, or of a shade that is not the next one, its number among these cells from 1 on, else 0; and their
/// count.
fn edges(
    labels: &[u32],
    items: &[u32],
    shades: &[Shade],
    width: usize,
    mut places: Vec<u32>,
) -> (Vec<u32>, usize) {
    let item = |label: u32| items.get(label as usize).copied();
    // As far apart as two of the coarse shades.
    let is_crease = |p: u32, q: u32| {
        let both = [p.min(q), p.max(q)].map(|label| shades.get(label as usize));
        let [Some(dark), Some(light)] = both else { return false };
        light.step - dark.last > i32::from(dark.item.shades / SHADES)
    };
    let mut mark = |a: usize, b: usize| {
        // Most neighbours are of one region.
        let [p, q] = [labels[a], labels[b]];
        if p != q && (item(p) != item(q) || is_crease(p, q)) {
            (places[a], places[b]) = (1, 1);
        }
    };
    // The cells around the raster are empty, so the first of a row may be compared with the last of the row before.
    for cell in 1..labels.len() {
        mark(cell - 1, cell);
    }
    for cell in width..labels.len() {
        mark(cell - width, cell);
    }
    let mut count = 0;
    for place in places.iter_mut().filter(|place| **place != 0) {
        count += 1;
        *place = count;
    }
    (places, count as usize)
}
