//! Materials and the palette: names and colours of everything that is drawn.
//!
//! Elements of a scene refer to materials, never to colours. The first few are the defaults of organs; the
//! numbered ones are chosen by `;(n)`: twelve that are built in, then the colours and the
//! gradients that the model declares. A gradient is [`GRADIENT_STEPS`] materials, so that a material library
//! stays small whatever is coloured by it.

use std::borrow::Cow;
use std::fmt;

use dlsys_model::Texture;

/// A colour of the sRGB space, 8 bits a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Color {
    /// Red, from 0 to 255.
    pub red: u8,
    /// Green, from 0 to 255.
    pub green: u8,
    /// Blue, from 0 to 255.
    pub blue: u8,
}

impl Color {
    /// From `0xRRGGBB`.
    pub const fn hex(rgb: u32) -> Color {
        Color { red: (rgb >> 16) as u8, green: (rgb >> 8) as u8, blue: rgb as u8 }
    }

    /// The channels from 0 to 1.
    pub fn channels(self) -> [f64; 3] {
        [self.red, self.green, self.blue].map(|c| f64::from(c) / 255.0)
    }

    /// The colour under a light of this strength: 1 leaves it as it is, less darkens it towards a
    /// slightly cool shadow, more (up to 1.25 or so) lightens it towards white.
    pub fn lit(self, strength: f64) -> Color {
        let [r, g, b] = self.channels();
        let shade = |c: f64, shadow: f64| {
            let lit = if strength <= 1.0 {
                c * (shadow + (1.0 - shadow) * strength)
            } else {
                c + (1.0 - c) * (strength - 1.0)
            };
            // To the nearest, without a call of the mathematical library.
            (lit.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
        };
        Color { red: shade(r, 0.0), green: shade(g, 0.05), blue: shade(b, 0.15) }
    }

    fn letters(self) -> [u8; 7] {
        const DIGITS: &[u8; 16] = b"0123456789abcdef";
        let mut text = *b"#rrggbb";
        for (digits, channel) in text[1..].chunks_exact_mut(2).zip([self.red, self.green, self.blue]) {
            digits[0] = DIGITS[usize::from(channel >> 4)];
            digits[1] = DIGITS[usize::from(channel & 15)];
        }
        text
    }

    /// `#rrggbb`, as it is displayed; for files with many colours.
    pub fn hexadecimal(self) -> String {
        std::str::from_utf8(&self.letters()).unwrap_or_default().to_owned()
    }
}

impl fmt::Display for Color {
    /// `#rrggbb`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(std::str::from_utf8(&self.letters()).unwrap_or_default())
    }
}

/// A material of a [`Palette`], by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MaterialId(u32);

impl MaterialId {
    /// Stems, unless a colour is chosen.
    pub const STEM: MaterialId = MaterialId(0);
    /// Leaves and polygons, unless a colour is chosen.
    pub const LEAF: MaterialId = MaterialId(1);
    /// Petals, unless a colour is chosen.
    pub const PETAL: MaterialId = MaterialId(2);
    /// The middle of a flower.
    pub const CENTRE: MaterialId = MaterialId(3);
    /// The green cup of a flower.
    pub const SEPAL: MaterialId = MaterialId(4);
    /// Materials before the numbered ones.
    const NAMED: usize = 5;

    /// Position in [`Palette::materials`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A named colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Material {
    /// ASCII letters, digits, `_` and `-`; no two materials of a palette share one.
    pub name: Cow<'static, str>,
    /// Its colour in full light; with a texture, the mean of that.
    pub color: Color,
    /// The picture that is seen in place of the colour.
    pub texture: Option<Texture>,
}

impl Material {
    /// Of one colour.
    fn plain(name: impl Into<Cow<'static, str>>, color: Color) -> Material {
        Material { name: name.into(), color, texture: None }
    }
}

/// Materials of each gradient.
pub const GRADIENT_STEPS: usize = 64;

/// The materials of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Palette {
    materials: Vec<Material>,
    /// Where the colours of the model begin: after the built-in ones, and after those of the models around a plant.
    own: usize,
    /// Colours with a number, those of the model included.
    colors: usize,
    /// Gradients, whose numbers and materials follow those of the colours.
    gradients: usize,
}

/// The materials of the default palette: the named ones, then the colours 1, 2, 3, ….
const DEFAULT: [(&str, u32); 17] = [
    ("stem", 0x6b7a3a),
    ("leaf", 0x5d9b41),
    ("petal", 0x8b6cc9),
    ("centre", 0xf2c230),
    ("sepal", 0x6f9440),
    ("colour-1", 0x4a7a35),  // dark green
    ("colour-2", 0x7cb342),  // leaf green
    ("colour-3", 0xb5cf5a),  // shoot green
    ("colour-4", 0x7e57c2),  // violet
    ("colour-5", 0xe573a5),  // pink
    ("colour-6", 0xf5c53a),  // yellow
    ("colour-7", 0xd1493f),  // red
    ("colour-8", 0xee8b3a),  // orange
    ("colour-9", 0x4a8fd0),  // blue
    ("colour-10", 0xece4cf), // cream
    ("colour-11", 0x7d5a3c), // bark
    ("colour-12", 0x555555), // grey
];

/// Built-in colours with a number.
const BUILT_IN: usize = DEFAULT.len() - MaterialId::NAMED;

impl Default for Palette {
    fn default() -> Palette {
        let materials = DEFAULT.iter().map(|&(name, rgb)| Material::plain(name, Color::hex(rgb)));
        let (own, colors) = (DEFAULT.len(), BUILT_IN);
        Palette { materials: materials.collect(), own, colors, gradients: 0 }
    }
}

impl Palette {
    /// The default palette, and after it colours and gradients of a model: their names, and sRGB colours at
    /// equal distances from 0 to 1.
    pub fn with<'n>(
        colors: impl IntoIterator<Item = (&'n str, Color)>,
        gradients: impl IntoIterator<Item = (&'n str, Vec<Color>)>,
    ) -> Palette {
        Palette::default().beside(colors, gradients)
    }

    /// The palette of a plant that stands in a scene with this palette: the same materials, behind them those of the plant's model,
    /// whose numbers follow those of the built-in colours.
    pub fn beside<'n>(
        &self,
        colors: impl IntoIterator<Item = (&'n str, Color)>,
        gradients: impl IntoIterator<Item = (&'n str, Vec<Color>)>,
    ) -> Palette {
        let own = self.materials.len();
        let mut palette = Palette { materials: self.materials.clone(), own, colors: BUILT_IN, gradients: 0 };
        for (name, color) in colors {
            let name = palette.free_name(name);
            palette.materials.push(Material::plain(name, color));
            palette.colors += 1;
        }
        for (name, stops) in gradients {
            let name = palette.free_name(name);
            for step in 0..GRADIENT_STEPS {
                let color = blend(&stops, step as f64 / (GRADIENT_STEPS - 1) as f64);
                palette.materials.push(Material::plain(format!("{name}-{step:02}"), color));
            }
            palette.gradients += 1;
        }
        palette
    }

    /// This palette with the materials of another one, which begins with those of this one.
    pub fn completed(&self, all: &Palette) -> Palette {
        Palette { materials: all.materials.clone(), ..self.clone() }
    }

    /// Adds a material without a number, for example that of a surface.
    pub fn add(&mut self, name: &str, color: Color) -> MaterialId {
        let name = self.free_name(name);
        self.materials.push(Material::plain(name, color));
        MaterialId(self.materials.len() as u32 - 1)
    }

    /// Adds a material with a texture.
    pub fn add_textured(&mut self, name: &str, texture: &Texture) -> MaterialId {
        let id = self.add(name, Color::hex(texture.picture.mean()));
        self.materials[id.index()].texture = Some(texture.clone());
        id
    }

    /// The texture of a material.
    pub fn texture(&self, id: MaterialId) -> Option<&Texture> {
        self.get(id).texture.as_ref()
    }

    /// Whether any material has a texture.
    pub fn has_textures(&self) -> bool {
        self.materials.iter().any(|material| material.texture.is_some())
    }

    /// A name in ASCII that no material has, and none of a gradient of that name would.
    fn free_name(&self, name: &str) -> String {
        let plain: String = (name.chars())
            .map(|c| {
                if c.is_ascii_alphanumeric() || c == '_' { c.to_string() } else { format!("u{:x}", c as u32) }
            })
            .collect();
        let taken = |name: &str| {
            self.materials.iter().any(|m| {
                m.name == name || m.name.strip_prefix(name).is_some_and(|rest| rest.starts_with('-'))
            })
        };
        let mut free = plain.clone();
        let mut count = 1;
        while taken(&free) {
            count += 1;
            free = format!("{plain}_{count}");
        }
        free
    }

    /// All materials, in the order of their ids.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The ids of all materials.
    pub fn ids(&self) -> impl Iterator<Item = MaterialId> + use<> {
        (0..self.materials.len() as u32).map(MaterialId)
    }

    /// The material with a number of this palette.
    pub fn get(&self, id: MaterialId) -> &Material {
        &self.materials[id.index()]
    }

    /// The material that `;(number, value)` chooses: `None` for number 0, which is the natural colour of
    /// whatever is drawn. Numbers are rounded; beyond the last colour and gradient they start again at 1. The
    /// value matters to gradients only, where it runs from 0 to 1; what is beyond is drawn as the nearer end.
    pub fn chosen(&self, number: f64, value: f64) -> Option<MaterialId> {
        let number = number.round();
        if number == 0.0 || !number.is_finite() {
            return None;
        }
        let place = (number - 1.0).rem_euclid((self.colors + self.gradients) as f64) as usize;
        let index = if place < BUILT_IN {
            MaterialId::NAMED + place
        } else if place < self.colors {
            self.own + place - BUILT_IN
        } else {
            let value = if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
            let step = (value * (GRADIENT_STEPS - 1) as f64).round() as usize;
            self.own + self.colors - BUILT_IN + (place - self.colors) * GRADIENT_STEPS + step
        };
        Some(MaterialId(index as u32))
    }

    /// How many colours have a number, and how many gradients have one after them.
    pub fn counts(&self) -> [usize; 2] {
        [self.colors, self.gradients]
    }

    /// The material of the colour of this number; the beginning of a gradient.
    pub fn numbered(&self, number: f64) -> Option<MaterialId> {
        self.chosen(number, 0.0)
    }
}

/// The colour at a place from 0 to 1 between stops at equal distances.
fn blend(stops: &[Color], at: f64) -> Color {
    let last = stops.len().saturating_sub(1);
    let place = at * last as f64;
    let low = (place.floor() as usize).min(last.saturating_sub(1));
    let Some(&from) = stops.get(low) else { return Color::hex(0) };
    let to = stops.get(low + 1).copied().unwrap_or(from);
    let part = place - low as f64;
    let mix = |a: u8, b: u8| (f64::from(a) * (1.0 - part) + f64::from(b) * part).round() as u8;
    Color { red: mix(from.red, to.red), green: mix(from.green, to.green), blue: mix(from.blue, to.blue) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_numbers_cycle() {
        let palette = Palette::default();
        let name = |n: f64| palette.numbered(n).map(|id| palette.get(id).name.as_ref());
        assert_eq!(name(0.2), None);
        assert_eq!(name(1.0), Some("colour-1"));
        assert_eq!(name(12.0), Some("colour-12"));
        assert_eq!(name(13.0), Some("colour-1"));
        assert_eq!(name(-1.0), Some("colour-11"));
        assert!(name(1e300).is_some());
        assert_eq!(palette.get(MaterialId::SEPAL).name, "sepal");
    }

    #[test]
    fn light_keeps_a_colour_or_moves_it() {
        let green = Color::hex(0x5d9b41);
        assert_eq!(green.lit(1.0), green);
        assert_eq!(green.to_string(), "#5d9b41");
        assert!(green.lit(0.5).green < green.green && green.lit(1.2).green > green.green);
    }

    #[test]
    fn a_models_colours_follow_and_gradients_have_their_steps() {
        let (black, white) = (Color::hex(0), Color::hex(0xffffff));
        let palette = Palette::with(
            [("leaf", Color::hex(0x102030)), ("τ", Color::hex(0x405060))],
            [("age", vec![black, white]), ("leaf", vec![white, Color::hex(0xff0000), black])],
        );
        let look = |number: f64, value: f64| {
            let material = palette.get(palette.chosen(number, value).expect("a colour"));
            (material.name.to_string(), material.color.to_string())
        };
        let pair = |name: &str, color: &str| (name.to_owned(), color.to_owned());
        assert_eq!(look(12.0, 0.3), pair("colour-12", "#555555"));
        assert_eq!(look(13.0, 0.3), pair("leaf_2", "#102030"));
        assert_eq!(look(14.0, 0.3), pair("u3c4", "#405060"));
        assert_eq!(look(15.0, -7.0), pair("age-00", "#000000"));
        assert_eq!(look(15.0, 0.5), pair("age-32", "#828282"));
        assert_eq!(look(15.0, 2.0), pair("age-63", "#ffffff"));
        assert_eq!(look(16.0, 0.25), pair("leaf_3-16", "#ff7d7d"));
        assert_eq!(look(17.0, 0.0).0, "colour-1");
        let mut names: Vec<&str> = palette.materials().iter().map(|m| &*m.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), palette.materials().len());
    }
}
