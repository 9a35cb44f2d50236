//! Failures: how many failed attempts a plan affords, and how much longer durations may be with
//! them.

mod proof;

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::faults::{
    FaultLimit, FaultNetwork, FaultVerdict, MAX_FAULTS, NotRetriable, decide, fault_limit,
    retriable,
};
use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::{BestSettings, Guarantee, Oracle};
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{DecoupledEnvelope, Parameter, ParameterKind, ParametrizedPlan};
use serde::{Deserialize, Serialize};

use super::envelope::{EnvelopeFinding, EnvelopeRequest, NominalFailure, envelope};
use super::{Observer, RequestError, Version, exact};
use crate::pipeline::PipelineError;

pub use proof::{FaultProof, ProofAttempt, ProofRequirement, ProofStep};

/// Number of steps per unit of the searched slack: it is a multiple of 0.1 %.
const STEPS: i64 = 1000;
/// Greatest number of rows of the table.
const MAX_ROWS: usize = 12;

/// Requests the number of failures that a plan affords.
#[derive(Clone, Debug)]
pub struct FaultsRequest {
    /// The plan, and the search for its box. The guarantee has to be dynamic, and no box may be
    /// given.
    pub envelope: EnvelopeRequest,
    /// The number of failures to guarantee; `None` asks for the greatest.
    pub faults: Option<usize>,
    /// Greatest number of failures of each action; `None` is no limit but that on their sum.
    pub retries: Option<usize>,
    /// Least and greatest time from a failure to the next start of the action. Times below ε count
    /// as ε.
    pub recovery: [Rational; 2],
}

/// The failures that a plan affords: `docs/reference/formats/faults-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultsAnswer {
    /// Format of the document.
    pub format: FaultsFormat,
    /// Version of the document.
    pub version: Version,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
    /// The name of the plan, as the request gives it.
    pub plan: String,
    /// The requested number of failures; missing if the greatest was requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faults: Option<usize>,
    /// Greatest number of failures of each action; missing without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retries: Option<usize>,
    /// Least time from a failure to the next start.
    #[serde(with = "exact")]
    pub recovery_at_least: Rational,
    /// Greatest time from a failure to the next start.
    #[serde(with = "exact")]
    pub recovery_at_most: Rational,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: FaultsFinding,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultsFormat {
    /// The name `elbowroom-faults`.
    #[default]
    #[serde(rename = "elbowroom-faults")]
    Faults,
}

/// The result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum FaultsFinding {
    /// The plan works without failures.
    Faults(Box<Faults>),
    /// The plan fails as planned, without any failure.
    Fails {
        /// The reason.
        reason: String,
    },
    /// A limit was reached before there was a result.
    None {
        /// The reason for the end of the search.
        reason: String,
    },
}

/// The failures that a valid plan affords.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Faults {
    /// Failures if no action takes longer than planned.
    pub as_planned: Afforded,
    /// Failures in the box that `elbowroom envelope` prints.
    pub in_box: Afforded,
    /// For each number of failures the slack that is left.
    pub table: Vec<FaultRow>,
    /// The names of durations that no box lets be longer than planned, such as those that the
    /// domain ties to an amount. They stay as planned in the rows of the table.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_longer: Vec<String>,
    /// Actions without retries.
    pub without_retries: Vec<WithoutRetries>,
    /// The box for the requested number of failures, or for the greatest one.
    pub box_with_faults: Vec<FaultInterval>,
    /// The number of failures of that box.
    pub box_faults: Option<usize>,
    /// Proof that the box allows that many failures, or failures that defeat the requested number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<FaultProof>,
    /// Actions whose failures defeat every strategy, with their numbers of failures: one more
    /// failure than affordable, or the requested number.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub defeated_by: Vec<FailedAction>,
}

/// Bounds on the number of failures that one strategy survives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Afforded {
    /// It survives so many.
    pub at_least: Option<usize>,
    /// No strategy survives more; missing if that is not proved.
    pub at_most: Option<usize>,
    /// The greatest number that was searched.
    pub searched: usize,
}

/// A row of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultRow {
    /// Number of failures.
    pub faults: usize,
    /// Slack of all durations except [`Faults::not_longer`], as a share of the planned ones: a multiple
    /// of 0.1 %.
    #[serde(with = "exact")]
    pub slack: Rational,
    /// `true` if it is proved that 0.1 % more is too much.
    pub exact: bool,
}

/// An action without retries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WithoutRetries {
    /// The action.
    pub action: String,
    /// The reason.
    pub reason: String,
}

/// An action with its number of failures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailedAction {
    /// The action.
    pub action: String,
    /// The number of failures.
    pub failures: usize,
}

/// An interval of a box with failures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultInterval {
    /// The name of the parameter.
    pub name: String,
    /// The action, if the parameter is a duration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<String>,
    /// The planned value.
    #[serde(with = "exact")]
    pub nominal: Rational,
    /// The least value.
    #[serde(with = "exact")]
    pub lower: Rational,
    /// The greatest value.
    #[serde(with = "exact")]
    pub upper: Rational,
}

/// Computes the number of failures that a plan affords, and the slack that is left.
///
/// A plan that does not work is an answer, not an error.
///
/// # Errors
/// When the request names quantities that the plan does not have, requests another guarantee than
/// the dynamic one, or the plan is beyond exact analysis.
pub fn faults(
    request: &FaultsRequest,
    watcher: &mut dyn Observer,
) -> Result<FaultsAnswer, RequestError> {
    let task = &request.envelope.task;
    if request.envelope.guarantee != Guarantee::Dynamic {
        let message = "failures need the dynamic guarantee: an executor observes them";
        return Err(RequestError::Unsupported(message.to_owned()));
    }
    if let Some(feature) = task.validator_only_feature() {
        let message = format!("the problem has {feature}, for which failures are not supported");
        return Err(RequestError::Unsupported(message));
    }
    let outcome = envelope(&request.envelope, watcher)?;
    let finding = match (&outcome.answer.finding, &outcome.plan, &outcome.envelope) {
        (EnvelopeFinding::Fails(failing), ..) => FaultsFinding::Fails {
            reason: match failing {
                NominalFailure::Invalid { violation } => violation.message.clone(),
                NominalFailure::AsPlanned { counterexample, .. } => counterexample.message.clone(),
            },
        },
        (_, Some(plan), Some(found)) => finding(request, plan, found, watcher)?,
        _ => interrupted(),
    };
    Ok(answer(request, finding))
}

/// Returns the answer of a search that was ended early.
pub fn partial_result(request: &FaultsRequest) -> FaultsAnswer {
    answer(request, interrupted())
}

fn interrupted() -> FaultsFinding {
    FaultsFinding::None {
        reason: "the search was ended before there was a result".to_owned(),
    }
}

fn answer(request: &FaultsRequest, finding: FaultsFinding) -> FaultsAnswer {
    let problem = request.envelope.task.problem();
    let [at_least, at_most] = recovery(request);
    FaultsAnswer {
        format: FaultsFormat::Faults,
        version: Version,
        domain: problem.domain.clone(),
        problem: problem.name.clone(),
        plan: request.envelope.name.clone(),
        faults: request.faults,
        retries: request.retries,
        recovery_at_least: at_least,
        recovery_at_most: at_most,
        finding,
    }
}

/// Returns the recovery: a failure and the next start interfere, so it takes ε at least.
fn recovery(request: &FaultsRequest) -> [Rational; 2] {
    let epsilon = request.envelope.task.epsilon();
    let most = |time: &Rational| time.clone().max(epsilon.clone());
    [most(&request.recovery[0]), most(&request.recovery[1])]
}

/// The plan with its box, and the failures of its actions.
struct Subject<'a> {
    request: &'a FaultsRequest,
    plan: &'a Arc<ParametrizedPlan>,
    found: &'a DecoupledEnvelope,
    retries: Vec<usize>,
}

impl Subject<'_> {
    /// Returns the box whose durations exceed the planned ones by at most a share, in steps, unless
    /// they [cannot be longer](Self::cannot_be_longer). Their lower ends are those of the box found.
    fn longer(&self, steps: i64) -> DecoupledEnvelope {
        let factor = Rational::new(STEPS + steps, STEPS);
        let pairs = self.plan.parameters.iter().zip(self.found.intervals());
        let intervals = pairs.map(|(parameter, found)| {
            if !matches!(parameter.kind, ParameterKind::Duration(_)) {
                return Interval::point(parameter.nominal.clone());
            }
            let longer = if Self::cannot_be_longer(parameter, found) {
                parameter.nominal.clone()
            } else {
                &parameter.nominal * &factor
            };
            let upper = match parameter.range.upper.value() {
                Some(most) if *most < longer => parameter.range.upper.clone(),
                _ => End::Closed(longer),
            };
            Interval {
                lower: found.lower.clone(),
                upper,
            }
        });
        DecoupledEnvelope::new(self.plan, intervals.collect())
            .expect("an interval for each parameter")
    }

    /// Returns `true` if the box found does not exceed the planned duration.
    fn cannot_be_longer(parameter: &Parameter, found: &Interval) -> bool {
        found.upper.value() == Some(&parameter.nominal)
    }

    /// Returns the names of the durations that cannot be longer.
    fn not_longer(&self) -> Vec<String> {
        let pairs = self.plan.parameters.iter().zip(self.found.intervals());
        let fixed = pairs.filter(|(parameter, found)| {
            matches!(parameter.kind, ParameterKind::Duration(_))
                && Self::cannot_be_longer(parameter, found)
        });
        fixed.map(|(parameter, _)| parameter.name.clone()).collect()
    }

    /// Returns the network in a box; `None` if nothing satisfies it.
    fn network(&self, envelope: &DecoupledEnvelope) -> Option<FaultNetwork> {
        FaultNetwork::new(self.plan, envelope, &self.retries, recovery(self.request)).ok()
    }

    /// Returns the retriable actions without retries, because the executor chooses their durations.
    fn chosen_durations(&self, envelope: &DecoupledEnvelope) -> Vec<WithoutRetries> {
        let Some(network) = self.network(envelope) else {
            return Vec::new();
        };
        let attempts = network.attempts.iter().filter(|own| own.retries > 0);
        let retried: BTreeSet<usize> = attempts.map(|own| own.start.index()).collect();
        let instances = self.plan.plan.instances.iter().enumerate();
        let chosen = instances.filter(|(index, _)| {
            let start = self.plan.plan.start((*index).into());
            self.retries[*index] > 0 && !retried.contains(&start.index())
        });
        chosen
            .map(|(_, instance)| WithoutRetries {
                action: instance.action.name.clone(),
                reason: NotRetriable::ChosenDuration.to_string(),
            })
            .collect()
    }

    fn limit(&self, envelope: &DecoupledEnvelope, watcher: &mut dyn Observer) -> Afforded {
        let most = self.request.faults.unwrap_or(MAX_FAULTS).min(MAX_FAULTS);
        let network = self.network(envelope);
        let limit = network.map(|network| {
            let mut flow = || match watcher.flow() {
                ControlFlow::Continue(()) => ControlFlow::Continue(()),
                ControlFlow::Break(_) => ControlFlow::Break(()),
            };
            fault_limit(&network, most, &mut flow)
        });
        let FaultLimit { at_least, at_most } = limit.unwrap_or(FaultLimit {
            at_least: None,
            at_most: None,
        });
        Afforded {
            at_least,
            at_most,
            searched: most,
        }
    }
}

fn finding(
    request: &FaultsRequest,
    plan: &Arc<ParametrizedPlan>,
    found: &DecoupledEnvelope,
    watcher: &mut dyn Observer,
) -> Result<FaultsFinding, RequestError> {
    let task = &request.envelope.task;
    let mut without_retries = Vec::new();
    let mut retries = Vec::new();
    for (instance, verdict) in plan.plan.instances.iter().zip(retriable(task, plan)) {
        retries.push(match verdict {
            Ok(()) => request.retries.unwrap_or(MAX_FAULTS),
            Err(reason) => {
                without_retries.push(WithoutRetries {
                    action: instance.action.name.clone(),
                    reason: reason.to_string(),
                });
                0
            }
        });
    }
    let subject = Subject {
        request,
        plan,
        found,
        retries,
    };
    let as_planned_box = subject.longer(0);
    without_retries.extend(subject.chosen_durations(&as_planned_box));
    let as_planned = subject.limit(&as_planned_box, watcher);
    let in_box = subject.limit(found, watcher);
    let mut oracle = Oracle::new(task, plan, Guarantee::Dynamic).map_err(PipelineError::Refused)?;
    let greatest = BestSettings::default().max_deviation * Rational::from(STEPS);
    let greatest = greatest.floor().as_small().map_or(0, |(steps, _)| steps);
    // The greatest slack at which every schedule is valid.
    let mut steps = greatest_step(greatest, &mut |steps| {
        let objection = Refusal::unless_interrupted(oracle.objection(&subject.longer(steps)));
        let is_inside = objection.map_err(PipelineError::Refused)? == Some(None);
        Ok(watcher.flow().is_continue() && is_inside)
    })?
    .unwrap_or(0);
    let valid = steps;
    let mut table = Vec::new();
    let mut last = None;
    let rows = as_planned.at_least.map_or(0, |most| most + 1).min(MAX_ROWS);
    let requested = request.faults.filter(|own| *own >= rows);
    let requested = requested.filter(|own| as_planned.at_least.is_some_and(|most| *own <= most));
    for faults in (0..rows).chain(requested) {
        let limit = steps;
        let reached = greatest_step(limit, &mut |steps| {
            let network = subject.network(&subject.longer(steps));
            Ok(watcher.flow().is_continue()
                && network.is_some_and(|own| decide(&own, faults) == FaultVerdict::Controllable))
        })?;
        let Some(reached) = reached else {
            break;
        };
        let is_exact = reached == valid || {
            let next = subject.network(&subject.longer(reached + 1));
            next.is_none_or(|own| matches!(decide(&own, faults), FaultVerdict::Defeated(..)))
        };
        steps = reached;
        table.push(FaultRow {
            faults,
            slack: Rational::new(reached, STEPS),
            exact: is_exact,
        });
        last = Some((faults, reached));
    }
    if watcher.flow().is_break() {
        return Ok(interrupted());
    }
    let defeated = (as_planned.at_most.map(|most| most + 1))
        .and_then(|k| Some((k, subject.network(&as_planned_box)?)))
        .and_then(|(k, network)| match decide(&network, k) {
            FaultVerdict::Defeated(failures, missed) => Some((network, k, failures, missed)),
            _ => None,
        });
    let is_refused = request.faults.is_some() && as_planned.at_least < request.faults;
    let proof = match &defeated {
        Some((network, k, _, missed)) if is_refused => missed
            .clone()
            .map(|missed| proof::defeat(plan, network, *k, missed)),
        _ => last.and_then(|(faults, steps)| {
            let network = subject.network(&subject.longer(steps))?;
            proof::layers(plan, &network, faults)
        }),
    };
    let defeated_by = defeated.map_or_else(Vec::new, |(network, _, failures, _)| {
        proof::failed_actions(plan, &network, &failures)
    });
    let box_with_faults = last.map_or_else(Vec::new, |(_, steps)| {
        intervals(plan, &subject.longer(steps))
    });
    Ok(FaultsFinding::Faults(Box::new(Faults {
        as_planned,
        in_box,
        table,
        not_longer: subject.not_longer(),
        without_retries,
        box_with_faults,
        box_faults: last.map(|(faults, _)| faults),
        proof,
        defeated_by,
    })))
}

/// Returns the greatest number of steps up to `most` for which `works` holds, which must then also
/// hold for all smaller ones. `None` if it does not hold for 0.
fn greatest_step(
    most: i64,
    works: &mut dyn FnMut(i64) -> Result<bool, RequestError>,
) -> Result<Option<i64>, RequestError> {
    if works(most)? {
        return Ok(Some(most));
    }
    if !works(0)? {
        return Ok(None);
    }
    let (mut good, mut bad) = (0, most);
    while good + 1 < bad {
        let middle = i64::midpoint(good, bad);
        if works(middle)? {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Ok(Some(good))
}

fn intervals(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Vec<FaultInterval> {
    let pairs = plan.parameters.iter().zip(envelope.intervals());
    let intervals = pairs.map(|(parameter, interval)| FaultInterval {
        name: parameter.name.clone(),
        action: match parameter.kind {
            ParameterKind::Duration(id) => Some(plan.plan.instance(id).action.name.clone()),
            _ => None,
        },
        nominal: parameter.nominal.clone(),
        lower: interval.lower.value().cloned().unwrap_or_default(),
        upper: interval.upper.value().cloned().unwrap_or_default(),
    });
    intervals.collect()
}
