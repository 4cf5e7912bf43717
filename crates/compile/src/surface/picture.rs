//! Pictures on surfaces: PNG files of any kind, as texels of eight bits.

use std::io::Cursor;
use std::path::Path;

use super::SurfaceError;
use dlsys_model::Picture;
use dlsys_syntax::{Files, fault_of_path};

/// Maximum size of the file of a picture, in bytes.
const FILE_LIMIT: u64 = 32 << 20;
/// Maximum width and height of a picture, in texels.
const SIDE_LIMIT: u32 = 4096;
/// Maximum number of texels of all pictures of a model: four of the largest ones.
const TEXEL_LIMIT: usize = 4 << 24;

/// Reads a picture.
pub fn read(path: &str, files: &dyn Files) -> Result<Picture, SurfaceError> {
    if let Some(why) = fault_of_path(path) {
        return Err(SurfaceError::whole(why)
            .help("pictures stand in the folder of the model or below it, as in `\"organs/leaf.png\"`"));
    }
    let file = files.read(Path::new(path), FILE_LIMIT).map_err(|what| {
        SurfaceError::whole(what)
            .help("put it into the folder of the model's file or below; the path begins there")
    })?;
    if !file.starts_with(b"\x89PNG") {
        let what = match file.starts_with(b"\xff\xd8\xff") {
            true => "this is a JPEG picture, and pictures on surfaces are PNG files",
            false => "this is no PNG picture",
        };
        return Err(SurfaceError::whole(what)
            .help("save it as PNG in a program for pictures; a PNG can also be transparent around a leaf"));
    }
    let (size, texels) = decode(&file)?;
    Picture::new(path, file, size, texels).ok_or_else(|| SurfaceError::whole("the picture is empty"))
}

/// An error if all pictures of a model have so many texels and these are too many.
pub fn within_limit(texels: usize) -> Result<(), SurfaceError> {
    if texels <= TEXEL_LIMIT {
        return Ok(());
    }
    let what = format!("the pictures of the model have more than {} million pixels", TEXEL_LIMIT >> 20);
    Err(SurfaceError::whole(what).help("make them smaller, or let surfaces share them"))
}

/// Width and height, and the texels by row from the upper one.
fn decode(file: &[u8]) -> Result<([usize; 2], Vec<[u8; 4]>), SurfaceError> {
    let broken = |error: png::DecodingError| {
        SurfaceError::whole(format!("the PNG picture is broken: {error}"))
            .help("save it again in a program for pictures")
    };
    let limits = png::Limits { bytes: 4 * (SIDE_LIMIT as usize).pow(2) * 4 };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(file), limits);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let header = decoder.read_header_info().map_err(broken)?;
    let (width, height) = (header.width, header.height);
    if width.max(height) > SIDE_LIMIT {
        let what = format!(
            "the picture has {width} × {height} pixels; at most {SIDE_LIMIT} × {SIDE_LIMIT} are read"
        );
        return Err(SurfaceError::whole(what).help("make it smaller: an organ is rarely larger in a picture"));
    }
    let mut reader = decoder.read_info().map_err(broken)?;
    let length = reader.output_buffer_size().unwrap_or_default();
    let mut data = vec![0; length];
    let info = reader.next_frame(&mut data).map_err(broken)?;
    data.truncate(info.buffer_size());
    let texels = match info.color_type {
        png::ColorType::Rgba => data.as_chunks().0.to_vec(),
        png::ColorType::Rgb => data.as_chunks().0.iter().map(|&[r, g, b]| [r, g, b, 255]).collect(),
        png::ColorType::GrayscaleAlpha => data.as_chunks().0.iter().map(|&[g, a]| [g, g, g, a]).collect(),
        png::ColorType::Grayscale | png::ColorType::Indexed => data.iter().map(|&g| [g, g, g, 255]).collect(),
    };
    Ok(([width as usize, height as usize], texels))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct One(Vec<u8>);

    impl Files for One {
        fn read(&self, _: &Path, _: u64) -> Result<Vec<u8>, String> {
            Ok(self.0.clone())
        }
    }

    fn encoded(color: png::ColorType, depth: png::BitDepth, size: [u32; 2], data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == png::ColorType::Indexed {
            encoder.set_palette(vec![1, 2, 3, 4, 5, 6]);
            encoder.set_trns(vec![0, 255]);
        }
        let mut writer = encoder.write_header().expect("a header");
        writer.write_image_data(data).expect("the data");
        writer.finish().expect("memory");
        bytes
    }

    #[test]
    fn every_kind_of_png_has_the_same_texels() {
        use png::{BitDepth, ColorType};
        let read = |color, depth, size, data: &[u8]| {
            read("p.png", &One(encoded(color, depth, size, data))).expect("a picture").texels().to_vec()
        };
        assert_eq!(read(ColorType::Rgb, BitDepth::Eight, [1, 1], &[1, 2, 3]), [[1, 2, 3, 255]]);
        assert_eq!(
            read(ColorType::Rgba, BitDepth::Sixteen, [1, 1], &[1, 0, 2, 0, 3, 0, 4, 0]),
            [[1, 2, 3, 4]]
        );
        assert_eq!(read(ColorType::GrayscaleAlpha, BitDepth::Eight, [1, 1], &[7, 9]), [[7, 7, 7, 9]]);
        assert_eq!(read(ColorType::Grayscale, BitDepth::One, [2, 1], &[0x40]), [[0, 0, 0, 255], [255; 4]]);
        assert_eq!(read(ColorType::Indexed, BitDepth::One, [2, 1], &[0x40]), [[1, 2, 3, 0], [4, 5, 6, 255]]);
    }

    #[test]
    fn other_files_and_broken_ones_are_refused() {
        let fault = |bytes: Vec<u8>| read("p.png", &One(bytes)).expect_err("a fault").what;
        assert_eq!(fault(b"text".to_vec()), "this is no PNG picture");
        assert!(fault(b"\xff\xd8\xff\xe0".to_vec()).contains("JPEG"));
        let whole = encoded(png::ColorType::Rgb, png::BitDepth::Eight, [40, 40], &[7; 4800]);
        assert!(fault(whole[..whole.len() / 2].to_vec()).contains("broken"));
        // A header of a picture that would take much memory, and nothing behind it.
        let mut huge = encoded(png::ColorType::Rgb, png::BitDepth::Eight, [1, 1], &[0; 3]);
        huge[16..24].copy_from_slice(&[0, 0, 0x10, 1, 0, 0, 0, 9]);
        assert!(fault(huge).contains("broken"), "the checksum of the header");
        let wide = encoded(png::ColorType::Grayscale, png::BitDepth::One, [4097, 1], &[0; 513]);
        assert!(fault(wide).starts_with("the picture has 4097 × 1 pixels"));
        assert!(read("../p.png", &One(Vec::new())).expect_err("outside").what.contains("leaves"));
    }
}
