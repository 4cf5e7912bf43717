//! Common steps that several threads make: the bits, and the work, of one.

use dlsys_session::Session;
use dlsys_sim::{Error, Method, Scheduler, Settings};
use dlsys_tree::ModuleString;
use std::fmt::Write;

/// Cells that only read one another, without events.
const RING: &str = "initial string: W(2) for i in 1 .. 300: ( C(uniform(0, 2)) ) W(1)\n\
    W(l) < C(c) > C(r): solve dc/dt = 0.2*(l^2 + r^2 - 2*c^2) - 0.1*c\n\
    C(l) < C(c) > W(r): solve dc/dt = 0.2*(l^2 + r^2 - 2*c^2) - 0.1*c\n\
    C(l) < C(c) > C(r): solve dc/dt = 0.2*(l^2 + r^2 - 2*c^2) - 0.1*c\n";

/// Cells with two components, of which some have other equations, beside others that follow formulas; they divide, and turn into others.
const TISSUE: &str = "initial string: F_h(1, 3) for i in 1 .. 150: \
      ( if i - 11*floor(i/11) = 5: ( F_h(1, 2) ) else ( F_v(uniform(0.4, 1), uniform(0.6, 3)) ) ) F_h(1, 3)\n\
    F(y, l) < F_v(x, c) > F(z, r):\n  \
    if x < 1 & c > 0.4 solve dx/dt = 0.2*x + 0.01*c, dc/dt = 0.3*(l + r - 2c) - 0.5*c\n  \
    if x = 1 & c > 0.4 produce F_v(0.4*x, c) F_v(0.6*x, c)\n  \
    if c = 0.4 produce F_h(x, c)\n\
    F_h(x, c): solve dx/dt = 0.1*(1 - x), dc/dt = 0.4*(3 - c)\n";

/// A trunk whose cells have branches: those far away in the string are neighbours.
const TREE: &str = "initial string: B(3, 0) for i in 1 .. 12: \
      ( S(uniform(0.5, 2), 0) [ for j in 1 .. 9: ( S(uniform(0.1, 1), j) ) ] )\n\
    B(c, n): solve dc/dt = cos(t)\n\
    B(p, m) < S(c, n): solve dc/dt = 0.5*(p - c) - 0.1*c^2\n\
    S(p, m) < S(c, n):\n  if c < 2 solve dc/dt = 0.5*(p - c) - 0.1*c*p + 0.2*sin(age)\n  if c >= 2 produce S(1, n)\n";

/// The same with an aggregate, which columns are not enough for.
const FLOWS: &str = "initial string: B(1) for i in 1 .. 40: ( S(uniform(0.5, 2)) [ L(uniform(0, 1)) ] )\n\
    S(c): solve dc/dt = sum(L(w): w) + sum(S(d): d) - c\n\
    S(p) < L(w): solve dw/dt = p - w^2\nB(c): solve dc/dt = sum(S(d): d) - c\n";

/// Cells that exchange so fast that steps become implicit, in the midst of a run.
const STIFF: &str = "initial string: W(3, 1) for i in 1 .. 60: ( C(uniform(1, 2), 0) ) W(1, 1)\n\
    W(l, u) < C(c, s) > C(r, v): solve dc/dt = 10^(5*s)*(l^2 + r^2 - 2*c^2) - 0.1*c^3, ds/dt = 1 - s^3\n\
    C(l, u) < C(c, s) > W(r, v): solve dc/dt = 10^(5*s)*(l^2 + r^2 - 2*c^2) - 0.1*c^3, ds/dt = 1 - s^3\n\
    C(l, u) < C(c, s) > C(r, v): solve dc/dt = 10^(5*s)*(l^2 + r^2 - 2*c^2) - 0.1*c^3, ds/dt = 1 - s^3\n";

/// Parameters at some times in bits, with the statistics; where the run ends with an error, that.
fn run(text: &str, settings: Settings, times: &[f64]) -> String {
    let session = Session::from_text("tissue.dls", text, &[]);
    let session = session.unwrap_or_else(|error| panic!("{:?}\n{text}", error.diagnostics));
    let mut seen = String::new();
    let mut go = || -> Result<(), Error> {
        let mut simulation = session.simulate(settings)?;
        let mut string = ModuleString::default();
        for &t in times {
            simulation.at(t, &mut string)?;
            for module in string.iter() {
                write!(seen, "{:x?} ", module.parameters.iter().map(|x| x.to_bits()).collect::<Vec<_>>())
                    .expect("a text");
            }
            writeln!(seen, "{:?}", simulation.stats()).expect("a text");
        }
        Ok(())
    };
    if let Err(error) = go() {
        write!(seen, "{error}").expect("a text");
    }
    seen
}

/// A model with the methods by which it is run.
const MODELS: [(&str, &[Method]); 5] = [
    (RING, &[Method::Auto, Method::Dopri5, Method::Dop853, Method::Rk4]),
    (TISSUE, &[Method::Auto, Method::Dopri5, Method::Dop853, Method::Euler]),
    (TREE, &[Method::Auto, Method::Dopri5]),
    (FLOWS, &[Method::Auto]),
    (STIFF, &[Method::Auto]),
];

#[test]
fn threads_make_the_steps_of_one() {
    for (text, methods) in MODELS {
        for &method in methods {
            for (scheduler, seed) in [(Scheduler::Auto, 0), (Scheduler::Auto, 1), (Scheduler::Global, 2)] {
                let with = |threads| {
                    let settings = Settings {
                        threads,
                        threads_from: 10,
                        seed,
                        method,
                        scheduler,
                        ..Settings::default()
                    };
                    run(text, settings, &[0.3, 0.31, 0.9])
                };
                let alone = with(1);
                assert!(alone.contains("steps"), "it is integrated: {alone}\n{text}");
                for threads in [2, 3] {
                    assert!(
                        with(threads) == alone,
                        "{threads} threads, {method:?}, {scheduler:?}, seed {seed}\n{text}"
                    );
                }
            }
        }
    }
}
