//! `dlsys new`: a small commented model.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use clap::Args;

use super::common::{Failure, out_error};

/// The model, with `NAME` for the name: a flowering herb.
const START: &str = include_str!("start.dls");
/// The same for plants with this name.
const FERN: (&str, &str) = ("fern", include_str!("fern.dls"));

#[derive(Debug, Args)]
pub struct NewArgs {
    /// Name of the plant; the model is NAME.dls: a flowering herb, or a fern if the name says so
    pub name: PathBuf,
}

/// Writes the model, unless the file exists.
pub fn new(args: &NewArgs) -> Result<(), Failure> {
    let path = if args.name.extension().is_some_and(|e| e == "dls") {
        args.name.clone()
    } else {
        let mut name = args.name.clone().into_os_string();
        name.push(".dls");
        PathBuf::from(name)
    };
    let stem = path.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned());
    if stem.is_empty() || stem == ".dls" || args.name.as_os_str().to_string_lossy().ends_with(['/', '\\']) {
        return Err(Failure::Usage(format!(
            "error: `{}` is no name for a model\n\n  = help: give it one, such as `dlsys new fern`\n",
            args.name.display()
        )));
    }
    let written = fs::File::create_new(&path).and_then(|mut file| file.write_all(text(&stem).as_bytes()));
    written.map_err(|error| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let help = match error.kind() {
            ErrorKind::AlreadyExists => {
                return Failure::Usage(format!(
                    "error: {} is there already and is not overwritten\n\n  = help: choose another name, or begin from that: \
                     `dlsys render {0} -o frames`\n",
                    path.display()
                ));
            }
            ErrorKind::NotFound => format!("make the folder first: `mkdir -p {}`", folder.display()),
            _ => format!("check the rights to {}", folder.display()),
        };
        Failure::Model(format!("error: cannot write {}: {error}\n\n  = help: {help}\n", path.display()))
    })?;
    let (file, frames) = (typed(&path), path.with_extension(""));
    let (page, folder, frames) = (path.with_extension("html"), frames.display(), typed(&frames));
    let next = [
        (format!("view {file} -o {}", typed(&page)), "a page that plays it: open it in a browser".to_owned()),
        (
            format!("render {file} -o {frames} --format png"),
            format!("pictures of all its frames, up to {folder}/frame-0160.png"),
        ),
        (
            format!("render {file} -o {frames} --watch"),
            "draws it again whenever you save the model".to_owned(),
        ),
        (format!("check {file}"), "says what is wrong with it".to_owned()),
    ];
    let width = next.iter().map(|(command, _)| command.chars().count()).max().unwrap_or(0);
    let mut text = format!("{} is written. What to do with it:\n", path.display());
    for (command, what) in &next {
        text += &format!("  dlsys {command:width$}  {what}\n");
    }
    std::io::stdout().write_all(text.as_bytes()).map_err(out_error)
}

/// A name, quoted for a shell if necessary.
fn typed(path: &Path) -> String {
    let name = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "._-/\\:~".contains(c);
    if name.chars().all(plain) { name } else { format!("'{}'", name.replace('\'', "'\\''")) }
}

/// The text of the model, without characters of the name that a title cannot have.
fn text(name: &str) -> String {
    let name: String = name.chars().filter(|c| *c != '"' && !c.is_control()).collect();
    let model = if name.to_lowercase().contains(FERN.0) { FERN.1 } else { START };
    model.replace("NAME", &name)
}

#[cfg(test)]
mod tests {
    use crate::diagnostic::Source;
    use crate::session::Session;
    use crate::syntax::format::format;

    #[test]
    fn the_models_are_good_and_tidy() {
        for (name, title, first) in [("a \"rose\"\n", "a rose", "Foot"), ("Tree fern", "Tree fern", "Frond")]
        {
            let text = super::text(name);
            let session = Session::from_text("new.dls", &text, &[]).expect("a good model");
            assert!(session.warnings.is_empty(), "{:?}", session.warnings);
            assert_eq!(session.model.title.as_deref(), Some(title));
            assert!(text.contains(&format!("{first}(")), "{title}");
            assert_eq!(format(&Source::new("new.dls", &*text)).expect("good"), text);
            assert_eq!(session.model.frames.expect("frames").times().count(), 161);
            assert!(text.lines().count() < 40);
        }
    }
}
