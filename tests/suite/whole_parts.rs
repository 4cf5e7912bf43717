//! Random conditions on whole parts, in rates, clauses and productions: places within a period, remainders, multiples. Each against what is
//! counted or added up by hand.

use dlsys::sim::{Method, Settings};
use proptest::prelude::*;

use crate::common::run;

/// The productions of `k*t - c - floor(k*t - c) < p & age > 0.4` up to a time; all but the rate k in units of 1/6000, so that all times are whole
/// numbers.
fn productions_in_periods(k: i64, c: i64, p: i64, end: i64) -> u32 {
    const UNIT: i64 = 6000;
    let (mut t, mut n) = (0, 0);
    loop {
        let ripe = t + 2 * UNIT / 5;
        let place = (k * ripe - c).rem_euclid(UNIT);
        t = if place < p { ripe } else { ripe + (UNIT - place) / k };
        match t < end {
            true => n += 1,
            false => return n,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn a_place_within_a_period_is_reached_once_in_each(
        k in 1..4i64, c in 1..100i64, p in 1..50i64, method in 0..3usize,
        rate in prop::sample::select(vec!["x", "sin(t)", "floor(3*t)", "floor(2.3*t)", "if floor(1.7*t) > 1 then 1 else 2"]),
    ) {
        // Multiples of 60, so that all times are whole.
        let n = productions_in_periods(k, 60 * c, 60 * p, 14_227);
        let (c, p) = (c as f64 / 100.0, p as f64 / 100.0);
        let text = format!(
            "initial string: A(0.9, 0)\nA(x, n):\n  solve dx/dt = {rate}\n  if {k}*t - {c} - floor({k}*t - {c}) < {p} & age > 0.4 produce A(x, n + 1)"
        );
        let method = [Method::Auto, Method::Dopri5, Method::Radau][method];
        let strings = run(&text, Settings { method, ..Settings::default() }, &[14_227.0 / 6000.0]);
        let string = strings.unwrap_or_else(|error| panic!("{error}\n{text}")).remove(0);
        prop_assert_eq!(string[0].1[1], f64::from(n), "{}", text);
    }
}

/// sinh(asinh(start) + speed t), whose rate is speed √(1 + y²): there is no formula for it in the program.
fn sinh(start: f64, speed: f64, t: f64) -> f64 {
    (start.asinh() + speed * t).sinh()
}

/// The times at which it is a whole number, from 0 to some time, with these.
fn times_of_whole_numbers(start: f64, speed: f64, end: f64) -> Vec<f64> {
    let bounds = [0.0, end].map(|t| sinh(start, speed, t));
    let (low, high) = (bounds[0].min(bounds[1]).ceil() as i32, bounds[0].max(bounds[1]).floor() as i32);
    let reached = |whole: i32| (f64::from(whole).asinh() - start.asinh()) / speed;
    let mut times: Vec<f64> = (low..=high).map(reached).chain([0.0, end]).collect();
    times.sort_by(f64::total_cmp);
    times
}

/// A rate that depends on the whole part of y, as it is written and as a number.
type Rate = (&'static str, fn(f64) -> f64);

const OF_WHOLE_PARTS: [Rate; 8] = [
    ("if floor(y) - 2*floor(y/2) = 0 then 2 else 1", |f| 2.0 - f.rem_euclid(2.0)),
    ("if floor(y) > 2*floor(y/2) then 1 else 2", |f| 2.0 - f.rem_euclid(2.0)),
    ("match floor(y) - 4*floor(y/4) case 0: 2 case 1: 1.5 case 2: 0.3 else 1", |f| {
        [2.0, 1.5, 0.3, 1.0][f.rem_euclid(4.0) as usize]
    }),
    ("match 2*floor(y) case 2: 2 case 0: 1.5 else 0.5", |f| match f {
        1.0 => 2.0,
        0.0 => 1.5,
        _ => 0.5,
    }),
    ("if 2*floor(y) = 2 then 2 else 0.5", |f| if f == 1.0 { 2.0 } else { 0.5 }),
    ("if floor(y)^2 = 1 then 2 else 0.5", |f| if f.abs() == 1.0 { 2.0 } else { 0.5 }),
    ("if floor(y)/2 = 1 then 2 else 0.5", |f| if f == 2.0 { 2.0 } else { 0.5 }),
    ("if sign(y - floor(y) - 2) = 0 then 9 else floor(y)/8", |f| f / 8.0),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn rates_by_whole_parts_of_what_is_integrated_are_those_of_the_present_part(
        which in 0..OF_WHOLE_PARTS.len(), start in -4.0..4.0f64, method in 0..3usize, as_clauses in prop::bool::ANY,
        speed in prop_oneof![-1.3..-0.4f64, 0.4..1.3f64],
    ) {
        let (rate, of) = OF_WHOLE_PARTS[which];
        let end = 3.0;
        let times = times_of_whole_numbers(start, speed, end);
        let expected: f64 = times.windows(2).map(|t| (t[1] - t[0]) * of(sinh(start, speed, 0.5 * (t[0] + t[1])).floor())).sum();
        let flow = format!("dy/dt = {speed:?}*sqrt(1 + y^2)");
        let body = if as_clauses && which == 0 {
            format!("\n  if floor(y) - 2*floor(y/2) = 0 solve dx/dt = 2, {flow}\n  if floor(y) - 2*floor(y/2) = 1 solve dx/dt = 1, {flow}")
        } else {
            format!(" solve dx/dt = {rate}, {flow}")
        };
        let text = format!("initial string: A(0, {start:?})\nA(x, y):{body}");
        let method = [Method::Auto, Method::Dopri5, Method::Radau][method];
        let strings = run(&text, Settings { method, ..Settings::default() }, &[end]);
        let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error}\n{text}")).remove(0);
        let found = string[0].1[0];
        prop_assert!((found - expected).abs() < 1e-4 * expected.abs().max(1.0), "{:?}: {}, not {}\n{}", method, found, expected, text);
    }
}

#[test]
fn a_sign_that_is_zero_at_an_instant_holds_nothing_up() {
    let text = "initial string: A(0, 2.295, 2.286)\nA(x, y, z):\n  solve dx/dt = if 2*sign(y - z) = 0 then 2 else 0.5, dy/dt = 0.532*(-1.064 - y), dz/dt = -1.5";
    for method in [Method::Auto, Method::Dopri5, Method::Radau] {
        let strings = run(text, Settings { method, ..Settings::default() }, &[3.0]);
        let x = strings.unwrap_or_else(|error| panic!("{method:?}: {error}"))[0][0].1[0];
        assert!((x - 1.5).abs() < 1e-5, "{method:?}: {x}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn rates_and_productions_may_ask_for_the_same(
        (condition, holds) in prop::sample::select(vec![
            ("floor(y) - 2*floor(y/2) = 0", (|f| f.rem_euclid(2.0) == 0.0) as fn(f64) -> bool),
            ("floor(y) - 3*floor(y/3) = 1", |f| f.rem_euclid(3.0) == 1.0),
            ("2*floor(y) = 2", |f| f == 1.0),
            ("floor(y)^2 = 1", |f| f.abs() == 1.0),
        ]),
        start in -4.0..4.0f64, speed in prop_oneof![-1.3..-0.4f64, 0.4..1.3f64], integrated in prop::bool::ANY,
    ) {
        let end = 3.0;
        let times = times_of_whole_numbers(start, speed, end);
        let (mut x, mut n, mut state) = (0.0, 0.0, false);
        for t in times.windows(2) {
            let now = holds(sinh(start, speed, 0.5 * (t[0] + t[1])).floor());
            x += (t[1] - t[0]) * if now { 2.0 } else { 1.0 };
            n += f64::from(u8::from(std::mem::replace(&mut state, now) != now));
        }
        let text = format!(
            "initial string: A(0, {start:?}, 0, 0)\nA(x, y, s, n):\n  solve dx/dt = if {condition} then 2 else 1, dy/dt = {speed:?}*sqrt(1 + y^2)\n  \
             if s = 0 & {condition} produce A(x, y, 1, n + 1)\n  if s = 1 & !({condition}) produce A(x, y, 0, n + 1)"
        );
        let method = if integrated { Method::Dopri5 } else { Method::Auto };
        let strings = run(&text, Settings { method, ..Settings::default() }, &[end]);
        let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error}\n{text}")).remove(0);
        let found = &string[0].1;
        prop_assert!((found[0] - x).abs() < 1e-4 * x.max(1.0) && found[3] == n, "{:?}, not {}, {}\n{}", found, x, n, text);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn rates_and_productions_may_ask_for_the_same_of_a_neighbour(
        (condition, holds) in prop::sample::select(vec![
            ("floor(y) - 2*floor(y/2) = 0", (|f| f.rem_euclid(2.0) == 0.0) as fn(f64) -> bool),
            ("floor(y) - 3*floor(y/3) = 1", |f| f.rem_euclid(3.0) == 1.0),
            ("floor(y)^2 = 1", |f| f.abs() == 1.0),
        ]),
        start in -4.0..4.0f64, speed in prop_oneof![-1.3..-0.4f64, 0.4..1.3f64], method in 0..3usize,
    ) {
        let end = 3.0;
        let (mut x, mut n, mut state) = (0.0, 0.0, false);
        for t in times_of_whole_numbers(start, speed, end).windows(2) {
            let now = holds(sinh(start, speed, 0.5 * (t[0] + t[1])).floor());
            x += (t[1] - t[0]) * if now { 2.0 } else { 1.0 };
            n += f64::from(u8::from(std::mem::replace(&mut state, now) != now));
        }
        let text = format!(
            "initial string: B({start:?}) A(0, 0, 0)\nB(y): solve dy/dt = {speed:?}*sqrt(1 + y^2)\nB(y) < A(x, s, n):\n  solve dx/dt = if {condition} then 2 else 1\n  \
             if s = 0 & {condition} produce A(x, 1, n + 1)\n  if s = 1 & !({condition}) produce A(x, 0, n + 1)"
        );
        let method = [Method::Auto, Method::Dopri5, Method::Radau][method];
        let strings = run(&text, Settings { method, ..Settings::default() }, &[end]);
        let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error}\n{text}")).remove(0);
        let found = &string[1].1;
        prop_assert!((found[0] - x).abs() < 1e-4 * x.max(1.0) && found[2] == n, "{:?}: {:?}, not {} {}\n{}", method, found, x, n, text);
    }

    #[test]
    fn sums_of_what_jumps_are_those_of_the_present_parts(
        starts in prop::collection::vec((-3.0..3.0f64, prop_oneof![-1.1..-0.2f64, 0.2..1.1f64]), 1..4),
        (term, of) in prop::sample::select(vec![
            ("sum(M(w, r): floor(w))", (|f| f.iter().sum()) as fn(&[f64]) -> f64),
            ("largest(M(w, r): floor(w))", |f| f.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
            ("sum(M(w, r): floor(w) - 2*floor(w/2))", |f| f.iter().map(|f| f.rem_euclid(2.0)).sum()),
            ("sum(M(w, r): if w >= 1 then 1 else 0)", |f| f.iter().filter(|f| **f >= 1.0).count() as f64),
        ]),
        integrated in prop::bool::ANY, method in 0..3usize,
    ) {
        let end = 3.0;
        let at = |(start, speed): (f64, f64), t: f64| if integrated { sinh(start, speed, t) } else { start + speed * t };
        let times_of = |start: f64, speed: f64| match integrated {
            true => times_of_whole_numbers(start, speed, end),
            false => (-7..8).map(|whole| (f64::from(whole) - start) / speed).chain([0.0, end]).filter(|t| (0.0..=end).contains(t)).collect(),
        };
        let mut times: Vec<f64> = starts.iter().flat_map(|(start, speed)| times_of(*start, *speed)).collect();
        times.sort_by(f64::total_cmp);
        let mut expected = 0.0;
        for t in times.windows(2) {
            let parts: Vec<f64> = starts.iter().map(|one| at(*one, 0.5 * (t[0] + t[1])).floor()).collect();
            expected += (t[1] - t[0]) * of(&parts);
        }
        let attached: Vec<String> = starts.iter().map(|(start, speed)| format!("[ M({start:?}, {speed:?}) ]")).collect();
        let flow = if integrated { "r*sqrt(1 + w^2)" } else { "r" };
        let text = format!("initial string: Q(0) {}\nQ(x): solve dx/dt = {term}\nM(w, r): solve dw/dt = {flow}", attached.join(" "));
        let method = [Method::Auto, Method::Dopri5, Method::Radau][method];
        let strings = run(&text, Settings { method, ..Settings::default() }, &[end]);
        let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error}\n{text}")).remove(0);
        let found = string[0].1[0];
        prop_assert!((found - expected).abs() < 2e-5 * expected.abs().max(1.0), "{:?}: {}, not {}\n{}", method, found, expected, text);
    }
}

/// The instant of one of its jumps, by the numbers of a step, is a rounding before it by those of the next.
#[test]
fn a_jump_is_behind_by_the_numbers_of_the_next_step_too() {
    let text = "initial string: B(2.651428815840137) A(0, 0, 0)
B(y): solve dy/dt = 1.2471818362544163*sqrt(1 + y^2)
B(y) < A(x, s, n):
  solve dx/dt = if floor(y) - 3*floor(y/3) = 1 then 2 else 1
  if s = 0 & floor(y) - 3*floor(y/3) = 1 produce A(x, 1, n + 1)
  if s = 1 & !(floor(y) - 3*floor(y/3) = 1) produce A(x, 0, n + 1)";
    for method in [Method::Auto, Method::Dopri5, Method::Radau] {
        let strings = run(text, Settings { method, ..Settings::default() }, &[3.0]);
        let string = strings.unwrap_or_else(|error| panic!("{method:?}: {error}")).remove(0);
        assert_eq!(string[1].1[2], 75.0, "{method:?}");
    }
}
