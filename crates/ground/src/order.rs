//! Things in the order of their columns, as fast as there are columns.

/// Things of which this many are to a column of the box around them on the average, or more, are put in order by counting.
const SPARSE: usize = 8;

/// Puts things in order along x, row after row, and keeps the order of those of the same column.
pub(crate) fn by_columns<T: Copy>(all: &mut Vec<T>, column: impl Fn(&T) -> (i32, i32)) {
    let first = all.first().map_or((0, 0), &column);
    let (mut low, mut high, mut is_ordered, mut last) = (first, first, true, first);
    for one in all.iter() {
        let (i, k) = column(one);
        low = (low.0.min(i), low.1.min(k));
        high = (high.0.max(i), high.1.max(k));
        is_ordered &= (last.1, last.0) <= (k, i);
        last = (i, k);
    }
    if is_ordered {
        return;
    }
    let [width, depth] = [high.0.abs_diff(low.0) as usize + 1, high.1.abs_diff(low.1) as usize + 1];
    if width.saturating_mul(depth) > SPARSE * all.len() {
        all.sort_by_key(|one| {
            let (i, k) = column(one);
            (k, i)
        });
        return;
    }
    let place = |one: &T| {
        let (i, k) = column(one);
        k.abs_diff(low.1) as usize * width + i.abs_diff(low.0) as usize
    };
    // How many come before each column, then where the next one of it belongs.
    let mut starts = vec![0_u32; width * depth + 1];
    for one in all.iter() {
        starts[place(one) + 1] += 1;
    }
    let mut sum = 0;
    for start in &mut starts {
        sum += *start;
        *start = sum;
    }
    let mut ordered = all.clone();
    for one in all.iter() {
        let start = &mut starts[place(one)];
        ordered[*start as usize] = *one;
        *start += 1;
    }
    *all = ordered;
}

#[cfg(test)]
mod tests {
    use super::by_columns;

    /// Dense, sparse, in order: as by a stable sort.
    #[test]
    fn counting_keeps_the_order_within_columns() {
        let mut state = 1_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        for width in [1, 7, 40, 100_000] {
            let all: Vec<_> =
                (0..500).map(|n| ((random(width) as i32 - 3, random(5) as i32 - 2), n)).collect();
            let mut expected = all.clone();
            expected.sort_by_key(|((i, k), _)| (*k, *i));
            let mut found = all;
            for _ in 0..2 {
                by_columns(&mut found, |(column, _)| *column);
                assert_eq!(found, expected, "{width}");
            }
        }
        by_columns(&mut Vec::<(i32, i32)>::new(), |column| *column);
    }
}
