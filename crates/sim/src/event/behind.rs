//! The instant behind a jump.
//!
//! `if floor(x)*2 + 1 != n produce A(floor(x)*2 + 1)`: the difference of the sides is not zero where x reaches a whole number, it
//! jumps there. The instant of a jump is known to rounding only, and at a time a rounding too early the condition does not hold, and a
//! successor gets the value from before. So the event takes place at the first time at which the condition holds by the numbers that
//! the successor is computed from. The same goes for `floor(p + z) != n`, where the sides that meet, `p + z` and `n + 1`, meet in no
//! variable that could be given the value at the level.

use super::EventStage;
use super::levels::put_levels;
use crate::detect::signs::opposite;
use crate::world::path::Path;
use crate::world::state::{Change, Next, NextKind, Signs};
use dlsys_expr::Dual;
use dlsys_model::{Comparison, Model, Rule, Sign, Truth};
use dlsys_tree::{ModuleId, SimTime};

/// No event is put off by more than this part of the present time, or of 1: then what jumps moves less than its rounding.
const LONGEST_DELAY: f64 = 1e-6;

/// Sides of what is integrated have parted by more than rounding after this part of the present time, or of 1.
const LONGEST_BLUR: f64 = 1e-12;

/// What is integrated goes on from numbers that differ by a rounding from those of the instant, so it has to be past the jump by this part of its size.
const CLEARANCE: f64 = 8.0 * f64::EPSILON;

/// And none by less: near t = 0 the resolution of time is so fine that what has moved is less than the smallest normal number.
const SHORTEST_DELAY: f64 = 1e-18;

/// When the event of a module takes place.
#[derive(Clone, Copy)]
pub(super) enum When {
    /// Now.
    Now,
    /// Now, behind a jump: the signs at the instant are those by the numbers of now.
    Behind,
    /// Not before then.
    Later(SimTime),
    /// Never, by the numbers of now: it was found with others, or only touches.
    Never,
}

/// The question whether a production holds, as a function of the signs of what jumps.
struct Question<'r> {
    rule: &'r Rule,
    /// The signs just before the instant.
    before: Signs,
    touched: Vec<Change>,
    /// By change: it is that of a jump.
    jumps: Vec<bool>,
}

impl Question<'_> {
    /// True if some production holds, where the touched atoms have such signs.
    fn holds_with(&self, sign: impl Fn(usize) -> Sign) -> bool {
        let of = |atom: usize| match self.touched.iter().position(|change| change.atom() == atom) {
            Some(place) => sign(place),
            None => self.before[atom],
        };
        self.rule.produces.iter().any(|produce| produce.guard.judge(of) == Truth::Yes)
    }

    /// True if a production holds just after the instant.
    fn follows(&self) -> bool {
        self.holds_with(|place| self.touched[place].after)
    }

    /// True if a production holds at the instant or just after it, where what jumps has these signs.
    fn holds(&self, signs: &[Sign]) -> bool {
        let of = |place: usize, other: Sign| if self.jumps[place] { signs[place] } else { other };
        // Behind a jump no zero of what jumps tells anything: as `production_at` has it.
        let is_behind = (0..signs.len()).any(|place| self.jumps[place] && signs[place] != Sign::Zero);
        let at = |place: usize| match self.touched[place].at {
            Sign::Zero if is_behind && self.rule.jumping[self.touched[place].atom()] => Sign::Any,
            sign => sign,
        };
        self.holds_with(|place| of(place, at(place)))
            || self.holds_with(|place| of(place, self.touched[place].after))
    }
}

impl<'m> EventStage<'_, 'm> {
    /// True if the instant of a change of sign has to be put behind a jump.
    fn is_jump(&self, rule: usize, change: &Change) -> bool {
        let (of_rule, atom) = (&self.setup.model.rules[rule], change.atom());
        if of_rule.jumping_whole[atom] {
            return true;
        }
        // The sign of zero is zero at an instant only.
        let mut compared = of_rule.produces.iter().flat_map(|produce| produce.guard.atoms());
        of_rule.jumping[atom]
            && change.level().is_none_or(|(variable, _)| variable >= of_rule.first_aggregate)
            && !compared.any(|compared| compared == (atom, Comparison::Equal))
    }

    /// When the event of a module takes place whose signs change so, by the numbers of now and of a little later. The signs at the
    /// instant become those by the numbers, where that is now.
    pub(super) fn behind_jumps(&mut self, id: ModuleId, touched: &mut [Change]) -> When {
        let Some(rule) = self.world.state(id).and_then(|state| state.rule.get()) else { return When::Now };
        if self.setup.leads_to_edges[rule]
            && let When::Later(time) = self.behind_edge(id, rule, touched)
        {
            return When::Later(time);
        }
        if !self.setup.has_jumps[rule] {
            return When::Now;
        }
        self.level_signs(id, rule, touched);
        let jumps: Vec<bool> = touched.iter().map(|change| self.is_jump(rule, change)).collect();
        if !jumps.contains(&true) {
            return When::Now;
        }
        let question = self.question(id, rule, touched, jumps);
        if !question.follows() {
            return When::Now;
        }
        let at = self.instant.at;
        // Of numbers below the normal ones parts are lost.
        let is_normal = at.to_f64() == 0.0 || at.to_f64().abs() >= SHORTEST_DELAY;
        let now = self.signs_by_numbers(id, rule, touched);
        let is_integrated = self.is_integrated(id, rule, touched, &question.jumps);
        let is_past = |stage: &mut Self, delay: f64| {
            question.holds(&stage.signs_later(id, rule, touched, delay, 0.0))
                && (!is_integrated || question.holds(&stage.signs_later(id, rule, touched, delay, CLEARANCE)))
        };
        self.flows.known_rates.clear();
        if is_normal && question.holds(&now) && (!is_integrated || is_past(self, 0.0)) {
            return self.at_the_numbers(touched, &question.jumps, &now);
        }
        let longest = LONGEST_DELAY * at.to_f64().abs().max(1.0);
        let waited = touched.iter().map(|change| at.since(change.time)).fold(0.0, f64::max);
        let mut delay = at.resolution().max(SHORTEST_DELAY).max(waited);
        while delay <= longest {
            if is_past(self, delay) {
                let is_whole = |change: &Change| self.setup.model.rules[rule].jumping_whole[change.atom()];
                if !touched.iter().any(is_whole) && self.has_event_beside(id) {
                    let then: Vec<Sign> = touched.iter().map(|change| change.after).collect();
                    return self.at_the_numbers(touched, &question.jumps, &then);
                }
                return When::Later(at.after(delay));
            }
            delay *= 2.0;
        }
        // It only touches: nothing follows from signs that it does not get.
        let later = self.signs_later(id, rule, touched, longest, 0.0);
        for (place, change) in touched.iter_mut().enumerate().filter(|(place, _)| question.jumps[*place]) {
            (change.at, change.after) = (now[place], later[place]);
        }
        When::Never
    }

    /// When sides have met of which neighbours' values are a part, where a production leads to equations that end at an edge (`sqrt(x + y - 3.4)`): once
    /// their numbers, which go on as they are, are no rounding beyond it.
    fn behind_edge(&mut self, id: ModuleId, rule: usize, touched: &[Change]) -> When {
        let of_rule = &self.setup.model.rules[rule];
        let is_around = |atom: usize| {
            let around = of_rule.parameters.len()..of_rule.time_variable();
            let jumps = of_rule.jumping[atom] || of_rule.jumping_whole[atom];
            !jumps && of_rule.atom_reads[atom].iter().any(|v| around.contains(v))
        };
        let met: Vec<Change> = (touched.iter().copied())
            .filter(|change| change.at == Sign::Zero && is_around(change.atom()))
            .collect();
        if met.is_empty() || self.has_event_beside(id) {
            return When::Now;
        }
        let is_integrated = self.is_integrated(id, rule, &met, &vec![true; met.len()]);
        let clearances = if is_integrated { &[0.0, CLEARANCE][..] } else { &[0.0] };
        let at = self.instant.at;
        self.flows.known_rates.clear();
        let is_beyond = |stage: &mut Self, delay: f64| {
            clearances.iter().any(|clearance| {
                let signs = stage.signs_later(id, rule, &met, delay, *clearance);
                signs.iter().zip(&met).any(|(sign, change)| *sign == opposite(change.after))
            })
        };
        if !is_beyond(self, 0.0) {
            return When::Now;
        }
        let mut delay = at.resolution().max(SHORTEST_DELAY);
        while delay <= LONGEST_BLUR * at.to_f64().abs().max(1.0) {
            if !is_beyond(self, delay) {
                return When::Later(at.after(delay));
            }
            delay *= 2.0;
        }
        When::Now
    }

    /// True if a module that this one reads, or one that reads it, has its own event now: put off, one would find the other replaced.
    fn has_event_beside(&self, id: ModuleId) -> bool {
        self.setup.looks_around && self.around(id).iter().any(|beside| self.has_event_now(*beside))
    }

    /// True if the instant concerns a module, or will once all of its batch are opened.
    fn has_event_now(&self, id: ModuleId) -> bool {
        let now = self.instant.at;
        let is_next = |next: &Next| {
            next.kind == NextKind::Event
                && next.touched().iter().any(|change| change.time.since(now) <= now.resolution())
        };
        self.takes_place(id) || self.world.state(id).is_some_and(|state| is_next(&state.next))
    }

    /// Gives signs that are zero at the instant, of differences of several variables that move, a variable and its number at which
    /// they are.
    fn level_signs(&mut self, id: ModuleId, rule: usize, touched: &mut [Change]) {
        let of_rule = &self.setup.model.rules[rule];
        for change in touched.iter_mut().filter(|change| of_rule.jumping[change.atom()]) {
            if change.level().is_none() && change.at == Sign::Zero && !self.is_jump(rule, change) {
                *change = change.at_level(self.meeting(id, of_rule, change.atom()));
            }
        }
    }

    /// What the production of a module depends on whose signs change so.
    fn question(&self, id: ModuleId, rule: usize, touched: &[Change], jumps: Vec<bool>) -> Question<'m> {
        let model: &'m Model = self.setup.model;
        let state = self.world.state(id).expect("scheduled");
        let before = self.signs_now(state);
        Question { rule: &model.rules[rule], before, touched: touched.to_vec(), jumps }
    }

    /// Makes the signs of what jumps those by the numbers of now.
    fn at_the_numbers(&mut self, touched: &mut [Change], jumps: &[bool], now: &[Sign]) -> When {
        let mut is_behind = false;
        for (place, change) in touched.iter_mut().enumerate().filter(|(place, _)| jumps[*place]) {
            *change = change.at_level(None);
            change.at = now[place];
            if now[place] != Sign::Zero {
                change.after = now[place];
                is_behind = true;
            }
        }
        self.events.is_after |= is_behind;
        if is_behind { When::Behind } else { When::Now }
    }

    /// The signs of differences by the numbers of now.
    fn signs_by_numbers(&mut self, id: ModuleId, index: usize, touched: &[Change]) -> Vec<Sign> {
        let rule = &self.setup.model.rules[index];
        let state = self.world.state(id).expect("scheduled");
        let variables = &mut self.scratch.variables;
        self.world.variables(rule, id, &state.context, self.instant.at, variables);
        put_levels(&self.events.met, (&self.world.tree, id), &state.context, variables);
        for (variable, level) in touched.iter().filter_map(Change::level) {
            if variable < rule.first_aggregate {
                variables[variable] = level;
            }
        }
        signs(rule, touched, &self.scratch.variables, &mut self.scratch.registers)
    }

    /// True if something is integrated of which the differences are made that jump.
    fn is_integrated(&self, id: ModuleId, rule: usize, touched: &[Change], jumps: &[bool]) -> bool {
        let (of_rule, state) = (&self.setup.model.rules[rule], self.world.state(id).expect("scheduled"));
        let path = Path::new(self.world, state, of_rule, self.instant.at, 0.0);
        let mut jumping = touched.iter().zip(jumps).filter(|(_, jumps)| **jumps);
        jumping.any(|(change, _)| path.is_integrated(&of_rule.atom_reads[change.atom()]))
    }

    /// The signs of differences a little later, where all that moves has not come as far by this part of its size. What a neighbour has at its own event
    /// is known.
    fn signs_later(
        &mut self,
        id: ModuleId,
        index: usize,
        touched: &[Change],
        delay: f64,
        clearance: f64,
    ) -> Vec<Sign> {
        let mut moving: Vec<Dual<f64>> = Vec::new();
        self.flow().moving_variables(id, delay, &mut moving);
        let rule = &self.setup.model.rules[index];
        let state = self.world.state(id).expect("scheduled");
        let path = Path::new(self.world, state, rule, self.instant.at, 0.0);
        let back = |variable: usize, v: &Dual<f64>| {
            let moves = v.rate != 0.0 && path.moves(variable);
            if moves { clearance * v.value.abs() * v.rate.signum() } else { 0.0 }
        };
        let values: Vec<f64> = moving.iter().enumerate().map(|(i, v)| v.value - back(i, v)).collect();
        signs(rule, touched, &values, &mut self.scratch.registers)
    }
}

/// The signs of the differences of touched atoms, by the values of the rule's variables.
pub(super) fn signs(
    rule: &Rule,
    touched: &[Change],
    variables: &[f64],
    registers: &mut Vec<f64>,
) -> Vec<Sign> {
    let mut sides = vec![0.0; rule.sides.outputs()];
    rule.sides.eval(variables, registers, &mut sides);
    touched.iter().map(|change| Sign::of(sides[2 * change.atom()] - sides[2 * change.atom() + 1])).collect()
}
