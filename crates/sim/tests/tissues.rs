//! Coupled modules whose equations are in columns, and structures so large that memory is fetched ahead.

use dlsys_session::Session;
use dlsys_sim::{Method, Scheduler, Settings};
use dlsys_tree::ModuleString;

/// The parameters of all modules at a time, the number of productions up to then, and whether equations have been stiff.
fn state(text: &str, settings: Settings, t: f64) -> (Vec<f64>, u64, bool) {
    let session = Session::from_text("tissue.dls", text, &[]).expect("a model");
    let mut simulation = session.simulate(settings).expect("it starts");
    let mut string = ModuleString::default();
    simulation.at(t, &mut string).expect("it runs");
    let values = string.iter().flat_map(|module| module.parameters.to_vec()).collect();
    (values, simulation.stats().events, simulation.has_been_stiff())
}

/// The largest difference of two states, relative to max(1, |value|).
fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f64::max)
}

/// Steps begin as explicit ones, on columns alone; when diffusion has become fast they are implicit, and need a table.
#[test]
fn explicit_steps_on_columns_give_way_to_implicit_ones() {
    let text = "initial string: F_w(3, 1) G(0, 40) F_w(1, 1)\n\
        G(i, n):\n  if n > 1 produce G(i, floor(n/2)) G(i + floor(n/2), n - floor(n/2))\n  \
        if n = 1 produce F_c(1 + i*0.618 - floor(i*0.618), 0)\n\
        F(l, u) < F_c(c, s) > F(r, v): solve dc/dt = 10^(5*s)*(l^2 + r^2 - 2*c^2) - 0.1*c^3, ds/dt = 1 - s^3\n";
    let auto = state(text, Settings { tolerance: 1e-6, ..Settings::default() }, 2.0);
    let reference = Settings { tolerance: 1e-9, method: Method::Radau, ..Settings::default() };
    let exact = state(text, reference, 2.0);
    assert!(auto.2, "the equations become stiff");
    let error = difference(&auto.0, &exact.0);
    assert!(error <= 1e-5, "{error:e}");
}

/// 2,500 cells whose lives are formulas and whose contents diffuse, some of which turn into others where they are poor: what is
/// fetched ahead, and what is known about formulas, changes neither the events nor the values.
#[test]
fn large_tissues_have_the_events_that_global_steps_find() {
    let text = "initial string: F_h(1, 255) G(0, 2500) F_h(1, 255)\n\
        G(i, n):\n  if n > 1 produce G(i, floor(n/2)) G(i + floor(n/2), n - floor(n/2))\n  \
        if n = 1 produce F_v(0.4 + 0.59*(i*0.618 - floor(i*0.618)), 5 + 20*(i*0.7 - floor(i*0.7)))\n\
        F(y, l) < F_v(x, c) > F(z, r):\n  \
        if x < 1 & c > 5 solve dx/dt = 0.05*x, dc/dt = 0.2*(l + r - 2c) - 0.3*c\n  \
        if x = 1 & c > 5 produce F_v(0.37*x, c) F_v(0.63*x, c)\n  \
        if c = 5 produce F_h(x, c)\n\
        F_h(x, c): solve dx/dt = 0.1*(1 - x), dc/dt = 0.15*(255 - c)\n";
    let settings = Settings { tolerance: 1e-5, ..Settings::default() };
    let auto = state(text, settings, 1.5);
    let global = state(text, Settings { scheduler: Scheduler::Global, ..settings }, 1.5);
    // 5,215 of them are at t = 0, where the cells are made.
    assert!(auto.1 > 5400, "{} events", auto.1);
    assert_eq!(auto.1, global.1);
    let error = difference(&auto.0, &global.0);
    assert!(error <= 1e-3, "{error:e}");
}

/// Modules that are replaced by one of their kind each, in contexts of one and two modules, some of which do not match: contexts
/// are taken over by heirs, which debug builds match again.
#[test]
fn heirs_take_the_places_of_their_predecessors_in_contexts() {
    let text = "initial string: W(0) A(0.13, 1) A(0.5, 2) B(0.31) A(0.72, 3) B(0.2) A(0.94, 4) W(0)\n\
        A(u, p) B(z) < A(x, c):\n  if x < 1 solve dx/dt = 1, dc/dt = p*z - c\n  if x = 1 produce A(0, 0.5*c)\n\
        A(x, c) > A(y, d):\n  if x < 1 solve dx/dt = 1, dc/dt = d - c\n  if x = 1 produce A(0, c + 1)\n\
        A(x, c):\n  if x < 1 solve dx/dt = 1, dc/dt = 1 - c\n  if x = 1 produce A(0, 2*c)\n\
        A(x, c) < B(z):\n  if z < 1 solve dz/dt = 0.4 + 0.01*c\n  if z = 1 produce B(0)\n";
    let settings = Settings { tolerance: 1e-6, ..Settings::default() };
    let auto = state(text, settings, 9.7);
    let global = Settings { scheduler: Scheduler::Global, tolerance: 1e-9, ..settings };
    let exact = state(text, global, 9.7);
    assert!(auto.1 > 40, "{} events", auto.1);
    assert_eq!(auto.1, exact.1);
    let error = difference(&auto.0, &exact.0);
    assert!(error <= 1e-5, "{error:e}");
}

/// Cells that diffuse fast and are replaced when their clocks say so. Where conditions read nothing but clocks, and the tissue is so
/// small that an event reaches most of it, no steps are made; where they read what diffuses, they are.
#[test]
fn events_met_by_formulas_leave_stiff_linear_tissues_without_steps() {
    let text = |guard: &str| {
        format!(
            "initial string: F_w(0, 255) G(0, 60) F_w(0, 255)\n\
             G(i, n):\n  if n > 1 produce G(i, floor(n/2)) G(i + floor(n/2), n - floor(n/2))\n  \
             if n = 1 produce F_v(i*0.618 - floor(i*0.618), 50 + 150*(i*0.7 - floor(i*0.7)))\n\
             F(u, l) < F_v(x, c) > F(v, r):\n  \
             if x < 1{guard} solve dx/dt = 1, dc/dt = 2000*(l + r - 2c) - 0.03*c\n  \
             if x = 1{guard} produce F_v(0, 0.5*c + 60)\n"
        )
    };
    let settings = Settings { tolerance: 1e-6, ..Settings::default() };
    let reference = Settings { scheduler: Scheduler::Global, tolerance: 1e-9, ..settings };
    let exact = state(&text(""), reference, 2.3);
    let steps = |text: &str, times: &[f64]| {
        let session = Session::from_text("tissue.dls", text, &[]).expect("a model");
        let mut simulation = session.simulate(settings).expect("it starts");
        let mut string = ModuleString::default();
        times.iter().for_each(|t| simulation.at(*t, &mut string).expect("it runs"));
        let values: Vec<f64> = string.iter().flat_map(|module| module.parameters.to_vec()).collect();
        (values, simulation.stats().steps, simulation.stats().events)
    };
    let (clocks, read) = (steps(&text(""), &[2.3]), steps(&text(" & c > 1"), &[2.3]));
    assert!(exact.2 && clocks.2 == exact.1 && read.2 == exact.1, "{} {} {}", clocks.2, read.2, exact.1);
    assert!(3 * clocks.1 < read.1, "{} and {} steps", clocks.1, read.1);
    for (values, ..) in [&clocks, &read] {
        let error = difference(values, &exact.0);
        assert!(error <= 1e-7, "{error:e}");
    }
    // The times that are asked for change nothing.
    let often: Vec<f64> = (1..=230).map(|n| f64::from(n) / 100.0).collect();
    assert_eq!(steps(&text(""), &often), clocks);
}

/// A tissue with linear equations: cells that divide or turn into others by their clocks and by what diffuses, beside some whose content
/// is a formula; with a conductance that each cell has of its own, or one for all.
fn linear_tissue(
    (d, flow, decay): (f64, f64, f64),
    (kind, guard, has_own): (usize, usize, bool),
    cells: &[(f64, f64)],
) -> String {
    let [w, of_one, of_left, own, by] =
        if has_own { [", w", ", 1", ", u", "(0.5*u + w)*", ", v"] } else { ["", "", "", "", ""] };
    let successor = [
        format!("F_v(0, 0.5*c + 60{w})"),
        format!("F_v(0.05, c{w}) F_v(0.37, c{w})"),
        format!("F_v(0.1, c{w}) F_h(1, c{w})"),
    ];
    let (held, met) = [
        ("", String::new()),
        (" & c > 40", format!("  if c = 40 produce F_h(x, c{w})\n")),
        (" & c < 170", format!("  if c = 170 produce F_v(0.5*x, 100{w})\n")),
    ][guard % 3]
        .clone();
    let (successor, formula) =
        (&successor[kind % 3], ["0.15*(255 - c)", "-0.4*c", "3", "0"][(kind + guard) % 4]);
    let width = |x: &f64| if has_own { format!(", {}", 0.3 + x) } else { String::new() };
    let cells: String = cells.iter().map(|(x, c)| format!("F_v({x}, {c}{}) ", width(x))).collect();
    format!(
        "initial string: F_h(1, 255{of_one}) {cells} F_h(0.5, 90{of_one}) {cells} F_h(1, 200{of_one})\n\
         F(y, l{of_left}) < F_v(x, c{w}) > F(z, r{by}):\n  \
         if x < 1{held} solve dx/dt = 0.1 + 0.5*x, dc/dt = {d}*{own}(l + r - 2c) + {flow}*(l - c) - {decay}*c\n  \
         if x = 1{held} produce {successor}\n{met}\
         F_h(x, c{w}): solve dx/dt = 0.1*(1 - x), dc/dt = {formula}\n"
    )
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig { cases: 150, ..Default::default() })]

    /// Linear equations are followed by polynomials, and by steps of pairs where those lead too short a way: both against global steps.
    #[test]
    fn linear_tissues_have_the_events_and_values_of_global_steps(
        (d, flow, decay) in (-2.0..1.5f64, 0.0..1.0f64, 0.0..0.3f64),
        choice in (0..3usize, 0..3usize, proptest::bool::ANY),
        cells in proptest::collection::vec((0.0..0.95f64, 60.0..140.0f64), 3..14),
    ) {
        let d = 10f64.powf(d);
        let text = linear_tissue((d, if flow < 0.5 { 0.0 } else { flow * d }, decay), choice, &cells);
        let settings = Settings { tolerance: 1e-6, ..Settings::default() };
        let reference =
            Settings { scheduler: Scheduler::Global, method: Method::Dop853, tolerance: 1e-10, ..settings };
        let (auto, exact) = (state(&text, settings, 3.0), state(&text, reference, 3.0));
        proptest::prop_assert_eq!(auto.1, exact.1, "{}", &text);
        let error = difference(&auto.0, &exact.0);
        proptest::prop_assert!(error <= 2e-5, "{} in\n{}", error, &text);
    }
}

/// A region may have members and no components.
#[test]
fn readers_without_equations_have_events_beside_one_that_is_integrated() {
    let text = "initial string: P(0.869) A(0, 0)\nP(x): solve dx/dt = 1.302 - 0.688*t - 0.116*t^2\n\
        P(x) < A(n, s):\n  if abs(x - 1.4816) < 1.5e-6 & s = 0 produce A(n + 1, 1)\n  \
        if abs(x - 1.4816) > 1.5e-6 & s = 1 produce A(n + 1, 0)\n";
    let (values, events, _) = state(text, Settings::default(), 3.0);
    assert_eq!((events, values[1]), (4, 4.0));
}

/// Polynomials take no trials, and what is observed changes nothing.
#[test]
fn a_linear_tissue_with_events_rejects_no_step() {
    [false, true].into_iter().for_each(rejects_no_step);
}

fn rejects_no_step(has_own: bool) {
    let cells: Vec<(f64, f64)> =
        (0..40).map(|n| (f64::from(n) * 0.618 % 0.95, 60.0 + f64::from(n * 37 % 80))).collect();
    let text = linear_tissue((0.03, 0.0, 0.03), (1, 1, has_own), &cells);
    let run = |settings: Settings, times: &[f64]| {
        let session = Session::from_text("tissue.dls", &text, &[]).expect("a model");
        let mut simulation = session.simulate(settings).expect("it starts");
        let mut string = ModuleString::default();
        times.iter().for_each(|t| simulation.at(*t, &mut string).expect("it runs"));
        let values: Vec<f64> = string.iter().flat_map(|module| module.parameters.to_vec()).collect();
        (values, simulation.stats())
    };
    let auto = Settings { tolerance: 1e-6, ..Settings::default() };
    let (values, stats) = run(auto, &[4.0]);
    assert!(
        stats.events > 100 && stats.rejected == 0,
        "{} events, {} rejected",
        stats.events,
        stats.rejected
    );
    let (steps, pair) = run(Settings { method: Method::Dop853, ..auto }, &[4.0]);
    assert!(difference(&values, &steps) <= 1e-6);
    let [of_powers, of_pair] = [stats, pair].map(|stats| stats.rhs_evaluations);
    assert!(of_powers < of_pair, "{of_powers} products and {of_pair} evaluations");
    let often: Vec<f64> = (1..=200).map(|n| f64::from(n) / 50.0).collect();
    assert_eq!(run(auto, &often).0, values);
}
