//! Surfaces that are given: what a ground looks like before anything touches it.

use std::fmt;
use std::sync::Arc;

use crate::Error;
use crate::tile::{HIGHEST, QUANTA};

/// A height or thickness over the plane, in m.
#[derive(Clone)]
pub enum Relief {
    /// The same everywhere.
    Level(f64),
    /// A function of x and z, in m. It is a pure function; it is evaluated at columns only.
    Function(Arc<dyn Fn(f64, f64) -> f64 + Send + Sync>),
}

impl Relief {
    /// A function of x and z, in m.
    pub fn function(f: impl Fn(f64, f64) -> f64 + Send + Sync + 'static) -> Relief {
        Relief::Function(Arc::new(f))
    }

    fn at(&self, x: f64, z: f64) -> f64 {
        match self {
            Relief::Level(height) => *height,
            Relief::Function(f) => f(x, z),
        }
    }

    pub(crate) fn is_level(&self) -> bool {
        matches!(self, Relief::Level(_))
    }

    /// The value at a column, in quanta.
    pub(crate) fn quanta(&self, name: &'static str, cell: f64, i: i32, k: i32) -> Result<i64, Error> {
        let (x, z) = (f64::from(i) * cell, f64::from(k) * cell);
        let value = self.at(x, z);
        quanta(value, cell).ok_or(Error::Height {
            name,
            value,
            at: [x, z],
            most: HIGHEST as f64 / QUANTA * cell,
        })
    }
}

/// A height in quanta; none if it is not a number or too large.
pub(crate) fn quanta(height: f64, cell: f64) -> Option<i64> {
    let quanta = (height / cell * QUANTA).round();
    (quanta.abs() <= HIGHEST as f64).then_some(quanta as i64)
}

impl fmt::Debug for Relief {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Relief::Level(height) => f.debug_tuple("Level").field(height).finish(),
            Relief::Function(_) => f.write_str("Function"),
        }
    }
}
