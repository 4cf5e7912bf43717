//! The energy spectrum and the correlation in time, from the amplitudes of modes.

use super::{INTENSITY, Row, SCALE, SPEED, heading};
use crate::spectrum::von_karman_length;
use crate::{Error, Field};

/// Shells of k between 11/L and 110/L, for the spectrum.
const SHELLS: usize = 12;

/// Shells of k between these multiples of 1/L, for the correlation in time.
const TIMED: [(f64, f64); 3] = [(1.5, 3.0), (10.0, 15.0), (60.0, 90.0)];

/// Times of the correlation, as values of kσt in the middle of a shell.
const SIZES: [f64; 3] = [0.5, 1.0, 1.5];

/// Sums over fields.
pub(super) struct Shells {
    /// The cube of the smallest wave vector of each lattice.
    cells: Vec<f64>,
    /// Number of modes, sum of ln k, and of the energy that a mode stands for.
    spectrum: [(f64, f64, f64); SHELLS],
    /// Sums of products at two times, of squares, and of squares times the correlation of theory.
    correlation: [[(f64, f64, f64); SIZES.len()]; TIMED.len()],
}

impl Shells {
    pub(super) fn new(field: &Field) -> Shells {
        // The end of a band is 10.5 times its smallest wave vector.
        let cells = field.bands().iter().map(|band| (band.range[1] / crate::modes::CUT).powi(3)).collect();
        Shells { cells, spectrum: [(0.0, 0.0, 0.0); SHELLS], correlation: Default::default() }
    }

    pub(super) fn add(&mut self, field: &Field) -> Result<(), Error> {
        let length = von_karman_length(SCALE);
        let mut before = Vec::new();
        field.modes(0.0, |band, k, [re, im]| {
            before.push([re, im]);
            let shell = (k.norm() * length / 11.0).log10() * SHELLS as f64;
            if (0.0..SHELLS as f64).contains(&shell) {
                let square = re.norm_squared() + im.norm_squared();
                let energy = 2.0 * std::f64::consts::PI * k.norm_squared() * square / self.cells[band];
                let (n, sum, total) = &mut self.spectrum[shell as usize];
                *n += 1.0;
                *sum += k.norm().ln();
                *total += energy;
            }
        })?;
        for ((from, to), sums) in TIMED.into_iter().zip(&mut self.correlation) {
            for (size, (product, square, theory)) in SIZES.into_iter().zip(sums) {
                let time = size / (0.5 * (from + to) / length) / (INTENSITY * SPEED);
                let mut before = before.iter();
                field.modes(time, |_, k, [re, im]| {
                    let Some([re0, im0]) = before.next() else { return };
                    if !(from..to).contains(&(k.norm() * length)) {
                        return;
                    }
                    // In the frame that moves with the wind, phases are larger by k·Ut.
                    let (s, c) = (k.dot(&heading()) * SPEED * time).sin_cos();
                    let (re, im) = (re * c - im * s, re * s + im * c);
                    *product += re.dot(re0) + im.dot(im0);
                    let energy = re0.norm_squared() + im0.norm_squared();
                    *square += energy;
                    *theory += energy * (-0.5 * (k.norm() * INTENSITY * SPEED * time).powi(2)).exp();
                })?;
            }
        }
        Ok(())
    }

    pub(super) fn rows(&self, rows: &mut Vec<Row>) {
        let points: Vec<(f64, f64)> =
            self.spectrum.iter().map(|(n, sum, energy)| (sum / n, (energy / n).ln())).collect();
        let name = "slope of the spectrum, kL from 11 to 110, modes";
        rows.push(Row::relative(name, fit(&points), -5.0 / 3.0, 0.03));
        for ((from, to), sums) in TIMED.into_iter().zip(&self.correlation) {
            for (size, (product, square, theory)) in SIZES.into_iter().zip(sums) {
                // exp(-k²s²/2) with the path s = IUt.
                let name = format!("correlation in time, kL from {from} to {to}, kσt ≈ {size}, modes");
                rows.push(Row::absolute(name, product / square, theory / square, 0.03));
            }
        }
    }
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
