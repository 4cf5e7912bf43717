//! Stems as tubes.
//!
//! Segments that continue one another make one closed tube: they share the ring of vertices where they
//! meet, which lies in the plane that halves the bend, and the first and last end in a dome. Cross-sections
//! are carried along without twist (parallel transport: each bend turns them by the least rotation). A tube
//! is cut in two where it turns back on itself, or where it bends so much in so short a space that the ring
//! would cut into the segment's other end. A branch begins with its dome inside the stem that it grows from, so that
//! there is no gap.

use std::collections::HashMap;

use super::obj::Triangles;
use crate::scene::{Point, Scene, Segment, Vector, sin_cos_degrees};

/// Least cosine of a bend within a tube (100 degrees).
const SHARPEST: f64 = -0.173_648_177_666_930_3;

/// Adds all stems of a scene, as tubes with so many sides (at least 3).
pub(super) fn add_tubes(scene: &Scene, default_width: f64, sides: usize, out: &mut Triangles) {
    add(scene, default_width, |_| sides, out);
}

/// Adds all stems of a scene, as tubes whose sides are no further from round ones than `accuracy`.
pub(super) fn add_round_tubes(scene: &Scene, default_width: f64, accuracy: f64, out: &mut Triangles) {
    add(scene, default_width, |radius| sides_for(radius, accuracy), out);
}

/// Sides of a prism whose faces are no further from its cylinder than that. Few numbers are used, so that a
/// stem that grows does not change all the time.
fn sides_for(radius: f64, accuracy: f64) -> usize {
    const STEPS: [usize; 7] = [8, 12, 16, 24, 32, 48, 64];
    let deviation = |sides: usize| radius * (1.0 - sin_cos_degrees(180.0 / sides as f64).1);
    STEPS.into_iter().find(|&sides| deviation(sides) <= accuracy).unwrap_or(STEPS[STEPS.len() - 1])
}

/// Adds all stems of a scene; `sides` tells the number of sides by the largest radius of a tube.
fn add(scene: &Scene, default_width: f64, sides: impl Fn(f64) -> usize, out: &mut Triangles) {
    let radii: Vec<[f64; 2]> =
        scene.segments.iter().map(|s| s.widths.map(|w| w.resolve(default_width) / 2.0)).collect();
    let visible = |i: usize| radii[i][0] > 0.0 || radii[i][1] > 0.0;
    let mut next: Vec<Option<usize>> = vec![None; scene.segments.len()];
    let mut continues = vec![false; scene.segments.len()];
    for (i, segment) in scene.segments.iter().enumerate() {
        if let Some(before) = segment.follows
            && next[before].is_none()
            && scene.segments[before].contour == segment.contour
            && radii[before][1] > 0.0
            && radii[i][0] > 0.0
            && can_join(&scene.segments[before], segment, radii[before][1].max(radii[i][0]))
        {
            next[before] = Some(i);
            continues[i] = true;
        }
    }
    let mut profiles: HashMap<(Option<u32>, usize), Vec<Spoke>> = HashMap::new();
    let mut pieces: Vec<(&Segment, [f64; 2])> = Vec::new();
    for first in (0..scene.segments.len()).filter(|&i| !continues[i] && visible(i)) {
        let chain = std::iter::successors(Some(first), |&i| next[i]);
        pieces.clear();
        pieces.extend(chain.map(|i| (&scene.segments[i], radii[i])));
        let sides = sides(pieces.iter().flat_map(|(_, radii)| *radii).fold(0.0, f64::max));
        let contour = scene.segments[first].contour;
        let profile = profiles.entry((contour, sides)).or_insert_with(|| {
            let points = contour.and_then(|i| scene.prepared_for.as_ref()?.contours.get(i as usize));
            points.map_or_else(|| circle(sides), |contour| curve(&contour.points, sides))
        });
        Tube { profile, out }.add(&pieces);
    }
}

/// A corner of a cross-section, in parts of the radius: its place, and the unit normal of the outline there.
#[derive(Clone, Copy)]
struct Spoke {
    place: [f64; 2],
    normal: [f64; 2],
}

fn circle(sides: usize) -> Vec<Spoke> {
    (0..sides)
        .map(|k| {
            let (sin, cos) = sin_cos_degrees(360.0 * k as f64 / sides as f64);
            Spoke { place: [cos, sin], normal: [cos, sin] }
        })
        .collect()
}

/// A smooth closed curve through points (Catmull and Rom 1974), with at least so many sides.
fn curve(points: &[[f64; 2]], sides: usize) -> Vec<Spoke> {
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

/// Whether two segments can share a ring of this radius.
fn can_join(a: &Segment, b: &Segment, radius: f64) -> bool {
    let cos = a.direction.dot(&b.direction);
    if cos < SHARPEST {
        return false;
    }
    // How far the ring reaches into either segment: r tan(θ/2).
    let reach = radius * ((1.0 - cos).max(0.0) / (1.0 + cos)).sqrt();
    let shorter = (a.end - a.start).norm().min((b.end - b.start).norm());
    reach <= 0.5 * shorter
}

/// Vertices and normals around a tube, by number.
struct Ring {
    vertices: Vec<u32>,
    normals: Vec<u32>,
}

/// Directions along and across a tube at one place: `along`, `u`, `v` are orthonormal and right-handed.
#[derive(Clone, Copy)]
struct Section {
    along: Vector,
    u: Vector,
    v: Vector,
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
    fn outward(&self, at: Spoke) -> Vector {
        self.u * at.place[0] + self.v * at.place[1]
    }

    /// Normal of the tube's side.
    fn normal(&self, at: Spoke) -> Vector {
        let ([x, y], [a, b]) = (at.normal, at.place);
        (self.u * x + self.v * y - self.along * (self.slope * (x * a + y * b))).normalize()
    }
}

struct Tube<'a> {
    /// The corners of a cross-section.
    profile: &'a [Spoke],
    out: &'a mut Triangles,
}

impl Tube<'_> {
    /// Adds a closed tube along segments, given with their radii at both ends.
    fn add(&mut self, pieces: &[(&Segment, [f64; 2])]) {
        let slope = |&(segment, radii): &(&Segment, [f64; 2])| {
            (radii[1] - radii[0]) / (segment.end - segment.start).norm()
        };
        let (first, radii) = pieces[0];
        let mut section = Section::new(first.direction, first.across, slope(&pieces[0]));
        let mut ring = self.dome(first, first.start, radii[0], &section, -1.0);
        for (i, piece) in pieces.iter().enumerate() {
            let (segment, [_, radius]) = *piece;
            let Some(after) = pieces.get(i + 1) else {
                let end = self.dome(segment, segment.end, radius, &section, 1.0);
                self.strip(segment, &ring, &end);
                return;
            };
            let carried = section.carried(after.0.direction, slope(after));
            let steps = (after.1[0] - radius).abs() > 1e-9 * radius.max(after.1[0]);
            let meeting = if steps { section } else { carried };
            let end = self.joint(segment.end, radius, [&section, &carried], [&section, &meeting]);
            self.strip(segment, &ring, &end);
            ring = end;
            if steps {
                // The tube changes its width at once: a flat shoulder that belongs to the next segment.
                let faces = if after.1[0] > radius { -carried.along } else { carried.along };
                let wide = self.joint(segment.end, after.1[0], [&section, &carried], [&carried, &carried]);
                let normal = self.out.add_normal(faces);
                let flat = |ring: &Ring| Ring {
                    vertices: ring.vertices.clone(),
                    normals: vec![normal; self.profile.len()],
                };
                let (a, b) = (flat(&ring), flat(&wide));
                self.strip(after.0, &a, &b);
                ring = wide;
            }
            section = carried;
        }
    }

    /// A ring in the plane that halves the bend between two sections, with the mean of two normals.
    fn joint(
        &mut self,
        centre: Point,
        radius: f64,
        [before, after]: [&Section; 2],
        sides: [&Section; 2],
    ) -> Ring {
        let plane = before.along + after.along;
        let mut ring = Ring { vertices: Vec::new(), normals: Vec::new() };
        for &at in self.profile {
            let outward = before.outward(at);
            // Along the side of the tube up to the plane.
            let slide = outward.dot(&plane) / before.along.dot(&plane);
            ring.vertices.push(self.out.add_vertex(centre + (outward - before.along * slide) * radius));
            let normal = (sides[0].normal(at) + sides[1].normal(at)).normalize();
            ring.normals.push(self.out.add_normal(normal));
        }
        ring
    }

    /// Closes an end by a dome and returns the ring that it stands on; an end without width is a point.
    /// `sign` is -1 at the start.
    fn dome(&mut self, segment: &Segment, centre: Point, radius: f64, section: &Section, sign: f64) -> Ring {
        if radius <= 0.0 {
            let point = self.out.add_vertex(centre);
            let normals = self.profile.iter().map(|&at| self.out.add_normal(section.normal(at))).collect();
            return Ring { vertices: vec![point; self.profile.len()], normals };
        }
        let outwards = section.along * sign;
        let base = self.joint(centre, radius, [section; 2], [section; 2]);
        // As many rings from the base to the pole as make the dome as round as the tube.
        let steps = (self.profile.len() / 8).clamp(1, 8) + 1;
        let mut outer = Ring { vertices: base.vertices.clone(), normals: base.normals.clone() };
        for step in 1..steps {
            let (sin, cos) = sin_cos_degrees(90.0 * step as f64 / steps as f64);
            let mut ring = Ring { vertices: Vec::new(), normals: Vec::new() };
            for &at in self.profile {
                let place = centre + (section.outward(at) * cos + outwards * sin) * radius;
                ring.vertices.push(self.out.add_vertex(place));
                let aside = section.u * at.normal[0] + section.v * at.normal[1];
                ring.normals.push(self.out.add_normal((aside * cos + outwards * sin).normalize()));
            }
            let (low, high) = if sign < 0.0 { (&ring, &outer) } else { (&outer, &ring) };
            self.strip(segment, low, high);
            outer = ring;
        }
        let pole = (self.out.add_vertex(centre + outwards * radius), self.out.add_normal(outwards));
        for k in 0..self.profile.len() {
            let after = (k + 1) % self.profile.len();
            let (a, b) = if sign < 0.0 { (after, k) } else { (k, after) };
            let corner = |k: usize| (outer.vertices[k], outer.normals[k]);
            self.face(segment, [pole, corner(a), corner(b)]);
        }
        base
    }

    /// The side between two rings, the second one further along.
    fn strip(&mut self, segment: &Segment, from: &Ring, to: &Ring) {
        for k in 0..self.profile.len() {
            let after = (k + 1) % self.profile.len();
            let corner = |ring: &Ring, k: usize| (ring.vertices[k], ring.normals[k]);
            let [a, b, c, d] = [corner(from, k), corner(from, after), corner(to, after), corner(to, k)];
            self.face(segment, [a, b, c]);
            self.face(segment, [a, c, d]);
        }
    }

    fn face(&mut self, segment: &Segment, corners: [(u32, u32); 3]) {
        // At a point a side has one triangle, not two.
        let [(a, _), (b, _), (c, _)] = corners;
        if a == b || b == c || c == a {
            return;
        }
        self.out.add_face(segment.owner, segment.material, corners);
    }
}
