//! The page that a picture is drawn on: its area, its size in pixels, its background.

use super::{Error, Picture};
use dlsys_geometry::scene::Color;

/// Size of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// The larger side; the other one follows from the shape of the picture.
    Larger(u32),
    /// The width; the height follows.
    Width(u32),
    /// Both; a picture of another shape gets more background.
    Exact(u32, u32),
}

impl Default for Size {
    fn default() -> Size {
        Size::Larger(1000)
    }
}

/// The page that a picture is drawn on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Page {
    /// The area of the scene that it shows.
    pub picture: Picture,
    /// Width and height.
    pub pixels: [u32; 2],
    /// `None`: nothing, the picture is transparent.
    pub background: Option<Color>,
}

impl Page {
    /// A warm white.
    pub const BACKGROUND: Color = Color::hex(0xfbfaf5);
    /// Most pixels on a side.
    pub const MOST_ON_A_SIDE: u32 = 20_000;
    /// Most pixels in all.
    pub const MOST_PIXELS: u64 = 50_000_000;

    /// A page for a picture. Sides that are not given are even, as video encoders require.
    ///
    /// # Errors
    /// If a side is 0 or there are too many pixels.
    pub fn new(picture: Picture, size: Size, background: Option<Color>) -> Result<Page, Error> {
        let [_, _, width, height] = picture.area;
        let (picture, pixels) = match size {
            Size::Larger(n) => (picture, within(picture, n)),
            Size::Width(w) => (picture, [w, even(f64::from(w) * height / width)]),
            Size::Exact(w, h) => (picture.shaped(f64::from(w.max(1)) / f64::from(h.max(1))), [w, h]),
        };
        let [width, height] = pixels;
        let fits = |side: u32| (1..=Page::MOST_ON_A_SIDE).contains(&side);
        if !fits(width) || !fits(height) || u64::from(width) * u64::from(height) > Page::MOST_PIXELS {
            return Err(Error::PageTooLarge { width, height });
        }
        Ok(Page { picture, pixels, background })
    }

    /// A page of the usual size and background.
    pub fn usual(picture: Picture) -> Page {
        Page { picture, pixels: within(picture, 1000), background: Some(Page::BACKGROUND) }
    }

    /// Pixels in a scene unit of the plane of focus.
    pub fn pixels_per_unit(&self) -> f64 {
        self.placement()[0]
    }

    /// The map from the picture to the page, as `[a, b, c]`: a point is at `[ax + b, c - ay]` pixels from the upper left corner.
    /// The picture is in the middle where rounding has left the page another shape.
    pub(super) fn placement(&self) -> [f64; 3] {
        let [left, bottom, width, height] = self.picture.area;
        let [w, h] = self.pixels.map(f64::from);
        let scale = (w / width).min(h / height);
        [scale, w / 2.0 - scale * (left + width / 2.0), h / 2.0 + scale * (bottom + height / 2.0)]
    }
}

/// An even number of pixels, at least 2. A float beyond the greatest integer becomes that.
fn even(x: f64) -> u32 {
    (2.0 * (x / 2.0).round()).max(2.0) as u32
}

/// Width and height if the larger one is `side`.
fn within(picture: Picture, side: u32) -> [u32; 2] {
    let [_, _, width, height] = picture.area;
    [width, height].map(|length| even(f64::from(side) * length / width.max(height)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_have_the_shape_of_their_picture_or_make_it_theirs() {
        let picture = Picture { area: [0.0, 0.0, 2.0, 1.0], scale: 100.0 };
        let page = |size| Page::new(picture, size, None);
        let pixels = |size| page(size).expect("small").pixels;
        assert_eq!(pixels(Size::default()), [1000, 500]);
        assert_eq!(pixels(Size::Width(301)), [301, 150]);
        let square = page(Size::Exact(50, 50)).expect("small");
        assert_eq!((square.pixels, square.picture.area), ([50, 50], [0.0, -0.5, 2.0, 2.0]));
        assert_eq!(square.placement(), [25.0, 0.0, 37.5]);
        assert_eq!(
            page(Size::Exact(20_000, 10_000)).unwrap_err().to_string(),
            "a picture of 20000 x 10000 pixels is too large; at most 20000 on a side and 50 million in all"
        );
        assert!(page(Size::Exact(0, 5)).is_err() && page(Size::Width(u32::MAX)).is_err());
    }
}
