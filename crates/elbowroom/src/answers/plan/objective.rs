//! Plans with the greatest slack or success probability.

mod evaluation;

use std::fmt;
use std::ops::ControlFlow;
use std::str::FromStr;
use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, terms};
use elbowroom_plan::makespan::last_end;
use elbowroom_planner::{Answer, Settings};
use elbowroom_sim::WorldModel;
use serde::{Deserialize, Serialize};

use super::{PlanFinding, PlanOutcome, PlanStop, SearchMonitor, no_plan_reason};
use crate::answers::{Event, Exact, Observer, PlanProgress, RequestError, exact};
use crate::execute::{Candidates, Limits};
use crate::pipeline;
use evaluation::{EvaluatedPlan, PlanEvaluator};

terms! {
    /// Objective of a plan other than its makespan or metric. The deviation is that of all durations at the same time,
    /// in the plan's best box ([`elbowroom_envelope::Objective::LeastSlack`]); documents in JSON call it `room`. Plans
    /// are executed in the world with the default executor and without replanning.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum PlanObjective {
        #[serde(rename = "room", alias = "slack")]
        Slack = "slack": "The relative deviation that all its durations may have",
        Probability = "probability": "Share of successes in a world",
    }
}

/// The name of an unknown [`PlanObjective`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("plans are made for `slack` or `probability`, not for `{0}`")]
pub struct UnknownPlanObjective(String);

impl fmt::Display for PlanObjective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for PlanObjective {
    type Err = UnknownPlanObjective;

    fn from_str(name: &str) -> Result<Self, UnknownPlanObjective> {
        let name = if name == "room" { "slack" } else { name };
        let known = Self::TERMS.iter().find(|(_, known, _)| *known == name);
        let known = known.map(|(objective, ..)| *objective);
        known.ok_or_else(|| UnknownPlanObjective(name.to_owned()))
    }
}

/// Requests the best plan by an objective, among those that can be found.
#[derive(Clone, Debug)]
pub struct BestPlanRequest<'a> {
    /// The problem.
    pub task: &'a Arc<Task>,
    /// The objective; for [`PlanObjective::Probability`] with its world.
    pub aim: PlanAim<'a>,
    /// Maximum number of variants of the problem that are planned for. Without a limit, the search
    /// ends when the watcher stops it or there are no further variants.
    pub most_searches: Option<usize>,
    /// `true` if a ground action may overlap itself.
    pub self_overlap: bool,
    /// Memory limit of a search, in bytes (approximate).
    pub most_memory: Option<u64>,
}

/// An objective with its arguments.
#[derive(Clone, Copy, Debug)]
pub enum PlanAim<'a> {
    /// See [`PlanObjective::Slack`].
    Slack,
    /// See [`PlanObjective::Probability`].
    Probability(&'a WorldModel),
}

/// Value of a plan by an objective.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum PlanValue {
    /// The deviation that each duration may have, as a share of its nominal value.
    Slack {
        /// The share.
        #[serde(rename = "room", with = "exact")]
        slack: Rational,
    },
    /// The success rate in samples of the world.
    Sampled {
        /// The number of successful samples.
        successes: u64,
        /// The number of samples.
        samples: u64,
        /// Wilson's 95 % interval of the probability.
        interval: Option<(f64, f64)>,
    },
    /// The value is unknown: nothing in the plan may deviate, or it is beyond exact analysis.
    Unknown {
        /// The reason.
        why: String,
    },
}

/// The choice of a plan among several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanChoice {
    /// The objective.
    pub objective: PlanObjective,
    /// Value of the plan.
    pub value: PlanValue,
    /// Value of the shortest plan that the planner found.
    pub shortest: PlanValue,
    /// Makespan of the shortest plan.
    pub shortest_makespan: Exact,
    /// The variant of the problem that the plan was made for, in words; empty if it is the shortest
    /// plan.
    pub made_for: String,
    /// Number of compared plans.
    pub compared: usize,
}

impl fmt::Display for PlanValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slack { slack } => {
                let percent = slack * &Rational::from(100);
                write!(f, "{} %", percent.to_decimal(1))
            }
            Self::Sampled {
                successes, samples, ..
            } => write!(f, "{successes} of {samples}"),
            Self::Unknown { .. } => f.write_str("unknown"),
        }
    }
}

/// Searches for the best plan by an objective. The shortest plan is evaluated first, so the answer
/// is at least as good.
///
/// # Errors
/// When the problem has features that the embedded planner does not support.
pub fn best_plan(
    request: &BestPlanRequest<'_>,
    watcher: &mut dyn Observer,
) -> Result<PlanOutcome, RequestError> {
    let task = request.task.with_own_table();
    let situation = Situation::initial(&task);
    let mut settings = Settings {
        self_overlap: request.self_overlap,
        ..Settings::default()
    };
    if let Some(bytes) = request.most_memory {
        settings.max_memory = usize::try_from(bytes).unwrap_or(usize::MAX);
    }
    let max_memory = settings.max_memory;
    let limits = Limits {
        most_states: u64::MAX,
        improve_states: 20_000,
        work: u64::MAX,
        first_plan_factor: 1,
        other_states: u64::MAX / 2,
        searches: request.most_searches.unwrap_or(usize::MAX),
    };
    let world = match request.aim {
        PlanAim::Slack => None,
        PlanAim::Probability(world) => Some(world),
    };
    let begun = watcher.elapsed();
    let mut course = SearchMonitor {
        watcher,
        started: begun,
        plans: 0,
        first: None,
        stop_request: None,
    };
    let mut source = Candidates::new(&task, &situation, world, settings, limits);
    let (best, shortest) = compare_candidates(request, &task, &mut source, &mut course);
    let stop = match (course.stop_request, request.most_searches) {
        (Some(halt), _) => halt.into(),
        (None, Some(_)) => PlanStop::Ended,
        (None, None) => PlanStop::Exhausted,
    };
    let counts = source.counts();
    let mut ended = None;
    let (plan, finding, choice) = match best {
        Some(best) => {
            let value = best.value.to_plan_value();
            let (worth, end) = shortest.unwrap_or((value.clone(), best.makespan.clone()));
            let choice = PlanChoice {
                objective: request.aim.objective(),
                value,
                shortest: worth,
                shortest_makespan: Exact(end),
                made_for: best.candidate.made_for,
                compared: course.plans,
            };
            let plan = best.candidate.plan;
            let metric = metric(&task, &plan);
            let finding = PlanFinding::of(&task, &plan, best.makespan, metric, None);
            (Some(plan), finding, Some(choice))
        }
        None => match source.answer() {
            Some(Answer::Unsupported(unsupported)) => {
                return Err(RequestError::Unsupported(unsupported.to_string()));
            }
            Some(Answer::Unsolvable { proof, .. }) => {
                let (finding, stop) = course.refuted_finding(&task, proof, counts);
                ended = Some(stop);
                (None, finding, None)
            }
            answer => {
                let without_self_overlap = matches!(
                    answer,
                    Some(Answer::NoneFound {
                        without_self_overlap: true,
                        ..
                    })
                );
                let counts = (counts, without_self_overlap);
                let reason = no_plan_reason(stop, counts, max_memory);
                (None, PlanFinding::none(&task, reason), None)
            }
        },
    };
    let stop = ended.unwrap_or(stop);
    let answer = course.answer(request.task, (finding, choice), (stop, counts));
    let plan = plan.and_then(|plan| elbowroom_selection::renumbered(request.task, &plan));
    Ok(PlanOutcome { answer, plan })
}

/// Returns the best plan, and the value and makespan of the shortest plan.
fn compare_candidates(
    request: &BestPlanRequest<'_>,
    task: &Task,
    source: &mut Candidates<'_>,
    course: &mut SearchMonitor<'_>,
) -> (Option<EvaluatedPlan>, Option<(PlanValue, Rational)>) {
    let mut best: Option<EvaluatedPlan> = None;
    let mut shortest: Option<(PlanValue, Rational)> = None;
    let mut evaluator: Option<PlanEvaluator<'_>> = None;
    while let Some(candidate) = source.next(&mut |states| course.report_progress(states, None)) {
        course.plans += 1;
        let elapsed = course.elapsed();
        course.first.get_or_insert(elapsed);
        let known = best.as_ref().map(|best| &best.value);
        // After planning, the task's table contains the facts of plans.
        let evaluator = evaluator.get_or_insert_with(|| PlanEvaluator::of(request, task));
        let value = evaluator.value(&candidate.plan, known, course);
        let Some(value) = value else {
            // Interrupted: the first plan is returned with an unknown value, a later one is
            // dropped.
            best.get_or_insert(EvaluatedPlan::unknown(
                candidate,
                "the search stopped before its evaluation",
            ));
            break;
        };
        let judged = EvaluatedPlan {
            makespan: last_end(&candidate.plan),
            candidate,
            value,
        };
        shortest.get_or_insert_with(|| (judged.value.to_plan_value(), judged.makespan.clone()));
        if best.as_ref().is_none_or(|best| judged.is_better_than(best)) {
            let worth = judged.value.to_plan_value().to_string();
            course.report_progress(0, Some((&judged, &worth)));
            best = Some(judged);
        }
    }
    (best, shortest)
}

impl PlanAim<'_> {
    fn objective(self) -> PlanObjective {
        match self {
            Self::Slack => PlanObjective::Slack,
            Self::Probability(_) => PlanObjective::Probability,
        }
    }
}

/// Returns the value of the problem's metric, if it has one.
fn metric(task: &Task, plan: &TimeTriggeredPlan) -> Option<Rational> {
    match pipeline::validate_plan(task, plan) {
        elbowroom_model::validate::Verdict::Valid(report) => report.metric(task),
        _ => None,
    }
}

impl SearchMonitor<'_> {
    /// Notifies the watcher of the progress, with a new best plan and its value. Returns `true` if
    /// the search continues.
    fn report_progress(&mut self, states: u64, new: Option<(&EvaluatedPlan, &str)>) -> bool {
        let progress = PlanProgress {
            plan: new.map(|(judged, _)| &judged.candidate.plan),
            makespan: new.map(|(judged, _)| &judged.makespan),
            metric: None,
            value: new.map(|(_, worth)| worth),
            plans: self.plans,
            states: Some(states),
            memory: None,
        };
        self.watcher.notice(&Event::Plan(progress));
        match self.watcher.flow() {
            ControlFlow::Continue(()) => true,
            ControlFlow::Break(halt) => {
                self.stop_request = Some(halt);
                false
            }
        }
    }
}
