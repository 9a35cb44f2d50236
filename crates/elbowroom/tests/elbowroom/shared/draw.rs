//! Random values in a box, and random schedules.

use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{DecoupledEnvelope, NodeId, Schedule, StnPlan, Valuation, network_node};
use elbowroom_stn::{ConsistentNetwork, Constraint};
use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Draws values in the box, often at ends of intervals. From an unbounded interval, it draws a
/// value up to a thousand away from the other end.
pub(crate) fn valuation(envelope: &DecoupledEnvelope, rng: &mut ChaCha8Rng) -> Valuation {
    envelope
        .intervals()
        .iter()
        .map(|interval| value(interval, rng))
        .collect()
}

fn value(interval: &Interval, rng: &mut ChaCha8Rng) -> Rational {
    let far = Rational::from(1000);
    let (lower, upper) = match (interval.lower.value(), interval.upper.value()) {
        (Some(lower), Some(upper)) => (lower.clone(), upper.clone()),
        (Some(lower), None) => (lower.clone(), lower + &far),
        (None, Some(upper)) => (upper - &far, upper.clone()),
        (None, None) => (-&far, far),
    };
    &lower + (&upper - &lower) * share(rng)
}

/// Returns 0 or 1 half of the time, and a number in between otherwise.
fn share(rng: &mut ChaCha8Rng) -> Rational {
    let thousandths = match rng.random_range(0..4) {
        0 => 0,
        1 => 1000,
        _ => rng.random_range(0..=1000_i64),
    };
    Rational::new(thousandths, 1000)
}

/// Draws a schedule of the plan at the values: in random order, each node gets a time in its
/// window, often one of the window's ends. `None` if the plan has no schedule there.
pub(crate) fn schedule(
    plan: &StnPlan,
    valuation: &Valuation,
    rng: &mut ChaCha8Rng,
) -> Option<Schedule> {
    let zero = network_node(NodeId::ZERO);
    let mut network = ConsistentNetwork::try_from(plan.network(valuation)).ok()?;
    let mut nodes: Vec<NodeId> = plan.nodes().map(|(node, _)| node).skip(1).collect();
    nodes.shuffle(rng);
    // Some schedules are as early as possible, some as late as possible, others mixed.
    let habit = [Some(Rational::ZERO), Some(Rational::ONE), None][rng.random_range(0..3)].clone();
    for node in nodes {
        let node = network_node(node);
        let earliest = -network
            .distance(node, zero)
            .expect("no node comes before zero");
        let latest = network
            .distance(zero, node)
            .unwrap_or_else(|| &earliest + Rational::from(rng.random_range(0..200_i64)));
        let share = match &habit {
            Some(habit) if rng.random_bool(0.8) => habit.clone(),
            _ => share(rng),
        };
        let time = &earliest + (&latest - &earliest) * share;
        network
            .add(Constraint::at_least(zero, node, time.clone()))
            .expect("in its window");
        network
            .add(Constraint::at_most(zero, node, time))
            .expect("in its window");
    }
    Some(network.earliest_schedule(zero).into())
}
