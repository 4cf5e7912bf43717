//! The energy spectrum and the correlation in time, from the amplitudes of modes.

use nalgebra::Vector3;

use super::{INTENSITY, Row, SCALE, SPEED};
use crate::spectrum::von_karman_length;
use crate::{Error, Field};

/// Shells of k between 11/L and 110/L.
const SHELLS: usize = 12;

pub(super) fn rows(fields: &[Field], rows: &mut Vec<Row>) -> Result<(), Error> {
    slope(fields, rows)?;
    decorrelation(fields, rows)
}

/// The slope of ln E over ln k, fitted over a decade above kL = 11.
fn slope(fields: &[Field], rows: &mut Vec<Row>) -> Result<(), Error> {
    let length = von_karman_length(SCALE);
    let ends: Vec<f64> = fields[0].bands().iter().map(|band| band.range[1]).collect();
    // Number of modes, sums of ln k, and of the energy that a mode stands for.
    let mut shells = [(0.0, 0.0, 0.0); SHELLS];
    for field in fields {
        field.modes(0.0, |band, k, [re, im]| {
            let shell = (k.norm() * length / 11.0).log10() * SHELLS as f64;
            if !(0.0..SHELLS as f64).contains(&shell) {
                return;
            }
            // A mode stands for the cube of the smallest wave vector of its lattice, whose 10.5-fold is the end of the band.
            let cell = (ends[band] / crate::modes::CUT).powi(3);
            let energy =
                2.0 * std::f64::consts::PI * k.norm_squared() * (re.norm_squared() + im.norm_squared())
                    / cell;
            let (n, sum, total) = &mut shells[shell as usize];
            *n += 1.0;
            *sum += k.norm().ln();
            *total += energy;
        })?;
    }
    let points: Vec<(f64, f64)> =
        shells.iter().map(|(n, sum, energy)| (sum / n, (energy / n).ln())).collect();
    rows.push(Row::relative(
        "slope of the spectrum, kL from 11 to 110, modes",
        fit(&points),
        -5.0 / 3.0,
        0.03,
    ));
    Ok(())
}

/// The slope of the straight line of least squares.
fn fit(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let mean = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let sums = points.iter().fold((0.0, 0.0), |(xx, xy), (x, y)| {
        let dx = x - mean.0;
        (xx + dx * dx, xy + dx * (y - mean.1))
    });
    sums.1 / sums.0
}

/// The correlation of modes in time, in shells of k, against exp(-k²s²/2) with the path s = IUτ.
fn decorrelation(fields: &[Field], rows: &mut Vec<Row>) -> Result<(), Error> {
    let length = von_karman_length(SCALE);
    let heading = Vector3::new(2.0, 1.0, -0.5).normalize();
    for (from, to) in [(1.5, 3.0), (10.0, 15.0), (60.0, 90.0)] {
        for size in [0.5, 1.0, 1.5] {
            // k s is about this in the middle of the shell.
            let time = size / (0.5 * (from + to) / length) / (INTENSITY * SPEED);
            let (mut product, mut square, mut theory) = (0.0, 0.0, 0.0);
            for field in fields {
                let mut before = Vec::new();
                field.modes(0.0, |_, _, amplitude| before.push(amplitude))?;
                let mut before = before.into_iter();
                field.modes(time, |_, k, [re, im]| {
                    let Some([re0, im0]) = before.next() else { return };
                    if !(from..to).contains(&(k.norm() * length)) {
                        return;
                    }
                    // In the frame that moves with the wind, phases are larger by k·Ut.
                    let (s, c) = (k.dot(&heading) * SPEED * time).sin_cos();
                    let (re, im) = (re * c - im * s, re * s + im * c);
                    product += re.dot(&re0) + im.dot(&im0);
                    let energy = re0.norm_squared() + im0.norm_squared();
                    square += energy;
                    theory += energy * (-0.5 * (k.norm() * INTENSITY * SPEED * time).powi(2)).exp();
                })?;
            }
            let name = format!("correlation in time, kL from {from} to {to}, kσt ≈ {size}, modes");
            rows.push(Row::absolute(name, product / square, theory / square, 0.03));
        }
    }
    Ok(())
}
