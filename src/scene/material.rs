//! Materials: what a thing is made of, and the colour that goes with it.
//!
//! A scene names materials, never colours. The first few are what plants are drawn in when a model says
//! nothing; the numbered ones are what `;(n)` chooses.

use std::fmt;

/// A colour of the sRGB space, 8 bits a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Color {
    pub red: u8,
    pub green: u8,
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
            (lit.clamp(0.0, 1.0) * 255.0).round() as u8
        };
        Color { red: shade(r, 0.0), green: shade(g, 0.05), blue: shade(b, 0.15) }
    }
}

impl fmt::Display for Color {
    /// `#rrggbb`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.red, self.green, self.blue)
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

    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A named colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Material {
    /// ASCII letters, digits and `-`.
    pub name: &'static str,
    pub color: Color,
}

/// The materials of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Palette(Vec<Material>);

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

impl Default for Palette {
    fn default() -> Palette {
        Palette(DEFAULT.iter().map(|&(name, rgb)| Material { name, color: Color::hex(rgb) }).collect())
    }
}

impl Palette {
    /// All materials, in the order of their ids.
    pub fn materials(&self) -> &[Material] {
        &self.0
    }

    pub fn get(&self, id: MaterialId) -> &Material {
        &self.0[id.index()]
    }

    /// The material of the colour of this number, as `;(n)` chooses it: `None` for 0, which is the natural
    /// colour of whatever is drawn. Numbers are rounded; beyond the last colour they start again at 1.
    pub fn numbered(&self, number: f64) -> Option<MaterialId> {
        let number = number.round();
        let count = (self.0.len() - MaterialId::NAMED) as f64;
        if number == 0.0 || !number.is_finite() {
            return None;
        }
        Some(MaterialId(MaterialId::NAMED as u32 + (number - 1.0).rem_euclid(count) as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_numbers_cycle() {
        let palette = Palette::default();
        let name = |n: f64| palette.numbered(n).map(|id| palette.get(id).name);
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
}
