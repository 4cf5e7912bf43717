//! Sides of conditions that meet at a combination of what moves (`x + y = 3.4`): whatever asks for the same combination at that instant finds
//! it at its level, to the last bit where there are such numbers.

use dlsys::sim::{Method, Settings};

use crate::common::{Plain, run};
use crate::dice::Dice;

/// The string of a model at a time.
fn at(text: &str, time: f64) -> Vec<Plain> {
    let strings = run(text, Settings::default(), &[time]);
    strings.unwrap_or_else(|error| panic!("{error}\n{text}")).remove(0)
}

/// The parameters of the only module of a name.
fn only(string: &[Plain], name: &str, text: &str) -> Vec<f64> {
    let found: Vec<&Plain> = string.iter().filter(|module| module.0 == name).collect();
    assert_eq!(found.len(), 1, "{string:?} of\n{text}");
    found[0].1.clone()
}

/// A sum of two integrated parameters, and what is asked of it where it is 3.4: a whole part, roots and weights to both sides, an angle.
#[test]
fn what_follows_from_a_sum_at_its_level_finds_it_there() {
    for (start, rate) in
        [(0.897, "0.6*x*(1 - x/9)"), (0.11, "0.5*x*exp(-0.1*x)"), (0.864, "cos(0.3*t)^2 + 0.2")]
    {
        for level in [3.4, 2.9, 3.0, 3.82] {
            let model = |successor: &str| {
                format!(
                    "initial string: A({start}, 0)\nA(x, y): solve dx/dt = {rate}, dy/dt = 0.3*cos(x)\n  \
                     if x + y = {level} produce {successor}\n"
                )
            };
            let made = |successor: &str, name: &str| {
                let text = model(successor);
                only(&at(&text, 30.0), name, &text)
            };
            for comparison in [">=", "<=", "="] {
                made(&format!("if x + y {comparison} {level}: ( B ) else ( C )"), "B");
            }
            for comparison in [">", "<", "!="] {
                made(&format!("if x + y {comparison} {level}: ( C ) else ( B )"), "B");
            }
            assert_eq!(made(&format!("B(floor((x + y)/{level}), ceil((x + y)/{level}))"), "B"), [1.0, 1.0]);
            assert_eq!(made(&format!("B(sqrt(x + y - {level}), sqrt({level} - (x + y)))"), "B"), [0.0, 0.0]);
            made(&format!("x + y - {level}: C or 1: B"), "B");
            made(&format!("{level} - (x + y): C or 1: B"), "B");
            made(&format!("B(asin((x + y)/{level}))"), "B");
        }
    }
}

/// Two parameters that meet while both move are the same number afterwards.
#[test]
fn parameters_that_meet_are_equal_afterwards() {
    for start in [0.6, 0.75, 1.3, 1.9] {
        for rate in ["0.7*sqrt(1 + 0.1*sin(t))", "0.5*x*exp(-0.1*x) + 0.2", "0.6*tanh(1 + x*y)"] {
            let text = format!(
                "initial string: A(0.31, {start})\nA(x, y):\n  solve dx/dt = {rate}, dy/dt = 0.05*cos(x)\n  if x >= y produce B(x, y)\n"
            );
            let found = only(&at(&text, 20.0), "B", &text);
            assert_eq!(found[0].to_bits(), found[1].to_bits(), "{found:?} of\n{text}");
        }
    }
}

/// A value and what it is computed from: where one meets a level, the other does, for whoever is made then.
#[test]
fn a_value_and_its_definition_meet_a_level_together() {
    let equations = "dx/dt = 0.7*sqrt(1 + 0.1*sin(t)), dy/dt = 0.2*sin(y) + 0.35";
    for value in ["x + y", "x*y", "x^2 + y^2", "x + sin(y)", "x^2 - 3*x + y"] {
        for level in [1.9, 2.0, 2.37] {
            for (event, asked) in [("v", value), (value, "v"), ("v", "v"), (value, value)] {
                // The third condition has the value followed, whatever the event is.
                let text = format!(
                    "initial string: A(0.3, 0.2, 0)\n\
                     A(x, y, v):\n  solve {equations}, v = {value}\n  if {event} >= {level} produce B(x, y, v)\n  if v = 1e6 produce C\n\
                     B(x, y, v):\n  solve {equations}, v = {value}\n  if {asked} < {level} produce C\n  if {asked} >= {level} produce D({value} - {level})\n"
                );
                let found = only(&at(&text, 20.0), "D", &text);
                assert!(found[0].abs() < 1e-14, "{found:?} of\n{text}");
            }
        }
    }
}

/// What two equations bring to their levels at one time, but for their errors, is at both of them.
#[test]
fn several_levels_are_met_at_once() {
    for (start, level) in [(0.297, 3.0), (0.35, 2.0), (0.61, 4.0)] {
        let (rate, other) = ("0.5*x*exp(-0.1*x) + 0.1", "0.2*sin(y) + 0.35");
        let text = format!(
            "initial string: A({start}, 0.1, {})\n\
             A(x, y, z):\n  solve dx/dt = {rate}, dy/dt = {other}, dz/dt = 2*({rate} + {other})\n  \
             if x + y >= {level} & z >= {} produce B(floor(x + y), ceil(x + y), floor(z), ceil(z))\n",
            2.0 * start + 0.2,
            2.0 * level
        );
        let found = only(&at(&text, 20.0), "B", &text);
        assert_eq!(found, [level, level, 2.0 * level, 2.0 * level], "{text}");
    }
}

/// Neighbours that read each other and meet their levels at one time: both events take place at the first of them, with the levels.
#[test]
fn neighbours_meet_their_levels_at_once() {
    for start in [0.25, 0.4, 0.55] {
        for level in [2.0, 3.0] {
            let own = "dx/dt = 0.3*(5 - x) + 0.1*sin(y), dy/dt = 0.2*sin(y) + 0.35";
            let event = format!("if x + y >= {level} produce B(floor(x + y), ceil(x + y))");
            let text = format!(
                "initial string: A({start}, 0.2, 0.3) A({start}, 0.2, 0.4)\n\
                 A(x, y, z) > A(a, b, c):\n  solve {own}, dz/dt = 0.1*c - 0.2*z\n  {event}\n\
                 A(a, b, c) < A(x, y, z):\n  solve {own}, dz/dt = 0.2*c - 0.1*z^2\n  {event}\n"
            );
            let string = at(&text, 20.0);
            assert!(
                string.iter().all(|module| module.0 == "B" && module.1 == [level, level]),
                "{string:?} of\n{text}"
            );
        }
    }
}

/// Equations that end where a level is met, in the module itself, in its successor, and in one that reads neighbours.
#[test]
fn equations_begin_at_their_edge() {
    let (first, second) = ("dx/dt = 0.7*sqrt(1 + 0.1*sin(t))", "dy/dt = 0.2*sin(y) + 0.35");
    for start in [0.3, 0.42, 0.57, 0.727, 0.79] {
        for (sum, level) in [("x + y", 2.0), ("2*x - y", 1.5), ("x*x + y", 1.892)] {
            let edge = format!("sqrt({sum} - {level})");
            let texts = [
                format!(
                    "initial string: A({start}, 0.1, 0)\nA(x, y, n):\n  if {sum} < {level} solve {first}, {second}\n  \
                     if {sum} >= {level} solve {first}, {second}, dn/dt = {edge}\n"
                ),
                format!(
                    "initial string: B({start}, 0.1)\nB(x, y):\n  solve {first}, {second}\n  if {sum} = {level} produce A(x, y, 0)\n\
                     A(x, y, n): solve {first}, {second}, dn/dt = {edge}\n"
                ),
                format!(
                    "initial string: P({start}) B Q(0.1)\nP(x): solve {first}\nQ(y): solve {second}\n\
                     P(x) < B > Q(y):\n  if {sum} = {level} produce A(0)\nP(x) < A(n) > Q(y): solve dn/dt = {edge}\n"
                ),
            ];
            let found = texts.each_ref().map(|text| *only(&at(text, 4.0), "A", text).last().expect("n"));
            assert!(
                found[0] > 0.1 && found.iter().all(|n| (n - found[0]).abs() < 1e-5),
                "{found:?} of\n{texts:?}"
            );
        }
    }
}

/// An expression of x and y, and its value.
type Combination = (&'static str, fn(f64, f64) -> f64);

/// Random sums and products of what grows: each meets any level above its start once, and what is asked of it there has one answer.
#[test]
fn random_combinations_are_at_their_levels() {
    let rates = [
        "0.7*sqrt(1 + 0.1*sin(t))",
        "0.5*x*exp(-0.1*x) + 0.1",
        "0.4",
        "0.6*x*(1 - x/9)",
        "0.6*tanh(1 + x*y)",
    ];
    let others = ["0.3*cos(x)^2 + 0.1", "0.2*sin(y) + 0.35", "0.1*x/(1 + y^2)", "0.2*y + 0.1", "0.15"];
    let combinations: [Combination; 6] = [
        ("x + y", |x, y| x + y),
        ("x*y", |x, y| x * y),
        ("x^2 + y^2", |x, y| x * x + y * y),
        ("x + sin(y)/3", |x, y| x + y.sin() / 3.0),
        ("0.3*x + 0.7*y", |x, y| 0.3 * x + 0.7 * y),
        ("x*exp(0.3*y)", |x, y| x * (0.3 * y).exp()),
    ];
    let mut dice = Dice(7);
    for _ in 0..400 {
        let (rate, other) = (rates[dice.below(rates.len())], others[dice.below(others.len())]);
        let (sum, of) = combinations[dice.below(combinations.len())];
        let [x, y] = [dice.rounded(0.3, 0.9), dice.rounded(0.3, 0.9)];
        let digits = 10f64.powi(dice.below(4) as i32);
        let level = ((of(x, y) + dice.rounded(0.3, 1.5)) * digits).ceil() / digits;
        let heads = [
            format!("initial string: A({x}, {y})\nA(x, y):\n  solve dx/dt = {rate}, dy/dt = {other}\n"),
            format!(
                "initial string: P({x}, {y}) A\nP(x, y): solve dx/dt = {rate}, dy/dt = {other}\nP(x, y) < A:\n"
            ),
        ];
        let asks = [
            format!("if {sum} >= {level}: ( B ) else ( C )"),
            format!("if {sum} <= {level}: ( B ) else ( C )"),
            format!("if {sum} > {level}: ( C ) else ( B )"),
            format!("if floor(({sum})/{level}) = 1: ( B ) else ( C )"),
            format!("if ceil(({sum})/{level}) = 1: ( B ) else ( C )"),
            format!("if sqrt({sum} - {level}) + sqrt({level} - ({sum})) = 0: ( B ) else ( C )"),
            format!("{level} - ({sum}): C or 1: B"),
            format!("{sum} - ({level}): C or 1: B"),
            format!("if acos(({sum})/{level}) = 0: ( B ) else ( C )"),
        ];
        let (head, ask) = (&heads[dice.below(2)], &asks[dice.below(asks.len())]);
        let text = format!("{head}  if {sum} = {level} produce {ask}\n");
        let method = [Method::Auto, Method::Auto, Method::Dopri5, Method::Radau][dice.below(4)];
        let strings = run(&text, Settings { method, ..Settings::default() }, &[60.0]);
        let string = strings.unwrap_or_else(|error| panic!("{error}\n{text}")).remove(0);
        assert!(string.iter().any(|module| module.0 == "B"), "{method:?}: {string:?} of\n{text}");
    }
}
