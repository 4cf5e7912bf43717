//! A triangle at several pixels of a row at once: which of them it touches, which it covers, and where it is in front.

use wide::{f32x8, i32x8};

use super::plane::{Plane, Ready};
use super::{EQUAL, STEPS};

/// Pixels that are looked at together.
pub(super) const LANES: usize = 8;
/// Sides with fewer steps along each axis take 32 bits; and bound of a side's function, beyond which its value does not matter.
const SHORTEST: i64 = 1 << 17;
const LIMIT: i64 = 1 << 30;

/// A triangle.
pub(super) struct Lanes {
    /// By side: what each pixel adds to the value of its function at the first one, with the corner that is the furthest within; unless the triangle is large.
    most: Option<[i32x8; 3]>,
    /// The same with the corner that is the furthest without, less the above.
    less: [i32x8; 3],
    sides: [[i64; 3]; 3],
    plane: Plane,
    /// The least and the greatest depth that a place in a pixel adds.
    reach: [f32; 2],
}

impl Lanes {
    #[inline(always)]
    pub(super) fn new(ready: &Ready) -> Lanes {
        let sides = ready.sides;
        let is_short = sides.iter().all(|[_, a, b]| a.abs() < SHORTEST && b.abs() < SHORTEST);
        let most = |[_, a, b]: [i64; 3]| {
            let (first, right) = (((a.max(0) + b.max(0)) * STEPS) as i32, (a * STEPS) as i32);
            i32x8::splat(first) + multiples(right)
        };
        let less = |[_, a, b]: [i64; 3]| i32x8::splat(((a.abs() + b.abs()) * STEPS) as i32);
        Lanes {
            most: is_short.then(|| sides.map(most)),
            less: sides.map(less),
            sides,
            plane: ready.plane,
            reach: ready.plane.reach(),
        }
    }

    /// The pixels that the triangle touches, as bits; and those that it covers. Given are the values of the functions of its sides at the upper left
    /// corner of the first one.
    #[inline(always)]
    pub(super) fn cover(&self, here: [i64; 3]) -> [u32; 2] {
        let Some(most) = &self.most else { return self.cover_one_by_one(here) };
        let at = |side: usize| i32x8::splat(here[side].clamp(-LIMIT, LIMIT) as i32) + most[side];
        let [p, q, r] = [at(0), at(1), at(2)];
        let touched = !(p | q | r).to_bitmask();
        if touched & ALL == 0 {
            return [0; 2];
        }
        let full = !((p - self.less[0]) | (q - self.less[1]) | (r - self.less[2])).to_bitmask();
        [touched & ALL, full & ALL]
    }

    /// The same for a large triangle.
    #[inline(never)]
    fn cover_one_by_one(&self, here: [i64; 3]) -> [u32; 2] {
        let (mut touched, mut full) = (0, 0);
        for k in 0..LANES {
            let (mut most, mut least) = (0, 0);
            for (value, [_, a, b]) in here.iter().zip(self.sides) {
                let at = value + a * STEPS * k as i64;
                most |= at + (a.max(0) + b.max(0)) * STEPS;
                least |= at + (a.min(0) + b.min(0)) * STEPS;
            }
            touched |= u32::from(most >= 0) << k;
            full |= u32::from(least >= 0) << k;
        }
        [touched, full]
    }

    /// The depths at the upper left corners of the pixels, given the first one.
    #[inline(always)]
    pub(super) fn along(&self, pixel: [usize; 2]) -> f32x8 {
        self.plane.along_row(pixel)
    }

    /// The pixels, as bits, of which something is not behind what is the farthest there; given are these depths.
    #[inline(always)]
    pub(super) fn in_front(&self, along: f32x8, far: [f32; LANES]) -> u32 {
        not_behind(self.plane.bounded_all(along + f32x8::splat(self.reach[1])), far)
    }

    /// The least and the greatest depth in a pixel, given that at its upper left corner.
    #[inline(always)]
    pub(super) fn depths(&self, base: f32) -> (f32, f32) {
        let [lowest, highest] = self.reach;
        (self.plane.bounded(base + lowest), self.plane.bounded(base + highest))
    }
}

/// A number times 0, 1, 2 and so on. Numbers that are stored one by one and loaded together would be waited for.
#[inline(always)]
fn multiples(number: i32) -> i32x8 {
    const ONES: i32x8 = i32x8::new([0, -1, 0, -1, 0, -1, 0, -1]);
    const TWOS: i32x8 = i32x8::new([0, 0, -1, -1, 0, 0, -1, -1]);
    const FOURS: i32x8 = i32x8::new([0, 0, 0, 0, -1, -1, -1, -1]);
    let [one, two, four] = [1, 2, 4].map(|times| i32x8::splat(number * times));
    (one & ONES) + (two & TWOS) + (four & FOURS)
}

/// All pixels.
const ALL: u32 = (1 << LANES) - 1;

/// The pixels, as bits, at which what is this near is not behind what is this far.
#[inline(always)]
pub(super) fn not_behind(near: f32x8, far: [f32; LANES]) -> u32 {
    !(near + f32x8::splat(EQUAL)).simd_lt(f32x8::new(far)).to_bitmask() & ALL
}

/// The first pixels, as bits, no more than so many.
#[inline(always)]
pub(super) fn within(count: usize) -> u32 {
    (1 << count.min(LANES)) - 1
}
