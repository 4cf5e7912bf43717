//! Instants at which solutions of implicit equations meet.
//!
//! The equations determine their unknowns while the matrix of partial derivatives is regular. Where its determinant
//! passes zero, or touches it, solutions meet, and which of them continues the one that was followed does not follow from
//! the equations. The determinant is known wherever the unknowns are solved for, so it is interpolated along with them;
//! a stretch in which the bounds of that polynomial contain zero is halved until they do not, or until it is narrow.
//!
//! A determinant that is zero is no meeting if the solution is unique all the same: for `u^3 = x` at 0, and for
//! `x*(u - 1) = 0`. The equations along the direction that is left undetermined tell: there they change sign at a
//! solution of odd order, and are zero at a factor that all solutions have in common.

use crate::flow::coupled::algebra::{Block, of};
use crate::flow::coupled::blend::{BETWEEN, KINK, NARROW, POINTS, interpolate, positions};
use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::matrix::{FEW, Matrix};
use crate::flow::coupled::newton::{Solver, Workspace};
use crate::flow::coupled::system::System;
use dlsys_expr::eliminate;
use dlsys_ode::{Dense, MAX_DEGREE};

/// A stretch of at most this part of the first one is not halved any more, and a determinant that heads for zero so near beyond its end is
/// taken to arrive there: close to a double root solutions have half their digits.
const SHORT: f64 = 1e-7;
/// The part of a stretch, at each of its ends, over which the slope of a determinant there is known: another solution may be followed from the next
/// place on.
pub const AT_ENDS: f64 = 1e-8;
/// A determinant that heads for zero at an end of a stretch, and would arrive within this part of it, may be zero there.
const HEADS: f64 = 0.03;
/// Most stretches that are looked at.
const MAX_LOOKS: usize = 400;
/// A determinant that falls below this part of its size in the step touches zero, if it does so in a narrow stretch.
const TOUCH: f64 = 1e-4;
/// The departures from a solution at which equations are compared with zero, as parts of the unknowns, from small to large: all of them in a
/// step, and those that are small where a step has failed.
const DEPARTURES: [f64; 8] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1];
const SMALL: usize = 6;
/// And those that are as small as the distance of solutions that cannot be told apart.
const CLOSE: usize = 4;
/// Unknowns are not taken to be smaller than this part of the largest component.
const SCALE: f64 = 1e-3;
/// Equations are zero at a departure if they are at most so many times what is left of them at the solution.
const LEFT: f64 = 4.0;

/// The place in a step at which solutions meet.
#[derive(Clone, Copy, Debug)]
pub struct Meeting {
    /// A component that is not determined there.
    pub component: usize,
    /// The position in the step, from 0 to 1.
    pub position: f64,
    /// The end of the stretch that was searched, over which polynomials follow what moves.
    pub reach: f64,
}

/// Determinants of one block in a stretch: at the points of interpolation, and between them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Determinants {
    /// At the points of interpolation.
    pub points: [f64; POINTS],
    /// At the positions at which the interpolant is compared.
    pub between: [f64; BETWEEN.len()],
    /// Close to both ends.
    pub at_ends: [f64; 2],
}

/// The positions in a stretch at which determinants are known: the points of interpolation, those between them, and those close to the ends.
pub const POSITIONS: usize = POINTS + BETWEEN.len() + 2;

impl Determinants {
    /// Sets the determinant at one of the [`POSITIONS`].
    pub fn set(&mut self, place: usize, determinant: f64) {
        match (place.checked_sub(POINTS), place.checked_sub(POINTS + BETWEEN.len())) {
            (_, Some(end)) => self.at_ends[end] = determinant,
            (Some(place), None) => self.between[place] = determinant,
            (None, None) => self.points[place] = determinant,
        }
    }

    /// True if the bounds of the determinant contain zero. `width`: the part of the first stretch that this one is.
    pub fn may_vanish(&self, width: f64) -> bool {
        let c = interpolate(&self.points);
        // Where it heads, a little beyond both ends.
        let beyond = MAX_DEGREE as f64 * (SHORT / width).min(1.0);
        let ends =
            [(c[0], c[1]), (c[MAX_DEGREE], c[MAX_DEGREE - 1])].map(|(end, next)| end - beyond * (next - end));
        let heads = |(end, near): (f64, f64)| end * (end + (near - end) * (HEADS / AT_ENDS)) <= 0.0;
        if heads((c[0], self.at_ends[0])) || heads((c[MAX_DEGREE], self.at_ends[1])) {
            return true;
        }
        let miss = |(s, value): (&f64, &f64)| (Dense::at(&c, *s) - value).abs();
        let slack = KINK * BETWEEN.iter().zip(&self.between).map(miss).fold(0.0, f64::max);
        let all = || c.iter().chain(&ends).copied();
        let (least, most) =
            (all().fold(f64::INFINITY, f64::min) - slack, all().fold(f64::NEG_INFINITY, f64::max) + slack);
        !(least > 0.0 || most < 0.0)
    }

    /// The largest size.
    fn size(&self) -> f64 {
        self.points.iter().chain(&self.between).map(|x| x.abs()).fold(0.0, f64::max)
    }
}

/// The blocks whose determinants are watched in a step, with the logarithms in units of which they are known.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    /// Indices of the blocks.
    pub blocks: Vec<u32>,
    /// By block: the logarithm of the determinant where it was seen first.
    units: Vec<Option<f64>>,
}

/// What equations do along the direction in which they leave their unknowns undetermined.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// They have the same sign on both sides: two solutions meet.
    Even,
    /// They change sign.
    Odd,
    /// They are zero: solutions have a factor in common.
    Flat,
}

/// Determinants of a block in a stretch of a step.
struct Sample {
    determinants: Determinants,
    /// The state at the end, if it is solved for everywhere.
    end: Vec<f64>,
    /// The least size of the determinant, and the position and the state there.
    least: (f64, f64, Vec<f64>),
    is_solved: bool,
}

/// All [`POSITIONS`], by their numbers: what is close to the start first, and what is close to the end last, where the end is known.
fn places() -> [(usize, f64); POSITIONS] {
    let all = positions();
    std::array::from_fn(|n| match n {
        0 => (POSITIONS - 2, AT_ENDS),
        n if n <= all.len() => (n - 1, all[n - 1]),
        _ => (POSITIONS - 1, 1.0 - AT_ENDS),
    })
}

impl Equations<'_> {
    /// The blocks whose partial derivatives change in a step.
    pub fn watched(&self) -> Watched {
        let System { algebra, table, .. } = self.system;
        let is_constant = |block: &Block| {
            block.unknowns.iter().all(|unknown| {
                let row = &table.rows[algebra.unknowns[*unknown as usize].row as usize];
                let mut terms = self.rules[row.rule].aggregates.iter();
                of(self.rules, row).jacobian.values.constants().is_some()
                    && terms.all(|aggregate| aggregate.jacobian.values.constants().is_some())
            })
        };
        let changes = |block: &Block| !block.explicit && !is_constant(block);
        let blocks = (0..).zip(&algebra.blocks).filter(|(_, block)| changes(block)).map(|(n, _)| n).collect();
        Watched { blocks, units: Vec::new() }
    }

    /// The determinant of a watched block at a state that solves it, in units of the first one.
    fn determinant(&self, watched: &mut Watched, which: usize, tau: f64, state: &[f64]) -> f64 {
        let block = &self.system.algebra.blocks[watched.blocks[which] as usize];
        let mut memory = Workspace::default();
        let partials = self.solver(tau, &mut memory).partials(block, state);
        let Some((sign, log)) = Matrix::new(partials, block.unknowns.len()).determinant() else { return 1.0 };
        watched.units.resize(watched.blocks.len(), None);
        if watched.units[which].is_none() && log.is_finite() {
            watched.units[which] = Some(log);
        }
        sign * (log - watched.units[which].unwrap_or(0.0)).exp()
    }

    /// Notes the determinants of all watched blocks at one of the [`POSITIONS`] of a stretch.
    pub fn determinants(
        &self,
        watched: &mut Watched,
        tau: f64,
        state: &[f64],
        (noted, place): (&mut [Determinants], usize),
    ) {
        for (which, noted) in noted.iter_mut().enumerate() {
            noted.set(place, self.determinant(watched, which, tau, state));
        }
    }

    /// Searches the stretch of a step from `first` to `last`, with the state at `first`, for the first place where the determinant of a
    /// watched block is zero and solutions meet. `seen`: its values in that stretch.
    pub fn meeting(
        &mut self,
        step: &Dense,
        (first, last): (f64, f64),
        start: &[f64],
        (watched, which): (&mut Watched, usize),
        seen: &Determinants,
    ) -> Option<Meeting> {
        let algebra = &self.system.algebra;
        let component = algebra.component(&algebra.blocks[watched.blocks[which] as usize], 0);
        let size = seen.size();
        let mut reach = 0.0;
        let mut state = start.to_vec();
        let mut pieces = vec![(first, last)];
        for _ in 0..MAX_LOOKS {
            let (lo, hi) = pieces.pop()?;
            let width = (hi - lo) / (last - first);
            let is_narrow = width <= SHORT || (hi - lo) * step.h <= NARROW * step.end.resolution();
            let Sample { determinants, end, least, is_solved } =
                self.sample(step, (lo, hi), &state, (watched, which));
            if reach == 0.0 {
                // An unknown may be zero at the place itself.
                let block = &algebra.blocks[watched.blocks[which] as usize];
                let places = (0..block.unknowns.len()).map(|unknown| algebra.component(block, unknown));
                reach = places.map(|place| start[place].abs().max(end[place].abs())).fold(0.0, f64::max);
                reach = start.iter().fold(reach, |reach, x| reach.max(SCALE * x.abs()));
            }
            if is_solved && !determinants.may_vanish(width) {
                state = end;
                continue;
            }
            let shape = |equations: &mut Self, watched: &Watched, departures: usize| {
                equations.shape((watched, which), least.1 * step.h, &least.2, (reach, departures))
            };
            if !is_narrow {
                // Among solutions that cannot be told apart all is rounding, however short the stretch is.
                if shape(self, watched, CLOSE - 1) == Shape::Even {
                    return Some(Meeting { component, position: least.1, reach: last });
                }
                let middle = 0.5 * (lo + hi);
                pieces.extend([(middle, hi), (lo, middle)]);
                continue;
            }
            // It may be zero at one of the ends.
            let [before, after] = [(2.0 * lo - hi).max(0.0), (2.0 * hi - lo).min(1.0)].map(|position| {
                let mut there = state.clone();
                self.follow(step, position, &mut there)
                    .map_or(0.0, |()| self.determinant(watched, which, position * step.h, &there))
            });
            let passes = before * after < 0.0;
            // Steps become short where solutions are close, and then the determinant is small everywhere; but so near, there is no other one else.
            let is_near = passes || !is_solved || least.0 <= TOUCH * size;
            let shape = shape(self, watched, if is_near { DEPARTURES.len() } else { CLOSE });
            if shape == Shape::Even || passes && shape == Shape::Odd {
                return Some(Meeting { component, position: least.1, reach: last });
            }
            if is_solved {
                state = end;
            }
        }
        None
    }

    /// Follows a watched block through the stretch of a step from `lo` to `hi`, with the state at `lo`.
    fn sample(
        &mut self,
        step: &Dense,
        (lo, hi): (f64, f64),
        start: &[f64],
        (watched, which): (&mut Watched, usize),
    ) -> Sample {
        let mut determinants = Determinants::default();
        let (mut end, mut between, mut close) = (start.to_vec(), start.to_vec(), start.to_vec());
        let mut least = (f64::INFINITY, lo, start.to_vec());
        let is_solved = places().into_iter().all(|(place, s)| {
            let position = lo + s * (hi - lo);
            if place == POSITIONS - 1 {
                close.clone_from(&end);
            }
            let there = match place {
                ..POINTS => &mut end,
                place if place < POSITIONS - 2 => &mut between,
                _ => &mut close,
            };
            if self.follow(step, position, there).is_err() {
                return false;
            }
            let determinant = self.determinant(watched, which, position * step.h, there);
            determinants.set(place, determinant);
            if determinant.abs() < least.0 {
                least = (determinant.abs(), position, there.clone());
            }
            true
        });
        Sample { determinants, end, least, is_solved }
    }

    /// A component of a state, at the start of a step, that equations do not determine because solutions meet there.
    pub fn met(&mut self, state: &[f64]) -> Option<usize> {
        let watched = self.watched();
        let algebra = &self.system.algebra;
        (0..watched.blocks.len()).find_map(|which| {
            let block = &algebra.blocks[watched.blocks[which] as usize];
            let places = (0..block.unknowns.len()).map(|unknown| algebra.component(block, unknown));
            let reach = places.map(|place| state[place].abs()).fold(0.0, f64::max);
            let shape = self.shape((&watched, which), 0.0, state, (reach, SMALL));
            (shape == Shape::Even).then(|| algebra.component(block, 0))
        })
    }

    /// The shape of the equations of a watched block at a state where they are singular. `reach`: the size of its unknowns in
    /// the step. So many departures are tried.
    fn shape(
        &mut self,
        (watched, which): (&Watched, usize),
        tau: f64,
        state: &[f64],
        (reach, departures): (f64, usize),
    ) -> Shape {
        self.read_inputs(tau);
        let block = &self.system.algebra.blocks[watched.blocks[which] as usize];
        let n = block.unknowns.len();
        if n > FEW {
            return Shape::Odd;
        }
        let mut memory = Workspace::default();
        let mut solver = self.solver(tau, &mut memory);
        solver.follows_sides = true;
        let places = solver.places(block);
        let mut matrix = vec![0.0; n * n];
        for (i, j, value) in solver.partials(block, state) {
            matrix[i as usize * n + j as usize] += value;
        }
        let transposed: Vec<f64> = (0..n * n).map(|k| matrix[k % n * n + k / n]).collect();
        let (mut direction, combination) = (null_vector(&matrix, n), null_vector(&transposed, n));
        let size = if reach > 0.0 { reach } else { 1.0 };
        direction.iter_mut().for_each(|v| *v *= size);
        let mut residuals = Vec::new();
        let mut combined = |solver: &mut Solver, departure: f64| -> f64 {
            let mut there = state.to_vec();
            for (place, v) in places.iter().zip(&direction) {
                there[*place] += departure * v;
            }
            solver.residuals(block, &there, &mut residuals);
            combination.iter().zip(&residuals).map(|(w, g)| w * g).sum()
        };
        let left = combined(&mut solver, 0.0).abs();
        let slope: f64 = (0..n * n).map(|k| combination[k / n] * matrix[k] * direction[k % n]).sum();
        let (mut known, mut shape) = (None, Shape::Flat);
        for departure in DEPARTURES.into_iter().take(departures) {
            let (up, down) = (combined(&mut solver, departure), combined(&mut solver, -departure));
            let zero = LEFT * (left + slope.abs() * departure);
            if up.is_nan() || down.is_nan() || up.abs().min(down.abs()) <= zero {
                continue;
            }
            shape = if (up > 0.0) == (down > 0.0) { Shape::Even } else { Shape::Odd };
            if known.replace(shape) == Some(shape) {
                break;
            }
        }
        shape
    }
}

/// A vector of largest entry 1 that a matrix, singular to rounding, maps to almost nothing (inverse iteration).
fn null_vector(matrix: &[f64], n: usize) -> Vec<f64> {
    let mut v: Vec<f64> = (0..n).map(|i| 1.0 + 0.1 * i as f64).collect();
    let size = matrix.iter().fold(f64::MIN_POSITIVE, |size: f64, x| size.max(x.abs()));
    for _ in 0..3 {
        let mut shifted = matrix.to_vec();
        (0..n).for_each(|k| shifted[k * n + k] += f64::EPSILON * size);
        let before = v.clone();
        if eliminate(&mut shifted, &mut v) == 0.0 || v.iter().any(|x| !x.is_finite()) {
            return before;
        }
        let largest = v.iter().fold(0.0, |most: f64, x| if x.abs() > most.abs() { *x } else { most });
        v.iter_mut().for_each(|x| *x /= largest);
    }
    v
}
