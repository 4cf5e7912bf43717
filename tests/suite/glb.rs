//! Animated GLB files, read by a reader of our own, against the model drawn again at random times, frames or not.

use std::collections::{BTreeMap, HashMap};
use std::fs;

use dlsys::interchange::{Error, Format, Growth, Limits, Options, grow};
use dlsys::render::{self, Fit, FrameWriter, Neck, Survey, View};
use dlsys::scene::{Point, Scene, Segment, Vector};
use dlsys::session::{Nursery, Session};
use dlsys::sim::{Settings, Simulation};
use dlsys::tree::ModuleString;

use crate::cli::{bad, good};
use crate::common::repository;
use crate::glb_reader::{Glb, Shown};

/// A model with its run followed up to a time.
pub struct Followed {
    pub session: Session,
    pub growth: Growth,
    pub options: Options,
}

/// Drawn with curved stems as straight pieces that are no further from them than `accuracy`, in units of the model; 0: not known.
fn scene_at(simulation: &mut Simulation<'_>, nursery: &Nursery<'_>, time: f64, accuracy: f64) -> Scene {
    let mut string = ModuleString::default();
    simulation.at(time, &mut string).expect("a run");
    let mut scene = nursery.blank();
    scene.accuracy = accuracy;
    nursery.draw(&string, &mut scene).expect("drawn");
    scene
}

pub fn follow(session: Session, [from, to, step]: [f64; 3], threads: usize) -> Followed {
    let settings = Settings::default();
    let count = ((to - from) / step).round() as usize;
    let times: Vec<f64> = (0..=count).map(|i| from + step * i as f64).collect();
    let mut survey = Survey::new(View::FRONT);
    {
        let nursery = Nursery::new(&session.model, settings);
        let mut simulation = session.simulate(settings).expect("a start");
        times.iter().for_each(|t| survey.add(&scene_at(&mut simulation, &nursery, *t, 0.0)));
    }
    let fit = FrameWriter::new(render::Format::OBJ, survey.fit()).fit;
    let mut options = Options::new(&session.model, fit.default_width, fit.accuracy / Fit::ACCURACY);
    options.threads = threads;
    options.grown = fit.is_grown();
    let growth = grow(&session, settings, &times, &options, &mut |_| true).expect("a growth");
    Followed { session, growth, options }
}

pub fn model(name: &str) -> Session {
    Session::open(&repository(&format!("models/{name}")), &[]).expect("a model")
}

/// Points on the side of a stem, which narrows where an axis goes on into it at its end.
fn side(segment: &Segment, neck: Option<Neck>, default_width: f64) -> Vec<Point> {
    let radii = segment.widths.map(|w| w.resolve(default_width) / 2.0);
    let length = (segment.end - segment.start).norm();
    let radius = |part: f64| {
        let plain = |part: f64| radii[0] + (radii[1] - radii[0]) * part;
        match neck.filter(|neck| part * length < neck.length) {
            Some(neck) => {
                let (u, narrow) = (part * length / neck.length, plain(neck.length / length));
                neck.radius + (narrow - neck.radius) * u * u * (3.0 - 2.0 * u)
            }
            None => plain(part),
        }
    };
    let u = segment.across;
    let v = segment.direction.cross(&u);
    let at = |(part, angle): (f64, f64)| {
        let out: Vector = u * angle.cos() + v * angle.sin();
        segment.start + (segment.end - segment.start) * part + out * radius(part)
    };
    let angles = (0..6).map(|k| f64::from(k) * 1.1);
    angles.flat_map(|angle| [0.0, 0.3, 0.7, 1.0].map(|part| (part, angle))).map(at).collect()
}

/// The largest distance of drawn points from what the file shows for their module, in metres.
pub fn worst(followed: &Followed, times: &[f64], first: f64) -> f64 {
    let glb = Glb::read(&followed.growth.file(Format::Glb).expect("a file"));
    worst_of(followed, |seconds| glb.shown(seconds), times, first)
}

/// The same of any file, by what it shows.
pub fn worst_of(
    followed: &Followed,
    shown: impl Fn(f64) -> BTreeMap<String, Shown>,
    times: &[f64],
    first: f64,
) -> f64 {
    let Followed { session, options, .. } = followed;
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut simulation = session.simulate(Settings::default()).expect("a start");
    let mut worst = 0.0_f64;
    let mut compared = 0;
    for &time in times {
        // In pieces as long as those of the file: the necks of shoots end with them.
        let pieces = 0.2 * options.accuracy * options.extent;
        let scene = scene_at(&mut simulation, &nursery, time, pieces);
        let shown = shown((time - first) * options.seconds);
        let mut points: HashMap<String, Vec<Point>> = HashMap::new();
        let mut add = |owner, some: Vec<Point>| {
            let owner = scene.owner(owner);
            let kind = dlsys::render::plain_name(&owner.name);
            points.entry(format!("{kind}.{}", owner.lineage.name())).or_default().extend(some);
        };
        let necks = match options.grown {
            true => render::necks(&scene, options.default_width),
            false => vec![None; scene.segments.len()],
        };
        for (segment, neck) in
            scene.segments.iter().zip(necks).filter(|(segment, _)| segment.contour.is_none())
        {
            add(segment.owner, side(segment, neck, options.default_width));
        }
        for polygon in &scene.polygons {
            add(polygon.owner, polygon.vertices.clone());
        }
        for surface in &scene.tessellated(options.accuracy * options.extent).surfaces {
            let all = surface.mesh.vertices.iter().map(|p| surface.placement.point(*p));
            add(surface.owner, all.collect());
        }
        for (name, points) in points {
            let Some(shown) = shown.get(&name) else { panic!("{name} is not shown at {time}") };
            let some = points.len().div_ceil(60);
            for point in points.iter().step_by(some) {
                let away = shown.distance(*point * options.metres);
                if away > worst && away > options.accuracy * options.extent {
                    eprintln!("{name} is {away:.3e} off at t = {time}, at {point}");
                }
                worst = worst.max(away);
                compared += 1;
            }
        }
    }
    assert!(compared > 1000, "{compared} points");
    worst
}

/// Times that are no frames.
pub fn random_times(from: f64, to: f64, count: usize) -> Vec<f64> {
    let mut times: Vec<f64> =
        (1..=count).map(|i| from + (to - from) * (i as f64 * 0.618_033_988_749_894_9).fract()).collect();
    times.sort_by(f64::total_cmp);
    times
}

/// Runs of models whose positions are compared, with their frames.
pub const RUNS: [(&str, [f64; 3]); 5] = [
    ("leaf.dls", [0.0, 9.0, 0.1]),
    ("dragon.dls", [0.0, 6.0, 0.125]),
    ("campanula.dls", [6.0, 20.0, 0.2]),
    ("lychnis.dls", [0.0, 5.0, 0.1]),
    ("birch.dls", [4.0, 9.0, 0.2]),
];

/// Checks the errors of the positions in the files of some runs at times that are no frames. `worst` is the largest one at these times.
pub fn check_positions(runs: &[(&str, [f64; 3])], worst: impl Fn(&Followed, &[f64], f64) -> f64) {
    for &(name, [from, to, step]) in runs {
        let followed = follow(model(name), [from, to, step], 2);
        let worst = worst(&followed, &random_times(from, to, 12), from);
        let allowed = followed.options.accuracy * followed.options.extent;
        assert!(worst <= allowed, "{name}: {worst} of {allowed}");
    }
}

#[test]
fn positions_are_within_the_accuracy_between_frames_too() {
    check_positions(&RUNS, worst);
}

/// Places in a GLB file have 32 bits.
#[test]
fn what_stands_too_far_from_the_origin_for_its_size_is_an_error() {
    let file = |far: &str| {
        let text =
            format!("initial string: f({far}) B(0.1)\nB(x): solve dx/dt = 1\ninterpret B(x): F(x) @L(x)");
        let session = Session::from_text("far.dls", &text, &[]).expect("a model");
        let growth = follow(session, [0.0, 2.0, 0.5], 1).growth;
        (growth.file(Format::Glb).map_err(|error| error.to_string()), growth.file(Format::Usda).is_ok())
    };
    assert!(file("1000").0.is_ok());
    let (glb, usd) = file("10000000");
    let message = glb.expect_err("refused");
    assert!(
        message.contains("1.000e7 m from the origin") && message.contains("off by 6.0e-1 m"),
        "{message}"
    );
    assert!(usd);
}

/// Whole runs of the models, at many times; those with stems that sway and with things that fall have tests of their own.
#[test]
#[ignore = "slow"]
fn all_models_are_within_the_accuracy_at_many_times() {
    const ALL: [(&str, [f64; 3]); 12] = [
        ("anabaena.dls", [200.0, 575.0, 1.0]),
        ("birch.dls", [0.0, 14.0, 0.1]),
        ("campanula.dls", [0.0, 20.0, 0.04]),
        ("dragon.dls", [0.0, 8.0, 0.125]),
        ("hieracium-apex.dls", [0.0, 30.0, 0.1]),
        ("hieracium.dls", [0.0, 30.0, 0.1]),
        ("leaf.dls", [0.0, 9.0, 0.05]),
        ("lychnis.dls", [0.0, 8.0, 0.02]),
        ("petal.dls", [0.0, 7.0, 0.05]),
        ("poppy.dls", [0.0, 26.0, 0.1]),
        ("sapling.dls", [0.0, 16.0, 0.1]),
        ("wilting.dls", [0.0, 12.0, 0.05]),
    ];
    for (name, [from, to, step]) in ALL {
        let followed = follow(model(name), [from, to, step], 2);
        let worst = worst(&followed, &random_times(from, to, 40), from);
        let allowed = followed.options.accuracy * followed.options.extent;
        assert!(worst <= allowed, "{name}: {worst} of {allowed}");
    }
}

#[test]
fn a_stem_that_begins_upside_down_by_rounding_keeps_its_ends() {
    // At first its length is negative by less than anything that is seen.
    let text = "initial string: B(0)\nB(x): solve dx/dt = 1\n\
                interpret B(x): !(0.2) F(x/2 - 1e-12) [ +(40x) !(0.02) F(1 + x^3) +(30x^2) @L(0.5 + x) ]";
    let session = Session::from_text("bud.dls", text, &[]).expect("a model");
    let followed = follow(session, [0.0, 2.0, 0.1], 1);
    let worst = worst(&followed, &random_times(0.0, 2.0, 30), 0.0);
    let allowed = followed.options.accuracy * followed.options.extent;
    assert!(worst <= allowed, "{worst} of {allowed}");
}

/// The shapes of such a drawing are sums of a few others, in which stems are no tubes.
#[test]
fn stems_that_turn_within_a_drawing_are_as_thick_as_they_are() {
    let text = "initial string: B(0)\nB(x): solve dx/dt = 1\n\
                interpret B(x): f(1) &(170x) [ +(50) !(0.3) F(0.6 + x) @W(0.05) ] [ -(50) !(0.2) F(0.4) ] f(x/10) @L(0.2)";
    let session = Session::from_text("vane.dls", text, &[]).expect("a model");
    let followed = follow(session, [0.0, 2.0, 0.1], 1);
    let worst = worst(&followed, &random_times(0.0, 2.0, 30), 0.0);
    let allowed = followed.options.accuracy * followed.options.extent;
    assert!(worst <= allowed, "{worst} of {allowed}");
}

#[test]
fn stems_that_sway_follow_the_wind() {
    let text = "units length 0.1, time 1\nwind 1, 0, 0 speed 3 turbulence 0.3 scale 4\n\
                tissue stalk = stiffness 2e8, density 900, damping 0.1\n\
                initial string: @E(stalk) S(1) S(1) [ +(40) @L(0.5) ] S(1)\nS(x): solve dx/dt = 0.2\ninterpret S(x): !(0.1) F(x)";
    let session = Session::from_text("reed.dls", text, &[]).expect("a model");
    let followed = follow(session, [0.0, 2.0, 0.1], 2);
    // Segments of the model are pieces of arcs, of another number than in the file: compared are their ends, by the distance of their sides.
    let worst = worst(&followed, &random_times(0.0, 2.0, 12), 0.0);
    let allowed = followed.options.accuracy * followed.options.extent * followed.options.metres;
    assert!(worst <= 2.0 * allowed, "{worst} of {allowed}");
}

#[test]
fn what_is_let_go_flies_as_its_drawing_does() {
    // The `@D` as a module of its own, and in a drawing.
    let text = "ground 0\nwind 1, 0, 0 speed 2 turbulence 0.4 scale 1\n\
                initial string: for k in 0 .. 1: ( [ f(0.6 + k/4) P(k) ] ) [ f(0.5) R ]\nP(k): if age = 0.3 + k/10 produce @D Q(k)\n\
                R: if age = 0.2 produce S\ninterpret P(k): @P(0.1)\ninterpret Q(k): @P(0.1)\n\
                interpret R: +(40) !(0.01) F(0.1) @L(0.1)\ninterpret S: +(40) @D !(0.01) F(0.1) @L(0.1)";
    let session = Session::from_text("petals.dls", text, &[]).expect("a model");
    // Flight, impacts from 0.52 s on, and rest.
    let followed = follow(session, [0.0, 1.5, 0.05], 2);
    let worst = worst(&followed, &random_times(0.0, 1.5, 100), 0.0);
    let allowed = followed.options.accuracy * followed.options.extent;
    assert!(worst <= allowed, "{worst} of {allowed}");
}

/// A fork whose shoots grow from nothing, in width and in length, is one node a module: no shape takes the place of another. Its shoots begin as wide as their stem in the
/// end, and the file follows them on the way.
#[test]
fn a_fork_that_grows_is_one_node_a_module() {
    let text = "initial string: T [ +(35) A(0, 0) ] [ -(35) &(20) A(0, 0) ]
def c(x) = if x < 1 then x else 1
A(w, l): solve w = c(age/4), l = c(age/6)
interpret T: @W(1) F(3)
interpret A(w, l): @W(0.7*w) F(3*l)";
    let session = Session::from_text("fork.dls", text, &[]).expect("a model");
    let followed = follow(session, [0.0, 8.0, 0.5], 2);
    assert_eq!(followed.growth.nodes(), 3);
    let off = worst(&followed, &random_times(0.0, 8.0, 30), 0.0);
    let allowed = followed.options.accuracy * followed.options.extent;
    assert!(off < allowed, "{off} of {allowed}");
    let glb = Glb::read(&followed.growth.file(Format::Glb).expect("a file"));
    let wide = |seconds: f64| {
        let shown = glb.shown(seconds);
        let beside = Point::new(0.0, 3.0, 0.0) + Vector::new(0.0, 0.3, 0.4);
        shown
            .iter()
            .filter(|(name, _)| name.starts_with('A'))
            .map(|(_, shape)| shape.distance(beside))
            .fold(f64::INFINITY, f64::min)
    };
    assert!(wide(8.0) < 0.1 && wide(1.0) > 0.3, "{} {}", wide(8.0), wide(1.0));
}

#[test]
fn modules_appear_and_vanish_within_a_millisecond() {
    let text = "initial string: A(0, 3)\nA(x, n):\n  if x < 1 solve dx/dt = 1\n  if x = 1 & n > 0 produce F(0.7) B(0) A(0, n - 1)\n  if x = 1 & n = 0 produce F(0.1)\n\
                B(y):\n  if y < 0.37 solve dy/dt = 1\n  if y = 0.37 produce F(0.3)\n\
                interpret A(x, n): F(0.2 + x)\ninterpret B(y): [ +(60) @L(0.5 + y) ]";
    let session = Session::from_text("events.dls", text, &[]).expect("a model");
    let growth = follow(session, [0.0, 4.0, 0.25], 1).growth;
    let glb = Glb::read(&growth.file(Format::Glb).expect("a file"));
    let mut checked = 0;
    for (number, node) in glb.nodes().iter().enumerate().filter(|(_, node)| !node["mesh"].is_null()) {
        let birth = node["extras"]["birth"].as_f64().expect("a birth");
        let death = node["extras"]["death"].as_f64();
        assert_eq!(death.is_some(), node["extras"]["rule"].is_string());
        assert!(glb.scale(number, birth + 1e-6) > 0.0, "{node}");
        if birth > 0.0 {
            assert_eq!(glb.scale(number, birth - 1e-3), 0.0, "{node}");
            checked += 1;
        }
        match death {
            Some(death) => {
                assert_eq!(glb.scale(number, death + 1e-3), 0.0, "{node}");
                assert!(glb.scale(number, death - 1e-6) > 0.0, "{node}");
                checked += 1;
            }
            None => assert!(glb.scale(number, 4.0) > 0.0),
        }
    }
    assert!(checked > 12 && glb.duration() == 4.0, "{checked}");
}

#[test]
fn lives_are_shared_and_the_file_depends_on_nothing_but_the_model() {
    let followed = follow(model("lychnis.dls"), [0.0, 8.0, 0.04], 1);
    let nodes = followed.growth.nodes();
    assert!(nodes > 100 && 4 * followed.growth.lives() < nodes, "{nodes} {}", followed.growth.lives());
    let file = followed.growth.file(Format::Glb).expect("a file");
    assert!(file.len() < 2_500_000, "{}", file.len());
    let others = follow(model("lychnis.dls"), [0.0, 8.0, 0.04], 3).growth.file(Format::Glb).expect("a file");
    assert!(file == others, "threads do not matter");
    let glb = Glb::read(&file);
    let mut names: Vec<&str> = glb.nodes().iter().filter_map(|node| node["name"].as_str()).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "names are unique");
}

#[test]
fn units_are_metres_and_seconds_and_titles_are_escaped() {
    let text = "title \"a \\\"reed\\\" \u{1f33e} </script>\"\nunits length 0.5, time 4\ninitial string: F(2) +(90) F(x0)\nparam x0 = 1\n";
    let text = text.replace("\\\"", "'");
    let session = Session::from_text("units.dls", &text, &[]).expect("a model");
    let growth = follow(session, [0.0, 3.0, 1.0], 1).growth;
    let glb = Glb::read(&growth.file(Format::Glb).expect("a file"));
    assert_eq!(glb.duration(), 12.0);
    let extras = &glb.json["asset"]["extras"];
    assert_eq!(
        (extras["seconds_per_unit"].as_f64(), extras["metres_per_unit"].as_f64()),
        (Some(4.0), Some(0.5))
    );
    assert_eq!(glb.json["scenes"][0]["name"], "a 'reed' \u{1f33e} </script>");
    let all: Vec<Point> = glb.shown(6.0).into_values().flat_map(|shown| shown.vertices).collect();
    let top = all.iter().map(|p| p.y).fold(f64::MIN, f64::max);
    let left = all.iter().map(|p| p.x).fold(f64::MAX, f64::min);
    // Two units high and one to the left, and the half ball of a line of 0.8 % of two units.
    assert!((top - 1.004).abs() < 1e-3 && (left + 0.504).abs() < 1e-3, "{top} {left}");
}

#[test]
fn too_much_is_refused_before_it_fills_the_memory() {
    let session = model("dragon.dls");
    let mut options = Options::new(&session.model, 0.01, 1.0);
    options.limits = Limits { nodes: 100, ..Limits::default() };
    let refused = grow(&session, Settings::default(), &[0.0, 4.0, 8.0], &options, &mut |_| true);
    assert!(matches!(refused, Err(Error::TooMany { limit: 100, .. })), "{refused:?}");
    options.limits = Limits { numbers: 1000, ..Limits::default() };
    let refused = grow(&session, Settings::default(), &[0.0, 4.0, 8.0], &options, &mut |_| true);
    assert!(matches!(refused, Err(Error::TooLarge { limit: 1000, .. })), "{refused:?}");
    options.seconds = 1e4;
    let refused = grow(&session, Settings::default(), &[0.0, 8.0], &options, &mut |_| true);
    assert!(matches!(refused, Err(Error::TooLong { .. })), "{refused:?}");
    options = Options::new(&session.model, 0.01, 1e50);
    let refused = grow(&session, Settings::default(), &[0.0, 8.0], &options, &mut |_| true);
    assert!(matches!(refused, Err(Error::TooWide { .. })), "{refused:?}");
    options = Options { floor: Some([-1e50, 0.0, 0.0, 10.0]), ..Options::new(&session.model, 0.01, 1.0) };
    let refused = grow(&session, Settings::default(), &[0.0, 8.0], &options, &mut |_| true);
    assert!(matches!(refused, Err(Error::GroundTooFar { metres: -1e50, .. })), "{refused:?}");
    options = Options::new(&session.model, 0.01, 1.0);
    let stopped = grow(&session, Settings::default(), &[0.0, 8.0], &options, &mut |_| false);
    assert!(matches!(stopped, Err(Error::Stopped { .. })), "{stopped:?}");
}

#[test]
fn the_program_writes_files_whole_or_not_at_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let said = good(&["run", "models/leaf.dls", "--format", "glb", "-o", &at("leaf.glb")]);
    assert!(said.contains("leaf.glb: 19 nodes, 4 different lives"), "{said}");
    let whole = fs::read(at("leaf.glb")).expect("a file");
    good(&["render", "models/leaf.dls", "--format", "glb", "-o", &at("there")]);
    assert!(fs::read(at("there/leaf.glb")).expect("a file") == whole, "both commands write the same");
    let still = Glb::read(&{
        good(&["render", "models/leaf.dls", "--at", "4", "--format", "glb", "-o", &at("still.glb")]);
        fs::read(at("still.glb")).expect("a file")
    });
    assert!(still.json["animations"].is_null() && still.shown(0.0).len() > 3);
    fs::write(at("thesis.glb"), "years of work").expect("written");
    let cases: [(&[&str], &str); 8] = [
        (&["run", "models/leaf.dls", "--format", "glb"], "name it, such as `-o leaf.glb`"),
        (&["run", "models/leaf.dls", "--format", "glb", "-o", "a.gltf"], "`-o a.glb`"),
        (&["run", "models/leaf.dls", "-o", "a.txt"], "add --format glb"),
        (
            &["run", "models/leaf.dls", "--format", "glb", "-o", "a.glb", "--seeds", "1..2"],
            "--seeds does not go",
        ),
        (&["run", "models/leaf.dls", "--format", "glb", "-o", "a.glb", "--speed", "1e-6"], "`--speed 1`"),
        (&["run", "models/meadow.dls", "--format", "glb", "-o", "a.glb"], "plants of other models"),
        (
            &["render", "models/leaf.dls", "--format", "glb", "-o", "a.glb", "--view", "top"],
            "--view does not go",
        ),
        (&["render", "models/leaf.dls", "--speed", "2", "-o", "a"], "--speed is for animated files"),
    ];
    for (arguments, expected) in cases {
        let (_, message) = bad(arguments);
        assert!(message.contains(expected), "{arguments:?}: {message}");
    }
    let (_, message) = bad(&["run", "models/leaf.dls", "--format", "glb", "-o", &at("thesis.glb")]);
    assert!(message.contains("is not a GLB file"), "{message}");
    // The format follows from the name.
    let (_, message) = bad(&["run", "models/leaf.dls", "-o", &at("thesis.glb")]);
    assert!(message.contains("is not a GLB file"), "{message}");
    assert_eq!(fs::read_to_string(at("thesis.glb")).expect("there"), "years of work");
    assert!(!repository("a.glb").exists());
}

/// Plants of other models, one of which holds another, at a single time: where they are, how they are turned, and one mesh for those that look the same.
#[test]
fn a_scene_of_plants_at_one_time_is_nodes_that_share_meshes() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let write = |name: &str, text: &str| fs::write(at(name), text).expect("written");
    write("twig.dls", "initial string: F(1)\nF(x): solve dx/dt = 1\ninterpret F(x): !(0.2) F(x)\n");
    write("bush.dls", "plant @Twig from \"twig.dls\"\ninitial string: F(3) -(90) @Twig(0)\n");
    write(
        "scene.dls",
        "plant @Twig from \"twig.dls\"\nplant @Bush from \"bush.dls\"\nframes 0 .. 2 step 1\n\
         initial string: [ f(5) @Twig(0) ] [ -(90) f(4) @Twig(0) ] [ +(90) f(7) -(90) @Bush(0) ]\n",
    );
    let said = good(&["render", &at("scene.dls"), "--at", "2", "-o", &at("scene.glb")]);
    assert!(said.contains("4 nodes, 3 different lives"), "{said}");
    let glb = Glb::read(&fs::read(at("scene.glb")).expect("a file"));
    assert!(glb.json["animations"].is_null());
    assert_eq!(glb.json["meshes"].as_array().map(Vec::len), Some(3), "{}", glb.json["meshes"]);
    let nodes = glb.nodes().iter().filter(|node| node["extras"]["kind"] == "@Twig");
    let meshes: Vec<String> = nodes.map(|node| node["mesh"].to_string()).collect();
    assert!(meshes.len() == 3 && meshes[0] == meshes[1], "{meshes:?}");
    // The twigs have a length of 3 and a radius of 0.1, and the bush has one at its top.
    let ends = [([0.0, 5.0], [0.0, 8.0]), ([4.0, 0.0], [7.0, 0.0]), ([-7.0, 3.0], [-4.0, 3.0])];
    let shown: Vec<Shown> = glb.shown(0.0).into_values().collect();
    for ([x, y], [to_x, to_y]) in ends {
        for part in [0.1, 0.5, 0.9] {
            let axis = Point::new(x + (to_x - x) * part, y + (to_y - y) * part, 0.0);
            let away = shown.iter().map(|shown| shown.distance(axis)).fold(f64::INFINITY, f64::min);
            assert!((away - 0.1).abs() < 0.01, "{axis}: {away}");
        }
    }
    for arguments in [&["--at", "2", "-o", "a.usda"][..], &["-o", "a.glb"]] {
        let (_, message) = bad(&[&["render", &at("scene.dls")], arguments].concat());
        assert!(message.contains("GLB files of a single time") && message.contains("--at T -o"), "{message}");
    }
}
