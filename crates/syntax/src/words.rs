//! The words of the language, for those who colour, complete or count them.

use crate::layout::DECLARATIONS;
pub use crate::lexeme::{in_name, number_length};

/// Words that begin a part of a rule. Also those of an expression, which may stand at the beginning of a line.
pub const CLAUSES: [&str; 8] = ["if", "then", "else", "solve", "produce", "or", "at", "let"];

/// Words that mean something in certain places only.
pub const PARTICLES: [&str; 13] = [
    "string", "in", "step", "from", "strength", "rate", "for", "column", "monotone", "spline", "linear",
    "match", "case",
];

/// Words that end a declaration.
pub const ENDINGS: [&str; 1] = ["periodic"];

/// Words for what becomes of the modules attached to one: `sum(B(x): x)`.
pub const FOLDS: [&str; 4] = ["sum", "count", "largest", "smallest"];

/// Words that begin a declaration.
pub fn declarations() -> impl Iterator<Item = &'static str> {
    DECLARATIONS.iter().map(|(word, _)| *word)
}

/// How a declaration goes on after its first word, for somebody who types it; empty for a word that begins none.
pub fn usage(declaration: &str) -> &'static str {
    match declaration {
        "title" => "\"…\"",
        "include" => "\"FILE\"",
        "const" => "NAME = VALUE, or NAME = [VALUE, …]",
        "param" => "NAME = VALUE in LOW .. HIGH",
        "def" => "NAME(x, …) = EXPRESSION",
        "curve" => "monotone|spline|linear NAME = (x, y) (x, y) … periodic",
        "table" => "NAME from \"FILE\" column \"COLUMN\"",
        "angle" => "DEGREES",
        "period" => "DURATION",
        "frames" => "FROM .. TO step STEP",
        "color" => "NAME = \"#rrggbb\"",
        "gradient" => "NAME = \"#rrggbb\", \"#rrggbb\", …",
        "surface" => "@NAME from \"FILE\"",
        "contour" => "NAME = (x, y) (x, y) …",
        "tropism" => "X, Y, Z strength E",
        "ignore" | "consider" => "NAME …",
        "initial" => "string: MODULE …",
        "axiom" => ": MODULE …",
        "interpret" => "HEAD: MODULE …",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_declaration_has_its_usage() {
        for word in declarations() {
            assert!(!usage(word).is_empty(), "{word}");
        }
    }
}
