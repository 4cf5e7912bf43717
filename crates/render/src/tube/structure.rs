//! How the segments of a scene hang together: which of them share a ring, and how each tube begins.

use super::chain::Within;
use super::collar::Ahead;
use super::{Begin, Collar, NONE, SHARPEST, TubeStyle, can_join, chain};
use dlsys_geometry::scene::{Scene, Segment};

/// A branch is wider than what goes on along the axis from this ratio on.
const TAKES_OVER: f64 = 1.02;
/// Between these parts of its width, a branch at the end of an axis changes from one that comes out of a collar to one that the axis
/// goes on into. Two equal branches that share the cross-section of their stem have 0.71 of its width, three 0.58.
const PARTS: [f64; 2] = [0.42, 0.58];
/// So do thinner ones, of which there are more, while together they get these parts of its cross-section, and each of them these parts of the width of the
/// widest.
const WHOLE: [f64; 2] = [0.5, 0.8];
const ALIKE: [f64; 2] = [0.6, 0.85];
/// And so does each while it grows in length from what its bend needs to this many times that.
const LONG: f64 = 1.8;
/// Most of a segment that a neck takes.
const NECK: f64 = 0.9;
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
    /// The segment at whose end each bends away with a tube of its own, which begins within that segment, or `NONE`; none if that happens nowhere.
    forks: Vec<usize>,
    /// How far it is between a branch with a collar (0) and one that the axis goes on into (1); none if that happens nowhere.
    parting: Vec<f64>,
    /// The segments at whose end an axis goes on into branches, in order, and what happens there.
    pub(super) ends: Vec<usize>,
    joints: Vec<Joint>,
}

/// Where an axis goes on into branches.
#[derive(Clone, Copy, Debug, Default)]
struct Joint {
    /// How far before it all of these are still straight.
    reach: f64,
    /// How far before it the axis' own tube ends: further and further while a branch grows, so that its end is within that branch.
    cut: f64,
    /// The branch that the axis goes on into most, if any, and how much, to 1.
    main: usize,
    part: f64,
}

/// How much of the axis goes on into a branch of which this is the [`parting`](Structure::parting): from 0 to 1.
fn part_of(parting: f64) -> f64 {
    (2.0 * parting - 1.0).max(0.0)
}

impl Structure {
    /// Of the segments that are to be `kept`, in a style: in one that is grown branches may take over.
    pub(super) fn of(segments: &[Segment], style: &TubeStyle, kept: impl Fn(usize) -> bool) -> Structure {
        let TubeStyle { default_width, grown, steady, .. } = *style;
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
            joints: Vec::new(),
        };
        if grown {
            let widest = structure.give_way(segments, &kept);
            structure.fork_ends(segments, &widest, steady, kept);
        }
        structure
    }

    /// Where a branch is wider than what goes on along the axis, the branch is the smooth continuation, and the axis comes out of it in a
    /// collar. One that is wider than the axis ever was is no limb of it, but an organ. Returns how wide the axis of each segment has been up to it.
    fn give_way(&mut self, segments: &[Segment], kept: impl Fn(usize) -> bool) -> Vec<f64> {
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
        for (parent, &branch) in branches.iter().enumerate().filter(|(_, branch)| **branch != NONE) {
            let axis = self.ahead[parent];
            if axis == NONE || self.radii[axis][0] <= 0.0 {
                continue;
            }
            let gives_way = self.radii[branch][0] > TAKES_OVER * self.radii[axis][0];
            let ends = [parent, branch];
            if !gives_way || !self.is_limb(segments, ends, &widest) || !self.can_bend(segments, ends) {
                continue;
            }
            self.leaves.resize(segments.len(), NONE);
            self.leaves[axis] = parent;
            self.continues[axis] = false;
            self.go_on(ends);
        }
        widest
    }

    fn go_on(&mut self, [parent, branch]: [usize; 2]) {
        (self.next[parent], self.ahead[parent], self.continues[branch]) = (branch, branch, true);
    }

    /// Where an axis ends in branches, it goes on into them. The widest of those that it goes on into wholly shares its tube, unless joints are
    /// `steady`.
    fn fork_ends(
        &mut self,
        segments: &[Segment],
        widest: &[f64],
        steady: bool,
        kept: impl Fn(usize) -> bool,
    ) {
        let mut shoots: Vec<[usize; 2]> = Vec::new();
        for (i, segment) in segments.iter().enumerate().filter(|(i, _)| kept(*i)) {
            let parent = segment.grows_from.filter(|_| segment.follows.is_none());
            let Some(parent) = parent.filter(|parent| kept(*parent)) else { continue };
            let ahead = self.ahead[parent];
            if (ahead == NONE || self.radii[ahead][0] <= 0.0) && self.is_limb(segments, [parent, i], widest) {
                shoots.push([parent, i]);
            }
        }
        shoots.sort_by_key(|[parent, _]| *parent);
        if shoots.is_empty() {
            return;
        }
        self.parting.resize(segments.len(), 0.0);
        self.forks.resize(segments.len(), NONE);
        for shoots in shoots.chunk_by(|a, b| a[0] == b[0]) {
            self.part_shoots(segments, shoots);
        }
        let mut mains = Vec::new();
        for shoots in shoots.chunk_by(|a, b| a[0] == b[0]) {
            let mut joint = Joint::default();
            for &ends in shoots {
                let [parent, i] = ends;
                let part = part_of(self.parting[i]);
                if part <= 0.0 && !steady {
                    continue;
                }
                self.forks[i] = parent;
                let wide = self.radii[parent][1].max(self.radii[i][0]);
                let bend = chain::reach_of_bend(ends.map(|i| segments[i].direction), wide);
                let [back, on] = self.straight(segments, ends);
                joint.reach = joint.reach.max(bend + STRAIGHT * wide);
                joint.cut = joint.cut.max(part * bend.min(0.5 * back).min(0.5 * on));
                let wider = |than: usize| self.radii[i][0] > self.radii[than][0];
                if part > joint.part || part > 0.0 && part == joint.part && wider(joint.main) {
                    (joint.main, joint.part) = (i, part);
                }
            }
            let parent = shoots[0][0];
            if shoots.iter().any(|[_, i]| self.forks[*i] != NONE) {
                self.ends.push(parent);
                self.joints.push(joint);
            }
            if joint.part >= 1.0 && !steady {
                self.forks[joint.main] = NONE;
                mains.push([parent, joint.main]);
            }
        }
        // Not before, so that how long stems are straight is the same for all.
        mains.into_iter().for_each(|ends| self.go_on(ends));
    }

    /// How far each of the branches at the end of an axis is between one with a collar and one that the axis goes on into. It changes with their sizes without
    /// a jump, so that nothing jumps in a film.
    fn part_shoots(&mut self, segments: &[Segment], shoots: &[[usize; 2]]) {
        let smooth = |x: f64, [none, all]: [f64; 2]| {
            let u = ((x - none) / (all - none)).clamp(0.0, 1.0);
            u * u * (3.0 - 2.0 * u)
        };
        let width = |i: usize| self.radii[i][0];
        let grown: Vec<f64> = shoots
            .iter()
            .map(|ends| {
                let [from, to] = ends.map(|i| segments[i].direction);
                let half = (from - to).norm() / 2.0;
                let bend = 2.0 * half / (1.0 - half * half).max(1e-6).sqrt();
                let long = self.straight(segments, *ends).into_iter().fold(f64::INFINITY, f64::min);
                smooth(long / (self.radii[ends[0]][1] * bend.max(1.0)), [1.0, LONG])
            })
            .collect();
        let both = || shoots.iter().zip(&grown);
        let wide = self.radii[shoots[0][0]][1];
        let whole = both().map(|([_, i], grown)| (width(*i) / wide).powi(2) * grown).sum::<f64>();
        let widest = both().map(|([_, i], grown)| width(*i) * grown).fold(0.0, f64::max);
        let parting: Vec<f64> = both()
            .map(|([_, i], grown)| {
                let like = if widest > 0.0 { smooth(width(*i) / widest, ALIKE) } else { 0.0 };
                grown * smooth(width(*i) / wide, PARTS).max(like * smooth(whole, WHOLE))
            })
            .collect();
        for ([_, i], parting) in shoots.iter().zip(parting) {
            self.parting[*i] = parting;
        }
    }

    /// Whether a branch may leave a segment, whose axis was as wide as that, smoothly.
    fn is_limb(&self, segments: &[Segment], [parent, branch]: [usize; 2], widest: &[f64]) -> bool {
        let (end, width) = (self.radii[parent][1], self.radii[branch][0]);
        let (from, to) = (&segments[parent], &segments[branch]);
        end > 0.0
            && width <= LIMB * widest[parent]
            && from.contour == to.contour
            && from.direction.dot(&to.direction) >= SHARPEST
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
        let reach = self.joint(parent).reach;
        let along = segments[parent].direction;
        let before = |at: &usize| {
            let before = segments[*at].follows.filter(|before| self.next[*before] == *at)?;
            (segments[before].direction.cross(&along).norm() < 1e-6).then_some(before)
        };
        let mut run: Vec<usize> = std::iter::successors(Some(parent), before).collect();
        run.reverse();
        let within = Within { run: run.len(), reach, part: part_of(self.parting[first]) };
        (run, within)
    }

    /// What happens at the end of a segment.
    fn joint(&self, end: usize) -> Joint {
        self.ends.binary_search(&end).map_or_else(|_| Joint::default(), |at| self.joints[at])
    }

    /// How far before the end of a segment the tube ends whose last segment this is.
    pub(super) fn cut(&self, last: usize) -> f64 {
        self.joint(last).cut
    }

    /// Whether a tube begins with this segment that may begin within another one.
    fn is_shoot(&self, first: usize) -> bool {
        self.forks.get(first).is_some_and(|parent| *parent != NONE)
    }

    /// How a segment begins at the end of an axis that goes on into it: how wide, and for how long it is wider than by itself.
    pub(super) fn neck(&self, segments: &[Segment], i: usize) -> Option<[f64; 2]> {
        let parent = self.forks.get(i).copied().filter(|parent| *parent != NONE)?;
        let (wide, own) = (self.radii[parent][1], self.radii[i][0]);
        let change = (wide - own).max(0.0);
        let wanted = chain::length_of_fork(wide.max(own), change);
        let length = wanted.min(NECK * (segments[i].end - segments[i].start).norm());
        // Where there is no room for it, it has less of a shoulder.
        Some([own + change * part_of(self.parting[i]) * (length / wanted).min(1.0), length])
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

    /// Whether there is anything to see of a segment; `steady`: or may be in another frame, of a joint.
    pub(super) fn is_visible(&self, i: usize, steady: bool) -> bool {
        self.radii[i][0] > 0.0 || self.radii[i][1] > 0.0 || steady && self.is_shoot(i)
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
            let joint = self.joint(parent);
            let ahead = Some(self.ahead[parent]).filter(|&i| i != NONE && self.radii[i][0] > 0.0);
            let (ahead, part) = match joint.part > 0.0 {
                true => (Some(joint.main), joint.part),
                false => (ahead, 1.0),
            };
            // A stem that gets wider at the joint is as wide there as what goes on.
            let goes_on = |&i: &usize| self.next[parent] == i || joint.part > 0.0;
            let end = self.radii[parent][1];
            let wider = ahead.filter(goes_on).map_or(0.0, |i| (self.radii[i][0] - end).max(0.0) * part);
            let thickness = end + wider;
            let ahead = ahead.map(|i| {
                let (direction, radius) = (scene.segments[i].direction, self.radii[i][0]);
                Ahead { direction, radius, part, ends: joint.part > 0.0 }
            });
            let back = (scene.segments[parent].direction, thickness);
            let parting = self.parting.get(first).copied().unwrap_or(0.0);
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
