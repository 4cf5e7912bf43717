//! The growing structure: modules on axes, axes on modules.
//!
//! An axis is a doubly linked list of modules and branches; a branch holds an axis of its own. So a
//! production costs what it replaces, and string order is a walk. Slots are used again, and a
//! [`ModuleId`] carries the generation of its slot, so that an old id never means a new module.

use super::{Instant, Lineage, ModuleString};
use crate::model::{KindId, Successor};

const NONE: u32 = u32::MAX;
/// The branch that holds the main axis.
const TRUNK: u32 = 0;

/// A module in a [`Tree`], while it lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ModuleId {
    slot: u32,
    generation: u32,
}

impl ModuleId {
    /// Small number, unique among living modules.
    pub fn slot(self) -> usize {
        self.slot as usize
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// `KindId::OPEN` for a branch.
    kind: KindId,
    generation: u32,
    /// The branch whose axis this is on.
    parent: u32,
    before: u32,
    after: u32,
    /// Ends of a branch's own axis.
    first: u32,
    last: u32,
    /// Where the parameters begin.
    values: u32,
    birth: Instant,
    lineage: Lineage,
}

/// The modules alive, their order and their parameters.
#[derive(Clone, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    free: Vec<u32>,
    values: Vec<f64>,
    /// Free blocks of `values`, by their length.
    free_values: Vec<Vec<u32>>,
    arities: Vec<u32>,
    modules: usize,
}

/// What a walk in string order meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visit {
    Module(ModuleId),
    Open,
    Close,
}

impl Tree {
    /// An empty structure; `arities` gives the number of parameters of each kind.
    pub fn new(arities: Vec<u32>) -> Tree {
        let trunk = Node {
            kind: KindId::OPEN,
            generation: 0,
            parent: NONE,
            before: NONE,
            after: NONE,
            first: NONE,
            last: NONE,
            values: 0,
            birth: Instant::ZERO,
            lineage: Lineage::of_axiom(0),
        };
        Tree {
            nodes: vec![trunk],
            free: Vec::new(),
            values: Vec::new(),
            free_values: Vec::new(),
            arities,
            modules: 0,
        }
    }

    /// Number of modules, brackets not counted.
    pub fn len(&self) -> usize {
        self.modules
    }

    pub fn is_empty(&self) -> bool {
        self.modules == 0
    }

    /// Slots that have ever been used; `ModuleId::slot` is below this.
    pub fn slots(&self) -> usize {
        self.nodes.len()
    }

    pub fn is_alive(&self, id: ModuleId) -> bool {
        self.nodes[id.slot()].generation == id.generation
    }

    fn node(&self, id: ModuleId) -> &Node {
        let node = &self.nodes[id.slot()];
        debug_assert_eq!(node.generation, id.generation, "the module is no longer alive");
        node
    }

    fn id(&self, slot: u32) -> ModuleId {
        ModuleId { slot, generation: self.nodes[slot as usize].generation }
    }

    pub fn kind(&self, id: ModuleId) -> KindId {
        self.node(id).kind
    }

    pub fn birth(&self, id: ModuleId) -> Instant {
        self.node(id).birth
    }

    pub fn lineage(&self, id: ModuleId) -> Lineage {
        self.node(id).lineage
    }

    /// Places of a module's parameters in [`Tree::values`].
    pub fn places(&self, id: ModuleId) -> std::ops::Range<usize> {
        let node = self.node(id);
        let first = node.values as usize;
        first..first + self.arities[node.kind.index()] as usize
    }

    pub fn parameters(&self, id: ModuleId) -> &[f64] {
        &self.values[self.places(id)]
    }

    /// All parameters of all modules; a module's stand at [`Tree::places`].
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    pub fn set_value(&mut self, place: usize, value: f64) {
        self.values[place] = value;
    }

    fn allocate(&mut self, kind: KindId, parent: u32, birth: Instant, lineage: Lineage) -> u32 {
        let arity = self.arities[kind.index()] as usize;
        let values = match self.free_values.get_mut(arity).and_then(Vec::pop) {
            Some(place) if arity > 0 => place,
            _ => {
                self.values.resize(self.values.len() + arity, 0.0);
                (self.values.len() - arity) as u32
            }
        };
        let node = Node {
            kind,
            generation: 0,
            parent,
            before: NONE,
            after: NONE,
            first: NONE,
            last: NONE,
            values,
            birth,
            lineage,
        };
        match self.free.pop() {
            Some(slot) => {
                let generation = self.nodes[slot as usize].generation;
                self.nodes[slot as usize] = Node { generation, ..node };
                slot
            }
            None => {
                self.nodes.push(node);
                self.nodes.len() as u32 - 1
            }
        }
    }

    fn release(&mut self, slot: u32) {
        let node = &mut self.nodes[slot as usize];
        node.generation = node.generation.wrapping_add(1);
        let (arity, values) = (self.arities[node.kind.index()] as usize, node.values);
        self.free.push(slot);
        if arity > 0 {
            if self.free_values.len() <= arity {
                self.free_values.resize(arity + 1, Vec::new());
            }
            self.free_values[arity].push(values);
        }
    }

    /// Puts `slot` on its parent's axis between two neighbours.
    fn link(&mut self, slot: u32, before: u32, after: u32) {
        let parent = self.nodes[slot as usize].parent;
        let node = &mut self.nodes[slot as usize];
        (node.before, node.after) = (before, after);
        match before {
            NONE => self.nodes[parent as usize].first = slot,
            b => self.nodes[b as usize].after = slot,
        }
        match after {
            NONE => self.nodes[parent as usize].last = slot,
            a => self.nodes[a as usize].before = slot,
        }
    }

    /// Appends a string at the end of the main axis. `lineage` names the module at each place (from 0,
    /// brackets not counted). The new modules are added to `made`.
    pub fn append(
        &mut self,
        string: &Successor,
        arguments: &[f64],
        birth: Instant,
        lineage: impl Fn(usize) -> Lineage,
        made: &mut Vec<ModuleId>,
    ) {
        let last = self.nodes[TRUNK as usize].last;
        self.insert(TRUNK, last, NONE, string, arguments, birth, lineage, made);
    }

    /// Replaces a module by a string.
    pub fn replace(
        &mut self,
        id: ModuleId,
        string: &Successor,
        arguments: &[f64],
        birth: Instant,
        lineage: impl Fn(usize) -> Lineage,
        made: &mut Vec<ModuleId>,
    ) {
        let Node { parent, before, after, .. } = *self.node(id);
        match before {
            NONE => self.nodes[parent as usize].first = after,
            b => self.nodes[b as usize].after = after,
        }
        match after {
            NONE => self.nodes[parent as usize].last = before,
            a => self.nodes[a as usize].before = before,
        }
        self.release(id.slot);
        self.modules -= 1;
        self.insert(parent, before, after, string, arguments, birth, lineage, made);
    }

    #[allow(clippy::too_many_arguments)]
    fn insert(
        &mut self,
        mut parent: u32,
        mut before: u32,
        mut after: u32,
        string: &Successor,
        arguments: &[f64],
        birth: Instant,
        lineage: impl Fn(usize) -> Lineage,
        made: &mut Vec<ModuleId>,
    ) {
        // Where to go on after each branch that is open.
        let mut outer: Vec<(u32, u32, u32)> = Vec::new();
        let (mut place, mut next) = (0, 0);
        for &kind in &string.kinds {
            if kind == KindId::CLOSE {
                (parent, before, after) = outer.pop().expect("brackets match: the front end saw to it");
                continue;
            }
            let slot = self.allocate(kind, parent, birth, lineage(place));
            self.link(slot, before, after);
            if kind == KindId::OPEN {
                outer.push((parent, slot, after));
                (parent, before, after) = (slot, NONE, NONE);
                continue;
            }
            let id = self.id(slot);
            let places = self.places(id);
            let count = places.len();
            self.values[places].copy_from_slice(&arguments[next..next + count]);
            next += count;
            place += 1;
            before = slot;
            self.modules += 1;
            made.push(id);
        }
    }

    /// The nearest module before this one on the path to the root, finished side branches and modules
    /// of skipped kinds passed over.
    pub fn left(&self, id: ModuleId, skipped: impl Fn(KindId) -> bool) -> Option<ModuleId> {
        let mut at = id.slot;
        loop {
            let node = &self.nodes[at as usize];
            at = match (node.before, node.parent) {
                (NONE, NONE | TRUNK) => return None,
                // The first of a branch grows from what stands before the branch.
                (NONE, branch) => branch,
                (before, _) => {
                    let kind = self.nodes[before as usize].kind;
                    if kind != KindId::OPEN && !skipped(kind) {
                        return Some(self.id(before));
                    }
                    before
                }
            };
        }
    }

    /// The next module on the same axis, side branches and modules of skipped kinds passed over.
    pub fn right(&self, id: ModuleId, skipped: impl Fn(KindId) -> bool) -> Option<ModuleId> {
        let mut at = self.node(id).after;
        while at != NONE {
            let node = &self.nodes[at as usize];
            if node.kind != KindId::OPEN && !skipped(node.kind) {
                return Some(self.id(at));
            }
            at = node.after;
        }
        None
    }

    /// True if a module of a certain kind stands after this one on its axis, or on a branch of that.
    pub fn is_followed(&self, id: ModuleId, wanted: impl Fn(KindId) -> bool) -> bool {
        let node = self.node(id);
        let mut depth = 0usize;
        for visit in (Walk { tree: self, next: node.after, inside: node.parent }) {
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

    /// All modules and brackets in string order.
    pub fn walk(&self) -> Walk<'_> {
        Walk { tree: self, next: self.nodes[TRUNK as usize].first, inside: TRUNK }
    }

    /// Writes the structure out; `values` appends the parameters of a module.
    pub fn write(
        &self,
        now: Instant,
        time: f64,
        out: &mut ModuleString,
        mut values: impl FnMut(ModuleId, &mut Vec<f64>),
    ) {
        out.reset(time);
        let mut parameters = Vec::new();
        // Brackets are no modules and have no identity.
        let nobody = Lineage::of_axiom(0);
        for visit in self.walk() {
            match visit {
                Visit::Open => out.push(KindId::OPEN, [], 0.0, nobody),
                Visit::Close => out.push(KindId::CLOSE, [], 0.0, nobody),
                Visit::Module(id) => {
                    let node = self.node(id);
                    let age = now.since(node.birth).max(0.0);
                    parameters.clear();
                    values(id, &mut parameters);
                    out.push(node.kind, parameters.iter().copied(), age, node.lineage);
                }
            }
        }
    }
}

/// Iterator of [`Tree::walk`].
pub struct Walk<'t> {
    tree: &'t Tree,
    next: u32,
    inside: u32,
}

impl Iterator for Walk<'_> {
    type Item = Visit;

    fn next(&mut self) -> Option<Visit> {
        if self.next == NONE {
            if self.inside == TRUNK {
                return None;
            }
            let branch = &self.tree.nodes[self.inside as usize];
            (self.next, self.inside) = (branch.after, branch.parent);
            return Some(Visit::Close);
        }
        let slot = self.next;
        let node = &self.tree.nodes[slot as usize];
        if node.kind == KindId::OPEN {
            (self.next, self.inside) = (node.first, slot);
            return Some(Visit::Open);
        }
        self.next = node.after;
        Some(Visit::Module(self.tree.id(slot)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::{Graph, Program};
    use crate::model::Kinds;

    /// A string of kinds without parameters, written with one letter each.
    fn string(kinds: &mut Kinds, text: &str) -> Successor {
        let ids = text.chars().map(|c| kinds.intern(&c.to_string(), 0)).collect();
        Successor { kinds: ids, arguments: Program::compile(&Graph::default(), &[], 0) }
    }

    fn show(kinds: &Kinds, tree: &Tree) -> String {
        tree.walk()
            .map(|visit| match visit {
                Visit::Open => "[".to_owned(),
                Visit::Close => "]".to_owned(),
                Visit::Module(id) => kinds.get(tree.kind(id)).name.clone(),
            })
            .collect()
    }

    fn grown(text: &str, swaps: &[(usize, &str)]) -> (Kinds, Tree) {
        let mut kinds = Kinds::default();
        let axiom = string(&mut kinds, text);
        let successors: Vec<_> = swaps.iter().map(|(at, s)| (*at, string(&mut kinds, s))).collect();
        let mut tree = Tree::new(vec![0; kinds.len()]);
        tree.append(&axiom, &[], Instant::ZERO, Lineage::of_axiom, &mut Vec::new());
        for (at, successor) in successors {
            let ids: Vec<ModuleId> = tree
                .walk()
                .filter_map(|v| match v {
                    Visit::Module(id) => Some(id),
                    _ => None,
                })
                .collect();
            let lineage = tree.lineage(ids[at]);
            tree.replace(ids[at], &successor, &[], Instant::ZERO, |i| lineage.child(0, i), &mut Vec::new());
        }
        (kinds, tree)
    }

    #[test]
    fn productions_splice_the_string() {
        let (kinds, tree) = grown("AB[C[D]E]F", &[(2, "X[Y]"), (0, ""), (0, "PQ")]);
        assert_eq!(show(&kinds, &tree), "PQ[X[Y][D]E]F");
        assert_eq!(tree.len(), 7);
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
