//! Simulation of the remaining plan from the believed state.

use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use super::{Dispatch, in_words, is_instantaneous};
use crate::belief_state::BeliefState;
use crate::event::ActionHandle;
use crate::executor::DecisionContext;

/// First failure in the simulation of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Failure {
    /// The action that needs it; `None` for the goal.
    pub(crate) action: Option<String>,
    /// The condition that would not hold.
    pub(crate) condition: String,
}

/// First ticket of simulated starts.
const FIRST_SIMULATED_TICKET: u64 = 1 << 63;

/// Simulates the remaining plan without further deviations. Returns the first condition that does
/// not hold.
pub(crate) fn simulate_remaining_plan(
    dispatch: &Dispatch,
    moment: &DecisionContext<'_>,
) -> Option<Failure> {
    let mut state = moment.belief.clone();
    let mut running: Vec<(InstanceId, ActionHandle)> = Vec::new();
    for (time, node) in expected_happenings(dispatch, moment.now) {
        // A value that cannot be computed shows up as a condition without a value.
        let _ = state.advance(&time.max(state.time().clone()));
        if let Some(failure) = violated_condition(&state) {
            return Some(failure);
        }
        match dispatch.plan().nodes[node.index()] {
            Node::Start(id) | Node::Instant(id) => {
                let action = dispatch.action(id);
                let duration = dispatch.nominal_duration(id);
                if let Some(reason) = dispatch.unmet_start_condition(id, &duration, &state) {
                    return Some(Failure {
                        action: reason.action,
                        condition: reason
                            .about
                            .map_or(String::new(), |about| about.to_string()),
                    });
                }
                let ticket = ActionHandle(FIRST_SIMULATED_TICKET + u64::from(id.0));
                let _ = state.start(ticket, action, &duration, &[]);
                if !is_instantaneous(action) {
                    running.push((id, ticket));
                }
            }
            Node::End(id) => {
                let ticket = ticket_of(&state, dispatch.action(id), &running, id)?;
                if let Some(failure) = at_end(&state, ticket) {
                    return Some(failure);
                }
                let _ = state.end(ticket, &[]);
            }
            Node::Zero | Node::Timed(_) => {}
        }
    }
    let unmet = state.unmet_finally();
    (!unmet.is_empty()).then(|| Failure {
        action: None,
        condition: in_words(&state, &unmet).join(" and "),
    })
}

/// Returns the coming happenings with their expected times, in order.
fn expected_happenings(dispatch: &Dispatch, now: &Rational) -> Vec<(Rational, NodeId)> {
    let plan = dispatch.plan();
    let is_open = |node: &NodeId| {
        let happens = !matches!(plan.nodes[node.index()], Node::Zero | Node::Timed(_));
        happens && dispatch.execution_time(*node).is_none()
    };
    let mut nodes: Vec<NodeId> = plan.nodes().map(|(node, _)| node).filter(is_open).collect();
    nodes.sort_by_key(|node| dispatch.nominal_time(*node));
    let mut latest = now.clone();
    let mut times = Vec::with_capacity(nodes.len());
    for node in nodes {
        let (earliest, _) = dispatch.window_of(node);
        let nominal = dispatch.to_world_time(dispatch.nominal_time(node));
        let earliest = earliest.map_or(nominal.clone(), |earliest| earliest.max(nominal));
        latest = latest.max(earliest);
        times.push((latest.clone(), node));
    }
    times
}

fn ticket_of(
    state: &BeliefState,
    action: &Arc<Action>,
    running: &[(InstanceId, ActionHandle)],
    id: InstanceId,
) -> Option<ActionHandle> {
    if let Some((_, ticket)) = running.iter().find(|(instance, _)| *instance == id) {
        return Some(*ticket);
    }
    let mut underway = state.running().iter();
    underway
        .find(|(_, underway)| underway.action.name == action.name)
        .map(|(ticket, _)| *ticket)
}

fn at_end(state: &BeliefState, ticket: ActionHandle) -> Option<Failure> {
    let underway = state.running().get(&ticket)?;
    let body = underway.action.durative()?;
    let unmet = state.unmet_on_arrival(&body.end.condition, Some(&underway.planned));
    (!unmet.is_empty()).then(|| Failure {
        action: Some(underway.action.name.clone()),
        condition: in_words(state, &unmet).join(" and "),
    })
}

fn violated_condition(state: &BeliefState) -> Option<Failure> {
    let (_, underway) = state.violated_action()?;
    Some(Failure {
        action: Some(underway.action.name.clone()),
        condition: in_words(state, &underway.violated_conjuncts()).join(" and "),
    })
}
