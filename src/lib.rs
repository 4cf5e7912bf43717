//! dlsys
pub mod cli;
pub mod diagnostic;
pub mod export;
pub mod expr;
pub mod lang;
pub mod model;
pub mod scene;
pub mod session;
pub mod sim;
pub mod structure;
pub mod turtle;
