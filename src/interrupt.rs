//! Ctrl-C, for those who go on after it.
//!
//! A session listens: the first Ctrl-C sets a flag, at which long work looks from time to time; a second one, before the
//! flag was taken back, ends the process. Everybody else dies of the first, as usual.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// Exit status of a process that Ctrl-C has ended: 128 and the number of the signal.
const KILLED: i32 = 130;

static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// The flag; true from the first Ctrl-C on.
pub fn flag() -> Arc<AtomicBool> {
    FLAG.get_or_init(Arc::default).clone()
}

/// True if Ctrl-C was pressed since the flag was taken back last.
pub fn asked() -> bool {
    FLAG.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// Takes the flag back.
pub fn clear() {
    flag().store(false, Ordering::Relaxed);
}

/// From now on Ctrl-C sets the flag. False if that cannot be had.
pub fn listen() -> bool {
    let flag = flag();
    let pressed = move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(KILLED);
        }
    };
    ctrlc::set_handler(pressed).is_ok()
}
