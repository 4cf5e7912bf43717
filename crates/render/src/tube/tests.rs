//! Joints of tubes, on scenes made by hand.

use std::collections::HashMap;

use crate::triangles::{Solid, Triangles};
use crate::{Survey, View};
use dlsys_geometry::scene::{MaterialId, Owner, Point, Scene, Segment, Vector, Width};
use dlsys_tree::Lineage;

/// A stem of segments with directions and lengths, each with a width, each cut into so many equal segments.
/// Returns the last segment.
fn stem(
    scene: &mut Scene,
    from: (Point, Option<usize>),
    way: &[(Vector, f64)],
    pieces: usize,
) -> (Point, Option<usize>) {
    let owner = scene.add_owner(Owner { name: "F".into(), lineage: Lineage::of_axiom(0) });
    let (mut start, mut follows) = (from.0, None);
    for (direction, width) in way {
        for _ in 0..pieces {
            let end = start + direction / pieces as f64;
            scene.segments.push(Segment {
                start,
                end,
                direction: direction.normalize(),
                across: Vector::x(),
                widths: [Width::Set(*width); 2],
                contour: None,
                material: MaterialId::STEM,
                owner,
                follows,
                grows_from: from.1.filter(|_| follows.is_none()),
            });
            follows = Some(scene.segments.len() - 1);
            start = end;
        }
    }
    (start, follows)
}

/// A trunk that steps and bends, a branch, and a twig on that.
fn tree(pieces: usize) -> Scene {
    let mut scene = Scene::default();
    let foot = Point::origin();
    let trunk = stem(&mut scene, (foot, None), &[(Vector::y() * 3.0, 1.0)], pieces);
    let last = scene.segments.len();
    stem(&mut scene, trunk, &[(Vector::new(0.4, 2.0, 0.3), 0.8), (Vector::new(0.4, 2.0, 0.3), 0.3)], pieces);
    // The trunk goes on from where the branch leaves it.
    (scene.segments[last].follows, scene.segments[last].grows_from) = (trunk.1, None);
    let branch = stem(&mut scene, trunk, &[(Vector::new(-1.5, 1.5, 0.4), 0.6)], pieces);
    stem(&mut scene, branch, &[(Vector::new(-1.0, -0.2, 0.6), 0.35)], pieces);
    scene
}

fn mesh(scene: &Scene, accuracy: f64) -> Triangles {
    mesh_with(scene, accuracy, 0)
}

/// With so many sides, or as many as the accuracy takes.
fn mesh_with(scene: &Scene, accuracy: f64, sides: usize) -> Triangles {
    let mut survey = Survey::new(View::FRONT);
    survey.add(scene);
    Triangles::of(&Solid::new(scene, &survey.fit().with_accuracy(accuracy), sides), |_| true)
}

/// Volume, and whether every edge is passed once in each direction.
fn solid(mesh: &Triangles) -> (f64, bool) {
    let mut edges = HashMap::new();
    let mut volume = 0.0;
    for face in &mesh.faces {
        let corners = face.corners.map(|(vertex, _)| vertex);
        let [p, q, r] = corners.map(|i| mesh.vertices[i as usize].coords);
        volume += p.dot(&q.cross(&r)) / 6.0;
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            *edges.entry((a, b)).or_insert(0) += 1;
            *edges.entry((b, a)).or_insert(0) -= 1;
        }
    }
    (volume, edges.values().all(|count| *count == 0))
}

#[test]
fn tubes_with_joints_are_closed() {
    for accuracy in [0.05, 0.005, 0.0005] {
        let (volume, closed) = solid(&mesh(&tree(1), accuracy));
        assert!(closed && volume > 0.0, "{accuracy}");
    }
}

/// Cutting segments changes nothing: the corners are the same, but for rings at the cuts, which lie on the surface.
#[test]
fn a_division_of_stems_with_joints_cannot_be_seen() {
    let whole = mesh(&tree(1), 1e-3);
    for pieces in [2, 3, 7] {
        let cut = mesh(&tree(pieces), 1e-3);
        for vertex in &whole.vertices {
            let near = cut.vertices.iter().map(|p| (p - vertex).norm()).fold(f64::INFINITY, f64::min);
            assert!(near < 1e-9, "{pieces}: {vertex} is {near} away");
        }
        let (a, b) = (solid(&whole).0, solid(&cut).0);
        assert!((a - b).abs() < 2e-3 * a, "{pieces}: volumes {a} and {b}");
    }
}

#[test]
fn normals_agree_with_the_faces() {
    let mesh = mesh(&tree(1), 1e-3);
    let (mut wrong, mut all) = (0.0, 0.0);
    for face in &mesh.faces {
        let [p, q, r] = face.corners.map(|(vertex, _)| mesh.vertices[vertex as usize]);
        let area = (q - p).cross(&(r - p));
        all += area.norm();
        for (_, normal) in face.corners {
            let normal = mesh.normals[normal as usize];
            assert!((normal.norm() - 1.0).abs() < 1e-9);
            if area.dot(&normal) < 0.0 {
                wrong += area.norm() / 3.0;
            }
        }
    }
    // Inside a parent, cross-sections may lie over one another.
    assert!(wrong < 0.01 * all, "{wrong} of {all}");
}

/// Nothing of a branch comes out on the other side of its parent, whatever its angle and its width.
#[test]
fn a_collar_stays_on_its_side() {
    for angle in [0.2_f64, 0.4, 0.8, 1.2, 1.57, 2.0, 2.7] {
        for width in [0.2, 0.6, 1.0] {
            let mut scene = Scene::default();
            let trunk = stem(&mut scene, (Point::origin(), None), &[(Vector::y() * 4.0, 1.0)], 1);
            let (first, direction) = (scene.segments.len(), Vector::new(angle.sin(), angle.cos(), 0.1));
            stem(&mut scene, trunk, &[(Vector::y() * 4.0, 1.0)], 1);
            (scene.segments[first].follows, scene.segments[first].grows_from) = (trunk.1, None);
            let branch = stem(&mut scene, trunk, &[(direction * 5.0, width)], 1).1.expect("a segment");
            let mesh = mesh(&scene, 1e-3);
            let owner = scene.segments[branch].owner;
            for face in mesh.faces.iter().filter(|face| face.owner == owner) {
                for (vertex, _) in face.corners {
                    let at = mesh.vertices[vertex as usize];
                    // Beside the branch, surfaces run alongside.
                    let beyond = at.x < -0.25;
                    assert!(!beyond || at.x.hypot(at.z) < 0.505, "{angle} {width}: {at}");
                }
            }
        }
    }
}

/// A foot on a declared floor widens towards it; without a floor it is cut flat.
#[test]
fn feet_are_flat_and_flare_on_a_floor() {
    let foot = |floor: Option<f64>| {
        let mut scene = tree(1);
        scene.surroundings.floor = floor;
        let mesh = mesh(&scene, 1e-3);
        let low = mesh.vertices.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let wide = mesh.vertices.iter().filter(|p| p.y < 1e-3).map(|p| p.x.hypot(p.z)).fold(0.0, f64::max);
        (low, wide)
    };
    let (low, wide) = foot(None);
    assert!(low.abs() < 1e-12 && (wide - 0.5).abs() < 1e-12, "{low} {wide}");
    let (low, wide) = foot(Some(0.0));
    assert!(low.abs() < 1e-9 && (0.55..0.6).contains(&wide), "{low} {wide}");
}

/// A trunk, cut into pieces, with a branch and the axis that goes on; all of them with these widths. It has depth: flat drawings are not grown.
fn fork(pieces: usize, [trunk, branch, axis]: [f64; 3]) -> Scene {
    let mut scene = Scene::default();
    let below = stem(&mut scene, (Point::origin(), None), &[(Vector::y() * 3.0, trunk)], pieces);
    stem(&mut scene, below, &[(Vector::new(1.5, 1.3, 0.5), branch)], pieces);
    let first = scene.segments.len();
    stem(&mut scene, below, &[(Vector::y() * 2.0, axis)], pieces);
    (scene.segments[first].follows, scene.segments[first].grows_from) = (below.1, None);
    scene
}

/// Where a branch is wider than what goes on along the axis, the trunk bends smoothly into the branch: nothing of the branch stands out on
/// the other side of the trunk, and the meshes are closed and the same however stems are divided.
#[test]
fn a_branch_that_takes_over_is_the_smooth_continuation() {
    for [trunk, branch, axis] in [[1.0, 0.9, 0.2], [0.7, 0.7, 0.4], [0.6, 0.7, 0.6]] {
        let mut scene = fork(1, [trunk, branch, axis]);
        // A trunk that tapers to the width of the axis.
        scene.segments[0].widths = [Width::Set(trunk.max(0.8)), Width::Set(trunk)];
        let whole = mesh(&scene, 1e-3);
        let (volume, closed) = solid(&whole);
        assert!(closed && volume > 0.0, "{branch} {axis}");
        let owner = scene.segments[1].owner;
        for face in whole.faces.iter().filter(|face| face.owner == owner) {
            for at in face.corners.map(|(vertex, _)| whole.vertices[vertex as usize]) {
                assert!(at.x > -0.6 * trunk && at.y > 3.0 - 0.35 * branch, "{branch} {axis}: {at}");
            }
        }
    }
    let [one, three] = [1, 3].map(|pieces| solid(&mesh(&fork(pieces, [0.7, 0.6, 0.3]), 1e-3)).0);
    assert!((one - three).abs() < 2e-3 * one, "{one} {three}");
}

/// What is wider than its stem ever was is an organ: the stem goes on as if it were not there.
#[test]
fn an_organ_does_not_take_over() {
    let count =
        |scene: &Scene, owner| mesh(scene, 1e-3).faces.iter().filter(|face| face.owner == owner).count();
    let with = fork(1, [0.2, 0.9, 0.2]);
    let without = fork(1, [0.2, 0.1, 0.2]);
    let trunk = with.segments[0].owner;
    assert_eq!(count(&with, trunk), count(&without, trunk));
}

/// A trunk that ends in shoots with these widths and lengths, all of them branches, leaning to different sides.
fn shoots(all: &[(f64, f64)]) -> Scene {
    let mut scene = Scene::default();
    let end = stem(&mut scene, (Point::origin(), None), &[(Vector::y() * 3.0, 1.0)], 1);
    for (k, (width, length)) in all.iter().enumerate() {
        let (sin, cos) = (2.0 * std::f64::consts::PI * k as f64 / all.len() as f64 + 0.2).sin_cos();
        let direction = Vector::new(0.6 * cos, 0.8, 0.6 * sin);
        stem(&mut scene, end, &[(direction * *length, *width)], 1);
    }
    scene
}

/// How far away a mesh is along each of some rays towards -x; infinite beside it. Rays are in rows; with `scatter` 1 they are moved about by the distance to the next, so that no
/// edge passes several at once.
fn depths(mesh: &Triangles, scatter: f64) -> Vec<f64> {
    let mut depths = vec![f64::INFINITY; 30 * 40];
    for face in &mesh.faces {
        let [p, q, r] = face.corners.map(|(vertex, _)| mesh.vertices[vertex as usize]);
        let area = (q.y - p.y) * (r.z - p.z) - (q.z - p.z) * (r.y - p.y);
        if area.abs() < 1e-14 {
            continue;
        }
        let rows = [p.y.min(q.y).min(r.y), p.y.max(q.y).max(r.y)].map(|y| (y - 2.0) * 20.0);
        let (low, high) = (rows[0].floor() as usize, rows[1].ceil() as usize + 1);
        let rows = low.saturating_sub(1).min(40) * 30..high.min(40) * 30;
        for i in rows {
            let depth = &mut depths[i];
            let [up, aside] = [0.618_034, 0.754_878].map(|part| scatter * (i as f64 * part).fract());
            let (row, column) = ((i / 30) as f64 + up, (i % 30) as f64 + aside);
            let (y, z) = (2.0 + 2.0 * row / 40.0, -1.0 + 2.0 * column / 30.0);
            let part = |a: &Point, b: &Point| ((a.y - y) * (b.z - z) - (a.z - z) * (b.y - y)) / area;
            let parts = [part(&q, &r), part(&r, &p), part(&p, &q)];
            if parts.iter().all(|part| *part >= -1e-12) {
                *depth = depth.min(-(parts[0] * p.x + parts[1] * q.x + parts[2] * r.x));
            }
        }
    }
    depths
}

/// The mean difference of two shapes as seen from the side, in parts of the trunk's width; where only one is seen, that width.
fn change(a: &[f64], b: &[f64]) -> f64 {
    let seen: Vec<f64> = a
        .iter()
        .zip(b)
        .filter(|(a, b)| a.is_finite() || b.is_finite())
        .map(|(a, b)| if a.is_finite() && b.is_finite() { (a - b).abs().min(1.0) } else { 1.0 })
        .collect();
    seen.iter().sum::<f64>() / seen.len() as f64
}

/// Where a stem ends in branches, they leave it as wide as it is: nothing narrows at the joint, and meshes are closed.
#[test]
fn shoots_leave_their_stem_without_a_neck() {
    for shoots in
        [&[(0.7, 3.0), (0.7, 3.0)][..], &[(0.58, 3.0); 3], &[(0.9, 3.0), (0.53, 3.0)], &[(0.8, 3.0)]]
    {
        let mesh = mesh(&self::shoots(shoots), 1e-3);
        let (volume, closed) = solid(&mesh);
        assert!(closed && volume > 0.0, "{shoots:?}");
        let depths = depths(&mesh, 0.0);
        let width = |y: usize| depths[30 * y..30 * y + 30].iter().filter(|depth| depth.is_finite()).count();
        let trunk = width(0);
        for y in 0..20 {
            assert!(width(y) + 1 >= trunk, "{shoots:?}: {} of {trunk} in row {y}", width(y));
        }
    }
}

/// A fork as it is seen. All stems have as many sides: where the number changes, the shape changes at once, by the accuracy.
fn seen(all: &[(f64, f64)]) -> Vec<f64> {
    depths(&mesh_with(&shoots(all), 1e-3, 30), 1.0)
}

/// The largest change of the shape at once while a number goes from 0 to 1, and where it is: between shapes the distance is halved where the change is largest.
fn jump(shape: impl Fn(f64) -> Vec<f64>) -> (f64, f64) {
    let shape = |part: f64| (part, shape(part));
    let shapes: Vec<_> = (0..=24).map(|k| shape(f64::from(k) / 24.0)).collect();
    let steps = shapes.windows(2).map(|pair| change(&pair[0].1, &pair[1].1));
    let most = steps.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).expect("steps").0;
    let (mut low, mut high) = (shapes[most].clone(), shapes[most + 1].clone());
    for _ in 0..8 {
        let middle = shape(0.5 * (low.0 + high.0));
        match change(&low.1, &middle.1) > change(&middle.1, &high.1) {
            true => high = middle,
            false => low = middle,
        }
    }
    (change(&low.1, &high.1), low.0)
}

/// A shoot that becomes wider beside another one, or is the only one, changes the joint little by little: where it changes most, it changes the less the
/// less the shoot grows.
#[test]
fn a_fork_does_not_jump_while_a_shoot_becomes_wider() {
    let wide = |part: f64| (0.3 + 0.4 * part, 3.0);
    let (jump_beside, at) = jump(|part| seen(&[(0.9, 3.0), wide(part)]));
    assert!(jump_beside < 0.004, "{jump_beside} at {at}");
    let (jump_alone, at) = jump(|part| seen(&[wide(part)]));
    assert!(jump_alone < 0.004, "{jump_alone} at {at}");
}

/// And so does one that becomes longer: alone, beside another one, and where it becomes the longer one.
#[test]
fn a_fork_does_not_jump_while_a_shoot_becomes_longer() {
    for (others, width) in [(None, 0.8), (Some((0.9, 3.0)), 0.7), (Some((0.6, 0.7)), 0.8)] {
        let grown = |part: f64| -> Vec<(f64, f64)> {
            others.into_iter().chain([(width, 0.3 + 1.2 * part)]).collect()
        };
        let (jump, at) = jump(|part| seen(&grown(part)));
        assert!(jump < 0.004, "{others:?}: {jump} at {at}");
    }
}
