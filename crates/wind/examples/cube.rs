//! Samples of the wind for other programs: `cargo run --release -p dlsys-wind --example cube -- POINTS SIDE SEED FILE`.
//!
//! The turbulence in a cube of POINTS³ places and SIDE integral scales, with a variance of about 1 m²/s² for each component and an integral
//! scale of 1 m: little-endian numbers of 64 bits, x fastest, three to a place.

use std::io::Write;

use dlsys_wind::{Description, Field, grid};
use nalgebra::Vector3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [points, side, seed, file] = arguments.as_slice() else {
        return Err("usage: cube POINTS SIDE SEED FILE".into());
    };
    let (points, side) = (points.parse::<usize>()?, side.parse::<f64>()?);
    // One place of each axis lies beyond the cube, so that a period of the samples is SIDE.
    let end = side * (points - 1) as f64 / points as f64;
    let field = Field::new(Description {
        turbulence: 0.1,
        scale: 1.0,
        seed: seed.parse()?,
        ..Description::new(Vector3::x(), 10.0)
    })?;
    let wind = field.at(0.7)?;
    let mut out = std::io::BufWriter::new(std::fs::File::create(file)?);
    for x in grid(Vector3::zeros(), Vector3::repeat(end), [points; 3]) {
        let u = wind.velocity(x) - Vector3::new(10.0, 0.0, 0.0);
        for component in u.iter() {
            out.write_all(&component.to_le_bytes())?;
        }
    }
    Ok(out.flush()?)
}
