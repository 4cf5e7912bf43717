//! Ten thousand restarts with criterion, at errors of 1e-6 and 1e-9 in one life. Times are those of a whole run.
//!
//! The `compare` binary measures ratios, with both programs running alternately.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use dlsys::sim::Method;
use dlsys_benches::restart::{self, EVENTS, Life};

fn restarts(c: &mut Criterion) {
    for life in [restart::sine(), restart::short(), restart::logistic()] {
        for target in [1e-6, 1e-9] {
            if let Err(message) = one(c, life, target) {
                eprintln!("{}: {message}", life.name);
            }
        }
    }
}

fn one(c: &mut Criterion, life: Life, target: f64) -> Result<(), String> {
    let session = life.session()?;
    let mut group = c.benchmark_group(format!("{EVENTS} restarts of {} at {target:.0e}", life.name));
    group.sample_size(20);
    match restart::tuned_dlsys(&session, &life, Method::Auto, target) {
        Some((tolerance, _)) => {
            group.bench_function("dlsys", |b| {
                b.iter(|| black_box(restart::run_dlsys(&session, &life, Method::Auto, tolerance)))
            });
        }
        None => eprintln!("{}: dlsys does not reach the error", life.name),
    }
    let best = restart::best_loop(&life, target, |_, _| ())?;
    group.bench_function(best.name, |b| b.iter(|| black_box((best.run)(EVENTS))));
    group.finish();
    Ok(())
}

criterion_group!(benches, restarts);
criterion_main!(benches);
