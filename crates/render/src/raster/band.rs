//! A band of rows: which triangle is seen at each sample. Its colours are in [`resolve`](super::resolve).
//!
//! Most pixels are within one triangle. Such a pixel holds the number of the triangle and bounds of its depth; only when an edge crosses it, or
//! when another triangle passes through the first, it holds several ([`Fragments`]). A triangle is passed at once where all pixels are nearer, and so is
//! a pixel whose farthest sample is nearer than the triangle there. Eight pixels of a row are looked at together ([`Lanes`]).

use std::ops::Range;

use super::fragments::{Cover, Fragment, Fragments, Places, places};
use super::lanes::{LANES, Lanes, not_behind, within};
use super::list::List;
use super::plane::{Plane, Ready};
use super::{BAND, EQUAL, Pattern, STEPS, Triangles};
use crate::mapping::Cut;
use dlsys_geometry::scene::Drawn;
use wide::f32x8;

/// Nothing is drawn in the pixel.
pub(super) const NOTHING: u32 = u32::MAX;
/// From this number on several triangles share the pixel: the rest of the number is its place among those.
pub(super) const MIXED: u32 = 1 << 31;

/// The samples of some rows. What is by pixel is row by row, [`Band::stride`] pixels each.
pub(super) struct Band<const N: usize> {
    places: Places<N>,
    pub(super) width: usize,
    /// The width, and as much more that eight pixels from any one on are within a row.
    pub(super) stride: usize,
    /// The triangle that covers all of a pixel, by its place in the band's list; or [`NOTHING`], or from [`MIXED`] on.
    pub(super) seen: Vec<u32>,
    /// No sample is farther, none nearer.
    far: Vec<f32>,
    near: Vec<f32>,
    /// Of pixels that several triangles share.
    pub(super) shared: Vec<Fragments<N>>,
    /// Of the triangles that are seen or were, by their places in the list.
    planes: Vec<Plane>,
    /// First column in which something may be drawn, and the one after the last: most of a picture is empty.
    pub(super) touched: [usize; 2],
}

impl<const N: usize> Band<N> {
    pub(super) fn new(pattern: &Pattern<N>, width: usize) -> Band<N> {
        let stride = width + LANES - 1;
        let count = stride * BAND;
        Band {
            places: places(pattern),
            width,
            stride,
            seen: vec![NOTHING; count],
            far: vec![f32::NEG_INFINITY; count],
            near: vec![f32::NEG_INFINITY; count],
            shared: Vec::new(),
            planes: Vec::new(),
            touched: [0; 2],
        }
    }

    /// Draws these triangles in these rows, which were empty.
    // In each of its callers: called, it took a twentieth more of the time of a picture.
    #[inline(always)]
    pub(super) fn draw(&mut self, triangles: &impl Triangles, list: &List, rows: Range<usize>) {
        self.clear();
        self.planes.clear();
        self.planes.resize(list.numbers.len(), Plane::NONE);
        for place in list.nearest_first() {
            let number = list.numbers[place] as usize;
            let Some(ready) = Ready::new(triangles.corners(number), self.width, &rows) else { continue };
            if !self.is_open(&ready, rows.start) {
                continue;
            }
            self.planes[place] = ready.plane;
            let [first, last] = ready.columns;
            let [from, end] = self.touched;
            self.touched = if from == end { [first, last + 1] } else { [from.min(first), end.max(last + 1)] };
            let cut = triangles.cut(number, N);
            self.fill(&ready, cut.as_ref(), place as u32, rows.start);
        }
    }

    /// Passes on the places in the list of all triangles that are seen, once or several times.
    pub(super) fn each_seen(&self, mut visit: impl FnMut(u32)) {
        let [first, end] = self.touched;
        let mut last = NOTHING;
        for start in (first..self.seen.len()).step_by(self.stride) {
            for &seen in &self.seen[start..start + (end - first)] {
                match seen {
                    NOTHING => {}
                    seen @ MIXED.. => {
                        self.shared[(seen - MIXED) as usize].places().iter().for_each(|&p| visit(p))
                    }
                    place if place == last => {}
                    place => {
                        visit(place);
                        last = place;
                    }
                }
            }
        }
    }

    fn clear(&mut self) {
        let [first, end] = std::mem::take(&mut self.touched);
        for start in (first..self.seen.len()).step_by(self.stride) {
            let cells = start..start + (end - first);
            self.seen[cells.clone()].fill(NOTHING);
            self.far[cells.clone()].fill(f32::NEG_INFINITY);
            self.near[cells].fill(f32::NEG_INFINITY);
        }
        self.shared.clear();
    }

    /// Whether something at this depth may be seen in these columns of these rows.
    #[inline(always)]
    fn is_open(&self, ready: &Ready, top: usize) -> bool {
        let front = f32x8::splat(ready.plane.front());
        let [first, last] = ready.columns;
        for row in ready.rows[0]..=ready.rows[1] {
            let line = (row - top) * self.stride;
            let mut column = first;
            while column <= last {
                let open = not_behind(front, self.farthest(line + column));
                if open & within(last + 1 - column) != 0 {
                    return true;
                }
                column += LANES;
            }
        }
        false
    }

    /// The depth of what is the farthest, in some pixels from one on.
    #[inline(always)]
    fn farthest(&self, pixel: usize) -> [f32; LANES] {
        let far = self.far[pixel..].first_chunk();
        far.copied().unwrap_or([f32::NEG_INFINITY; LANES])
    }

    /// Draws a triangle.
    #[inline(always)]
    fn fill(&mut self, ready: &Ready, cut: Option<&Cut<'_>>, place: u32, top: usize) {
        let lanes = Lanes::new(ready);
        let mut cover: Option<Cover<N>> = None;
        let [[p, ..], [q, ..], [r, ..]] = ready.sides;
        let mut start = [p, q, r];
        for row in ready.rows[0]..=ready.rows[1] {
            let mut here = start;
            let mut is_entered = false;
            let line = (row - top) * self.stride;
            let (mut first, last) = (ready.columns[0], ready.columns[1]);
            while first <= last {
                let [touched, full] = lanes.cover(here);
                let touched = touched & within(last + 1 - first);
                if touched == 0 && is_entered {
                    break;
                }
                is_entered |= touched != 0;
                let along = lanes.along([first, row]);
                let mut open = match touched {
                    0 => 0,
                    touched => touched & lanes.in_front(along, self.farthest(line + first)),
                };
                let along = along.to_array();
                while open != 0 {
                    let k = open.trailing_zeros() as usize;
                    open &= open - 1;
                    let (column, is_full) = (first + k, full >> k & 1 == 1);
                    let drawn = cut.map_or(Drawn::All, |cut| cut.in_pixel([column, row]));
                    if drawn == Drawn::Nothing {
                        continue;
                    }
                    let (far, near) = lanes.depths(along[k]);
                    let new = Fragment { place, mask: 0, far, near };
                    if is_full && drawn == Drawn::All && self.covers(line + column, &new) {
                        continue;
                    }
                    let mut at = here;
                    for (at, [_, a, _]) in at.iter_mut().zip(ready.sides) {
                        *at += a * (STEPS * k as i64);
                    }
                    let cover = match &mut cover {
                        Some(cover) => cover,
                        none => none.insert(Cover::new(&ready.sides, &self.places)),
                    };
                    let covered = cover.mask(at);
                    let mask = match cut.filter(|_| drawn == Drawn::Some) {
                        Some(cut) => left_of(cut, covered, [column, row], &self.places),
                        None => covered,
                    };
                    if mask != 0 {
                        self.share(line + column, Fragment { mask, ..new }, [column, row]);
                    }
                }
                for (here, [_, a, _]) in here.iter_mut().zip(ready.sides) {
                    *here += a * (STEPS * LANES as i64);
                }
                first += LANES;
            }
            for (start, [.., b]) in start.iter_mut().zip(ready.sides) {
                *start += b * STEPS;
            }
        }
    }

    /// Gives a pixel to a triangle that covers all of it if nothing is in front of that.
    #[inline(always)]
    fn covers(&mut self, pixel: usize, new: &Fragment) -> bool {
        let (seen, held) = (self.seen[pixel], self.near[pixel]);
        let is_later = seen < MIXED && new.place > seen;
        let is_nearer = new.far > held + EQUAL || (is_later && new.far + EQUAL >= held);
        if seen != NOTHING && !is_nearer {
            return false;
        }
        (self.seen[pixel], self.far[pixel]) = (new.place, new.far);
        self.near[pixel] = new.near.max(held);
        true
    }

    /// Gives a triangle its samples of a pixel.
    #[inline(always)]
    fn share(&mut self, pixel: usize, new: Fragment, at: [usize; 2]) {
        let seen = self.seen[pixel];
        let is_new = seen < MIXED || seen == NOTHING;
        let index = if is_new { self.shared.len() } else { (seen - MIXED) as usize };
        if is_new {
            self.seen[pixel] = MIXED + index as u32;
            self.shared.push(Fragments::EMPTY);
        }
        let shared = &mut self.shared[index];
        if seen < MIXED {
            shared.begin(seen, self.far[pixel]);
        }
        if let Some(far) = shared.add(new, &self.planes, &self.places, at) {
            self.far[pixel] = far;
        }
        let held = self.near[pixel];
        self.near[pixel] = if new.near > held { new.near } else { held };
    }
}

/// The samples of a mask that are not cut out.
#[inline(never)]
pub(super) fn left_of<const N: usize>(
    cut: &Cut<'_>,
    mask: u32,
    [column, row]: [usize; 2],
    [xs, ys]: &Places<N>,
) -> u32 {
    let mut left = 0;
    for s in (0..N).filter(|s| mask >> s & 1 == 1) {
        let at = |pixel: usize, step: f32| pixel as f64 + f64::from(step) / STEPS as f64;
        left |= u32::from(cut.is_drawn([at(column, xs[s]), at(row, ys[s])])) << s;
    }
    left
}
