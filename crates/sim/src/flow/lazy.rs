//! Lazy modules: of each only a class and its birth are kept; the rest of its life is computed again on demand.
//!
//! The last life of each class is remembered, so that twins (born at one instant with the same values) cost a comparison,
//! and so do modules with the same values born at other instants under a rule that does not read `t`.

use super::prediction::{PredictedEnd, Prediction, predict, retrace, values_at_event};
use crate::scratch::Scratch;
use crate::setup::Setup;
use crate::world::life::{CachedPrediction, End, Life, LifeClass, Newborn, REFUSED, same_bits};
use crate::world::state::{Change, NextKind};
use crate::world::{Instant, World};
use dlsys_model::{Rule, Sign};
use dlsys_tree::{ModuleId, ModuleView, NO_LABEL, SimTime};
use smallvec::{SmallVec, smallvec};

/// The class of a module that is born now with the parameters in `scratch`, and its event.
pub fn classify(
    setup: &Setup,
    world: &mut World,
    now: SimTime,
    rule: usize,
    scratch: &mut Scratch,
) -> Newborn {
    let timeless = world.lives.is_timeless(rule);
    let compiled = &setup.model.rules[rule];
    let arity = compiled.parameters.len();
    if timeless
        && let Some(known) = &world.lives.cached[rule]
        && same_bits(&known.values, &scratch.variables[..arity])
    {
        let time = known.tau.map(|tau| now.ahead(tau));
        if time != Some(None) {
            let (label, time, tau) = (known.label, time.flatten(), known.tau);
            return Newborn { label, time, open: false, lasting: true, tau };
        }
    }
    let refused = Newborn { label: REFUSED, time: None, open: true, lasting: false, tau: None };
    let values = SmallVec::from_slice(&scratch.variables[..arity]);
    let Some(prediction) = predict(compiled, now, scratch) else { return refused };
    let Prediction { solve, signs, end, lasting, .. } = prediction;
    let (end, time) = match end {
        Some(PredictedEnd::AtBirth { produce }) => {
            let class = LifeClass { rule, solve: None, signs, end: Some(End::AtBirth { produce }) };
            let label = world.lives.intern(class);
            return label.map_or(refused, |label| Newborn { label, ..refused });
        }
        Some(PredictedEnd::Event { change, produce }) => {
            let (atom, after) = (change.atom(), change.after);
            (Some(End::Crossing { produce, atom, after }), Some(change.time.to_f64()))
        }
        None => (None, None),
    };
    // An infinite time has no place in the calendar queue.
    if time.is_some_and(|t| !t.is_finite()) {
        return refused;
    }
    let Some(label) = world.lives.intern(LifeClass { rule, solve, signs, end }) else {
        return refused;
    };
    let lasting = lasting.filter(|_| timeless);
    if let Some(tau) = lasting {
        world.lives.cached[rule] = Some(CachedPrediction { values, label, tau });
    }
    Newborn { label, time, open: false, lasting: lasting.is_some(), tau: lasting.flatten() }
}

/// The life of the lazy module in a slot, taken out of its class; to be given back with
/// [`Lives::keep`](crate::world::life::Lives::keep).
#[inline]
pub fn life(world: &mut World, rules: &[Rule], slot: u32, scratch: &mut Scratch) -> (u16, Box<Life>) {
    let ModuleView { label, birth, values, .. } = world.tree.look(slot);
    let mut life = world.lives.take_life(label);
    if !life.is_of(birth, values) {
        life.values.clear();
        life.values.extend_from_slice(values);
        life.birth = birth;
        let class = world.lives.get(label).expect("a lazy module");
        let timeless = world.lives.is_timeless(class.rule);
        retrace(&rules[class.rule], class, timeless, &mut life, scratch);
    }
    (label, life)
}

/// The instant of the event of the lazy module in a slot.
pub fn event_of(world: &mut World, rules: &[Rule], slot: u32, scratch: &mut Scratch) -> SimTime {
    let (label, life) = life(world, rules, slot, scratch);
    let at = life.at;
    world.lives.keep(label, life);
    at
}

/// Writes the values that a lazy module has at its event, now, into the tree: for messages.
pub fn write_values_at_event(
    world: &mut World,
    rules: &[Rule],
    id: ModuleId,
    now: SimTime,
    scratch: &mut Scratch,
) {
    let Some(class) = world.lives.get(world.tree.label(id)) else { return };
    if class.is_over_at_birth() {
        return;
    }
    let (label, life) = life(world, rules, id.slot() as u32, scratch);
    let first = world.tree.places(id).start;
    let mut values = Vec::new();
    values_at_event(&life, now, &mut values);
    for (i, value) in values.into_iter().enumerate() {
        world.tree.set_value(first + i, value);
    }
    world.lives.keep(label, life);
}

/// Gives a lazy module the state that it would have, had it never been lazy.
pub fn materialise(
    world: &mut World,
    rules: &[Rule],
    id: ModuleId,
    instant: &Instant,
    scratch: &mut Scratch,
) {
    let Some(class) = world.lives.get(world.tree.label(id)).cloned() else { return };
    let (label, life) = life(world, rules, id.slot() as u32, scratch);
    world.tree.set_label(id, NO_LABEL);
    let state = world.make_state(id);
    state.renew(id);
    state.put_under(class.rule, class.solve);
    state.marks.set_signs(&class.signs);
    state.since = life.birth;
    state.restart(instant.number);
    state.trajectories.assign(life.trajectories.iter().cloned());
    match class.end {
        Some(End::AtBirth { .. }) => state.place(false),
        Some(End::Crossing { atom, after, .. }) => {
            let change = Change::new(atom, life.at, [Sign::Zero, after]).at_level(life.level);
            state.next.touch(NextKind::Event, smallvec![change]);
        }
        None => {}
    }
    world.lives.keep(label, life);
}
