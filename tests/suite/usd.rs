//! USD files, read by a reader of our own, against the model drawn again at random times, frames or not.

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
