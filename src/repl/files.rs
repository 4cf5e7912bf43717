//! Commands that write files: `save` and `export`. Files are complete or absent, and files of others are not overwritten.

use std::path::{Path, PathBuf};

use super::loaded::{LoadedModel, misused};
use super::state::{CommandError, SessionState};
use crate::cli::run::Printer;
use crate::render::{self, Format, FrameWriter, Page, Size, Survey, View};
use crate::sim::brief;

/// Refuses to overwrite a file that this session has not written.
fn spare(path: &Path, force: bool, state: &SessionState) -> Result<(), CommandError> {
    if path.exists() && !force && !state.written.contains(&real(path)) {
        let path = path.display();
        return Err(CommandError::new(format!(
            "{path} is there already; another name, or `--force` after it to replace it"
        )));
    }
    Ok(())
}

/// The canonical path of a file.
fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Writes a file, whole or not at all.
fn write(path: &Path, bytes: &[u8], state: &mut SessionState) -> Result<(), CommandError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return Err(CommandError::new(format!("{} is no name for a file", path.display())));
    };
    render::replace(folder, name, bytes).map_err(CommandError::new)?;
    state.written.insert(real(path));
    Ok(())
}

/// Removes a flag without a value from the words; true if it was there.
fn flag(words: &mut Vec<String>, name: &str) -> bool {
    let before = words.len();
    words.retain(|word| word != name);
    words.len() < before
}

/// Removes a flag with its value from the words.
fn value(words: &mut Vec<String>, name: &str) -> Result<Option<String>, CommandError> {
    let Some(at) = words.iter().position(|word| word == name) else { return Ok(None) };
    words.remove(at);
    if at >= words.len() {
        return Err(CommandError::new(format!("{name} needs a value after it")));
    }
    Ok(Some(words.remove(at)))
}

impl LoadedModel<'_> {
    /// `save [FILE] [--force]`
    pub fn save(&mut self, rest: &[String], state: &mut SessionState) -> Result<(), CommandError> {
        let mut words = rest.to_vec();
        let force = flag(&mut words, "--force");
        let path = match &words[..] {
            [] => match state.draft.path.clone() {
                Some(path) => path,
                None => {
                    return Err(CommandError::new(
                        "this model has no file yet: `save NAME.dls` gives it one",
                    ));
                }
            },
            [name] => PathBuf::from(name),
            _ => return Err(misused("save")),
        };
        if state.draft.text.trim().is_empty() {
            return Err(CommandError::new("there is nothing to save yet"));
        }
        let own = state.draft.path.as_ref().is_some_and(|known| real(known) == real(&path));
        if !own {
            spare(&path, force, state)?;
        } else if !force && state.draft.was_changed_elsewhere(&path) {
            return Err(CommandError::new(format!(
                "{} was changed by somebody else since it was read: `reload` takes what is there, `save NAME.dls` another name, `save --force` writes over it",
                path.display()
            )));
        }
        let text = state.draft.text.clone();
        write(&path, text.as_bytes(), state)?;
        state.draft.set_saved(&path);
        let lines = text.lines().count();
        let noun = if lines == 1 { "line" } else { "lines" };
        state.say(&format!("{}: {lines} {noun}\n", path.display()))?;
        if !state.set.is_empty() {
            let set: Vec<String> = state.set.iter().map(|s| format!("{} = {}", s.name, s.value)).collect();
            state.say(&format!("  not in the file: what was set, {}\n", set.join(", ")))?;
        }
        Ok(())
    }

    /// `export FILE [--view V] [--perspective D] [--width N] [--force]`
    pub fn export(&mut self, rest: &[String], state: &mut SessionState) -> Result<(), CommandError> {
        let mut words = rest.to_vec();
        let force = flag(&mut words, "--force");
        let number = |text: Option<String>, what: &str, range: std::ops::RangeInclusive<f64>| match text {
            None => Ok(None),
            Some(text) => match text.parse::<f64>().ok().filter(|x| range.contains(x)) {
                Some(x) => Ok(Some(x)),
                None => Err(CommandError::new(format!(
                    "{what} is a number from {} to {}, not `{text}`",
                    range.start(),
                    range.end()
                ))),
            },
        };
        let view = match value(&mut words, "--view")? {
            Some(text) => text.parse().map_err(|error: render::Error| CommandError::new(error))?,
            None => View::FRONT,
        };
        let perspective =
            number(value(&mut words, "--perspective")?, "--perspective", render::Camera::FIELDS)?;
        let side = f64::from(Page::MOST_ON_A_SIDE);
        let width = number(value(&mut words, "--width")?, "--width", 1.0..=side)?;
        let [name] = &words[..] else { return Err(misused("export")) };
        let path = PathBuf::from(name);
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
        self.replay()?;
        let (bytes, companions) = match extension.as_str() {
            "json" | "txt" => {
                let printer = Printer::new(&self.session.model);
                let string = self.string(state)?;
                let mut text = String::new();
                match extension.as_str() {
                    "json" => printer.json(string, &mut text),
                    _ => printer.text(string, &mut text),
                }
                (text.into_bytes(), Vec::new())
            }
            other => {
                let format: Format = other.parse().map_err(|_| {
                    CommandError::new(format!(
                        "the name tells the format: .svg, .png, .obj, .json or .txt, but `{}` has {}; `render -o DIR` writes all frames",
                        path.display(),
                        if extension.is_empty() { "none".to_owned() } else { format!("`.{extension}`") }
                    ))
                })?;
                let scene = self.scene(state)?;
                let mut survey = Survey::new(view);
                if let Some(field) = perspective {
                    survey = survey.with_perspective(field);
                }
                survey.add(&scene);
                let mut writer = FrameWriter::new(format, survey.fit());
                if let Some(width) = width {
                    let size = Size::Width(width as u32);
                    writer.page = Page::new(writer.page.picture, size, Some(Page::BACKGROUND))
                        .map_err(CommandError::new)?;
                }
                let model = &self.session.model;
                let name = model.title.as_deref().unwrap_or(&self.session.source.name);
                let title = format!("{name}, t = {}", brief(self.time().unwrap_or(0.0), 9));
                (writer.write(&scene, &title), writer.companions(&scene))
            }
        };
        let beside = |name: &str| path.with_file_name(name);
        spare(&path, force, state)?;
        for companion in &companions {
            spare(&beside(&companion.name), force, state)?;
        }
        for companion in &companions {
            write(&beside(&companion.name), &companion.bytes, state)?;
        }
        write(&path, &bytes, state)?;
        let names: Vec<&str> = companions.iter().map(|companion| &*companion.name).collect();
        let with = if names.is_empty() { String::new() } else { format!(", with {}", names.join(", ")) };
        state.say(&format!("{}: {} bytes{with}\n", path.display(), bytes.len()))
    }
}
