//! Lines of hard cases: what is read, and what is refused.

use super::*;

fn parse(lines: &str) -> Result<Case, Error> {
    Case::parse("x.dls", &format!("#= case: X\n{lines}\ninitial string: A"))
}

fn only(lines: &str) -> Expectation {
    parse(lines).unwrap_or_else(|e| panic!("{e}")).expectations[0].1.clone()
}

#[test]
fn strings_and_tolerances_are_read() {
    let piece = |name: &str, parameters: &[f64]| PlainModule {
        name: name.to_owned(),
        parameters: parameters.to_vec(),
    };
    let Expectation::At { t, string, within } =
        only("#= at 0.5: F_i(0.75, 1)[+(30)@L(2)] - B relative within 10 tol")
    else {
        panic!("not a string")
    };
    assert_eq!(t, 0.5);
    assert_eq!(
        string,
        [
            piece("F_i", &[0.75, 1.0]),
            piece("[", &[]),
            piece("+", &[30.0]),
            piece("@L", &[2.0]),
            piece("]", &[]),
            piece("-", &[]),
            piece("B", &[])
        ]
    );
    assert_eq!((within.allowed(1e-6), within.relative), (10.0 * 1e-6, true));
    let Expectation::At { within, .. } = only("#= at 3: relative B(1e-150) within 1e-9") else { panic!() };
    assert_eq!((within.allowed(0.1), within.error(2e-150, 1e-150)), (1e-9, 1.0));
    assert_eq!(only("#= at 1: ε"), Expectation::At { t: 1.0, string: vec![], within: Within::DEFAULT });
    let Expectation::Sum { parameter, within, .. } = only("#= sum C 1 by 5: 3.14 within 1e-12 relative")
    else {
        panic!()
    };
    assert_eq!((parameter, within.relative, within.amount), (0, true, 1e-12));
    assert_eq!(only("#= count * by 8.4: 4096"), Expectation::Count { name: None, t: 8.4, count: 4096 });
    let case = parse("#= fails NotFinite|Zeno at 2 within 1e-6\n#= fails Zeno by 9\n#= set r = 0.1").unwrap();
    assert_eq!((case.fails_by, case.settings[0].value, case.tolerances.len()), (Some(9.0), 0.1, 2));
}

#[test]
fn malformed_lines_are_refused_where_they_are() {
    for (line, says) in [
        ("#= at 0.5 A(1)", "expected `:`"),
        ("#= at soon: A(1)", "`soon` is not a number"),
        ("#= at -1: A(1)", "before 0"),
        ("#= at 1: A(1", "`)` is missing"),
        ("#= at 1: A(x)", "`x` is not a number"),
        ("#= at 1: A(1) within close", "`close` is not a number"),
        ("#= at 1: A(1) within -1", "not negative"),
        ("#= at 1: 3", "name of a module"),
        ("#= at 1:", "`ε` is the empty one"),
        ("#= count C: 3", "count NAME by T"),
        ("#= count C by 1: many", "whole number"),
        ("#= sum C 0 by 1: 3", "from 1"),
        ("#= events by 1: 2.5", "whole number"),
        ("#= fails Sometimes at 1", "no error of a run"),
        ("#= fails Zeno near 1", "`at` or `by`"),
        ("#= tolerances: 1", "between"),
        ("#= methods: magic", "no method `magic`"),
        ("#= methods: euler", "fixed step"),
        ("#= set r 1", "NAME = VALUE"),
        ("#= why not", "`why: …`"),
        ("#= case: Y", "one `case"),
        ("#= frobnicate: 1", "means nothing"),
        ("\n#= at 1: A", "come first"),
    ] {
        let error = parse(line).expect_err(line).to_string();
        let at = if line.starts_with('\n') { 3 } else { 2 };
        assert!(error.starts_with(&format!("x.dls:{at}: ")) && error.contains(says), "{line}: {error}");
    }
    assert!(parse("").expect_err("empty").to_string().contains("nothing is expected"));
    assert!(Case::parse("x.dls", "#= at 1: A").expect_err("no id").to_string().contains("case: ID"));
}
