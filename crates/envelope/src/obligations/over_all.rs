//! Over-all conditions, which must hold at every moment of an action's open interval.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, FactId, FluentId};

use super::dnf::{Alternatives, WantedTruth};
use super::precedence::Precedence;
use super::timeline::{Reading, Timeline};
use super::{BadCase, Difference, Inequality, Refusal, Substitution};
use elbowroom_plan::{InstanceId, NodeId, StnPlan};

/// Numeric or compound over-all condition of one action.
///
/// It is violated if there is a moment strictly between `start` and `end`, with some of [its
/// events](Self::events) up to it and the others after it, at which the condition is false. The
/// events before the moment depend on the schedule; [`OverAll::cases`] gives the inequalities for
/// one choice.
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
    /// Outcomes of conditional effects that the condition applies to.
    pub assumptions: Vec<Inequality>,
    /// Node that represents the moment in differences and inequalities.
    pub moment: NodeId,
    /// Facts that the condition reads.
    facts: Vec<FactId>,
    fluents: Vec<FluentId>,
    near: NearbyEvents,
    all: Arc<Happenings>,
}

/// Possible places of a moment among the events, provided that the parameters' values are in their
/// ranges, and all interfering happenings keep their order.
#[derive(Clone, Debug)]
struct NearbyEvents {
    /// The events that can be on either side of it, in nominal order.
    events: Vec<NodeId>,
    /// The changes by these events, and by past ones.
    timeline: Timeline,
}

/// All happenings of a plan.
#[derive(Debug)]
pub(super) struct Happenings {
    pub(super) timeline: Timeline,
    pub(super) precedence: Precedence,
    pub(super) substitution: Arc<Substitution>,
}

impl OverAll {
    pub(super) fn new(
        task: &Task,
        plan: &StnPlan,
        instance: InstanceId,
        condition: &Condition,
        all: &Arc<Happenings>,
    ) -> Self {
        let (mut facts, mut fluents) = (BTreeSet::new(), BTreeSet::new());
        task.visit_facts_of(condition, &mut |fact| {
            facts.insert(fact);
        });
        task.visit_fluents_of(condition, &mut |fluent| {
            fluents.insert(fluent);
        });
        let (facts, fluents) = (Vec::from_iter(facts), Vec::from_iter(fluents));
        let (start, end) = (plan.start(instance), plan.end(instance));
        let mut around = all.precedence.around(start, end);
        let (timeline, open) = all.timeline.relevant_part((&facts, &fluents), &mut around);
        Self {
            instance,
            start,
            end,
            condition: condition.clone(),
            assumptions: all.timeline.assumptions.clone(),
            moment: NodeId::from(plan.nodes.len()),
            facts,
            fluents,
            near: NearbyEvents {
                events: all.precedence.in_order(open),
                timeline,
            },
            all: Arc::clone(all),
        }
    }

    /// Returns the nodes that change what the condition reads, and may come before the moment or
    /// after it, in nominal order. There are few of them if interfering happenings keep their
    /// order, and the parameters' values are in their ranges.
    pub fn events(&self, is_in_ranges: bool) -> Cow<'_, [NodeId]> {
        if is_in_ranges {
            return Cow::Borrowed(&self.near.events);
        }
        let timeline = &self.all.timeline;
        let of_facts = self.facts.iter().flat_map(|it| timeline.fact_nodes(*it));
        let of_fluents = self
            .fluents
            .iter()
            .flat_map(|it| timeline.fluent_nodes(*it));
        Cow::Owned(
            self.all
                .precedence
                .in_order(of_facts.chain(of_fluents).collect()),
        )
    }

    /// Returns the alternatives in which the condition is false at the moment. Of the
    /// [events](Self::events), exactly those for which `cut` is true have happened by then.
    ///
    /// # Errors
    /// If a value is not linear.
    pub fn cases(
        &self,
        task: &Task,
        plan: &StnPlan,
        is_in_ranges: bool,
        cut: &dyn Fn(NodeId) -> bool,
    ) -> Result<Alternatives, Refusal> {
        let has_happened = |node: NodeId| !self.near.events.contains(&node) || cut(node);
        let (timeline, cut): (_, &dyn Fn(NodeId) -> bool) = if is_in_ranges {
            (&self.near.timeline, &has_happened)
        } else {
            (&self.all.timeline, cut)
        };
        let reading = Reading {
            task,
            timeline,
            cut: Some(cut),
            moment: self.moment,
            action: Some((self.start, self.end)),
            substitution: &self.all.substitution,
            location: &plan.instance(self.instance).action.name,
            derived: OnceCell::new(),
        };
        reading.alternatives(&self.condition, WantedTruth::NotTrue)
    }
}

/// Returns the ways to violate an over-all condition on a single basic fact: the fact is wrong from
/// some event (or from the beginning) until the first event that corrects it, and that time
/// overlaps the action's open interval.
///
/// This is exact without any case split. Events that make a fact true interfere with those that
/// make it false, so each wrong event has a fixed set of correcting events after it, and the first
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
        // Corrected at the action's own start, or as it became wrong, so never wrong inside.
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
