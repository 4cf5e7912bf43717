//! How far the surface slides, for pictures on it.
//!
//! Material that flows through a column carries the picture there with it: a layer of a cell in thickness moves (Onoue, Nishita, *Virtual Sandbox*, 2003, section 4.2,
//! add up the volumes that move, each times its direction). Differences between neighbours are bounded, so that a picture is stretched by a
//! half at most; what slides far slides against what stands, and the picture shows only so much of it.

use std::ops::Range;

use crate::kernel::Block;
use crate::slip::{Around, HALO};
use crate::tile::QUANTA;

/// Largest difference between neighbours along an axis, in cells.
const STRETCH: f64 = 0.5;

/// How far the columns of a tile have slid after a sweep, in cells. A column moves at most half of what keeps the difference from each neighbour below the bound,
/// so all of them may move at once.
pub(crate) fn slid(
    block: &Block,
    tiles: &Around,
    (rows, places): (&Range<usize>, &Range<usize>),
    side: usize,
    awake: &[u32],
) -> Box<[[f64; 2]]> {
    let old = |number: usize, index: usize| {
        tiles[number].and_then(|tile| tile.slid.as_ref()).map_or([0.0; 2], |slid| slid[index])
    };
    let mut new: Box<[[f64; 2]]> = (0..side * side).map(|index| old(4, index)).collect();
    for r in rows.clone() {
        for c in places.clone() {
            let (row, place) = (r - HALO, c - HALO);
            if awake[row] >> place & 1 == 0 {
                continue;
            }
            let index = row * side + place;
            let own = old(4, index);
            let beside = [
                if place > 0 { old(4, index - 1) } else { old(3, index + side - 1) },
                if place + 1 < side { old(4, index + 1) } else { old(5, index + 1 - side) },
                if row > 0 { old(4, index - side) } else { old(1, index + side * (side - 1)) },
                if row + 1 < side { old(4, index + side) } else { old(7, index - side * (side - 1)) },
            ];
            let way = block.stream(r, c);
            for axis in 0..2 {
                let [mut least, mut most] = [f64::NEG_INFINITY, f64::INFINITY];
                for other in beside {
                    least = least.max(0.5 * (other[axis] - STRETCH - own[axis]));
                    most = most.min(0.5 * (other[axis] + STRETCH - own[axis]));
                }
                // Rounding may have taken a difference beyond the bound.
                new[index][axis] = own[axis] + (way[axis] / QUANTA).clamp(least.min(0.0), most.max(0.0));
            }
        }
    }
    new
}
