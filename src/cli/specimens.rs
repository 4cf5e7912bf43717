//! `dlsys run --seeds A..B`: many specimens of one model, and the distribution of measures over them.
//!
//! Specimens are run in parallel on several threads; results are taken in the order of seeds, so nothing depends on the
//! number of threads.

use std::io::Write;
use std::path::Path;

use serde_json::json;

use super::args::RunArgs;
use super::common::{Failure, ModelRun, coloured, cores, out_error};
use super::output;
use super::parallel;
use super::progress::Progress;
use super::shared::TextFormat;
use super::values::Seeds;
use crate::model::Measure;
use crate::sim::Settings;
use crate::study::{Spread, SpreadSeries, band_svg, spread_csv, spread_table};
use crate::tree::ModuleString;

/// Largest number of values kept: one for each specimen, measure and time.
const MOST: usize = 100_000_000;

/// Name of the default measure, the number of all modules.
const ALL: &str = "modules";

/// Runs all specimens and prints the distributions of their measures.
pub fn summarise(args: &RunArgs, run: &ModelRun, seeds: Seeds, format: TextFormat) -> Result<(), Failure> {
    let measures: Vec<Measure> =
        args.measures.iter().map(|text| measure(run, text)).collect::<Result<_, _>>()?;
    spare(args)?;
    let names: Vec<&str> = match &measures[..] {
        [] => vec![ALL],
        some => some.iter().map(|m| m.name.as_str()).collect(),
    };
    let (width, times) = (names.len(), run.times.len());
    if seeds.count().saturating_mul(width * times) > MOST {
        return Err(Failure::Usage(format!(
            "error: {} specimens at {times} times: more than {MOST:e} numbers to keep; look at fewer times with `--at` or `--step`\n",
            seeds.count()
        )));
    }
    let threads = args.threads.unwrap_or_else(cores);
    let mut progress = Progress::of_printed("specimens", seeds.count());
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    // One list for each measure and time, with the specimens in the order of seeds.
    let mut values: Vec<Vec<f64>> = vec![Vec::with_capacity(seeds.count()); width * times];
    let mut all = seeds.iter();
    let done = parallel::in_order(
        threads,
        || all.next(),
        |seed| (seed, specimen(run, seed, &measures)),
        |(seed, result)| {
            let row = result.map_err(|why| why.of_seed(seed))?;
            for (all, value) in values.iter_mut().zip(&row) {
                all.push(*value);
            }
            progress.inc();
            match format {
                TextFormat::Json => {
                    let courses: serde_json::Map<String, serde_json::Value> = names
                        .iter()
                        .zip(row.chunks(times))
                        .map(|(n, row)| ((*n).to_owned(), json!(row)))
                        .collect();
                    let line = json!({ "seed": seed, "t": run.times, "measures": courses });
                    writeln!(out, "{line}").map_err(out_error)
                }
                TextFormat::Text => Ok(()),
            }
        },
    );
    drop(progress);
    out.flush().map_err(out_error)?;
    done?;
    let mut values = values.into_iter();
    let courses: Vec<SpreadSeries> = (names.iter())
        .map(|name| {
            let spreads = run.times.iter().zip(&mut values).map(|(t, values)| Spread::new(*t, values));
            SpreadSeries { name: (*name).to_owned(), spreads: spreads.collect() }
        })
        .collect();
    if format == TextFormat::Text {
        out.write_all(spread_table(&courses).as_bytes()).and_then(|()| out.flush()).map_err(out_error)?;
    }
    let model = &run.session.model;
    let title = model.title.as_deref().unwrap_or(&run.session.source.name);
    write(args.csv.as_deref(), || spread_csv(&courses))?;
    write(args.plot.as_deref(), || band_svg(title, &courses))
}

/// Reads a measure.
fn measure(run: &ModelRun, text: &str) -> Result<Measure, Failure> {
    run.session.measure(text).map_err(|error| {
        Failure::Usage(error.diagnostics.iter().map(|d| d.render(&error.source, coloured())).collect())
    })
}

/// Refuses to overwrite the model, or to write two outputs into one file.
fn spare(args: &RunArgs) -> Result<(), Failure> {
    let there = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let files = [("--csv", args.csv.as_deref()), ("--plot", args.plot.as_deref())];
    for (flag, path) in files.iter().filter_map(|(flag, path)| Some((flag, (*path)?))) {
        if there(path) == there(&args.shared.model) {
            return Err(Failure::Usage(format!(
                "error: `{flag} {}` would be written over the model itself\n",
                path.display()
            )));
        }
    }
    match (&args.csv, &args.plot) {
        (Some(csv), Some(plot)) if there(csv) == there(plot) => Err(Failure::Usage(format!(
            "error: `--plot {}` would be written over the file of `--csv`\n",
            plot.display()
        ))),
        _ => Ok(()),
    }
}

/// The measures of one specimen: for each measure, its values at all times.
fn specimen(run: &ModelRun, seed: u64, measures: &[Measure]) -> Result<Vec<f64>, Failure> {
    let times = run.times.len();
    let settings = Settings { seed, log: false, ..run.settings };
    let mut simulation = run.session.simulate(settings).map_err(|error| run.fault(&error))?;
    let mut string = ModuleString::default();
    let mut values = vec![0.0; measures.len().max(1) * times];
    for (i, &t) in run.times.iter().enumerate() {
        simulation.at(t, &mut string).map_err(|error| run.fault(&error))?;
        if measures.is_empty() {
            values[i] = string.iter().filter(|m| !m.kind.is_bracket()).count() as f64;
        }
        for (k, measure) in measures.iter().enumerate() {
            let value = measure.over(t, string.iter().map(|m| (m.kind, m.parameters, m.age)));
            if !value.is_finite() {
                return Err(Failure::Model(format!("error: `{}` is {value} at t = {t}\n", measure.name)));
            }
            values[k * times + i] = value;
        }
    }
    Ok(values)
}

fn write(path: Option<&Path>, text: impl FnOnce() -> String) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    output::write(path, &text())
}
