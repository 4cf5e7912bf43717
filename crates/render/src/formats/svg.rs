//! A scene as an SVG picture: the document around its [elements](crate::painter).

use std::io::{self, Write};

use super::{Content, Description, Drawing, Exporter};
use svg::Document;
use svg::node::Blob;
use svg::node::element::{Group, Rectangle, Title};

use crate::painter::{self, Style, text};
use crate::{Fit, Page};

/// Scalable Vector Graphics.
pub(crate) struct Svg;

impl Exporter for Svg {
    fn description(&self) -> Description {
        Description { name: "svg", about: "Vector graphics, one view", content: Content::Vectors }
    }

    fn write(
        &self,
        Drawing { scene, writer, title }: Drawing<'_>,
        out: &mut (dyn Write + Send),
    ) -> io::Result<()> {
        let style = style(&writer.fit, &writer.page);
        out.write_all(around(&writer.page, title, painter::elements(scene, style, true, "")).as_bytes())
    }
}

/// How frames are painted on a page.
pub(crate) fn style<'a>(fit: &'a Fit, page: &Page) -> Style<'a> {
    let [pixels, ..] = page.placement();
    Style { fit, scale: page.picture.scale, pixels }
}

/// The document of a page with these elements, each with its line's end.
pub(crate) fn around(page: &Page, title: &str, mut elements: String) -> String {
    let view_box = page.picture.view_box();
    let [left, top, width, height] = view_box;
    elements.truncate(elements.trim_end().len());
    // Characters that XML cannot hold have no place in a title.
    let title: String = title.chars().filter(|c| !c.is_control()).collect();
    let mut document = Document::new()
        .set("viewBox", view_box.map(text).join(" "))
        .set("width", page.pixels[0])
        .set("height", page.pixels[1])
        .add(Title::new(title));
    if elements.contains("xlink:href") {
        document = document.set("xmlns:xlink", "http://www.w3.org/1999/xlink");
    }
    if let Some(color) = page.background {
        let background = Rectangle::new()
            .set("x", text(left))
            .set("y", text(top))
            .set("width", text(width))
            .set("height", text(height))
            .set("fill", color.to_string());
        document = document.add(background);
    }
    let things =
        Group::new().set("stroke-linecap", "round").set("stroke-linejoin", "round").add(Blob::new(elements));
    let mut out = document.add(things).to_string();
    out.push('\n');
    out
}
