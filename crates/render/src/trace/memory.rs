//! Memory for rasters of cells, kept from frame to frame: the system takes longer to hand it out than it takes to fill. Rasters that are kept are empty, so
//! that only those cells are filled that something was in.

use std::sync::{Mutex, PoisonError};

use super::spans::Spans;

/// Rasters of more cells are not kept.
const MOST_CELLS: usize = 5_000_000;
/// Marks begin anew at this number.
const MOST_MARKS: u32 = u32::MAX / 2;

/// Rasters that were used before, for any number of threads.
#[derive(Debug, Default)]
pub(crate) struct Memory(Mutex<Vec<Rasters>>);

/// The rasters of a picture.
#[derive(Debug, Default)]
pub(crate) struct Rasters {
    /// Empty between pictures.
    pub(super) numbers: Vec<u32>,
    pub(super) depths: Vec<f32>,
    /// Of cells that have anything only.
    pub(super) strengths: Vec<f32>,
    pub(super) marks: MarkMemory,
}

/// Marks on cells, which need not be taken away: those of something new have numbers that no mark has yet.
#[derive(Debug, Default)]
pub(crate) struct MarkMemory {
    pub(super) on: Vec<u32>,
    last: u32,
}

impl MarkMemory {
    /// Room for marks on so many cells, if there is none yet on `most`, and the last number that was used.
    pub(super) fn begin(&mut self, cells: usize, most: usize) -> u32 {
        if self.last > MOST_MARKS {
            self.on.fill(0);
            self.last = 0;
        }
        let room = if most > MOST_CELLS { cells } else { most.max(cells) };
        if self.on.len() < cells {
            self.on = vec![0; room];
        }
        self.last
    }

    /// Remembers the last number.
    pub(super) fn end(&mut self, last: u32) {
        self.last = last;
    }
}

impl Memory {
    /// Rasters with nothing in them.
    pub(super) fn take(&self) -> Rasters {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Keeps rasters for the next picture. Triangles are in the first ones of these cells, and nothing is beyond the others.
    pub(super) fn keep(&self, mut rasters: Rasters, [seen, beyond]: [&Spans; 2]) {
        if rasters.numbers.len() > MOST_CELLS {
            return;
        }
        seen.fill(&mut rasters.depths, f32::NEG_INFINITY);
        beyond.fill(&mut rasters.numbers, 0);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(rasters);
    }
}

/// A raster of so many cells, all with this value, which those of the kept one have. There is room for `most` cells.
pub(crate) fn empty<T: Clone>(kept: &mut Vec<T>, [cells, most]: [usize; 2], value: T) -> Vec<T> {
    let mut raster = std::mem::take(kept);
    if raster.capacity() < cells {
        let most = if most > MOST_CELLS { cells } else { most.max(cells) };
        // New memory is often empty without being filled.
        raster = vec![value.clone(); most];
    }
    raster.resize(cells, value);
    raster
}

#[cfg(test)]
mod tests {
    use crate::{Format, FrameWriter, Survey, View};
    use dlsys_geometry::scene::{MaterialId, Owner, Point, Polygon, Scene};
    use dlsys_tree::Lineage;

    /// A fan of polygons that stand in front of one another, of this size.
    fn fan(size: f64) -> Scene {
        let mut scene = Scene::default();
        for i in 0..12 {
            let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(i) });
            let (turn, material) = (i as f64 * 0.7, [MaterialId::LEAF, MaterialId::STEM][i % 2]);
            let at = |x: f64, y: f64| Point::new(x * turn.cos(), y + turn, x * turn.sin()) * size;
            let vertices = vec![at(0.0, 0.0), at(3.0, 1.0), at(4.0, 5.0), at(1.0, 4.0)];
            scene.polygons.push(Polygon { vertices, material, owner });
        }
        scene
    }

    #[test]
    fn pictures_do_not_depend_on_those_before() {
        let scenes = [1.0, 0.3, 0.8, 0.05, 1.0].map(fan);
        let mut survey = Survey::new(View::FRONT);
        scenes.iter().for_each(|scene| survey.add(scene));
        let writer = || FrameWriter::new(Format::SVG, survey.clone().fit());
        let kept = writer();
        for scene in &scenes {
            let svg = kept.write(scene, "");
            assert!(String::from_utf8_lossy(&svg).matches("<path").count() > 5);
            assert_eq!(svg, writer().write(scene, ""));
        }
    }
}
