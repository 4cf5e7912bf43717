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
            if lower(&mut c.chars()) == folded || look_alike(c, &name) {
                return Some((0, c));
            }
            let close = name.len().abs_diff(other.len()) <= allowed;
            let distance = if close { distance(&name, &other) } else { usize::MAX };
            // Two different letters are not similar.
            (distance <= allowed && distance < name.len().max(other.len())).then_some((distance, c))
        })
        .min_by_key(|(distance, c)| (*distance, *c))
        .map(|(_, c)| c)
}

/// The nearest candidate, as a sentence.
pub fn did_you_mean<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<String> {
    nearest(name, candidates).map(|c| meant(name, c))
}

/// A sentence that suggests another name.
pub fn meant(name: &str, other: &str) -> String {
    if looks_like(name, other) {
        return format!(
            "there is a `{other}` that looks the same and is written in other characters: a letter with a mark may be one character, or a letter and a mark; write both alike"
        );
    }
    format!("did you mean `{other}`?")
}

/// True if two names appear to differ only in the composition of letters with marks. Without Unicode tables, the test is
/// whether one has as many non-ASCII characters as the other has marked letters.
pub fn looks_like(name: &str, other: &str) -> bool {
    name != other && look_alike(other, &name.chars().collect::<Vec<_>>())
}

fn look_alike(other: &str, name: &[char]) -> bool {
    fn is_mark(c: char) -> bool {
        matches!(c, '\u{300}'..='\u{36f}' | '\u{1ab0}'..='\u{1aff}' | '\u{1dc0}'..='\u{1dff}' | '\u{20d0}'..='\u{20ff}')
    }
    /// The letters, each with the number of its marks.
    fn letters(text: impl Iterator<Item = char>) -> Vec<(char, usize)> {
        let mut letters: Vec<(char, usize)> = Vec::new();
        for c in text {
            match letters.last_mut() {
                Some(last) if is_mark(c) => last.1 += 1,
                _ => letters.push((c, 0)),
            }
        }
        letters
    }
    if other.is_ascii() || !other.chars().chain(name.iter().copied()).any(is_mark) {
        return false;
    }
    let (ours, theirs) = (letters(name.iter().copied()), letters(other.chars()));
    ours.len() == theirs.len()
        && ours.iter().zip(&theirs).all(|(a, b)| match (a.1, b.1) {
            (0, 0) => a.0 == b.0,
            (0, _) => !a.0.is_ascii(),
            (_, 0) => !b.0.is_ascii(),
            _ => a.0 == b.0 || a.1 != b.1,
        })
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

    #[test]
    fn similar_looking_names_are_reported() {
        let (composed, with_mark) = ("Bl\u{fc}te", "Blu\u{308}te");
        assert!(looks_like(composed, with_mark) && looks_like(with_mark, composed));
        assert!(!looks_like(with_mark, with_mark) && !looks_like(with_mark, "Blute"));
        assert!(!looks_like(composed, "Bl\u{f6}te") && !looks_like("Bluete", "Blute"));
        assert!(did_you_mean(composed, [with_mark]).is_some_and(|said| said.contains("looks the same")));
        assert_eq!(did_you_mean("Blut", ["Blute"]).as_deref(), Some("did you mean `Blute`?"));
    }
}
