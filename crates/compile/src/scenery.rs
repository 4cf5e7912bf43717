//! The declarations of a scene: plants of other models, light, sky, camera and floor; wind and tissues are in `physics.rs`, sheets in `sheets.rs`.
//! From the syntax tree to the model.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::air::Air;
use crate::appearance::color;
use crate::land::Land;
use crate::scope::{Scope, Variables};
use crate::{Setting, advice, load_nested};
use dlsys_diagnostic::{Diagnostic, Severity, Source, Span};
use dlsys_expr::{NodeId, Program};
use dlsys_model::{Appearance, COMMAND_SURFACES, Camera, Plant, Scenery};
use dlsys_syntax::Files;
use dlsys_syntax::ast::{Document, Expression, Item, Name, Text};
use dlsys_syntax::fault_of_path;

/// Maximum depth of plants in plants.
const MAX_DEPTH: usize = 8;
/// Maximum number of models that one model reads for its plants, and these for theirs.
const MAX_MODELS: usize = 200;

/// The beginning of messages about models of plants.
const UNREADABLE: &str = "the plant";

/// The models around the one that is being read: the paths of those that it is a plant of, and the number of models so far.
#[derive(Default)]
pub(crate) struct Nesting<'n> {
    chain: Vec<PathBuf>,
    models: Option<&'n Cell<usize>>,
}

/// The files of a plant's model: paths begin at its own folder, which is below that of the model around it.
struct Below<'f> {
    files: &'f dyn Files,
    folder: PathBuf,
}

impl Files for Below<'_> {
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, String> {
        self.files.read(&self.folder.join(path), limit)
    }
}

/// Builds the scenery from the declarations of a document. Errors are added to the scope.
pub(crate) fn build(
    document: &Document,
    appearance: &Appearance,
    scope: &mut Scope,
    files: &dyn Files,
    nesting: &Nesting,
) -> Scenery {
    let (scenery, seen) = (Scenery::default(), Vec::new());
    let mut builder = Builder { document, scope, files, scenery, seen, speed: None, flows: Vec::new() };
    // Ground and what is poured name soils that may be declared behind them.
    for (item, span) in &document.items {
        if let Item::Soil { name, attributes, colors } = item {
            builder.soil(name, (attributes, colors), *span);
        }
    }
    for (item, span) in &document.items {
        match item {
            Item::Plant { name, file, settings } => {
                builder.plant((name, file, settings), *span, appearance, nesting)
            }
            Item::Ground { height, color: of_floor } => {
                builder.once("ground", *span);
                builder.scenery.ground = builder.height(*height);
                builder.scenery.ground_color = of_floor.as_ref().and_then(|text| color(text, builder.scope));
            }
            Item::Bed { soil, file, attributes, textures } => {
                builder.once("ground", *span);
                builder.bed((soil, file.as_ref()), (attributes, textures), appearance, *span);
            }
            Item::Pour { soil, attributes } => builder.pour(soil, attributes, *span),
            Item::Light(direction) => {
                builder.once("light", *span);
                let program = builder.of_time(direction);
                builder.scenery.light = program.map(|program| (program, *span));
            }
            Item::Sky(colors) => {
                builder.once("sky", *span);
                let [zenith, horizon] = colors.each_ref().map(|text| color(text, builder.scope));
                builder.scenery.sky = zenith.zip(horizon).map(|(zenith, horizon)| [zenith, horizon]);
            }
            Item::Camera { eye, aim, angle } => {
                builder.once("camera", *span);
                builder.camera(eye, aim, *angle, *span);
            }
            Item::Units(attributes) => {
                builder.once("units", *span);
                builder.units(attributes);
            }
            Item::Wind { direction, attributes } => {
                builder.once("wind", *span);
                builder.wind(direction, attributes, *span);
            }
            Item::Flow { kind, attributes } => builder.flow(kind, attributes, *span),
            Item::Tissue { name, attributes } => builder.tissue(name, attributes, *span),
            Item::Gas { name, attributes, colors } => builder.gas(name, (attributes, colors), *span),
            _ => {}
        }
    }
    builder.end_soils();
    // They name tissues, which may stand behind them.
    for (item, span) in &document.items {
        if let Item::Sheet { name, file, tissue, pinned } = item {
            builder.sheet((name, file, tissue, *pinned), *span, appearance);
        }
    }
    let Builder { scenery, speed, flows, scope, .. } = builder;
    scope.air = Air::new(&scenery, speed, flows, &mut scope.graph);
    scope.land = Land::new(&scenery);
    scenery
}

/// The scenery so far, and what its declarations are compiled with.
pub(crate) struct Builder<'b> {
    pub(crate) document: &'b Document,
    pub(crate) scope: &'b mut Scope,
    pub(crate) files: &'b dyn Files,
    pub(crate) scenery: Scenery,
    /// Declarations that may stand once, with their places.
    seen: Vec<(&'static str, Span)>,
    /// The speed of the wind, and the values of its flows, as expressions of `t`.
    pub(crate) speed: Option<NodeId>,
    pub(crate) flows: Vec<Vec<NodeId>>,
}

impl Builder<'_> {
    fn once(&mut self, what: &'static str, span: Span) {
        if let Some((_, before)) = self.seen.iter().find(|(known, _)| *known == what) {
            let twice = advice::given_twice(&format!("`{what}`"), [*before, span]);
            self.scope.diagnostics.push(twice);
        }
        self.seen.push((what, span));
    }

    /// A program over `t`.
    pub(crate) fn of_time(&mut self, expressions: &[Expression]) -> Option<Program> {
        let roots = self.nodes_of_time(expressions)?;
        Some(Program::compile(&self.scope.graph, &roots, 1))
    }

    /// Expressions of `t`.
    pub(crate) fn nodes_of_time(&mut self, expressions: &[Expression]) -> Option<Vec<NodeId>> {
        let no_age = "a scene has no age; `t` is the time";
        let mut variables = Variables { no_time: Some(no_age), ..Variables::default() };
        variables.names.insert("t".into(), self.scope.graph.var(0));
        let all = &self.document.expressions;
        let mut roots = Vec::new();
        for expression in expressions {
            let root = self.scope.number(all, *expression, &variables)?;
            if let Some(value) = self.scope.graph.as_constant(root).filter(|value| !value.is_finite()) {
                self.scope.diagnostics.push(
                    Diagnostic::error("this has no finite value")
                        .at(all.span(expression.root), format!("it is {value}"))
                        .help(advice::not_finite(value)),
                );
                return None;
            }
            roots.push(root);
        }
        Some(roots)
    }

    fn camera(
        &mut self,
        eye: &[Expression; 3],
        aim: &[Expression; 3],
        angle: Option<Expression>,
        span: Span,
    ) {
        let mut all: Vec<Expression> = eye.iter().chain(aim).copied().collect();
        all.extend(angle);
        let Some(program) = self.of_time(&all) else { return };
        if let Some(values) = program.constants() {
            let [least, greatest] = Camera::ANGLES;
            if values[..3] == values[3..6] {
                let same = Diagnostic::error("the camera looks at the point where it stands")
                    .at(span, "no direction follows from this")
                    .help("for example `camera at 0, 1, 5 towards 0, 1, 0`");
                self.scope.diagnostics.push(same);
            }
            if let (Some(angle), Some(value)) = (angle, values.get(6))
                && !(least..=greatest).contains(value)
            {
                let wrong = Diagnostic::error("this is no angle of view")
                    .at(self.document.expressions.span(angle.root), format!("it is {value} degrees"))
                    .help(format!(
                        "it is an angle from {least} to {greatest} degrees; {} without it",
                        Camera::ANGLE
                    ));
                self.scope.diagnostics.push(wrong);
            }
        }
        self.scenery.camera = Some(Camera { program, span });
    }

    fn plant(
        &mut self,
        (name, file, settings): (&Name, &Text, &[(Name, Expression)]),
        span: Span,
        appearance: &Appearance,
        nesting: &Nesting,
    ) {
        if COMMAND_SURFACES.iter().any(|(command, _)| *command == &*name.text) {
            self.scope.diagnostics.push(
                Diagnostic::error(format!("`{}` cannot be a plant", name.text))
                    .at(name.span, "this name is a command of the turtle")
                    .help("choose another name"),
            );
            return;
        }
        let plants = self.scenery.plants.iter().map(|plant| (&plant.name, plant.span));
        let surfaces = appearance.surfaces.iter().map(|shape| (&shape.name, shape.span));
        if let Some((_, before)) = { plants }.chain(surfaces).find(|(known, _)| **known == *name.text) {
            self.scope.diagnostics.push(
                Diagnostic::error(format!("`{}` is declared twice", name.text))
                    .at(name.span, "the second time")
                    .at(before, "the first time")
                    .help(advice::twice(&name.text)),
            );
            return;
        }
        let all = &self.document.expressions;
        let mut values = Vec::new();
        for (name, value) in settings {
            let Some(value) = self.scope.constant_value(all, *value) else { return };
            values.push(Setting { name: name.text.to_string(), value });
        }
        match self.read(name, file, (settings, &values), nesting) {
            Ok((model, source)) => {
                let is_random = model.is_random();
                let plant = Plant { name: name.text.to_string(), model, source, span, is_random };
                self.scenery.plants.push(Arc::new(plant));
            }
            Err(error) => {
                self.scope.diagnostics.push(*error);
                // The name counts as declared in spite of the error.
                let (model, source) = (dlsys_model::Model::default(), Source::new("", ""));
                let plant = Plant { name: name.text.to_string(), model, source, span, is_random: false };
                self.scenery.plants.push(Arc::new(plant));
            }
        }
    }

    /// Reads and compiles the model of a plant.
    fn read(
        &self,
        name: &Name,
        file: &Text,
        (written, values): (&[(Name, Expression)], &[Setting]),
        nesting: &Nesting,
    ) -> Result<(dlsys_model::Model, Source), Box<Diagnostic>> {
        let fault = |what: String| {
            Diagnostic::error(format!("{UNREADABLE} `{}` cannot be read", name.text)).at(file.span, what)
        };
        if let Some(why) = fault_of_path(&file.text) {
            return Err(Box::new(fault(why.to_owned()).help(
                "models of plants stand in the folder of this model or below it, and their paths begin there",
            )));
        }
        let path: PathBuf = Path::new(&file.text).components().collect();
        let here = nesting.chain.last().and_then(|around| around.parent()).unwrap_or(Path::new(""));
        let full = here.join(&path);
        if nesting.chain.contains(&full) {
            let what = format!("`{}` is a plant of itself", file.text);
            return Err(Box::new(fault(what).help("parts that repeat within one plant belong in its rules")));
        }
        let count = Cell::new(0);
        let models = nesting.models.unwrap_or(&count);
        models.set(models.get() + 1);
        if nesting.chain.len() >= MAX_DEPTH || models.get() > MAX_MODELS {
            let what =
                format!("plants in plants: more than {MAX_DEPTH} deep, or more than {MAX_MODELS} models");
            return Err(Box::new(
                fault(what).help("a plant that several models have is drawn by the outermost one"),
            ));
        }
        let bytes = self.files.read(&path, Source::LIMIT as u64).map_err(|why| {
            fault(why).help("the path begins at the folder of this model: `plant @Grass from \"grass.dls\"`")
        })?;
        let source = Source::from_bytes(file.text.clone(), bytes)
            .map_err(|bad| fault(bad.diagnostic.message).help("save the file as UTF-8"))?;
        let chain = nesting.chain.iter().cloned().chain([full]).collect();
        let below = Below { files: self.files, folder: path.parent().unwrap_or(Path::new("")).to_owned() };
        let loaded = load_nested(&source, values, &below, &Nesting { chain, models: Some(models) });
        let source = loaded.source.unwrap_or(source);
        let Some(model) = loaded.model else {
            let error = loaded.diagnostics.iter().find(|d| d.severity == Severity::Error);
            return Err(Box::new(match (error, loaded.refused_settings.first()) {
                (Some(error), _) => fault(format!("in line {}", line_of(error, &source)))
                    .note(first_line(error, &source))
                    .help(format!("`dlsys check {}` shows all its errors", file.text)),
                (None, Some(refused)) => {
                    let about = |name: &&(Name, Expression)| refused.message.contains(&*name.0.text);
                    let span = written.iter().find(about).map_or(file.span, |(name, _)| name.span);
                    let mut error = Diagnostic::error(format!("`{}` refuses a value", file.text))
                        .at(span, refused.message.clone());
                    error.help.clone_from(&refused.help);
                    error.help("the params of a model are listed by `dlsys explain`")
                }
                (None, None) => fault("it has errors".to_owned()),
            }));
        };
        Ok((model, source))
    }
}

/// The line of an error in the text of a plant's model.
fn line_of(error: &Diagnostic, source: &Source) -> usize {
    let at = error.labels.first().map_or(0, |(span, _)| span.start as usize);
    source.text[..at.min(source.text.len())].matches('\n').count() + 1
}

/// An error of a plant's model in one line; the error of a plant in that goes down to its cause.
fn first_line(error: &Diagnostic, source: &Source) -> String {
    if let Some(cause) = error.notes.first().filter(|_| error.message.starts_with(UNREADABLE)) {
        return cause.clone();
    }
    let label = error.labels.first().map_or(String::new(), |(_, text)| format!(": {text}"));
    format!("{}:{}: {}{label}", source.name, line_of(error, source), error.message)
}

/// Warns of plants that no string contains.
pub fn unused_plants(scenery: &Scenery, is_used: impl Fn(&str) -> bool, scope: &mut Scope) {
    for plant in scenery.plants.iter().filter(|plant| !is_used(&plant.name)) {
        scope.diagnostics.push(
            Diagnostic::warning(format!("the plant `{}` is not used", plant.name))
                .at(plant.span, "declared here")
                .help(format!("draw it: `{}(0)` in a string, or remove this line", plant.name)),
        );
    }
}
