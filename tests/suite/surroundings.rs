//! Wind and stems that bend, as the commands show them: samples of the wind, axes with frequencies, methods and tolerances.

use std::io::Write;
use std::process::{Command, Output, Stdio};

use dlsys::scene::Vector;
use dlsys::session::Session;
use dlsys::surround::Weather;
use serde_json::Value;

const GUSTS: &str = "units length 0.1, time 2\nwind 1, 0, 0 speed 3 + sin(t) turbulence 0.3 scale 4 roughness 0.03\n\
    tissue stalk = stiffness 2e8, density 900, damping 0.05\ninitial string: @E(stalk) Stalk(0) @L(0.5)\n\
    Stalk(x): solve dx/dt = 3 - x\ninterpret Stalk(x): !(0.05) F(x)\nframes 0 .. 2 step 0.5\n";
/// A cantilever of 1 m and 1 cm, in 20 pieces.
const POLE: &str = "tissue wood = stiffness 1e10, density 500, damping 0.02\n\
    initial string: @E(wood) for i in 1 .. 20: ( A )\ninterpret A: !(0.01) F(0.05)\nframes 0 .. 4 step 1\n";

fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

/// Runs the program in a folder, with this standard input.
fn dlsys(folder: &tempfile::TempDir, arguments: &str, input: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
    command.current_dir(folder.path()).args(arguments.split(' '));
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    let written = child.stdin.take().map(|mut stdin| stdin.write_all(input.as_bytes()));
    // A command that fails early does not read all.
    drop(written);
    child.wait_with_output().expect("it ends")
}

fn good(folder: &tempfile::TempDir, arguments: &str) -> String {
    let output = dlsys(folder, arguments, "");
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), &*error), (Some(0), ""), "{arguments}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

fn numbers(csv: &str) -> Vec<Vec<f64>> {
    let line = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    csv.lines().skip(1).map(line).collect()
}

#[test]
fn the_field_is_the_wind_of_the_library() {
    let folder = folder(&[("gusts.dls", GUSTS), ("places.csv", "x,y,z\n0,10,0\n\n-3, 2.5 ,1e1\n")]);
    let csv = good(&folder, "run gusts.dls --field places.csv --at 0.5,2");
    assert!(csv.starts_with("t,x,y,z,u,v,w\n0.5,0,10,0,"), "{csv}");
    let session = Session::open(&folder.path().join("gusts.dls"), &[]).expect("a good model");
    let weather = Weather::of(&session.model, Default::default()).expect("a wind").expect("there is one");
    let rows = numbers(&csv);
    assert_eq!(rows.len(), 4);
    for row in rows {
        // Two seconds and a decimetre in a unit.
        let snapshot = weather.field().at(2.0 * row[0]).expect("a time");
        let velocity = snapshot.velocity(Vector::new(row[1], row[2], row[3]) * 0.1);
        assert_eq!(row[4..], [velocity.x, velocity.y, velocity.z]);
    }
    let json = good(&folder, "run gusts.dls --field places.csv --at 0.5,2 --format json");
    let of_json: Vec<Vec<f64>> = (json.lines())
        .map(|line| {
            let row: Value = serde_json::from_str(line).expect("JSON");
            ["t", "x", "y", "z", "u", "v", "w"].map(|name| row[name].as_f64().expect("a number")).to_vec()
        })
        .collect();
    assert_eq!(of_json, numbers(&csv));
}

#[test]
fn places_may_have_times_and_come_through_a_pipe() {
    let folder = folder(&[("gusts.dls", GUSTS), ("places.csv", "x,y,z\n0,10,0\n4,1,2\n")]);
    let all = good(&folder, "run gusts.dls --field places.csv --at 0.5,2");
    let timed = "t,x,y,z\r\n0.5,0,10,0\r\n0.5,4,1,2\r\n2,0,10,0\r\n2,4,1,2";
    let piped = dlsys(&folder, "run gusts.dls --field -", timed);
    assert_eq!(String::from_utf8_lossy(&piped.stdout), all);
    let places = "x,y,z\n0,10,0\n4,1,2\n";
    assert_eq!(
        String::from_utf8_lossy(&dlsys(&folder, "run gusts.dls --field - --at 2,0.5", places).stdout),
        all
    );
}

/// A vortex whose axis turns from the vertical to x: the air circles around the axis of each instant.
#[test]
fn the_axis_of_a_vortex_follows_t() {
    let turning = "units length 1, time 2\nflow vortex 4 at 0, 0, 0 axis sin(pi*t/2), cos(pi*t/2), 0\ninitial string: F(1)\n";
    let upright = turning.replace("sin(pi*t/2), cos(pi*t/2), 0", "0, 1, 0");
    let lying = turning.replace("sin(pi*t/2), cos(pi*t/2), 0", "1, 0, 0");
    let folder = folder(&[("turning.dls", turning), ("upright.dls", &upright), ("lying.dls", &lying)]);
    let at = |name: &str, t: f64| {
        let places = format!("t,x,y,z\n{t},0.5,0.25,1\n{t},2,-1,0.5\n");
        let rows = numbers(&String::from_utf8_lossy(
            &dlsys(&folder, &format!("run {name} --field -"), &places).stdout,
        ));
        assert_eq!(rows.len(), 2, "{name} at {t}");
        rows.into_iter().flat_map(|row| row[4..].to_vec()).collect::<Vec<f64>>()
    };
    for (t, still) in [(0.0, "upright.dls"), (1.0, "lying.dls"), (2.0, "upright.dls")] {
        let sign = if t == 2.0 { -1.0 } else { 1.0 };
        for (turning, still) in at("turning.dls", t).into_iter().zip(at(still, t)) {
            assert!((turning - sign * still).abs() < 1e-12, "t = {t}: {turning}, {still}");
        }
    }
}

/// Values that read `t` may have no meaning at some time: the message quotes their declaration, not that of a tissue.
#[test]
fn winds_without_a_value_at_some_time_are_shown_where_they_are_declared() {
    let no_axis = format!("flow vortex 2 at 0, 1, 0 axis 0, max(0, 1 - t), 0\n{POLE}");
    let no_speed = format!("wind 1, 0, 0 speed sqrt(1 - t)\n{POLE}");
    for (text, message) in
        [(&no_axis, "the axis of flow 1 is (0, 0, 0) at "), (&no_speed, "the speed of the wind is NaN at ")]
    {
        let folder = folder(&[("bad.dls", text)]);
        for (arguments, place) in [
            ("render bad.dls --at 3 -o out --format svg", "bad.dls:1:1"),
            ("run bad.dls --field -", "standard input:2:1"),
        ] {
            let output = dlsys(&folder, arguments, "t,x,y,z\n3,0,1,0\n");
            let error = String::from_utf8_lossy(&output.stderr);
            assert!(error.contains(message) && error.contains(place), "{arguments}: {error}");
            assert_eq!(output.status.code(), Some(1), "{arguments}");
        }
    }
}

#[test]
fn mistakes_in_the_places_are_shown_with_their_line() {
    let folder = folder(&[("gusts.dls", GUSTS), ("pole.dls", POLE)]);
    for (arguments, input, status, message) in [
        ("gusts.dls --field -", "x,y,z\n1,2,3\n1, two,3\n", 1, "standard input:3:4: `two` is not a number"),
        ("gusts.dls --field -", "x,y,z\n1,2,inf\n", 1, "standard input:2:5: `inf` is not a finite number"),
        ("gusts.dls --field -", "x,y,z\n1,2\n", 1, "standard input:2:1: expected 3 values, found 2"),
        ("gusts.dls --field -", "1,2,3\n", 1, "expected the names of the columns in the first line"),
        ("gusts.dls --field -", "t,x,y,z\n1e300,2,3,4\n", 1, "standard input:2:1: the wind has no value"),
        ("gusts.dls --at 1 --field -", "t,x,y,z\n1,2,3,4\n", 2, "standard input has a column `t`"),
        ("gusts.dls --field missing.csv", "", 1, "cannot read missing.csv"),
        ("pole.dls --field -", "x,y,z\n1,2,3\n", 2, "pole.dls has no wind to sample"),
    ] {
        let output = dlsys(&folder, &format!("run {arguments}"), input);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(error.contains(message), "{arguments}: {error}");
        assert_eq!(output.status.code(), Some(status), "{arguments}");
    }
}

fn explained(folder: &tempfile::TempDir, name: &str) -> Value {
    serde_json::from_str(&good(folder, &format!("explain {name} --format json"))).expect("JSON")
}

/// The single value of a range of equal axes.
fn value(axis: &Value, name: &str) -> f64 {
    let range = &axis[name];
    assert_eq!(range[0], range[1], "{name}");
    range[0].as_f64().unwrap_or_else(|| panic!("no {name}: {axis}"))
}

#[test]
fn an_axis_has_the_frequency_and_the_stability_of_a_cantilever() {
    let windy = format!("wind 1, 0, 0 speed 6\n{POLE}");
    let folder = folder(&[("pole.dls", POLE), ("windy.dls", &windy)]);
    let plan = explained(&folder, "windy.dls");
    let axes = plan["bending"]["axes"].as_array().expect("a list");
    assert_eq!(axes.len(), 1);
    let axis = &axes[0];
    let inertia = std::f64::consts::PI * 1e-8 / 64.0;
    let (rigidity, mass) = (1e10 * inertia, 500.0 * std::f64::consts::PI * 1e-4 / 4.0);
    assert_eq!((value(axis, "segments"), &axis["kinds"][0]), (20.0, &Value::from("A")));
    assert!((value(axis, "mass") / mass - 1.0).abs() < 1e-9);
    // Greenhill's length, and a frequency that the weight lowers in proportion to the load factor (Rayleigh's quotient).
    let ratio = (mass * 9.81 / (7.837347 * rigidity)).cbrt();
    assert!((value(axis, "greenhill") / ratio - 1.0).abs() < 2e-3, "{axis}");
    let free = 1.875104f64.powi(2) / std::f64::consts::TAU * (rigidity / mass).sqrt();
    let under_weight = free * (1.0 - ratio.powi(3)).sqrt();
    assert!((value(axis, "frequency") / under_weight - 1.0).abs() < 5e-3, "{under_weight}: {axis}");
    assert!((value(axis, "damping") / (0.02 * under_weight) - 1.0).abs() < 2e-2, "{axis}");
    let cauchy = 0.5 * 1.2 * 1.1 * 0.01 * 36.0 / rigidity;
    assert!((value(axis, "cauchy") / cauchy - 1.0).abs() < 1e-9, "{axis}");
    assert_eq!(plan["bending"]["ticks"], 120.0);
    assert!(explained(&folder, "pole.dls")["bending"]["axes"][0]["cauchy"].is_null());
}

/// One F bends to one curvature: what is said of that is what comes out, against an axis of many.
#[test]
fn axes_of_few_segments_are_told_from_rods() {
    let axis = |pieces: u32| {
        let text = format!(
            "tissue wood = stiffness 1e10, density 500, damping 0.02\nwind 1, 0, 0 speed 1\n\
             initial string: @E(wood) !(0.01) for i in 1 .. {pieces}: ( F(1/{pieces}) )\nframes 0 .. 1 step 1"
        );
        let folder = folder(&[("axis.dls", &text)]);
        (explained(&folder, "axis.dls")["bending"]["axes"][0].clone(), good(&folder, "explain axis.dls"))
    };
    let (rod, _) = axis(40);
    for (pieces, less, higher) in [(1, "33", 29.0), (2, "8.3", 5.0), (3, "3.7", 2.0)] {
        let (few, said) = axis(pieces);
        let found = 100.0 * (value(&few, "frequency") / value(&rod, "frequency") - 1.0);
        assert!((found - higher).abs() < 1.0, "{pieces}: {found}");
        let note = said.split_whitespace().collect::<Vec<_>>().join(" ");
        let expected = format!("sags {less} % less than a rod, and its frequency is {higher} % higher");
        assert!(note.contains(&expected) && note.contains("`for i in 1 .. 5: ( F(x/5) )`"), "{said}");
        assert_eq!(few["few"], 1);
    }
    // A shoot that has just begun is none of the long ones.
    let text = "tissue wood = stiffness 1e10, density 500, damping 0.02\n\
        initial string: @E(wood) !(0.01) [ F(1) F(1) F(1) F(1) ] [ F(1) ] [ F(1) F(1) ]\nframes 0 .. 1 step 1";
    let folder_of_shoots = folder(&[("shoots.dls", text)]);
    let shoots = &explained(&folder_of_shoots, "shoots.dls")["bending"]["axes"][0];
    assert!(shoots["count"] == 3 && shoots["few"] == 1, "{shoots}");
    let said = good(&folder_of_shoots, "explain shoots.dls");
    let note = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(note.contains("note: an axis of 2 segments sags 8.3 %"), "{said}");
    assert!(note.contains("1 of them has fewer than 4"), "{said}");
    let (enough, said) = axis(4);
    assert!(enough["few"] == 0 && !said.contains("note:") && !said.contains("F(x/5)"), "{said}");
}

#[test]
fn explain_says_what_makes_stems_work() {
    let sagging = POLE.replace("damping 0.02", "damping 0.02, sag");
    let slender = sagging.replace("!(0.01)", "!(0.001)");
    let folder = folder(&[
        ("still.dls", POLE),
        ("sagging.dls", &sagging),
        ("slender.dls", &slender),
        ("gusts.dls", GUSTS),
    ]);
    let class = |name: &str| {
        let plan = explained(&folder, name);
        let scene = plan["scene"].as_array().expect("a list").clone();
        let stems = scene.into_iter().find(|part| part["part"] == "stems").expect("a part");
        (stems["class"].as_str().unwrap_or("").to_owned(), stems["why"].as_str().unwrap_or("").to_owned())
    };
    assert_eq!(class("still.dls").0, "nothing to do");
    let (sags, why) = class("sagging.dls");
    assert!(sags == "in steps" && why.starts_with("their weight does (`sag`: wood); 120 ticks"), "{why}");
    let (blown, why) = class("gusts.dls");
    assert!(blown == "in steps" && why.contains("the wind moves them") && why.contains("growth"), "{why}");
    assert!(good(&folder, "explain slender.dls").contains("warning: longer than Greenhill's length"));
    assert!(!good(&folder, "explain sagging.dls").contains("warning"));
}

#[test]
fn explain_tells_stems_that_act_on_growth_and_those_of_plants() {
    let snapping = "tissue wood = stiffness 1e9, density 500, damping 0.1\nwind 1, 0, 0 speed 3\n\
        initial string: @E(wood) S\nS: if strain >= 0.1 produce F\ninterpret S: !(0.01) F(1)\nframes 0 .. 4 step 1\n";
    let meadow = "units length 0.1, time 2\nwind 0, 0, 1 speed 2 + t\nplant @Grass from \"gusts.dls\"\n\
        initial string: @Grass\nframes 0 .. 3 step 1\n";
    let garden = "units length 0.1, time 2\nplant @Meadow from \"meadow.dls\"\ninitial string: @Meadow\nframes 0 .. 3 step 1\n";
    let folder = folder(&[
        ("snapping.dls", snapping),
        ("gusts.dls", GUSTS),
        ("meadow.dls", meadow),
        ("garden.dls", garden),
    ]);
    let told = |name: &str| {
        good(&folder, &format!("explain {name}")).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let snapping = told("snapping.dls");
    assert!(snapping.contains("two ways: rules of S read `strain`"), "{snapping}");
    assert!(told("gusts.dls").contains("one way: no rule reads `strain`"));
    let plan = explained(&folder, "meadow.dls");
    let of_grass = &plan["bending_of_plants"][0];
    assert_eq!(plan["bending"], Value::Null);
    assert_eq!((of_grass["plant"].as_str(), of_grass["wind"].as_f64()), (Some("@Grass"), Some(5.0)));
    let alone = explained(&folder, "gusts.dls");
    assert_eq!(of_grass["axes"][0]["frequency"], alone["bending"]["axes"][0]["frequency"]);
    let meadow = told("meadow.dls");
    assert!(meadow.contains("stems of @Grass in steps the wind moves them"), "{meadow}");
    assert!(meadow.contains("made of stalk"), "{meadow}");
    // The wind of a plant's own model does not blow in the scene around it.
    let garden = told("garden.dls");
    assert!(garden.contains("stems of @Grass in @Meadow") && !garden.contains("mean wind"), "{garden}");
}

#[test]
fn the_tolerance_of_bending_changes_stems_only() {
    let plain = GUSTS
        .replace("@E(stalk) ", "")
        .replace("tissue stalk = stiffness 2e8, density 900, damping 0.05\n", "");
    let folder = folder(&[("gusts.dls", GUSTS), ("plain.dls", &plain)]);
    let mesh = |model: &str, flags: &str| {
        good(&folder, &format!("render {model} -o out --force --quiet --format obj --at 0.3{flags}"));
        std::fs::read_to_string(folder.path().join("out/frame-0000.obj")).expect("written")
    };
    let default = mesh("gusts.dls", "");
    assert_eq!(mesh("gusts.dls", " --bend-tolerance 1e-3 --bend-method ros2"), default);
    assert_ne!(mesh("gusts.dls", " --bend-tolerance 1e-5"), default);
    assert_ne!(mesh("gusts.dls", " --bend-method euler"), default);
    assert_eq!(mesh("plain.dls", " --bend-tolerance 1e-5"), mesh("plain.dls", ""));
    for wrong in ["1e-10", "0.2", "-1e-3", "nan"] {
        let output = dlsys(&folder, &format!("run gusts.dls --bend-tolerance {wrong}"), "");
        assert_eq!(output.status.code(), Some(2), "{wrong}");
    }
}

#[test]
fn a_report_compares_methods_of_bending() {
    // Turbulence costs milliseconds an instant.
    let smooth = GUSTS.replace(" turbulence 0.3 scale 4", "").replace("3 + sin(t)", "9 + 6 * sin(4 * t)");
    let folder = folder(&[("gusts.dls", &smooth)]);
    let table = good(&folder, "report gusts.dls --methods auto --runs 1 --time-limit 2 --budget 40 -o out");
    assert!(table.contains("stems that bend, at 5 times, against ros"), "{table}");
    let csv = std::fs::read_to_string(folder.path().join("out/gusts-stems.csv")).expect("written");
    let error = |start: &str| -> f64 {
        let line =
            csv.lines().find(|line| line.starts_with(start)).unwrap_or_else(|| panic!("{start}: {csv}"));
        line.split(',').nth(2).and_then(|cell| cell.parse().ok()).expect("a number")
    };
    for method in ["ros2", "ros34pw2"] {
        let [loose, tight] = ["1e-2", "1e-6"].map(|tolerance| error(&format!("{method},{tolerance},")));
        assert!(tight < 1e-3 && tight < loose, "{csv}");
    }
}

/// Some ten seconds in a debug build.
#[test]
#[ignore]
fn the_report_of_the_surroundings_has_all_its_tables() {
    let folder = folder(&[]);
    let output = dlsys(&folder, "report --surroundings -o out", "");
    let table = String::from_utf8_lossy(&output.stdout);
    for part in [
        "exact cases",
        "hard cases",
        "a stalk in gusts",
        "falling: exact cases",
        "gas: exact cases",
        "gas: speed",
        "sheets: exact cases",
        "a net of 0.03 kg",
        "sheets: speed",
        "ground: exact cases",
        "ground: speed",
        "400 of 400",
        "statistics of the turbulence",
        "speed on one core",
    ] {
        assert!(table.contains(part), "{part}: {table}");
    }
    let csv = std::fs::read_to_string(folder.path().join("out/surroundings.csv")).expect("written");
    assert!(csv.lines().count() > 80 && csv.contains("stems,\"end load"), "{csv}");
    assert!(csv.contains("falling,\"flutter") && csv.contains("gas,\"rigid rotation"), "{csv}");
    assert!(csv.contains("sheets,\"chain between") && csv.contains("ground,\"collapsing cylinder"), "{csv}");
}
