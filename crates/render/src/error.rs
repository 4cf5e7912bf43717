//! The error of this crate.

use crate::{Format, Page};
use std::io;
use std::path::PathBuf;

/// Why something cannot be drawn or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The system does not let a file be read or written.
    #[error("cannot {action} {}: {source}", .path.display())]
    Io {
        /// What was tried, as a verb: `write`.
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// The answer of the system.
        source: io::Error,
    },
    /// A directory has files of others in it, so that it is not taken for that of a render.
    #[error(
        "{} holds files that are not of an earlier render, such as `{file}`; \
         choose another directory, or --force to write beside them", .directory.display()
    )]
    Foreign {
        /// The directory.
        directory: PathBuf,
        /// Name of one of the files.
        file: String,
    },
    /// A file of this name is not of an earlier render.
    #[error("{} is not of an earlier render and is not overwritten; choose another directory", .0.display())]
    Taken(PathBuf),
    /// The directory is locked by another process.
    #[error("another render is writing to {}; wait for its end, or choose another directory", .0.display())]
    Busy(PathBuf),
    /// The files of a render are larger than allowed, all together.
    #[error("the files of this render are larger than {limit} bytes")]
    TooLarge {
        /// Bytes allowed.
        limit: u64,
    },
    /// The path for a directory is that of a file.
    #[error("{} is not a directory; choose another name", .0.display())]
    NotADirectory(PathBuf),
    /// The name of a file has a separator in it, or is one that a render uses itself.
    #[error("`{0}` cannot be the name of a file of a render")]
    Name(String),
    /// There is no format of this name.
    #[error("unknown format `{0}`; known are {known}", known = Format::names())]
    UnknownFormat(String),
    /// The text of a view is neither a name nor a pair of angles.
    #[error("unknown view `{0}`; a view is front, side, top, or AZIMUTH,ELEVATION in degrees")]
    UnknownView(String),
    /// The text of an elevation is not within -90 to 90 degrees.
    #[error("elevation {0} is not between -90 and 90 degrees")]
    Elevation(String),
    /// A picture has a side of 0 pixels, or more pixels than fit into memory.
    #[error(
        "a picture of {width} x {height} pixels is too large; at most {} on a side and {} million in all",
        Page::MOST_ON_A_SIDE,
        Page::MOST_PIXELS / 1_000_000
    )]
    PageTooLarge {
        /// Pixels from left to right.
        width: u32,
        /// Pixels from top to bottom.
        height: u32,
    },
    /// A layout of frames was chosen for a format without pictures.
    #[error("an OBJ file is one mesh in space: it has no layout")]
    NoLayout,
    /// The document of a sheet is longer than 1 GiB.
    #[error(
        "the picture would be longer than 1 GiB from frame {frame} on; choose fewer frames, or PNG, which does not grow"
    )]
    SheetTooLong {
        /// The first frame that does not fit, from 0.
        frame: usize,
    },
    /// More plants of other models are seen than a picture of vectors has room for.
    #[error("{0}")]
    TooManySeen(io::Error),
    /// The camera or the sky of a frame of an animated SVG is not that of the first one.
    #[error(
        "frame {frame} has another camera or sky than the first, and an animated SVG has one of each; choose a film of pixels, such as --format webp"
    )]
    AnotherView {
        /// Its number, from 0.
        frame: usize,
    },
    /// An animated SVG has too many elements.
    #[error(
        "the animated SVG is too large from frame {frame} on; take fewer frames with --step, or a film of pixels, such as --format webp"
    )]
    AnimationTooLong {
        /// The first frame that does not fit, from 0.
        frame: usize,
    },
}
