//! An order with its happenings, layers and losses.

use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};
use elbowroom_probability::loss_analysis::LossAnalysis;
use elbowroom_probability::{Layer, Loss, LossCause, Model, Reading, SearchStop, TotalOrderPlan};
use elbowroom_report::exact;
use serde::{Deserialize, Serialize};

use super::{Subject, coupling_error};
use crate::answers::RequestError;

/// An order and its probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderAnswer {
    /// `true` if it is the best order found, `false` if it is that of the plan's times.
    pub is_best: bool,
    /// `true` if it is proven that no order of the plan is better; `None` if no other order was
    /// examined.
    pub is_proven: Option<bool>,
    /// P(A): the probability that all happenings succeed.
    pub actions_probability: f64,
    /// P(A ∩ G): the probability that all happenings succeed and the goal holds after them.
    pub probability: f64,
    /// Number of conditions on numbers that were assumed to hold, because the numbers depend on the
    /// times of happenings.
    pub assumed_conditions: usize,
    /// `true` if the order is consistent with durations and timed initials.
    pub has_time: bool,
    /// The happenings.
    pub happenings: Vec<HappeningAnswer>,
    /// The layer after the last happening: the goal.
    pub goal: LayerAnswer,
    /// The losses. All masses and the probability add up to 1.
    pub losses: Vec<LossAnswer>,
    /// The effect of each action on the probability, by start.
    pub actions: Vec<ActionAnswer>,
    /// The facts that may change by themselves and prevent success, the worst first.
    pub facts: Vec<FactAnswer>,
    /// The happenings as nodes.
    #[serde(skip)]
    pub(super) sequence: Vec<NodeId>,
}

/// A happening of an order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HappeningAnswer {
    /// `start`, `end`, `instant` or `timed`.
    pub kind: String,
    /// The action; `None` for timed initials.
    pub action: Option<String>,
    /// The happening in words.
    pub what: String,
    /// `true` if it happens at the same time as the happening before it, because they depend on
    /// each other.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub together: bool,
    /// The earliest time; `None` if the order is inconsistent with durations and timed initials.
    #[serde(with = "exact::option")]
    pub earliest: Option<Rational>,
    /// The latest time; `None` if there is no bound, or if the order is inconsistent with durations
    /// and timed initials.
    #[serde(with = "exact::option")]
    pub latest: Option<Rational>,
    /// Probability that everything up to here succeeds, and that the actions running then can
    /// continue.
    pub probability_so_far: f64,
    /// The layer before it: the facts that must hold for the remaining order to succeed if nothing
    /// else fails.
    pub layer: LayerAnswer,
}

/// A layer: the facts that must hold between two happenings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayerAnswer {
    /// Facts that must be true, facts that must be false as `(not …)`, and other conditions, in
    /// PDDL.
    pub conditions: Vec<String>,
    /// The running actions.
    pub running: Vec<String>,
}

/// The share of all worlds that is lost at a happening.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LossAnswer {
    /// The position of the happening in the order, from 0; `None` before the first.
    pub happening: Option<usize>,
    /// The happening in words.
    pub at: String,
    /// The reason for the loss.
    #[serde(flatten)]
    pub reason: LossReason,
    /// The share.
    pub mass: f64,
}

/// Reasons for losses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
pub enum LossReason {
    /// The attempt to start fails.
    Start,
    /// The end fails.
    End,
    /// A running action fails.
    During {
        /// The action.
        action: String,
    },
    /// A condition of the happening does not hold.
    Condition {
        /// The condition.
        condition: String,
        /// The last happening with an effect on the condition; `None` for the initial state.
        since: Option<String>,
    },
    /// An invariant of a running action does not hold.
    Throughout {
        /// The action.
        action: String,
        /// The condition.
        condition: String,
        /// As in `Condition`.
        since: Option<String>,
    },
    /// A condition of the goal does not hold.
    Goal {
        /// The condition.
        condition: String,
        /// As in `Condition`.
        since: Option<String>,
    },
}

/// The effect of an action on the probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionAnswer {
    /// Its name.
    pub action: String,
    /// The position of its start in the order.
    pub happening: usize,
    /// P(A ∩ G) if its start, its end and its effects never failed.
    pub if_certain: f64,
    /// P(A ∩ G) if failed attempts to start it were repeated; `None` if the order is too long.
    pub if_retried: Option<f64>,
    /// P(A ∩ G) if it was started again at once whenever its end fails. `None` if its end does not
    /// fail, if a failure has several possible outcomes, or if the order is too long.
    pub if_done_again: Option<f64>,
}

/// The effect of a fact on the probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FactAnswer {
    /// Its name.
    pub fact: String,
    /// P(A ∩ G) if it never changed by itself.
    pub if_steady: f64,
}

impl OrderAnswer {
    pub(super) fn of(
        subject: &Subject<'_>,
        order: &TotalOrderPlan,
        best: Option<SearchStop>,
    ) -> Result<Self, RequestError> {
        let model = &**subject.search.model();
        let account = LossAnalysis::of(model, &subject.initial, order)
            .map_err(|error| coupling_error(&error))?;
        let starts = order.sequence.iter().enumerate().filter(|(_, node)| {
            matches!(
                model.plan().nodes[node.index()],
                Node::Start(_) | Node::Instant(_)
            )
        });
        let action = |id: InstanceId| model.plan().instance(id).action.name.clone();
        let mut left = 1.0 - loss_at(&account.losses, None);
        let happenings = order.sequence.iter().enumerate().map(|(at, &node)| {
            let slot = order.slots.get(at);
            let (kind, action) = match model.plan().nodes[node.index()] {
                Node::Start(id) => ("start", Some(action(id))),
                Node::End(id) => ("end", Some(action(id))),
                Node::Instant(id) => ("instant", Some(action(id))),
                Node::Timed(_) | Node::Zero => ("timed", None),
            };
            left -= loss_at(&account.losses, Some(at));
            HappeningAnswer {
                kind: kind.to_owned(),
                action,
                what: model.describe_node(node),
                together: order.joined[at],
                earliest: slot.map(|slot| slot.earliest.clone()),
                latest: slot.and_then(|slot| slot.latest.clone()),
                probability_so_far: left.clamp(0.0, 1.0),
                layer: LayerAnswer::of(model, &order.layers[at]),
            }
        });
        Ok(Self {
            is_best: best.is_some(),
            is_proven: best.map(|stop| stop == SearchStop::Complete),
            actions_probability: account.actions_probability,
            probability: account.probability,
            assumed_conditions: order.assumed_conditions,
            has_time: order.slots.len() == order.sequence.len(),
            happenings: happenings.collect(),
            goal: order
                .layers
                .last()
                .map_or_else(LayerAnswer::empty, |layer| LayerAnswer::of(model, layer)),
            losses: account
                .losses
                .iter()
                .map(|loss| LossAnswer::of(model, &order.sequence, loss))
                .collect(),
            actions: starts
                .zip(&account.actions)
                .map(|((happening, _), share)| ActionAnswer {
                    action: action(share.instance),
                    happening,
                    if_certain: share.if_certain,
                    if_retried: share.if_retried,
                    if_done_again: share.if_restarted,
                })
                .collect(),
            facts: account
                .facts
                .iter()
                .map(|share| FactAnswer {
                    fact: model.task().fact_name(share.fact),
                    if_steady: share.if_steady,
                })
                .collect(),
            sequence: order.sequence.clone(),
        })
    }
}

/// Returns the probability lost at a happening, without losses at the goal.
fn loss_at(losses: &[Loss], position: Option<usize>) -> f64 {
    let here = losses
        .iter()
        .filter(|loss| loss.position == position && loss.reading != Reading::Goal);
    here.map(|loss| loss.mass).sum()
}

impl LayerAnswer {
    fn empty() -> Self {
        Self {
            conditions: Vec::new(),
            running: Vec::new(),
        }
    }

    fn of(model: &Model, layer: &Layer) -> Self {
        let task = model.task();
        let literals = layer.literals.iter();
        let literals = literals.map(|&(fact, truth)| literal(model, fact, truth));
        let conditions = layer.conditions.iter();
        let running = layer.running.iter();
        Self {
            conditions: literals
                .chain(conditions.map(|condition| task.describe_condition(condition)))
                .collect(),
            running: running
                .map(|&id| model.plan().instance(id).action.name.clone())
                .collect(),
        }
    }
}

fn literal(model: &Model, fact: FactId, truth: bool) -> String {
    let name = model.task().fact_name(fact);
    if truth { name } else { format!("(not {name})") }
}

impl LossAnswer {
    fn of(model: &Model, sequence: &[NodeId], loss: &Loss) -> Self {
        let (condition, since) = match &loss.cause {
            LossCause::Start | LossCause::End | LossCause::During => (None, None),
            LossCause::Fact { fact, truth } => {
                let since = last_change_before_loss(model, sequence, loss, *fact);
                (Some(literal(model, *fact, *truth)), since)
            }
            LossCause::Condition(condition) => {
                (Some(model.task().describe_condition(condition)), None)
            }
        };
        let reason = match (condition, loss.reading) {
            (None, Reading::Throughout(id)) => LossReason::During {
                action: model.plan().instance(id).action.name.clone(),
            },
            (None, _) if loss.cause == LossCause::End => LossReason::End,
            (None, _) => LossReason::Start,
            (Some(condition), Reading::OnArrival) => LossReason::Condition { condition, since },
            (Some(condition), Reading::Throughout(id)) => LossReason::Throughout {
                action: model.plan().instance(id).action.name.clone(),
                condition,
                since,
            },
            (Some(condition), Reading::Goal) => LossReason::Goal { condition, since },
        };
        Self {
            happening: loss.position,
            at: match loss.position {
                Some(position) => model.describe_node(sequence[position]),
                None => "the beginning".to_owned(),
            },
            reason,
            mass: loss.mass,
        }
    }
}

/// Returns the last happening before a loss that has an effect on the fact.
fn last_change_before_loss(
    model: &Model,
    sequence: &[NodeId],
    loss: &Loss,
    fact: FactId,
) -> Option<String> {
    let before = match (loss.position, loss.reading) {
        (None, _) => 0,
        (Some(position), Reading::OnArrival) => position,
        (Some(position), Reading::Throughout(_) | Reading::Goal) => position + 1,
    };
    let mut before = sequence[..before].iter().rev();
    let last = before.find(|&&node| model.has_effect_on(node, fact))?;
    Some(model.describe_node(*last))
}
