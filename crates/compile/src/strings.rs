//! Strings of modules: successors with their weights, axioms and drawings; checks of the numbers of parameters of their
//! modules.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::advice;
use crate::chance::Drawn;
use crate::rules::RuleBuilder;
use crate::scene_checks::MaterialNumber;
use crate::scope::{RESERVED, Scope, Variables, plural};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{NodeId, Program};
use dlsys_model::{
    Choice, Class, ELASTIC, KindId, Outcome, Part, Repeat, SOURCE, Stretch, Successor, base_of, choose,
    class_of,
};
use dlsys_syntax::ast::{self, Alternative, HeadModule, modules_of};
use dlsys_syntax::print;
use dlsys_syntax::suggest::{looks_like, meant};

/// The effect of a module on the balance of brackets.
enum Bracket {
    /// A bracket that may match, or another module.
    Good,
    /// A `]` without its `[`.
    Unmatched,
    /// A bracket with arguments, which is an error.
    WithArguments,
}

impl RuleBuilder<'_> {
    /// Lowers a string of modules in which draws are allowed, over the given variables.
    pub fn successor(
        &mut self,
        parts: &[ast::Part],
        variables: &Variables,
        count: usize,
    ) -> Option<Successor> {
        self.string(parts, variables, count, true)
    }

    /// Lowers the successors of a clause with their weights.
    pub(super) fn outcome(
        &mut self,
        all: &[Alternative],
        variables: &Variables,
        count: usize,
    ) -> Option<Outcome> {
        let mut weights = Vec::new();
        let mut successors = Vec::new();
        for Alternative { weight, modules } in all {
            self.handing.restart();
            let successor = self.successor(modules, variables, count);
            let weight = weight.map(|w| self.scope.number(&self.document.expressions, w, variables));
            weights.extend(weight.flatten());
            successors.extend(successor);
        }
        if successors.len() < all.len() || weights.len() < all.iter().filter(|a| a.weight.is_some()).count() {
            return None;
        }
        let fixed: Option<Vec<f64>> = weights.iter().map(|w| self.scope.graph.as_constant(*w)).collect();
        if let Some(why) = fixed.filter(|w| !w.is_empty()).and_then(|w| choose(&w, 0.5).err()) {
            let of = |a: &Alternative| a.weight.map(|w| self.document.expressions.span(w.root));
            let mut spans = all.iter().filter_map(of);
            let first = spans.next().unwrap_or_default();
            self.error(
                Diagnostic::error("these weights are invalid")
                    .at(spans.fold(first, |a, b| a.to(b)), why)
                    .help("weights are at least 0, and one of them is greater; they need not add up to 1"),
            );
            return None;
        }
        let weights = (!weights.is_empty()).then(|| self.scope.graph.program(&weights, count));
        Some(Outcome { weights, successors })
    }

    /// Lowers a string of modules over the given variables, with draws or without.
    pub(super) fn string(
        &mut self,
        parts: &[ast::Part],
        variables: &Variables,
        count: usize,
        draws: bool,
    ) -> Option<Successor> {
        if parts.iter().all(|part| matches!(part, ast::Part::Module(_))) {
            let modules: Vec<&ast::Module> = modules_of(parts).collect();
            let mut open = Vec::new();
            let stretch = self.stretch(&modules, variables, count, (draws, &mut open));
            return stretch
                .filter(|_| self.closed(open, "brackets must match within each string"))
                .map(Successor::Plain);
        }
        self.parts(parts, variables, count, draws).map(Successor::Parts)
    }

    /// Lowers a string with repetitions and conditions, or one within them.
    fn parts(
        &mut self,
        parts: &[ast::Part],
        variables: &Variables,
        count: usize,
        draws: bool,
    ) -> Option<Vec<Part>> {
        let mut lowered = Vec::new();
        let mut open = Vec::new();
        let is_module = |part: &ast::Part| matches!(part, ast::Part::Module(_));
        let around = self.open_around;
        for run in parts.chunk_by(|a, b| is_module(a) && is_module(b)) {
            if !is_module(&run[0]) {
                self.open_around = around + open.len();
            }
            lowered.push(match &run[0] {
                ast::Part::Module(_) => {
                    let modules: Vec<&ast::Module> = modules_of(run).collect();
                    self.stretch(&modules, variables, count, (draws, &mut open)).map(Part::Stretch)
                }
                ast::Part::Repeat(of) => self.repetition(of, variables, count, draws).map(Part::Repeat),
                ast::Part::If(of) => self.conditional(of, variables, count, draws).map(Part::Choice),
            });
            self.open_around = around;
        }
        let lowered: Option<Vec<Part>> = lowered.into_iter().collect();
        let help = "brackets must match within each string, and within each repetition and condition";
        lowered.filter(|_| self.closed(open, help))
    }

    fn repetition(
        &mut self,
        of: &ast::Repetition,
        variables: &Variables,
        count: usize,
        draws: bool,
    ) -> Option<Repeat> {
        let all = &self.document.expressions;
        let (from, to) =
            (self.scope.number(all, of.from, variables), self.scope.number(all, of.to, variables));
        let span = all.span(of.from.root).to(all.span(of.to.root));
        let name = &of.index.text;
        if RESERVED.contains(&&**name) || Scope::is_built_in(name) {
            self.error(
                Diagnostic::error(format!("`{name}` cannot be the index of a repetition"))
                    .at(of.index.span, "this name is built in")
                    .help("choose another name, such as `i`"),
            );
            return None;
        }
        let mut inner = variables.clone();
        let index = self.scope.graph.var(count as u32);
        inner.names.insert(name.clone(), index);
        let body = self.parts(&of.body, &inner, count + 1, draws);
        let roots = [from?, to?];
        let known = |node| self.scope.graph.as_constant(node);
        for (bound, expression) in roots.into_iter().zip([of.from, of.to]) {
            if let Some(value) =
                known(bound).filter(|value| (value - value.round()).abs() > 1e-9 || !value.is_finite())
            {
                let error = Diagnostic::error("this bound of a repetition is not a whole number")
                    .at(all.span(expression.root), format!("it is {value}"))
                    .help("round it: `floor(x)` or `ceil(x)`");
                self.error(error);
                return None;
            }
        }
        Some(Repeat { bounds: Program::compile(&self.scope.graph, &roots, count), body: body?, span })
    }

    fn conditional(
        &mut self,
        of: &ast::Conditional,
        variables: &Variables,
        count: usize,
        draws: bool,
    ) -> Option<Choice> {
        let condition = self.scope.condition(&self.document.expressions, of.condition, variables);
        let before = self.handing.clone();
        let then = self.parts(&of.then, variables, count, draws);
        let after = std::mem::replace(&mut self.handing, before);
        let otherwise = self.parts(&of.otherwise, variables, count, draws);
        self.handing.join(&after);
        let condition = Program::compile(&self.scope.graph, &[condition?], count);
        Some(Choice { condition, then: then?, otherwise: otherwise? })
    }

    fn stretch(
        &mut self,
        modules: &[&ast::Module],
        variables: &Variables,
        count: usize,
        (draws, open): (bool, &mut Vec<Span>),
    ) -> Option<Stretch> {
        self.scope.draws.allowed = draws;
        let stretch = self.modules(modules, variables, count, open);
        self.scope.draws.allowed = false;
        stretch
    }

    /// Reports a bracket that is still open at the end of a string or a group; false if there is one.
    fn closed(&mut self, mut open: Vec<Span>, help: &str) -> bool {
        let Some(bracket) = open.pop() else { return true };
        self.error(
            Diagnostic::error("this `[` is never closed")
                .at(bracket, "expected a `]` for it in this string")
                .help(help),
        );
        false
    }

    /// Lowers modules; `open` are the brackets that are open before them, then behind them.
    fn modules(
        &mut self,
        modules: &[&ast::Module],
        variables: &Variables,
        count: usize,
        open: &mut Vec<Span>,
    ) -> Option<Stretch> {
        let mut drawn = Drawn::default();
        let mut clocks = Vec::new();
        let (mut place, mut places) = (0, Vec::new());
        let mut kinds = Vec::with_capacity(modules.len());
        let mut roots = Vec::new();
        let mut good = true;
        for module in modules {
            let kind = self.kinds.intern(&module.name, module.arguments.len());
            match self.bracket(module, open) {
                Bracket::Good => {}
                Bracket::Unmatched => good = false,
                Bracket::WithArguments => {
                    good = false;
                    continue;
                }
            }
            self.occurs.entry(kind).or_insert(module.span);
            kinds.push(kind);
            let first = self.scope.draws.all.len() as u32;
            let argument = roots.len();
            good &= self.arguments(module, variables, count > 0, &mut roots);
            self.note_material(module, kind, roots.get(argument));
            let draws = first..self.scope.draws.all.len() as u32;
            if !draws.is_empty() {
                drawn.modules.push((place, draws));
            }
            clocks.extend(self.clocks.for_new(&module.name, module.arguments.len(), place, roots.len()));
            let in_branch = !open.is_empty() || self.open_around > 0;
            roots.extend(self.inputs_of_new(module, in_branch));
            place += usize::from(!kind.is_bracket());
            if !kind.is_bracket() && places.len() < Stretch::PLACES {
                places.push((kind, module.span));
            }
        }
        if !good {
            return None;
        }
        let (arguments, draws) = drawn.compile(self.scope, roots, count);
        Some(Stretch { kinds, arguments, draws, clocks, places })
    }

    /// Lowers the arguments of a module; false if one has an error. `in_rule` is true if the module may be meant as the head
    /// of another rule.
    fn arguments(
        &mut self,
        module: &ast::Module,
        variables: &Variables,
        in_rule: bool,
        roots: &mut Vec<NodeId>,
    ) -> bool {
        let mut good = true;
        for &argument in &module.arguments {
            let known = self.scope.diagnostics.len();
            let Some(node) = self.scope.number(&self.document.expressions, argument, variables) else {
                good = false;
                advice::of_look(module, &self.document.expressions, &mut self.scope.diagnostics[known..]);
                if in_rule
                    && known < self.scope.diagnostics.len()
                    && let Some(head) = self.looks_like_a_head(module)
                    && let Some(error) = self.scope.diagnostics.last_mut()
                {
                    error.help.push(format!("if `{head}` is the head of a rule, end it with `:`"));
                }
                continue;
            };
            if let Some(value) = self.scope.graph.as_constant(node).filter(|x| !x.is_finite()) {
                self.error(
                    Diagnostic::error("this has no finite value")
                        .at(self.document.expressions.span(argument.root), format!("it is {value}"))
                        .help(advice::not_finite(value)),
                );
                good = false;
            }
            roots.push(node);
        }
        good
    }

    /// Notes the first argument of `@E` and of `@S` if it is a constant.
    fn note_material(&mut self, module: &ast::Module, kind: KindId, argument: Option<&NodeId>) {
        if ![ELASTIC, SOURCE].contains(&base_of(&module.name)) {
            return;
        }
        let value = argument.and_then(|node| self.scope.graph.as_constant(*node));
        if let (Some(value), Some(written)) = (value, module.arguments.first()) {
            let span = self.document.expressions.span(written.root);
            self.materials.push(MaterialNumber { kind, value, span });
        }
    }

    /// Updates the open brackets and reports those without a partner or with arguments.
    fn bracket(&mut self, module: &ast::Module, open: &mut Vec<Span>) -> Bracket {
        match &*module.name {
            "[" | "]" if !module.arguments.is_empty() => {
                self.error(
                    Diagnostic::error("a bracket has no parameters")
                        .at(module.span, "a `(` cannot follow a bracket")
                        .help("write it alone; a branch that turns away has a turn in it: `[ +(45) F(1) ]`"),
                );
                if &*module.name == "[" {
                    open.push(module.span);
                } else {
                    open.pop();
                }
                Bracket::WithArguments
            }
            "[" => {
                open.push(module.span);
                Bracket::Good
            }
            "]" if open.pop().is_none() => {
                self.error(
                    Diagnostic::error("this `]` closes no branch")
                        .at(module.span, "there is no `[` before it in this string")
                        .help("brackets must match within each string"),
                );
                Bracket::Unmatched
            }
            _ => Bracket::Good,
        }
    }

    /// True for a module whose arguments are bare names, as in the head of a rule.
    fn looks_like_a_head(&self, module: &ast::Module) -> Option<String> {
        let names: Vec<&str> = (module.arguments.iter())
            .map(|argument| match self.document.expressions.get(argument.root) {
                ast::Expr::Name(name) => Some(&**name),
                _ => None,
            })
            .collect::<Option<_>>()?;
        Some(format!("{}({})", module.name, names.join(", ")))
    }

    /// Reports words in strings (or drawings) whose number of parameters differs from that of their rules (or drawings).
    /// `place` describes the head with the right number.
    pub fn check_arities(&mut self, heads: &[&HeadModule], strings: &[&[ast::Part]], place: &str) {
        let mut declared: FxHashMap<&str, Vec<&HeadModule>> = FxHashMap::default();
        for &head in heads {
            declared.entry(&head.name.text).or_default().push(head);
        }
        let mut reported: FxHashSet<(&str, usize)> = FxHashSet::default();
        for module in strings.iter().flat_map(|parts| modules_of(parts)) {
            // The turtle has defaults for missing parameters of symbols and surfaces.
            if class_of(&module.name) != Class::Word {
                continue;
            }
            let Some(heads) = declared.get(&*module.name) else { continue };
            let given = module.arguments.len();
            if heads.iter().any(|h| h.parameters.len() == given) || !reported.insert((&module.name, given)) {
                continue;
            }
            let error = Diagnostic::error(format!(
                "`{}` has {}, not {given}",
                module.name,
                plural(heads[0].parameters.len(), "parameter"),
            ))
            .at(module.span, format!("{} here", plural(given, "parameter")))
            .at(heads[0].span, format!("{} {place}", plural(heads[0].parameters.len(), "parameter")))
            .help_opt(
                advice::decimal_comma(
                    &self.document.expressions,
                    module.arguments.iter().map(|a| a.root),
                    heads[0].parameters.len(),
                )
                .map(|meant| format!("the decimal sign is a point: `{}({meant})`", module.name)),
            )
            .help(advice::wrong_arity(module, heads[0], place));
            self.error(error);
        }
    }

    /// Warns of drawings of modules that occur neither in strings nor in other drawings.
    pub fn check_interpretations(&mut self, heads: &[&HeadModule]) {
        for head in heads {
            let name = &*head.name.text;
            let given = head.parameters.len();
            let seen = |kind| self.occurs.contains_key(&kind) || self.drawn.contains_key(&kind);
            if self.kinds.find(name, given).is_some_and(seen) {
                continue;
            }
            let mut error =
                Diagnostic::warning(format!("nothing is drawn as `{}`", print::head_module(head)))
                    .at(head.span, "no string and no other drawing has this module");
            let other = (self.occurs.iter().chain(&self.drawn))
                .filter(|(kind, _)| self.kinds.get(**kind).name == name)
                .min_by_key(|(_, span)| **span);
            if let Some((kind, span)) = other {
                let arity = self.kinds.get(*kind).arity;
                error = error
                    .at(*span, format!("here it has {}", plural(arity, "parameter")))
                    .help(format!("write the head with as many: `{}`", advice::head_with(head, arity)));
            } else {
                let mut others = (self.occurs.keys()).map(|kind| self.kinds.get(*kind).name.as_str());
                error = error.help(match others.find(|other| looks_like(name, other)) {
                    Some(other) => meant(name, other),
                    None => format!("put `{name}` into a string, or remove this line"),
                });
            }
            self.error(error);
        }
    }
}
