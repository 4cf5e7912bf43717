//! Lowering of strings, heads and interpretations, the parts of a model that consist of modules.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::advice;
use crate::chance::Clocks;
use crate::clauses::{MovingParameters, OutOfReach, moving_parameters};
use crate::declared::DeclaredPattern;
use crate::inputs::{Handing, Inputs};
use crate::scene_checks::MaterialNumber;
use crate::scope::{RESERVED, Scope, Variables};
use crate::smooth::Smoothed;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::NodeId;
use dlsys_model::{CUT, Class, DRAWN_WORDS, Interpretation, KindId, Kinds, base_of, class_of};
use dlsys_syntax::ast::{self, Document, Expression, HeadModule, modules_of};
use dlsys_syntax::print;

/// Builds the parts of a model that consist of modules.
pub struct RuleBuilder<'b> {
    pub document: &'b Document,
    pub scope: &'b mut Scope,
    pub kinds: &'b mut Kinds,
    pub clocks: Clocks,
    pub inputs: Inputs,
    /// What modules of the string that is being lowered take over from the module that they replace.
    pub(super) handing: Handing,
    /// The parameters that rules move.
    pub(super) moving: MovingParameters,
    /// Equations that were made smooth for rules before.
    pub(super) smoothed: Smoothed,
    /// What flows cannot reach, for rules before.
    pub(super) out_of_reach: OutOfReach,
    /// Number of brackets that are open around the part of a string that is being lowered.
    pub(super) open_around: usize,
    /// Each kind that occurs in a string, with its first place.
    pub occurs: FxHashMap<KindId, Span>,
    /// Each kind that occurs in the drawing of another kind, with its first place.
    pub drawn: FxHashMap<KindId, Span>,
    /// The constant arguments of `@E`, in strings and drawings.
    pub materials: Vec<MaterialNumber>,
}

impl<'b> RuleBuilder<'b> {
    /// A builder before the first string.
    pub fn new(
        document: &'b Document,
        scope: &'b mut Scope,
        kinds: &'b mut Kinds,
        (clocks, inputs): (Clocks, Inputs),
    ) -> RuleBuilder<'b> {
        let (occurs, drawn, materials, smoothed, out_of_reach) = Default::default();
        let (handing, open_around) = (Handing::default(), 0);
        RuleBuilder {
            document,
            scope,
            kinds,
            clocks,
            inputs,
            handing,
            moving: moving_parameters(document),
            smoothed,
            out_of_reach,
            open_around,
            occurs,
            drawn,
            materials,
        }
    }

    /// Number of hidden parameters of a module.
    pub(super) fn hidden(&self, module: &HeadModule) -> usize {
        let (name, arity) = (&module.name.text, module.parameters.len());
        self.clocks.width(name, arity) + 2 * self.inputs.of(name, arity).len()
    }

    /// A module of a context by name; its kinds are resolved later.
    pub(super) fn pattern(&self, head: HeadModule) -> DeclaredPattern {
        DeclaredPattern { width: head.parameters.len() + self.hidden(&head), head }
    }

    pub(super) fn error(&mut self, error: Diagnostic) {
        self.scope.diagnostics.push(error);
    }

    /// The variables of a head, and their number, `t` and `age` included.
    pub(super) fn variables(
        &mut self,
        own: &HeadModule,
        left: &[HeadModule],
        right: &[HeadModule],
        aggregates: u32,
    ) -> (Variables, usize) {
        let mut names: FxHashMap<Arc<str>, NodeId> = FxHashMap::default();
        let mut count = 0;
        let mut parameters = Vec::new();
        for module in std::iter::once(own).chain(left).chain(right) {
            parameters.extend(module.parameters.iter().zip(count..));
            // Hidden parameters follow the written ones.
            let hidden = self.hidden(module);
            count += (module.parameters.len() + hidden) as u32;
        }
        for (i, &(parameter, number)) in parameters.iter().enumerate() {
            let node = self.scope.graph.var(number);
            if RESERVED.contains(&&*parameter.text) {
                self.error(
                    Diagnostic::error(format!("a parameter cannot be called `{}`", parameter.text))
                        .at(parameter.span, "this name stands for time in every rule")
                        .help(match &*parameter.text {
                            "age" => "`age`, the time since the module was made, is known without a parameter; for another time choose another name".to_owned(),
                            name => format!("`{name}`, the time since the start, is known without a parameter; for another time choose another name"),
                        }),
                );
            }
            if names.insert(parameter.text.clone(), node).is_some() {
                let before = parameters[..i].iter().rfind(|(known, _)| known.text == parameter.text);
                let before = before.expect("only parameters are in the map").0.span;
                self.error(
                    Diagnostic::error(format!("two parameters of this head are called `{}`", parameter.text))
                        .at(parameter.span, "the second one")
                        .at(before, "the first one")
                        .help(advice::other_name(&parameter.text, !left.is_empty(), !right.is_empty())),
                );
            }
        }
        let first_aggregate = count;
        count += aggregates;
        for name in RESERVED {
            let node = self.scope.graph.var(count);
            names.insert(name.into(), node);
            count += 1;
        }
        let aggregates = Some((first_aggregate, count));
        (Variables { names, aggregates, ..Variables::default() }, count as usize)
    }

    pub(super) fn not_a_bracket(&mut self, head: &HeadModule, is_context: bool) -> bool {
        let bracket = matches!(&*head.name.text, "[" | "]");
        if bracket {
            self.error(
                Diagnostic::error("a bracket has no rules")
                    .at(head.name.span, "brackets structure the string; they do not develop")
                    .help(if is_context {
                        "in a context after `>` brackets stand in pairs around a branch: `A > [ B ] C`"
                    } else {
                        "to change a branch, write a rule for a module in it"
                    }),
            );
        }
        let cut = &*head.name.text == CUT;
        if cut {
            self.error(
                Diagnostic::error("`%` has no rules and no context")
                    .at(head.name.span, "it cuts off the rest of its branch, and is gone at once")
                    .help("write the rule for the module that makes it, as in `A(x): if x = 1 produce %`"),
            );
        }
        !bracket && !cut
    }

    pub fn interpretation(
        &mut self,
        head: &HeadModule,
        drawn: &[ast::Part],
    ) -> Option<(KindId, Interpretation)> {
        if !self.not_a_bracket(head, false) {
            return None;
        }
        // Drawings and measures read the written parameters only.
        let (clocks, inputs) = (std::mem::take(&mut self.clocks), std::mem::take(&mut self.inputs));
        let (mut variables, count) = self.variables(head, &[], &[], 0);
        // They have no aggregates.
        variables.aggregates = None;
        if let Some(cut) = modules_of(drawn).find(|module| &*module.name == CUT) {
            self.error(
                Diagnostic::error("a drawing cuts nothing off")
                    .at(cut.span, "`%` belongs in the successors of rules")
                    .help("to draw nothing, write `ε`"),
            );
        }
        if let Some(again) = modules_of(drawn).find(|module| is_head(module, head)) {
            self.error(draws_nothing(again, head));
        }
        // A module that is only drawn does not develop and makes no rule reachable.
        let before = std::mem::take(&mut self.occurs);
        let drawn = self.string(drawn, &variables, count, false);
        (self.clocks, self.inputs) = (clocks, inputs);
        let inside = std::mem::replace(&mut self.occurs, before);
        let kind = self.kinds.intern(&head.name.text, head.parameters.len());
        self.drawn.extend(inside.into_iter().filter(|(other, _)| *other != kind));
        Some((kind, Interpretation { span: head.span, drawn: drawn? }))
    }

    /// The value of an expression of constants, for declarations such as `angle`.
    pub fn constant(&mut self, expression: Expression) -> Option<f64> {
        self.scope.constant_value(&self.document.expressions, expression)
    }
}

/// True if a module of a drawing is of the kind that is drawn, and the turtle does not interpret its name.
fn is_head(module: &ast::Module, head: &HeadModule) -> bool {
    let same = module.name == head.name.text && module.arguments.len() == head.parameters.len();
    same && class_of(&module.name) == Class::Word && !DRAWN_WORDS.contains(&base_of(&module.name))
}

fn draws_nothing(module: &ast::Module, head: &HeadModule) -> Diagnostic {
    let name = &module.name;
    let arguments = if head.parameters.is_empty() { "" } else { "(…)" };
    Diagnostic::warning(format!("`{name}` draws nothing in its own drawing"))
        .at(module.span, format!("inside its own drawing a module is drawn by its name, and the turtle draws nothing for `{name}`"))
        .help(format!(
            "drawings do not repeat themselves: let a rule make the parts, `{}: … produce F(1) {name}{arguments}`, or draw a module with another name",
            print::head_module(head)
        ))
}
