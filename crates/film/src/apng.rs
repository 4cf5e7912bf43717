//! Animated PNG (W3C, *Portable Network Graphics*, third edition, 2025).

use std::io::{self, Write};

use crate::{Encoder, Frame, Shape, Ticks};

pub(crate) struct Apng<'w, W: Write> {
    writer: png::Writer<&'w mut W>,
    ticks: Ticks,
}

impl<'w, W: Write> Apng<'w, W> {
    pub(crate) fn new(out: &'w mut W, shape: Shape, frames: usize) -> io::Result<Apng<'w, W>> {
        let mut encoder = png::Encoder::new(out, shape.width, shape.height);
        encoder.set_color(if shape.has_alpha { png::ColorType::Rgba } else { png::ColorType::Rgb });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        // No end of repetitions.
        encoder.set_animated(u32::try_from(frames).map_err(io::Error::other)?, 0)?;
        encoder.set_blend_op(png::BlendOp::Source)?;
        Ok(Apng { writer: encoder.write_header()?, ticks: Ticks::new(1000.0, [1, 65_535]) })
    }
}

impl<W: Write> Encoder for Apng<'_, W> {
    fn add(&mut self, frame: &Frame<'_>) -> io::Result<()> {
        let part = frame.changed;
        self.writer.set_frame_delay(self.ticks.up_to(frame.end) as u16, 1000)?;
        if frame.before.is_some() {
            // In this order: the rectangle is within the picture at every step.
            self.writer.reset_frame_position()?;
            self.writer.set_frame_dimension(part.width, part.height)?;
            self.writer.set_frame_position(part.left, part.top)?;
        }
        Ok(self.writer.write_image_data(&part.cut(frame.pixels, frame.shape))?)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        Ok(self.writer.finish()?)
    }
}
