//! Interchangeable instances.
//!
//! Example: three machines of one kind need the same maintenance. Any order that begins with the
//! second machine is as likely as a symmetric order that begins with the first one. Of such
//! instances, only the first unused one is tried, which keeps one of each set of symmetric orders.
//!
//! Two instances are interchangeable if swapping them, and the facts that only they access, changes
//! nothing: not the model (probabilities, conditions, effects, the goal), not durations and
//! separations, and not the belief. Instances that read or write numbers, or read facts other than
//! as single literals, are treated as unique.

use elbowroom_plan::{InstanceId, NodeId};

use super::separations::Separations;
use crate::likelihoods::Rate;
use crate::model::{Event, Model};
use crate::search_state::SearchState;

/// Symmetries of a model, computed once for all searches.
#[derive(Clone, Debug)]
pub(super) struct Symmetry {
    /// For each instance, its class, and the facts that only it accesses, in corresponding order.
    instances: Vec<Option<(usize, Vec<usize>)>>,
}

/// A fact from the viewpoint of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Seen {
    Shared(usize),
    Own(usize),
}

/// Properties of an instance, independent of the names of its own facts.
#[derive(Clone, Debug, PartialEq)]
struct Signature {
    is_durative: bool,
    duration: (elbowroom_num::Rational, Option<elbowroom_num::Rational>),
    success: [f64; 3],
    /// Conditions at start, over all, and at end.
    needs: [Vec<(Seen, bool)>; 3],
    /// Effects at start and end, with their probability; `true` if they cannot fail.
    effects: [Vec<(Seen, bool, f64, bool)>; 2],
    /// For each own fact: the probabilities of spontaneous changes, the rates of changes with time,
    /// and its required value in the goal.
    own: Vec<(f64, f64, Rate, Option<bool>)>,
}

impl Symmetry {
    pub(super) fn of(model: &Model, separations: &Separations) -> Self {
        let touched: Vec<Vec<usize>> = model
            .plan()
            .instances()
            .map(|(id, _)| facts_of(model, id))
            .collect();
        let mut by_how_many = vec![0; model.facts.len()];
        let timed = separations.timed.iter().map(|(node, _)| model.event(*node));
        let others = timed.flat_map(|event| event.effects.iter().map(|effect| effect.fact));
        let coupled = model.goal.coupled.iter().flat_map(|part| &part.facts);
        for fact in others.chain(coupled.copied()) {
            by_how_many[fact] = 2;
        }
        for &fact in touched.iter().flatten() {
            by_how_many[fact] += 1;
        }
        let mut classes: Vec<(Signature, InstanceId)> = Vec::new();
        let instances = model.plan().instances().map(|(id, _)| {
            let is_own = |fact: usize| by_how_many[fact] == 1;
            let (signature, own) = signature(model, separations, id, &is_own)?;
            let same = classes.iter().position(|(other, first)| {
                *other == signature && separations.are_swappable(*first, id)
            });
            let class = same.unwrap_or_else(|| {
                classes.push((signature, id));
                classes.len() - 1
            });
            Some((class, own))
        });
        Self {
            instances: instances.collect(),
        }
    }

    /// Returns, for each instance, the one that has to be used before it, if there is one.
    pub(super) fn order(
        &self,
        model: &Model,
        circumstances: &SearchState,
    ) -> Vec<Option<InstanceId>> {
        let is_free = |id: InstanceId| {
            let nodes = [model.start(id), model.end(id)];
            let mut recent = circumstances.recent.iter();
            !circumstances.is_running(id) && !recent.any(|(node, _)| nodes.contains(node))
        };
        let belief = |facts: &[usize]| -> Vec<u64> {
            let chance = |&fact: &usize| circumstances.belief.probability(model.facts[fact]);
            facts.iter().map(|fact| chance(fact).to_bits()).collect()
        };
        let mut last: Vec<((usize, Vec<u64>), InstanceId)> = Vec::new();
        let mut order = Vec::with_capacity(self.instances.len());
        for (index, instance) in self.instances.iter().enumerate() {
            let id = InstanceId::from(index);
            let mut before = None;
            if let Some((class, own)) = instance.as_ref().filter(|_| is_free(id)) {
                let kind = (*class, belief(own));
                match last.iter_mut().find(|(other, _)| *other == kind) {
                    Some((_, last)) => before = Some(std::mem::replace(last, id)),
                    None => last.push((kind, id)),
                }
            }
            order.push(before);
        }
        order
    }
}

fn events_of(model: &Model, id: InstanceId) -> (bool, [&Event; 2]) {
    let (start, end) = (model.start(id), model.end(id));
    (start != end, [model.event(start), model.event(end)])
}

/// Returns the facts that an instance reads as single literals, or writes.
fn facts_of(model: &Model, id: InstanceId) -> Vec<usize> {
    let (_, events) = events_of(model, id);
    let mut facts: Vec<usize> = Vec::new();
    for event in events {
        for requirement in [&event.condition, &event.over_all] {
            facts.extend(requirement.literals.iter().map(|(fact, _)| *fact));
            facts.extend(requirement.coupled.iter().flat_map(|part| &part.facts));
        }
        facts.extend(event.effects.iter().map(|effect| effect.fact));
        facts.extend(event.guard_memories.iter().map(|(memory, _)| *memory));
    }
    facts.sort_unstable();
    facts.dedup();
    facts
}

/// Returns an instance's signature and its own facts; `None` if it is treated as unique.
fn signature(
    model: &Model,
    separations: &Separations,
    id: InstanceId,
    is_own: &dyn Fn(usize) -> bool,
) -> Option<(Signature, Vec<usize>)> {
    let (is_durative, events) = events_of(model, id);
    for event in events {
        let requirements = [&event.condition, &event.over_all];
        let is_plain = requirements
            .iter()
            .all(|needs| needs.numeric.is_empty() && needs.coupled.is_empty())
            && event.guard_memories.is_empty()
            && event.updates.is_empty()
            && event.continuous.is_empty()
            && event.effects.iter().all(|effect| effect.guard.is_none());
        if !is_plain {
            return None;
        }
    }
    let [start, end] = events;
    let mut own: Vec<usize> = Vec::new();
    // Shared facts come first, so that the result does not depend on the numbers of facts.
    let mut see = |fact: usize| {
        if !is_own(fact) {
            return Seen::Shared(fact);
        }
        let known = own.iter().position(|&other| other == fact);
        Seen::Own(known.unwrap_or_else(|| {
            own.push(fact);
            own.len() - 1
        }))
    };
    let mut needs = |literals: &[(usize, bool)]| {
        let mut seen: Vec<_> = literals
            .iter()
            .map(|&(fact, truth)| (see(fact), truth))
            .collect();
        seen.sort_unstable();
        seen
    };
    let needs = [
        needs(&start.condition.literals),
        needs(&start.over_all.literals),
        needs(&end.condition.literals),
    ];
    let mut effects = |event: &Event| {
        let effects = event.effects.iter();
        let mut seen: Vec<_> = effects
            .map(|e| (see(e.fact), e.makes_true, e.probability, e.is_certain))
            .collect();
        seen.sort_by_key(|(fact, makes_true, ..)| (*fact, *makes_true));
        seen
    };
    let effects = [effects(start), effects(end)];
    let wanted = |fact: usize| {
        let mut goal = model.goal.literals.iter();
        goal.find(|(own, _)| *own == fact).map(|(_, truth)| *truth)
    };
    let flips = own.iter().map(|&fact| {
        let flip = model.spontaneous_changes[fact];
        let rate = model.rates[fact];
        (flip.becomes_true, flip.becomes_false, rate, wanted(fact))
    });
    let signature = Signature {
        is_durative,
        duration: separations.durations[id.index()].clone(),
        success: [start.success, end.success, start.failures_per_second],
        needs,
        effects,
        own: flips.collect(),
    };
    Some((signature, own))
}

impl Separations {
    /// Returns `true` if separations stay the same when two instances are swapped.
    fn are_swappable(&self, one: InstanceId, other: InstanceId) -> bool {
        let nodes = |id: InstanceId| [self.starts[id.index()], self.ends[id.index()]];
        let (ones, others) = (nodes(one), nodes(other));
        let swapped = |node: NodeId| {
            let place = |nodes: &[NodeId; 2]| nodes.iter().position(|own| *own == node);
            match (place(&ones), place(&others)) {
                (Some(place), _) => others[place],
                (_, Some(place)) => ones[place],
                _ => node,
            }
        };
        let stays = |from: NodeId, to: NodeId| {
            let (new_from, new_to) = (swapped(from), swapped(to));
            self.must_be_separated(from, to) == self.must_be_separated(new_from, new_to)
                && self.may_precede(from, to) == self.may_precede(new_from, new_to)
        };
        let all = || (0..self.node_count()).map(NodeId::from);
        let mut moved = ones.into_iter().chain(others);
        moved.all(|node| all().all(|other| stays(node, other) && stays(other, node)))
    }
}
