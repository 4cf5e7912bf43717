//! Ground and bodies: no air passes them, and the flow around them has no divergence.

use dlsys_wind::{Description, Field, Flow, Ground, Signal, Snapshot, Sphere, grid};
use nalgebra::Vector3;

fn gusty() -> Description {
    Description {
        turbulence: 0.3,
        scale: 2.0,
        seed: 5,
        ..Description::new(Vector3::new(1.0, 0.0, -0.3), 4.0)
    }
}

/// The divergence by differences of fourth order, relative to the size of the derivatives.
fn divergence(wind: &Snapshot, x: Vector3<f64>, step: f64) -> f64 {
    let (mut sum, mut size) = (0.0, 0.0);
    for j in 0..3 {
        let at = |n: f64| wind.velocity(x + Vector3::ith(j, n * step));
        let slope = (at(-2.0) - at(2.0) + (at(1.0) - at(-1.0)) * 8.0) / (12.0 * step);
        sum += slope[j];
        size += slope.norm();
    }
    sum.abs() / size
}

fn hills() -> Ground {
    Ground::Uneven {
        height: Box::new(|x, z, _| {
            let (s, c) = (0.7 * x + 0.4 * z).sin_cos();
            [0.5 * s, 0.35 * c, 0.2 * c]
        }),
        fading: 3.0,
    }
}

#[test]
fn no_air_passes_flat_ground_and_eddies_slide_along_it() {
    let mut sums = Vector3::zeros();
    let mut expected = 0.0;
    for seed in 0..12 {
        let field = Field::new(Description { seed, ground: Some(Ground::Flat(1.0)), ..gusty() }).unwrap();
        let wind = field.at(0.5).unwrap();
        let mean = Vector3::new(1.0, 0.0, -0.3).normalize() * 4.0;
        let places = grid(Vector3::new(0.0, 1.0, 0.0), Vector3::new(60.0, 1.0, 60.0), [40, 1, 40]);
        for x in &places {
            let u = wind.velocity(*x) - mean;
            assert!(u.y.abs() < 1e-12, "{u}");
            sums += u.component_mul(&u) / places.len() as f64;
        }
        expected += 1.5 * field.variance(0.0).unwrap();
        assert_eq!(wind.velocity(Vector3::new(3.0, 0.999, 2.0)), Vector3::zeros(), "below the ground");
    }
    // The layers are made so that horizontal variances at the ground are 1.5 times those above.
    for i in [0, 2] {
        assert!((sums[i] / expected - 1.0).abs() < 0.06, "{} for {expected}", sums[i]);
    }
}

#[test]
fn gradients_over_flat_ground_are_exact_and_their_trace_is_zero() {
    let field = Field::new(Description { ground: Some(Ground::Flat(0.0)), roughness: Some(0.02), ..gusty() })
        .unwrap();
    let wind = field.at(0.5).unwrap();
    for x in grid(Vector3::new(0.0, 0.01, 0.0), Vector3::new(9.0, 3.0, 7.0), [8, 30, 8]) {
        let (_, gradient) = wind.velocity_and_gradient(x);
        assert!(gradient.trace().abs() < 1e-13 * gradient.norm(), "{x}");
        for j in 0..3 {
            let step = Vector3::ith(j, 1e-6);
            let slope = (wind.velocity(x + step) - wind.velocity(x - step)) / 2e-6;
            assert!((slope - gradient.column(j)).norm() < 1e-4 * gradient.norm(), "{x}: {slope}, {gradient}");
        }
    }
}

#[test]
fn wind_follows_hills() {
    let ground = Some(hills());
    let field = Field::new(Description { ground, roughness: Some(0.01), ..gusty() }).unwrap();
    let wind = field.at(0.5).unwrap();
    let Ground::Uneven { height, .. } = hills() else { unreachable!() };
    let mut largest = 0.0f64;
    for place in grid(Vector3::zeros(), Vector3::new(20.0, 0.0, 20.0), [30, 1, 30]) {
        let [h, along_x, along_z] = height(place.x, place.z, 0.0);
        // Half of rounding above the ground, since below there is no air.
        let x = Vector3::new(place.x, h + 1e-12, place.z);
        let normal = Vector3::new(-along_x, 1.0, -along_z).normalize();
        let u = wind.velocity(x);
        assert!(u.dot(&normal).abs() < 1e-9 * u.norm(), "{x}: {u}");
        largest = largest.max(u.norm());
        let divergence = divergence(&wind, Vector3::new(place.x, h + 0.6, place.z), 2e-6);
        assert!(divergence < 1e-6, "{divergence}");
    }
    assert!(largest > 0.1, "there is wind at the ground");
}

#[test]
fn a_ball_in_a_steady_wind_has_the_flow_of_its_radius_and_no_more() {
    let ball = Sphere::fixed(Vector3::new(1.0, 2.0, 3.0), 0.5);
    let field =
        Field::new(Description { obstacles: vec![Box::new(ball)], ..Description::new(Vector3::x(), 4.0) });
    let wind = field.unwrap().at(0.0).unwrap();
    let at = |x: f64, y: f64, z: f64| wind.velocity(Vector3::new(1.0 + x, 2.0 + y, 3.0 + z));
    // Stagnation in front, 3/2 of the speed at the equator as in potential flow, undisturbed beyond the layer.
    assert!(at(-0.5, 0.0, 0.0).norm() < 1e-12);
    assert!((at(0.0, 0.5, 0.0) - Vector3::new(6.0, 0.0, 0.0)).norm() < 1e-12);
    assert_eq!(at(0.0, 0.0, 0.9), Vector3::new(4.0, 0.0, 0.0));
    assert_eq!(at(0.1, 0.1, 0.1), Vector3::zeros(), "inside, the velocity of the ball");
}

#[test]
fn no_air_passes_a_moving_ball_over_ground_in_gusts() {
    let ball = || Sphere {
        centre: [Signal::function(|t| 1.0 + 2.0 * t), 1.2.into(), Signal::function(|t| 3.0 - t)],
        velocity: [2.0.into(), 0.0.into(), (-1.0).into()],
        radius: 0.4,
    };
    for (ground, tolerance) in [(None, 1e-6), (Some(Ground::Flat(0.0)), 1e-6), (Some(hills()), 1e-4)] {
        let roughness = ground.is_some().then_some(0.02);
        let flows = vec![Flow::vortex(1.0, Vector3::new(0.0, 1.0, 0.0), Vector3::y(), Some(3.0))];
        let obstacles = vec![Box::new(ball()) as Box<dyn dlsys_wind::Obstacle>];
        let with_flow = Description { flows, ground, roughness, obstacles, ..gusty() };
        let wind = Field::new(with_flow).unwrap().at(0.25).unwrap();
        let (centre, velocity) = (Vector3::new(1.5, 1.2, 2.75), Vector3::new(2.0, 0.0, -1.0));
        for i in 0..200 {
            let (height, turn) = (1.0 - (f64::from(i) + 0.5) / 100.0, 2.4 * f64::from(i));
            let across = (1.0 - height * height).sqrt();
            let normal = Vector3::new(across * turn.cos(), height, across * turn.sin());
            let relative = wind.velocity(centre + normal * (0.4 * (1.0 + 1e-12))) - velocity;
            let through = relative.dot(&normal).abs();
            assert!(through < tolerance, "{through} of {} with tolerance {tolerance}", relative.norm());
        }
    }
}

#[test]
fn the_flow_around_a_ball_has_no_divergence() {
    for (ground, bound) in [(None, 1e-7), (Some(Ground::Flat(0.0)), 1e-7), (Some(hills()), 1e-4)] {
        let ball = Sphere::fixed(Vector3::new(1.0, 1.0, 3.0), 0.4);
        let description =
            Description { roughness: Some(0.02), obstacles: vec![Box::new(ball)], ground, ..gusty() };
        let wind = Field::new(description).unwrap().at(0.25).unwrap();
        for i in 0..100 {
            let (height, turn) = (1.0 - (f64::from(i) + 0.5) / 50.0, 2.4 * f64::from(i));
            let across = (1.0 - height * height).sqrt();
            let direction = Vector3::new(across * turn.cos(), height, across * turn.sin());
            let x = Vector3::new(1.0, 1.0, 3.0) + direction * (0.41 + 0.0023 * f64::from(i));
            let divergence = divergence(&wind, x, 2e-5);
            assert!(divergence < bound, "{x}: {divergence}");
        }
    }
}
