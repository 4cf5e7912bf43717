//! Layouts of several frames on one sheet: over one another, one below the other, or in rows.
//!
//! All frames have one scale and one camera; a sheet only moves their pictures.

use super::lighting::floor_color;
use super::{Fit, Page, Picture, Size, Survey};
use dlsys_geometry::scene::{Color, Point};

/// How the frames of an animation are put on pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// A file for each frame.
    Frames,
    /// All in one place, the older the fainter (paper, figure 6).
    Overlay,
    /// Each below the one before, aligned on the plant's origin (paper, figure 7).
    Stack,
    /// In rows, aligned on the ground, each with its time (paper, figures 9, 10, 13 and 15).
    Grid,
}

impl Layout {
    /// All layouts, with their names, which are also those of their files.
    pub const NAMED: [(&'static str, Layout); 4] = [
        ("frames", Layout::Frames),
        ("overlay", Layout::Overlay),
        ("stack", Layout::Stack),
        ("grid", Layout::Grid),
    ];

    /// The name on the command line, and of the files.
    pub fn name(self) -> &'static str {
        Layout::NAMED.iter().find(|(_, layout)| *layout == self).map_or("", |(name, _)| name)
    }
}

/// Distances in a layout.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spacing {
    /// Frames in a row of a grid; `None`: all in one row.
    pub columns: Option<usize>,
    /// From one line of a stack to the next, in scene units; `None`: the height of the highest.
    pub row_height: Option<f64>,
    /// Of the whole sheet: captions of a grid are large enough to be read.
    pub size: Size,
}

/// The place of a frame on a sheet. Coordinates are those that the camera sees, to the right and up.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cell {
    /// Displacement of the frame.
    pub(super) offset: [f64; 2],
    /// Left, bottom, right and top of what is drawn there; `None` if nothing is.
    pub(super) frame: Option<[f64; 4]>,
    pub(super) opacity: f64,
    pub(super) caption: Option<Caption>,
}

/// A line of text: the middle of its base line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Caption {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) text: String,
}

/// Frames in their places.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// How frames are arranged.
    pub layout: Layout,
    /// The area of the whole sheet.
    pub picture: Picture,
    pub(super) cells: Vec<Cell>,
    /// Size of the captions' letters, in scene units.
    pub(super) letters: f64,
    /// A stack of frames that are hardly more than lines.
    pub(super) lines: bool,
    /// The floor that all frames stand on, and its colour if that is not the one of the background.
    pub(super) floor: Option<Option<Color>>,
    /// Whether frames are pieces of one ground of soil.
    pub(super) has_soil: bool,
    /// Whether captions were left out, because the sheet has no room for letters that can be read.
    pub lacks_captions: bool,
}

/// Opacity of the oldest frame of an overlay. The last one has 1.
const FAINTEST: f64 = 0.15;
/// Frames this many times as wide as high are lines.
const LINE_SHAPE: f64 = 20.0;
/// Space between the frames of a grid, in parts of the widest.
const GAP: f64 = 0.08;
/// Size of letters, in parts of the larger side of a grid, and what a line takes up, in sizes of letters.
const LETTERS: f64 = 0.02;
const LINE: f64 = 1.6;
/// Width of a letter, in sizes of letters, and the space between captions.
const LETTER_WIDTH: f64 = 0.55;
/// Letters that can be read, in pixels, and how much larger a sheet may become by them.
const READABLE: f64 = 9.0;
const LARGER: f64 = 1.6;
/// How far a piece of soil reaches beyond what is drawn on it in any frame, in parts of the larger side of that.
const SOIL_RIM: f64 = 0.15;

impl Sheet {
    /// Frames on a sheet, each as a survey of it; `captions` are the texts below them in a grid, none if empty.
    pub fn new(layout: Layout, fit: &Fit, frames: &[Survey], captions: &[String], spacing: Spacing) -> Sheet {
        let seen: Vec<Option<[f64; 4]>> = frames.iter().map(|survey| fit.frame_of(survey)).collect();
        match layout {
            Layout::Frames | Layout::Overlay => overlay(layout, fit, &seen),
            Layout::Stack => stack(&seen, spacing.row_height),
            Layout::Grid => {
                let around = frames.first().map(Survey::first_surroundings).unwrap_or_default();
                let floor = around.floor.filter(|_| !fit.light.is_flat()).map(|_| floor_color(&around));
                let seen = match floor {
                    Some(_) => frames.iter().map(|survey| fit.shaded_frame_of(survey)).collect(),
                    None => seen,
                };
                // Soil has traces of what is not there any more, so all frames show the same piece of it.
                let has_soil = frames.iter().any(|survey| survey.has_soil);
                let soil = union(seen.iter().flatten().copied()).filter(|_| has_soil).map(
                    |[left, bottom, right, top]| {
                        let rim = SOIL_RIM * (right - left).max(top - bottom);
                        [left - rim, bottom - rim, right + rim, top + rim]
                    },
                );
                let seen = if soil.is_some() { vec![soil; seen.len()] } else { seen };
                let ground = fit.camera.project(Point::origin()).y;
                Sheet { floor, has_soil, ..readable(&seen, ground, captions, spacing) }
            }
        }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// True if there are no frames.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }
}

fn overlay(layout: Layout, fit: &Fit, seen: &[Option<[f64; 4]>]) -> Sheet {
    let last = seen.len().saturating_sub(1).max(1) as f64;
    let cells = seen.iter().enumerate().map(|(i, &frame)| {
        // The last one keeps its full strength, even if it is alone.
        let age = (seen.len() - 1 - i) as f64 / last;
        Cell { offset: [0.0; 2], frame, opacity: 1.0 - (1.0 - FAINTEST) * age, caption: None }
    });
    Sheet {
        layout,
        picture: fit.picture,
        cells: cells.collect(),
        letters: 0.0,
        lines: false,
        floor: None,
        has_soil: false,
        lacks_captions: false,
    }
}

fn stack(seen: &[Option<[f64; 4]>], row_height: Option<f64>) -> Sheet {
    let drawn = || seen.iter().flatten();
    let widest = drawn().map(|[left, _, right, _]| right - left).fold(0.0, f64::max);
    let highest = drawn().map(|[_, bottom, _, top]| top - bottom).fold(0.0, f64::max);
    let lines = LINE_SHAPE * highest < widest;
    // Lines touch, so that bands of colour run down through them.
    let space = if lines { 1.0 } else { 1.0 + GAP };
    let pitch = row_height.unwrap_or(if highest > 0.0 { space * highest } else { 0.01 * widest });
    let cells: Vec<Cell> = seen
        .iter()
        .enumerate()
        .map(|(i, &frame)| {
            let down = -(i as f64) * pitch;
            Cell {
                offset: [0.0, down],
                frame: frame.map(|f| moved(f, [0.0, down])),
                opacity: 1.0,
                caption: None,
            }
        })
        .collect();
    let all = union(cells.iter().filter_map(|cell| cell.frame));
    Sheet {
        layout: Layout::Stack,
        picture: Picture::around(all),
        cells,
        letters: 0.0,
        lines,
        floor: None,
        has_soil: false,
        lacks_captions: false,
    }
}

/// A grid whose captions can be read at its size: whole, or at least what stands behind the last space of each, the number; or none.
fn readable(seen: &[Option<[f64; 4]>], ground: f64, captions: &[String], spacing: Spacing) -> Sheet {
    /// Larger letters make a larger sheet, on which they have to be larger again.
    const TRIALS: usize = 20;
    let columns = spacing.columns.unwrap_or(seen.len()).max(1);
    let bare = grid(seen, ground, &[], columns, 0.0);
    let pixel = |sheet: &Sheet| {
        Page::new(sheet.picture, spacing.size, None).map_or(0.0, |page| 1.0 / page.pixels_per_unit())
    };
    let numbers = || captions.iter().map(|text| text.rsplit(' ').next().unwrap_or(text).to_owned()).collect();
    for captions in [captions.to_vec(), numbers()] {
        let mut sheet = grid(seen, ground, &captions, columns, 0.0);
        for _ in 0..TRIALS {
            if captions.is_empty() || sheet.letters >= 0.99 * READABLE * pixel(&sheet) {
                return sheet;
            }
            sheet = grid(seen, ground, &captions, columns, READABLE * pixel(&sheet));
            if pixel(&sheet) > LARGER * pixel(&bare) {
                break;
            }
        }
    }
    Sheet { lacks_captions: true, ..bare }
}

/// Letters have the usual size, but at least this one, in scene units.
fn grid(seen: &[Option<[f64; 4]>], ground: f64, captions: &[String], columns: usize, least: f64) -> Sheet {
    let frames: Vec<[f64; 4]> = seen.iter().map(|f| f.unwrap_or([0.0, ground, 0.0, ground])).collect();
    let columns = columns.min(frames.len().max(1));
    let width_of = |i: usize| frames[i][2] - frames[i][0];
    let rows: Vec<RowExtent> = frames.chunks(columns).map(|row| RowExtent::new(row, ground)).collect();
    let mut widths: Vec<f64> =
        (0..columns).map(|c| (c..frames.len()).step_by(columns).map(width_of).fold(0.0, f64::max)).collect();
    let gap = GAP * widths.iter().copied().fold(0.0, f64::max);
    let across = widths.iter().sum::<f64>() + gap * (columns - 1) as f64;
    let down: f64 = rows.iter().map(|row| row.above + row.below).sum();
    let letters = if captions.is_empty() { 0.0 } else { least.max(LETTERS * across.max(down)) };
    for (i, caption) in captions.iter().enumerate() {
        let width = &mut widths[i % columns];
        *width = width.max(letters * LETTER_WIDTH * (caption.chars().count() + 1) as f64);
    }
    let mut cells = Vec::with_capacity(frames.len());
    let mut line = 0.0;
    let mut extents = Vec::new();
    for (r, row) in rows.iter().enumerate() {
        line -= row.above;
        let mut left = 0.0;
        for (c, width) in widths.iter().enumerate() {
            let i = r * columns + c;
            let Some(frame) = frames.get(i) else { break };
            let middle = left + width / 2.0;
            let offset = [middle - (frame[0] + frame[2]) / 2.0, line - ground];
            let y = line - row.below - LINE * letters;
            let caption = captions.get(i).map(|text| Caption { x: middle, y, text: text.clone() });
            extents.push([left, y, left + width, line + row.above]);
            cells.push(Cell { offset, frame: seen[i].map(|f| moved(f, offset)), opacity: 1.0, caption });
            left += width + gap;
        }
        line -= row.below + (LINE + 0.6) * letters + gap;
    }
    Sheet {
        layout: Layout::Grid,
        picture: Picture::around(union(extents.into_iter())),
        cells,
        letters,
        lines: false,
        floor: None,
        has_soil: false,
        lacks_captions: false,
    }
}

/// How far the frames of a row reach above and below the ground.
struct RowExtent {
    above: f64,
    below: f64,
}

impl RowExtent {
    fn new(frames: &[[f64; 4]], ground: f64) -> RowExtent {
        let above = frames.iter().map(|frame| frame[3] - ground).fold(0.0, f64::max);
        let below = frames.iter().map(|frame| ground - frame[1]).fold(0.0, f64::max);
        RowExtent { above, below }
    }
}

fn moved([left, bottom, right, top]: [f64; 4], [x, y]: [f64; 2]) -> [f64; 4] {
    [left + x, bottom + y, right + x, top + y]
}

fn union(frames: impl Iterator<Item = [f64; 4]>) -> Option<[f64; 4]> {
    frames.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: Option<[f64; 4]> = Some([-1.0, 0.0, 1.0, 2.0]);
    const LARGE: Option<[f64; 4]> = Some([-2.0, -1.0, 4.0, 6.0]);

    #[test]
    fn a_stack_goes_down_by_the_highest() {
        let sheet = stack(&[SMALL, None, LARGE], None);
        let offsets: Vec<[f64; 2]> = sheet.cells.iter().map(|cell| cell.offset).collect();
        assert_eq!(offsets, [[0.0, 0.0], [0.0, -7.0 * 1.08], [0.0, -14.0 * 1.08]]);
        assert_eq!(sheet.cells[2].frame.map(|f| [f[0], f[2]]), Some([-2.0, 4.0]), "aligned on the origin");
        assert_eq!(sheet.cells[1].frame, None);
        let line = Some([0.0, -0.5, 100.0, 0.5]);
        assert_eq!(stack(&[line, line], None).cells[1].offset, [0.0, -1.0], "lines touch");
        assert_eq!(stack(&[SMALL, SMALL], Some(0.5)).cells[1].offset, [0.0, -0.5]);
        let [_, bottom, _, height] = sheet.picture.area;
        assert!(bottom < -15.0 && bottom + height > 2.0);
    }

    #[test]
    fn a_grid_stands_on_the_ground() {
        let captions: Vec<String> = ["a", "b", "c"].map(str::to_owned).into();
        let sheet = grid(&[SMALL, LARGE, SMALL], 0.0, &captions, 2, 0.0);
        let [a, b, c] = &sheet.cells[..] else { panic!("three") };
        assert_eq!(a.offset[1], b.offset[1], "one ground");
        assert!(c.offset[1] < a.offset[1] - 3.0, "the next row is below");
        let (left, right) = (a.frame.expect("drawn"), b.frame.expect("drawn"));
        assert!(left[2] < right[0], "side by side");
        let caption = b.caption.as_ref().expect("a caption");
        assert!(caption.y < right[1] && caption.y > c.frame.expect("drawn")[3], "below its own frame");
        assert!((caption.x - (right[0] + right[2]) / 2.0).abs() < 1e-12);
        let one_row = grid(&[SMALL, None, LARGE], 0.0, &[], 3, 0.0);
        assert!(one_row.cells.iter().all(|cell| cell.offset[1] == one_row.cells[0].offset[1]));
        assert_eq!(one_row.letters, 0.0);
    }

    #[test]
    fn captions_can_be_read_or_are_left_out() {
        let captions: Vec<String> = (0..6).map(|i| format!("t = {i}.25")).collect();
        let seen = [SMALL; 6];
        let of = |pixels: u32| {
            readable(&seen, 0.0, &captions, Spacing { size: Size::Width(pixels), ..Spacing::default() })
        };
        let pixels = |sheet: &Sheet, width: u32| {
            let page = Page::new(sheet.picture, Size::Width(width), None).expect("a page");
            sheet.letters * page.pixels_per_unit()
        };
        let large = of(1000);
        assert_eq!(large.letters, grid(&seen, 0.0, &captions, 6, 0.0).letters, "as usual");
        let small = of(300);
        assert!((8.9..9.5).contains(&pixels(&small, 300)), "{}", pixels(&small, 300));
        assert!(small.cells.iter().all(|cell| cell.caption.is_some()) && !small.lacks_captions);
        let words = |sheet: &Sheet| sheet.cells[1].caption.as_ref().map(|caption| caption.text.clone());
        assert_eq!(
            [words(&large), words(&small)],
            ["t = 1.25", "t = 1.25"].map(|text| Some(text.to_owned()))
        );
        assert_eq!(words(&of(200)).as_deref(), Some("1.25"), "not more than there is room for");
        let tiny = of(80);
        assert!(tiny.lacks_captions && tiny.cells.iter().all(|cell| cell.caption.is_none()));
        assert!(
            !readable(&seen, 0.0, &[], Spacing { size: Size::Width(100), ..Spacing::default() })
                .lacks_captions
        );
    }

    #[test]
    fn nothing_is_a_sheet_too() {
        for sheet in [
            stack(&[], None),
            stack(&[None], None),
            grid(&[], 0.0, &[], 1, 0.0),
            grid(&[None], 0.0, &[], 1, 0.0),
        ] {
            assert!(sheet.picture.area[2] > 0.0 && sheet.picture.area[3] > 0.0);
        }
    }
}
