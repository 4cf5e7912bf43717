//! The text of a model and its syntax tree, both ways.
//!
//! ```text
//! text ──layout──▶ items ──parse──▶ Document ──print──▶ text
//! ```
//!
//! This crate implements the notation only: `dlsys-compile` resolves names and builds the model. Each item that cannot be
//! parsed yields one [`Diagnostic`](dlsys_diagnostic::Diagnostic), and the other items are still parsed. Every pass takes
//! time linear in the text and recurses to a fixed depth at most.
//!
//! - [`parse`]: text to [`ast::Document`]; [`read`] also parses the files that a text includes.
//! - [`print`](mod@print): the syntax tree as text.
//! - [`format`](mod@format): the canonical layout of a text (`dlsys fmt`).
//! - [`declarations`]: the table of declarations: words, notation, descriptions.
//! - [`words`]: the words of the language, for highlighting and completion.
//! - [`outline`]: the declarations of a text and their places, for programs that edit texts.

#![warn(missing_docs)]

// The parser that pest derives without `std` names it.
extern crate alloc;

pub mod ast;
pub mod declarations;
mod error;
mod files;
pub mod foreign_lines;
pub mod foreign_syntax;
pub mod format;
mod grammar;
mod include;
mod layout;
mod lexeme;
mod notation;
pub mod outline;
pub mod parse;
pub mod print;
pub mod suggest;
pub mod words;

pub use error::Errors;
pub use files::{Files, NoFiles, fault_of_path, is_inside};
pub use include::{library_names, read};
pub use layout::MAX_DEPTH;
