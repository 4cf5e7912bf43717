//! Prints the exact cases, the hard cases and the methods side by side:
//! `cargo run --release -p dlsys-sway --example sway_table`. An argument is the number of segments of the longest chain (10000).

use dlsys_sway::study;
use dlsys_wind::study::Convergence;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let chain = std::env::args().nth(1).map_or(Ok(10_000), |text| text.parse())?;
    println!("{:<50} {:>8} {:>16} {:>16} {:>9} {:>6}", "case", "n", "value", "exact", "error", "order");
    for row in study::EXACT_CASES.iter().flat_map(|case| match case() {
        Ok(rows) => rows,
        Err(error) => {
            println!("{error}");
            Vec::new()
        }
    }) {
        let order = row.order.map_or(String::new(), |order| format!("{order:.2}"));
        let Convergence { case, resolution, value, expected, error, .. } = row;
        println!("{case:<50} {resolution:>8} {value:>16.9e} {expected:>16.9e} {error:>9.1e} {order:>6}");
    }
    println!(
        "\n{:<32} {:>6} {:>6} {:>9} {:>8} {:>9}",
        "hard case", "steps", "again", "shortest", "moved", "error"
    );
    for case in study::hard_cases(chain) {
        let error = case.error.map_or(String::new(), |error| format!("{error:.1e}"));
        let failure = case.failure.map_or(String::new(), |failure| failure.to_string());
        let study::HardCase { case, steps, rejected, shortest, moved, .. } = case;
        println!("{case:<32} {steps:>6} {rejected:>6} {shortest:>9.2e} {moved:>8.4} {error:>9} {failure}");
    }
    println!("\n{:<10} {:>9} {:>7} {:>7} {:>9}", "method", "tolerance", "steps", "evals", "error");
    for row in study::methods()? {
        let method = format!("{:?}", row.method);
        println!(
            "{method:<10} {:>9.0e} {:>7} {:>7} {:>9.1e}",
            row.tolerance, row.steps, row.evaluations, row.error
        );
    }
    Ok(())
}
