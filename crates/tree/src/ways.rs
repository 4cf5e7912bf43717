//! Neighbours in the tree: left and right context, children, and all that follows a module.

use smallvec::SmallVec;

use super::tree::{Link, TRUNK};
use super::{ModuleId, Tree, Visit, Walk};
use dlsys_model::KindId;

impl Tree {
    /// The nearest module before this one on the path to the root, finished side branches and modules
    /// of skipped kinds passed over.
    pub fn left(&self, id: ModuleId, skipped: impl Fn(KindId) -> bool) -> Option<ModuleId> {
        let mut at = id.slot() as u32;
        loop {
            let before = self.nodes[at as usize].before;
            at = match before.ended() {
                Some(TRUNK) => return None,
                // The first of a branch grows from what stands before the branch.
                Some(branch) => branch,
                None => {
                    let kind = self.nodes[before.0 as usize].kind;
                    if kind != KindId::OPEN && !skipped(kind) {
                        return Some(self.id(before.0));
                    }
                    before.0
                }
            };
        }
    }

    /// The next module on the same axis, side branches and modules of skipped kinds passed over.
    pub fn right(&self, id: ModuleId, skipped: impl Fn(KindId) -> bool) -> Option<ModuleId> {
        let mut at = self.node(id).after;
        while at.ended().is_none() {
            let node = &self.nodes[at.0 as usize];
            if node.kind != KindId::OPEN && !skipped(node.kind) {
                return Some(self.id(at.0));
            }
            at = node.after;
        }
        None
    }

    /// The modules attached to this one, in string order, appended to `out`: the first of each side branch, then the next
    /// on the same axis, modules of skipped kinds passed over. Returns whether the last one is on the axis.
    pub fn children(&self, id: ModuleId, skipped: impl Fn(KindId) -> bool, out: &mut Vec<ModuleId>) -> bool {
        let mut at = self.node(id).after;
        // The branches that are open.
        let mut branches: SmallVec<[u32; 8]> = SmallVec::new();
        loop {
            if at.ended().is_some() {
                let Some(branch) = branches.pop() else { return false };
                at = self.nodes[branch as usize].after;
                continue;
            }
            let node = &self.nodes[at.0 as usize];
            if node.kind == KindId::OPEN {
                branches.push(at.0);
                at = Link(node.first);
            } else if skipped(node.kind) {
                at = node.after;
            } else {
                out.push(self.id(at.0));
                // What follows on the axis of this one is attached to it.
                let Some(branch) = branches.pop() else { return true };
                at = self.nodes[branch as usize].after;
            }
        }
    }

    /// True if a module of a certain kind stands after this one on its axis, or on a branch of that.
    pub fn is_followed(&self, id: ModuleId, wanted: impl Fn(KindId) -> bool) -> bool {
        let mut depth = 0usize;
        for visit in Walk::new(self, self.node(id).after) {
            match visit {
                Visit::Module(id) if wanted(self.kind(id)) => return true,
                Visit::Module(_) => {}
                Visit::Open => depth += 1,
                Visit::Close if depth == 0 => return false,
                Visit::Close => depth -= 1,
            }
        }
        false
    }

    /// The modules that follow on the axis of this one, with all branches, in string order.
    pub fn following(&self, id: ModuleId) -> Vec<ModuleId> {
        let (mut depth, mut out) = (0usize, Vec::new());
        for visit in Walk::new(self, self.node(id).after) {
            match visit {
                Visit::Module(id) => out.push(id),
                Visit::Open => depth += 1,
                Visit::Close if depth == 0 => break,
                Visit::Close => depth -= 1,
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::super::tree::tests::grown;
    use super::*;

    #[test]
    fn children_are_the_first_of_each_branch_and_the_next_on_the_axis() {
        let children = |text: &str| {
            let (kinds, tree) = grown(text, &[]);
            let Some(Visit::Module(first)) = tree.walk().next() else { panic!("a module comes first") };
            let mut all = Vec::new();
            let on_axis = tree.children(first, |kind| kinds.get(kind).name == "x", &mut all);
            let names: String = all.iter().map(|id| kinds.get(tree.kind(*id)).name.clone()).collect();
            (names, on_axis)
        };
        let is = |names: &str, on_axis| (names.to_owned(), on_axis);
        assert_eq!(children("A[B[C]D][xE[F]][]xG[H]I"), is("BEG", true));
        assert_eq!(children("A[[B]C][x][[xD]]"), is("BCD", false));
        assert_eq!(children("A"), is("", false));
    }

    #[test]
    fn context_follows_the_axes() {
        let (kinds, tree) = grown("A[B[C]]D[E]", &[]);
        let name = |id: Option<ModuleId>| id.map(|id| kinds.get(tree.kind(id)).name.clone());
        let all: Vec<_> = tree
            .walk()
            .filter_map(|v| match v {
                Visit::Module(id) => Some(id),
                _ => None,
            })
            .map(|id| (name(Some(id)), name(tree.left(id, |_| false)), name(tree.right(id, |_| false))))
            .collect();
        let some = |s: &str| Some(s.to_owned());
        assert_eq!(
            all,
            [
                (some("A"), None, some("D")),
                (some("B"), some("A"), None),
                (some("C"), some("B"), None),
                (some("D"), some("A"), None),
                (some("E"), some("D"), None),
            ]
        );
    }
}
