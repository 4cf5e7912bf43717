//! From text to model: the notation, its round trip, and hostile input.

use std::time::{Duration, Instant};

use dlsys::compile::load;
use dlsys::diagnostic::{Severity, Source};
use dlsys::model::Comparison;
use dlsys::syntax::ast::{Document, Expr, ExprId, Expressions, Operator};
use dlsys::syntax::{MAX_DEPTH, parse, print};
use proptest::prelude::*;

/// The value of a constant expression, through the whole front end.
fn value(text: &str) -> f64 {
    let model = format!("param it = {text}\ninitial string: F(it)");
    crate::common::session(&model).model.parameters[0].value
}

fn errors(text: &str) -> Vec<String> {
    let loaded = load(&Source::new("t", text), &[]);
    loaded.diagnostics.into_iter().filter(|d| d.severity == Severity::Error).map(|d| d.message).collect()
}

#[test]
fn operators_bind_as_the_language_says() {
    for (text, wanted) in [
        ("2 + 3*4", 14.0),
        ("2 - 3 - 4", -5.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("8/4/2", 1.0),
        ("2(3 + 4)", 14.0),
        ("3pi/pi", 3.0),
        ("2e", 2.0 * std::f64::consts::E),
        ("2e3", 2000.0),
        ("1e-3", 0.001),
        ("if 1 < 2 then 3 else 4 + 1", 3.0),
        ("if 2 < 1 then 3 else 4 + 1", 5.0),
        ("if 1 < 2 < 3 then 1 else 0", 1.0),
        ("if 1 < 3 < 2 then 1 else 0", 0.0),
        ("if 1 ≤ 1 & 2 ≥ 2 & 1 ≠ 2 then 1 else 0", 1.0),
        ("if ! 1 = 2 then 1 else 0", 1.0),
        ("if 1 = 2 | 1 = 1 & 2 = 3 then 1 else 0", 0.0),
        ("max(1, 2) + min(3, 4) + atan2(0, 1) + sign(-3) + floor(1.5) + ceil(1.5)", 7.0),
        ("abs(-2)*sqrt(4)*exp(0)*ln(e)*log10(10)", 4.0),
        ("1e20*expm1(1e-20)*ln1p(1e-20)*1e20", 1.0),
        ("sin(pi/2) + cosh(0) + tanh(0)", 2.0),
        ("(1 +\n 2 +\n 3)", 6.0),
        ("1 +\n 2", 3.0),
        ("if 1 = 1\n\n # why not\n then 1\n else 2", 1.0),
    ] {
        assert!((value(text) - wanted).abs() <= 1e-15 * wanted.abs(), "{text} is {}", value(text));
    }
}

#[test]
fn the_colon_of_a_case_does_not_begin_a_rule_on_a_line_that_goes_on() {
    for rule in [
        "def f(u) = (match floor(u +\n  1) case 0: 1 else 2)\nA(x): solve dx/dt = f(x)",
        "A(x): solve dx/dt = 1 +\n  match floor(x) case 0: 1 case 1: 3 else 2",
        "A(x): solve dx/dt = max(1,\n  match floor(x) case 0: 1 else 2)",
        "A(x): solve dx/dt = match floor(x) case 0: 1 case 1:\n  2 case 2: 3 else 4\nB(x): solve dx/dt = 1",
    ] {
        let text = format!("initial string: A(0.5) B(0)\n{rule}");
        assert_eq!(errors(&text), Vec::<String>::new(), "{text}");
    }
}

#[test]
fn a_line_break_ends_an_expression() {
    let text = "initial string: F(1) +(2)\nF(x): solve dx/dt = x\n+(α): solve dα/dt = 1";
    let model = crate::common::session(text).model;
    assert_eq!(model.rules.len(), 2);
    // And a rule whose successor ends in a symbol ends there.
    let text = "initial string: F\nF: produce - G +\nG:\n if t = 1\n produce ε";
    assert_eq!(
        crate::common::session(text).model.rules[0].produces[0].outcome.successors[0].kinds().count(),
        3
    );
}

#[test]
fn heads_may_run_over_lines() {
    let text = "initial string: A(1) B(2) C(3)\nA(a) <\n B(b) >\n C(c):\n solve db/dt = a + c";
    let model = crate::common::session(text).model;
    assert_eq!((model.rules[0].left.len(), model.rules[0].right.len()), (1, 1));
}

#[test]
fn several_mistakes_are_all_reported() {
    let text = "const a = \ninitial string: F(b) ]\nF(x): solve dy/dt = 1\nconst c = c\nfoo bar";
    assert!(errors(text).len() >= 4, "{:?}", errors(text));
}

#[test]
fn bytes_that_are_no_text_are_refused_where_they_are() {
    let bad = Source::from_bytes("m", b"title \"x\"\naxiom: F\xff".to_vec()).expect_err("not UTF-8");
    assert_eq!(bad.source.position(bad.diagnostic.labels[0].0.start), (2, 9));
}

#[test]
fn marks_and_line_ends_of_other_systems_are_nothing_special() {
    let text = "\u{feff}const a = 2\r\ninitial string: F(a)\r\nF(x):\r\n  solve dx/dt = 1\r\n";
    let source = Source::from_bytes("m", text.as_bytes().to_vec()).expect("text");
    let loaded = load(&source, &[]);
    assert!(loaded.model.is_some() && loaded.diagnostics.is_empty(), "{:?}", loaded.diagnostics);
}

#[test]
fn nesting_is_bounded_and_the_bound_is_far() {
    let nested = |n: usize| format!("{}1{}", "(".repeat(n), ")".repeat(n));
    assert_eq!(value(&nested(MAX_DEPTH)), 1.0);
    assert_eq!(value(&format!("{}1", "-".repeat(MAX_DEPTH))), 1.0);
    for deep in [
        nested(MAX_DEPTH + 1),
        nested(100_000),
        format!("{}1", "-".repeat(100_000)),
        format!("1{}", "^1".repeat(100_000)),
        "(".repeat(100_000),
        "sqrt(".repeat(100_000),
        format!("{}1", "if 1 < 2 then ".repeat(100_000)),
        format!("if {}1", "!".repeat(100_000)),
    ] {
        let found = errors(&format!("const a = {deep}\ninitial string: F(a)"));
        assert!(!found.is_empty(), "{}…", &deep[..20]);
    }
}

#[test]
fn long_is_not_deep() {
    let sum = vec!["1"; 100_000].join(" + ");
    assert_eq!(value(&sum), 100_000.0);
    let chain = "if 1 > 2 then 3 else ".repeat(10_000) + "4";
    assert_eq!(value(&chain), 4.0);
    // Constants and functions that build on one another, backwards.
    let mut text = String::from("initial string: F(c0 + f0(0))\nconst c20000 = 1\ndef f2000(x) = x\n");
    for i in 0..20_000 {
        text += &format!("const c{i} = c{}\n", i + 1);
    }
    for i in 0..2_000 {
        text += &format!("def f{i}(x) = f{}(x)\n", i + 1);
    }
    assert!(crate::common::session(&text).warnings.is_empty());
}

#[test]
fn functions_that_explode_are_refused() {
    let mut text = String::from("initial string: F(f0(1))\ndef f40(x) = sin(x)\n");
    for i in 0..40 {
        text += &format!("def f{i}(x) = f{}(x) + f{}(x + {i})\n", i + 1, i + 1);
    }
    assert!(errors(&text).iter().any(|e| e.contains("without bound")));
}

#[test]
fn deep_brackets_are_no_recursion() {
    let n = 100_000;
    let text = format!("initial string: {}F{}\nF: if t < 0 produce ε", "[".repeat(n), "]".repeat(n));
    let session = crate::common::session(&text);
    let mut simulation = session.simulate(Default::default()).expect("starts");
    let mut string = Default::default();
    simulation.at(0.0, &mut string).expect("runs");
    assert_eq!(string.len(), 2 * n + 1);
    let mut scene = Default::default();
    dlsys::turtle::draw(&session.model, &string, &mut scene).expect("draws");
}

/// Reading must stay linear in the text. No wall time is asserted tightly: ten times the text may take at
/// most forty times as long, and an eternity is a hang.
#[test]
fn time_is_linear_in_the_text() {
    type Make = fn(usize) -> String;
    let inputs: [(&str, Make); 8] = [
        ("modules", |n| format!("initial string: {}\n", "F(1, 2) ".repeat(n))),
        ("constants", |n| (0..n).map(|i| format!("const c{i} = 1\n")).collect::<String>() + "axiom: F"),
        ("unknown names", |n| "const a = b\n".repeat(n)),
        ("junk", |n| "? % ~ \u{1f331}\n".repeat(n)),
        ("comments", |n| "# nothing\n".repeat(n) + "axiom: F"),
        ("open parentheses", |n| "const a = (\n".repeat(n)),
        ("rules", |n| {
            let rules =
                (0..n).map(|i| format!("A{i}(x): if x < 1 solve dx/dt = x\n if x = 1 produce A{i}(0)\n"));
            let axiom = (0..n).map(|i| format!(" A{i}(0)"));
            rules.collect::<String>() + "initial string:" + &axiom.collect::<String>()
        }),
        ("contexts", |n| {
            let rules = (0..n).map(|i| format!("A{i}(x) < B(y): solve dy/dt = x\n"));
            let axiom = (0..n).map(|i| format!(" A{i}(0)"));
            rules.take(900).collect::<String>() + "initial string: B(1)" + &axiom.collect::<String>()
        }),
    ];
    for (what, make) in inputs {
        let time = |n: usize| {
            let source = Source::new("t", make(n));
            let before = Instant::now();
            let loaded = load(&source, &[]);
            assert!(loaded.model.is_some() || !loaded.diagnostics.is_empty());
            before.elapsed()
        };
        let (small, large) = (time(1_000), time(10_000));
        assert!(
            large < 40 * small.max(Duration::from_millis(5)),
            "{what}: {small:?}, ten times as much {large:?}"
        );
    }
}

// ---------------------------------------------------------------------------------------------- round trip

/// Writes a random expression into an arena; `choices` decides what it is.
fn grow(all: &mut Expressions, choices: &mut impl Iterator<Item = u32>, depth: u32, truth: bool) -> ExprId {
    let mut choose = |n: u32| choices.next().unwrap_or(0) % n;
    let span = Default::default();
    if truth {
        let what = if depth == 0 { 0 } else { choose(4) };
        return match what {
            1 => {
                let a = grow(all, choices, depth - 1, true);
                all.push(Expr::Not(a), span)
            }
            2 | 3 => {
                let a = grow(all, choices, depth - 1, true);
                let b = grow(all, choices, depth - 1, true);
                all.push(Expr::Binary(if what == 2 { Operator::And } else { Operator::Or }, a, b), span)
            }
            _ => {
                let first = grow(all, choices, depth.saturating_sub(1), false);
                let links = 1 + choices.next().unwrap_or(0) % 2;
                let links = (0..links)
                    .map(|_| {
                        let all_of = [
                            Comparison::Less,
                            Comparison::LessOrEqual,
                            Comparison::Equal,
                            Comparison::NotEqual,
                            Comparison::GreaterOrEqual,
                            Comparison::Greater,
                        ];
                        let comparison = all_of[(choices.next().unwrap_or(0) % 6) as usize];
                        (comparison, grow(all, choices, depth.saturating_sub(1), false))
                    })
                    .collect();
                all.push(Expr::Compare(first, links), span)
            }
        };
    }
    let what = if depth == 0 { choose(2) } else { choose(15) };
    let node = match what {
        0 => Expr::Number(f64::from(choose(100)) / 8.0),
        1 => Expr::Name(["x", "e", "e3", "τ", "c_min"][choose(5) as usize].into()),
        2 => Expr::Negate(grow(all, choices, depth - 1, false)),
        3 => Expr::Scale(f64::from(choose(9)), grow(all, choices, depth - 1, false)),
        4 => {
            let c = grow(all, choices, depth - 1, true);
            let a = grow(all, choices, depth - 1, false);
            let b = grow(all, choices, depth - 1, false);
            Expr::If(c, a, b)
        }
        5 => {
            let a = grow(all, choices, depth - 1, false);
            let b = grow(all, choices, depth - 1, false);
            Expr::Call("max".into(), vec![a, b])
        }
        6 => Expr::Index("a".into(), grow(all, choices, depth - 1, false)),
        7 => {
            let subject = grow(all, choices, depth - 1, false);
            let cases = 1 + choices.next().unwrap_or(0) % 2;
            let cases = (0..cases)
                .map(|_| {
                    let value = grow(all, choices, depth - 1, false);
                    (value, grow(all, choices, depth - 1, false))
                })
                .collect();
            Expr::Match(subject, cases, grow(all, choices, depth - 1, false))
        }
        n => {
            let operator =
                [Operator::Add, Operator::Sub, Operator::Mul, Operator::Div, Operator::Pow][(n % 5) as usize];
            let a = grow(all, choices, depth - 1, false);
            let b = grow(all, choices, depth - 1, false);
            Expr::Binary(operator, a, b)
        }
    };
    all.push(node, span)
}

/// An expression without its parentheses, as a tree in prefix notation.
fn shape(all: &Expressions, id: ExprId) -> String {
    match all.get(id) {
        Expr::Parenthesis(a) => shape(all, *a),
        Expr::Number(x) => x.to_string(),
        Expr::Name(name) => name.to_string(),
        Expr::Call(name, arguments) => {
            format!("({name} {})", arguments.iter().map(|a| shape(all, *a)).collect::<Vec<_>>().join(" "))
        }
        Expr::Negate(a) => format!("(neg {})", shape(all, *a)),
        Expr::Not(a) => format!("(not {})", shape(all, *a)),
        Expr::Scale(k, a) => format!("(scale {k} {})", shape(all, *a)),
        Expr::Binary(operator, a, b) => format!("({operator:?} {} {})", shape(all, *a), shape(all, *b)),
        Expr::Compare(first, links) => {
            let links: Vec<String> = links.iter().map(|(c, a)| format!("{c:?} {}", shape(all, *a))).collect();
            format!("(chain {} {})", shape(all, *first), links.join(" "))
        }
        Expr::Index(name, a) => format!("(element {name} {})", shape(all, *a)),
        Expr::Match(subject, cases, otherwise) => {
            let shape = |a: &ExprId| shape(all, *a);
            let cases: Vec<String> =
                cases.iter().map(|(a, b)| format!("{} {}", shape(a), shape(b))).collect();
            format!("(match {} {} {})", shape(subject), cases.join(" "), shape(otherwise))
        }
        Expr::If(c, a, b) => format!("(if {} {} {})", shape(all, *c), shape(all, *a), shape(all, *b)),
        Expr::Aggregate(of) => {
            let term = of.term.map_or(String::new(), |term| shape(all, term.root));
            format!("({} {} {term})", of.fold.name(), of.head.name.text)
        }
    }
}

proptest! {
    #[test]
    fn printed_expressions_read_back_the_same(choices in proptest::collection::vec(any::<u32>(), 1..200)) {
        let mut all = Expressions::default();
        let root = grow(&mut all, &mut choices.into_iter(), 6, false);
        let text = print::expression(&all, root);
        let (read, expression) = parse::parse_expression(&Source::new("t", text.clone())).expect("reads back");
        prop_assert_eq!(shape(&read.expressions, expression.root), shape(&all, root), "{}", text);
    }

    #[test]
    fn no_text_makes_the_front_end_panic(text in "[ -~\\nFf±ετ≤(){}\\[\\]#\"=<>:&|!^+*/.,;@$\\\\-]{0,200}") {
        let _ = load(&Source::new("t", text), &[]);
    }

    #[test]
    fn no_mangled_model_makes_the_front_end_panic(
        which in 0usize..6, cut in 0.0..1.0f64, drop in 0usize..20, put in "[ -~\\nετ]{0,6}",
    ) {
        let names = ["dragon", "leaf", "campanula", "lychnis", "anabaena", "hieracium-apex"];
        let path = crate::common::repository("tests/paper-models").join(format!("{}.dls", names[which]));
        let text: Vec<char> = std::fs::read_to_string(path).expect("a listing").chars().collect();
        let at = (cut * text.len() as f64) as usize;
        let mangled: String =
            text[..at].iter().chain(&put.chars().collect::<Vec<_>>()).chain(text.iter().skip(at + drop)).collect();
        let loaded = load(&Source::new("t", mangled), &[]);
        prop_assert!(loaded.model.is_some() || !loaded.diagnostics.is_empty());
    }
}

#[test]
fn printed_models_read_back_the_same() {
    for folder in ["tests/paper-models", "models"] {
        for entry in std::fs::read_dir(crate::common::repository(folder)).expect("models") {
            let path = entry.expect("readable").path();
            if path.extension().is_none_or(|e| e != "dls") {
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("readable");
            let read = |text: &str| -> Document {
                let (document, errors) = parse::parse(&Source::new("t", text));
                assert!(errors.is_empty(), "{path:?}: {errors:?}");
                document
            };
            let once = print::document(&read(&text));
            assert_eq!(print::document(&read(&once)), once, "{path:?}");
            // The same model, not only the same text.
            let folder = path.parent().expect("a folder");
            let models = [&text, &once].map(|text| {
                let read = dlsys::session::Session::from_text_in(folder, &[], "t", text, &[]);
                read.unwrap_or_else(|refused| panic!("{path:?}: {:?}", refused.diagnostics)).model.rules.len()
            });
            assert_eq!(models[0], models[1]);
        }
    }
}
