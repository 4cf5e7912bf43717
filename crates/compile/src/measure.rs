//! Measures of a model's strings, written as the head of a rule and an expression: `F(x): x`.

use crate::rules::RuleBuilder;
use crate::scope::{Scope, plural};
use crate::{Setting, globals};
use dlsys_diagnostic::{Diagnostic, Source};
use dlsys_expr::Program;
use dlsys_model::{Measure, Model};
use dlsys_syntax::suggest::did_you_mean;
use dlsys_syntax::{Errors, Files, parse, read};

/// Compiles a measure over the modules of a model that was loaded from `model_text` and `files` with these settings.
pub fn measure(
    model_text: &Source,
    files: &dyn Files,
    settings: &[Setting],
    model: &Model,
    source: &Source,
) -> Result<Measure, Errors> {
    let (document, head, expression) = parse::parse_measure(source)?;
    // The model has been loaded without errors before, so its messages are ignored.
    let mut scope = Scope::default();
    let own = Source::new(&*model_text.name, model_text.own_text());
    globals::declare(&read(&own, files).1, settings, &mut scope, files);
    scope.diagnostics.clear();
    let mut kinds = model.kinds.clone();
    let mut builder = RuleBuilder::new(&document, &mut scope, &mut kinds, Default::default());
    let (mut variables, count) = builder.variables(&head, &[], &[], 0);
    variables.aggregates = None;
    let value = match expression {
        Some(expression) => scope.number(&document.expressions, expression, &variables),
        None => Some(scope.graph.constant(1.0)),
    };
    let (name, arity) = (&*head.name.text, head.parameters.len());
    let of: Vec<_> = (model.kinds.iter())
        .filter(|(id, kind)| {
            !id.is_bracket() && (kind.name == name || kind.base() == name) && kind.arity == arity
        })
        .map(|(id, _)| id)
        .collect();
    if of.is_empty() {
        let mut error =
            Diagnostic::error(format!("the model has no `{name}` with {}", plural(arity, "parameter")))
                .at(head.span, "no module is measured by this");
        let same = model.kinds.iter().find(|(_, kind)| kind.name == name || kind.base() == name);
        error = match same {
            Some((_, kind)) => error.help(format!("`{}` has {}", kind.name, plural(kind.arity, "parameter"))),
            None => {
                error.help_opt(did_you_mean(name, model.kinds.iter().map(|(_, kind)| kind.name.as_str())))
            }
        };
        scope.diagnostics.push(error);
    }
    match value {
        Some(value) if scope.diagnostics.is_empty() => {
            let name = source.text.trim().to_owned();
            let program = Program::compile(&scope.graph, &[value], count);
            let mut kinds = vec![false; model.kinds.len()];
            of.iter().for_each(|kind| kinds[kind.index()] = true);
            Ok(Measure { name, kinds, program })
        }
        _ => Err(scope.diagnostics.into()),
    }
}
