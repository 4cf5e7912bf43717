//! Names of modules in files: the same from frame to frame, and unique within one.

use std::collections::HashMap;
use std::fmt::Write;

use crate::scene::{OwnerId, Scene};

/// The names of the modules of a scene, `KIND` + separator + `LINEAGE`: by what a module is called, and by
/// who it is ([`Lineage::name`](crate::structure::Lineage::name)). They consist of ASCII letters, digits,
/// `_`, `-` and the separator and begin with a letter or `_`, so that they are good as XML ids and as OBJ
/// group names.
pub(super) struct Names(Vec<String>);

impl Names {
    pub(super) fn new(scene: &Scene, separator: char) -> Names {
        let mut kinds: HashMap<&str, String> = HashMap::new();
        let mut seen: HashMap<String, usize> = HashMap::with_capacity(scene.owners().len());
        let names = scene.owners().iter().map(|owner| {
            let kind = kinds.entry(&owner.name).or_insert_with(|| plain(&owner.name));
            let mut name = format!("{kind}{separator}{}", owner.lineage.name());
            // Lineages are unique by construction, save for a hash that meets another.
            let count = seen.entry(name.clone()).or_insert(0);
            *count += 1;
            if *count > 1 {
                let _ = write!(name, "-{count}");
            }
            name
        });
        Names(names.collect())
    }

    pub(super) fn get(&self, id: OwnerId) -> &str {
        &self.0[id.index()]
    }
}

/// A name of a kind in ASCII letters, digits, `_` and `-`. The mark of a surface is dropped, `{` is
/// `polygon`, other characters are written as `u` and their code.
fn plain(name: &str) -> String {
    let name = name.strip_prefix('@').unwrap_or(name);
    let mut out = String::new();
    for c in name.chars() {
        match c {
            'a'..='z' | 'A'..='Z' | '_' => out.push(c),
            '0'..='9' | '-' if !out.is_empty() => out.push(c),
            '{' | '}' => out.push_str("polygon"),
            other => {
                let _ = write!(out, "u{:x}", u32::from(other));
            }
        }
    }
    if out.is_empty() { "module".to_owned() } else { out }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_plain() {
        for (name, expected) in
            [("F_i", "F_i"), ("@L", "L"), ("F_α", "F_u3b1"), ("}", "polygon"), ("+", "u2b"), ("@", "module")]
        {
            assert_eq!(plain(name), expected);
        }
    }
}
