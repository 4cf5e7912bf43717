//! Segments that continue one another, cut into parts: where the width steps, the thinner stem widens smoothly
//! towards the thicker one, or tapers through a bend; bends are round; and collars need cross-sections of their own.
//!
//! Blends, tapers and bends depend on places along the stem alone, so they are the same however the stem is divided into segments.

use super::NONE;
use super::collar::{Collar, Pieces, Station};
use dlsys_geometry::scene::{Point, Segment, Vector};

/// Widths that differ by less than this part do not make a step.
const EQUAL: f64 = 1e-9;
/// Length of a blend in parts of its height, and in parts of the thinner radius where that is more.
const LENGTH: f64 = 2.5;
const LEAST: f64 = 1.2;
/// Most that a blend adds to the thinner radius, in parts of it; beyond that there is a flat shoulder.
pub(super) const MOST: f64 = 1.0;

/// Segments are straight on from one another if the sine of their angle is less.
const STRAIGHT: f64 = 1e-6;
/// Radius of a bend, in parts of the stem's radius.
const ROUNDING: f64 = 2.5;
/// Pieces of a taper on either side of its bend.
const TAPER_PIECES: f64 = 3.0;
/// Where a stem forks, it keeps its width up to the joint, and each shoot tapers behind it: over this part of the stem's radius, and that of
/// the change of it.
const FORK: f64 = 1.2;
const FORK_CHANGE: f64 = 3.0;
/// Pieces of that.
const FORK_PIECES: f64 = 8.0;
/// Where there are as many cross-sections in all frames, those of a shoot that an axis may go on into: in parts of the reach of its bend and of its taper,
/// all on its first segment; a collar has as many.
const BEND_STATIONS: [f64; 2] = [0.5, 1.0];
const TAPER_STATIONS: [f64; 4] = [0.2, 0.45, 0.7, 1.0];
/// Those before the joint: where it begins and those of its bend.
const RUN_STATIONS: usize = 3;
/// Pieces of a collar there, and of one elsewhere.
const SHOOT_PIECES: u8 = (RUN_STATIONS + BEND_STATIONS.len() + TAPER_STATIONS.len() - 1) as u8;
const COLLAR_PIECES: u8 = 3;

/// A part of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) segment: usize,
    /// The middle of its ends.
    pub(super) centres: [Point; 2],
    /// The unit vector from one to the other.
    pub(super) direction: Vector,
    pub(super) radii: [f64; 2],
    /// Whether it is within the collar of its stem, and how far its end [follows](Station::drape)
    /// the collar's edge.
    pub(super) in_collar: bool,
    pub(super) drape: f64,
}

/// Stems that continue one another.
pub(super) struct Chain<'a> {
    pub(super) segments: &'a [Segment],
    pub(super) radii: &'a [[f64; 2]],
    /// Its segments in order.
    pub(super) members: &'a [usize],
    /// The segments at whose end an axis forks.
    pub(super) forks: &'a [usize],
    /// How it begins within another stem.
    pub(super) within: Within,
    /// See [`TubeStyle`](super::TubeStyle).
    pub(super) accuracy: f64,
    pub(super) steady: bool,
    /// Whether it begins as a shoot that its axis may go on into.
    pub(super) is_shoot: bool,
}

/// How a stem begins within another one, which goes on into it and into others.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Within {
    /// How many segments of its chain are the other stem's; 0: it does not.
    pub(super) run: usize,
    /// How far before the end of these it begins.
    pub(super) reach: f64,
    /// How much of the other stem's width it has there, from none of the difference, 0, to all of it.
    pub(super) part: f64,
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

/// A place where a stem turns, rounded by a parabola (a quadratic Bézier curve) that begins and ends on its segments.
struct Bend {
    /// The member that begins there.
    member: usize,
    /// Where it is, as a length along the chain, and how far from there it begins and ends.
    at: f64,
    reach: f64,
    point: Point,
    directions: [Vector; 2],
    /// Number of pieces on either side.
    pieces: f64,
    /// The width steps there.
    taper: Option<Taper>,
}

/// The smooth change of a stem's width where it turns: half before the bend and half after it, so that it does not bulge there; all of it
/// after the bend where the stem forks, so that its shoots are as wide as the stem where they part.
#[derive(Clone, Copy)]
struct Taper {
    /// What the radius gains.
    change: f64,
    /// How far before the bend it begins, and how far behind it it ends.
    reach: [f64; 2],
}

impl Bend {
    /// The middle of the stem at a length along the chain; `None` where it is on its segment. Between the bend's own cross-sections the stem is
    /// straight, so that one more there, where a segment ends, does not turn the others.
    fn place(&self, at: f64) -> Option<Point> {
        let u = 0.5 + 0.5 * (at - self.at) / self.reach;
        if !(u > 0.0 && u < 1.0) {
            return None;
        }
        let number = 2.0 * self.pieces * u;
        let (low, part) = (number.floor(), number.fract());
        let on_curve = |number: f64| self.on_curve(0.5 * number / self.pieces);
        let low_place = on_curve(low);
        Some(low_place + (on_curve(low + 1.0) - low_place) * part)
    }

    /// A place of the parabola, from 0 at its beginning to 1.
    fn on_curve(&self, u: f64) -> Point {
        let [before, after] = self.directions;
        self.point + (after * (u * u) - before * ((1.0 - u) * (1.0 - u))) * self.reach
    }

    /// What it adds to the radius of a member at a length along the chain.
    fn height(&self, member: usize, at: f64) -> f64 {
        let Some(Taper { change, reach: [before, after] }) = self.taper else { return 0.0 };
        let u = ((at - self.at + before) / (before + after)).clamp(0.0, 1.0);
        let part = u * u * (3.0 - 2.0 * u);
        change * if member < self.member { part } else { part - 1.0 }
    }

    fn stations(&self) -> impl Iterator<Item = f64> + use<> {
        let at = self.at;
        let around = |[before, after]: [f64; 2], pieces: f64| {
            let (step, pieces) = (0.5 * (before + after) / pieces, pieces as i32);
            let middle = at + 0.5 * (after - before);
            (-pieces..=pieces).map(move |k| middle + step * f64::from(k)).filter(move |place| *place != at)
        };
        let taper = self.taper.map(|taper| match taper.reach {
            [0.0, after] => around([0.0, after], 0.5 * FORK_PIECES),
            reach => around(reach, TAPER_PIECES),
        });
        around([self.reach; 2], self.pieces).chain(taper.into_iter().flatten())
    }
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

/// The length of a blend of this height on a stem of this radius, if it is long enough.
fn length_of_blend(radius: f64, height: f64) -> f64 {
    (LENGTH * height).max(LEAST * radius)
}

/// For how long a shoot tapers behind a fork of a stem of this radius, of which it has so much less.
pub(super) fn length_of_fork(radius: f64, change: f64) -> f64 {
    FORK * radius + FORK_CHANGE * change
}

/// How far from a bend a stem of this radius begins to turn, if it is long enough on both sides.
pub(super) fn reach_of_bend(directions: [Vector; 2], radius: f64) -> f64 {
    let half = (directions[0] - directions[1]).norm() / 2.0;
    ROUNDING * radius * half / (1.0 - half * half).max(1e-6).sqrt()
}

/// Places along a stem, moved back as far as it takes that all of them are on its first segment, and apart from one another.
fn on_first(mut places: Vec<f64>, length: f64) -> Vec<f64> {
    places.sort_by(f64::total_cmp);
    let step = length / (places.len() + 1) as f64;
    let mut low = 0.0;
    for (k, place) in places.iter_mut().enumerate() {
        low += 1e-3 * step;
        *place = place.min(step * (k + 1) as f64).max(low);
        low = *place;
    }
    places
}

/// Takes from the parts of a chain those of the straight `run` at its beginning up to where the first of the stems that leave it begins to
/// turn: all of that is another tube's. What is left begins a little within that.
pub(super) fn begin_within(run: &[usize], segments: &[Segment], parts: &mut Vec<Part>) {
    /// By which part of its radius it is thinner where it begins; less and less up to the fork, so that no edge can be seen.
    const THINNER: f64 = 0.006;
    let is_whole =
        |part: &&Part| run.contains(&part.segment) && part.centres[1] == segments[part.segment].end;
    let whole = parts.iter().take_while(is_whole).count();
    // Up to the first cross-section between ends of segments.
    let is_cut = parts.get(whole).is_some_and(|part| run.contains(&part.segment));
    parts.drain(..whole + usize::from(is_cut));
    let shared = parts.iter().take_while(|part| run.contains(&part.segment)).count();
    let length = |part: &Part| (part.centres[1] - part.centres[0]).norm();
    let all: f64 = parts[..shared].iter().map(length).sum();
    let mut left = all;
    for part in &mut parts[..shared] {
        let ends = [left, left - length(part)];
        for (radius, left) in part.radii.iter_mut().zip(ends) {
            *radius *= 1.0 - THINNER * left.max(0.0) / all;
        }
        left = ends[1];
    }
}

/// Makes the straight `run` at the beginning of a chain one segment: cross-sections at the ends of its segments are left out.
pub(super) fn merge(run: &[usize], parts: &mut Vec<Part>) {
    let Some(&end) = run.last() else { return };
    let shared = parts.iter().take_while(|part| run.contains(&part.segment)).count();
    let mut merged: Vec<Part> = Vec::with_capacity(shared);
    let mut segment = NONE;
    for part in parts.drain(..shared) {
        match merged.last_mut().filter(|_| part.segment != segment) {
            Some(before) => {
                (before.centres[1], before.radii[1]) = (part.centres[1], part.radii[1]);
                before.direction =
                    (before.centres[1] - before.centres[0]).try_normalize(0.0).unwrap_or(part.direction);
            }
            None => merged.push(Part { segment: end, ..part }),
        }
        segment = part.segment;
    }
    parts.splice(0..0, merged);
}

/// Ends a stem so far before the end of its last segment; `steady`: with as many parts as it has.
pub(super) fn end_before(cut: f64, steady: bool, parts: &mut Vec<Part>) {
    /// Most of a part that is cut off.
    const MOST_OF_PART: f64 = 0.95;
    let mut left = cut;
    while left > 0.0 {
        let is_only = parts.len() == 1;
        let Some(part) = parts.last_mut() else { return };
        let length = (part.centres[1] - part.centres[0]).norm();
        if !steady && left > MOST_OF_PART * length && !is_only {
            parts.pop();
            left -= length;
            continue;
        }
        let rest = 1.0 - (left / length).min(MOST_OF_PART);
        part.centres[1] = part.centres[0] + (part.centres[1] - part.centres[0]) * rest;
        part.radii[1] = part.radii[0] + (part.radii[1] - part.radii[0]) * rest;
        return;
    }
}

impl Chain<'_> {
    /// Cuts the chain; plain ones into their segments as they are. `grown`: with blends and round bends.
    pub(super) fn parts(&self, grown: bool, collar: Option<&Collar>, out: &mut Vec<Part>) {
        let count = self.members.len();
        let steps: Vec<usize> = (1..count).filter(|&i| grown && self.steps(i)).collect();
        let bends = grown
            && match self.steady {
                true => self.within.run > 0,
                false => (1..count).any(|i| self.needs_rounding(i)),
            };
        if steps.is_empty() && collar.is_none() && !bends && self.within.run == 0 {
            out.extend(self.members.iter().map(|&i| {
                let Segment { start, end, direction, .. } = self.segments[i];
                let radii = self.radii[i];
                Part { segment: i, centres: [start, end], direction, radii, in_collar: false, drape: 0.0 }
            }));
            return;
        }
        let mut arcs = vec![0.0];
        arcs.extend(self.members.iter().scan(0.0, |sum, &i| {
            *sum += (self.segments[i].end - self.segments[i].start).norm();
            Some(*sum)
        }));
        let bends = if bends { self.bends(&steps, &arcs) } else { Vec::new() };
        let blends = self.blends(&steps, &bends, &arcs);
        let plain = |at| Station { at, drape: 0.0 };
        let mut stations: Vec<Station> =
            blends.iter().flat_map(|blend| self.stations(blend)).map(plain).collect();
        let within = self.within;
        if within.run > 0 {
            stations.push(plain(arcs[within.run] - within.reach.min(0.6 * arcs[within.run])));
        }
        match bends.first().filter(|_| self.steady) {
            Some(bend) => stations.extend(self.stations_of_fork(bend, &arcs).map(plain)),
            None => stations.extend(bends.iter().flat_map(Bend::stations).map(plain)),
        }
        if let Some(collar) = collar {
            let free = (1..count).find(|&i| steps.first() == Some(&i) || self.turns(i)).unwrap_or(count);
            let pieces = match (self.steady, self.is_shoot) {
                (true, true) => Pieces::Fixed(SHOOT_PIECES),
                (true, false) => Pieces::Fixed(COLLAR_PIECES),
                (false, _) => Pieces::Within(self.accuracy),
            };
            let mut all = collar.stations(pieces, arcs[free]);
            if self.steady && self.is_shoot {
                let places = on_first(all.iter().map(|station| station.at).collect(), arcs[1]);
                all.iter_mut().zip(places).for_each(|(station, at)| station.at = at);
            }
            stations.extend(all);
        }
        stations.sort_by(|a, b| a.at.total_cmp(&b.at));
        let own = self.members.get(within.run).map_or(0.0, |first| self.radii[*first][0]);
        let reach = collar.map_or(0.0, Collar::reach);
        let (mut near, mut stations) = (0, stations.into_iter().peekable());
        for (member, &segment) in self.members.iter().enumerate() {
            let Segment { start, end, direction, .. } = self.segments[segment];
            let (first, length) = (arcs[member], arcs[member + 1] - arcs[member]);
            let radius = |part: f64| {
                let [a, b] = self.radii[segment];
                let plain = if part == 1.0 { b } else { a + (b - a) * part };
                let plain = if member < within.run { own + (plain - own) * within.part } else { plain };
                let at = first + length * part;
                // Blends do not overlap; of one place the rounding of lengths may count either neighbour as next.
                let next = blends.partition_point(|blend| blend.at <= at);
                let near = &blends[next.saturating_sub(2)..blends.len().min(next + 2)];
                let blended = near.iter().map(|blend| blend.height(member, at)).sum::<f64>();
                // Nor do tapers.
                let next = bends.partition_point(|bend| bend.member <= member);
                let near = &bends[next.saturating_sub(1)..bends.len().min(next + 1)];
                plain + blended + near.iter().map(|bend| bend.height(member, at)).sum::<f64>()
            };
            let mut centre = |part: f64| {
                let at = first + length * part;
                while bends.get(near).is_some_and(|bend| bend.at + bend.reach <= at) {
                    near += 1;
                }
                let straight = match part {
                    0.0 => start,
                    1.0 => end,
                    part => start + (end - start) * part,
                };
                bends.get(near).and_then(|bend| bend.place(at)).map_or((straight, false), |p| (p, true))
            };
            let (mut from, mut begin) = (0.0, centre(0.0));
            while from < 1.0 {
                // Cross-sections that fall together are one.
                let next = stations.next_if(|station| station.at < arcs[member + 1]);
                let (next, drape) = next.map_or((1.0, 0.0), |next| ((next.at - first) / length, next.drape));
                let to = if 1.0 - next < 1e-6 { 1.0 } else { next };
                if to - from < 1e-6 {
                    continue;
                }
                let finish = centre(to);
                let chord = || (finish.0 - begin.0).try_normalize(0.0).unwrap_or(direction);
                out.push(Part {
                    segment,
                    centres: [begin.0, finish.0],
                    direction: if begin.1 || finish.1 { chord() } else { direction },
                    radii: [radius(from), radius(to)],
                    in_collar: first + length * from < reach,
                    drape,
                });
                (from, begin) = (to, finish);
            }
            // Those that fell upon its end.
            while stations.next_if(|station| station.at < arcs[member + 1]).is_some() {}
        }
    }

    /// Where a shoot that its axis goes on into needs cross-sections, as many in all frames.
    fn stations_of_fork(&self, bend: &Bend, arcs: &[f64]) -> impl Iterator<Item = f64> + use<> {
        let (at, reach, first) = (bend.at, bend.reach, arcs[bend.member + 1] - bend.at);
        let taper = bend.taper.map_or(0.0, |taper| taper.reach[1]);
        let bend = BEND_STATIONS.map(|part| part * reach);
        let all = bend.into_iter().chain(TAPER_STATIONS.map(|part| part * taper)).collect();
        let behind = on_first(all, first).into_iter().map(move |place| at + place);
        BEND_STATIONS.into_iter().map(move |part| at - part * reach).chain(behind)
    }

    /// Whether the width steps between a member and the one before.
    fn steps(&self, i: usize) -> bool {
        let (a, b) = self.radii_at(i);
        (a - b).abs() > EQUAL * a.max(b)
    }

    fn radii_at(&self, i: usize) -> (f64, f64) {
        (self.radii[self.members[i - 1]][1], self.radii[self.members[i]][0])
    }

    fn directions_at(&self, i: usize) -> [Vector; 2] {
        [i - 1, i].map(|i| self.segments[self.members[i]].direction)
    }

    /// Whether the stem turns between a member and the one before.
    fn turns(&self, i: usize) -> bool {
        let [before, after] = self.directions_at(i);
        before.cross(&after).norm() > STRAIGHT
    }

    /// Whether the ring in which two members meet stands out by more than the accuracy.
    fn needs_rounding(&self, i: usize) -> bool {
        let [before, after] = self.directions_at(i);
        let (a, b) = self.radii_at(i);
        // 1 / cos(θ/2) - 1, without a loss of digits for a small θ.
        let sine = (before - after).norm() / 2.0;
        let cosine = (1.0 - sine * sine).max(1e-6).sqrt();
        a.max(b) * sine * sine / (cosine * (1.0 + cosine)) > self.accuracy
    }

    /// The bends that are rounded, in order.
    fn bends(&self, steps: &[usize], arcs: &[f64]) -> Vec<Bend> {
        let is_fork = |i: usize| self.steady && i == self.within.run;
        let turns: Vec<usize> = (1..self.members.len()).filter(|&i| self.turns(i) || is_fork(i)).collect();
        let bound = |k: Option<usize>, end: usize| arcs[k.map_or(end, |k| turns[k])];
        let mut bends = Vec::new();
        for (k, &i) in turns.iter().enumerate() {
            let (a, b) = self.radii_at(i);
            let (thin, thick) = (a.min(b), a.max(b));
            let steps = steps.binary_search(&i).is_ok();
            // A shoulder stays as it is.
            let forks = self.forks.binary_search(&self.members[i - 1]).is_ok();
            let is_plain = steps && thick - thin > MOST * thin && !forks || !self.needs_rounding(i);
            if !is_fork(i) && (is_plain || self.steady) {
                continue;
            }
            let back = arcs[i] - bound(k.checked_sub(1), 0);
            let on = bound(Some(k + 1).filter(|k| *k < turns.len()), self.members.len()) - arcs[i];
            let directions = self.directions_at(i);
            let half = (directions[0] - directions[1]).norm() / 2.0;
            let part = if i == self.within.run { self.within.part } else { 1.0 };
            let reach = match is_fork(i) {
                true => reach_of_bend(directions, thick).max(0.1 * thick),
                false => reach_of_bend(directions, thick),
            };
            let reach = reach.min(0.5 * back).min(0.5 * on) * part.max(0.05);
            let point = self.segments[self.members[i]].start;
            // A piece turns by 8 degrees at most.
            let pieces = match is_fork(i) {
                true => BEND_STATIONS.len() as f64,
                false => (half.asin().to_degrees() / 8.0).ceil().max(1.0),
            };
            let taper = (is_fork(i) || steps && thick - thin > self.accuracy).then(|| {
                let reach = if forks {
                    [0.0, length_of_fork(thick, thick - thin).min(0.9 * on)]
                } else {
                    let long = reach.max(0.5 * length_of_blend(thin, thick - thin));
                    [long.min(0.5 * back).min(0.5 * on); 2]
                };
                Taper { change: (b - a) * part, reach }
            });
            bends.push(Bend { member: i, at: arcs[i], reach, point, directions, pieces, taper });
        }
        bends
    }

    /// The blends where the stem goes straight on.
    fn blends(&self, steps: &[usize], bends: &[Bend], arcs: &[f64]) -> Vec<Blend> {
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
            let length = length_of_blend(thin, height).min(0.5 * bound);
            let smooth = (2.0 - (thick - thin) / (MOST * thin)).clamp(0.0, 1.0);
            Blend { at: arcs[member], member, forwards, height, length, smooth }
        };
        let tapers = |step: usize| {
            let bend = bends.binary_search_by_key(&step, |bend| bend.member);
            bend.is_ok_and(|at| bends[at].taper.is_some())
        };
        (0..steps.len())
            .filter(|k| !tapers(steps[*k]))
            .map(blend)
            .filter(|blend| blend.height > self.accuracy && blend.length > 0.0)
            .collect()
    }

    /// Where a blend needs cross-sections.
    fn stations(&self, blend: &Blend) -> impl Iterator<Item = f64> + use<> {
        // A chord over 1/n of a curve with the second derivative 6 is 6/8 of 1/n² away from it.
        let enough = |n: &i32| 0.75 * blend.height <= self.accuracy * f64::from(n * n);
        let pieces = if self.steady { 4 } else { [2, 4, 8].into_iter().find(enough).unwrap_or(8) };
        let sign = if blend.forwards { 1.0 } else { -1.0 };
        let (at, step) = (blend.at, sign * blend.length / f64::from(pieces));
        (1..=pieces).map(move |k| at + step * f64::from(k))
    }
}
