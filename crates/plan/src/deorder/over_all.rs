//! Orders that keep writers of over-all conditions on their side of an action's start and end.
//!
//! Not all writers need this:
//!
//! - A writer that establishes a fact as the action needs it is harmless at any time. One such
//!   writer must come before the action, if the fact does not have the value initially; the others
//!   are free.
//! - Increases and decreases of numbers in a comparison may be harmful or not, depending on the
//!   numbers. In two cases, these sides ([`Reason::Side`]) are listed separately, so that
//!   [`pin_until_sound`](super::pin_until_sound) can add those that are needed: if they would tie
//!   together happenings that are simultaneous in the plan, or the ends of actions that overlap.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Condition, DurativeBody, FactId, Guard};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

use super::order::{Order, Quantity, Timeline, Writer, read_by};
use crate::stn_plan::{InstanceId, Node, NodeId, Reason, StnPlan};

/// Adds the orders of all writers, for all durative instances. Orders of writers that may be
/// harmless go to `sides`.
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
            // During an action of duration 0, every condition would hold.
            let duration = timeline.time(end) - timeline.time(start);
            order.require_distance(
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
            constrain_to_keep_true(
                writers,
                wanted,
                is_so_at_first,
                (start, end),
                timeline,
                order,
            );
        }
        // If an interval contains fewer moments, a required condition is never violated. But an
        // effect whose guard was false at one of these moments might then take place.
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
                constrain_sides(writers, &action, timeline, &mut |_, from, to, distance| {
                    order.require_distance(from, to, distance, Reason::OverAll);
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
            constrain_sides(
                writers,
                &action,
                timeline,
                &mut |writer, from, to, least| {
                    if writer.is_shift() && !costs_nothing(from, to) {
                        sides.require_distance(from, to, least, Reason::Side);
                    } else {
                        order.require_distance(from, to, least, Reason::OverAll);
                    }
                },
            );
        }
    }
}

/// Returns `true` if two actions overlap, but neither is within the other. Then it is not useful to
/// try the orders in which one action ends before the other, or in which they start or end at the
/// same time.
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

/// Over-all conditions of an action, without those of its conditional effects.
#[derive(Default)]
struct Required {
    /// Basic facts with their required truth values.
    literals: Vec<(FactId, bool)>,
    /// Reads of comparisons that are conjuncts.
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

/// Returns `true` if the instance has an over-all condition, or an effect that depends on one.
pub(super) fn has_over_all_condition(plan: &StnPlan, id: InstanceId) -> bool {
    let body = plan.instance(id).action.durative();
    body.is_some_and(|body| !body.over_all.is_trivial() || has_guards(body))
}

/// Returns `true` if effects depend on over-all conditions.
fn has_guards(body: &DurativeBody) -> bool {
    let mut guards = guards(body);
    guards.any(|guard| !guard.over_all.is_trivial())
}

fn guards(body: &DurativeBody) -> impl Iterator<Item = &Guard> {
    let guards = body.end.effects.iter().map(|effect| &effect.guard);
    guards.chain(body.continuous.iter().map(|effect| &effect.guard))
}

/// Returns the reads of over-all conditions of conditional effects.
fn guards_throughout(task: &Task, body: &DurativeBody) -> Footprint {
    let conditions = guards(body).map(|guard| guard.over_all.clone()).collect();
    Footprint::of_condition(task, &Condition::And(conditions))
}

/// A durative action, and the distance from its start and its end that writers inside it must keep,
/// unless they are closer in the plan.
struct Span<'a> {
    start: NodeId,
    end: NodeId,
    distance: &'a Rational,
}

/// Keeps the writers of one quantity on their sides. Runs keep their order, so it is sufficient to
/// constrain those next to the start and next to the end.
fn constrain_sides(
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

/// Adds the orders that keep a fact at its `wanted` value between a start and an end.
/// `is_so_at_first` is `true` if it has the value before all writers.
///
/// Writers that establish the value and writers that destroy it keep their order. So it is
/// sufficient that one writer that establishes it comes before the start, and that the next ones
/// that destroy it come after the end.
fn constrain_to_keep_true(
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
    // In time order. The action's own start needs no constraint.
    let serving = &before[since.map_or(0, |position| position + 1)..];
    let own = serving.iter().find(|writer| writer.node == start);
    match own.or(serving.first()) {
        _ if since.is_none() && is_so_at_first => {}
        Some(first) => order.require_distance(first.node, start, Rational::ZERO, Reason::OverAll),
        // The fact has the wrong value. The validator has not read it, because the action has
        // duration 0.
        None => {
            for writer in last_run(before) {
                order.require_distance(writer.node, start, Rational::ZERO, Reason::OverAll);
            }
        }
    }
    let later = &writers[before.len()..];
    let spoiling = later.iter().position(|writer| !makes_so(writer));
    for writer in first_run(&later[spoiling.unwrap_or(later.len())..]) {
        let original = timeline.time(writer.node) - timeline.time(end);
        let least = original.min(Rational::ZERO);
        order.require_distance(end, writer.node, least, Reason::OverAll);
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
