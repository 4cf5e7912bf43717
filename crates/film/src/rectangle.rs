//! Rectangles of pixels.

use crate::Shape;

/// A part of a frame, not empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rectangle {
    pub(crate) left: u32,
    pub(crate) top: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl Rectangle {
    /// With even left and top, which WebP asks for.
    pub(crate) fn even(self) -> Rectangle {
        let (x, y) = (self.left % 2, self.top % 2);
        Rectangle { left: self.left - x, top: self.top - y, width: self.width + x, height: self.height + y }
    }

    /// The bytes of its rows in a frame, one after another.
    pub(crate) fn rows(self, pixels: &[u8], shape: Shape) -> impl Iterator<Item = &[u8]> {
        let channels = shape.channels();
        let (left, width) = (self.left as usize * channels, self.width as usize * channels);
        let rows = pixels.chunks_exact(shape.width as usize * channels);
        rows.skip(self.top as usize).take(self.height as usize).map(move |row| &row[left..left + width])
    }
}

/// The smallest rectangle around all pixels that differ; the first pixel where none do.
pub(crate) fn changed(before: &[u8], after: &[u8], shape: Shape) -> Rectangle {
    let channels = shape.channels();
    let stride = shape.width as usize * channels;
    let (mut top, mut bottom) = (None, 0);
    let (mut left, mut right) = (usize::MAX, 0);
    for (y, (a, b)) in before.chunks_exact(stride).zip(after.chunks_exact(stride)).enumerate() {
        if a == b {
            continue;
        }
        top.get_or_insert(y);
        bottom = y;
        let differs = |x: &usize| a[*x] != b[*x];
        left = (0..stride).find(differs).map_or(left, |x| left.min(x / channels));
        right = (0..stride).rev().find(differs).map_or(right, |x| right.max(x / channels));
    }
    match top {
        None => Rectangle { left: 0, top: 0, width: 1, height: 1 },
        Some(top) => Rectangle {
            left: left as u32,
            top: top as u32,
            width: (right - left + 1) as u32,
            height: (bottom - top + 1) as u32,
        },
    }
}
