//! The variables that are constant between events, and those that change.

use rustc_hash::FxHashSet;

use dlsys_expr::{Graph, NodeId};
use dlsys_model::{Kinds, Pattern};

use crate::declared::{DeclaredRule, DeclaredSolve, ResolvedRule};

/// The parameters of modules for which some rule has an equation.
pub struct Moving {
    /// By kind and parameter: true if an equation changes it.
    kinds: Vec<Vec<bool>>,
    /// By rule: the variables between the module's own and `t`; those of the context come first, then the aggregates.
    contexts: Vec<Vec<bool>>,
}

impl Moving {
    pub fn new(graph: &Graph, kinds: &Kinds, rules: &[ResolvedRule]) -> Moving {
        let mut all: Vec<Vec<bool>> = kinds.iter().map(|(_, kind)| vec![false; kind.width()]).collect();
        for (id, kind) in kinds.iter() {
            let solves = kind.rules.iter().flat_map(|rule| &rules[*rule].declared.solves);
            for parameter in solves.flat_map(DeclaredSolve::moved) {
                all[id.index()][parameter] = true;
            }
        }
        let mut moving = Moving { kinds: all, contexts: Vec::new() };
        moving.contexts = rules.iter().map(|rule| moving.of_context(graph, rule)).collect();
        moving
    }

    /// True if a parameter changes in some kind that the pattern matches.
    pub fn in_pattern(&self, pattern: &Pattern, parameter: usize) -> bool {
        pattern.kinds.iter().any(|kind| self.kinds[kind.index()][parameter])
    }

    /// By variable of the context of a rule, then by aggregate: true if it changes.
    pub fn context(&self, rule: usize) -> &[bool] {
        &self.contexts[rule]
    }

    fn of_context(&self, graph: &Graph, rule: &ResolvedRule) -> Vec<bool> {
        let declared = &rule.declared;
        let mut all: Vec<bool> = (rule.context())
            .flat_map(|pattern| (0..pattern.width).map(|p| self.in_pattern(pattern, p)))
            .collect();
        let (own, variables) = (declared.own(), declared.variables);
        let context = own + all.len();
        let moving: Vec<bool> = (rule.children.iter().zip(declared.terms()))
            .map(|(pattern, term)| {
                graph.variables(&[term]).into_iter().any(|v| match v as usize {
                    v if v >= variables => self.in_pattern(pattern, v - variables),
                    v if v < own => declared.moves(v),
                    v if v < context => all[v - own],
                    _ => true,
                })
            })
            .collect();
        all.extend(moving);
        all.resize(variables - 2 - own, false);
        all
    }
}

/// The variables of a rule that are constant while one clause is active.
#[derive(Clone)]
pub struct Constants<'a> {
    /// Number of the module's own parameters.
    pub own: usize,
    /// Own parameters with an equation.
    of: FxHashSet<usize>,
    /// By variable of the context, then by aggregate: true if it changes.
    moving: &'a [bool],
    /// Index of `t`; `age` is the next.
    pub time: usize,
}

impl<'a> Constants<'a> {
    /// The state without an active clause. `moving` is true for variables of the context and aggregates that change.
    pub fn at_rest(rule: &DeclaredRule, moving: &'a [bool]) -> Constants<'a> {
        Constants { own: rule.own(), of: FxHashSet::default(), moving, time: rule.time() }
    }

    /// The state while this clause is active.
    pub fn under(&self, solve: &DeclaredSolve) -> Constants<'a> {
        Constants { of: solve.moved().collect(), ..self.clone() }
    }

    pub fn is_constant(&self, variable: u32) -> bool {
        let v = variable as usize;
        if v < self.own {
            !self.of.contains(&v)
        } else if v < self.time {
            !self.moving[v - self.own]
        } else {
            v > self.time + 1
        }
    }

    pub fn all_constant(&self, graph: &Graph, roots: &[NodeId]) -> bool {
        graph.variables(roots).into_iter().all(|v| self.is_constant(v))
    }

    /// True if the expressions read a variable of the context that changes.
    pub fn reads_context(&self, graph: &Graph, roots: &[NodeId]) -> bool {
        let context = |v: u32| (v as usize) >= self.own && (v as usize) < self.time;
        graph.variables(roots).into_iter().any(|v| context(v) && !self.is_constant(v))
    }
}
