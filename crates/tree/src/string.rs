//! The structure at one instant, in string order.

use super::brood::{Broods, NO_BROOD};
use super::{Lineage, SimTime};
use dlsys_model::KindId;

/// All modules alive at `time`, in string order, brackets included.
///
/// Parameters lie one after another in a single array: a string of a million modules is a few
/// allocations, and can be filled again for the next frame.
///
/// Of a module the birth is kept, not the age: from frame to frame a string whose modules are the same has nothing
/// to write but the parameters that move.
#[derive(Clone, Debug, Default)]
pub struct ModuleString {
    /// Time of the simulation.
    pub time: f64,
    /// What ages are counted to.
    now: SimTime,
    entries: Vec<Entry>,
    parameters: Vec<f64>,
    broods: Broods,
    /// Birth and lineage of modules that come from nowhere.
    strangers: Vec<(SimTime, Lineage)>,
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

/// Who a module is says its brood; of those of none, it is said apart.
#[derive(Clone, Copy, Debug)]
struct Entry {
    kind: KindId,
    /// Where the parameters begin. As in a tree, there are fewer than 2^32 of them.
    first: u32,
    brood: u32,
    /// In the brood; in `strangers`, for a module of no brood; `NO_BROOD` for a bracket.
    place: u32,
}

/// One module, or one bracket, of a [`ModuleString`].
#[derive(Clone, Copy, Debug)]
pub struct Module<'a> {
    /// Kind of the module; [`KindId::OPEN`] or [`KindId::CLOSE`] for a bracket.
    pub kind: KindId,
    /// Parameters shown to observers, in their order in the model.
    pub parameters: &'a [f64],
    /// Time since the module was created.
    pub age: f64,
    /// Means nothing for a bracket.
    pub lineage: Lineage,
}

impl ModuleString {
    /// Empties the string and sets its time, keeping its memory.
    pub fn reset(&mut self, time: f64) {
        (self.time, self.now, self.version) = (time, SimTime::ZERO, None);
        self.entries.clear();
        self.parameters.clear();
        self.strangers.clear();
        self.broods.clear();
    }

    /// Empties the string, for so many entries and parameters, of modules of these broods, at an instant.
    pub(super) fn begin(&mut self, time: f64, now: SimTime, broods: &Broods, extent: (usize, usize)) {
        self.reset(time);
        self.now = now;
        self.entries.reserve(extent.0);
        self.parameters.reserve(extent.1);
        self.broods.copy(broods);
    }

    /// Appends a module.
    pub fn push(
        &mut self,
        kind: KindId,
        parameters: impl IntoIterator<Item = f64>,
        age: f64,
        lineage: Lineage,
    ) {
        let place = match kind.is_bracket() {
            true => NO_BROOD,
            false => {
                self.strangers.push((self.now.after(-age), lineage));
                self.strangers.len() as u32 - 1
            }
        };
        let first = self.parameters.len() as u32;
        self.parameters.extend(parameters);
        self.version = None;
        self.entries.push(Entry { kind, first, brood: NO_BROOD, place });
    }

    /// Appends a module of a brood; returns the place of its first parameter.
    pub(super) fn push_known(&mut self, kind: KindId, brood: u32, place: u16, parameters: &[f64]) -> usize {
        let first = self.parameters.len();
        self.parameters.extend(parameters);
        self.entries.push(Entry { kind, first: first as u32, brood, place: u32::from(place) });
        first
    }

    pub(super) fn push_bracket(&mut self, kind: KindId) {
        let first = self.parameters.len() as u32;
        self.entries.push(Entry { kind, first, brood: NO_BROOD, place: NO_BROOD });
    }

    /// Sets the time that the string shows, and the instant that ages are counted to.
    pub fn show(&mut self, time: f64, now: SimTime) {
        (self.time, self.now) = (time, now);
    }

    /// Which modules these are, if a simulation has written them.
    pub fn version(&self) -> Option<Version> {
        self.version
    }

    /// Sets the version; changes of the string unset it.
    pub fn set_version(&mut self, version: Version) {
        self.version = Some(version);
    }

    /// The parameters of all modules, to be set by who has written them.
    pub fn parameters_mut(&mut self) -> &mut [f64] {
        &mut self.parameters
    }

    /// Number of modules, brackets included.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True if there are no modules and no brackets.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The module or bracket at a place in string order, from 0. Panics beyond [`len`](ModuleString::len).
    pub fn get(&self, index: usize) -> Module<'_> {
        let Entry { kind, first, brood, place } = self.entries[index];
        let end = self.entries.get(index + 1).map_or(self.parameters.len(), |next| next.first as usize);
        let (birth, lineage) = match (brood, place) {
            // Brackets are no modules, have no identity, and are of no age.
            (NO_BROOD, NO_BROOD) => (self.now, Lineage::of_axiom(0)),
            (NO_BROOD, stranger) => self.strangers[stranger as usize],
            _ => (self.broods.birth(brood), self.broods.lineage(brood, place as u16)),
        };
        let parameters = &self.parameters[first as usize..end];
        Module { kind, parameters, age: self.now.since(birth).max(0.0), lineage }
    }

    /// All modules and brackets in string order.
    pub fn iter(&self) -> impl Iterator<Item = Module<'_>> {
        (0..self.len()).map(|i| self.get(i))
    }
}
