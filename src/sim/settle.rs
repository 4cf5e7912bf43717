//! What happens at one instant: productions, cascades, changes of equations.
//!
//! ```text
//! look up rules and contexts ─▶ judge at the instant ─▶ replace all in parallel ─┐
//!        ▲                              │ nothing holds                           │
//!        └──────────────────────────────┼─────────────────────────────────────────┘
//!                                       ▼
//!            choose equations ─▶ where do the zero signs go? ─▶ judge just after
//! ```
//!
//! LANGUAGE, "Events": all modules whose conditions hold are replaced in parallel, on the values before
//! any was replaced; then the string is examined again at the same instant, until nothing holds.

use super::error::{Error, Site};
use super::event::Event;
use super::runge_kutta::Rates;
use super::simulation::{SHORT_LIFE, Simulation, State};
use super::system::{Joining, System};
use super::watch::Change;
use crate::expr::Dual;
use crate::model::{Rule, Sign, Truth};
use crate::structure::ModuleId;

/// Most rounds of productions at one instant.
pub const MAX_ROUNDS: usize = 10_000;
/// Most times that the equations at one instant are chosen anew before the choice is called chattering.
const MAX_CHOICES: usize = 8;

/// A rate of no more than this part of the value, over the length of a step, is rounding.
const NOISE: f64 = 16.0 * f64::EPSILON;

/// What is still open about a module at the instant under examination.
#[derive(Clone, Debug)]
pub struct Open {
    /// The signs at the instant.
    at: Vec<Sign>,
    /// Where zero signs are expected to go: known if they were followed there.
    guess: Vec<Sign>,
    /// The equations that brought the module here. None if it comes from elsewhere: then its signs are
    /// computed from values, not followed along a trajectory.
    flow: Option<(Option<usize>, Vec<bool>)>,
    /// Clauses whose equations were tried.
    tried: Vec<usize>,
    /// Times that switches were found the other way.
    flips: usize,
}

/// A state a little ahead of the present.
struct Ahead {
    tau: f64,
    y: Vec<f64>,
    rates: Vec<f64>,
}

/// A production that applies.
struct Firing {
    id: ModuleId,
    rule: usize,
    produce: usize,
}

impl Simulation<'_> {
    /// Brings the structure at the present instant to rest: nothing holds any more, and every module
    /// has its equations. `touched` are the signs that are zero now.
    pub(super) fn settle(&mut self, touched: &[Change]) -> Result<(), Error> {
        let mut open = std::mem::take(&mut self.open);
        open.clear();
        open.resize(self.tree.slots(), None);
        self.open_known(touched, &mut open);
        let mut rounds = 0;
        let mut grown = self.ruled_is_stale;
        let mut hurried = false;
        self.group += 1;
        loop {
            if std::mem::take(&mut grown) {
                self.look_up(&mut open);
            }
            let mut firing = self.judge(&open, |open| &open.at);
            if firing.is_empty() {
                firing = self.choose_equations(&mut open, &mut hurried)?;
            }
            if firing.is_empty() {
                break;
            }
            rounds += 1;
            self.rounds = rounds;
            if rounds > MAX_ROUNDS {
                let site = self.site(&firing[0], self.now.to_f64());
                return Err(if hurried { Error::Zeno { site } } else { Error::Cascade { site, rounds } });
            }
            self.replace(&firing)?;
            open.resize(self.tree.slots(), None);
            grown = true;
        }
        self.open = open;
        Ok(())
    }

    /// Opens the modules whose signs are zero now, or have been all along.
    fn open_known(&mut self, touched: &[Change], open: &mut [Option<Open>]) {
        for id in &self.ruled {
            let Some(state) = &self.states[id.slot()] else { continue };
            if state.signs.contains(&Sign::Zero) {
                open[id.slot()] = Some(Open::followed(state));
            }
        }
        for change in touched {
            let Some(state) = &self.states[change.id.slot()] else { continue };
            let entry = open[change.id.slot()].get_or_insert_with(|| Open::followed(state));
            entry.at[change.atom] = change.at;
            entry.guess[change.atom] = change.after;
        }
    }

    /// Open modules in string order.
    fn opened<'o>(&'o self, open: &'o [Option<Open>]) -> impl Iterator<Item = (&'o State, &'o Open)> + 'o {
        self.ruled.iter().filter_map(|id| {
            let state = self.states[id.slot()].as_ref().filter(|s| s.rule.is_some())?;
            Some((state, open[id.slot()].as_ref()?))
        })
    }

    /// The production of each open module whose condition holds for the given signs.
    fn judge(&self, open: &[Option<Open>], signs: impl Fn(&Open) -> &[Sign]) -> Vec<Firing> {
        self.opened(open)
            .filter_map(|(state, open)| {
                let rule = state.rule?;
                let signs = signs(open);
                let produce = (self.model.rules[rule].produces.iter())
                    .position(|p| p.guard.judge(|i| signs[i]) == Truth::Yes)?;
                Some(Firing { id: state.id, rule, produce })
            })
            .collect()
    }

    /// Chooses the equations of the open modules so that they agree with where they lead; returns
    /// productions whose conditions become true just after the instant.
    fn choose_equations(
        &mut self,
        open: &mut [Option<Open>],
        hurried: &mut bool,
    ) -> Result<Vec<Firing>, Error> {
        let rules = &self.model.rules;
        let opened: Vec<ModuleId> = self.opened(open).map(|(state, _)| state.id).collect();
        // First choice: the first clause that can hold where the signs are expected to go.
        for id in &opened {
            let (Some(state), Some(open)) = (&mut self.states[id.slot()], &mut open[id.slot()]) else {
                continue;
            };
            let rule = &rules[state.rule.expect("open modules have a rule")];
            open.tried.clear();
            open.flips = 0;
            let guess = open.guess.clone();
            state.solve = next_clause(rule, &guess, &open.tried);
            state.switches = switches(rule, state.solve, &guess);
        }
        for choice in 0.. {
            self.rebuild();
            let mut rates = vec![0.0; self.y.len()];
            self.system.equations(rules).rates(0.0, &self.y, &mut rates);
            self.stats.rhs_evaluations += 1;
            let mut after: Vec<(ModuleId, Vec<Sign>)> = Vec::with_capacity(opened.len());
            let mut probe = None;
            for member in &self.system.members {
                let Some(entry) = &mut open[member.id.slot()] else { continue };
                let state = self.states[member.id.slot()].as_ref().expect("opened");
                let smooth = entry.flow.as_ref().is_some_and(|f| f.0 == state.solve && f.1 == state.switches);
                let (signs, snapped) = self.signs_after(member, entry, smooth, &rates, &mut probe);
                // A value born within the resolution of time of zero is born on it.
                if snapped {
                    *hurried = true;
                }
                after.push((member.id, signs));
            }
            let mut firing: Vec<Firing> = Vec::new();
            let mut changed = false;
            let mut trouble = None;
            for (id, signs) in &after {
                let entry = open[id.slot()].as_mut().expect("opened");
                let state = self.states[id.slot()].as_mut().expect("opened");
                let index = state.rule.expect("open modules have a rule");
                let rule = &rules[index];
                let holds = |signs: &[Sign]| {
                    rule.produces.iter().position(|p| p.guard.judge(|i| signs[i]) == Truth::Yes)
                };
                if let Some(produce) = holds(&entry.at).or_else(|| holds(signs)) {
                    firing.push(Firing { id: *id, rule: index, produce });
                    continue;
                }
                let first = rule.solves.iter().position(|s| s.guard.judge(|i| signs[i]) == Truth::Yes);
                if first != state.solve || (first.is_none() && !rule.solves.is_empty()) {
                    entry.tried.extend(state.solve);
                    // Any zero may yet go either way under other equations.
                    let any: Vec<Sign> =
                        entry.at.iter().map(|&s| if s == Sign::Zero { Sign::Any } else { s }).collect();
                    let next = first
                        .filter(|f| !entry.tried.contains(f))
                        .or_else(|| next_clause(rule, &any, &entry.tried));
                    match next {
                        Some(next) => {
                            state.solve = Some(next);
                            state.switches = switches(rule, state.solve, signs);
                            changed = true;
                        }
                        None => {
                            trouble.get_or_insert((*id, index, entry.tried.len() > 1, signs.clone()));
                        }
                    }
                    continue;
                }
                let wanted = switches(rule, state.solve, signs);
                if wanted != state.switches {
                    entry.flips += 1;
                    if entry.flips > 2 {
                        trouble.get_or_insert((*id, index, true, signs.clone()));
                    }
                    state.switches = wanted;
                    changed = true;
                }
            }
            if !firing.is_empty() {
                return Ok(firing);
            }
            if let Some((id, rule, chattering, signs)) = trouble {
                return Err(self.no_equations(id, rule, chattering, &signs));
            }
            if !changed {
                for (id, signs) in after {
                    self.states[id.slot()].as_mut().expect("opened").signs = signs;
                    open[id.slot()] = None;
                }
                return Ok(Vec::new());
            }
            if choice > MAX_CHOICES {
                let id = after[0].0;
                let rule = self.states[id.slot()].as_ref().and_then(|s| s.rule).expect("opened");
                return Err(self.no_equations(id, rule, true, &after[0].1));
            }
        }
        unreachable!("the choices are bounded")
    }

    /// Where a member's signs go under the present equations. Also tells whether a sign turned out to be
    /// zero within the resolution of time.
    fn signs_after(
        &self,
        member: &super::system::Member,
        open: &mut Open,
        smooth: bool,
        rates: &[f64],
        probe: &mut Option<Vec<Ahead>>,
    ) -> (Vec<Sign>, bool) {
        let rule = &self.model.rules[member.rule];
        let mut snapped = false;
        let mut after = open.at.clone();
        if rule.atoms.is_empty() {
            return (after, false);
        }
        let mut out = vec![Dual { value: 0.0, rate: 0.0 }; rule.sides.outputs()];
        let (mut variables, mut scratch) = (Vec::new(), Vec::new());
        self.system.moving_variables(member, 0.0, &self.y, rates, &mut variables);
        rule.sides.eval(&variables, &mut scratch, &mut out);
        let reach = self.step_size.clamp(f64::MIN_POSITIVE, 1e300);
        for atom in 0..rule.atoms.len() {
            let (a, b) = (out[2 * atom], out[2 * atom + 1]);
            let slope = a.rate - b.rate;
            let size = a.value.abs().max(b.value.abs());
            if open.flow.is_none() && matches!(open.at[atom], Sign::Plus | Sign::Minus) {
                let gap = (a.value - b.value).abs();
                if gap <= slope.abs() * self.now.resolution() && gap <= 1e-9 * self.scale(member) {
                    open.at[atom] = Sign::Zero;
                    snapped = true;
                }
            }
            if open.at[atom] != Sign::Zero {
                continue;
            }
            let clear = |slope: f64, least: f64| {
                if slope.abs() * reach > least * size { Sign::of(slope) } else { Sign::Zero }
            };
            after[atom] = match (clear(slope, 1e-9), open.guess[atom]) {
                (Sign::Zero, guess @ (Sign::Plus | Sign::Minus)) if smooth => guess,
                (Sign::Zero, _) => match clear(slope, NOISE) {
                    Sign::Zero => {
                        // Not moving yet, or at rest: look ahead, first a little, then further.
                        let probe = probe.get_or_insert_with(|| self.look_ahead(rates, reach));
                        let seen = probe.iter().map(|ahead| {
                            let Ahead { tau, y, rates } = ahead;
                            self.system.moving_variables(member, *tau, y, rates, &mut variables);
                            rule.sides.eval(&variables, &mut scratch, &mut out);
                            clear(out[2 * atom].rate - out[2 * atom + 1].rate, 1e-12)
                        });
                        { seen }.find(|sign| *sign != Sign::Zero).unwrap_or(Sign::Zero)
                    }
                    sign => sign,
                },
                (sign, _) => sign,
            };
        }
        (after, snapped)
    }

    /// The size of a module's parameters, against which a tiny one is as good as zero.
    fn scale(&self, member: &super::system::Member) -> f64 {
        self.tree.parameters(member.id).iter().fold(1.0, |m: f64, x| m.max(x.abs()))
    }

    /// The state and its rates small parts of a step ahead, by Euler's method.
    fn look_ahead(&self, rates: &[f64], reach: f64) -> Vec<Ahead> {
        let mut equations = self.system.equations(&self.model.rules);
        let ahead = |part: f64| {
            let tau = part * reach.min(1e12);
            let y: Vec<f64> = self.y.iter().zip(rates).map(|(y, f)| y + tau * f).collect();
            let mut later = vec![0.0; y.len()];
            equations.rates(tau, &y, &mut later);
            Ahead { tau, y, rates: later }
        };
        [1e-9, 1e-6, 1e-3].map(ahead).into()
    }

    /// Builds the system of equations for the present structure.
    pub(super) fn rebuild(&mut self) {
        let states = &self.states;
        let joining = self.ruled.iter().filter_map(|id| {
            let state = states[id.slot()].as_ref()?;
            Some(Joining {
                id: *id,
                rule: state.rule?,
                context: &state.context,
                solve: state.solve,
                switches: &state.switches,
            })
        });
        let mut y = std::mem::take(&mut self.y);
        self.system = System::new(&self.model.rules, &self.tree, self.now, joining, &mut y);
        self.y = y;
    }

    /// Replaces all modules in parallel: every successor is computed before any is put in.
    fn replace(&mut self, firing: &[Firing]) -> Result<(), Error> {
        let rules = &self.model.rules;
        let mut arguments = Vec::with_capacity(firing.len());
        let mut scratch = Vec::new();
        for fire in firing {
            let state = self.states[fire.id.slot()].as_ref().expect("fires");
            let values = self.values(fire.id, &state.context);
            let mut out = Vec::new();
            let successor = &rules[fire.rule].produces[fire.produce].successor;
            successor.evaluate(&values, &mut scratch, &mut out);
            if out.iter().any(|x| !x.is_finite()) {
                let site = self.site(fire, self.now.to_f64());
                return Err(Error::NotFinite { site, what: "a parameter of the successor".to_owned() });
            }
            arguments.push(out);
        }
        self.record(firing);
        let mut made = Vec::new();
        for (fire, arguments) in firing.iter().zip(&arguments) {
            let site = |me: &Self| me.site(fire, me.now.to_f64());
            let lineage = self.tree.lineage(fire.id);
            let number = fire.rule << 16 | fire.produce;
            let successor = &rules[fire.rule].produces[fire.produce].successor;
            if self.tree.len() + successor.kinds.len() > self.settings.max_modules {
                let limit = self.settings.max_modules;
                return Err(Error::TooManyModules { site: site(self), limit, rounds: self.rounds });
            }
            self.states[fire.id.slot()] = None;
            let birth = self.now;
            self.tree.replace(
                fire.id,
                successor,
                arguments,
                birth,
                |place| lineage.child(number, place),
                &mut made,
            );
        }
        self.stats.events += firing.len() as u64;
        self.stats.peak_modules = self.stats.peak_modules.max(self.tree.len() as u64);
        Ok(())
    }

    /// Writes productions that are about to take place into the log.
    fn record(&mut self, firing: &[Firing]) {
        let Some(mut log) = self.log.take() else { return };
        for fire in firing {
            let state = self.states[fire.id.slot()].as_ref().expect("fires");
            let rule = &self.model.rules[fire.rule];
            let mut sides = vec![0.0; rule.sides.outputs()];
            rule.sides.eval(&self.values(fire.id, &state.context), &mut Vec::new(), &mut sides);
            let residual = (rule.produces[fire.produce].guard.atoms())
                .filter(|(atom, comparison)| {
                    *comparison == crate::model::Comparison::Equal || state.signs[*atom] == Sign::Zero
                })
                .map(|(atom, _)| (sides[2 * atom] - sides[2 * atom + 1]).abs())
                .fold(0.0, f64::max);
            log.push(Event {
                time: self.now.to_f64(),
                lineage: self.tree.lineage(fire.id),
                kind: self.tree.kind(fire.id),
                rule: fire.rule,
                clause: fire.produce,
                residual,
                group: self.group,
            });
        }
        self.log = Some(log);
    }

    fn no_equations(&self, id: ModuleId, rule: usize, chattering: bool, signs: &[Sign]) -> Error {
        let compiled = &self.model.rules[rule];
        let site = self.site_of(id, rule, compiled.span, self.now.to_f64());
        // A life about as short as the resolution of time, at the end of a line of lives: what comes first at its
        // end can no longer be told.
        let age = self.now.since(self.tree.birth(id));
        if age > 0.0 && age <= SHORT_LIFE * self.now.resolution() && self.tree.lineage(id).generation > 4 {
            return Error::Zeno { site };
        }
        if chattering {
            return Error::Chattering { site };
        }
        let mut failing = Vec::new();
        for solve in &compiled.solves {
            for (atom, comparison) in solve.guard.atoms() {
                let alone = crate::model::Condition(vec![crate::model::Step::Atom(atom as u32, comparison)]);
                if alone.judge(|i| signs[i]) == Truth::No
                    && !failing.iter().any(|(s, _)| *s == compiled.atoms[atom])
                {
                    failing.push((compiled.atoms[atom], format!("if {}", self.boundary(rule, atom))));
                }
            }
        }
        Error::OutsideDomain { site, born: age == 0.0, failing }
    }

    /// How the boundary of an atom is written.
    fn boundary(&self, rule: usize, atom: usize) -> String {
        self.model.rules[rule].boundaries[atom].clone()
    }

    fn site(&self, fire: &Firing, time: f64) -> Site {
        let span = self.model.rules[fire.rule].produces[fire.produce].span;
        self.site_of(fire.id, fire.rule, span, time)
    }

    pub(super) fn site_of(
        &self,
        id: ModuleId,
        rule: usize,
        span: crate::diagnostic::Span,
        time: f64,
    ) -> Site {
        Site {
            module: self.describe(id),
            lineage: self.tree.lineage(id),
            rule: self.model.rules[rule].label.clone(),
            span,
            time,
        }
    }
}

impl Open {
    /// A module whose signs are known from its values only.
    pub(super) fn elsewhere(signs: &[Sign]) -> Open {
        let guess = signs.iter().map(|&s| if s == Sign::Zero { Sign::Any } else { s }).collect();
        Open { at: signs.to_vec(), guess, flow: None, tried: Vec::new(), flips: 0 }
    }

    /// A module that was followed along its trajectory.
    fn followed(state: &State) -> Open {
        let flow = (state.solve, state.switches.clone());
        let signs = &state.signs;
        Open { at: signs.clone(), guess: signs.clone(), flow: Some(flow), tried: Vec::new(), flips: 0 }
    }
}

/// The first clause, not tried before, whose condition holds or may hold.
fn next_clause(rule: &Rule, signs: &[Sign], tried: &[usize]) -> Option<usize> {
    (rule.solves.iter().enumerate())
        .find(|(i, s)| !tried.contains(i) && s.guard.judge(|a| signs[a]) != Truth::No)
        .map(|(i, _)| i)
}

/// The conditions inside a clause's equations. What may hold is first taken to hold.
fn switches(rule: &Rule, solve: Option<usize>, signs: &[Sign]) -> Vec<bool> {
    let all = solve.map_or(&[][..], |s| &rule.solves[s].switches);
    all.iter().map(|s| s.condition.judge(|a| signs[a]) != Truth::No).collect()
}
