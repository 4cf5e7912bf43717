//! The same work in plain Rust, written for one model each: what a program costs that has no language around its
//! numerics. Measured next to dlsys, in the same minutes on the same machine.
//!
//! - [`busy`]: the busy filament, by dlsys's own numerics (a common step of the fifth order with dense output, and after
//!   each event the cells around it once more) on arrays of cells.
//! - [`lives`]: modules whose lives have lengths of their own, in a binary heap.
//! - [`dragon_by_euler`]: the dragon curve as a program of derivation steps makes it, by forward Euler.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::plants::Dice;

/// The stages of Dormand and Prince's pair of orders 5 and 4: nodes, coefficients, weights of the error and of the dense
/// output (Hairer, Nørsett and Wanner 1993, sections II.5 and II.6).
const C: [f64; 7] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];
const DENSE: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

/// The tolerated error of a step, as a part of the tolerance, as in dlsys.
const SHARE: f64 = 0.1;
/// A common step takes no longer than this many lives of a cell.
const LIVES: f64 = 2.0;
/// The reach from one cell to the next, the decay, and the walls at both ends.
const D: f64 = 0.03;
const MU: f64 = 0.03;
const WALL: f64 = 255.0;

/// One cell in one step.
#[derive(Clone, Copy)]
struct Stretch {
    start: f64,
    h: f64,
    /// Coefficients of the dense output.
    r: [f64; 5],
}

impl Stretch {
    fn value(&self, t: f64) -> f64 {
        let s = (t - self.start) / self.h;
        let q = 1.0 - s;
        self.r[0] + s * (self.r[1] + q * (self.r[2] + s * (self.r[3] + q * self.r[4])))
    }
}

/// A filament between two walls, all of whose cells follow polynomials up to the end of the common step.
struct Filament {
    /// The stretches of each cell since the last event near it, one after another.
    ways: Vec<Vec<Stretch>>,
    end: f64,
    tolerance: f64,
    /// Working memory: the state, a stage, and the rates of all stages.
    y: Vec<f64>,
    stage: Vec<f64>,
    k: [Vec<f64>; 7],
    trial: Vec<Vec<Stretch>>,
}

impl Filament {
    fn value(&self, cell: usize, t: f64) -> f64 {
        let way = &self.ways[cell];
        way.iter().find(|one| t < one.start + one.h).or(way.last()).map_or(WALL, |one| one.value(t))
    }

    /// The cell beside a region, or the wall.
    fn beside(&self, cell: Option<usize>, t: f64) -> f64 {
        cell.filter(|cell| *cell < self.ways.len()).map_or(WALL, |cell| self.value(cell, t))
    }

    /// Tries a step of the cells from `first` on whose state is in `y`; returns the error, in units of what is tolerated.
    fn attempt(&mut self, first: usize, t: f64, h: f64) -> f64 {
        let n = self.y.len();
        for i in 0..7 {
            for j in 0..n {
                let sum: f64 = (0..i).map(|s| A[i][s] * self.k[s][j]).sum();
                self.stage[j + 1] = self.y[j] + h * sum;
            }
            self.stage[0] = self.beside(first.checked_sub(1), t + C[i] * h);
            self.stage[n + 1] = self.beside(Some(first + n), t + C[i] * h);
            for (k, w) in self.k[i][..n].iter_mut().zip(self.stage[..n + 2].windows(3)) {
                *k = D * (w[0] + w[2] - 2.0 * w[1]) - MU * w[1];
            }
        }
        let of = |j: usize| {
            let error: f64 = (0..7).map(|s| E[s] * self.k[s][j]).sum();
            let scale = self.y[j].abs().max(h * self.k[0][j].abs());
            (h * error).abs() / (SHARE * self.tolerance * scale)
        };
        (0..n).map(of).fold(0.0, f64::max)
    }

    /// Integrates cells from `first` on, from their state in `y` at `t` to `end`, in steps of at most `h`; returns the next
    /// length. The stretches are in `trial`.
    fn integrate(&mut self, first: usize, mut t: f64, end: f64, mut h: f64, once: bool) -> (f64, f64) {
        let n = self.y.len();
        self.stage.resize(n + 2, 0.0);
        self.k.iter_mut().for_each(|k| k.resize(n, 0.0));
        self.trial.resize(self.trial.len().max(n), Vec::new());
        self.trial[..n].iter_mut().for_each(Vec::clear);
        while t < end {
            let length = h.min(end - t);
            let error = self.attempt(first, t, length);
            let next = length * (0.9 * error.max(1e-10).powf(-0.2)).clamp(0.2, 10.0);
            if error > 1.0 {
                h = next.min(0.9 * length);
                continue;
            }
            for j in 0..n {
                let (y, end) = (self.y[j], self.stage[j + 1]);
                let change = end - y;
                let bend = length * self.k[0][j] - change;
                let dense: f64 = (0..7).map(|s| DENSE[s] * self.k[s][j]).sum();
                let r = [y, change, bend, change - length * self.k[6][j] - bend, length * dense];
                self.trial[j].push(Stretch { start: t, h: length, r });
                self.y[j] = end;
            }
            (t, h) = (if length == end - t { end } else { t + length }, next.max(h));
            if once {
                break;
            }
        }
        (t, h)
    }

    /// Makes the stretches in `trial` those of the cells from `first` on.
    fn accept(&mut self, first: usize, n: usize) {
        for (way, trial) in self.ways[first..first + n].iter_mut().zip(&mut self.trial) {
            std::mem::swap(way, trial);
        }
    }

    /// A common step of all cells from `t` on.
    fn step(&mut self, t: f64, h: f64) -> f64 {
        let all = self.ways.len();
        let (end, next) = self.integrate(0, t, t + h.min(LIVES), h.min(LIVES), true);
        self.accept(0, all);
        self.end = end;
        next
    }

    /// Gives a cell a new value, and integrates as many cells around it again as it changes up to the end of the step.
    fn divide(&mut self, cell: usize, t: f64, reach: &mut usize) {
        let all = self.ways.len();
        loop {
            let (first, last) = (cell.saturating_sub(*reach), (cell + *reach).min(all - 1));
            self.y.clear();
            for j in first..=last {
                let c = self.value(j, t);
                self.y.push(if j == cell { 0.5 * c + 60.0 } else { c });
            }
            let n = last + 1 - first;
            self.integrate(first, t, self.end, self.end - t, false);
            let is_changed = |j: usize| {
                let (old, new) = (self.value(j, self.end), self.y[j - first]);
                (new - old).abs() > SHARE * self.tolerance * new.abs().max(old.abs())
            };
            let edges = [first, last].map(|j| j != cell && is_changed(j));
            if (!edges[0] || first == 0) && (!edges[1] || last + 1 == all) {
                let changed = (first..=last).filter(|j| is_changed(*j)).map(|j| j.abs_diff(cell)).max();
                *reach = changed.unwrap_or(0) + 2;
                self.accept(first, n);
                return;
            }
            *reach *= 2;
        }
    }
}

/// The filament of [`plants::busy`](crate::plants::busy) up to `end`: the number of events, and what the cells hold then.
pub fn busy(cells: usize, tolerance: f64, end: f64) -> (u64, Vec<f64>) {
    let mut dice = Dice::new(5);
    let (mut queue, mut y) = (BinaryHeap::new(), Vec::new());
    for cell in 0..cells {
        let (x, c) = (dice.between(0.0, 1.0), dice.between(50.0, 200.0));
        // Times are positive, so their bits have their order.
        queue.push(Reverse(((1.0 - x).to_bits(), cell)));
        y.push(c);
    }
    let mut filament = Filament {
        ways: vec![Vec::new(); cells],
        end: 0.0,
        tolerance,
        y,
        stage: Vec::new(),
        k: Default::default(),
        trial: Vec::new(),
    };
    let (mut h, mut reach, mut events) = (0.1, 3, 0);
    loop {
        let t = filament.end;
        if t > 0.0 {
            filament.y = (0..cells).map(|cell| filament.value(cell, t)).collect();
        }
        h = filament.step(t, h);
        while let Some(&Reverse((bits, cell))) = queue.peek()
            && f64::from_bits(bits) < filament.end
        {
            let t = f64::from_bits(bits);
            if t > end {
                break;
            }
            queue.pop();
            filament.divide(cell, t, &mut reach);
            queue.push(Reverse(((t + 1.0).to_bits(), cell)));
            events += 1;
        }
        if filament.end > end {
            return (events, (0..cells).map(|cell| filament.value(cell, end)).collect());
        }
    }
}

/// The lives of [`Lives::Various`](crate::plants::Lives::Various) up to `end`, in a heap: the number of events, and the sum
/// of what decides the next lives.
pub fn lives(n: usize, end: f64) -> (u64, f64) {
    let mut all: Vec<f64> = (0..n).map(|i| (i as f64 + 0.4567) / n as f64).collect();
    let mut queue: BinaryHeap<Reverse<(u64, usize)>> =
        all.iter().enumerate().map(|(i, p)| Reverse(((1.0 + p).to_bits(), i))).collect();
    let mut events = 0;
    while let Some(mut next) = queue.peek_mut() {
        let Reverse((bits, i)) = *next;
        let t = f64::from_bits(bits);
        if t > end {
            break;
        }
        let p = 4.0 * all[i] * (1.0 - all[i]);
        all[i] = p;
        *next = Reverse(((t + 1.0 + p).to_bits(), i));
        events += 1;
    }
    (events, all.iter().sum())
}

/// A module of the dragon curve.
#[derive(Clone, Copy)]
enum Module {
    Right { x: f64, s: f64 },
    Left { x: f64, s: f64 },
    Shrinking { x: f64, s: f64 },
    Turn,
}

/// The dragon curve at `end` by derivation steps of length `dt`, each of which writes the whole string anew, as L-system
/// programs do: the number of modules, and the sum of their lengths.
pub fn dragon_by_euler(dt: f64, end: f64) -> (usize, f64) {
    use Module::{Left, Right, Shrinking, Turn};
    let mut string = vec![Turn, Turn, Right { x: 1.0, s: 1.0 }];
    let mut next = Vec::new();
    let half = |s: f64| s * std::f64::consts::SQRT_2 / 2.0;
    for _ in 0..(end / dt).round() as u64 {
        next.clear();
        for &module in &string {
            match module {
                Right { x, s } if x >= s => {
                    let (right, left) = (Right { x: 0.0, s: half(s) }, Left { x: 0.0, s: half(s) });
                    next.extend([Turn, right, Turn, Shrinking { x: s, s }, Turn, left, Turn]);
                }
                Left { x, s } if x >= s => {
                    let (right, left) = (Right { x: 0.0, s: half(s) }, Left { x: 0.0, s: half(s) });
                    next.extend([Turn, right, Turn, Shrinking { x: s, s }, Turn, left, Turn]);
                }
                Shrinking { x, .. } if x <= 0.0 => {}
                Right { x, s } => next.push(Right { x: x + dt * s, s }),
                Left { x, s } => next.push(Left { x: x + dt * s, s }),
                Shrinking { x, s } => next.push(Shrinking { x: x - dt * s, s }),
                Turn => next.push(module),
            }
        }
        std::mem::swap(&mut string, &mut next);
    }
    let length = |module: &Module| match module {
        Right { x, .. } | Left { x, .. } | Shrinking { x, .. } => *x,
        Turn => 0.0,
    };
    (string.len(), string.iter().map(length).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plants::{self, Lives};
    use crate::scale;
    use dlsys::sim::Scheduler;

    #[test]
    fn the_busy_filament_is_that_of_dlsys() {
        let (text, end) = (plants::busy(60), 3.37);
        let exact = scale::states(&text, scale::with(Scheduler::Global, 1e-10), &[end]).expect("it runs").0;
        let expected: Vec<f64> = exact[0].iter().map(|m| m.parameters[1]).collect();
        let (events, found) = busy(60, 1e-6, end);
        assert_eq!(events, scale::work(&text, Default::default(), 0.0, end).expect("it runs").events);
        for (a, b) in found.iter().zip(&expected[1..]) {
            assert!((a - b).abs() <= 1e-5 * b, "{a} for {b}");
        }
    }

    #[test]
    fn lives_in_a_heap_are_those_of_dlsys() {
        let work = scale::work(&Lives::Various.text(100), Default::default(), 0.0, 9.0).expect("it runs");
        // The cascade that makes the modules is 199 events.
        assert_eq!(lives(100, 9.0).0 + 199, work.events);
    }

    #[test]
    fn derivation_steps_make_the_dragon_curve() {
        let session = crate::solver::session(scale::DRAGON).expect("a model");
        let modules = scale::observed(&session, 6.5, 1).expect("it runs").1;
        // By Euler each generation is a step late: the same string a little later.
        assert_eq!(dragon_by_euler(1.0 / 512.0, 6.53).0, modules);
    }
}
