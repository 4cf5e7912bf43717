//! Linear equations without stages: Taylor polynomials of the solution.
//!
//! Where the rates are `y' = A y + b(t)`, with constant A, each further Taylor coefficient of y takes one product of A and a vector, and
//! the polynomial is the dense output: no rates are evaluated at stages, and no length is tried in vain. Neighbours outside a region
//! follow polynomials, too, and closed forms that are sums of exponentials are further unknowns. With the largest row sum of A as its
//! norm, all terms that are left out are bounded together; what polynomials of low degree lose against those of many powers is known
//! ([`economy_error`]).
//!
//! Source: the coefficients of an autonomous linear system, E. Hairer, S. P. Nørsett, G. Wanner, "Solving Ordinary Differential
//! Equations I", 2nd ed. 1993, section I.8.

mod rows;

pub use rows::{MANY, Members};

use crate::world::coupled_solution::CoupledSolution;
use dlsys_ode::{Dense, Economized, LEAST_DEGREE, MAX_DEGREE, MAX_POWER, economy_error};
use dlsys_tree::SimTime;
use rows::{Clauses, Rows};
use smallvec::SmallVec;

/// The part of the tolerated error of a step up to which the bound is let: estimates of pairs are far above their errors, the bound is
/// not, and a further power takes little. But no further than to rounding.
const SHARE: f64 = 0.1;
const ROUNDING: f64 = 1e-14;
/// The part of that which the powers that are left out may have: the error of the end, which is carried on.
const TAIL: f64 = 0.01;
/// Polynomials serve up to this tolerance. Above it, `auto` has short steps of low order, in which fewer approaches to a level are in doubt.
pub const LOOSEST: f64 = 1e-4;
/// The part of the length that the bound allows which is taken.
const SAFETY: f64 = 0.9;
/// The longest piece, in units of the inverse of the norm: terms of alternating sign lose no more than three digits.
const LONGEST: f64 = 2.5;
/// The length of the first step, in the same units, and the factor by which the next one may be longer: how many events there are is not
/// known, and each has to be answered up to the end of the step.
const FIRST: f64 = 0.25;
const GROWTH: f64 = 4.0;
/// The same where the error ended the last one: what is tried in vain takes more powers.
const GAIN: f64 = 1.2;
/// A common step in which a component falls below this part of what it was is cut into halves, up to so many times: its error is taken to be
/// relative to the largest value within a step.
const LEFT: f64 = 0.5;
const MOST_HALVINGS: usize = 3;
/// More pieces than this up to the end of the common step take longer than steps of a pair.
const MOST_PIECES: usize = 8;

/// Equations, and the memory for their Taylor coefficients.
#[derive(Clone, Debug, Default)]
pub struct Taylor {
    clauses: Clauses,
    rows: Rows,
    /// The Taylor coefficients of all rows, in units of the length of the piece, by power in the order of [`Taylor::place`].
    powers: Vec<f64>,
    /// The ends of the closed forms, whose rows are the last.
    ends: Vec<f64>,
    /// The length that is to be tried for the next common step; 0 before the first.
    next: f64,
    /// Products of a row and a vector so far.
    products: u64,
}

/// What limits a piece.
#[derive(Clone, Copy)]
struct Span<'s> {
    from: SimTime,
    /// It goes to this instant, or to one from which some pieces as long go there.
    end: Option<SimTime>,
    /// The trajectories of the inputs.
    solution: Option<&'s CoupledSolution>,
    /// The error, relative to the values at the start or to the way that the first rates go.
    tolerance: f64,
}

impl Taylor {
    /// Products of a row and a vector so far.
    pub fn products(&self) -> u64 {
        self.products
    }

    /// Appends the dense output of a region from an instant to the end of the common step, one piece or several, given the values of
    /// its components then. False, with nothing appended, where equations are not linear with constant coefficients, or steps of a pair
    /// are faster. `tolerance`: what is tolerated of a step. `known`: the error so far.
    pub fn solve(
        &mut self,
        region: Members,
        solution: &CoupledSolution,
        (y, now): (&[f64], SimTime),
        (tolerance, known): (f64, f64),
        stretches: &mut Vec<Dense>,
    ) -> bool {
        // Readers of formulas may be coupled and have no equations of their own.
        if y.is_empty() || self.rows.write(&mut self.clauses, region, y, now).is_none() {
            return false;
        }
        let begun = stretches.len();
        let (mut from, mut error) = (now, known);
        while solution.end.since(from) > 0.0 {
            let (end, solution) = (Some(solution.end), Some(solution));
            let span = Span { from, end, solution, tolerance: share(tolerance) };
            let piece = if stretches.len() < begun + MOST_PIECES { self.piece(span) } else { None };
            let Some(mut dense) = piece else {
                stretches.truncate(begun);
                return false;
            };
            error += dense.error;
            (from, dense.error) = (dense.end, error);
            stretches.push(dense);
        }
        true
    }

    /// The dense output of all coupled modules from an instant on, as far as its error is tolerated, but no further than to a limit; see
    /// [`Taylor::solve`]. Its error is that of this step alone.
    pub fn step(
        &mut self,
        members: Members,
        (y, now): (&[f64], SimTime),
        limit: Option<SimTime>,
        tolerance: f64,
    ) -> Option<Dense> {
        self.rows.write(&mut self.clauses, members, y, now)?;
        let norm = self.rows.norm;
        let longest = if self.next > 0.0 { LONGEST.min(self.next * norm) } else { FIRST };
        let far = now.after(longest / norm);
        if norm <= 0.0 || far.since(now) <= 0.0 {
            return None;
        }
        let end = limit.filter(|limit| limit.since(far) < 0.0).unwrap_or(far);
        let mut span = Span { from: now, end: Some(end), solution: None, tolerance: share(tolerance) };
        let mut dense = self.piece(span);
        for _ in 0..MOST_HALVINGS {
            let Some(found) = dense.as_ref().filter(|dense| falls(dense)) else { break };
            span.end = Some(now.after(0.5 * found.h));
            // The first coefficients are the values at the start.
            let n = self.rows.y.len();
            self.rows.y.copy_from_slice(&self.powers[..n]);
            dense = self.piece(span);
        }
        if let Some(dense) = &dense {
            self.next = dense.h * if dense.end == end { GROWTH } else { GAIN };
        }
        if self.rows.y.len() > MANY {
            (self.rows, self.powers, self.ends) = Default::default();
        }
        dense
    }

    /// The polynomials along a span, or along a part of it in which their error is tolerated, and that error. The values at their end are
    /// those that the next piece begins with.
    fn piece(&mut self, span: Span) -> Option<Dense> {
        let Span { from, solution, tolerance, .. } = span;
        let mut end = span.end?;
        for input in &self.rows.inputs {
            let (dense, _) = solution?.stretch(input.component as usize, from)?;
            if dense.end.since(end) < 0.0 {
                end = dense.end;
            }
        }
        let whole = end.since(from);
        if whole <= 0.0 {
            return None;
        }
        // The end is known better than the start and a length.
        let cut =
            |parts: f64| if parts > 1.0 { (whole / parts, from.after(whole / parts)) } else { (whole, end) };
        let mut parts = (self.rows.norm * whole / LONGEST).ceil().max(1.0);
        if parts > MOST_PIECES as f64 {
            return None;
        }
        let (room, end) = cut(parts);
        for input in &mut self.rows.inputs {
            let (dense, component) = solution?.stretch(input.component as usize, from)?;
            input.powers = dense.powers(component, dense.position(from), dense.position(end));
            input.powers.iter_mut().for_each(|power| *power *= input.coefficient);
        }
        let (sizes, left_out, scale) = self.raise(room, tolerance);
        let tolerated = tolerance * scale;
        let error = |degree: usize| (left_out + economy_error(degree, &sizes)) / tolerated;
        let degrees = LEAST_DEGREE..=MAX_DEGREE;
        let degree = degrees.clone().find(|degree| error(*degree) <= 1.0).unwrap_or(MAX_DEGREE);
        let (mut error, mut shorter) = (error(degree), 1.0);
        if error.is_nan() {
            // Some component has no size, and nothing is left out.
            return None;
        }
        if error > 1.0 {
            let more = (error.powf(1.0 / (MAX_DEGREE + 1) as f64) / SAFETY).ceil();
            // Of a component that begins from rest the size falls with the length.
            let is_fit = more * parts <= MOST_PIECES as f64 && self.least_scale(more) > 0.5 * scale;
            if !is_fit {
                return None;
            }
            (parts, error, shorter) = (parts * more, 1.0, more);
        }
        let (h, end) = cut(parts);
        let mut dense = self.economize(degree, sizes.len(), (room, shorter)).dense((from, end, h));
        dense.error = tolerance * error;
        let (of_components, of_formulas) = self.rows.y.split_at_mut(self.rows.components);
        for (component, y) in of_components.iter_mut().enumerate() {
            *y = *dense.of(component).last()?;
        }
        of_formulas.copy_from_slice(&self.ends);
        self.rows.y.iter().all(|y| y.is_finite()).then_some(dense)
    }

    /// Polynomials of a degree for those of so many powers along a length, in a piece so many times shorter; their ends, too.
    /// Of many rows the powers are made once more: all of them would be the most that a large tissue takes.
    fn economize(&mut self, degree: usize, powers: usize, (room, shorter): (f64, f64)) -> Economized {
        let (n, components) = (self.rows.y.len(), self.rows.components);
        let mut economized = Economized::new(degree, components, shorter);
        self.ends.clear();
        self.ends.resize(n - components, 0.0);
        if n <= MANY {
            economized.add(&self.powers[..powers * n], n);
            if n == components {
                return economized;
            }
        }
        let mut factor = 1.0;
        for power in 0..powers {
            if n > MANY && power > 1 {
                self.differentiate(power, room);
            }
            let known = &self.powers[self.place(power) * n..][..n];
            if n > MANY {
                economized.add(known, n);
            }
            self.ends.iter_mut().zip(&known[components..]).for_each(|(end, a)| *end += factor * a);
            factor /= shorter;
        }
        economized
    }

    /// Where the coefficients of a power stand. Of many rows, those of the first two are kept, and of the others two at a time.
    #[inline]
    fn place(&self, power: usize) -> usize {
        if self.rows.y.len() > MANY && power > 1 { 2 + power % 2 } else { power }
    }

    /// Makes the coefficients of a power from those of the one before; see [`Rows::differentiate`].
    #[inline]
    fn differentiate(&mut self, power: usize, room: f64) -> [f64; 2] {
        let n = self.rows.y.len();
        let [last, next] = [power - 1, power].map(|power| self.place(power) * n);
        if self.powers.len() < next + n {
            // There is room for the least number of powers, then for each one more.
            let least = if n > MANY { 4 } else { LEAST_DEGREE + 1 };
            self.powers.resize(next.max((least - 1) * n) + n, 0.0);
        }
        let (low, high) = self.powers.split_at_mut(last.max(next));
        let (last, next) = match last < next {
            true => (&low[last..last + n], &mut high[..n]),
            false => (&high[..n], &mut low[next..next + n]),
        };
        self.products += n as u64;
        self.rows.differentiate(power - 1, last, next, room)
    }

    /// Makes the coefficients of as many powers as count along a length: gives the largest of the components for each power, a bound of all
    /// others together, and [`Taylor::least_scale`].
    fn raise(&mut self, room: f64, tolerance: f64) -> (SmallVec<[f64; MAX_POWER + 1]>, f64, f64) {
        self.powers.clear();
        self.powers.extend_from_slice(&self.rows.y);
        let (mut sizes, mut scale) = (SmallVec::new(), 0.0);
        // That of the values counts nowhere.
        sizes.push(0.0);
        for power in 1..=MAX_POWER {
            let [size, all] = self.differentiate(power, room);
            sizes.push(size);
            if power == 1 {
                scale = self.least_scale(1.0);
            }
            if power >= LEAST_DEGREE {
                let left_out = self.left_out(power, all, room);
                if left_out <= TAIL * tolerance * scale || power == MAX_POWER {
                    return (sizes, left_out, scale);
                }
            }
        }
        (sizes, f64::INFINITY, scale)
    }

    /// A bound of all terms beyond a power together, given the largest coefficient of that.
    fn left_out(&self, power: usize, last: f64, room: f64) -> f64 {
        let theta = self.rows.norm * room;
        let (mut term, mut sum, mut power) = (last, 0.0, power);
        while power <= MAX_DEGREE {
            let inflow: f64 = self.rows.inputs.iter().map(|input| input.powers[power].abs()).sum();
            term = (theta * term + room * inflow) / (power + 1) as f64;
            sum += term;
            power += 1;
        }
        let ratio = theta / (power + 1) as f64;
        if ratio < 1.0 { sum + term * ratio / (1.0 - ratio) } else { f64::INFINITY }
    }

    /// The least of the sizes that errors of components are relative to, in a length so many times smaller than that of which there are
    /// coefficients.
    fn least_scale(&self, parts: f64) -> f64 {
        let rates = &self.powers[self.rows.y.len()..];
        let scales =
            self.rows.y[..self.rows.components].iter().zip(rates).map(|(y, a)| y.abs().max(a.abs() / parts));
        scales.fold(f64::INFINITY, f64::min)
    }
}

/// True if some component falls by much.
fn falls(dense: &Dense) -> bool {
    (0..dense.components()).any(|component| match dense.of(component) {
        [first, .., last] => last.abs() < LEFT * first.abs(),
        _ => false,
    })
}

/// The part of what is tolerated of a step that a piece may have.
fn share(tolerance: f64) -> f64 {
    (SHARE * tolerance).max(ROUNDING).min(tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_rows_few_powers_and_coefficients_are_kept_with_the_same_result() {
        const CELLS: usize = MANY / 2 + 1;
        let mut shorter = [0, 0];
        for (length, digits) in (1..=5).flat_map(|length| (3..=12).map(move |digits| (length, digits))) {
            let (end, tolerance) = (SimTime::new(3.0 * f64::from(length)), 0.1f64.powi(digits));
            let solve = |filaments: usize| {
                let rows = Rows::of_filaments(filaments, CELLS);
                let mut taylor = Taylor { rows, ..Taylor::default() };
                let span = Span { from: SimTime::ZERO, end: Some(end), solution: None, tolerance };
                taylor.piece(span).map(|dense| (dense, taylor))
            };
            let (one, two) = (solve(1), solve(2));
            assert_eq!(one.is_some(), two.is_some(), "{length}, {digits}");
            let (Some((one, few)), Some((two, many))) = (one, two) else { continue };
            assert_eq!((one.start, one.end, one.h, one.error), (two.start, two.end, two.h, two.error));
            for cell in 0..CELLS {
                assert_eq!([two.of(cell), two.of(CELLS + cell)], [one.of(cell); 2], "cell {cell}");
            }
            // The ends, with those of the closed forms.
            assert_eq!(many.rows.y[2 * CELLS..], [few.rows.y[CELLS]; 2]);
            assert_eq!(many.rows.y[CELLS..2 * CELLS], few.rows.y[..CELLS]);
            assert_eq!(many.powers.len(), 4 * many.rows.y.len());
            assert!(few.rows.kept() == CELLS + 1 && many.rows.kept() < CELLS, "{}", many.rows.kept());
            shorter[usize::from(one.end.since(end) < 0.0)] += 1;
        }
        assert!(shorter.iter().all(|count| *count > 0), "{shorter:?}");
    }
}
