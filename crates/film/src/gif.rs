//! Animated GIF: each frame has the palette of its own changes.

use std::io::{self, Write};

use crate::{Encoder, Frame, Shape, Ticks};

/// How coarse palettes are chosen where there are more than 256 colours: 1 (slow) to 30.
const COARSENESS: i32 = 10;

pub(crate) struct Gif<'w, W: Write> {
    encoder: gif::Encoder<&'w mut W>,
    ticks: Ticks,
}

fn failed(error: gif::EncodingError) -> io::Error {
    match error {
        gif::EncodingError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl<'w, W: Write> Gif<'w, W> {
    pub(crate) fn new(out: &'w mut W, shape: Shape) -> io::Result<Gif<'w, W>> {
        let mut encoder =
            gif::Encoder::new(out, shape.width as u16, shape.height as u16, &[]).map_err(failed)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
        // Browsers slow down frames of less than two hundredths of a second.
        Ok(Gif { encoder, ticks: Ticks::new(100.0, [2, 65_535]) })
    }
}

impl<W: Write> Encoder for Gif<'_, W> {
    fn add(&mut self, frame: &Frame<'_>) -> io::Result<()> {
        let part = frame.changed;
        // What has not changed is transparent: it is not compressed, and its colour is not chosen anew.
        let mut pixels: Vec<u8> = Vec::with_capacity(part.width as usize * part.height as usize * 4);
        let mut add = |rgb: &[u8], seen: bool| match seen {
            true => pixels.extend([rgb[0], rgb[1], rgb[2], 255]),
            false => pixels.extend([0; 4]),
        };
        let rows = part.rows(frame.pixels, frame.shape);
        match frame.before {
            None => rows.flat_map(|row| row.chunks_exact(3)).for_each(|rgb| add(rgb, true)),
            Some(before) => {
                let old = part.rows(before, frame.shape).flat_map(|row| row.chunks_exact(3));
                rows.flat_map(|row| row.chunks_exact(3)).zip(old).for_each(|(rgb, old)| add(rgb, rgb != old));
            }
        }
        let (width, height) = (part.width as u16, part.height as u16);
        let mut still = gif::Frame::from_rgba_speed(width, height, &mut pixels, COARSENESS);
        (still.left, still.top) = (part.left as u16, part.top as u16);
        still.delay = self.ticks.up_to(frame.end) as u16;
        still.dispose = gif::DisposalMethod::Keep;
        self.encoder.write_frame(&still).map_err(failed)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        // The encoder writes the end of the file here.
        self.encoder.into_inner().map_err(failed)?.flush()
    }
}
