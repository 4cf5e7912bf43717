//! Modules whose equations read one another, and their common step.
//!
//! Only those modules are coupled that read an integrated parameter of a neighbour; a neighbour with a closed form is an
//! input. All of them are integrated together over a common step ([`step`]). An event of one of them within the step is
//! answered by a local re-integration ([`reintegration`]), or ends the step for all.
//!
//! ```text
//! couple ─▶ which modules are coupled ─▶ reintegration   the modules around an event, to the end of the common step
//!                                     └▶ restart ─▶ step  a new common step ─▶ detect ─▶ schedule
//!                                        step ─▶ repair   stiff members that the step does not resolve
//! algebra ─▶ newton ─▶ matrix, meeting (where solutions meet) ─▶ blend
//! system ─▶ rows (table of equations) ─▶ algebra, lanes, aggregates ─▶ equations (right-hand side) ─▶ integrator
//! columns ─▶ the equations of explicit steps without a table, sections ─▶ of several threads
//! linear ─▶ exponentials of matrices in place of steps, taylor ─▶ polynomials in place of stages, for reintegration
//! ```

pub mod aggregates;
pub mod algebra;
pub mod blend;
pub mod columns;
pub mod couple;
pub mod equations;
pub mod lanes;
pub mod linear;
mod matrix;
mod meeting;
mod newton;
mod polynomial_step;
pub mod reintegration;
mod repair;
mod restart;
pub mod rows;
mod search;
mod sections;
mod sift;
mod step;
pub mod system;
mod taylor;
mod traffic;

use crate::flow::coupled::couple::Affected;
use crate::flow::coupled::linear::Linear;
use crate::flow::coupled::reintegration::Reintegration;
use crate::flow::coupled::system::System;
use crate::flow::coupled::traffic::Traffic;
use crate::flow::integrator::Integrator;
use crate::world::state::Control;
use dlsys_tree::{ModuleId, SimTime};

/// The coupled modules and their common step.
#[derive(Clone, Default)]
pub struct Coupled {
    /// The modules of the common step in string order, then those that have joined since; some may be dead.
    pub members: Vec<ModuleId>,
    /// The equations of the common step.
    pub system: System,
    /// The components at the start of the common step.
    y: Vec<f64>,
    /// Makes the common steps.
    pub integrator: Integrator,
    /// The experience of its step control.
    pub control: Control,
    /// The equations as a linear system, if they are solved without steps.
    pub linear: Option<Linear>,
    /// A step has been made whose dense output has not been computed yet.
    pending: bool,
    /// Re-integrations have changed the members or their trajectories since the common step was made.
    pub reintegrated: bool,
    /// Modules whose parameters are no longer read by a neighbour that has died.
    pub loosened: Vec<ModuleId>,
    /// Local re-integrations within the common step.
    pub reintegration: Reintegration,
    /// The modules that the last instant has affected.
    pub affected: Affected,
    /// A solution without steps has been tried since the common trajectory was last restarted.
    tried: bool,
    /// The number of times that an event has cut a trajectory without steps.
    pub cuts: u32,
    /// An earlier time, to detect steps that hardly advance time.
    pub mark: SimTime,
    /// The number of common steps since `mark`.
    pub since_mark: usize,
    /// Members whose rates may have pulses.
    pulsing: Vec<ModuleId>,
    /// How far the last polynomials of linear equations for all members led; 0 if none were tried.
    reach: f64,
    /// How often events cut the trajectories of members.
    traffic: Traffic,
}

impl Coupled {
    /// Evaluations of the equations of one module so far.
    pub fn evaluations(&self) -> u64 {
        self.integrator.evaluations() + self.reintegration.evaluations()
    }
}
