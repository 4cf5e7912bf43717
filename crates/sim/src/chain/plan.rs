//! The plan of a stretch of time: the lives of many modules, each followed from one to the next.
//!
//! A *runner* is a module that is there when the stretch begins. All that happens to it depends on nothing but its values and its birth, so runners
//! are computed independently of each other, up to [`LANES`] with lives of one class at once. Nothing is changed: the plan is carried out, or
//! dropped where something happens that the general way decides.

use dlsys_expr::{LANES, Lanes};
use dlsys_model::{KindId, Outcome};
use dlsys_tree::{Family, Lineage, NO_LABEL, SimTime, Tree};

use super::lanes::{Block, Fate};
use super::law::Law;
use super::order::Happened;
use crate::event::SHORT_LIFE;
use crate::world::life::Lives;

/// Runners that are followed together.
const GROUP: usize = 1024;
/// Parts of the work of a plan for each thread.
const PARTS: usize = 4;

/// The facts of a plan.
#[derive(Clone, Copy)]
pub struct Course<'a, 'm> {
    pub tree: &'a Tree,
    pub lives: &'a Lives,
    pub laws: &'a [Option<Law<'m>>],
    /// Only what happens before this time is planned.
    pub limit: f64,
    pub logs: bool,
}

/// A module that was there when the stretch began, and the one that takes its place.
#[derive(Clone, Debug)]
pub struct Runner {
    pub slot: u32,
    /// Number of productions.
    pub productions: u32,
    /// Of the last production.
    pub family: Family,
    pub kind: KindId,
    pub birth: SimTime,
    pub label: u16,
    /// Its event, if it has one.
    pub next: Option<f64>,
    /// Where its parameters are among the values of the plan.
    pub values: (u32, u32),
}

/// A production for the log.
#[derive(Clone, Copy, Debug)]
pub struct Logged {
    pub lineage: Lineage,
    pub kind: KindId,
    pub rule: usize,
    pub clause: usize,
    pub residual: f64,
}

/// What happens in a stretch of time.
#[derive(Debug, Default)]
pub struct Plan {
    pub events: Vec<Happened>,
    /// By entry, if productions are logged.
    pub logged: Vec<Logged>,
    pub runners: Vec<Runner>,
    pub values: Vec<f64>,
    /// The first time from which on the general way decides; infinite if there is none.
    pub cut: f64,
}

/// Modules with lives of one class.
#[derive(Debug, Default)]
struct Crowd {
    walkers: Vec<Walker>,
    values: Vec<f64>,
}

/// One life of a runner.
#[derive(Clone, Copy, Debug)]
struct Walker {
    runner: u32,
    slot: u32,
    /// Of the module that lives it.
    kind: KindId,
    lineage: Lineage,
    /// Number of productions before it.
    productions: u32,
    birth: SimTime,
    /// The event, and the level that a parameter meets then.
    at: SimTime,
    level: f64,
}

impl Crowd {
    fn add(&mut self, walker: Walker, values: impl Iterator<Item = f64>) {
        self.walkers.push(walker);
        self.values.extend(values);
    }

    /// Puts up to [`LANES`] modules from one on, with as many parameters each, into a block; returns the number of the next one.
    fn load(&self, first: usize, width: usize, block: &mut Block) -> usize {
        let next = (first + LANES).min(self.walkers.len());
        let values = self.values[first * width..next * width].chunks(width.max(1));
        for (lane, values) in values.enumerate() {
            for (register, x) in block.registers.iter_mut().zip(values) {
                register[lane] = *x;
            }
        }
        block.count = next - first;
        block.births.clear();
        block.births.extend(self.walkers[first..next].iter().map(|walker| walker.birth));
        next
    }

    fn clear(&mut self) {
        self.walkers.clear();
        self.values.clear();
    }
}

/// Plans for some modules, whose slots are given, made on several threads; each is for modules that follow each other in the list.
pub fn plans(course: Course, slots: &[u32], threads: usize) -> Vec<Plan> {
    let size = match threads {
        ..=1 => slots.len(),
        // Some threads may be faster than others.
        _ => slots.len().div_ceil(PARTS * threads).max(LANES),
    };
    let chunks: Vec<&[u32]> = slots.chunks(size.max(1)).collect();
    dlsys_threads::each(threads, chunks.len(), |number| Planner::new(course).plan(chunks[number]))
}

/// The productions of some plans, one list for each, and what is logged of all of them, by entry.
pub fn take_events(plans: &mut [Plan]) -> (Vec<Vec<Happened>>, Vec<Logged>) {
    let (mut lists, mut logged) = (Vec::with_capacity(plans.len()), Vec::new());
    let mut first = 0;
    for plan in plans {
        let mut events = std::mem::take(&mut plan.events);
        if first > 0 {
            events.iter_mut().for_each(|event| event.entry += first);
        }
        first += events.len() as u32;
        lists.push(events);
        match logged.is_empty() {
            true => logged = std::mem::take(&mut plan.logged),
            false => logged.append(&mut plan.logged),
        }
    }
    (lists, logged)
}

/// Makes a plan for some modules.
struct Planner<'a, 'm> {
    course: Course<'a, 'm>,
    plan: Plan,
    /// By label: lives whose events come before the limit.
    crowds: Vec<Crowd>,
    /// An empty one, with its memory.
    spare: Crowd,
    block: Block,
    fates: Vec<Fate>,
    arguments: Vec<Lanes>,
}

impl<'a, 'm> Planner<'a, 'm> {
    fn new(course: Course<'a, 'm>) -> Planner<'a, 'm> {
        let crowds = course.laws.iter().map(|_| Crowd::default()).collect();
        let plan = Plan { cut: f64::INFINITY, ..Plan::default() };
        let (spare, block, fates, arguments) = Default::default();
        Planner { course, plan, crowds, spare, block, fates, arguments }
    }

    fn plan(mut self, slots: &[u32]) -> Plan {
        for group in slots.chunks(GROUP) {
            self.start(group);
            // The largest crowd fills most lanes.
            while let Some(label) = (0..self.crowds.len()).max_by_key(|i| self.crowds[*i].walkers.len())
                && !self.crowds[label].walkers.is_empty()
            {
                let crowd = std::mem::replace(&mut self.crowds[label], std::mem::take(&mut self.spare));
                let mut first = 0;
                while first < crowd.walkers.len() {
                    first = self.step(label, &crowd, first);
                }
                self.spare = crowd;
                self.spare.clear();
            }
        }
        self.plan
    }

    /// Takes up modules of the tree.
    fn start(&mut self, group: &[u32]) {
        let Course { tree, lives, laws, .. } = self.course;
        let mut starting: Vec<Crowd> = laws.iter().map(|_| Crowd::default()).collect();
        for &slot in group {
            let look = tree.look(slot);
            let (birth, runner) = (look.birth, self.plan.runners.len() as u32);
            let lineage = tree.lineage_of(&look);
            self.plan.runners.push(Runner {
                slot,
                productions: 0,
                family: Family::AXIOM,
                kind: look.kind,
                birth,
                label: look.label,
                next: None,
                values: (0, 0),
            });
            let (kind, productions, level) = (look.kind, 0, 0.0);
            let walker = Walker { runner, slot, kind, lineage, productions, birth, at: birth, level };
            starting[look.label as usize].add(walker, look.values.iter().copied());
        }
        for (label, crowd) in starting.iter().enumerate() {
            let Some(law) = &laws[label] else { continue };
            let mut first = 0;
            while first < crowd.walkers.len() {
                self.block.make_variables(law.rule);
                let next = crowd.load(first, law.rule.parameters.len(), &mut self.block);
                self.block.foresee(lives, law.rule, Some(label as u16), &mut self.fates);
                for (lane, walker) in crowd.walkers[first..next].iter().enumerate() {
                    match self.fates[lane] {
                        Fate::Ends(same, at, level) if usize::from(same) == label => {
                            let width = law.rule.parameters.len();
                            let values = self.block.registers[..width].iter().map(|lanes| lanes[lane]);
                            self.crowds[label].add(Walker { at, level, ..*walker }, values);
                        }
                        // Not so: it is the life that was foreseen at birth.
                        _ => self.plan.cut = f64::NEG_INFINITY,
                    }
                }
                first = next;
            }
        }
    }

    /// Lets up to [`LANES`] lives of a class end, from one on; returns the number of the next one.
    fn step(&mut self, label: usize, crowd: &Crowd, first: usize) -> usize {
        let Course { lives, laws, limit, logs, .. } = self.course;
        let Some(law) = &laws[label] else { return crowd.walkers.len() };
        let Planner { plan, crowds, block, fates, arguments, .. } = self;
        let rule = law.rule;
        block.make_variables(rule);
        let end = crowd.load(first, rule.parameters.len(), block);
        let walkers = &crowd.walkers[first..end];
        block.end(law, walkers.iter().map(|walker| (walker.at, walker.level)));
        let residuals = if logs { block.residuals(rule, &law.at_boundary) } else { Lanes::default() };
        arguments.clear();
        for register in law.stretch.arguments.eval_rows(&mut block.registers, block.count) {
            arguments.push(block.registers[register]);
        }
        block.births.clear();
        block.births.extend(walkers.iter().map(|walker| walker.at));
        match law.next {
            Some(next) => {
                block.make_variables(next);
                block.registers[..arguments.len()].copy_from_slice(arguments);
                block.foresee(lives, next, None, fates);
            }
            None => {
                fates.clear();
                fates.resize(block.count, Fate::Lasts(NO_LABEL));
            }
        }
        let production = Outcome::production(law.key, 0);
        for (lane, (walker, fate)) in walkers.iter().zip(&*fates).enumerate() {
            let Walker { runner, slot, lineage, at, .. } = *walker;
            let is_short = at.since(walker.birth) <= SHORT_LIFE * at.resolution();
            let is_finite = arguments.iter().all(|lanes| lanes[lane].is_finite());
            let (label, next) = match *fate {
                Fate::Ends(label, next, level) if is_finite && !is_short => (label, Some((next, level))),
                Fate::Lasts(label) if is_finite && !is_short => (label, None),
                _ => {
                    plan.cut = plan.cut.min(at.to_f64());
                    continue;
                }
            };
            if logs {
                let (kind, residual) = (walker.kind, residuals[lane]);
                plan.logged.push(Logged { lineage, kind, rule: rule.index, clause: law.produce, residual });
            }
            plan.events.push(Happened { at, slot, entry: plan.events.len() as u32 });
            let (kind, productions, family) =
                (law.successor, walker.productions + 1, lineage.family(production));
            let values = arguments.iter().map(|lanes| lanes[lane]);
            if let Some((next, level)) = next
                && next.to_f64() < limit
            {
                match laws[usize::from(label)] {
                    Some(_) => {
                        let lineage = family.child(0);
                        #[rustfmt::skip]
                        let walker =
                            Walker { runner, slot, kind, lineage, productions, birth: at, at: next, level };
                        crowds[usize::from(label)].add(walker, values);
                        continue;
                    }
                    None => plan.cut = plan.cut.min(next.to_f64()),
                }
            }
            let first = plan.values.len();
            plan.values.extend(values);
            let values = (first as u32, plan.values.len() as u32);
            let next = next.map(|(next, _)| next.to_f64());
            plan.runners[runner as usize] =
                Runner { slot, productions, family, kind, birth: at, label, next, values };
        }
        end
    }
}
