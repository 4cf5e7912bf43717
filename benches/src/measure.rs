//! Alternating time measurements of two programs.

use std::time::Instant;

/// A median and the quartiles around it.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    pub median: f64,
    pub low: f64,
    pub high: f64,
}

impl Spread {
    /// Of nothing.
    pub const NONE: Spread = Spread { median: f64::NAN, low: f64::NAN, high: f64::NAN };

    /// Of any numbers; not a number if there are none.
    pub fn of(mut values: Vec<f64>) -> Spread {
        values.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
            values.get(index).copied().unwrap_or(f64::NAN)
        };
        Spread { median: at(0.5), low: at(0.25), high: at(0.75) }
    }

    pub fn scaled(self, factor: f64) -> Spread {
        Spread { median: self.median * factor, low: self.low * factor, high: self.high * factor }
    }
}

/// Seconds a run of `a` and of `b`, and the ratio a : b of each round.
#[derive(Clone, Copy, Debug)]
pub struct Race {
    pub a: Spread,
    pub b: Spread,
    pub ratio: Spread,
}

/// Least duration of one sample in seconds; shorter runs are repeated.
const SAMPLE: f64 = 0.01;

/// Times `a` and `b` in turns, each first in every other round. The runs have been made before, so that memory is
/// warm.
pub fn race(rounds: usize, a: &mut dyn FnMut(), b: &mut dyn FnMut()) -> Race {
    let (repeat_a, repeat_b) = (repeats(a), repeats(b));
    let (mut times_a, mut times_b) = (Vec::new(), Vec::new());
    for round in 0..rounds {
        if round % 2 == 0 {
            times_a.push(time(a, repeat_a));
            times_b.push(time(b, repeat_b));
        } else {
            times_b.push(time(b, repeat_b));
            times_a.push(time(a, repeat_a));
        }
    }
    let ratios = times_a.iter().zip(&times_b).map(|(a, b)| a / b).collect();
    Race { a: Spread::of(times_a), b: Spread::of(times_b), ratio: Spread::of(ratios) }
}

fn repeats(run: &mut dyn FnMut()) -> u32 {
    let once = time(run, 1);
    (SAMPLE / once.max(1e-9)).ceil().clamp(1.0, 1e5) as u32
}

/// Seconds a run.
pub fn time(run: &mut dyn FnMut(), repeat: u32) -> f64 {
    let begin = Instant::now();
    for _ in 0..repeat {
        run();
    }
    begin.elapsed().as_secs_f64() / f64::from(repeat)
}

/// A duration in the unit that suits it.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1e-6 => format!("{:.3} ns", s * 1e9),
        s if s < 1e-3 => format!("{:.3} µs", s * 1e6),
        s if s < 1.0 => format!("{:.3} ms", s * 1e3),
        s => format!("{s:.3} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles() {
        let s = Spread::of(vec![5.0, 1.0, 4.0, 2.0, 3.0]);
        assert_eq!((s.low, s.median, s.high), (2.0, 3.0, 4.0));
    }
}
