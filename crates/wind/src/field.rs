//! The wind as a function of time: a [`Snapshot`] for every instant.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::between::{self, Part, Resolution, Turbulence};
use crate::description::Signal;
use crate::fourier::Transform;
use crate::journey::Journey;
use crate::lattice::Lattice;
use crate::modes::{BANDS, Band, Instant, Lap, bands};
use crate::obstacle::{Ground, Obstacle};
use crate::primitives::Flow;
use crate::snapshot::{Carried, Mean, Snapshot};
use crate::spectrum::Energy;
use crate::turns::cos_sin;
use crate::{Description, Error, Spectrum};

/// A wind: the velocity of the air as a pure function of place and time.
///
/// Two fields of equal descriptions are equal in all bits, whatever was evaluated before and on whichever thread.
#[derive(Debug)]
pub struct Field {
    direction: Vector3<f64>,
    speed: Signal,
    turbulence: Eddying,
    period: Option<f64>,
    roughness: Option<f64>,
    flows: Vec<Flow>,
    journey: Journey,
    lap: Option<Lap>,
    setting: Arc<Setting>,
    resolution: Resolution,
}

/// What stands in the wind, and how far up it is felt.
#[derive(Debug)]
pub(crate) struct Setting {
    pub(crate) ground: Option<Ground>,
    pub(crate) obstacles: Vec<Arc<dyn Obstacle>>,
    /// The thickness in metres of the layer over the ground in which a band of turbulence turns aside.
    pub(crate) layers: [f64; BANDS],
    /// The same for flows that come from above.
    pub(crate) layer: f64,
}

#[derive(Debug)]
struct Eddying {
    /// Empty if there is none.
    bands: Vec<Band>,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// The intensity I.
    WithWind(f64),
    /// The deviation σ in m/s.
    Still(f64),
}

/// The steps into which a period is divided, so that rounding of t/T does not break the repetition. Their number has many divisors:
/// times of frames at common rates are steps of common periods, far from where rounding could go either way.
const TICKS: f64 = ((1u64 << 24) * 9 * 125 * 7) as f64;

/// The thickness of a layer over the ground relative to the size of its eddies, the root of the mean of 1/k²: with it, the
/// variance of horizontal components at the ground is 1.5 times that far above, as at a wall in the theory of rapid distortion
/// (Hunt and Graham 1978). It is (15/8 · a/d)² + 2/5 for eddies of size a in a layer d.
const LAYER: f64 = 1.787_7;

impl Field {
    /// Checks a description and draws the amplitudes of the turbulence. This takes some ten milliseconds and 10 MB with
    /// turbulence, nothing without.
    ///
    /// # Errors
    ///
    /// Values out of range, and speeds and flows without the [period](Description::period), see [`Error`].
    pub fn new(description: Description) -> Result<Field, Error> {
        description.check()?;
        let d = description;
        let direction = d.heading()?;
        let (kind, travels) = match d.spectrum {
            Spectrum::VonKarman => (Kind::WithWind(d.turbulence), direction),
            Spectrum::Kolmogorov { sigma, .. } => (Kind::Still(sigma), Vector3::zeros()),
        };
        let energy = Energy::new(d.spectrum, d.scale);
        let bands = match d.turbulence > 0.0 {
            true => bands(energy, (travels, d.smoothing), d.seed).into(),
            false => Vec::<Band>::new(),
        };
        let mut layers = [0.0; BANDS];
        for (layer, band) in layers.iter_mut().zip(&bands) {
            *layer = LAYER * band.eddy_size;
        }
        let obstacles = d.obstacles.into_iter().map(Arc::from).collect();
        let setting = Setting { ground: d.ground, obstacles, layers, layer: d.scale };
        let mut field = Field {
            direction,
            speed: d.speed,
            turbulence: Eddying { bands, kind },
            period: d.period,
            roughness: d.roughness,
            flows: d.flows,
            journey: Journey::default(),
            lap: None,
            setting: Arc::new(setting),
            resolution: Resolution::default(),
        };
        if let Some(period) = field.period {
            let [drift, swept] = field.paths(period)?;
            field.lap = Some(Lap { drift, swept });
        }
        Ok(field)
    }

    /// The paths of drift and of decorrelation from time 0, in metres.
    fn paths(&self, time: f64) -> Result<[f64; 2], Error> {
        match self.turbulence.kind {
            Kind::WithWind(intensity) => {
                let [path, length] = self.journey.to(&self.speed, time)?;
                Ok([path, intensity * length])
            }
            Kind::Still(sigma) => Ok([0.0, sigma * time]),
        }
    }

    /// The time within the period, and where the eddies are.
    fn instant(&self, time: f64) -> Result<(f64, Instant), Error> {
        if !time.is_finite() {
            return Err(Error::Time { time, limit: f64::MAX });
        }
        let (Some(period), Some(lap)) = (self.period, self.lap) else {
            let [drift, swept] = if self.turbulence.bands.is_empty() { [0.0; 2] } else { self.paths(time)? };
            return Ok((time, Instant { share: 0.0, drift, swept }));
        };
        let turns = time / period;
        let ticks = ((turns - turns.floor()) * TICKS).round();
        let share = if ticks == TICKS { 0.0 } else { ticks / TICKS };
        let within = share * period;
        let [drift, swept] = self.paths(within)?;
        Ok((within, Instant { share, drift: drift - share * lap.drift, swept: swept - share * lap.swept }))
    }

    /// How far the mean wind has come at a time, of which the instant within the period is known.
    fn drift(&self, time: f64, within: f64, at: Instant) -> f64 {
        match (self.period, self.lap) {
            (Some(period), Some(lap)) => {
                at.drift + at.share * lap.drift + ((time - within) / period).round() * lap.drift
            }
            _ => at.drift,
        }
    }

    /// The wind at a time in seconds, to be evaluated at any number of places. It takes 1.5 ms and 3 MB with
    /// turbulence, and nothing without; it holds all that it needs and can be sent to other threads.
    ///
    /// # Errors
    ///
    /// A time that is not finite; a speed, a flow or an obstacle that is not finite at that time; a speed that varies, more than
    /// 10⁷ s from 0.
    pub fn at(&self, time: f64) -> Result<Snapshot, Error> {
        let (within, instant) = self.instant(time)?;
        let drift = self.drift(time, within, instant);
        let speed = self.speed.finite_at(within, || "the speed of the wind".to_owned())?;
        let amplitude = self.amplitude(speed);
        let mut lattices = Vec::new();
        if amplitude > 0.0 && !self.turbulence.bands.is_empty() {
            let mut work = Transform::new();
            lattices.extend(
                self.turbulence
                    .bands
                    .iter()
                    .map(|band| Lattice::new(band, instant, self.lap, amplitude, &mut work)),
            );
        }
        self.snapshot((within, speed), (Turbulence::At(lattices.into()), Carried { drift, amplitude }))
    }

    /// The wind at a time within the period and at the speed of that time, with this turbulence.
    fn snapshot(
        &self,
        (time, speed): (f64, f64),
        turbulence: (Turbulence, Carried),
    ) -> Result<Snapshot, Error> {
        let flows = self.flows.iter().enumerate().map(|(i, flow)| flow.at(time, i));
        let flows = flows.collect::<Result<Vec<_>, _>>()?;
        let mean = Mean::new(self.direction * speed, self.roughness);
        Snapshot::new(time, turbulence, mean, flows, Arc::clone(&self.setting))
    }

    /// The wind at a time among four instants that are one interval apart, `place` intervals after the first of them. Its turbulence is that of the cubic
    /// through theirs, in the frame of the mean wind, so that it takes microseconds and not milliseconds; a place costs four times as much. All else
    /// is that of the time itself. `None` if one of the four is itself between instants, or all but without turbulence.
    ///
    /// Its error is some 1 % of the turbulence if the interval is at most as long as [`resolved`](Field::resolved) says.
    ///
    /// # Errors
    ///
    /// As for [`at`](Field::at).
    pub fn between(&self, time: f64, around: [&Snapshot; 4], place: f64) -> Result<Option<Snapshot>, Error> {
        /// A factor of the velocities of an instant that is larger than this would be made of almost nothing.
        const LARGEST: f64 = 100.0;
        let (within, instant) = self.instant(time)?;
        let drift = self.drift(time, within, instant);
        let speed = self.speed.finite_at(within, || "the speed of the wind".to_owned())?;
        let amplitude = self.amplitude(speed);
        let heading = match self.turbulence.kind {
            Kind::WithWind(_) => self.direction,
            Kind::Still(_) => Vector3::zeros(),
        };
        let mut parts = Vec::with_capacity(4);
        for (snapshot, weight) in around.into_iter().zip(between::weights(place)) {
            let (Some(lattices), of) = (snapshot.exact(), snapshot.carried) else { return Ok(None) };
            // Also if both are 0.
            let is_known = amplitude <= LARGEST * of.amplitude && of.amplitude > 0.0;
            if lattices.is_empty() || !is_known {
                return Ok(None);
            }
            let (lattices, carried) = (Arc::clone(lattices), heading * (drift - of.drift));
            parts.push(Part { lattices, carried, weight: weight * (amplitude / of.amplitude) });
        }
        let Ok(parts) = <[Part; 4]>::try_from(parts) else { return Ok(None) };
        self.snapshot((within, speed), (Turbulence::Between(parts), Carried { drift, amplitude })).map(Some)
    }

    /// How far apart instants of the turbulence may be, in s, from one time to another, so that it is known [`between`](Field::between) them; none
    /// without turbulence.
    ///
    /// # Errors
    ///
    /// As for [`at`](Field::at).
    pub fn resolved(&self, from: f64, to: f64) -> Result<Option<f64>, Error> {
        /// Parts of the stretch, of which the fastest counts.
        const PARTS: u32 = 4;
        if self.turbulence.bands.is_empty() {
            return Ok(None);
        }
        let part = (to - from) / f64::from(PARTS);
        let (from, _) = self.instant(from)?;
        let mut fastest = 0.0f64;
        let [_, mut before] = self.paths(from)?;
        for i in 1..=PARTS {
            let [_, after] = self.paths(from + f64::from(i) * part)?;
            fastest = fastest.max((after - before).abs() / part);
            before = after;
        }
        Ok(Some(self.resolution.of(&self.turbulence.bands) / fastest))
    }

    /// The turbulence alone at a time in seconds, relative to its amplitude: that of the wind is it times the intensity and |U|; Kolmogorov's has its own
    /// amplitude. Below the ground it goes on smoothly, where there is no air. It costs what [`at`](Field::at) does.
    ///
    /// # Errors
    ///
    /// A time that is not finite; a speed that varies, more than 10⁷ s from 0.
    pub fn turbulence(&self, time: f64) -> Result<Snapshot, Error> {
        let (time, instant) = self.instant(time)?;
        let mut work = Transform::new();
        let bands = self.turbulence.bands.iter();
        let lattices = bands.map(|band| Lattice::new(band, instant, self.lap, 1.0, &mut work)).collect();
        Ok(Snapshot::of_turbulence(time, lattices, Arc::clone(&self.setting)))
    }

    /// The period in seconds after which the wind repeats, if it does.
    pub fn period(&self) -> Option<f64> {
        self.period
    }

    /// The factor of the velocities of the bands at a mean speed.
    fn amplitude(&self, speed: f64) -> f64 {
        match self.turbulence.kind {
            Kind::WithWind(intensity) => intensity * speed.abs(),
            Kind::Still(_) => 1.0,
        }
    }

    /// The expected variance of each component of the turbulence at a time in seconds, in m²/s². It is the sum over all modes: less
    /// than (IU)² by the variance of the eddies that are smaller than [`smallest_eddy`](Field::smallest_eddy), 6 % for
    /// von Kármán's spectrum.
    ///
    /// # Errors
    ///
    /// A speed that is not finite at that time.
    pub fn variance(&self, time: f64) -> Result<f64, Error> {
        let speed = self.speed.finite_at(time, || "the speed of the wind".to_owned())?;
        let unit: f64 = self.turbulence.bands.iter().map(Band::variance).sum();
        Ok(unit * self.amplitude(speed).powi(2))
    }

    /// The wavelength of the smallest eddies in metres; none without turbulence. It is a twenty-seventh of the integral scale for
    /// von Kármán's spectrum.
    pub fn smallest_eddy(&self) -> Option<f64> {
        self.turbulence.bands.last().map(|band| std::f64::consts::TAU / band.range[1])
    }

    /// The bands of the turbulence; none if there is none.
    pub(crate) fn bands(&self) -> &[Band] {
        &self.turbulence.bands
    }

    /// The amplitudes of all modes of all bands at a time in seconds: calls `each` with the index of the band, |k| in rad/m, the wave vector
    /// in the axes of the world, and real and imaginary part of the amplitude of the velocity in m/s, which is the factor of exp(i k·x);
    /// the conjugate at -k belongs to each.
    ///
    /// # Errors
    ///
    /// As for [`at`](Field::at).
    pub fn modes(
        &self,
        time: f64,
        mut each: impl FnMut(usize, Vector3<f64>, [Vector3<f64>; 2]),
    ) -> Result<(), Error> {
        let (time, instant) = self.instant(time)?;
        let speed = self.speed.finite_at(time, || "the speed of the wind".to_owned())?;
        let amplitude = self.amplitude(speed);
        for (i, band) in self.turbulence.bands.iter().enumerate() {
            band.amplitudes(instant, self.lap, |mode, re, im| {
                let direction = Vector3::from(mode.m.map(f64::from)).normalize();
                // u = i k × A, with |A| = |u|/k.
                let [real, imaginary] = [-direction.cross(&im), direction.cross(&re)];
                let back = band.rotation.inverse();
                each(i, back * direction * mode.k, [back * real * amplitude, back * imaginary * amplitude]);
            });
        }
        Ok(())
    }

    /// The turbulence at a place and a time, in empty space, as the sum of its modes: slow, and the reference for
    /// [`Snapshot::velocity`], which interpolates.
    ///
    /// # Errors
    ///
    /// As for [`at`](Field::at).
    pub fn sum_of_modes(&self, time: f64, x: Vector3<f64>) -> Result<Vector3<f64>, Error> {
        let mut sum = Vector3::zeros();
        self.modes(time, |_, k, [re, im]| {
            let (c, s) = cos_sin(k.dot(&x) / std::f64::consts::TAU);
            sum += (re * c - im * s) * 2.0;
        })?;
        Ok(sum)
    }
}
