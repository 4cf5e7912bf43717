//! Which module is which command.

use super::frame::Axis;
use crate::model::{Kind, Model};

/// What a module tells the turtle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Command {
    /// Nothing: the module has no meaning for the turtle.
    Nothing,
    /// `F(l)`: a step of length `l`, drawn.
    Draw,
    /// `f(l)`: a step, not drawn.
    Move,
    /// `+ - & ^ \ /`: a turn about the axis, by the parameter times this sign.
    Turn(Axis, f64),
    /// `|`: half a turn about up.
    TurnBack,
    /// `$`: left becomes horizontal.
    Level,
    /// `!(w)`
    Width,
    /// `;(n)`
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
    /// Drawn as the model's interpretation of this index says.
    Interpret(usize),
}

impl Command {
    fn of(kind: &Kind) -> Command {
        if let Some(interpretation) = kind.interpretation {
            return Command::Interpret(interpretation);
        }
        Command::plain(kind)
    }

    /// What a kind's name says, whatever its interpretation.
    pub(super) fn plain(kind: &Kind) -> Command {
        match kind.base() {
            "F" => Command::Draw,
            "f" => Command::Move,
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
            _ => Command::Nothing,
        }
    }

    /// The commands of all kinds of a model, by the kinds' index.
    pub(super) fn table(model: &Model) -> Vec<Command> {
        model.kinds.iter().map(|(_, kind)| Command::of(kind)).collect()
    }

    /// Whether it reads a parameter.
    pub(super) fn reads_parameter(self) -> bool {
        matches!(
            self,
            Command::Draw
                | Command::Move
                | Command::Turn(..)
                | Command::Width
                | Command::Color
                | Command::Leaf
                | Command::Flower
        )
    }
}
