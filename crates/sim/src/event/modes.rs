//! Mode selection: the choice of equations at an instant, so that they agree with where they lead.
//!
//! Which clause is active just after an instant depends on signs just after it, and those on the equations. The first
//! choice follows what is known; a choice that leads out of its own domain is given up for the next.

use smallvec::SmallVec;

use super::SHORT_LIFE;
use super::opening::open;
use super::{EventStage, Firing};
use crate::detect::signs::NEAR;
use crate::error::Error;
use crate::world::state::{Signs, Switches};
use dlsys_expr::Dual;
use dlsys_model::{Condition, ConditionStep, Remedy, Rule, Sign, Truth, ZeroCrossing};
use dlsys_tree::ModuleId;

/// Most times that the equations at one instant are chosen anew before the choice is called chattering.
const MAX_CHOICES: usize = 8;

/// A rate of no more than this part of the value, over the length of a step, is rounding.
const NOISE: f64 = 16.0 * f64::EPSILON;

/// Rates that differ by no more than this part of them, or of the module's parameters over a step, are the same.
const SMOOTH: f64 = 1e-9;

/// A module without equations, and the reason.
struct NoMode {
    id: ModuleId,
    chattering: bool,
    signs: Signs,
}

/// One pass over the open modules.
#[derive(Default)]
struct Pass {
    /// Some module has got other equations.
    changed: bool,
    missing: Option<NoMode>,
    /// Modules whose equations agree with their signs just after the instant, with these.
    settled: SmallVec<[(ModuleId, Signs); 4]>,
}

impl EventStage<'_, '_> {
    /// Chooses the equations of the open modules; finds productions whose conditions become true just after the
    /// instant.
    pub fn select_modes(&mut self, hurried: &mut bool, firing: &mut Vec<Firing>) -> Result<(), Error> {
        let opened = std::mem::take(&mut self.events.opened);
        let outcome = self.select_modes_of(&opened, hurried, firing);
        self.events.opened = opened;
        outcome
    }

    fn select_modes_of(
        &mut self,
        opened: &[ModuleId],
        hurried: &mut bool,
        firing: &mut Vec<Firing>,
    ) -> Result<(), Error> {
        self.choose_first(opened);
        self.flows.known_rates.clear();
        for choice in 0.. {
            let mut pass = Pass::default();
            for &id in opened {
                if self.world.state(id).is_none_or(|s| s.rule.is_none()) {
                    continue;
                }
                let (signs, snapped) = self.signs_after(id);
                // A value born within the resolution of time of zero is born on it.
                *hurried |= snapped;
                match self.production_at(id, &signs) {
                    Some(fire) => firing.push(fire),
                    None => self.reconsider(id, signs, &mut pass),
                }
            }
            if !firing.is_empty() {
                return Ok(());
            }
            if pass.missing.is_none() && pass.changed && choice > MAX_CHOICES {
                let (id, signs) = pass.settled.pop().unwrap_or((opened[0], Signs::new()));
                pass.missing = Some(NoMode { id, chattering: true, signs });
            }
            if let Some(missing) = pass.missing {
                return Err(self.no_equations(&missing));
            }
            if !pass.changed {
                for (id, signs) in pass.settled {
                    self.world.state_mut(id).expect("settled").signs = signs;
                }
                return Ok(());
            }
        }
        Ok(())
    }

    /// The first choice: the first clause that can hold where the signs are expected to go.
    fn choose_first(&mut self, opened: &[ModuleId]) {
        for id in opened {
            let Some(state) = self.world.state_mut(*id) else { continue };
            let Some(rule) = state.rule.map(|r| &self.setup.model.rules[r]) else { continue };
            let entry = open(state);
            entry.tried.clear();
            entry.flips = 0;
            let guess = Signs::from_slice(&entry.guess);
            state.solve = next_clause(rule, &guess, &[]);
            state.switches = switches(rule, state.solve, &guess);
        }
    }

    /// The production of an open module that holds at the instant or just after it.
    fn production_at(&self, id: ModuleId, after: &[Sign]) -> Option<Firing> {
        let state = self.world.state(id)?;
        let rule = state.rule?;
        let produces = &self.setup.model.rules[rule].produces;
        let holds = |signs: &[Sign]| produces.iter().position(|p| p.guard.judge(|i| signs[i]) == Truth::Yes);
        let produce = holds(&state.open.as_ref()?.at).or_else(|| holds(after))?;
        Some(Firing { id, rule, produce })
    }

    /// Compares the equations of a module with the signs just after the instant that follow from them, and chooses again
    /// if they disagree.
    fn reconsider(&mut self, id: ModuleId, signs: Signs, pass: &mut Pass) {
        let state = self.world.state_mut(id).expect("open modules have a state");
        let rule = &self.setup.model.rules[state.rule.expect("open modules have a rule")];
        let entry = state.open.as_mut().expect("open");
        let first = rule.solves.iter().position(|s| s.guard.judge(|i| signs[i]) == Truth::Yes);
        if first != state.solve || (first.is_none() && !rule.solves.is_empty()) {
            entry.tried.extend(state.solve);
            // Any zero may yet go either way under other equations.
            let any: Signs = entry.at.iter().map(|&s| if s == Sign::Zero { Sign::Any } else { s }).collect();
            let untried = first.filter(|f| !entry.tried.contains(f));
            match untried.or_else(|| next_clause(rule, &any, &entry.tried)) {
                Some(next) => {
                    state.solve = Some(next);
                    state.switches = switches(rule, state.solve, &signs);
                    self.flows.known_rates.forget(id);
                    pass.changed = true;
                }
                None => {
                    let chattering = entry.tried.len() > 1;
                    pass.missing.get_or_insert(NoMode { id, chattering, signs });
                }
            }
            return;
        }
        let wanted = switches(rule, state.solve, &signs);
        if wanted != state.switches {
            entry.flips += 1;
            let undecided = entry.flips > 2;
            let other = std::mem::replace(&mut state.switches, wanted);
            self.flows.known_rates.forget(id);
            if undecided && self.is_smooth_across(id, &other) {
                // It goes on alike on both sides: it rests on the boundary.
                let state = self.world.state_mut(id).expect("seen above");
                let at = &state.open.as_ref().expect("open").at;
                let both = at.iter().zip(&signs);
                let rest: Signs =
                    both.map(|(at, after)| if *at == Sign::Zero { Sign::Zero } else { *after }).collect();
                state.switches = switches(rule, state.solve, &rest);
                pass.settled.push((id, rest));
                return;
            }
            if undecided {
                pass.missing.get_or_insert(NoMode { id, chattering: true, signs: signs.clone() });
            }
            pass.changed = true;
        }
        pass.settled.push((id, signs));
    }

    /// True if a module's rates are the same under other conditions inside its equations.
    fn is_smooth_across(&mut self, id: ModuleId, other: &Switches) -> bool {
        let (mut here, mut there) = (Vec::new(), Vec::new());
        self.flow().rates_now(id, &mut here);
        let swap = |simulation: &mut Self, switches: Switches| {
            simulation.flows.known_rates.forget(id);
            let state = simulation.world.state_mut(id).expect("open modules have a state");
            std::mem::replace(&mut state.switches, switches)
        };
        let own = swap(self, other.clone());
        self.flow().rates_now(id, &mut there);
        swap(self, own);
        // A kink in an integrated value has the error of the value.
        let smooth = if self.flows.error_of(self.world, id) > 0.0 {
            SMOOTH.max(self.setup.settings.tolerance)
        } else {
            SMOOTH
        };
        let size = self.scale(id) / self.flows.reach_of(self.world, id);
        here.iter().zip(&there).all(|(a, b)| (a - b).abs() <= smooth * (size + a.abs().max(b.abs())))
    }

    /// Where a module's signs go under the present equations. Also tells whether a sign turned out to be
    /// zero within the resolution of time.
    fn signs_after(&mut self, id: ModuleId) -> (Signs, bool) {
        let state = self.world.state(id).expect("open modules have a state");
        let rule = &self.setup.model.rules[state.rule.expect("open modules have a rule")];
        let known = state.open.as_ref().expect("open");
        let elsewhere = known.flow.is_none();
        if rule.atoms.is_empty() || (known.clear || !elsewhere) && !known.at.contains(&Sign::Zero) {
            return (Signs::from_slice(&known.at), false);
        }
        let mut entry = known.clone();
        let mut snapped = false;
        let mut after = entry.at.clone();
        let smooth = entry.flow.as_ref().is_some_and(|f| f.0 == state.solve && f.1 == state.switches);
        let mut moving = Vec::new();
        self.flow().moving_variables(id, 0.0, &mut moving);
        let mut scratch = Vec::new();
        let mut out = vec![Dual { value: 0.0, rate: 0.0 }; rule.sides.outputs()];
        rule.sides.eval(&moving, &mut scratch, &mut out);
        let mut probed = false;
        let reach = self.flows.reach_of(self.world, id).clamp(f64::MIN_POSITIVE, 1e300);
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
                if slope.abs() * reach > least * size { Sign::of(slope) } else { Sign::Zero }
            };
            after[atom] = match (clear(slope, 1e-9), entry.guess[atom]) {
                (Sign::Zero, guess @ (Sign::Plus | Sign::Minus)) if smooth => guess,
                (Sign::Zero, _) => match clear(slope, NOISE) {
                    Sign::Zero => {
                        probed = true;
                        // Not moving yet, or at rest: look ahead, first a little, then further.
                        let seen = [1e-9, 1e-6, 1e-3].into_iter().map(|part| {
                            self.flow().moving_variables(id, part * reach.min(1e12), &mut moving);
                            rule.sides.eval(&moving, &mut scratch, &mut out);
                            clear(out[2 * atom].rate - out[2 * atom + 1].rate, 1e-12)
                        });
                        { seen }.find(|sign| *sign != Sign::Zero).unwrap_or(Sign::Zero)
                    }
                    sign => sign,
                },
                (sign, _) => sign,
            };
            if std::mem::take(&mut probed) {
                // The probes have written over it.
                self.flow().moving_variables(id, 0.0, &mut moving);
                rule.sides.eval(&moving, &mut scratch, &mut out);
            }
        }
        self.world.state_mut(id).expect("seen above").open = Some(entry);
        (after, snapped)
    }

    /// The size of a module's parameters, against which a tiny one is as good as zero.
    fn scale(&self, id: ModuleId) -> f64 {
        self.world.tree.parameters(id).iter().fold(1.0, |m: f64, x| m.max(x.abs()))
    }

    fn no_equations(&self, missing: &NoMode) -> Error {
        let id = missing.id;
        let index = self.world.state(id).and_then(|s| s.rule).expect("open modules have a rule");
        let rule = &self.setup.model.rules[index];
        let site = self.world.site(self.setup.model, id, index, rule.span, self.instant.at);
        // A life about as short as the resolution of time, at the end of a line of lives: the order of events at its end
        // is lost in rounding.
        let age = self.instant.at.since(self.world.tree.birth(id));
        let generation = self.world.tree.lineage(id).generation;
        if age > 0.0 && age <= SHORT_LIFE * self.instant.at.resolution() && generation > 4 {
            return Error::Zeno { site };
        }
        if missing.chattering {
            return Error::Chattering { site };
        }
        let (mut variables, mut scratch) = (Vec::new(), Vec::new());
        let state = self.world.state(id).expect("open modules have a state");
        self.world.variables(rule, id, &state.context, self.instant.at, &mut variables);
        let mut sides = vec![0.0; rule.sides.outputs()];
        rule.sides.eval(&variables, &mut scratch, &mut sides);
        // The signs are those just behind the instant; a production applies to those at it.
        let meet = |atom: usize| {
            let (a, b): (f64, f64) = (sides[2 * atom], sides[2 * atom + 1]);
            (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
        };
        let mut failing = Vec::new();
        for solve in &rule.solves {
            for (atom, comparison) in solve.guard.atoms() {
                let alone = Condition(vec![ConditionStep::Atom(atom as u32, comparison)]);
                if alone.judge(|i| missing.signs[i]) == Truth::No
                    && !failing.iter().any(|(s, _)| *s == rule.atoms[atom])
                {
                    // A difference that never changes may be beyond the boundary as well.
                    let moves = !matches!(solve.zero_crossings[atom], ZeroCrossing::Constant);
                    let sign = match missing.signs[atom] {
                        Sign::Undefined => Sign::Undefined,
                        _ if !moves => Sign::Any,
                        _ if meet(atom) => Sign::Zero,
                        sign => sign,
                    };
                    let remedy = Remedy::new(&self.setup.model.kinds, rule, atom, comparison, sign);
                    failing.push((rule.atoms[atom], remedy));
                }
            }
        }
        Error::OutsideDomain { site, born: age == 0.0, failing }
    }
}

/// The first clause, not tried before, whose condition holds or may hold.
fn next_clause(rule: &Rule, signs: &[Sign], tried: &[usize]) -> Option<usize> {
    (rule.solves.iter().enumerate())
        .find(|(i, s)| !tried.contains(i) && s.guard.judge(|a| signs[a]) != Truth::No)
        .map(|(i, _)| i)
}

/// The conditions inside a clause's equations. A condition that may hold is first taken to hold.
fn switches(rule: &Rule, solve: Option<usize>, signs: &[Sign]) -> Switches {
    let all = solve.map_or(&[][..], |s| &rule.solves[s].switches);
    all.iter().map(|s| s.condition.judge(|a| signs[a]) != Truth::No).collect()
}
