//! The compressed rows of a PNG: each as its differences from what is beside and above it, by the filter that leaves the least.
//!
//! Rows of pictures are mostly like those above them. Where a row is the same, the filters `Up` and `Paeth` leave nothing, and nothing is reckoned.

use std::io::{self, Cursor};
use std::ops::Range;

use fdeflate::{Compressor, StoredOnlyCompressor};

/// Filters by their numbers: none, and those that are tried.
const NONE: u8 = 0;
const SUB: u8 = 1;
const UP: u8 = 2;
const PAETH: u8 = 4;

/// If less than one of so many bytes of a row differs from that above, it is not compared with what is beside it.
const FEW: usize = 4;

/// Rows of so many bytes, so many a pixel, as the content of the chunk `IDAT`.
pub(super) fn compressed(data: &[u8], row: usize, pixel: usize) -> io::Result<Vec<u8>> {
    let mut compressor = Compressor::new(Vec::with_capacity(data.len() / 8))?;
    let nothing = vec![0; row];
    let mut above = &nothing[..];
    let mut tried = [SUB, UP, PAETH].map(|filter| {
        let mut filtered = vec![0; row + 1];
        filtered[0] = filter;
        // The part of it that may not be 0.
        (filtered, 0..0)
    });
    for line in data.chunks_exact(row.max(1)) {
        let changed = changed(line, above);
        let mut least = (u64::MAX, 1);
        for (number, (filtered, touched)) in tried.iter_mut().enumerate() {
            let range = match number {
                // Where little changes, the others leave less.
                0 if FEW * changed.len() < row => continue,
                0 => 0..row,
                1 => changed.clone(),
                _ => changed.start..(changed.end + pixel).min(row),
            };
            let out = &mut filtered[1..];
            out[std::mem::replace(touched, range.clone())].fill(0);
            let rest = match number {
                0 => sub(line, pixel, out),
                1 => up(&line[range.clone()], &above[range.clone()], &mut out[range]),
                _ => paeth([line, above], range, pixel, out),
            };
            if rest < least.0 {
                least = (rest, number);
            }
            if rest == 0 {
                break;
            }
        }
        compressor.write_data(&tried[least.1].0)?;
        above = line;
    }
    let bytes = compressor.finish()?;
    let lines = data.len() / row.max(1);
    if bytes.len() <= StoredOnlyCompressor::<()>::compressed_size((row + 1) * lines) {
        return Ok(bytes);
    }
    // Noise is as short as it is.
    let mut stored = StoredOnlyCompressor::new(Cursor::new(Vec::new()))?;
    for line in data.chunks_exact(row.max(1)) {
        stored.write_data(&[NONE])?;
        stored.write_data(line)?;
    }
    stored.finish().map(Cursor::into_inner)
}

/// From the first to the last byte that differs.
fn changed(line: &[u8], above: &[u8]) -> Range<usize> {
    const BLOCK: usize = 32;
    let differs = |(a, b): (&[u8], &[u8])| a != b;
    let blocks = || line.chunks(BLOCK).zip(above.chunks(BLOCK));
    let Some(first) = blocks().position(differs) else { return 0..0 };
    let last = blocks().rposition(differs).unwrap_or(first);
    first * BLOCK..((last + 1) * BLOCK).min(line.len())
}

/// The sum of what is left, as numbers with signs.
fn rest(filtered: &[u8]) -> u64 {
    // Sums of a block fit.
    filtered
        .chunks(256)
        .map(|block| block.iter().map(|x| u32::from(x.cast_signed().unsigned_abs())).sum::<u32>())
        .map(u64::from)
        .sum()
}

fn sub(line: &[u8], pixel: usize, out: &mut [u8]) -> u64 {
    let first = pixel.min(line.len());
    out[..first].copy_from_slice(&line[..first]);
    for ((out, x), left) in out[first..].iter_mut().zip(&line[first..]).zip(line) {
        *out = x.wrapping_sub(*left);
    }
    rest(out)
}

fn up(line: &[u8], above: &[u8], out: &mut [u8]) -> u64 {
    for ((out, x), above) in out.iter_mut().zip(line).zip(above) {
        *out = x.wrapping_sub(*above);
    }
    rest(out)
}

fn paeth([line, above]: [&[u8]; 2], range: Range<usize>, pixel: usize, out: &mut [u8]) -> u64 {
    // Left of the first pixel is nothing, and what is above is the nearest then.
    let first = range.start.max(pixel).min(range.end);
    up(&line[range.start..first], &above[range.start..first], &mut out[range.start..first]);
    let count = range.end - first;
    let before = first - pixel.min(first);
    let ([x, a], [b, c]) =
        ([first, before].map(|at| &line[at..][..count]), [first, before].map(|at| &above[at..][..count]));
    // Slices of one length, so that the compiler works on several bytes at a time.
    for (k, out) in out[first..][..count].iter_mut().enumerate() {
        *out = x[k].wrapping_sub(nearest([a[k], b[k], c[k]]));
    }
    rest(&out[range])
}

/// Of what is left, above, and left above, the nearest to left plus above less left above; of equals the first.
#[inline(always)]
fn nearest([a, b, c]: [u8; 3]) -> u8 {
    let [x, y, z] = [a, b, c].map(i16::from);
    let (from_a, from_b, from_c) = ((y - z).abs(), (x - z).abs(), (x + y - 2 * z).abs());
    let of_rest = if from_b <= from_c { y } else { z };
    (if (from_a <= from_b) & (from_a <= from_c) { x } else { of_rest }) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pixels of a PNG with these rows.
    fn read(rows: &[u8], [width, height]: [u32; 2], color: png::ColorType) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(color);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().expect("a header");
        writer.write_chunk(png::chunk::IDAT, rows).expect("rows");
        writer.finish().expect("an end");
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().expect("a PNG");
        let mut data = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut data).expect("an image");
        data
    }

    #[test]
    fn rows_are_read_as_they_were() {
        let mut state = 5_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        for (pixel, color) in [(3, png::ColorType::Rgb), (4, png::ColorType::Rgba)] {
            let size @ [width, height] = [50, 40_u32];
            let row = width as usize * pixel;
            let at = |i: usize| [i % row / pixel, i / row].map(|at| at as f64);
            let count = row * height as usize;
            let even = vec![7; count];
            let smooth: Vec<u8> = (0..count).map(|i| (at(i)[0] * 2.0 + at(i)[1] * 3.0) as u8).collect();
            // A disc of noise on an even ground.
            let within = |[x, y]: [f64; 2]| (x - 25.0).hypot(y - 20.0) < 12.0;
            let mixed: Vec<u8> = (0..count).map(|i| if within(at(i)) { noise() } else { 200 }).collect();
            let rough: Vec<u8> = (0..count).map(|_| noise()).collect();
            let sizes = [even, smooth, mixed, rough].map(|data| {
                let rows = compressed(&data, row, pixel).expect("memory");
                assert_eq!(read(&rows, size, color), data);
                rows.len()
            });
            // Even rows hardly take room, differences that are all the same half a byte, and noise no more than it is.
            let most = [count / 20, count * 6 / 10, count * 6 / 10, count + count / 20];
            assert!(sizes.iter().zip(most).all(|(size, most)| *size < most), "{sizes:?}");
        }
    }
}
