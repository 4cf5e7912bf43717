//! Files of the exporters, read back by independent libraries, and compared with golden files.
//!
//! The golden files under `tests/golden` are small enough to be read. To renew them after an intended change,
//! run the tests with `DLSYS_RENEW_GOLDEN=1` and review the difference.

use std::collections::HashMap;

use crate::common::scene;
use dlsys::render::{Fit, Format, FrameWriter, Survey, View};
use dlsys::scene::{Point, Scene, Vector};
use proptest::prelude::*;

const TWIG: &str = "F_i(2)[+(60)@L(1.5)][-(60)!(0.1)F(1);(5){f(1)-(120)f(1)-(120)f(1)}]F_i(1)@K(1)";

fn fit(scene: &Scene, view: &str) -> Fit {
    let mut survey = Survey::new(view.parse().expect("a view"));
    survey.add(scene);
    survey.fit()
}

fn written(scene: &Scene, view: &str, format: Format) -> String {
    let bytes = FrameWriter::new(format, fit(scene, view)).write(scene, "a twig, t = 1.5 & <more>");
    String::from_utf8(bytes).expect("UTF-8")
}

/// Compares with a file under `tests/golden`, line by line.
pub fn assert_golden(name: &str, text: &str) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("DLSYS_RENEW_GOLDEN").is_some() {
        std::fs::write(&path, text).expect("written");
    }
    let golden = std::fs::read_to_string(&path).expect("a golden file").replace("\r\n", "\n");
    for (number, (ours, theirs)) in text.lines().zip(golden.lines()).enumerate() {
        assert_eq!(ours, theirs, "{name}, line {}", number + 1);
    }
    assert_eq!(text.len(), golden.len(), "{name}");
}

#[test]
fn golden_files() {
    let twig = scene("F_i(2)[+(60)F(1)]!(0.1)F_i(1){-(30)f(1)+(120)f(1)+(120)f(1)}");
    assert_golden("twig.svg", &written(&twig, "front", Format::SVG));
    let bend = scene("!(0.5)F_i(2)+(30)F_i(1)");
    let mut writer = FrameWriter::new(Format::OBJ, fit(&bend, "front"));
    writer.sides = 4;
    assert_golden("bend.obj", &String::from_utf8(writer.write(&bend, "a bend")).expect("UTF-8"));
    let [library] = &writer.companions(&bend)[..] else { panic!("a material library") };
    assert_golden(&library.name, &String::from_utf8(library.bytes.clone()).expect("UTF-8"));
}

/// All elements of an SVG that are drawn.
pub fn nodes(group: &usvg::Group) -> Vec<&usvg::Path> {
    let mut found = Vec::new();
    for node in group.children() {
        match node {
            usvg::Node::Group(inner) => found.extend(nodes(inner)),
            usvg::Node::Path(path) => found.push(&**path),
            _ => {}
        }
    }
    found
}

#[test]
fn pictures_are_read_back_and_never_cropped() {
    for view in ["front", "side", "top", "30,20", "-120,-70"] {
        let text = written(&scene(TWIG), view, Format::SVG);
        let tree = usvg::Tree::from_str(&text, &usvg::Options::default()).expect("an SVG");
        let size = tree.size();
        let paths = nodes(tree.root());
        assert!(paths.len() > 10, "{view}");
        for path in paths {
            let bounds = path.abs_stroke_bounding_box();
            let slack = 1e-3;
            assert!(bounds.left() >= -slack && bounds.top() >= -slack, "{view}: {bounds:?}");
            assert!(bounds.right() <= size.width() + slack, "{view}: {bounds:?}");
            assert!(bounds.bottom() <= size.height() + slack, "{view}: {bounds:?}");
        }
    }
}

#[test]
fn strokes_have_the_width_that_was_set() {
    let scene = scene("!(0.25)F(4)");
    let fit = fit(&scene, "front");
    let text = written(&scene, "front", Format::SVG);
    let width = 0.25 * fit.picture.scale;
    assert!(text.contains(&format!("stroke-width=\"{width}\"")), "{text}");
    assert!(text.contains("id=\"F-"), "{text}");
    assert!(text.contains("<title>a twig, t = 1.5 &amp; &lt;more&gt;</title>"), "{text}");
}

#[test]
fn ids_are_unique_and_last() {
    let ids = |text: &str| -> Vec<String> {
        let found =
            text.split(" id=\"").skip(1).map(|rest| rest.split('"').next().expect("an end").to_owned());
        // Gradients have names without a hyphen.
        found.filter(|id| id.contains('-')).collect()
    };
    let front = ids(&written(&scene(TWIG), "front", Format::SVG));
    let mut sorted = front.clone();
    sorted.sort();
    sorted.dedup();
    assert_eq!(sorted.len(), front.len());
    assert_eq!(front.len(), 6);
    // From the side the polygon is seen edge on: only what is visible is drawn.
    let mut side = ids(&written(&scene(TWIG), "side", Format::SVG));
    side.sort();
    let visible: Vec<String> = sorted.into_iter().filter(|id| !id.starts_with("polygon")).collect();
    assert_eq!(side, visible);
}

#[test]
fn all_frames_share_one_picture() {
    let (small, large) = (scene("F(1)"), scene("F(5)[+F(1)]F(2)"));
    let mut survey = Survey::new(View::FRONT);
    survey.add(&small);
    survey.add(&large);
    let writer = FrameWriter::new(Format::SVG, survey.fit());
    let view_box = |scene: &Scene| {
        let text = String::from_utf8(writer.write(scene, "")).expect("UTF-8");
        let rest = text.split("viewBox=\"").nth(1).expect("a view box").to_owned();
        rest.split('"').next().expect("an end").to_owned()
    };
    assert_eq!(view_box(&small), view_box(&large));
    assert_eq!(view_box(&small), writer.fit.picture.view_box().map(|x| x.to_string()).join(" "));
    assert_eq!(survey.fit().default_width, 0.008 * 7.0);
}

/// A mesh as a reader that is not ours understands it.
fn read_obj(text: &str) -> Vec<tobj::Model> {
    let options = tobj::LoadOptions { single_index: false, ..Default::default() };
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| {
        let materials = FrameWriter::new(Format::OBJ, fit(&Scene::default(), "front"));
        let library = materials.companions(&Scene::default()).remove(0);
        tobj::load_mtl_buf(&mut library.bytes.as_slice())
    })
    .expect("an OBJ");
    models
}

/// All triangles, with positions and normals at their corners.
fn triangles(models: &[tobj::Model]) -> Vec<[(Point, Vector); 3]> {
    let mut all = Vec::new();
    for model in models {
        let mesh = &model.mesh;
        let triple = |values: &[f32], i: u32| [0, 1, 2].map(|k| f64::from(values[3 * i as usize + k]));
        let corner = |k: usize| {
            let position = triple(&mesh.positions, mesh.indices[k]);
            let normal = triple(&mesh.normals, mesh.normal_indices[k]);
            (Point::from(position), Vector::from(normal))
        };
        for face in 0..mesh.indices.len() / 3 {
            all.push([3 * face, 3 * face + 1, 3 * face + 2].map(corner));
        }
    }
    all
}

/// Every edge, by the numbers of its vertices, has one triangle on each side.
fn assert_closed(text: &str) {
    let mut edges: HashMap<(&str, &str), i32> = HashMap::new();
    for face in text.lines().filter_map(|line| line.strip_prefix("f ")) {
        let corners: Vec<&str> = face.split(' ').filter_map(|corner| corner.split('/').next()).collect();
        for k in 0..3 {
            *edges.entry((corners[k], corners[(k + 1) % 3])).or_default() += 1;
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!(count, 1, "an edge is passed once in each direction");
        assert_eq!(edges.get(&(b, a)), Some(&1), "an edge has a triangle on both sides");
    }
}

/// Volume inside a closed mesh whose triangles turn counter-clockwise seen from outside.
fn volume(all: &[[(Point, Vector); 3]]) -> f64 {
    all.iter().map(|[a, b, c]| a.0.coords.dot(&b.0.coords.cross(&c.0.coords)) / 6.0).sum()
}

#[test]
fn tubes_are_closed_and_face_outwards() {
    let strings = [
        "!(0.2)F(1)",
        "!(0.2)F(1)F(2)+(30)F(1)&(40)F(1)/(50)F(1)^(80)F(1)",
        "!(0.4)F(1)!(0.2)+(20)F(1)!(0.3)F(1)",
        "!(0.2)F(1)[+(90)F(1)]F(1)",
    ];
    for text in strings {
        let document = written(&scene(text), "front", Format::OBJ);
        assert_closed(&document);
        let all = triangles(&read_obj(&document));
        assert!(volume(&all) > 0.0, "{text}");
        for corners in &all {
            let [a, b, c] = corners.map(|corner| corner.0);
            let facing = (b - a).cross(&(c - a));
            for (_, normal) in corners {
                assert!((normal.norm() - 1.0).abs() < 1e-3);
                assert!(facing.dot(normal) > 0.0, "{text}: normals agree with the winding");
            }
        }
    }
}

#[test]
fn a_straight_tube_is_one_cylinder_however_it_is_divided() {
    let volume_of = |text: &str| volume(&triangles(&read_obj(&written(&scene(text), "front", Format::OBJ))));
    let (whole, parts) = (volume_of("!(0.2)F(3)"), volume_of("!(0.2)F_a(1)F_b(0.5)F_c(1.5)"));
    assert!((whole - parts).abs() < 1e-5);
    // An octagonal prism of radius 0.1, and the domes.
    let prism = 3.0 * 2.0 * 2.0_f64.sqrt() * 0.01;
    assert!((prism..prism * 1.15).contains(&whole), "{whole} {prism}");
}

#[test]
fn a_sharp_turn_or_a_short_piece_begins_a_new_tube() {
    for (text, tubes) in
        [("!(.2)F|F", 2), ("!(.2)F+(120)F", 2), ("!(.2)F+(90)F(.01)", 2), ("!(.2)F+(90)F", 1)]
    {
        let all = triangles(&read_obj(&written(&scene(text), "front", Format::OBJ)));
        // Euler: a closed surface has V - E + F = 2, E = 3F/2.
        let vertices = written(&scene(text), "front", Format::OBJ).matches("\nv ").count();
        assert_eq!(vertices as i64 - all.len() as i64 / 2, 2 * tubes, "{text}");
    }
}

#[test]
fn a_bend_where_the_width_changes_has_no_spike() {
    let text = written(&scene("!(0.4) F(2) +(70) !(0.6) F(2)"), "front", Format::OBJ);
    let (sin, cos) = 70.0_f64.to_radians().sin_cos();
    let corner = Vector::new(0.0, 2.0, 0.0);
    let axes = [(Vector::zeros(), corner), (corner, corner + 2.0 * Vector::new(-sin, cos, 0.0))];
    for (vertex, _) in triangles(&read_obj(&text)).into_iter().flatten() {
        let away = axes.map(|(from, to)| {
            let (along, p) = (to - from, vertex.coords - from);
            (p - along * (p.dot(&along) / along.norm_squared()).clamp(0.0, 1.0)).norm()
        });
        assert!(away[0].min(away[1]) < 0.3 + 1e-6, "{vertex} lies outside");
    }
}

#[test]
fn groups_are_named_after_modules() {
    let text = written(&scene(TWIG), "front", Format::OBJ);
    let names: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("g ")).collect();
    assert_eq!(names.len(), 6);
    for (name, kind) in names.iter().zip(["F_i.", "L.", "F.", "polygon.", "F_i.", "K."]) {
        assert!(name.starts_with(kind), "{name}");
        assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c)), "{name}");
    }
    let models = read_obj(&text);
    assert!(models.iter().all(|model| model.mesh.material_id.is_some()));
}

#[test]
fn an_empty_scene_is_a_valid_frame() {
    let nothing = Scene::default();
    let text = written(&nothing, "front", Format::SVG);
    usvg::Tree::from_str(&text, &usvg::Options::default()).expect("an SVG");
    assert!(triangles(&read_obj(&written(&nothing, "front", Format::OBJ))).is_empty());
    let fit = fit(&nothing, "top");
    assert_eq!((fit.bounds, fit.extent), (None, 0.0));
}

#[test]
fn any_scale_will_do() {
    for length in ["1e-80", "1e-9", "1e9", "1e80"] {
        let scene = scene(&format!("F({length})+(30)F({length})[+@L({length})]"));
        let text = written(&scene, "30,20", Format::SVG);
        let tree = usvg::Tree::from_str(&text, &usvg::Options::default()).expect("an SVG");
        assert!(nodes(tree.root()).len() > 3, "{length}");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{length}");
        assert!(!written(&scene, "30,20", Format::OBJ).contains("NaN"), "{length}");
    }
}

/// Strings of modules with matching brackets and braces.
fn strings() -> impl Strategy<Value = String> {
    let module = prop_oneof![
        (0.0..2.0).prop_map(|l: f64| format!("F({l})")),
        (-1.0..1.0).prop_map(|l: f64| format!("f({l})")),
        ("[-+&^/]", -200.0..200.0).prop_map(|(name, a): (String, f64)| format!("{name}({a})")),
        (0.0..0.6).prop_map(|w: f64| format!("!({w})")),
        Just("|".to_owned()),
        Just("$".to_owned()),
        Just(";".to_owned()),
        Just("F".to_owned()),
        Just("@L(0.3)".to_owned()),
        Just("@K".to_owned()),
    ];
    let flat = prop::collection::vec(module, 1..20).prop_map(|modules| modules.concat());
    flat.prop_recursive(3, 12, 4, |inner| {
        let branch = prop_oneof![
            inner.clone().prop_map(|s| format!("[{s}]")),
            inner.clone().prop_map(|s| format!("{{{s}}}")),
            inner,
        ];
        prop::collection::vec(branch, 1..4).prop_map(|parts| parts.concat())
    })
}

proptest! {
    // Each case traces two pictures.
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn whatever_is_drawn_can_be_read(text in strings(), azimuth in -180.0..180.0, elevation in -90.0..90.0) {
        let mut scene = scene(&text);
        let view = format!("{azimuth},{elevation}");
        let picture = written(&scene, &view, Format::SVG);
        prop_assert!(usvg::Tree::from_str(&picture, &usvg::Options::default()).is_ok());
        prop_assert_eq!(&picture, &written(&scene, &view, Format::SVG));
        scene.polygons.clear();
        scene.surfaces.clear();
        let tubes = written(&scene, &view, Format::OBJ);
        assert_closed(&tubes);
        read_obj(&tubes);
    }
}
