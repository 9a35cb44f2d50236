//! Trajectory constraints, compiled into conditions of actions and goals.
//!
//! A problem with constraints becomes one without constraints, whose plans satisfy them (Baier &
//! `McIlraith`, ICAPS 2006, and Bonassi, De Giacomo, Favorito, Fuggitti, Gerevini & Scala, ICAPS
//! 2021, use similar compilations for sequential plans; here happenings overlap):
//!
//! - `always`: a happening that makes the last true literal of a clause false needs another literal
//!   to hold afterwards, which is computed by regression.
//! - `sometime`, `within`: an *observer*, an instantaneous action, observes that the condition
//!   holds, before its deadline. The goal requires the fact that it adds.
//! - `sometime-before`: as `always`, unless the other condition has been observed.
//! - `at-most-once`: a happening that ends the condition records it, and then no happening can make
//!   it true again.
//! - `sometime-after`: a happening that makes the first condition true without the second creates
//!   an obligation until the second has been observed.
//! - `always-within`: as `always`, unless an action that *waits* is running. It ends in time, when
//!   the other condition holds.
//! - `hold-during`, `hold-after`: an observer observes the condition in time and *locks* it, until
//!   a timed initial unlocks it.
//! - `at end`: a part of the goal.
//!
//! If a timed initial would break a condition, an observer observes and locks the condition before
//! (`timed`). Observers and waiting actions are removed from the plan, and the validator checks the
//! plan under the original constraints. The compilation loses a few plans: an observation takes ε,
//! and happenings of one time cannot keep a clause together. So nothing is proved this way. If no
//! plan is found, or a constraint has no such form, a search ignores the constraints, and the
//! validator rejects the plans that violate them. A proof for the problem without constraints also
//! holds with them.
//!
//! In mid-execution, only [deadlines](Task::with_deadlines) are respected, because they do not
//! depend on the past. They change no action, so that running actions remain as they are.

mod actions;
mod clauses;
mod consequences;
mod delay;
mod regression;
mod rewriting;
mod timed;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::ground::FactId;
use elbowroom_model::problem::{Expression, Problem};
use elbowroom_model::validate::{self, Verdict, validate_from};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};

use super::answer::{Answer, Counts, FoundPlan, Objective, Progress, Proof, Settings, Stopped};
use super::compile::Unsupported;
use super::tuning::Technique;
pub(super) use delay::delayed;
use rewriting::Coverage;

/// Reason why a problem has no form without constraints.
enum Obstacle {
    /// The feature is not supported.
    Feature(&'static str),
    /// The constraint is violated in every plan.
    ConstraintViolated(String),
}

/// Number of states evaluated for each preference that is tried.
const TRIAL: u64 = 20_000;

/// Maximum number of states of each of the short searches, with and without the constraints, before
/// the full search.
const QUICK: u64 = 60;

/// Returns `true` if this module handles the search for plans of the task.
pub(super) fn is_responsible_for(task: &Task, situation: &Situation, settings: &Settings) -> bool {
    let constraints = task.constraints();
    let is_improving = !settings.first_plan_only
        && settings.objective == Objective::Metric
        && *situation == Situation::initial(task)
        && counts_violations(task);
    !constraints.hard.is_empty() || is_improving && !constraints.soft.is_empty()
}

fn counts_violations(task: &Task) -> bool {
    let mut counts = false;
    if let Some(metric) = &task.problem().metric {
        metric.expression.visit_leaves(&mut |leaf| {
            counts |= matches!(leaf, Expression::Violations(_));
        });
    }
    counts
}

/// As [`plan`](super::plan), for a task with constraints.
///
/// If the metric counts violated preferences, they are tried one after the other once there is a
/// plan: each is required, in addition to those that improved the plan, for a limited number of
/// states. The remaining time is used for plans under all preferences that improved it.
pub(super) fn plan(
    task: &Task,
    situation: &Situation,
    settings: &Settings,
    observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Answer {
    let constraints = task.constraints();
    let is_begun = *situation != Situation::initial(task) && !constraints.ignores_past();
    if is_begun || constraints.depends_on_unknown_past() {
        return unsupported(task, "trajectory constraints during execution");
    }
    let mut search = Search {
        task,
        situation,
        settings,
        observe,
        best: None,
        is_interrupted: false,
        spent: Counts::default(),
    };
    let is_improving = !settings.first_plan_only && counts_violations(task);
    let mut demanded = Vec::new();
    if is_improving {
        let first = match search.search_with_preferences((&demanded, Coverage::All), None, true) {
            Ok(answer) => answer,
            Err(answer) => return *answer,
        };
        if search.best.is_none() || search.is_interrupted {
            return search.answer(first);
        }
        for soft in 0..task.constraints().soft.len() {
            demanded.push(soft);
            let before = search.best.as_ref().map(|best| best.value.clone());
            let tried =
                search.search_with_preferences((&demanded, Coverage::All), Some(TRIAL), true);
            let after = search.best.as_ref().map(|best| best.value.clone());
            if tried.is_err() || after == before {
                demanded.pop();
            }
            if search.is_interrupted {
                break;
            }
        }
        if search.is_interrupted {
            return search.answer(first);
        }
    }
    if search.best.is_none()
        && let Some(answer) = search.quick_search(&demanded)
    {
        return answer;
    }
    match search.search_with_preferences((&demanded, Coverage::All), None, settings.first_plan_only)
    {
        Ok(answer) => {
            let proof = search.search_unconstrained(None);
            proof.unwrap_or_else(|| search.answer(answer))
        }
        Err(answer) if matches!(*answer, Answer::Unsupported(_)) => {
            let is_first = settings.first_plan_only;
            let expressible = (&demanded[..], Coverage::Expressible);
            // An obstacle here is not an obstacle for the problem without constraints.
            let _ = search.search_with_preferences(expressible, Some(TRIAL), is_first);
            let proof = search.search_unconstrained(None);
            proof.unwrap_or_else(|| search.answer_unsupported_form(*answer))
        }
        Err(answer) => *answer,
    }
}

/// A search for plans of the task, over several problems without constraints.
struct Search<'a> {
    task: &'a Task,
    situation: &'a Situation,
    settings: &'a Settings,
    observe: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    best: Option<FoundPlan>,
    is_interrupted: bool,
    /// Statistics of the finished searches.
    spent: Counts,
}

impl Search<'_> {
    /// Searches for plans that also satisfy these preferences. Returns the answer for the problem
    /// without constraints. If there is no such problem, returns the answer for the task as `Err`.
    fn search_with_preferences(
        &mut self,
        (demanded, coverage): (&[usize], Coverage),
        most_states: Option<u64>,
        first_plan_only: bool,
    ) -> Result<Answer, Box<Answer>> {
        let free = match rewriting::without_constraints(self.task, demanded, coverage) {
            Ok(problem) => self.extended_task(problem),
            Err(Obstacle::Feature(feature)) => {
                return Err(Box::new(unsupported(self.task, feature)));
            }
            Err(Obstacle::ConstraintViolated(reason)) => {
                return Err(Box::new(Answer::Unsolvable {
                    proof: Proof::Unreachable(vec![reason]),
                    counts: Counts::default(),
                }));
            }
        };
        let settings = self.search_settings(first_plan_only);
        let constrained = coverage == Coverage::Expressible;
        let constrained = constrained.then_some((self.task, self.situation));
        Ok(self.search(&free, constrained, &settings, most_states))
    }

    /// Returns the settings of one search. Each plan that it finds is validated under the
    /// constraints.
    fn search_settings(&self, first_plan_only: bool) -> Settings {
        let mut settings = Settings {
            first_plan_only,
            ..self.settings.clone()
        };
        settings.tuning.without.push(Technique::Cleanup);
        settings
    }

    /// Searches for plans of a task without constraints; evaluates about `most_states` states at most.
    fn search(
        &mut self,
        free: &Task,
        constrained: Option<(&Task, &Situation)>,
        settings: &Settings,
        most_states: Option<u64>,
    ) -> Answer {
        let begin = self.extended_situation(free);
        let mut counts = Counts::default();
        let mut observe = |progress: &Progress| {
            counts = progress.counts;
            let is_over = most_states.is_some_and(|most| progress.counts.evaluated > most);
            match self.process_report(progress) {
                ControlFlow::Continue(()) if !is_over => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        };
        let answer = super::search_for_plans(free, constrained, &begin, settings, &mut observe);
        self.spent.expanded += counts.expanded;
        self.spent.generated += counts.generated;
        self.spent.evaluated += counts.evaluated;
        self.spent.work += counts.work;
        answer
    }

    /// Searches for a first plan for a few states, first under the constraints and then without
    /// them, since the form of the constraints may exclude plans that are easy to find without it.
    /// Returns the answer if it is final.
    fn quick_search(&mut self, demanded: &[usize]) -> Option<Answer> {
        let whole = self.search_with_preferences((demanded, Coverage::All), Some(QUICK), true);
        let answer = match whole {
            Ok(answer) => answer,
            Err(answer) if matches!(*answer, Answer::Unsupported(_)) => {
                let part = self.search_with_preferences(
                    (demanded, Coverage::Expressible),
                    Some(QUICK),
                    true,
                );
                part.unwrap_or(*answer)
            }
            Err(answer) => return Some(*answer),
        };
        if self.best.is_none() && !self.is_interrupted {
            let proof = self.search_unconstrained(Some(QUICK));
            if proof.is_some() {
                return proof;
            }
        }
        let is_settled =
            self.is_interrupted || self.best.is_some() && self.settings.first_plan_only;
        is_settled.then(|| self.answer(answer))
    }

    /// Searches without the constraints if the search under them found no plan: for plans that
    /// happen to satisfy them, and for a proof that no plan exists even without them.
    fn search_unconstrained(&mut self, most_states: Option<u64>) -> Option<Answer> {
        if self.best.is_some() || self.is_interrupted {
            return None;
        }
        let task = self.task;
        let loose = self.extended_task(rewriting::relaxed_problem(task));
        let settings = self.search_settings(true);
        let constrained = Some((task, self.situation));
        let answer = self.search(&loose, constrained, &settings, most_states);
        match answer {
            // A rejected plan may represent others that satisfy the constraints.
            Answer::Unsolvable {
                proof: Proof::Exhausted { .. } | Proof::WithoutSelfOverlap { .. },
                ..
            } => None,
            Answer::Unsolvable { .. } => Some(answer),
            _ => None,
        }
    }

    /// Returns the task of a problem that extends this one's.
    fn extended_task(&self, problem: Problem) -> Task {
        if *self.situation == Situation::initial(self.task) {
            Task::new(problem).with_epsilon(self.task.epsilon().clone())
        } else {
            self.task.extended(problem)
        }
    }

    /// Returns the situation for plans of the extended task.
    fn extended_situation(&self, free: &Task) -> Situation {
        if *self.situation == Situation::initial(self.task) {
            return Situation::initial(free);
        }
        let own = self.task.problem().predicates.len();
        let is_more = |fact: &&FactId| free.atom(**fact).0.index() >= own;
        let more = free.initial().facts.iter().filter(is_more).copied();
        let mut begin = self.situation.clone();
        begin.state.facts.extend(more);
        begin
    }

    fn validated(&self, plan: &TimeTriggeredPlan) -> Option<FoundPlan> {
        validated_without_observers(self.task, self.situation, self.settings, plan)
    }

    /// Processes a report of a search.
    fn process_report(&mut self, progress: &Progress) -> ControlFlow<()> {
        let found = progress.plan.as_ref();
        let found = found.and_then(|found| self.validated(&found.plan));
        let worth = |found: &FoundPlan| (found.value.clone(), found.makespan.clone());
        let best = &self.best;
        let better =
            found.filter(|found| best.as_ref().is_none_or(|best| worth(found) < worth(best)));
        let counts = progress.counts.after(&self.spent);
        let report = Progress {
            counts,
            plan: better.clone(),
            best: better
                .as_ref()
                .or(best.as_ref())
                .map(|found| found.value.clone()),
            ..progress.clone()
        };
        if better.is_some() {
            self.best = better;
        }
        let flow = (self.observe)(&report);
        self.is_interrupted |= flow.is_break();
        flow
    }

    /// Returns the answer for the task if there is no problem without constraints.
    fn answer_unsupported_form(&mut self, unsupported: Answer) -> Answer {
        let stopped = if self.is_interrupted {
            Stopped::Interrupted
        } else {
            Stopped::Exhausted
        };
        let counts = self.spent;
        match self.best.take() {
            Some(found) => Answer::Plan {
                found,
                stopped,
                counts,
            },
            None if self.is_interrupted => Answer::NoneFound {
                stopped,
                without_self_overlap: false,
                counts,
            },
            None => unsupported,
        }
    }

    /// Returns the answer for the task, given the last answer for a problem without constraints.
    fn answer(&mut self, last: Answer) -> Answer {
        let (stopped, mut counts) = match &last {
            Answer::Plan {
                stopped, counts, ..
            }
            | Answer::NoneFound {
                stopped, counts, ..
            } => (*stopped, *counts),
            Answer::Unsolvable { counts, .. } => (Stopped::Exhausted, *counts),
            Answer::Unsupported(_) if self.best.is_none() => return last,
            Answer::Unsupported(_) => (Stopped::Exhausted, Counts::default()),
        };
        let stopped = match stopped {
            _ if self.is_interrupted => Stopped::Interrupted,
            Stopped::FirstPlan if self.best.is_none() => Stopped::Exhausted,
            stopped => stopped,
        };
        let without_self_overlap = match &last {
            Answer::NoneFound {
                without_self_overlap,
                ..
            } => *without_self_overlap,
            Answer::Unsolvable { proof, .. } => matches!(proof, Proof::WithoutSelfOverlap { .. }),
            _ => false,
        };
        counts.expanded = self.spent.expanded;
        counts.generated = self.spent.generated;
        counts.evaluated = self.spent.evaluated;
        counts.work = self.spent.work;
        match self.best.take() {
            Some(found) => Answer::Plan {
                found,
                stopped,
                counts,
            },
            None => Answer::NoneFound {
                stopped,
                without_self_overlap,
                counts,
            },
        }
    }
}

fn unsupported(task: &Task, feature: &str) -> Answer {
    Answer::Unsupported(Unsupported {
        feature: feature.to_owned(),
        place: format!("problem {}", task.problem().name),
    })
}

/// Returns the plan without observers if the validator accepts it.
pub(super) fn validated_without_observers(
    task: &Task,
    situation: &Situation,
    settings: &Settings,
    plan: &TimeTriggeredPlan,
) -> Option<FoundPlan> {
    let own = plan
        .new_steps(situation)
        .iter()
        .filter(|step| step.action.schema.index() < task.problem().schemas.len());
    let running = plan.steps.iter().take(situation.running.len());
    let running = running.map(|step| Some(step.clone()));
    let new = own.map(|step| {
        let action = task.instantiate(step.action.schema, &step.action.arguments);
        Some(Step {
            start: step.start.clone(),
            action: Arc::new(action.ok()?),
            duration: step.duration.clone(),
        })
    });
    let plan = TimeTriggeredPlan {
        steps: running.chain(new).collect::<Option<_>>()?,
    };
    let settings_of_validator = validate::Settings::default();
    let verdict = validate_from(task, situation, &plan, &settings_of_validator);
    let Verdict::Valid(report) = verdict else {
        return None;
    };
    let metric = report.metric(task);
    let is_maximized = task.problem().metric.as_ref().is_some_and(|m| m.maximize);
    let value = match (&metric, settings.objective) {
        (Some(metric), Objective::Metric) if is_maximized => -metric,
        (Some(metric), Objective::Metric) => metric.clone(),
        _ => report.makespan.clone(),
    };
    Some(FoundPlan {
        plan,
        makespan: report.makespan,
        metric,
        value,
    })
}
