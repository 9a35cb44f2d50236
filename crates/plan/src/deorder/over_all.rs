//! Writers of what is read throughout an action stay on their side of its start and end.
//!
//! Not all of them need to:
//!
//! - What makes a fact as the action needs it does no harm wherever it happens. One such writer
//!   must come before the action, if the fact is not so from the beginning; the others are free.
//! - Increases and decreases that a comparison of numbers reads may do harm or not; that depends
//!   on the numbers. Where keeping them on their sides would tie together what falls together in
//!   the plan, or the ends of actions that overlap, these sides ([`Reason::Side`]) are listed by
//!   themselves, for [`pin_until_sound`](super::pin_until_sound) to take those that it needs.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Condition, DurativeBody, FactId, Guard};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

use super::order::{Order, Quantity, Timeline, Writer, read_by};
use crate::stn_plan::{InstanceId, Node, NodeId, Reason, StnPlan};

/// Demands it of all writers, for all durative instances; of those that may do no harm, in
/// `sides`.
pub(super) fn order(
    task: &Task,
    plan: &StnPlan,
    timeline: &Timeline<'_>,
    order: &mut Order,
    sides: &mut Order,
) {
    let mut writers: BTreeMap<Quantity, Vec<Writer>> = BTreeMap::new();
    let mut ends = vec![NodeId::ZERO; plan.instances.len()];
    let mut starts = ends.clone();
    for (node, what) in plan.nodes() {
        match what {
            Node::Start(id) => starts[id.index()] = node,
            Node::End(id) => ends[id.index()] = node,
            _ => {}
        }
    }
    for (index, instance) in plan.instances.iter().enumerate() {
        let Some(body) = instance.action.durative() else {
            continue;
        };
        let (start, end) = (starts[index], ends[index]);
        if has_guards(body) {
            // In no time at all, anything would hold throughout.
            let duration = timeline.time(end) - timeline.time(start);
            order.demand(
                start,
                end,
                duration.min(task.epsilon().clone()),
                Reason::OverAll,
            );
        }
        let required = Required::of(task, body);
        for &(fact, wanted) in &required.literals {
            let writers = writers
                .entry(Quantity::Fact(fact))
                .or_insert_with(|| timeline.writers(Quantity::Fact(fact)));
            let is_so_at_first = task.initial().facts.contains(&fact) == wanted;
            keep_true(
                writers,
                wanted,
                is_so_at_first,
                (start, end),
                timeline,
                order,
            );
        }
        // A required condition only gains when a moment in which it was read is lost. But an
        // effect that did not happen could happen then.
        let decisive = guards_throughout(task, body);
        let epsilon = task.epsilon();
        for (footprint, distance) in [(&required.other, &Rational::ZERO), (&decisive, epsilon)] {
            for quantity in read_by(footprint) {
                let writers = writers
                    .entry(quantity)
                    .or_insert_with(|| timeline.writers(quantity));
                let action = Span {
                    start,
                    end,
                    distance,
                };
                keep_sides(writers, &action, timeline, &mut |_, from, to, distance| {
                    order.demand(from, to, distance, Reason::OverAll);
                });
            }
        }
        for quantity in read_by(&required.compared) {
            let writers = writers
                .entry(quantity)
                .or_insert_with(|| timeline.writers(quantity));
            let action = Span {
                start,
                end,
                distance: &Rational::ZERO,
            };
            let span = |node: NodeId| match plan.nodes[node.index()] {
                Node::Start(id) | Node::End(id) => (starts[id.index()], ends[id.index()]),
                _ => (node, node),
            };
            let costs_nothing = |from: NodeId, to: NodeId| {
                timeline.time(from) < timeline.time(to)
                    && !overlap_in_part(span(from), span(to), timeline)
            };
            keep_sides(
                writers,
                &action,
                timeline,
                &mut |writer, from, to, least| {
                    if writer.is_shift() && !costs_nothing(from, to) {
                        sides.demand(from, to, least, Reason::Side);
                    } else {
                        order.demand(from, to, least, Reason::OverAll);
                    }
                },
            );
        }
    }
}

/// Whether two actions, from start to end each, run together for a while, but neither within the
/// other. Nobody would then want the one to end before the other, or to start before it ends, as
/// little as that they start or end together.
fn overlap_in_part(
    (start, end): (NodeId, NodeId),
    (other_start, other_end): (NodeId, NodeId),
    timeline: &Timeline<'_>,
) -> bool {
    let time = |node| timeline.time(node);
    let (first, second) = if time(start) <= time(other_start) {
        (end, (other_start, other_end))
    } else {
        (other_end, (start, end))
    };
    time(second.0) < time(first) && time(first) < time(second.1)
}

/// The over-all conditions of an action, without those of its conditional effects.
#[derive(Default)]
struct Required {
    /// Basic facts, and whether they must be true.
    literals: Vec<(FactId, bool)>,
    /// The reads of comparisons that stand by themselves.
    compared: Footprint,
    /// All other reads: by other conditions, and by rates.
    other: Footprint,
}

impl Required {
    fn of(task: &Task, body: &DurativeBody) -> Self {
        let mut required = Self::default();
        let mut others = Vec::new();
        let mut comparisons = Vec::new();
        for condition in body.over_all.conjuncts() {
            match condition {
                Condition::Fact(fact) if !task.is_derived(*fact) => {
                    required.literals.push((*fact, true));
                }
                Condition::Not(part) => match **part {
                    Condition::Fact(fact) if !task.is_derived(fact) => {
                        required.literals.push((fact, false));
                    }
                    _ => others.push(condition.clone()),
                },
                Condition::Compare(..) => comparisons.push(condition.clone()),
                _ => others.push(condition.clone()),
            }
        }
        required.compared = Footprint::of_condition(task, &Condition::And(comparisons));
        required.other = Footprint::of_condition(task, &Condition::And(others));
        for effect in &body.continuous {
            effect.rate.visit_fluents(&mut |fluent| {
                required.other.reads_fluents.insert(fluent);
            });
        }
        required
    }
}

/// Whether anything is required throughout the instance, or decided by it.
pub(super) fn has_any(plan: &StnPlan, id: InstanceId) -> bool {
    let body = plan.instance(id).action.durative();
    body.is_some_and(|body| !body.over_all.is_trivial() || has_guards(body))
}

/// Whether effects depend on what holds throughout the action.
fn has_guards(body: &DurativeBody) -> bool {
    let mut guards = guards(body);
    guards.any(|guard| !guard.over_all.is_trivial())
}

fn guards(body: &DurativeBody) -> impl Iterator<Item = &Guard> {
    let guards = body.end.effects.iter().map(|effect| &effect.guard);
    guards.chain(body.continuous.iter().map(|effect| &effect.guard))
}

/// The reads of over-all conditions of conditional effects.
fn guards_throughout(task: &Task, body: &DurativeBody) -> Footprint {
    let conditions = guards(body).map(|guard| guard.over_all.clone()).collect();
    Footprint::of_condition(task, &Condition::And(conditions))
}

/// A durative action, and how far inside it writers that were inside must stay, unless they were
/// closer to its start or end.
struct Span<'a> {
    start: NodeId,
    end: NodeId,
    distance: &'a Rational,
}

/// `writers` are those of one quantity. As runs keep their order among each other, it is enough
/// to hold the ones next to the start and next to the end.
fn keep_sides(
    writers: &[Writer],
    action: &Span<'_>,
    timeline: &Timeline<'_>,
    demand: &mut dyn FnMut(&Writer, NodeId, NodeId, Rational),
) {
    let (start, end) = (action.start, action.end);
    let time = |writer: &Writer| timeline.time(writer.node);
    let before = writers.partition_point(|writer| time(writer) <= timeline.time(start));
    let until_end = writers.partition_point(|writer| time(writer) < timeline.time(end));
    let (before, rest) = writers.split_at(before);
    let (inside, after) = rest.split_at(until_end.saturating_sub(before.len()));
    let mut demand = |writer: &Writer, from, to, least: &Rational| {
        let original = timeline.time(to) - timeline.time(from);
        demand(writer, from, to, original.min(least.clone()));
    };
    for writer in last_run(before) {
        demand(writer, writer.node, start, &Rational::ZERO);
    }
    for writer in first_run(inside) {
        demand(writer, start, writer.node, action.distance);
    }
    for writer in last_run(inside) {
        demand(writer, writer.node, end, action.distance);
    }
    for writer in first_run(after) {
        demand(writer, end, writer.node, &Rational::ZERO);
    }
}

/// Demands what keeps a fact as it is `wanted` between a start and an end, given its writers and
/// whether it is so before all of them.
///
/// What makes it so and what makes it otherwise keep their order among each other. So one writer
/// that makes it so before the start is enough, and those that make it otherwise next must come
/// after the end.
fn keep_true(
    writers: &[Writer],
    wanted: bool,
    is_so_at_first: bool,
    (start, end): (NodeId, NodeId),
    timeline: &Timeline<'_>,
    order: &mut Order,
) {
    let time = |writer: &Writer| timeline.time(writer.node);
    let makes_so = |writer: &Writer| writer.makes_true() == wanted;
    let is_before = |writer: &Writer| time(writer) <= timeline.time(start);
    let before = &writers[..writers.partition_point(is_before)];
    let since = before.iter().rposition(|writer| !makes_so(writer));
    // In time order; the action's own start serves without any demand.
    let serving = &before[since.map_or(0, |position| position + 1)..];
    let own = serving.iter().find(|writer| writer.node == start);
    match own.or(serving.first()) {
        _ if since.is_none() && is_so_at_first => {}
        Some(first) => order.demand(first.node, start, Rational::ZERO, Reason::OverAll),
        // It is not so: nobody has looked, as the action takes no time.
        None => {
            for writer in last_run(before) {
                order.demand(writer.node, start, Rational::ZERO, Reason::OverAll);
            }
        }
    }
    let later = &writers[before.len()..];
    let spoiling = later.iter().position(|writer| !makes_so(writer));
    for writer in first_run(&later[spoiling.unwrap_or(later.len())..]) {
        let original = timeline.time(writer.node) - timeline.time(end);
        let least = original.min(Rational::ZERO);
        order.demand(end, writer.node, least, Reason::OverAll);
    }
}

fn first_run(writers: &[Writer]) -> impl Iterator<Item = &Writer> {
    let run = writers.first().map(|writer| writer.run);
    writers
        .iter()
        .take_while(move |writer| Some(writer.run) == run)
}

fn last_run(writers: &[Writer]) -> impl Iterator<Item = &Writer> {
    let run = writers.last().map(|writer| writer.run);
    writers
        .iter()
        .rev()
        .take_while(move |writer| Some(writer.run) == run)
}
