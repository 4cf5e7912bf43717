//! `dlsys check` and `dlsys run`.

use std::io::Write;
use std::time::Instant;

use super::args::{CheckArgs, RunArgs};
use super::common::{Failure, ModelRun, count_of, out_error};
use super::events::EventLog;
use super::export;
use super::progress::Progress;
use super::shared::TextFormat;
use crate::model::Model;
use crate::sim::{Passed, describe};
use crate::tree::ModuleString;

/// Reads a model and reports on it.
pub fn check(args: &CheckArgs) -> Result<(), Failure> {
    let session = super::common::open(&args.model, &args.settings, &args.include)?;
    let model = &session.model;
    let title = model.title.as_ref().map_or(String::new(), |t| format!("{t}: "));
    let warnings = session.warnings.len();
    let summary = format!(
        "{title}{}, {} of modules, {}, {}",
        count_of(model.rules.len(), "rule"),
        // Without the two brackets, which are kinds as well.
        count_of(model.kinds.len() - 2, "kind"),
        count_of(model.parameters.len(), "param"),
        if warnings == 0 { "no warnings".to_owned() } else { count_of(warnings, "warning") }
    );
    writeln!(std::io::stdout(), "{summary}").map_err(out_error)?;
    if args.continuity { super::continuity::check(args, &session) } else { Ok(()) }
}

/// Parts of a run to a single time, for its progress.
const WAY: usize = 1000;
/// Least number of events and steps between updates of the progress.
const STRIDE: usize = 1000;

/// Runs a model and prints its strings.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let format = match args.format.of_text() {
        Ok(format) => format,
        Err(format) => return export::run(args, format),
    };
    export::refuse_flags(args)?;
    if let Some(path) = &args.field {
        return super::field::sample(args, path, format);
    }
    let run = ModelRun::start(&args.shared)?;
    if let Some(seeds) = args.seeds {
        return super::specimens::summarise(args, &run, seeds, format);
    }
    let run = run.on_threads(args.threads);
    let mut clock = run.clock;
    let mut out = std::io::BufWriter::with_capacity(1 << 16, std::io::stdout().lock());
    let printer = Printer::new(&run.session.model);
    let mut events = EventLog::create(args.shared.events.as_deref(), &run)?;
    let result = (|| -> Result<_, Failure> {
        let mut simulation = run.simulate()?;
        let mut string = ModuleString::default();
        let mut text = String::new();
        // For a single observed time, the progress is that of the simulated time.
        let alone = run.times.len() == 1;
        let mut progress = match alone {
            true => Progress::new("running", WAY),
            false => Progress::of_printed("running", run.times.len()),
        };
        for &t in &run.times {
            let before = Instant::now();
            while alone && let Ok(Passed::Some) = simulation.pass_piece(t, STRIDE) {
                progress.reach(simulation.reached() / t);
            }
            let done = simulation.at(t, &mut string);
            clock.simulate += before.elapsed();
            if let Some(log) = &mut events {
                log.write(&simulation.take_events())?;
            }
            done.map_err(|error| run.fault(&error))?;
            let before = Instant::now();
            text.clear();
            match format {
                TextFormat::Json => printer.json(&string, &mut text),
                TextFormat::Text => printer.text(&string, &mut text),
            }
            out.write_all(text.as_bytes()).map_err(out_error)?;
            clock.output += before.elapsed();
            if !alone {
                progress.inc();
            }
        }
        run.note(simulation.remarks());
        Ok(simulation.stats())
    })();
    // Results before an error are written before the error is reported.
    events.map_or(Ok(()), EventLog::finish)?;
    out.flush().map_err(out_error)?;
    drop(out);
    run.warn();
    run.write_stats(&args.shared, clock, result?)?;
    if args.verify.verify { super::verify::verify(&args.verify, &run) } else { Ok(()) }
}

/// Writes strings of modules as text.
pub struct Printer<'m> {
    model: &'m Model,
    /// The name of each kind as a JSON string.
    names: Vec<String>,
}

impl<'m> Printer<'m> {
    pub fn new(model: &'m Model) -> Printer<'m> {
        let names =
            model.kinds.iter().map(|(_, kind)| serde_json::Value::from(kind.name.as_str()).to_string());
        Printer { model, names: names.collect() }
    }

    /// One line: the time, and each module as its name and parameters.
    pub fn json(&self, string: &ModuleString, out: &mut String) {
        out.push_str("{\"t\":");
        number(string.time, out);
        out.push_str(",\"modules\":[");
        for (i, module) in string.iter().enumerate() {
            out.push_str(if i == 0 { "[" } else { ",[" });
            out.push_str(&self.names[module.kind.index()]);
            out.push_str(",[");
            for (j, &x) in module.parameters.iter().enumerate() {
                if j > 0 {
                    out.push(',');
                }
                number(x, out);
            }
            out.push_str("]]");
        }
        out.push_str("]}\n");
    }

    /// The time, and the string in the notation of the language, with six digits.
    pub fn text(&self, string: &ModuleString, out: &mut String) {
        out.push_str("t = ");
        number(string.time, out);
        out.push('\n');
        let mut column = 0;
        for module in string.iter() {
            let shown = describe(self.model, module.kind, module.parameters);
            let width = shown.chars().count() + 1;
            if column > 0 && column + width > 100 {
                out.push('\n');
                column = 0;
            }
            out.push_str(if column == 0 { "  " } else { " " });
            out.push_str(&shown);
            column += width;
        }
        out.push('\n');
    }
}

/// The shortest decimal that reads back as the same float.
pub fn number(x: f64, out: &mut String) {
    use std::fmt::Write;
    let start = out.len();
    // Writing to a string does not fail. Both forms have the fewest digits; large and small numbers
    // are shorter with an exponent.
    let _ = write!(out, "{x}");
    if out.len() - start > 6 {
        let plain = out.len() - start;
        let exponent = format!("{x:e}");
        if exponent.len() < plain {
            out.truncate(start);
            out.push_str(&exponent);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_exact() {
        for (x, shown) in [
            (0.35355339059327373, "0.35355339059327373"),
            (1.0, "1"),
            (-0.0, "-0"),
            (1e300, "1e300"),
            (1.5e-9, "1.5e-9"),
            (100000.0, "100000"),
            (10000000.0, "1e7"),
        ] {
            let mut out = String::new();
            number(x, &mut out);
            assert_eq!(out, shown);
            assert_eq!(out.parse::<f64>().map(f64::to_bits), Ok(x.to_bits()));
        }
    }
}
