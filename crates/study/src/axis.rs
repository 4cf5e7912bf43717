//! Axes of plots, logarithmic and linear: range, ticks, and the position of a value.

/// The least and the greatest of the finite values; `None` if there are none.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.filter(|x| x.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    (low <= high).then_some((low, high))
}

/// A linear axis: a range of values mapped onto a stretch of the picture.
#[derive(Clone, Copy, Debug)]
pub struct LinearAxis {
    /// The value at `from`.
    pub low: f64,
    /// The value at `to`.
    pub high: f64,
    /// Coordinate of one end in the picture.
    pub from: f64,
    /// Coordinate of the other end.
    pub to: f64,
}

impl LinearAxis {
    /// An axis over all finite values, or over 0 to 1 if there are none. If they are all the same, the range extends a
    /// tenth of the value to either side.
    pub fn around(values: impl Iterator<Item = f64>, from: f64, to: f64) -> LinearAxis {
        let (low, high) = range(values).unwrap_or((0.0, 1.0));
        if high - low > 1e-12 * high.abs().max(low.abs()) {
            return LinearAxis { low, high, from, to };
        }
        let space = if high == 0.0 { 1.0 } else { 0.1 * high.abs() };
        LinearAxis { low: low - space, high: high + space, from, to }
    }

    /// The coordinate of a value. A value outside the range lies at most a tenth of the length beyond the end.
    pub fn place(&self, value: f64) -> f64 {
        let part = (value - self.low) / (self.high - self.low);
        self.from + part.clamp(-0.1, 1.1) * (self.to - self.from)
    }

    /// The multiples within the range of a round number (1, 2 or 5 times a power of ten), about as many as asked for.
    pub(super) fn ticks(&self, about: f64) -> Vec<f64> {
        let rough = (self.high - self.low) / about;
        let power = 10f64.powf(rough.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].map(|n| n * power).into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let (first, last) =
            ((self.low / step - 1e-9).ceil() as i64, (self.high / step + 1e-9).floor() as i64);
        (first..=last).map(|n| n as f64 * step).collect()
    }
}

/// A logarithmic axis in a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct LogAxis {
    /// Common logarithms of the ends of the range.
    low: f64,
    high: f64,
    /// Where the ends lie in the picture.
    from: f64,
    to: f64,
}

/// A mark on an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tick {
    pub position: f64,
    pub mantissa: u8,
    pub exponent: i32,
    /// Has a line across the picture.
    pub is_decade: bool,
    pub is_labelled: bool,
}

/// An axis over more decades than this has no ticks between them.
const CROWDED: f64 = 7.5;

impl LogAxis {
    /// An axis that shows all values greater than 0, with some space around them, and at least a decade. The
    /// lowest lies towards `from`.
    pub fn around(values: impl Iterator<Item = f64>, from: f64, to: f64) -> LogAxis {
        let positive = values.filter(|x| *x > 0.0 && x.is_finite());
        let (low, high) = range(positive.map(f64::log10)).unwrap_or((0.0, 0.0));
        let space = (0.04 * (high - low)).max((1.0 - (high - low)) / 2.0);
        LogAxis { low: low - space, high: high + space, from, to }
    }

    /// Where a value lies; values beyond the ends lie on them.
    pub fn place(&self, value: f64) -> f64 {
        let part = (value.log10() - self.low) / (self.high - self.low);
        let part = if part.is_nan() { 0.0 } else { part.clamp(0.0, 1.0) };
        self.from + part * (self.to - self.from)
    }

    /// Ticks at all decades and, if there is space, at their multiples. `labels` is how many labels there is
    /// space for.
    pub fn ticks(&self, labels: usize) -> Vec<Tick> {
        let decades = self.high - self.low;
        let every = (decades / labels.max(1) as f64).ceil().max(1.0) as i32;
        let mut ticks = Vec::new();
        for exponent in self.low.floor() as i32..=self.high.floor() as i32 {
            for mantissa in 1..=9_u8 {
                let log = f64::from(exponent) + f64::from(mantissa).log10();
                let is_decade = mantissa == 1;
                if log < self.low || log > self.high || (!is_decade && decades > CROWDED) {
                    continue;
                }
                // On a short axis the decades alone say too little.
                let between = decades < 2.2 && [2, 5].contains(&mantissa);
                let is_labelled = between || is_decade && exponent.rem_euclid(every) == 0;
                let position = self.place(10f64.powf(log));
                ticks.push(Tick { position, mantissa, exponent, is_decade, is_labelled });
            }
        }
        ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_are_equally_far_apart() {
        let axis = LogAxis::around([1e-3, 1e3, 0.0, f64::NAN].into_iter(), 100.0, 0.0);
        let step = axis.place(1.0) - axis.place(10.0);
        assert!((axis.place(1e-2) - axis.place(1e-1) - step).abs() < 1e-9 && step > 0.0);
        let ticks = axis.ticks(3);
        let decades: Vec<i32> = ticks.iter().filter(|t| t.is_decade).map(|t| t.exponent).collect();
        assert_eq!(decades, [-3, -2, -1, 0, 1, 2, 3]);
        let labelled: Vec<i32> = ticks.iter().filter(|t| t.is_labelled).map(|t| t.exponent).collect();
        assert_eq!(labelled, [-3, 0, 3]);
        assert!(ticks.iter().any(|t| t.mantissa == 5), "space for ticks between decades");
    }

    #[test]
    fn linear_ticks_are_round_and_within_the_axis() {
        let axis = LinearAxis { low: 0.0, high: 7.3, from: 0.0, to: 1.0 };
        assert_eq!(axis.ticks(7.0), [0.0, 2.0, 4.0, 6.0]);
        let flat = LinearAxis::around([3.0, 3.0].into_iter(), 0.0, 1.0);
        assert!(flat.low < 3.0 && flat.high > 3.0);
        assert!(!flat.ticks(5.0).is_empty());
    }

    #[test]
    fn an_axis_has_at_least_a_decade() {
        for values in [vec![], vec![42.0], vec![41.0, 43.0]] {
            let axis = LogAxis::around(values.iter().copied(), 0.0, 1.0);
            assert!(axis.ticks(5).iter().filter(|t| t.is_labelled).count() >= 2, "{values:?}");
            assert!(values.iter().all(|x| (0.4..0.6).contains(&axis.place(*x))), "{values:?}");
        }
    }
}
