//! Animated WebP: lossless frames (VP8L) of `image-webp` in a container of our own (Google, *WebP Container Specification*, 2024).

use std::io::{self, Seek, SeekFrom, Write};

use image_webp::{ColorType, WebPEncoder};

use crate::{Encoder, Frame, Shape, Ticks};

const HAS_ANIMATION: u8 = 0x02;
const HAS_ALPHA: u8 = 0x10;
/// A frame replaces the pixels below it.
const REPLACES: u8 = 0x02;

pub(crate) struct Webp<'w, W> {
    out: &'w mut W,
    /// Bytes behind the first eight.
    bytes: u64,
    begun: u64,
    ticks: Ticks,
}

/// The lower 24 bits.
fn three(x: u32) -> [u8; 3] {
    let [a, b, c, _] = x.to_le_bytes();
    [a, b, c]
}

impl<'w, W: Write + Seek> Webp<'w, W> {
    pub(crate) fn new(out: &'w mut W, shape: Shape) -> io::Result<Webp<'w, W>> {
        let begun = out.stream_position()?;
        // The size is not known yet.
        out.write_all(b"RIFF\0\0\0\0WEBP")?;
        let mut webp = Webp { out, bytes: 4, begun, ticks: Ticks::new(1000.0, [1, 0xff_ffff]) };
        let mut head = vec![HAS_ANIMATION | if shape.has_alpha { HAS_ALPHA } else { 0 }, 0, 0, 0];
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
        let mut still = Vec::new();
        let color = if frame.shape.has_alpha { ColorType::Rgba8 } else { ColorType::Rgb8 };
        WebPEncoder::new(&mut still)
            .encode(&part.cut(frame.pixels, frame.shape), part.width, part.height, color)
            .map_err(io::Error::other)?;
        let mut data = Vec::with_capacity(16 + still.len());
        for number in [part.left / 2, part.top / 2, part.width - 1, part.height - 1] {
            data.extend(three(number));
        }
        data.extend(three(self.ticks.up_to(frame.end)));
        data.push(REPLACES);
        // Behind the head of the still file there is one chunk, which is also the frame of an animation.
        data.extend(still.get(12..).unwrap_or_default());
        self.chunk(b"ANMF", &data)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        let bytes = u32::try_from(self.bytes)
            .map_err(|_| io::Error::other("a WebP file has at most 4 GiB: fewer or smaller frames"))?;
        self.out.seek(SeekFrom::Start(self.begun + 4))?;
        self.out.write_all(&bytes.to_le_bytes())?;
        self.out.seek(SeekFrom::End(0))?;
        self.out.flush()
    }
}
