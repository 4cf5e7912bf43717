//! `dlsys gallery`: the paper's figures that show development, each from its model.
//!
//! ```text
//! figures (figure, model, flags) ──arguments of──▶ render ──▶ DIR/figure-06-a/overlay.svg … ──▶ DIR/index.html
//! ```
//!
//! Every picture is made by a `dlsys render` command. The models are part of the program and are written to `DIR/models`,
//! so that users can repeat the commands.

mod figures;
mod page;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Parser;

use super::args::{Action, Command, GalleryArgs, RenderArgs};
use super::common::{Failure, out_error};
use super::one_file::refuse_stream;
use super::output;
use super::progress::Progress;
use super::render::render;
use super::values::RenderFormat;
use crate::render::Content;
use figures::{FIGURES, Picture, models};

/// Renders the selected figures, or lists them.
pub fn gallery(args: &GalleryArgs) -> Result<(), Failure> {
    let known: Vec<String> = figures::numbers().iter().map(u8::to_string).collect();
    if let Some(number) = args.figures.iter().find(|n| !figures::numbers().contains(n)) {
        return Err(Failure::Usage(format!(
            "error: the gallery has no figure {number}\n\n  = help: it has {}\n",
            known.join(", ")
        )));
    }
    if args.format.content() == Content::Mesh {
        return Err(Failure::Usage(
            "error: the gallery is made of pictures: svg or png; for meshes type one of its lines (`--list`) with `--format obj`\n"
                .to_owned(),
        ));
    }
    let wanted: Vec<&Picture> =
        FIGURES.iter().filter(|p| args.figures.is_empty() || args.figures.contains(&p.figure)).collect();
    match &args.out {
        Some(out) if !args.list => draw(&wanted, out, args),
        _ => wanted.iter().try_for_each(|p| say(&format!("figure {:2}  {}\n", p.figure, p.line()))),
    }
}

fn draw(wanted: &[&Picture], out: &Path, args: &GalleryArgs) -> Result<(), Failure> {
    refuse_stream(out, "name a folder: `-o gallery`")?;
    let folder = out.join("models");
    spare(out, &folder)?;
    make(&folder)?;
    for (name, text) in models() {
        output::write(&folder.join(name), text)?;
    }
    let mut drawn = Vec::new();
    let mut progress = Progress::of_printed("pictures", wanted.len());
    for picture in wanted {
        let target = out.join(picture.name);
        render(&typed(picture, out, &target, args)?)?;
        let file = picture.file(args.format);
        say(&format!("figure {:2}  {}\n", picture.figure, target.join(&file).display()))?;
        drawn.push((*picture, file));
        progress.inc();
    }
    let index = out.join("index.html");
    output::write(&index, &page::page(&drawn))?;
    say(&format!("all        {}\n", index.display()))
}

/// Refuses to overwrite files that are not of a gallery.
fn spare(out: &Path, folder: &Path) -> Result<(), Failure> {
    let foreign = |path: &Path, ours: &dyn Fn(&str) -> bool| match std::fs::read(path) {
        Ok(bytes) => !std::str::from_utf8(&bytes).is_ok_and(ours),
        Err(error) => error.kind() != std::io::ErrorKind::NotFound,
    };
    let index = out.join("index.html");
    let models = models();
    let models = models.iter().map(|(name, text)| (folder.join(name), *text));
    let changed = models.filter(|(path, text)| foreign(path, &|found| found == *text)).map(|(path, _)| path);
    let page = Some(index).filter(|index| foreign(index, &|found| found.contains(page::MARK)));
    match changed.chain(page).next() {
        Some(path) => Err(Failure::Usage(format!(
            "error: {} is not of an earlier gallery and is not overwritten; choose another directory\n",
            path.display()
        ))),
        None => Ok(()),
    }
}

/// The parsed command of a picture.
fn typed(picture: &Picture, out: &Path, target: &Path, args: &GalleryArgs) -> Result<RenderArgs, Failure> {
    let words = ["dlsys", "render", "-o", ".", picture.model].into_iter().chain(picture.flags.split(' '));
    let typed = Command::try_parse_from(words).map_err(|error| Failure::Usage(error.to_string()))?;
    let Action::Render(mut typed) = typed.action else {
        return Err(Failure::Usage("error: the command of a picture is not `render`\n".to_owned()));
    };
    typed.shared.model = out.join(picture.model);
    typed.out = target.to_owned();
    typed.format = RenderFormat::Frames(args.format);
    // The gallery prints its own summary.
    typed.quiet = true;
    Ok(*typed)
}

fn say(text: &str) -> Result<(), Failure> {
    std::io::stdout().write_all(text.as_bytes()).map_err(out_error)
}

fn make(folder: &PathBuf) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::Model(format!("error: cannot make {}: {error}\n", folder.display())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Format;

    #[test]
    fn every_line_can_be_typed() {
        let args = GalleryArgs { out: None, figures: Vec::new(), format: Format::SVG, list: false };
        for picture in FIGURES {
            let typed = typed(picture, Path::new("there"), Path::new("here"), &args);
            let typed = typed.unwrap_or_else(|error| panic!("{}: {error:?}", picture.name));
            assert_eq!(typed.shared.model, Path::new("there").join(picture.model));
            assert!(models().iter().any(|(name, _)| picture.model == format!("models/{name}")));
        }
    }

    #[test]
    fn every_figure_that_shows_development_is_there() {
        assert_eq!(figures::numbers(), [6, 7, 9, 10, 11, 12, 13, 14, 15, 17]);
    }
}
