//! Encoding of tracks as compressed bytes, for the page.
//!
//! Everything is a whole number of seven bits a byte, the lowest first, the eighth bit saying that there is more; signed
//! numbers have their sign in the lowest bit. First of every track
//!
//! ```text
//! kind, outline / mesh / 0 / corners / mesh and corners, first frame, frames after it, log₂ of the stride, samples,
//! finishes, and for each: frames since the one before, material + 1 or 0, variant
//! ```
//!
//! (kind 0 is a stem, 1 a mesh, 2 a patch, 3 a polygon, 4 a mesh scaled by axis, 5 a net), then of every track, number by number, its samples: the first
//! as difference from the point before it, the second from the first, others from the line through the two before. Growth
//! is smooth, so most of that is small. All of it is compressed (zlib, RFC 1950).

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::recording::{Recording, is_point};
use super::stage::Form;
use dlsys_render::Spoke;

/// The tracks of a recording, compressed; and the outlines of stems that they refer to.
pub(super) fn tracks(recording: &Recording) -> (Vec<u8>, Vec<Vec<Spoke>>) {
    let mut outlines: Vec<Vec<Spoke>> = Vec::new();
    let mut bytes = Vec::new();
    natural(recording.tracks.len() as u64, &mut bytes);
    for track in &recording.tracks {
        let (kind, detail) = match track.form {
            Form::Stem(contour) => {
                let outline = recording.outline(contour, thickest(&track.samples) * recording.unit);
                let known = outlines.iter().position(|known| *known == outline);
                let number = known.unwrap_or_else(|| {
                    outlines.push(outline);
                    outlines.len() - 1
                });
                (0, number as u64)
            }
            Form::Mesh(number) => (1, u64::from(number)),
            Form::Stretched(number) => (4, u64::from(number)),
            Form::Patch => (2, 0),
            Form::Polygon(corners) => (3, u64::from(corners)),
            Form::Net(number, _) => (5, u64::from(number)),
        };
        let span = u64::from(track.last - track.first);
        let (first, stride) = (u64::from(track.first), u64::from(track.stride.trailing_zeros()));
        let finishes = track.finishes.len() as u64;
        natural(kind, &mut bytes);
        natural(detail, &mut bytes);
        if let Form::Net(_, corners) = track.form {
            natural(u64::from(corners), &mut bytes);
        }
        for number in [first, span, stride, track.len() as u64, finishes] {
            natural(number, &mut bytes);
        }
        let mut before = track.first;
        for (frame, finish) in &track.finishes {
            natural(u64::from(frame - before), &mut bytes);
            natural(finish.material.map_or(0, |material| material.index() as u64 + 1), &mut bytes);
            natural(u64::from(finish.variant), &mut bytes);
            before = *frame;
        }
    }
    for track in &recording.tracks {
        let width = track.form.numbers();
        for number in 0..width {
            let sample = |i: usize| i64::from(track.samples[i * width + number]);
            let neighbour = number >= 3 && is_point(track.form, number) && is_point(track.form, number - 3);
            let near = if neighbour { i64::from(track.samples[number - 3]) } else { 0 };
            for i in 0..track.len() {
                let guess = match i {
                    0 => near,
                    1 => sample(0),
                    _ => 2 * sample(i - 1) - sample(i - 2),
                };
                integer(sample(i) - guess, &mut bytes);
            }
        }
    }
    (compressed(&bytes), outlines)
}

pub(super) fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    // Memory takes whatever is written to it.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

/// The largest radius of a stem, in steps.
fn thickest(samples: &[i32]) -> f64 {
    let squares = samples
        .chunks_exact(9)
        .map(|section| section[3..6].iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>());
    squares.fold(0.0, f64::max).sqrt()
}

pub(super) fn natural(mut number: u64, out: &mut Vec<u8>) {
    while number >= 128 {
        out.push(number as u8 | 128);
        number >>= 7;
    }
    out.push(number as u8);
}

pub(super) fn integer(number: i64, out: &mut Vec<u8>) {
    natural(((number << 1) ^ (number >> 63)) as u64, out);
}

/// Bytes as text (RFC 4648, section 4).
pub(super) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let of = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let bits = of(0) << 16 | of(1) << 8 | of(2);
        for i in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * i) & 63) as usize] as char;
            text.push(if i <= chunk.len() { digit } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_signed_ones_alternate() {
        let bytes = |number: i64| {
            let mut out = Vec::new();
            integer(number, &mut out);
            out
        };
        assert_eq!([0, -1, 1, 63, -64].map(bytes), [[0], [1], [2], [126], [127]]);
        assert_eq!(bytes(64), [128, 1]);
        assert_eq!(bytes(i64::from(i32::MIN)).len(), 5);
    }

    #[test]
    fn bytes_as_text() {
        let text = |bytes: &str| base64(bytes.as_bytes());
        assert_eq!(["", "f", "fo", "foo", "foob"].map(text), ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]);
    }
}
