//! Orders of methods and of their dense outputs; the measured error of interpolation.

use super::*;
use crate::control::{Control, StepSettings};
use crate::stepper::Stepper;
use crate::workspace::{MAX_STAGES, Workspace};

/// y' = y cos(t), y(0) = 1: y = exp(sin t).
struct Growth {
    t: f64,
}

impl Rates for Growth {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        out[0] = y[0] * (self.t + tau).cos();
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        vec![(0, 0)]
    }

    fn partials(&mut self, tau: f64, _: &[f64], out: &mut Vec<f64>) {
        out.push((self.t + tau).cos());
    }

    fn modules(&self) -> u64 {
        1
    }
}

/// Components that do not read one another: y' = (1 + j/8) sin y cos t + t.
struct Copies;

impl Rates for Copies {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        for (j, (y, out)) in y.iter().zip(out).enumerate() {
            *out = (1.0 + j as f64 / 8.0) * y.sin() * tau.cos() + tau;
        }
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        Vec::new()
    }

    fn partials(&mut self, _: f64, _: &[f64], _: &mut Vec<f64>) {}

    fn modules(&self) -> u64 {
        1
    }
}

/// The end of a step of so many components, with its dense output and their ranges.
fn step_of(scheme: Scheme, n: usize) -> (Vec<f64>, Dense, [Vec<f64>; 2]) {
    let (mut work, mut schemes) = (Workspace::default(), Schemes::default());
    work.provide(n, MAX_STAGES);
    work.keep_reached(true);
    let y: Vec<f64> = (0..n).map(|j| 0.3 + 0.2 * j as f64).collect();
    work.start(&mut Copies, &y).expect("finite");
    let step = Step { y: &y, start: SimTime::ZERO, h: 0.75 };
    let tried = schemes.attempt(scheme, &mut work, &mut Copies, step, 1e-6);
    assert!(matches!(tried, Trial::Done { error, .. } if error > 0.0), "{tried:?}");
    let dense = schemes.dense(scheme, &mut work, &mut Copies, step, None);
    (work.end().to_vec(), dense, work.reached.clone())
}

#[test]
fn few_components_are_to_the_bit_what_they_are_among_many() {
    for scheme in [Scheme::Dopri5, Scheme::Dop853] {
        let (all, dense, reached) = step_of(scheme, 9);
        for n in 1..=5 {
            let (few, of_few, range) = step_of(scheme, n);
            assert_eq!(few, all[..n]);
            for j in 0..n {
                assert_eq!(of_few.of(j), dense.of(j), "{scheme:?}, component {j} of {n}");
                assert_eq!([range[0][j], range[1][j]], [reached[0][j], reached[1][j]]);
            }
        }
    }
}

/// Largest error at step ends, and in the middle of steps, on [0, 2].
fn errors(scheme: Scheme, steps: usize) -> (f64, f64) {
    let h = 2.0 / steps as f64;
    let (mut work, mut schemes) = (Workspace::default(), Schemes::default());
    work.provide(1, MAX_STAGES);
    schemes.prepare(scheme, 1.0);
    let mut y = vec![1.0];
    let (mut end, mut inside): (f64, f64) = (0.0, 0.0);
    for i in 0..steps {
        let mut system = Growth { t: i as f64 * h };
        work.start(&mut system, &y).expect("finite");
        let step = Step { y: &y, start: SimTime::ZERO, h };
        schemes.attempt(scheme, &mut work, &mut system, step, 1.0);
        let dense = schemes.dense(scheme, &mut work, &mut system, step, None);
        y.copy_from_slice(work.end());
        let exact = |s: f64| (system.t + s * h).sin().exp();
        end = end.max((y[0] - exact(1.0)).abs());
        for s in [0.25, 0.5, 0.8] {
            inside = inside.max((dense.value(0, s) - exact(s)).abs());
        }
    }
    (end, inside)
}

#[test]
fn explicit_methods_and_their_dense_outputs_have_the_order_of_the_table() {
    for (_, method) in Method::NAMED {
        let Some(scheme) = method.scheme().filter(|_| !method.is_implicit()) else { continue };
        let order = f64::from(scheme.facts().order);
        let steps = if order > 5.0 { [8, 16] } else { [20, 80] };
        let (coarse, fine) = (errors(scheme, steps[0]), errors(scheme, steps[1]));
        let slope = |a: f64, b: f64| (a / b).ln() / (steps[1] as f64 / steps[0] as f64).ln();
        let (ends, inside) = (slope(coarse.0, fine.0), slope(coarse.1, fine.1));
        assert!((ends - order).abs() < 0.7, "{method:?}: order {ends}");
        // A dense output of degree p over one step errs like h^(p+1), as the ends do after many.
        assert!((inside - order).abs() < 0.7, "{method:?}: dense order {inside}");
    }
}

/// y' = zy.
struct Decay(f64);

impl Rates for Decay {
    fn rates(&mut self, _: f64, y: &[f64], out: &mut [f64]) {
        out[0] = self.0 * y[0];
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        vec![(0, 0)]
    }

    fn partials(&mut self, _: f64, _: &[f64], out: &mut Vec<f64>) {
        out.push(self.0);
    }

    fn modules(&self) -> u64 {
        1
    }
}

#[test]
fn the_measured_interior_error_is_close_to_the_true_one() {
    for z in [-25.0, -16.0, -12.0, -10.0, -8.3, -7.0, -6.0, -5.0, -4.0, -2.0, -1.0, 1.0, 2.0] {
        let (mut work, mut schemes, mut system) = (Workspace::default(), Schemes::default(), Decay(z));
        work.provide(1, MAX_STAGES);
        work.start(&mut system, &[1.0]).expect("finite");
        let step = Step { y: &[1.0], start: SimTime::ZERO, h: 1.0 };
        schemes.attempt(Scheme::Dop853, &mut work, &mut system, step, 1e-9);
        let dense = schemes.dense(Scheme::Dop853, &mut work, &mut system, step, None);
        let error = |i: i32| (dense.value(0, f64::from(i) / 100.0) - (z * f64::from(i) / 100.0).exp()).abs();
        let worst = (0..=100).map(error).fold(0.0, f64::max);
        let measured =
            schemes.interior_error(Scheme::Dop853, &mut work, &mut system, &[1.0], &dense).absolute;
        assert!(measured >= 0.75 * worst && measured <= 2.0 * worst, "z = {z}: {measured}, not {worst}");
    }
}

/// y' = -rate (y - 1) for each component.
struct Relaxation(Vec<f64>);

impl Rates for Relaxation {
    fn rates(&mut self, _: f64, y: &[f64], out: &mut [f64]) {
        for (out, (rate, y)) in out.iter_mut().zip(self.0.iter().zip(y)) {
            *out = rate * (1.0 - y);
        }
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        (0..self.0.len() as u32).map(|i| (i, i)).collect()
    }

    fn partials(&mut self, _: f64, _: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.0.iter().map(|rate| -rate));
    }

    fn modules(&self) -> u64 {
        1
    }
}

/// A component that relaxes a thousand times as fast as the others shortens the step for all, unless it is spared; then it
/// is named, and the others are as exact as ever.
#[test]
fn a_component_that_is_spared_does_not_shorten_the_step() {
    let mut system = Relaxation(vec![1.0, 1.5, 1000.0, 2.0, 1.2]);
    let settings = crate::StepSettings { method: Method::Radau, tolerance: 1e-6, step_size: 1.0 };
    let y = vec![2.0; 5];
    let step = |spared: usize, system: &mut Relaxation| {
        let mut stepper = crate::Stepper::default();
        stepper.spared = spared;
        let mut control = crate::Control { size: 0.1, ..Default::default() };
        stepper.restart(settings.method, y.len());
        let end = stepper.step(&settings, &mut control, system, &y, SimTime::ZERO, None).expect("a step");
        (end.to_f64(), stepper.rough().to_vec(), stepper.end_mut().to_vec())
    };
    let (short, none, _) = step(0, &mut system);
    assert!(short < 0.02 && none.is_empty(), "{short} {none:?}");
    let (long, rough, end) = step(1, &mut system);
    assert_eq!((long, rough), (0.1, vec![2]));
    for i in [0, 1, 3, 4] {
        let exact = 1.0 + (-system.0[i] * long).exp();
        assert!((end[i] - exact).abs() < 1e-8, "{} for {exact}", end[i]);
    }
}

/// The rates of [`Growth`] with the range of the states at which they were asked for.
struct Recorded {
    growth: Growth,
    range: (f64, f64),
}

impl Rates for Recorded {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.range = (self.range.0.min(y[0]), self.range.1.max(y[0]));
        self.growth.rates(tau, y, out);
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        self.growth.couplings()
    }

    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        self.growth.partials(tau, y, out);
    }

    fn modules(&self) -> u64 {
        1
    }
}

#[test]
fn the_range_of_a_step_is_that_of_the_states_at_its_stages() {
    for method in [Method::Dopri5, Method::Dop853] {
        let mut system = Recorded { growth: Growth { t: 0.0 }, range: (1.0, 1.0) };
        let settings = StepSettings { method, tolerance: 1e-9, step_size: 0.1 };
        let mut stepper = Stepper::default();
        stepper.restart(method, 1);
        let mut control = Control { size: 1e-2, ..Control::default() };
        let start = stepper.step(&settings, &mut control, &mut system, &[1.0], SimTime::ZERO, None);
        assert!(start.is_ok() && stepper.reached().is_none(), "it is kept only where that is asked for");
        stepper.reached_is_kept = true;
        stepper.restart(method, 1);
        system.range = (1.0, 1.0);
        stepper.step(&settings, &mut control, &mut system, &[1.0], SimTime::ZERO, None).expect("a step");
        stepper.dense(&mut system, &[1.0]);
        assert_eq!(stepper.counts().1, 0, "no step was rejected");
        let (least, greatest) = stepper.reached().and_then(|reached| reached.of(0)).expect("it is kept");
        // The defect of the dense output is measured at a place of its own, which is on that.
        assert_eq!(least, 1.0);
        assert!(greatest > 1.0 && greatest >= system.range.1 - 1e-12, "{greatest}, {:?}", system.range);
    }
    let mut implicit = Stepper::default();
    implicit.reached_is_kept = true;
    implicit.restart(Method::Radau, 1);
    let settings = StepSettings { method: Method::Radau, tolerance: 1e-6, step_size: 0.1 };
    let mut system = Growth { t: 0.0 };
    let step = implicit.step(&settings, &mut Control::default(), &mut system, &[1.0], SimTime::ZERO, None);
    assert!(step.is_ok() && implicit.reached().is_none());
}
