//! Memory that will be needed soon is asked for early.
//!
//! What is kept of modules stands in memory as they were born, and a common step visits it in string order: for the
//! processor, at random. So each visit would wait for memory; asked for some modules ahead, it is there.

use super::plant::Plant;
use crate::structure::ModuleId;

/// So many modules ahead, memory is asked for.
const AHEAD: usize = 6;

/// Bytes that come from memory together.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Asks for what will be read when some modules, visited one after another, have come to the one at a place.
#[inline]
pub fn fetch_ahead(plant: &Plant, visited: &[ModuleId], at: usize) {
    if let Some(id) = visited.get(at + 2 * AHEAD) {
        // Where the state stands has to be read, too.
        plant.states.get(id.slot()).into_iter().for_each(fetch);
    }
    if let Some(state) = visited.get(at + AHEAD).and_then(|id| plant.states.get(id.slot())?.as_deref()) {
        fetch(state);
    }
}

/// Asks for all of a value.
#[inline]
fn fetch<T>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let first = std::ptr::from_ref(value).cast::<i8>();
        let offsets = (0..size_of::<T>()).step_by(LINE).chain(size_of::<T>().checked_sub(1));
        for offset in offsets {
            // SAFETY: this is a hint, which reads nothing and cannot fail, for memory that the reference is to. There is no
            // safe way to say it.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(offset)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}
