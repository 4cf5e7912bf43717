//! Ground that gives way: soils, the ground that is made of one, and what is poured on it.

use std::sync::Arc;

use crate::{Rgb, Texture};
use dlsys_diagnostic::Span;
use dlsys_expr::Program;

/// `soil NAME = sand, repose 30, …`: a granular material. What is not given is that of its base.
#[derive(Clone, Debug)]
pub struct Soil {
    /// The name, which `ground` and `pour` give.
    pub name: Arc<str>,
    /// The material that it begins from.
    pub base: SoilBase,
    /// Angle of repose in degrees.
    pub repose: Option<f64>,
    /// Angle of repose of what a body has pressed, in degrees.
    pub inner: Option<f64>,
    /// The part of what is pressed that goes to the rim, from 0 to 1; the rest is compressed (α of Sumner et al. 1999).
    pub push: Option<f64>,
    /// Relative deviations of the slope at rest.
    pub rough: Option<f64>,
    /// The rate at which steep slopes slip (λ), in m²/s.
    pub flow: Option<f64>,
    /// Cohesion in kPa.
    pub cohesion: Option<f64>,
    /// Weight in kN/m³.
    pub weight: Option<f64>,
    /// The pressure that it holds below a body, in weights of the soil above.
    pub bearing: Option<f64>,
    /// The part by which loosened soil expands.
    pub swell: Option<f64>,
    /// What an area of a body takes up where it touches the soil, in m.
    pub stick: Option<f64>,
    /// The time constant with which bodies shed what sticks to them, in s.
    pub shed: Option<f64>,
    /// The acceleration from which on bodies shed all that is due, in m/s², and the power with which what they shed follows a smaller one.
    pub hold: Option<f64>,
    /// See `hold`.
    pub exponent: Option<f64>,
    /// The diameter of the particles that leave them, in m.
    pub grain: Option<f64>,
    /// Its colour.
    pub color: Rgb,
    /// The place of the declaration in the text.
    pub span: Span,
}

/// Materials with a name of their own: those of Sumner, O'Brien and Hodgins 1999, and soil as in the virtual sandbox of Onoue and Nishita.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SoilBase {
    /// `sand`
    #[default]
    Sand,
    /// `mud`
    Mud,
    /// `snow`
    Snow,
    /// `soil`
    Soil,
}

impl SoilBase {
    /// The colour of a soil that begins from it, unless the text gives another one.
    pub const fn color(self) -> Rgb {
        match self {
            SoilBase::Sand => 0xd9bf8c,
            SoilBase::Mud => 0x7a6248,
            SoilBase::Snow => 0xf6f9fd,
            SoilBase::Soil => 0x8a6a4a,
        }
    }
}

/// `ground SOIL cell D depth H height f(x, z) extent E`, in units of the model.
#[derive(Clone, Debug)]
pub struct Bed {
    /// The number of its soil in [`Scenery::soils`](crate::Scenery).
    pub soil: usize,
    /// The width of a column.
    pub cell: f64,
    /// The height of the soil above what does not give way; `None` if there is no end to it.
    pub depth: Option<f64>,
    /// The height of the surface at the beginning.
    pub height: Relief,
    /// It extends from -E to E in x and z.
    pub extent: f64,
    /// The picture on it, which is repeated.
    pub texture: Option<Texture>,
    /// The width of the picture.
    pub texture_size: f64,
    /// The place of the declaration in the text.
    pub span: Span,
}

impl Bed {
    /// The height of the surface at the beginning, at a place; beyond the edges that at the nearest edge.
    pub fn surface(&self, x: f64, z: f64) -> f64 {
        let inside = |at: f64| at.clamp(-self.extent, self.extent);
        self.height.at(inside(x), inside(z), self.extent)
    }

    /// The columns across a picture, if the text gives no size.
    pub const TEXTURE_CELLS: f64 = 32.0;
    /// Half the number of columns on a side, if the text gives no extent.
    pub const CELLS: f64 = 500.0;
    /// The largest number of columns on a side.
    pub const MOST_CELLS: f64 = 65_536.0;
}

/// Heights at the beginning.
#[derive(Clone, Debug)]
pub enum Relief {
    /// A function of x and z.
    Function(Program),
    /// Heights of a file.
    Grid(HeightGrid),
}

impl Relief {
    /// The height, if it is the same everywhere.
    pub fn level(&self) -> Option<f64> {
        match self {
            Relief::Function(program) if program.reads().is_empty() => Some(program.eval_one(&[0.0; 2])),
            _ => None,
        }
    }

    /// The height at a place, where the ground extends from `-extent` to `extent`.
    pub fn at(&self, x: f64, z: f64, extent: f64) -> f64 {
        match self {
            Relief::Function(program) => program.eval_one(&[x, z]),
            Relief::Grid(grid) => grid.at(x, z, extent),
        }
    }
}

/// Heights on a grid that covers the ground from edge to edge: a row for each z, from the least on, and in it a value for each x.
#[derive(Clone, Debug)]
pub struct HeightGrid {
    /// The number of values in a row, 2 or more.
    pub columns: usize,
    /// All values, row by row.
    pub values: Arc<[f64]>,
}

impl HeightGrid {
    /// The height between the four nearest values, bilinear; at the edge beyond it.
    fn at(&self, x: f64, z: f64, extent: f64) -> f64 {
        let rows = self.values.len() / self.columns;
        let place = |at: f64, count: usize| {
            let steps = (count - 1) as f64;
            let along = ((at / extent + 1.0) / 2.0 * steps).clamp(0.0, steps);
            let first = (along.floor() as usize).min(count - 2);
            (first, along - first as f64)
        };
        let ((column, u), (row, v)) = (place(x, self.columns), place(z, rows));
        let value = |row: usize, column: usize| self.values[row * self.columns + column];
        let along = |row: usize| value(row, column) * (1.0 - u) + value(row, column + 1) * u;
        along(row) * (1.0 - v) + along(row + 1) * v
    }
}

/// `pour SOIL rate R at X, Y, Z radius r`
#[derive(Clone, Debug)]
pub struct Pour {
    /// The number of its soil in [`Scenery::soils`](crate::Scenery).
    pub soil: usize,
    /// The rate, which reads `t`, in units of the model: a volume for each unit of t at a place, else a height.
    pub rate: Program,
    /// The place, which reads `t`, and the radius of the disc, in units of the model; `None` if it falls everywhere.
    pub place: Option<(Program, f64)>,
    /// The place of the declaration in the text.
    pub span: Span,
}
