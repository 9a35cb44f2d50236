//! Values of plans by an objective.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::Objective;
use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::RunSettings;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::makespan::last_end;
use elbowroom_probability::Likelihoods;
use elbowroom_report::statistics::Proportion;

use super::{BestPlanRequest, PlanAim, PlanValue};
use crate::answers::envelope::{EnvelopeFinding, EnvelopeRequest, Search, envelope};
use crate::answers::plan::SearchMonitor;
use crate::answers::{Observer, RequestError, StopRequest};
use crate::execute::{Candidate, RolloutSession, Rollouts};
use crate::pipeline;

/// Number of samples after each round. A plan that is significantly behind the best one gets no
/// further samples.
const ROUNDS: [u64; 5] = [50, 100, 200, 400, 1000];

/// A plan with its value.
pub(super) struct EvaluatedPlan {
    pub(super) candidate: Candidate,
    pub(super) makespan: Rational,
    pub(super) value: Value,
}

impl EvaluatedPlan {
    pub(super) fn unknown(candidate: Candidate, why: &str) -> Self {
        Self {
            makespan: last_end(&candidate.plan),
            candidate,
            value: Value::Unknown(why.to_owned()),
        }
    }

    /// Returns `true` if this plan has a greater value, or the same value and a shorter makespan.
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        let rank = |value: &Value| match value {
            Value::Unknown(_) => None,
            Value::Slack(slack) => Some(slack.clone()),
            Value::Samples(results) => {
                let successes = results.iter().filter(|success| **success).count();
                let of = i64::try_from(results.len().max(1)).unwrap_or(i64::MAX);
                Some(Rational::new(
                    i64::try_from(successes).unwrap_or(i64::MAX),
                    of,
                ))
            }
        };
        let (own, theirs) = (rank(&self.value), rank(&other.value));
        match own.cmp(&theirs) {
            std::cmp::Ordering::Equal => self.makespan < other.makespan,
            ordering => ordering.is_gt() && !self.value.was_dropped(&other.value),
        }
    }
}

/// Value of a plan.
pub(super) enum Value {
    Slack(Rational),
    Samples(Vec<bool>),
    Unknown(String),
}

impl Value {
    /// Returns `true` if it has fewer samples than `other`, because it was behind.
    fn was_dropped(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Samples(own), Self::Samples(other)) => own.len() < other.len(),
            _ => false,
        }
    }

    pub(super) fn to_plan_value(&self) -> PlanValue {
        match self {
            Self::Slack(slack) => PlanValue::Slack {
                slack: slack.clone(),
            },
            Self::Unknown(why) => PlanValue::Unknown { why: why.clone() },
            Self::Samples(results) => {
                let mut share = Proportion::default();
                for success in results {
                    share.add(*success);
                }
                PlanValue::Sampled {
                    successes: share.successes,
                    samples: share.count,
                    interval: share.wilson(),
                }
            }
        }
    }
}

/// Evaluates plans.
pub(super) enum PlanEvaluator<'a> {
    Slack(Arc<Task>),
    Probability(Box<RolloutSession<'a>>),
}

impl PlanEvaluator<'_> {
    pub(super) fn of(request: &BestPlanRequest<'_>, task: &Task) -> Self {
        match request.aim {
            PlanAim::Slack => Self::Slack(Arc::new(task.clone())),
            PlanAim::Probability(world) => {
                let rollouts = Rollouts {
                    world: Arc::new(world.clone()),
                    executor: ExecutorSpec::default(),
                    settings: RunSettings::default(),
                    flow: pipeline::Settings::default(),
                    likelihoods: Arc::new(Likelihoods::certain()),
                    replanning: None,
                    is_ready: true,
                };
                Self::Probability(Box::new(RolloutSession::new(
                    task,
                    rollouts,
                    u64::MAX,
                    &|| true,
                )))
            }
        }
    }

    /// Returns the value of a plan; `None` if the watcher stopped the evaluation. `best` is the
    /// value of the best plan so far.
    pub(super) fn value(
        &mut self,
        plan: &TimeTriggeredPlan,
        best: Option<&Value>,
        course: &mut SearchMonitor<'_>,
    ) -> Option<Value> {
        match self {
            Self::Slack(task) => slack(task, plan, course),
            Self::Probability(tryout) => samples(tryout, plan, best, course),
        }
    }
}

fn slack(
    task: &Arc<Task>,
    plan: &TimeTriggeredPlan,
    course: &mut SearchMonitor<'_>,
) -> Option<Value> {
    let settings = pipeline::Settings {
        search: Search::best(Objective::LeastSlack),
        ..pipeline::Settings::default()
    };
    let request = EnvelopeRequest::new(task, plan.clone()).with_settings(&settings);
    let outcome = envelope(&request, &mut SilentMonitor(course));
    if course.stop_request.is_some() {
        return None;
    }
    let finding = match outcome {
        Ok(outcome) => outcome.answer.finding,
        Err(RequestError::Unsupported(why)) => return Some(Value::Unknown(why)),
        Err(error) => return Some(Value::Unknown(error.to_string())),
    };
    Some(match finding {
        EnvelopeFinding::Envelope {
            best: Some(best), ..
        } => Value::Slack(best.value),
        EnvelopeFinding::Envelope { .. } => {
            Value::Unknown("no quantity of the plan may deviate".to_owned())
        }
        _ => Value::Unknown("the plan has no envelope".to_owned()),
    })
}

fn samples(
    tryout: &mut RolloutSession<'_>,
    plan: &TimeTriggeredPlan,
    best: Option<&Value>,
    course: &mut SearchMonitor<'_>,
) -> Option<Value> {
    let best = match best {
        Some(Value::Samples(results)) => results.as_slice(),
        _ => &[],
    };
    let mut results = Vec::new();
    for most in ROUNDS {
        for sample in results.len() as u64..most {
            if !course.report_progress(0, None) {
                return None;
            }
            results.push(tryout.succeeds(plan, sample));
        }
        if elbowroom_selection::is_behind(&results, best) {
            break;
        }
    }
    Some(Value::Samples(results))
}

/// Watcher without progress events, for the search inside a comparison.
struct SilentMonitor<'q, 'w>(&'q mut SearchMonitor<'w>);

impl Observer for SilentMonitor<'_, '_> {
    fn elapsed(&mut self) -> std::time::Duration {
        self.0.watcher.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        let flow = self.0.watcher.flow();
        if let ControlFlow::Break(halt) = flow {
            self.0.stop_request = Some(halt);
        }
        flow
    }
}
