//! Turbulence as a function of place and of any time, with its derivatives and their bounds: for equations that read the wind.
//!
//! ```text
//! instants   k-1    k      k+1    k+2       128 in a second
//!             ●     ●───────●      ●
//!                     t ▲               a cubic of the four, smooth from one interval to the next
//! ```
//!
//! Each instant is a [`Snapshot`], which costs a millisecond, so a few are kept. The cubic is that of Catmull and Rom (1974): it has the values of the
//! instants, and at each of them the slope between its neighbours. Eddies that pass faster than two instants are not resolved.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::{Matrix3, Vector3};

use crate::{Error, Field, Snapshot};

/// Instants in a second.
const INSTANTS: f64 = 128.0;
/// Instants that are kept: those of half a second, 3 MB each.
const KEPT: usize = 64;
/// Places whose instants are kept.
const PLACES: usize = 4;
/// Over more intervals than this there are no bounds.
const MOST: f64 = 4.0;
/// The largest sum of the magnitudes of the weights of a cubic, of the instants.
const WEIGHTS: f64 = 1.25;
/// The same of its slope, of the differences of neighbouring instants.
const SLOPE: f64 = 1.5;

/// The turbulence of a wind at any time from 0 on, relative to its amplitude, as [`Field::turbulence`] has it at an instant.
#[derive(Debug)]
pub struct Eddies {
    field: Arc<Field>,
    /// Seconds from one instant to the next.
    step: f64,
    /// Instants in the period of the wind, if it has one.
    lap: Option<u64>,
    kept: Mutex<VecDeque<(u64, Arc<Still>)>>,
    /// The last places, the latest at the end.
    places: Mutex<VecDeque<Local>>,
}

/// The four instants around an interval at a place.
#[derive(Clone, Debug)]
struct Local {
    first: u64,
    place: Vector3<f64>,
    velocities: [Vector3<f64>; 4],
    gradients: Option<[Matrix3<f64>; 4]>,
}

/// An instant, with bounds of it and of its difference from the one before.
#[derive(Debug)]
struct Still {
    snapshot: Snapshot,
    bounds: OnceLock<Extremes>,
    change: OnceLock<Extremes>,
}

/// Bounds of the length of a velocity (m/s), and of that of its first and second derivatives along any direction (1/s, 1/(m s)).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Extremes(pub(crate) [f64; 3]);

impl Extremes {
    fn larger(self, other: Extremes) -> Extremes {
        Extremes([0, 1, 2].map(|i| self.0[i].max(other.0[i])))
    }
}

/// Velocity and derivatives at a place and a time: the gradient has ∂u_i/∂x_j in row i, column j.
#[derive(Clone, Copy, Debug)]
pub struct EddyJet {
    /// Velocity in m/s, relative to the amplitude.
    pub velocity: Vector3<f64>,
    /// Derivatives by place, in 1/s.
    pub gradient: Matrix3<f64>,
    /// Derivative by time, in m/s².
    pub rate: Vector3<f64>,
}

/// Bounds of a number, the lesser first.
pub type Bounds = [f64; 2];

/// Bounds of velocity and derivatives over a stretch of time and a ball of places; infinite where they are not known.
#[derive(Clone, Copy, Debug)]
pub struct EddyBounds {
    /// Of each component of the velocity in m/s.
    pub velocity: [Bounds; 3],
    /// Of the derivatives by place in 1/s: row i, column j is ∂u_i/∂x_j. Infinite if they were not asked for.
    pub gradient: [[Bounds; 3]; 3],
    /// Of the derivatives by time in m/s².
    pub rate: [Bounds; 3],
}

const UNKNOWN: Bounds = [f64::NEG_INFINITY, f64::INFINITY];
const NOTHING: Bounds = [f64::INFINITY, f64::NEG_INFINITY];

impl Eddies {
    /// The turbulence of a wind.
    pub fn new(field: Arc<Field>) -> Eddies {
        let lap = field.period().map(|period| (period * INSTANTS).ceil().max(1.0));
        let step = match (field.period(), lap) {
            (Some(period), Some(lap)) => period / lap,
            _ => 1.0 / INSTANTS,
        };
        let lap = lap.map(|lap| lap as u64);
        Eddies { field, step, lap, kept: Mutex::default(), places: Mutex::default() }
    }

    /// Seconds within which the turbulence changes much.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// The velocity at a place in m and a time in s, relative to the amplitude.
    ///
    /// # Errors
    /// A time before 0 or one that is not finite; a speed of the wind that is not finite at that time, or that varies more than 10⁷ s from 0.
    pub fn velocity(&self, time: f64, x: Vector3<f64>) -> Result<Vector3<f64>, Error> {
        let (first, share) = self.place(time)?;
        let [weights, _] = self.weights(first, share);
        let Local { velocities, .. } = self.local(first, x, false)?;
        Ok(velocities.iter().zip(weights).fold(Vector3::zeros(), |sum, (of, weight)| sum + of * weight))
    }

    /// The velocity with its derivatives.
    ///
    /// # Errors
    /// As of [`Eddies::velocity`].
    pub fn jet(&self, time: f64, x: Vector3<f64>) -> Result<EddyJet, Error> {
        let (first, share) = self.place(time)?;
        let [weights, slopes] = self.weights(first, share);
        let Local { velocities, gradients, .. } = self.local(first, x, true)?;
        let mut jet =
            EddyJet { velocity: Vector3::zeros(), gradient: Matrix3::zeros(), rate: Vector3::zeros() };
        for (i, (velocity, gradient)) in velocities.iter().zip(gradients.unwrap_or_default()).enumerate() {
            jet.velocity += velocity * weights[i];
            jet.gradient += gradient * weights[i];
            jet.rate += velocity * (slopes[i] / self.step);
        }
        Ok(jet)
    }

    /// Bounds from one time in s to another, for places up to a distance in m from a middle; of derivatives by place if they are wanted. At the middle
    /// they are those of the cubics; how far velocities are from those there follows from the coefficients of the whole field. Infinite over long stretches.
    ///
    /// # Errors
    /// As of [`Eddies::velocity`].
    pub fn bounds(
        &self,
        [from, to]: [f64; 2],
        (x, reach): (Vector3<f64>, f64),
        with_gradient: bool,
    ) -> Result<EddyBounds, Error> {
        let ((first, begin), (last, end)) = (self.place(from)?, self.place(to)?);
        let mut bounds =
            EddyBounds { velocity: [UNKNOWN; 3], gradient: [[UNKNOWN; 3]; 3], rate: [UNKNOWN; 3] };
        if (last - first) as f64 > MOST || !reach.is_finite() {
            return Ok(bounds);
        }
        (bounds.velocity, bounds.rate) = ([NOTHING; 3], [NOTHING; 3]);
        if with_gradient {
            bounds.gradient = [[NOTHING; 3]; 3];
        }
        for number in first..=last {
            let part = [if number == first { begin } else { 0.0 }, if number == last { end } else { 1.0 }];
            let local = self.local(number, x, with_gradient)?;
            let away = if reach > 0.0 { self.away(number, reach)? } else { [0.0; 3] };
            for i in 0..3 {
                let cubic = self.cubic(number, local.velocities.map(|velocity| velocity[i]));
                widen(&mut bounds.velocity[i], range(cubic, part), away[0]);
                let slope = [cubic[1], 2.0 * cubic[2], 3.0 * cubic[3], 0.0].map(|c| c / self.step);
                widen(&mut bounds.rate[i], range(slope, part), away[2]);
                let Some(gradients) = &local.gradients else { continue };
                for j in 0..3 {
                    let cubic = self.cubic(number, [0, 1, 2, 3].map(|k| gradients[k][(i, j)]));
                    widen(&mut bounds.gradient[i][j], range(cubic, part), away[1]);
                }
            }
        }
        Ok(bounds)
    }

    /// How far velocity, derivatives by place and by time, at places up to a distance from another one, may be from those there.
    fn away(&self, number: u64, reach: f64) -> Result<[f64; 3], Error> {
        let around = self.around(number)?;
        let (mut all, mut change) = (Extremes::default(), Extremes::default());
        for (i, still) in around.iter().enumerate() {
            all = all.larger(*still.bounds.get_or_init(|| still.snapshot.extremes(None)));
            if i > 0 {
                let before = &around[i - 1].snapshot;
                change = change.larger(*still.change.get_or_init(|| still.snapshot.extremes(Some(before))));
            }
        }
        let [_, slope, bend] = all.0.map(|value| WEIGHTS * value * reach);
        Ok([slope, bend, SLOPE * change.0[1] * reach / self.step])
    }

    /// The coefficients of the cubic of an interval, by the share of it.
    fn cubic(&self, number: u64, values: [f64; 4]) -> [f64; 4] {
        let [mut a, b, c, d] = values;
        if number == 0 && self.lap.is_none() {
            a = 2.0 * b - c;
        }
        [b, 0.5 * (c - a), a - 2.5 * b + 2.0 * c - 0.5 * d, 0.5 * (d - a) + 1.5 * (b - c)]
    }

    /// The instants around an interval at a place, with gradients if they are wanted.
    fn local(&self, first: u64, place: Vector3<f64>, with_gradients: bool) -> Result<Local, Error> {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |local: &Local| local.first == first && local.place == place;
        let known = places.iter().position(is_it);
        if let Some(local) = known.map(|index| &places[index])
            && (local.gradients.is_some() || !with_gradients)
        {
            return Ok(local.clone());
        }
        known.map(|index| places.remove(index));
        let around = self.around(first)?;
        let local = match with_gradients {
            false => {
                let velocities = around.each_ref().map(|still| still.snapshot.velocity(place));
                Local { first, place, velocities, gradients: None }
            }
            true => {
                let all = around.each_ref().map(|still| still.snapshot.velocity_and_gradient(place));
                let (velocities, gradients) = (all.map(|of| of.0), Some(all.map(|of| of.1)));
                Local { first, place, velocities, gradients }
            }
        };
        if places.len() >= PLACES {
            places.pop_front();
        }
        places.push_back(local.clone());
        Ok(local)
    }

    /// The number of the instant at or before a time, and the share of the way to the next one.
    fn place(&self, time: f64) -> Result<(u64, f64), Error> {
        if !(time >= 0.0 && time.is_finite()) {
            return Err(Error::Time { time, limit: f64::MAX });
        }
        let place = time / self.step;
        if place >= 2f64.powi(53) {
            return Err(Error::Time { time, limit: 2f64.powi(53) * self.step });
        }
        Ok((place as u64, place.fract()))
    }

    /// The weights of the four instants around an interval, and their derivatives by the share of it. Before the first instant of a wind without a
    /// period, the line through the first two goes on.
    fn weights(&self, first: u64, share: f64) -> [[f64; 4]; 2] {
        let (t, t2) = (share, share * share);
        let t3 = t2 * t;
        let mut weights = [
            [
                -0.5 * t3 + t2 - 0.5 * t,
                1.5 * t3 - 2.5 * t2 + 1.0,
                -1.5 * t3 + 2.0 * t2 + 0.5 * t,
                0.5 * t3 - 0.5 * t2,
            ],
            [-1.5 * t2 + 2.0 * t - 0.5, 4.5 * t2 - 5.0 * t, -4.5 * t2 + 4.0 * t + 0.5, 1.5 * t2 - t],
        ];
        if first == 0 && self.lap.is_none() {
            for of in &mut weights {
                (of[1], of[2], of[0]) = (of[1] + 2.0 * of[0], of[2] - of[0], 0.0);
            }
        }
        weights
    }

    /// The four instants around an interval; the first interval of a wind without a period has its first instant twice.
    fn around(&self, first: u64) -> Result<[Arc<Still>; 4], Error> {
        let before = match (first, self.lap) {
            (0, Some(lap)) => lap - 1,
            (0, None) => 0,
            (first, _) => first - 1,
        };
        Ok([self.instant(before)?, self.instant(first)?, self.instant(first + 1)?, self.instant(first + 2)?])
    }

    fn instant(&self, number: u64) -> Result<Arc<Still>, Error> {
        let number = self.lap.map_or(number, |lap| number % lap);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, still)) = kept.iter().rev().find(|(of, _)| *of == number) {
            return Ok(Arc::clone(still));
        }
        let snapshot = self.field.turbulence(number as f64 * self.step)?;
        let still = Arc::new(Still { snapshot, bounds: OnceLock::new(), change: OnceLock::new() });
        if kept.len() >= KEPT {
            kept.pop_front();
        }
        kept.push_back((number, Arc::clone(&still)));
        Ok(still)
    }
}

/// Adds to bounds those of a number that may be further away.
fn widen(bounds: &mut Bounds, [low, high]: Bounds, away: f64) {
    *bounds = [bounds[0].min(low - away), bounds[1].max(high + away)];
}

/// Bounds of a cubic between two arguments: it lies between its coefficients in Bernstein's form.
fn range(c: [f64; 4], [from, to]: [f64; 2]) -> Bounds {
    let h = to - from;
    let value = c[0] + from * (c[1] + from * (c[2] + from * c[3]));
    let slope = h * (c[1] + from * (2.0 * c[2] + 3.0 * from * c[3]));
    let (bend, last) = (h * h * (c[2] + 3.0 * from * c[3]), h * h * h * c[3]);
    let second = value + slope / 3.0;
    let third = value + 2.0 * slope / 3.0 + bend / 3.0;
    let all = [value, second, third, value + slope + bend + last];
    [all.into_iter().fold(f64::INFINITY, f64::min), all.into_iter().fold(f64::NEG_INFINITY, f64::max)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Description, Ground, Signal};

    fn windy(ground: Option<f64>, period: Option<f64>) -> Eddies {
        let field = Field::new(Description {
            turbulence: 0.3,
            scale: 4.0,
            seed: 5,
            period,
            ground: ground.map(Ground::Flat),
            ..Description::new(Vector3::x(), Signal::function(|t| 3.0 + (t * std::f64::consts::TAU).sin()))
        });
        Eddies::new(Arc::new(field.expect("a wind")))
    }

    /// Places and times all over.
    fn probes() -> impl Iterator<Item = (f64, Vector3<f64>)> {
        (0..40).map(|i| {
            let part = |factor: f64| (f64::from(i) * factor).fract();
            let x = Vector3::new(8.0 * part(0.755), 3.0 * part(0.57) - 0.5, 8.0 * part(0.43));
            (1.5 * part(0.618), x)
        })
    }

    #[test]
    fn instants_are_those_of_the_field_and_the_amplitude_is_a_factor() {
        let eddies = windy(None, None);
        for n in [0, 1, 128, 200] {
            let (time, x) = (f64::from(n) / INSTANTS, Vector3::new(1.0, 2.0, 0.3));
            let found = eddies.velocity(time, x).expect("a velocity");
            assert_eq!(found, eddies.field.turbulence(time).expect("an instant").velocity(x));
            let amplitude = 0.3 * (3.0 + (time * std::f64::consts::TAU).sin());
            let mean = Vector3::x() * (3.0 + (time * std::f64::consts::TAU).sin());
            let whole = eddies.field.at(time).expect("an instant").velocity(x);
            assert!((found * amplitude + mean - whole).norm() < 1e-12);
        }
    }

    /// Between the instants, against instants there.
    #[test]
    fn eddies_are_resolved_between_instants() {
        let eddies = windy(None, None);
        let (mut error, mut square) = (0.0, 0.0);
        for (time, x) in probes() {
            let exact = eddies.field.turbulence(time).expect("an instant").velocity(x);
            error += (eddies.velocity(time, x).expect("a velocity") - exact).norm_squared();
            square += exact.norm_squared();
        }
        let relative = (error / square).sqrt();
        assert!(relative < 0.02, "{relative}");
    }

    #[test]
    fn derivatives_are_those_of_the_velocity() {
        for eddies in [windy(None, None), windy(Some(0.2), None), windy(None, Some(1.0))] {
            for (time, x) in probes() {
                let at = |time: f64, x: Vector3<f64>| eddies.velocity(time, x).expect("a velocity");
                let jet = eddies.jet(time, x).expect("a velocity");
                assert!((jet.velocity - at(time, x)).norm() < 1e-14);
                let step = 1e-6;
                let rate = (at(time + step, x) - at((time - step).max(0.0), x)) / (step + step.min(time));
                assert!((rate - jet.rate).norm() < 1e-2 * (1.0 + jet.rate.norm()), "{rate} {}", jet.rate);
                for j in 0..3 {
                    let offset = Vector3::ith(j, step);
                    let slope = (at(time, x + offset) - at(time, x - offset)) / (2.0 * step);
                    assert!((slope - jet.gradient.column(j)).norm() < 1e-4, "{slope} {}", jet.gradient);
                }
            }
        }
    }

    /// Nothing near a place, and near a time, is beyond the bounds; and they become narrow.
    #[test]
    fn bounds_hold_and_become_narrow() {
        let within = |[low, high]: Bounds, value: f64| {
            let rounding = 1e-12 * (1.0 + value.abs());
            assert!(low - rounding <= value && value <= high + rounding, "{low} {value} {high}");
        };
        for eddies in [windy(None, None), windy(Some(0.2), None), windy(None, Some(1.0))] {
            for (i, (time, x)) in probes().enumerate() {
                let (half, reach) = ([0.01, 1e-3, 1e-5][i % 3], [0.3, 0.01, 0.0][i % 3]);
                let (from, to) = ((time - half).max(0.0), time + half);
                let bounds = eddies.bounds([from, to], (x, reach), true).expect("bounds");
                for (j, (_, other)) in probes().take(12).enumerate() {
                    let way =
                        (other - x).try_normalize(0.0).unwrap_or_default() * (reach * (j % 7) as f64 / 6.0);
                    let there =
                        eddies.jet(from + (to - from) * (j % 5) as f64 / 4.0, x + way).expect("a velocity");
                    for a in 0..3 {
                        within(bounds.velocity[a], there.velocity[a]);
                        within(bounds.rate[a], there.rate[a]);
                        (0..3).for_each(|b| within(bounds.gradient[a][b], there.gradient[(a, b)]));
                    }
                }
            }
            let x = Vector3::new(1.0, 2.0, 3.0);
            let width = |half: f64, reach: f64| {
                let [low, high] =
                    eddies.bounds([0.7 - half, 0.7 + half], (x, reach), false).expect("bounds").velocity[0];
                high - low
            };
            assert_eq!(width(0.0, 0.0), 0.0);
            assert!(
                width(1e-6, 1e-6) < 2e-5 * width(0.02, 0.05),
                "{} {}",
                width(1e-6, 1e-6),
                width(0.02, 0.05)
            );
            assert!(width(0.5, 0.0).is_infinite());
        }
    }

    #[test]
    fn a_period_is_exact_and_times_without_wind_are_errors() {
        let eddies = windy(None, Some(1.0));
        let x = Vector3::new(1.0, 0.5, -3.0);
        for time in [0.0, 0.25, 0.996_093_75] {
            assert_eq!(eddies.velocity(time, x), eddies.velocity(time + 3.0, x));
        }
        for time in [-1.0, f64::NAN, f64::INFINITY, 1e300] {
            assert!(eddies.velocity(time, x).is_err());
        }
        assert!(windy(None, None).velocity(2e7, x).is_err(), "a speed that varies is not integrated as far");
    }
}
