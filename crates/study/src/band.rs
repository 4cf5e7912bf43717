//! Distributions over time as an SVG picture: bands of the middle 50 and 90 per cent of specimens, median and mean.
//!
//! A panel for each measure, one below the other, over the same axis of time. The picture has the width and the type of the
//! other plots.

use std::fmt::Write;

use svg::Document;
use svg::node::element::{Group, Line, Path, Rectangle, Text, Title};

use super::plot::{COLOURS, FAMILY, FONT, SMALL, WIDTH, label, plain, two};
use super::spread::{Course, Spread};
use dlsys_sim::brief;

const LEFT: f64 = 58.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 34.0;
const PANEL: f64 = 150.0;
/// Between panels: the name of the next one stands there.
const GAP: f64 = 28.0;
const UNDER: f64 = 64.0;

/// An axis with equal steps.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn place(&self, value: f64) -> f64 {
        let part = (value - self.low) / (self.high - self.low);
        self.from + part.clamp(-0.1, 1.1) * (self.to - self.from)
    }

    /// Multiples of 1, 2 or 5 times a power of ten, about so many.
    fn ticks(&self, about: f64) -> Vec<f64> {
        let rough = (self.high - self.low) / about;
        let power = 10f64.powf(rough.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].map(|n| n * power).into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let (first, last) =
            ((self.low / step - 1e-9).ceil() as i64, (self.high / step + 1e-9).floor() as i64);
        (first..=last).map(|n| n as f64 * step).collect()
    }
}

/// An axis over some values; one that is all there is gets space on both sides.
fn axis(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Axis {
    let finite = values.filter(|x| x.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    match () {
        () if low > high => Axis { low: 0.0, high: 1.0, from, to },
        () if high - low <= 1e-12 * high.abs().max(low.abs()) => {
            let space = if high == 0.0 { 1.0 } else { 0.1 * high.abs() };
            Axis { low: low - space, high: high + space, from, to }
        }
        () => Axis { low, high, from, to },
    }
}

/// The picture of some measures.
pub fn band_svg(title: &str, courses: &[Course]) -> String {
    let panels = courses.len() as f64;
    let bottom = TOP + panels * PANEL + (panels - 1.0).max(0.0) * GAP + 14.0;
    let height = bottom + UNDER;
    let title = plain(title);
    let times = courses.iter().flat_map(|c| &c.spreads).map(|s| s.time);
    let x = axis(times, LEFT, WIDTH - RIGHT);
    let mut document = Document::new()
        .set("viewBox", (0.0, 0.0, WIDTH, height))
        .set("width", 2.0 * WIDTH)
        .set("height", 2.0 * height)
        .set("font-family", FAMILY)
        .set("font-size", FONT)
        .add(Title::new(format!("Specimens: {title}")))
        .add(Rectangle::new().set("width", WIDTH).set("height", height).set("fill", "white"))
        .add(label(&title, (LEFT + WIDTH - RIGHT) / 2.0, 20.0, "middle").set("font-weight", "bold"));
    for (i, course) in courses.iter().enumerate() {
        document = document.add(panel(course, &x, TOP + 14.0 + i as f64 * (PANEL + GAP), COLOURS[1 + i % 6]));
    }
    for t in x.ticks(7.0) {
        document = document.add(label(&brief(t, 4), x.place(t), bottom + 16.0, "middle"));
    }
    let specimens = courses.first().and_then(|c| c.spreads.first()).map_or(0, |s| s.count);
    document
        .add(label("time", (LEFT + WIDTH - RIGHT) / 2.0, bottom + 32.0, "middle"))
        .add(legend(bottom + 50.0, specimens))
        .to_string()
        + "\n"
}

fn panel(course: &Course, x: &Axis, top: f64, colour: &str) -> Group {
    let bottom = top + PANEL;
    let all = course.spreads.iter().flat_map(|s| s.quantiles.into_iter().chain([s.mean]));
    let mut y = axis(all, bottom, top);
    let space = 0.06 * (y.high - y.low);
    // What is never negative has its zero at the bottom, if that is near.
    y.low = if y.low >= 0.0 && y.low < 0.4 * y.high { 0.0 } else { y.low - space };
    y.high += space;
    let (mut grid, mut group) = (String::new(), Group::new());
    for value in y.ticks(5.0) {
        let at = y.place(value);
        let _ = write!(grid, "M{LEFT:.2} {at:.2}H{:.2}", WIDTH - RIGHT);
        group = group.add(label(&brief(value, 4), LEFT - 6.0, at + 4.0, "end"));
    }
    for t in x.ticks(7.0) {
        let _ = write!(grid, "M{:.2} {top:.2}V{bottom:.2}", x.place(t));
    }
    group = group.add(stroke(grid, "#d8d8d8", 0.7));
    let s = &course.spreads;
    for (low, high, opacity) in [(0, 4, 0.2), (1, 3, 0.35)] {
        let upper = s.iter().map(|s| (x.place(s.time), y.place(s.quantiles[high])));
        let lower = s.iter().rev().map(|s| (x.place(s.time), y.place(s.quantiles[low])));
        let outline = line(upper.chain(lower)) + "Z";
        group = group.add(Path::new().set("d", outline).set("fill", colour).set("fill-opacity", opacity));
    }
    let course_of = |of: &dyn Fn(&Spread) -> f64| line(s.iter().map(|s| (x.place(s.time), y.place(of(s)))));
    group = group.add(stroke(course_of(&|s| s.quantiles[2]), colour, 1.6));
    group = group.add(stroke(course_of(&|s| s.mean), "#000000", 1.0).set("stroke-dasharray", "4 2.5"));
    let frame = Rectangle::new().set("x", LEFT).set("y", top).set("width", WIDTH - LEFT - RIGHT);
    let frame = frame.set("height", PANEL).set("fill", "none").set("stroke", "#333333");
    group.add(frame).add(label(&plain(&course.name), LEFT, top - 6.0, "start"))
}

/// What is what.
fn legend(y: f64, specimens: usize) -> Group {
    let mut group = Group::new().set("font-size", SMALL);
    let colour = COLOURS[1];
    let mut x = LEFT;
    let text = |text: String, x: f64| Text::new(text).set("x", two(x)).set("y", y + 4.0);
    for (opacity, name) in [(0.2, "90 %"), (0.55, "50 %")] {
        let band = Rectangle::new().set("x", x).set("y", y - 5.0).set("width", 22.0).set("height", 10.0);
        group = group.add(band.set("fill", colour).set("fill-opacity", opacity));
        group = group.add(text(name.to_owned(), x + 27.0));
        x += 62.0;
    }
    for (colour, dashes, name) in [(colour, "none", "median"), ("#000000", "4 2.5", "mean")] {
        let sample = Line::new().set("x1", x).set("x2", x + 22.0).set("y1", y).set("y2", y);
        let sample = sample.set("stroke", colour).set("stroke-width", 1.5).set("stroke-dasharray", dashes);
        group = group.add(sample).add(text(name.to_owned(), x + 27.0));
        x += 72.0;
    }
    group.add(text(format!("{specimens} specimens"), x))
}

fn line(points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut d = String::new();
    for (x, y) in points {
        let _ = write!(d, "{}{x:.2} {y:.2}", if d.is_empty() { 'M' } else { 'L' });
    }
    d
}

fn stroke(d: String, colour: &str, width: f64) -> Path {
    Path::new().set("d", d).set("fill", "none").set("stroke", colour).set("stroke-width", width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        let axis = Axis { low: 0.0, high: 7.3, from: 0.0, to: 1.0 };
        assert_eq!(axis.ticks(7.0), [0.0, 2.0, 4.0, 6.0]);
        let flat = super::axis([3.0, 3.0].into_iter(), 0.0, 1.0);
        assert!(flat.low < 3.0 && flat.high > 3.0);
        assert!(!flat.ticks(5.0).is_empty());
    }

    #[test]
    fn a_panel_for_each_measure() {
        let spreads = (0..3).map(|t| Spread::new(t as f64, vec![1.0, 2.0 * t as f64])).collect();
        let course = Course { name: "F(x): x < 2".into(), spreads };
        let picture = band_svg("two", &[course.clone(), course]);
        assert_eq!(picture.matches("fill-opacity=\"0.35\"").count(), 2);
        assert!(picture.contains("x &lt; 2"), "names are escaped");
    }
}
