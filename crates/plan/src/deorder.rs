//! Conversion of a plan with fixed times to a flexible plan: [`deorder`].
//!
//! Also called *lifting to a partial order*, and in `ROSPlan` the ESTEREL transformation.
//!
//! The result is sound because everything that a happening reads was written by the same happenings
//! as in the original plan:
//!
//! - Interfering happenings keep their order, at least ε apart. This includes timed initials, so
//!   deadlines become constraints.
//! - A happening that writes facts or fluents of an over-all condition stays on its side of the
//!   action's start and of its end, unless its only effect is to establish a fact as the condition
//!   needs it. An over-all condition is read in the open interval between them, so the writer may
//!   be simultaneous with start or end: at the start, the write counts as earlier, because the
//!   condition only reads the states after the start; at the end, it counts as later.
//! - Rates of continuous effects are treated like over-all conditions. So are over-all conditions
//!   of conditional effects. But a writer that was between start and end stays strictly between,
//!   because such a condition must not become true either.
//! - The goal is read at the end, after all timed initials, so it needs no constraint of its own:
//!   the last writer of a fact or fluent is the last one in every schedule.
//! - Happenings that change facts of a constraint on the plan's course keep their order. Bounds on
//!   the times of such changes become bounds between happenings.
//! - Instances of one ground action that do not overlap in the plan do not overlap in any schedule.
//!   No condition needs this, but planners and performers do.
//! - A duration is limited by the domain instead of the planner's number. If the domain's bounds
//!   depend on values that depend on the schedule, the duration is fixed at the planner's number.
//!
//! This is not sufficient in all cases. Conditions on numbers that change continuously, or by
//! amounts that depend on durations, can still fail in some schedules. So can over-all conditions
//! that read several changes between start and end, if no other constraint keeps their order: of a
//! fact that replaces another one (`(or (a) (b))`), or an increase before a decrease.
//! [`pin_until_sound`] handles these plans, and [`keeps_all_that_is_read`] recognises plans without
//! such conditions. On the other hand, it depends on the numbers whether a happening that increases
//! or decreases a number must stay on its side of an action. Such constraints have a reason of
//! their own ([`Reason::Side`](crate::Reason::Side)), and [`pin_until_sound`] drops those that are
//! not needed.

pub(crate) mod durations;
mod implied;
mod lossless;
mod order;
mod over_all;
mod pin;
mod self_overlap;
mod trajectory;

use elbowroom_model::{Footprint, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_stn::ConsistentNetwork;

pub use implied::without_implied;
pub use lossless::keeps_all_that_is_read;
pub use pin::{
    pin_until_sound, with_compatible_sides, with_fixed_times, with_permanent_sides, without_sides,
};

use crate::network::{Schedule, network_node};
use crate::stn_plan::{Bound, Constraint, Instance, InstanceId, Node, NodeId, StnPlan};
use crate::valuation::Valuation;
use order::{Order, Timeline};

/// A flexible plan, and a schedule of it: the original one, if that satisfies the constraints.
#[derive(Clone, Debug, PartialEq)]
pub struct Deordered {
    /// The plan. Its instances are labelled `n0`, `n1`, … in order of their start.
    pub plan: StnPlan,
    /// For each step of the original plan, its instance.
    pub instances: Vec<InstanceId>,
    /// The times of the original plan. If rounding has made them violate the constraints, these are
    /// close times that satisfy the constraints.
    pub nominal: Schedule,
}

/// Reason why a plan cannot be deordered: it is not valid, or the problem has an unsupported
/// feature.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeorderError {
    /// The plan violates a constraint on its course.
    #[error("the plan violates the constraint {constraint}")]
    ConstraintViolated {
        /// The constraint in PDDL notation.
        constraint: String,
    },
    /// Orders and bounds do not support this feature of the problem.
    #[error("the plan cannot be converted to a network: networks do not support {feature} yet")]
    Unsupported {
        /// The feature.
        feature: &'static str,
    },
    /// Two interfering happenings have no order.
    #[error("{first} and {second} interfere, but both happen at {time}")]
    Simultaneous {
        /// The first happening.
        first: String,
        /// The second happening.
        second: String,
        /// Their time.
        time: String,
    },
    /// No schedule satisfies the constraints that keep the plan's order.
    #[error(
        "the order of the plan has no schedule: between {}, interfering happenings cannot all be \
         {epsilon} apart",
        nodes.join(", ")
    )]
    NoSchedule {
        /// The happenings whose constraints contradict each other.
        nodes: Vec<String>,
        /// The least separation.
        epsilon: String,
    },
}

/// Determines which happenings of a valid plan need to keep their order.
///
/// # Errors
/// The plan is found to be invalid (not all mistakes are found, so validate it first), the problem
/// has constraints that orders and bounds do not support (on numbers, on derived facts, or on facts
/// that conditional effects change), or it has processes or events, or numbers that the plan
/// chooses.
pub fn deorder(task: &Task, plan: &TimeTriggeredPlan) -> Result<Deordered, DeorderError> {
    if let Some(feature) = task.unsupported_by_analysis() {
        return Err(DeorderError::Unsupported { feature });
    }
    deorder_ignoring_processes(task, plan)
}

/// Like [`deorder`], but ignores processes, events and trajectory constraints. These may need more
/// than the constraints of the result.
///
/// # Errors
/// As for [`deorder`], except for these features.
pub fn deorder_ignoring_processes(
    task: &Task,
    plan: &TimeTriggeredPlan,
) -> Result<Deordered, DeorderError> {
    if !task.problem().controls.is_empty() {
        let feature = "control parameters (`:control`)";
        return Err(DeorderError::Unsupported { feature });
    }
    let Labelled {
        plan: mut stn_plan,
        instances,
        times,
    } = labelled(task, plan);
    let footprints: Vec<Footprint> = stn_plan
        .nodes()
        .map(|(node, _)| stn_plan.footprint(task, node))
        .collect();
    let timeline = Timeline::new(&times, &footprints);
    let mut order = Order::default();
    timeline
        .interference(&stn_plan, task.epsilon(), &mut order)
        .map_err(|(first, second)| DeorderError::Simultaneous {
            first: stn_plan.describe_node(task, first),
            second: stn_plan.describe_node(task, second),
            time: times[first].to_decimal(6),
        })?;
    self_overlap::order(&stn_plan, &times, &mut order);
    let mut sides = Order::default();
    over_all::order(task, &stn_plan, &timeline, &mut order, &mut sides);
    stn_plan
        .constraints
        .extend(durations::constraints(task, &stn_plan, &times));
    stn_plan.constraints.extend(order.into_constraints());
    if task.autonomous().is_empty() {
        let course = trajectory::constraints(task, &stn_plan, &footprints, &times)?;
        stn_plan.constraints.extend(course);
    }
    let sides: Vec<_> = sides.into_constraints().collect();
    let nominal = nominal(task, &stn_plan, &sides, times)?;
    Ok(Deordered {
        plan: implied::with_sides(without_implied(stn_plan, &nominal), sides),
        instances,
        nominal,
    })
}

/// Returns the durations that the domain allows for each step of a plan, if the order of the plan
/// determines them; `None` if they depend on the times.
pub fn allowed_durations(task: &Task, plan: &TimeTriggeredPlan) -> Vec<Option<Interval>> {
    let Labelled {
        plan,
        instances,
        times,
    } = labelled(task, plan);
    let intervals = durations::intervals(task, &plan, &times);
    let own = instances.iter().map(|id| intervals[id.index()].clone());
    own.collect()
}

/// A plan without any order.
#[derive(Clone, Debug, PartialEq)]
pub struct Unordered {
    /// The plan. Its instances are labelled `n0`, `n1`, … in order of their start. Its constraints
    /// are the times of the timed initials, and the durations that the domain allows. If these
    /// depend on values that change during the plan, durations are only non-negative.
    pub plan: StnPlan,
    /// For each step of the original plan, its instance.
    pub instances: Vec<InstanceId>,
    /// The times of the original plan, which need not satisfy any constraint.
    pub times: Schedule,
}

/// Returns the actions and the timed initials of a plan, valid or not, without the order that its
/// times imply.
pub fn unordered(task: &Task, plan: &TimeTriggeredPlan) -> Unordered {
    let Labelled {
        mut plan,
        instances,
        times,
    } = labelled(task, plan);
    let footprints = plan.nodes().map(|(node, _)| plan.footprint(task, node));
    let footprints: Vec<Footprint> = footprints.collect();
    let durations = durations::state_independent_bounds(task, &plan, &footprints);
    plan.constraints.extend(durations);
    Unordered {
        plan,
        instances,
        times,
    }
}

/// A plan without order.
pub(crate) struct Labelled {
    /// The plan, without constraints.
    pub(crate) plan: StnPlan,
    /// For each step of the original, its instance.
    pub(crate) instances: Vec<InstanceId>,
    /// Time of each node in the original plan.
    pub(crate) times: Schedule,
}

/// Returns the plan without order; instances are numbered by start.
pub(crate) fn labelled(task: &Task, plan: &TimeTriggeredPlan) -> Labelled {
    let mut order: Vec<usize> = (0..plan.steps.len()).collect();
    order.sort_by(|&a, &b| plan.steps[a].start.cmp(&plan.steps[b].start));
    let mut instance_of = vec![InstanceId(0); order.len()];
    for (position, &step) in order.iter().enumerate() {
        instance_of[step] = InstanceId::from(position);
    }
    let steps: Vec<_> = order.iter().map(|&step| &plan.steps[step]).collect();
    let instances = steps
        .iter()
        .enumerate()
        .map(|(index, step)| Instance {
            label: format!("n{index}"),
            action: step.action.clone(),
        })
        .collect();
    let stn_plan = StnPlan::unconstrained(task, instances);
    let times = stn_plan
        .nodes
        .iter()
        .map(|node| match *node {
            Node::Zero => Rational::ZERO,
            Node::Start(id) | Node::Instant(id) => steps[id.index()].start.clone(),
            Node::End(id) => steps[id.index()].end(),
            Node::Timed(index) => task.timed()[index].time.clone(),
        })
        .collect();
    Labelled {
        plan: stn_plan,
        instances: instance_of,
        times,
    }
}

/// Returns the original times, or the earliest ones where actions start no sooner than in the
/// original plan, as far as possible.
fn nominal(
    task: &Task,
    plan: &StnPlan,
    sides: &[Constraint],
    times: Schedule,
) -> Result<Schedule, DeorderError> {
    let mut all = plan.constraints.iter().chain(sides);
    if times.iter().all(|time| !time.is_negative()) && all.all(|own| holds(own, &times)) {
        return Ok(times);
    }
    let mut plan = plan.clone();
    plan.constraints.extend_from_slice(sides);
    let network = plan.network(&Valuation::default());
    let original = elbowroom_stn::Schedule::from(times);
    let mut network =
        ConsistentNetwork::try_from(network.clone()).map_err(|cycle| DeorderError::NoSchedule {
            nodes: cycle
                .constraints
                .iter()
                .map(|&id| NodeId(network.constraint(id).to.0))
                .filter(|&node| node != NodeId::ZERO)
                .map(|node| plan.describe_node(task, node))
                .collect(),
            epsilon: task.epsilon().to_string(),
        })?;
    let zero = network_node(NodeId::ZERO);
    for (node, what) in plan.nodes() {
        if matches!(what, Node::Start(_) | Node::Instant(_)) {
            let time = original[network_node(node)].clone();
            let start = elbowroom_stn::Constraint::at_least(zero, network_node(node), time);
            // If this start is not possible, another constraint takes precedence.
            let _ = network.add(start);
        }
    }
    Ok(network.earliest_schedule(zero).into())
}

/// Returns `true` if a constraint without parameters holds at these times.
fn holds(constraint: &Constraint, times: &Schedule) -> bool {
    let difference = &times[constraint.to] - &times[constraint.from];
    let is_within = |bound: &Bound, is_outside: fn(&Rational, &Rational) -> bool| match bound {
        Bound::Finite(value) => !is_outside(&difference, value),
        Bound::Infinite => true,
        Bound::Parameter(_) => false,
    };
    is_within(&constraint.lower, |difference, lower| difference < lower)
        && is_within(&constraint.upper, |difference, upper| difference > upper)
}

#[cfg(test)]
mod tests;
