//! The structure at one instant, in string order.

use super::Lineage;
use crate::model::KindId;

/// All modules alive at `time`, in string order, brackets included.
///
/// Parameters lie one after another in a single array: a string of a million modules is four
/// allocations, and can be filled again for the next frame.
#[derive(Clone, Debug, Default)]
pub struct ModuleString {
    /// Time of the simulation.
    pub time: f64,
    entries: Vec<Entry>,
    parameters: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    kind: KindId,
    /// Where the parameters begin.
    first: usize,
    age: f64,
    lineage: Lineage,
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
        self.time = time;
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
        self.entries.push(Entry { kind, first: self.parameters.len(), age, lineage });
        self.parameters.extend(parameters);
    }

    /// Number of modules, brackets included.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub fn get(&self, index: usize) -> Module<'_> {
        let entry = self.entries[index];
        let end = self.entries.get(index + 1).map_or(self.parameters.len(), |next| next.first);
        Module {
            kind: entry.kind,
            parameters: &self.parameters[entry.first..end],
            age: entry.age,
            lineage: entry.lineage,
        }
    }

    pub fn iter(&self) -> impl Iterator<Item = Module<'_>> {
        (0..self.len()).map(|i| self.get(i))
    }
}
