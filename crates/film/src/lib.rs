//! Frames of pixels as a film in one file.
//!
//! | format | colours | transparency |
//! |---|---|---|
//! | animated WebP, lossless | all | yes |
//! | animated PNG | all | yes |
//! | animated GIF | 255 in the changes of each frame | no |
//! | YUV4MPEG2, raw, for encoders of video | all but for the rounding of BT.601 | no |
//! | AV1 in MP4, behind the feature `video` | lossy | no |
//!
//! Frames come one after another, and only the one before is kept, and those that are being encoded. Of a frame only the pixels that have changed are written, except in raw video: the others are
//! transparent in the rectangle around them.
//!
//! ```
//! use dlsys_film::{Film, Format, Shape};
//!
//! # fn main() -> std::io::Result<()> {
//! let mut file = std::io::Cursor::new(Vec::new());
//! let shape = Shape { width: 2, height: 1, has_alpha: false };
//! let mut film = Film::begin(Format::Webp, &mut file, shape, vec![0.5, 1.0], 2)?;
//! film.add(&[255, 0, 0, 255, 0, 0])?;
//! film.add(&[255, 0, 0, 0, 0, 255])?;
//! film.finish()?;
//! assert!(file.into_inner().starts_with(b"RIFF"));
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

mod apng;
mod gif;
#[cfg(feature = "video")]
mod mp4;
mod palette;
mod pipeline;
mod rectangle;
mod vp8l;
mod webp;
mod y4m;

use std::io::{self, Seek, Write};

use rectangle::Rectangle;

/// Formats of films.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Animated WebP, lossless.
    Webp,
    /// Animated PNG.
    Apng,
    /// Animated GIF.
    Gif,
    /// YUV4MPEG2: raw video.
    Y4m,
    /// AV1 in MP4.
    #[cfg(feature = "video")]
    Mp4,
}

impl Format {
    /// All formats.
    #[cfg(not(feature = "video"))]
    pub const ALL: [Format; 4] = [Format::Webp, Format::Apng, Format::Gif, Format::Y4m];
    /// All formats.
    #[cfg(feature = "video")]
    pub const ALL: [Format; 5] = [Format::Webp, Format::Apng, Format::Gif, Format::Y4m, Format::Mp4];

    /// The extension of files, which is also the name of the format.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Webp => "webp",
            Format::Apng => "apng",
            Format::Gif => "gif",
            Format::Y4m => "y4m",
            #[cfg(feature = "video")]
            Format::Mp4 => "mp4",
        }
    }

    /// A description in one line.
    pub fn about(self) -> &'static str {
        match self {
            Format::Webp => {
                "A film in one file: animated WebP, lossless and small; browsers play it in <img>"
            }
            Format::Apng => "A film in one file: animated PNG, lossless",
            Format::Gif => "A film in one file: animated GIF, at most 255 colours in the changes of a frame",
            Format::Y4m => {
                "A film in one file: raw video; with -o - for a pipe into ffmpeg and other encoders"
            }
            #[cfg(feature = "video")]
            Format::Mp4 => {
                "A film in one file: video, AV1 in MP4, lossy and smallest; web pages, players and slides play it"
            }
        }
    }

    /// Whether frames may be transparent.
    pub fn has_alpha(self) -> bool {
        matches!(self, Format::Webp | Format::Apng)
    }

    /// The clock of the format; `None` if frames last as long as they are asked to.
    fn ticks(self) -> Option<Ticks> {
        match self {
            Format::Webp => Some(Ticks::WEBP),
            Format::Apng => Some(Ticks::APNG),
            Format::Gif => Some(Ticks::GIF),
            _ => None,
        }
    }

    /// How long a film takes to play whose frames are to end at these ascending times, all in seconds: longer where frames would be shorter than the format has them.
    pub fn played(self, ends: &[f64]) -> f64 {
        match self.ticks() {
            Some(mut ticks) => {
                ends.iter().for_each(|end| {
                    ticks.up_to(*end);
                });
                ticks.sum / ticks.per_second
            }
            None => ends.last().copied().unwrap_or(0.0),
        }
    }

    /// Whether a file that begins like this is of the format.
    pub fn begins(self, start: &[u8]) -> bool {
        match self {
            Format::Webp => start.starts_with(b"RIFF") && start.get(8..12) == Some(b"WEBP"),
            Format::Apng => start.starts_with(b"\x89PNG") && start.get(37..41) == Some(b"acTL"),
            Format::Gif => start.starts_with(b"GIF8"),
            Format::Y4m => start.starts_with(b"YUV4MPEG2"),
            #[cfg(feature = "video")]
            Format::Mp4 => start.get(4..8) == Some(b"ftyp"),
        }
    }
}

/// The shape of all frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Four bytes a pixel, the last one the opacity; else three.
    pub has_alpha: bool,
}

impl Shape {
    /// Bytes of a pixel.
    pub fn channels(self) -> usize {
        if self.has_alpha { 4 } else { 3 }
    }

    /// Bytes of a frame.
    pub fn bytes(self) -> usize {
        self.width as usize * self.height as usize * self.channels()
    }
}

/// A frame that is written.
struct Frame<'a> {
    shape: Shape,
    pixels: &'a [u8],
    before: Option<&'a [u8]>,
    /// The rectangle outside of which nothing has changed.
    changed: Rectangle,
    /// Its end, in seconds from the beginning.
    end: f64,
}

/// Opacity, red, green and blue, from the highest byte to the lowest.
fn colour(pixel: &[u8]) -> u32 {
    let opacity = pixel.get(3).copied().unwrap_or(u8::MAX);
    u32::from_be_bytes([opacity, pixel[0], pixel[1], pixel[2]])
}

impl Frame<'_> {
    fn colours<'p>(&self, part: Rectangle, pixels: &'p [u8]) -> impl Iterator<Item = u32> + use<'p> {
        let channels = self.shape.channels();
        part.rows(pixels, self.shape).flat_map(move |row| row.chunks_exact(channels)).map(colour)
    }

    /// The pixels of a rectangle.
    fn cut(&self, part: Rectangle) -> Vec<u32> {
        self.colours(part, self.pixels).collect()
    }

    /// The pixels of a rectangle, those that have not changed with opacity 0. None in the first frame, and where a change makes a pixel transparent: laid over the
    /// pixel below, it would not replace it.
    fn over(&self, part: Rectangle) -> Option<Vec<u32>> {
        let pairs = self.colours(part, self.before?).zip(self.colours(part, self.pixels));
        pairs
            .map(|(old, new)| match new >> 24 {
                _ if old == new => Some(0),
                255 => Some(new),
                _ => None,
            })
            .collect()
    }
}

/// One format.
trait Encoder {
    fn add(&mut self, frame: &Frame<'_>) -> io::Result<()>;
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// A film that is being written.
pub struct Film<'w> {
    encoder: Box<dyn Encoder + 'w>,
    shape: Shape,
    ends: Vec<f64>,
    next: usize,
    before: Vec<u8>,
}

fn invalid(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message)
}

impl<'w> Film<'w> {
    /// Begins a film whose frames end at these ascending times, in seconds. They are encoded on this many threads where the format takes most of the time (WebP); the
    /// file does not depend on it.
    ///
    /// # Errors
    /// If there are no frames, if the shape is impossible in the format, or those of `out`. Formats other than WebP never seek.
    pub fn begin<W: Write + Seek>(
        format: Format,
        out: &'w mut W,
        shape: Shape,
        ends: Vec<f64>,
        threads: usize,
    ) -> io::Result<Film<'w>> {
        if ends.is_empty() || shape.width == 0 || shape.height == 0 {
            return Err(invalid("a film without frames, or without pixels".to_owned()));
        }
        if shape.has_alpha && !format.has_alpha() {
            return Err(invalid(format!("{} files have no transparency", format.extension())));
        }
        let most: u32 = if format == Format::Webp { 16_384 } else { 65_535 };
        if shape.width.max(shape.height) > most {
            return Err(invalid(format!(
                "{} files have at most {most} pixels on a side",
                format.extension()
            )));
        }
        if let Some(ticks) = format.ticks() {
            let begins = std::iter::once(&0.0).chain(&ends);
            let longest = begins.zip(&ends).map(|(begin, end)| end - begin).fold(0.0, f64::max);
            let most = f64::from(ticks.limits[1]) / ticks.per_second;
            if longest > most {
                return Err(invalid(format!(
                    "a frame would last {} s, and those of {} files last {most} s at most; a larger `--speed` or a smaller `--step` makes frames shorter",
                    (longest * 1e3).round() / 1e3,
                    format.extension()
                )));
            }
        }
        let encoder: Box<dyn Encoder + 'w> = match format {
            Format::Webp => Box::new(webp::Webp::new(out, shape, threads)?),
            Format::Apng => Box::new(apng::Apng::new(out, shape, ends.len())?),
            Format::Gif => Box::new(gif::Gif::new(out, shape)?),
            Format::Y4m => Box::new(y4m::Y4m::new(out, shape, &ends)?),
            #[cfg(feature = "video")]
            Format::Mp4 if shape.width.min(shape.height) < mp4::LEAST => {
                return Err(invalid(format!("mp4 films have at least {} pixels on a side", mp4::LEAST)));
            }
            #[cfg(feature = "video")]
            Format::Mp4 => Box::new(mp4::Mp4::new(out, shape, &ends, threads)?),
        };
        Ok(Film { encoder, shape, ends, next: 0, before: Vec::new() })
    }

    /// Adds the next frame: its pixels row by row from the top, three bytes each or four.
    ///
    /// # Errors
    /// If the pixels do not fit the shape, if the film has no more frames, or those of `out`.
    pub fn add(&mut self, pixels: &[u8]) -> io::Result<()> {
        let Some(&end) = self.ends.get(self.next) else {
            return Err(invalid("more frames than times".to_owned()));
        };
        if pixels.len() != self.shape.bytes() {
            return Err(invalid("a frame of another size".to_owned()));
        }
        let before = Some(&self.before[..]).filter(|_| self.next > 0);
        let changed = match before {
            Some(before) => rectangle::changed(before, pixels, self.shape),
            None => Rectangle { left: 0, top: 0, width: self.shape.width, height: self.shape.height },
        };
        self.encoder.add(&Frame { shape: self.shape, pixels, before, changed, end })?;
        self.before.clear();
        self.before.extend_from_slice(pixels);
        self.next += 1;
        Ok(())
    }

    /// Ends the film.
    ///
    /// # Errors
    /// If there are fewer frames than times, or those of `out`.
    pub fn finish(self) -> io::Result<()> {
        if self.next < self.ends.len() {
            return Err(invalid("fewer frames than times".to_owned()));
        }
        self.encoder.finish()
    }
}

/// Whole ticks of a clock, without drift.
#[derive(Clone, Copy, Debug)]
struct Ticks {
    per_second: f64,
    /// The fewest and the most that a frame lasts.
    limits: [u32; 2],
    sum: f64,
}

impl Ticks {
    const WEBP: Ticks = Ticks::new(1000.0, [1, 0xff_ffff]);
    const APNG: Ticks = Ticks::new(1000.0, [1, 65_535]);
    /// Browsers play frames of one tick much more slowly.
    const GIF: Ticks = Ticks::new(100.0, [2, 65_535]);

    const fn new(per_second: f64, limits: [u32; 2]) -> Ticks {
        Ticks { per_second, limits, sum: 0.0 }
    }

    /// The ticks of the frame that ends at this time.
    fn up_to(&mut self, end: f64) -> u32 {
        let [least, most] = self.limits.map(f64::from);
        let ticks = ((end * self.per_second).round() - self.sum).clamp(least, most);
        self.sum += ticks;
        ticks as u32
    }
}

#[cfg(test)]
mod tests;
