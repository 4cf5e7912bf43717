//! Texts that a model includes, and the library of growth functions.
//!
//! `include "lib.dls"` is replaced with the declarations and rules of another file. A file that several texts include is
//! read once; one that includes itself is an error. Its text follows that of the model in the [`Source`], so that a
//! [`Span`] identifies a place in any file and messages name the file.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use crate::Files;
use crate::ast::{Document, Expr, Item, Text};
use crate::parse::Reader;
use dlsys_diagnostic::{Diagnostic, Source, Span};

/// Maximum depth of files that include one another.
const MAX_DEPTH: usize = 20;
/// Maximum number of files of one model.
const MAX_FILES: usize = 1000;

/// The text of the library.
const LIBRARY: &str = include_str!("growth.dls");
/// The file name of the library in messages.
const LIBRARY_NAME: &str = "(library of growth functions)";

/// Parses a text with the files that it includes. The source in the result, if any, contains all texts; spans then refer
/// to that and not to the given one.
pub fn read(source: &Source, files: &dyn Files) -> (Option<Source>, Document, Vec<Diagnostic>) {
    let mut reader = Reader::default();
    let items = reader.read(&source.text);
    let includes = items.iter().any(|(item, _)| matches!(item, Item::Include(_)));
    let mut whole = None;
    let items = if includes {
        let source = whole.insert(source.clone());
        // Paths begin at the folder of the model.
        let own = Path::new(&source.name).file_name().unwrap_or_default().to_string_lossy();
        let chain = vec![(own.as_ref().into(), None)];
        let mut inclusion = Inclusion { reader: &mut reader, source, files, chain, seen: HashMap::new() };
        inclusion.expand(items)
    } else {
        items
    };
    reader.document.items = items;
    if wants_library(&reader.document) {
        let text = whole.get_or_insert_with(|| source.clone());
        let start = text.include(LIBRARY_NAME, LIBRARY);
        reader.document.library = Some(reader.document.items.len());
        let items = reader.read(&padded(start, LIBRARY));
        reader.document.items.extend(items);
    }
    let Reader { document, errors, .. } = reader;
    (whole, document, errors)
}

/// A text with spaces before it, so that its spans are valid in the whole source.
fn padded(start: usize, text: &str) -> String {
    " ".repeat(start) + text
}

/// True if an expression calls a function that the library declares and the model does not.
fn wants_library(document: &Document) -> bool {
    let names: HashSet<&str> = library_names().collect();
    let declared: HashSet<&str> =
        document.items.iter().filter_map(|(item, _)| Some(&*item.name()?.text)).collect();
    document.expressions.iter().any(|expr| match expr {
        Expr::Call(name, _) | Expr::Name(name) => names.contains(&**name) && !declared.contains(&**name),
        _ => false,
    })
}

/// The functions of the library that a model can call.
pub fn library_names<'n>() -> impl Iterator<Item = &'n str> {
    let names = LIBRARY.lines().filter_map(|line| line.strip_prefix("def ")?.split_once('('));
    names.map(|(name, _)| name)
}

type Items = Vec<(Item, Span)>;

struct Inclusion<'i> {
    reader: &'i mut Reader,
    source: &'i mut Source,
    files: &'i dyn Files,
    /// The files that are being read, each with the place of its `include`; the model itself has none.
    chain: Vec<(Arc<str>, Option<Span>)>,
    /// The files that have been read.
    seen: HashMap<Arc<str>, Span>,
}

impl Inclusion<'_> {
    /// Items with each `include` replaced by the items of its file. Recursion is bounded by `MAX_DEPTH`.
    fn expand(&mut self, items: Items) -> Items {
        let mut all = Vec::with_capacity(items.len());
        for (item, span) in items {
            match item {
                Item::Include(file) => all.extend(self.include(&file)),
                item => all.push((item, span)),
            }
        }
        all
    }

    fn include(&mut self, file: &Text) -> Items {
        match self.open(file) {
            Ok(Some((name, text))) => {
                let start = self.source.include(&*name, &text);
                self.seen.insert(name.clone(), file.span);
                self.chain.push((name, Some(file.span)));
                let items = self.reader.read(&padded(start, &text));
                let items = self.expand(items);
                self.chain.pop();
                items
            }
            Ok(None) => Vec::new(),
            Err(error) => {
                self.reader.errors.push(*error);
                Vec::new()
            }
        }
    }

    /// Path and text of a file; None if it has been read before.
    fn open(&self, file: &Text) -> Result<Option<(Arc<str>, String)>, Box<Diagnostic>> {
        let fault =
            |what: &str| Diagnostic::error(format!("`{}` cannot be included", file.text)).at(file.span, what);
        if let Some(why) = crate::fault_of_path(&file.text) {
            return Err(Box::new(fault(why).help(
                "included files stand in the folder of the model or below it, or in a folder given with `--include-path DIR`, \
                 and their paths begin there",
            )));
        }
        let name: Arc<str> = normal(&file.text).into();
        if let Some(at) = self.chain.iter().position(|(known, _)| *known == name) {
            let mut circle: Vec<&str> = self.chain[at..].iter().map(|(name, _)| &**name).collect();
            circle.push(&name);
            let mut error = fault(&match circle[..] {
                [_, _] => "this file includes itself".to_owned(),
                _ => format!("this closes the circle {}", circle.join(" → ")),
            });
            if let Some(span) = self.chain[at].1 {
                error = error.at(span, "it is being included from here");
            }
            return Err(Box::new(error.help(match circle[..] {
                [_, _] => "remove this line",
                _ => "put what both need into a third file, and include that in both",
            })));
        }
        if self.seen.contains_key(&name) {
            return Ok(None);
        }
        if self.chain.len() > MAX_DEPTH {
            let what = format!("files include one another more than {MAX_DEPTH} deep");
            return Err(Box::new(fault(&what).help("include it from a file nearer to the model")));
        }
        if self.seen.len() >= MAX_FILES {
            return Err(Box::new(
                fault(&format!("a model has at most {MAX_FILES} included files"))
                    .help("put several of them into one"),
            ));
        }
        let room = Source::LIMIT.saturating_sub(self.source.text.len()) as u64;
        let bytes = self.files.read(Path::new(&file.text), room).map_err(|why| {
            Box::new(fault(&why).help(
                "paths begin at the folder of the model; other folders are searched with `--include-path DIR`",
            ))
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let line =
                error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count();
            Box::new(
                fault(&format!("line {} of it is not valid UTF-8", line + 1))
                    .help("save the file as UTF-8 (in most editors: “Save with encoding”)"),
            )
        })?;
        let text = text.strip_prefix('\u{feff}').map_or(text.clone(), str::to_owned);
        Ok(Some((name, text)))
    }
}

/// A path without `.` and repeated slashes, so that each file has one name.
fn normal(path: &str) -> String {
    let parts: Vec<&str> = path.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    parts.join("/")
}
