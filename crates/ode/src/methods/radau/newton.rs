//! A Radau IIA step of a fixed number of stages: Newton's iteration, error estimate, dense output.
//!
//! Section numbers are those of E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (2nd ed.
//! 1996).

mod affine;

use super::collocation::Collocation;
use super::stages::{Attempt, Beginning, Form, Start, Stiff};
use crate::one_step::InteriorError;
use crate::sparse::{Field, Pattern, Wide};
use crate::workspace::FLOOR;

/// Longest extrapolation of the collocation polynomial, in lengths of the step before.
const EXTRAPOLATE: f64 = 10.0;
/// Newton's remaining error as a share of the allowed one.
const KAPPA: f64 = 1e-2;
/// A Jacobian is kept for the next step if the iteration converged at least this fast (RADAU5's `THET`).
const FAST: f64 = 1e-3;

/// How well the stored Jacobian is known.
#[derive(Clone, Copy, PartialEq)]
enum Jacobian {
    Unknown,
    /// Evaluated at the beginning of an earlier step.
    Earlier,
    /// Evaluated at the beginning of this step.
    Here,
}

/// Why Newton's iteration stopped; `Ok` holds the number of iterations.
type Iterations = Result<u32, Attempt>;

/// A method with fixed number of stages; `L = (S + 1) / 2` lanes: one real and the complex systems.
#[derive(Clone)]
pub struct Newton<const S: usize, const L: usize> {
    table: Collocation<S, L>,
    lambda: Wide<L>,
    jacobian: Vec<f64>,
    candidate: Vec<f64>,
    known: Jacobian,
    factors: Vec<Wide<L>>,
    /// Step length of the factors, NaN if there are none.
    factored: f64,
    /// Stage increments Z_1 .. Z_s one after the other; the same of the step before; transformed increments.
    z: Vec<f64>,
    before: Vec<f64>,
    w: Vec<Wide<L>>,
    rhs: Vec<Wide<L>>,
    rates: Vec<f64>,
    point: Vec<f64>,
    weight: Vec<f64>,
    /// The estimated error of each component, filtered once, and filtered once more where that was done.
    errors: Vec<[f64; 1]>,
    again: Vec<[f64; 1]>,
    /// The estimated error of each component, in units of what is tolerated.
    pub shares: Vec<f64>,
    pub end: Vec<f64>,
    h: f64,
    /// Length of the step `before`, if there is one that ended here.
    h_before: Option<f64>,
    /// The form of the system in the last attempt.
    form: Form,
    /// The longest step for which one solution of a linear system is known to be exact enough.
    confirmed: f64,
    /// Expected ratio of remaining error to last correction (IV.8, stopping criterion).
    eta: f64,
    slow: bool,
    /// The last attempt is done; it was accepted; it was tried from the same place as an attempt before it.
    done: bool,
    accepted: bool,
    tried: bool,
    first: bool,
    pub rates_used: u64,
    pub factorisations: u64,
}

impl<const S: usize, const L: usize> Newton<S, L> {
    pub fn nodes(&self) -> &[f64] {
        &self.table.nodes
    }

    pub fn new() -> Self {
        let table = Collocation::compute();
        let lambda = Wide { re: table.lambda.map(|l| l.re), im: table.lambda.map(|l| l.im) };
        Newton {
            table,
            lambda,
            jacobian: Vec::new(),
            candidate: Vec::new(),
            known: Jacobian::Unknown,
            factors: Vec::new(),
            factored: f64::NAN,
            z: Vec::new(),
            before: Vec::new(),
            w: Vec::new(),
            rhs: Vec::new(),
            rates: Vec::new(),
            point: Vec::new(),
            weight: Vec::new(),
            errors: Vec::new(),
            again: Vec::new(),
            shares: Vec::new(),
            end: Vec::new(),
            h: 0.0,
            h_before: None,
            form: Form::Any,
            confirmed: 0.0,
            eta: 1.0,
            slow: false,
            done: false,
            accepted: false,
            tried: false,
            first: true,
            rates_used: 0,
            factorisations: 0,
        }
    }

    pub fn forget(&mut self) {
        self.known = Jacobian::Unknown;
        self.factored = f64::NAN;
        self.h_before = None;
        self.eta = 1.0;
        (self.done, self.accepted, self.tried, self.first) = (false, false, false, true);
    }

    pub fn accept(&mut self) {
        self.accepted |= self.done;
    }

    pub fn attempt(&mut self, problem: &mut impl Stiff, start: &Start<'_>, h: f64) -> Attempt {
        let Start { pattern, y, rate, scale, .. } = *start;
        let n = pattern.unknowns();
        if y.len() != n || rate.len() != n || scale.len() != n || !h.is_finite() || h == 0.0 {
            return Attempt::NotFinite(None);
        }
        if let Some(i) = (0..n).find(|&i| !y[i].is_finite() || !rate[i].is_finite()) {
            return Attempt::NotFinite(Some(i));
        }
        self.begin(n, pattern.entries());
        if n == 0 {
            return Attempt::Done { error: 0.0, newton: 0 };
        }
        let again = std::mem::replace(&mut self.tried, true);
        self.h = h;
        let mut rounding = 0.0f64;
        for i in 0..n {
            self.weight[i] = 1.0 / scale[i].max(f64::MIN_POSITIVE);
            rounding = rounding.max(10.0 * f64::EPSILON * y[i].abs() * self.weight[i]);
        }

        let renew = match self.known {
            Jacobian::Unknown => true,
            Jacobian::Earlier => self.slow || again,
            Jacobian::Here => false,
        };
        self.form = problem.form();
        let mut outcome = match self.form {
            Form::Any => self.try_newton(problem, start, renew, true, rounding),
            _ => self.try_linear(problem, start, rounding),
        };
        if let Err(failure) = outcome {
            // An old Jacobian or a wild extrapolation must not be the reason.
            let finite = failure == Attempt::Diverged;
            if self.known == Jacobian::Earlier || (!finite && self.h_before.is_some()) {
                outcome = self.try_newton(problem, start, self.known != Jacobian::Here, false, rounding);
            }
        }
        match outcome {
            Err(failure) => {
                self.eta = 1.0;
                failure
            }
            Ok(newton) => {
                let error = self.estimate(problem, start, self.first || again);
                for (e, (y, z)) in self.end.iter_mut().zip(y.iter().zip(&self.z[(S - 1) * n..])) {
                    *e = y + z;
                }
                if let Some(i) = self.end.iter().position(|v| !v.is_finite()) {
                    return Attempt::NotFinite(Some(i));
                }
                if !error.is_finite() {
                    return Attempt::NotFinite(None);
                }
                self.done = true;
                Attempt::Done { error, newton }
            }
        }
    }

    /// Takes over an accepted step, and fits the work space to the system.
    fn begin(&mut self, n: usize, entries: usize) {
        if self.weight.len() != n || self.jacobian.len() != entries {
            self.forget();
            for v in [&mut self.z, &mut self.before, &mut self.rates] {
                v.resize(S * n, 0.0);
            }
            for v in [&mut self.point, &mut self.weight, &mut self.end] {
                v.resize(n, 0.0);
            }
            for v in [&mut self.jacobian, &mut self.candidate] {
                v.resize(entries, 0.0);
            }
            self.w.resize(n, Wide::zero());
            self.rhs.resize(n, Wide::zero());
        }
        if self.accepted {
            std::mem::swap(&mut self.z, &mut self.before);
            self.h_before = Some(self.h);
            if self.known == Jacobian::Here {
                self.known = Jacobian::Earlier;
            }
            (self.tried, self.first) = (false, false);
        }
        (self.done, self.accepted) = (false, false);
    }

    /// Jacobian and factors as needed, starting values, and the iteration.
    fn try_newton(
        &mut self,
        problem: &mut impl Stiff,
        start: &Start<'_>,
        renew: bool,
        extrapolate: bool,
        rounding: f64,
    ) -> Iterations {
        self.factor(problem, start, renew)?;
        match self.h_before {
            Some(before) if extrapolate && (0.0..=EXTRAPOLATE).contains(&(self.h / before)) => {
                self.extrapolate(self.h / before);
            }
            _ => {
                self.z.fill(0.0);
                self.w.fill(Wide::zero());
                self.eta = 1.0;
            }
        }
        self.iterate(problem, start, rounding)
    }

    /// Jacobian and factors as needed.
    fn factor(&mut self, problem: &mut impl Stiff, start: &Start<'_>, renew: bool) -> Result<(), Attempt> {
        if renew {
            self.candidate.fill(0.0);
            problem.jacobian(0.0, start.y, &mut self.candidate);
            if self.candidate.iter().any(|v| !v.is_finite()) {
                self.known = Jacobian::Unknown;
                return Err(Attempt::NotFinite(None));
            }
            // A linear system keeps its factors.
            if self.known == Jacobian::Unknown || self.candidate != self.jacobian {
                std::mem::swap(&mut self.candidate, &mut self.jacobian);
                self.factored = f64::NAN;
                self.confirmed = if start.pattern.is_dominant(&self.jacobian) { f64::INFINITY } else { 0.0 };
            }
            self.known = Jacobian::Here;
        }
        if self.factored != self.h {
            self.factorisations += 1;
            self.factored = self.h;
            if !start.pattern.factor(&self.jacobian, self.lambda, self.h, &mut self.factors) {
                self.factored = f64::NAN;
                return Err(Attempt::Diverged);
            }
        }
        Ok(())
    }

    /// Starting values from the collocation polynomial of the step before; `ratio` of the step lengths.
    fn extrapolate(&mut self, ratio: f64) {
        let n = self.w.len();
        let from: [[f64; S]; S] = std::array::from_fn(|i| {
            let mut row = self.table.lagrange(1.0 + self.table.nodes[i] * ratio);
            row[S - 1] -= 1.0;
            row
        });
        for i in 0..n {
            let old: [f64; S] = std::array::from_fn(|j| self.before[j * n + i]);
            let z = product(&from, &old);
            (0..S).for_each(|j| self.z[j * n + i] = z[j]);
            self.w[i] = pack(&product(&self.table.inverse, &z));
        }
    }

    /// Simplified Newton iteration on the transformed increments (IV.8).
    fn iterate(&mut self, problem: &mut impl Stiff, start: &Start<'_>, rounding: f64) -> Iterations {
        let Start { pattern, y, tolerance, .. } = *start;
        let (n, h, most) = (self.w.len(), self.h, 2 * S as u32 + 1);
        let kappa = KAPPA.max(rounding);
        let (mut last, mut last_ratio) = (0.0, 0.0);
        self.eta = self.eta.max(f64::EPSILON).powf(0.8);
        self.slow = false;
        for iteration in 1..=most {
            for (j, (rates, z)) in self.rates.chunks_exact_mut(n).zip(self.z.chunks_exact(n)).enumerate() {
                for (p, (y, z)) in self.point.iter_mut().zip(y.iter().zip(z)) {
                    *p = y + z;
                }
                problem.rates(self.table.nodes[j] * h, &self.point, rates);
                self.rates_used += 1;
            }
            // 0 as long as all rates are finite.
            let mut check = 0.0;
            for i in 0..n {
                let f: [f64; S] = std::array::from_fn(|j| h * self.rates[j * n + i]);
                check += f.iter().sum::<f64>() * 0.0;
                let f = pack::<S, L>(&product(&self.table.inverse, &f));
                self.rhs[i] = f.sub(self.lambda.mul(self.w[i]));
            }
            if check != 0.0 || check.is_nan() {
                return Err(Attempt::NotFinite(
                    self.rates.iter().position(|f| !f.is_finite()).map(|i| i % n),
                ));
            }
            pattern.solve(&self.factors, &mut self.rhs);
            let mut norm = 0.0;
            for (i, before) in y.iter().enumerate() {
                self.w[i] = self.w[i].add(self.rhs[i]);
                let d = product(&self.table.vectors, &unpack::<S, L>(self.rhs[i]));
                let mut largest = 0.0;
                for (j, d) in d.iter().enumerate() {
                    self.z[j * n + i] += d;
                    largest = if d.abs() > largest { d.abs() } else { largest };
                }
                if before.abs() < FLOOR {
                    self.weigh_by_change(i, tolerance);
                }
                let share = largest * self.weight[i];
                norm = if share > norm { share } else { norm };
            }
            if iteration > 1 {
                let ratio: f64 = norm / last;
                let theta = if iteration == 2 { ratio } else { (ratio * last_ratio).sqrt() };
                last_ratio = ratio;
                if norm > rounding {
                    self.slow = theta > FAST;
                    if theta.is_nan() || theta >= 0.99 {
                        return Err(Attempt::Diverged);
                    }
                    self.eta = theta / (1.0 - theta);
                    if self.eta * norm * theta.powi((most - iteration) as i32) > kappa {
                        return Err(Attempt::Diverged);
                    }
                }
            }
            if self.eta * norm <= kappa || norm <= rounding {
                return Ok(iteration);
            }
            last = norm;
        }
        Err(Attempt::Diverged)
    }

    /// What was next to nothing, and is driven, errs relative to what it becomes in the step.
    fn weigh_by_change(&mut self, component: usize, tolerance: f64) {
        let changes = self.z.iter().skip(component).step_by(self.weight.len());
        let most = changes.fold(0.0, |most: f64, z| most.max(z.abs()));
        self.weight[component] = self.weight[component].min(1.0 / (tolerance * most));
    }

    /// See [`Stages::absolute_error`](super::stages::Stages::absolute_error).
    pub fn absolute_error(&self, y: &[f64]) -> f64 {
        let errors = self.errors.iter().zip(y).map(|([error], y)| error.abs() / y.abs().max(1.0));
        errors.fold(0.0, f64::max)
    }

    /// Error of the embedded formula of order s, filtered by `(lambda_0 / h - J)^-1`, and filtered once more
    /// where the first value may be far too large (IV.8).
    fn estimate(&mut self, problem: &mut impl Stiff, start: &Start<'_>, twice: bool) -> f64 {
        let (y, n) = (start.y, start.y.len());
        let mut errors = std::mem::take(&mut self.errors);
        let mut error = self.filter(start, start.rate, &mut errors);
        if error >= 1.0 && twice {
            for (p, (y, e)) in self.point.iter_mut().zip(y.iter().zip(&errors)) {
                *p = y + e[0];
            }
            let mut rates = std::mem::take(&mut self.rates);
            problem.rates(0.0, &self.point, &mut rates[..n]);
            self.rates_used += 1;
            if rates[..n].iter().all(|f| f.is_finite()) {
                let mut again = std::mem::take(&mut self.again);
                error = self.filter(start, &rates[..n], &mut again);
                self.again = again;
            }
            self.rates = rates;
        }
        self.errors = errors;
        error
    }

    /// Filtered error of each component for a given rate at the beginning; its norm.
    fn filter(&mut self, start: &Start<'_>, rate: &[f64], errors: &mut Vec<[f64; 1]>) -> f64 {
        let n = rate.len();
        errors.clear();
        errors.extend(rate.iter().enumerate().map(|(i, rate)| {
            let mut v = self.h * rate;
            (0..S).for_each(|j| v += self.table.error[j] * self.z[j * n + i]);
            [v]
        }));
        start.pattern.solve_real(&self.factors, errors);
        self.shares.clear();
        self.shares.extend(errors.iter().zip(&self.weight).map(|(e, w)| (e[0] * w).abs()));
        self.shares.iter().fold(0.0, |m, &v| if v > m || v.is_nan() { v } else { m })
    }

    /// The error inside the last attempt done, which began at `y`: see [`Stages::interior_error`](super::stages::Stages::interior_error).
    pub fn interior_error(
        &self,
        pattern: &Pattern,
        Beginning { y, rates: at_start, rough }: Beginning<'_>,
        mut rates: impl FnMut(f64, &[f64], &mut [f64]),
    ) -> InteriorError {
        let n = y.len();
        let places = &self.table.between;
        let sum = |i: usize, of: &[f64; S]| (0..S).map(|j| of[j] * self.z[j * n + i]).sum::<f64>();
        // What is integrated again does not count.
        let silence = |errors: &mut [[f64; 2]]| rough.iter().for_each(|i| errors[*i as usize] = [0.0; 2]);
        let mut errors = vec![[0.0; 2]; n];
        if self.form == Form::LinearSteady {
            // The defect is known from that at the start, and so is what it leaves.
            for (inside, [error]) in errors.iter_mut().zip(&self.errors) {
                *inside = places.each_ref().map(|at| at.defect * error);
            }
        } else {
            let (mut point, mut found) = (vec![0.0; n], vec![0.0; n]);
            for (number, at) in places.iter().enumerate() {
                for (i, (point, y)) in point.iter_mut().zip(y).enumerate() {
                    *point = y + sum(i, &at.values);
                }
                rates(at.place * self.h, &point, &mut found);
                for (i, (error, rate)) in errors.iter_mut().zip(&found).enumerate() {
                    error[number] = self.h * rate - sum(i, &at.slopes);
                }
            }
            silence(&mut errors);
            pattern.solve_real(&self.factors, &mut errors);
        }
        silence(&mut errors);
        let mut worst = InteriorError::default();
        for (i, errors) in errors.into_iter().enumerate() {
            let size = y[i].abs();
            for (error, at) in errors.into_iter().zip(places) {
                let error = error.abs();
                if !error.is_finite() {
                    continue;
                }
                worst.absolute = worst.absolute.max(error / size.max(1.0));
                // A value that is larger on its way makes the error less.
                let scale = size.max((self.h * at_start[i]).abs()) + FLOOR;
                if error > worst.relative * scale {
                    let slope = sum(i, &at.slopes).abs();
                    let scale = scale.max(slope).max((y[i] + sum(i, &at.values)).abs());
                    worst.relative = worst.relative.max(error / scale);
                }
            }
        }
        worst
    }

    pub fn dense(&self, y: &[f64], out: &mut Vec<f64>) {
        let n = self.end.len();
        out.clear();
        out.reserve((S + 1) * n);
        for (i, (y, end)) in y.iter().zip(&self.end).enumerate() {
            let z: [f64; S] = std::array::from_fn(|j| self.z[j * n + i]);
            let inner = product(&self.table.bernstein, &z);
            out.push(*y);
            out.extend(inner[..S - 1].iter().map(|b| y + b));
            out.push(*end);
        }
    }
}

#[inline(always)]
fn product<const S: usize>(matrix: &[[f64; S]; S], x: &[f64; S]) -> [f64; S] {
    let mut out = [0.0; S];
    for i in 0..S {
        for j in 0..S {
            out[i] += matrix[i][j] * x[j];
        }
    }
    out
}

/// Real coordinates (v_0, Re v_1, Im v_1, ..) as lanes: a Re v + b Im v is the real part of (a - i b) v.
#[inline(always)]
fn pack<const S: usize, const L: usize>(x: &[f64; S]) -> Wide<L> {
    let mut out = Wide::from_f64(0.0);
    out.re[0] = x[0];
    for l in 1..L {
        out.re[l] = x[2 * l - 1];
        out.im[l] = -x[2 * l];
    }
    out
}

/// Inverse of `pack`.
#[inline(always)]
fn unpack<const S: usize, const L: usize>(x: Wide<L>) -> [f64; S] {
    let mut out = [0.0; S];
    out[0] = x.re[0];
    for l in 1..L {
        out[2 * l - 1] = x.re[l];
        out[2 * l] = -x.im[l];
    }
    out
}
