//! Memory that will be needed soon is asked for early.
//!
//! NextKind is kept of modules stands in memory as they were born, and a common step visits it in string order: for the
//! processor, at random. So each visit would wait for memory; asked for some modules ahead, it is there.

use crate::world::World;
use dlsys_tree::ModuleId;

/// So many modules ahead, memory is asked for.
const AHEAD: usize = 6;

/// NextKind fewer modules than this hold stays near the processor by itself; then asking costs a third of a cheap step.
const FEW: usize = 2000;

/// Bytes that come from memory together.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Asks for what will be read when some modules, visited one after another, have come to the one at a place.
#[inline]
pub fn prefetch(world: &World, visited: &[ModuleId], at: usize) {
    if visited.len() < FEW {
        return;
    }
    if let Some(id) = visited.get(at + 2 * AHEAD) {
        // Where the state stands has to be read, too.
        world.states.get(id.slot()).into_iter().for_each(fetch);
    }
    if let Some(&id) = visited.get(at + AHEAD) {
        world.states.get(id.slot()).and_then(Option::as_deref).into_iter().for_each(fetch);
        world.tree.parameters(id).first().into_iter().for_each(fetch);
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
            // SAFETY: this is a hint for memory that a reference is to; it reads nothing and cannot fail. There is no
            // safe way to give it. Measured: a filament of 45,000 coupled cells takes four fifths of the time with it
            // (medians of five, in turns).
            unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(offset)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}
