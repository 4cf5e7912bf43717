//! A reader of animated WebP for tests: `image-webp` decodes the pictures, and they are laid over one another here. (Its own animations round opaque pixels that are
//! laid over others down, by one of 255; libwebp and browsers do not.)

use std::io::Cursor;

/// All pictures of a film as four bytes a pixel, and how long each is shown, in milliseconds.
pub fn read(file: &[u8]) -> (Vec<Vec<u8>>, Vec<u32>) {
    let three = |at: usize| u32::from_le_bytes([file[at], file[at + 1], file[at + 2], 0]);
    let four = |at: usize| three(at) + (u32::from(file[at + 3]) << 24);
    assert_eq!((&file[..4], &file[8..16]), (&b"RIFF"[..], &b"WEBPVP8X"[..]));
    assert_eq!(four(4) as usize + 8, file.len());
    let (width, height) = (three(24) as usize + 1, three(27) as usize + 1);
    let mut canvas = vec![0; width * height * 4];
    let (mut pictures, mut milliseconds) = (Vec::new(), Vec::new());
    // Behind the chunk VP8X.
    let mut at = 30;
    while at < file.len() {
        let length = four(at + 4) as usize;
        if &file[at..at + 4] == b"ANMF" {
            let data = at + 8;
            let [left, top] = [three(data), three(data + 3)].map(|x| x as usize * 2);
            let columns = three(data + 6) as usize + 1;
            let is_over = file[data + 15] & 2 == 0;
            let part = still(&file[data + 16..data + length]);
            for (i, pixel) in part.chunks_exact(4).enumerate() {
                assert!(!is_over || matches!(pixel[3], 0 | 255), "nothing is mixed");
                if !is_over || pixel[3] > 0 {
                    let place = ((top + i / columns) * width + left + i % columns) * 4;
                    canvas[place..place + 4].copy_from_slice(pixel);
                }
            }
            pictures.push(canvas.clone());
            milliseconds.push(three(data + 12));
        }
        at += 8 + length.next_multiple_of(2);
    }
    (pictures, milliseconds)
}

/// A single picture.
fn still(chunk: &[u8]) -> Vec<u8> {
    let mut file = b"RIFF".to_vec();
    file.extend((chunk.len() as u32 + 4).to_le_bytes());
    file.extend(b"WEBP");
    file.extend(chunk);
    let mut decoder = image_webp::WebPDecoder::new(Cursor::new(file)).expect("WebP");
    let (width, height) = decoder.dimensions();
    let channels = if decoder.has_alpha() { 4 } else { 3 };
    let mut data = vec![0; (width * height) as usize * channels];
    decoder.read_image(&mut data).expect("a picture");
    let whole = |pixel: &[u8]| [pixel[0], pixel[1], pixel[2], pixel.get(3).copied().unwrap_or(255)];
    data.chunks_exact(channels).flat_map(whole).collect()
}
