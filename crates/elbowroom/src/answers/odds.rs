//! The success probability of a plan, its losses, and possible gains.

mod executed;
mod improvements;
mod lattice;
mod order;
mod text;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_execution::executors::{self, ExecutorSpec, Role};
use elbowroom_execution::{PlanAnswer, Planner};
use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_plan::NodeId;
use elbowroom_plan::partial_order::partial_order;
use elbowroom_probability::{
    Likelihoods, Model, OrderSearch, SearchSettings, SearchState, SearchStop, Semantics,
    TotalOrderPlan,
};
use elbowroom_selection::with_fixed_durations;
use elbowroom_sim::WorldModel;
use serde::{Deserialize, Serialize};

use super::{Observer, RequestError, Version, ViolationAnswer};
use crate::execute::Embedded;

pub use executed::{EndAnswer, ExecutedAnswer};
pub use improvements::{BestOrderAnswer, ImprovementsAnswer, ValueAnswer};
pub use lattice::{EdgeAnswer, LatticeAnswer, LatticeFinding, SetAnswer};
pub use order::{
    ActionAnswer, FactAnswer, HappeningAnswer, LayerAnswer, LossAnswer, LossReason, OrderAnswer,
};

/// Requests the success probability of a plan.
#[derive(Clone, Debug)]
pub struct OddsRequest<'a> {
    /// The problem.
    pub task: &'a Arc<Task>,
    /// The plan. Without one, the embedded planner makes one, and its best order is used.
    pub plan: Option<TimeTriggeredPlan>,
    /// Likelihoods of failures, effects and changes.
    pub likelihoods: &'a Arc<Likelihoods>,
    /// A world on a clock, for executing the plan in samples.
    pub world: Option<&'a WorldModel>,
    /// Settings of the analysis.
    pub settings: OddsSettings,
}

/// Settings of the analysis of a plan's success probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OddsSettings {
    /// The state after a failed effect.
    pub semantics: OddsSemantics,
    /// `true` if the answer is about the best order instead of that of the plan's times.
    pub takes_best_order: bool,
    /// Limit on the number of partial orders that the search for the best order visits.
    pub most_sequences: usize,
    /// `true` if the answer lists all orders.
    pub with_lattice: bool,
    /// `true` if a ground action may overlap itself in plans that are made.
    #[serde(default)]
    pub self_overlap: bool,
    /// The executors that execute the plan in samples of the world.
    #[serde(with = "crate::execute::listed")]
    pub executors: Vec<ExecutorSpec>,
    /// Number of samples.
    pub samples: u64,
    /// Seed of the first sample. Each further sample has the next seed.
    pub seed: u64,
}

impl Default for OddsSettings {
    /// Returns the settings of paper 2, with 1000 samples for each executor that evaluates plans.
    fn default() -> Self {
        Self {
            semantics: OddsSemantics::default(),
            takes_best_order: false,
            most_sequences: 50_000,
            with_lattice: false,
            self_overlap: false,
            executors: executors::with_role(Role::Evaluation).collect(),
            samples: 1000,
            seed: 0,
        }
    }
}

/// The state after a failed effect: [`Semantics`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OddsSemantics {
    /// The opposite of the intended effect, as in paper 2.
    #[default]
    Paper,
    /// The fact keeps its value.
    World,
}

impl From<OddsSemantics> for Semantics {
    fn from(semantics: OddsSemantics) -> Self {
        match semantics {
            OddsSemantics::Paper => Self::Paper,
            OddsSemantics::World => Self::World,
        }
    }
}

/// The success probability of a plan: `docs/reference/formats/odds-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OddsAnswer {
    /// Format of the document.
    pub format: OddsFormat,
    /// Version of the document.
    pub version: Version,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
    /// The state after a failed effect.
    pub semantics: OddsSemantics,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: OddsFinding,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum OddsFormat {
    /// The name `elbowroom-odds`.
    #[default]
    #[serde(rename = "elbowroom-odds")]
    Odds,
}

/// The success probability, or the reason why it is missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer")]
pub enum OddsFinding {
    /// The analysis.
    #[serde(rename = "odds")]
    Odds(Box<Odds>),
    /// No order of the plan can succeed.
    #[serde(rename = "no order")]
    NoOrder,
    /// There is no plan.
    #[serde(rename = "no plan")]
    NoPlan,
    /// A limit was reached before there was a result.
    #[serde(rename = "none")]
    None {
        /// The limit.
        reason: String,
    },
    /// The validator rejects the plan.
    #[serde(rename = "invalid")]
    Invalid {
        /// The reason.
        violation: ViolationAnswer,
    },
}

/// The analysis of a plan's success probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Odds {
    /// The analysed order.
    pub order: OrderAnswer,
    /// The gain of another order, of retrying, and of another plan.
    pub gains: ImprovementsAnswer,
    /// The results of executing the plan in samples of the world, if there is one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub executed: Vec<ExecutedAnswer>,
    /// All orders, if requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lattice: Option<LatticeFinding>,
}

/// A plan with the data for searches among its orders.
pub(super) struct Subject<'a> {
    request: &'a OddsRequest<'a>,
    plan: &'a TimeTriggeredPlan,
    search: OrderSearch,
    initial: SearchState,
    /// The happenings in the order of the plan's times.
    as_planned: Vec<NodeId>,
}

/// Computes the success probability of a plan.
///
/// # Errors
/// When likelihoods are missing for a part of the plan, too many facts are coupled, the validator
/// cannot decide whether the plan is valid, or the planner does not support the problem.
pub fn odds(
    request: &OddsRequest<'_>,
    watcher: &mut dyn Observer,
) -> Result<OddsAnswer, RequestError> {
    let problem = request.task.problem();
    Ok(OddsAnswer {
        format: OddsFormat::Odds,
        version: Version,
        domain: problem.domain.clone(),
        problem: problem.name.clone(),
        semantics: request.settings.semantics,
        finding: finding(request, watcher)?,
    })
}

fn finding(
    request: &OddsRequest<'_>,
    watcher: &mut dyn Observer,
) -> Result<OddsFinding, RequestError> {
    if let Some(feature) = request.task.validator_only_feature() {
        let message = format!("the problem has {feature}, which `odds` does not support yet");
        return Err(RequestError::Unsupported(message));
    }
    let made;
    let plan = if let Some(plan) = &request.plan {
        match validate::validate(request.task, plan, &validate::Settings::default()) {
            Verdict::Valid(_) => plan,
            Verdict::Invalid(violation) => {
                let violation = (&violation).into();
                return Ok(OddsFinding::Invalid { violation });
            }
            Verdict::Undecided(why) => return Err(RequestError::Undecided(why.to_string())),
        }
    } else {
        match plan_of_planner(request) {
            PlanAnswer::Plan(plan) => made = plan,
            PlanAnswer::Unsolvable => return Ok(OddsFinding::NoPlan),
            PlanAnswer::Failed { why } => return Err(RequestError::Unsupported(why)),
            other => {
                let reason = other.failure_reason().unwrap_or_default().to_owned();
                return Ok(OddsFinding::None { reason });
            }
        }
        &made
    };
    let mut subject = Subject::new(request, plan, request.likelihoods)?;
    let order = if request.settings.takes_best_order || request.plan.is_none() {
        let (best, stop) = subject.best_order(watcher)?;
        match (best, stop) {
            (Some(order), stop) => OrderAnswer::of(&subject, &order, Some(stop))?,
            (None, SearchStop::Complete) if is_executable_in_order(request, plan)? => {
                return Ok(OddsFinding::NoOrder);
            }
            (None, SearchStop::Complete) => return Ok(no_order_finding()),
            (None, SearchStop::Interrupted) => {
                let reason = "no order was found within the limit of the search".to_owned();
                return Ok(OddsFinding::None { reason });
            }
        }
    } else {
        let order = subject
            .search
            .order_of(&subject.initial, &subject.as_planned);
        OrderAnswer::of(
            &subject,
            &order.map_err(|error| coupling_error(&error))?,
            None,
        )?
    };
    if order.probability <= 0.0 && !is_executable_in_order(request, plan)? {
        return Ok(no_order_finding());
    }
    let gains = ImprovementsAnswer::of(&mut subject, &order, watcher)?;
    let executed = match request.world {
        Some(world) => executed::execute_with_all(&subject, world, watcher),
        None => Vec::new(),
    };
    let lattice = request.settings.with_lattice;
    let lattice = lattice.then(|| LatticeFinding::of(&subject, &order));
    Ok(OddsFinding::Odds(Box::new(Odds {
        order,
        gains,
        executed,
        lattice,
    })))
}

/// Returns the answer for a valid plan whose happenings do not work as an order.
fn no_order_finding() -> OddsFinding {
    let reason = "not supported: the happenings of this plan do not reach the goal as an order, although the plan is valid";
    OddsFinding::None {
        reason: reason.to_owned(),
    }
}

/// Returns `true` if the happenings of a valid plan, taken as an order, succeed when everything is certain.
fn is_executable_in_order(
    request: &OddsRequest<'_>,
    plan: &TimeTriggeredPlan,
) -> Result<bool, RequestError> {
    let mut subject = Subject::new(request, plan, &Likelihoods::certain())?;
    subject.initial = SearchState::initial(request.task);
    let order = subject
        .search
        .order_of(&subject.initial, &subject.as_planned);
    Ok(order.map_err(|error| coupling_error(&error))?.probability > 0.0)
}

/// Returns a plan of the embedded planner.
fn plan_of_planner(request: &OddsRequest<'_>) -> PlanAnswer {
    planner(&request.settings)
        .plan(request.task, &Situation::initial(request.task))
        .answer
}

/// Returns the planner for the plan, and for new plans in samples.
fn planner(settings: &OddsSettings) -> Embedded<'static> {
    let mut planner = Embedded::default();
    planner.settings.self_overlap = settings.self_overlap;
    planner
}

fn coupling_error(error: &elbowroom_probability::TooCoupled) -> RequestError {
    RequestError::Unsupported(error.to_string())
}

impl<'a> Subject<'a> {
    fn new(
        request: &'a OddsRequest<'a>,
        plan: &'a TimeTriggeredPlan,
        likelihoods: &Likelihoods,
    ) -> Result<Self, RequestError> {
        let ordered = partial_order(request.task, &with_fixed_durations(plan));
        let by_step = ordered.instance_of_step.iter().zip(&plan.steps);
        let mut steps: Vec<(_, &Step)> = by_step.map(|(&id, step)| (id, step)).collect();
        steps.sort_by_key(|(id, _)| *id);
        let steps: Vec<Step> = steps.into_iter().map(|(_, step)| step.clone()).collect();
        let semantics = request.settings.semantics.into();
        let task = Arc::clone(request.task);
        let model = Model::new(task, ordered, likelihoods, semantics);
        let model = model.map_err(|missing| RequestError::Unsupported(missing.to_string()))?;
        let search = OrderSearch::new(model, SearchSettings::default());
        let as_planned = search.timed_sequence(&steps);
        Ok(Self {
            request,
            plan,
            search: search.beginning_with(as_planned.clone()),
            initial: SearchState::initial_with_beliefs(request.task, likelihoods),
            as_planned,
        })
    }

    fn best_order(
        &mut self,
        watcher: &mut dyn Observer,
    ) -> Result<(Option<TotalOrderPlan>, SearchStop), RequestError> {
        let most = self.request.settings.most_sequences;
        let found = self.search.best_order(&self.initial, &mut |progress| {
            if progress.sequences >= most || watcher.flow().is_break() {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        let found = found.map_err(|error| coupling_error(&error))?;
        Ok((found.order, found.stop))
    }
}
