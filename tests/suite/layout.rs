//! `dlsys fmt` must not lose a character, change the meaning of a text, or need a second pass.
//!
//! The tests use all models of the repository, including the ones with mistakes, and many random changes of each, of which
//! many still parse.

use dlsys::diagnostic::Source;
use dlsys::session::Session;
use dlsys::sim::Settings;
use dlsys::syntax::{format::format, parse, print};
use dlsys::tree::ModuleString;

use crate::common::{plain, repository};
use crate::dice::Dice;
use crate::wild::{changed, texts};

/// The characters that are no white space.
fn characters(text: &str) -> String {
    text.chars().filter(|c| !c.is_whitespace()).collect()
}

/// What a text says, whatever its layout; `None` if it does not parse.
fn meaning(text: &str) -> Option<String> {
    let (document, errors) = parse::parse(&Source::new("t", text));
    errors.is_empty().then(|| print::document(&document))
}

/// The model that a text is compiled to, without the places in the text; or the messages, if it is none.
fn model(path: &std::path::Path, text: &str) -> String {
    let read = Session::from_text_in(path.parent().expect("a folder"), &[], "m.dls", text, &[]);
    let shown = match read {
        Ok(session) => format!("{:?}", session.model),
        Err(refused) => refused.diagnostics.iter().map(|d| d.message.clone() + "\n").collect(),
    };
    let mut out = String::new();
    let mut rest = &shown[..];
    while let Some((before, after)) = rest.split_once("Span {") {
        out += before;
        rest = after.split_once('}').expect("a span ends").1;
    }
    out += rest;
    // A map, whose order is another each time; it says nothing that the list of kinds does not.
    // Models of plants have maps of their own.
    while let Some(from) = out.find(", ids: {") {
        let Some(length) = out[from..].find("}, axiom: ") else { break };
        out.replace_range(from..from + length, "");
    }
    out
}

/// Says what is different, and not all of both.
fn alike(path: &std::path::Path, text: &str, a: &str, b: &str) -> Result<(), String> {
    let same = a.chars().zip(b.chars()).take_while(|(a, b)| a == b).count();
    let from = |s: &str| s.chars().skip(same.saturating_sub(80)).take(200).collect::<String>();
    let both = || format!("{}\n---\n{text}\n--- is\n{}\n--- not\n{}", path.display(), from(a), from(b));
    if a == b { Ok(()) } else { Err(both()) }
}

/// The layout of a text, if it has one, or what does not hold of it that must hold of every text.
fn laid_out(path: &std::path::Path, text: &str) -> Result<Option<String>, String> {
    let say = |what: &str| format!("{}: {what}\n---\n{text}", path.display());
    let Ok(once) = format(&Source::new("t", text)) else {
        // Nothing that parses is refused: that would be a fault of the layout, found out in time.
        return if meaning(text).is_none() { Ok(None) } else { Err(say("it has no layout")) };
    };
    if characters(&once) != characters(text) {
        return Err(say("it has other characters"));
    }
    if meaning(&once) != meaning(text) {
        return Err(say("it has another meaning"));
    }
    match format(&Source::new("t", &once)) {
        Ok(twice) => alike(path, text, &once, &twice)?,
        Err(_) => return Err(say("its layout has none")),
    }
    Ok(Some(once))
}

/// Every kind of space of the grammar stands for every other, also where the layout looks ahead.
#[test]
fn all_kinds_of_space_are_alike() {
    let text = "initial string: for i in 1 .. 3: ( F(i) ) if 1 < 2: ( A )\n";
    let plain = format(&Source::new("t", text)).expect("good");
    for space in ["\t", "\r ", "\u{A0}", "  "] {
        let other = format(&Source::new("t", text.replace(' ', space))).expect("good");
        assert_eq!(other, plain, "{space:?}");
    }
}

#[test]
fn changed_texts_keep_their_characters_and_their_meaning() {
    keep_characters_and_meaning(12);
}

#[test]
#[ignore = "slow: a hundred thousand texts"]
fn very_many_changed_texts_keep_their_characters_and_their_meaning() {
    keep_characters_and_meaning(1);
}

/// Lays out every text, and one in `share` of a hundred thousand changed ones.
fn keep_characters_and_meaning(share: usize) {
    let texts = texts();
    assert!(texts.len() > 400, "{}", texts.len());
    let mut dice = Dice(1);
    let (mut parsed, mut compared, mut wrong) = (0, 0, Vec::new());
    for (path, text) in &texts {
        wrong.extend(laid_out(path, text).err());
        // Many of short texts, few of long ones: the characters that are read are about the same.
        for _ in 0..(200_000 / text.len().max(100)).clamp(30, 400) / share {
            let other = changed(text, &mut dice);
            let once = match laid_out(path, &other) {
                Ok(None) => continue,
                Ok(Some(once)) => once,
                Err(fault) => {
                    wrong.push(fault);
                    continue;
                }
            };
            parsed += 1;
            if parsed % 4 == 0 {
                compared += 1;
                wrong.extend(alike(path, &other, &model(path, &once), &model(path, &other)).err());
            }
        }
    }
    wrong.sort_by_key(String::len);
    assert!(wrong.is_empty(), "{} texts\n{}", wrong.len(), wrong[..wrong.len().min(5)].join("\n\n"));
    assert!(parsed > 10_000 / share && compared > 2000 / share, "{parsed} of the changed texts parse");
}

/// The string at some times, or what goes wrong.
fn run(path: &std::path::Path, text: &str) -> String {
    let folder = path.parent().expect("a folder");
    let Ok(session) = Session::from_text_in(folder, &[], "m.dls", text, &[]) else {
        return "refused".to_owned();
    };
    let settings = Settings { max_modules: 2000, ..Settings::default() };
    let mut simulation = match session.simulate(settings) {
        Ok(simulation) => simulation,
        Err(fault) => return fault.diagnostic().message,
    };
    let mut string = ModuleString::default();
    let mut out = String::new();
    for t in [0.0, 0.3, 1.0] {
        match simulation.at(t, &mut string) {
            Ok(()) => out += &format!("{:?}\n", plain(&session.model, &string)),
            Err(fault) => return out + &fault.diagnostic().message,
        }
    }
    out
}

#[test]
fn what_is_laid_out_runs_as_before() {
    let mut ran = 0;
    for (path, text) in texts() {
        // Wild in white space: every gap another one.
        let wild: String = text
            .lines()
            .map(|line| {
                let end = line.find(['#', '"']).unwrap_or(line.len());
                line[..end].replace(' ', "   ").replace(',', " ,") + &line[end..] + "\n"
            })
            .collect();
        let Some(once) = laid_out(&path, &wild).expect("a good layout") else { continue };
        alike(&path, &wild, &model(&path, &once), &model(&path, &wild)).expect("the same model");
        let fast = !path.starts_with(repository("models/hard"));
        if fast {
            ran += 1;
            alike(&path, &wild, &run(&path, &once), &run(&path, &wild)).expect("the same run");
        }
    }
    assert!(ran > 100, "{ran}");
}

#[test]
fn numbers_end_where_the_parser_ends_them() {
    for (text, value) in [
        ("const x = 3\nconst a = 1e2x", 300.0),
        ("const x = 3\nconst a = 1e-2x", 0.03),
        ("const ex = 3\nconst a = 2ex", 6.0),
        ("const e3 = 3\nconst a = 1e2e3", 300.0),
        ("const a = 1e9floor(2.5)", 2e9),
        ("const a = 2e", 2.0 * std::f64::consts::E),
        ("const a = 1/2e1(5)", 0.01),
    ] {
        let text = format!("{text}\ninitial string: F(a)\n");
        let laid_out = format(&Source::new("t", &text)).expect("it parses");
        assert_eq!(laid_out, text, "laid out as it is");
        let session = crate::common::session(&text);
        let mut string = ModuleString::default();
        session.simulate(Settings::default()).expect("a start").at(0.0, &mut string).expect("it runs");
        assert!((string.get(0).parameters[0] - value).abs() <= 1e-15 * value, "{text}");
    }
}
