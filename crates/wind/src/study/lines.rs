//! Spectra and correlations along straight lines through the field, from sampled velocities, as an anemometer measures them.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::{INTENSITY, Row, SCALE, SPEED, end, heading, place};
use crate::random::Draw;
use crate::spectrum::{Energy, correlations, von_karman_length};
use crate::turns::cos_sin;
use crate::{Error, Field, Spectrum};

/// Places on a line, their distance as a share of von Kármán's length, and lines through each field.
const PLACES: usize = 512;
const STEP: f64 = 0.02;
const LINES: u64 = 48;

/// Wave numbers of the spectra, as multiples of 2π over the length of a line: kL from 5.5 to 15.
const WAVES: std::ops::RangeInclusive<usize> = 9..=24;

/// Distances of the correlations, in steps: 0.1, 0.25, 0.5, 1 and 2 L.
const LAGS: [usize; 5] = [5, 12, 25, 50, 100];

/// Sums over fields of the longitudinal component and of two transverse ones.
#[derive(Default)]
pub(super) struct Lines {
    fields: f64,
    spectrum: [f64; 3],
    products: [[f64; LAGS.len()]; 3],
}

impl Lines {
    pub(super) fn add(&mut self, field: &Field, seed: u64) -> Result<(), Error> {
        self.fields += 1.0;
        let length = von_karman_length(SCALE);
        let wind = field.at(3.0)?;
        let mean = heading() * SPEED;
        for line in 0..LINES {
            let draw = Draw::new(4).of(seed).of(line);
            let axes = axes(draw.of(1));
            let start = place(draw.of(2));
            let velocities: Vec<Vector3<f64>> = (0..PLACES)
                .map(|i| wind.velocity(start + axes[0] * (STEP * length * i as f64)) - mean)
                .collect();
            for (i, axis) in axes.iter().enumerate() {
                let values: Vec<f64> = velocities.iter().map(|u| u.dot(axis)).collect();
                self.spectrum[i] += spectrum(&values, length);
                for (sum, lag) in self.products[i].iter_mut().zip(LAGS) {
                    let pairs = values.iter().zip(&values[lag..]);
                    *sum += pairs.map(|(a, b)| a * b).sum::<f64>() / (PLACES - lag) as f64;
                }
            }
        }
        Ok(())
    }

    pub(super) fn rows(&self, field: &Field, rows: &mut Vec<Row>) {
        let length = von_karman_length(SCALE);
        let count = self.fields * LINES as f64;
        let [along, across, other] = self.spectrum.map(|sum| sum / count);
        let ratio = 0.5 * (across + other) / along;
        let name = "spectra across to along a line, kL from 5.5 to 15, sampled";
        rows.push(Row::relative(name, ratio, 4.0 / 3.0, 0.05));
        let name = "spectrum along a line, kL from 5.5 to 15, sampled, m³/s²";
        rows.push(Row::relative(name, along, theory(end(field), length), 0.05));
        let variance = (INTENSITY * SPEED).powi(2);
        for (i, lag) in LAGS.into_iter().enumerate() {
            let r = lag as f64 * STEP;
            let (f, g) = correlations(r);
            let [along, across, other] = self.products.map(|sums| sums[i] / count / variance);
            let across = 0.5 * (across + other);
            let name = format!("longitudinal correlation f at r = {r:.2} L, sampled");
            rows.push(Row::absolute(name, along, f, 0.03));
            let name = format!("transverse correlation g at r = {r:.2} L, sampled");
            rows.push(Row::absolute(name, across, g, 0.03));
        }
    }
}

/// A random direction, and two at right angles to it.
fn axes(draw: Draw) -> [Vector3<f64>; 3] {
    let ([a, b], [c, _]) = (draw.of(1).normal_pair(), draw.of(2).normal_pair());
    let first = Vector3::new(a, b, c).normalize();
    let second = first.cross(&Vector3::ith(first.iamin(), 1.0)).normalize();
    [first, second, first.cross(&second)]
}

/// The mean over the wave numbers of the spectrum of a line (one-sided, over the wave number in rad/m), with Hann's window.
fn spectrum(values: &[f64], length: f64) -> f64 {
    let n = values.len();
    let window = |i: usize| 0.5 - 0.5 * cos_sin((i as f64 + 0.5) / n as f64).0;
    let square: f64 = (0..n).map(|i| window(i).powi(2)).sum();
    let power = |wave: usize| {
        let (mut re, mut im) = (0.0, 0.0);
        for (i, value) in values.iter().enumerate() {
            let (c, s) = cos_sin((wave * i % n) as f64 / n as f64);
            re += window(i) * value * c;
            im += window(i) * value * s;
        }
        re * re + im * im
    };
    let sum: f64 = WAVES.map(power).sum();
    sum / WAVES.count() as f64 * 2.0 * STEP * length / (TAU * square)
}

/// The same of von Kármán's spectrum as far as it is resolved: ∫E/k (1 - k₁²/k²) dk from k₁ on.
fn theory(end: f64, length: f64) -> f64 {
    let energy = Energy::new(Spectrum::VonKarman, SCALE);
    let at = |wave: usize| {
        let first = wave as f64 * TAU / (PLACES as f64 * STEP * length);
        // The trapezoidal rule over ln k.
        let (n, width) = (2000, (end / first).ln());
        let f = |i: usize| {
            let k = first * (width * i as f64 / n as f64).exp();
            energy.at(k) * (1.0 - (first / k).powi(2))
        };
        ((1..n).map(f).sum::<f64>() + 0.5 * f(n)) * width / n as f64
    };
    let variance = (INTENSITY * SPEED).powi(2);
    WAVES.map(at).sum::<f64>() / WAVES.count() as f64 * variance
}
