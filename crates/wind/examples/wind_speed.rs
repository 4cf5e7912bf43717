//! Measures what the wind costs: `cargo run --release -p dlsys-wind --example wind_speed`.
//!
//! Medians of 31 rounds. Places are random, so that every sample reads other coefficients; those along a stem are near each other, and
//! cheaper.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use dlsys_wind::{
    Description, Error, Field, Ground, Hull, Obstacle, Signal, Snapshot, Spectrum, Sphere, study,
};
use nalgebra::Vector3;

const ROUNDS: usize = 31;

/// Nanoseconds of one of `count` calls: the median over rounds.
fn measure(count: usize, mut run: impl FnMut()) -> f64 {
    run();
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e9 / count as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[ROUNDS / 2]
}

fn print(name: &str, nanoseconds: f64) {
    println!("{name:<58} {:>12.3} µs", nanoseconds * 1e-3);
}

/// Places in a box of 40 m, the same every time.
fn places(count: usize) -> Vec<Vector3<f64>> {
    let share = |i: usize, factor: f64| (i as f64 * factor).fract();
    let place = |i| Vector3::new(share(i, 0.754_877_666), share(i, 0.569_840_291), share(i, 0.430_159_709));
    (0..count).map(|i| place(i) * 40.0).collect()
}

fn sample(name: &str, wind: &Snapshot, places: &[Vector3<f64>]) {
    let run = || {
        black_box(places.iter().map(|x| wind.velocity(*x)).sum::<Vector3<f64>>());
    };
    print(name, measure(places.len(), run));
}

fn main() -> Result<(), Error> {
    let gusty =
        |speed: Signal| Description { turbulence: 0.3, scale: 4.0, ..Description::new(Vector3::x(), speed) };
    let field = Field::new(gusty(5.0.into()))?;
    let wind = field.at(1.0)?;
    let random = places(20_000);
    sample("velocity, three lattices, random places", &wind, &random);
    let stem: Vec<_> = (0..20_000).map(|i| Vector3::new(1.0, i as f64 * 5e-5, 2.0)).collect();
    sample("velocity, three lattices, along a stem of 1 m", &wind, &stem);
    let one = study::first_lattice(&wind);
    sample("velocity, one lattice, random places", &one, &random);
    sample("velocity, one lattice, along a stem of 1 m", &one, &stem);
    let gradients = || {
        black_box(random.iter().map(|x| wind.velocity_and_gradient(*x).1.trace()).sum::<f64>());
    };
    print("velocity and gradient, three lattices, random places", measure(random.len(), gradients));
    let calm = Field::new(Description { turbulence: 0.0, ..gusty(5.0.into()) })?.at(1.0)?;
    sample("velocity without turbulence", &calm, &random);
    let ground = Description { ground: Some(Ground::Flat(0.0)), roughness: Some(0.03), ..gusty(5.0.into()) };
    sample("velocity over ground, along a stem of 1 m", &Field::new(ground)?.at(1.0)?, &stem);
    let ball = Sphere::fixed(Vector3::new(1.0, 0.5, 2.0), 0.1);
    let around = Description { obstacles: vec![Box::new(ball)], ..gusty(5.0.into()) };
    sample("velocity along a stem of 1 m through a ball", &Field::new(around)?.at(1.0)?, &stem);

    let free = Field::new(gusty(5.0.into()))?.at(1.0)?;
    let corner = |k: usize| Vector3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64) * 0.2;
    let boxed = Hull::new((0..8).map(|k| corner(k) + Vector3::new(0.9, 0.4, 1.9)).collect(), 0.01);
    let boxed = boxed.map(|hull| Arc::new(hull) as Arc<dyn Obstacle>);
    let among = free.among(boxed.as_slice())?;
    sample("velocity along a stem of 1 m through a box", &among, &stem);
    let close: Vec<Vector3<f64>> =
        (0..1000).map(|k| Vector3::new(0.895, 0.4 + 0.0002 * f64::from(k), 2.0)).collect();
    sample("velocity in the layer of a box", &among, &close);

    let mut time = 0.0;
    let snapshot = |field: &Field, time: &mut f64| {
        measure(1, || {
            *time += 0.1;
            black_box(field.at(*time).is_ok());
        })
    };
    print("instant", snapshot(&field, &mut time));
    let varying = Field::new(gusty(Signal::function(|t| 5.0 + (0.3 * t).sin())))?;
    print("instant, speed varies", snapshot(&varying, &mut time));
    let period = Description { period: Some(8.0), ..gusty(5.0.into()) };
    print("instant, period", snapshot(&Field::new(period)?, &mut time));
    let paper = Spectrum::Kolmogorov { dissipation: 1.0, inertial: 4.0, sigma: 1.0 };
    let paper = Field::new(Description { spectrum: paper, ..gusty(5.0.into()) })?;
    print("instant, the paper's spectrum", snapshot(&paper, &mut time));
    let build = || {
        black_box(Field::new(gusty(5.0.into())).is_ok());
    };
    print("field", measure(1, build));
    Ok(())
}
