//! From an instant to the next: how the parameters of a module move, and what is known to come.

use super::error::Error;
use super::motion::{Driven, Flow, Function, Motion, Pace, Riccati, Terms};
use super::plant::{Path, Plant};
use super::queue::Who;
use super::simulation::Simulation;
use super::state::{Change, Next, What};
use super::watch::needs_search;
use dlsys_expr::Value;
use dlsys_model::{Law, Sign, Solve};
use dlsys_ode::Dense;
use dlsys_tree::{ModuleId, SimTime};
use smallvec::SmallVec;

/// The first stretch that is searched on formulas, if nothing is known of their pace, in units of time.
const FIRST_WINDOW: f64 = 1.0;
/// Two sides that differ by less than this part of the tolerance have met, where the equations end.
const ARRIVED: f64 = 0.01;
/// Growth of the stretches that are searched on formulas.
const WIDENING: f64 = 4.0;

impl Simulation<'_> {
    /// Starts the motions of the modules that were open, and of those that depend on them.
    pub(super) fn begin_phases(&mut self) -> Result<(), Error> {
        let mut opened = std::mem::take(&mut self.opened);
        opened.append(&mut self.ready);
        for &id in &opened {
            if let Some(state) = self.plant.state_mut(id) {
                state.open = None;
                state.waits = true;
            }
        }
        // A module that got several rules within the instant is there several times; its motion begins once.
        opened.retain(|id| self.plant.state_mut(*id).is_some_and(|state| std::mem::take(&mut state.waits)));
        for &id in &opened {
            let Some(state) = self.plant.state_mut(id) else { continue };
            if state.rule.is_some() {
                state.restarted = self.group;
                self.start_motions(id, self.forced);
            }
        }
        if self.looks_around || self.algebra.any {
            self.note_resting(&opened);
            self.couple(&opened)?;
        }
        for &id in &opened {
            let state = self.plant.state(id).filter(|s| s.rule.is_some() && !s.coupled);
            if state.is_some() {
                self.look_ahead(id, self.now)?;
            }
        }
        self.opened = opened;
        self.opened.clear();
        Ok(())
    }

    /// Gives each parameter of a module its motion from the present on. Numeric motions get their component; the
    /// steps are made later.
    pub(super) fn start_motions(&mut self, id: ModuleId, forced: bool) {
        let model = self.model;
        let state = self.plant.state(id).expect("a module with a rule");
        let rule = &model.rules[state.rule.expect("a module with a rule")];
        let Some(solve) = state.solve.map(|s| &rule.solves[s]) else {
            self.set_motions(id, false, &[]);
            return;
        };
        if solve.of.is_empty() && solve.algebraic.is_empty() {
            self.set_motions(id, false, &[]);
            return;
        }
        let mut motions = std::mem::take(&mut self.motions);
        motions.clear();
        motions.resize(rule.parameters.len(), Motion::Rest);
        let mut refused = false;
        if forced {
            for (component, &parameter) in solve.of.iter().enumerate() {
                motions[parameter] = Motion::Step(component as u32);
            }
            self.solved(solve, true, &mut motions);
        } else {
            let read = (rule, solve.stepping.laws_read());
            self.plant.variables_read(read, id, &state.context, self.now, &mut self.variables);
            self.variables.extend(state.switches.iter().map(|&on| f64::from(u8::from(on))));
            refused = !self.formulas(solve, rule.time_variable(), &mut motions)
                || !self.functions(solve, rule.time_variable(), &mut motions);
        }
        if refused {
            self.motions = motions;
            self.start_motions(id, true);
            return;
        }
        self.set_motions(id, forced, &motions);
        self.motions = motions;
    }

    fn set_motions(&mut self, id: ModuleId, forced: bool, motions: &[Motion]) {
        let now = self.now;
        let state = self.plant.state_mut(id).expect("a module with a rule");
        state.since = now;
        state.forced = forced;
        state.motions.clear();
        state.motions.extend(motions.iter().cloned());
        state.window = 0.0;
        if let Some(step) = &mut state.step {
            step.live = false;
        }
    }

    /// The motions of a clause from `self.variables`; false if a formula refuses these numbers.
    pub(super) fn formulas(&mut self, solve: &Solve, time: usize, motions: &mut [Motion]) -> bool {
        let mut out = [0.0; 4];
        // For the algebra: the coefficients f and d of exponential motions.
        let mut sums_follow = false;
        for (law, &parameter) in solve.laws.iter().zip(&solve.of) {
            match law {
                Law::Polynomial(program) => {
                    let out = &mut out[..program.outputs()];
                    program.eval(&self.variables, &mut self.scratch, out);
                    motions[parameter] = Motion::Polynomial(integrated(out, self.variables[time + 1]));
                }
                Law::Quadratic(program) => {
                    program.eval(&self.variables, &mut self.scratch, &mut out[..3]);
                    let riccati = Riccati::new(self.variables[parameter], out[0], out[1], out[2]);
                    motions[parameter] = Motion::Riccati(riccati);
                }
                Law::Sum { .. } => sums_follow = true,
                Law::Driven(driven) => match self.driven(driven, parameter, time) {
                    Some(motion) => motions[parameter] = motion,
                    None => return false,
                },
                Law::Numeric(_) => {}
            }
        }
        if sums_follow && !self.sums(solve, time, motions) {
            return false;
        }
        for (component, &position) in solve.numeric.iter().enumerate() {
            motions[solve.of[position]] = Motion::Step(component as u32);
        }
        motions.iter().zip(&self.variables).all(|(m, _)| !m.is_formula() || m.rate(0.0).is_finite())
    }

    /// The motion of a parameter at a pace; None if its formula does not hold for these numbers.
    fn driven(&mut self, law: &dlsys_model::Driven, parameter: usize, time: usize) -> Option<Motion> {
        let mut c = [0.0; 3];
        let coefficients = &mut c[..law.coefficients.outputs()];
        law.coefficients.eval(&self.variables, &mut self.scratch, coefficients);
        if coefficients.iter().any(|c| !c.is_finite()) {
            return None;
        }
        let x = self.variables[parameter];
        let flow = Flow::new(law.flow, x, c)?;
        let pace = match &law.pace {
            Some(program) => Some(Pace::new(program.clone(), &self.variables, time)?),
            None => None,
        };
        Some(Motion::Driven(Box::new(Driven::new(flow, pace))))
    }

    /// The motions of explicit parameters that are formulas, and components for those that are solved for.
    fn functions(&mut self, solve: &Solve, time: usize, motions: &mut [Motion]) -> bool {
        let algebraic = &solve.algebraic;
        for (place, &parameter) in algebraic.of.iter().enumerate() {
            if !algebraic.closed[place] {
                continue;
            }
            let program = &algebraic.formulas[place];
            let moves = |v: &usize| *v < motions.len() && !matches!(motions[*v], Motion::Rest);
            let moving =
                program.reads().iter().copied().filter(moves).map(|v| (v, motions[v].clone())).collect();
            let Some(function) = Function::new(program, &self.variables, moving, time) else { return false };
            motions[parameter] = Motion::Function(Box::new(function));
        }
        self.solved(solve, false, motions);
        true
    }

    /// Components for the algebraic parameters that are solved for, after those that are integrated.
    fn solved(&self, solve: &Solve, forced: bool, motions: &mut [Motion]) {
        let algebraic = &solve.algebraic;
        let first = if forced { solve.of.len() } else { solve.numeric.len() };
        let places = (0..algebraic.of.len()).filter(|place| algebraic.is_solved(*place, forced));
        for (component, place) in (first..).zip(places) {
            motions[algebraic.of[place]] = Motion::Step(component as u32);
        }
    }

    /// The motions that are sums, those that others depend on first.
    fn sums(&mut self, solve: &Solve, time: usize, motions: &mut [Motion]) -> bool {
        let mut variables: Vec<Terms> = self.variables.iter().map(|&x| Terms::constant(x)).collect();
        for v in [time, time + 1] {
            variables[v] = Terms::affine(self.variables[v], 1.0);
        }
        let mut known: Vec<bool> = solve.laws.iter().map(|law| !matches!(law, Law::Sum { .. })).collect();
        for (i, &parameter) in solve.of.iter().enumerate() {
            if known[i]
                && let Some(terms) = motions[parameter].terms(self.variables[parameter])
            {
                variables[parameter] = terms;
            }
        }
        while let Some(i) = (0..known.len()).find(|&i| {
            let Law::Sum { inflow, .. } = &solve.laws[i] else { return false };
            let waits = |v: usize| solve.of.iter().position(|p| *p == v).is_some_and(|j| j != i && !known[j]);
            !known[i] && !inflow.reads().iter().copied().any(waits)
        }) {
            let Law::Sum { factor, inflow } = &solve.laws[i] else { unreachable!("found as one") };
            let parameter = solve.of[i];
            let mut b = [0.0];
            factor.eval(&self.variables, &mut self.scratch, &mut b);
            let mut g = [Terms::constant(0.0)];
            inflow.eval(&variables, &mut Vec::new(), &mut g);
            let Some(sum) = g[0].solve(self.variables[parameter], b[0]) else { return false };
            variables[parameter] = sum.terms(self.variables[parameter]);
            motions[parameter] = Motion::Sum(Box::new(sum));
            known[i] = true;
        }
        known.into_iter().all(|k| k)
    }

    /// Finds out what comes next for a module that is not coupled, from an instant on, and puts it into the queue.
    pub(super) fn look_ahead(&mut self, id: ModuleId, from: SimTime) -> Result<(), Error> {
        let model = self.model;
        let who = Who::Module(id.slot() as u32);
        let Plant { tree, states, .. } = &mut self.plant;
        let state = states[id.slot()].as_mut().expect("a module with a rule");
        let rule = &model.rules[state.rule.expect("a module with a rule")];
        // The steps of coupled modules are not their own.
        let numeric = state.is_numeric() && !state.coupled;
        state.next = state.next.again();
        let (h, limit) = if numeric {
            match self.step_alone(id, from) {
                Ok(h) => (h, 1.0),
                Err(error) => return self.arrest(id, from).ok_or(error),
            }
        } else if needs_search(state, rule) {
            let h = if state.window > 0.0 { WIDENING * state.window } else { pace(state, tree) };
            // Not shorter than time itself can tell.
            let h = h.max(64.0 * from.resolution());
            state.window = h;
            (h, 1.0)
        } else {
            (1.0, f64::INFINITY)
        };
        let state = self.plant.state(id).expect("seen above");
        let path = Path::new(&self.plant, state, rule, from, h);
        let found = self.watcher.search(&path, limit);
        let end = (state.motions.iter()).filter_map(Motion::end).reduce(f64::min);
        let end = end.map(|tau| state.since.after(tau));
        let (what, at) = match found.event {
            Some(_) if found.in_doubt => (What::Doubt, found.touched[0].time),
            Some(_) => (What::Event, found.touched[0].time),
            None if numeric => (What::Window, state.step.as_ref().map_or(from, |s| s.dense.end)),
            None if limit.is_finite() => (What::Window, from.after(h)),
            None => (What::Nothing, from),
        };
        let (what, at) = match end {
            Some(end) if what == What::Nothing || end.since(at) < 0.0 => (What::Fault, end),
            _ => (what, at),
        };
        let state = self.plant.state_mut(id).expect("seen above");
        let lasting = limit.is_infinite();
        let (near, before, index) = (found.near, state.next.near, state.rule);
        state.next = Next { what, touched: found.touched, changes: found.changes, lasting, near };
        if what == What::Nothing {
            self.queue.cancel(who);
        } else {
            self.queue.schedule(who, at);
        }
        self.note_approach(index.unwrap_or(0), near, before, at);
        Ok(())
    }

    /// Where no step leads on because the equations end there: if a boundary is there too, it has been reached.
    pub(super) fn arrest(&mut self, id: ModuleId, at: SimTime) -> Option<()> {
        let model = self.model;
        let state = self.plant.state(id)?;
        let rule = &model.rules[state.rule?];
        self.plant.variables(rule, id, &state.context, at, &mut self.variables);
        let mut sides = vec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.variables, &mut self.scratch, &mut sides);
        let near = |atom: &usize| {
            let (a, b) = (sides[2 * atom], sides[2 * atom + 1]);
            (a - b).abs() <= ARRIVED * self.settings.tolerance * a.abs().max(b.abs()).max(1.0)
        };
        let signed = |atom: &usize| matches!(state.signs[*atom], Sign::Plus | Sign::Minus);
        let touched: SmallVec<[Change; 1]> = (0..rule.atoms.len())
            .filter(signed)
            .filter(near)
            .map(|atom| Change { atom, time: at, at: Sign::Zero, after: state.signs[atom], level: None })
            .collect();
        if touched.is_empty() {
            return None;
        }
        let state = self.plant.state_mut(id)?;
        state.next = Next { what: What::Event, touched, ..Next::default() };
        self.queue.schedule(Who::Module(id.slot() as u32), at);
        Some(())
    }

    /// Goes on to the next stretch of a module.
    pub(super) fn pass_window(&mut self, id: ModuleId, at: SimTime) -> Result<(), Error> {
        let state = self.plant.state_mut(id).expect("scheduled");
        state.pass_changes(at);
        if state.is_numeric() {
            // The numeric parameters begin anew; formulas go on from where they began.
            self.rebase(id, at);
        }
        self.look_ahead(id, at)
    }

    /// Makes the end of a module's own step the start of its next.
    fn rebase(&mut self, id: ModuleId, at: SimTime) {
        let state = self.plant.state(id).expect("scheduled");
        let first = self.plant.tree.places(id).start;
        let ends: Vec<(usize, f64)> = (state.motions.iter().enumerate())
            .filter_map(|(parameter, motion)| match motion {
                Motion::Step(c) => {
                    let dense: &Dense = &state.step.as_ref()?.dense;
                    Some((first + parameter, dense.value(*c as usize, dense.position(at))))
                }
                _ => None,
            })
            .collect();
        for (place, value) in ends {
            self.plant.tree.set_value(place, value);
        }
    }

    /// Forgets all about a module that has been replaced, or has lost its rule.
    pub(super) fn forget(&mut self, id: ModuleId) {
        // What was kept of it stays as memory for the next that lives there.
        if let Some(state) = self.plant.state_mut(id) {
            state.is_alive = false;
            if state.coupled {
                self.coupled.repaired = true;
                self.coupled.loosened.extend_from_slice(&state.context);
            }
            self.queue.cancel(Who::Module(id.slot() as u32));
        }
    }
}

/// Coefficients of the displacement whose rate is `Σ c_j age^j`, as powers of the time since a given age.
fn integrated(c: &[f64], age: f64) -> [f64; 4] {
    let mut shifted = [0.0; 4];
    shifted[..c.len()].copy_from_slice(c);
    if age != 0.0 {
        // Taylor shift by Horner's scheme.
        for i in 0..c.len() {
            for j in (i..c.len() - 1).rev() {
                shifted[j] += age * shifted[j + 1];
            }
        }
    }
    [shifted[0], shifted[1] / 2.0, shifted[2] / 3.0, shifted[3] / 4.0]
}

/// A time in which the formulas of a module change noticeably.
fn pace(state: &super::state::State, tree: &dlsys_tree::Tree) -> f64 {
    let values = tree.parameters(state.id);
    let times = state.motions.iter().zip(values).filter_map(|(motion, x)| {
        let rate = motion.rate(0.0).abs();
        (rate > 0.0 && *x != 0.0).then(|| (x.abs() / rate).clamp(1e-9, 1e9))
    });
    times.reduce(f64::min).unwrap_or(FIRST_WINDOW)
}
