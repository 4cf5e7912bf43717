//! The change that a production makes, recorded on request ([`Settings::transitions`](crate::Settings::transitions)): the
//! predecessor just before the instant and the successor just after it, both with their rates.
//!
//! A successor that is itself replaced at the same instant is never observed, so a transition goes across the
//! whole cascade: from a module that was there before the instant to the modules that stand there after it, with
//! the rates of the equations that were chosen for them.

use super::EventStage;
use crate::log::{ModuleState, Transition};
use std::collections::BTreeMap;

use crate::event::Firing;
use dlsys_model::{BUILT_IN_SURFACES, DRAWN_WORDS, Kind, KindId, Model};
use dlsys_tree::ModuleId;

/// Productions of the present instant.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorder {
    /// Rates just before it of all modules that it may concern.
    arrivals: BTreeMap<ModuleId, Vec<f64>>,
    fired: BTreeMap<ModuleId, Fired>,
}

#[derive(Clone, Debug)]
struct Fired {
    /// Index into the log.
    event: usize,
    before: ModuleState,
    moved: bool,
    followed: bool,
    /// It was made at this instant.
    made_now: bool,
    parts: Vec<(KindId, Option<ModuleId>)>,
}

impl EventStage<'_, '_> {
    /// Remembers the rates with which modules come to an instant, before anything happens there.
    pub fn note_arrivals(&mut self) {
        let Some(mut recorder) = self.events.recorder.take() else { return };
        recorder.arrivals.clear();
        recorder.fired.clear();
        // Those of the initial string have not come from anywhere.
        let known = |id: &ModuleId| self.world.state(*id).is_some();
        let all = self.events.opened.iter().copied().chain(self.contextual());
        let concerned: Vec<ModuleId> = all.filter(known).collect();
        for id in concerned {
            if !recorder.arrivals.contains_key(&id) && self.world.tree.is_alive(id) {
                let mut rates = Vec::new();
                self.flow().rates_ahead(id, 0.0, &mut rates);
                recorder.arrivals.insert(id, rates);
            }
        }
        self.events.recorder = Some(recorder);
    }

    /// Remembers modules that are about to be replaced; their events begin at this index of the log.
    pub fn note_predecessors(&mut self, firing: &[Firing]) {
        let first = self.log.events.as_ref().map_or(0, Vec::len);
        let Some(mut recorder) = self.events.recorder.take() else { return };
        let draws = |kind: KindId| is_drawn(self.setup.model, kind);
        for (event, fire) in (first..).zip(firing) {
            let tree = &self.world.tree;
            let mut values = Vec::new();
            self.world.values(fire.id, self.instant.at, &mut values);
            let arrival = recorder.arrivals.get(&fire.id);
            let mut rates = arrival.cloned().unwrap_or_else(|| vec![0.0; values.len()]);
            values.truncate(tree.shown(fire.id));
            rates.truncate(values.len());
            let (kind, age) = (tree.kind(fire.id), self.instant.at.since(tree.birth(fire.id)));
            let made = |f: &Fired| f.parts.iter().any(|(_, id)| *id == Some(fire.id));
            let fired = Fired {
                event,
                before: ModuleState { kind, values, rates, age },
                moved: arrival.is_some(),
                followed: tree.is_followed(fire.id, draws),
                made_now: arrival.is_none() && recorder.fired.values().any(made),
                parts: Vec::new(),
            };
            recorder.fired.insert(fire.id, fired);
        }
        self.events.recorder = Some(recorder);
    }

    /// Records the successor of a module: the kinds of its string, and its modules.
    pub fn note_successor(&mut self, id: ModuleId, kinds: &[KindId], made: &[ModuleId]) {
        let Some(fired) = self.events.recorder.as_mut().and_then(|r| r.fired.get_mut(&id)) else { return };
        let mut made = made.iter().copied();
        fired.parts =
            (kinds.iter()).map(|&kind| (kind, if kind.is_bracket() { None } else { made.next() })).collect();
    }

    /// Completes the events of the instant, now that all equations are chosen.
    pub fn finish_transitions(&mut self) {
        let Some(recorder) = self.events.recorder.take() else { return };
        for fired in recorder.fired.values().filter(|fired| !fired.made_now) {
            let (mut after, mut cascade) = (Vec::new(), 0);
            // Parts still to be looked at, the next one last.
            let mut parts: Vec<(KindId, Option<ModuleId>)> = fired.parts.iter().rev().copied().collect();
            while let Some((kind, id)) = parts.pop() {
                match id {
                    None => after.push(ModuleState { kind, values: Vec::new(), rates: Vec::new(), age: 0.0 }),
                    Some(id) if self.world.tree.is_alive(id) => {
                        let (mut values, mut rates) = (Vec::new(), Vec::new());
                        self.world.values(id, self.instant.at, &mut values);
                        self.flow().rates_ahead(id, 0.0, &mut rates);
                        values.truncate(self.world.tree.shown(id));
                        rates.truncate(values.len());
                        after.push(ModuleState { kind, values, rates, age: 0.0 });
                    }
                    Some(id) => {
                        cascade += 1;
                        let next = recorder.fired.get(&id).map_or(&[][..], |fired| &fired.parts);
                        parts.extend(next.iter().rev());
                    }
                }
            }
            let Fired { event, before, moved, followed, .. } = fired;
            if let Some(event) = self.log.events.as_mut().and_then(|log| log.get_mut(*event)) {
                let (before, moved, followed) = (before.clone(), *moved, *followed);
                event.transition = Some(Box::new(Transition { before, after, moved, followed, cascade }));
            }
        }
        self.events.recorder = Some(recorder);
    }
}

/// True for a kind that is drawn.
fn is_drawn(model: &Model, kind: KindId) -> bool {
    let by_name =
        |kind: &Kind| DRAWN_WORDS.contains(&kind.base()) || BUILT_IN_SURFACES.contains(&kind.name.as_str());
    let kind = model.kinds.get(kind);
    let Some(index) = kind.interpretation else { return by_name(kind) };
    model.interpretations[index].drawn.kinds().any(|part| {
        let part = model.kinds.get(part);
        by_name(part) || part.interpretation.is_some_and(|other| other != index)
    })
}
