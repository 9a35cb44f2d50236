//! Analysis of an order's success probability: [`LossAnalysis`].
//!
//! It answers three questions about an order with a known P(A ∩ G):
//!
//! - *Where is probability lost?* [`Loss`]es, each with its position, its cause and its share of
//!   all worlds. They and P(A ∩ G) add up to 1.
//! - *What would certainty gain?* P(A ∩ G) of the same order if one action never failed, or one
//!   fact never changed by itself. These gains do not add up: if two actions must both succeed,
//!   making one of them certain does not make the other certain.
//! - *What would retrying gain?* P(A ∩ G) if failed attempts to start one action did not end the
//!   order, but were repeated. Each attempt is a step after which facts may change by themselves.
//!   The same for ends that fail: the action is started again at once, in the state that the
//!   failure left behind. The sum over the number of failed attempts is exact except for a
//!   negligible remainder.

use elbowroom_model::ground::FactId;
use elbowroom_plan::{InstanceId, Node, NodeId};

use crate::likelihoods::{Rate, SpontaneousChange};
use crate::model::{Model, is_fact};
use crate::network::{Happenings, Loss, PrunedNetwork, TooCoupled};
use crate::search_state::SearchState;

/// Limit on the number of failed attempts that are counted.
const MAX_ATTEMPTS: usize = 1000;

/// The remainder of a sum is ignored below this value.
const NEGLIGIBLE: f64 = 1e-13;

/// Limit on the number of happenings evaluated for one order. For longer orders, the gain of
/// retrying is not computed.
const MAX_HAPPENINGS: usize = 4_000_000;

/// Analysis of an order's success probability.
#[derive(Clone, Debug, PartialEq)]
pub struct LossAnalysis {
    /// P(A).
    pub actions_probability: f64,
    /// P(A ∩ G).
    pub probability: f64,
    /// Losses, in the order of the happenings.
    pub losses: Vec<Loss>,
    /// Actions that start in the order, sorted by start.
    pub actions: Vec<ActionContribution>,
    /// Facts that may change by themselves and whose changes reduce the probability, the largest
    /// reduction first.
    pub facts: Vec<FactContribution>,
}

/// Contribution of an action to an order.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionContribution {
    /// The action.
    pub instance: InstanceId,
    /// P(A ∩ G) if its start, its end and its effects were certain.
    pub if_certain: f64,
    /// P(A ∩ G) if failed attempts to start it were repeated; `None` if the computation would take
    /// too long.
    pub if_retried: Option<f64>,
    /// P(A ∩ G) if the action was started again at once whenever its end fails; `None` if its end
    /// does not fail, if a failure has several possible outcomes, or if the computation would take
    /// too long.
    pub if_restarted: Option<f64>,
}

/// Contribution of a fact to an order.
#[derive(Clone, Debug, PartialEq)]
pub struct FactContribution {
    /// The fact.
    pub fact: FactId,
    /// P(A ∩ G) if it never changed by itself.
    pub if_steady: f64,
}

impl LossAnalysis {
    /// Computes the analysis of an order.
    ///
    /// # Errors
    /// When a condition couples too many uncertain facts.
    pub fn of<'a>(
        model: &Model,
        circumstances: &SearchState,
        happenings: impl Into<Happenings<'a>>,
    ) -> Result<Self, TooCoupled> {
        let happenings = happenings.into();
        let (actions_probability, probability) = probabilities(model, circumstances, happenings)?;
        let losses = PrunedNetwork::losses(model, circumstances, happenings)?;
        let retries = RetryEvaluator::of(model, circumstances, happenings);
        let mut actions = Vec::new();
        for (at, &node) in happenings.sequence.iter().enumerate() {
            let (Node::Start(instance) | Node::Instant(instance)) =
                model.plan().nodes[node.index()]
            else {
                continue;
            };
            let certain = model.with_certain(instance);
            actions.push(ActionContribution {
                instance,
                if_certain: probabilities(&certain, circumstances, happenings)?.1,
                if_retried: match &retries {
                    Some(retries) => Some(retries.with_retries_at(at)?),
                    None => None,
                },
                if_restarted: match &retries {
                    Some(retries) => retries.with_restart(instance, at)?,
                    None => None,
                },
            });
        }
        let mut facts = Vec::new();
        for fact in model.facts() {
            let Some(steady) = model.with_steady(fact) else {
                continue;
            };
            let if_steady = probabilities(&steady, circumstances, happenings)?.1;
            if if_steady > probability {
                facts.push(FactContribution { fact, if_steady });
            }
        }
        facts.sort_by(|a, b| b.if_steady.total_cmp(&a.if_steady));
        Ok(Self {
            actions_probability,
            probability,
            losses,
            actions,
            facts,
        })
    }
}

/// Returns P(A) and P(A ∩ G).
fn probabilities(
    model: &Model,
    circumstances: &SearchState,
    happenings: Happenings<'_>,
) -> Result<(f64, f64), TooCoupled> {
    let mut network = PrunedNetwork::new(model, circumstances)?;
    network.push_all(happenings)?;
    let probability = network.success_probability()?;
    Ok((network.actions_probability(), probability))
}

/// An order whose attempts are repeated.
struct RetryEvaluator<'a> {
    model: &'a Model,
    circumstances: &'a SearchState,
    happenings: Happenings<'a>,
}

impl<'a> RetryEvaluator<'a> {
    /// Returns `None` if the order is too long.
    fn of(
        model: &'a Model,
        circumstances: &'a SearchState,
        happenings: Happenings<'a>,
    ) -> Option<Self> {
        let sequence = happenings.sequence;
        let length = sequence.len();
        let attempts = |node: &NodeId| {
            let success = model.event(*node).success;
            if success >= 1.0 || success <= 0.0 {
                return 1;
            }
            // Beyond this number of attempts, the remainder is negligible.
            let enough = NEGLIGIBLE.ln() / (1.0 - success).ln();
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a positive number, and casts saturate"
            )]
            let enough = enough.ceil() as usize;
            enough.min(MAX_ATTEMPTS)
        };
        let all: usize = sequence.iter().map(attempts).sum();
        (all.saturating_mul(length) <= MAX_HAPPENINGS).then_some(Self {
            model,
            circumstances,
            happenings,
        })
    }

    /// Returns the network with the happenings before a position.
    fn network_before(&self, position: usize) -> Result<PrunedNetwork<'a>, TooCoupled> {
        let mut network = PrunedNetwork::new(self.model, self.circumstances)?;
        for (node, is_open) in self.happenings.nodes().take(position) {
            network.push_as(node, is_open)?;
        }
        Ok(network)
    }

    /// Returns P(A ∩ G) if the attempt at this position is repeated until it succeeds.
    fn with_retries_at(&self, position: usize) -> Result<f64, TooCoupled> {
        let mut before = self.network_before(position)?;
        let mut whole = 0.0;
        for _ in 0..=MAX_ATTEMPTS {
            let mut rest = before.clone();
            rest.push_all(self.happenings.suffix(position))?;
            whole += rest.success_probability()?;
            if before.push_failure(self.happenings.sequence[position])? <= NEGLIGIBLE {
                break;
            }
        }
        Ok(whole)
    }

    /// Returns P(A ∩ G) if the action that starts at this position is started again whenever its
    /// end fails.
    fn with_restart(&self, instance: InstanceId, start: usize) -> Result<Option<f64>, TooCoupled> {
        let end = self.model.end(instance);
        let can_fail = self.model.event(end).success < 1.0;
        // An action that is joined with simultaneous happenings cannot be started again.
        let joined = self.happenings.joined;
        if joined.get(start) == Some(&true) || joined.get(start + 1) == Some(&true) {
            return Ok(None);
        }
        let after = &self.happenings.sequence[start..];
        let Some(end) = after
            .iter()
            .position(|node| *node == end)
            .filter(|_| can_fail)
        else {
            return Ok(None);
        };
        let end = start + end;
        if self
            .model
            .failed_end_event(self.happenings.sequence[end])
            .is_none()
        {
            return Ok(None);
        }
        let mut before = self.network_before(end)?;
        let mut whole = 0.0;
        for _ in 0..=MAX_ATTEMPTS {
            let mut rest = before.clone();
            rest.push_all(self.happenings.suffix(end))?;
            whole += rest.success_probability()?;
            before.push_failure(self.happenings.sequence[end])?;
            if before.push(self.happenings.sequence[start])? <= NEGLIGIBLE {
                break;
            }
        }
        Ok(Some(whole))
    }
}

impl Model {
    /// Returns the same plan in a world where an action and its effects never fail.
    fn with_certain(&self, instance: InstanceId) -> Self {
        let mut model = self.clone();
        for node in [self.start(instance), self.end(instance)] {
            let event = &mut model.events[node.index()];
            event.success = 1.0;
            event.failures_per_second = 0.0;
            for effect in &mut event.effects {
                effect.probability = 1.0;
            }
        }
        model
    }

    /// Returns the same plan in a world where a fact does not change by itself; `None` if it never
    /// does anyway.
    fn with_steady(&self, fact: FactId) -> Option<Self> {
        let position = self.position(fact).filter(|_| is_fact(fact))?;
        if self.spontaneous_changes[position] == SpontaneousChange::NEVER
            && self.rates[position] == Rate::NEVER
        {
            return None;
        }
        let mut model = self.clone();
        model.spontaneous_changes[position] = SpontaneousChange::NEVER;
        model.rates[position] = Rate::NEVER;
        Some(model)
    }
}
