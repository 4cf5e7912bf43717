//! Aggregates in the equations of coupled modules, and partial derivatives by way of them.

use std::collections::BTreeMap;

use crate::flow::coupled::rows::{EquationRow, EquationTable, RowAggregate, VariableSource};
use dlsys_expr::LANES;
use dlsys_model::{Jacobian, Rule};

/// A rule and the number of one of its aggregates.
type TermKey = (usize, usize);

/// At most [`LANES`] children of aggregates with the same term: by the number of the aggregate in the table, and of the
/// child in it.
pub type TermBatch = (TermKey, Vec<(u32, u32)>);

/// A partial derivative by a component: directly, or by way of one child of an aggregate.
#[derive(Clone, Copy, Debug)]
pub struct Partial {
    /// The component of the state vector that the derivative is by.
    pub component: u32,
    /// Index of the entry in the Jacobian.
    pub entry: usize,
    /// Index among the slopes of terms, if it is by way of a child.
    slope: Option<usize>,
}

impl Partial {
    /// The value, given the values of the Jacobian's entries and the slopes of the terms.
    pub fn value(&self, values: &[f64], slopes: &[f64]) -> f64 {
        values[self.entry] * self.slope.map_or(1.0, |slope| slopes[slope])
    }
}

impl EquationTable {
    /// The aggregates of a row, by their numbers.
    fn aggregates_of(&self, rules: &[Rule], row: &EquationRow) -> impl Iterator<Item = u32> + '_ {
        let (first, count) = (rules[row.rule].first_aggregate, rules[row.rule].aggregates.len());
        let sources = &self.sources[row.first_source + first..][..count];
        sources.iter().filter_map(|source| match source {
            VariableSource::Aggregate(number) => Some(*number),
            _ => None,
        })
    }

    /// Fills in the aggregates among the variables of a row's rule, at a time after the start.
    pub fn gather(
        &self,
        rules: &[Rule],
        row: &EquationRow,
        tau: f64,
        y: &[f64],
        inputs: &[f64],
        variables: &mut Vec<f64>,
    ) {
        let rule = &rules[row.rule];
        let mut scratch = Vec::new();
        for number in self.aggregates_of(rules, row) {
            let sum = &self.aggregates[number as usize];
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

    /// Puts the children of all aggregates with the same term together, in batches.
    pub fn batch_terms(&self, batches: &mut Vec<TermBatch>) {
        batches.clear();
        if self.aggregates.is_empty() {
            return;
        }
        let key = |sum: &RowAggregate| (self.rows[sum.row as usize].rule, sum.aggregate);
        let mut groups: BTreeMap<TermKey, Vec<(u32, u32)>> = BTreeMap::new();
        for (number, sum) in self.aggregates.iter().enumerate() {
            let children = (0..sum.count as u32).map(|child| (number as u32, child));
            groups.entry(key(sum)).or_default().extend(children);
        }
        for (key, all) in groups {
            batches.extend(all.chunks(LANES).map(|few| (key, few.to_vec())));
        }
    }

    /// The sources of the parameters of each child of an aggregate.
    fn children_of(&self, rules: &[Rule], number: u32) -> impl Iterator<Item = &[VariableSource]> + '_ {
        let sum = self.aggregates[number as usize];
        let row = &self.rows[sum.row as usize];
        let width = rules[row.rule].aggregates[sum.aggregate].pattern.width;
        (0..sum.count).map(move |child| &self.children[sum.first + child * width..][..width])
    }

    /// Calls a function with each partial derivative of a row's Jacobian by a component.
    pub fn visit_partials(
        &self,
        rules: &[Rule],
        row: &EquationRow,
        jacobian: &Jacobian,
        mut each: impl FnMut(Partial),
    ) {
        let rule = &rules[row.rule];
        let sources = &self.sources[row.first_source..row.first_source + row.sources];
        for (entry, &(_, variable)) in jacobian.entries.iter().enumerate() {
            match sources[variable] {
                VariableSource::State(component) => each(Partial { component, entry, slope: None }),
                VariableSource::Aggregate(number) => {
                    let before = self.aggregates_of(rules, row).take_while(|other| *other != number);
                    let width = |n: u32| {
                        let sum = &self.aggregates[n as usize];
                        sum.count * rule.aggregates[sum.aggregate].jacobian.entries.len()
                    };
                    let mut slope: usize = before.map(width).sum();
                    let aggregate = &rule.aggregates[self.aggregates[number as usize].aggregate];
                    for child in self.children_of(rules, number) {
                        for &(_, v) in &aggregate.jacobian.entries {
                            let source = match v.checked_sub(rule.variables) {
                                Some(of_child) => child.get(of_child).copied(),
                                None => sources.get(v).copied(),
                            };
                            if let Some(VariableSource::State(component)) = source {
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

    /// The slopes: the partial derivatives of the terms of a row's aggregates, one child after another. `variables` are
    /// those of the row's rule, followed by the switches.
    pub fn slopes(
        &self,
        rules: &[Rule],
        row: &EquationRow,
        variables: &mut Vec<f64>,
        tau: f64,
        y: &[f64],
        inputs: &[f64],
    ) -> Vec<f64> {
        let rule = &rules[row.rule];
        let (mut slopes, mut scratch) = (Vec::new(), Vec::new());
        let switches = variables.split_off(rule.variables);
        for number in self.aggregates_of(rules, row) {
            let jacobian = &rule.aggregates[self.aggregates[number as usize].aggregate].jacobian;
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
