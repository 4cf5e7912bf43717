//! The runs of a study, in lock step: forces, distances, work.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use dlsys_model::{KindId, Model};
use dlsys_sheet::{Matrix, Vector};
use dlsys_sim::Settings;
use dlsys_surround::{self as surround, SolidSeen, TrialTick, Ways};

use super::{
    Active, Apart, Coupling, CouplingError, CouplingPlan, CouplingStudy, Range, Row, Trial, decide, reading,
};

/// The tolerance of the reference, in parts of that of the runs.
const FINER: f64 = 0.1;
/// The tightest tolerance of a run of sheets.
const FINEST: f64 = 1e-7;

/// Least, largest and mean of values with weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sum {
    least: f64,
    most: f64,
    sum: f64,
    weight: f64,
}

impl Default for Sum {
    fn default() -> Sum {
        Sum { least: f64::INFINITY, most: f64::NEG_INFINITY, sum: 0.0, weight: 0.0 }
    }
}

impl Sum {
    pub(super) fn add(&mut self, value: f64, weight: f64) {
        (self.least, self.most) = (self.least.min(value), self.most.max(value));
        (self.sum, self.weight) = (self.sum + weight * value, self.weight + weight);
    }

    /// `None` without values.
    pub(super) fn range(&self) -> Option<Range> {
        let Sum { least, most, sum, weight } = *self;
        (weight > 0.0).then(|| Range { least, most, mean: sum / weight })
    }
}

/// What one sheet, or all, did to the solids of a name.
#[derive(Clone, Default)]
struct Touch {
    seconds: f64,
    force: Sum,
    acceleration: Sum,
}

/// What a run shows of the solids of a name.
#[derive(Clone, Default)]
struct Tally {
    sheets: BTreeMap<usize, Touch>,
    all: Touch,
    own: Sum,
    most: f64,
    end: f64,
    size: f64,
    touched: BTreeSet<u64>,
    /// The inverse mass, if sheets push them.
    light: Option<Matrix>,
}

struct Running<'m> {
    coupling: Coupling,
    is_reference: bool,
    model: &'m Model,
    trial: surround::Trial<'m>,
    tallies: BTreeMap<String, Tally>,
    stretch: f64,
    masses: Vec<f64>,
    failed: Option<(surround::Error, f64)>,
}

/// Inverse masses of the solids of a tick.
#[derive(Default)]
struct Lights {
    modules: HashMap<u64, Matrix>,
    names: BTreeMap<String, Matrix>,
}

impl Lights {
    fn of(&self, name: &str, module: u64) -> Option<&Matrix> {
        self.modules.get(&module).or(self.names.get(name))
    }
}

/// Runs the model with all couplings that it can have.
pub(super) fn run(
    model: &Model,
    plan: &CouplingPlan,
    study: &mut CouplingStudy,
    say: &mut dyn FnMut(&str, f64),
) -> Result<(), CouplingError> {
    let bare = plan.without.unwrap_or(model);
    let masses: BTreeMap<KindId, f64> = plan
        .masses
        .iter()
        .flat_map(|(name, mass)| reading::kinds(bare, name).map(|kind| (kind, *mass)).collect::<Vec<_>>())
        .collect();
    // A run that takes longer than both ways may is no help, and the reference is worth twice the time.
    let most = plan.time_limit.max(plan.thresholds.patience).min(plan.settings.max_seconds);
    let settings = Settings { max_seconds: most, ..plan.settings };
    let bending = plan.settings.bending;
    let finer = (bending.tolerance * FINER).max(FINEST.min(bending.tolerance));
    let exact = Settings {
        bending: dlsys_sim::BendSettings { tolerance: finer, ..bending },
        max_seconds: 2.0 * most,
        ..plan.settings
    };
    let mut runs = Vec::new();
    let mut start = |model, settings, coupling, ways, is_reference| -> Result<(), CouplingError> {
        if let Some(trial) = surround::Trial::new(model, settings, ways).map_err(Box::new)? {
            let (tallies, masses) = (BTreeMap::new(), Vec::new());
            runs.push(Running {
                coupling,
                is_reference,
                model,
                trial,
                tallies,
                stretch: 0.0,
                masses,
                failed: None,
            });
        }
        Ok(())
    };
    if model.reads_force() || !masses.is_empty() {
        start(bare, exact, Coupling::TwoWay, Ways::Pushed(masses.clone()), true)?;
        start(bare, settings, Coupling::TwoWay, Ways::Pushed(masses), false)?;
    }
    if plan.without.is_some() {
        start(model, settings, Coupling::Hybrid, Ways::Own, false)?;
    }
    start(bare, settings, Coupling::OneWay, Ways::Own, false)?;
    go_through(&mut runs, plan, study, say)?;
    let reached_end = |run: &&Running| run.is_reference && run.failed.is_none();
    study.reference = runs.iter().any(|run| reached_end(&run)).then_some(finer);
    gather(model, plan, runs, study);
    Ok(())
}

/// Goes through all ticks. A run that fails does not go on; if all fail, the last error is that of the study.
fn go_through(
    runs: &mut [Running],
    plan: &CouplingPlan,
    study: &mut CouplingStudy,
    say: &mut dyn FnMut(&str, f64),
) -> Result<(), CouplingError> {
    let end = runs.first().map_or(1.0, |run| plan.until * run.model.scenery.units.time);
    loop {
        if study.ticks.is_multiple_of(8) {
            say("sheets and solids", study.ticks as f64 * surround::SHEET_TICK / end);
        }
        let (mut lights, mut places, mut went) = (Lights::default(), HashMap::new(), false);
        for run in runs.iter_mut().filter(|run| run.failed.is_none()) {
            match run.trial.tick(plan.until) {
                Ok(None) => (),
                Ok(Some(tick)) => {
                    went = true;
                    run.note(&tick, &mut lights, &mut places);
                }
                Err(error) => run.failed = Some((error, study.ticks as f64 * surround::SHEET_TICK)),
            }
        }
        if !went {
            break;
        }
        study.ticks += 1;
    }
    match runs.iter_mut().all(|run| run.failed.is_some()) {
        true => {
            let failed = runs.iter_mut().filter_map(|run| run.failed.take()).next_back();
            failed.map_or(Ok(()), |(error, _)| Err(CouplingError::from(Box::new(error))))
        }
        false => Ok(()),
    }
}

impl Running<'_> {
    /// Notes a tick. `places` are those of the reference, which comes first.
    fn note(&mut self, tick: &TrialTick, lights: &mut Lights, places: &mut HashMap<u64, Vector>) {
        let length = tick.span[1] - tick.span[0];
        for solid in &tick.solids {
            let (name, module) = (&self.model.kinds.get(solid.kind).name, solid.lineage.id);
            if let Some(light) = solid.light {
                lights.modules.insert(module, light);
                lights.names.insert(name.clone(), light);
            }
            let tally = self.tallies.entry(name.clone()).or_default();
            tally.size = tally.size.max(solid.size);
            tally.light = solid.light.or(tally.light);
            tally.touch(solid, lights.of(name, module), length);
            if self.is_reference {
                places.insert(module, solid.places[1]);
            } else if let Some(place) = places.get(&module) {
                tally.end = (solid.places[1] - place).norm();
                tally.most = tally.most.max(tally.end);
            }
        }
        self.stretch = tick.sheets.iter().map(|sheet| sheet.stretch).fold(self.stretch, f64::max);
        self.masses.resize(tick.sheets.len(), 0.0);
        self.masses.iter_mut().zip(&tick.sheets).for_each(|(mass, sheet)| *mass = mass.max(sheet.mass));
    }
}

impl Tally {
    fn touch(&mut self, solid: &SolidSeen, light: Option<&Matrix>, length: f64) {
        if solid.impulses.is_empty() {
            return;
        }
        self.touched.insert(solid.lineage.id);
        let mut sum = Vector::zeros();
        for (sheet, impulse) in &solid.impulses {
            self.sheets.entry(*sheet).or_default().add(impulse, light, length);
            sum += impulse;
        }
        self.all.add(&sum, light, length);
        let [before, after] = solid.velocities;
        self.own.add((after - before).norm() / length, 1.0);
    }
}

impl Touch {
    fn add(&mut self, impulse: &Vector, light: Option<&Matrix>, length: f64) {
        self.seconds += length;
        self.force.add(impulse.norm() / length, 1.0);
        if let Some(light) = light {
            self.acceleration.add((light * impulse).norm() / length, 1.0);
        }
    }
}

/// What has been measured, as it is shown.
fn gather(model: &Model, plan: &CouplingPlan, mut runs: Vec<Running>, study: &mut CouplingStudy) {
    let second = model.scenery.units.time;
    let names: BTreeSet<String> = runs
        .iter()
        .filter(|run| !run.is_reference)
        .flat_map(|run| run.tallies.iter().filter(|(_, tally)| !tally.touched.is_empty()))
        .map(|(name, _)| name.clone())
        .collect();
    let mass_of = |runs: &[Running], name: &str| {
        let light = runs.iter().find_map(|run| run.tallies.get(name)?.light)?;
        // Along the axis along which it moves most easily.
        let most = light.symmetric_eigenvalues().max();
        (most > 0.0).then(|| 1.0 / most)
    };
    let masses: Vec<f64> = runs.iter().fold(Vec::new(), |most, run| {
        let count = most.len().max(run.masses.len());
        let of = |masses: &[f64], k: usize| masses.get(k).copied().unwrap_or(0.0);
        (0..count).map(|k| of(&most, k).max(of(&run.masses, k))).collect()
    });
    let sheets = &model.scenery.sheets;
    for name in &names {
        for run in runs.iter().filter(|run| !run.is_reference) {
            let Some(tally) = run.tallies.get(name) else { continue };
            let row = |passive: Option<String>, passive_mass: f64, touch: &Touch| {
                let force = touch.force.range()?;
                let (active, coupling, touching) = (name.clone(), run.coupling, touch.seconds);
                let acceleration = touch.acceleration.range();
                Some(Row { active, passive, passive_mass, coupling, touching, force, acceleration })
            };
            let each = tally
                .sheets
                .iter()
                .filter_map(|(k, touch)| row(Some(sheets[*k].name.to_string()), masses[*k], touch));
            study.rows.extend(each);
            if tally.sheets.len() > 1 {
                let mass = tally.sheets.keys().map(|k| masses[*k]).sum();
                study.rows.extend(row(None, mass, &tally.all));
            }
        }
    }
    let own = reading::coupling;
    let has_stand_in = plan.without.is_some();
    let is_two_way = model.reads_force();
    for run in runs.iter_mut().filter(|run| !run.is_reference) {
        let is_own = match run.coupling {
            Coupling::TwoWay => is_two_way,
            Coupling::Hybrid => true,
            Coupling::OneWay => !is_two_way && !has_stand_in,
        };
        let apart = |tally: &Tally| Apart { most: tally.most, end: tally.end };
        let touched =
            run.tallies.iter().filter(|(name, _)| names.contains(*name) && study.reference.is_some());
        let counts = run.trial.counts();
        study.trials.push(Trial {
            coupling: run.coupling,
            is_own,
            seconds: run.trial.spent(),
            steps: [counts.steps, counts.rejected],
            stretch: run.stretch,
            apart: touched.map(|(name, tally)| (name.clone(), apart(tally))).collect(),
            failed: run.failed.take().map(|(error, seconds)| (error.diagnostic().message, seconds / second)),
        });
    }
    for name in names {
        let tallies = || runs.iter().filter_map(|run| Some((run.coupling, run.tallies.get(&name)?)));
        let one_way = tallies().find(|(coupling, _)| *coupling == Coupling::OneWay);
        let mass = mass_of(&runs, &name);
        let mut active = Active {
            count: tallies().map(|(_, tally)| tally.touched.len()).max().unwrap_or(0),
            size: tallies().map(|(_, tally)| tally.size).fold(0.0, f64::max),
            mass,
            is_measured: mass.is_some() && !plan.masses.contains_key(&name),
            coupling: own(model, &name, has_stand_in),
            has_feedback: reading::has_feedback(model, &name),
            own: one_way.and_then(|(_, tally)| tally.own.range()),
            decision: decide::Decision::default(),
            name,
        };
        active.decision = decide::decide(&active, study);
        study.actives.push(active);
    }
}
