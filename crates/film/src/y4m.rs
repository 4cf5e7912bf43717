//! Raw video, YUV4MPEG2 (mjpegtools): every pixel with its own brightness and colour, by ITU-R BT.601 in the limited range.

use std::io::{self, Write};

use crate::{Encoder, Frame, Shape};

pub(crate) struct Y4m<'w, W> {
    out: &'w mut W,
    planes: [Vec<u8>; 3],
}

impl<'w, W: Write> Y4m<'w, W> {
    /// All frames last equally long: frames that do not in the model get the mean.
    pub(crate) fn new(out: &'w mut W, shape: Shape, ends: &[f64]) -> io::Result<Y4m<'w, W>> {
        let rate = ends.len() as f64 / ends.last().copied().unwrap_or(1.0).max(1e-6);
        let (rate, unit) = ratio(rate);
        let Shape { width, height, .. } = shape;
        writeln!(out, "YUV4MPEG2 W{width} H{height} F{rate}:{unit} Ip A1:1 C444 XCOLORRANGE=LIMITED")?;
        Ok(Y4m { out, planes: Default::default() })
    }
}

/// A rate as a fraction, to a thousandth.
fn ratio(rate: f64) -> (u64, u64) {
    let (mut a, mut b) = ((rate * 1000.0).round().clamp(1.0, 1e12) as u64, 1000);
    let whole = (a, b);
    while b > 0 {
        (a, b) = (b, a % b);
    }
    (whole.0 / a, whole.1 / a)
}

/// Brightness and the two differences of colour.
pub(crate) fn yuv(rgb: &[u8]) -> [u8; 3] {
    let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(f64::from);
    let y = 0.299 * r + 0.587 * g + 0.114 * b;
    let blue = (b - y) / (2.0 * (1.0 - 0.114));
    let red = (r - y) / (2.0 * (1.0 - 0.299));
    [16.0 + y * 219.0 / 255.0, 128.0 + blue * 224.0 / 255.0, 128.0 + red * 224.0 / 255.0]
        .map(|x| x.round() as u8)
}

impl<W: Write> Encoder for Y4m<'_, W> {
    fn add(&mut self, frame: &Frame<'_>) -> io::Result<()> {
        self.planes.iter_mut().for_each(Vec::clear);
        for rgb in frame.pixels.chunks_exact(3) {
            self.planes.iter_mut().zip(yuv(rgb)).for_each(|(plane, x)| plane.push(x));
        }
        self.out.write_all(b"FRAME\n")?;
        self.planes.iter().try_for_each(|plane| self.out.write_all(plane))
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_fractions_and_colours_those_of_the_standard() {
        assert_eq!([50.0, 23.976, 0.5].map(ratio), [(50, 1), (2997, 125), (1, 2)]);
        assert_eq!(yuv(&[255, 255, 255]), [235, 128, 128]);
        assert_eq!(yuv(&[0, 0, 0]), [16, 128, 128]);
        assert_eq!(yuv(&[255, 0, 0]), [81, 90, 240]);
        assert_eq!(yuv(&[0, 0, 255]), [41, 240, 110]);
    }
}
