//! How far the mean wind has come: the integrals of U and |U| from 0 to any time.
//!
//! The line of time is divided into panels of a fixed length, on which the speed is integrated adaptively. Sums over
//! panels from 0 on are kept, and are always extended panel by panel, so that each has the same bits whatever was evaluated before.

use std::sync::{PoisonError, RwLock};

use crate::{Error, Signal};

/// The length of a panel in seconds.
const PANEL: f64 = 4.0;

/// The largest distance from 0 in seconds at which a speed that varies can be integrated: 10⁷ s are 116 days.
const LIMIT: f64 = 1e7;

/// The largest number of parts into which a panel is divided.
const PARTS: usize = 2000;

/// An error of a panel that is accepted, relative to the largest mean speed on it.
const TOLERANCE: f64 = 1e-13;

/// ∫U dt and ∫|U| dt, in metres.
pub(crate) type Path = [f64; 2];

/// The integrals of a speed from time 0.
#[derive(Debug, Default)]
pub(crate) struct Journey {
    /// Sums at the ends of panels, after 0 and before it.
    later: RwLock<Vec<Path>>,
    earlier: RwLock<Vec<Path>>,
}

impl Journey {
    /// The integrals of a speed from 0 to `time` seconds.
    pub(crate) fn to(&self, speed: &Signal, time: f64) -> Result<Path, Error> {
        let f = match speed {
            Signal::Constant(speed) => {
                let path = speed * time;
                return if path.is_finite() {
                    Ok([path, speed.abs() * time])
                } else {
                    Err(Error::Time { time, limit: f64::MAX })
                };
            }
            Signal::Function(f) => f,
        };
        // Written so that a time that is not a number fails as well.
        let near = time.abs() <= LIMIT;
        if !near {
            return Err(Error::Time { time, limit: LIMIT });
        }
        let (sums, sign) = if time < 0.0 { (&self.earlier, -1.0) } else { (&self.later, 1.0) };
        let whole = (time.abs() / PANEL).floor() as usize;
        let before = prefix(sums, whole, |panel| {
            integral(f, sign * PANEL * panel as f64, sign * PANEL * (panel + 1) as f64)
        })?;
        let rest = integral(f, sign * PANEL * whole as f64, time)?;
        Ok([before[0] + rest[0], before[1] + rest[1]])
    }
}

/// The sum over the first panels, with as many as are missing added to those that are kept.
fn prefix(
    sums: &RwLock<Vec<Path>>,
    panels: usize,
    panel: impl Fn(usize) -> Result<Path, Error>,
) -> Result<Path, Error> {
    if panels == 0 {
        return Ok([0.0; 2]);
    }
    // Sums are complete whenever the lock is free, so one that a panic has left is as good as any.
    if let Some(sum) = sums.read().unwrap_or_else(PoisonError::into_inner).get(panels - 1) {
        return Ok(*sum);
    }
    let mut sums = sums.write().unwrap_or_else(PoisonError::into_inner);
    let mut sum = sums.last().copied().unwrap_or([0.0; 2]);
    while sums.len() < panels {
        let part = panel(sums.len())?;
        sum = [sum[0] + part[0], sum[1] + part[1]];
        sums.push(sum);
    }
    Ok(sums[panels - 1])
}

/// Nodes of Kronrod's rule of 15 points on [0, 1], its weights, and the weights of Gauss's rule of 7 points at every other node.
const NODES: [f64; 8] = [
    0.0,
    0.207_784_955_007_898_48,
    0.405_845_151_377_397_2,
    0.586_087_235_467_691_1,
    0.741_531_185_599_394_5,
    0.864_864_423_359_769_1,
    0.949_107_912_342_758_5,
    0.991_455_371_120_812_6,
];
const KRONROD: [f64; 8] = [
    0.209_482_141_084_727_82,
    0.204_432_940_075_298_89,
    0.190_350_578_064_785_42,
    0.169_004_726_639_267_9,
    0.140_653_259_715_525_92,
    0.104_790_010_322_250_19,
    0.063_092_092_629_978_56,
    0.022_935_322_010_529_224,
];
const GAUSS: [f64; 4] =
    [0.417_959_183_673_469_4, 0.381_830_050_505_118_9, 0.279_705_391_489_276_64, 0.129_484_966_168_869_7];

/// Both rules on one interval: the integrals of f and |f| by the finer, and the difference between the rules.
fn rules(f: impl Fn(f64) -> f64, from: f64, to: f64) -> Result<(Path, f64), Error> {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let (mut fine, mut coarse) = ([0.0; 2], [0.0; 2]);
    for (i, node) in NODES.iter().enumerate() {
        for side in [1.0, -1.0] {
            if i == 0 && side < 0.0 {
                continue;
            }
            let time = middle + side * half * node;
            let value = f(time);
            if !value.is_finite() {
                return Err(Error::NotFinite { name: "the speed of the wind".to_owned(), time, value });
            }
            for (k, v) in [value, value.abs()].into_iter().enumerate() {
                fine[k] += KRONROD[i] * v;
                if i % 2 == 0 {
                    coarse[k] += GAUSS[i / 2] * v;
                }
            }
        }
    }
    let error = (fine[0] - coarse[0]).abs().max((fine[1] - coarse[1]).abs());
    Ok(([fine[0] * half, fine[1] * half], error * half.abs()))
}

/// The integrals from one time to another, with intervals halved until the rules agree.
fn integral(f: &dyn Fn(f64) -> f64, from: f64, to: f64) -> Result<Path, Error> {
    if from == to {
        return Ok([0.0; 2]);
    }
    let (mut open, mut sum, mut parts) = (vec![(from, to)], [0.0; 2], 0);
    while let Some((a, b)) = open.pop() {
        let (part, error) = rules(f, a, b)?;
        parts += 1;
        // Relative to the whole interval, with the share of this part: a jump is halved until its part is too short to matter.
        let size = part[1].abs() / (b - a).abs() * (to - from).abs();
        let middle = 0.5 * (a + b);
        if error <= TOLERANCE * size || parts >= PARTS || middle == a || middle == b {
            sum = [sum[0] + part[0], sum[1] + part[1]];
        } else {
            open.push((middle, b));
            open.push((a, middle));
        }
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_of_a_gust_agree_with_the_antiderivative() {
        let speed = Signal::function(|t| 3.0 + 2.0 * (0.7 * t).sin());
        let journey = Journey::default();
        for t in [0.0f64, 1.0, 3.999, 4.0, 57.3, 1234.5, -0.5, -99.25] {
            let exact = 3.0 * t + 2.0 / 0.7 * (1.0 - (0.7 * t).cos());
            let [path, length] = journey.to(&speed, t).unwrap();
            assert!((path - exact).abs() <= 2e-13 * (1.0 + exact.abs()), "{t}: {path} for {exact}");
            // Positive throughout, so both are equal.
            assert_eq!(path, length);
        }
    }

    #[test]
    fn reversals_and_jumps() {
        // Triangle wave, |U| has kinks at whole multiples of 0.5.
        let speed = Signal::function(|t: f64| 1.0 - 2.0 * (2.0 * (t - (t + 0.5).floor())).abs());
        let [path, length] = Journey::default().to(&speed, 7.0).unwrap();
        assert!(path.abs() < 1e-12 && (length - 3.5).abs() < 1e-12, "{path} {length}");
        let gust = Signal::function(|t| if (1.3..2.7).contains(&t) { 10.0 } else { 0.0 });
        let [path, _] = Journey::default().to(&gust, 9.0).unwrap();
        assert!((path - 14.0).abs() < 1e-10, "{path}");
    }

    #[test]
    fn the_order_of_calls_changes_no_bit() {
        let speed = || Signal::function(|t: f64| (t * 0.3).sin().exp());
        let (forward, backward) = (Journey::default(), Journey::default());
        let times: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.7).collect();
        let a: Vec<_> = times.iter().map(|t| forward.to(&speed(), *t).unwrap()).collect();
        let mut b: Vec<_> = times.iter().rev().map(|t| backward.to(&speed(), *t).unwrap()).collect();
        b.reverse();
        assert_eq!(a, b);
    }

    #[test]
    fn speeds_and_times_without_a_value() {
        let journey = Journey::default();
        let pole = Signal::function(|t| 1.0 / (t - 2.0));
        assert!(matches!(journey.to(&pole, 8.0), Err(Error::NotFinite { .. })));
        let fine = Signal::function(|t| t);
        assert!(matches!(Journey::default().to(&fine, f64::NAN), Err(Error::Time { .. })));
        assert!(matches!(Journey::default().to(&fine, 1e9), Err(Error::Time { .. })));
        assert!(matches!(Journey::default().to(&Signal::from(1.0), f64::INFINITY), Err(Error::Time { .. })));
    }
}
