//! Prints the exact cases, random landings, and the cost of a body-second:
//! `cargo run --release -p dlsys-fall --example fall_table`. An argument is the number of random landings (400).

use std::time::Instant;

use dlsys_fall::{Body, Error, Fall, Ground, Motion, Settings, Still, Vector, Wind, study};
use dlsys_wind::study::Convergence;

/// Time of the fall of many petals in µs for each body and second, and steps a second.
fn cost(tolerance: f64, wind: &impl Wind) -> Result<(f64, f64), Error> {
    let (bodies, seconds) = (400, 4.0);
    let settings = Settings { tolerance, ..Settings::default() };
    let (mut best, mut steps) = (f64::INFINITY, 0);
    for _ in 0..3 {
        let begun = Instant::now();
        steps = 0;
        for k in 0..bodies {
            let release = Motion::at(Vector::new(0.1 * f64::from(k), 100.0, 0.0));
            let mut release = release;
            release.velocity.x = 0.01 * f64::from(k);
            let mut fall =
                Fall::new(Body::plate(2e-5, [0.008, 0.012])?, release, 0.0, Some(Ground::at(0.0)), settings)?;
            fall.at(seconds, wind)?;
            steps += fall.steps();
        }
        best = best.min(begun.elapsed().as_secs_f64());
    }
    let total = f64::from(bodies) * seconds;
    Ok((best * 1e6 / total, steps as f64 / total))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let throws: u64 = std::env::args().nth(1).map_or(Ok(400), |text| text.parse())?;
    println!(
        "{:<46} {:>9} {:>16} {:>16} {:>9} {:>6}",
        "case", "tol or h", "value", "exact", "error", "order"
    );
    for case in study::EXACT_CASES {
        for row in case()? {
            let order = row.order.map_or(String::new(), |order| format!("{order:.2}"));
            let Convergence { case, resolution, value, expected, error, .. } = row;
            println!(
                "{case:<46} {resolution:>9.2e} {value:>16.9e} {expected:>16.9e} {error:>9.1e} {order:>6}"
            );
        }
    }
    let (mut rested, mut deepest, mut latest, mut steps, mut most) = (0, 0.0_f64, 0.0_f64, 0, 0);
    for seed in 0..throws {
        let end = study::random_landing(seed, 1e-3)?;
        rested += u64::from(end.rest.is_some());
        deepest = deepest.max(end.depth);
        latest = latest.max(end.rest.unwrap_or(f64::INFINITY));
        steps += end.steps;
        most = most.max(end.steps);
    }
    println!(
        "\n{rested} of {throws} random throws rest, the last after {latest:.2} s; deepest contact {deepest:.1e} half-extents below ground"
    );
    println!("steps of a throw until rest: {:.0} on average, {most} at most", steps as f64 / throws as f64);
    println!("\n{:>9} {:>26} {:>16}", "tolerance", "µs for a body and second", "steps a second");
    let wind = |point: Vector, time: f64| Vector::new(1.0 + (time + point.x).sin(), 0.0, 0.3 * point.y.sin());
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let (still, count) = cost(tolerance, &Still)?;
        println!("{tolerance:>9.0e} {still:>26.1} {count:>16.1}   still air");
        let (windy, count) = cost(tolerance, &wind)?;
        println!("{tolerance:>9.0e} {windy:>26.1} {count:>16.1}   wind");
    }
    Ok(())
}
