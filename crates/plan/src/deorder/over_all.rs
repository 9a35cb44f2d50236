//! Writers of what is read throughout an action stay on their side of its start and end.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Condition, DurativeBody};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

use super::order::{Order, Quantity, Timeline, Writer, read_by};
use crate::stn_plan::{InstanceId, Node, NodeId, Reason, StnPlan};

/// Demands it of all writers, for all durative instances.
pub(super) fn order(task: &Task, plan: &StnPlan, timeline: &Timeline<'_>, order: &mut Order) {
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
        for quantity in read_by(&read_throughout(task, body)) {
            let writers = writers
                .entry(quantity)
                .or_insert_with(|| timeline.writers(quantity));
            keep_sides(writers, start, end, timeline, order);
        }
    }
}

/// Whether anything is read throughout the instance.
pub(super) fn has_any(task: &Task, plan: &StnPlan, id: InstanceId) -> bool {
    let body = plan.instance(id).action.durative();
    body.is_some_and(|body| read_by(&read_throughout(task, body)).next().is_some())
}

/// What must not change unnoticed while the action runs: over-all conditions, those of
/// conditional effects, and rates.
fn read_throughout(task: &Task, body: &DurativeBody) -> Footprint {
    let guards = body.end.effects.iter().map(|effect| &effect.guard);
    let guards = guards.chain(body.continuous.iter().map(|effect| &effect.guard));
    let mut conditions = vec![body.over_all.clone()];
    conditions.extend(guards.map(|guard| guard.over_all.clone()));
    let mut footprint = Footprint::of_condition(task, &Condition::And(conditions));
    for effect in &body.continuous {
        effect.rate.visit_fluents(&mut |fluent| {
            footprint.reads_fluents.insert(fluent);
        });
    }
    footprint
}

/// `writers` are those of one quantity. As runs keep their order among each other, it is enough
/// to hold the ones next to the start and next to the end.
fn keep_sides(
    writers: &[Writer],
    start: NodeId,
    end: NodeId,
    timeline: &Timeline<'_>,
    order: &mut Order,
) {
    let time = |writer: &Writer| timeline.time(writer.node);
    let before = writers.partition_point(|writer| time(writer) <= timeline.time(start));
    let until_end = writers.partition_point(|writer| time(writer) < timeline.time(end));
    let (before, rest) = writers.split_at(before);
    let (inside, after) = rest.split_at(until_end.saturating_sub(before.len()));
    let mut demand = |from, to| order.demand(from, to, Rational::ZERO, Reason::OverAll);
    for writer in last_run(before) {
        demand(writer.node, start);
    }
    for writer in first_run(inside) {
        demand(start, writer.node);
    }
    for writer in last_run(inside) {
        demand(writer.node, end);
    }
    for writer in first_run(after) {
        demand(end, writer.node);
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
