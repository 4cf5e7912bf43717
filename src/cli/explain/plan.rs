//! The explanation of a model, as data for printing.

use serde::Serialize;

use super::bending::BendingPlan;
use super::curves::CurvePlan;
use super::falling::FallingPlan;
use super::gas;
use super::ground;
use super::scene::{self, ScenePart};
use super::sheet;
use super::{given, words};
use crate::diagnostic::Source;
use crate::model::{
    Class, Condition, DRAWN_WORDS, Kind, Model, Produce, Quantity, Rule, SolutionForm, Solve, ZeroCrossing,
};
use crate::session::Session;

/// The explanation of a model. Field names are those of the JSON.
#[derive(Serialize)]
pub struct Explanation {
    pub model: String,
    pub title: Option<String>,
    pub kinds: Vec<KindPlan>,
    pub rules: Vec<RulePlan>,
    pub curves: Vec<CurvePlan>,
    /// What stands around the plant; empty for a plant alone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scene: Vec<ScenePart>,
    /// The stems that bend, if the model has tissues.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bending: Option<BendingPlan>,
    /// Those of the plants of other models.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bending_of_plants: Vec<BendingPlan>,
    /// What is let go.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub falling: Vec<FallingPlan>,
    pub summary: Summary,
}

#[derive(Serialize)]
pub struct KindPlan {
    pub name: String,
    pub arity: usize,
    pub work: Work,
    pub rules: Vec<usize>,
    pub drawn_only: Vec<String>,
    /// Whether the turtle interprets it.
    #[serde(skip)]
    pub is_drawn: bool,
}

/// How the modules of a kind develop in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Work {
    /// It never changes.
    #[serde(rename = "no rules")]
    NoRules,
    /// Productions, but no equations.
    #[serde(rename = "at rest")]
    AtRest,
    /// Discrete rules only.
    #[serde(rename = "in steps")]
    InSteps,
    /// Never stepped.
    #[serde(rename = "formulas")]
    Formulas,
    #[serde(rename = "alone")]
    Alone,
    #[serde(rename = "coupled")]
    Coupled,
}

#[derive(Serialize)]
pub struct RulePlan {
    pub head: String,
    pub line: usize,
    pub kinds: Vec<String>,
    pub solves: Vec<SolvePlan>,
    pub produces: Vec<ClausePlan>,
    pub conditions: Vec<ConditionPlan>,
}

#[derive(Serialize)]
pub struct ClausePlan {
    pub line: usize,
    /// The condition as written, on one line, with the rate of an event at a rate; empty if there is none.
    pub condition: String,
    /// For a production, its number of successors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub successors: Option<usize>,
}

#[derive(Serialize)]
pub struct SolvePlan {
    #[serde(flatten)]
    pub clause: ClausePlan,
    pub parameters: Vec<ParameterPlan>,
}

#[derive(Serialize)]
pub struct ParameterPlan {
    pub name: String,
    pub class: &'static str,
    /// The form of the solution, if there is a formula.
    pub law: Option<String>,
    pub why: String,
    /// The names that its rate reads: parameters, `t`, `age`.
    pub reads: Vec<String>,
}

#[derive(Serialize)]
pub struct ConditionPlan {
    pub boundary: String,
    pub line: usize,
    pub decides: Vec<Use>,
    pub found: Vec<FoundPlan>,
}

/// A clause that depends on a condition.
#[derive(Clone, PartialEq, Serialize)]
pub struct Use {
    pub clause: &'static str,
    pub line: usize,
}

#[derive(Serialize)]
pub struct FoundPlan {
    /// Line of the active `solve`.
    pub line: Option<usize>,
    pub class: &'static str,
    pub why: String,
}

#[derive(Default, Serialize)]
pub struct Summary {
    pub formulas: Vec<String>,
    pub alone: Vec<String>,
    pub coupled: Vec<String>,
    pub at_rest: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub in_steps: Vec<String>,
    pub no_rules: Vec<String>,
    pub closed_form: bool,
}

/// Input of the explanation.
pub struct Facts<'m> {
    pub model: &'m Model,
    source: &'m Source,
    /// For each kind.
    work: Vec<Work>,
}

impl Explanation {
    pub fn new(session: &Session) -> Explanation {
        let model = &session.model;
        let facts = Facts { model, source: &session.source, work: works(model) };
        let mut summary = Summary { closed_form: model.is_closed_form(), ..Summary::default() };
        let mut kinds = Vec::new();
        for (id, kind) in model.kinds.iter().filter(|(id, _)| !id.is_bracket()) {
            let work = facts.work[id.index()];
            let names = parameter_names(model, kind);
            let drawn = model.drawn_only.get(id.index()).map_or(&[][..], Vec::as_slice);
            let drawn_only = names.into_iter().zip(drawn).filter(|(_, only)| **only).map(|(name, _)| name);
            let list = match work {
                Work::NoRules => &mut summary.no_rules,
                Work::AtRest => &mut summary.at_rest,
                Work::InSteps => &mut summary.in_steps,
                Work::Formulas => &mut summary.formulas,
                Work::Alone => &mut summary.alone,
                Work::Coupled => &mut summary.coupled,
            };
            if !list.contains(&kind.name) {
                list.push(kind.name.clone());
            }
            let named = kind.class() != Class::Word || DRAWN_WORDS.contains(&kind.base());
            kinds.push(KindPlan {
                is_drawn: kind.interpretation.is_some() || named,
                name: kind.name.clone(),
                arity: kind.arity,
                work,
                rules: kind.all_rules().collect(),
                // A kind without equations has nothing to evaluate.
                drawn_only: if kind.rules.is_empty() { Vec::new() } else { drawn_only.collect() },
            });
        }
        let (mut scene, bending) = (scene::parts(model), BendingPlan::new(model));
        let bending_of_plants = BendingPlan::of_plants(model);
        scene.extend(bending.iter().chain(&bending_of_plants).map(|bending| bending.part.clone()));
        let falling = FallingPlan::all(model);
        scene.extend(falling.iter().map(|falling| falling.row.clone()));
        scene.extend(gas::parts(model));
        scene.extend(ground::part(model));
        scene.extend(sheet::parts(model));
        Explanation {
            model: session.source.name.clone(),
            title: model.title.clone(),
            kinds,
            rules: (0..model.rules.len()).map(|rule| facts.rule(rule)).collect(),
            curves: model.curves.iter().map(|curve| CurvePlan::new(curve)).collect(),
            scene,
            bending,
            bending_of_plants,
            falling,
            summary,
        }
    }
}

/// Names of a kind's parameters in its first rule.
fn parameter_names(model: &Model, kind: &Kind) -> Vec<String> {
    kind.rules.first().map_or_else(Vec::new, |rule| model.rules[*rule].parameters[..kind.arity].to_vec())
}

/// True if some equation for a parameter of a kind is integrated numerically, or solved for along with those.
fn is_numeric(model: &Model, kind: &Kind, parameter: Option<usize>) -> bool {
    let is_meant = |p: usize| parameter.is_none_or(|wanted| wanted == p);
    kind.rules.iter().flat_map(|rule| &model.rules[*rule].solves).any(|solve| {
        let mut forms = solve.of.iter().zip(&solve.solution_forms);
        let mut given = solve.algebraic.of.iter().enumerate();
        forms.any(|(p, law)| is_meant(*p) && !law.is_closed())
            || given.any(|(place, p)| is_meant(*p) && solve.algebraic.is_solved(place, false))
    })
}

/// The work of each kind. A rule that reads what changes of its neighbours shares a clock with them as soon as it or
/// one of them is integrated numerically; this is the simulation's own criterion.
fn works(model: &Model) -> Vec<Work> {
    let numeric: Vec<bool> = model.kinds.iter().map(|(_, kind)| is_numeric(model, kind, None)).collect();
    let mut works: Vec<Work> = (model.kinds.iter())
        .map(|(id, kind)| {
            let mut solves = kind.rules.iter().flat_map(|rule| &model.rules[*rule].solves);
            match () {
                () if kind.has_no_rules() => Work::NoRules,
                () if kind.rules.is_empty() => Work::InSteps,
                () if numeric[id.index()] => Work::Alone,
                () if solves.all(|solve| solve.of.is_empty() && solve.algebraic.is_empty()) => Work::AtRest,
                () => Work::Formulas,
            }
        })
        .collect();
    for (id, kind) in model.kinds.iter() {
        for rule in kind.rules.iter().map(|rule| &model.rules[*rule]).filter(|rule| rule.reads_context) {
            let patterns = rule.aggregates.iter().map(|aggregate| &aggregate.pattern);
            let neighbours: Vec<usize> = (rule.left.iter().chain(&rule.right).chain(patterns))
                .flat_map(|pattern| &pattern.kinds)
                .map(|kind| kind.index())
                .filter(|kind| numeric[*kind])
                .collect();
            if numeric[id.index()] || !neighbours.is_empty() {
                works[id.index()] = Work::Coupled;
            }
            for neighbour in neighbours {
                works[neighbour] = Work::Coupled;
            }
        }
    }
    works
}

impl Facts<'_> {
    pub fn line(&self, byte: u32) -> usize {
        self.source.position(byte).0
    }

    fn rule(&self, index: usize) -> RulePlan {
        let rule = &self.model.rules[index];
        let kinds = self.model.kinds.iter().filter(|(_, kind)| kind.all_rules().any(|rule| rule == index));
        let clause = |guard: &Condition, span: crate::diagnostic::Span| ClausePlan {
            line: self.line(span.start),
            condition: match guard.is_always() {
                true => String::new(),
                false if rule.discrete => self.discrete_guard(rule),
                false => self.guard(span),
            },
            successors: None,
        };
        let production = |p: &Produce| ClausePlan {
            successors: p.outcome.weights.is_some().then_some(p.outcome.successors.len()),
            ..clause(&p.guard, p.span)
        };
        let real = rule.produces.iter().filter(|p| !p.is_fault);
        RulePlan {
            head: rule.label.clone(),
            line: self.line(rule.span.start),
            kinds: kinds.map(|(_, kind)| kind.name.clone()).collect(),
            solves: (rule.solves.iter())
                .map(|solve| SolvePlan {
                    clause: clause(&solve.guard, solve.span),
                    parameters: self.parameters(index, solve),
                })
                .collect(),
            produces: real.map(production).collect(),
            conditions: (0..rule.atoms.len()).map(|atom| self.condition(rule, atom)).collect(),
        }
    }

    /// The condition of a discrete rule as written, on one line: it stands between the first colon and the arrow.
    fn discrete_guard(&self, rule: &Rule) -> String {
        let text = self.source.slice(rule.span);
        let (_, behind) = text.split_once(':').unwrap_or_default();
        let before = behind.find("->").map_or(behind, |arrow| behind[..arrow].trim_end_matches('-'));
        before.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// The condition of a clause as written, on one line.
    fn guard(&self, clause: crate::diagnostic::Span) -> String {
        let lines = self.source.slice(clause).lines().map(|line| line.split('#').next().unwrap_or(""));
        let text = lines.collect::<Vec<_>>().join(" ");
        let in_word = |c: char| c.is_alphanumeric() || c == '_';
        let action = |word: &'static str| {
            let alone =
                |at: usize| !text[..at].ends_with(in_word) && !text[at + word.len()..].starts_with(in_word);
            text.match_indices(word).map(|(at, _)| at).find(|at| alone(*at))
        };
        let end = ["solve", "produce"].into_iter().filter_map(action).min();
        let before = text[..end.unwrap_or(text.len())].trim();
        let words: Vec<&str> = before.strip_prefix("if").unwrap_or(before).split_whitespace().collect();
        words.join(" ")
    }

    /// How each parameter moves under a clause.
    fn parameters(&self, rule: usize, solve: &Solve) -> Vec<ParameterPlan> {
        let model = self.model;
        let compiled = &model.rules[rule];
        let mut kinds = model.kinds.iter().filter(|(_, kind)| kind.rules.contains(&rule));
        let coupled = kinds.any(|(id, _)| self.work[id.index()] == Work::Coupled);
        let shown = compiled.parameters.len() - compiled.hidden;
        let inputs = self.inputs(rule);
        let input =
            |v: usize| inputs.iter().find(|(_, parameter)| *parameter == v).map(|(quantity, _)| *quantity);
        let is_named = |v: usize| v < shown || self.clock(compiled, v).is_some() || input(v).is_some();
        (0..compiled.parameters.len())
            .filter(|v| is_named(*v))
            .map(|parameter| {
                let name = self.name(compiled, parameter).unwrap_or_default();
                if let Some(quantity) = input(parameter) {
                    let (why, law) = match quantity {
                        Quantity::Force(_) => (
                            "follows from what sheets and soil do to the solid, at the ticks of their grid of time",
                            "linear from tick to tick",
                        ),
                        Quantity::Strain => (
                            "follows from the bending of the stem, at the ticks of its grid of time",
                            "linear from tick to tick",
                        ),
                        Quantity::Ground => (
                            "stands for the heights of the soil, which are others after each tick at which it moves",
                            "constant from tick to tick",
                        ),
                    };
                    let law = Some(law.to_owned());
                    return ParameterPlan {
                        name,
                        class: "given",
                        law,
                        why: why.to_owned(),
                        reads: Vec::new(),
                    };
                }
                if let Some(place) = solve.algebraic.of.iter().position(|p| *p == parameter) {
                    return given::parameter(self, compiled, solve, place);
                }
                let Some(position) = solve.of.iter().position(|p| *p == parameter) else {
                    let why = "its rate here is 0".to_owned();
                    return ParameterPlan { name, class: "constant", law: None, why, reads: Vec::new() };
                };
                let law = &solve.solution_forms[position];
                let class = match law {
                    SolutionForm::Numeric(numeric) if coupled && numeric.linear => "coupled and linear",
                    SolutionForm::Numeric(_) if coupled => "coupled",
                    SolutionForm::Numeric(_) => "local",
                    _ => "closed form",
                };
                let reads = solve.rates.output_reads(position);
                let reads = reads.into_iter().filter_map(|v| self.name(compiled, v)).collect();
                let (law, why) = words::law(self, compiled, solve, position, coupled);
                ParameterPlan { name, class, law, why, reads }
            })
            .collect()
    }

    /// The clauses that depend on an atom, and how its instant is located.
    fn condition(&self, rule: &Rule, atom: usize) -> ConditionPlan {
        let mentions = |condition: &Condition| condition.atoms().any(|(a, _)| a == atom);
        let mut decides = Vec::new();
        for solve in &rule.solves {
            let line = self.line(solve.span.start);
            if mentions(&solve.guard) {
                decides.push(Use { clause: "solve", line });
            }
            if solve.switches.iter().any(|switch| mentions(&switch.condition)) {
                decides.push(Use { clause: "if in the equations", line });
            }
        }
        let produces = rule.produces.iter().filter(|p| mentions(&p.guard) && !p.is_fault);
        decides.extend(produces.map(|p| Use { clause: "produce", line: self.line(p.span.start) }));
        let found = |solve: Option<usize>| {
            let (class, why) = self.watch(rule, solve, atom);
            FoundPlan { line: solve.map(|s| self.line(rule.solves[s].span.start)), class, why }
        };
        // With clauses, a module without an active one is an error.
        let found = match rule.solves.len() {
            0 => vec![found(None)],
            n => (0..n).map(|solve| found(Some(solve))).collect(),
        };
        let line = self.line(rule.atoms[atom].start);
        let mut boundary = rule.boundaries[atom].to_string();
        let sides = [2 * atom, 2 * atom + 1].map(|side| rule.sides.output_reads(side)).concat();
        if let Some(clock) = sides.into_iter().find_map(|v| self.clock(rule, v)) {
            boundary = format!("{clock} = 0");
        }
        ConditionPlan { boundary, line, decides, found }
    }

    /// The numbers of what the surroundings give among the parameters of a rule.
    fn inputs(&self, rule: usize) -> Vec<(Quantity, usize)> {
        let mut kinds = self.model.kinds.iter().filter(|(_, kind)| kind.rules.contains(&rule));
        kinds.next().map_or_else(Vec::new, |(_, kind)| kind.read_inputs().collect())
    }

    /// The name of a variable of a rule; None for truth values.
    fn name(&self, rule: &Rule, variable: usize) -> Option<String> {
        self.clock(rule, variable).or_else(|| words::variable(rule, variable))
    }

    /// The name of the clock of an event at a rate, if a variable is one.
    fn clock(&self, rule: &Rule, variable: usize) -> Option<String> {
        let clock = rule.clocks.iter().find(|clock| clock.parameter == variable)?;
        Some(format!("clock of line {}", self.line(rule.produces[clock.produce].span.start)))
    }

    fn watch(&self, rule: &Rule, solve: Option<usize>, atom: usize) -> (&'static str, String) {
        if rule.discrete {
            return (
                "judged at each step",
                "discrete rules apply at whole multiples of the period".to_owned(),
            );
        }
        let watch = &rule.zero_crossings(solve)[atom];
        let solve = solve.map(|s| &rule.solves[s]);
        if matches!(watch, ZeroCrossing::Constant) {
            return ("nothing to find", "nothing in it changes from one event to the next".to_owned());
        }
        if solve.is_some_and(|s| s.unreachable[atom]) {
            return ("never met", "the equations approach it and never arrive".to_owned());
        }
        if let ZeroCrossing::Formula { variable, .. } = watch
            && self.clock(rule, *variable).is_some()
        {
            return (
                "closed-form time",
                "a formula tells when the integral of the rate is what was drawn".to_owned(),
            );
        }
        if let ZeroCrossing::Formula { variable, level } = watch {
            return ("closed-form time", words::crossing(rule, *variable, level));
        }
        let mut reads = rule.sides.output_reads(2 * atom);
        reads.extend(rule.sides.output_reads(2 * atom + 1));
        let integrated = reads.iter().filter(|v| self.is_integrated(rule, solve, **v));
        let mut integrated: Vec<String> = integrated.filter_map(|v| self.name(rule, *v)).collect();
        integrated.dedup();
        if integrated.is_empty() {
            (
                "root on a closed form",
                "everything in it follows a formula; the first root is searched".to_owned(),
            )
        } else {
            let verb = if integrated.len() == 1 { "is" } else { "are" };
            let is_given = |v: &usize| solve.is_some_and(|s| s.algebraic.of.contains(v));
            let how = if reads.iter().any(is_given) { "computed step by step" } else { "integrated" };
            let why = format!("{} {verb} {how}; the root is searched in each step", words::list(&integrated));
            ("root on dense output", why)
        }
    }

    /// True if a variable of a rule is, or may be, integrated numerically.
    pub fn is_integrated(&self, rule: &Rule, solve: Option<&Solve>, variable: usize) -> bool {
        if variable < rule.parameters.len() {
            let Some(solve) = solve else { return false };
            let by_law = solve
                .of
                .iter()
                .position(|p| *p == variable)
                .is_some_and(|i| !solve.solution_forms[i].is_closed());
            let given = solve.algebraic.of.iter().position(|p| *p == variable);
            return by_law || given.is_some_and(|place| !solve.algebraic.closed[place]);
        }
        if let Some(aggregate) =
            variable.checked_sub(rule.first_aggregate).and_then(|i| rule.aggregates.get(i))
        {
            let of_child = |v: usize| v.checked_sub(rule.variables);
            let read = aggregate.term.reads().iter().copied().filter_map(of_child);
            let kinds = || aggregate.pattern.kinds.iter().map(|kind| self.model.kinds.get(*kind));
            return { read }.any(|p| kinds().any(|kind| is_numeric(self.model, kind, Some(p))));
        }
        let mut first = rule.parameters.len();
        for pattern in rule.left.iter().chain(&rule.right) {
            if variable < first + pattern.width {
                let kinds = pattern.kinds.iter().map(|kind| self.model.kinds.get(*kind));
                return { kinds }.any(|kind| is_numeric(self.model, kind, Some(variable - first)));
            }
            first += pattern.width;
        }
        false
    }
}
