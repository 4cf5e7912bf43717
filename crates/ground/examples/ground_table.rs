//! Prints the exact cases, the rules of the papers beside the law, and the speed of sweeps; only one of these with the argument `cases`, `rules` or `speed`.

use dlsys_ground::{Error, study};

fn main() -> Result<(), Error> {
    let only = std::env::args().nth(1);
    let wanted = |part: &str| only.as_deref().is_none_or(|only| only == part);
    for case in study::EXACT_CASES.into_iter().chain([study::SLOW_CASE]).filter(|_| wanted("cases")) {
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
    if wanted("rules") {
        for row in study::rules()? {
            println!("{row:?}");
        }
    }
    if wanted("speed") {
        for speed in study::speeds()? {
            println!("{:<48} {:>8.1} {}", speed.name, speed.value, speed.unit);
        }
    }
    Ok(())
}
