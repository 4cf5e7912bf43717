//! Messages about a model, with the places in its text that they are about.
//!
//! Every stage has errors of its own; each becomes a [`Diagnostic`], and one function draws them all ([`Diagnostic::render`]): for the
//! command line, for tests, and for programs that embed the library. A [`Source`] holds the text, a [`Span`] is a place in it.
//!
//! ```
//! use dlsys_diagnostic::{Diagnostic, Source, Span};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let source = Source::from_bytes("stem.dls", b"initial string: F(1) G".to_vec())?;
//! let message = Diagnostic::error("there is no rule for `G`")
//!     .at(Span::new(21, 22), "this module")
//!     .help("write `G: …`");
//! let text = message.render(&source, false);
//! assert!(text.starts_with("error: there is no rule for `G`"));
//! assert!(text.contains("stem.dls:1:22"));
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

mod source;

pub use source::{Error, Source, Span};

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

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
    /// Places in the text, each with a remark; the first is that of the mistake.
    pub labels: Vec<(Span, String)>,
    /// Further facts.
    pub notes: Vec<String>,
    /// Advice: what to write instead, or where to look.
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

    /// Adds advice, if there is any.
    pub fn help_opt(mut self, help: Option<String>) -> Diagnostic {
        self.help.extend(help);
        self
    }

    /// Draws the message as text: the message, the places (file, line, column, the line itself) with their remarks, notes and advice.
    /// With colours, it contains escape sequences of terminals. It ends with an empty line.
    pub fn render(&self, source: &Source, coloured: bool) -> String {
        /// Lines longer than this are quoted in part: a line of 50 MB helps nobody.
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
            if span.range().end > source.text.len() {
                // A place outside the text: the message is about another one.
                excerpts.push(remark.clone());
                labels.remove(0);
                continue;
            }
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
        renderer.render(&[group]) + "\n\n"
    }
}
