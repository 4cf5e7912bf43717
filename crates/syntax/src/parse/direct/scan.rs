//! A place in the text of an item, and the tokens that begin there. Each ends where that of the grammar ends.

use pest::unicode::{DECIMAL_NUMBER, LETTER, MARK};

use crate::lexeme::number_length;

/// A place in a text, which moves on over what is read.
pub struct Cursor<'t> {
    text: &'t str,
    /// The byte that is read next.
    pub at: usize,
    /// The end of the last token.
    pub end: usize,
}

impl<'t> Cursor<'t> {
    pub fn new(text: &'t str) -> Cursor<'t> {
        Cursor { text, at: 0, end: 0 }
    }

    /// The byte at the present place, as it is; 0 at the end of the text.
    pub fn byte(&self) -> u8 {
        self.text.as_bytes().get(self.at).copied().unwrap_or(0)
    }

    /// The first byte behind spaces; 0 at the end of the text.
    pub fn next(&mut self) -> u8 {
        while self.byte() == b' ' {
            self.at += 1;
        }
        self.byte()
    }

    /// Passes over spaces and line breaks.
    pub fn lines(&mut self) {
        while matches!(self.byte(), b' ' | b'\n') {
            self.at += 1;
        }
    }

    /// The text from the present place on.
    pub fn rest(&self) -> &'t str {
        &self.text[self.at..]
    }

    pub fn is_at_end(&self) -> bool {
        self.at == self.text.len()
    }

    /// Takes a token of this length.
    pub fn take(&mut self, length: usize) -> &'t str {
        let token = &self.text[self.at..self.at + length];
        self.at += length;
        self.end = self.at;
        token
    }

    /// Takes a sign of one byte, behind spaces.
    pub fn sign(&mut self, sign: u8) -> Option<()> {
        (self.next() == sign).then(|| {
            self.take(1);
        })
    }

    /// The word that begins at the present place, whatever it means; "" if none does.
    pub fn peek_word(&self) -> &'t str {
        let first = self.byte();
        if first.is_ascii_alphabetic() || !first.is_ascii() && self.rest().starts_with(LETTER) {
            &self.text[self.at..self.end_of_name(self.at)]
        } else {
            ""
        }
    }

    /// Takes a keyword, behind spaces.
    pub fn keyword(&mut self, word: &str) -> Option<()> {
        self.next();
        (self.peek_word() == word).then(|| {
            self.take(word.len());
        })
    }

    /// Takes a name, behind spaces: a word that is not reserved.
    pub fn name(&mut self) -> Option<&'t str> {
        self.next();
        let word = self.peek_word();
        (!word.is_empty() && !is_reserved(word)).then(|| self.take(word.len()))
    }

    /// The length of the subscript at this byte, as in `+_l`; 0 if there is none.
    pub fn subscript_length(&self, at: usize) -> usize {
        if self.text.as_bytes().get(at) != Some(&b'_') {
            return 0;
        }
        let length = self.end_of_name(at) - at;
        if length > 1 { length } else { 0 }
    }

    /// The length of the number at the present place, and whether it multiplies what it touches.
    pub fn number(&self) -> (usize, bool) {
        let rest = self.rest();
        let length = number_length(rest);
        (length, rest[length..].starts_with(|c: char| c == '(' || is_letter(c)))
    }

    /// The end of the characters of a name from this byte on.
    fn end_of_name(&self, from: usize) -> usize {
        let bytes = self.text.as_bytes();
        let mut end = from;
        while let Some(&byte) = bytes.get(end) {
            if byte.is_ascii_alphanumeric() || byte == b'_' {
                end += 1;
            } else if byte.is_ascii() {
                break;
            } else {
                match self.text[end..].chars().next() {
                    Some(c) if is_name_character(c) => end += c.len_utf8(),
                    _ => break,
                }
            }
        }
        end
    }
}

/// `reserved` of the grammar.
pub fn is_reserved(word: &str) -> bool {
    matches!(word, "if" | "then" | "else" | "solve" | "produce")
}

/// True if a text begins with a letter, as what stands behind the `d` of a rate does.
pub fn begins_with_letter(text: &str) -> bool {
    text.starts_with(LETTER)
}

/// `letter` of the grammar.
fn is_letter(c: char) -> bool {
    c.is_ascii_alphabetic() || LETTER(c)
}

/// `ident_char` of the grammar, beyond ASCII.
fn is_name_character(c: char) -> bool {
    LETTER(c) || DECIMAL_NUMBER(c) || ('\u{2080}'..='\u{2089}').contains(&c) || MARK(c)
}
