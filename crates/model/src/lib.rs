//! The compiled model: names resolved, expressions compiled, kinds of modules numbered.
//!
//! `dlsys-compile` builds a [`Model`] from text; all later stages read it. It contains no syntax except [`Span`]s, which let
//! messages point at the text, and no state: the growing tree is in `dlsys-tree`, the clock in `dlsys-sim`.
//!
//! - [`Kind`]: a module's name and number of parameters. `F(x)` and `F(x, y)` are two kinds.
//! - [`Rule`]: context, equations and productions under one head.
//! - [`SolutionForm`], [`ZeroCrossing`]: the solution of an equation and the location of a zero, by formula or numerically.
//! - [`Condition`]: the logic of an `if` over the signs of differences. The simulation tracks these signs, because a
//!   comparison of rounded numbers cannot decide whether two sides are equal at an event.
//!
//! # Examples
//!
//! ```
//! use dlsys_model::SolutionForm;
//! use dlsys_session::Session;
//!
//! let text = "
//!     param r = 0.5 in 0 .. 1
//!     initial string: F(1) A
//!     F(x): solve dx/dt = r*x
//! ";
//! let model = Session::from_text("stem.dls", text, &[])?.model;
//! assert_eq!((&*model.parameters[0].name, model.parameters[0].value), ("r", 0.5));
//! let kind = model.kinds.find("F", 1).expect("it is in the initial string");
//! let rule = &model.rules[model.kinds.get(kind).rules[0]];
//! // Growth at a constant relative rate has a formula and needs no integration.
//! assert!(!matches!(rule.solves[0].solution_forms[0], SolutionForm::Numeric(_)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

mod algebraic;
mod appearance;
mod chance;
mod condition;
mod kind;
mod measure;
mod physics;
mod picture;
mod remedy;
mod rule;
mod scenery;
mod sheet;
mod soil;
mod solution_form;
mod stepping;
mod successor;

pub use algebraic::{Aggregate, Algebraic, ContextPart};
pub use appearance::{
    Appearance, BUILT_IN_COLORS, Contour, Gradient, NamedColor, Net, Rgb, SurfaceShape, Tropism,
};
pub use chance::{Clock, Distribution, Draw, NewClock, choose};
pub use condition::{Condition, ConditionStep};
pub use dlsys_expr::{Comparison, Fold, Sign, Truth};
pub use kind::{
    BUILT_IN_SURFACES, COMMAND_SURFACES, CUT, Class, DETACH, DRAWN_WORDS, ELASTIC, GROUND, Input, Kind,
    KindId, Kinds, Quantity, SOURCE, SURFACE_SIZES, base_of, class_of,
};
pub use measure::Measure;
pub use physics::{FieldCache, Flow, Gas, Primitive, Spectrum, Tissue, Units, Wind};
pub use picture::{Drawn, Footprint, Picture, Texture};
pub use remedy::{Boundary, Remedy};
pub use rule::{
    Equations, Interpretation, Outcome, Pattern, Produce, PulseTerms, Pulses, Rule, Solve, Switch,
};
pub use scenery::{Camera, Plant, Scenery};
pub use sheet::Sheet;
pub use soil::{Bed, HeightGrid, Pour, Relief, Soil, SoilBase};
pub use solution_form::{
    AffineSum, DrivenGrowth, GrowthLaw, Jacobian, LinearRates, Numeric, Obstacle, SolutionForm, ZeroCrossing,
};
pub use stepping::{Read, Stepping};
pub use successor::{BadBounds, Choice, Part, Repeat, Stretch, Successor};

use std::sync::Arc;

use dlsys_diagnostic::Span;
use dlsys_expr::Curve;

/// A checked model, ready to run.
#[derive(Clone, Debug)]
pub struct Model {
    /// `title "…"`
    pub title: Option<String>,
    /// Angle of a turn without a parameter, in degrees (`angle`; 90 by default).
    pub angle: f64,
    /// Default observation times (`frames`).
    pub frames: Option<Frames>,
    /// The time between two applications of the discrete rules, which apply at its multiples (`period`; 1 by default).
    pub period: f64,
    /// The constants that can be set from outside (`param`), with the values in force.
    pub parameters: Vec<Parameter>,
    /// All kinds of modules that the model mentions, brackets included.
    pub kinds: Kinds,
    /// The axiom (initial string); its arguments read no variables.
    pub axiom: Successor,
    /// The place of the axiom in the text.
    pub axiom_span: Span,
    /// The rules, in the order written; [`Kind::rules`] refers to them by number.
    pub rules: Vec<Rule>,
    /// The drawings; [`Kind::interpretation`] refers to them by number.
    pub interpretations: Vec<Interpretation>,
    /// Colours, surfaces, contours and tropism.
    pub appearance: Arc<Appearance>,
    /// Plants of other models, light, sky, camera and floor.
    pub scenery: Scenery,
    /// By kind and parameter: true if no rule reads it, so that only drawings and output do.
    pub drawn_only: Vec<Vec<bool>>,
    /// Curves and tables, in the order of their declarations.
    pub curves: Vec<Arc<Curve>>,
}

impl Model {
    /// True if every parameter of every rule follows a formula, so that the model needs no numerical integration.
    pub fn is_closed_form(&self) -> bool {
        let mut solves = self.rules.iter().flat_map(|r| &r.solves);
        solves.all(|s| {
            s.solution_forms.iter().all(SolutionForm::is_closed)
                && s.algebraic.closed.iter().all(|closed| *closed)
        })
    }
}

impl Model {
    /// True if some rule reads `strain`, so that growth depends on how stems bend.
    pub fn reads_strain(&self) -> bool {
        self.kinds.iter().any(|(_, kind)| kind.input_parameter(Quantity::Strain).is_some())
    }

    /// True if some rule reads a component of the force on its solid, so that growth depends on what sheets do.
    pub fn reads_force(&self) -> bool {
        self.kinds.iter().any(|(_, kind)| kind.reads_force())
    }

    /// True if some rule reads the height of ground that may move.
    pub fn reads_ground(&self) -> bool {
        self.kinds.iter().any(|(_, kind)| kind.input_parameter(Quantity::Ground).is_some())
    }

    /// True if some rule reads anything that the surroundings give.
    pub fn reads_inputs(&self) -> bool {
        self.kinds.iter().any(|(_, kind)| kind.read_inputs().next().is_some())
    }

    /// The least time within which a field changes much that rules read ([`Program::stretch`](dlsys_expr::Program::stretch)).
    pub fn stretch(&self) -> f64 {
        let of_solve = |solve: &Solve| solve.rates.stretch().min(solve.algebraic.values.stretch());
        let of_rule = |rule: &Rule| {
            let terms = rule.aggregates.iter().map(|aggregate| aggregate.term.stretch());
            let solves = rule.solves.iter().map(of_solve);
            terms.chain(solves).fold(rule.sides.stretch(), f64::min)
        };
        self.rules.iter().map(of_rule).fold(f64::INFINITY, f64::min)
    }

    /// The names of a kind's parameters: as in its first rule, or else their numbers.
    pub fn parameter_names(&self, kind: KindId) -> Vec<String> {
        let kind = self.kinds.get(kind);
        match kind.all_rules().next() {
            // Hidden parameters may follow the written ones.
            Some(rule) => self.rules[rule].parameters[..kind.arity].to_vec(),
            None => (1..=kind.arity).map(|i| i.to_string()).collect(),
        }
    }
}

impl Default for Model {
    /// The empty model: no modules, turns of 90 degrees.
    fn default() -> Model {
        Model {
            title: None,
            angle: 90.0,
            frames: None,
            period: 1.0,
            parameters: Vec::new(),
            kinds: Kinds::default(),
            axiom: Successor::default(),
            axiom_span: Span::default(),
            rules: Vec::new(),
            interpretations: Vec::new(),
            appearance: Arc::default(),
            scenery: Scenery::default(),
            drawn_only: Vec::new(),
            curves: Vec::new(),
        }
    }
}

/// Equidistant observation times: `from + i * step` up to `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frames {
    /// The first time, at least 0.
    pub from: f64,
    /// The upper bound; the last time, if it is a whole number of steps after the first.
    pub to: f64,
    /// The time between two frames, greater than 0.
    pub step: f64,
}

impl Frames {
    /// Maximum number of frames; more are an error.
    pub const LIMIT: usize = 10_000_000;

    /// Number of observation times, both ends included. The last interval may be shorter than a step by rounding (up to a
    /// billionth of it): `0 .. 1 step 0.1` has 11 times.
    pub fn count(&self) -> usize {
        ((self.to - self.from) / self.step + 1e-9).floor() as usize + 1
    }

    /// The times. Each is computed from its index, so that rounding errors do not accumulate.
    pub fn times(&self) -> impl Iterator<Item = f64> + use<> {
        let frames = *self;
        (0..self.count()).map(move |i| frames.time(i))
    }

    /// The time of a frame, rounded to 15 digits where only rounding errors are lost: 0.3 from steps of 0.1, and not
    /// 0.30000000000000004.
    pub fn time(&self, index: usize) -> f64 {
        let t = self.from + index as f64 * self.step;
        let short: f64 = format!("{t:.14e}").parse().unwrap_or(t);
        if (short - t).abs() <= 4.0 * f64::EPSILON * t.abs() { short } else { t }
    }
}

/// A `param`: a constant that can be set from outside.
#[derive(Clone, Debug)]
pub struct Parameter {
    /// The name by which it is set.
    pub name: String,
    /// The value in force: that of the text, or that given from outside.
    pub value: f64,
    /// The least and the greatest value allowed, if the text gives them.
    pub range: Option<(f64, f64)>,
    /// The place of its name in the declaration.
    pub span: Span,
}
