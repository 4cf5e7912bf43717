//! Chains of lives against the queue: random models whose modules are replaced one by one, some of them by several modules, by none or
//! by chance. [`Simulation::pass_some`] takes every production from the queue, [`Simulation::at`] makes chains of them, on one thread or on
//! several: the states, the logs and the counts must be the same bits.

use dlsys_session::Session;
use dlsys_sim::{Error, Event, Passed, Settings, Simulation, Stats};
use proptest::prelude::*;

/// A kind of the model: how a module grows, when it is replaced, and by what.
#[derive(Clone, Debug)]
struct Kind {
    growth: usize,
    level: usize,
    successors: [usize; 2],
    heirs: [usize; 2],
    splits: bool,
    rate: u32,
}

/// Number of kinds, and of entries in the lists below.
const KINDS: usize = 3;
const GROWTHS: usize = 8;
const LEVELS: usize = 5;
const SUCCESSORS: usize = 12;

fn growth(kind: &Kind) -> String {
    let r = 0.5 + f64::from(kind.rate) / 7.0;
    match kind.growth {
        0 => "dx/dt = 1".to_owned(),
        1 => format!("dx/dt = {r}"),
        2 => format!("dx/dt = {r}*(0.2 + p)"),
        3 => format!("dx/dt = {r}*(0.1 + x)*(1 - x/4)"),
        4 => format!("dx/dt = {r} + x"),
        5 => format!("dx/dt = {r}, dq/dt = 0.3*q*(1 - q)"),
        6 => format!("dx/dt = 1, dq/dt = {r}*age"),
        _ => format!("dx/dt = {r} + 0.1*t"),
    }
}

fn level(kind: &Kind) -> &'static str {
    ["1", "1 + p", "0.5 + 2*p", "1 + p*(1 - p)", "1.5"][kind.level]
}

fn successor(which: usize, heir: usize) -> String {
    let heir = ["A", "B", "C"][heir];
    match which {
        0 => format!("{heir}(0, p, q)"),
        1..=4 => format!("{heir}(0, 4*p*(1 - p), q/2 + 0.1)"),
        5 => format!("{heir}(p/8, 4*p*(1 - p), age/9)"),
        6 => format!("{heir}(0, p, fract(t))"),
        // Born beyond its level: replaced at once.
        7 => format!("{heir}(3, 4*p*(1 - p), q)"),
        8 => format!("{heir}(0, 4*p*(1 - p), q) D(x)"),
        9 => "D(x)".to_owned(),
        10 => format!("{heir}(0, uniform(0, 1), q)"),
        _ => format!("{heir}(1e-14, p, q)"),
    }
    .replace("fract(t)", "t - floor(t)")
}

/// The text of a model of `n` modules at first. `apart` is how their phases differ.
fn text(n: usize, apart: f64, kinds: &[Kind]) -> String {
    let mut text = format!(
        "initial string: A(0, 0.3, 0.5) B(0, 0.4, 0.5) C(0, 0.7, 0.5) D(1) G(0, {n})\nG(i, n):\n  \
         if n > 1 produce G(i, floor(n/2)) G(i + floor(n/2), n - floor(n/2))\n  \
         if n = 1 produce A(0, 0.1 + 0.8*(i*{apart} - floor(i*{apart})), 0.5)\n"
    );
    for (name, kind) in ["A", "B", "C"].iter().zip(kinds) {
        let (growth, level) = (growth(kind), level(kind));
        let [one, other] = [0, 1].map(|i| successor(kind.successors[i], kind.heirs[i]));
        text += &format!("{name}(x, p, q):\n  if x < {level} solve {growth}\n");
        text += &match kind.splits {
            true => format!(
                "  if x >= {level} & p > 0.5 produce {one}\n  if x >= {level} & p <= 0.5 produce {other}\n"
            ),
            false => format!("  if x >= {level} produce {one}\n"),
        };
    }
    text + "D(x): solve dx/dt = -x\n"
}

/// Everything that a run gives: at some times the bits of the state and the counts, and the log or the error.
type Record = (Vec<(Vec<u64>, Stats)>, Vec<Event>, Option<String>);

/// How time passes.
#[derive(Clone, Copy)]
enum Way {
    Queue,
    Chains,
    /// Chains, with a pause after each of them.
    Pieces,
}

/// Runs a model; returns also how many productions were those of chains.
fn run(session: &Session, settings: Settings, times: &[f64], way: Way) -> (Record, u64) {
    let mut simulation = match session.simulate(settings) {
        Ok(simulation) => simulation,
        Err(error) => return ((Vec::new(), Vec::new(), Some(error.to_string())), 0),
    };
    let (mut states, mut failed) = (Vec::new(), None);
    for &t in times {
        match state(&mut simulation, t, way) {
            Ok(bits) => states.push((bits, simulation.stats())),
            Err(error) => {
                states.push((Vec::new(), simulation.stats()));
                failed = Some(error.to_string());
                break;
            }
        }
    }
    let chained = simulation.productions_in_chains();
    ((states, simulation.take_events(), failed), chained)
}

fn state(simulation: &mut Simulation, t: f64, way: Way) -> Result<Vec<u64>, Error> {
    match way {
        Way::Queue => {
            simulation.pass_some(t, usize::MAX, false)?;
        }
        Way::Chains => {}
        Way::Pieces => while simulation.pass_piece(t, 100)? != Passed::All {},
    }
    let mut string = Default::default();
    simulation.at(t, &mut string)?;
    let module = |m: dlsys_tree::Module| {
        let numbers = m.parameters.iter().map(|x| x.to_bits());
        let which = [m.kind.index() as u64, m.lineage.id];
        which.into_iter().chain(numbers).collect::<Vec<u64>>()
    };
    Ok(string.iter().flat_map(module).collect())
}

/// Runs by the queue, and by chains on so many threads, and compares; returns how many productions were those of chains.
fn compare(text: &str, settings: Settings, times: &[f64], threads: &[usize]) -> u64 {
    let session = Session::from_text("chains.dls", text, &[]).unwrap_or_else(|e| panic!("{text}\n{e:?}"));
    let (queue, none) = run(&session, settings, times, Way::Queue);
    assert_eq!(none, 0);
    let mut least = u64::MAX;
    for &threads in threads {
        let way = if threads == 2 { Way::Pieces } else { Way::Chains };
        let (chains, chained) = run(&session, Settings { threads, threads_from: 0, ..settings }, times, way);
        assert_eq!(queue.2, chains.2, "{threads} threads, {text}");
        for (i, (a, b)) in queue.1.iter().zip(&chains.1).enumerate() {
            assert_eq!(a, b, "production {i}, {threads} threads, of\n{text}");
        }
        assert_eq!(queue.1.len(), chains.1.len(), "{threads} threads, {text}");
        let ends = [queue.0.last(), chains.0.last()];
        assert!(queue.0 == chains.0, "states, {threads} threads, of\n{text}\n{ends:?}");
        least = least.min(chained);
    }
    least
}

fn kind() -> impl Strategy<Value = Kind> {
    // One successor in nine is none of a chain.
    let successor = || prop_oneof![8 => 0..7usize, 1 => 7..SUCCESSORS];
    let heirs = [0..KINDS, 0..KINDS];
    (0..GROWTHS, 0..LEVELS, [successor(), successor()], heirs, any::<bool>(), 0..9u32).prop_map(
        |(growth, level, successors, heirs, splits, rate)| Kind {
            growth,
            level,
            successors,
            heirs,
            splits,
            rate,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn chains_are_as_the_queue(
        kinds in proptest::collection::vec(kind(), KINDS),
        n in prop_oneof![1..4usize, 60..400usize],
        // Some models have many twins.
        apart in prop_oneof![Just(0.123_456_789), Just(0.25), Just(0.1)],
        log in any::<bool>(),
        frames in 1..9usize,
        most in prop_oneof![Just(10_000_000_000u64), 500..6000u64],
        threads in 1..4usize,
    ) {
        let settings = Settings { log, max_modules: 3000, max_events: most, ..Settings::default() };
        let times: Vec<f64> = (1..=frames).map(|k| 20.0 * k as f64 / frames as f64).collect();
        compare(&text(n, apart, &kinds), settings, &times, &[threads]);
    }
}

/// A kind whose modules live on in chains: growth, level, and the number of the successor.
fn lives(growth: usize, level: usize, successor: usize) -> Kind {
    Kind { growth, level, successors: [successor; 2], heirs: [0; 2], splits: false, rate: 3 }
}

#[test]
fn most_productions_of_plain_lives_are_in_chains() {
    for (growth, level, successor) in [(0, 1, 1), (3, 0, 2), (5, 3, 5), (6, 2, 6)] {
        for log in [false, true] {
            let text = text(300, 0.123_456_789, &vec![lives(growth, level, successor); KINDS]);
            let chained = compare(&text, Settings { log, ..Settings::default() }, &[40.0], &[1, 2, 3]);
            assert!(chained > 3000, "{chained} of\n{text}");
        }
    }
}

/// Modules with the same values end at many instants. The time since birth, which their values at the end hang on, is rounded there in more
/// ways than one: no successor may be taken from a twin of another instant unless it is the same. Here one of a hundred and twenty lives was,
/// by the queue, so that a value depended in its last bit on the frames that were asked for.
#[test]
fn twins_of_other_instants_give_no_other_bits() {
    let a = Kind { heirs: [1; 2], ..lives(1, 4, 1) };
    let b = Kind { rate: 0, ..lives(6, 2, 0) };
    let c = Kind { heirs: [1; 2], ..lives(3, 1, 1) };
    let times: Vec<f64> = (1..=7).map(|k| 20.0 * f64::from(k) / 7.0).collect();
    for times in [&times[..], &times[2..], &times[6..]] {
        compare(&text(68, 0.25, &[a.clone(), b.clone(), c.clone()]), Settings::default(), times, &[1]);
    }
}

#[test]
fn an_error_is_found_where_the_queue_finds_it() {
    // One of them divides by zero at the end of its sixth life.
    let text = "initial string: G(0, 300)\nG(i, n):\n  \
        if n > 1 produce G(i, floor(n/2)) G(i + floor(n/2), n - floor(n/2))\n  if n = 1 produce A(0, (i + 0.4567)/300, i)\n\
        A(x, p, k):\n  if x < 1 + p solve dx/dt = 1\n  \
        if x = 1 + p produce A(0, 4*p*(1 - p) + (if k = 5150 then 1/(k - 5150) else 0), k + 1000)\n";
    for times in [&[30.0][..], &[3.0, 4.5, 30.0]] {
        let chained = compare(text, Settings { log: true, ..Settings::default() }, times, &[1, 2, 3]);
        assert!(chained > 500, "{chained}");
    }
}
