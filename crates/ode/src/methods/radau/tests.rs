//! Tests of the Radau IIA steps: orders, stiff references, cost.

use super::stages::{Attempt, Beginning, Form, Stages, Start, Stiff};
use crate::sparse::Pattern;

/// A system of rates and a Jacobian in absolute time, with the time of the step's beginning.
struct Case<R, J> {
    time: f64,
    rates: R,
    jacobian: J,
}

impl<R: Fn(f64, &[f64], &mut [f64]), J: Fn(f64, &[f64], &mut [f64])> Stiff for Case<R, J> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        (self.rates)(self.time + tau, y, out);
    }
    fn jacobian(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        (self.jacobian)(self.time + tau, y, out);
    }
}

/// What a run took: good steps, other attempts, rates, factorisations.
#[derive(Debug)]
#[allow(dead_code)]
struct Cost {
    steps: u32,
    failed: u32,
    rates: u64,
    factorisations: u64,
}

/// Integrates to `until` with plain error control; `scale_i = relative |y_i| + absolute`.
fn integrate<R: Fn(f64, &[f64], &mut [f64]), J: Fn(f64, &[f64], &mut [f64])>(
    case: &mut Case<R, J>,
    stages: usize,
    pattern: &Pattern,
    y: &mut Vec<f64>,
    until: f64,
    (relative, absolute, first): (f64, f64, f64),
) -> Cost {
    let mut radau = Stages::of(stages);
    let (mut h, mut steps, mut failed, mut after_failure) = (first, 0, 0, false);
    let (mut rate, mut scale) = (vec![0.0; y.len()], vec![0.0; y.len()]);
    case.rates(0.0, y, &mut rate);
    while case.time < until {
        let last = case.time + h * (1.0 + 1e-9) >= until;
        let step = if last { until - case.time } else { h };
        scale.iter_mut().zip(&*y).for_each(|(s, y)| *s = relative * y.abs() + absolute);
        let mut factor = 0.5;
        let mut good = false;
        if let Attempt::Done { error, newton } =
            radau.attempt(case, &Start { pattern, y, rate: &rate, scale: &scale, tolerance: 0.0 }, step)
        {
            let most = 2.0 * stages as f64 + 1.0;
            let safety = 0.9 * (2.0 * most + 1.0) / (2.0 * most + f64::from(newton));
            factor = (safety * error.max(1e-10).powf(-1.0 / (stages as f64 + 1.0))).clamp(0.125, 8.0);
            good = error <= 1.0;
        }
        if good {
            steps += 1;
            radau.accept();
            y.copy_from_slice(radau.end());
            case.time = if last { until } else { case.time + step };
            case.rates(0.0, y, &mut rate);
            // A factor near 1 is not worth new factors; after a failure the twice filtered error is too
            // small.
            if (1.0..1.2).contains(&factor) || (after_failure && factor > 1.0) {
                factor = 1.0;
            }
            after_failure = false;
        } else {
            failed += 1;
            after_failure = true;
            assert!(failed < 1_000, "stuck at {}", case.time);
        }
        h = step * factor;
    }
    Cost { steps, failed, rates: radau.rates_used(), factorisations: radau.factorisations() }
}

/// Rotation at speed (1 + r^2) / 2, r the radius: y = (cos t, sin t), nonlinear.
#[allow(clippy::type_complexity)]
fn rotation() -> Case<fn(f64, &[f64], &mut [f64]), fn(f64, &[f64], &mut [f64])> {
    let rates = |_: f64, y: &[f64], out: &mut [f64]| {
        let speed = 0.5 + 0.5 * (y[0] * y[0] + y[1] * y[1]);
        (out[0], out[1]) = (-speed * y[1], speed * y[0]);
    };
    // Places: (0, 0), (1, 1), (1, 0), (0, 1).
    let jacobian = |_: f64, y: &[f64], out: &mut [f64]| {
        let (a, b) = (y[0] * y[0], y[1] * y[1]);
        (out[0], out[1]) = (-y[0] * y[1], y[0] * y[1]);
        (out[2], out[3]) = (0.5 + 1.5 * a + 0.5 * b, -0.5 - 0.5 * a - 1.5 * b);
    };
    Case { time: 0.0, rates, jacobian }
}

#[test]
fn orders_are_five_and_nine() {
    let pattern = Pattern::new(2, &[(0, 1), (1, 0)]).unwrap();
    assert_eq!((pattern.entry(1, 0), pattern.entry(0, 1)), (Some(2), Some(3)));
    for (stages, counts) in [(3, [96, 144, 192]), (5, [24, 36, 48])] {
        let mut errors = Vec::new();
        for count in counts {
            let (mut radau, h) = (Stages::of(stages), 12.0 / f64::from(count));
            let (mut y, mut rate) = (vec![1.0, 0.0], [0.0; 2]);
            let mut case = rotation();
            for _ in 0..count {
                case.rates(0.0, &y, &mut rate);
                let outcome = radau.attempt(
                    &mut case,
                    &Start { pattern: &pattern, y: &y, rate: &rate, scale: &[1e-13; 2], tolerance: 0.0 },
                    h,
                );
                assert!(matches!(outcome, Attempt::Done { .. }), "{outcome:?}");
                radau.accept();
                y.copy_from_slice(radau.end());
                case.time += h;
            }
            errors.push((y[0] - 12f64.cos()).hypot(y[1] - 12f64.sin()));
        }
        let slope = |i: usize| {
            f64::ln(errors[i] / errors[i + 1]) / f64::ln(f64::from(counts[i + 1]) / f64::from(counts[i]))
        };
        let (slopes, first) = ([slope(0), slope(1)], errors[0]);
        println!("{stages} stages: first error {first:.1e}, slopes {slopes:.2?}");
        let order = 2.0 * stages as f64 - 1.0;
        assert!(slopes.iter().all(|s| (s - order).abs() < 0.3), "{slopes:?}");
    }
}

/// A. Prothero, A. Robinson, Math. Comp. 28 (1974) 145: stiffness must not spoil accuracy or step size.
#[test]
fn stiffness_costs_neither_accuracy_nor_steps() {
    let pattern = Pattern::new(1, &[]).unwrap();
    for (stages, tolerance, most) in [(3, 1e-6, 40), (3, 1e-10, 400), (5, 1e-6, 20), (5, 1e-10, 100)] {
        let rates = |t: f64, y: &[f64], out: &mut [f64]| out[0] = -1e6 * (y[0] - t.cos()) - t.sin();
        let mut case =
            Case { time: 0.0, rates, jacobian: |_: f64, _: &[f64], out: &mut [f64]| out[0] = -1e6 };
        let mut y = vec![1.0];
        let cost = integrate(&mut case, stages, &pattern, &mut y, 10.0, (0.0, tolerance, 1e-3));
        let error = (y[0] - 10f64.cos()).abs();
        println!("Prothero-Robinson, {stages} stages, {tolerance:e}: error {error:.1e}, {cost:?}");
        assert!(error < 10.0 * tolerance && cost.steps <= most, "{error:e} {cost:?}");
    }
}

/// H. Robertson's kinetics (Hairer, Wanner IV.1); reference of 16 digits at t = 40.
#[test]
#[allow(clippy::excessive_precision)]
fn robertson_kinetics_agree_with_the_reference_of_sixteen_digits() {
    let pattern = Pattern::new(3, &[(0, 1), (0, 2), (1, 0), (1, 2), (2, 1)]).unwrap();
    let at = |r, c| pattern.entry(r, c).unwrap();
    let reference = [0.7158270687194051, 9.185534764557764e-6, 0.2841637457458304];
    for stages in [3, 5] {
        let rates = |_: f64, y: &[f64], out: &mut [f64]| {
            let (a, b, c) = (0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]);
            out.copy_from_slice(&[b - a, a - b - c, c]);
        };
        let jacobian = |_: f64, y: &[f64], out: &mut [f64]| {
            let (b1, b2, c) = (1e4 * y[2], 1e4 * y[1], 6e7 * y[1]);
            (out[at(0, 0)], out[at(0, 1)], out[at(0, 2)]) = (-0.04, b1, b2);
            (out[at(1, 0)], out[at(1, 1)], out[at(1, 2)]) = (0.04, -b1 - c, -b2);
            out[at(2, 1)] = c;
        };
        let mut case = Case { time: 0.0, rates, jacobian };
        let mut y = vec![1.0, 0.0, 0.0];
        let cost = integrate(&mut case, stages, &pattern, &mut y, 40.0, (1e-8, 1e-14, 1e-6));
        let error = reference.iter().zip(&y).map(|(r, y)| (y / r - 1.0).abs()).fold(0.0, f64::max);
        println!("Robertson, {stages} stages: relative error {error:.1e}, {cost:?}");
        assert!(error < 1e-7 && (y.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{error:e}");
    }
}

/// Diffusion and decay along 1,000 cells from 0, ends held at 255, against the exact solution: steady state
/// `cosh(mu (i - m)) / cosh(mu m)`, m the middle, less its expansion in decaying sines.
#[test]
fn a_stiff_diffusion_chain_is_exact_within_tolerance_in_few_steps() {
    let n = 1_000usize;
    let (diffusion, decay) = (1e4, 0.03);
    let couplings: Vec<(u32, u32)> = (1..n as u32).flat_map(|k| [(k - 1, k), (k, k - 1)]).collect();
    let pattern = Pattern::new(n, &couplings).unwrap();
    let rates = move |_: f64, y: &[f64], out: &mut [f64]| {
        (out[0], out[n - 1]) = (0.0, 0.0);
        for i in 1..n - 1 {
            out[i] = diffusion * (y[i - 1] + y[i + 1] - 2.0 * y[i]) - decay * y[i];
        }
    };
    let places: Vec<[usize; 2]> =
        (1..n - 1).map(|i| [pattern.entry(i, i - 1).unwrap(), pattern.entry(i, i + 1).unwrap()]).collect();
    let jacobian = |_: f64, _: &[f64], out: &mut [f64]| {
        for i in 1..n - 1 {
            out[i] = -2.0 * diffusion - decay;
            places[i - 1].iter().for_each(|&p| out[p] = diffusion);
        }
    };
    let (mu, middle) = (2.0 * (0.25 * decay / diffusion).sqrt().asinh(), 0.5 * (n - 1) as f64);
    let mut exact: Vec<f64> =
        (0..n).map(|i| 255.0 * (mu * (i as f64 - middle)).cosh() / (mu * middle).cosh()).collect();
    let steady = exact.clone();
    for k in 1..40 {
        let wave = f64::from(k) * std::f64::consts::PI / (n - 1) as f64;
        let part: f64 = (1..n - 1).map(|i| steady[i] * (wave * i as f64).sin()).sum();
        let left = (-4.0 * diffusion * (0.5 * wave).sin().powi(2) - decay).exp() * 2.0 / (n - 1) as f64;
        (0..n).for_each(|i| exact[i] -= part * left * (wave * i as f64).sin());
    }
    for (stages, tolerance, most) in
        [(3, 1e-4, 60), (5, 1e-4, 35), (3, 1e-7, 280), (5, 1e-7, 75), (5, 1e-10, 220)]
    {
        let mut case = Case { time: 0.0, rates, jacobian };
        let mut y = vec![0.0; n];
        (y[0], y[n - 1]) = (255.0, 255.0);
        let start = std::time::Instant::now();
        let cost = integrate(&mut case, stages, &pattern, &mut y, 1.0, (tolerance, 255.0 * tolerance, 1e-7));
        let time = start.elapsed().as_secs_f64() * 1e6;
        let error = y.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("chain of {n}, {stages} stages, {tolerance:e}: error {error:.1e}, {time:.0} us, {cost:?}");
        assert!(error < 255.0 * tolerance.max(1e-13) && cost.steps <= most, "{error:e} {cost:?}");
    }
}

/// A linear chain driven by its neighbours; of a form that may be less than it has.
struct Driven {
    form: Form,
    /// Influences of the next and of the last cell.
    couplings: [f64; 2],
}

impl Stiff for Driven {
    fn rates(&mut self, _: f64, y: &[f64], out: &mut [f64]) {
        let [next, last] = self.couplings;
        for i in 0..y.len() {
            let of = |i: usize| y.get(i).copied().unwrap_or(0.0);
            out[i] = next * of(i + 1) + last * of(i.wrapping_sub(1)) - 2.0 * y[i] + 3.0;
        }
    }
    fn jacobian(&mut self, _: f64, y: &[f64], out: &mut [f64]) {
        let (n, [next, last]) = (y.len(), self.couplings);
        out[..n].fill(-2.0);
        // Rows lie in the order of elimination: the influence of the last cell, then that of the next one on it.
        out[n..].chunks_exact_mut(2).for_each(|pair| (pair[0], pair[1]) = (last, next));
    }
    fn form(&self) -> Form {
        self.form
    }
}

#[test]
fn linear_systems_take_one_solution_and_give_what_iteration_gives() {
    let n = 12;
    let pattern = Pattern::new(n, &(1..n as u32).map(|k| (k - 1, k)).collect::<Vec<_>>()).unwrap();
    // Dominant, and not.
    for couplings in [[1.0, 1.0], [1.9, -1.4]] {
        for stages in [3, 5] {
            let [any, linear] = [Form::Any, Form::LinearSteady].map(|form| {
                let (mut radau, mut case) = (Stages::of(stages), Driven { form, couplings });
                let (mut y, mut rates, mut all) = (vec![1.0; n], vec![0.0; n], Vec::new());
                // The second of 20 times the length of the first.
                for h in [0.05, 1.0, 1.0] {
                    case.rates(0.0, &y, &mut rates);
                    let start =
                        Start { pattern: &pattern, y: &y, rate: &rates, scale: &[1e-8; 12], tolerance: 0.0 };
                    let Attempt::Done { error, .. } = radau.attempt(&mut case, &start, h) else {
                        panic!("{couplings:?}")
                    };
                    let of = |tau: f64, y: &[f64], out: &mut [f64]| {
                        Driven { form, couplings }.rates(tau, y, out);
                    };
                    let beginning = Beginning { y: &y, rates: &rates, rough: &[4] };
                    let inside = radau.interior_error(&pattern, beginning, of);
                    all.push([error, 1e8 * inside.relative, 1e8 * inside.absolute]);
                    radau.accept();
                    y.copy_from_slice(radau.end());
                }
                (y, all, radau.rates_used())
            });
            for (a, b) in any.0.iter().zip(&linear.0) {
                assert!((a - b).abs() < 1e-12 * a.abs(), "{a} {b}");
            }
            for (step, (any, linear)) in any.1.iter().zip(&linear.1).enumerate() {
                assert!((any[0] - linear[0]).abs() < 1e-5 * (1.0 + any[0]), "{step}: {any:?} {linear:?}");
            }
            assert!(linear.2 < any.2, "{} and {} evaluations", linear.2, any.2);
        }
    }
}

#[test]
fn the_defect_of_a_steady_linear_system_is_known_from_that_at_the_start() {
    let n = 12;
    let pattern = Pattern::new(n, &(1..n as u32).map(|k| (k - 1, k)).collect::<Vec<_>>()).unwrap();
    for stages in [3, 5] {
        let inside = [Form::Any, Form::LinearSteady].map(|form| {
            let case = || Driven { form, couplings: [1.0, 1.0] };
            let (mut radau, y, mut rates) = (Stages::of(stages), vec![1.0; n], vec![0.0; n]);
            case().rates(0.0, &y, &mut rates);
            let start = Start { pattern: &pattern, y: &y, rate: &rates, scale: &[1e-8; 12], tolerance: 0.0 };
            assert!(matches!(radau.attempt(&mut case(), &start, 2.0), Attempt::Done { .. }));
            let of = |tau: f64, y: &[f64], out: &mut [f64]| case().rates(tau, y, out);
            radau.interior_error(&pattern, Beginning { y: &y, rates: &rates, rough: &[] }, of)
        });
        let [any, known] = inside.map(|inside| [inside.relative, inside.absolute]);
        assert!(any[1] > 1e-6, "{any:?}");
        assert!((0..2).all(|i| (any[i] - known[i]).abs() < 1e-8 * any[i]), "{any:?} {known:?}");
    }
}

#[test]
fn dense_output_follows_the_solution() {
    let pattern = Pattern::new(2, &[(0, 1)]).unwrap();
    let mut case = rotation();
    let (y, mut rate, mut out) = ([1.0, 0.0], [0.0; 2], Vec::new());
    case.rates(0.0, &y, &mut rate);
    for (stages, error) in [(3, 1e-5), (5, 1e-8)] {
        let mut radau = Stages::of(stages);
        let done = radau.attempt(
            &mut case,
            &Start { pattern: &pattern, y: &y, rate: &rate, scale: &[1e-9; 2], tolerance: 0.0 },
            0.3,
        );
        assert!(matches!(done, Attempt::Done { .. }));
        radau.dense(&y, &mut out);
        for (i, b) in out.chunks(stages + 1).enumerate() {
            assert!(b[0] == y[i] && b[stages] == radau.end()[i]);
            for x in [0.1, 0.5, 0.9] {
                let mut b = b.to_vec();
                (0..stages).for_each(|r| (0..stages - r).for_each(|k| b[k] += x * (b[k + 1] - b[k])));
                let exact = if i == 0 { (0.3 * x).cos() } else { (0.3 * x).sin() };
                assert!((b[0] - exact).abs() < error, "{stages} {x} {:e}", b[0] - exact);
            }
        }
    }
}

#[test]
fn invalid_input_is_reported_and_factors_are_reused() {
    let pattern = Pattern::new(1, &[]).unwrap();
    let mut radau = Stages::of(5);
    let decay = |_: f64, y: &[f64], out: &mut [f64]| out[0] = if y[0] < 2.0 { -y[0] } else { f64::NAN };
    let mut case =
        Case { time: 0.0, rates: decay, jacobian: |_: f64, _: &[f64], out: &mut [f64]| out[0] = -1.0 };
    let mut tried = |y: &[f64], rate: f64, h: f64| {
        radau.attempt(
            &mut case,
            &Start { pattern: &pattern, y, rate: &[rate], scale: &[1e-9], tolerance: 0.0 },
            h,
        )
    };
    assert_eq!(tried(&[1.0], f64::NAN, 0.1), Attempt::NotFinite(Some(0)));
    assert_eq!(tried(&[1.0], -1.0, 0.0), Attempt::NotFinite(None));
    assert_eq!(tried(&[1.0, 1.0], -1.0, 0.1), Attempt::NotFinite(None));
    assert_eq!(tried(&[3.0], -3.0, 0.1), Attempt::NotFinite(Some(0)));
    let mut y = [1.0];
    for _ in 0..10 {
        let outcome = radau.attempt(
            &mut case,
            &Start { pattern: &pattern, y: &y, rate: &[-y[0]], scale: &[1e-9], tolerance: 0.0 },
            0.1,
        );
        assert!(matches!(outcome, Attempt::Done { error, .. } if error < 1.0), "{outcome:?}");
        radau.accept();
        y[0] = radau.end()[0];
    }
    assert!((y[0] - (-1f64).exp()).abs() < 1e-14 && radau.factorisations() == 1);
    assert_eq!([3, 4, 5].map(|count| Stages::of(count).count()), [3, 5, 5]);
    // Growth without bound inside the step: blow-up of y' = y^2 at tau = 1.
    let square = |_: f64, y: &[f64], out: &mut [f64]| out[0] = y[0] * y[0];
    let mut case =
        Case { time: 0.0, rates: square, jacobian: |_: f64, y: &[f64], out: &mut [f64]| out[0] = 2.0 * y[0] };
    let outcome = Stages::of(3).attempt(
        &mut case,
        &Start { pattern: &pattern, y: &[1.0], rate: &[1.0], scale: &[1e-9], tolerance: 0.0 },
        3.0,
    );
    assert!(!matches!(outcome, Attempt::Done { error, .. } if error < 1.0), "{outcome:?}");
}
