//! Proofs about failures, which `elbowroom verify` checks without search.

use elbowroom_envelope::faults::{DeadlineFailure, FaultNetwork, Layers};
use elbowroom_plan::{Node, NodeId, ParametrizedPlan};
use serde::{Deserialize, Serialize};

use super::FailedAction;
use crate::answers::{Exact, exact};

/// A network with failures, and latest times in it or failures that defeat it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultProof {
    /// The number of failures.
    pub faults: usize,
    /// The time points; the first is time zero.
    pub nodes: Vec<String>,
    /// The requirements.
    pub requirements: Vec<ProofRequirement>,
    /// The actions.
    pub attempts: Vec<ProofAttempt>,
    /// Greatest time from a failure to the next start.
    #[serde(with = "exact")]
    pub recovery: elbowroom_num::Rational,
    /// For each time point its latest times after at most 0, 1, … failures on the path to it;
    /// missing where there is no limit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub latest: Vec<Vec<Option<Exact>>>,
    /// Lower bounds that lead to a missed deadline, if all durations are as long as possible.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub path: Vec<ProofStep>,
}

/// A time point on a path of lower bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProofStep {
    /// The time point.
    pub node: usize,
    /// The number of failures before it.
    pub layer: usize,
}

/// `to - from <= bound`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProofRequirement {
    /// The time point subtracted.
    pub from: usize,
    /// The time point it is subtracted from.
    pub to: usize,
    /// The greatest difference.
    #[serde(with = "exact")]
    pub bound: elbowroom_num::Rational,
}

/// An action with its attempts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProofAttempt {
    /// Its start.
    pub start: usize,
    /// Its end.
    pub end: usize,
    /// Its least duration.
    #[serde(with = "exact")]
    pub lower: elbowroom_num::Rational,
    /// Its greatest duration; missing if there is none.
    #[serde(
        with = "exact::option",
        default,
        skip_serializing_if = "Option::is_none"
    )]
    pub upper: Option<elbowroom_num::Rational>,
    /// Greatest number of failures.
    pub retries: usize,
}

/// Returns a proof that one strategy works for all failures; `None` if only another condition than
/// that of deadlines shows it.
pub(super) fn layers(
    plan: &ParametrizedPlan,
    network: &FaultNetwork,
    k: usize,
) -> Option<FaultProof> {
    let layers = Layers::new(network)?;
    if layers.failure(k).is_some() {
        return None;
    }
    let latest = layers.latest(k).into_iter();
    let latest = latest.map(|own| own.into_iter().map(|time| time.map(Exact)).collect());
    Some(FaultProof {
        latest: latest.collect(),
        ..skeleton(plan, network, k)
    })
}

/// Returns a proof that no strategy works for the failures that miss a deadline.
pub(super) fn defeat(
    plan: &ParametrizedPlan,
    network: &FaultNetwork,
    k: usize,
    missed: DeadlineFailure,
) -> FaultProof {
    let path = missed.path.into_iter();
    let path = path.map(|(node, layer)| ProofStep {
        node: node.index(),
        layer,
    });
    FaultProof {
        path: path.collect(),
        ..skeleton(plan, network, k)
    }
}

/// Returns the actions that fail.
pub(super) fn failed_actions(
    plan: &ParametrizedPlan,
    network: &FaultNetwork,
    failures: &[usize],
) -> Vec<FailedAction> {
    let pairs = network.attempts.iter().zip(failures);
    let failed = pairs.filter_map(|(attempt, &failures)| {
        let Node::Start(id) = plan.plan.nodes[attempt.start.index()] else {
            return None;
        };
        (failures > 0).then(|| FailedAction {
            action: plan.plan.instance(id).action.name.clone(),
            failures,
        })
    });
    failed.collect()
}

fn skeleton(plan: &ParametrizedPlan, network: &FaultNetwork, k: usize) -> FaultProof {
    let requirements = network.requirements.iter();
    let attempts = network.attempts.iter();
    FaultProof {
        faults: k,
        nodes: (0..network.nodes)
            .map(|node| plan.plan.node_label(NodeId::from(node)))
            .collect(),
        requirements: requirements
            .map(|own| ProofRequirement {
                from: own.from.index(),
                to: own.to.index(),
                bound: own.bound.clone(),
            })
            .collect(),
        attempts: attempts
            .map(|own| ProofAttempt {
                start: own.start.index(),
                end: own.end.index(),
                lower: own.lower.clone(),
                upper: own.upper.clone(),
                retries: own.retries,
            })
            .collect(),
        recovery: network.recovery[1].clone(),
        latest: Vec::new(),
        path: Vec::new(),
    }
}
