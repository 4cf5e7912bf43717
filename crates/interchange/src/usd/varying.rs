//! USD in text with triangles that change from frame to frame: a mesh for each material, with `velocities`.
//!
//! A layer holds all samples of an attribute in one place, and frames come one after the other. So the samples are written to a file aside, and put in order at the end; memory holds the frames
//! that are in work.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use dlsys_geometry::scene::{MaterialId, Palette, Vector};
use dlsys_render::{Companion, Page, push_number};
use dlsys_session::Session;
use dlsys_sim::Settings;

use super::text::{BRACES, PARENTHESES, Text, list, quoted, tuple, tuples};
use super::{OF_COLORS, OF_NORMALS, OF_PLACES, RATE, bounds, decimals, header, materials, rgb};
use crate::vary::{Mesh, Varied, vary};
use crate::{Error, Options, floor_of};

/// Attributes of a mesh that change, in the order of a layer.
const ATTRIBUTES: [&str; 7] = [
    "float3[] extent",
    "int[] faceVertexCounts",
    "int[] faceVertexIndices",
    "normal3f[] normals",
    "point3f[] points",
    "texCoord2f[] primvars:st",
    "vector3f[] velocities",
];
const NORMALS: usize = 3;
const PLACES: usize = 5;

/// What has been written.
#[derive(Debug)]
#[non_exhaustive]
pub struct Summary {
    /// Frames.
    pub frames: usize,
    /// Corners of all triangles of the largest frame.
    pub corners: usize,
    /// Bytes of the file.
    pub bytes: u64,
    /// The largest difference of a velocity from that of fewer instants, in metres a second: a bound of its error where the motion is smooth.
    pub velocity_error: f64,
    /// The files that it refers to, beside it.
    pub companions: Vec<Companion>,
}

/// Writes a run as USD in text whose triangles change from frame to frame: for programs that take no other, and for renderers that blur by `velocities`. Every frame is exact
/// to the accuracy of the options; between frames there is the motion by velocities. `progress` is told the time reached and stops the work by being false.
///
/// # Errors
/// See [`Error`]; `out` may have been written in part.
pub fn vary_usda(
    session: &Session,
    settings: Settings,
    times: &[f64],
    options: &Options,
    out: &mut dyn Write,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Summary, Error> {
    let clock = Codes::new(times, options);
    let decimals = decimals(options.tolerance());
    let mut spool = Spool::new(options.limits.bytes)?;
    let mut summary =
        Summary { frames: times.len(), corners: 0, bytes: 0, velocity_error: 0.0, companions: Vec::new() };
    let mut frame = 0;
    let work = |varied: Varied, palette: &Palette| Draft::new(&varied, palette, decimals);
    vary(session, settings, times, options, work, |time, draft| {
        summary.corners = summary.corners.max(draft.corners);
        summary.velocity_error = summary.velocity_error.max(draft.error);
        spool.add(clock.code(frame), draft)?;
        frame += 1;
        if progress(time) { Ok(()) } else { Err(Error::Stopped { time }) }
    })?;
    let palette = dlsys_session::Nursery::new(&session.model, settings).blank().palette;
    let mut counted = Counted { out, bytes: 0 };
    layer(session, options, &clock, &mut spool, &palette, &mut counted)?;
    summary.bytes = counted.bytes;
    let pictures = dlsys_render::pictures(&palette).into_iter();
    summary.companions =
        pictures.map(|(picture, name)| Companion { name, bytes: picture.file.clone() }).collect();
    Ok(summary)
}

/// Time codes of frames.
struct Codes<'a> {
    times: &'a [f64],
    seconds: f64,
    /// Codes in a second.
    rate: f64,
}

impl Codes<'_> {
    /// One for each frame, if frames are equally far apart; else as many a second as film has.
    fn new<'a>(times: &'a [f64], options: &Options) -> Codes<'a> {
        let seconds = options.seconds;
        let span = times.last().unwrap_or(&0.0) - times.first().unwrap_or(&0.0);
        let step = span / (times.len().max(2) - 1) as f64;
        let even = times.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() <= 1e-6 * step);
        let rate = if even && step > 0.0 { 1.0 / (step * seconds) } else { RATE };
        // A whole number, if it is one but for rounding.
        let rate = if (rate - rate.round()).abs() < 1e-6 * rate { rate.round() } else { rate };
        Codes { times, seconds, rate }
    }

    fn code(&self, frame: usize) -> f64 {
        let first = self.times.first().unwrap_or(&0.0);
        let code = (self.times[frame] - first) * self.seconds * self.rate;
        if (code - code.round()).abs() < 1e-6 * code.max(1.0) { code.round() } else { code }
    }
}

/// The text of the samples of a frame, by material.
struct Draft {
    meshes: Vec<(usize, [String; ATTRIBUTES.len()])>,
    corners: usize,
    error: f64,
}

impl Draft {
    fn new(varied: &Varied, palette: &Palette, decimals: usize) -> Draft {
        let text = |(&material, mesh): (&usize, &Mesh)| {
            let has_picture =
                palette.materials().get(material).is_some_and(|material| material.texture.is_some());
            (material, attributes(mesh, has_picture, decimals))
        };
        Draft {
            meshes: varied.meshes.iter().map(text).collect(),
            corners: varied.meshes.values().map(|mesh| mesh.points.len()).sum(),
            error: varied.error,
        }
    }
}

fn attributes(mesh: &Mesh, has_picture: bool, decimals: usize) -> [String; ATTRIBUTES.len()] {
    let mut all: [String; ATTRIBUTES.len()] = Default::default();
    let [extent, counts, indices, normals, points, places, velocities] = &mut all;
    let positions: Vec<[f32; 3]> = mesh.points.iter().map(|p| p.map(|x| x as f32).into()).collect();
    tuples(extent, &bounds(&positions), decimals);
    list(counts, &vec![3_u32; mesh.triangles.len() / 3], |out, n| push_number(out, n.into(), 0));
    list(indices, &mesh.triangles, |out, n| push_number(out, n.into(), 0));
    tuples(normals, &mesh.normals, OF_NORMALS);
    list(points, &mesh.points, |out, p| tuple(out, p.into(), decimals));
    if has_picture {
        list(places, &mesh.pinned, |out, place| tuple(out, place.map(f64::from), OF_PLACES));
    }
    list(velocities, &mesh.velocities, velocity);
    all
}

/// A velocity with all digits of a 32-bit float: the slowest growth and the fastest fall are both in seconds.
fn velocity(out: &mut String, v: Vector) {
    use std::fmt::Write;
    let parts: [f32; 3] = v.map(|x| x as f32).into();
    for (i, x) in parts.into_iter().enumerate() {
        out.push(if i == 0 { '(' } else { ',' });
        // Writing to a string does not fail.
        let _ = match x {
            x if x == 0.0 || !x.is_finite() => write!(out, "0"),
            x if x.abs() < 1e-4 || x.abs() >= 1e7 => write!(out, "{x:e}"),
            x => write!(out, "{x}"),
        };
    }
    out.push(')');
}

/// The code of a sample, and its beginning and length in a file.
type Sample = (f64, u64, u64);

/// Samples in the order of frames, in a file without a name, and where they are in it.
struct Spool {
    file: io::BufWriter<File>,
    end: u64,
    limit: u64,
    /// By material and attribute.
    samples: BTreeMap<(usize, usize), Vec<Sample>>,
    /// Materials, each with whether it has triangles now.
    seen: BTreeMap<usize, bool>,
    /// The code of the first frame.
    first: Option<f64>,
}

impl Spool {
    fn new(limit: u64) -> Result<Spool, Error> {
        let file = io::BufWriter::with_capacity(1 << 20, tempfile::tempfile()?);
        let (samples, seen) = (BTreeMap::new(), BTreeMap::new());
        Ok(Spool { file, end: 0, limit, samples, seen, first: None })
    }

    fn put(&mut self, code: f64, key: (usize, usize), text: &str) -> Result<(), Error> {
        let length = text.len() as u64;
        if self.end + length > self.limit {
            return Err(Error::Bytes { limit: self.limit });
        }
        self.file.write_all(text.as_bytes())?;
        self.samples.entry(key).or_default().push((code, self.end, length));
        self.end += length;
        Ok(())
    }

    /// A mesh without triangles.
    fn clear(&mut self, code: f64, material: usize) -> Result<(), Error> {
        (0..ATTRIBUTES.len())
            .try_for_each(|k| self.put(code, (material, k), if k == 0 { "[(0,0,0),(0,0,0)]" } else { "[]" }))
    }

    fn add(&mut self, code: f64, draft: Draft) -> Result<(), Error> {
        let first = *self.first.get_or_insert(code);
        let now: BTreeSet<usize> = draft.meshes.iter().map(|(material, _)| *material).collect();
        for (material, text) in &draft.meshes {
            // Nothing is before it appears.
            if self.seen.insert(*material, true).is_none() && code > first {
                self.clear(first, *material)?;
            }
            for (k, text) in text.iter().enumerate().filter(|(_, text)| !text.is_empty()) {
                self.put(code, (*material, k), text)?;
            }
        }
        let gone: Vec<usize> = self
            .seen
            .iter()
            .filter(|(material, seen)| **seen && !now.contains(material))
            .map(|(m, _)| *m)
            .collect();
        for material in gone {
            self.seen.insert(material, false);
            self.clear(code, material)?;
        }
        Ok(())
    }
}

/// Text on its way out.
struct Counted<'w> {
    out: &'w mut dyn Write,
    bytes: u64,
}

impl Counted<'_> {
    fn put(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.out.write_all(bytes)?;
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    fn text(&mut self, text: &mut Text) -> Result<(), Error> {
        self.put(&text.take())
    }
}

fn layer(
    session: &Session,
    options: &Options,
    clock: &Codes<'_>,
    spool: &mut Spool,
    palette: &Palette,
    out: &mut Counted<'_>,
) -> Result<(), Error> {
    spool.file.flush()?;
    let title = session.model.title.clone().unwrap_or_else(|| session.source.name.clone());
    let [first, last] = [clock.times.first(), clock.times.last()].map(|time| time.copied().unwrap_or(0.0));
    let end = clock.times.len().checked_sub(1).map_or(0.0, |last| clock.code(last));
    let floor = floor_of(options);
    let mut text = Text::default();
    header(&mut text, &title, [first, last], options, (clock.rate, end));
    text.open("def Xform \"Plant\" ", PARENTHESES);
    text.line(&format!("displayName = {}", quoted(&title)));
    text.line("kind = \"component\"");
    text.close(PARENTHESES);
    text.open("", BRACES);
    let used: Vec<MaterialId> = palette.ids().filter(|id| spool.seen.contains_key(&id.index())).collect();
    let names = materials(&mut text, palette, &used, floor.is_some().then_some(Page::BACKGROUND));
    out.text(&mut text)?;
    for id in used {
        let Some(name) = names.get(&Some(id)) else { continue };
        mesh(&mut text, name, id, palette, spool, out)?;
    }
    if let Some((corners, triangles)) = floor {
        ground(&mut text, names.get(&None).map_or("ground", String::as_str), &corners, &triangles);
    }
    text.close(BRACES);
    out.text(&mut text)
}

fn mesh(
    text: &mut Text,
    name: &str,
    id: MaterialId,
    palette: &Palette,
    spool: &mut Spool,
    out: &mut Counted<'_>,
) -> Result<(), Error> {
    text.open(&format!("def Mesh \"Mesh_{name}\" "), PARENTHESES);
    text.line("prepend apiSchemas = [\"MaterialBindingAPI\"]");
    text.close(PARENTHESES);
    text.open("", BRACES);
    text.line("uniform bool doubleSided = 1");
    text.line(&format!("rel material:binding = </Plant/Materials/{name}>"));
    for (k, attribute) in ATTRIBUTES.iter().enumerate() {
        let Some(samples) = spool.samples.get(&(id.index(), k)) else { continue };
        // Places come with the triangles, or not at all.
        if k == PLACES && samples.iter().all(|(_, _, length)| *length <= 2) {
            continue;
        }
        if k == NORMALS || k == PLACES {
            text.block(&format!("{attribute} "), PARENTHESES, |text| text.line("interpolation = \"vertex\""));
        }
        text.long(&format!("{attribute}.timeSamples = {{"), |_| {});
        out.text(text)?;
        for (i, (code, begin, length)) in samples.iter().enumerate() {
            let mut head = String::from(if i == 0 { "" } else { ",\n" });
            push_number(&mut head, *code, 5);
            head.push(':');
            out.put(head.as_bytes())?;
            let file = spool.file.get_mut();
            file.seek(SeekFrom::Start(*begin))?;
            let mut part = file.take(*length);
            let mut room = vec![0; 1 << 16];
            loop {
                match part.read(&mut room)? {
                    0 => break,
                    count => out.put(&room[..count])?,
                }
            }
        }
        text.line("");
        text.line("}");
    }
    if let Some(material) = palette.materials().get(id.index()) {
        text.long("color3f[] primvars:displayColor = ", |out| {
            list(out, &[rgb(material.color)], |out, rgb| tuple(out, rgb, OF_COLORS));
        });
    }
    text.line("uniform token subdivisionScheme = \"none\"");
    text.close(BRACES);
    out.text(text)
}

fn ground(text: &mut Text, material: &str, corners: &[[f32; 3]], triangles: &[u32]) {
    text.prim(
        "def Mesh \"ground\"",
        |text| text.line("prepend apiSchemas = [\"MaterialBindingAPI\"]"),
        |text| {
            text.line("uniform bool doubleSided = 1");
            text.long("float3[] extent = ", |out| tuples(out, &bounds(corners), 5));
            text.line("int[] faceVertexCounts = [3,3]");
            text.long("int[] faceVertexIndices = ", |out| {
                list(out, triangles, |out, n| push_number(out, n.into(), 0))
            });
            text.line(&format!("rel material:binding = </Plant/Materials/{material}>"));
            text.long("point3f[] points = ", |out| tuples(out, corners, 5));
            text.line("uniform token subdivisionScheme = \"none\"");
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_frames_where_these_are_even() {
        let options = Options::new(&dlsys_model::Model::default(), 1.0, 1.0);
        let even: Vec<f64> = (0..=400).map(|i| 2.0 + f64::from(i) * 0.02).collect();
        let codes = Codes::new(&even, &options);
        assert_eq!((codes.rate, codes.code(0), codes.code(7), codes.code(400)), (50.0, 0.0, 7.0, 400.0));
        let codes = Codes::new(&[1.0, 2.0, 4.0], &options);
        assert_eq!((codes.rate, codes.code(1), codes.code(2)), (24.0, 24.0, 72.0));
        assert_eq!(Codes::new(&[3.0], &options).code(0), 0.0);
    }

    #[test]
    fn velocities_have_all_digits_of_floats() {
        let mut out = String::new();
        velocity(&mut out, Vector::new(1.0 / 3.0, -2.5e-9, 0.0));
        assert_eq!(out, "(0.33333334,-2.5e-9,0)");
    }
}
