//! `flow_x(x, y, z)` and so on in rules and drawings: against the wind of the scene, exact paths, events, messages, and the same bits whatever is observed.

use dlsys::model::Model;
use dlsys::session::Session;
use dlsys::sim::{Method, Settings, Simulation};
use dlsys::surround::{Place, Weather, start};
use dlsys::tree::ModuleString;
use nalgebra::Vector3;

use crate::common::{bits, session};

fn model(text: &str) -> Model {
    session(text).model
}

fn started(model: &Model) -> Simulation<'_> {
    start(model, Settings::default(), Place::of_scene(&model.scenery)).expect("it starts")
}

/// All messages about a text.
fn messages(text: &str) -> String {
    Session::from_text("test.dls", text, &[]).map_or_else(|refused| refused.to_string(), |_| String::new())
}

fn at(simulation: &mut Simulation, t: f64) -> ModuleString {
    let mut string = ModuleString::default();
    simulation.at(t, &mut string).expect("it grows");
    string
}

const PLACES: [[f64; 3]; 4] = [[0.3, 1.2, -0.7], [0.01, 0.0, 2.0], [2.0, -9.0, 0.0], [-3.0, 0.4, 8.0]];

/// What rules read is what everything else in the scene feels, at instants at which that is not interpolated.
#[test]
fn the_wind_of_rules_is_that_of_the_scene() {
    for wind in [
        "wind 1, 0.3, -0.4 speed 3",
        "wind 1, 0.3, -0.4 speed 3 turbulence 0.3 scale 2 seed 3",
        "wind 1, 0.3, -0.4 speed 3 + sin(2*t) turbulence 0.3 scale 2 roughness 0.05\nground -0.25",
        "wind 0, 0, 1 speed 2 period 2 turbulence 0.2 scale 1",
        "wind 1, 0, 0 speed 1 spectrum kolmogorov 0.1, 4, 1",
        "flow uniform 1, 2*t, 0\nflow source 3 at 0, 1, 0 decay 2\nflow sink 1 + t at t, 0, 1",
        "flow vortex 2 at 0, 1, 0 axis 0.2, 1, t decay 3\nwind 1, -1, 0 speed 2 scale 4\nground 0",
    ] {
        for units in ["", "units length 0.5, time 0.5\n"] {
            let axiom = PLACES.map(|[x, y, z]| format!("V({x}, {y}, {z}, 0, 0, 0)")).join(" ");
            let model = model(&format!(
                "{units}{wind}\ninitial string: {axiom}\nV(x, y, z, u, v, w): \
                 solve u = flow_x(x, y, z), v = flow_y(x, y, z), w = flow_z(x, y, z)"
            ));
            let weather = Weather::of(&model, Settings::default()).expect("a wind").expect("a wind");
            let (mut simulation, units) = (started(&model), model.scenery.units);
            for instant in [0.0, 64.0, 192.0] {
                let time = instant / 128.0 / units.time;
                let string = at(&mut simulation, time);
                let air = weather.at(time * units.time).expect("an instant");
                for (place, module) in PLACES.into_iter().zip(string.iter()) {
                    let wanted =
                        air.velocity(Vector3::from(place) * units.length) * (units.time / units.length);
                    let found = Vector3::from_column_slice(&module.parameters[3..6]);
                    let apart = (found - wanted).norm();
                    assert!(
                        apart <= 1e-11 * (1.0 + wanted.norm()),
                        "{wind} at {place:?}: {found}, not {wanted}"
                    );
                }
            }
        }
    }
}

/// Steady uniform wind is a formula; so is one whose speed has one. A vortex leads around a circle.
#[test]
fn what_the_wind_carries_moves_with_it() {
    let carried =
        "S(x, y, z): solve dx/dt = flow_x(x, y, z), dy/dt = flow_y(x, y, z), dz/dt = flow_z(x, y, z)";
    let uniform = model(&format!(
        "wind 0, 0, 1 speed 3 + 2*t\nunits length 0.5, time 2\ninitial string: S(1, 2, 3)\n{carried}"
    ));
    let string = at(&mut started(&uniform), 2.0);
    // (3 + 2 t) m/s times 2 s/unit over 0.5 m/unit, from 0 to 2.
    assert_eq!(string.get(0).parameters, [1.0, 2.0, 3.0 + 4.0 * (6.0 + 4.0)]);
    let vortex =
        model(&format!("flow vortex 2*pi at 0, 0, 0 axis 0, 1, 0\ninitial string: S(1, 0, 0)\n{carried}"));
    let string = at(&mut started(&vortex), 10.0);
    // 1/(1 + 0.1²) m/s around a circle of 1 m, with the right hand around y.
    let angle = 10.0 / 1.01;
    let [x, _, z] = string.get(0).parameters[..] else { panic!("three of them") };
    assert!((x - f64::cos(angle)).abs() < 1e-5 && (z + f64::sin(angle)).abs() < 1e-5, "{x} {z}");
}

const GUSTS: &str = "wind 1, 0, 0 speed 3 + sin(t) turbulence 0.4 scale 2 seed 11\n";

/// Events on gusts: each is at a time at which the wind has the value, and before it there is none, on a fine grid.
#[test]
fn events_on_gusts_are_located_and_none_is_missed() {
    let model = model(&format!(
        "{GUSTS}initial string: A(0)\nA(n):\n  if flow_x(0, 1, 0) < 4.2 solve dn/dt = 0\n  \
         if flow_x(0, 1, 0) = 4.2 produce B(n)\n\
         B(n):\n  if flow_x(0, 1, 0) > 3.5 solve dn/dt = 0\n  if flow_x(0, 1, 0) = 3.5 produce A(n + 1)"
    ));
    let settings = Settings { log: true, ..Settings::default() };
    let mut simulation = start(&model, settings, Place::of_scene(&model.scenery)).expect("it starts");
    at(&mut simulation, 14.0);
    let events = simulation.take_events();
    assert!(events.len() >= 6, "{}", events.len());
    let probe = self::model(&format!("{GUSTS}initial string: V(0)\nV(u): solve u = flow_x(0, 1, 0)"));
    let mut wind = started(&probe);
    let mut speed = |t: f64| at(&mut wind, t).get(0).parameters[0];
    let (mut from, mut is_up) = (0.0, false);
    for event in &events {
        let end = event.time;
        let mut t = from;
        while t < end - 1e-4 {
            let found = speed(t);
            assert!(if is_up { found > 3.5 } else { found < 4.2 }, "{found} at {t}");
            t += 1e-3;
        }
        let found = speed(end);
        assert!((found - if is_up { 3.5 } else { 4.2 }).abs() < 1e-9, "{found} at {end}");
        (from, is_up) = (end + 1e-9, !is_up);
    }
}

/// A mass that the wind drags: two methods, and steps that a frame cuts, agree.
#[test]
fn methods_agree_on_what_the_wind_drags() {
    let model = model(&format!(
        "{GUSTS}initial string: S(0, 1, 0, 0)\nS(x, y, u, v): solve dx/dt = u, dy/dt = v, \
         du/dt = 5*(flow_x(x, y, 0) - u), dv/dt = 5*(flow_y(x, y, 0) - v)"
    ));
    let run = |method: Method, step_size: f64| {
        let settings = Settings { method, step_size, ..Settings::default() };
        let mut simulation = start(&model, settings, Place::of_scene(&model.scenery)).expect("it starts");
        at(&mut simulation, 1.5).get(0).parameters.to_vec()
    };
    let auto = run(Method::Auto, 0.1);
    let fine = run(Method::Rk4, 1.0 / 8192.0);
    for (a, b) in auto.iter().zip(&fine) {
        assert!((a - b).abs() < 1e-4 * b.abs().max(1.0), "{auto:?} {fine:?}");
    }
    assert!(auto[0] > 2.0, "{auto:?}");
}

/// Other frames, in another order, by copies: the same bits.
#[test]
fn frames_and_copies_change_no_bit() {
    let model = model(&format!(
        "{GUSTS}initial string: S(0, 1) S(0, 2)\nS(x, y): if x < 2 solve dx/dt = 0.3*flow_x(x, y, 0), dy/dt = flow_y(x, y, 0)\n  \
         if x = 2 produce S(0, y) S(1, y)"
    ));
    let once = bits(&at(&mut started(&model), 3.0));
    let mut often = started(&model);
    for frame in 0..30 {
        at(&mut often, f64::from(frame) / 11.0);
    }
    let mut copy = often.clone();
    assert_eq!(bits(&at(&mut often, 3.0)), once);
    assert_eq!(bits(&at(&mut copy, 3.0)), once);
    assert!(once.len() > 4);
}

#[test]
fn a_direction_is_one_however_long_it_is() {
    for length in ["5e-324", "1e-300", "1", "1e200", "1e300"] {
        let model = model(&format!(
            "wind {length}, 0, {length} speed 3\ninitial string: A(0)\nA(x): solve dx/dt = flow_x(0, 1, 0)"
        ));
        let string = at(&mut started(&model), 1.0);
        let x = string.iter().next().expect("one").parameters[0];
        assert!((x - 3.0 / f64::sqrt(2.0)).abs() < 1e-6, "{length}: {x}");
        let direction = Vector3::new(1.0, 0.0, 1.0) * length.parse::<f64>().expect("a number");
        let field = dlsys::wind::Field::new(dlsys::wind::Description::new(direction, 3.0)).expect("a wind");
        let velocity = field.at(0.0).expect("an instant").velocity(Vector3::zeros());
        assert!((velocity.x - 3.0 / f64::sqrt(2.0)).abs() < 1e-12, "{length}: {velocity}");
    }
}

#[test]
fn ground_beyond_all_drawings_is_an_error_with_its_place() {
    let text = messages("ground -1e300\ninitial string: F(1)");
    assert!(text.contains("beyond the greatest coordinate") && text.contains("it is -1e300"), "{text}");
    assert!(text.contains(":1:8") && text.contains("`ground 0`"), "{text}");
}

#[test]
fn mistakes_have_a_place_and_a_remedy() {
    let still = "initial string: A(0)\nA(x): solve dx/dt = flow_x(x, 1, 0)";
    let text = messages(still);
    assert!(
        text.contains("`flow_x` reads the wind, and there is none here")
            && text.contains("wind 1, 0, 0 speed 3"),
        "{text}"
    );
    assert!(text.contains(":2:"), "{text}");
    let windy = |rest: &str| messages(&format!("wind 1, 0, 0 speed 3\n{rest}"));
    let text = windy("initial string: A(flow_x(0, 0, 0))\nA(x): solve dx/dt = 1");
    assert!(text.contains("`flow_x` has no meaning here"), "{text}");
    let text = windy("def G(x) = flow_y(x, 0, 0)\ninitial string: A(0)\nA(x): solve dx/dt = G(x)");
    assert!(text.contains("`flow_y` has no meaning here") && text.contains("as an argument"), "{text}");
    let text = windy("initial string: A(0)\nA(x): solve dx/dt = flow_z(x, 0)");
    assert!(text.contains("`flow_z` has 3 parameters, not 2") && text.contains("flow_z(x, y, z)"), "{text}");
    let text = windy("initial string: A(0)\nA(x): solve dx/dt = flow_x");
    assert!(text.contains("`flow_x` is a function"), "{text}");
    let text = windy("light flow_x(0, 0, 0), 1, 0\ninitial string: A(0)\nA(x): solve dx/dt = 1");
    assert!(text.contains("`flow_x` has no meaning here"), "{text}");
    // A name of the model hides it.
    assert_eq!(
        messages(
            "def flow_x(x, y, z) = x + y + z\ninitial string: A(0)\nA(x): solve dx/dt = flow_x(x, 1, 0)"
        ),
        ""
    );
    // A flow without the period of the wind, which only the field checks.
    let text = messages(
        "wind 1, 0, 0 speed 3 turbulence 0.1 scale 1 period 2\nflow uniform t, 0, 0\n\
         initial string: A(0)\nA(x): solve dx/dt = flow_x(x, 1, 0)",
    );
    assert!(text.contains("does not repeat") && text.contains(":2:"), "{text}");
}
