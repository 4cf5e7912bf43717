//! Steps of the implicit method: Radau IIA over a sparse Jacobian.

use super::dense::Dense;
use super::radau::{Attempt, Radau, Stiff};
use super::runge_kutta::{Rates, Trial, Workspace};
use super::sparse::Pattern;
use dlsys_expr::SimTime;

/// Tighter than this, five stages need fewer evaluations than three.
const FIVE_STAGES_BELOW: f64 = 1e-5;

/// Errors below the tolerated part of this are none, whatever they are errors of.
const FLOOR: f64 = 1e-18;

/// The method with what it knows of one system.
#[derive(Clone)]
pub struct Implicit {
    radau: Radau,
    stages: usize,
    /// The structure of the Jacobian, and where each partial derivative goes.
    pattern: Option<(Pattern, Vec<usize>)>,
    scale: Vec<f64>,
    coefficients: Vec<f64>,
}

/// A system whose partial derivatives are put into their places.
struct Placed<'a, R> {
    system: &'a mut R,
    places: &'a [usize],
    values: Vec<f64>,
    evaluations: u64,
}

impl<R: Rates> Stiff for Placed<'_, R> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.evaluations += 1;
        self.system.rates(tau, y, out);
    }

    fn jacobian(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.system.partials(tau, y, &mut self.values);
        for (&place, value) in self.places.iter().zip(&self.values) {
            out[place] += value;
        }
    }
}

fn stages(tolerance: f64) -> usize {
    if tolerance < FIVE_STAGES_BELOW { 5 } else { 3 }
}

impl Implicit {
    pub fn new(tolerance: f64) -> Implicit {
        let stages = stages(tolerance);
        let radau = Radau::new(stages).expect("there are methods of 3 and of 5 stages");
        Implicit { radau, stages, pattern: None, scale: Vec::new(), coefficients: Vec::new() }
    }

    /// The nodes of the stages.
    pub fn nodes(&self) -> &[f64] {
        self.radau.nodes()
    }

    /// True if the method is the one for a tolerance.
    pub fn fits(&self, tolerance: f64) -> bool {
        self.stages == stages(tolerance)
    }

    pub fn error_order(&self) -> u32 {
        self.stages as u32
    }

    /// Forgets the system.
    pub fn forget(&mut self) {
        self.pattern = None;
        self.radau.forget();
    }

    /// Tries a step from `y`, whose rates the workspace knows; leaves the end there.
    pub fn attempt(
        &mut self,
        workspace: &mut Workspace,
        system: &mut impl Rates,
        y: &[f64],
        h: f64,
        tolerance: f64,
    ) -> Trial {
        let rates = workspace.rates_at_start();
        let largest = y.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        self.scale.clear();
        // As for explicit methods; but the rate at the start of a fast transient says nothing about its size.
        let largest = if largest > 0.0 { largest } else { f64::INFINITY };
        let scale = |(y, f): (&f64, &f64)| tolerance * (y.abs().max((h * f).abs().min(largest)) + FLOOR);
        self.scale.extend(y.iter().zip(rates).map(scale));
        let (pattern, places) = match &mut self.pattern {
            Some(known) => known,
            unknown => {
                let couplings = system.couplings();
                let Some(pattern) = Pattern::new(y.len(), &couplings) else { return Trial::Diverged };
                let place = |&(row, column): &(u32, u32)| pattern.entry(row as usize, column as usize);
                let places = couplings.iter().filter_map(place).collect();
                unknown.insert((pattern, places))
            }
        };
        let modules = system.modules();
        let mut placed = Placed { system, places, values: Vec::new(), evaluations: 0 };
        let attempt = self.radau.attempt(&mut placed, pattern, y, rates, h, &self.scale);
        workspace.evaluations += placed.evaluations * modules;
        match attempt {
            Attempt::Done { error, .. } => {
                workspace.end.copy_from_slice(self.radau.end());
                Trial::Done { error, rounding: 0.0 }
            }
            Attempt::Diverged => Trial::Diverged,
            Attempt::NotFinite(component) => Trial::NotFinite(component.unwrap_or(0)),
        }
    }

    /// Says that the step just tried is taken.
    pub fn accept(&mut self) {
        self.radau.accept();
    }

    /// The dense output of the step just tried.
    pub fn dense(&mut self, start: SimTime, y: &[f64], h: f64) -> Dense {
        self.radau.dense(y, &mut self.coefficients);
        Dense::new(start, None, h, self.stages, self.coefficients.clone())
    }
}
