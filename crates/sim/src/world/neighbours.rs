//! The nearest neighbours of each module, and the modules that have looked at it.
//!
//! The nearest module that is not skipped, on either side, is remembered once it has been found, and handed on from a
//! module to its successor. So finding a context costs the same however many finished branches stand between: they are
//! not passed again. A remembered neighbour stays right until it dies, because nothing else can come between;
//! only where a skipped module turns into one that counts is everything forgotten.
//!
//! For each module its *lookers* are recorded, the modules whose contexts were matched against it, successfully or not: when
//! it dies, their contexts are matched again, and no others.

use std::collections::HashMap;

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::world::World;
use crate::world::prefetch::fetch;
use crate::world::state::State;
use dlsys_model::{KindId, Model};
use dlsys_tree::{ModuleId, Tree, room};

/// A module with more neighbours than this is taken to read all that it has looked at.
const MANY: usize = 32;

/// A neighbour, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Link {
    Unknown,
    /// There is none.
    End,
    Module(ModuleId),
}

impl From<Option<ModuleId>> for Link {
    fn from(found: Option<ModuleId>) -> Link {
        found.map_or(Link::End, Link::Module)
    }
}

/// The sides of a module.
const LEFT: usize = 0;
const RIGHT: usize = 1;

/// What is kept in a slot of the tree: 40 bytes, because an event reads it for all modules around it, and they are anywhere
/// in memory.
#[derive(Clone, Debug)]
struct Around {
    /// The generation of the module whose neighbours these are.
    generation: u32,
    /// What is known of the neighbours on both sides.
    known: [Known; 2],
    /// The number of lookers, or [`CROWD`].
    count: u8,
    /// The neighbours on the sides where there are known ones.
    neighbours: [ModuleId; 2],
    lookers: [ModuleId; FEW],
}

/// So many lookers stand in place. Where there have been more at a time, they are kept in a list, and this is their number.
const FEW: usize = 2;
const CROWD: u8 = u8::MAX;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    Nothing,
    End,
    Module,
}

impl Around {
    /// Nothing known of a module.
    fn new(id: ModuleId) -> Around {
        let known = [Known::Nothing; 2];
        Around { generation: id.generation(), known, count: 0, neighbours: [id; 2], lookers: [id; FEW] }
    }

    /// The neighbour on one side.
    fn link(&self, side: usize) -> Link {
        match self.known[side] {
            Known::Nothing => Link::Unknown,
            Known::End => Link::End,
            Known::Module => Link::Module(self.neighbours[side]),
        }
    }

    fn set(&mut self, side: usize, link: Link) {
        self.known[side] = match link {
            Link::Unknown => Known::Nothing,
            Link::End => Known::End,
            Link::Module(id) => {
                self.neighbours[side] = id;
                Known::Module
            }
        };
    }
}

/// Neighbours and lookers.
#[derive(Clone, Debug, Default)]
pub struct Neighbours {
    /// By slot of the tree, as far as there are any.
    around: Vec<Around>,
    /// The lookers of modules that have many, by slot.
    crowds: FxHashMap<usize, Vec<ModuleId>>,
    /// The left neighbour, now, of the right neighbour of a module that has died at this instant.
    forwards: Forwards,
}

/// Links by module. Most instants concern few modules: then a list is enough.
#[derive(Clone, Debug, Default)]
struct Forwards {
    few: Vec<(ModuleId, Link)>,
    many: HashMap<ModuleId, Link>,
}

impl Forwards {
    fn get(&self, id: ModuleId) -> Option<Link> {
        let known = self.few.iter().find(|(of, _)| *of == id).map(|(_, link)| *link);
        if self.many.is_empty() { known } else { known.or_else(|| self.many.get(&id).copied()) }
    }

    fn insert(&mut self, id: ModuleId, link: Link) {
        const FEW: usize = 8;
        if let Some((_, known)) = self.few.iter_mut().find(|(of, _)| *of == id) {
            *known = link;
        } else if self.few.len() < FEW {
            self.few.push((id, link));
        } else {
            self.many.insert(id, link);
        }
    }

    fn clear(&mut self) {
        self.few.clear();
        // One large instant is no reason to sweep a large table at every small one.
        if !self.many.is_empty() {
            self.many = HashMap::new();
        }
    }
}

impl Neighbours {
    /// What is kept in the slot of a module, maybe of an earlier one.
    fn slot(&mut self, id: ModuleId) -> &mut Around {
        room::lengthen(&mut self.around, id.slot() + 1, || Around::new(id));
        &mut self.around[id.slot()]
    }

    fn near(&mut self, id: ModuleId) -> &mut Around {
        let near = self.slot(id);
        if near.generation != id.generation() {
            (near.generation, near.known) = (id.generation(), [Known::Nothing; 2]);
        }
        near
    }

    /// The left neighbour, as [`Tree::left`] finds it.
    pub fn left(&mut self, tree: &Tree, id: ModuleId, skipped: impl Fn(KindId) -> bool) -> Option<ModuleId> {
        let known = self.near(id).link(LEFT);
        if let Link::Module(found) = known
            && tree.is_alive(found)
        {
            return Some(found);
        }
        let left = self.forwarded(tree, known);
        if left != known {
            self.near(id).set(LEFT, left);
        }
        match left {
            Link::End => None,
            Link::Module(found) if tree.is_alive(found) => Some(found),
            _ => {
                let found = tree.left(id, skipped);
                self.near(id).set(LEFT, found.into());
                found
            }
        }
    }

    /// A left neighbour, or its replacement at this instant. The path to it is compressed: a million branches may need it
    /// one after another.
    fn forwarded(&mut self, tree: &Tree, known: Link) -> Link {
        let mut way: SmallVec<[ModuleId; 8]> = SmallVec::new();
        let mut link = known;
        while let Link::Module(id) = link
            && !tree.is_alive(id)
            && let Some(next) = self.forwards.get(id)
        {
            way.push(id);
            link = next;
        }
        for id in way {
            self.forwards.insert(id, link);
        }
        link
    }

    /// Ends an instant: all contexts have been matched.
    pub fn end_instant(&mut self) {
        self.forwards.clear();
    }

    /// The right neighbour, as [`Tree::right`] finds it.
    pub fn right(&mut self, tree: &Tree, id: ModuleId, skipped: impl Fn(KindId) -> bool) -> Option<ModuleId> {
        match self.near(id).link(RIGHT) {
            Link::End => None,
            Link::Module(found) if tree.is_alive(found) => Some(found),
            _ => {
                let found = tree.right(id, skipped);
                self.near(id).set(RIGHT, found.into());
                found
            }
        }
    }

    /// Remembers that a module looked at another.
    pub fn note(&mut self, tree: &Tree, looker: ModuleId, seen: ModuleId) {
        let around = self.slot(seen);
        let count = usize::from(around.count);
        if (1..=FEW).contains(&count) && around.lookers[count - 1] == looker {
            return;
        }
        if count < FEW {
            around.lookers[count] = looker;
            around.count += 1;
            return;
        }
        if around.count == CROWD {
            let crowd = self.crowds.get_mut(&seen.slot()).expect("it has many");
            if crowd.last() == Some(&looker) {
                return;
            }
            if crowd.len() == crowd.capacity() {
                let kept = tidy(tree, looker, crowd);
                crowd.truncate(kept);
            }
            crowd.push(looker);
            return;
        }
        let kept = tidy(tree, looker, &mut around.lookers);
        if kept < FEW {
            around.lookers[kept] = looker;
            around.count = kept as u8 + 1;
            return;
        }
        around.count = CROWD;
        let mut crowd = Vec::with_capacity(2 * FEW);
        crowd.extend(around.lookers.into_iter().chain([looker]));
        self.crowds.insert(seen.slot(), crowd);
    }

    /// The lookers of a slot's module, living and dead; some maybe of an earlier module.
    pub fn lookers(&self, id: ModuleId) -> &[ModuleId] {
        match self.around.get(id.slot()) {
            Some(around) if around.count == CROWD => &self.crowds[&id.slot()],
            Some(around) => &around.lookers[..usize::from(around.count)],
            None => &[],
        }
    }

    /// Calls a function with each module whose equations or conditions read something of this one that may change, and
    /// with its context; with some twice.
    pub fn readers(
        &self,
        world: &World,
        model: &Model,
        id: ModuleId,
        mut each: impl FnMut(ModuleId, &[ModuleId]),
    ) {
        for &looker in self.lookers(id) {
            if let Some(state) = world.state(looker)
                && reads(model, state, id)
            {
                each(looker, &state.context);
            }
        }
    }

    /// The neighbours of a slot's module, as far as they are known.
    pub fn beside(&self, slot: usize) -> impl Iterator<Item = ModuleId> {
        let known = |around: &Around| [LEFT, RIGHT].map(|side| around.link(side));
        self.around.get(slot).map(known).into_iter().flatten().filter_map(|link| match link {
            Link::Module(id) => Some(id),
            _ => None,
        })
    }

    /// Prefetches what is kept in a slot.
    pub fn prefetch(&self, slot: usize) {
        self.around.get(slot).into_iter().for_each(fetch);
    }

    /// Removes the lookers of a module that has died.
    pub fn bury(&mut self, id: ModuleId) {
        if let Some(around) = self.around.get_mut(id.slot()) {
            match around.count {
                CROWD => self.crowds.get_mut(&id.slot()).expect("it has many").clear(),
                _ => around.count = 0,
            }
        }
    }

    /// Forgets all neighbours.
    pub fn forget(&mut self) {
        self.around.iter_mut().for_each(|around| around.known = [Known::Nothing; 2]);
        self.end_instant();
    }

    /// Hands the neighbours of a module on to its successor: `made` are the modules of a string of `kinds`.
    /// Without a module, the string is the initial one.
    pub fn hand_on(
        &mut self,
        dead: Option<ModuleId>,
        kinds: &[KindId],
        made: &[ModuleId],
        skipped: impl Fn(KindId) -> bool,
    ) {
        if let Some(last) = made.last() {
            // Room for all of them at once.
            self.slot(*last);
        }
        let (left, right) = match dead {
            Some(id) => {
                let near = self.near(id);
                (near.link(LEFT), near.link(RIGHT))
            }
            None => (Link::End, Link::End),
        };
        let mut made = made.iter().copied();
        // The left neighbour of the next module, and the last module on the same axis.
        let (mut before, mut last): (Link, Option<ModuleId>) = (left, None);
        let mut outer = Vec::new();
        let mut first = None;
        for &kind in kinds {
            if kind == KindId::OPEN {
                outer.push((before, last.take()));
            } else if kind == KindId::CLOSE {
                if let Some(last) = last {
                    self.near(last).set(RIGHT, Link::End);
                }
                (before, last) = outer.pop().expect("brackets match: the front end saw to it");
            } else if let Some(id) = made.next() {
                let near = self.near(id);
                near.set(LEFT, before);
                near.set(RIGHT, Link::Unknown);
                if !skipped(kind) {
                    if let Some(last) = last {
                        self.near(last).set(RIGHT, Link::Module(id));
                    }
                    if outer.is_empty() {
                        first.get_or_insert(id);
                    }
                    (before, last) = (Link::Module(id), Some(id));
                }
            }
        }
        if let Some(last) = last {
            self.near(last).set(RIGHT, right);
        }
        let Some(dead) = dead else { return };
        self.forwards.insert(dead, before);
        if let Link::Module(id) = right
            && self.near(id).link(LEFT) == Link::Module(dead)
        {
            self.near(id).set(LEFT, before);
        }
        if let Link::Module(id) = left
            && self.near(id).link(RIGHT) == Link::Module(dead)
        {
            self.near(id).set(RIGHT, first.map_or(right, Link::Module));
        }
    }
}

/// Puts those of a full list of lookers first that are to stay, and gives their number: the living ones without one that looks again, or,
/// if these are all, each of them once.
fn tidy(tree: &Tree, again: ModuleId, lookers: &mut [ModuleId]) -> usize {
    let mut kept = 0;
    for n in 0..lookers.len() {
        if lookers[n] != again && tree.is_alive(lookers[n]) {
            lookers[kept] = lookers[n];
            kept += 1;
        }
    }
    if kept < lookers.len() {
        return kept;
    }
    lookers.sort_unstable();
    kept = 0;
    for n in 0..lookers.len() {
        if n == 0 || lookers[n] != lookers[kept - 1] {
            lookers[kept] = lookers[n];
            kept += 1;
        }
    }
    kept
}

/// True if the equations or conditions of a module that has looked at another read something of it that may change.
pub fn reads(model: &Model, state: &State, seen: ModuleId) -> bool {
    // A module that has looked at many has looked at children, and reads them.
    state.rule.get().is_some_and(|rule| model.rules[rule].reads_context)
        && (state.context.len() > MANY || state.context.contains(&seen))
}
