//! Pictures of the wind: `cargo run --release -p dlsys-wind --example look -- FOLDER`.
//!
//! - `slice.png`: the velocity along the wind without its mean, in a horizontal plane of 60 by 40 integral scales: blue is slower, red
//!   faster. Neither a lattice nor a repetition may be seen.
//! - `across.png`: the same for the component across the wind.
//! - `streaks.png`: stream lines of the turbulence over 6 by 4 integral scales, by noise that is averaged along them.
//! - `paper.png`: the same for the field of Stam and Fiume.
//! - `square.png`: what becomes of a square of smoke in that field within 2.5 s, as in figure 1 of the paper: 4 m across, every half of a second. It shows
//!   the eddies of the first of three lattices, down to 0.3 m, because smaller ones only blur it.
//! - `ground.png`: stream lines over a hill, with a ball in the wind.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use dlsys_wind::{Description, Field, Ground, Snapshot, Sphere, study};
use nalgebra::Vector3;

const WIDTH: usize = 960;
const HEIGHT: usize = 640;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A plane through the wind: the place of a pixel, and the directions of its axes.
struct Plane {
    corner: Vector3<f64>,
    right: Vector3<f64>,
    down: Vector3<f64>,
    /// Metres a pixel.
    scale: f64,
}

impl Plane {
    fn place(&self, column: f64, row: f64) -> Vector3<f64> {
        self.corner + (self.right * column + self.down * row) * self.scale
    }
}

fn write(path: &Path, pixels: &[[u8; 3]]) -> Result<()> {
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), WIDTH as u32, HEIGHT as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&pixels.concat())?;
    println!("{}", path.display());
    Ok(())
}

/// Blue for -1, white for 0, red for 1.
fn colour(value: f64) -> [u8; 3] {
    let v = value.clamp(-1.0, 1.0);
    let fade = |strength: f64| (255.0 * (1.0 - strength * v.abs())) as u8;
    if v < 0.0 { [fade(0.9), fade(0.6), fade(0.2)] } else { [fade(0.2), fade(0.75), fade(0.9)] }
}

fn slice(path: &Path, plane: &Plane, value: impl Fn(Vector3<f64>) -> f64) -> Result<()> {
    let pixels: Vec<[u8; 3]> = (0..WIDTH * HEIGHT)
        .map(|i| colour(value(plane.place((i % WIDTH) as f64, (i / WIDTH) as f64))))
        .collect();
    write(path, &pixels)
}

/// Noise of a pixel, from 0 to 1.
fn noise(column: f64, row: f64) -> f64 {
    let (x, y) = (column.floor() as i64 as u64, row.floor() as i64 as u64);
    let mut z = x.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Line integral convolution: noise averaged along 16 pixels of the stream line to each side, coloured by the speed in units of `full`.
fn streaks(
    path: &Path,
    plane: &Plane,
    full: f64,
    velocity: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Result<()> {
    let flow: Vec<[f64; 2]> = (0..WIDTH * HEIGHT)
        .map(|i| {
            let u = velocity(plane.place((i % WIDTH) as f64, (i / WIDTH) as f64));
            [u.dot(&plane.right), u.dot(&plane.down)]
        })
        .collect();
    let at = |x: f64, y: f64| {
        let (column, row) = (x.max(0.0) as usize, y.max(0.0) as usize);
        flow[row.min(HEIGHT - 1) * WIDTH + column.min(WIDTH - 1)]
    };
    let pixels: Vec<[u8; 3]> = (0..WIDTH * HEIGHT)
        .map(|i| {
            let start = ((i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5);
            let (mut sum, mut count) = (noise(start.0, start.1), 1.0);
            for side in [1.0, -1.0] {
                let (mut x, mut y) = start;
                for _ in 0..16 {
                    let [u, v] = at(x, y);
                    let speed = u.hypot(v).max(1e-9);
                    x += side * u / speed;
                    y += side * v / speed;
                    sum += noise(x, y);
                    count += 1.0;
                }
            }
            let light = (0.5 + 2.2 * (sum / count - 0.5)).clamp(0.0, 1.0);
            let [u, v] = flow[i];
            let strength = (u.hypot(v) / full).min(1.0);
            [0.25 + 0.75 * strength, 0.35 + 0.4 * strength, 0.6 - 0.4 * strength]
                .map(|c| (255.0 * c * (0.35 + 0.65 * light)) as u8)
        })
        .collect();
    write(path, &pixels)
}

/// Panels of `square.png`, in two rows; the seconds between them; steps of the paths between them.
const PANELS: usize = 6;
const PAUSE: f64 = 0.5;
const STEPS: usize = 10;

/// A square of smoke that the turbulence of a field carries along: each pixel shows where its air was at the beginning.
fn square(path: &Path, field: &Field, mean: Vector3<f64>) -> Result<()> {
    let (columns, side) = (3, WIDTH / 3);
    let step = PAUSE / STEPS as f64;
    let instant = |i: usize| field.at(i as f64 * step).map(|wind| study::first_lattice(&wind));
    let instants = (0..=(PANELS - 1) * STEPS).map(instant);
    let instants = instants.collect::<std::result::Result<Vec<Snapshot>, _>>()?;
    let scale = 4.0 / side as f64;
    let pixels: Vec<[u8; 3]> = (0..WIDTH * HEIGHT)
        .map(|i| {
            let (column, row) = (i % WIDTH, i / WIDTH);
            let panel = row / side * columns + column / side;
            let place = |pixel: usize, part: f64| ((pixel % side) as f64 + part) * scale - 2.0;
            // Four places a pixel.
            let sum: f64 = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
                .map(|(right, down)| {
                    let mut x = Vector3::new(place(column, right), 0.0, place(row, down));
                    // Heun's method, backwards.
                    for pair in instants[..=panel * STEPS].windows(2).rev() {
                        let [before, after] = pair else { continue };
                        let late = after.velocity(x) - mean;
                        let early = before.velocity(x - late * step) - mean;
                        x -= (late + early) * (0.5 * step);
                    }
                    if x.x.abs().max(x.z.abs()) < 0.8 { 0.25 } else { 0.0 }
                })
                .iter()
                .sum();
            let frame = column % side == 0 || row % side == 0;
            [if frame { 200 } else { (255.0 - 215.0 * sum) as u8 }; 3]
        })
        .collect();
    write(path, &pixels)
}

fn main() -> Result<()> {
    let folder = std::env::args().nth(1).ok_or("usage: look FOLDER")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let mean = Vector3::new(10.0, 0.0, 0.0);
    let gusty = || Description { turbulence: 0.2, scale: 1.0, ..Description::new(Vector3::x(), 10.0) };
    let wind = Field::new(gusty())?.at(0.0)?;
    let wide = Plane {
        corner: Vector3::zeros(),
        right: Vector3::x(),
        down: Vector3::z(),
        scale: 60.0 / WIDTH as f64,
    };
    slice(&folder.join("slice.png"), &wide, |x| (wind.velocity(x) - mean).x / 5.0)?;
    slice(&folder.join("across.png"), &wide, |x| wind.velocity(x).z / 5.0)?;
    let close = Plane { scale: 6.0 / WIDTH as f64, ..wide };
    streaks(&folder.join("streaks.png"), &close, 5.0, |x| wind.velocity(x) - mean)?;
    let field = study::paper(0)?;
    let paper = field.at(0.0)?;
    streaks(&folder.join("paper.png"), &close, 1.8, |x| paper.velocity(x) - Vector3::x())?;
    square(&folder.join("square.png"), &field, Vector3::x())?;

    // A hill 1 m high, seen from the side; a ball of 1 m above its slope.
    let hill = Ground::Uneven {
        height: Box::new(|x, _, _| {
            let (d, width) = (x - 6.0, 2.0);
            let h = (-d * d / (2.0 * width * width)).exp();
            [h, -d / (width * width) * h, 0.0]
        }),
        fading: 3.0,
    };
    let ball = Sphere::fixed(Vector3::new(2.5, 2.5, 0.0), 0.5);
    let over = Description {
        turbulence: 0.15,
        roughness: Some(0.02),
        ground: Some(hill),
        obstacles: vec![Box::new(ball)],
        ..gusty()
    };
    let wind = Field::new(over)?.at(0.0)?;
    let side = Plane {
        corner: Vector3::new(0.0, 6.5, 0.0),
        right: Vector3::x(),
        down: -Vector3::y(),
        scale: 12.0 / WIDTH as f64,
    };
    streaks(&folder.join("ground.png"), &side, 16.0, |x| wind.velocity(x))?;
    Ok(())
}
