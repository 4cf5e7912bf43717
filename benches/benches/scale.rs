//! A million modules with criterion: productions, contexts, coupled filaments, frames, parsing.
//!
//! The `scale` binary measures ratios and compares them with their targets.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use dlsys::session::Session;
use dlsys::sim::{Method, Scheduler, Settings, Simulation};
use dlsys::tree::ModuleString;
use dlsys_benches::plants::{self, Branches, Growing, Lives};
use dlsys_benches::{scale, solver};

fn session(text: &str) -> Session {
    solver::session(text).expect("a good model")
}

/// A simulation that has come to a time.
fn at(session: &Session, settings: Settings, t: f64) -> Simulation<'_> {
    let mut simulation = session.simulate(settings).expect("it starts");
    simulation.pass(t).expect("it runs");
    simulation
}

/// Measures `length` units of time, one after another in one simulation, which stays the same kind of thing.
fn stationary(c: &mut Criterion, group: &str, name: &str, text: &str, settings: Settings, length: f64) {
    let session = session(text);
    let mut simulation = at(&session, settings, 2.0);
    let before = simulation.stats().events;
    let mut t = 2.0 + length;
    simulation.pass(t).expect("it runs");
    let events = simulation.stats().events - before;
    let mut group = c.benchmark_group(group);
    group.sample_size(10).throughput(Throughput::Elements(events.max(1)));
    group.bench_function(name, |b| {
        b.iter(|| {
            t += length;
            simulation.pass(t).expect("it runs");
        });
    });
    group.finish();
}

fn parsing(c: &mut Criterion) {
    let mut group = c.benchmark_group("reading");
    group.sample_size(10);
    for (name, text) in
        [("20,000 cells", Growing::Vegetative.text(20_000, 1)), ("rules", plants::many_rules(40_000))]
    {
        group.throughput(Throughput::Bytes(text.len() as u64));
        group.bench_function(name, |b| b.iter(|| black_box(solver::session(&text))));
    }
    group.finish();
}

/// Elements are productions.
fn productions(c: &mut Criterion) {
    for lives in Lives::ALL {
        for (n, length) in [(1_000, 10.0), (1_000_000, 0.1)] {
            let name = format!("{}, {n} modules", lives.name());
            stationary(c, "productions", &name, &lives.text(n), Settings::default(), length);
        }
    }
}

fn dragon(c: &mut Criterion) {
    let session = session(scale::DRAGON);
    let mut group = c.benchmark_group("dragon to t = 16");
    group.sample_size(10);
    for (name, frames) in [("state at the end", 1), ("1,024 frames formed", 1024)] {
        group.bench_function(name, |b| b.iter(|| black_box(scale::observed(&session, 16.0, frames))));
    }
    group.finish();
}

/// Elements are evaluations of the equation of one cell.
fn right_hand_sides(c: &mut Criterion) {
    let mut group = c.benchmark_group("right-hand sides");
    group.sample_size(20);
    let settings = Settings { method: Method::Dop853, ..Settings::default() };
    let evaluations = scale::right_hand_sides(settings.tolerance, 100.0).expect("it runs").rhs_evaluations;
    group.throughput(Throughput::Elements(evaluations));
    group.bench_function("1,000 cells, DOP853", |b| {
        b.iter(|| black_box(scale::right_hand_sides(settings.tolerance, 100.0)));
    });
    group.finish();
}

/// Elements are branches.
fn contexts(c: &mut Criterion) {
    for branches in Branches::ALL {
        for n in [4_000, 16_000] {
            let session = session(&branches.text(n));
            let mut group = c.benchmark_group(format!("branches, {}", branches.name()));
            group.sample_size(10).throughput(Throughput::Elements(n as u64));
            group.bench_function(format!("{n}"), |b| {
                b.iter(|| drop(black_box(at(&session, Settings::default(), 1.5))));
            });
            group.finish();
        }
    }
}

/// Elements are events.
fn busy(c: &mut Criterion) {
    let text = plants::busy(1000);
    for (name, scheduler, length) in [("auto", Scheduler::Auto, 1.0), ("global", Scheduler::Global, 0.1)] {
        stationary(c, "busy filament", name, &text, scale::with(scheduler, 1e-6), length);
    }
}

/// Elements are cells: the time of a unit of time of each.
fn growing(c: &mut Criterion) {
    for growing in Growing::ALL {
        let mut group = c.benchmark_group(format!("growing filament, {}", growing.name()));
        group.sample_size(10);
        for n in [1_000, 100_000] {
            let session = session(&growing.text(n, 7));
            group.throughput(Throughput::Elements(n as u64));
            // From the same state each time: a filament that grew on would not stay at its size.
            group.bench_function(format!("{n} cells"), |b| {
                b.iter_batched(
                    || at(&session, Settings::default(), 5.0),
                    |mut simulation| simulation.pass(6.0).expect("it runs"),
                    BatchSize::PerIteration,
                );
            });
        }
        group.finish();
    }
}

/// Elements are modules, none of which is replaced.
fn frames(c: &mut Criterion) {
    let session = session(scale::DRAGON);
    let mut simulation = at(&session, Settings::default(), 15.0);
    let mut string = ModuleString::default();
    let mut t = 15.0;
    let mut group = c.benchmark_group("frames");
    simulation.at(t, &mut string).expect("it runs");
    group.throughput(Throughput::Elements(string.len() as u64));
    group.bench_function("dragon, t = 15 to 16", |b| {
        b.iter(|| {
            // No end comes, however often this is run.
            t += (16.0 - t) * 1e-6;
            simulation.at(t, &mut string).expect("it runs");
        });
    });
    group.finish();
}

criterion_group!(benches, parsing, productions, dragon, right_hand_sides, contexts, busy, growing, frames);
criterion_main!(benches);
