//! The lives of light modules: birth, event, successor.
//!
//! What happens here is what `quick`, `settle` and `lookup` do with a [`State`](super::state::State), for modules of
//! which only a label and the values at birth are kept (see `career`). Where a light module takes part in something
//! unusual, it is *promoted*: it gets the state that it would have had from the start.

use smallvec::SmallVec;

use super::around::Around;
use super::career::{Career, Child, End, Forecast, Life, REFUSED, same_bits};
use super::chance::{self, Misfortune};
use super::error::Error;
use super::event::Event;
use super::motion::Motion;
use super::quick::{First, Outlook, Prospect};
use super::settle::Firing;
use super::simulation::Simulation;
use super::state::{Change, What};
use dlsys_model::{Comparison, KindId, Outcome, Sign};
use dlsys_tree::{ModuleId, ModuleView, NO_LABEL, SimTime};

impl Simulation<'_> {
    /// Begins the life of a module whose kind may be light; false if it is not.
    pub(super) fn begin_lightly(&mut self, id: ModuleId, rule: usize) -> bool {
        let mut label = self.plant.tree.label(id);
        if label == NO_LABEL {
            let around = Around::default();
            self.plant.variables(&self.model.rules[rule], id, &around, self.now, &mut self.variables);
            let child = self.foresee(rule);
            label = child.label;
            self.plant.tree.set_label(id, label);
            if let Some(time) = child.time {
                self.agenda.push(time, id.slot() as u32);
            }
        }
        let Some(career) = self.plant.careers.get(label) else { return false };
        if career.is_over_at_birth() {
            // A cascade may be most of the structure: half the memory where nobody else is open.
            match self.opened.is_empty() {
                true => self.firing_light.push(id.slot() as u32),
                false => self.opened.push(id),
            }
        }
        true
    }

    /// What a module does that is born now with the parameters in `self.variables`.
    fn foresee(&mut self, rule: usize) -> Child {
        let timeless = self.plant.careers.is_timeless(rule);
        let arity = self.model.rules[rule].parameters.len();
        if timeless
            && let Some(known) = &self.plant.careers.forecasts[rule]
            && same_bits(&known.values, &self.variables[..arity])
        {
            let time = known.tau.map(|tau| self.now.ahead(tau));
            if time != Some(None) {
                let (label, time, tau) = (known.label, time.flatten(), known.tau);
                return Child { label, time, open: false, lasting: true, tau };
            }
        }
        let refused = Child { label: REFUSED, time: None, open: true, lasting: false, tau: None };
        let values = SmallVec::from_slice(&self.variables[..arity]);
        let Some(outlook) = self.outlook(&self.model.rules[rule]) else { return refused };
        let Prospect { solve, signs, first: First { event, lasting }, .. } = match outlook {
            Outlook::Lives(prospect) => prospect,
            Outlook::Over { produce, signs } => {
                let career = Career { rule, solve: None, signs, end: Some(End::AtBirth { produce }) };
                let label = self.plant.careers.intern(career);
                return label.map_or(refused, |label| Child { label, ..refused });
            }
        };
        let end = event.map(|(change, produce)| {
            let (atom, after) = (change.atom, change.after);
            End::Crossing { produce, atom, after }
        });
        let time = event.map(|(change, _)| change.time.to_f64());
        // An instant beyond all numbers is for others to think about.
        if time.is_some_and(|t| !t.is_finite()) {
            return refused;
        }
        let Some(label) = self.plant.careers.intern(Career { rule, solve, signs, end }) else {
            return refused;
        };
        let lasting = lasting.filter(|_| timeless);
        if let Some(tau) = lasting {
            self.plant.careers.forecasts[rule] = Some(Forecast { values, label, tau });
        }
        Child { label, time, open: false, lasting: lasting.is_some(), tau: lasting.flatten() }
    }

    /// The life of a light module, taken out of its career; to be given back.
    #[inline]
    fn life(&mut self, slot: u32) -> (u16, Box<Life>) {
        let ModuleView { label, birth, values, .. } = self.plant.tree.look(slot);
        let mut life = self.plant.careers.take_life(label);
        if !life.is_of(birth, values) {
            life.values.clear();
            life.values.extend_from_slice(values);
            life.birth = birth;
            self.live(label, &mut life);
        }
        (label, life)
    }

    /// Finds out what a light module does that has the birth and the values of `life`.
    fn live(&mut self, label: u16, life: &mut Life) {
        let birth = life.birth;
        (life.replaced, life.known, life.lasting) = (None, true, false);
        let career = self.plant.careers.get(label).expect("a light module");
        let (rule, solve, end) = (&self.model.rules[career.rule], career.solve, career.end);
        let timeless = self.plant.careers.is_timeless(career.rule);
        self.variables.clear();
        self.variables.extend_from_slice(&life.values);
        self.variables.extend([birth.to_f64(), birth.since(birth)]);
        let clause = solve.map(|s| &rule.solves[s]);
        life.motions = self.simple_motions(rule, clause).unwrap_or_default();
        (life.at, life.tau, life.level) = (birth, None, None);
        if let Some(End::Crossing { atom, .. }) = end {
            let watch = &rule.watch(solve)[atom];
            if let Some(meeting) = self.crossing(rule, clause, atom, watch, &life.motions, birth) {
                (life.at, life.level) = (meeting.time, meeting.level);
                life.tau = meeting.tau.filter(|_| timeless);
            }
        }
    }

    /// The instant of the event of the light module in a slot.
    pub(super) fn event_of(&mut self, slot: u32) -> SimTime {
        let (label, life) = self.life(slot);
        let at = life.at;
        self.plant.careers.keep(label, life);
        at
    }

    /// Makes the values that a light module has at its event, now, those of the tree: for messages.
    pub(super) fn stand_still(&mut self, id: ModuleId) {
        let label = self.plant.tree.label(id);
        let Some(career) = self.plant.careers.get(label) else { return };
        if career.is_over_at_birth() {
            return;
        }
        let (label, life) = self.life(id.slot() as u32);
        let first = self.plant.tree.places(id).start;
        let mut values = Vec::new();
        values_at_event(&life, self.now, &mut values);
        for (i, value) in values.into_iter().enumerate() {
            self.plant.tree.set_value(first + i, value);
        }
        self.plant.careers.keep(label, life);
    }

    /// Gives a light module the state that it would have, had it never been light.
    pub(super) fn promote(&mut self, id: ModuleId) {
        let label = self.plant.tree.label(id);
        let Some(career) = self.plant.careers.get(label).cloned() else { return };
        let (label, life) = self.life(id.slot() as u32);
        let group = self.group;
        self.plant.tree.set_label(id, NO_LABEL);
        let state = self.plant.make_state(id);
        state.renew(id);
        (state.rule, state.solve, state.signs) = (Some(career.rule), career.solve, career.signs);
        (state.since, state.restarted) = (life.birth, group);
        state.motions = life.motions.clone();
        state.next.what = What::Nothing;
        state.next.touched.clear();
        match career.end {
            Some(End::AtBirth { .. }) => state.place(false),
            Some(End::Crossing { atom, after, .. }) => {
                state.next.what = What::Event;
                let change = Change { atom, time: life.at, at: Sign::Zero, after, level: life.level };
                state.next.touched.push(change);
            }
            None => {}
        }
        self.plant.careers.keep(label, life);
    }

    /// Replaces a light module whose event it is. Nothing that others of the instant read changes by that.
    pub(super) fn replace_light(&mut self, slot: u32, rounds: usize) -> Result<(), Error> {
        let model = self.model;
        let (label, mut life) = self.life(slot);
        let look = self.plant.tree.look(slot);
        let (id, kind, lineage) = (look.id, look.kind, self.plant.tree.lineage_of(&look));
        let career = self.plant.careers.get(label).expect("a light module");
        let (rule, produce) = (career.rule, career.produce().expect("it is its event"));
        let clause = &model.rules[rule].produces[produce];
        let fire = Firing { id, rule, produce };
        // What chance decides, is another thing for each of them.
        let again = match life.replaced == Some(self.now) {
            true => !clause.outcome.is_random() && !clause.is_fault,
            false => life.end_again(self.now),
        };
        if !again && let Err(misfortune) = self.succeed(&mut life, id, rule, produce) {
            life.replaced = None;
            self.plant.careers.keep(label, life);
            self.stand_still(id);
            return Err(misfortune.error(self.site(&fire)));
        }
        if clause.is_fault {
            self.plant.careers.keep(label, life);
            self.stand_still(id);
            return Err(Error::NegativeRate { site: self.site(&fire) });
        }
        let successor = &clause.outcome.successors[life.successor];
        if self.plant.tree.len() + successor.kinds.len() > self.settings.max_modules {
            self.plant.careers.keep(label, life);
            self.stand_still(id);
            let limit = self.settings.max_modules;
            return Err(Error::TooManyModules { site: self.site(&fire), limit, rounds });
        }
        if let Err(shortage) = self.room_for(successor) {
            self.plant.careers.keep(label, life);
            self.stand_still(id);
            return Err(self.out_of_memory(shortage, self.site(&fire)));
        }
        let tree = &mut self.plant.tree;
        if let Some(log) = &mut self.log {
            log.push(Event {
                time: self.now.to_f64(),
                lineage,
                kind,
                rule,
                clause: produce,
                successor: clause.outcome.weights.is_some().then_some(life.successor),
                residual: life.residual,
                group: self.group,
                transition: None,
            });
        }
        let family = lineage.family(Outcome::production(clause.key, life.successor));
        let made = &mut self.made;
        made.clear();
        tree.replace(id, successor, &life.arguments, self.now, family, made);
        for (&id, child) in self.made.iter().zip(&life.children) {
            if child.label != NO_LABEL {
                tree.set_label(id, child.label);
            }
            if let Some(time) = child.time {
                self.agenda.push(time, id.slot() as u32);
            }
            if !child.open {
                continue;
            }
            // What ends as soon as it is there need not be looked at by anybody first.
            let goes_on = child.label < REFUSED && self.fresh.is_empty();
            match goes_on && self.plain && self.cuts.is_none() {
                true => self.firing_light.push(id.slot() as u32),
                false => self.fresh.push(id),
            }
        }
        self.plant.careers.keep(label, life);
        if self.hands_on {
            let made = std::mem::take(&mut self.made);
            self.hand_on(id, kind, successor, &made);
            self.made = made;
        }
        self.stats.events += 1;
        self.stats.peak_modules = self.stats.peak_modules.max(self.plant.tree.len() as u64);
        Ok(())
    }

    /// Finds out what follows from the end of a life now.
    fn succeed(
        &mut self,
        life: &mut Life,
        id: ModuleId,
        rule: usize,
        produce: usize,
    ) -> Result<(), Misfortune> {
        let model = self.model;
        let (label, lineage) = (self.plant.tree.label(id), self.plant.tree.lineage(id));
        let compiled = &model.rules[rule];
        let clause = &compiled.produces[produce];
        self.variables.clear();
        values_at_event(life, self.now, &mut self.variables);
        self.variables.extend([self.now.to_f64(), self.now.since(life.birth)]);
        life.children.clear();
        life.arguments.clear();
        (life.replaced, life.lasting) = (Some(self.now), false);
        if clause.is_fault {
            return Ok(());
        }
        if self.log.is_some() {
            life.residual = self.residual(label, rule, produce);
        }
        let (seed, variables, scratch) = (self.seed, &mut self.variables, &mut self.scratch);
        let which = chance::decide(seed, &clause.outcome, clause.key, lineage, variables, scratch)?;
        let successor = &clause.outcome.successors[which];
        life.successor = which;
        let family = lineage.family(Outcome::production(clause.key, which));
        chance::arguments(seed, successor, family, variables, scratch, &mut life.arguments)?;
        let mut rest = &life.arguments[..];
        for &kind in successor.kinds.iter().filter(|kind| !kind.is_bracket()) {
            let (own, others) = rest.split_at(self.model.kinds.get(kind).width());
            rest = others;
            let child = self.child(kind, own);
            life.children.push(child);
        }
        life.lasting =
            self.plant.careers.is_lasting(rule, produce) && life.children.iter().all(|c| c.lasting);
        Ok(())
    }

    /// What a newborn module of a kind is going to do.
    fn child(&mut self, kind: KindId, parameters: &[f64]) -> Child {
        match self.plant.careers.rule(kind) {
            Some(rule) => {
                self.variables.clear();
                self.variables.extend_from_slice(parameters);
                self.variables.extend([self.now.to_f64(), self.now.since(self.now)]);
                self.foresee(rule)
            }
            None => {
                let open = Some(kind) == self.cuts || !self.model.kinds.get(kind).has_no_rules();
                Child { label: NO_LABEL, time: None, open, lasting: true, tau: None }
            }
        }
    }

    /// How far the instant is from the boundary: see [`Event::residual`]. By `self.variables`.
    fn residual(&mut self, label: u16, rule: usize, produce: usize) -> f64 {
        let rule = &self.model.rules[rule];
        let career = self.plant.careers.get(label).expect("a light module");
        let mut sides: SmallVec<[f64; 16]> = smallvec::smallvec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.variables, &mut self.scratch, &mut sides);
        let zero = |atom: usize| match career.end {
            Some(End::Crossing { atom: touched, .. }) => atom == touched,
            _ => career.signs[atom] == Sign::Zero,
        };
        (rule.produces[produce].guard.atoms())
            .filter(|(atom, comparison)| *comparison == Comparison::Equal || zero(*atom))
            .map(|(atom, _)| (sides[2 * atom] - sides[2 * atom + 1]).abs())
            .fold(0.0, f64::max)
    }
}

/// The parameters at the event, appended to `out`. Where the instant is known from a level, the value is that level, not
/// a rounding of it.
fn values_at_event(life: &Life, at: SimTime, out: &mut Vec<f64>) {
    let tau = at.since(life.birth).max(0.0);
    for (i, &x) in life.values.iter().enumerate() {
        out.push(match (life.motions.get(i), life.level) {
            (_, Some((parameter, level))) if parameter == i => level,
            (None | Some(Motion::Rest), _) => x,
            (Some(formula), _) => x + formula.value(tau),
        });
    }
}
