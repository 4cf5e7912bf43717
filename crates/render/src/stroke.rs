//! Stems as SVG strokes: plain where they are thin or the drawing is flat, else with a gradient across, as light falls on a
//! cylinder.
//!
//! The colours across a stem depend on its direction and depth only, so they are shared by all stems of about the same; their
//! position is given by a small gradient of each stem. A stem that is cut in two looks like a whole one.

use std::fmt::Write;

use super::lighting::Lighting;
use super::number;
use super::painter::{DECIMALS, SHADES, Style, text};
use super::tube::{can_join, stands};
use dlsys_geometry::scene::{Color, Point, Scene, Segment};
use rustc_hash::FxHashMap;

/// Stems thinner than this many pixels of the page have one colour.
const HAIR: f64 = 0.8;
/// Stems thinner than this many pixels of the page have half as many shades.
const NARROW: f64 = 6.0;
/// Stems thinner than this many pixels of the page are strokes, wherever they are visible, and never regions.
const THIN: f64 = 2.5;
/// Lines thinner than this many pixels of the page are strokes with round ends, whatever they join.
const HAIRLINE: f64 = 1.6;
/// Places across a stem at which its colour is given: its edges are at -1 and 1.
const PLACES: [f64; 5] = [-1.0, -0.55, 0.0, 0.55, 1.0];
/// Least cosine of the angle between two pieces of a straight line.
const STRAIGHT: f64 = 0.999_99;
/// How far a piece of a line reaches under the one that continues it, in pixels of the page: less can be seen as a seam.
const OVERLAP: f64 = 0.7;
/// How much of the next piece a mitred one takes along, in widths.
const STUB: f64 = 0.2;
/// Places that are further apart, in units of the picture, are written as different ones.
const LEAST: f64 = 2e-3;
/// Bytes that the attributes of a stroke take, mostly.
const ROOM: usize = 128;

/// The mean width of a segment, in pixels of the page.
pub(super) fn pixels_across(segment: &Segment, style: Style) -> f64 {
    let Style { fit, pixels, .. } = style;
    let width = |i: usize, p: Point| {
        segment.widths[i].resolve(fit.default_width) * fit.camera.magnification(fit.camera.project(p).z)
    };
    (width(0, segment.start) + width(1, segment.end)) / 2.0 * pixels
}

/// True for a stem that is too thin to be a region of cells, though the scene has depth.
pub(super) fn is_thin(segment: &Segment, style: Style) -> bool {
    pixels_across(segment, style) < THIN
}

/// How a segment is drawn.
pub(super) enum Stroke {
    Element {
        name: &'static str,
        attributes: String,
    },
    /// Of which several can be one path, if their attributes are the same.
    Path {
        attributes: String,
        data: String,
    },
}

impl Stroke {
    /// Its element: name and attributes.
    pub(super) fn element(self) -> (&'static str, String) {
        match self {
            Stroke::Element { name, attributes } => (name, attributes),
            Stroke::Path { attributes, data } => ("path", format!("{attributes} d=\"{data}\"")),
        }
    }
}

/// The shape of an end of a stroke.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum End {
    #[default]
    Round,
    /// Round, in the midst of a stem.
    Joint,
    /// Mitred, where a stem of a flat drawing bends and goes on in this segment, as tubes do.
    Mitre(usize),
    /// Straight, where the stroke continues or something else hides the rest.
    Straight,
    /// Cut aslant by what hides the rest: by place across from the left of one who looks up the picture along the stem, at -0.8, -0.4, 0, 0.4 and 0.8 radii
    /// how far along the stem it is visible from there, or to there, in hundredths of the radius.
    Slant([i32; 5]),
    /// The flat end of a stem that stands there: the outer half of the ellipse as which a disc is seen.
    Foot,
}

/// The stems of a picture.
pub(super) struct Strokes<'a> {
    scene: &'a Scene,
    style: Style<'a>,
    prefix: &'a str,
    /// The light, unless that is the default one.
    lighting: Option<&'a Lighting<'a>>,
    /// Shapes of the ends of each segment.
    ends: Vec<[End; 2]>,
    /// Numbers of colours across, and of gradients.
    profiles: FxHashMap<[Color; PLACES.len()], usize>,
    gradients: FxHashMap<String, usize>,
    definitions: String,
}

impl<'a> Strokes<'a> {
    /// `parted` tells of two segments, by number, if they are separate strokes that must not lie over one another.
    pub(super) fn new(
        scene: &'a Scene,
        style: Style<'a>,
        prefix: &'a str,
        parted: impl Fn(usize, usize) -> bool,
    ) -> Strokes<'a> {
        let mut ends = vec![[End::Round; 2]; scene.segments.len()];
        for (i, segment) in scene.segments.iter().enumerate() {
            let Some(before) = segment.follows else {
                let radius = segment.widths[0].resolve(style.fit.default_width) / 2.0;
                let is_branch = segment.grows_from.is_some();
                if !style.fit.light.is_flat()
                    && !is_branch
                    && stands(segment, radius, scene.surroundings.floor)
                {
                    ends[i][0] = End::Foot;
                }
                continue;
            };
            let previous = &scene.segments[before];
            let is_smooth = is_smooth(previous, segment);
            let bends = !is_smooth && style.fit.light.is_flat();
            let radii = [previous.widths[1], segment.widths[0]];
            let radii = radii.map(|width| width.resolve(style.fit.default_width) / 2.0);
            (ends[before][1], ends[i][0]) = if is_smooth && parted(before, i) {
                (End::Straight, End::Straight)
            } else if bends && can_join(previous, segment, radii) {
                (End::Mitre(i), End::Mitre(before))
            } else {
                (End::Joint, End::Joint)
            };
        }
        Strokes {
            scene,
            style,
            prefix,
            lighting: None,
            ends,
            profiles: FxHashMap::default(),
            gradients: FxHashMap::default(),
            definitions: String::new(),
        }
    }

    /// In this light.
    pub(super) fn lit(self, lighting: &'a Lighting<'a>) -> Strokes<'a> {
        Strokes { lighting: Some(lighting).filter(|lighting| lighting.is_declared()), ..self }
    }

    /// The paint of what is seen of a segment: a colour, or a gradient across it.
    pub(super) fn fill(&mut self, segment: &Segment) -> String {
        let ends = [segment.start, segment.end].map(|p| self.style.project(p));
        let width = pixels_across(segment, self.style) / self.style.pixels * self.style.scale;
        self.paint(segment, ends, width)
    }

    /// The gradients that were used.
    pub(super) fn definitions(&mut self) -> String {
        std::mem::take(&mut self.definitions)
    }

    /// The shapes of a segment's ends.
    pub(super) fn ends(&self, index: usize) -> [End; 2] {
        self.ends[index]
    }

    /// A stroke; a dot if it is seen end on; a filled outline if its ends differ in width or shape. `None` if it has no width.
    pub(super) fn stroke(&mut self, segment: &Segment, ends: [End; 2], as_path: bool) -> Option<Stroke> {
        let Style { fit, scale, pixels, .. } = self.style;
        let [a, b] = [segment.start, segment.end].map(|p| self.style.project(p));
        let width = |i: usize, z: f64| {
            segment.widths[i].resolve(fit.default_width) * scale * fit.camera.magnification(z / scale)
        };
        let (wa, wb) = (width(0, a.z), width(1, b.z));
        let widths = Texts::new([wa, wb]);
        let [from, to] = widths.all();
        if from == "0" && to == "0" {
            return None;
        }
        let paint = self.paint(segment, [a, b], (wa + wb) / 2.0);
        let outline = |data: String| Some(Stroke::Path { attributes: format!(" fill=\"{paint}\""), data });
        let overlap = |from: Point, to: Point| {
            let along = (to - from).xy().normalize() * (OVERLAP * scale / pixels);
            Point::new(to.x + along.x, to.y + along.y, to.z)
        };
        if ends.iter().any(|end| matches!(end, End::Slant(_))) {
            return outline(slanted([a, b], [wa / 2.0, wb / 2.0], ends));
        }
        // A hairline is round at both ends: that reaches less than a pixel further than a cut, under what continues it.
        let is_hairline = from == to && wa * pixels < HAIRLINE * scale;
        let cuts = [0, 1].map(|k| self.cut(segment, k, ends[k]).filter(|_| !is_hairline));
        let end_of_outline = || if ends[1] == End::Straight { overlap(a, b) } else { b };
        if from != to {
            return outline(tapered([a, end_of_outline()], [wa / 2.0, wb / 2.0], cuts));
        }
        // Not every renderer draws the ends of a stroke without length.
        let is_dot = || Texts::new([a.x, a.y]).text == Texts::new([b.x, b.y]).text;
        if (b - a).xy().abs().max() < LEAST && is_dot() {
            let [x, y, r] = [a.x, a.y, wa / 2.0].map(text);
            let attributes = format!(" fill=\"{paint}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\"");
            return Some(Stroke::Element { name: "circle", attributes });
        }
        let mut look = String::with_capacity(ROOM);
        look.extend([" stroke=\"", &paint, "\" stroke-width=\"", from, "\""]);
        if ends.iter().any(|end| matches!(end, End::Mitre(_))) {
            let data = self.mitred(ends, [a, end_of_outline()], wa);
            let has_cap = |end| matches!(end, End::Round | End::Joint);
            let cap = if ends.into_iter().any(has_cap) { "" } else { " stroke-linecap=\"butt\"" };
            let attributes = [" fill=\"none\"", &look, " stroke-linejoin=\"miter\"", cap].concat();
            return Some(Stroke::Path { attributes, data });
        }
        let mut end = b;
        match cuts {
            [None, None] => {}
            [Some(cut), None] => return outline(half_round([a, b], wa / 2.0, cut)),
            [None, Some(cut)] => return outline(half_round([end_of_outline(), a], wa / 2.0, cut)),
            [Some(first), Some(last)] if first > 0.0 || last > 0.0 => {
                return outline(tapered([a, end_of_outline()], [wa / 2.0; 2], cuts));
            }
            [Some(_), Some(_)] => {
                end = end_of_outline();
                look.push_str(" stroke-linecap=\"butt\"");
            }
        }
        let places = Texts::new([a.x, a.y, end.x, end.y]);
        let [x1, y1, x2, y2] = places.all();
        if as_path {
            return Some(Stroke::Path {
                attributes: look,
                data: ["M", x1, " ", y1, "L", x2, " ", y2].concat(),
            });
        }
        look.extend([" x1=\"", x1, "\" y1=\"", y1, "\" x2=\"", x2, "\" y2=\"", y2, "\""]);
        Some(Stroke::Element { name: "line", attributes: look })
    }

    /// Of an end that is cut: how far the cut reaches along the stroke in the picture. 0 is straight.
    fn cut(&self, segment: &Segment, k: usize, end: End) -> Option<f64> {
        /// Ellipses narrower than this, in pixels of the page, are lines.
        const FLAT: f64 = 0.05;
        if end != End::Foot {
            return (end == End::Straight).then_some(0.0);
        }
        let centre = [segment.start, segment.end][k];
        let radius = segment.widths[k].resolve(self.style.fit.default_width) / 2.0;
        let [from, to, centre_seen] = [segment.start, segment.end, centre].map(|p| self.style.project(p));
        let Some(way) = (to - from).xy().try_normalize(0.0) else { return Some(0.0) };
        let ahead = segment.direction;
        let aside = ahead.cross(&self.style.fit.camera.towards(centre)).try_normalize(1e-9);
        let Some(aside) = aside else { return Some(0.0) };
        let rim = [aside, ahead.cross(&aside)];
        let reach = rim.map(|to| (self.style.project(centre + to * radius) - centre_seen).xy().dot(&way));
        let reach = reach[0].hypot(reach[1]);
        Some(if reach * self.style.pixels < FLAT * self.style.scale { 0.0 } else { reach })
    }

    /// The path of a stroke, at mitred ends with a little of the one that goes on there: what joins the two is the corner of both.
    fn mitred(&self, ends: [End; 2], places: [Point; 2], width: f64) -> String {
        let stub = |k: usize| {
            let End::Mitre(other) = ends[k] else { return None };
            let other = &self.scene.segments[other];
            let far = self.style.project(if k == 0 { other.start } else { other.end });
            let way = (far - places[k]).xy();
            let length = way.norm();
            let part = (STUB * width).min(length) / length;
            (length > 0.0).then(|| [places[k].x + part * way.x, places[k].y + part * way.y])
        };
        let [a, b] = places.map(|place| [place.x, place.y]);
        let all = [stub(0), Some(a), Some(b), stub(1)];
        let mut data = String::with_capacity(ROOM);
        for (number, place) in all.iter().flatten().enumerate() {
            push(&mut data, if number == 0 { "M" } else { "L" }, place);
        }
        data
    }

    /// The colour of a stem between two places of the picture, or a reference to its gradient.
    fn paint(&mut self, segment: &Segment, [a, b]: [Point; 2], width: f64) -> String {
        let light = self.style.fit.light;
        let color = self.scene.palette.get(segment.material).color;
        let depth = (a.z + b.z) / 2.0 / self.style.scale;
        let camera = &self.style.fit.camera;
        let middle = nalgebra::center(&segment.start, &segment.end);
        let directions = [segment.direction, camera.towards(middle)].map(|v| camera.direction(v));
        let strengths = match self.lighting {
            None => light.across(directions, depth, PLACES),
            Some(lighting) => {
                let radius = segment.widths.map(|width| width.resolve(self.style.fit.default_width));
                let seen = camera.project(middle);
                lighting.across(directions, (seen, (radius[0] + radius[1]) / 4.0), PLACES)
            }
        };
        // Of narrow stems so few shades that many share their colours.
        let is_narrow = width * self.style.pixels < NARROW * self.style.scale;
        let shades = if is_narrow { SHADES / 2.0 } else { SHADES };
        let lit = |strength: f64| {
            let strength = (strength * shades).round() / shades;
            self.lighting.map_or_else(|| color.lit(strength), |lighting| lighting.color(color, strength))
        };
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let length = dx.hypot(dy);
        if light.is_flat() || width * self.style.pixels < HAIR * self.style.scale || length < 1e-3 * width {
            // The mean over the width, by the trapezoidal rule.
            const SHARES: [f64; PLACES.len()] = [0.1125, 0.25, 0.275, 0.25, 0.1125];
            return lit(strengths.iter().zip(SHARES).map(|(s, share)| s * share).sum()).hexadecimal();
        }
        // In the picture y goes down; the stem's left is on the left of one who walks along it. The gradient is given on the stem
        // itself: further away its rounded direction would lead past it.
        let middle = nalgebra::center(&a, &b);
        let aside = [dy / length * width / 2.0, -dx / length * width / 2.0];
        // Within a hundredth of the width.
        let decimals = (-(width / 100.0).log10()).ceil().clamp(0.0, DECIMALS as f64) as usize;
        let place = |side: f64| {
            [middle.x + side * aside[0], middle.y + side * aside[1]].map(|x| {
                let mut out = String::new();
                number::push(&mut out, x, decimals);
                out
            })
        };
        let ([x1, y1], [x2, y2]) = (place(1.0), place(-1.0));
        let profile = self.profile(strengths.map(lit));
        let prefix = self.prefix;
        let gradient =
            format!(" xlink:href=\"#{prefix}s{profile}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"");
        let number = match self.gradients.get(&gradient) {
            Some(&number) => number,
            None => {
                let number = self.gradients.len() + 1;
                let _ = writeln!(
                    self.definitions,
                    "<linearGradient id=\"{prefix}g{number}\"{gradient} gradientUnits=\"userSpaceOnUse\"/>"
                );
                self.gradients.insert(gradient, number);
                number
            }
        };
        format!("url(#{prefix}g{number})")
    }

    /// The number of these colours across.
    fn profile(&mut self, colors: [Color; PLACES.len()]) -> usize {
        let next = self.profiles.len() + 1;
        let (prefix, definitions) = (self.prefix, &mut self.definitions);
        *self.profiles.entry(colors).or_insert_with(|| {
            let _ = write!(definitions, "<linearGradient id=\"{prefix}s{next}\">");
            for (i, (place, color)) in PLACES.iter().zip(colors).enumerate() {
                // Between two of its colour, and at the edge beside one, a stop changes nothing.
                let is_same = |other: Option<&Color>| other.is_none_or(|other| *other == color);
                if i > 0 && is_same(colors.get(i - 1)) && is_same(colors.get(i + 1)) {
                    continue;
                }
                let mut offset = String::new();
                number::push(&mut offset, (place + 1.0) / 2.0, 2);
                let offset = offset.trim_start_matches('0');
                let offset = if offset.is_empty() { "0" } else { offset };
                let _ = write!(definitions, "<stop offset=\"{offset}\" stop-color=\"{color}\"/>");
            }
            definitions.push_str("</linearGradient>\n");
            next
        })
    }
}

/// Some numbers as they are written, in one string, with blanks between them.
struct Texts<const N: usize> {
    text: String,
    ends: [usize; N],
}

impl<const N: usize> Texts<N> {
    fn new(numbers: [f64; N]) -> Texts<N> {
        let mut text = String::with_capacity(ROOM);
        let ends = number::push_row(&mut text, numbers, DECIMALS);
        Texts { text, ends }
    }

    fn all(&self) -> [&str; N] {
        let mut start = 0;
        self.ends.map(|end| &self.text[std::mem::replace(&mut start, end + 1)..end])
    }
}

/// True if a segment continues another one straight, so that both have straight ends there. Round ends would lie over one another,
/// and where edges are smoothed twice they are darker.
fn is_smooth(before: &Segment, after: &Segment) -> bool {
    before.direction.dot(&after.direction) > STRAIGHT
}

/// Appends a command of a path and its numbers.
fn push<const N: usize>(data: &mut String, command: &str, numbers: &[f64; N]) {
    data.push_str(command);
    number::push_row(data, *numbers, DECIMALS);
}

/// The outline of a stroke that begins with a cut, which reaches so far along it, and ends round.
fn half_round([a, b]: [Point; 2], r: f64, cut: f64) -> String {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let distance = dx.hypot(dy);
    let (nx, ny) = (-dy / distance * r, dx / distance * r);
    let mut data = String::new();
    push(&mut data, "M", &[a.x - nx, a.y - ny]);
    push(&mut data, "L", &[b.x - nx, b.y - ny]);
    push(&mut data, "A", &[r, r, 0.0, 0.0, 1.0, b.x + nx, b.y + ny]);
    push(&mut data, "L", &[a.x + nx, a.y + ny]);
    if cut > 0.0 {
        push_cut(&mut data, r, cut, [dx, dy], [a.x - nx, a.y - ny]);
    }
    data.push('Z');
    data
}

/// Appends the outer half of an ellipse across a stroke of this direction.
fn push_cut(data: &mut String, r: f64, cut: f64, [dx, dy]: [f64; 2], [x, y]: [f64; 2]) {
    let across = if dx == 0.0 { 0.0 } else { (-dx).atan2(dy).to_degrees() };
    push(data, "A", &[r, cut, across, 0.0, 1.0, x, y]);
}

/// The outline of a stroke one or both ends of which are cut aslant.
fn slanted(places: [Point; 2], radii: [f64; 2], ends: [End; 2]) -> String {
    /// Places across of the corners: the outer ones are as far along as those at 0.8.
    const CORNERS: [f64; 5] = [-1.0, -0.4, 0.0, 0.4, 1.0];
    let [a, b] = places;
    let along = (b - a).xy().try_normalize(0.0).unwrap_or_default();
    let mut data = String::new();
    for (k, end) in ends.into_iter().enumerate() {
        let (c, r) = (places[k], radii[k]);
        // From the left to the right at the first end, and back at the last.
        let turn = if k == 0 { 1.0 } else { -1.0 };
        let corner = |u: f64, ahead: f64| {
            [c.x + r * (u * along.y + ahead * along.x), c.y + r * (ahead * along.y - u * along.x)]
        };
        let command = if k == 0 { "M" } else { "L" };
        match end {
            End::Slant(aslant) => {
                for i in 0..CORNERS.len() {
                    let at = if k == 0 { i } else { CORNERS.len() - 1 - i };
                    let command = if i == 0 { command } else { "L" };
                    push(&mut data, command, &corner(CORNERS[at], f64::from(aslant[at]) / 100.0));
                }
            }
            End::Round | End::Joint => {
                push(&mut data, command, &corner(-turn, 0.0));
                let [x, y] = corner(turn, 0.0);
                push(&mut data, "A", &[r, r, 0.0, 0.0, 1.0, x, y]);
            }
            End::Mitre(_) | End::Straight | End::Foot => {
                push(&mut data, command, &corner(-turn, 0.0));
                push(&mut data, "L", &corner(turn, 0.0));
            }
        }
    }
    data.push('Z');
    data
}

/// The outline around two circles and what lies between them, with those of its ends that are cut as far along it as the cuts reach. It turns as all
/// outlines do (clockwise to the eye), so that several that overlap can be one path.
fn tapered([a, b]: [Point; 2], [ra, rb]: [f64; 2], cuts: [Option<f64>; 2]) -> String {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let distance = dx.hypot(dy);
    let mut data = String::new();
    if distance <= (ra - rb).abs() && cuts.contains(&None) || distance == 0.0 {
        // One circle holds the other.
        let (c, r) = if ra > rb { (a, ra) } else { (b, rb) };
        push(&mut data, "M", &[c.x - r, c.y]);
        push(&mut data, "A", &[r, r, 0.0, 0.0, 1.0, c.x + r, c.y]);
        push(&mut data, "A", &[r, r, 0.0, 0.0, 1.0, c.x - r, c.y]);
    } else {
        let (ex, ey) = (dx / distance, dy / distance);
        // The common tangents touch at this sine from the axis; at a cut the outline is where the radius ends.
        let touch = |k: usize, side: f64| {
            let sin = if cuts[k].is_some() { 0.0 } else { (ra - rb) / distance };
            let cos = (1.0 - sin * sin).sqrt();
            let (c, r) = [(a, ra), (b, rb)][k];
            [c.x + r * (sin * ex - side * cos * ey), c.y + r * (sin * ey + side * cos * ex)]
        };
        let large = |this: f64, other: f64| if this > other { 1.0 } else { 0.0 };
        let end = |data: &mut String, k: usize, [r, other]: [f64; 2], [x, y]: [f64; 2]| match cuts[k] {
            Some(cut) if cut > 0.0 => push_cut(data, r, cut, [dx, dy], [x, y]),
            Some(_) => push(data, "L", &[x, y]),
            None => push(data, "A", &[r, r, 0.0, large(r, other), 1.0, x, y]),
        };
        push(&mut data, "M", &touch(0, 1.0));
        end(&mut data, 0, [ra, rb], touch(0, -1.0));
        push(&mut data, "L", &touch(1, -1.0));
        end(&mut data, 1, [rb, ra], touch(1, 1.0));
    }
    data.push('Z');
    data
}
