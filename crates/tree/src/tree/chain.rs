//! Chains: a module that has been replaced by one module, which has been replaced by one module, and so on, in one change of the tree.

use super::{ModuleId, Node, Tree};
use crate::{Family, SimTime};
use dlsys_model::KindId;

/// The last module of a chain.
#[derive(Clone, Copy, Debug)]
pub struct LastOfChain<'a> {
    /// Its kind.
    pub kind: KindId,
    /// All its parameters, hidden ones last.
    pub arguments: &'a [f64],
    /// Time at which the last production made it.
    pub birth: SimTime,
    /// The common part of the lineages of the successor of that production.
    pub family: Family,
    /// Its label ([`Tree::label`]).
    pub label: u16,
    /// Number of productions that led to it, at least one.
    pub productions: u32,
}

impl Tree {
    /// Puts the last module of a chain into the slot of the first, as that many calls of [`Tree::replace`] do. The links of its
    /// neighbours stay valid, so that their memory is not touched.
    pub fn replace_chain(&mut self, slot: u32, last: &LastOfChain) -> ModuleId {
        self.groups.leave(self.nodes[slot as usize].group);
        self.vacate(slot);
        let first = self.store(last.arguments);
        let group = self.groups.begin(last.family, last.birth, 0);
        self.groups.count(group, 1);
        let node = &mut self.nodes[slot as usize];
        let generation = node.generation.wrapping_add(last.productions - 1);
        let (kind, label) = (last.kind, last.label);
        *node = Node { kind, first, group, place: 0, label, generation, ..*node };
        ModuleId { slot, generation }
    }
}
