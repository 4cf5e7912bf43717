//! Small models of which every class is known.

use super::plan::Explanation;
use super::words;
use crate::session::Session;

/// Parameters of the first clause of a rule, as class, law and reason.
fn parameters(plan: &Explanation, rule: usize) -> Vec<[&str; 3]> {
    let all = &plan.rules[rule].solves[0].parameters;
    all.iter().map(|p| [p.class, p.law.as_deref().unwrap_or(""), &p.why]).collect()
}

fn plan(text: &str) -> Explanation {
    Explanation::new(&Session::from_text("test.dls", text, &[]).expect("a good model"))
}

#[test]
fn every_obstacle_is_named() {
    let plan = plan(
        "initial string: A(1, 1, 1, 1, 1) B(1) C(1) B(1)
             A(u, v, w, x, y):
               solve du/dt = sin(u), dv/dt = v^3 + 1, dw/dt = u*w, dx/dt = u - x, dy/dt = y*age
             B(b) < C(c): solve dc/dt = b*c
             B(b): solve db/dt = b*sin(b)",
    );
    let reasons: Vec<&str> = parameters(&plan, 0).iter().map(|p| p[2]).collect();
    assert_eq!(
        reasons,
        [
            "its rate is no polynomial in u",
            "its rate has degree 3 in v; formulas go up to 2",
            "its rate multiplies w by what changes: u",
            "reads u, which is integrated",
            "its rate multiplies y by what changes: age",
        ]
    );
    assert!(parameters(&plan, 0).iter().all(|p| p[0] == "local"));
    assert_eq!(parameters(&plan, 1), [["coupled", "", "reads b of a neighbour, not linearly"]]);
    // Its neighbour reads it: they share a clock.
    assert_eq!(parameters(&plan, 2)[0][0], "coupled");
    assert_eq!(plan.summary.alone, ["A"]);
    assert_eq!(plan.summary.coupled, ["B", "C"]);
}

#[test]
fn every_formula_has_its_name() {
    let plan = plan(
        "const m = 3
             initial string: A(1, 1, 1, 1, 1, 1, 1)
             A(p, q, r, s, u, v, w):
               solve dp/dt = 2*p, dq/dt = -q, dr/dt = (m - r)/2, ds/dt = 0.5*s*(1 - s/m), du/dt = 1 + u^2,
                 dv/dt = age, dw/dt = q - w",
    );
    let laws: Vec<&str> = parameters(&plan, 0).iter().map(|p| p[1]).collect();
    assert_eq!(
        laws,
        [
            "exponential growth",
            "exponential decay",
            "exponential approach to 3",
            "logistic, limit 3",
            "quadratic (tanh, tan or a hyperbola, by its numbers)",
            "polynomial of degree 2 in age",
            words::SUM,
        ]
    );
    assert!(plan.summary.closed_form);
}

#[test]
fn every_way_to_an_instant_is_named() {
    let plan = plan(
        "initial string: A(0, 1, 1)
             A(x, y, z):
               if x < 2 & y*x < 5 & z < 3 & age < 9 & solved(y) < 2
                 solve dx/dt = 1, dy/dt = y*(1 - y/2), dz/dt = sin(z)
               if x = 2 | y*x = 5 | z = 3 | age = 9 produce A(0, 1, 1)
             def solved(y) = y",
    );
    let rule = &plan.rules[0];
    let found: Vec<(&str, &str)> =
        rule.conditions.iter().map(|c| (c.boundary.as_str(), c.found[0].class)).collect();
    assert_eq!(
        found,
        [
            ("x = 2", "closed-form time"),
            ("y*x = 5", "root on a closed form"),
            ("z = 3", "root on dense output"),
            ("age = 9", "closed-form time"),
            ("solved(y) = 2", "never met"),
        ]
    );
    assert_eq!(rule.solves[0].clause.condition, "x < 2 & y*x < 5 & z < 3 & age < 9 & solved(y) < 2");
    assert_eq!(rule.conditions[0].decides.iter().map(|u| u.line).collect::<Vec<_>>(), [3, 5]);
}
