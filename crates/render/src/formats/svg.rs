//! A scene as an SVG picture: the document around its [elements](crate::painter).

use std::io::{self, Write};

use super::{Content, Description, Drawing, Exporter};
use svg::Document;
use svg::node::Blob;
use svg::node::element::{Definitions, Group, LinearGradient, Rectangle, Stop, Title};

use crate::field::Field;
use crate::painter::{self, Style, text};
use crate::sky::Sky;
use crate::{Fit, Page, floor, trace};
use dlsys_geometry::scene::Scene;

/// Scalable Vector Graphics.
pub(crate) struct Svg;

impl Exporter for Svg {
    fn description(&self) -> Description {
        Description { name: "svg", about: "Vector graphics, one view", content: Content::Vectors }
    }

    fn write(
        &self,
        Drawing { scene, whole, writer, title }: Drawing<'_>,
        out: &mut (dyn Write + Send),
    ) -> io::Result<()> {
        let (mut fit, page) = writer.fit.for_frame(scene, &writer.page);
        // A page of another shape than what is drawn shows more, such as a floor.
        fit.picture = page.picture;
        let sky = Sky::of(scene, &fit, &page);
        let (casting, memory) = (Some(whole), Some(&*writer.memory));
        let style = Style { casting, threads: writer.threads, memory, ..style(&fit, &page) };
        let elements = if fit.has_visible_regions() {
            field(scene, &page, style, (true, ""))?
        } else {
            let (scene, floor) = floor::added(scene, &fit, Some(&page));
            painter::elements(&scene, Style { floor, ..style }, true, "")
        };
        let parts = around(&page, title, sky.as_ref(), elements);
        parts.iter().try_for_each(|part| out.write_all(part.as_bytes()))
    }
}

/// The regions that are seen of a scene on a page, with its plants of other models as a [`Field`].
///
/// # Errors
/// If more of these is seen than there is room for.
pub(crate) fn field(
    scene: &Scene,
    page: &Page,
    style: Style,
    (named, prefix): (bool, &str),
) -> io::Result<String> {
    let field = Field::of(scene, style.fit, page);
    let beside = field.small(style.threads)?;
    let large = field.large();
    let (scene, floor) = floor::added(&large, style.fit, Some(page));
    Ok(trace::elements(&scene, beside, Style { floor, ..style }, named, prefix))
}

/// How frames are painted on a page.
pub(crate) fn style<'a>(fit: &'a Fit, page: &Page) -> Style<'a> {
    let [pixels, ..] = page.placement();
    Style {
        fit,
        scale: page.picture.scale,
        pixels,
        background: page.background,
        floor: None,
        casting: None,
        threads: 1,
        memory: None,
    }
}

/// The document of a page with these elements, each with its line's end, in parts: elements are most of it, and are not copied. A sky stands in
/// place of the background.
pub(crate) fn around(page: &Page, title: &str, sky: Option<&Sky>, mut elements: String) -> [String; 3] {
    /// Stands for the elements; no title holds such a character.
    const HERE: &str = "\u{1}";
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
        let fill = sky.map_or_else(|| color.to_string(), |_| "url(#sky)".to_owned());
        if let Some(sky) = sky {
            let mut gradient = LinearGradient::new().set("id", "sky").set("x2", 0).set("y2", 1);
            for (part, color) in sky.stops() {
                gradient =
                    gradient.add(Stop::new().set("offset", text(part)).set("stop-color", color.to_string()));
            }
            document = document.add(Definitions::new().add(gradient));
        }
        let background = Rectangle::new()
            .set("x", text(left))
            .set("y", text(top))
            .set("width", text(width))
            .set("height", text(height))
            .set("fill", fill);
        document = document.add(background);
    }
    let things =
        Group::new().set("stroke-linecap", "round").set("stroke-linejoin", "round").add(Blob::new(HERE));
    let document = document.add(things).to_string();
    let (before, after) = document.split_once(HERE).unwrap_or((&document, ""));
    [before.to_owned(), elements, format!("{after}\n")]
}
