//! Pictures that are exposed for a while: moments of one page, averaged as a camera averages light.
//!
//! Channels are sRGB (IEC 61966-2-1). Light adds up in linear channels, so they are averaged there, each with the weight of its opacity, and the gamma curve comes back at the
//! end. The sums are whole numbers, so a pixel that is the same in all moments keeps its bits.

/// The linear light of each value of a channel, in parts of 65535.
fn light() -> [u32; 256] {
    std::array::from_fn(|value| {
        let c = value as f64 / 255.0;
        let linear = if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        (linear * 65535.0).round() as u32
    })
}

/// The value of a channel for each amount of light.
fn values() -> Vec<u8> {
    (0..=65535_u32)
        .map(|light| {
            let linear = f64::from(light) / 65535.0;
            let c = if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
            (c * 255.0).round() as u8
        })
        .collect()
}

/// A picture that is being exposed: the sum of its moments so far.
#[derive(Clone, Debug)]
pub struct Exposure {
    channels: usize,
    count: u32,
    sums: Vec<u32>,
    /// The only moment so far.
    first: Vec<u8>,
}

impl Exposure {
    /// Most moments of a picture.
    pub const MOST: u32 = 255;

    /// Nothing yet. Pixels have three channels, or a fourth one for the opacity, by which the others are not multiplied: as [`FrameWriter::pixels`](crate::FrameWriter::pixels) makes
    /// them.
    pub fn new(has_opacity: bool) -> Exposure {
        Exposure { channels: if has_opacity { 4 } else { 3 }, count: 0, sums: Vec::new(), first: Vec::new() }
    }

    /// Adds a moment, as long as all others. There are no more than [`MOST`](Exposure::MOST) of them, all of one size; others are left out.
    pub fn add(&mut self, pixels: Vec<u8>) {
        if self.count == 0 {
            (self.first, self.count) = (pixels, 1);
            return;
        }
        if self.count >= Exposure::MOST || pixels.len() != self.first.len() {
            return;
        }
        let light = light();
        if self.sums.is_empty() {
            self.sums = vec![0; pixels.len()];
            sum(&mut self.sums, &self.first, self.channels, &light);
        }
        sum(&mut self.sums, &pixels, self.channels, &light);
        self.count += 1;
    }

    /// The picture. Of one moment, it is that moment.
    pub fn finish(self) -> Vec<u8> {
        if self.count <= 1 {
            return self.first;
        }
        let values = values();
        let share = |sum: u32, whole: u32| values[((sum + whole / 2) / whole).min(65535) as usize];
        let mut out = self.first;
        for (out, sums) in out.chunks_exact_mut(self.channels).zip(self.sums.chunks_exact(self.channels)) {
            match *sums {
                [red, green, blue] => {
                    out.copy_from_slice(&[red, green, blue].map(|sum| share(sum, self.count)));
                }
                [red, green, blue, opacity] if opacity > 0 => {
                    let [red, green, blue] = [red, green, blue].map(|sum| share(sum, opacity));
                    let opacity = ((opacity + self.count / 2) / self.count) as u8;
                    out.copy_from_slice(&[red, green, blue, opacity]);
                }
                _ => out.fill(0),
            }
        }
        out
    }
}

fn sum(sums: &mut [u32], pixels: &[u8], channels: usize, light: &[u32; 256]) {
    if channels == 3 {
        sums.iter_mut().zip(pixels).for_each(|(sum, value)| *sum += light[usize::from(*value)]);
        return;
    }
    for (sums, pixel) in sums.as_chunks_mut::<4>().0.iter_mut().zip(pixels.as_chunks::<4>().0) {
        let opacity = u32::from(pixel[3]);
        for (sum, value) in sums.iter_mut().zip(&pixel[..3]) {
            *sum += light[usize::from(*value)] * opacity;
        }
        sums[3] += opacity;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exposed(has_opacity: bool, moments: &[&[u8]]) -> Vec<u8> {
        let mut exposure = Exposure::new(has_opacity);
        moments.iter().for_each(|moment| exposure.add(moment.to_vec()));
        exposure.finish()
    }

    #[test]
    fn what_does_not_change_keeps_its_bits() {
        let all: Vec<u8> = (0..=255).flat_map(|value| [value; 3]).collect();
        assert_eq!(exposed(false, &[&all]), all);
        assert_eq!(exposed(false, &vec![&all[..]; 255]), all, "also the most moments");
        let clear: Vec<u8> = (0..=255).flat_map(|value| [value, 255 - value, 7, 255]).collect();
        assert_eq!(exposed(true, &vec![&clear[..]; 255]), clear);
    }

    #[test]
    fn light_is_averaged_in_linear_channels() {
        // Half of the light of white is 0.7354 of the channel: 188 of 255 (IEC 61966-2-1).
        assert_eq!(exposed(false, &[&[255, 0, 255], &[0, 0, 255]]), [188, 0, 255]);
        // An eighth: 1.055 · 0.125^(1/2.4) - 0.055 = 0.3885.
        let mut moments = vec![&[0, 0, 0][..]; 7];
        moments.push(&[255, 0, 0]);
        assert_eq!(exposed(false, &moments), [99, 0, 0]);
    }

    #[test]
    fn what_is_transparent_has_no_colour() {
        // A red thing that is there half of the time is half transparent, and as red as it was.
        assert_eq!(exposed(true, &[&[200, 10, 0, 255], &[0, 0, 0, 0]]), [200, 10, 0, 128]);
        assert_eq!(exposed(true, &[&[9, 9, 9, 0], &[0, 0, 0, 0]]), [0, 0, 0, 0]);
        // Three parts of white to one of black.
        assert_eq!(exposed(true, &[&[255, 255, 255, 255], &[0, 0, 0, 85]]), [225, 225, 225, 170]);
    }
}
