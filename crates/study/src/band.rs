//! Distributions over time as an SVG picture: bands of the middle 50 and 90 per cent of specimens, median and mean.
//!
//! A panel for each measure, one below the other, over the same axis of time. The picture has the width and the type of the
//! other plots.

use std::fmt::Write;

use svg::node::element::{Group, Line, Path, Rectangle, Text};

use super::axis::LinearAxis;
use super::diagram::{
    COLOURS, LEFT, MIDDLE, PALE, RIGHT, SMALL, TOP, frame, label, page, plain, polyline, stroke, two,
};
use super::spread::{Spread, SpreadSeries};
use dlsys_sim::brief;

const PANEL: f64 = 150.0;
/// Between panels: the name of the next one stands there.
const GAP: f64 = 28.0;
const UNDER: f64 = 64.0;

/// The picture of some measures.
pub fn band_svg(title: &str, courses: &[SpreadSeries]) -> String {
    let panels = courses.len() as f64;
    let bottom = TOP + panels * PANEL + (panels - 1.0).max(0.0) * GAP + 14.0;
    let height = bottom + UNDER;
    let times = courses.iter().flat_map(|c| &c.spreads).map(|s| s.time);
    let x = LinearAxis::around(times, LEFT, RIGHT);
    let mut document = page(height, "Specimens", title);
    for (i, course) in courses.iter().enumerate() {
        document = document.add(panel(course, &x, TOP + 14.0 + i as f64 * (PANEL + GAP), COLOURS[1 + i % 6]));
    }
    for t in x.ticks(7.0) {
        document = document.add(label(&brief(t, 4), x.place(t), bottom + 16.0, "middle"));
    }
    let specimens = courses.first().and_then(|c| c.spreads.first()).map_or(0, |s| s.count);
    document
        .add(label("time", MIDDLE, bottom + 32.0, "middle"))
        .add(legend(bottom + 50.0, specimens))
        .to_string()
        + "\n"
}

fn panel(course: &SpreadSeries, x: &LinearAxis, top: f64, colour: &str) -> Group {
    let bottom = top + PANEL;
    let all = course.spreads.iter().flat_map(|s| s.quantiles.into_iter().chain([s.mean]));
    let mut y = LinearAxis::around(all, bottom, top);
    let space = 0.06 * (y.high - y.low);
    // What is never negative has its zero at the bottom, if that is near.
    y.low = if y.low >= 0.0 && y.low < 0.4 * y.high { 0.0 } else { y.low - space };
    y.high += space;
    let (mut grid, mut group) = (String::new(), Group::new());
    for value in y.ticks(5.0) {
        let at = y.place(value);
        let _ = write!(grid, "M{LEFT:.2} {at:.2}H{RIGHT:.2}");
        group = group.add(label(&brief(value, 4), LEFT - 6.0, at + 4.0, "end"));
    }
    for t in x.ticks(7.0) {
        let _ = write!(grid, "M{:.2} {top:.2}V{bottom:.2}", x.place(t));
    }
    group = group.add(stroke(grid, PALE, 0.7));
    let s = &course.spreads;
    for (low, high, opacity) in [(0, 4, 0.2), (1, 3, 0.35)] {
        let upper = s.iter().map(|s| (x.place(s.time), y.place(s.quantiles[high])));
        let lower = s.iter().rev().map(|s| (x.place(s.time), y.place(s.quantiles[low])));
        let outline = polyline(upper.chain(lower)) + "Z";
        group = group.add(Path::new().set("d", outline).set("fill", colour).set("fill-opacity", opacity));
    }
    let course_of =
        |of: &dyn Fn(&Spread) -> f64| polyline(s.iter().map(|s| (x.place(s.time), y.place(of(s)))));
    group = group.add(stroke(course_of(&|s| s.quantiles[2]), colour, 1.6));
    group = group.add(stroke(course_of(&|s| s.mean), "#000000", 1.0).set("stroke-dasharray", "4 2.5"));
    group.add(frame(top, PANEL)).add(label(&plain(&course.name), LEFT, top - 6.0, "start"))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_for_each_measure() {
        let spreads = (0..3).map(|t| Spread::new(t as f64, vec![1.0, 2.0 * t as f64])).collect();
        let course = SpreadSeries { name: "F(x): x < 2".into(), spreads };
        let picture = band_svg("two", &[course.clone(), course]);
        assert_eq!(picture.matches("fill-opacity=\"0.35\"").count(), 2);
        assert!(picture.contains("x &lt; 2"), "names are escaped");
    }
}
