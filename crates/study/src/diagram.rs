//! Parts that all plots share: the page, its type and colours, panels, labels and lines.
//!
//! Coordinates are those of the SVG view box: 400 units across, y downwards. A column of print is 88 mm wide, so a
//! millimetre has about 4.5 units.

use std::fmt::Write;

use svg::Document;
use svg::node::element::{Path, Rectangle, Text, Title};

/// Width of the picture.
pub(super) const WIDTH: f64 = 400.0;
/// Left edge of the panels; the numbers of the vertical axis stand to the left of it.
pub(super) const LEFT: f64 = 58.0;
/// Right edge of the panels.
pub(super) const RIGHT: f64 = WIDTH - 12.0;
/// Horizontal centre of the panels.
pub(super) const MIDDLE: f64 = (LEFT + RIGHT) / 2.0;
/// Space above the first panel, for the title.
pub(super) const TOP: f64 = 34.0;
/// Size of the type.
pub(super) const FONT: f64 = 12.0;
/// Size of the type of legends and captions.
pub(super) const SMALL: f64 = 10.0;
const FAMILY: &str = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";

/// Okabe and Ito (2008), Color universal design: distinct for readers with colour vision deficiencies, and of different
/// lightness. Yellow is left out because it is too light for lines on paper.
pub(super) const COLOURS: [&str; 7] =
    ["#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
/// Colour of frames, ticks and secondary text.
pub(super) const GREY: &str = "#333333";
/// Colour of the grid.
pub(super) const PALE: &str = "#d8d8d8";

/// An empty page with a white background and a heading; `sort` precedes the heading in the document's title.
pub(super) fn page(height: f64, sort: &str, title: &str) -> Document {
    let title = plain(title);
    Document::new()
        .set("viewBox", (0.0, 0.0, WIDTH, height))
        .set("width", 2.0 * WIDTH)
        .set("height", 2.0 * height)
        .set("font-family", FAMILY)
        .set("font-size", FONT)
        .add(Title::new(format!("{sort}: {title}")))
        .add(Rectangle::new().set("width", WIDTH).set("height", height).set("fill", "white"))
        .add(label(&title, MIDDLE, 20.0, "middle").set("font-weight", "bold"))
}

/// The frame of a panel.
pub(super) fn frame(top: f64, height: f64) -> Rectangle {
    let frame = Rectangle::new().set("x", LEFT).set("y", top).set("width", RIGHT - LEFT);
    frame.set("height", height).set("fill", "none").set("stroke", GREY)
}

/// A line of text; `anchor` is the SVG attribute `text-anchor`.
pub(super) fn label(text: &str, x: f64, y: f64, anchor: &str) -> Text {
    Text::new(text).set("x", two(x)).set("y", two(y)).set("text-anchor", anchor)
}

/// A path that is stroked and not filled.
pub(super) fn stroke(d: String, colour: &str, width: f64) -> Path {
    Path::new().set("d", d).set("fill", "none").set("stroke", colour).set("stroke-width", width)
}

/// The path data of a polyline; empty without points.
pub(super) fn polyline(points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut d = String::new();
    for (x, y) in points {
        let _ = write!(d, "{}{x:.2} {y:.2}", if d.is_empty() { 'M' } else { 'L' });
    }
    d
}

/// The text without characters that XML cannot hold.
pub(super) fn plain(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

/// Rounded to two decimals, which is enough for a coordinate.
pub(super) fn two(x: f64) -> f64 {
    (x * 100.0).round() / 100.0
}
