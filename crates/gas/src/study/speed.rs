//! What clouds cost: ticks of plumes in turbulence, and light through them.

use std::hint::black_box;
use std::time::Instant;

use dlsys_wind::{Description, Field, Snapshot, Wind, study::first_lattice};

use super::random_smoke;
use crate::{Blob, Breeze, Cloud, Error, Gas, Light, Look, Ray, Settings, Smoke, Source, Span, Vector};

/// A measured cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Speed {
    /// What was measured.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

/// The first of three lattices at the ends of a tick, which is where steps of Adams and Bashforth read it.
struct Large {
    end: f64,
    snapshots: [Snapshot; 2],
}

impl Wind for Large {
    fn velocity(&self, point: Vector, time: f64) -> Vector {
        let [before, after] = &self.snapshots;
        if time >= self.end { after.velocity(point) } else { before.velocity(point) }
    }
}

/// Seconds that a plume takes to reach its full number of blobs, and ticks that are measured then.
const PLUME: f64 = 1.0;
const MEASURED: usize = 9;

/// Seconds of a tick (1/64 s) of a plume in turbulence, with the wind at its instants: the median of nine. `lattices` is 1 or 3 of those that the wind
/// has.
///
/// # Errors
///
/// Too many blobs or threads.
pub fn pace(blobs: usize, threads: usize, lattices: usize) -> Result<f64, Error> {
    let field = Field::new(Description {
        turbulence: 0.3,
        scale: 1.0,
        ..Description::new(Vector::new(1.0, 0.0, 0.2), 1.0)
    })?;
    let gas = Gas { diffusion: 1e-4, decay: 0.0, size: 0.02, mass: 1e-6, fall: -0.3 };
    let mut cloud = Cloud::new(gas, Settings { threads, ..Settings::default() })?;
    let tick = cloud.tick();
    let source = [Source::at(1, Vector::zeros(), 0.1, blobs as f64 / PLUME)];
    let first = || field.at(0.0).map(|snapshot| first_lattice(&snapshot));
    let mut large = Large { end: 0.0, snapshots: [first()?, first()?] };
    let mut wind = Breeze::new(&field, 0.0, tick);
    let mut times = Vec::new();
    // Blobs that are new have no past; after four ticks all have one.
    while times.len() < MEASURED + 4 {
        let full = cloud.time() >= PLUME;
        let sources = if full { &[][..] } else { &source[..] };
        let begun = Instant::now();
        if lattices == 1 {
            let end = cloud.time() + tick;
            let [_, before] = large.snapshots;
            large = Large { end, snapshots: [before, first_lattice(&field.at(end)?)] };
            cloud.advance(sources, &large)?;
        } else {
            cloud.advance(sources, &wind)?;
            wind = wind.next();
        }
        if full {
            times.push(begun.elapsed().as_secs_f64());
        }
    }
    times.drain(..4);
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

/// Microseconds of a blob that is lit by one distant light, on one thread, and of a ray through some blobs, for a picture.
fn light(count: u64) -> Result<[f64; 2], Error> {
    let look = Look { extinction: 20.0, albedo: [0.9; 3], glow: [0.0; 3] };
    let small = |blob: Blob| Blob { variance: blob.variance * 0.01, mass: blob.mass * 0.02, ..blob };
    let blobs = random_smoke(1, count).into_iter().map(small).collect();
    let begun = Instant::now();
    let sun = Light::Distant { towards: Vector::y(), colour: [1.0; 3] };
    let smoke = Smoke::cut(look, blobs, 3.0)?.lit(&[sun], 1)?;
    let lit = begun.elapsed().as_secs_f64() * 1e6 / count as f64;
    let (begun, rays) = (Instant::now(), 500);
    for k in 0..rays {
        let share = |factor: f64| (f64::from(k) * factor).fract() - 0.5;
        let from = Vector::new(share(0.754_877_666), share(0.569_840_291), -3.0);
        black_box(smoke.light(&Ray::new(from, Vector::z())?, Span::ALL));
    }
    Ok([lit, begun.elapsed().as_secs_f64() * 1e6 / f64::from(rays)])
}

/// The cost of clouds in turbulence of three lattices, and of the largest eddies alone, and of light.
///
/// # Errors
///
/// None; the clouds are valid.
pub fn speeds() -> Result<Vec<Speed>, Error> {
    let mut all = Vec::new();
    for (blobs, threads, lattices) in [
        (60_000, 1, 3),
        (60_000, 2, 3),
        (60_000, 2, 1),
        (1_000_000, 1, 1),
        (1_000_000, 2, 1),
        (1_000_000, 2, 3),
    ] {
        let seconds = pace(blobs, threads, lattices)?;
        let on = if threads == 1 { "1 thread" } else { "2 threads" };
        let eddies = if lattices == 1 { "large eddies" } else { "all eddies" };
        let name = format!("{blobs} blobs, {eddies}, {on}");
        all.push(Speed { name, value: 1.0 / seconds, unit: "ticks a second" });
    }
    for count in [10_000, 100_000] {
        let [lit, ray] = light(count)?;
        all.push(Speed { name: format!("light of {count} blobs"), value: lit, unit: "µs a blob" });
        all.push(Speed { name: format!("light through {count} blobs"), value: ray, unit: "µs a ray" });
    }
    Ok(all)
}
