//! The light on a frame: the lamp of [`Light`](super::Light), or a declared sun and sky with shadows; and the floor.
//!
//! Light has one strength at each place, from which its colour follows: what is dark is in the light of the sky, what is bright in that of the
//! sun. So pictures of pixels and of regions have the same shading.

use super::casters::Casters;
use super::floor::Fading;
use super::haze::{self, Haze};
use super::lens::Lens;
use super::light::{GLOSS, Light, SHARPNESS, Spot, TRANSMITTED};
use super::shadow::{Fineness, Maps, OpenSky, thrown};
use super::{Camera, Fit, Page, floor, light};
use dlsys_geometry::scene::{Color, MaterialId, Point, Scene, Surroundings, Vector};

/// Strengths of light on what is fully exposed to it: the sky's beside a sun and alone, the sun's, and what the ground throws back.
const SKY: f64 = 0.56;
const SKY_ALONE: f64 = 1.25;
const SUN: f64 = 0.66;
const GROUND: f64 = 0.26;
/// The colours of zenith and horizon beside a sun, if the model declares none.
const CLEAR: [Color; 2] = [Color::hex(0xb4cdf0), Color::hex(0xf2efe8)];
/// How much darker the floor is where no sky is seen, if there is neither sun nor sky.
const CONTACT: f64 = 0.5;
/// How much darker the floor is around the plant than far away, and how far that reaches in parts of the extent.
const POOL: f64 = 0.06;
const POOL_REACH: f64 = 1.2;
/// The colour of bare ground, and its part beside the haze of the horizon in the floor under a declared sky.
const EARTH: Color = Color::hex(0xa99a78);
const EARTHY: f64 = 0.6;
/// How much of the sky's tint is seen where only the sky lights: what stands around throws warmer light there.
const TINTED: f64 = 0.5;
/// Strengths between which the colour of light changes from the sky's to the sun's.
const COOL: f64 = 0.35;
const WARM: f64 = 0.85;

/// Plants out of the picture darken the sky for what is nearer than so many of their radii.
const NEIGHBOURHOOD: f64 = 3.0;

/// Whether the shadow of a ball in the sun, down to the floor, may be seen; without a floor it has no end.
fn is_shadow_seen(
    lens: &Lens,
    (middle, radius): (Point, f64),
    sun: Option<Vector>,
    floor: Option<f64>,
) -> bool {
    let Some(sun) = sun else { return false };
    let Some(floor) = floor.filter(|_| sun.y > 0.0) else { return true };
    let length = ((middle.y + radius - floor) / sun.y).max(0.0);
    !lens.misses(middle - sun * (length / 2.0), radius + length / 2.0)
}

/// A declared light.
struct Declared {
    /// Unit vector towards the sun.
    sun: Option<Vector>,
    sky: f64,
    /// Tint of what only the sky lights.
    tint: [f64; 3],
}

/// The light on one frame.
pub(super) struct Lighting<'a> {
    fit: &'a Fit,
    declared: Option<Declared>,
    maps: Option<Maps>,
    floor: Option<f64>,
    open_sky: Option<OpenSky>,
    /// The middle of what the floor is darker around, and its extent.
    pool: (Vector, f64),
    /// The colour of the floor, if it has one of its own.
    ground: Option<Color>,
    fading: Option<Fading>,
    haze: Option<Haze>,
}

impl<'a> Lighting<'a> {
    /// The light on a scene. Shadows are as fine as a picture with so many pixels for a scene unit shows.
    /// A floor among the polygons has the material `ground`. Through a lens, plants count if they or their shadows are seen, or are near to what is.
    pub(super) fn new(
        scene: &Scene,
        fit: &'a Fit,
        scale: f64,
        threads: usize,
        ground: Option<MaterialId>,
        lens: Option<&Lens>,
    ) -> Lighting<'a> {
        let around = fit.surroundings(scene);
        let is_declared = (around.sun.is_some() || around.sky.is_some()) && !fit.light.is_flat();
        let sun = around.sun.and_then(|sun| sun.try_normalize(0.0)).filter(|_| is_declared);
        let declared = is_declared.then(|| {
            let [zenith, horizon] = around.sky.unwrap_or(CLEAR).map(Color::channels);
            let mean = [0, 1, 2].map(|k| 0.6 * zenith[k] + 0.4 * horizon[k]);
            let most = mean.into_iter().fold(1e-3, f64::max);
            let sky = if sun.is_some() { SKY } else { SKY_ALONE };
            Declared { sun, sky, tint: mean.map(|c| c / most) }
        });
        let floor = around.floor.filter(|_| !fit.light.is_flat());
        let (middle, extent) = fit.middle();
        let (mut open_sky, mut pool) = (None, (middle.coords, extent));
        let maps = (declared.is_some() || floor.is_some()).then(|| {
            let larger = lens.map_or(f64::INFINITY, |lens| lens.size[0].max(lens.size[1]) as f64);
            // Soil is a surface on which the edges of single maps would be seen.
            let fineness = Fineness::of(if scene.terrain.is_some() { f64::INFINITY } else { larger });
            // Details beyond the maps' cells cast no shadows of their own.
            let seen = |p| fit.camera.ahead(p).map_or(0.0, |p| scale * fit.camera.magnification(p.z));
            let counts = |middle: Point, radius: f64| {
                lens.is_none_or(|lens| !lens.misses(middle, NEIGHBOURHOOD * radius))
                    || lens.is_none_or(|lens| is_shadow_seen(lens, (middle, radius), sun, floor))
            };
            let casters = Casters::new(scene, fit, scale.min(1500.0 / extent), seen, ground, counts, threads);
            if fit.is_aimed() && casters.count() > 0 {
                let [middle, half] = casters.core();
                pool = (middle, (2.0 * half.amax()).max(f64::MIN_POSITIVE));
            }
            let maps = (casters.count() > 0).then(|| Maps::new(&casters, sun, scale, fineness, threads))?;
            open_sky = floor.map(|height| OpenSky::new(&maps, casters.around(), height, fineness, threads));
            Some(maps)
        });
        let ground = floor_color(&around);
        let fading = floor.filter(|_| ground.is_some()).and_then(|height| Fading::new(fit, height));
        let maps = maps.flatten();
        let visible = |at: &Vector| match (&maps, sun) {
            (Some(maps), Some(sun)) => maps.sun(*at, sun),
            _ => 1.0,
        };
        let around = haze::Around {
            sun,
            tint: declared.as_ref().map(|declared| declared.tint),
            is_flat: fit.light.is_flat(),
            visible: &visible,
        };
        let haze = Haze::new(scene, fit.camera, &around, threads);
        Lighting { fit, declared, maps, floor, open_sky, pool, ground, fading, haze }
    }

    /// How the floor fades into the horizon, if it does.
    pub(super) fn fading(&self) -> Option<&Fading> {
        self.fading.as_ref()
    }

    /// The gases in front of what is seen.
    pub(super) fn haze(&self) -> Option<&Haze> {
        self.haze.as_ref()
    }

    /// The part of the sun's light that comes to a point on a surface whose lit side has this normal, past plants and through gases.
    fn sunlight(&self, at: Vector, normal: Vector, sun: Vector) -> f64 {
        let past = self.maps.as_ref().map_or(1.0, |maps| maps.sun(at, normal));
        match &self.haze {
            Some(haze) if past > 0.0 => past * haze.sunlight(at, sun),
            _ => past,
        }
    }

    /// Strength of light at a place; 1 leaves a colour as it is.
    pub(super) fn strength(&self, spot: &Spot) -> f64 {
        let Some(declared) = &self.declared else { return self.fit.light.strength_at(spot) };
        let view = self.fit.camera.view();
        let at = self.fit.camera.unproject(spot.seen).coords;
        let normal = view.space(spot.normal);
        let sky = |normal: Vector| match &self.maps {
            Some(maps) => maps.sky(at, normal),
            None => 0.5 + 0.5 * normal.y,
        };
        let mut from_sky = sky(normal);
        if spot.is_thin {
            from_sky += (sky(-normal) - from_sky).max(0.0) * TRANSMITTED;
        }
        let mut strength = declared.sky * from_sky + GROUND * (0.5 - 0.5 * normal.y) + 0.04;
        if let Some(sun) = declared.sun {
            let cos = normal.dot(&sun);
            let part = if spot.is_thin && cos < 0.0 { -cos * TRANSMITTED } else { cos.max(0.0) };
            if part > 0.0 {
                let lit_side = if cos < 0.0 { -normal } else { normal };
                let visible = self.sunlight(at, lit_side, sun);
                let half = (sun + view.towards()).try_normalize(1e-9).unwrap_or(sun);
                let gloss = if cos > 0.0 { normal.dot(&half).max(0.0).powi(SHARPNESS) * GLOSS } else { 0.0 };
                strength += visible * (SUN * part + gloss);
            }
        }
        // As the drawing gains depth.
        let relief = self.fit.light.relief();
        1.0 + relief * (strength - 1.0)
    }

    /// The camera that sees it.
    pub(super) fn camera(&self) -> &Camera {
        &self.fit.camera
    }

    /// The default lamp, unless another light is declared.
    pub(super) fn lamp(&self) -> Option<&Light> {
        self.declared.is_none().then_some(&self.fit.light)
    }

    /// Whether the light is a declared one, which casts shadows.
    pub(super) fn is_declared(&self) -> bool {
        self.declared.is_some()
    }

    /// Strengths of light across a stem of this radius at a place on its axis, as [`Light::across`](super::Light::across).
    pub(super) fn across<const N: usize>(
        &self,
        directions: [Vector; 2],
        (seen, radius): (Point, f64),
        places: [f64; N],
    ) -> [f64; N] {
        match self.declared {
            None => self.fit.light.across(directions, seen.z, places),
            Some(_) => light::normals_across(directions, places)
                .map(|normal| self.strength(&Spot { normal, seen: seen + normal * radius, is_thin: false })),
        }
    }

    /// A colour in light of this strength.
    pub(super) fn color(&self, color: Color, strength: f64) -> Color {
        let Some(declared) = &self.declared else { return color.lit(strength) };
        let warm = 1.0 - TINTED * (1.0 - ((strength - COOL) / (WARM - COOL)).clamp(0.0, 1.0));
        let [red, green, blue] = [0, 1, 2].map(|k| declared.tint[k] + (1.0 - declared.tint[k]) * warm);
        let tinted = |c: u8, by: f64| (f64::from(c) * by + 0.5) as u8;
        Color {
            red: tinted(color.red, red),
            green: tinted(color.green, green),
            blue: tinted(color.blue, blue),
        }
        .lit(strength)
    }

    /// The normal of the floor, if there is one.
    pub(super) fn floor_normal(&self) -> Option<Vector> {
        self.floor.map(|_| Vector::y())
    }

    /// The corners of what is seen of the floor.
    pub(super) fn floor_outline(&self, lens: &Lens) -> Vec<Point> {
        self.floor.map_or_else(Vec::new, |height| floor::outline(self.fit, height, lens))
    }

    /// Strength of light on the floor, beside that on an open floor far away.
    pub(super) fn floor_strength(&self, seen: Point) -> f64 {
        let at = self.fit.camera.unproject(seen).coords;
        let (centre, extent) = self.pool;
        let away = ((at.x - centre.x).hypot(at.z - centre.z) / (POOL_REACH * extent)).powi(2);
        let pool = 1.0 - POOL * (-away).exp();
        let sky = self.open_sky.as_ref().map_or(1.0, |open_sky| open_sky.at(at));
        let light = match &self.declared {
            None => 1.0 - CONTACT * (1.0 - sky),
            Some(declared) => {
                let (mut here, mut open) = (declared.sky * thrown(sky) + 0.04, declared.sky + 0.04);
                if let Some(sun) = declared.sun.filter(|sun| sun.y > 0.0) {
                    here += SUN * sun.y * self.sunlight(at, Vector::y(), sun);
                    open += SUN * sun.y;
                }
                here / open
            }
        };
        match self.fit.shaded {
            None => pool * light.min(1.0),
            Some(rim) => 1.0 - (1.0 - light.min(1.0)) * inside(rim, seen),
        }
    }

    /// The floor where it is seen: times its opacity, and the opacity. Without a sky it is as light as the background.
    pub(super) fn floor_color(&self, seen: Point) -> [u8; 4] {
        let strength = self.floor_strength(seen);
        match self.ground {
            Some(ground) => {
                let Color { red, green, blue } = self.color(ground, strength);
                let left = self.fading.map_or(1.0, |fading| fading.left(self.fit.camera.unproject(seen)));
                [red, green, blue, 255].map(|c| (f64::from(c) * left + 0.5) as u8)
            }
            None => {
                let opacity = (1.0 - strength) * 255.0;
                let Color { red, green, blue } = Color::hex(0xffffff).lit(0.0);
                let part = |c: u8| (f64::from(c) / 255.0 * opacity + 0.5) as u8;
                [part(red), part(green), part(blue), (opacity + 0.5) as u8]
            }
        }
    }

    /// The floor in light of this strength, before a background.
    pub(super) fn floor_over(&self, background: Option<Color>, strength: f64) -> Color {
        match self.ground {
            Some(ground) => self.color(ground, strength),
            None => background.unwrap_or(Page::BACKGROUND).lit(strength),
        }
    }
}

/// 1 well within a rectangle, and 0 on its rim and beyond.
fn inside([left, bottom, right, top]: [f64; 4], at: Point) -> f64 {
    const RIM: f64 = 0.12;
    let room = (at.x - left).min(right - at.x).min(at.y - bottom).min(top - at.y);
    let part = (room / (RIM * (right - left).min(top - bottom))).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// The colour of a floor in full light: the declared one, or that of earth under a declared sky; `None`: that of the background.
pub(super) fn floor_color(around: &Surroundings) -> Option<Color> {
    around.floor_color.or(around.sky.map(|[_, horizon]| between(horizon, EARTH, EARTHY)))
}

/// A colour between two.
fn between(from: Color, to: Color, part: f64) -> Color {
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * part + 0.5) as u8;
    Color { red: mix(from.red, to.red), green: mix(from.green, to.green), blue: mix(from.blue, to.blue) }
}
