//! Animated WebP: lossless frames ([`vp8l`]) in its container (RFC 9649, section 2).

use std::io::{self, Seek, SeekFrom, Write};

use crate::pipeline::Pipeline;
use crate::{Encoder, Frame, Shape, Ticks, invalid, vp8l};

const HAS_ANIMATION: u8 = 0x02;
const HAS_ALPHA: u8 = 0x10;
/// A frame replaces the pixels below it; else opaque ones do, and those of opacity 0 leave them.
const REPLACES: u8 = 0x02;
/// Place of the first byte of flags.
const FLAGS: u64 = 20;
/// Pixels that are encoded at once, at most, where there is more than one frame in work. Each takes about 40 bytes of memory: tokens, residuals, and the tables that find copies.
const PIXELS_AT_ONCE: u64 = 25_000_000;
/// Most pixels of a frame: 4 GB of memory.
const MOST_PIXELS: u64 = 100_000_000;

/// The number of frames that are encoded at once, so that large ones do not fill the memory; `None` if a single one would.
fn at_once(shape: Shape, threads: usize) -> Option<usize> {
    let pixels = u64::from(shape.width) * u64::from(shape.height);
    let most = (PIXELS_AT_ONCE / pixels.max(1)).clamp(1, 1024) as usize;
    (pixels <= MOST_PIXELS).then_some(threads.min(most))
}

pub(crate) struct Webp<'w, W> {
    out: &'w mut W,
    /// Bytes behind the first eight.
    bytes: u64,
    begun: u64,
    flags: u8,
    ticks: Ticks,
    /// Frames with the head of each.
    frames: Pipeline<Vec<u8>>,
}

/// The lower 24 bits.
fn three(x: u32) -> [u8; 3] {
    let [a, b, c, _] = x.to_le_bytes();
    [a, b, c]
}

impl<'w, W: Write + Seek> Webp<'w, W> {
    pub(crate) fn new(out: &'w mut W, shape: Shape, threads: usize) -> io::Result<Webp<'w, W>> {
        let threads = at_once(shape, threads).ok_or_else(|| {
            invalid(format!(
                "webp films have at most {} million pixels a frame, because encoding one takes 40 bytes of memory for each; --format y4m has no such limit",
                MOST_PIXELS / 1_000_000
            ))
        })?;
        let begun = out.stream_position()?;
        // The size is not known yet.
        out.write_all(b"RIFF\0\0\0\0WEBP")?;
        let flags = HAS_ANIMATION | if shape.has_alpha { HAS_ALPHA } else { 0 };
        let (ticks, frames) = (Ticks::WEBP, Pipeline::new(threads));
        let mut webp = Webp { out, bytes: 4, begun, flags, ticks, frames };
        let mut head = vec![flags, 0, 0, 0];
        head.extend(three(shape.width - 1));
        head.extend(three(shape.height - 1));
        webp.chunk(b"VP8X", &head)?;
        // No colour of a background, and no end of repetitions.
        webp.chunk(b"ANIM", &[0; 6])?;
        Ok(webp)
    }

    fn chunk(&mut self, name: &[u8; 4], data: &[u8]) -> io::Result<()> {
        let length = u32::try_from(data.len()).map_err(io::Error::other)?;
        self.out.write_all(name)?;
        self.out.write_all(&length.to_le_bytes())?;
        self.out.write_all(data)?;
        if data.len() % 2 == 1 {
            self.out.write_all(&[0])?;
        }
        self.bytes += 8 + data.len().next_multiple_of(2) as u64;
        Ok(())
    }
}

impl<W: Write + Seek> Encoder for Webp<'_, W> {
    fn add(&mut self, frame: &Frame<'_>) -> io::Result<()> {
        let part = frame.changed.even();
        let over = frame.over(part);
        let is_over = over.is_some();
        if is_over {
            // Pixels that leave those below count as transparent, even if nothing in the film is.
            self.flags |= HAS_ALPHA;
        }
        let pixels = over.unwrap_or_else(|| frame.cut(part));
        let mut data = Vec::new();
        for number in [part.left / 2, part.top / 2, part.width - 1, part.height - 1] {
            data.extend(three(number));
        }
        data.extend(three(self.ticks.up_to(frame.end)));
        data.push(if is_over { 0 } else { REPLACES });
        let encode = move || {
            let picture = vp8l::encode(&pixels, part.width as usize, is_over);
            data.extend(b"VP8L");
            data.extend((picture.len() as u32).to_le_bytes());
            data.extend(&picture);
            data.extend((picture.len() % 2 == 1).then_some(0));
            data
        };
        match self.frames.push(encode) {
            Some(data) => self.chunk(b"ANMF", &data),
            None => Ok(()),
        }
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        while let Some(data) = self.frames.pop() {
            self.chunk(b"ANMF", &data)?;
        }
        let bytes = u32::try_from(self.bytes)
            .map_err(|_| io::Error::other("a WebP file has at most 4 GiB: fewer or smaller frames"))?;
        self.out.seek(SeekFrom::Start(self.begun + 4))?;
        self.out.write_all(&bytes.to_le_bytes())?;
        self.out.seek(SeekFrom::Start(self.begun + FLAGS))?;
        self.out.write_all(&[self.flags])?;
        self.out.seek(SeekFrom::End(0))?;
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_frames_are_encoded_one_by_one() {
        let shape = |width, height| Shape { width, height, has_alpha: false };
        assert_eq!(at_once(shape(480, 572), 8), Some(8));
        assert_eq!(at_once(shape(3840, 2160), 8), Some(3));
        assert_eq!(at_once(shape(8000, 6000), 8), Some(1));
        assert_eq!(at_once(shape(16_384, 16_384), 1), None);
        let mut out = io::Cursor::new(Vec::new());
        let refused = Webp::new(&mut out, shape(16_384, 16_384), 1).err().expect("refused");
        assert!(refused.to_string().contains("100 million pixels"), "{refused}");
    }
}
