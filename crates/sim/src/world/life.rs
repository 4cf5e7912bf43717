//! Life classes: the data of lazy modules besides their numbers.
//!
//! A module is *lazy* if it reads no module and no module reads it, all its parameters have closed forms, and its next event
//! has one and is a production (`flow::prediction` decides that at birth). Then its birth and the values it was born with determine
//! all its life: trajectories, instant of the event, successor. They are computed from them by the same code, hence to the
//! same bits, on demand, and nothing is kept of the module but the number of its [`LifeClass`]. A model
//! has a few classes; a module has one from its birth to its end.

use smallvec::SmallVec;

use crate::setup::levels_decide;
use crate::trajectory::Trajectory;
use crate::world::new_modules::NewModules;
use crate::world::state::Signs;
use dlsys_expr::Program;
use dlsys_model::{Model, Rule, Sign, SolutionForm, Solve, ZeroCrossing};
use dlsys_tree::{NO_LABEL, SimTime};

/// The label of a module that is known not to be lazy.
pub const REFUSED: u16 = NO_LABEL - 1;
/// Most classes of one rule; a model with more of them has conditions without number.
const MAX_CLASSES: usize = 64;

/// The common data of all modules with the same rule, clause, signs and kind of end.
#[derive(Clone, Debug, PartialEq)]
pub struct LifeClass {
    pub rule: usize,
    pub solve: Option<usize>,
    /// Of the rule's atoms, from birth to the event.
    pub signs: Signs,
    /// The production at the end; None if there is none.
    pub end: Option<End>,
}

/// A production.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// It applies as soon as the module is there.
    AtBirth { produce: usize },
    /// An atom's sides meet.
    Crossing { produce: usize, atom: usize, after: Sign },
}

impl LifeClass {
    pub fn produce(&self) -> Option<usize> {
        match self.end? {
            End::AtBirth { produce } | End::Crossing { produce, .. } => Some(produce),
        }
    }

    pub fn is_over_at_birth(&self) -> bool {
        matches!(self.end, Some(End::AtBirth { .. }))
    }
}

/// The life of one module and its successor: kept because the next life may be the same. Many modules are born
/// with the same values, and many of those at one instant.
#[derive(Clone, Debug, Default)]
pub struct Life {
    pub known: bool,
    pub birth: SimTime,
    /// Those it was born with.
    pub values: SmallVec<[f64; 4]>,
    pub trajectories: SmallVec<[Trajectory; 2]>,
    /// The event, if there is one.
    pub at: SimTime,
    /// The time from birth to the event, if that and the trajectories are the same whenever a module is born.
    pub tau: Option<f64>,
    /// The parameter that meets a level at the event, with the level.
    pub level: Option<(usize, f64)>,
    /// When it was replaced, if the successor is known.
    pub replaced: Option<SimTime>,
    /// The modules of the successor.
    pub new: NewModules,
    /// Which of the successors that the production has.
    pub successor: usize,
    pub children: Vec<Newborn>,
    pub residual: f64,
    /// All that is said of the end here is the same whenever a module with these values is born; but for the times of the
    /// children's events, which come as long after as they say.
    pub lasting: bool,
}

/// The prediction for modules of a rule that are born with these values, whenever that is.
#[derive(Clone, Debug)]
pub struct CachedPrediction {
    pub values: SmallVec<[f64; 4]>,
    pub label: u16,
    /// The time to the event, if there is one.
    pub tau: Option<f64>,
}

/// The predicted life of a module of a successor.
#[derive(Clone, Copy, Debug)]
pub struct Newborn {
    /// Of its class; or [`REFUSED`]; or [`NO_LABEL`]: it has no rules, or a context.
    pub label: u16,
    /// Of its event.
    pub time: Option<f64>,
    /// It is to be looked up.
    pub open: bool,
    /// The same is told whenever it is born, and its event is `tau` later, if there is one.
    pub lasting: bool,
    pub tau: Option<f64>,
}

impl Life {
    /// True if a module of this birth and these values lives this life.
    #[inline]
    pub fn is_of(&mut self, birth: SimTime, values: &[f64]) -> bool {
        if !self.known || !same_bits(&self.values, values) {
            return false;
        }
        if self.birth != birth {
            let Some(tau) = self.tau else { return false };
            (self.birth, self.at, self.replaced) = (birth, birth.after(tau), None);
        }
        true
    }

    /// Takes over the end of the last module that lived this life, now. False if it may differ.
    pub fn end_again(&mut self, now: SimTime) -> bool {
        if !self.lasting || self.tau != Some(now.since(self.birth)) {
            return false;
        }
        for child in &mut self.children {
            let Some(tau) = child.tau else { continue };
            child.time = now.ahead(tau);
            if child.time.is_none() {
                return false;
            }
        }
        self.replaced = Some(now);
        true
    }
}

/// True if the numbers are the same, 0 and -0 told apart.
#[inline]
pub fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// All classes that there have been, by number.
#[derive(Clone, Debug, Default)]
pub struct Lives {
    all: Vec<LifeClass>,
    lives: Vec<Option<Box<Life>>>,
    of_rule: Vec<Vec<u16>>,
    /// By kind: the rule of those that can be lazy.
    rules: Vec<Option<usize>>,
    /// By rule: nothing in it depends on the time of birth.
    timeless: Vec<bool>,
    /// By rule and production: its successor depends on the values at birth only.
    lasting: Vec<Vec<bool>>,
    /// By rule: the last one, if it is timeless.
    pub cached: Vec<Option<CachedPrediction>>,
}

impl Lives {
    /// No classes yet. A kind can have some if its rule needs no context, has rates only and reads nothing of the surroundings, and no
    /// rule looks for it as a context.
    pub fn new(model: &Model, kinds_with_context: &[bool]) -> Lives {
        let mut seen = vec![false; model.kinds.len()];
        for rule in &model.rules {
            let children = rule.aggregates.iter().map(|aggregate| &aggregate.pattern);
            for pattern in rule.left.iter().chain(&rule.right).chain(children) {
                pattern.kinds.iter().for_each(|kind| seen[kind.index()] = true);
            }
        }
        let rules = (model.kinds.iter())
            .map(|(id, kind)| {
                let alone = !kinds_with_context[id.index()] && !seen[id.index()] && kind.steps.is_empty();
                // The surroundings change what they give at any time.
                let alone = alone && kind.read_inputs().next().is_none();
                // Algebraic parameters must be made consistent first.
                let is_plain = |rule: &Rule| !rule.is_algebraic() && !levels_decide(rule);
                kind.rules.first().copied().filter(|rule| alone && is_plain(&model.rules[*rule]))
            })
            .collect();
        let of_rule = vec![Vec::new(); model.rules.len()];
        let timeless = model.rules.iter().map(is_timeless).collect();
        let lasting = model.rules.iter().map(lasting_productions).collect();
        let cached = vec![None; model.rules.len()];
        Lives { all: Vec::new(), lives: Vec::new(), of_rule, rules, timeless, lasting, cached }
    }

    /// True if nothing in a rule depends on the time of birth.
    pub fn is_timeless(&self, rule: usize) -> bool {
        self.timeless[rule]
    }

    /// True if the successor of a production depends on the values at birth only, whenever that is.
    pub fn is_lasting(&self, rule: usize, produce: usize) -> bool {
        self.lasting[rule][produce]
    }

    /// The rule of a kind whose modules can be lazy.
    pub fn rule(&self, kind: dlsys_model::KindId) -> Option<usize> {
        self.rules[kind.index()]
    }

    /// The class with a label, if it is one.
    pub fn get(&self, label: u16) -> Option<&LifeClass> {
        self.all.get(label as usize)
    }

    /// The number of a class; None if there are too many of them.
    pub fn intern(&mut self, class: LifeClass) -> Option<u16> {
        let known = &mut self.of_rule[class.rule];
        if let Some(&label) = known.iter().find(|label| self.all[**label as usize] == class) {
            return Some(label);
        }
        if known.len() >= MAX_CLASSES || self.all.len() >= usize::from(REFUSED) {
            return None;
        }
        let label = self.all.len() as u16;
        known.push(label);
        self.all.push(class);
        self.lives.push(None);
        Some(label)
    }

    /// The labels of the classes of a rule.
    pub fn labels_of(&self, rule: usize) -> &[u16] {
        &self.of_rule[rule]
    }

    /// Number of classes.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// The last life of a class, to be given back with [`Lives::keep`].
    pub fn take_life(&mut self, label: u16) -> Box<Life> {
        self.lives[label as usize].take().unwrap_or_default()
    }

    pub fn keep(&mut self, label: u16, life: Box<Life>) {
        self.lives[label as usize] = Some(life);
    }
}

/// True if lives under a rule are the same whenever they begin: nothing reads `t`.
fn is_timeless(rule: &Rule) -> bool {
    let time = rule.time_variable();
    let blind = |program: &Program| !program.reads().contains(&time);
    let law_is_blind = |law: &SolutionForm| match law {
        SolutionForm::Polynomial(program) | SolutionForm::Quadratic(program) => blind(program),
        SolutionForm::Driven(law) => {
            blind(&law.coefficients) && law.pace.as_ref().is_none_or(|pace| blind(pace))
        }
        SolutionForm::Sum { .. } | SolutionForm::Numeric(_) => false,
    };
    let watch_is_blind = |watch: &ZeroCrossing| match watch {
        ZeroCrossing::Constant => true,
        ZeroCrossing::Formula { variable, level } => *variable != time && blind(level),
        ZeroCrossing::Search { .. } => false,
    };
    let solve_is_blind = |s: &Solve| {
        blind(&s.rates)
            && s.solution_forms.iter().all(law_is_blind)
            && s.zero_crossings.iter().all(watch_is_blind)
    };
    blind(&rule.sides)
        && rule.zero_crossings_at_rest.iter().all(watch_is_blind)
        && rule.solves.iter().all(solve_is_blind)
}

/// Of each production of a rule, whether its successor depends on the values at birth only: neither chance, nor `t`,
/// nor `age`, which is rounded.
fn lasting_productions(rule: &Rule) -> Vec<bool> {
    let time = rule.time_variable();
    let reads_time = |variable: usize| variable == time || variable == time + 1;
    let plain = is_timeless(rule) && !rule.sides.reads().iter().any(|variable| reads_time(*variable));
    (rule.produces.iter())
        .map(|p| plain && !p.is_fault && !p.outcome.is_random() && !p.outcome.reads().any(reads_time))
        .collect()
}
