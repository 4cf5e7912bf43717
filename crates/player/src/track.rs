//! One thing through time: the numbers that place it, as few as its motion needs.
//!
//! A track holds samples at every frame while it is recorded. Then samples are left out: those at the end that repeat the
//! one before, and all but every second, fourth, … one if straight lines between the rest are as near as they should be.

use super::stage::{Finish, Form};

/// One thing from the first frame in which it is there to the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// The form of the thing.
    pub form: Form,
    /// Frames, by index.
    pub first: u32,
    /// The last frame in which it is there, by index.
    pub last: u32,
    /// Changes of finish: the frame from which it holds. The first is `first`.
    pub finishes: Vec<(u32, Finish)>,
    /// Samples of all numbers, in steps of the recording's unit. Sample `i` is of frame `first + i * stride`, but that of the
    /// last frame is always the last one there would be; samples that are missing at the end repeat the last.
    pub samples: Vec<i32>,
    /// Frames from sample to sample: a power of two.
    pub stride: u32,
}

impl Track {
    /// Largest distance between samples.
    const LONGEST: u32 = 32;

    /// Samples that there would be, were none missing at the end.
    pub fn full(&self) -> usize {
        ((self.last - self.first).div_ceil(self.stride) + 1) as usize
    }

    /// Samples that are there.
    pub fn len(&self) -> usize {
        self.samples.len() / self.form.numbers().max(1)
    }

    /// Never; for the sake of convention.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Leaves out samples, such that straight lines stay within `tolerance`, in steps. The track has a sample at
    /// each of its frames.
    pub(super) fn thin(&mut self, tolerance: i32) {
        debug_assert_eq!(self.stride, 1);
        let width = self.form.numbers();
        let frames = self.len();
        let mut stride = Track::LONGEST;
        while stride > 1 && !self.is_straight(stride as usize, tolerance) {
            stride /= 2;
        }
        if stride > 1 && frames > 2 {
            let kept: Vec<i32> = (0..frames - 1)
                .step_by(stride as usize)
                .chain([frames - 1])
                .flat_map(|i| &self.samples[i * width..(i + 1) * width])
                .copied()
                .collect();
            self.samples = kept;
            self.stride = stride;
        }
        let mut length = self.len();
        while length > 1
            && self.samples[(length - 1) * width..length * width]
                == self.samples[(length - 2) * width..(length - 1) * width]
        {
            length -= 1;
        }
        self.samples.truncate(length * width);
        self.samples.shrink_to_fit();
    }

    /// Whether all samples are near the lines between every so-manieth of them and the last.
    fn is_straight(&self, stride: usize, tolerance: i32) -> bool {
        let width = self.form.numbers();
        let frames = self.len();
        (0..frames.saturating_sub(1)).step_by(stride).all(|start| {
            let end = (start + stride).min(frames - 1);
            let [low, high] = [start, end].map(|i| &self.samples[i * width..(i + 1) * width]);
            let span = (end - start) as i64;
            (start + 1..end).all(|i| {
                let between = &self.samples[i * width..(i + 1) * width];
                let past = (i - start) as i64;
                between.iter().zip(low.iter().zip(high)).all(|(&x, (&a, &b))| {
                    let line = i64::from(a) * (span - past) + i64::from(b) * past;
                    (i64::from(x) * span - line).abs() <= i64::from(tolerance) * span
                })
            })
        })
    }

    /// The numbers at a frame, in steps: what a player shows.
    pub fn at(&self, frame: u32) -> Vec<f64> {
        let width = self.form.numbers();
        let sample = |i: usize| {
            let i = i.min(self.len() - 1);
            self.samples[i * width..(i + 1) * width].iter().map(|&x| f64::from(x))
        };
        let past = frame.clamp(self.first, self.last) - self.first;
        let i = past / self.stride;
        let reach = ((i + 1) * self.stride).min(self.last - self.first) - i * self.stride;
        let part = if reach > 0 { f64::from(past - i * self.stride) / f64::from(reach) } else { 0.0 };
        sample(i as usize).zip(sample(i as usize + 1)).map(|(a, b)| a + (b - a) * part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(length: u32, path: impl Fn(u32) -> i32) -> Track {
        let numbers = Form::Mesh(0).numbers() as i32;
        let samples = (0..length).flat_map(|i| (0..numbers).map(|k| (k, i)).collect::<Vec<_>>());
        let samples = samples.map(|(k, i)| if k == 4 { path(i) } else { k }).collect();
        let finish = Finish { material: None, variant: 0 };
        Track {
            form: Form::Mesh(0),
            first: 10,
            last: 9 + length,
            finishes: vec![(10, finish)],
            samples,
            stride: 1,
        }
    }

    #[test]
    fn straight_motion_keeps_its_ends_and_rest_one_sample() {
        let mut line = track(100, |i| 7 * i as i32);
        line.thin(2);
        assert_eq!((line.stride, line.len(), line.full()), (32, 5, 5));
        assert_eq!(line.at(10 + 99)[4], 693.0);
        assert_eq!(line.at(10 + 50)[4], 350.0);
        let mut rest = track(100, |_| 5);
        rest.thin(2);
        assert_eq!((rest.len(), rest.full()), (1, 5));
        assert_eq!(rest.at(70)[4], 5.0);
        let mut short = track(1, |_| 3);
        short.thin(2);
        assert_eq!((short.len(), short.at(10)[4]), (1, 3.0));
    }

    #[test]
    fn bent_motion_stays_within_the_tolerance() {
        let path = |i: u32| (3000.0 * (f64::from(i) * 0.05).sin()) as i32;
        for length in [2, 3, 17, 64, 65, 100] {
            let whole = track(length, path);
            let mut thin = whole.clone();
            thin.thin(20);
            assert!(length < 17 || thin.len() < whole.len(), "{}", thin.len());
            for frame in whole.first..=whole.last {
                let off = (whole.at(frame)[4] - thin.at(frame)[4]).abs();
                assert!(off <= 20.0, "{length} {frame}: {off}");
            }
        }
    }
}
