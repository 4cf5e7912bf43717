//! Ctrl-C in an interactive session.
//!
//! In a session the first Ctrl-C sets a flag, which long computations check from time to time; a second one before the
//! flag is cleared ends the process. In all other commands Ctrl-C ends the process, as usual.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// Exit status after Ctrl-C: 128 plus the number of the signal.
const KILLED: i32 = 130;

static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// The flag, which the first Ctrl-C sets.
pub fn flag() -> Arc<AtomicBool> {
    FLAG.get_or_init(Arc::default).clone()
}

/// True if Ctrl-C was pressed since the flag was last cleared.
pub fn asked() -> bool {
    FLAG.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// Clears the flag.
pub fn clear() {
    flag().store(false, Ordering::Relaxed);
}

/// Installs the handler that sets the flag. False if that is impossible.
pub fn listen() -> bool {
    let flag = flag();
    let pressed = move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(KILLED);
        }
    };
    ctrlc::set_handler(pressed).is_ok()
}
