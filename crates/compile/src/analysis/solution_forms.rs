//! Classification of the equations of a clause: by formula or by numerical integration.

use rustc_hash::FxHashSet;

use dlsys_expr::{Binary, Graph, Monomial, Node, NodeId, Polynomial, Program, Unary};
use dlsys_model::{Jacobian, LinearRates, Numeric, Obstacle, SolutionForm};

use super::driven::driven_form;
use super::variability::Constants;

/// Maximum degree in `age` of a rate that is integrated as a polynomial.
const MAX_AGE_DEGREE: u32 = 3;

/// Classifies the equations of a clause, in the order of their dependencies.
pub fn classify(
    graph: &mut Graph,
    rates: &[(usize, NodeId)],
    constants: &Constants,
    total: usize,
) -> Vec<SolutionForm> {
    let mut found: Vec<Option<SolutionForm>> = vec![None; rates.len()];
    // Parameters known to be sums of exponentials and polynomials.
    let mut sums: FxHashSet<u32> = FxHashSet::default();
    loop {
        let mut progress = false;
        for (i, &(parameter, rate)) in rates.iter().enumerate() {
            if found[i].is_some() {
                continue;
            }
            let form = closed(graph, parameter as u32, rate, constants, &sums, total)
                .or_else(|| Some((driven(graph, parameter as u32, rate, constants, total)?, false)));
            if let Some((form, is_sum)) = form {
                found[i] = Some(form);
                if is_sum {
                    sums.insert(parameter as u32);
                }
                progress = true;
            }
        }
        if !progress {
            break;
        }
    }
    let numeric = |graph: &mut Graph, parameter: usize, rate: NodeId| Numeric {
        coupled: constants.reads_context(graph, &[rate]),
        linear: affine(graph, rate, constants).is_some(),
        obstacle: obstacle(graph, parameter as u32, rate, constants),
    };
    found
        .into_iter()
        .zip(rates)
        .map(|(form, &(parameter, rate))| {
            form.unwrap_or_else(|| SolutionForm::Numeric(numeric(graph, parameter, rate)))
        })
        .collect()
}

/// The reason why [`closed`] finds no formula.
fn obstacle(graph: &mut Graph, parameter: u32, rate: NodeId, constants: &Constants) -> Obstacle {
    if constants.reads_context(graph, &[rate]) {
        return Obstacle::Neighbours;
    }
    let Some(by_self) = graph.polynomial(rate, |v| v == parameter) else { return Obstacle::NotPolynomial };
    if by_self.degree() > 2 {
        return Obstacle::Degree(by_self.degree());
    }
    let factors: Vec<NodeId> = (1..3).filter_map(|power| by_self.coefficient(parameter, power)).collect();
    // A constant coefficient of the square has no formula together with an inflow that changes.
    if constants.all_constant(graph, &factors) { Obstacle::Inflow } else { Obstacle::Factor }
}

/// The solution form of a parameter, if it has a formula, and whether that is a sum of exponentials and polynomials.
fn closed(
    graph: &mut Graph,
    parameter: u32,
    rate: NodeId,
    constants: &Constants,
    sums: &FxHashSet<u32>,
    total: usize,
) -> Option<(SolutionForm, bool)> {
    let zero = graph.constant(0.0);
    let by_self = graph.polynomial(rate, |v| v == parameter)?;
    if by_self.degree() > 2 {
        return None;
    }
    let coefficients: Vec<NodeId> =
        (0..3).map(|power| by_self.coefficient(parameter, power).unwrap_or(zero)).collect();
    let [inflow, factor, square] = coefficients[..] else { unreachable!("three of them") };
    if constants.all_constant(graph, &coefficients) {
        if by_self.degree() == 0 {
            return Some((SolutionForm::Polynomial(Program::compile(graph, &[inflow], total)), true));
        }
        let is_sum = by_self.degree() == 1;
        return Some((SolutionForm::Quadratic(Program::compile(graph, &coefficients, total)), is_sum));
    }
    if square != zero || !constants.all_constant(graph, &[factor]) {
        return None;
    }
    let age = constants.time as u32 + 1;
    if factor == zero
        && let Some(by_age) = graph.polynomial(inflow, |v| v == age)
        && by_age.degree() <= MAX_AGE_DEGREE
    {
        let powers: Vec<NodeId> =
            (0..=by_age.degree()).map(|power| by_age.coefficient(age, power).unwrap_or(zero)).collect();
        if constants.all_constant(graph, &powers) {
            return Some((SolutionForm::Polynomial(Program::compile(graph, &powers, total)), true));
        }
    }
    is_sum(graph, inflow, constants, sums).then(|| {
        let factor = Program::compile(graph, &[factor], total);
        (SolutionForm::Sum { factor, inflow: Program::compile(graph, &[inflow], total) }, true)
    })
}

/// The solution form of a parameter that follows curves, growth functions of time, or a growth law.
fn driven(
    graph: &mut Graph,
    parameter: u32,
    rate: NodeId,
    constants: &Constants,
    total: usize,
) -> Option<SolutionForm> {
    let is_constant = |v: u32| constants.is_constant(v);
    let form = driven_form(graph, parameter, rate, &is_constant, constants.time as u32)?;
    Some(SolutionForm::Driven(Box::new(form.compile(graph, total))))
}

/// True if an expression consists of sums and products of constants, time, exponentials, sines and cosines of time, and
/// parameters whose solutions are such sums.
fn is_sum(graph: &mut Graph, root: NodeId, constants: &Constants, sums: &FxHashSet<u32>) -> bool {
    let is_time = |v: u32| v as usize == constants.time || v as usize == constants.time + 1;
    for id in graph.reachable(&[root]) {
        if constants.all_constant(graph, &[id]) {
            continue;
        }
        let good = match graph.node(id) {
            Node::Const(_) => true,
            Node::Var(v) => is_time(v) || sums.contains(&v),
            Node::Unary(Unary::Neg, _) | Node::Binary(Binary::Add | Binary::Sub | Binary::Mul, ..) => true,
            Node::Unary(Unary::Exp | Unary::Sin | Unary::Cos, a) => {
                let by_time = graph.polynomial(a, is_time);
                by_time.is_some_and(|p| {
                    let coefficients: Vec<NodeId> = p.terms.values().copied().collect();
                    p.degree() <= 1 && constants.all_constant(graph, &coefficients)
                })
            }
            Node::Binary(Binary::Div, _, b) => constants.all_constant(graph, &[b]),
            Node::Binary(Binary::Pow, _, b) => {
                graph.as_constant(b).is_some_and(|n| (0.0..=4.0).contains(&n) && n == n.trunc())
            }
            Node::Select(c, ..) => constants.all_constant(graph, &[c]),
            _ => false,
        };
        if !good {
            return false;
        }
    }
    true
}

/// A rate as `constant + Σ coefficient · variable`, if it has this form with constant coefficients.
fn affine(graph: &mut Graph, rate: NodeId, constants: &Constants) -> Option<Polynomial> {
    let polynomial = graph.polynomial(rate, |v| !constants.is_constant(v))?;
    let time = |m: &Monomial| m.iter().any(|(v, _)| *v as usize >= constants.time);
    (polynomial.degree() <= 1 && !polynomial.terms.keys().any(time)).then_some(polynomial)
}

/// The rates as linear equations, if all are linear with constant coefficients.
pub fn linear(
    graph: &mut Graph,
    rates: &[NodeId],
    constants: &Constants,
    total: usize,
) -> Option<LinearRates> {
    let zero = graph.constant(0.0);
    let (mut variables, mut roots) = (Vec::new(), Vec::new());
    for &rate in rates {
        let polynomial = affine(graph, rate, constants)?;
        roots.push(polynomial.terms.get(&Monomial::new()).copied().unwrap_or(zero));
        let mut row = Vec::new();
        for (monomial, &coefficient) in &polynomial.terms {
            if let [(variable, 1)] = monomial[..] {
                row.push(variable as usize);
                roots.push(coefficient);
            }
        }
        variables.push(row);
    }
    Some(LinearRates { variables, coefficients: Program::compile(graph, &roots, total) })
}

/// Partial derivatives of expressions, one row each, with respect to the variables that change.
pub fn jacobian(
    graph: &mut Graph,
    rates: &[(usize, NodeId)],
    constants: &Constants,
    total: usize,
) -> Jacobian {
    let (mut entries, mut roots) = (Vec::new(), Vec::new());
    for (row, &(_, rate)) in rates.iter().enumerate() {
        for variable in graph.variables(&[rate]) {
            if (variable as usize) < constants.time && !constants.is_constant(variable) {
                entries.push((row, variable as usize));
                roots.push(graph.derivative(rate, variable));
            }
        }
    }
    Jacobian { entries, values: Program::compile(graph, &roots, total) }
}
