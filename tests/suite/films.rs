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

/// A square of a unit that moves to the right by its `t`, beside one that stands.
const MOVING: &str = "initial string: S\nframes 0 .. 4 step 1\ncolor c = \"#202020\"\n\
    interpret S: [ f(3) -(90) f(-4) Box ] [ -(90) f(t) Box ] [ f(5) -(90) f(10) Box ]\n\
    interpret Box: ;(c) { f(1) +(90) f(1) +(90) f(1) +(90) f(1) }";

#[test]
fn an_open_shutter_averages_the_light_of_what_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("moving.dls");
    fs::write(&model, MOVING).expect("written");
    let model = model.to_str().expect("UTF-8");
    let render = |name: &str, flags: &[&str]| {
        let out = folder.path().join(name);
        let all = ["render", model, "-o", out.to_str().expect("UTF-8"), "--size", "160x80", "--format"];
        let said = good(&[&all[..], flags].concat());
        (out, said)
    };
    let one = ["--from", "2", "--to", "2", "--step", "1"];
    let frame = |name: &str, flags: &[&str]| {
        png(&render(name, &[&["png"][..], flags].concat()).0.join("frame-0000.png"))
    };
    let sharp = frame("sharp", &one);
    assert!(frame("none", &[&one[..], &["--shutter", "0"]].concat()) == sharp);
    let (out, said) = render("open", &[&["png"][..], &one[..], &["--shutter", "360deg"]].concat());
    let open = png(&out.join("frame-0000.png"));
    assert!(said.contains("moments in all") && !said.contains("something moves by"), "{said}");
    // The light that the square takes away is the same, and spread over twice its width.
    let linear = |value: u8| (f64::from(value) / 255.0).powf(2.2);
    let taken = |picture: &[u8], column: usize| -> f64 {
        let paper = linear(picture[0]);
        picture[4 * column..].chunks(4 * 160).map(|row| paper - linear(row[0])).sum()
    };
    let all = |picture: &[u8]| (0..160).map(|column| taken(picture, column)).sum::<f64>();
    assert!((all(&open) / all(&sharp) - 1.0).abs() < 0.02, "{} {}", all(&open), all(&sharp));
    let widest = |picture: &[u8]| {
        let dark: Vec<bool> = (0..160).map(|column| taken(picture, column) > 0.05).collect();
        dark.chunk_by(|a, b| a == b).filter(|run| run[0]).map(<[bool]>::len).max().unwrap_or(0)
    };
    let (moved, stood) = (widest(&open), widest(&sharp));
    assert!((2 * stood - 2..=2 * stood + 2).contains(&moved), "{moved} {stood}");
    // What stands keeps its bits: the last column of the picture in which anything is drawn.
    let last = (0..160).rev().find(|column| taken(&sharp, *column) > 0.05).expect("drawn");
    let column = |picture: &[u8]| -> Vec<u8> {
        picture[4 * (last - 2)..].chunks(4 * 160).flat_map(|row| row[..4].to_vec()).collect()
    };
    assert!(column(&open) == column(&sharp));
    // A film shows the PNG frames, whatever the threads, and a still with the camera of the film is its frame.
    let (out, _) = render("frames", &["png", "--shutter", "0.5", "--background", "none"]);
    let frames: Vec<Vec<u8>> = (0..5).map(|i| png(&out.join(format!("frame-{i:04}.png")))).collect();
    let (film, _) =
        render("a.webp", &["webp", "--shutter", "180deg", "--background", "none", "--threads", "1"]);
    assert!(reader::read(&fs::read(film).expect("a file")).0 == frames);
    let seen = ["--camera", "3,3,30/3,3,0/40", "--shutter", "0.5"];
    let (out, _) = render("some", &[&["png"][..], &seen].concat());
    let at = frame("at", &[&["--at", "2"][..], &seen].concat());
    assert!(png(&out.join("frame-0002.png")) == at);
    assert!(png(&out.join("frame-0001.png")) != at);
    // The camera moves, too.
    let turn = ["--at", "2", "--orbit", "360", "--orbit-frames", "8"];
    assert!(frame("orbit", &[&turn[..], &["--shutter", "0.5"]].concat()) != frame("still", &turn));
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
    let cases: [(&[&str], &str); 21] = [
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
        (
            &["png", "-o", "a", "--camera", "0,1,5/0,0,0", "--layout", "grid"],
            "--camera does not go with --layout grid",
        ),
        (&["png", "-o", "a", "--orbit", "90", "--orbit-frames", "9"], "`--at T`"),
        (&["svg", "-o", "a", "--shutter", "0.5"], "--shutter averages pixels, and SVG files have none"),
        (&["obj", "-o", "a", "--shutter", "0.5"], "choose --format png, or a film"),
        (&["usda", "-o", "a.usda", "--shutter", "0.5"], "--shutter does not go with --format usda"),
        (&["png", "-o", "a", "--shutter", "0.5", "--layout", "stack"], "--shutter does not go with"),
        (&["png", "-o", "a", "--shutter", "180"], "180 degrees of 360 are 0.5 of a frame, or `180deg`"),
        (&["png", "-o", "a", "--fps", "25"], "--fps is for films in one file"),
        (&["glb", "-o", "a.glb", "--fps", "25"], "has a rate of its own"),
        (&["webp", "-o", "a.webp", "--fps", "25", "--speed", "2"], "leave one of the two out"),
        (&["png", "-o", "a", "--shutter", "1.5"], "from 0 to 1 frame, or from 0deg to 360deg"),
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

#[test]
fn of_rate_step_and_speed_two_say_the_third() {
    let folder = tempfile::tempdir().expect("a folder");
    let film = |name: &str, flags: &[&str]| {
        let file = folder.path().join(name).with_extension("webp");
        let out = file.to_str().expect("UTF-8");
        let all = ["render", "models/leaf.dls", "--format", "webp", "--size", "40x30", "-o", out];
        let said = good(&[&all[..], flags].concat());
        (said, reader::read(&fs::read(&file).expect("a file")).1)
    };
    let from_to = ["--from", "0", "--to", "2"];
    let (said, milliseconds) = film("slides", &[&from_to[..], &["--step", "0.5"]].concat());
    assert_eq!(milliseconds, [500; 5]);
    assert!(said.contains("2 a second, 2.50 s to play") && said.contains("`--fps 25`"), "{said}");
    let (said, milliseconds) = film("fps", &[&from_to[..], &["--fps", "16"]].concat());
    assert_eq!(milliseconds.len(), 33, "2 units of t last 2 seconds");
    assert!(said.contains("16 a second") && !said.contains("slides"), "{said}");
    let (_, milliseconds) = film("speed", &[&from_to[..], &["--fps", "8", "--speed", "4"]].concat());
    assert_eq!(milliseconds, [125; 5]);
    let (_, milliseconds) = film("step", &[&from_to[..], &["--fps", "20", "--step", "0.5"]].concat());
    assert_eq!(milliseconds, [50; 5]);
    let (_, milliseconds) = film("at", &["--at", "0,1,5", "--fps", "20"]);
    assert_eq!(milliseconds, [50; 3]);
    let (_, milliseconds) =
        film("orbit", &["--at", "5", "--orbit", "90", "--orbit-frames", "4", "--fps", "20"]);
    assert_eq!(milliseconds, [50; 4]);
}
