//! What sweeps cost.

use std::hint::black_box;
use std::time::Instant;

use super::{SLOPE, dry};
use crate::{Description, Error, Extent, Ground, Relief, Settings};

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

/// Columns along each axis of the field that is measured: it does not fit into caches near the processor.
const WIDTH: i32 = 1024;

/// Column updates in a second where everything slips, on some threads.
fn slipping(threads: usize) -> Result<f64, Error> {
    let wave = |x: f64, z: f64| 8.0 + 2.0 * libm::sin(0.6 * x) + 2.0 * libm::sin(0.5 * z + 0.2 * x);
    let description = Description {
        cell: 1.0,
        extent: Extent { x: [0, WIDTH - 1], z: [0, WIDTH - 1] },
        soil: dry(SLOPE),
        bed: Relief::Level(0.0),
        depth: Relief::function(wave),
    };
    let settings = Settings { threads, ..Settings::default() };
    let mut ground = Ground::new(description, settings)?;
    // The first sweeps find out what slips.
    ground.sweeps_at_most(4)?;
    let mut best = 0.0_f64;
    for _ in 0..5 {
        let (begun, before) = (Instant::now(), ground.updates());
        ground.sweeps_at_most(4)?;
        best = best.max((ground.updates() - before) as f64 / begun.elapsed().as_secs_f64());
    }
    Ok(best)
}

/// Columns in a second of a plain copy of the memory that a sweep reads and writes: bed, bonded, loose; loose.
fn copied() -> f64 {
    let count = (WIDTH * WIDTH) as usize;
    let from = vec![1_i64; 4 * count];
    let mut to = vec![0_i64; 4 * count];
    let mut best = 0.0_f64;
    for _ in 0..5 {
        let begun = Instant::now();
        black_box(&mut to).copy_from_slice(black_box(&from));
        // A copy of 2 numbers reads 2 and writes 2, as many as a sweep moves for a column.
        best = best.max(2.0 * count as f64 / begun.elapsed().as_secs_f64());
    }
    best
}

/// The cost of sweeps.
///
/// # Errors
///
/// None; the ground is valid.
pub fn speeds() -> Result<Vec<Speed>, Error> {
    let unit = "million columns a second";
    let (copy, mut all) = (copied(), Vec::new());
    for threads in [1, 2] {
        let on = if threads == 1 { "1 thread" } else { "2 threads" };
        let pace = slipping(threads)?;
        all.push(Speed { name: format!("sweeps where all slips, {on}"), value: pace / 1e6, unit });
        if threads == 1 {
            let name = "copies of the memory of a sweep, 1 thread".to_owned();
            all.push(Speed { name, value: copy / 1e6, unit });
            let name = "time of a sweep, 1 thread".to_owned();
            all.push(Speed { name, value: copy / pace, unit: "copies" });
        }
    }
    let mut push = |name: &str, value, unit| all.push(Speed { name: name.to_owned(), value, unit });
    push("a runner for 3 s, nine prints at 1 cm", super::runner()?, "s");
    push("90 × 90 posts with a blade", super::posts()?, "ticks a second");
    push("256 × 256 columns with a torus of 4,000 triangles", super::sandbox()?, "ticks a second");
    for count in [1, 10, 100] {
        let [time, stored] = super::footprints(count)?;
        push(&format!("a tick with {count} footprints on 4096 × 512"), time, "ms");
        push(&format!("columns in memory with {count} footprints"), stored, "thousand of 2,097 thousand");
    }
    Ok(all)
}
