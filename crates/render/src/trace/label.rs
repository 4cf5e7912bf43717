//! The region of each cell of a raster: the module, the material and the shade of the nearest triangle there.

use std::collections::HashSet;

use rustc_hash::FxHashMap;

use super::edges::{self, AtEdges, FaceItem};
use super::memory::{Rasters, empty};
use super::regions::{COVERED, NOTHING, Regions};
use super::scarce;
use super::shading::Shading;
use super::spans::Spans;
use super::tones::{MOST, Tones};
use crate::formats::png::Lit;
use crate::raster::SIXTEEN;
use crate::raster::cells::{self, Given, Middles};
use crate::raster::samples::EIGHT;
use crate::triangles::{Triangle, Triangles};
use dlsys_geometry::scene::{MaterialId, OwnerId};

/// Shades between black and a colour as it is; of what is so large in the picture that the steps between shades would show; and of the floor, on which light changes
/// so slowly that these would, too.
pub const SHADES: u8 = 20;
const FINE_SHADES: u8 = 60;
const FLOOR_SHADES: u8 = 180;
/// What covers so many pixels is large.
const LARGE: f64 = 3000.0;
/// No step is below this.
pub const DARKEST: i32 = -256;
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
    pub shades: u8,
}

impl Item {
    /// All of a look.
    pub fn of(look: Look) -> Item {
        Item { look, stem: None, tone: 0, shades: SHADES }
    }

    /// The shade of a strength of light.
    pub fn step(&self, strength: f64) -> i32 {
        // Not below 0, so that a cut rounds down.
        let above = strength * f64::from(self.shades) - f64::from(DARKEST) + 0.5;
        (above as i32).max(0) + DARKEST
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

/// What the middles of cells show: the triangles, their light, and where in the raster they are.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    pub mesh: &'a Triangles,
    pub lit: &'a Lit<'a>,
    pub size: [usize; 2],
    /// Where there are triangles, that with the cells around, and that with the cells around it.
    pub spans: &'a Spans,
    pub around: &'a Spans,
    pub beyond: &'a Spans,
}

/// The number of the nearest triangle in the middle of each cell plus 1, or 0, and its depth; and where there are triangles. Memory is for `most`
/// cells, if there are no more.
pub fn nearest(
    mesh: &Triangles,
    lit: &Lit,
    (size, most): ([usize; 2], usize),
    rasters: &mut Rasters,
) -> (Middles, Spans) {
    let room = [size[0] * size[1], most];
    let numbers = empty(&mut rasters.numbers, room, 0);
    let nothing = Middles { numbers, depths: empty(&mut rasters.depths, room, f32::NEG_INFINITY) };
    let triangles = Given { count: mesh.faces.len(), corners: |n| lit.snapped(n), cut: |n| lit.cut(n, 1) };
    let (nearest, rows) = cells::in_middles(size, &triangles, nothing);
    (nearest, Spans::new(size[0], rows))
}

/// The raster of regions, in place of one of triangles, and their shades by number. Regions are painted in the order of modules, materials and shades.
/// A pixel of the page is so many cells; of cells finer than pixels edges have fewer samples.
pub fn label(
    (numbers, seen): (Vec<u32>, Seen),
    (stems, tones): (&Stems, &Tones),
    (is_fine, per_pixel): (bool, f64),
    most: usize,
    rasters: &mut Rasters,
) -> (Regions, Vec<Shade>) {
    let Seen { mesh, around, size: [width, _], .. } = seen;
    let room = [numbers.len(), most];
    let mut item_of = items_of(mesh, stems);
    shade_finely((mesh, seen.lit.floor()), &mut item_of, &numbers, seen.spans, (per_pixel * LARGE) as usize);
    let mut shading = Shading::new(seen.lit);
    let mut cells = Cells {
        labels: numbers,
        in_front: vec![false; mesh.faces.len()],
        strengths: empty(&mut rasters.strengths, room, 0.0),
        shades: Vec::new(),
        items: FxHashMap::default(),
        last: None,
        tables: Vec::new(),
    };
    cells.fill(seen, &item_of, tones, &mut shading);
    let Cells { mut labels, in_front, strengths, mut shades, .. } = cells;
    clear_rim(&mut labels, width, seen.beyond);
    let mut order: Vec<u32> = (0..shades.len() as u32).collect();
    order.sort_by_key(|number| shades[*number as usize].key());
    shades.sort_by_key(Shade::key);
    let (shades, of_shade) = scarce::merged(shades, per_pixel);
    let mut ranks = vec![0; order.len()];
    order.iter().zip(of_shade).for_each(|(number, rank)| ranks[*number as usize] = rank);
    for cells in seen.spans.cells() {
        let labels = labels[cells].iter_mut().filter(|label| **label < COVERED);
        labels.for_each(|label| *label = ranks[*label as usize]);
    }

    let (items, of_item) = items(&shades);
    let edges = edges::found(&labels, &items, &shades, (width, around));
    let at_edges = AtEdges { seen, in_front: &in_front, cells: &edges, tones, of_item: &of_item };
    let face_items = face_items(&item_of, &of_item);
    let samples = match is_fine {
        true => at_edges.samples(&EIGHT, &face_items, &mut shading),
        false => at_edges.samples(&SIXTEEN, &face_items, &mut shading),
    };
    let per_cell = if is_fine { EIGHT.len() } else { SIXTEEN.len() };
    let is_floor = shades.iter().map(|shade| shade.item.shades == FLOOR_SHADES).collect();
    let least =
        shades.iter().map(|shade| (f64::from(shade.step) - 0.5) / f64::from(shade.item.shades)).collect();
    let steps = shades.iter().map(|shade| shade.step).collect();
    let means = shades.iter().map(Shade::strength).collect();
    let around = around.clone();
    let regions = Regions {
        width,
        around,
        labels,
        edges,
        samples,
        per_cell,
        items,
        steps,
        strengths,
        least,
        means,
        is_floor,
    };
    (regions, shades)
}

/// The item of each triangle, without its tone. Those of a surface follow one another.
fn items_of(mesh: &Triangles, stems: &Stems) -> Vec<Option<Item>> {
    let mut items = Vec::with_capacity(mesh.faces.len());
    let key = |face: &Triangle| (face.surface, face.owner, face.material);
    for run in mesh.faces.chunk_by(|a, b| key(a) == key(b)) {
        let item = stems.item(mesh, items.len());
        items.resize(items.len() + run.len(), item);
    }
    items
}

/// Cells as they are given their regions, which are numbered as they are found.
struct Cells {
    /// First the number of the nearest triangle plus 1, or 0; then the region.
    labels: Vec<u32>,
    /// By triangle: whether it is the nearest in any cell.
    in_front: Vec<bool>,
    strengths: Vec<f32>,
    shades: Vec<Shade>,
    /// By item: the number of its table, and of the last item; a table has the number of each shade from the darkest on, plus 1, or 0.
    items: FxHashMap<Item, usize>,
    last: Option<(Item, usize)>,
    tables: Vec<Vec<u32>>,
}

impl Cells {
    fn fill(&mut self, seen: Seen, items: &[Option<Item>], tones: &Tones, shading: &mut Shading) {
        let width = seen.size[0];
        for cells in seen.beyond.cells() {
            let row = cells.start / width;
            let mut cell = cells.start;
            while cell < cells.end {
                let (first, number) = (cell, self.labels[cell]);
                let rest = &self.labels[cell..cells.end];
                cell += rest.iter().position(|other| *other != number).unwrap_or(rest.len());
                let n = (number as usize).wrapping_sub(1);
                let Some(item) = items.get(n) else {
                    self.labels[first..cell].fill(NOTHING);
                    continue;
                };
                self.in_front[n] = true;
                match item {
                    None => self.labels[first..cell].fill(COVERED),
                    Some(item) => {
                        let from = [first - row * width, row];
                        self.fill_run(seen, (n, *item), (from, cell - first), tones, shading);
                    }
                }
            }
        }
    }

    /// Labels so many cells, from the first one on, that show one triangle.
    fn fill_run(
        &mut self,
        seen: Seen,
        (n, mut item): (usize, Item),
        ([first, row], count): ([usize; 2], usize),
        tones: &Tones,
        shading: &mut Shading,
    ) {
        let has_shades = item.stem.is_none();
        let even = if has_shades { shading.even(n) } else { None };
        let known = if seen.mesh.places.is_empty() { Some(self.table(item)) } else { None };
        for column in first..first + count {
            let at = [column, row];
            let weights = || cells::weights(seen.lit.corners(n), at);
            if known.is_none()
                && let Some(color) = seen.lit.pictured(n, weights)
            {
                item.tone = tones.nearest(item.look.1, color);
            }
            let strength = match even {
                Some(even) => even.at(at).into(),
                None if has_shades => shading.uneven(n, at),
                None => 0.0,
            };
            let table = match known {
                Some(table) => table,
                None => self.table(item),
            };
            let number = self.number(table, item, item.step(strength));
            let shade = &mut self.shades[number as usize];
            (shade.sum, shade.count) = (shade.sum + strength, shade.count + 1);
            let cell = row * seen.size[0] + column;
            (self.labels[cell], self.strengths[cell]) = (number, strength as f32);
        }
    }

    /// The number of the table of an item.
    fn table(&mut self, item: Item) -> usize {
        let table = match self.last.filter(|(last, _)| *last == item) {
            Some((_, table)) => table,
            None => *self.items.entry(item).or_insert_with(|| {
                self.tables.push(Vec::new());
                self.tables.len() - 1
            }),
        };
        self.last = Some((item, table));
        table
    }

    /// The number of a shade of an item, which has this table.
    fn number(&mut self, table: usize, item: Item, step: i32) -> u32 {
        let table = &mut self.tables[table];
        let at = (step - DARKEST) as usize;
        if at >= table.len() {
            table.resize(at + 1, 0);
        }
        if table[at] == 0 {
            self.shades.push(Shade::new(item, step, 0.0, 0));
            table[at] = self.shades.len() as u32;
        }
        table[at] - 1
    }
}

/// Gives more shades to the looks of large surfaces. Triangles of one look follow one another, and so do
/// those of one surface.
fn shade_finely(
    (mesh, floor): (&Triangles, Option<MaterialId>),
    items: &mut [Option<Item>],
    numbers: &[u32],
    seen: &Spans,
    large: usize,
) {
    let mut covered = vec![0; items.len() + 1];
    // Nothing is no surface.
    let surface = |number: u32| Some(mesh.faces[(number as usize).checked_sub(1)?].surface);
    let mut run: Vec<u32> = Vec::new();
    for row in seen.cells().step_by(APART) {
        run.clear();
        run.extend(numbers[row].iter().step_by(APART));
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
            let shades = |item: &Item| if Some(item.look.1) == floor { FLOOR_SHADES } else { FINE_SHADES };
            run.iter_mut().flatten().for_each(|item| item.shades = shades(item));
        }
    }
}

/// By triangle: its item, as edges see it.
fn face_items(item_of: &[Option<Item>], of_item: &FxHashMap<Item, u32>) -> Vec<FaceItem> {
    let mut items = Vec::with_capacity(item_of.len());
    // Faces of one item follow one another.
    for run in item_of.chunk_by(|a, b| a == b) {
        let item = match run[0] {
            None => FaceItem { item: None, number: COVERED, has_shades: false },
            Some(known) => {
                // Of a picture any tone that there is.
                let mut toned = (0..MOST as u8).map(|tone| of_item.get(&Item { tone, ..known }));
                let number = toned.find_map(|number| number.copied()).unwrap_or(NOTHING);
                FaceItem { item: run[0], number, has_shades: known.stem.is_none() }
            }
        };
        items.resize(items.len() + run.len(), item);
    }
    items
}

/// Leaves the cells around a raster empty: none of them is in the picture.
fn clear_rim(labels: &mut [u32], width: usize, spans: &Spans) {
    let last = labels.len().saturating_sub(width);
    for cells in spans.cells() {
        if cells.start < width || cells.start >= last {
            labels[cells].fill(NOTHING);
            continue;
        }
        for at_rim in
            [cells.start, cells.end - 1].into_iter().filter(|cell| matches!((cell + 1) % width, 0 | 1))
        {
            labels[at_rim] = NOTHING;
        }
    }
}

/// The item (module and material) of each region, by number in the order of painting; and the number of each item.
fn items(shades: &[Shade]) -> (Vec<u32>, FxHashMap<Item, u32>) {
    let mut numbers: FxHashMap<Item, u32> = FxHashMap::default();
    let number = |shade: &Shade| {
        let next = numbers.len() as u32;
        *numbers.entry(shade.item).or_insert(next)
    };
    let items = shades.iter().map(number).collect();
    (items, numbers)
}
