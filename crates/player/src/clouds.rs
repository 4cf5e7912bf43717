//! Gases in a recording: the blobs of each frame, each followed from frame to frame by its key.
//!
//! Numbers are written as `encode.rs` says. Of every frame
//!
//! ```text
//! runs of the blobs of the frame before (kept, gone, kept, …): their number, and the length of each
//! number of new blobs
//! of each of the eight numbers of a blob: its change in blobs that are kept, in their order; in new ones the difference from the blob before
//! ```
//!
//! Blobs that are kept come first, in the order of the frame before. The numbers of a blob are its centre (x, y, z) and its standard deviation, in [`STEP`] units of the
//! recording; the code of its depth, 16 for a factor of 2, 256 for 1; and its light, red, green and blue, 255 for full light.

use std::collections::HashMap;

use dlsys_geometry::scene::Point;
use dlsys_render::Puff;

use super::encode::{integer, natural};

/// Steps of a blob's place, in units of the recording: an eighth of a pixel of a picture of 2000.
pub(super) const STEP: f64 = 16.0;
/// The code of the depth 1, and the difference for a factor of 2. What has the code 0 or less is not seen.
const DEPTH: [f64; 2] = [256.0, 16.0];

/// The blobs of all frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clouds {
    /// One of so many blobs is kept, as dense as all of them.
    share: u64,
    bytes: Vec<u8>,
    last: Vec<(u64, [i32; 8])>,
    is_empty: bool,
}

impl Clouds {
    /// Most blobs of all frames together, and of one.
    const MOST: [u64; 2] = [2_000_000, 30_000];

    /// Clouds with so many blobs in all frames, and in the fullest one.
    pub fn of(all: u64, fullest: u64) -> Clouds {
        let share = all.div_ceil(Clouds::MOST[0]).max(fullest.div_ceil(Clouds::MOST[1])).max(1);
        Clouds { share, bytes: Vec::new(), last: Vec::new(), is_empty: true }
    }

    /// One of so many blobs is kept.
    pub fn share(&self) -> u64 {
        self.share
    }

    /// No frame has a blob.
    pub fn is_empty(&self) -> bool {
        self.is_empty
    }

    /// The frames so far, as described at the top of this file.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Adds a frame; `unit` is that of the recording.
    pub(super) fn add(&mut self, puffs: &[Puff], centre: Point, unit: f64) {
        let share = self.share.max(1);
        let step = unit * STEP;
        let code = |puff: &Puff| {
            let depth = DEPTH[0] + DEPTH[1] * (puff.depth * share as f64).log2();
            let place = (puff.centre - centre) / step;
            let lengths = [place.x, place.y, place.z, puff.deviation / step, depth];
            let lights = puff.light.map(|light| (255.0 * light).clamp(0.0, 255.0));
            let mut numbers = [0; 8];
            for (number, value) in numbers.iter_mut().zip(lengths.into_iter().chain(lights)) {
                // To whole numbers; what is out of range is at its end.
                *number = value.round() as i32;
            }
            (puff.key, numbers)
        };
        // Keys are random numbers.
        let coded = puffs.iter().filter(|puff| puff.key % share == 0).map(code);
        let coded: Vec<(u64, [i32; 8])> = coded.filter(|(_, numbers)| numbers[4] > 0).collect();
        let now: HashMap<u64, [i32; 8]> = coded.iter().copied().collect();
        let mut kept = Vec::new();
        let mut runs = Vec::new();
        let mut was_kept = false;
        for (key, before) in &self.last {
            let found = now.get(key);
            if runs.is_empty() || found.is_some() != was_kept {
                if runs.is_empty() && found.is_none() {
                    runs.push(0);
                }
                runs.push(0);
            }
            was_kept = found.is_some();
            if let Some(run) = runs.last_mut() {
                *run += 1;
            }
            kept.extend(found.map(|numbers| (*key, *before, *numbers)));
        }
        natural(runs.len() as u64, &mut self.bytes);
        runs.iter().for_each(|run| natural(*run, &mut self.bytes));
        let known: HashMap<u64, ()> = kept.iter().map(|(key, ..)| (*key, ())).collect();
        let new: Vec<_> = coded.into_iter().filter(|(key, _)| !known.contains_key(key)).collect();
        natural(new.len() as u64, &mut self.bytes);
        for number in 0..8 {
            for (_, before, numbers) in &kept {
                integer(i64::from(numbers[number]) - i64::from(before[number]), &mut self.bytes);
            }
            let mut before = 0;
            for (_, numbers) in &new {
                integer(i64::from(numbers[number]) - before, &mut self.bytes);
                before = i64::from(numbers[number]);
            }
        }
        self.last = kept.into_iter().map(|(key, _, numbers)| (key, numbers)).chain(new).collect();
        self.is_empty &= self.last.is_empty();
    }
}
