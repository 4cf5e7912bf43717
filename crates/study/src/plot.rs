//! The work-precision diagram of a study as an SVG picture for print.
//!
//! Two panels share the axis of errors, which are smaller to the right: wall time above, evaluations of the
//! right-hand side below. Both axes are logarithmic, so a method of order p is a straight line on which the
//! work grows tenfold while the error falls by p decades. The picture is as wide as a column of print
//! (88 mm) at 4.5 units a millimetre; methods differ in colour, marker and dashes.

use std::fmt::Write;

use svg::node::element::{Circle, Group, Line, Path, Rectangle, TSpan, Text};

use super::axis::{LogAxis, Tick};
use super::diagram::{
    COLOURS, GREY, LEFT, MIDDLE, PALE, RIGHT, SMALL, TOP, WIDTH, frame, label, page, plain, polyline, stroke,
    two,
};
use super::study::{Outcome, Series, Study};
use super::table::order_text;
use dlsys_sim::brief;

const PANEL: f64 = 185.0;
const GAP: f64 = 14.0;
/// From the lower panel to the legend.
const UNDER: f64 = 52.0;
const LEGEND_LINE: f64 = 18.0;
const CAPTION_LINE: f64 = 13.0;
/// Characters of a line of the caption.
const CAPTION_WIDTH: usize = 80;

/// Smaller errors are drawn as this one: they are rounding.
const LEAST_ERROR: f64 = 1e-16;

const DASHES: [&str; 4] = ["none", "6 2.5", "2 2", "7 2 2 2"];

/// The value of a point on a vertical axis, the least and the largest of it.
type Measure<'a> = &'a dyn Fn(&Outcome) -> [f64; 3];

/// The picture of a study.
pub fn svg(study: &Study) -> String {
    let caption = caption(study);
    let legend_lines = study.series.len().div_ceil(2) + usize::from(has_wrong_points(study));
    let legend_top = TOP + 2.0 * PANEL + GAP + UNDER;
    let caption_top = legend_top + legend_lines as f64 * LEGEND_LINE + 4.0;
    let height = caption_top + caption.len() as f64 * CAPTION_LINE + 6.0;
    let x = LogAxis::around(shown(study).map(|(_, _, error)| error), RIGHT, LEFT);
    let mut document = page(height, "Work and precision", &study.title);

    let time = |o: &Outcome| [o.wall.median, o.wall.min, o.wall.max].map(|s| s * 1e3);
    let work = |o: &Outcome| [o.stats.rhs_evaluations as f64; 3];
    let panels: [(&str, Measure<'_>, f64); 2] =
        [("wall time (ms)", &time, TOP), ("right-hand side evaluations", &work, TOP + PANEL + GAP)];
    for (name, measure, top) in panels {
        document = document.add(panel(study, &x, name, measure, top));
    }
    let bottom = TOP + 2.0 * PANEL + GAP;
    let ticks = x.ticks(7);
    for tick in ticks.iter().filter(|t| t.is_labelled) {
        document = document.add(power(tick, is_plain(&ticks), tick.position, bottom + 16.0, "middle"));
    }
    document = document
        .add(label("largest error, relative to max(1, |value|)", MIDDLE, bottom + 34.0, "middle"))
        .add(legend(study, legend_top));
    for (i, line) in caption.iter().enumerate() {
        let y = caption_top + (i + 1) as f64 * CAPTION_LINE - 2.0;
        document = document.add(label(line, 8.0, y, "start").set("font-size", SMALL).set("fill", GREY));
    }
    document.to_string() + "\n"
}

/// All points that have a place in the picture, with the number of their series and their error.
fn shown(study: &Study) -> impl Iterator<Item = (usize, &Outcome, f64)> {
    study.series.iter().enumerate().flat_map(|(i, series)| of_series(series).map(move |(o, e)| (i, o, e)))
}

fn of_series(series: &Series) -> impl Iterator<Item = (&Outcome, f64)> {
    let done = series.points.iter().filter_map(|point| point.result.as_ref().ok());
    done.filter_map(|outcome| {
        let error = outcome.error.filter(|e| e.is_finite())?;
        let failed = matches!(outcome.agreement, super::Agreement::Failed(_));
        (!failed).then(|| (outcome, error.max(LEAST_ERROR)))
    })
}

/// The largest error of a reference.
fn reference_error(study: &Study) -> f64 {
    study.series.iter().filter_map(|s| s.reference.error).fold(LEAST_ERROR, f64::max)
}

fn has_wrong_points(study: &Study) -> bool {
    shown(study).any(|(_, outcome, _)| !outcome.agreement.is_right())
}

/// One panel: its frame, grid, labels of the vertical axis, lines, bars and markers.
fn panel(study: &Study, x: &LogAxis, name: &str, measure: Measure<'_>, top: f64) -> Group {
    let y = LogAxis::around(shown(study).flat_map(|(_, o, _)| measure(o)), top + PANEL, top);
    let mut group = Group::new();
    let ticks = y.ticks(8);
    for tick in ticks.iter().filter(|tick| tick.is_labelled) {
        group = group.add(power(tick, is_plain(&ticks), LEFT - 6.0, tick.position + 4.0, "end"));
    }
    // To the right of here the error of the reference is as large as those of the methods.
    let from = x.place(reference_error(study));
    let doubtful = Rectangle::new().set("x", two(from)).set("y", top).set("fill", "#f0f0f0");
    let doubtful = doubtful.set("width", two(RIGHT - from)).set("height", PANEL);
    let (decades, marks) = grid(&x.ticks(7), &ticks, top);
    group = group.add(doubtful).add(stroke(decades, PALE, 0.7)).add(stroke(marks, GREY, 0.8));
    let turned = label(name, 0.0, 0.0, "middle")
        .set("transform", format!("translate(14 {:.1}) rotate(-90)", top + PANEL / 2.0));
    group = group.add(frame(top, PANEL)).add(turned);
    for (index, series) in study.series.iter().enumerate() {
        group = group.add(curve(index, series, [x, &y], measure));
    }
    group
}

/// The lines across a panel at decades, and the tick marks on its four sides.
fn grid(horizontal: &[Tick], vertical: &[Tick], top: f64) -> (String, String) {
    let bottom = top + PANEL;
    let (mut decades, mut marks) = (String::new(), String::new());
    let length = |tick: &Tick| if tick.is_decade { 5.0 } else { 3.0 };
    for tick in horizontal {
        let (at, length) = (tick.position, length(tick));
        if tick.is_decade {
            let _ = write!(decades, "M{at:.2} {top:.2}V{bottom:.2}");
        }
        let _ = write!(marks, "M{at:.2} {bottom:.2}v-{length}M{at:.2} {top:.2}v{length}");
    }
    for tick in vertical {
        let (at, length) = (tick.position, length(tick));
        if tick.is_decade {
            let _ = write!(decades, "M{LEFT:.2} {at:.2}H{RIGHT:.2}");
        }
        let _ = write!(marks, "M{LEFT:.2} {at:.2}h{length}M{RIGHT:.2} {at:.2}h-{length}");
    }
    (decades, marks)
}

/// A method in a panel: a line through its correct points, a bar from the least to the largest value, and a marker.
fn curve(index: usize, series: &Series, [x, y]: [&LogAxis; 2], measure: Measure<'_>) -> Group {
    let mut bars = String::new();
    let mut markers = Group::new();
    for (outcome, error) in of_series(series) {
        let [value, least, most] = measure(outcome);
        let (px, py) = (x.place(error), y.place(value));
        if most > least {
            let _ = write!(bars, "M{px:.2} {:.2}V{:.2}", y.place(least), y.place(most));
        }
        markers = markers.add(marker(index, px, py, outcome.agreement.is_right()));
    }
    let right = of_series(series).filter(|(outcome, _)| outcome.agreement.is_right());
    let line = polyline(right.map(|(outcome, error)| (x.place(error), y.place(measure(outcome)[0]))));
    let colour = COLOURS[index % COLOURS.len()];
    let mut group = Group::new().set("class", series.name);
    if line.contains('L') {
        let path = stroke(line, colour, 1.4).set("stroke-dasharray", DASHES[index % DASHES.len()]);
        group = group.add(path.set("stroke-linejoin", "round"));
    }
    if !bars.is_empty() {
        group = group.add(stroke(bars, colour, 1.0));
    }
    group.add(markers)
}

/// A marker of a method: filled, or hollow where modules or the order of events are wrong.
fn marker(index: usize, x: f64, y: f64, filled: bool) -> Group {
    let colour = COLOURS[index % COLOURS.len()];
    let fill = if filled { colour } else { "white" };
    let group = Group::new().set("fill", fill).set("stroke", colour).set("stroke-width", 1.2);
    let corners: &[(f64, f64)] = match index % 6 {
        0 => return group.add(Circle::new().set("cx", two(x)).set("cy", two(y)).set("r", 3.3)),
        1 => &[(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)],
        2 => &[(0.0, -4.2), (3.8, 2.6), (-3.8, 2.6)],
        3 => &[(0.0, -4.4), (4.4, 0.0), (0.0, 4.4), (-4.4, 0.0)],
        4 => &[(0.0, 4.2), (3.8, -2.6), (-3.8, -2.6)],
        _ => &[(-1.9, -4.2), (1.9, -4.2), (4.2, 0.0), (1.9, 4.2), (-1.9, 4.2), (-4.2, 0.0)],
    };
    let mut outline = String::new();
    for (i, (dx, dy)) in corners.iter().enumerate() {
        let _ = write!(outline, "{}{:.2} {:.2}", if i == 0 { 'M' } else { 'L' }, x + dx, y + dy);
    }
    group.add(Path::new().set("d", outline + "Z"))
}

/// Methods in two columns, and what a hollow marker means.
fn legend(study: &Study, top: f64) -> Group {
    let mut group = Group::new().set("font-size", SMALL + 1.0);
    let rows = study.series.len().div_ceil(2);
    let line = |row: usize| top + (row as f64 + 0.5) * LEGEND_LINE;
    for (index, series) in study.series.iter().enumerate() {
        let x = if index < rows { 12.0 } else { WIDTH / 2.0 + 4.0 };
        let y = line(index % rows.max(1));
        let sample = Line::new().set("x1", x).set("x2", x + 28.0).set("y1", y).set("y2", y);
        let sample = sample.set("stroke", COLOURS[index % COLOURS.len()]).set("stroke-width", 1.4);
        let sample = sample.set("stroke-dasharray", DASHES[index % DASHES.len()]);
        let text = Text::new("").set("x", x + 34.0).set("y", y + 4.0);
        let name = TSpan::new(series.name).set("font-weight", "bold");
        let order = TSpan::new(order_text(series)).set("dx", 6).set("fill", GREY);
        group = group.add(sample).add(marker(index, x + 14.0, y, true)).add(text.add(name).add(order));
    }
    if has_wrong_points(study) {
        let y = line(rows);
        let meaning = "hollow: wrong events or modules; error before the first of them";
        group = group.add(marker(0, 26.0, y, false)).add(label(meaning, 46.0, y + 4.0, "start"));
    }
    group
}

/// What one must know to read the picture, in lines.
fn caption(study: &Study) -> Vec<String> {
    let (first, last) = (study.times.first().unwrap_or(&0.0), study.times.last().unwrap_or(&0.0));
    let mut text = match study.times.len() {
        1 => format!("Errors at t = {}.", brief(*last, 6)),
        n => format!("Errors at {n} times from t = {} to {}.", brief(*first, 6), brief(*last, 6)),
    };
    let _ = write!(text, " {} productions, {} modules at the end.", study.events, study.modules);
    if study.runs > 1 {
        let _ = write!(text, " Wall time: median of up to {} runs; bars: fastest to slowest.", study.runs);
    }
    // Methods with the same reference share a sentence.
    let mut references: Vec<(String, Vec<&str>)> = Vec::new();
    for series in &study.series {
        let reference = series.reference.to_string();
        match references.iter_mut().find(|(known, _)| *known == reference) {
            Some((_, methods)) => methods.push(series.name),
            None => references.push((reference, vec![series.name])),
        }
    }
    for (reference, methods) in &references {
        let _ = match references.len() {
            1 => write!(text, " Reference: {reference}."),
            _ => write!(text, " Reference for {}: {reference}.", methods.join(", ")),
        };
    }
    if shown(study).any(|(_, _, error)| error < 10.0 * reference_error(study)) {
        text += " Grey: below the error of the reference.";
    }
    let unseen = |series: &Series| series.points.len() - of_series(series).count();
    let unseen: usize = study.series.iter().map(unseen).sum();
    match unseen {
        0 => {}
        1 => text += " 1 point failed or was left out and is not shown.",
        n => text += &format!(" {n} points failed or were left out and are not shown."),
    }
    wrap(&plain(&text), CAPTION_WIDTH)
}

fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// `10` with an exponent above it; plain numbers if all of an axis can be written so.
fn power(tick: &Tick, plain: bool, x: f64, y: f64, anchor: &str) -> Text {
    let text = label("", x, y, anchor);
    if plain {
        return text.add(TSpan::new(brief(f64::from(tick.mantissa) * 10f64.powi(tick.exponent), 3)));
    }
    let base = if tick.mantissa == 1 { "10".to_owned() } else { format!("{}·10", tick.mantissa) };
    let exponent = tick.exponent.to_string().replace('-', "\u{2212}");
    text.add(TSpan::new(base)).add(TSpan::new(exponent).set("dy", -4.5).set("font-size", 9))
}

/// True if no label of an axis is very small or large.
fn is_plain(ticks: &[Tick]) -> bool {
    ticks.iter().filter(|t| t.is_labelled).all(|t| (-2..=3).contains(&t.exponent))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_are_broken_between_words() {
        assert_eq!(wrap("one two three  four", 9), ["one two", "three", "four"]);
        assert_eq!(wrap("", 9), Vec::<String>::new());
    }
}
