//! Prints the exact cases, and the cost of clouds: `cargo run --release -p dlsys-gas --example gas_table`.

use dlsys_gas::study;
use dlsys_wind::study::Convergence;

fn main() -> Result<(), dlsys_gas::Error> {
    for case in study::EXACT_CASES {
        for row in case()? {
            let order = row.order.map_or(String::new(), |order| format!("{order:.2}"));
            let Convergence { case, resolution, value, expected, error, .. } = row;
            println!(
                "{case:<56} {resolution:>9.2e} {value:>16.9e} {expected:>16.9e} {error:>9.1e} {order:>6}"
            );
        }
    }
    println!();
    for study::Speed { name, value, unit } in study::speeds()? {
        println!("{name:<42} {value:>10.1} {unit}");
    }
    Ok(())
}
