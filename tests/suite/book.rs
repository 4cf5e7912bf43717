//! The book in `docs/`: its listings are run, and its outputs and pictures are compared with the results.
//!
//! The pages of a folder are processed in order, in one scratch folder with a copy of `models/`.
//! The info string of a fenced block determines its treatment:
//!
//! | block | treatment |
//! |---|---|
//! | `dlsys NAME.dls` | a whole model: saved, checked without a warning, run to the end of its `frames` (or t = 1) and drawn |
//! | `dlsys` | the same, not saved |
//! | `dlsys fragment` | a part of a model: parsed |
//! | `dlsys wrong NAME.dls` | a model with a mistake: saved; it is refused, or gets a warning |
//! | `sh` | commands, one per line: those that begin with `dlsys` are run and must succeed |
//! | `sh fails` | the last of them must fail with status 1 |
//! | `sh unrun` | not run; subcommands and flags must be those of `--help` |
//! | `repl` | a session, optionally with a model: lines that begin with `> ` or `  if` are input, the others are the expected answers |
//! | `output` | the expected output of the preceding block of commands; a line `…` stands for any lines |
//! | `KIND NAME.EXT` | any other file: saved |
//! | `rust`, `lpy`, `cpfg`, `text`, `json` | nothing |
//!
//! A picture whose title names a file, `![…](x.png "stem/grid.png")`, must equal that file as written by the preceding commands. With
//! `DLSYS_RENEW_GOLDEN=1` outputs and pictures are renewed; review every difference.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use dlsys::diagnostic::{Diagnostic, Source};
use dlsys::scene::Scene;
use dlsys::session::Session;
use dlsys::tree::ModuleString;

use crate::common::repository;
use crate::pages::{Block, Page, Piece};

fn renew() -> bool {
    std::env::var_os("DLSYS_RENEW_GOLDEN").is_some()
}

/// The chapters, in the order of the summary.
fn chapters() -> Vec<PathBuf> {
    let summary = Page::read(&repository("docs/src/SUMMARY.md"));
    summary.links().map(|(_, target)| repository("docs/src").join(target)).collect()
}

/// Follows the chapters of a folder of the book; `""` is the book's own.
fn follow(folder: &str) {
    let scratch = tempfile::tempdir().expect("a folder");
    copy(&repository("models"), &scratch.path().join("models"));
    let home = repository("docs/src").join(folder);
    let pages: Vec<PathBuf> =
        chapters().into_iter().filter(|p| p.parent() == Some(home.components().as_path())).collect();
    assert!(!pages.is_empty(), "no chapters in {folder}");
    let mut wrong = Vec::new();
    for path in pages {
        Reader::new(Page::read(&path), scratch.path(), &mut wrong).follow();
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("readable");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).expect("copied");
        }
    }
}

struct Reader<'a> {
    page: Page,
    scratch: &'a Path,
    wrong: &'a mut Vec<String>,
    /// What the last commands printed.
    printed: String,
    /// New texts of `output` blocks, by the line on which they begin.
    renewed: Vec<(usize, String)>,
}

impl<'a> Reader<'a> {
    fn new(page: Page, scratch: &'a Path, wrong: &'a mut Vec<String>) -> Reader<'a> {
        Reader { page, scratch, wrong, printed: String::new(), renewed: Vec::new() }
    }

    fn complain(&mut self, line: usize, what: impl std::fmt::Display) {
        self.wrong.push(format!("{}:{line}: {what}", self.page.path.display()));
    }

    fn follow(mut self) {
        for piece in std::mem::take(&mut self.page.pieces) {
            match piece {
                Piece::Block(block) => self.block(&block),
                Piece::Picture { line, file, title: Some(made) } => self.picture(line, &file, &made),
                _ => {}
            }
        }
        if renew() && !self.renewed.is_empty() {
            self.page.replace(&self.renewed);
        }
    }

    fn block(&mut self, block: &Block) {
        let words: Vec<&str> = block.info.split_whitespace().collect();
        let file = words.get(1..).unwrap_or_default().iter().find(|word| word.contains('.'));
        if let Some(name) = file.filter(|_| words[0] != "repl") {
            std::fs::write(self.scratch.join(name), &block.text).expect("saved");
        }
        match words[..] {
            ["dlsys", "fragment"] => {
                let source = Source::new(format!("line {}", block.line), &block.text);
                let said = dlsys::syntax::parse::parse(&source).1;
                self.no_faults(block, &said, &source);
            }
            ["dlsys", "wrong", ..] => {
                let read = Session::from_text("wrong.dls", &block.text, &[]);
                if read.is_ok_and(|session| session.warnings.is_empty()) {
                    self.complain(block.line, "there is no mistake in this");
                }
            }
            ["dlsys", ref rest @ ..] if rest.len() == usize::from(file.is_some()) => {
                self.model(block, file.copied())
            }
            ["sh", ref rest @ ..] if rest.len() <= 1 => self.commands(block, rest.first().copied()),
            ["repl", ref rest @ ..] if rest.len() <= 1 => self.session(block, rest.first().copied()),
            ["output"] => self.output(block),
            ["rust" | "lpy" | "cpfg" | "text" | "json", ..] => {}
            _ if file.is_some() => {}
            _ => self.complain(block.line, format!("what is a block of `{}`?", block.info)),
        }
    }

    fn no_faults(&mut self, block: &Block, said: &[Diagnostic], source: &Source) {
        if !said.is_empty() {
            let said: String = said.iter().map(|d| d.render(source, false)).collect();
            self.complain(block.line, said);
        }
    }

    /// A whole model is read without a remark, runs to the end of its frames and can be drawn.
    fn model(&mut self, block: &Block, name: Option<&str>) {
        let read = match name {
            Some(name) => Session::open(&self.scratch.join(name), &[]),
            None => Session::from_text("listing.dls", &block.text, &[]),
        };
        let session = match read {
            Ok(session) => session,
            Err(refused) => return self.no_faults(block, &refused.diagnostics, &refused.source),
        };
        self.no_faults(block, &session.warnings, &session.source);
        let end = session.model.frames.as_ref().map_or(1.0, |frames| frames.to);
        let mut string = ModuleString::default();
        let run = session.simulate(Default::default()).and_then(|mut run| run.at(end, &mut string));
        if let Err(error) = run {
            return self.no_faults(block, &[error.diagnostic()], &session.source);
        }
        if let Err(error) = dlsys::turtle::draw(&session.model, &string, &mut Scene::default()) {
            self.complain(block.line, error);
        }
    }

    fn commands(&mut self, block: &Block, how: Option<&str>) {
        self.printed.clear();
        let text = block.text.replace("\\\n", " ");
        let lines: Vec<&str> = text.lines().filter(|l| !l.trim().is_empty() && !l.starts_with('#')).collect();
        for (i, line) in lines.iter().enumerate() {
            if !line.starts_with("dlsys ") {
                if !["cargo ", "git ", "cd "].iter().any(|known| line.starts_with(known)) {
                    self.complain(block.line, format!("`{line}` is none of our commands"));
                }
                continue;
            }
            if how == Some("unrun") {
                self.flags(block, line);
                continue;
            }
            let expected = i32::from(how == Some("fails") && i + 1 == lines.len());
            let program = Path::new(env!("CARGO_BIN_EXE_dlsys"));
            let mut path = program.parent().expect("a folder").as_os_str().to_owned();
            path.push(":");
            path.push(std::env::var_os("PATH").unwrap_or_default());
            let mut shell = Command::new("sh");
            shell.args(["-c", line]).current_dir(self.scratch).env("PATH", path);
            let done = shell.output().expect("a shell");
            let [out, err] =
                [done.stdout, done.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
            if done.status.code() != Some(expected) {
                self.complain(block.line, format!("`{line}` ends with {}\n{out}{err}", done.status));
            }
            self.printed += &out;
            self.printed += &err;
        }
    }

    /// Commands that are shown and not run: their flags exist.
    fn flags(&mut self, block: &Block, line: &str) {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace().skip(1);
        let action = words.next().unwrap_or_default();
        let help =
            Command::new(env!("CARGO_BIN_EXE_dlsys")).args([action, "--help"]).output().expect("it starts");
        let help = String::from_utf8_lossy(&help.stdout).into_owned();
        if help.is_empty() {
            self.complain(block.line, format!("there is no `dlsys {action}`"));
        }
        for flag in words.filter(|word| word.starts_with('-') && word.len() > 1) {
            if !help.contains(flag.split('=').next().unwrap_or(flag)) {
                self.complain(block.line, format!("`dlsys {action}` has no {flag}"));
            }
        }
    }

    /// A session at the prompt: the statements of the block are run, and give the whole of it.
    fn session(&mut self, block: &Block, model: Option<&str>) {
        // A clause on a line of its own belongs to the rule typed before it.
        let typed = |line: &'_ str| line.starts_with("> ") || line.starts_with("  if ");
        let script: String =
            block.text.lines().filter(|line| typed(line)).flat_map(|line| [&line[2..], "\n"]).collect();
        let script_file = self.scratch.join("session.txt");
        std::fs::write(&script_file, script).expect("saved");
        let mut command = Command::new(env!("CARGO_BIN_EXE_dlsys"));
        command.args(["repl", "--echo"]).args(model).current_dir(self.scratch);
        command.stdin(std::fs::File::open(script_file).expect("readable"));
        let done = command.output().expect("it starts");
        self.printed = String::from_utf8_lossy(&[done.stdout, done.stderr].concat()).into_owned();
        if done.status.code() != Some(0) {
            self.complain(block.line, format!("the session ends with {}", done.status));
        }
        self.output(block);
    }

    fn output(&mut self, block: &Block) {
        if matches(&block.text, &self.printed) {
            return;
        }
        if renew() && !block.text.lines().any(|line| line.trim() == "…") {
            self.renewed.push((block.line, self.printed.clone()));
            return;
        }
        let what = format!("what is run here prints\n{}", self.printed);
        self.complain(block.line, what);
    }

    fn picture(&mut self, line: usize, shown: &str, made: &str) {
        let shown = self.page.path.parent().expect("a folder").join(shown);
        let made = self.scratch.join(made);
        if !made.is_file() {
            return self.complain(line, format!("no command has made {}", made.display()));
        }
        if shown.is_file() && alike(&shown, &made) {
            return;
        }
        if renew() {
            std::fs::create_dir_all(shown.parent().expect("a folder")).expect("made");
            std::fs::copy(&made, &shown).expect("copied");
            return;
        }
        self.complain(line, "this is no longer the picture that the commands make; renew it, and look at it");
    }
}

/// Whether a text is what is shown of it, where `…` on a line stands for any number of lines. Trailing space and
/// blank lines at the ends do not count.
fn matches(shown: &str, text: &str) -> bool {
    fn lines(text: &str) -> Vec<&str> {
        text.trim_matches('\n').lines().map(str::trim_end).collect()
    }
    fn same(shown: &[&str], text: &[&str]) -> bool {
        match shown.split_first() {
            None => text.is_empty(),
            Some((first, rest)) if first.trim() == "…" => {
                (0..=text.len()).any(|skip| same(rest, &text[skip..]))
            }
            Some((first, rest)) => text.first() == Some(first) && same(rest, &text[1..]),
        }
    }
    same(&lines(shown), &lines(text))
}

/// Whether two pictures show the same: one size, and on average less than one of 255 levels apart.
fn alike(a: &Path, b: &Path) -> bool {
    if a.extension().is_some_and(|extension| extension == "svg") {
        return std::fs::read(a).ok() == std::fs::read(b).ok();
    }
    let read = |path: &Path| {
        let file = std::io::BufReader::new(std::fs::File::open(path).expect("readable"));
        let mut reader = png::Decoder::new(file).read_info().expect("a picture");
        let mut pixels = vec![0; reader.output_buffer_size().expect("its size")];
        let info = reader.next_frame(&mut pixels).expect("pixels");
        pixels.truncate(info.buffer_size());
        ((info.width, info.height), pixels)
    };
    let ((size, a), (other, b)) = (read(a), read(b));
    let apart: u64 = a.iter().zip(&b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    size == other && a.len() == b.len() && apart <= a.len() as u64
}

#[test]
fn the_tutorial_gives_what_it_says() {
    follow("tutorial");
}

#[test]
fn the_language_reference_runs() {
    follow("language");
}

#[test]
fn the_pages_of_the_models_are_true() {
    follow("models");
}

#[test]
fn the_other_chapters_are_true() {
    follow("");
}

#[test]
fn every_page_is_in_the_summary_and_every_link_leads_somewhere() {
    let book = repository("docs/src");
    let listed = chapters();
    let unique: HashSet<&PathBuf> = listed.iter().collect();
    assert_eq!(unique.len(), listed.len(), "a page is listed twice");
    let mut wrong = Vec::new();
    let mut folders = vec![book.clone()];
    let mut pages = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                if !unique.contains(&path) && !path.ends_with("SUMMARY.md") {
                    wrong.push(format!("{} is not in the summary", path.display()));
                }
                pages.push(path);
            }
        }
    }
    for page in ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "models/hard/README.md"] {
        pages.push(repository(page));
    }
    for path in &pages {
        let page = Page::read(path);
        for (line, target) in page.links() {
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let (file, anchor) =
                target.split_once('#').map_or((target, None), |(file, anchor)| (file, Some(anchor)));
            let to = if file.is_empty() { path.clone() } else { path.parent().expect("a folder").join(file) };
            if !to.exists() {
                wrong.push(format!("{}:{line}: {target} is not there", path.display()));
            } else if let Some(anchor) = anchor
                && !Page::read(&to).anchors().any(|a| a == anchor)
            {
                wrong.push(format!("{}:{line}: {target} has no such heading", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn dots_stand_for_lines() {
    assert!(matches("a\n…\nd\n", "a\nb\nc\nd\n"));
    assert!(matches("…\n", ""));
    assert!(!matches("a\n…\nd\n", "a\nb\n"));
    assert!(!matches("a\n", "a\nb\n"));
}
