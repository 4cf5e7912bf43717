//! `dlsys run --verify` and `dlsys report --verify`: runs that pass, runs that fail, and the messages.

use dlsys::sim::{Method, Settings};
use dlsys::study::{Error, Verification, verify};

use crate::cli::dlsys;
use crate::common::session;

/// A model in a file.
fn model(text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("model.dls");
    std::fs::write(&path, text).expect("written");
    let path = path.to_str().expect("UTF-8").to_owned();
    (folder, path)
}

/// Exit status, standard output, standard error.
fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = dlsys(arguments);
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

fn verified(text: &str, settings: Settings, times: &[f64]) -> Verification {
    verify(&session(text), settings, times, 60.0, &mut |_| ()).expect("compared")
}

/// Cells that divide, with neighbours; the rate has no formula.
const CELLS: &str = "frames 0 .. 6 step 0.5\ninitial string: C(0.3, 1) C(0.4, 0)\n\
    C(l, m) < C(x, c) > C(r, n):\n  if x < 0.5 solve dx/dt = x*(1 - x), dc/dt = m + n - 2*c\n  \
    if x = 0.5 produce C(x/2, c) C(x/3, c)\n\
    C(x, c):\n  if x < 0.5 solve dx/dt = x*(1 - x), dc/dt = sin(t) - c\n  if x = 0.5 produce C(x/2, c) C(x/3, c)\n";

#[test]
fn what_is_right_passes_and_output_stays_as_it_is() {
    let (_folder, path) = model(CELLS);
    for format in ["text", "json"] {
        let plain = run(&["run", &path, "--format", format]);
        let (status, out, said) = run(&["run", &path, "--format", format, "--verify"]);
        assert_eq!((status, &out, plain.0), (Some(0), &plain.1, Some(0)), "{said}");
        assert!(said.starts_with("checked  auto at tolerance 1e-6\nagainst  radau at tolerance "), "{said}");
        for part in [
            ", scheduler global, reference path\n",
            "at       13 times up to t = 6\n",
            "\nC(x, c): x ",
            "\nC(x, c): c ",
            "\ntime of a production ",
            " productions in both, in one order\n",
            "\nverified: no difference is larger than 100 TOL\n",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
        assert!(!said.contains("error"), "{said}");
    }
    for line in run(&["run", &path, "--format", "json", "--verify"]).1.lines() {
        serde_json::from_str::<serde_json::Value>(line).expect("JSON");
    }
}

#[test]
fn what_has_formulas_is_integrated_all_the_same() {
    let (_folder, path) = model("initial string: A(0.1)\nA(x): solve dx/dt = x*(1 - x)\n");
    let (status, _, said) = run(&["run", &path, "--at", "5", "--tolerance", "1e-9", "--verify"]);
    assert_eq!(status, Some(0), "{said}");
    let found =
        verified("initial string: A(0.1)\nA(x): solve dx/dt = x*(1 - x)\n", Settings::default(), &[5.0]);
    // Two ways: a difference of nothing at all would be one way.
    let error = found.worst().expect("x").error;
    assert!(found.passes() && error > 0.0 && error < 1e-7, "{error:e}");
}

#[test]
fn every_method_is_checked_by_another() {
    for (name, method) in Method::NAMED {
        if method.is_fixed_step() {
            continue;
        }
        for tolerance in [1e-3, 1e-6, 1e-9] {
            let settings = Settings { method, tolerance, ..Settings::default() };
            let found = verified(CELLS, settings, &[1.0, 2.0, 4.0]);
            assert!(found.passes(), "{name} at {tolerance:e}: {found:?}");
            assert!(
                found.other.method != method
                    && found.other.tolerance < tolerance
                    && found.productions.ours > 3
            );
        }
    }
}

#[test]
fn the_worst_parameter_is_named() {
    let (_folder, path) =
        model("initial string: A(1, 0) B(2)\nA(x, y): solve dx/dt = y, dy/dt = -x\nB(z): solve dz/dt = 0\n");
    let euler = ["run", &path, "--at", "1,8", "--method", "euler", "--step-size", "0.25", "--verify"];
    let (status, out, said) = run(&euler);
    assert!(status == Some(1) && out.starts_with("t = 1\n") && out.contains("t = 8\n"), "{status:?} {out}");
    assert!(
        said.contains("\nerror: not verified: `A(x, y): ") && said.contains(" of module 1 is "),
        "{said}"
    );
    assert!(
        said.contains(" at t = 8: ") && said.contains("100 are promised") && said.contains("`--step-size`"),
        "{said}"
    );
    assert!(said.contains("\nB(z): z ") && !said.contains("verified: no difference"), "{said}");
    // By the definition of the error.
    let line = said.lines().find(|l| l.starts_with("A(x, y): y ")).expect("a line");
    let cells: Vec<f64> =
        line.split_whitespace().skip(3).take(4).map(|c| c.parse().expect("a number")).collect();
    let error = (cells[2] - cells[3]).abs() / 1e-6;
    assert!((error / cells[0] - 1.0).abs() < 0.01 && (cells[3] + 8f64.sin()).abs() < 1e-7, "{line}");
    // What the tolerance allows is no fault.
    let coarse =
        [&euler[..4], &["--method", "euler", "--step-size", "1e-4", "--tolerance", "1e-4", "--verify"]]
            .concat();
    let (status, _, said) = run(&coarse);
    assert_eq!(status, Some(0), "{said}");
}

/// A formula arrives where integration does not, from less than it looks at; from a little more both do.
#[test]
fn where_auto_has_formulas_the_other_way_may_be_the_wrong_one() {
    let (status, _, said) = run(&["run", "models/hard/g01-300-decades.dls", "--at", "345,700", "--verify"]);
    assert!(status == Some(0) && said.contains("1 production in both"), "{said}");
    let (_folder, path) =
        model("initial string: A(1e-306)\nA(x):\n  if x < 1 solve dx/dt = x\n  if x = 1 produce B(t)\n");
    let (status, _, said) = run(&["run", &path, "--at", "345,710", "--verify"]);
    assert!(
        status == Some(1) && said.contains("error: not verified: the production of A 1 at t = 704.59"),
        "{said}"
    );
    assert!(
        said.contains("is here, but not there") && said.contains("`auto` has formulas for all"),
        "{said}"
    );
}

/// A is before B, by 0.002; with large steps A is late.
const PAIR: &str = "initial string: A(0.1) B(0)\nA(x): if x < 0.5 solve dx/dt = x*(1 - x)\n if x = 0.5 produce C\n\
    B(y): if y < 2.1995 solve dy/dt = 1\n if y = 2.1995 produce C C\n";

#[test]
fn early_productions_and_another_order_are_told() {
    let (_folder, path) = model(PAIR);
    let good = run(&["run", &path, "--at", "1,2,3", "--verify"]);
    assert!(good.0 == Some(0) && good.2.contains("2 productions in both, in one order"), "{}", good.2);
    let (status, _, said) =
        run(&["run", &path, "--at", "1,3", "--method", "euler", "--step-size", "0.01", "--verify"]);
    assert_eq!(status, Some(1), "{said}");
    assert!(
        said.contains("2 productions in both, in another order: first B 2 at t = 2.1995 and A 1 at t = 2.2"),
        "{said}"
    );
    assert!(said.contains("error: not verified: "), "{said}");
    // Late by more than the distance of the observed times: compared where the modules are the same, and said.
    let (status, _, said) =
        run(&["run", &path, "--at", "1,2.2,3", "--method", "euler", "--step-size", "0.5", "--verify"]);
    assert!(status == Some(1) && said.contains("compared at 2 of 3 times"), "{said}");
}

#[test]
fn productions_that_are_another_kind_of_thing_are_told() {
    // Which of the two comes first decides for good.
    let text = |lead: f64| {
        format!(
            "initial string: A(0.1) B({lead:e})\nA(x) > B(y): if x < 0.5 & y < 2 solve dx/dt = x*(1 - x)\n \
             if x = 0.5 produce C\n if y = 2 produce D\nB(y): if y < 2 solve dy/dt = 1\n if y = 2 produce B_end\n"
        )
    };
    let crossing = 9f64.ln();
    let euler = Settings { method: Method::Euler, step_size: 0.01, ..Settings::default() };
    let far = text(2.0 - crossing - 0.003);
    assert!(verified(&far, Settings::default(), &[1.0, 3.0]).passes());
    let found = verified(&far, euler, &[1.0, 3.0]);
    let split = found.productions.split.as_ref().expect("other productions");
    let clauses = (split.ours.as_ref().map(|e| e.clause), split.theirs.as_ref().map(|e| e.clause));
    assert!(!found.passes() && clauses.0 != clauses.1, "{split:?}");
    let (_folder, path) = model(&far);
    let (status, _, said) =
        run(&["run", &path, "--at", "1,3", "--method", "euler", "--step-size", "0.01", "--verify"]);
    assert!(status == Some(1) && said.contains("error: not verified: "), "{said}");
    assert!(
        said.contains("A 1 by its produce no. ") && said.contains(" here") && said.contains(" there"),
        "{said}"
    );
}

#[test]
fn chance_is_the_same_in_both() {
    let text = "frames 0 .. 3 step 1\ninitial string: A(0)\nA(x):\n  if x < 1 solve dx/dt = 1 - x/9\n  \
        if x = 1 produce 2: A(uniform(0, 0.5)) A(0) or 1: F\nF: at rate 1 + sin(t)^2 produce G\n";
    for seed in 0..20 {
        let found = verified(text, Settings { seed, ..Settings::default() }, &[1.0, 2.5, 4.0]);
        assert!(found.passes() && found.productions.ours > 0, "seed {seed}: {found:?}");
    }
    let (_folder, path) = model(text);
    let (status, _, said) = run(&["run", &path, "--seed", "7", "--verify"]);
    assert_eq!(status, Some(0), "{said}");
}

#[test]
fn stiff_equations_are_verified_and_what_that_is_worth_is_said() {
    let text = "initial string: A(2, 0)\nA(x, v): solve dx/dt = v, dv/dt = 1000*(1 - x^2)*v - x\n";
    let (_folder, path) = model(text);
    let (status, _, said) = run(&["run", &path, "--at", "10,300", "--verify"]);
    assert!(
        status == Some(0) && said.contains("(stiff equations are solved by one method in both"),
        "{said}"
    );
}

#[test]
fn not_verified_is_not_verified() {
    // One thing is asked of all: a formula, or a million steps.
    let (_folder, path) = model("initial string: A(1)\nA(x): solve dx/dt = cos(1000*t)\n");
    let (status, out, said) = run(&["run", &path, "--at", "1000000", "--verify", "--time-limit", "0.2"]);
    assert!(status == Some(1) && out.starts_with("t = 1"), "{out}{said}");
    for part in [
        "error: not verified: no other way comes to the last time",
        "radau at ",
        "dop853 at ",
        "stopped after 0.2 s",
        "--time-limit S",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // The run itself fails: its own error, once.
    let (_folder, path) = model("initial string: A(1)\nA(x): if x < 2 solve dx/dt = 1\n");
    let (status, _, said) = run(&["run", &path, "--at", "3", "--verify"]);
    assert!(
        status == Some(1) && said.matches("error: ").count() == 1 && said.contains("left its domain"),
        "{said}"
    );
    let session = session("initial string: A(1)\nA(x): if x < 2 solve dx/dt = 1\n");
    let why = verify(&session, Settings::default(), &[3.0], 9.0, &mut |_| ()).expect_err("outside");
    assert!(matches!(why, Error::Run(_)));
    let (_folder, path) = model(CELLS);
    assert_eq!(run(&["run", &path, "--time-limit", "5"]).0, Some(2));
    assert_eq!(run(&["run", &path, "--seeds", "0..3", "--verify"]).0, Some(2));
}

#[test]
fn slices_of_time_fail_honestly() {
    let text = "initial string: B(0) A(0) B(4)\nB(c) < A(x) > B(d): solve dx/dt = c - x + d\nB(c): solve dc/dt = sin(t) - c*c/9\n";
    let (_folder, path) = model(text);
    let (status, _, said) =
        run(&["run", &path, "--at", "1,2", "--scheduler", "local", "--slice", "0.125", "--verify"]);
    assert!(
        status == Some(1) && said.contains("scheduler local at slice 0.125") && said.contains("`--slice`"),
        "{said}"
    );
    assert!(said.contains("`A(x): x` of module 2"), "{said}");
}

#[test]
fn a_report_is_verified_at_each_tolerance() {
    let (_folder, path) = model(CELLS);
    let (status, out, said) =
        run(&["report", &path, "--verify", "--methods", "auto,dopri5", "--tolerances", "1e-4,1e-7"]);
    assert_eq!((status, said.as_str()), (Some(0), ""), "{out}");
    assert_eq!(out.matches("  verified  ").count(), 4, "{out}");
    assert!(
        out.starts_with(&format!("{path}, at 13 times up to t = 6\n"))
            && out.contains("\ndopri5 at tolerance "),
        "{out}"
    );
    let status = |arguments: &[&str]| run(&[&["report", &path, "--verify"], arguments].concat());
    assert_eq!(status(&["--methods", "euler"]).0, Some(2));
    assert_eq!(status(&["--out", "x"]).0, Some(2));
    let (code, out, said) = status(&["--tolerances", "1e-6", "--time-limit", "1e-9"]);
    assert!(code == Some(1) && out.contains("NOT: nothing to compare with"), "{out}");
    assert!(said.contains("error: 1 of 1 model not verified"), "{said}");
}
