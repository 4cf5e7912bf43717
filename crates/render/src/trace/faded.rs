//! A floor that fades into the horizon: its regions have a mask, and lie over copies of themselves that have the colour of the horizon. Without these,
//! what regions in front of the floor have beyond their outlines would be seen through it.

use std::fmt::Write;

use crate::lighting::Lighting;
use crate::painter::{Style, text};
use dlsys_geometry::scene::{Color, Scene};

/// How a floor fades on a page.
pub(super) struct Faded {
    /// Of the horizon.
    color: Color,
    /// Heights on the page, from the horizon down, with the parts of the floor's colour that are left there.
    stops: Vec<(f64, f64)>,
    /// The rectangle of the page, as attributes.
    page: String,
}

impl Faded {
    /// `None` if nothing fades, or there is nothing behind the floor.
    pub(super) fn of(style: Style, lighting: &Lighting, scene: &Scene) -> Option<Faded> {
        let Style { fit, scale, background, .. } = style;
        let [left, bottom, width, height] = fit.picture.area;
        let stops = lighting.fading()?.stops([bottom, bottom + height]);
        let stops: Vec<(f64, f64)> = stops.into_iter().map(|(y, part)| (-y * scale, part)).collect();
        let color =
            fit.surroundings(scene).sky.map_or(background, |[_, horizon]| background.map(|_| horizon))?;
        let page = [("x", left), ("y", -bottom - height), ("width", width), ("height", height)];
        let page = page.map(|(name, length)| format!("{name}=\"{}\"", text(length * scale))).join(" ");
        (!stops.is_empty()).then_some(Faded { color, stops, page })
    }

    /// Whether a floor at this height on the page is paler than it is.
    pub(super) fn is_faint(&self, y: f64) -> bool {
        self.stops.iter().any(|(at, part)| *part < 1.0 && y <= *at)
    }

    /// All that stands before the regions of the floor, of which those with these outlines are far away; `</g>` stands behind them.
    pub(super) fn begin(&self, far: &[String], prefix: &str) -> String {
        let units = "Units=\"userSpaceOnUse\"";
        let (first, last) = (self.stops[0].0, self.stops[self.stops.len() - 1].0);
        let [y1, y2] = [first, last].map(text);
        let mut out = format!(
            "<defs><linearGradient id=\"{prefix}far\" gradient{units} x1=\"0\" x2=\"0\" y1=\"{y1}\" y2=\"{y2}\">\n"
        );
        for (at, part) in &self.stops {
            let offset = (at - first) / (last - first);
            let _ = writeln!(
                out,
                "<stop offset=\"{offset:.4}\" stop-color=\"#fff\" stop-opacity=\"{part:.4}\"/>"
            );
        }
        let Faded { color, page, .. } = self;
        let _ = writeln!(
            out,
            "</linearGradient><mask id=\"{prefix}near\" mask{units} {page}><rect {page} fill=\"url(#{prefix}far)\"/></mask></defs>"
        );
        let _ = writeln!(out, "<g fill=\"{color}\">");
        for data in far {
            let _ = writeln!(out, "<path d=\"{data}\"/>");
        }
        let _ = writeln!(out, "</g>\n<g mask=\"url(#{prefix}near)\">");
        out
    }
}
