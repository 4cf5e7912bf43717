//! The equations of all modules between two changes of structure.

use super::runge_kutta::Rates;
use crate::expr::{Dual, Scratch, Value};
use crate::model::Rule;
use crate::structure::{Instant, ModuleId, Tree};

const NONE: u32 = u32::MAX;

/// Where a variable of a rule comes from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// It does not change before the next event.
    Fixed(f64),
    /// A component of the state vector.
    State(u32),
}

/// A module to which a rule applies.
#[derive(Clone, Debug)]
pub struct Member {
    pub id: ModuleId,
    /// Index into the model's rules.
    pub rule: usize,
    /// The active `solve` clause.
    pub solve: Option<usize>,
    /// Its variables in `System::sources`, without time and switches.
    first_source: usize,
    sources: usize,
    /// Its switches in `System::switches`.
    first_switch: usize,
    switches: usize,
    /// Its derivatives in the state vector.
    first_rate: usize,
    /// Age at the start of the system's time.
    age: f64,
    birth: Instant,
}

impl Member {
    pub fn age(&self) -> f64 {
        self.age
    }

    pub fn birth(&self) -> Instant {
        self.birth
    }
}

/// What the system has to know of a module.
pub struct Joining<'a> {
    pub id: ModuleId,
    pub rule: usize,
    pub context: &'a [ModuleId],
    pub solve: Option<usize>,
    pub switches: &'a [bool],
}

/// All modules that have rules, their equations and their state vector.
#[derive(Clone, Debug, Default)]
pub struct System {
    pub members: Vec<Member>,
    sources: Vec<Source>,
    switches: Vec<f64>,
    /// Place in the tree's values of each component of the state vector.
    pub places: Vec<u32>,
    /// Component of each place; `NONE` for values that stand.
    component: Vec<u32>,
    /// Time 0 of `tau`.
    pub start: Instant,
}

impl System {
    /// Builds the system at an instant, and its state vector.
    pub fn new<'a>(
        rules: &[Rule],
        tree: &Tree,
        start: Instant,
        modules: impl Iterator<Item = Joining<'a>> + Clone,
        y: &mut Vec<f64>,
    ) -> System {
        let mut system = System { start, component: vec![NONE; tree.values().len()], ..System::default() };
        y.clear();
        for Joining { id, rule, solve, .. } in modules.clone() {
            let first = tree.places(id).start;
            for &parameter in solve.map_or(&[][..], |s| &rules[rule].solves[s].of) {
                system.component[first + parameter] = system.places.len() as u32;
                system.places.push((first + parameter) as u32);
                y.push(tree.values()[first + parameter]);
            }
        }
        let mut first_rate = 0;
        for Joining { id, rule, context, solve, switches } in modules {
            let first_source = system.sources.len();
            for module in std::iter::once(&id).chain(context) {
                for place in tree.places(*module) {
                    system.sources.push(match system.component[place] {
                        NONE => Source::Fixed(tree.values()[place]),
                        component => Source::State(component),
                    });
                }
            }
            let first_switch = system.switches.len();
            system.switches.extend(switches.iter().map(|&on| f64::from(u8::from(on))));
            system.members.push(Member {
                id,
                rule,
                solve,
                first_source,
                sources: system.sources.len() - first_source,
                first_switch,
                switches: switches.len(),
                first_rate,
                age: start.since(tree.birth(id)),
                birth: tree.birth(id),
            });
            first_rate += solve.map_or(0, |s| rules[rule].solves[s].of.len());
        }
        system
    }

    /// Moves time 0 of `tau`.
    pub fn advance(&mut self, tree: &Tree, start: Instant) {
        self.start = start;
        for member in &mut self.members {
            member.age = start.since(tree.birth(member.id));
        }
    }

    pub fn sources(&self, member: &Member) -> &[Source] {
        &self.sources[member.first_source..member.first_source + member.sources]
    }

    pub fn switches(&self, member: &Member) -> &[f64] {
        &self.switches[member.first_switch..member.first_switch + member.switches]
    }

    /// The module, and its parameter, that a component of the state vector belongs to.
    pub fn owner(&self, rules: &[Rule], component: usize) -> Option<(&Member, usize)> {
        self.members.iter().find_map(|member| {
            let of = &rules[member.rule].solves[member.solve?].of;
            let index = component.checked_sub(member.first_rate)?;
            Some((member, *of.get(index)?))
        })
    }

    /// The variables of a member's rule, from the state vector `y` at `tau`.
    pub fn variables<T: Value>(
        &self,
        member: &Member,
        tau: f64,
        state: impl Fn(usize) -> T,
        time: impl Fn(f64) -> T,
        out: &mut Vec<T>,
    ) {
        out.clear();
        for source in self.sources(member) {
            out.push(match *source {
                Source::Fixed(x) => T::constant(x),
                Source::State(component) => state(component as usize),
            });
        }
        out.push(time(self.start.to_f64() + tau));
        out.push(time(member.age + tau));
        out.extend(self.switches(member).iter().map(|&s| T::constant(s)));
    }

    /// The variables of a member's rule with their rates of change.
    pub fn moving_variables(
        &self,
        member: &Member,
        tau: f64,
        y: &[f64],
        rates: &[f64],
        out: &mut Vec<Dual<f64>>,
    ) {
        self.variables(
            member,
            tau,
            |i| Dual { value: y[i], rate: rates[i] },
            |t| Dual { value: t, rate: 1.0 },
            out,
        );
    }

    /// Borrows the system for evaluating its equations.
    pub fn equations<'s>(&'s self, rules: &'s [Rule]) -> Equations<'s> {
        Equations { system: self, rules, variables: Vec::new(), scratch: Vec::new() }
    }

    /// Component of the state vector at a place of the tree's values.
    pub fn component(&self, place: usize) -> Option<usize> {
        match self.component.get(place) {
            Some(&NONE) | None => None,
            Some(&component) => Some(component as usize),
        }
    }
}

/// The right-hand side of a [`System`].
pub struct Equations<'s> {
    system: &'s System,
    rules: &'s [Rule],
    variables: Vec<f64>,
    scratch: Scratch<f64>,
}

impl Rates for Equations<'_> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        for member in &self.system.members {
            let Some(solve) = member.solve else { continue };
            let program = &self.rules[member.rule].solves[solve].rates;
            if program.outputs() == 0 {
                continue;
            }
            self.system.variables(member, tau, |i| y[i], |t| t, &mut self.variables);
            let first = member.first_rate;
            program.eval(&self.variables, &mut self.scratch, &mut out[first..first + program.outputs()]);
        }
    }
}
