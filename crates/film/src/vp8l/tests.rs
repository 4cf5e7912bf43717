//! Pictures of all sorts, decoded again by another program.

use std::io::Cursor;

use proptest::prelude::*;

use super::encode;

/// What a reader makes of the data.
fn decoded(data: &[u8], width: usize, count: usize) -> Vec<u32> {
    let mut file = b"RIFF".to_vec();
    let padded = data.len().next_multiple_of(2);
    file.extend((padded as u32 + 12).to_le_bytes());
    file.extend(b"WEBPVP8L");
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(data);
    file.resize(20 + padded, 0);
    let mut decoder = image_webp::WebPDecoder::new(Cursor::new(file)).expect("WebP");
    assert_eq!(decoder.dimensions(), (width as u32, (count / width) as u32));
    let channels = if decoder.has_alpha() { 4 } else { 3 };
    let mut bytes = vec![0; count * channels];
    decoder.read_image(&mut bytes).expect("a picture");
    bytes.chunks_exact(channels).map(crate::colour).collect()
}

fn check(pixels: &[u32], width: usize) -> usize {
    let data = encode(pixels, width, false);
    assert!(decoded(&data, width, pixels.len()) == pixels, "{width} wide");
    let open = encode(pixels, width, true);
    let shown = decoded(&open, width, pixels.len());
    let is_same = |(a, b): (&u32, &u32)| a == b || (a >> 24 == 0 && b >> 24 == 0);
    assert!(pixels.iter().zip(&shown).all(is_same), "{width} wide, open");
    data.len()
}

fn noise(x: usize, y: usize) -> u32 {
    ((x * 374_761_393 + y * 668_265_263) as u32 ^ 0x5bd1_e995).wrapping_mul(0x27d4_eb2d) >> 8
}

fn picture(width: usize, height: usize, pixel: impl Fn(usize, usize) -> u32) -> Vec<u32> {
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
}

#[test]
fn pictures_of_all_sorts_are_decoded_exactly() {
    for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 2), (8, 8), (9, 17), (130, 77), (300, 90)] {
        check(&picture(width, height, |_, _| 0xff12_3456), width);
        check(&picture(width, height, |_, _| 0), width);
        check(&picture(width, height, noise), width);
        check(&picture(width, height, |x, y| noise(x, y) | 0xff00_0000), width);
        check(
            &picture(width, height, |x, y| 0xff00_0000 | ((x * 3 + y) as u32 & 255) << 8 | (y as u32 & 255)),
            width,
        );
        check(&picture(width, height, |x, y| if (x + y) % 2 > 0 { 0xffff_ffff } else { 0xff00_0000 }), width);
        check(&picture(width, height, |x, y| noise(x / 7, y / 5) << 8 | ((x as u32 * 5) & 255) << 24), width);
        check(
            &picture(
                width,
                height,
                |x, y| if !noise(x, y).is_multiple_of(9) { 0 } else { 0xff30_2010 + x as u32 },
            ),
            width,
        );
    }
}

#[test]
fn smooth_and_repeated_pictures_are_small() {
    let gradient = picture(256, 256, |x, y| {
        0xff00_0000 | (x as u32) << 16 | (y as u32) << 8 | ((x as u32 + y as u32) / 2)
    });
    assert!(check(&gradient, 256) < 1000);
    let tiles = picture(256, 256, |x, y| 0xff00_0000 | noise(x % 32, y % 32));
    assert!(check(&tiles, 256) < 32 * 32 * 4);
    assert!(check(&picture(256, 256, |_, _| 7), 256) < 64);
}

proptest! {
    #[test]
    fn random_pictures_are_decoded_exactly(
        width in 1_usize..50,
        colours in proptest::collection::vec(any::<u32>(), 1..40),
        choices in proptest::collection::vec((0_usize..40, 1_usize..30, any::<bool>()), 1..120),
    ) {
        // Runs of colours of a few, some opaque, some noisy.
        let mut pixels: Vec<u32> = Vec::new();
        for (colour, length, is_noisy) in choices {
            let colour = colours[colour % colours.len()];
            pixels.extend((0..length).map(|i| if is_noisy { colour ^ (noise(i, length) & 0x0003_0303) } else { colour }));
        }
        pixels.resize(pixels.len().next_multiple_of(width), 0);
        check(&pixels, width);
    }
}
