//! The four filaments with criterion: dlsys and diffsol's best, each at the tolerance that reaches 1e-9.
//!
//! The `compare` binary measures ratios, with both programs running alternately.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use dlsys_benches::filament::{Coupling, D_SLOW, D_STIFF, Filament, TARGET, TIMES};
use dlsys_benches::solver::{Candidate, Dlsys, Method, Solver};
use dlsys_benches::tune::tune;

/// A program that takes longer for one run is left out.
const LIMIT: Duration = Duration::from_secs(5);

fn filaments(c: &mut Criterion) {
    for coupling in [Coupling::Linear, Coupling::Nonlinear] {
        for d in [D_SLOW, D_STIFF] {
            if let Err(message) = one(c, Filament { coupling, d }) {
                eprintln!("{coupling:?}, D = {d}: {message}");
            }
        }
    }
}

fn one(c: &mut Criterion, problem: Filament) -> Result<(), String> {
    let reference = problem.reference()?;
    let error = |solver: &dyn Solver| reference.error(solver);
    let method = if problem.d == D_SLOW { Method::Tsit45 } else { Method::Bdf };
    let mut candidates: Vec<Candidate> = match method {
        // Landing on outputs, vectors of faer: the fastest of the explicit ones.
        Method::Tsit45 => problem.explicit().into_iter().skip(3).collect(),
        // The decomposition kept for 50 steps.
        method => problem.implicit(method).into_iter().skip(1).collect(),
    };
    if Dlsys::new(&problem.text(), 1e-6, &TIMES)?.ends_within(LIMIT)? {
        candidates.push(problem.dlsys());
    } else {
        eprintln!("{}: dlsys takes more than {LIMIT:?}, left out", problem.name());
    }
    let mut group = c.benchmark_group(problem.name());
    group.sample_size(20);
    for candidate in candidates {
        match tune(&candidate, (4, 14), TARGET, LIMIT, &error) {
            Some(mut tuned) => {
                group.bench_function(tuned.name, |b| b.iter(|| black_box(tuned.solver.run())));
            }
            None => eprintln!("{}: {} does not reach the error", problem.name(), candidate.name),
        }
    }
    group.finish();
    Ok(())
}

criterion_group!(benches, filaments);
criterion_main!(benches);
