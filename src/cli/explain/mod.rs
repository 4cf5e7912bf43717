//! `dlsys explain`: how each equation and each condition of a model is solved, and why, comparable to the query plan of a
//! database.
//!
//! ```text
//! Model (classes found by model::analyse) ──plan──▶ Explanation ──▶ text
//!                                            words             JSON
//! ```
//!
//! # JSON
//!
//! One object. `model`, `title`;
//! - `kinds`: a list of `{name, arity, work, rules, drawn_only}`; `work` is `no rules`, `at rest`, `formulas`, `alone`
//!   or `coupled`; `rules` are positions in the list `rules`; `drawn_only` the parameters that only drawing reads.
//! - `rules`: `{head, line, kinds, solves, produces, conditions}`;
//!   - a solve is `{line, condition, parameters}`, a parameter `{name, class, law, why, reads}`; `class` is `constant`,
//!     `closed form`, `local`, `coupled and linear` or `coupled`, or, for a parameter with a value or an equation instead of a rate,
//!     `explicit formula`, `explicit` or `implicit`; `law` is the form of the solution, or null;
//!   - a produce is `{line, condition}`;
//!   - a condition is `{boundary, line, decides, found}`: `decides` names the clauses (`{clause, line}`), `found`
//!     how its instant is found under each `solve`: `{line, class, why}`, line null if the rule has none; `class` is
//!     `nothing to find`, `never met`, `closed-form time`, `root on a closed form` or `root on dense output`.
//! - `curves`: a list of `{name, sort, points, from, to, least, greatest, periodic, inverse}`; `sort` is `linear`,
//!   `monotone` or `spline`; `from` and `to` are arguments, `least` and `greatest` values; `inverse` tells whether it is strictly
//!   monotone;
//! - `scene`, for what stands around a plant: a list of `{part, class, why}`; `class` is `constant`, `closed form`, `in steps`,
//!   `nothing to do`, `evaluated at frames`, `one simulation` or `one simulation a seed`;
//! - `bending`, for a model with tissues: `{t, ticks, wind, axes, unbent}`; `t` is the time at which axes are listed, `ticks` the number of steps of
//!   the clock up to it, `wind` the mean speed in m/s or null; an axis is `{kinds, tissue, depth, count, measured, segments, length, width, mass,
//!   carried, frequency, damping, cauchy, greenhill}`: `count` axes of the same kinds, least and greatest values in SI, of `measured` of
//!   them for the last four; null where there is none; `unbent` is true if rules read `strain`: the axes are those of a growth without it;
//! - `bending_of_plants`, for a model with plants of other models that have tissues: a list of such objects with `plant`, its name; `t` is its
//!   age, `ticks` those of its age, `wind` that of the scene at the last frame;
//! - `falling`, for models that let go (`@D`), plants included: a list of `{plant, t, parts}`; a part is `{kind, shape, count, mass, size, speed, ratio}`: `count`
//!   parts that modules of this kind let go, `plate` or `lump`, least and greatest values in SI; `ratio` is I* of plates;
//! - `summary`: names of kinds by `work`, and `closed_form`: true if nothing is ever integrated numerically.

mod bending;
mod curves;
mod falling;
mod gas;
mod given;
mod ground;
mod plan;
mod scene;
mod sheet;
#[cfg(test)]
mod tests;
mod text;
mod words;

use std::io::Write;

use super::args::ExplainArgs;
use super::common::{Failure, open, out_error};
use super::shared::TextFormat;
use crate::session::Session;

/// Prints the explanation of a model.
pub fn explain(args: &ExplainArgs) -> Result<(), Failure> {
    show(args, &open(&args.model, &args.settings, &args.include)?)
}

/// Prints the explanation of a model that has been read.
pub fn show(args: &ExplainArgs, session: &Session) -> Result<(), Failure> {
    let plan = plan::Explanation::new(session);
    let shown = match args.format {
        TextFormat::Text => text::show(&plan),
        TextFormat::Json => serde_json::to_string(&plan).expect("text becomes JSON") + "\n",
    };
    std::io::stdout().write_all(shown.as_bytes()).map_err(out_error)
}
