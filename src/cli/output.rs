//! Output files of the flags `--stats`, `--events`, `--csv` and `--plot`. The path `-` is standard output.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::common::{Failure, out_error};

/// A file, or standard output, written in pieces.
pub struct Output {
    path: PathBuf,
    writer: BufWriter<Box<dyn Write>>,
}

impl Output {
    /// Creates the file, or uses standard output.
    pub fn create(path: &Path) -> Result<Output, Failure> {
        let writer: Box<dyn Write> = match is_stdout(path) {
            true => Box::new(std::io::stdout()),
            false => Box::new(File::create(path).map_err(|error| cannot_write(path, error))?),
        };
        Ok(Output { path: path.to_owned(), writer: BufWriter::with_capacity(1 << 16, writer) })
    }

    pub fn write(&mut self, text: &str) -> Result<(), Failure> {
        self.writer.write_all(text.as_bytes()).map_err(|error| cannot_write(&self.path, error))
    }

    /// Flushes all text.
    pub fn finish(mut self) -> Result<(), Failure> {
        self.writer.flush().map_err(|error| cannot_write(&self.path, error))
    }
}

/// Writes a file as a whole, or to standard output.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    match is_stdout(path) {
        true => std::io::stdout().write_all(text.as_bytes()),
        false => std::fs::write(path, text),
    }
    .map_err(|error| cannot_write(path, error))
}

fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

fn cannot_write(path: &Path, error: std::io::Error) -> Failure {
    match is_stdout(path) {
        true => out_error(error),
        false => Failure::Model(format!("error: cannot write {}: {error}\n", path.display())),
    }
}
