//! The course of a plant by small steps of equal length: the classical Runge-Kutta method, and events where a comparison
//! changes its sign.

use super::expression::{Values, Variable};
use super::plant::{Cell, Plant, Step};
use super::shape::{Relatives, Shape};

/// Sides of a comparison that come so near each other without meeting, or so soon after an event, leave it open what happens.
const NEAR: f64 = 1e-3;
/// States so soon after or before an event are not compared: the event may be on their other side.
const SOON: f64 = 1e-3;
/// Most events of a course; a cell that is replaced without end has more.
const MOST_EVENTS: usize = 400;
/// Most changes of signs of a course.
const MOST_CUTS: usize = 4000;
/// Most cells that are replaced at one instant, one after another.
const MOST_AT_ONCE: usize = 50;
/// Halvings of a step in which an event is.
const HALVINGS: usize = 60;
/// Sides that are so far from each other just behind a change of sign have jumped.
const JUMP: f64 = 1e-6;
/// Most cells.
const MOST_CELLS: usize = 40;
/// Larger values have left what is of interest.
const LARGE: f64 = 1e6;

/// States at the first of the times, up to where it is not known what happens.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Age, value and function, or 0, of each cell, by time.
    pub states: Vec<Vec<[f64; 3]>>,
    /// The number of events before each of these times.
    pub events: Vec<usize>,
}

/// Solves the equations with so many steps a unit of time; each value at the start is larger by a part of itself.
pub fn solve(plant: &Plant, steps: usize, nudge: f64) -> Course {
    let nudged = |[x, c, kind]: &Cell| [*x, c + nudge * c.abs().max(1.0), *kind];
    let cells: Vec<Cell> = plant.start.iter().map(nudged).collect();
    let mut run = Run {
        plant,
        relatives: plant.shape.relatives(),
        shape: plant.shape.clone(),
        cells,
        t: 0.0,
        events: 0,
        cuts: 0,
        last_event: f64::NEG_INFINITY,
        signs: Vec::new(),
    };
    let mut course = Course::default();
    if run.settle(None).is_none() {
        return course;
    }
    for &time in &plant.times {
        let count = ((time - run.t) * steps as f64).ceil().max(1.0) as usize;
        let begin = run.t;
        for n in 1..=count {
            let to = begin + (time - begin) * (n as f64 / count as f64);
            if run.advance(to).is_none() {
                return course;
            }
        }
        if time - run.last_event < SOON || run.foresees_event() || run.is_about_to_jump() {
            return course;
        }
        course.states.push(run.state());
        course.events.push(run.events);
    }
    course
}

struct Run<'p> {
    plant: &'p Plant,
    cells: Vec<Cell>,
    shape: Shape,
    relatives: Vec<Relatives>,
    t: f64,
    events: usize,
    /// Changes of signs that have been passed.
    cuts: usize,
    last_event: f64,
    /// The signs of all comparisons of each cell just after the last event.
    signs: Vec<Vec<f64>>,
}

impl Run<'_> {
    fn values(&self, cells: &[Cell], cell: usize, t: f64) -> Values {
        let mut values = self.own_values(cells, cell, t);
        if self.plant.function.is_some()
            && let Some(left) = self.relatives[cell].below
        {
            let function = self.plant.function_at(&self.own_values(cells, left, t));
            values[Variable::LeftFunction as usize] = function.unwrap_or(0.0);
        }
        values
    }

    /// The same but for the function of the cell on the left.
    fn own_values(&self, cells: &[Cell], cell: usize, t: f64) -> Values {
        let [left, right] = self.plant.walls;
        let Relatives { below, attached } = &self.relatives[cell];
        let l = below.map_or(left, |below| cells[below][1]);
        let above = attached.iter().map(|other| cells[*other][1]);
        // In a row at most one is attached.
        let r = above.clone().next().unwrap_or(right);
        let (sum, largest) = (above.clone().sum(), above.reduce(f64::max).unwrap_or(0.0));
        let mut values = [cells[cell][0], cells[cell][1], l, r, t, 0.0, 0.0, sum, largest];
        values[Variable::Function as usize] = self.plant.function_at(&values).unwrap_or(0.0);
        values
    }

    fn state(&self) -> Vec<[f64; 3]> {
        let values = (0..self.cells.len()).map(|cell| self.values(&self.cells, cell, self.t));
        values.map(|v| [Variable::Age, Variable::Own, Variable::Function].map(|n| v[n as usize])).collect()
    }

    /// The rate of a cell. Within a step, what jumps has the value that it has at the beginning.
    fn rate(&self, cells: &[Cell], cell: usize, t: f64) -> f64 {
        let step = self.plant.step.as_ref().map_or(0.0, |Step { values: [more, less], .. }| {
            if self.signs[cell].last().is_some_and(|sign| *sign > 0.0) { *more } else { *less }
        });
        self.plant.rates[cells[cell][2] as usize].at(&self.values(cells, cell, t)) + step
    }

    /// The differences of the sides of all comparisons of a cell, that of the step in its rate last.
    fn gaps(&self, cells: &[Cell], cell: usize, t: f64) -> Vec<f64> {
        let values = self.values(cells, cell, t);
        let step = self.plant.step.iter().map(|Step { sides: [a, b], .. }| a.at(&values) - b.at(&values));
        self.plant
            .condition
            .comparisons
            .iter()
            .map(|comparison| comparison.gap(&values))
            .chain(step)
            .collect()
    }

    fn all_gaps(&self, cells: &[Cell], t: f64) -> Vec<Vec<f64>> {
        (0..cells.len()).map(|cell| self.gaps(cells, cell, t)).collect()
    }

    /// The cells after a step of this length.
    fn step(&self, h: f64) -> Vec<Cell> {
        let rates = |cells: &[Cell], t: f64| -> Vec<f64> {
            (0..cells.len()).map(|cell| self.rate(cells, cell, t)).collect()
        };
        let moved = |by: f64, rates: &[f64]| -> Vec<Cell> {
            self.cells.iter().zip(rates).map(|([x, c, kind], rate)| [x + by, c + by * rate, *kind]).collect()
        };
        let a = rates(&self.cells, self.t);
        let b = rates(&moved(0.5 * h, &a), self.t + 0.5 * h);
        let c = rates(&moved(0.5 * h, &b), self.t + 0.5 * h);
        let d = rates(&moved(h, &c), self.t + h);
        let mean: Vec<f64> = (0..a.len()).map(|n| (a[n] + 2.0 * b[n] + 2.0 * c[n] + d[n]) / 6.0).collect();
        moved(h, &mean)
    }

    /// Goes on to a time; None where it is open what happens.
    fn advance(&mut self, to: f64) -> Option<()> {
        while self.t < to {
            let h = to - self.t;
            let before = self.all_gaps(&self.cells, self.t);
            let next = self.step(h);
            if next.iter().flatten().any(|value| value.is_nan() || value.abs() > LARGE) {
                return None;
            }
            let changed = |gaps: &[Vec<f64>], signs: &[Vec<f64>]| {
                gaps.iter().flatten().zip(signs.iter().flatten()).any(|(gap, sign)| gap * sign <= 0.0)
            };
            let after = self.all_gaps(&next, to);
            if !changed(&after, &self.signs) {
                self.passes_far(&before, &after, h)?;
                (self.cells, self.t) = (next, to);
                continue;
            }
            // Equations may push a cell against a level from both sides.
            self.cuts += 1;
            if self.cuts > MOST_CUTS {
                return None;
            }
            // The last instant before a change.
            let (mut lo, mut hi) = (0.0, h);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (lo + hi);
                if changed(&self.all_gaps(&self.step(middle), self.t + middle), &self.signs) {
                    hi = middle;
                } else {
                    lo = middle;
                }
            }
            let before = self.all_gaps(&self.step(lo), self.t + lo);
            (self.cells, self.t) = (self.step(hi), self.t + hi);
            self.settle(Some(&before))?;
        }
        Some(())
    }

    /// None where sides may meet and part within the step, or nearly do.
    fn passes_far(&self, before: &[Vec<f64>], after: &[Vec<f64>], h: f64) -> Option<()> {
        let middle = self.all_gaps(&self.step(0.5 * h), self.t + 0.5 * h);
        let all = before.iter().flatten().zip(middle.iter().flatten()).zip(after.iter().flatten());
        for ((a, b), c) in all {
            let turns = (b.abs() <= a.abs() && b.abs() <= c.abs()) || (a - b) * (b - c) < 0.0;
            if turns && b.abs() < NEAR {
                return None;
            }
        }
        Some(())
    }

    /// Replaces cells until no condition holds, at the start or where a comparison has just changed its sign, whose differences were these
    /// a moment before; None where it is open what happens.
    fn settle(&mut self, before: Option<&[Vec<f64>]>) -> Option<()> {
        let after = self.all_gaps(&self.cells, self.t);
        let mut firing = Vec::new();
        for (cell, gaps) in after.iter().enumerate() {
            let changed = |n: usize| before.is_some() && gaps[n] * self.signs[cell][n] <= 0.0;
            let mut at: Vec<f64> = gaps.iter().map(|gap| gap.signum()).collect();
            let mut then = at.clone();
            for n in 0..gaps.len() {
                if changed(n) {
                    then[n] = -self.signs[cell][n];
                    // What jumps is on the other side at once.
                    at[n] = if gaps[n].abs() > JUMP { then[n] } else { 0.0 };
                } else if gaps[n].abs() < NEAR {
                    return None;
                }
            }
            if self.plant.condition.holds(&at) || self.plant.condition.holds(&then) {
                firing.push(cell);
            }
        }
        if firing.is_empty() {
            self.signs = match before {
                None => after.iter().map(|gaps| gaps.iter().map(|gap| gap.signum()).collect()).collect(),
                Some(_) => (after.iter().zip(&self.signs))
                    .map(|(gaps, signs)| {
                        let pairs = gaps.iter().zip(signs);
                        pairs.map(|(gap, sign)| if gap * sign <= 0.0 { -sign } else { *sign }).collect()
                    })
                    .collect(),
            };
            return Some(());
        }
        for round in 0.. {
            self.events += firing.len();
            if self.events > MOST_EVENTS || round > MOST_AT_ONCE {
                return None;
            }
            let mut next = Vec::new();
            for (cell, own) in self.cells.iter().enumerate() {
                if !firing.contains(&cell) {
                    next.push(*own);
                    continue;
                }
                let values = self.values(&self.cells, cell, self.t);
                let kind = |n: usize| (own[2] as usize + n) % self.plant.rates.len();
                let successors = self.plant.successors.iter().enumerate();
                next.extend(successors.map(|(n, value)| [0.0, value.at(&values), kind(n) as f64]));
            }
            self.cells = next;
            self.shape = self.shape.after(&firing, self.plant.successors.len(), self.plant.forks);
            self.relatives = self.shape.relatives();
            if self.cells.len() > MOST_CELLS {
                return None;
            }
            let gaps = self.all_gaps(&self.cells, self.t);
            // What starts near its condition, or is brought there by a neighbour, is left open.
            if gaps.iter().flatten().any(|gap| gap.abs() < NEAR) {
                return None;
            }
            self.signs = gaps.iter().map(|gaps| gaps.iter().map(|gap| gap.signum()).collect()).collect();
            firing = (0..gaps.len()).filter(|cell| self.plant.condition.holds(&self.signs[*cell])).collect();
            if firing.is_empty() {
                break;
            }
        }
        self.last_event = self.t;
        Some(())
    }

    /// True if the function of a cell jumps where values are only a little others.
    fn is_about_to_jump(&self) -> bool {
        let least =
            |cell| Some(self.plant.function.as_ref()?.least_gap(&self.values(&self.cells, cell, self.t)));
        (0..self.cells.len()).filter_map(least).any(|gap| gap < NEAR)
    }

    /// True if an event is so near that dlsys may be behind it already.
    fn foresees_event(&self) -> bool {
        let soon = self.all_gaps(&self.step(SOON), self.t + SOON);
        soon.iter().flatten().zip(self.signs.iter().flatten()).any(|(gap, sign)| gap * sign <= 0.0)
    }
}
