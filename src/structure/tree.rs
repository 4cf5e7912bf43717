//! The growing structure: modules on axes, axes on modules.
//!
//! An axis is a doubly linked list of modules and branches; a branch holds an axis of its own. So a
//! production costs what it replaces, and string order is a walk. Slots are used again, and a
//! [`ModuleId`] carries the generation of its slot, so that an old id never means a new module.
//!
//! A module is a record of 28 bytes and its parameters; its birth and lineage are kept with those of its siblings
//! (`brood`). At a million modules, what anything costs is the memory that it touches.

use smallvec::SmallVec;

use super::brood::{Broods, NO_BROOD};
use super::{Family, Instant, Lineage, Visit, Walk};
use crate::model::{KindId, Successor};

/// The branch that holds the main axis.
pub(super) const TRUNK: u32 = 0;

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

    pub(super) fn of_parts(slot: u32, generation: u32) -> ModuleId {
        ModuleId { slot, generation }
    }
}

/// What stands before or after on an axis: a module or a branch, by its slot; or nothing, and then it is known which
/// branch the axis belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link(pub(super) u32);

impl Link {
    const END: u32 = 1 << 31;

    /// The end of a branch's axis.
    fn end_of(branch: u32) -> Link {
        Link(branch | Link::END)
    }

    /// The branch whose axis ends here.
    pub(super) fn ended(self) -> Option<u32> {
        (self.0 & Link::END != 0).then_some(self.0 & !Link::END)
    }
}

/// No module has this label.
pub const NO_LABEL: u16 = u16::MAX;

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// `KindId::OPEN` for a branch.
    pub kind: KindId,
    /// Of the slot.
    pub generation: u32,
    before: Link,
    pub after: Link,
    /// Where the parameters begin; of a branch, what its own axis begins with.
    pub first: u32,
    pub brood: u32,
    pub place: u16,
    pub label: u16,
}

/// The modules alive, their order and their parameters.
#[derive(Clone, Debug)]
pub struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) broods: Broods,
    free: Vec<u32>,
    pub(super) values: Vec<f64>,
    /// Free blocks of `values`, by their length.
    free_values: Vec<Vec<u32>>,
    pub(super) arities: Vec<u32>,
    /// Parameters of each kind that are shown to others: hidden ones are its last.
    pub(super) shown: Vec<u32>,
    modules: usize,
}

impl Tree {
    /// An empty structure; `arities` gives the number of parameters of each kind, and `shown` how many of them an
    /// observer gets to see.
    pub fn new(arities: Vec<u32>, shown: Vec<u32>) -> Tree {
        let trunk = Node {
            kind: KindId::OPEN,
            generation: 0,
            before: Link::end_of(TRUNK),
            after: Link::end_of(TRUNK),
            first: Link::end_of(TRUNK).0,
            label: NO_LABEL,
            brood: NO_BROOD,
            place: 0,
        };
        Tree {
            nodes: vec![trunk],
            broods: Broods::default(),
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

    pub fn is_empty(&self) -> bool {
        self.modules == 0
    }

    /// Number of modules and brackets, and of parameters at most.
    pub(super) fn extent(&self) -> (usize, usize) {
        let branches = self.nodes.len() - 1 - self.free.len() - self.modules;
        (self.modules + 2 * branches, self.values.len())
    }

    /// Bytes that it takes, about.
    pub fn size(&self) -> usize {
        size_of_val(&self.nodes[..])
            + size_of_val(&self.values[..])
            + self.broods.size()
            + 4 * self.free.len()
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

    /// Who lives in a slot.
    pub fn id(&self, slot: u32) -> ModuleId {
        ModuleId { slot, generation: self.nodes[slot as usize].generation }
    }

    pub fn kind(&self, id: ModuleId) -> KindId {
        self.node(id).kind
    }

    pub fn birth(&self, id: ModuleId) -> Instant {
        self.broods.birth(self.node(id).brood)
    }

    pub fn lineage(&self, id: ModuleId) -> Lineage {
        let node = self.node(id);
        self.broods.lineage(node.brood, node.place)
    }

    /// A number that the owner of the tree has given to a module; [`NO_LABEL`] from birth on.
    pub fn label(&self, id: ModuleId) -> u16 {
        self.node(id).label
    }

    pub fn set_label(&mut self, id: ModuleId, label: u16) {
        self.nodes[id.slot()].label = label;
    }

    /// The label of a module that may be dead: then there is none.
    pub fn label_if_alive(&self, id: ModuleId) -> Option<u16> {
        let node = &self.nodes[id.slot()];
        (node.generation == id.generation).then_some(node.label)
    }

    /// Places of a module's parameters in [`Tree::values`].
    pub fn places(&self, id: ModuleId) -> std::ops::Range<usize> {
        self.node(id).places(&self.arities)
    }

    pub fn parameters(&self, id: ModuleId) -> &[f64] {
        &self.values[self.places(id)]
    }

    /// Number of a module's parameters that an observer gets to see.
    pub fn shown(&self, id: ModuleId) -> usize {
        self.shown[self.node(id).kind.index()] as usize
    }

    /// All parameters of all modules; a module's stand at [`Tree::places`].
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    pub fn set_value(&mut self, place: usize, value: f64) {
        self.values[place] = value;
    }

    /// Puts a node into a slot. What is after it is not known yet.
    fn allocate(&mut self, kind: KindId, before: Link, brood: u32, place: u16) -> u32 {
        let mut node =
            Node { kind, generation: 0, before, after: before, first: 0, label: NO_LABEL, brood, place };
        let arity = self.arities[kind.index()] as usize;
        if arity > 0 {
            let known = self.free_values.get_mut(arity).and_then(Vec::pop);
            node.first = known.unwrap_or_else(|| {
                self.values.resize(self.values.len() + arity, 0.0);
                (self.values.len() - arity) as u32
            });
        }
        match self.free.pop() {
            Some(slot) => {
                let place = &mut self.nodes[slot as usize];
                node.generation = place.generation;
                *place = node;
                slot
            }
            None => {
                self.nodes.push(node);
                self.nodes.len() as u32 - 1
            }
        }
    }

    fn release(&mut self, slot: u32) {
        self.end(slot);
        self.free.push(slot);
    }

    /// Ends the life of whoever is in a slot. The slot is not free yet.
    fn end(&mut self, slot: u32) {
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

    /// Appends a string at the end of the main axis, in time proportional to its length. The new modules are added to
    /// `made`.
    pub fn append(
        &mut self,
        string: &Successor,
        arguments: &[f64],
        birth: Instant,
        family: Family,
        made: &mut Vec<ModuleId>,
    ) {
        let mut last = Link::end_of(TRUNK);
        let mut next = Link(self.nodes[TRUNK as usize].first);
        while next.ended().is_none() {
            (last, next) = (next, self.nodes[next.0 as usize].after);
        }
        self.insert(last, next, string, arguments, birth, family, made);
    }

    /// Replaces a module by a string.
    pub fn replace(
        &mut self,
        id: ModuleId,
        string: &Successor,
        arguments: &[f64],
        birth: Instant,
        family: Family,
        made: &mut Vec<ModuleId>,
    ) {
        let Node { before, after, brood, .. } = *self.node(id);
        self.broods.leave(brood);
        self.release(id.slot);
        self.modules -= 1;
        self.insert(before, after, string, arguments, birth, family, made);
    }

    /// Takes out a module and all that follows on its axis, with all branches. Slots that are to be kept stay empty until
    /// they are given back with [`Tree::free_slot`].
    pub fn cut(&mut self, id: ModuleId, keep: impl Fn(u32) -> bool) {
        let before = self.node(id).before;
        let mut axes = vec![Link(id.slot)];
        let mut end = None;
        while let Some(mut at) = axes.pop() {
            while at.ended().is_none() {
                let Node { kind, after, first, brood, .. } = self.nodes[at.0 as usize];
                if kind == KindId::OPEN {
                    axes.push(Link(first));
                } else {
                    self.broods.leave(brood);
                    self.modules -= 1;
                }
                if keep(at.0) {
                    self.end(at.0)
                } else {
                    self.release(at.0)
                }
                at = after;
            }
            end.get_or_insert(at);
        }
        self.link_forward(before, end.expect("an axis has an end"));
    }

    /// Gives back a slot that was kept when its module was cut off.
    pub fn free_slot(&mut self, slot: u32) {
        self.free.push(slot);
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

    /// Puts a string between two neighbours.
    #[allow(clippy::too_many_arguments)]
    fn insert(
        &mut self,
        mut before: Link,
        after: Link,
        string: &Successor,
        arguments: &[f64],
        birth: Instant,
        family: Family,
        made: &mut Vec<ModuleId>,
    ) {
        // The branches that are open.
        let mut branches: SmallVec<[u32; 8]> = SmallVec::new();
        let (mut place, mut next) = (0, 0);
        // Of the present brood; a very long successor is several.
        let (mut brood, mut members) = (NO_BROOD, 0);
        for &kind in &string.kinds {
            if kind == KindId::CLOSE {
                let branch = branches.pop().expect("brackets match: the front end saw to it");
                self.link_forward(before, Link::end_of(branch));
                before = Link(branch);
                continue;
            }
            if kind == KindId::OPEN {
                let slot = self.allocate(kind, before, NO_BROOD, 0);
                self.link_forward(before, Link(slot));
                branches.push(slot);
                before = Link::end_of(slot);
                continue;
            }
            if brood == NO_BROOD || members == u16::MAX {
                self.broods.count(brood, members);
                brood = self.broods.begin(family, birth, place);
                members = 0;
            }
            let slot = self.allocate(kind, before, brood, members);
            members += 1;
            self.link_forward(before, Link(slot));
            let id = self.id(slot);
            let places = self.places(id);
            if !places.is_empty() {
                let count = places.len();
                let own = self.values[places].iter_mut();
                own.zip(&arguments[next..next + count]).for_each(|(value, &x)| *value = x);
                next += count;
            }
            place += 1;
            before = Link(slot);
            self.modules += 1;
            made.push(id);
        }
        self.broods.count(brood, members);
        self.link_forward(before, after);
        if after.ended().is_none() {
            self.nodes[after.0 as usize].before = before;
        }
    }

    /// The nearest module before this one on the path to the root, finished side branches and modules
    /// of skipped kinds passed over.
    pub fn left(&self, id: ModuleId, skipped: impl Fn(KindId) -> bool) -> Option<ModuleId> {
        let mut at = id.slot;
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
    /// on the same axis, modules of skipped kinds passed over. Also tells whether the last is on the axis.
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
}

impl Node {
    pub fn places(&self, arities: &[u32]) -> std::ops::Range<usize> {
        let first = self.first as usize;
        first..first + arities[self.kind.index()] as usize
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
        let arguments = Program::compile(&Graph::default(), &[], 0);
        Successor { kinds: ids, arguments, ..Successor::default() }
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
        let mut tree = Tree::new(vec![0; kinds.len()], vec![0; kinds.len()]);
        tree.append(&axiom, &[], Instant::ZERO, Family::AXIOM, &mut Vec::new());
        for (at, successor) in successors {
            let ids: Vec<ModuleId> = tree
                .walk()
                .filter_map(|v| match v {
                    Visit::Module(id) => Some(id),
                    _ => None,
                })
                .collect();
            let family = tree.lineage(ids[at]).family(0);
            tree.replace(ids[at], &successor, &[], Instant::ZERO, family, &mut Vec::new());
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
    fn what_is_cut_leaves_room_for_others() {
        let (mut kinds, mut tree) = grown("A[B[C]%D[E[F]G]H]IXYZ", &[]);
        let more = string(&mut kinds, "XY[Z]");
        let cut = kinds.find("%", 0).expect("%");
        let find = |tree: &Tree, kind| {
            let modules = tree.walk().filter_map(|v| if let Visit::Module(id) = v { Some(id) } else { None });
            { modules }.find(|id| tree.kind(*id) == kind).expect("it is there")
        };
        let cut = find(&tree, cut);
        assert_eq!(tree.following(cut).len(), 5);
        tree.cut(cut, |slot| slot as usize == cut.slot());
        assert_eq!((show(&kinds, &tree).as_str(), tree.len()), ("A[B[C]]IXYZ", 7));
        assert!(!tree.is_alive(cut));
        let mut made = Vec::new();
        for _ in 0..3 {
            let last = find(&tree, kinds.find("B", 0).expect("B"));
            let family = tree.lineage(last).family(0);
            let b = string(&mut kinds, "B[A]");
            tree.replace(last, &b, &[], Instant::ZERO, family, &mut made);
            tree.append(&more, &[], Instant::ZERO, Family::AXIOM, &mut made);
        }
        assert_eq!(show(&kinds, &tree), "A[B[A][A][A][C]]IXYZXY[Z]XY[Z]XY[Z]");
        assert!(made.iter().all(|id| id.slot() != cut.slot()), "its slot is kept");
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
