//! The interactive session: transcripts of scripts, and a terminal with keys pressed.
//!
//! `tests/sessions/NAME.txt` is a script, `tests/golden/repl-NAME.txt` its output, errors included. To renew the
//! transcripts after an intended change, run the tests with `DLSYS_RENEW_GOLDEN=1`, and review every difference.

use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::repository;

/// Runs a script; gives the exit status, the answers and the complaints.
fn session(arguments: &[&str], script: &str) -> (i32, String, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_dlsys"))
        .arg("repl")
        .args(arguments)
        .current_dir(repository(""))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    child.stdin.take().expect("a pipe").write_all(script.as_bytes()).expect("it reads");
    let out = child.wait_with_output().expect("it ends");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (out.status.code().expect("a status"), text(out.stdout), text(out.stderr))
}

#[test]
fn scripts_give_their_transcripts() {
    for (name, status) in [("plant", 0), ("mistakes", 1), ("anabaena", 0)] {
        let script =
            std::fs::read_to_string(repository(&format!("tests/sessions/{name}.txt"))).expect("there");
        let (code, answers, complaints) = session(&["--echo"], &script);
        assert_eq!(code, status, "{name}: {complaints}");
        let shown = format!("{answers}\n------ standard error\n{complaints}");
        let path = repository(&format!("tests/golden/repl-{name}.txt"));
        if std::env::var_os("DLSYS_RENEW_GOLDEN").is_some() {
            std::fs::write(&path, &shown).expect("written");
        }
        let stored = std::fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
        assert!(shown == stored, "{name} gives\n{shown}");
    }
}

/// Lines of cpfg get the hints that they get in a file.
#[test]
fn lines_of_cpfg_get_their_hints() {
    let (code, _, complaints) = session(&[], "homomorphism\n/* a tree */\nendlsystem\n");
    assert_eq!(code, 1);
    for hint in ["`interpret A(x): F(x)`", "a comment begins with `#`", "a model ends with its file"] {
        assert!(complaints.contains(hint), "{hint}: {complaints}");
    }
}

#[test]
fn files_are_written_whole_and_those_of_others_left_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    std::fs::write(path("mine.svg"), "precious").expect("written");
    let script = format!(
        "load models/leaf.dls\nset n_0 = 2\nrun 5\nexport {}\nexport {}\nexport {}\nexport {}\nexport {} --view 30,20 --width 200\nexport {}\nsave {}\nrender -o {} --at 1,2\n",
        path("a.json"),
        path("a.json"),
        path("mine.svg"),
        path("a.obj"),
        path("a.png"),
        path("a.txt"),
        path("leaf.dls"),
        path("frames"),
    );
    let (code, answers, complaints) = session(&[], &script);
    assert_eq!(code, 1, "{answers}{complaints}");
    assert!(
        complaints.contains("mine.svg is there already")
            && complaints.contains("1 of 11 statements failed, line 6")
    );
    assert_eq!(std::fs::read_to_string(path("mine.svg")).expect("there"), "precious");
    // What is exported is what a run gives.
    let run = Command::new(env!("CARGO_BIN_EXE_dlsys"))
        .args(["run", "models/leaf.dls", "--at", "5", "--set", "n_0=2", "--format", "json"])
        .current_dir(repository(""))
        .output()
        .expect("it runs");
    assert_eq!(std::fs::read(path("a.json")).expect("written"), run.stdout);
    assert!(std::fs::read(path("a.png")).expect("written").starts_with(b"\x89PNG"));
    assert!(std::fs::read_to_string(path("a.obj")).expect("written").contains("mtllib"));
    let model = std::fs::read(repository("models/leaf.dls")).expect("there");
    assert_eq!(std::fs::read(path("leaf.dls")).expect("written"), model);
    assert_eq!(std::fs::read_dir(path("frames")).expect("made").count(), 3);
}

#[test]
fn a_model_on_the_command_line_is_loaded_first() {
    let (code, answers, _) =
        session(&["models/dragon.dls", "--tolerance", "1e-8"], "run 2\nback\nquit\nnonsense\n");
    assert_eq!(code, 0);
    assert!(answers.contains("t = 2: ") && answers.contains("t = 1: "), "{answers}");
    let (code, _, complaints) = session(&["no-such-file.dls"], "");
    assert!(code == 1 && complaints.contains("cannot be read"), "{complaints}");
    let (code, answers, complaints) = session(&[], "");
    assert_eq!((code, answers.as_str(), complaints.as_str()), (0, "", ""));
}

#[test]
fn reloading_keeps_the_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.dls");
    std::fs::write(&path, "initial string: F(1)\nF(x): solve dx/dt = 1").expect("written");
    let file = path.to_str().expect("UTF-8");
    let script = format!("load {file}\nrun 2\nF(x): solve dx/dt = 2\nshow\nreload\nshow\nundo\nshow\n");
    let (code, answers, complaints) = session(&[], &script);
    assert_eq!(code, 0, "{complaints}");
    let lengths: Vec<&str> = answers.lines().filter(|line| line.starts_with("  F(")).collect();
    assert_eq!(lengths, ["  F(5)", "  F(3)", "  F(5)"], "{answers}");
}

/// A terminal of 80 by 24 characters, in tmux.
struct Terminal {
    socket: String,
}

impl Terminal {
    fn start(home: &std::path::Path, arguments: &str) -> Terminal {
        let socket = format!("dlsys-test-{}", std::process::id());
        let terminal = Terminal { socket };
        let command = format!(
            "env XDG_STATE_HOME='{}' NO_COLOR=1 '{}' repl {arguments}",
            home.display(),
            env!("CARGO_BIN_EXE_dlsys")
        );
        let folder = repository("");
        let folder = folder.to_str().expect("UTF-8");
        terminal.tmux(&[
            "-f",
            "/dev/null",
            "new-session",
            "-d",
            "-x",
            "80",
            "-y",
            "24",
            "-c",
            folder,
            &command,
        ]);
        terminal
    }

    fn tmux(&self, arguments: &[&str]) -> String {
        let out = Command::new("tmux")
            .args(["-u", "-L", &self.socket])
            .args(arguments)
            .output()
            .expect("tmux is installed");
        String::from_utf8_lossy(&out.stdout).into_owned()
    }

    fn keys(&self, keys: &[&str]) {
        let mut all = vec!["send-keys"];
        all.extend(keys);
        self.tmux(&all);
    }

    fn screen(&self) -> String {
        self.tmux(&["capture-pane", "-p"])
    }

    /// Waits until the screen shows something.
    fn expect(&self, wanted: impl Fn(&str) -> bool, what: &str) -> String {
        let begin = Instant::now();
        loop {
            let screen = self.screen();
            if wanted(&screen) {
                return screen;
            }
            assert!(begin.elapsed() < Duration::from_secs(60), "{what} does not come:\n{screen}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Types a line and waits for its answer.
    fn line(&self, line: &str, answer: &str) -> String {
        self.keys(&["-l", line]);
        self.keys(&["Enter"]);
        self.expect(|screen| screen.contains(answer), answer)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.tmux(&["kill-server"]);
    }
}

/// The last line on the screen that is not empty.
fn last(screen: &str) -> &str {
    screen.trim_end().lines().last().unwrap_or("").trim_end()
}

#[test]
#[ignore = "needs tmux"]
fn a_first_hour_at_the_terminal() {
    let home = tempfile::tempdir().expect("a folder");
    let terminal = Terminal::start(home.path(), "");
    terminal.expect(|screen| last(screen) == ">", "the prompt");
    terminal.line("initial string: A(0)", "t=0>");
    // A rule over several lines; an empty one ends it.
    terminal.keys(&["-l", "A(x):"]);
    terminal.keys(&["Enter"]);
    terminal.keys(&["-l", "  if x < 1 solve dx/dt = 1"]);
    terminal.keys(&["Enter"]);
    terminal.keys(&["-l", "  if x = 1 produce F(x) [ +(30) A(0) ] [ -(20) A(0.3) ]"]);
    terminal.keys(&["Enter"]);
    terminal.expect(|screen| screen.contains("Enter ends the rule"), "the hint");
    terminal.keys(&["Enter"]);
    terminal.expect(|screen| screen.contains("\nA(x)\n"), "the rule");
    // A hint, and completion.
    terminal.keys(&["-l", "insp"]);
    terminal.expect(|screen| last(screen) == "t=0> inspect", "the hint");
    terminal.keys(&["Right"]);
    terminal.keys(&["-l", " A"]);
    terminal.keys(&["Enter"]);
    terminal.expect(|screen| screen.contains("replaced at t = 1, by line 4"), "the module");
    terminal.line("run 4", "t = 4: 65 modules, 16 productions so far");
    let picture = terminal.line("draw", "⡇");
    assert!(picture.lines().all(|line| line.chars().count() <= 80));
    terminal.keys(&["-l", "expl"]);
    terminal.keys(&["Tab"]);
    terminal.expect(|screen| last(screen).starts_with("t=4> explain "), "the completion");
    terminal.keys(&["C-u"]);
    // A mistake takes nothing with it.
    terminal.line("A(x): solve dx/dt = z", "unknown name `z`");
    terminal.line("back to 1.5", "t = 1.5:");
    // A long run is stopped, and the session goes on.
    terminal.line("new", ">");
    terminal.line("initial string: P(1, 0)", "t=0>");
    terminal.line("P(x, v): solve dx/dt = v, dv/dt = -sin(x)", "P(x, v)\n");
    terminal.keys(&["-l", "run 1e9"]);
    terminal.keys(&["Enter"]);
    std::thread::sleep(Duration::from_millis(300));
    terminal.keys(&["C-c"]);
    terminal.expect(|screen| screen.contains("stopped at t = "), "the stop");
    terminal.line("back to 0.5", "t = 0.5: 1 module");
    terminal.keys(&["C-d"]);
    let history = home.path().join("dlsys/history");
    let begin = Instant::now();
    while terminal.tmux(&["has-session"]).is_empty() && begin.elapsed() < Duration::from_millis(500) {
        std::thread::sleep(Duration::from_millis(20));
    }
    let kept = std::fs::read_to_string(&history).expect("a history");
    assert!(kept.contains("run 4") && kept.contains("if x = 1 produce"), "{kept}");
    drop(terminal);
    // The next session knows what was typed.
    let terminal = Terminal::start(home.path(), "models/leaf.dls");
    terminal.expect(|screen| last(screen) == "t=0>", "the prompt");
    terminal.keys(&["Up"]);
    terminal.expect(|screen| last(screen) == "t=0> back to 0.5", "the history");
}
