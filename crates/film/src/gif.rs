//! Animated GIF: each frame has the palette of its own changes.

use std::collections::HashMap;
use std::io::{self, Write};

use crate::palette::{self, Colour};
use crate::{Encoder, Frame, Shape, Ticks};

pub(crate) struct Gif<'w, W: Write> {
    encoder: gif::Encoder<&'w mut W>,
    ticks: Ticks,
    /// The picture as it is shown: colours of palettes.
    shown: Vec<Colour>,
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
        let shown = vec![[0; 3]; shape.width as usize * shape.height as usize];
        // Browsers slow down frames of less than two hundredths of a second.
        Ok(Gif { encoder, ticks: Ticks::GIF, shown })
    }
}

impl<W: Write> Encoder for Gif<'_, W> {
    fn add(&mut self, frame: &Frame<'_>) -> io::Result<()> {
        let part = frame.changed;
        let colours = |pixels| part.rows(pixels, frame.shape).flat_map(|row| row.as_chunks::<3>().0);
        let mut old = frame.before.map(colours);
        // What has not changed stays: it is not compressed, and its colour is not chosen anew.
        let changes: Vec<Option<Colour>> = colours(frame.pixels)
            .map(|colour| Some(*colour).filter(|_| old.as_mut().and_then(Iterator::next) != Some(colour)))
            .collect();
        let mut counts: HashMap<Colour, u32> = HashMap::new();
        changes.iter().flatten().for_each(|colour| *counts.entry(*colour).or_default() += 1);
        let palette = palette::choose(counts);
        let clear = palette.colours.len();
        let (left, width) = (part.left as usize, part.width as usize);
        let mut indices = Vec::with_capacity(changes.len());
        for (i, change) in changes.into_iter().enumerate() {
            let at = (part.top as usize + i / width) * frame.shape.width as usize + left + i % width;
            let Some((colour, index)) =
                change.and_then(|colour| Some((colour, *palette.nearest.get(&colour)?)))
            else {
                indices.push(clear as u8);
                continue;
            };
            // A colour that is shown already, and is as near, stays as well: no flicker by another palette.
            let offered = palette.colours[usize::from(index)];
            let stays = frame.before.is_some()
                && palette::distance(self.shown[at], colour) <= palette::distance(offered, colour);
            if !stays {
                self.shown[at] = offered;
            }
            indices.push(if stays { clear as u8 } else { index });
        }
        let mut still = gif::Frame {
            left: part.left as u16,
            top: part.top as u16,
            width: part.width as u16,
            height: part.height as u16,
            delay: self.ticks.up_to(frame.end) as u16,
            dispose: gif::DisposalMethod::Keep,
            transparent: Some(clear as u8),
            buffer: indices.into(),
            ..gif::Frame::default()
        };
        let mut colours = palette.colours.concat();
        colours.extend([0; 3]);
        still.palette = Some(colours);
        self.encoder.write_frame(&still).map_err(failed)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        // The encoder writes the end of the file here.
        self.encoder.into_inner().map_err(failed)?.flush()
    }
}
