//! Errors of drawing, and warnings of what is drawn but hardly meant: both with the place in the text.
//!
//! A module of the string is drawn by its own name, or as an `interpret` says. The text to look at is in the one case
//! the production that makes such modules (or the initial string), in the other the line of the `interpret`.

use super::{COORDINATE_LIMIT, DEPTH_LIMIT};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{KindId, Model, Produce, Successor};
use dlsys_tree::Lineage;

/// Most warnings of one frame.
const MAX_WARNINGS: usize = 20;

/// What a module that cannot be drawn does wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A parameter that it reads is NaN or infinite.
    #[error("its parameter is {value}")]
    NotFinite {
        /// The parameter.
        value: f64,
    },
    /// It leads beyond [`COORDINATE_LIMIT`].
    #[error("it goes beyond the greatest coordinate, {COORDINATE_LIMIT:e}")]
    TooFar,
    /// With its interpretation the frame has more than this many modules; see [`ModuleString::drawn_limit`](dlsys_tree::ModuleString::drawn_limit).
    #[error("its interpretation brings the frame to more than {limit} modules")]
    TooMany {
        /// The limit.
        limit: usize,
        /// Modules of the string itself.
        in_string: usize,
    },
    /// Interpretations are nested deeper than [`DEPTH_LIMIT`].
    #[error("interpretations are nested more than {DEPTH_LIMIT} deep")]
    TooDeep,
    /// `@PC` or `@PD` of a patch for which there was no `@PS`.
    #[error("patch {patch} is not begun; `@PS({patch})` comes before its points")]
    PatchNotBegun {
        /// Number of the patch.
        patch: i64,
    },
    /// `@PC` with a row or a column that a patch does not have.
    #[error("it sets row {row}, column {column} of a patch; both are 0, 1, 2 or 3")]
    NoControlPoint {
        /// The row given.
        row: f64,
        /// The column given.
        column: f64,
    },
    /// `@PD` of a patch with fewer than 16 control points.
    #[error("patch {patch} has no control point at (row, column) {missing}")]
    PatchIncomplete {
        /// Number of the patch.
        patch: i64,
        /// The points that are missing: `(0, 1), (3, 3)`.
        missing: String,
    },
    /// A declaration of light or camera has no meaning at this time.
    #[error("{why}")]
    BadSurroundings {
        /// The reason, as a sentence.
        why: String,
    },
    /// The bounds of a repetition in its drawing are none.
    #[error("a repetition in its drawing cannot be made: {why}")]
    BadBounds {
        /// The reason, as a part of a sentence.
        why: String,
    },
    /// A stem under `@E` without a width of its own.
    #[error("it draws a stem that gives way, and its width is not set")]
    NoWidth,
    /// A stem behind `@D` without a width of its own.
    #[error("it draws a stem that is let go, and its width is not set")]
    NoWidthFree,
    /// A plant of another model behind `@D`.
    #[error("it lets go of a plant of another model")]
    FreePlant,
    /// A sheet behind `@D`.
    #[error("it lets go of a sheet")]
    FreeSheet,
    /// A sheet on stems that give way.
    #[error("it places a sheet on stems that bend, and the sheet would stay where they are at rest")]
    BentSheet,
    /// More patches have been begun than a frame may have.
    #[error("it begins more patches than a frame may have")]
    TooManyPatches,
}

impl ErrorKind {
    fn help(&self) -> String {
        match self {
            ErrorKind::NotFinite { .. } => {
                "look for a division by zero, or a root or logarithm of a negative number, in what it is computed from"
                    .to_owned()
            }
            ErrorKind::TooFar => "look for a length or a size that grows without bound".to_owned(),
            ErrorKind::TooMany { limit, .. } => format!(
                "if this is meant, allow more: `--max-modules {}`; otherwise draw fewer modules for one, or let the rules make fewer",
                limit.saturating_mul(10)
            ),
            ErrorKind::TooDeep => {
                "let the drawing of a module name what is drawn, not another module with a drawing of its own"
                    .to_owned()
            }
            ErrorKind::PatchNotBegun { patch } => format!("write `@PS({patch})` before it in the same string"),
            ErrorKind::NoControlPoint { .. } => "write `@PC(n, row, column)`, row and column from 0 to 3".to_owned(),
            ErrorKind::PatchIncomplete { patch, .. } => {
                format!("set all 16 points with `@PC({patch}, row, column)` before `@PD({patch})`")
            }
            ErrorKind::BadSurroundings { .. } => {
                "look at the values of its expressions at this time: they may read `t`".to_owned()
            }
            ErrorKind::BadBounds { .. } => {
                "bounds are whole numbers, at most a million apart: round them with `floor(…)` or `ceil(…)`".to_owned()
            }
            ErrorKind::NoWidth => {
                "stiffness and mass follow from the width: write `!(w)` before it, or `@E(0)` for a rigid stem".to_owned()
            }
            ErrorKind::NoWidthFree => {
                "the mass of what falls follows from the width: write `!(w)` before it, as in `@D !(0.01) F(0.2)`".to_owned()
            }
            ErrorKind::FreePlant => {
                "a plant of another model stands where it is: draw what falls with modules of this model".to_owned()
            }
            ErrorKind::FreeSheet => {
                "a sheet is held where its `pinned` says: place it outside the branch of `@D`".to_owned()
            }
            ErrorKind::BentSheet => {
                "place it outside the branch of `@E`; what holds it is rigid, or a `solid` that the equations move".to_owned()
            }
            ErrorKind::TooManyPatches => {
                "use the number of a patch again when it is drawn: `@PS(1)` forgets the patch 1 that was there".to_owned()
            }
        }
    }
}

/// A module that cannot be drawn, with its place in the string and in the text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[error("cannot draw `{name}` (module {lineage}): {kind}")]
pub struct Error {
    /// What is wrong.
    pub kind: ErrorKind,
    /// Name of the module of the string, or of the part of its interpretation.
    pub name: String,
    /// Lineage of the module of the string.
    pub lineage: Lineage,
    /// The place in the text that makes the module, or says how it is drawn.
    pub span: Option<Span>,
    /// Time of the string.
    pub time: f64,
}

impl Error {
    /// The error as a message that quotes the model, with advice.
    pub fn diagnostic(&self) -> Diagnostic {
        let message = format!("cannot draw `{}` at t = {}: {}", self.name, short(self.time), self.kind);
        let error = Diagnostic::error(message);
        let error = match self.span {
            Some(span) => error.at(span, "drawn by this"),
            None => error,
        };
        let error = match self.kind {
            ErrorKind::BadSurroundings { .. } => error,
            _ => error.note(format!("it is drawn for module {}", self.lineage)),
        };
        let error = match self.kind {
            ErrorKind::TooMany { in_string, .. } => error.note(format!(
                "{in_string} of them are modules of the string itself; interpretations make the others"
            )),
            _ => error,
        };
        error.help(self.kind.help())
    }
}

/// Something that is drawn, but hardly as it was meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Remark {
    NegativeWidth(f64),
    /// A colour of this number, and how many there are.
    NoColor(f64, usize),
    /// `;` alone behind the last colour: the number, and how many there are.
    NoNextColor(f64, usize),
    /// A gradient of this number, without a place in it.
    GradientWithoutPlace(usize),
    NoContour(f64, usize),
    NoTissue(f64, usize),
    NoGas(f64, usize),
    /// A rate of a source below 0.
    NegativeRate(f64),
    /// An `@D` of a part that was not there when its module was born.
    HeldBack,
    /// A polygon with so many vertices.
    FewVertices(usize),
    PolygonNotOpen,
    PolygonNotClosed,
    /// Widths of two segments of one axis that meet.
    Step(f64, f64),
    /// A stem of a solid module or a shelf on soil, without a width of its own.
    NoWidthBody,
}

/// The warnings of a frame, each once for each place.
#[derive(Default)]
pub(super) struct Remarks {
    added: Vec<(std::mem::Discriminant<Remark>, Option<Span>)>,
    /// The interpretations and kinds whose steps were looked at.
    steps: Vec<(Option<(usize, KindId)>, KindId)>,
}

impl Remarks {
    /// Whether no step of the width was found before that these set.
    pub(super) fn steps_are_new(&mut self, inside: Option<(usize, KindId)>, kind: KindId) -> bool {
        let key = (inside, if inside.is_some() { KindId::OPEN } else { kind });
        let new = self.steps.len() < MAX_WARNINGS && !self.steps.contains(&key);
        if new {
            self.steps.push(key);
        }
        new
    }

    /// The warning, unless it has been said.
    pub(super) fn add(
        &mut self,
        remark: Remark,
        model: &Model,
        span: Option<Span>,
        time: f64,
    ) -> Option<Diagnostic> {
        let key = (std::mem::discriminant(&remark), span);
        if self.added.len() >= MAX_WARNINGS || self.added.contains(&key) {
            return None;
        }
        self.added.push(key);
        Some(warning(remark, model, span, time))
    }
}

/// A number as people read it.
fn short(x: f64) -> f64 {
    format!("{x:.8e}").parse().unwrap_or(x)
}

fn warning(remark: Remark, model: &Model, span: Option<Span>, time: f64) -> Diagnostic {
    let time = short(time);
    let appearance = &model.appearance;
    let (message, found, help) = match remark {
        Remark::NegativeWidth(width) => (
            "a width is negative".to_owned(),
            format!("{} at t = {time}, drawn as 0", short(width)),
            "give a width of 0 or more: `!(max(0, …))` where it may come out negative".to_owned(),
        ),
        Remark::NoColor(number, count) => (
            "there is no such colour".to_owned(),
            format!("colour {} at t = {time}; beyond the last one they begin again at 1", short(number)),
            format!("choose a number from 0 to {count}, or declare a colour and write its name: `color rose = \"#e573a5\"`, `;(rose)`"),
        ),
        Remark::NoNextColor(number, count) => (
            "there is no next colour".to_owned(),
            format!("colour {} of {count} at t = {time}; beyond the last one they begin again at 1", short(number)),
            match &appearance.colors[..] {
                [] => "declare the colours in their order, `color bark = \"#7a5a3a\"`, and begin with the first of them by its name, `;(bark)`".to_owned(),
                [first, ..] => format!("declare as many colours as there are steps, in their order, and begin with the first by its name, such as `;({})`", first.name),
            },
        ),
        Remark::GradientWithoutPlace(index) => {
            let name = appearance.gradients.get(index).map_or("leaf", |g| &*g.name);
            (
                format!("the gradient `{name}` is used without a place in it"),
                "drawn in its first colour".to_owned(),
                format!("write `;({name}, v)`, with v from 0, the first colour, to 1, the last"),
            )
        }
        Remark::NoContour(number, count) => (
            "there is no such contour".to_owned(),
            format!("contour {} at t = {time}, drawn as a circle", short(number)),
            match &appearance.contours[..] {
                [] => "declare one and write its name: `contour square = (1, 1) (-1, 1) (-1, -1) (1, -1)`, `@C(square)`".to_owned(),
                [first, ..] => format!("write the name of a contour, such as `@C({})`; the model has {count}, and 0 is a circle", first.name),
            },
        ),
        Remark::NoTissue(number, count) => (
            "there is no such tissue".to_owned(),
            format!("tissue {} at t = {time}, drawn rigid", short(number)),
            match &model.scenery.tissues[..] {
                [] => "declare one and write its name: `tissue stalk = stiffness 2e8, density 900, damping 0.05`, `@E(stalk)`".to_owned(),
                [first, ..] => format!("write the name of a tissue, such as `@E({})`; the model has {count}, and 0 is rigid", first.name),
            },
        ),
        Remark::NoGas(number, count) => (
            "there is no such gas".to_owned(),
            format!("gas {} at t = {time}; nothing begins here", short(number)),
            match &model.scenery.gases[..] {
                [] => "declare one and write its name: `gas steam = size 0.01, mass 1e-6, extinction 200`, `@S(steam, 100)`".to_owned(),
                [first, ..] => format!("write the name of a gas, such as `@S({}, 100)`; the model has {count}", first.name),
            },
        ),
        Remark::NegativeRate(rate) => (
            "a gas begins at a rate below 0".to_owned(),
            format!("{} at t = {time}; nothing begins here", short(rate)),
            "the rate is a number of blobs in a unit of t, 0 or greater".to_owned(),
        ),
        Remark::HeldBack => (
            "this `@D` lets nothing go".to_owned(),
            format!("first drawn at t = {time}, after the birth of its module"),
            "what it holds is free since the birth of the module: let a production make a module that is drawn with `@D` from its birth on"
                .to_owned(),
        ),
        Remark::FewVertices(count) => (
            "a polygon has fewer than three vertices, and is not drawn".to_owned(),
            format!("{count} at t = {time}"),
            "between `{` and `}` each step `f`, `F` and each `.` makes a vertex, and the place of `{` is none: write three or more; `{.` makes one where it begins".to_owned(),
        ),
        Remark::PolygonNotOpen => (
            "a `}` ends no polygon".to_owned(),
            format!("no polygon is open here at t = {time}"),
            "write the `{` that begins it, before its first vertex".to_owned(),
        ),
        Remark::PolygonNotClosed => (
            "a `{` is never closed, and its polygon is not drawn".to_owned(),
            format!("no `}}` follows at t = {time}; what comes behind it makes vertices, and no lines"),
            "write the `}` that ends it".to_owned(),
        ),
        Remark::Step(from, to) => (
            "the width of a stem changes at once".to_owned(),
            format!("from {} to {} at t = {time}", short(from), short(to)),
            "write `@W(w)` in place of `!(w)`: the stem before it tapers to that width".to_owned(),
        ),
        Remark::NoWidthBody => (
            "a stem without a width is no body on soil".to_owned(),
            format!("its width is not set at t = {time}: it presses nothing and carries nothing"),
            "write `!(w)` before it, with its width in units of the model".to_owned(),
        ),
    };
    let warning = Diagnostic::warning(message);
    let warning = match span {
        Some(span) => warning.at(span, found),
        None => warning.note(found),
    };
    warning.help(help)
}

/// Where the text says how a module is drawn: in the `interpret` that is being drawn, in the production that makes such
/// modules, or in the initial string. Where it cannot be told which module of that it is, the whole; of several productions
/// the first that makes such a module at this place, or else the first.
pub(super) fn place(
    model: &Model,
    kind: KindId,
    lineage: Lineage,
    inside: Option<(usize, KindId)>,
) -> Option<Span> {
    let known = |span: Span| (span != Span::default()).then_some(span);
    if let Some((index, part)) = inside
        && let Some(interpretation) = model.interpretations.get(index)
    {
        return only_one(&interpretation.drawn, part).or(known(interpretation.span));
    }
    let of = |successor: &Successor| successor.place_of(lineage.place()?, kind);
    if lineage.generation == 0 {
        return of(&model.axiom).or(known(model.axiom_span));
    }
    let productions = model.rules.iter().flat_map(|rule| &rule.produces);
    let makes = |p: &&Produce| p.outcome.successors.iter().any(|s| s.kinds().any(|made| made == kind));
    let mut productions = productions.filter(makes).peekable();
    let whole = productions.peek().and_then(|first| known(first.span));
    productions.flat_map(|production| &production.outcome.successors).find_map(of).or(whole)
}

/// The place of the module of this kind in a drawing that has no other.
fn only_one(drawn: &Successor, kind: KindId) -> Option<Span> {
    let mut places = drawn.stretches().flat_map(|stretch| &stretch.places);
    let (_, span) = places.find(|(known, _)| *known == kind)?;
    (drawn.kinds().filter(|known| *known == kind).count() == 1).then_some(*span)
}
