//! Values of the flags of `render`, and combinations that are refused.

use super::one_picture;
use crate::cli::args::RenderArgs;
use crate::cli::common::{Failure, cores};
use crate::cli::one_file;
use crate::cli::shared::Topology;
use crate::cli::values::{Background, Ground, LineWidth, RenderFormat, Sky};
use crate::render::{CAMERA_SHAPE, Content, Fit, Format, Layout, Page, Picture, Size, Spacing, Survey, View};
use crate::scene::Surroundings;
use crate::session::Detail;

fn usage(message: impl std::fmt::Display) -> Failure {
    Failure::Usage(format!("error: {message}\n"))
}

/// An empty survey in the chosen view, light and size.
pub fn survey(args: &RenderArgs) -> Result<Survey, Failure> {
    let view: View = args.view.as_deref().unwrap_or("front").parse().map_err(usage)?;
    let declared = Surroundings {
        sun: args.light,
        sky: args.sky.map(|Sky(colors)| colors),
        camera: args.camera,
        floor: args.ground.map(|Ground(height, _)| height),
        floor_color: args.ground.and_then(|Ground(_, color)| color),
    };
    let survey = Survey::new(view).with_surroundings(declared).with_zoom(args.zoom.unwrap_or(1.0));
    let survey = if args.line_width.is_some() { survey.with_one_width() } else { survey };
    let survey = match args.perspective {
        Some(field) => survey.with_perspective(field),
        None => survey,
    };
    let survey = if args.orbit.is_some() { survey.on_a_turntable() } else { survey };
    let has_view = args.view.is_some() || args.perspective.is_some();
    Ok(if has_view { survey.without_cameras() } else { survey })
}

/// Flags that are for pictures, and whether they are given.
pub fn of_pictures(args: &RenderArgs) -> [(&'static str, bool); 12] {
    [
        ("--perspective", args.perspective.is_some()),
        ("--camera", args.camera.is_some()),
        ("--orbit", args.orbit.is_some()),
        ("--shutter", args.shutter.is_some()),
        ("--zoom", args.zoom.is_some()),
        ("--light", args.light.is_some()),
        ("--sky", args.sky.is_some()),
        ("--ground", args.ground.is_some()),
        ("--width", args.width.is_some()),
        ("--size", args.size.is_some()),
        ("--background", args.background.is_some()),
        ("--line-width", args.line_width.is_some()),
    ]
}

/// Endings of pictures, films and meshes of other programs.
const OTHERS: [&str; 17] = [
    "jpg", "jpeg", "bmp", "tif", "tiff", "tga", "pdf", "eps", "ps", "exr", "avi", "mov", "mkv", "fbx", "stl",
    "ply", "dae",
];

/// Refuses flags that have no meaning for the format or the layout.
pub fn agree(args: &RenderArgs, format: Format) -> Result<(), Failure> {
    if args.speed.is_some() {
        return Err(usage(
            "--speed is for animated files; leave it out, or choose --format glb, usda, webp, apng, gif, y4m or asvg",
        ));
    }
    if args.fps.is_some() {
        return Err(usage(
            "--fps is for films in one file: choose --format webp, apng, gif, y4m or asvg; of single frames there are as many as `--step S` says",
        ));
    }
    let single = match format.content() {
        Content::Mesh => "in which every frame is a file".to_owned(),
        _ => {
            let name = one_file::named(&args.shared.model, format.extension());
            format!("or one frame in a file: `--at T -o {name}`")
        }
    };
    one_file::refuse_stream(&args.out, &format!("name a folder, `-o frames`, {single}"))?;
    let extension = args.out.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let is_file = |name: &str| extension == name;
    if !args.out.is_dir() && OTHERS.contains(&&*extension) {
        return Err(usage(format!(
            "no format of dlsys writes .{extension}, and -o {} would be a folder; write a .svg, .png, .webp, .gif, .glb or .usda file; OBJ files stand in a folder, --format obj",
            args.out.display()
        )));
    }
    if !args.out.is_dir()
        && extension != format.extension()
        && Format::all().any(|other| is_file(other.extension()))
    {
        return Err(usage(format!(
            "-o {} says {extension} and --format says {}: leave --format out, or change the ending",
            args.out.display(),
            format.extension()
        )));
    }
    let known = Format::all()
        .map(Format::extension)
        .chain(["gif", "webp", "apng", "y4m", "mp4", "webm", "glb", "usda"]);
    if !args.out.is_dir() && known.into_iter().any(is_file) && one_picture::format(args).is_none() {
        let name = args.out.with_extension("");
        if format.content() == Content::Mesh {
            return Err(usage(format!(
                "an OBJ file has its materials in a file beside it, so also a single frame is written into a folder, and {} looks like a file: `-o {} --format obj`; whole animations in one file are --format glb and usda",
                args.out.display(),
                name.display()
            )));
        }
        return Err(usage(format!(
            "-o names a folder, and {} looks like a file: every frame is a file in it; `-o {}` and --format svg, png or obj, or `--at T` for one frame in a file; a whole film in one file is --format webp, apng, gif, y4m or asvg",
            args.out.display(),
            name.display()
        )));
    }
    if args.shutter.is_some() && format.content() != Content::Pixels {
        return Err(usage(format!(
            "--shutter averages pixels, and {} files have none; choose --format png, or a film (webp, apng, gif or y4m)",
            format.extension().to_uppercase()
        )));
    }
    if format.content() == Content::Mesh {
        if args.layout != Layout::Frames {
            return Err(usage(format!(
                "an OBJ file is one mesh in space, so frames cannot be laid out on a sheet as --layout {} does; \
                 choose --format svg or png, or leave out --layout for a file for each frame",
                args.layout.name()
            )));
        }
        let given = of_pictures(args);
        if let Some((flag, _)) = given.iter().find(|(_, given)| *given) {
            return Err(usage(format!(
                "{flag} is for pictures, and an OBJ file is a mesh in space; leave it out, or choose --format svg or png"
            )));
        }
    }
    of_layouts(args)
}

/// Refuses flags of another layout.
pub fn of_layouts(args: &RenderArgs) -> Result<(), Failure> {
    if args.topology == Topology::Varying {
        return Err(usage(
            "--topology is for --format usda, whose meshes keep their triangles or change them; leave it out",
        ));
    }
    if args.orbit.is_some() && args.layout != Layout::Frames {
        return Err(usage(format!(
            "--orbit does not go with --layout {}: the camera turns from frame to frame, so choose a film (--format webp, apng, gif or y4m) or a file for each frame",
            args.layout.name()
        )));
    }
    if args.shutter.is_some() && args.layout != Layout::Frames {
        return Err(usage(format!(
            "--shutter does not go with --layout {}: stages on a sheet are sharp; choose a film (--format webp, apng, gif or y4m) or a file for each frame",
            args.layout.name()
        )));
    }
    if args.camera.is_some() && args.layout != Layout::Frames {
        return Err(usage(format!(
            "--camera does not go with --layout {}: stages on a sheet are moved apart, and seen from one direction; choose --view AZIMUTH,ELEVATION, or a file for each frame",
            args.layout.name()
        )));
    }
    let mut times: Vec<f64> = args.shared.at.iter().flatten().copied().collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    if args.orbit_frames.is_some() && times.len() != 1 {
        return Err(usage(
            "--orbit-frames is for a plant that stands still, with one time: `--at T`; with several times each has its frame",
        ));
    }
    let of_layout = [
        ("--columns", args.columns.is_some(), Layout::Grid),
        ("--no-captions", args.no_captions, Layout::Grid),
        ("--row-height", args.row_height.is_some(), Layout::Stack),
    ];
    match of_layout.iter().find(|(_, given, layout)| *given && args.layout != *layout) {
        Some((flag, _, layout)) => Err(usage(format!(
            "{flag} goes with --layout {}, not with {}",
            layout.name(),
            args.layout.name()
        ))),
        None => Ok(()),
    }
}

pub fn threads(args: &RenderArgs) -> usize {
    args.threads.unwrap_or_else(cores)
}

pub fn spacing(args: &RenderArgs) -> Spacing {
    Spacing { columns: args.columns, row_height: args.row_height, size: size(args) }
}

/// The values that all frames share; `picture` is the area of the page.
pub fn fit(args: &RenderArgs, survey: &Survey, picture: impl Fn(&Fit) -> Picture) -> Result<Fit, Failure> {
    let fit = match args.line_width {
        None => survey.fit(),
        Some(LineWidth::Units(width)) => survey.fit_of_width(width),
        Some(LineWidth::Pixels(pixels)) => {
            let mut fit = survey.fit_of_width(0.0);
            // The area includes the widths of lines, which depend on the area: each time by some hundredths of what they did before.
            for _ in 0..3 {
                let page = page(args, picture(&fit))?;
                fit = survey.fit_of_width(pixels / page.pixels_per_unit());
            }
            fit
        }
    };
    let is_picture = match args.format {
        RenderFormat::Frames(format) => format.content() != Content::Mesh,
        RenderFormat::Film(_) | RenderFormat::Moving => true,
        RenderFormat::Growth(_) => false,
    };
    Ok(match args.accuracy {
        Some(accuracy) => fit.with_accuracy(accuracy),
        None if is_picture => {
            let page = page(args, picture(&fit))?;
            fit.for_pictures(&survey.first_surroundings(), &page)
        }
        None => fit,
    })
}

/// The size in which the plants of a scene are seen, if pictures are taken by its camera.
pub fn detail(args: &RenderArgs, format: Format) -> Option<Detail> {
    let has_view = args.view.is_some() || args.perspective.is_some();
    let bound = match format.content() {
        Content::Pixels => args.bend_pixels,
        // They are looked at enlarged.
        Content::Vectors => args.bend_pixels / 2.0,
        Content::Mesh => 0.0,
    };
    if has_view || bound == 0.0 {
        return None;
    }
    let size = match (args.size, args.width) {
        (Some((width, height)), _) => Size::Exact(width, height),
        (None, Some(width)) => Size::Width(width),
        (None, None) => Size::default(),
    };
    let (smaller, shape) = match size {
        Size::Exact(width, height) => {
            let [smaller, larger] = [width.min(height), width.max(height)].map(f64::from);
            (smaller, larger / smaller.max(1.0))
        }
        Size::Larger(pixels) | Size::Width(pixels) => (f64::from(pixels) / CAMERA_SHAPE, CAMERA_SHAPE),
    };
    let pixels = smaller * args.zoom.unwrap_or(1.0);
    Some(Detail { pixels, shape, viewpoint: args.camera, bound })
}

/// The page for a picture.
pub fn page(args: &RenderArgs, picture: Picture) -> Result<Page, Failure> {
    let background = args.background.map_or(Some(Page::BACKGROUND), |Background(color)| color);
    Page::new(picture, size(args), background).map_err(usage)
}

fn size(args: &RenderArgs) -> Size {
    match (args.size, args.width) {
        (Some((width, height)), _) => Size::Exact(width, height),
        (None, Some(width)) => Size::Width(width),
        (None, None) => Size::default(),
    }
}
