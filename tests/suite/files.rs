//! Files that a model names: included texts and tables, where they are searched for, and the messages about them.

use std::path::{Path, PathBuf};

use dlsys::session::{LoadError, Session};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

use crate::common::{plain, show};

/// A scratch folder with files.
struct Home(tempfile::TempDir);

impl Home {
    fn new(files: &[(&str, &str)]) -> Home {
        let home = Home(tempfile::tempdir().expect("a folder"));
        for (name, text) in files {
            home.put(name, text);
        }
        home
    }

    fn put(&self, name: &str, text: &str) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        std::fs::write(path, text).expect("written");
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn open(&self, others: &[PathBuf]) -> Result<Session, Box<LoadError>> {
        Session::open_with(&self.path("model.dls"), &[], others)
    }

    /// The initial string.
    fn string(&self) -> String {
        let session = self.open(&[]).unwrap_or_else(|refused| panic!("{}", self.said(&refused)));
        let mut simulation = session.simulate(Settings::default()).expect("it starts");
        let mut string = ModuleString::default();
        simulation.at(0.0, &mut string).expect("it runs");
        show(&plain(&session.model, &string))
    }

    /// What is said, without the name of the scratch folder.
    fn said(&self, refused: &LoadError) -> String {
        let all: String = refused.diagnostics.iter().map(|d| d.render(&refused.source, false)).collect();
        all.replace(&self.0.path().display().to_string(), "~")
    }

    fn refusal(&self) -> String {
        match self.open(&[]) {
            Ok(_) => panic!("the model is not refused"),
            Err(refused) => self.said(&refused),
        }
    }
}

fn expect(said: &str, parts: &[&str]) {
    for part in parts {
        assert!(said.contains(part), "{part:?} is not in\n{said}");
    }
}

#[test]
fn included_texts_are_part_of_the_model() {
    let home = Home::new(&[
        (
            "model.dls",
            "include \"lib/organs.dls\"\ninclude \"./lib//organs.dls\"\ninitial string: F(size) G(half(4))\n",
        ),
        (
            "lib/organs.dls",
            "\u{feff}# organs\ninclude \"lib/numbers.dls\"\nF(x): solve dx/dt = size\ndef half(x) = x/2",
        ),
        ("lib/numbers.dls", "const size = 3"),
    ]);
    assert_eq!(home.string(), "F(3) G(2)");
    let session = home.open(&[]).expect("it is good");
    assert_eq!(session.model.rules.len(), 1);
    let mut inputs: Vec<String> =
        session.inputs.iter().map(|input| input.path.display().to_string()).collect();
    inputs.dedup();
    // Whoever watches the model watches these.
    assert_eq!(
        inputs.iter().filter(|path| path.ends_with("numbers.dls") || path.ends_with("organs.dls")).count(),
        2
    );
    assert_eq!(session.source.own_text().lines().count(), 3);
}

#[test]
fn messages_point_into_the_file_at_fault() {
    let home = Home::new(&[
        (
            "model.dls",
            "# one\n# two\ninclude \"organs.dls\"\ninitial string: F(1)\nF(x): solve dx/dt = speed(x, 1)\n",
        ),
        ("organs.dls", "# organs\ndef speed(x) = x*\n"),
    ]);
    expect(&home.refusal(), &["organs.dls:2:", "def speed(x) = x*"]);
    home.put("organs.dls", "\ndef speed(x) = x*raet\nconst rate = 2\n");
    expect(&home.refusal(), &["organs.dls:2:18", "unknown name `raet`"]);
    // One that stands in the model again, though files were read after it.
    home.put("organs.dls", "def speed(x) = x\n");
    expect(&home.refusal(), &["~/model.dls:5:21", "`speed` has 1 parameter, not 2"]);
    // A fault that is found in a run.
    home.put("organs.dls", "\n\nF(x): if x < 2 solve dx/dt = 1\n");
    home.put("model.dls", "include \"organs.dls\"\ninitial string: F(1)\n");
    let session = home.open(&[]).expect("it is good");
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let fault = simulation.at(5.0, &mut ModuleString::default()).expect_err("it leaves its domain");
    expect(&fault.diagnostic().render(&session.source, false), &["organs.dls:3:"]);
}

#[test]
fn includes_stay_inside_and_end() {
    let home = Home::new(&[("a.dls", "include \"b.dls\""), ("b.dls", "\ninclude \"a.dls\"")]);
    let ask = |line: &str| {
        home.put("model.dls", &format!("{line}\ninitial string: F(1)\n"));
        home.refusal()
    };
    expect(
        &ask("include \"a.dls\""),
        &["b.dls:2:9", "this closes the circle a.dls → b.dls → a.dls", "help:"],
    );
    for outside in ["../a.dls", "/etc/passwd", "lib/../../a.dls"] {
        expect(
            &ask(&format!("include \"{outside}\"")),
            &["model.dls:1:9", "leaves the model's folder", "--include-path"],
        );
    }
    expect(
        &ask("include \"..\\\\a.dls\""),
        &["model.dls:1:9", "separated by `/`, not by `\\`", "--include-path"],
    );
    expect(&ask("include \"model.dls\""), &["model.dls:1:9", "this file includes itself"]);
    expect(&ask("include \"nowhere.dls\""), &["there is no file ~/nowhere.dls", "--include-path"]);
    std::fs::create_dir(home.path("folder")).expect("made");
    expect(&ask("include \"folder\""), &["is not a file"]);
    std::fs::write(home.path("latin.dls"), b"# one\n# gr\xfc\xdfe\n").expect("written");
    expect(&ask("include \"latin.dls\""), &["line 2 of it is not valid UTF-8"]);
    for i in 0..30 {
        home.put(&format!("deep{i}.dls"), &format!("include \"deep{}.dls\"", i + 1));
    }
    expect(&ask("include \"deep0.dls\""), &["more than 20 deep", "deep19.dls:1:9"]);
    // A file that includes the model itself would double its rules.
    home.put("back.dls", "include \"model.dls\"");
    expect(&ask("include \"back.dls\""), &["closes the circle"]);
    #[cfg(unix)]
    {
        let elsewhere = tempfile::tempdir().expect("a folder");
        std::fs::write(elsewhere.path().join("secret.dls"), "const k = 1").expect("written");
        std::os::unix::fs::symlink(elsewhere.path().join("secret.dls"), home.path("link.dls")).expect("made");
        std::os::unix::fs::symlink(elsewhere.path(), home.path("door")).expect("made");
        for link in ["link.dls", "door/secret.dls"] {
            expect(&ask(&format!("include \"{link}\"")), &["leads out of the model's folder"]);
        }
    }
}

#[test]
fn other_folders_are_searched_when_told() {
    let library = Home::new(&[
        ("organs.dls", "const size = 3"),
        ("day.csv", "0,1\n1,5\n"),
        ("own.dls", "const who = 1"),
    ]);
    let home = Home::new(&[
        (
            "model.dls",
            "include \"organs.dls\"\ninclude \"own.dls\"\ntable day from \"day.csv\"\ninitial string: F(size, day(0.5), who)",
        ),
        ("own.dls", "const who = 2"),
    ]);
    expect(&home.refusal(), &["there is no file ~/organs.dls", "--include-path"]);
    let others: Vec<PathBuf> = vec![home.path("nothing-here"), library.0.path().to_owned()];
    let session = home.open(&others).unwrap_or_else(|refused| panic!("{}", home.said(&refused)));
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let mut string = ModuleString::default();
    simulation.at(0.0, &mut string).expect("it runs");
    // Its own folder comes first.
    assert_eq!(show(&plain(&session.model, &string)), "F(3, 3, 2)");

    let run = |arguments: &[&Path]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_dlsys"));
        command
            .arg("check")
            .arg(home.path("model.dls"))
            .args(arguments)
            .output()
            .expect("it runs")
            .status
            .code()
    };
    assert_eq!(run(&[]), Some(1));
    assert_eq!(run(&[Path::new("--include-path"), library.0.path()]), Some(0));
}

#[test]
fn tables_are_read_and_their_faults_told() {
    let home = Home::new(&[("data/growth.csv", "day,\"length\",mass\r\n0,1,10\r\n1,3,20\r\n3,4,50\r\n")]);
    home.put(
        "model.dls",
        "table length from \"data/growth.csv\"\ntable monotone mass from \"data/growth.csv\" column \"mass\"
        initial string: F(length(0.5), mass(3), integral(length, 0, 3), inverse(length, 2), length(99))",
    );
    assert_eq!(home.string(), "F(2, 50, 9, 0.5, 4)");
    let ask = |rest: &str| {
        home.put("model.dls", &format!("table g from {rest}\ninitial string: F(g(1))\n"));
        home.refusal()
    };
    expect(
        &ask("\"data/growth.csv\" column \"mas\""),
        &["model.dls:1:39", "no column \"mas\"", "did you mean `mass`?"],
    );
    expect(&ask("\"../growth.csv\""), &["leaves the model's folder"]);
    expect(&ask("\"data/none.csv\""), &["there is no file ~/data/none.csv"]);
    for (text, parts) in [
        ("0,1\n1,2\n0.5,3\n", ["line 3", "must ascend"]),
        ("0,1\n1,2\n1,3\n", ["line 3", "a jump at the end"]),
        ("0,1\n1,two\n", ["line 2", "expected a number, not `two`"]),
        ("0,1\n1\n", ["line 2", "there is no column 2"]),
        ("day,mass\n", ["no rows of numbers", "help:"]),
        ("", ["no rows", "help:"]),
        ("0,1\n", ["2 rows or more", "help:"]),
        ("0,1\n1,inf\n", ["line 2", "expected a number, not `inf`"]),
        ("0;1\n1;0,5\n", ["line 2", "the decimal sign is a point"]),
    ] {
        home.put("bad.csv", text);
        expect(&ask("\"bad.csv\""), &parts);
    }
    home.put("bad.csv", "0,1\n1,2\n2,3\n");
    expect(&ask("\"bad.csv\" periodic"), &["begins with 1 and ends with 3", "help:"]);
}
