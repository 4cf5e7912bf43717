//! Prints the exact cases, and the cost of clouds: `cargo run --release -p dlsys-gas --example gas_table`.

use std::time::Instant;

use dlsys_gas::{Blob, Breeze, Cloud, Gas, Light, Look, Ray, Settings, Smoke, Source, Span, Vector, study};
use dlsys_wind::{Description, Field, Snapshot, Wind};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// The first of three lattices, at the ends of a tick.
struct Large(f64, [Snapshot; 2]);

impl Wind for Large {
    fn velocity(&self, point: Vector, time: f64) -> Vector {
        let Large(end, [before, after]) = self;
        if time >= *end { after.velocity(point) } else { before.velocity(point) }
    }
}

fn main() -> Result<()> {
    for case in study::EXACT_CASES {
        for row in case()? {
            let order = row.order.map_or(String::new(), |order| format!("{order:.2}"));
            println!(
                "{:<56} {:>9.2e} {:>16.9e} {:>16.9e} {:>9.1e} {order:>6}",
                row.case, row.resolution, row.value, row.expected, row.error
            );
        }
    }
    let field = Field::new(Description {
        turbulence: 0.3,
        scale: 1.0,
        ..Description::new(Vector::new(1.0, 0.0, 0.2), 1.0)
    })?;
    println!(
        "\n{:<10} {:>8} {:>10} {:>10} {:>12} {:>12}",
        "blobs", "threads", "lattices", "tolerance", "steps a s", "ns a blob"
    );
    for (count, threads, lattices, tolerance) in [
        (60_000, 1, 1, 0.1),
        (60_000, 2, 1, 0.1),
        (60_000, 1, 3, 0.01),
        (60_000, 1, 3, 0.1),
        (60_000, 2, 3, 0.1),
        (1_000_000, 1, 1, 0.1),
        (1_000_000, 2, 1, 0.1),
        (1_000_000, 2, 3, 0.1),
    ] {
        let seconds = pace(&field, count, threads, lattices, tolerance)?;
        let each = seconds * 1e9 / count as f64;
        println!(
            "{count:<10} {threads:>8} {lattices:>10} {tolerance:>10} {:>12.1} {each:>12.1}",
            1.0 / seconds
        );
    }
    draw();
    Ok(())
}

/// Seconds of a tick of a plume, with the wind at its instants: the median of some.
fn pace(field: &Field, count: usize, threads: usize, lattices: usize, tolerance: f64) -> Result<f64> {
    let gas = Gas { diffusion: 1e-4, decay: 0.0, size: 0.02, mass: 1e-6, fall: -0.3 };
    let mut cloud = Cloud::new(gas, Settings { threads, tolerance, ..Settings::default() })?;
    let tick = cloud.tick();
    // A plume of 2 s.
    let source = [Source::at(1, Vector::zeros(), 0.1, count as f64 / 2.0)];
    let mut wind = Breeze::new(field, 0.0, tick);
    let mut large = Large(0.0, [study_first(field, 0.0)?, study_first(field, 0.0)?]);
    let mut times = Vec::new();
    while cloud.time() < 2.3 {
        let full = cloud.time() >= 2.0;
        let sources = if full { &[][..] } else { &source[..] };
        let begun = Instant::now();
        if lattices == 3 {
            cloud.advance(sources, &wind)?;
            wind = wind.next();
        } else {
            let end = cloud.time() + tick;
            let [_, before] = large.1;
            large = Large(end, [before, study_first(field, end)?]);
            cloud.advance(sources, &large)?;
        }
        if full {
            times.push(begun.elapsed().as_secs_f64());
        }
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

fn study_first(field: &Field, time: f64) -> Result<Snapshot> {
    Ok(dlsys_wind::study::first_lattice(&field.at(time)?))
}

/// The cost of light.
fn draw() {
    let look = Look { extinction: 20.0, albedo: [0.9; 3], glow: [0.0; 3] };
    for count in [10_000, 100_000] {
        let blobs: Vec<Blob> = study::random_smoke(1, count)
            .into_iter()
            .map(|blob| Blob { variance: blob.variance * 0.01, mass: blob.mass * 0.02, ..blob })
            .collect();
        let begun = Instant::now();
        let Ok(smoke) = Smoke::cut(look, blobs, 3.0) else { return };
        let built = begun.elapsed().as_secs_f64();
        let begun = Instant::now();
        let sun = Light::Distant { towards: Vector::y(), colour: [1.0; 3] };
        let Ok(smoke) = smoke.lit(&[sun], 2) else { return };
        let lit = begun.elapsed().as_secs_f64();
        let (begun, mut sum) = (Instant::now(), 0.0);
        for k in 0..1000 {
            let share = |factor: f64| (f64::from(k) * factor).fract() - 0.5;
            let from = Vector::new(share(0.754_877_666), share(0.569_840_291), -3.0);
            if let Ok(ray) = Ray::new(from, Vector::z()) {
                sum += smoke.light(&ray, Span::ALL).1;
            }
        }
        let ray = begun.elapsed().as_secs_f64() * 1e3;
        let [built, lit] = [built, lit].map(|seconds| seconds * 1e6 / count as f64);
        println!(
            "{count} blobs: tree {built:.2} µs a blob, light {lit:.1} µs a blob (2 threads), {ray:.1} µs a ray (mean transmittance {:.2})",
            sum / 1000.0
        );
    }
}
