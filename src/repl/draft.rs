//! The text of the loaded model, typed piece by piece, or read from a file and changed.
//!
//! A declaration or rule replaces the earlier one with the same name or head; anything else is added
//! at the end. `undo` restores an earlier text. The caller reads a changed text and accepts it only if it is valid.

use std::path::{Path, PathBuf};

use crate::syntax::outline::{OutlineEntry, outline};

/// Largest number of texts kept for `undo`.
const MOST_UNDONE: usize = 100;

/// The text and where it came from.
#[derive(Clone, Debug, Default)]
pub struct Draft {
    pub text: String,
    /// The file that it was read from or saved in.
    pub path: Option<PathBuf>,
    saved: String,
    before: Vec<String>,
    /// The rule typed last, to which clauses are added.
    last_rule: Option<String>,
}

/// A proposed new text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextChange {
    pub text: String,
    /// Descriptions of the changes, such as `F(x) replaced`.
    pub done: Vec<String>,
    last_rule: Option<String>,
}

impl TextChange {
    /// A change of the whole text.
    pub fn whole(text: String) -> TextChange {
        TextChange { text, done: Vec::new(), last_rule: None }
    }
}

impl Draft {
    /// A text read from a file.
    pub fn of_file(path: &Path, text: String) -> Draft {
        let saved = text.clone();
        Draft { text, path: Some(path.to_owned()), saved, ..Draft::default() }
    }

    /// The file's name, for messages.
    pub fn name(&self) -> String {
        self.path.as_ref().map_or("typed".to_owned(), |path| path.display().to_string())
    }

    /// The folder from which the model reads files.
    pub fn folder(&self) -> PathBuf {
        self.path.as_ref().and_then(|path| path.parent()).unwrap_or(Path::new("")).to_owned()
    }

    pub fn is_saved(&self) -> bool {
        self.text == self.saved || self.text.trim().is_empty()
    }

    /// True if the file exists and holds neither the text last read or saved, nor the present one.
    pub fn was_changed_elsewhere(&self, path: &Path) -> bool {
        let Ok(found) = std::fs::read(path) else { return false };
        let found = String::from_utf8_lossy(&found);
        let same = |text: &str| text.lines().eq(found.trim_start_matches('\u{feff}').lines());
        !same(&self.saved) && !same(&self.text)
    }

    pub fn set_saved(&mut self, path: &Path) {
        self.path = Some(path.to_owned());
        self.saved = self.text.clone();
    }

    /// The text with declarations and rules typed in.
    pub fn with(&self, typed: &str) -> TextChange {
        let known = outline(&self.text);
        let new = outline(typed);
        if new.is_empty() {
            // It cannot be parsed; the caller reports why.
            return TextChange { text: joined(&self.text, typed), done: Vec::new(), last_rule: None };
        }
        let mut text = self.text.clone();
        let mut added = String::new();
        let mut done = Vec::new();
        // From the last to the first, so that spans stay valid.
        let mut replaced: Vec<(&OutlineEntry, String)> = Vec::new();
        for (i, entry) in new.iter().enumerate() {
            let begin = if i == 0 { 0 } else { entry.span.range().start };
            let end = new.get(i + 1).map_or(typed.len(), |next| next.span.range().start);
            let piece = typed[begin..end].trim_end();
            let same = |old: &&OutlineEntry| old.key.is_some() && old.key == entry.key;
            match known.iter().find(same).filter(|old| !replaced.iter().any(|(other, _)| other == old)) {
                Some(old) => {
                    replaced.push((old, typed[entry.span.range().start..end].trim_end().to_owned()));
                    done.push(format!("{} replaced", entry.name));
                }
                None => {
                    added = joined(&added, piece);
                    done.push(entry.name.clone());
                }
            }
        }
        replaced.sort_by_key(|(old, _)| std::cmp::Reverse(old.span));
        for (old, piece) in replaced {
            text.replace_range(old.span.range(), &piece);
        }
        if !added.is_empty() {
            text = joined(&text, &added);
        }
        let last_rule = new.iter().rev().find(|entry| entry.is_rule).and_then(|entry| entry.key.clone());
        TextChange { text, done, last_rule }
    }

    /// The text with a clause added to the rule typed last; None if no rule was typed.
    pub fn with_clause(&self, clause: &str) -> Option<TextChange> {
        let key = self.last_rule.as_ref()?;
        let known = outline(&self.text);
        let rule = known.iter().rev().find(|entry| entry.key.as_ref() == Some(key))?;
        let mut text = self.text.clone();
        text.insert_str(rule.span.range().end, &format!("\n  {}", clause.trim()));
        Some(TextChange {
            text,
            done: vec![format!("{} continued", rule.name)],
            last_rule: Some(key.clone()),
        })
    }

    /// Applies a change.
    pub fn accept(&mut self, change: TextChange) {
        let before = std::mem::replace(&mut self.text, change.text);
        self.before.push(before);
        if self.before.len() > MOST_UNDONE {
            self.before.remove(0);
        }
        self.last_rule = change.last_rule.or(self.last_rule.take());
    }

    /// The text before the last change.
    pub fn previous(&self) -> Option<&str> {
        self.before.last().map(String::as_str)
    }

    /// Reverts the last change.
    pub fn undo(&mut self) {
        if let Some(before) = self.before.pop() {
            self.text = before;
        }
    }

    /// True if there is an initial string.
    pub fn has_axiom(text: &str) -> bool {
        outline(text).iter().any(|entry| entry.is_axiom)
    }
}

/// One text after another, each with its line break.
fn joined(before: &str, after: &str) -> String {
    let mut text = before.trim_end().to_owned();
    if !text.is_empty() {
        text += "\n";
    }
    text += after.trim_end();
    text += "\n";
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(lines: &[&str]) -> Draft {
        let mut draft = Draft::default();
        for line in lines {
            let change = draft.with(line);
            draft.accept(change);
        }
        draft
    }

    #[test]
    fn what_is_typed_again_replaces_what_was_there() {
        let mut draft = typed(&[
            "const r = 2   # a rate",
            "F(x): solve dx/dt = r",
            "A < F(x): produce A",
            "const r = 3\nconst s = 4 # new",
            "F(y):\n  solve dy/dt = s",
        ]);
        assert_eq!(
            draft.text,
            "const r = 3   # a rate\nF(y):\n  solve dy/dt = s\nA < F(x): produce A\nconst s = 4 # new\n"
        );
        let change = draft.with_clause("if y = 2 produce A").expect("a rule was typed");
        assert_eq!(change.done, ["F(y) continued"]);
        draft.accept(change);
        assert!(draft.text.contains("dy/dt = s\n  if y = 2 produce A\nA < F(x)"), "{}", draft.text);
        draft.undo();
        draft.undo();
        assert!(draft.text.contains("F(x): solve dx/dt = r\n"));
    }

    #[test]
    fn remarks_stay_with_what_follows_them() {
        let draft = typed(&["# the rate\nconst r = 2\n# the rule\nF(x): solve dx/dt = r"]);
        assert_eq!(draft.text, "# the rate\nconst r = 2\n# the rule\nF(x): solve dx/dt = r\n");
        assert_eq!(draft.with("F(x): solve dx/dt = 1").done, ["F(x) replaced"]);
        assert!(typed(&[]).with_clause("if x = 1 produce A").is_none());
    }
}
