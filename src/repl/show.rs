//! Commands about modules and texts: `list`, `show`, `inspect`, `events`.

use super::assist::coloured;
use super::loaded::{LoadedModel, misused};
use super::state::{CommandError, SessionState};
use crate::diagnostic::Span;
use crate::model::{KindId, Model};
use crate::session::Session;
use crate::sim::{InspectedModule, Inspection, brief, describe};
use crate::syntax::suggest::did_you_mean;
use crate::tree::{Lineage, Module, ModuleString};

/// Default number of lines of a string, or rows of a table.
const MOST_LINES: usize = 16;
/// Default number of productions in `events`.
const MOST_EVENTS: usize = 20;

/// A module of the present string with its number, without brackets.
pub struct Numbered<'a> {
    pub number: usize,
    pub module: Module<'a>,
}

/// All modules, numbered from 1.
pub fn modules(string: &ModuleString) -> impl Iterator<Item = Numbered<'_>> {
    let all = string.iter().filter(|module| !module.kind.is_bracket());
    all.zip(1..).map(|(module, number)| Numbered { number, module })
}

/// True if a name denotes a kind: the name of the kind or, without `_`, its base name.
pub fn is_called(model: &Model, kind: KindId, name: &str) -> bool {
    let kind = model.kinds.get(kind);
    kind.name == name || !name.contains('_') && kind.base() == name
}

/// Checks that the model has modules of a name.
pub fn known_name<'n>(model: &Model, name: &'n str) -> Result<&'n str, CommandError> {
    let kinds = || model.kinds.iter().filter(|(id, _)| !id.is_bracket());
    if kinds().any(|(id, _)| is_called(model, id, name)) {
        return Ok(name);
    }
    let hint = did_you_mean(name, kinds().map(|(_, kind)| kind.name.as_str()));
    let hint = hint.map_or(String::new(), |hint| format!("; {hint}"));
    Err(CommandError::new(format!("the model has no module `{name}`{hint}")))
}

impl LoadedModel<'_> {
    /// `list [NAME]`
    pub fn list(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let text = &state.draft.text;
        let names = state.names.borrow();
        let wanted: Vec<bool> = match rest {
            [] => text.lines().map(|_| true).collect(),
            [name] => {
                let mut wanted = vec![false; text.lines().count()];
                let position = |byte: usize| text[..byte].matches('\n').count();
                for entry in crate::syntax::outline::outline(text) {
                    let range = entry.span.range();
                    let part = |c: char| c.is_alphanumeric() || c == '_' || c == '@';
                    let own = &text[range.clone()];
                    if own.split(|c| !part(c)).any(|word| word == name) || entry.name == *name {
                        let lines = position(range.start)..=position(range.end.max(range.start + 1) - 1);
                        lines.for_each(|line| wanted[line] = true);
                    }
                }
                if !wanted.contains(&true) {
                    return Err(CommandError::new(format!("nothing in the text mentions `{name}`")));
                }
                wanted
            }
            _ => return Err(misused("list")),
        };
        if text.trim().is_empty() {
            return state.say("nothing was typed yet, and no file is loaded\n");
        }
        let mut out = String::new();
        for ((line, number), _) in text.lines().zip(1..).zip(wanted).filter(|(_, wanted)| *wanted) {
            let shown = if state.screen.coloured { coloured(line, &names) } else { line.to_owned() };
            out += format!("{number:>4}  {shown}").trim_end();
            out.push('\n');
        }
        state.say(&out)
    }

    /// `show [all | A..B | NAME]`
    pub fn show(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let model = &self.session.model;
        self.string(state)?;
        let status = self.status()?;
        let present = self.string(state)?;
        match rest {
            [] => state.say(&(status + &string(model, present, state.screen.columns, MOST_LINES))),
            [all] if all == "all" => {
                state.say(&(status + &string(model, present, state.screen.columns, usize::MAX)))
            }
            [range] if range.starts_with(|c: char| c.is_ascii_digit()) => {
                let (from, to) = range.split_once("..").unwrap_or((range, range));
                let number = |text: &str| text.parse::<usize>().ok().filter(|n| *n >= 1);
                let (Some(from), Some(to)) = (number(from), number(to)) else {
                    return Err(CommandError::new(format!(
                        "`{range}` is no part of the string: `show 10..20` is from the 10th to the 20th module"
                    )));
                };
                let rows = modules(present).filter(|m| (from..=to).contains(&m.number));
                state.say(&table(model, rows, usize::MAX)?)
            }
            [name, more @ ..] if more.is_empty() || more == ["all"] => {
                let name = known_name(model, name)?;
                let rows = modules(present).filter(|m| is_called(model, m.module.kind, name));
                let most = if more.is_empty() { MOST_LINES } else { usize::MAX };
                state.say(&table(model, rows, most)?)
            }
            _ => Err(misused("show")),
        }
    }

    /// The module denoted by the arguments of a command: number and lineage.
    pub fn find(&mut self, rest: &[String], state: &SessionState) -> Result<(usize, Lineage), CommandError> {
        let model = &self.session.model;
        let present = self.string(state)?;
        let found = |m: Option<Numbered>, what: String| match m {
            Some(m) => Ok((m.number, m.module.lineage)),
            None => Err(CommandError::new(format!("{what} at present; `show` lists the modules"))),
        };
        let count = modules(present).count();
        let words: Vec<&str> = rest.iter().map(|word| word.trim_start_matches('#')).collect();
        let number = |text: &str| text.parse::<usize>().ok();
        match words[..] {
            [word] if number(word).is_some() => {
                let n = number(word).unwrap_or(0);
                found(
                    modules(present).find(|m| m.number == n),
                    format!("no module has the number {n} (the last is {count})"),
                )
            }
            [word]
                if word.contains('.')
                    || word.starts_with('…')
                    || word.len() == 13 && number(&word[..1]).is_some() =>
            {
                let is_it =
                    |m: &Numbered| m.module.lineage.to_string() == word || m.module.lineage.name() == word;
                found(modules(present).find(is_it), format!("there is no module of the lineage {word}"))
            }
            [name] | [name, _] => {
                let name = known_name(model, name)?;
                let nth = match words.get(1) {
                    None => 1,
                    Some(text) => match number(text).filter(|n| *n >= 1) {
                        Some(n) => n,
                        None => return Err(CommandError::new(format!("`{text}` is not a number from 1"))),
                    },
                };
                let mut all = modules(present).filter(|m| is_called(model, m.module.kind, name));
                let which = if nth == 1 {
                    format!("there is no `{name}`")
                } else {
                    format!("there are not {nth} `{name}`")
                };
                found(all.nth(nth - 1), which)
            }
            _ => Err(misused("inspect")),
        }
    }

    /// `inspect N | NAME [N] | LINEAGE`
    pub fn inspect(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let (number, lineage) = self.find(rest, state)?;
        let limit = self.horizon(self.time().unwrap_or(0.0));
        let session = self.session;
        let model = &session.model;
        let replay = self.replay()?;
        let t = replay.time();
        let end = replay.end_of(lineage, limit);
        let Some(all) = replay.simulation().ok().and_then(|now| now.inspect(t, number - 1)) else {
            return Err(CommandError::new("this module cannot be looked at now"));
        };
        let present = self.string(state)?;
        let count = modules(present).count();
        let mut out = format!("{}\n", described(model, &all.module));
        let ago = brief(t - all.birth, 6);
        out += &format!(
            "  module {number} of {count}, lineage {lineage}, born at t = {} ({ago} old)\n",
            brief(all.birth, 9)
        );
        out += &rule_line(session, &all);
        out += &state_lines(model, &all);
        out += &neighbour_lines(model, &all, present);
        out += &match end {
            Some(event) => {
                let rule = &model.rules[event.rule];
                let clause = line_of(session, rule.produces[event.clause].span);
                let t = brief(event.time, 9);
                format!("  next      replaced at t = {t}, by line {clause} ({})\n", rule.label)
            }
            None => format!("  next      no production up to t = {}\n", brief(limit, 9)),
        };
        state.say(&out)
    }

    /// `events [N | all] [NAME]`
    pub fn events(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let session = self.session;
        let model = &session.model;
        let (most, rest) = match rest {
            [first, rest @ ..] if first == "all" => (usize::MAX, rest),
            [first, rest @ ..] if first.starts_with(|c: char| c.is_ascii_digit()) => match first.parse() {
                Ok(n) => (n, rest),
                Err(_) => return Err(CommandError::new(format!("`{first}` is not a number"))),
            },
            rest => (MOST_EVENTS, rest),
        };
        let name = match rest {
            [] => None,
            [name] => Some(known_name(model, name)?),
            _ => return Err(misused("events")),
        };
        let replay = self.replay()?;
        let wanted = |kind: KindId| name.is_none_or(|name| is_called(model, kind, name));
        let count = replay.events().filter(|event| wanted(event.kind)).count();
        let forgotten = replay.forgotten_events();
        if count == 0 {
            return state.say("no productions so far\n");
        }
        let mut out = String::new();
        if forgotten > 0 {
            out += &format!("the first {forgotten} productions of the run are forgotten\n");
        }
        if count > most {
            out += &format!("the last {most} of {count}; `events all` lists all\n");
        }
        let rows = replay.events().filter(|event| wanted(event.kind)).skip(count.saturating_sub(most)).map(
            |event| {
                let rule = &model.rules[event.rule];
                let (line, _) = session.source.position(rule.produces[event.clause].span.start);
                [
                    brief(event.time, 9),
                    model.kinds.get(event.kind).name.clone(),
                    format!("line {line}"),
                    event.lineage.to_string(),
                ]
            },
        );
        out += &columns(["t", "module", "replaced by", "lineage"], rows.collect());
        state.say(&out)
    }
}

fn line_of(session: &Session, span: Span) -> usize {
    session.source.position(span.start).0
}

fn described(model: &Model, seen: &InspectedModule) -> String {
    describe(model, seen.kind, &seen.parameters)
}

/// `inspect`: the rule that applies, and its active equations.
fn rule_line(session: &Session, all: &Inspection) -> String {
    let model = &session.model;
    let mut out = match all.rule {
        Some(rule) => {
            let line = line_of(session, model.rules[rule].span);
            format!("  rule      {}, line {line}", model.rules[rule].label)
        }
        None if model.kinds.get(all.module.kind).rules.is_empty() => {
            "  rule      none: it stays as it is".to_owned()
        }
        None => "  rule      none whose context is there: it stays as it is".to_owned(),
    };
    if let (Some(rule), Some(solve)) = (all.rule, all.solve) {
        out += &format!("; equations of line {}", line_of(session, model.rules[rule].solves[solve].span));
    }
    out + "\n"
}

/// `inspect`: parameters and their rates.
fn state_lines(model: &Model, all: &Inspection) -> String {
    let names = match all.rule {
        Some(rule) => model.rules[rule].parameters.clone(),
        None => model.parameter_names(all.module.kind),
    };
    let mut rows = Vec::new();
    for (i, value) in all.module.parameters.iter().enumerate() {
        let parameter = names.get(i).cloned().unwrap_or_default();
        let rate = all.rates.get(i).copied().unwrap_or(0.0);
        rows.push([parameter.clone(), brief(*value, 9), format!("d{parameter}/dt"), brief(rate, 9)]);
    }
    let width = |k: usize| rows.iter().map(|row: &[String; 4]| row[k].chars().count()).max().unwrap_or(0);
    let [a, b, c] = [width(0), width(1), width(2)];
    let mut out = String::new();
    for ([parameter, value, rate, of], i) in rows.iter().zip(0..) {
        let title = if i == 0 { "state" } else { "" };
        out += &format!("  {title:8}  {parameter:a$} = {value:b$}   {rate:c$} = {of}\n");
    }
    out
}

/// `inspect`: the neighbours, and other modules of the context.
fn neighbour_lines(model: &Model, all: &Inspection, present: &ModuleString) -> String {
    let mut out = String::new();
    for (title, seen) in [("left", &all.left), ("right", &all.right)] {
        let Some(seen) = seen else {
            out += &format!("  {title:8}  none\n");
            continue;
        };
        let at = modules(present).find(|m| m.module.lineage == seen.lineage).map_or(0, |m| m.number);
        let is_read = all.context.iter().any(|other| other.lineage == seen.lineage);
        let read = if is_read { ", in the rule's context" } else { "" };
        out += &format!("  {title:8}  {} (module {at}{read})\n", described(model, seen));
    }
    let apart = |seen: &&InspectedModule| {
        [&all.left, &all.right].into_iter().flatten().all(|n| n.lineage != seen.lineage)
    };
    for seen in all.context.iter().filter(apart) {
        out += &format!("  context   {}\n", described(model, seen));
    }
    out
}

/// The string in the notation of the language.
fn string(model: &Model, all: &ModuleString, width: usize, most: usize) -> String {
    let (mut out, mut lines, mut line, mut shown) = (String::new(), 0, String::new(), 0);
    let count = |range: std::ops::Range<usize>| range.filter(|i| !all.get(*i).kind.is_bracket()).count();
    for (i, module) in all.iter().enumerate() {
        let text = describe(model, module.kind, module.parameters);
        if !line.is_empty() && 2 + line.chars().count() + 1 + text.chars().count() > width {
            out += &format!("  {line}\n");
            line.clear();
            lines += 1;
            if lines >= most {
                let rest = count(i..all.len());
                return out
                    + &format!(
                        "… {rest} more modules; `show all` prints them, `show NAME` those of one name\n"
                    );
            }
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += &text;
        shown += 1;
    }
    if shown == 0 {
        return "  ε\n".to_owned();
    }
    out + &format!("  {line}\n")
}

/// Modules with numbers, ages and lineages.
fn table<'a>(
    model: &Model,
    rows: impl Iterator<Item = Numbered<'a>>,
    most: usize,
) -> Result<String, CommandError> {
    let mut all = rows.peekable();
    if all.peek().is_none() {
        return Ok("there are none at present\n".to_owned());
    }
    let row = |m: Numbered| {
        let module = &m.module;
        [
            m.number.to_string(),
            describe(model, module.kind, module.parameters),
            brief(module.age, 6),
            module.lineage.to_string(),
        ]
    };
    let shown: Vec<[String; 4]> = all.by_ref().take(most).map(row).collect();
    let mut text = columns(["#", "module", "age", "lineage"], shown);
    match all.count() {
        0 => {}
        more => text += &format!("… {more} more; `all` after the name prints them\n"),
    }
    Ok(text)
}

/// Rows under headings, in aligned columns.
fn columns(heads: [&str; 4], rows: Vec<[String; 4]>) -> String {
    let mut all = vec![heads.map(str::to_owned)];
    all.extend(rows);
    let width = |k: usize| all.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let [a, b, c] = [width(0), width(1), width(2)];
    let mut out = String::new();
    for [w, x, y, z] in &all {
        out += format!("  {w:>a$}  {x:b$}  {y:c$}  {z}").trim_end();
        out.push('\n');
    }
    out
}
