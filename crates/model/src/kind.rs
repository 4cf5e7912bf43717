//! Module kinds: a name and a number of parameters.

use std::collections::HashMap;

/// A kind of a [`Model`](super::Model), by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct KindId(u32);

impl KindId {
    /// `[`: a branch begins.
    pub const OPEN: KindId = KindId(0);
    /// `]`: a branch ends.
    pub const CLOSE: KindId = KindId(1);

    /// Its index in the table of kinds.
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// True for `[` and `]`, which structure a string and are not modules.
    pub fn is_bracket(self) -> bool {
        self == KindId::OPEN || self == KindId::CLOSE
    }
}

/// The class of a module's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// `F`, `F_h`, `Apex`
    Word,
    /// `@L`
    Surface,
    /// `+`, `!`, `[`
    Symbol,
}

/// A module's name and number of parameters, with its rules and its drawing.
#[derive(Clone, Debug)]
pub struct Kind {
    /// The name with its suffix, as in `F_h`, `@L` or `+`.
    pub name: String,
    /// Number of parameters.
    pub arity: usize,
    /// Indices into [`Model::rules`](super::Model::rules) of the rules with this strict predecessor, in
    /// the order in which they are written.
    pub rules: Vec<usize>,
    /// The discrete rules with this strict predecessor, which apply in addition.
    pub steps: Vec<usize>,
    /// Index into [`Model::interpretations`](super::Model::interpretations).
    pub interpretation: Option<usize>,
    /// True if context matching passes over it: a symbol or surface by default, a module that an `ignore` names, and, in a
    /// model with `consider`, every module that this does not name.
    pub skipped: bool,
    /// The hidden parameters, which follow the written ones: the clocks of events at a rate, by the keys of their clauses.
    /// Kinds with the same base name and number of parameters have the same number of them.
    pub clocks: Vec<u64>,
    /// What the surroundings give, in the order of [`Quantity`]: hidden parameters behind the clocks, a value and its rate of change for each.
    pub inputs: Vec<Input>,
}

/// A quantity that the surroundings give to modules, and that rules read by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Quantity {
    /// `strain`: the largest bending strain of the stem that the module draws.
    Strain,
    /// `force_x`, `force_y`, `force_z`: what sheets and soil do to the solid that the module draws, by the axis; in kg·length/time².
    Force(usize),
    /// `ground(x, z)` where soil may move: the number of the heights that hold from a tick to the next one, which the field of
    /// [`Scenery::heights`](crate::Scenery::heights) has as an argument. Its slope is always 0.
    Ground,
}

impl Quantity {
    /// Those that rules read by a name alone, in their order.
    pub const NAMED: [Quantity; 4] =
        [Quantity::Strain, Quantity::Force(0), Quantity::Force(1), Quantity::Force(2)];

    /// The name in rules.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Strain => "strain",
            Quantity::Force(0) => "force_x",
            Quantity::Force(1) => "force_y",
            Quantity::Force(_) => "force_z",
            Quantity::Ground => "ground",
        }
    }

    /// True for a component of the force.
    pub fn is_force(self) -> bool {
        matches!(self, Quantity::Force(_))
    }
}

/// A quantity in the hidden parameters of a kind: its value, and the slope with which it goes on until the surroundings give the
/// next value. Kinds with the same base name and number of parameters have the same quantities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Input {
    /// The quantity.
    pub quantity: Quantity,
    /// Some rule of the kind reads it. If not, it is there because another kind that the same context patterns match reads it, and stays 0.
    pub is_read: bool,
}

impl Kind {
    /// Number of parameters, hidden ones included.
    pub fn width(&self) -> usize {
        self.computed() + self.clocks.len()
    }

    /// Number of parameters that a string computes for a new module: all but the clocks.
    pub fn computed(&self) -> usize {
        self.arity + 2 * self.inputs.len()
    }

    /// Numbers of the hidden parameters that hold the quantities that rules read. The slope of each stands behind it.
    pub fn read_inputs(&self) -> impl Iterator<Item = (Quantity, usize)> + '_ {
        let first = self.arity + self.clocks.len();
        let read = self.inputs.iter().enumerate().filter(|(_, input)| input.is_read);
        read.map(move |(i, input)| (input.quantity, first + 2 * i))
    }

    /// Number of the hidden parameter of a quantity, behind which its slope stands, if a rule reads it.
    pub fn input_parameter(&self, quantity: Quantity) -> Option<usize> {
        self.read_inputs().find(|(of, _)| *of == quantity).map(|(_, parameter)| parameter)
    }

    /// True if its rules read a component of the force.
    pub fn reads_force(&self) -> bool {
        self.read_inputs().any(|(quantity, _)| quantity.is_force())
    }

    /// Indices of its continuous and then its discrete rules.
    pub fn all_rules(&self) -> impl Iterator<Item = usize> + '_ {
        self.rules.iter().chain(&self.steps).copied()
    }

    /// True if it has no rules, continuous or discrete.
    pub fn has_no_rules(&self) -> bool {
        self.rules.is_empty() && self.steps.is_empty()
    }

    /// Its discrete rules or its continuous ones.
    pub fn rules_like(&self, rule: &super::Rule) -> &[usize] {
        if rule.discrete { &self.steps } else { &self.rules }
    }

    /// The class of its name.
    pub fn class(&self) -> Class {
        class_of(&self.name)
    }

    /// The part of a word before its first `_`, by which the turtle draws it and by which a context
    /// without `_` matches it. Surfaces and symbols are their own base.
    pub fn base(&self) -> &str {
        base_of(&self.name)
    }
}

/// Base names of the words that the turtle interprets: a line, a move without a line, and a move that adds no corner
/// to a polygon.
pub const DRAWN_WORDS: [&str; 3] = ["F", "f", "g"];

/// The surfaces that are built in: a leaf, a flower, a petal, a bud and a ball.
pub const BUILT_IN_SURFACES: [&str; 5] = ["@L", "@K", "@P", "@B", "@O"];

/// Most sizes of a surface: width, length, height.
pub const SURFACE_SIZES: usize = 3;

/// The command that sets the turtle on the ground. A model may declare a surface or a drawing of this name instead.
pub const GROUND: &str = "@G";

/// The command after which stems give way: `@E(TISSUE)`; with 0 they are rigid. A model may declare a surface or a drawing of this
/// name instead.
pub const ELASTIC: &str = "@E";

/// The command that lets blobs of a gas begin: `@S(GAS, rate, radius)`; without a radius they begin at one point. A model may declare a
/// surface or a drawing of this name instead.
pub const SOURCE: &str = "@S";

/// The command that lets go what follows, to the end of the branch. A model may declare a surface or a drawing of this name
/// instead.
pub const DETACH: &str = "@D";

/// The cut symbol: removes itself and the rest of its branch.
pub const CUT: &str = "%";

/// Turtle commands with the notation of surfaces, each with the number of parameters that it needs: a width to taper to,
/// the strength of tropism, the contour of stems, and the beginning, the points and the drawing of a Bézier patch.
pub const COMMAND_SURFACES: [(&str, usize); 6] =
    [("@W", 1), ("@T", 1), ("@C", 1), ("@PS", 1), ("@PC", 3), ("@PD", 1)];

/// The class of a name.
pub fn class_of(name: &str) -> Class {
    match name.chars().next() {
        Some('@') => Class::Surface,
        Some(c) if c.is_alphabetic() => Class::Word,
        _ => Class::Symbol,
    }
}

/// See [`Kind::base`].
pub fn base_of(name: &str) -> &str {
    match name.find('_') {
        Some(at) if at > 0 => &name[..at],
        _ => name,
    }
}

/// The table of the kinds of a model; brackets are the first two.
#[derive(Clone, Debug)]
pub struct Kinds {
    all: Vec<Kind>,
    /// By name: the kinds with each number of parameters.
    ids: HashMap<String, Vec<(usize, KindId)>>,
}

impl Default for Kinds {
    fn default() -> Kinds {
        let mut kinds = Kinds { all: Vec::new(), ids: HashMap::new() };
        assert_eq!(kinds.intern("[", 0), KindId::OPEN);
        assert_eq!(kinds.intern("]", 0), KindId::CLOSE);
        kinds
    }
}

impl Kinds {
    /// The kind with this name and number of parameters, added if it is new.
    pub fn intern(&mut self, name: &str, arity: usize) -> KindId {
        if let Some(id) = self.find(name, arity) {
            return id;
        }
        let id = KindId(self.all.len() as u32);
        self.all.push(Kind {
            name: name.to_owned(),
            arity,
            rules: Vec::new(),
            steps: Vec::new(),
            interpretation: None,
            skipped: class_of(name) != Class::Word,
            clocks: Vec::new(),
            inputs: Vec::new(),
        });
        self.ids.entry(name.to_owned()).or_default().push((arity, id));
        id
    }

    /// The kind with this name and number of parameters, if the model mentions it.
    pub fn find(&self, name: &str, arity: usize) -> Option<KindId> {
        self.ids.get(name)?.iter().find(|(known, _)| *known == arity).map(|(_, id)| *id)
    }

    /// A kind by its number, which must come from this table.
    pub fn get(&self, id: KindId) -> &Kind {
        &self.all[id.index()]
    }

    /// A kind by its number, to fill in its rules.
    pub fn get_mut(&mut self, id: KindId) -> &mut Kind {
        &mut self.all[id.index()]
    }

    /// Number of kinds, the two brackets included.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// False: a table contains the brackets at least.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// All kinds with their numbers, brackets included.
    pub fn iter(&self) -> impl Iterator<Item = (KindId, &Kind)> {
        self.all.iter().enumerate().map(|(i, kind)| (KindId(i as u32), kind))
    }
}
