//! Meadows: plants of one simulation share drawings where the picture cannot show the difference, on any number of threads.

use std::collections::HashSet;
use std::sync::Arc;

use dlsys::scene::{Plant, Point, Scene};
use dlsys::session::{Detail, Nursery, Session};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

const STEM: &str = "initial string: S(0.1) A(0)\nS(x): solve dx/dt = 0.2\n\
    A(n): if age = 1 produce S(0.01) A(n + 1)\ninterpret S(x): !(0.05) F(x)\n";
/// 600 stems of ages from 1 to 7 in a row that leads away from the camera, and behind it.
const ROW: &str = "plant @Stem from \"stem.dls\"\ncamera at 0, 2, 30 towards 0, 1, 0 angle 30\n\
    initial string: for n in 1 .. 600: ( [ /(90) -(90) f(n - 100) +(90) @Stem(-1 - uniform(0, 6)) ] )\n";
const DETAIL: Detail = Detail { pixels: 200.0, shape: 1.5, viewpoint: None, bound: 0.5 };

fn drawn(detail: Option<Detail>, threads: usize) -> Scene {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in [("stem.dls", STEM), ("row.dls", ROW)] {
        std::fs::write(folder.path().join(name), text).expect("a model");
    }
    let session =
        Session::open(&folder.path().join("row.dls"), &[]).unwrap_or_else(|refused| panic!("{refused}"));
    let nursery = Nursery::new(&session.model, Settings::default()).for_picture(detail).with_threads(threads);
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).expect("it starts").at(0.0, &mut string).expect("it grows");
    let mut scene = nursery.blank();
    scene.accuracy = 1e-4;
    nursery.draw(&string, &mut scene).unwrap_or_else(|error| panic!("{error}"));
    scene
}

fn looks(scene: &Scene) -> usize {
    scene.plants.iter().map(|plant| Arc::as_ptr(&plant.scene)).collect::<HashSet<_>>().len()
}

/// The tip of a stem in the scene.
fn tip(plant: &Plant) -> Point {
    plant.placement.point(plant.scene.segments.last().expect("a stem").end)
}

#[test]
fn plants_share_drawings_within_the_bound_and_never_without_a_picture() {
    let (each, shared) = (drawn(None, 1), drawn(Some(DETAIL), 1));
    assert_eq!((each.plants.len(), looks(&each)), (600, 600), "every age is another one");
    assert!(looks(&shared) < 300, "{}", looks(&shared));
    let eye = Point::new(0.0, 2.0, 30.0);
    let mut moved = 0;
    for (own, taken) in each.plants.iter().zip(&shared.plants) {
        assert_eq!(own.placement, taken.placement);
        let (a, b) = (tip(own), tip(taken));
        let away = (a - b).norm();
        moved += usize::from(away > 0.0);
        let depth = (eye.z - a.z).abs().max(1.0);
        let pixels = away * DETAIL.pixels * 0.5 / (15_f64.to_radians().tan() * depth);
        // Behind the camera only shadows are seen.
        let bound = if a.z > eye.z - 10.0 { 8.0 * DETAIL.bound } else { DETAIL.bound };
        assert!(pixels <= bound, "{pixels} pixels at {a}");
    }
    assert!(moved > 100, "{moved}");
}

#[test]
fn shared_drawings_are_the_same_on_any_number_of_threads() {
    let shown = |scene: &Scene| {
        let tips = scene.plants.iter().map(|plant| (tip(plant), plant.scene.segments.len()));
        (looks(scene), format!("{:?}", tips.collect::<Vec<_>>()))
    };
    let alone = shown(&drawn(Some(DETAIL), 1));
    assert_eq!(alone, shown(&drawn(Some(DETAIL), 2)));
    assert_eq!(alone, shown(&drawn(Some(DETAIL), 7)));
}
