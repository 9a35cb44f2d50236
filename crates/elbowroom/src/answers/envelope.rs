//! Envelopes: how far each quantity of a plan may deviate.

mod answer;
mod answer_builder;
mod best;
mod binding_constraints;
mod certificate;
mod conditions;
mod inequalities;
mod search;
mod shadow_prices;
pub mod timeline;
mod timeouts;
mod uniform_slack;
mod value_of_information;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::explain::{Explainer, Explanation};
use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::{Guarantee, Method, Objective, Oracle};
use elbowroom_execution::run::TimeoutRule;
use elbowroom_model::Task;
use elbowroom_plan::deorder::DeorderError;
use elbowroom_plan::parametrize::VarySpec;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};
use elbowroom_selection::timeouts::unknown_action;
use elbowroom_sim::WorldModel;

use super::{Observer, RequestError, StopRequest};
use crate::pipeline::{self, PipelineError};
use crate::{AnyPlan, parse_box};

pub use elbowroom_selection::Search;

pub use answer::{
    ActionTimes, ChosenDuration, Counterexample, EnvelopeAnswer, EnvelopeFinding, EnvelopeFormat,
    EnvelopeSettings, LimitGroup, LimitedRange, Makespans, NominalFailure, Quantity, QuantityKind,
    Range, Stop, WideningStep,
};
pub(crate) use answer_builder::quantities;
pub use best::{Best, Probability};
pub use conditions::Conditions;
pub use inequalities::{Inequalities, NetworkRow, RequirementRow};
pub use shadow_prices::{Relax, ShadowPrices};
pub use timeline::Timeline;
pub use uniform_slack::{Deviation, UniformSlack};
pub use value_of_information::ValueOfInformation;

/// Requests the envelope of a plan, or checks whether a box lies inside it.
#[derive(Clone, Debug)]
pub struct EnvelopeRequest {
    /// The problem.
    pub task: Arc<Task>,
    /// The plan.
    pub plan: AnyPlan,
    /// The name of the plan in the answer, such as its file.
    pub name: String,
    /// Quantities to leave open; if empty, all durations that the domain fixes. An STN plan may
    /// leave some open itself.
    pub vary: Vec<VarySpec>,
    /// The guarantee inside the envelope.
    pub guarantee: Guarantee,
    /// `true` if the dispatcher enforces the obligations that are bounds on differences of times
    /// ([`elbowroom_envelope::with_obligations`]).
    pub enforce: bool,
    /// The rule that sets the time-out of each action. The plan works as long as each quantity
    /// stays inside its interval *and* each action ends before its time-out. A box to check must
    /// not exceed the time-outs.
    pub timeout: TimeoutRule,
    /// A box to check, in the syntax of [`parse_box`]: `d0=[5,30] d1=[10,20]`. Without one, the
    /// request searches for a large box inside the envelope.
    pub contains: Option<String>,
    /// Settings of the search.
    pub search: Search,
    /// World whose distributions of durations [`Objective::Probability`] uses.
    pub world: Option<Arc<WorldModel>>,
}

/// IRR was requested with an objective, which only the largest box has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("IRR has no objective")]
pub struct IrrHasNoObjective;

/// Returns the objective of the box in a run for the given options; `None` if the box is that of IRR.
///
/// # Errors
/// When the options contradict each other.
pub fn objective_of(
    method: Option<Method>,
    objective: Option<Objective>,
    has_precision: bool,
) -> Result<Option<Objective>, IrrHasNoObjective> {
    match (method, objective) {
        (Some(Method::Irr), Some(_)) => Err(IrrHasNoObjective),
        (Some(Method::Irr), None) => Ok(None),
        (None, None) if has_precision => Ok(None),
        (_, objective) => Ok(Some(objective.unwrap_or_default())),
    }
}

/// The answer, with the plan and the box that it is about.
#[derive(Clone, Debug)]
pub struct EnvelopeOutcome {
    /// The answer as a document.
    pub answer: EnvelopeAnswer,
    /// The plan with its open quantities; `None` if the validator rejects the plan as it is.
    pub plan: Option<Arc<ParametrizedPlan>>,
    /// The box inside the envelope; `None` if there is none, or if the request had another aim.
    pub envelope: Option<DecoupledEnvelope>,
    /// The reason why the plan fails as planned, or in the given box.
    pub explanation: Option<Explanation>,
}

impl EnvelopeRequest {
    /// Requests the envelope of a plan with the default search. All durations are open that the
    /// domain fixes.
    pub fn new(task: &Arc<Task>, plan: impl Into<AnyPlan>) -> Self {
        Self {
            task: Arc::clone(task),
            plan: plan.into(),
            name: String::new(),
            vary: Vec::new(),
            guarantee: Guarantee::default(),
            enforce: false,
            timeout: TimeoutRule::default(),
            contains: None,
            search: Search::default(),
            world: None,
        }
    }

    /// Returns the algorithm of the search.
    pub(crate) fn method(&self) -> Method {
        self.search.method_for(&self.task)
    }

    /// Replaces the open quantities and the guarantee by those of `settings`.
    #[must_use]
    pub fn with_settings(mut self, settings: &pipeline::Settings) -> Self {
        self.vary.clone_from(&settings.vary);
        self.guarantee = settings.guarantee;
        self.timeout.clone_from(&settings.timeout);
        self.search.clone_from(&settings.search);
        self.world.clone_from(&settings.world);
        self
    }
}

/// Computes how far each quantity may deviate, or checks whether a box lies inside the envelope.
///
/// A plan that does not work is an answer, not an error. If the watcher ends the search, the answer
/// is the box found so far.
///
/// # Errors
/// When the request names quantities that the plan does not have, or the plan is beyond exact analysis.
pub fn envelope(
    request: &EnvelopeRequest,
    watcher: &mut dyn Observer,
) -> Result<EnvelopeOutcome, RequestError> {
    if let Some(mistake) = unknown_action(&request.timeout, request.task.problem()) {
        return Err(RequestError::Timeout(mistake));
    }
    let opened = if request.method() == Method::Best {
        parametrized_plan(request)
    } else {
        parametrized_plan_with_autonomous(request)
    };
    let (plan, enforced) = match opened {
        Ok((plan, enforced)) => (Arc::new(plan), enforced),
        Err(PipelineError::Invalid(violation)) => {
            let violation = (&*violation).into();
            let failing = NominalFailure::Invalid { violation };
            return Ok(EnvelopeOutcome {
                answer: EnvelopeAnswer::new(request, EnvelopeFinding::Fails(failing)),
                plan: None,
                envelope: None,
                explanation: None,
            });
        }
        Err(error) => return Err(error.into()),
    };
    let subject = Subject {
        request,
        plan: &plan,
        enforced,
        explainer: Explainer::new(&request.task, &plan),
    };
    let oracle = Oracle::new(&request.task, &plan, request.guarantee);
    let oracle = oracle.map_err(PipelineError::Refused)?;
    let nominal = plan.nominal();
    if plan.plan.network(&nominal).consistency().is_err() {
        return Ok(subject.failure_outcome(subject.explainer.no_schedule(&nominal)));
    }
    if let Some(counterexample) = subject.planned_timeout() {
        let failing = NominalFailure::AsPlanned {
            parameters: subject.quantities(),
            counterexample,
        };
        return Ok(subject.outcome(EnvelopeFinding::Fails(failing)));
    }
    if let Some(text) = &request.contains {
        return contains(&subject, oracle, text);
    }
    match watcher.flow() {
        ControlFlow::Continue(()) => search::search(&subject, oracle, watcher),
        ControlFlow::Break(halt) => {
            Ok(subject.outcome(EnvelopeFinding::None { stop: halt.into() }))
        }
    }
}

/// Builds the answer of an interrupted search from its last progress report: plan, box and number
/// of checks. Unlike [`envelope`], it does not compute the limits of the ends, which takes time.
pub fn partial_result(
    request: &EnvelopeRequest,
    found: Option<(&Arc<ParametrizedPlan>, &DecoupledEnvelope, usize)>,
    halt: StopRequest,
    seconds: f64,
) -> EnvelopeOutcome {
    let stop = halt.into();
    let Some((plan, envelope, checks)) = found else {
        return EnvelopeOutcome {
            answer: EnvelopeAnswer::new(request, EnvelopeFinding::None { stop }),
            plan: None,
            envelope: None,
            explanation: None,
        };
    };
    let subject = Subject {
        request,
        plan,
        enforced: 0,
        explainer: Explainer::new(&request.task, plan),
    };
    let unknown = vec![[None, None]; plan.parameters.len()];
    let mut outcome = subject.outcome(EnvelopeFinding::Envelope {
        parameters: subject.limited_ranges(envelope, unknown),
        chosen: subject.chosen(),
        stop,
        checks,
        seconds,
        widenings: Vec::new(),
        balance: None,
        best: None,
        conditions: Conditions::default(),
        foresight: None,
        inequalities: None,
        timeline: None,
        makespans: None,
    });
    outcome.envelope = Some(envelope.clone());
    outcome
}

/// Returns the plan of a request with its open quantities, and the number of bounds added for the
/// dispatcher to enforce.
///
/// # Errors
/// When the validator rejects the plan, the request names quantities that the plan does not have, or
/// the problem has processes or events.
pub fn parametrized_plan(
    request: &EnvelopeRequest,
) -> Result<(ParametrizedPlan, usize), PipelineError> {
    match request.task.unsupported_by_analysis() {
        Some(feature) => Err(DeorderError::Unsupported { feature }.into()),
        None => parametrized_plan_with_autonomous(request),
    }
}

/// Like [`opened`], but also for problems with processes and events.
fn parametrized_plan_with_autonomous(
    request: &EnvelopeRequest,
) -> Result<(ParametrizedPlan, usize), PipelineError> {
    let task = &request.task;
    let plan = match &request.plan {
        AnyPlan::Stn(plan) => pipeline::open_more_quantities(task, plan.clone(), &request.vary)?,
        AnyPlan::TimeTriggered(plan) => pipeline::deorder_and_open(task, plan, &request.vary)?,
    };
    if !request.enforce {
        return Ok((plan, 0));
    }
    // A plan without a schedule gets no bounds; the search reports the reason later.
    Ok(elbowroom_envelope::with_obligations(task, &plan).unwrap_or((plan, 0)))
}

/// Checks whether a box lies inside the envelope.
fn contains(
    subject: &Subject<'_>,
    mut oracle: Oracle,
    text: &str,
) -> Result<EnvelopeOutcome, RequestError> {
    let envelope = parse_box(text, subject.plan)?;
    let objection = oracle
        .objection(&envelope)
        .map_err(PipelineError::Refused)?;
    let parameters = subject.ranges(&envelope);
    let Some(objection) = objection else {
        let finding = match subject.possible_timeout(&envelope) {
            None => EnvelopeFinding::Inside { parameters },
            Some(counterexample) => EnvelopeFinding::Outside {
                parameters,
                counterexample,
            },
        };
        return Ok(subject.outcome(finding));
    };
    let why_not = subject.explainer.objection(&oracle, &envelope, &objection);
    subject.reject_unproved_objection("this box", &why_not)?;
    let mut outcome = subject.outcome(EnvelopeFinding::Outside {
        parameters,
        counterexample: subject.counterexample(&why_not),
    });
    outcome.explanation = Some(why_not);
    Ok(outcome)
}

/// The plan that an answer is about, with its request and explainer.
#[derive(Clone, Copy)]
struct Subject<'a> {
    request: &'a EnvelopeRequest,
    plan: &'a Arc<ParametrizedPlan>,
    /// Number of bounds added for the dispatcher to enforce.
    enforced: usize,
    explainer: Explainer<'a>,
}

impl Subject<'_> {
    fn outcome(&self, finding: EnvelopeFinding) -> EnvelopeOutcome {
        EnvelopeOutcome {
            answer: EnvelopeAnswer::new(self.request, finding),
            plan: Some(Arc::clone(self.plan)),
            envelope: None,
            explanation: None,
        }
    }

    /// Rejects an objection that does not prove a failure: processes and events would take another
    /// course than in the plan, which may be harmless.
    fn reject_unproved_objection(
        &self,
        place: &str,
        why_not: &Explanation,
    ) -> Result<(), PipelineError> {
        if !why_not.may_be_harmless(&self.request.task) {
            return Ok(());
        }
        let reason = &why_not.reason;
        Err(PipelineError::Refused(Refusal::Autonomous {
            place: place.to_owned(),
            obstacle: format!(
                "processes and events may behave differently, and that case is not \
                 analysed: {reason}"
            ),
        }))
    }

    /// Returns the outcome for a plan that fails as planned.
    fn failure_outcome(&self, why_not: Explanation) -> EnvelopeOutcome {
        let failing = NominalFailure::AsPlanned {
            parameters: self.quantities(),
            counterexample: self.counterexample(&why_not),
        };
        let mut outcome = self.outcome(EnvelopeFinding::Fails(failing));
        outcome.explanation = Some(why_not);
        outcome
    }
}
