//! Scenes of the first pass of a render, kept for the second.
//!
//! The second pass draws what the first has drawn. Scenes that fit in [`ROOM`] are kept in between; the others are drawn again. Pictures do
//! not depend on which are kept, because the turtle draws the same to the last bit; scenes that it would draw differently with an accuracy, which
//! only the second pass knows, are never kept.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::scene::Scene;
use crate::sim::Stats;

/// Most bytes of the scenes that are kept. A scene that is alone is kept whatever its size: it is in memory in the second pass as well.
const ROOM: usize = 64 << 20;

/// Scenes by frame.
#[derive(Default)]
pub struct Album(Mutex<Pages>);

#[derive(Default)]
struct Pages {
    scenes: HashMap<usize, Kept>,
    bytes: usize,
    stats: Option<Stats>,
}

/// A scene that is kept.
pub struct Kept {
    pub scene: Scene,
    /// Modules of its string, brackets not counted.
    pub modules: usize,
}

impl Album {
    fn pages(&self) -> MutexGuard<'_, Pages> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps the scene of one of `count` frames, or gives it back.
    pub fn keep(&self, index: usize, count: usize, kept: Kept) -> Option<Scene> {
        let bytes = kept.scene.footprint();
        let mut pages = self.pages();
        if kept.scene.lacked_accuracy || (count > 1 && pages.bytes + bytes > ROOM) {
            return Some(kept.scene);
        }
        pages.bytes += bytes;
        pages.scenes.insert(index, kept);
        None
    }

    /// Keeps the statistics of the first pass.
    pub fn finish(&self, stats: Stats) {
        self.pages().stats = Some(stats);
    }

    /// The statistics, if the scenes of all `count` frames are kept.
    pub fn stats_of_all(&self, count: usize) -> Option<Stats> {
        let pages = self.pages();
        pages.stats.filter(|_| pages.scenes.len() == count)
    }

    /// The number of modules of a frame that is kept.
    pub fn modules(&self, index: usize) -> Option<usize> {
        self.pages().scenes.get(&index).map(|kept| kept.modules)
    }

    /// Takes the scene of a frame out, if it is kept.
    pub fn take(&self, index: usize) -> Option<Scene> {
        self.pages().scenes.remove(&index).map(|kept| kept.scene)
    }
}

/// What a pass does with the scenes of an album.
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
        album.keep(index, count, Kept { scene, modules: 7 }).is_none()
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
        assert_eq!((album.modules(2), album.modules(5)), (Some(7), None));
        assert!(album.take(2).is_some() && album.take(2).is_none());
        assert!(keep(&Album::default(), 0, 1, scene(large)), "alone");
    }

    #[test]
    fn a_scene_that_an_accuracy_would_change_is_not_kept() {
        let mut bent = scene(3);
        bent.lacked_accuracy = true;
        assert!(!keep(&Album::default(), 0, 1, bent));
    }
}
