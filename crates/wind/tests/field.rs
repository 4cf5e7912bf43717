//! The field as a function: the same bits for every thread and order, exact repetition, reference values, far places, errors.

use dlsys_wind::{Description, Error, Field, Flow, Ground, Obstacle, Signal, Spectrum, Sphere, grid};
use nalgebra::Vector3;

fn gusty() -> Description {
    Description {
        turbulence: 0.3,
        scale: 4.0,
        seed: 11,
        ..Description::new(
            Vector3::new(1.0, 0.0, 0.2),
            Signal::function(|t| 5.0 + 2.0 * (0.25 * std::f64::consts::PI * t).sin()),
        )
    }
}

fn places() -> Vec<Vector3<f64>> {
    grid(Vector3::new(-7.0, 0.1, 3.0), Vector3::new(23.0, 9.0, 31.0), [7, 5, 3])
}

fn bits(field: &Field, times: &[f64]) -> Vec<Vec<[u64; 3]>> {
    let at = |t: &f64| field.at(*t).unwrap().velocities(&places());
    let bits = |u: Vector3<f64>| [u.x.to_bits(), u.y.to_bits(), u.z.to_bits()];
    times.iter().map(|t| at(t).into_iter().map(bits).collect()).collect()
}

#[test]
fn threads_and_order_change_no_bit() {
    let times = [0.0, 17.3, 2.5, -4.75, 1000.125, 17.25];
    let forward = bits(&Field::new(gusty()).unwrap(), &times);
    let shared = Field::new(gusty()).unwrap();
    let reversed: Vec<f64> = times.iter().rev().copied().collect();
    let (one, two) = std::thread::scope(|scope| {
        let one = scope.spawn(|| bits(&shared, &reversed));
        let two = scope.spawn(|| bits(&shared, &times));
        (one.join().unwrap(), two.join().unwrap())
    });
    assert!(two == forward);
    assert!(one.into_iter().rev().collect::<Vec<_>>() == forward);
    // A snapshot gives the same on two threads.
    let wind = shared.at(17.3).unwrap();
    std::thread::scope(|scope| {
        let other = scope.spawn(|| wind.velocities(&places()));
        assert_eq!(wind.velocities(&places()), other.join().unwrap());
    });
}

#[test]
fn a_wind_with_a_period_repeats_to_the_last_bit() {
    for spectrum in
        [Spectrum::VonKarman, Spectrum::Kolmogorov { dissipation: 1.0, inertial: 4.0, sigma: 1.0 }]
    {
        let field = Field::new(Description { period: Some(8.0), spectrum, ..gusty() }).unwrap();
        // Frames at 30 Hz, whose times are not exact in binary, and several laps, backwards too.
        let frames: Vec<f64> = (0..40).map(|i| f64::from(i) / 30.0).collect();
        let first = bits(&field, &frames);
        for lap in [1.0, 7.0, -1.0, 10_000.0] {
            let later: Vec<f64> = frames.iter().map(|t| t + 8.0 * lap).collect();
            // Not assert_eq, which would print thousands of numbers.
            assert!(bits(&field, &later) == first, "lap {lap}");
        }
        // It is a loop, not a standstill, and it has no jump where it closes.
        let at = |t: f64| field.at(t).unwrap().velocity(Vector3::new(1.0, 2.0, 3.0));
        assert!((at(4.0) - at(0.0)).norm() > 0.05);
        let step = |t: f64| (at(t + 1e-4) - at(t)).norm();
        assert!(step(8.0 - 0.5e-4) < 3.0 * step(3.0).max(step(5.0)));
    }
}

#[test]
fn a_period_changes_little_but_the_repetition() {
    // A wind of constant speed with a long period has the same variance and nearly the same drift.
    let still = |period| Description { period, ..Description { speed: 5.0.into(), ..gusty() } };
    let (free, bound) = (Field::new(still(None)).unwrap(), Field::new(still(Some(1000.0))).unwrap());
    let x = Vector3::new(0.3, 0.4, 0.5);
    // After half a second, phases differ by at most half a turn in 1000 s, for drift and for evolution.
    let difference = (free.at(0.5).unwrap().velocity(x) - bound.at(0.5).unwrap().velocity(x)).norm();
    assert!(difference < 0.02 * 1.5, "{difference}");
    assert_eq!(free.variance(0.0).unwrap(), bound.variance(0.0).unwrap());
}

#[test]
fn eddies_travel_with_the_wind() {
    // Weak turbulence is nearly frozen: s = 0.001 m after 0.2 s, of eddies of 0.2 m and more.
    let field = Field::new(Description {
        turbulence: 1e-3,
        scale: 4.0,
        ..Description::new(Vector3::new(3.0, 4.0, 0.0), 5.0)
    })
    .unwrap();
    let mean = Vector3::new(3.0, 4.0, 0.0);
    let (before, after) = (field.at(10.0).unwrap(), field.at(10.2).unwrap());
    let (mut difference, mut square) = (0.0, 0.0);
    for x in places() {
        let (a, b) = (before.velocity(x) - mean, after.velocity(x + mean * 0.2) - mean);
        difference += (a - b).norm_squared();
        square += a.norm_squared();
    }
    // What is left is interpolation, which differs between places: 1.2 % each.
    assert!(difference < 0.02f64.powi(2) * square, "{}", (difference / square).sqrt());
}

#[test]
fn interpolation_agrees_with_the_sum_of_the_modes() {
    let field = Field::new(Description { speed: 5.0.into(), ..gusty() }).unwrap();
    let wind = field.at(3.7).unwrap();
    let mean = Vector3::new(1.0, 0.0, 0.2).normalize() * 5.0;
    let (mut difference, mut square) = (0.0, 0.0);
    for x in places() {
        let exact = field.sum_of_modes(3.7, x).unwrap();
        difference += (wind.velocity(x) - mean - exact).norm_squared();
        square += exact.norm_squared();
    }
    // Waves of three spacings lose 6 % of their amplitude, and most waves are much longer.
    assert!(difference < 0.02f64.powi(2) * square, "{}", (difference / square).sqrt());
}

#[test]
fn velocities_and_gradients_fit() {
    let field = Field::new(Description {
        roughness: Some(0.05),
        flows: vec![Flow::vortex(2.0, Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 1.0, 0.0), Some(4.0))],
        ..gusty()
    })
    .unwrap();
    let wind = field.at(3.0).unwrap();
    for x in places() {
        let (velocity, gradient) = wind.velocity_and_gradient(x);
        assert_eq!(velocity, wind.velocity(x));
        for j in 0..3 {
            let step = Vector3::ith(j, 1e-5);
            let slope = (wind.velocity(x + step) - wind.velocity(x - step)) / 2e-5;
            assert!((slope - gradient.column(j)).norm() < 1e-3 * gradient.norm(), "{slope} {gradient}");
        }
    }
}

#[test]
fn the_axis_of_a_vortex_may_turn() {
    let vortex = |axis: [Signal; 3]| Flow::Vortex {
        circulation: 2.0.into(),
        at: [1.0.into(), 2.0.into(), 3.0.into()],
        axis,
        decay: Some(4.0),
        core: 0.1,
    };
    let calm = || Description::new(Vector3::x(), 0.0);
    let turning =
        vortex([Signal::function(|t: f64| t.sin()), Signal::function(|t: f64| t.cos()), 0.0.into()]);
    let turning = Field::new(Description { flows: vec![turning], ..calm() }).unwrap();
    for time in [0.0, 0.5, 3.0] {
        let (s, c) = f64::sin_cos(time);
        let flows = vec![vortex([s.into(), c.into(), 0.0.into()])];
        let still = Field::new(Description { flows, ..calm() }).unwrap();
        assert_eq!(
            turning.at(time).unwrap().velocities(&places()),
            still.at(0.0).unwrap().velocities(&places())
        );
    }
    // An axis that vanishes, or that does not have the period of the wind.
    let lost = |period| {
        let flows = vec![vortex([Signal::function(|t: f64| (1.0 - t).max(0.0)), 0.0.into(), 0.0.into()])];
        Field::new(Description { flows, period, ..calm() })
    };
    let error = lost(None).unwrap().at(1.5).unwrap_err();
    assert_eq!(error.to_string(), "the axis of flow 1 is (0, 0, 0) at 1.5 s, which is no direction");
    let error = lost(Some(8.0)).unwrap_err();
    let expected = "the x component of the axis of flow 1 does not repeat after the period of 8 s";
    assert!(error.to_string().starts_with(expected), "{error}");
}

#[test]
fn far_places_and_late_times_keep_their_precision() {
    let field = Field::new(Description { speed: 5.0.into(), ..gusty() }).unwrap();
    let wind = field.at(1e6).unwrap();
    let mean = Vector3::new(1.0, 0.0, 0.2).normalize() * 5.0;
    let far = Vector3::new(1e6, -1e6, 3e5);
    for x in places() {
        let exact = field.sum_of_modes(1e6, x + far).unwrap();
        assert!(
            (wind.velocity(x + far) - mean - exact).norm() < 0.15,
            "{}",
            (wind.velocity(x + far) - mean - exact).norm()
        );
        // Neighbours within a micrometre have neighbouring velocities: rounding of coordinates is all that is lost.
        let near = wind.velocity(x + far + Vector3::new(1e-6, 0.0, 0.0));
        assert!((near - wind.velocity(x + far)).norm() < 1e-4);
    }
    // And neighbouring times: a microsecond late is micrometres away.
    let later = field.at(1e6 + 1e-6).unwrap();
    assert!((later.velocity(far) - wind.velocity(far)).norm() < 1e-3);
}

#[test]
fn profiles_and_calms() {
    let field =
        Field::new(Description { roughness: Some(0.1), ..Description::new(Vector3::x(), 8.0) }).unwrap();
    let wind = field.at(0.0).unwrap();
    let speed = |y: f64| wind.velocity(Vector3::new(0.0, y, 0.0)).x;
    assert!((speed(10.0) - 8.0).abs() < 1e-14);
    assert!((speed(1.0) - 4.0).abs() < 1e-14, "half of the logarithm");
    assert_eq!([speed(0.1), speed(0.05), speed(-3.0)], [0.0; 3]);
    // No wind, no turbulence.
    let calm = Field::new(Description { speed: 0.0.into(), ..gusty() }).unwrap();
    assert_eq!(calm.at(5.0).unwrap().velocity(Vector3::new(1.0, 2.0, 3.0)), Vector3::zeros());
}

#[test]
fn seeds_differ_and_equal_seeds_do_not() {
    let at =
        |seed| Field::new(Description { seed, ..gusty() }).unwrap().at(0.0).unwrap().velocity(Vector3::x());
    assert_eq!(at(3), at(3));
    assert!((at(3) - at(4)).norm() > 1e-3);
}

#[track_caller]
fn refused(description: Description, message: &str) {
    let error = Field::new(description).map(|_| ()).unwrap_err();
    assert!(error.to_string().contains(message), "{error}");
}

#[test]
fn what_is_no_wind_is_refused() {
    refused(Description::new(Vector3::zeros(), 1.0), "the direction of the wind is (0, 0, 0)");
    refused(Description::new(Vector3::x(), f64::NAN), "the speed of the wind is NaN");
    refused(Description { turbulence: -0.1, ..gusty() }, "the turbulence intensity is -0.1");
    refused(Description { turbulence: f64::INFINITY, ..gusty() }, "the turbulence intensity is inf");
    refused(Description { scale: 0.0, ..gusty() }, "the integral scale of the turbulence is 0");
    refused(Description { roughness: Some(10.0), ..gusty() }, "the roughness is 10 m");
    refused(Description { roughness: Some(0.0), ..gusty() }, "the roughness is 0 m");
    refused(Description { period: Some(-8.0), ..gusty() }, "the period of the wind is -8");
    refused(
        Description { period: Some(7.0), ..gusty() },
        "the speed of the wind does not repeat after the period of 7 s",
    );
    let inertial = Spectrum::Kolmogorov { dissipation: 1.0, inertial: 0.0, sigma: 1.0 };
    refused(Description { spectrum: inertial, ..gusty() }, "the inertial frequency k is 0");
    let flow = Flow::source(Signal::function(|t| t), Vector3::x(), None);
    refused(
        Description { flows: vec![flow], period: Some(8.0), ..gusty() },
        "the strength of flow 1 does not repeat",
    );
    let obstacles: Vec<Box<dyn Obstacle>> = vec![Box::new(Sphere::fixed(Vector3::x(), 0.0))];
    refused(Description { obstacles, ..gusty() }, "the thickness of the layer around an obstacle is 0");
    let ground = Ground::Uneven { height: Box::new(|_, _, _| [0.0; 3]), fading: -1.0 };
    refused(
        Description { ground: Some(ground), ..gusty() },
        "the height over which the wind forgets the ground is -1",
    );
    let flow = Flow::source(1.0, Vector3::x(), Some(0.0));
    refused(Description { flows: vec![flow], ..gusty() }, "the length of decay of a flow is 0");
}

#[test]
fn instants_without_a_wind_are_errors() {
    let field = Field::new(gusty()).unwrap();
    for time in [f64::NAN, f64::INFINITY, 1e9] {
        assert!(matches!(field.at(time), Err(Error::Time { .. })), "{time}");
    }
    let root = Field::new(Description { speed: Signal::function(|t| (2.0 - t).sqrt()), ..gusty() }).unwrap();
    assert!(root.at(1.0).is_ok());
    let error = root.at(3.0).unwrap_err();
    assert!(error.to_string().starts_with("the speed of the wind is NaN at "), "{error}");
    let centre = [Signal::function(|t| 1.0 / t), 0.0.into(), 0.0.into()];
    let ball = Sphere { centre, velocity: [0.0.into(), 0.0.into(), 0.0.into()], radius: 1.0 };
    let lost = Field::new(Description { obstacles: vec![Box::new(ball)], ..gusty() }).unwrap();
    let error = lost.at(0.0).unwrap_err();
    assert!(
        error.to_string().starts_with("the centre or the velocity of obstacle 1 is inf at 0 s"),
        "{error}"
    );
    // A place that is not finite has no velocity, and nothing panics.
    assert!(field.at(0.0).unwrap().velocity(Vector3::new(f64::NAN, 0.0, f64::INFINITY)).x.is_nan());
}

/// The mean of a wave over a Gaussian of deviation s is exp(-k²s²/2) of it; nothing else changes. The interpolated field follows its modes.
#[test]
fn smoothing_weakens_each_wave_as_the_mean_over_a_gaussian() {
    let deviation = 0.3;
    let plain = Field::new(gusty()).unwrap();
    let smooth = Field::new(Description { smoothing: deviation, ..gusty() }).unwrap();
    let modes = |field: &Field| {
        let mut modes = Vec::new();
        field.modes(2.7, |band, k, amplitude| modes.push((band, k, amplitude))).unwrap();
        modes
    };
    let (before, after) = (modes(&plain), modes(&smooth));
    assert!(before.len() == after.len() && before.len() > 5000);
    for ((band, k, from), (other, wave, to)) in before.iter().zip(&after) {
        assert_eq!((band, k), (other, wave));
        let factor = (-k.norm_squared() * deviation * deviation / 2.0).exp();
        for part in [0, 1] {
            assert!((from[part] * factor - to[part]).norm() <= 1e-12 * from[part].norm());
        }
    }
    assert!(smooth.variance(2.7).unwrap() < 0.95 * plain.variance(2.7).unwrap());
    let snapshot = smooth.at(2.7).unwrap();
    let (mut error, mut square) = (0.0, 0.0);
    let mean =
        Vector3::new(1.0, 0.0, 0.2).normalize() * (5.0 + 2.0 * (0.25 * std::f64::consts::PI * 2.7).sin());
    for place in places().into_iter().step_by(5) {
        let exact = smooth.sum_of_modes(2.7, place).unwrap();
        error += (snapshot.velocity(place) - mean - exact).norm_squared();
        square += exact.norm_squared();
    }
    assert!((error / square).sqrt() < 0.05, "{}", (error / square).sqrt());
    assert!(Field::new(Description { smoothing: -1.0, ..gusty() }).is_err());
}
