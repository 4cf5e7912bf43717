//! The turtle itself: its state, and what each command does to it and to the scene.

use std::sync::Arc;

use super::command::Command;
use super::frame::{Axis, Frame};
use super::{COORDINATE_LIMIT, Error, Pose, shapes};
use crate::model::{KindId, Model};
use crate::scene::{
    MaterialId, Mesh, Owner, OwnerId, Placement, Point, Polygon, Scene, Segment, Surface, Vector, Width,
};
use crate::structure::Lineage;

/// What `!` without a parameter multiplies the width by.
const THINNING: f64 = 0.7;

/// The module of the string that is being drawn.
#[derive(Clone, Copy)]
pub(super) struct Source {
    pub(super) kind: KindId,
    pub(super) lineage: Lineage,
}

/// What brackets remember.
#[derive(Clone)]
struct State {
    position: Point,
    /// What rounding has kept out of `position`: a million small steps should end where one large step does.
    remainder: Vector,
    frame: Frame,
    width: Width,
    /// Number of the colour; 0 is the natural one.
    color: f64,
    /// The last segment on this axis, if the turtle still stands at its end.
    last: Option<usize>,
}

/// A turtle that walks through a string and draws into a scene.
pub(super) struct Walk<'a> {
    model: &'a Model,
    scene: &'a mut Scene,
    state: State,
    stack: Vec<State>,
    /// Vertices of the polygons that are open, innermost last.
    polygons: Vec<Vec<Point>>,
    source: Source,
    /// The source as an owner, once it has drawn something.
    owner: Option<OwnerId>,
    /// Names of the kinds that have drawn something, shared among their modules.
    names: Vec<Option<Arc<str>>>,
}

impl<'a> Walk<'a> {
    pub(super) fn new(model: &'a Model, scene: &'a mut Scene) -> Walk<'a> {
        Walk {
            model,
            scene,
            state: State {
                position: Point::origin(),
                remainder: Vector::zeros(),
                frame: Frame::upright(),
                width: Width::Default(1.0),
                color: 0.0,
                last: None,
            },
            stack: Vec::new(),
            polygons: Vec::new(),
            // Replaced before the first command.
            source: Source { kind: KindId::OPEN, lineage: Lineage::of_axiom(0) },
            owner: None,
            names: vec![None; model.kinds.len()],
        }
    }

    pub(super) fn pose(&self) -> Pose {
        Pose { position: self.state.position, axes: self.state.frame.vectors() }
    }

    /// Says on whose behalf the next commands are.
    pub(super) fn set_source(&mut self, source: Source) {
        self.source = source;
        self.owner = None;
    }

    /// An error about the present source.
    pub(super) fn complain(&self, error: impl FnOnce(String, Lineage) -> Error) -> Error {
        error(self.model.kinds.get(self.source.kind).name.clone(), self.source.lineage)
    }

    /// Does what a module of this kind says.
    pub(super) fn obey(&mut self, command: Command, parameters: &[f64], kind: KindId) -> Result<(), Error> {
        let given = if command.reads_parameter() { parameters.first().copied() } else { None };
        if let Some(value) = given.filter(|value| !value.is_finite()) {
            let name = self.model.kinds.get(kind).name.clone();
            return Err(self.complain(|_, lineage| Error::NotFinite { name, lineage, value }));
        }
        match command {
            Command::Nothing | Command::Interpret(_) => {}
            Command::Draw => self.step(given.unwrap_or(1.0), true)?,
            Command::Move => self.step(given.unwrap_or(1.0), false)?,
            Command::Turn(axis, sign) => {
                self.state.frame.turn(axis, sign * given.unwrap_or(self.model.angle))
            }
            Command::TurnBack => self.state.frame.turn(Axis::Up, 180.0),
            Command::Level => self.state.frame.level(),
            Command::Width => {
                self.state.width = match given {
                    Some(width) => Width::Set(self.in_range(width.max(0.0))?),
                    None => self.state.width.scaled(THINNING),
                }
            }
            Command::Color => self.state.color = given.unwrap_or(self.state.color + 1.0),
            Command::Push => {
                self.stack.push(self.state.clone());
                self.state.last = None;
            }
            Command::Pop => {
                // Brackets match, by the rules of the language; a stray one changes nothing.
                if let Some(state) = self.stack.pop() {
                    self.state = state;
                }
            }
            Command::BeginPolygon => self.polygons.push(Vec::new()),
            Command::Vertex => self.record_vertex(),
            Command::EndPolygon => self.end_polygon(),
            Command::Leaf => self.place(shapes::leaf, given.unwrap_or(1.0))?,
            Command::Flower => self.place(shapes::flower, given.unwrap_or(1.0))?,
        }
        Ok(())
    }

    fn in_range(&self, x: f64) -> Result<f64, Error> {
        if x.abs() <= COORDINATE_LIMIT {
            Ok(x)
        } else {
            Err(self.complain(|name, lineage| Error::TooFar { name, lineage }))
        }
    }

    /// A step along the heading, drawn as a segment if `draw` and if no polygon is open.
    fn step(&mut self, length: f64, draw: bool) -> Result<(), Error> {
        let start = self.state.position;
        if length != 0.0 {
            let [heading, left, _] = self.state.frame.vectors();
            self.advance(heading * length)?;
            let end = self.state.position;
            if end != start {
                let follows = self.state.last.take();
                if draw && self.polygons.is_empty() {
                    let segment = Segment {
                        start,
                        end,
                        direction: heading * length.signum(),
                        across: left,
                        widths: [self.state.width; 2],
                        material: self.chosen().unwrap_or(MaterialId::STEM),
                        owner: self.owner(),
                        follows,
                    };
                    self.state.last = Some(self.scene.segments.len());
                    self.scene.segments.push(segment);
                }
            }
        }
        self.record_vertex();
        Ok(())
    }

    /// Moves, with compensated summation (Neumaier 1974).
    fn advance(&mut self, by: Vector) -> Result<(), Error> {
        for i in 0..3 {
            let (old, step) = (self.state.position[i], by[i] + self.state.remainder[i]);
            let new = self.in_range(old + step)?;
            self.state.remainder[i] =
                if old.abs() >= step.abs() { (old - new) + step } else { (step - new) + old };
            self.state.position[i] = new;
        }
        Ok(())
    }

    fn record_vertex(&mut self) {
        if let Some(vertices) = self.polygons.last_mut()
            && vertices.last() != Some(&self.state.position)
        {
            vertices.push(self.state.position);
        }
    }

    fn end_polygon(&mut self) {
        let Some(mut vertices) = self.polygons.pop() else { return };
        while vertices.len() > 1 && vertices.first() == vertices.last() {
            vertices.pop();
        }
        let distinct = |p: &Point, among: &[Point]| among.iter().all(|q| p != q);
        let different =
            (0..vertices.len()).filter(|&i| distinct(&vertices[i], &vertices[..i])).take(3).count();
        if different == 3 {
            let material = self.chosen().unwrap_or(MaterialId::LEAF);
            let owner = self.owner();
            self.scene.polygons.push(Polygon { vertices, material, owner });
        }
    }

    /// Puts a surface at the turtle's position.
    fn place(&mut self, mesh: fn() -> Arc<Mesh>, scale: f64) -> Result<(), Error> {
        self.in_range(scale)?;
        if scale > 0.0 {
            let placement =
                Placement { origin: self.state.position, axes: self.state.frame.vectors(), scale };
            let (tint, owner) = (self.chosen(), self.owner());
            self.scene.surfaces.push(Surface { mesh: mesh(), placement, tint, owner });
        }
        Ok(())
    }

    /// The material of the chosen colour; `None` if things keep their own.
    fn chosen(&self) -> Option<MaterialId> {
        self.scene.palette.numbered(self.state.color)
    }

    /// The present source as an owner.
    fn owner(&mut self) -> OwnerId {
        if let Some(owner) = self.owner {
            return owner;
        }
        let Source { kind, lineage } = self.source;
        let kinds = &self.model.kinds;
        let name =
            self.names[kind.index()].get_or_insert_with(|| kinds.get(kind).name.as_str().into()).clone();
        *self.owner.insert(self.scene.add_owner(Owner { name, lineage }))
    }
}
