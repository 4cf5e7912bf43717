//! Equations at an instant: rows of modules whose rates depend on thresholds of their own values and of those of their neighbours, against all
//! choices of rates that agree with where they lead; productions follow from the choice that is left, and from no other.

use dlsys::sim::{Error, Settings};
use proptest::prelude::*;

use crate::common::{Plain, run, show};
use crate::semantics::{expect, fails};

/// The value that a module's condition reads: its own, or that of a neighbour.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Read {
    Own,
    Left,
    Right,
}

/// A comparison of a value with a level, in quarters. Values, rates and levels are such that all times are multiples of 1/8, and exact.
#[derive(Clone, Copy, Debug)]
struct Threshold {
    operator: &'static str,
    level: i32,
}

impl Threshold {
    fn level(self) -> f64 {
        f64::from(self.level) / 4.0
    }

    /// True if it holds for a value, or just after it if the value moves at a rate.
    fn holds(self, value: f64, rate: f64) -> bool {
        let above = value - self.level();
        let side = if above != 0.0 { above } else { rate };
        match self.operator {
            "<" => side < 0.0,
            "<=" => side <= 0.0,
            ">" => side > 0.0,
            _ => side >= 0.0,
        }
    }
}

#[derive(Clone, Debug)]
struct Cell {
    start: i32,
    read: Read,
    threshold: Threshold,
    rates: [i32; 2],
    production: Option<Threshold>,
}

/// The number of the module that a module reads. The outermost ones read themselves where there is no neighbour.
fn read_by(cells: &[Cell], i: usize) -> usize {
    match cells[i].read {
        Read::Left if i > 0 => i - 1,
        Read::Right if i + 1 < cells.len() => i + 1,
        _ => i,
    }
}

fn text_of(cells: &[Cell]) -> String {
    let string: Vec<String> =
        cells.iter().enumerate().map(|(i, cell)| format!("K{i}({})", f64::from(cell.start) / 4.0)).collect();
    let mut text = format!("initial string: {}\n", string.join(" "));
    for (i, cell) in cells.iter().enumerate() {
        let read = read_by(cells, i);
        let (head, variable) = match read.cmp(&i) {
            std::cmp::Ordering::Less => (format!("K{read}(p) < K{i}(x)"), "p"),
            std::cmp::Ordering::Equal => (format!("K{i}(x)"), "x"),
            std::cmp::Ordering::Greater => (format!("K{i}(x) > K{read}(p)"), "p"),
        };
        let ([on, off], Threshold { operator, .. }) = (cell.rates, cell.threshold);
        let level = cell.threshold.level();
        text += &format!("{head}:\n  solve dx/dt = if {variable} {operator} {level} then {on} else {off}\n");
        if let Some(production) = cell.production {
            text += &format!("  if {variable} {} {} produce E(t)\n", production.operator, production.level());
        }
    }
    text + "interpret E(t_0): ε\n"
}

/// What is true of a row.
#[derive(Debug, PartialEq)]
enum Truth {
    /// The values at the end.
    Values(Vec<f64>),
    /// The first productions: when, of which modules, and whether they hold at the instant: others may follow just after it.
    Produced(f64, Vec<bool>, bool),
    /// From this time on no choice of rates agrees with where it leads.
    Impossible(f64),
    /// Several do.
    Ambiguous,
}

fn truth_of(cells: &[Cell], end: f64) -> Truth {
    let mut values: Vec<f64> = cells.iter().map(|cell| f64::from(cell.start) / 4.0).collect();
    let mut t = 0.0;
    let produced = |values: &[f64], rates: &[f64]| -> Vec<bool> {
        let holds = |(i, cell): (usize, &Cell)| {
            let read = read_by(cells, i);
            cell.production.is_some_and(|production| production.holds(values[read], rates[read]))
        };
        cells.iter().enumerate().map(holds).collect()
    };
    loop {
        let at = produced(&values, &vec![0.0; cells.len()]);
        if at.contains(&true) {
            return Truth::Produced(t, at, true);
        }
        let mut found: Option<Vec<f64>> = None;
        for choice in 0..1 << cells.len() {
            let on = |i: usize| choice >> i & 1 == 1;
            let rates: Vec<f64> = cells
                .iter()
                .enumerate()
                .map(|(i, cell)| f64::from(cell.rates[usize::from(!on(i))]))
                .collect();
            let agrees = |(i, cell): (usize, &Cell)| {
                let read = read_by(cells, i);
                cell.threshold.holds(values[read], rates[read]) == on(i)
            };
            if cells.iter().enumerate().all(agrees) {
                if found.as_ref().is_some_and(|other| *other != rates) {
                    return Truth::Ambiguous;
                }
                found = Some(rates);
            }
        }
        let Some(rates) = found else { return Truth::Impossible(t) };
        let after = produced(&values, &rates);
        if after.contains(&true) {
            return Truth::Produced(t, after, false);
        }
        let mut next = end;
        for (i, cell) in cells.iter().enumerate() {
            let read = read_by(cells, i);
            for threshold in [Some(cell.threshold), cell.production].into_iter().flatten() {
                let meets = t + (threshold.level() - values[read]) / rates[read];
                if meets > t {
                    next = next.min(meets);
                }
            }
        }
        values.iter_mut().zip(&rates).for_each(|(value, rate)| *value += rate * (next - t));
        t = next;
        if t == end {
            return Truth::Values(values);
        }
    }
}

fn threshold() -> impl Strategy<Value = Threshold> {
    (prop::sample::select(vec!["<", "<=", ">", ">="]), -2..=4)
        .prop_map(|(operator, level)| Threshold { operator, level })
}

fn cell() -> impl Strategy<Value = Cell> {
    let read = prop::sample::select(vec![Read::Own, Read::Left, Read::Right, Read::Right]);
    let rates = [prop::sample::select(vec![-2, -1, 0, 1, 2]), prop::sample::select(vec![-2, -1, 0, 1, 2])];
    (
        prop::sample::select(vec![0, 1, 1, 2]),
        read,
        threshold(),
        rates,
        prop::option::weighted(0.3, threshold()),
    )
        .prop_map(|(start, read, threshold, rates, production)| Cell {
            start,
            read,
            threshold,
            rates,
            production,
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn rows_take_the_equations_that_agree_with_where_they_lead(cells in prop::collection::vec(cell(), 1..6)) {
        // Not at a multiple of 1/8: what happens just after an instant belongs to it.
        let (text, end) = (text_of(&cells), 4.05);
        match truth_of(&cells, end) {
            Truth::Ambiguous => {}
            Truth::Impossible(t) => {
                let error = run(&text, Settings::default(), &[end]).map(|strings| show(&strings[0]));
                let Err(Error::Chattering { site }) = error else { panic!("{error:?}, not chattering at {t}\n{text}") };
                prop_assert!((site.time - t).abs() < 1e-9, "at {}, not {}\n{}", site.time, t, text);
            }
            Truth::Values(values) => {
                let string = run(&text, Settings::default(), &[end]).unwrap_or_else(|e| panic!("{e}\n{text}")).remove(0);
                let near = |(module, value): (&Plain, &f64)| module.0 != "E" && (module.1[0] - value).abs() < 1e-6;
                prop_assert!(string.iter().zip(&values).all(near), "{string:?}, not {values:?}\n{text}");
            }
            Truth::Produced(t, produced, others) => {
                let string = match run(&text, Settings::default(), &[t + 0.01]) {
                    Ok(mut strings) => strings.remove(0),
                    // The others have no equations then.
                    Err(Error::Chattering { site }) if others && (site.time - t).abs() < 1e-9 => return Ok(()),
                    Err(error) => panic!("{error}\n{text}"),
                };
                let found: Vec<bool> = string.iter().map(|module| module.0 == "E").collect();
                let all = found.iter().zip(&produced).all(|(found, produced)| found == produced || *found && others);
                prop_assert!(all, "{string:?}, not {produced:?} at {t}\n{text}");
            }
        }
    }
}

#[test]
fn what_comes_to_rest_at_a_threshold_does_not_pass_it() {
    let tank = "initial string: Leaf(0) Tank(0)\nTank(x): solve dx/dt = if x >= 1 then 0 else 1\n";
    let leaf = "Leaf(y) > Tank(p):\n  solve dy/dt = 1\n";
    for condition in ["if p > 1", "if p > 1 at rate 50", "if ceil(p) > 1", "if p - 1 > 0 & y > 0"] {
        expect(&format!("{tank}{leaf}  {condition} produce E"), &[(2.0, "Leaf(2) Tank(1)")]);
    }
    for (law, y) in [("if p > 1 then 1 else 2", 4.0), ("ceil(p)", 2.0), ("1 + sign(p - 1)", 1.0)] {
        let text = format!("{tank}Leaf(y) > Tank(p): solve dy/dt = {law}");
        expect(&text, &[(2.0, &format!("Leaf({y}) Tank(1)"))]);
    }
    expect(
        &format!("{tank}Leaf(v) > Tank(p): solve v = if p > 1 then 5 else 0"),
        &[(2.0, "Leaf(0) Tank(1)")],
    );
    let empty = "initial string: Leaf(0) Tank(1)\nTank(x):\n  if x > 0 solve dx/dt = -x^2 - 1\n  if x <= 0 solve dx/dt = 0\n";
    expect(&format!("{empty}{leaf}  if p < 0 produce E"), &[(2.0, "Leaf(2) Tank(0)")]);
    // What rests is two modules away, and rests because of a third.
    let far = "initial string: L(0) X(0) Q(1)\nQ(v): solve dv/dt = -1\nX(x) > Q(q): solve dx/dt = if q > 0 then 1 else 0\nL(y) > X(p):\n  solve dy/dt = 1\n  if p > 1 produce E";
    expect(far, &[(2.0, "L(2) X(1) Q(-1)")]);
}

#[test]
fn what_is_born_at_rest_on_a_threshold_stays() {
    let clauses = "initial string: A(0.75)\nA(x):\n  if x < 0.75 solve dx/dt = 1\n  if x >= 0.75 solve dx/dt = 0\n  if x > 0.75 produce E";
    expect(clauses, &[(2.0, "A(0.75)")]);
    let switch = "initial string: A(0)\nA(x):\n  solve dx/dt = if x > 0 then -1 else 0\n  if x < 0 produce E";
    expect(switch, &[(2.0, "A(0)")]);
    let three = "initial string: A(1)\nA(x):\n  if x > 0.5 solve dx/dt = -1\n  if x = 0.5 solve dx/dt = 0\n  if x < 0.5 solve dx/dt = 1\n  if x < 0.5 produce E";
    expect(three, &[(2.0, "A(0.5)")]);
    // No choice agrees with where it leads, so nothing follows from any.
    let error = fails(
        "initial string: A(0.5)\nA(x):\n  solve dx/dt = if x < 0.5 then 1 else -2\n  if x > 0.5 produce E",
        1.0,
    );
    assert!(matches!(error, Error::Chattering { .. }), "{error}");
}

#[test]
fn a_rate_that_is_zero_on_the_boundary_keeps_a_module_there() {
    for law in [
        "-sign(x - 0.5)",
        "if x = 0.5 then 0 else if x < 0.5 then 1 else -2",
        "match sign(x - 0.5) case 1: -2 case 0: 0 else 1",
    ] {
        for start in [0.0, 0.5, 0.75] {
            let text = format!("initial string: A({start})\nA(x): solve dx/dt = {law}");
            expect(&text, &[(2.0, "A(0.5)")]);
        }
    }
}

#[test]
fn a_value_that_jumps_at_an_instant_is_read_as_it_is_after_the_jump() {
    // V is 0.25 when B goes, and 0.5 from then on.
    let tissue = "initial string: B(0) V(0) W(0)\nB(x) > V(q):\n  solve dx/dt = 1\n  if q >= 0.25 produce ε\nB(p) < V(v): solve v = p\nV(v): solve v = 0.5\n";
    for (law, seen) in [
        ("V(p) < W(w): solve w = if p < 0.5 then 7 else 2*p", "V(0.5) W(1)"),
        ("V(p) < W(w): solve dw/dt = if p < 0.5 then 1 else 0", "V(0.5) W(0.25)"),
        ("V(p) < W(w): solve w = if p > 0.3 then 2*p else 7", "V(0.5) W(1)"),
    ] {
        expect(&format!("{tissue}{law}"), &[(2.0, seen)]);
    }
    // It rests where it is, at the threshold.
    let rests = tissue.replace("solve v = 0.5", "solve v = 0.25");
    for (law, seen) in [
        ("if p > 0.25 produce Z(p)", "V(0.25) W(0)"),
        ("solve dw/dt = if p <= 0.25 then 1 else 5", "V(0.25) W(2)"),
    ] {
        expect(&format!("{rests}V(p) < W(w): {law}"), &[(2.0, seen)]);
    }
}

#[test]
fn a_signal_passes_along_many_modules_at_once() {
    let string = "initial string: X(0) for i in 1 .. 300: ( V(0) ) L(0)\nX(x): solve dx/dt = 1\n";
    let row = "X(x) < V(v): solve v = if x > 0.5 then 1 else 0\nV(p) < V(v): solve v = if p > 0.5 then 1 else 0\nV(p) < L(y): solve dy/dt = p";
    let strings =
        run(&format!("{string}{row}"), Settings::default(), &[2.0]).unwrap_or_else(|e| panic!("{e}"));
    assert!((strings[0].last().expect("L is there").1[0] - 1.5).abs() < 1e-6, "{:?}", strings[0].last());
}

#[test]
fn a_row_settles_from_either_end() {
    for (head, seen) in
        [("A(x) > A(p)", "A(2) A(0) A(2) A(0) A(2)"), ("A(p) < A(x)", "A(2) A(0) A(2) A(0) A(2)")]
    {
        let text = format!(
            "initial string: A(0) A(0) A(0) A(0) A(0)\n{head}: solve dx/dt = if p < 1 then 1 else -1\nA(x): solve dx/dt = 1"
        );
        expect(&text, &[(2.0, seen)]);
    }
    // Long rows, of which every module waits for the one before it in the order of choice.
    let text = |head: &str| {
        format!(
            "initial string: for i in 1 .. 400: ( A(0) )\n{head}: solve dx/dt = if p < 1 then 1 else -1\nA(x): solve dx/dt = 1"
        )
    };
    for head in ["A(x) > A(p)", "A(p) < A(x)"] {
        let string =
            run(&text(head), Settings::default(), &[2.0]).unwrap_or_else(|e| panic!("{e}")).remove(0);
        let down = string.iter().filter(|module| module.1[0].abs() < 1e-6).count();
        assert_eq!((string.len(), down), (400, 200), "{head}");
    }
}
