//! Triangles of solids: far sides, and meshes made piece by piece.

use super::*;
use dlsys_geometry::scene::{Owner, Polygon, Segment, Width};
use dlsys_tree::Lineage;

#[test]
fn far_sides_of_what_is_closed_are_left_out() {
    let mut mesh = Triangles::with_capacity(3, 1, 4);
    for [x, y] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]] {
        mesh.vertex(|| Point::new(x, y, 0.0));
    }
    mesh.normal(Vector::z);
    for is_thin in [false, true] {
        mesh.is_thin = is_thin;
        mesh.face([(0, 0), (1, 0), (2, 0)]);
        mesh.face([(0, 0), (2, 0), (1, 0)]);
    }
    let seen = mesh.vertices.clone();
    mesh.without_far_sides(&seen);
    let kept: Vec<(bool, u32)> = mesh.faces.iter().map(|face| (face.is_thin, face.corners[1].0)).collect();
    assert_eq!(kept, [(false, 1), (true, 1), (true, 2)]);
}

#[test]
fn pieces_have_the_triangles_of_the_whole() {
    // A stem that turns and gets thinner in steps, polygons of two colours between its segments, and branches.
    let mut scene = Scene::default();
    let at = |i: usize| Point::new((0.9 * i as f64).sin(), 0.4 * i as f64, (0.5 * i as f64).cos());
    for i in 0..12 {
        let lineage = Lineage::of_axiom(i);
        let owner = scene.add_owner(Owner { name: "F".into(), lineage });
        let mut add = |start: Point, end: Point, follows: Option<usize>, grows_from: Option<usize>| {
            scene.segments.push(Segment {
                start,
                end,
                direction: (end - start).normalize(),
                across: Vector::x(),
                widths: [Width::Set(0.2 - 0.05 * (i / 4) as f64); 2],
                contour: None,
                material: if i % 5 == 0 { MaterialId::LEAF } else { MaterialId::STEM },
                owner,
                follows,
                grows_from,
            });
            scene.segments.len() - 1
        };
        let before = (i > 0).then(|| 2 * (i - 1));
        let stem = add(at(i), at(i + 1), before, None);
        add(at(i + 1), at(i + 1) + Vector::new(0.5, 0.2, 0.1), None, Some(stem));
        let vertices = vec![at(i), at(i + 1), at(i + 2)];
        scene.polygons.push(Polygon { vertices, material: MaterialId::LEAF, owner });
    }
    let mut survey = crate::Survey::new(crate::View::FRONT);
    survey.add(&scene);
    let fit = survey.fit();
    let solid = Solid::new(&scene, &fit, 8);
    let corners = |mesh: &Triangles| -> Vec<_> {
        let corner = |(v, n): (u32, u32)| (mesh.vertices[v as usize], mesh.normals[n as usize]);
        mesh.faces.iter().map(|face| (face.corners.map(corner), face.material, face.owner)).collect()
    };
    let whole = corners(&Triangles::of(&solid, |_| true));
    let items = solid.by_owner();
    for count in [1, 2, 7, items.len()] {
        let pieces: Vec<_> =
            items.chunks(count).flat_map(|piece| corners(&Triangles::of_items(&solid, piece))).collect();
        assert!(pieces == whole, "{count} at a time");
    }
}
