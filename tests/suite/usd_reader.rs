//! A reader of the USD files that the program writes, for tests: what they show at a time. It knows the grammar as far as these files use it, interpolates
//! as OpenUSD does, and shares nothing with the writer.

use std::collections::{BTreeMap, HashMap};

use dlsys::scene::{Point, Vector};

use crate::glb_reader::Shown;

/// Values at time codes; one value at 0 if there are no samples.
type Samples = Vec<(f64, Vec<f64>)>;

/// A prim: its attributes and its children.
#[derive(Debug, Default)]
struct Prim {
    mesh: bool,
    attributes: HashMap<String, Samples>,
    children: BTreeMap<String, Prim>,
    /// The life that it references, and the offset of time.
    life: Option<(String, f64)>,
}

/// A file.
pub struct Usd {
    plant: Prim,
    pub metadata: HashMap<String, String>,
    rate: f64,
}

/// All numbers of a text.
fn numbers(text: &str) -> Vec<f64> {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '-' | '.' | 'e');
    text.split(|c| !is_part(c))
        .filter(|word| !word.is_empty())
        .map(|x| x.parse().expect("a number"))
        .collect()
}

fn samples(text: &str) -> Samples {
    let mut all = Samples::new();
    let (mut depth, mut begin) = (0, 0);
    let inner = text.strip_prefix('{').and_then(|text| text.strip_suffix('}')).expect("samples");
    for (i, c) in inner.char_indices().chain([(inner.len(), ',')]) {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            ',' if depth == 0 => {
                let (time, value) = inner[begin..i].split_once(':').expect("a time");
                let seen = |word: &str| match word {
                    "\"inherited\"" => vec![1.0],
                    "\"invisible\"" => vec![0.0],
                    other => numbers(other),
                };
                all.push((time.parse().expect("a time"), seen(value)));
                begin = i + 1;
            }
            _ => {}
        }
    }
    assert!(all.windows(2).all(|pair| pair[0].0 < pair[1].0), "times ascend: {all:?}");
    all
}

impl Usd {
    pub fn read(text: &str) -> Usd {
        let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        assert_eq!(lines.next(), Some("#usda 1.0"));
        let mut metadata = HashMap::new();
        for line in lines.by_ref().take_while(|line| !line.starts_with("def ")) {
            if let Some((name, value)) = line.split_once(" = ") {
                metadata.insert(name.to_owned(), value.to_owned());
            }
        }
        let rate = metadata["timeCodesPerSecond"].parse().expect("a rate");
        let mut plant = Prim::default();
        fill(&mut plant, &mut lines, true);
        assert_eq!(lines.next(), None, "brackets match");
        Usd { plant, metadata, rate }
    }

    pub fn names(&self) -> Vec<&str> {
        self.plant.children.keys().map(String::as_str).collect()
    }

    /// Everything that is visible and has a size at a time in seconds, by name as in GLB files.
    pub fn shown(&self, seconds: f64) -> BTreeMap<String, Shown> {
        let code = seconds * self.rate;
        let mut all = BTreeMap::new();
        for (name, prim) in &self.plant.children {
            let Some((life, offset)) = &prim.life else { continue };
            let scale = prim.at("xformOp:scale", code).map_or(1.0, |scale| scale[0]);
            let visible = prim.held("visibility", code).is_none_or(|seen| seen == 1.0);
            assert!(visible || scale == 0.0, "{name} at {seconds}");
            if scale == 0.0 || !visible {
                continue;
            }
            let at = Vector::from_column_slice(&prim.at("xformOp:translate", code).expect("a place"));
            let turn = prim.turn(code);
            let mut shown = Shown { vertices: Vec::new(), triangles: Vec::new() };
            for mesh in self.plant.children["Lives"].children[life].children.values().filter(|p| p.mesh) {
                let age = code - offset;
                let size = scale * mesh.at("xformOp:scale", age).map_or(1.0, |size| size[0]);
                let first = shown.vertices.len();
                let points = mesh.at("points", age).expect("points");
                let place = |p: &[f64; 3]| Point::from(turn * (Vector::from(*p) * size) + at);
                shown.vertices.extend(points.as_chunks::<3>().0.iter().map(place));
                let corners = mesh.at("faceVertexIndices", 0.0).expect("triangles");
                let corner = |i: &f64| first + *i as usize;
                shown.triangles.extend(corners.as_chunks::<3>().0.iter().map(|t| t.each_ref().map(corner)));
            }
            // A module that goes on with other parts has a prim for each, with a number behind the lineage.
            let module =
                name.rsplit_once('_').filter(|(_, last)| last.len() < 13).map_or(&**name, |(m, _)| m);
            let (kind, lineage) = module.rsplit_once('_').expect("a lineage");
            assert!(all.insert(format!("{kind}.{lineage}"), shown).is_none(), "{name} is shown once");
        }
        all
    }
}

/// Reads a prim up to the bracket that closes it.
fn fill<'t>(prim: &mut Prim, lines: &mut impl Iterator<Item = &'t str>, mut in_metadata: bool) {
    while let Some(line) = lines.next() {
        if in_metadata {
            if let Some(reference) = line.strip_prefix("prepend references = </Plant/Lives/") {
                let (life, rest) = reference.split_once('>').expect("a path");
                prim.life = Some((
                    life.to_owned(),
                    numbers(rest.trim_start_matches(" (offset =")).first().copied().unwrap_or(0.0),
                ));
            }
            in_metadata = line != "{";
        } else if line == "}" {
            return;
        } else if line.starts_with("def ") || line.starts_with("class ") {
            let mut child = Prim { mesh: line.starts_with("def Mesh"), ..Prim::default() };
            fill(&mut child, lines, line.ends_with('('));
            let name = line.split('"').nth(1).expect("a name");
            assert!(prim.children.insert(name.to_owned(), child).is_none(), "{name} is unique");
        } else if let Some((name, value)) = line.split_once(" = ") {
            let name = name.rsplit(' ').next().unwrap_or(name);
            match name.strip_suffix(".timeSamples") {
                Some(name) => prim.attributes.insert(name.to_owned(), samples(value)),
                None if value.contains(['"', '<']) => None,
                None => prim.attributes.insert(name.to_owned(), vec![(0.0, numbers(value))]),
            };
        }
    }
    panic!("a bracket is open");
}

impl Prim {
    /// The samples around a time, and the weight of the later one.
    fn around(&self, name: &str, code: f64) -> Option<(&[f64], &[f64], f64)> {
        let samples = self.attributes.get(name)?;
        let after = samples.partition_point(|(time, _)| *time <= code);
        let (i, j) = (after.saturating_sub(1), after.min(samples.len() - 1));
        let (from, to) = (samples[i].0, samples[j].0);
        let weight = if to > from { ((code - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        Some((&samples[i].1, &samples[j].1, weight))
    }

    fn at(&self, name: &str, code: f64) -> Option<Vec<f64>> {
        let (a, b, weight) = self.around(name, code)?;
        assert_eq!(a.len(), b.len(), "{name} has one topology");
        Some(a.iter().zip(b).map(|(a, b)| a + (b - a) * weight).collect())
    }

    fn held(&self, name: &str, code: f64) -> Option<f64> {
        self.around(name, code).map(|(a, ..)| a[0])
    }

    /// A turn between samples, the shorter way at constant speed.
    fn turn(&self, code: f64) -> nalgebra::UnitQuaternion<f64> {
        let (a, b, weight) = self.around("xformOp:orient", code).expect("a turn");
        let [a, b] = [a, b].map(|q| {
            nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]))
        });
        a.try_slerp(&b, weight, 1e-9).unwrap_or(b)
    }
}
