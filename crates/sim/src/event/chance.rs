//! The modules of a successor and their parameters, with the random choices of a production: its successor, the random
//! parameters, and how long the clocks of its modules run.
//!
//! All ways to take an event (materialised, lazy, and the beginning of a run) use this file, so they agree. A number that is
//! drawn belongs to the lineage of the module that it is drawn for ([`Seed`]), never to the order of events.

use smallvec::SmallVec;

use crate::error::{Error, Site};
use crate::scratch::Scratch;
use crate::world::new_modules::NewModules;
use dlsys_diagnostic::Span;
use dlsys_expr::Scratch as Registers;
use dlsys_model::{BadBounds, Distribution, Outcome, Produce, Stretch, Successor, choose};
use dlsys_tree::{Family, Lineage, Purpose, Seed};

/// The reason why a successor has no parameters.
#[derive(Clone, Debug)]
pub enum Undrawn {
    /// A distribution has parameters that it cannot have.
    Draw {
        span: Span,
        distribution: Distribution,
        why: String,
    },
    Weights {
        why: String,
    },
    /// The bounds of a repetition are none.
    Bounds(BadBounds),
    /// An argument is no finite number.
    NotFinite,
}

impl From<BadBounds> for Undrawn {
    fn from(bad: BadBounds) -> Undrawn {
        Undrawn::Bounds(bad)
    }
}

impl Undrawn {
    pub fn error(self, site: Site) -> Error {
        match self {
            Undrawn::Draw { span, distribution, why } => {
                Error::BadDraw { site: Site { span, ..site }, distribution, why: why.into() }
            }
            Undrawn::Weights { why } => Error::BadWeights { site, why },
            Undrawn::Bounds(BadBounds { span, why }) => Error::BadBounds { site: Site { span, ..site }, why },
            Undrawn::NotFinite => Error::NotFinite { site, what: "a parameter of the successor".to_owned() },
        }
    }
}

/// Chooses the successor of a module and appends its modules to `out`; returns its number and the lineage of the new
/// modules. The variables in `scratch` are those of the rule.
pub fn successor(
    seed: Seed,
    clause: &Produce,
    lineage: Lineage,
    scratch: &mut Scratch,
    out: &mut NewModules,
) -> Result<(usize, Family), Undrawn> {
    let Scratch { variables, registers, .. } = scratch;
    let which = decide(seed, &clause.outcome, clause.key, lineage, variables, registers)?;
    let family = lineage.family(Outcome::production(clause.key, which));
    modules(seed, &clause.outcome.successors[which], family, variables, registers, out)?;
    Ok((which, family))
}

/// The number of the successor that takes the place of a module.
fn decide(
    seed: Seed,
    outcome: &Outcome,
    key: u64,
    lineage: Lineage,
    variables: &[f64],
    scratch: &mut Registers<f64>,
) -> Result<usize, Undrawn> {
    let Some(program) = &outcome.weights else { return Ok(0) };
    let mut weights: SmallVec<[f64; 8]> = smallvec::smallvec![0.0; program.outputs()];
    program.eval(variables, scratch, &mut weights);
    let u = seed.unit(lineage, Purpose::Choice(key));
    choose(&weights, u).map_err(|why| Undrawn::Weights { why })
}

/// Appends the modules of a successor to `out`, with all their parameters. `variables` are those of the rule.
pub fn modules(
    seed: Seed,
    successor: &Successor,
    family: Family,
    variables: &mut Vec<f64>,
    registers: &mut Registers<f64>,
    out: &mut NewModules,
) -> Result<(), Undrawn> {
    if let Successor::Plain(stretch) = successor {
        return arguments(seed, stretch, (family, 0), variables, registers, &mut out.arguments);
    }
    // Modules of the stretches before: draws and clocks belong to a module by its place in the whole successor.
    let mut place = 0;
    successor.expand(variables, registers, &mut |stretch, variables, registers| {
        let known = variables.len();
        arguments(seed, stretch, (family, place), variables, registers, &mut out.arguments)?;
        variables.truncate(known);
        out.kinds.extend_from_slice(&stretch.kinds);
        place += stretch.kinds.iter().filter(|kind| !kind.is_bracket()).count();
        Ok(())
    })
}

/// Appends the values of all parameters of a stretch, hidden ones included, to `out`; `before` is the number of modules before
/// it in its successor. `variables` are those of the rule and the indices of repetitions; draws are put behind them.
fn arguments(
    seed: Seed,
    stretch: &Stretch,
    (family, before): (Family, usize),
    variables: &mut Vec<f64>,
    scratch: &mut Registers<f64>,
    out: &mut Vec<f64>,
) -> Result<(), Undrawn> {
    for draw in &stretch.draws {
        let mut parameters: SmallVec<[f64; 4]> = smallvec::smallvec![0.0; draw.parameters.outputs()];
        draw.parameters.eval(variables, scratch, &mut parameters);
        if !draw.conditional
            && let Some(why) = draw.distribution.fault(&parameters)
        {
            return Err(Undrawn::Draw { span: draw.span, distribution: draw.distribution, why });
        }
        let u = seed.unit_of_child(family, before + draw.place, Purpose::Parameter(draw.number));
        variables.push(draw.distribution.quantile(&parameters, u));
    }
    let first = out.len();
    stretch.evaluate(variables, scratch, out);
    if out[first..].iter().any(|x| !x.is_finite()) {
        return Err(why_not_finite(stretch, variables, scratch));
    }
    if !stretch.clocks.is_empty() {
        let written: SmallVec<[f64; 32]> = SmallVec::from_slice(&out[first..]);
        out.truncate(first);
        let mut copied = 0;
        for clock in &stretch.clocks {
            out.extend_from_slice(&written[copied..clock.after]);
            copied = clock.after;
            out.push(seed.endurance(family.child(before + clock.place), clock.key));
        }
        out.extend_from_slice(&written[copied..]);
    }
    Ok(())
}

/// A draw with wrong parameters, if there is one that was let pass.
fn why_not_finite(stretch: &Stretch, variables: &[f64], scratch: &mut Registers<f64>) -> Undrawn {
    for draw in &stretch.draws {
        let mut parameters: SmallVec<[f64; 4]> = smallvec::smallvec![0.0; draw.parameters.outputs()];
        draw.parameters.eval(variables, scratch, &mut parameters);
        if let Some(why) = draw.distribution.fault(&parameters) {
            return Undrawn::Draw { span: draw.span, distribution: draw.distribution, why };
        }
    }
    Undrawn::NotFinite
}
