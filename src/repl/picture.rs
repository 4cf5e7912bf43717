//! `draw`: the plant on the terminal.

use super::braille::Sheet;
use super::commands;
use super::loaded::{LoadedModel, misused};
use super::state::{CommandError, SessionState};
use crate::render::{Fit, Page, Size, Survey, View, pixels};
use crate::scene::Scene;
use crate::session::Nursery;

/// Coverage (of 255) from which a dot is set; stems may be thinner than a dot.
const COVERED: u8 = 48;

impl LoadedModel<'_> {
    /// The drawing at present.
    pub fn scene(&mut self, state: &SessionState) -> Result<Scene, CommandError> {
        let nursery = Nursery::new(&self.session.model, state.settings);
        let mut scene = nursery.blank();
        nursery
            .draw(self.string(state)?, &mut scene)
            .map_err(|error| CommandError::Message(error.diagnostic().render(&self.session.source, false)))?;
        Ok(scene)
    }

    /// `draw [VIEW] [blocks]`
    pub fn draw(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let (mut view, mut blocks) = (View::FRONT, false);
        for word in rest {
            if word == "blocks" {
                blocks = true;
                continue;
            }
            view = word.parse().map_err(|error: crate::render::Error| {
                CommandError::new(format!("{error}\n  it is used as `draw {}`", usage()))
            })?;
        }
        if rest.len() > 2 {
            return Err(misused("draw"));
        }
        let scene = self.scene(state)?;
        for warning in &scene.warnings {
            state.complain(&warning.render(&self.session.source, false));
        }
        let mut survey = Survey::new(view);
        survey.add(&scene);
        let mut fit = survey.fit();
        if scene.is_empty() || fit.bounds.is_none() {
            return state.say(
                "there is nothing to be seen: the turtle draws F, surfaces such as @L, and what `interpret` says\n",
            );
        }
        let [columns, rows] = [state.screen.columns - 2, state.screen.rows - 3];
        let picture = fit.picture;
        let [_, _, width, height] = picture.area;
        // Pixels are square: a character holds two by four dots, or one by two blocks.
        let cell = if blocks { [1, 2] } else { [2, 4] };
        let most = [columns * cell[0], rows * cell[1]].map(|n| n as f64);
        let scale = (most[0] / width).min(most[1] / height);
        let side = |length: f64, most: f64| (length * scale).round().clamp(2.0, most) as u32;
        let size = Size::Exact(side(width, most[0]), side(height, most[1]));
        let page = Page::new(picture, size, None).map_err(CommandError::new)?;
        // Lines of default width are a dot wide; thinner ones would be broken.
        fit.default_width = 1.4 / scale;
        let lines = match blocks {
            true => half_blocks(&scene, &fit, &page, state.screen.coloured),
            false => dots(&scene, &fit, &page, state.screen.coloured),
        };
        let empty = |line: &&String| line.trim().is_empty();
        let first = lines.iter().take_while(empty).count();
        let last = lines.iter().rposition(|line| !line.trim().is_empty()).map_or(0, |at| at + 1);
        let mut out = String::new();
        for line in lines.get(first..last).unwrap_or_default() {
            out += line;
            out.push('\n');
        }
        if out.is_empty() {
            out += "too small to be seen\n";
        }
        state.say(&out)
    }
}

fn usage() -> &'static str {
    commands::find("draw").map_or("", |command| command.usage)
}

/// The colour of a pixel with premultiplied alpha.
fn colour([r, g, b, a]: [u8; 4]) -> [u8; 3] {
    [r, g, b].map(|c| (u32::from(c) * 255 / u32::from(a.max(1))).min(255) as u8)
}

fn dots(scene: &Scene, fit: &Fit, page: &Page, coloured: bool) -> Vec<String> {
    let [width, height] = page.pixels.map(|side| side as usize);
    let mut sheet = Sheet::new(width.div_ceil(2), height.div_ceil(4));
    for (i, pixel) in pixels(scene, fit, page).into_iter().enumerate() {
        if pixel[3] >= COVERED {
            sheet.dot(i % width, i / width, Some(colour(pixel)));
        }
    }
    sheet.rows(coloured)
}

fn half_blocks(scene: &Scene, fit: &Fit, page: &Page, coloured: bool) -> Vec<String> {
    let [width, height] = page.pixels.map(|side| side as usize);
    let all = pixels(scene, fit, page);
    let at =
        |x: usize, y: usize| all.get(y * width + x).copied().filter(|p| y < height && p[3] >= 2 * COVERED);
    let mut lines = Vec::new();
    for y in (0..height).step_by(2) {
        let mut line = String::new();
        for x in 0..width {
            let ink = |code: u8, pixel: [u8; 4]| {
                let [r, g, b] = colour(pixel);
                if coloured { format!("\x1b[{code};2;{r};{g};{b}m") } else { String::new() }
            };
            let end = if coloured { "\x1b[0m" } else { "" };
            line += &match (at(x, y), at(x, y + 1)) {
                (None, None) => " ".to_owned(),
                (Some(up), None) => format!("{}▀{end}", ink(38, up)),
                (None, Some(down)) => format!("{}▄{end}", ink(38, down)),
                (Some(up), Some(down)) if coloured => format!("{}{}▀{end}", ink(38, up), ink(48, down)),
                (Some(_), Some(_)) => "█".to_owned(),
            };
        }
        lines.push(line.trim_end().to_owned());
    }
    lines
}
