//! A Markdown reader for the tests of the book: fenced blocks, pictures, links and headings.

use std::path::{Path, PathBuf};

/// A fenced block.
#[derive(Debug)]
pub struct Block {
    /// What stands behind the opening fence.
    pub info: String,
    /// Its lines without the indentation of the fence.
    pub text: String,
    /// The line of the opening fence, from 1.
    pub line: usize,
}

#[derive(Debug)]
pub enum Piece {
    Block(Block),
    Picture { line: usize, file: String, title: Option<String> },
    Link { line: usize, target: String },
    Heading(String),
}

/// A page, in pieces.
#[derive(Debug)]
pub struct Page {
    pub path: PathBuf,
    pub pieces: Vec<Piece>,
}

impl Page {
    pub fn read(path: &Path) -> Page {
        let text =
            std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Page { path: path.to_owned(), pieces: pieces(&text) }
    }

    /// Links and pictures, with their lines.
    pub fn links(&self) -> impl Iterator<Item = (usize, &str)> {
        self.pieces.iter().filter_map(|piece| match piece {
            Piece::Picture { line, file, .. } => Some((*line, file.as_str())),
            Piece::Link { line, target } => Some((*line, target.as_str())),
            _ => None,
        })
    }

    /// The names by which headings can be linked to.
    pub fn anchors(&self) -> impl Iterator<Item = String> {
        self.pieces.iter().filter_map(|piece| match piece {
            Piece::Heading(text) => Some(anchor(text)),
            _ => None,
        })
    }

    /// Writes new texts into the blocks that begin on these lines.
    pub fn replace(&self, texts: &[(usize, String)]) {
        let old = std::fs::read_to_string(&self.path).expect("readable");
        let mut new = String::new();
        let mut lines = old.lines().enumerate().map(|(i, line)| (i + 1, line));
        while let Some((number, line)) = lines.next() {
            new += line;
            new.push('\n');
            let Some((_, text)) = texts.iter().find(|(at, _)| *at == number) else { continue };
            let fence = line.trim_start();
            let indent = &line[..line.len() - fence.len()];
            for shown in text.trim_matches('\n').lines() {
                new += format!("{indent}{shown}").trim_end();
                new.push('\n');
            }
            let fence: String = fence.chars().take_while(|c| *c == '`').collect();
            let close = lines.find(|(_, line)| line.trim() == fence).expect("a closing fence");
            new += close.1;
            new.push('\n');
        }
        std::fs::write(&self.path, new).expect("written");
    }
}

fn pieces(text: &str) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line));
    while let Some((number, line)) = lines.next() {
        let start = line.trim_start();
        if start.starts_with("```") {
            let fence: String = start.chars().take_while(|c| *c == '`').collect();
            let indent = line.len() - start.len();
            let mut block =
                Block { info: start[fence.len()..].trim().to_owned(), text: String::new(), line: number };
            for (_, inside) in lines.by_ref() {
                if inside.trim() == fence {
                    break;
                }
                let strip = inside.len() - inside.trim_start_matches(' ').len();
                block.text += &inside[indent.min(strip)..];
                block.text.push('\n');
            }
            pieces.push(Piece::Block(block));
        } else if start.starts_with('#') {
            pieces.push(Piece::Heading(start.trim_start_matches('#').trim().to_owned()));
            links(number, line, &mut pieces);
        } else {
            links(number, line, &mut pieces);
        }
    }
    pieces
}

/// Links and pictures of a line, outside `code`.
fn links(number: usize, line: &str, pieces: &mut Vec<Piece>) {
    let text: String =
        line.split('`').enumerate().map(|(i, part)| if i % 2 == 0 { part } else { "" }).collect();
    let mut rest = text.as_str();
    while let Some(at) = rest.find("](") {
        let label = rest[..at].rfind('[').map_or("", |from| &rest[..from]);
        let inside = &rest[at + 2..];
        let Some(end) = inside.find(')') else { return };
        let (target, title) = match inside[..end].split_once(" \"") {
            Some((target, title)) => (target, Some(title.trim_end_matches('"').to_owned())),
            None => (&inside[..end], None),
        };
        pieces.push(if label.ends_with('!') {
            Piece::Picture { line: number, file: target.to_owned(), title }
        } else {
            Piece::Link { line: number, target: target.to_owned() }
        });
        rest = &inside[end + 1..];
    }
}

/// As GitHub and mdBook make them: lower case, spaces as `-`, punctuation left out.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

#[test]
fn pages_are_taken_apart() {
    let text =
        "# A *b* c\n[x](y.md#z) `[no](no)` ![p](q.png \"r/s.png\")\n  ```sh fails\n  a\n    b\n  ```\n";
    let pieces = pieces(text);
    assert!(matches!(&pieces[0], Piece::Heading(text) if anchor(text) == "a-b-c"), "{pieces:?}");
    assert!(matches!(&pieces[1], Piece::Link { target, .. } if target == "y.md#z"), "{pieces:?}");
    assert!(
        matches!(&pieces[2], Piece::Picture { title: Some(title), .. } if title == "r/s.png"),
        "{pieces:?}"
    );
    assert!(
        matches!(&pieces[3], Piece::Block(block) if block.info == "sh fails" && block.text == "a\n  b\n")
    );
}
