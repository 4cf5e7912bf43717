//! `ground(x, z)` in rules: rigid floors, soil at rest, soil that is poured, and soil that growth itself presses.

use dlsys::session::Session;
use dlsys::sim::{Settings, Simulation};
use dlsys::surround::Terrain;
use dlsys::tree::ModuleString;

use crate::common::{bits, session};

fn at(simulation: &mut Simulation, t: f64) -> ModuleString {
    let mut string = ModuleString::default();
    simulation.at(t, &mut string).unwrap_or_else(|error| panic!("{error}"));
    string
}

fn started(session: &Session) -> Simulation<'_> {
    session.simulate(Settings::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// The first parameter of the last module at some times.
fn values(session: &Session, times: &[f64]) -> Vec<f64> {
    let mut simulation = started(session);
    let last = |string: ModuleString| string.get(string.len() - 1).parameters[0];
    times.iter().map(|t| last(at(&mut simulation, *t))).collect()
}

/// Heights of the ground as it is drawn, which are those of ticks.
fn drawn(session: &Session, place: [f64; 2], times: &[f64]) -> Vec<f64> {
    let terrain = Terrain::new(&session.model, Settings::default(), 1).expect("a ground").expect("a ground");
    times.iter().map(|t| terrain.height(*t, place, None).unwrap_or_else(|error| panic!("{error}"))).collect()
}

fn messages(text: &str) -> String {
    Session::from_text("test.dls", text, &[]).map_or_else(|refused| refused.to_string(), |_| String::new())
}

/// The message of a run that fails.
fn fault(session: &Session, until: f64) -> String {
    let fault = started(session).pass(until).expect_err("it fails");
    fault.diagnostic().render(&session.source, false)
}

#[test]
fn a_rigid_ground_is_a_constant() {
    let rigid = session(
        "ground 2.5\ninitial string: A(0)\nA(y): if y < ground(1, 2) solve dy/dt = 1\n  if y = ground(y, 0) produce B(ground(0, 0))",
    );
    let string = at(&mut started(&rigid), 2.5);
    assert_eq!(rigid.model.kinds.get(string.get(0).kind).name, "B");
    assert_eq!(string.get(0).parameters, [2.5]);
}

const HILLS: &str = "soil dry = soil, repose 60\nground dry cell 0.25 height 0.3*sin(x) + 0.1*z extent 8\n";

/// At columns what is declared, and between them bilinear; at its edges level; with other units the same numbers.
#[test]
fn soil_at_rest_has_the_heights_that_are_drawn() {
    for units in ["", "units length 0.1, time 2\n"] {
        for [x, z] in [[0.5, 1.0], [-3.25, 0.0], [0.6, 1.1], [7.9, -7.9], [20.0, 0.0]] {
            let text = format!("{units}{HILLS}initial string: A(0)\nA(y): solve y = ground({x}, {z})");
            let session = session(&text);
            let found = values(&session, &[0.0, 0.3]);
            assert_eq!(found, drawn(&session, [x, z], &[0.0, 0.3]), "{x} {z}");
            if [0.25 * (x / 0.25).round(), 0.25 * (z / 0.25).round()] == [x, z] && x.abs() < 8.0 {
                assert!((found[0] - (0.3 * f64::sin(x) + 0.1 * z)).abs() < 1e-9, "{found:?}");
            }
        }
    }
}

/// A stone falls on a slope, where both are known: y = 2 - t²·g/2 at x = 1.5 t meets 0.2 x.
#[test]
fn an_event_on_a_slope_is_exact() {
    let falls = session(
        "soil dry = soil, repose 60\nground dry cell 0.25 height 0.2*x extent 8\ninitial string: S(0, 2, 0)\n\
         S(x, y, v):\n  if y > ground(x, 0.1) solve dx/dt = 1.5, dy/dt = v, dv/dt = -9.81\n  if y = ground(x, 0.1) produce L(t, y)",
    );
    let string = at(&mut started(&falls), 2.0);
    assert_eq!(falls.model.kinds.get(string.get(0).kind).name, "L");
    let time = (f64::sqrt(0.3 * 0.3 + 4.0 * 2.0 * 4.905) - 0.3) / 9.81;
    let [found, y] = string.get(0).parameters[..] else { panic!("two of them") };
    assert!((found - time).abs() < 1e-9 && (y - 0.3 * time).abs() < 1e-9, "{found} {time} {y}");
}

/// A walker on hills goes up and down with them, and turns where they are high enough: thousands of cells on its way.
#[test]
fn a_walker_follows_the_hills() {
    let walks = session(
        "soil dry = soil, repose 60\nground dry cell 0.01 height 0.3*sin(x) extent 10\ninitial string: W(-9, 0)\n\
         W(x, y):\n  if ground(x, 0) < 0.29 & x < 9 solve dx/dt = 2, y = ground(x, 0)\n  if ground(x, 0) = 0.29 produce T(x, y)",
    );
    let string = at(&mut started(&walks), 9.0);
    // The first place behind -9 where 0.3 sin x = 0.29 and it rises.
    let exact = f64::asin(0.29 / 0.3) - 2.0 * std::f64::consts::TAU / 2.0 * 1.0;
    let [x, y] = string.get(0).parameters[..] else { panic!("two of them") };
    assert!((x - exact).abs() < 1e-4 && (y - 0.29).abs() < 1e-9, "{x} {exact} {y}");
}

/// What is poured rises under a rule that reads it: at ticks as drawn, between them a straight line.
#[test]
fn poured_sand_is_read_as_it_rises() {
    let poured = session(
        "soil sand = sand\nground sand cell 0.05 extent 2\npour sand rate 0.02 at 0, 2, 0 radius 0.1\ninitial string: A(0)\n\
         A(y): solve y = ground(0.1, 0)",
    );
    let ticks: Vec<f64> = (0..200).map(|tick| f64::from(tick) / 120.0).collect();
    let (found, shown) = (values(&poured, &ticks), drawn(&poured, [0.1, 0.0], &ticks));
    for (tick, (found, shown)) in found.iter().zip(&shown).enumerate() {
        assert!((found - shown).abs() < 1e-12, "{tick}: {found} {shown}");
    }
    assert!(shown[199] > 0.05, "{}", shown[199]);
    let between: Vec<f64> = ticks.iter().map(|t| t + 0.25 / 120.0).collect();
    for (tick, part) in values(&poured, &between).into_iter().enumerate().take(199) {
        let line = shown[tick] + 0.25 * (shown[tick + 1] - shown[tick]);
        assert!((part - line).abs() < 1e-12, "{tick}: {part} {line}");
    }
}

/// A ball is pressed into sand until a rule finds the dent deep enough; another rule is born then, and reads it, too.
const PRESSED: &str = "soil sand = sand
ground sand cell 0.02 depth 0.4 extent 1
solid Ball
interpret Ball(y): [ f(y) @O(0.3) ]
initial string: Ball(0.25) Probe(0)
";

#[test]
fn growth_that_presses_the_ground_reads_what_it_did() {
    let session = session(&format!(
        "{PRESSED}Ball(y): solve dy/dt = -0.4\nProbe(d):\n  if ground(0.02, 0) > -0.06 solve d = ground(0.02, 0)\n  \
         if ground(0.02, 0) = -0.06 produce [ New(t, ground(0.02, 0)) ] Late(0)\n\
         New(t0, y): if ground(0.02, 0) < -0.08 produce Deep(t)\nLate(d): solve d = ground(0.02, 0)"
    ));
    let times: Vec<f64> = (0..=60).map(|tick| f64::from(tick) / 120.0).collect();
    let (found, shown) = (values(&session, &times), drawn(&session, [0.02, 0.0], &times));
    for (tick, (found, shown)) in found.iter().zip(&shown).enumerate() {
        // Growth and ground agree within a thousandth of a cell.
        assert!((found - shown).abs() <= 2e-5, "{tick}: {found} {shown}");
    }
    // The lowest point of the ball goes down by 0.4 a second from 0.1: a column beside it follows the ball.
    let under = |t: f64| 0.25 - 0.4 * t - f64::sqrt(0.15 * 0.15 - 0.02 * 0.02);
    assert!((shown[60] - under(0.5)).abs() < 5e-3, "{} {}", shown[60], under(0.5));
    let string = at(&mut started(&session), 0.5);
    let names: Vec<&str> = string.iter().map(|m| session.model.kinds.get(m.kind).name.as_str()).collect();
    assert_eq!(names, ["Ball", "[", "Deep", "]", "Late"]);
    let deep = string.get(2).parameters[0];
    let tick = (deep * 120.0).floor();
    let (before, after) = (shown[tick as usize], shown[tick as usize + 1]);
    let part = deep * 120.0 - tick;
    assert!((before + part * (after - before) + 0.08).abs() < 2e-5, "{deep}");
}

/// A post that is driven in slows down by the height of the rim beside it: both ways, with the same bits whatever is observed.
#[test]
fn both_ways_has_the_same_bits_in_any_order() {
    let session = session(&format!(
        "{PRESSED}Ball(y): solve dy/dt = -0.4*exp(-20*ground(0.18, 0))\nProbe(d): solve d = ground(0.18, 0)"
    ));
    let once = bits(&at(&mut started(&session), 0.6));
    let mut often = started(&session);
    for frame in 0..23 {
        at(&mut often, f64::from(frame) / 40.0);
    }
    let mut copy = often.clone();
    assert_eq!(bits(&at(&mut often, 0.6)), once);
    drop(often);
    assert_eq!(bits(&at(&mut copy, 0.6)), once);
    let end = at(&mut started(&session), 0.6);
    let [y, rim] = [end.get(0).parameters[0], end.get(1).parameters[0]];
    assert!(rim > 0.002 && y > 0.25 - 0.4 * 0.6 + 1e-3, "{y} {rim}");
}

/// A foot that is always a little below the ground where it stands would sink without end.
#[test]
fn a_body_that_follows_its_own_dent_is_an_error() {
    let session =
        session(&format!("{PRESSED}Ball(y): solve y = ground(0, 0) + 0.14\nProbe(d): solve dd/dt = 1"));
    let text = fault(&session, 1.0);
    assert!(text.contains("growth and the ground that it reads and presses do not agree at t = 0"), "{text}");
    assert!(text.contains("test.dls:2:") && text.contains("sinks without end"), "{text}");
}

/// Growth may fail between two ticks: what it reads until then is the same everywhere, and so is the message.
#[test]
fn growth_that_fails_within_a_tick_gets_there() {
    let session = session(&format!(
        "{PRESSED}Ball(y): solve dy/dt = -0.4\nProbe(d): if t < 0.3012 solve d = ground(0.02, 0)"
    ));
    let mut simulation = started(&session);
    let before = at(&mut simulation, 0.301);
    assert!(before.get(1).parameters[0] < -0.01);
    let text = fault(&session, 0.4);
    assert!(text.contains("Probe") && text.contains("0.3012"), "{text}");
}

#[test]
fn mistakes_have_a_place_and_a_remedy() {
    let text = messages("initial string: A(0)\nA(y): solve dy/dt = 1 - ground(0, y)");
    assert!(text.contains("`ground` reads the height of the ground, and there is none here"), "{text}");
    assert!(text.contains("test.dls:2:"), "{text}");
    let soil = |rest: &str| messages(&format!("{HILLS}{rest}"));
    let text = soil("initial string: A(ground(0, 0))\nA(y): solve dy/dt = 1");
    assert!(text.contains("`ground` has no meaning here") && text.contains("@G"), "{text}");
    let text = soil("initial string: A(0)\nA(y): solve dy/dt = 1\ninterpret A(y): f(ground(0, 0))");
    assert!(
        text.contains("`ground` has no meaning here") && text.contains("solve y = ground(x, z)"),
        "{text}"
    );
    let text = soil("initial string: A(0)\nA(y): solve dy/dt = ground(0)");
    assert!(text.contains("`ground` has 2 parameters, not 1") && text.contains("ground(x, z)"), "{text}");
    let text = soil("initial string: A(0)\nA(y): solve dy/dt = ground");
    assert!(text.contains("`ground` is a function"), "{text}");
    let text = soil(
        "tissue wood = stiffness 1e9, density 800, damping 0.1\ninitial string: @E(wood) !(0.1) A(1)\nA(y): solve dy/dt = ground(0, 0) + strain",
    );
    assert!(text.contains("rules read both `ground` and `strain`"), "{text}");
    assert_eq!(
        messages("def ground(x, z) = x*z\ninitial string: A(0)\nA(y): solve dy/dt = ground(y, 1)"),
        ""
    );
}
