//! `explain`: curves and tables.

use serde::Serialize;

use crate::expr::{Curve, Sort};
use crate::sim::brief;

/// A curve or a table. Field names are those of the JSON.
#[derive(Serialize)]
pub struct CurvePlan {
    pub name: String,
    /// `linear`, `monotone` or `spline`.
    pub sort: &'static str,
    pub points: usize,
    pub from: f64,
    pub to: f64,
    pub least: f64,
    pub greatest: f64,
    pub periodic: bool,
    /// Whether it is strictly monotone, so that it has an inverse.
    pub inverse: bool,
    #[serde(skip)]
    rises: bool,
}

impl CurvePlan {
    pub fn new(curve: &Curve) -> CurvePlan {
        let ((from, to), (least, greatest)) = (curve.domain(), curve.range());
        CurvePlan {
            name: curve.name.clone(),
            sort: match curve.sort {
                Sort::Linear => "linear",
                Sort::Monotone => "monotone",
                Sort::Spline => "spline",
            },
            points: curve.points,
            from,
            to,
            least,
            greatest,
            periodic: curve.periodic,
            inverse: curve.direction().is_some(),
            rises: curve.direction() == Some(1.0),
        }
    }

    /// The name, the sort, and the rest in words.
    pub fn row(&self) -> [String; 3] {
        let sort = match self.sort {
            "linear" => "straight pieces",
            "monotone" => "monotone cubic",
            _ => "cubic B-spline",
        };
        let number = |x: f64| brief(x, 6);
        let way = match (self.inverse, self.rises) {
            (true, true) => ", rises: has an inverse",
            (true, false) => ", falls: has an inverse",
            _ => "",
        };
        let beyond = if self.periodic { ", again and again" } else { "" };
        [
            self.name.clone(),
            sort.to_owned(),
            format!(
                "{} points, from {} to {}{beyond}; values from {} to {}{way}",
                self.points,
                number(self.from),
                number(self.to),
                number(self.least),
                number(self.greatest),
            ),
        ]
    }
}
