//! USD files, read by a reader of our own, against the model drawn again at random times, frames or not.

use std::collections::BTreeMap;
use std::fs;

use dlsys::interchange::Format;
use dlsys::session::Session;

use crate::cli::{bad, good};
use crate::glb::{Followed, RUNS, check_positions, follow, worst_of};
use crate::usd_reader::Usd;

fn text(followed: &Followed) -> String {
    String::from_utf8(followed.growth.file(Format::Usda).expect("a file")).expect("text")
}

#[test]
fn positions_are_within_the_accuracy_between_frames_too() {
    check_positions(&RUNS[..4], |followed, times, from| {
        let usd = Usd::read(&text(followed));
        worst_of(followed, |seconds| usd.shown(seconds), times, from)
    });
}

/// Its size and its shape are animated apart, and readers multiply what is linear by what is linear.
#[test]
fn an_organ_that_grows_from_nothing_keeps_its_width_between_the_samples_too() {
    for drawing in
        ["!(0.2) F(x) @L(x)", "!(0.2) F(x)", "{ F(x) +(90) F(0.3) +(100) F(x*x) }", "!(0.1*x) F(1) @O(0.5)"]
    {
        let text = format!(
            "initial string: for i in 1 .. 8: ( B(0.0001) f(4) )\nB(x): solve dx/dt = 1\ninterpret B(x): {drawing}"
        );
        let session = Session::from_text("wide.dls", &text, &[]).expect("a model");
        let followed = follow(session, [0.0, 3.0, 0.1], 1);
        let usd = Usd::read(&self::text(&followed));
        let times: Vec<f64> = (1..60).map(|i| 0.05 * f64::from(i) * 0.997).collect();
        let worst = worst_of(&followed, |seconds| usd.shown(seconds), &times, 0.0);
        let allowed = followed.options.accuracy * followed.options.extent;
        assert!(worst <= allowed, "{drawing}: {worst} of {allowed}");
    }
}

/// A stem of a millimetre in a scene of a hundred metres.
#[test]
fn a_stem_keeps_its_thickness_however_thin_it_is() {
    let model = "initial string: H(1) -(90) f(100) [ @L(1) ]\ninterpret H(x): !(0.0008) F(x)";
    let session = Session::from_text("hair.dls", model, &[]).expect("a model");
    let usd = Usd::read(&text(&follow(session, [0.0, 1.0, 0.5], 1)));
    let near = usd.shown(0.5).into_values().flat_map(|shown| shown.vertices).filter(|p| p.x.abs() < 1.0);
    let radii: Vec<f64> = near.map(|p| p.x.hypot(p.z)).filter(|r| *r > 0.0).collect();
    // Its ends are round.
    let widest = radii.iter().copied().fold(0.0, f64::max);
    assert!(radii.len() > 8 && (widest - 0.0004).abs() < 0.00001, "{radii:?}");
}

#[test]
fn units_are_metres_and_seconds_and_names_are_identifiers() {
    let text_of = "title \"a 'reed' \u{1f33e} \\\\ é\"\nunits length 0.5, time 4\ninitial string: F(2) +(90) é-1(1)\nF(x): solve dx/dt = 1";
    let model = text_of.replace("é-1(1)", "Ä(1)") + "\ninterpret Ä(x): F(x)";
    let session = Session::from_text("units.dls", &model, &[]).expect("a model");
    let text = text(&follow(session, [0.0, 3.0, 1.0], 1));
    let usd = Usd::read(&text);
    assert!(
        text.contains("\"a 'reed' \u{1f33e} \\\\\\\\ é\"") || text.contains("\"a 'reed' \u{1f33e} \\\\ é\"")
    );
    assert_eq!((&*usd.metadata["metersPerUnit"], &*usd.metadata["upAxis"]), ("1", "\"Y\""));
    // 12 seconds of 24 codes.
    assert_eq!(usd.metadata["endTimeCode"], "288");
    for name in usd.names() {
        assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{name}");
    }
    let top = |seconds: f64| {
        let all = usd.shown(seconds).into_values().flat_map(|shown| shown.vertices);
        all.map(|p| p.y).fold(f64::MIN, f64::max)
    };
    // Half a metre for each unit, and half the width of the line that goes on sideways.
    assert!((top(12.0) - 2.5).abs() < 0.03 && (top(6.0) - 1.75).abs() < 0.03, "{} {}", top(12.0), top(6.0));
}

#[test]
fn the_program_writes_usd_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let said = good(&["run", "models/leaf.dls", "--format", "usda", "-o", &at("leaf.usda")]);
    assert!(said.contains("leaf.usda: 19 nodes, 4 different lives"), "{said}");
    good(&["render", "models/leaf.dls", "--at", "4", "--format", "usda", "-o", &at("still.usda")]);
    let still = fs::read_to_string(at("still.usda")).expect("a file");
    assert!(!still.contains("timeSamples") && !still.contains("endTimeCode"));
    assert!(Usd::read(&still).shown(0.0).len() > 3);
    fs::write(at("thesis.usda"), "years of work").expect("written");
    let (_, message) = bad(&["run", "models/leaf.dls", "--format", "usda", "-o", &at("thesis.usda")]);
    assert!(message.contains("is not a USDA file"), "{message}");
    let (_, message) = bad(&["run", "models/leaf.dls", "--format", "usda", "-o", "a.usdc"]);
    assert!(message.contains("`-o a.usda`"), "{message}");
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 3, "nothing is left over");
}

/// By material: the samples of an attribute of a mesh whose triangles change, by time code.
fn varying(text: &str, attribute: &str) -> BTreeMap<String, Vec<(f64, Vec<f64>)>> {
    let mut all = BTreeMap::new();
    let mut mesh = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(name) = line.trim().strip_prefix("def Mesh \"") {
            mesh = name.split('"').next().unwrap_or_default().to_owned();
        }
        if line.trim() != format!("{attribute}.timeSamples = {{") {
            continue;
        }
        let samples = lines.by_ref().take_while(|line| line.trim() != "}").map(|line| {
            let (code, values) = line.trim_end_matches(',').split_once(':').expect("a sample");
            let words = values.split(|c: char| "[](),".contains(c)).filter(|word| !word.is_empty());
            (code.parse().expect("a code"), words.map(|word| word.parse().expect("a number")).collect())
        });
        all.insert(mesh.clone(), samples.collect());
    }
    all
}

#[test]
fn meshes_that_change_their_triangles_have_exact_velocities() {
    // Metres and seconds are not units of the model. A stem grows by e^t and turns at once; at t = 1 it is replaced by two whose motion goes on; and a leaf appears.
    let model = "units length 0.5, time 2\ninitial string: A(1, 0)\nframes 0 .. 2 step 0.25\n\
                 A(x, a):\n  if age < 1 solve dx/dt = x, da/dt = 30\n  if age = 1 produce +(a) B(x) C(x) [ +(90) @L(0.4) ]\n\
                 B(x): solve dx/dt = x\nC(x): solve dx/dt = -x\n\
                 interpret A(x, a): +(a) !(0.02) F(x)\ninterpret B(x): !(0.02) F(x/2)\ninterpret C(x): !(0.02) F(x/2)";
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    fs::write(path("grow.dls"), model).expect("written");
    let write = |name: &str, flags: &[&str]| {
        let model = path("grow.dls");
        let out = path(name);
        let said = good(
            &[&["run", &model, "--format", "usda", "--topology", "varying", "-o", &out], flags].concat(),
        );
        (fs::read_to_string(path(name)).expect("a file"), said)
    };
    let (text, said) = write("a.usda", &[]);
    assert!(said.contains("9 frames") && said.contains("of the extent a second"), "{said}");
    // A frame every half a second: two codes a second.
    assert!(text.contains("timeCodesPerSecond = 2\n") && text.contains("endTimeCode = 8\n"), "{text}");
    let points = varying(&text, "point3f[] points");
    let velocities = varying(&text, "vector3f[] velocities");
    let counts = varying(&text, "int[] faceVertexCounts");
    assert_eq!(points.keys().collect::<Vec<_>>(), velocities.keys().collect::<Vec<_>>());
    assert_eq!(points.len(), 2, "stems and leaves");
    for (mesh, samples) in &points {
        for ((code, places), (same, speeds)) in samples.iter().zip(&velocities[mesh]) {
            assert_eq!((code, places.len()), (same, speeds.len()));
        }
    }
    let leaves = counts.iter().find(|(_, samples)| samples[0].1.is_empty()).expect("leaves");
    let codes: Vec<f64> = leaves.1.iter().map(|(code, _)| *code).collect();
    assert_eq!(codes, [0.0, 4.0, 5.0, 6.0, 7.0, 8.0], "nothing, and from the production on");
    let stems = points.keys().find(|mesh| *mesh != leaves.0).expect("stems");
    // Where a point is on the stem and how it moves, in metres and seconds: lengths are halves of the numbers, t is half of the seconds.
    let mut compared = 0;
    for ((code, places), (_, speeds)) in points[stems].iter().zip(&velocities[stems]) {
        let t = code / 2.0 / 2.0;
        let (first, turn): (f64, f64) =
            (t.exp() / 2.0, if t < 1.0 { 30_f64.to_radians() / 2.0 } else { 0.0 });
        // The upper end of everything, and its speed along the stem.
        let (top, rate) = match t {
            t if t < 1.0 => (first, first / 2.0),
            t => ((t.exp() + (2.0 - t).exp()) / 4.0, (t.exp() - (2.0 - t).exp()) / 8.0),
        };
        let angle = 30_f64.to_radians() * t.min(1.0);
        let along = [-angle.sin(), angle.cos()];
        for (p, v) in places.chunks_exact(3).zip(speeds.chunks_exact(3)) {
            let (height, side) = (p[0] * along[0] + p[1] * along[1], p[0] * along[1] - p[1] * along[0]);
            let expected = if height > top - 2e-5 {
                // The half ball at the end: it turns about the foot and moves along.
                [along[0] * rate - turn * p[1], along[1] * rate + turn * p[0], 0.0]
            } else if height < 2e-5 && side.abs() < 0.006 {
                [-turn * p[1], turn * p[0], 0.0]
            } else {
                continue;
            };
            compared += 1;
            for k in 0..3 {
                // Places have five decimals.
                assert!((v[k] - expected[k]).abs() < 3e-6, "{t} {p:?}: {v:?} {expected:?}");
            }
        }
    }
    assert!(compared > 200, "{compared}");
    assert!(write("b.usda", &["--threads", "1"]).0 == text, "threads do not matter");
    let (still, _) = write("still.usda", &["--at", "1.5"]);
    let own = &velocities[stems].iter().find(|(code, _)| *code == 6.0).expect("a sample").1;
    assert!(!still.contains("endTimeCode") && varying(&still, "vector3f[] velocities")[stems][0].1 == *own);
    for (flags, expected) in [
        (&["run", "--format", "glb", "--topology", "varying", "-o", "a.glb"][..], "choose --format usda"),
        (
            &["render", "--format", "png", "--topology", "varying", "-o", "a"],
            "--topology is for --format usda",
        ),
        (&["run", "--topology", "varying"], "--topology is for animated files"),
        (
            &[
                "render",
                "--format",
                "usda",
                "--topology",
                "varying",
                "--max-output",
                "20kB",
                "-o",
                &path("c.usda"),
            ],
            "larger than 20000 bytes",
        ),
    ] {
        let (_, message) = bad(&[&flags[..1], &[&path("grow.dls")], &flags[1..]].concat());
        assert!(message.contains(expected), "{flags:?}: {message}");
    }
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 4, "nothing is left over");
}
