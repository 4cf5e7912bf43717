//! Which parameters anybody reads: "model only what a scene needs".

use std::collections::HashSet;

use super::Draft;
use dlsys_expr::{Graph, NodeId};
use dlsys_model::Model;

/// Kinds with the numbers of their parameters.
type Read = HashSet<(usize, usize)>;

/// What the variables of rules stand for.
struct Owners<'m> {
    model: &'m Model,
    kinds_of: Vec<Vec<usize>>,
    /// Per rule: what each aggregate reads.
    terms: Vec<Vec<Vec<usize>>>,
}

impl Owners<'_> {
    fn new<'m>(graph: &Graph, model: &'m Model, drafts: &[Draft]) -> Owners<'m> {
        let mut kinds_of: Vec<Vec<usize>> = vec![Vec::new(); model.rules.len()];
        for (id, kind) in model.kinds.iter() {
            for rule in kind.all_rules() {
                kinds_of[rule].push(id.index());
            }
        }
        let reads = |node: &NodeId| graph.variables(&[*node]).into_iter().map(|v| v as usize).collect();
        let terms = drafts.iter().map(|draft| draft.terms.iter().map(reads).collect()).collect();
        Owners { model, kinds_of, terms }
    }

    /// Adds the parameters that a variable of a rule stands for.
    fn add(&self, index: usize, v: usize, read: &mut Read) {
        let rule = &self.model.rules[index];
        let own = rule.parameters.len();
        if v < own {
            read.extend(self.kinds_of[index].iter().map(|kind| (*kind, v)));
            return;
        }
        if v >= rule.first_aggregate {
            if let Some(terms) = self.terms[index].get(v - rule.first_aggregate) {
                let pattern = &rule.aggregates[v - rule.first_aggregate].pattern;
                for &v in terms {
                    match v.checked_sub(rule.variables) {
                        Some(p) => read.extend(pattern.kinds.iter().map(|k| (k.index(), p))),
                        None if v < rule.first_aggregate => self.add(index, v, read),
                        None => {}
                    }
                }
            }
            return;
        }
        let mut first = own;
        for pattern in rule.left.iter().chain(&rule.right) {
            if v < first + pattern.width {
                read.extend(pattern.kinds.iter().map(|k| (k.index(), v - first)));
                return;
            }
            first += pattern.width;
        }
    }
}

/// The parameters that rates and conditions read, by themselves or through algebraic parameters.
pub fn needed(graph: &Graph, model: &Model, drafts: &[Draft]) -> Read {
    let owners = Owners::new(graph, model, drafts);
    let mut read = Read::new();
    for (index, draft) in drafts.iter().enumerate() {
        // An implicit one is followed from its start: solved for now and then, it might be another solution.
        for entry in draft.algebraic.iter().flatten().filter(|entry| !entry.explicit) {
            owners.add(index, entry.parameter, &mut read);
        }
        let sides = draft.sides.iter().flat_map(|(a, b)| [*a, *b]);
        let nodes: Vec<NodeId> = sides.chain(draft.rates.iter().flatten().map(|r| r.1)).collect();
        for v in graph.variables(&nodes) {
            owners.add(index, v as usize, &mut read);
        }
    }
    loop {
        let known = read.len();
        for (index, draft) in drafts.iter().enumerate() {
            for clause in &draft.algebraic {
                let is_read = |p: usize| owners.kinds_of[index].iter().any(|kind| read.contains(&(*kind, p)));
                let known = clause.iter().filter(|e| !e.explicit || is_read(e.parameter));
                let nodes: Vec<NodeId> = known.map(|e| e.node).collect();
                for v in graph.variables(&nodes) {
                    owners.add(index, v as usize, &mut read);
                }
            }
        }
        if read.len() == known {
            return read;
        }
    }
}

/// Per kind and parameter: nothing but the drawing reads it.
pub fn drawn_only(graph: &Graph, model: &Model, drafts: &[Draft]) -> Vec<Vec<bool>> {
    let owners = Owners::new(graph, model, drafts);
    let mut read = Read::new();
    for (index, (rule, draft)) in model.rules.iter().zip(drafts).enumerate() {
        let sides: Vec<NodeId> = draft.sides.iter().flat_map(|(a, b)| [*a, *b]).collect();
        let mut variables: Vec<usize> = graph.variables(&sides).into_iter().map(|v| v as usize).collect();
        let algebraic = draft.algebraic.iter().flatten().map(|e| (e.parameter, e.node));
        for (parameter, node) in draft.rates.iter().flatten().copied().chain(algebraic) {
            let others = graph.variables(&[node]).into_iter().map(|v| v as usize);
            variables.extend(others.filter(|v| *v != parameter));
        }
        variables.extend(rule.produces.iter().flat_map(|p| p.outcome.reads()));
        for v in variables {
            owners.add(index, v, &mut read);
        }
    }
    (model.kinds.iter())
        .map(|(id, kind)| (0..kind.arity).map(|p| !read.contains(&(id.index(), p))).collect())
        .collect()
}
