//! Parsers of command-line values, with their error messages.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::compile::Setting;
use crate::film;
use crate::interchange;
use crate::render::{Camera, Format, Layout, Page};
use crate::scene::{Color, Point, Vector, Viewpoint};
use crate::sim::{BendMethod, GroundRule, Method, brief};
use crate::study::Thresholds;

/// A format for frames.
pub(super) fn frame_format() -> impl TypedValueParser<Value = Format> {
    let values = Format::all().map(|format| PossibleValue::new(format.extension()).help(format.about()));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<Format>())
}

/// A format of `render`: of frames, or of the whole animation in one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderFormat {
    /// A file for each frame.
    Frames(Format),
    /// One file of a plant that grows in space.
    Growth(interchange::Format),
    /// One file of pictures.
    Film(film::Format),
    /// One SVG document that plays by itself.
    Moving,
}

impl Default for RenderFormat {
    fn default() -> RenderFormat {
        RenderFormat::Frames(Format::SVG)
    }
}

impl RenderFormat {
    /// The format of this name, which is also the ending of its files.
    pub(super) fn named(name: &str) -> Option<RenderFormat> {
        match name {
            ANIMATED_SVG => Some(RenderFormat::Moving),
            "glb" => Some(RenderFormat::Growth(interchange::Format::Glb)),
            "usda" => Some(RenderFormat::Growth(interchange::Format::Usda)),
            name => match film::Format::ALL.into_iter().find(|film| film.extension() == name) {
                Some(film) => Some(RenderFormat::Film(film)),
                None => name.parse::<Format>().ok().map(RenderFormat::Frames),
            },
        }
    }
}

/// The name of the format of one SVG document that plays by itself.
pub const ANIMATED_SVG: &str = "asvg";

/// A format for frames or for a whole animation.
pub(super) fn render_format() -> impl TypedValueParser<Value = RenderFormat> {
    let frames = Format::all().map(|format| PossibleValue::new(format.extension()).help(format.about()));
    let glb = PossibleValue::new("glb").help("One animated file, glTF 2.0: see --format glb of `dlsys run`");
    let usda =
        PossibleValue::new("usda").help("One animated file, USD in text: see --format usda of `dlsys run`");
    let films = film::Format::ALL.map(|film| PossibleValue::new(film.extension()).help(film.about()));
    let moving = PossibleValue::new(ANIMATED_SVG)
        .help("A film in one file: animated SVG, sharp at any size; browsers play it in <img>");
    PossibleValuesParser::new(frames.chain([glb, usda]).chain(films).chain([moving]))
        .try_map(|name| RenderFormat::named(&name).ok_or("no format"))
}

pub(super) fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(match text.trim().replacen(',', ".", 1) {
            point if text.contains(',') && point.parse::<f64>().is_ok() => {
                format!("not a number; the decimal sign is a point: {point}")
            }
            _ => "not a number".to_owned(),
        }),
    }
}

/// A whole number, which may be written as 1e12.
pub(super) fn events(text: &str) -> Result<u64, String> {
    match number(text)? {
        n if n >= 1.0 && n.fract() == 0.0 => Ok(n as u64),
        _ => Err("must be a whole number from 1".to_owned()),
    }
}

/// A number of bytes with its unit: 500MB, 2GB.
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" | "k" => 1e3,
        "mb" | "m" => 1e6,
        "gb" | "g" => 1e9,
        "tb" | "t" => 1e12,
        _ => return Err("expected a number of bytes, such as 500MB or 2GB".to_owned()),
    };
    match number(digits).map_err(|_| "expected a number of bytes, such as 500MB or 2GB")? * unit {
        n if n >= 1.0 => Ok(n as u64),
        _ => Err("must be at least one byte".to_owned()),
    }
}

pub(super) fn time(text: &str) -> Result<f64, String> {
    match number(text)? {
        t if t >= 0.0 => Ok(t),
        _ => Err("time begins at 0".to_owned()),
    }
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    match number(text)? {
        x if x > 0.0 => Ok(x),
        _ => Err("must be greater than 0".to_owned()),
    }
}

pub(super) fn tolerance(text: &str) -> Result<f64, String> {
    match number(text)? {
        x if (1e-13..=0.1).contains(&x) => Ok(x),
        _ => Err("must be between 1e-13 and 0.1".to_owned()),
    }
}

/// The colours of the sky at the zenith and at the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sky(pub [Color; 2]);

pub(super) fn sky(text: &str) -> Result<Sky, String> {
    let colors: Vec<Option<Color>> = text
        .split(',')
        .map(|color| background(color.trim()).ok().and_then(|Background(color)| color))
        .collect();
    match colors[..] {
        [Some(zenith), Some(horizon)] => Ok(Sky([zenith, horizon])),
        _ => Err("expected two colours, of the zenith and of the horizon, like \"#6fa3e0,#e8f0f8\" (in quotes: the shell takes # for a comment)".to_owned()),
    }
}

/// The height of a floor, and its colour if it is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground(pub f64, pub Option<Color>);

pub(super) fn ground(text: &str) -> Result<Ground, String> {
    let (height, color) = text.split_once(',').map_or((text, None), |(height, color)| (height, Some(color)));
    let height = height.trim().parse().ok().filter(|height: &f64| height.is_finite());
    let color = color.map(|color| background(color.trim()).ok().and_then(|Background(color)| color));
    match (height, color) {
        (Some(height), None) => Ok(Ground(height, None)),
        (Some(height), Some(Some(color))) => Ok(Ground(height, Some(color))),
        _ => Err("expected a height, like 0, or a height and a colour, like \"0,#9aa35f\"".to_owned()),
    }
}

/// Three finite numbers with commas between them.
fn triple(text: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> = text.split(',').map(|x| x.trim().parse().ok()).collect::<Option<_>>()?;
    <[f64; 3]>::try_from(numbers).ok().filter(|numbers| numbers.iter().all(|x| x.is_finite()))
}

pub(super) fn direction(text: &str) -> Result<Vector, String> {
    let direction = triple(text).map(Vector::from).filter(|direction| direction.norm() > 0.0);
    direction.ok_or_else(|| "expected a direction, three numbers like 1,2,1, not all 0".to_owned())
}

pub(super) fn camera(text: &str) -> Result<Viewpoint, String> {
    /// Angle of view, in degrees.
    const ANGLE: f64 = 40.0;
    let expected = "expected eye/aim or eye/aim/angle, like 4,2,6/0,1,0 or 4,2,6/0,1,0/35";
    let parts: Vec<&str> = text.split('/').collect();
    let (eye, aim, angle) = match parts[..] {
        [eye, aim] => (eye, aim, ANGLE),
        [eye, aim, angle] => (eye, aim, field_of_view(angle.trim())?),
        _ => return Err(expected.to_owned()),
    };
    let (Some(eye), Some(aim)) = (triple(eye), triple(aim)) else { return Err(expected.to_owned()) };
    if eye == aim {
        return Err("the eye and the point that it looks at must be different".to_owned());
    }
    Ok(Viewpoint { eye: Point::from(eye), aim: Point::from(aim), angle })
}

pub(super) fn zoom(text: &str) -> Result<f64, String> {
    match number(text) {
        Ok(zoom) if (1e-3..=1e6).contains(&zoom) => Ok(zoom),
        _ => Err("expected a number from 0.001 to 1000000".to_owned()),
    }
}

/// The background of pictures; `None` is transparent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Background(pub Option<Color>);

pub(super) fn background(text: &str) -> Result<Background, String> {
    if text == "none" {
        return Ok(Background(None));
    }
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6);
    let rgb = digits.filter(|d| d.bytes().all(|b| b.is_ascii_hexdigit())).map(|d| u32::from_str_radix(d, 16));
    match rgb {
        Some(Ok(rgb)) => Ok(Background(Some(Color::hex(rgb)))),
        _ => {
            Err("expected none or a colour like #ffffff (in quotes: the shell takes # for a comment)"
                .to_owned())
        }
    }
}

/// The width of all lines of pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineWidth {
    /// Pixels of the page.
    Pixels(f64),
    /// Units of the model.
    Units(f64),
}

pub(super) fn line_width(text: &str) -> Result<LineWidth, String> {
    let wanted =
        || "expected pixels of the page, such as 1px, or a length of the model, such as 0.05".to_owned();
    let (number, in_pixels) = text.strip_suffix("px").map_or((text, false), |number| (number, true));
    match number.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => {
            Ok(if in_pixels { LineWidth::Pixels(x) } else { LineWidth::Units(x) })
        }
        Ok(_) => Err("must be greater than 0".to_owned()),
        Err(_) => Err(wanted()),
    }
}

pub(super) fn field_of_view(text: &str) -> Result<f64, String> {
    match number(text)? {
        x if Camera::FIELDS.contains(&x) => Ok(x),
        _ => Err(format!("must be between {} and {} degrees", Camera::FIELDS.start(), Camera::FIELDS.end())),
    }
}

pub(super) fn turn(text: &str) -> Result<f64, String> {
    /// A hundred turns.
    const MOST: f64 = 36_000.0;
    match number(text)? {
        x if x.abs() <= MOST => Ok(x),
        _ => Err(format!("must be between -{MOST} and {MOST} degrees; a full turn has 360")),
    }
}

/// How long the shutter is open, in frames: as Blender has it, or as an angle.
pub(super) fn shutter(text: &str) -> Result<f64, String> {
    let angle = ["deg", "°"].iter().find_map(|unit| text.strip_suffix(unit));
    let (open, whole) = match angle {
        Some(angle) => (number(angle.trim_end())?, 360.0),
        None => (number(text)?, 1.0),
    };
    match open {
        x if (0.0..=whole).contains(&x) => Ok(x / whole),
        x if angle.is_none() && (2.0..=360.0).contains(&x) => Err(format!(
            "is in frames, from 0 to 1; {x} degrees of 360 are {} of a frame, or `{x}deg`",
            brief(x / 360.0, 4)
        )),
        _ => {
            Err("must be from 0 to 1 frame, or from 0deg to 360deg: the shutter opens once a frame"
                .to_owned())
        }
    }
}

pub(super) fn layout(text: &str) -> Result<Layout, String> {
    let names: Vec<&str> = Layout::NAMED.iter().map(|(name, _)| *name).collect();
    let found = Layout::NAMED.iter().find(|(name, _)| *name == text);
    found.map(|(_, layout)| *layout).ok_or_else(|| format!("layouts are {}", names.join(", ")))
}

pub(super) fn columns(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if n >= 1 => Ok(n),
        _ => Err("must be a number from 1".to_owned()),
    }
}

pub(super) fn threads(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if (1..=256).contains(&n) => Ok(n),
        _ => Err("must be between 1 and 256".to_owned()),
    }
}

pub(super) fn pixels(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(n) if (1..=Page::MOST_ON_A_SIDE).contains(&n) => Ok(n),
        _ => Err(format!("must be between 1 and {} pixels", Page::MOST_ON_A_SIDE)),
    }
}

pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').ok_or("expected WIDTHxHEIGHT, such as 1280x720")?;
    Ok((pixels(width)?, pixels(height)?))
}

pub(super) fn figure(text: &str) -> Result<u8, String> {
    text.parse()
        .map_err(|_| "expected the number of a figure of the paper, such as 6; --list shows them".to_owned())
}

/// Seeds from one to another, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seeds {
    pub first: u64,
    pub last: u64,
}

impl Seeds {
    pub fn count(self) -> usize {
        (self.last - self.first) as usize + 1
    }

    pub fn iter(self) -> impl Iterator<Item = u64> {
        self.first..=self.last
    }
}

pub(super) fn seeds(text: &str) -> Result<Seeds, String> {
    const MOST: u64 = 10_000_000;
    let wanted = "expected FIRST..LAST, such as 0..99";
    let (first, last) = text.split_once("..").ok_or(wanted)?;
    let number =
        |text: &str| text.trim().trim_start_matches('=').parse::<u64>().map_err(|_| wanted.to_owned());
    let (first, last) = (number(first)?, number(last)?);
    match last.checked_sub(first) {
        None => Err(format!("{last} is before {first}")),
        Some(more) if more >= MOST => Err(format!("more than {MOST} specimens")),
        Some(_) => Ok(Seeds { first, last }),
    }
}

pub(super) fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("expected a whole number from 0 to {}", u64::MAX))
}

pub(super) fn runs(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if (1..=1000).contains(&n) => Ok(n),
        _ => Err("must be between 1 and 1000".to_owned()),
    }
}

pub(super) fn setting(text: &str) -> Result<Setting, String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    Ok(Setting { name: name.trim().to_owned(), value: number(value)? })
}

/// A name with a number that is greater than 0.
fn named(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    Ok((name.trim().to_owned(), positive(value)?))
}

/// The mass of the solids of a name, in kg.
pub(super) fn mass(text: &str) -> Result<(String, f64), String> {
    named(text)
}

/// A limit of the decision of `report --coupling`.
pub(super) fn limit(text: &str) -> Result<(String, f64), String> {
    let (name, value) = named(text)?;
    match Thresholds::NAMES.contains(&&*name) {
        true => Ok((name, value)),
        false => Err(format!("limits are {}", Thresholds::NAMES.join(", "))),
    }
}

pub(super) fn method(text: &str) -> Result<Method, String> {
    let names: Vec<&str> = Method::NAMED.iter().map(|(name, _)| *name).collect();
    let found = Method::NAMED.iter().find(|(name, _)| *name == text);
    found.map(|(_, method)| *method).ok_or_else(|| format!("methods are {}", names.join(", ")))
}

pub(super) fn bend_method(text: &str) -> Result<BendMethod, String> {
    let found = BendMethod::NAMED.iter().find(|(name, _)| *name == text);
    found.map(|(_, method)| *method).ok_or_else(|| {
        let names: Vec<&str> = BendMethod::NAMED.iter().map(|(name, _)| *name).collect();
        format!("methods of bending are {}", names.join(", "))
    })
}

pub(super) fn ground_rule(text: &str) -> Result<GroundRule, String> {
    let found = GroundRule::NAMED.iter().find(|(name, _)| *name == text);
    found.map(|(_, rule)| *rule).ok_or_else(|| {
        let names: Vec<&str> = GroundRule::NAMED.iter().map(|(name, _)| *name).collect();
        format!("rules of soil are {}", names.join(", "))
    })
}

/// Smallest tolerance of bending: below it, rounding is what remains of the error of a step.
const FINEST_BEND: f64 = 1e-9;

/// Largest error in pixels of plants that move by modes.
pub(super) fn bend_pixels(text: &str) -> Result<f64, String> {
    match number(text)? {
        x if (0.0..=100.0).contains(&x) => Ok(x),
        _ => Err("must be between 0 and 100".to_owned()),
    }
}

pub(super) fn bend_tolerance(text: &str) -> Result<f64, String> {
    match number(text)? {
        x if (FINEST_BEND..=0.1).contains(&x) => Ok(x),
        _ => Err(format!("must be between {FINEST_BEND:e} and 0.1")),
    }
}
