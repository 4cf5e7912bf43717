//! Discrete rules: models of *The Algorithmic Beauty of Plants* (ABOP), chapter 1, against strings and counts that were
//! computed independently, and steps combined with continuous time.

use std::collections::HashMap;

use dlsys::session::Session;
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

use crate::common::repository;

/// The strings of a model at some times: modules separated by spaces, numbers to nine digits.
fn strings(text: &str, times: &[f64]) -> Vec<String> {
    let session = Session::from_text("model.dls", text, &[]).unwrap_or_else(|refused| {
        panic!("{text}\n{:?}", refused.diagnostics);
    });
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let mut string = ModuleString::default();
    let show = |string: &ModuleString| {
        let modules = string.iter().map(|module| {
            let name = &session.model.kinds.get(module.kind).name;
            if module.parameters.is_empty() {
                return name.clone();
            }
            let numbers: Vec<String> =
                module.parameters.iter().map(|x| format!("{}", (x * 1e9).round() / 1e9)).collect();
            format!("{name}({})", numbers.join(","))
        });
        modules.collect::<Vec<_>>().join(" ")
    };
    (times.iter())
        .map(|t| {
            simulation.at(*t, &mut string).unwrap_or_else(|error| panic!("{text}\n{error}"));
            show(&string)
        })
        .collect()
}

/// A string of symbols of one letter, with what is written in braces as one symbol.
fn symbols(text: &str) -> Vec<String> {
    let (mut out, mut rest) = (Vec::new(), text);
    while let Some(first) = rest.chars().next() {
        let end = if first == '{' { rest.find('}').expect("closed") } else { 0 };
        let name = if end > 0 { &rest[1..end] } else { &rest[..first.len_utf8()] };
        out.push(name.to_owned());
        rest = &rest[end.max(first.len_utf8() - 1) + 1..];
    }
    out
}

type Count = (&'static str, fn(i64) -> i64);

struct Figure {
    /// In the book.
    place: &'static str,
    axiom: &'static str,
    rules: &'static [(&'static str, &'static str)],
    steps: usize,
    /// A symbol, and how many there are after n steps.
    counts: &'static [Count],
}

fn power(base: i64, n: i64) -> i64 {
    base.pow(n as u32)
}

/// Context-free, without parameters. The counts follow from the matrices of the rules.
const FIGURES: [Figure; 18] = [
    Figure {
        place: "figure 1.3",
        axiom: "b",
        rules: &[("a", "ab"), ("b", "a")],
        steps: 12,
        counts: &[("a", |n| fibonacci(n)), ("b", |n| if n == 0 { 1 } else { fibonacci(n - 1) })],
    },
    Figure {
        place: "figure 1.4, Anabaena catenula",
        axiom: "{a_r}",
        rules: &[("{a_r}", "{a_l}{b_r}"), ("{a_l}", "{b_l}{a_r}"), ("{b_r}", "{a_r}"), ("{b_l}", "{a_l}")],
        steps: 10,
        counts: &[],
    },
    Figure {
        place: "figure 1.6",
        axiom: "F-F-F-F",
        rules: &[("F", "F-F+F+FF-F-F+F")],
        steps: 3,
        counts: &[("F", |n| 4 * power(8, n))],
    },
    Figure {
        place: "figure 1.7 a",
        axiom: "-F",
        rules: &[("F", "F+F-F-F+F")],
        steps: 5,
        counts: &[("F", |n| power(5, n))],
    },
    Figure {
        place: "figure 1.8",
        axiom: "F+F+F+F",
        rules: &[("F", "F+f-FF+F+FF+Ff+FF-f+FF-F-FF-Ff-FFF"), ("f", "ffffff")],
        steps: 2,
        counts: &[("F", |n| 4 * power(18, n)), ("f", |n| [0, 16, 384][n as usize])],
    },
    Figure {
        place: "figure 1.9 a",
        axiom: "F-F-F-F",
        rules: &[("F", "FF-F-F-F-F-F+F")],
        steps: 3,
        counts: &[("F", |n| 4 * power(8, n))],
    },
    Figure {
        place: "figure 1.9 f",
        axiom: "F-F-F-F",
        rules: &[("F", "F-F+F-F-F")],
        steps: 4,
        counts: &[("F", |n| 4 * power(5, n))],
    },
    Figure {
        place: "figure 1.10 a, the dragon curve",
        axiom: "{F_l}",
        rules: &[("{F_l}", "{F_l}+{F_r}+"), ("{F_r}", "-{F_l}-{F_r}")],
        steps: 10,
        counts: &[("F_l", |n| power(2, n - 1)), ("F_r", |n| power(2, n - 1))],
    },
    Figure {
        place: "figure 1.10 b, the Sierpinski gasket",
        axiom: "{F_r}",
        rules: &[("{F_l}", "{F_r}+{F_l}+{F_r}"), ("{F_r}", "{F_l}-{F_r}-{F_l}")],
        steps: 6,
        counts: &[("F_r", |n| (power(3, n) + power(-1, n)) / 2)],
    },
    Figure {
        place: "figure 1.11 a, the hexagonal Gosper curve",
        axiom: "{F_l}",
        rules: &[
            ("{F_l}", "{F_l}+{F_r}++{F_r}-{F_l}--{F_l}{F_l}-{F_r}+"),
            ("{F_r}", "-{F_l}+{F_r}{F_r}++{F_r}+{F_l}--{F_l}-{F_r}"),
        ],
        steps: 4,
        counts: &[("F_l", |n| (power(7, n) + 1) / 2), ("F_r", |n| (power(7, n) - 1) / 2)],
    },
    Figure {
        place: "figure 1.19, Hilbert's curve in space",
        axiom: "A",
        rules: &[
            ("A", "B-F+CFC+F-D&F^D-F+&&CFC+F+B//"),
            ("B", "A&F^CFB^F^D^^-F-D^|F^B|FC^F^A//"),
            ("C", "|D^|F^B-F+C^F^A&&FA&F^C+F+B^F^D//"),
            ("D", "|CFB-F+B|FA&F^A&&FB-F+B|FC//"),
        ],
        steps: 3,
        counts: &[("F", |n| power(8, n) - 1)],
    },
    Figure {
        place: "figure 1.24 a",
        axiom: "F",
        rules: &[("F", "F[+F]F[-F]F")],
        steps: 5,
        counts: &[("F", |n| power(5, n)), ("[", |n| (power(5, n) - 1) / 2)],
    },
    Figure {
        place: "figure 1.24 b",
        axiom: "F",
        rules: &[("F", "F[+F]F[-F][F]")],
        steps: 5,
        counts: &[("F", |n| power(5, n))],
    },
    Figure {
        place: "figure 1.24 c",
        axiom: "F",
        rules: &[("F", "FF-[-F+F+F]+[+F-F-F]")],
        steps: 4,
        counts: &[("F", |n| power(8, n))],
    },
    Figure {
        place: "figure 1.24 d",
        axiom: "X",
        rules: &[("X", "F[+X]F[-X]+X"), ("F", "FF")],
        steps: 7,
        counts: &[("X", |n| power(3, n)), ("F", |n| 2 * (power(3, n) - power(2, n)))],
    },
    Figure {
        place: "figure 1.24 e",
        axiom: "X",
        rules: &[("X", "F[+X][-X]FX"), ("F", "FF")],
        steps: 7,
        counts: &[("X", |n| power(3, n)), ("F", |n| 2 * (power(3, n) - power(2, n)))],
    },
    Figure {
        place: "figure 1.24 f",
        axiom: "X",
        rules: &[("X", "F-[[X]+X]+F[+FX]-X"), ("F", "FF")],
        steps: 5,
        counts: &[("X", |n| power(4, n)), ("F", |n| 3 * (power(4, n) - power(2, n)) / 2)],
    },
    Figure {
        place: "figure 1.25, the bush",
        axiom: "A",
        rules: &[("A", "[&FL!A]/////[&FL!A]///////[&FL!A]"), ("F", "S/////F"), ("S", "FL"), ("L", "[^^{f}]")],
        steps: 7,
        counts: &[("A", |n| power(3, n))],
    },
];

fn fibonacci(n: i64) -> i64 {
    (0..n).fold((0, 1), |(a, b), _| (b, a + b)).0
}

#[test]
fn models_of_the_book_give_its_strings_and_counts() {
    for Figure { place, axiom, rules, steps, counts } in FIGURES {
        let spaced = |text: &str| symbols(text).join(" ");
        let mut text = format!("initial string: {}\n", spaced(axiom));
        let mut table: HashMap<String, Vec<String>> = HashMap::new();
        for (predecessor, successor) in rules {
            text += &format!("{} -> {}\n", spaced(predecessor), spaced(successor));
            table.insert(symbols(predecessor).concat(), symbols(successor));
        }
        let times: Vec<f64> = (0..=steps).map(|n| n as f64).collect();
        let found = strings(&text, &times);
        let mut wanted = symbols(axiom);
        for (n, found) in (0..).zip(&found) {
            assert!(*found == wanted.join(" "), "{place}, step {n}");
            for (symbol, count) in counts.iter().filter(|_| n > 0) {
                let there = wanted.iter().filter(|s| s == symbol).count();
                assert_eq!(there as i64, count(n), "{place}: {symbol} after {n} steps");
            }
            wanted = wanted.into_iter().flat_map(|s| table.get(&s).cloned().unwrap_or(vec![s])).collect();
        }
    }
    // As printed (section 1.2).
    let anabaena = "initial string: a_r\na_r -> a_l b_r\na_l -> b_l a_r\nb_r -> a_r\nb_l -> a_l";
    assert_eq!(
        strings(anabaena, &[0.0, 1.0, 2.0, 3.0, 4.0]),
        ["a_r", "a_l b_r", "b_l a_r a_r", "a_l a_l b_r a_l b_r", "b_l a_r b_l a_r a_r b_l a_r a_r"]
    );
}

#[test]
fn parametric_words_are_those_of_the_book() {
    // Section 1.10.2.
    let text = "initial string: B(2) A(4, 4)
A(x, y) : y <= 3 -> A(x*2, x + y)
A(x, y) : y > 3 -> B(x) A(x/y, 0)
B(x) : x < 1 -> C
B(x) : x >= 1 -> B(x - 1)";
    assert_eq!(
        strings(text, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
        [
            "B(2) A(4,4)",
            "B(1) B(4) A(1,0)",
            "B(0) B(3) A(2,1)",
            "C B(2) A(4,3)",
            "C B(1) A(8,7)",
            "C B(0) B(8) A(1.142857143,0)"
        ]
    );
    // Figure 1.37: 2^n apices, and 2^n - 1 segments, those of step n being R^(1 - n) long.
    let tree = "const R = 1.456\ninitial string: A(1)\nA(s) -> F(s) [ +(85) A(s/R) ] [ -(85) A(s/R) ]";
    let last = strings(tree, &[9.0]).pop().expect("one");
    let lengths: Vec<f64> =
        last.split(' ').filter_map(|m| m.strip_prefix("F(")?.strip_suffix(')')?.parse().ok()).collect();
    assert_eq!(lengths.len(), 511);
    for order in 0..9 {
        let length = 1.456f64.powi(-order);
        assert_eq!(lengths.iter().filter(|l| (*l - length).abs() < 1e-8).count(), 1 << order);
    }
    // Figure 1.36: segments of four, which wait for 2, 1, 1 and 0 steps.
    let row = std::fs::read_to_string(repository("models/abop/row-of-trees.dls")).expect("there");
    let times: Vec<f64> = (0..=10).map(f64::from).collect();
    let found = strings(&row, &times);
    // By what they wait for: nobody, one step, two steps.
    let mut waiting = [1usize, 0, 0];
    for (n, found) in found.iter().enumerate() {
        let count = found.split(' ').filter(|m| m.starts_with("F(")).count();
        assert_eq!(count, waiting.iter().sum::<usize>(), "after {n} steps");
        waiting = [waiting[0] + waiting[1], 2 * waiting[0] + waiting[2], waiting[0]];
    }
}

/// Rewrites a bracketed string by rules `left < predecessor > right`, the slow way: over text.
fn rewrite(string: &[String], rules: &[(&str, &str, &str, Vec<String>)], ignored: &str) -> Vec<String> {
    let mut out = Vec::new();
    for (i, symbol) in string.iter().enumerate() {
        // The next symbol to the left, out of all branches that are closed.
        let (mut left, mut depth) = (None, 0);
        for other in string[..i].iter().rev() {
            match other.as_str() {
                "]" => depth += 1,
                "[" => depth = (depth - 1).max(0),
                other if depth == 0 && !ignored.contains(other) => {
                    left = Some(other);
                    break;
                }
                _ => {}
            }
        }
        let (mut right, mut depth) = (None, 0);
        for other in &string[i + 1..] {
            match other.as_str() {
                "[" => depth += 1,
                "]" if depth == 0 => break,
                "]" => depth -= 1,
                other if depth == 0 && !ignored.contains(other) => {
                    right = Some(other);
                    break;
                }
                _ => {}
            }
        }
        let fits = |wanted: &str, there: Option<&str>| wanted.is_empty() || there == Some(wanted);
        let rule = rules.iter().find(|(l, p, r, _)| p == symbol && fits(l, left) && fits(r, right));
        match rule {
            Some((.., successor)) => out.extend_from_slice(successor),
            None => out.push(symbol.clone()),
        }
    }
    out
}

#[test]
fn signals_travel_and_branch() {
    // Section 1.8: a signal goes from left to right, one cell in a step.
    let text = "initial string: b a a a a a a a a\nb < a -> b\nb -> a";
    for (n, found) in strings(text, &[0.0, 1.0, 2.0, 5.0, 8.0]).iter().enumerate() {
        let at = [0, 1, 2, 5, 8][n];
        let wanted: Vec<&str> = (0..9).map(|i| if i == at { "b" } else { "a" }).collect();
        assert_eq!(*found, wanted.join(" "));
    }
    // Figure 1.31, after Hogeweg and Hesper: successors of 000, 001, 010, …, 111; I F I, with a branch or without.
    let tables: [(&str, [&str; 8]); 5] = [
        ("a", ["O", "I[+FIFI]", "I", "I", "O", "IFI", "O", "O"]),
        ("b", ["I", "I[-FIFI]", "I", "I", "O", "IFI", "I", "O"]),
        ("c", ["O", "I", "O", "I[+FIFI]", "O", "IFI", "O", "O"]),
        ("d", ["I", "O", "O", "IFI", "I", "I[+FIFI]", "I", "O"]),
        ("e", ["O", "I[-FIFI]", "I", "I", "O", "IFI", "I", "O"]),
    ];
    for (figure, successors) in tables {
        let digit = |i: usize, bit: usize| if i >> bit & 1 == 1 { "I" } else { "O" };
        let mut text = "ignore + - F\ninitial string: F I F I F I\n+ -> -\n- -> +\n".to_owned();
        let mut rules = vec![("", "+", "", symbols("-")), ("", "-", "", symbols("+"))];
        for (i, successor) in successors.iter().enumerate() {
            let [left, own, right] = [2, 1, 0].map(|bit| digit(i, bit));
            let made = symbols(successor);
            text += &format!("{left} < {own} > {right} -> {}\n", made.join(" "));
            rules.push((left, own, right, made));
        }
        let found = strings(&text, &(0..=26).map(f64::from).collect::<Vec<_>>());
        let mut wanted = symbols("FIFIFI");
        for (n, found) in found.iter().enumerate() {
            assert!(*found == wanted.join(" "), "figure 1.31 {figure}, step {n}");
            wanted = rewrite(&wanted, &rules, "+-F");
        }
        assert!(wanted.len() > 100, "figure 1.31 {figure} grows: {}", wanted.len());
    }
}

#[test]
fn a_step_takes_place_once_at_each_multiple_of_the_period() {
    // No cascade: the condition holds for the successor, too.
    assert_eq!(strings("initial string: A(0)\nA(n) -> A(n + 1)", &[0.0, 0.999, 1.0, 1.5, 7.0])[4], "A(7)");
    // Decimal periods, and times that are written as decimals.
    let text = "period 0.1\ninitial string: A(0)\nA(n) : * --> A(n + 1)";
    let times: Vec<f64> = (0..=100).map(|i| f64::from(i) / 10.0).collect();
    for (i, found) in strings(text, &times).iter().enumerate() {
        assert_eq!(*found, format!("A({i})"));
    }
    let far = strings(text, &[99_999.95, 100_000.0, 100_000.05]);
    assert_eq!(far, ["A(999999)", "A(1000000)", "A(1000000)"]);
    // Who comes between two steps waits for the next one.
    let text = "period 2\ninitial string: B(0)
B(x): if x < 3 solve dx/dt = 1
  if x = 3 produce A(0) A(0)
A(n) : age > 0 → A(n + 1)";
    let found = strings(text, &[2.0, 3.0, 3.9, 4.0, 6.0, 10.0]);
    assert_eq!(found[1..], ["A(0) A(0)", "A(0) A(0)", "A(1) A(1)", "A(2) A(2)", "A(4) A(4)"]);
    // Nobody is left for a long time, then somebody is made at a multiple: that step is over.
    let text = "initial string: B(0)\nB(x): if x < 1000 solve dx/dt = 1\n  if x = 1000 produce A(0)\nA(n) -> A(n + 1)";
    assert_eq!(strings(text, &[1000.0, 1000.5, 1001.0]), ["A(0)", "A(0)", "A(1)"]);
}

#[test]
fn steps_and_continuous_growth_live_in_one_model() {
    // A cell that grows all the time, and is looked at once in a step.
    let text = "const r = ln(2)
initial string: C(1)
C(x): solve dx/dt = r*x
C(x) : x >= 2 -> C(x/2) C(x/2)";
    assert_eq!(strings(text, &[0.5, 1.0, 2.0, 3.5])[1..3], ["C(1) C(1)", "C(1) C(1) C(1) C(1)"]);
    // At one instant rules see the values from before it, whichever kind they are of: neither sees the other's successor.
    let text = "initial string: A(0) B(7)
A(x): if x < 2 solve dx/dt = 1
  if x = 2 produce A_2(100)
A(x) < B(y) -> B(x)";
    assert_eq!(strings(text, &[1.0, 2.0, 3.0]), ["A(1) B(1)", "A_2(100) B(2)", "A_2(100) B(100)"]);
    // Of a continuous and a discrete rule that replace a module at one instant, the first written does.
    let continuous = "A(x): if x < 1 solve dx/dt = 1\n  if x = 1 produce C";
    let discrete = "A(x) -> D";
    for (first, second, made) in [(continuous, discrete, "C"), (discrete, continuous, "D")] {
        assert_eq!(strings(&format!("initial string: A(0)\n{first}\n{second}"), &[0.5, 1.0])[1], made);
    }
    // Integrated neighbours: the step sees the middle of a common step of the integrator.
    let text = "initial string: A(1, 0) A(3, 0) A(2, 0)
A(l, n) < A(x, k) > A(r, m): solve dx/dt = l + r - 2x
A(x, k) : k < 1 -> A(x, k + 1)
A(x, k) : k = 1 -> A(0, 2)";
    let found = strings(text, &[0.999_999_999_999, 1.0, 2.0]);
    assert_eq!(found[0].replace(",0)", ",1)"), found[1], "a step that keeps a value keeps it");
    assert_eq!(found[2], "A(0,2) A(0,2) A(0,2)");
    // The other way round, it is the same with one clock for all.
    let middle = 1.5 + 1.5 * (-2.0f64).exp();
    assert_eq!(found[1], format!("A(1,1) A({},1) A(2,1)", (middle * 1e9).round() / 1e9));
}

#[test]
fn a_cut_takes_the_rest_of_its_branch() {
    let text = "initial string: A [ B C [ D ] E ] F(1)\nB -> B %\nD -> D D";
    assert_eq!(strings(text, &[0.0, 1.0, 2.0]), ["A [ B C [ D ] E ] F(1)", "A [ B ] F(1)", "A [ B ] F(1)"]);
    assert_eq!(strings("initial string: A % B [ C ]", &[0.0]), ["A"]);
    // By a continuous rule, of modules with events to come, which then have none: slots are used again.
    let text = "initial string: S(0) G(0) [ G(0) G(0.5) ] G(0)
S(x): if x < 1.5 solve dx/dt = 1
  if x = 1.5 produce F(1) [ G(0.25) % G(0) ] H(0) %
H(x): if x < 1 solve dx/dt = 1
  if x = 1 produce H(0) H(0)
G(x): if x < 1 solve dx/dt = 1
  if x = 1 produce G(0) G(0)";
    let found = strings(text, &[1.25, 1.5, 2.0, 2.25, 2.5, 4.75]);
    assert_eq!(found[1], "F(1) [ G(0.25) ] H(0)");
    assert_eq!(found[2], "F(1) [ G(0.75) ] H(0.5)");
    assert_eq!(found[3], "F(1) [ G(0) G(0) ] H(0.75)");
    assert_eq!(found[4], "F(1) [ G(0.25) G(0.25) ] H(0) H(0)");
    // Seen from before the cut, nobody follows.
    let text = "initial string: A(0) B C D\nA(n) > B -> A(n + 1)\nB -> %\nA(n) -> A(n + 100)";
    assert_eq!(strings(text, &[1.0, 2.0]), ["A(1)", "A(101)"]);
}

#[test]
fn steps_are_the_same_whichever_way_they_are_made() {
    let text = std::fs::read_to_string(repository("models/abop/hogeweg-hesper.dls")).expect("there");
    let session = Session::from_text("model.dls", &text, &[]).expect("good");
    let run = |settings: Settings, times: &[f64]| {
        let mut simulation = session.simulate(settings).expect("it starts");
        let mut string = ModuleString::default();
        times.iter().for_each(|t| simulation.at(*t, &mut string).expect("it runs"));
        let events = simulation.take_events().len();
        let all: Vec<_> = string.iter().map(|m| (m.kind, m.age.to_bits(), m.lineage)).collect();
        (all, events)
    };
    let log = Settings { log: true, ..Settings::default() };
    let few = run(log, &[24.0]);
    assert!(few.1 > 1000);
    let many: Vec<f64> = (0..=240).map(|i| f64::from(i) / 10.0).collect();
    assert_eq!(run(log, &many), few);
    for other in [Settings { slow: true, ..log }, Settings { transitions: true, ..log }] {
        assert_eq!(run(other, &[24.0]), few);
    }
}

#[test]
fn the_page_on_discrete_rules_tells_what_happens() {
    let page = std::fs::read_to_string(repository("docs/src/language/discrete.md")).expect("there");
    let listings: Vec<&str> =
        page.split("```dlsys\n").skip(1).map(|rest| rest.split("```").next().expect("it ends")).collect();
    assert_eq!(listings.len(), 5);
    for listing in &listings {
        let session = Session::from_text("listing.dls", listing, &[]).expect("a good listing");
        assert!(session.warnings.is_empty(), "{:?}", session.warnings);
    }
    let words = strings(listings[0], &[0.0, 1.0, 2.0, 3.0]);
    for word in &words {
        assert!(page.contains(&word.replace(',', ", ")), "the page has {word}");
    }
    assert_eq!(strings(listings[1], &[3.0]), [["C(1)"; 8].join(" ")]);
    assert_eq!(strings(listings[2], &[3.0, 4.0]), ["S(3) [ B(3) L L ] F(1)", "S(4) [ ] F(1)"]);
    // The same segments; in the growing tree those of the last step have just begun.
    let times: Vec<f64> = (1..8).map(f64::from).collect();
    let (steps, growth) = (strings(listings[3], &times), strings(listings[4], &times));
    for (i, (step, grown)) in steps.iter().zip(&growth).enumerate() {
        let segments = |text: &str| text.split(' ').filter(|m| m.starts_with('F')).count();
        assert_eq!(segments(step), segments(grown));
        assert_eq!(grown.matches("F_g(0,").count(), 1 << i);
    }
    for model in std::fs::read_dir(repository("models/abop")).expect("there") {
        let text = std::fs::read_to_string(model.expect("there").path()).expect("there");
        assert!(Session::from_text("model.dls", &text, &[]).expect("good").warnings.is_empty());
    }
}
