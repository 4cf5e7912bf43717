//! Crossings, touches and jumps that the search has to find, and near misses that it must not.

use super::*;
use dlsys_expr::{Binary, Unary, Value};

/// A function given once, for every type of value.
struct Given<F, G>(F, G);

impl<F: Fn(f64) -> f64, G: Fn(Dual<Interval>) -> Dual<Interval>> Function for Given<F, G> {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        (self.1)(Dual { value: Interval::spanned(lo, hi), rate: Interval::constant(1.0) })
    }
    fn value(&mut self, at: f64) -> f64 {
        (self.0)(at)
    }
}

macro_rules! given {
    ($x:ident => $body:expr) => {
        Given(
            move |$x: f64| {
                type T = f64;
                #[allow(unused)]
                fn c(x: f64) -> T {
                    T::constant(x)
                }
                $body(c, f64::binary, f64::unary)
            },
            move |$x: Dual<Interval>| {
                type T = Dual<Interval>;
                #[allow(unused)]
                fn c(x: f64) -> T {
                    T::constant(x)
                }
                $body(c, T::binary, T::unary)
            },
        )
    };
}

/// (x - a)(x - b)
fn parabola(a: f64, b: f64) -> impl Function {
    given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
        op(Binary::Mul, op(Binary::Sub, x, c(a)), op(Binary::Sub, x, c(b)))
    })
}

#[test]
fn both_crossings_of_a_close_pair_are_found() {
    let (a, b) = (0.3, 0.3 + 1e-6);
    let first = first_root(&mut parabola(a, b), 0.0, 1.0, Sign::Plus, 1e-15).expect("a root");
    assert!((first.position - a).abs() < 1e-9, "{first:?}");
    assert_eq!(first.after, Sign::Minus);
    let second = first_root(&mut parabola(a, b), first.position, 1.0, Sign::Minus, 1e-15).expect("a root");
    assert!((second.position - b).abs() < 1e-9, "{second:?}");
}

#[test]
fn a_touch_is_found_once_and_a_near_miss_is_not() {
    let touch = first_root(&mut parabola(0.3, 0.3), 0.0, 1.0, Sign::Plus, 1e-15).expect("a touch");
    assert!((touch.position - 0.3).abs() < 1e-7 && touch.after == Sign::Plus, "{touch:?}");
    let rest = first_root(&mut parabola(0.3, 0.3), touch.position, 1.0, Sign::Plus, 1e-15);
    assert_eq!(rest, None);
    let mut miss = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
        let d = op(Binary::Sub, x, c(0.3));
        op(Binary::Add, op(Binary::Mul, d, d), c(1e-12))
    });
    assert_eq!(first_root(&mut miss, 0.0, 1.0, Sign::Plus, 1e-15), None);
}

#[test]
fn what_passes_through_infinity_does_not_meet_zero() {
    // 1/(0.3 - x) + 0.5 rises to infinity, and comes back from below.
    let mut f = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
        op(Binary::Add, op(Binary::Div, c(1.0), op(Binary::Sub, c(0.3), x)), c(0.5))
    });
    for to in [1.0, 0.3, 0.3 + 1e-16] {
        let root = first_root(&mut f, 0.0, to, Sign::Plus, 1e-15);
        assert!(root.is_none_or(|root| root.at != Sign::Zero), "up to {to}: {root:?}");
    }
}

#[test]
fn what_ends_on_zero_to_the_last_bit_has_not_crossed_it() {
    // 1 - sin(x) is 0 in numbers within 1e-8 of its touch.
    let mut f = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, un: fn(Unary, T) -> T| {
        op(Binary::Sub, c(1.0), un(Unary::Sin, op(Binary::Mul, c(4.0), x)))
    });
    let touch = first_root(&mut f, 0.0, 1.0, Sign::Plus, 1e-13).expect("a touch");
    assert_eq!((touch.at, touch.after), (Sign::Zero, Sign::Plus), "{touch:?}");
    // min(x, 1/2) - 1/2 rests there from the middle on, max(min(x, 1/2), x - 1/4) - 1/2 up to three quarters.
    let mut rests = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
        let rest = op(Binary::Min, x, c(0.5));
        op(Binary::Sub, op(Binary::Max, rest, op(Binary::Sub, x, c(0.25))), c(0.5))
    });
    let root = first_root(&mut rests, 0.0, 1.0, Sign::Minus, 1e-15).expect("a root");
    assert_eq!((root.position, root.at, root.after), (0.5, Sign::Zero, Sign::Zero));
    let leaves = first_root(&mut rests, 0.5, 1.0, Sign::Zero, 1e-15).expect("a root");
    assert!((leaves.position - 0.75).abs() < 1e-12 && leaves.after == Sign::Plus, "{leaves:?}");
}

#[test]
fn corners_that_touch_zero_are_found_wherever_they_are() {
    for i in 1..200 {
        let at = f64::from(i) * 0.005;
        let mut f = given!(x => |k: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
            let d = op(Binary::Sub, x, k(at));
            op(Binary::Max, op(Binary::Mul, d, k(-1.0)), op(Binary::Mul, d, k(3.0)))
        });
        let touch = first_root(&mut f, 0.0, 1.0, Sign::Plus, 1e-16);
        assert!(
            touch.is_some_and(|t| (t.position - at).abs() < 1e-15 && t.at == Sign::Zero),
            "{at}: {touch:?}"
        );
    }
}

#[test]
fn flat_touches_are_found_wherever_the_step_begins() {
    // 1 + 3 (x - c)^4 - 1, written out as a polynomial, whose bounds are wider.
    for i in 0..60 {
        let at = 0.01 * f64::from(i) + 0.203;
        let mut f = given!(x => |k: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
            let add = |a, b| op(Binary::Add, a, b);
            let mul = |a, b| op(Binary::Mul, a, b);
            let rest = add(k(-12.0 * at), mul(k(3.0), x));
            let rest = add(k(18.0 * at * at), mul(rest, x));
            let rest = add(k(-12.0 * at * at * at), mul(rest, x));
            op(Binary::Sub, add(k(1.0 + 3.0 * at * at * at * at), mul(rest, x)), k(1.0))
        });
        let touch = first_root(&mut f, 0.0, 1.0, Sign::Plus, 6e-14);
        assert!(
            touch.is_some_and(|t| (t.position - at).abs() < 1e-3 && t.at == Sign::Zero),
            "{at}: {touch:?}"
        );
    }
}

#[test]
fn a_crossing_with_a_kink_is_no_touch() {
    // max(a (x - c), b (x - c)) has no rate at c; the tolerance is a thousand times what rounding makes of it.
    for (a, b) in [(-1.0 / 2.6, -2.5), (-2.5, -1.0 / 2.6)] {
        let mut f = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
            let d = op(Binary::Sub, x, c(0.62));
            op(Binary::Max, op(Binary::Mul, d, c(a)), op(Binary::Mul, d, c(b)))
        });
        let root = first_root(&mut f, 0.0, 1.0, Sign::Plus, 1e-13).expect("a root");
        assert!((root.position - 0.62).abs() < 1e-15 && root.after == Sign::Minus, "{root:?}");
        assert_eq!(first_root(&mut f, root.position, 1.0, root.after, 1e-15), None);
    }
}

#[test]
fn a_crossing_at_the_very_end_is_not_left_to_what_follows() {
    // As rounding has it, sin(2 π) is still below zero.
    let mut f = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, un: fn(Unary, T) -> T| {
        let t = op(Binary::Add, x, c(1.0));
        op(Binary::Sub, c(0.0), un(Unary::Sin, op(Binary::Mul, c(std::f64::consts::PI), t)))
    });
    let root = first_root(&mut f, 1e-14, 1.0, Sign::Plus, 1e-15).expect("a root");
    assert_eq!((root.position, root.after), (1.0, Sign::Minus));
}

#[test]
fn a_root_with_nothing_beyond_it_is_found() {
    // sqrt(0.5 - x) - 0.1 is undefined from 0.5 on.
    let mut f = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, un: fn(Unary, T) -> T| {
        op(Binary::Sub, un(Unary::Sqrt, op(Binary::Sub, c(0.5), x)), c(0.1))
    });
    let root = first_root(&mut f, 0.0, 1.0, Sign::Plus, 1e-15).expect("a root");
    assert!((root.position - 0.49).abs() < 1e-14, "{root:?}");
}

#[test]
fn the_identically_zero_function_has_no_roots() {
    let mut zero = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, _: fn(Unary, T) -> T| {
        op(Binary::Mul, x, c(0.0))
    });
    assert_eq!(first_root(&mut zero, 0.0, 1.0, Sign::Zero, 1e-15), None);
}

#[test]
fn one_of_a_thousand_oscillations_is_the_first() {
    let mut f = given!(x => |c: fn(f64) -> T, op: fn(Binary, T, T) -> T, un: fn(Unary, T) -> T| {
        op(Binary::Sub, un(Unary::Sin, op(Binary::Mul, x, c(6000.0))), c(0.5))
    });
    let root = first_root(&mut f, 0.0, 1.0, Sign::Minus, 1e-15).expect("a root");
    assert!((root.position - std::f64::consts::FRAC_PI_6 / 6000.0).abs() < 1e-15, "{root:?}");
}

/// 1 but for a dip of a width of 1e-4 at 0.9, with bounds that are of use over short stretches only.
struct Dip {
    stretch: f64,
}

impl Function for Dip {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        let near = hi > 0.899 && lo < 0.901;
        let value = match (hi - lo > 1e-4, near) {
            (true, _) => Interval { lo: -1.0, hi: 1.0, partial: false },
            (_, true) => Interval::ENTIRE,
            _ => Interval { lo: 0.9, hi: 1.0, partial: false },
        };
        Dual { value, rate: Interval::ENTIRE }
    }

    fn value(&mut self, at: f64) -> f64 {
        let x = (at - 0.9) / 1e-4;
        1.0 - 1.5 * (-x * x).exp()
    }

    fn stretch(&self) -> f64 {
        self.stretch
    }
}

#[test]
fn what_varies_fast_is_searched_in_stretches() {
    let find = |stretch: f64| first_root(&mut Dip { stretch }, 0.0, 1.0, Sign::Plus, 1e-12);
    let exact = 0.9 - 1e-4 * f64::sqrt(f64::ln(1.5));
    let root = find(0.01).expect("there is one");
    assert!((root.position - exact).abs() < 1e-11 && root.after == Sign::Minus, "{root:?}");
    // At once, it takes more pieces than there may be.
    assert!(find(f64::INFINITY).is_none_or(|root| (root.position - exact).abs() > 1e-6));
}

/// A function that jumps up by 1 at one half and falls between jumps at a constant rate: its bounds say that it jumps just after one half.
struct Rounded {
    rate: f64,
    level: f64,
}

impl Rounded {
    fn at(&self, jumped: bool, at: f64) -> f64 {
        f64::from(u8::from(jumped)) - self.rate * at - self.level
    }
}

impl Function for Rounded {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        let rate = Interval::constant(-self.rate);
        let [before, after] = [hi <= 0.5, lo >= 0.5];
        let value = Interval { lo: self.at(after, hi), hi: self.at(!before, lo), partial: !before && !after };
        Dual { value, rate: Interval { partial: value.partial, ..rate } }
    }
    fn value(&mut self, at: f64) -> f64 {
        self.at(at >= 0.5, at)
    }
}

#[test]
fn a_jump_is_seen_where_bounds_are_rounded_another_way() {
    for (rate, level) in [(1.0, 0.45), (0.0, 0.6), (0.1, 0.9), (0.01, 0.5)] {
        let root = first_root(&mut Rounded { rate, level }, 0.0, 1.0, Sign::Minus, 1e-15);
        let expected = Root { position: 0.5, at: Sign::Plus, after: Sign::Plus };
        assert!(root.is_some_and(|root| (root.position - 0.5).abs() < 1e-12), "{rate} {level}: {root:?}");
        assert_eq!(root.map(|root| Root { position: 0.5, ..root }), Some(expected), "{rate} {level}");
    }
}
