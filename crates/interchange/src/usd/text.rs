//! The text of USD layers: lines, strings, numbers and identifiers (OpenUSD, *USDA file format specification* 1.0).

use std::collections::HashSet;
use std::fmt::Display;

use dlsys_render::push_number;

/// Lines, indented by their depth.
#[derive(Debug, Default)]
pub(super) struct Text {
    out: String,
    depth: usize,
}

impl Text {
    fn indent(&mut self) {
        self.out.extend(std::iter::repeat_n("    ", self.depth));
    }

    /// A line.
    pub(super) fn line(&mut self, line: &str) {
        if !line.is_empty() {
            self.indent();
        }
        self.out.push_str(line);
        self.out.push('\n');
    }

    /// A line that `write` writes behind its beginning, such as a long list.
    pub(super) fn long(&mut self, beginning: &str, write: impl FnOnce(&mut String)) {
        self.indent();
        self.out.push_str(beginning);
        write(&mut self.out);
        self.out.push('\n');
    }

    /// The beginning of a block.
    pub(super) fn open(&mut self, beginning: &str, [open, _]: [&str; 2]) {
        self.line(&format!("{beginning}{open}"));
        self.depth += 1;
    }

    /// The end of a block.
    pub(super) fn close(&mut self, [_, close]: [&str; 2]) {
        self.depth -= 1;
        self.line(close);
    }

    /// Lines between brackets: `(` and `)`, or `{` and `}`.
    pub(super) fn block(&mut self, beginning: &str, brackets: [&str; 2], inside: impl FnOnce(&mut Text)) {
        self.open(beginning, brackets);
        inside(self);
        self.close(brackets);
    }

    /// A prim with its metadata.
    pub(super) fn prim(
        &mut self,
        head: &str,
        metadata: impl FnOnce(&mut Text),
        properties: impl FnOnce(&mut Text),
    ) {
        self.block(&format!("{head} "), PARENTHESES, metadata);
        self.block("", BRACES, properties);
    }

    /// Samples of an attribute at ascending times: `beginning.timeSamples = { … }`. Those just before and just after an event, whose times are
    /// less than [`APART`] from one another, are set that far apart, because no time may stand there twice.
    pub(super) fn samples<T>(
        &mut self,
        beginning: &str,
        samples: impl IntoIterator<Item = (f64, T)>,
        write: impl Fn(&mut String, T),
    ) {
        self.long(beginning, |out| {
            out.push_str(".timeSamples = {");
            let mut before = f64::NEG_INFINITY;
            for (i, (time, value)) in samples.into_iter().enumerate() {
                let time = time.max(before + APART);
                before = time;
                out.push_str(if i == 0 { "" } else { "," });
                push_number(out, time, TIME);
                out.push(':');
                write(out, value);
            }
            out.push('}');
        });
    }

    /// Takes out what has been written so far.
    pub(super) fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out).into_bytes()
    }

    pub(super) fn finish(self) -> Vec<u8> {
        self.out.into_bytes()
    }
}

/// Decimals of times, in time codes.
const TIME: usize = 5;
/// Least time between two samples, in time codes: four microseconds.
const APART: f64 = 1e-4;

pub(super) const PARENTHESES: [&str; 2] = ["(", ")"];
pub(super) const BRACES: [&str; 2] = ["{", "}"];

/// Numbers between brackets with commas.
pub(super) fn tuple<const N: usize>(out: &mut String, numbers: [f64; N], decimals: usize) {
    for (i, x) in numbers.into_iter().enumerate() {
        out.push(if i == 0 { '(' } else { ',' });
        push_number(out, x, decimals);
    }
    out.push(')');
}

/// A list of tuples.
pub(super) fn tuples(out: &mut String, all: &[[f32; 3]], decimals: usize) {
    list(out, all, |out, numbers| tuple(out, numbers.map(f64::from), decimals));
}

/// A list.
pub(super) fn list<T: Copy>(out: &mut String, all: &[T], write: impl Fn(&mut String, T)) {
    out.push('[');
    for (i, item) in all.iter().enumerate() {
        out.push_str(if i == 0 { "" } else { "," });
        write(out, *item);
    }
    out.push(']');
}

/// A string in quotes.
pub(super) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// An entry of a dictionary.
pub(super) fn entry(kind: &str, name: &str, value: impl Display) -> String {
    format!("{kind} {name} = {value}")
}

/// Names of the children of a prim: ASCII letters, digits and underscores, not a digit first, no two the same.
#[derive(Debug, Default)]
pub(super) struct Identifiers(HashSet<String>);

impl Identifiers {
    pub(super) fn choose(&mut self, wanted: &str) -> String {
        let mut name: String =
            wanted.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        if name.chars().next().is_none_or(|first| first.is_ascii_digit()) {
            name.insert(0, '_');
        }
        let base = name.clone();
        let mut count = 1;
        while !self.0.insert(name.clone()) {
            count += 1;
            name = format!("{base}_{count}");
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_valid_and_unique() {
        let mut names = Identifiers::default();
        let chosen = ["Leaf.01", "Leaf-01", "3x", "", "é", "Leaf_01_2"].map(|name| names.choose(name));
        assert_eq!(chosen, ["Leaf_01", "Leaf_01_2", "_3x", "_", "__2", "Leaf_01_2_2"]);
    }

    #[test]
    fn strings_are_escaped() {
        assert_eq!(quoted("a \"b\" \\ c\nd\u{7}é"), r#""a \"b\" \\ c\nd é""#);
    }

    #[test]
    fn samples_are_one_line() {
        let mut text = Text::default();
        text.block("def Xform \"a\" ", BRACES, |text| {
            text.samples(
                "double3 xformOp:translate",
                [(0.0, 1.0), (1.25, -0.00001), (1.25, 3.0)],
                |out, x| {
                    tuple(out, [x, 0.0, 2.0], 4);
                },
            );
        });
        let expected = "def Xform \"a\" {\n    double3 xformOp:translate.timeSamples = {0:(1,0,2),1.25:(0,0,2),1.2501:(3,0,2)}\n}\n";
        assert_eq!(String::from_utf8(text.finish()).expect("text"), expected);
    }
}
