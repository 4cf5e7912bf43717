//! The cost of landing: petals and seeds with up to 64 contacts fall from 0.8 m until they rest.
//! `cargo run --release -p dlsys-fall --example landing`. An argument is the number of bodies (200).

use std::time::Instant;

use dlsys_fall::{Body, Contact, Error, Fall, Ground, Motion, Settings, Vector};

/// A petal that is bent along and across, with contacts all over.
fn petal(contacts: u32, bend: f64) -> Result<Body, Error> {
    let half = [0.035, 0.03];
    let point = |k: u32| {
        let angle = f64::from(k) * 2.399_963_229_728_653;
        let share = (f64::from(k) + 0.5) / f64::from(contacts);
        let (x, y) = (share.sqrt() * angle.cos(), share.sqrt() * angle.sin());
        let aside = bend * (x * x + 0.3 * y * y - 0.4 + 0.1 * (5.0 * angle).sin() * share);
        Contact { point: Vector::new(half[0] * x, half[1] * y, half[0] * aside), radius: 0.0 }
    };
    let area = std::f64::consts::PI * half[0] * half[1];
    Body::plate(0.07 * area, half)?.touching((0..contacts).map(point).collect())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let count: u32 = std::env::args().nth(1).map_or(Ok(200), |text| text.parse())?;
    let wind = |point: Vector, time: f64| Vector::new(1.0 + (time + point.x).sin(), 0.0, 0.3 * point.y.sin());
    println!("{:<30} {:>9} {:>9} {:>9} {:>9} {:>9}", "body", "ms", "flight ms", "steps", "impacts", "rest s");
    for (name, contacts, bend) in [
        ("flat petal, 8 contacts", 8, 0.0),
        ("flat petal, 64 contacts", 64, 0.0),
        ("bent petal, 64 contacts", 64, 0.3),
        ("bowl, 64 contacts", 64, 1.0),
    ] {
        let (mut all, mut flight, mut steps, mut impacts, mut rest) = (0.0, 0.0, 0, 0, 0.0);
        for k in 0..count {
            let x = f64::from(k);
            let mut release = Motion::at(Vector::new(0.1 * x, 0.8, 0.0));
            release.velocity = Vector::new(x.sin(), 0.3 * (2.0 * x).cos(), 0.2);
            release.spin = Vector::new(3.0 * (3.0 * x).sin(), 5.0 * x.cos(), 1.0);
            let fall = |ground| Fall::new(petal(contacts, bend)?, release, 0.0, ground, Settings::default());
            let mut free = fall(None)?;
            let begun = Instant::now();
            free.at(1.0, &wind)?;
            flight += begun.elapsed().as_secs_f64();
            let mut landing = fall(Some(Ground::at(0.0)))?;
            let begun = Instant::now();
            landing.at(60.0, &wind)?;
            all += begun.elapsed().as_secs_f64();
            steps += landing.steps();
            impacts += landing.impacts();
            rest += landing.rest().unwrap_or(f64::INFINITY);
        }
        let mean = |sum: f64| sum / f64::from(count);
        println!(
            "{name:<30} {:>9.2} {:>9.2} {:>9.0} {:>9.1} {:>9.2}",
            1e3 * mean(all),
            1e3 * mean(flight),
            mean(steps as f64),
            mean(f64::from(impacts)),
            mean(rest)
        );
    }
    Ok(())
}
