//! Prefetching of memory that a traversal of modules, or the next event, will read soon.
//!
//! The states of modules stand in memory in the order of their birth, and a common step visits them in string order, events
//! in the order of time: for the processor, at random. Without prefetching each visit waits for memory.

use crate::world::World;
use crate::world::neighbours::Neighbours;
use dlsys_tree::ModuleId;

/// Memory is prefetched this many modules ahead.
const AHEAD: usize = 6;

/// The states of fewer modules than this stay in the caches by themselves; prefetching would cost a third of a cheap
/// step.
const FEW: usize = 2000;

/// Bytes of a cache line.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Prefetches the states and values of modules some places behind place `at` of a traversal.
#[inline]
pub fn prefetch(world: &World, visited: &[ModuleId], at: usize) {
    if visited.len() < FEW {
        return;
    }
    if let Some(id) = visited.get(at + 2 * AHEAD) {
        // The place of the state has to be prefetched before the state, the place of the values before the values.
        world.states.place(id.slot()).into_iter().for_each(fetch);
        world.tree.record(id.slot()).into_iter().for_each(fetch);
    }
    if let Some(&id) = visited.get(at + AHEAD) {
        world.states.get(id.slot()).into_iter().for_each(fetch);
        world.tree.parameters(id).first().into_iter().for_each(fetch);
    }
}

/// Prefetches what events will read. `soon` are their modules: of the first, its state and where its neighbours are; of the
/// others, which may come after it, where all that is.
pub fn prefetch_events(world: &World, neighbours: &Neighbours, mut soon: impl Iterator<Item = u32>) {
    if !is_large(world) {
        return;
    }
    let locate = |slot: usize| {
        world.states.place(slot).into_iter().for_each(fetch);
        neighbours.prefetch(slot);
    };
    if let Some(next) = soon.next() {
        world.states.get(next as usize).into_iter().for_each(fetch);
        neighbours.beside(next as usize).for_each(|id| locate(id.slot()));
    }
    soon.for_each(|slot| locate(slot as usize));
}

/// What a walk in string order comes to next, by a list of modules that were in that order before: each link of the walk would wait for
/// memory, because it says where the next one is.
pub struct Guide<'b> {
    before: &'b [ModuleId],
    passed: usize,
}

impl Guide<'_> {
    pub fn new<'b>(world: &World, before: &'b [ModuleId]) -> Guide<'b> {
        Guide { before: if is_large(world) { before } else { &[] }, passed: 0 }
    }

    /// The walk has come to a module, one of the list or a new one between those.
    #[inline]
    pub fn pass(&mut self, world: &World, id: ModuleId) {
        let Some(known) = self.before.get(self.passed) else { return };
        if *known == id || !world.tree.is_alive(*known) {
            self.passed += 1;
        }
        if let Some(next) = self.before.get(self.passed + 2 * AHEAD) {
            world.tree.record(next.slot()).into_iter().for_each(fetch);
        }
    }
}

/// True if there are so many states that the caches do not hold them.
pub fn is_large(world: &World) -> bool {
    world.states.slots() >= FEW
}

/// Prefetches all cache lines of a value.
#[inline]
pub fn fetch<T>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let first = std::ptr::from_ref(value).cast::<i8>();
        // SAFETY: this is a hint for memory behind a reference; it reads nothing and cannot fail. The standard
        // library has no safe equivalent. A filament of 45,000 coupled cells takes four fifths of the time with it
        // (medians of five, in turns).
        let hint = |offset: usize| unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(offset)) };
        // A loop whose length is known when this is compiled: a fifth of the instructions that a chain of iterators takes.
        let mut offset = 0;
        while offset < size_of::<T>() {
            hint(offset);
            offset += LINE;
        }
        // What is no larger than its alignment lies in one line.
        if size_of::<T>() > align_of::<T>() {
            hint(size_of::<T>() - 1);
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}
