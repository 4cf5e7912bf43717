//! From a document to a model: each declaration and rule, then the passes over all of them.
//!
//! ```text
//! globals, appearance ─▶ items ─▶ kinds ─▶ contexts ─▶ analysis ─▶ Model ─▶ checks
//! ```

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::analysis::{Analysed, analyse};
use crate::chance::Clocks;
use crate::clauses::names_of;
use crate::declared::DeclaredRule;
use crate::inputs::{self, Inputs};
use crate::rules::RuleBuilder;
use crate::scene_checks::MaterialNumber;
use crate::scenery::Nesting;
use crate::scope::{Scope, Variables};
use crate::{
    Setting, appearance, check, contexts, coverage, dead_rules, globals, porting, scene_checks, scenery,
    sheets,
};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{
    Appearance, DRAWN_WORDS, Frames, Interpretation, KindId, Kinds, Model, Parameter, Scenery, Successor,
};
use dlsys_syntax::Files;
use dlsys_syntax::ast::{self, Action, Document, Expression, HeadModule, Item};

/// The description of the axiom in messages.
const INITIAL_STRING: &str = "the initial string";

/// Builds the model; errors are added to the scope. `unread` is true if items of the text could not be parsed; checks
/// whose results might depend on these items are then omitted.
pub fn build(
    document: &Document,
    settings: &[Setting],
    scope: &mut Scope,
    unread: bool,
    (files, nesting): (&dyn Files, &Nesting),
) -> Option<Model> {
    let parameters = globals::declare(document, settings, scope, files);
    let appearance = appearance::build(document, scope, files);
    let scenery = scenery::build(document, &appearance, scope, files, nesting);
    let mut kinds = Kinds::default();
    let hidden = (Clocks::new(document), Inputs::new(document, scope));
    let mut builder = RuleBuilder::new(document, scope, &mut kinds, hidden);
    let mut parts = Parts::default();
    for (item, span) in &document.items {
        parts.item(item, *span, &mut builder);
    }
    parts.check_strings(&mut builder, unread);
    porting::comments(document, &mut builder.scope.diagnostics);
    porting::strays(document, &mut builder.scope.diagnostics);
    let RuleBuilder { occurs, drawn, clocks, inputs, materials, .. } = builder;
    if !parts.singles.seen(INITIAL_STRING) && !unread {
        scope.diagnostics.push(
            Diagnostic::error("the model has no initial string")
                .help("begin with one, such as `initial string: F(1)`"),
        );
    }
    if scope.diagnostics.is_empty() && !unread {
        unused(document, scope);
        let is_used = |name: &str| kinds.iter().any(|(_, kind)| kind.name == name);
        appearance::unused_surfaces(&appearance, is_used, scope);
        scenery::unused_plants(&scenery, is_used, scope);
        sheets::unused(&scenery, is_used, scope);
    }
    if parts.faulty || unread {
        return None;
    }
    let places = Places { occurs, drawn, materials };
    let mut looks = Looks { parameters, appearance, scenery };
    if let Some(air) = &scope.air {
        looks.scenery.flow_reader = air.read;
        looks.scenery.eddies = air.slot();
    }
    looks.scenery.heights = scope.land.slot();
    Some(parts.model(document, kinds, (&clocks, &inputs), &places, looks, scope))
}

/// Declarations that were lowered before the rules.
struct Looks {
    parameters: Vec<Parameter>,
    appearance: Appearance,
    scenery: Scenery,
}

/// The first place of each kind of module in strings and in drawings, and the tissues and gases that strings name.
struct Places {
    occurs: FxHashMap<KindId, Span>,
    drawn: FxHashMap<KindId, Span>,
    materials: Vec<MaterialNumber>,
}

/// The declarations and rules that have been lowered.
#[derive(Default)]
struct Parts<'d> {
    singles: Singles,
    title: Option<String>,
    angle: Option<f64>,
    frames: Option<Frames>,
    period: Option<(f64, Span)>,
    ignored: Vec<&'d ast::Name>,
    considered: Vec<&'d ast::Name>,
    solid: Vec<&'d ast::Name>,
    shelf: Vec<&'d ast::Name>,
    axiom: Successor,
    axiom_span: Span,
    rules: Vec<DeclaredRule>,
    /// The rules as written, including those with errors.
    written: Vec<&'d ast::Rule>,
    interpretations: Vec<(KindId, Interpretation)>,
    /// The heads of the interpretations.
    heads: Vec<&'d HeadModule>,
    /// The axiom and all successors.
    strings: Vec<&'d [ast::Part]>,
    drawings: Vec<&'d [ast::Part]>,
    /// True if a string or a rule could not be lowered.
    faulty: bool,
}

impl<'d> Parts<'d> {
    fn item(&mut self, item: &'d Item, span: Span, builder: &mut RuleBuilder) {
        match item {
            Item::Title(text) => {
                self.singles.once("title", span, builder.scope);
                check_title(text, span, builder.scope);
                self.title = Some(text.clone());
            }
            Item::Angle(value) => {
                self.singles.once("angle", span, builder.scope);
                self.angle = builder.constant(*value);
            }
            Item::Period(value) => {
                self.singles.once("period", span, builder.scope);
                self.period = Some((builder.constant(*value).unwrap_or(1.0), span));
            }
            Item::Frames { from, to, step } => self.frames([*from, *to, *step], span, builder),
            Item::Ignore(names) => self.ignored.extend(names),
            Item::Consider(names) => self.considered.extend(names),
            Item::Solid(names) => self.solid.extend(names),
            Item::Shelf(names) => self.shelf.extend(names),
            Item::Axiom(modules) => self.axiom(modules, span, builder),
            Item::Interpret { head, drawn } => {
                self.heads.push(head);
                self.drawings.push(&drawn[..]);
                match builder.interpretation(head, drawn) {
                    Some(interpretation) => self.interpretations.push(interpretation),
                    None => self.faulty = true,
                }
            }
            Item::Rule(rule) => self.rule(rule, builder),
            // Globals and appearance have been declared before.
            _ => {}
        }
    }

    fn frames(&mut self, written: [Expression; 3], span: Span, builder: &mut RuleBuilder) {
        self.singles.once("frames", span, builder.scope);
        if let [Some(from), Some(to), Some(step)] = written.map(|e| builder.constant(e)) {
            let frames = Frames { from, to, step };
            check_frames(&frames, span, builder.scope);
            self.frames = Some(frames);
        }
    }

    fn axiom(&mut self, modules: &'d [ast::Part], span: Span, builder: &mut RuleBuilder) {
        self.singles.once(INITIAL_STRING, span, builder.scope);
        self.strings.push(modules);
        let variables =
            Variables { no_time: Some("the initial string is made at t = 0"), ..Variables::default() };
        self.axiom_span = span;
        match builder.successor(modules, &variables, 0) {
            Some(axiom) => self.axiom = axiom,
            None => self.faulty = true,
        }
    }

    fn rule(&mut self, rule: &'d ast::Rule, builder: &mut RuleBuilder) {
        for clause in &rule.clauses {
            if let Action::Produce(successors) = &clause.action {
                self.strings.extend(successors.iter().map(|s| &s.modules[..]));
            }
        }
        self.written.push(rule);
        match builder.rule(rule, self.rules.len()) {
            Some(declared) => self.rules.push(declared),
            None => self.faulty = true,
        }
    }

    /// Checks numbers of parameters in strings and drawings. Heads of words that the turtle interprets are exempt: in a
    /// drawing, `F(x)` is a line even if `F` with other parameters has a drawing.
    fn check_strings(&self, builder: &mut RuleBuilder, unread: bool) {
        let ruled: Vec<&HeadModule> = self.written.iter().map(|rule| &rule.predecessor).collect();
        builder.check_arities(&ruled, &self.strings, "in its rule");
        let is_drawn = |head: &&HeadModule| !DRAWN_WORDS.contains(&&*head.name.text);
        let drawn: Vec<&HeadModule> = self.heads.iter().copied().filter(is_drawn).collect();
        builder.check_arities(&drawn, &self.drawings, "where it is drawn");
        if !unread {
            builder.check_interpretations(&self.heads);
        }
    }

    /// Compiles and checks the model.
    fn model(
        self,
        document: &Document,
        mut kinds: Kinds,
        (clocks, inputs): (&Clocks, &Inputs),
        places: &Places,
        looks: Looks,
        scope: &mut Scope,
    ) -> Model {
        let has_axiom = self.singles.seen(INITIAL_STRING);
        for (i, rule) in self.written.iter().enumerate() {
            for name in names_of(rule) {
                let kind = kinds.intern(&name, rule.predecessor.parameters.len());
                let kind = kinds.get_mut(kind);
                if rule.discrete { &mut kind.steps } else { &mut kind.rules }.push(i);
            }
        }
        clocks.assign(&mut kinds);
        inputs.assign(&mut kinds);
        let diagnostics = &mut scope.diagnostics;
        let interpretations = assign_interpretations(self.interpretations, &mut kinds, diagnostics);
        contexts::filter(&mut kinds, &self.ignored, &self.considered, diagnostics);
        let solids = contexts::bodies(&kinds, &self.solid, diagnostics);
        let shelves = contexts::bodies(&kinds, &self.shelf, diagnostics);
        let rules = contexts::resolve_all(&kinds, self.rules, diagnostics);
        let Analysed { rules, drawn_only } = analyse(&mut scope.graph, &kinds, rules);
        let model = Model {
            title: self.title,
            angle: self.angle.unwrap_or(90.0),
            frames: self.frames,
            period: self.period.map_or(1.0, |(period, _)| period),
            parameters: looks.parameters,
            kinds,
            axiom: self.axiom,
            axiom_span: self.axiom_span,
            rules,
            interpretations,
            appearance: Arc::new(looks.appearance),
            scenery: Scenery { solids, shelves, ..looks.scenery },
            drawn_only,
            curves: scope.graph.curves().to_vec(),
        };
        let Places { occurs, drawn, .. } = places;
        if has_axiom {
            check::reachability(&model, &self.written, occurs, diagnostics);
        }
        check::period(self.period, &model, diagnostics);
        inputs::check(&model, inputs, diagnostics);
        coverage::coverage(&model, diagnostics);
        dead_rules::rules(&model, &self.written, document, diagnostics);
        check::inert_modules(&model, occurs, drawn, diagnostics);
        porting::strings(document, &self.written, diagnostics);
        porting::drawn_words(&model, drawn, diagnostics);
        let all = drawn.iter().chain(occurs).map(|(k, s)| (*k, *s)).collect();
        scene_checks::ground(&model, &all, diagnostics);
        scene_checks::detach(&model, &all, diagnostics);
        scene_checks::tissues(&model, &all, &places.materials, diagnostics);
        scene_checks::gases(&model, &all, &places.materials, diagnostics);
        scene_checks::gases_of_plants(&model, diagnostics);
        scene_checks::units_of_plants(&model, diagnostics);
        scene_checks::soil(&model, diagnostics);
        scene_checks::plants_as_bodies(&model, diagnostics);
        sheets::modules(&model, &all, diagnostics);
        scene_checks::solids(&model, occurs, drawn, diagnostics);
        check::commands(&model, diagnostics, &all);
        check::surface_sizes(&model, diagnostics, &all);
        model
    }
}

/// Assigns to each kind its drawing.
fn assign_interpretations(
    interpretations: Vec<(KindId, Interpretation)>,
    kinds: &mut Kinds,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Interpretation> {
    let mut all: Vec<Interpretation> = Vec::with_capacity(interpretations.len());
    for (kind, interpretation) in interpretations {
        if let Some(before) = kinds.get(kind).interpretation {
            diagnostics.push(
                Diagnostic::error("two interpretations of one module")
                    .at(interpretation.span, "the second one")
                    .at(all[before].span, "the first one")
                    .help("keep one of them; what both draw can stand in one string"),
            );
        }
        kinds.get_mut(kind).interpretation = Some(all.len());
        all.push(interpretation);
    }
    all
}

fn check_title(text: &str, span: Span, scope: &mut Scope) {
    if text.chars().any(char::is_control) {
        let error =
            Diagnostic::error("a title has no control characters").at(span, "it is shown in terminals");
        scope.diagnostics.push(error.help("write the title in letters; a line break ends it"));
    }
}

/// Declarations that a model may have only once.
#[derive(Default)]
struct Singles(Vec<(&'static str, Span)>);

impl Singles {
    fn seen(&self, what: &str) -> bool {
        self.0.iter().any(|(name, _)| *name == what)
    }

    fn once(&mut self, what: &'static str, span: Span, scope: &mut Scope) {
        if let Some((_, before)) = self.0.iter().find(|(name, _)| *name == what) {
            scope.diagnostics.push(
                Diagnostic::error(format!("{what} is given twice"))
                    .at(first_line(span), "the second time")
                    .at(first_line(*before), "the first time")
                    .help(match what {
                        "the initial string" => "keep one of them, with the modules of both",
                        _ => "keep one of them, and remove the other",
                    }),
            );
        }
        self.0.push((what, span));
    }
}

/// The beginning of a declaration, short enough to be underlined.
fn first_line(span: Span) -> Span {
    Span { end: span.end.min(span.start + 5), ..span }
}

fn check_frames(&Frames { from, to, step }: &Frames, span: Span, scope: &mut Scope) {
    let written = |from: f64, to: f64, step: f64| format!("write `frames {from} .. {to} step {step}`");
    let (fault, help) = if from < 0.0 {
        ("time begins at 0".to_owned(), written(0.0, to.max(0.0), step))
    } else if to < from {
        (format!("{to} is before {from}"), written(to, from, step))
    } else if step <= 0.0 {
        let hundredth = if to > from { (to - from) / 100.0 } else { 1.0 };
        let help = format!("{}, for example", written(from, to, hundredth));
        ("the step must be greater than 0".to_owned(), help)
    } else if (to - from) / step >= Frames::LIMIT as f64 {
        let help = format!("choose a longer step: {}", written(from, to, (to - from) / 100.0));
        (format!("more than {} frames", Frames::LIMIT), help)
    } else {
        return;
    };
    scope.diagnostics.push(Diagnostic::error("these frames are invalid").at(span, fault).help(help));
}

/// The modules of all strings of a document.
fn strings(document: &Document) -> impl Iterator<Item = &ast::Module> {
    let parts = document.items.iter().flat_map(|(item, _)| {
        let mut all: Vec<&[ast::Part]> = Vec::new();
        match item {
            Item::Axiom(parts) | Item::Interpret { drawn: parts, .. } => all.push(parts),
            Item::Rule(rule) => {
                for clause in &rule.clauses {
                    if let ast::Action::Produce(alternatives) = &clause.action {
                        all.extend(alternatives.iter().map(|alternative| &alternative.modules[..]));
                    }
                }
            }
            _ => {}
        }
        all
    });
    parts.flat_map(ast::modules_of)
}

/// Warns of unused constants and functions.
fn unused(document: &Document, scope: &mut Scope) {
    let goes_on = strings(document).any(|module| &*module.name == ";" && module.arguments.is_empty());
    for (item, _) in document.own_items() {
        let text = |name: &ast::Name| name.text.clone();
        let (what, name, use_it) = match item {
            Item::Const { name, .. } => {
                ("constant", name, "use it in an equation, a condition or a string".into())
            }
            Item::Param { name, .. } => {
                ("param", name, "use it in an equation, a condition or a string".into())
            }
            Item::Def { name, parameters, .. } => {
                let formals: Vec<&str> = parameters.iter().map(|p| &*p.text).collect();
                ("function", name, format!("call it, as in `{}({})`", text(name), formals.join(", ")))
            }
            Item::Array { name, .. } => ("array", name, format!("use an element, as in `{}[0]`", text(name))),
            Item::Curve { name, .. } | Item::Function { name, .. } => {
                ("curve", name, format!("use it, as in `{}(age)`", text(name)))
            }
            Item::Table { name, .. } => ("table", name, format!("use it, as in `{}(t)`", text(name))),
            // `;` goes on to the colours declared behind the one that is named.
            Item::Color { .. } if goes_on => continue,
            Item::Color { name, .. } => {
                ("colour", name, format!("draw with it: `;({})` in a string", text(name)))
            }
            Item::Gradient { name, .. } => {
                ("gradient", name, format!("draw with it: `;({}, v)` in a string, v from 0 to 1", text(name)))
            }
            Item::Contour { name, .. } => {
                ("contour", name, format!("draw with it: `@C({})` in a string", text(name)))
            }
            Item::Tissue { name, .. } => {
                ("tissue", name, format!("let stems give way: `@E({})` in a string before them", text(name)))
            }
            Item::Gas { name, .. } => {
                ("gas", name, format!("let it out: `@S({}, rate, radius)` in a string", text(name)))
            }
            _ => continue,
        };
        let text: &Arc<str> = &name.text;
        if !scope.used.contains(text) {
            scope.diagnostics.push(
                Diagnostic::warning(format!("the {what} `{text}` is not used"))
                    .at(name.span, "declared here")
                    .help(format!("{use_it}, or remove this line")),
            );
        }
    }
}
