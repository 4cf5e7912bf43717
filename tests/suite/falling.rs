//! What is let go (`@D`): it keeps pose and velocity, falls, is carried by the wind, lands and rests; frames and threads do not matter.

use dlsys::scene::{Point, Scene, Vector};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

fn read(text: &str) -> Session {
    Session::from_text("falling.dls", text, &[]).unwrap_or_else(|refused| panic!("{refused}"))
}

fn string(session: &Session, t: f64) -> ModuleString {
    let mut string = ModuleString::default();
    let mut simulation = session.simulate(Settings::default()).unwrap_or_else(|error| panic!("{error}"));
    simulation.at(t, &mut string).unwrap_or_else(|error| panic!("{error}"));
    string
}

fn draw(nursery: &Nursery<'_>, string: &ModuleString) -> Scene {
    let mut scene = nursery.blank();
    nursery.draw(string, &mut scene).unwrap_or_else(|error| panic!("{}", error.diagnostic().message));
    scene
}

/// The scenes at some times, drawn in this order by one nursery.
fn scenes(session: &Session, times: &[f64]) -> Vec<Scene> {
    let nursery = Nursery::new(&session.model, Settings::default());
    times.iter().map(|t| draw(&nursery, &string(session, *t))).collect()
}

/// The only surface of a scene: its place and its axes.
fn surface(scene: &Scene) -> (Point, [Vector; 3]) {
    assert_eq!(scene.surfaces.len(), 1);
    let place = &scene.surfaces[0].placement;
    (place.origin, place.axes)
}

/// A ball that is let go at t = 1, on a turtle that has moved it sideways at 3 units of length in a unit of time.
const THROWN: &str = "units length 0.1, time 0.5\n\
    initial string: -(90) A(0)\n\
    A(x): solve dx/dt = 3 if age = 1 produce B(x)\n\
    interpret A(x): f(x) @O(0.2)\n\
    B(x): solve dx/dt = 3\n\
    interpret B(x): f(x) @D @O(0.2)\n";

/// From rest, way and speed at first are those of free fall; the error is the drag, of the order of the way. A ball of water in air falls
/// at g (1 - ρ_a/ρ)/(1 + ρ_a/2ρ), with the air in its place and the air that it pushes.
#[test]
fn what_is_let_go_falls_with_half_g_t_squared_and_keeps_its_velocity() {
    let session = read(THROWN);
    for after in [0.02, 0.05, 0.1] {
        let (at, _) = surface(&scenes(&session, &[1.0 + after])[0]);
        let seconds = after * 0.5;
        let g = 9.81 * (1.0 - 1.2e-3) / (1.0 + 0.6e-3);
        let drop = 0.5 * g * seconds * seconds / 0.1;
        assert!((-at.y / drop - 1.0).abs() < 2e-3, "{at:?} {drop}");
        // Drag of a ball of 4.19 g and 1 cm at 0.6 m/s.
        let slowed = 0.5 * 1.2 * 0.47 * 3.1416e-4 * 0.36 / 4.19e-3;
        let way = 3.0 * after - 0.5 * slowed * seconds * seconds / 0.1;
        assert!((at.x - 3.0 - way).abs() < 1e-4 * after, "{at:?} {way}");
    }
}

#[test]
fn what_is_let_go_jumps_neither_in_place_nor_in_velocity() {
    let text = "units length 0.1, time 1\nwind 1, 0, 0.3 speed 3 turbulence 0.4 scale 2\n\
        tissue stalk = stiffness 2e8, density 900, damping 0.05\n\
        initial string: @E(stalk) !(0.06) F(2) F(2) [ P ]\nP: if age = 1.37 produce @D Q\n\
        interpret P: +(40) STALK @P(1)\ninterpret Q: +(40) STALK @P(1)\n";
    // Without a stalk, with one that is rigid, and with one that bends, takes its bend along, and gives the mean of its motion. The velocity is
    // a difference over a part of a tick, with an error of the same order.
    for (stalk, error) in [("", 2e-3), ("@E(0) F(0.4)", 2e-3), ("!(0.02) F(0.4)", 0.1)] {
        held_and_free(&read(&text.replace("STALK", stalk)), error);
    }
}

fn held_and_free(session: &Session, error: f64) {
    const H: f64 = 1e-5;
    let times: Vec<f64> = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0].map(|k| 1.37 + k * H).to_vec();
    let seen: Vec<Vector> = scenes(session, &times).iter().map(|scene| surface(scene).0.coords).collect();
    let limit = |[near, next, far]: [usize; 3]| (seen[near] - seen[next]) * 3.0 + seen[far];
    let slope =
        |[near, next, far]: [usize; 3]| (seen[near] * 5.0 - seen[next] * 8.0 + seen[far] * 3.0) / (2.0 * H);
    let speed = slope([2, 1, 0]).norm();
    assert!(speed > 0.3, "the stalk swings: {speed}");
    assert!((limit([3, 4, 5]) - limit([2, 1, 0])).norm() < 1e-8);
    let jump = (slope([3, 4, 5]) + slope([2, 1, 0])).norm();
    assert!(jump < error * speed, "{jump} of {speed}");
}

#[test]
fn petals_land_flat_and_rest() {
    let text = "ground -0.5\nwind 1, 0, 0 speed 1 turbulence 0.3 scale 1\ninitial string: f(0.5) @D +(30) &(20) @P(0.05, 0.06)\n";
    let session = read(text);
    let scenes = scenes(&session, &[0.0, 6.0, 30.0]);
    let (begin, _) = surface(&scenes[0]);
    assert!((begin - Point::new(0.0, 0.5, 0.0)).norm() < 1e-12);
    let bottom = |scene: &Scene| {
        let surface = &scene.surfaces[0];
        surface.mesh.vertices.iter().map(|p| surface.placement.point(*p).y).fold(f64::INFINITY, f64::min)
    };
    for scene in &scenes[1..] {
        assert!((bottom(scene) + 0.5).abs() < 2e-4, "it lies on the ground: {}", bottom(scene));
    }
    assert_eq!(surface(&scenes[1]), surface(&scenes[2]), "it lies still");
    assert!(surface(&scenes[2]).0.x > 0.3, "the wind has carried it");
}

/// Petals that come off at random in the wind, and one that comes off another.
const SHOWER: &str = "units length 0.1, time 1\nground 0\nwind 1, 0, 0.3 speed 2 turbulence 0.4 scale 1\n\
    tissue stalk = stiffness 2e8, density 900, damping 0.05\n\
    initial string: @E(stalk) F(3) F(2) for k in 0 .. 5: ( [ P(k) ] )\n\
    P(k): at rate 1.5 produce @D Q(k)\n\
    Q(k): if age = 0.31 & k < 3 produce R(k) [ @D @P(0.2) ]\n\
    interpret F(x): !(0.06) F(x)\ninterpret P(k): /(60*k) &(50) @P(1)\ninterpret Q(k): /(60*k) &(50) @P(1)\n\
    interpret R(k): /(60*k) &(50) @P(1)\n";

fn places(scene: &Scene) -> Vec<(u64, Point, [Vector; 3])> {
    let owned =
        |s: &dlsys::scene::Surface| (scene.owner(s.owner).lineage.id, s.placement.origin, s.placement.axes);
    scene.surfaces.iter().map(owned).collect()
}

#[test]
fn the_order_of_frames_does_not_matter() {
    let session = read(SHOWER);
    let times: Vec<f64> = (0..60).map(|i| f64::from(i) * 0.0631).collect();
    let straight = scenes(&session, &times);
    assert!(straight.iter().any(|scene| scene.surfaces.len() > 6), "some petals have lost a part");
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by_key(|i| i * 23 % 61);
    let mixed = scenes(&session, &order.iter().map(|i| times[*i]).collect::<Vec<_>>());
    for (scene, &i) in mixed.iter().zip(&order) {
        assert_eq!(places(scene), places(&straight[i]), "{}", times[i]);
    }
    for i in [7, 33, 59] {
        assert_eq!(places(&scenes(&session, &times[i..=i])[0]), places(&straight[i]), "{}", times[i]);
    }
}

#[test]
fn threads_do_not_matter() {
    let session = read(SHOWER);
    let times: Vec<f64> = (0..48).map(|i| f64::from(i) * 0.079).collect();
    let alone = scenes(&session, &times);
    let nursery = Nursery::new(&session.model, Settings::default());
    let strings: Vec<ModuleString> = times.iter().map(|t| string(&session, *t)).collect();
    let together: Vec<Vec<(usize, Scene)>> = std::thread::scope(|scope| {
        let part = |first: usize| {
            let (nursery, strings) = (&nursery, &strings);
            scope.spawn(move || {
                (first..strings.len()).step_by(4).map(|i| (i, draw(nursery, &strings[i]))).collect::<Vec<_>>()
            })
        };
        let threads: Vec<_> = (0..4).map(part).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    for (i, scene) in together.iter().flatten() {
        assert_eq!(places(scene), places(&alone[*i]), "{}", times[*i]);
    }
}

/// The petals of a plant in another model fall in the scene, whichever way the plant is turned, onto the ground of the scene.
#[test]
fn plants_let_go_in_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let flower = "initial string: f(0.5) [ P ]\nP: if age = 1 produce @D Q\ninterpret P: @P(0.1)\ninterpret Q: @P(0.1)\n";
    let scene = "plant @Flower from \"flower.dls\"\nground -0.3\ninitial string: f(0.4) +(90) @Flower(-5)\n";
    for (name, text) in [("flower.dls", flower), ("scene.dls", scene)] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let session =
        Session::open(&folder.path().join("scene.dls"), &[]).unwrap_or_else(|refused| panic!("{refused}"));
    let scene = scenes(&session, &[3.0]).remove(0);
    let flat = scene.flattened();
    let surface = &flat.surfaces[0];
    let bottom =
        surface.mesh.vertices.iter().map(|p| surface.placement.point(*p).y).fold(f64::INFINITY, f64::min);
    assert!((bottom + 0.3).abs() < 3e-4, "{bottom}");
}

/// A twig keeps the bend with which it was let go.
#[test]
fn bent_stems_keep_their_bend() {
    let text = |freed: &str| {
        format!(
            "units length 0.1, time 1\nwind 1, 0, 0 speed 6\ntissue twig = stiffness 2e7, density 500, damping 0.3\n\
            initial string: @E(twig) !(0.05) [ A F(2) F(2) ]\nA: if age = 2 produce {freed}\ninterpret A: ε\n"
        )
    };
    let bend = |text: &str, t: f64| {
        let session = read(text);
        let scene = scenes(&session, &[t]).remove(0);
        let (first, last) = (&scene.segments[0], &scene.segments[scene.segments.len() - 1]);
        first.direction.dot(&last.direction)
    };
    let held = bend(&text("B"), 2.0 - 1e-6);
    assert!(held < 0.98, "the wind bends it: {held}");
    for t in [2.0, 2.5] {
        // The drawing cuts a stem into straight pieces as its curvature needs.
        assert!((bend(&text("@D"), t) - held).abs() < 1e-3, "{t}: {} {held}", bend(&text("@D"), t));
    }
}

#[test]
fn mistakes_have_their_place() {
    let message = |text: &str| {
        let session = read(text);
        let nursery = Nursery::new(&session.model, Settings::default());
        let error = nursery.draw(&string(&session, 1.0), &mut nursery.blank()).expect_err("it cannot fall");
        let diagnostic = error.diagnostic();
        assert!(!diagnostic.help.is_empty() && !diagnostic.labels.is_empty(), "{diagnostic:?}");
        diagnostic.message
    };
    let stem = message("initial string: @D F(1)\n");
    assert!(stem.contains("a stem that is let go, and its width is not set"), "{stem}");
    let far = message("units length 1, time 1e9\ninitial string: @D @P(1)\n");
    assert!(far.contains("more than 1e7 steps"), "{far}");
}

/// What an `@D` holds is known at the birth of its module; a drawing that begins to hold one later says so.
#[test]
fn a_drawing_that_lets_go_too_late_is_told() {
    let session = read("initial string: A\ninterpret A: if age > 0.5: ( @D ) @P(1)\n");
    let nursery = Nursery::new(&session.model, Settings::default());
    let scene = draw(&nursery, &string(&session, 1.0));
    assert_eq!(surface(&scene).0, Point::origin());
    assert!(scene.warnings[0].message.contains("lets nothing go"), "{:?}", scene.warnings);
}
