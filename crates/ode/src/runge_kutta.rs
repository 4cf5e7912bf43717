//! One step of an explicit Runge-Kutta method, with its dense output.

use super::Method;
use super::dense::{Dense, PLACE};
use super::tableau::{DOP853, DOPRI5, Tableau, dop853_dense, dop853_error, dopri5_dense};
use dlsys_expr::SimTime;

/// A system of equations `y' = f(tau, y)`, `tau` counted from the start of the step.
pub trait Rates {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]);

    /// Which rates depend on which components: pairs of them.
    fn couplings(&self) -> Vec<(u32, u32)>;

    /// The partial derivatives of the rates, for each of the couplings in their order.
    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>);

    /// Number of modules whose equations one evaluation evaluates.
    fn modules(&self) -> u64;

    /// The error of what is solved for along with the components, in units of what is tolerated, given the components at
    /// `tau` and their errors.
    fn algebraic_error(&mut self, _tau: f64, _end: &[f64], _errors: &[f64], _tolerance: f64) -> f64 {
        0.0
    }

    /// True if rates read the time of the simulation, which is known as well as a float is.
    fn is_timed(&self) -> bool {
        false
    }

    /// True if there is something that is solved for along with the components.
    fn is_algebraic(&self) -> bool {
        false
    }
}

/// Errors below the tolerated part of this are none, whatever they are errors of.
const FLOOR: f64 = 1e-18;

/// A step of so many resolutions of time, in which nothing changes by more than this part of the tolerance, is as good as none.
const INSTANT: f64 = 1e4;
const NOTHING: f64 = 1e-3;

/// So few components are added up one by one, in the same order as many.
const FEW: usize = 2;

/// Components that fit into the processor's registers together. States and rates are kept in so many more places than
/// there are components that all of them are whole parts: what the last places hold means nothing.
const PART: usize = 8;

/// The sums of the stages' rates with these weights, of the components from `first` on.
#[inline]
fn weigh(weights: &[f64], k: &[Vec<f64>], first: usize) -> [f64; PART] {
    let mut sums = [0.0; PART];
    for (weight, k) in weights.iter().zip(k) {
        if *weight != 0.0 {
            let k: &[f64; PART] = part(k, first);
            for (sum, k) in sums.iter_mut().zip(k) {
                *sum += weight * k;
            }
        }
    }
    sums
}

/// The part of some rates that begins with a component.
fn part(k: &[f64], first: usize) -> &[f64; PART] {
    k[first..first + PART].try_into().expect("as many as that")
}

/// The sum of one component's rates at the stages with these weights.
fn weighed(weights: &[f64], k: &[Vec<f64>], component: usize) -> f64 {
    let mut sum = 0.0;
    for (weight, k) in weights.iter().zip(k) {
        if *weight != 0.0 {
            sum += weight * k[component];
        }
    }
    sum
}

/// Places in a step, as parts of it.
pub type Nodes = smallvec::SmallVec<[f64; 12]>;

/// Working memory of a step.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// The state at the start of the step.
    from: Vec<f64>,
    /// Rates at the stages; the first is that of the start of the step.
    k: Vec<Vec<f64>>,
    stage: Vec<f64>,
    /// The stage before the last, which is also at the end of the step.
    other_end: Vec<f64>,
    /// The state at the end of the step.
    pub end: Vec<f64>,
    /// What rounding of the state makes of each rate; empty where nobody has asked.
    pub noise: Vec<f64>,
    /// The resolution of time, if rates read it.
    pub resolution: f64,
    /// Of the equations of one module.
    pub evaluations: u64,
}

/// What dense output is wrong by inside a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inside {
    /// As a part of the values and of their changes.
    pub relative: f64,
    /// Relative to max(1, |value|).
    pub absolute: f64,
}

/// What became of a trial step.
pub enum Trial {
    /// The largest error of a component, in units of what is tolerated, by truncation and by rounding;
    /// 0 for methods without estimate.
    Done { error: f64, rounding: f64 },
    /// Some rate or value on the way was not finite; the component.
    NotFinite(usize),
    /// The equations of the stages could not be solved.
    Diverged,
}

impl Method {
    fn tableau(self) -> Option<&'static Tableau> {
        match self {
            Method::Euler | Method::Rk4 => None,
            Method::Dop853 => Some(&DOP853),
            _ => Some(&DOPRI5),
        }
    }

    /// Where a step evaluates rates that its estimate of errors depends on, as parts of it.
    pub fn nodes(self) -> Nodes {
        let Some(tableau) = self.tableau() else { return Nodes::from_slice(&[0.0, 0.5, 1.0]) };
        let counts = |(_, weight): &(&f64, &f64)| **weight != 0.0;
        tableau.c.iter().zip(tableau.e[0]).filter(counts).map(|(c, _)| *c).collect()
    }

    /// Order of the error estimate.
    pub fn error_order(self) -> u32 {
        self.tableau().map_or(1, |t| t.error_order)
    }

    /// Stage whose rate is that of the end of the step.
    fn last_stage(self) -> usize {
        match self {
            Method::Euler => 1,
            Method::Rk4 => 4,
            _ => self.tableau().map_or(0, |t| t.stages - 1),
        }
    }
}

impl Workspace {
    pub fn resize(&mut self, n: usize) {
        if self.end.len() == n && !self.k.is_empty() {
            return;
        }
        let places = n.next_multiple_of(PART);
        if self.k.first().is_none_or(|k| k.len() != places) {
            let stages = DOP853.a.len();
            self.k.resize(stages, Vec::new());
            for k in &mut self.k {
                k.resize(places, 0.0);
            }
        }
        self.from.resize(places, 0.0);
        self.stage.resize(places, 0.0);
        self.other_end.resize(n, 0.0);
        self.end.resize(n, 0.0);
    }

    fn evaluate(&mut self, system: &mut impl Rates, tau: f64, stage: usize) {
        self.evaluations += system.modules();
        let n = self.end.len();
        system.rates(tau, &self.stage[..n], &mut self.k[stage][..n]);
    }

    /// Computes the rates at the start of a step; the component whose rate is not finite is an error.
    pub fn start(&mut self, system: &mut impl Rates, y: &[f64]) -> Result<(), usize> {
        self.stage[..y.len()].copy_from_slice(y);
        self.evaluate(system, 0.0, 0);
        self.rates_at_start().iter().position(|x| !x.is_finite()).map_or(Ok(()), Err)
    }

    /// Tries a step from `y`, whose rates are known.
    pub fn attempt(
        &mut self,
        method: Method,
        system: &mut impl Rates,
        y: &[f64],
        h: f64,
        tolerance: f64,
    ) -> Trial {
        match method.tableau() {
            None if method == Method::Euler => {
                for (end, (y, k)) in self.end.iter_mut().zip(y.iter().zip(&self.k[0])) {
                    *end = y + h * k;
                }
                self.finite(0.0, 0.0, 0)
            }
            None => {
                for (i, c) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
                    for (s, (y, k)) in self.stage.iter_mut().zip(y.iter().zip(&self.k[i - 1])) {
                        *s = y + h * c * k;
                    }
                    self.evaluate(system, c * h, i);
                }
                for (i, end) in self.end.iter_mut().enumerate() {
                    let [a, b, c, d] = [0, 1, 2, 3].map(|s| self.k[s][i]);
                    *end = y[i] + h / 6.0 * (a + 2.0 * (b + c) + d);
                }
                // The rate at the end gives the Hermite interpolant and is the next step's first.
                self.stage[..y.len()].copy_from_slice(&self.end);
                self.evaluate(system, h, 4);
                self.finite(0.0, 0.0, 4)
            }
            Some(tableau) => {
                let n = y.len();
                self.from[..n].copy_from_slice(y);
                for i in 1..tableau.stages {
                    self.combine(tableau.a[i], n, h);
                    self.evaluate(system, tableau.c[i] * h, i);
                    if i + 2 == tableau.stages {
                        self.other_end.copy_from_slice(&self.stage[..n]);
                    }
                    if i + 1 == tableau.stages {
                        // The last stage is the end of the step.
                        self.end.copy_from_slice(&self.stage[..n]);
                    }
                }
                let (mut error, rounding) = self.error(tableau, n, h, tolerance);
                if system.is_algebraic() {
                    let errors: Vec<f64> = (0..y.len()).map(|j| self.estimate(tableau, h, j)).collect();
                    error = error.max(system.algebraic_error(h, &self.end, &errors, tolerance));
                }
                self.finite(error, rounding, tableau.stages - 1)
            }
        }
    }

    /// The state at which a stage's rate is taken, given its weights.
    fn combine(&mut self, weights: &[f64], n: usize, h: f64) {
        let Workspace { from, stage, k, .. } = self;
        if n <= FEW {
            for (j, (s, y)) in stage.iter_mut().zip(from).enumerate().take(n) {
                *s = *y + h * weighed(weights, k, j);
            }
            return;
        }
        let (from, stage) = (from.as_chunks::<PART>().0, stage.as_chunks_mut::<PART>().0);
        for (block, (from, stage)) in from.iter().zip(stage).enumerate() {
            let sums = weigh(weights, k, block * PART);
            for i in 0..PART {
                stage[i] = from[i] + h * sums[i];
            }
        }
    }

    /// An estimate of the step times the largest rate of decay: two states at the end of the step and the
    /// difference of their rates (Hairer and Wanner 1996, IV.2).
    pub fn stiffness(&self, method: Method, h: f64) -> f64 {
        let Some(tableau) = method.tableau() else { return 0.0 };
        let [a, b] = [1, 2].map(|before| &self.k[tableau.stages - before][..self.end.len()]);
        let square = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>();
        let distance = square(&self.end, &self.other_end);
        if distance > 0.0 { h * (square(a, b) / distance).sqrt() } else { 0.0 }
    }

    /// The rates at the start of the step.
    pub fn rates_at_start(&self) -> &[f64] {
        &self.k[0][..self.end.len()]
    }

    /// The largest error of a component, in units of what is tolerated, by truncation and by rounding.
    fn error(&mut self, tableau: &Tableau, n: usize, h: f64, tolerance: f64) -> (f64, f64) {
        let (mut error, mut rounding): (f64, f64) = (0.0, 0.0);
        let blur = 4.0 * self.resolution / tableau.c[1];
        let estimates = |row: &[f64], first: usize| match n {
            0..=FEW => std::array::from_fn(|j| if j < n { weighed(row, &self.k, j) } else { 0.0 }),
            _ => weigh(row, &self.k, first),
        };
        // The last stage is the end of the step.
        let (from, end) = (self.from.as_chunks::<PART>().0, self.stage.as_chunks::<PART>().0);
        for (block, (from, end)) in from.iter().zip(end).enumerate() {
            let first = block * PART;
            let mut estimate = estimates(tableau.e[0], first);
            if let Some(low) = tableau.e.get(1) {
                for (high, low) in estimate.iter_mut().zip(estimates(low, first)) {
                    *high = dop853_error(h * *high, h * low);
                }
            } else {
                estimate = estimate.map(|high| (h * high).abs());
            }
            let (departure, second) = (part(&self.k[0], first), part(&self.k[1], first));
            let (mut ratios, mut roundings) = ([0.0; PART], [0.0; PART]);
            let mut noise = [0.0; PART];
            for (noise, known) in noise.iter_mut().zip(self.noise.iter().skip(first)) {
                *noise = *known;
            }
            for j in 0..PART {
                // Relative to where the step begins, and to how far it goes from there at first: what
                // grows from 1e-6 must be known to its own digits. Not to where it ends: beyond an
                // event, equations may lead anywhere, and that must not spoil the part that counts.
                // What begins from rest goes somewhere only after that: the second stage shows it.
                let speed = departure[j].abs().max(second[j].abs());
                // Rates that depend on time are known as well as time is.
                let blur = blur * (second[j] - departure[j]).abs();
                let blur = blur + 4.0 * h.abs() * noise[j];
                let scale = tolerance * (from[j].abs().max(h.abs() * speed) + FLOOR) + blur;
                roundings[j] = 4.0 * f64::EPSILON * end[j].abs() / scale;
                ratios[j] = estimate[j] / scale;
            }
            for (ratio, other) in ratios.into_iter().zip(roundings).take(n - first) {
                rounding = rounding.max(other);
                error = if ratio > error || ratio.is_nan() { ratio } else { error };
            }
        }
        (error, rounding)
    }

    /// The estimated error of one component at the end of the step, with its sign.
    fn estimate(&self, tableau: &Tableau, h: f64, component: usize) -> f64 {
        let high = h * weighed(tableau.e[0], &self.k, component);
        match tableau.e.get(1) {
            None => high,
            Some(low) => dop853_error(high, h * weighed(low, &self.k, component)).copysign(high),
        }
    }

    /// The largest estimated error of a component in the step just tried, relative to max(1, |value|), given what it is in units
    /// of what is tolerated.
    pub fn absolute_error(&self, method: Method, y: &[f64], h: f64, error: f64, tolerance: f64) -> f64 {
        let part = |(component, y): (usize, &f64)| match method.tableau().filter(|_| method != Method::Radau)
        {
            Some(tableau) => self.estimate(tableau, h, component).abs() / y.abs().max(1.0),
            None => error * tolerance * y.abs().min(1.0),
        };
        y.iter().enumerate().map(part).fold(0.0, f64::max)
    }

    fn finite(&self, error: f64, rounding: f64, last: usize) -> Trial {
        let bad = self.end.iter().position(|x| !x.is_finite());
        let rates = &self.k[last][..self.end.len()];
        match bad.or_else(|| rates.iter().position(|x| !x.is_finite())) {
            None if error.is_finite() => Trial::Done { error, rounding },
            at => Trial::NotFinite(at.unwrap_or(0)),
        }
    }

    /// Computes what the dense output of a good step needs besides.
    pub fn finish(&mut self, method: Method, system: &mut impl Rates, y: &[f64], h: f64) {
        if let Some(tableau) = method.tableau() {
            self.from[..y.len()].copy_from_slice(y);
            for i in tableau.stages..tableau.a.len() {
                self.combine(tableau.a[i], y.len(), h);
                self.evaluate(system, tableau.c[i] * h, i);
            }
        }
    }

    /// The dense output of the step just tried, up to `end` if that is known better than as `start` and `h`.
    pub fn dense(&self, method: Method, start: SimTime, end: Option<SimTime>, y: &[f64], h: f64) -> Dense {
        let degree = match method {
            Method::Euler => 1,
            Method::Rk4 => 3,
            Method::Dop853 => 7,
            _ => 4,
        };
        let mut c = Vec::with_capacity(y.len() * (degree + 1));
        for (block, (y, end)) in y.chunks(PART).zip(self.end.chunks(PART)).enumerate() {
            let first = block * PART;
            let ends = y.iter().zip(end);
            match method {
                Method::Euler => ends.for_each(|(&a, &b)| c.extend([a, b])),
                Method::Rk4 => {
                    let hk = |stage: usize, j: usize| h * self.k[stage][first + j];
                    ends.enumerate()
                        .for_each(|(j, (a, b))| c.extend([*a, a + hk(0, j) / 3.0, b - hk(4, j) / 3.0, *b]));
                }
                Method::Dop853 => {
                    let k: [_; 16] = std::array::from_fn(|stage| part(&self.k[stage], first));
                    ends.enumerate()
                        .for_each(|(j, (a, b))| c.extend(dop853_dense(*a, *b, &k.map(|k| h * k[j]))));
                }
                _ => {
                    let (mut from, mut to) = ([0.0; PART], [0.0; PART]);
                    from[..y.len()].copy_from_slice(y);
                    to[..y.len()].copy_from_slice(end);
                    let hk = std::array::from_fn(|stage| part(&self.k[stage], first).map(|k| h * k));
                    c.extend_from_slice(dopri5_dense(&from, &to, &hk)[..y.len()].as_flattened());
                }
            }
        }
        Dense::new(start, end, h, degree, c)
    }

    /// What the dense output of DOP853 is wrong by inside a step: a thousand times more than its end is
    /// where the step is twice as long as stability allows, which no estimate of the end shows. (DOPRI5's is wrong by at most
    /// 2.6 times the estimate of its end for every z.) It is measured by the defect, the difference of the output's rate and
    /// the equations'. For y' = zy, that at 0.7 is 8 to 13 times the largest error, for all z from -25 to 2 and for
    /// imaginary ones up to 6; elsewhere in the step it has zeros.
    pub fn measure_interpolation(&mut self, system: &mut impl Rates, y: &[f64], dense: &Dense) -> Inside {
        const PER_ERROR: f64 = 8.0;
        // The second and the third stage are needed no more.
        for component in 0..y.len() {
            (self.stage[component], self.k[2][component]) = dense.at_place(component);
        }
        self.evaluate(system, PLACE * dense.h, 1);
        let mut inside = Inside::default();
        for (component, y) in y.iter().enumerate() {
            let defect = self.k[2][component] - dense.h * self.k[1][component];
            let error = defect.abs() / PER_ERROR;
            if error.is_finite() {
                // What begins from rest goes somewhere only after that.
                let moved = (dense.h * self.k[0][component]).abs().max(self.k[2][component].abs());
                let scale = y.abs().max(moved).max(self.stage[component].abs()) + FLOOR;
                inside.relative = inside.relative.max(error / scale);
                inside.absolute = inside.absolute.max(error / y.abs().max(1.0));
            }
        }
        inside
    }

    /// Makes the end of the step the start of the next: true if its rate is known.
    pub fn advance(&mut self, method: Method) -> bool {
        self.k.swap(0, method.last_stage());
        !matches!(method, Method::Euler | Method::Radau)
    }

    /// A step over which the solution changes little (Hairer, Nørsett and Wanner 1993, II.4).
    pub fn first_size(&mut self, method: Method, system: &mut impl Rates, y: &[f64], tolerance: f64) -> f64 {
        let f = &self.k[0][..y.len()];
        let norm = |v: &[f64]| {
            v.iter().zip(y).fold(0.0f64, |m, (v, y)| m.max((v / (tolerance * (1.0 + y.abs()))).abs()))
        };
        let (d0, d1) = (norm(y), norm(f));
        if y.is_empty() || d1 == 0.0 {
            return 1e-3;
        }
        let guess = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 };
        for (s, (y, f)) in self.stage.iter_mut().zip(y.iter().zip(f)) {
            *s = y + guess * f;
        }
        self.evaluate(system, guess, 1);
        let bend: Vec<f64> = self.k[1].iter().zip(&self.k[0]).map(|(a, b)| a - b).collect();
        let most = d1.max(norm(&bend) / guess);
        let order = f64::from(method.error_order() + 1);
        let next = if most <= 1e-15 { (guess * 1e-3).max(1e-6) } else { (0.01 / most).powf(1.0 / order) };
        let size = next.min(100.0 * guess);
        if size.is_finite() && size > 0.0 { size } else { 1e-6 }
    }

    /// Finds out what rounding of the state makes of the rates, from their partial derivatives.
    pub fn measure_noise(&mut self, system: &mut impl Rates, y: &[f64]) {
        let (couplings, mut partials) = (system.couplings(), Vec::new());
        system.partials(0.0, y, &mut partials);
        self.noise.clear();
        self.noise.resize(y.len(), 0.0);
        for (&(row, column), slope) in couplings.iter().zip(&partials) {
            let part = f64::EPSILON * (slope * y[column as usize]).abs();
            self.noise[row as usize] += if part.is_finite() { part } else { 0.0 };
        }
    }

    /// True for a step so short that nothing much can happen in it, however rates may jump: no step control can do better
    /// where a rate leaves zero like a root, or jumps where no condition says so.
    pub fn is_instant(&self, y: &[f64], h: f64, resolution: f64, tolerance: f64) -> bool {
        let change =
            |most: f64| y.iter().zip(&self.end).all(|(y, end)| (end - y).abs() <= most * y.abs().max(1.0));
        h <= INSTANT * resolution && change(NOTHING * tolerance) || h <= 4.0 * resolution && change(1e-9)
    }

    /// The component that changes most, for its size.
    pub fn worst(&self, y: &[f64]) -> usize {
        let size = |i: usize| (self.k[0][i] / (1.0 + y[i].abs())).abs();
        (0..y.len()).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests;
