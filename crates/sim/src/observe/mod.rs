//! Observation: the structure written out at an instant, in two passes.
//!
//! The first goes through the structure in string order and writes every module with the values from which its
//! trajectories are displacements; it also collects the moving modules. It is made anew only when the structure has changed: from frame to frame a
//! string stays, but for the second pass, which goes through the moving ones, by class: the coefficients of their
//! trajectories are evaluated for many modules at once (`Program::eval_lanes`, to the same bits as one by one), and once
//! for twins.

pub mod cache;
pub mod inspect;

use crate::budget::afford_string;
use crate::error::Error;
use crate::kernel::Simulation;
use crate::trajectory::{AutonomousFlow, Riccati};
use crate::world::life::LifeClass;
use cache::{Column, FrameCache};
use dlsys_expr::{LANES, Lanes, Program};
use dlsys_model::{DrivenGrowth, SolutionForm};
use dlsys_tree::{ModuleId, ModuleString, SimTime, Version, Visit};

impl Simulation<'_> {
    /// Writes the structure into a string.
    pub(super) fn observe(&mut self, t: f64, now: SimTime, out: &mut ModuleString) -> Result<(), Error> {
        self.flow_stage().refresh(now)?;
        let mut cache = std::mem::take(&mut self.frames);
        let version = Version { source: cache.source, structure: self.world.structure };
        let again = cache.version == Some(version) && out.version() == Some(version);
        if again {
            out.show(t, now);
        } else {
            let site = || self.world.site_of_first(self.setup.model, self.instant.at);
            afford_string(&self.setup, &self.world, site)?;
            self.rebuild(&mut cache, t, now, out);
            cache.version = Some(version);
            out.set_version(version);
            out.set_run_limit(self.setup.settings.max_modules);
        }
        // The first place of a value that is none.
        let mut bad = usize::MAX;
        for &(id, to) in &cache.others {
            cache.values.clear();
            self.world.values(id, now, &mut cache.values);
            cache.values.truncate(self.world.tree.shown(id));
            let place = &mut out.parameters_mut()[to..to + cache.values.len()];
            place.copy_from_slice(&cache.values);
            if let Some(at) = place.iter().position(|x| !x.is_finite()) {
                bad = bad.min(to + at);
            }
        }
        for (label, column) in cache.columns.iter().enumerate().filter(|(_, column)| !column.rows.is_empty())
        {
            let class = self.world.lives.get(label as u16).expect("a lazy module's label");
            let registers = &mut cache.registers;
            let place = self.show_column(class, column, now, again, registers, out.parameters_mut());
            bad = bad.min(place);
        }
        self.frames = cache;
        match self.owner(bad) {
            Some((id, parameter)) => {
                // Values that no caller may use.
                out.reset(t);
                Err(self.world.not_finite(self.setup.model, id, parameter, now))
            }
            None => Ok(()),
        }
    }

    /// The first pass.
    fn rebuild(&self, cache: &mut FrameCache, t: f64, now: SimTime, out: &mut ModuleString) {
        let FrameCache { columns, others, .. } = cache;
        columns.iter_mut().for_each(Column::clear);
        columns.resize(self.world.lives.len(), Column::default());
        others.clear();
        let world = &self.world;
        // Modules at rest need not be visited again.
        let moves: Vec<bool> = (0..world.lives.len())
            .map(|label| {
                let class = world.lives.get(label as u16).expect("as many as there are columns");
                let clause = class.solve.map(|solve| &self.setup.model.rules[class.rule].solves[solve]);
                clause.is_some_and(|clause| !clause.of.is_empty())
            })
            .collect();
        world.tree.write(t, now, out, |id, label, to| match columns.get_mut(label as usize) {
            Some(column) if moves[label as usize] => {
                column.add(world.tree.birth(id), world.tree.values(), world.tree.places(id), to);
            }
            Some(_) => {}
            None if world.state(id).is_some() => others.push((id, to)),
            None => {}
        });
    }

    /// The second pass over the modules of a class; `again` if it has been over the same string before. Returns the first place of a value that is not finite.
    fn show_column(
        &self,
        class: &LifeClass,
        column: &Column,
        now: SimTime,
        again: bool,
        registers: &mut Vec<Lanes>,
        out: &mut [f64],
    ) -> usize {
        let rule = &self.setup.model.rules[class.rule];
        let Some(clause) = class.solve.map(|solve| &rule.solves[solve]) else { return usize::MAX };
        let (arity, time) = (rule.parameters.len(), rule.time_variable());
        let shown = arity - rule.hidden;
        let values = self.world.tree.values();
        let mut bad = usize::MAX;
        let mut tau = Lanes::default();
        let mut begin = 0;
        for rows in column.rows.chunks(LANES) {
            registers.resize(registers.len().max(time + 2), Lanes::default());
            for (lane, row) in rows.iter().enumerate() {
                tau[lane] = now.since(row.birth).max(0.0);
                for (i, x) in values[row.from as usize..row.from as usize + arity].iter().enumerate() {
                    registers[i][lane] = *x;
                }
                registers[time][lane] = row.birth.to_f64();
            }
            registers[time + 1] = Lanes::default();
            for (law, &parameter) in clause.solution_forms.iter().zip(&clause.of) {
                if parameter >= shown {
                    continue;
                }
                let moved: Lanes = match law {
                    // A parameter at rest is as it was in the frame before.
                    SolutionForm::Polynomial(program) if again && is_zero(program) => continue,
                    SolutionForm::Polynomial(program) => polynomial(program, registers, parameter, &tau),
                    SolutionForm::Quadratic(program) => {
                        let mut c = [Lanes::default(); 3];
                        for (power, register) in program.eval_lanes(registers).enumerate() {
                            c[power] = registers[register];
                        }
                        let mut moved = registers[parameter];
                        for (i, x) in moved.iter_mut().enumerate().take(rows.len()) {
                            *x = Riccati::new(*x, c[0][i], c[1][i], c[2][i]).at(*x, tau[i]);
                        }
                        moved
                    }
                    SolutionForm::Driven(law) => driven(law, registers, [parameter, time], &tau, rows.len()),
                    SolutionForm::Sum { .. } | SolutionForm::Numeric(_) => continue,
                };
                let mut from = begin;
                for (row, &x) in rows.iter().zip(moved.iter()) {
                    let twins = &column.places[from..row.end as usize];
                    from = row.end as usize;
                    for &to in twins {
                        out[to as usize + parameter] = x;
                    }
                    if !x.is_finite() {
                        bad = bad.min(twins[0] as usize + parameter);
                    }
                }
            }
            begin = rows.last().map_or(begin, |row| row.end as usize);
        }
        bad
    }

    /// The module whose parameter stands at a place of the string, if there is one.
    fn owner(&self, place: usize) -> Option<(ModuleId, usize)> {
        if place == usize::MAX {
            return None;
        }
        let mut first = 0;
        for visit in self.world.tree.walk() {
            let Visit::Module(id) = visit else { continue };
            let arity = self.world.tree.shown(id);
            if place < first + arity {
                return Some((id, place - first));
            }
            first += arity;
        }
        None
    }
}

/// True for a rate that is 0 at all times.
fn is_zero(program: &Program) -> bool {
    program.outputs() == 1 && program.constant_output(0) == Some(0.0)
}

/// The values that follow a law `x' = h(time) q(x)`, some times after the births whose variables the registers hold.
fn driven(
    law: &DrivenGrowth,
    registers: &mut Vec<Lanes>,
    [parameter, time]: [usize; 2],
    tau: &Lanes,
    count: usize,
) -> Lanes {
    let mut c = [Lanes::default(); 3];
    for (i, register) in law.coefficients.eval_lanes(registers).enumerate() {
        c[i] = registers[register];
    }
    let mut s = *tau;
    if let Some(pace) = &law.pace {
        let whole = |registers: &mut Vec<Lanes>| -> Lanes {
            let place = pace.eval_lanes(registers).next();
            place.map_or(Lanes::all(f64::NAN), |place| registers[place])
        };
        let before = whole(registers);
        let births = [registers[time], registers[time + 1]];
        for k in 0..2 {
            registers[time + k] = Lanes(std::array::from_fn(|i| births[k][i] + tau[i]));
        }
        let after = whole(registers);
        (registers[time], registers[time + 1]) = (births[0], births[1]);
        s = Lanes(std::array::from_fn(|i| after[i] - before[i]));
    }
    let mut moved = registers[parameter];
    for (i, x) in moved.iter_mut().enumerate().take(count) {
        let flow = AutonomousFlow::new(law.growth, *x, c.map(|c| c[i]));
        *x += if tau[i] == 0.0 { 0.0 } else { flow.map_or(f64::NAN, |flow| flow.value(s[i])) };
    }
    moved
}

/// A parameter with a polynomial rate at the time `tau` after birth, for each lane: as `Trajectory::value` has it.
fn polynomial(program: &Program, registers: &mut Vec<Lanes>, parameter: usize, tau: &Lanes) -> Lanes {
    let mut c = [Lanes::default(); 4];
    for (power, register) in program.eval_lanes(registers).enumerate() {
        c[power] = registers[register];
    }
    let starts = &registers[parameter];
    if program.outputs() == 1 {
        // The higher coefficients are zero.
        return Lanes(std::array::from_fn(|i| starts[i] + tau[i] * (c[0][i] + tau[i] * 0.0)));
    }
    Lanes(std::array::from_fn(|i| {
        let tau = tau[i];
        let c = [c[0][i], c[1][i] / 2.0, c[2][i] / 3.0, c[3][i] / 4.0];
        starts[i] + tau * (c[0] + tau * (c[1] + tau * (c[2] + tau * c[3])))
    }))
}
