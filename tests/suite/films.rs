//! Films in one file, decoded again, against the PNG frames of the same render.

#[path = "../../crates/film/src/tests/reader.rs"]
mod reader;

use std::fs;
use std::io::Cursor;

use crate::cli::{bad, good};

const RENDER: [&str; 7] =
    ["render", "models/leaf.dls", "--at", "0.5,1.2,1.2000001,3,6", "--size", "90x70", "--format"];

/// The first picture of a file, with the opacity of each pixel.
fn png(path: &std::path::Path) -> Vec<u8> {
    let file = fs::read(path).expect("a file");
    let mut reader = png::Decoder::new(Cursor::new(file)).read_info().expect("PNG");
    let mut data = vec![0; reader.output_buffer_size().expect("small")];
    reader.next_frame(&mut data).expect("a picture");
    match reader.info().color_type {
        png::ColorType::Rgb => data.chunks_exact(3).flat_map(|rgb| [rgb[0], rgb[1], rgb[2], 255]).collect(),
        _ => data,
    }
}

#[test]
fn films_show_the_frames_bit_for_bit() {
    for background in ["#fbfaf5", "none"] {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
        let render = |format: &str, out: &str| {
            good(&[&RENDER[..], &[format, "-o", out, "--background", background]].concat())
        };
        render("png", &at("frames"));
        let frames: Vec<Vec<u8>> =
            (0..5).map(|i| png(&folder.path().join(format!("frames/frame-{i:04}.png")))).collect();
        let said = render("webp", &at("a.webp"));
        assert!(said.contains("5 frames of 90x70 pixels"), "{said}");
        let file = fs::read(at("a.webp")).expect("a file");
        let (pictures, milliseconds) = reader::read(&file);
        assert!(pictures == frames);
        assert_eq!(milliseconds, [700, 1, 1799, 3000, 3000]);
        good(
            &[&RENDER[..], &["webp", "-o", &at("b.webp"), "--threads", "1", "--background", background]]
                .concat(),
        );
        assert!(fs::read(at("b.webp")).expect("a file") == file, "threads do not matter");
        render("apng", &at("a.apng"));
        assert!(png(&folder.path().join("a.apng")) == frames[0]);
    }
}

#[test]
fn a_camera_goes_round_a_plant_that_grows_or_stands_still() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let render = |name: &str, flags: &[&str]| {
        let all = ["render", "models/leaf.dls", "-o", &at(name), "--size", "90x70", "--format"];
        good(&[&all[..], flags].concat())
    };
    // The leaf is flat, so from the side it is a line.
    let columns = |picture: &[u8]| {
        let is_drawn =
            |column: &usize| picture[4 * column..].chunks(4 * 90).any(|row| row[..3] != picture[..3]);
        (0..90).filter(is_drawn).collect::<Vec<usize>>()
    };
    render("still", &["png", "--at", "5", "--orbit", "360", "--orbit-frames", "8"]);
    let frames: Vec<Vec<u8>> =
        (0..8).map(|i| png(&folder.path().join(format!("still/frame-{i:04}.png")))).collect();
    let widths: Vec<usize> = frames.iter().map(|frame| columns(frame).len()).collect();
    assert!(widths[0] > 4 * widths[2] && widths[0] == widths[4], "{widths:?}");
    // From behind it is the other way round, about the same axis: its foot is in the middle.
    let [front, back] = [&frames[0], &frames[4]].map(|frame| columns(frame));
    assert!(front.iter().rev().map(|column| 89 - column).eq(back), "{front:?}");
    let said = render("still.webp", &["webp", "--at", "5", "--orbit", "360", "--orbit-frames", "8"]);
    assert!(said.contains("8 frames") && said.contains("0.32 s to play"), "{said}");
    assert!(reader::read(&fs::read(at("still.webp")).expect("a file")).0 == frames);
    // While it grows, the angle follows the time: 5 of the 6 until the end of the last frame.
    render("grown", &["png", "--at", "0,4,5", "--orbit", "-216"]);
    let turned = png(&folder.path().join("grown/frame-0002.png"));
    assert!(turned == frames[4], "180 degrees the other way round");
}

#[test]
fn raw_video_goes_to_a_pipe() {
    let video = std::process::Command::new(env!("CARGO_BIN_EXE_dlsys"))
        .args(RENDER)
        .args(["y4m", "-o", "-"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the program");
    assert!(video.status.success() && video.stdout.starts_with(b"YUV4MPEG2 W90 H70 F"));
    let head = video.stdout.iter().position(|byte| *byte == b'\n').expect("a line") + 1;
    assert_eq!(video.stdout.len() - head, 5 * (6 + 3 * 90 * 70));
}

#[test]
fn flags_that_make_no_film_are_refused_and_files_of_others_stay() {
    let folder = tempfile::tempdir().expect("a folder");
    let thesis = folder.path().join("thesis.gif");
    fs::write(&thesis, "years of work").expect("written");
    let thesis = thesis.to_str().expect("UTF-8");
    let cases: [(&[&str], &str); 11] = [
        (&["gif", "-o", thesis], "is not a GIF file"),
        (&["gif", "-o", "a.gif", "--background", "none"], "no transparency"),
        (&["webp", "-o", "a.gif"], "`-o a.webp`"),
        (&["webp", "-o", "-"], "`-o -` is for --format y4m"),
        (&["webp", "-o", "a.webp", "--layout", "grid"], "on one sheet"),
        (&["png", "-o", "a.gif"], "--format webp"),
        (&["glb", "-o", "a.glb", "--orbit", "90"], "has a camera"),
        (&["usda", "-o", "a.usda", "--orbit", "90"], "has a camera"),
        (&["obj", "-o", "a", "--orbit", "90"], "--orbit is for pictures"),
        (&["png", "-o", "a", "--orbit", "90", "--layout", "grid"], "--orbit does not go with --layout grid"),
        (&["png", "-o", "a", "--orbit", "90", "--orbit-frames", "9"], "`--at T`"),
    ];
    for (arguments, expected) in cases {
        let (_, message) = bad(&[&RENDER[..], arguments].concat());
        assert!(message.contains(expected), "{arguments:?}: {message}");
    }
    let limited = folder.path().join("b.webp");
    let (_, message) = bad(&[
        &RENDER[..],
        &["webp", "-o", limited.to_str().expect("UTF-8"), "--max-output", "1kB"],
    ]
    .concat());
    assert!(message.contains("larger than"), "{message}");
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1, "nothing is left over");
}
