//! The text of a model, and places in it.

use crate::Diagnostic;
use std::ops::Range;

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

/// A model's text and the name of its file. Texts that it includes are appended to it, so that a [`Span`] is a place in any of them.
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

    /// Takes text as it is, without a check of its size: for tests and examples.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Source {
        let text = text.into();
        let mut lines = vec![0];
        lines.extend(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i as u32 + 1));
        Source { name: name.into(), text, lines, included: Vec::new() }
    }

    /// Takes the bytes of a file, without the byte-order mark.
    ///
    /// # Errors
    ///
    /// The file is larger than [`Source::LIMIT`], or is not UTF-8.
    pub fn from_bytes(name: impl Into<String>, bytes: Vec<u8>) -> Result<Source, Box<Error>> {
        let name = name.into();
        if bytes.len() > Source::LIMIT {
            let message =
                format!("this file has {} MB; a model may have {}", bytes.len() >> 20, Source::LIMIT >> 20);
            let source = Source::new(name, "");
            return Err(Box::new(Error { source, diagnostic: Diagnostic::error(message) }));
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
                Err(Box::new(Error { source, diagnostic }))
            }
        }
    }

    /// Appends a text that the model includes; returns the byte at which it begins.
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

    /// The name of the file that a byte is in.
    pub fn name_of(&self, byte: u32) -> &str {
        self.part(byte).map_or(&self.name, |part| &part.2)
    }

    /// The line that a byte is in, counted from 0 through all texts.
    pub(crate) fn line_of(&self, byte: u32) -> usize {
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

    pub(crate) fn line_range(&self, line: usize) -> Range<usize> {
        let end = self.lines.get(line + 1).map_or(self.text.len(), |&next| next as usize);
        self.lines[line] as usize..end
    }
}

/// A file that is no text of a model: with the text as far as it can be quoted, and the message.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Error {
    /// The text, invalid bytes replaced; empty if the file is too large.
    pub source: Source,
    /// What is wrong.
    pub diagnostic: Diagnostic,
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.diagnostic.render(&self.source, false).trim_end())
    }
}

impl std::error::Error for Error {}
