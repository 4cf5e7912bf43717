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
    // Soil is a ground, too: level, and with a slope that begins elsewhere.
    let soil = "soil dry = sand\nground dry cell 0.02 depth 1 height -0.3 + max(0, 0.2*(x - 1)) extent 2";
    let on_soil = scene.replace("ground -0.3", soil);
    for (name, text) in [("flower.dls", flower), ("scene.dls", scene), ("soil.dls", &on_soil)] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    for name in ["scene.dls", "soil.dls"] {
        let session =
            Session::open(&folder.path().join(name), &[]).unwrap_or_else(|refused| panic!("{refused}"));
        let scene = scenes(&session, &[3.0]).remove(0);
        let flat = scene.flattened();
        let surface = &flat.surfaces[0];
        let bottom =
            surface.mesh.vertices.iter().map(|p| surface.placement.point(*p).y).fold(f64::INFINITY, f64::min);
        assert!((bottom + 0.3).abs() < 3e-4, "{name}: {bottom}");
    }
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

/// The lowest point of the only surface.
fn bottom(scene: &Scene) -> f64 {
    let surface = &scene.surfaces[0];
    surface.mesh.vertices.iter().map(|p| surface.placement.point(*p).y).fold(f64::INFINITY, f64::min)
}

/// A board of 2 m, its upper side at a height of 1.05 m, that begins to tip over at t = 3.
const BOARD: &str = "solid Board\nground 0\ncurve tip = (0, 0) (3, 0) (3.5, 80) (9, 80)\n\
    initial string: Board [ f(1.5) -(90) f(0.3) +(90) P ]\nP: if age = 0.2 produce @D Q\n\
    interpret P: &(80) @P(0.1, 0.08)\ninterpret Q: &(80) @P(0.1, 0.08)\n\
    interpret Board: [ f(1) -(90) -(tip(t)) f(-1) for i in 0 .. 2: ( [ &(90) f(0.1*i - 0.1) ^(90) !(0.1) F(2) ] ) ]\n";

#[test]
fn what_falls_lies_on_a_solid_and_slides_off_when_it_tips() {
    let session = read(BOARD);
    let scenes = self::scenes(&session, &[2.0, 2.9, 6.0]);
    assert!((bottom(&scenes[0]) - 1.05).abs() < 2e-3, "on the board: {}", bottom(&scenes[0]));
    assert_eq!(surface(&scenes[0]), surface(&scenes[1]), "it lies still");
    assert!(bottom(&scenes[2]).abs() < 1e-3, "on the ground: {}", bottom(&scenes[2]));
    // Without the word it falls through what is drawn.
    let through = read(&BOARD.replace("solid Board\n", ""));
    assert!(bottom(&self::scenes(&through, &[2.0])[0]) < 0.2);
}

/// Petals over a dish that turns and rocks, with a paddle that sweeps over it; a production replaces the dish on the way.
const DISH: &str = "units length 0.1, time 1\nground 0\nsolid Dish Plate Paddle\nwind 1, 0, 0.2 speed 0.6 turbulence 0.3 scale 1\n\
    initial string: Dish [ f(6) for k in 0 .. 5: ( [ /(60*k) &(70) f(0.8) P(k) ] ) ] Paddle(0)\n\
    P(k): if age = 0.1 + 0.13*k produce @D Q(k)\nDish: if age = 1.7 produce Plate\nPaddle(a): solve da/dt = 120\n\
    interpret P(k): @P(0.5, 0.4)\ninterpret Q(k): @P(0.5, 0.4)\n\
    interpret Dish: Slats\ninterpret Plate: Slats\n\
    interpret Slats: [ f(4 + 0.2*sin(2*t)) -(90 + 8*sin(3*t)) f(-2) for i in 0 .. 4: ( [ &(90) f(0.8*i - 1.6) ^(90) !(0.15) F(4) ] ) ]\n\
    interpret Paddle(a): [ f(4.6) /(a) -(90) !(0.2) F(3) ]\n";

/// The scenes of some times are the same if two threads draw them in leaps of so many, and if two of them are drawn alone.
fn come_in_any_order(
    session: &Session,
    (times, straight): (&[f64], &[Scene]),
    leap: usize,
    alone: [usize; 2],
) {
    let nursery = Nursery::new(&session.model, Settings::default());
    let strings: Vec<ModuleString> = times.iter().map(|t| string(session, *t)).collect();
    std::thread::scope(|scope| {
        for first in 0..2 {
            let (nursery, strings) = (&nursery, &strings);
            scope.spawn(move || {
                for i in (first..strings.len()).step_by(2).map(|i| i * leap % strings.len()) {
                    assert_eq!(places(&draw(nursery, &strings[i])), places(&straight[i]), "{i}");
                }
            });
        }
    });
    for i in alone {
        assert_eq!(places(&scenes(session, &times[i..=i])[0]), places(&straight[i]), "{}", times[i]);
    }
}

#[test]
fn the_order_of_frames_and_threads_do_not_matter_among_solids() {
    let session = read(DISH);
    let times: Vec<f64> = (0..50).map(|i| f64::from(i) * 0.0631).collect();
    let straight = scenes(&session, &times);
    let high = |scene: &Scene| places(scene).iter().filter(|(_, at, _)| at.y > 3.0).count();
    assert!(high(&straight[49]) > 0 && places(&straight[40]) != places(&straight[49]), "they ride on it");
    come_in_any_order(&session, (&times, &straight), 23, [11, 49]);
}

/// A fruit hangs within the hull of its tree, which is `solid`: it falls through it to the ground, as if the tree were not.
#[test]
fn a_fruit_falls_out_of_its_own_tree() {
    let text = "ground 0\nsolid Tree\ninitial string: Tree [ f(0.8) -(90) f(0.1) A ]\nA: if age = 0.1 produce @D B\n\
        interpret A: @O(0.08)\ninterpret B: @O(0.08)\n\
        interpret Tree: !(0.1) F(0.5) [ +(60) F(1) ] [ -(60) F(1) ] F(1)\n";
    let free = scenes(&read(&text.replace("solid Tree\n", "")), &[0.3, 3.0]);
    let among = scenes(&read(text), &[0.3, 3.0]);
    let at = |scenes: &[Scene], k: usize| surface(&scenes[k]).0;
    assert!((at(&free, 0) - at(&among, 0)).norm() < 1e-3, "{} {}", at(&free, 0), at(&among, 0));
    assert!((at(&among, 1).y - 0.04).abs() < 1e-3, "{}", at(&among, 1));
}

/// Sand is poured for a second; leaves and a ball are let go above the heap at t = 1.5. From t = 4 on a board moves through the heap, and from t = 6 on more is poured.
const HEAP: &str = "soil dry = sand, repose 30\nground dry cell 0.01 depth 0.3 extent 0.5\nsolid Board\n\
    pour dry rate if t < 1 then 0.003 else if t > 6 & t < 7 then 0.002 else 0 at 0, 1, 0 radius 0.02\n\
    initial string: Board(0.4) [ f(0.3) for k in 0 .. 2: ( [ /(120*k) &(90) f(0.08) /(30) P(k) ] ) B ]\n\
    P(k): if age = 1.5 produce @D Q(k)\nB: if age = 1.5 produce @D C\n\
    interpret P(k): @P(0.05, 0.04)\ninterpret Q(k): @P(0.05, 0.04)\ninterpret B: -(90) f(0.02) @O(0.03)\ninterpret C: -(90) f(0.02) @O(0.03)\n\
    Board(x): if t < 4 solve dx/dt = 0 if t >= 4 & t < 6 solve dx/dt = -0.3 if t >= 6 solve dx/dt = 0\n\
    interpret Board(x): [ f(0.02) -(90) f(x) &(90) f(-0.15) !(0.06) F(0.3) ]\n";

/// How high above the soil the places of what falls are: where leaves begin, and the middle of the ball.
fn above(session: &Session, scene: &Scene, time: f64) -> Vec<f64> {
    let made = dlsys::surround::Terrain::new(&session.model, Settings::default(), 1);
    let terrain = made.unwrap_or_else(|error| panic!("{error}")).expect("soil");
    let height =
        |x: f64, z: f64| terrain.height(time, [x, z], None).unwrap_or_else(|error| panic!("{error}"));
    let falls = scene.surfaces.iter().map(|surface| surface.placement.origin);
    // The last surface is the soil itself.
    falls.take(4).map(|at| at.y - height(at.x, at.z)).collect()
}

#[test]
fn what_falls_lies_on_a_heap_and_is_moved_with_it() {
    let session = read(HEAP);
    let times = [3.0, 6.0, 7.5];
    let scenes = self::scenes(&session, &times);
    let on = above(&session, &scenes[0], times[0]);
    assert!(on[..3].iter().all(|gap| *gap > -1e-4 && *gap < 0.01), "leaves lie on the heap: {on:?}");
    assert!((on[3] - 0.015).abs() < 1e-3, "the ball has rolled down: {on:?}");
    let ball = |scene: &Scene| scene.surfaces[3].placement.origin;
    assert!(ball(&scenes[0]).x > 0.2 && ball(&scenes[0]).z.abs() < 0.02, "{}", ball(&scenes[0]));
    for (scene, time) in scenes.iter().zip(times) {
        let gaps = above(&session, scene, time);
        assert!(gaps[..3].iter().all(|gap| *gap > -1e-3), "none is below the soil at {time}: {gaps:?}");
    }
    assert!(ball(&scenes[1]).x < 0.2, "the board has taken it along: {}", ball(&scenes[1]));
}

#[test]
fn the_order_of_frames_and_threads_do_not_matter_on_soil() {
    let session = read(HEAP);
    let times: Vec<f64> = (0..20).map(|i| 1.4 + f64::from(i) * 0.161).collect();
    let straight = scenes(&session, &times);
    assert!(places(&straight[19]) != places(&straight[12]), "they move in the end");
    come_in_any_order(&session, (&times, &straight), 7, [9, 19]);
}

/// A solid that sheets push is where they have pushed it: a ball that drops into a cloth stays above it, and a petal that drops later lies on the ball.
#[test]
fn what_falls_meets_solids_where_forces_have_led_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut cloth = String::new();
    for i in 0..9 {
        (0..9).for_each(|j| cloth += &format!("v {} 1 {}\n", i as f64 / 8.0 - 0.5, j as f64 / 8.0 - 0.5));
    }
    for i in 0..8 {
        for j in 0..8 {
            let a = 9 * i + j + 1;
            cloth += &format!("f {a} {} {} {}\n", a + 1, a + 10, a + 9);
        }
    }
    std::fs::write(folder.path().join("cloth.obj"), cloth).expect("written");
    let text = "tissue cloth = stiffness 1e5, density 500, damping 0.3, thickness 1e-3\n\
        sheet @Cloth from \"cloth.obj\" of cloth pinned x < -0.49 | x > 0.49\nsolid Ball\n\
        initial string: [ @Cloth ] Ball(1.3, 0) [ f(2) P ]\n\
        Ball(y, v): solve dy/dt = v, dv/dt = -9.81 + force_y/0.4 - 2*v\n\
        P: if age = 1.2 produce @D Q\ninterpret P: @O(0.04)\ninterpret Q: @O(0.04)\n\
        interpret Ball(y, v): [ f(y) @O(0.3) ]\n";
    let path = folder.path().join("cloth.dls");
    std::fs::write(&path, text).expect("written");
    let session = Session::open(&path, &[]).unwrap_or_else(|refused| panic!("{refused}"));
    let scene = scenes(&session, &[1.66]).remove(0);
    let middle = |size: f64| {
        let of = |s: &&dlsys::scene::Surface| (s.placement.scales[0] - size).abs() < 1e-6;
        scene.surfaces.iter().find(of).map(|surface| surface.placement.origin)
    };
    let (ball, berry) = (middle(0.3).or(middle(0.15)), middle(0.04).or(middle(0.02)));
    let (ball, berry) = (ball.expect("a ball"), berry.expect("a berry"));
    assert!(ball.y > 0.5 && ball.y < 1.3, "the cloth carries it: {ball}");
    assert!((berry - ball).norm() > 0.169, "{berry} {ball}");
    assert!(berry.y > ball.y, "{berry} {ball}");
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
