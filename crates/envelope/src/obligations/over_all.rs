//! Over-all conditions: what must hold at every moment of an action's open interval.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, FactId};

use super::dnf::{Alternatives, Wanted};
use super::precedence::Precedence;
use super::timeline::{Reading, Timeline};
use super::{BadCase, Difference, Inequality, Refusal, Substitution};
use elbowroom_plan::{InstanceId, NodeId, StnPlan};

/// A numeric or compound over-all condition of one action.
///
/// It is violated if there is a moment strictly between `start` and `end`, with some of `events`
/// up to it and the others after it, at which the condition is false. Which events come before
/// the moment depends on the schedule; [`OverAll::cases`] gives the inequalities for one choice.
#[derive(Clone, Debug)]
pub struct OverAll {
    /// The action.
    pub instance: InstanceId,
    /// Its start.
    pub start: NodeId,
    /// Its end.
    pub end: NodeId,
    /// The condition, one conjunct.
    pub condition: Condition,
    /// The nodes that change what the condition reads, in nominal order.
    pub events: Vec<NodeId>,
    /// The events of which it is known whether they come before the moment, as long as the
    /// parameters' values are in their ranges; and whether they do.
    pub(crate) settled: BTreeMap<NodeId, bool>,
    /// Under which outcomes of conditional effects all this applies.
    pub assumptions: Vec<Inequality>,
    /// Stands for the moment in differences and inequalities.
    pub moment: NodeId,
    timeline: Arc<Timeline>,
    substitution: Arc<Substitution>,
}

impl OverAll {
    pub(super) fn new(
        task: &Task,
        plan: &StnPlan,
        instance: InstanceId,
        condition: &Condition,
        (order, precedence): (&[NodeId], &Precedence),
        timeline: &Arc<Timeline>,
        substitution: &Arc<Substitution>,
    ) -> Self {
        let mut touched = BTreeSet::new();
        task.visit_facts_of(condition, &mut |fact| {
            touched.extend(timeline.fact_nodes(fact));
        });
        task.visit_fluents_of(condition, &mut |fluent| {
            touched.extend(timeline.fluent_nodes(fluent));
        });
        let (start, end) = (plan.start(instance), plan.end(instance));
        let events = order.iter().copied();
        let events: Vec<NodeId> = events.filter(|node| touched.contains(node)).collect();
        let (happened, to_come) = (precedence.not_after(start), precedence.not_before(end));
        let settled = events.iter().filter_map(|event| {
            let has_happened = happened.contains(event);
            (has_happened || to_come.contains(event)).then_some((*event, has_happened))
        });
        Self {
            instance,
            start,
            end,
            condition: condition.clone(),
            settled: settled.collect(),
            events,
            assumptions: timeline.assumptions.clone(),
            moment: NodeId::from(plan.nodes.len()),
            timeline: Arc::clone(timeline),
            substitution: Arc::clone(substitution),
        }
    }

    /// The alternatives in which the condition is false at the moment, when exactly the events
    /// for which `cut` is true have happened.
    ///
    /// # Errors
    /// When a value is not linear.
    pub fn cases(
        &self,
        task: &Task,
        plan: &StnPlan,
        cut: &dyn Fn(NodeId) -> bool,
    ) -> Result<Alternatives, Refusal> {
        let reading = Reading {
            task,
            timeline: &self.timeline,
            cut,
            moment: self.moment,
            action: Some((self.start, self.end)),
            substitution: &self.substitution,
            place: &plan.instance(self.instance).action.name,
            derived: OnceCell::new(),
        };
        reading.alternatives(&self.condition, Wanted::NotTrue)
    }
}

/// How an over-all condition on a single basic fact is violated: the fact is wrong from some
/// event (or from the beginning) until all events that right it, and that time overlaps the
/// action's open interval.
///
/// This is exact without any case split: events that make a fact true interfere with those that
/// make it false, so each wrong event has a fixed set of righting events after it, and the first
/// of these to happen ends the wrong time.
pub(super) fn literal_cases(
    timeline: &Timeline,
    fact: FactId,
    wanted: bool,
    start: NodeId,
    end: NodeId,
) -> Vec<BadCase> {
    let history = timeline.fact_history(fact);
    let mut wrongs: Vec<Option<usize>> = Vec::new();
    if history.initially != wanted {
        wrongs.push(None);
    }
    let wrong_events = history
        .events
        .iter()
        .enumerate()
        .filter(|(_, event)| event.1 != wanted);
    wrongs.extend(wrong_events.map(|(index, _)| Some(index)));
    let mut cases = Vec::new();
    for wrong in wrongs {
        let (since, later) = match wrong {
            Some(index) => (Some(history.events[index].0), &history.events[index + 1..]),
            None => (None, &history.events[..]),
        };
        if since == Some(end) {
            continue;
        }
        let mut differences = vec![Difference::before(start, end)];
        differences.extend(since.map(|since| Difference::before(since, end)));
        let righting = later
            .iter()
            .skip_while(|event| event.1 != wanted)
            .take_while(|event| event.1 == wanted)
            .map(|event| event.0);
        let righting: Vec<NodeId> = righting.collect();
        // Righted at the action's own start, or as it began to be wrong: never inside.
        if righting
            .iter()
            .any(|&right| right == start || Some(right) == since)
        {
            continue;
        }
        differences.extend(
            righting
                .iter()
                .map(|&right| Difference::before(start, right)),
        );
        cases.push(BadCase {
            differences,
            inequalities: timeline.assumptions.clone(),
        });
    }
    cases
}
