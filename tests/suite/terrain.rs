//! Ground of soil through the whole pipeline: `soil`, `ground SOIL cell …`, `solid`, `shelf` and `pour` from the text to columns, pictures and files.

use dlsys::Format;
use dlsys::interchange::Format as Played;
use dlsys::render::{FrameWriter, Survey, View};
use dlsys::scene::{MaterialId, Scene};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::surround::Terrain;
use dlsys::tree::ModuleString;

use crate::cli::dlsys;
use crate::glb::follow;
use crate::glb_reader::{Glb, Shown};
use crate::usd_reader::Usd;

/// A ball that sinks into sand, and rests.
const BALL: &str = "soil dry = sand\nground dry cell 0.01 depth 0.3 extent 0.5\nsolid Ball\ninitial string: Ball(0.2)\n\
    Ball(y): if y > 0.05 solve dy/dt = -0.3 if y <= 0.05 solve dy/dt = 0\ninterpret Ball(y): [ f(y) @O(0.2) ]\n";
/// Snow that falls on a leaf, and on the ground around it.
const LEAF: &str = "soil powder = snow, repose 40\nground powder cell 0.01 depth 0.1 extent 0.4\nshelf Leaf\npour powder rate if t < 1 then 0.02 else 0\n\
    initial string: Leaf\ninterpret Leaf: f(0.2) -(90) f(-0.1) { . f(0.2) . +(90) &(90) f(0.1) ^(90) . +(90) f(0.2) . }\n";
/// Sand that is poured at a place.
const CONE: &str = "soil dry = sand, repose 30\nground dry cell 0.01 extent 0.4\npour dry rate if t < 1 then 0.003 else 0 at 0, 1, 0 radius 0.02\n\
    initial string: F(0.01)\n";

fn session(text: &str) -> Session {
    Session::from_text("ground.dls", text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn terrain(session: &Session, threads: usize) -> Terrain<'_> {
    let made = Terrain::new(&session.model, Settings::default(), threads);
    made.unwrap_or_else(|error| panic!("{}", error.diagnostic().message)).expect("a ground of soil")
}

/// The heights of a mesh, to the bit.
fn bits(terrain: &Terrain, time: f64) -> Vec<[u64; 3]> {
    let mesh = terrain.at(time, MaterialId::LEAF, None).unwrap_or_else(|error| panic!("{error}"));
    mesh.vertices.iter().map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect()
}

fn string(session: &Session, time: f64) -> ModuleString {
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).unwrap().at(time, &mut string).unwrap();
    string
}

fn drawn(session: &Session, time: f64) -> Scene {
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut scene = nursery.blank();
    nursery.draw(&string(session, time), &mut scene).unwrap_or_else(|error| panic!("{error}"));
    scene
}

/// The message of a time that cannot be drawn.
fn failure(text: &str, time: f64) -> String {
    let session = session(text);
    let nursery = Nursery::new(&session.model, Settings::default());
    let error = nursery.draw(&string(&session, time), &mut nursery.blank()).unwrap_err();
    error.diagnostic().render(&session.source, false)
}

/// Times in any order, one or two threads: the same bits; and no quantum is lost.
#[test]
fn the_ground_depends_neither_on_the_order_of_times_nor_on_threads() {
    for text in [BALL, LEAF, CONE] {
        let session = session(text);
        let (one, two) = (terrain(&session, 1), terrain(&session, 2));
        let times = [0.0, 0.3, 0.61, 0.9, 1.4];
        let forward: Vec<_> = times.iter().map(|time| bits(&one, *time)).collect();
        let backward: Vec<_> = times.iter().rev().map(|time| bits(&two, *time)).collect();
        assert!(forward.iter().eq(backward.iter().rev()));
        assert_ne!(forward[0], forward[4], "nothing has happened");
        // Frames in between change nothing.
        let lone = terrain(&session, 1);
        assert_eq!(bits(&lone, 1.4), forward[4]);
        let report = lone.report(1.4, None).unwrap();
        assert_eq!(report.imbalance, 0);
        assert!(report.columns > 0 && report.updates > 0);
    }
}

/// A ball that has sunk by its radius less 5 cm leaves its shape, and sand around it is higher.
#[test]
fn a_ball_presses_its_shape_into_sand() {
    let session = session(BALL);
    let ground = terrain(&session, 1);
    let height = |x: f64| ground.height(1.0, [x, 0.0], None).unwrap();
    assert!((height(0.0) + 0.05).abs() < 0.002, "{}", height(0.0));
    let rim = (90..130).map(|mm| height(f64::from(mm) / 1000.0)).fold(0.0, f64::max);
    assert!(rim > 0.001, "a rim of {rim}");
    assert_eq!(height(0.45), 0.0);
}

/// A poured heap has the volume of what was poured and the angle of repose: its height is the cube root of 3 V tan² φ / π.
#[test]
fn a_poured_cone_stands_at_the_angle_of_repose() {
    let session = session(CONE);
    let ground = terrain(&session, 1);
    let exact = (3.0 * 0.003 * 30_f64.to_radians().tan().powi(2) / std::f64::consts::PI).cbrt();
    let summit = ground.height(4.0, [0.0, 0.0], None).unwrap();
    assert!((summit / exact - 1.0).abs() < 0.08, "{summit} {exact}");
}

/// Half of the snow that falls above a shelf lies on it; the ground below it is bare of new snow, that beside it is not.
#[test]
fn a_leaf_carries_snow() {
    let session = session(LEAF);
    let ground = terrain(&session, 1);
    let report = ground.report(1.5, None).unwrap();
    // 2 cm on 20 cm × 10 cm, less what has slipped off the edges.
    assert!(report.carried > 0.5 * 0.0004 && report.carried < 1.02 * 0.0004, "{}", report.carried);
    let far = ground.height(1.5, [0.35, 0.35], None).unwrap();
    assert!((far - 0.02).abs() < 1e-9, "{far}");
    let scene = drawn(&session, 1.5);
    let mesh = &scene.surfaces.last().unwrap().mesh;
    assert!(mesh.vertices.iter().any(|p| p.y > 0.2), "what lies on the leaf is drawn");
}

/// Framing ignores the ground; pictures have it, and files have it as a group.
#[test]
fn pictures_and_files_have_the_ground() {
    let session = session(BALL);
    let scene = drawn(&session, 1.0);
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let [low, high] = survey.fit().bounds.unwrap();
    assert!((high.x - low.x) < 0.25, "the ball only: {} to {}", low.x, high.x);
    let obj = String::from_utf8(FrameWriter::new(Format::OBJ, survey.fit()).write(&scene, "ball")).unwrap();
    assert!(obj.contains("\ng ground\nusemtl ground\n"));
}

/// Where the model draws nothing, its ground has light and shadow all the same: a heap is seen from above.
#[test]
fn ground_alone_is_seen_as_it_is() {
    let text = CONE.replace("F(0.01)", "A") + "camera at 0, 1, 0.01 towards 0, 0, 0 angle 40\n";
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    std::fs::write(path("heap.dls"), text).expect("written");
    let (model, out) = (path("heap.dls"), path("out"));
    let done = dlsys(&["render", &model, "--at", "0,1", "--format", "png", "--size", "60x40", "-o", &out]);
    assert!(done.status.success(), "{done:?}");
    let frame = |n: usize| std::fs::read(path(&format!("out/frame-000{n}.png"))).expect("a frame");
    assert!(frame(0) != frame(1), "the heap is seen");
}

/// The report on a scene with soil: errors that fall with the width of columns, and no volume from nowhere.
#[test]
fn errors_of_ground_are_measured_by_the_width_of_columns_and_by_ticks() {
    let text = CONE.replace("cell 0.01", "cell 0.02");
    let allowance = dlsys::study::Allowance { run: 60.0, all: 600.0, may_shorten: false };
    let of = |text: &str, times: &[f64]| {
        dlsys::study::soil_study(&session(text), times, Settings::default(), allowance, &mut |_| ())
    };
    let study = of(&text, &[0.5, 1.0]);
    let study = study.expect("runs").expect("ground of soil");
    for points in [&study.by_cell, &study.by_tick] {
        let outcomes: Vec<_> = points.iter().map(|point| point.result.clone().expect("a run")).collect();
        assert_eq!((outcomes.len(), outcomes[3].misplaced, outcomes[3].height), (4, 0.0, 0.0));
        assert!(outcomes[0].misplaced > 0.0 && outcomes.iter().all(|outcome| outcome.imbalance == 0));
    }
    let [coarse, _, fine, finest] = [0, 1, 2, 3].map(|n| study.by_cell[n].result.clone().expect("a run"));
    assert!(fine.misplaced < 0.5 * coarse.misplaced, "{coarse:?} {fine:?}");
    assert!(finest.updates > 4 * coarse.updates, "{coarse:?} {finest:?}");
    let table = dlsys::study::soil_table(&study);
    assert!(table.contains("misplaced") && table.contains("the reference"), "{table}");
    // Rules that read the ground would grow otherwise on other columns.
    let reads = CONE.replace("F(0.01)", "A(0)") + "A(y): solve dy/dt = ground(0, 0)\n";
    assert!(of(&reads, &[0.5]).expect("nothing to run").is_none());
}

/// The pieces of ground that a file shows, against the ground itself at a tick: the largest distance of a point of one from the other, beside the ball.
fn apart(terrain: &Terrain, shown: &[Shown], time: f64) -> f64 {
    let cell = 0.01;
    let is_column =
        |p: &&dlsys::scene::Point| [p.x, p.z].iter().all(|x| (x / cell - (x / cell).round()).abs() < 1e-4);
    let mut worst = 0.0_f64;
    let mut compared = 0;
    for point in
        shown.iter().flat_map(|piece| &piece.vertices).filter(is_column).filter(|p| p.x.hypot(p.z) > 0.12)
    {
        worst = worst.max((point.y - terrain.height(time, [point.x, point.z], None).unwrap()).abs());
        compared += 1;
    }
    let mesh = terrain.at(time, MaterialId::LEAF, None).unwrap();
    for point in mesh.vertices.iter().filter(is_column).step_by(41) {
        worst = worst.max(shown.iter().map(|piece| piece.distance(*point)).fold(f64::INFINITY, f64::min));
    }
    assert!(compared > 1000, "{compared} points");
    worst
}

/// Files that play have the ground in pieces, at frames and at ticks between them within their accuracy.
#[test]
fn files_that_play_have_the_ground() {
    let followed = follow(session(BALL), [0.0, 1.0, 0.05], 2);
    let terrain = terrain(&followed.session, 1);
    let allowed = followed.options.accuracy * followed.options.extent;
    let bytes = followed.growth.file(Played::Glb).unwrap();
    assert!(bytes.len() < 8_000_000, "{} bytes", bytes.len());
    let glb = Glb::read(&bytes);
    let usd = Usd::read(&String::from_utf8(followed.growth.file(Played::Usda).unwrap()).unwrap());
    for tick in [0, 61, 90, 120] {
        let time = f64::from(tick) / 120.0;
        for all in [glb.shown(time), usd.shown(time)] {
            let ground: Vec<Shown> = all
                .into_iter()
                .filter(|(name, _)| name.starts_with("ground"))
                .map(|(_, shown)| shown)
                .collect();
            let worst = apart(&terrain, &ground, time);
            assert!(worst <= allowed, "{worst} of {allowed} at {time}");
        }
    }
}

/// A rigid floor, and no floor, have no surface; the turtle is set down on soil as on a floor.
#[test]
fn a_rigid_floor_is_as_before() {
    for text in ["ground 0\ninitial string: F(1)", "initial string: F(1)"] {
        let session = session(text);
        assert!(Terrain::new(&session.model, Settings::default(), 1).unwrap().is_none());
        let scene = drawn(&session, 0.0);
        assert!(scene.terrain.is_none() && scene.surfaces.is_empty());
    }
    let soil = session(
        "soil a = sand\nground a cell 0.1 height 0.5 + 0.1*x extent 2\ninitial string: -(90) f(1) +(90) f(3) @G F(1)",
    );
    let start = drawn(&soil, 0.0).segments[0].start;
    assert!((start.y - 0.6).abs() < 1e-12, "{start}");
}

/// What cannot be: a message with its place and a remedy.
#[test]
fn what_cannot_be_says_where() {
    let open = BALL.replace("@O(0.2)", "-(90) { . f(0.2) . &(90) f(0.2) . &(90) f(0.2) . }");
    let said = failure(&open, 1.0);
    assert!(said.contains("the surface of `Ball` is not closed") && said.contains("is a `shelf`"), "{said}");
    let outside = BALL.replace("[ f(y)", "[ -(90) f(0.5) +(90) f(y)");
    let said = failure(&outside, 1.0);
    assert!(said.contains("where there is no ground") && said.contains("ground.dls:3:7"), "{said}");
    let much = CONE.replace("0.003", "1e12");
    let said = failure(&much, 1.0);
    assert!(said.contains("what is poured") && said.contains("65,536 cells"), "{said}");
    let negative = CONE.replace("else 0", "else -1");
    let said = failure(&negative, 2.0);
    assert!(said.contains("the rate -1 at t = ") && said.contains("0 or greater"), "{said}");
    let fine = BALL.replace("cell 0.01", "cell 0.00001").replace("extent 0.5", "extent 0.0005");
    assert!(failure(&fine, 0.0).contains("a larger `cell`"), "{}", failure(&fine, 0.0));
}

/// A stem of the default width has no thickness to press with, which is said once.
#[test]
fn stems_without_a_width_are_no_bodies() {
    let post = |drawing: &str| {
        let text = format!(
            "soil a = sand\nground a cell 0.01 extent 0.3\nsolid Post\ninitial string: Post\ninterpret Post: {drawing}\n"
        );
        let session = session(&text);
        let warnings = drawn(&session, 0.1).warnings;
        warnings.iter().map(|warning| warning.render(&session.source, false)).collect::<Vec<_>>()
    };
    let said = post("F(0.1) F(0.1)");
    assert!(said.len() == 1 && said[0].contains("a stem without a width is no body on soil"), "{said:?}");
    assert!(said[0].contains("ground.dls:5") && said[0].contains("`!(w)`"), "{said:?}");
    assert!(post("!(0.05) F(0.1)").is_empty());
}

/// Words that are wrong, when the model is read.
#[test]
fn wrong_words_are_refused() {
    for (text, said) in [
        ("soil a = sand\nground a cell 0", "0"),
        ("soil a = sand, repose 95\nground a cell 1", "95"),
        ("soil a = sand, repose 40, inner 30\nground a cell 1", "pressed soil is less steep"),
        ("ground a cell 1", "there is no soil `a`"),
        ("soil a = sand\npour a rate 1", "there is none"),
        ("soil a = sand\nground a cell 0.001 extent 100", "cells on a side"),
    ] {
        let text = format!("{text}\ninitial string: F(1)");
        let error = Session::from_text("ground.dls", &text, &[]).unwrap_err().to_string();
        assert!(error.contains(said), "{text}\n{error}");
    }
}
