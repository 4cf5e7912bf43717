//! The binary part of the file: accessors and what they describe. The same numbers are written once.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::Arc;

use super::document::{Accessor, Bytes, Document, Image, View};
use dlsys_geometry::scene::Picture;

const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Views of the buffer: attributes of corners, triangles, tracks, places in pictures, sizes of points; a view for each picture follows.
const ATTRIBUTES: usize = 0;
const TRIANGLES: usize = 1;
const TRACKS: usize = 2;
const PLACES: usize = 3;
const SIZES: usize = 4;

/// What vectors are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Positions of corners, or their differences, whose bounds the file has to name.
    Place,
    /// Normals of corners, or their differences.
    Normal,
    /// Of a track.
    Motion,
}

/// Accessors and bytes.
#[derive(Debug, Default)]
pub(super) struct Buffer {
    views: [Vec<u8>; 5],
    pictures: Vec<Arc<Picture>>,
    accessors: Vec<Accessor>,
    /// Accessors by a hash of all that they are, bytes included.
    known: HashMap<u64, Vec<usize>>,
}

impl Buffer {
    /// Times of keys, in seconds, ascending.
    pub(super) fn times(&mut self, times: &[f32]) -> usize {
        self.floats(times, 1, "SCALAR", TRACKS, true)
    }

    /// Weights of keys, or other single numbers of a track.
    pub(super) fn scalars(&mut self, values: &[f32]) -> usize {
        self.floats(values, 1, "SCALAR", TRACKS, false)
    }

    pub(super) fn vectors(&mut self, values: &[[f32; 3]], kind: Kind) -> usize {
        let view = if kind == Kind::Motion { TRACKS } else { ATTRIBUTES };
        self.floats(values.as_flattened(), 3, "VEC3", view, kind == Kind::Place)
    }

    pub(super) fn turns(&mut self, values: &[[f32; 4]]) -> usize {
        self.floats(values.as_flattened(), 4, "VEC4", TRACKS, false)
    }

    /// Places of corners in a picture.
    pub(super) fn places(&mut self, values: &[[f32; 2]]) -> usize {
        self.floats(values.as_flattened(), 2, "VEC2", PLACES, false)
    }

    /// Sizes of points.
    pub(super) fn sizes(&mut self, values: &[f32]) -> usize {
        self.floats(values, 1, "SCALAR", SIZES, false)
    }

    /// The file of a picture; returns its number among the images.
    pub(super) fn picture(&mut self, picture: &Arc<Picture>) -> usize {
        let known = self.pictures.iter().position(|known| known == picture);
        known.unwrap_or_else(|| {
            self.pictures.push(picture.clone());
            self.pictures.len() - 1
        })
    }

    /// Numbers of corners.
    pub(super) fn indices(&mut self, corners: &[u32]) -> usize {
        let greatest = corners.iter().copied().max().unwrap_or(0);
        // The greatest of 16 bits ends a strip.
        let (kind, bytes): (u32, Vec<u8>) = match greatest < 65_535 {
            true => (UNSIGNED_SHORT, corners.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()),
            false => (UNSIGNED_INT, corners.iter().flat_map(|i| i.to_le_bytes()).collect()),
        };
        self.add((TRIANGLES, kind, corners.len(), "SCALAR"), &bytes, [Vec::new(), Vec::new()])
    }

    fn floats(
        &mut self,
        values: &[f32],
        width: usize,
        shape: &'static str,
        view: usize,
        has_bounds: bool,
    ) -> usize {
        // One zero, so that equal numbers have equal bytes.
        let bytes: Vec<u8> = values.iter().flat_map(|x| (x + 0.0).to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f64> {
            let column = |k: usize| values.iter().skip(k).step_by(width).copied().reduce(pick);
            (0..width).filter_map(column).map(|x| f64::from(x + 0.0)).collect()
        };
        let bounds = if has_bounds { [bound(f32::min), bound(f32::max)] } else { [Vec::new(), Vec::new()] };
        self.add((view, FLOAT, values.len() / width, shape), &bytes, bounds)
    }

    fn add(
        &mut self,
        (view, component_type, count, shape): (usize, u32, usize, &'static str),
        bytes: &[u8],
        [min, max]: [Vec<f64>; 2],
    ) -> usize {
        let mut hasher = DefaultHasher::new();
        (view, component_type, shape, min.is_empty(), bytes).hash(&mut hasher);
        let known = self.known.entry(hasher.finish()).or_default();
        let data = &mut self.views[view];
        let is_same = |number: &&usize| {
            let old: &Accessor = &self.accessors[**number];
            let place = old.byte_offset..old.byte_offset + bytes.len();
            old.buffer_view == view
                && (old.component_type, old.count, old.shape) == (component_type, count, shape)
                && old.min.is_empty() == min.is_empty()
                && data.get(place) == Some(bytes)
        };
        if let Some(&number) = known.iter().find(is_same) {
            return number;
        }
        let byte_offset = data.len();
        data.extend(bytes);
        data.resize(data.len().next_multiple_of(4), 0);
        known.push(self.accessors.len());
        self.accessors.push(Accessor {
            buffer_view: view,
            byte_offset,
            component_type,
            count,
            shape,
            min,
            max,
        });
        self.accessors.len() - 1
    }

    /// Puts accessors and views into the document and returns the bytes of its buffer.
    pub(super) fn finish(self, document: &mut Document) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut numbers = [0; 5];
        let attributes = |width| (Some(width), Some(ARRAY_BUFFER));
        let kinds =
            [attributes(12), (None, Some(ELEMENT_ARRAY_BUFFER)), (None, None), attributes(8), attributes(4)];
        for ((view, number), (byte_stride, target)) in self.views.iter().zip(&mut numbers).zip(kinds) {
            if view.is_empty() {
                continue;
            }
            *number = document.buffer_views.len();
            let (byte_offset, byte_length) = (bytes.len(), view.len());
            document.buffer_views.push(View { buffer: 0, byte_offset, byte_length, byte_stride, target });
            bytes.extend(view);
        }
        for picture in &self.pictures {
            let view = View {
                buffer: 0,
                byte_offset: bytes.len(),
                byte_length: picture.file.len(),
                byte_stride: None,
                target: None,
            };
            let stem = Path::new(&*picture.path).file_stem().unwrap_or_default();
            let (name, buffer_view) = (stem.to_string_lossy().into_owned(), document.buffer_views.len());
            document.images.push(Image { name, buffer_view, mime_type: "image/png" });
            document.buffer_views.push(view);
            bytes.extend(&picture.file);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        document.accessors = self.accessors;
        for accessor in &mut document.accessors {
            accessor.buffer_view = numbers[accessor.buffer_view];
        }
        if !bytes.is_empty() {
            document.buffers.push(Bytes { byte_length: bytes.len() });
        }
        bytes
    }
}
