//! The file: meshes of lives, nodes of modules, one animation.
//!
//! Everything is linear interpolation, which every program knows. A node is hidden by a scale of 0: extensions for visibility are newer than most
//! importers. Its scale changes within half a millisecond, just before birth and just after death, which need not fall on frames.

mod buffer;
mod document;
mod gases;
mod motion;
mod normals;

use std::collections::{BTreeMap, HashMap};

use dlsys_geometry::scene::{self, MaterialId};
use dlsys_render::{GENERATOR, plain_name};
use serde_json::json;

use crate::life::{Life, Shape};
use crate::mesh::{Cutter, Layout, Places};
use crate::motion::{Clock, Moved};
use crate::stand::Look;
use crate::stem::{Corner, IS_LENGTH, SIZES};
use crate::{Error, Growth, linear};
use buffer::{Buffer, Kind};
use document::{
    Animation, Asset, Document, Material, Mesh, Node, Pbr, Primitive, Sampler, Scene, Texture, TextureInfo,
};

/// Normals of shapes that differ by less than this are those of the mesh.
const SAME_NORMAL: f32 = 0.01;
/// Part of the accuracy that triangles take.
const OF_TRIANGLES: f64 = 0.36;

/// A file that is being made.
struct Writer<'a> {
    growth: &'a Growth,
    cutter: Cutter<'a>,
    clock: Clock,
    buffer: Buffer,
    document: Document,
    /// Numbers of materials; the floor has none in the palette.
    materials: HashMap<Option<MaterialId>, usize>,
    /// Numbers of the meshes of stems, by contour, whether they have a neck, corners and material.
    stems: BTreeMap<(Option<u32>, bool, usize, MaterialId), usize>,
    /// The largest coordinate of a node, in metres.
    farthest: f64,
}

/// The bytes of the file of a run.
pub(crate) fn file(growth: &Growth) -> Result<Vec<u8>, Error> {
    let mut writer = Writer {
        growth,
        cutter: growth.cutter(OF_TRIANGLES),
        clock: growth.clock(),
        buffer: Buffer::default(),
        document: Document::default(),
        materials: HashMap::new(),
        stems: BTreeMap::new(),
        farthest: 0.0,
    };
    writer.asset();
    writer.nodes();
    // Rounding moves a place by half of the distance between two numbers.
    let (metres, off) = (writer.farthest, 0.5 * f64::from(f32::EPSILON) * writer.farthest);
    if off > growth.options.tolerance() {
        return Err(Error::TooFar { metres, off });
    }
    writer.finish()
}

impl Writer<'_> {
    fn asset(&mut self) {
        let growth = self.growth;
        let extras = json!({
            "title": growth.title,
            "first_time": growth.first,
            "last_time": growth.last,
            "seconds_per_unit": growth.options.seconds,
            "metres_per_unit": growth.options.metres,
        });
        self.document.asset = Asset { version: "2.0", generator: GENERATOR, extras };
    }

    /// The root, the nodes of all modules and their tracks, and the floor.
    fn nodes(&mut self) {
        let growth = self.growth;
        self.document.nodes.push(Node { name: growth.title.clone(), ..Node::default() });
        self.document.scenes.push(Scene { name: growth.title.clone(), nodes: vec![0] });
        let meshes: Vec<usize> = growth.lives.lives.iter().map(|life| self.mesh(life)).collect();
        let mut animation = Animation { name: "growth".to_owned(), ..Animation::default() };
        if !self.clock.is_still() {
            // So that the animation lasts as long as the run, whatever moves.
            let input = self.buffer.times(&[0.0, self.clock.end()]);
            let output = self.buffer.vectors(&[[0.0; 3]; 2], Kind::Motion);
            animation.add(0, "translation", input, output);
        }
        for (i, &number) in growth.lives.of_phase.iter().enumerate() {
            let phase = &growth.tracks.phases[i];
            let life = &growth.lives.lives[number];
            let target = self.document.nodes.len();
            let mut node = Node {
                name: name(&plain_name(&phase.kind), &phase.lineage.name(), phase.number),
                mesh: Some(meshes[number]),
                ..Node::default()
            };
            let mut extras = json!({
                "kind": *phase.kind, "lineage": phase.lineage.to_string(), "birth": phase.birth,
            });
            if let Some(ending) = phase.ending {
                extras["death"] = ending.time.into();
                extras["rule"] = growth.rules.get(ending.rule).cloned().into();
            }
            node.extras = Some(extras);
            let tolerance = 0.13 * growth.options.tolerance();
            let moved = Moved { phase, life, clock: &self.clock, tolerance };
            let (buffer, farthest) = (&mut self.buffer, &mut self.farthest);
            let (place, moves) = (&mut node, &mut animation);
            let tracks = motion::Tracks { target, node: place, animation: moves, buffer, farthest };
            if tracks.write(&moved) {
                self.document.nodes[0].children.push(target);
                self.document.nodes.push(node);
            }
        }
        self.stands();
        self.gases(&mut animation);
        if !animation.channels.is_empty() {
            self.document.animations.push(animation);
        }
        self.floor();
    }

    /// The plants of other models: those of one look share a mesh.
    fn stands(&mut self) {
        let growth = self.growth;
        let meshes: Vec<usize> = growth.stands.looks.iter().map(|look| self.look(look)).collect();
        for stand in &growth.stands.stands {
            let kind = plain_name(&stand.kind);
            self.farthest = self.farthest.max(stand.frame.origin.coords.amax());
            let translation: [f32; 3] = stand.frame.origin.coords.map(|x| x as f32).into();
            let rotation: [f32; 4] = stand.frame.turn.coords.map(|x| x as f32).into();
            let scale = stand.scales.map(|x| x as f32);
            let number = self.document.nodes.len();
            self.document.nodes[0].children.push(number);
            self.document.nodes.push(Node {
                name: name(&kind, &stand.lineage.name(), 0),
                mesh: Some(meshes[stand.look]),
                translation: Some(translation).filter(|at| *at != [0.0; 3]),
                rotation: Some(rotation).filter(|turn| *turn != [0.0, 0.0, 0.0, 1.0]),
                scale: Some(scale).filter(|scale| *scale != [1.0; 3]),
                extras: Some(json!({ "kind": *stand.kind, "lineage": stand.lineage.to_string() })),
                ..Node::default()
            });
        }
    }

    /// The mesh of a look.
    fn look(&mut self, look: &Look) -> usize {
        let layout = self.cutter.layout(&look.form, &look.paint, std::slice::from_ref(&look.numbers));
        let places = layout.places(&look.numbers);
        let primitives = self.primitives(&layout, &[places]);
        let number = self.document.meshes.len();
        self.document.meshes.push(Mesh { name: format!("{}-{number}", plain_name(&look.kind)), primitives });
        number
    }

    /// The mesh of a life.
    fn mesh(&mut self, life: &Life) -> usize {
        let number = self.document.meshes.len();
        let kind = plain_name(&life.kind);
        let (shapes, examples) = match &life.shape {
            Shape::Stem { contour, neck, size, weights } => {
                return self.stem(life, (*contour, *neck), *size, weights);
            }
            Shape::Still(shape) => (std::slice::from_ref(shape), &[][..]),
            Shape::Mixed { shapes, examples, .. } => (&shapes[..], &examples[..]),
        };
        let layout = self.cutter.layout(&life.form, &life.paint, shapes);
        let mut all: Vec<Vec<Places>> = shapes.iter().map(|shape| layout.places(shape)).collect();
        normals::fit(&layout, examples, &mut all);
        let primitives = self.primitives(&layout, &all);
        self.document.meshes.push(Mesh { name: format!("{kind}-{number}"), primitives });
        number
    }

    fn primitives(&mut self, layout: &Layout, all: &[Vec<Places>]) -> Vec<Primitive> {
        let mut primitives = Vec::new();
        let pinned = layout.pinned();
        for (i, (material, triangles)) in layout.primitives.iter().enumerate() {
            if triangles.is_empty() {
                continue;
            }
            let mut base = all[0][i].clone();
            for normal in base.normals.iter_mut().filter(|normal| **normal == [0.0; 3]) {
                *normal = [0.0, 1.0, 0.0];
            }
            let shapes: Vec<Places> = all[1..].iter().map(|shape| difference(&shape[i], &base)).collect();
            let turns = shapes.iter().flat_map(|s| &s.normals).flatten().any(|x| x.abs() > SAME_NORMAL);
            let targets = shapes.iter().map(|shape| {
                let mut target = BTreeMap::new();
                target.insert("POSITION", self.buffer.vectors(&shape.positions, Kind::Place));
                if turns {
                    target.insert("NORMAL", self.buffer.vectors(&shape.normals, Kind::Normal));
                }
                target
            });
            let targets: Vec<_> = targets.collect();
            let mut attributes = BTreeMap::from([
                ("POSITION", self.buffer.vectors(&base.positions, Kind::Place)),
                ("NORMAL", self.buffer.vectors(&base.normals, Kind::Normal)),
            ]);
            if !pinned[i].is_empty() {
                // Down from the upper edge.
                let places: Vec<[f32; 2]> = pinned[i].iter().map(|[u, v]| [*u, 1.0 - v]).collect();
                attributes.insert("TEXCOORD_0", self.buffer.places(&places));
            }
            let indices = Some(self.buffer.indices(triangles));
            let material = self.material(Some(*material));
            primitives.push(Primitive { attributes, indices, material, mode: None, targets });
        }
        primitives
    }

    /// The mesh of straight stems: all sizes are 1; its targets make them 0.
    fn stem(&mut self, life: &Life, form: (Option<u32>, bool), size: f32, weights: &[f32]) -> usize {
        let count = life.shape.targets();
        let radii = weights.chunks_exact(count).flat_map(|own| own.iter().zip(IS_LENGTH));
        let thickest = radii.filter(|(_, is_length)| !is_length).map(|(w, _)| 1.0 - w).fold(0.0, f32::max);
        let tube = self.cutter.tube(form, f64::from(thickest * size));
        let material = life.paint.first().copied().flatten().unwrap_or(MaterialId::STEM);
        let key = (form.0, form.1, tube.corners.len(), material);
        if let Some(&known) = self.stems.get(&key) {
            return known;
        }
        // The frame of a stem: its direction is +Y, across is -X.
        let axes =
            [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]].map(dlsys_geometry::scene::Vector::from);
        let turned = |of: [f64; 3]| -> [f32; 3] { Corner::turned(of, axes).map(|x| x as f32).into() };
        let side = |corner: &Corner| turned(corner.place);
        let base = |corner: &Corner| {
            let [height, radius] = corner.sized(&[1.0; SIZES]).map(|x| x as f32);
            let [x, y, z] = side(corner).map(|x| x * radius);
            [x, y + height, z]
        };
        // What a corner has of a size, taken away.
        let without = |corner: &Corner, k: usize| -> [f32; 3] {
            let share = corner.shares[k] as f32;
            if IS_LENGTH[k] { [0.0, 0.0 - share, 0.0] } else { side(corner).map(|x| 0.0 - x * share) }
        };
        let corners = &tube.corners;
        let places: Vec<[f32; 3]> = corners.iter().map(base).collect();
        let normals: Vec<[f32; 3]> = corners.iter().map(|c| turned(c.normal)).collect();
        let targets = (0..count).map(|k| {
            let moved: Vec<[f32; 3]> = corners.iter().map(|corner| without(corner, k)).collect();
            BTreeMap::from([("POSITION", self.buffer.vectors(&moved, Kind::Place))])
        });
        let targets: Vec<_> = targets.collect();
        let attributes = BTreeMap::from([
            ("POSITION", self.buffer.vectors(&places, Kind::Place)),
            ("NORMAL", self.buffer.vectors(&normals, Kind::Normal)),
        ]);
        let triangles: Vec<u32> = tube.triangles.iter().flatten().copied().collect();
        let indices = Some(self.buffer.indices(&triangles));
        let number = self.document.meshes.len();
        let name = format!("stem-{number}");
        let material = self.material(Some(material));
        let primitives = vec![Primitive { attributes, indices, material, mode: None, targets }];
        self.document.meshes.push(Mesh { name, primitives });
        self.stems.insert(key, number);
        number
    }

    /// The number of a material; `None` is the floor.
    fn material(&mut self, id: Option<MaterialId>) -> usize {
        if let Some(&known) = self.materials.get(&id) {
            return known;
        }
        let found = id.and_then(|id| self.cutter.palette.materials().get(id.index()));
        let (name, color) = match found {
            Some(material) => (material.name.to_string(), material.color),
            None => ("ground".to_owned(), self.growth.floor_color),
        };
        let mut pbr = Pbr::of(linear(color));
        let mut alpha_mode = None;
        if let Some(texture) = found.and_then(|material| material.texture.as_ref()) {
            // The factor is multiplied with the picture.
            pbr.base_color_factor = [1.0; 4];
            pbr.base_color_texture = Some(TextureInfo { index: self.texture(texture) });
            alpha_mode = texture.picture.is_cut_out().then_some("MASK");
        }
        let number = self.document.materials.len();
        self.document.materials.push(Material { name, pbr, double_sided: true, alpha_mode });
        self.materials.insert(id, number);
        number
    }

    /// The number of a texture.
    fn texture(&mut self, texture: &scene::Texture) -> usize {
        let sampler = number_of(&mut self.document.samplers, Sampler::of(texture.repeats));
        let source = self.buffer.picture(&texture.picture);
        number_of(&mut self.document.textures, Texture { sampler, source })
    }

    /// The floor that the model declares, as a large square.
    fn floor(&mut self) {
        let Some((corners, triangles)) = self.growth.floor() else { return };
        let attributes = BTreeMap::from([
            ("POSITION", self.buffer.vectors(&corners, Kind::Place)),
            ("NORMAL", self.buffer.vectors(&[[0.0, 1.0, 0.0]; 4], Kind::Normal)),
        ]);
        let indices = Some(self.buffer.indices(&triangles));
        let material = self.material(None);
        let primitives = vec![Primitive { attributes, indices, material, mode: None, targets: Vec::new() }];
        let mesh = Some(self.document.meshes.len());
        self.document.meshes.push(Mesh { name: "ground".to_owned(), primitives });
        let node = self.document.nodes.len();
        self.document.nodes[0].children.push(node);
        self.document.nodes.push(Node { name: "ground".to_owned(), mesh, ..Node::default() });
    }

    fn finish(mut self) -> Result<Vec<u8>, Error> {
        let bytes = self.buffer.finish(&mut self.document);
        let mut text = serde_json::to_vec(&self.document).unwrap_or_default();
        text.resize(text.len().next_multiple_of(4), b' ');
        let has_bytes = !bytes.is_empty();
        let total = 12 + 8 + text.len() + if has_bytes { 8 + bytes.len() } else { 0 };
        let fits = |length: usize| u32::try_from(length).map_err(|_| Error::File { bytes: total as u64 });
        let mut file = Vec::with_capacity(total);
        file.extend(b"glTF");
        file.extend(2_u32.to_le_bytes());
        file.extend(fits(total)?.to_le_bytes());
        file.extend(fits(text.len())?.to_le_bytes());
        file.extend(b"JSON");
        file.extend(text);
        if has_bytes {
            file.extend(fits(bytes.len())?.to_le_bytes());
            file.extend(b"BIN\0");
            file.extend(bytes);
        }
        Ok(file)
    }
}

/// The number of an item of a list, to which it is added unless it is there.
fn number_of<T: PartialEq>(all: &mut Vec<T>, item: T) -> usize {
    let known = all.iter().position(|known| *known == item);
    known.unwrap_or_else(|| {
        all.push(item);
        all.len() - 1
    })
}

/// A shape as differences from the base; where it has no normal, it has that of the base.
fn difference(shape: &Places, base: &Places) -> Places {
    let minus = |a: &[f32; 3], b: &[f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let positions = shape.positions.iter().zip(&base.positions).map(|(a, b)| minus(a, b)).collect();
    let turned = |(a, b): (&[f32; 3], &[f32; 3])| if *a == [0.0; 3] { [0.0; 3] } else { minus(a, b) };
    Places { positions, normals: shape.normals.iter().zip(&base.normals).map(turned).collect() }
}

/// `KIND.LINEAGE`, as in OBJ files; with a number where a module goes on with other parts.
fn name(kind: &str, lineage: &str, number: u32) -> String {
    match number {
        0 => format!("{kind}.{lineage}"),
        _ => format!("{kind}.{lineage}.{}", number + 1),
    }
}
