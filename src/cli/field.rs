//! `dlsys run --field FILE`: the wind that a model declares, sampled at the places of a CSV file.
//!
//! A file with the columns `x,y,z` is sampled at every observed time, one with `t,x,y,z` at the time of each line. Lines are read, sampled
//! and printed one by one, so memory does not depend on their number.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Read, Seek, Write};
use std::path::Path;
use std::sync::Arc;

use super::args::RunArgs;
use super::common::{Failure, coloured, open, out_error, settings, times};
use super::progress::Progress;
use super::run::number;
use super::shared::TextFormat;
use crate::model::Units;
use crate::scene::Vector;
use crate::surround::{Error, Weather};
use crate::wind::Snapshot;

/// Most bytes of a line.
const MOST_BYTES: u64 = 1 << 12;
/// Instants of the wind that are kept, for files that go to and fro between some times.
const KEPT: usize = 16;

/// Prints the velocity of the wind at the places of the file.
pub fn sample(args: &RunArgs, path: &Path, format: TextFormat) -> Result<(), Failure> {
    let settings = settings(&args.shared)?;
    let session = open(&args.shared.model, &args.shared.settings, &args.shared.include)?;
    let fault = |error: Error| Failure::Model(error.diagnostic().render(&session.source, coloured()));
    let weather = Weather::of(&session.model, settings).map_err(fault)?;
    let Some(weather) = weather else {
        return Err(Failure::Usage(format!(
            "error: {} has no wind to sample\n\n  = help: declare one, such as `wind 1, 0, 0 speed 5`, or a `flow`\n",
            session.source.name
        )));
    };
    let mut places = Places::open(path)?;
    let times = match places.has_times {
        true => own_times(args, &places)?,
        false => times(&args.shared, &session)?,
    };
    let out = BufWriter::with_capacity(1 << 16, std::io::stdout().lock());
    let units = session.model.scenery.units;
    let mut sampler = Sampler { weather: &weather, fault: &fault, units, format, recent: Vec::new(), out };
    sampler.head()?;
    let done = match places.has_times {
        true => sampler.sample_all(None, &mut places),
        false => at_times(&times, &mut places, &mut sampler),
    };
    // Results before an error are written before the error is reported.
    sampler.out.flush().map_err(out_error)?;
    done
}

/// No times for a file that has its own: flags that give others are refused.
fn own_times(args: &RunArgs, places: &Places) -> Result<Vec<f64>, Failure> {
    let shared = &args.shared;
    if shared.at.is_none() && shared.from.is_none() && shared.to.is_none() && shared.step.is_none() {
        return Ok(Vec::new());
    }
    Err(Failure::Usage(format!(
        "error: {} has a column `t`, and the flags give other times\n\n  \
         = help: leave out `--at`, `--from`, `--to` and `--step`, or the column\n",
        places.name
    )))
}

/// Samples all lines at each observed time.
fn at_times(times: &[f64], places: &mut Places, sampler: &mut Sampler) -> Result<(), Failure> {
    let mut progress = Progress::of_printed("sampling", times.len());
    for &t in times {
        places.rewind()?;
        sampler.sample_all(Some(t), places)?;
        progress.inc();
    }
    Ok(())
}

/// Evaluates and prints.
struct Sampler<'a, 'm> {
    weather: &'a Weather<'m>,
    /// The message of an error of the model.
    fault: &'a dyn Fn(Error) -> Failure,
    units: Units,
    format: TextFormat,
    /// The last instants, with their times in units of the model.
    recent: Vec<(f64, Arc<Snapshot>)>,
    out: BufWriter<std::io::StdoutLock<'static>>,
}

impl Sampler<'_, '_> {
    fn head(&mut self) -> Result<(), Failure> {
        match self.format {
            TextFormat::Text => self.out.write_all(b"t,x,y,z,u,v,w\n").map_err(out_error),
            TextFormat::Json => Ok(()),
        }
    }

    /// Prints the wind at the places of the lines that follow, at a time or at their own.
    fn sample_all(&mut self, time: Option<f64>, places: &mut Places) -> Result<(), Failure> {
        while let Some([t, x, y, z]) = places.next()? {
            self.sample(time.unwrap_or(t), [x, y, z], places)?;
        }
        Ok(())
    }

    /// Prints the wind at the place of the present line.
    fn sample(&mut self, t: f64, place: [f64; 3], places: &Places) -> Result<(), Failure> {
        if !self.recent.iter().any(|(time, _)| *time == t) {
            let new = self.weather.at(t * self.units.time).map_err(|error| match error {
                Error::Wind { error, .. } => places.fault(1, &error.to_string(), ""),
                error => (self.fault)(error),
            })?;
            if self.recent.len() == KEPT {
                self.recent.remove(0);
            }
            self.recent.push((t, new));
        }
        let snapshot = self.recent.iter().rev().find(|(time, _)| *time == t).map(|(_, snapshot)| snapshot);
        let velocity = snapshot.map_or_else(Vector::zeros, |snapshot| {
            snapshot.velocity(Vector::from(place) * self.units.length)
        });
        if !velocity.iter().all(|value| value.is_finite()) {
            return Err(places.fault(1, "the wind has no finite velocity there", ""));
        }
        let values = [t, place[0], place[1], place[2], velocity.x, velocity.y, velocity.z];
        let mut line = String::new();
        let names = ["t", "x", "y", "z", "u", "v", "w"];
        for (i, (name, value)) in names.iter().zip(values).enumerate() {
            line.push_str(if i > 0 { "," } else { "" });
            if self.format == TextFormat::Json {
                line.push_str(if i == 0 { "{\"" } else { "\"" });
                line.push_str(name);
                line.push_str("\":");
            }
            // A velocity has no sign where it is zero.
            number(value + 0.0, &mut line);
        }
        line.push_str(if self.format == TextFormat::Json { "}\n" } else { "\n" });
        self.out.write_all(line.as_bytes()).map_err(out_error)
    }
}

/// The lines of a CSV file.
struct Places {
    name: String,
    reader: BufReader<File>,
    has_times: bool,
    /// Number of the last line that was read, from 1.
    line: usize,
    bytes: Vec<u8>,
}

impl Places {
    /// Opens a file and reads its first line; `-` is standard input, which is copied to a temporary file, because it is read once for
    /// each time.
    fn open(path: &Path) -> Result<Places, Failure> {
        let cannot = |error| Failure::Model(format!("error: cannot read {}: {error}\n", path.display()));
        let (name, file) = match path == Path::new("-") {
            true => {
                let mut copy = tempfile::tempfile().map_err(cannot)?;
                std::io::copy(&mut std::io::stdin().lock(), &mut copy).map_err(cannot)?;
                copy.rewind().map_err(cannot)?;
                ("standard input".to_owned(), copy)
            }
            false => (path.display().to_string(), File::open(path).map_err(cannot)?),
        };
        let reader = BufReader::with_capacity(1 << 16, file);
        let mut places = Places { name, reader, has_times: false, line: 0, bytes: Vec::new() };
        let head: Vec<String> = match places.read()? {
            true => places.text()?.split(',').map(|name| name.trim().to_owned()).collect(),
            false => Vec::new(),
        };
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        places.has_times = match head[..] {
            ["x", "y", "z"] => false,
            ["t", "x", "y", "z"] => true,
            _ => {
                let help = "such as\n\n      x,y,z\n      0,1.5,0\n      2,1.5,0";
                let why = "expected the names of the columns in the first line: `x,y,z`, or `t,x,y,z`";
                return Err(places.fault(1, why, help));
            }
        };
        Ok(places)
    }

    /// Goes back to the line after the head.
    fn rewind(&mut self) -> Result<(), Failure> {
        let done = self.reader.rewind();
        done.map_err(|error| Failure::Model(format!("error: cannot read {} again: {error}\n", self.name)))?;
        self.line = 0;
        self.read().map(drop)
    }

    /// The next place, with its time, which is 0 without a column for it.
    fn next(&mut self) -> Result<Option<[f64; 4]>, Failure> {
        loop {
            if !self.read()? {
                return Ok(None);
            }
            let text = self.text()?;
            if text.trim().is_empty() {
                continue;
            }
            let width = if self.has_times { 4 } else { 3 };
            let count = text.split(',').count();
            if count != width {
                let help = if count == 1 { "separate them by commas" } else { "" };
                return Err(self.fault(1, &format!("expected {width} values, found {count}"), help));
            }
            let mut values = [0.0; 4];
            let mut column = 1;
            for (value, cell) in values[4 - width..].iter_mut().zip(text.split(',')) {
                let shown = cell.trim();
                let at = column + cell.chars().take_while(|c| c.is_whitespace()).count();
                *value = match shown.parse::<f64>() {
                    Ok(x) if x.is_finite() => x,
                    Ok(_) => return Err(self.fault(at, &format!("`{shown}` is not a finite number"), "")),
                    Err(_) => return Err(self.fault(at, &format!("`{shown}` is not a number"), "")),
                };
                column += cell.chars().count() + 1;
            }
            return Ok(Some(values));
        }
    }

    /// Reads a line; false at the end.
    fn read(&mut self) -> Result<bool, Failure> {
        self.bytes.clear();
        self.line += 1;
        let read = (&mut self.reader).take(MOST_BYTES).read_until(b'\n', &mut self.bytes);
        let read =
            read.map_err(|error| Failure::Model(format!("error: cannot read {}: {error}\n", self.name)))?;
        if read as u64 == MOST_BYTES {
            return Err(self.fault(1, &format!("the line is longer than {MOST_BYTES} bytes"), ""));
        }
        Ok(read > 0)
    }

    /// The line that was read.
    fn text(&self) -> Result<&str, Failure> {
        let text = std::str::from_utf8(&self.bytes)
            .map_err(|error| self.fault(error.valid_up_to() + 1, "this is no text in UTF-8", ""))?;
        Ok(text.trim_end_matches(['\n', '\r']).trim_start_matches('\u{feff}'))
    }

    /// An error at a column of the present line.
    fn fault(&self, column: usize, why: &str, help: &str) -> Failure {
        let help = if help.is_empty() { String::new() } else { format!("\n  = help: {help}\n") };
        Failure::Model(format!("error: {}:{}:{column}: {why}\n{help}", self.name, self.line))
    }
}
