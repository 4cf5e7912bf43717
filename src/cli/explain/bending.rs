//! The stems that bend: axes with their frequencies and stability, and the work of following them.

use std::collections::HashMap;
use std::fmt::Write;

use serde::Serialize;

use super::scene::ScenePart;
use super::text::wrapped;
use crate::model::{Model, Quantity};
use crate::sim::{Settings, Simulation, brief};
use crate::surround::{self, Axis, CLOCK, MOST_TICKS, Survey, Vibration};
use crate::sway::Air;
use crate::tree::ModuleString;
use crate::turtle;

/// Most groups of axes in the text.
const MOST_SHOWN: usize = 8;
/// Most axes of a group whose vibrations are computed.
const MOST_MEASURED: usize = 24;
/// Axes of fewer segments bend less than rods, so that it shows.
const LIKE_A_ROD: usize = 4;
/// What to do about that.
const IN_PIECES: &str = "A segment, one F, bends to one curvature. An axis bends as a rod does if it is drawn in five pieces or more: not F(x), but `for i in 1 .. 5: ( F(x/5) )`";
/// Number of times at which motion of growth is looked for.
const LOOKS: u32 = 16;
/// Seconds that the run to the last frame may take.
pub(super) const PATIENCE: f64 = 20.0;
/// Part of a tick over which motion of growth is looked for.
const BEFORE: f64 = 1.0 / 1024.0;

/// Stems that bend, and the work that they make. Field names are those of the JSON.
#[derive(Serialize)]
pub struct BendingPlan {
    /// The plant of another model whose stems they are, such as `@Grass`, or `@Grass in @Meadow`; none for those of the model itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant: Option<String>,
    /// The time of the axes: that of the last frame, or 0; the age of a plant of another model.
    pub t: f64,
    /// Number of ticks of the clock up to then.
    pub ticks: f64,
    /// Mean speed of the wind at that time in m/s.
    pub wind: Option<f64>,
    pub axes: Vec<AxisPlan>,
    /// Why there are no axes, if the model could not be run to that time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Rules read `strain`, and the axes are those of a growth without strain.
    pub unbent: bool,
    /// The row of the table of the scene.
    #[serde(skip)]
    pub part: ScenePart,
}

/// Least and greatest value.
pub(super) type Range = [f64; 2];

/// Axes that modules of the same kinds draw.
#[derive(Serialize)]
pub struct AxisPlan {
    pub kinds: Vec<String>,
    pub tissue: String,
    /// Number of brackets around the first module.
    pub depth: usize,
    pub count: usize,
    /// Number of axes of which the last four values are known.
    pub measured: usize,
    pub segments: Range,
    /// Number of axes with fewer than [`LIKE_A_ROD`] segments, of those that are at least half as long as the longest: shoots that have just begun have few, and
    /// hardly bend.
    pub few: usize,
    /// Least number of segments of these.
    #[serde(skip)]
    fewest: usize,
    pub length: Range,
    pub width: Range,
    pub mass: Range,
    pub carried: Range,
    pub frequency: Option<Range>,
    pub damping: Option<Range>,
    pub cauchy: Option<Range>,
    pub greenhill: Option<Range>,
    #[serde(skip)]
    sags: bool,
}

impl BendingPlan {
    /// Of a model; `None` without tissues.
    pub fn new(model: &Model) -> Option<BendingPlan> {
        BendingPlan::within(model, model, None)
    }

    /// Of the plants of other models that stand in a model, those in plants included.
    pub fn of_plants(scene: &Model) -> Vec<BendingPlan> {
        fn add(scene: &Model, outer: &Model, place: &str, plans: &mut Vec<BendingPlan>) {
            for plant in &outer.scenery.plants {
                let name = format!("{}{place}", plant.name);
                plans.extend(BendingPlan::within(scene, &plant.model, Some(name.clone())));
                add(scene, &plant.model, &format!(" in {name}"), plans);
            }
        }
        let mut plans = Vec::new();
        add(scene, scene, "", &mut plans);
        plans
    }

    /// Of a model, or of a plant of this model in the wind of a scene.
    fn within(scene: &Model, model: &Model, plant: Option<String>) -> Option<BendingPlan> {
        if !turtle::bends(model) {
            return None;
        }
        let units = model.scenery.units;
        let t = model.frames.map_or(0.0, |frames| frames.to);
        let ticks = (t * units.time / CLOCK).ceil();
        // A plant stands in the wind of the scene at a time that its age does not tell: the speed is that of the last frame.
        let now = if plant.is_some() { scene.frames.map_or(0.0, |frames| frames.to) } else { t };
        let wind = scene.scenery.wind.as_ref().map(|wind| wind.speed.eval_one(&[now]));
        let (survey, moves, error) = match look(model, t) {
            Ok((survey, moves)) => (Some(survey), moves, None),
            Err(message) => (None, true, Some(message)),
        };
        let axes = survey.as_ref().map_or(Vec::new(), |survey| axes(model, survey, wind));
        let part = part(scene, model, plant.as_deref(), (t, ticks), survey.as_ref(), moves);
        Some(BendingPlan { plant, t, ticks, wind, axes, error, unbent: model.reads_strain(), part })
    }

    /// The section of the text.
    pub fn text(&self) -> String {
        let when = brief(self.t, 6);
        let whose = match &self.plant {
            Some(plant) => format!("Stems of {plant} at its age {when}"),
            None => format!("Stems at t = {when}"),
        };
        let mut out = match self.wind {
            Some(speed) => format!("{whose}, in a mean wind of {} m/s\n", brief(speed, 3)),
            None => format!("{whose}\n"),
        };
        if let Some(error) = &self.error {
            let _ = writeln!(out, "  unknown, because the model cannot be run so far: {error}");
        } else if self.axes.is_empty() {
            let _ = writeln!(out, "  none that bends is drawn then");
        }
        if self.unbent {
            let _ = writeln!(out, "  as they grow where nothing bends them");
        }
        for axis in self.axes.iter().take(MOST_SHOWN) {
            axis.text(&mut out);
        }
        if let Some(more @ 1..) = self.axes.len().checked_sub(MOST_SHOWN) {
            let _ = writeln!(out, "  … and {more} more sorts of axes (all with `--format json`)");
        }
        if self.axes.iter().take(MOST_SHOWN).any(|axis| axis.few > 0 && axis.frequency.is_some()) {
            wrapped(2, IN_PIECES, &mut out);
        }
        out.push('\n');
        out
    }
}

impl AxisPlan {
    /// How an axis of few segments differs from a rod.
    fn stiffer(&self) -> String {
        /// Per cent by which the first frequency of an axis of 1, 2 and 3 equal segments is higher than a rod's.
        const HIGHER: [u32; LIKE_A_ROD - 1] = [29, 5, 2];
        let least = self.fewest.max(1);
        // Under its own weight.
        let less = brief(100.0 / (3.0 * (least * least) as f64), 2);
        let higher = HIGHER.get(least - 1).unwrap_or(&0);
        let pieces = if least == 1 { "segment" } else { "segments" };
        let axis = format!("an axis of {least} {pieces}");
        let others = match self.few {
            few if few == self.count => String::new(),
            1 => format!("; 1 of them has fewer than {LIKE_A_ROD}"),
            few => format!("; {few} of them have fewer than {LIKE_A_ROD}"),
        };
        format!("{axis} sags {less} % less than a rod, and its frequency is {higher} % higher{others}")
    }

    fn text(&self, out: &mut String) {
        let segments = values(self.segments, 1.0);
        let pieces = if self.segments == [1.0, 1.0] { "segment" } else { "segments" };
        let depth = match self.depth {
            0 => String::new(),
            1 => " in a bracket".to_owned(),
            n => format!(" in {n} brackets"),
        };
        let each = if self.count == 1 { String::new() } else { format!(", {} axes", self.count) };
        let carries =
            if self.carried[1] > 0.0 { format!(", carries {}", mass(self.carried)) } else { String::new() };
        let line = format!(
            "{}{depth}{each} of {segments} {pieces}: {} long, {} wide at the base, {}{carries}",
            self.kinds.join(" "),
            length(self.length),
            length(self.width),
            mass(self.mass)
        );
        wrapped(2, &line, out);
        let (Some(frequency), Some(damping), Some(greenhill)) =
            (self.frequency, self.damping, self.greenhill)
        else {
            out.push_str("    too small to vibrate\n");
            return;
        };
        let of = if self.measured < self.count {
            format!("of {} of them: ", self.measured)
        } else {
            String::new()
        };
        let cauchy =
            self.cauchy.map_or(String::new(), |cauchy| format!(", Cauchy number {}", values(cauchy, 1.0)));
        let line = format!(
            "{of}first natural frequency {} Hz, damping ratio {}{cauchy}, length {} of Greenhill's",
            values(frequency, 1.0),
            values(damping, 1.0),
            values(greenhill, 1.0)
        );
        wrapped(4, &line, out);
        if self.few > 0 {
            wrapped(4, &format!("note: {}", self.stiffer()), out);
        }
        if greenhill[1] > 1.0 {
            let what = match self.sags {
                true => "bends down under its weight",
                false => "does not keep the shape that is drawn",
            };
            let warning =
                format!("warning: longer than Greenhill's length, at which a stem buckles: it {what}");
            wrapped(4, &warning, out);
        }
    }
}

/// Least and greatest value in a unit.
pub(super) fn values([least, greatest]: Range, unit: f64) -> String {
    let [least, greatest] = [least, greatest].map(|value| brief(value / unit, 3));
    if least == greatest { least } else { format!("{least} to {greatest}") }
}

fn with_unit(range: Range, units: &[(f64, &str)]) -> String {
    let shown = |range: Range| {
        // The unit of what is not there is that of a hundredth.
        let large = if range[1] > 0.0 { range[1] } else { 1e-2 };
        let fits = units.iter().find(|(unit, _)| large >= *unit).or(units.last());
        fits.map_or(String::new(), |(unit, name)| format!("{} {name}", values(range, *unit)))
    };
    let [least, greatest] = range;
    if least > 0.0 && greatest > 100.0 * least {
        return format!("{} to {}", shown([least; 2]), shown([greatest; 2]));
    }
    shown(range)
}

/// A length from m, as people read it.
pub(super) fn length(range: Range) -> String {
    with_unit(range, &[(1.0, "m"), (0.01, "cm"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")])
}

/// A mass from kg.
pub(super) fn mass(range: Range) -> String {
    with_unit(range, &[(1.0, "kg"), (1e-3, "g"), (1e-6, "mg"), (1e-9, "µg")])
}

/// Runs the model to a time; returns its stems then, and whether growth has moved any on the way.
fn look(model: &Model, t: f64) -> Result<(Survey, bool), String> {
    let settings = Settings { max_seconds: PATIENCE, ..Settings::default() };
    let told = |error: crate::sim::Error| error.diagnostic().message;
    let shown = |error: surround::Error| error.diagnostic().message;
    let mut simulation = Simulation::new(model, settings).map_err(told)?;
    let mut strings = <[ModuleString; 2]>::default();
    let [earlier, now] = &mut strings;
    let before = BEFORE * CLOCK / model.scenery.units.time;
    let mut moves = false;
    for look in 1..=LOOKS {
        let time = t * f64::from(look) / f64::from(LOOKS);
        // A model that is moving already is only run to its end.
        if !moves && time > before {
            simulation.at(time - before, earlier).map_err(told)?;
            simulation.at(time, now).map_err(told)?;
            moves = surround::moves(model, earlier, now).map_err(shown)?;
        }
    }
    simulation.at(t, now).map_err(told)?;
    Ok((Survey::new(model, now).map_err(shown)?, moves))
}

/// Axes in groups by the kinds of modules that draw them, the longest first.
fn axes(model: &Model, survey: &Survey, wind: Option<f64>) -> Vec<AxisPlan> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut known = HashMap::new();
    for (i, axis) in survey.axes().iter().enumerate() {
        let group = *known.entry((&axis.kinds, axis.tissue, axis.depth)).or_insert_with(|| {
            groups.push(Vec::new());
            groups.len() - 1
        });
        groups[group].push(i);
    }
    let mut plans: Vec<AxisPlan> = groups.iter().map(|group| plan(model, survey, group, wind)).collect();
    plans.sort_by(|a, b| b.length[1].total_cmp(&a.length[1]));
    plans
}

fn plan(model: &Model, survey: &Survey, group: &[usize], wind: Option<f64>) -> AxisPlan {
    let axes = || group.iter().map(|i| &survey.axes()[*i]);
    let first = &survey.axes()[group[0]];
    let of = |value: fn(&Axis) -> f64| range(axes().map(value)).unwrap_or_default();
    let longest = of(|axis| axis.length)[1];
    let few = || axes().filter(|axis| axis.segments < LIKE_A_ROD && axis.length >= longest / 2.0);
    // Evenly over the group from the shortest to the longest, both included.
    let mut by_length = group.to_vec();
    by_length.sort_by(|a, b| survey.axes()[*a].length.total_cmp(&survey.axes()[*b].length));
    let chosen = by_length.len().min(MOST_MEASURED);
    let place = |k: usize| by_length[k * (by_length.len() - 1) / (chosen - 1).max(1)];
    let measured: Vec<(usize, Vibration)> = (0..chosen)
        .map(place)
        .filter_map(|axis| survey.vibration(axis).map(|vibration| (axis, vibration)))
        .collect();
    let vibrations = |value: fn(&Vibration) -> f64| range(measured.iter().map(|(_, v)| value(v)));
    let air = Air::default();
    let tissue = &model.scenery.tissues[first.tissue];
    AxisPlan {
        kinds: first.kinds.iter().map(|kind| model.kinds.get(*kind).name.clone()).collect(),
        tissue: tissue.name.to_string(),
        depth: first.depth,
        count: group.len(),
        measured: measured.len(),
        segments: of(|axis| axis.segments as f64),
        few: few().count(),
        fewest: few().map(|axis| axis.segments).min().unwrap_or(LIKE_A_ROD),
        length: of(|axis| axis.length),
        width: of(|axis| axis.width),
        mass: of(|axis| axis.mass),
        carried: of(|axis| axis.carried),
        frequency: vibrations(|v| v.frequency),
        damping: vibrations(|v| v.damping),
        cauchy: wind.and_then(|speed| {
            range(measured.iter().map(|(axis, _)| survey.axes()[*axis].cauchy_number(&air, speed)))
        }),
        greenhill: vibrations(|v| v.greenhill),
        sags: tissue.sag,
    }
}

pub(super) fn range(values: impl Iterator<Item = f64>) -> Option<Range> {
    values.fold(None, |range, x| match range {
        None => Some([x, x]),
        Some([least, greatest]) => Some([x.min(least), x.max(greatest)]),
    })
}

/// How the stems of a model are followed, in the wind of a scene, and why.
fn part(
    scene: &Model,
    model: &Model,
    plant: Option<&str>,
    (t, ticks): (f64, f64),
    survey: Option<&Survey>,
    moves: bool,
) -> ScenePart {
    let name = plant.map_or("stems".to_owned(), |plant| format!("stems of {plant}"));
    let tissues = &model.scenery.tissues;
    let is_used = |number: &usize| survey.is_none_or(|s| s.axes().iter().any(|axis| axis.tissue == *number));
    let names = |is_meant: &dyn Fn(usize) -> bool| -> Vec<&str> {
        (0..tissues.len()).filter(|n| is_used(n) && is_meant(*n)).map(|n| &*tissues[n].name).collect()
    };
    let sagging = names(&|number| tissues[number].sag);
    let mut reasons = Vec::new();
    if scene.scenery.wind.is_some() || !scene.scenery.flows.is_empty() {
        reasons.push("the wind moves them".to_owned());
    }
    if !scene.scenery.solids.is_empty() {
        reasons.push("the air that bodies push aside moves them (`solid`)".to_owned());
    }
    if !sagging.is_empty() {
        reasons.push(format!("their weight does (`sag`: {})", sagging.join(", ")));
    }
    if moves {
        reasons.push("growth moves what they carry".to_owned());
    }
    let when = brief(t, 6);
    if reasons.is_empty() {
        let why = "there is no wind, no body that is `solid`, no tissue with `sag`, and growth moves nothing: stems keep the shape that is drawn";
        return ScenePart::new(name, "nothing to do", why);
    }
    if survey.is_some_and(|survey| survey.axes().is_empty()) && !moves {
        let why =
            format!("none that bends is drawn at {} = {when}", if plant.is_some() { "the age" } else { "t" });
        return ScenePart::new(name, "nothing to do", why);
    }
    let reasons = reasons.join(", ");
    let why = if plant.is_some() {
        let made = names(&|_| true).join(", ");
        format!(
            "{reasons}; each plant sways at its own place, made of {made}, at every tick of a clock of 1/30 s"
        )
    } else {
        let steps = if ticks > MOST_TICKS {
            format!(
                "{ticks:.1e} ticks of a clock of 1/30 s up to t = {when}, more than the {MOST_TICKS:.0e} that are possible"
            )
        } else {
            format!("{ticks} ticks of a clock of 1/30 s up to t = {when}, of one step or more")
        };
        format!("{reasons}; {steps}; {}", ways(model))
    };
    ScenePart::new(name, "in steps", why)
}

/// Whether the stems act on growth.
fn ways(model: &Model) -> String {
    let readers = (model.kinds.iter()).filter(|(_, kind)| kind.input_parameter(Quantity::Strain).is_some());
    let readers: Vec<&str> = readers.map(|(_, kind)| &*kind.name).collect();
    match model.reads_strain() {
        true => format!(
            "two ways: rules of {} read `strain`, and growth and stems go on in turn, tick by tick",
            readers.join(", ")
        ),
        false => "one way: no rule reads `strain`".to_owned(),
    }
}
