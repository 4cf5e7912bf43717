//! Stems as tubes.
//!
//! Segments that continue one another make one closed tube: they share the ring of vertices where they
//! meet, which lies in the plane that halves the bend, and the first and last end in a dome. Cross-sections
//! are carried along without twist (parallel transport: each bend turns them by the least rotation). A tube
//! is cut in two where it turns back on itself, or where it bends so much in so short a space that the ring
//! would cut into the segment's other end.

use super::obj::Triangles;
use crate::scene::{Point, Scene, Segment, Vector, sin_cos_degrees};

/// Least cosine of a bend within a tube (100 degrees).
const SHARPEST: f64 = -0.173_648_177_666_930_3;

/// Adds all stems of a scene, as tubes with so many sides (at least 3).
pub(super) fn add_tubes(scene: &Scene, default_width: f64, sides: usize, out: &mut Triangles) {
    let radii: Vec<[f64; 2]> =
        scene.segments.iter().map(|s| s.widths.map(|w| w.resolve(default_width) / 2.0)).collect();
    let visible = |i: usize| radii[i][0] > 0.0 || radii[i][1] > 0.0;
    let mut next: Vec<Option<usize>> = vec![None; scene.segments.len()];
    let mut continues = vec![false; scene.segments.len()];
    for (i, segment) in scene.segments.iter().enumerate() {
        if let Some(before) = segment.follows
            && next[before].is_none()
            && visible(before)
            && visible(i)
            && can_join(&scene.segments[before], segment, radii[before][1].max(radii[i][0]))
        {
            next[before] = Some(i);
            continues[i] = true;
        }
    }
    let circle: Vec<(f64, f64)> =
        (0..sides).map(|k| sin_cos_degrees(360.0 * k as f64 / sides as f64)).collect();
    for first in (0..scene.segments.len()).filter(|&i| !continues[i] && visible(i)) {
        let chain = std::iter::successors(Some(first), |&i| next[i]);
        let pieces: Vec<(&Segment, [f64; 2])> = chain.map(|i| (&scene.segments[i], radii[i])).collect();
        Tube { circle: &circle, out }.add(&pieces);
    }
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

    /// Direction away from the axis.
    fn outward(&self, (sin, cos): (f64, f64)) -> Vector {
        self.u * cos + self.v * sin
    }

    /// Normal of the tube's side.
    fn normal(&self, at: (f64, f64)) -> Vector {
        (self.outward(at) - self.along * self.slope).normalize()
    }
}

struct Tube<'a> {
    /// `(sin, cos)` of the corners of a cross-section.
    circle: &'a [(f64, f64)],
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
                    normals: vec![normal; self.circle.len()],
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
        for &at in self.circle {
            let outward = before.outward(at);
            // Along the side of the tube up to the plane.
            let slide = outward.dot(&plane) / before.along.dot(&plane);
            ring.vertices.push(self.out.add_vertex(centre + (outward - before.along * slide) * radius));
            let normal = (sides[0].normal(at) + sides[1].normal(at)).normalize();
            ring.normals.push(self.out.add_normal(normal));
        }
        ring
    }

    /// Closes an end by a dome and returns the ring that it stands on. `sign` is -1 at the start.
    fn dome(&mut self, segment: &Segment, centre: Point, radius: f64, section: &Section, sign: f64) -> Ring {
        let outwards = section.along * sign;
        let base = self.joint(centre, radius, [section; 2], [section; 2]);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mut middle = Ring { vertices: Vec::new(), normals: Vec::new() };
        for &at in self.circle {
            let direction = (section.outward(at) + outwards) * half;
            middle.vertices.push(self.out.add_vertex(centre + direction * radius));
            middle.normals.push(self.out.add_normal(direction));
        }
        let pole = (self.out.add_vertex(centre + outwards * radius), self.out.add_normal(outwards));
        let (low, high) = if sign < 0.0 { (&middle, &base) } else { (&base, &middle) };
        self.strip(segment, low, high);
        for k in 0..self.circle.len() {
            let after = (k + 1) % self.circle.len();
            let (a, b) = if sign < 0.0 { (after, k) } else { (k, after) };
            let corner = |k: usize| (middle.vertices[k], middle.normals[k]);
            self.face(segment, [pole, corner(a), corner(b)]);
        }
        base
    }

    /// The side between two rings, the second one further along.
    fn strip(&mut self, segment: &Segment, from: &Ring, to: &Ring) {
        for k in 0..self.circle.len() {
            let after = (k + 1) % self.circle.len();
            let corner = |ring: &Ring, k: usize| (ring.vertices[k], ring.normals[k]);
            let [a, b, c, d] = [corner(from, k), corner(from, after), corner(to, after), corner(to, k)];
            self.face(segment, [a, b, c]);
            self.face(segment, [a, c, d]);
        }
    }

    fn face(&mut self, segment: &Segment, corners: [(u32, u32); 3]) {
        self.out.add_face(segment.owner, segment.material, corners);
    }
}
