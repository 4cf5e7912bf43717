//! Radau IIA collocation for stiff systems: s = 3 or 5 stages, order 2s - 1, L-stable.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (2nd ed. 1996), section IV.8, and the
//! same authors' "Stiff differential equations solved by Radau methods", J. Comput. Appl. Math. 111 (1999)
//! 93. The stages' linear systems are decoupled by the eigenvectors of the inverse Runge-Kutta matrix; the
//! real and the complex ones are eliminated side by side, as lanes of one wide number.
//!
//! Here the method meets the other ones ([`OneStep`]): number of stages, scale of errors, the places of partial derivatives in the
//! sparse Jacobian. `stages.rs` holds what a step needs of its system, `newton.rs` makes the step.

mod collocation;
mod newton;
mod stages;

use crate::Rates;
use crate::dense::Dense;
use crate::one_step::{InteriorError, OneStep, Step, Trial};
use crate::sparse::Pattern;
use crate::workspace::{FLOOR, Workspace};
use dlsys_expr::SimTime;
use stages::{Attempt, Beginning, Form, Stages, Start, Stiff};

/// Tighter than this, five stages need fewer evaluations than three.
const FIVE_STAGES_BELOW: f64 = 1e-5;

/// The method, with what it knows of one system.
#[derive(Clone, Default)]
pub struct Radau {
    /// None before the first step.
    stages: Option<Stages>,
    pattern: Option<Structure>,
    /// The structure is that of another system, perhaps.
    is_doubtful: bool,
    /// The partial derivatives as they were last evaluated; none before that.
    partials: Vec<f64>,
    scale: Vec<f64>,
    blur: Vec<f64>,
    /// How far the resolution of time moves each component in a step; empty if rates do not depend on time.
    blur_of_time: Vec<f64>,
    coefficients: Vec<f64>,
}

/// The structure of the Jacobian: of each partial derivative, row and column, and its place.
#[derive(Clone)]
struct Structure {
    pattern: Pattern,
    couplings: Vec<(u32, u32)>,
    places: Vec<usize>,
}

/// A system whose partial derivatives are put into their places.
struct Placed<'a, R> {
    system: &'a mut R,
    places: &'a [usize],
    values: &'a mut Vec<f64>,
    evaluations: u64,
}

impl<R: Rates> Stiff for Placed<'_, R> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.evaluations += 1;
        self.system.rates(tau, y, out);
    }

    fn jacobian(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.system.partials(tau, y, self.values);
        for (&place, value) in self.places.iter().zip(&*self.values) {
            out[place] += value;
        }
    }

    fn form(&self) -> Form {
        if self.system.is_linear() && self.system.is_steady() { Form::LinearSteady } else { Form::Any }
    }
}

/// How far rounding of the state moves each component in a step, by the partial derivatives that are known: a component that decays at the
/// rate d forgets it in the time 1/d. What has come to rest where its rate is a difference of large terms is no better known, and a
/// step that knew it better would be of no length.
fn blur(couplings: &[(u32, u32)], partials: &[f64], y: &[f64], h: f64, out: &mut Vec<f64>) {
    out.clear();
    out.resize(y.len(), 0.0);
    for (&(row, column), slope) in couplings.iter().zip(partials) {
        let noise = (slope * y[column as usize]).abs();
        out[row as usize] += if noise.is_finite() { noise } else { 0.0 };
    }
    for noise in &mut *out {
        *noise *= ROUNDINGS * f64::EPSILON * h.abs();
    }
    for (&(row, _), slope) in couplings.iter().zip(partials).filter(|((row, column), _)| row == column) {
        out[row as usize] /= 1.0 + (h * slope).abs();
    }
}

/// Roundings of a rate, in units of that of its largest term, or of time.
const ROUNDINGS: f64 = 4.0;
/// Where in a step rates that depend on time are evaluated for their change.
const LATER: f64 = 0.25;

impl Radau {
    /// Rates that depend on time are known as well as time is: what begins at an instant within an age is not known to its own digits at once.
    fn blur_of_time(&mut self, work: &mut Workspace, system: &mut impl Rates, Step { y, h, .. }: Step<'_>) {
        self.blur_of_time.clear();
        if work.tick == 0.0 {
            return;
        }
        work.stage[..y.len()].copy_from_slice(y);
        work.evaluate(system, LATER * h, 1);
        let blur = |(later, now): (&f64, &f64)| {
            let blur = ROUNDINGS * work.tick / LATER * (later - now).abs();
            if blur.is_finite() { blur } else { 0.0 }
        };
        self.blur_of_time.extend(work.k[1].iter().zip(work.rates_at_start()).map(blur));
    }
}

impl OneStep for Radau {
    /// Between the ends of its long steps the solution is known less well than there.
    const TOLERANCE_SHARE: f64 = 0.01;
    /// A stiff component lies on what it follows at the stages, however many periods of that are between them.
    const INTERIOR_IS_MEASURED: bool = true;

    fn prepare(&mut self, tolerance: f64) {
        let count = if tolerance < FIVE_STAGES_BELOW { 5 } else { 3 };
        if self.stages.as_ref().is_none_or(|stages| stages.count() != count) {
            *self = Radau { stages: Some(Stages::of(count)), ..Radau::default() };
        }
    }

    fn forget(&mut self) {
        self.is_doubtful = true;
        self.partials.clear();
        if let Some(stages) = &mut self.stages {
            stages.forget();
        }
    }

    fn error_order(&self) -> u32 {
        self.stages.as_ref().map_or(0, Stages::count) as u32
    }

    /// Whatever the number of stages: the first step has nothing to do with stiffness yet.
    fn starting_order(&self) -> u32 {
        4
    }

    fn stages(&self) -> usize {
        // Its own are kept elsewhere.
        2
    }

    fn nodes(&self) -> &[f64] {
        self.stages.as_ref().map_or(&[0.0, 0.5, 1.0], |stages| stages.nodes())
    }

    fn attempt(
        &mut self,
        work: &mut Workspace,
        system: &mut impl Rates,
        step: Step<'_>,
        tolerance: f64,
    ) -> Trial {
        let Step { y, h, .. } = step;
        self.blur_of_time(work, system, step);
        let rate = work.rates_at_start();
        let largest = y.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        self.scale.clear();
        // As for explicit methods; but the rate at the start of a fast transient says nothing about its size. Nor does what is left of
        // values that have decayed, once something flows in.
        let largest = if largest > FLOOR { largest } else { f64::INFINITY };
        let floor = work.floor;
        let scale = |(y, f): (&f64, &f64)| tolerance * (y.abs().max((h * f).abs().min(largest)) + floor);
        self.scale.extend(y.iter().zip(rate).map(scale));
        let Some(stages) = &mut self.stages else { return Trial::Diverged };
        let others = std::mem::take(&mut self.is_doubtful).then(|| system.couplings());
        // Mostly a system has the couplings of the one before.
        let is_same = |known: &Structure, couplings: &Vec<(u32, u32)>| {
            known.pattern.unknowns() == y.len() && known.couplings == *couplings
        };
        let is_other = |known: &mut Structure| others.as_ref().is_some_and(|others| !is_same(known, others));
        self.pattern.take_if(is_other);
        let Structure { pattern, couplings, places } = match &mut self.pattern {
            Some(known) => known,
            unknown => {
                let couplings = others.unwrap_or_else(|| system.couplings());
                let Some(pattern) = Pattern::new(y.len(), &couplings) else { return Trial::Diverged };
                let place = |&(row, column): &(u32, u32)| pattern.entry(row as usize, column as usize);
                let places = couplings.iter().filter_map(place).collect();
                unknown.insert(Structure { pattern, couplings, places })
            }
        };
        blur(couplings, &self.partials, y, h, &mut self.blur);
        for (scale, blur) in self.scale.iter_mut().zip(&self.blur) {
            *scale = scale.max(*blur);
        }
        for (scale, blur) in self.scale.iter_mut().zip(&self.blur_of_time) {
            *scale += *blur;
        }
        let modules = system.modules();
        let mut placed = Placed { system, places, values: &mut self.partials, evaluations: 0 };
        let start = Start { pattern, y, rate, scale: &self.scale, tolerance };
        let attempt = stages.attempt(&mut placed, &start, h);
        work.evaluations += placed.evaluations * modules;
        match attempt {
            Attempt::Done { error, .. } => {
                work.end.copy_from_slice(stages.end());
                Trial::Done { error, rounding: 0.0 }
            }
            Attempt::Diverged => Trial::Diverged,
            Attempt::NotFinite(component) => Trial::NotFinite(component.unwrap_or(0)),
        }
    }

    fn absolute_error(&self, _: &Workspace, step: Step<'_>, _: f64, _: f64) -> f64 {
        self.stages.as_ref().map_or(0.0, |stages| stages.absolute_error(step.y))
    }

    fn component_errors(&self) -> &[f64] {
        self.stages.as_ref().map_or(&[], Stages::component_errors)
    }

    /// The end of the step is `start + h`, whatever else is known of it.
    fn dense(&mut self, _: &mut Workspace, _: &mut impl Rates, step: Step<'_>, _: Option<SimTime>) -> Dense {
        let count = self.stages.as_ref().map_or(0, |stages| {
            stages.dense(step.y, &mut self.coefficients);
            stages.count()
        });
        Dense::new(step.start, None, step.h, count, std::mem::take(&mut self.coefficients))
    }

    /// By the defect between stages, the difference between the rates of the equations and that of the output, filtered as the estimate
    /// at the end is: of a stiff component, that is its distance from what it follows.
    fn interior_error(
        &self,
        work: &mut Workspace,
        system: &mut impl Rates,
        y: &[f64],
        _: &Dense,
    ) -> InteriorError {
        let (Some(stages), Some(Structure { pattern, .. })) = (&self.stages, &self.pattern) else {
            return InteriorError::default();
        };
        let Workspace { k, rough, evaluations, .. } = work;
        let rates = |tau: f64, y: &[f64], out: &mut [f64]| {
            *evaluations += system.modules();
            system.rates(tau, y, out);
        };
        stages.interior_error(pattern, Beginning { y, rates: &k[0], rough }, rates)
    }

    fn accept(&mut self, _: &mut Workspace) -> bool {
        if let Some(stages) = &mut self.stages {
            stages.accept();
        }
        false
    }
}

#[cfg(test)]
mod tests;
