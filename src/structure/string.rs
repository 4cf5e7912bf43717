//! The structure at one instant, in string order.

use super::{Instant, Lineage};
use crate::model::KindId;

/// All modules alive at `time`, in string order, brackets included.
///
/// Parameters lie one after another in a single array: a string of a million modules is four
/// allocations, and can be filled again for the next frame.
///
/// Of a module the birth is kept, not the age: from frame to frame a string whose modules are the same has nothing
/// to write but the parameters that move.
#[derive(Clone, Debug, Default)]
pub struct ModuleString {
    /// Time of the simulation.
    pub time: f64,
    /// What ages are counted to.
    now: Instant,
    entries: Vec<Entry>,
    parameters: Vec<f64>,
    version: Option<Version>,
}

/// Which modules a string is made of: the same number means the same ones, in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    /// Tells the simulations of a process apart.
    pub source: u64,
    /// Grows with every change of the structure.
    pub structure: u64,
}

/// 48 bytes; a [`Lineage`] of its own would make it 56.
#[derive(Clone, Copy, Debug)]
struct Entry {
    kind: KindId,
    generation: u32,
    /// Where the parameters begin.
    first: usize,
    birth: Instant,
    id: u64,
    trail: u64,
}

/// One module, or one bracket, of a [`ModuleString`].
#[derive(Clone, Copy, Debug)]
pub struct Module<'a> {
    pub kind: KindId,
    pub parameters: &'a [f64],
    /// Time since the module was created.
    pub age: f64,
    /// Means nothing for a bracket.
    pub lineage: Lineage,
}

impl ModuleString {
    /// Empties the string and sets its time, keeping its memory.
    pub fn reset(&mut self, time: f64) {
        (self.time, self.now, self.version) = (time, Instant::ZERO, None);
        self.entries.clear();
        self.parameters.clear();
    }

    /// Appends a module.
    pub fn push(
        &mut self,
        kind: KindId,
        parameters: impl IntoIterator<Item = f64>,
        age: f64,
        lineage: Lineage,
    ) {
        let birth = self.now.after(-age);
        let first = self.parameters.len();
        self.parameters.extend(parameters);
        self.enter(kind, birth, lineage, first);
    }

    /// Appends a module that was born at an instant; returns the place of its first parameter.
    pub(crate) fn push_born(
        &mut self,
        kind: KindId,
        birth: Instant,
        lineage: Lineage,
        parameters: &[f64],
    ) -> usize {
        let first = self.parameters.len();
        self.parameters.extend_from_slice(parameters);
        self.enter(kind, birth, lineage, first);
        first
    }

    fn enter(&mut self, kind: KindId, birth: Instant, lineage: Lineage, first: usize) {
        self.version = None;
        let Lineage { id, generation, trail } = lineage;
        self.entries.push(Entry { kind, generation, first, birth, id, trail });
    }

    /// Sets the time that the string shows, and the instant that ages are counted to.
    pub(crate) fn show(&mut self, time: f64, now: Instant) {
        (self.time, self.now) = (time, now);
    }

    /// Which modules these are, if a simulation has written them.
    pub(crate) fn version(&self) -> Option<Version> {
        self.version
    }

    pub(crate) fn set_version(&mut self, version: Version) {
        self.version = Some(version);
    }

    /// The parameters of all modules, to be set by who has written them.
    pub(crate) fn parameters_mut(&mut self) -> &mut [f64] {
        &mut self.parameters
    }

    /// Number of modules, brackets included.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub fn get(&self, index: usize) -> Module<'_> {
        let entry = &self.entries[index];
        let end = self.entries.get(index + 1).map_or(self.parameters.len(), |next| next.first);
        Module {
            kind: entry.kind,
            parameters: &self.parameters[entry.first..end],
            age: self.now.since(entry.birth).max(0.0),
            lineage: Lineage { id: entry.id, generation: entry.generation, trail: entry.trail },
        }
    }

    pub fn iter(&self) -> impl Iterator<Item = Module<'_>> {
        (0..self.len()).map(|i| self.get(i))
    }
}
