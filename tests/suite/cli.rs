//! The command line: output, files, exit status.

use std::path::Path;
use std::process::{Command, Output};

use crate::common::repository;

pub fn dlsys(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
    command.current_dir(repository("")).args(arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// Runs what must succeed in silence on standard error; returns standard output.
pub fn good(arguments: &[&str]) -> String {
    let output = dlsys(arguments);
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{arguments:?}");
    text(&output.stdout)
}

/// Runs what must fail; returns the status and standard error.
pub fn bad(arguments: &[&str]) -> (i32, String) {
    let output = dlsys(arguments);
    let status = output.status.code().expect("no signal");
    assert_ne!(status, 0, "{arguments:?}");
    (status, text(&output.stderr))
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("readable").file_name().into_string().expect("UTF-8"))
        .collect();
    names.sort();
    names
}

#[test]
fn run_prints_one_json_object_a_time() {
    let out = good(&["run", "tests/paper-models/dragon.dls", "--at", "2,0.5,0.5", "--format", "json"]);
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines.len(), 2);
    assert!(
        lines[0].starts_with(r#"{"t":0.5,"modules":[["-",[]],["-",[]],["-",[]],["F_r",[0.353553390593273"#)
    );
    for (line, t) in lines.iter().zip([0.5, 2.0]) {
        let value: serde_json::Value = serde_json::from_str(line).expect("JSON");
        assert_eq!(value["t"].as_f64(), Some(t));
    }
    let spaced = good(&[
        "run",
        "tests/paper-models/dragon.dls",
        "--from",
        "0",
        "--to",
        "1",
        "--step",
        "0.25",
        "--format",
        "json",
    ]);
    assert_eq!(spaced.lines().count(), 5);
    let framed = good(&["run", "tests/paper-models/dragon.dls", "--format", "json"]);
    assert_eq!(framed.lines().count(), 33, "the model's own frames");
}

#[test]
fn run_prints_strings_for_people() {
    let out = good(&["run", "tests/paper-models/leaf.dls", "--at", "0.5"]);
    assert_eq!(out, "t = 0.5\n  F_a(1.72835, 4)\n");
}

#[test]
fn stats_tell_what_was_done() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("stats.json");
    good(&["run", "tests/paper-models/leaf.dls", "--at", "9", "--stats", file.to_str().expect("UTF-8")]);
    let stats: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(file).expect("written")).expect("JSON");
    for key in
        ["parse_s", "simulate_s", "output_s", "events", "steps", "rhs_evaluations", "modules", "peak_modules"]
    {
        assert!(stats[key].is_number(), "{key}");
    }
    assert_eq!((stats["events"].as_u64(), stats["modules"].as_u64()), (Some(5), Some(22)));
}

#[test]
fn params_are_set_from_outside_within_their_range() {
    let at = ["--at", "9", "--format", "json"];
    let plain = good(&[&["run", "models/leaf.dls"], &at[..]].concat());
    let set = good(&[&["run", "models/leaf.dls", "--set", "n_0=2"], &at[..]].concat());
    assert!(set.len() < plain.len());
    let (status, message) = bad(&["run", "models/leaf.dls", "--set", "n_0=13", "--at", "1"]);
    assert!(status == 2 && message.contains("0 .. 12"), "{message}");
    let (status, message) = bad(&["run", "models/leaf.dls", "--set", "α_mac=13", "--at", "1"]);
    assert!(status == 2 && message.contains("did you mean `α_max`"), "{message}");
    let (status, message) = bad(&["run", "models/leaf.dls", "--set", "x_th=1.5", "--at", "1"]);
    assert!(status == 2 && message.contains("declare it with `param`"), "{message}");
}

/// Widths are lengths, and pixels in cpfg; the warning marks the module that sets them, in the first of several rules that could.
#[test]
fn a_stem_that_is_wider_than_the_drawing_is_long_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let rules = "A(l, w) --> !(w) F(l) [ &(45) B(l*0.6, w*0.707) ] /(137.5) A(l*0.9, w*0.707)\n\
        B(l, w) --> !(w) F(l) [ -(45) B(l*0.6, w*0.707) ] B(l*0.9, w*0.707)\n";
    let warned = |axiom: &str| {
        std::fs::write(path("tree.dls"), format!("axiom: {axiom}\n{rules}")).expect("written");
        let done = dlsys(&["render", &path("tree.dls"), "--at", "5", "-o", &path("tree.svg"), "--force"]);
        assert!(done.status.success(), "{done:?}");
        text(&done.stderr)
    };
    let said = warned("A(1, 10)");
    assert!(said.contains("warning: a stem is wider than half of the largest side of the drawing"), "{said}");
    assert!(said.contains("tree.dls:2:13\n") && said.contains("| "), "{said}");
    assert!(said.contains("10 wide at t = 5, and the largest side is 4") && said.contains("*w)`"), "{said}");
    assert!(!warned("A(1, 0.1)").contains("wider than half"));
    // A body of one piece is as wide as it is meant to be.
    std::fs::write(path("ball.dls"), "initial string: !(1) F(1)").expect("written");
    good(&["render", &path("ball.dls"), "--at", "0", "-o", &path("ball.svg"), "--quiet"]);
}

#[test]
fn faults_have_their_exit_status() {
    let model = "tests/paper-models/leaf.dls";
    for (arguments, status, says) in [
        (&["run", "nowhere.dls"][..], 1, "nowhere.dls"),
        (&["check", "tests/errors/unknown_name.dls"], 1, "unknown name"),
        (&["run", "tests/errors/run_cascade.dls", "--at", "1"], 1, "without end"),
        (&["run", model, "--at=-1"], 2, "time begins at 0"),
        (&["run", model, "--at", "soon"], 2, "not a number"),
        (&["run", model, "--from", "90"], 2, "of the model is before --from 90"),
        (&["run", model, "--from", "2", "--to", "1", "--step", "1"], 2, "before"),
        (&["run", model, "--method", "rk4", "--at", "1"], 2, "--step-size"),
        (&["run", model, "--method", "magic", "--at", "1"], 2, "methods are"),
        (&["run", model, "--tolerance", "0", "--at", "1"], 2, "between"),
        (&["run", model, "--scheduler", "local", "--at", "1"], 2, "--slice"),
        (&["run", model, "--slice", "1", "--at", "1"], 2, "--scheduler local"),
        (&["run", model, "--scheduler", "local", "--slice", "1e-9", "--at", "1"], 2, "too short a slice"),
        (&["run", model, "--at", "-1"], 2, "-1"),
        (&["run", model, "--at", "1", "--events", model], 2, "the model itself"),
        (&["run", model, "--at", "1", "--stats", "x", "--events", "x"], 2, "the file of `--events`"),
        (&["run", model, "--set", "n_0", "--at", "1"], 2, "NAME=VALUE"),
        (&["render", model], 2, "--out"),
        (&["render", model, "-o", "x", "--view", "inside"], 2, "view"),
        (&["bloom"], 2, "bloom"),
        (&[], 2, "Usage"),
    ] {
        let (code, message) = bad(arguments);
        assert!(code == status && message.contains(says), "{arguments:?}: {code}, {message}");
    }
    assert!(good(&["--help"]).contains("check"));
    assert!(good(&["--version"]).starts_with("dlsys "));
}

#[test]
fn what_was_computed_before_an_error_is_printed() {
    let output = dlsys(&["run", "tests/errors/run_blow_up.dls", "--at", "0,0.1,10", "--format", "json"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output.stdout).lines().count(), 2);
}

#[test]
fn render_writes_whole_frames_and_a_manifest() {
    for format in ["svg", "obj"] {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("out");
        let path = out.to_str().expect("UTF-8");
        let arguments =
            ["render", "tests/paper-models/leaf.dls", "--at", "0,3,9", "-o", path, "--format", format];
        let said = good(&arguments);
        assert!(said.starts_with("3 frames, ") && said.lines().count() == 1, "one line in a pipe: {said}");
        let frame = |i| format!("frame-{i:04}.{format}");
        let mut expected: Vec<String> = (0..3).map(frame).collect();
        expected.push("manifest.json".to_owned());
        if format == "obj" {
            expected.push("materials.mtl".to_owned());
        }
        assert_eq!(files(&out), expected);
        let manifest: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(out.join("manifest.json")).expect("written"))
                .expect("JSON");
        let frames = manifest["frames"].as_array().expect("frames");
        assert_eq!(frames.iter().map(|f| f["modules"].as_u64()).collect::<Vec<_>>(), [1, 21, 22].map(Some));
        assert_eq!(frames[1]["time"].as_f64(), Some(3.0));
        assert_eq!(manifest["settings"]["tolerance"].as_f64(), Some(1e-6));

        // The same bytes again; fewer frames leave none of the old ones behind.
        let before = std::fs::read(out.join(frame(1))).expect("a frame");
        good(&["render", "tests/paper-models/leaf.dls", "--at", "0,3,9", "-o", path, "--format", format]);
        assert_eq!(std::fs::read(out.join(frame(1))).expect("a frame"), before);
        good(&["render", "tests/paper-models/leaf.dls", "--at", "0", "-o", path, "--format", format]);
        assert!(!files(&out).contains(&frame(1)));
    }
}

#[test]
fn other_peoples_files_are_left_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("thesis.txt"), "years of work").expect("written");
    let path = folder.path().to_str().expect("UTF-8");
    let (status, message) = bad(&["render", "tests/paper-models/leaf.dls", "--at", "0", "-o", path]);
    assert!(status == 2 && message.contains("thesis.txt") && message.contains("--force"), "{message}");
    assert_eq!(files(folder.path()), ["thesis.txt"]);
    good(&["render", "tests/paper-models/leaf.dls", "--at", "0", "-o", path, "--force"]);
    assert_eq!(std::fs::read_to_string(folder.path().join("thesis.txt")).expect("there"), "years of work");

    // Not even one that has the name of a frame.
    let folder = tempfile::tempdir().expect("a folder");
    let drawing = folder.path().join("frame-0000.svg");
    std::fs::write(&drawing, "my own").expect("written");
    let path = folder.path().to_str().expect("UTF-8");
    let (status, _) = bad(&["render", "tests/paper-models/leaf.dls", "--at", "0", "-o", path, "--force"]);
    assert_eq!((status, std::fs::read_to_string(&drawing).expect("there").as_str()), (2, "my own"));
}

#[test]
fn a_model_that_fails_later_leaves_no_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let (status, _) =
        bad(&["render", "tests/errors/run_blow_up.dls", "--at", "0,10", "-o", out.to_str().expect("UTF-8")]);
    assert_eq!((status, out.exists()), (1, false));
}

#[test]
fn a_floor_that_hides_the_sky_says_so() {
    let folder = tempfile::tempdir().expect("a directory");
    let path = folder.path().join("a.dls");
    std::fs::write(&path, "ground 0\nsky \"#6fa3e0\", \"#e8f0f8\"\naxiom: F\n").expect("written");
    let path = path.to_str().expect("UTF-8");
    let out = folder.path().join("a.png");
    let says = |flags: &[&str]| {
        let line =
            ["render", path, "--at", "0", "--width", "40", "--force", "-o", out.to_str().expect("UTF-8")];
        String::from_utf8_lossy(&dlsys(&[&line, flags].concat()).stderr).contains("the floor hides the sky")
    };
    assert!(says(&["--view", "20,15"]));
    assert!(!says(&[]) && !says(&["--view", "20,15", "--perspective", "40"]) && !says(&["--view", "20,-5"]));
}

/// Sheets are not seen from the camera of a model, which is said unless another direction is chosen.
#[test]
fn a_sheet_says_that_it_does_not_use_the_camera() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("a.dls");
    let text = "camera at 0, 1, 5 towards 0, 0.5, 0\ninitial string: F(1)\n";
    std::fs::write(&model, text).expect("written");
    let sheet = |more: &[&str]| {
        let out = folder.path().join("sheet");
        let [model, out] = [&model, &out].map(|path| path.to_str().expect("UTF-8"));
        let line = ["render", model, "-o", out, "--at", "0,1", "--format", "png", "--width", "60", "--force"];
        let output = dlsys(&[&line, more].concat());
        assert!(output.status.success());
        String::from_utf8(output.stderr).expect("text")
    };
    let said = sheet(&["--layout", "grid"]);
    assert!(said.contains("--layout grid does not use the camera") && said.contains("a.dls:1:1"), "{said}");
    for more in [&["--layout", "grid", "--view", "20,10"][..], &[]] {
        assert_eq!(sheet(more), "");
    }
}

#[test]
fn all_models_render() {
    for model in ["dragon", "anabaena", "leaf", "campanula", "lychnis", "hieracium-apex"] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().to_str().expect("UTF-8");
        let file = format!("models/{model}.dls");
        good(&["check", &file]);
        good(&["render", &file, "--at", "0,4", "-o", path]);
        good(&["render", &file, "--at", "0,4", "-o", path, "--format", "obj"]);
    }
}

#[test]
fn flags_that_mean_nothing_and_files_that_cannot_be_are_refused_before_the_run() {
    let leaf = "tests/paper-models/leaf.dls";
    let folder = tempfile::tempdir().expect("a folder");
    let there = folder.path().to_str().expect("UTF-8");
    let lost = format!("{there}/lost/stats.json");
    for (arguments, said) in [
        (&["run", leaf, "--step-size", "0.1"][..], "`auto` chooses its own"),
        (&["run", leaf, "--method", "dopri5", "--step-size", "0.1"], "`dopri5` chooses its own"),
        (&["run", leaf, "--method", "rk4"], "`--step-size H`"),
        (&["run", leaf, "--stats", there], "stats.json"),
        (&["run", leaf, "--events", there], "events.jsonl"),
        (&["run", leaf, "--stats", &lost], "there is no directory"),
        (&["gallery", "-o", there, "--figure", "abc"], "the number of a figure"),
    ] {
        let (status, message) = bad(arguments);
        assert_eq!(status, 2, "{message}");
        assert!(message.contains(said), "{arguments:?}: {message}");
    }
}

#[test]
fn things_are_counted_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("line.dls");
    std::fs::write(&model, "initial string: F(1)\nF(x): solve dx/dt = 1\n").expect("written");
    let said = good(&["check", model.to_str().expect("UTF-8")]);
    assert_eq!(said, "1 rule, 1 kind of modules, 0 params, no warnings\n");
}

#[test]
fn drawings_that_are_hardly_meant_are_said_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("odd.dls");
    let text = "initial string: A(0)\nA(x): solve dx/dt = 1\ninterpret A(x): ;(31) F(x)\n";
    std::fs::write(&model, text).expect("written");
    let (model, out) = (model.to_str().expect("UTF-8"), folder.path().join("out"));
    let output =
        dlsys(&["render", model, "--at", "1,2,3", "-o", out.to_str().expect("UTF-8"), "--threads", "2"]);
    let said = text_of(&output);
    assert_eq!((output.status.code(), said.matches("warning").count()), (Some(0), 1), "{said}");
    assert!(said.contains("odd.dls:3:17") && said.contains("at t = 1"), "{said}");
}

#[test]
fn an_error_of_drawing_names_the_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("root.dls");
    let text = "initial string: A(0)\nA(x): solve dx/dt = 1\ninterpret A(x): F(sqrt(2 - x))\n";
    std::fs::write(&model, text).expect("written");
    let (model, out) = (model.to_str().expect("UTF-8"), folder.path().join("out"));
    let (status, said) = bad(&["render", model, "--at", "1,2,3", "-o", out.to_str().expect("UTF-8")]);
    assert_eq!(status, 1, "{said}");
    assert!(said.starts_with("error: cannot draw `F` at t = 3: its parameter is NaN"), "{said}");
    assert!(said.contains("root.dls:3:17") && said.contains("help"), "{said}");
}

#[test]
fn work_of_less_than_a_second_shows_no_progress() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let out = out.to_str().expect("UTF-8");
    assert_eq!(good(&["run", "tests/paper-models/leaf.dls", "--at", "1", "--progress"]).lines().count(), 2);
    good(&["render", "tests/paper-models/leaf.dls", "--at", "1", "--progress", "-q", "-o", out]);
}

fn text_of(output: &Output) -> String {
    text(&output.stderr)
}

/// What is no file is refused at once: a device without an end, a pipe that nobody writes to.
#[cfg(unix)]
#[test]
fn devices_and_pipes_are_no_models() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("pipe.dls");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
    assert!(made.success());
    for path in ["/dev/zero", pipe.to_str().expect("UTF-8")] {
        for command in ["check", "run", "explain", "fmt"] {
            let (status, said) = bad(&[command, path]);
            assert!(status == 1 && said.contains("no regular file") && said.contains("help"), "{said}");
        }
    }
}

/// Answers that cannot be written are a failure, of every subcommand.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_a_failure() {
    for arguments in [
        &["repl"][..],
        &["run", "models/dragon.dls", "--at", "1"],
        &["check", "models/dragon.dls"],
        &["explain", "models/dragon.dls"],
        &["gallery", "--list"],
        &["completions", "bash"],
        &["man"],
        &["help"],
        &["--version"],
    ] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_dlsys"))
            .args(arguments)
            .current_dir(crate::common::repository("."))
            .stdin(
                std::fs::File::open(crate::common::repository("tests/sessions/full-disk.txt"))
                    .expect("a script"),
            )
            .stdout(std::fs::OpenOptions::new().write(true).open("/dev/full").expect("a device"))
            .output()
            .expect("the program starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains("cannot write"), "{arguments:?}: {said}");
    }
}

#[test]
fn the_page_on_the_command_line_has_all_commands_and_formats() {
    let page = std::fs::read_to_string(repository("docs/src/language/command-line.md")).expect("a page");
    let help = good(&["help"]);
    // A name begins behind two spaces; its description goes on further to the right.
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let commands = commands.take_while(|line| !line.is_empty()).filter_map(|line| {
        let word = line.strip_prefix("  ")?;
        word.starts_with(char::is_alphabetic).then(|| word.split_whitespace().next())?
    });
    let commands: Vec<&str> = commands.collect();
    assert!(commands.contains(&"repl") && commands.len() > 10, "{commands:?}");
    for command in commands {
        assert!(
            page.contains(&format!("\ndlsys {command} ")) || page.contains(&format!("\ndlsys {command}\n")),
            "{command}"
        );
    }
    let help = good(&["help", "render"]);
    let formats = help.lines().skip_while(|line| !line.contains("--format <")).skip(1);
    let formats = formats
        .take_while(|line| !line.trim_start().starts_with("--"))
        .filter_map(|line| line.trim_start().strip_prefix("- ")?.split_once(':').map(|(format, _)| format));
    let formats: Vec<&str> = formats.collect();
    assert!(formats.len() >= 10, "{formats:?}");
    for format in formats {
        assert!(
            page.contains(&format!("`{format}`")) || page.contains(&format!("`--format {format}`")),
            "{format}"
        );
    }
}

#[test]
fn signs_that_end_something_in_c_get_a_warning_in_strings() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("c.dls");
    let said = |model: &str| {
        std::fs::write(&file, model).expect("written");
        let output = dlsys(&["check", file.to_str().expect("UTF-8")]);
        text(&output.stderr)
    };
    let rest = "A(x) -> F(x)\n";
    for (string, wanted) in [
        ("F  // the trunk", "`//` begins no comment"),
        ("F  \\\n  F", "does not join lines"),
        ("F [+F];", "`;` does not end a line"),
    ] {
        let found = said(&format!("initial string: A(1) {string}\n{rest}"));
        assert!(found.contains(wanted), "{string}: {found}");
    }
    for string in ["F // F", "F \\(30) F", "F ;", "F ; F // [ F ]"] {
        let found = said(&format!("initial string: A(1) {string}\n{rest}"));
        assert!(!found.contains("begins no comment") && !found.contains("does not"), "{string}: {found}");
    }
    for (model, wanted) in [
        ("initial string: A(0)\nA(n): n % 2 = 0 -> F(n)\n", "a remainder is written `n - 2*floor(n/2)`"),
        (
            "initial string: A(0)\nA(x):\n  if x < 1 solve dx/dt = 1\n  elif x < 2 solve dx/dt = 2\n",
            "every clause begins with `if …`",
        ),
        ("include \"c.dls\"\ninitial string: F(1)\n", "this file includes itself"),
        ("surface @Q from \"organs\\leaf.s\"\ninitial string: @Q(1)\n", "separated by `/`, not by `\\`"),
    ] {
        let found = said(model);
        assert!(found.contains(wanted), "{model}: {found}");
    }
}
