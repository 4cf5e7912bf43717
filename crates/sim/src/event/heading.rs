//! Where signs that are zero at an instant go just after it, under the present equations.
//!
//! A difference that moves goes with its rate; one that does not is looked at a little later, and so is one that jumps. What no influence has reached
//! yet does not move: its rate is the noise of integration.

use super::EventStage;
use super::modes::FAR_AWAY;
use crate::detect::signs::{NEAR, noise, opposite, sign_at_birth};
use crate::world::path::NEXT_TO_NOTHING;
use crate::world::state::Signs;
use dlsys_expr::Dual;
use dlsys_model::{Rule, Sign};
use dlsys_tree::ModuleId;
use smallvec::SmallVec;

/// A rate of no more than this part of the value, over the length of a step, is rounding.
const NOISE: f64 = 16.0 * f64::EPSILON;

/// A difference that is so many times larger than the error of its sides has a sign.
const CLEAR: f64 = 10.0;

impl EventStage<'_, '_> {
    /// Where a module's signs go under the present equations. Also tells whether a sign turned out to be
    /// zero within the resolution of time.
    pub(super) fn signs_after(&mut self, id: ModuleId) -> (Signs, bool) {
        let state = self.world.state(id).expect("open modules have a state");
        let rule = &self.setup.model.rules[state.rule.get().expect("open modules have a rule")];
        let known = state.open.as_ref().expect("open");
        let elsewhere = known.flow.is_none();
        let jumping: SmallVec<[usize; 4]> =
            (0..rule.atoms.len()).filter(|atom| is_settled_behind(rule, *atom)).collect();
        let is_known = (known.clear || !elsewhere) && !known.at.contains(&Sign::Zero) && jumping.is_empty();
        if rule.atoms.is_empty() || is_known {
            return (known.at.clone(), false);
        }
        let mut entry = known.clone();
        let mut snapped = false;
        let mut after = entry.at.clone();
        let mut moving = Vec::new();
        self.flow().moving_variables(id, 0.0, &mut moving);
        let mut scratch = Vec::new();
        let mut out = vec![Dual { value: 0.0, rate: 0.0 }; rule.sides.outputs()];
        rule.sides.eval(&moving, &mut scratch, &mut out);
        let mut probed = false;
        let reach = self.flows.reach_of(self.world, id).clamp(f64::MIN_POSITIVE, 1e300);
        let error = self.flows.error_among_others(self.world, id);
        let least_way = error * NEXT_TO_NOTHING;
        // What has been at rest may seem to move by the noise of those that it reads: its context and its sums.
        let has_rested = error > 0.0 && entry.guess.contains(&Sign::Zero);
        let unrest = if has_rested {
            let context = self.world.tree.parameters(id).len()..rule.time_variable();
            let reads =
                |variable: &usize| rule.solves.iter().any(|solve| solve.rates.reads().contains(variable));
            let others = context.filter(reads).map(|variable| moving[variable]).filter(|x| x.rate != 0.0);
            error * others.map(|x| x.value.abs() + x.rate.abs() * reach).fold(0.0, f64::max)
        } else {
            0.0
        };
        for atom in 0..rule.atoms.len() {
            let (a, b) = (out[2 * atom], out[2 * atom + 1]);
            let slope = a.rate - b.rate;
            let size = a.value.abs().max(b.value.abs());
            if elsewhere && matches!(entry.at[atom], Sign::Plus | Sign::Minus) {
                let gap = (a.value - b.value).abs();
                if gap <= slope.abs() * self.instant.at.resolution() && gap <= NEAR * self.scale(id) {
                    entry.at[atom] = Sign::Zero;
                    snapped = true;
                }
            }
            if entry.at[atom] != Sign::Zero {
                continue;
            }
            let clear = |slope: f64, least: f64| {
                let way = slope.abs() * reach;
                let noise = if entry.guess[atom] == Sign::Zero { least_way.max(unrest) } else { least_way };
                if way > least * size && way > noise { Sign::of(slope) } else { Sign::Zero }
            };
            // Beyond zero on a side by more than its noise.
            let is_on = |side: Sign| {
                let gap = a.value - b.value;
                let values: SmallVec<[f64; 16]> = moving.iter().map(|x| x.value).collect();
                Sign::of(gap) == side
                    && !rule.jumping_whole[atom]
                    && gap.abs() > CLEAR * noise(rule, atom, &values, error.max(NEAR))
            };
            after[atom] = match (clear(slope, 1e-9), entry.guess[atom]) {
                // What was at zero, and is beyond it without having been seen to leave, has not come back yet.
                (towards @ (Sign::Plus | Sign::Minus), Sign::Zero)
                    if error > 0.0 && is_on(opposite(towards)) =>
                {
                    Sign::Zero
                }
                // What has been seen to leave has done so, wherever noise seems to take it.
                (towards, guess @ (Sign::Plus | Sign::Minus))
                    if towards != guess && error > 0.0 && is_on(guess) =>
                {
                    guess
                }
                (Sign::Zero, guess @ (Sign::Plus | Sign::Minus))
                    if !elsewhere && self.goes_on_alike(id, FAR_AWAY) =>
                {
                    guess
                }
                (Sign::Zero, _) => match clear(slope, NOISE) {
                    Sign::Zero => {
                        probed = true;
                        // Not moving yet, or at rest: look ahead, first a little, then further.
                        let mut ahead = |part: f64| {
                            self.flow().moving_variables(id, part * reach.min(1e12), &mut moving);
                            rule.sides.eval(&moving, &mut scratch, &mut out);
                            [out[2 * atom], out[2 * atom + 1]]
                        };
                        let moves = [1e-9, 1e-6, 1e-3].into_iter().find_map(|part| {
                            let [a, b] = ahead(part);
                            Some(clear(a.rate - b.rate, 1e-12)).filter(|sign| *sign != Sign::Zero)
                        });
                        moves.unwrap_or(Sign::Zero)
                    }
                    sign => sign,
                },
                // It turns back at a kink (`abs(x)` at 0), and the numbers of now are a rounding before it: a little later tells.
                (sign @ (Sign::Plus | Sign::Minus), guess) if guess == opposite(sign) => {
                    probed = true;
                    self.flow().moving_variables(id, 1e-9 * reach.min(1e12), &mut moving);
                    rule.sides.eval(&moving, &mut scratch, &mut out);
                    let [later_a, later_b] = [out[2 * atom], out[2 * atom + 1]];
                    let turns = Sign::of(later_a.value - later_b.value) == guess
                        && clear(later_a.rate - later_b.rate, 1e-9) == guess;
                    if turns { guess } else { sign }
                }
                (sign, _) => sign,
            };
            if std::mem::take(&mut probed) {
                // The probes have written over it.
                self.flow().moving_variables(id, 0.0, &mut moving);
                rule.sides.eval(&moving, &mut scratch, &mut out);
            }
        }
        self.settle_jumps(id, &jumping, &entry.at, &mut after);
        self.world.state_mut(id).expect("seen above").open = Some(entry);
        (after, snapped)
    }

    /// Gives these atoms the signs a little after the instant: what jumps in them meets its level at the instant, and on which side of the jump
    /// the numbers of now are is rounding.
    fn settle_jumps(&mut self, id: ModuleId, jumping: &[usize], at: &[Sign], after: &mut [Sign]) {
        if jumping.is_empty() {
            return;
        }
        let rule = self.world.state(id).and_then(|state| state.rule.get());
        let rule = &self.setup.model.rules[rule.expect("open modules have a rule")];
        let reads: SmallVec<[usize; 8]> =
            jumping.iter().flat_map(|atom| rule.atom_reads[*atom].iter().copied()).collect();
        let meets = |atom: &usize| at[*atom] == Sign::Zero && !rule.jumping_whole[*atom];
        let zero: SmallVec<[usize; 8]> = (0..rule.atoms.len()).filter(meets).collect();
        let delay = self.delay_of_parting(id, &reads, &zero);
        let (mut moving, mut registers) = (Vec::new(), Vec::new());
        self.flow().moving_variables(id, delay, &mut moving);
        let mut sides = vec![Dual { value: 0.0, rate: 0.0 }; rule.sides.outputs()];
        rule.sides.eval(&moving, &mut registers, &mut sides);
        for &atom in jumping {
            let [a, b] = [sides[2 * atom], sides[2 * atom + 1]];
            let sign = sign_at_birth(a.value, b.value);
            // So soon, a difference that moves may not have parted.
            if sign != Sign::Zero || a.rate == b.rate {
                after[atom] = sign;
            }
        }
    }

    /// The size of a module's parameters, against which a tiny one is as good as zero.
    pub(super) fn scale(&self, id: ModuleId) -> f64 {
        self.world.tree.parameters(id).iter().fold(1.0, |m: f64, x| m.max(x.abs()))
    }
}

/// True for differences that jump and were not taken apart, where only equations ask for them; productions take place behind a jump.
fn is_settled_behind(rule: &Rule, atom: usize) -> bool {
    rule.jumping_whole[atom] && !rule.decides_productions(atom)
}
