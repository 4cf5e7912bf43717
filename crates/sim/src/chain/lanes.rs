//! Lives in lanes: what `flow::prediction` computes for one newborn, for up to [`LANES`] newborns of one kind at once, by the
//! same functions on the same numbers, hence to the same bits.

use dlsys_expr::{LANES, Lanes};
use dlsys_model::{Rule, Sign, SolutionForm, ZeroCrossing};
use dlsys_tree::SimTime;
use smallvec::SmallVec;

use super::law::{Law, is_simple};
use super::straight::{Firsts, NEVER, Newborns, is_linear, is_straight};
use crate::detect::signs::{NEAR, opposite, rate_at};
use crate::flow::closed_form::integrated;
use crate::flow::prediction::{
    FirstCrossing, Outlives, PredictedCrossing, first_crossing, follows, meeting, outlives,
};
use crate::scratch::Scratch;
use crate::trajectory::{Riccati, Trajectory};
use crate::world::life::{End, LifeClass, Lives};

/// The life of a newborn.
#[derive(Clone, Copy, Debug)]
pub enum Fate {
    /// It goes the general way.
    General,
    /// It lives for ever, in this class.
    Lasts(u16),
    /// It has its event then. The number is the level that a parameter meets.
    Ends(u16, SimTime, f64),
}

/// Up to [`LANES`] modules of one rule, and the memory to compute with.
#[derive(Debug, Default)]
pub struct Block {
    pub count: usize,
    /// The variables of the rule, then temporaries.
    pub registers: Vec<Lanes>,
    pub births: Vec<SimTime>,
    /// The coefficients of the equations of a clause, four each.
    coefficients: Vec<[Lanes; 4]>,
    /// The levels of the atoms.
    levels: Vec<Lanes>,
    /// By atom: the instants at which the sides meet.
    meetings: Vec<[Option<PredictedCrossing>; LANES]>,
    firsts: Firsts,
    /// The classes of the newborns, by lane; none for those that go the general way.
    alike: [Option<u16>; LANES],
    scratch: Scratch,
}

/// The trajectory of a parameter that has the value `x` at birth, by the coefficients of its equation.
#[inline(always)]
fn trajectory(law: &SolutionForm, c: &[Lanes; 4], lane: usize, x: f64) -> Trajectory {
    match law {
        SolutionForm::Polynomial(program) => {
            let c = [c[0][lane], c[1][lane], c[2][lane], c[3][lane]];
            Trajectory::Polynomial(integrated(&c[..program.outputs()], 0.0))
        }
        _ => Trajectory::Riccati(Riccati::new(x, c[0][lane], c[1][lane], c[2][lane])),
    }
}

/// The same of a linear function.
#[inline(always)]
fn linear(c: &[Lanes; 4], lane: usize) -> Trajectory {
    Trajectory::Polynomial(integrated(&[c[0][lane]], 0.0))
}

/// The label of the class with the signs of another one whose lives end when the sides of an atom meet, or never.
#[cold]
fn label_of_end(lives: &Lives, rule: &Rule, like: &LifeClass, atom: Option<usize>) -> Option<u16> {
    let LifeClass { solve, signs, .. } = like;
    let end = match atom {
        Some(atom) => {
            let (produce, after) = (follows(rule, signs, atom)?, opposite(signs[atom]));
            Some(End::Crossing { produce, atom, after })
        }
        None => None,
    };
    let is_it = |other: &LifeClass| other.end == end && other.solve == *solve && other.signs == *signs;
    lives.labels_of(rule.index).iter().copied().find(|label| lives.get(*label).is_some_and(is_it))
}

/// Leaves those lanes true in which the sides of an atom clearly differ and have a sign. The same as
/// [`is_clear`](crate::flow::prediction::is_clear) and
/// [`sign_at_birth`](crate::detect::signs::sign_at_birth): sides that clearly differ are not equal.
#[inline]
fn has_sign(sign: Sign, [a, b]: [&Lanes; 2], scale: &Lanes, is_like: &mut [bool; LANES]) {
    let sign = match sign {
        Sign::Plus => 1.0,
        Sign::Minus => -1.0,
        // Those clearly have none.
        _ => return *is_like = [false; LANES],
    };
    for (lane, is_like) in is_like.iter_mut().enumerate() {
        let gap = sign * (a[lane] - b[lane]);
        *is_like &= (gap > NEAR * scale[lane].max(a[lane].abs())) & (gap < f64::INFINITY);
    }
}

impl Block {
    /// The registers of the variables of a rule.
    pub fn make_variables(&mut self, rule: &Rule) {
        self.registers.resize(self.registers.len().max(rule.variables), Lanes::default());
    }

    /// The lives of newborns whose parameters are in the registers. `label` is their class, if it is known.
    pub fn foresee(&mut self, lives: &Lives, rule: &Rule, label: Option<u16>, fates: &mut Vec<Fate>) {
        self.put_births(rule);
        fates.clear();
        fates.resize(self.count, Fate::General);
        self.alike = [label; LANES];
        if label.is_none() {
            self.classify(lives, rule);
        }
        // Nearly always all lanes have one class.
        while let Some(label) = self.alike[..self.count].iter().copied().flatten().next() {
            let mut of_class = [false; LANES];
            for (like, is_it) in self.alike.iter_mut().zip(&mut of_class) {
                *is_it = *like == Some(label);
                if *is_it {
                    *like = None;
                }
            }
            if let Some(class) = lives.get(label).filter(|class| is_simple(rule, class.solve)) {
                self.evaluate(rule, class.solve);
                match is_straight(class.solve.map(|solve| &rule.solves[solve])) {
                    true => self.decide_straight(lives, rule, (label, class), &of_class, fates),
                    false => self.decide(lives, rule, (label, class), of_class, fates),
                }
            }
        }
    }

    /// The lives of those of the modules that have the signs of a class in which nothing is curved.
    fn decide_straight(
        &mut self,
        lives: &Lives,
        rule: &Rule,
        (label, class): (u16, &LifeClass),
        of_class: &[bool; LANES],
        fates: &mut [Fate],
    ) {
        let Block { count, registers, births, coefficients, levels, firsts, .. } = self;
        firsts.find(rule, class.solve, &Newborns { count: *count, registers, births, coefficients, levels });
        let usual = match class.end {
            Some(End::Crossing { atom, .. }) => atom as u32,
            _ => NEVER,
        };
        for (lane, fate) in fates.iter_mut().enumerate() {
            let (atom, at) = (firsts.atom[lane], firsts.at[lane]);
            if !of_class[lane] || firsts.general[lane] || atom != NEVER && !at.to_f64().is_finite() {
                continue;
            }
            let label = match atom == usual {
                true => Some(label),
                false => {
                    let atom = Some(atom as usize).filter(|_| atom != NEVER);
                    label_of_end(lives, rule, class, atom)
                }
            };
            *fate = match label {
                None => Fate::General,
                Some(label) if atom == NEVER => Fate::Lasts(label),
                Some(label) => Fate::Ends(label, at, firsts.level[lane]),
            };
        }
    }

    /// The lives of those of the modules that have the signs of a class.
    fn decide(
        &mut self,
        lives: &Lives,
        rule: &Rule,
        (label, class): (u16, &LifeClass),
        mut open: [bool; LANES],
        fates: &mut [Fate],
    ) {
        let own = &self.registers[..rule.parameters.len()];
        let timeless = lives.is_timeless(rule.index);
        // Of a module with the values of one before it, that one.
        let mut original = [usize::MAX; LANES];
        let mut last = 0;
        for lane in 0..self.count {
            let equal = |lanes: &Lanes| lanes[lane].to_bits() == lanes[last].to_bits();
            let is_new = !open[lane] || !open[last] || lane == 0 || !own.iter().all(equal);
            match is_new || !timeless && self.births[lane] != self.births[last] {
                true => last = lane,
                false => original[lane] = last,
            }
        }
        let mut lasting: [Option<Option<f64>>; LANES] = [None; LANES];
        // Those that are the first with their values, then those to which something else happens than to these.
        for first in [true, false] {
            let wanted: [bool; LANES] =
                std::array::from_fn(|lane| open[lane] && (!first || original[lane] == usize::MAX));
            if !wanted.contains(&true) {
                continue;
            }
            self.meet(rule, class.solve, &wanted);
            for lane in (0..self.count).filter(|lane| wanted[*lane]) {
                open[lane] = false;
                if let Some(found) = self.fate(lives, rule, (label, class), lane) {
                    (fates[lane], lasting[lane]) = found;
                }
            }
            for lane in 0..self.count {
                let like = original[lane];
                if first
                    && like != usize::MAX
                    && let Some(fate) = self.again(fates[like], lasting[like], [like, lane])
                {
                    (fates[lane], open[lane]) = (fate, false);
                }
            }
        }
    }

    /// Finds a class with the signs of each newborn; none if there is none, or they end at birth.
    fn classify(&mut self, lives: &Lives, rule: &Rule) {
        let sides: SmallVec<[usize; 8]> = rule.sides.eval_rows(&mut self.registers, self.count).collect();
        let mut scale = Lanes::all(1.0);
        for own in &self.registers[..rule.parameters.len()] {
            scale = Lanes(std::array::from_fn(|lane| scale[lane].max(own[lane].abs())));
        }
        let mut open = [true; LANES];
        for &label in lives.labels_of(rule.index) {
            let Some(class) = lives.get(label) else { continue };
            let mut is_like = open;
            for (side, sign) in sides.chunks(2).zip(&class.signs) {
                let (a, b) = (&self.registers[side[0]], &self.registers[side[1]]);
                has_sign(*sign, [a, b], &scale, &mut is_like);
            }
            let label = Some(label).filter(|_| !class.is_over_at_birth());
            for lane in 0..self.count {
                if is_like[lane] {
                    (self.alike[lane], open[lane]) = (label, false);
                }
            }
            if !open[..self.count].contains(&true) {
                break;
            }
        }
    }

    /// Computes the coefficients of a clause's equations and the levels of the atoms.
    fn evaluate(&mut self, rule: &Rule, solve: Option<usize>) {
        let clause = solve.map(|solve| &rule.solves[solve]);
        let laws = clause.map_or(&[][..], |clause| &clause.solution_forms);
        self.coefficients.resize(self.coefficients.len().max(laws.len()), [Lanes::default(); 4]);
        for (law, out) in laws.iter().zip(&mut self.coefficients) {
            let (SolutionForm::Polynomial(program) | SolutionForm::Quadratic(program)) = law else {
                continue;
            };
            for (register, out) in program.eval_rows(&mut self.registers, self.count).zip(out) {
                *out = self.registers[register];
            }
        }
        let watches = rule.zero_crossings(solve);
        self.levels.resize(self.levels.len().max(watches.len()), Lanes::default());
        for (watch, out) in watches.iter().zip(&mut self.levels) {
            if let ZeroCrossing::Formula { level, .. } = watch
                && let Some(register) = level.eval_rows(&mut self.registers, self.count).next()
            {
                *out = self.registers[register];
            }
        }
    }

    /// Computes at which instants the sides of each atom meet, of the modules that are wanted.
    fn meet(&mut self, rule: &Rule, solve: Option<usize>, wanted: &[bool; LANES]) {
        let (clause, watches) = (solve.map(|solve| &rule.solves[solve]), rule.zero_crossings(solve));
        let time = rule.time_variable();
        self.meetings.resize(self.meetings.len().max(watches.len()), [None; LANES]);
        let Block { count, registers, births, coefficients, levels, meetings, scratch, .. } = self;
        for (atom, (watch, meetings)) in watches.iter().zip(meetings).enumerate() {
            *meetings = [None; LANES];
            let ZeroCrossing::Formula { variable, .. } = watch else { continue };
            if clause.is_some_and(|clause| clause.unreachable[atom]) {
                continue;
            }
            let equation = clause.and_then(|clause| clause.of.iter().position(|of| of == variable));
            let law = equation
                .zip(clause)
                .map(|(equation, clause)| (&clause.solution_forms[equation], &coefficients[equation]));
            let levels = &levels[atom];
            let mut meet_one = |lane: usize, trajectory: Option<&Trajectory>| {
                let (level, start) = (levels[lane], registers[*variable][lane]);
                let exact = || {
                    let Scratch { variables, registers: memory, rates } = &mut *scratch;
                    variables.clear();
                    variables.extend(registers[..rule.variables].iter().map(|lanes| lanes[lane]));
                    rate_at(clause, variables, *variable, level, memory, rates)
                };
                meeting((*variable, time), level, trajectory, (births[lane], start), exact)
            };
            // The choice of the formula is made once, not for every lane.
            let lanes = meetings.iter_mut().enumerate().take(*count);
            for (lane, meeting) in lanes.filter(|(lane, _)| wanted[*lane]) {
                *meeting = match law {
                    Some((law, c)) if is_linear(law) => meet_one(lane, Some(&linear(c, lane))),
                    Some((law, c)) => {
                        meet_one(lane, Some(&trajectory(law, c, lane, registers[*variable][lane])))
                    }
                    None => meet_one(lane, None),
                };
            }
        }
    }

    /// The life of a module that is born with the same values as another, whose life is known; None if it may have another life.
    #[inline]
    fn again(&self, fate: Fate, lasting: Option<Option<f64>>, [like, lane]: [usize; 2]) -> Option<Fate> {
        let birth = self.births[lane];
        if birth == self.births[like] {
            return Some(fate);
        }
        match (fate, lasting?) {
            (Fate::Ends(label, _, level), Some(tau)) => {
                birth.ahead(tau).map(|_| Fate::Ends(label, birth.after(tau), level))
            }
            (fate, _) => Some(fate),
        }
    }

    /// The life of one module with the signs of a class, and its length, if that does not depend on the birth; None if it goes the
    /// general way.
    #[inline]
    fn fate(
        &self,
        lives: &Lives,
        rule: &Rule,
        (label, class): (u16, &LifeClass),
        lane: usize,
    ) -> Option<(Fate, Option<Option<f64>>)> {
        let LifeClass { solve, signs, .. } = class;
        let (birth, clause) = (self.births[lane], solve.map(|solve| &rule.solves[solve]));
        let laws = || {
            let laws = clause.map_or(&[][..], |clause| &clause.solution_forms).iter();
            let of = clause.map_or(&[][..], |clause| &clause.of).iter();
            laws.zip(of).zip(&self.coefficients).map(|((law, parameter), c)| (law, *parameter, c))
        };
        for (law, parameter, c) in laws() {
            let rate = match is_linear(law) {
                true => c[0][lane],
                false => trajectory(law, c, lane, self.registers[parameter][lane]).rate(0.0),
            };
            if !rate.is_finite() {
                return None;
            }
        }
        let meet = |atom: usize| self.meetings[atom][lane];
        let FirstCrossing { change, lasting } =
            first_crossing(rule.zero_crossings(*solve), signs, birth, meet)?;
        if change.is_some_and(|change| !change.time.to_f64().is_finite()) {
            return None;
        }
        let mut lasting = lasting;
        for (law, parameter, c) in laws().filter(|(law, ..)| !is_linear(law)) {
            let trajectory = trajectory(law, c, lane, self.registers[parameter][lane]);
            match outlives(trajectory.end(), birth, change.map(|change| change.time)) {
                Outlives::Always => {}
                Outlives::Event => lasting = None,
                Outlives::Not => return None,
            }
        }
        let atom = change.map(|change| change.atom());
        let label = match (atom, class.end) {
            (Some(atom), Some(End::Crossing { atom: usual, .. })) if atom == usual => label,
            (None, None) => label,
            _ => label_of_end(lives, rule, class, atom)?,
        };
        let fate = match change {
            Some(change) => Fate::Ends(label, change.time, change.level().map_or(0.0, |(_, level)| level)),
            None => Fate::Lasts(label),
        };
        Some((fate, lasting))
    }

    /// Brings modules, whose variables in the registers are those of their births, to their events: each at an instant, with the level that a
    /// parameter meets then.
    pub fn end(&mut self, law: &Law, ends: impl ExactSizeIterator<Item = (SimTime, f64)> + Clone) {
        let time = law.rule.time_variable();
        let clause = law.solve.map(|solve| &law.rule.solves[solve]);
        let others = clause.is_some_and(|clause| clause.of.iter().any(|moving| Some(*moving) != law.meets));
        if others {
            self.put_births(law.rule);
            self.evaluate(law.rule, law.solve);
        }
        for (lane, (at, level)) in ends.enumerate() {
            let age = at.since(self.births[lane]);
            if others && let Some(clause) = clause {
                let laws = clause.solution_forms.iter().zip(&clause.of).zip(&self.coefficients);
                for ((law, &parameter), c) in laws.filter(|((_, of), _)| Some(**of) != law.meets) {
                    let x = &mut self.registers[parameter][lane];
                    *x = trajectory(law, c, lane, *x).at(*x, age.max(0.0));
                }
            }
            // Where the instant is known from a level, the value is that level, not a rounding of it.
            if let Some(parameter) = law.meets {
                self.registers[parameter][lane] = level;
            }
            (self.registers[time][lane], self.registers[time + 1][lane]) = (at.to_f64(), age);
        }
    }

    /// Makes `t` and `age` those of the births.
    fn put_births(&mut self, rule: &Rule) {
        let time = rule.time_variable();
        self.registers[time] =
            Lanes(std::array::from_fn(|lane| self.births.get(lane).map_or(0.0, |b| b.to_f64())));
        self.registers[time + 1] = Lanes::default();
    }

    /// The largest difference between the sides of some atoms, of each module.
    pub fn residuals(&mut self, rule: &Rule, atoms: &[usize]) -> Lanes {
        let sides: SmallVec<[usize; 8]> = rule.sides.eval_rows(&mut self.registers, self.count).collect();
        let mut residuals = Lanes::default();
        for &atom in atoms {
            let (a, b) = (self.registers[sides[2 * atom]], self.registers[sides[2 * atom + 1]]);
            for (lane, residual) in residuals.iter_mut().enumerate() {
                *residual = residual.max((a[lane] - b[lane]).abs());
            }
        }
        residuals
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::signs::sign_at_birth;
    use crate::flow::prediction::is_clear;

    #[test]
    fn signs_in_lanes_are_those_of_single_modules() {
        let numbers = [0.0, -0.0, 1.0, 1.0 + 1e-10, 1.0 + 1e-8, -1.0, 1e-12, 5e9, -5e9 - 1.0, 1e300, -1e300]
            .into_iter()
            .chain([f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1.7e308, -1.7e308, 5e-324]);
        let numbers: Vec<f64> = numbers.collect();
        for (&a, &b) in numbers.iter().flat_map(|a| numbers.iter().map(move |b| (a, b))) {
            for scale in [1.0, 3e9] {
                for sign in [Sign::Plus, Sign::Minus, Sign::Zero, Sign::Any, Sign::Undefined] {
                    let mut found = [true; LANES];
                    has_sign(sign, [&Lanes::all(a), &Lanes::all(b)], &Lanes::all(scale), &mut found);
                    let expected = is_clear(a, b, scale) && sign_at_birth(a, b) == sign;
                    assert_eq!(found, [expected; LANES], "{a} {b} {scale} {sign:?}");
                }
            }
        }
    }
}
