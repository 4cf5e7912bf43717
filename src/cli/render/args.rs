//! Arguments of `dlsys render`.

use std::path::PathBuf;

use clap::Args;

use crate::cli::shared::{SharedArgs, Topology};
use crate::cli::values::{
    Background, Ground, LineWidth, RenderFormat, Seeds, Sky, background, bend_pixels, bytes, camera, columns,
    direction, field_of_view, ground, layout, line_width, pixels, positive, render_format, seeds, shutter,
    size, sky, threads, turn, zoom,
};
use crate::render::Layout;
use crate::scene::{Vector, Viewpoint};

/// How the paper's figures are made.
pub const RENDER_EXAMPLES: &str = "\
Examples:
  dlsys render models/lychnis.dls -o out --format png --perspective 40 --view 30,20
      pixels, in perspective, from azimuth 30 and elevation 20 degrees
  dlsys render models/lychnis.dls -o lychnis.webp --format webp --orbit 360
      a film of the growing plant, round which the camera goes
  dlsys render models/dragon.dls -o fig6 --layout overlay --from 0 --to 1 --step 0.125
      figure 6 of the paper, upper left: stages over one another, the older the fainter
  dlsys render models/anabaena.dls -o fig7 --layout stack
      figure 7: a line for each frame, one below the other
  dlsys render models/leaf.dls -o fig9 --layout grid --at 0.5,2.15,3,4,5,6,9
      figure 9: a row of stages with their times";

#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub shared: SharedArgs,
    /// Render specimens with these seeds, both ends included, each into a directory seed-N of its own; all are drawn to
    /// one scale
    #[arg(long, value_name = "A..B", value_parser = seeds, conflicts_with_all = ["seed", "events", "stats", "watch"])]
    pub seeds: Option<Seeds>,
    /// Directory for the frames; made if it is not there. The file, such as plant.png, for one frame (--at T) or a sheet (--layout). With a format of whole animations
    /// (glb, usda, webp, apng, gif, y4m, asvg) the file, or a folder for it; - is standard output, for y4m
    #[arg(short, long = "out", value_name = "DIR")]
    pub out: PathBuf,
    /// File format of the frames, or of the whole animation [default: that of the file that -o names, or svg]
    #[arg(long = "format", value_name = "FORMAT", value_parser = render_format())]
    pub chosen_format: Option<RenderFormat>,
    /// That, or the one that the file's name says.
    #[arg(skip)]
    pub format: RenderFormat,
    /// With a format of whole animations: units of the model's time in a second of the animation [default: 1, or, with `units … time S`, 1/S]
    #[arg(long, value_name = "V", allow_negative_numbers = true, value_parser = positive)]
    pub speed: Option<f64>,
    /// For films: frames in a second. Without --step there are as many frames as that takes, with it each frame of that step is seen for 1/N of a second
    ///
    /// The film is as long as --speed says, or, with --step, as its frames: of --fps, --step and --speed two say the third. With --at T1,T2,… each of these times is seen for 1/N of a second.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = positive)]
    pub fps: Option<f64>,
    /// With --format usda: whether meshes keep their triangles
    #[arg(long, value_enum, default_value_t = Topology::Constant)]
    pub topology: Topology,
    /// A file for each frame, or all frames on one sheet
    ///
    /// frames: a file for each frame. overlay: all in one place, the older the fainter. stack: each below the one before,
    /// aligned on the plant's origin; for flat plants such as filaments. grid: in rows, aligned on the ground, each with
    /// its time. All frames of a sheet have one scale. The sheet is written as overlay.svg, stack.svg or grid.svg (or
    /// .png).
    #[arg(long, default_value = "frames", value_parser = layout, value_name = "frames|overlay|stack|grid")]
    pub layout: Layout,
    /// With --layout grid: frames in a row [default: all in one]
    #[arg(long, value_name = "N", value_parser = columns)]
    pub columns: Option<usize>,
    /// With --layout grid: do not write the time below each frame. It has letters of at least 9
    /// pixels; on small sheets it is a number alone
    #[arg(long)]
    pub no_captions: bool,
    /// With --layout stack: from one line to the next, in scene units [default: the height of the highest]
    #[arg(long, value_name = "H", allow_negative_numbers = true, value_parser = positive)]
    pub row_height: Option<f64>,
    /// Direction of view: front, side, top, or AZIMUTH,ELEVATION in degrees [default: the model's `camera`, or front]
    #[arg(long, allow_hyphen_values = true)]
    pub view: Option<String>,
    /// Turntable: the camera goes round the plant's vertical axis by so many degrees over the film, or over the frames; negative for the other way
    ///
    /// Round the axis through the origin; round the one through its aim if the camera is given by --camera or declared. The plant fits into the picture at all
    /// angles. A full turn of 360 degrees is a loop: the frame after the last would be like the first. With one time, such as --at 5, the plant stands still.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = turn)]
    pub orbit: Option<f64>,
    /// With --orbit and one time: frames, 25 in a second of a film, or as many as --fps says [default: 120]
    #[arg(long, value_name = "N", value_parser = columns, requires = "orbit")]
    pub orbit_frames: Option<usize>,
    /// Motion blur: how long the shutter is open, in frames, or as an angle: 0.5 and 180deg are half of the interval between frames
    ///
    /// From 0 (no blur) to 1, or 360deg; each frame is in the middle of the time for which its shutter is open. For --format png and films. A frame is drawn at as many moments as it takes
    /// for nothing to move by more than about a pixel between two of them, at most 127, and their light is averaged.
    #[arg(long, value_name = "FRAMES", allow_negative_numbers = true, value_parser = shutter)]
    pub shutter: Option<f64>,
    /// A camera in perspective: eye/aim, or eye/aim/angle of view in degrees across the smaller side (1 to 120) [default angle: 40]
    ///
    /// Points in scene units, such as 4,2,6/0,1,0/35.
    #[arg(long, value_name = "X,Y,Z/X,Y,Z", allow_hyphen_values = true, value_parser = camera, conflicts_with_all = ["view", "perspective"])]
    pub camera: Option<Viewpoint>,
    /// Magnify pictures about their middle
    #[arg(long, value_name = "K", allow_negative_numbers = true, value_parser = zoom)]
    pub zoom: Option<f64>,
    /// Direction towards the sun, such as 1,2,1: its light casts shadows
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = direction)]
    pub light: Option<Vector>,
    /// Colours of the sky at the zenith and at the horizon, such as "#6fa3e0,#e8f0f8": light from all over it, and the background
    #[arg(long, value_name = "COLOUR,COLOUR", value_parser = sky)]
    pub sky: Option<Sky>,
    /// A floor without end at this height, in scene units, which takes up shadows; and its colour, such as "0,#9aa35f"
    ///
    /// It is seen only: things that fall stop at the `ground` of the model.
    #[arg(long, value_name = "H[,COLOUR]", allow_hyphen_values = true, value_parser = ground)]
    pub ground: Option<Ground>,
    /// Largest distance of the drawing from a curved surface, in scene units [default: 1/2000 of the extent of the
    /// whole animation]
    ///
    /// Applies to stems and Bézier patches, with at most 4096 sides of a stem and 64 pieces on an edge of a patch. The leaf
    /// @L, the flower @K and meshes from files are not subdivided.
    #[arg(long, value_name = "L", value_parser = positive)]
    pub accuracy: Option<f64>,
    /// Largest error, in pixels, of plants of other models that move in the wind by the modes of their class (0 to 100; 0: all are solved)
    ///
    /// For --format png, and half of it for svg, in scenes with a camera. The error is measured on a sample; without a camera, all plants are solved. Plants of nearly the same age share a drawing where
    /// that moves no point by more than this.
    #[arg(long, value_name = "PIXELS", allow_negative_numbers = true, default_value = "0.5", value_parser = bend_pixels)]
    pub bend_pixels: f64,
    /// Draw in perspective with this field of view (1 to 120 degrees), filled by the drawings of all times [default:
    /// orthographic]
    #[arg(long, value_name = "DEGREES", value_parser = field_of_view)]
    pub perspective: Option<f64>,
    /// Width of pictures in pixels; the height follows [default: 1000 on the larger side]
    #[arg(long, value_name = "PIXELS", value_parser = pixels)]
    pub width: Option<u32>,
    /// Width and height of pictures in pixels
    #[arg(long, value_name = "WxH", value_parser = size, conflicts_with = "width")]
    pub size: Option<(u32, u32)>,
    /// Background of pictures: "#rrggbb" or none (transparent) [default: #fbfaf5]
    #[arg(long, value_name = "COLOUR", value_parser = background)]
    pub background: Option<Background>,
    /// Width of all lines of pictures, whatever the model says: in pixels, such as 1px, or in the model's units [default:
    /// the widths of the model; 0.8 % of the largest extent for lines without one, less where they are crowded]
    #[arg(long, value_name = "WIDTH", value_parser = line_width)]
    pub line_width: Option<LineWidth>,
    /// More bytes than this, in all files of the render, are an error, such as 500MB
    #[arg(long, value_name = "BYTES", default_value = "10GB", value_parser = bytes)]
    pub max_output: u64,
    /// Number of threads that compute, draw and write, with no effect on the files [default: one for each core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<usize>,
    /// Write into a directory that holds other files
    #[arg(long)]
    pub force: bool,
    /// Render again whenever the model, or a file that it names, is saved, until Ctrl-C. Errors are shown, and
    /// the frames of the last valid model stay
    #[arg(long)]
    pub watch: bool,
    /// Print no summary and show no progress
    #[arg(short, long)]
    pub quiet: bool,
}
