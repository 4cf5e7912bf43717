//! From the syntax tree back to text.
//!
//! Parentheses are added where the tree needs them, so that the printed text parses to the same tree. Printing uses an
//! explicit stack, because a tree may be deeper than the call stack allows.

use crate::ast::{
    Action, Alternative, Clause, ContextPart, Document, Equation, Expr, ExprId, Expressions, HeadModule,
    Module, Name, Operator, Part,
};
use crate::notation;

/// Binding strength of a node; 0 is the weakest.
fn strength(expr: &Expr) -> u8 {
    match expr {
        Expr::If(..) | Expr::Match(..) => 0,
        Expr::Binary(Operator::Or, ..) => 1,
        Expr::Binary(Operator::And, ..) => 2,
        Expr::Not(_) => 3,
        Expr::Compare(..) => 4,
        Expr::Binary(Operator::Add | Operator::Sub, ..) => 5,
        Expr::Binary(Operator::Mul | Operator::Div, ..) => 6,
        Expr::Negate(_) => 7,
        Expr::Scale(..) => 8,
        Expr::Binary(Operator::Pow, ..) => 9,
        Expr::Number(_) | Expr::Name(_) | Expr::Call(..) | Expr::Index(..) => 10,
        Expr::Parenthesis(_) | Expr::Aggregate(_) => 10,
    }
}

impl Operator {
    fn symbol(self) -> &'static str {
        match self {
            Operator::Add => " + ",
            Operator::Sub => " - ",
            Operator::Mul => "*",
            Operator::Div => "/",
            Operator::Pow => "^",
            Operator::And => " & ",
            Operator::Or => " | ",
        }
    }
}

enum Task<'e> {
    Text(&'e str),
    Owned(String),
    /// A node, in parentheses unless it binds at least this tightly.
    Node(ExprId, u8),
}

/// An expression as text.
pub fn expression(expressions: &Expressions, root: ExprId) -> String {
    let mut out = String::new();
    let mut tasks = vec![Task::Node(root, 0)];
    // In the order of printing; pushed in reverse.
    let mut parts: Vec<Task> = Vec::new();
    while let Some(task) = tasks.pop() {
        let (id, needed) = match task {
            Task::Text(text) => {
                out.push_str(text);
                continue;
            }
            Task::Owned(text) => {
                out.push_str(&text);
                continue;
            }
            Task::Node(id, needed) => (id, needed),
        };
        let enclosed = strength(expressions.get(id)) < needed;
        if enclosed {
            parts.push(Task::Text("("));
        }
        push_parts(expressions, id, &mut parts);
        if enclosed {
            parts.push(Task::Text(")"));
        }
        tasks.extend(parts.drain(..).rev());
    }
    out
}

/// The parts of a node in print order: signs, words, and operands with the strength that each needs.
fn push_parts<'e>(expressions: &'e Expressions, id: ExprId, parts: &mut Vec<Task<'e>>) {
    let node = expressions.get(id);
    let own = strength(node);
    match node {
        Expr::Number(x) => parts.push(Task::Owned(x.to_string())),
        Expr::Name(name) => parts.push(Task::Text(name)),
        Expr::Call(name, arguments) => {
            parts.extend([Task::Text(name), Task::Text("(")]);
            for (i, argument) in arguments.iter().enumerate() {
                if i > 0 {
                    parts.push(Task::Text(", "));
                }
                parts.push(Task::Node(*argument, 0));
            }
            parts.push(Task::Text(")"));
        }
        Expr::Index(name, index) => {
            parts.extend([Task::Text(name), Task::Text("["), Task::Node(*index, 0), Task::Text("]")]);
        }
        Expr::Negate(a) => parts.extend([Task::Text("-"), Task::Node(*a, own)]),
        Expr::Not(a) => parts.extend([Task::Text("!"), Task::Node(*a, own)]),
        Expr::Scale(factor, a) => push_scaled(expressions, *factor, *a, own, parts),
        Expr::Binary(operator, a, b) => {
            // Equal strength needs no parentheses on the side to which the operator associates.
            let (left, right) = if *operator == Operator::Pow { (own + 1, own) } else { (own, own + 1) };
            // A sign may open the right operand of a tighter operator; an `if` extends to the end of the expression.
            parts.extend([Task::Node(*a, left), Task::Text(operator.symbol()), Task::Node(*b, right)]);
        }
        Expr::Compare(first, links) => {
            parts.push(Task::Node(*first, own + 1));
            for (comparison, operand) in links {
                parts.extend([Task::Text(" "), Task::Text(comparison.symbol()), Task::Text(" ")]);
                parts.push(Task::Node(*operand, own + 1));
            }
        }
        Expr::If(condition, then, otherwise) => {
            parts.extend([Task::Text("if "), Task::Node(*condition, 0)]);
            parts.extend([Task::Text(" then "), Task::Node(*then, 0)]);
            parts.extend([Task::Text(" else "), Task::Node(*otherwise, 0)]);
        }
        Expr::Match(subject, cases, otherwise) => {
            parts.extend([Task::Text("match "), Task::Node(*subject, 1)]);
            for (value, then) in cases {
                // Without parentheses, an inner `match` would include the cases that follow.
                parts.extend([Task::Text(" case "), Task::Node(*value, 1), Task::Text(": ")]);
                parts.push(Task::Node(*then, 1));
            }
            parts.extend([Task::Text(" else "), Task::Node(*otherwise, 0)]);
        }
        Expr::Aggregate(all) => {
            parts.push(Task::Owned(format!("{}({}", all.fold.name(), head_module(&all.head))));
            if let Some(term) = all.term {
                parts.extend([Task::Text(": "), Task::Node(term.root, 0)]);
            }
            parts.push(Task::Text(")"));
        }
        Expr::Parenthesis(a) => parts.extend([Task::Text("("), Task::Node(*a, 0), Task::Text(")")]),
    }
}

/// `2c`: a number directly before its factor. Only a name, a call or a parenthesis can stand there.
fn push_scaled(expressions: &Expressions, factor: f64, a: ExprId, own: u8, parts: &mut Vec<Task>) {
    parts.push(Task::Owned(factor.to_string()));
    let first = leftmost(expressions, a);
    let bare = matches!(first, Expr::Name(_) | Expr::Call(..) | Expr::Index(..) | Expr::Parenthesis(_))
        && strength(expressions.get(a)) >= own
        && !exponent_like(first);
    if bare {
        parts.push(Task::Node(a, own));
    } else {
        parts.extend([Task::Text("("), Task::Node(a, 0), Task::Text(")")]);
    }
}

/// The leftmost operand of an expression, which is printed first.
fn leftmost(expressions: &Expressions, mut id: ExprId) -> &Expr {
    loop {
        match expressions.get(id) {
            Expr::Binary(_, a, _) => id = *a,
            Expr::Compare(first, _) => id = *first,
            node => return node,
        }
    }
}

/// True for a name that would become part of a number before it: `2e3` is 2000, not 2 times `e3`.
fn exponent_like(expr: &Expr) -> bool {
    matches!(expr, Expr::Name(name) | Expr::Call(name, _) | Expr::Index(name, _) if name.starts_with(['e', 'E']))
}

/// A string of modules as text.
pub fn modules(expressions: &Expressions, parts: &[Part]) -> String {
    if parts.is_empty() {
        return "ε".to_owned();
    }
    let shown: Vec<String> = parts.iter().map(|one| part(expressions, one)).collect();
    shown.join(" ")
}

/// A part of a string as text. Groups nest no deeper than the layout allows.
fn part(expressions: &Expressions, part: &Part) -> String {
    let text = |e: &crate::ast::Expression| expression(expressions, e.root);
    let group = |parts: &[Part]| format!("( {} )", modules(expressions, parts));
    match part {
        Part::Module(module) => self::module(expressions, module),
        Part::Repeat(of) => {
            format!("for {} in {} .. {}: {}", of.index.text, text(&of.from), text(&of.to), group(&of.body))
        }
        Part::If(of) if of.otherwise.is_empty() => {
            format!("if {}: {}", text(&of.condition), group(&of.then))
        }
        Part::If(of) => {
            let otherwise = match &of.otherwise[..] {
                [Part::If(_)] => modules(expressions, &of.otherwise),
                parts => group(parts),
            };
            format!("if {}: {} else {otherwise}", text(&of.condition), group(&of.then))
        }
    }
}

fn module(expressions: &Expressions, module: &Module) -> String {
    let arguments: Vec<String> = module.arguments.iter().map(|a| expression(expressions, a.root)).collect();
    match arguments.is_empty() {
        true => module.name.to_string(),
        false => format!("{}({})", module.name, arguments.join(", ")),
    }
}

/// A module of a head as text.
pub fn head_module(module: &HeadModule) -> String {
    if module.parameters.is_empty() {
        module.name.text.to_string()
    } else {
        format!("{}({})", module.name.text, names(&module.parameters, ", "))
    }
}

/// Names with a separator between them.
pub(crate) fn names(names: &[Name], between: &str) -> String {
    let texts: Vec<&str> = names.iter().map(|n| &*n.text).collect();
    texts.join(between)
}

/// A rule's head as text, without the colon.
pub fn head(rule: &crate::ast::Rule) -> String {
    let side = |modules: &[HeadModule]| modules.iter().map(head_module).collect::<Vec<_>>().join(" ");
    let mut out = String::new();
    if !rule.left.is_empty() {
        out += &(side(&rule.left) + " < ");
    }
    out += &head_module(&rule.predecessor);
    if !rule.right.is_empty() {
        let mut right = rule.right.iter();
        out += " >";
        for turn in &rule.right_shape {
            out += &match turn {
                ContextPart::Open => " [".to_owned(),
                ContextPart::Close => " ]".to_owned(),
                ContextPart::Module => {
                    right.next().map_or_else(String::new, |m| " ".to_owned() + &head_module(m))
                }
            };
        }
    }
    out
}

/// The successors of a clause, with their weights.
fn alternatives(expressions: &Expressions, all: &[Alternative]) -> Vec<String> {
    let show = |a: &Alternative| match &a.weight {
        Some(weight) => {
            format!("{}: {}", expression(expressions, weight.root), modules(expressions, &a.modules))
        }
        None => modules(expressions, &a.modules),
    };
    all.iter().map(show).collect()
}

/// A discrete rule, on one line.
fn discrete_rule(expressions: &Expressions, rule: &crate::ast::Rule) -> String {
    let mut text = head(rule);
    for clause in &rule.clauses {
        if let Some(guard) = &clause.guard {
            text += &format!(" : {}", expression(expressions, guard.root));
        }
        if let Action::Produce(all) = &clause.action {
            text += &format!(" -> {}", alternatives(expressions, all).join(" or "));
        }
    }
    text
}

/// A rule: its head, then one line for each `let` and each clause.
pub(crate) fn rule(expressions: &Expressions, rule: &crate::ast::Rule) -> String {
    if rule.discrete {
        return discrete_rule(expressions, rule);
    }
    let mut text = head(rule) + ":";
    for (name, value) in &rule.locals {
        text += &format!("\n  let {} = {}", name.text, expression(expressions, value.root));
    }
    for one in &rule.clauses {
        text += "\n  ";
        text += &clause(expressions, one);
    }
    text
}

fn clause(expressions: &Expressions, clause: &Clause) -> String {
    let mut text = String::new();
    if let Some(guard) = &clause.guard {
        text += &format!("if {}\n    ", expression(expressions, guard.root));
    }
    if let Some(hazard) = &clause.hazard {
        text += &format!("at rate {}\n    ", expression(expressions, hazard.root));
    }
    match &clause.action {
        Action::Solve(equations) => {
            let all: Vec<String> = equations.iter().map(|one| equation(expressions, one)).collect();
            text += &format!("solve {}", all.join(", "));
        }
        Action::Produce(successors) => {
            text += &format!("produce {}", alternatives(expressions, successors).join("\n      or "));
        }
    }
    text
}

fn equation(expressions: &Expressions, equation: &Equation) -> String {
    let right = expression(expressions, equation.expression().root);
    match equation {
        Equation::Rate { parameter, .. } => format!("d{}/dt = {right}", parameter.text),
        Equation::Value { parameter, .. } => format!("{} = {right}", parameter.text),
        Equation::Zero { unknown: None, .. } => format!("0 = {right}"),
        Equation::Zero { unknown: Some(name), .. } => format!("0 = {right} for {}", name.text),
    }
}

/// A whole document, one declaration a line, one clause a line.
pub fn document(document: &Document) -> String {
    let mut out = String::new();
    for (item, _) in &document.items {
        out += &notation::write(&document.expressions, item);
        out.push('\n');
    }
    out
}
