//! Output of `explain`, `--events` and `check --continuity`.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::cli::{bad, dlsys, good};
use crate::common::repository;

/// A file of a temporary folder.
struct Scratch(tempfile::TempDir);

impl Scratch {
    fn new() -> Scratch {
        Scratch(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("UTF-8").to_owned()
    }

    fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.path(name), text).expect("written");
        self.path(name)
    }

    /// A file of JSON lines.
    fn lines(&self, name: &str) -> Vec<Value> {
        let text = std::fs::read_to_string(self.path(name)).expect("written");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }
}

#[test]
fn the_dragon_replaces_a_generation_at_one_instant() {
    let scratch = Scratch::new();
    let file = scratch.path("events.jsonl");
    good(&["run", "models/dragon.dls", "--at", "0.5,3", "--events", &file]);
    let events = scratch.lines("events.jsonl");
    let mut groups: BTreeMap<u64, (f64, usize)> = BTreeMap::new();
    for event in &events {
        let t = event["t"].as_f64().expect("a time");
        let group = groups.entry(event["group"].as_u64().expect("a number")).or_insert((t, 0));
        assert_eq!(group.0, t, "one group, one time");
        group.1 += 1;
    }
    // Of 2^n sides, each with a long side that vanishes, but for the first.
    let expected = [(0.0, 1), (1.0, 3), (2.0, 6), (3.0, 12)];
    assert_eq!(groups.into_values().collect::<Vec<_>>(), expected);
    let second = &events[1];
    assert_eq!(second["lineage"], "3.2");
    assert_eq!(second["id"].as_str().map(str::len), Some(13));
    assert_eq!((&second["module"], &second["rule"]), (&"F_r".into(), &"F_r(x, s)".into()));
    assert_eq!((&second["clause"], &second["line"]), (&1.into(), &21.into()));
    assert!(events.iter().all(|e| e["residual"].as_f64().is_some_and(|r| r < 1e-12)));
}

#[test]
fn anabaena_logs_its_351_events() {
    let scratch = Scratch::new();
    let file = scratch.path("events.jsonl");
    good(&["run", "tests/paper-models/anabaena.dls", "--tolerance", "1e-10", "--events", &file]);
    let events = scratch.lines("events.jsonl");
    let text = std::fs::read_to_string(repository("tests/reference/anabaena_events.json")).expect("there");
    let reference: Value = serde_json::from_str(&text).expect("JSON");
    let reference = reference["events"].as_array().expect("events");
    assert_eq!((events.len(), reference.len()), (351, 351));
    for (event, expected) in events.iter().zip(reference) {
        let t: f64 = expected[0].as_str().and_then(|t| t.parse().ok()).expect("a time");
        let clause = if expected[1] == "s" { 1 } else { 2 };
        assert!((event["t"].as_f64().expect("a time") - t).abs() < 1e-9 * t.max(1.0), "{event}");
        assert_eq!(event["clause"], clause, "{event}");
    }
}

#[test]
fn the_event_log_is_the_same_however_a_model_is_observed() {
    let scratch = Scratch::new();
    let (a, b, frames) = (scratch.path("a"), scratch.path("b"), scratch.path("frames"));
    good(&["run", "models/leaf.dls", "--events", &a]);
    good(&["render", "models/leaf.dls", "--at", "9", "-o", &frames, "--events", &b]);
    assert_eq!(scratch.lines("a").len(), 5);
    assert_eq!(scratch.lines("a"), scratch.lines("b"));
}

#[test]
fn events_before_an_error_are_logged() {
    let scratch = Scratch::new();
    let file = scratch.path("events.jsonl");
    let model = scratch.write(
        "blow.dls",
        "initial string: A(0)\nA(x):\n  if x < 1 solve dx/dt = 1\n  if x = 1 produce B(1)\nB(x): solve dx/dt = x^3",
    );
    let (status, _) = bad(&["run", &model, "--at", "5", "--events", &file]);
    let events = scratch.lines("events.jsonl");
    assert_eq!((status, events.len(), events[0]["t"].as_f64()), (1, 1, Some(1.0)));
    let (status, message) = bad(&["run", &model, "--at", "0", "--events", &scratch.path("no/such/folder")]);
    assert!(status == 2 && message.contains("there is no directory"), "{message}");
}

#[test]
fn explain_says_what_is_stored() {
    for name in ["anabaena", "leaf"] {
        let shown = good(&["explain", &format!("models/{name}.dls")]);
        assert!(shown.lines().all(|line| line.chars().count() <= 100), "{shown}");
        let path = repository(&format!("tests/golden/explain-{name}.txt"));
        if std::env::var_os("DLSYS_RENEW_GOLDEN").is_some() {
            std::fs::write(&path, &shown).expect("written");
        }
        assert_eq!(shown, std::fs::read_to_string(&path).expect("stored"), "{name}");
    }
}

#[test]
fn explain_speaks_json() {
    let plan: Value =
        serde_json::from_str(&good(&["explain", "models/anabaena.dls", "--format", "json"])).expect("JSON");
    let kind = |name: &str| {
        let kinds = plan["kinds"].as_array().expect("kinds");
        kinds.iter().find(|kind| kind["name"] == name).expect("a kind").clone()
    };
    assert_eq!((&kind("F_v")["work"], &kind("F_h")["work"]), (&"coupled".into(), &"formulas".into()));
    assert_eq!(kind("F_h")["drawn_only"], serde_json::json!(["x"]));
    let rule = &plan["rules"][kind("F_v")["rules"][0].as_u64().expect("a rule") as usize];
    let parameters = &rule["solves"][0]["parameters"];
    assert_eq!(parameters[0]["class"], "closed form");
    assert_eq!(parameters[0]["law"], "exponential growth");
    assert_eq!(parameters[1]["class"], "coupled and linear");
    assert_eq!(parameters[1]["reads"], serde_json::json!(["c", "c_l", "c_r"]));
    let conditions = rule["conditions"].as_array().expect("conditions");
    let classes: Vec<&Value> = conditions.iter().map(|c| &c["found"][0]["class"]).collect();
    assert_eq!(classes, ["closed-form time", "root on dense output"]);
    assert_eq!(plan["summary"]["closed_form"], false);
}

/// The report on a model, and what `--deny` makes of it for C0 and C1.
fn continuity(text: &str) -> (String, [Option<i32>; 2]) {
    let scratch = Scratch::new();
    let model = scratch.write("model.dls", text);
    let report = good(&["check", "--continuity", "--to", "3", &model]);
    let denied = ["c0", "c1"]
        .map(|order| dlsys(&["check", "--continuity", "--to", "3", "--deny", order, &model]).status.code());
    (report, denied)
}

/// A line of a report that begins with a quantity, its words joined by one space.
fn row(report: &str, quantity: &str) -> String {
    let line = report.lines().find(|line| line.trim_start().starts_with(quantity)).unwrap_or("");
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_jump_in_length_is_found() {
    // One line becomes two, 0.1 too long; it grew at 1, they grow at 0.5 each.
    let (report, denied) = continuity(
        "initial string: F(1)\nF(x):\n  if x < 2 solve dx/dt = 1\n  if x = 2 produce G(1.1) G(1)
         G(x): solve dx/dt = 0.5\ninterpret G(x): F(x)",
    );
    assert!(report.contains("F(x), line 4: fired 1 time; discontinuous"), "{report}");
    assert_eq!(row(&report, "length"), "length 2 -> 2.1 by 0.1 (4.76%) at t = 1");
    assert_eq!(row(&report, "position"), "position by 0.1 (4.76%) at t = 1");
    assert_eq!(row(&report, "speed"), "", "{report}");
    assert_eq!(denied, [Some(1), Some(1)]);
}

#[test]
fn a_jump_in_direction_is_found_where_something_follows() {
    let model = |after: &str| {
        format!(
            "initial string: A(0) {after}\nA(x):\n  if x < 1 solve dx/dt = 1\n  if x = 1 produce F_i(1) +(30) /(20)
             F_i(x): solve dx/dt = 1\ninterpret A(x): F(x)"
        )
    };
    let (report, denied) = continuity(&model("F(1)"));
    assert_eq!(row(&report, "heading"), "heading by 30° at t = 1");
    assert_eq!(row(&report, "roll"), "roll by 20° at t = 1");
    assert_eq!((row(&report, "position"), row(&report, "speed")), (String::new(), String::new()));
    assert_eq!(denied, [Some(1), Some(1)]);
    let (report, denied) = continuity(&model(""));
    assert!(report.contains("1 C1, 0 C0 only, 0 discontinuous"), "{report}");
    assert_eq!(denied, [Some(0), Some(0)]);
    // A side branch follows; what comes after the end of the branch does not, nor does what is not drawn.
    let (report, _) = continuity(&model("!(1) [ [ -(10) ] F(1) ]"));
    assert_eq!(row(&report, "heading"), "heading by 30° at t = 1");
    let (report, _) =
        continuity(&(model("!(1)").replace("A(0) !(1)", "[ A(0) X ] F(1)") + "\ninterpret X: ε"));
    assert!(report.contains("1 C1, 0 C0 only, 0 discontinuous"), "{report}");
}

#[test]
fn a_jump_in_speed_alone_is_found() {
    // Turning by 60 degrees a unit of time stops; so does growth, by 3 to 1, also of the drawing by age alone.
    let (report, denied) = continuity(
        "initial string: A(0, 0) F(1)\nA(x, a):\n  if x < 3 solve dx/dt = 3, da/dt = 60\n  if x = 3 produce B(3) +(a)
         B(x): solve dx/dt = 1\ninterpret A(x, a): F(x) +(a)\ninterpret B(x): F(x - age) F(2*age)",
    );
    assert!(report.contains("fired 1 time; C0 only"), "{report}");
    assert_eq!(row(&report, "speed of position"), "speed of position 3 -> 2 by 1 (33.3%) at t = 1");
    assert_eq!(row(&report, "speed of direction"), "speed of direction 60° -> 0° by 60° (100%) at t = 1");
    assert_eq!(row(&report, "speed of length"), "speed of length 3 -> 2 by 1 (33.3%) at t = 1");
    assert_eq!((row(&report, "length"), row(&report, "heading")), (String::new(), String::new()));
    assert_eq!(denied, [Some(0), Some(1)]);
}

#[test]
fn what_happens_at_one_instant_is_judged_as_one() {
    // A jumps to B and B back to two halves of A, so that nothing is seen: length and speed are those of before.
    let (report, denied) = continuity(
        "initial string: F_a(1)\nF_a(x):\n  if x < 2 solve dx/dt = x\n  if x = 2 produce F_b(7)
         F_b(x): if x > 5 produce F_c(0.5) F_c(1.5)\nF_c(x): solve dx/dt = x",
    );
    assert!(report.contains("F_a(x), line 4: fired 1 time; C1"), "{report}");
    assert!(
        report.contains("F_b(x), line 5: fired 1 time; judged with what made its predecessor"),
        "{report}"
    );
    assert_eq!(denied, [Some(0), Some(0)]);
}

#[test]
fn the_filament_keeps_length_and_speed_when_a_cell_divides() {
    let report = good(&["check", "--continuity", "models/anabaena.dls", "--to", "300"]);
    assert!(report.contains("line 34: fired 31 times; C1"), "{report}");
    assert!(report.contains("line 36: fired 3 times; C0 only"), "{report}");
    let (status, message) = bad(&["check", "--to", "300", "models/anabaena.dls"]);
    assert!(status == 2 && message.contains("--continuity"), "{message}");
}

#[test]
fn an_inflorescence_grows_without_a_jump_in_height() {
    // Paper, section 7.2: first-order continuity of the height, but where the last flower is made.
    let report = good(&["check", "--continuity", "tests/paper-models/campanula.dls"]);
    let (first, last) = report.split_once("line 23").expect("two productions");
    assert_eq!(row(first, "speed of position"), "");
    assert!(row(last, "speed of position").starts_with("speed of position 1 -> 0 by 1 (100%)"), "{report}");
}
