//! Palettes of few colours for many: boxes of colours are cut in two (P. Heckbert, *Color image quantization for frame buffer display*, 1982), the one with the
//! largest error first, and their means are then moved to the middle of the colours that are nearest to them (S. Lloyd, *Least squares quantization in PCM*, 1982).

use std::collections::HashMap;

/// Red, green, blue.
pub(crate) type Colour = [u8; 3];

/// Colours of a palette; one more is transparent.
const MOST: usize = 255;
/// Movements of the colours of a palette.
const MOVES: usize = 3;

pub(crate) struct Palette {
    pub(crate) colours: Vec<Colour>,
    /// The index of the colour for each colour of the picture.
    pub(crate) nearest: HashMap<Colour, u8>,
}

/// The square of the distance.
pub(crate) fn distance(a: Colour, b: Colour) -> u32 {
    (0..3).map(|i| u32::from(a[i].abs_diff(b[i])).pow(2)).sum()
}

/// The palette for colours that are as frequent as here: all of them if there are few enough.
pub(crate) fn choose(counts: HashMap<Colour, u32>) -> Palette {
    // A colour of many pixels counts for more, but a rare one is seen as well.
    let mut colours: Vec<(Colour, f32)> =
        counts.into_iter().map(|(colour, count)| (colour, (count as f32).sqrt())).collect();
    // The order of a table by hashes is not the same in every run.
    colours.sort_unstable_by_key(|(colour, _)| *colour);
    let mut chosen: Vec<Colour> = colours.iter().map(|(colour, _)| *colour).collect();
    if colours.len() > MOST {
        chosen = cut(&mut colours);
        for _ in 0..MOVES {
            chosen = middles(&colours, &chosen);
        }
    }
    let nearest = colours.iter().map(|(colour, _)| (*colour, nearest(*colour, &chosen) as u8)).collect();
    Palette { colours: chosen, nearest }
}

fn nearest(colour: Colour, chosen: &[Colour]) -> usize {
    (0..chosen.len()).min_by_key(|i| distance(chosen[*i], colour)).unwrap_or(0)
}

/// The weighted mean.
fn mean<'a>(colours: impl Iterator<Item = &'a (Colour, f32)>) -> Option<[f32; 3]> {
    let (mut sums, mut weights) = ([0.0; 3], 0.0);
    for (colour, weight) in colours {
        (0..3).for_each(|i| sums[i] += weight * f32::from(colour[i]));
        weights += weight;
    }
    (weights > 0.0).then(|| sums.map(|sum| sum / weights))
}

/// A box of colours: a part of the list, the channel in which it is longest, and how urgently it has to be cut.
struct Part {
    from: usize,
    to: usize,
    channel: usize,
    error: f32,
}

impl Part {
    fn new(colours: &[(Colour, f32)], from: usize, to: usize) -> Part {
        let part = &colours[from..to];
        let middle = mean(part.iter()).unwrap_or_default();
        let mut spread = [0.0_f32; 3];
        let mut farthest = 0.0_f32;
        for (colour, weight) in part {
            let squares = [0, 1, 2].map(|i| (f32::from(colour[i]) - middle[i]).powi(2));
            (0..3).for_each(|i| spread[i] += weight * squares[i]);
            farthest = farthest.max(squares.iter().sum());
        }
        let channel = (0..3).max_by(|a, b| spread[*a].total_cmp(&spread[*b])).unwrap_or(0);
        // Between the sum of all errors and the largest one.
        let error = spread.iter().sum::<f32>().sqrt() * farthest;
        Part { from, to, channel, error }
    }
}

/// Means of as many boxes as there may be colours.
fn cut(colours: &mut [(Colour, f32)]) -> Vec<Colour> {
    let mut parts = vec![Part::new(colours, 0, colours.len())];
    while parts.len() < MOST {
        let Some(widest) = (0..parts.len()).max_by(|a, b| parts[*a].error.total_cmp(&parts[*b].error)) else {
            break;
        };
        let Part { from, to, channel, .. } = parts[widest];
        let part = &mut colours[from..to];
        part.sort_unstable_by_key(|(colour, _)| (colour[channel], *colour));
        let middle = mean(part.iter()).map_or(0.0, |middle| middle[channel]);
        let below = part.partition_point(|(colour, _)| f32::from(colour[channel]) <= middle);
        let between = from + below.clamp(1, part.len().saturating_sub(1).max(1));
        if between >= to {
            break;
        }
        parts[widest] = Part::new(colours, from, between);
        parts.push(Part::new(colours, between, to));
    }
    let middles = parts.iter().filter_map(|part| mean(colours[part.from..part.to].iter()));
    middles.map(|middle| middle.map(|x| x.round() as u8)).collect()
}

/// The colours of a palette, each moved to the mean of those that it stands for.
fn middles(colours: &[(Colour, f32)], chosen: &[Colour]) -> Vec<Colour> {
    let mut sums = vec![([0.0_f32; 3], 0.0_f32); chosen.len()];
    for (colour, weight) in colours {
        let (sum, weights) = &mut sums[nearest(*colour, chosen)];
        (0..3).for_each(|i| sum[i] += weight * f32::from(colour[i]));
        *weights += weight;
    }
    let moved = sums.into_iter().zip(chosen);
    moved
        .map(
            |((sum, weights), old)| {
                if weights > 0.0 { sum.map(|x| (x / weights).round() as u8) } else { *old }
            },
        )
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_are_kept_and_many_are_near() {
        let few: HashMap<Colour, u32> = (0..200_u8).map(|i| ([i, 255 - i, 3], 1 + u32::from(i))).collect();
        let palette = choose(few.clone());
        assert!(few.keys().all(|colour| palette.colours[usize::from(palette.nearest[colour])] == *colour));
        // A cube of 20 by 20 by 20 colours, and one far away that a single pixel has.
        let axis = || (0..20_u8).map(|i| i * 5);
        let cube = axis().flat_map(|r| axis().flat_map(move |g| axis().map(move |b| [r, g, b])));
        let many: HashMap<Colour, u32> = cube.map(|colour| (colour, 9)).chain([([255, 0, 255], 1)]).collect();
        let palette = choose(many.clone());
        assert_eq!(palette.colours.len(), MOST);
        let worst = many
            .keys()
            .map(|colour| distance(palette.colours[usize::from(palette.nearest[colour])], *colour));
        // 255 cubes of the same size would be 15 long, with a half diagonal of 13.
        assert!(worst.max().unwrap_or(0) <= 20 * 20);
    }
}
