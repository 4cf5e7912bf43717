//! `dlsys report`: work-precision studies of models, the hard cases, and how the parts of a scene are coupled.

mod coupling;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::args::ReportArgs;
use super::common::{Failure, count_of, open, out_error};
use super::progress::Progress;
use crate::model::Frames;
use crate::render;
use crate::session::Session;
use crate::sim::{Method, brief};
use crate::study::{self, Allowance, CASES, Case, CaseResult, HardPlan, Plan};
use crate::turtle;

/// Studies models, or runs the hard cases.
pub fn report(args: &ReportArgs) -> Result<(), Failure> {
    if let Some(folder) = &args.hard {
        return hard(args, folder.as_deref());
    }
    if args.surroundings {
        return surroundings(args);
    }
    // A conflict would lift clap's own requirement.
    if !args.cases.is_empty() {
        return Err(Failure::Usage("error: --case is for --hard\n".to_owned()));
    }
    let (mut names, mut failed) = (BTreeMap::<String, usize>::new(), 0);
    for model in &args.models {
        let session = open(model, &args.settings, &args.include)?;
        let stem = model.file_stem().map_or("model".to_owned(), |s| s.to_string_lossy().into_owned());
        // A second model of the same name gets other names of files.
        let count = names.entry(stem.clone()).or_insert(0);
        *count += 1;
        let name = if *count == 1 { stem } else { format!("{stem}-{count}") };
        failed += usize::from(!of(args, (Some(model), &session), &name)?);
    }
    match failed {
        0 => Ok(()),
        n => Err(Failure::Model(format!(
            "error: {n} of {} not verified\n",
            count_of(args.models.len(), "model")
        ))),
    }
}

/// The report of a model that has been read, from a file if it has a path; `name` is the stem of the files. False if it is not verified, where that is asked for; the reason
/// has been printed.
pub fn of(
    args: &ReportArgs,
    (path, session): (Option<&Path>, &Session),
    name: &str,
) -> Result<bool, Failure> {
    match (args.verify, args.coupling) {
        (true, _) => return verify(args, session),
        (_, true) => coupling::coupling(args, (path, session), name)?,
        (false, false) => study(args, session, name)?,
    }
    Ok(true)
}

/// Verifies a model at each tolerance. False if that fails; the reason has been printed.
fn verify(args: &ReportArgs, session: &Session) -> Result<bool, Failure> {
    let tolerances = args.tolerances.clone().unwrap_or_else(Plan::default_tolerances);
    crate::cli::verify::verify_all(args, session, &tolerances, &times(args, session)?, &print)
}

/// A study of a passive part of a scene.
type Part = fn(&ReportArgs, &Session, &str, &Plan) -> Result<(), Failure>;

/// Studies a model that has been read; `name` is the stem of the files.
fn study(args: &ReportArgs, session: &Session, name: &str) -> Result<(), Failure> {
    let plan = Plan {
        methods: args.methods.clone().unwrap_or_else(|| Method::NAMED.iter().map(|(_, m)| *m).collect()),
        tolerances: args.tolerances.clone(),
        step_sizes: args.step_sizes.clone(),
        slices: args.slices.clone(),
        times: times(args, session)?,
        runs: args.runs,
        allowance: allowance(args, session),
        base: args.budget.settings(),
    };
    let progress = RefCell::new(Progress::of_printed(name, plan.points(session)));
    // The block of each method is printed when it is complete.
    let mut printed = Ok(());
    let study = study::study(
        session,
        name,
        &plan,
        &mut |what| {
            let mut progress = progress.borrow_mut();
            progress.say(format!("{name}: {what}"));
            progress.inc();
        },
        &mut |study| {
            let head = if study.series.len() == 1 { study::study_head(study) } else { String::new() };
            let block = study.series.last().map(study::series_table).unwrap_or_default();
            if printed.is_ok() {
                printed = progress.borrow().suspend(|| print(&format!("{head}{block}")));
            }
        },
    );
    drop(progress);
    printed?;
    let study = study.map_err(|why| {
        Failure::Model(format!(
            "error: {}: there is nothing to compare with, because no reference comes to the last time\n  {why}\n",
            session.source.name
        ))
    })?;
    print(&left_out(&study, args, &plan))?;
    // Together they have as much time as growth.
    let (model, scenery) = (&session.model, &session.model.scenery);
    let has_passive = turtle::lets_go(model) || !scenery.sheets.is_empty();
    let parts: [(bool, Part); 3] =
        [(turtle::bends(model), stems), (has_passive, passive), (scenery.bed.is_some(), soils)];
    let parts: Vec<Part> =
        parts.into_iter().filter(|(is_there, _)| *is_there).map(|(_, part)| part).collect();
    let mut rest = plan.allowance.all;
    for (number, part) in parts.iter().enumerate() {
        let begun = Instant::now();
        let all = rest / (parts.len() - number) as f64;
        part(args, session, name, &Plan { allowance: Allowance { all, ..plan.allowance }, ..plan.clone() })?;
        rest = (rest - begun.elapsed().as_secs_f64()).max(0.0);
    }
    print("\n")?;
    let Some(out) = &args.out else { return Ok(()) };
    write(out, &format!("{name}.csv"), &study::csv(&study))?;
    write(out, &format!("{name}.json"), &study::json(&study))?;
    write(out, &format!("{name}.svg"), &study::svg(&study))
}

/// The time of a study. It may end earlier where neither its times nor its points were asked for.
fn allowance(args: &ReportArgs, session: &Session) -> Allowance {
    let (times, points) = (&args.at, [&args.tolerances, &args.step_sizes, &args.slices]);
    let is_asked_for = times.is_some() || args.from.is_some() || points.into_iter().any(Option::is_some);
    let may_shorten = session.model.frames.is_some() && !is_asked_for;
    Allowance { run: args.time_limit, all: args.study_budget, may_shorten }
}

/// What a part of the report did not reach, if it ended before the last of the times.
fn shortened(args: &ReportArgs, what: &str, last: f64, plan: &Plan) -> String {
    match plan.times.last() {
        Some(end) if last < *end => format!(
            "\n{what} from t = {} to {} left out, as it takes longer than `--budget {}`: a larger one goes further, `--at {}` to the end in any case\n",
            brief(last, 6),
            brief(*end, 6),
            args.study_budget,
            brief(*end, 6)
        ),
        _ => String::new(),
    }
}

/// How much did not fit into the time, and which time has room for it.
fn left_out(study: &study::Study, args: &ReportArgs, plan: &Plan) -> String {
    let shortened = shortened(args, "growth", study.times.last().copied().unwrap_or(0.0), plan);
    if !shortened.is_empty() {
        return shortened;
    }
    let Some((count, enough)) = study.left_out(args.time_limit) else { return String::new() };
    // Rounded up to a digit.
    let unit = 10f64.powf(enough.max(1.0).log10().floor());
    let (count, budget) = (count_of(count, "point"), args.study_budget);
    let enough = ((enough / unit).ceil() * unit).max(2.0 * budget);
    format!("\n{count} left out to stay within {budget} s; `--budget {enough}` has time for all\n")
}

/// Studies the methods of bending on a model with tissues.
fn stems(args: &ReportArgs, session: &Session, name: &str, plan: &Plan) -> Result<(), Failure> {
    let mut progress = Progress::new("stems", 16);
    let study = study::stem_study(session, &plan.times, plan.base, plan.allowance, &mut |what| {
        progress.say(format!("{name}: stems by {what}"));
        progress.inc();
    });
    drop(progress);
    let study = study.map_err(|why| {
        Failure::Model(format!("error: {}: its stems cannot be followed\n  {why}\n", session.source.name))
    })?;
    let Some(study) = study else { return Ok(()) };
    print(&(study::stem_table(&study) + &shortened(args, "stems", study.last, plan)))?;
    match &args.out {
        Some(out) => write(out, &format!("{name}-stems.csv"), &study::stem_csv(&study)),
        None => Ok(()),
    }
}

/// Studies the tolerance on a scene in which something falls or hangs.
fn passive(args: &ReportArgs, session: &Session, name: &str, plan: &Plan) -> Result<(), Failure> {
    let mut progress = Progress::new("scene", 5);
    let study = study::passive_study(session, &plan.times, plan.base, plan.allowance, &mut |what| {
        progress.say(format!("{name}: what falls and hangs by {what}"));
        progress.inc();
    });
    drop(progress);
    let file = format!("{name}-scene.csv");
    let texts = study.map(|study| {
        study.map(|study| {
            let note = shortened(args, "what falls and hangs", study.last, plan);
            [study::passive_table(&study) + &note, study::passive_csv(&study)]
        })
    });
    passive_result(args, "what falls and hangs: no run came to the last time", &file, texts)
}

/// Prints the table of a passive part of a scene, and writes its data; or the reason why there is none: growth has been studied all the same.
fn passive_result(
    args: &ReportArgs,
    failure: &str,
    file: &str,
    texts: Result<Option<[String; 2]>, impl std::fmt::Display>,
) -> Result<(), Failure> {
    let [table, data] = match texts {
        Ok(Some(texts)) => texts,
        Ok(None) => return Ok(()),
        Err(why) => {
            return print(&format!(
                "\n{failure}\n  {why}\n  (`--time-limit S` gives each run more time, `--at` fewer)\n"
            ));
        }
    };
    print(&table)?;
    args.out.as_ref().map_or(Ok(()), |out| write(out, file, &data))
}

/// Studies the sizes of columns and of ticks on a scene with ground that gives way.
fn soils(args: &ReportArgs, session: &Session, name: &str, plan: &Plan) -> Result<(), Failure> {
    let mut progress = Progress::new("ground", 9);
    let study = study::soil_study(session, &plan.times, plan.base, plan.allowance, &mut |what| {
        progress.say(format!("{name}: ground with {what}"));
        progress.inc();
    });
    drop(progress);
    let file = format!("{name}-ground.csv");
    let texts = study.map(|study| {
        study.map(|study| {
            let note = shortened(args, "ground", study.last, plan);
            [study::soil_table(&study) + &note, study::soil_csv(&study)]
        })
    });
    passive_result(args, "ground: it does not come to the last time", &file, texts)
}

/// Seeds over which statistics of the wind are averaged.
const SEEDS: u64 = 32;
/// Segments of the longest chain among the hard cases.
const CHAIN: usize = 10_000;
/// Seeds of the random trees.
const TREES: std::ops::Range<u64> = 48..128;
/// Bodies that are thrown at the ground.
const THROWS: u64 = 400;
/// Solids that move into a sheet.
const PASSES: u64 = 100;

/// Exact cases, hard cases and speed of wind, stems, bodies that fall, gases, sheets and ground. Each table is printed when it is complete.
fn surroundings(args: &ReportArgs) -> Result<(), Failure> {
    let defect = |error: String| Failure::Model(format!("error: {error}\n"));
    let mut progress = Progress::of_printed("surroundings", 20);
    let mut show = |table: String| {
        progress.inc();
        progress.suspend(|| print(&format!("{table}\n")))
    };
    let mut stems = Vec::new();
    for case in crate::sway::study::EXACT_CASES {
        stems.extend(case().map_err(|error| defect(error.to_string()))?);
    }
    show(study::exact_stem_table(&stems))?;
    let hard = crate::sway::study::hard_cases(CHAIN);
    show(study::hard_stem_table(&hard))?;
    let (method, tolerance) = (crate::sway::Method::default(), crate::sway::Settings::default().tolerance);
    let random: Vec<_> = TREES.map(|seed| crate::sway::study::random_case(seed, method, tolerance)).collect();
    show(study::random_stem_table(&random))?;
    let methods = crate::sway::study::methods().map_err(|error| defect(error.to_string()))?;
    show(study::method_table(&methods))?;
    let mut falls = Vec::new();
    for case in crate::fall::study::EXACT_CASES {
        falls.extend(case().map_err(|error| defect(error.to_string()))?);
    }
    show(study::exact_fall_table(&falls))?;
    let landings = study::Landings::new(THROWS).map_err(|error| defect(error.to_string()))?;
    show(landings.table())?;
    let contacts = study::Contacts::new(THROWS);
    show(contacts.table())?;
    let mut gases = Vec::new();
    for case in crate::gas::study::EXACT_CASES {
        gases.extend(case().map_err(|error| defect(error.to_string()))?);
    }
    show(study::exact_gas_table(&gases))?;
    let mut sheets = Vec::new();
    for case in crate::sheet::study::EXACT_CASES {
        sheets.extend(case().map_err(|error| defect(error.to_string()))?);
    }
    show(study::exact_sheet_table(&sheets))?;
    show(study::net_table().map_err(|error| defect(error.to_string()))?)?;
    show(study::sheet_method_table().map_err(|error| defect(error.to_string()))?)?;
    let driven = crate::sheet::study::hard_cases().map_err(|error| defect(error.to_string()))?;
    show(study::hard_sheet_table(&driven))?;
    let passes = study::Passes::new(PASSES);
    show(passes.table())?;
    let mut grounds = Vec::new();
    for case in crate::ground::study::EXACT_CASES {
        grounds.extend(case().map_err(|error| defect(error.to_string()))?);
    }
    show(study::exact_ground_table(&grounds))?;
    let buried = crate::ground::study::hard_cases();
    show(study::hard_ground_table(&buried))?;
    show(study::ground_rule_table().map_err(|error| defect(error.to_string()))?)?;
    let wind = crate::wind::study::statistics(SEEDS).map_err(|error| defect(error.to_string()))?;
    show(study::wind_table(&wind))?;
    show(study::speed_table().map_err(defect)?)?;
    show(study::gas_speed_table().map_err(|error| defect(error.to_string()))?)?;
    show(study::sheet_speed_table().map_err(|error| defect(error.to_string()))?)?;
    show(study::ground_speed_table().map_err(|error| defect(error.to_string()))?)?;
    drop(progress);
    if let Some(out) = &args.out {
        write(
            out,
            "surroundings.csv",
            &study::surroundings_csv(
                &wind,
                &[
                    ("stems", &stems),
                    ("falling", &falls),
                    ("gas", &gases),
                    ("sheets", &sheets),
                    ("ground", &grounds),
                ],
            ),
        )?;
    }
    let bad = wind.iter().filter(|row| !row.holds()).count();
    let failed = hard.iter().filter(|case| case.failure.is_some()).count()
        + random.iter().filter(|case| case.failure.is_some()).count()
        + driven.iter().filter(|case| case.failure.is_some()).count()
        + buried.iter().filter(|case| case.failure.is_some()).count()
        + landings.failed()
        + contacts.failed()
        + passes.failed();
    match bad + failed {
        0 => Ok(()),
        _ => Err(Failure::Model(format!(
            "error: {} out of bounds, {} failed\n",
            count_of(bad, "statistic"),
            count_of(failed, "case of stems, falls, sheets and ground")
        ))),
    }
}

/// Runs the hard cases of a folder, or the built-in ones.
fn hard(args: &ReportArgs, folder: Option<&Path>) -> Result<(), Failure> {
    let texts = match folder {
        Some(folder) => read_folder(folder)?,
        None => {
            CASES.iter().map(|(name, text)| (format!("models/hard/{name}"), (*text).to_owned())).collect()
        }
    };
    let fault = |error: study::Error| Failure::Model(format!("error: {error}\n"));
    let mut cases = Vec::new();
    for (file, text) in &texts {
        cases.push(Case::parse(file, text).map_err(fault)?);
    }
    if let Some(unknown) = args.cases.iter().find(|id| !cases.iter().any(|case| case.id == **id)) {
        let all: Vec<&str> = cases.iter().map(|case| case.id.as_str()).collect();
        return Err(Failure::Usage(format!(
            "error: there is no case `{unknown}`; there are {}\n",
            all.join(", ")
        )));
    }
    if !args.cases.is_empty() {
        cases.retain(|case| args.cases.contains(&case.id));
    }
    if let Some(methods) = &args.methods
        && let Some(fixed) = methods.iter().find(|m| m.is_fixed_step())
    {
        let name = study::method_name(*fixed);
        return Err(Failure::Usage(format!(
            "error: hard cases have tolerances, and `{name}` has a fixed step\n"
        )));
    }
    let plan = HardPlan {
        methods: args.methods.clone(),
        tolerances: args.tolerances.clone(),
        time_limit: args.time_limit,
    };
    let mut progress = Progress::new("hard cases", cases.len());
    let mut rows: Vec<CaseResult> = Vec::new();
    for case in &cases {
        let run = study::run_case(case, &plan, &mut |what| progress.say(what));
        rows.extend(run.map_err(fault)?);
        progress.inc();
    }
    drop(progress);
    print(&study::hard_table(&rows))?;
    if let Some(out) = &args.out {
        write(out, "hard.csv", &study::hard_csv(&rows))?;
        write(out, "hard.json", &study::hard_json(&rows))?;
    }
    let failed = rows.iter().filter(|row| !row.passes()).count();
    if failed > 0 {
        let text = study::mismatches(&rows);
        return Err(Failure::Model(format!(
            "{text}\nerror: {failed} of {} failed\n",
            count_of(rows.len(), "run")
        )));
    }
    print(&format!("{} of {}, all passed\n", count_of(rows.len(), "run"), count_of(cases.len(), "case")))
}

/// The model files of a folder, in the order of their names.
fn read_folder(folder: &Path) -> Result<Vec<(String, String)>, Failure> {
    let fault = |path: &Path, error: std::io::Error| {
        Failure::Model(format!("error: cannot read {}: {error}\n", path.display()))
    };
    let mut paths: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| fault(folder, e))? {
        let path = entry.map_err(|e| fault(folder, e))?.path();
        if path.extension().is_some_and(|e| e == "dls") {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(Failure::Usage(format!("error: there are no *.dls files in {}\n", folder.display())));
    }
    let read = |path: PathBuf| match fs::read_to_string(&path) {
        Ok(text) => Ok((path.display().to_string(), text)),
        Err(error) => Err(fault(&path, error)),
    };
    paths.into_iter().map(read).collect()
}

/// The observed times, in ascending order without duplicates.
fn times(args: &ReportArgs, session: &Session) -> Result<Vec<f64>, Failure> {
    let mut times = match (&args.at, args.from, args.to, args.step) {
        (Some(at), ..) => at.clone(),
        (None, Some(from), Some(to), Some(step)) => {
            let frames = Frames { from, to, step };
            if to < from {
                return Err(Failure::Usage(format!("error: --to {to} is before --from {from}\n")));
            }
            if (to - from) / step >= MOST_TIMES as f64 {
                return Err(Failure::Usage(format!("error: more than {MOST_TIMES} times to compare at\n")));
            }
            frames.times().collect()
        }
        _ => study::default_times(session).ok_or_else(|| {
            Failure::Usage(format!(
                "error: {} has no `frames`: say where to compare with `--at T1,T2,…` or `--from A --to B --step S`\n",
                session.source.name
            ))
        })?,
    };
    times.sort_by(f64::total_cmp);
    times.dedup();
    Ok(times)
}

/// Largest number of times, because all strings are kept for the comparison.
const MOST_TIMES: usize = 10_000;

fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(out_error)
}

/// Writes a file of the report, replacing an earlier one of the same name.
fn write(folder: &Path, name: &str, text: &str) -> Result<(), Failure> {
    fs::create_dir_all(folder)
        .map_err(|error| Failure::Model(format!("error: cannot make {}: {error}\n", folder.display())))?;
    render::replace(folder, name, text.as_bytes())
        .map_err(|error| Failure::Model(format!("error: {error}\n")))
}
