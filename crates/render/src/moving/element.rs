//! An element over the frames in which it has the same form.

use std::collections::HashMap;
use std::fmt::Write;

use super::frame::Item;
use crate::number;

/// How far what is shown may be from the frames: in pixels, and in steps of a colour.
const SLACK: f64 = 0.05;
const SHADE: f64 = 1.5;
/// Decimals of places, as in the frames, and of parts of the whole time.
const DECIMALS: usize = 3;
const MOMENTS: usize = 6;

/// The form of an attribute's value: what does not move.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Form {
    /// Text that is the same in all frames.
    Fixed(String),
    /// `#rrggbb`.
    Color,
    /// Numbers between pieces of text, one piece more than numbers.
    Numbers(Vec<String>),
}

/// An attribute of an element in a frame.
#[derive(Clone, Debug)]
pub(super) struct Attribute {
    name: String,
    form: Form,
    pub(super) numbers: Vec<f64>,
}

impl Attribute {
    pub(super) fn read(name: &str, value: &str) -> Attribute {
        let (form, numbers) = match name {
            "fill" | "stroke" => color(value),
            "d" => path(value),
            "x1" | "y1" | "x2" | "y2" | "cx" | "cy" | "r" | "rx" | "ry" | "x" | "y" | "width" | "height"
            | "stroke-width" => value.parse().ok().map(|x| (Form::Numbers(vec![String::new(); 2]), vec![x])),
            _ => None,
        }
        .unwrap_or_else(|| (Form::Fixed(value.to_owned()), Vec::new()));
        Attribute { name: name.to_owned(), form, numbers }
    }

    /// The value with other numbers.
    fn value(&self, numbers: &[f64]) -> String {
        match &self.form {
            Form::Fixed(text) => text.clone(),
            Form::Color => numbers
                .iter()
                .fold("#".to_owned(), |text, c| format!("{text}{:02x}", c.round().clamp(0.0, 255.0) as u8)),
            Form::Numbers(pieces) => {
                let mut out = pieces[0].clone();
                for (x, piece) in numbers.iter().zip(&pieces[1..]) {
                    number::push(&mut out, *x, DECIMALS);
                    out += piece;
                }
                out
            }
        }
    }

    /// How far a number may be off.
    fn slack(&self, unit: f64) -> f64 {
        if self.form == Form::Color { SHADE } else { SLACK * unit }
    }
}

fn color(value: &str) -> Option<(Form, Vec<f64>)> {
    let digits = value.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii())?;
    let channels = [0, 2, 4].map(|i| u8::from_str_radix(&digits[i..i + 2], 16).ok().map(f64::from));
    Some((Form::Color, channels.into_iter().collect::<Option<Vec<f64>>>()?))
}

/// A path of absolute commands; the flags of its arcs do not move.
fn path(data: &str) -> Option<(Form, Vec<f64>)> {
    let (mut pieces, mut numbers) = (vec![String::new()], Vec::new());
    let (mut command, mut operand) = (' ', 0);
    let mut rest = data;
    while let Some(first) = rest.chars().next() {
        if first.is_ascii_uppercase() {
            (command, operand) = (first, 0);
            pieces.last_mut()?.push(first);
            rest = &rest[1..];
        } else if first == ' ' || first == ',' {
            rest = &rest[1..];
        } else {
            let digits = |c: char| c.is_ascii_digit() || c == '.';
            let sign = usize::from(first == '-');
            let end = rest[sign..].find(|c| !digits(c)).map_or(rest.len(), |end| end + sign);
            let text = &rest[..end];
            let x: f64 = text.parse().ok()?;
            // Numbers are parted by a space; a command's first one follows it at once.
            if operand > 0 {
                pieces.last_mut()?.push(' ');
            }
            if command == 'A' && matches!(operand % 7, 3 | 4) {
                pieces.last_mut()?.push_str(text);
            } else {
                numbers.push(x);
                pieces.push(String::new());
            }
            operand += 1;
            rest = &rest[end..];
        }
    }
    Some((Form::Numbers(pieces), numbers))
}

/// When frames begin, as parts of the whole time.
pub(super) struct Timing {
    /// Of each frame, and 1.
    starts: Vec<f64>,
    /// What all animations have in common.
    common: String,
    /// Scene units in a pixel.
    unit: f64,
}

impl Timing {
    pub(super) fn new(ends: &[f64], unit: f64) -> Timing {
        let whole = ends.last().copied().unwrap_or(1.0);
        let starts = std::iter::once(0.0).chain(ends.iter().map(|end| end / whole)).collect();
        let mut seconds = String::new();
        number::push(&mut seconds, whole, MOMENTS);
        Timing { starts, common: format!(" dur=\"{seconds}s\" repeatCount=\"indefinite\"/>"), unit }
    }
}

/// An element over some frames.
#[derive(Debug)]
pub(super) struct Element {
    first: usize,
    frames: usize,
    id: Option<String>,
    tag: String,
    text: Option<String>,
    /// Of the first frame.
    attributes: Vec<Attribute>,
    /// Of each attribute, the numbers of all frames.
    tracks: Vec<Vec<f64>>,
}

impl Element {
    pub(super) fn new(first: usize, item: &Item) -> Element {
        let Item { id, tag, text, attributes, .. } = item;
        Element {
            first,
            frames: 1,
            id: id.clone(),
            tag: tag.clone(),
            text: text.clone(),
            attributes: attributes.clone(),
            tracks: attributes.iter().map(|attribute| attribute.numbers.clone()).collect(),
        }
    }

    /// Whether it has the form of another one.
    pub(super) fn goes_on(&self, item: &Item) -> bool {
        let alike = |(a, b): (&Attribute, &Attribute)| a.name == b.name && a.form == b.form;
        self.tag == item.tag
            && self.text == item.text
            && self.attributes.len() == item.attributes.len()
            && self.attributes.iter().zip(&item.attributes).all(alike)
    }

    /// Adds its next frame.
    pub(super) fn extend(&mut self, item: &Item) {
        self.frames += 1;
        for (track, attribute) in self.tracks.iter_mut().zip(&item.attributes) {
            track.extend(&attribute.numbers);
        }
    }

    /// The frames in which it is shown: the first one, and how many.
    pub(super) fn span(&self) -> (usize, usize) {
        (self.first, self.frames)
    }

    /// Whether it is shown to the end, and when it is shown, as an animation; empty if it is always.
    fn shown(&self, timing: &Timing) -> (bool, String) {
        let (begin, end) = (timing.starts[self.first], timing.starts[self.first + self.frames]);
        let is_last = self.is_last(timing);
        let mut out = String::new();
        if begin == 0.0 && is_last {
            return (true, out);
        }
        let (mut values, mut moments) = (vec!["inline"], vec![begin]);
        if begin > 0.0 {
            values.insert(0, "none");
            moments.insert(0, 0.0);
        }
        if !is_last {
            values.push("none");
            moments.push(end);
        }
        let values: Vec<String> = values.into_iter().map(str::to_owned).collect();
        animation("display\" calcMode=\"discrete", &values, &moments, timing, &mut out);
        (is_last, out)
    }

    fn is_last(&self, timing: &Timing) -> bool {
        self.first + self.frames + 1 == timing.starts.len()
    }

    /// Writes elements that are shown in the same frames, one after another in the order of drawing. `ids`: how often each was given.
    pub(super) fn write(
        together: &[&Element],
        timing: &Timing,
        ids: &mut HashMap<String, usize>,
        out: &mut String,
    ) {
        let (is_last, animation) = together[0].shown(timing);
        let hidden = if is_last { "" } else { " display=\"none\"" };
        let [alone] = together else {
            // Writing to a string does not fail.
            let _ = writeln!(out, "<g{hidden}>{animation}");
            together.iter().for_each(|element| element.write_one(timing, ("", ""), ids, out));
            out.push_str("</g>\n");
            return;
        };
        alone.write_one(timing, (hidden, &animation), ids, out);
    }

    fn write_one(
        &self,
        timing: &Timing,
        (hidden, shown): (&str, &str),
        ids: &mut HashMap<String, usize>,
        out: &mut String,
    ) {
        if let Some(text) = &self.text {
            let _ = match shown.is_empty() {
                true => writeln!(out, "{text}"),
                false => writeln!(out, "<g{hidden}>{shown}{text}</g>"),
            };
            return;
        }
        let _ = write!(out, "<{}", self.tag);
        if let Some(id) = &self.id {
            let count = ids.entry(id.clone()).or_default();
            *count += 1;
            let _ = match *count {
                1 => write!(out, " id=\"{id}\""),
                count => write!(out, " id=\"{id}-{count}\""),
            };
        }
        let mut animations = shown.to_owned();
        for (attribute, track) in self.attributes.iter().zip(&self.tracks) {
            let width = attribute.numbers.len();
            let last = &track[width * (self.frames - 1)..];
            let _ = write!(out, " {}=\"{}\"", attribute.name, attribute.value(last));
            self.move_along(attribute, track, timing, &mut animations);
        }
        let _ = match animations.is_empty() {
            true => writeln!(out, "{hidden}/>"),
            false => writeln!(out, "{hidden}>{animations}</{}>", self.tag),
        };
    }

    /// The animation of an attribute, if it moves.
    fn move_along(&self, attribute: &Attribute, track: &[f64], timing: &Timing, out: &mut String) {
        let width = attribute.numbers.len();
        let slack = attribute.slack(timing.unit);
        let mut samples: Vec<Vec<f64>> = track.chunks_exact(width.max(1)).map(<[f64]>::to_vec).collect();
        if width == 0 || samples.iter().all(|sample| within(sample, &samples[0], slack / 2.0)) {
            return;
        }
        let starts = &timing.starts[self.first..=self.first + self.frames];
        let [.., before, last] = &samples[..] else { return };
        // It goes on as it moved until the next frame; the last frame of all stands still.
        let [.., s, t, u] = *starts else { return };
        let ahead = if self.is_last(timing) { 0.0 } else { (u - t) / (t - s) };
        let at_least =
            if attribute.name == "stroke-width" || attribute.name == "r" { 0.0 } else { f64::NEG_INFINITY };
        samples.push(last.iter().zip(before).map(|(b, a)| (b + ahead * (b - a)).max(at_least)).collect());
        let kept = thinned(starts, &samples, slack);
        let mut moments: Vec<f64> = kept.iter().map(|i| starts[*i]).collect();
        let mut values: Vec<String> = kept.iter().map(|i| attribute.value(&samples[*i])).collect();
        // An animation has values from the beginning to the end.
        if moments[0] > 0.0 {
            moments.insert(0, 0.0);
            values.insert(0, values[0].clone());
        }
        if moments[moments.len() - 1] < 1.0 {
            moments.push(1.0);
            values.push(values[values.len() - 1].clone());
        }
        animation(&attribute.name, &values, &moments, timing, out);
    }
}

fn animation(name: &str, values: &[String], moments: &[f64], timing: &Timing, out: &mut String) {
    let mut parts = String::new();
    for moment in moments {
        if !parts.is_empty() {
            parts.push(';');
        }
        number::push(&mut parts, *moment, MOMENTS);
    }
    let (values, common) = (values.join(";"), &timing.common);
    // Writing to a string does not fail.
    let _ = write!(out, "<animate attributeName=\"{name}\" values=\"{values}\" keyTimes=\"{parts}\"{common}");
}

fn within(a: &[f64], b: &[f64], slack: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= slack)
}

/// Samples such that all others are near the lines between them; the first and the last are among them.
fn thinned(times: &[f64], samples: &[Vec<f64>], slack: f64) -> Vec<usize> {
    /// Most samples on a line, for the sake of time.
    const LONGEST: usize = 256;
    let is_straight = |from: usize, to: usize| {
        (from + 1..to).all(|i| {
            let part = (times[i] - times[from]) / (times[to] - times[from]);
            let on_line = samples[from].iter().zip(&samples[to]).map(|(a, b)| a + part * (b - a));
            samples[i].iter().zip(on_line).all(|(x, line)| (x - line).abs() <= slack)
        })
    };
    let mut kept = vec![0];
    let mut from = 0;
    while from + 1 < samples.len() {
        let mut to = from + 1;
        while to + 1 < samples.len() && to - from < LONGEST && is_straight(from, to + 1) {
            to += 1;
        }
        kept.push(to);
        from = to;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_keep_their_text() {
        for data in ["M1.179 0.45L0 0.45A0.45 0.45 0 0 1 0 -0.45L1.179 -0.45Z", "M0 0L-18.75 18.75"] {
            let attribute = Attribute::read("d", data);
            assert_eq!(attribute.value(&attribute.numbers), data);
        }
        // Relative paths are not read.
        assert!(matches!(Attribute::read("d", "M0 0l1 1").form, Form::Fixed(_)));
        let arcs = ["M0 0A1 1 0 0 1 2 2", "M0 0A1 1 0 1 1 2 2"].map(|d| Attribute::read("d", d).form);
        assert_ne!(arcs[0], arcs[1], "a flag does not move");
    }

    #[test]
    fn colours_are_whole_steps() {
        let attribute = Attribute::read("fill", "#0a10ff");
        assert_eq!(attribute.numbers, [10.0, 16.0, 255.0]);
        assert_eq!(attribute.value(&[9.6, 300.0, -1.0]), "#0aff00");
        assert!(matches!(Attribute::read("fill", "url(#g1)").form, Form::Fixed(_)));
    }

    #[test]
    fn samples_on_a_line_are_left_out() {
        let times: Vec<f64> = (0..10).map(f64::from).collect();
        let samples: Vec<Vec<f64>> =
            times.iter().map(|t| vec![if *t < 5.0 { *t } else { 10.0 - *t }]).collect();
        assert_eq!(thinned(&times, &samples, 0.01), [0, 5, 9]);
    }
}
