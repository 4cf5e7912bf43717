//! Stems as tubes: rings, domes at the ends, and their vertices and triangles.
//!
//! Segments that continue one another make one closed tube: they share the ring of vertices where they
//! meet, which lies in the plane that halves the bend, and the first and last end in a dome. Cross-sections
//! are carried along without twist (parallel transport: each bend turns them by the least rotation). A tube
//! is cut in two where it turns back on itself, or where it bends so much in so short a space that the ring
//! would cut into the segment's other end. A branch begins with its dome inside the stem that it grows from, so that
//! there is no gap.

use std::collections::HashMap;
use std::ops::Range;

use super::lengths::{CrossSection, Length};
use super::triangles::{Faces, Points, Ring};
use dlsys_geometry::scene::{Point, Scene, Segment, Vector, sin_cos_degrees};

/// Least cosine of a bend within a tube (100 degrees).
const SHARPEST: f64 = -0.173_648_177_666_930_3;

/// Sides of a prism whose faces are no further from its cylinder than that. Few numbers are used, so that a
/// stem that grows does not change all the time.
pub(super) fn sides_for(radius: f64, accuracy: f64) -> usize {
    // With the last, a face is three parts in ten million of the radius from its cylinder.
    const STEPS: [usize; 19] =
        [8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096];
    let deviation = |sides: usize| radius * (1.0 - sin_cos_degrees(180.0 / sides as f64).1);
    STEPS.into_iter().find(|&sides| deviation(sides) <= accuracy).unwrap_or(STEPS[STEPS.len() - 1])
}

/// All stems of a scene as tubes: how they are cut and how their vertices and normals are numbered. Each piece can
/// then be made by itself, on any thread.
pub(super) struct Tubes<'s> {
    segments: &'s [Segment],
    profiles: Vec<Profile>,
    /// Along each tube, one tube after the other.
    pieces: Vec<TubeSegment>,
    /// Numbers of vertices and of normals.
    pub(super) counts: [u32; 2],
}

/// A segment of a tube.
struct TubeSegment {
    segment: usize,
    profile: usize,
    radii: [f64; 2],
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
    /// On the ring at the end of the one before.
    Joint,
    /// On a ring of its own at the end of the one before: the tube changes its width at once, by a flat shoulder that
    /// belongs to this one.
    Shoulder,
}

/// A cross-section.
struct Profile {
    spokes: Vec<Spoke>,
    /// Sine and cosine of the latitudes of a dome's rings, from the base without it to the pole without it: as many
    /// as make the dome as round as the tube.
    latitudes: Vec<(f64, f64)>,
}

impl Profile {
    fn new(spokes: Vec<Spoke>) -> Profile {
        let steps = (spokes.len() / 8).max(1) + 1;
        let latitude = |step| sin_cos_degrees(90.0 * step as f64 / steps as f64);
        Profile { latitudes: (1..steps).map(latitude).collect(), spokes }
    }

    /// Vertices and normals of a dome; one without width is a point.
    fn dome(&self, radius: f64) -> [u32; 2] {
        let sides = self.spokes.len() as u32;
        let all = sides * (self.latitudes.len() as u32 + 1) + 1;
        if radius > 0.0 { [all; 2] } else { [1, sides] }
    }
}

impl<'s> Tubes<'s> {
    /// Tubes with so many sides (at least 3); 0: as many as make them no further from round ones than `accuracy`.
    pub(super) fn new(scene: &'s Scene, default_width: f64, sides: usize, accuracy: f64) -> Tubes<'s> {
        let sides_of = |radius: f64, _: Point| match sides {
            0 => sides_for(radius, accuracy),
            _ => sides.max(3),
        };
        Tubes::of(scene, default_width, sides_of, |_| true)
    }

    /// Tubes of the segments that are to be `kept`, with as many sides as `sides` tells for the radius and the place of each.
    pub(super) fn of(
        scene: &'s Scene,
        default_width: f64,
        sides: impl Fn(f64, Point) -> usize,
        kept: impl Fn(usize) -> bool,
    ) -> Tubes<'s> {
        let segments = &scene.segments[..];
        let radii: Vec<[f64; 2]> =
            segments.iter().map(|s| s.widths.map(|w| w.resolve(default_width) / 2.0)).collect();
        const NONE: usize = usize::MAX;
        let mut next = vec![NONE; segments.len()];
        let mut continues = vec![false; segments.len()];
        for (i, segment) in segments.iter().enumerate() {
            if let Some(before) = segment.follows
                && next[before] == NONE
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
        let mut tubes = Tubes {
            segments,
            profiles: Vec::new(),
            pieces: Vec::with_capacity(segments.len()),
            counts: [0; 2],
        };
        let mut profiles: HashMap<(Option<u32>, usize), usize> = HashMap::new();
        let visible = |i: usize| (radii[i][0] > 0.0 || radii[i][1] > 0.0) && kept(i);
        for first in (0..segments.len()).filter(|&i| !continues[i] && visible(i)) {
            let chain = || std::iter::successors(Some(first), |&i| Some(next[i]).filter(|&i| i != NONE));
            let sides = sides(chain().flat_map(|i| radii[i]).fold(0.0, f64::max), segments[first].start);
            let contour = segments[first].contour;
            let profile = *profiles.entry((contour, sides)).or_insert_with(|| {
                let points = contour.and_then(|i| scene.prepared_for.as_ref()?.contours.get(i as usize));
                let spokes = points.map_or_else(|| circle(sides), |contour| curve(&contour.points, sides));
                tubes.profiles.push(Profile::new(spokes));
                tubes.profiles.len() - 1
            });
            for i in chain() {
                tubes.push(i, profile, radii[i], i != first, next[i] == NONE);
            }
        }
        tubes
    }

    /// Adds a piece and numbers what it is made of.
    fn push(&mut self, segment: usize, profile: usize, radii: [f64; 2], goes_on: bool, last: bool) {
        let here = &self.segments[segment];
        let slope = (radii[1] - radii[0]) / (here.end - here.start).norm();
        let shape = &self.profiles[profile];
        let ring = shape.spokes.len() as u32;
        let (section, begins, start) = match self.pieces.last().filter(|_| goes_on) {
            None => (Section::new(here.direction, here.across, slope), Begin::Dome, shape.dome(radii[0])),
            Some(before) => {
                let section = before.section.carried(here.direction, slope);
                let radius = before.radii[1];
                let steps = (radii[0] - radius).abs() > 1e-9 * radius.max(radii[0]);
                if steps {
                    (section, Begin::Shoulder, [ring, ring + 1])
                } else {
                    (section, Begin::Joint, [0; 2])
                }
            }
        };
        let end = if last { shape.dome(radii[1]) } else { [ring; 2] };
        self.pieces.push(TubeSegment { segment, profile, radii, section, begins, last, first: self.counts });
        for (count, (a, b)) in self.counts.iter_mut().zip(start.into_iter().zip(end)) {
            *count = count.saturating_add(a.saturating_add(b));
        }
    }

    /// Number of pieces; each makes a part of the points, and of the triangles of its segment.
    pub(super) fn len(&self) -> usize {
        self.pieces.len()
    }

    /// The segment that a piece is made of.
    pub(super) fn segment(&self, piece: usize) -> &Segment {
        &self.segments[self.pieces[piece].segment]
    }

    /// A piece between its two cross-sections, before it the flat shoulder on which it begins, if it does.
    pub(super) fn lengths(&self, i: usize) -> impl Iterator<Item = Length> {
        let piece = &self.pieces[i];
        let segment = &self.segments[piece.segment];
        let (begin, end) = (piece.begins, self.end(i));
        let start = match begin {
            Begin::Dome => CrossSection::across(segment.start, &piece.section, piece.radii[0]),
            Begin::Joint => self.end(i - 1),
            Begin::Shoulder => {
                let before = &self.pieces[i - 1];
                let centre = self.segments[before.segment].end;
                CrossSection::between(centre, &before.section, &piece.section, piece.radii[0])
            }
        };
        let length = |ends, caps| Length { segment: piece.segment, ends, caps };
        let shoulder = (begin == Begin::Shoulder).then(|| length([self.end(i - 1), start], [false; 2]));
        let caps = [begin == Begin::Dome && piece.radii[0] > 0.0, piece.last && piece.radii[1] > 0.0];
        shoulder.into_iter().chain([length([start, end], caps)])
    }

    /// The cross-section at the end of a piece.
    fn end(&self, i: usize) -> CrossSection {
        let piece = &self.pieces[i];
        let (centre, radius) = (self.segments[piece.segment].end, piece.radii[1]);
        if piece.last {
            return CrossSection::across(centre, &piece.section, radius);
        }
        CrossSection::between(centre, &piece.section, &self.pieces[i + 1].section, radius)
    }

    /// Makes the vertices and normals of some pieces, in the order of their numbers.
    pub(super) fn points(&self, pieces: Range<usize>, out: &mut impl Points) {
        for i in pieces {
            let piece = &self.pieces[i];
            let profile = &self.profiles[piece.profile];
            let (segment, section) = (&self.segments[piece.segment], &piece.section);
            match piece.begins {
                Begin::Dome => dome(profile, segment.start, piece.radii[0], section, -1.0, out),
                Begin::Joint => {}
                Begin::Shoulder => {
                    let before = &self.pieces[i - 1];
                    let centre = self.segments[before.segment].end;
                    joint(profile, centre, piece.radii[0], [&before.section, section], [section; 2], out);
                    let wider = piece.radii[0] > before.radii[1];
                    out.normal(|| if wider { -section.along } else { section.along });
                }
            }
            if piece.last {
                dome(profile, segment.end, piece.radii[1], section, 1.0, out);
            } else {
                let after = &self.pieces[i + 1];
                let meeting = if after.begins == Begin::Shoulder { section } else { &after.section };
                joint(
                    profile,
                    segment.end,
                    piece.radii[1],
                    [section, &after.section],
                    [section, meeting],
                    out,
                );
            }
        }
    }

    /// Makes the triangles of a piece.
    pub(super) fn faces(&self, i: usize, out: &mut impl Faces) {
        let piece = &self.pieces[i];
        let profile = &self.profiles[piece.profile];
        let low = self.low(i);
        match piece.begins {
            Begin::Dome => dome_faces(profile, low, -1.0, out),
            Begin::Joint => {}
            Begin::Shoulder => {
                let normal = low.normal + low.sides;
                let flat = |ring: Ring| Ring { normal, flat: true, ..ring };
                out.strip(flat(self.high(i - 1)), flat(low));
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
        Ring { vertex, normal, sides, point: piece.radii[0] <= 0.0, flat: false }
    }

    /// The ring at the end of a piece.
    fn high(&self, i: usize) -> Ring {
        let piece = &self.pieces[i];
        let profile = &self.profiles[piece.profile];
        let sides = profile.spokes.len() as u32;
        let [vertices, normals] = match piece.begins {
            Begin::Dome => profile.dome(piece.radii[0]),
            Begin::Joint => [0; 2],
            Begin::Shoulder => [sides, sides + 1],
        };
        Ring {
            vertex: piece.first[0] + vertices,
            normal: piece.first[1] + normals,
            sides,
            point: piece.radii[1] <= 0.0,
            flat: false,
        }
    }
}

/// A corner of a cross-section, in parts of the radius: its place, and the unit normal of the outline there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spoke {
    /// Its place, the outline's radius being 1.
    pub place: [f64; 2],
    /// The unit normal of the outline, pointing out.
    pub normal: [f64; 2],
}

pub(super) fn circle(sides: usize) -> Vec<Spoke> {
    (0..sides)
        .map(|k| {
            let (sin, cos) = sin_cos_degrees(360.0 * k as f64 / sides as f64);
            Spoke { place: [cos, sin], normal: [cos, sin] }
        })
        .collect()
}

/// A smooth closed curve through points (Catmull and Rom 1974), with at least so many sides.
pub(super) fn curve(points: &[[f64; 2]], sides: usize) -> Vec<Spoke> {
    let count = points.len();
    let pieces = (2 * sides).div_ceil(count).max(2);
    let mut spokes = Vec::with_capacity(count * pieces);
    for i in 0..count {
        let [a, b, c, d] = [count - 1, 0, 1, 2].map(|k| points[(i + k) % count]);
        for k in 0..pieces {
            let t = k as f64 / pieces as f64;
            let weigh = |w: [f64; 4]| [0, 1].map(|x| w[0] * a[x] + w[1] * b[x] + w[2] * c[x] + w[3] * d[x]);
            let place = weigh([
                t * (t * (1.0 - 0.5 * t) - 0.5),
                t * t * (1.5 * t - 2.5) + 1.0,
                t * (t * (2.0 - 1.5 * t) + 0.5),
                t * t * 0.5 * (t - 1.0),
            ]);
            let [x, y] = weigh([
                t * (2.0 - 1.5 * t) - 0.5,
                t * (4.5 * t - 5.0),
                t * (4.0 - 4.5 * t) + 0.5,
                t * (1.5 * t - 1.0),
            ]);
            let length = x.hypot(y);
            // Where the curve has no direction, away from the middle.
            let (x, y) = if length > 1e-9 { (y, -x) } else { (place[0], place[1]) };
            let length = x.hypot(y).max(1e-300);
            spokes.push(Spoke { place, normal: [x / length, y / length] });
        }
    }
    spokes
}

/// Whether two segments can share a ring, or the plane of it where they have these radii there.
fn can_join(a: &Segment, b: &Segment, radii: [f64; 2]) -> bool {
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

/// Directions along and across a tube at one place: `along`, `u`, `v` are orthonormal and right-handed.
#[derive(Clone, Copy)]
pub(super) struct Section {
    pub(super) along: Vector,
    pub(super) u: Vector,
    pub(super) v: Vector,
    /// Growth of the radius along the segment.
    slope: f64,
}

impl Section {
    /// With a cross-section counted from `u`, as far as that is across.
    fn new(along: Vector, u: Vector, slope: f64) -> Section {
        let across = (u - along * along.dot(&u)).try_normalize(1e-6).unwrap_or_else(|| {
            let mut aside = Vector::zeros();
            aside[along.iamin()] = 1.0;
            along.cross(&aside).normalize()
        });
        Section { along, u: across, v: along.cross(&across), slope }
    }

    /// Turned by the least rotation that brings `along` to `to`.
    fn carried(&self, to: Vector, slope: f64) -> Section {
        let half = self.along + to;
        // Two reflections, in the plane across `along` and in the one across `half`.
        let u = self.u - half * (2.0 * half.dot(&self.u) / half.norm_squared());
        Section::new(to, u, slope)
    }

    /// Away from the axis, as far as the cross-section reaches with radius 1.
    fn outward(&self, at: &Spoke) -> Vector {
        self.u * at.place[0] + self.v * at.place[1]
    }

    /// Normal of the tube's side.
    fn normal(&self, at: &Spoke) -> Vector {
        let ([x, y], [a, b]) = (at.normal, at.place);
        let aside = self.u * x + self.v * y;
        // Already of length 1 on a stem that does not taper: spokes and cross-sections are.
        if self.slope == 0.0 {
            return aside;
        }
        (aside - self.along * (self.slope * (x * a + y * b))).normalize()
    }
}

/// A ring in the plane that halves the bend between two sections, with the mean of two normals.
fn joint(
    profile: &Profile,
    centre: Point,
    radius: f64,
    [before, after]: [&Section; 2],
    sides: [&Section; 2],
    out: &mut impl Points,
) {
    let plane = before.along + after.along;
    let lean = before.along.dot(&plane);
    let one = std::ptr::eq(sides[0], sides[1]);
    for at in &profile.spokes {
        out.vertex(|| {
            let outward = before.outward(at);
            // Along the side of the tube up to the plane.
            let slide = outward.dot(&plane) / lean;
            centre + (outward - before.along * slide) * radius
        });
        out.normal(|| match one {
            true => sides[0].normal(at),
            false => (sides[0].normal(at) + sides[1].normal(at)).normalize(),
        });
    }
}

/// Points of a dome that closes an end, from the ring that it stands on to the pole; an end without width is a point
/// with the normals of a ring. `sign` is -1 at the start.
fn dome(profile: &Profile, centre: Point, radius: f64, section: &Section, sign: f64, out: &mut impl Points) {
    if radius <= 0.0 {
        out.vertex(|| centre);
        for at in &profile.spokes {
            out.normal(|| section.normal(at));
        }
        return;
    }
    let outwards = section.along * sign;
    joint(profile, centre, radius, [section; 2], [section; 2], out);
    for &(sin, cos) in &profile.latitudes {
        for at in &profile.spokes {
            out.vertex(|| centre + (section.outward(at) * cos + outwards * sin) * radius);
            // Of length 1, as all three are at right angles.
            out.normal(|| (section.u * at.normal[0] + section.v * at.normal[1]) * cos + outwards * sin);
        }
    }
    out.vertex(|| centre + outwards * radius);
    out.normal(|| outwards);
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
