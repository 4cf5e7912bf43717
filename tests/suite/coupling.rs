//! Solids and sheets both ways: rules that read `force_x`, `force_y`, `force_z`.
//!
//! A ball on a cloth is a free ball of the mechanics of sheets, which knows its mass: the trajectory must be the same, though growth integrates it.

use dlsys::diagnostic::Source;
use dlsys::session::replay::{Replay, Stop};
use dlsys::session::{Nursery, Session};
use dlsys::sheet::{Drive, Grip, Mesh, Place, Shape, Sheet, Solid, Solver, State, Still, Tissue, Vector};
use dlsys::sim::{BendSettings, Settings};
use dlsys::tree::ModuleString;

use crate::common::repository;
use crate::sheets::{cloth, cloth_of, with_mesh};

/// A cloth of 1 by 1 m and 0.2 kg, held along two sides.
const CLOTH: &str = "tissue silk = stiffness 1e6, density 200, damping 0.1, thickness 0.001
sheet @Cloth from \"cloth.obj\" of silk pinned x < 0.01 | x > 0.99
";
/// A ball of 0.5 kg above its middle.
const DRAWN: &str = "solid Ball
interpret Ball(y, v): [ f(y) -(90) f(0.5) ^(90) f(0.5) @O(0.2) ]
";
const BALL: &str = "initial string: [ @Cloth ] Ball(0.3, 0)
Ball(y, v): solve dy/dt = v, dv/dt = -9.81 + force_y/0.5
";

fn session(text: &str) -> Session {
    with_mesh(text, &cloth()).unwrap_or_else(|error| panic!("{error}"))
}

fn within(tolerance: f64) -> Settings {
    let default = Settings::default();
    Settings { bending: BendSettings { tolerance, ..default.bending }, ..default }
}

/// The parameters of the last module at some times.
fn values(session: &Session, settings: Settings, times: &[f64]) -> Vec<Vec<f64>> {
    let mut simulation = session.simulate(settings).unwrap_or_else(|error| panic!("{error}"));
    let mut string = ModuleString::default();
    let mut at = |time: &f64| {
        simulation.at(*time, &mut string).unwrap_or_else(|error| panic!("{error}"));
        string.get(string.len() - 1).parameters.to_vec()
    };
    times.iter().map(&mut at).collect()
}

/// The message of a run that fails.
fn message(session: &Session, until: f64) -> String {
    let mut simulation = session.simulate(Settings::default()).unwrap_or_else(|error| panic!("{error}"));
    let fault = simulation.pass(until).expect_err("it fails");
    fault.diagnostic().render(&session.source, false)
}

/// The same ball, free to move along all axes, beside the middle.
const FREE: &str = "solid Ball
interpret Ball(x, y, z, u, v, w): [ f(y) -(90) f(x) ^(90) f(z) @O(0.2) ]
initial string: [ @Cloth ] Ball(0.45, 0.3, 0.52, 0, 0, 0)
Ball(x, y, z, u, v, w):
  solve dx/dt = u, dy/dt = v, dz/dt = w, du/dt = force_x/0.5, dv/dt = -9.81 + force_y/0.5, dw/dt = force_z/0.5
";

/// Places of a free ball of the mechanics at ticks of 1/64 s; friction does not turn it.
fn free(session: &Session, tolerance: f64, ticks: usize) -> Vec<Vector> {
    let declared = &session.model.scenery.sheets[0];
    let points = declared.points.iter().map(|point| Vector::from(*point)).collect();
    let mesh = Mesh { points, faces: declared.faces.clone(), cords: declared.cords.clone() };
    let tissue = Tissue { damping: 0.1, ..Tissue::new(1e6, 200.0, 1e-3) };
    let sheet = Sheet::new(&mesh, &tissue, |point| point.x < 0.01 || point.x > 0.99).expect("a sheet");
    let shape = Shape::ball(0.1).expect("a ball");
    let drive = Drive::Free { mass: 0.5, inertia: [1e9; 3] };
    let solids = [Solid { shape: &shape, drive, grip: Grip::default() }];
    let mut state = State::at_rest(&sheet).with(vec![Place::at(Vector::new(0.45, 0.3, 0.52))]);
    let tick = 1.0 / 64.0;
    let mut solver = Solver::new(dlsys::sheet::Settings { tolerance, longest: tick, ..Default::default() });
    (0..ticks)
        .map(|k| {
            let span = k as f64 * tick..(k + 1) as f64 * tick;
            solver.advance(&sheet, &mut state, span, &solids, &Still, |_| ()).expect("a step");
            state.bodies[0].position
        })
        .collect()
}

#[test]
fn a_ball_on_a_cloth_does_what_a_free_ball_does() {
    let session = session(&format!("{CLOTH}{FREE}"));
    let ticks = 64;
    let exact = free(&session, 1e-6, ticks);
    let lowest = exact.iter().map(|place| place.y).fold(f64::INFINITY, f64::min);
    let after = exact.iter().skip(28).map(|place| place.y).fold(f64::NEG_INFINITY, f64::max);
    assert!(lowest < 0.0 && after > lowest + 0.05, "it sinks in and comes back: {lowest} {after}");
    let times: Vec<f64> = (1..=ticks).map(|k| k as f64 / 64.0).collect();
    let mut errors = Vec::new();
    for tolerance in [1e-3, 1e-4, 1e-5] {
        let both = values(&session, within(tolerance), &times);
        let apart = exact.iter().zip(&both).map(|(a, b)| (a - Vector::new(b[0], b[1], b[2])).norm());
        errors.push(apart.fold(0.0, f64::max));
    }
    let allowed = [1e-2, 2e-3, 2e-4];
    assert!(errors.iter().zip(allowed).all(|(error, most)| *error < most), "{errors:?}");
}

/// The energy of the ball never exceeds what it had by more than what the cloth loses by sagging, and it comes to rest.
#[test]
fn no_energy_is_made() {
    let session = session(&format!("{CLOTH}{DRAWN}{BALL}"));
    let times: Vec<f64> = (0..320).map(|k| k as f64 / 80.0).collect();
    let energy = |p: &Vec<f64>| 9.81 * p[0] + 0.5 * p[1] * p[1];
    let all: Vec<f64> = values(&session, Settings::default(), &times).iter().map(energy).collect();
    let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(most < all[0] + 0.2 / 0.5 * 9.81 * 0.05, "{most} of {}", all[0]);
    let last = &all[280..];
    let change = last.iter().copied().fold(f64::NEG_INFINITY, f64::max)
        - last.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(change < 0.02 * all[0], "it rests at last: {change}");
}

/// The force at rest is the weight, and a condition on it is located.
#[test]
fn rules_get_the_force_and_events_on_it_are_located() {
    let rule = "initial string: [ @Cloth ] Ball(0.11, 0)
Ball(y, v):
  solve dy/dt = v, dv/dt = -9.81 + force_y/0.5 - 8*v
  if age >= 3 produce Held(force_y, force_y)\n";
    let held = session(&format!("{CLOTH}{DRAWN}{rule}"));
    let force = values(&held, Settings::default(), &[3.5])[0][0];
    assert!((force - 0.5 * 9.81).abs() < 0.05, "{force}");
    let rule = "initial string: [ @Cloth ] Ball(0.3, 0)
Ball(y, v):
  solve dy/dt = v, dv/dt = -9.81 + force_y/0.5
  if force_y >= 12 produce Held(force_y, t)\n";
    let limit = session(&format!("{CLOTH}{DRAWN}{rule}"));
    let ends = |times: &[f64]| values(&limit, Settings::default(), times).pop().expect("values");
    let [force, time] = ends(&[1.0])[..] else { panic!("two values") };
    assert!(force >= 12.0 && (0.2..0.4).contains(&time), "{force} at {time}");
    let on_the_grid = (time * 1048576.0).fract() == 0.0;
    assert!(
        on_the_grid || (force - 12.0).abs() < 1e-9,
        "located, or a jump at the beginning of a part: {force} at {time}"
    );
    assert_eq!(ends(&[0.1, 0.21, 0.3, 1.0]), [force, time], "whatever is observed before");
}

/// The same bits in any order, from copies, and whatever has been drawn.
#[test]
fn the_same_bits_in_any_order_and_with_two_threads() {
    let session = session(&format!("{CLOTH}{DRAWN}{BALL}"));
    let settings = Settings::default();
    let times = [0.1, 0.25, 0.3, 0.41, 0.6];
    let alone: Vec<Vec<f64>> =
        times.iter().map(|time| values(&session, settings, &[*time]).remove(0)).collect();
    assert_eq!(alone, values(&session, settings, &times));
    let mut replay = Replay::new(&session.model, settings).expect("it starts");
    for i in [4, 0, 2, 3, 1, 4, 2] {
        assert_eq!(replay.seek(times[i]).expect("it runs"), Stop::There);
        let string = replay.string().expect("formed");
        assert_eq!(string.get(string.len() - 1).parameters, &alone[i][..]);
    }
    let first = session.simulate(settings).expect("it starts");
    let threads = std::thread::scope(|scope| {
        let run = |time: f64| {
            let mut copy = first.clone();
            scope.spawn(move || {
                let mut string = ModuleString::default();
                copy.at(time, &mut string).expect("it runs");
                string.get(string.len() - 1).parameters.to_vec()
            })
        };
        let all = times.map(run);
        all.map(|thread| thread.join().expect("no panic"))
    });
    assert_eq!(alone[..], threads);
    // Sheets are drawn as they were when they pushed.
    let nursery = Nursery::new(&session.model, settings);
    let draw = |time: f64| {
        let mut string = ModuleString::default();
        session.simulate(settings).expect("it starts").at(time, &mut string).expect("it runs");
        let mut scene = nursery.blank();
        nursery.draw(&string, &mut scene).unwrap_or_else(|error| panic!("{error}"));
        let cloth = scene.surfaces.iter().find(|surface| surface.mesh.vertices.len() == 25).expect("a cloth");
        cloth.mesh.vertices.clone()
    };
    let late = draw(0.41);
    assert!(late[12].y < draw(0.1)[12].y && late == draw(0.41));
    let height = alone[3][0];
    assert!((late[12].y - (height - 0.1)).abs() < 0.02, "the ball lies on it: {} {height}", late[12].y);
}

/// A production in the middle of a contact hands the force on.
#[test]
fn what_takes_the_place_of_a_solid_is_under_its_force() {
    let next = "solid Ball Later
interpret Later(y, v): [ f(y) -(90) f(0.5) ^(90) f(0.5) @O(0.2) ]
initial string: [ @Cloth ] Ball(0.3, 0)
Ball(y, v):
  solve dy/dt = v, dv/dt = -9.81 + force_y/0.5
  if y < -0.01 produce Later(y, v)
Later(y, v): solve dy/dt = v, dv/dt = -9.81 + force_y/0.5\n";
    let times = [0.2, 0.28, 0.3, 0.35, 0.5];
    let one = values(&session(&format!("{CLOTH}{DRAWN}{BALL}")), Settings::default(), &times);
    let two = values(
        &session(&format!("{CLOTH}{}{next}", DRAWN.replace("solid Ball\n", ""))),
        Settings::default(),
        &times,
    );
    for (one, two) in one.iter().flatten().zip(two.iter().flatten()) {
        assert!((one - two).abs() < 1e-9, "{one} {two}");
    }
}

/// Forces are in units of the model, kg·length/time².
#[test]
fn units_are_those_of_the_model() {
    let metres = values(&session(&format!("{CLOTH}{DRAWN}{BALL}")), Settings::default(), &[0.2, 0.3, 0.5]);
    let mesh = cloth_of(10.0);
    let text = format!("units length 0.1, time 0.5\n{CLOTH}{DRAWN}{BALL}")
        .replace("0.01 | x > 0.99", "0.1 | x > 9.9")
        .replace("f(0.5)", "f(5)")
        .replace("@O(0.2)", "@O(2)")
        .replace("Ball(0.3, 0)", "Ball(3, 0)")
        .replace("-9.81", "-9.81*10/4");
    let other = with_mesh(&text, &mesh).unwrap_or_else(|error| panic!("{error}"));
    let other = values(&other, Settings::default(), &[0.4, 0.6, 1.0]);
    for (a, b) in metres.iter().zip(&other) {
        assert!((a[0] * 10.0 - b[0]).abs() < 1e-8 && (a[1] * 5.0 - b[1]).abs() < 1e-8, "{a:?} {b:?}");
    }
}

/// Two cloths at one place carry a ball as one of twice the thickness does.
#[test]
fn two_sheets_push_one_solid() {
    let two = BALL.replace("[ @Cloth ]", "[ @Cloth ] [ @Cloth ]");
    let times = [0.2, 0.3, 0.5, 0.7, 1.0];
    let two = values(&session(&format!("{CLOTH}{DRAWN}{two}")), Settings::default(), &times);
    let thick = CLOTH.replace("thickness 0.001", "thickness 0.002");
    let one = values(&session(&format!("{thick}{DRAWN}{BALL}")), Settings::default(), &times);
    let thin = values(&session(&format!("{CLOTH}{DRAWN}{BALL}")), Settings::default(), &times);
    let apart = |a: &[Vec<f64>]| a.iter().zip(&two).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f64::max);
    assert!(apart(&one) < 0.01 && apart(&thin) > 2.0 * apart(&one), "{} {}", apart(&one), apart(&thin));
}

/// Equations with drag, whose rates depend on the velocity that the force makes.
#[test]
fn equations_may_be_nonlinear() {
    let drag = BALL.replace("force_y/0.5", "force_y/0.5 - 2*v*abs(v) - v");
    let session = session(&format!("{CLOTH}{DRAWN}{drag}"));
    let times: Vec<f64> = (1..=32).map(|k| k as f64 / 32.0).collect();
    let heights = |tolerance: f64| -> Vec<f64> {
        values(&session, within(tolerance), &times).iter().map(|p| p[0]).collect()
    };
    let exact = heights(1e-5);
    let apart = |other: Vec<f64>| exact.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (coarse, fine) = (apart(heights(1e-3)), apart(heights(1e-4)));
    assert!(coarse < 5e-3 && fine < 0.6 * coarse, "{coarse:e} {fine:e}");
}

/// A solid that is gone leaves its sheets behind.
#[test]
fn sheets_go_on_when_the_solid_is_gone() {
    let gone = BALL.trim_end().to_owned() + "\n  if y < 0 produce Rest(y, v)\n";
    let found = values(&session(&format!("{CLOTH}{DRAWN}{gone}")), Settings::default(), &[0.1, 2.0]);
    assert!(found[1][0].abs() < 1e-9, "{found:?}");
}

#[test]
fn mistakes_have_their_place() {
    let model = |text: &str| format!("{CLOTH}{DRAWN}{text}");
    let refused = [
        (model(BALL).replace("solid Ball", ""), "`Ball` is not solid, so that nothing pushes it"),
        (
            model(BALL) + "Stem: if strain > 0.1 produce Stem\ninterpret Stem: F(1)\n",
            "rules read both `strain` and `force_y`",
        ),
        (model(BALL).replace("cloth.obj", "lost.obj"), "there is no file"),
    ];
    for (text, part) in &refused {
        let said = with_mesh(text, &cloth()).err().unwrap_or_else(|| panic!("{text}"));
        assert!(said.contains(part) && said.contains("model.dls:") && said.contains("= help: "), "{said}");
        assert!(!said.contains("the model declares no sheet"), "{said}");
    }
    let against = session(&model(&BALL.replace("+ force_y", "- force_y")));
    let said = message(&against, 1.0);
    assert!(said.contains("do not answer a force as a mass does") && said.contains("model.dls:5:"), "{said}");
    // Its place jumps with the force.
    let massless = session(&model(
        "initial string: [ @Cloth ] Ball(0.2, 0)\nBall(y, v): solve y = 0.2 - 2*t + force_y/50, dv/dt = 0\n",
    ));
    let said = message(&massless, 1.0);
    assert!(
        said.contains("cannot be followed both ways")
            && said.contains("let a force be a part of an acceleration"),
        "{said}"
    );
    let plant = "plant @Other from \"other.dls\"\ninitial string: @Other\n";
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in [("model.dls", plant.to_owned()), ("other.dls", model(BALL)), ("cloth.obj", cloth())]
    {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let outer =
        Session::open(&folder.path().join("model.dls"), &[]).unwrap_or_else(|error| panic!("{error}"));
    let mut string = ModuleString::default();
    outer.simulate(Settings::default()).expect("it starts").at(0.5, &mut string).expect("it runs");
    let nursery = Nursery::new(&outer.model, Settings::default());
    let drawn = nursery.draw(&string, &mut nursery.blank());
    let said = drawn.expect_err("refused").diagnostic().render(&Source::new("model.dls", plant), false);
    assert!(said.contains("the rules of the plant `@Other` read the force of sheets"), "{said}");
}

/// The net of the book slows the ball down.
#[test]
fn the_ball_of_the_book_is_slowed_down() {
    let path = repository("models/scenes/swish.dls");
    let session = Session::open(std::path::Path::new(&path), &[]).expect("a model");
    let times: Vec<f64> = (0..=50).map(|k| 0.3 + k as f64 / 100.0).collect();
    let all = values(&session, Settings::default(), &times);
    let [_, _, u, last] = all[50][..] else { panic!("four values") };
    let falls = -1.0 - 9.81 * times[50];
    assert!((0.3..3.0).contains(&(last - falls)), "{last}, without a net {falls}");
    assert!(u.abs() < 1e-3, "it stays in the middle: {u}");
}
