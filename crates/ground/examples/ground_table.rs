//! Prints the exact cases and the speed of sweeps.

use dlsys_ground::{Error, study};

fn main() -> Result<(), Error> {
    for case in study::EXACT_CASES {
        let begun = std::time::Instant::now();
        for row in case()? {
            let order = row.order.map_or(String::new(), |order| format!("{order:.2}"));
            println!(
                "{:<72} {:>6} {:>10.5} {:>10.5} {:>9.2e} {order}",
                row.case, row.resolution, row.value, row.expected, row.error
            );
        }
        println!("{:.2} s", begun.elapsed().as_secs_f64());
    }
    for speed in study::speeds()? {
        println!("{:<48} {:>8.1} {}", speed.name, speed.value, speed.unit);
    }
    Ok(())
}
