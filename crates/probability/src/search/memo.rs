//! Dominance between sequences with the same happenings.
//!
//! Two sequences are *equivalent in progress* if they have used the same instances, have the same
//! running instances, have passed the same timed initials, and have the same relevant nominal state
//! and numbers. Then the same happenings can follow, apart from time, and every continuation has a
//! probability that is linear in the distribution of each independent group of facts. So sequence A
//! *dominates* B if
//!
//! `P_A(A) · Π over groups min over assignments x of p_A(x) / p_B(x)  >=  P_B(A)`
//!
//! and A has at least as much time left. For an independent fact, the minimum is over true and
//! false. If no later happening needs it to be false, a greater probability does no harm, and only
//! `p_A / p_B` counts if it is below 1.

use elbowroom_plan::{InstanceId, Node};
use indexmap::IndexMap;

use super::nominal::{Nominal, Truth};
use super::separations::Separations;
use super::time_slack::TimeSlack;
use crate::model::{Model, Requirement, visit_facts};
use crate::network::{Number, PrunedNetwork, Snapshot};

/// Largest number of remembered sequences that are equivalent in progress.
const MAX_ENTRIES: usize = 64;

/// Remembered sequences.
#[derive(Clone, Debug)]
pub(super) struct Memo {
    entries: IndexMap<Key, Vec<Entry>>,
    needs: Needs,
    marks: Vec<usize>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Key {
    is_used: Vec<bool>,
    running: Vec<InstanceId>,
    next_timed: usize,
    /// `true` if the last happening is a timed initial. Such a sequence may not be an order; see
    /// `OrderSearch::may_be_over`.
    is_timed_last: bool,
    /// If facts change with time: see [`PrunedNetwork::times_to_come`].
    times: Vec<i64>,
    truths: Vec<Truth>,
    numbers: Vec<Number>,
}

#[derive(Clone, Debug)]
struct Entry {
    probability: f64,
    facts: Snapshot,
    time_slack: Option<TimeSlack>,
}

/// Facts, with truth values, that conditions depend on.
#[derive(Clone, Debug)]
struct Needs {
    /// By instance: needs of its start and over-all conditions, and needs of its over-all
    /// conditions and end.
    whole: Vec<Vec<(usize, u8)>>,
    rest: Vec<Vec<(usize, u8)>>,
    goal: Need,
    /// Facts whose greater probability may be worse although nothing needs them to be false.
    is_non_monotone: Vec<bool>,
}

/// By fact: bit 0, needed true; bit 1, needed false.
type Need = Vec<u8>;

const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BOTH: u8 = 3;

impl Memo {
    pub(super) fn new(model: &Model, separations: &Separations) -> Self {
        let count = model.facts.len();
        let mut whole = Vec::new();
        let mut rest = Vec::new();
        for (id, _) in model.plan().instances() {
            let start = model.event(separations.starts[id.index()]);
            let end = model.event(separations.ends[id.index()]);
            let mut need = vec![0; count];
            for event in [start, end] {
                include(&mut need, &event.over_all);
                for (memory, condition) in &event.guard_memories {
                    need[*memory] = BOTH;
                    include_condition(model, &mut need, condition);
                }
                if std::ptr::eq(event, start) && !std::ptr::eq(start, end) {
                    continue;
                }
                include(&mut need, &event.condition);
                include_guards(model, &mut need, event);
            }
            rest.push(sparse(&need));
            include(&mut need, &start.condition);
            include_guards(model, &mut need, start);
            whole.push(sparse(&need));
        }
        let mut goal = vec![0; count];
        include(&mut goal, &model.goal);
        let is_turbulent = model.spontaneous_changes.iter();
        let is_turbulent = is_turbulent.map(|flip| flip.becomes_true + flip.becomes_false > 1.0);
        Self {
            entries: IndexMap::new(),
            needs: Needs {
                whole,
                rest,
                goal,
                is_non_monotone: is_turbulent.collect(),
            },
            marks: Vec::new(),
        }
    }

    /// Stores a position in the history of the nominal state.
    pub(super) fn mark(&mut self, checkpoint: usize) {
        self.marks.push(checkpoint);
    }

    /// Removes and returns the last stored position.
    pub(super) fn unmark(&mut self) -> usize {
        self.marks.pop().unwrap_or(0)
    }

    /// Returns `true` if a remembered sequence dominates this one. Otherwise, remembers this one.
    pub(super) fn is_dominated(
        &mut self,
        model: &Model,
        nominal: &Nominal,
        network: &mut PrunedNetwork<'_>,
        is_used: &[bool],
        (next_timed, has_timed): (usize, bool),
        room: Option<TimeSlack>,
    ) -> bool {
        let need = self.needs.of(is_used, network.running());
        let mut running = network.running().to_vec();
        running.sort_unstable();
        let numbers = (0..model.fluents.len()).map(|fluent| network.number(fluent).clone());
        let last = network.sequence().last();
        let matters = |fact: &usize| need[*fact] != 0;
        let key = Key {
            is_used: is_used.to_vec(),
            running,
            next_timed,
            is_timed_last: last
                .is_some_and(|node| matches!(model.plan().nodes[node.index()], Node::Timed(_))),
            times: network.pending_times(has_timed),
            truths: (0..need.len())
                .filter(matters)
                .map(|fact| nominal.truth(fact))
                .collect(),
            numbers: numbers.collect(),
        };
        let entry = Entry {
            probability: network.actions_probability(),
            facts: network.snapshot(&|fact| need[fact] != 0),
            time_slack: room,
        };
        let known = self.entries.entry(key).or_default();
        if known.iter().any(|other| other.dominates(&entry, &need)) {
            return true;
        }
        known.retain(|other| !entry.dominates(other, &need));
        if known.len() < MAX_ENTRIES {
            known.push(entry);
        }
        false
    }
}

impl Entry {
    fn dominates(&self, other: &Self, need: &Need) -> bool {
        let has_room = match (&self.time_slack, &other.time_slack) {
            (None, None) => true,
            (Some(own), Some(its)) => own.contains(its),
            _ => false,
        };
        // A ratio of products of the same factors in another order may be off in the last digits.
        has_room
            && self.probability * ratio(&self.facts, &other.facts, need)
                >= other.probability * (1.0 - 1e-12)
    }
}

/// Returns a lower bound of the ratio of the probabilities of any continuation from the two
/// distributions.
fn ratio(from: &Snapshot, than: &Snapshot, need: &Need) -> f64 {
    if from.coupled.len() != than.coupled.len() {
        return 0.0;
    }
    let mut ratio = 1.0;
    for ((own_facts, own), (facts, weights)) in from.coupled.iter().zip(&than.coupled) {
        if own_facts != facts {
            return 0.0;
        }
        let pairs = own.iter().zip(weights);
        ratio *= pairs
            .map(|(&own, &its)| ratio_or_infinity(own, its))
            .fold(f64::INFINITY, f64::min);
    }
    if from.single.len() != than.single.len() {
        return 0.0;
    }
    for (&(fact, own), &(its_fact, its)) in from.single.iter().zip(&than.single) {
        if fact != its_fact {
            return 0.0;
        }
        let if_true = ratio_or_infinity(own, its);
        let if_false = ratio_or_infinity(1.0 - own, 1.0 - its);
        ratio *= match need[fact] {
            TRUE => if_true.min(1.0),
            FALSE => if_false.min(1.0),
            _ => if_true.min(if_false),
        };
    }
    ratio
}

/// Returns `own / its`, or infinity if `its` is 0.
fn ratio_or_infinity(own: f64, its: f64) -> f64 {
    if its > 0.0 { own / its } else { f64::INFINITY }
}

impl Needs {
    fn of(&self, is_used: &[bool], running: &[InstanceId]) -> Need {
        let mut need = self.goal.clone();
        let mut add = |part: &[(usize, u8)]| {
            for &(fact, one) in part {
                need[fact] |= one;
            }
        };
        for (whole, _) in self.whole.iter().zip(is_used).filter(|(_, used)| !**used) {
            add(whole);
        }
        for id in running {
            add(&self.rest[id.index()]);
        }
        for (need, _) in need
            .iter_mut()
            .zip(&self.is_non_monotone)
            .filter(|(_, is)| **is)
        {
            if *need != 0 {
                *need = BOTH;
            }
        }
        need
    }
}

/// Returns the facts with a need; an action reads few of all facts.
fn sparse(need: &Need) -> Vec<(usize, u8)> {
    let facts = need.iter().copied().enumerate();
    facts.filter(|(_, need)| *need != 0).collect()
}

fn include(need: &mut Need, requirement: &Requirement) {
    for &(fact, truth) in &requirement.literals {
        need[fact] |= if truth { TRUE } else { FALSE };
    }
    for coupled in &requirement.coupled {
        for &fact in &coupled.facts {
            need[fact] = BOTH;
        }
    }
}

fn include_condition(
    model: &Model,
    need: &mut Need,
    condition: &elbowroom_model::ground::Condition,
) {
    visit_facts(model.task(), condition, &mut |fact| {
        if let Some(fact) = model.position(fact) {
            need[fact] = BOTH;
        }
    });
}

fn include_guards(model: &Model, need: &mut Need, event: &crate::model::Event) {
    for guard in event
        .effects
        .iter()
        .filter_map(|effect| effect.guard.as_ref())
    {
        include_condition(model, need, guard);
    }
    for guard in event
        .updates
        .iter()
        .filter_map(|update| update.guard.as_ref())
    {
        include_condition(model, need, guard);
    }
}
