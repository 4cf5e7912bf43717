//! Directions of view, by name or by azimuth and elevation.

use crate::Error;
use std::fmt;
use std::str::FromStr;

use dlsys_geometry::scene::{Point, Vector, sin_cos_degrees};

/// A direction of view; the projection is orthographic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Degrees from the front (`+Z`) towards the side (`+X`), in which the viewer stands.
    azimuth: f64,
    /// Degrees above the horizon, from -90 to 90.
    elevation: f64,
    right: Vector,
    up: Vector,
    towards: Vector,
}

impl View {
    /// From `+Z`: x to the right, y up.
    pub const FRONT: View = View {
        azimuth: 0.0,
        elevation: 0.0,
        right: Vector::new(1.0, 0.0, 0.0),
        up: Vector::new(0.0, 1.0, 0.0),
        towards: Vector::new(0.0, 0.0, 1.0),
    };

    /// The view of a viewer at this azimuth (degrees from the front towards the side) and elevation
    /// (degrees above the horizon).
    ///
    /// # Errors
    /// If the azimuth is not finite or the elevation not between -90 and 90.
    pub fn new(azimuth: f64, elevation: f64) -> Result<View, Error> {
        if !azimuth.is_finite() {
            return Err(Error::UnknownView(format!("{azimuth},{elevation}")));
        }
        if !(-90.0..=90.0).contains(&elevation) {
            return Err(Error::Elevation(elevation.to_string()));
        }
        let (sin_a, cos_a) = sin_cos_degrees(azimuth);
        let (sin_e, cos_e) = sin_cos_degrees(elevation);
        let towards = Vector::new(sin_a * cos_e, sin_e, cos_a * cos_e);
        let right = Vector::new(cos_a, 0.0, -sin_a);
        Ok(View { azimuth, elevation, right, up: towards.cross(&right), towards })
    }

    /// The view of a viewer that has gone round the axis y by this angle, in degrees.
    pub(super) fn turned(&self, degrees: f64) -> View {
        let (sin_a, cos_a) = sin_cos_degrees(self.azimuth + degrees);
        let level = self.up.y;
        let towards = Vector::new(sin_a * level, self.towards.y, cos_a * level);
        let right = Vector::new(cos_a, 0.0, -sin_a);
        View { azimuth: self.azimuth + degrees, right, up: towards.cross(&right), towards, ..*self }
    }

    /// True if the viewer looks down.
    pub fn is_from_above(&self) -> bool {
        self.elevation > 0.0
    }

    /// Sine and cosine of the elevation.
    pub(super) fn inclination(&self) -> (f64, f64) {
        (self.towards.y, self.up.y)
    }

    /// The unit vector towards the viewer.
    pub(super) fn towards(&self) -> Vector {
        self.towards
    }

    /// The direction in space that is to the right, up and towards the viewer by these lengths.
    pub(super) fn space(&self, v: Vector) -> Vector {
        self.right * v.x + self.up * v.y + self.towards * v.z
    }

    /// A point in the axes of the view: to the right, up, and towards the viewer; scene units.
    pub fn see(&self, p: Point) -> Point {
        Point::new(self.right.dot(&p.coords), self.up.dot(&p.coords), self.towards.dot(&p.coords))
    }
}

impl FromStr for View {
    type Err = Error;

    fn from_str(text: &str) -> Result<View, Error> {
        match text.trim() {
            "front" => Ok(View::FRONT),
            "side" => View::new(90.0, 0.0),
            "top" => View::new(0.0, 90.0),
            other => {
                let unknown = || Error::UnknownView(other.to_owned());
                let (azimuth, elevation) = other.split_once(',').ok_or_else(unknown)?;
                let number = |text: &str| text.trim().parse::<f64>().map_err(|_| unknown());
                View::new(number(azimuth)?, number(elevation)?)
            }
        }
    }
}

impl fmt::Display for View {
    /// The text from which the view can be parsed: `front`, `30,20`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.azimuth, self.elevation) {
            (0.0, 0.0) => write!(f, "front"),
            (90.0, 0.0) => write!(f, "side"),
            (0.0, 90.0) => write!(f, "top"),
            (azimuth, elevation) => write!(f, "{azimuth},{elevation}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_views_look_where_they_should() {
        let seen = |view: &str| view.parse::<View>().expect("a view").see(Point::new(1.0, 2.0, 3.0));
        assert_eq!(seen("front"), Point::new(1.0, 2.0, 3.0));
        assert_eq!(seen("side"), Point::new(-3.0, 2.0, 1.0));
        assert_eq!(seen("top"), Point::new(1.0, -3.0, 2.0));
        assert_eq!(seen("-90, 0"), Point::new(3.0, 2.0, -1.0));
    }

    #[test]
    fn views_are_orthonormal_and_print_as_they_parse() {
        for text in ["front", "side", "top", "30,20", "-135,-62.5", "400,90"] {
            let view: View = text.parse().expect("a view");
            assert_eq!(view.to_string(), text);
            assert!((view.right.cross(&view.up) - view.towards).norm() < 1e-15);
        }
    }

    #[test]
    fn what_is_no_view_is_an_error() {
        for text in ["", "back", "1", "1,2,3", "1,91", "nan,0", "inf,0", "0,nan"] {
            assert!(text.parse::<View>().is_err(), "{text}");
        }
    }
}
