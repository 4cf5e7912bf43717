//! The equations of many modules in sections, one for each thread.
//!
//! A section has the equations of some members one after another, as columns, with numbers of its own for its components: those of its members, then
//! the foreign ones that their rates read. So a thread works in memory of its own ([`dlsys_ode::Part`]), and what it needs of the others is a short
//! list. Which rows stand side by side in a chunk depends on where sections begin; the rates do not.

use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::system::{Membership, System};
use crate::world::World;
use crate::world::trajectories::Law;
use dlsys_model::Rule;
use dlsys_ode::{Part, Rates};
use dlsys_tree::ModuleId;
use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::Range;

/// Sections begin where a whole line of the processor's cache does, if such a component is found among so many members.
const LINE: usize = 8;
const LOOKED_AT: usize = 64;

/// The equations of some members, one after another.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The equations, as columns, of components with numbers of their own.
    system: System,
    components: Range<usize>,
    /// The components of other sections that are read. Their numbers follow those of the components.
    foreign: Vec<u32>,
}

/// The members and components of a section.
type Stretch = (Range<usize>, Range<usize>);

impl System {
    /// Adds to no equations those of all coupled modules, with `components` components, as columns only, in as many sections as threads
    /// shall evaluate them; see [`System::gather`].
    pub fn gather_all(
        &mut self,
        rules: &[Rule],
        modules: &Membership,
        components: usize,
        threads: usize,
    ) -> bool {
        if threads < 2 {
            self.sections.clear();
            return self.gather(rules, modules, components, Some);
        }
        let stretches = stretches(rules, modules, components, threads);
        let mut memory = std::mem::take(&mut self.sections);
        memory.resize_with(stretches.len(), Section::default);
        let jobs = memory.into_iter().zip(stretches).collect();
        let made = dlsys_threads::in_order(threads, jobs, |(section, stretch): (Section, Stretch)| {
            section.gather(rules, modules, stretch)
        });
        let Some(sections) = made.into_iter().collect::<Option<Vec<Section>>>() else { return false };
        self.is_bare = true;
        self.modules = sections.iter().map(|section| section.system.modules).sum();
        self.table.timed = sections.iter().any(|section| section.system.table.timed);
        self.table.aged = sections.iter().any(|section| section.system.table.aged);
        self.sections = sections;
        true
    }
}

/// About equal parts of the members, with their components.
fn stretches(rules: &[Rule], modules: &Membership, components: usize, count: usize) -> Vec<Stretch> {
    let members = modules.members;
    let mut cuts = vec![(0, 0)];
    for number in 1..count {
        let about = number * members.len() / count;
        let near = about..(about + LOOKED_AT).min(members.len());
        let mut found = near.filter_map(|at| Some((at, first_component(rules, modules.world, members[at])?)));
        let first = found.next();
        let aligned = first.into_iter().chain(found).find(|(_, component)| component % LINE == 0);
        cuts.extend(aligned.or(first).filter(|cut| cuts.last().is_some_and(|last| last.0 < cut.0)));
    }
    cuts.push((members.len(), components));
    cuts.windows(2).map(|ends| (ends[0].0..ends[1].0, ends[0].1..ends[1].1)).collect()
}

/// The first component of a member, if it has any.
fn first_component(rules: &[Rule], world: &World, id: ModuleId) -> Option<usize> {
    let state = world.state(id)?;
    let clause = &rules[state.rule.get()?].solves[state.solve.get()?];
    let first = *clause.stepping.components(state.numeric_only).first()?;
    match state.trajectories.get(first) {
        Some(Law::Coupled(component)) => Some(component as usize),
        _ => None,
    }
}

impl Section {
    /// The section with the equations of some members; None if columns are not enough.
    fn gather(mut self, rules: &[Rule], modules: &Membership, stretch: Stretch) -> Option<Section> {
        let (members, components) = stretch;
        self.system.clear(modules.start);
        self.foreign.clear();
        let (first, own) = (components.start as u32, components.len() as u32);
        let foreign = RefCell::new((HashMap::new(), self.foreign));
        let number = |component: u32| {
            if components.contains(&(component as usize)) {
                return Some(component - first);
            }
            let (numbers, foreign) = &mut *foreign.borrow_mut();
            let number = numbers.entry(component).or_insert_with(|| {
                foreign.push(component);
                foreign.len() as u32 - 1
            });
            Some(own + *number)
        };
        let modules = Membership { members: &modules.members[members], ..*modules };
        // Nothing is an input, whose number would follow that of the last component.
        let is_enough = self.system.gather(rules, &modules, u32::MAX as usize, number);
        let (_, foreign) = foreign.into_inner();
        is_enough.then_some(Section { system: self.system, components, foreign })
    }

    /// Moves the start of the step, from which time is counted.
    pub fn advance(&mut self, start: dlsys_tree::SimTime) {
        self.system.advance(start);
    }
}

/// A section as a thread evaluates it.
struct SectionRates<'s> {
    section: &'s Section,
    equations: Equations<'s>,
}

impl Part for SectionRates<'_> {
    fn components(&self) -> Range<usize> {
        self.section.components.clone()
    }

    fn foreign(&self) -> &[u32] {
        &self.section.foreign
    }

    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.equations.rates(tau, y, out);
    }
}

/// The sections of a system, to be evaluated side by side.
pub fn parts<'s>(system: &'s System, rules: &'s [Rule]) -> Vec<Box<dyn Part + 's>> {
    let rates = |section: &'s Section| SectionRates {
        section,
        equations: Equations::new(&section.system, rules, None),
    };
    system.sections.iter().map(|section| Box::new(rates(section)) as Box<dyn Part>).collect()
}

/// Evaluates the rates of all sections at a state, and writes them to `out`.
pub fn rates(system: &System, rules: &[Rule], tau: f64, y: &[f64], out: &mut [f64]) {
    let mut out = out;
    let jobs: Vec<_> = parts(system, rules)
        .into_iter()
        .filter_map(|part| {
            let rates = out.split_off_mut(..part.components().len())?;
            Some((part, rates))
        })
        .collect();
    dlsys_threads::in_order(jobs.len(), jobs, |(mut part, rates)| {
        let mut state = y[part.components()].to_vec();
        state.extend(part.foreign().iter().map(|component| y[*component as usize]));
        part.rates(tau, &state, rates);
    });
}
