//! The canonical layout of a model's text (`dlsys fmt`).
//!
//! ```text
//! text ──layout──▶ tokens ──pieces──▶ lines of pieces ──arrange──▶ text
//! ```
//!
//! Only white space changes; comments and line breaks are preserved. The formatter works on the tokens of the first pass
//! and does not depend on the grammar: the spaces around an operator follow from its characters, and the first pass
//! decides which words are operators. So new constructs of the language are laid out without changes here.
//!
//! - A declaration or rule begins in the first column. A clause is indented by 2, an action on a line of its own by 4. A
//!   continuation line is aligned with the beginning of the construct or indented; open brackets indent further.
//! - `+ - < = & |` have spaces around them, `* / ^` none; commas and colons have one behind. In strings of modules a gap
//!   between two modules becomes one space, and no gap stays none.
//! - Actions that share lines with their guards are aligned in columns, and so are comments at the ends of adjacent lines.
//! - One empty line at most, none at the ends, no spaces at line ends.

mod arrange;
mod pieces;

use crate::Errors;
use crate::ast::Document;
use crate::{parse, print};
use dlsys_diagnostic::{Diagnostic, Source};
use pieces::lines;

/// The text in its canonical layout. Two checks that are independent of the formatter run on each result: its characters
/// other than white space are those of the input, and it parses to the same declarations and rules.
///
/// # Errors
/// The syntax errors of a text that cannot be parsed. Names and types are not checked.
pub fn format(source: &Source) -> Result<String, Errors> {
    let (document, errors) = parse::parse(source);
    if !errors.is_empty() {
        return Err(errors.into());
    }
    let mut text = arrange::arrange(&lines(&source.text));
    if source.text.contains("\r\n") {
        text = text.replace('\n', "\r\n");
    }
    // A defect of the formatter must not change a model.
    if !kept(&source.text, &text) || !says_the_same(&document, &text) {
        let fault = Diagnostic::error("this text cannot be laid out without changing what it says")
            .help("leave its layout as it is; please report it with the text");
        return Err(fault.into());
    }
    Ok(text)
}

/// True if a layout has the characters of the text in the same order. White space may differ except in quotes and within
/// comments. The comparison is by characters, so that it also detects errors in the tokens.
fn kept(text: &str, layout: &str) -> bool {
    significant(text).eq(significant(layout))
}

/// The characters that a layout must preserve: all but white space, texts in quotes, and comments with their ends.
fn significant(text: &str) -> impl Iterator<Item = char> + '_ {
    text.split('\n').flat_map(|line| {
        let (mut quoted, mut comment) = (false, false);
        let end = if line.contains('#') { "\n" } else { "" };
        line.trim_end().chars().chain(end.chars()).filter(move |&c| {
            quoted ^= c == '"' && !comment;
            comment |= c == '#' && !quoted;
            quoted || comment || !c.is_whitespace()
        })
    })
}

/// True if a layout parses to the same declarations, rules and expressions in the same order.
fn says_the_same(document: &Document, layout: &str) -> bool {
    let (again, errors) = parse::parse(&Source::new("", layout));
    errors.is_empty() && print::document(&again) == print::document(document)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formatted(text: &str) -> String {
        let format = |text: &str| format(&Source::new("t", text)).unwrap_or_else(|e| panic!("{text}: {e:?}"));
        let once = format(text);
        assert_eq!(format(&once), once, "once is enough");
        once
    }

    #[test]
    fn spaces_are_canonical() {
        for (wild, tame) in [
            ("const  a=2 * ( 3+4 ) /5 ^ -2", "const a = 2*(3 + 4)/5^-2"),
            ("const a = -2c+ 1e-3*1.5E+2 - -b", "const a = -2c + 1e-3*1.5E+2 - -b"),
            ("const a=1e2x+2e3r*1e9floor(t)-2ex", "const a = 1e2x + 2e3r*1e9floor(t) - 2ex"),
            ("const a=2if b<1 then 1e2e3 else 3.5(b)", "const a = 2if b < 1 then 1e2e3 else 3.5(b)"),
            ("def f( x,y )=if x<=y&!(x=0)then x else-y", "def f(x, y) = if x <= y & !(x = 0) then x else -y"),
            (
                "def step( p )=p*2\nframes 0..9 step 2*step(1)+step(2)",
                "def step(p) = p*2\nframes 0 .. 9 step 2*step(1) + step(2)",
            ),
            ("frames 0..9 step .5", ""),
            ("frames 0..9 step 0.5", "frames 0 .. 9 step 0.5"),
            ("frames  200 .. 575   step 1", "frames 200 .. 575 step 1"),
            ("param α_max=60.0 in 10..90#wide", "param α_max = 60.0 in 10 .. 90  #wide"),
            ("ignore F_x  @L + -", "ignore F_x @L + -"),
            ("surface @M  from\t\"m.s\"", "surface @M from \"m.s\""),
            (
                "sheet  @N from \"n.obj\"of  rope pinned y>2 & x<1",
                "sheet @N from \"n.obj\" of rope pinned y > 2 & x < 1",
            ),
            ("surface @M from \"m.s\"texture  \"m.png\"", "surface @M from \"m.s\" texture \"m.png\""),
            ("contour c=(1,0)(0,1) (-1, 0)", "contour c = (1, 0) (0, 1) (-1, 0)"),
            ("tropism 0,-1,0 strength 0.2", "tropism 0, -1, 0 strength 0.2"),
            ("axiom:  F (x)[+( 30)A]  -  ![ @L(-1) ]  ;(2 , 3)", "axiom: F(x)[+(30)A] - ![ @L(-1) ] ;(2, 3)"),
            ("axiom: F&&_i( 1,0 ) &&A ||_a -&_b(2)  --_c", "axiom: F&&_i(1, 0) &&A ||_a -&_b(2) --_c"),
            ("A(x)<B( y )>C(z) :solve dy/dt=-x*z", "A(x) < B(y) > C(z): solve dy/dt = -x*z"),
            ("±( α ):solve dα / dt = 1", "±(α): solve dα/dt = 1"),
            (
                "axiom: F for i in 0..n-1:([+(10*i)A(i)])if n>2:(B)else(C D)E",
                "axiom: F for i in 0 .. n - 1: ( [+(10*i)A(i)] ) if n > 2: ( B ) else ( C D ) E",
            ),
            ("light   -1,2 , -3", "light -1, 2, -3"),
            ("ground -0.5", "ground -0.5"),
            ("camera at 0,1,-5 towards -x,0 , 0 angle 30", "camera at 0, 1, -5 towards -x, 0, 0 angle 30"),
            ("camera at -1,1,5 towards 0, 1, 0", "camera at -1, 1, 5 towards 0, 1, 0"),
            ("units  time 86400 ,length 0.01", "units time 86400, length 0.01"),
            (
                "wind 1,-0.2 , 0 speed 3+sin( t ) turbulence 0.3 scale -x period 8 seed 7 spectrum kolmogorov 1,4,-y",
                "wind 1, -0.2, 0 speed 3 + sin(t) turbulence 0.3 scale -x period 8 seed 7 spectrum kolmogorov 1, 4, -y",
            ),
            ("flow uniform -1,0 , t", "flow uniform -1, 0, t"),
            (
                "flow vortex -2 axis -1,0,0 at 0,-1,0 decay 3",
                "flow vortex -2 axis -1, 0, 0 at 0, -1, 0 decay 3",
            ),
            (
                "gas a=size 2*e ,mass 1e-6,  color  \"#fff\",fall -1",
                "gas a = size 2*e, mass 1e-6, color \"#fff\", fall -1",
            ),
            (
                "tissue a=stiffness 2*e ,density 900, damping 0.05,sag,thickness 1e-4",
                "tissue a = stiffness 2*e, density 900, damping 0.05, sag, thickness 1e-4",
            ),
            ("axiom: for(1) if(x):( for(2) )", "axiom: for(1) if (x): ( for(2) )"),
            ("interpret @L(s) :;(2)F( s )@L(s)", "interpret @L(s): ;(2)F(s)@L(s)"),
        ] {
            if tame.is_empty() {
                assert!(format(&Source::new("t", wild)).is_err(), "{wild}");
            } else {
                assert_eq!(formatted(wild), format!("{tame}\n"));
            }
        }
    }

    #[test]
    fn indentation_is_canonical() {
        let wild = "\n\n# About.\ntitle \"Bush\"   \n\n\n\ninitial string:\nF(1)\n[ +(30)\nF(2)\n] F(3)\n\n\
            # The apex.\nA(x, y):\n   # grows\n      if x < 1 & y>2 solve dx/dt = 1,\n dy/dt = (1 +\n 2)\n\
            if x = 1 produce F(x)\n   A(0) # new\n  if x > 1\nsolve dx/dt = 0 #still\nif y=0 &\nx = 0\n\n\
            produce ε\n  # nothing else\n\n#end\ninterpret A(x, y): F(x)\n            F(y)\n interpret B: F\nF\n\n";
        let tame = "# About.\ntitle \"Bush\"\n\ninitial string:\n  F(1)\n  [ +(30)\n    F(2)\n  ] F(3)\n\n\
            # The apex.\nA(x, y):\n  # grows\n  if x < 1 & y > 2  solve dx/dt = 1,\n                          \
            dy/dt = (1 +\n                            2)\n  if x = 1  produce F(x)\n                    \
            A(0)  # new\n  if x > 1\n    solve dx/dt = 0       #still\n  if y = 0 &\n     x = 0\n\n    produce ε\n  \
            # nothing else\n\n#end\ninterpret A(x, y): F(x)\n                   F(y)\ninterpret B: F\n  F\n";
        assert_eq!(formatted(wild), tame);
    }

    #[test]
    fn guards_and_comments_are_aligned() {
        let wild = "const a = 1 # one\nconst x = 10*10*10\nconst bcd = 2 # two\n\nconst e = 3 # three\nF(x):\n if x < a solve dx/dt = bcd\n\
            if x = a & t > e produce ε\naxiom: F(0)";
        let tame = "const a = 1    # one\nconst x = 10*10*10\nconst bcd = 2  # two\n\nconst e = 3  # three\nF(x):\n  \
            if x < a          solve dx/dt = bcd\n  if x = a & t > e  produce ε\naxiom: F(0)\n";
        assert_eq!(formatted(wild), tame);
    }

    #[test]
    fn crlf_is_preserved_and_invalid_text_is_an_error() {
        assert_eq!(formatted("axiom:  F\r\n\r\n\r\nangle  4"), "axiom: F\r\n\r\nangle 4\r\n");
        let refused = format(&Source::new("t", "axiom: F(")).expect_err("it never closes");
        assert!(refused[0].message.contains("never closed"));
        // The indentation is bounded, so the layout of a deep tree stays linear in its size.
        let deep = format!("axiom: {}{}", "[\n".repeat(5000), "]\n".repeat(5000));
        assert!(formatted(&deep).len() < 100 * deep.len());
    }
}
