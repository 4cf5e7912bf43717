//! A plant written with curves, arrays, `match`, `let` and growth functions, and the same plant simplified by hand, with a
//! rule for each element of an array and each case of a `match`, piecewise cubic polynomials for curves, and polynomials
//! for growth laws.

use std::fmt::Write;

use dlsys::tree::ModuleString;

/// Points of the curve: how fast an internode grows at which age.
const DRIVE: [[f64; 2]; 4] = [[0.0, 0.0], [0.5, 1.2], [1.5, 0.6], [4.0, 0.5]];
const SPREAD: [f64; 4] = [22.0, 31.0, 27.0, 35.0];
const FINAL: [f64; 4] = [1.0, 1.6, 2.2, 1.4];
const VIGOUR: [f64; 4] = [1.0, 1.3, 1.1, 0.8];

/// The two plants agree to this part of themselves.
pub const AGREEMENT: f64 = 1e-9;

/// Some axes, each with an apex that makes internodes and leaves. They begin with different sizes, so that no two lives are
/// the same.
pub fn with_blocks(axes: usize) -> String {
    let list = |values: [f64; 4]| values.map(|x| x.to_string()).join(", ");
    let points = DRIVE.map(|[x, y]| format!("({x}, {y})")).join(" ");
    let cases: String = (0..3).map(|n| format!(" case {n}: {}", VIGOUR[n])).collect();
    format!(
        "const spread = [{}]\nconst final = [{}]\ncurve linear drive = {points}\n\
         def vigour(n) = match n{cases} else {}\n\
         def next(n) = match n case {}: 0 else n + 1\n\
         initial string: {}\n\
         A(x, n):\n  let limit = final[n]\n\
         \x20 if x < limit solve dx/dt = vigour(n)*drive(age)\n\
         \x20 if x = limit produce F(x) [ +(spread[n]) L(0.05, n) ] A(x/20, next(n))\n\
         L(s, n):\n  let limit = final[n]/2\n\
         \x20 if s < 0.9limit solve ds/dt = logistic_rate(s, limit, 2)\n\
         \x20 if s = 0.9limit produce M(s)\n{MARK}",
        list(SPREAD),
        list(FINAL),
        VIGOUR[3],
        FINAL.len() - 1,
        axis(axes, |x| format!("A({x}, 0)")),
    )
}

/// The same by hand.
pub fn by_hand(axes: usize) -> String {
    let mut text = format!("initial string: {}\n{MARK}", axis(axes, |x| format!("A_0({x})")));
    for n in 0..4 {
        let mut rate = String::new();
        for pair in DRIVE.windows(2) {
            let ([x, y], [to, end]) = (pair[0], pair[1]);
            // One product less for each number that is known.
            let (a, b) = (VIGOUR[n] * y, VIGOUR[n] * (end - y) / (to - x));
            let _ = write!(rate, "if age < {to} then {a} + {b}*(age - {x}) else ");
        }
        let _ = write!(rate, "{}", VIGOUR[n] * DRIVE[3][1]);
        let (limit, next) = (FINAL[n], (n + 1) % 4);
        let _ = write!(
            text,
            "A_{n}(x):\n  if x < {limit} solve dx/dt = {rate}\n\
             \x20 if x = {limit} produce F(x) [ +({}) L_{n}(0.05) ] A_{next}(x/20)\n\
             L_{n}(s):\n  if s < {} solve ds/dt = 2*s*(1 - s/{})\n  if s = {} produce M(s)\n",
            SPREAD[n],
            0.9 * (limit / 2.0),
            limit / 2.0,
            0.9 * (limit / 2.0),
        );
    }
    text
}

/// A grown leaf marks a place.
const MARK: &str = "interpret M(s): F(s)\n";

fn axis(axes: usize, apex: impl Fn(f64) -> String) -> String {
    (0..axes).map(|i| format!("[ {} ] ", apex(0.5 * i as f64 / axes as f64))).collect()
}

/// The number of modules without brackets, and the sum of their first parameters.
pub fn summary(string: &ModuleString) -> (usize, f64) {
    let modules = string.iter().filter(|module| !module.kind.is_bracket());
    modules.fold((0, 0.0), |(count, sum), module| {
        (count + 1, sum + module.parameters.first().copied().unwrap_or(0.0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{scale, solver};
    use dlsys::sim::Settings;

    #[test]
    fn both_are_the_same_plant() {
        let at = |text: &str| {
            assert!(solver::session(text).expect("good").model.is_closed_form(), "{text}");
            let times = [0.7, 3.1, 9.0];
            let (strings, _) = scale::states(text, Settings::default(), &times).expect("it runs");
            strings.iter().map(summary).collect::<Vec<_>>()
        };
        for (a, b) in at(&with_blocks(3)).into_iter().zip(at(&by_hand(3))) {
            assert_eq!(a.0, b.0);
            assert!((a.1 - b.1).abs() <= AGREEMENT * b.1, "{a:?} {b:?}");
        }
    }
}
