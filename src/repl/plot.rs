//! `plot`: a parameter over time, drawn with Braille dots.

use std::collections::BTreeMap;

use super::braille::Sheet;
use super::loaded::{LoadedModel, misused};
use super::navigation::time_of;
use super::show::{is_called, known_name};
use super::state::{CommandError, SessionState};
use crate::interrupt;
use crate::model::{KindId, Model};
use crate::replay::Stop;
use crate::sim::brief;
use crate::study::LinearAxis;
use crate::syntax::suggest::did_you_mean;
use crate::tree::{Lineage, ModuleString};

/// The quantity that is plotted.
enum Subject {
    /// The parameter of each module of these kinds, with its index: a dot for each module.
    Each(BTreeMap<KindId, usize>),
    /// One number for all modules of these kinds.
    Whole(Summary, BTreeMap<KindId, usize>),
    Count(Vec<KindId>),
    One(Lineage, usize),
}

#[derive(Clone, Copy, PartialEq)]
enum Summary {
    Sum,
    Mean,
    Max,
    Min,
}

const SUMMARIES: [(&str, Summary); 4] =
    [("sum", Summary::Sum), ("mean", Summary::Mean), ("max", Summary::Max), ("min", Summary::Min)];

/// Width of the column of numbers on the left.
const MARGIN: usize = 11;
const INK: [u8; 3] = [90, 170, 90];

impl LoadedModel<'_> {
    /// `plot SPEC [A..B]`
    pub fn plot(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let (range, words) = match rest.split_last() {
            Some((last, words)) if last.contains("..") && !words.is_empty() => (Some(last), words),
            _ => (None, rest),
        };
        let present = self.replay()?.time();
        let (from, to) = match range.and_then(|range| range.split_once("..")) {
            Some((a, b)) => (time_of(a)?, time_of(b)?),
            None => match self.session.model.frames {
                _ if present > 0.0 => (0.0, present),
                Some(frames) if frames.to > 0.0 => (0.0, frames.to),
                _ => {
                    return Err(CommandError::new(
                        "at t = 0 there is nothing to plot; `run` first, or say from when to when, as in `plot F.x 0..10`",
                    ));
                }
            },
        };
        if to <= from {
            return Err(CommandError::new(format!(
                "{} .. {} is no stretch of time",
                brief(from, 9),
                brief(to, 9)
            )));
        }
        let (subject, title) = self.subject(words, state)?;
        // An odd number of rows has a row in the middle.
        let sheet_rows = (state.screen.rows - 6).clamp(6, 16) | 1;
        let mut sheet = Sheet::new(state.screen.columns - MARGIN - 2, sheet_rows);
        let Some(columns) = self.sample(&subject, [from, to], sheet.size()[0], state)? else {
            return state.say("stopped\n");
        };
        let Some(axis) = value_axis(&columns, sheet.size()[1]) else {
            return state.say("there is no such module from first to last\n");
        };
        let joined = !matches!(subject, Subject::Each(_));
        dots(&mut sheet, &columns, &axis, joined);
        let range = [axis.high, axis.low];
        let width = sheet.size()[0] / 2;
        state.say(&framed(&sheet.rows(state.screen.coloured), &title, [from, to], range, width))
    }

    /// The values of a subject at equidistant times, one column of dots each; `None` if the user has stopped it. The
    /// replay is back at the present afterwards.
    fn sample(
        &mut self,
        subject: &Subject,
        [from, to]: [f64; 2],
        width: usize,
        state: &SessionState,
    ) -> Result<Option<Vec<Vec<f64>>>, CommandError> {
        let present = self.replay()?.time();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let (mut interrupted, mut failed) = (false, None);
        for i in 0..width {
            let t = from + (to - from) * i as f64 / (width - 1) as f64;
            match self.replay()?.seek(t) {
                Ok(stop) => interrupted = stop == Stop::Interrupted,
                Err(error) => failed = Some(error),
            }
            if interrupted || failed.is_some() {
                break;
            }
            columns.push(subject.values(self.string(state)?));
        }
        // The way back is short and cannot be left out.
        interrupt::clear();
        let gone = self.replay()?.seek(present);
        self.arrive(gone, state)?;
        match failed {
            Some(error) => Err(self.drawn(&error, state)),
            None => Ok((!interrupted).then_some(columns)),
        }
    }

    fn subject(&mut self, words: &[String], state: &SessionState) -> Result<(Subject, String), CommandError> {
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        match words[..] {
            ["count", name] => {
                let model = &self.session.model;
                let name = known_name(model, name)?;
                let kinds = model.kinds.iter().map(|(id, _)| id).filter(|id| is_called(model, *id, name));
                Ok((Subject::Count(kinds.collect()), format!("number of {name}")))
            }
            [spec] if spec.starts_with('#') => {
                let Some((number, parameter)) = spec[1..].split_once('.') else {
                    return Err(misused("plot"));
                };
                let (number, lineage) = self.find(&[number.to_owned()], state)?;
                let model = &self.session.model;
                let module = super::show::modules(self.string(state)?).find(|m| m.number == number);
                let kind = module.map(|m| m.module.kind).unwrap_or(KindId::OPEN);
                let place = parameter_place(model, kind, parameter)?;
                let name = &model.kinds.get(kind).name;
                Ok((Subject::One(lineage, place), format!("{parameter} of {name}, module {number}")))
            }
            [spec] => {
                let kinds = self.kinds_with(spec)?;
                Ok((Subject::Each(kinds), format!("{spec}, each module a dot")))
            }
            [how, spec] => match SUMMARIES.iter().find(|(name, _)| *name == how) {
                Some((_, summary)) => {
                    let kinds = self.kinds_with(spec)?;
                    Ok((Subject::Whole(*summary, kinds), format!("{how} of {spec}")))
                }
                None => Err(CommandError::new(format!("`{how}` is none of sum, mean, max, min, count"))),
            },
            _ => Err(misused("plot")),
        }
    }

    /// The kinds denoted by `NAME.PARAM`.
    fn kinds_with(&self, spec: &str) -> Result<BTreeMap<KindId, usize>, CommandError> {
        let model = &self.session.model;
        let Some((name, parameter)) = spec.rsplit_once('.').filter(|(name, _)| !name.is_empty()) else {
            let all = model.kinds.iter().find(|(id, _)| is_called(model, *id, spec));
            let own = all.map(|(id, _)| model.parameter_names(id)).unwrap_or_default();
            let example = own.first().map_or("F.x".to_owned(), |parameter| format!("{spec}.{parameter}"));
            return Err(CommandError::new(format!("say which parameter, as in `plot {example}`")));
        };
        let name = known_name(model, name)?;
        let mut kinds = BTreeMap::new();
        let mut missing = None;
        for (id, _) in model.kinds.iter().filter(|(id, _)| is_called(model, *id, name)) {
            match parameter_place(model, id, parameter) {
                Ok(place) => drop(kinds.insert(id, place)),
                Err(error) => missing = Some(error),
            }
        }
        match missing {
            Some(error) if kinds.is_empty() => Err(error),
            _ => Ok(kinds),
        }
    }
}

/// The index of a parameter, given by name or by number from 1.
fn parameter_place(model: &Model, kind: KindId, parameter: &str) -> Result<usize, CommandError> {
    let names = model.parameter_names(kind);
    let kind = model.kinds.get(kind);
    let number = parameter.parse::<usize>().ok().filter(|n| (1..=kind.arity).contains(n));
    if let Some(place) = names.iter().position(|name| name == parameter).or(number.map(|n| n - 1)) {
        return Ok(place);
    }
    if names.is_empty() {
        return Err(CommandError::new(format!("`{}` has no parameters", kind.name)));
    }
    let hint = did_you_mean(parameter, names.iter().map(String::as_str));
    let hint = hint.unwrap_or_else(|| format!("it has {}", names.join(", ")));
    Err(CommandError::new(format!("`{}` has no parameter `{parameter}`; {hint}", kind.name)))
}

impl Subject {
    /// The values for a string.
    fn values(&self, string: &ModuleString) -> Vec<f64> {
        let of = |kinds: &BTreeMap<KindId, usize>| -> Vec<f64> {
            let value =
                |m: crate::tree::Module| kinds.get(&m.kind).and_then(|i| m.parameters.get(*i)).copied();
            string.iter().filter_map(value).collect()
        };
        match self {
            Subject::Each(kinds) => of(kinds),
            Subject::Count(kinds) => vec![string.iter().filter(|m| kinds.contains(&m.kind)).count() as f64],
            Subject::One(lineage, place) => {
                let own = |m: &crate::tree::Module| m.lineage == *lineage && !m.kind.is_bracket();
                string.iter().find(own).and_then(|m| m.parameters.get(*place).copied()).into_iter().collect()
            }
            Subject::Whole(summary, kinds) => {
                let all = of(kinds);
                let sum: f64 = all.iter().sum();
                match summary {
                    Summary::Sum => vec![sum],
                    _ if all.is_empty() => Vec::new(),
                    Summary::Mean => vec![sum / all.len() as f64],
                    Summary::Max => vec![all.iter().copied().fold(f64::NEG_INFINITY, f64::max)],
                    Summary::Min => vec![all.iter().copied().fold(f64::INFINITY, f64::min)],
                }
            }
        }
    }
}

/// The vertical axis, from the top row of dots to the bottom one; `None` without values. Zero is included where it is
/// near the values.
fn value_axis(columns: &[Vec<f64>], height: usize) -> Option<LinearAxis> {
    let values = || columns.iter().flatten().copied().filter(|x| x.is_finite());
    values().next()?;
    let mut axis = LinearAxis::around(values(), 0.0, (height - 1) as f64);
    if axis.low > 0.0 && axis.low < 0.3 * axis.high {
        axis.low = 0.0;
    }
    if axis.high < 0.0 && axis.high > 0.3 * axis.low {
        axis.high = 0.0;
    }
    // Rows are counted from the top.
    Some(LinearAxis { low: axis.high, high: axis.low, ..axis })
}

/// Draws values as dots, or joins the first ones of adjacent columns by lines.
fn dots(sheet: &mut Sheet, columns: &[Vec<f64>], axis: &LinearAxis, joined: bool) {
    for (i, values) in columns.iter().enumerate() {
        for &x in values.iter().filter(|x| x.is_finite()) {
            let before =
                i.checked_sub(1).and_then(|i| columns[i].first()).filter(|x| joined && x.is_finite());
            match before {
                Some(&y) => {
                    sheet.line([i as f64 - 1.0, axis.place(y)], [i as f64, axis.place(x)], Some(INK));
                }
                None => sheet.dot(i, axis.place(x).round() as usize, Some(INK)),
            }
        }
    }
}

/// The dots with a frame and its numbers.
fn framed(rows: &[String], title: &str, [from, to]: [f64; 2], [low, high]: [f64; 2], width: usize) -> String {
    let mut out = format!("{:MARGIN$}{title}\n", "");
    let middle = rows.len() / 2;
    for (i, row) in rows.iter().enumerate() {
        let number = match i {
            0 => brief(high, 5),
            i if i + 1 == rows.len() => brief(low, 5),
            i if i == middle && rows.len() > 8 => brief(0.5 * (high + low), 5),
            _ => String::new(),
        };
        let tick = if number.is_empty() { '│' } else { '┤' };
        out += format!("{number:>w$} {tick}{row}", w = MARGIN - 2).trim_end();
        out.push('\n');
    }
    out += &format!("{:w$}└{}\n", "", "─".repeat(width), w = MARGIN - 1);
    let (first, last) = (format!("t = {}", brief(from, 6)), brief(to, 6));
    let gap = width.saturating_sub(first.chars().count() + last.chars().count());
    out + &format!("{:MARGIN$}{first}{:gap$}{last}\n", "", "")
}
