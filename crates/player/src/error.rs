//! The error of this crate.

use crate::Recorder;

/// Why there is no recording, or no window.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The recording has more numbers than a page can hold.
    #[error("there is too much to record: more than {limit} numbers by t = {time}", limit = Recorder::MOST_NUMBERS)]
    TooLong {
        /// Time of the first frame that does not fit, in units of the model.
        time: f64,
    },
    /// The system opens no window: the reason that it gives.
    #[error("no window can be opened: {0}")]
    Screen(String),
    /// An action that a trial of the window was to do has failed: which, and why.
    #[error("{0}")]
    Trial(String),
}
