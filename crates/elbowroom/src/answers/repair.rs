//! Repairs: the cheapest changes that make a plan work.

mod descriptions;
mod subject;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::pinning;
use elbowroom_envelope::{
    Guarantee, Oracle, Repair, RepairLimits, RepairRun, repair as cheapest, with_obligations,
};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::parametrize::VarySpec;
use elbowroom_plan::{Constraint, DecoupledEnvelope, ParametrizedPlan, Schedule, Valuation};
use serde::{Deserialize, Serialize};

use super::plan::PlanStep;
use super::{Exact, Observer, RequestError, StopRequest, Version, exact};
use crate::AnyPlan;
use crate::pipeline::{self, PipelineError};
use subject::Subject;

/// Work limit of a search through other orders, in linear programs times the square of the number
/// of time points.
const OTHER_ORDERS_WORK: usize = 200_000;

/// Requests the cheapest change that makes a plan work.
#[derive(Clone, Debug)]
pub struct RepairRequest {
    /// The problem.
    pub task: Arc<Task>,
    /// The plan, valid or not.
    pub plan: AnyPlan,
    /// The name of the plan in the answer, such as its file.
    pub name: String,
    /// Quantities that may change. The weight is the cost per unit of change; values stay inside
    /// the range. If empty, these may change: durations, also beyond the domain's limits (weight
    /// 2); times of timed initials (weight 1); and the parameters and bounds of an STN plan file
    /// (weight 1, lower bounds 10).
    pub change: Vec<VarySpec>,
    /// Exceptions from `change`: quantities that may not change.
    pub keep: Vec<VarySpec>,
    /// The required guarantee of the repaired plan at its nominal values.
    pub guarantee: Guarantee,
}

impl RepairRequest {
    /// Requests the cheapest repair of a plan with the default quantities.
    pub fn new(task: &Arc<Task>, plan: impl Into<AnyPlan>) -> Self {
        Self {
            task: Arc::clone(task),
            plan: plan.into(),
            name: String::new(),
            change: Vec::new(),
            keep: Vec::new(),
            guarantee: Guarantee::default(),
        }
    }
}

/// The answer, with the repaired problem and plan.
#[derive(Clone, Debug)]
pub struct RepairOutcome {
    /// The answer as a document (`docs/reference/formats/repair-json.md`).
    pub answer: RepairAnswer,
    /// The changed problem, and the plan with times for it, which the validator accepts; `None`
    /// without a repair.
    pub repaired: Option<(Task, TimeTriggeredPlan)>,
}

/// The cheapest change that makes a plan work: `docs/reference/formats/repair-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RepairAnswer {
    /// Format of the document.
    pub format: RepairFormat,
    /// Version of the document.
    pub version: Version,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
    /// The name of the plan, as the request gives it.
    pub plan: String,
    /// The least separation of interfering happenings (ε).
    #[serde(with = "exact")]
    pub epsilon: Rational,
    /// The requested guarantee.
    pub guarantee: Guarantee,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: RepairFinding,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum RepairFormat {
    /// The name `elbowroom-repair`.
    #[default]
    #[serde(rename = "elbowroom-repair")]
    Repair,
}

/// The result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum RepairFinding {
    /// The plan works after these changes. No changes that cost less make it work in the `orders`
    /// searched.
    Repaired {
        /// The changes; empty if other times for the actions are sufficient.
        changes: Vec<Change>,
        /// Cost of the changes: the sum of weight times deviation.
        #[serde(with = "exact")]
        cost: Rational,
        /// Lower bound on the cost of repairs: the cost, or its infimum.
        #[serde(with = "exact")]
        bound: Rational,
        /// The bounds and conditions that determine the cost, in words.
        because: Vec<String>,
        /// Bounds that an STN plan needs in addition, because some of its schedules are not valid.
        /// They cost nothing.
        keeps: Vec<String>,
        /// The reason why the repaired plan, which is valid, does not have the requested guarantee;
        /// `None` if it has.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        not_guaranteed: Option<String>,
        /// The plan with the times that the validator has accepted.
        steps: Vec<PlanStep>,
        /// Number of solved linear programs; 0 if no change was necessary.
        cases: usize,
        /// The searched orders of interfering actions. No repair in them is cheaper.
        #[serde(default)]
        orders: Orders,
        /// `true` if interfering actions have another order than in the plan.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        reordered: bool,
    },
    /// No allowed change makes the plan work.
    Impossible {
        /// The bounds and conditions that prevent it, in words.
        because: Vec<String>,
        /// The searched orders of interfering actions.
        #[serde(default)]
        orders: Orders,
    },
    /// The search ended without a result.
    None {
        /// The reason for the end of the search.
        reason: String,
        /// Lower bound on the cost of repairs.
        #[serde(with = "exact")]
        bound: Rational,
    },
}

/// The orders of interfering actions that a search for a repair has covered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Orders {
    /// The order of the plan. Other orders were not searched to the end.
    #[default]
    Kept,
    /// All orders; for an STN plan, all that its bounds allow.
    All,
}

/// A quantity that changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The quantity, in words.
    pub quantity: String,
    /// Its value, or the nearest of several allowed values.
    #[serde(with = "exact")]
    pub from: Rational,
    /// Its new value.
    #[serde(with = "exact")]
    pub to: Rational,
    /// Cost per unit of the change.
    #[serde(with = "exact")]
    pub weight: Rational,
}

/// Finds the cheapest change that makes a plan work.
///
/// The search first keeps the plan's order of interfering actions. Timed initials may come before
/// or after them. If that costs anything, other orders are searched, within a limit, and the answer
/// names the orders that it covers. The repair is checked: the validator accepts the plan for the
/// changed problem, and the box check accepts its values.
///
/// # Errors
/// When the request names quantities that the plan does not have, or the plan is beyond exact analysis.
pub fn repair(
    request: &RepairRequest,
    watcher: &mut dyn Observer,
) -> Result<RepairOutcome, RequestError> {
    if let AnyPlan::TimeTriggered(plan) = &request.plan
        && pipeline::validate_plan(&request.task, plan).is_valid()
    {
        return Ok(unchanged_outcome(request, plan));
    }
    let subject = Subject::new(request)?;
    let mut halt = None;
    let mut go_on = || watcher.flow().map_break(|why| halt = Some(why));
    let limits = RepairLimits::default();
    let times = subject.times.as_ref();
    let run = subject.search(times, &limits, &mut go_on)?;
    if times.is_none() {
        return Ok(subject.outcome_of(request, run, (Orders::All, false), halt));
    }
    // Search other orders for a cheaper repair, and record whether all of them were searched.
    let below = match &run {
        RepairRun::Repaired { repair, .. } => Some(repair.cost.clone()),
        _ => None,
    };
    let is_free = below.as_ref().is_some_and(Rational::is_zero);
    if is_free || matches!(run, RepairRun::Stopped { .. }) {
        let orders = if is_free { Orders::All } else { Orders::Kept };
        return Ok(subject.outcome_of(request, run, (orders, false), halt));
    }
    let limits = subject.limits_of_other_orders(below.clone());
    let (run, orders) = match subject.search(None, &limits, &mut go_on) {
        Ok(other @ RepairRun::Repaired { .. }) => (other, (Orders::All, true)),
        Ok(RepairRun::Impossible { because }) if below.is_none() => {
            (RepairRun::Impossible { because }, (Orders::All, false))
        }
        Ok(RepairRun::Stopped { bound, .. }) if below.is_some_and(|below| bound >= below) => {
            (run, (Orders::All, false))
        }
        _ => (run, (Orders::Kept, false)),
    };
    Ok(subject.outcome_of(request, run, orders, None))
}

/// Builds the answer of an interrupted search, which has no partial result.
pub fn partial_result(request: &RepairRequest, halt: StopRequest) -> RepairOutcome {
    outcome(request, stopped(Some(halt), Rational::ZERO), None)
}

fn stopped(halt: Option<StopRequest>, bound: Rational) -> RepairFinding {
    RepairFinding::None {
        reason: match halt {
            Some(StopRequest::TimeLimit) => "the time limit was reached".to_owned(),
            Some(StopRequest::MemoryLimit) => "the memory limit was reached".to_owned(),
            Some(StopRequest::Cancelled) => "it was cancelled".to_owned(),
            None => "there are too many cases to decide".to_owned(),
        },
        bound,
    }
}

/// Builds the answer for a valid plan, which keeps its times.
fn unchanged_outcome(request: &RepairRequest, plan: &TimeTriggeredPlan) -> RepairOutcome {
    let promise = check_guarantee(request, &request.task, plan);
    let finding = RepairFinding::Repaired {
        changes: Vec::new(),
        cost: Rational::ZERO,
        bound: Rational::ZERO,
        because: Vec::new(),
        keeps: Vec::new(),
        not_guaranteed: promise.missing_reason,
        steps: steps(plan),
        cases: 0,
        orders: Orders::All,
        reordered: false,
    };
    let repaired = ((*request.task).clone(), plan.clone());
    outcome(request, finding, Some(repaired))
}

fn outcome(
    request: &RepairRequest,
    finding: RepairFinding,
    repaired: Option<(Task, TimeTriggeredPlan)>,
) -> RepairOutcome {
    RepairOutcome {
        answer: RepairAnswer {
            format: RepairFormat::Repair,
            version: Version,
            domain: request.task.problem().domain.clone(),
            problem: request.task.problem().name.clone(),
            plan: request.name.clone(),
            epsilon: request.task.epsilon().clone(),
            guarantee: request.guarantee,
            finding,
        },
        repaired,
    }
}

/// Additional bounds of a repaired plan, and the reason for a missing guarantee.
#[derive(Default)]
struct RepairGuarantee {
    added_bounds: Vec<String>,
    missing_reason: Option<String>,
}

/// Deorders the plan, and checks its guarantee at the nominal values.
fn check_guarantee(
    request: &RepairRequest,
    task: &Task,
    plan: &TimeTriggeredPlan,
) -> RepairGuarantee {
    let task = Arc::new(task.clone());
    let opened = pipeline::free(&task, plan).and_then(|freed| pipeline::open(&task, freed, &[]));
    let why_not = match opened {
        Ok(opened) => nominal_objection(&task, &Arc::new(opened), request.guarantee),
        Err(error) => Some(error.to_string()),
    };
    RepairGuarantee {
        missing_reason: why_not,
        ..RepairGuarantee::default()
    }
}

/// Returns the objection to the plan's nominal values, if there is one.
fn nominal_objection(
    task: &Arc<Task>,
    plan: &Arc<ParametrizedPlan>,
    guarantee: Guarantee,
) -> Option<String> {
    let point = DecoupledEnvelope::point(&plan.nominal());
    let oracle = Oracle::new(task, plan, guarantee);
    let objection = oracle.and_then(|mut oracle| oracle.objection(&point));
    match objection {
        Ok(None) => None,
        Ok(Some(objection)) => Some(objection.to_string()),
        Err(refusal) => Some(refusal.to_string()),
    }
}

impl Subject {
    /// Searches for the cheapest repair. If there are `times`, interfering actions keep their
    /// order.
    fn search(
        &self,
        times: Option<&Schedule>,
        limits: &RepairLimits,
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<RepairRun, PipelineError> {
        let mut judged = |values: &Valuation, schedule: &Schedule| {
            let (task, plan) = self.repaired(values, schedule);
            pipeline::validate_plan(&task, &plan).is_valid()
        };
        let run = cheapest(
            &self.task,
            &self.plan,
            times,
            &self.changeable,
            limits,
            &mut judged,
            flow,
        );
        run.map_err(PipelineError::Refused)
    }

    /// Returns the limits of a search through other orders for a repair cheaper than `below`. More
    /// time points make each linear program slower, so fewer are solved.
    fn limits_of_other_orders(&self, below: Option<Rational>) -> RepairLimits {
        let points = self.plan.plan.nodes.len().max(1);
        RepairLimits {
            cases: (OTHER_ORDERS_WORK / (points * points)).clamp(10, 1_000),
            cost_limit: below,
        }
    }

    fn outcome_of(
        &self,
        request: &RepairRequest,
        run: RepairRun,
        (orders, reordered): (Orders, bool),
        halt: Option<StopRequest>,
    ) -> RepairOutcome {
        let mut repaired = None;
        let finding = match run {
            RepairRun::Repaired { repair, cases } => {
                let (task, plan) = self.repaired(&repair.values, &repair.schedule);
                let promise = match &self.times {
                    Some(_) => check_guarantee(request, &task, &plan),
                    None => self.check_network_guarantee(request, &repair.values, &repair.schedule),
                };
                let because = self.cost_reasons(&repair);
                let Repair { cost, bound, .. } = repair;
                let finding = RepairFinding::Repaired {
                    changes: self.changes(&repair.values),
                    because,
                    cost,
                    bound,
                    keeps: promise.added_bounds,
                    not_guaranteed: promise.missing_reason,
                    steps: steps(&plan),
                    cases,
                    orders,
                    reordered,
                };
                repaired = Some((task, plan));
                finding
            }
            RepairRun::Impossible { because } => RepairFinding::Impossible {
                because: self.hindrances(&because),
                orders,
            },
            RepairRun::Unexplained { values, schedule } => {
                let (task, plan) = self.repaired(&values, &schedule);
                let why = match pipeline::validate_plan(&task, &plan) {
                    elbowroom_model::Verdict::Invalid(violation) => violation.to_string(),
                    _ => "the validator rejects the plan".to_owned(),
                };
                RepairFinding::Impossible {
                    because: vec![format!("{why}; repair does not take this into account")],
                    orders,
                }
            }
            RepairRun::Stopped { bound, .. } => stopped(halt, bound),
        };
        outcome(request, finding, repaired)
    }

    /// Checks the guarantee of an STN plan with these values, and finds the additional bounds that
    /// it needs.
    fn check_network_guarantee(
        &self,
        request: &RepairRequest,
        values: &Valuation,
        schedule: &Schedule,
    ) -> RepairGuarantee {
        let mut plan = self.plan.clone();
        let own = plan.parameters.iter_mut().zip(values).enumerate();
        for (index, (parameter, value)) in own {
            parameter.nominal = value.clone();
            if index >= self.own_parameters {
                // Parameters that were opened for the repair are fixed again.
                parameter.range = Interval::point(value.clone());
            }
        }
        let task = Arc::new(self.task.clone());
        let objected = |plan: &ParametrizedPlan| {
            nominal_objection(&task, &Arc::new(plan.clone()), request.guarantee)
        };
        let Some(why_not) = objected(&plan) else {
            return RepairGuarantee::default();
        };
        let bounded = with_obligations(&task, &plan).map(|(plan, _)| plan);
        let pinned = || Ok::<_, Refusal>(pinning::pin(&task, &plan, schedule));
        let bounded = bounded.into_iter().chain(pinned());
        let mut works = bounded.filter(|bounded| objected(bounded).is_none());
        let Some(bounded) = works.next() else {
            return RepairGuarantee {
                missing_reason: Some(why_not),
                ..RepairGuarantee::default()
            };
        };
        let is_new = |own: &&Constraint| !plan.plan.constraints.contains(own);
        let new = bounded.plan.constraints.iter().filter(is_new);
        RepairGuarantee {
            added_bounds: new.filter_map(|own| self.bound(own)).collect(),
            missing_reason: None,
        }
    }
}

fn steps(plan: &TimeTriggeredPlan) -> Vec<PlanStep> {
    let steps = plan.steps.iter().map(|step| PlanStep {
        start: Exact(step.start.clone()),
        action: step.action.name.clone(),
        duration: step.duration.clone().map(Exact),
    });
    steps.collect()
}
