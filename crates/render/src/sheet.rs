//! Writing of a [`Sheet`]: each frame is drawn by itself, on any thread; then all are put together in order.

use super::formats::Content;
use std::borrow::Cow;
use std::fmt::Write;

use super::floor;
use super::formats::png::{self, Canvas, Meeting};
use super::layout::{Caption, Cell};
use super::painter::{self, text};
use super::raster::Image;
use super::{Error, Fit, Format, Layout, Page, Sheet, Smoothness, formats::svg, glyphs};
use dlsys_geometry::scene::{Color, Scene};

/// Colour of captions.
const INK: Color = Color::hex(0x555555);
/// Longest document, in bytes.
const LONGEST: usize = 1 << 30;

/// Writes the frames of a sheet.
#[derive(Clone, Debug)]
pub struct SheetWriter {
    format: Format,
    fit: Fit,
    sheet: Sheet,
    page: Page,
}

/// One frame, ready to be put on the sheet.
#[derive(Debug)]
pub struct Part(Drawn);

#[derive(Debug)]
enum Drawn {
    Elements(String),
    /// With the pixel of its upper left corner.
    Image(Image, [i64; 2]),
}

/// A sheet that is being filled.
#[derive(Debug)]
pub struct Assembly<'a> {
    writer: &'a SheetWriter,
    elements: String,
    canvas: Option<Canvas<'a>>,
    added: usize,
}

impl SheetWriter {
    /// A writer on a page that has the area of the sheet's picture, or more.
    ///
    /// # Errors
    /// If the format has no pictures.
    pub fn new(format: Format, fit: Fit, sheet: Sheet, page: Page) -> Result<SheetWriter, Error> {
        match format.content() {
            Content::Mesh => Err(Error::NoLayout),
            _ => {
                // One floor for all frames.
                let color = sheet.floor.flatten();
                let background = page.background.map(|background| color.unwrap_or(background));
                Ok(SheetWriter { format, fit, sheet, page: Page { background, ..page } })
            }
        }
    }

    /// Name of the file: `overlay.svg`.
    pub fn file(&self) -> String {
        format!("{}.{}", self.sheet.layout.name(), self.format.extension())
    }

    /// The page of the whole sheet.
    pub fn page(&self) -> &Page {
        &self.page
    }

    /// Draws the frame with this number. A frame that the sheet has no place for is left out.
    ///
    /// # Errors
    /// If more plants of other models are seen than a picture of vectors has room for.
    pub fn part(&self, index: usize, scene: &Scene) -> Result<Part, Error> {
        let cell = self.sheet.cells.get(index);
        let fit = &*self.fit_of(cell);
        let scene = &*fit.drawn(Cow::Borrowed(scene));
        Ok(Part(match self.format.content() {
            Content::Pixels => {
                let (size, corner, placement) = self.window(cell);
                Drawn::Image(png::picture(scene, fit, size, placement, Smoothness::Fine, 1), corner)
            }
            _ => Drawn::Elements(match cell {
                None => String::new(),
                Some(_) => self.elements(scene, fit, &format!("f{index}"))?,
            }),
        }))
    }

    fn elements(&self, scene: &Scene, fit: &Fit, prefix: &str) -> Result<String, Error> {
        let style = svg::style(fit, &self.page);
        if fit.has_visible_regions() && !scene.plants.is_empty() {
            let style = painter::Style { casting: Some(scene), ..style };
            return svg::field(scene, &self.alone(fit), style, (false, prefix)).map_err(Error::TooManySeen);
        }
        let scene = scene.flattened();
        let scene = &*scene.tessellated(fit.accuracy);
        let (scene, floor) = floor::added(scene, fit, Some(&self.page_of(fit)));
        Ok(painter::elements(&scene, painter::Style { floor, ..style }, false, prefix))
    }

    /// The fit of a frame: of one that stands on the floor of the sheet or on soil, its part of that.
    fn fit_of(&self, cell: Option<&Cell>) -> Cow<'_, Fit> {
        let part = cell.and_then(|cell| cell.frame.zip(Some(cell.offset)));
        match part.filter(|_| self.sheet.floor.is_some() || self.sheet.has_soil) {
            None => Cow::Borrowed(&self.fit),
            Some(([left, bottom, right, top], [x, y])) => {
                Cow::Owned(self.fit.for_cell([left - x, bottom - y, right - x, top - y]))
            }
        }
    }

    /// The page for the floor of a frame.
    fn page_of(&self, fit: &Fit) -> Page {
        if fit.shaded.is_none() { self.page } else { self.alone(fit) }
    }

    /// The page of a frame alone, at the scale of the sheet.
    fn alone(&self, fit: &Fit) -> Page {
        let [_, _, width, height] = fit.picture.area;
        let pixels = [width, height].map(|side| (side * self.page.pixels_per_unit()).ceil().max(1.0) as u32);
        Page { picture: fit.picture, pixels, ..self.page }
    }

    /// The pixels that a frame takes up: size, upper left corner, and how the camera's picture is placed in them.
    fn window(&self, cell: Option<&Cell>) -> ([u32; 2], [i64; 2], [f64; 3]) {
        let [a, b, c] = self.page.placement();
        let frame = cell.and_then(|cell| cell.frame);
        let (Some(cell), Some([left, bottom, right, top])) = (cell, frame) else {
            return ([1, 1], [0, 0], [a, b, c]);
        };
        // A pixel more all round; what is beyond the page is of no use.
        let range = |low: f64, high: f64, side: u32| {
            let low = (low.floor() - 1.0).clamp(0.0, f64::from(side - 1));
            let high = (high.ceil() + 1.0).clamp(low + 1.0, f64::from(side));
            (low, (high - low) as u32)
        };
        let [width, height] = self.page.pixels;
        let (x, wide) = range(a * left + b, a * right + b, width);
        let (y, high) = range(c - a * top, c - a * bottom, height);
        let [dx, dy] = cell.offset;
        ([wide, high], [x as i64, y as i64], [a, b + a * dx - x, c - a * dy - y])
    }

    /// An empty sheet.
    pub fn begin(&self) -> Assembly<'_> {
        let canvas = (self.format.content() == Content::Pixels).then(|| Canvas::new(&self.page));
        Assembly { writer: self, elements: String::new(), canvas, added: 0 }
    }
}

impl Assembly<'_> {
    /// Adds the next frame, over those before it.
    ///
    /// # Errors
    /// If the document becomes too long.
    pub fn add(&mut self, part: Part) -> Result<(), Error> {
        let index = self.added;
        self.added += 1;
        let Some(cell) = self.writer.sheet.cells.get(index) else { return Ok(()) };
        let meeting = if self.writer.sheet.layout == Layout::Stack { Meeting::Beside } else { Meeting::Over };
        match part.0 {
            Drawn::Image(image, corner) => {
                if let Some(canvas) = &mut self.canvas {
                    canvas.add(&image, corner, cell.opacity, meeting);
                }
            }
            Drawn::Elements(elements) => {
                self.add_group(index, cell, &elements);
                if self.elements.len() > LONGEST {
                    return Err(Error::SheetTooLong { frame: index });
                }
            }
        }
        Ok(())
    }

    fn add_group(&mut self, index: usize, cell: &Cell, elements: &str) {
        let scale = self.writer.page.picture.scale;
        let out = &mut self.elements;
        let _ = write!(out, "<g id=\"frame-{index:04}\"");
        if cell.offset != [0.0; 2] {
            let [x, y] = [cell.offset[0] * scale, -cell.offset[1] * scale].map(text);
            let _ = write!(out, " transform=\"translate({x} {y})\"");
        }
        if self.writer.sheet.lines {
            // Rows that touch would show a seam wherever an edge is smoothed.
            out.push_str(" shape-rendering=\"crispEdges\"");
        }
        if cell.opacity < 1.0 {
            let _ = write!(out, " opacity=\"{}\"", text(cell.opacity));
        }
        let _ = writeln!(out, ">\n{elements}</g>");
        if let Some(Caption { x, y, text: words }) = &cell.caption {
            let [x, y, size] = [x * scale, -y * scale, self.writer.sheet.letters * scale].map(text);
            let words = words.replace('&', "&amp;").replace('<', "&lt;");
            let _ = writeln!(
                out,
                "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" font-family=\"sans-serif\" text-anchor=\"middle\" fill=\"{INK}\">{words}</text>"
            );
        }
    }

    /// The bytes of the file. `title` is its title for readers.
    pub fn finish(self, title: &str) -> Vec<u8> {
        let page = &self.writer.page;
        let Some(mut canvas) = self.canvas else {
            return svg::around(page, title, None, self.elements).concat().into_bytes();
        };
        let [a, b, c] = page.placement();
        let sheet = &self.writer.sheet;
        let lines: Vec<glyphs::GlyphLine> = sheet
            .cells
            .iter()
            .filter_map(|cell| cell.caption.as_ref())
            .map(|caption| glyphs::GlyphLine {
                middle: a * caption.x + b,
                base: c - a * caption.y,
                size: a * sheet.letters,
                text: &caption.text,
            })
            .collect();
        if !lines.is_empty() {
            canvas.add(&glyphs::draw(page.pixels, &lines, INK), [0, 0], 1.0, Meeting::Over);
        }
        canvas.encode(title)
    }
}
