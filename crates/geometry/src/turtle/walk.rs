//! The turtle: its state, and the effect of each command on it and on the scene.

mod width;

use std::sync::Arc;

use super::bend::Bend;
use super::command::Command;
use super::error::{self, Error, ErrorKind, Remark, Remarks};
use super::frame::{Axis, Frame};
use super::patch::OpenPatches;
use super::{COORDINATE_LIMIT, Pose, SMALLEST_LENGTH, shapes};
use crate::scene::{
    MaterialId, Owner, OwnerId, Patch, Placement, Point, Polygon, Scene, Seedling, Segment, Shape, Surface,
    Vector, Width,
};
use dlsys_diagnostic::Span;
use dlsys_model::{KindId, Model};
use dlsys_tree::Lineage;

/// The factor by which `!` without a parameter multiplies the width.
const THINNING: f64 = 0.7;

/// The module of the string that is being drawn.
#[derive(Clone, Copy)]
pub(super) struct DrawnModule {
    pub(super) kind: KindId,
    pub(super) lineage: Lineage,
}

/// The state that brackets save and restore.
#[derive(Clone)]
struct State {
    position: Point,
    /// Rounding error of `position` (compensated summation): a million small steps end where one large step does.
    remainder: Vector,
    frame: Frame,
    width: Width,
    /// Number of the colour, 0 being the natural one, and its place in a gradient.
    color: (f64, f64),
    /// Index of the cross-section of stems; `None` is a circle.
    contour: Option<u32>,
    /// Strength of the tropism.
    strength: f64,
    /// The last segment on this axis, if the turtle still stands at its end.
    last: Option<usize>,
    /// The segment at whose end this branch begins, if the turtle still stands there.
    parent: Option<usize>,
    /// Number of segments on this axis since the width was set.
    run: usize,
    /// The interpretation and the module that set the width with `!`.
    set_by: Option<(Option<(usize, KindId)>, DrawnModule)>,
    /// A branch or an organ stands where the turtle is.
    node: bool,
}

/// A polygon that is open.
struct Outline {
    vertices: Vec<Point>,
    /// Number of vertices made, coinciding ones included.
    made: usize,
    /// The interpretation and the module that began it.
    begun: (Option<(usize, KindId)>, DrawnModule),
}

/// A turtle that walks through a string and draws into a scene.
pub(super) struct Walk<'a> {
    model: &'a Model,
    scene: &'a mut Scene,
    state: State,
    stack: Vec<State>,
    /// The polygons that are open, innermost last.
    polygons: Vec<Outline>,
    patches: OpenPatches,
    /// Direction of the tropism.
    target: Vector,
    drawn: DrawnModule,
    /// The same as an owner, once it has drawn something.
    owner: Option<OwnerId>,
    /// Names of the kinds that have drawn something, shared among their modules.
    names: Vec<Option<Arc<str>>>,
    /// The interpretation that is being drawn, and the kind of the part of it.
    pub(super) inside: Option<(usize, KindId)>,
    time: f64,
    remarks: Remarks,
}

impl<'a> Walk<'a> {
    pub(super) fn new(model: &'a Model, scene: &'a mut Scene, time: f64) -> Walk<'a> {
        let tropism = model.appearance.tropism;
        Walk {
            model,
            scene,
            state: State {
                position: Point::origin(),
                remainder: Vector::zeros(),
                frame: Frame::upright(),
                width: Width::Default(1.0),
                color: (0.0, 0.0),
                contour: None,
                strength: tropism.map_or(0.0, |tropism| tropism.strength),
                last: None,
                parent: None,
                run: 0,
                set_by: None,
                node: false,
            },
            stack: Vec::new(),
            polygons: Vec::new(),
            patches: OpenPatches::default(),
            // Without a declaration, gravity.
            target: tropism.map_or(-Vector::y(), |tropism| Vector::from(tropism.direction)),
            // Replaced before the first command.
            drawn: DrawnModule { kind: KindId::OPEN, lineage: Lineage::of_axiom(0) },
            owner: None,
            names: vec![None; model.kinds.len()],
            inside: None,
            time,
            remarks: Remarks::default(),
        }
    }

    pub(super) fn pose(&self) -> Pose {
        Pose { position: self.state.position, axes: self.state.frame.vectors() }
    }

    /// Sets the module for which the next commands are.
    pub(super) fn set_drawn(&mut self, module: DrawnModule) {
        self.drawn = module;
        self.owner = None;
    }

    /// An error of the module that is being drawn.
    pub(super) fn error(&self, kind: ErrorKind) -> Error {
        let name = self.model.kinds.get(self.drawn.kind).name.clone();
        Error { kind, name, lineage: self.drawn.lineage, span: self.written(), time: self.time }
    }

    /// Adds a warning about the module that is being drawn.
    fn remark(&mut self, remark: Remark) {
        let span = self.written();
        self.scene.warnings.extend(self.remarks.add(remark, self.model, span, self.time));
    }

    /// The place in the text that says how the present module is drawn.
    fn written(&self) -> Option<Span> {
        error::place(self.model, self.drawn.kind, self.drawn.lineage, self.inside)
    }

    /// Ends the string: reports polygons that are still open.
    pub(super) fn finish(&mut self) {
        if let Some(open) = self.polygons.pop() {
            (self.inside, self.drawn) = open.begun;
            self.remark(Remark::PolygonNotClosed);
        }
    }

    /// Executes the command of a module of this kind.
    pub(super) fn obey(&mut self, command: Command, parameters: &[f64], kind: KindId) -> Result<(), Error> {
        let read = &parameters[..parameters.len().min(command.parameters())];
        if let Some(&value) = read.iter().find(|value| !value.is_finite()) {
            let name = self.model.kinds.get(kind).name.clone();
            return Err(Error { name, ..self.error(ErrorKind::NotFinite { value }) });
        }
        let given = read.first().copied();
        match command {
            Command::Nothing | Command::Interpret(_) => {}
            Command::Draw => self.step(given.unwrap_or(1.0), true)?,
            Command::Move => self.step(given.unwrap_or(1.0), false)?,
            Command::Hop => self.hop(given.unwrap_or(1.0))?,
            Command::Turn(axis, sign) => {
                self.state.frame.turn(axis, sign * given.unwrap_or(self.model.angle))
            }
            Command::TurnBack => self.state.frame.turn(Axis::Up, 180.0),
            Command::Level => self.state.frame.level(),
            Command::Width => self.set_width(given)?,
            Command::Taper => {
                self.check_width(given);
                let width = Width::Set(self.in_range(given.unwrap_or(0.0).max(0.0))?);
                self.taper(width);
                self.state.width = width;
                (self.state.run, self.state.set_by) = (0, None);
            }
            Command::Bend => self.state.strength = self.in_range(given.unwrap_or(0.0))?,
            Command::Contour => self.set_contour(given.unwrap_or(0.0).round()),
            Command::Color => {
                if let Some(number) = given {
                    self.check_color(number.round(), read.len() > 1);
                }
                self.state.color = match given {
                    Some(number) => (number, read.get(1).copied().unwrap_or(0.0)),
                    None => (self.state.color.0 + 1.0, 0.0),
                }
            }
            Command::Push => {
                self.stack.push(self.state.clone());
                self.state.parent = self.state.last.take().or(self.state.parent);
                self.state.run = 0;
            }
            Command::Pop => {
                // Brackets match, by the rules of the language; a stray one changes nothing.
                if let Some(state) = self.stack.pop() {
                    self.state = state;
                    self.state.node = true;
                }
            }
            Command::BeginPolygon => {
                let begun = (self.inside, self.drawn);
                self.polygons.push(Outline { vertices: Vec::new(), made: 0, begun });
            }
            Command::Vertex => self.record_vertex(),
            Command::EndPolygon => self.end_polygon(),
            Command::Leaf => self.place(&shapes::LEAF, read)?,
            Command::Flower => self.place(&shapes::FLOWER, read)?,
            Command::Petal => self.place(&shapes::PETAL, read)?,
            Command::Bud => self.place(&shapes::BUD, read)?,
            Command::Ball => self.place(&shapes::BALL, read)?,
            Command::Surface(index) => {
                if let Some(shape) = self.scene.shapes.get(index).cloned() {
                    self.place(&shape, read)?;
                }
            }
            Command::Plant(plant) => self.plant(plant, read),
            Command::Ground => self.set_down(),
            Command::BeginPatch | Command::ControlPoint | Command::DrawPatch => self.patch(command, read)?,
        }
        Ok(())
    }

    /// A step that is not drawn and makes no vertex: open polygons are put aside.
    fn hop(&mut self, length: f64) -> Result<(), Error> {
        let open = std::mem::take(&mut self.polygons);
        let done = self.step(length, false);
        self.polygons = open;
        done
    }

    /// Sets the width of lines, or makes them thinner.
    fn set_width(&mut self, given: Option<f64>) -> Result<(), Error> {
        self.check_width(given);
        self.state.width = match given {
            Some(width) => Width::Set(self.in_range(width.max(0.0))?),
            // The limit of thinner and thinner lines is 0.
            None => match self.state.width.scaled(THINNING) {
                Width::Set(width) => Width::Set(self.in_range(width)?),
                Width::Default(factor) => Width::Default(self.in_range(factor)?),
            },
        };
        (self.state.run, self.state.set_by) = (0, Some((self.inside, self.drawn)));
        Ok(())
    }

    /// Sets the cross-section of stems; 0, and the number of no contour, is a circle.
    fn set_contour(&mut self, number: f64) {
        let count = self.model.appearance.contours.len();
        if number != 0.0 && !(1.0..=count as f64).contains(&number) {
            self.remark(Remark::NoContour(number, count));
        }
        let first = self.scene.first_contour;
        self.state.contour = (1.0..=count as f64).contains(&number).then(|| first + number as u32 - 1);
    }

    /// Begins a patch, sets a point of it, or draws it.
    fn patch(&mut self, command: Command, parameters: &[f64]) -> Result<(), Error> {
        let given = |i: usize| parameters.get(i).copied().unwrap_or(0.0);
        match command {
            Command::BeginPatch => self.patches.begin(given(0)).map_err(|fault| self.error(fault))?,
            Command::ControlPoint => {
                let set = self.patches.set([0, 1, 2].map(given), self.state.position);
                set.map_err(|fault| self.error(fault))?;
            }
            _ => {
                let net = self.patches.net(given(0)).map_err(|fault| self.error(fault))?;
                let material = self.chosen().unwrap_or(MaterialId::PETAL);
                let owner = self.owner();
                // All in one place there is nothing to see, as at the birth of an organ.
                if net.iter().flatten().any(|p| *p != net[0][0]) {
                    self.scene.patches.push(Patch { net, material, owner });
                }
            }
        }
        Ok(())
    }

    /// A length, or another measure, as it is drawn: what is too small to be told from nothing is nothing.
    fn in_range(&self, x: f64) -> Result<f64, Error> {
        if x.abs() < SMALLEST_LENGTH {
            return Ok(0.0);
        }
        if x.abs() <= COORDINATE_LIMIT { Ok(x) } else { Err(self.error(ErrorKind::TooFar)) }
    }

    /// A step along the heading, drawn if `draw` and if no polygon is open; along an arc where there is a
    /// tropism.
    fn step(&mut self, length: f64, draw: bool) -> Result<(), Error> {
        let [heading, left, _] = self.state.frame.vectors();
        let length = self.in_range(length)?;
        let bend = Bend::new(heading, self.target, self.state.strength).filter(|_| length != 0.0);
        if let Some(bend) = bend {
            self.scene.lacked_accuracy |= self.scene.accuracy <= 0.0;
            let pieces = bend.pieces(length, self.scene.accuracy);
            let mut before = Vector::zeros();
            for i in 1..=pieces {
                let displacement = bend.displacement(length * i as f64 / pieces as f64);
                let way = displacement - before;
                before = displacement;
                if let Some(direction) = way.try_normalize(0.0) {
                    self.go(way, direction, left, draw)?;
                }
                self.record_vertex();
            }
            self.state.frame.bend(bend.towards(), bend.turn(length));
            return Ok(());
        }
        if length != 0.0 {
            self.go(heading * length, heading * length.signum(), left, draw)?;
        }
        self.record_vertex();
        Ok(())
    }

    /// Moves straight, by a displacement with its direction, and draws a segment if `draw`.
    fn go(&mut self, way: Vector, direction: Vector, across: Vector, draw: bool) -> Result<(), Error> {
        let start = self.state.position;
        self.advance(way)?;
        let end = self.state.position;
        if end == start {
            return Ok(());
        }
        let (follows, grows_from) = (self.state.last.take(), self.state.parent.take());
        let node = std::mem::replace(&mut self.state.node, false);
        if draw && self.polygons.is_empty() {
            let material = self.chosen().unwrap_or(MaterialId::STEM);
            if let Some(before) = follows.filter(|_| !node) {
                self.check_step(before, material);
            }
            let segment = Segment {
                start,
                end,
                direction,
                across,
                widths: [self.state.width; 2],
                contour: self.state.contour,
                material,
                owner: self.owner(),
                follows,
                grows_from,
            };
            self.state.run = if follows.is_some() { self.state.run + 1 } else { 1 };
            self.state.last = Some(self.scene.segments.len());
            self.scene.segments.push(segment);
        }
        Ok(())
    }

    /// Moves, with compensated summation (Neumaier 1974).
    fn advance(&mut self, by: Vector) -> Result<(), Error> {
        // A direction that is nearly an axis has parts far shorter than the whole.
        let by = by.map(|x| if x.abs() < SMALLEST_LENGTH { 0.0 } else { x });
        for i in 0..3 {
            let (old, step) = (self.state.position[i], by[i] + self.state.remainder[i]);
            let new = old + step;
            self.in_range(new)?;
            self.state.remainder[i] =
                if old.abs() >= step.abs() { (old - new) + step } else { (step - new) + old };
            self.state.position[i] = new;
        }
        Ok(())
    }

    fn record_vertex(&mut self) {
        if let Some(open) = self.polygons.last_mut() {
            open.made += 1;
            if open.vertices.last() != Some(&self.state.position) {
                open.vertices.push(self.state.position);
            }
        }
    }

    fn check_width(&mut self, given: Option<f64>) {
        /// What is nearer to 0 is the rounding of something that is 0.
        const ROUNDING: f64 = -1e-9;
        if let Some(width) = given.filter(|w| *w < ROUNDING) {
            self.remark(Remark::NegativeWidth(width));
        }
    }

    /// Warns of a number of a colour that does not exist, or of a gradient without a place in it.
    fn check_color(&mut self, number: f64, has_place: bool) {
        let [colors, gradients] = self.scene.palette.counts();
        let count = colors + gradients;
        if !(0.0..=count as f64).contains(&number) {
            self.remark(Remark::NoColor(number, count));
        } else if !has_place && number > colors as f64 {
            self.remark(Remark::GradientWithoutPlace(number as usize - colors - 1));
        }
    }

    fn end_polygon(&mut self) {
        let Some(Outline { mut vertices, made, .. }) = self.polygons.pop() else {
            return self.remark(Remark::PolygonNotOpen);
        };
        // One that has yet to grow has all its vertices in one place.
        if made < 3 {
            self.remark(Remark::FewVertices(made));
        }
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

    /// Puts a surface at the turtle's position: of one size (1), or of a width, a length and a height, which is
    /// the length if it is missing.
    fn place(&mut self, shape: &Shape, sizes: &[f64]) -> Result<(), Error> {
        let [width, length, height] = match *sizes {
            [] => [1.0; 3],
            [size] => [size; 3],
            [width, length] => [width, length, length],
            [width, length, height, ..] => [width, length, height],
        };
        self.state.node = true;
        // The axes are heading, left, up.
        let scales = [self.in_range(length)?, self.in_range(width)?, self.in_range(height)?];
        if scales.iter().all(|scale| *scale > 0.0) {
            let placement =
                Placement { origin: self.state.position, axes: self.state.frame.vectors(), scales };
            let (tint, owner) = (self.chosen(), self.owner());
            let Shape { mesh, patches } = shape.clone();
            self.scene.surfaces.push(Surface { mesh, patches, placement, tint, owner });
        }
        Ok(())
    }

    /// Puts a plant of another model, born at the time given first, at the turtle's position. Its axes follow the turtle's.
    fn plant(&mut self, plant: usize, parameters: &[f64]) {
        let age = self.time - parameters.first().copied().unwrap_or(0.0);
        if age < 0.0 {
            return;
        }
        let [heading, left, up] = self.state.frame.vectors();
        let placement = Placement::uniform(self.state.position, [-left, heading, up], 1.0);
        let (seed, owner) = (parameters.get(1).copied(), self.owner());
        self.scene.seedlings.push(Seedling { plant, age, seed, placement, owner });
    }

    /// Moves to the ground below or above, without a vertex of a polygon.
    fn set_down(&mut self) {
        if let Some(height) = self.model.scenery.ground
            && height != self.state.position.y
        {
            (self.state.position.y, self.state.remainder.y) = (height, 0.0);
            self.state.last = None;
        }
    }

    /// The material of the chosen colour; `None` if things keep their own.
    fn chosen(&self) -> Option<MaterialId> {
        let (number, value) = self.state.color;
        self.scene.palette.chosen(number, value)
    }

    /// The module that is being drawn, as an owner.
    fn owner(&mut self) -> OwnerId {
        if let Some(owner) = self.owner {
            return owner;
        }
        let DrawnModule { kind, lineage } = self.drawn;
        let kinds = &self.model.kinds;
        let name =
            self.names[kind.index()].get_or_insert_with(|| kinds.get(kind).name.as_str().into()).clone();
        *self.owner.insert(self.scene.add_owner(Owner { name, lineage }))
    }
}
