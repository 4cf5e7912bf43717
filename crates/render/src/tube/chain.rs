//! Segments that continue one another, cut into parts: where the width steps, the thinner stem widens smoothly
//! towards the thicker one, and collars need corners of their own.
//!
//! A blend depends on places along the stem alone, so it is the same however the stem is divided into segments.

use super::collar::Collar;
use dlsys_geometry::scene::Segment;

/// Widths that differ by less than this part do not make a step.
const EQUAL: f64 = 1e-9;
/// Length of a blend in parts of its height.
const LENGTH: f64 = 2.5;
/// Most that a blend adds to the thinner radius, in parts of it; beyond that there is a flat shoulder.
const MOST: f64 = 1.0;

/// A part of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) segment: usize,
    /// Its ends in parts of the segment.
    pub(super) ends: [f64; 2],
    pub(super) radii: [f64; 2],
    /// Whether it is within the collar of its stem.
    pub(super) in_collar: bool,
}

/// Stems that continue one another.
pub(super) struct Chain<'a> {
    pub(super) segments: &'a [Segment],
    pub(super) radii: &'a [[f64; 2]],
    /// Its segments in order.
    pub(super) members: &'a [usize],
    /// See [`Tubes::new`](super::Tubes::new); 0 if it is not known.
    pub(super) accuracy: f64,
}

/// The widening of a stem towards a thicker one that it continues, or that continues it.
struct Blend {
    /// Where both meet, as a length along the chain.
    at: f64,
    /// On the members from this one on, or on those before it.
    member: usize,
    forwards: bool,
    height: f64,
    length: f64,
    /// From 0, a fillet at the thinner stem only, to 1, without an edge at the thicker one either.
    smooth: f64,
}

impl Blend {
    /// What it adds to the radius of a member at a length along the chain.
    fn height(&self, member: usize, at: f64) -> f64 {
        let away = if self.forwards { at - self.at } else { self.at - at };
        if (member >= self.member) != self.forwards || away >= self.length {
            return 0.0;
        }
        let u = (away / self.length).max(0.0);
        self.height * (1.0 - u) * (1.0 - u) * (1.0 + 2.0 * u * self.smooth)
    }
}

impl Chain<'_> {
    /// Cuts the chain; plain ones into their segments as they are. `grown`: with blends.
    pub(super) fn parts(&self, grown: bool, collar: Option<&Collar>, out: &mut Vec<Part>) {
        let radii = |i: usize| self.radii[self.members[i]];
        let count = self.members.len();
        let steps = |i: &usize| {
            let (a, b) = (radii(i - 1)[1], radii(*i)[0]);
            (a - b).abs() > EQUAL * a.max(b)
        };
        let steps: Vec<usize> = if grown { (1..count).filter(steps).collect() } else { Vec::new() };
        if steps.is_empty() && collar.is_none() {
            out.extend(self.members.iter().map(|&segment| Part {
                segment,
                ends: [0.0, 1.0],
                radii: self.radii[segment],
                in_collar: false,
            }));
            return;
        }
        let lengths: Vec<f64> =
            self.members.iter().map(|&i| (self.segments[i].end - self.segments[i].start).norm()).collect();
        let mut arcs = vec![0.0];
        arcs.extend(lengths.iter().scan(0.0, |sum, length| {
            *sum += length;
            Some(*sum)
        }));
        let blends = self.blends(&steps, &arcs);
        let mut stations: Vec<f64> = blends.iter().flat_map(|blend| self.stations(blend)).collect();
        if let Some(collar) = collar {
            stations.extend(collar.stations(self.accuracy));
        }
        stations.sort_by(f64::total_cmp);
        let reach = collar.map_or(0.0, Collar::reach);
        let mut stations = stations.into_iter().peekable();
        for (member, &segment) in self.members.iter().enumerate() {
            let (start, length) = (arcs[member], lengths[member]);
            let radius = |part: f64| {
                let [a, b] = self.radii[segment];
                let at = start + length * part;
                let plain = if part == 1.0 { b } else { a + (b - a) * part };
                plain + blends.iter().map(|blend| blend.height(member, at)).sum::<f64>()
            };
            let mut from = 0.0;
            loop {
                // Corners that fall together are one.
                let next =
                    stations.next_if(|&at| at < arcs[member + 1]).map_or(1.0, |at| (at - start) / length);
                let to = if 1.0 - next < 1e-6 { 1.0 } else { next };
                if to - from > 1e-6 || to == 1.0 {
                    out.push(Part {
                        segment,
                        ends: [from, to],
                        radii: [radius(from), radius(to)],
                        in_collar: start + length * from < reach,
                    });
                    from = to;
                }
                if to == 1.0 {
                    break;
                }
            }
            // Those that fell upon its end.
            while stations.next_if(|&at| at < arcs[member + 1]).is_some() {}
        }
    }

    fn blends(&self, steps: &[usize], arcs: &[f64]) -> Vec<Blend> {
        let count = self.members.len();
        let blend = |k: usize| {
            let member = steps[k];
            let (before, after) =
                (self.radii[self.members[member - 1]][1], self.radii[self.members[member]][0]);
            let (thin, thick) = (before.min(after), before.max(after));
            let forwards = after < before;
            let height = (thick - thin).min(MOST * thin);
            // The stem goes on as thin as this up to the next step.
            let bound = match forwards {
                true => arcs[steps.get(k + 1).copied().unwrap_or(count)] - arcs[member],
                false => arcs[member] - arcs[if k > 0 { steps[k - 1] } else { 0 }],
            };
            let length = (LENGTH * height).min(0.5 * bound);
            let smooth = (2.0 - (thick - thin) / (MOST * thin)).clamp(0.0, 1.0);
            Blend { at: arcs[member], member, forwards, height, length, smooth }
        };
        (0..steps.len())
            .map(blend)
            .filter(|blend| blend.height > self.accuracy && blend.length > 0.0)
            .collect()
    }

    /// Where a blend needs cross-sections.
    fn stations(&self, blend: &Blend) -> impl Iterator<Item = f64> + use<> {
        // A chord over 1/n of a curve with the second derivative 6 is 6/8 of 1/n² away from it.
        let pieces = match self.accuracy {
            0.0 => 4,
            accuracy => [2, 4, 8]
                .into_iter()
                .find(|&n| 0.75 * blend.height <= accuracy * f64::from(n * n))
                .unwrap_or(8),
        };
        let sign = if blend.forwards { 1.0 } else { -1.0 };
        let (at, step) = (blend.at, sign * blend.length / f64::from(pieces));
        (1..=pieces).map(move |k| at + step * f64::from(k))
    }
}
