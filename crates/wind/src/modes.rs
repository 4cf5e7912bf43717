//! The turbulence as a sum of modes: random amplitudes over wave vectors and frequencies, and their sum over frequencies at an
//! instant.
//!
//! The wave vectors of one band are the points m of a cubic lattice, k = 2π R m/P with the rotation R and the period P of the
//! band. A mode has a number of frequencies of its own, drawn from the paper's Gaussian of deviation kσ, instead of those of a
//! lattice in time: the correlation of a mode is exp(-k²σ²τ²/2) for the largest and the smallest eddies alike, and the field never
//! repeats in time unless it has a period.

use std::f64::consts::{PI, TAU};

use nalgebra::{Rotation3, Unit, UnitQuaternion, Vector3};

use crate::fourier::{LONGEST, MODES, N, index};
use crate::groups::{GROUP, Group, Member};
use crate::random::{Draw, normal_quantile};
use crate::spectrum::Energy;
use crate::turns::cos_sin;

/// The number of lattices, each with a band of k.
pub(crate) const BANDS: usize = 3;

/// The number of frequencies of a mode.
pub(crate) const FREQUENCIES: usize = 16;

/// The ratio of the periods of two neighbouring lattices: irrational, 3 + √5.
pub(crate) const RATIO: f64 = 5.236_067_977_499_79;

/// Wave vectors of a lattice are at most this long, in units of its smallest: a little more than the root of [`LONGEST`].
pub(crate) const CUT: f64 = 10.5;

/// Axes of the lattices, as quaternions (w, i, j, k) of any length. A slice through a turned lattice nearly repeats itself where a
/// period of the lattice ends near the plane of the slice; these turns were searched so that none of up to 3.4 P comes nearer than
/// 0.05 P, an integral scale in the first lattice, to a plane at right angles to an axis of the world.
const TURNS: [[f64; 4]; BANDS] =
    [[1.0, -0.543, -0.111, 0.441], [1.0, 0.517, -0.554, -0.355], [1.0, -0.701, 1.717, 1.449]];

/// Where the eddies are at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Instant {
    /// The share of the period that has passed, from 0 to 1; 0 for a wind without a period.
    pub(crate) share: f64,
    /// The path of the wind in metres, without its mean over the period: all of it for a wind without one.
    pub(crate) drift: f64,
    /// The path that eddies have decorrelated over, in metres, likewise.
    pub(crate) swept: f64,
}

/// What a wind with a period covers in one: metres of drift, and metres of decorrelation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lap {
    pub(crate) drift: f64,
    pub(crate) swept: f64,
}

/// A pair of modes, m and -m.
#[derive(Clone, Debug)]
pub(crate) struct Mode {
    /// m, with the last component that is not 0 positive.
    pub(crate) m: [i32; 3],
    /// |k| in rad/m.
    pub(crate) k: f64,
    /// Two directions at right angles to k and to each other, in the axes of the lattice.
    polarisation: [Vector3<f64>; 2],
    /// The expected square of the velocity's amplitude in each of the two polarisations.
    pub(crate) power: f64,
}

/// A band of k: its lattice and its modes.
#[derive(Debug)]
pub(crate) struct Band {
    /// The period P of the lattice in metres.
    pub(crate) period: f64,
    /// From the axes of the world to those of the lattice.
    pub(crate) rotation: Rotation3<f64>,
    /// The wave numbers between which its modes lie; 0 for the lower end of the first.
    pub(crate) range: [f64; 2],
    pub(crate) modes: Vec<Mode>,
    /// The size of the eddies in metres, without smoothing: the root of the mean of 1/k², weighted by the energy.
    pub(crate) eddy_size: f64,
    /// The modes again, with their frequencies and amplitudes.
    pub(crate) groups: Vec<Group>,
}

/// The bands of a spectrum. `direction` is that of the wind, by which eddies travel; zero if they stay. They are averaged over a Gaussian whose standard
/// deviation in metres is given.
pub(crate) fn bands(energy: Energy, (direction, smoothing): (Vector3<f64>, f64), seed: u64) -> [Band; BANDS] {
    let quantiles = Quantiles::new();
    let around = (direction, smoothing);
    std::array::from_fn(|i| Band::new(i, energy, around, Draw::new(seed).of(i as u64), &quantiles))
}

impl Band {
    fn new(
        i: usize,
        energy: Energy,
        (direction, smoothing): (Vector3<f64>, f64),
        draw: Draw,
        quantiles: &Quantiles,
    ) -> Band {
        let scaled = |times: usize| (0..times).fold(energy.smallest(), |unit, _| unit * RATIO);
        let unit = scaled(i);
        let end = CUT * unit;
        let [w, a, b, c] = TURNS[i];
        let rotation =
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, a, b, c)).to_rotation_matrix();
        let lowest = if i == 0 { 0.0 } else { CUT * scaled(i - 1) };
        let heading = rotation * direction;
        let mut modes = Vec::new();
        for m in half_space() {
            let k = unit * Vector3::from(m.map(f64::from)).norm();
            // Half-open, so that neighbouring bands leave nothing out and have nothing twice.
            if k > lowest && k <= end && energy.at(k) > 0.0 {
                modes.push(Mode {
                    m,
                    k,
                    polarisation: polarisation(m),
                    power: energy.at(k) / (4.0 * PI * k * k),
                });
            }
        }
        // The sum over points of the lattice becomes the integral over the band: each component has a third of 2∫E dk. A mode and
        // its conjugate have two polarisations each.
        let total: f64 = modes.iter().map(|mode| 4.0 * mode.power).sum();
        let scale = if total > 0.0 { 2.0 * energy.integral(lowest, end) / total } else { 0.0 };
        for mode in &mut modes {
            mode.power *= scale;
        }
        let eddy_size = eddy_size(&modes);
        // The mean of a wave over the Gaussian is exp(-k²s²/2) of it.
        for mode in &mut modes {
            mode.power *= libm::exp(-(mode.k * smoothing).powi(2));
        }
        let period = TAU / unit;
        let members: Vec<Member> =
            modes.iter().map(|mode| mode.member(unit, heading, period / N as f64, draw, quantiles)).collect();
        Band { period, rotation, range: [lowest, end], modes, eddy_size, groups: Group::of(&members) }
    }

    /// The expected variance of each component of the velocity.
    pub(crate) fn variance(&self) -> f64 {
        self.modes.iter().map(|mode| 4.0 * mode.power).sum::<f64>() / 3.0
    }

    /// The complex amplitude of the velocity of each mode at an instant, in the axes of the lattice: real and imaginary part of the
    /// factor of exp(i k·x). Potential and velocity have the same amplitudes up to 1/k, since i k × turns one polarisation into the
    /// other and both are alike; so the amplitude of the potential is this divided by k, and that of the velocity is its curl.
    pub(crate) fn amplitudes(
        &self,
        at: Instant,
        lap: Option<Lap>,
        mut each: impl FnMut(&Mode, Vector3<f64>, Vector3<f64>),
    ) {
        for (i, mode) in self.modes.iter().enumerate() {
            let sum = self.groups[i / GROUP].exact(i % GROUP, at, lap);
            let [p, q] = mode.polarisation;
            each(mode, p * sum[0] + q * sum[2], p * sum[1] + q * sum[3]);
        }
    }
}

/// The root of the mean of 1/k², weighted by the energy.
fn eddy_size(modes: &[Mode]) -> f64 {
    let sum = |f: fn(&Mode) -> f64| modes.iter().map(f).sum::<f64>();
    let total = sum(|mode| mode.power);
    if total > 0.0 { (sum(|mode| mode.power / (mode.k * mode.k)) / total).sqrt() } else { 0.0 }
}

impl Mode {
    /// Draws frequencies and amplitudes of the mode of a lattice with this spacing and this smallest wave vector.
    fn member(
        &self,
        unit: f64,
        heading: Vector3<f64>,
        spacing: f64,
        draw: Draw,
        quantiles: &Quantiles,
    ) -> Member {
        let size = (self.power / (2.0 * FREQUENCIES as f64)).sqrt();
        // Numbers belong to the one of m and -m whose first component that is not 0 is positive.
        let sign = if self.m > [0, 0, 0] { 1 } else { -1 };
        let draw = self.m.iter().fold(draw, |draw, m| draw.of(i64::from(sign * m) as u64));
        let (mut turns, mut amplitude) = ([0.0; FREQUENCIES], [[0.0; 4]; FREQUENCIES]);
        for j in 0..FREQUENCIES {
            let draw = draw.of(j as u64);
            let ([a, b], [c, d]) = (draw.of(1).normal_pair(), draw.of(2).normal_pair());
            let sign = f64::from(sign);
            turns[j] = sign * quantiles.draw(j, draw.of(3).unit()) * self.k / TAU;
            amplitude[j] = [a, sign * b, c, sign * d].map(|x| x * size);
        }
        // The transform of the coefficients of the spline is that of the values divided by (2 + cos 2πm/32)/3 for each axis.
        let filter = |size: f64, m: &i32| size * 3.0 / (2.0 + cos_sin(f64::from(*m) / N as f64).0);
        let factor = self.m.iter().fold(1.0 / (self.k * spacing), filter);
        let [a, b, c] = self.m;
        let conjugate = if c == 0 { [-a, -b, 0] } else { self.m };
        Member {
            drift: -unit / TAU * Vector3::from(self.m.map(f64::from)).dot(&heading),
            turns,
            amplitude,
            potential: self.polarisation.map(|direction| direction * factor),
            indices: [self.m, conjugate].map(|m| index(m) as u32),
        }
    }
}

/// One of each pair m, -m, but not zero, up to the cut.
fn half_space() -> impl Iterator<Item = [i32; 3]> {
    let axis = || -MODES..=MODES;
    axis()
        .flat_map(move |a| axis().flat_map(move |b| axis().map(move |c| [a, b, c])))
        .filter(|[a, b, c]| [c, b, a] > [&0, &0, &0])
        .filter(|m| m.iter().map(|m| m * m).sum::<i32>() <= LONGEST)
}

/// Two unit vectors at right angles to a wave vector and to each other, the same for m and -m.
fn polarisation(m: [i32; 3]) -> [Vector3<f64>; 2] {
    let sign = if m > [0, 0, 0] { 1.0 } else { -1.0 };
    let wave = Vector3::from(m.map(f64::from)) * sign;
    let axis = Vector3::ith(wave.iamin(), 1.0);
    let first = Unit::new_normalize(wave.cross(&axis)).into_inner();
    [first, wave.normalize().cross(&first)]
}

/// Normally distributed numbers, one from each of as many intervals of equal probability as a mode has frequencies.
struct Quantiles(Vec<f64>);

/// Points of the table for each interval.
const STEPS: usize = 256;

impl Quantiles {
    fn new() -> Quantiles {
        let points = STEPS * FREQUENCIES;
        Quantiles((0..points).map(|i| normal_quantile((i as f64 + 0.5) / points as f64)).collect())
    }

    /// A number of the interval `j`, by a number from 0 to 1.
    fn draw(&self, j: usize, unit: f64) -> f64 {
        self.0[j * STEPS + ((unit * STEPS as f64) as usize).min(STEPS - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Spectrum;

    #[test]
    fn sums_of_modes_are_the_integrals_of_their_bands() {
        let energy = Energy::new(Spectrum::VonKarman, 3.0);
        let bands = bands(energy, (Vector3::x(), 0.0), 1);
        let mut end = 0.0;
        for band in &bands {
            assert_eq!(band.range[0], end, "bands meet");
            end = band.range[1];
            let exact = 2.0 / 3.0 * energy.integral(band.range[0], band.range[1]);
            assert!((band.variance() / exact - 1.0).abs() < 1e-12);
            // Without the correction, the sum over the points of the lattice is the integral within a few per cent already.
            let unit = TAU / band.period;
            let raw: f64 =
                band.modes.iter().map(|mode| energy.at(mode.k) / (PI * mode.k.powi(2)) / 3.0).sum::<f64>()
                    * unit.powi(3);
            assert!((raw / exact - 1.0).abs() < 0.05, "{raw} for {exact}");
        }
    }

    #[test]
    fn no_period_of_a_lattice_lies_in_a_plane_of_the_world() {
        let bands = bands(Energy::new(Spectrum::VonKarman, 3.0), (Vector3::x(), 0.0), 1);
        for band in &bands {
            for n in half_space().filter(|n| n.iter().map(|n| n * n).sum::<i32>() <= 12) {
                let period = band.rotation.inverse() * Vector3::from(n.map(f64::from));
                assert!(period.abs().min() > 0.05, "{n:?}: {period}");
            }
        }
    }
}
