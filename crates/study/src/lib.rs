//! How good the answers are and what they cost: work-precision studies of any model, the hard cases, and a second
//! opinion on a run.
//!
//! ```text
//! model × method × accuracy ──record──▶ Record ──compare with the reference──▶ Outcome ──▶ Study
//! Study ──▶ table (terminal), CSV and JSON (files), SVG (plot)
//! text of a hard case ──case──▶ Case ──hard──▶ rows with verdicts
//! ```
//!
//! - `record`: one run, with everything that can be compared.
//! - `compare`: two runs; says where they first differ rather than by how much on the whole.
//! - `reference`: what is taken as the truth for a method, and how far that is to be trusted.
//! - `study`: all points of all methods of a model; `order`: the slope that they show.
//! - `table`, `files`, `plot` (with `axis`): a study for people, for programs, for print.
//! - `spread`, `band`: how measures of many specimens are distributed, as tables and as a plot.
//! - `verify`: one run again by an independent way, for users who want to be sure of an answer.
//! - `case`, `hard`, `cases`: models with exact answers in their first lines.
//!
//! Runs are made one after another, never in parallel, because they are timed.

mod axis;
mod band;
mod case;
mod cases;
mod compare;
mod diagram;
mod files;
mod hard;
mod order;
mod plot;
mod record;
mod reference;
mod spread;
mod study;
mod table;
mod verify;

pub use axis::LinearAxis;
pub use band::band_svg;
pub use case::{Case, CaseError, Expectation, PlainModule, Within};
pub use cases::CASES;
pub use compare::{Agreement, Comparison, Difference, compare};
pub use files::{csv, hard_csv, hard_json, json};
pub use hard::{CaseResult, HardPlan, Mismatch, run_case};
pub use order::{nominal_order, observed_order};
pub use plot::svg;
pub use record::{Accuracy, EarlyEnd, Record, Setup, Task, method_name};
pub use reference::{Reference, References};
pub use spread::{QUANTILES, Spread, SpreadSeries, spread_csv, spread_table};
pub use study::{Outcome, Plan, Point, Series, Study, Wall, default_times, study};
pub use table::{hard_table, mismatches, series_table, study_head, study_table};
pub use verify::{
    Gap, PROMISED, Pair, Productions, Split, Unverified, Verification, complaint, unverified,
    verification_rows, verification_table, verify,
};
