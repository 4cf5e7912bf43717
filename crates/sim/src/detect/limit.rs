//! Limits of a parameter among the places at which two sides meet.
//!
//! A module that comes near a limit never arrives there, but its numbers do: at last they are those of the limit, or a rounding beyond it. Where the sides
//! of a condition meet at limits only, the analysis of the model shows it, and they are not compared at all. `abs(x) = 1` has two places,
//! and under `dx/dt = 1 - x` one of them is the limit; which of them a value comes to is known when it does. There, the sides and the rate of the
//! parameter vanish at one place, and the rate at all times and whatever else moves: by uniqueness of solutions nothing arrives there.

use super::crossing::CrossingDetector;
use crate::world::path::Path;
use dlsys_expr::{Dual, Interval};
use dlsys_model::ZeroCrossing;

/// Steps of Newton's method from the number that has come near to the place itself.
const STEPS: usize = 8;
/// It is no further away than this part of its size, or than values are known,
const NEAR: f64 = 1e-3;
/// and is known up to this part of it.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// What else moves is taken to move by this part of its size, or of 1.
const ELSEWHERE: f64 = 1e-3;

impl CrossingDetector {
    /// True if the sides of an atom, which seem to meet at a position, or to have come near each other there, do so at a limit of the only
    /// parameter that moves in them.
    pub(super) fn is_limit(&mut self, path: &Path, atom: usize, position: f64) -> bool {
        // Sides that meet at one value only have been judged for all values (`dlsys_compile`).
        let crossing = &path.rule.zero_crossings(path.state.solve.get())[atom];
        if !matches!(crossing, ZeroCrossing::Search { sum: None, level: None }) {
            return false;
        }
        let mut moving = path.rule.atom_reads[atom].iter().copied().filter(|v| path.moves(*v));
        let (Some(pivot), None) = (moving.next(), moving.next()) else { return false };
        let Some(solve) = path.state.solve.get().map(|solve| &path.rule.solves[solve]) else { return false };
        let Some(output) = solve.of.iter().position(|parameter| *parameter == pivot) else { return false };
        path.at(0.0, &mut self.values);
        let first = self.values[pivot];
        path.everything_at(position, &mut self.values);
        let come = (self.values[pivot] - first).abs();
        let Some(place) = self.meeting_place(path, atom, pivot, come) else { return false };
        let own = path.world.tree.parameters(path.state.id).len();
        let variables = path.rule.variables;
        let around = |(v, &x): (usize, &f64)| {
            let is_still = v < own && !path.moves(v) || v >= variables;
            let width = match v == pivot {
                true => ROUNDING * place.abs(),
                false if is_still => 0.0,
                false => ELSEWHERE * x.abs().max(1.0),
            };
            let centre = if v == pivot { place } else { x };
            let rate = if v == pivot { 1.0 } else { 0.0 };
            Dual {
                value: Interval::spanned(centre - width, centre + width),
                rate: Interval::spanned(rate, rate),
            }
        };
        let all: Vec<Dual<Interval>> = self.values.iter().enumerate().map(around).collect();
        let nothing = Dual { value: Interval::EMPTY, rate: Interval::EMPTY };
        let mut rates = vec![nothing; solve.rates.outputs()];
        solve.rates.eval(&all, &mut Default::default(), &mut rates);
        let Dual { value, rate: bend } = rates[output];
        // Where the bend is infinite solutions are not unique: x' = -sqrt(x) reaches 0.
        let is_smooth = !value.partial && !bend.partial && bend.magnitude().is_finite();
        is_smooth && value.magnitude() <= 2.0 * ROUNDING * place.abs() * bend.magnitude()
    }

    /// The value of a variable at which the sides of an atom meet, near the present one or no further away than that has `come` on this path, or
    /// than the error of integration: a step may begin where the one before has overshot a limit at 0.
    /// `self.values` has those of all variables.
    fn meeting_place(&mut self, path: &Path, atom: usize, pivot: usize, come: f64) -> Option<f64> {
        let start = self.values[pivot];
        let mut variables: Vec<Dual<f64>> =
            self.values.iter().map(|&value| Dual { value, rate: 0.0 }).collect();
        let (sides, mut scratch) = (&path.rule.sides, Vec::new());
        let mut out = vec![Dual { value: 0.0, rate: 0.0 }; sides.outputs()];
        let mut place = start;
        for _ in 0..STEPS {
            variables[pivot] = Dual { value: place, rate: 1.0 };
            sides.eval(&variables[..path.rule.variables], &mut scratch, &mut out);
            let (a, b) = (out[2 * atom], out[2 * atom + 1]);
            let step = (a.value - b.value) / (a.rate - b.rate);
            if !step.is_finite() {
                return None;
            }
            place -= step;
            if step == 0.0 {
                break;
            }
        }
        let size = start.abs().max(place.abs());
        let near = come.max(NEAR * size).max(path.error() * size.max(1.0));
        ((place - start).abs() <= near).then_some(place)
    }
}
