//! Sheets: flexible surfaces and nets, from the syntax tree to the model.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::advice;
use crate::physics::MAX_DECLARED;
use crate::scenery::Builder;
use crate::scope::{Scope, Variables, plural};
use crate::surface::{self, Net};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::Program;
use dlsys_model::{Appearance, COMMAND_SURFACES, KindId, Model, Scenery, Sheet, Tissue};
use dlsys_sheet as sheet;
use dlsys_syntax::ast::{Expression, Name, Text};
use dlsys_syntax::suggest::did_you_mean;

impl Builder<'_> {
    pub(crate) fn sheet(
        &mut self,
        (name, file, tissue, pinned): (&Name, &Text, &Name, Expression),
        span: Span,
        appearance: &Appearance,
    ) {
        if !self.is_free(name, appearance) {
            return;
        }
        if self.scenery.sheets.len() == MAX_DECLARED {
            self.scope.diagnostics.push(advice::too_many(
                MAX_DECLARED,
                "sheets",
                span,
                "one sheet may be placed any number of times",
            ));
        }
        let found = self.read_sheet((name, file, tissue, pinned), span);
        // The name counts as declared in spite of an error.
        let nothing = || Sheet {
            name: name.text.to_string(),
            points: Vec::new(),
            faces: Vec::new(),
            cords: Vec::new(),
            pinned: Vec::new(),
            tissue: 0,
            span,
        };
        self.scenery.sheets.push(Arc::new(found.unwrap_or_else(nothing)));
    }

    /// Reports a name that is taken; true if it is not.
    fn is_free(&mut self, name: &Name, appearance: &Appearance) -> bool {
        if COMMAND_SURFACES.iter().any(|(command, _)| *command == &*name.text) {
            self.scope.diagnostics.push(
                Diagnostic::error(format!("`{}` cannot be a sheet", name.text))
                    .at(name.span, "this name is a command of the turtle")
                    .help("choose another name"),
            );
            return false;
        }
        let plants = self.scenery.plants.iter().map(|plant| (&plant.name, plant.span));
        let surfaces = appearance.surfaces.iter().map(|shape| (&shape.name, shape.span));
        let sheets = self.scenery.sheets.iter().map(|sheet| (&sheet.name, sheet.span));
        let before = plants.chain(surfaces).chain(sheets).find(|(known, _)| **known == *name.text);
        let before = before.map(|(_, span)| span);
        if let Some(before) = before {
            self.scope.diagnostics.push(
                Diagnostic::error(format!("`{}` is declared twice", name.text))
                    .at(name.span, "the second time")
                    .at(before, "the first time")
                    .help(advice::twice(&name.text)),
            );
        }
        before.is_none()
    }

    /// The sheet; `None` after an error that has been reported.
    fn read_sheet(
        &mut self,
        (name, file, tissue, pinned): (&Name, &Text, &Name, Expression),
        span: Span,
    ) -> Option<Sheet> {
        let number = self.tissue_of(tissue);
        let held = self.condition_of_place(pinned);
        let net = match surface::read_net(&file.text, self.files) {
            Ok(net) => net,
            Err(fault) => {
                let help = fault
                    .help
                    .unwrap_or_else(|| "export the file again, or mend the line in a text editor".to_owned());
                self.faulty_file(name, file, (fault.line, &fault.what), help);
                return None;
            }
        };
        let (number, held) = (number?, held?);
        let pins: Vec<bool> = net.points.iter().map(|point| held.eval_one(point) != 0.0).collect();
        if !pins.contains(&true) {
            self.pinned_nowhere(name, pinned, &net);
            return None;
        }
        self.check(name, file, (&net, number))?;
        let Net { points, faces, cords, .. } = net;
        let name = name.text.to_string();
        Some(Sheet { name, points, faces, cords, pinned: pins, tissue: number, span })
    }

    /// The index of a tissue by its name.
    fn tissue_of(&mut self, name: &Name) -> Option<usize> {
        self.scope.used.insert(name.text.clone());
        let tissues = &self.scenery.tissues;
        let Some(index) = tissues.iter().position(|tissue| tissue.name == name.text) else {
            let error = Diagnostic::error(format!("there is no tissue `{}`", name.text))
                .at(name.span, "a sheet is made of a tissue");
            let known = did_you_mean(&name.text, tissues.iter().map(|tissue| &*tissue.name));
            self.scope.diagnostics.push(error.help(known.unwrap_or_else(|| {
                format!(
                    "declare it: `tissue {} = stiffness 5e6, density 1100, damping 0.1, thickness 0.002`",
                    name.text
                )
            })));
            return None;
        };
        if !tissues[index].is_constant() {
            let declared = tissues[index].span;
            self.scope.diagnostics.push(
                Diagnostic::error(format!("the stiffness of `{}` follows t", name.text))
                    .at(name.span, "a sheet keeps its stiffness")
                    .at(declared, "declared here")
                    .help("give the sheet a tissue of its own whose `stiffness` is a constant"),
            );
            return None;
        }
        Some(index)
    }

    /// A condition over x, y and z as a program whose value is 0 where it does not hold.
    fn condition_of_place(&mut self, condition: Expression) -> Option<Program> {
        let no_time = "a sheet is held at the same points at all times: `x`, `y` and `z` of its file";
        let mut variables = Variables { no_time: Some(no_time), ..Variables::default() };
        for (number, name) in ["x", "y", "z"].into_iter().enumerate() {
            variables.names.insert(name.into(), self.scope.graph.var(number as u32));
        }
        let all = &self.document.expressions;
        let root = self.scope.condition(all, condition, &variables)?;
        let [one, zero] = [1.0, 0.0].map(|value| self.scope.graph.constant(value));
        let value = self.scope.graph.select(root, one, zero);
        Some(Program::compile(&self.scope.graph, &[value], 3))
    }

    fn pinned_nowhere(&mut self, name: &Name, pinned: Expression, net: &Net) {
        let range = |axis: usize| {
            let values = net.points.iter().map(|point| point[axis]);
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            format!("{} from {low} to {high}", ["x", "y", "z"][axis])
        };
        let ranges = [0, 1, 2].map(range).join(", ");
        self.scope.diagnostics.push(
            Diagnostic::error(format!("the sheet `{}` is held nowhere", name.text))
                .at(
                    self.document.expressions.span(pinned.root),
                    "no point of the file fulfils this condition",
                )
                .note(format!("its points have {ranges}, in the file's coordinates"))
                .help("write where it is held: `pinned y > 2.99` for what is above 2.99"),
        );
    }

    /// Checks mesh and tissue as the mechanics do.
    fn check(&mut self, name: &Name, file: &Text, (net, number): (&Net, usize)) -> Option<()> {
        let tissue = &self.scenery.tissues[number];
        let made = sheet::Sheet::new(&mesh(net, self.scenery.units.length), &material(tissue), |_| false);
        let Err(error) = made else { return Some(()) };
        let line = |lines: &[usize], index: usize| lines.get(index).copied();
        let (at, what, help) = match &error {
            sheet::Error::Manifold { edge: [a, b], faces } => (
                line(&net.point_lines, *a),
                format!(
                    "it is not manifold: {faces} faces share the edge between points {} and {}",
                    a + 1,
                    b + 1
                ),
                "at most two faces meet at an edge: separate what is joined there, or draw a seam as lines (`l`)",
            ),
            sheet::Error::Massless { point } => (
                line(&net.point_lines, *point),
                format!("point {} belongs to no face and to no line, so its mass is 0", point + 1),
                "remove points that nothing uses; most programs have `merge by distance` or `delete loose`",
            ),
            sheet::Error::Element { element, index, what } => (
                line(if *element == "face" { &net.face_lines } else { &net.cord_lines }, *index),
                format!("this {} is not valid: {what}", if *element == "face" { "face" } else { "line" }),
                "faces and lines have a size, and each of their points once",
            ),
            error => (None, error.to_string(), "look at the values of its tissue, and at the `units`"),
        };
        self.faulty_file(name, file, (at, &what), help.to_owned());
        None
    }

    fn faulty_file(&mut self, name: &Name, file: &Text, (line, what): (Option<usize>, &str), help: String) {
        let place = match line {
            Some(line) => format!("{}, line {line}: {what}", file.text),
            None => what.to_owned(),
        };
        let message = format!("the sheet `{}` cannot be made", name.text);
        self.scope.diagnostics.push(Diagnostic::error(message).at(file.span, place).help(help));
    }
}

/// A mesh in m, given the metres in a unit of length.
fn mesh(net: &Net, metre: f64) -> sheet::Mesh {
    let points = net.points.iter().map(|point| sheet::Vector::from(*point) * metre).collect();
    sheet::Mesh { points, faces: net.faces.clone(), cords: net.cords.clone() }
}

/// The material of a tissue of constant stiffness.
fn material(tissue: &Tissue) -> sheet::Tissue {
    let stiffness = tissue.stiffness.eval_one(&[0.0]);
    sheet::Tissue {
        damping: tissue.damping,
        ..sheet::Tissue::new(stiffness, tissue.density, tissue.thickness)
    }
}

/// Warns of sheets that no string contains.
pub fn unused(scenery: &Scenery, is_used: impl Fn(&str) -> bool, scope: &mut Scope) {
    for sheet in scenery.sheets.iter().filter(|sheet| !is_used(&sheet.name)) {
        scope.diagnostics.push(
            Diagnostic::warning(format!("the sheet `{}` is not used", sheet.name))
                .at(sheet.span, "declared here")
                .help(format!("place it: `[ {} ]` in a string, or remove this line", sheet.name)),
        );
    }
}

/// Reports sheets with parameters, and warns of sheets in plants of other models.
pub fn modules(model: &Model, places: &FxHashMap<KindId, Span>, diagnostics: &mut Vec<Diagnostic>) {
    let is_sheet = |name: &str| model.scenery.sheets.iter().any(|sheet| sheet.name == name);
    for (id, kind) in model.kinds.iter() {
        if kind.arity == 0 || kind.interpretation.is_some() || !is_sheet(&kind.name) {
            continue;
        }
        if let Some(span) = places.get(&id) {
            diagnostics.push(
                Diagnostic::error(format!("the sheet `{}` has no parameters", kind.name))
                    .at(*span, format!("{} here", plural(kind.arity, "parameter")))
                    .help("its file says how large it is, in units of the model"),
            );
        }
    }
    for plant in &model.scenery.plants {
        let mut inner = vec![&plant.model];
        while let Some(within) = inner.pop() {
            inner.extend(within.scenery.plants.iter().map(|plant| &plant.model));
            if let Some(sheet) = within.scenery.sheets.first() {
                diagnostics.push(
                    Diagnostic::warning(format!(
                        "the sheet `{}` of the plant `{}` is not drawn",
                        sheet.name, plant.name
                    ))
                    .at(plant.span, "a sheet in the model of a plant is left out here")
                    .help("declare the sheet in this model, and place it beside the plant"),
                );
                break;
            }
        }
    }
}
