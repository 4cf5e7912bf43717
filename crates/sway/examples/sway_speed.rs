//! Prints the cost of a step in µs a segment, for chains and trees of 100 to a million segments:
//! `cargo run --release -p dlsys-sway --example sway_speed`. Numbers of segments may be given as arguments.

use std::time::Instant;

use dlsys_sway::{Fixed, Segment, Settings, Skeleton, Solver, State, Vector, upright};

/// Stems of 20 segments that fork.
fn tree(n: usize) -> Skeleton {
    let mut skeleton = Skeleton::new();
    for index in 0..n {
        let parent = (index > 0).then(|| if index % 20 == 0 { index - 10 } else { index - 1 });
        let depth = (index / 20) as f64;
        let mut segment = Segment::solid(parent, 0.05, 0.02 / (1.0 + depth), 5e9, 900.0);
        segment.sag = false;
        segment.damping = 0.01;
        if parent.is_none() {
            segment.joint.rotation = upright();
        } else if index % 20 == 0 {
            let turn = nalgebra::Rotation3::from_scaled_axis(Vector::new(0.3, 0.0, 0.6));
            segment.joint.rotation = turn.into_inner();
        }
        skeleton.push(segment);
    }
    skeleton
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut sizes: Vec<usize> =
        std::env::args().skip(1).map(|text| text.parse()).collect::<Result<_, _>>()?;
    if sizes.is_empty() {
        sizes = vec![100, 1_000, 10_000, 100_000, 1_000_000];
    }
    let wind = |point: Vector, time: f64| Vector::new(2.0 + (time + point.x).sin(), 0.0, 0.3 * point.y);
    println!("{:>9} {:>22}", "segments", "µs a segment and step");
    for n in sizes {
        // Many plants of 100 segments.
        let mut skeleton = Skeleton::new();
        let plant = tree(n.min(100));
        for _ in 0..n / plant.len() {
            let first = skeleton.len();
            for segment in plant.segments() {
                let parent = segment.parent.map(|parent| parent + first);
                skeleton.push(Segment { parent, ..*segment });
            }
        }
        let steps = (2_000_000 / n).max(3) as u32;
        let h = 1.0 / 240.0;
        let settings = Settings { fixed: true, longest: h, ..Settings::default() };
        let mut solver = Solver::new(settings);
        let mut state = State::at_rest(&skeleton);
        solver.advance(&mut state, 0.0, h, &mut Fixed(&skeleton), &wind, |_| ())?;
        let mut best = f64::INFINITY;
        let mut begun = Instant::now();
        let end = f64::from(steps + 1) * h;
        let mut count = 0;
        solver.advance(&mut state, h, end, &mut Fixed(&skeleton), &wind, |_| {
            count += 1;
            if count % steps.div_ceil(5) == 0 {
                best = best.min(begun.elapsed().as_secs_f64() / f64::from(steps.div_ceil(5)));
                begun = Instant::now();
            }
        })?;
        println!("{n:>9} {:>22.3}", best * 1e6 / n as f64);
    }
    Ok(())
}
