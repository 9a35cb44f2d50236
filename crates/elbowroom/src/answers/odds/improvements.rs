//! Gains of another order, of retrying, and of another plan.

use elbowroom_execution::PlanAnswer;
use elbowroom_model::ground::Action;
use elbowroom_probability::optimum::{ValueBounds, best_value};
use elbowroom_probability::{SearchStop, all_actions_under};
use serde::{Deserialize, Serialize};

use super::{OrderAnswer, Subject, plan_of_planner};
use crate::answers::{Observer, RequestError};

/// The gain of another order, of retrying, and of another plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImprovementsAnswer {
    /// The best order of this plan; `None` if the search found none.
    pub best_order: Option<BestOrderAnswer>,
    /// The best order of the plan that the embedded planner makes, if that is another plan.
    pub planners_plan: Option<BestOrderAnswer>,
    /// The plan's actions, each chosen for the current state: repeated, skipped, in any order.
    pub as_the_state_asks: ValueAnswer,
    /// The same with all actions of the problem: an upper bound for all plans and executors.
    pub any_action: ValueAnswer,
}

/// The best order of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BestOrderAnswer {
    /// The success probability P(A ∩ G).
    pub probability: f64,
    /// `true` if no order is better.
    pub is_proven: bool,
    /// The happenings in words.
    pub happenings: Vec<String>,
}

/// A value that can be computed only in worlds without time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ValueAnswer {
    /// The value.
    Probability(f64),
    /// Bounds on the value, in a world with too many states.
    Bounds {
        /// Success probability of some agent.
        lower: f64,
        /// No agent has a greater success probability.
        upper: f64,
    },
    /// The reason why it cannot be computed.
    Unknown(String),
}

impl ImprovementsAnswer {
    pub(super) fn of(
        subject: &mut Subject<'_>,
        order: &OrderAnswer,
        watcher: &mut dyn Observer,
    ) -> Result<Self, RequestError> {
        let request = subject.request;
        let best_order = if order.is_best {
            Some(BestOrderAnswer {
                probability: order.probability,
                is_proven: order.is_proven == Some(true),
                happenings: order.happenings.iter().map(|it| it.what.clone()).collect(),
            })
        } else {
            BestOrderAnswer::of(subject, watcher)?
        };
        let own: Vec<Action> = subject.search.model().plan().instances().fold(
            Vec::new(),
            |mut actions: Vec<Action>, (_, instance)| {
                if !actions
                    .iter()
                    .any(|known| known.name == instance.action.name)
                {
                    actions.push((*instance.action).clone());
                }
                actions
            },
        );
        Ok(Self {
            best_order,
            planners_plan: match &request.plan {
                Some(_) => best_order_of_planner(subject, watcher)?,
                None => None,
            },
            as_the_state_asks: ValueAnswer::of(subject, own),
            any_action: match all_actions_under(request.task, request.likelihoods) {
                Ok(actions) => ValueAnswer::of(subject, actions),
                Err(error) => ValueAnswer::Unknown(error.to_string()),
            },
        })
    }
}

/// Returns the best order of the plan that the embedded planner makes.
fn best_order_of_planner(
    subject: &Subject<'_>,
    watcher: &mut dyn Observer,
) -> Result<Option<BestOrderAnswer>, RequestError> {
    let PlanAnswer::Plan(other) = plan_of_planner(subject.request) else {
        return Ok(None);
    };
    let actions = |plan: &elbowroom_model::TimeTriggeredPlan| {
        let names = plan.steps.iter().map(|step| step.action.name.clone());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    };
    if actions(&other) == actions(subject.plan) {
        return Ok(None);
    }
    let mut other = Subject::new(subject.request, &other, subject.request.likelihoods)?;
    BestOrderAnswer::of(&mut other, watcher)
}

impl BestOrderAnswer {
    fn of(
        subject: &mut Subject<'_>,
        watcher: &mut dyn Observer,
    ) -> Result<Option<Self>, RequestError> {
        let (order, stop) = subject.best_order(watcher)?;
        let model = subject.search.model();
        Ok(order.map(|order| Self {
            probability: order.probability,
            is_proven: stop == SearchStop::Complete,
            happenings: order
                .sequence
                .iter()
                .map(|&node| model.describe_node(node))
                .collect(),
        }))
    }
}

impl ValueAnswer {
    fn of(subject: &Subject<'_>, actions: Vec<Action>) -> Self {
        let request = subject.request;
        match best_value(request.task, actions, request.likelihoods, &subject.initial) {
            Ok(bounds) if bounds.is_exact() => Self::Probability(bounds.lower),
            Ok(ValueBounds { lower, upper }) => Self::Bounds { lower, upper },
            Err(error) => Self::Unknown(error.to_string()),
        }
    }
}
