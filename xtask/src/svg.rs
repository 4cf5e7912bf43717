//! `svg`: SVG against PNG. Both show the same frame at the same size; librsvg draws the SVG, and the pixels are compared.
//!
//! Of each picture, within the plant (all that is not background in the PNG):
//!
//! * *mean*: the mean difference of a channel, of 255;
//! * *wrong*: the part of the pixels of which a channel differs by more than 60;
//! * *seams*: the part of the pixels, off the edge, through which a tenth of the background shows that does not in the PNG.
//!
//! Each is given three times:
//!
//! * *at its size*: as the files are;
//! * *drawn large*: the same SVG drawn at four times the size and reduced, against a PNG of four times the size that is reduced. Shapes,
//!   shades and hidden parts differ as much as before, but edges are smoothed alike: at its size librsvg puts one half-transparent edge
//!   over the other, while a PNG counts its samples;
//! * *smoothing*: the PNG against the reduced one. Two ways to smooth edges cannot agree better than that.
//!
//! A picture is beyond the bounds if at its size it differs by more than the bound and its share of the smoothing. `(edges)` tells that it
//! is within the bounds when drawn large, `(detail)` that it is so but for its share of the smoothing: drawn large it is about as near to the finer picture as
//! the PNG of its size, which is made of the same cells.
//!
//! The view `clear` is that from the front without a background: opacities are compared instead of colours, and the bounds hold when
//! drawn large.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use super::same::build;

/// Most that pictures may differ: the mean of a channel, and parts in percent.
const MEAN: f64 = 4.0;
const WRONG: f64 = 0.5;
const SEAMS: f64 = 0.5;
/// How much more they may differ for each unit by which the PNG differs from a finer one.
const ALLOWED: f64 = 1.5;
/// Times of a model, in parts of its `frames`.
const TIMES: [f64; 3] = [0.35, 0.7, 1.0];
/// How much larger the finer PNG is.
const FINER: u32 = 4;
/// A channel is wrong if it differs by more.
const FAR: i32 = 60;

/// Runs the task. False if a picture is beyond the bounds.
pub fn run(arguments: &[String]) -> Result<bool, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().map_err(|e| e.to_string())?;
    let mut program = None;
    let mut models: Vec<PathBuf> = Vec::new();
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--program" => program = Some(PathBuf::from(words.next().ok_or("--program needs a path")?)),
            model => models.push(PathBuf::from(model)),
        }
    }
    if Command::new("rsvg-convert").arg("--version").output().is_err() {
        return Err(
            "error: rsvg-convert is not installed, which draws the SVG; it is in Debian's librsvg2-bin"
                .to_owned(),
        );
    }
    if models.is_empty() {
        models = all_models(&root)?;
    }
    let program = program.map_or_else(|| build(&root, &root.join("target")), Ok)?;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let bench = Bench { program, folder: folder.path().to_owned() };
    println!(
        "                                                         at its size            drawn large            smoothing\n\
         model                   time view      kB  png s  svg s   mean  wrong  seams     mean  wrong  seams     mean  wrong  seams"
    );
    let mut beyond = 0;
    for model in &models {
        for time in times(model)? {
            for view in [View::Front, View::Perspective, View::Clear] {
                let found = bench.compare(model, time, view)?;
                println!("{}", found.line(model, time, view));
                beyond += usize::from(found.is_beyond(view));
            }
        }
    }
    println!(
        "{beyond} beyond the bounds: mean {MEAN}, wrong {WRONG} %, seams {SEAMS} %, each with {ALLOWED} times what a finer PNG differs by"
    );
    Ok(beyond == 0)
}

/// The models that the repository shows.
fn all_models(root: &Path) -> Result<Vec<PathBuf>, String> {
    let mut models = Vec::new();
    for folder in ["models", "models/abop"] {
        let entries = fs::read_dir(root.join(folder)).map_err(|e| format!("{folder}: {e}"))?;
        let files = entries.flatten().map(|entry| entry.path());
        models.extend(files.filter(|path| path.extension().is_some_and(|extension| extension == "dls")));
    }
    models.sort();
    Ok(models)
}

/// Times within the range that the model declares, on its grid.
fn times(model: &Path) -> Result<Vec<f64>, String> {
    let text = fs::read_to_string(model).map_err(|e| format!("{}: {e}", model.display()))?;
    let range = || -> Option<Vec<f64>> {
        let words: Vec<&str> =
            text.lines().find_map(|line| line.strip_prefix("frames "))?.split_whitespace().collect();
        let number = |i: usize| words.get(i)?.parse::<f64>().ok();
        let (from, to, step) = (number(0)?, number(2)?, number(4)?);
        let on_grid = |part: f64| from + ((to - from) * part / step).round() * step;
        Some(TIMES.map(on_grid).to_vec())
    };
    range().ok_or_else(|| format!("{}: no line `frames A .. B step S`", model.display()))
}

/// How a model is looked at.
#[derive(Clone, Copy, PartialEq)]
enum View {
    Front,
    Perspective,
    /// From the front, without a background.
    Clear,
}

impl View {
    fn name(self) -> &'static str {
        match self {
            View::Front => "front",
            View::Perspective => "persp",
            View::Clear => "clear",
        }
    }

    fn arguments(self) -> &'static [&'static str] {
        match self {
            View::Front => &[],
            View::Perspective => &["--perspective", "40"],
            View::Clear => &["--background", "none"],
        }
    }
}

/// Where pictures are drawn.
struct Bench {
    program: PathBuf,
    folder: PathBuf,
}

/// The differences of two pictures: mean of a channel, parts in percent.
#[derive(Clone, Copy, Debug, Default)]
struct Difference {
    mean: f64,
    wrong: f64,
    seams: f64,
}

impl Difference {
    /// Whether it is more than the bounds and the share of a difference that two ways to smooth edges make.
    fn is_beyond(&self, floor: &Difference) -> bool {
        self.mean > MEAN + ALLOWED * floor.mean
            || self.wrong > WRONG + ALLOWED * floor.wrong
            || self.seams > SEAMS + ALLOWED * floor.seams
    }
}

/// What was found of one frame.
struct Found {
    bytes: u64,
    /// Of the PNG and the SVG.
    seconds: [f64; 2],
    difference: Difference,
    /// Of the same SVG and of a PNG, both drawn larger and reduced.
    large: Difference,
    /// Between the PNG and a finer one.
    floor: Difference,
}

impl Found {
    /// Whether it differs by more than the bounds. Opacities count when drawn large only: at their size they are what edges are.
    fn is_beyond(&self, view: View) -> bool {
        match view {
            View::Clear => self.large.is_beyond(&Difference::default()),
            View::Front | View::Perspective => self.difference.is_beyond(&self.floor),
        }
    }

    fn line(&self, model: &Path, time: f64, view: View) -> String {
        let name = model.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let [png, svg] = self.seconds;
        let parts = [self.difference, self.large, self.floor]
            .map(|d| format!("{:>6.2} {:>5.2}% {:>5.2}%", d.mean, d.wrong, d.seams));
        format!(
            "{name:22} {time:>6.5} {} {:>6} {png:>6.2} {svg:>6.2} {}{}",
            view.name(),
            self.bytes.div_ceil(1000),
            parts.join("   "),
            match [Difference::default(), self.floor].map(|floor| self.large.is_beyond(&floor)) {
                _ if !self.is_beyond(view) => "",
                [false, _] => "  BEYOND (edges)",
                [true, false] => "  BEYOND (detail)",
                [true, true] => "  BEYOND",
            }
        )
    }
}

impl Bench {
    /// Draws a frame in both formats, and compares.
    fn compare(&self, model: &Path, time: f64, view: View) -> Result<Found, String> {
        let (png, png_seconds) = self.draw(model, time, view, "png", None)?;
        let (svg, svg_seconds) = self.draw(model, time, view, "svg", None)?;
        let exact = Pixels::read(&png, view)?;
        let size = [exact.width, exact.height].map(|side| side as u32 * FINER);
        let (finer, _) = self.draw(model, time, view, "png", Some(size))?;
        let finer = Pixels::read(&finer, view)?.reduced(FINER as usize);
        let large = self.drawn(&svg, view, FINER)?.reduced(FINER as usize);
        Ok(Found {
            bytes: fs::metadata(&svg).map_err(|e| e.to_string())?.len(),
            seconds: [png_seconds, svg_seconds],
            difference: exact.difference(&self.drawn(&svg, view, 1)?)?,
            large: finer.difference(&large)?,
            floor: exact.difference(&finer)?,
        })
    }

    /// An SVG as librsvg draws it, so many times as large.
    fn drawn(&self, svg: &Path, view: View, zoom: u32) -> Result<Pixels, String> {
        let drawn = self.folder.join("drawn.png");
        let mut command = Command::new("rsvg-convert");
        command.arg("--zoom").arg(zoom.to_string()).arg(svg).arg("-o").arg(&drawn);
        if !command.status().is_ok_and(|status| status.success()) {
            return Err(format!("error: rsvg-convert cannot draw {}", svg.display()));
        }
        Pixels::read(&drawn, view)
    }

    /// Draws a frame; its file, and the seconds that it took.
    fn draw(
        &self,
        model: &Path,
        time: f64,
        view: View,
        format: &str,
        size: Option<[u32; 2]>,
    ) -> Result<(PathBuf, f64), String> {
        let out = self.folder.join(format!("{format}{}", if size.is_some() { "-finer" } else { "" }));
        let mut command = Command::new(&self.program);
        command
            .args(["render", "--quiet", "--format", format, "--at", &time.to_string(), "-o"])
            .arg(&out)
            .arg(model)
            .args(view.arguments());
        if let Some([width, height]) = size {
            command.args(["--size", &format!("{width}x{height}")]);
        }
        let begun = Instant::now();
        let output = command.output().map_err(|e| format!("{}: {e}", self.program.display()))?;
        let seconds = begun.elapsed().as_secs_f64();
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned());
        }
        Ok((out.join(format!("frame-0000.{format}")), seconds))
    }
}

/// A picture without transparency, or the opacities of one that has no background as shades of grey.
struct Pixels {
    width: usize,
    height: usize,
    colors: Vec<[i32; 3]>,
}

impl Pixels {
    fn read(path: &Path, view: View) -> Result<Pixels, String> {
        let fault = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
        let file = File::open(path).map_err(|e| fault(&e))?;
        let mut reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(|e| fault(&e))?;
        let mut data = vec![0; reader.output_buffer_size().ok_or_else(|| fault(&"too large"))?];
        let frame = reader.next_frame(&mut data).map_err(|e| fault(&e))?;
        let channels = frame.color_type.samples();
        if channels < if view == View::Clear { 4 } else { 3 } {
            return Err(fault(&"a picture without colours, or without opacities"));
        }
        let colors = data[..frame.buffer_size()].chunks_exact(channels);
        let of = if view == View::Clear { [3; 3] } else { [0, 1, 2] };
        let colors: Vec<[i32; 3]> = colors.map(|pixel| of.map(|k| i32::from(pixel[k]))).collect();
        if view == View::Clear && !colors.contains(&[0; 3]) {
            return Err(fault(&"without a background some of the picture should be clear"));
        }
        Ok(Pixels { width: frame.width as usize, height: frame.height as usize, colors })
    }

    /// A picture of which each pixel is the mean of a square of pixels.
    fn reduced(&self, by: usize) -> Pixels {
        let (width, height) = (self.width / by, self.height / by);
        let area = (by * by) as i32;
        let mean = |i: usize| {
            let (left, top) = (i % width * by, i / width * by);
            let cells = (0..by * by).map(|k| self.colors[(top + k / by) * self.width + left + k % by]);
            let sum = cells.fold([0; 3], |sum, color| [0, 1, 2].map(|k| sum[k] + color[k]));
            sum.map(|channel: i32| (channel + area / 2) / area)
        };
        Pixels { width, height, colors: (0..width * height).map(mean).collect() }
    }

    /// How another picture differs from this one, within all that is not background here.
    fn difference(&self, other: &Pixels) -> Result<Difference, String> {
        if [self.width, self.height] != [other.width, other.height] {
            return Err(format!(
                "error: sizes differ: {} x {} and {} x {}",
                self.width, self.height, other.width, other.height
            ));
        }
        let Some(&ground) = self.colors.first() else { return Ok(Difference::default()) };
        let is_plant = |i: usize| self.colors.get(i).is_some_and(|color| *color != ground);
        let (mut plant, mut inner) = (0_usize, 0_usize);
        let (mut sum, mut wrong, mut seams) = (0_i64, 0_usize, 0_usize);
        for (i, (a, b)) in self.colors.iter().zip(&other.colors).enumerate().filter(|(i, _)| is_plant(*i)) {
            plant += 1;
            let off = [0, 1, 2].map(|k| (a[k] - b[k]).abs());
            sum += off.iter().map(|off| i64::from(*off)).sum::<i64>();
            wrong += usize::from(off.iter().any(|off| *off > FAR));
            let around = [i.wrapping_sub(1), i + 1, i.wrapping_sub(self.width), i + self.width];
            if around.into_iter().all(is_plant) {
                inner += 1;
                let to_ground = [0, 1, 2].map(|k| ground[k] - a[k]);
                let far: i32 = to_ground.iter().map(|x| x * x).sum();
                let moved: i32 = (0..3).map(|k| (b[k] - a[k]) * to_ground[k]).sum();
                // Where plant and ground are nearly of one colour, nothing can be told.
                seams += usize::from(far > 900 && 10 * moved > far);
            }
        }
        let part = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
        Ok(Difference {
            mean: sum as f64 / (3 * plant.max(1)) as f64,
            wrong: part(wrong, plant),
            seams: part(seams, inner),
        })
    }
}
