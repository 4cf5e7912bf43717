//! The sky behind a picture: in perspective by the elevation of what is seen, from the horizon up to the zenith; without perspective from the
//! lower edge of the picture to the upper one.

use super::{Fit, Page};
use dlsys_geometry::scene::{Color, Scene};

/// Sine of the elevation from which the sky has the colour of the zenith.
const ZENITH: f64 = 0.75;
/// The colour changes faster near the horizon: the exponent of the elevation.
const HAZE: f64 = 0.7;
/// Stops of the gradient of a vector picture.
const STOPS: usize = 24;

/// The sky of a frame on a page.
pub(super) struct Sky<'a> {
    fit: &'a Fit,
    page: &'a Page,
    zenith: Color,
    horizon: Color,
}

impl<'a> Sky<'a> {
    /// The sky of a frame; `None` if none is declared.
    pub(super) fn of(scene: &Scene, fit: &'a Fit, page: &'a Page) -> Option<Sky<'a>> {
        let [zenith, horizon] = fit.surroundings(scene).sky?;
        Some(Sky { fit, page, zenith, horizon })
    }

    /// Its colour at a part of the height of the page, from the upper edge.
    pub(super) fn color(&self, part: f64) -> Color {
        let [a, _, c] = self.page.placement();
        let row = part * f64::from(self.page.pixels[1]);
        let up = match self.fit.camera.elevation((c - row) / a) {
            Some(sine) => (sine / ZENITH).clamp(0.0, 1.0).powf(HAZE),
            None => 1.0 - part,
        };
        let mix = |low: u8, high: u8| (f64::from(low) + (f64::from(high) - f64::from(low)) * up + 0.5) as u8;
        Color {
            red: mix(self.horizon.red, self.zenith.red),
            green: mix(self.horizon.green, self.zenith.green),
            blue: mix(self.horizon.blue, self.zenith.blue),
        }
    }

    /// Parts of the height, from the upper edge, with the colours there; in between colours change evenly.
    pub(super) fn stops(&self) -> impl Iterator<Item = (f64, Color)> {
        (0..=STOPS).map(|i| i as f64 / STOPS as f64).map(|part| (part, self.color(part)))
    }
}
