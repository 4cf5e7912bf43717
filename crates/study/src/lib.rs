//! Studies of accuracy and cost: work-precision studies of any model, the hard cases, and verification of a run.
//!
//! ```text
//! model × method × accuracy ──record──▶ Record ──compare with the reference──▶ Outcome ──▶ Study
//! Study ──▶ table (terminal), CSV and JSON (files), SVG (plot)
//! text of a hard case ──case──▶ Case ──hard──▶ CaseResult
//! ```
//!
//! - `record`: one run, with all its states, productions and counts.
//! - `compare`: two runs; finds the first difference in structure before it measures differences of numbers.
//! - `reference`: the run against which a method is judged, and an estimate of its error.
//! - `study`: all points of all methods of a model; `order`: the observed order of convergence.
//! - `table`, `files`, `plot`: a study as text, as CSV and JSON, and as a picture; `axis`, `diagram`: parts that plots share.
//! - `allowance`: the time that a study may take.
//! - `spread`, `band`: the distribution of measures over many specimens, as tables and as a plot.
//! - `verify`: a run computed again in an independent way.
//! - `stems`, `passive`, `soils`: error against work for stems that bend, for what falls and hangs, and for ground that gives way; `surroundings`, `falls`, `gases`, `sheets`, `grounds`: exact cases and
//!   speed of wind, stems, bodies that fall, gases, sheets and ground.
//! - `coupling`: forces of the passive parts of a model on the active ones, and which coupling serves.
//! - `case`, `hard`, `cases`: models with exact answers in their first lines.
//!
//! Runs are made one after another, never in parallel, because they are timed.

#![warn(missing_docs)]

mod allowance;
mod axis;
mod band;
mod case;
mod cases;
mod compare;
mod coupling;
mod diagram;
mod error;
mod falls;
mod files;
mod gases;
mod grounds;
mod hard;
mod order;
mod passive;
mod plot;
mod points;
mod record;
mod reference;
mod sheets;
mod soils;
mod spread;
mod stems;
mod study;
mod surroundings;
mod table;
mod verify;

pub use allowance::Allowance;
pub use axis::LinearAxis;
pub use band::band_svg;
pub use case::{Case, Expectation, PlainModule, Within};
pub use cases::CASES;
pub use compare::{Agreement, Comparison, Difference, compare};
pub use coupling::{
    Active, Apart, Coupling, CouplingError, CouplingPlan, CouplingStudy, Decision, Feet, Question, Range,
    Row, Thresholds, Trial, coupling_csv, coupling_json, coupling_study, coupling_text, has_feedback,
};
pub use error::Error;
pub use falls::{Contacts, Landings, exact_fall_table};
pub use files::{csv, hard_csv, hard_json, json};
pub use gases::{exact_gas_table, gas_speed_table};
pub use grounds::{exact_ground_table, ground_rule_table, ground_speed_table, hard_ground_table};
pub use hard::{CaseResult, HardPlan, Mismatch, run_case};
pub use order::{nominal_order, observed_order};
pub use passive::{PassivePoint, PassiveStudy, passive_csv, passive_study, passive_table};
pub use plot::svg;
pub use record::{Accuracy, EarlyEnd, Record, Setup, Task, method_name};
pub use reference::{Reference, References};
pub use sheets::{
    Passes, exact_sheet_table, hard_sheet_table, net_table, sheet_method_table, sheet_speed_table,
};
pub use soils::{SoilOutcome, SoilPoint, SoilStudy, soil_csv, soil_study, soil_table};
pub use spread::{QUANTILES, Spread, SpreadSeries, spread_csv, spread_table};
pub use stems::{StemOutcome, StemPoint, StemStudy, stem_csv, stem_study, stem_table};
pub use study::{Outcome, Plan, Point, Series, Study, Wall, default_times, study};
pub use surroundings::{
    exact_stem_table, hard_stem_table, method_table, random_stem_table, speed_table, surroundings_csv,
    wind_table,
};
pub use table::{hard_table, mismatches, series_table, study_head, study_table};
pub use verify::{
    Gap, PROMISED, Pair, Productions, Split, Verification, complaint, unverified, verification_rows,
    verification_table, verify,
};
