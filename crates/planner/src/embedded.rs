//! The embedded temporal planner.
//!
//! Forward search over the starts and ends of actions, in the line of CRIKEY3, POPF and COLIN
//! (Coles, Fox, Long & Smith, AAAI 2008; Coles, Coles, Fox & Long, ICAPS 2010 and IJCAI 2009),
//! with the queues of LAMA (Richter & Westphal, JAIR 2010).
//!
//! The way through the module:
//!
//! 1. [`plan`] grounds the task from the situation on, and compiles it (`compile`): small
//!    numbers for facts and fluents, ticks for time, and for each happening the list of what it
//!    must keep away from.
//! 2. `search` chooses happenings one after the other. Only what interferes keeps that order in
//!    time, so a sequence of choices stands for a plan in which much happens side by side. The
//!    times that are not settled form a small network (`network`).
//! 3. `relaxed` estimates how far the goal is.
//! 4. `extract` turns the choices into a plan with times, and shows it to the judge.

mod answer;
mod apply;
mod compile;
mod extract;
mod formula;
mod hash;
mod metric;
mod network;
mod pairs;
mod reasons;
mod relaxed;
mod search;
mod state;
mod symbolic;
mod symmetry;
mod time;

use std::ops::ControlFlow;

use elbowroom_model::problem::Metric;
use elbowroom_model::reachability::{self, Grounding};
use elbowroom_model::validate::Report;
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

pub use answer::{Answer, Counts, Found, Objective, Phase, Progress, Proof, Settings, Stopped};
pub use compile::Unsupported;

use apply::Step;
use compile::{Compiled, Eagerness};
use reasons::Names;
use search::{PATIENCE, Search, Style, Turn};
use symmetry::Symmetry;
use time::{NEVER, Ticks};

/// How much work lies between two reports, in operators of estimates: about ten milliseconds.
const REPORT_WORK: u64 = 2_000_000;

/// The most turns between two reports where each state is a linear program.
const REPORT_SYMBOLIC_TURNS: u64 = 8;

/// The most turns between two reports.
const REPORT_TURNS: u64 = 256;

/// How many states the hasty search may look at before the complete one gets its first turns.
const HASTE: u64 = 20_000;

/// How many turns the hasty search gets for each one of the complete search.
const COMPLETE_SHARE: u64 = 10;

/// Finds a plan from `situation`.
///
/// `observe` is called now and then, and for each better plan; with `Break` the search ends, and
/// the best plan so far is the answer. Every plan has been found valid by
/// [`elbowroom_model::validate_from`], exactly, with the given ε. The same input gives the same
/// answer, and the same sequence of reports.
pub fn plan(
    task: &mut Task,
    situation: &Situation,
    settings: &Settings,
    observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Answer {
    let mut progress = Progress::default();
    if observe(&progress).is_break() {
        return none_found(Stopped::Interrupted, progress.counts);
    }
    let mut continued;
    let grounded = if *situation == Situation::initial(task) {
        &mut *task
    } else {
        continued = task.beginning_at(situation);
        &mut continued
    };
    let limits = reachability::Settings::default();
    let grounding = match reachability::ground(grounded, &limits) {
        reachability::Answer::Complete(grounding) => grounding,
        reachability::Answer::LimitReached => {
            return none_found(Stopped::OutOfMemory, progress.counts);
        }
    };
    progress.counts.actions = grounding.actions.len() as u64;
    if let Some(proof) = unreachable(grounded, &grounding) {
        return Answer::Unsolvable {
            proof,
            counts: progress.counts,
        };
    }
    let compiled = compile::compile(grounded, &grounding, situation, &settings.epsilon);
    let compiled = match compiled {
        Ok(compiled) => compiled,
        Err(unsupported) => return Answer::Unsupported(unsupported),
    };
    let names = Names::of(grounded, &compiled);
    if compiled.is_relaxation_exact()
        && let Some(proof) = reasons::relaxed_proof(&names, &compiled)
    {
        return Answer::Unsolvable {
            proof,
            counts: progress.counts,
        };
    }
    let symmetry = Symmetry::of(grounded, &compiled);
    Planner {
        names: &names,
        symmetry: &symmetry,
        task,
        situation,
        settings,
        observe,
        compiled: &compiled,
        progress,
        best: None,
        horizon: NEVER,
    }
    .run()
}

fn none_found(stopped: Stopped, counts: Counts) -> Answer {
    Answer::NoneFound { stopped, counts }
}

fn unreachable(task: &Task, grounding: &Grounding) -> Option<Proof> {
    if grounding.unreachable_goals.is_empty() && !grounding.goal.is_contradiction() {
        return None;
    }
    let reasons = grounding
        .unreachable_goals
        .iter()
        .map(|goal| format!("`{}` cannot become true", task.describe_condition(goal)));
    Some(Proof::Unreachable(reasons.collect()))
}

/// One run.
struct Planner<'a> {
    task: &'a mut Task,
    situation: &'a Situation,
    settings: &'a Settings,
    observe: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    compiled: &'a Compiled,
    symmetry: &'a Symmetry,
    names: &'a Names,
    progress: Progress,
    best: Option<Found>,
    /// Only plans that end by then are of interest.
    horizon: Ticks,
}

impl Planner<'_> {
    fn run(mut self) -> Answer {
        let compiled = self.compiled;
        let mut styles = vec![Style::hasty(Eagerness::Lends)];
        let lends = |action: &compile::Action| action.eagerness == Eagerness::Lends;
        if compiled.actions.iter().any(lends) {
            styles.push(Style::hasty(Eagerness::Free));
        }
        styles.push(Style::COMPLETE);
        let mut searches: Vec<Search<'_>> = styles
            .iter()
            .map(|&style| Search::new(compiled, self.symmetry, style))
            .collect();
        let mut is_over = vec![false; searches.len()];
        let mut stopped = match self.work(&mut searches[0], Phase::Hasty, PATIENCE) {
            Outcome::Stop(stopped) => Some(stopped),
            Outcome::BudgetSpent => None,
            Outcome::Over => {
                is_over[0] = searches[0].is_incomplete();
                (!is_over[0]).then_some(Stopped::Exhausted)
            }
        };
        if self.best.is_none()
            && stopped.is_none_or(|stopped| stopped == Stopped::Exhausted)
            && compiled.is_relaxation_exact()
            && let Some(proof) = reasons::pairs_proof(self.names, compiled)
        {
            let counts = self.progress.counts;
            return Answer::Unsolvable { proof, counts };
        }
        let mut budget = HASTE;
        while stopped.is_none() {
            for (number, search) in searches.iter_mut().enumerate() {
                if is_over[number] {
                    continue;
                }
                let (phase, share) = match styles[number].haste {
                    Some(_) => (Phase::Hasty, budget),
                    None => (Phase::Complete, budget / COMPLETE_SHARE),
                };
                match self.work(search, phase, share) {
                    Outcome::Stop(reason) => stopped = Some(reason),
                    Outcome::BudgetSpent => {}
                    Outcome::Over if search.is_incomplete() => is_over[number] = true,
                    Outcome::Over => stopped = Some(Stopped::Exhausted),
                }
                if stopped.is_some() {
                    break;
                }
            }
            if !is_over.contains(&false) {
                stopped = stopped.or(Some(Stopped::Exhausted));
            }
            budget = budget.saturating_mul(2);
        }
        let stopped = stopped.unwrap_or(Stopped::Exhausted);
        let is_proof = stopped == Stopped::Exhausted
            && compiled.is_exact
            && compiled.gap.is_none()
            && searches.iter().any(|search| !search.is_incomplete());
        let counts = self.progress.counts;
        match self.best {
            Some(found) => Answer::Plan {
                found,
                stopped,
                counts,
            },
            None if is_proof => Answer::Unsolvable {
                proof: Proof::Exhausted {
                    states: counts.evaluated,
                },
                counts,
            },
            None => none_found(stopped, counts),
        }
    }

    /// Lets a search look at so many states.
    fn work(&mut self, search: &mut Search<'_>, phase: Phase, budget: u64) -> Outcome {
        self.progress.phase = phase;
        if self.horizon < NEVER {
            search.set_horizon(self.horizon);
        }
        let before = (self.progress.counts, search.counts());
        let most_turns = if self.compiled.is_symbolic {
            REPORT_SYMBOLIC_TURNS
        } else {
            REPORT_TURNS
        };
        let report_every = (REPORT_WORK / (1 + search.size())).clamp(1, most_turns);
        for turn in 0..budget {
            match search.turn() {
                Turn::Over => {
                    self.count(&before, search);
                    return Outcome::Over;
                }
                Turn::Nothing => {}
                Turn::Goal(steps) => {
                    self.count(&before, search);
                    if let Some(outcome) = self.consider(&steps, search) {
                        return outcome;
                    }
                }
            }
            if turn % report_every == report_every - 1 {
                self.count(&before, search);
                if (self.observe)(&self.progress).is_break() {
                    return Outcome::Stop(Stopped::Interrupted);
                }
                if self.progress.counts.memory > self.settings.max_memory {
                    return Outcome::Stop(Stopped::OutOfMemory);
                }
            }
        }
        self.count(&before, search);
        Outcome::BudgetSpent
    }

    fn count(&mut self, before: &(Counts, Counts), search: &Search<'_>) {
        let (counts, start, now) = (&mut self.progress.counts, before.1, search.counts());
        counts.expanded = before.0.expanded + now.expanded - start.expanded;
        counts.generated = before.0.generated + now.generated - start.generated;
        counts.evaluated = before.0.evaluated + now.evaluated - start.evaluated;
        counts.memory = before.0.memory + now.memory - start.memory;
    }

    /// Looks at the choices that a search takes for a plan.
    fn consider(&mut self, steps: &[Step], search: &mut Search<'_>) -> Option<Outcome> {
        let judged = extract::plan_of(
            self.task,
            self.situation,
            self.compiled,
            steps,
            self.settings,
        );
        let Some((plan, report)) = judged else {
            search.has_lost = true;
            return None;
        };
        let found = self.value(plan, &report);
        if self
            .best
            .as_ref()
            .is_some_and(|best| best.value <= found.value)
        {
            return None;
        }
        self.progress.best = Some(found.value.clone());
        self.progress.plan = Some(found.clone());
        let is_makespan = found.value == found.makespan;
        let (end, _) = self.compiled.scale.floor(&found.makespan);
        self.best = Some(found);
        let flow = (self.observe)(&self.progress);
        self.progress.plan = None;
        if flow.is_break() {
            return Some(Outcome::Stop(Stopped::Interrupted));
        }
        if self.settings.first_plan_only {
            return Some(Outcome::Stop(Stopped::FirstPlan));
        }
        if is_makespan {
            self.horizon = end - 1;
            search.set_horizon(self.horizon);
        }
        None
    }

    fn value(&self, plan: TimeTriggeredPlan, report: &Report) -> Found {
        let makespan = report.makespan.clone();
        let metric = match self.settings.objective {
            Objective::Makespan => None,
            Objective::Metric => self.task.problem().metric.clone(),
        };
        let value = metric
            .and_then(|metric| self.metric(&metric, report))
            .unwrap_or_else(|| makespan.clone());
        Found {
            plan,
            makespan,
            value,
        }
    }

    /// The metric's value at the end of a plan, negated if more is better.
    fn metric(&self, metric: &Metric, report: &Report) -> Option<Rational> {
        let value = metric::metric_value(self.task, metric.expression.as_ref()?, report)?;
        Some(if metric.maximize { -value } else { value })
    }
}

enum Outcome {
    Stop(Stopped),
    Over,
    BudgetSpent,
}
