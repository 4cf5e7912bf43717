//! Commands about time: `run`, `step`, `back`, `time`.

use super::grammar::{Statement, classify};
use super::loaded::{LoadedModel, NextStep, misused};
use super::state::{CommandError, SessionState};
use crate::replay::Stop;
use crate::sim::{Event, brief};

/// Largest number of lines about passed events.
const MOST_LINES: usize = 8;
/// Largest number of events in one command.
const MOST_EVENTS: usize = 1_000_000;
/// Time span in which the next event is searched for if the model has no `frames`.
const FAR: f64 = 100.0;

/// Parses a time, which must not be negative.
pub fn time_of(text: &str) -> Result<f64, CommandError> {
    match text.parse::<f64>() {
        Ok(t) if t.is_finite() && t >= 0.0 => Ok(t + 0.0),
        Ok(t) if t < 0.0 => Err(CommandError::new(format!("time begins at 0, and {text} is before that"))),
        _ => Err(CommandError::new(format!("`{text}` is not a time: a number such as 2.5 is"))),
    }
}

fn count_of(text: &str) -> Result<usize, CommandError> {
    match text.parse::<usize>() {
        Ok(n) if (1..=MOST_EVENTS).contains(&n) => Ok(n),
        _ => Err(CommandError::new(format!("`{text}` is not a number from 1 to {MOST_EVENTS}"))),
    }
}

impl LoadedModel<'_> {
    /// `run [T | +DT]`
    pub fn run(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let frames = self.session.model.frames;
        let present = self.replay()?.time();
        let t = match rest {
            [] => match frames {
                Some(frames) => frames.to,
                None => {
                    return Err(CommandError::new(
                        "the model has no `frames`: say to which time, as in `run 10`",
                    ));
                }
            },
            [text] => match text.strip_prefix('+') {
                Some(more) => present + time_of(more)?,
                None => time_of(text)?,
            },
            _ => return Err(misused("run")),
        };
        self.go(t, state)
    }

    fn go(&mut self, t: f64, state: &SessionState) -> Result<(), CommandError> {
        let gone = self.replay()?.seek(t);
        self.arrive(gone, state)?;
        state.say(&self.status()?)
    }

    /// `step [N | frame [N]]`
    pub fn step(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        self.replay()?;
        let words: Vec<&str> = rest.iter().map(String::as_str).collect();
        let count = match words[..] {
            [] | ["event"] => 1,
            ["frame"] => return self.step_frames(1, state),
            ["frame", n] => return self.step_frames(count_of(n)? as i64, state),
            [n] | ["event", n] => count_of(n)?,
            _ => return Err(misused("step")),
        };
        let start = self.replay()?.time();
        let limit = self.horizon(start);
        for _ in 0..count {
            let before = self.replay()?.time();
            let gone = self.replay()?.seek_event(limit.max(before));
            match self.arrive(gone, state)? {
                Stop::There => {}
                Stop::Interrupted => break,
                Stop::Nothing => {
                    // Without an event the time does not change.
                    let gone = self.replay()?.seek(before);
                    self.arrive(gone, state)?;
                    let what = if count == 1 { "no event" } else { "no more events" };
                    state.say(&format!(
                        "{what} up to t = {}; `run T` goes there, or beyond\n",
                        brief(limit, 12)
                    ))?;
                    break;
                }
            }
        }
        state.say(&(self.status()? + &self.happened_since(start)?))
    }

    /// `back [N | frame [N] | to T]`
    pub fn back(&mut self, rest: &[String], state: &SessionState) -> Result<(), CommandError> {
        let present = self.replay()?.time();
        let words: Vec<&str> = rest.iter().map(String::as_str).collect();
        let count = match words[..] {
            [] | ["event"] => 1,
            ["frame"] => return self.step_frames(-1, state),
            ["frame", n] => return self.step_frames(-(count_of(n)? as i64), state),
            ["to", t] => {
                let t = time_of(t)?;
                if t > present {
                    let (t, present) = (brief(t, 12), brief(present, 12));
                    return Err(CommandError::new(format!(
                        "t = {t} is after t = {present}; `run {t}` goes there"
                    )));
                }
                return self.go(t, state);
            }
            [n] | ["event", n] => count_of(n)?,
            _ => return Err(misused("back")),
        };
        if present == 0.0 {
            return state.say("this is the start, t = 0\n");
        }
        for _ in 0..count {
            let gone = self.replay()?.seek_event_before();
            match self.arrive(gone, state)? {
                Stop::There => {}
                Stop::Interrupted => break,
                Stop::Nothing => {
                    state.say("no event before that: the start\n")?;
                    break;
                }
            }
        }
        state.say(&self.status()?)
    }

    /// Moves by a number of frames, backwards if it is negative.
    fn step_frames(&mut self, count: i64, state: &SessionState) -> Result<(), CommandError> {
        let Some(frames) = self.session.model.frames else {
            return Err(CommandError::new(
                "the model has no `frames`; type them, as in `frames 0 .. 10 step 0.1`, or go by `run +0.1`",
            ));
        };
        let t = self.replay()?.time();
        let place = (t - frames.from) / frames.step;
        let last = frames.count() as i64 - 1;
        // A time that differs from a frame only by rounding counts as that frame.
        let near = place.round();
        let at_frame = (place - near).abs() < 1e-6;
        let here = if at_frame {
            near
        } else if count > 0 {
            place.floor()
        } else {
            place.ceil()
        };
        let wanted = (here as i64).saturating_add(count);
        let index = wanted.clamp(0, last);
        if wanted != index {
            state.say(if count > 0 { "this is the last frame\n" } else { "this is the first frame\n" })?;
        }
        let target = frames.time(index as usize);
        let beyond = if count > 0 { target < t } else { target > t };
        self.go(if beyond { t } else { target }, state)
    }

    /// The time up to which events are searched for.
    pub fn horizon(&self, t: f64) -> f64 {
        match self.session.model.frames {
            Some(frames) if t < frames.to => frames.to,
            Some(frames) if frames.to > frames.from => t + (frames.to - frames.from),
            _ => t + FAR,
        }
    }

    /// Time, modules and productions in a line.
    pub fn status(&mut self) -> Result<String, CommandError> {
        let replay = self.replay()?;
        let plural = |n: usize, word: &str| format!("{n} {word}{}", if n == 1 { "" } else { "s" });
        Ok(format!(
            "t = {}: {}, {} so far\n",
            brief(replay.time(), 12),
            plural(replay.modules(), "module"),
            plural(replay.productions(), "production")
        ))
    }

    /// The productions after a time, grouped by clause and instant.
    fn happened_since(&mut self, start: f64) -> Result<String, CommandError> {
        let session = self.session;
        let replay = self.replay()?;
        let mut groups: Vec<(&Event, usize)> = Vec::new();
        let new: Vec<&Event> = replay.events().rev().take_while(|event| event.time > start).collect();
        for event in new.into_iter().rev() {
            let same = |(other, _): &&mut (&Event, usize)| {
                (other.group, other.rule, other.clause) == (event.group, event.rule, event.clause)
            };
            match groups.iter_mut().rev().take(8).find(same) {
                Some((_, count)) => *count += 1,
                None => groups.push((event, 1)),
            }
        }
        let mut text = String::new();
        let hidden = groups.len().saturating_sub(MOST_LINES);
        if hidden > 0 {
            text += &format!("  … {hidden} more before these; `events` lists them\n");
        }
        for (event, count) in &groups[hidden..] {
            let rule = &session.model.rules[event.rule];
            let (line, _) = session.source.position(rule.produces[event.clause].span.start);
            let many = if *count > 1 { format!(", {count} times") } else { String::new() };
            text += &format!("  t = {}: {}, line {line}{many}\n", brief(event.time, 9), rule.label);
        }
        Ok(text)
    }

    /// `time [COMMAND …]`
    pub fn clock(&mut self, rest: &[String], state: &mut SessionState) -> Result<NextStep, CommandError> {
        if !rest.is_empty() {
            let text = rest.join(" ");
            let statement = Statement { kind: classify(&text), text, line: 0 };
            let before = std::time::Instant::now();
            let flow = self.obey(&statement, state)?;
            state.say(&format!("{:.3} s\n", before.elapsed().as_secs_f64()))?;
            return Ok(flow);
        }
        let frames = self.session.model.frames;
        self.settle(state)?;
        let mut text = self.status()?;
        let replay = self.replay()?;
        if let Some(frames) = frames {
            text += &format!(
                "  frames from {} to {}, every {}\n",
                brief(frames.from, 9),
                brief(frames.to, 9),
                brief(frames.step, 9)
            );
        }
        let (marks, bytes) = replay.marks();
        let stats = match replay.simulation() {
            Ok(simulation) => simulation.stats(),
            Err(error) => return Err(self.drawn(&error, state)),
        };
        text += &format!(
            "  up to here: {} productions, {} steps, {} evaluations of rates, at most {} modules\n  for going back: {marks} marks, {:.1} MB\n",
            stats.events,
            stats.steps,
            stats.rhs_evaluations,
            stats.peak_modules,
            bytes as f64 / 1e6
        );
        state.say(&text)?;
        Ok(NextStep::Continue)
    }
}
