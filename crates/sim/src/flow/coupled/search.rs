//! The search for a solution where Newton's method finds none: at an instant at which values jump, or at birth.
//!
//! Conditions inside equations (`abs`, `max`, `if`) are frozen while Newton's method goes on, so that it sees smooth
//! equations; a solution on the other side of one of them is out of its reach. Here they follow the values. A single
//! unknown is enclosed between two values at which its equation has different signs, the nearest ones. Several
//! unknowns follow the path on which what is left of their equations shrinks to zero (Newton homotopy).

use crate::flow::coupled::algebra::{AlgebraicError, Block};
use crate::flow::coupled::newton::Solver;

/// The first distance from the start at which the sign of an equation is tried, as a part of the start, or of 1.
const FIRST: f64 = 1e-3;
/// The factor from one distance to the next, and the number of distances.
const WIDER: f64 = 1.5;
const DISTANCES: usize = 70;
/// Most halvings of a stretch that encloses a solution.
const HALVINGS: usize = 1100;
/// What is left of an equation where its sign changes, as a part of what it is at the ends of the stretch: more is a jump or a pole.
const LEFT: f64 = 1e-6;
/// The least part of a path that is taken at once.
const LEAST_PART: f64 = 1e-5;

impl Solver<'_> {
    /// Newton's method, and where it finds nothing, a search.
    ///
    /// # Errors
    /// That of Newton's method if nothing is found.
    pub fn search(&mut self, block: &Block, y: &mut [f64]) -> Result<(), AlgebraicError> {
        let places = self.places(block);
        let start: Vec<f64> = places.iter().map(|place| y[*place]).collect();
        let Err(error) = self.newton(block, y) else { return Ok(()) };
        put(y, &places, &start);
        self.follows_sides = true;
        let found = match places[..] {
            [place] => self.enclose(block, y, place),
            _ => {
                self.newton(block, y).is_ok() || {
                    put(y, &places, &start);
                    self.follow_path(block, y, &places)
                }
            }
        };
        self.follows_sides = false;
        if found { Ok(()) } else { Err(error) }
    }

    /// Finds the solution of a single equation that is nearest to the start, by its signs.
    fn enclose(&mut self, block: &Block, y: &mut [f64], place: usize) -> bool {
        let start = y[place];
        let mut residuals = Vec::new();
        let mut at = |solver: &mut Self, x: f64| {
            y[place] = x;
            solver.residuals(block, y, &mut residuals);
            residuals[0]
        };
        let first = at(self, start);
        if !first.is_finite() {
            return false;
        }
        let mut inner = [(start, first); 2];
        let mut distance = FIRST * start.abs().max(1.0);
        for _ in 0..DISTANCES {
            let outer = [-1.0, 1.0].map(|side| {
                let x = start + side * distance;
                (x, at(self, x))
            });
            let mut enclosed = [None; 2];
            for side in 0..2 {
                if inner[side].1 * outer[side].1 < 0.0 {
                    enclosed[side] = halve(inner[side], outer[side], |x| at(self, x)).map(|x| (x, side));
                }
            }
            match enclosed {
                // Which of them is meant, the start does not say.
                [Some(_), Some(_)] => return false,
                [Some((x, side)), None] | [None, Some((x, side))] => {
                    y[place] = x;
                    // The last digits; at a kink there may be no tangent to find them with.
                    if self.newton(block, y).is_err() || !within(y[place], inner[side].0, outer[side].0) {
                        y[place] = x;
                    }
                    return true;
                }
                [None, None] => {}
            }
            inner = outer;
            distance *= WIDER;
        }
        false
    }

    /// Follows the solutions of equations whose left-over shrinks from what it is at the start to zero.
    fn follow_path(&mut self, block: &Block, y: &mut [f64], places: &[usize]) -> bool {
        let mut left = Vec::new();
        self.residuals(block, y, &mut left);
        if left.iter().any(|x| !x.is_finite()) {
            return false;
        }
        let (mut done, mut part) = (0.0, 0.1);
        while done < 1.0 && part >= LEAST_PART {
            let next = f64::min(done + part, 1.0);
            let before: Vec<f64> = places.iter().map(|place| y[*place]).collect();
            self.aims = left.iter().map(|left| (1.0 - next) * left).collect();
            if self.newton(block, y).is_ok() {
                (done, part) = (next, 2.0 * part);
            } else {
                put(y, places, &before);
                part *= 0.5;
            }
        }
        self.aims.clear();
        done >= 1.0
    }
}

/// The place between two where a function is zero, by halving; None if it jumps there.
fn halve(mut a: (f64, f64), mut b: (f64, f64), mut f: impl FnMut(f64) -> f64) -> Option<f64> {
    let size = a.1.abs().max(b.1.abs());
    for _ in 0..HALVINGS {
        let x = 0.5 * (a.0 + b.0);
        if x == a.0 || x == b.0 {
            break;
        }
        let value = f(x);
        if value == 0.0 {
            return Some(x);
        }
        // Beyond a place where it is undefined nothing is known.
        if value.is_nan() {
            return None;
        }
        if (value > 0.0) == (a.1 > 0.0) { a = (x, value) } else { b = (x, value) }
    }
    let (x, value) = if a.1.abs() < b.1.abs() { a } else { b };
    (value.abs() <= LEFT * size).then_some(x)
}

fn within(x: f64, a: f64, b: f64) -> bool {
    (a.min(b)..=a.max(b)).contains(&x)
}

fn put(y: &mut [f64], places: &[usize], values: &[f64]) {
    for (place, value) in places.iter().zip(values) {
        y[*place] = *value;
    }
}
