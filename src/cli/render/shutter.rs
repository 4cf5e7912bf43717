//! `--shutter`: motion blur, as the sum of the moments while the shutter of a camera is open.
//!
//! A frame is in the middle of that time. Its motion is measured first, by the scenes at five instants of it: so many moments are drawn that nothing moves by more than about a pixel between
//! two of them. All of that depends on the frame alone, so a still is the frame of the film. A frame in which nothing moves is drawn once, as without a shutter.

use std::collections::{BTreeMap, HashMap};

use super::{Clock, Failure, FrameRecord, Render, brief, count_of, play_at, record, turntable};
use crate::cli::common::step;
use crate::cli::frame_source::Frame;
use crate::render::{Exposure, FrameWriter, Positions};
use crate::scene::Scene;
use crate::sim::Stats;
use turntable::Orbit;

/// Pixels between two moments.
const STEP: f64 = 1.0;
/// Most moments of a frame: an odd number, as all of them are, so that the one in the middle is the frame's own.
const MOST: usize = 127;
/// Moments of a frame in which something appears or vanishes, at least.
const CHANGED: usize = 9;
/// Intervals of the open time between which the motion is measured.
const PROBED: usize = 4;

const _: () = assert!(MOST % 2 == 1 && MOST <= Exposure::MOST as usize && CHANGED % 2 == 1);

/// A moment of a frame.
#[derive(Clone, Copy, Debug)]
struct Moment {
    frame: usize,
    time: f64,
    /// The angle of the camera on its turntable.
    angle: Option<f64>,
    /// The one in the middle of the frame.
    is_own: bool,
}

/// The moments of all frames.
pub struct Moments {
    /// In the order of time.
    moments: Vec<Moment>,
    /// Moments of each frame.
    counts: Vec<usize>,
    /// Frames with more motion than moments, and the largest motion in them, in pixels while the shutter is open.
    coarse: (usize, f64),
}

/// When the shutter is open.
struct Shutter<'a> {
    times: &'a [f64],
    /// How long it is open, in frames and in units of the model's time.
    part: f64,
    open: f64,
    orbit: Option<Orbit>,
}

impl Shutter<'_> {
    /// The moment of a frame at a place of the open time, from 0 to 1.
    fn moment(&self, frame: usize, place: f64) -> Moment {
        let own = self.times[frame];
        // There is nothing before the beginning, at t = 0: the shutter opens later.
        let (from, to) = ((own - self.open / 2.0).max(0.0), own + self.open / 2.0);
        let time = if self.open > 0.0 { from + (to - from) * place } else { own };
        let angle = self.orbit.map(|orbit| orbit.angle(frame as f64 + (place - 0.5) * self.part, time));
        Moment { frame, time, angle, is_own: false }
    }

    /// The moments of a frame, each in the middle of its share of the open time.
    fn moments(&self, frame: usize, count: usize) -> impl Iterator<Item = Moment> {
        let own = self.times[frame];
        let angle = self.orbit.map(|orbit| orbit.angle(frame as f64, own));
        (0..count).map(move |i| match count {
            1 => Moment { frame, time: own, angle, is_own: true },
            _ => {
                let moment = self.moment(frame, (i as f64 + 0.5) / count as f64);
                Moment { is_own: i == count / 2, ..moment }
            }
        })
    }
}

/// Moments in the order of time: those of frames near to one another may overlap.
fn sorted(mut moments: Vec<Moment>) -> Vec<Moment> {
    moments.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.frame.cmp(&b.frame)));
    moments
}

/// How many moments it takes, if the fastest thing moves by so many pixels in the fastest of the intervals that have been measured.
fn count(pixels: f64, has_changed: bool) -> usize {
    let wanted = (pixels * PROBED as f64 / STEP).ceil().min(MOST as f64) as usize;
    let wanted = if has_changed { wanted.max(CHANGED) } else { wanted };
    wanted.max(1) / 2 * 2 + 1
}

impl Moments {
    /// Measures the motion and chooses the moments; `None` without `--shutter`.
    pub fn plan(
        render: &Render<'_>,
        writer: &FrameWriter,
        clock: &mut Clock,
    ) -> Result<Option<Moments>, Failure> {
        let Some(part) = render.args.shutter.filter(|part| *part > 0.0) else { return Ok(None) };
        let times = &render.run.times;
        let shared = &render.args.shared;
        let open = match step(shared, &render.run.session) {
            _ if turntable::stands(times) => 0.0,
            Some(step) => part * step,
            None => {
                return Err(Failure::Usage(
                    "error: --shutter is a part of the time between frames, and the model has no `frames`\n\n  \
                     = help: declare them, `frames 0 .. 10 step 0.04`, or say it with `--from A --to B --step S`; one frame is `--from T --to T --step S`\n"
                        .to_owned(),
                ));
            }
        };
        let shutter = Shutter { times, part, open, orbit: Orbit::new(render.args, times) };
        let probes = (0..times.len()).flat_map(|frame| {
            let shutter = &shutter;
            (0..=PROBED).map(move |i| shutter.moment(frame, i as f64 / PROBED as f64))
        });
        let probes = sorted(probes.collect());
        let mut progress = render.bar("measuring", times.len());
        let mut last: HashMap<usize, (Positions, usize)> = HashMap::new();
        let mut fastest = vec![(0.0_f64, false); times.len()];
        play_at(
            render.run,
            probes.iter().map(|probe| probe.time).collect(),
            render.writing(&writer.fit),
            render.threads,
            (clock, None),
            |frame: &Frame, scene: &Scene| {
                let probe = probes[frame.index];
                (probe.frame, turntable::turned(writer, probe.angle).positions(scene))
            },
            |(frame, positions)| {
                let mut passed = 0;
                if let Some((before, count)) = last.remove(&frame) {
                    let motion = before.motion(&positions);
                    let (pixels, has_changed) = &mut fastest[frame];
                    *pixels = pixels.max(motion.pixels);
                    *has_changed |= motion.has_changed;
                    passed = count + 1;
                }
                match passed {
                    PROBED => progress.inc(),
                    _ => drop(last.insert(frame, (positions, passed))),
                }
                if (render.stale)() { Err(Failure::Stale) } else { Ok(()) }
            },
        )?;
        let counts: Vec<usize> =
            fastest.iter().map(|&(pixels, has_changed)| count(pixels, has_changed)).collect();
        let moments = (0..times.len()).flat_map(|frame| shutter.moments(frame, counts[frame]));
        let moments = sorted(moments.collect());
        let coarse = fastest.iter().map(|(pixels, _)| pixels * PROBED as f64);
        let coarse = coarse
            .filter(|pixels| *pixels > 2.0 * STEP * MOST as f64)
            .fold((0, 0.0), |(frames, most), pixels| (frames + 1, pixels.max(most)));
        Ok(Some(Moments { moments, counts, coarse }))
    }

    /// Draws all moments, and passes the record and the pixels of each frame to `take`, in order.
    pub fn expose(
        &self,
        render: &Render<'_>,
        writer: &FrameWriter,
        clock: &mut Clock,
        mut take: impl FnMut(FrameRecord, Vec<u8>) -> Result<(), Failure>,
    ) -> Result<Stats, Failure> {
        let mut writer = writer.clone();
        writer.threads = (render.threads / self.moments.len().max(1)).max(1);
        let has_opacity = writer.page.background.is_none();
        let mut open: BTreeMap<usize, (Exposure, Option<FrameRecord>, usize)> = BTreeMap::new();
        play_at(
            render.run,
            self.moments.iter().map(|moment| moment.time).collect(),
            render.writing(&writer.fit),
            render.threads_for(&writer.page),
            (clock, None),
            |frame: &Frame, scene: &Scene| {
                let moment = self.moments[frame.index];
                let (index, time) = (moment.frame, render.run.times[moment.frame]);
                let own = moment.is_own.then(|| FrameRecord {
                    index,
                    time,
                    ..record(&writer.fit, frame, scene, render.file(index))
                });
                (index, own, turntable::turned(&writer, moment.angle).pixels(scene))
            },
            |(index, own, pixels)| {
                let empty = || (Exposure::new(has_opacity), None, 0);
                let (exposure, record, count) = open.entry(index).or_insert_with(empty);
                exposure.add(pixels);
                *record = own.or(record.take());
                *count += 1;
                // In order: frames are open for equally long times, so an earlier one is never done later.
                while let Some(first) = open.first_entry() {
                    if first.get().2 < self.counts[*first.key()] {
                        break;
                    }
                    let (exposure, record, _) = first.remove();
                    if let Some(record) = record {
                        take(record, exposure.finish())?;
                    }
                }
                Ok(())
            },
        )
    }

    /// A line about them.
    pub fn note(&self) -> String {
        let mut line = format!("  shutter: {} in all", count_of(self.moments.len(), "moment"));
        let (frames, pixels) = self.coarse;
        if frames > 0 {
            line += &format!(
                "; in {} something moves by up to {} pixels, {} from moment to moment",
                count_of(frames, "frame"),
                brief(pixels, 2),
                brief(pixels / MOST as f64, 2)
            );
        }
        line + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_moments_as_pixels_and_an_odd_number() {
        let counts = [0.0, 0.25, 0.26, 1.0, 10.0, 1e9].map(|pixels| count(pixels, false));
        assert_eq!(counts, [1, 1, 3, 5, 41, MOST]);
        assert_eq!([0.0, 10.0].map(|pixels| count(pixels, true)), [CHANGED, 41]);
    }

    #[test]
    fn moments_fill_the_open_time_around_their_frame_and_begin_at_the_beginning() {
        let shutter = Shutter { times: &[0.0, 1.0], part: 0.5, open: 0.5, orbit: None };
        let times = |frame, count| -> Vec<f64> { shutter.moments(frame, count).map(|m| m.time).collect() };
        assert_eq!((times(1, 5), times(1, 1)), (vec![0.8, 0.9, 1.0, 1.1, 1.2], vec![1.0]));
        assert_eq!((times(0, 5), times(0, 1)), (vec![0.025, 0.075, 0.125, 0.175, 0.225], vec![0.0]));
        let own: Vec<bool> = shutter.moments(1, 3).map(|m| m.is_own).collect();
        assert_eq!(own, [false, true, false]);
    }
}
