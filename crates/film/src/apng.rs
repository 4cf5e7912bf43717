//! Animated PNG (W3C, *Portable Network Graphics*, third edition, 2025).

use std::io::{self, Write};

use crate::{Encoder, Frame, Shape, Ticks};

pub(crate) struct Apng<'w, W: Write> {
    writer: png::Writer<&'w mut W>,
    /// Whether there are frames over others; their pixels have an opacity.
    is_layered: bool,
    ticks: Ticks,
}

impl<'w, W: Write> Apng<'w, W> {
    pub(crate) fn new(out: &'w mut W, shape: Shape, frames: usize) -> io::Result<Apng<'w, W>> {
        let is_layered = frames > 1 || shape.has_alpha;
        let mut encoder = png::Encoder::new(out, shape.width, shape.height);
        encoder.set_color(if is_layered { png::ColorType::Rgba } else { png::ColorType::Rgb });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        // No end of repetitions.
        encoder.set_animated(u32::try_from(frames).map_err(io::Error::other)?, 0)?;
        encoder.set_blend_op(png::BlendOp::Source)?;
        Ok(Apng { writer: encoder.write_header()?, is_layered, ticks: Ticks::APNG })
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
        if !self.is_layered {
            return Ok(self.writer.write_image_data(frame.pixels)?);
        }
        let over = frame.over(part);
        let is_over = over.is_some();
        self.writer.set_blend_op(if is_over { png::BlendOp::Over } else { png::BlendOp::Source })?;
        // Differences between neighbours would not be 0 where the frame before shows through.
        self.writer.set_filter(if is_over { png::Filter::NoFilter } else { png::Filter::Adaptive });
        let pixels = over.unwrap_or_else(|| frame.cut(part));
        let bytes: Vec<u8> =
            pixels.into_iter().flat_map(|pixel| pixel.rotate_left(8).to_be_bytes()).collect();
        Ok(self.writer.write_image_data(&bytes)?)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        Ok(self.writer.finish()?)
    }
}
