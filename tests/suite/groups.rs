//! Repetitions and conditions in strings: what they make is what the string written out in full makes, to the bit, with the same
//! random numbers, in initial strings, successors and drawings.

use crate::common::session;
use crate::dice::Dice;
use dlsys::tree::ModuleString;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A sum of multiples of variables and a number.
#[derive(Clone)]
struct Sum(Vec<(i64, String)>, i64);

impl Sum {
    fn random(dice: &mut Dice, scope: &[String]) -> Sum {
        let terms = (0..dice.below(3)).filter(|_| !scope.is_empty());
        let terms: Vec<_> = terms.map(|_| ()).collect();
        let terms = terms
            .iter()
            .map(|()| (dice.below(5) as i64 - 2, scope[dice.below(scope.len())].clone()))
            .collect();
        Sum(terms, dice.below(7) as i64 - 2)
    }

    fn text(&self) -> String {
        let terms: String = self.0.iter().map(|(factor, name)| format!("({factor})*{name} + ")).collect();
        format!("{terms}({})", self.1)
    }

    fn value(&self, scope: &BTreeMap<String, i64>) -> i64 {
        self.0.iter().map(|(factor, name)| factor * scope[name]).sum::<i64>() + self.1
    }
}

enum Part {
    /// `A(x)`, or with a random number.
    Module(Sum, bool),
    Branch(Vec<Part>),
    Repeat(String, Sum, Sum, Vec<Part>),
    If(Sum, Vec<Part>, Option<Vec<Part>>),
}

fn random(dice: &mut Dice, scope: &mut Vec<String>, depth: usize) -> Vec<Part> {
    let count = 1 + dice.below(3);
    let mut parts = Vec::new();
    for _ in 0..count {
        let kind = if depth == 0 { 0 } else { dice.below(5) };
        parts.push(match kind {
            0 | 1 => Part::Module(Sum::random(dice, scope), dice.below(2) == 0),
            2 => Part::Branch(random(dice, scope, depth - 1)),
            3 => {
                let from = Sum::random(dice, scope);
                let mut to = from.clone();
                to.1 += dice.below(4) as i64 - 1;
                // Names may hide those outside.
                let name = ["i", "j", "k"][dice.below(3)].to_owned();
                scope.push(name.clone());
                let body = random(dice, scope, depth - 1);
                scope.pop();
                Part::Repeat(name, from, to, body)
            }
            _ => {
                let otherwise = (dice.below(2) == 0).then(|| random(dice, scope, depth - 1));
                Part::If(Sum::random(dice, scope), random(dice, scope, depth - 1), otherwise)
            }
        });
    }
    parts
}

/// As it is written with groups.
fn written(parts: &[Part], out: &mut String) {
    for part in parts {
        match part {
            Part::Module(sum, false) => write!(out, "A({}) ", sum.text()).expect("text"),
            Part::Module(sum, true) => write!(out, "A(uniform(0, 1) + ({})) ", sum.text()).expect("text"),
            Part::Branch(inner) => {
                out.push_str("[ ");
                written(inner, out);
                out.push_str("] ");
            }
            Part::Repeat(name, from, to, body) => {
                write!(out, "for {name} in {} .. {}: ( ", from.text(), to.text()).expect("text");
                written(body, out);
                out.push_str(")\n    ");
            }
            Part::If(sum, then, otherwise) => {
                write!(out, "if {} > 0: ( ", sum.text()).expect("text");
                written(then, out);
                out.push_str(") ");
                if let Some(otherwise) = otherwise {
                    out.push_str("else ( ");
                    written(otherwise, out);
                    out.push_str(") ");
                }
            }
        }
    }
}

/// Written out in full.
fn unrolled(parts: &[Part], scope: &BTreeMap<String, i64>, out: &mut String) {
    for part in parts {
        match part {
            Part::Module(sum, random) => {
                let draw = if *random { "uniform(0, 1) + " } else { "" };
                write!(out, "A({draw}({})) ", sum.value(scope)).expect("text");
            }
            Part::Branch(inner) => {
                out.push_str("[ ");
                unrolled(inner, scope, out);
                out.push_str("] ");
            }
            Part::Repeat(name, from, to, body) => {
                for index in from.value(scope)..=to.value(scope) {
                    let mut inner = scope.clone();
                    inner.insert(name.clone(), index);
                    unrolled(body, &inner, out);
                }
            }
            Part::If(sum, then, otherwise) => {
                let branch = if sum.value(scope) > 0 { Some(then) } else { otherwise.as_ref() };
                branch.into_iter().for_each(|branch| unrolled(branch, scope, out));
            }
        }
    }
}

fn grown(text: &str, times: [f64; 3]) -> Vec<String> {
    let session = session(text);
    let mut simulation = session.simulate(dlsys::sim::Settings::default()).expect("it begins");
    let mut string = ModuleString::default();
    let mut all = Vec::new();
    for t in times {
        simulation.at(t, &mut string).expect("it grows");
        let kinds = &session.model.kinds;
        all.extend(string.iter().map(|module| {
            let bits: Vec<u64> = module.parameters.iter().map(|x| x.to_bits()).collect();
            format!("{} {bits:?} {} {}", kinds.get(module.kind).name, module.age, module.lineage)
        }));
        let mut scene = dlsys::scene::Scene::default();
        dlsys::turtle::draw(&session.model, &string, &mut scene).expect("drawable");
        all.extend(scene.segments.iter().map(|s| format!("{:?} {:?}", s.start, s.end)));
    }
    all
}

/// A model in which the string is the successor of modules that are born with `n`, whose modules end at random, or at an age.
fn model(successor: &str, drawing: &str, n: i64, lazy: bool) -> String {
    let end = if lazy { "if age = 1" } else { "at rate 0.7" };
    let or = |text: &str| if text.trim().is_empty() { "ε".to_owned() } else { text.to_owned() };
    format!(
        "initial string: P({n}) A(0)\nP(n): if age = 1 produce {}\nA(x): {end} produce B(x)\ninterpret B(n): {}\ninterpret A(x): F(1)\n",
        or(successor),
        or(drawing),
    )
}

#[test]
fn groups_make_what_the_string_written_out_makes() {
    let mut dice = Dice(18);
    let mut modules = 0;
    for round in 0..150 {
        let parts = random(&mut dice, &mut vec!["n".to_owned()], 3);
        let n = dice.below(5) as i64;
        let (mut short, mut long) = (String::new(), String::new());
        written(&parts, &mut short);
        unrolled(&parts, &BTreeMap::from([("n".to_owned(), n)]), &mut long);
        let model = |string: &str| model(string, "F(n)", n, round % 2 == 0);
        let (ours, full) = (grown(&model(&short), [1.0, 1.5, 3.0]), grown(&model(&long), [1.0, 1.5, 3.0]));
        assert_eq!(ours, full, "{}\n{}", model(&short), model(&long));
        modules += full.len();
        // In an initial string.
        let axiom = |string: &str| {
            format!("const n = {n}\ninitial string: A(n) {string}\nA(x): at rate 0.4 produce F(x)\n")
        };
        assert_eq!(grown(&axiom(&short), [0.0, 1.0, 2.0]), grown(&axiom(&long), [0.0, 1.0, 2.0]), "{short}");
    }
    assert!(modules > 2000, "{modules}");
}

#[test]
fn drawings_repeat_and_choose() {
    let short = "initial string: L(3)\ninterpret L(n): for i in 1 .. n: ( [ +(10*i) F(i) if i >= 2: ( F(t + age) ) ] )";
    let long = "initial string: L(3)\ninterpret L(n): [ +(10) F(1) ] [ +(20) F(2) F(t + age) ] [ +(30) F(3) F(t + age) ]";
    assert_eq!(grown(short, [0.0, 1.0, 2.0]), grown(long, [0.0, 1.0, 2.0]));
}

#[test]
fn names_of_the_new_words_stay_names() {
    // Modules called `for`, and `in` as a name, as before.
    let text = "const in = 2\ninitial string: for(in) in\nfor(x): if x < 3 solve dx/dt = 1\n if x = 3 produce in\nin: if age = 1 produce ε";
    assert_eq!(grown(text, [0.5, 1.5, 3.0]).len(), 2 + 1);
}

#[test]
fn a_clause_after_a_string_is_no_condition_of_the_string() {
    let text = "initial string: A(0)\nA(x):\n  if x < 1 solve dx/dt = 1\n  if x = 1 & age > 5 produce B\n  if x = 1\n    produce C if x > 0: ( D ) else ( E )\n  if x > 2 at rate 1 produce B";
    assert_eq!(grown(text, [0.5, 1.0, 2.0]).iter().filter(|line| line.starts_with('D')).count(), 2);
}

#[test]
fn a_long_initial_string_is_cut_outside_of_groups() {
    let stretch = "F(1) for i in 0 .. max(1, 2): ( A(i) [ F(i) ] ) if (1 < 2) & (2 < 3): ( B ) else ( C ) ";
    let text = format!("initial string: {}", stretch.repeat(3000));
    assert_eq!(session(&text).model.axiom.kinds().count(), 3000 * 7);
}
