//! Video in AV1 in an MP4 file: what web pages, players and slides take.
//!
//! rav1e encodes the pictures, with one brightness a pixel and one colour for four, by ITU-R BT.601 in the limited range; mp4-atom writes the boxes
//! (ISO/IEC 14496-12; *AV1 Codec ISO Media File Format Binding*, Alliance for Open Media). The table of frames stands before them, so that a page can play
//! the film while it loads.

use std::io::{self, Write};

use mp4_atom::{
    Atom, Av01, Av1c, Codec, Colr, Dinf, Dref, DrefEntry, Encode, FixedPoint, FourCC, Ftyp, Hdlr, Mdat, Mdhd,
    Mdia, Minf, Moov, Mvhd, Stbl, Stco, Stsc, StscEntry, Stsd, Stss, Stsz, StszSamples, Stts, SttsEntry,
    Tkhd, Trak, Url, Visual, Vmhd,
};
use rav1e::prelude::{
    ChromaSampling, ColorDescription, ColorPrimaries, Config, Context, EncoderConfig, EncoderStatus,
    FrameType, MatrixCoefficients, PixelRange, Rational, SpeedSettings, TransferCharacteristics,
};

use crate::y4m::yuv;
use crate::{Encoder, Frame, Shape};

/// Ticks in a second of the film.
const TICKS: u32 = 90_000;
/// Coarseness, from 0 to 255: flat colours and their edges stay clear.
const QUANTIZER: usize = 40;
/// The preset of rav1e, from 0 (slow) to 10.
const SPEED: u8 = 9;
/// The least size in pixels that rav1e encodes.
pub(crate) const LEAST: u32 = 16;

/// An encoded frame.
struct Sample {
    data: Vec<u8>,
    is_key: bool,
}

pub(crate) struct Mp4<'w, W> {
    out: &'w mut W,
    shape: Shape,
    context: Context<u8>,
    /// Kept until the end: their table comes first.
    samples: Vec<Sample>,
    /// The times at which frames end, in ticks.
    ends: Vec<u64>,
}

fn failed(error: impl std::fmt::Display) -> io::Error {
    io::Error::other(error.to_string())
}

impl<'w, W: Write> Mp4<'w, W> {
    pub(crate) fn new(out: &'w mut W, shape: Shape, ends: &[f64], threads: usize) -> io::Result<Mp4<'w, W>> {
        let rate = ends.len() as f64 / ends.last().copied().unwrap_or(1.0).max(1e-3);
        let encoder = EncoderConfig {
            width: shape.width as usize,
            height: shape.height as usize,
            // For the control of quality over time only; the file has the time of each frame.
            time_base: Rational::new(1000, (rate * 1000.0).clamp(1.0, 1e6) as u64),
            chroma_sampling: ChromaSampling::Cs420,
            pixel_range: PixelRange::Limited,
            color_description: Some(ColorDescription {
                color_primaries: ColorPrimaries::BT709,
                transfer_characteristics: TransferCharacteristics::SRGB,
                matrix_coefficients: MatrixCoefficients::BT601,
            }),
            max_key_frame_interval: 240,
            quantizer: QUANTIZER,
            speed_settings: SpeedSettings::from_preset(SPEED),
            ..EncoderConfig::default()
        };
        let config = Config::new().with_encoder_config(encoder).with_threads(threads.max(1));
        let context = config.new_context().map_err(failed)?;
        Ok(Mp4 { out, shape, context, samples: Vec::new(), ends: Vec::new() })
    }

    /// Takes the frames that are encoded. rav1e gives them in the order of time.
    fn take(&mut self) -> io::Result<()> {
        loop {
            match self.context.receive_packet() {
                Ok(packet) => {
                    let data = without_delimiters(&packet.data);
                    self.samples.push(Sample { data, is_key: packet.frame_type == FrameType::KEY });
                }
                Err(EncoderStatus::Encoded) => {}
                Err(EncoderStatus::NeedMoreData | EncoderStatus::LimitReached) => return Ok(()),
                Err(status) => return Err(failed(status)),
            }
        }
    }

    fn table(&self) -> io::Result<Stbl> {
        let Shape { width, height, .. } = self.shape;
        let header = self.context.container_sequence_header();
        let mut av1c = Av1c::decode_body(&mut &header[..]).map_err(failed)?;
        // The header of the sequence, as it stands in the first frame, for players that read no frame before they begin.
        let first = self.samples.first().map_or(&[][..], |sample| &sample.data);
        av1c.config_obus = obus(first).find(|obu| kind(obu) == SEQUENCE_HEADER).unwrap_or_default().to_vec();
        let visual = Visual {
            data_reference_index: 1,
            width: width as u16,
            height: height as u16,
            compressor: "AV1".into(),
            ..Visual::default()
        };
        let colr = Colr::Nclx {
            colour_primaries: 1,
            transfer_characteristics: 13,
            matrix_coefficients: 6,
            full_range_flag: false,
        };
        let av01 = Av01 { visual, av1c, colr: Some(colr), ..Av01::default() };
        let mut entries: Vec<SttsEntry> = Vec::new();
        let mut begin = 0;
        for end in &self.ends {
            let lasts = u32::try_from(end - begin).map_err(failed)?;
            begin = *end;
            match entries.last_mut().filter(|entry| entry.sample_delta == lasts) {
                Some(entry) => entry.sample_count += 1,
                None => entries.push(SttsEntry { sample_count: 1, sample_delta: lasts }),
            }
        }
        let keys = self.samples.iter().zip(1..).filter(|(sample, _)| sample.is_key).map(|(_, number)| number);
        let sizes = self.samples.iter().map(|sample| u32::try_from(sample.data.len()).map_err(failed));
        let count = u32::try_from(self.samples.len()).map_err(failed)?;
        Ok(Stbl {
            stsd: Stsd { codecs: vec![Codec::Av01(av01)] },
            stts: Stts { entries },
            stss: Some(Stss { entries: keys.collect() }),
            stsc: Stsc {
                entries: vec![StscEntry {
                    first_chunk: 1,
                    samples_per_chunk: count,
                    sample_description_index: 1,
                }],
            },
            stsz: Stsz { samples: StszSamples::Different { sizes: sizes.collect::<io::Result<_>>()? } },
            // Set when the size of what stands before the frames is known.
            stco: Some(Stco { entries: vec![0] }),
            ..Stbl::default()
        })
    }

    /// The description of the film; `first` is the place of the first frame in the file.
    fn description(&self, first: u32) -> io::Result<Moov> {
        let duration = self.ends.last().copied().unwrap_or(0);
        let Shape { width, height, .. } = self.shape;
        let mut stbl = self.table()?;
        stbl.stco = Some(Stco { entries: vec![first] });
        let minf = Minf {
            vmhd: Some(Vmhd::default()),
            dinf: Dinf { dref: Dref { entries: vec![DrefEntry::Url(Url::default())] } },
            stbl,
            ..Minf::default()
        };
        let mdia = Mdia {
            mdhd: Mdhd { timescale: TICKS, duration, language: "und".to_owned(), ..Mdhd::default() },
            hdlr: Hdlr { handler: FourCC::new(b"vide"), name: "dlsys".to_owned() },
            minf,
        };
        let tkhd = Tkhd {
            track_id: 1,
            duration,
            enabled: true,
            in_movie: true,
            width: FixedPoint::new(width as u16, 0),
            height: FixedPoint::new(height as u16, 0),
            ..Tkhd::default()
        };
        let mvhd = Mvhd {
            timescale: TICKS,
            duration,
            rate: FixedPoint::new(1, 0),
            next_track_id: 2,
            ..Mvhd::default()
        };
        let trak = vec![Trak { tkhd, mdia, ..Trak::default() }];
        Ok(Moov { mvhd, trak, ..Moov::default() })
    }
}

impl<W: Write> Encoder for Mp4<'_, W> {
    fn add(&mut self, frame: &Frame<'_>) -> io::Result<()> {
        let [width, height] = [self.shape.width, self.shape.height].map(|side| side as usize);
        let [half_width, half_height] = [width.div_ceil(2), height.div_ceil(2)];
        let pixels: Vec<[u8; 3]> = frame.pixels.chunks_exact(3).map(yuv).collect();
        let brightness: Vec<u8> = pixels.iter().map(|pixel| pixel[0]).collect();
        // The mean over a square of four; at an odd edge, over those that are there.
        let colour = |channel: usize, row: usize, column: usize| {
            let rows = 2 * row..(2 * row + 2).min(height);
            let places =
                rows.flat_map(|r| (2 * column..(2 * column + 2).min(width)).map(move |c| r * width + c));
            let (sum, count) =
                places.fold((0, 0), |(sum, n), at| (sum + u32::from(pixels[at][channel]), n + 1));
            ((sum + count / 2) / count) as u8
        };
        let mut picture = self.context.new_frame();
        picture.planes[0].copy_from_raw_u8(&brightness, width, 1);
        for channel in [1, 2] {
            let rows = (0..half_height).flat_map(|row| (0..half_width).map(move |column| (row, column)));
            let plane: Vec<u8> = rows.map(|(row, column)| colour(channel, row, column)).collect();
            picture.planes[channel].copy_from_raw_u8(&plane, half_width, 1);
        }
        self.context.send_frame(picture).map_err(failed)?;
        self.ends.push((frame.end * f64::from(TICKS)).round() as u64);
        self.take()
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.context.flush();
        self.take()?;
        if self.samples.len() != self.ends.len() {
            return Err(failed(format!("{} frames of {} are encoded", self.samples.len(), self.ends.len())));
        }
        let mut head = Vec::new();
        let brands = [b"isom", b"iso6", b"av01", b"mp42"].map(FourCC::new).to_vec();
        let ftyp = Ftyp { major_brand: FourCC::new(b"isom"), minor_version: 512, compatible_brands: brands };
        ftyp.encode(&mut head).map_err(failed)?;
        let begin = head.len();
        // Its size does not depend on the place of the frames, which stand behind it and the eight bytes that begin them.
        self.description(0)?.encode(&mut head).map_err(failed)?;
        let first = u32::try_from(head.len() + 8).map_err(failed)?;
        head.truncate(begin);
        self.description(first)?.encode(&mut head).map_err(failed)?;
        let data = self.samples.iter().flat_map(|sample| &sample.data).copied().collect();
        Mdat { data }.encode(&mut head).map_err(failed)?;
        self.out.write_all(&head)?;
        self.out.flush()
    }
}

/// Kinds of units in a stream (AV1 specification, section 6.2.2).
const SEQUENCE_HEADER: u8 = 1;
const TEMPORAL_DELIMITER: u8 = 2;

fn kind(obu: &[u8]) -> u8 {
    obu.first().map_or(0, |header| header >> 3 & 15)
}

/// The units of a frame, each with its header and its size.
fn obus(data: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = data;
    std::iter::from_fn(move || {
        let &header = rest.first()?;
        let (has_extension, has_size) = (header & 4 != 0, header & 2 != 0);
        let mut at = 1 + usize::from(has_extension);
        let mut size = 0;
        let length = match has_size {
            // LEB128.
            true => loop {
                let &byte = rest.get(at)?;
                size |= usize::from(byte & 127) << (7 * (at - 1 - usize::from(has_extension)));
                at += 1;
                if byte & 128 == 0 {
                    break at + size;
                }
            },
            false => rest.len(),
        };
        let (first, behind) = rest.split_at_checked(length)?;
        rest = behind;
        Some(first)
    })
}

/// A frame without the units that only separate frames, which the file does.
fn without_delimiters(data: &[u8]) -> Vec<u8> {
    obus(data).filter(|obu| kind(obu) != TEMPORAL_DELIMITER).flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use mp4_atom::{Any, DecodeMaybe};

    use crate::{Film, Format, Shape};

    use super::*;

    /// A square that moves over an odd number of pixels, each frame longer than the one before.
    fn film(threads: usize) -> Vec<u8> {
        let shape = Shape { width: 37, height: 21, has_alpha: false };
        let mut file = Cursor::new(Vec::new());
        let ends: Vec<f64> = (1..=9).map(|k| 0.01 * f64::from(k * (k + 1) / 2)).collect();
        let mut film = Film::begin(Format::Mp4, &mut file, shape, ends, threads).expect("begun");
        for frame in 0..9 {
            let inside = |x: u32, y: u32| (frame..frame + 12).contains(&x) && (4..16).contains(&y);
            let pixels = (0..21).flat_map(|y| (0..37).map(move |x| (x, y)));
            let pixels = pixels.flat_map(|(x, y)| if inside(x, y) { [200, 30, 90] } else { [250, 248, 240] });
            film.add(&pixels.collect::<Vec<u8>>()).expect("added");
        }
        film.finish().expect("finished");
        file.into_inner()
    }

    #[test]
    fn the_table_leads_to_every_frame() {
        let file = film(1);
        assert!(Format::Mp4.begins(&file));
        let mut rest = &file[..];
        let mut moov = None;
        while let Some(atom) = Any::decode_maybe(&mut rest).expect("boxes") {
            if let Any::Moov(found) = atom {
                moov = Some(found);
            }
        }
        let track = moov.expect("a description").trak.remove(0);
        assert_eq!((track.tkhd.width.integer(), track.tkhd.height.integer()), (37, 21));
        let table = &track.mdia.minf.stbl;
        let deltas: Vec<u32> = table.stts.entries.iter().map(|entry| entry.sample_delta).collect();
        assert_eq!(deltas, (1..=9).map(|k| k * 900).collect::<Vec<u32>>(), "a hundredth more each time");
        assert_eq!(track.mdia.mdhd.duration, 900 * 45);
        assert_eq!(table.stss.as_ref().expect("keys").entries.first(), Some(&1));
        let StszSamples::Different { sizes } = &table.stsz.samples else { panic!("sizes") };
        assert_eq!(sizes.len(), 9);
        let mut at = table.stco.as_ref().expect("a place").entries[0] as usize;
        for (number, size) in sizes.iter().enumerate() {
            let units: Vec<u8> = obus(&file[at..at + *size as usize]).map(kind).collect();
            // Frames, or a header that shows an earlier one; no delimiters; the first frame has the header of the sequence.
            assert!(units.iter().all(|unit| [1, 3, 4, 6].contains(unit)), "{number}: {units:?}");
            assert_eq!(units.contains(&SEQUENCE_HEADER), number == 0, "{number}: {units:?}");
            at += *size as usize;
        }
        assert_eq!(at, file.len());
    }

    #[test]
    fn threads_do_not_matter_and_tiny_films_are_refused() {
        assert!(film(1) == film(2));
        let shape = Shape { width: 15, height: 40, has_alpha: false };
        let mut file = Cursor::new(Vec::new());
        let refused = Film::begin(Format::Mp4, &mut file, shape, vec![1.0], 1).err().expect("refused");
        assert_eq!(refused.to_string(), "mp4 films have at least 16 pixels on a side");
    }
}
