//! A scene as a Wavefront OBJ mesh, with normals, materials, and one group for each module.
//!
//! A module's group is named `KIND.LINEAGE`, the same in every frame. Segments that share a ring of a tube
//! share its vertices across their groups, so a tube is one closed mesh.
//!
//! The mesh is never in memory as a whole: parts of the text are made on several threads and written at once.

use super::{Companion, Content, Description, Drawing, Exporter};
use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;

use crate::name::{Names, pictures};
use crate::text::{Corner, Text};
use crate::triangles::{Faces, Points, Ring, Solid};
use crate::{GENERATOR, Page, floor, number, relay};
use dlsys_geometry::scene::{Face, MaterialId, OwnerId, Palette, Picture, Point, Scene, Texture, Vector};

/// Name of the material library that all frames refer to.
const MATERIALS: &str = "materials.mtl";
/// Decimals of a normal.
const NORMAL_DECIMALS: usize = 4;
/// Decimals of a place in a picture: a hundredth of a texel of the largest one.
const PLACE_DECIMALS: usize = 6;
/// Approximate number of points of a part of the text: some hundred kilobytes, which fit into a cache.
const PART: usize = 6000;

/// A part of the text; items by number, of faces in the order of owners.
enum Part {
    Vertices(Range<usize>),
    Normals(Range<usize>),
    Places(Range<usize>),
    Faces(Range<usize>),
}

/// Wavefront OBJ.
pub(crate) struct Obj;

impl Exporter for Obj {
    fn description(&self) -> Description {
        Description { name: "obj", about: "Meshes in three dimensions", content: Content::Mesh }
    }

    fn write(
        &self,
        Drawing { scene, writer, title, .. }: Drawing<'_>,
        out: &mut (dyn Write + Send),
    ) -> io::Result<()> {
        let (scene, _) = floor::added(scene, &writer.fit, None);
        let scene = &*scene;
        let solid = Solid::new(scene, &writer.fit, writer.sides);
        if solid.counts.contains(&u32::MAX) {
            return Err(io::Error::other("a mesh has at most 4e9 points: choose a coarser accuracy"));
        }
        let names = Names::new(scene, '.');
        let order = solid.by_owner();
        let points = solid.parts(0..solid.len(), PART);
        let faces = whole_groups(&solid, &order);
        let parts: Vec<Part> = (points.iter().cloned().map(Part::Vertices))
            .chain(points.iter().cloned().map(Part::Normals))
            .chain(points.iter().filter(|_| solid.has_places).cloned().map(Part::Places))
            .chain(faces.into_iter().map(Part::Faces))
            .collect();
        let title: String = title.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        writeln!(out, "# {GENERATOR}\n# {title}\n# Up axis: +Y; front: +Z. Units: those of the model.")?;
        writeln!(out, "mtllib {MATERIALS}")?;
        let decimals = number::decimals_for(writer.fit.extent);
        let make = |part: usize, draft: &mut Draft| {
            draft.text.clear();
            match &parts[part] {
                Part::Vertices(items) => {
                    solid.points(items.clone(), &mut Vertices { text: &mut draft.text, decimals });
                }
                Part::Normals(items) => solid.points(items.clone(), &mut Normals { text: &mut draft.text }),
                Part::Places(items) => solid.points(items.clone(), &mut Places { text: &mut draft.text }),
                Part::Faces(items) => draft.groups(&solid, &names, &order[items.clone()]),
            }
        };
        relay::write(writer.threads, parts.len(), make, |draft| draft.text.bytes(), out)?;
        gases(scene, solid.counts[0], decimals, out)
    }

    fn companions(&self, scene: &Scene) -> Vec<Companion> {
        let scene = scene.flattened();
        let mut palette = scene.palette.clone();
        if scene.surroundings.floor.is_some() {
            palette.add("ground", scene.surroundings.floor_color.unwrap_or(Page::BACKGROUND));
        }
        let pictures = pictures(&palette);
        let library = Companion { name: MATERIALS.to_owned(), bytes: materials(&palette, &pictures) };
        let copies = pictures.into_iter();
        let copies = copies.map(|(picture, name)| Companion { name, bytes: picture.file.clone() });
        [library].into_iter().chain(copies).collect()
    }
}

/// The middles of blobs as points, in a group for each gas, behind so many vertices.
fn gases(scene: &Scene, vertices: u32, decimals: usize, out: &mut (dyn Write + Send)) -> io::Result<()> {
    // Of one line each, so that the text is never in memory as a whole.
    const LINE: usize = 20;
    let mut next = u64::from(vertices) + 1;
    for gas in scene.gases.iter().filter(|gas| !gas.blobs.is_empty()) {
        let mut text = Text::default();
        for blobs in gas.blobs.chunks(PART) {
            text.clear();
            blobs.iter().for_each(|blob| text.triple(b"v", &blob.centre.coords, decimals));
            out.write_all(text.bytes())?;
        }
        writeln!(out, "g gas.{}", gas.name)?;
        let end = next + gas.blobs.len() as u64;
        for first in (next..end).step_by(LINE) {
            write!(out, "p")?;
            (first..end.min(first + LINE as u64)).try_for_each(|number| write!(out, " {number}"))?;
            writeln!(out)?;
        }
        next = end;
    }
    Ok(())
}

/// Parts of a list of items by owner in which no owner is cut.
fn whole_groups(solid: &Solid, order: &[u32]) -> Vec<Range<usize>> {
    let mut parts = solid.parts(order.iter().map(|&n| n as usize), PART);
    let owner = |i: usize| solid.owner_of(order[i] as usize);
    let mut start = 0;
    for part in &mut parts {
        part.start = start;
        part.end = part.end.max(start);
        while (1..order.len()).contains(&part.end) && owner(part.end - 1) == owner(part.end) {
            part.end += 1;
        }
        start = part.end;
    }
    parts
}

/// Writes vertices and leaves out normals.
struct Vertices<'t> {
    text: &'t mut Text,
    decimals: usize,
}

impl Points for Vertices<'_> {
    fn vertex(&mut self, at: impl FnOnce() -> Point) {
        self.text.triple(b"v", &at().coords, self.decimals);
    }

    fn normal(&mut self, _: impl FnOnce() -> Vector) {}
}

/// Writes normals and leaves out vertices.
struct Normals<'t> {
    text: &'t mut Text,
}

impl Points for Normals<'_> {
    fn vertex(&mut self, _: impl FnOnce() -> Point) {}

    fn normal(&mut self, of: impl FnOnce() -> Vector) {
        self.text.triple(b"vn", &of(), NORMAL_DECIMALS);
    }
}

/// Writes places in pictures only.
struct Places<'t> {
    text: &'t mut Text,
}

impl Points for Places<'_> {
    fn vertex(&mut self, _: impl FnOnce() -> Point) {}

    fn normal(&mut self, _: impl FnOnce() -> Vector) {}

    fn places(&mut self, places: &[[f64; 2]]) {
        places.iter().for_each(|place| self.text.numbers(b"vt", place, PLACE_DECIMALS));
    }
}

/// The text of a part, and corners of rings, which belong to many faces.
#[derive(Default)]
struct Draft {
    text: Text,
    low: Corners,
    high: Corners,
    /// Those of a mesh.
    mesh: Vec<Corner>,
}

/// Corners of a ring, the first one once more after the last.
#[derive(Default)]
struct Corners {
    of: Option<Ring>,
    corners: Vec<Corner>,
}

impl Corners {
    fn set(&mut self, ring: Ring) {
        if self.of == Some(ring) {
            return;
        }
        self.of = Some(ring);
        self.corners.clear();
        self.corners.extend((0..ring.sides).map(|k| {
            let (vertex, normal) = ring.corner(k);
            Corner::new(vertex, normal)
        }));
        self.corners.extend_from_within(..1);
    }
}

impl Draft {
    /// Groups of items that are given by owner.
    fn groups(&mut self, solid: &Solid, names: &Names, items: &[u32]) {
        let (mut group, mut of) = (None, None);
        let palette = &solid.scene.palette;
        solid.faces(items, self, |draft, owner: OwnerId, material: MaterialId, _| {
            if group != Some(owner) {
                group = Some(owner);
                draft.text.words(&[b"g ", names.get(owner).as_bytes(), b"\n"]);
            }
            // Each part tells its material: what comes before it, is written on another thread.
            if of != Some(material) {
                of = Some(material);
                draft.text.words(&[b"usemtl ", palette.get(material).name.as_bytes(), b"\n"]);
            }
        });
    }
}

impl Faces for Draft {
    fn face(&mut self, corners: [(u32, u32); 3]) {
        let [a, b, c] = corners.map(|(vertex, normal)| Corner::new(vertex, normal));
        self.text.line(|line| line.face([&a, &b, &c]));
    }

    fn mesh(&mut self, [vertex, normal]: [u32; 2], vertices: usize, faces: &[Face]) {
        if 3 * faces.len() <= vertices {
            for face in faces {
                self.face(face.corners.map(|k| (vertex + k, normal + k)));
            }
            return;
        }
        self.mesh.clear();
        self.mesh.extend((0..vertices as u32).map(|k| Corner::new(vertex + k, normal + k)));
        for face in faces {
            let [a, b, c] = face.corners.map(|k| &self.mesh[k as usize]);
            self.text.line(|line| line.face([a, b, c]));
        }
    }

    fn pictured(&mut self, corners: [(u32, u32); 3], places: [u32; 3]) {
        self.text.words(&[b"f"]);
        for ((vertex, normal), place) in corners.into_iter().zip(places) {
            // OBJ counts from 1.
            let [vertex, place, normal] = [vertex, place, normal].map(|number| u64::from(number) + 1);
            self.text.words(&[format!(" {vertex}/{place}/{normal}").as_bytes()]);
        }
        self.text.words(&[b"\n"]);
    }

    fn strip(&mut self, from: Ring, to: Ring) {
        if self.high.of == Some(from) {
            std::mem::swap(&mut self.low, &mut self.high);
        }
        self.low.set(from);
        self.high.set(to);
        for (low, high) in self.low.corners.windows(2).zip(self.high.corners.windows(2)) {
            let ([a, b], [d, c]) = (low, high) else { continue };
            self.text.line(|line| {
                if !from.point {
                    line.face([a, b, c]);
                }
                if !to.point {
                    line.face([a, c, d]);
                }
            });
        }
    }

    fn fan(&mut self, pole: (u32, u32), ring: Ring, reversed: bool) {
        let tip = Corner::new(pole.0, pole.1);
        // Where the strip before it has left it.
        if self.low.of == Some(ring) {
            std::mem::swap(&mut self.low, &mut self.high);
        }
        self.high.set(ring);
        for side in self.high.corners.windows(2) {
            let [a, b] = side else { continue };
            self.text.line(|line| line.face(if reversed { [&tip, b, a] } else { [&tip, a, b] }));
        }
    }
}

/// The material library. Programs multiply the picture by `Kd`, or leave that out.
fn materials(palette: &Palette, pictures: &[(Arc<Picture>, String)]) -> Vec<u8> {
    let mut out = Text::default();
    out.words(&[b"# ", GENERATOR.as_bytes(), b"\n"]);
    for material in palette.materials() {
        out.words(&[b"\nnewmtl ", material.name.as_bytes(), b"\n"]);
        let color = if material.texture.is_some() { [1.0; 3] } else { material.color.channels() };
        for (keyword, strength) in [(b"Ka", 0.2), (b"Kd", 1.0)] {
            out.triple(keyword, &(Vector::from(color) * strength), NORMAL_DECIMALS);
        }
        out.words(&[b"Ks 0.05 0.05 0.05\nNs 20\nd 1\nillum 2\n"]);
        let Some(Texture { picture, .. }) = &material.texture else { continue };
        for (_, name) in pictures.iter().filter(|(known, _)| known == picture) {
            out.words(&[b"map_Kd ", name.as_bytes(), b"\n"]);
            if picture.is_cut_out() {
                out.words(&[b"map_d ", name.as_bytes(), b"\n"]);
            }
        }
    }
    out.bytes().to_vec()
}
