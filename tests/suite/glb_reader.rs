//! A reader of GLB files for tests: what a program that plays the file shows at a time. It shares nothing with the writer but the specification.

use std::collections::BTreeMap;

use dlsys::scene::{Point, Vector};
use serde_json::Value;

/// A file.
pub struct Glb {
    pub json: Value,
    bytes: Vec<u8>,
    /// By node and path: times, and values one after another.
    tracks: BTreeMap<(u64, String), (Vec<f64>, Vec<f64>)>,
}

/// What a node shows.
pub struct Shown {
    pub vertices: Vec<Point>,
    pub triangles: Vec<[usize; 3]>,
}

impl Glb {
    /// Reads a file, and checks that the parts of its frame agree.
    pub fn read(file: &[u8]) -> Glb {
        let number =
            |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes")) as usize;
        assert_eq!((&file[..4], number(4), number(8)), (&b"glTF"[..], 2, file.len()));
        let text = number(12);
        assert_eq!((&file[16..20], text % 4), (&b"JSON"[..], 0));
        let json: Value = serde_json::from_slice(&file[20..20 + text]).expect("JSON");
        let bytes = match file.get(20 + text..).filter(|rest| !rest.is_empty()) {
            Some(rest) => {
                assert_eq!((number(20 + text), &rest[4..8]), (rest.len() - 8, &b"BIN\0"[..]));
                rest[8..].to_vec()
            }
            None => Vec::new(),
        };
        let mut glb = Glb { json, bytes, tracks: BTreeMap::new() };
        let mut tracks = BTreeMap::new();
        for animation in glb.json["animations"].as_array().into_iter().flatten() {
            for channel in animation["channels"].as_array().expect("channels") {
                let sampler = &animation["samplers"][index(&channel["sampler"])];
                let (input, output) = (glb.accessor(&sampler["input"]), glb.accessor(&sampler["output"]));
                assert!(input.windows(2).all(|pair| pair[0] < pair[1]), "keys ascend");
                assert!(input[0] >= 0.0 && output.len() % input.len() == 0);
                let path = channel["target"]["path"].as_str().expect("a path").to_owned();
                let node = channel["target"]["node"].as_u64().expect("a node");
                assert!(tracks.insert((node, path), (input, output)).is_none(), "one track of a kind");
            }
        }
        glb.tracks = tracks;
        glb
    }

    /// The numbers of an accessor; those that have bounds are within them.
    fn accessor(&self, number: &Value) -> Vec<f64> {
        let accessor = &self.json["accessors"][index(number)];
        let view = &self.json["bufferViews"][index(&accessor["bufferView"])];
        let width = match accessor["type"].as_str() {
            Some("SCALAR") => 1,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            other => panic!("{other:?}"),
        };
        let offset = |value: &Value| value["byteOffset"].as_u64().unwrap_or(0) as usize;
        let kind = accessor["componentType"].as_u64().expect("a type");
        let size = if kind == 5123 { 2 } else { 4 };
        let count = index(&accessor["count"]) * width;
        let (from, length) = (offset(accessor), index(&view["byteLength"]));
        assert!(from + count * size <= length && (offset(view) + from).is_multiple_of(size));
        let bytes = &self.bytes[offset(view) + from..][..count * size];
        let values: Vec<f64> = match kind {
            5123 => bytes.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b).into()).collect(),
            5125 => bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b).into()).collect(),
            5126 => bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b).into()).collect(),
            other => panic!("{other}"),
        };
        for (bound, pick) in [("min", f64::min as fn(f64, f64) -> f64), ("max", f64::max)] {
            for (k, bound) in accessor[bound].as_array().into_iter().flatten().enumerate() {
                let found = values.iter().skip(k).step_by(width).copied().reduce(pick);
                assert_eq!(found, bound.as_f64());
            }
        }
        values
    }

    /// Seconds of the animation.
    pub fn duration(&self) -> f64 {
        self.tracks.values().flat_map(|(times, _)| times).fold(0.0, |a, b| a.max(*b))
    }

    pub fn nodes(&self) -> &Vec<Value> {
        self.json["nodes"].as_array().expect("nodes")
    }

    fn value(&self, node: usize, path: &str, time: f64, rest: &[f64]) -> Vec<f64> {
        let Some((times, values)) = self.tracks.get(&(node as u64, path.to_owned())) else {
            let own = self.nodes()[node][path].as_array();
            return own.map_or(rest.to_vec(), |own| own.iter().filter_map(Value::as_f64).collect());
        };
        let width = values.len() / times.len();
        let row = |i: usize| &values[i * width..(i + 1) * width];
        let after = times.partition_point(|t| *t <= time);
        if after == 0 || after == times.len() {
            return row(after.saturating_sub(1)).to_vec();
        }
        let (a, b) = (row(after - 1), row(after));
        let w = (time - times[after - 1]) / (times[after] - times[after - 1]);
        if path != "rotation" {
            return a.iter().zip(b).map(|(a, b)| a + (b - a) * w).collect();
        }
        let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        let (sign, angle) = (dot.signum(), dot.abs().min(1.0).acos());
        let parts = match angle.sin() {
            sin if sin > 1e-9 => [((1.0 - w) * angle).sin() / sin, (w * angle).sin() / sin * sign],
            _ => [1.0 - w, w * sign],
        };
        a.iter().zip(b).map(|(a, b)| a * parts[0] + b * parts[1]).collect()
    }

    /// The scale of a node at a time in seconds.
    pub fn scale(&self, node: usize, time: f64) -> f64 {
        self.value(node, "scale", time, &[1.0; 3])[0]
    }

    /// What is shown at a time in seconds, by the name of the node; numbers of phases behind the lineage are left out.
    pub fn shown(&self, time: f64) -> BTreeMap<String, Shown> {
        let mut shown: BTreeMap<String, (f64, Shown)> = BTreeMap::new();
        for (number, node) in self.nodes().iter().enumerate() {
            let scale = self.scale(number, time);
            if node["mesh"].is_null() || scale == 0.0 {
                continue;
            }
            let mesh = &self.json["meshes"][index(&node["mesh"])];
            let at = Vector::from_column_slice(&self.value(number, "translation", time, &[0.0; 3]));
            let turn = self.value(number, "rotation", time, &[0.0, 0.0, 0.0, 1.0]);
            let turn = nalgebra::Quaternion::new(turn[3], turn[0], turn[1], turn[2]);
            let turn = nalgebra::UnitQuaternion::new_normalize(turn);
            let weights = self.value(number, "weights", time, &[]);
            // While one phase gives way to the next, the one that is whole counts.
            let name = node["name"].as_str().expect("a name");
            let module: Vec<&str> = name.splitn(3, '.').take(2).collect();
            if shown.get(&module.join(".")).is_some_and(|(other, _)| *other > scale) {
                continue;
            }
            let mut all = Shown { vertices: Vec::new(), triangles: Vec::new() };
            for primitive in mesh["primitives"].as_array().expect("primitives") {
                let mut places = self.accessor(&primitive["attributes"]["POSITION"]);
                let targets = primitive["targets"].as_array().map_or(&[][..], Vec::as_slice);
                assert_eq!(weights.len(), targets.len());
                for (target, weight) in targets.iter().zip(&weights) {
                    let moved = self.accessor(&target["POSITION"]);
                    places.iter_mut().zip(moved).for_each(|(x, by)| *x += weight * by);
                }
                let first = all.vertices.len();
                let point = |p: &[f64]| Point::from(turn * (Vector::from_column_slice(p) * scale) + at);
                all.vertices.extend(places.chunks_exact(3).map(point));
                // Points have no corners.
                let is_points = primitive["mode"] == 0;
                let corners = if is_points { Vec::new() } else { self.accessor(&primitive["indices"]) };
                all.triangles
                    .extend(corners.as_chunks().0.iter().map(|t| t.map(|i: f64| i as usize + first)));
            }
            shown.insert(module.join("."), (scale, all));
        }
        shown.into_iter().map(|(name, (_, all))| (name, all)).collect()
    }
}

impl Shown {
    /// The distance of a point from the nearest triangle.
    pub fn distance(&self, p: Point) -> f64 {
        let away = |corners: &[usize; 3]| triangle_distance(p, corners.map(|i| self.vertices[i]));
        self.triangles.iter().map(away).fold(f64::INFINITY, f64::min)
    }
}

fn triangle_distance(p: Point, [a, b, c]: [Point; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let edges = [(a, b), (b, c), (c, a)];
    if normal.norm_squared() > 0.0 {
        let unit = normal.normalize();
        let foot = p - unit * unit.dot(&(p - a));
        if edges.iter().all(|(from, to)| normal.dot(&(to - from).cross(&(foot - from))) >= 0.0) {
            return (p - foot).norm();
        }
    }
    let beside = |(from, to): (Point, Point)| {
        let way = to - from;
        let part = ((p - from).dot(&way) / way.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p - (from + way * part)).norm()
    };
    edges.into_iter().map(beside).fold(f64::INFINITY, f64::min)
}

fn index(value: &Value) -> usize {
    value.as_u64().expect("a number") as usize
}
