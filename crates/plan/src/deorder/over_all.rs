//! Writers of what is read throughout an action stay on their side of its start and end.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Condition, DurativeBody, Guard};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

use super::order::{Order, Quantity, Timeline, Writer, read_by};
use crate::stn_plan::{InstanceId, Node, NodeId, Reason, StnPlan};

/// Demands it of all writers, for all durative instances.
pub(super) fn order(
    task: &Task,
    plan: &StnPlan,
    timeline: &Timeline<'_>,
    epsilon: &Rational,
    order: &mut Order,
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
            order.demand(start, end, duration.min(epsilon.clone()), Reason::OverAll);
        }
        // A required condition only gains when a moment in which it was read is lost. But an
        // effect that did not happen could happen then.
        let required = (read_throughout(task, body), Rational::ZERO);
        let decisive = (guards_throughout(task, body), epsilon.clone());
        for (footprint, distance) in [required, decisive] {
            for quantity in read_by(&footprint) {
                let writers = writers
                    .entry(quantity)
                    .or_insert_with(|| timeline.writers(quantity));
                let action = Span {
                    start,
                    end,
                    distance: &distance,
                };
                keep_sides(writers, &action, timeline, order);
            }
        }
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

/// What over-all conditions and rates read.
fn read_throughout(task: &Task, body: &DurativeBody) -> Footprint {
    let mut footprint = Footprint::of_condition(task, &body.over_all);
    for effect in &body.continuous {
        effect.rate.visit_fluents(&mut |fluent| {
            footprint.reads_fluents.insert(fluent);
        });
    }
    footprint
}

/// What over-all conditions of conditional effects read.
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
fn keep_sides(writers: &[Writer], action: &Span<'_>, timeline: &Timeline<'_>, order: &mut Order) {
    let (start, end) = (action.start, action.end);
    let time = |writer: &Writer| timeline.time(writer.node);
    let before = writers.partition_point(|writer| time(writer) <= timeline.time(start));
    let until_end = writers.partition_point(|writer| time(writer) < timeline.time(end));
    let (before, rest) = writers.split_at(before);
    let (inside, after) = rest.split_at(until_end.saturating_sub(before.len()));
    let mut demand = |from, to, least: &Rational| {
        let original = timeline.time(to) - timeline.time(from);
        order.demand(from, to, original.min(least.clone()), Reason::OverAll);
    };
    for writer in last_run(before) {
        demand(writer.node, start, &Rational::ZERO);
    }
    for writer in first_run(inside) {
        demand(start, writer.node, action.distance);
    }
    for writer in last_run(inside) {
        demand(writer.node, end, action.distance);
    }
    for writer in first_run(after) {
        demand(end, writer.node, &Rational::ZERO);
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
