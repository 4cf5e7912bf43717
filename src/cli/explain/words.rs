//! Descriptions of solutions and of the reasons for them.

use super::plan::Facts;
use crate::expr::Program;
use crate::model::{DrivenGrowth, GrowthLaw, Numeric, Obstacle, Rule, SolutionForm, Solve};
use crate::sim::brief;

/// The form of a solution that a run may replace by integration.
pub const SUM: &str = "sum of exponentials and polynomials";

/// `x`, `x and y`, `x, y and z`.
pub fn list(names: &[String]) -> String {
    match names {
        [] => "nothing".to_owned(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// The name of a variable of a rule; None for truth values.
pub fn variable(rule: &Rule, variable: usize) -> Option<String> {
    let own = rule.parameters.len();
    match variable {
        v if v < own => Some(rule.parameters[v].clone()),
        v if v >= rule.first_aggregate && v < rule.time_variable() => {
            rule.aggregates.get(v - rule.first_aggregate).map(|aggregate| aggregate.label.clone())
        }
        v if v < rule.time_variable() => rule.context_names.get(v - own).cloned(),
        v if v == rule.time_variable() => Some("t".to_owned()),
        v if v == rule.time_variable() + 1 => Some("age".to_owned()),
        _ => None,
    }
}

/// How the equation at a position of a clause is solved: the form of its solution, if there is a formula, and why.
pub fn law(
    facts: &Facts,
    rule: &Rule,
    solve: &Solve,
    position: usize,
    coupled: bool,
) -> (Option<String>, String) {
    let x = &rule.parameters[solve.of[position]];
    let piecewise = if solve.rates.output_reads(position).iter().any(|v| *v >= rule.variables) {
        ", between changes of the `if` in it"
    } else {
        ""
    };
    match &solve.solution_forms[position] {
        SolutionForm::Polynomial(coefficients) if coefficients.outputs() == 1 => {
            let why = match coefficients.constant_output(0) {
                Some(rate) => format!("its rate is the number {}", brief(rate, 6)),
                None => format!("nothing that its rate reads changes{piecewise}"),
            };
            (Some("constant rate".to_owned()), why)
        }
        SolutionForm::Polynomial(coefficients) => {
            let degree = coefficients.outputs() - 1;
            let why = format!("its rate is a polynomial of degree {degree} in age{piecewise}");
            (Some(format!("polynomial of degree {} in age", degree + 1)), why)
        }
        SolutionForm::Quadratic(coefficients) => {
            let (name, degree) = quadratic(coefficients);
            let why = format!("its rate is {degree} in {x} with constant coefficients{piecewise}");
            (Some(name), why)
        }
        SolutionForm::Sum { inflow, .. } => {
            let driven: Vec<String> =
                inflow.reads().iter().copied().filter_map(|v| variable(rule, v)).collect();
            let own = |name: &&String| rule.parameters.contains(name) || *name == "t" || *name == "age";
            let driven: Vec<String> = driven.iter().filter(own).cloned().collect();
            let why =
                format!("its rate is linear in {x}, driven by {} by a formula{piecewise}", list(&driven));
            (Some(SUM.to_owned()), why)
        }
        SolutionForm::Driven(law) => driven(rule, x, law, piecewise),
        SolutionForm::Numeric(numeric) => (None, obstacle(facts, rule, solve, position, *numeric, coupled)),
    }
}

/// The name of the solution of `x' = c + b x + a x²`, and a description of its rate.
fn quadratic(coefficients: &Program) -> (String, &'static str) {
    let [c, b, a] = [0, 1, 2].map(|i| coefficients.constant_output(i));
    let zero = |x: Option<f64>| x == Some(0.0);
    if zero(a) {
        let name = match (c, b) {
            (c, Some(b)) if zero(c) && b > 0.0 => "exponential growth".to_owned(),
            (c, Some(_)) if zero(c) => "exponential decay".to_owned(),
            (Some(c), Some(b)) if b < 0.0 => format!("exponential approach to {}", brief(-c / b, 6)),
            (_, Some(b)) if b < 0.0 => "exponential approach to a limit".to_owned(),
            (Some(c), Some(b)) => format!("exponential, away from {}", brief(-c / b, 6)),
            _ => "exponential".to_owned(),
        };
        return (name, "linear");
    }
    let name = match (c, b, a) {
        (c, Some(b), Some(a)) if zero(c) && b > 0.0 && a < 0.0 => {
            format!("logistic, limit {}", brief(-b / a, 6))
        }
        (c, ..) if zero(c) => "logistic".to_owned(),
        _ => "quadratic (tanh, tan or a hyperbola, by its numbers)".to_owned(),
    };
    (name, "a quadratic")
}

/// The form of the solution of `x' = h(time) q(x)`, and the reason.
fn driven(rule: &Rule, x: &str, law: &DrivenGrowth, piecewise: &str) -> (Option<String>, String) {
    let curves: Vec<String> = law.curves.iter().map(|curve| curve.name.clone()).collect();
    let pace = match (curves.len(), &law.pace) {
        (0, None) => String::new(),
        (0, Some(pace)) => {
            let time = |v: &usize| *v >= rule.time_variable() && *v < rule.variables;
            let times: Vec<String> =
                pace.reads().iter().copied().filter(time).filter_map(|v| variable(rule, v)).collect();
            format!("a function of {}", list(&times))
        }
        (1, _) => format!("the curve {}", curves[0]),
        _ => format!("the curves {}", list(&curves)),
    };
    let name = match law.growth {
        GrowthLaw::Quadratic if [1, 2].iter().all(|i| law.coefficients.constant_output(*i) == Some(0.0)) => {
            let why = format!("its rate is made of {pace}, whose integral is known{piecewise}");
            return (Some(format!("integral of {pace}")), why);
        }
        GrowthLaw::Quadratic => quadratic(&law.coefficients).0,
        GrowthLaw::Gompertz => "Gompertz growth".to_owned(),
        GrowthLaw::Bernoulli => "Bernoulli's equation (Richards, von Bertalanffy)".to_owned(),
    };
    if pace.is_empty() {
        return (
            Some(name),
            format!("its rate is a growth law of {x} with constant coefficients{piecewise}"),
        );
    }
    let why = format!("its rate is one of {x} alone times {pace}, whose integral is known{piecewise}");
    (Some(format!("{name}, at the pace of {pace}")), why)
}

/// Why a parameter is integrated numerically.
fn obstacle(
    facts: &Facts,
    rule: &Rule,
    solve: &Solve,
    position: usize,
    numeric: Numeric,
    coupled: bool,
) -> String {
    let own = rule.parameters.len();
    let parameter = solve.of[position];
    let x = &rule.parameters[parameter];
    let reads = solve.rates.output_reads(position);
    let named = |keep: &dyn Fn(usize) -> bool| -> Vec<String> {
        reads.iter().filter(|v| keep(**v)).filter_map(|v| variable(rule, *v)).collect()
    };
    let others = named(&|v| v != parameter && solve.of.contains(&v));
    let unsolved = named(&|v| v != parameter && v < own && facts.is_integrated(rule, Some(solve), v));
    let mut why = match numeric.obstacle {
        Obstacle::Neighbours => {
            let read = named(&|v| rule.moving_context.contains(&v));
            let how = if numeric.linear { ", linearly" } else { ", not linearly" };
            let whose = if read.len() == 1 { "a neighbour" } else { "its neighbours" };
            format!("reads {} of {whose}{how}", list(&read))
        }
        Obstacle::NotPolynomial => format!("its rate is no polynomial in {x}"),
        Obstacle::Degree(n) => format!("its rate has degree {n} in {x}; formulas go up to 2"),
        Obstacle::Factor => {
            let movers = named(&|v| v != parameter && (solve.of.contains(&v) || v >= rule.time_variable()));
            format!("its rate multiplies {x} by what changes: {}", list(&movers))
        }
        Obstacle::Inflow if !unsolved.is_empty() => {
            let verb = if unsolved.len() == 1 { "is" } else { "are" };
            format!("reads {}, which {verb} integrated", list(&unsolved))
        }
        Obstacle::Inflow if !others.is_empty() => {
            format!("reads {} in a way for which there is no formula", list(&others))
        }
        Obstacle::Inflow => "its rate depends on time in a way for which there is no formula".to_owned(),
    };
    if coupled && numeric.obstacle != Obstacle::Neighbours {
        why += "; shares a clock with its neighbours, which read one another";
    }
    why
}

/// Why the instant of a crossing is a formula.
pub fn crossing(rule: &Rule, v: usize, level: &Program) -> String {
    let name = variable(rule, v).unwrap_or_default();
    match level.constant_output(0).map(|level| brief(level, 6)) {
        Some(level) if v >= rule.time_variable() => format!("{name} reaches {level} at a known time"),
        None if v >= rule.time_variable() => format!("{name} reaches what stands still at a known time"),
        Some(level) => format!("{name} moves one way only; a formula tells when it is {level}"),
        None => format!("{name} alone moves, and one way only; a formula tells when they meet"),
    }
}
