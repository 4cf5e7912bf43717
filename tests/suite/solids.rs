//! Bodies (`solid`): the wind flows around what they draw, wherever growth moves them, in any order of times.

use dlsys::scene::{Scene, Vector};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::surround::{Error, Weather};
use dlsys::tree::ModuleString;
use dlsys::wind::{Hull, Obstacle};

fn read(text: &str) -> Session {
    Session::from_text("solids.dls", text, &[]).unwrap_or_else(|refused| panic!("{refused}"))
}

/// The wind of a model at a place and a time in SI.
fn wind(weather: &Weather, place: [f64; 3], seconds: f64) -> Vector {
    let snapshot = weather.at(seconds).unwrap_or_else(|error| panic!("{}", error.diagnostic().message));
    snapshot.velocity(Vector::from(place))
}

fn weather(session: &Session) -> std::sync::Arc<Weather<'_>> {
    Weather::of(&session.model, Settings::default()).expect("a wind").expect("there is one")
}

fn refused(text: &str, seconds: f64) -> Error {
    let session = read(text);
    match Weather::of(&session.model, Settings::default()) {
        Err(error) => error,
        Ok(weather) => weather.expect("a wind").at(seconds).expect_err("it is refused"),
    }
}

/// A ball of 1 m flies at 2 m/s; a unit of t is half a second.
const FLYING: &str = "units length 0.1, time 0.5\nwind 1, 0, 0 speed 4\nsolid Ball\n\
    initial string: Ball(0)\nBall(x): solve dx/dt = 10\ninterpret Ball(x): f(30) -(90) f(x) @O(10)\n";

#[test]
fn the_wind_flows_around_a_ball_where_growth_has_led_it() {
    let session = read(FLYING);
    let weather = weather(&session);
    for seconds in [0.0, 1.0, 0.37] {
        let x = 2.0 * seconds;
        let at = |dx: f64, dy: f64| wind(&weather, [x + dx, 3.0 + dy, 0.0], seconds);
        // The air comes at 2 m/s relative to the ball: 3/2 of that at the equator, nothing in front, and the ball's own inside.
        assert!((at(0.0, 0.5) - Vector::new(5.0, 0.0, 0.0)).norm() < 1e-9, "{}", at(0.0, 0.5));
        assert!((at(-0.5, 0.0) - Vector::new(2.0, 0.0, 0.0)).norm() < 1e-9, "{}", at(-0.5, 0.0));
        assert!((at(0.1, 0.2) - Vector::new(2.0, 0.0, 0.0)).norm() < 1e-9);
        assert_eq!(at(0.0, 1.0), Vector::new(4.0, 0.0, 0.0));
    }
}

#[test]
fn a_turning_slab_pushes_with_its_surface() {
    // A slab of 2 m by 1 m by 0.2 m about the upward axis, one turn in 4 s.
    let text = "solid Slab\ninitial string: Slab(0)\nSlab(a): solve da/dt = 90\n\
        interpret Slab(a): f(3) +(90) ^(a) { -(90) g(0.1) +(90) &(90) g(0.5) ^(90) g(-1) . g(2) . &(90) g(-1) ^(90) . g(-2) . \
        +(90) g(0.2) -(90) . g(2) . &(90) g(1) ^(90) . g(-2) . }\n";
    let session = read(text);
    let weather = weather(&session);
    let snapshot = weather.at(0.5).expect("a wind");
    let mut drawn = Scene::default();
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).expect("starts").at(0.5, &mut string).expect("grows");
    dlsys::turtle::draw(&session.model, &string, &mut drawn).expect("drawn");
    let points: Vec<Vector> = drawn.polygons[0].vertices.iter().map(|p| p.coords).collect();
    assert_eq!(points.len(), 8);
    let middle = points.iter().sum::<Vector>() / 8.0;
    let reach = points.iter().map(|point| (point - middle).norm()).fold(0.0, f64::max);
    let body = Hull::new(points, 0.02 * reach).expect("a body");
    let spin = (wind(&weather, [0.1, 3.0, 0.0], 0.5) - wind(&weather, [0.0, 3.0, 0.0], 0.5)) / 0.1;
    let turn = spin.norm();
    assert!((turn - std::f64::consts::FRAC_PI_2).abs() < 1e-3, "{turn}");
    let about = Vector::new(0.0, if spin.z < 0.0 { turn } else { -turn }, 0.0);
    let mut tried = 0;
    for k in 0..200 {
        let (angle, height) = (f64::from(k) * 0.7, 3.0 + 0.2 * (f64::from(k) * 0.31).sin());
        let mut place = Vector::new(2.0 * angle.cos(), height, 2.0 * angle.sin());
        // Far away, the distance is that from the ball around the body.
        for _ in 0..20 {
            place -= body.normal(place, 0.0) * body.distance(place, 0.0);
        }
        // Straight lines between instants: the surface is right to the square of the turn between two of them.
        let normal = body.normal(place, 0.0);
        let relative = snapshot.velocity(place + normal * 1e-4) - about.cross(&(place - middle));
        assert!(relative.dot(&normal).abs() < 5e-3, "{relative} through {normal} at {place}");
        tried += 1;
    }
    assert_eq!(tried, 200);
}

/// A ball that bounces to and fro, each time as a new module.
const BOUNCING: &str = "wind 0, 0, 1 speed 3 turbulence 0.2 scale 1\nsolid To Fro\ninitial string: To(0)\n\
    To(x): if x < 1 solve dx/dt = 5 if x = 1 produce Fro(1)\nFro(x): if x > 0 solve dx/dt = -5 if x = 0 produce To(0)\n\
    interpret To(x): -(90) f(x) @O(0.5)\ninterpret Fro(x): -(90) f(x) @O(0.5)\n";

#[test]
fn a_production_does_not_interrupt_a_body_and_times_may_come_in_any_order() {
    let session = read(BOUNCING);
    let times: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.0113).collect();
    let forward = weather(&session);
    let all: Vec<[Vector; 2]> = times
        .iter()
        .map(|&t| {
            let place = 1.0 - (1.0 - (5.0 * t) % 2.0).abs();
            // Inside the body, where straight lines between instants lead it: its velocity, that of the equations but for bounces.
            let inside = wind(&forward, [place, 0.0, 0.0], t);
            let phase = (5.0 * t) % 1.0;
            if (0.05..0.95).contains(&phase) {
                let expected = if (5.0 * t) % 2.0 < 1.0 { 5.0 } else { -5.0 };
                assert!((inside - Vector::new(expected, 0.0, 0.0)).norm() < 1e-6, "{inside} at {t}");
            } else {
                assert!(inside.x.abs() < 5.0 + 1e-6 && inside.z == 0.0, "{inside} at {t}");
            }
            [inside, wind(&forward, [0.5, 0.3, 0.1], t)]
        })
        .collect();
    let other = weather(&session);
    for (k, &t) in times.iter().enumerate().rev().step_by(3) {
        assert_eq!(wind(&other, [0.5, 0.3, 0.1], t), all[k][1], "{t}");
    }
}

/// A blade stands beside the way of a ball: the air that the ball pushes bends it, and without `solid` nothing happens.
#[test]
fn stems_bend_in_the_air_that_a_ball_pushes() {
    let text = |solid: &str| {
        format!(
            "tissue soft = stiffness 1e8, density 800, damping 0.1\n{solid}\n\
            initial string: [ @E(soft) Blade ] Ball(-1)\nBall(x): solve dx/dt = 4\n\
            interpret Blade: !(0.003) F(0.3) F(0.3)\ninterpret Ball(x): f(0.3) &(90) f(0.45) ^(90) -(90) f(x) @O(0.7)\n"
        )
    };
    let tips = |text: &str, times: &[f64]| -> Vec<Vector> {
        let session = read(text);
        let nursery = Nursery::new(&session.model, Settings::default());
        let tip = |t: &f64| {
            let (mut string, mut scene) = (ModuleString::default(), nursery.blank());
            session.simulate(Settings::default()).expect("starts").at(*t, &mut string).expect("grows");
            nursery
                .draw(&string, &mut scene)
                .unwrap_or_else(|error| panic!("{}", error.diagnostic().message));
            scene.segments.last().expect("a stem").end.coords
        };
        times.iter().map(tip).collect()
    };
    let pushed = tips(&text("solid Ball"), &[0.1, 0.2, 0.25, 0.3, 0.5]);
    let alone = tips(&text(""), &[0.25]);
    assert_eq!(alone[0], Vector::new(0.0, 0.6, 0.0));
    assert_eq!(pushed[0], alone[0], "the ball is far away");
    let aside = pushed.iter().map(|tip| (tip - alone[0]).norm()).fold(0.0, f64::max);
    assert!((0.003..0.3).contains(&aside), "{aside} {pushed:?}");
    // Other times in another order give the same bits.
    assert_eq!(tips(&text("solid Ball"), &[0.5, 0.25]), [pushed[4], pushed[2]]);
}

#[test]
fn bodies_that_cannot_push_the_wind_are_refused() {
    let tissue = "tissue soft = stiffness 1e8, density 800, damping 0.1\nwind 1, 0, 0 speed 1\nsolid Ball\n";
    let message = |text: &str, seconds: f64| refused(text, seconds).diagnostic().message;
    let bends = format!(
        "{tissue}initial string: @E(soft) Stem Ball\ninterpret Stem: !(0.1) F(1)\ninterpret Ball: @O(1)\n"
    );
    assert_eq!(message(&bends, 0.0), "the body of `Ball` (module 3) cannot push the wind: it bends in it");
    let own = format!("{tissue}initial string: @E(soft) Ball\ninterpret Ball: !(0.1) F(1)\n");
    assert_eq!(message(&own, 0.0), "the body of `Ball` (module 2) cannot push the wind: it bends in it");
    let rigid = format!("{tissue}initial string: @E(soft) @E(0) Ball\ninterpret Ball: !(0.1) F(1)\n");
    let session = read(&rigid);
    assert!(weather(&session).at(0.0).is_ok(), "behind `@E(0)` at the root nothing bends");
    let falls = "wind 1, 0, 0 speed 1\nsolid Ball\ninitial string: A\nA: if age = 1 produce @D Ball\ninterpret Ball: @O(1)\n";
    assert!(message(falls, 2.0).ends_with("cannot push the wind: it falls"), "{}", message(falls, 2.0));
    let many = "wind 1, 0, 0 speed 1\nsolid Ball\ninitial string: for i in 1 .. 1001: ( [ Ball ] )\ninterpret Ball: @O(1)\n";
    assert_eq!(message(many, 0.0), "more than 1000 bodies push the wind at t = 0");
    // Nothing runs away: neither with the time that is asked for, nor beyond the seconds that a run may take.
    let post = "wind 1, 0, 0 speed 1\nsolid Ball\ninitial string: Ball\ninterpret Ball: @O(1)\n";
    assert!(
        message(post, 1e9).starts_with("the surroundings take more than 1e7 steps"),
        "{}",
        message(post, 1e9)
    );
    let session = read(post);
    let settings = Settings { max_seconds: 0.05, ..Settings::default() };
    let limited = Weather::of(&session.model, settings).expect("a wind").expect("there is one");
    assert!(limited.at(0.1).is_ok());
    assert!(matches!(limited.at(200_000.0), Err(Error::OutOfTime { .. })));
    // Growth that fails is reported for the times that it does not reach, and for no others.
    let ends = "wind 1, 0, 0 speed 1\nsolid Ball\ninitial string: Ball(0)\nBall(x): if x < 1 solve dx/dt = 1\n\
        interpret Ball(x): @O(1)\n";
    let session = read(ends);
    let weather = weather(&session);
    assert!(weather.at(0.999).is_ok());
    assert!(matches!(weather.at(1.5), Err(Error::Growth(_))));
}

/// What a plant of another model draws is no body, also behind drawings of drawings, and that is said when the model is read.
#[test]
fn plants_of_other_models_in_bodies_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("twig.dls"), "initial string: F(1)\n").expect("written");
    let said = |drawn: &str| {
        let text = format!(
            "wind 1, 0, 0 speed 1\nplant @Twig from \"twig.dls\"\nsolid A\ninitial string: A B\n\
            interpret A: C\ninterpret C: {drawn}\ninterpret B: @Twig\n"
        );
        let path = folder.path().join("model.dls");
        std::fs::write(&path, text).expect("written");
        let session = Session::open(&path, &[]).unwrap_or_else(|refused| panic!("{refused}"));
        session.warnings.iter().map(|warning| warning.message.clone()).collect::<Vec<_>>()
    };
    assert_eq!(said("@O(1) @Twig"), ["`@Twig` is a plant of another model, and no body"]);
    assert!(said("@O(1)").is_empty());
}
