//! Limits of a parameter among the places at which two sides meet.
//!
//! A module that comes near a limit never arrives there, but its numbers do: at last they are those of the limit, or a rounding beyond it. Where the sides
//! of a condition meet at limits only, the analysis of the model shows it, and they are not compared at all. `abs(x) = 1` has two places,
//! and under `dx/dt = 1 - x` one of them is the limit; which of them a value comes to is known when it does. There, the sides and the rate of the
//! parameter vanish at one place, and the rate at all times and whatever else moves: by uniqueness of solutions nothing arrives there.

use super::crossing::CrossingDetector;
use crate::detect::signs::sign_of;
use crate::world::path::Path;
use dlsys_expr::{Dual, Interval, Program};
use dlsys_model::{Sign, ZeroCrossing};

/// Steps of Newton's method from the number that has come near to the limit itself.
const STEPS: usize = 8;
/// It is no further away than so many times the error of values,
const KNOWN: f64 = 16.0;
/// and is known up to this part of its size.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// What else moves is taken to move by this part of its size, or of 1.
const ELSEWHERE: f64 = 1e-3;

/// The only parameter that moves in an atom, and its rate among those of its equations.
struct Pivot<'a> {
    parameter: usize,
    rates: &'a Program,
    output: usize,
}

/// What becomes of sides that seem to meet.
#[derive(Clone, Copy, Default, PartialEq)]
pub(super) enum Arrival {
    /// They do so at no limit.
    #[default]
    Elsewhere,
    /// They approach each other at a limit, and nothing ever arrives there.
    Never,
    /// They meet at a limit and at another place so close by that the errors of integration do not say whether the value has passed it.
    Unclear,
}

impl CrossingDetector {
    /// Whether the sides of an atom, which seem to meet at a position, or to have come near each other there, do so at a limit of the only
    /// parameter that moves in them. The sign is that of their difference before.
    pub(super) fn arrival(&mut self, path: &Path, atom: usize, position: f64, sign: Sign) -> Arrival {
        self.limit_near(path, atom, position, sign).unwrap_or_default()
    }

    fn limit_near(&mut self, path: &Path, atom: usize, position: f64, sign: Sign) -> Option<Arrival> {
        // Sides that meet at one value only have been judged for all values (`dlsys_compile`).
        let crossing = &path.rule.zero_crossings(path.state.solve.get())[atom];
        if !matches!(crossing, ZeroCrossing::Search { sum: None, level: None }) {
            return None;
        }
        let mut moving = path.rule.atom_reads[atom].iter().copied().filter(|v| path.moves(*v));
        let (Some(parameter), None) = (moving.next(), moving.next()) else { return None };
        let solve = &path.rule.solves[path.state.solve.get()?];
        let output = solve.of.iter().position(|moving| *moving == parameter)?;
        let pivot = Pivot { parameter, rates: &solve.rates, output };
        path.at(0.0, &mut self.values);
        let first = self.values[parameter];
        path.everything_at(position, &mut self.values);
        let here = self.values[parameter];
        let known = KNOWN * path.error().max(f64::EPSILON) * here.abs().max(1.0);
        let limit = self.resting_place(&pivot).filter(|limit| (limit - here).abs() <= known)?;
        let bend = self.bend_at_rest(path, &pivot, limit)?;
        // What moves away from where it rests meets something else; that it seems to, where all approach, is an error of values.
        let leaves = (here - limit).abs() > (first - limit).abs();
        if bend.lo > 0.0 || leaves && bend.hi >= 0.0 {
            return None;
        }
        Some(self.way_to_limit(path, atom, &pivot, [first, here], (limit, known), sign))
    }

    /// The derivative of the parameter's rate by the parameter at a place, if the rate vanishes there, whatever else moves.
    fn bend_at_rest(&mut self, path: &Path, pivot: &Pivot, place: f64) -> Option<Interval> {
        let own = path.world.tree.parameters(path.state.id).len();
        let variables = path.rule.variables;
        let around = |(v, &x): (usize, &f64)| {
            let is_still = v < own && !path.moves(v) || v >= variables;
            let width = match v == pivot.parameter {
                true => ROUNDING * place.abs(),
                false if is_still => 0.0,
                false => ELSEWHERE * x.abs().max(1.0),
            };
            let centre = if v == pivot.parameter { place } else { x };
            let rate = if v == pivot.parameter { 1.0 } else { 0.0 };
            Dual {
                value: Interval::spanned(centre - width, centre + width),
                rate: Interval::spanned(rate, rate),
            }
        };
        let all: Vec<Dual<Interval>> = self.values.iter().enumerate().map(around).collect();
        let nothing = Dual { value: Interval::EMPTY, rate: Interval::EMPTY };
        let mut rates = vec![nothing; pivot.rates.outputs()];
        pivot.rates.eval(&all, &mut Default::default(), &mut rates);
        let Dual { value, rate: bend } = rates[pivot.output];
        // Where the bend is infinite solutions are not unique: x' = -sqrt(x) reaches 0.
        let is_smooth = !value.partial && !bend.partial && bend.magnitude().is_finite();
        let rests = is_smooth && value.magnitude() <= 2.0 * ROUNDING * place.abs() * bend.magnitude();
        rests.then_some(bend)
    }

    /// What a difference that has had a sign says of its way from the first value of a path to one close by a limit: where it has the other sign in
    /// between, by more than rounding, there is another place.
    fn way_to_limit(
        &mut self,
        path: &Path,
        atom: usize,
        pivot: &Pivot,
        [first, here]: [f64; 2],
        (limit, known): (f64, f64),
        sign: Sign,
    ) -> Arrival {
        let rounding = ROUNDING * limit.abs().max(1.0);
        let mut difference = |x: f64, width: f64| {
            self.around.clear();
            self.around.extend(self.values[..path.rule.variables].iter().map(|x| Interval::spanned(*x, *x)));
            self.around[pivot.parameter] = Interval::spanned(x - width, x + width);
            self.around_out.resize(path.rule.sides.outputs(), Interval::EMPTY);
            path.rule.sides.eval(&self.around, &mut self.whole_scratch, &mut self.around_out);
            let [a, b] = [0, 1].map(|side| self.around_out[2 * atom + side]);
            if sign_of(sign) > 0.0 { [a.lo - b.hi, a.hi - b.lo] } else { [b.lo - a.hi, b.hi - a.lo] }
        };
        let has_passed = difference(first, 0.0)[1] < 0.0;
        let mut has_sign = |from: f64, is_same: bool| {
            let distances = std::iter::successors(Some(from), |distance| Some(0.5 * distance));
            let mut distances = distances.take_while(|distance| distance.abs() > 2.0 * rounding);
            distances.any(|distance| {
                let [low, high] = difference(limit + distance, rounding);
                if is_same { low > 0.0 } else { high < 0.0 }
            })
        };
        let side = known.copysign(here - limit);
        let crosses = (first - limit) * (here - limit) <= 0.0;
        // Errors lead beyond the limit, in this step or in one before.
        let other = match (crosses, has_passed) {
            (true, _) => has_sign((first - limit).clamp(-known, known), false),
            (false, true) => has_sign(side, true) || has_sign(-side, false),
            (false, false) if has_sign(here - limit, false) => return Arrival::Elsewhere,
            (false, false) => false,
        };
        if other { Arrival::Unclear } else { Arrival::Never }
    }

    /// The value at which the rate vanishes next to that of `self.values`, by Newton's method.
    fn resting_place(&self, pivot: &Pivot) -> Option<f64> {
        let constant = |&value: &f64| Dual { value, rate: 0.0 };
        let mut variables: Vec<Dual<f64>> = self.values.iter().map(constant).collect();
        let (mut rates, mut scratch) = (vec![constant(&0.0); pivot.rates.outputs()], Vec::new());
        let mut place = self.values[pivot.parameter];
        for _ in 0..STEPS {
            variables[pivot.parameter] = Dual { value: place, rate: 1.0 };
            pivot.rates.eval(&variables, &mut scratch, &mut rates);
            let Dual { value, rate } = rates[pivot.output];
            if value == 0.0 {
                return Some(place);
            }
            place -= value / rate;
        }
        place.is_finite().then_some(place)
    }
}
