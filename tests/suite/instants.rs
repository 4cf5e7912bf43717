//! Modules that see each other and whose events are one instant: all of them take place, on the values of then.

use dlsys::sim::{Method, Settings};
use dlsys::tree::ModuleString;

use crate::common::{plain, run, session};

/// An event of a neighbour would keep Q from the level that it is about to reach. Within the error of integration both happen together, as what is one instant
/// has to; where they are not surely one, a warning says so.
#[test]
fn what_is_taken_for_one_instant_is_said() {
    // The integral of x/(1 + sin(x)/10) from 0 to 1.
    let reached = 0.471_749_986_593_199_06;
    let outcome = |level: f64, tolerance: f64| {
        let text = format!(
            "initial string: P(0) Q(0)\nP(x): solve dx/dt = 1 + 0.1*sin(x)\n if x = 1 produce R\nP(x) < Q(y): solve dy/dt = x\n if y = {level} produce S\nR < Q(y): solve dy/dt = -1\n if y = {level} produce S"
        );
        let session = session(&text);
        let settings = Settings { tolerance, ..Settings::default() };
        let mut simulation = session.simulate(settings).expect("a model");
        let mut string = ModuleString::default();
        simulation.at(1.2, &mut string).expect("a string");
        let joined = plain(&session.model, &string).iter().any(|module| module.0 == "S");
        let warns = simulation.remarks().iter().any(|warning| warning.message.contains("which is first"));
        (joined, warns)
    };
    for tolerance in [1e-3, 1e-5, 1e-7] {
        let (joined, warns) = outcome(reached, tolerance);
        // Where steps are so long that their estimate is all that there is, a warning is in place.
        assert!(joined && (!warns || tolerance == 1e-3), "{tolerance:e}: one instant");
        assert_eq!(outcome(reached + tolerance, tolerance), (false, false), "{tolerance:e}: never");
        let steps = (0..60).map(|step| reached + tolerance * 0.7f64.powi(step));
        let farthest = steps.map(|level| outcome(level, tolerance)).find(|(joined, _)| *joined);
        assert_eq!(farthest, Some((true, true)), "{tolerance:e}");
    }
}

/// A row of cells: one at its beginning divides at a threshold, those inside it are replaced at a level of their own or of the cell before, the last
/// one only grows.
struct Row {
    axiom: &'static str,
    condition: &'static str,
    successor: &'static str,
    rate: &'static str,
    first: &'static str,
    /// A time, and how many cells there are then.
    cells: &'static [(f64, usize)],
}

impl Row {
    fn text(&self) -> String {
        let Row { axiom, condition, successor, rate, first, .. } = self;
        format!(
            "initial string: {axiom}\nC(a) < C(x) > C(b): if {condition} produce {successor} solve dx/dt = {rate}\nC(a) < C(x): solve dx/dt = 0.1*x\nC(x) > C(b): {first}"
        )
    }
}

/// The cell before reaches the level at one instant for itself and for the cell that looks at it, however the instants of both are found, and whatever
/// keeps one of them from its own time: the numbers of cells are those of an independent solver (Runge-Kutta steps of 0.003, bisection).
#[test]
fn a_cell_is_replaced_with_the_one_before() {
    let rows = [
        // Its successor leads to equations that end at an edge.
        Row {
            axiom: "C(0.311) C(0.321) C(0.195)",
            condition: "x >= 0.912 | a >= 0.912",
            successor: "C(0.4*x) [ C(0.3*x) ]",
            rate: "0.454*x*(1 - (x/3.847)^1.5) + a - x + 0.2",
            first: "if x = 0.577 produce C(x/2) C(x/2) solve dx/dt = 0.712*(2.995 - x)",
            cells: &[(1.69, 14), (1.71, 16)],
        },
        // They are integrated in steps that are not the same.
        Row {
            axiom: "C(0.222) C(0.285) C(0.266)",
            condition: "x >= 0.851 | a >= 0.851",
            successor: "C(0.4*x) C(0.5*x)",
            rate: "0.581*x*(1 - x/4) + 0.63*(a - x) + 0.156",
            first: "if x >= 0.677 produce C(x/2) C(x/2) solve dx/dt = 0.717*(3 - x)",
            cells: &[(2.247, 25)],
        },
        // No level of one variable.
        Row {
            axiom: "C(0.336) C(0.424) C(0.245) C(0.289)",
            condition: "max(x, a) >= 0.907",
            successor: "C(0.4*x) C(0.5*x)",
            rate: "0.66*(a - x) + 0.202*sqrt(x) + 0.202",
            first: "if x >= 0.686 produce C(x/2) C(x/2) solve dx/dt = 0.578*(3 - x)",
            cells: &[(1.637, 13)],
        },
        Row {
            axiom: "C(0.211) C(0.333) C(0.263) C(0.328) C(0.249)",
            condition: "max(x, a) >= 1.006",
            successor: "C(0.4*x) C(0.5*x)",
            rate: "1.104*(a - x) + 0.161*sqrt(x) + 0.161",
            first: "if x = 0.703 produce C(x/2) C(x/2) solve dx/dt = 0.488*(3 - x)",
            cells: &[(2.637, 16)],
        },
        // A jump that is known to a rounding only.
        Row {
            axiom: "C(0.325) C(0.43) C(0.291) C(0.212) C(0.371)",
            condition: "floor(x/0.951) >= 1 | floor(a/0.951) >= 1",
            successor: "C(0.4*x) [ L(0.3*x) ]",
            rate: "1.013*max(0, 1 - b) + 0.257",
            first: "if x >= 0.684 produce C(x/2) C(x/2) solve dx/dt = 0.782*(3 - x)",
            cells: &[(2.137, 17)],
        },
        // Jumps of several values, of which one is that of the cell beside.
        Row {
            axiom: "C(0.342) C(0.286) C(0.276) C(0.234)",
            condition: "x >= 0.965 | floor(a/0.965) + floor(b/0.965) >= 1",
            successor: "C(0.4*x) C(0.5*x)",
            rate: "1.052*max(0, 1 - b) + 0.259",
            first: "if x = 0.546 produce C(x/2) C(x/2) solve dx/dt = 0.58*(3 - x)",
            cells: &[(0.737, 10)],
        },
        Row {
            axiom: "C(0.236) C(0.208) C(0.339)",
            condition: "x >= 0.891 | sign(a - 0.891) + sign(x - 0.891) > -1.5",
            successor: "C(0.4*x) [ L(0.3*x) ]",
            rate: "0.769*(a - x) + 0.45",
            first: "if x >= 0.51 produce C(x/2) C(x/2) solve dx/dt = 0.691*(3 - x)",
            cells: &[(1.737, 15)],
        },
        Row {
            axiom: "C(0.249) C(0.261) C(0.385) C(0.21)",
            condition: "x >= 0.9 | 2*floor(a/0.9) + 1 > 2",
            successor: "C(0.4*x) C(0.5*x)",
            rate: "1.009*(a - x) + 1.009*(b - x) + 0.468",
            first: "if x = 0.694 produce C(x/2) C(x/2) solve dx/dt = 0.798*(3 - x)",
            cells: &[(2.137, 21)],
        },
        Row {
            axiom: "C(0.233) C(0.373) C(0.445) C(0.211) C(0.33)",
            condition: "x >= 0.874 | sign(a - 0.874) + sign(x - 0.874) > -1.5",
            successor: "C(0.4*x) [ L(0.3*x) ]",
            rate: "0.852*(a - x) + 0.852*(b - x) + 0.36",
            first: "if x >= 0.72 produce C(x/2) C(x/2) solve dx/dt = 0.741*(3 - x)",
            cells: &[(2.637, 18)],
        },
    ];
    for row in &rows {
        let times: Vec<f64> = row.cells.iter().map(|(t, _)| *t).collect();
        for method in [Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau] {
            for tolerance in [1e-4, 1e-5, 1e-6, 1e-10] {
                let settings = Settings { method, tolerance, ..Settings::default() };
                let found = run(&row.text(), settings, &times).expect("a string");
                for (string, (t, cells)) in found.iter().zip(row.cells) {
                    let count = string.iter().filter(|module| module.0 == "C").count();
                    assert_eq!(count, *cells, "{method:?} {tolerance:e}, t = {t}\n{}", row.text());
                }
            }
        }
    }
}
