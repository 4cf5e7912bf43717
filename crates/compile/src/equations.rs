//! The equations of a `solve`: rates, values and equations to be solved.
//!
//! ```text
//! solve dx/dt = r*x - z, w = sqrt(x), 0 = z^3 + z - x*w
//! ```
//!
//! The formula of an explicit parameter (`w`) is substituted into the equations that read it, so that it needs no
//! evaluation of its own. Each implicit equation is matched to the parameter that it is solved for. Without a complete
//! matching the equations are singular for all values, which is an error here.

use rustc_hash::FxHashMap;

use crate::advice;
use crate::analysis::is_singular;
use crate::declared::DeclaredAlgebraic;
use crate::rules::RuleBuilder;
use crate::scope::Variables;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Graph, Node, NodeId};
use dlsys_syntax::ast::{self, Expression, HeadModule};

/// Maximum number of implicit equations of one clause; they form one system for each module.
const MAX_IMPLICIT: usize = 100;

/// The equations of one `solve`.
#[derive(Default)]
pub(super) struct Equations {
    /// Parameters with their rates, without those that are the constant 0.
    pub rates: Vec<(usize, NodeId)>,
    /// Values and implicit equations; values come first.
    pub algebraic: Vec<DeclaredAlgebraic>,
}

/// An implicit equation `0 = …`.
struct Zero {
    residual: NodeId,
    unknown: Option<usize>,
    span: Span,
}

impl Equations {
    /// All expressions with their parameters.
    pub fn all(&self) -> Vec<(usize, NodeId)> {
        let algebraic = self.algebraic.iter().map(|entry| (entry.parameter, entry.node));
        self.rates.iter().copied().chain(algebraic).collect()
    }

    /// Replaces all expressions, given in the order of `all`.
    pub fn set_all(&mut self, all: Vec<(usize, NodeId)>) {
        let mut all = all.into_iter().map(|(_, node)| node);
        let nodes = self.rates.iter_mut().map(|(_, node)| node);
        let algebraic = self.algebraic.iter_mut().map(|entry| &mut entry.node);
        for (place, node) in nodes.chain(algebraic).zip(&mut all) {
            *place = node;
        }
    }
}

impl RuleBuilder<'_> {
    /// Lowers the equations of a `solve`.
    pub(super) fn equations(
        &mut self,
        equations: &[ast::Equation],
        head: &HeadModule,
        variables: &Variables,
        clause: Span,
    ) -> Option<Equations> {
        let mut rates: Vec<(usize, NodeId)> = Vec::new();
        let (mut values, mut zeros): (Vec<DeclaredAlgebraic>, Vec<Zero>) = Default::default();
        let mut seen: FxHashMap<usize, Span> = FxHashMap::default();
        let mut good = true;
        for equation in equations {
            let name = match equation {
                ast::Equation::Rate { parameter, .. } | ast::Equation::Value { parameter, .. } => {
                    Some(parameter)
                }
                ast::Equation::Zero { unknown, .. } => unknown.as_ref(),
            };
            let parameter = match name.map(|name| self.parameter(name, head, variables, equation)) {
                Some(None) => {
                    good = false;
                    // Errors on the other side are reported as well.
                    self.number(equation.expression(), variables);
                    continue;
                }
                known => known.flatten(),
            };
            if let (Some(parameter), Some(name)) = (parameter, name)
                && let Some(before) = seen.insert(parameter, name.span)
            {
                self.error(
                    Diagnostic::error(format!("two equations for `{}` in one `solve`", name.text))
                        .at(name.span, "the second one")
                        .at(before, "the first one")
                        .help(match equation {
                            ast::Equation::Rate { .. } => format!(
                                "keep one of them; two contributions are added: `d{0}/dt = … + …`",
                                name.text
                            ),
                            _ => "a parameter has a rate, a value, or an equation that is solved for it: keep one".to_owned(),
                        }),
                );
                good = false;
            }
            let Some(node) = self.number(equation.expression(), variables) else {
                good = false;
                continue;
            };
            match (equation, parameter) {
                (ast::Equation::Zero { span, .. }, unknown) => {
                    zeros.push(Zero { residual: node, unknown, span: *span });
                }
                (ast::Equation::Value { parameter: name, .. }, Some(parameter)) => {
                    values.push(DeclaredAlgebraic { parameter, node, explicit: true, span: name.span });
                }
                (_, Some(parameter)) if self.scope.graph.as_constant(node) != Some(0.0) => {
                    rates.push((parameter, node));
                }
                _ => {}
            }
        }
        if !good || !self.put_in(&mut values, &mut zeros, &mut rates, head) {
            return None;
        }
        let named: Vec<usize> = seen.into_keys().collect();
        let implicit = self.match_unknowns(zeros, &named, head, clause)?;
        let context = variables.aggregates.map_or(0, |(_, count)| count as usize);
        if !self.check_rank(&implicit, head, context) {
            return None;
        }
        values.extend(implicit);
        Some(Equations { rates, algebraic: values })
    }

    fn number(&mut self, expression: Expression, variables: &Variables) -> Option<NodeId> {
        self.scope.number(&self.document.expressions, expression, variables)
    }

    fn parameter(
        &mut self,
        name: &ast::Name,
        head: &HeadModule,
        variables: &Variables,
        equation: &ast::Equation,
    ) -> Option<usize> {
        let known = head.parameters.iter().position(|p| p.text == name.text);
        if known.is_none() {
            let mut error = advice::not_a_parameter(name, head, variables);
            let of_rate = name.text.strip_prefix('d').unwrap_or_default();
            if matches!(equation, ast::Equation::Value { .. })
                && head.parameters.iter().any(|p| &*p.text == of_rate)
            {
                error = error.help(format!("a rate is written `{}/dt = …`", name.text));
            }
            self.error(error);
        }
        known
    }

    /// Substitutes explicit parameters into the equations that read them, in the order of their dependencies; false if one
    /// depends on itself.
    fn put_in(
        &mut self,
        values: &mut [DeclaredAlgebraic],
        zeros: &mut [Zero],
        rates: &mut [(usize, NodeId)],
        head: &HeadModule,
    ) -> bool {
        if values.is_empty() {
            return true;
        }
        let graph = &mut self.scope.graph;
        let reads: Vec<Vec<u32>> = values.iter().map(|v| graph.variables(&[v.node])).collect();
        let mut known: FxHashMap<u32, NodeId> = FxHashMap::default();
        let mut left: Vec<usize> = (0..values.len()).collect();
        while !left.is_empty() {
            let waits = |i: usize| {
                let open = left.iter().map(|j| values[*j].parameter as u32);
                { open }.any(|p| reads[i].contains(&p))
            };
            let Some(at) = left.iter().position(|i| !waits(*i)) else {
                let first = left.iter().copied().min_by_key(|i| values[*i].span).unwrap_or(0);
                let name = &head.parameters[values[first].parameter].text;
                let own = reads[first].contains(&(values[first].parameter as u32));
                self.scope.diagnostics.push(
                    Diagnostic::error(format!("`{name}` depends on itself"))
                        .at(values[first].span, if own { "its value reads it" } else { "by way of other values" })
                        .help(format!(
                            "a rate is written `d{name}/dt = …`; an equation to be solved for {name} is written `0 = …`"
                        )),
                );
                return false;
            };
            let i = left.remove(at);
            values[i].node = substitute(graph, values[i].node, &known);
            known.insert(values[i].parameter as u32, values[i].node);
        }
        for zero in zeros {
            zero.residual = substitute(graph, zero.residual, &known);
        }
        for (_, rate) in rates {
            *rate = substitute(graph, *rate, &known);
        }
        true
    }

    /// Matches each implicit equation to the parameter that it is solved for: first those that are named, then, by
    /// augmenting paths, one of the parameters that nothing else determines.
    fn match_unknowns(
        &mut self,
        zeros: Vec<Zero>,
        named: &[usize],
        head: &HeadModule,
        clause: Span,
    ) -> Option<Vec<DeclaredAlgebraic>> {
        if zeros.is_empty() {
            return Some(Vec::new());
        }
        if let Some(zero) = zeros.get(MAX_IMPLICIT) {
            self.error(
                Diagnostic::error(format!("more than {MAX_IMPLICIT} equations to be solved in one `solve`"))
                    .at(zero.span, "this one is too many"),
            );
            return None;
        }
        let own = head.parameters.len() as u32;
        let reads: Vec<Vec<usize>> = (zeros.iter())
            .map(|zero| self.scope.graph.variables(&[zero.residual]))
            .map(|all| all.into_iter().filter(|v| *v < own).map(|v| v as usize).collect())
            .collect();
        let unknowns = self.unknowns(&zeros, &reads, named, head)?;
        // By unknown: the equation that is solved for it.
        let mut equation_of: FxHashMap<usize, usize> =
            (zeros.iter().enumerate()).filter_map(|(i, zero)| Some((zero.unknown?, i))).collect();
        let fixed: Vec<bool> = zeros.iter().map(|zero| zero.unknown.is_some()).collect();
        for (i, zero) in zeros.iter().enumerate().filter(|(i, _)| !fixed[*i]) {
            if !augment(i, &reads, &unknowns, &fixed, &mut equation_of, &mut Vec::new()) {
                self.error(
                    Diagnostic::error("these equations cannot determine their parameters")
                        .at(zero.span, "every parameter in this one is needed for another")
                        .at(clause, "in these equations")
                        .help("some parameter must stand in more of the equations: as it is, they contradict one another, or one of them follows from the others"),
                );
                return None;
            }
        }
        let mut all: Vec<DeclaredAlgebraic> = (equation_of.into_iter())
            .map(|(parameter, i)| {
                let Zero { residual, span, .. } = zeros[i];
                DeclaredAlgebraic { parameter, node: residual, explicit: false, span }
            })
            .collect();
        all.sort_by_key(|entry| entry.parameter);
        Some(all)
    }

    /// The parameters that the implicit equations determine: those that equations name, then those that nothing else
    /// determines. An error unless there are as many as equations.
    fn unknowns(
        &mut self,
        zeros: &[Zero],
        reads: &[Vec<usize>],
        named: &[usize],
        head: &HeadModule,
    ) -> Option<Vec<usize>> {
        let mut unknowns: Vec<usize> = zeros.iter().filter_map(|zero| zero.unknown).collect();
        // If every equation names its parameter, the others in it keep their values.
        let Some(first) = zeros.iter().find(|zero| zero.unknown.is_none()) else { return Some(unknowns) };
        let mut free: Vec<usize> = reads.iter().flatten().copied().filter(|p| !named.contains(p)).collect();
        free.sort_unstable();
        free.dedup();
        if free.len() == zeros.len() - unknowns.len() {
            unknowns.extend(free);
            return Some(unknowns);
        }
        let name = |p: &usize| format!("`{}`", head.parameters[*p].text);
        let names: Vec<String> = free.iter().map(name).collect();
        let label = match free.len() {
            0 => "nothing in it is left to be determined".to_owned(),
            n => format!("{n} parameters have no equation of their own: {}", names.join(", ")),
        };
        let help = match free.first() {
            None => "a parameter that has a rate or a value has its equation already; an equation that holds between such parameters must be differentiated by hand until it contains the unknown (index 1)".to_owned(),
            Some(p) => format!("name the parameter: `0 = … for {}`", head.parameters[*p].text),
        };
        self.error(
            Diagnostic::error("it is not clear which parameters the equations are to be solved for")
                .at(first.span, label)
                .help(help),
        );
        None
    }

    /// Reports implicit equations that are singular for all values; false if they are.
    fn check_rank(&mut self, implicit: &[DeclaredAlgebraic], head: &HeadModule, variables: usize) -> bool {
        let own = head.parameters.len();
        let alone = |v: &u32| (*v as usize) < own || *v as usize + 2 >= variables;
        let graph = &self.scope.graph;
        let mut nodes = implicit.iter().map(|entry| entry.node);
        if implicit.is_empty()
            || !nodes.all(|node| graph.variables(&[node]).iter().all(alone))
            || !is_singular(&mut self.scope.graph, implicit, variables)
        {
            return true;
        }
        let names: Vec<&str> = implicit.iter().map(|e| &*head.parameters[e.parameter].text).collect();
        let mut error = Diagnostic::error(format!("the equations for {} are singular", names.join(", ")));
        for entry in implicit {
            error = error.at(entry.span, "one of them");
        }
        self.error(error.help(
            "whatever the values are, these equations leave a direction open in which the parameters can move: one of them follows from the others, or does not depend on what it is solved for",
        ));
        false
    }
}

fn substitute(graph: &mut Graph, root: NodeId, known: &FxHashMap<u32, NodeId>) -> NodeId {
    graph.rewrite(&[root], |_, _, node| match node {
        Node::Var(v) => known.get(&v).copied(),
        _ => None,
    })[0]
}

/// Finds an augmenting path: assigns to an equation one of its unknowns, and to the equation that had it before another
/// one. The recursion is at most as deep as there are equations.
fn augment(
    equation: usize,
    reads: &[Vec<usize>],
    unknowns: &[usize],
    fixed: &[bool],
    equation_of: &mut FxHashMap<usize, usize>,
    visited: &mut Vec<usize>,
) -> bool {
    for unknown in reads[equation].iter().filter(|p| unknowns.contains(p)) {
        if visited.contains(unknown) {
            continue;
        }
        visited.push(*unknown);
        let free = match equation_of.get(unknown) {
            None => true,
            Some(&other) => !fixed[other] && augment(other, reads, unknowns, fixed, equation_of, visited),
        };
        if free {
            equation_of.insert(*unknown, equation);
            return true;
        }
    }
    false
}
