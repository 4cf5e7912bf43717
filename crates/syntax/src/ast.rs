//! The text of a model as a tree, close to how it is written.
//!
//! - [`Expressions`]: the arena of all expressions. [`Part`]: a part of a string of modules.
//! - [`Rule`], [`Item`]: a rule, and a declaration or rule. [`Document`]: a model.

mod expression;
mod string;

use std::sync::Arc;

use crate::declarations::Declaration;
pub use crate::foreign_lines::Stray;
use dlsys_diagnostic::Span;
use dlsys_expr::Sort;
pub use expression::{Aggregate, Expr, ExprId, Expression, Expressions, Operator};
pub use string::{Conditional, Module, Part, Repetition, modules_of};

/// A name and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// The name as written.
    pub text: Arc<str>,
    /// Its place in the text.
    pub span: Span,
}

/// A module of a rule's head: a name and the names of its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct HeadModule {
    /// The name of the module.
    pub name: Name,
    /// The names of its parameters.
    pub parameters: Vec<Name>,
    /// Name and parameters.
    pub span: Span,
}

/// A part of a right context: `> [ C(z) ] D(w)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContextPart {
    /// The next module of the right context.
    Module,
    /// `[`: a branch begins.
    Open,
    /// `]`: a branch ends.
    Close,
}

/// A rule, continuous or discrete.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The left context in reading order.
    pub left: Vec<HeadModule>,
    /// The strict predecessor; its name is `±` where one rule stands for both turns.
    pub predecessor: HeadModule,
    /// The modules of the right context in reading order.
    pub right: Vec<HeadModule>,
    /// How its modules stand: one after another, or on branches.
    pub right_shape: Vec<ContextPart>,
    /// The whole head.
    pub head: Span,
    /// `let` lines.
    pub locals: Vec<(Name, Expression)>,
    /// True if written with `->`: the rule has one production, applied at the multiples of the period.
    pub discrete: bool,
    /// The clauses in the order written, at least one.
    pub clauses: Vec<Clause>,
    /// The expressions of the whole rule: from the first id, included, to the second, excluded.
    pub nodes: (ExprId, ExprId),
}

/// A clause of a rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Clause {
    /// The condition behind `if`, or before the arrow of a discrete rule.
    pub guard: Option<Expression>,
    /// `at rate …`, of a production.
    pub hazard: Option<Expression>,
    /// The equations, or the successors.
    pub action: Action,
    /// The whole clause.
    pub span: Span,
}

/// The effect of a clause: equations while its condition holds, or a production when it does.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Equations that hold while the clause is active.
    Solve(Vec<Equation>),
    /// One successor, or several with weights.
    Produce(Vec<Alternative>),
}

/// A successor of a clause.
#[derive(Clone, Debug, PartialEq)]
pub struct Alternative {
    /// `2:` before it.
    pub weight: Option<Expression>,
    /// The string; empty for `ε`.
    pub modules: Vec<Part>,
}

/// An equation of a `solve`.
#[derive(Clone, Debug, PartialEq)]
pub enum Equation {
    /// `dx/dt = …`
    Rate {
        /// The parameter, without the `d`.
        parameter: Name,
        /// Its derivative by time.
        rate: Expression,
    },
    /// `x = …`
    Value {
        /// The parameter on the left side.
        parameter: Name,
        /// Its value at every instant.
        value: Expression,
    },
    /// `0 = …`, optionally with the parameter that it is solved for.
    Zero {
        /// The right side, which must be 0.
        residual: Expression,
        /// The parameter behind `for`.
        unknown: Option<Name>,
        /// The whole equation.
        span: Span,
    },
}

impl Equation {
    /// The expression on its right side.
    pub fn expression(&self) -> Expression {
        match self {
            Equation::Rate { rate: it, .. }
            | Equation::Value { value: it, .. }
            | Equation::Zero { residual: it, .. } => *it,
        }
    }
}

/// A text in quotes, without them, and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// The text between the quotes.
    pub text: String,
    /// Its place, quotes included.
    pub span: Span,
}

/// A word within a declaration with the values behind it: `speed 3`, `at 0, 1, 0`, `spectrum kolmogorov 1, 4, 1`, `sag`.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// The word.
    pub word: Name,
    /// A second word, which is the one of several alternatives that the values belong to.
    pub choice: Option<Name>,
    /// The values, of which the grammar determines the number.
    pub values: Vec<Expression>,
    /// The whole attribute.
    pub span: Span,
}

/// A declaration or a rule.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// `title "text"`: the name of the model, without the quotes.
    Title(String),
    /// `const name = [values]`: an array of constants.
    Array {
        /// The name by which expressions index it.
        name: Name,
        /// The elements, from index 0.
        values: Vec<Expression>,
    },
    /// `curve sort name = points periodic`: a function of one argument through points.
    Curve {
        /// The name of the function.
        name: Name,
        /// The interpolation; monotone unless the text says otherwise.
        sort: Sort,
        /// Argument and value of each point.
        points: Vec<[Expression; 2]>,
        /// True if the curve repeats beyond its last point.
        periodic: bool,
    },
    /// `curve name from "file" item "item"`: a function of cpfg or lpfg.
    Function {
        /// The name of the function.
        name: Name,
        /// The path, relative to the folder of the model.
        file: Text,
        /// The name of the function in a file of several; None for that of the curve.
        item: Option<Text>,
    },
    /// `table sort name from "file" column "column" periodic`: a curve whose points are the rows of a file.
    Table {
        /// The name of the function.
        name: Name,
        /// The interpolation; linear unless the text says otherwise.
        sort: Sort,
        /// The path, relative to the folder of the model.
        file: Text,
        /// The heading of the column of values; None for the second column.
        column: Option<Text>,
        /// True if the curve repeats beyond its last point.
        periodic: bool,
    },
    /// `include "file"`: the path, relative to the folder of the model.
    Include(Text),
    /// `const name = value`: a constant.
    Const {
        /// The name that expressions read.
        name: Name,
        /// A value of constants only.
        value: Expression,
    },
    /// `param name = value in low .. high`: a constant that can be set when the model is loaded.
    Param {
        /// The name that expressions read and settings give.
        name: Name,
        /// The value without a setting.
        value: Expression,
        /// The least and the greatest value allowed; None for any number.
        range: Option<(Expression, Expression)>,
    },
    /// `def name(parameters) = body`: a function, expanded where it is called.
    Def {
        /// The name of the function.
        name: Name,
        /// The formal parameters.
        parameters: Vec<Name>,
        /// The value, in terms of the formal parameters and global names.
        body: Expression,
    },
    /// `angle value`: the turn of a symbol without a parameter, in degrees.
    Angle(Expression),
    /// `period value`: the time between two applications of the discrete rules.
    Period(Expression),
    /// `frames from .. to step step`: the default observation times.
    Frames {
        /// The first time.
        from: Expression,
        /// The last time.
        to: Expression,
        /// The time between two frames.
        step: Expression,
    },
    /// `color name = "value"`: a colour of the model's own.
    Color {
        /// The name that expressions read as the number of the colour.
        name: Name,
        /// The colour as `#rrggbb` or `#rgb`.
        value: Text,
    },
    /// `gradient name = "stop", "stop"`: colours at equal distances from 0 to 1.
    Gradient {
        /// The name that expressions read as the number of the gradient.
        name: Name,
        /// The colours as `#rrggbb` or `#rgb`.
        stops: Vec<Text>,
    },
    /// `surface @name from "file" texture "picture"`: patches or a mesh that the module `@name` draws.
    Surface {
        /// The name with its mark.
        name: Name,
        /// The path, relative to the folder of the model.
        file: Text,
        /// The path of the picture on the surface, likewise.
        texture: Option<Text>,
    },
    /// `contour name = points`: the cross-section of stems.
    Contour {
        /// The name that expressions read as the number of the contour.
        name: Name,
        /// The corners, counter-clockwise, in parts of the radius of the stem.
        points: Vec<[Expression; 2]>,
    },
    /// `tropism x, y, z strength strength`: the direction towards which headings bend.
    Tropism {
        /// The direction in scene coordinates, of any length but 0.
        direction: [Expression; 3],
        /// Radians per scene unit; None for 0.
        strength: Option<Expression>,
    },
    /// `plant @name from "file" with n = 5`: a plant of another model, which the module `@name` draws.
    Plant {
        /// The name with its mark.
        name: Name,
        /// The path, relative to the folder of the model.
        file: Text,
        /// Values for the params of the other model.
        settings: Vec<(Name, Expression)>,
    },
    /// `ground height color "#rrggbb"`: a rigid floor without end.
    Ground {
        /// Its height.
        height: Expression,
        /// Its colour, as `#rrggbb` or `#rgb`.
        color: Option<Text>,
    },
    /// `light x, y, z`: the direction towards the sun.
    Light([Expression; 3]),
    /// `sky "zenith", "horizon"`: colours as `#rrggbb` or `#rgb`.
    Sky([Text; 2]),
    /// `camera at x, y, z towards x, y, z angle degrees`
    Camera {
        /// The eye.
        eye: [Expression; 3],
        /// The point in the middle of the picture.
        aim: [Expression; 3],
        /// The angle of view in degrees; None for the default.
        angle: Option<Expression>,
    },
    /// `units length metres, time seconds`
    Units(Vec<Attribute>),
    /// `wind x, y, z speed u turbulence i scale l …`
    Wind {
        /// The direction in scene coordinates, of any length but 0.
        direction: [Expression; 3],
        /// Its other values, in the order written.
        attributes: Vec<Attribute>,
    },
    /// `flow source s at x, y, z decay r`: a further part of the wind.
    Flow {
        /// The kind of flow with its velocity or its strength.
        kind: Attribute,
        /// Its other values, in the order written.
        attributes: Vec<Attribute>,
    },
    /// `tissue name = stiffness e, density d, damping z`: a material of stems and surfaces.
    Tissue {
        /// The name that expressions read as the number of the tissue.
        name: Name,
        /// Its values, in the order written.
        attributes: Vec<Attribute>,
    },
    /// `gas name = size s, mass m, extinction x, …`: smoke, steam or pollen.
    Gas {
        /// The name that expressions read as the number of the gas.
        name: Name,
        /// Its values, in the order written.
        attributes: Vec<Attribute>,
        /// Its colours, as `#rrggbb` or `#rgb`: more than one is an error.
        colors: Vec<Text>,
    },
    /// `sheet @name from "file" of tissue pinned condition`: a flexible surface or net, which the module `@name` places.
    Sheet {
        /// The name with its mark.
        name: Name,
        /// The path of the mesh, relative to the folder of the model.
        file: Text,
        /// The name of its tissue.
        tissue: Name,
        /// The condition over x, y and z, in the file's coordinates, under which a point is held.
        pinned: Expression,
    },
    /// `solid names`: the modules whose drawings are solid bodies.
    Solid(Vec<Name>),
    /// `shelf names`: the modules whose drawings carry what falls on them.
    Shelf(Vec<Name>),
    /// `soil name = sand, repose 30`: a granular material.
    Soil {
        /// The name that `ground` and `pour` give.
        name: Name,
        /// Its parts, in the order written; one without a value is the material that it begins from.
        attributes: Vec<Attribute>,
        /// Its colours, as `#rrggbb` or `#rgb`: more than one is an error.
        colors: Vec<Text>,
    },
    /// `ground soil cell d depth h height f(x, z) extent e texture "picture" size w`: ground that gives way.
    Bed {
        /// The name of its soil.
        soil: Name,
        /// A file of heights.
        file: Option<Text>,
        /// Its values, in the order written.
        attributes: Vec<Attribute>,
        /// Its pictures: more than one is an error.
        textures: Vec<Text>,
    },
    /// `pour soil rate r at x, y, z radius r`: material that is added.
    Pour {
        /// The name of its soil.
        soil: Name,
        /// Its values, in the order written.
        attributes: Vec<Attribute>,
    },
    /// `ignore names`: the modules that context matching passes over.
    Ignore(Vec<Name>),
    /// `consider names`: the only modules that context matching does not pass over.
    Consider(Vec<Name>),
    /// `initial string: modules`, or `axiom: modules`.
    Axiom(Vec<Part>),
    /// `interpret head: drawn`: the modules that the turtle draws in place of one.
    Interpret {
        /// The module, with names for its parameters.
        head: HeadModule,
        /// The modules drawn, in terms of those parameters, `t` and `age`.
        drawn: Vec<Part>,
    },
    /// `head: clauses`, or `head : condition -> successor`.
    Rule(Rule),
}

impl Item {
    /// Its row in the table of declarations; None for rules.
    pub fn declaration(&self) -> Option<&'static Declaration> {
        Declaration::of_word(match self {
            Item::Title(_) => "title",
            Item::Include(_) => "include",
            Item::Const { .. } | Item::Array { .. } => "const",
            Item::Param { .. } => "param",
            Item::Def { .. } => "def",
            Item::Curve { .. } | Item::Function { .. } => "curve",
            Item::Table { .. } => "table",
            Item::Angle(_) => "angle",
            Item::Period(_) => "period",
            Item::Frames { .. } => "frames",
            Item::Color { .. } => "color",
            Item::Gradient { .. } => "gradient",
            Item::Surface { .. } => "surface",
            Item::Contour { .. } => "contour",
            Item::Tropism { .. } => "tropism",
            Item::Plant { .. } => "plant",
            Item::Ground { .. } => "ground",
            Item::Light(_) => "light",
            Item::Sky(_) => "sky",
            Item::Camera { .. } => "camera",
            Item::Units(_) => "units",
            Item::Wind { .. } => "wind",
            Item::Flow { .. } => "flow",
            Item::Tissue { .. } => "tissue",
            Item::Gas { .. } => "gas",
            Item::Sheet { .. } => "sheet",
            Item::Solid(_) => "solid",
            Item::Shelf(_) => "shelf",
            Item::Soil { .. } => "soil",
            Item::Bed { .. } => "ground",
            Item::Pour { .. } => "pour",
            Item::Ignore(_) => "ignore",
            Item::Consider(_) => "consider",
            Item::Axiom(_) => "initial",
            Item::Interpret { .. } => "interpret",
            Item::Rule(_) => return None,
        })
    }

    /// The name that it declares.
    pub fn name(&self) -> Option<&Name> {
        match self {
            Item::Const { name, .. }
            | Item::Array { name, .. }
            | Item::Param { name, .. }
            | Item::Def { name, .. }
            | Item::Curve { name, .. }
            | Item::Function { name, .. }
            | Item::Table { name, .. }
            | Item::Color { name, .. }
            | Item::Gradient { name, .. }
            | Item::Surface { name, .. }
            | Item::Plant { name, .. }
            | Item::Sheet { name, .. }
            | Item::Tissue { name, .. }
            | Item::Gas { name, .. }
            | Item::Soil { name, .. }
            | Item::Contour { name, .. } => Some(name),
            _ => None,
        }
    }
}

/// A parsed model.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// The declarations and rules in the order written, each with its place.
    pub items: Vec<(Item, Span)>,
    /// The arena in which all expressions of the items stand.
    pub expressions: Expressions,
    /// Names of global declarations that could not be parsed; their uses are not reported as errors.
    pub unread: Vec<Arc<str>>,
    /// Names and values in comments such as `#define K 0.5`, which are definitions in cpfg; for hints.
    pub commented: Vec<(Arc<str>, String)>,
    /// Comments such as `#(2)` in strings, which set the width of lines in cpfg: the place, and the text in the
    /// parentheses.
    pub commented_widths: Vec<(Span, String)>,
    /// Signs in strings that end something in C: comments, continued lines, declarations.
    pub strays: Vec<(Span, Stray)>,
    /// Index of the first item of the library, if it was included. Names that the model declares itself take precedence
    /// over those of the library, and unused library functions are not reported.
    pub library: Option<usize>,
}

impl Document {
    /// The items of the model and of the files that it includes, without the library.
    pub fn own_items(&self) -> &[(Item, Span)] {
        &self.items[..self.library.unwrap_or(self.items.len())]
    }
}
