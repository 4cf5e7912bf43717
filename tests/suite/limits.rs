//! Limits and robustness: runs that would not end, extreme numbers in every format, killed renders, full disks, little
//! memory.

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use dlsys::render::{Format, FrameWriter, Survey, View};
use dlsys::sim::{Error, Method, Settings};
use dlsys::tree::ModuleString;

use crate::common::{repository, run, session};
use crate::dice::Dice;

fn dlsys(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dlsys")).args(arguments).output().expect("it starts")
}

fn model(folder: &Path, text: &str) -> String {
    let path = folder.join("model.dls");
    std::fs::write(&path, text).expect("written");
    path.display().to_string()
}

const RATE: &str = "initial string: A(0)\nA(x): solve dx/dt = 1 at rate 1e300 produce A(0)";
const SHORT: &str = "initial string: A(0)\nA(x): if x < 1e-18 solve dx/dt = 1\n  if x = 1e-18 produce A(0)";

#[test]
fn what_never_ends_is_stopped_and_says_where() {
    let rk4 = Settings { method: Method::Rk4, step_size: 1e-300, ..Settings::default() };
    let cases = [
        (RATE, Settings::default()),
        (SHORT, Settings::default()),
        ("initial string: A(0)\nA(x): solve dx/dt = 1 - x", rk4),
    ];
    for (text, settings) in cases {
        let begun = Instant::now();
        let error = run(text, settings, &[1.0]).expect_err("it never ends");
        assert!(begun.elapsed() < Duration::from_secs(10), "{text}: {:?}", begun.elapsed());
        assert!(matches!(error, Error::TooManyEvents { foreseen: Some(_), .. }), "{error}");
        let site = error.site();
        assert!(site.module.starts_with("A(") && site.time < 1e-6 && site.rule == "A(x)", "{error}");
        // Frames that are close together need not be waited for either.
        let many: Vec<f64> = (1..100).map(|i| f64::from(i) * 1e-3).collect();
        assert!(run(text, settings, &many).is_err(), "{text}");
    }
}

#[test]
fn budgets_change_nothing_until_they_are_exceeded() {
    let text = "initial string: A(0)\nA(x): if x < 1 solve dx/dt = 1\n  if x = 1 produce A(0) B";
    let free = run(text, Settings::default(), &[100.5]).expect("runs");
    let tight = Settings { max_events: 102, max_seconds: 1e3, max_memory: 1 << 40, ..Settings::default() };
    assert_eq!(run(text, tight, &[100.5]).expect("just enough"), free);
    let error = run(text, Settings { max_events: 50, ..tight }, &[100.5]).expect_err("too few");
    assert!(matches!(error, Error::TooManyEvents { limit: 50, foreseen: None, .. }), "{error}");
    assert!((49.0..=52.0).contains(&error.site().time), "{error}");
    let error = run(text, Settings { max_seconds: 1e-9, ..tight }, &[100.5]).expect_err("no time");
    assert!(matches!(error, Error::OutOfTime { .. }), "{error}");
    // A burst of generations in a small part of the time is no run without end.
    let burst = "initial string: A(0, 0)\nA(x, n): if x < 1e-7 solve dx/dt = 1, dn/dt = 0\n  \
                 if x = 1e-7 & n < 100000 produce A(0, n + 1)\n  if x = 1e-7 & n >= 100000 produce B";
    assert_eq!(run(burst, Settings::default(), &[1000.0]).expect("it ends")[0][0].0, "B");
}

/// Numbers at the ends of what there is.
const EXTREMES: [f64; 16] = [
    0.0, 1e-320, 5e-310, 1e-300, 1e-200, 1e-160, 1e-100, 1e-61, 1e-30, 1e-9, 1.0, 45.0, 1e16, 1e50, 1e99,
    1e308,
];

/// One of the extreme numbers, or nearly one, as a literal.
fn extreme(dice: &mut Dice) -> String {
    let x = dice.pick(&EXTREMES) * dice.pick(&[1.0, 1.0, -1.0, 0.7]);
    format!("{x:e}")
}

/// A file that takes ten million bytes and no more.
struct Bounded(Vec<u8>);

impl std::io::Write for Bounded {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.0.len() + bytes.len() > 10_000_000 {
            return Err(std::io::Error::other("large"));
        }
        self.0.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// A string of drawing commands with extreme numbers.
fn drawing(dice: &mut Dice) -> String {
    let mut text = String::from("initial string: F(1e-310)");
    for _ in 0..1 + dice.below(8) {
        let (a, b) = (extreme(dice), extreme(dice));
        text += &match dice.below(12) {
            0..=2 => format!(" F({a})"),
            3 => format!(" !({a})"),
            4 => format!(" +({a}) &({b})"),
            5 => format!(" @L({a})"),
            6 => format!(" f({a}) @K({b})"),
            7 => format!(" @T({a}) F({b}) @T(0)"),
            8 => format!(" @W({a}) F({b})"),
            9 => format!(" {{ f({a}) +(90) f({b}) +(90) f({a}) }}"),
            10 => format!(" [ +(30) F({a}) ] F({b})"),
            _ => format!(" ! F({a})"),
        };
    }
    text
}

#[test]
fn all_numbers_in_files_are_finite() {
    write_extreme_drawings(16);
}

#[test]
#[ignore = "slow: large meshes"]
fn all_numbers_in_many_files_are_finite() {
    write_extreme_drawings(60);
}

/// Writes drawings with extreme numbers in every format; no file may have a number that is not finite.
fn write_extreme_drawings(cases: usize) {
    let mut dice = Dice(7);
    let (mut drawn, mut refused) = (0, 0);
    for _ in 0..cases {
        let text = drawing(&mut dice);
        let accuracy = dice.pick(&[None, Some(1e-300), Some(1e-12), Some(1e300)]);
        let perspective = dice.pick(&[None, Some(40.0)]);
        let Ok(session) = dlsys::session::Session::from_text("test.dls", &text, &[]) else {
            panic!("{text}");
        };
        let mut string = ModuleString::default();
        let mut simulation = session.simulate(Settings::default()).expect("it starts");
        simulation.at(0.0, &mut string).expect("nothing happens");
        let mut scene = dlsys::turtle::blank(&session.model);
        if let Err(error) = dlsys::turtle::draw(&session.model, &string, &mut scene) {
            assert!(error.span.is_some(), "{text}: {error}");
            refused += 1;
            continue;
        }
        drawn += 1;
        let mut survey = Survey::new(View::FRONT);
        if let Some(field) = perspective {
            survey = survey.with_perspective(field);
        }
        survey.add(&scene);
        let mut fit = survey.fit();
        if let Some(accuracy) = accuracy {
            fit = fit.with_accuracy(accuracy);
        }
        for format in [Format::SVG, Format::OBJ, Format::PNG] {
            let mut file = Bounded(Vec::new());
            let written = FrameWriter::new(format, fit.clone()).write_to(&scene, "a drawing", &mut file);
            // Who asks for a thousandth of a thousandth gets large files; what they begin with is looked at.
            assert!(written.is_ok() || accuracy.is_some_and(|a| a < 1.0), "{text}: {format:?} is large");
            let bytes = file.0;
            if format == Format::PNG {
                continue;
            }
            let written = String::from_utf8_lossy(&bytes);
            let bad =
                written.split(|c: char| !c.is_alphanumeric()).find(|w| ["NaN", "inf", "nan"].contains(w));
            assert_eq!(bad, None, "{text}, accuracy {accuracy:?}, {perspective:?}: {format:?}");
        }
    }
    assert!(drawn > cases / 8 && refused > cases / 8, "{drawn} drawn, {refused} refused");
}

#[test]
fn a_stem_wider_than_long_is_a_small_file() {
    for (text, accuracy) in
        [("initial string: !(1e16) F(1)", None), ("initial string: F(1) @L(1)", Some(1e-300))]
    {
        let session = session(text);
        let mut string = ModuleString::default();
        session.simulate(Settings::default()).expect("starts").at(0.0, &mut string).expect("runs");
        let mut scene = dlsys::turtle::blank(&session.model);
        dlsys::turtle::draw(&session.model, &string, &mut scene).expect("drawable");
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        let fit = match accuracy {
            Some(accuracy) => survey.fit().with_accuracy(accuracy),
            None => survey.fit(),
        };
        let bytes = FrameWriter::new(Format::OBJ, fit).write(&scene, "a stem").len();
        assert!((1000..5_000_000).contains(&bytes), "{text}: {bytes}");
    }
}

#[test]
fn files_beyond_the_bound_are_an_error_that_names_what_is_drawn() {
    let folder = tempfile::tempdir().expect("a directory");
    let path = model(folder.path(), "initial string: F(1) F(1) @L(1)");
    let out = folder.path().join("out").display().to_string();
    let done = dlsys(&["render", &path, "--at", "0", "-o", &out, "--format", "obj", "--max-output", "2kB"]);
    let said = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(1), "{said}");
    assert!(said.contains("larger than 2 kB") && said.contains("pieces for `F`"), "{said}");
    assert!(said.contains("--max-output"), "{said}");
    assert!(!folder.path().join("out/frame-0000.obj").exists());
}

#[test]
fn a_killed_render_leaves_whole_frames_and_the_next_one_takes_over() {
    let kills = std::env::var("DLSYS_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(20);
    let folder = tempfile::tempdir().expect("a directory");
    let out = folder.path().join("out");
    let dragon = repository("models/dragon.dls");
    let start = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
        command.arg("render").arg(&dragon).arg("-o").arg(&out).args(["-q", "--to", "12", "--step", "0.5"]);
        command.spawn().expect("it starts")
    };
    let begun = Instant::now();
    assert!(start().wait().expect("it ends").success());
    let whole = begun.elapsed().as_micros() as usize;
    let mut dice = Dice(11);
    let mut cut = 0;
    for _ in 0..kills {
        let mut child = start();
        std::thread::sleep(Duration::from_micros(dice.below(whole) as u64));
        cut += usize::from(child.try_wait().expect("known").is_none());
        let _ = child.kill();
        child.wait().expect("it ends");
        for entry in std::fs::read_dir(&out).expect("there").map(|entry| entry.expect("readable")) {
            let name = entry.file_name().into_string().expect("plain");
            if name.ends_with(".svg") {
                let text = std::fs::read_to_string(entry.path()).expect("text");
                assert!(text.ends_with("</svg>\n"), "{name} is not whole");
            }
        }
    }
    assert!(cut >= kills / 4, "{cut} of {kills} were killed before their end");
    assert!(start().wait().expect("it ends").success(), "nothing is in the way");
    let left = std::fs::read_dir(&out)
        .expect("there")
        .filter(|entry| entry.as_ref().expect("readable").file_name().to_string_lossy().starts_with('.'));
    assert_eq!(left.count(), 0, "nothing is left behind");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let folder = tempfile::tempdir().expect("a directory");
    let path = model(folder.path(), "initial string: F(1)");
    // The device is opened for writing by the shell only: nothing that replaces files comes near it.
    for arguments in ["run MODEL --at 0", "run MODEL --at 0 --format json", "explain MODEL"] {
        let line =
            format!("exec {} {} > /dev/full", env!("CARGO_BIN_EXE_dlsys"), arguments.replace("MODEL", &path));
        let done = Command::new("sh").args(["-c", &line]).output().expect("a shell");
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(matches!(done.status.code(), Some(1 | 2)) && said.starts_with("error: "), "{line}: {said}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn little_memory_is_an_error_and_no_abort() {
    let folder = tempfile::tempdir().expect("a directory");
    let grows = "initial string: A(0)\nA(x): if x < 1 solve dx/dt = 1\n  if x = 1 produce A(0) A(0)";
    for (text, end) in [("initial string: A\nperiod 0.01\nA -> A A", "0.23"), (grows, "23")] {
        let path = model(folder.path(), text);
        let line = format!("ulimit -v 500000; exec {} run {path} --at {end}", env!("CARGO_BIN_EXE_dlsys"));
        let done = Command::new("sh").args(["-c", &line]).output().expect("a shell");
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{said}");
        assert!(said.starts_with("error: no memory for more than "), "{said}");
    }
    let path = model(folder.path(), grows);
    let done = dlsys(&["run", &path, "--at", "20", "--max-memory", "30MB"]);
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.code() == Some(1) && said.contains("`--max-memory`"), "{said}");
}

/// Surroundings count, too: those whose strain the rules read, and those of plants in a scene.
#[cfg(target_os = "linux")]
#[test]
fn stems_in_the_wind_keep_within_the_memory_that_is_allowed() {
    let folder = tempfile::tempdir().expect("a directory");
    let tuft = |rate: &str| {
        format!(
            "wind 1, 0, 0 speed 3 turbulence 0.3 scale 0.5\ntissue g = stiffness 1e8, density 700, damping 0.1\n\
             initial string: for i in 1 .. 40: ( [ /(137.5*i) &(2*i) @E(g) Blade(i/40) ] )\nBlade(x): solve dx/dt = {rate}\n\
             interpret Blade(x): !(0.03) F(x/2) @W(0.015) F(x/2) @W(0)\n"
        )
    };
    let fails = |arguments: &[&str]| {
        let done = dlsys(&[arguments, &["--max-memory", "50MB"]].concat());
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(1), "{said}");
        assert!(said.contains("no memory for") && said.contains("allow more with `--max-memory`"), "{said}");
    };
    fails(&["run", &model(folder.path(), &tuft("0.1 + strain")), "--at", "0.6"]);
    std::fs::write(folder.path().join("tuft.dls"), tuft("0.1")).expect("written");
    let field = "wind 1, 0, 0 speed 3 turbulence 0.3 scale 0.5\nplant @Tuft from \"tuft.dls\"\ninitial string: for i in 1 .. 12: ( [ f(i) @Tuft(-0.3) ] )";
    let out = folder.path().join("x.png");
    let out = out.to_str().expect("a path in UTF-8");
    fails(&["render", &model(folder.path(), field), "--at", "1", "-o", out, "--width", "50"]);
}

/// Each frame of a sheet is made of what is seen of it, as a picture of its own is.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "slow: a meadow"]
fn sheets_of_fields_need_little_memory() {
    let folder = tempfile::tempdir().expect("a directory");
    let out = folder.path().join("sheet.svg");
    let flags = "--set plants=300 --at 3 --layout grid --width 200 --threads 1";
    let program = env!("CARGO_BIN_EXE_dlsys");
    let line =
        format!("ulimit -v 1000000; exec {program} render models/meadow.dls {flags} -o {}", out.display());
    let done = Command::new("sh").args(["-c", &line]).output().expect("a shell");
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{said}");
    let picture = std::fs::read_to_string(out).expect("a picture");
    assert!(picture.matches("<path").count() > 300, "{} bytes", picture.len());
}

#[test]
fn a_bug_is_called_a_bug() {
    // The hook is there in builds with debug assertions only, as those of the tests are.
    let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
    let done = command.args(["check", "x.dls"]).env("DLSYS_PANIC", "at once").output().expect("it starts");
    let said = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(101), "{said}");
    assert!(said.contains("error: this is a bug in dlsys") && said.contains("please report it"), "{said}");
}
