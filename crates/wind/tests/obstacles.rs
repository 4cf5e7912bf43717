//! Ground and bodies: no air passes them, and the flow around them has no divergence.

use std::sync::Arc;

use dlsys_wind::{Description, Field, Flow, Ground, Hull, Obstacle, Signal, Snapshot, Sphere, grid};
use nalgebra::Vector3;

fn gusty() -> Description {
    Description {
        turbulence: 0.3,
        scale: 2.0,
        seed: 5,
        ..Description::new(Vector3::new(1.0, 0.0, -0.3), 4.0)
    }
}

/// The wind of a description at an instant.
fn at(time: f64, description: Description) -> Snapshot {
    Field::new(description).unwrap().at(time).unwrap()
}

/// Directions that are spread evenly over a sphere.
fn directions(count: u32) -> impl Iterator<Item = Vector3<f64>> {
    (0..count).map(move |i| {
        let (height, turn) = (1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count), 2.4 * f64::from(i));
        let across = (1.0 - height * height).sqrt();
        Vector3::new(across * turn.cos(), height, across * turn.sin())
    })
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
    let wind = at(0.5, Description { ground: Some(Ground::Flat(0.0)), roughness: Some(0.02), ..gusty() });
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
    let wind = at(0.5, Description { ground, roughness: Some(0.01), ..gusty() });
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
    let wind =
        at(0.0, Description { obstacles: vec![Box::new(ball)], ..Description::new(Vector3::x(), 4.0) });
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
        let obstacles = vec![Box::new(ball()) as Box<dyn Obstacle>];
        let with_flow = Description { flows, ground, roughness, obstacles, ..gusty() };
        let wind = at(0.25, with_flow);
        let (centre, velocity) = (Vector3::new(1.5, 1.2, 2.75), Vector3::new(2.0, 0.0, -1.0));
        for normal in directions(200) {
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
        let wind = at(0.25, description);
        for (i, direction) in directions(100).enumerate() {
            let x = Vector3::new(1.0, 1.0, 3.0) + direction * (0.41 + 0.0023 * i as f64);
            let divergence = divergence(&wind, x, 2e-5);
            assert!(divergence < bound, "{x}: {divergence}");
        }
    }
}

/// A rod with round ends along z, without derivatives of its normal.
#[derive(Debug)]
struct Rod {
    half: f64,
    radius: f64,
}

impl Rod {
    fn off_axis(&self, point: Vector3<f64>) -> Vector3<f64> {
        point - Vector3::new(0.0, 0.0, point.z.clamp(-self.half, self.half))
    }
}

impl Obstacle for Rod {
    fn distance(&self, point: Vector3<f64>, _: f64) -> f64 {
        self.off_axis(point).norm() - self.radius
    }

    fn normal(&self, point: Vector3<f64>, _: f64) -> Vector3<f64> {
        self.off_axis(point).normalize()
    }

    fn velocity(&self, _: f64) -> Vector3<f64> {
        Vector3::zeros()
    }

    fn centre(&self, _: f64) -> Vector3<f64> {
        Vector3::zeros()
    }

    fn layer(&self) -> f64 {
        self.radius
    }
}

/// Bodies of other shapes need a distance and a normal only; derivatives of the normal are found by differences.
#[test]
fn a_body_of_any_shape_pushes_the_wind_aside() {
    let rod = || Rod { half: 0.6, radius: 0.2 };
    let wind = at(0.25, Description { obstacles: vec![Box::new(rod())], ..gusty() });
    let free = at(0.25, gusty());
    let mut changed = 0.0f64;
    for (i, direction) in directions(300).enumerate() {
        // The rod is the set of all points at its radius from its axis; ends and middle in turn, off the circles where they meet.
        let axis =
            Vector3::new(0.0, 0.0, if i % 2 == 0 { 0.6f64.copysign(direction.z) } else { 0.5 * direction.z });
        let normal =
            if i % 2 == 0 { direction } else { Vector3::new(direction.x, direction.y, 0.0).normalize() };
        let surface = axis + normal * (0.2 * (1.0 + 1e-12));
        let through = wind.velocity(surface).dot(&normal).abs();
        assert!(through < 1e-6, "{through} at {surface}");
        let near = axis + normal * (0.21 + 0.0006 * i as f64);
        if normal.z == 0.0 || normal.z.abs() > 0.01 {
            let divergence = divergence(&wind, near, 2e-5);
            assert!(divergence < 1e-5, "{divergence} at {near}");
        }
        changed = changed.max((wind.velocity(near) - free.velocity(near)).norm());
    }
    assert!(changed > 1.0, "{changed}");
    let far = Vector3::new(0.0, 0.41, 0.3);
    assert_eq!(wind.velocity(far), free.velocity(far));
}

/// A rounded box that flies and turns: relative to its surface, no air passes, and the flow has no divergence.
#[test]
fn no_air_passes_a_hull_that_flies_and_turns() {
    let half = Vector3::new(0.5, 0.3, 0.2);
    let corner = |k: i32| {
        let sign = |bit: i32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
        half.component_mul(&Vector3::new(sign(0), sign(1), sign(2)))
    };
    let (velocity, spin) = (Vector3::new(2.0, 0.5, -1.0), Vector3::new(3.0, -1.0, 4.0));
    let body = Hull::new((0..8).map(corner).collect(), 0.1).unwrap().moving(velocity, spin);
    let free = at(0.25, gusty());
    let wind = free.among(&[Arc::new(body.clone())]).unwrap();
    let (mut largest, mut tried) = (0.0f64, [0; 3]);
    for (i, direction) in directions(600).enumerate() {
        // The point of the box that is nearest to a place around it, and the surface above: over faces, edges and corners.
        let place = direction * 0.8;
        let nearest = place.zip_map(&half, |x, limit| x.clamp(-limit, limit));
        let normal = (place - nearest).normalize();
        let surface = nearest + normal * (0.1 * (1.0 + 1e-9));
        let moved = velocity + spin.cross(&surface);
        let relative = wind.velocity(surface) - moved;
        assert!(relative.dot(&normal).abs() < 1e-6, "{relative} at {surface}");
        largest = largest.max(relative.norm());
        let place = nearest + normal * (0.11 + 0.0002 * i as f64);
        // Away from the borders between parts, where derivatives of the normal jump.
        if place.iter().zip(&half).all(|(x, limit)| (limit - x.abs()).abs() > 1e-3) {
            let divergence = divergence(&wind, place, 1e-5);
            assert!(divergence < 1e-6, "{divergence} at {place}");
            let at_limits = nearest.iter().zip(&half).filter(|(x, limit)| x.abs() == **limit);
            tried[at_limits.count() - 1] += 1;
        }
    }
    assert!(largest > 1.0, "air moves along the surface");
    assert!(tried.iter().all(|count| *count > 20), "faces, edges and corners: {tried:?}");
    // Inside, the body's own velocity; far away, the wind.
    assert_eq!(wind.velocity(half * 0.5), velocity + spin.cross(&(half * 0.5)));
    assert_eq!(wind.velocity(Vector3::repeat(2.0)), free.velocity(Vector3::repeat(2.0)));
    let broken = Hull::new(vec![Vector3::zeros()], 1.0).unwrap().moving(Vector3::repeat(f64::NAN), spin);
    assert!(free.among(&[Arc::new(broken)]).is_err());
}
