//! A ball moves through rising smoke and pushes it aside: `cargo run --release -p dlsys-gas --example smoke -- FILE.png`.
//!
//! Three instants side by side, as in the last figure of Stam and Fiume: the smoke shades itself, and the ball.

use std::fs::File;
use std::io::BufWriter;
use std::time::Instant;

use dlsys_gas::{Breeze, Cloud, Gas, Light, Look, Ray, Settings, Smoke, Source, Span, Vector};
use dlsys_wind::{Description, Field, Signal, Sphere};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Pixels of a panel, and the instants that panels show, in s.
const PANEL: [usize; 2] = [300, 480];
const INSTANTS: [f64; 3] = [2.2, 3.0, 3.8];
/// Metres from the bottom to the top of a panel.
const HEIGHT: f64 = 3.0;
/// Radius of the ball and its speed along x, in m and m/s.
const RADIUS: f64 = 0.28;
const SPEED: f64 = 0.8;
const THREADS: usize = 2;
const SUN: [f64; 3] = [1.0, 0.95, 0.85];
const SKY: [f64; 3] = [0.22, 0.26, 0.32];

/// Towards the sun.
fn towards() -> Vector {
    Vector::new(-0.6, 0.7, 0.4).normalize()
}

/// The centre of the ball.
fn ball(time: f64) -> Vector {
    Vector::new(SPEED * (time - 3.0), 1.35, 0.0)
}

fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "smoke.png".to_owned());
    let sphere = Sphere {
        centre: [Signal::function(|time| ball(time).x), 1.35.into(), 0.0.into()],
        velocity: [SPEED.into(), 0.0.into(), 0.0.into()],
        radius: RADIUS,
    };
    let field = Field::new(Description {
        turbulence: 0.22,
        scale: 0.5,
        seed: 5,
        obstacles: vec![Box::new(sphere)],
        ..Description::new(Vector::y(), 0.8)
    })?;
    let gas = Gas { diffusion: 1.5e-4, decay: 0.25, size: 0.02, mass: 1e-5, fall: 0.0 };
    let look = Look { extinction: 22.0, albedo: [0.93, 0.94, 0.96], glow: [0.0; 3] };
    let mut cloud = Cloud::new(gas, Settings { threads: THREADS, split: 0.05, ..Settings::default() })?;
    let source = [Source::at(1, Vector::zeros(), 0.16, 6000.0)];
    let mut wind = Breeze::new(&field, 0.0, cloud.tick());
    let (mut panels, begun) = (Vec::new(), Instant::now());
    for instant in INSTANTS {
        while cloud.time() + cloud.tick() <= instant {
            cloud.advance(&source, &wind)?;
            wind = wind.next();
        }
        let shown = cloud.shown(instant, &source, &wind)?;
        println!("{instant} s: {} blobs after {:.1} s", shown.len(), begun.elapsed().as_secs_f64());
        let lights = [Light::Distant { towards: towards(), colour: SUN }, Light::Ambient(SKY)];
        let smoke = Smoke::cut(look, shown.blobs().collect(), 3.0)?.lit(&lights, THREADS)?;
        panels.push(panel(&smoke, ball(instant))?);
    }
    println!("drawn after {:.1} s", begun.elapsed().as_secs_f64());
    write(&path, &panels)?;
    println!("{path}");
    Ok(())
}

/// The pixels of a panel, row by row, drawn by some threads.
fn panel(smoke: &Smoke, centre: Vector) -> Result<Vec<[f64; 3]>> {
    let [width, height] = PANEL;
    let mut pixels = vec![[0.0; 3]; width * height];
    let parts = pixels.chunks_mut(width * height.div_ceil(THREADS)).enumerate();
    let failed = std::thread::scope(|scope| {
        let handles: Vec<_> = parts
            .map(|(part, pixels)| {
                scope.spawn(move || {
                    let first = part * width * height.div_ceil(THREADS);
                    pixels.iter_mut().enumerate().try_for_each(|(index, pixel)| {
                        let (column, row) = ((first + index) % width, (first + index) / width);
                        *pixel = seen(smoke, centre, column as f64 + 0.5, row as f64 + 0.5)?;
                        Ok(())
                    })
                })
            })
            .collect();
        let ends: Vec<std::result::Result<(), dlsys_gas::Error>> =
            handles.into_iter().filter_map(|handle| handle.join().ok()).collect();
        ends.into_iter().find_map(std::result::Result::err)
    });
    failed.map_or(Ok(pixels), |error| Err(error.into()))
}

/// The light that comes to the camera at a pixel.
fn seen(
    smoke: &Smoke,
    centre: Vector,
    column: f64,
    row: f64,
) -> std::result::Result<[f64; 3], dlsys_gas::Error> {
    let [width, height] = PANEL.map(|size| size as f64);
    let scale = HEIGHT / height;
    let target = Vector::new((column - width / 2.0) * scale, HEIGHT - 0.3 - row * scale, 0.0);
    let camera = Vector::new(0.0, 1.2, 8.0);
    let ray = Ray::new(camera, target - camera)?;
    let aside = centre - ray.origin;
    let along = aside.dot(&ray.direction);
    let room = RADIUS * RADIUS - (aside - ray.direction * along).norm_squared();
    let (end, behind) = if room > 0.0 {
        let distance = along - room.sqrt();
        (distance, surface(smoke, centre, ray.origin + ray.direction * distance)?)
    } else {
        let share = row / height;
        (f64::INFINITY, [0.05 + 0.07 * share, 0.08 + 0.09 * share, 0.13 + 0.1 * share])
    };
    let (colour, passing) = smoke.light(&ray, Span { from: 0.0, to: end });
    Ok(std::array::from_fn(|k| colour[k] + passing * behind[k]))
}

/// The light of a point of the ball, in the shadow of the smoke.
fn surface(smoke: &Smoke, centre: Vector, point: Vector) -> std::result::Result<[f64; 3], dlsys_gas::Error> {
    let normal = (point - centre) / RADIUS;
    let facing = normal.dot(&towards()).max(0.0);
    let sun = facing * smoke.transmittance(&Ray::new(point, towards())?, Span::ALL);
    let paint = [0.75, 0.2, 0.12];
    Ok(std::array::from_fn(|k| paint[k] * (sun * SUN[k] + SKY[k] * (0.7 + 0.3 * normal.y))))
}

/// Panels side by side.
fn write(path: &str, panels: &[Vec<[f64; 3]>]) -> Result<()> {
    let [width, height] = PANEL;
    let mut bytes = Vec::with_capacity(3 * panels.len() * width * height);
    for row in 0..height {
        for pixel in panels.iter().flat_map(|panel| &panel[row * width..(row + 1) * width]) {
            // The transfer function of sRGB, about.
            bytes.extend(pixel.map(|value| (255.0 * value.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8));
        }
    }
    let all = (panels.len() * width) as u32;
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), all, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&bytes)?;
    Ok(())
}
