//! The declarations of a text and their places, for programs that edit texts piece by piece.

use crate::ast::{ContextPart, HeadModule, Item, Rule};
use crate::declarations::Repeats;
use crate::parse;
use dlsys_diagnostic::{Source, Span};

/// A declaration or rule of a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutlineEntry {
    /// Of two entries with the same key, the later one replaces the other. None where a text may have any number.
    pub key: Option<String>,
    /// Its name, if it has one: `r`, `F_a(x, n)`, `frames`.
    pub name: String,
    /// True for a rule, continuous or discrete.
    pub is_rule: bool,
    /// True for the initial string.
    pub is_axiom: bool,
    /// Its place, without white space at its end.
    pub span: Span,
}

/// The declarations and rules of a text in the order written, without those that cannot be parsed.
pub fn outline(text: &str) -> Vec<OutlineEntry> {
    let source = Source::new("", text);
    let (document, _) = parse::parse(&source);
    document.items.iter().map(|(item, span)| entry(item, *span, &source)).collect()
}

fn entry(item: &Item, span: Span, source: &Source) -> OutlineEntry {
    let (key, name) = match item {
        Item::Rule(rule) => (Some(head(rule)), source.slice(rule.head).trim().to_owned()),
        Item::Axiom(_) => (Some("initial string".to_owned()), "initial string".to_owned()),
        Item::Include(file) => (Some(format!("include {}", file.text)), format!("include \"{}\"", file.text)),
        Item::Interpret { head, .. } => (
            Some(format!("interpret {}", pattern(head))),
            format!("interpret {}", source.slice(head.span).trim()),
        ),
        item => declared(item),
    };
    let (is_rule, is_axiom) = (matches!(item, Item::Rule(_)), matches!(item, Item::Axiom(_)));
    OutlineEntry { key, name, is_rule, is_axiom, span }
}

/// Key and name of a declaration that is identified by its word or by the name that it declares.
fn declared(item: &Item) -> (Option<String>, String) {
    let Some(declaration) = item.declaration() else { return (None, String::new()) };
    let name = item.name().map_or(declaration.word, |name| &*name.text);
    let key = match declaration.repeats {
        Repeats::Once => Some(declaration.word.to_owned()),
        Repeats::PerName(sort) => Some(format!("{sort} {name}")),
        _ => None,
    };
    (key, name.to_owned())
}

/// A module of a head without the names of its parameters.
fn pattern(module: &HeadModule) -> String {
    format!("{}/{}", module.name.text, module.parameters.len())
}

fn head(rule: &Rule) -> String {
    let all = |modules: &[HeadModule]| modules.iter().map(pattern).collect::<Vec<_>>().join(" ");
    let mut following = rule.right.iter().map(pattern);
    let right: Vec<String> = (rule.right_shape.iter())
        .filter_map(|turn| match turn {
            ContextPart::Module => following.next(),
            ContextPart::Open => Some("[".to_owned()),
            ContextPart::Close => Some("]".to_owned()),
        })
        .collect();
    format!("{} < {} > {}", all(&rule.left), pattern(&rule.predecessor), right.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_do_not_depend_on_the_notation() {
        let text = "const r = 2\nA(a) < F(x): solve dx/dt = r\n  # a remark\n\nfoo bar\nignore F\n";
        let entries = outline(text);
        let names: Vec<&str> = entries.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["r", "A(a) < F(x)", "ignore"]);
        assert_eq!(&text[entries[1].span.range()], "A(a) < F(x): solve dx/dt = r");
        let again = outline("param r = 3 in 0 .. 5\nA(q)<F(y):\n  solve dy/dt = 1");
        assert_eq!(again[0].key, entries[0].key);
        assert_eq!(again[1].key, entries[1].key);
        assert_eq!(entries[2].key, None);
    }
}
