//! Observation: the structure written out at an instant, in two passes.
//!
//! The first goes through the structure in string order and writes who is there, with the values of which motions are
//! displacements; it also notes who moves. It is made anew only when the structure has changed: from frame to frame a
//! string stays, but for the second pass, which goes through those that move, by career: the coefficients of their
//! motions are evaluated for many modules at once (`Program::eval_lanes`, to the same bits as one by one), and once
//! for twins.

use std::ops::Range;

use super::career::{Career, same_bits};
use super::error::Error;
use super::motion::{Flow, Riccati};
use super::simulation::Simulation;
use dlsys_expr::{LANES, Lanes, Program};
use dlsys_model::{Driven, Law};
use dlsys_tree::{ModuleId, ModuleString, SimTime, Version, Visit};

/// Who moves, in the structure of some version.
#[derive(Debug, Default)]
pub(super) struct Gallery {
    version: Option<Version>,
    /// Light modules, by label.
    columns: Vec<Cast>,
    /// Modules with a state, and where their parameters begin in the string.
    others: Vec<(ModuleId, usize)>,
    registers: Vec<Lanes>,
    values: Vec<f64>,
}

/// A copy of a simulation looks anew: what is remembered here may be as large as all the rest.
impl Clone for Gallery {
    fn clone(&self) -> Gallery {
        Gallery::default()
    }
}

/// The light modules of a career that move.
#[derive(Clone, Debug, Default)]
struct Cast {
    rows: Vec<Row>,
    /// Where the parameters of each stand in the string.
    places: Vec<u32>,
}

/// A light module with its twins: those after it in the string that were born at the same instant with the same values,
/// so that they are the same at all times.
#[derive(Clone, Copy, Debug)]
struct Row {
    birth: SimTime,
    /// Where the parameters of one of them begin in the tree.
    from: u32,
    /// Where they end in the list of places; they begin where those of the row before end.
    end: u32,
}

impl Cast {
    fn clear(&mut self) {
        self.rows.clear();
        self.places.clear();
    }

    fn add(&mut self, birth: SimTime, values: &[f64], own: Range<usize>, to: usize) {
        self.places.push(to as u32);
        let end = self.places.len() as u32;
        if let Some(last) = self.rows.last_mut()
            && last.birth == birth
            && same_bits(&values[last.from as usize..last.from as usize + own.len()], &values[own.clone()])
        {
            last.end = end;
            return;
        }
        self.rows.push(Row { birth, from: own.start as u32, end });
    }
}

impl Simulation<'_> {
    /// Writes the structure into a string.
    pub(super) fn observe(&mut self, t: f64, now: SimTime, out: &mut ModuleString) -> Result<(), Error> {
        self.refresh(now)?;
        let mut gallery = std::mem::take(&mut self.gallery);
        let version = Version { source: self.source, structure: self.structure };
        let again = gallery.version == Some(version) && out.version() == Some(version);
        if again {
            out.show(t, now);
        } else {
            self.afford_string()?;
            self.hang(&mut gallery, t, now, out);
            gallery.version = Some(version);
            out.set_version(version);
        }
        // The first place of a value that is none.
        let mut bad = usize::MAX;
        for &(id, to) in &gallery.others {
            gallery.values.clear();
            self.plant.values(id, now, &mut gallery.values);
            gallery.values.truncate(self.plant.tree.shown(id));
            let place = &mut out.parameters_mut()[to..to + gallery.values.len()];
            place.copy_from_slice(&gallery.values);
            if let Some(at) = place.iter().position(|x| !x.is_finite()) {
                bad = bad.min(to + at);
            }
        }
        for (label, cast) in gallery.columns.iter().enumerate().filter(|(_, cast)| !cast.rows.is_empty()) {
            let career = self.plant.careers.get(label as u16).expect("a light module's label");
            let registers = &mut gallery.registers;
            let place = self.show_column(career, cast, now, again, registers, out.parameters_mut());
            bad = bad.min(place);
        }
        self.gallery = gallery;
        match self.owner(bad) {
            Some((id, parameter)) => {
                // Not what anybody may go on from.
                out.reset(t);
                Err(self.not_finite(id, parameter, now))
            }
            None => Ok(()),
        }
    }

    /// The first pass.
    fn hang(&self, gallery: &mut Gallery, t: f64, now: SimTime, out: &mut ModuleString) {
        let Gallery { columns, others, .. } = gallery;
        columns.iter_mut().for_each(Cast::clear);
        columns.resize(self.plant.careers.len(), Cast::default());
        others.clear();
        let plant = &self.plant;
        // What rests need not be looked at again.
        let moves: Vec<bool> = (0..plant.careers.len())
            .map(|label| {
                let career = plant.careers.get(label as u16).expect("as many as there are columns");
                let clause = career.solve.map(|solve| &self.model.rules[career.rule].solves[solve]);
                clause.is_some_and(|clause| !clause.of.is_empty())
            })
            .collect();
        plant.tree.write(t, now, out, |id, label, to| match columns.get_mut(label as usize) {
            Some(cast) if moves[label as usize] => {
                cast.add(plant.tree.birth(id), plant.tree.values(), plant.tree.places(id), to);
            }
            Some(_) => {}
            None if plant.state(id).is_some() => others.push((id, to)),
            None => {}
        });
    }

    /// The second pass over the modules of a career; `again` if it has been over the same string before. Returns the first place of a value that is not finite.
    fn show_column(
        &self,
        career: &Career,
        cast: &Cast,
        now: SimTime,
        again: bool,
        registers: &mut Vec<Lanes>,
        out: &mut [f64],
    ) -> usize {
        let rule = &self.model.rules[career.rule];
        let Some(clause) = career.solve.map(|solve| &rule.solves[solve]) else { return usize::MAX };
        let (arity, time) = (rule.parameters.len(), rule.time_variable());
        let shown = arity - rule.hidden;
        let values = self.plant.tree.values();
        let mut bad = usize::MAX;
        let mut tau = [0.0; LANES];
        let mut begin = 0;
        for rows in cast.rows.chunks(LANES) {
            registers.resize(registers.len().max(time + 2), [0.0; LANES]);
            for (lane, row) in rows.iter().enumerate() {
                tau[lane] = now.since(row.birth).max(0.0);
                for (i, x) in values[row.from as usize..row.from as usize + arity].iter().enumerate() {
                    registers[i][lane] = *x;
                }
                registers[time][lane] = row.birth.to_f64();
            }
            registers[time + 1] = [0.0; LANES];
            for (law, &parameter) in clause.laws.iter().zip(&clause.of) {
                if parameter >= shown {
                    continue;
                }
                let moved: Lanes = match law {
                    // What is at rest is what it was in the frame before.
                    Law::Polynomial(program) if again && is_zero(program) => continue,
                    Law::Polynomial(program) => polynomial(program, registers, parameter, &tau),
                    Law::Quadratic(program) => {
                        let mut c = [[0.0; LANES]; 3];
                        for (power, register) in program.eval_lanes(registers).enumerate() {
                            c[power] = registers[register];
                        }
                        let mut moved = registers[parameter];
                        for (i, x) in moved.iter_mut().enumerate().take(rows.len()) {
                            *x += Riccati::new(*x, c[0][i], c[1][i], c[2][i]).value(tau[i]);
                        }
                        moved
                    }
                    Law::Driven(law) => driven(law, registers, [parameter, time], &tau, rows.len()),
                    Law::Sum { .. } | Law::Numeric(_) => continue,
                };
                let mut from = begin;
                for (row, &x) in rows.iter().zip(&moved) {
                    let twins = &cast.places[from..row.end as usize];
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
        for visit in self.plant.tree.walk() {
            let Visit::Module(id) = visit else { continue };
            let arity = self.plant.tree.shown(id);
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
    law: &Driven,
    registers: &mut Vec<Lanes>,
    [parameter, time]: [usize; 2],
    tau: &Lanes,
    count: usize,
) -> Lanes {
    let mut c = [[0.0; LANES]; 3];
    for (i, register) in law.coefficients.eval_lanes(registers).enumerate() {
        c[i] = registers[register];
    }
    let mut s = *tau;
    if let Some(pace) = &law.pace {
        let whole = |registers: &mut Vec<Lanes>| -> Lanes {
            let place = pace.eval_lanes(registers).next();
            place.map_or([f64::NAN; LANES], |place| registers[place])
        };
        let before = whole(registers);
        let births = [registers[time], registers[time + 1]];
        for k in 0..2 {
            registers[time + k] = std::array::from_fn(|i| births[k][i] + tau[i]);
        }
        let after = whole(registers);
        (registers[time], registers[time + 1]) = (births[0], births[1]);
        s = std::array::from_fn(|i| after[i] - before[i]);
    }
    let mut moved = registers[parameter];
    for (i, x) in moved.iter_mut().enumerate().take(count) {
        let flow = Flow::new(law.flow, *x, c.map(|c| c[i]));
        *x += if tau[i] == 0.0 { 0.0 } else { flow.map_or(f64::NAN, |flow| flow.value(s[i])) };
    }
    moved
}

/// A parameter with a polynomial rate at the time `tau` after birth, for each lane: as `Motion::value` has it.
fn polynomial(program: &Program, registers: &mut Vec<Lanes>, parameter: usize, tau: &Lanes) -> Lanes {
    let mut c = [[0.0; LANES]; 4];
    for (power, register) in program.eval_lanes(registers).enumerate() {
        c[power] = registers[register];
    }
    let starts = &registers[parameter];
    if program.outputs() == 1 {
        // What is added to the first coefficient is zero.
        return std::array::from_fn(|i| starts[i] + tau[i] * (c[0][i] + tau[i] * 0.0));
    }
    std::array::from_fn(|i| {
        let tau = tau[i];
        let c = [c[0][i], c[1][i] / 2.0, c[2][i] / 3.0, c[3][i] / 4.0];
        starts[i] + tau * (c[0] + tau * (c[1] + tau * (c[2] + tau * c[3])))
    })
}
