//! Films, decoded again by the readers of the crates that wrote their frames.

mod reader;

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
    let mut film = Film::begin(format, &mut out, shape, ends, 2).expect("a film");
    frames.iter().for_each(|frame| film.add(frame).expect("a frame"));
    film.finish().expect("an end");
    let bytes = out.into_inner();
    assert!(format.begins(&bytes));
    bytes
}

const SHAPES: [Shape; 2] =
    [Shape { width: 33, height: 21, has_alpha: false }, Shape { width: 32, height: 27, has_alpha: true }];

/// A frame as it is decoded: with the opacity of each pixel.
fn with_opacity(frame: &[u8], shape: Shape) -> Vec<u8> {
    let pixels = frame.chunks_exact(shape.channels());
    pixels.flat_map(|pixel| colour(pixel).rotate_left(8).to_be_bytes()).collect()
}

#[test]
fn webp_films_are_lossless() {
    for shape in SHAPES {
        let frames = frames(shape);
        let file = film(Format::Webp, shape, &frames);
        let decoder = image_webp::WebPDecoder::new(Cursor::new(&file[..])).expect("WebP");
        assert_eq!(decoder.dimensions(), (shape.width, shape.height));
        assert_eq!((decoder.num_frames() as usize, decoder.has_alpha()), (frames.len(), true));
        let (pictures, milliseconds) = reader::read(&file);
        assert_eq!(pictures.len(), frames.len());
        assert!(pictures.iter().zip(&frames).all(|(picture, frame)| *picture == with_opacity(frame, shape)));
        assert_eq!(milliseconds.iter().sum::<u32>(), 167, "five thirtieths of a second, without drift");
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
        let mut canvas = vec![0; shape.width as usize * shape.height as usize * 4];
        for frame in &frames {
            let mut part = vec![0; canvas.len()];
            reader.next_frame(&mut part).expect("a frame");
            let control = *reader.info().frame_control().expect("a frame");
            let is_over = control.blend_op == png::BlendOp::Over;
            let width = control.width as usize;
            for (i, pixel) in part.chunks_exact(4).take(width * control.height as usize).enumerate() {
                let (x, y) = (control.x_offset as usize + i % width, control.y_offset as usize + i / width);
                assert!(!is_over || matches!(pixel[3], 0 | 255), "nothing is mixed");
                if !is_over || pixel[3] > 0 {
                    let at = (y * shape.width as usize + x) * 4;
                    canvas[at..at + 4].copy_from_slice(pixel);
                }
            }
            assert!(canvas == with_opacity(frame, shape));
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

/// A film of one frame, and one whose frames have nothing in common, and more colours than a palette.
#[test]
fn gif_films_are_near_to_many_colours() {
    let shape = Shape { width: 64, height: 64, has_alpha: false };
    let frame = |k: u32| -> Vec<u8> {
        (0..64 * 64_u32).flat_map(|i| [i % 64 * 4, i / 64 * 4, (i % 64 + k) * 2].map(|x| x as u8)).collect()
    };
    for frames in [vec![frame(0)], vec![frame(0), frame(30)]] {
        let file = film(Format::Gif, shape, &frames);
        let mut options = ::gif::DecodeOptions::new();
        options.set_color_output(::gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&file[..]).expect("GIF");
        let mut canvas = vec![0; shape.bytes()];
        for frame in &frames {
            let part = decoder.read_next_frame().expect("GIF").expect("a frame");
            assert_eq!((part.width, part.height), (64, 64), "all has changed");
            for (i, pixel) in part.buffer.chunks_exact(4).enumerate().filter(|(_, pixel)| pixel[3] > 0) {
                canvas[3 * i..3 * i + 3].copy_from_slice(&pixel[..3]);
            }
            let worst = canvas.iter().zip(frame).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(worst <= Some(16), "{worst:?}");
        }
    }
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
    assert!(Film::begin(Format::Gif, &mut out, shape, vec![1.0], 1).is_err(), "transparent");
    assert!(Film::begin(Format::Webp, &mut out, shape, Vec::new(), 1).is_err(), "no frames");
    let wide = Shape { width: 20_000, height: 1, has_alpha: false };
    assert!(Film::begin(Format::Webp, &mut out, wide, vec![1.0], 1).is_err(), "too wide");
    let mut film = Film::begin(Format::Apng, &mut out, shape, vec![1.0, 2.0], 1).expect("a film");
    assert!(film.add(&[0; 7]).is_err(), "another size");
    film.add(&vec![0; shape.bytes()]).expect("a frame");
    assert!(film.finish().is_err(), "a frame is missing");
}
