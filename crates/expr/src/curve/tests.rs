//! Curves against quadrature, differences and one another.

use proptest::prelude::*;

use super::*;
use crate::Error;
use crate::{Dual, Interval, Value};

const SORTS: [Sort; 3] = [Sort::Linear, Sort::Monotone, Sort::Spline];

fn curve(sort: Sort, points: &[[f64; 2]], periodic: bool) -> Curve {
    Curve::new("g", sort, points, periodic).expect("a good curve")
}

/// Ascending points from gaps and values.
fn ascending(gaps: &[f64], values: &[f64]) -> Vec<[f64; 2]> {
    let mut x = -1.0;
    let points = gaps.iter().zip(values).map(|(gap, y)| {
        x += gap;
        [x, *y]
    });
    points.collect()
}

#[test]
fn curves_go_where_their_points_say() {
    let points = [[0.0, 0.0], [1.0, 0.3], [2.0, 1.0], [4.0, 1.2]];
    for sort in [Sort::Linear, Sort::Monotone] {
        let g = curve(sort, &points, false);
        for [x, y] in points {
            assert_eq!(g.eval(Part::Value, x), y, "{sort:?}");
        }
        assert_eq!((g.eval(Part::Value, -5.0), g.eval(Part::Value, 9.0)), (0.0, 1.2));
        assert_eq!(g.direction(), Some(1.0));
    }
    let g = curve(Sort::Linear, &points, false);
    assert!((g.eval(Part::Value, 1.5) - 0.65).abs() < 1e-15);
    assert!((g.eval(Part::Slope, 1.5) - 0.7).abs() < 1e-15);
    assert!((g.eval(Part::Integral, 4.0) - (0.15 + 0.65 + 2.2)).abs() < 1e-15);
    assert!((g.eval(Part::Integral, 6.0) - (3.0 + 2.4)).abs() < 1e-15);
    // The clamped spline of four points is their Bézier curve.
    let s = curve(Sort::Spline, &[[0.0, 0.0], [1.0, 0.0], [2.0, 1.0], [3.0, 1.0]], false);
    assert_eq!((s.eval(Part::Value, 0.0), s.eval(Part::Value, 3.0)), (0.0, 1.0));
    assert!((s.eval(Part::Value, 1.5) - 0.5).abs() < 1e-15);
    // 3 u² (1 - u) + u³ at x = 3 u.
    let u: f64 = 0.2;
    assert!((s.eval(Part::Value, 3.0 * u) - (3.0 * u * u * (1.0 - u) + u.powi(3))).abs() < 1e-15);
    // A periodic spline over evenly spaced points is the cardinal one: at a control point (1, 4, 1)/6 of the values.
    let p = curve(Sort::Spline, &[[0.0, 0.0], [1.0, 6.0], [2.0, 0.0], [3.0, 0.0]], true);
    for (x, y) in [(1.0, 4.0), (2.0, 1.0), (3.0, 1.0), (4.0, 4.0), (-2.0, 4.0)] {
        assert!((p.eval(Part::Value, x) - y).abs() < 1e-14, "{x}");
    }
}

#[test]
fn monotone_curves_do_not_overshoot() {
    let g = curve(Sort::Monotone, &[[0.0, 0.0], [1.0, 0.01], [1.1, 5.0], [3.0, 5.0], [4.0, 2.0]], false);
    assert_eq!(g.range(), (0.0, 5.0));
    assert_eq!(g.direction(), None);
    let mut last = 0.0;
    for i in 0..=300 {
        let y = g.eval(Part::Value, f64::from(i) / 100.0);
        assert!(y >= last);
        last = y;
    }
}

#[test]
fn points_that_make_no_curve() {
    let fault = |sort, points: &[[f64; 2]], periodic| Curve::new("g", sort, points, periodic).err();
    assert_eq!(fault(Sort::Linear, &[[0.0, 1.0]], false), Some(Error::TooFew(2)));
    let back = [[0.0, 1.0], [1.0, 1.0], [0.9, 2.0], [2.0, 1.0]];
    assert_eq!(fault(Sort::Spline, &back, false), Some(Error::NotAscending(2)));
    let thrice = [[0.0, 1.0], [1.0, 1.0], [1.0, 2.0], [1.0, 1.0], [2.0, 1.0]];
    assert_eq!(fault(Sort::Linear, &thrice, false), Some(Error::Crowded(3)));
    let ends = [[0.0, 1.0], [1.0, 1.0], [1.0, 2.0]];
    assert_eq!(fault(Sort::Monotone, &ends, false), Some(Error::JumpAtEnd(2)));
    assert_eq!(
        fault(Sort::Linear, &ends.map(|[x, y]| [1.0 - x, y]).into_iter().rev().collect::<Vec<_>>(), false),
        Some(Error::JumpAtEnd(1))
    );
    assert_eq!(fault(Sort::Spline, &[[1.0, 0.0]; 4], false), Some(Error::TooFew(4)));
    let open = [[0.0, 1.0], [1.0, 2.0], [2.0, 3.0]];
    assert_eq!(fault(Sort::Monotone, &open, true), Some(Error::NotClosed { first: 1.0, last: 3.0 }));
    let huge = [[0.0, -1e308], [1e-300, 1e308]];
    assert_eq!(fault(Sort::Linear, &huge, false), Some(Error::TooLarge));
}

#[test]
fn elements_are_counted_from_zero_and_rounded_down() {
    let a = Array { name: "a".to_owned(), values: vec![1.0, 2.0, 4.0] };
    let at = |i: f64| a.element(i);
    assert_eq!((at(0.0), at(0.99), at(2.5)), (1.0, 1.0, 4.0));
    assert!(at(-0.1).is_nan() && at(3.0).is_nan() && at(f64::NAN).is_nan());
    let bounds = a.over(Interval::spanned(0.5, 1.5));
    assert_eq!((bounds.lo, bounds.hi, bounds.partial), (1.0, 2.0, true));
}

proptest! {
    /// Integral and derivatives against differences; inverse against value; bounds against samples.
    #[test]
    fn parts_agree(
        gaps in proptest::collection::vec(0.1..2.0f64, 6), values in proptest::collection::vec(-2.0..2.0f64, 6),
        x in -2.0..8.0f64, width in 0.0..3.0f64, part in 0.0..1.0f64, periodic: bool,
    ) {
        let mut points = ascending(&gaps, &values);
        if periodic {
            points[5][1] = points[0][1];
        }
        for sort in SORTS {
            let g = curve(sort, &points, periodic);
            let h = 1e-5;
            for of in [Part::Integral, Part::Value, Part::Slope, Part::Second, Part::Phase] {
                let slope = of.derivative().expect("one of these");
                // Not across a knot.
                if g.eval(Part::Phase, x - h).floor() != g.eval(Part::Phase, x + h).floor() {
                    continue;
                }
                let difference = (g.eval(of, x + h) - g.eval(of, x - h)) / (2.0 * h);
                let exact = g.eval(slope, x);
                let third = g.eval(Part::Third, x).abs() + g.eval(Part::Second, x).abs() + exact.abs();
                prop_assert!((difference - exact).abs() <= 1e-4 * (1.0 + third), "{sort:?} {of:?}: {difference} {exact}");
            }
            let set = Interval::spanned(x, x + width);
            let at = x + part * width;
            for of in [Part::Value, Part::Slope, Part::Second, Part::Third, Part::Integral, Part::Phase, Part::PhaseSlope] {
                let (value, bound) = (g.eval(of, at), g.over(of, set));
                let slack = 1e-9 * (1.0 + value.abs());
                prop_assert!(bound.lo - slack <= value && value <= bound.hi + slack, "{sort:?} {of:?} {value} {bound:?}");
            }
            // A piece is the curve where it is, and smooth beyond.
            let index = g.eval(Part::Phase, at).floor();
            for of in [Part::Value, Part::Slope, Part::Integral] {
                let (own, value) = (g.continued(of, index, at), g.eval(of, at));
                prop_assert!((own - value).abs() <= 1e-12 * (1.0 + value.abs()), "{sort:?} {of:?} {own} {value}");
                let bound = g.continued_over(of, Interval::constant(index), set);
                let slack = 1e-9 * (1.0 + own.abs());
                prop_assert!(bound.lo - slack <= own && own <= bound.hi + slack, "{sort:?} {of:?} {own} {bound:?}");
            }
            let moving = Dual::curve(&g, Part::Value, Dual { value: at, rate: 2.0 });
            prop_assert_eq!(moving.rate, 2.0 * g.eval(Part::Slope, at));
        }
    }

    #[test]
    fn inverses_undo(gaps in proptest::collection::vec(0.1..2.0f64, 5), rises in proptest::collection::vec(0.1..2.0f64, 5), part in 0.0..1.0f64, falls: bool) {
        let mut points = ascending(&gaps, &ascending(&rises, &[0.0; 5]).iter().map(|p| p[0]).collect::<Vec<_>>());
        if falls {
            points.iter_mut().for_each(|p| p[1] = -p[1]);
        }
        for sort in SORTS {
            let g = curve(sort, &points, false);
            let (first, last) = g.domain();
            let x = first + part * (last - first);
            let y = g.eval(Part::Value, x);
            let back = g.eval(Part::Inverse, y);
            prop_assert!((back - x).abs() <= 1e-10, "{sort:?}: {back} {x}");
            prop_assert!(g.eval(Part::Inverse, 1e3).is_nan());
        }
    }
}

#[test]
fn two_points_with_one_x_are_a_jump() {
    let points = [[0.0, 0.0], [1.0, 1.0], [1.0, 3.0], [2.0, 3.5], [3.0, 0.0]];
    for (sort, periodic) in [(Sort::Linear, false), (Sort::Monotone, false), (Sort::Linear, true)] {
        let g = curve(sort, &points, periodic);
        let before = f64::from_bits(1f64.to_bits() - 1);
        assert!((g.eval(Part::Value, before) - 1.0).abs() < 1e-14, "{sort:?}");
        assert_eq!(g.eval(Part::Value, 1.0), 3.0, "{sort:?}");
        assert!(g.jumps(Part::Value) && g.direction().is_none());
        // No continuity over the jump, on every turn of a periodic curve; continuity beside it.
        let over = |lo: f64, hi: f64| g.over(Part::Value, Interval { lo, hi, partial: false }).partial;
        assert!(
            over(0.5, 1.5) && over(0.5, 1.0) && !over(1.0, 2.5) && !over(0.2, 0.9) && !over(2.5, 3.5),
            "{sort:?}"
        );
        assert_eq!(over(3.5, 4.5), periodic);
        assert_eq!(over(-2.5, -1.5), periodic);
    }
    let g = curve(Sort::Linear, &points, false);
    assert_eq!(g.eval(Part::Integral, 2.0), 0.5 + 3.25);
    // Each side has its own slope.
    let slopes = [0.999, 1.001].map(|x| g.eval(Part::Slope, x));
    assert!((slopes[0] - 1.0).abs() < 1e-12 && (slopes[1] - 0.5).abs() < 1e-12);
    // A rising curve with a jump has an inverse: the jump, for the values that it passes over.
    let g = curve(Sort::Linear, &points[..4], false);
    assert_eq!([1.0, 2.0, 3.0].map(|y| g.eval(Part::Inverse, y)), [1.0; 3]);
    assert!((g.eval(Part::Inverse, 3.25) - 1.5).abs() < 1e-15);
}

#[test]
fn control_points_with_one_x_are_corners() {
    // As function editors write steps: the Bézier curve of these points rises steeply and has no jump.
    let g = curve(Sort::Spline, &[[0.0, 0.0], [0.4, 0.0], [0.4, 1.0], [1.0, 1.0]], false);
    assert!(!g.jumps(Part::Value));
    // x = 1.2 u (1 - u)^2 + 1.2 u² (1 - u) + u³ and y = 3 u² (1 - u) + u³ at u = 1/2.
    assert!((g.eval(Part::Value, 0.425) - 0.5).abs() < 1e-15);
    // Two points at an end: a vertical tangent. The continuation beyond it is finite.
    let g = curve(Sort::Spline, &[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]], false);
    assert!(g.eval(Part::Value, 1e-6) > 1e-4);
    assert_eq!(g.continued(Part::Value, 0.0, -0.1), 0.0);
    // Four points at one place are a jump.
    let mut points = vec![[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.3, 0.0]];
    points.extend([[0.5, 0.0], [0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [0.5, 1.0], [0.5, 1.0]]);
    points.extend([[0.7, 1.0], [0.8, 1.0], [1.0, 1.0]]);
    let g = curve(Sort::Spline, &points, false);
    assert!(g.jumps(Part::Value));
    assert_eq!([0.4999999, 0.5].map(|x| g.eval(Part::Value, x).round()), [0.0, 1.0]);
}
