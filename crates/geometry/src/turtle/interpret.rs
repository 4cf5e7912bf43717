//! Interpretations: what is drawn in place of a module.
//!
//! The nesting of interpretations is kept on a stack of its own, and their modules and arguments in one array each, so that
//! depth costs memory by the level and nothing by the module.

use super::body::DrawnBody;
use super::command::Command;
use super::free::{FreePart, SolidBody};
use super::prepare::prepare;
use super::skeleton::Skeleton;
use super::surroundings::surroundings;
use super::walk::{DrawnModule, Walk};
use super::{DEPTH_LIMIT, Error, ErrorKind, Pose, Strains};
use crate::scene::Scene;
use dlsys_expr::Scratch;
use dlsys_model::{BadBounds, KindId, Model, Stretch};
use dlsys_tree::{Module, ModuleString};

/// Why the string of an interpretation cannot be made.
enum Unexpanded {
    TooMany,
    Bounds(BadBounds),
}

impl From<BadBounds> for Unexpanded {
    fn from(bad: BadBounds) -> Unexpanded {
        Unexpanded::Bounds(bad)
    }
}

/// An interpretation being drawn.
struct Level {
    /// The interpretation.
    index: usize,
    /// Where its modules begin in the array of modules, and the next one.
    first_kind: usize,
    next_kind: usize,
    /// Where the array of modules ends for this level.
    end: usize,
    /// Where in the array of arguments those of this level begin, and those of its next module.
    first: usize,
    next: usize,
}

/// See [`super::trace`].
pub(super) fn trace(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<Pose, Error> {
    begin(model, string, scene)?;
    let mut walk = Walk::new(model, scene, string.time);
    run(model, string, &mut walk)?;
    Ok(walk.pose())
}

/// See [`super::draw_bent`].
pub(super) fn bent(
    model: &Model,
    string: &ModuleString,
    strains: &dyn Strains,
    scene: &mut Scene,
) -> Result<(), Error> {
    begin(model, string, scene)?;
    run(model, string, &mut Walk::new(model, scene, string.time).bending(strains))
}

/// See [`super::skeleton`].
pub(super) fn skeleton(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<Skeleton, Error> {
    scene.clear();
    prepare(model, scene);
    let mut walk = Walk::new(model, scene, string.time).recording();
    run(model, string, &mut walk)?;
    Ok(walk.skeleton())
}

/// See [`super::free_parts`].
pub(super) fn free_parts(
    model: &Model,
    string: &ModuleString,
    strains: &dyn Strains,
    scene: &mut Scene,
) -> Result<Vec<FreePart>, Error> {
    scene.clear();
    prepare(model, scene);
    let mut walk = Walk::new(model, scene, string.time).bending(strains).recording();
    run(model, string, &mut walk)?;
    Ok(walk.free_parts())
}

/// See [`super::solids`].
pub(super) fn solids(
    model: &Model,
    string: &ModuleString,
    scene: &mut Scene,
) -> Result<Vec<SolidBody>, Error> {
    scene.clear();
    prepare(model, scene);
    let mut walk = Walk::new(model, scene, string.time).recording_solids();
    run(model, string, &mut walk)?;
    Ok(walk.solids())
}

/// See [`super::bodies`].
pub(super) fn bodies(
    model: &Model,
    string: &ModuleString,
    strains: Option<&dyn Strains>,
    accuracy: f64,
    scene: &mut Scene,
) -> Result<Vec<DrawnBody>, Error> {
    scene.clear();
    prepare(model, scene);
    let mut walk = Walk::new(model, scene, string.time);
    if let Some(strains) = strains {
        walk = walk.bending(strains);
    }
    let mut walk = walk.recording_bodies();
    run(model, string, &mut walk)?;
    Ok(walk.bodies(accuracy))
}

fn begin(model: &Model, string: &ModuleString, scene: &mut Scene) -> Result<(), Error> {
    prepare(model, scene);
    scene.surroundings = surroundings(model, string.time)?;
    Ok(())
}

/// Walks through a string.
fn run(model: &Model, string: &ModuleString, walk: &mut Walk<'_>) -> Result<(), Error> {
    let commands = Command::table(model);
    let mut expander = Expander::new(model, &commands, string);
    for module in string.iter() {
        walk.set_drawn(DrawnModule { kind: module.kind, lineage: module.lineage });
        match commands[module.kind.index()] {
            Command::Interpret(index) => expander.expand(index, module, walk)?,
            command => walk.obey(command, module.parameters, module.kind)?,
        }
    }
    walk.finish();
    Ok(())
}

struct Expander<'a> {
    model: &'a Model,
    commands: &'a [Command],
    time: f64,
    /// Modules of the frame so far, those of the string included; how many the string has, and how many there may be.
    drawn: usize,
    in_string: usize,
    limit: usize,
    levels: Vec<Level>,
    kinds: Vec<KindId>,
    arguments: Vec<f64>,
    variables: Vec<f64>,
    scratch: Vec<f64>,
}

impl<'a> Expander<'a> {
    fn new(model: &'a Model, commands: &'a [Command], string: &ModuleString) -> Expander<'a> {
        Expander {
            model,
            commands,
            time: string.time,
            drawn: string.len(),
            in_string: string.len(),
            limit: string.drawn_limit(),
            levels: Vec::new(),
            kinds: Vec::new(),
            arguments: Vec::new(),
            variables: Vec::new(),
            scratch: Vec::new(),
        }
    }

    /// Draws a module's interpretation, and what that is interpreted as in turn.
    fn expand(&mut self, index: usize, module: Module<'_>, walk: &mut Walk<'_>) -> Result<(), Error> {
        self.levels.clear();
        self.kinds.clear();
        self.arguments.clear();
        self.variables.clear();
        self.variables.extend_from_slice(module.parameters);
        self.enter(index, module.age, walk)?;
        while let Some(level) = self.levels.last_mut() {
            if level.next_kind == level.end {
                self.arguments.truncate(level.first);
                self.kinds.truncate(level.first_kind);
                self.levels.pop();
                continue;
            }
            let kind = self.kinds[level.next_kind];
            level.next_kind += 1;
            let arity = self.model.kinds.get(kind).arity;
            walk.inside = Some((level.index, kind));
            let from = level.next;
            level.next += arity;
            self.drawn += 1;
            if self.drawn > self.limit {
                return Err(self.too_many(walk));
            }
            match self.commands[kind.index()] {
                Command::Interpret(index) if !self.levels.iter().any(|level| level.index == index) => {
                    if self.levels.len() >= DEPTH_LIMIT {
                        return Err(walk.error(ErrorKind::TooDeep));
                    }
                    self.variables.clear();
                    self.variables.extend_from_slice(&self.arguments[from..from + arity]);
                    self.enter(index, module.age, walk)?;
                }
                // Inside its own drawing a module is what its name says: `interpret F(x): !(0.1) F(x)`.
                Command::Interpret(_) => {
                    let plain = Command::plain(self.model.kinds.get(kind), self.model);
                    walk.obey(plain, &self.arguments[from..from + arity], kind)?;
                }
                command => walk.obey(command, &self.arguments[from..from + arity], kind)?,
            }
        }
        walk.inside = None;
        Ok(())
    }

    fn too_many(&self, walk: &Walk<'_>) -> Error {
        walk.error(ErrorKind::TooMany { limit: self.limit, in_string: self.in_string })
    }

    /// Begins an interpretation; `variables` holds the parameters of the module that it stands for.
    fn enter(&mut self, index: usize, age: f64, walk: &mut Walk<'_>) -> Result<(), Error> {
        let (first, first_kind) = (self.arguments.len(), self.kinds.len());
        let (kinds, arguments, drawn) = (&mut self.kinds, &mut self.arguments, self.drawn);
        let limit = self.limit;
        self.variables.extend([self.time, age]);
        let mut add = |stretch: &Stretch, variables: &mut Vec<f64>, scratch: &mut Scratch<f64>| {
            if drawn + kinds.len() + stretch.kinds.len() > limit {
                return Err(Unexpanded::TooMany);
            }
            kinds.extend_from_slice(&stretch.kinds);
            stretch.evaluate(variables, scratch, arguments);
            Ok(())
        };
        let drawing = &self.model.interpretations[index].drawn;
        match drawing.expand(&mut self.variables, &mut self.scratch, &mut add) {
            Ok(()) => {
                let (next_kind, end) = (first_kind, self.kinds.len());
                self.levels.push(Level { index, first_kind, next_kind, end, first, next: first });
                Ok(())
            }
            Err(Unexpanded::TooMany) => Err(self.too_many(walk)),
            Err(Unexpanded::Bounds(BadBounds { span, why })) => {
                Err(Error { span: Some(span), ..walk.error(ErrorKind::BadBounds { why }) })
            }
        }
    }
}
