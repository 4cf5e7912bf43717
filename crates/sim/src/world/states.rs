//! The states of materialised modules, by slot of the tree.
//!
//! Each is a box. Side by side in pages, with a list of their places, they would take a fiftieth less memory, and an event of a tissue a
//! twentieth more instructions, because it looks for a state a hundred times.

use super::state::State;
use dlsys_tree::{ModuleId, room};

/// All states. Modules without rules have none, and lazy ones. The memory of a dead module's state is that of the next one in its slot.
#[derive(Clone, Debug, Default)]
pub struct States(Vec<Option<Box<State>>>);

impl States {
    /// The number of slots for which there is room.
    pub fn slots(&self) -> usize {
        self.0.len()
    }

    /// The state in a slot, of a living module or of a dead one.
    #[inline]
    pub fn get(&self, slot: usize) -> Option<&State> {
        self.0.get(slot)?.as_deref()
    }

    /// The same, to be changed.
    #[inline]
    pub fn get_mut(&mut self, slot: usize) -> Option<&mut State> {
        self.0.get_mut(slot)?.as_deref_mut()
    }

    /// The state in the slot of a module; a new one if there is none.
    pub fn make(&mut self, id: ModuleId) -> &mut State {
        room::cover(&mut self.0, id.slot(), || None);
        self.0[id.slot()].get_or_insert_with(|| Box::new(State::new(id)))
    }

    /// All states, to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut State> {
        self.0.iter_mut().flatten().map(|state| &mut **state)
    }

    /// All states, by slot.
    pub fn iter(&self) -> impl Iterator<Item = &State> {
        self.0.iter().flatten().map(|state| &**state)
    }

    /// Where it is written where the state in a slot is: to be fetched from memory ahead.
    pub fn place(&self, slot: usize) -> Option<&(impl Sized + use<>)> {
        self.0.get(slot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_takes_no_more_room_than_is_said() {
        assert_eq!(size_of::<State>(), 168, "ARCHITECTURE.md says what each part of a coupled module takes");
    }
}
