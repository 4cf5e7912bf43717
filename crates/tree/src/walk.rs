//! String order: all modules and brackets, one after another.

use super::tree::{Link, TRUNK};
use super::{ModuleId, ModuleString, SimTime, Tree};
use dlsys_model::KindId;

/// One step of a walk in string order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visit {
    /// A module.
    Module(ModuleId),
    /// The start of a branch: `[`.
    Open,
    /// The end of a branch: `]`.
    Close,
}

impl Tree {
    /// All modules and brackets in string order.
    pub fn walk(&self) -> Walk<'_> {
        Walk::new(self, Link(self.nodes[TRUNK as usize].first))
    }

    /// Writes the structure to a string, with the parameters that the tree has. `note` is called for each module with its label and
    /// the place at which its parameters begin in the string.
    pub fn write(
        &self,
        time: f64,
        now: SimTime,
        out: &mut ModuleString,
        mut note: impl FnMut(ModuleId, u16, usize),
    ) {
        out.begin(time, now, &self.groups, self.extent());
        let mut next = Link(self.nodes[TRUNK as usize].first);
        loop {
            match next.ended() {
                Some(TRUNK) => return,
                Some(branch) => {
                    out.push_bracket(KindId::CLOSE);
                    next = self.nodes[branch as usize].after;
                }
                None => {
                    let node = &self.nodes[next.0 as usize];
                    if node.kind == KindId::OPEN {
                        out.push_bracket(KindId::OPEN);
                        next = Link(node.first);
                        continue;
                    }
                    let places = node.places(&self.shown);
                    let to = out.push_known(node.kind, node.group, node.place, &self.values[places]);
                    let id = ModuleId::of_parts(next.0, node.generation);
                    note(id, node.label, to);
                    next = node.after;
                }
            }
        }
    }
}

/// Iterator of [`Tree::walk`].
pub struct Walk<'t> {
    tree: &'t Tree,
    next: Link,
}

impl<'t> Walk<'t> {
    pub(super) fn new(tree: &'t Tree, next: Link) -> Walk<'t> {
        Walk { tree, next }
    }
}

impl Iterator for Walk<'_> {
    type Item = Visit;

    fn next(&mut self) -> Option<Visit> {
        match self.next.ended() {
            Some(TRUNK) => None,
            Some(branch) => {
                self.next = self.tree.nodes[branch as usize].after;
                Some(Visit::Close)
            }
            None => {
                let slot = self.next.0;
                let node = &self.tree.nodes[slot as usize];
                if node.kind == KindId::OPEN {
                    self.next = Link(node.first);
                    return Some(Visit::Open);
                }
                self.next = node.after;
                Some(Visit::Module(ModuleId::of_parts(slot, node.generation)))
            }
        }
    }
}
