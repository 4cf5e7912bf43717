//! `%`: the rest of a branch goes (ABOP, section 3.3).
//!
//! Whoever is cut off is gone at once: before anything else is asked of the structure, and in no frame. A light module
//! leaves an entry in the agenda behind, which knows it by its slot; so the slot is kept empty until the entry comes up.

use super::simulation::Simulation;
use dlsys_tree::ModuleId;

impl Simulation<'_> {
    /// Carries out the cuts among the modules that were made lately.
    pub(super) fn cut_branches(&mut self, made: &[ModuleId]) {
        if self.cuts.is_none() {
            return;
        }
        let mut cut = false;
        for &id in made {
            if self.plant.tree.is_alive(id) && Some(self.plant.tree.kind(id)) == self.cuts {
                self.cut_off(id);
                cut = true;
            }
        }
        if cut {
            self.structure += 1;
            let ghosts = &self.ghosts;
            let freed = self.front.remove(|slot| ghosts.contains(&slot));
            for slot in freed {
                self.ghosts.remove(&slot);
                self.plant.tree.free_slot(slot);
            }
        }
    }

    fn cut_off(&mut self, id: ModuleId) {
        for gone in self.plant.tree.following(id) {
            let career = self.plant.careers.get(self.plant.tree.label(gone));
            if career.is_some_and(|career| career.end.is_some() && !career.is_over_at_birth()) {
                self.ghosts.insert(gone.slot() as u32);
            }
            self.forget(gone);
            self.to_look.extend_from_slice(self.neighbours.lookers(gone));
            self.neighbours.bury(gone);
        }
        let ghosts = &self.ghosts;
        self.plant.tree.cut(id, |slot| ghosts.contains(&slot));
    }

    /// Takes those out of a list of light modules that have been cut off.
    pub(super) fn without_ghosts(&mut self, slots: &mut Vec<u32>) {
        if self.ghosts.is_empty() {
            return;
        }
        let (ghosts, tree) = (&mut self.ghosts, &mut self.plant.tree);
        slots.retain(|slot| {
            let gone = ghosts.remove(slot);
            if gone {
                tree.free_slot(*slot);
            }
            !gone
        });
    }
}
