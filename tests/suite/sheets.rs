//! Sheets through the whole pipeline: `sheet` from the text and its mesh to surfaces and stems at any time.

use std::path::Path;

use dlsys::scene::{Point, Scene};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

use crate::common::repository;
use crate::glb::{self, follow, random_times};

/// A cloth of 4 by 4 squares, 1 by 1 in the plane y = 0.
pub fn cloth() -> String {
    cloth_of(1.0)
}

/// The same of another size.
pub fn cloth_of(size: f64) -> String {
    sheet_of(|x, z| [x * size, 0.0, z * size])
}

/// A sheet of 4 by 4 squares that lead from 0 to 1 along two directions.
fn sheet_of(place: impl Fn(f64, f64) -> [f64; 3]) -> String {
    let mut text = String::new();
    for k in 0..25 {
        let [x, y, z] = place((k % 5) as f64 / 4.0, (k / 5) as f64 / 4.0);
        text += &format!("v {x} {y} {z}\n");
    }
    for k in 0..16 {
        let a = k / 4 * 5 + k % 4 + 1;
        text += &format!("f {} {} {} {}\n", a, a + 5, a + 6, a + 1);
    }
    text
}

/// Held along two sides.
const CLOTH: &str = "tissue silk = stiffness 1e6, density 1000, damping 0.1, thickness 0.001
sheet @Cloth from \"cloth.obj\" of silk pinned x < 0.01 | x > 0.99\n";

/// A model beside a mesh.
pub fn with_mesh(text: &str, mesh: &str) -> Result<Session, String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("cloth.obj"), mesh).expect("written");
    let path = folder.path().join("model.dls");
    std::fs::write(&path, text).expect("written");
    let told = |error: Box<dlsys::session::LoadError>| {
        error.diagnostics.iter().map(|d| d.render(&error.source, false)).collect::<String>()
    };
    Session::open_with(&path, &[], &[]).map_err(told)
}

fn session(text: &str) -> Session {
    with_mesh(text, &cloth()).unwrap_or_else(|error| panic!("{error}"))
}

fn string(session: &Session, time: f64) -> ModuleString {
    let mut string = ModuleString::default();
    let mut simulation = session.simulate(Settings::default()).unwrap_or_else(|error| panic!("{error}"));
    simulation.at(time, &mut string).unwrap_or_else(|error| panic!("{error}"));
    string
}

fn draw(nursery: &Nursery<'_>, session: &Session, time: f64) -> Scene {
    let mut scene = nursery.blank();
    let drawn = nursery.draw(&string(session, time), &mut scene);
    drawn.unwrap_or_else(|error| panic!("{}", error.diagnostic().render(&session.source, false)));
    scene
}

/// The points of the only sheet at some times, drawn in this order by one nursery.
fn points(session: &Session, times: &[f64]) -> Vec<Vec<Point>> {
    let nursery = Nursery::new(&session.model, Settings::default());
    times
        .iter()
        .map(|time| draw(&nursery, session, *time).surfaces.last().expect("a sheet").mesh.vertices.clone())
        .collect()
}

/// At its birth a sheet has the shape of its file, where the turtle stands; then it hangs through, and is held where it is held.
#[test]
fn a_sheet_begins_in_the_shape_of_its_file_and_hangs_through() {
    let session = session(&format!(
        "{CLOTH}initial string: A(0)\nA(x):\n  if x < 0.5 solve dx/dt = 1\n  if x = 0.5 produce f(2) -(90) @Cloth\n"
    ));
    let nursery = Nursery::new(&session.model, Settings::default());
    assert!(draw(&nursery, &session, 0.25).surfaces.is_empty(), "it is not there yet");
    let [new, later] = &points(&session, &[0.5, 2.5])[..] else { panic!("two times") };
    let rest: Vec<Point> =
        (0..25).map(|k| Point::new(0.0, 2.0 - (k % 5) as f64 / 4.0, (k / 5) as f64 / 4.0)).collect();
    for (found, rest) in new.iter().zip(&rest) {
        assert!((found - rest).norm() < 1e-12, "{found} instead of {rest}");
    }
    let held = |k: usize| k.is_multiple_of(5) || k % 5 == 4;
    assert!((0..25).filter(|k| held(*k)).all(|k| later[k] == new[k]));
    assert!((0..25).filter(|k| !held(*k)).any(|k| later[k] != new[k]));
}

const BALL: &str = "solid Ball\nwind 0, 0, 1 speed 2 turbulence 0.3 scale 1\n\
    initial string: [ @Cloth ] Ball(0.6)\nBall(y): solve dy/dt = -0.8\n\
    interpret Ball(y): [ f(y) -(90) f(0.5) ^(90) f(0.5) @O(0.3) ]\n";

/// The same bits whatever is asked for, in whatever order, by however many threads.
#[test]
fn the_same_bits_in_any_order_and_with_two_threads() {
    let session = session(&format!("{CLOTH}{BALL}"));
    let times = [0.1, 0.35, 0.5, 0.62];
    let forwards = points(&session, &times);
    let mut mixed = points(&session, &[0.5, 0.1, 0.62, 0.35, 0.2]);
    mixed.swap(0, 1);
    mixed.swap(1, 3);
    mixed.swap(2, 3);
    assert_eq!(forwards, mixed[..4]);
    let nursery = Nursery::new(&session.model, Settings::default());
    let all = std::thread::scope(|scope| {
        let at = |time: f64| {
            scope.spawn({
                let (nursery, session) = (&nursery, &session);
                move || draw(nursery, session, time)
            })
        };
        times.map(at).map(|thread| {
            thread.join().expect("drawn").surfaces.last().expect("a sheet").mesh.vertices.clone()
        })
    });
    assert_eq!(forwards, all);
}

/// A ball that presses into a cloth takes it along, and no corner of the cloth is in the ball.
#[test]
fn a_solid_takes_a_sheet_along_and_does_not_pierce_it() {
    let session = session(&format!("{CLOTH}{BALL}"));
    for time in [0.6, 0.8, 0.9] {
        let nursery = Nursery::new(&session.model, Settings::default());
        let scene = draw(&nursery, &session, time);
        let ball = &scene.surfaces[0];
        let centre = ball.placement.origin;
        assert!((centre - Point::new(0.5, 0.6 - 0.8 * time, 0.5)).norm() < 1e-9, "{centre}");
        let sheet = &scene.surfaces[1].mesh.vertices;
        let nearest = sheet.iter().map(|point| (point - centre).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest > 0.8 * 0.15, "a corner is {nearest} from the middle of the ball at t = {time}");
        // The middle of the cloth is in front of the ball.
        assert!(sheet[12].y < centre.y - 0.1, "{}", sheet[12]);
    }
}

/// What a production puts elsewhere has not passed what is between, as on soil: the cloth between both places does not feel it.
#[test]
fn a_solid_that_is_put_elsewhere_passes_nothing() {
    let hop = BALL.replace(
        "solve dy/dt = -0.8",
        "if age < 0.3 | y < 0 solve dy/dt = 0, if age = 0.3 & y > 0 produce Ball(-0.6)",
    );
    let hop = hop.replace("solve dy/dt = 0,", "solve dy/dt = 0\n ");
    let alone = session(&format!("{CLOTH}{}", hop.replace("solid Ball\n", "")));
    let among = session(&format!("{CLOTH}{hop}"));
    let times = [0.29, 0.3125, 0.33, 0.5];
    assert_eq!(points(&among, &times), points(&alone, &times));
}

/// A sheet on what bends is a mistake: it would stay where the stem is at rest.
#[test]
fn sheets_on_stems_that_bend_are_errors() {
    for hold in ["@E(silk) !(0.1) F(1) @Cloth", "@E(silk) !(0.1) F(1) [ @E(0) F(1) @Cloth ]"] {
        let session = session(&format!("{CLOTH}initial string: {hold}\n"));
        let nursery = Nursery::new(&session.model, Settings::default());
        let error = nursery.draw(&string(&session, 0.1), &mut nursery.blank()).expect_err("it bends");
        let said = error.diagnostic().render(&session.source, false);
        assert!(said.contains("places a sheet on stems that bend") && said.contains("model.dls:"), "{said}");
    }
    let session = session(&format!("{CLOTH}initial string: [ @E(silk) !(0.1) F(1) ] @Cloth\n"));
    draw(&Nursery::new(&session.model, Settings::default()), &session, 0.1);
}

/// A cloth that is held along one side lies down on the ground.
#[test]
fn a_sheet_lies_on_the_ground() {
    let text = CLOTH.replace(" | x > 0.99", "");
    let session = session(&format!("{text}ground -0.3\ninitial string: @Cloth\n"));
    let [points] = &points(&session, &[1.5])[..] else { panic!("one time") };
    let lowest = points.iter().map(|point| point.y).fold(f64::INFINITY, f64::min);
    assert!((-0.302..-0.29).contains(&lowest), "{lowest}");
}

/// Lines of the mesh are stems with the thickness of the tissue, which follow the points.
#[test]
fn cords_are_stems() {
    let text = "units length 0.1\ntissue rope = stiffness 1e7, density 1000, damping 0.1, thickness 0.004\n\
        sheet @Rope from \"cloth.obj\" of rope pinned x < 0.1\ninitial string: @Rope";
    let session = with_mesh(text, "v 0 0 0\nv 1 0 0\nv 2 0 0\nl 1 2 3\n").expect("a model");
    let nursery = Nursery::new(&session.model, Settings::default());
    let scene = draw(&nursery, &session, 0.3);
    assert_eq!(scene.segments.len(), 2);
    assert!(scene.surfaces.is_empty() && scene.segments[1].follows == Some(0));
    assert_eq!(scene.segments[0].end, scene.segments[1].start);
    assert!(scene.segments.iter().all(|segment| (segment.widths[0].resolve(1.0) - 0.04).abs() < 1e-12));
    assert!(scene.segments[1].end.y < -0.5, "it falls: {}", scene.segments[1].end);
}

/// What cannot be a sheet is told with its place and with advice.
#[test]
fn mistakes_have_their_place() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\n";
    let model = |tissue: &str, rest: &str| {
        format!(
            "tissue silk = stiffness 1e6, density 1000, damping 0.1{tissue}\nsheet @Cloth from \"cloth.obj\" {rest}\ninitial string: @Cloth\n"
        )
    };
    let good = "of silk pinned x < 0.1";
    let cases: &[(String, String, &str)] = &[
        (model("", good), format!("{square}v 0 1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n"), "model.dls:2:19\n"),
        (
            model("", good),
            format!("{square}f 1 2 3\nf 1 2 4\nf 2 1 4 3\n"),
            "cloth.obj, line 1: it is not manifold: 3 faces share the edge between points 1 and 2",
        ),
        (
            model("", good),
            format!("{square}f 1 2 3\n"),
            "cloth.obj, line 4: point 4 belongs to no face and to no line, so its mass is 0",
        ),
        (
            model("", good),
            format!("{square}f 1 2 3 4\nf 1 1 2\n"),
            "cloth.obj, line 6: this face is not valid: it has a point twice",
        ),
        (model("", good), "v 0 0 0\n".to_owned(), "the file has no faces and no lines"),
        (
            model("", "of silk pinned x > 5"),
            format!("{square}f 1 2 3 4\n"),
            "its points have x from 0 to 1, y from 0 to 0, z from 0 to 1",
        ),
        (
            model("", "of silk pinned t > 5"),
            format!("{square}f 1 2 3 4\n"),
            "a sheet is held at the same points at all times",
        ),
        (model("", "of silk pinned 1"), format!("{square}f 1 2 3 4\n"), "model.dls:2:46\n"),
        (model("", "of slik pinned x < 0.1"), format!("{square}f 1 2 3 4\n"), "there is no tissue `slik`"),
        (model("", "of silk"), format!("{square}f 1 2 3 4\n"), "pinned"),
        (
            model("", good).replace("1e6", "1e6 + t"),
            format!("{square}f 1 2 3 4\n"),
            "a sheet keeps its stiffness",
        ),
        (
            model("", good).replace("string: @Cloth", "string: @Cloth(2)"),
            format!("{square}f 1 2 3 4\n"),
            "the sheet `@Cloth` has no parameters",
        ),
        (
            model("", good).replace("cloth.obj", "lost.obj"),
            format!("{square}f 1 2 3 4\n"),
            "put it into the folder of the model's file or below",
        ),
        (
            model("", good).replace("cloth.obj", "../cloth.obj"),
            format!("{square}f 1 2 3 4\n"),
            "the path leaves the model's folder",
        ),
    ];
    for (text, mesh, part) in cases {
        let said = with_mesh(text, mesh).expect_err("a mistake");
        assert!(said.contains(part), "{part:?} is not in\n{said}");
        assert!(said.contains("model.dls:") && said.contains("= help: "), "{said}");
    }
}

/// The models of the book are drawn, and no frame changes what follows.
#[test]
fn the_net_of_the_book_opens_for_the_ball() {
    let session =
        Session::open(Path::new(&repository("models/scenes/basketball.dls")), &[]).expect("a model");
    let nursery = Nursery::new(&session.model, Settings::default());
    let widest = |scene: &Scene| {
        let low = scene
            .segments
            .iter()
            .filter(|segment| segment.start.y < 2.64 && segment.widths[0].resolve(1.0) < 0.01);
        low.map(|segment| segment.start.x.hypot(segment.start.z)).fold(0.0, f64::max)
    };
    let before = widest(&draw(&nursery, &session, 0.05));
    let within = widest(&draw(&nursery, &session, 0.44));
    assert!(before < 0.118 && within > 0.122, "{before} and {within}");
}

#[test]
fn a_tissue_of_a_sheet_alone_bends_no_stems() {
    let session =
        Session::open(Path::new(&repository("models/scenes/basketball.dls")), &[]).expect("a model");
    assert!(!session.model.scenery.tissues.is_empty() && !dlsys::turtle::bends(&session.model));
    assert!(!dlsys::session::sways(&session.model));
}

/// In a file that plays, a sheet is one mesh, whose points are where they are drawn at any time.
#[test]
fn files_that_play_have_one_mesh_for_a_sheet() {
    let session = session(&format!("{CLOTH}{BALL}"));
    let followed = follow(session, [0.0, 1.5, 0.05], 2);
    // The ball, and the cloth.
    assert_eq!(followed.growth.nodes(), 2);
    let worst = glb::worst(&followed, &random_times(0.0, 1.5, 60), 0.0);
    let allowed = followed.options.accuracy * followed.options.extent * followed.options.metres;
    assert!(worst > 0.0 && worst <= allowed, "{worst} of {allowed}");
}

/// A production that makes two of a module hands its sheet to the first; the other one has a sheet of its own, where the turtle stands.
#[test]
fn a_copy_of_a_module_has_a_sheet_of_its_own() {
    let session = session(&format!(
        "{CLOTH}initial string: A\nA: if age = 0.5 produce [ B ] -(90) f(2) +(90) B\n\
         B: if age = 0.5 produce C\ninterpret A: @Cloth\ninterpret B: @Cloth\ninterpret C: @Cloth\n"
    ));
    let nursery = Nursery::new(&session.model, Settings::default());
    let alone = points(&session, &[0.45])[0].clone();
    for time in [0.55, 0.75, 1.3] {
        let scene = draw(&nursery, &session, time);
        let least = |n: usize| {
            let vertices = &scene.surfaces[n].mesh.vertices;
            vertices.iter().map(|point| point.x).fold(f64::INFINITY, f64::min)
        };
        assert_eq!(scene.surfaces.len(), 2);
        assert!(least(0).abs() < 0.1 && (least(1) - 2.0).abs() < 0.1, "{time}: {} {}", least(0), least(1));
    }
    // The first has hung on, the other one begins flat.
    let scene = draw(&nursery, &session, 0.5 + 1e-9);
    let sag = |points: &[Point]| points.iter().map(|point| point.y.abs()).fold(0.0, f64::max);
    assert!(
        sag(&scene.surfaces[1].mesh.vertices) < 1e-6
            && sag(&scene.surfaces[0].mesh.vertices) > 0.5 * sag(&alone)
    );
}

/// A flag in still air hangs down: the plane in which it begins is no rest.
#[test]
fn a_flag_in_still_air_hangs_down() {
    let text = sheet_of(|x, y| [x, y / 2.0, 0.0]);
    let model = "tissue silk = stiffness 1e6, density 500, damping 0.2, thickness 0.0002\n\
                 sheet @Cloth from \"cloth.obj\" of silk pinned x < 0.01\ninitial string: f(2) @Cloth\n";
    let session = with_mesh(model, &text).unwrap_or_else(|error| panic!("{error}"));
    let [first, later] = &points(&session, &[0.1, 12.0])[..] else { panic!("two times") };
    let lowest = |points: &[Point]| points.iter().map(|point| point.y).fold(f64::INFINITY, f64::min);
    let flat = first.iter().map(|point| point.z.abs()).fold(0.0, f64::max);
    assert!(flat < 1e-3, "it begins flat: {flat}");
    assert!(lowest(later) < 1.7, "it hangs down to {}", lowest(later));
}
