//! The error type of studies, hard cases and verifications.

use dlsys_sim::{self as sim, Settings};

use super::record::EarlyEnd;

/// Why there is no study, case or verification.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The text of a hard case is malformed, or its model cannot be loaded.
    #[error("{file}:{line}: {message}")]
    Case {
        /// Path or name of the file.
        file: String,
        /// Line of the mistake, from 1; 0 for the file as a whole.
        line: usize,
        /// Description of the mistake.
        message: String,
    },
    /// No method reaches the last time, so a study has no reference; the text is the reason.
    #[error("{0}")]
    NoReference(String),
    /// The run that is to be verified ends with an error.
    #[error("{0}")]
    Run(#[from] sim::Error),
    /// No other method reaches the last time: the settings of each, and why it ended.
    #[error("no other method reaches the last time")]
    NoOtherMethod(Vec<(Settings, EarlyEnd)>),
}
