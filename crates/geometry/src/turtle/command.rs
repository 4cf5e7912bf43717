//! Which module is which command.

use super::frame::Axis;
use dlsys_model::{DETACH, Kind, KindId, Model, SOURCE};

/// What a module tells the turtle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Command {
    /// Nothing: the module has no meaning for the turtle.
    Nothing,
    /// `F(l)`: a step of length `l`, drawn.
    Draw,
    /// `f(l)`: a step, not drawn.
    Move,
    /// `g(l)`: a step, not drawn and no edge of a polygon.
    Hop,
    /// `+ - & ^ \ /`: a turn about the axis, by the parameter times this sign.
    Turn(Axis, f64),
    /// `|`: half a turn about up.
    TurnBack,
    /// `$`: left becomes horizontal.
    Level,
    /// `!(w)`
    Width,
    /// `@W(w)`: a width to which the stem tapers.
    Taper,
    /// `@T(e)`: strength of the tropism.
    Bend,
    /// `@C(n)`: cross-section of stems.
    Contour,
    /// `@E(n)`: the tissue of stems that give way; 0 is rigid.
    Elastic,
    /// `;(n)`, `;(n, v)`
    Color,
    /// `[`
    Push,
    /// `]`
    Pop,
    /// `{`
    BeginPolygon,
    /// `.`
    Vertex,
    /// `}`
    EndPolygon,
    /// `@L(s)`
    Leaf,
    /// `@K(s)`
    Flower,
    /// `@P(s)`
    Petal,
    /// `@B(s)`
    Bud,
    /// `@O(d)`
    Ball,
    /// A surface of the model, by its index among the scene's shapes.
    Surface(usize),
    /// A plant of another model, by its index among those that the model declares.
    Plant(usize),
    /// A sheet, by its index among those that the model declares.
    Sheet(usize),
    /// `@S(n, rate, radius)`: blobs of gas `n` begin here.
    Source,
    /// `@D`: what follows is free.
    Detach,
    /// `@G`: the turtle is set on the ground.
    Ground,
    /// `@PS(n)`
    BeginPatch,
    /// `@PC(n, row, column)`
    ControlPoint,
    /// `@PD(n)`
    DrawPatch,
    /// Drawn as the model's interpretation of this index says.
    Interpret(usize),
}

impl Command {
    fn of(kind: &Kind, model: &Model) -> Command {
        if let Some(interpretation) = kind.interpretation {
            return Command::Interpret(interpretation);
        }
        Command::plain(kind, model)
    }

    /// What a kind's name says, whatever its interpretation. A surface that the model declares goes before one
    /// that is built in.
    pub(super) fn plain(kind: &Kind, model: &Model) -> Command {
        if let Some(surface) = model.appearance.surfaces.iter().position(|shape| shape.name == kind.name) {
            return Command::Surface(surface);
        }
        if let Some(plant) = model.scenery.plants.iter().position(|plant| plant.name == kind.name) {
            return Command::Plant(plant);
        }
        if let Some(sheet) = model.scenery.sheets.iter().position(|sheet| sheet.name == kind.name) {
            return Command::Sheet(sheet);
        }
        match kind.base() {
            "F" => Command::Draw,
            "f" => Command::Move,
            "g" => Command::Hop,
            "+" => Command::Turn(Axis::Up, 1.0),
            "-" => Command::Turn(Axis::Up, -1.0),
            "&" => Command::Turn(Axis::Left, 1.0),
            "^" => Command::Turn(Axis::Left, -1.0),
            "\\" => Command::Turn(Axis::Heading, 1.0),
            "/" => Command::Turn(Axis::Heading, -1.0),
            "|" => Command::TurnBack,
            "$" => Command::Level,
            "!" => Command::Width,
            ";" => Command::Color,
            "[" => Command::Push,
            "]" => Command::Pop,
            "{" => Command::BeginPolygon,
            "." => Command::Vertex,
            "}" => Command::EndPolygon,
            "@L" => Command::Leaf,
            "@K" => Command::Flower,
            "@P" => Command::Petal,
            "@B" => Command::Bud,
            "@O" => Command::Ball,
            "@W" => Command::Taper,
            "@T" => Command::Bend,
            "@C" => Command::Contour,
            "@E" => Command::Elastic,
            SOURCE => Command::Source,
            DETACH => Command::Detach,
            "@G" => Command::Ground,
            "@PS" => Command::BeginPatch,
            "@PC" => Command::ControlPoint,
            "@PD" => Command::DrawPatch,
            _ => Command::Nothing,
        }
    }

    /// The commands of all kinds of a model, by the kinds' index.
    pub(super) fn table(model: &Model) -> Vec<Command> {
        model.kinds.iter().map(|(_, kind)| Command::of(kind, model)).collect()
    }

    /// The kinds of a model that hold a command, themselves or in what they are drawn as, by the kinds' index.
    pub(super) fn that_hold(sought: impl Fn(Command) -> bool, model: &Model) -> Vec<bool> {
        let table = Command::table(model);
        let mut holders: Vec<bool> = table.iter().map(|command| sought(*command)).collect();
        let holds = |holders: &[bool], drawn: KindId| {
            // Inside its own drawing a module is what its name says.
            holders[drawn.index()] || sought(Command::plain(model.kinds.get(drawn), model))
        };
        loop {
            let before = holders.clone();
            for (id, command) in table.iter().enumerate() {
                if let Command::Interpret(index) = command {
                    holders[id] |=
                        model.interpretations[*index].drawn.kinds().any(|kind| holds(&before, kind));
                }
            }
            if holders == before {
                return holders;
            }
        }
    }

    /// How many parameters it reads, at most.
    pub(super) fn parameters(self) -> usize {
        match self {
            Command::ControlPoint
            | Command::Source
            | Command::Leaf
            | Command::Flower
            | Command::Petal
            | Command::Bud
            | Command::Ball
            | Command::Plant(_)
            | Command::Surface(_) => 3,
            Command::Color => 2,
            Command::Draw
            | Command::Move
            | Command::Hop
            | Command::Turn(..)
            | Command::Width
            | Command::Taper
            | Command::Bend
            | Command::Contour
            | Command::Elastic
            | Command::BeginPatch
            | Command::DrawPatch => 1,
            _ => 0,
        }
    }
}
