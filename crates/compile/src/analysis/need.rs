//! The parameters that rates, conditions and productions read; others need no computation until they are observed.

use rustc_hash::{FxHashMap, FxHashSet};

use dlsys_expr::{Graph, NodeId};
use dlsys_model::Kinds;

use crate::declared::ResolvedRule;

/// Parameters as pairs of the index of a kind and that of the parameter.
type ParameterSet = FxHashSet<(usize, usize)>;

/// The parameters for which the variables of rules stand.
struct Owners<'r> {
    rules: &'r [ResolvedRule],
    /// By rule: the kinds to which it applies.
    kinds_of: Vec<Vec<usize>>,
    /// By rule: the variables that each aggregate reads.
    terms: Vec<Vec<Vec<usize>>>,
}

impl Owners<'_> {
    fn new<'r>(graph: &Graph, kinds: &Kinds, rules: &'r [ResolvedRule]) -> Owners<'r> {
        let mut kinds_of: Vec<Vec<usize>> = vec![Vec::new(); rules.len()];
        for (id, kind) in kinds.iter() {
            for rule in kind.all_rules() {
                kinds_of[rule].push(id.index());
            }
        }
        let terms =
            rules.iter().map(|rule| rule.declared.terms().map(|term| reads(graph, &[term])).collect());
        Owners { rules, kinds_of, terms: terms.collect() }
    }

    /// Adds the parameters that a variable of a rule stands for.
    fn add(&self, index: usize, v: usize, read: &mut ParameterSet) {
        let rule = &self.rules[index];
        let (own, first_aggregate) = (rule.declared.own(), rule.declared.first_aggregate);
        if v < own {
            read.extend(self.kinds_of[index].iter().map(|kind| (*kind, v)));
            return;
        }
        if v >= first_aggregate {
            if let Some(terms) = self.terms[index].get(v - first_aggregate) {
                let pattern = &rule.children[v - first_aggregate];
                for &v in terms {
                    match v.checked_sub(rule.declared.variables) {
                        Some(p) => read.extend(pattern.kinds.iter().map(|k| (k.index(), p))),
                        None if v < first_aggregate => self.add(index, v, read),
                        None => {}
                    }
                }
            }
            return;
        }
        let mut first = own;
        for pattern in rule.context() {
            if v < first + pattern.width {
                read.extend(pattern.kinds.iter().map(|k| (k.index(), v - first)));
                return;
            }
            first += pattern.width;
        }
    }
}

/// The variables that expressions read.
fn reads(graph: &Graph, nodes: &[NodeId]) -> Vec<usize> {
    graph.variables(nodes).into_iter().map(|v| v as usize).collect()
}

/// The same for many rules, of which those that differ in names only have the same expressions.
struct Reads<'g> {
    graph: &'g Graph,
    known: FxHashMap<Box<[NodeId]>, Vec<usize>>,
}

impl<'g> Reads<'g> {
    fn new(graph: &'g Graph) -> Reads<'g> {
        Reads { graph, known: FxHashMap::default() }
    }

    fn of(&mut self, nodes: &[NodeId]) -> &[usize] {
        if !self.known.contains_key(nodes) {
            self.known.insert(nodes.into(), reads(self.graph, nodes));
        }
        &self.known[nodes]
    }
}

/// The parameters that rates and conditions read, directly or through algebraic parameters.
pub fn needed(graph: &Graph, kinds: &Kinds, rules: &[ResolvedRule]) -> ParameterSet {
    let owners = Owners::new(graph, kinds, rules);
    let mut read = ParameterSet::default();
    let mut reads = Reads::new(graph);
    for (index, ResolvedRule { declared, .. }) in rules.iter().enumerate() {
        // An implicit parameter is solved for in each step: occasional solves might converge to another solution.
        for entry in declared.algebraic().filter(|entry| !entry.explicit) {
            owners.add(index, entry.parameter, &mut read);
        }
        let nodes: Vec<NodeId> = declared.side_nodes().chain(declared.rates().map(|rate| rate.1)).collect();
        for &v in reads.of(&nodes) {
            owners.add(index, v, &mut read);
        }
    }
    loop {
        let known = read.len();
        for (index, ResolvedRule { declared, .. }) in rules.iter().enumerate() {
            for clause in &declared.solves {
                let is_read = |p: usize| owners.kinds_of[index].iter().any(|kind| read.contains(&(*kind, p)));
                let known = clause.algebraic.iter().filter(|e| !e.explicit || is_read(e.parameter));
                let nodes: Vec<NodeId> = known.map(|e| e.node).collect();
                for &v in reads.of(&nodes) {
                    owners.add(index, v, &mut read);
                }
            }
        }
        if read.len() == known {
            return read;
        }
    }
}

/// By kind and parameter: true if only drawings read it.
pub fn drawn_only(graph: &Graph, kinds: &Kinds, rules: &[ResolvedRule]) -> Vec<Vec<bool>> {
    let owners = Owners::new(graph, kinds, rules);
    let mut read = ParameterSet::default();
    let mut reads = Reads::new(graph);
    for (index, ResolvedRule { declared, .. }) in rules.iter().enumerate() {
        let sides: Vec<NodeId> = declared.side_nodes().collect();
        let mut variables = reads.of(&sides).to_vec();
        let algebraic = declared.algebraic().map(|entry| (entry.parameter, entry.node));
        for (parameter, node) in declared.rates().chain(algebraic) {
            variables.extend(reads.of(&[node]).iter().copied().filter(|v| *v != parameter));
        }
        variables.extend(declared.produces.iter().flat_map(|p| p.outcome.reads()));
        for v in variables {
            owners.add(index, v, &mut read);
        }
    }
    (kinds.iter())
        .map(|(id, kind)| (0..kind.arity).map(|p| !read.contains(&(id.index(), p))).collect())
        .collect()
}
