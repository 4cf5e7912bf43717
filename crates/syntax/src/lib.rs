//! The text of a model and its syntax tree, both ways.
//!
//! ```text
//! text ──layout──▶ items ──parse──▶ Document ──print──▶ text
//! ```
//!
//! This crate knows the notation and nothing of its meaning: names are not resolved, and no model is built. That is the
//! work of `dlsys-compile`. Errors are collected, not thrown: each item that cannot be parsed gives one
//! [`Diagnostic`](dlsys_diagnostic::Diagnostic), and the others are parsed all the same. Every pass is linear in the text,
//! and none recurses deeper than a fixed bound.
//!
//! - [`parse`]: text to [`ast::Document`]; [`read`] also parses the files that a text includes.
//! - [`print`]: the syntax tree as text.
//! - [`format`]: the canonical layout of a text (`dlsys fmt`).
//! - [`declarations`]: the table of declarations: words, notation, descriptions.
//! - [`words`]: the words of the language, for highlighting and completion.
//! - [`outline`]: the declarations of a text and their places, for programs that edit texts.

#![warn(missing_docs)]

pub mod ast;
pub mod declarations;
mod error;
mod files;
pub mod foreign_syntax;
pub mod format;
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
pub use files::{Files, NoFiles, is_inside};
pub use include::{library_names, read};
pub use layout::MAX_DEPTH;
