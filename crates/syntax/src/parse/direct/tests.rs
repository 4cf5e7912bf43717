//! Which items are read without the grammar, and that each is read alike with it.

use super::*;
use crate::ast::Expressions;
use crate::layout::{ItemKind, layout};
use crate::parse::{build, pest_parse};
use std::collections::HashSet;

/// The items of a text: of each, whether it is read directly. Where it is, the grammar must give the same tree.
fn read(text: &str) -> Vec<bool> {
    let cut = layout(text);
    let defined = HashSet::new();
    let mut found = Vec::new();
    for item in cut.items.iter().filter(|item| !item.broken) {
        let rule = match item.kind {
            ItemKind::Declaration(declaration) => declaration.rule,
            ItemKind::Rule => Rule::rule_item,
            ItemKind::Step => Rule::step_item,
            ItemKind::Unknown => continue,
        };
        let is_axiom = item.kind.body() == Some(crate::declarations::Body::String);
        let from = if is_axiom { item.after_colon.unwrap_or(item.start) } else { item.start };
        let piece = &cut.text[from..item.end];
        let both = [true, false].map(|direct| {
            let (mut expressions, mut interner) = (Expressions::default(), build::Interner::default());
            let mut builder = Builder {
                expressions: &mut expressions,
                interner: &mut interner,
                offset: from,
                defined: Some(&defined),
            };
            let read = match (direct, is_axiom) {
                (true, true) => modules(piece, &mut builder).map(Item::Axiom),
                (true, false) => super::item(rule, piece, &mut builder),
                (false, true) => pest_parse(Rule::modules, piece, from)
                    .and_then(|pair| builder.successor(pair))
                    .ok()
                    .map(Item::Axiom),
                (false, false) => pest_parse(rule, piece, from).and_then(|pair| builder.item(pair)).ok(),
            };
            read.map(|item| (item, expressions))
        });
        let [direct, grammar] = both;
        if let Some((item, expressions)) = &direct {
            let (same, nodes) = grammar.as_ref().unwrap_or_else(|| panic!("the grammar refuses {piece}"));
            assert!(item == same, "{piece}\n{item:?}\n{same:?}");
            let all = |of: &Expressions| format!("{:?}", of.since(ast::ExprId(0)));
            assert_eq!(all(expressions), all(nodes), "{piece}");
        }
        found.push(direct.is_some());
    }
    found
}

/// A rule with one equation.
fn with_rate(rate: &str) -> String {
    format!("A(x, y):\n  solve dx/dt = {rate}\n")
}

#[test]
fn the_common_notation_is_read_directly() {
    for text in [
        "A(x): solve dx/dt = 1\n",
        "F(x_l, c_l) < F_v(x, c) > G F(x_r, c_r):\n  let k = 2\n  if x < 1 & c > 5 solve dx/dt = ln(1.01)*x,\n    c = 3\n  if x = 1 produce F [ +(45) A ] @L(2) { . }\n",
        "A(x):\n  if x > 1 at rate 2x\n    produce ε\n  produce B\n    C(1)\n",
        "A(x): x > 3 -> F(x) [ +_l -A(x/2) ]\n",
        "A < B > C --> B\n",
        "A → epsilon\n",
        "A : * -> B\n",
        "const k = 3\n",
        "param k = 1e-3\n",
        "def f(x, y) = x^2*y\n",
        "interpret A(x): F(x) [ ; B ]\n",
        "axiom: A(1, 2.5) [ +(45) B ] %\n  C\n",
    ] {
        assert_eq!(read(text), [true], "{text}");
    }
    let names = "τ_0*größe + x₁ - größe";
    for rate in [
        "-x^-2^y*3/2c·x",
        "2(x + y)3",
        "2e3x + 2ex",
        "a <= b < c & !d = e | f != g ≥ 2 ≠ 3",
        "-!x",
        "--x",
        "if x < 1 then 2 else if y > 3 then 4 else 5 + 6",
        "f()",
        "f( x , g(y)[ 2 ] )",
        "a[x + 1]*a [2]",
        "((x))",
        "x/2c^2",
        "x - -y",
        "matches + iffy",
        names,
    ] {
        let text = with_rate(rate);
        let expected = rate != "2(x + y)3" && rate != "f( x , g(y)[ 2 ] )";
        assert_eq!(read(&text), [expected], "{text}");
    }
}

/// These forms are rare, or mistakes: the grammar has the word.
#[test]
fn other_notation_is_left_to_the_grammar() {
    for rate in [
        "match x case 1: 2 else 3",
        "sum(B(z): z)",
        "count(B)",
        "1e999",
        "x +",
        "x = = y",
        "2 3",
        "x ! = y",
        "then",
        "if x then y",
        "f(x",
        "f(,)",
        "x.y",
        "x²",
        "-> x",
        "1_a",
        "a[1, 2]",
    ] {
        assert!(!read(&with_rate(rate)).contains(&true), "{rate}");
    }
    for text in [
        "A: produce 2: B or 1: C\n",
        "A: produce for i in 1 .. 3: ( B )\n",
        "A: produce if x > 1: ( B )\n",
        "A(x): 0 = x\n",
        "±(x): solve dx/dt = 1\n",
        "A > [ B ] C: produce D\n",
        "const a = [1, 2]\n",
        "param k = 1 in 0 .. 2\n",
        "A B: produce C\n",
        "A: produce\n",
        "A(x): solve dx/dt\n",
        "A(x): solve x/dt = 1\n",
        "A(x): solve d_x/dt = 1\n",
        "A: produce @if\n",
        "A: produce B..\n",
        "A: produce -> B\n",
        "< A: produce B\n",
        "A: produce ε B\n",
        "axiom: ε\n",
        "interpret A: 2\n",
        "A : x -> B : C\n",
    ] {
        assert!(!read(text).contains(&true), "{text}");
    }
}

/// Models of the repository with characters and words deleted, inserted and exchanged: what is read directly is what the grammar reads.
#[test]
fn mutated_models_are_read_alike() {
    let models = [
        include_str!("../../../../../models/hieracium.dls"),
        include_str!("../../../../../models/campanula.dls"),
        include_str!("../../../../../models/barley.dls"),
    ];
    let pieces = [
        "(", ")", "[", "-", "->", "<", ">", "=", "!", ":", ",", ".", "..", "2", "1e5", " ", "\n", "x", "τ",
        "²", "_", "@", "ε", "if ", "else ", "then ", "at rate ", "or ", "for ", "match ", "let ", "solve ",
        "produce ", "sum(", "/dt", "d",
    ];
    let mut state = 1u64;
    let mut draw = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as usize) % below
    };
    let mut direct = 0;
    for round in 0..150 {
        let mut text = models[round % models.len()].to_owned();
        for _ in 0..20 {
            let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
            let at = places[draw(places.len())];
            match draw(3) {
                0 => drop(text.remove(at)),
                1 => text.insert_str(at, pieces[draw(pieces.len())]),
                _ => {
                    let c = text.remove(at);
                    let to = places[draw(places.len() - 1)];
                    let to = (to..).find(|to| text.is_char_boundary(*to)).unwrap_or(text.len());
                    text.insert(to.min(text.len()), c);
                }
            }
        }
        direct += read(&text).into_iter().filter(|direct| *direct).count();
    }
    assert!(direct > 1000, "{direct} items were read directly");
}
