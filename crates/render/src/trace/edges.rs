//! Cells at the edges of items and at creases, and what is seen at several samples of each.

use rustc_hash::FxHashMap;

use super::cell_set::CellSet;
use super::label::{Item, SHADES, Seen, Shade};
use super::regions::{COVERED, NOTHING, Sample};
use super::shading::Shading;
use super::spans::{Spans, changes};
use super::tones::Tones;
use crate::raster::Pattern;
use crate::raster::cells::{self, Given};
use crate::raster::samples::at_samples;

/// The item of a triangle without its tone, the number of that with some tone, and whether it has shades.
#[derive(Clone, Copy)]
pub struct FaceItem {
    pub item: Option<Item>,
    pub number: u32,
    pub has_shades: bool,
}

/// What tells whether there is an edge between two cells: the item of a region, its shades, and by how many steps the shades of one item differ at a crease.
#[derive(Clone, Copy, PartialEq)]
struct Kind {
    item: u32,
    steps: [i32; 2],
    crease: i32,
}

impl Kind {
    const NONE: Kind = Kind { item: NOTHING, steps: [0; 2], crease: i32::MAX };

    fn of(shade: &Shade, item: u32) -> Kind {
        // As far apart as two of the coarse shades.
        Kind { item, steps: [shade.step, shade.last], crease: i32::from(shade.item.shades / SHADES) }
    }

    /// Whether there is an edge between a region and one that is painted later, or a crease.
    fn is_apart(&self, later: &Kind) -> bool {
        self.item != later.item || later.steps[0] - self.steps[1] > self.crease
    }
}

/// The cells beside one of another item, or of a shade that is not the next one. All that is labelled is well within the spans.
pub fn found(labels: &[u32], items: &[u32], shades: &[Shade], (width, around): (usize, &Spans)) -> CellSet {
    let mut kinds: Vec<Kind> = shades.iter().zip(items).map(|(shade, item)| Kind::of(shade, *item)).collect();
    kinds.push(Kind::NONE);
    let kind = |label: u32| kinds[(label as usize).min(kinds.len() - 1)];
    let mut found = CellSet::new(labels.len());
    let mut mark = |a: usize, b: usize| {
        let [p, q] = [labels[a], labels[b]];
        if kind(p.min(q)).is_apart(&kind(p.max(q))) {
            [a, b].into_iter().for_each(|cell| found.insert(cell));
        }
    };
    // The cells around the raster are empty, so the first of a row may be compared with the last of the row before.
    for cells in around.cells() {
        for before in [1, width] {
            let cells = cells.start.max(before)..cells.end;
            changes(labels, cells, before).for_each(|cell| mark(cell - before, cell));
        }
    }
    found.number(around.cells());
    found
}

/// The cells at edges.
pub struct AtEdges<'a> {
    pub seen: Seen<'a>,
    /// By triangle: whether it is the nearest in the middle of any cell.
    pub in_front: &'a [bool],
    pub cells: &'a CellSet,
    pub tones: &'a Tones,
    pub of_item: &'a FxHashMap<Item, u32>,
}

impl AtEdges<'_> {
    /// What is seen at the samples of these cells, one cell after another.
    pub fn samples<const N: usize>(
        &self,
        pattern: &Pattern<N>,
        items: &[FaceItem],
        shading: &mut Shading,
    ) -> Vec<Sample> {
        let Seen { lit, size, .. } = self.seen;
        let (cells, in_front) = (self.cells.cells(), self.in_front);
        let triangles = Given { count: items.len(), corners: |n| lit.snapped(n), cut: |n| lit.cut(n, N) };
        // Each has a place.
        let place = |cell: usize| self.cells.place(cell).unwrap_or_default();
        let seen = at_samples(pattern, size, &triangles, (cells, place), |n| in_front[n]);
        let mut samples = Vec::with_capacity(cells.len() * N);
        let mut known: Vec<(u32, Sample)> = Vec::with_capacity(N);
        for (cell, numbers) in cells.iter().zip(&seen.numbers) {
            known.clear();
            samples.extend(numbers.map(|number| match known.iter().find(|known| known.0 == number) {
                Some(&(_, sample)) => sample,
                None => {
                    let sample = self.sample(number, *cell as usize, items, shading);
                    known.push((number, sample));
                    sample
                }
            }));
        }
        samples
    }

    /// What a triangle, by number plus 1, shows in a cell.
    fn sample(&self, number: u32, cell: usize, items: &[FaceItem], shading: &mut Shading) -> Sample {
        let Some(n) = (number as usize).checked_sub(1) else { return Sample { item: NOTHING, step: 0 } };
        let FaceItem { number: item, has_shades, .. } = items[n];
        if item >= COVERED || !has_shades {
            return Sample { item, step: 0 };
        }
        let (cell, width) = (cell as u32, self.seen.size[0] as u32);
        let cell = [cell % width, cell / width].map(|at| at as usize);
        let step = items[n].item.map_or(0, |item| item.step(shading.strength(n, cell)));
        Sample { item: self.toned(n, &items[n], cell), step }
    }

    /// The number of the item of a triangle in a cell: of those of its tones that there are the nearest.
    fn toned(&self, n: usize, own: &FaceItem, cell: [usize; 2]) -> u32 {
        let lit = self.seen.lit;
        let color = lit.pictured(n, || cells::weights(lit.corners(n), cell));
        let Some((item, color)) = own.item.zip(color) else { return own.number };
        let tone = self.tones.nearest(item.look.1, color);
        self.of_item.get(&Item { tone, ..item }).copied().unwrap_or(own.number)
    }
}
