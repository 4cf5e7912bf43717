//! Granular materials and their checked values.

use crate::Error;
use crate::error::check;

/// A granular material.
///
/// The named ones have the angles and the push of Sumner, O'Brien, Hodgins (*Animating Sand, Mud, and Snow*, 1999, table 1), and [`Soil::earth`] the
/// angle of Onoue, Nishita (*Virtual Sandbox*, 2003, section 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Soil {
    /// Angle of repose in degrees: steeper slopes slip.
    pub repose: f64,
    /// Angle of repose where bodies have compressed the material, in degrees; at least [`repose`](Self::repose).
    pub inner: f64,
    /// Part of what a body displaces that goes to its rim, 0 to 1; the rest is compressed.
    pub push: f64,
    /// Relative variation of the tangent of the angle of repose from place to place, 0 to 0.5.
    pub rough: f64,
    /// Mobility λ of slipping material, in m²/s.
    pub flow: f64,
    /// Cohesion c in kPa; 0: nothing is bonded.
    pub cohesion: f64,
    /// Specific weight γ in kN/m³. It matters for cohesive soil, and for bodies that the soil bears.
    pub weight: f64,
    /// The pressure that it holds below a body, in weights of the soil above ([`Soil::carries`]); 35 times the tangent of the angle of repose if nothing is said.
    pub bearing: Option<f64>,
    /// Relative growth of the volume of bonded soil when it comes loose, 0 to 1.
    pub swell: f64,
    /// Volume that an area of a body takes up where it touches the material, in m³/m²; 0: nothing sticks to bodies.
    pub stick: f64,
    /// Time constant in s with which bodies that have left the ground shed what sticks to them.
    pub shed: f64,
    /// Acceleration of a body in m/s² from which on it sheds all that is due; the less it is accelerated, the more it keeps ([`Soil::part_let_go`]). It sheds
    /// however it moves if nothing is said.
    pub hold: Option<f64>,
    /// The power with which what is let go follows the acceleration.
    pub exponent: f64,
    /// Diameter in m of the particles that leave bodies; a quarter of a column if nothing is said.
    pub grain: Option<f64>,
}

/// Mobility of a slipping material if nothing else is said, in m²/s.
const FLOW: f64 = 0.05;
/// Time constant of shedding if nothing else is said, in s.
const SHED: f64 = 0.1;
/// Steepest angle of repose, in degrees. Snow, which stands, has 1.57 rad.
const STEEPEST: f64 = 89.96;
/// Difference between the angle at which resting material begins to slip and the angle of repose, in degrees.
const START: f64 = 2.0;
/// Relative excess of a slope over that of repose at which material that slips comes to rest; 0.03° or less.
pub(crate) const REST: f64 = 1e-3;

impl Soil {
    /// Dry sand: 0.436 rad (25.0°), 0.8 rad (45.8°) where pressed; 0.3 of what is pressed goes to the rim.
    pub fn sand() -> Soil {
        Soil::of(0.436, 0.8, 0.3, 16.0)
    }

    /// Mud: 1.1 rad (63.0°), 1.57 rad where pressed; 0.41 of what is pressed goes to the rim.
    pub fn mud() -> Soil {
        // Soft mud of an undrained strength of 2 kPa holds nine times that (Skempton 1951), about five weights of what is above 0.2 m.
        Soil { bearing: Some(5.0), ..Soil::of(1.1, 1.57, 0.41, 18.0) }
    }

    /// Snow that stands at any slope up to 1.57 rad and is compressed only.
    pub fn snow() -> Soil {
        Soil::of(1.57, 1.57, 0.0, 3.0)
    }

    /// Loose soil: 5π/18 (50°); as sand otherwise.
    pub fn earth() -> Soil {
        let angle = 5.0 * std::f64::consts::PI / 18.0;
        Soil::of(angle, angle, 0.3, 18.0)
    }

    /// Angles are in radians here, as the papers print them.
    fn of(repose: f64, inner: f64, push: f64, weight: f64) -> Soil {
        let (repose, inner) = (repose.to_degrees(), inner.to_degrees());
        Soil {
            repose,
            inner,
            push,
            rough: 0.0,
            flow: FLOW,
            cohesion: 0.0,
            weight,
            bearing: None,
            swell: 0.0,
            stick: 0.0,
            shed: SHED,
            hold: None,
            exponent: 1.0,
            grain: None,
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let Soil { repose, inner, push, rough, flow, cohesion, weight, bearing, swell, stick, shed, .. } =
            *self;
        check("an angle of repose (°)", repose, repose > 0.1 && repose <= STEEPEST, "0.1 to 89.96")?;
        let steeper = inner >= repose && inner <= STEEPEST;
        check("an inner angle of repose (°)", inner, steeper, "the angle of repose to 89.96")?;
        check("a part that goes to the rim", push, (0.0..=1.0).contains(&push), "0 to 1")?;
        check("a roughness", rough, (0.0..=0.5).contains(&rough), "0 to 0.5")?;
        check("a flow (m²/s)", flow, (1e-6..=1e3).contains(&flow), "1e-6 to 1000")?;
        check("a cohesion (kPa)", cohesion, (0.0..=1e4).contains(&cohesion), "0 to 10,000")?;
        check("a weight (kN/m³)", weight, weight > 0.0 && weight <= 1e3, "more than 0, at most 1000")?;
        let bearing = bearing.unwrap_or(0.0);
        check("a bearing", bearing, (0.0..=1e4).contains(&bearing), "0 to 10,000")?;
        check("a swelling", swell, (0.0..=1.0).contains(&swell), "0 to 1")?;
        check("what sticks to an area (m)", stick, (0.0..=1.0).contains(&stick), "0 to 1")?;
        check("a time constant of shedding (s)", shed, (1e-6..=1e6).contains(&shed), "1e-6 to 1e6")?;
        let hold = self.hold.unwrap_or(1.0);
        let most = "more than 0, at most 1e6";
        check("an acceleration that sheds all (m/s²)", hold, hold > 0.0 && hold <= 1e6, most)?;
        let exponent = self.exponent;
        let most = "more than 0, at most 100";
        check("an exponent of what is shed", exponent, exponent > 0.0 && exponent <= 100.0, most)?;
        let grain = self.grain.unwrap_or(1.0);
        check("a diameter of particles (m)", grain, (1e-6..=1e3).contains(&grain), "1e-6 to 1000")
    }

    /// The part of what a body sheds that it lets go with an acceleration a in m/s²: (a/`hold`)^`exponent`, at most 1, and always 1 without `hold` (Sumner, O'Brien,
    /// Hodgins, section 3.2, where it is the probability of a particle). The other part stays.
    pub fn part_let_go(&self, acceleration: f64) -> f64 {
        self.hold.map_or(1.0, |hold| libm::pow(acceleration / hold, self.exponent).min(1.0))
    }

    /// Tangent of the angle of repose.
    pub fn slope(&self) -> f64 {
        libm::tan(self.repose.to_radians())
    }

    /// Tangent of the angle of repose where bodies have compressed the material.
    pub fn inner_slope(&self) -> f64 {
        libm::tan(self.inner.to_radians())
    }

    /// Ratio of the slope at which resting material begins to slip to that of repose.
    pub(crate) fn start(&self) -> f64 {
        let angle = (self.repose + START).min((self.repose + 90.0) / 2.0);
        (libm::tan(angle.to_radians()) / self.slope()).max(1.0 + REST)
    }
}
