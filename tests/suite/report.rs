//! `dlsys report`: tables, files, plots; verdicts on wrong results; hard cases.

use std::path::Path;
use std::process::{Command, Output};

use crate::common::repository;

fn report(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
    command.current_dir(repository("")).arg("report").args(arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

fn good(arguments: &[&str]) -> String {
    let output = report(arguments);
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{arguments:?}");
    text(&output.stdout)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).expect("written")
}

/// The fields of a CSV file that has no quoted line breaks, by line.
fn fields(csv: &str) -> Vec<Vec<String>> {
    let split = |line: &str| {
        let (mut fields, mut quoted) = (vec![String::new()], false);
        for c in line.chars() {
            match c {
                '"' => quoted = !quoted,
                ',' if !quoted => fields.push(String::new()),
                c => fields.last_mut().expect("a field").push(c),
            }
        }
        fields
    };
    csv.lines().map(split).collect()
}

/// One column of a CSV file.
fn column<'a>(lines: &'a [Vec<String>], name: &str) -> Vec<&'a str> {
    let at = lines[0].iter().position(|head| head == name).unwrap_or_else(|| panic!("no column {name}"));
    lines[1..].iter().map(|line| line[at].as_str()).collect()
}

#[test]
fn a_report_is_a_table_and_three_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("new/reports");
    let table = good(&[
        "models/leaf.dls",
        "--methods",
        "dopri5,rk4",
        "--tolerances",
        "1e-4,1e-6,1e-8,1e-10",
        "--step-sizes",
        "0.0625,0.03125,0.015625",
        "--runs",
        "2",
        "-o",
        out.to_str().expect("UTF-8"),
    ]);
    for part in [
        "Pinnate leaf, at 50 times",
        "5 productions, 22 modules",
        "order 4, observed ",
        "reference: closed form (auto)",
    ] {
        assert!(table.contains(part), "{part}: {table}");
    }
    let widths: Vec<usize> = (table.lines().filter(|l| l.ends_with("  right")))
        .map(|l| l.chars().position(|c| c == 'r').expect("right"))
        .collect();
    assert_eq!(widths.len(), 7, "{table}");
    assert!(widths[..4].iter().all(|w| *w == widths[0]) && widths[4..].iter().all(|w| *w == widths[4]));

    let csv = fields(&read(&out.join("leaf.csv")));
    assert_eq!(csv.len(), 8);
    assert!(csv.iter().all(|line| line.len() == csv[0].len()));
    assert_eq!(
        column(&csv, "accuracy_value"),
        ["1e-4", "1e-6", "1e-8", "1e-10", "6.25e-2", "3.125e-2", "1.5625e-2"]
    );
    assert!(column(&csv, "verdict").iter().all(|v| *v == "right"));
    assert!(
        column(&csv, "modules").iter().all(|v| *v == "22")
            && column(&csv, "events").iter().all(|v| *v == "5")
    );
    let orders = column(&csv, "observed_order");
    let order: f64 = orders[6].parse().expect("a number");
    assert!((order - 4.0).abs() < 0.3, "{order}");
    let errors: Vec<f64> = column(&csv, "error").iter().map(|e| e.parse().expect("a number")).collect();
    for (error, tolerance) in errors.iter().zip([1e-4, 1e-6, 1e-8, 1e-10]) {
        assert!(*error > 0.0 && *error < 10.0 * tolerance, "{errors:?}");
    }
    let json: serde_json::Value = serde_json::from_str(&read(&out.join("leaf.json"))).expect("JSON");
    assert_eq!((json["times"].as_array().map(Vec::len), json["productions"].as_u64()), (Some(50), Some(5)));
    let dopri5 = &json["series"][0];
    assert_eq!(
        (dopri5["method"].as_str(), dopri5["points"].as_array().map(Vec::len)),
        (Some("dopri5"), Some(4))
    );
    let point = &dopri5["points"][1];
    assert_eq!((point["tolerance"].as_f64(), point["error"].as_f64()), (Some(1e-6), Some(errors[1])));
    assert!(point["wall_s"]["min"].as_f64() <= point["wall_s"]["median"].as_f64());
    assert!(point["counts"]["rhs_evaluations"].is_u64() && dopri5["reference"]["error"].is_f64());

    let svg = read(&out.join("leaf.svg"));
    let tree = usvg::Tree::from_str(&svg, &usvg::Options::default()).expect("an SVG");
    let (size, bounds) = (tree.size(), tree.root().abs_stroke_bounding_box());
    assert!(bounds.right() <= size.width() + 0.1 && bounds.bottom() <= size.height() + 0.1, "{bounds:?}");
    for part in [
        "Pinnate leaf",
        "wall time (ms)",
        "right-hand side evaluations",
        "class=\"rk4\"",
        "order 4, observed ",
    ] {
        assert!(svg.contains(part), "{part}");
    }
    assert!(!svg.contains("hollow") && !svg.contains("NaN") && !svg.contains("inf"));
}

/// The paper's approximation (section 5) is of order 1 in the slice; where nobody reads a neighbour there is nothing to study.
#[test]
fn the_error_of_local_time_is_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("row.dls");
    let text = "initial string: B(0) A(0) B(4)\nB(c) < A(x) > B(d): solve dx/dt = c - x, dx/dt = 0\n";
    let text = text.replace(", dx/dt = 0", " + d") + "B(c): solve dc/dt = sin(t) - c*c/9\n";
    std::fs::write(&model, text).expect("written");
    let out = folder.path().to_string_lossy().into_owned();
    let flags = ["--methods", "auto", "--tolerances", "1e-8", "--at", "1,2", "--runs", "1", "--out", &out];
    let slices = ["--slices", "0.125,0.0625,0.03125,0.015625"];
    let file = model.to_string_lossy().into_owned();
    let table = good(&[&[file.as_str()], &flags[..], &slices[..]].concat());
    assert!(table.contains("\nlocal  order 1, observed 1.0\n") && table.contains("  slice "), "{table}");
    let csv = fields(&read(&folder.path().join("row.csv")));
    let errors: Vec<f64> = column(&csv, "error").iter().map(|e| e.parse().expect("a number")).collect();
    assert!(errors[0] < 1e-6 && errors[4] > 1e-4 && errors[1] > 6.0 * errors[4], "{errors:?}");
    let table = good(&[&["models/leaf.dls"], &flags[..], &slices[..]].concat());
    assert!(!table.contains("local"), "{table}");
}

#[test]
fn wrong_structure_is_said_and_not_averaged() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("UTF-8");
    let model = "models/hieracium-apex.dls";
    let table = good(&[
        model,
        "--methods",
        "euler,rk4",
        "--step-sizes",
        "0.0625",
        "--slices",
        "1",
        "--runs",
        "1",
        "-o",
        out,
    ]);
    assert!(table.contains("WRONG: 14 modules for 18 at t = 11.6"), "{table}");
    assert!(table.contains("step size 0.0625: production 30 is F_a1 "), "{table}");
    assert!(table.contains("expected F_a1 ") && table.contains(" at t = 17.1067"), "{table}");
    let csv = fields(&read(&folder.path().join("hieracium-apex.csv")));
    assert_eq!(column(&csv, "verdict")[..2], ["wrong_modules", "right"]);
    let json = read(&folder.path().join("hieracium-apex.json"));
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let difference = &json["series"][0]["points"][0]["difference"];
    assert_eq!(
        (difference["modules"].as_u64(), difference["expected_modules"].as_u64()),
        (Some(14), Some(18))
    );
    assert_eq!(difference["first"]["production"].as_u64(), Some(30));
    let svg = read(&folder.path().join("hieracium-apex.svg"));
    assert!(svg.contains("hollow: wrong events or modules") && svg.contains("<g fill=\"white\""));
}

#[test]
fn runs_that_fail_or_take_too_long_do_not_stop_a_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("stiff.dls");
    std::fs::write(&model, "initial string: A(1)\nA(x): solve dx/dt = -100*(x - cos(t))").expect("written");
    let model = model.to_str().expect("UTF-8");
    let common = [model, "--methods", "rk4", "--at", "50,100", "--runs", "1"];
    let table = good(&[&common[..], &["--step-sizes", "0.5,0.01"]].concat());
    assert!(table.contains("FAILED: ") && table.contains("not finite") && table.contains("right"), "{table}");
    let table = good(&[&common[..], &["--step-sizes", "0.01,1e-7", "--time-limit", "1"]].concat());
    assert!(table.contains("left out: would take about"), "{table}");
    let table = good(&[&common[..], &["--step-sizes", "1e-7", "--time-limit", "1"]].concat());
    assert!(table.contains("FAILED: stopped after 1 s, at t = "), "{table}");
}

#[test]
fn a_report_keeps_within_its_time_and_says_what_it_left_out() {
    let common = ["models/leaf.dls", "--runs", "1", "--at", "1"];
    let table = good(&[&common[..], &["--budget", "0.001"]].concat());
    let left_out = table.matches("left out: would take about").count();
    assert!(
        left_out > 10
            && table.contains(&format!("\n{left_out} points left out to stay within 0.001 s; `--budget ")),
        "{table}"
    );
    let (rows, orders) = (table.matches("  right\n").count(), table.matches("\n  reference: ").count());
    assert!(orders == 6 && rows >= orders, "of each method the first point is there: {table}");
    // What is listed is measured, whatever time it takes.
    let listed = [
        "--budget",
        "0.001",
        "--methods",
        "dopri5,rk4",
        "--tolerances",
        "1e-3,1e-6,1e-9",
        "--step-sizes",
        "0.1,0.01",
    ];
    let table = good(&[&common[..], &listed].concat());
    assert!(!table.contains("left out") && table.matches("  right\n").count() == 5, "{table}");
    let table = good(&[&common[..], &["--budget", "1000"]].concat());
    assert!(!table.contains("left out") && table.matches("  right\n").count() == left_out + rows, "{table}");
}

/// Where a run that others are compared with takes too long, the study ends earlier and says so; not where times are asked for.
#[test]
fn a_report_of_a_large_model_ends_at_an_earlier_time() {
    let common = ["models/sapling.dls", "--runs", "1", "--methods", "dopri5", "--budget", "2"];
    let table = good(&common);
    let said = "left out, as it takes longer than `--budget 2`: a larger one goes further, `--at 16` to the end in any case";
    assert!(table.contains("\ngrowth from t = ") && table.contains(said), "{table}");
    assert!(table.contains("from t = 0 to ") && !table.contains("from t = 0 to 16:"), "{table}");
    assert!(table.matches("  right\n").count() > 0, "{table}");
    let table = good(&[&common[..], &["--at", "1,2"]].concat());
    assert!(table.contains("at 2 times from t = 1 to 2:") && !table.contains("longer than"), "{table}");
}

/// Runs the hard cases of a folder with one file.
fn hard(file: &str) -> (Option<i32>, String, String) {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("x.dls"), file).expect("written");
    let output = report(&["--hard", folder.path().to_str().expect("UTF-8")]);
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

const GROWTH: &str = "initial string: A(0)\n\
    A(x): if x < 1 solve dx/dt = 1\n if x = 1 produce B(0) B(0)\n\
    B(y): solve dy/dt = 1\n";

#[test]
fn a_wrong_expectation_fails_with_what_was_found_and_where() {
    let head = "#= case: X01\n#= group: growth\n#= tolerances: 1e-6\n#= methods: dopri5\n";
    for (line, says) in [
        ("#= at 0.5: A(0.5) within 1e-9", &["all passed"][..]),
        ("#= at 0.5: A(0.75)", &["off by 0.25", "x.dls:5", "expected: A(0.75)", "found:    A(0."]),
        ("#= at 2: A(1)", &["other modules at t = 2", "expected: A(1)", "found:    B("]),
        ("#= at 2: B(1) B(1.5)", &["parameter 1 of B (module 2) at t = 2 is off by 0.333"]),
        ("#= count B by 2: 3", &["number of B at t = 2 is 2 for 3"]),
        ("#= count * by 2: 2", &["all passed"]),
        ("#= sum B 1 by 3: 5", &["sum of parameter 1 of B at t = 3", "expected: 5", "off by 0.2"]),
        ("#= events by 1: 1", &["all passed"]),
        ("#= events by 0.5: 1", &["number of productions by t = 0.5 is 0 for 1"]),
        ("#= instants by 2: 2", &["is 1 for 2"]),
        (
            "#= fails Zeno at 2",
            &["the run does not end with Zeno", "expected: Zeno at t = 2", "found:    no error"],
        ),
    ] {
        let (status, out, error) = hard(&format!("{head}{line}\n{GROWTH}"));
        let passes = says[0] == "all passed";
        assert_eq!(status, Some(i32::from(!passes)), "{line}: {out}{error}");
        assert!(out.contains(if passes { "pass" } else { "FAIL: " }), "{line}: {out}");
        for part in says {
            assert!(out.contains(part) || error.contains(part), "{line}: {part}: {out}{error}");
        }
    }
    let blow_up = "#= case: X02\n#= at 3: A(1)\ninitial string: A(1)\nA(x): solve dx/dt = x^2";
    let (status, out, error) = hard(blow_up);
    assert_eq!(status, Some(1));
    assert!(out.contains("the run ends too early") && error.contains("x.dls:2"), "{out}{error}");
    let expected = blow_up.replace("at 3: A(1)", "fails NotFinite|StepTooSmall at 1 within 1e-3");
    assert_eq!(hard(&expected).0, Some(0));
    let sooner = blow_up.replace("at 3: A(1)", "fails NotFinite|StepTooSmall at 1.5 within 1e-3");
    assert!(hard(&sooner).2.contains("is off by 0.3"), "{}", hard(&sooner).2);
}

#[test]
fn malformed_lines_are_named() {
    let (status, _, error) = hard(&format!("#= case: X01\n#= at 2 B(1)\n{GROWTH}"));
    assert!(status == Some(1) && error.contains("x.dls:2: expected `:`"), "{error}");
    let (status, _, error) = hard("#= case: X01\n#= at 2: B(1)\ninitial string: A(\n");
    assert!(status == Some(1) && error.contains("error"), "{error}");
}

#[test]
fn the_built_in_cases_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("UTF-8");
    let first = dlsys::study::CASES[0];
    let id = dlsys::study::Case::parse(first.0, first.1).expect("good").id;
    let table = good(&["--hard", "--case", &id, "-o", out]);
    assert!(table.contains(&id) && table.contains("all passed"), "{table}");
    let csv = fields(&read(&folder.path().join("hard.csv")));
    assert!(column(&csv, "verdict").iter().all(|v| *v == "pass"));
    let json: serde_json::Value =
        serde_json::from_str(&read(&folder.path().join("hard.json"))).expect("JSON");
    assert_eq!(json["rows"][0]["case"].as_str(), Some(id.as_str()));
    for (arguments, status, says) in [
        (&["--hard", "--case", "nowhere"][..], 2, "there is no case `nowhere`"),
        (&["--hard", "--methods", "euler"], 2, "fixed step"),
        (&["--hard", "nowhere"], 1, "nowhere"),
        (&["--case", "N90", "models/leaf.dls"], 2, "--hard"),
        (&["models/leaf.dls", "--runs", "0"], 2, "between"),
        (&["models/leaf.dls", "--methods", "magic"], 2, "methods are"),
        (&["tests/errors/run_blow_up.dls"], 2, "--at"),
        (&["tests/errors/run_blow_up.dls", "--at", "10"], 1, "no reference comes to the last time"),
        (&[], 2, "MODEL"),
    ] {
        let output = report(arguments);
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(status) && message.contains(says), "{arguments:?}: {message}");
    }
}

#[test]
fn the_hard_cases_hold() {
    // Every case with every method and tolerance that its file names; the table is what `report --hard` prints.
    let table = good(&["--hard"]);
    println!("{table}");
    let verdicts = table.lines().filter(|line| line.ends_with("  pass")).count();
    assert!(verdicts >= 250, "{table}");
}

/// Of what falls and hangs, tighter tolerances have smaller errors.
#[test]
fn scenes_are_studied_by_tolerance() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("drop.dls");
    let text = "units length 0.1, time 1\nwind 1, 0, 0 speed 1\nground 0\nsolid Board\nframes 0 .. 0.5 step 0.1\n\
        initial string: [ Hang ] [ f(2) -(80) Board ]\nHang: if age = 0.2 produce @D Loose\n\
        interpret Hang: Petal\ninterpret Loose: Petal\ninterpret Petal: f(6) &(40) @P(1)\ninterpret Board: !(0.5) F(4)\n";
    std::fs::write(&model, text).expect("written");
    let out = folder.path().to_str().expect("UTF-8");
    let table = good(&[model.to_str().expect("UTF-8"), "--methods", "auto", "--budget", "200", "-o", out]);
    assert!(table.contains("what falls and hangs, at 6 times, against 1e-6"), "{table}");
    let lines = fields(&read(&folder.path().join("drop-scene.csv")));
    let errors: Vec<f64> =
        column(&lines, "error").iter().map(|text| text.parse().expect("a number")).collect();
    assert_eq!(errors.len(), 4);
    assert!(errors[3] < 0.03 * errors[0] && errors[3] < 1e-3, "{errors:?}");
}
