//! `dlsys report --coupling`, and solids that sheets push though no rule reads the force.

use std::collections::BTreeMap;
use std::process::{Command, Output};

use dlsys::session::Session;
use dlsys::sheet::Vector;
use dlsys::sim::{BendSettings, Settings};
use dlsys::surround::{Trial, TrialTick, Ways};
use serde_json::Value;

use crate::common::repository;
use crate::sheets::{cloth, cloth_of, with_mesh};

fn report(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
    command
        .current_dir(repository(""))
        .args(["report", "--coupling"])
        .args(arguments)
        .output()
        .expect("it starts")
}

/// What is printed, and the JSON file.
fn studied(arguments: &[&str]) -> (String, Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let out = ["-o", folder.path().to_str().expect("UTF-8")];
    let output = report(&[arguments, &out].concat());
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("UTF-8");
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{arguments:?}");
    let mut files: Vec<_> =
        std::fs::read_dir(folder.path()).expect("a folder").map(|e| e.expect("a file").path()).collect();
    files.sort();
    assert_eq!(files.len(), 2);
    let csv = std::fs::read_to_string(&files[0]).expect("read");
    let json: Value = serde_json::from_str(&std::fs::read_to_string(&files[1]).expect("read")).expect("JSON");
    let lines: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(lines, vec![12; 1 + json["forces"].as_array().expect("rows").len()], "{csv}");
    (text(&output.stdout), json)
}

/// The object of a list with a value under a key.
fn of<'a>(list: &'a Value, key: &str, value: &str) -> &'a Value {
    let all = list.as_array().expect("a list");
    all.iter().find(|one| one[key] == value).unwrap_or_else(|| panic!("{value} in {list}"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

fn distance(json: &Value, coupling: &str) -> f64 {
    number(&of(&json["couplings"], "coupling", coupling)["distances"]["Ball"]["max"])
}

fn serves(json: &Value) -> &Value {
    &of(&json["active"], "name", "Ball")["serves"]
}

/// The ball that reads forces, and the one that is given its mass, do the same.
#[test]
fn a_mass_that_is_given_does_what_equations_do() {
    let (text, both) = studied(&["models/scenes/swish.dls"]);
    let (_, one) = studied(&["models/scenes/basketball.dls", "--mass", "Ball=0.68"]);
    for (json, own, measured) in [(&both, "two-way", true), (&one, "one-way", false)] {
        let ball = of(&json["active"], "name", "Ball");
        assert!((number(&ball["mass"]) - 0.68).abs() < 1e-6, "{ball}");
        assert_eq!(
            (ball["coupling"].as_str(), &ball["mass_from_equations"]),
            (Some(own), &Value::Bool(measured))
        );
        assert_eq!(of(&json["couplings"], "coupling", own)["is_own"], true);
        assert_eq!(serves(json), "two-way");
        assert!((number(&ball["own_acceleration"]["mean"]) - 9.81).abs() < 1e-6);
        let rows = of(&json["forces"], "coupling", "two-way");
        let (force, acceleration) = (&rows["force"], &rows["acceleration"]);
        for part in ["max", "mean"] {
            let ratio = number(&force[part]) / number(&acceleration[part]);
            assert!((ratio - 0.68).abs() < 1e-3, "{part}: {ratio}");
        }
        // Of the order of the paper's 59.9 N and 15.7 N, with another net and another throw.
        assert!(
            (40.0..80.0).contains(&number(&force["max"])) && (10.0..25.0).contains(&number(&force["mean"]))
        );
    }
    let mean =
        |json: &Value, coupling: &str| number(&of(&json["forces"], "coupling", coupling)["force"]["mean"]);
    for coupling in ["two-way", "one-way"] {
        let (a, b) = (mean(&both, coupling), mean(&one, coupling));
        assert!((a - b).abs() < 1e-3 * a, "{coupling}: {a} {b}");
    }
    assert!((distance(&both, "one-way") - distance(&one, "one-way")).abs() < 1e-3);
    assert!(distance(&both, "two-way") < 5e-3 && distance(&both, "one-way") > 0.3);
    assert!(text.contains("two-way serves, and the model has it"), "{text}");
    let without: Vec<&str> =
        both["not_measured"].as_array().expect("notes").iter().filter_map(Value::as_str).collect();
    assert!(without.iter().any(|note| note.contains("moments of sheets")), "{without:?}");
}

#[test]
fn without_a_mass_nothing_is_decided() {
    let (text, json) = studied(&["models/scenes/basketball.dls"]);
    let ball = of(&json["active"], "name", "Ball");
    assert!(ball["mass"].is_null() && ball["serves"].is_null());
    assert_eq!(json["couplings"].as_array().map(Vec::len), Some(1));
    assert!(text.contains("not decided") && text.contains("--mass Ball=KG"), "{text}");
    assert!(json["couplings"][0]["distances"].as_object().is_some_and(serde_json::Map::is_empty));
}

/// The tree is walked to each of its leaves.
#[test]
fn the_decision_follows_the_numbers() {
    let model = "models/scenes/basketball.dls";
    let (_, heavy) = studied(&[model, "--mass", "Ball=1000"]);
    assert_eq!(serves(&heavy), "one-way");
    let (_, driven) = studied(&[model, "--mass", "Ball=1000", "--limit", "stretch=0.01"]);
    assert_eq!(serves(&driven), "two-way");
    let (_, overwhelmed) = studied(&[model, "--mass", "Ball=30", "--limit", "overwhelmed=0.5"]);
    assert_eq!(serves(&overwhelmed), "one-way");
    let slow = ["--mass", "Ball=0.68", "--limit", "patience=1e-9"];
    let (text, none) = studied(&[&[model][..], &slow].concat());
    assert!(serves(&none).is_null() && text.contains("write a stand-in"), "{text}");
    let hybrid = ["models/scenes/stand-in.dls", "--without", "damping=0"];
    let (_, json) = studied(&[&hybrid[..], &slow].concat());
    assert_eq!(serves(&json), "hybrid");
    assert_eq!(of(&json["couplings"], "coupling", "hybrid")["is_own"], true);
    // A stand-in is nearer to both ways than nothing.
    let all = ["two-way", "hybrid", "one-way"].map(|coupling| distance(&json, coupling));
    assert!(all[0] < 0.2 * all[1] && all[1] < 0.2 * all[2], "{all:?}");
    let (text, _) = studied(&["models/scenes/stand-in.dls"]);
    assert!(text.contains("if that is a stand-in for a sheet, the model is hybrid"), "{text}");
}

#[test]
fn stems_pass_on_moments() {
    let (text, json) = studied(&["models/scenes/snap.dls", "--at", "9"]);
    let stem = of(&json["stems"], "name", "S");
    assert!(number(&stem["moment"]["max"]) > 1.0 && number(&stem["strain"]) < 0.0101, "{stem}");
    assert_eq!(stem["coupling"], "two-way");
    assert!(
        text.contains("rules of S read `strain`") && text.contains("force that they pass on is not measured")
    );
}

#[test]
fn what_cannot_be_measured_is_told() {
    let (ball, swish) = ("models/scenes/basketball.dls", "models/scenes/swish.dls");
    let cases: [(&[&str], i32, &str); 9] = [
        (&["models/leaf.dls"], 1, "nothing passive in it touches an active part"),
        (&["models/scenes/footprints.dls"], 1, "the force of soil on what presses is not measured"),
        (&["models/scenes/flag.dls"], 1, "nothing is `solid`"),
        (&[ball, "--at", "0.1"], 1, "no solid touches a sheet up to t = 0.1"),
        (&[ball, "--mass", "Bell=1"], 2, "there is no solid `Bell`; solid are `Ball`"),
        (&[ball, "--mass", "Ball=0"], 2, "greater than 0"),
        (&[swish, "--mass", "Ball=1"], 2, "its mass follows from its equations"),
        (&[swish, "--limit", "size=1"], 2, "limits are negligible, overwhelmed, unseen, stretch, patience"),
        (&[ball, "--without", "damping=0"], 2, "damping"),
    ];
    for (arguments, status, part) in cases {
        let output = report(arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {said}");
        assert!(said.contains(part) && output.stdout.is_empty(), "{arguments:?}: {said}");
    }
}

/// A cloth of 1 by 1 m and 0.2 kg, held along two sides, and a ball above its middle.
const CLOTH: &str = "tissue silk = stiffness 1e6, density 200, damping 0.1, thickness 0.001
sheet @Cloth from \"cloth.obj\" of silk pinned x < 0.01 | x > 0.99
";
const DRAWN: &str = "interpret Ball(y, v): [ f(y) -(90) f(0.5) ^(90) f(0.5) @O(0.2) ]\n";
const FALLS: &str = "solid Ball
initial string: [ @Cloth ] Ball(0.3, 0)
Ball(y, v): solve dy/dt = v, dv/dt = -9.81
";

fn session(text: &str, mesh: &str) -> Session {
    with_mesh(text, mesh).unwrap_or_else(|error| panic!("{error}"))
}

/// The ticks of a model whose balls have a mass of 0.5 kg.
fn ticks(session: &Session, until: f64, is_pushed: bool) -> Vec<TrialTick> {
    let kinds = session.model.scenery.solids.iter().map(|(kind, _)| (*kind, 0.5));
    let masses: BTreeMap<_, _> =
        kinds.filter(|(kind, _)| !session.model.kinds.get(*kind).reads_force()).collect();
    let ways = if is_pushed { Ways::Pushed(masses) } else { Ways::Own };
    let settings = Settings::default();
    let settings = Settings { bending: BendSettings { tolerance: 1e-4, ..settings.bending }, ..settings };
    let mut trial = Trial::new(&session.model, settings, ways).expect("it starts").expect("a sheet");
    std::iter::from_fn(|| trial.tick(until).unwrap_or_else(|error| panic!("{error}"))).collect()
}

fn places(ticks: &[TrialTick]) -> Vec<Vector> {
    ticks.iter().map(|tick| tick.solids[0].places[1]).collect()
}

fn apart(a: &[Vector], b: &[Vector]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// What the impulses and the weight do to a momentum is what the ball does.
#[test]
fn impulses_are_changes_of_momentum() {
    let pushed = ticks(&session(&format!("{CLOTH}{DRAWN}{FALLS}"), &cloth()), 1.0, true);
    let mut sum = Vector::zeros();
    for tick in &pushed {
        let ball = &tick.solids[0];
        sum += ball.impulses.values().sum::<Vector>()
            - Vector::y() * (9.81 * 0.5 * (tick.span[1] - tick.span[0]));
        assert!((sum - ball.velocities[1] * 0.5).norm() < 1e-3, "{sum} {}", ball.velocities[1] * 0.5);
        assert!(ball.light.is_some_and(|light| (light[(1, 1)] - 2.0).abs() < 1e-9));
    }
    assert!(pushed.iter().any(|tick| tick.solids[0].velocities[1].y > 0.1), "it is thrown back");
    // Guided, the ball falls on, whatever the cloth does.
    let own = ticks(&session(&format!("{CLOTH}{DRAWN}{FALLS}"), &cloth()), 0.4, false);
    for tick in &own {
        let fallen = 0.3 - 4.905 * tick.span[1] * tick.span[1];
        assert!((tick.solids[0].places[1].y - fallen).abs() < 1e-9);
    }
    let last = &own[own.len() - 1];
    assert!(last.solids[0].impulses[&0].y > 0.0 && last.sheets[0].stretch > 0.1);
    assert!((last.sheets[0].mass - 0.2).abs() < 1e-9);
}

/// A production in the middle of a contact hands the deviation on, and equations that read the force give the same.
#[test]
fn what_takes_the_place_of_a_solid_deviates_on() {
    let one = places(&ticks(&session(&format!("{CLOTH}{DRAWN}{FALLS}"), &cloth()), 0.6, true));
    let next = "solid Ball Later
interpret Later(y, v): [ f(y) -(90) f(0.5) ^(90) f(0.5) @O(0.2) ]
initial string: [ @Cloth ] Ball(0.3, 0)
Ball(y, v):
  solve dy/dt = v, dv/dt = -9.81
  if y < -0.01 produce Later(y, v)
Later(y, v): solve dy/dt = v, dv/dt = -9.81\n";
    let two = places(&ticks(&session(&format!("{CLOTH}{DRAWN}{next}"), &cloth()), 0.6, true));
    assert!(apart(&one, &two) < 1e-6, "{}", apart(&one, &two));
    // All axes, as a mass has them.
    let reads = "solid Ball
interpret Ball(x, y, z, u, v, w): [ f(y) -(90) f(x) ^(90) f(z) @O(0.2) ]
initial string: [ @Cloth ] Ball(0.5, 0.3, 0.5, 0, 0, 0)
Ball(x, y, z, u, v, w):
  solve dx/dt = u, dy/dt = v, dz/dt = w, du/dt = force_x/0.5, dv/dt = -9.81 + force_y/0.5, dw/dt = force_z/0.5\n";
    let read = places(&ticks(&session(&format!("{CLOTH}{reads}"), &cloth()), 0.6, true));
    assert!(apart(&one, &read) < 1e-3, "{}", apart(&one, &read));
}

/// Forces are in N, whatever the units of the model.
#[test]
fn trials_are_in_si() {
    let metres = ticks(&session(&format!("{CLOTH}{DRAWN}{FALLS}"), &cloth()), 0.5, true);
    let mesh = cloth_of(10.0);
    let text = format!("units length 0.1, time 0.5\n{CLOTH}{DRAWN}{FALLS}")
        .replace("0.01 | x > 0.99", "0.1 | x > 9.9")
        .replace("f(0.5)", "f(5)")
        .replace("@O(0.2)", "@O(2)")
        .replace("Ball(0.3, 0)", "Ball(3, 0)")
        .replace("-9.81", "-9.81*10/4");
    let other = ticks(&session(&text, &mesh), 1.0, true);
    assert_eq!(metres.len(), other.len());
    for (a, b) in metres.iter().zip(&other) {
        let (a, b) = (&a.solids[0], &b.solids[0]);
        let sum = |solid: &dlsys::surround::SolidSeen| solid.impulses.values().sum::<Vector>();
        assert!((sum(a) - sum(b)).norm() < 1e-6 && (a.places[1] - b.places[1]).norm() < 1e-7, "{a:?} {b:?}");
    }
}

/// One-way, a ball takes a cloth along to three times its length and back, at 60 m/s; then it is gone. Nothing grows without bound, and the cloth comes to rest.
#[test]
fn one_way_stays_stable_when_it_is_driven_too_far() {
    let driven = "solid Ball
initial string: [ @Cloth ] Ball(0.3, -60)
Ball(y, v):
  solve dy/dt = v, dv/dt = 0
  if y < -1.5 & v < 0 produce Ball(y, 60)
  if y > 0.3 & v > 0 produce Gone\n";
    let session = session(&format!("{CLOTH}{DRAWN}{driven}"), &cloth());
    let settings = Settings::default();
    let mut trial = Trial::new(&session.model, settings, Ways::Own).expect("it starts").expect("a sheet");
    let mut stretches = Vec::new();
    while let Some(tick) = trial.tick(6.0).unwrap_or_else(|error| panic!("{error}")) {
        stretches.push(tick.sheets[0].stretch);
    }
    let most = stretches.iter().copied().fold(0.0, f64::max);
    assert!((1.0..6.0).contains(&most), "{most}");
    let late = stretches[stretches.len() - 64..].iter().copied().fold(0.0, f64::max);
    assert!(late < 0.05, "{late} of {most}");
    let counts = trial.counts();
    assert!(counts.steps + counts.rejected < 100 * stretches.len() as u64, "{counts:?}");
}

fn of_the_book(name: &str) -> Session {
    Session::open(&repository(&format!("models/scenes/{name}.dls")), &[])
        .unwrap_or_else(|error| panic!("{error}"))
}

/// The body of the book bounces, each time lower, and never has more energy than at the beginning.
#[test]
fn a_trampoline_gives_back_no_more_than_it_got() {
    let session = of_the_book("trampoline");
    let settings = Settings::default();
    let mut trial = Trial::new(&session.model, settings, Ways::Pushed(BTreeMap::new()))
        .expect("it starts")
        .expect("a bed");
    let (mut tops, mut before, mut first) = (Vec::new(), 0.0, None);
    while let Some(tick) = trial.tick(4.0).unwrap_or_else(|error| panic!("{error}")) {
        let body = &tick.solids[0];
        let (place, velocity) = (body.places[1].y, body.velocities[1].y);
        let first = *first.get_or_insert(body.places[0].y);
        assert!(9.81 * place + 0.5 * velocity * velocity < 9.81 * first + 1e-6, "{tick:?}");
        if velocity < 0.0 && before >= 0.0 {
            tops.push(place);
        }
        before = velocity;
    }
    assert!(tops.len() >= 4, "{tops:?}");
    assert!(tops.windows(2).all(|pair| pair[1] < pair[0] - 0.02), "{tops:?}");
}

/// The body of the book comes to rest on its mat, which it presses down without stretching it far.
#[test]
fn a_mat_is_pressed_down() {
    let session = of_the_book("mat");
    let mut trial =
        Trial::new(&session.model, Settings::default(), Ways::Own).expect("it starts").expect("a mat");
    let mut ticks = Vec::new();
    while let Some(tick) = trial.tick(1.5).unwrap_or_else(|error| panic!("{error}")) {
        ticks.push(tick);
    }
    let last = ticks.last().expect("a tick");
    let push = last.solids[0].impulses[&0].y / (last.span[1] - last.span[0]);
    // The stand-in was chosen to carry the body where the mat would.
    assert!((0.7..1.3).contains(&(push / (64.38 * 9.81))), "{push}");
    assert!(last.solids[0].velocities[1].norm() < 1e-2);
    assert!(ticks.iter().all(|tick| tick.sheets[0].stretch < 0.2));
}

/// `explain` tells which models may be hybrid.
#[test]
fn explain_tells_the_coupling_of_sheets() {
    let explain = |name: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
        let file = format!("models/scenes/{name}.dls");
        let output =
            command.current_dir(repository("")).args(["explain", &file]).output().expect("it starts");
        let said = String::from_utf8(output.stdout).expect("UTF-8");
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let hybrid = ["Ball", "Body"].map(|name| format!("hybrid, if what the equations of {name} do"));
    assert!(explain("stand-in").contains(&hybrid[0]) && explain("mat").contains(&hybrid[1]));
    let one_way = explain("basketball");
    assert!(
        one_way.contains("one way: no rule reads what it does") && !one_way.contains("hybrid"),
        "{one_way}"
    );
    assert!(explain("trampoline").contains("two ways: rules of Body read `force_y`"));
}

/// In a session, too.
#[test]
fn a_session_has_the_report() {
    use std::io::Write;
    let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
    command.current_dir(repository("")).args(["repl", "models/scenes/basketball.dls"]);
    let (input, output) = (std::process::Stdio::piped(), std::process::Stdio::piped());
    let mut child =
        command.stdin(input).stdout(output).stderr(std::process::Stdio::piped()).spawn().expect("it starts");
    let lines = b"report --coupling --mass Ball=0.68\nreport --coupling --without a=1\nquit\n";
    child.stdin.take().expect("piped").write_all(lines).expect("written");
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("two-way serves, and the model is one-way"), "{said}");
    assert!(said.contains("use it on the command line, not in a session"), "{said}");
}
