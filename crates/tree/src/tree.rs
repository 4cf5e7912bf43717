//! The linked tree of modules: axes of modules and branches, and the operations of productions on them.
//!
//! An axis is a doubly linked list of modules and branches; a branch holds an axis of its own. So a
//! production costs as much as it replaces, and string order is a walk. Slots are used again, and a
//! [`ModuleId`] contains the generation of its slot, so that an old id never means a new module.
//!
//! A module is a record of 28 bytes and its parameters; its birth and lineage are stored with those of its siblings
//! (`siblings.rs`). At a million modules, memory access dominates all costs.

mod chain;
mod node;

use std::collections::TryReserveError;

use smallvec::SmallVec;

use super::siblings::{NO_GROUP, SiblingGroups};
use super::{Family, Lineage, SimTime, room};
pub use chain::LastOfChain;
use dlsys_model::KindId;
pub use node::NO_LABEL;
pub(super) use node::{Link, Node};

/// The branch that holds the main axis.
pub(super) const TRUNK: u32 = 0;

/// A module in a [`Tree`], while it lives. The default is none: the slot of the trunk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ModuleId {
    slot: u32,
    generation: u32,
}

impl ModuleId {
    /// Small number, unique among living modules.
    #[inline]
    pub fn slot(self) -> usize {
        self.slot as usize
    }

    /// Number of modules that have had the slot before: it tells the modules of one slot apart.
    #[inline]
    pub fn generation(self) -> u32 {
        self.generation
    }

    pub(super) fn of_parts(slot: u32, generation: u32) -> ModuleId {
        ModuleId { slot, generation }
    }
}

/// A module of a [`Tree`]: all that the tree stores of it, read at once.
#[derive(Clone, Copy, Debug)]
pub struct ModuleView<'t> {
    /// Its id.
    pub id: ModuleId,
    /// Its kind.
    pub kind: KindId,
    /// Its label ([`Tree::label`]).
    pub label: u16,
    /// Time at which a production made it.
    pub birth: SimTime,
    /// All its parameters, hidden ones last, with the values that the tree has of them.
    pub values: &'t [f64],
    /// Sibling group, and place in it.
    member: (u32, u16),
}

/// The modules alive, their order and their parameters.
#[derive(Clone, Debug)]
pub struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) groups: SiblingGroups,
    free: Vec<u32>,
    pub(super) values: Vec<f64>,
    /// Free blocks of `values`, by their length.
    free_values: Vec<Vec<u32>>,
    pub(super) arities: Vec<u32>,
    /// Number of parameters of each kind that observers see: hidden parameters are the last ones.
    pub(super) shown: Vec<u32>,
    modules: usize,
}

impl Tree {
    /// An empty tree; `arities` gives the number of parameters of each kind, `shown` the number of those that observers see.
    pub fn new(arities: Vec<u32>, shown: Vec<u32>) -> Tree {
        let trunk = Node {
            kind: KindId::OPEN,
            generation: 0,
            before: Link::end_of(TRUNK),
            after: Link::end_of(TRUNK),
            first: Link::end_of(TRUNK).0,
            label: NO_LABEL,
            group: NO_GROUP,
            place: 0,
        };
        Tree {
            nodes: vec![trunk],
            groups: SiblingGroups::default(),
            free: Vec::new(),
            values: Vec::new(),
            free_values: Vec::new(),
            arities,
            shown,
            modules: 0,
        }
    }

    /// Number of modules, brackets not counted.
    pub fn len(&self) -> usize {
        self.modules
    }

    /// True if no module is alive.
    pub fn is_empty(&self) -> bool {
        self.modules == 0
    }

    /// Number of modules and brackets, and of parameters at most.
    pub fn extent(&self) -> (usize, usize) {
        let branches = self.nodes.len() - 1 - self.free.len() - self.modules;
        (self.modules + 2 * branches, self.values.len())
    }

    /// Bytes of memory, about.
    pub fn size(&self) -> usize {
        size_of_val(&self.nodes[..])
            + size_of_val(&self.values[..])
            + self.groups.size()
            + 4 * self.free.len()
    }

    /// Slots that have ever been used; `ModuleId::slot` is below this.
    pub fn slots(&self) -> usize {
        self.nodes.len()
    }

    /// True if the module has not been replaced.
    #[inline]
    pub fn is_alive(&self, id: ModuleId) -> bool {
        self.nodes[id.slot()].generation == id.generation
    }

    pub(super) fn node(&self, id: ModuleId) -> &Node {
        let node = &self.nodes[id.slot()];
        debug_assert_eq!(node.generation, id.generation, "the module is no longer alive");
        node
    }

    /// The module in a slot.
    #[inline]
    pub fn id(&self, slot: u32) -> ModuleId {
        ModuleId { slot, generation: self.nodes[slot as usize].generation }
    }

    /// What is read first of the module in a slot, to be fetched from memory ahead.
    #[inline]
    pub fn record(&self, slot: usize) -> Option<&(impl Sized + use<>)> {
        self.nodes.get(slot)
    }

    /// All that is stored of the module in a slot.
    #[inline]
    pub fn look(&self, slot: u32) -> ModuleView<'_> {
        let node = &self.nodes[slot as usize];
        let Node { kind, label, group, place, generation, .. } = *node;
        let (birth, values) = (self.groups.birth(group), &self.values[node.places(&self.arities)]);
        ModuleView { id: ModuleId { slot, generation }, kind, label, birth, values, member: (group, place) }
    }

    /// The lineage of a module that was read with [`Tree::look`].
    pub fn lineage_of(&self, look: &ModuleView) -> Lineage {
        self.groups.lineage(look.member.0, look.member.1)
    }

    /// The kind of a living module.
    #[inline]
    pub fn kind(&self, id: ModuleId) -> KindId {
        self.node(id).kind
    }

    /// The time at which a production made a living module.
    #[inline]
    pub fn birth(&self, id: ModuleId) -> SimTime {
        self.groups.birth(self.node(id).group)
    }

    /// The lineage of a living module.
    pub fn lineage(&self, id: ModuleId) -> Lineage {
        let node = self.node(id);
        self.groups.lineage(node.group, node.place)
    }

    /// A number that the owner of the tree has given to a module; [`NO_LABEL`] from birth on.
    #[inline]
    pub fn label(&self, id: ModuleId) -> u16 {
        self.node(id).label
    }

    /// Gives a living module a label.
    pub fn set_label(&mut self, id: ModuleId, label: u16) {
        self.nodes[id.slot()].label = label;
    }

    /// The label of a module; None if it has been replaced.
    #[inline]
    pub fn label_if_alive(&self, id: ModuleId) -> Option<u16> {
        let node = &self.nodes[id.slot()];
        (node.generation == id.generation).then_some(node.label)
    }

    /// Places of a module's parameters in [`Tree::values`].
    #[inline]
    pub fn places(&self, id: ModuleId) -> std::ops::Range<usize> {
        self.node(id).places(&self.arities)
    }

    /// All parameters of a living module, hidden ones last.
    #[inline]
    pub fn parameters(&self, id: ModuleId) -> &[f64] {
        &self.values[self.places(id)]
    }

    /// Number of a module's parameters that observers see.
    pub fn shown(&self, id: ModuleId) -> usize {
        self.shown[self.node(id).kind.index()] as usize
    }

    /// All parameters of all modules; a module's stand at [`Tree::places`].
    #[inline]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Sets the parameter at a place of [`Tree::values`].
    #[inline]
    pub fn set_value(&mut self, place: usize, value: f64) {
        self.values[place] = value;
    }

    /// Puts a node into a free slot.
    fn allocate(&mut self, mut node: Node) -> ModuleId {
        match self.free.pop() {
            Some(slot) => {
                let place = &mut self.nodes[slot as usize];
                node.generation = place.generation;
                *place = node;
                ModuleId { slot, generation: node.generation }
            }
            None => {
                room::push(&mut self.nodes, node);
                ModuleId { slot: self.nodes.len() as u32 - 1, generation: 0 }
            }
        }
    }

    /// Stores values, and returns the place of the first.
    fn store(&mut self, values: &[f64]) -> u32 {
        if values.is_empty() {
            return 0;
        }
        match self.free_values.get_mut(values.len()).and_then(Vec::pop) {
            Some(first) => {
                self.values[first as usize..first as usize + values.len()].copy_from_slice(values);
                first
            }
            None => {
                room::reserve(&mut self.values, values.len());
                self.values.extend_from_slice(values);
                (self.values.len() - values.len()) as u32
            }
        }
    }

    /// True if modules of these kinds can be added without an allocation.
    #[inline]
    pub fn has_room(&self, kinds: &[KindId], width: usize) -> bool {
        let (nodes, values) = (&self.nodes, &self.values);
        nodes.capacity() - nodes.len() + self.free.len() >= kinds.len()
            && (values.capacity() - values.len() >= width || self.has_free_values(kinds))
    }

    /// True if the parameters of these kinds fit into freed blocks.
    fn has_free_values(&self, kinds: &[KindId]) -> bool {
        kinds.iter().filter(|kind| !kind.is_bracket()).all(|kind| {
            let arity = self.arities[kind.index()] as usize;
            arity == 0 || self.free_values.get(arity).is_some_and(|free| free.len() >= kinds.len())
        })
    }

    /// Allocates memory for modules of these kinds, in the steps in which vectors grow.
    ///
    /// # Errors
    ///
    /// There is not enough memory.
    pub fn make_room(&mut self, kinds: &[KindId], width: usize) -> Result<(), TryReserveError> {
        room::try_reserve(&mut self.nodes, kinds.len().saturating_sub(self.free.len()))?;
        if self.has_free_values(kinds) { Ok(()) } else { room::try_reserve(&mut self.values, width) }
    }

    fn release(&mut self, slot: u32) {
        self.vacate(slot);
        self.free.push(slot);
    }

    /// Removes the module from a slot, without freeing the slot.
    fn vacate(&mut self, slot: u32) {
        let node = &mut self.nodes[slot as usize];
        node.generation = node.generation.wrapping_add(1);
        let (arity, first) = (self.arities[node.kind.index()] as usize, node.first);
        if arity > 0 {
            if self.free_values.len() <= arity {
                self.free_values.resize(arity + 1, Vec::new());
            }
            self.free_values[arity].push(first);
        }
    }

    /// Sets what comes after `before`, which may be the beginning of an axis.
    fn link_forward(&mut self, before: Link, after: Link) {
        match before.ended() {
            Some(branch) => self.nodes[branch as usize].first = after.0,
            None => self.nodes[before.0 as usize].after = after,
        }
    }

    /// Appends a string of modules of these kinds, brackets included, at the end of the main axis, in time proportional to its length. The new modules are added to
    /// `made`.
    pub fn append(
        &mut self,
        kinds: &[KindId],
        arguments: &[f64],
        birth: SimTime,
        family: Family,
        made: &mut Vec<ModuleId>,
    ) {
        room::reserve(&mut self.nodes, kinds.len());
        room::reserve(&mut self.values, arguments.len());
        room::reserve(made, kinds.len());
        let mut last = Link::end_of(TRUNK);
        let mut next = Link(self.nodes[TRUNK as usize].first);
        while next.ended().is_none() {
            (last, next) = (next, self.nodes[next.0 as usize].after);
        }
        self.insert(last, next, kinds, arguments, birth, family, made);
    }

    /// Replaces a module by a string of modules of these kinds, brackets included.
    pub fn replace(
        &mut self,
        id: ModuleId,
        kinds: &[KindId],
        arguments: &[f64],
        birth: SimTime,
        family: Family,
        made: &mut Vec<ModuleId>,
    ) {
        if let [kind] = *kinds
            && kind != KindId::OPEN
        {
            let last = LastOfChain { kind, arguments, birth, family, label: NO_LABEL, productions: 1 };
            return made.push(self.replace_chain(id.slot, &last));
        }
        let Node { before, after, group, .. } = *self.node(id);
        self.groups.leave(group);
        self.release(id.slot);
        self.modules -= 1;
        self.insert(before, after, kinds, arguments, birth, family, made);
    }

    /// Removes a module and all that follows on its axis, with all branches. Slots for which `keep` is true stay empty until they are
    /// freed with [`Tree::free_slot`].
    pub fn cut(&mut self, id: ModuleId, keep: impl Fn(u32) -> bool) {
        let before = self.node(id).before;
        let mut axes = vec![Link(id.slot)];
        let mut end = None;
        while let Some(mut at) = axes.pop() {
            while at.ended().is_none() {
                let Node { kind, after, first, group, .. } = self.nodes[at.0 as usize];
                if kind == KindId::OPEN {
                    axes.push(Link(first));
                } else {
                    self.groups.leave(group);
                    self.modules -= 1;
                }
                if keep(at.0) {
                    self.vacate(at.0)
                } else {
                    self.release(at.0)
                }
                at = after;
            }
            end.get_or_insert(at);
        }
        self.link_forward(before, end.expect("an axis has an end"));
    }

    /// Frees a slot that was kept when its module was removed.
    pub fn free_slot(&mut self, slot: u32) {
        self.free.push(slot);
    }

    /// Puts a string between two neighbours.
    #[allow(clippy::too_many_arguments)]
    fn insert(
        &mut self,
        mut before: Link,
        after: Link,
        kinds: &[KindId],
        mut arguments: &[f64],
        birth: SimTime,
        family: Family,
        made: &mut Vec<ModuleId>,
    ) {
        // The branches that are open.
        let mut branches: SmallVec<[u32; 8]> = SmallVec::new();
        let mut place = 0;
        // Of the present group; a very long successor is several.
        let (mut group, mut members) = (NO_GROUP, 0);
        for &kind in kinds {
            if kind == KindId::CLOSE {
                let branch = branches.pop().expect("brackets match: the front end saw to it");
                self.link_forward(before, Link::end_of(branch));
                before = Link(branch);
                continue;
            }
            // What is after it is not known yet.
            let mut node = Node {
                kind,
                generation: 0,
                before,
                after: before,
                first: 0,
                label: NO_LABEL,
                group: NO_GROUP,
                place: 0,
            };
            if kind == KindId::OPEN {
                let slot = self.allocate(node).slot;
                self.link_forward(before, Link(slot));
                branches.push(slot);
                before = Link::end_of(slot);
                continue;
            }
            if group == NO_GROUP || members == u16::MAX {
                self.groups.count(group, members);
                group = self.groups.begin(family, birth, place);
                members = 0;
            }
            let own;
            (own, arguments) = arguments.split_at(self.arities[kind.index()] as usize);
            (node.first, node.group, node.place) = (self.store(own), group, members);
            let id = self.allocate(node);
            self.link_forward(before, Link(id.slot));
            members += 1;
            place += 1;
            before = Link(id.slot);
            made.push(id);
        }
        self.modules += place as usize;
        self.groups.count(group, members);
        self.link_forward(before, after);
        if after.ended().is_none() {
            self.nodes[after.0 as usize].before = before;
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
