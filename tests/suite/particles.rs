//! Soil that sticks to bodies and is thrown up: from the text to pictures and files, with its volume, at any time in any order.

use dlsys::Format;
use dlsys::interchange::Format as Played;
use dlsys::render::{FrameWriter, Survey, View};
use dlsys::scene::{MaterialId, Point, Scene};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::surround::Terrain;
use dlsys::tree::ModuleString;

use crate::glb::follow;
use crate::glb_reader::Glb;

/// A ball that dips into sand that sticks, and is thrown out of it sideways.
const BALL: &str = "soil wet = sand, stick 0.003, shed 0.1, grain 0.004\nground wet cell 0.01 depth 0.3 extent 0.5\nsolid Ball\n\
    initial string: Ball(0, 0.2)\nBall(x, y):\n  if t < 0.4 solve dx/dt = 0, dy/dt = -0.5\n  if t >= 0.4 solve dx/dt = 0.4, dy/dt = 2.5 - 9.81*(t - 0.4)\n\
    interpret Ball(x, y): [ f(y) -(90) f(x) @O(0.15) ]\n";

fn session(text: &str) -> Session {
    Session::from_text("ground.dls", text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn terrain(session: &Session, threads: usize) -> Terrain<'_> {
    let made = Terrain::new(&session.model, Settings::default(), threads);
    made.unwrap_or_else(|error| panic!("{}", error.diagnostic().message)).expect("a ground of soil")
}

fn vertices(terrain: &Terrain, time: f64) -> Vec<Point> {
    let mesh = terrain.at(time, MaterialId::LEAF, None).unwrap_or_else(|error| panic!("{error}"));
    mesh.vertices.clone()
}

fn bits(points: &[Point]) -> Vec<[u64; 3]> {
    points.iter().map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect()
}

/// The middles of the particles in a mesh: their corners are its last points, six each.
fn middles(terrain: &Terrain, time: f64) -> Vec<Point> {
    let count = terrain.report(time, None).unwrap().particles;
    let all = vertices(terrain, time);
    all[all.len() - 6 * count..].chunks(6).map(|six| nalgebra::center(&six[0], &six[1])).collect()
}

fn drawn(session: &Session, time: f64) -> Scene {
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).unwrap().at(time, &mut string).unwrap();
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut scene = nursery.blank();
    nursery.draw(&string, &mut scene).unwrap_or_else(|error| panic!("{error}"));
    scene
}

/// The words of what sticks: a value that makes no sense, or nothing to do, is told with its place.
#[test]
fn what_holds_is_declared_with_its_acceleration() {
    let text = |soil: &str| BALL.replace("shed 0.1", soil);
    let message = |text: &str| match Session::from_text("ground.dls", text, &[]) {
        Ok(session) => session.warnings.iter().map(|warning| warning.message.clone()).collect::<String>(),
        Err(error) => error.to_string(),
    };
    for (soil, expected) in [
        ("hold 0", "error: this is no acceleration\n --> ground.dls:1:36"),
        ("hold 20, exponent -1", "error: this is no exponent\n --> ground.dls:1:49"),
        ("exponent 2", "`exponent` stands here without `hold`"),
    ] {
        let found = message(&text(soil));
        assert!(found.contains(expected), "{soil}: {found}");
    }
    let idle = text("hold 20").replace("stick 0.003, ", "");
    assert_eq!(message(&idle), "`hold` does nothing here");
    assert_eq!(message(&text("shed 0.1, hold 20, exponent 2")), "");
}

/// A body that is moved without a jerk keeps what sticks to it, and it is drawn there: in pictures and OBJ, and in files whose points move.
#[test]
fn what_sticks_is_drawn_on_the_body() {
    // It is lifted at 0.5 m/s, as it went down.
    let text = BALL.replace("shed 0.1", "shed 0.1, hold 1000").replace("2.5 - 9.81*(t - 0.4)", "0.5");
    let session = session(&text.replace("dx/dt = 0.4", "dx/dt = 0"));
    let terrain = terrain(&session, 1);
    let time = 0.9;
    let report = terrain.report(time, None).unwrap();
    assert!(report.sticking > 1e-5 && report.imbalance == 0, "{report:?}");
    // The ball is 25 cm above the ground there: what is drawn around it is what sticks.
    let near = |points: &[Point]| points.iter().filter(|point| (0.1..0.2).contains(&point.y)).count();
    let all = vertices(&terrain, time);
    let count = near(&all[..all.len() - 6 * report.particles]);
    assert!(count > 100, "{count}");
    let quilt = terrain.quilt(time, MaterialId::LEAF, None).unwrap();
    let mut scene = Nursery::new(&session.model, Settings::default()).blank();
    terrain.draw_quilt(time, &quilt, None, &mut scene).unwrap();
    let meshes = scene.surfaces.iter().filter(|surface| !quilt.is_particle(surface));
    assert_eq!(meshes.map(|surface| near(&surface.mesh.vertices)).sum::<usize>(), count);
}

/// Times in any order, on and between ticks, one or two threads: the same bits; and no quantum is lost.
#[test]
fn particles_depend_neither_on_the_order_of_times_nor_on_threads() {
    let session = session(BALL);
    let times = [0.36, 0.45, 0.503, 0.504, 0.61, 0.9];
    let (one, two) = (terrain(&session, 1), terrain(&session, 2));
    let forward: Vec<_> = times.iter().map(|time| bits(&vertices(&one, *time))).collect();
    let backward: Vec<_> = times.iter().rev().map(|time| bits(&vertices(&two, *time))).collect();
    assert!(forward.iter().eq(backward.iter().rev()));
    let lone = terrain(&session, 1);
    assert_eq!(bits(&vertices(&lone, 0.9)), forward[5]);
    let reports: Vec<_> = times.iter().map(|time| one.report(*time, None).unwrap()).collect();
    assert!(reports.iter().all(|report| report.imbalance == 0));
    let (pressed, thrown) = (&reports[0], &reports[2]);
    assert!(pressed.sticking > 1e-5 && pressed.particles == 0, "{pressed:?}");
    assert!(
        thrown.airborne > 1e-5 && thrown.sticking < pressed.sticking && thrown.particles > 100,
        "{thrown:?}"
    );
    // Particles of 4 mm.
    let ball = std::f64::consts::PI / 6.0 * 0.004_f64.powi(3);
    let mean = thrown.airborne / thrown.particles as f64;
    assert!((mean / ball - 1.0).abs() < 0.2, "{mean} {ball}");
}

/// Within a tick each particle goes on along its parabola: to its place, 2.5 ms later, and 5 ms later.
#[test]
fn particles_move_between_ticks() {
    let session = session(BALL);
    let terrain = terrain(&session, 1);
    let [a, b, c] = [0.0, 0.0025, 0.005].map(|by| middles(&terrain, 0.5 + by));
    assert!(a.len() == b.len() && b.len() == c.len() && a.len() > 100);
    let mut flies = 0;
    for ((a, b), c) in a.iter().zip(&b).zip(&c) {
        let bend = (c - b) - (b - a);
        // Those that come down in this tick stay where they do.
        if b == c {
            continue;
        }
        if c.y > 0.02 {
            assert!((bend.y + 9.81 * 0.0025_f64.powi(2)).abs() < 1e-9, "{bend}");
            assert!(bend.x.abs() < 1e-12 && bend.z.abs() < 1e-12);
            flies += 1;
        }
    }
    assert!(flies > 50, "{flies} of {}", a.len());
}

/// Framing ignores what is in the air; meshes have it as ground, and so do files that play, at their frames.
#[test]
fn pictures_and_files_have_particles() {
    let scene = drawn(&session(BALL), 0.5);
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let obj = String::from_utf8(FrameWriter::new(Format::OBJ, survey.fit()).write(&scene, "ball")).unwrap();
    let dry = BALL.replace("stick 0.003, shed 0.1, grain 0.004", "repose 25");
    let bare = drawn(&session(&dry), 0.5);
    let mut other = Survey::new(View::FRONT);
    other.add(&bare);
    assert_eq!(survey.fit().bounds, other.fit().bounds);
    let session = session(BALL);
    let terrain = terrain(&session, 1);
    let all = middles(&terrain, 0.5);
    let faces = |scene: &Scene| scene.surfaces.iter().map(|surface| surface.mesh.faces.len()).sum::<usize>();
    assert!(faces(&scene) > 8 * all.len() && obj.contains("\ng ground\nusemtl ground\n"));
    let followed = follow(self::session(BALL), [0.4, 0.6, 0.05], 2);
    let glb = Glb::read(&followed.growth.file(Played::Glb).unwrap());
    let usd = String::from_utf8(followed.growth.file(Played::Usda).unwrap()).unwrap();
    assert!(all.len() > 100);
    // Files begin with their first frame; what is seen at one is seen until the next.
    for later in [0.1, 0.13] {
        let shown = glb.shown(later);
        let points = &shown["ground.particles"].vertices;
        assert_eq!(points.len(), all.len());
        assert!(points.iter().zip(&all).all(|(point, middle)| (point - middle).norm() < 1e-5));
    }
    assert!(usd.contains("def Points \"ground_particles\""));
}

/// A rule that reads the height of such ground gets what is drawn.
#[test]
fn rules_read_ground_that_is_thrown_up() {
    let text = BALL.replace("initial string: ", "initial string: Mark(0) ");
    let text = format!("{text}Mark(y): solve y = ground(0, 0)\ninterpret Mark(y): f(1)\n");
    let session = session(&text);
    let terrain = terrain(&session, 1);
    let mut run = session.simulate(Settings::default()).unwrap();
    let mut string = ModuleString::default();
    for tick in [20, 50, 80] {
        let time = f64::from(tick) / 120.0;
        run.at(time, &mut string).unwrap();
        let read = string.get(0).parameters[0];
        let seen = terrain.height(time, [0.0; 2], None).unwrap();
        assert!((read - seen).abs() < 1e-5, "{read} {seen}");
    }
    assert_eq!(terrain.report(0.7, None).unwrap().imbalance, 0);
}

/// Values that cannot be, and more particles than there can be: messages with places and remedies.
#[test]
fn what_cannot_be_thrown_says_where() {
    let fine = BALL.replace("stick 0.003, shed 0.1, grain 0.004", "stick 0.05, grain 0.0002");
    let session = session(&fine);
    let error = terrain(&session, 1).at(0.6, MaterialId::LEAF, None).unwrap_err();
    let said = error.diagnostic().render(&session.source, false);
    assert!(said.contains("particles are in the air") && said.contains("ground.dls:2:1"), "{said}");
    assert!(said.contains("`grain D`"), "{said}");
}
