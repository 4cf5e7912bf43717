//! The turtle: its state, and the effect of each command on it and on the scene.

mod place;
mod step;
mod width;

use std::sync::Arc;

use super::bent::{Bent, Strains};
use super::body::{self, DrawnBody};
use super::command::Command;
use super::error::{self, Error, ErrorKind, Remark, Remarks};
use super::frame::{Axis, Frame, Turns};
use super::free::{FreePart, Passive, SolidBody};
use super::patch::OpenPatches;
use super::skeleton::{Origin, Recorder, Skeleton};
use super::{COORDINATE_LIMIT, Pose, SMALLEST_LENGTH, shapes};
use crate::scene::{MaterialId, Owner, OwnerId, Point, Scene, Vector, Widest, Width};
use dlsys_diagnostic::Span;
use dlsys_model::{KindId, Model};
use dlsys_tree::Lineage;

/// The factor by which `!` without a parameter multiplies the width.
const THINNING: f64 = 0.7;
/// Stems from which on a drawing is none of a single body.
const FEW: usize = 3;

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
    set_by: Option<Place>,
    /// What stands where the turtle is.
    node: Node,
    /// The tissue of stems that give way, by its number from 0; `None` for rigid ones.
    tissue: Option<usize>,
    /// The tissue of what is rigid: the last one that gave way.
    rigid: Option<usize>,
    /// The motion from the shape at rest to what is seen; `None` if there is none.
    bent: Option<Bent>,
    /// The stem of the skeleton at whose end the turtle is, rigid parts in between.
    stem: Option<usize>,
    /// What is drawn here is let go: the number of its part, from 0 in the order of drawing.
    part: Option<usize>,
}

/// What stands at a place of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Node {
    #[default]
    Bare,
    /// A branch, of stems or of organs.
    Branch,
    /// An organ on the axis itself.
    Organ,
}

/// A module that draws, in the interpretation and the part of it that draws it.
pub(super) type Place = (Option<(usize, KindId)>, DrawnModule);

/// A polygon that is open.
struct Outline {
    vertices: Vec<Point>,
    /// Number of vertices made, coinciding ones included.
    made: usize,
    /// The interpretation and the module that began it.
    begun: Place,
}

/// A turtle that walks through a string and draws into a scene.
pub(super) struct Walk<'a> {
    model: &'a Model,
    scene: &'a mut Scene,
    state: State,
    stack: Vec<State>,
    turns: Turns,
    /// The polygons that are open, innermost last.
    polygons: Vec<Outline>,
    patches: OpenPatches,
    /// Direction of the tropism.
    target: Vector,
    drawn: DrawnModule,
    /// The same as an owner, once it has drawn something.
    owner: Option<OwnerId>,
    /// The pose at the beginning of the module, if the scene notes it.
    start: Option<Pose>,
    /// Names of the kinds that have drawn something, shared among their modules.
    names: Vec<Option<Arc<str>>>,
    /// The interpretation that is being drawn, and the kind of the part of it.
    pub(super) inside: Option<(usize, KindId)>,
    time: f64,
    remarks: Remarks,
    /// How far stems are from their shape at rest.
    strains: Option<&'a dyn Strains>,
    /// The greatest width that is set and drawn, and by what it was set.
    widest: Option<(f64, Place)>,
    /// What is noted for the skeleton.
    recorder: Option<Recorder>,
    /// Number of brackets of the string around the module that is being drawn.
    depth: usize,
    /// Number of stems that this module has drawn.
    stems_drawn: u32,
    /// Number of parts that this module has let go, and that the string has.
    parts_drawn: (u32, usize),
    /// The body that this module draws, by its number in the recorder.
    solid: Option<usize>,
    /// Number of sources of gas that this module has drawn.
    sources_drawn: u32,
    /// Number of sheets that this module has placed.
    sheets_drawn: u32,
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
                node: Node::Bare,
                tissue: None,
                rigid: None,
                bent: None,
                stem: None,
                part: None,
            },
            stack: Vec::new(),
            turns: Turns::default(),
            polygons: Vec::new(),
            patches: OpenPatches::default(),
            // Without a declaration, gravity.
            target: tropism.map_or(-Vector::y(), |tropism| Vector::from(tropism.direction)),
            // Replaced before the first command.
            drawn: DrawnModule { kind: KindId::OPEN, lineage: Lineage::of_axiom(0) },
            owner: None,
            start: None,
            names: vec![None; model.kinds.len()],
            inside: None,
            time,
            remarks: Remarks::default(),
            strains: None,
            widest: None,
            recorder: None,
            depth: 0,
            stems_drawn: 0,
            parts_drawn: (0, 0),
            solid: None,
            sources_drawn: 0,
            sheets_drawn: 0,
        }
    }

    /// Bends stems by these strains.
    pub(super) fn bending(self, strains: &'a dyn Strains) -> Walk<'a> {
        Walk { strains: Some(strains), ..self }
    }

    /// Notes the skeleton of what is drawn; the scene must be empty.
    pub(super) fn recording(self) -> Walk<'a> {
        Walk { recorder: Some(Recorder::default()), ..self }
    }

    /// Notes the bodies among what is drawn; the scene must be empty.
    pub(super) fn recording_solids(self) -> Walk<'a> {
        let mut solid_kinds = vec![false; self.model.kinds.len()];
        for (kind, _) in &self.model.scenery.solids {
            solid_kinds[kind.index()] = true;
        }
        Walk { recorder: Some(Recorder { solid_kinds, ..Recorder::default() }), ..self }
    }

    /// Notes the bodies and the shelves among what is drawn; the scene must be empty.
    pub(super) fn recording_bodies(self) -> Walk<'a> {
        let solid_kinds = body::kinds(self.model);
        Walk { recorder: Some(Recorder { solid_kinds, ..Recorder::default() }), ..self }
    }

    /// The bodies and the shelves with their triangles, if they were noted.
    pub(super) fn bodies(self, accuracy: f64) -> Vec<DrawnBody> {
        let Walk { recorder, scene, model, .. } = self;
        recorder.map_or_else(Vec::new, |recorder| recorder.finish_bodies(scene, model, accuracy))
    }

    /// The bodies, if they were noted.
    pub(super) fn solids(self) -> Vec<SolidBody> {
        self.recorder.map_or_else(Vec::new, |recorder| recorder.finish_solids(self.scene))
    }

    /// The skeleton, if it was noted.
    pub(super) fn skeleton(self) -> Skeleton {
        self.recorder.map_or_else(Skeleton::default, |recorder| recorder.finish(self.scene))
    }

    /// The free parts, if they were noted.
    pub(super) fn free_parts(self) -> Vec<FreePart> {
        self.recorder.map_or_else(Vec::new, |recorder| recorder.finish_parts(self.scene))
    }

    pub(super) fn pose(&mut self) -> Pose {
        Pose { position: self.seen(self.state.position), axes: self.seen_axes() }
    }

    /// Sets the module for which the next commands are.
    pub(super) fn set_drawn(&mut self, module: DrawnModule) {
        self.drawn = module;
        self.owner = None;
        (self.depth, self.stems_drawn) = (self.stack.len(), 0);
        (self.parts_drawn.0, self.sources_drawn, self.sheets_drawn) = (0, 0, 0);
        self.solid = None;
        if let Some(recorder) = &mut self.recorder
            && recorder.solid_kinds.get(module.kind.index()) == Some(&true)
        {
            let origin = Origin::new(module.kind, module.lineage);
            recorder.solids.push(SolidBody { origin, points: Vec::new(), passive: None });
            self.solid = Some(recorder.solids.len() - 1);
        }
        if self.scene.notes_poses {
            self.start = Some(self.pose());
        }
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

    /// Notes that the body that is being drawn, if there is one, is passive.
    fn note_passive(&mut self, passive: Passive) {
        if let (Some(recorder), Some(solid)) = (&mut self.recorder, self.solid) {
            recorder.solids[solid].passive.get_or_insert(passive);
        }
    }

    /// Ends the string: reports polygons that are still open.
    pub(super) fn finish(&mut self) {
        if let Some(open) = self.polygons.pop() {
            (self.inside, self.drawn) = open.begun;
            self.remark(Remark::PolygonNotClosed);
        }
        if let Some((width, (inside, drawn))) = self.widest
            && self.scene.segments.len() >= FEW
        {
            let span = error::place(self.model, drawn.kind, drawn.lineage, inside);
            self.scene.widest = span.map(|span| Widest { width, span, time: self.time });
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
            Command::Elastic => self.set_tissue(given.unwrap_or(0.0)),
            Command::Contour => self.set_contour(given.unwrap_or(0.0).round()),
            Command::Color => {
                if let Some(number) = given {
                    self.check_color(number.round(), read.len() > 1);
                }
                self.state.color = match given {
                    Some(number) => (number, read.get(1).copied().unwrap_or(0.0)),
                    None => (self.state.color.0 + 1.0, 0.0),
                };
                if given.is_none() {
                    self.check_next_color();
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
                    if self.state.node == Node::Bare {
                        self.state.node = Node::Branch;
                    }
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
            Command::Plant(plant) => self.plant(plant, read)?,
            Command::Sheet(sheet) => self.drape(sheet)?,
            Command::Source => self.let_out(read)?,
            Command::Detach => self.let_go(),
            Command::Ground => self.set_down(),
            Command::BeginPatch | Command::ControlPoint | Command::DrawPatch => self.patch(command, read)?,
        }
        Ok(())
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

    /// Sets the tissue of the stems that follow; 0, and the number of no tissue, is rigid.
    fn set_tissue(&mut self, number: f64) {
        let count = self.model.scenery.tissues.len();
        let number = number.round();
        if number != 0.0 && !(1.0..=count as f64).contains(&number) {
            self.remark(Remark::NoTissue(number, count));
        }
        self.state.rigid = self.state.tissue.or(self.state.rigid);
        self.state.tissue = (1.0..=count as f64).contains(&number).then(|| number as usize - 1);
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

    /// A length, or another measure, as it is drawn: what is too small to be told from nothing is nothing.
    fn in_range(&self, x: f64) -> Result<f64, Error> {
        if x.abs() < SMALLEST_LENGTH {
            return Ok(0.0);
        }
        if x.abs() <= COORDINATE_LIMIT { Ok(x) } else { Err(self.error(ErrorKind::TooFar)) }
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

    /// Warns if the next colour is that behind the last one.
    fn check_next_color(&mut self) {
        let count: usize = self.scene.palette.counts().iter().sum();
        let number = self.state.color.0.round();
        if number > count as f64 {
            self.remark(Remark::NoNextColor(number, count));
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
        self.scene.poses.extend(self.start);
        *self.owner.insert(self.scene.add_owner(Owner { name, lineage }))
    }
}
