//! Words and functions of cpfg and L-Py, with their counterparts in this language.
//!
//! None of them is reserved: hints name the counterpart only where a text cannot be parsed or a name is unknown.

use dlsys_diagnostic::{Diagnostic, Span};

/// The chapter of the book about them.
const PAGE: &str = "the book has a page for this: “Coming from cpfg or L-Py”, docs/src/moving.md";

/// Beginnings of lines, as words and signs, each with its remedy.
const LINES: [(&[&str], &str); 35] = [
    (&["elif"], ELIF),
    (&["lsystem", ":"], "remove this line: a file is one model, from its first line to its last"),
    (&["endlsystem"], "remove this line: a model ends with its file"),
    (&["axiom", ":"], "small letters: `axiom: …`, or `initial string: …`"),
    (&["derivation", "length"], STEPS),
    (&["production", ":"], RULES),
    (&["productions", ":"], RULES),
    (
        &["group"],
        "rules do not come in groups: what is to change in time is a parameter, or a condition on `t`",
    ),
    (
        &["module"],
        "remove this line: modules are not declared; the head of a rule names its parameters: `A(x): …`",
    ),
    (&["homomorphism"], DRAWINGS),
    (&["interpretation"], DRAWINGS),
    (&["endhomomorphism"], "remove this line: each drawing is a line of its own"),
    (&["endinterpretation"], "remove this line: each drawing is a line of its own"),
    (&["decomposition"], PARTS),
    (&["enddecomposition"], "remove this line: what falls into parts has rules like others"),
    (&["maximum", "depth"], "remove this line: drawings may be nested 100 deep"),
    (&["nproduce"], PRODUCE),
    (&["nsproduce"], PRODUCE),
    (&["start", ":"], STATEMENTS),
    (&["starteach", ":"], STATEMENTS),
    (&["end", ":"], STATEMENTS),
    (&["endeach", ":"], STATEMENTS),
    (&["endgroup"], "remove this line: rules do not come in groups"),
    (
        &["define", ":"],
        "remove this block: an array of numbers is declared by `const angles = [30, 45, 60]`, and its elements are `angles[i]`; what changes in time is a parameter of a module",
    ),
    (
        &["print"],
        "a model prints nothing: `dlsys run MODEL` prints the string, and `--measure` what is counted in it",
    ),
    (&["seed", ":"], "the seed is no part of the model: `dlsys run MODEL --seed N`"),
    (
        &["import"],
        "a model is no program: functions are declared with `def`, other texts are included by `include \"FILE\"`",
    ),
    (
        &["from"],
        "a model is no program: functions are declared with `def`, other texts are included by `include \"FILE\"`",
    ),
    (
        &["for"],
        "a model is no program: actions that repeat are productions: `A(n): if age = 1 & n > 0 produce F(1) A(n - 1)`",
    ),
    (
        &["while"],
        "a model is no program: actions that repeat are productions: `A(n): if age = 1 & n > 0 produce F(1) A(n - 1)`",
    ),
    (&["delta", "angle"], "the angle of turns without a parameter is written `angle 22.5`"),
    (
        &["initial", "line"],
        "a width stands in the string, in units of length and not in pixels: `initial string: !(0.05) F(1)`",
    ),
    (
        &["initial", "color"],
        "a colour stands in the string: `color bark = \"#7a5a3a\"`, then `initial string: ;(bark) F(1)`",
    ),
    (&["line", "style"], "lines that have a width are round stems: `initial string: !(0.05) F(1)`"),
    (&["return"], "a model is no program: a function is one expression: `def f(x) = x^2`"),
];

const ELIF: &str = "every clause begins with `if …`, without a colon behind the condition; of several `solve` clauses the first whose condition holds is active";
const STEPS: &str = "there are no derivation steps; write the times to look at: `frames 0 .. N step 1`; `dlsys render MODEL --at N` draws the last one alone. Discrete rules apply at t = 1, 2, …";
const RULES: &str = "remove this line: rules stand among declarations, `A(x): if x = 1 produce F(x) A(0)`, or discrete `A(x) : x > 3 -> F(x) A(0)`";
const PRODUCE: &str = "a clause has one successor, and strings are not put together by statements: `if x = 1 produce F(x) A(0)`; modules that repeat are productions of their own";
const STATEMENTS: &str = "a model is no program: what is to change in time is a parameter with an equation, `A(x): solve dx/dt = 1`";
const AXIOM: &str = "the string at t = 0 is written `initial string: A(0)` or `axiom: A(0)`";
const DRAWINGS: &str = "remove this line, and write `interpret` before each of the rules below it, with `:` in place of the arrow (and without `: *`): `A(x) --> F(x)` becomes `interpret A(x): F(x)`; otherwise they are productions";
const PARTS: &str = "remove this line: what falls into parts at once has a rule, `A(x): produce F(x) B(x)`";

/// The error for a line that begins with such words. `at` is the byte at which the line begins.
pub fn line(line: &str, at: usize) -> Option<Diagnostic> {
    let words = beginning(line);
    // A single word may be the name of a module, unless a colon or another word follows.
    let follows =
        |n: usize| words.get(n).is_none_or(|(w, _)| w.starts_with(|c: char| c == ':' || c.is_alphanumeric()));
    let (known, help) = LINES.iter().find(|(known, _)| {
        known.len() <= words.len()
            && known.iter().zip(&words).all(|(k, (w, _))| w.eq_ignore_ascii_case(k))
            && (known.len() > 1 || follows(1))
    })?;
    let of_words = known.iter().filter(|word| **word != ":").count();
    let end = words[of_words - 1].1;
    // Statements assign; otherwise, what follows is a string.
    let behind = line[end..].trim_matches([' ', ':']);
    let help = match known {
        ["start", ":"] if !behind.is_empty() && !behind.contains(['=', '{']) => AXIOM,
        _ => help,
    };
    let number = line.rsplit(':').next().unwrap_or_default().trim().parse::<u32>();
    let help = match number {
        Ok(n) => ["0 .. ", "--at ", "--seed "].iter().fold((*help).to_owned(), |help, before| {
            help.replace(&format!("{before}N"), &format!("{before}{n}"))
        }),
        Err(_) => (*help).to_owned(),
    };
    Some(
        Diagnostic::error(format!("`{}` means nothing here", &line[..end]))
            .at(Span::new(at, at + end), "a word of cpfg or L-Py, or of Python")
            .note(PAGE)
            .help(help),
    )
}

/// The first two words or signs of a line, and the byte at which each ends.
fn beginning(line: &str) -> Vec<(&str, usize)> {
    let in_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    let mut at = 0;
    while found.len() < 2 {
        at += line[at..].len() - line[at..].trim_start().len();
        let rest = &line[at..];
        let Some(first) = rest.chars().next() else { break };
        let length =
            if in_word(first) { rest.find(|c| !in_word(c)).unwrap_or(rest.len()) } else { first.len_utf8() };
        at += length;
        found.push((&rest[..length], at));
    }
    found
}

/// True for words that stand alone on a line in cpfg or L-Py, where this language would read a module.
pub fn stands_alone(word: &str) -> bool {
    [
        "endlsystem",
        "homomorphism",
        "endhomomorphism",
        "endinterpretation",
        "decomposition",
        "enddecomposition",
    ]
    .contains(&word)
}

/// The counterpart of a symbol of a string in cpfg or L-Py that is none here, given the text before it and from it on.
pub fn symbol(before: &str, text: &str) -> Option<String> {
    let first = text.chars().next()?;
    let rest = &text[first.len_utf8()..];
    let is_digit = |c: char| c.is_ascii_digit();
    let after_symbol = before.ends_with(|c: char| !(c.is_alphanumeric() || c == ')' || c.is_whitespace()));
    let arguments = || {
        let end = rest.starts_with('(').then(|| rest.find(')')).flatten();
        end.map_or("(n)", |end| &rest[..=end])
    };
    Some(match first {
        '~' => {
            let end = rest.find(|c: char| !c.is_alphanumeric()).unwrap_or(rest.len());
            let (name, behind) = rest.split_at(end);
            let size = match behind.find(')').filter(|_| behind.starts_with('(')) {
                Some(close) => &behind[..=close],
                None => "",
            };
            let reads = match name {
                "" => return Some("a surface is written with `@` before its name: `@L(s)`".to_owned()),
                "C" | "D" | "E" | "G" | "H" | "M" | "O" | "R" | "S" | "T" | "V" | "W" => {
                    return Some(format!(
                        "a surface is written with `@` before its name, and `@{name}` is a command: give it another name, `@Organ{size}` with `surface @Organ from \"{name}.s\"`"
                    ));
                }
                "L" | "K" | "P" | "B" => {
                    "that one is built in, and `surface` reads others from files".to_owned()
                }
                _ => format!("`surface @{name} from \"{name}.s\"` reads its file"),
            };
            format!("a surface is written with `@` before its name: `@{name}{size}`; {reads}")
        }
        '_' if rest.starts_with(|c: char| c.is_alphanumeric()) => {
            "brackets and points have no subscript; turns have one: `+_l`".to_owned()
        }
        '_' => format!("the width of lines is written `!{}`", arguments().replace("(n)", "(w)")),
        ',' if rest.starts_with('(') => {
            format!("a colour is chosen by its number or its name: `;{}`, `;(rose)`", arguments())
        }
        // A decimal comma, as in a weight.
        ',' if before.ends_with(is_digit) && rest.starts_with(is_digit) => return None,
        ',' => match comma(before, rest) {
            Comma::Separator => NO_COMMAS.to_owned(),
            Comma::Color => format!("{COLOR_BEFORE}; `;` alone is the next one"),
            Comma::Either => format!("{NO_COMMAS}; or, if this is cpfg's sign, {COLOR_BEFORE}"),
        },
        '\'' => "the next colour is written `;` in place of `'`: declare the colours of the map in their order, `color bark = \"#7a5a3a\"` for each, and begin the initial string with the first of them, `;(bark)`"
            .to_owned(),
        '?' if rest.starts_with('(') => "a plant of another model is a module: `plant @Tree from \"tree.dls\"`, then `@Tree(b)` in place of `?(i, s)` … `$`".to_owned(),
        '@' if rest.starts_with('#') => {
            "a cross-section is chosen by its name: `contour square = (1, 1) (-1, 1) (-1, -1) (1, -1)`, then `@C(square)`".to_owned()
        }
        '₀'..='₉' if after_symbol => "the subscript of a symbol begins with `_`: `+_1`".to_owned(),
        _ => return None,
    })
}

/// The hint for a name with a subscript of its own, such as `F₁`: the part before `_` would say how it is drawn.
pub fn subscript(name: &str) -> Option<String> {
    let at = name.find(|c| ('₀'..='₉').contains(&c)).filter(|at| *at > 0)?;
    let digits: Option<String> =
        name[at..].chars().map(|c| char::from_digit(u32::from(c).checked_sub(u32::from('₀'))?, 10)).collect();
    digits.map(|digits| format!("a subscript is written behind `_`: `{}_{digits}`", &name[..at]))
}

/// The hint where a comma separates modules.
pub const NO_COMMAS: &str = "modules stand one after another, with spaces and no commas";
/// The hint where a comma is cpfg's sign.
const COLOR_BEFORE: &str =
    "the colour before the present one is chosen by its number or its name: `;(n)`, `;(rose)`";

/// What a comma in a string is meant for.
enum Comma {
    /// It stands between two modules.
    Separator,
    /// It is the sign of cpfg and L-Py for the colour before the present one.
    Color,
    Either,
}

/// The meaning of a comma by the text before it and behind it. Where a string begins, behind a symbol and with a space only before it,
/// it separates nothing.
fn comma(before: &str, behind: &str) -> Comma {
    let written = before.trim_end();
    let is_first = written.ends_with("produce")
        || !written.ends_with(|c: char| c.is_alphanumeric() || c == ')' || c == ']');
    match (written.len() < before.len(), behind.starts_with(|c: char| !c.is_whitespace())) {
        _ if is_first => Comma::Color,
        (true, true) => Comma::Color,
        (false, false) => Comma::Separator,
        _ => Comma::Either,
    }
}

/// The counterpart of a module that cpfg, lpfg or L-Py draw by its name.
pub fn module(name: &str) -> Option<&'static str> {
    const CYLINDERS: &str = "consecutive lines are one smooth stem without further signs; `@W(w)` gives it its width at this place, and `@C(name)` a cross-section";
    Some(match name {
        "G" => "a step without a vertex is `g(l)`",
        "Left" => "a turn to the left is `+(a)`",
        "Right" => "a turn to the right is `-(a)`",
        "Up" => "a pitch up is `^(a)`",
        "Down" => "a pitch down is `&(a)`",
        "RollL" => "a roll to the left is `\\(a)`",
        "RollR" => "a roll to the right is `/(a)`",
        "TurnAround" => "a turn by 180 degrees is `|`",
        "RollToVert" => "a roll until the left side is horizontal is `$`",
        "SetWidth" => "the width of lines is `!(w)`, or `@W(w)` for a taper to it",
        "SetColor" => "a colour is `;(n)`, or `;(rose)`",
        "SB" => "a branch begins with `[`",
        "EB" => "a branch ends with `]`",
        "Cut" => "the rest of a branch is cut off by `%`",
        "SP" => "a polygon begins with `{`",
        "PP" => "a vertex of a polygon is `.`",
        "EP" => "a polygon ends with `}`",
        "@Gs" | "@Gc" | "@Ge" | "@Gt" => CYLINDERS,
        "@v" => "a roll until the left side is horizontal is `$`",
        "@c" | "@o" => "there are no circles; `@O(d)` is a ball with the diameter d",
        "@M" => {
            "the turtle goes to no coordinates: `f(l)` is a step without a line, behind turns such as `+(a)`; a surface of this name is declared with `surface @M from \"m.s\"`"
        }
        "@D" | "@R" | "@V" | "@H" => "directions are relative: a turn is `+(a)`, `&(a)` or `/(a)`",
        _ => return None,
    })
}

/// The places of `#(w)`, which sets the width of lines in cpfg and begins a comment here: the `#`, and what stands in
/// the parentheses. A parenthesis in which there is no expression, such as `#(as measured)`, is a comment.
pub fn commented_widths(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.match_indices("#(").filter_map(|(at, _)| {
        let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
        let rest = text[at + 2..].lines().next().unwrap_or_default();
        let inside = &rest[..rest.find(')')?];
        let spaced = |c: char| c.is_whitespace() || "+-*/^.,".contains(c);
        let words = inside.split(spaced).filter(|word| !word.is_empty()).count();
        let signs = inside.chars().filter(|c| "+-*/^.".contains(*c)).count();
        let is_expression = words > 0
            && words <= signs + 1
            && inside.chars().all(|c| c.is_alphanumeric() || c == '_' || spaced(c));
        // `@#(n)` is another sign.
        (is_expression && !text[line..at].contains(['#', '"']) && !text[..at].ends_with('@'))
            .then_some((at, inside))
    })
}

/// The counterpart of a function call of cpfg, L-Py or Python, given the texts of its arguments.
pub fn function(name: &str, arguments: &[String]) -> Option<String> {
    let argument =
        |i: usize, otherwise: &str| arguments.get(i).cloned().unwrap_or_else(|| otherwise.to_owned());
    let both = || format!("{}, {}", argument(0, "a"), argument(1, "b"));
    let call = match name {
        "pow" | "power" => {
            let (x, n) = (argument(0, "x"), argument(1, "n"));
            return Some(format!("a power is written `{}^{}`", grouped(&x), grouped(&n)));
        }
        "func" => {
            return Some(format!(
                "a function of a file is declared with a name, `curve g from \"FILE.func\"` or `curve g from \"FILE.fset\" item \"NAME\"`, and called by it: `g({})`",
                argument(1, "x")
            ));
        }
        "bran" => format!("beta({})", both()),
        "round" | "rint" => format!("floor({} + 0.5)", argument(0, "x")),
        "radians" => format!("{}*pi/180", grouped(&argument(0, "x"))),
        "degrees" => format!("{}*180/pi", grouped(&argument(0, "x"))),
        "ran" => format!("uniform(0, {})", argument(0, "1")),
        "random" | "rand" => "uniform(0, 1)".to_owned(),
        "nran" | "gauss" | "normalvariate" => {
            format!("normal({}, {})", argument(0, "mean"), argument(1, "deviation"))
        }
        "randint" | "randrange" => format!("integer({})", both()),
        "expovariate" => format!("exponential({})", argument(0, "rate")),
        "srand" | "seed" => {
            return Some("the seed is no part of the model: `dlsys run MODEL --seed N`".to_owned());
        }
        "trunc" | "int" => format!("floor({})", argument(0, "x")),
        "fmod" => {
            let (x, y) = (argument(0, "x"), argument(1, "y"));
            return Some(remainder(&x, &y));
        }
        "fabs" => format!("abs({})", argument(0, "x")),
        _ => return None,
    };
    Some(format!("write `{call}`"))
}

/// An expression as a part of another.
fn grouped(text: &str) -> String {
    let is_simple = text.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '.'));
    if is_simple { text.to_owned() } else { format!("({text})") }
}

/// How a remainder is written.
pub fn remainder(x: &str, y: &str) -> String {
    format!("a remainder is written `{x} - {y}*floor({x}/{y})`", x = grouped(x), y = grouped(y))
}

/// The places of lines for the preprocessor of C, which are comments in this language. A comment that begins with such a word has a space before it.
/// Not of `#define`: see [`commented_definitions`].
pub fn directives(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1));
    starts.filter_map(|start| {
        let line = text[start..].lines().next()?;
        let at = line.len() - line.trim_start().len();
        let (word, rest) =
            line[at..].trim_end().split_once([' ', '\t']).unwrap_or((line[at..].trim_end(), ""));
        let (rest, is_alone) = (rest.trim_start(), !rest.trim().contains([' ', '\t']));
        let is_one = match word {
            "#include" => rest.starts_with(['"', '<']),
            "#ifdef" | "#ifndef" | "#undef" => !rest.is_empty() && is_alone,
            "#endif" | "#else" => rest.is_empty(),
            _ => false,
        };
        is_one.then_some((start + at, word))
    })
}

/// Names and values in lines such as `#define K 0.5`, which are comments in this language, with their places.
pub fn commented_definitions(text: &str) -> impl Iterator<Item = (usize, &str, &str)> {
    let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1));
    starts.filter_map(|start| {
        let line = text[start..].lines().next()?;
        let at = line.len() - line.trim_start().len();
        let rest = line[at..].strip_prefix("#define")?;
        let name = rest.trim_start_matches([' ', '\t']);
        let end = name.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(name.len());
        (end > 0 && name.len() < rest.len()).then(|| (start + at, &name[..end], name[end..].trim()))
    })
}

/// The hint for an unknown name that such a line mentions.
pub fn of_definition(name: &str, meaning: &str) -> String {
    let meaning = meaning.split("/*").next().unwrap_or_default();
    let meaning = meaning.split("//").next().unwrap_or_default().trim();
    match meaning.strip_prefix('(').and_then(|rest| rest.split_once(')')) {
        // `#define F(x) …`, and not `#define K (2*L)`.
        Some((formals, body)) if !body.trim().is_empty() => {
            format!("`#define …` is a comment: write `def {name}({formals}) = {}`", body.trim())
        }
        _ if meaning.is_empty() => format!("`#define …` is a comment: write `const {name} = …`"),
        _ => format!("`#define …` is a comment: write `const {name} = {meaning}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_other_programs_are_recognised_and_heads_of_rules_are_not() {
        let said = |text: &str| line(text, 0).map(|d| d.help.concat());
        assert!(said("derivation length: 5").is_some_and(|help| help.contains("`frames 0 .. 5 step 1`")));
        assert!(said("Lsystem: 1").is_some() && said("production:").is_some());
        assert!(said("production(x): solve dx/dt = 1").is_none());
        assert!(said("seedling: F").is_none() && said("").is_none());
    }

    #[test]
    fn calls_are_translated_with_their_arguments() {
        let call = |name, arguments: &[&str]| {
            function(name, &arguments.iter().map(|a| a.to_string()).collect::<Vec<_>>()).unwrap()
        };
        assert_eq!(call("pow", &["x + 1", "2"]), "a power is written `(x + 1)^2`");
        assert_eq!(call("ran", &["10"]), "write `uniform(0, 10)`");
        assert_eq!(call("nran", &[]), "write `normal(mean, deviation)`");
        assert_eq!(call("bran", &["2", "5"]), "write `beta(2, 5)`");
        assert_eq!(call("radians", &["x + 1"]), "write `(x + 1)*pi/180`");
        assert_eq!(call("round", &["x/2"]), "write `floor(x/2 + 0.5)`");
        assert!(call("func", &["1", "t/2"]).ends_with("called by it: `g(t/2)`"));
        assert!(function("sin", &[]).is_none());
    }

    #[test]
    fn a_definition_leaves_its_comment_behind() {
        for meaning in ["20 /* depth */", "20 // depth", "20"] {
            assert!(of_definition("D", meaning).ends_with("write `const D = 20`"), "{meaning}");
        }
        assert!(of_definition("f", "(x) (x*x) /* a square */").ends_with("write `def f(x) = (x*x)`"));
    }

    #[test]
    fn symbols_are_translated_with_their_arguments() {
        assert!(symbol("", "~L(2) F").is_some_and(|help| help.contains("`@L(2)`; that one is built in")));
        assert!(symbol("", "~leaf").is_some_and(|help| help.contains("surface @leaf from \"leaf.s\"")));
        assert!(symbol("", "_(0.5)F").is_some_and(|help| help.contains("`!(0.5)`")));
        assert!(symbol("F ", ",(3)").is_some_and(|help| help.contains("`;(3)`")));
        assert!(symbol("F ", "?(1, 2) X").is_some_and(|help| help.contains("`plant @Tree from")));
        assert!(symbol("F ", "@#(2)").is_some_and(|help| help.contains("`@C(square)`")));
        assert!(symbol("F ", "F").is_none() && symbol("F ", "? ").is_none());
        assert!(commented_widths("axiom: A @#(2)").next().is_none());
    }

    #[test]
    fn subscripts_are_written_behind_a_line() {
        assert!(subscript("F₁₂").is_some_and(|help| help.contains("`F_12`")));
        assert!(subscript("F").is_none() && subscript("₁").is_none() && subscript("F₁x").is_none());
    }

    #[test]
    fn commas_are_told_by_what_stands_around_them() {
        let said = |before: &str, text: &str| {
            let help = symbol(before, text).expect("a hint");
            (help.contains("no commas"), help.contains("`;(n)`"))
        };
        for (before, text) in [
            ("A -> ", ",F"),
            ("A -> ", ", F"),
            ("axiom:", ",F"),
            ("A: if x = 1 produce ", ", F"),
            ("A -> F [", ",F ]"),
            ("A -> F ;", ", F"),
            ("A -> F ", ",F"),
            ("A -> F(1) ", ",F"),
        ] {
            assert_eq!(said(before, text), (false, true), "{before}{text}");
        }
        assert_eq!(said("A -> F(1)", ", F(2)"), (true, false));
        assert!(symbol("A -> 0", ",3: F").is_none());
        assert_eq!(said("A -> [ F ]", ", F(2)"), (true, false));
        for (before, text) in [("A -> F ", ", F"), ("A -> F", ",F"), ("A -> F(1)", ",F(2)")] {
            assert_eq!(said(before, text), (true, true), "{before}{text}");
        }
    }

    #[test]
    fn widths_in_comments_are_found_and_other_comments_are_not() {
        let text = "F #(0.5) A\n[#(w*0.7)F]\nF  #(as measured)\nF # not #(2)\n#(width)\n#(1";
        let found: Vec<&str> = commented_widths(text).map(|(_, inside)| inside).collect();
        assert_eq!(found, ["0.5", "w*0.7", "width"]);
    }

    #[test]
    fn lines_for_the_preprocessor_are_found_and_other_comments_are_not() {
        let text = "#include \"a.h\"\n  #ifdef X\n# include \"b\"\n#define K 2\n#endif\n#include the sun\n#else we say\nF #endif\n";
        let found: Vec<_> = directives(text).collect();
        assert_eq!(found, [(0, "#include"), (17, "#ifdef"), (52, "#endif")]);
    }

    #[test]
    fn definitions_of_the_preprocessor_are_found() {
        let text = "# define a thing\n#define K 0.5\n#define G(x) x*K\n#define\n";
        let found: Vec<_> = commented_definitions(text).collect();
        assert_eq!(found, [(17, "K", "0.5"), (31, "G", "(x) x*K")]);
        assert!(of_definition("G", "(x) x*K").ends_with("`def G(x) = x*K`"));
        assert!(of_definition("L", "(2*K)").ends_with("`const L = (2*K)`"));
    }
}
