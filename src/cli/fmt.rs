//! `dlsys fmt`: the canonical layout of model files.

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use clap::Args;

use super::common::{Failure, coloured, out_error, tell};
use crate::diagnostic::{Diagnostic, Source};
use crate::session::read_whole;
use crate::syntax::format::format;

#[derive(Debug, Args)]
pub struct FmtArgs {
    /// Model files (*.dls); - reads standard input and writes standard output
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Change nothing, but name the files that would be changed; exit status 1 if there are any
    #[arg(long)]
    pub check: bool,
}

/// Formats files. A file that cannot be read or parsed is not changed; the others are formatted.
pub fn fmt(args: &FmtArgs) -> Result<(), Failure> {
    let (mut failed, mut differing) = (0, 0);
    for path in &args.files {
        let done = if path == Path::new("-") { stream(args.check) } else { file(path, args.check) };
        match done {
            Ok(None) => {}
            Ok(Some(line)) => {
                differing += 1;
                if args.check {
                    say(&format!("{}:{line}: the layout is another from here on\n", shown(path)))?;
                } else if path != Path::new("-") {
                    say(&format!("{}: laid out anew\n", path.display()))?;
                }
            }
            Err(Failure::Model(message)) => {
                failed += 1;
                tell(&message);
            }
            Err(other) => return Err(other),
        }
    }
    let files = |n: usize| if n == 1 { "1 file".to_owned() } else { format!("{n} files") };
    if failed > 0 {
        return Err(Failure::Model(format!("error: {} left as found\n", files(failed))));
    }
    if args.check && differing > 0 {
        return Err(Failure::Model(format!(
            "error: {} not in canonical layout\n  = help: `dlsys fmt` without `--check` lays out anew what was named\n",
            files(differing)
        )));
    }
    Ok(())
}

fn shown(path: &Path) -> String {
    if path == Path::new("-") { "<stdin>".to_owned() } else { path.display().to_string() }
}

/// The text of a file in its canonical layout, and the first line that differs, if any.
fn laid_out(name: &str, bytes: Vec<u8>) -> Result<(String, Option<usize>), Failure> {
    let original = bytes.clone();
    let draw = |source: &Source, all: &[Diagnostic]| {
        Failure::Model(all.iter().map(|d| d.render(source, coloured())).collect())
    };
    let source = Source::from_bytes(name, bytes).map_err(|bad| draw(&bad.source, &[bad.diagnostic]))?;
    let text = format(&source).map_err(|errors| draw(&source, &errors))?;
    let differs = (original != text.as_bytes()).then(|| {
        let mut new = text.split('\n');
        let same =
            String::from_utf8_lossy(&original).split('\n').take_while(|l| new.next() == Some(*l)).count();
        same + 1
    });
    Ok((text, differs))
}

/// Formats standard input to standard output.
fn stream(check: bool) -> Result<Option<usize>, Failure> {
    let mut bytes = Vec::new();
    std::io::stdin()
        .take(Source::LIMIT as u64 + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| Failure::Model(format!("error: cannot read standard input: {error}\n")))?;
    let (text, differs) = laid_out("<stdin>", bytes)?;
    if !check {
        say(&text)?;
    }
    Ok(differs)
}

/// Replaces a file if its layout differs.
fn file(path: &Path, check: bool) -> Result<Option<usize>, Failure> {
    let fault = |action: &str, error: std::io::Error| {
        let help = match error.kind() {
            std::io::ErrorKind::NotFound => "is the name right? In another folder it needs its path",
            std::io::ErrorKind::InvalidInput => "standard input is laid out as `-`",
            std::io::ErrorKind::IsADirectory => "name the files in it, such as `*.dls`",
            _ => "check the rights to the file and its folder; it is as it was",
        };
        Failure::Model(format!("error: cannot {action} {}: {error}\n  = help: {help}\n", path.display()))
    };
    let bytes = read_whole(path, Source::LIMIT as u64).map_err(|error| fault("read", error))?;
    let (text, differs) = laid_out(&path.display().to_string(), bytes)?;
    if differs.is_some() && !check {
        replace(path, &text).map_err(|error| fault("write", error))?;
    }
    Ok(differs)
}

/// Writes a temporary file and renames it, so that the file always has its complete old or new text. If the path is a link,
/// its target is replaced.
fn replace(path: &Path, text: &str) -> std::io::Result<()> {
    let path = path.canonicalize()?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut aside = tempfile::Builder::new().prefix(".dlsys-tmp-").tempfile_in(folder)?;
    aside.write_all(text.as_bytes())?;
    aside.as_file().set_permissions(fs::metadata(&path)?.permissions())?;
    aside.persist(&path).map_err(|error| error.error)?;
    Ok(())
}

fn say(text: &str) -> Result<(), Failure> {
    std::io::stdout().write_all(text.as_bytes()).map_err(out_error)
}
