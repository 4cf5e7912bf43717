//! The choice of equations at an instant, so that they agree with where they lead.
//!
//! Which clause is active just after an instant depends on signs just after it, and those on the equations. The first
//! choice follows what is known; a choice that leads out of its own domain is given up for the next.

use smallvec::SmallVec;

use super::around::{Around, gather};
use super::error::Error;
use super::lookup::NEAR;
use super::settle::{Firing, open};
use super::simulation::{SHORT_LIFE, Simulation};
use super::state::{Signs, Switches};
use dlsys_expr::Dual;
use dlsys_model::{Condition, Remedy, Rule, Sign, Step, Truth};
use dlsys_tree::ModuleId;

/// Most times that the equations at one instant are chosen anew before the choice is called chattering.
const MAX_CHOICES: usize = 8;

/// How many neighbours in a row are asked for the rate of a value that depends on them, if none of them has been asked
/// before.
const DEPTH: usize = 100;

/// A rate of no more than this part of the value, over the length of a step, is rounding.
const NOISE: f64 = 16.0 * f64::EPSILON;

/// Rates that differ by no more than this part of them, or of the module's parameters over a step, are the same.
const SMOOTH: f64 = 1e-9;

/// Why a module has no equations.
struct Trouble {
    id: ModuleId,
    chattering: bool,
    signs: Signs,
}

impl Simulation<'_> {
    /// Chooses the equations of the open modules; finds productions whose conditions become true just after the
    /// instant.
    pub(super) fn choose_equations(
        &mut self,
        hurried: &mut bool,
        firing: &mut Vec<Firing>,
    ) -> Result<(), Error> {
        let rules = &self.model.rules;
        let opened = std::mem::take(&mut self.opened);
        // First choice: the first clause that can hold where the signs are expected to go.
        for id in &opened {
            let Some(state) = self.plant.state_mut(*id) else { continue };
            let Some(rule) = state.rule.map(|r| &rules[r]) else { continue };
            let entry = open(state);
            entry.tried.clear();
            entry.flips = 0;
            let guess = Signs::from_slice(&entry.guess);
            state.solve = next_clause(rule, &guess, &[]);
            state.switches = switches(rule, state.solve, &guess);
        }
        self.known_rates.clear();
        let mut outcome = Ok(());
        for choice in 0.. {
            let mut changed = false;
            let mut trouble: Option<Trouble> = None;
            let mut settled: SmallVec<[(ModuleId, Signs); 4]> = SmallVec::new();
            for &id in &opened {
                if self.plant.state(id).is_none_or(|s| s.rule.is_none()) {
                    continue;
                }
                let (signs, snapped) = self.signs_after(id);
                // A value born within the resolution of time of zero is born on it.
                *hurried |= snapped;
                let state = self.plant.state_mut(id).expect("seen above");
                let index = state.rule.expect("seen above");
                let rule = &rules[index];
                let entry = state.open.as_mut().expect("open");
                let holds = |signs: &[Sign]| {
                    rule.produces.iter().position(|p| p.guard.judge(|i| signs[i]) == Truth::Yes)
                };
                if let Some(produce) = holds(&entry.at).or_else(|| holds(&signs)) {
                    firing.push(Firing { id, rule: index, produce });
                    continue;
                }
                let first = rule.solves.iter().position(|s| s.guard.judge(|i| signs[i]) == Truth::Yes);
                if first != state.solve || (first.is_none() && !rule.solves.is_empty()) {
                    entry.tried.extend(state.solve);
                    // Any zero may yet go either way under other equations.
                    let any: Signs =
                        entry.at.iter().map(|&s| if s == Sign::Zero { Sign::Any } else { s }).collect();
                    let next = first
                        .filter(|f| !entry.tried.contains(f))
                        .or_else(|| next_clause(rule, &any, &entry.tried));
                    match next {
                        Some(next) => {
                            state.solve = Some(next);
                            state.switches = switches(rule, state.solve, &signs);
                            self.known_rates.forget(id);
                            changed = true;
                        }
                        None => {
                            let chattering = entry.tried.len() > 1;
                            trouble.get_or_insert(Trouble { id, chattering, signs: signs.clone() });
                        }
                    }
                    continue;
                }
                let wanted = switches(rule, state.solve, &signs);
                if wanted != state.switches {
                    entry.flips += 1;
                    let undecided = entry.flips > 2;
                    let other = std::mem::replace(&mut state.switches, wanted);
                    self.known_rates.forget(id);
                    if undecided && self.is_smooth_across(id, &other) {
                        // Whichever way it goes, it goes on alike: it rests on the boundary.
                        let state = self.plant.state_mut(id).expect("seen above");
                        let at = &state.open.as_ref().expect("open").at;
                        let rest: Signs = at
                            .iter()
                            .zip(&signs)
                            .map(|(at, after)| match at {
                                Sign::Zero => Sign::Zero,
                                _ => *after,
                            })
                            .collect();
                        state.switches = switches(rule, state.solve, &rest);
                        settled.push((id, rest));
                        continue;
                    }
                    if undecided {
                        trouble.get_or_insert(Trouble { id, chattering: true, signs: signs.clone() });
                    }
                    changed = true;
                }
                settled.push((id, signs));
            }
            if !firing.is_empty() {
                break;
            }
            if trouble.is_none() && changed && choice > MAX_CHOICES {
                let (id, signs) = settled.pop().unwrap_or((opened[0], Signs::new()));
                trouble = Some(Trouble { id, chattering: true, signs });
            }
            if let Some(trouble) = trouble {
                outcome = Err(self.no_equations(&trouble));
                break;
            }
            if !changed {
                for (id, signs) in settled {
                    self.plant.state_mut(id).expect("settled").signs = signs;
                }
                break;
            }
        }
        self.opened = opened;
        outcome
    }

    /// True if a module's rates are the same under other conditions inside its equations.
    fn is_smooth_across(&mut self, id: ModuleId, other: &Switches) -> bool {
        let (mut here, mut there) = (Vec::new(), Vec::new());
        self.rates_to(id, 0.0, DEPTH, &mut here);
        let swap = |simulation: &mut Self, switches: Switches| {
            simulation.known_rates.forget(id);
            let state = simulation.plant.state_mut(id).expect("open modules have a state");
            std::mem::replace(&mut state.switches, switches)
        };
        let own = swap(self, other.clone());
        self.rates_to(id, 0.0, DEPTH, &mut there);
        swap(self, own);
        // What an integrated value is off by, a kink in it is off by, too.
        let smooth = if self.error_of(id) > 0.0 { SMOOTH.max(self.settings.tolerance) } else { SMOOTH };
        let size = self.scale(id) / self.reach_of(id);
        here.iter().zip(&there).all(|(a, b)| (a - b).abs() <= smooth * (size + a.abs().max(b.abs())))
    }

    /// Where a module's signs go under the present equations. Also tells whether a sign turned out to be
    /// zero within the resolution of time.
    fn signs_after(&mut self, id: ModuleId) -> (Signs, bool) {
        let state = self.plant.state(id).expect("open modules have a state");
        let rule = &self.model.rules[state.rule.expect("open modules have a rule")];
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
        self.moving_variables(id, 0.0, &mut moving);
        let mut scratch = Vec::new();
        let mut out = vec![Dual { value: 0.0, rate: 0.0 }; rule.sides.outputs()];
        rule.sides.eval(&moving, &mut scratch, &mut out);
        let mut probed = false;
        let reach = self.reach_of(id).clamp(f64::MIN_POSITIVE, 1e300);
        for atom in 0..rule.atoms.len() {
            let (a, b) = (out[2 * atom], out[2 * atom + 1]);
            let slope = a.rate - b.rate;
            let size = a.value.abs().max(b.value.abs());
            if elsewhere && matches!(entry.at[atom], Sign::Plus | Sign::Minus) {
                let gap = (a.value - b.value).abs();
                if gap <= slope.abs() * self.now.resolution() && gap <= NEAR * self.scale(id) {
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
                            self.moving_variables(id, part * reach.min(1e12), &mut moving);
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
                self.moving_variables(id, 0.0, &mut moving);
                rule.sides.eval(&moving, &mut scratch, &mut out);
            }
        }
        self.plant.state_mut(id).expect("seen above").open = Some(entry);
        (after, snapped)
    }

    /// The variables of a module's rule with their rates, `tau` ahead of the present by Euler's method.
    fn moving_variables(&mut self, id: ModuleId, tau: f64, out: &mut Vec<Dual<f64>>) {
        out.clear();
        let state = self.plant.state(id).expect("open modules have a state");
        let rule = &self.model.rules[state.rule.expect("open modules have a rule")];
        let around = state.context.clone();
        self.variables_ahead(rule, id, &around, tau, rule.reads_context, DEPTH, out);
    }

    /// The variables of a rule, given the rates of the module's own parameters.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn neighbours_ahead(
        &mut self,
        rule: &Rule,
        id: ModuleId,
        around: &Around,
        tau: f64,
        depth: usize,
        own: &[f64],
        out: &mut Vec<Dual<f64>>,
    ) {
        self.variables_ahead(rule, id, around, tau, rule.reads_context, depth - 1, out);
        for (variable, &rate) in out.iter_mut().zip(own) {
            variable.rate = rate;
        }
    }

    /// The variables of a rule with their rates; those of neighbours are 0 if they are not read.
    #[allow(clippy::too_many_arguments)]
    fn variables_ahead(
        &mut self,
        rule: &Rule,
        id: ModuleId,
        around: &Around,
        tau: f64,
        reads_context: bool,
        depth: usize,
        out: &mut Vec<Dual<f64>>,
    ) {
        out.clear();
        let (mut values, mut rates) = (Vec::new(), Vec::new());
        let mut append = |me: &mut Self, module: ModuleId, out: &mut Vec<Dual<f64>>| {
            if module != id && !reads_context {
                values.clear();
                me.plant.values(module, me.now, &mut values);
                out.extend(values.iter().map(|&value| Dual { value, rate: 0.0 }));
                return;
            }
            me.ahead(module, tau, depth, &mut values);
            me.rates_to(module, tau, depth, &mut rates);
            out.extend(values.iter().zip(&rates).map(|(&value, &rate)| Dual { value, rate }));
        };
        for &module in std::iter::once(&id).chain(around.context()) {
            append(self, module, out);
        }
        let now = self.now.to_f64() + tau;
        let age = self.now.since(self.plant.tree.birth(id)) + tau;
        let times = [now, age].map(|value| Dual { value, rate: 1.0 });
        let child = |child, out: &mut Vec<Dual<f64>>| append(self, child, out);
        gather(rule, around, times, out, &mut Vec::new(), |_| true, child);
    }

    /// A module's parameters a little ahead.
    fn ahead(&mut self, id: ModuleId, tau: f64, depth: usize, out: &mut Vec<f64>) {
        out.clear();
        self.plant.values(id, self.now, out);
        if tau != 0.0 {
            let mut rates = Vec::new();
            self.rates_to(id, 0.0, depth, &mut rates);
            for (value, rate) in out.iter_mut().zip(&rates) {
                *value += tau * rate;
            }
        }
    }

    /// The rates of a module's parameters a little ahead, by its present equations.
    pub(super) fn rates_ahead(&mut self, id: ModuleId, tau: f64, out: &mut Vec<f64>) {
        self.known_rates.clear();
        self.rates_to(id, tau, DEPTH, out);
    }

    /// The same; rates of algebraic parameters go back to neighbours so many times.
    fn rates_to(&mut self, id: ModuleId, tau: f64, depth: usize, out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.plant.tree.parameters(id).len(), 0.0);
        let model = self.model;
        let Some(state) = self.plant.state(id) else { return };
        let (Some(rule), Some(solve)) = (state.rule, state.solve) else { return };
        let solve = &model.rules[rule].solves[solve];
        if solve.of.is_empty() {
            return self.algebraic_rates(id, tau, depth, out);
        }
        let mut variables = Vec::new();
        if tau == 0.0 {
            self.plant.variables(&model.rules[rule], id, &state.context, self.now, &mut variables);
        } else {
            let around = state.context.clone();
            let mut values = Vec::new();
            for &module in std::iter::once(&id).chain(around.context()) {
                self.ahead(module, tau, depth, &mut values);
                variables.extend_from_slice(&values);
            }
            let times = [self.now.to_f64() + tau, self.now.since(self.plant.tree.birth(id)) + tau];
            let child = |child, out: &mut Vec<f64>| {
                self.ahead(child, tau, depth, &mut values);
                out.extend_from_slice(&values);
            };
            gather(&model.rules[rule], &around, times, &mut variables, &mut Vec::new(), |_| true, child);
        }
        let state = self.plant.state(id).expect("seen above");
        variables.extend(state.switches.iter().map(|&on| f64::from(u8::from(on))));
        let mut rates: SmallVec<[f64; 4]> = smallvec::smallvec![0.0; solve.rates.outputs()];
        solve.rates.eval(&variables, &mut self.scratch, &mut rates);
        self.stats.rhs_evaluations += 1;
        for (&parameter, rate) in solve.of.iter().zip(rates) {
            out[parameter] = rate;
        }
        self.algebraic_rates(id, tau, depth, out);
    }

    /// The size of a module's parameters, against which a tiny one is as good as zero.
    fn scale(&self, id: ModuleId) -> f64 {
        self.plant.tree.parameters(id).iter().fold(1.0, |m: f64, x| m.max(x.abs()))
    }

    fn no_equations(&self, trouble: &Trouble) -> Error {
        let id = trouble.id;
        let index = self.plant.state(id).and_then(|s| s.rule).expect("open modules have a rule");
        let rule = &self.model.rules[index];
        let site = self.site_of(id, index, rule.span, self.now.to_f64());
        // A life about as short as the resolution of time, at the end of a line of lives: what comes first at its
        // end can no longer be told.
        let age = self.now.since(self.plant.tree.birth(id));
        let generation = self.plant.tree.lineage(id).generation;
        if age > 0.0 && age <= SHORT_LIFE * self.now.resolution() && generation > 4 {
            return Error::Zeno { site };
        }
        if trouble.chattering {
            return Error::Chattering { site };
        }
        let (mut variables, mut scratch) = (Vec::new(), Vec::new());
        let state = self.plant.state(id).expect("open modules have a state");
        self.plant.variables(rule, id, &state.context, self.now, &mut variables);
        let mut sides = vec![0.0; rule.sides.outputs()];
        rule.sides.eval(&variables, &mut scratch, &mut sides);
        // The signs are those just behind the instant; a production is for what is met at it.
        let meet = |atom: usize| {
            let (a, b): (f64, f64) = (sides[2 * atom], sides[2 * atom + 1]);
            (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
        };
        let mut failing = Vec::new();
        for solve in &rule.solves {
            for (atom, comparison) in solve.guard.atoms() {
                let alone = Condition(vec![Step::Atom(atom as u32, comparison)]);
                if alone.judge(|i| trouble.signs[i]) == Truth::No
                    && !failing.iter().any(|(s, _)| *s == rule.atoms[atom])
                {
                    let sign = if meet(atom) { Sign::Zero } else { trouble.signs[atom] };
                    let remedy = Remedy::new(&self.model.kinds, rule, atom, comparison, sign);
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

/// The conditions inside a clause's equations. What may hold is first taken to hold.
fn switches(rule: &Rule, solve: Option<usize>, signs: &[Sign]) -> Switches {
    let all = solve.map_or(&[][..], |s| &rule.solves[s].switches);
    all.iter().map(|s| s.condition.judge(|a| signs[a]) != Truth::No).collect()
}
