//! The process without time: see [`untimed`].

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Change, Condition, FactId, SnapAction};
use elbowroom_model::{State, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, PartialOrderPlan};
use elbowroom_probability::optimum::{DeadEnds, Horizon, Perturbed, Settings, TabulationError};
use elbowroom_probability::{Likelihoods, Model, Semantics, all_actions_under};

use super::formula::{Formula, choice, exact};
use super::{PrismError, bare, checked, dead_ends};
use crate::names::distinct;

/// Maximum number of states in the search for dead ends.
const MAX_STATES: usize = 1 << 18;

/// Returns the Markov decision process of [`optimum`](elbowroom_probability::optimum) in the
/// language of PRISM. Its `Pmax=? [F "goal"]` is the best probability of reaching the goal.
///
/// # Errors
/// When the problem has time or numbers, when likelihoods are missing, when the settings limit the
/// number of steps, and when there are too many states to find the dead ends.
pub fn untimed(
    task: &Task,
    likelihoods: &Likelihoods,
    settings: &Settings,
) -> Result<String, PrismError> {
    if settings.horizon != Horizon::Unlimited {
        return Err(PrismError::Horizon);
    }
    // Facts are added to the table of this task when they are first used.
    let task = Arc::new(task.clone());
    let plan = PartialOrderPlan::unordered(&task, all_actions_under(&task, likelihoods)?);
    let model = Model::new(Arc::clone(&task), plan, likelihoods, Semantics::World)?;
    let process = Process::new(model, likelihoods, settings)?;
    checked(process.text()?)
}

/// A problem, with names for its facts and actions.
struct Process<'p> {
    model: Arc<Model>,
    likelihoods: &'p Likelihoods,
    settings: &'p Settings,
    actions: Vec<(InstanceId, Action)>,
    /// Names of actions, without the prefix of a letter and an underscore.
    names: Vec<String>,
    facts: Vec<FactId>,
    /// Names of facts, with the prefix.
    fact_names: Vec<String>,
    dead_end: Option<Formula>,
}

/// A start, an end, or an instantaneous action.
struct Happening<'p> {
    action: usize,
    kind: Kind,
    snap: &'p SnapAction,
}

/// An outcome of a failed end.
struct Failure {
    /// The position of the end among the happenings.
    happening: usize,
    /// Conditional probability of the outcome after a failure.
    probability: Rational,
    /// The changes of facts, in order.
    changes: Vec<(FactId, bool)>,
}

impl Failure {
    /// Returns its effects on a fact, as certain effects.
    fn effects(&self, fact: FactId) -> Vec<(bool, Rational)> {
        let own = self.changes.iter().filter(|(other, _)| *other == fact);
        own.map(|(_, becomes)| (*becomes, Rational::ONE)).collect()
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Start,
    End,
    Instant,
}

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::End => "end",
            Self::Instant => "do",
        }
    }
}

impl<'p> Process<'p> {
    fn new(
        model: Model,
        likelihoods: &'p Likelihoods,
        settings: &'p Settings,
    ) -> Result<Self, PrismError> {
        if model.has_rates() {
            return Err(PrismError::Seconds);
        }
        let model = Arc::new(model);
        let instances = model.plan().instances();
        let actions: Vec<(InstanceId, Action)> = instances
            .map(|(id, instance)| (id, (*instance.action).clone()))
            .collect();
        let names = actions
            .iter()
            .map(|(_, action)| bare(&action.name).to_owned());
        let facts: Vec<FactId> = model.facts().collect();
        let fact_names = facts.iter().map(|fact| {
            let name = model.task().fact_name(*fact);
            format!("f_{}", bare(&name))
        });
        let mut process = Self {
            names: distinct(names),
            fact_names: distinct(fact_names),
            dead_end: None,
            model: Arc::clone(&model),
            likelihoods,
            settings,
            actions,
            facts,
        };
        if settings.dead_ends != DeadEnds::Harmless {
            process.dead_end = Some(process.dead_ends()?);
        }
        Ok(process)
    }

    fn task(&self) -> &Task {
        self.model.task()
    }

    fn durative(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.actions.len()).filter(|action| self.actions[*action].1.durative().is_some())
    }

    /// Returns the formula of the dead ends: no plan leads from them to the goal.
    fn dead_ends(&self) -> Result<Formula, PrismError> {
        let durative: Vec<usize> = self.durative().collect();
        let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
        let too_many = || TabulationError::TooManyStates {
            facts: self.facts.len(),
            actions: self.actions.len(),
        };
        for action in &durative {
            let longer: Vec<Vec<usize>> = sets
                .iter()
                .filter(|set| set.len() < self.settings.most_running)
                .map(|set| set.iter().chain([action]).copied().collect())
                .collect();
            sets.extend(longer);
            if sets.len() > MAX_STATES >> self.facts.len().min(60) {
                return Err(too_many().into());
            }
        }
        let process = Perturbed::new(Arc::clone(&self.model), self.settings.clone())?;
        let mut tables = Vec::new();
        for set in sets {
            let running: Vec<InstanceId> =
                set.iter().map(|action| self.actions[*action].0).collect();
            let table = (0..1_usize << self.facts.len()).map(|bits| {
                let facts = self.facts.iter().enumerate();
                let facts = facts.filter(|(place, _)| bits & (1 << place) != 0);
                let state = State {
                    facts: facts.map(|(_, fact)| *fact).collect(),
                    values: BTreeMap::new(),
                };
                process.is_dead_end_at(&state, &running)
            });
            tables.push((set, table.collect()));
        }
        let running: Vec<String> = self.names.iter().map(|name| format!("u_{name}")).collect();
        // Instantaneous actions are never running, so they have no such name.
        let place = |action: &usize| durative.iter().position(|other| other == action);
        for (set, _) in &mut tables {
            *set = set.iter().filter_map(place).collect();
        }
        let running: Vec<String> = durative.iter().map(|it| running[*it].clone()).collect();
        Ok(dead_ends::by_set(&tables, &running, &self.fact_names))
    }

    fn condition(&self, condition: &Condition) -> Formula {
        let all = |parts: &[Condition]| -> Vec<Formula> {
            parts.iter().map(|part| self.condition(part)).collect()
        };
        match condition {
            Condition::Fact(fact) => match self.facts.binary_search(fact) {
                Ok(place) => Formula::atom(&self.fact_names[place]),
                Err(_) => Formula::FALSE,
            },
            Condition::Not(part) => self.condition(part).negated(),
            Condition::And(parts) => Formula::all(all(parts)),
            Condition::Or(parts) => Formula::any(all(parts)),
            Condition::Compare(..) => {
                unreachable!("problems with numbers have been refused with their actions")
            }
        }
    }

    fn happenings(&self) -> Vec<Happening<'_>> {
        let actions = self.actions.iter().enumerate();
        actions
            .flat_map(|(action, (_, ground))| match &ground.body {
                Body::Instantaneous(snap) => vec![(action, Kind::Instant, snap)],
                Body::Durative(body) => vec![
                    (action, Kind::Start, &*body.start),
                    (action, Kind::End, &*body.end),
                ],
            })
            .map(|(action, kind, snap)| Happening { action, kind, snap })
            .collect()
    }

    fn text(&self) -> Result<String, PrismError> {
        let mut text = String::new();
        self.heading(&mut text);
        self.agent(&mut text)?;
        for place in 0..self.facts.len() {
            self.fact(place, &mut text)?;
        }
        text.push_str("label \"goal\" = phase=0 & under_way=0 & goal;\n");
        Ok(text)
    }

    fn heading(&self, text: &mut String) {
        let problem = self.task().problem();
        let _ = writeln!(
            text,
            "// The problem {} of the domain {}, without time.\n\
             // Pmax=? [F \"goal\"] is the greatest probability of reaching the goal for an agent that\n\
             // observes the state after each step.\n\n\
             mdp\n",
            problem.name, problem.domain
        );
        let under_way: Vec<String> = self
            .durative()
            .map(|action| format!("(u_{} ? 1 : 0)", self.names[action]))
            .collect();
        let under_way = if under_way.is_empty() {
            "0".to_owned()
        } else {
            under_way.join(" + ")
        };
        let _ = writeln!(text, "// Number of running actions.");
        let _ = writeln!(text, "formula under_way = {under_way};");
        let _ = writeln!(
            text,
            "formula goal = {};",
            self.condition(self.task().goal())
        );
        if let Some(dead_end) = &self.dead_end {
            text.push_str("// The goal is unreachable even if nothing else fails.\n");
            let _ = writeln!(text, "formula dead_end = {dead_end};");
        }
        let ready = match self.settings.dead_ends {
            DeadEnds::Harmless => "phase=0",
            DeadEnds::Lost => "phase=0 & !dead_end",
            DeadEnds::Patience(_) => "phase=0 & rounds>0",
        };
        let _ = writeln!(text, "// The agent chooses.\nformula ready = {ready};\n");
    }

    /// Writes the module of the agent and of the running actions.
    fn agent(&self, text: &mut String) -> Result<(), PrismError> {
        let happenings = self.happenings();
        let failures = self.failures();
        let phases = Phases::new(happenings.len() + failures.len(), self);
        text.push_str("module agent\n");
        let _ = writeln!(
            text,
            "  // 0: the agent chooses; 1 to {}: the effects of a happening; {}: it failed without\n  \
             // effects, and facts change by themselves.",
            happenings.len(),
            phases.nothing
        );
        if !failures.is_empty() {
            let _ = writeln!(
                text,
                "  // {} to {}: effects of failed ends.",
                happenings.len() + 1,
                happenings.len() + failures.len()
            );
        }
        let begin = if self.uncertain().next().is_some() {
            phases.begin
        } else {
            0
        };
        let _ = writeln!(text, "  phase : [0..{}] init {begin};", phases.begin);
        for action in self.durative() {
            let name = bare(&self.actions[action].1.name);
            let _ = writeln!(
                text,
                "  u_{} : bool init false; // {name}",
                self.names[action]
            );
        }
        if let DeadEnds::Patience(steps) = self.settings.dead_ends {
            let steps = steps.max(1);
            text.push_str(
                "  // Remaining number of steps that may end in a dead end; the last one ends the run.\n",
            );
            let _ = writeln!(text, "  rounds : [0..{steps}] init {steps};");
        }
        if begin > 0 {
            text.push_str("  // Facts that are uncertain initially.\n");
            let _ = writeln!(text, "  [begin] phase={begin} -> (phase'=0);");
        }
        for (index, happening) in happenings.iter().enumerate() {
            let own = failures.iter().enumerate();
            let own = own.filter(|(_, failure)| failure.happening == index);
            let own: Vec<_> = own
                .map(|(place, failure)| (happenings.len() + 1 + place, failure))
                .collect();
            self.command(happening, index + 1, (phases.nothing, &own), text)?;
        }
        for action in self.durative() {
            let name = &self.names[action];
            let _ = writeln!(
                text,
                "  [abandon_{name}] ready & u_{name} -> (u_{name}'=false);"
            );
        }
        let after = phases.settle.or(phases.count).unwrap_or(0);
        for step in 1..=phases.nothing {
            let _ = writeln!(text, "  [step_{step}] phase={step} -> (phase'={after});");
        }
        self.write_change_commands(&phases, text);
        text.push_str("  // The run stays stopped.\n");
        text.push_str("  [stop] phase=0 -> true;\nendmodule\n\n");
        Ok(())
    }

    /// Writes a command of the agent: an attempt to start an action, or its end.
    fn command(
        &self,
        happening: &Happening<'_>,
        step: usize,
        (nothing, failures): (usize, &[(usize, &Failure)]),
        text: &mut String,
    ) -> Result<(), PrismError> {
        let (_, action) = &self.actions[happening.action];
        let name = &self.names[happening.action];
        let needs = self.condition(&happening.snap.condition);
        let own = Formula::atom(format!("u_{name}"));
        let (guard, after) = match happening.kind {
            Kind::Instant => (needs, String::new()),
            Kind::Start => {
                let room = match self.settings.most_running {
                    most if most < self.durative().count() => {
                        Formula::atom(format!("under_way<{most}"))
                    }
                    _ => Formula::TRUE,
                };
                let guard = Formula::all([own.negated(), room, needs]);
                (guard, format!("&(u_{name}'=true)"))
            }
            Kind::End => (Formula::all([own, needs]), format!("&(u_{name}'=false)")),
        };
        let success = match happening.kind {
            Kind::End => exact(self.likelihoods.end(action)),
            Kind::Start | Kind::Instant => exact(self.likelihoods.start(action)?),
        };
        let failure = &Rational::ONE - &success;
        let mut ways = vec![(success, format!("(phase'={step}){after}"))];
        if happening.kind == Kind::End {
            ways.extend(failures.iter().map(|(phase, of_it)| {
                let p = &failure * &of_it.probability;
                (p, format!("(phase'={phase}){after}"))
            }));
        } else {
            ways.push((failure, format!("(phase'={nothing})")));
        }
        let guard = Formula::all([Formula::atom("ready"), guard]);
        let word = happening.kind.word();
        let _ = writeln!(text, "  [{word}_{name}] {guard} -> {};", choice(&ways));
        Ok(())
    }

    /// Returns the outcomes of failed ends, by happening.
    fn failures(&self) -> Vec<Failure> {
        let mut failures = Vec::new();
        for (index, happening) in self.happenings().iter().enumerate() {
            let (_, action) = &self.actions[happening.action];
            if happening.kind != Kind::End || self.likelihoods.end(action) >= 1.0 {
                continue;
            }
            let aftermaths = self.likelihoods.failure_outcomes(self.task(), action);
            let last = aftermaths.len().saturating_sub(1);
            let mut left = Rational::ONE;
            for (place, aftermath) in aftermaths.into_iter().enumerate() {
                // The last one gets the remaining probability, so that the sum is exactly 1.
                let probability = if place == last {
                    left.clone()
                } else {
                    exact(aftermath.probability)
                };
                left = &left - &probability;
                failures.push(Failure {
                    happening: index,
                    probability,
                    changes: aftermath.changes,
                });
            }
        }
        failures
    }

    /// Writes the commands after a step has changed facts.
    fn write_change_commands(&self, phases: &Phases, text: &mut String) {
        if let Some(settle) = phases.settle {
            text.push_str("  // Actions whose conditions over all are violated fail.\n");
            let kept = self.durative().map(|action| {
                let name = &self.names[action];
                let body = self.actions[action].1.durative();
                let over_all = body.map_or(Formula::TRUE, |body| self.condition(&body.over_all));
                let may_continue = Formula::all([Formula::atom(format!("u_{name}")), over_all]);
                format!("&(u_{name}'=({may_continue}))")
            });
            let kept: String = kept.collect();
            let after = phases.count.unwrap_or(0);
            let _ = writeln!(text, "  [settle] phase={settle} -> (phase'={after}){kept};");
        }
        if let Some(count) = phases.count {
            let _ = writeln!(text, "  [land] phase={count} & !dead_end -> (phase'=0);");
            let _ = writeln!(
                text,
                "  [land] phase={count} & dead_end & rounds>0 -> (phase'=0)&(rounds'=rounds-1);"
            );
        }
    }

    /// Returns the facts whose initial value is uncertain, with the probabilities that they hold.
    fn uncertain(&self) -> impl Iterator<Item = (FactId, f64)> + '_ {
        let belief = self.likelihoods.initial_belief(self.task());
        let facts = self.facts.iter();
        facts
            .map(move |fact| (*fact, belief.probability(*fact)))
            .filter(|(_, p)| *p > 0.0 && *p < 1.0)
    }

    /// Writes the module of a fact: its change in each step.
    fn fact(&self, place: usize, text: &mut String) -> Result<(), PrismError> {
        let (fact, name) = (self.facts[place], &self.fact_names[place]);
        let task = self.task();
        let initial = self.likelihoods.initial_belief(task).probability(fact);
        let flip = self.likelihoods.spontaneous_change(task, fact)?;
        let (rises, falls) = (exact(flip.becomes_true), exact(flip.becomes_false));
        let label = task.fact_name(fact);
        let _ = writeln!(text, "module m{name} // {}", bare(&label));
        let _ = writeln!(text, "  {name} : bool init {};", initial >= 1.0);
        let drawn = |p: Rational| {
            let rest = &Rational::ONE - &p;
            choice(&[
                (p, format!("({name}'=true)")),
                (rest, format!("({name}'=false)")),
            ])
        };
        let mut line = |label: &str, guard: &str, p: Rational| {
            let _ = writeln!(text, "  [{label}] {guard} -> {};", drawn(p));
        };
        if initial > 0.0 && initial < 1.0 {
            line("begin", "true", exact(initial));
        }
        let (happenings, failures) = (self.happenings(), self.failures());
        for step in 0..=happenings.len() + failures.len() {
            let effects = match happenings.get(step) {
                Some(happening) => self.effects(happening, fact)?,
                None => failures
                    .get(step - happenings.len())
                    .map_or_else(Vec::new, |failure| failure.effects(fact)),
            };
            if effects.is_empty() && rises.is_zero() && falls.is_zero() {
                continue;
            }
            for before in [false, true] {
                let mut p = if before {
                    Rational::ONE
                } else {
                    Rational::ZERO
                };
                for (makes_true, chance) in &effects {
                    // A failed effect leaves the fact unchanged.
                    let rest = &(&Rational::ONE - chance) * &p;
                    p = if *makes_true { &rest + chance } else { rest };
                }
                let holds_on = &p * &(&Rational::ONE - &falls);
                let comes_about = &(&Rational::ONE - &p) * &rises;
                let guard = if before {
                    name.clone()
                } else {
                    format!("!{name}")
                };
                line(
                    &format!("step_{}", step + 1),
                    &guard,
                    &holds_on + &comes_about,
                );
            }
        }
        text.push_str("endmodule\n\n");
        Ok(())
    }

    /// Returns the effects of a happening on a fact, deletions first, each with its probability.
    fn effects(
        &self,
        happening: &Happening<'_>,
        fact: FactId,
    ) -> Result<Vec<(bool, Rational)>, PrismError> {
        let (_, action) = &self.actions[happening.action];
        let mut effects = Vec::new();
        for effect in &happening.snap.effects {
            let makes_true = match &effect.change {
                Change::Add(own) if *own == fact => true,
                Change::Delete(own) if *own == fact => false,
                _ => continue,
            };
            let p = self
                .likelihoods
                .effect(self.task(), action, fact, makes_true)?;
            effects.push((makes_true, exact(p)));
        }
        effects.sort_by_key(|(makes_true, _)| *makes_true);
        Ok(effects)
    }
}

/// The values of the variable `phase` after those of the happenings and of failed ends.
struct Phases {
    nothing: usize,
    settle: Option<usize>,
    count: Option<usize>,
    /// The last value.
    begin: usize,
}

impl Phases {
    fn new(happenings: usize, process: &Process<'_>) -> Self {
        let mut last = happenings + 1;
        let mut next = |is_there: bool| {
            last += usize::from(is_there);
            is_there.then_some(last)
        };
        let settle = next(process.settings.enforces_over_all);
        let count = next(matches!(process.settings.dead_ends, DeadEnds::Patience(_)));
        Self {
            nothing: happenings + 1,
            settle,
            count,
            begin: last + usize::from(process.uncertain().next().is_some()),
        }
    }
}
