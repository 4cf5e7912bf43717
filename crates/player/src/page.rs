//! A recording as one HTML file that plays it, without network or other files.
//!
//! The file has three parts that matter: the player and its shaders (`page/`, `shaders/`), a description of the recording as
//! JSON, and its tracks (see `encode.rs`) in base64.

use std::collections::{BTreeMap, HashSet};

use serde_json::{Value, json};

use super::clouds::STEP;
use super::encode;
use super::forms::MeshForm;
use super::recording::Recording;
use super::stage::Form;
use super::track::Track;
use dlsys_geometry::scene::{Material, Point, Texture};
use dlsys_render::{GENERATOR, Spoke};

const PAGE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/style.css");
/// The scripts, each after those that it needs.
const SCRIPTS: [&str; 7] = [
    include_str!("page/recording.js"),
    include_str!("page/camera.js"),
    include_str!("page/geometry.js"),
    include_str!("page/clouds.js"),
    include_str!("page/sky.js"),
    include_str!("page/painter.js"),
    include_str!("page/player.js"),
];

/// Those that only scenes with declared light or a floor need, before the others.
const SCENE_SCRIPTS: [&str; 2] = [include_str!("page/shadows.js"), include_str!("page/floor.js")];

/// The shaders, by name; without a version, which depends on where they run.
pub const SHADERS: [(&str, &str); 7] = [
    ("shade", include_str!("shaders/shade.glsl")),
    ("surface", include_str!("shaders/surface.vert")),
    ("light", include_str!("shaders/light.frag")),
    ("puff", include_str!("shaders/puff.vert")),
    ("veil", include_str!("shaders/veil.frag")),
    ("sky", include_str!("shaders/sky.vert")),
    ("heaven", include_str!("shaders/sky.frag")),
];

/// Those that only scenes with declared light or a floor need.
pub const SCENE_SHADERS: [(&str, &str); 6] = [
    ("open", include_str!("shaders/open.glsl")),
    ("sun", include_str!("shaders/sun.glsl")),
    ("shadow", include_str!("shaders/shadow.vert")),
    ("cast", include_str!("shaders/shadow.frag")),
    ("lawn", include_str!("shaders/floor.vert")),
    ("floor", include_str!("shaders/floor.frag")),
];

/// The beginning of every page, by which it is told from files of other programs.
pub const MARK: &str = "<!doctype html>\n<!-- dlsys view: a recorded plant -->\n";

/// The document.
pub fn document(recording: &Recording) -> String {
    let (tracks, outlines) = encode::tracks(recording);
    let around = &recording.surroundings;
    let is_scene = around.sun.is_some() || around.sky.is_some() || around.floor.is_some();
    let of_scene = if is_scene { &SCENE_SCRIPTS[..] } else { &[] };
    let scripts: Vec<String> = of_scene.iter().chain(&SCRIPTS).map(|script| bare(script)).collect();
    let scripts = scripts.join("\n\n");
    let parts = [
        ("title", escaped(&recording.title)),
        ("generator", GENERATOR.to_owned()),
        ("style", STYLE.trim_end().to_owned()),
        ("script", scripts),
        ("description", embedded(&description(recording, &outlines, is_scene))),
        ("tracks", encode::base64(&tracks)),
    ];
    let mut page = String::from(MARK);
    let mut rest = PAGE;
    // Parts are put where their names stand, once, so that nothing in a part is taken for a name.
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").expect("names are closed");
        page.push_str(before);
        page.push_str(&parts.iter().find(|part| part.0 == name).expect("a known name").1);
        rest = after;
    }
    page.push_str(rest);
    page
}

/// A script or a shader without the lines of its comments, which stand in the sources.
fn bare(text: &str) -> String {
    let lines = text.trim_end().lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// JSON that may stand in a script element: nothing in it can end that.
fn embedded(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}

/// Text that may stand in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Everything but the tracks.
fn description(recording: &Recording, outlines: &[Vec<Spoke>], is_scene: bool) -> Value {
    let of_scene = if is_scene { &SCENE_SHADERS[..] } else { &[] };
    let shaders: BTreeMap<&str, String> =
        of_scene.iter().chain(&SHADERS).map(|(name, shader)| (*name, bare(shader))).collect();
    let Recording { history, palette, forms, clouds, .. } = recording;
    let color = |material: &Material| material.color.to_string();
    let mut pictures: Vec<Texture> = Vec::new();
    let net = |track: &Track| match track.form {
        Form::Net(number, _) => Some(number as usize),
        _ => None,
    };
    let nets: HashSet<usize> = recording.tracks.iter().filter_map(net).collect();
    let placed = |track: &Track| match track.form {
        Form::Mesh(number) | Form::Stretched(number) => Some(number as usize),
        _ => None,
    };
    let placed: HashSet<usize> = recording.tracks.iter().filter_map(placed).collect();
    let meshes: Vec<Value> = (0..forms.meshes())
        .map(|i| {
            mesh(
                &forms.mesh_form(i, recording.accuracy, palette),
                [placed.contains(&i), nets.contains(&i)],
                &mut pictures,
            )
        })
        .collect();
    let pictures = pictures.iter().map(|texture| {
        json!({ "file": encode::base64(&texture.picture.file), "size": texture.picture.size(), "repeats": texture.repeats })
    });
    let parameters = recording.parameters.iter().map(|p| {
        let range = p.range.map(|(low, high)| json!([low, high]));
        json!({ "name": p.name, "value": p.value, "range": range })
    });
    let events = history.happenings.iter().map(|h| json!([h.t, h.module, h.times, h.line]));
    let size = (recording.bounds[1] - recording.bounds[0]) / recording.extent;
    json!({
        "generator": GENERATOR,
        "title": recording.title,
        "source": recording.source,
        "parameters": parameters.collect::<Vec<_>>(),
        "times": recording.times,
        "modules": recording.modules,
        "events": events.collect::<Vec<_>>(),
        "productions": history.productions,
        "leftOut": history.left_out,
        "palette": palette.materials().iter().map(color).collect::<Vec<_>>(),
        "outlines": outlines.iter().map(|outline| spokes(outline)).collect::<Vec<_>>(),
        "meshes": meshes,
        "pictures": pictures.collect::<Vec<_>>(),
        "cuts": forms.cuts(),
        "clouds": (!clouds.is_empty()).then(|| encode::base64(&encode::compressed(clouds.bytes()))),
        "puffUnit": recording.unit * STEP,
        "unit": recording.unit,
        "extent": recording.extent,
        "size": [size.x, size.y, size.z],
        "light": light(recording),
        "camera": recording.surroundings.camera.map(|at| {
            let seen = |point: Point| <[f64; 3]>::from(point - recording.centre);
            json!({ "eye": seen(at.eye), "aim": seen(at.aim), "angle": at.angle })
        }),
        "floor": recording.surroundings.floor.map(|height| height - recording.centre.y),
        "floorColor": recording.surroundings.floor_color.map(|color| color.to_string()),
        "shaders": shaders,
    })
}

/// The declared light: the direction towards the sun, and the colours of zenith and horizon; null if there is neither.
fn light(recording: &Recording) -> Value {
    let around = &recording.surroundings;
    if around.sun.is_none() && around.sky.is_none() {
        return Value::Null;
    }
    let sun = around.sun.and_then(|sun| sun.try_normalize(0.0)).map(|sun| [sun.x, sun.y, sun.z]);
    json!({ "sun": sun, "sky": around.sky.map(|colors| colors.map(|color| color.to_string())) })
}

/// A number to some decimals, which is then short in JSON.
fn rounded(x: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    // No negative zero.
    (x * scale).round() / scale + 0.0
}

fn spokes(outline: &[Spoke]) -> Vec<f64> {
    let numbers = outline.iter().flat_map(|spoke| [spoke.place, spoke.normal]);
    numbers.flatten().map(|x| rounded(x, 6)).collect()
}

/// Places in parts of the mesh's unit; colours as numbers, less one and negative where the thing's colour replaces them; the number of the picture, and where
/// corners lie in that. Of nets, the numbers of the corners of the mesh; their places are in the tracks.
fn mesh(form: &MeshForm, [is_placed, is_net]: [bool; 2], pictures: &mut Vec<Texture>) -> Value {
    let vertices = &form.vertices;
    let flat = |of: &dyn Fn(usize) -> [f64; 3], decimals| {
        (0..vertices.len()).flat_map(of).map(|x| rounded(x, decimals)).collect::<Vec<_>>()
    };
    let colors = vertices.iter().map(|v| {
        let [r, g, b] = [v.color.red, v.color.green, v.color.blue].map(i64::from);
        let rgb = r << 16 | g << 8 | b;
        if v.takes_tint { -rgb - 1 } else { rgb }
    });
    let picture = form.texture.as_ref().map(|texture| {
        let known = pictures.iter().position(|known| known == texture);
        known.unwrap_or_else(|| {
            pictures.push(texture.clone());
            pictures.len() - 1
        })
    });
    let pinned: Vec<f64> = form.places.iter().flatten().map(|x| rounded(*x, 5)).collect();
    json!({
        "picture": picture,
        "pinned": pinned,
        "places": if is_placed { flat(&|i| vertices[i].place.coords.into(), 6) } else { Vec::new() },
        "normals": if is_placed { flat(&|i| vertices[i].normal.into(), 4) } else { Vec::new() },
        "corners": if is_net { &form.corners[..] } else { &[] },
        "colors": colors.collect::<Vec<_>>(),
        "triangles": form.triangles,
    })
}
