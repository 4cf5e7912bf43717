//! How the segments of a scene hang together: which of them share a ring, and how each tube begins.

use super::{Begin, Collar, NONE, TubeStyle, can_join};
use dlsys_geometry::scene::{Scene, Segment};

/// How segments hang together.
pub(super) struct Structure {
    pub(super) radii: Vec<[f64; 2]>,
    /// The segment that shares the ring at the end of each, or `NONE`.
    pub(super) next: Vec<usize>,
    /// The segment that goes on from the end of each on the same axis, with or without a common ring, or `NONE`.
    ahead: Vec<usize>,
    pub(super) continues: Vec<bool>,
}

impl Structure {
    pub(super) fn of(segments: &[Segment], default_width: f64, kept: impl Fn(usize) -> bool) -> Structure {
        let radii: Vec<[f64; 2]> =
            segments.iter().map(|s| s.widths.map(|w| w.resolve(default_width) / 2.0)).collect();
        let mut next = vec![NONE; segments.len()];
        let mut ahead = vec![NONE; segments.len()];
        let mut continues = vec![false; segments.len()];
        for (i, segment) in segments.iter().enumerate() {
            let Some(before) = segment.follows else { continue };
            ahead[before] = i;
            if next[before] == NONE
                && kept(before)
                && kept(i)
                && segments[before].contour == segment.contour
                && radii[before][1] > 0.0
                && radii[i][0] > 0.0
                && can_join(&segments[before], segment, [radii[before][1], radii[i][0]])
            {
                next[before] = i;
                continues[i] = true;
            }
        }
        Structure { radii, next, ahead, continues }
    }

    pub(super) fn is_visible(&self, i: usize) -> bool {
        self.radii[i][0] > 0.0 || self.radii[i][1] > 0.0
    }

    /// How the tube begins whose first segment this is, and its collar.
    pub(super) fn beginning(
        &self,
        scene: &Scene,
        first: usize,
        style: &TubeStyle,
    ) -> (Begin, Option<Collar>) {
        let segment = &scene.segments[first];
        let (start, radius) = (segment.start, self.radii[first][0]);
        if radius <= 0.0 || segment.follows.is_some() {
            return (Begin::Dome, None);
        }
        if let Some(parent) = segment.grows_from {
            let thickness = self.radii[parent][1];
            let ahead = Some(self.ahead[parent]).filter(|&i| i != NONE && self.radii[i][0] > 0.0);
            let ahead = ahead.map(|i| (scene.segments[i].direction, self.radii[i][0]));
            let back = (scene.segments[parent].direction, thickness);
            let collar =
                Collar::of_branch([start.coords, segment.direction], radius, back, ahead, style.accuracy);
            // A thicker one would show its cut.
            let begin = if radius <= 1.001 * thickness { Begin::Flat } else { Begin::Dome };
            return (begin, collar.filter(|_| begin == Begin::Flat));
        }
        let ground = style.floor.unwrap_or(0.0);
        if (start.y - ground).abs() > 1e-6 * radius || segment.direction.y < 0.5 {
            return (Begin::Dome, None);
        }
        let foot = style.floor.map(|_| Collar::of_foot(start, segment.direction, radius, ground));
        (Begin::Flat, foot)
    }
}
