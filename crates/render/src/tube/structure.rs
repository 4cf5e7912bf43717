//! How the segments of a scene hang together: which of them share a ring, and how each tube begins.

use super::chain::Within;
use super::{Begin, Collar, NONE, TubeStyle, can_join, chain};
use dlsys_geometry::scene::{Scene, Segment};

/// A branch is wider than what goes on along the axis from this ratio on.
const TAKES_OVER: f64 = 1.02;
/// A branch goes on from the end of an axis, which narrows to it, from this part of its width on. Two equal branches that share
/// the cross-section of their stem have 0.71 of its width, three 0.58.
const GOES_ON: f64 = 0.5;
/// Between these parts of its width, a further branch at the end of an axis changes from one that comes out of a collar to one that the axis
/// goes on into as well; and so it does while it grows in length from what its bend needs to this many times that.
const PARTS: [f64; 2] = [0.42, 0.62];
const LONG: f64 = 2.4;
/// Stems that part are straight up to this part of their radius before the first of them turns.
const STRAIGHT: f64 = 0.3;
/// A branch that is wider than the axis ever was by this ratio is no limb of it.
const LIMB: f64 = 1.001;

/// Whether a stem of this radius that begins with a segment stands on a floor, or on the height 0 if there is none: it is cut there.
pub(crate) fn stands(segment: &Segment, radius: f64, floor: Option<f64>) -> bool {
    let height = segment.start.y - floor.unwrap_or(0.0);
    height.abs() <= 1e-6 * radius && segment.direction.y >= 0.5
}

/// How segments hang together.
pub(super) struct Structure {
    pub(super) radii: Vec<[f64; 2]>,
    /// The segment that shares the ring at the end of each, or `NONE`.
    pub(super) next: Vec<usize>,
    /// The segment that goes on from the end of each on the same axis, with or without a common ring, or `NONE`.
    ahead: Vec<usize>,
    pub(super) continues: Vec<bool>,
    /// The segment that each leaves as a branch does, although it goes on along its axis, or `NONE`; none if that happens nowhere.
    leaves: Vec<usize>,
    /// The segment at whose end each bends away beside the branch that goes on from there, or `NONE`; none if that happens nowhere.
    forks: Vec<usize>,
    /// How far it is between a branch with a collar (0) and one that the axis goes on into (1); none if that happens nowhere.
    parting: Vec<f64>,
    /// The segments at whose end an axis goes on into branches, in order, and how far before it all of these are still straight.
    pub(super) ends: Vec<usize>,
    reaches: Vec<f64>,
}

impl Structure {
    /// Of the segments that are to be `kept`; `grown`: branches may take over.
    pub(super) fn of(
        segments: &[Segment],
        default_width: f64,
        grown: bool,
        kept: impl Fn(usize) -> bool,
    ) -> Structure {
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
        let mut structure = Structure {
            radii,
            next,
            ahead,
            continues,
            leaves: Vec::new(),
            forks: Vec::new(),
            parting: Vec::new(),
            ends: Vec::new(),
            reaches: Vec::new(),
        };
        if grown {
            structure.give_way(segments, kept);
        }
        structure
    }

    /// Where a branch is wider than what goes on along the axis, the branch is the smooth continuation, and the axis comes out of it in a
    /// collar. Where an axis ends in branches, the widest of them goes on from it. One that is wider than the axis ever was is no
    /// limb of it, but an organ.
    fn give_way(&mut self, segments: &[Segment], kept: impl Fn(usize) -> bool) {
        let mut widest: Vec<f64> = Vec::with_capacity(segments.len());
        let mut branches: Vec<usize> = vec![NONE; segments.len()];
        for (i, segment) in segments.iter().enumerate() {
            let own = self.radii[i][0].max(self.radii[i][1]);
            widest.push(segment.follows.map_or(own, |before| own.max(widest[before])));
            let Some(parent) = segment.grows_from.filter(|_| segment.follows.is_none()) else { continue };
            let known = branches[parent];
            if kept(i) && kept(parent) && (known == NONE || self.radii[i][0] > self.radii[known][0]) {
                branches[parent] = i;
            }
        }
        let mut ends = Vec::new();
        for (parent, &branch) in branches.iter().enumerate().filter(|(_, branch)| **branch != NONE) {
            let axis = self.ahead[parent];
            let on = if axis == NONE { 0.0 } else { self.radii[axis][0] };
            let gives_way =
                if on > 0.0 { self.radii[branch][0] > TAKES_OVER * on } else { self.goes_on(parent, branch) };
            if !gives_way || !self.is_limb(segments, [parent, branch], &widest) {
                continue;
            }
            if axis != NONE {
                self.leaves.resize(segments.len(), NONE);
                self.leaves[axis] = parent;
                self.continues[axis] = false;
            }
            (self.next[parent], self.ahead[parent], self.continues[branch]) = (branch, branch, true);
            if axis == NONE {
                ends.push(parent);
            }
        }
        ends.sort_unstable();
        self.reaches = ends.iter().map(|&end| self.reach(segments, [end, self.next[end]])).collect();
        for (i, segment) in segments.iter().enumerate().filter(|(i, _)| !self.continues[*i]) {
            let Some(parent) = segment.grows_from.filter(|_| segment.follows.is_none() && kept(i)) else {
                continue;
            };
            let Ok(end) = ends.binary_search(&parent) else { continue };
            if !self.is_limb(segments, [parent, i], &widest) {
                continue;
            }
            self.parting.resize(segments.len(), 0.0);
            self.parting[i] = self.parts(segments, [parent, i]);
            if self.parting[i] > 0.5 {
                self.forks.resize(segments.len(), NONE);
                self.forks[i] = parent;
                self.reaches[end] = self.reaches[end].max(self.reach(segments, [parent, i]));
            }
        }
        self.ends = ends;
    }

    /// How far a branch at the end of an axis is between one with a collar and one that the axis goes on into. It changes with its size without
    /// a jump, so that nothing jumps in a film.
    fn parts(&self, segments: &[Segment], ends: [usize; 2]) -> f64 {
        let [from, to] = ends.map(|i| segments[i].direction);
        let (wide, width) = (self.radii[ends[0]][1], self.radii[ends[1]][0]);
        let half = (from - to).norm() / 2.0;
        let need = wide * (2.0 * half / (1.0 - half * half).max(1e-6).sqrt()).max(1.0);
        let long = self.straight(segments, ends).into_iter().fold(f64::INFINITY, f64::min);
        let smooth = |u: f64| {
            let u = u.clamp(0.0, 1.0);
            u * u * (3.0 - 2.0 * u)
        };
        let [least, most] = PARTS;
        smooth((width / wide - least) / (most - least)) * smooth((long / need - 1.0) / (LONG - 1.0))
    }

    /// How far before the end of a segment a branch that goes on from there is still straight.
    fn reach(&self, segments: &[Segment], [parent, branch]: [usize; 2]) -> f64 {
        let wide = self.radii[parent][1].max(self.radii[branch][0]);
        chain::reach_of_bend([segments[parent].direction, segments[branch].direction], wide) + STRAIGHT * wide
    }

    /// Whether a branch is wide enough to go on from the end of an axis.
    fn goes_on(&self, end: usize, branch: usize) -> bool {
        self.radii[branch][0] >= GOES_ON * self.radii[end][1]
    }

    /// Whether a branch may leave a segment, whose axis was as wide as that, smoothly.
    fn is_limb(&self, segments: &[Segment], [parent, branch]: [usize; 2], widest: &[f64]) -> bool {
        let (end, width) = (self.radii[parent][1], self.radii[branch][0]);
        let (from, to) = (&segments[parent], &segments[branch]);
        end > 0.0
            && width <= LIMB * widest[parent]
            && from.contour == to.contour
            && self.can_bend(segments, [parent, branch])
    }

    /// Whether a branch can share the ring at the end of a segment. Where it is not much thinner or thicker, its width tapers through the bend, so that there
    /// is no shoulder; and how stems are divided into segments makes no difference.
    fn can_bend(&self, segments: &[Segment], [parent, branch]: [usize; 2]) -> bool {
        let (from, to) = (&segments[parent], &segments[branch]);
        let radii = [self.radii[parent][1], self.radii[branch][0]];
        let (thin, thick) = (radii[0].min(radii[1]), radii[0].max(radii[1]));
        if thick > (1.0 + chain::MOST) * thin {
            return can_join(from, to, radii);
        }
        let [back, on] = self.straight(segments, [parent, branch]);
        let as_long = |segment: &Segment, length: f64| Segment {
            end: segment.start + segment.direction * length,
            ..segment.clone()
        };
        can_join(&as_long(from, back), &as_long(to, on), [thick; 2])
    }

    /// For how long a stem is straight up to the end of one segment, and from the beginning of another on.
    fn straight(&self, segments: &[Segment], [parent, branch]: [usize; 2]) -> [f64; 2] {
        let length = |segment: &Segment| (segment.end - segment.start).norm();
        let goes_straight =
            |a: usize, b: usize| segments[a].direction.cross(&segments[b].direction).norm() < 1e-6;
        let before = |at: &usize| segments[*at].follows.filter(|before| goes_straight(*before, *at));
        let after =
            |at: &usize| Some(self.ahead[*at]).filter(|after| *after != NONE && goes_straight(*at, *after));
        let back: f64 = std::iter::successors(Some(parent), before).map(|i| length(&segments[i])).sum();
        let on: f64 = std::iter::successors(Some(branch), after).map(|i| length(&segments[i])).sum();
        [back, on]
    }

    /// The straight run of segments at the end of which the tube bends away whose first segment this is; an empty one where none does so.
    pub(super) fn fork(&self, segments: &[Segment], first: usize) -> (Vec<usize>, Within) {
        let Some(parent) = self.forks.get(first).copied().filter(|parent| *parent != NONE) else {
            return (Vec::new(), Within::default());
        };
        let reach = self.ends.binary_search(&parent).map_or(0.0, |end| self.reaches[end]);
        let along = segments[parent].direction;
        let before = |at: &usize| {
            let before = segments[*at].follows.filter(|before| self.next[*before] == *at)?;
            (segments[before].direction.cross(&along).norm() < 1e-6).then_some(before)
        };
        let mut run: Vec<usize> = std::iter::successors(Some(parent), before).collect();
        run.reverse();
        let within = Within { run: run.len(), reach, part: 2.0 * self.parting[first] - 1.0 };
        (run, within)
    }

    /// The segment that this one comes out of as a branch.
    fn parent(&self, segments: &[Segment], i: usize) -> Option<usize> {
        match segments[i].follows {
            None => segments[i].grows_from,
            Some(_) => self.leaves.get(i).copied().filter(|parent| *parent != NONE),
        }
    }

    /// How far before its start a tube is to begin whose first segment this is. An axis that leaves its stem where that bends away begins
    /// where the stem is still straight, within it.
    pub(super) fn before(&self, segments: &[Segment], first: usize) -> f64 {
        let parent = self.leaves.get(first).copied().filter(|parent| *parent != NONE);
        let Some(parent) = parent else { return 0.0 };
        let along = segments[parent].direction;
        let wide = self.radii[parent][1].max(self.radii[self.ahead[parent]][0]);
        let wanted = chain::reach_of_bend([along, segments[self.ahead[parent]].direction], wide) + wide;
        let (mut straight, mut at) = (0.0, parent);
        while straight < wanted && segments[at].direction.cross(&along).norm() < 1e-6 {
            straight += (segments[at].end - segments[at].start).norm();
            let Some(before) = segments[at].follows else { break };
            at = before;
        }
        wanted.min(straight)
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
        let parent = self.parent(&scene.segments, first);
        if radius <= 0.0 || segment.follows.is_some() && parent.is_none() {
            return (Begin::Dome, None);
        }
        if let Some(parent) = parent {
            let ahead = Some(self.ahead[parent]).filter(|&i| i != NONE && self.radii[i][0] > 0.0);
            // A stem that gets wider at the joint is as wide there as what goes on.
            let joined = ahead.filter(|&i| self.next[parent] == i).map_or(0.0, |i| self.radii[i][0]);
            let thickness = self.radii[parent][1].max(joined);
            let ahead = ahead.map(|i| (scene.segments[i].direction, self.radii[i][0]));
            let back = (scene.segments[parent].direction, thickness);
            let parting = self.parting.get(first).filter(|_| !style.steady).copied().unwrap_or(0.0);
            let place = [start.coords, segment.direction];
            let part = (1.0 - 2.0 * parting).max(0.0);
            let collar = Collar::of_branch(place, radius, back, ahead, (style.accuracy, part));
            // A thicker one would show its cut.
            let begin = if radius <= 1.001 * thickness { Begin::Flat } else { Begin::Dome };
            return (begin, collar.filter(|_| begin == Begin::Flat));
        }
        if !stands(segment, radius, style.floor) {
            return (Begin::Dome, None);
        }
        let ground = style.floor.unwrap_or(0.0);
        let even = self.even_length(&scene.segments, first);
        let floor = style.floor.filter(|_| even > 0.0);
        let foot = floor.map(|_| Collar::of_foot(start, segment.direction, radius, (ground, even)));
        (Begin::Flat, foot)
    }

    /// For how long a stem goes on straight and without a step in its width.
    fn even_length(&self, segments: &[Segment], first: usize) -> f64 {
        let along = segments[first].direction;
        let (mut length, mut at) = (0.0, first);
        loop {
            length += (segments[at].end - segments[at].start).norm();
            let next = self.next[at];
            if next == NONE
                || segments[next].direction.cross(&along).norm() > 1e-6
                || (self.radii[next][0] - self.radii[at][1]).abs() > 1e-9 * self.radii[at][1]
            {
                return length;
            }
            at = next;
        }
    }
}
