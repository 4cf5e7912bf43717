//! Films, decoded again by the readers of the crates that wrote their frames.

use std::io::Cursor;

use super::*;

/// A square that moves to the right and changes its colour, with a noisy edge; the third frame is like the second.
fn frames(shape: Shape) -> Vec<Vec<u8>> {
    let frame = |i: u32| {
        let pixel = |k: u32| {
            let (x, y) = (k % shape.width, k / shape.width);
            let inside = (5 + 4 * i..15 + 4 * i).contains(&x) && (7..18).contains(&y);
            let rgb = match inside {
                true => [200, (x * 37 + y * 11) as u8, (40 * i) as u8],
                false => [251, 250, 245],
            };
            let alpha = if inside { 255 - 20 * i as u8 } else { 0 };
            rgb.into_iter().chain(Some(alpha).filter(|_| shape.has_alpha))
        };
        (0..shape.width * shape.height).flat_map(pixel).collect()
    };
    [0, 1, 1, 2, 3].map(frame).to_vec()
}

fn film(format: Format, shape: Shape, frames: &[Vec<u8>]) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let ends = (1..=frames.len()).map(|i| i as f64 / 30.0).collect();
    let mut film = Film::begin(format, &mut out, shape, ends).expect("a film");
    frames.iter().for_each(|frame| film.add(frame).expect("a frame"));
    film.finish().expect("an end");
    let bytes = out.into_inner();
    assert!(format.begins(&bytes));
    bytes
}

const SHAPES: [Shape; 2] =
    [Shape { width: 33, height: 21, has_alpha: false }, Shape { width: 32, height: 27, has_alpha: true }];

#[test]
fn webp_films_are_lossless() {
    for shape in SHAPES {
        let frames = frames(shape);
        let file = film(Format::Webp, shape, &frames);
        let length = u32::from_le_bytes([file[4], file[5], file[6], file[7]]);
        assert_eq!(length as usize + 8, file.len());
        let mut decoder = image_webp::WebPDecoder::new(Cursor::new(file)).expect("WebP");
        assert_eq!(decoder.dimensions(), (shape.width, shape.height));
        assert_eq!((decoder.num_frames() as usize, decoder.has_alpha()), (frames.len(), shape.has_alpha));
        let mut sum = 0;
        for frame in &frames {
            let mut decoded = vec![0; shape.bytes()];
            sum += decoder.read_frame(&mut decoded).expect("a frame");
            assert!(decoded == *frame);
        }
        assert_eq!(sum, 167, "five thirtieths of a second, without drift");
    }
}

#[test]
fn apng_films_are_lossless() {
    for shape in SHAPES {
        let frames = frames(shape);
        let file = film(Format::Apng, shape, &frames);
        let mut reader = png::Decoder::new(Cursor::new(file)).read_info().expect("PNG");
        let control = *reader.info().animation_control().expect("animated");
        assert_eq!((control.num_frames as usize, control.num_plays), (frames.len(), 0));
        let mut canvas = vec![0; shape.bytes()];
        for frame in &frames {
            let mut part = vec![0; shape.bytes()];
            reader.next_frame(&mut part).expect("a frame");
            let control = *reader.info().frame_control().expect("a frame");
            assert_eq!(control.blend_op, png::BlendOp::Source);
            let channels = shape.channels();
            let row = control.width as usize * channels;
            for y in 0..control.height as usize {
                let at = ((control.y_offset as usize + y) * shape.width as usize + control.x_offset as usize)
                    * channels;
                canvas[at..at + row].copy_from_slice(&part[y * row..(y + 1) * row]);
            }
            assert!(canvas == *frame);
        }
    }
}

#[test]
fn gif_films_keep_the_colours_of_few() {
    let shape = SHAPES[0];
    let frames = frames(shape);
    let file = film(Format::Gif, shape, &frames);
    let mut options = ::gif::DecodeOptions::new();
    options.set_color_output(::gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(&file[..]).expect("GIF");
    let mut canvas = vec![0; shape.bytes()];
    let mut delays = 0;
    for frame in &frames {
        let part = decoder.read_next_frame().expect("GIF").expect("a frame");
        delays += part.delay;
        for (i, pixel) in part.buffer.chunks_exact(4).enumerate().filter(|(_, pixel)| pixel[3] > 0) {
            let (x, y) = (i % part.width as usize, i / part.width as usize);
            let at = ((part.top as usize + y) * shape.width as usize + part.left as usize + x) * 3;
            canvas[at..at + 3].copy_from_slice(&pixel[..3]);
        }
        assert!(canvas == *frame);
    }
    assert!((16..=17).contains(&delays), "{delays}");
    assert!(decoder.read_next_frame().expect("GIF").is_none());
}

#[test]
fn raw_video_has_three_planes_a_frame() {
    let shape = SHAPES[0];
    let file = film(Format::Y4m, shape, &frames(shape));
    let head = b"YUV4MPEG2 W33 H21 F30:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    assert!(file.starts_with(head));
    assert_eq!(file.len(), head.len() + 5 * (6 + 3 * 33 * 21));
}

#[test]
fn impossible_films_are_errors() {
    let shape = SHAPES[1];
    let mut out = Cursor::new(Vec::new());
    assert!(Film::begin(Format::Gif, &mut out, shape, vec![1.0]).is_err(), "transparent");
    assert!(Film::begin(Format::Webp, &mut out, shape, Vec::new()).is_err(), "no frames");
    let wide = Shape { width: 20_000, height: 1, has_alpha: false };
    assert!(Film::begin(Format::Webp, &mut out, wide, vec![1.0]).is_err(), "too wide");
    let mut film = Film::begin(Format::Apng, &mut out, shape, vec![1.0, 2.0]).expect("a film");
    assert!(film.add(&[0; 7]).is_err(), "another size");
    film.add(&vec![0; shape.bytes()]).expect("a frame");
    assert!(film.finish().is_err(), "a frame is missing");
}
