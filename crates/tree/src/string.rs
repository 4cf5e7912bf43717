//! The string of modules: the structure at one instant, in string order, as observers get it.

use super::siblings::{NO_GROUP, SiblingGroups};
use super::{Family, Lineage, SimTime};
use dlsys_model::KindId;

/// All modules alive at `time`, in string order, brackets included.
///
/// Parameters are stored in a single array: a string of a million modules is a few allocations, and is filled again for the next
/// frame.
///
/// The birth of a module is stored, not its age: from one frame to the next, a string of the same modules changes in its moving
/// parameters only.
#[derive(Clone, Debug, Default)]
pub struct ModuleString {
    /// Time of the simulation.
    pub time: f64,
    /// The instant at which ages end.
    now: SimTime,
    entries: Vec<StringEntry>,
    parameters: Vec<f64>,
    groups: SiblingGroups,
    /// Birth and lineage of modules that belong to no group of a tree.
    ungrouped: Vec<(SimTime, Lineage)>,
    version: Option<Version>,
    /// The limit of modules of the run that has written the string.
    run_limit: usize,
}

/// Which modules a string is made of: the same number means the same ones, in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    /// Number of the simulation in this process.
    pub source: u64,
    /// Grows with every change of the structure.
    pub structure: u64,
}

/// A module or bracket. Birth and lineage are those of its group and place.
#[derive(Clone, Copy, Debug)]
struct StringEntry {
    kind: KindId,
    /// Where the parameters begin. As in a tree, there are fewer than 2^32 of them.
    first: u32,
    group: u32,
    /// Place in the group; for a module of no group, in `ungrouped`; `NO_GROUP` for a bracket.
    place: u32,
}

/// One module, or one bracket, of a [`ModuleString`].
#[derive(Clone, Copy, Debug)]
pub struct Module<'a> {
    /// Kind of the module; [`KindId::OPEN`] or [`KindId::CLOSE`] for a bracket.
    pub kind: KindId,
    /// Parameters shown to observers, in their order in the model.
    pub parameters: &'a [f64],
    /// Time since a production made the module, in units of simulated time; 0 for a bracket.
    pub age: f64,
    /// Identity by descent; without meaning for a bracket.
    pub lineage: Lineage,
}

impl ModuleString {
    /// Modules that a drawing may have in any case: a low limit of a run is meant for growth, and a module may draw many.
    pub const DRAWN: usize = 10_000_000;

    /// Empties the string and sets its time, keeping its memory.
    pub fn reset(&mut self, time: f64) {
        (self.time, self.now, self.version) = (time, SimTime::ZERO, None);
        self.entries.clear();
        self.parameters.clear();
        self.ungrouped.clear();
        self.groups.clear();
    }

    /// Empties the string and reserves memory for `extent`, the numbers of entries and of parameters; ages end at `now`.
    pub(super) fn begin(&mut self, time: f64, now: SimTime, groups: &SiblingGroups, extent: (usize, usize)) {
        self.reset(time);
        self.now = now;
        self.entries.reserve(extent.0);
        self.parameters.reserve(extent.1);
        self.groups.copy(groups);
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
            true => NO_GROUP,
            false => {
                self.ungrouped.push((self.now.after(-age), lineage));
                self.ungrouped.len() as u32 - 1
            }
        };
        let first = self.parameters.len() as u32;
        self.parameters.extend(parameters);
        self.version = None;
        self.entries.push(StringEntry { kind, first, group: NO_GROUP, place });
    }

    /// Appends a module of a group; returns the place of its first parameter.
    pub(super) fn push_known(&mut self, kind: KindId, group: u32, place: u16, parameters: &[f64]) -> usize {
        let first = self.parameters.len();
        self.parameters.extend(parameters);
        self.entries.push(StringEntry { kind, first: first as u32, group, place: u32::from(place) });
        first
    }

    pub(super) fn push_bracket(&mut self, kind: KindId) {
        let first = self.parameters.len() as u32;
        self.entries.push(StringEntry { kind, first, group: NO_GROUP, place: NO_GROUP });
    }

    /// Sets the time that the string shows, and the instant at which ages end.
    pub fn show(&mut self, time: f64, now: SimTime) {
        (self.time, self.now) = (time, now);
    }

    /// The version of the structure, if a simulation has written the string.
    pub fn version(&self) -> Option<Version> {
        self.version
    }

    /// True if a simulation has written both strings, and they have the same modules with the same parameters, bit for bit. Times and ages may
    /// differ.
    pub fn has_same_modules(&self, other: &ModuleString) -> bool {
        fn bits(string: &ModuleString) -> impl Iterator<Item = u64> {
            string.parameters.iter().map(|value| value.to_bits())
        }
        self.version.is_some() && self.version == other.version && bits(self).eq(bits(other))
    }

    /// Most modules that a drawing of this string may have, those that interpretations make included: the limit of the run that has
    /// written it, if that is greater than [`DRAWN`](ModuleString::DRAWN).
    pub fn drawn_limit(&self) -> usize {
        self.run_limit.max(ModuleString::DRAWN)
    }

    /// Sets the limit of modules of the run that the string is of.
    pub fn set_run_limit(&mut self, limit: usize) {
        self.run_limit = limit;
    }

    /// Sets the version; changes of the string unset it.
    pub fn set_version(&mut self, version: Version) {
        self.version = Some(version);
    }

    /// The parameters of all modules, one after another, for the writer of the string.
    pub fn parameters_mut(&mut self) -> &mut [f64] {
        &mut self.parameters
    }

    /// Bytes of memory, about.
    pub fn footprint(&self) -> usize {
        size_of_val(&*self.entries)
            + size_of_val(&*self.parameters)
            + size_of_val(&*self.ungrouped)
            + self.groups.size()
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
        self.module(index, &mut None)
    }

    /// All modules and brackets in string order.
    pub fn iter(&self) -> impl Iterator<Item = Module<'_>> {
        let mut siblings = None;
        (0..self.len()).map(move |i| self.module(i, &mut siblings))
    }

    /// The module at a place, given the group of one before it: most have siblings beside them.
    #[inline]
    fn module(&self, index: usize, siblings: &mut Option<Siblings>) -> Module<'_> {
        let StringEntry { kind, first, group, place } = self.entries[index];
        let end = self.entries.get(index + 1).map_or(self.parameters.len(), |next| next.first as usize);
        let parameters = &self.parameters[first as usize..end];
        let (age, lineage) = match (group, place) {
            // Brackets are no modules: they have no identity and no age.
            (NO_GROUP, NO_GROUP) => (0.0, Lineage::of_axiom(0)),
            (NO_GROUP, place) => {
                let (birth, lineage) = self.ungrouped[place as usize];
                (self.age_of(birth), lineage)
            }
            _ => {
                let known = match siblings {
                    Some(known) if known.group == group => *known,
                    _ => {
                        let (family, first) = self.groups.family(group);
                        let age = self.age_of(self.groups.birth(group));
                        *siblings.insert(Siblings { group, family, first, age })
                    }
                };
                (known.age, known.family.child(known.first + place as usize))
            }
        };
        Module { kind, parameters, age, lineage }
    }

    fn age_of(&self, birth: SimTime) -> f64 {
        self.now.since(birth).max(0.0)
    }
}

/// What the modules of a group have in common.
#[derive(Clone, Copy)]
struct Siblings {
    group: u32,
    family: Family,
    /// The place in the successor at which the group begins.
    first: usize,
    age: f64,
}
