//! Prints the exact cases and the speed of sweeps; only the latter with the argument `speed`.

use dlsys_ground::{Error, study};

fn main() -> Result<(), Error> {
    let only_speed = std::env::args().nth(1).is_some_and(|word| word == "speed");
    for case in study::EXACT_CASES.into_iter().chain([study::SLOW_CASE]).filter(|_| !only_speed) {
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
