//! The tones of pictures: few colours that stand for all of a picture, because regions have one colour each.

use std::collections::HashMap;

use dlsys_geometry::scene::{Color, MaterialId, Palette, Picture};

/// Most tones of a picture.
pub const MOST: usize = 6;
/// Colours that differ by less in every channel are one tone.
const ALIKE: f64 = 20.0;
/// The largest side of the copy of a picture whose texels are sorted into tones.
const SIDE: usize = 64;

/// The tones of all pictures of a palette.
pub struct Tones(HashMap<MaterialId, Vec<[f64; 3]>>);

impl Tones {
    pub fn of(palette: &Palette) -> Tones {
        let ids = palette.ids().filter_map(|id| Some((id, tones(&palette.texture(id)?.picture))));
        Tones(ids.collect())
    }

    /// The number of the tone next to a colour, in the order of how much of the picture they are.
    pub fn nearest(&self, material: MaterialId, color: [f64; 3]) -> u8 {
        let off = |tone: &[f64; 3]| (0..3).map(|k| (tone[k] - color[k]).powi(2)).sum::<f64>();
        let all = self.0.get(&material).map_or(&[][..], Vec::as_slice);
        let best = all.iter().enumerate().min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
        best.map_or(0, |(i, _)| i as u8)
    }

    /// The colour of a tone.
    pub fn color(&self, material: MaterialId, tone: u8) -> Option<Color> {
        let [red, green, blue] = self.0.get(&material)?.get(usize::from(tone))?.map(|c| (c + 0.5) as u8);
        Some(Color { red, green, blue })
    }
}

/// Cuts the colours of a picture in two at the mean of the channel in which they are most apart, again and again; the box with most to tell first.
fn tones(picture: &Picture) -> Vec<[f64; 3]> {
    let texels = picture.small(SIDE).iter().filter(|texel| texel[3] >= 128);
    let colors: Vec<[f64; 3]> = texels.map(|&[r, g, b, _]| [r, g, b].map(f64::from)).collect();
    let mut boxes = vec![colors];
    // Channel, and by how much its colours are apart.
    let widest = |colors: &[[f64; 3]]| {
        let range = |k: usize| {
            let bounds = colors.iter().fold((f64::MAX, f64::MIN), |(a, b), c| (c[k].min(a), c[k].max(b)));
            bounds.1 - bounds.0
        };
        (0..3).map(|k| (range(k), k)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
    };
    while boxes.len() < MOST {
        let weights = boxes.iter().map(|colors| (widest(colors), colors.len()));
        let told =
            weights.map(|((range, k), count)| (if range < ALIKE { 0.0 } else { range * count as f64 }, k));
        let most = told.enumerate().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((number, (_, k))) = most.filter(|(_, (told, _))| *told > 0.0) else { break };
        let colors = boxes.swap_remove(number);
        let mean = colors.iter().map(|c| c[k]).sum::<f64>() / colors.len() as f64;
        let (low, high): (Vec<_>, Vec<_>) = colors.into_iter().partition(|c| c[k] <= mean);
        boxes.extend([low, high]);
    }
    boxes.retain(|colors| !colors.is_empty());
    boxes.sort_by_key(|colors| std::cmp::Reverse(colors.len()));
    let mean = |colors: &Vec<[f64; 3]>| {
        [0, 1, 2].map(|k| colors.iter().map(|c| c[k]).sum::<f64>() / colors.len() as f64)
    };
    boxes.iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tones_are_the_colours_that_there_are() {
        let picture = |texel: &dyn Fn(usize) -> [u8; 4]| {
            Picture::new("p.png", Vec::new(), [32, 32], (0..1024).map(texel).collect()).expect("texels")
        };
        assert_eq!(tones(&picture(&|_| [10, 20, 30, 255])), [[10.0, 20.0, 30.0]]);
        // A third is red, the rest green; what is cut out does not count.
        let two = picture(&|i| match i % 4 {
            0 => [200, 0, 0, 255],
            3 => [0, 0, 255, 0],
            _ => [0, 150, (i % 8) as u8, 255],
        });
        let found = tones(&two);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0][1], found[1]), (150.0, [200.0, 0.0, 0.0]));
        assert_eq!(tones(&picture(&|i| [(i % 256) as u8, (i / 4) as u8, 0, 255])).len(), MOST);
        assert_eq!(tones(&picture(&|_| [9, 9, 9, 0])).len(), 0);
    }
}
