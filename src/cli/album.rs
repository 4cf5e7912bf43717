//! Scenes and strings of the first pass of a render, kept for the second.
//!
//! The second pass draws what the first has drawn. Scenes that fit in [`ROOM`] are kept in between; of the others, the strings that fit are, and
//! are drawn again. If a frame is neither, all are simulated again. Pictures do not depend on which are kept, because the turtle draws the same to
//! the last bit; of scenes that it would draw differently with an accuracy, which only the second pass knows, only strings are kept.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::scene::Scene;
use crate::sim::Stats;
use crate::tree::ModuleString;

/// Most bytes of what is kept. A scene or string that is alone is kept whatever its size: it is in memory in the second pass as well.
const ROOM: usize = 64 << 20;

/// Scenes or strings by frame.
#[derive(Default)]
pub struct Album(Mutex<Pages>);

#[derive(Default)]
struct Pages {
    kept: HashMap<usize, Kept>,
    bytes: usize,
    stats: Option<Stats>,
}

/// A scene, or a string to be drawn again.
enum Content {
    Scene(Box<Scene>),
    String(Box<ModuleString>),
}

struct Kept {
    content: Content,
    /// Modules of the string, brackets not counted.
    modules: usize,
}

impl Album {
    fn pages(&self) -> MutexGuard<'_, Pages> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps the scene of one of `count` frames, or gives it back and keeps its string of so many modules, if there is room.
    pub fn keep(
        &self,
        (index, count): (usize, usize),
        scene: Scene,
        (string, modules): (ModuleString, usize),
    ) -> Option<Scene> {
        let mut pages = self.pages();
        let mut put = |bytes: usize| {
            let fits = count <= 1 || pages.bytes + bytes <= ROOM;
            pages.bytes += if fits { bytes } else { 0 };
            fits
        };
        let (content, scene) = if !scene.lacked_accuracy && put(scene.footprint()) {
            (Content::Scene(Box::new(scene)), None)
        } else if put(string.footprint()) {
            (Content::String(Box::new(string)), Some(scene))
        } else {
            return Some(scene);
        };
        pages.kept.insert(index, Kept { content, modules });
        scene
    }

    /// Keeps the statistics of the first pass.
    pub fn finish(&self, stats: Stats) {
        self.pages().stats = Some(stats);
    }

    /// The statistics, if all `count` frames are kept.
    pub fn stats_of_all(&self, count: usize) -> Option<Stats> {
        let pages = self.pages();
        pages.stats.filter(|_| pages.kept.len() == count)
    }

    /// The string of a frame that is kept, which is empty if its scene is, and the number of its modules.
    pub fn string(&self, index: usize) -> (ModuleString, usize) {
        match self.pages().kept.get_mut(&index) {
            Some(Kept { content: Content::String(string), modules }) => (std::mem::take(string), *modules),
            Some(Kept { modules, .. }) => (ModuleString::default(), *modules),
            None => (ModuleString::default(), 0),
        }
    }

    /// Takes the scene of a frame out, if it is kept.
    pub fn take(&self, index: usize) -> Option<Scene> {
        match self.pages().kept.remove(&index)?.content {
            Content::Scene(scene) => Some(*scene),
            Content::String(_) => None,
        }
    }
}

/// What a pass does with an album.
#[derive(Clone, Copy)]
pub enum Keeping<'a> {
    Nothing,
    Fill(&'a Album),
    Use(&'a Album),
}

impl<'a> Keeping<'a> {
    /// The album that is filled.
    pub fn filled(self) -> Option<&'a Album> {
        if let Keeping::Fill(album) = self { Some(album) } else { None }
    }

    /// The album whose scenes are used.
    pub fn used(self) -> Option<&'a Album> {
        if let Keeping::Use(album) = self { Some(album) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::KindId;
    use crate::scene::{MaterialId, Owner, Point, Polygon};
    use crate::tree::Lineage;

    fn scene(vertices: usize) -> Scene {
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(0) });
        let vertices = vec![Point::origin(); vertices];
        scene.polygons.push(Polygon { vertices, material: MaterialId::LEAF, owner });
        scene
    }

    fn keep(album: &Album, index: usize, count: usize, scene: Scene) -> bool {
        album.keep((index, count), scene, (string(ROOM / 8), 7)).is_none()
    }

    fn string(parameters: usize) -> ModuleString {
        let mut string = ModuleString::default();
        string.push(KindId::OPEN, std::iter::repeat_n(0.5, parameters), 0.0, Lineage::of_axiom(0));
        string
    }

    #[test]
    fn scenes_are_kept_while_there_is_room() {
        let (small, large) = (ROOM / 24 / 4, ROOM / 24 * 2);
        let album = Album::default();
        assert!(keep(&album, 2, 6, scene(small)) && keep(&album, 0, 6, scene(small)));
        assert!(keep(&album, 1, 6, scene(small)));
        assert!(!keep(&album, 3, 6, scene(large)) && !keep(&album, 4, 6, scene(small)), "full");
        album.finish(Stats::default());
        assert!(album.stats_of_all(6).is_none() && album.stats_of_all(3).is_some());
        assert_eq!([2, 5].map(|index| album.string(index).1), [7, 0]);
        assert!(album.take(2).is_some() && album.take(2).is_none());
        assert!(keep(&Album::default(), 0, 1, scene(large)), "alone");
    }

    #[test]
    fn of_a_scene_that_an_accuracy_would_change_the_string_is_kept() {
        let bent = || {
            let mut scene = scene(3);
            scene.lacked_accuracy = true;
            scene
        };
        let album = Album::default();
        assert!(album.keep((0, 2), bent(), (string(2), 7)).is_some());
        assert!(album.keep((1, 2), bent(), (string(ROOM / 8), 8)).is_some(), "no room");
        album.finish(Stats::default());
        assert!(album.stats_of_all(2).is_none() && album.stats_of_all(1).is_some());
        let (kept, modules) = album.string(0);
        assert_eq!((kept.get(0).parameters, modules), (&[0.5, 0.5][..], 7));
        assert!(album.take(0).is_none() && album.string(1).1 == 0);
        assert!(!keep(&album, 0, 1, bent()) && album.string(0).0.len() == 1, "alone");
    }
}
