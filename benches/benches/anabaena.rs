//! The Anabaena listing to t = 575 with criterion: dlsys at an error of 1e-6, and forward Euler at a step of 0.1.
//!
//! Forward Euler at that error would run for hours; the `compare` binary extrapolates its time.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use dlsys_benches::anabaena::{Anabaena, END, TARGET, auto, euler};
use dlsys_benches::tune;

fn listing(c: &mut Criterion) {
    if let Err(message) = one(c) {
        eprintln!("anabaena: {message}");
    }
}

fn one(c: &mut Criterion) -> Result<(), String> {
    let anabaena = Anabaena::open()?;
    let state = anabaena.state(END).ok_or("no state at the end")?;
    let error = |tolerance| {
        let (string, _) = anabaena.run(auto(tolerance), END).ok()?;
        Some(anabaena.error(&string, state))
    };
    let (tolerance, _) = tune::search(3, 12, TARGET, error).ok_or("dlsys does not reach the error")?;
    let mut group = c.benchmark_group("anabaena to t = 575");
    group.sample_size(20);
    group.bench_function("dlsys, error 1e-6", |b| b.iter(|| black_box(anabaena.run(auto(tolerance), END))));
    group.bench_function("Euler, step 0.1, error 7e-2", |b| {
        b.iter(|| black_box(anabaena.run(euler(0.1), END)))
    });
    group.finish();
    Ok(())
}

criterion_group!(benches, listing);
criterion_main!(benches);
