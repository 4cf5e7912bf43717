//! Measured statistics of the turbulence, next to what theory says.
//!
//! Values come from the fields as they are: from sampled velocities and from the amplitudes of modes, averaged over seeds.

mod convergence;
mod lines;
mod shells;

pub use convergence::Convergence;
use lines::Lines;
use nalgebra::Vector3;
use shells::Shells;

use crate::random::Draw;
use crate::spectrum::Energy;
use crate::{Description, Error, Field, Snapshot, Spectrum};

/// A measured number, and what it should be.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What was measured, with its unit if it has one.
    pub name: String,
    /// The measured value.
    pub value: f64,
    /// The value according to theory.
    pub expected: f64,
    /// The deviation: relative where a value other than 0 and correlations is expected, absolute otherwise.
    pub error: f64,
    /// The largest deviation that is acceptable.
    pub bound: f64,
}

impl Row {
    /// A row whose error is relative.
    fn relative(name: impl Into<String>, value: f64, expected: f64, bound: f64) -> Row {
        Row { name: name.into(), value, expected, error: (value / expected - 1.0).abs(), bound }
    }

    /// A row whose error is absolute.
    fn absolute(name: impl Into<String>, value: f64, expected: f64, bound: f64) -> Row {
        Row { name: name.into(), value, expected, error: (value - expected).abs(), bound }
    }

    /// Whether the error is within its bound.
    pub fn holds(&self) -> bool {
        self.error <= self.bound
    }
}

/// The integral scale of the fields that are measured, in metres; von Kármán's length is 1.339 m.
const SCALE: f64 = 1.0;
/// Their speed in m/s and their intensity.
const SPEED: f64 = 10.0;
const INTENSITY: f64 = 0.2;

/// A wind in empty space, for a seed.
fn von_karman(seed: u64) -> Result<Field, Error> {
    Field::new(Description {
        turbulence: INTENSITY,
        scale: SCALE,
        seed,
        ..Description::new(heading(), SPEED)
    })
}

/// The field of Stam and Fiume 1993: ε = 1, k_inertial = 4, σ = 1.
///
/// # Errors
///
/// None with these values.
pub fn paper(seed: u64) -> Result<Field, Error> {
    let spectrum = Spectrum::Kolmogorov { dissipation: 1.0, inertial: 4.0, sigma: 1.0 };
    Field::new(Description { turbulence: 1.0, seed, spectrum, ..Description::new(Vector3::x(), 1.0) })
}

/// The same wind without the smaller eddies, which are in the second and the third lattice: for measurements of the cost of one lattice.
pub fn first_lattice(wind: &Snapshot) -> Snapshot {
    wind.with_lattices(1)
}

/// The direction of the wind in the fields that are measured: along no axis.
fn heading() -> Vector3<f64> {
    Vector3::new(2.0, 1.0, -0.5).normalize()
}

/// The largest wave number of a field in rad/m.
fn end(field: &Field) -> f64 {
    field.bands().last().map_or(0.0, |band| band.range[1])
}

/// A place at random within 100 m of the origin, along each axis.
fn place(draw: Draw) -> Vector3<f64> {
    Vector3::from_fn(|i, _| 200.0 * draw.of(i as u64).unit() - 100.0)
}

/// Statistics of turbulence over the seeds from 0 on: variances, isotropy, spectra, correlations in space and in time, divergence,
/// and the field of the paper. 32 seeds bring statistical errors well below the bounds, and take some seconds (release build).
///
/// # Errors
///
/// None; the fields that it builds are valid.
pub fn statistics(seeds: u64) -> Result<Vec<Row>, Error> {
    let seeds = seeds.max(1);
    let (mut rows, first) = (Vec::new(), von_karman(0)?);
    // Samples on one thread, amplitudes on another; on each, one field at a time, which takes some megabytes, in the order of the seeds.
    let sampled = || {
        let (mut variances, mut lines) = (Variances::default(), Lines::default());
        for seed in 0..seeds {
            let field = von_karman(seed)?;
            variances.add(&field, seed)?;
            lines.add(&field, seed)?;
        }
        Ok::<_, Error>((variances, lines))
    };
    let by_modes = || {
        let (mut shells, mut paper) = (Shells::new(&first), Vec::new());
        for seed in 0..seeds {
            shells.add(&von_karman(seed)?)?;
        }
        of_paper(seeds, &mut paper)?;
        Ok::<_, Error>((shells, paper))
    };
    let (sampled, modes) = std::thread::scope(|scope| {
        let sampled = scope.spawn(sampled);
        let modes = by_modes();
        (sampled.join(), modes)
    });
    let (variances, lines) = sampled.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
    let (shells, paper) = modes?;
    variances.rows(&first, &mut rows)?;
    shells.rows(&mut rows);
    lines.rows(&first, &mut rows);
    divergence(&first, &mut rows)?;
    rows.extend(paper);
    Ok(rows)
}

/// Variances of components and products of different ones, over whole boxes and at random places: sums over fields.
#[derive(Default)]
struct Variances {
    fields: f64,
    square: Vector3<f64>,
    cross: Vector3<f64>,
    sampled: f64,
}

/// Places at which each field is sampled.
const PLACES: u64 = 4000;

impl Variances {
    fn add(&mut self, field: &Field, seed: u64) -> Result<(), Error> {
        self.fields += 1.0;
        field.modes(0.0, |_, _, [re, im]| {
            // A mode and its conjugate.
            self.square += (re.component_mul(&re) + im.component_mul(&im)) * 2.0;
            self.cross += (re.component_mul(&re.yzx()) + im.component_mul(&im.yzx())) * 2.0;
        })?;
        let mean = heading() * SPEED;
        let wind = field.at(0.0)?;
        let draw = Draw::new(1).of(seed);
        self.sampled +=
            (0..PLACES).map(|i| (wind.velocity(place(draw.of(i))) - mean).norm_squared()).sum::<f64>();
        Ok(())
    }

    fn rows(&self, field: &Field, rows: &mut Vec<Row>) -> Result<(), Error> {
        let expected = field.variance(0.0)?;
        let energy = Energy::new(Spectrum::VonKarman, SCALE);
        let share = energy.integral(0.0, end(field)) / energy.integral(0.0, f64::INFINITY);
        let full = (INTENSITY * SPEED).powi(2);
        rows.push(Row::relative("share of the variance that is resolved", expected / full, share, 1e-9));
        for (i, name) in ["x", "y", "z"].iter().enumerate() {
            let name = format!("variance of u_{name}, modes, m²/s²");
            rows.push(Row::relative(name, self.square[i] / self.fields, expected, 0.02));
        }
        for (i, name) in ["xy", "yz", "zx"].iter().enumerate() {
            let name = format!("correlation of components {name}, modes");
            rows.push(Row::absolute(name, self.cross[i] / self.fields / expected, 0.0, 0.02));
        }
        let sampled = self.sampled / (3.0 * PLACES as f64 * self.fields);
        rows.push(Row::relative("variance of a component, sampled, m²/s²", sampled, expected, 0.02));
        Ok(())
    }
}

/// The largest divergence at 10⁵ random places.
fn divergence(field: &Field, rows: &mut Vec<Row>) -> Result<(), Error> {
    let wind = field.at(12.5)?;
    let draw = Draw::new(2);
    let (mut largest, mut square) = (0.0f64, 0.0);
    let points = 100_000;
    for i in 0..points {
        let (_, gradient) = wind.velocity_and_gradient(place(draw.of(i)));
        largest = largest.max(gradient.trace().abs());
        square += gradient.norm_squared();
    }
    let rms = (square / points as f64).sqrt();
    rows.push(Row::absolute("largest divergence, relative to the rms gradient", largest / rms, 0.0, 1e-13));
    Ok(())
}

/// The variance of the paper's field.
fn of_paper(seeds: u64, rows: &mut Vec<Row>) -> Result<(), Error> {
    let (points, mut square, mut modes) = (4000, 0.0, 0.0);
    for seed in 0..seeds {
        let field = paper(seed)?;
        modes = field.variance(0.0)?;
        let wind = field.at(0.5)?;
        let draw = Draw::new(3).of(seed);
        square += (0..points)
            .map(|i| (wind.velocity(place(draw.of(i))) - Vector3::x()).norm_squared())
            .sum::<f64>();
    }
    let value = square / (3 * points * seeds) as f64;
    rows.push(Row::relative("the paper's field: variance of a component, m²/s²", value, modes, 0.02));
    // Two thirds of ∫1.5 k^(-5/3) dk from 4 rad/m to infinity.
    let all = 1.5 * 4f64.powf(-2.0 / 3.0);
    rows.push(Row::relative("the paper's field: sum of the modes for the integral, m²/s²", modes, all, 0.05));
    Ok(())
}
