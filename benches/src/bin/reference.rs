//! Computes the stored references of the nonlinear filament: `cargo run --release --bin reference`.
//!
//! The stiff filament is also integrated with diffsol's explicit method, in about a million steps, because stability
//! limits the steps far more than accuracy does. So the reference has nothing in common with the implicit methods that are
//! compared with it. The difference from a second run with another tolerance estimates the error of the values.

use dlsys_benches::chain::WALL;
use dlsys_benches::filament::{Coupling, D_SLOW, D_STIFF, Filament, STORED, stored_cells};

fn main() -> Result<(), String> {
    let mut all = serde_json::Map::new();
    for d in [D_SLOW, D_STIFF] {
        let candidate = &Filament { coupling: Coupling::Nonlinear, d }.explicit()[2];
        let mut outputs: Vec<Vec<Vec<f64>>> = Vec::new();
        for tolerance in [1e-12, 1e-13] {
            let mut solver = (candidate.prepare)(tolerance)?;
            solver.run()?;
            let pick = |values: Vec<f64>| stored_cells().iter().map(|i| values[*i]).collect::<Vec<f64>>();
            outputs.push((0..3).map(|output| pick(solver.values(output))).collect());
        }
        let pairs = outputs[0].iter().flatten().zip(outputs[1].iter().flatten());
        let worst = pairs.map(|(a, b)| (a - b).abs() / WALL).fold(0.0, f64::max);
        println!("D = {d}: two tolerances differ by {worst:.1e}, relative to {WALL}");
        let values = serde_json::to_value(&outputs[1]).map_err(|e| e.to_string())?;
        all.insert(format!("{d}"), values);
    }
    let text = serde_json::to_string(&all).map_err(|e| e.to_string())?.replace("],", "],\n");
    std::fs::write(STORED, text + "\n").map_err(|e| format!("{STORED}: {e}"))
}
