//! Values of plans by an objective.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::Objective;
use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::RunSettings;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_probability::Likelihoods;
use elbowroom_report::statistics::Proportion;

use super::{BestPlanRequest, PlanAim, PlanWorth};
use crate::answers::envelope::{EnvelopeFinding, EnvelopeRequest, Search, envelope};
use crate::answers::plan::Course;
use crate::answers::{Halt, RequestError, Watcher};
use crate::execute::{Candidate, Rollouts, Tryout};
use crate::flow;
use crate::makespan::end;

/// Number of samples after each round. A plan that is significantly behind the best one gets no
/// further samples.
const ROUNDS: [u64; 5] = [50, 100, 200, 400, 1000];

/// A plan with its value.
pub(super) struct Judged {
    pub(super) candidate: Candidate,
    pub(super) makespan: Rational,
    pub(super) value: Value,
}

impl Judged {
    pub(super) fn unknown(candidate: Candidate, why: &str) -> Self {
        Self {
            makespan: end(&candidate.plan),
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

    pub(super) fn worth(&self) -> PlanWorth {
        match self {
            Self::Slack(slack) => PlanWorth::Slack {
                slack: slack.clone(),
            },
            Self::Unknown(why) => PlanWorth::Unknown { why: why.clone() },
            Self::Samples(results) => {
                let mut share = Proportion::default();
                for success in results {
                    share.add(*success);
                }
                PlanWorth::Sampled {
                    successes: share.successes,
                    samples: share.count,
                    interval: share.wilson(),
                }
            }
        }
    }
}

/// Evaluates plans.
pub(super) enum Judge<'a> {
    Slack(Arc<Task>),
    Probability(Box<Tryout<'a>>),
}

impl Judge<'_> {
    pub(super) fn of(request: &BestPlanRequest<'_>, task: &Task) -> Self {
        match request.aim {
            PlanAim::Slack => Self::Slack(Arc::new(task.clone())),
            PlanAim::Probability(world) => {
                let rollouts = Rollouts {
                    world: Arc::new(world.clone()),
                    executor: "live"
                        .parse::<ExecutorSpec>()
                        .unwrap_or_else(|_| ExecutorSpec::default()),
                    settings: RunSettings::default(),
                    flow: flow::Settings::default(),
                    likelihoods: Arc::new(Likelihoods::certain()),
                    replanning: None,
                    is_ready: true,
                };
                Self::Probability(Box::new(Tryout::new(task, rollouts, u64::MAX, &|| true)))
            }
        }
    }

    /// Returns the value of a plan; `None` if the watcher stopped the evaluation. `best` is the
    /// value of the best plan so far.
    pub(super) fn value(
        &mut self,
        plan: &TimeTriggeredPlan,
        best: Option<&Value>,
        course: &mut Course<'_>,
    ) -> Option<Value> {
        match self {
            Self::Slack(task) => slack(task, plan, course),
            Self::Probability(tryout) => samples(tryout, plan, best, course),
        }
    }
}

fn slack(task: &Arc<Task>, plan: &TimeTriggeredPlan, course: &mut Course<'_>) -> Option<Value> {
    let settings = flow::Settings {
        search: Search::best(Objective::LeastSlack),
        ..flow::Settings::default()
    };
    let request = EnvelopeRequest::new(task, plan.clone()).with_settings(&settings);
    let outcome = envelope(&request, &mut Quiet(course));
    if course.halt.is_some() {
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
            Value::Unknown("nothing in the plan may deviate".to_owned())
        }
        _ => Value::Unknown("the plan has no envelope".to_owned()),
    })
}

fn samples(
    tryout: &mut Tryout<'_>,
    plan: &TimeTriggeredPlan,
    best: Option<&Value>,
    course: &mut Course<'_>,
) -> Option<Value> {
    let best = match best {
        Some(Value::Samples(results)) => results.as_slice(),
        _ => &[],
    };
    let mut results = Vec::new();
    for most in ROUNDS {
        for sample in results.len() as u64..most {
            if !course.goes_on(0, None) {
                return None;
            }
            results.push(tryout.succeeds(plan, sample));
        }
        if crate::execute::is_behind(&results, best) {
            break;
        }
    }
    Some(Value::Samples(results))
}

/// Watcher without progress events, for the search inside a comparison.
struct Quiet<'q, 'w>(&'q mut Course<'w>);

impl Watcher for Quiet<'_, '_> {
    fn elapsed(&mut self) -> std::time::Duration {
        self.0.watcher.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        let flow = self.0.watcher.flow();
        if let ControlFlow::Break(halt) = flow {
            self.0.halt = Some(halt);
        }
        flow
    }
}
