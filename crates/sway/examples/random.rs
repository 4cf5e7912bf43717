//! Prints random cases: `cargo run --release -p dlsys-sway --example random -- FIRST COUNT [TOLERANCE]`.

use dlsys_sway::{Method, study};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: f64| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (first, count, tolerance) = (number(0.0) as u64, number(200.0) as u64, number(1e-3));
    let (mut failed, mut steps, mut work, mut worst) = (0, 0, 0, 0.0_f64);
    for seed in first..first + count {
        let case = study::random_case(seed, Method::Ros2, tolerance);
        let tried = case.steps + case.rejected;
        steps += tried;
        work += tried * case.segments as u64;
        failed += usize::from(case.failure.is_some());
        worst = worst.max(case.gain.unwrap_or(0.0));
        if case.failure.is_some() || case.steps > 10_000 || count <= 5 {
            println!("{case:?}");
        }
    }
    println!(
        "{failed} of {count} failed; {steps} steps, {work} segment steps, largest gain of energy {worst:.2e}"
    );
}
