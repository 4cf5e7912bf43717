//! Pixels that several triangles share: which samples each of them has.
//!
//! Samples are bits of a mask. Most triangles in a pixel are neighbours on one surface, whose masks have no bit in common; so depths are
//! looked at only where masks overlap, and sample by sample only where two triangles pass through one another in the pixel.

use wide::{f32x4, i32x4};

use super::plane::Plane;
use super::{EQUAL, STEPS};

/// Sides with fewer steps along each axis take 32 bits; and bound of a side's function, beyond which its value does not matter.
const SHORTEST: i64 = 1 << 15;
const LIMIT: i64 = 1 << 30;
/// Most samples, in fours.
const FOURS: usize = 4;

/// Places of the samples in a pixel, in steps from its upper left corner: all x, all y.
pub(super) type Places<const N: usize> = [[f32; N]; 2];

/// What the samples of a pixel add to the functions of a triangle's sides.
pub(super) enum Cover<const N: usize> {
    /// Four samples after four.
    Short([[i32x4; FOURS]; 3]),
    Long([[i64; N]; 3]),
}

impl<const N: usize> Cover<N> {
    /// For the growth of each side's function by a step to the right and down.
    #[inline(always)]
    pub(super) fn new(sides: &[[i64; 3]; 3], places: &Places<N>) -> Cover<N> {
        const { assert!(N.is_multiple_of(4) && N <= 4 * FOURS) };
        if sides.iter().all(|[_, a, b]| a.abs() < SHORTEST && b.abs() < SHORTEST) {
            let [xs, ys] = places.each_ref().map(|places| places.as_chunks::<4>().0);
            let mut added = [[i32x4::ZERO; FOURS]; 3];
            for (added, [_, a, b]) in added.iter_mut().zip(sides) {
                let (a, b) = (f32x4::splat(*a as f32), f32x4::splat(*b as f32));
                for k in 0..N / 4 {
                    // All these numbers are whole, and less than 2^24.
                    added[k] = (a * f32x4::new(xs[k]) + b * f32x4::new(ys[k])).fast_trunc_int();
                }
            }
            return Cover::Short(added);
        }
        let [xs, ys] = places;
        let added = sides.map(|[_, a, b]| std::array::from_fn(|s| a * xs[s] as i64 + b * ys[s] as i64));
        Cover::Long(added)
    }

    /// The samples within all sides, given the values of the sides' functions at the pixel.
    #[inline(always)]
    pub(super) fn mask(&self, here: [i64; 3]) -> u32 {
        let mut outside = 0;
        match self {
            Cover::Short([a, b, c]) => {
                let at = |side: usize| i32x4::splat(here[side].clamp(-LIMIT, LIMIT) as i32);
                let [p, q, r] = [at(0), at(1), at(2)];
                for k in 0..N / 4 {
                    outside |= ((p + a[k]) | (q + b[k]) | (r + c[k])).to_bitmask() << (4 * k);
                }
            }
            Cover::Long([a, b, c]) => {
                let [p, q, r] = here;
                for s in 0..N {
                    outside |= u32::from((p + a[s]) | (q + b[s]) | (r + c[s]) < 0) << s;
                }
            }
        }
        !outside & full::<N>()
    }
}

/// All samples.
const fn full<const N: usize>() -> u32 {
    ((1_u64 << N) - 1) as u32
}

/// A triangle in a pixel.
#[derive(Clone, Copy)]
pub(super) struct Fragment {
    /// Its place in the band's list.
    pub(super) place: u32,
    /// The samples that it has, or would have.
    pub(super) mask: u32,
    /// No place of it in the pixel is farther, none nearer.
    pub(super) far: f32,
    pub(super) near: f32,
}

/// The triangles that share a pixel; no sample belongs to two.
#[derive(Clone, Copy)]
pub(super) struct Fragments<const N: usize> {
    count: u32,
    places: [u32; N],
    masks: [u32; N],
    fars: [f32; N],
}

impl<const N: usize> Fragments<N> {
    pub(super) const EMPTY: Fragments<N> =
        Fragments { count: 0, places: [0; N], masks: [0; N], fars: [0.0; N] };

    /// The places in the list of the triangles that share the pixel; one of them may have lost its last sample.
    pub(super) fn places(&self) -> &[u32] {
        &self.places[..self.count as usize]
    }

    /// Begins with a triangle that has the whole pixel, given its place and depth.
    #[inline(always)]
    pub(super) fn begin(&mut self, place: u32, far: f32) {
        self.push(place, full::<N>(), far);
    }

    #[inline(always)]
    fn push(&mut self, place: u32, mask: u32, far: f32) {
        let i = self.count as usize;
        (self.places[i], self.masks[i], self.fars[i]) = (place, mask, far);
        self.count += 1;
    }

    /// Gives a triangle the samples of its mask at which it is in front, and returns a depth that no sample is behind.
    #[inline(always)]
    pub(super) fn add(
        &mut self,
        new: Fragment,
        planes: &[Plane],
        places: &Places<N>,
        pixel: [usize; 2],
    ) -> Option<f32> {
        let mut mask = new.mask;
        let mut is_emptied = false;
        for i in 0..self.count as usize {
            let both = self.masks[i] & mask;
            if both == 0 {
                continue;
            }
            let won = self.won(i, Fragment { mask: both, ..new }, planes, places, pixel);
            self.masks[i] &= !won;
            mask &= !(both & !won);
            is_emptied |= self.masks[i] == 0;
        }
        if mask == 0 {
            return None;
        }
        if is_emptied {
            let held = *self;
            self.count = 0;
            for i in (0..held.count as usize).filter(|&i| held.masks[i] != 0) {
                self.push(held.places[i], held.masks[i], held.fars[i]);
            }
        }
        // Masks have no sample in common, so there is room for one more.
        self.push(new.place, mask, new.far);
        let count = self.count as usize;
        let covered = self.masks[..count].iter().fold(0, |all, mask| all | mask);
        (covered == full::<N>())
            .then(|| self.fars[..count].iter().fold(f32::INFINITY, |a, &b| if b < a { b } else { a }))
    }

    /// The samples of a mask at which a triangle is before the one of this number. Of two at one depth, the later one is.
    #[inline(always)]
    fn won(&self, i: usize, new: Fragment, planes: &[Plane], places: &Places<N>, pixel: [usize; 2]) -> u32 {
        let Some((held, plane)) = planes.get(self.places[i] as usize).zip(planes.get(new.place as usize))
        else {
            return new.mask;
        };
        let base = held.at(pixel);
        let [lowest, highest] = held.reach();
        if new.far > held.bounded(base + highest) + EQUAL {
            return new.mask;
        }
        if held.bounded(base + lowest) > new.near + EQUAL {
            return 0;
        }
        let is_later = new.place > self.places[i];
        let own = plane.at(pixel);
        let (mut won, mut left) = (0, new.mask);
        while left != 0 {
            let s = left.trailing_zeros() as usize;
            left &= left - 1;
            let at = [places[0][s], places[1][s]];
            let (depth, behind) = (plane.sample(own, at), held.sample(base, at));
            if depth > behind + EQUAL || (is_later && depth + EQUAL >= behind) {
                won |= 1 << s;
            }
        }
        won
    }

    /// The mean colour of the samples, of which those of no surface have the colour `open`. Each surface is shaded where its first sample is:
    /// the first ones are in the middle.
    #[inline(always)]
    pub(super) fn mean(
        &self,
        surface: impl Fn(u32) -> u32,
        mut color: impl FnMut(u32) -> [u8; 4],
        open: impl FnOnce() -> [u8; 4],
    ) -> [u8; 4] {
        let (mut sum, mut left) = ([0_u32; 4], N as u32);
        let count = self.count as usize;
        let mut surfaces = [0; N];
        for (own, place) in surfaces.iter_mut().zip(&self.places[..count]) {
            *own = surface(*place);
        }
        let mut is_done = 0_u32;
        for i in 0..count {
            if is_done >> i & 1 == 1 {
                continue;
            }
            let (mut first, mut mask) = (self.places[i], self.masks[i]);
            for k in i + 1..count {
                if surfaces[k] == surfaces[i] {
                    is_done |= 1 << k;
                    let other = self.masks[k];
                    // No two have a sample in common.
                    if other & other.wrapping_neg() < mask & mask.wrapping_neg() {
                        first = self.places[k];
                    }
                    mask |= other;
                }
            }
            let painted = color(first);
            let weight = mask.count_ones();
            if weight == N as u32 {
                return painted;
            }
            left -= weight;
            for (sum, channel) in sum.iter_mut().zip(painted) {
                *sum += weight * u32::from(channel);
            }
        }
        if left > 0 {
            for (sum, channel) in sum.iter_mut().zip(open()) {
                *sum += left * u32::from(channel);
            }
        }
        sum.map(|total| ((total + N as u32 / 2) / N as u32) as u8)
    }
}

/// Where the samples of a pattern are, given in sixteenths of a pixel from its middle.
pub(super) fn places<const N: usize>(pattern: &super::Pattern<N>) -> Places<N> {
    let place = |k: i64| ((k + 8) * (STEPS / 16) + STEPS / 32) as f32;
    [pattern.map(|(x, _)| place(x)), pattern.map(|(_, y)| place(y))]
}
