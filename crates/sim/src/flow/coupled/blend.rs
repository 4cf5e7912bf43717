//! Dense output of algebraic components: polynomials through points at which they were solved for.
//!
//! Between the ends of a step the integrated components are polynomials. The algebraic components are solved for at
//! eight Chebyshev points, ends included, and interpolated. Between the points the interpolant is compared with the
//! solution itself; where it errs by more than a step may, the stretch is halved. So events on algebraic components are
//! located like all others, on polynomials with bounds.
//!
//! A stretch begins exactly where the one before ended, for example with the value on which an event was located.
//! Solving there again gives another value within the tolerance; the difference vanishes within the first stretch.

use std::sync::LazyLock;

use crate::flow::coupled::algebra::AlgebraicError;
use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::meeting::{AT_ENDS, Determinants, Meeting, POSITIONS};
use dlsys_expr::eliminate;
use dlsys_ode::{Dense, MAX_DEGREE};

pub const POINTS: usize = MAX_DEGREE + 1;
/// Most stretches of a step.
const MAX_STRETCHES: usize = 64;
/// The positions in a stretch at which the interpolant is compared with the solution.
pub const BETWEEN: [f64; 3] = [0.02, 0.37, 0.9];
/// A kink makes an error so many times as large as the one that is found there.
pub const KINK: f64 = 10.0;
/// What is found there may be rounding, up to so many times that of the values.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A stretch of at most so many times the resolution of time is not halved any more.
pub const NARROW: f64 = 16.0;
/// What the interpolant may miss in so narrow a stretch, in place of the tolerance: a root that begins or ends changes that fast. More is a jump.
const STEEP: f64 = 1e-3;

/// The points, and for each coefficient in Bernstein form the weights of the values there.
static INTERPOLATION: LazyLock<([f64; POINTS], [[f64; POINTS]; POINTS])> = LazyLock::new(|| {
    let angle = |i: usize| std::f64::consts::PI * i as f64 / MAX_DEGREE as f64;
    let points: [f64; POINTS] = std::array::from_fn(|i| 0.5 - 0.5 * angle(i).cos());
    let mut choose = [1.0; POINTS];
    for j in 1..POINTS {
        choose[j] = choose[j - 1] * (POINTS - j) as f64 / j as f64;
    }
    let basis = |s: f64, j: usize| choose[j] * s.powi(j as i32) * (1.0 - s).powi((MAX_DEGREE - j) as i32);
    let mut weights = [[0.0; POINTS]; POINTS];
    for i in 0..POINTS {
        let mut matrix: Vec<f64> =
            points.iter().flat_map(|s| (0..POINTS).map(|j| basis(*s, j)).collect::<Vec<_>>()).collect();
        let mut unit = [0.0; POINTS];
        unit[i] = 1.0;
        eliminate(&mut matrix, &mut unit);
        for (j, weight) in unit.into_iter().enumerate() {
            weights[j][i] = weight;
        }
    }
    (points, weights)
});

/// The positions in a stretch at which components are solved for: the points of interpolation, and those between them.
pub fn positions() -> [f64; POINTS + BETWEEN.len()] {
    let points = &INTERPOLATION.0;
    std::array::from_fn(|n| n.checked_sub(POINTS).map_or_else(|| points[n], |between| BETWEEN[between]))
}

/// The coefficients of the polynomial through the values at the points of interpolation.
pub fn interpolate(values: &[f64; POINTS]) -> [f64; POINTS] {
    let weights = &INTERPOLATION.1;
    let mut c: [f64; POINTS] =
        std::array::from_fn(|j| weights[j].iter().zip(values).map(|(w, v)| w * v).sum());
    (c[0], c[MAX_DEGREE]) = (values[0], values[MAX_DEGREE]);
    c
}

/// The reason why the algebraic components of a step cannot be followed.
#[derive(Clone, Copy, Debug)]
pub enum BlendError {
    /// They cannot be solved for somewhere, or take too many stretches.
    Unsolved(AlgebraicError),
    /// Two solutions meet.
    Meeting(Meeting),
}

impl From<AlgebraicError> for BlendError {
    fn from(error: AlgebraicError) -> BlendError {
        BlendError::Unsolved(error)
    }
}

impl Equations<'_> {
    /// The dense output of a step from the state `start`, with its algebraic components, as one stretch or several.
    ///
    /// # Errors
    /// If the algebraic components cannot be solved for somewhere, or take too many stretches, or if two solutions meet.
    pub fn blend(&mut self, step: &Dense, start: &[f64], tolerance: f64) -> Result<Vec<Dense>, BlendError> {
        let unknowns: Vec<usize> =
            self.system.algebra.unknowns.iter().map(|unknown| unknown.component as usize).collect();
        let mut stretches: Vec<Dense> = Vec::new();
        let mut last = start.to_vec();
        // A stack of the pieces that are left.
        let mut pieces = vec![(0.0, 1.0)];
        let mut watched = self.watched();
        while let Some((lo, hi)) = pieces.pop() {
            let points = &INTERPOLATION.0;
            let mut determinants = vec![Determinants::default(); watched.blocks.len()];
            let mut values = vec![[0.0; POINTS]; unknowns.len()];
            let mut state = last.clone();
            for (i, s) in points.iter().enumerate() {
                self.follow(step, lo + s * (hi - lo), &mut state)?;
                for (values, &c) in values.iter_mut().zip(&unknowns) {
                    values[i] = state[c];
                }
                let place = (&mut determinants[..], i);
                self.determinants(&mut watched, (lo + s * (hi - lo)) * step.h, &state, place);
            }
            let end = state.clone();
            let mut all: Vec<[f64; POINTS]> = values.iter().map(interpolate).collect();
            let narrow = (hi - lo) * step.h <= NARROW * step.end.resolution();
            let allowed = if narrow { STEEP } else { tolerance };
            let mut fits = true;
            let mut misfits: Vec<(u32, f64)> = unknowns.iter().map(|c| (*c as u32, 0.0)).collect();
            let mut state = last.clone();
            for (i, s) in BETWEEN.into_iter().enumerate() {
                self.follow(step, lo + s * (hi - lo), &mut state)?;
                let place = (&mut determinants[..], POINTS + i);
                self.determinants(&mut watched, (lo + s * (hi - lo)) * step.h, &state, place);
                for (((c, values), &place), misfit) in
                    all.iter().zip(&values).zip(&unknowns).zip(&mut misfits)
                {
                    let (off, there) = ((Dense::at(c, s) - state[place]).abs(), state[place].abs());
                    fits &= off <= allowed * there.max(1.0);
                    if off > ROUNDING * values.iter().fold(0.0, |size: f64, v| size.max(v.abs())) {
                        misfit.1 = misfit.1.max(KINK * off);
                    }
                }
            }
            for (place, s, from) in [(POSITIONS - 2, AT_ENDS, &last), (POSITIONS - 1, 1.0 - AT_ENDS, &end)] {
                if fits && !watched.blocks.is_empty() {
                    state.clone_from(from);
                    self.follow(step, lo + s * (hi - lo), &mut state)?;
                    let tau = (lo + s * (hi - lo)) * step.h;
                    self.determinants(&mut watched, tau, &state, (&mut determinants[..], place));
                }
            }
            if !fits {
                if stretches.len() + pieces.len() + 2 > MAX_STRETCHES {
                    return Err(AlgebraicError::Rough(unknowns.first().copied().unwrap_or(0)).into());
                }
                let middle = 0.5 * (lo + hi);
                pieces.extend([(middle, hi), (lo, middle)]);
                continue;
            }
            for (which, seen) in determinants.iter().enumerate().filter(|(_, seen)| seen.may_vanish(1.0)) {
                if let Some(meeting) = self.meeting(step, (lo, hi), &last, (&mut watched, which), seen) {
                    return Err(BlendError::Meeting(meeting));
                }
            }
            for (c, place) in all.iter_mut().zip(&unknowns) {
                c[0] = last[*place];
            }
            let mut stretch = step.with(lo, hi, &unknowns, &all);
            // What the polynomials miss is an error like that of integration: a touch within it is not decided.
            misfits.retain(|misfit| misfit.1 > 0.0);
            if !misfits.is_empty() {
                misfits.sort_unstable_by_key(|misfit| misfit.0);
                (stretch.error, stretch.misfits) =
                    (stretch.error.max(f64::EPSILON), misfits.into_boxed_slice());
            }
            stretches.push(stretch);
            last = end;
        }
        Ok(stretches)
    }

    /// Moves a state to a nearby position in a step.
    pub fn follow(&mut self, step: &Dense, position: f64, state: &mut [f64]) -> Result<(), AlgebraicError> {
        let system = self.system;
        for (component, value) in state.iter_mut().enumerate() {
            if !system.algebra.is_solved(component as u32) {
                *value = step.value(component, position);
            }
        }
        self.make_consistent(position * step.h, state)
    }
}
