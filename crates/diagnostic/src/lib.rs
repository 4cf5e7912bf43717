//! What is said about a model: messages with the place in the text that they are about.
//!
//! Every stage has its own errors; all of them end here, in a [`Diagnostic`], and there is one function
//! that draws them ([`Diagnostic::render`]), for the command line, the tests and whoever embeds the library.

#![warn(missing_docs)]

use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// A stretch of the source text, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Span {
    /// The first byte.
    pub start: u32,
    /// The byte after the last one.
    pub end: u32,
}

impl Span {
    /// The bytes from `start` up to `end`, excluded.
    pub fn new(start: usize, end: usize) -> Span {
        // Sources are bounded far below 4 GiB (`Source::LIMIT`).
        Span { start: start as u32, end: end as u32 }
    }

    /// From the start of `self` to the end of `other`.
    pub fn to(self, other: Span) -> Span {
        Span { start: self.start.min(other.start), end: self.end.max(other.end) }
    }

    /// The bytes, for slicing [`Source::text`].
    pub fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A model's text and where it came from. Texts that it includes stand behind it, so that a [`Span`] is a place in any of
/// them.
#[derive(Clone, Debug)]
pub struct Source {
    /// The file as the user named it.
    pub name: String,
    /// The text, UTF-8, with everything that it includes behind it.
    pub text: String,
    /// Byte at which each line starts.
    lines: Vec<u32>,
    /// Included texts: where each begins, its first line, and its name.
    included: Vec<(u32, usize, String)>,
}

impl Source {
    /// Greatest size of a model file, in bytes.
    pub const LIMIT: usize = 256 << 20;

    /// Takes text that is known to be good, as in tests and examples.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Source {
        let text = text.into();
        let mut lines = vec![0];
        lines.extend(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i as u32 + 1));
        Source { name: name.into(), text, lines, included: Vec::new() }
    }

    /// Takes the bytes of a file: drops a byte-order mark, rejects what is not UTF-8.
    pub fn from_bytes(name: impl Into<String>, bytes: Vec<u8>) -> Result<Source, Box<(Source, Diagnostic)>> {
        let name = name.into();
        if bytes.len() > Source::LIMIT {
            let message =
                format!("this file has {} MB; a model may have {}", bytes.len() >> 20, Source::LIMIT >> 20);
            return Err(Box::new((Source::new(name, ""), Diagnostic::error(message))));
        }
        match String::from_utf8(bytes) {
            Ok(mut text) => {
                if text.starts_with('\u{feff}') {
                    text.drain(..'\u{feff}'.len_utf8());
                }
                Ok(Source::new(name, text))
            }
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                let byte = error.as_bytes()[at];
                // The text is shown with the bad bytes replaced; up to the first of them nothing moves.
                let source = Source::new(name, String::from_utf8_lossy(error.as_bytes()).into_owned());
                let diagnostic = Diagnostic::error("the file is not valid UTF-8")
                    .at(
                        Span::new(at, at + '\u{fffd}'.len_utf8()),
                        format!("byte 0x{byte:02x} begins no character"),
                    )
                    .help("save the file as UTF-8 (in most editors: “Save with encoding”)");
                Err(Box::new((source, diagnostic)))
            }
        }
    }

    /// Puts a text that the model includes behind what there is, and returns where it begins.
    pub fn include(&mut self, name: impl Into<String>, text: &str) -> usize {
        if !self.text.ends_with('\n') {
            self.text.push('\n');
            self.lines.push(self.text.len() as u32);
        }
        let start = self.text.len();
        self.included.push((start as u32, self.lines.len() - 1, name.into()));
        self.text.push_str(text);
        let breaks = text.bytes().enumerate().filter(|(_, b)| *b == b'\n');
        self.lines.extend(breaks.map(|(i, _)| (start + i) as u32 + 1));
        start
    }

    /// The model's own text, without what it includes.
    pub fn own_text(&self) -> &str {
        self.included.first().map_or(&self.text, |first| &self.text[..first.0 as usize])
    }

    fn part(&self, byte: u32) -> Option<&(u32, usize, String)> {
        self.included[..self.included.partition_point(|part| part.0 <= byte)].last()
    }

    /// The file that a byte stands in.
    pub fn name_of(&self, byte: u32) -> &str {
        self.part(byte).map_or(&self.name, |part| &part.2)
    }

    /// The line that a byte stands in, of all texts together.
    fn line_of(&self, byte: u32) -> usize {
        self.lines.partition_point(|&start| start <= byte) - 1
    }

    /// Line and column of a byte in its file, both from 1; columns count characters.
    pub fn position(&self, byte: u32) -> (usize, usize) {
        let line = self.line_of(byte);
        let column = self.text[self.lines[line] as usize..].char_indices();
        let offset = (byte - self.lines[line]) as usize;
        let first = self.part(byte).map_or(0, |part| part.1);
        (line - first + 1, column.take_while(|(i, _)| *i < offset).count() + 1)
    }

    /// The text of a span.
    pub fn slice(&self, span: Span) -> &str {
        &self.text[span.range()]
    }

    fn line_range(&self, line: usize) -> Range<usize> {
        let end = self.lines.get(line + 1).map_or(self.text.len(), |&next| next as usize);
        self.lines[line] as usize..end
    }
}

/// How grave a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The model cannot be used, or the run cannot go on.
    Error,
    /// Does not stop a run.
    Warning,
}

/// One message.
#[derive(Clone, Debug)]
pub struct Diagnostic {
    /// How grave it is.
    pub severity: Severity,
    /// One sentence without a full stop: what is wrong.
    pub message: String,
    /// Places in the text with a remark each; the first is where the fault is.
    pub labels: Vec<(Span, String)>,
    /// Further facts.
    pub notes: Vec<String>,
    /// What to try.
    pub help: Vec<String>,
}

impl Diagnostic {
    fn new(severity: Severity, message: impl Into<String>) -> Diagnostic {
        Diagnostic {
            severity,
            message: message.into(),
            labels: Vec::new(),
            notes: Vec::new(),
            help: Vec::new(),
        }
    }

    /// A message that stops a run, without labels, notes or advice.
    pub fn error(message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(Severity::Error, message)
    }

    /// A message that does not stop a run, without labels, notes or advice.
    pub fn warning(message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(Severity::Warning, message)
    }

    /// Adds a place in the text.
    pub fn at(mut self, span: Span, remark: impl Into<String>) -> Diagnostic {
        self.labels.push((span, remark.into()));
        self
    }

    /// Adds a further fact: one sentence without a full stop.
    pub fn note(mut self, note: impl Into<String>) -> Diagnostic {
        self.notes.push(note.into());
        self
    }

    /// Adds advice: what to write instead, or where to look.
    pub fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.help.push(help.into());
        self
    }

    /// Adds advice if there is any.
    pub fn help_opt(mut self, help: Option<String>) -> Diagnostic {
        self.help.extend(help);
        self
    }

    /// Draws the message as text: what, where (file, line, column, source line), why, what to try.
    pub fn render(&self, source: &Source, coloured: bool) -> String {
        /// Lines longer than this are quoted in part: nobody reads a line of 50 MB.
        const LONG: usize = 400;
        /// Up to this column lines are quoted from their beginning, so that places in them have their number.
        const FAR: usize = 10_000;

        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let mut group = Group::with_title(level.primary_title(&self.message));
        let mut excerpts = Vec::new();
        let mut labels: Vec<&(Span, String)> = self.labels.iter().collect();
        while let Some((span, remark)) = labels.first().copied() {
            let last = source.line_of(span.end.saturating_sub(1).max(span.start));
            let mut range = source.line_range(source.line_of(span.start));
            range.end = range.end.max(source.line_range(last).end).min(source.text.len());
            let near = span.range().end < range.start + FAR && span.range().len() < LONG / 2;
            if range.len() > LONG && near {
                let wanted = range.end.min(span.range().end + LONG / 2);
                range.end =
                    (wanted..range.end).find(|i| source.text.is_char_boundary(*i)).unwrap_or(range.end);
            } else if range.len() > LONG {
                let (line, column) = source.position(span.start);
                let excerpt: String = source.text[span.range()].chars().take(60).collect();
                excerpts.push(format!(
                    "{}:{line}:{column}: {remark} (at `{}`)",
                    source.name_of(span.start),
                    excerpt.trim_end()
                ));
                labels.remove(0);
                continue;
            }
            let mut snippet = Snippet::source(&source.text[range.clone()])
                .line_start(source.position(span.start).0)
                .path(source.name_of(span.start));
            let first_label = std::ptr::eq(*labels.first().expect("not empty"), &self.labels[0]);
            let mut kind = if first_label { AnnotationKind::Primary } else { AnnotationKind::Context };
            labels.retain(|(other, remark)| {
                let inside = range.start <= other.range().start && other.range().end <= range.end;
                if inside {
                    let at = other.range().start - range.start..other.range().end - range.start;
                    snippet = std::mem::replace(&mut snippet, Snippet::source(""))
                        .annotation(kind.span(at).label(remark.as_str()));
                    kind = AnnotationKind::Context;
                }
                !inside
            });
            group = group.element(snippet);
        }
        if self.labels.is_empty() && !source.name.is_empty() {
            group = group.element(annotate_snippets::Origin::path(&source.name));
        }
        for excerpt in &excerpts {
            group = group.element(Level::NOTE.message(excerpt));
        }
        for note in &self.notes {
            group = group.element(Level::NOTE.message(note));
        }
        for help in &self.help {
            group = group.element(Level::HELP.message(help));
        }
        let renderer = if coloured { Renderer::styled() } else { Renderer::plain() };
        // An empty line sets messages apart.
        renderer.render(&[group]) + "\n\n"
    }
}
