//! Turbulence between instants: for those who ask for it at times that are closer together than it changes.
//!
//! ```text
//! instants    k-1      k       k+1     k+2      the lattices of each, carried to where the mean wind has taken them at t
//!              ●       ●────▲──●        ●
//!                           t                   the cubic through the four
//! ```
//!
//! Eddies that travel with the wind change slowly in its own frame: a mode turns there by `q k` per metre of decorrelation, with `q` normally
//! distributed, where at a fixed place it would turn by `k` per metre of the wind. So the error of a cubic follows from the spectrum and from
//! how far the eddies decorrelate from one instant to the next, and from nothing else.

use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix3, Vector3};

use crate::fourier::LONGEST;
use crate::lattice::{Jet, Lattice};
use crate::modes::{Band, FREQUENCIES};
use crate::random::normal_quantile;

/// The error of an interpolated velocity relative to the turbulence, as root mean square in the middle between two instants.
const ERROR: f64 = 0.01;

/// Ratio of neighbouring lengths that are tried.
const TRIED: f64 = 1.1;

/// The potential of the turbulence at an instant, a lattice a band.
#[derive(Clone, Debug)]
pub(crate) enum Turbulence {
    /// Of that instant.
    At(Arc<[Lattice]>),
    /// A mean of the four around it.
    Between([Part; 4]),
}

/// The lattices of another instant.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) lattices: Arc<[Lattice]>,
    /// How far the mean wind has carried them since, in m.
    pub(crate) carried: Vector3<f64>,
    pub(crate) weight: f64,
}

impl Turbulence {
    /// One lattice of each band.
    pub(crate) fn lattices(&self) -> &[Lattice] {
        match self {
            Turbulence::At(lattices) => lattices,
            Turbulence::Between([part, ..]) => &part.lattices,
        }
    }

    /// The same with the first bands only.
    pub(crate) fn first(&self, count: usize) -> Turbulence {
        let first = |lattices: &[Lattice]| lattices.iter().take(count).cloned().collect();
        match self {
            Turbulence::At(lattices) => Turbulence::At(first(lattices)),
            Turbulence::Between(parts) => Turbulence::Between(
                parts.each_ref().map(|part| Part { lattices: first(&part.lattices), ..part.clone() }),
            ),
        }
    }

    /// The velocity of a band.
    #[inline]
    pub(crate) fn velocity(&self, band: usize, x: Vector3<f64>) -> Vector3<f64> {
        match self {
            Turbulence::At(lattices) => lattices[band].velocity(x),
            Turbulence::Between(parts) => {
                let of = |part: &Part| part.lattices[band].velocity(x - part.carried) * part.weight;
                parts.iter().map(of).sum()
            }
        }
    }

    /// The potential of a band and its first derivatives.
    pub(crate) fn potential(&self, band: usize, x: Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        match self {
            Turbulence::At(lattices) => lattices[band].potential(x),
            Turbulence::Between(parts) => {
                let (mut value, mut first) = (Vector3::zeros(), Matrix3::zeros());
                for part in parts {
                    let (a, derivatives) = part.lattices[band].potential(x - part.carried);
                    value += a * part.weight;
                    first += derivatives * part.weight;
                }
                (value, first)
            }
        }
    }

    /// The same with second derivatives.
    pub(crate) fn jet(&self, band: usize, x: Vector3<f64>) -> Jet {
        match self {
            Turbulence::At(lattices) => lattices[band].jet(x),
            Turbulence::Between(parts) => {
                let zero = Matrix3::zeros();
                let mut sum = Jet { value: Vector3::zeros(), first: zero, second: [zero; 3] };
                for part in parts {
                    let jet = part.lattices[band].jet(x - part.carried);
                    sum.value += jet.value * part.weight;
                    sum.first += jet.first * part.weight;
                    for (sum, of) in sum.second.iter_mut().zip(jet.second) {
                        *sum += of * part.weight;
                    }
                }
                sum
            }
        }
    }
}

/// The weights of four instants one interval apart in the cubic through them, at a number of intervals after the first one.
pub(crate) fn weights(place: f64) -> [f64; 4] {
    let [a, b, c, d] = [0.0, 1.0, 2.0, 3.0].map(|node| place - node);
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// How far apart instants of a turbulence may be, computed when it is asked for.
#[derive(Debug, Default)]
pub(crate) struct Resolution(OnceLock<f64>);

impl Resolution {
    /// Metres of decorrelation from one instant to the next.
    pub(crate) fn of(&self, bands: &[Band]) -> f64 {
        *self.0.get_or_init(|| longest(bands))
    }
}

/// The longest path of decorrelation from one instant to the next with an error of at most [`ERROR`] between them.
fn longest(bands: &[Band]) -> f64 {
    let powers: Vec<_> = bands.iter().flat_map(by_length).collect();
    let total: f64 = powers.iter().map(|(_, power)| power).sum();
    let quantiles: [f64; FREQUENCIES] =
        std::array::from_fn(|j| normal_quantile((j as f64 + 0.5) / FREQUENCIES as f64));
    let square = |length: f64| -> f64 {
        let of = |(k, power): &(f64, f64)| {
            let error = |q: &f64| lost(q * k * length).powi(2) / FREQUENCIES as f64;
            power * quantiles.iter().map(error).sum::<f64>()
        };
        powers.iter().map(of).sum()
    };
    let Some((shortest, _)) = powers.last() else { return f64::INFINITY };
    // Shorter than any eddy turns over.
    let mut length = 1e-2 / shortest;
    while length < 1e9 && square(length * TRIED) <= ERROR * ERROR * total {
        length *= TRIED;
    }
    length
}

/// The lengths of the wave vectors of a band, with the power of all modes of that length.
fn by_length(band: &Band) -> Vec<(f64, f64)> {
    let mut powers = vec![(0.0, 0.0); LONGEST as usize + 1];
    for mode in &band.modes {
        let (k, power) = &mut powers[mode.m.iter().map(|m| m * m).sum::<i32>() as usize];
        *k = mode.k;
        *power += mode.power;
    }
    powers.retain(|(_, power)| *power > 0.0);
    powers
}

/// The part of a wave that the cubic through four instants loses in their middle, if the wave turns by an angle from one to the next.
fn lost(angle: f64) -> f64 {
    1.0 - (9.0 * libm::cos(0.5 * angle) - libm::cos(1.5 * angle)) / 8.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Description, Field, Ground, Signal, Snapshot, Spectrum};

    fn windy(scale: f64, period: Option<f64>) -> Field {
        let speed = Signal::function(|t| 3.0 + (t * std::f64::consts::TAU).sin());
        let ground = Some(Ground::Flat(0.2));
        let description = Description { turbulence: 0.3, scale, seed: 5, period, ground, ..calm(speed) };
        Field::new(description).expect("a wind")
    }

    fn calm(speed: Signal) -> Description {
        Description::new(Vector3::new(2.0, 0.0, 1.0), speed)
    }

    /// The wind at a place of the way from the second to the third of four instants.
    fn between(field: &Field, from: f64, step: f64, share: f64) -> Snapshot {
        let around = [0.0, 1.0, 2.0, 3.0].map(|i| field.at(from + i * step).expect("an instant"));
        let time = from + (1.0 + share) * step;
        let between = field.between(time, around.each_ref(), 1.0 + share);
        between.expect("a time").expect("turbulence at all instants")
    }

    #[test]
    fn weights_are_those_of_the_cubic_through_four_points() {
        for place in [0.0, 0.3, 1.0, 1.5, 2.75] {
            let w = weights(place);
            for power in 0..4 {
                let sum: f64 = (0..4).map(|i| w[i as usize] * f64::from(i).powi(power)).sum();
                assert!((sum - place.powi(power)).abs() < 1e-12, "{place} to the power {power}: {sum}");
            }
        }
    }

    /// The error is that of the spectrum, whatever the scale: at places all over, in a speed that varies, near the ground too, over the end of a period.
    #[test]
    fn the_error_between_instants_is_the_one_that_is_asked_for() {
        for (scale, period) in [(0.3, None), (4.0, None), (1.0, Some(1.0))] {
            let field = windy(scale, period);
            let step = field.resolved(0.0, 1.0).expect("a speed").expect("turbulence");
            let (mut error, mut square, mut plain) = (0.0, 0.0, 0.0);
            for i in 0..40 {
                let part = |factor: f64| (f64::from(i) * factor).fract();
                let x = Vector3::new(8.0 * part(0.755), 3.0 * part(0.57), 8.0 * part(0.43)) * scale;
                let from = 0.9 * part(0.618);
                let exact = field.at(from + 1.5 * step).expect("an instant");
                let mean = Vector3::new(2.0, 0.0, 1.0).normalize()
                    * if x.y < 0.2 { 0.0 } else { 3.0 + ((from + 1.5 * step) * std::f64::consts::TAU).sin() };
                error += (between(&field, from, step, 0.5).velocity(x) - exact.velocity(x)).norm_squared();
                plain += (field.at(from + step).expect("an instant").velocity(x) - exact.velocity(x))
                    .norm_squared();
                square += (exact.velocity(x) - mean).norm_squared();
            }
            let [relative, held] = [error, plain].map(|sum: f64| (sum / square).sqrt());
            assert!(relative < 3.0 * ERROR && held > 5.0 * relative, "{scale}: {relative}, {held}");
        }
    }

    #[test]
    fn instants_themselves_are_met_and_gradients_are_those_of_the_velocity() {
        let field = windy(1.0, None);
        let wind = between(&field, 0.4, 0.01, 0.3);
        for x in [Vector3::new(0.3, 0.4, -2.0), Vector3::new(5.0, 3.0, 1.0)] {
            for (share, time) in [(0.0, 0.41), (1.0, 0.42)] {
                let met = between(&field, 0.4, 0.01, share).velocity(x);
                let exact = field.at(time).expect("an instant").velocity(x);
                assert!((met - exact).norm() < 1e-12, "{met} {exact}");
            }
            let (velocity, gradient) = wind.velocity_and_gradient(x);
            assert_eq!(velocity, wind.velocity(x));
            assert!(gradient.trace().abs() < 1e-12, "no divergence");
            for j in 0..3 {
                let offset = Vector3::ith(j, 1e-6);
                let slope = (wind.velocity(x + offset) - wind.velocity(x - offset)) / 2e-6;
                assert!((slope - gradient.column(j)).norm() < 1e-6, "{slope} {}", gradient.column(j));
            }
        }
    }

    #[test]
    fn eddies_of_a_size_ask_for_instants_as_far_apart_as_they_are_large() {
        let length = |scale: f64| Resolution::default().of(windy(scale, None).bands());
        let ratio = length(8.0) / length(1.0);
        assert!((7.0..9.0).contains(&ratio), "{ratio}");
        assert!(Field::new(calm(3.0.into())).expect("a wind").resolved(0.0, 1.0).expect("a speed").is_none());
        let spectrum = Spectrum::Kolmogorov { dissipation: 1.0, inertial: 4.0, sigma: 1.0 };
        let paper =
            Field::new(Description { turbulence: 1.0, spectrum, ..calm(1.0.into()) }).expect("a wind");
        let step = paper.resolved(0.0, 1.0).expect("a speed").expect("turbulence");
        assert!((0.001..0.1).contains(&step), "{step}");
    }

    /// A speed that jumps: nothing is made up from a calm.
    #[test]
    fn a_calm_is_not_interpolated() {
        let field = Field::new(Description {
            turbulence: 0.3,
            ..calm(Signal::function(|t| if t < 0.5 { 0.0 } else { 3.0 }))
        })
        .expect("a wind");
        let around = [0.48, 0.49, 0.5, 0.51].map(|time| field.at(time).expect("an instant"));
        assert!(field.between(0.505, around.each_ref(), 2.5).expect("a time").is_none());
    }
}
