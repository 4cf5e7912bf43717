//! Aggregates in the equations of coupled modules: values of children, added up for many modules at a time.

use std::collections::BTreeMap;

use crate::flow::coupled::algebra::Fault;
use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::system::{Row, Source, Sum, System};
use dlsys_expr::LANES;
use dlsys_model::{Jacobian, Rule};

/// A partial derivative by a component: directly, or by way of one child of an aggregate.
#[derive(Clone, Copy, Debug)]
pub struct Partial {
    pub component: u32,
    /// In the Jacobian.
    pub entry: usize,
    /// Of the slopes of terms.
    slope: Option<usize>,
}

impl Partial {
    /// The value, given those of the Jacobian and of the slopes.
    pub fn value(&self, values: &[f64], slopes: &[f64]) -> f64 {
        values[self.entry] * self.slope.map_or(1.0, |slope| slopes[slope])
    }
}

impl System {
    /// The sums of a row.
    fn sums_of(&self, rules: &[Rule], row: &Row) -> impl Iterator<Item = u32> + '_ {
        let (first, count) = (rules[row.rule].first_aggregate, rules[row.rule].aggregates.len());
        let sources = &self.sources[row.first_source + first..][..count];
        sources.iter().filter_map(|source| match source {
            Source::Sum(number) => Some(*number),
            _ => None,
        })
    }

    /// Fills in the aggregates among the variables of a row's rule.
    pub fn gather(
        &self,
        rules: &[Rule],
        row: &Row,
        tau: f64,
        y: &[f64],
        inputs: &[f64],
        variables: &mut Vec<f64>,
    ) {
        let rule = &rules[row.rule];
        let mut scratch = Vec::new();
        for number in self.sums_of(rules, row) {
            let sum = &self.sums[number as usize];
            let aggregate = &rule.aggregates[sum.aggregate];
            let mut children = self.children_of(rules, number);
            let next = |variables: &mut Vec<f64>| match children.next() {
                Some(child) => {
                    variables.extend(child.iter().map(|source| self.value(*source, tau, y, inputs)));
                    true
                }
                None => false,
            };
            let value = aggregate.evaluate(variables, next, &mut scratch);
            variables[rule.first_aggregate + sum.aggregate] = value;
        }
    }

    /// Puts the children of all aggregates with the same term together, a few for each evaluation.
    pub fn put_together(&mut self) {
        if self.sums.is_empty() {
            return self.folds.clear();
        }
        let key = |sum: &Sum| (self.rows[sum.row as usize].rule, sum.aggregate);
        let mut groups: BTreeMap<(usize, usize), Vec<(u32, u32)>> = BTreeMap::new();
        for (number, sum) in self.sums.iter().enumerate() {
            let children = (0..sum.count as u32).map(|child| (number as u32, child));
            groups.entry(key(sum)).or_default().extend(children);
        }
        self.folds = (groups.into_iter())
            .flat_map(|(key, all)| all.chunks(LANES).map(|few| (key, few.to_vec())).collect::<Vec<_>>())
            .collect();
    }

    /// The sources of each child of a sum.
    fn children_of(&self, rules: &[Rule], number: u32) -> impl Iterator<Item = &[Source]> + '_ {
        let sum = self.sums[number as usize];
        let row = &self.rows[sum.row as usize];
        let width = rules[row.rule].aggregates[sum.aggregate].pattern.width;
        (0..sum.count).map(move |child| &self.children[sum.first + child * width..][..width])
    }

    /// Calls a function with the component that each partial derivative of a Jacobian is by.
    pub fn visit_partials(
        &self,
        rules: &[Rule],
        row: &Row,
        jacobian: &Jacobian,
        mut each: impl FnMut(Partial),
    ) {
        let rule = &rules[row.rule];
        let sources = &self.sources[row.first_source..row.first_source + row.sources];
        for (entry, &(_, variable)) in jacobian.entries.iter().enumerate() {
            match sources[variable] {
                Source::State(component) => each(Partial { component, entry, slope: None }),
                Source::Sum(number) => {
                    let before = self.sums_of(rules, row).take_while(|other| *other != number);
                    let width = |n: u32| {
                        let sum = &self.sums[n as usize];
                        sum.count * rule.aggregates[sum.aggregate].jacobian.entries.len()
                    };
                    let mut slope: usize = before.map(width).sum();
                    let aggregate = &rule.aggregates[self.sums[number as usize].aggregate];
                    for child in self.children_of(rules, number) {
                        for &(_, v) in &aggregate.jacobian.entries {
                            let source = match v.checked_sub(rule.variables) {
                                Some(of_child) => child.get(of_child).copied(),
                                None => sources.get(v).copied(),
                            };
                            if let Some(Source::State(component)) = source {
                                each(Partial { component, entry, slope: Some(slope) });
                            }
                            slope += 1;
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// The partial derivatives of the terms of a row's aggregates, one child after another. `variables` are those of the
    /// row's rule.
    pub fn slopes(
        &self,
        rules: &[Rule],
        row: &Row,
        variables: &mut Vec<f64>,
        tau: f64,
        y: &[f64],
        inputs: &[f64],
    ) -> Vec<f64> {
        let rule = &rules[row.rule];
        let (mut slopes, mut scratch) = (Vec::new(), Vec::new());
        let switches = variables.split_off(rule.variables);
        for number in self.sums_of(rules, row) {
            let jacobian = &rule.aggregates[self.sums[number as usize].aggregate].jacobian;
            for child in self.children_of(rules, number) {
                variables.extend(child.iter().map(|source| self.value(*source, tau, y, inputs)));
                let first = slopes.len();
                slopes.resize(first + jacobian.entries.len(), 0.0);
                jacobian.values.eval(variables, &mut scratch, &mut slopes[first..]);
                variables.truncate(rule.variables);
            }
        }
        variables.extend(switches);
        slopes
    }
}

impl Equations<'_> {
    /// Computes all aggregates. Children of many modules are worked on together; each sum is added up in string order.
    pub fn add_up(&mut self, tau: f64, y: &[f64]) {
        let system = self.system;
        self.memory.sums.clear();
        if system.sums.is_empty() {
            return;
        }
        self.memory.sums.resize(system.sums.len(), 0.0);
        let mut begun = vec![false; system.sums.len()];
        for (of, lanes) in &system.folds {
            self.fold(*of, lanes, tau, y, &mut begun);
        }
    }

    /// Adds the terms of some children.
    fn fold(
        &mut self,
        (rule, aggregate): (usize, usize),
        lanes: &[(u32, u32)],
        tau: f64,
        y: &[f64],
        begun: &mut [bool],
    ) {
        let system = self.system;
        let rule = &self.rules[rule];
        let aggregate = &rule.aggregates[aggregate];
        let width = aggregate.pattern.width;
        let mut registers = std::mem::take(&mut self.memory.registers);
        registers.resize(registers.len().max(rule.variables + width), [0.0; LANES]);
        for &v in aggregate.term.reads() {
            for (lane, &(number, child)) in registers[v].iter_mut().zip(lanes) {
                let sum = &system.sums[number as usize];
                let row = &system.rows[sum.row as usize];
                let source = match v.checked_sub(rule.variables) {
                    Some(of_child) => system.children[sum.first + child as usize * width + of_child],
                    None if v < row.sources => system.sources[row.first_source + v],
                    None => Source::Fixed(system.time(row, v - row.sources, tau)),
                };
                *lane = system.value(source, tau, y, &self.memory.inputs);
            }
        }
        let output = aggregate.term.eval_rows(&mut registers, lanes.len()).next().unwrap_or(0);
        for (lane, &(number, _)) in lanes.iter().enumerate() {
            let number = number as usize;
            let known = std::mem::replace(&mut begun[number], true).then_some(self.memory.sums[number]);
            self.memory.sums[number] = aggregate.fold.add(known, registers[output][lane]);
        }
        self.memory.registers = registers;
    }

    /// Equations that become singular, at the start of a step.
    pub fn fading(&mut self, y: &[f64]) -> Option<Fault> {
        self.read_inputs(0.0);
        self.system.algebra.fading(self.system, self.rules, &self.memory.inputs, y)
    }

    /// How far the errors of the components at the end of a step move what is solved for.
    pub fn sensitivity(&mut self, tau: f64, end: &[f64], errors: &[f64], tolerance: f64) -> f64 {
        let there: Result<Vec<f64>, Fault> = (|| {
            let mut there = end.to_vec();
            self.make_consistent(tau, &mut there)?;
            Ok(there)
        })();
        let mut aside: Vec<f64> = end.iter().zip(errors).map(|(y, e)| y - e).collect();
        let moved = self.make_consistent(tau, &mut aside);
        let (Ok(there), Ok(())) = (there, moved) else { return f64::INFINITY };
        let error = |c: usize| (there[c] - aside[c]).abs() / (tolerance * there[c].abs().max(1.0));
        let unknowns = self.system.algebra.unknowns.iter();
        unknowns.map(|unknown| error(unknown.component as usize)).fold(0.0, f64::max)
    }
}
