//! Bugs of the program itself: the message, and the recovery of unsaved text.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Exit status after a panic, as usual for Rust programs.
pub const STATUS: u8 = 101;

/// The text of a session that is not saved yet.
static UNSAVED: Mutex<Option<String>> = Mutex::new(None);

/// Registers a text that is saved if the program panics; `None` when it has been saved.
pub fn remember(text: Option<&str>) {
    *UNSAVED.lock().unwrap_or_else(PoisonError::into_inner) = text.map(str::to_owned);
}

/// Calls a function. If it panics, the registered text is written into a new file in the folder.
///
/// # Errors
/// The message for the user, if the function panics.
pub fn guarded<T>(folder: &Path, work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = UNSAVED.lock().unwrap_or_else(PoisonError::into_inner).take();
        message(&*panic, text.map(|text| save(folder, &text)))
    })
}

/// Writes a text into a new file.
fn save(folder: &Path, text: &str) -> std::io::Result<PathBuf> {
    use std::io::Write;
    let mut file = tempfile::Builder::new().prefix("dlsys-recovered-").suffix(".dls").tempfile_in(folder)?;
    file.write_all(text.as_bytes())?;
    Ok(file.keep()?.1)
}

fn message(panic: &(dyn Any + Send), saved: Option<std::io::Result<PathBuf>>) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let what = text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
    let mut message = format!(
        "error: this is a bug in dlsys {}: {what}\n\n  = help: please report it with the model, the command line and the lines above\n",
        env!("CARGO_PKG_VERSION")
    );
    match saved {
        Some(Ok(path)) => message += &format!("  = note: the text of the session is in {}\n", path.display()),
        Some(Err(error)) => {
            message += &format!("  = note: the text of the session could not be saved: {error}\n")
        }
        None => {}
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_a_message_and_the_text_of_the_session_is_saved() {
        let folder = tempfile::tempdir().expect("a directory");
        assert_eq!(guarded(folder.path(), || 7), Ok(7));
        remember(Some("initial string: F(1)\n"));
        let message = guarded(folder.path(), || panic!("no such {}", "module")).expect_err("it panics");
        assert!(
            message.contains("this is a bug in dlsys") && message.contains("no such module"),
            "{message}"
        );
        let files: Vec<_> = std::fs::read_dir(folder.path()).expect("there").collect();
        let file = files[0].as_ref().expect("readable").path();
        assert!(files.len() == 1 && message.contains(&file.display().to_string()), "{message}");
        assert_eq!(std::fs::read_to_string(file).expect("text"), "initial string: F(1)\n");
        remember(None);
        let message = guarded(folder.path(), || panic!("again")).expect_err("it panics");
        assert!(!message.contains("text of the session"), "{message}");
    }
}
