//! The order of elements over all frames.

/// Which of these ranks are kept such that what is kept ascends: as many as possible (patience sorting, Fredman 1975).
pub(super) fn ascending(ranks: impl Iterator<Item = Option<usize>>) -> Vec<bool> {
    let ranks: Vec<Option<usize>> = ranks.collect();
    // The smallest last rank of a chain of each length, where it stands, and what was before each in its chain.
    let mut lasts: Vec<(usize, usize)> = Vec::new();
    let mut before: Vec<Option<usize>> = vec![None; ranks.len()];
    for (at, rank) in ranks.iter().enumerate() {
        let Some(rank) = *rank else { continue };
        let length = lasts.partition_point(|(last, _)| *last < rank);
        before[at] = length.checked_sub(1).map(|shorter| lasts[shorter].1);
        match lasts.get_mut(length) {
            Some(last) => *last = (rank, at),
            None => lasts.push((rank, at)),
        }
    }
    let mut kept = vec![false; ranks.len()];
    let mut at = lasts.last().map(|(_, at)| *at);
    while let Some(i) = at {
        kept[i] = true;
        at = before[i];
    }
    kept
}

/// An order with others in it, each after the one of a rank (`None`: before all), by ascending ranks.
pub(super) fn inserted(order: &[usize], others: &[(Option<usize>, usize)]) -> Vec<usize> {
    let mut out = Vec::with_capacity(order.len() + others.len());
    let mut others = others.iter().peekable();
    let mut take = |out: &mut Vec<usize>, after: Option<usize>| {
        while let Some((_, other)) = others.next_if(|(place, _)| *place == after) {
            out.push(*other);
        }
    };
    take(&mut out, None);
    for (rank, element) in order.iter().enumerate() {
        out.push(*element);
        take(&mut out, Some(rank));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_chain_is_kept() {
        let kept = |ranks: &[usize]| ascending(ranks.iter().map(|rank| Some(*rank)));
        assert_eq!(kept(&[3, 0, 1, 2]), [false, true, true, true]);
        assert_eq!(kept(&[0, 1, 2]), [true; 3]);
        assert_eq!(ascending([Some(1), None, Some(2)].into_iter()), [true, false, true]);
        assert_eq!(ascending(std::iter::empty()), [false; 0]);
    }

    #[test]
    fn others_stand_after_their_places() {
        assert_eq!(
            inserted(&[7, 8], &[(None, 1), (Some(0), 2), (Some(0), 3), (Some(1), 4)]),
            [1, 7, 2, 3, 8, 4]
        );
    }
}
