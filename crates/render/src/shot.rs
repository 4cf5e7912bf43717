//! A picture in the making: the triangles of a [`Stage`] in pixels, and their colours in the light.

use std::ops::Range;

use super::draft::Draft;
use super::lens::Lens;
use super::light::Spot;
use super::lighting::Lighting;
use super::mapping::{Cut, Mapping, Pinned};
use super::raster::{self, Image, Pattern, Place};
use super::stage::{Part, Stage};
use super::triangles::{keep_numbered, renumbered};
use super::veil::Veil;
use dlsys_geometry::scene::{Color, Point, Texture, Vector};
use dlsys_threads::each;

/// From so many triangles on, those that are hidden by the ones so far are dropped.
const MOST: usize = 6_000_000;
/// Parts that are made side by side.
const BLOCK: usize = 64;
/// How far the edges of a ribbon are turned away, as those of a stem: sine and cosine.
const TURNED: (f32, f32) = (0.866, 0.5);
/// The same of a hair, a ribbon of less than two pixels: the middle of a pixel is often beside it, and the light is then that on an edge.
/// So the edges have about the mean of what is between.
const TURNED_OF_HAIR: (f32, f32) = (0.5, 0.866);
/// Ribbons of fewer pixels are hairs.
const HAIR: f64 = 2.0;

/// A triangle in pixels.
struct Face {
    corners: [u32; 3],
    normals: [u32; 3],
    surface: u32,
    /// Twice the number of its colour, and 1 if light comes through it.
    look: u32,
}

/// Triangles of a picture.
struct Shot<'a, const N: usize> {
    pattern: &'a Pattern<N>,
    threads: usize,
    /// When there are more, hidden ones are dropped.
    most: usize,
    lens: &'a Lens,
    lighting: &'a Lighting<'a>,
    veil: Option<&'a Veil<'a>>,
    colors: &'a [Color],
    /// By number of a colour: the picture in place of it.
    textures: &'a [Option<&'a Texture>],
    places: Vec<Place>,
    /// By number of a place: where it lies in a picture; of the last ones that have no picture nothing.
    pinned: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    faces: Vec<Face>,
    surface: u32,
}

/// Draws a stage with so many samples.
pub(super) fn draw<const N: usize>(
    pattern: &Pattern<N>,
    threads: usize,
    stage: &Stage,
    lens: &Lens,
    lighting: &Lighting,
) -> Image {
    draw_within(MOST, pattern, threads, stage, lens, lighting)
}

/// The same with about so many triangles in memory, and as many more as are seen.
pub(super) fn draw_within<const N: usize>(
    most: usize,
    pattern: &Pattern<N>,
    threads: usize,
    stage: &Stage,
    lens: &Lens,
    lighting: &Lighting,
) -> Image {
    let [width, height] = lens.size;
    let veil = lighting.haze().map(|haze| Veil::new(haze, lens));
    let mut shot = Shot {
        pattern,
        threads,
        most,
        lens,
        lighting,
        veil: veil.as_ref(),
        colors: &stage.colors,
        textures: &stage.textures,
        places: Vec::new(),
        pinned: Vec::new(),
        normals: Vec::new(),
        faces: Vec::new(),
        surface: 0,
    };
    shot.add_floor();
    for block in stage.parts.chunks(BLOCK) {
        shot.add_block(block, stage);
    }
    let mut pixels = vec![[0; 4]; width * height];
    raster::draw(pattern, threads, lens.size, &shot, &mut pixels);
    Image { width, height, pixels }
}

impl<'a, const N: usize> Shot<'a, N> {
    /// One with nothing in it, for one thread.
    fn emptied(&self) -> Shot<'a, N> {
        Shot {
            threads: 1,
            places: Vec::new(),
            pinned: Vec::new(),
            normals: Vec::new(),
            faces: Vec::new(),
            surface: 0,
            ..*self
        }
    }

    /// Adds parts, in their order, made by several threads. When hidden triangles are dropped does not depend on the number of these.
    fn add_block(&mut self, block: &[Part], stage: &Stage) {
        if let [part] = block {
            return self.add_part(part, stage);
        }
        let (threads, empty) = (self.threads, self.emptied());
        let make = |number: usize| {
            let mut shot = empty.emptied();
            shot.add_part(&block[number], stage);
            shot
        };
        let add = |shot: Shot<N>| {
            self.append(&shot);
            self.drop_hidden();
        };
        if threads <= 1 {
            (0..block.len()).map(make).for_each(add);
        } else {
            each(threads, block.len(), make).into_iter().for_each(add);
        }
    }

    /// Adds a part.
    fn add_part(&mut self, part: &Part, stage: &Stage) {
        stage.with_draft(part, &mut |draft| {
            self.add(draft, part);
            self.drop_hidden();
        });
    }

    /// Where there are too many triangles, drops those that are not seen, and what only these have: what comes later hides more, never less.
    fn drop_hidden(&mut self) {
        if self.faces.len() <= self.most {
            return;
        }
        let seen = raster::seen(self.pattern, self.threads, self.lens.size, self);
        let mut seen = seen.iter();
        self.faces.retain(|_| seen.next().is_some_and(|seen| *seen));
        let corners = |of: fn(&Face) -> [u32; 3]| self.faces.iter().flat_map(of);
        let place = renumbered(self.places.len(), corners(|face| face.corners));
        let normal = renumbered(self.normals.len(), corners(|face| face.normals));
        keep_numbered(&mut self.places, &place);
        keep_numbered(&mut self.pinned, &place);
        keep_numbered(&mut self.normals, &normal);
        for face in &mut self.faces {
            face.corners = face.corners.map(|corner| place[corner as usize]);
            face.normals = face.normals.map(|corner| normal[corner as usize]);
        }
        // Rarely enough to cost no more than the triangles themselves.
        self.most = self.most.max(2 * self.faces.len());
    }

    /// Adds all that is in another one.
    fn append(&mut self, shot: &Shot<N>) {
        let (vertex, normal, surface) = (self.places.len() as u32, self.normals.len() as u32, self.surface);
        self.places.extend_from_slice(&shot.places);
        if !shot.pinned.is_empty() {
            self.pinned.resize(vertex as usize, [0.0; 2]);
            self.pinned.extend_from_slice(&shot.pinned);
        }
        self.normals.extend_from_slice(&shot.normals);
        self.faces.extend(shot.faces.iter().map(|face| Face {
            corners: face.corners.map(|v| vertex + v),
            normals: face.normals.map(|n| normal + n),
            surface: surface + face.surface,
            look: face.look,
        }));
        self.surface += shot.surface;
    }

    /// Adds a draft in its place.
    fn add(&mut self, draft: &Draft, part: &Part) {
        let stems = part.stems.clone();
        if stems.as_ref().is_none_or(Range::is_empty) {
            self.add_mesh(draft, part);
        }
        self.add_ribbons(draft, part, stems.unwrap_or(0..draft.thin()));
        self.surface += 1;
    }

    /// Adds the triangles of a draft in its place.
    fn add_mesh(&mut self, draft: &Draft, part: &Part) {
        let place = part.place.as_ref();
        let (vertex, normal) = (self.places.len() as u32, self.normals.len() as u32);
        let mesh = &draft.mesh;
        let lens = self.lens;
        match place {
            None => {
                self.places.extend(mesh.vertices.iter().map(|&p| lens.place(p)));
                self.normals.extend(mesh.normals.iter().map(|&n| lens.normal(n)));
            }
            Some(place) => {
                self.places.extend(mesh.vertices.iter().map(|&p| lens.place(place.point(p))));
                self.normals.extend(mesh.normals.iter().map(|&n| lens.normal(place.turned(n))));
            }
        }
        if !mesh.places.is_empty() {
            self.pinned.resize(vertex as usize, [0.0; 2]);
            self.pinned.extend(mesh.places.iter().map(|place| place.map(|x| x as f32)));
        }
        let first = self.surface;
        for face in &mesh.faces {
            self.surface = first + face.surface;
            let look = (part.colors + face.material.index() as u32) << 1 | u32::from(face.is_thin);
            let corners = face.corners.map(|(v, _)| vertex + v);
            self.face(corners, face.corners.map(|(_, n)| normal + n), look);
        }
        if self.faces.last().is_none_or(|face| face.corners[0] < vertex) {
            self.places.truncate(vertex as usize);
            self.pinned.truncate(vertex as usize);
            self.normals.truncate(normal as usize);
        }
    }

    /// Adds thin stems of a draft in its place.
    fn add_ribbons(&mut self, draft: &Draft, part: &Part, stems: Range<usize>) {
        let lens = self.lens;
        for ribbon in draft.ribbons(stems, part.place.as_ref(), |p| lens.camera.towards(p)) {
            self.surface += 1;
            let (vertex, normal) = (self.places.len() as u32, self.normals.len() as u32);
            self.places.extend(ribbon.corners.iter().flatten().map(|&p| lens.place(p)));
            let [side, facing] = [ribbon.side, ribbon.facing].map(|v| lens.normal(v));
            let (aside, ahead) = turned([vertex, vertex + 1].map(|corner| self.places[corner as usize]));
            let turned = |sign: f32| [0, 1, 2].map(|k| sign * aside * side[k] + ahead * facing[k]);
            self.normals.extend([turned(-1.0), turned(1.0)]);
            let look = (part.colors + ribbon.material.index() as u32) << 1;
            let count = self.faces.len();
            for corners in [[0, 1, 3], [0, 3, 2]] {
                let normals = corners.map(|k| normal + (k & 1));
                self.face(corners.map(|k| vertex + k), normals, look);
            }
            if self.faces.len() == count {
                self.places.truncate(vertex as usize);
                self.normals.truncate(normal as usize);
            }
        }
    }

    /// Adds what is seen of the floor.
    fn add_floor(&mut self) {
        let outline = self.lighting.floor_outline(self.lens);
        let Some(normal) = self.lighting.floor_normal() else { return };
        let vertex = self.places.len() as u32;
        self.places.extend(outline.iter().map(|&p| self.lens.place(p)));
        let at = self.normals.len() as u32;
        self.normals.push(self.lens.normal(normal));
        self.surface += 1;
        for k in 2..outline.len() as u32 {
            self.face([vertex, vertex + k - 1, vertex + k], [at; 3], FLOOR);
        }
        self.surface += 1;
    }

    /// Adds a triangle if it may be seen.
    fn face(&mut self, corners: [u32; 3], normals: [u32; 3], look: u32) {
        let places = corners.map(|corner| self.places[corner as usize]);
        if may_be_seen(&places, look & 1 == 1, self.lens.size.map(|end| 0..end)) {
            self.faces.push(Face { corners, normals, surface: self.surface, look });
        }
    }
}

/// Whether a triangle is in front of the viewer and in these columns and rows, and not on the far side of a stem.
pub(super) fn may_be_seen([p, q, r]: &[Place; 3], is_thin: bool, [columns, rows]: [Range<usize>; 2]) -> bool {
    let outside = |low: i32, high: i32, within: Range<usize>| {
        i64::from(high) < within.start as i64 * raster::STEPS
            || i64::from(low) > within.end as i64 * raster::STEPS
    };
    let is_behind = p.depth.is_nan() || q.depth.is_nan() || r.depth.is_nan();
    if is_behind
        || outside(p.y.min(q.y).min(r.y), p.y.max(q.y).max(r.y), rows)
        || outside(p.x.min(q.x).min(r.x), p.x.max(q.x).max(r.x), columns)
    {
        return false;
    }
    // A stem is closed: its far side is never seen.
    let wide = |a: i32, b: i32| i64::from(a) - i64::from(b);
    is_thin || wide(q.x, p.x) * wide(r.y, p.y) < wide(q.y, p.y) * wide(r.x, p.x)
}

/// How far the edges of a ribbon are turned away, given its corners at one end.
pub(super) fn turned([p, q]: [Place; 2]) -> (f32, f32) {
    let across = f64::from(q.x - p.x).hypot(f64::from(q.y - p.y));
    if across < HAIR * raster::STEPS as f64 { TURNED_OF_HAIR } else { TURNED }
}

/// The look of the floor.
const FLOOR: u32 = u32::MAX;

impl<const N: usize> Shot<'_, N> {
    /// The picture on a triangle, and where its corners are.
    fn picture(&self, n: usize) -> Option<(&Texture, [Pinned; 3])> {
        let face = &self.faces[n];
        let texture = self.textures.get((face.look >> 1) as usize).copied().flatten()?;
        let pinned = face.corners.map(|corner| {
            let Place { x, y, depth } = self.places[corner as usize];
            let place = self.pinned.get(corner as usize).copied().unwrap_or_default();
            let magnification = self.lens.magnification(depth.into());
            let at = [x, y].map(|at| f64::from(at) / raster::STEPS as f64);
            Pinned { at, place: place.map(f64::from), magnification }
        });
        Some((texture, pinned))
    }

    /// The colour of a triangle at a place between its corners.
    fn color(&self, n: usize, weights: [f64; 3]) -> Color {
        let pictured = self.picture(n).and_then(|(texture, pinned)| {
            Some(texture.color(&Mapping::new(pinned)?.print_between(pinned, weights)))
        });
        match pictured {
            Some(channels) => {
                let [red, green, blue] = channels.map(|channel| (channel + 0.5) as u8);
                Color { red, green, blue }
            }
            None => self.colors[(self.faces[n].look >> 1) as usize],
        }
    }
}

impl<const N: usize> raster::Triangles for Shot<'_, N> {
    fn count(&self) -> usize {
        self.faces.len()
    }

    #[inline(always)]
    fn corners(&self, n: usize) -> [Place; 3] {
        let [p, q, r] = self.faces[n].corners;
        [self.places[p as usize], self.places[q as usize], self.places[r as usize]]
    }

    fn surface(&self, n: usize) -> u32 {
        self.faces[n].surface
    }

    fn cut(&self, n: usize, count: usize) -> Option<Cut<'_>> {
        let (texture, pinned) = self.picture(n)?;
        Cut::new(texture, pinned, count)
    }

    fn is_veiled(&self) -> bool {
        self.veil.is_some()
    }

    fn open(&self, pixel: [usize; 2]) -> [u8; 4] {
        self.veil.map_or([0; 4], |veil| veil.over(pixel, None, [0; 4]))
    }

    fn shade(&self, n: usize, pixel: [usize; 2], weights: [f64; 3]) -> [u8; 4] {
        let [p, q, r] = self.corners(n);
        let depth = (0..3).map(|k| f64::from([p, q, r][k].depth) * weights[k]).sum();
        let seen = self.lens.seen(pixel, depth);
        let shade = self.surface_shade(n, seen, weights);
        self.veil.map_or(shade, |veil| veil.over(pixel, Some(seen.z), shade))
    }
}

impl<const N: usize> Shot<'_, N> {
    /// The colour of a triangle at a place that the camera projects here.
    fn surface_shade(&self, n: usize, seen: Point, weights: [f64; 3]) -> [u8; 4] {
        let face = &self.faces[n];
        let [p, q, r] = face.corners.map(|corner| self.places[corner as usize]);
        if face.look == FLOOR {
            return self.lighting.floor_color(seen);
        }
        let normal = (0..3).fold(Vector::zeros(), |sum, k| {
            let [x, y, z] = self.normals[face.normals[k] as usize];
            sum + Vector::new(f64::from(x), f64::from(y), f64::from(z)) * weights[k]
        });
        // Pixels go down.
        let wide = |a: i32, b: i32| f64::from(a) - f64::from(b);
        let is_front = wide(q.x, p.x) * wide(r.y, p.y) < wide(q.y, p.y) * wide(r.x, p.x);
        let normal =
            normal.try_normalize(1e-12).unwrap_or_else(Vector::z) * if is_front { 1.0 } else { -1.0 };
        let spot = Spot { normal, seen, is_thin: face.look & 1 == 1 };
        let color = self.color(n, weights);
        let Color { red, green, blue } = self.lighting.color(color, self.lighting.strength(&spot));
        [red, green, blue, 255]
    }
}
