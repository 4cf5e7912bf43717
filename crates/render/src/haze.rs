//! Gases in a picture: blobs in the light, in front of what is seen in each pixel.
//!
//! A ray adds up the light of the gas front to back as far as the surface that is seen; samples of a pixel that show different surfaces have rays of
//! different lengths. Gas shades itself, and is in the shadow of the plant; its own shadow falls on the plant and on the floor where a sun is declared.

use dlsys_gas::{self as gas, Light, Look, Ray, Smoke, Span};
use dlsys_geometry::scene::{Gas, Point, Scene, Vector};

use super::Camera;
use super::light::LAMP;

/// Distance in standard deviations at which a blob ends: a three-thousandth of its optical depth is beyond.
const REACH: f64 = 4.0;
/// Strengths of light on gas: from all sides and from the sun, if a sun is declared; from a sky alone; in a plain drawing from all sides and from the
/// lamp.
const SKY: f64 = 0.5;
const SUN: f64 = 0.6;
const SKY_ALONE: f64 = 1.0;
const AROUND: f64 = 0.6;
const LAMPLIGHT: f64 = 0.45;

/// The light that falls on gases.
pub(super) struct Around<'a> {
    /// Unit vector towards a declared sun.
    pub(super) sun: Option<Vector>,
    /// Tint of the light of a declared sky, or of the usual one beside a sun; `None` if the light is the default lamp.
    pub(super) tint: Option<[f64; 3]>,
    /// The drawing is flat: light has no direction.
    pub(super) is_flat: bool,
    /// The part of the sun's light that comes past the plant to a place.
    pub(super) visible: &'a (dyn Fn(&Vector) -> f64 + Sync),
}

/// The gases of a scene in light.
pub(super) struct Haze {
    smoke: Smoke,
    camera: Camera,
    /// A ball around all blobs.
    centre: Point,
    radius: f64,
}

impl Haze {
    /// `None` without blobs.
    pub(super) fn new(scene: &Scene, camera: Camera, around: &Around<'_>, threads: usize) -> Option<Haze> {
        let blobs = || scene.gases.iter().flat_map(|gas| &gas.blobs);
        let first = blobs().next()?.centre;
        let (low, high) = blobs().fold((first, first), |(low, high), blob| {
            let reach = Vector::repeat(REACH * blob.deviation);
            (low.inf(&(blob.centre - reach)), high.sup(&(blob.centre + reach)))
        });
        let mut lights = Vec::new();
        match (around.sun, around.tint) {
            (Some(towards), tint) => {
                let tint = tint.unwrap_or([1.0; 3]);
                lights.push(Light::Ambient(tint.map(|c| c * SKY)));
                lights.push(Light::Distant { towards, colour: [SUN; 3] });
            }
            (None, Some(tint)) => lights.push(Light::Ambient(tint.map(|c| c * SKY_ALONE))),
            (None, None) if around.is_flat => lights.push(Light::Ambient([1.0; 3])),
            (None, None) => {
                let towards = camera.view().space(LAMP).normalize();
                lights.push(Light::Ambient([AROUND; 3]));
                lights.push(Light::Distant { towards, colour: [LAMPLIGHT; 3] });
            }
        }
        let gases = scene.gases.iter().map(|gas| (look(gas), gas.blobs.iter().map(blob(gas)).collect()));
        // Values have been checked where the model was read; a scene made by hand with others shows no gas.
        let smoke = Smoke::of(gases.collect(), REACH).ok()?;
        let smoke = smoke.lit_among(&lights, around.visible, threads).ok()?;
        let (centre, radius) = (nalgebra::center(&low, &high), (high - low).norm() / 2.0);
        Some(Haze { smoke, camera, centre, radius })
    }

    /// The ray of sight through a point of the picture, as the camera projects it.
    fn ray(&self, seen: Point) -> Option<Ray> {
        let focus = self.camera.unproject(Point::new(seen.x, seen.y, 0.0));
        let origin = self.camera.eye().unwrap_or_else(|| {
            let away = (focus - self.centre).norm() + self.radius;
            focus + self.camera.view().towards() * away
        });
        Ray::new(origin.coords, focus - origin).ok()
    }

    /// True if a ray passes all blobs.
    fn misses(&self, ray: &Ray) -> bool {
        let aside = self.centre.coords - ray.origin;
        let along = aside.dot(&ray.direction);
        (aside - ray.direction * along).norm_squared() > self.radius * self.radius || along < -self.radius
    }

    /// What the gas does in front of a point of the picture, as the camera projects it, on a surface or far away.
    pub(super) fn through(&self, seen: Point, is_surface: bool) -> Through {
        let Some(ray) = self.ray(seen).filter(|ray| !self.misses(ray)) else { return Through::CLEAR };
        let to = match is_surface {
            true => (self.camera.unproject(seen).coords - ray.origin).dot(&ray.direction),
            false => f64::INFINITY,
        };
        let (light, passing) = self.smoke.light(&ray, Span { from: 0.0, to });
        Through { light, passing }
    }

    /// The middle of each blob, its standard deviation, and the radius at which it ends.
    pub(super) fn balls(&self) -> impl Iterator<Item = (Point, f64, f64)> {
        self.smoke.blobs().map(|blob| {
            let deviation = blob.variance.sqrt();
            (Point::from(blob.centre), deviation, REACH * deviation)
        })
    }

    /// What each blob of the scene scatters and emits where it lets no light through, by channel, gas by gas.
    pub(super) fn colours(&self) -> Vec<[f64; 3]> {
        self.smoke.colours()
    }

    /// The part of the sun's light that comes through the gas to a place.
    pub(super) fn sunlight(&self, at: Vector, towards: Vector) -> f64 {
        let ray = Ray { origin: at, direction: towards };
        if self.misses(&ray) { 1.0 } else { self.smoke.transmittance(&ray, Span::ALL) }
    }
}

/// What gas does to what is seen through it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Through {
    /// Light that comes from the gas, by channel.
    light: [f64; 3],
    /// The part of the light that passes from behind it.
    passing: f64,
}

impl Through {
    /// Of no gas.
    const CLEAR: Through = Through { light: [0.0; 3], passing: 1.0 };
    /// The beginning of a sum.
    pub(super) const NOTHING: Through = Through { light: [0.0; 3], passing: 0.0 };

    /// Adds another one, times a weight.
    pub(super) fn add(&mut self, other: &Through, weight: f64) {
        self.light.iter_mut().zip(other.light).for_each(|(sum, light)| *sum += weight * light);
        self.passing += weight * other.passing;
    }

    /// The same where a sum has left the bounds.
    pub(super) fn within_bounds(self) -> Through {
        Through { light: self.light.map(|light| light.max(0.0)), passing: self.passing.clamp(0.0, 1.0) }
    }

    /// The largest difference of a channel or of what passes.
    pub(super) fn distance(&self, other: &Through) -> f64 {
        let lights = self.light.iter().zip(other.light).map(|(a, b)| (a - b).abs());
        lights.fold((self.passing - other.passing).abs(), f64::max)
    }

    /// A colour, times its opacity, and its opacity, behind the gas.
    pub(super) fn over(&self, behind: [u8; 4]) -> [u8; 4] {
        let Through { light, passing } = self;
        let channel = |behind: u8, light: f64| 255.0 * light + passing * f64::from(behind);
        let [red, green, blue, opacity] = behind;
        let colors = [channel(red, light[0]), channel(green, light[1]), channel(blue, light[2])];
        // What glows and hides nothing still needs an opacity in a picture.
        let least = colors.into_iter().fold(0.0, f64::max);
        let opacity = channel(opacity, 1.0 - passing).max(least);
        let [red, green, blue] = colors;
        [red, green, blue, opacity].map(|value| (value.clamp(0.0, 255.0) + 0.5) as u8)
    }
}

/// The optical properties of a gas, whose blobs have masses in areas.
fn look(gas: &Gas) -> Look {
    let color = gas.color.channels();
    Look { extinction: 1.0, albedo: color.map(|c| c * gas.albedo), glow: color.map(|c| c * gas.glow) }
}

fn blob(gas: &Gas) -> impl Fn(&dlsys_geometry::scene::Blob) -> gas::Blob {
    let area = gas.area;
    move |blob| gas::Blob {
        centre: blob.centre.coords,
        variance: blob.deviation * blob.deviation,
        mass: area * blob.mass,
    }
}
