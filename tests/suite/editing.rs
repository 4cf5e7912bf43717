//! The edit loop: layout, a new model, rendering while a file is edited, completions and manual pages.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use dlsys::diagnostic::Source;
use dlsys::session::Session;
use dlsys::syntax::{format::format, parse, print};
use proptest::prelude::*;

use crate::cli::{bad, dlsys, good};
use crate::common::{models, repository};

/// What a text says, whatever its layout; `None` if it does not parse.
fn meaning(text: &str) -> Option<String> {
    let (document, errors) = parse::parse(&Source::new("t", text));
    errors.is_empty().then(|| print::document(&document))
}

fn laid_out(text: &str) -> Option<String> {
    format(&Source::new("t", text)).ok()
}

#[test]
fn the_layout_of_every_model_is_canonical_once_and_means_the_same() {
    let mut parsed = 0;
    for path in models() {
        let Ok(text) = String::from_utf8(fs::read(&path).expect("readable")) else { continue };
        let Some(meaning_before) = meaning(&text) else {
            assert!(laid_out(&text).is_none(), "{} does not parse", path.display());
            continue;
        };
        parsed += 1;
        let once = laid_out(&text).unwrap_or_else(|| panic!("{} has no layout", path.display()));
        assert_eq!(laid_out(&once).as_ref(), Some(&once), "{}", path.display());
        // Those that people read first are laid out.
        assert!(!path.starts_with(repository("models")) || once == text, "{}: `dlsys fmt`", path.display());
        assert_eq!(meaning(&once), Some(meaning_before), "{}", path.display());
        assert_eq!(comments(&once), comments(&text), "{}", path.display());
    }
    assert!(parsed > 150, "{parsed}");
}

/// `dlsys check` has nothing to say of a model that people begin from.
#[test]
fn no_model_has_a_warning() {
    // One is included by others and has no initial string, the other one is about what the warning says.
    let others = ["barley/organs", "hard/n21-outside-the-domain"]
        .map(|name| repository(&format!("models/{name}.dls")));
    let mut whole = 0;
    for path in
        models().into_iter().filter(|path| path.starts_with(repository("models")) && !others.contains(path))
    {
        let session = Session::open(&path, &[]).unwrap_or_else(|refused| panic!("{refused}"));
        let warnings: String = session.warnings.iter().map(|d| d.render(&session.source, false)).collect();
        assert!(warnings.is_empty(), "{warnings}");
        whole += 1;
    }
    assert!(whole > 150, "{whole}");
}

fn comments(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.find('#').map(|at| line[at..].trim_end())).collect()
}

/// Other white space where white space is, and some where it may be.
fn shaken(text: &str, choices: &[u8]) -> String {
    let mut choices = choices.iter().cycle();
    let mut out = String::new();
    for line in text.lines() {
        let (code, comment) = line.split_at(line.find(['#', '"']).unwrap_or(line.len()));
        for c in code.chars() {
            match (c, choices.next()) {
                (' ', Some(0..60)) => out.push_str("   "),
                (' ', Some(60..90)) => out.push('\t'),
                (',' | ')' | '*', Some(0..80)) => {
                    out.push(' ');
                    out.push(c);
                }
                _ => out.push(c),
            }
        }
        out.push_str(comment);
        match choices.next() {
            Some(0..40) => out.push_str("  \n"),
            Some(40..70) => out.push_str("\r\n"),
            _ => out.push('\n'),
        }
        if comment.is_empty() && code.is_empty() {
            out.push_str("\n\n");
        }
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn white_space_does_not_matter(which in 0usize..1000, choices in prop::collection::vec(any::<u8>(), 40..200)) {
        let models = models();
        let path = &models[which % models.len()];
        let Ok(text) = String::from_utf8(fs::read(path).expect("readable")) else { return Ok(()) };
        let wild = shaken(&text, &choices);
        let Some(before) = meaning(&wild) else { return Ok(()) };
        let once = laid_out(&wild).expect("a layout");
        prop_assert_eq!(meaning(&once), Some(before), "{}", path.display());
        prop_assert_eq!(laid_out(&once), Some(once), "{}", path.display());
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn fmt_replaces_files_whole_or_not_at_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let [wild, broken] = ["wild.dls", "broken.dls"].map(|name| folder.path().join(name));
    fs::write(&wild, "axiom:F( 1 )\n\n\n").expect("written");
    fs::write(&broken, "axiom: F(").expect("written");
    let (status, said) = bad(&["fmt", "--check", text(&wild)]);
    assert!(
        status == 1 && said.contains("1 file not in canonical layout") && said.contains("help"),
        "{said}"
    );
    assert_eq!(fs::read_to_string(&wild).expect("there"), "axiom:F( 1 )\n\n\n");
    let (status, said) = bad(&["fmt", text(&broken), text(&wild), "missing.dls"]);
    assert!(status == 1 && said.contains("never closed") && said.contains("2 files left as found"), "{said}");
    assert_eq!(fs::read_to_string(&wild).expect("there"), "axiom: F(1)\n", "the others are laid out");
    assert_eq!(fs::read_to_string(&broken).expect("there"), "axiom: F(");
    assert_eq!(good(&["fmt", text(&wild)]), "", "nothing to do");
    good(&["fmt", "--check", text(&wild)]);
    let left: Vec<_> = fs::read_dir(folder.path()).expect("a folder").collect();
    assert_eq!(left.len(), 2, "nothing is left beside them");
}

#[test]
fn fmt_reads_standard_input() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_dlsys"))
        .args(["fmt", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    child.stdin.take().expect("a pipe").write_all(b"axiom:F  [+F]").expect("written");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!((output.status.code(), &output.stdout[..]), (Some(0), &b"axiom: F [+F]\n"[..]));
}

#[test]
fn a_new_model_renders_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let name = folder.path().join("fern");
    let said = good(&["new", text(&name)]);
    let model = name.with_extension("dls");
    assert!(said.contains("dlsys render") && said.contains("fern.dls"), "{said}");
    good(&["fmt", "--check", text(&model)]);
    let said = good(&["render", text(&model), "-o", text(&name), "--at", "12"]);
    assert!(said.starts_with("1 frame, ") && said.contains("frame-0000.svg"), "{said}");
    assert_eq!(good(&["render", text(&model), "-o", text(&name), "--at", "12", "--quiet"]), "");
    fs::write(&model, "mine").expect("written");
    let (status, said) = bad(&["new", text(&name)]);
    assert!(status == 2 && said.contains("not overwritten") && said.contains("help"), "{said}");
    assert_eq!(fs::read_to_string(&model).expect("there"), "mine");
}

#[test]
fn shells_and_man_know_the_commands() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = good(&["completions", shell]);
        assert!(script.contains("render") && script.contains("tolerance"), "{shell}");
    }
    assert!(good(&["man"]).contains(".TH dlsys"));
    assert!(good(&["man", "render"]).contains("perspective"));
    let (status, said) = bad(&["man", "rendr"]);
    assert!(status == 2 && said.contains("render"), "{said}");
}

/// A process that is ended with the test.
struct Watching(Child);

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until something is so.
fn until(what: &str, so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !so() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn watch_renders_again_and_keeps_frames_through_mistakes() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let (model, frame, manifest) = (at("m.dls"), at("out/frame-0000.svg"), at("out/manifest.json"));
    fs::write(&model, "title \"first\"\naxiom: F(1)").expect("written");
    let log = fs::File::create(at("log")).expect("a file");
    let child = Command::new(env!("CARGO_BIN_EXE_dlsys"))
        .args(["render", text(&model), "-o", text(&at("out")), "--at", "1", "--watch"])
        .stdout(log.try_clone().expect("a file"))
        .stderr(log)
        .spawn()
        .expect("the program starts");
    let _watching = Watching(child);
    let said = |what: &str| fs::read_to_string(at("log")).is_ok_and(|log| log.contains(what));
    let shows =
        |what: &str| fs::read_to_string(&frame).is_ok_and(|svg| svg.contains(what)) && manifest.exists();
    until("the first render", || shows("first") && said("watching"));
    fs::write(&model, "title \"second\"\naxiom: F(").expect("written");
    until("the mistake is shown", || said("never closed") && said("keeps the frames"));
    assert!(shows("first"), "the frames stay");
    // As editors do that write aside.
    fs::write(at("new"), "title \"third\"\naxiom: @M(2)\nsurface @M from \"m.obj\"").expect("written");
    fs::rename(at("new"), &model).expect("renamed");
    until("the missing surface is shown", || said("there is no file"));
    fs::write(at("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    until("the surface is seen", || shows("third"));
}

#[test]
fn what_is_wrong_with_the_command_line_ends_watching() {
    let output = dlsys(&["render", "models/dragon.dls", "-o", "out", "--watch", "--set", "nothing=1"]);
    assert_eq!(output.status.code(), Some(2));
}
