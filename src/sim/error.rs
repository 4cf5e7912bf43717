//! What can go wrong while a model runs.

use crate::diagnostic::{Diagnostic, Span};
use crate::structure::Lineage;

/// A module in trouble: what an error message says of it.
#[derive(Clone, Debug)]
pub struct Site {
    /// The module with its parameters, as in a string.
    pub module: String,
    pub lineage: Lineage,
    /// The head of its rule.
    pub rule: String,
    /// The place in the text to point at.
    pub span: Span,
    pub time: f64,
}

impl Site {
    /// The time as people read it; the float is in `time`.
    fn when(&self) -> String {
        super::brief(self.time, 12)
    }
}

/// An error of a run. All name the rule, the module with its lineage, and the time.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Error {
    #[error(
        "{} {} its domain at t = {} and no production applies", .site.module,
        if *.born { "is born outside" } else { "left" }, .site.when()
    )]
    OutsideDomain {
        site: Site,
        /// It never was inside.
        born: bool,
        /// The comparisons that fail, with their places and how the production for them would begin.
        failing: Vec<(Span, String)>,
    },
    #[error("the equations of {} push against each other at t = {}", .site.module, .site.when())]
    Chattering { site: Site },
    #[error("productions go on without end at t = {}", .site.when())]
    Cascade { site: Site, rounds: usize },
    #[error("events pile up before t = {}", .site.when())]
    Zeno { site: Site },
    #[error("steps that are {period} apart cannot be told apart at t = {}", .site.when())]
    PeriodTooShort { site: Site, period: f64 },
    #[error("{what} of {} is not finite at t = {}", .site.module, .site.when())]
    NotFinite { site: Site, what: String },
    #[error("the step size fell to nothing at t = {}", .site.when())]
    StepTooSmall { site: Site },
    #[error("more than {limit} modules at t = {}", .site.when())]
    TooManyModules {
        site: Site,
        limit: usize,
        /// Productions that had followed one another at this instant.
        rounds: usize,
    },
}

impl Error {
    pub fn site(&self) -> &Site {
        match self {
            Error::OutsideDomain { site, .. }
            | Error::Chattering { site }
            | Error::Cascade { site, .. }
            | Error::Zeno { site }
            | Error::PeriodTooShort { site, .. }
            | Error::NotFinite { site, .. }
            | Error::StepTooSmall { site }
            | Error::TooManyModules { site, .. } => site,
        }
    }

    /// The message as it is drawn.
    pub fn diagnostic(&self) -> Diagnostic {
        let site = self.site();
        let mut d = Diagnostic::error(self.to_string());
        if site.span != Span::default() {
            d = d.at(site.span, self.remark());
        }
        if let Error::OutsideDomain { failing, .. } = self {
            for (span, _) in failing {
                d = d.at(*span, "this no longer holds");
            }
        }
        let descent = match site.lineage.generation {
            0 => format!("module {} of the initial string", site.lineage),
            n => format!("lineage {}, {n} productions after the initial string", site.lineage),
        };
        d = d.note(format!("{} is {descent}; its rule is {}", site.module, site.rule));
        match self {
            Error::OutsideDomain { failing, .. } => {
                let missing: Vec<String> =
                    failing.iter().map(|(_, begin)| format!("`{begin} produce …`")).collect();
                d.help_opt((!missing.is_empty()).then(|| format!("say what happens there: {}", missing.join(" or "))))
            }
            Error::Chattering { .. } => d.help(
                "let one side hold at the boundary with an equation of its own, for example `dx/dt = 0`",
            ),
            Error::Cascade { rounds, .. } => d
                .note(format!("{rounds} productions followed one another without time going on"))
                .help("a successor that meets the condition again is replaced again at once: change the condition, or the successor's parameters"),
            Error::Zeno { .. } => {
                d.help("each life is shorter than the one before, and all of them end before this time: stop the production below some size")
            }
            Error::PeriodTooShort { .. } => {
                d.help("times have 16 digits: choose a longer `period`, or stop the discrete rules before this time")
            }
            Error::NotFinite { .. } => {
                d.help("look for a division by zero, a root or logarithm of a negative number, an element or an inverse that is not there, or growth without bound")
            }
            Error::StepTooSmall { .. } => d.help(
                "the solution may become infinite here, or the equations jump in a way that no `if` shows; a fixed step (`--method rk4 --step-size H`) shows how it behaves",
            ),
            Error::TooManyModules { rounds, .. } if *rounds > 8 => d
                .note(format!("{rounds} productions followed one another without time going on"))
                .help("a successor that meets the condition again is replaced again at once: change the condition, or the successor's parameters"),
            Error::TooManyModules { limit, .. } => {
                d.help(format!("if this is meant, allow more: `--max-modules {}`", limit.saturating_mul(10)))
            }
        }
    }

    fn remark(&self) -> &'static str {
        match self {
            Error::OutsideDomain { .. } => "no equation of this rule holds any more",
            Error::Chattering { .. } => "on each side of the boundary the equations lead to the other",
            Error::Cascade { .. } => "this production applies again and again",
            Error::Zeno { .. } => "this production comes sooner and sooner",
            Error::PeriodTooShort { .. } => "a discrete rule, which applies at the multiples of the period",
            Error::NotFinite { .. } => "computed here",
            Error::StepTooSmall { .. } => "these equations",
            Error::TooManyModules { .. } => "this production made the last of them",
        }
    }
}
