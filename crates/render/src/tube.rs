//! Stems as tubes: rings, domes at the ends, and their vertices and triangles.
//!
//! Segments that continue one another make one closed tube: they share the ring of vertices where they
//! meet, which lies in the plane that halves the bend, and the last ends in a dome. Cross-sections
//! are carried along without twist (parallel transport: each bend turns them by the least rotation). A tube
//! is cut in two where it turns back on itself, or where it bends so much in so short a space that the ring
//! would cut into the segment's other end.
//!
//! In drawings with depth, stems look grown: a branch begins flat inside the stem that it grows from, so that there is
//! no gap, and comes out of it in a [collar](Collar); where the width steps, the thinner part widens to the thicker one
//! ([chain]); a stem that rises from height 0 stands there flat. None of that depends on how stems are divided into segments. In flat
//! drawings, which are diagrams, stems keep their widths and begin in a dome.

mod chain;
mod collar;
mod section;
mod structure;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::ops::Range;

use super::lengths::{CrossSection, Length};
use super::triangles::{Faces, Points, Ring};
use chain::{Chain, Part};
pub(super) use collar::Collar;
use dlsys_geometry::scene::{Point, Scene, Segment, Vector};
use section::Profile;
pub use section::Spoke;
pub(super) use section::{Section, circle, curve, sides_for};
use structure::Structure;
pub(super) use structure::stands;

/// Least cosine of a bend within a tube (100 degrees).
const SHARPEST: f64 = -0.173_648_177_666_930_3;
const NONE: usize = usize::MAX;

/// How stems become tubes.
#[derive(Clone, Copy, Debug)]
pub(super) struct TubeStyle {
    /// Width of a line of default width, in scene units.
    pub(super) default_width: f64,
    /// Number of sides (at least 3); 0: as many as make tubes no further from round ones than `accuracy`.
    pub(super) sides: usize,
    /// Greatest distance from the curved shape, in scene units.
    pub(super) accuracy: f64,
    /// Whether joints look grown.
    pub(super) grown: bool,
    /// Height of the floor, in scene units: the stems that stand there have a foot.
    pub(super) floor: Option<f64>,
    /// Whether joints have as many cross-sections in all frames, and bends none, for pieces that are followed from frame to
    /// frame.
    pub(super) steady: bool,
}

/// All stems of a scene as tubes: how they are cut and how their vertices and normals are numbered. Each piece can
/// then be made by itself, on any thread.
pub(super) struct Tubes<'s> {
    segments: &'s [Segment],
    profiles: Vec<Profile>,
    collars: Vec<Collar>,
    /// Along each tube, one tube after the other.
    pieces: Vec<Piece>,
    /// Numbers of vertices and of normals.
    pub(super) counts: [u32; 2],
}

/// How segments begin at the end of an axis that goes on into them, by number: the radius there, and for how long they are wider than by themselves. They are all
/// straight, and have as much of it in all frames.
pub(super) fn necks(scene: &Scene, default_width: f64) -> Vec<Option<[f64; 2]>> {
    let style = TubeStyle { default_width, sides: 3, accuracy: 0.0, grown: true, floor: None, steady: true };
    let structure = Structure::of(&scene.segments, &style, |_| true);
    (0..scene.segments.len()).map(|i| structure.neck(&scene.segments, i)).collect()
}

/// A piece of a tube.
struct Piece {
    part: Part,
    /// The first segment of its tube, if it is within the stem that this one begins in.
    of: Option<usize>,
    profile: usize,
    /// The index of the collar that it is within.
    collar: Option<usize>,
    section: Section,
    /// How it begins; the end is a dome if it is the last of its tube.
    begins: Begin,
    last: bool,
    /// Numbers of its first vertex and normal.
    first: [u32; 2],
}

#[derive(Clone, Copy, PartialEq)]
enum Begin {
    /// The first of a tube.
    Dome,
    /// The first of a tube, cut at a right angle.
    Flat,
    /// On the ring at the end of the one before.
    Joint,
    /// On a ring of its own at the end of the one before: the tube changes its width at once, by a flat shoulder that
    /// belongs to this one.
    Shoulder,
}

impl Begin {
    /// Vertices and normals of the beginning of a piece with this radius there.
    fn counts(self, profile: &Profile, radius: f64) -> [u32; 2] {
        let ring = profile.spokes.len() as u32;
        match self {
            Begin::Dome => profile.dome(radius),
            Begin::Flat => [ring + 1; 2],
            Begin::Joint => [0; 2],
            Begin::Shoulder => [ring, ring + 1],
        }
    }
}

impl<'s> Tubes<'s> {
    pub(super) fn new(scene: &'s Scene, style: TubeStyle) -> Tubes<'s> {
        let sides = |radius: f64, _: Point| match style.sides {
            0 => sides_for(radius, style.accuracy),
            sides => sides.max(3),
        };
        let style = TubeStyle { floor: scene.surroundings.floor, ..style };
        Tubes::of(scene, style, sides, |_| true)
    }

    /// Tubes of the segments that are to be `kept`, with as many sides as `sides` tells for the radius and the place of each.
    pub(super) fn of(
        scene: &'s Scene,
        style: TubeStyle,
        sides: impl Fn(f64, Point) -> usize,
        kept: impl Fn(usize) -> bool,
    ) -> Tubes<'s> {
        let segments = &scene.segments[..];
        let (profiles, collars, pieces) = Default::default();
        let mut tubes = Tubes { segments, profiles, collars, pieces, counts: [0; 2] };
        let count = (0..segments.len()).filter(|i| kept(*i)).count();
        if count == 0 {
            return tubes;
        }
        let structure = Structure::of(segments, &style, &kept);
        tubes.pieces.reserve(count);
        let mut profiles: HashMap<(Option<u32>, usize), usize> = HashMap::new();
        let (mut members, mut parts) = (Vec::new(), Vec::new());
        let is_seen = |i: usize| structure.is_visible(i, style.steady) && kept(i);
        let firsts = (0..segments.len()).filter(|&i| !structure.continues[i] && is_seen(i));
        for first in firsts {
            members.clear();
            let next = |&i: &usize| Some(structure.next[i]).filter(|&i| i != NONE);
            members.extend(std::iter::successors(Some(first), next));
            let widest = members.iter().flat_map(|&i| structure.radii[i]).fold(0.0, f64::max);
            let sides = sides(widest, segments[first].start);
            let contour = segments[first].contour;
            let profile = *profiles.entry((contour, sides)).or_insert_with(|| {
                let points = contour.and_then(|i| scene.contours.get(i as usize));
                let spokes = points.map_or_else(|| circle(sides), |points| curve(points, sides));
                tubes.profiles.push(Profile::new(spokes));
                tubes.profiles.len() - 1
            });
            let (mut fork, mut within) = structure.fork(segments, first);
            let is_shoot = !fork.is_empty();
            let (mut begin, collar) = match style.grown {
                true if within.part > 0.0 => (Begin::Flat, None),
                true => structure.beginning(scene, first, &style),
                false => (Begin::Dome, None),
            };
            if collar.is_some() {
                (fork, within) = Default::default();
            } else if is_shoot {
                begin = Begin::Flat;
            }
            members.splice(0..0, fork.iter().copied());
            let radii = &structure.radii;
            let TubeStyle { accuracy, steady, .. } = style;
            let forks = &structure.ends[..];
            let chain =
                Chain { segments, radii, members: &members, forks, within, accuracy, steady, is_shoot };
            parts.clear();
            chain.parts(style.grown, collar.as_ref(), &mut parts);
            if steady {
                chain::merge(&fork, &mut parts);
            }
            if !fork.is_empty() {
                chain::begin_within(&fork, segments, &mut parts);
            }
            chain::end_before(members.last().map_or(0.0, |last| structure.cut(*last)), steady, &mut parts);
            let before = structure.before(segments, first);
            if let Some(&part) = parts.first().filter(|_| style.grown && before > 0.0) {
                let [start, _] = part.centres;
                let centres = [start - part.direction * before, start];
                let radii = [part.radii[0]; 2];
                parts.insert(0, Part { centres, radii, drape: 0.0, ..part });
            }
            tubes.collars.extend(collar);
            let number = tubes.collars.len().wrapping_sub(1);
            for (i, part) in parts.iter().enumerate() {
                let collar = Some(number).filter(|_| part.in_collar);
                tubes.push(*part, profile, collar, (i == 0).then_some(begin), i + 1 == parts.len());
                if let Some(piece) = tubes.pieces.last_mut().filter(|_| fork.contains(&part.segment)) {
                    piece.of = Some(first);
                }
            }
        }
        tubes
    }

    /// Adds a piece and numbers what it is made of; `begin` for the first of a tube.
    fn push(&mut self, part: Part, profile: usize, collar: Option<usize>, begin: Option<Begin>, last: bool) {
        let Part { radii, direction, .. } = part;
        let slope = (radii[1] - radii[0]) / (part.centres[1] - part.centres[0]).norm();
        let (section, begins) = match (begin, self.pieces.last()) {
            (None, Some(before)) => {
                let section = before.section.carried(direction, slope);
                let radius = before.part.radii[1];
                let steps = (radii[0] - radius).abs() > 1e-9 * radius.max(radii[0]);
                (section, if steps { Begin::Shoulder } else { Begin::Joint })
            }
            (begin, _) => (
                Section::new(direction, self.segments[part.segment].across, slope),
                begin.unwrap_or(Begin::Dome),
            ),
        };
        let shape = &self.profiles[profile];
        let start = begins.counts(shape, radii[0]);
        let end = if last { shape.dome(radii[1]) } else { [shape.spokes.len() as u32; 2] };
        self.pieces.push(Piece {
            part,
            of: None,
            profile,
            collar,
            section,
            begins,
            last,
            first: self.counts,
        });
        for (count, (a, b)) in self.counts.iter_mut().zip(start.into_iter().zip(end)) {
            *count = count.saturating_add(a.saturating_add(b));
        }
    }

    /// Number of pieces; each makes a part of the points, and of the triangles of its segment.
    pub(super) fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Numbers of the first vertex and normal of a piece.
    pub(super) fn first(&self, piece: usize) -> [u32; 2] {
        self.pieces[piece].first
    }

    /// How many vertices a piece has of its own.
    pub(super) fn points_of(&self, piece: usize) -> usize {
        let end = self.pieces.get(piece + 1).map_or(self.counts, |next| next.first);
        (end[0] - self.first(piece)[0]) as usize
    }

    /// Whether a piece has corners that belong to the one before.
    pub(super) fn begins_on_one_before(&self, piece: usize) -> bool {
        matches!(self.pieces[piece].begins, Begin::Joint | Begin::Shoulder)
    }

    /// The segment that a piece is made of.
    pub(super) fn segment(&self, piece: usize) -> &Segment {
        &self.segments[self.segment_number(piece)]
    }

    /// The number of that segment.
    pub(super) fn segment_number(&self, piece: usize) -> usize {
        self.pieces[piece].part.segment
    }

    fn collar(&self, piece: &Piece) -> Option<&Collar> {
        piece.collar.map(|i| &self.collars[i])
    }

    /// A piece between its two cross-sections, before it the flat shoulder or the cut on which it begins, if it does.
    pub(super) fn lengths(&self, i: usize) -> impl Iterator<Item = Length> {
        let piece = &self.pieces[i];
        let (begin, end) = (piece.begins, self.end(i));
        let radius = piece.part.radii[0];
        let across = || CrossSection::across(piece.part.centres[0], &piece.section, radius);
        let start = match begin {
            Begin::Dome => across(),
            Begin::Flat => across().widened(self.collar(piece), piece.section.along, 0.0),
            Begin::Joint => self.end(i - 1),
            Begin::Shoulder => {
                let before = &self.pieces[i - 1];
                CrossSection::between(before.part.centres[1], &before.section, &piece.section, radius)
            }
        };
        let segment = piece.part.segment;
        let of = piece.of.unwrap_or(segment);
        let length = |ends, caps| Length { segment, of, ends, caps };
        let cut = match begin {
            Begin::Shoulder => Some(self.end(i - 1)),
            // That of a branch is within its parent, and so is that of an axis that gives way to one.
            Begin::Flat if self.stands(of) => {
                Some(CrossSection { u: Vector::zeros(), v: Vector::zeros(), ..start })
            }
            _ => None,
        };
        let cut = cut.map(|from| length([from, start], [false; 2]));
        let caps = [begin == Begin::Dome && radius > 0.0, piece.last && piece.part.radii[1] > 0.0];
        cut.into_iter().chain([length([start, end], caps)])
    }

    /// Whether a segment grows from no other one.
    fn stands(&self, segment: usize) -> bool {
        let Segment { grows_from, follows, .. } = self.segments[segment];
        grows_from.is_none() && follows.is_none()
    }

    /// The cross-section at the end of a piece.
    fn end(&self, i: usize) -> CrossSection {
        let piece = &self.pieces[i];
        let (centre, radius) = (piece.part.centres[1], piece.part.radii[1]);
        let section = if piece.last {
            CrossSection::across(centre, &piece.section, radius)
        } else {
            CrossSection::between(centre, &piece.section, &self.pieces[i + 1].section, radius)
        };
        section.widened(self.collar(piece), piece.section.along, piece.part.drape)
    }

    /// Makes the vertices and normals of some pieces, in the order of their numbers.
    pub(super) fn points(&self, pieces: Range<usize>, out: &mut impl Points) {
        for i in pieces {
            let piece = &self.pieces[i];
            let section = &piece.section;
            let stem =
                Plain { profile: &self.profiles[piece.profile], collar: self.collar(piece), drape: 0.0 };
            let [start, end] = piece.part.radii;
            match piece.begins {
                Begin::Dome => stem.dome(piece.part.centres[0], start, section, -1.0, out),
                Begin::Flat => {
                    let centre = piece.part.centres[0];
                    stem.joint(centre, start, [section; 2], [section; 2], out);
                    out.vertex(|| centre);
                    out.normal(|| -section.along);
                }
                Begin::Joint => {}
                Begin::Shoulder => {
                    let before = &self.pieces[i - 1];
                    stem.joint(before.part.centres[1], start, [&before.section, section], [section; 2], out);
                    let wider = start > before.part.radii[1];
                    out.normal(|| if wider { -section.along } else { section.along });
                }
            }
            let centre = piece.part.centres[1];
            if piece.last {
                stem.dome(centre, end, section, 1.0, out);
            } else {
                let after = &self.pieces[i + 1];
                let meeting = if after.begins == Begin::Shoulder { section } else { &after.section };
                let stem = Plain { drape: piece.part.drape, ..stem };
                stem.joint(centre, end, [section, &after.section], [section, meeting], out);
            }
        }
    }

    /// Makes the triangles of a piece.
    pub(super) fn faces(&self, i: usize, out: &mut impl Faces) {
        let piece = &self.pieces[i];
        let profile = &self.profiles[piece.profile];
        let low = self.low(i);
        let flat = |ring: Ring, normal| Ring { normal, flat: true, ..ring };
        match piece.begins {
            Begin::Dome => dome_faces(profile, low, -1.0, out),
            Begin::Flat => {
                let normal = low.normal + low.sides;
                out.fan((low.vertex + low.sides, normal), flat(low, normal), true);
            }
            Begin::Joint => {}
            Begin::Shoulder => {
                let normal = low.normal + low.sides;
                out.strip(flat(self.high(i - 1), normal), flat(low, normal));
            }
        }
        let high = self.high(i);
        if piece.last {
            dome_faces(profile, high, 1.0, out);
        }
        out.strip(low, high);
    }

    /// The ring at the start of a piece.
    fn low(&self, i: usize) -> Ring {
        let piece = &self.pieces[i];
        if piece.begins == Begin::Joint {
            return self.high(i - 1);
        }
        let sides = self.profiles[piece.profile].spokes.len() as u32;
        let [vertex, normal] = piece.first;
        Ring { vertex, normal, sides, point: piece.part.radii[0] <= 0.0, flat: false }
    }

    /// The ring at the end of a piece.
    fn high(&self, i: usize) -> Ring {
        let piece = &self.pieces[i];
        let profile = &self.profiles[piece.profile];
        let sides = profile.spokes.len() as u32;
        let [vertices, normals] = piece.begins.counts(profile, piece.part.radii[0]);
        Ring {
            vertex: piece.first[0] + vertices,
            normal: piece.first[1] + normals,
            sides,
            point: piece.part.radii[1] <= 0.0,
            flat: false,
        }
    }
}

/// Whether two segments can share a ring, or the plane of it where they have these radii there.
pub(super) fn can_join(a: &Segment, b: &Segment, radii: [f64; 2]) -> bool {
    /// Most that a shoulder may reach beyond the thinner one, as a part of its radius: it would be a spike.
    const OVERHANG: f64 = 0.1;
    let cos = a.direction.dot(&b.direction);
    if cos < SHARPEST {
        return false;
    }
    // How far the ring reaches into either segment: r tan(θ/2).
    let (thin, thick) = (radii[0].min(radii[1]), radii[0].max(radii[1]));
    let half = ((1.0 - cos).max(0.0) / (1.0 + cos)).sqrt();
    if (thick - thin) * half > OVERHANG * thin {
        return false;
    }
    let reach = thick * half;
    let shorter = (a.end - a.start).norm().min((b.end - b.start).norm());
    reach <= 0.5 * shorter
}

/// A tube's surface before its collar, and with it.
struct Plain<'a> {
    profile: &'a Profile,
    collar: Option<&'a Collar>,
    /// See [`Part::drape`].
    drape: f64,
}

impl Plain<'_> {
    fn vertex(&self, place: Point, normal: impl FnOnce() -> Vector) -> Point {
        self.collar.map_or(place, |collar| collar.place(place, normal()))
    }

    fn normal(&self, place: impl FnOnce() -> Point, normal: Vector, section: &Section) -> Vector {
        self.collar.map_or(normal, |collar| collar.normal(place(), normal, section.along))
    }

    /// A ring in the plane that halves the bend between two sections, with the mean of two normals.
    fn joint(
        &self,
        centre: Point,
        radius: f64,
        [before, after]: [&Section; 2],
        sides: [&Section; 2],
        out: &mut impl Points,
    ) {
        let plane = before.along + after.along;
        let lean = before.along.dot(&plane);
        let one = std::ptr::eq(sides[0], sides[1]);
        for at in &self.profile.spokes {
            let place = || {
                let outward = before.outward(at);
                // Along the side of the tube up to the plane.
                let slide = outward.dot(&plane) / lean;
                let place = centre + (outward - before.along * slide) * radius;
                let Some(collar) = self.collar.filter(|_| self.drape > 0.0) else { return place };
                let droop = collar.droop(centre, before.along, outward, self.drape);
                place + (before.along + outward * before.slope) * droop
            };
            let normal = || match one {
                true => sides[0].normal(at),
                false => (sides[0].normal(at) + sides[1].normal(at)).normalize(),
            };
            out.vertex(|| self.vertex(place(), normal));
            out.normal(|| self.normal(place, normal(), before));
        }
    }

    /// Points of a dome that closes an end, from the ring that it stands on to the pole; an end without width is a
    /// point with the normals of a ring. `sign` is -1 at the start.
    fn dome(&self, centre: Point, radius: f64, section: &Section, sign: f64, out: &mut impl Points) {
        let profile = self.profile;
        if radius <= 0.0 {
            out.vertex(|| centre);
            for at in &profile.spokes {
                out.normal(|| section.normal(at));
            }
            return;
        }
        let outwards = section.along * sign;
        self.joint(centre, radius, [section; 2], [section; 2], out);
        for &(sin, cos) in &profile.latitudes {
            for at in &profile.spokes {
                let place = || centre + (section.outward(at) * cos + outwards * sin) * radius;
                // Of length 1, as all three are at right angles.
                let normal = || (section.u * at.normal[0] + section.v * at.normal[1]) * cos + outwards * sin;
                out.vertex(|| self.vertex(place(), normal));
                out.normal(|| self.normal(place, normal(), section));
            }
        }
        let pole = centre + outwards * radius;
        out.vertex(|| self.vertex(pole, || outwards));
        out.normal(|| outwards);
    }
}

/// Triangles of a dome on its base.
fn dome_faces(profile: &Profile, base: Ring, sign: f64, out: &mut impl Faces) {
    if base.point {
        return;
    }
    let mut outer = base;
    for _ in &profile.latitudes {
        let ring = Ring { vertex: outer.vertex + base.sides, normal: outer.normal + base.sides, ..base };
        let (low, high) = if sign < 0.0 { (ring, outer) } else { (outer, ring) };
        out.strip(low, high);
        outer = ring;
    }
    let pole = (outer.vertex + base.sides, outer.normal + base.sides);
    out.fan(pole, outer, sign < 0.0);
}
