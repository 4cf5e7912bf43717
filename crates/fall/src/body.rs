//! Bodies: mass, size, and the points by which they touch the ground.

use crate::error::check;
use crate::{Air, Error, Vector};

/// How the air acts on a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A thin plate: its third axis is the normal. It has lift and the inertia of the air at its side.
    Plate,
    /// A compact body: drag against its motion through the air.
    Lump,
}

/// A small ball, fixed to a body, that touches the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Its centre in the body's axes, in m.
    pub point: Vector,
    /// Its radius in m; may be 0.
    pub radius: f64,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// How the air acts on it.
    pub shape: Shape,
    /// Mass in kg.
    pub mass: f64,
    /// Half-extents along its axes, in m: those of an ellipse or ellipsoid with the same moments of inertia. The third one of a plate is half its
    /// thickness, which may be 0.
    pub half: [f64; 3],
    /// Area of a plate, or the area that a lump shows on average, in m².
    pub area: f64,
    /// Volume of air that it displaces, in m³; that of a plate is taken as 0.
    pub volume: f64,
    /// The points by which it touches the ground; at most 64.
    pub contacts: Vec<Contact>,
}

/// Largest number of contacts.
const CONTACTS: usize = 64;

impl Body {
    /// A thin elliptic plate with a mass (kg) and two half-axes (m). It touches the ground with eight points of its rim.
    ///
    /// # Errors
    ///
    /// A mass or a half-axis that is not above 0.
    pub fn plate(mass: f64, half: [f64; 2]) -> Result<Body, Error> {
        let rim = |k: usize| {
            let angle = std::f64::consts::FRAC_PI_4 * k as f64;
            let point = Vector::new(half[0] * libm::cos(angle), half[1] * libm::sin(angle), 0.0);
            Contact { point, radius: 0.0 }
        };
        let body = Body {
            shape: Shape::Plate,
            mass,
            half: [half[0], half[1], 0.0],
            area: std::f64::consts::PI * half[0] * half[1],
            volume: 0.0,
            contacts: (0..8).map(rim).collect(),
        };
        body.check().map(|()| body)
    }

    /// A ball with a mass (kg) and a radius (m).
    ///
    /// # Errors
    ///
    /// A mass or a radius that is not above 0.
    pub fn ball(mass: f64, radius: f64) -> Result<Body, Error> {
        let contacts = vec![Contact { point: Vector::zeros(), radius }];
        Ok(Body { contacts, ..Body::lump(mass, [radius; 3])? })
    }

    /// An ellipsoid with a mass (kg) and half-axes (m). It touches the ground with fourteen points of its surface.
    ///
    /// # Errors
    ///
    /// A mass or a half-axis that is not above 0.
    pub fn lump(mass: f64, half: [f64; 3]) -> Result<Body, Error> {
        let mut contacts = Vec::new();
        let diagonal = 1.0 / libm::sqrt(3.0);
        for sign in [-1.0, 1.0] {
            for axis in 0..3 {
                let mut point = Vector::zeros();
                point[axis] = sign * half[axis];
                contacts.push(Contact { point, radius: 0.0 });
            }
            for (y, z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let point = Vector::new(sign * half[0], y * half[1], z * half[2]) * diagonal;
                contacts.push(Contact { point, radius: 0.0 });
            }
        }
        // The mean of the three views along the axes.
        let area = std::f64::consts::PI * (half[0] * half[1] + half[1] * half[2] + half[2] * half[0]) / 3.0;
        let volume = 4.0 / 3.0 * std::f64::consts::PI * half.into_iter().product::<f64>();
        let body = Body { shape: Shape::Lump, mass, half, area, volume, contacts };
        body.check().map(|()| body)
    }

    /// The same with other contacts.
    ///
    /// # Errors
    ///
    /// More than 64 contacts, or one that is not finite or has a negative radius.
    pub fn touching(mut self, contacts: Vec<Contact>) -> Result<Body, Error> {
        self.contacts = contacts;
        self.check().map(|()| self)
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check("a mass (kg)", self.mass, self.mass > 0.0, "more than 0")?;
        check("an area (m²)", self.area, self.area > 0.0, "more than 0")?;
        check("a volume (m³)", self.volume, self.volume >= 0.0, "0 or more")?;
        for (axis, half) in self.half.into_iter().enumerate() {
            let thin = self.shape == Shape::Plate && axis == 2;
            let expected = if thin { "0 or more" } else { "more than 0" };
            check("a half-extent (m)", half, half > 0.0 || thin && half == 0.0, expected)?;
        }
        let count = self.contacts.len();
        check("a number of contacts", count as f64, count <= CONTACTS, "at most 64")?;
        for Contact { point, radius } in &self.contacts {
            check("a radius of a contact (m)", *radius, *radius >= 0.0, "0 or more")?;
            for value in point.iter() {
                check("a coordinate of a contact (m)", *value, true, "a finite number")?;
            }
        }
        Ok(())
    }

    /// Largest half-extent, in m.
    pub fn size(&self) -> f64 {
        self.half.into_iter().fold(0.0, f64::max)
    }

    /// Largest distance of a contact, or of an end of a half-axis, from the centre, in m.
    pub fn reach(&self) -> f64 {
        self.contacts.iter().map(|contact| contact.point.norm() + contact.radius).fold(self.size(), f64::max)
    }

    /// Half the chord: the shorter half-axis of a plate, in m.
    pub fn half_chord(&self) -> f64 {
        self.half[0].min(self.half[1])
    }

    /// Mass less that of the air in its place, in kg.
    pub fn heaviness(&self, air: &Air) -> f64 {
        self.mass - air.density * self.volume
    }

    /// Speed in m/s at which weight and drag are equal: of a plate broadside on.
    pub fn terminal_speed(&self, air: &Air) -> f64 {
        let coefficient = match self.shape {
            Shape::Plate => air.broadside,
            Shape::Lump => air.lump,
        };
        let weight = self.heaviness(air).abs() * air.gravity;
        libm::sqrt(2.0 * weight / (air.density * coefficient * self.area))
    }

    /// The mass ratio I* = m/(π ρ a² s) of Andersen, Pesavento and Wang, with half the chord a and the span s = area/2a. Plates flutter below
    /// about 1 and tumble above.
    pub fn mass_ratio(&self, air: &Air) -> f64 {
        2.0 * self.mass / (std::f64::consts::PI * air.density * self.half_chord() * self.area)
    }

    /// Moments of inertia about its axes, in kg m².
    pub fn inertia(&self) -> Vector {
        let [a, b, c] = self.half.map(|half| half * half);
        let share = match self.shape {
            Shape::Plate => 4.0,
            Shape::Lump => 5.0,
        };
        Vector::new(b + c, a + c, a + b) * (self.mass / share)
    }
}
