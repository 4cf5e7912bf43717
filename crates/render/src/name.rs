//! Names of modules in files: the same from frame to frame, and unique within one. And names of copies of pictures.

use std::collections::{HashMap, HashSet};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

use dlsys_geometry::scene::{Owner, OwnerId, Palette, Picture, Scene};
use rustc_hash::FxHashMap;

/// The names of the modules of a scene, `KIND` + separator + `LINEAGE`: the name of a kind and the
/// identity of the module ([`Lineage::name`](dlsys_tree::Lineage::name)). They consist of ASCII letters, digits,
/// `_`, `-` and the separator and begin with a letter or `_`, so that they are valid as XML ids and as OBJ
/// group names.
pub(super) struct Names<'s> {
    owners: &'s [Owner],
    separator: char,
    kinds: FxHashMap<&'s str, String>,
    /// The names of modules with equal lineages, which is possible only by a collision of hashes.
    shared: HashMap<usize, String>,
}

impl<'s> Names<'s> {
    pub(super) fn new(scene: &'s Scene, separator: char) -> Names<'s> {
        let owners = scene.owners();
        let mut kinds: FxHashMap<&str, String> = FxHashMap::default();
        for (i, owner) in owners.iter().enumerate() {
            if i == 0 || !Arc::ptr_eq(&owner.name, &owners[i - 1].name) {
                kinds.entry(&owner.name).or_insert_with(|| plain(&owner.name));
            }
        }
        let mut names = Names { owners, separator, kinds, shared: HashMap::new() };
        let mut ids: Vec<u64> = owners.iter().map(|owner| owner.lineage.id).collect();
        ids.sort_unstable();
        if ids.windows(2).any(|pair| pair[0] == pair[1]) {
            let twice: HashSet<u64> =
                ids.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
            let mut seen: HashMap<String, usize> = HashMap::new();
            for (i, _) in owners.iter().enumerate().filter(|(_, o)| twice.contains(&o.lineage.id)) {
                let mut name = String::new();
                names.push_usual(&mut name, i);
                let count = seen.entry(name.clone()).or_insert(0);
                *count += 1;
                if *count > 1 {
                    let _ = write!(name, "-{count}");
                }
                names.shared.insert(i, name);
            }
        }
        names
    }

    pub(super) fn get(&self, id: OwnerId) -> String {
        let mut name = String::new();
        self.push(&mut name, id);
        name
    }

    /// Appends a name.
    pub(super) fn push(&self, out: &mut String, id: OwnerId) {
        let shared = if self.shared.is_empty() { None } else { self.shared.get(&id.index()) };
        match shared {
            Some(name) => out.push_str(name),
            None => self.push_usual(out, id.index()),
        }
    }

    fn push_usual(&self, out: &mut String, owner: usize) {
        let owner = &self.owners[owner];
        // What is no module, such as the ground, is there once.
        if let Some(name) = owner.name.strip_prefix('=') {
            return out.push_str(name);
        }
        out.push_str(self.kinds.get(&*owner.name).map_or("", String::as_str));
        out.push(self.separator);
        owner.lineage.push_name(out);
    }
}

/// A name of a kind in ASCII letters, digits, `_` and `-`. The mark of a surface is dropped, `{` is
/// `polygon`, other characters are written as `u` and their code.
pub fn plain(name: &str) -> String {
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

/// The pictures of a palette, each once, with plain names of files for them: that of the model's file, as far as it is plain. No two differ in the case
/// of letters only, which some file systems take for one.
pub fn pictures(palette: &Palette) -> Vec<(Arc<Picture>, String)> {
    let mut named: Vec<(Arc<Picture>, String)> = Vec::new();
    for texture in palette.materials().iter().filter_map(|material| material.texture.as_ref()) {
        let picture = &texture.picture;
        if named.iter().any(|(known, _)| known == picture) {
            continue;
        }
        let stem = Path::new(&*picture.path).file_stem().map(|stem| stem.to_string_lossy());
        let stem = plain(stem.as_deref().unwrap_or_default());
        let is_free = |name: &str| named.iter().all(|(_, known)| !known.eq_ignore_ascii_case(name));
        let mut name = format!("{stem}.png");
        let mut count = 1;
        while !is_free(&name) {
            count += 1;
            name = format!("{stem}-{count}.png");
        }
        named.push((picture.clone(), name));
    }
    named
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
