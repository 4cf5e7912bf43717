//! Regions of one module and one shade, as sets of cells of a raster.
//!
//! Regions are painted one over the other, in order. Each covers its own cells, and reaches under those that are painted later:
//! by a margin, so that no background shows through where two outlines meet, but not along an edge of those, where two half-transparent
//! edges would lie over one another; and through holes, so that an outline within another is needed once only. A region is worked on piece by piece (cells that hang together), and the work on a piece is that of its cells.

use super::cell_set::CellSet;
use super::contour::{Corner, Hidden, Mask, Part};
use super::label::DARKEST;
use super::memory::MarkMemory;
use super::pieces::Pieces;
use super::spans::Spans;
use std::ops::Range;

/// Cells of a row that are looked at together.
const BLOCK: usize = 8;
/// The width of the margin, in cells.
const MARGIN: usize = 3;
/// What has so many of the eight cells around a cell, or fewer, is narrow there.
const FEW: usize = 2;
/// By how much light is stronger than the least of a region, so that it is within it: less than half of the finest step.
const WITHIN: f64 = 0.002;

/// No region.
pub const NOTHING: u32 = u32::MAX;
/// Cells that will be drawn over by something else, so that regions may reach there.
pub const COVERED: u32 = u32::MAX - 1;

/// One place in a cell.
#[derive(Clone, Copy)]
pub struct Sample {
    /// In the order of painting, or [`NOTHING`], or [`COVERED`].
    pub item: u32,
    /// Its shade.
    pub step: i32,
}

/// A raster of regions, by number in the order of painting. Nothing is in the cells at its rim.
pub struct Regions {
    pub width: usize,
    /// All cells with a region or samples.
    pub around: Spans,
    /// By cell; [`NOTHING`] for the background, [`COVERED`] where something else is drawn.
    pub labels: Vec<u32>,
    /// The cells at the edge of an item or at a crease, each with `per_cell` samples.
    pub edges: CellSet,
    pub samples: Vec<Sample>,
    pub per_cell: usize,
    /// By region: its item (module and material), in the order of painting, and its shade.
    pub items: Vec<u32>,
    pub steps: Vec<i32>,
    /// By cell: the strength of light in its middle.
    pub strengths: Vec<f32>,
    /// By region: the least strength of light in its cells.
    pub least: Vec<f64>,
    /// By region: the mean of them.
    pub means: Vec<f64>,
    /// By region: whether it is floor, whose many outlines are exact where they meet what stands on it.
    pub is_floor: Vec<bool>,
}

/// Marks on the cells of a raster, so that they need not be taken away: the last piece that a cell was found to be in, or is covered by, or the last hole
/// that it was seen in. Each has an even number; it is odd if an outline of the piece passed above the cell.
struct Marks<'a> {
    on: &'a mut [u32],
    last: u32,
}

impl Marks<'_> {
    /// The number of something new.
    fn next(&mut self) -> u32 {
        self.last += 2;
        self.last
    }

    fn is_on(&self, cell: usize, number: u32) -> bool {
        self.on[cell] | 1 == number | 1
    }
}

/// Where the samples of cells at edges come in the order of painting.
struct Ranks<'a> {
    per_cell: usize,
    all: Vec<i32>,
    edges: &'a CellSet,
    /// By cell of these: the first item that is seen in it, plus 1; or 0 if something is open.
    first: Vec<u32>,
}

/// Bits for the shades of an item. What is left is enough for eight million items.
const SHADE_BITS: u32 = 9;
/// Comes before all shades of all items.
const FIRST: i32 = i32::MIN;

/// Where a shade of an item comes in the order of painting: so short that four are compared at a time.
fn rank(item: u32, step: i32) -> i32 {
    let shade = step.saturating_sub(DARKEST).clamp(0, (1 << SHADE_BITS) - 1) as u32;
    let number = item.saturating_add(1).min(u32::MAX >> SHADE_BITS);
    ((number << SHADE_BITS | shade) ^ 1 << 31) as i32
}

/// The item of a rank plus 1, or 0.
fn item_of(rank: i32) -> u32 {
    (rank as u32 ^ 1 << 31) >> SHADE_BITS
}

impl<'a> Ranks<'a> {
    fn of(regions: &'a Regions) -> Ranks<'a> {
        let of =
            |sample: &Sample| if sample.item == NOTHING { FIRST } else { rank(sample.item, sample.step) };
        let all: Vec<i32> = regions.samples.iter().map(of).collect();
        let least = |ranks: &[i32]| item_of(ranks.iter().fold(i32::MAX, |a, b| a.min(*b)));
        let first = all.chunks_exact(regions.per_cell).map(least).collect();
        Ranks { per_cell: regions.per_cell, all, edges: &regions.edges, first }
    }

    /// The part of the samples of a cell that comes no earlier.
    fn part(&self, place: usize, least: i32) -> f64 {
        let first = place * self.per_cell;
        let samples = &self.all[first..first + self.per_cell];
        samples.iter().map(|rank| u32::from(*rank >= least)).sum::<u32>() as f64 / self.per_cell as f64
    }
}

impl Regions {
    /// Gives cells to the narrow things in them, which the middles of most cells miss: to what has a quarter of a cell's samples, but few
    /// cells around it. So what is narrow hangs together; how wide it is, the samples say. A gap is such a thing, too.
    pub fn with_narrow_parts(&mut self) {
        let mut changes = Vec::new();
        for (cell, samples) in self.edges.cells().iter().zip(self.samples.chunks_exact(self.per_cell)) {
            let cell = *cell as usize;
            if !self.is_at_rim(cell)
                && let Some(label) = self.narrow_part(cell, samples)
            {
                changes.push((cell, label));
            }
        }
        for (cell, label) in changes {
            self.labels[cell] = label;
            if let Some(least) = self.least.get(label as usize) {
                self.strengths[cell] = (least + WITHIN) as f32;
            }
        }
    }

    /// Whether a cell is one of the first or last of the raster, or of its row.
    fn is_at_rim(&self, cell: usize) -> bool {
        let (row, column) = (cell / self.width, cell % self.width);
        row == 0 || column == 0 || column + 1 == self.width || (row + 1) * self.width == self.labels.len()
    }

    /// The region of the narrow thing in a cell, if there is one.
    fn narrow_part(&self, cell: usize, samples: &[Sample]) -> Option<u32> {
        let item = |label: u32| self.items.get(label as usize).copied().unwrap_or(label);
        let own = item(self.labels[cell]);
        if samples.iter().all(|sample| sample.item == own) {
            return None;
        }
        let around = self.around(cell).into_iter().chain(self.corners(cell));
        let mut others = [0; 8];
        others.iter_mut().zip(around).for_each(|(other, cell)| *other = item(self.labels[cell]));
        let near = |item: u32| others.iter().filter(|other| **other == item).count();
        if own == COVERED || near(own) < FEW {
            return None;
        }
        let mut found: Option<(usize, u32, i32)> = None;
        for (i, Sample { item, step }) in samples.iter().enumerate() {
            if *item == own || *item == COVERED || samples[..i].iter().any(|other| other.item == *item) {
                continue;
            }
            let (count, near) = (samples.iter().filter(|other| other.item == *item).count(), near(*item));
            if 4 * count >= samples.len() && near <= FEW && found.is_none_or(|(least, ..)| near < least) {
                found = Some((near, *item, *step));
            }
        }
        let (_, item, step) = found?;
        Some(if item == NOTHING { NOTHING } else { self.region(item, step)? })
    }

    /// The region of an item whose shade is next to one.
    fn region(&self, item: u32, step: i32) -> Option<u32> {
        let first = self.items.partition_point(|other| *other < item);
        let end = self.items.partition_point(|other| *other <= item);
        let last = end.checked_sub(1).filter(|last| *last >= first)?;
        // Those that have more than one shade are known by the darkest.
        let next = first + self.steps[first..end].partition_point(|other| *other <= step);
        Some(next.saturating_sub(1).clamp(first, last) as u32)
    }

    /// The outlines of `count` regions, by number, in cells from the upper left corner. Memory is for `most` cells, if there are no more.
    pub fn outlines(&self, count: usize, memory: &mut MarkMemory, most: usize) -> Vec<Vec<Vec<Corner>>> {
        let cells = self.labels.len();
        let last = memory.begin(cells, most).next_multiple_of(2);
        let samples = Ranks::of(self);
        let mut marks = Marks { on: &mut memory.on[..cells], last };
        let mut outlines = vec![Vec::new(); count];
        let pieces = Pieces::of(&self.labels, self.width, &self.around);
        let mut rim = Vec::new();
        for first in pieces.firsts() {
            let number = marks.next();
            let label = self.gather(pieces.cells(first), number, marks.on, &mut rim);
            self.spread((label, number), &samples, marks.on, &mut rim);
            outlines[label as usize].append(&mut self.outlines_of(
                (label, number),
                &samples,
                &rim,
                &mut marks,
            ));
        }
        let last = marks.last + 1;
        memory.end(last);
        outlines
    }

    /// Marks the cells of a piece with a number, and finds those of them at its rim. Returns its region.
    fn gather(
        &self,
        runs: impl Iterator<Item = Range<usize>>,
        number: u32,
        inside: &mut [u32],
        rim: &mut Vec<usize>,
    ) -> u32 {
        rim.clear();
        let mut label = NOTHING;
        for run in runs {
            label = self.labels[run.start];
            inside[run.clone()].fill(number);
            let last = run.end - 1;
            rim.push(run.start);
            let [above, below] = [run.start - self.width, run.start + self.width]
                .map(|start| &self.labels[start..start + run.len()]);
            let blocks = above.chunks(BLOCK).zip(below.chunks(BLOCK));
            for (first, (above, below)) in run.clone().step_by(BLOCK).zip(blocks) {
                // Most are in the midst of their region.
                if above.iter().zip(below).fold(0, |all, (a, b)| all | (a ^ label) | (b ^ label)) == 0 {
                    continue;
                }
                let open = above.iter().zip(below).map(|(a, b)| (a ^ label) | (b ^ label) != 0);
                let open = (first..).zip(open).filter(|(_, open)| *open).map(|(cell, _)| cell);
                rim.extend(open.filter(|cell| *cell != run.start && *cell != last));
            }
            if last > run.start {
                rim.push(last);
            }
        }
        label
    }

    /// Adds the cells near the rim of a piece that are painted later. Other pieces of the region have the same colour, so it does not matter
    /// which of the two covers a cell. Near places where what is painted later ends at something that was painted before, it adds only the
    /// cells that touch the piece: two half-transparent edges, one over the other, cover more than one.
    fn spread(&self, (label, number): (u32, u32), samples: &Ranks, inside: &mut [u32], rim: &mut Vec<usize>) {
        let mut from = 0;
        for ring in 0..MARGIN {
            let end = rim.len();
            for at in from..end {
                let cell = rim[at];
                let beside = self.around(cell).into_iter();
                let others = beside.chain(self.corners(cell).into_iter().filter(|_| ring == 0));
                for other in others {
                    let is_free = inside[other] != number
                        && self.is_free(other, label)
                        && (ring == 0 || self.is_amid(other, label, samples));
                    if is_free {
                        inside[other] = number;
                        rim.push(other);
                    }
                }
            }
            from = end;
        }
    }

    /// Whether a cell is painted after a region, or with it.
    fn is_free(&self, cell: usize, label: u32) -> bool {
        let other = self.labels[cell];
        other != NOTHING && other >= label
    }

    /// Whether nothing painted before a region shows in a cell, nor in those around it.
    fn is_amid(&self, cell: usize, label: u32, samples: &Ranks) -> bool {
        let item = self.items[label as usize];
        let shows = |cell: usize| samples.edges.place(cell).is_some_and(|place| samples.first[place] <= item);
        !(shows(cell) || self.around(cell).into_iter().any(shows))
    }

    /// Adds the cells of a hole, one of which is given, to a piece if all of them are painted later. False if not.
    fn fill(&self, hole: usize, number: u32, label: u32, marks: &mut Marks) -> bool {
        let seen = marks.next();
        let mut cells = vec![hole];
        marks.on[hole] = seen;
        let mut next = 0;
        while let Some(&cell) = cells.get(next) {
            next += 1;
            if !self.is_free(cell, label) {
                return false;
            }
            for other in self.around(cell) {
                if !marks.is_on(other, number) && marks.on[other] != seen {
                    marks.on[other] = seen;
                    cells.push(other);
                }
            }
        }
        cells.into_iter().for_each(|cell| marks.on[cell] = number);
        true
    }

    /// The outlines of a piece, all of which begin at one of these cells.
    fn outlines_of(
        &self,
        (label, number): (u32, u32),
        samples: &Ranks,
        rim: &[usize],
        marks: &mut Marks,
    ) -> Vec<Vec<Corner>> {
        let (item, step) = (self.items[label as usize], self.steps[label as usize]);
        let mut outlines = Vec::new();
        let mut passed = Vec::new();
        for &cell in rim {
            if marks.on[cell] == number + 1 {
                continue;
            }
            let is_inside = |cell: usize| marks.on.get(cell).is_some_and(|mark| mark | 1 == number + 1);
            // The part of a cell that this region covers, or one that is painted later.
            let covered = |cell: usize, part: Part| match self.edges.place(cell) {
                None => f64::from(u8::from(is_inside(cell))),
                Some(place) => {
                    samples.part(place, rank(item, if part == Part::Shade { step } else { i32::MIN }))
                }
            };
            let shade = |cell: usize| {
                let is_own = self.items.get(self.labels[cell] as usize) == Some(&item);
                is_own.then(|| f64::from(self.strengths[cell]) - self.least[label as usize])
            };
            let hidden = |cell: usize| {
                let is_under = !is_inside(cell) && self.is_free(cell, label);
                is_under
                    .then(|| if self.is_amid(cell, label, samples) { Hidden::Amid } else { Hidden::NearEdge })
            };
            let mask = Mask { width: self.width, inside: is_inside, covered, shade, hidden };
            if !mask.is_top(cell) {
                continue;
            }
            passed.clear();
            let mut outline = mask.follow(cell, |cell| passed.push(cell));
            if self.is_floor[label as usize] {
                outline.keep_junctions();
            }
            passed.iter().for_each(|cell| marks.on[*cell] = number + 1);
            if !outline.is_hole || !self.fill(cell - self.width, number, label, marks) {
                outlines.extend(outline.simplified());
            }
        }
        outlines
    }

    /// The cells beside, above and below one that is not at the rim of the raster.
    pub fn around(&self, cell: usize) -> [usize; 4] {
        [cell - 1, cell + 1, cell - self.width, cell + self.width]
    }

    /// The cells that touch such a one in a corner only.
    pub fn corners(&self, cell: usize) -> [usize; 4] {
        let [up, down] = [cell - self.width, cell + self.width];
        [up - 1, up + 1, down - 1, down + 1]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Regions by their digits; each is an item of its own, and no cell is at an edge.
    pub fn regions(rows: &[&str]) -> Regions {
        let label = |b: u8| if b == b'.' { NOTHING } else { u32::from(b - b'0') };
        let rim = ".".repeat(rows[0].len() + 2);
        let rows: Vec<String> = rows.iter().map(|row| format!(".{row}.")).collect();
        let rows: Vec<&str> =
            [&rim[..]].into_iter().chain(rows.iter().map(String::as_str)).chain([&rim[..]]).collect();
        let labels: Vec<u32> = rows.iter().flat_map(|row| row.bytes().map(label)).collect();
        let edges = CellSet::new(labels.len());
        let items = (0..10).collect();
        let (width, strengths) = (rim.len(), vec![0.0; labels.len()]);
        let around = Spans::new(width, vec![[0, width as u32]; labels.len() / width]);
        Regions {
            width,
            around,
            labels,
            edges,
            samples: Vec::new(),
            per_cell: 1,
            items,
            strengths,
            least: vec![0.0; 10],
            means: vec![0.0; 10],
            steps: vec![0; 10],
            is_floor: vec![false; 10],
        }
    }

    #[test]
    fn a_region_reaches_under_those_that_come_later_and_has_no_holes_for_them() {
        let of =
            regions(&["0000000000", "0111111110", "0111111110", "0111221110", "0111111110", "0000000000"]);
        let outlines = of.outlines(3, &mut MarkMemory::default(), 0);
        assert_eq!(outlines.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 1], "{outlines:?}");
        let reach = |outline: &[Corner]| outline.iter().fold(0.0_f64, |reach, p| reach.max(p[0]));
        assert!(reach(&outlines[0][0]) > 10.0 && (reach(&outlines[1][0]) - 10.0).abs() < 0.6);
    }

    #[test]
    fn a_region_does_not_follow_the_edge_of_what_comes_later() {
        let mut of = regions(&["000011111111"; 8]);
        of.per_cell = 4;
        // Half of each cell in the first row is background.
        for column in 1..13 {
            let cell = of.width + column;
            of.edges.insert(cell);
            let item = of.labels[cell];
            of.samples.extend([item, item, NOTHING, NOTHING].map(|item| Sample { item, step: 0 }));
        }
        of.edges.number(of.around.cells());
        let outlines = of.outlines(2, &mut MarkMemory::default(), 0);
        let reach = |upto: f64| {
            let within = outlines[0][0].iter().filter(|[_, y]| *y < upto);
            within.fold(0.0_f64, |reach, [x, _]| reach.max(*x))
        };
        // A cell along the edge, and the whole margin further down.
        let (edge, below) = (reach(2.6), reach(9.0));
        assert!(edge <= 5.6 && below >= 7.4, "{edge} {below}: {outlines:?}");
    }

    #[test]
    fn what_comes_earlier_stays_open() {
        let outlines = regions(&["11111", "11011", "11011", "11011", "11111"]).outlines(
            2,
            &mut MarkMemory::default(),
            0,
        );
        assert_eq!(outlines[1].len(), 2, "an outline and its hole: {outlines:?}");
    }

    #[test]
    fn a_hole_with_something_earlier_in_its_midst_stays_open() {
        let ring = |inner: &str| {
            let midst = format!("12222{inner}22221");
            regions(&["11111111111", "12222222221", &midst, "12222222221", "11111111111"]).outlines(
                3,
                &mut MarkMemory::default(),
                0,
            )
        };
        assert_eq!((ring("2")[1].len(), ring("0")[1].len()), (1, 2));
    }

    #[test]
    fn a_narrow_part_hangs_together_though_most_middles_miss_it() {
        let mut of = regions(&["0000000", "0100010", "0000000"]);
        of.per_cell = 4;
        let row = 2 * of.width;
        for cell in row + 3..row + 6 {
            of.edges.insert(cell);
            let sample = |item| Sample { item, step: 0 };
            of.samples.extend([1, 0, 0, 0].map(sample));
        }
        of.edges.number(of.around.cells());
        of.with_narrow_parts();
        assert_eq!(of.labels[row + 2..row + 7], [1; 5]);
        assert_eq!(of.outlines(2, &mut MarkMemory::default(), 0)[1].len(), 1);
        // What is as wide as it has cells around is none.
        let mut wide = regions(&["1111111", "0000000", "0000000"]);
        wide.per_cell = 4;
        wide.edges.insert(row + 3);
        wide.edges.number(wide.around.cells());
        wide.samples = [1, 1, 0, 0].map(|item| Sample { item, step: 0 }).to_vec();
        wide.with_narrow_parts();
        assert_eq!(wide.labels[row + 3], 0);
    }
}
