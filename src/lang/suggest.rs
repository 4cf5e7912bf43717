//! “Did you mean …?”

/// The candidate nearest to a misspelt name, if one is near enough to be meant.
///
/// Distance counts insertions, deletions, substitutions and exchanged neighbours (Damerau 1964,
/// restricted form); one in three characters may be wrong.
pub fn nearest<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<&'c str> {
    let name: Vec<char> = name.chars().collect();
    if name.len() > 60 {
        return None;
    }
    let allowed = (name.len() / 3).max(1);
    let lower = |text: &mut dyn Iterator<Item = char>| text.flat_map(char::to_lowercase).collect::<String>();
    let folded = lower(&mut name.iter().copied());
    candidates
        .into_iter()
        .filter(|c| !c.chars().eq(name.iter().copied()))
        .filter_map(|c| {
            let other: Vec<char> = c.chars().collect();
            if lower(&mut c.chars()) == folded {
                return Some((0, c));
            }
            let close = name.len().abs_diff(other.len()) <= allowed;
            let distance = if close { distance(&name, &other) } else { usize::MAX };
            // One letter for another is no likeness.
            (distance <= allowed && distance < name.len().max(other.len())).then_some((distance, c))
        })
        .min_by_key(|(distance, c)| (*distance, *c))
        .map(|(_, c)| c)
}

/// The nearest candidate, as a sentence.
pub fn did_you_mean<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<String> {
    nearest(name, candidates).map(|c| format!("did you mean `{c}`?"))
}

fn distance(a: &[char], b: &[char]) -> usize {
    let mut rows = [vec![0; b.len() + 1], (0..=b.len()).collect::<Vec<_>>(), vec![0; b.len() + 1]];
    for i in 1..=a.len() {
        let [before, last, now] = &mut rows;
        now[0] = i;
        for j in 1..=b.len() {
            let same = usize::from(a[i - 1] != b[j - 1]);
            now[j] = (last[j] + 1).min(now[j - 1] + 1).min(last[j - 1] + same);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                now[j] = now[j].min(before[j - 2] + 1);
            }
        }
        rows.rotate_left(1);
    }
    rows[1][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_found_and_far_ones_are_not() {
        assert_eq!(nearest("x_maxx", ["x_max", "x_min"]), Some("x_max"));
        assert_eq!(nearest("paarm", ["const", "param"]), Some("param"));
        assert_eq!(nearest("volume", ["const", "param"]), None);
        assert_eq!(nearest("x", ["y", "z"]), None);
        assert_eq!(nearest("Sin", ["min", "sin"]), Some("sin"));
    }
}
