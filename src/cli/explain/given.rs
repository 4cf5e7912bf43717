//! `explain`: parameters with a value or an equation instead of a rate.

use super::plan::{Facts, ParameterPlan};
use super::words::{list, variable};
use crate::model::{Rule, Solve};

/// The class of a parameter and its reason, by its index among the algebraic parameters of its clause.
pub fn parameter(facts: &Facts, rule: &Rule, solve: &Solve, place: usize) -> ParameterPlan {
    let algebraic = &solve.algebraic;
    let parameter = algebraic.of[place];
    let mut read = algebraic.values.output_reads(place);
    read.retain(|v| *v != parameter);
    let named = |keep: &dyn Fn(usize) -> bool| -> Vec<String> {
        read.iter().filter(|v| keep(**v)).filter_map(|v| variable(rule, *v)).collect()
    };
    let around = named(&|v| rule.moving_context.contains(&v));
    let (class, why) = match (algebraic.explicit[place], algebraic.closed[place], algebraic.needed[place]) {
        (true, true, _) => {
            ("explicit formula", "a function of what follows formulas; never integrated".to_owned())
        }
        (true, false, false) => {
            ("explicit", "only drawing and successors read it: evaluated when somebody looks".to_owned())
        }
        (true, false, true) => {
            let why = match named(&|v| facts.is_integrated(rule, Some(solve), v)) {
                moving if moving.is_empty() => "evaluated along with the rates".to_owned(),
                moving => format!("evaluated along with the rates, from {}", list(&moving)),
            };
            ("explicit", why)
        }
        (false, ..) => {
            let line = facts.line(algebraic.spans[place].start);
            let others =
                (0..algebraic.of.len()).filter(|other| *other != place && !algebraic.explicit[*other]);
            let others: Vec<String> =
                others.map(|other| rule.parameters[algebraic.of[other]].clone()).collect();
            let mut why = format!("solved for in the equation of line {line}");
            if !others.is_empty() {
                why += &format!(", together with {}", list(&others));
            }
            if !around.is_empty() {
                let whose = if around.len() == 1 { "a neighbour" } else { "its neighbours" };
                why += &format!("; reads {} of {whose}", list(&around));
            }
            ("implicit", why)
        }
    };
    let reads = named(&|_| true);
    ParameterPlan { name: rule.parameters[parameter].clone(), class, law: None, why, reads }
}
