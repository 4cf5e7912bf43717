//! Gases, and particles of soil, as points: a mesh of points for each frame, which is seen until the next one.
//!
//! Their number changes from frame to frame, and a track of a glTF file moves what is there. So nothing is between two frames; in USDA files, too.

use std::collections::BTreeMap;

use serde_json::json;

use super::Writer;
use super::buffer::Kind;
use super::document::{Animation, Material, Mesh, Node, POINTS, Pbr, Primitive};
use crate::gases::GasTrack;
use crate::linear;
use crate::motion::APART;

/// The attribute with the widths of points in metres: two standard deviations of blobs, diameters of particles.
const WIDTH: &str = "_WIDTH";

impl Writer<'_> {
    /// A node for each gas, with one for each frame in which there is any of it.
    pub(super) fn gases(&mut self, animation: &mut Animation) {
        let growth = self.growth;
        for gas in &growth.gases {
            let name = gas.name.clone();
            let material = self.document.materials.len();
            let pbr = Pbr::of(linear(gas.color));
            let look = Material { name: name.clone(), pbr, double_sided: true, alpha_mode: None };
            self.document.materials.push(look);
            let children = self.frames(gas, material, animation);
            let number = self.document.nodes.len();
            self.document.nodes[0].children.push(number);
            let extras = gas.gas.as_ref().map(|name| json!({ "gas": &**name }));
            self.document.nodes.push(Node { name, children, extras, ..Node::default() });
        }
    }

    fn frames(&mut self, gas: &GasTrack, material: usize, animation: &mut Animation) -> Vec<usize> {
        let mut nodes = Vec::new();
        for (number, frame) in gas.frames.iter().enumerate() {
            if frame.points.is_empty() {
                continue;
            }
            let attributes = BTreeMap::from([
                ("POSITION", self.buffer.vectors(&frame.points, Kind::Place)),
                (WIDTH, self.buffer.sizes(&frame.widths)),
            ]);
            let points =
                Primitive { attributes, indices: None, material, mode: Some(POINTS), targets: Vec::new() };
            let name = format!("{}.{number}", gas.name);
            let mesh = Some(self.document.meshes.len());
            self.document.meshes.push(Mesh { name: name.clone(), primitives: vec![points] });
            let node = self.document.nodes.len();
            // Seen from this frame to the next, with as short a change as other nodes have.
            let next = gas.frames.get(number + 1).map(|next| next.seconds as f32);
            let begin = frame.seconds as f32;
            let mut keys = Vec::new();
            if begin > 0.0 {
                keys.extend([((begin - APART).max(0.0), 0.0), (begin, 1.0)]);
            }
            if let Some(end) = next {
                if keys.is_empty() {
                    keys.push((begin, 1.0));
                }
                let last = end - APART;
                if last > begin {
                    keys.push((last, 1.0));
                }
                keys.push((end, 0.0));
            }
            if !keys.is_empty() {
                let (times, scales): (Vec<f32>, Vec<[f32; 3]>) =
                    keys.into_iter().map(|(time, scale)| (time, [scale; 3])).unzip();
                let input = self.buffer.times(&times);
                let output = self.buffer.vectors(&scales, Kind::Motion);
                animation.add(node, "scale", input, output);
            }
            let scale = next.map(|_| [0.0; 3]);
            self.document.nodes.push(Node { name, mesh, scale, ..Node::default() });
            nodes.push(node);
        }
        nodes
    }
}
