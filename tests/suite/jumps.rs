//! What jumps, in rates, values, conditions and successors: `floor`, `ceil`, `sign`, elements of arrays, comparisons that rest at equality.
//! Each against the solution by hand.

use crate::common::{Plain, run};
use crate::semantics::fails;
use dlsys::sim::{Error, Method, Settings};

fn at(text: &str, t: f64) -> Vec<Plain> {
    run(text, Settings::default(), &[t]).unwrap_or_else(|e| panic!("{e}\n{text}")).remove(0)
}

/// The parameters of the modules of a kind, by `auto` and by two methods that integrate everything.
fn reaches(text: &str, t: f64, name: &str, expected: &[f64]) {
    for method in [Method::Auto, Method::Dop853, Method::Radau] {
        let settings = Settings { method, ..Settings::default() };
        let string =
            run(text, settings, &[t]).unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}")).remove(0);
        let found: Vec<f64> =
            string.iter().filter(|m| m.0 == name).flat_map(|m| m.1.iter().copied()).collect();
        assert_eq!(found.len(), expected.len(), "{method:?}: {string:?}");
        let is_near = |(x, y): (&f64, &f64)| (x - y).abs() <= 2e-5 * y.abs().max(1.0);
        assert!(found.iter().zip(expected).all(is_near), "{method:?}: {found:?}, not {expected:?}\n{text}");
    }
}

#[test]
fn whole_numbers_of_neighbours_and_counts_are_whole() {
    let rate = "const rate = [0, 1, 2, 3]\n";
    reaches(
        &format!("{rate}initial string: N(2) B(0)\nN(n) < B(x): solve dx/dt = rate[n]"),
        1.0,
        "B",
        &[2.0],
    );
    reaches(
        &format!("{rate}initial string: B(0) [ L ] [ L ]\nB(x): solve dx/dt = rate[count(L)]"),
        1.0,
        "B",
        &[2.0],
    );
    for (law, expected) in [
        ("floor(n)", 3.0),
        ("ceil(n)", 3.0),
        ("floor(n/3)", 1.0),
        ("n - 2*floor(n/2)", 1.0),
        ("rate[n] + floor(n + 0.5)", 6.0),
    ] {
        let text = format!("{rate}initial string: N(3) B(0)\nN(n) < B(x): solve dx/dt = {law}");
        reaches(&text, 1.0, "B", &[expected]);
    }
    reaches("initial string: B(0) [ A ] [ A ] [ A ]\nB(x): solve x = floor(count(A)/3)", 1.0, "B", &[1.0]);
}

#[test]
fn no_jump_of_a_whole_part_is_passed_over() {
    // y falls from 1.17 like an exponential, and floor(1.8 y) = 1 from t = ln(1.872/1.813111) to ln(1.872/1.257556).
    let y = "dy/dt = (-0.702 - y)*(1 + 0*sin(y))";
    let [from, to] = [2.0, 1.0].map(|level| (1.872f64 / (level / 1.8 + 0.702)).ln());
    let x = -0.21 * 3.0 + 1.77 * (to - from);
    let text = format!(
        "initial string: A(0, 1.17)\nA(x, y): solve dx/dt = if floor(1.8*y) = 1 then 1.56 else -0.21, {y}"
    );
    reaches(&text, 3.0, "A", &[x, 1.872 * (-3f64).exp() - 0.702]);
    // A difference of a value and its whole part.
    let text = "initial string: A(0, 1.32)\nA(z, y): solve z = if 0.5*y - floor(0.5*y) < 0.3 then 1.18 else 0.66, dy/dt = 1.771*cos(t)";
    reaches(text, 3.0, "A", &[0.66, 1.32 + 1.771 * 3f64.sin()]);
    // 1.19 y falls from 1.4518 by 0.98294 a unit of time: three times 0.3 of it are in the first part of a period.
    for condition in ["1.19*y - floor(1.19*y) < 0.3", "!(0.3 <= 1.19*y - floor(1.19*y))"] {
        let text = format!(
            "initial string: A(0, 0, 1.22)\nA(x, z, y): solve dx/dt = z, z = if {condition} then 1.99 else -0.53, dy/dt = -0.826"
        );
        let end = [-0.53 * 3.0 + 2.52 * 0.9 / 0.98294, -0.53, 1.22 - 3.0 * 0.826];
        reaches(&text, 3.0, "A", &end);
    }
    // Several whole parts, in a value that is matched.
    let text = "initial string: A(0, 0.73)\nA(x, y): solve dx/dt = match ceil(3.46*y) - 1 case -1: 3 case 0: 1.49 case 1: 1.9 else 0.07, dy/dt = -1.938";
    let passes = |level: f64| (0.73 - level / 3.46) / 1.938;
    let x = 0.07 * passes(2.0)
        + 1.9 * (passes(1.0) - passes(2.0))
        + 1.49 * (passes(0.0) - passes(1.0))
        + 3.0 * (passes(-1.0) - passes(0.0))
        + 0.07 * (3.0 - passes(-1.0));
    reaches(text, 3.0, "A", &[x, 0.73 - 3.0 * 1.938]);
}

/// x'' = -1 above a level and 1 below it, from a distance d at rest: parabolas, each of which lasts sqrt(2 d) to the level.
fn swing(d: f64, t: f64) -> f64 {
    let quarter = (2.0 * d).sqrt();
    let phase = t % (4.0 * quarter);
    let half = |s: f64| d - 0.5 * (s - quarter) * (s - quarter);
    match phase {
        s if s <= quarter => d - 0.5 * s * s,
        s if s <= 3.0 * quarter => -half(s - quarter),
        s => half(s - 3.0 * quarter),
    }
}

#[test]
fn oscillations_through_a_jump_keep_their_size() {
    for condition in [
        "floor(x) < 2",
        "ceil(x) <= 2",
        "max(x, 2) <= 2",
        "min(x, 2) < 2",
        "sign(x - 2) < 1",
        "1 >= floor(x)",
    ] {
        for start in [2.52, 2.9] {
            let text = format!(
                "initial string: C({start}, 0)\nC(x, v): solve dx/dt = v, dv/dt = if {condition} then 1 + 0*x*sin(v) else -1 + 0*x*sin(v)"
            );
            let x = at(&text, 7.3)[0].1[0];
            let exact = 2.0 + swing(start - 2.0, 7.3);
            assert!((x - exact).abs() < 1e-4, "{condition}: {x}, not {exact}");
        }
    }
    let text = "initial string: C(-0.027, 0)\nC(x, v): solve dx/dt = v, dv/dt = match sign(2*x - 1) case 1: -1 case -1: 1 else 0";
    let x = at(text, 3.0)[0].1[0];
    assert!((x - (0.5 - swing(0.527, 3.0))).abs() < 1e-4, "{x}");
}

#[test]
fn equations_that_push_against_each_other_at_a_jump_are_an_error() {
    for start in [0.6, 0.3] {
        let text =
            format!("initial string: C({start})\nC(x): solve dx/dt = if floor(2.5*x) < 1 then 1 else -1");
        let error = fails(&text, 0.5);
        assert!(matches!(error, Error::Chattering { .. }), "{error}");
    }
    let error =
        fails("initial string: C(0.472)\nC(x): solve dx/dt = if floor(2.135*x) < 1 then 1 else -1", 1.0);
    assert!(matches!(error, Error::Chattering { .. }), "{error}");
}

#[test]
fn equalities_that_begin_to_hold_for_good_are_seen() {
    for condition in ["max(x, 0) = x", "abs(x) = x", "x = max(0, x)", "min(x, 0) != x"] {
        let text = format!("initial string: C(-0.5)\nC(x): solve dx/dt = if {condition} then 2 else 1");
        reaches(&text, 1.5, "C", &[2.0]);
    }
    let text = "initial string: C(-0.5)\nC(x):\n solve dx/dt = 1\n if abs(x) = x & x > 0 produce E(t)";
    assert!((at(text, 1.0)[0].1[0] - 0.5).abs() < 1e-9);
}

#[test]
fn a_jump_in_a_branch_that_is_not_taken_disturbs_nothing() {
    let text = "initial string: B(0.227, -0.988)\nB(x, y): solve dx/dt = 1.325*(2.067 - x), dy/dt = 1.497*((if y > 9 then (match floor(1.765*y) case 0: -0.5 case 1: 0.5 else 1) else x) - y)";
    let y = at(text, 3.0)[0].1[1];
    assert!((y - 1.91153).abs() < 1e-4, "{y}");
}

#[test]
fn a_production_happens_once_for_one_jump() {
    for x in ["dx/dt = 1", "dx/dt = 1 + 0*sin(x)"] {
        for condition in ["floor(x) != n", "floor(x) > n", "x >= n + 1", "x < n | x >= n + 1"] {
            let text = format!(
                "initial string: X(0) A(0, 0)\nX(x): solve {x}\nX(x) < A(n, k): if {condition} produce A(floor(x), k + 1)"
            );
            let string = at(&text, 10.5);
            let counter = string.iter().find(|m| m.0 == "A").expect("it is there");
            assert_eq!(counter.1, [10.0, 10.0], "{x}, {condition}");
        }
    }
    let string = at("initial string: A(0, 0)\nA(n, k): if floor(t) != n produce A(floor(t), k + 1)", 10.5);
    assert_eq!(string[0].1, [10.0, 10.0]);
}

#[test]
fn successors_get_the_level_at_which_their_condition_holds() {
    let q = "const q = [0, 1, 2, 3]\n";
    let of = |text: &str| at(text, 3.0).iter().find(|m| m.0 == "E").map(|m| m.1.clone());
    for law in ["1.17 + 0*sin(x)", "1.17"] {
        let text = format!(
            "{q}initial string: X(0.57) A\nX(x): solve dx/dt = {law}\nX(x) < A: if x = 1 produce E(q[x], x)"
        );
        assert_eq!(of(&text), Some(vec![1.0, 1.0]), "{law}");
        for factor in ["0.87", "1.83", "3.39", "2"] {
            for head in ["X(x) < A", "X(x)"] {
                let text = format!(
                    "initial string: X(0.1) A\nX(x): solve dx/dt = {law}\n{head}: if {factor}*x >= 2 produce E(floor({factor}*x))"
                );
                let text = if head == "X(x)" { text.replacen("\nX(x): if", "\n  if", 1) } else { text };
                assert_eq!(of(&text), Some(vec![2.0]), "{text}");
            }
        }
    }
}

/// The number of a whole part, and of its changes, of an x that moves from `start` at a rate until t = 2.
fn counted(start: f64, rate: f64, whole: fn(f64) -> f64) -> [f64; 2] {
    let (first, last) = (whole(start), whole(start + 2.0 * rate));
    [last, (last - first).abs()]
}

#[test]
fn a_production_that_holds_just_after_a_jump_finds_what_jumps_as_it_is_there() {
    for (rate, drift) in [(-1.3, ""), (-1.3, " + 0*sin(x)"), (1.3, ""), (1.3, " + 0*sin(x)")] {
        for (name, whole) in [("floor", f64::floor as fn(f64) -> f64), ("ceil", f64::ceil)] {
            for start in [1.52, 0.77, -0.41] {
                let expected = counted(start, rate, whole);
                let first = whole(start);
                let alone = format!(
                    "initial string: A({start}, {first}, 0)\nA(x, n, k):\n  solve dx/dt = {rate}{drift}\n  if {name}(x) != n produce A(x, {name}(x), k + 1)"
                );
                let string = at(&alone, 2.0);
                assert_eq!(string[0].1[1..], expected, "{alone}");
                let around = format!(
                    "initial string: X({start}) A({first}, 0)\nX(x): solve dx/dt = {rate}{drift}\nX(x) < A(n, k): if {name}(x) != n produce A({name}(x), k + 1)"
                );
                let string = at(&around, 2.0);
                assert_eq!(string[1].1, expected, "{around}");
            }
        }
    }
    // A sign has a value of its own at zero.
    for start in [-0.53, -0.5] {
        let text = format!(
            "initial string: A({start}, -1, 0)\nA(x, n, k):\n  solve dx/dt = 1.3\n  if sign(x - 1) != n produce A(x, sign(x - 1), k + 1)"
        );
        assert_eq!(at(&text, 3.0)[0].1[1..], [1.0, 2.0], "{text}");
    }
    // Whole parts of functions of time.
    for (law, first, last) in [
        ("floor(0.32 + 2.236*t)", 0.0, 4.0),
        ("ceil(0.32 - 2.236*t)", 1.0, -4.0),
        ("floor(0.32 - 2.236*t)", 0.0, -5.0),
    ] {
        let text = format!("initial string: A({first}, 0)\nA(n, k): if {law} != n produce A({law}, k + 1)");
        assert_eq!(at(&text, 2.0)[0].1, [last, f64::abs(last - first)], "{text}");
    }
    // However slow it is, and beside something larger.
    let text = "initial string: A(0.001, 0)\nA(x, n):\n  solve dx/dt = -0.001\n  if floor(x) != n produce A(x, floor(x)) L(floor(x + 8), floor(x + 100))";
    assert_eq!(at(text, 2.0)[1].1, [7.0, 99.0]);
    // Also with what is made once for each whole number, and from a condition that says the same in other words.
    let text = "initial string: A(2.5)\nA(x):\n  solve dx/dt = -1\n  if x < 2 produce B(floor(x), x) for i in 1 .. floor(x): ( C(i) )";
    let string = at(text, 1.0);
    assert_eq!(
        string.iter().map(|m| (m.0.as_str(), m.1.clone())).collect::<Vec<_>>(),
        [("B", vec![1.0, 2.0]), ("C", vec![1.0])]
    );
    // A reader of the counter and of what it counts sees both on the same side.
    let text = "initial string: A(2.5, 2) L(0)\nA(x, n):\n  solve dx/dt = -1 + 0*sin(x)\n  if floor(x) != n produce A(x, floor(x))\nA(x, n) < L(c): if floor(x) > n produce L(c + 1)";
    assert_eq!(at(text, 2.0)[1].1, [0.0]);
}

/// The last value of a function of a whole part, and the number of its changes, of an x that moves from `start` at a rate until t = 3, with
/// jumps at quarters only.
fn counted_through(start: f64, rate: f64, f: &dyn Fn(f64) -> f64) -> [f64; 3] {
    let mut times: Vec<f64> = (-60..=60).map(|quarter| (f64::from(quarter) / 4.0 - start) / rate).collect();
    times.retain(|time| (0.0..3.0).contains(time));
    times.extend([0.0, 3.0]);
    times.sort_by(f64::total_cmp);
    let values: Vec<f64> = times.windows(2).map(|ends| f(start + rate * (ends[0] + ends[1]) / 2.0)).collect();
    let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
    [values[0], values[values.len() - 1], changes as f64]
}

#[test]
fn conditions_that_jump_as_a_whole_hold_behind_the_jump() {
    type Law = (&'static str, fn(f64) -> f64);
    let laws: [Law; 11] = [
        ("max(floor(x), -1)", |x| x.floor().max(-1.0)),
        ("floor(x)*2 + 1", |x| x.floor() * 2.0 + 1.0),
        ("-floor(x)", |x| -x.floor()),
        ("abs(floor(x))", |x| x.floor().abs()),
        ("floor(x) - 2*floor(x/2)", |x| x.floor() - 2.0 * (x / 2.0).floor()),
        ("q[x + 9]", |x| [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0, 5.0, 3.0][((x + 9.0) as usize) % 10]),
        ("if x > 1 then 2 else if x >= 0 then 1 else 0", |x| {
            f64::from(u8::from(x > 1.0) + u8::from(x >= 0.0))
        }),
        ("if x - floor(x) < 0.75 then 1 else 0", |x| f64::from(u8::from(x - x.floor() < 0.75))),
        ("match floor(x) case 0: 5 case 1: 7 else 2", |x| match x.floor() {
            0.0 => 5.0,
            1.0 => 7.0,
            _ => 2.0,
        }),
        ("floor(x + 0.5*y)", |x| x.floor()),
        ("min(2, max(floor(x), 0))", |x| x.floor().clamp(0.0, 2.0)),
    ];
    let q = "const q = [3, 1, 4, 1, 5, 9, 2, 6, 5, 3, 3, 1, 4, 1, 5, 9, 2, 6, 5, 3]\nignore Q\n";
    for (number, (law, f)) in laws.iter().enumerate() {
        for case in 0..12 {
            // Starts and rates whose jumps are at no time that could be rounded to another.
            let start = f64::from((number as i32 * 7 + case * 13) % 50 * 83 - 1990) / 1000.0;
            let rate = f64::from(if case % 2 == 0 { 413 + 61 * case } else { -389 - 67 * case }) / 500.0;
            let [first, last, changes] = counted_through(start, rate, f);
            let drift = if case % 3 == 0 { " + 0*sin(x)" } else { "" };
            let condition =
                if case % 4 < 2 { format!("({law}) != n") } else { format!("({law}) > n | ({law}) < n") };
            // The same in a module of its own, and read from a neighbour; y makes a sum of what is neither.
            let alone = format!(
                "{q}initial string: A({start}, {first}, 0, 0)\nA(x, n, k, y):\n  solve dx/dt = {rate}{drift}\n  if {condition} produce A(x, ({law}), k + 1, y)"
            );
            let beside = format!(
                "{q}initial string: X({start}, 0) A({first}, 0)\nX(x, y): solve dx/dt = {rate}{drift}\nX(x, y) < A(n, k): if {condition} produce A(({law}), k + 1)"
            );
            let tuple = |text: &str, place: usize| {
                let string = at(text, 3.0);
                let counter = string.iter().find(|m| m.0 == "A").expect("it is there");
                [counter.1[place], counter.1[place + 1]]
            };
            assert_eq!(tuple(&alone, 1), [last, changes], "{alone}");
            assert_eq!(tuple(&beside, 0), [last, changes], "{beside}");
        }
    }
}

#[test]
fn whole_parts_of_sums_of_what_moves_are_counted_once() {
    for (rate, drift) in [(0.71, ""), (-0.83, ""), (0.71, " + 0*sin(x)"), (-0.83, " + 0*sin(x)")] {
        for (name, whole) in [("floor", f64::floor as fn(f64) -> f64), ("ceil", f64::ceil)] {
            for (start, other) in [(0.31, 0.2), (-1.27, -0.35), (1.9, 0.05)] {
                // Their sum moves from start + 0.4.
                let [first, last, changes] = counted_through(start + 0.4, rate + other, &|sum| whole(sum));
                let movers = format!("dx/dt = {rate}{drift}");
                let sums = [
                    (
                        format!("{name}(p + z)"),
                        format!(
                            "initial string: X({start}) A({first}, 0, 0.4)\nX(x): solve {movers}\nX(p) < A(n, k, z):\n  solve dz/dt = {other}\n"
                        ),
                    ),
                    (
                        format!("{name}(sum(M(w): w))"),
                        format!(
                            "initial string: A({first}, 0, 0) [ M_a({start}) ] M_b(0.4)\nM_a(x): solve {movers}\nM_b(x): solve dx/dt = {other}\nA(n, k, z):\n"
                        ),
                    ),
                ];
                for (sum, rules) in sums {
                    let text = format!("{rules}  if {sum} != n produce A({sum}, k + 1, z)");
                    for method in [Method::Auto, Method::Dop853, Method::Radau] {
                        let settings = Settings { method, ..Settings::default() };
                        let string = run(&text, settings, &[3.0])
                            .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
                            .remove(0);
                        let counter = string.iter().find(|m| m.0 == "A").expect("it is there");
                        assert_eq!(counter.1[..2], [last, changes], "{method:?}: {text}");
                    }
                }
            }
        }
    }
    // As many modules as the whole part has changed by: what is handed on is the value of the instant, not a rounding of it.
    let text = "ignore F\ninitial string: C(-3, 3, 0)\nC(x, n, k):\n  solve dx/dt = -2\n  if ceil(-x) != n produce C(x, ceil(-x), k + 1) for i in 1 .. abs(ceil(-x) - n): ( F(ceil(-x)) )\ninterpret F(a): ε";
    let string = at(text, 2.25);
    assert_eq!(string[0].1[1..], [8.0, 5.0]);
    assert_eq!(string.len(), 6);
}

/// Where the time is known from two sides, by a whole part and by a comparison of it, one of which comes a rounding before the other.
#[test]
fn comparisons_of_whole_parts_in_rates_are_seen_wherever_the_value_begins() {
    for (k, whole) in (1..60).flat_map(|k| [(k, 2.0), (k, 0.0), (k, -1.0)]) {
        let start = whole + f64::from(k) / 64.0 + 0.003;
        for (condition, sign) in [
            (format!("floor(y) > {whole}"), 1.0),
            (format!("floor(y) = {whole} + 1"), 1.0),
            (format!("ceil(y) <= {whole}"), -1.0),
            (format!("floor(y) < {whole}"), -1.0),
        ] {
            let rate = 0.7 * sign;
            let level = if sign > 0.0 { whole + 1.0 } else { whole };
            let met = (level - start) / rate;
            let t = met + 0.37;
            let text = format!(
                "initial string: A(0, {start})\nA(x, y): solve dx/dt = if {condition} then 1 else 2, dy/dt = {rate}"
            );
            reaches(&text, t, "A", &[2.0 * met + 0.37, start + rate * t]);
        }
    }
}

/// A remainder: even and odd whole parts.
#[test]
fn remainders_of_whole_parts_change_rates_at_each_whole_number() {
    // y passes 3, 4, …, 8; x grows by 1 a unit of time where the whole part is even, else by 2.
    let odd = "if floor(y) - 2*floor(y/2) = 0 then 1 else 2";
    let text = format!(
        "initial string: A(0, 2.9, 2)\nA(x, y, n):\n  solve dx/dt = {odd}, dy/dt = 1\n  if floor(y) > n produce A(x, y, floor(y))"
    );
    reaches(&text, 5.4, "A", &[0.1 + 2.0 + 1.0 + 2.0 + 1.0 + 2.0 + 0.3, 8.3, 8.0]);
    // Falling, through zero: even from 2 to 0 exclusive of ends that count with the whole number below.
    let text = format!("initial string: A(0, 1.4)\nA(x, y): solve dx/dt = {odd}, dy/dt = -1");
    reaches(&text, 4.0, "A", &[2.0 * 0.4 + 1.0 + 2.0 + 1.0 + 2.0 * 0.6, -2.6]);
}

/// A whole part of what jumps itself is no comparison of what moves.
#[test]
fn whole_parts_of_whole_parts_are_counted_at_their_jumps() {
    let text = "initial string: A(-1.7, -1, 0)\nA(x, n, k):\n  solve dx/dt = 1\n  if floor(0.5*floor(x)) != n produce A(x, floor(0.5*floor(x)), k + 1)";
    reaches(text, 1.69, "A", &[-0.01, -1.0, 0.0]);
    reaches(text, 2.31, "A", &[0.61, 0.0, 1.0]);
    reaches(text, 6.0, "A", &[4.3, 2.0, 3.0]);
    let text = "initial string: A(-0.5, -2.25, -2, 0)\nA(x, y, n, k):\n  solve dx/dt = -1.25, dy/dt = 1.5\n  if floor(0.5*floor(x + y)) != n produce A(x, y, floor(0.5*floor(x + y)), k + 1)";
    reaches(text, 3.7, "A", &[-5.125, 3.3, -1.0, 1.0]);
    let text = "initial string: A(0, 0.3)\nA(x, y): solve dx/dt = if floor(y) - floor(floor(y)/2)*2 < 0.5 then 1 else 3, dy/dt = 1";
    reaches(text, 2.0, "A", &[0.7 + 3.0 + 0.3, 2.3]);
}

/// What jumps in a sum over what is attached jumps in the sum.
#[test]
fn jumps_within_aggregates_are_counted_once() {
    let sum = "sum(Leaf(w, r): if w > 1 then 1 else 0)";
    let ripe = format!(
        "initial string: Stem(0, 0) [ Leaf(-1.048, 1.606) ] [ Leaf(-0.437, 0.66) ]\nStem(n, k): if {sum} != n produce Stem({sum}, k + 1)\nLeaf(w, r): solve dw/dt = r"
    );
    reaches(&ripe, 5.0, "Stem", &[2.0, 2.0]);
    // Falling from 0.5 through 0, -1 and -2.
    for (form, end) in [
        ("sum(M(w): floor(w))", -3.0),
        ("largest(M(w): floor(w))", -3.0),
        ("floor(sum(M(w): floor(w))/1)", -3.0),
        ("2*floor(sum(M(w): ceil(w)))", -4.0),
    ] {
        let text = format!(
            "initial string: Q(0, 0) [ M(0.5) ]\nQ(n, k): if {form} != n produce Q({form}, k + 1)\nM(w): solve dw/dt = -1"
        );
        // One production at once where it does not begin at 0, and one for each whole number.
        let count = if form.contains("ceil") { 4.0 } else { 3.0 };
        reaches(&text, 3.2, "Q", &[end, count]);
    }
    let both = "sum(M(w, r): floor(w) - 2*floor(w/2))";
    let text = format!(
        "initial string: Q(0, 0) [ M(0.3, 1) ] [ M(0.45, -0.7) ]\nQ(n, k): if {both} != n produce Q({both}, k + 1)\nM(w, r): solve dw/dt = r"
    );
    // The first is odd from 0.7 to 1.7, the second from 0.45/0.7 to 1.45/0.7.
    for (t, n, k) in [(0.6, 0.0, 0.0), (0.66, 1.0, 1.0), (1.0, 2.0, 2.0), (1.9, 1.0, 3.0), (2.1, 0.0, 4.0)] {
        reaches(&text, t, "Q", &[n, k]);
    }
}

/// A neighbour's own event gives a value its level; whoever counts its jumps at the same instant asks that, and not a rounding of it.
#[test]
fn jumps_of_a_neighbour_that_has_an_event_there_are_counted_once() {
    // u falls by 0.97 a unit of time to 1, then by 2.016.
    let t = 3.71828;
    let u: f64 = 1.0 - 2.016 * (t - 1.943 / 0.97);
    let odd = "floor(u) - 2*floor(0.5*u)";
    let text = format!(
        "initial string: A(0.729, -1.075, -2, 0) B(2.943, -2.941, 3, 0)\n\
         A(x, y, n, k) > B(u, w, m, j):\n  solve dx/dt = if m <= -1 then -2.193 else -1.767, dy/dt = 0.572\n  if {odd} != n produce A(x, y, {odd}, k + 1)\n\
         A(x, y, n, k) < B(u, w, m, j):\n  solve du/dt = if m >= 1 then -0.97 else -2.016, dw/dt = 1.109\n  if floor(u) != m produce B(u, w, floor(u), j + 1)"
    );
    let string = at(&text, t);
    let a = string.iter().find(|module| module.0 == "A").expect("one");
    let whole = u.floor();
    // Once at the beginning, and at each whole number.
    assert_eq!(a.1[2..], [whole - 2.0 * (whole / 2.0).floor(), 1.0 + 2.0 - whole], "{string:?}");
}
