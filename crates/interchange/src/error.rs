//! The error of this crate.

use dlsys_session::DrawError;

/// Why there is no file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The run failed.
    #[error(transparent)]
    Run(#[from] dlsys_sim::Error),
    /// A scene cannot be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// Plants of other models are followed at a single time only, and written as GLB.
    #[error("the scene has plants of other models, which stand in GLB files of a single time only")]
    Plants,
    /// More modules draw than a file should have nodes.
    #[error("more than {limit} modules draw something by t = {time}")]
    TooMany {
        /// The time at which they are too many, in units of the model.
        time: f64,
        /// The most that there may be.
        limit: usize,
    },
    /// The motion needs more numbers than fit into memory.
    #[error("by t = {time} there are more than {limit} numbers to keep")]
    TooLarge {
        /// The time at which they are too many, in units of the model.
        time: f64,
        /// The most that there may be.
        limit: usize,
    },
    /// A module goes through so many shapes that are sums of no few ones that their weights are more numbers than fit into memory.
    #[error("module `{kind}` goes through {shapes} shapes, none of which is a sum of few others")]
    TooManyShapes {
        /// The kind of the module.
        kind: String,
        /// The number of its shapes.
        shapes: usize,
    },
    /// The file would be larger than a GLB file can be.
    #[error("the file would have {bytes} bytes, and a GLB file has at most 4 GiB")]
    File {
        /// Its bytes.
        bytes: u64,
    },
    /// The file is larger than it may be.
    #[error("the file is larger than {limit} bytes")]
    Bytes {
        /// The most that it may have.
        limit: u64,
    },
    /// A file cannot be written.
    #[error("cannot write the file: {0}")]
    Io(#[from] std::io::Error),
    /// Times of the file are 32 bit floats, which this long an animation has too few of.
    #[error(
        "the animation would last {seconds} s, and instants later than {limit} s are further apart than a millisecond in the file"
    )]
    TooLong {
        /// Its length in seconds.
        seconds: f64,
        /// The longest that it may be.
        limit: f64,
    },
    /// Places in the file are 32 bit floats, beyond which the drawing reaches.
    #[error("the drawing is {metres:e} m large, and places in the file go up to {limit:e} m")]
    TooWide {
        /// Its size in metres.
        metres: f64,
        /// The largest that it may be.
        limit: f64,
    },
    /// Something stands so far from the origin that its places in the file, of 32 bits, are further off than the accuracy allows.
    #[error(
        "something is drawn {metres:.3e} m from the origin, where places in the file are off by {off:.1e} m: more than the accuracy allows"
    )]
    TooFar {
        /// The distance in metres.
        metres: f64,
        /// Half of the distance of two numbers there.
        off: f64,
    },
    /// The same of the ground.
    #[error("the ground is at a height of {metres:e} m, and places in the file go up to {limit:e} m")]
    GroundTooFar {
        /// The height in metres.
        metres: f64,
        /// The largest that it may be.
        limit: f64,
    },
    /// The caller stopped the work.
    #[error("stopped before t = {time}")]
    Stopped {
        /// The time reached, in units of the model.
        time: f64,
    },
}
