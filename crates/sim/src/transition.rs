//! What a production changes, for those who ask ([`Settings::transitions`](super::Settings::transitions)): the
//! predecessor just before the instant and the successor just after it, both with their rates.
//!
//! A successor that is itself replaced at the same instant is not seen by anybody, so a transition goes across the
//! whole cascade: from a module that was there before the instant to the modules that stand there after it, with
//! the rates of the equations that were chosen for them.

use std::collections::BTreeMap;

use super::settle::Firing;
use super::simulation::Simulation;
use dlsys_model::{BUILT_IN_SURFACES, DRAWN_WORDS, Kind, KindId, Model, Successor};
use dlsys_tree::ModuleId;

/// A module, or a bracket, at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    pub kind: KindId,
    pub values: Vec<f64>,
    /// Of the values, per unit of time.
    pub rates: Vec<f64>,
    pub age: f64,
}

/// What a production changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// The limit from the left.
    pub before: Stand,
    /// In string order, brackets included.
    pub after: Vec<Stand>,
    /// The rates before are known: not those of the initial string at t = 0.
    pub moved: bool,
    /// Something that is drawn follows the predecessor on its axis.
    pub followed: bool,
    /// Further productions at the same instant that were needed to get from one to the other.
    pub cascade: usize,
}

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
    before: Stand,
    moved: bool,
    followed: bool,
    /// It was made at this instant.
    made_now: bool,
    parts: Vec<(KindId, Option<ModuleId>)>,
}

impl Simulation<'_> {
    /// Remembers the rates with which modules come to an instant, before anything happens there.
    pub(super) fn note_arrivals(&mut self) {
        let Some(mut recorder) = self.recorder.take() else { return };
        recorder.arrivals.clear();
        recorder.fired.clear();
        // Those of the initial string have not come from anywhere.
        let known = |id: &ModuleId| self.plant.state(*id).is_some();
        let all = self.opened.iter().copied().chain(self.contextual());
        let concerned: Vec<ModuleId> = all.filter(known).collect();
        for id in concerned {
            if !recorder.arrivals.contains_key(&id) && self.plant.tree.is_alive(id) {
                let mut rates = Vec::new();
                self.rates_ahead(id, 0.0, &mut rates);
                recorder.arrivals.insert(id, rates);
            }
        }
        self.recorder = Some(recorder);
    }

    /// Remembers modules that are about to be replaced; their events begin at this index of the log.
    pub(super) fn note_predecessors(&mut self, firing: &[Firing], mut event: usize) {
        let Some(mut recorder) = self.recorder.take() else { return };
        let draws = |kind: KindId| is_drawn(self.model, kind);
        for fire in firing {
            let tree = &self.plant.tree;
            let mut values = Vec::new();
            self.plant.values(fire.id, self.now, &mut values);
            let arrival = recorder.arrivals.get(&fire.id);
            let mut rates = arrival.cloned().unwrap_or_else(|| vec![0.0; values.len()]);
            values.truncate(tree.shown(fire.id));
            rates.truncate(values.len());
            let (kind, age) = (tree.kind(fire.id), self.now.since(tree.birth(fire.id)));
            let made = |f: &Fired| f.parts.iter().any(|(_, id)| *id == Some(fire.id));
            let fired = Fired {
                event,
                before: Stand { kind, values, rates, age },
                moved: arrival.is_some(),
                followed: tree.is_followed(fire.id, draws),
                made_now: arrival.is_none() && recorder.fired.values().any(made),
                parts: Vec::new(),
            };
            recorder.fired.insert(fire.id, fired);
            event += 1;
        }
        self.recorder = Some(recorder);
    }

    /// Remembers what a module was replaced by.
    pub(super) fn note_successor(&mut self, id: ModuleId, successor: &Successor, made: &[ModuleId]) {
        let Some(fired) = self.recorder.as_mut().and_then(|r| r.fired.get_mut(&id)) else { return };
        let mut made = made.iter().copied();
        fired.parts = (successor.kinds.iter())
            .map(|&kind| (kind, if kind.is_bracket() { None } else { made.next() }))
            .collect();
    }

    /// Completes the events of the instant, now that all equations are chosen.
    pub(super) fn finish_transitions(&mut self) {
        let Some(recorder) = self.recorder.take() else { return };
        for fired in recorder.fired.values().filter(|fired| !fired.made_now) {
            let (mut after, mut cascade) = (Vec::new(), 0);
            // Parts still to be looked at, the next one last.
            let mut parts: Vec<(KindId, Option<ModuleId>)> = fired.parts.iter().rev().copied().collect();
            while let Some((kind, id)) = parts.pop() {
                match id {
                    None => after.push(Stand { kind, values: Vec::new(), rates: Vec::new(), age: 0.0 }),
                    Some(id) if self.plant.tree.is_alive(id) => {
                        let (mut values, mut rates) = (Vec::new(), Vec::new());
                        self.plant.values(id, self.now, &mut values);
                        self.rates_ahead(id, 0.0, &mut rates);
                        values.truncate(self.plant.tree.shown(id));
                        rates.truncate(values.len());
                        after.push(Stand { kind, values, rates, age: 0.0 });
                    }
                    Some(id) => {
                        cascade += 1;
                        let next = recorder.fired.get(&id).map_or(&[][..], |fired| &fired.parts);
                        parts.extend(next.iter().rev());
                    }
                }
            }
            let Fired { event, before, moved, followed, .. } = fired;
            if let Some(event) = self.log.as_mut().and_then(|log| log.get_mut(*event)) {
                let (before, moved, followed) = (before.clone(), *moved, *followed);
                event.transition = Some(Box::new(Transition { before, after, moved, followed, cascade }));
            }
        }
        self.recorder = Some(recorder);
    }
}

/// True for what leaves a trace in a picture.
fn is_drawn(model: &Model, kind: KindId) -> bool {
    let by_name =
        |kind: &Kind| DRAWN_WORDS.contains(&kind.base()) || BUILT_IN_SURFACES.contains(&kind.name.as_str());
    let kind = model.kinds.get(kind);
    let Some(index) = kind.interpretation else { return by_name(kind) };
    model.interpretations[index].drawn.kinds.iter().any(|part| {
        let part = model.kinds.get(*part);
        by_name(part) || part.interpretation.is_some_and(|other| other != index)
    })
}
