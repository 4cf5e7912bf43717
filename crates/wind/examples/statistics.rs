//! Prints the statistics of the turbulence next to theory: `cargo run --release -p dlsys-wind --example statistics -- [SEEDS]`. It fails if a
//! deviation exceeds its bound.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seeds = std::env::args().nth(1).map_or(Ok(32), |text| text.parse())?;
    println!("{:<68} {:>12} {:>12} {:>10} {:>8}", "statistic", "value", "expected", "error", "bound");
    let mut failures = 0;
    for row in dlsys_wind::study::statistics(seeds)? {
        failures += usize::from(!row.holds());
        let mark = if row.holds() { "" } else { "  FAILS" };
        println!(
            "{:<68} {:>12.6} {:>12.6} {:>10.2e} {:>8.0e}{mark}",
            row.name, row.value, row.expected, row.error, row.bound
        );
    }
    if failures > 0 { Err(format!("{failures} of these deviations are too large").into()) } else { Ok(()) }
}
