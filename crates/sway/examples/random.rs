//! Prints random cases: `cargo run --release -p dlsys-sway --example random -- FIRST COUNT`.

use dlsys_sway::{Method, study};

fn main() {
    if let Ok(seed) = std::env::var("SHOW") {
        study::show_case(seed.parse().unwrap());
        return;
    }
    let numbers: Vec<u64> = std::env::args().skip(1).filter_map(|text| text.parse().ok()).collect();
    let (first, count) = (numbers.first().copied().unwrap_or(0), numbers.get(1).copied().unwrap_or(200));
    let tolerance = std::env::args().nth(3).and_then(|t| t.parse().ok()).unwrap_or(1e-3);
    let method = match std::env::args().nth(4).as_deref() {
        Some("euler") => Method::Euler,
        Some("ros3") => Method::Ros34Pw2,
        _ => Method::Ros2,
    };
    let (mut failed, mut steps, mut work, mut slow) = (0, 0, 0, 0);
    let mut worst = 0.0_f64;
    let begun = std::time::Instant::now();
    for seed in first..first + count {
        let case = study::random_case(seed, method, tolerance);
        steps += case.steps + case.rejected;
        work += (case.steps + case.rejected) * case.segments as u64;
        if case.failure.is_some() {
            failed += 1;
        }
        if case.shortest < 1.0 / 30.0 / 16384.0 {
            slow += 1;
        }
        worst = worst.max(case.gain.unwrap_or(0.0));
        if count <= 5 || case.failure.is_some() || case.steps > 1000 || case.gain.is_some_and(|g| g > 0.2) {
            println!(
                "{seed:>5} n={} steps {} again {} shortest {:.1e} gain {:?} {}",
                case.segments,
                case.steps,
                case.rejected,
                case.shortest,
                case.gain,
                case.failure.map_or(String::new(), |f| f.to_string())
            );
        }
    }
    println!(
        "{failed} failed, {slow} beyond level 14, {steps} steps, {work} segment steps, worst gain {worst:.2e}, {:.2} s",
        begun.elapsed().as_secs_f64()
    );
}
