//! Organs from text to files: surfaces from files, patches, gradients, tapering and bent stems, chains of
//! polygons, nested drawings.

use std::collections::HashMap;
use std::path::Path;

use dlsys::render::{Format, FrameWriter, Survey, View};
use dlsys::scene::{Point, Scene, Vector};
use dlsys::session::Session;
use dlsys::tree::ModuleString;
use dlsys::turtle;

const LEAF: &str = "-1 1  0 1  0 1\nCONTACT POINT X: 0 Y: 0 Z: 0\nEND POINT X: 0 Y: 0 Z: 0\n\
    HEADING X: 0 Y: 0 Z: 1\nUP X: 0 Y: 1 Z: 0\nSIZE: 1\npatch\n\
    TOP COLOR: 0 DIFFUSE: 0 BOTTOM COLOR: 0 DIFFUSE: 0\nAL: ~ A: ~ AR: ~\nL: ~ R: ~\nBL: ~ B: ~ BR: ~\n\
    0 0 0  0 0 0  0 0 0  0 0 0\n-0.75 0 0.2  -0.25 0 0.2  0.25 0 0.2  0.75 0 0.2\n\
    -0.4 0.1 0.8  -0.2 0.3 0.3  0.2 0.3 0.3  0.4 0.1 0.8\n0 0 1  0 0 1  0 0 1  0 0 1\n";

fn at(session: &Session, t: f64) -> Scene {
    let mut simulation = session.simulate(Default::default()).expect("it starts");
    let mut string = ModuleString::default();
    simulation.at(t, &mut string).expect("it runs");
    let mut scene = Scene::default();
    turtle::draw(&session.model, &string, &mut scene).expect("drawable");
    scene
}

fn scene(text: &str) -> Scene {
    at(&crate::common::session(text), 0.0)
}

fn writer(scene: &Scene, format: Format) -> FrameWriter {
    let mut survey = Survey::new(View::FRONT);
    survey.add(scene);
    FrameWriter::new(format, survey.fit())
}

fn obj(scene: &Scene) -> String {
    String::from_utf8(writer(scene, Format::OBJ).write(scene, "organs")).expect("UTF-8")
}

/// Triangles of an OBJ: places and normals of their corners, and the numbers of their vertices.
struct Triangle {
    places: [Point; 3],
    normals: [Vector; 3],
    vertices: [usize; 3],
}

fn triangles(text: &str) -> Vec<Triangle> {
    let numbers =
        |line: &str| -> Vec<f64> { line.split(' ').skip(1).map(|x| x.parse().expect("a number")).collect() };
    let vectors = |keyword: &str| -> Vec<Vector> {
        (text.lines().filter(|line| line.starts_with(keyword)))
            .map(|line| Vector::from_column_slice(&numbers(line)))
            .collect()
    };
    let (points, normals) = (vectors("v "), vectors("vn "));
    assert!(points.iter().chain(&normals).all(|v| v.iter().all(|c| c.is_finite())));
    let corner = |text: &str| -> [usize; 2] {
        let (vertex, normal) = text.split_once("//").expect("two numbers");
        [vertex, normal].map(|n| n.parse::<usize>().expect("a number") - 1)
    };
    (text.lines().filter_map(|line| line.strip_prefix("f ")))
        .map(|face| {
            let corners: Vec<[usize; 2]> = face.split(' ').map(corner).collect();
            let corners = [corners[0], corners[1], corners[2]];
            Triangle {
                places: corners.map(|[v, _]| Point::from(points[v])),
                normals: corners.map(|[_, n]| normals[n]),
                vertices: corners.map(|[v, _]| v),
            }
        })
        .collect()
}

impl Triangle {
    fn area(&self) -> Vector {
        let [a, b, c] = self.places;
        (b - a).cross(&(c - a)) / 2.0
    }
}

/// No triangle without area, no normal against its triangle.
fn assert_sound(all: &[Triangle], what: &str) {
    assert!(!all.is_empty(), "{what}");
    for triangle in all {
        assert!(triangle.area().norm() > 0.0, "{what}: {:?}", triangle.places);
        for normal in triangle.normals {
            assert!((normal.norm() - 1.0).abs() < 1e-3, "{what}");
            assert!(triangle.area().dot(&normal) > -1e-9, "{what}: {:?} {normal}", triangle.places);
        }
    }
}

/// Every edge is passed once in each direction, and the inside is inside.
fn assert_closed(all: &[Triangle], what: &str) {
    let mut edges: HashMap<[usize; 2], i32> = HashMap::new();
    for t in all {
        for k in 0..3 {
            let (a, b) = (t.vertices[k], t.vertices[(k + 1) % 3]);
            *edges.entry([a, b]).or_default() += 1;
            *edges.entry([b, a]).or_default() -= 1;
        }
    }
    assert!(edges.values().all(|&count| count == 0), "{what}");
    let volume: f64 = all
        .iter()
        .map(|t| t.places[0].coords.dot(&t.places[1].coords.cross(&t.places[2].coords)) / 6.0)
        .sum();
    assert!(volume > 0.0, "{what}: {volume}");
}

#[test]
fn stems_of_every_kind_are_closed_and_sound() {
    for (what, text) in [
        ("a cone", "initial string: !(0.3) F(1) F(1) @W(0)"),
        ("two cones", "initial string: !(0) F(1) @W(0.3) F(0.5) @W(0) F(0.2) @W(0.2)"),
        ("a tapering tree", "initial string: !(0.3) F(1) @W(0.2) [ +(40) @W(0.1) F(1) @W(0) ] F(1) @W(0)"),
        ("a bent stem", "tropism 0, -1, 0 strength 0.9\ninitial string: +(60) !(0.2) F(3) @W(0.05) F(1)"),
        (
            "a square stem",
            "contour square = (1, 1) (-1, 1) (-1, -1) (1, -1)\n\
             initial string: @C(square) !(0.2) F(1) +(30) F(1) @W(0.1) F(1) @C(0) F(1)",
        ),
    ] {
        let all = triangles(&obj(&scene(text)));
        assert_sound(&all, what);
        assert_closed(&all, what);
    }
}

#[test]
fn a_branch_begins_inside_its_stem() {
    let text = "initial string: !(0.3) F(1) [ +(70) !(0.2) F(1) ] [ /(90) &(50) !(0.3) F(1) ] F(1)";
    let tree = scene(text);
    for branch in tree.segments.iter().filter(|s| s.start.y == 1.0 && s.follows.is_none()) {
        // The dome at its start is a ball around a point of the stem's axis, no thicker than the stem.
        assert!(branch.start.x == 0.0 && branch.widths[0].resolve(1.0) <= 0.3);
    }
    assert_closed(&triangles(&obj(&tree)), "branches");
}

#[test]
fn a_thick_stem_has_more_sides() {
    let count = |text: &str| triangles(&obj(&scene(text))).len();
    assert!(count("initial string: !(0.3) F(1)") > 2 * count("initial string: !(0.003) F(1)"));
}

#[test]
fn surfaces_come_from_files_beside_the_model() {
    let home = tempfile::tempdir().expect("a directory");
    let place = |name: &str, text: &str| {
        let path = home.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(&path, text).expect("written");
        path
    };
    place("organs/leaf.s", LEAF);
    // What we export reads back as it was drawn.
    place("petal.obj", &obj(&scene("initial string: @P(1)")));
    let model = place(
        "plant.dls",
        "surface @L from \"organs/leaf.s\"\nsurface @Q from \"petal.obj\"\ninitial string: F(1) @L(2) @Q(1) @P(1)",
    );
    let session = Session::open(&model, &[]).expect("a good model");
    assert!(session.warnings.is_empty());
    let drawn = at(&session, 0.0);
    assert_eq!(drawn.surfaces.len(), 3);
    let tip = drawn.surfaces[0].mesh.vertices.iter().map(|&v| drawn.surfaces[0].placement.point(v).y);
    assert!((tip.fold(0.0, f64::max) - 3.0).abs() < 1e-9, "the leaf of the file, not the one built in");
    let corners = |i: usize| -> Vec<Point> {
        let fine = drawn.tessellated(writer(&drawn, Format::OBJ).fit.accuracy).into_owned();
        let surface = &fine.surfaces[i];
        let mut all: Vec<Point> = surface.mesh.vertices.iter().map(|&v| surface.placement.point(v)).collect();
        all.sort_by(|a, b| a.coords.as_slice().partial_cmp(b.coords.as_slice()).expect("numbers"));
        all
    };
    let (read, built_in) = (corners(1), corners(2));
    let near = |p: &Point| built_in.iter().map(|q| (p - q).norm()).fold(1.0, f64::min);
    assert!(read.iter().map(near).fold(0.0, f64::max) < 0.05);
    assert_sound(&triangles(&obj(&drawn)), "surfaces");

    let message = |path: &Path| -> String {
        let refused = Session::open(path, &[]).expect_err("refused");
        refused.diagnostics.iter().map(|d| d.render(&refused.source, false)).collect()
    };
    let declare =
        |file: &str| place("bad.dls", &format!("surface @L from \"{file}\"\ninitial string: @L(1)"));
    place("broken.s", &LEAF.replace("-0.75 0 0.2", "-0.75 O 0.2"));
    let said = message(&declare("broken.s"));
    assert!(said.contains("broken.s, line 13: expected a number, not `O`"), "{said}");
    assert!(said.contains("bad.dls:1:17"), "{said}");
    let said = message(&declare("missing.s"));
    assert!(said.contains("there is no file") && said.contains("missing.s"), "{said}");
    for outside in ["../leaf.s", "/etc/leaf.s", "organs/../../leaf.s"] {
        let said = message(&declare(outside));
        assert!(said.contains("leaves the model's folder"), "{said}");
    }
    #[cfg(unix)]
    {
        let elsewhere = tempfile::tempdir().expect("a directory");
        std::fs::write(elsewhere.path().join("leaf.s"), LEAF).expect("written");
        std::os::unix::fs::symlink(elsewhere.path().join("leaf.s"), home.path().join("link.s"))
            .expect("made");
        let said = message(&declare("link.s"));
        assert!(said.contains("leads out of the model's folder"), "{said}");
    }
}

#[test]
fn colours_and_gradients_reach_pictures_and_materials() {
    let text = "color rose = \"#e573a5\"\ngradient dry = \"#7d5a3c\", \"#ffffff\"\n\
        initial string: ;(rose) F(1) ;(dry, 0) F(1) ;(dry, 0.5) F(1) ;(dry, 7) F(1) ;(dry, 0) @P(1)";
    let scene = scene(text);
    let svg = String::from_utf8(writer(&scene, Format::SVG).write(&scene, "colours")).expect("UTF-8");
    for color in ["#e573a5", "#7d5a3c", "#bfae9f", "#ffffff"] {
        assert!(svg.contains(color), "{color}");
    }
    let [library] = &writer(&scene, Format::OBJ).companions(&scene)[..] else { panic!("a library") };
    let materials = String::from_utf8(library.bytes.clone()).expect("UTF-8");
    assert_eq!(materials.matches("newmtl dry-").count(), 64);
    assert!(materials.contains("newmtl rose\n"));
    let used: Vec<String> =
        obj(&scene).lines().filter_map(|l| l.strip_prefix("usemtl ")).map(str::to_owned).collect();
    assert_eq!(used, ["rose", "dry-00", "dry-32", "dry-63", "dry-00"]);
}

#[test]
fn a_petal_is_a_chain_of_rectangles() {
    // Ten rectangles, one after the other, each bent against the one before it by an angle that grows.
    let text = "angle 90\nparam w = 0.2\ninitial string: P(10, 0)\nP(n, a): solve da/dt = 1\n\
        interpret P(n, a): R(a) R(a) R(a) R(a) R(a) R(a) R(a) R(a) R(a) R(a)\n\
        interpret R(a): &(a) { [ + g(w/2) . ] [ - g(w/2) . ] g(0.3) [ - g(w/2) . ] [ + g(w/2) . ] }";
    let session = crate::common::session(text);
    let drawn = at(&session, 9.0);
    assert_eq!(drawn.polygons.len(), 10);
    assert!(drawn.segments.is_empty());
    for pair in drawn.polygons.windows(2) {
        let shared =
            pair[0].vertices.iter().filter(|p| pair[1].vertices.iter().any(|q| (*p - q).norm() < 1e-9));
        assert_eq!(shared.count(), 2, "rectangles hang together");
    }
    for polygon in &drawn.polygons {
        assert_eq!(polygon.vertices.len(), 4);
    }
    let end = drawn.polygons[9].vertices[2];
    assert!(end.z < -1.0, "the petal bends down: {end}");
    assert_sound(&triangles(&obj(&drawn)), "a petal of polygons");
}

#[test]
fn drawings_nest_and_see_the_state() {
    // Three levels with parameters, `t` and the module's own age at each of them.
    let text = "initial string: A(1)\nA(x): if x < 3 solve dx/dt = 1\n if x = 3 produce A(1)\n\
        interpret A(x): B(x, t)\ninterpret B(x, s): C(x + s, age)\ninterpret C(y, a): F(y) F(a)";
    let nested = at(&crate::common::session(text), 2.5);
    let lengths: Vec<f64> = nested.segments.iter().map(|s| (s.end - s.start).norm()).collect();
    // At 2.5 the module is 0.5 old and has x = 1.5.
    assert!((lengths[0] - 4.0).abs() < 1e-9 && (lengths[1] - 0.5).abs() < 1e-9, "{lengths:?}");
    // What a drawing does to the turtle stays, unless it stands in brackets of its own.
    let widths =
        |text: &str| -> Vec<f64> { scene(text).segments.iter().map(|s| s.widths[0].resolve(0.01)).collect() };
    assert_eq!(widths("initial string: A F(1)\ninterpret A: !(0.5) F(1)"), [0.5, 0.5]);
    assert_eq!(widths("initial string: A F(1)\ninterpret A: [ !(0.5) F(1) ]"), [0.5, 0.01]);
}

#[test]
fn widths_grow_by_their_own_equation() {
    let text =
        "initial string: F(1, 0.1)\nF(x, w): solve dx/dt = 0, dw/dt = 0.1\ninterpret F(x, w): !(w) F(x)";
    let session = crate::common::session(text);
    for t in [0.0, 1.0, 2.5] {
        let width = at(&session, t).segments[0].widths[1].resolve(f64::NAN);
        assert!((width - (0.1 + 0.1 * t)).abs() < 1e-12, "{t}");
    }
}

#[test]
fn a_patch_opens_smoothly() {
    // A petal whose skeleton opens; between frames no point of the surface goes further than a control point.
    let text = "angle 90\ninitial string: P(0)\nP(a): solve da/dt = 10\n\
        interpret P(a): @PS(1) R(0, 0.02, 0, a) R(1, 0.3, 0.4, a) R(2, 0.4, 0.8, a) R(3, 0.1, 1, a) @PD(1)\n\
        interpret R(r, w, l, a): [ &(a*l) g(l) [ + g(w) @PC(1, r, 0) ] [ + g(w/3) @PC(1, r, 1) ] \
        [ - g(w/3) @PC(1, r, 2) ] [ - g(w) @PC(1, r, 3) ] ]";
    let session = crate::common::session(text);
    let net = |t: f64| at(&session, t).patches[0].net;
    let moved = |a: f64, b: f64| {
        let (before, after) = (net(a), net(b));
        let pairs = before.iter().flatten().zip(after.iter().flatten());
        pairs.map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
    };
    let largest = |step: f64| {
        let count = (4.0 / step).round() as usize;
        (0..count).map(|i| moved(step * i as f64, step * (i + 1) as f64)).fold(0.0, f64::max)
    };
    let [coarse, middle, fine] = [0.5, 0.25, 0.125].map(largest);
    assert!(
        (coarse / middle - 2.0).abs() < 0.01 && (middle / fine - 2.0).abs() < 0.01,
        "{coarse} {middle} {fine}"
    );
    let opened = at(&session, 4.0);
    assert_sound(&triangles(&obj(&opened)), "a petal of a patch");
}
