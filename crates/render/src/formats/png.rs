//! A scene as a PNG picture: stems as the tubes of the OBJ format, smooth shading, hidden surfaces removed to the pixel.

use std::io::{self, Write};

use super::{Content, Description, Drawing, Exporter, rows};
use crate::lens::Lens;
use crate::light::Spot;
use crate::lighting::Lighting;
use crate::mapping::{Cut, Mapping, Pinned};
use crate::raster::{self, Corner, Image, Place};
use crate::sky::Sky;
use crate::stage::Stage;
use crate::triangles::Triangles;
use crate::{Fit, Page, Smoothness, shot};
use dlsys_geometry::scene::{Color, MaterialId, Palette, Point, Scene, Texture, Vector};

/// The least cosines of the angles between corners where the light between them is a linear, and where it is a quadratic function of the place. The sharpest
/// part of it, the gloss, has second derivatives of about four, so a linear one is off by half the square of the angle, a hundredth.
const EVEN: f64 = 0.99;
const BENT: f64 = 0.85;

/// All of a channel, on a page.
const FULL: u32 = 65535;

/// Portable Network Graphics.
pub(crate) struct Png;

impl Exporter for Png {
    fn description(&self) -> Description {
        Description {
            name: "png",
            about: "Pixels, one view; what is nearer is in front to the pixel",
            content: Content::Pixels,
        }
    }

    fn write(
        &self,
        Drawing { scene, writer, title, .. }: Drawing<'_>,
        out: &mut (dyn Write + Send),
    ) -> io::Result<()> {
        let (fit, page) = writer.fit.for_frame(scene, &writer.page);
        out.write_all(&file(&page, title, &drawn(scene, &fit, &page, writer.threads)))
    }
}

/// The bytes of a frame: three for each pixel, or four if there is no background.
pub(crate) fn drawn(scene: &Scene, fit: &Fit, page: &Page, threads: usize) -> Vec<u8> {
    let image = picture(scene, fit, page.pixels, page.placement(), Smoothness::Fine, threads);
    composed(page, Sky::of(scene, fit, page).as_ref(), &image)
}

/// Pixels of a scene, transparent where nothing is. A point that the camera sees at x, y is at `a x + b` and `c - a y`
/// pixels from the upper left corner.
/// The pixels do not depend on the number of threads.
pub(crate) fn picture(
    scene: &Scene,
    fit: &Fit,
    size: [u32; 2],
    placement: [f64; 3],
    smoothness: Smoothness,
    threads: usize,
) -> Image {
    let lens = Lens::new(fit, size, placement);
    let stage = Stage::new(scene, fit, &lens);
    let lighting = Lighting::new(scene, fit, lens.scale(), threads, None, Some(&lens));
    match smoothness {
        Smoothness::Fine => shot::draw(&raster::SIXTEEN, threads, &stage, &lens, &lighting),
        Smoothness::Quick => shot::draw(&raster::FOUR, threads, &stage, &lens, &lighting),
    }
}

/// The strength of light at the corners of a triangle; and half-way from each to the next, if that is not about the mean.
pub(crate) struct CornerLight {
    pub(crate) at: [f64; 3],
    pub(crate) between: Option<[f64; 3]>,
}

/// Triangles in pixels, and the light on them.
pub(crate) struct Lit<'m> {
    mesh: &'m Triangles,
    lighting: Lighting<'m>,
    /// The material of the floor.
    floor: Option<MaterialId>,
    /// By vertex: pixels to the right and down, and depth in scene units.
    places: Vec<[f64; 3]>,
    /// The same on the grid of the rasteriser.
    snapped: Vec<Place>,
    /// By vertex: as the camera projects it.
    seen: Vec<Point>,
    normals: Vec<Vector>,
    scale: f64,
    palette: &'m Palette,
}

impl<'m> Lit<'m> {
    /// The triangles of a scene in this light, whose floor has a material of its own, and their vertices as the camera sees them. A point that it sees
    /// at x, y is at `a x + b` and `c - a y` pixels.
    pub(crate) fn new(
        scene: &'m Scene,
        (mesh, seen): (&'m Triangles, Vec<Point>),
        (fit, lighting): (&'m Fit, Lighting<'m>),
        [a, b, c]: [f64; 3],
        floor: Option<MaterialId>,
    ) -> Lit<'m> {
        let scale = if fit.extent > 0.0 { 1.0 / fit.extent } else { 1.0 };
        let places = seen.iter().map(|p| [a * p.x + b, c - a * p.y, p.z]).collect();
        let normals = mesh.normals.iter().map(|&n| fit.camera.direction(n)).collect();
        Lit {
            mesh,
            lighting,
            floor,
            places,
            snapped: Vec::new(),
            seen,
            normals,
            scale,
            palette: &scene.palette,
        }
    }

    /// The material of the floor, if there is one.
    pub(crate) fn floor(&self) -> Option<MaterialId> {
        self.floor
    }

    /// The picture on a triangle, and where its corners are.
    fn picture(&self, n: usize) -> Option<(&'m Texture, [Pinned; 3])> {
        if self.mesh.places.is_empty() {
            return None;
        }
        let face = &self.mesh.faces[n];
        let texture = self.palette.texture(face.material)?;
        let pinned = face.corners.map(|(vertex, _)| {
            let [x, y, z] = self.places[vertex as usize];
            let magnification = self.lighting.camera().magnification(z);
            Pinned { at: [x, y], place: self.mesh.places[vertex as usize], magnification }
        });
        Some((texture, pinned))
    }

    /// What is cut out of a triangle, decided so many times in a pixel.
    pub(crate) fn cut(&self, n: usize, count: usize) -> Option<Cut<'m>> {
        let (texture, pinned) = self.picture(n)?;
        Cut::new(texture, pinned, count)
    }

    /// The colour of a picture at a place between the corners of a triangle; `None` if none is on it.
    pub(crate) fn pictured(&self, n: usize, weights: impl FnOnce() -> [f64; 3]) -> Option<[f64; 3]> {
        let (texture, pinned) = self.picture(n)?;
        Some(texture.color(&Mapping::new(pinned)?.print_between(pinned, weights())))
    }

    /// Moves the origin of pixels to where it stays.
    pub(crate) fn shift(&mut self, [right, down]: [f64; 2]) {
        for [x, y, _] in &mut self.places {
            (*x, *y) = (*x - right, *y - down);
        }
        let snapped = self.places.iter().map(|&[x, y, z]| Corner { x, y, depth: z * self.scale }.place());
        self.snapped = snapped.collect();
    }

    /// The corners of a triangle on the grid of the rasteriser, once the origin stays.
    #[inline(always)]
    pub(crate) fn snapped(&self, n: usize) -> [Place; 3] {
        let [(p, _), (q, _), (r, _)] = self.mesh.faces[n].corners;
        [self.snapped[p as usize], self.snapped[q as usize], self.snapped[r as usize]]
    }

    /// The corners of a triangle.
    pub(crate) fn corners(&self, n: usize) -> [Corner; 3] {
        self.mesh.faces[n].corners.map(|(vertex, _)| {
            let [x, y, z] = self.places[vertex as usize];
            Corner { x, y, depth: z * self.scale }
        })
    }

    /// The strength of light at a place between the corners of a triangle. Of a surface that is seen from behind, the back
    /// is lit.
    pub(crate) fn strength(&self, n: usize, weights: [f64; 3]) -> f64 {
        let face = &self.mesh.faces[n];
        let facing = self.is_facing(n);
        let (mut normal, mut seen) = (Vector::zeros(), Vector::zeros());
        for (k, weight) in weights.into_iter().enumerate() {
            let (vertex, at) = face.corners[k];
            normal += self.normals[at as usize] * weight;
            seen += self.seen[vertex as usize].coords * weight;
        }
        if self.floor == Some(face.material) {
            return self.lighting.floor_strength(Point::from(seen));
        }
        let normal = normal.try_normalize(1e-12).unwrap_or_else(Vector::z) * if facing { 1.0 } else { -1.0 };
        self.lighting.strength(&Spot { normal, seen: Point::from(seen), is_thin: face.is_thin })
    }

    /// The numbers of triangles and of normals.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [self.mesh.faces.len(), self.normals.len()]
    }

    /// The strength of light at the corners of a triangle, and what is needed to tell it between them; `None` unless they are turned about the same way.
    /// What is known `by_normal`, on its front and on its back, is not reckoned again.
    pub(crate) fn at_corners(&self, n: usize, by_normal: &mut [[f64; 2]]) -> Option<CornerLight> {
        let light = self.lighting.lamp()?;
        let face = &self.mesh.faces[n];
        if self.floor == Some(face.material) {
            return None;
        }
        let normals = face.corners.map(|(_, at)| self.normals[at as usize]);
        let square = |i: usize, k: usize| {
            let (a, b) = (&normals[i], &normals[k]);
            let cos = a.dot(b);
            if cos > 0.0 { cos * cos / (a.norm_squared() * b.norm_squared()) } else { 0.0 }
        };
        let least = square(0, 1).min(square(1, 2)).min(square(2, 0));
        if least.is_nan() || least < BENT * BENT {
            return None;
        }
        let side = usize::from(!self.is_facing(n));
        let lit = |normal: Vector| {
            let unit = normal.try_normalize(1e-12).unwrap_or_else(Vector::z);
            light.of_normal(if side == 0 { unit } else { -unit }, face.is_thin)
        };
        let depths = face.corners.map(|(vertex, _)| light.at_depth(self.seen[vertex as usize].z));
        let at = [0, 1, 2].map(|k| {
            let known = &mut by_normal[face.corners[k].1 as usize][side];
            if known.is_nan() {
                *known = lit(normals[k]);
            }
            *known + depths[k]
        });
        let between = (least < EVEN * EVEN).then(|| {
            [(0, 1), (1, 2), (2, 0)]
                .map(|(i, k)| lit(normals[i] + normals[k]) + (depths[i] + depths[k]) / 2.0)
        });
        Some(CornerLight { at, between })
    }

    /// Whether a triangle is seen from its front.
    fn is_facing(&self, n: usize) -> bool {
        let [p, q, r] = self.mesh.faces[n].corners.map(|(vertex, _)| self.places[vertex as usize]);
        // Pixels go down.
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]) < 0.0
    }

    /// The light on the triangles.
    pub(crate) fn lighting(&self) -> &Lighting<'m> {
        &self.lighting
    }

    /// The colour of a material, or one of its tones, in light of this strength, before a background.
    pub(crate) fn color(
        &self,
        material: MaterialId,
        tone: Option<Color>,
        strength: f64,
        background: Option<Color>,
    ) -> Color {
        if self.floor == Some(material) {
            return self.lighting.floor_over(background, strength);
        }
        self.lighting.color(tone.unwrap_or(self.palette.get(material).color), strength)
    }
}

/// A page for several images, with 16 bits a channel, so that many faint ones add up.
#[derive(Debug)]
pub(crate) struct Canvas<'a> {
    page: &'a Page,
    /// Colour times opacity, and opacity.
    pixels: Vec<[u16; 4]>,
}

/// The rule for pixels that a new image and the page both cover in part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Meeting {
    /// Independent coverage: each hides its share of the other.
    Over,
    /// Side by side: neighbours that share an edge leave nothing open between them.
    Beside,
}

impl Canvas<'_> {
    pub(crate) fn new(page: &Page) -> Canvas<'_> {
        let [width, height] = page.pixels.map(|side| side as usize);
        Canvas { page, pixels: vec![[0; 4]; width * height] }
    }

    /// Puts an image over the page, its upper left corner at this pixel; parts beyond the page are cut off.
    pub(crate) fn add(&mut self, image: &Image, [left, top]: [i64; 2], opacity: f64, meeting: Meeting) {
        let [width, height] = self.page.pixels.map(i64::from);
        let opacity = (opacity.clamp(0.0, 1.0) * 257.0).round() as u32;
        for y in 0.max(-top)..(image.height as i64).min(height - top) {
            for x in 0.max(-left)..(image.width as i64).min(width - left) {
                let over = image.pixels[y as usize * image.width + x as usize];
                if over[3] == 0 {
                    continue;
                }
                let over = over.map(|channel| u32::from(channel) * opacity);
                let under = &mut self.pixels[((y + top) * width + x + left) as usize];
                let open = FULL - over[3].min(FULL);
                let share = match meeting {
                    Meeting::Over => open,
                    // As much as there is room for.
                    Meeting::Beside => (open * FULL / u32::from(under[3]).max(1)).min(FULL),
                };
                for (under, channel) in under.iter_mut().zip(over) {
                    *under = (channel + (u32::from(*under) * share + FULL / 2) / FULL).min(FULL) as u16;
                }
            }
        }
    }

    /// The file. `title` is for people.
    pub(crate) fn encode(&self, title: &str) -> Vec<u8> {
        let background = self.page.background.map(|Color { red, green, blue }| [red, green, blue]);
        let mut data = Vec::with_capacity(self.pixels.len() * if background.is_some() { 3 } else { 4 });
        for &[red, green, blue, opacity] in &self.pixels {
            let (color, opacity) = ([red, green, blue].map(u32::from), u32::from(opacity));
            match background {
                Some(background) => data.extend([0, 1, 2].map(|k| {
                    let channel = color[k] + u32::from(background[k]) * 257 * (FULL - opacity) / FULL;
                    ((channel + 128) / 257).min(255) as u8
                })),
                None => {
                    let whole = opacity.max(1);
                    data.extend(color.map(|c| ((c * 255 + whole / 2) / whole).min(255) as u8));
                    data.push(((opacity + 128) / 257) as u8);
                }
            }
        }
        file(self.page, title, &data)
    }
}

/// Pixels of which it is told at once whether all of them are empty, as most of a picture is.
const BLOCK: usize = 16;

/// The bytes of one image that fills a page; a sky stands behind it where there is a background.
fn composed(page: &Page, sky: Option<&Sky>, image: &Image) -> Vec<u8> {
    let Some(color) = page.background else { return uncovered(image) };
    let mut data = Vec::with_capacity(3 * image.pixels.len());
    let mut empty: Vec<u8> = Vec::new();
    for (line, row) in image.pixels.chunks_exact(image.width.max(1)).enumerate() {
        let part = (line as f64 + 0.5) / image.height.max(1) as f64;
        let background = sky.map_or(color, |sky| sky.color(part));
        let background = [background.red, background.green, background.blue];
        let start = data.len();
        if sky.is_some() || line == 0 {
            empty.clear();
            (0..row.len()).for_each(|_| empty.extend(background));
        }
        data.extend_from_slice(&empty);
        let over = data[start..].as_chunks_mut::<3>().0.chunks_mut(BLOCK);
        for (pixels, over) in row.chunks(BLOCK).zip(over) {
            let all = pixels.iter().fold(0, |all, pixel| all | u32::from_ne_bytes(*pixel));
            if all == 0 {
                continue;
            }
            for (&[red, green, blue, opacity], over) in pixels.iter().zip(over) {
                let (color, open) = ([red, green, blue], u32::from(255 - opacity));
                *over = match open {
                    0 => color,
                    255 => background,
                    _ => [0, 1, 2].map(|k| {
                        let behind = (u32::from(background[k]) * open + 127) / 255;
                        (u32::from(color[k]) + behind).min(255) as u8
                    }),
                };
            }
        }
    }
    data
}

/// The bytes of an image without a background: colours, and opacities.
fn uncovered(image: &Image) -> Vec<u8> {
    let mut data = Vec::with_capacity(4 * image.pixels.len());
    for &[red, green, blue, opacity] in &image.pixels {
        let whole = u32::from(opacity.max(1));
        let color = [red, green, blue];
        data.extend(color.map(|c| ((u32::from(c) * 255 + whole / 2) / whole).min(255) as u8));
        data.push(opacity);
    }
    data
}

/// The file of a page with this data, of three bytes a pixel, or four if there is no background.
pub(crate) fn file(page: &Page, title: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let [width, height] = page.pixels;
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(if page.background.is_some() { png::ColorType::Rgb } else { png::ColorType::Rgba });
    encoder.set_depth(png::BitDepth::Eight);
    // PNG's own texts are of another alphabet.
    let _ = encoder.add_itxt_chunk("Title".to_owned(), title.to_owned());
    // Writing to memory does not fail, and the sizes are right.
    let pixel = if page.background.is_some() { 3 } else { 4 };
    let rows = rows::compressed(data, width as usize * pixel, pixel);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_chunk(png::chunk::IDAT, &rows?)?;
        writer.finish()
    });
    debug_assert!(written.is_ok(), "{written:?}");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Picture;

    fn half(color: [u8; 3]) -> Image {
        let [red, green, blue] = color.map(|c| (u16::from(c) * 128 / 255) as u8);
        Image { width: 1, height: 1, pixels: vec![[red, green, blue, 128]] }
    }

    fn page(background: Option<Color>) -> Page {
        Page { picture: Picture { area: [0.0, 0.0, 1.0, 1.0], scale: 1.0 }, pixels: [1, 1], background }
    }

    fn pixel(bytes: &[u8]) -> Vec<u8> {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
        let mut data = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut data).expect("an image");
        data
    }

    #[test]
    fn images_cover_one_another_or_stand_side_by_side() {
        let (white, clear) = (page(Some(Color::hex(0xffffff))), page(None));
        let drawn = |page: &Page, meeting| {
            let mut canvas = Canvas::new(page);
            canvas.add(&half([255, 0, 0]), [0, 0], 1.0, meeting);
            canvas.add(&half([255, 0, 0]), [0, 0], 1.0, meeting);
            canvas.add(&half([255, 0, 0]), [5, -3], 1.0, meeting);
            pixel(&canvas.encode("ä & <b>"))
        };
        assert_eq!(drawn(&clear, Meeting::Beside), [255, 0, 0, 255]);
        assert_eq!(drawn(&clear, Meeting::Over)[3], 192);
        assert!(drawn(&white, Meeting::Over)[1].abs_diff(64) <= 1);
        assert_eq!(drawn(&white, Meeting::Beside), [255, 0, 0]);
        assert_eq!(pixel(&Canvas::new(&clear).encode("")), [0; 4]);
    }
}
