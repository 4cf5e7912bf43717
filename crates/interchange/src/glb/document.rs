//! The part of glTF 2.0 that is written, as serde structs (Khronos Group 2021, *glTF 2.0 Specification*, chapter 5).

use std::collections::BTreeMap;

use serde::Serialize;

#[derive(Debug, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) asset: Asset,
    pub(super) scene: usize,
    pub(super) scenes: Vec<Scene>,
    pub(super) nodes: Vec<Node>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) meshes: Vec<Mesh>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) materials: Vec<Material>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) textures: Vec<Texture>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) images: Vec<Image>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) samplers: Vec<Sampler>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) animations: Vec<Animation>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) accessors: Vec<Accessor>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) buffer_views: Vec<View>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) buffers: Vec<Bytes>,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct Asset {
    pub(super) version: &'static str,
    pub(super) generator: &'static str,
    pub(super) extras: serde_json::Value,
}

#[derive(Debug, Serialize)]
pub(super) struct Scene {
    pub(super) name: String,
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct Node {
    pub(super) name: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) children: Vec<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mesh: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) translation: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rotation: Option<[f32; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) scale: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) weights: Option<Vec<f32>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) extras: Option<serde_json::Value>,
}

#[derive(Debug, Serialize)]
pub(super) struct Mesh {
    pub(super) name: String,
    pub(super) primitives: Vec<Primitive>,
}

/// The mode of a primitive that is points.
pub(super) const POINTS: u32 = 0;

#[derive(Debug, Serialize)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<&'static str, usize>,
    /// None of points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) indices: Option<usize>,
    pub(super) material: usize,
    /// Triangles, which is what a file means that does not say, or [`POINTS`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mode: Option<u32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) targets: Vec<BTreeMap<&'static str, usize>>,
}

#[derive(Debug, Serialize)]
pub(super) struct Material {
    pub(super) name: String,
    #[serde(rename = "pbrMetallicRoughness")]
    pub(super) pbr: Pbr,
    #[serde(rename = "doubleSided")]
    pub(super) double_sided: bool,
    #[serde(rename = "alphaMode", skip_serializing_if = "Option::is_none")]
    pub(super) alpha_mode: Option<&'static str>,
}

#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Texture {
    pub(super) sampler: usize,
    pub(super) source: usize,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Image {
    pub(super) name: String,
    pub(super) buffer_view: usize,
    pub(super) mime_type: &'static str,
}

#[derive(Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Sampler {
    pub(super) mag_filter: u32,
    pub(super) min_filter: u32,
    pub(super) wrap_s: u32,
    pub(super) wrap_t: u32,
}

impl Sampler {
    /// Linear between texels and between copies of the picture; beyond its edges it is repeated, or these go on.
    pub(super) fn of(repeats: bool) -> Sampler {
        const LINEAR: u32 = 9729;
        const LINEAR_MIPMAP_LINEAR: u32 = 9987;
        const REPEAT: u32 = 10497;
        const CLAMP_TO_EDGE: u32 = 33071;
        let wrap = if repeats { REPEAT } else { CLAMP_TO_EDGE };
        Sampler { mag_filter: LINEAR, min_filter: LINEAR_MIPMAP_LINEAR, wrap_s: wrap, wrap_t: wrap }
    }
}

#[derive(Debug, Serialize)]
pub(super) struct TextureInfo {
    pub(super) index: usize,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Pbr {
    pub(super) base_color_factor: [f32; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: f32,
    pub(super) roughness_factor: f32,
}

impl Pbr {
    /// A dull surface of this colour.
    pub(super) fn of(base_color_factor: [f32; 4]) -> Pbr {
        Pbr { base_color_factor, base_color_texture: None, metallic_factor: 0.0, roughness_factor: 0.8 }
    }
}

#[derive(Debug, Default, Serialize)]
pub(super) struct Animation {
    pub(super) name: String,
    pub(super) channels: Vec<Channel>,
    pub(super) samplers: Vec<Interpolation>,
}

impl Animation {
    /// Adds a track of a node.
    pub(super) fn add(&mut self, node: usize, path: &'static str, input: usize, output: usize) {
        self.channels.push(Channel { sampler: self.samplers.len(), target: Target { node, path } });
        self.samplers.push(Interpolation { input, output });
    }
}

#[derive(Debug, Serialize)]
pub(super) struct Channel {
    pub(super) sampler: usize,
    pub(super) target: Target,
}

#[derive(Debug, Serialize)]
pub(super) struct Target {
    pub(super) node: usize,
    pub(super) path: &'static str,
}

/// Linear, which is what a file means that does not say.
#[derive(Debug, Serialize)]
pub(super) struct Interpolation {
    pub(super) input: usize,
    pub(super) output: usize,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: usize,
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) shape: &'static str,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) min: Vec<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) max: Vec<f64>,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct View {
    pub(super) buffer: usize,
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) byte_stride: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) target: Option<u32>,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Bytes {
    pub(super) byte_length: usize,
}
