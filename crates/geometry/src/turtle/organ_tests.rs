//! Patches, tropism, tapering stems, polygons with branches: on strings written by hand.

use std::sync::Arc;

use super::*;
use crate::scene::{Point, Scene, Vector, Width};
use dlsys_model::{Appearance, Tropism};
use dlsys_tree::Lineage;

fn string(model: &mut Model, modules: &[(&str, &[f64])]) -> ModuleString {
    let mut string = ModuleString::default();
    for (place, (name, parameters)) in modules.iter().enumerate() {
        let kind = model.kinds.intern(name, parameters.len());
        string.push(kind, parameters.iter().copied(), 0.0, Lineage::of_axiom(place));
    }
    string
}

fn drawn_by(mut model: Model, modules: &[(&str, &[f64])]) -> Result<(Scene, Pose), Error> {
    let string = string(&mut model, modules);
    let mut scene = Scene::default();
    let pose = trace(&model, &string, &mut scene)?;
    Ok((scene, pose))
}

fn drawn(modules: &[(&str, &[f64])]) -> Scene {
    drawn_by(Model::default(), modules).expect("drawable").0
}

fn bending(direction: [f64; 3], strength: f64) -> Model {
    let tropism = Some(Tropism { direction, strength });
    Model { appearance: Arc::new(Appearance { tropism, ..Appearance::default() }), ..Model::default() }
}

#[test]
fn cutting_a_bent_segment_changes_nothing() {
    let whole: [(&str, &[f64]); 3] = [("&", &[70.0]), ("/", &[20.0]), ("F", &[3.0])];
    let parts: [(&str, &[f64]); 6] =
        [("&", &[70.0]), ("/", &[20.0]), ("F", &[0.1]), ("F", &[1.7]), ("F", &[0.0]), ("F", &[1.2])];
    let down = [0.6, -0.8, 0.0];
    for strength in [0.3, -0.5, 2.0] {
        let one = drawn_by(bending(down, strength), &whole).expect("drawable").1;
        let two = drawn_by(bending(down, strength), &parts).expect("drawable").1;
        assert!((one.position - two.position).norm() < 1e-12, "{strength}");
        for (a, b) in one.axes.iter().zip(two.axes) {
            assert!((a - b).norm() < 1e-12, "{strength}");
        }
    }
    // And the way back leads back.
    let there_and_back: [(&str, &[f64]); 3] = [("&", &[70.0]), ("F", &[3.0]), ("F", &[-3.0])];
    let pose = drawn_by(bending(down, 0.3), &there_and_back).expect("drawable").1;
    assert!(pose.position.coords.norm() < 1e-12);
}

#[test]
fn a_long_bent_way_comes_to_its_direction() {
    let direction = Vector::new(0.0, -0.8, 0.6);
    let (scene, pose) =
        drawn_by(bending(direction.into(), 1.0), &[("+", &[30.0]), ("F", &[40.0])]).expect("drawable");
    assert!((pose.axes[0] - direction).norm() < 1e-12);
    let [h, l, u] = pose.axes;
    assert!((h.cross(&l) - u).norm() < 1e-12, "the frame is right-handed");
    assert!(scene.segments.len() > 100, "drawn in pieces");
    let joined = scene.segments.windows(2).all(|pair| pair[0].end == pair[1].start);
    assert!(joined && scene.segments.windows(2).all(|pair| pair[0].direction.dot(&pair[1].direction) > 0.99));
}

#[test]
fn without_strength_nothing_bends() {
    let modules: [(&str, &[f64]); 4] = [("+", &[30.0]), ("F", &[2.0]), ("&", &[10.0]), ("F", &[1.0])];
    let straight = drawn(&modules);
    let (declared, _) = drawn_by(bending([0.0, -1.0, 0.0], 0.0), &modules).expect("drawable");
    for (a, b) in straight.segments.iter().zip(&declared.segments) {
        assert_eq!((a.start, a.end, a.direction), (b.start, b.end, b.direction));
    }
    // The strength can be set along the string, and a bracket takes it back.
    let scene =
        drawn(&[("+", &[90.0]), ("[", &[]), ("@T", &[0.01]), ("F", &[1.0]), ("]", &[]), ("F", &[1.0])]);
    assert!(scene.segments[0].end.y < -1e-3, "gravity, unless another direction is declared");
    assert_eq!(scene.segments[1].end, Point::new(-1.0, 0.0, 0.0));
}

/// Sixteen control points over a square, set from branches, but for those left out.
fn net(number: f64, left_out: &[usize]) -> Vec<(&'static str, Vec<f64>)> {
    let mut modules = vec![("@PS", vec![number])];
    for i in (0..16).rev().filter(|i| !left_out.contains(i)) {
        let (row, column) = ((i / 4) as f64, (i % 4) as f64);
        modules.extend([("[", vec![]), ("f", vec![row]), ("-", vec![90.0]), ("f", vec![column])]);
        modules.extend([("@PC", vec![number, row, column]), ("]", vec![])]);
    }
    modules.push(("@PD", vec![number]));
    modules
}

fn of(modules: &[(&'static str, Vec<f64>)]) -> Result<Scene, Error> {
    let borrowed: Vec<(&str, &[f64])> = modules.iter().map(|(name, p)| (*name, &p[..])).collect();
    drawn_by(Model::default(), &borrowed).map(|(scene, _)| scene)
}

#[test]
fn branches_set_the_points_of_a_patch() {
    let scene = of(&net(7.0, &[])).expect("drawable");
    assert_eq!(scene.patches.len(), 1);
    for (row, points) in scene.patches[0].net.iter().enumerate() {
        for (column, point) in points.iter().enumerate() {
            assert!((point - Point::new(column as f64, row as f64, 0.0)).norm() < 1e-12);
        }
    }
    let surface = &scene.tessellated(1e-3).surfaces[0];
    assert!(
        surface.mesh.normals.iter().all(|n| (n - Vector::z()).norm() < 1e-9),
        "its front is the viewer's"
    );
    // Several at once, by number; one whose points all lie in one place is nothing to see.
    let mut two = net(1.0, &[]);
    let last = two.pop().expect("a drawing");
    two.extend(net(2.0, &[]));
    two.push(last);
    assert_eq!(of(&two).expect("drawable").patches.len(), 2);
    let mut point = vec![("@PS", vec![0.0])];
    point.extend((0..16).map(|i| ("@PC", vec![0.0, f64::from(i / 4), f64::from(i % 4)])));
    point.push(("@PD", vec![0.0]));
    assert!(of(&point).expect("drawable").is_empty());
}

#[test]
fn what_is_wrong_with_a_patch_is_said() {
    let error = of(&net(3.0, &[0, 6])).unwrap_err().to_string();
    assert!(error.contains("patch 3") && error.contains("(0, 0) (1, 2)"), "{error}");
    let error = of(&net(3.0, &[])[1..]).unwrap_err().to_string();
    assert!(error.contains("not begun") && error.contains("`@PS(3)`"), "{error}");
    let error = of(&[("@PS", vec![1.0]), ("@PC", vec![1.0, 4.0, 0.0])]).unwrap_err().to_string();
    assert!(error.contains("row 4") && error.contains("0, 1, 2 or 3"), "{error}");
    let error = of(&[("@PS", vec![1.0]), ("@PC", vec![1.0, 0.5, 0.0])]).unwrap_err().to_string();
    assert!(error.contains("row 0.5"), "{error}");
}

#[test]
fn stems_taper_between_widths() {
    let run = |modules: &[(&str, &[f64])]| -> Vec<[f64; 2]> {
        let widths = |w: Width| w.resolve(f64::NAN);
        drawn(modules).segments.iter().map(|s| s.widths.map(widths)).collect()
    };
    let one = run(&[("!", &[0.4]), ("F", &[4.0]), ("@W", &[0.2]), ("F", &[1.0])]);
    assert_eq!(one, [[0.4, 0.2], [0.2, 0.2]]);
    // Cut in two: the same cone.
    let two = run(&[("!", &[0.4]), ("F", &[1.0]), ("F", &[3.0]), ("@W", &[0.2]), ("F", &[1.0])]);
    for (a, b) in two.iter().flatten().zip([0.4, 0.35, 0.35, 0.2, 0.2, 0.2]) {
        assert!((a - b).abs() < 1e-15, "{two:?}");
    }
    // A branch neither tapers its stem nor hides what the stem does.
    let branched = run(&[
        ("!", &[0.4]),
        ("F", &[1.0]),
        ("[", &[]),
        ("@W", &[0.1]),
        ("F", &[1.0]),
        ("@W", &[0.0]),
        ("]", &[]),
        ("F", &[1.0]),
        ("@W", &[0.2]),
    ]);
    for (a, b) in branched.iter().flatten().zip([0.4, 0.3, 0.1, 0.0, 0.3, 0.2]) {
        assert!((a - b).abs() < 1e-15, "{branched:?}");
    }
    assert_eq!(run(&[("!", &[0.4]), ("F", &[1.0]), ("!", &[0.2]), ("F", &[1.0])]), [[0.4, 0.4], [0.2, 0.2]]);
}

/// Warnings of a string drawn with a known accuracy.
fn warnings(modules: &[(&str, &[f64])]) -> Vec<String> {
    let mut model = Model::default();
    let string = string(&mut model, modules);
    let mut scene = Scene::default();
    scene.accuracy = 1e-3;
    draw(&model, &string, &mut scene).expect("drawable");
    scene.warnings.iter().map(|warning| warning.message.clone()).collect()
}

#[test]
fn the_colour_behind_the_last_is_reported() {
    let pair: [(&str, &[f64]); 2] = [(";", &[]), ("F", &[1.0])];
    let steps = |count: usize| warnings(&vec![pair; count].concat());
    assert_eq!(steps(12), [""; 0], "there are twelve without a declaration");
    assert_eq!(steps(13), ["there is no next colour"]);
}

#[test]
fn a_step_of_the_width_is_reported_where_nothing_hides_it() {
    let step: [(&str, &[f64]); 4] = [("!", &[0.4]), ("F", &[1.0]), ("!", &[0.2]), ("F", &[1.0])];
    assert_eq!(warnings(&step), ["the width of a stem changes at once"]);
    // A branch does not hide so large a step, of whatever it is.
    for drawn in ["F", "@L"] {
        let behind: [(&str, &[f64]); 7] = [
            ("!", &[0.4]),
            ("F", &[1.0]),
            ("[", &[]),
            (drawn, &[]),
            ("]", &[]),
            ("!", &[0.28]),
            ("F", &[1.0]),
        ];
        assert_eq!(warnings(&behind), ["the width of a stem changes at once"], "{drawn}");
    }
    let silent: [&[(&str, &[f64])]; 7] = [
        // Too little, or too small to be seen.
        &[("!", &[0.4]), ("F", &[1.0]), ("!", &[0.36]), ("F", &[1.0])],
        &[("!", &[0.004]), ("F", &[1.0]), ("!", &[0.002]), ("F", &[1.0])],
        // It tapers; a branch or an organ stands there; it is another organ; it begins anew.
        &[("!", &[0.4]), ("F", &[1.0]), ("@W", &[0.2]), ("F", &[1.0])],
        &[("!", &[0.4]), ("F", &[1.0]), ("[", &[]), ("@L", &[]), ("]", &[]), ("!", &[0.32]), ("F", &[1.0])],
        &[("!", &[0.4]), ("F", &[1.0]), ("@O", &[0.5]), ("!", &[0.2]), ("F", &[1.0])],
        &[("!", &[0.4]), ("F", &[1.0]), (";", &[3.0]), ("!", &[0.2]), ("F", &[1.0])],
        &[("!", &[0.4]), ("F", &[1.0]), ("f", &[1.0]), ("!", &[0.2]), ("F", &[1.0])],
    ];
    for modules in silent {
        assert!(warnings(modules).is_empty(), "{modules:?}");
    }
}

#[test]
fn surfaces_are_scaled_by_width_length_and_height() {
    let scales = |sizes: &[f64]| drawn(&[("@L", sizes)]).surfaces.first().map(|s| s.placement.scales);
    // In the order of the axes: heading, left, up.
    assert_eq!(scales(&[]), Some([1.0; 3]));
    assert_eq!(scales(&[2.0]), Some([2.0; 3]));
    assert_eq!(scales(&[2.0, 3.0]), Some([3.0, 2.0, 3.0]));
    assert_eq!(scales(&[2.0, 3.0, 0.5]), Some([3.0, 2.0, 0.5]));
    assert_eq!(scales(&[2.0, 3.0, 0.0]), None);
    let ball = drawn(&[("F", &[3.0]), ("@O", &[2.0, 4.0, 6.0])]);
    let mut box_: [f64; 3] = [0.0; 3];
    for vertex in &ball.surfaces[0].mesh.vertices {
        let apart = ball.surfaces[0].placement.point(*vertex) - Point::new(0.0, 3.0, 0.0);
        (0..3).for_each(|i| box_[i] = box_[i].max(apart[i].abs()));
    }
    // The turtle heads up; left is -x.
    for (found, expected) in box_.iter().zip([1.0, 2.0, 3.0]) {
        assert!((found - expected).abs() < 0.03 * expected, "{box_:?}");
    }
}

#[test]
fn a_branch_knows_the_stem_that_it_grows_from() {
    let scene = drawn(&[
        ("F", &[1.0]),
        ("[", &[]),
        ("[", &[]),
        ("+", &[40.0]),
        ("F", &[0.0]),
        ("F", &[1.0]),
        ("F", &[1.0]),
        ("]", &[]),
        ("f", &[1.0]),
        ("F", &[1.0]),
        ("]", &[]),
        ("F", &[1.0]),
    ]);
    let from: Vec<_> = scene.segments.iter().map(|s| (s.grows_from, s.follows)).collect();
    // The stem, the branch and its second segment, one that begins elsewhere, and the stem again.
    assert_eq!(from, [(None, None), (Some(0), None), (None, Some(1)), (None, None), (None, Some(0))]);
}

#[test]
fn a_polygon_may_be_made_in_branches() {
    // A rectangle whose corners are set from its middle line: `g` makes no vertex.
    let corner = |turn: f64| -> Vec<(&'static str, Vec<f64>)> {
        vec![("[", vec![]), ("+", vec![turn]), ("g", vec![0.5]), (".", vec![]), ("]", vec![])]
    };
    let mut modules = vec![("{", vec![])];
    modules.extend(corner(90.0));
    modules.extend(corner(-90.0));
    modules.push(("g", vec![2.0]));
    modules.extend(corner(-90.0));
    modules.extend(corner(90.0));
    modules.push(("}", vec![]));
    let scene = of(&modules).expect("drawable");
    let expected = [[-0.5, 0.0], [0.5, 0.0], [0.5, 2.0], [-0.5, 2.0]].map(|[x, y]| Point::new(x, y, 0.0));
    let close = scene.polygons[0].vertices.iter().zip(expected).all(|(a, b)| (a - b).norm() < 1e-12);
    assert!(close && scene.polygons[0].vertices.len() == 4, "{:?}", scene.polygons[0]);
}
