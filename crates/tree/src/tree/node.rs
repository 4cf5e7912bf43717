//! The record of a module or of a branch, and the links between them.

use dlsys_model::KindId;

/// The neighbour before or after on an axis: a module or a branch, by its slot; at an end of the axis, the branch that the axis
/// belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link(pub u32);

impl Link {
    const END: u32 = 1 << 31;

    /// The end of a branch's axis.
    pub fn end_of(branch: u32) -> Link {
        Link(branch | Link::END)
    }

    /// The branch whose axis ends here.
    pub fn ended(self) -> Option<u32> {
        (self.0 & Link::END != 0).then_some(self.0 & !Link::END)
    }
}

/// The label of modules that have been given none.
pub const NO_LABEL: u16 = u16::MAX;

#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// `KindId::OPEN` for a branch.
    pub kind: KindId,
    /// Number of modules that the slot has had before.
    pub generation: u32,
    pub before: Link,
    pub after: Link,
    /// Of a module, where the parameters begin; of a branch, the first node of its axis.
    pub first: u32,
    pub group: u32,
    pub place: u16,
    pub label: u16,
}

impl Node {
    pub fn places(&self, arities: &[u32]) -> std::ops::Range<usize> {
        let first = self.first as usize;
        first..first + arities[self.kind.index()] as usize
    }
}
