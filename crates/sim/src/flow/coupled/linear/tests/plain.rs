//! Equations that are written without a table are those of the table, bit by bit.

use super::super::Linear;
use crate::flow::coupled::system::{Membership, System};
use crate::{Settings, Simulation};
use dlsys_session::Session;
use dlsys_tree::SimTime;

/// The solutions at t = 0 without a table, and with one, of the coupled modules of a model.
fn both(text: &str) -> [Option<Linear>; 2] {
    let session = Session::from_text("tissue.dls", text, &[]).expect("a model");
    let (model, tolerance) = (&session.model, 1e-6);
    let simulation = Simulation::new(model, Settings::default()).expect("it starts");
    let coupled = &simulation.flows.coupled;
    let (members, start) = (&coupled.members[..], SimTime::ZERO);
    assert!(!members.is_empty(), "nothing is coupled in {text}");
    let modules = Membership { world: &simulation.world, members, start, frozen: false };
    let mut system = System::default();
    system.rebuild(&model.rules, &modules, Some);
    [
        Linear::of_plain(&model.rules, &modules, &coupled.y, tolerance),
        Linear::new(&system, &model.rules, &coupled.y, tolerance),
    ]
}

#[test]
fn equations_without_a_table_are_those_of_the_table() {
    let texts = [
        // Cells between walls that rest.
        "initial string: C_w(3) C_c(1) C_c(2) C_c(0.5) C_w(1)\n\
         C(l) < C_c(c) > C(r): solve dc/dt = 0.3*(l + r - 2c) - 0.1*c + 0.7\n",
        // Branches, two parameters with rates and one without, the second first.
        "initial string: A(1, 2, 3) [ B(0.1, 0.2, 0.3) ] A(4, 5, 6) [ B(7, 8, 9) ] A(1, 1, 1)\n\
         A(k, x, y) < A(g, u, v): solve dv/dt = x - v, du/dt = 2*y - 3*u + 0.25\n\
         A(k, x, y) < B(g, u, v): solve du/dt = (x - u)/7 + (y + v)/5, dv/dt = x/9 - v\n\
         A(g, u, v) > A(k, x, y): solve du/dt = x - u\n",
    ];
    for text in texts {
        let [Some(plain), Some(table)] = &both(text) else { panic!("no solution without steps of {text}") };
        let bits = |all: &[f64]| all.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let entries = |linear: &Linear| {
            linear.problem.entries.iter().map(|(n, m, x)| (*n, *m, x.to_bits())).collect::<Vec<_>>()
        };
        assert!(entries(plain).len() > 4, "{text}");
        assert_eq!(entries(plain), entries(table), "{text}");
        assert_eq!(bits(&plain.problem.b), bits(&table.problem.b), "{text}");
        assert_eq!(bits(&plain.problem.y), bits(&table.problem.y), "{text}");
        assert_eq!(plain.unknown, table.unknown, "{text}");
    }
}

/// Formulas that flow in are unknowns of their own, and coefficients may depend on what no rule moves: both need the table.
#[test]
fn equations_that_read_more_are_left_to_the_table() {
    let texts = [
        "initial string: S(1) C(1) C(2)\nS(s): solve ds/dt = -0.5*s\n\
         S(l) < C(c) > C(r): solve dc/dt = l + r - 2c\nC(l) < C(c): solve dc/dt = l - c\n",
        "initial string: W(3) C(1) C(2)\nW(l) < C(c) > C(r): solve dc/dt = l*(r - c)\nC(l) < C(c): solve dc/dt = l - c\n",
    ];
    for text in texts {
        let [plain, table] = both(text);
        assert!(plain.is_none() && table.is_some(), "{text}");
    }
}
