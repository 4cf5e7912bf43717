//! `%`: the rest of a branch goes (ABOP, section 3.3).
//!
//! Modules that are cut off are removed at once, before anything else is done with the structure, and are in no frame. A lazy
//! module leaves an entry in the calendar queue behind, by its slot; so the slot is kept empty until the entry comes up.

use super::EventStage;
use dlsys_tree::ModuleId;

impl EventStage<'_, '_> {
    /// Carries out the cuts among the modules that were made lately.
    pub fn cut_branches(&mut self, made: &[ModuleId]) {
        if self.setup.cuts.is_none() {
            return;
        }
        let mut cut = false;
        for &id in made {
            if self.world.tree.is_alive(id) && Some(self.world.tree.kind(id)) == self.setup.cuts {
                self.cut_off(id);
                cut = true;
            }
        }
        if cut {
            self.world.structure += 1;
            self.schedule.clean_batch(self.world);
        }
    }

    fn cut_off(&mut self, id: ModuleId) {
        for gone in self.world.tree.following(id) {
            let class = self.world.lives.get(self.world.tree.label(gone));
            if class.is_some_and(|class| class.end.is_some() && !class.is_over_at_birth()) {
                self.schedule.bury(gone);
            }
            self.flow().forget(gone);
            self.events.to_look.extend_from_slice(self.neighbours.lookers(gone));
            self.neighbours.bury(gone);
        }
        let schedule = &self.schedule;
        self.world.tree.cut(id, |slot| schedule.is_buried(slot));
    }
}
