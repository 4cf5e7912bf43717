//! Shades of which little is seen in an item, as one with those next to them.
//!
//! A path for a shade takes some eighty bytes, whatever it covers. On a floret of a few pixels twenty shades differ by less than its edges do,
//! so a shade that covers less than a few pixels there becomes one with its neighbour, and has the mean of their light.

use super::label::Shade;

/// Pixels of the page that a shade covers, at least, in an item that has more than one.
const LEAST_PIXELS: f64 = 4.0;
/// Most shades that become one: as many as differ by about a tenth from their mean.
const MOST: i32 = 3;

/// Shades in the order of painting, those of one item that are scarce merged, and the new number of each. A pixel is so many cells.
pub fn merged(shades: Vec<Shade>, cells: f64) -> (Vec<Shade>, Vec<u32>) {
    let least = (LEAST_PIXELS * cells) as usize;
    let mut numbers = Vec::with_capacity(shades.len());
    let mut all: Vec<Shade> = Vec::new();
    for run in shades.chunk_by(|a, b| a.item == b.item) {
        let first = all.len();
        all.extend(run.iter().cloned());
        merge(&mut all, first, least);
        let mut number = first;
        for shade in run {
            number += usize::from(shade.step > all[number].last);
            numbers.push(number as u32);
        }
    }
    (all, numbers)
}

/// Merges the shades of one item, from the first one given to the end, the scarcest first.
fn merge(all: &mut Vec<Shade>, first: usize, least: usize) {
    // What cannot be merged is not looked at again.
    loop {
        let scarcest = (first..all.len())
            .filter(|i| all[*i].count < least)
            .filter_map(|i| Some((all[i].count, partner(&all[first..], i - first)? + first)))
            .min();
        let Some((_, at)) = scarcest else { return };
        let lighter = all.remove(at + 1);
        all[at].add(&lighter);
    }
}

/// The darker one of the two shades that become one if one of them has to: of two neighbours the one whose light is nearer.
fn partner(item: &[Shade], i: usize) -> Option<usize> {
    let pair = |dark: usize| {
        let [a, b] = [item.get(dark)?, item.get(dark + 1)?];
        (b.last - a.step < MOST).then(|| (b.strength() - a.strength(), dark))
    };
    let pairs = [i.checked_sub(1).and_then(pair), pair(i)];
    let nearest = pairs.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map(|(_, dark)| dark)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::label::Item;
    use dlsys_geometry::scene::{MaterialId, OwnerId};

    fn item() -> Item {
        Item::of((OwnerId::default(), MaterialId::STEM))
    }

    /// Shades of one item with so many cells each, from the darkest on; their strengths are their steps over twenty.
    fn shades(counts: &[usize]) -> Vec<Shade> {
        (0..)
            .zip(counts)
            .map(|(step, count)| Shade::new(item(), step, f64::from(step) / 20.0, *count))
            .collect()
    }

    fn merged_to(counts: &[usize]) -> (Vec<[i32; 2]>, Vec<u32>) {
        let (all, numbers) = merged(shades(counts), 1.0);
        (all.iter().map(|shade| [shade.step, shade.last]).collect(), numbers)
    }

    #[test]
    fn scarce_shades_join_the_neighbour_whose_light_is_nearer_and_no_more_than_three_do() {
        assert_eq!(merged_to(&[9, 9, 9]), (vec![[0, 0], [1, 1], [2, 2]], vec![0, 1, 2]));
        // Two of them are enough for a path.
        assert_eq!(merged_to(&[2, 2, 9]), (vec![[0, 1], [2, 2]], vec![0, 0, 1]));
        assert_eq!(merged_to(&[1, 1, 1, 1, 1]), (vec![[0, 1], [2, 4]], vec![0, 0, 1, 1, 1]));
    }

    #[test]
    fn a_merged_shade_has_the_mean_light_of_its_cells() {
        let (all, _) = merged(shades(&[3, 1]), 1.0);
        assert_eq!(all.len(), 1);
        assert!((all[0].strength() - 0.0125).abs() < 1e-12, "{}", all[0].strength());
    }

    #[test]
    fn shades_of_different_items_stay_apart() {
        let mut other = item();
        other.tone = 1;
        let both = vec![Shade::new(item(), 0, 0.0, 1), Shade::new(other, 1, 0.05, 1)];
        assert_eq!(merged(both, 1.0).1, [0, 1]);
    }
}
