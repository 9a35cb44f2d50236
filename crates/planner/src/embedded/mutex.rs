//! Mutex groups: sets of atoms of which at most one is true in each reachable state. An atom is a
//! fact, or the statement that an action is running. An example is "the robot is at a, at b, or
//! drives from a to b": a variable of a finite domain.
//!
//! A set is a mutex group if at most one of its atoms is true in the initial state, and each
//! happening *balances* it: a happening that makes an atom of the set true makes no other one true,
//! and needs one that it makes false (the invariants of Helmert, AIJ 173, 2009; the fam-groups of
//! Fišer & Komenda, JAIR 61, 2018). Starts and ends are operators here: a start makes the atom of
//! the running action true, and its end needs this atom and makes it false. Sets are found on the
//! ground problem: a set grows from an atom that is true in the initial state, by atoms that
//! balance the happenings that would add to it. If there are several candidates, the same position
//! in the list of deletions is tried for all actions of a schema, one position after the other.

use super::compile::{Change, Compiled, NONE, Snap};
use super::formula::is_set;
use super::hash::Map;
use super::state::State;

/// Maximum number of choices tried for each initial atom.
const MAX_TRIES: usize = 16;

/// A start, an end, an instant or timed initials.
#[derive(Debug, Default)]
struct Operator {
    /// In ascending order, as all lists.
    needs: Vec<u32>,
    adds: Vec<u32>,
    /// Atoms that it needs and makes false, in the order of its effects.
    uses_up: Vec<u32>,
    /// Operators of one kind make the same choice.
    kind: u32,
}

/// The mutex groups of a problem.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mutexes {
    /// Sets of atoms by number: facts, then the running actions. In ascending order.
    pub(crate) groups: Vec<Vec<u32>>,
    /// For each fact, the groups that contain it.
    of_fact: Vec<Vec<u32>>,
}

impl Mutexes {
    /// Returns the groups from a state that are found with at most `most_work` work.
    pub(crate) fn of(compiled: &Compiled, state: &State, most_work: u64) -> Self {
        let mut finder = Finder::new(compiled, state);
        let mut mutexes = Self {
            groups: Vec::new(),
            of_fact: vec![Vec::new(); compiled.facts.len()],
        };
        for seed in 0..narrow(finder.weight.len()) {
            if finder.work > most_work {
                break;
            }
            let is_known = mutexes.of_fact.get(seed as usize);
            if finder.weight[seed as usize] != 1 || is_known.is_some_and(|known| !known.is_empty())
            {
                continue;
            }
            let Some(mut group) = finder.group_with(seed) else {
                continue;
            };
            group.sort_unstable();
            let number = narrow(mutexes.groups.len());
            for &atom in &group {
                if let Some(groups) = mutexes.of_fact.get_mut(atom as usize) {
                    groups.push(number);
                }
            }
            mutexes.groups.push(group);
        }
        mutexes
    }
}

/// Search for mutex groups.
struct Finder {
    operators: Vec<Operator>,
    /// For each atom, the operators that make it true.
    adding: Vec<Vec<u32>>,
    /// For each atom, the operators that use it up.
    using: Vec<Vec<u32>>,
    /// Number of times each atom is true in the initial state.
    weight: Vec<u32>,
    is_member: Vec<bool>,
    work: u64,
}

/// Choices: for a kind of operators, the chosen position among the atoms that they use up, and the
/// number of positions.
type Choices = Vec<(u32, usize, usize)>;

impl Finder {
    fn new(compiled: &Compiled, state: &State) -> Self {
        let facts = narrow(compiled.facts.len());
        let atoms = compiled.facts.len() + compiled.actions.len();
        let mut weight = vec![0; atoms];
        for fact in (0..facts).filter(|&fact| is_set(&state.facts, fact)) {
            weight[fact as usize] = 1;
        }
        for open in &state.open {
            weight[(facts + open.action) as usize] += 1;
        }
        let mut operators = Vec::new();
        for (number, action) in (0..).zip(&compiled.actions) {
            let running = (action.end != NONE).then_some(facts + number);
            let kind = 2 * narrow(action.schema.index());
            if action.start != NONE {
                let mut start = Operator::of(compiled.snap(action.start), kind);
                start.adds.extend(running);
                operators.push(start);
            }
            if let Some(running) = running {
                let mut end = Operator::of(compiled.snap(action.end), kind + 1);
                end.needs.push(running);
                end.uses_up.push(running);
                operators.push(end);
            }
        }
        for timed in &compiled.timed {
            let adds = timed.adds.clone();
            operators.push(Operator {
                adds,
                ..Operator::default()
            });
        }
        // Rules may make derived facts true at any time.
        let derived = compiled.derived.iter().flatten();
        operators.extend(derived.map(|&fact| Operator {
            adds: vec![fact],
            ..Operator::default()
        }));
        let (mut adding, mut using) = (vec![Vec::new(); atoms], vec![Vec::new(); atoms]);
        for (number, operator) in (0..).zip(&operators) {
            for &atom in &operator.adds {
                adding[atom as usize].push(number);
            }
            for &atom in &operator.uses_up {
                using[atom as usize].push(number);
            }
        }
        Self {
            operators,
            adding,
            using,
            weight,
            is_member: vec![false; atoms],
            work: 0,
        }
    }

    /// Returns a group with that atom, if one is found.
    fn group_with(&mut self, seed: u32) -> Option<Vec<u32>> {
        let mut choices = Choices::new();
        for _ in 0..MAX_TRIES {
            let mut members = Vec::new();
            let is_balanced = self.grow(&mut members, seed, &mut choices);
            if is_balanced {
                self.extend(&mut members, &mut choices);
            }
            for &member in &members {
                self.is_member[member as usize] = false;
            }
            if is_balanced {
                return (members.len() > 1).then_some(members);
            }
            // Take the next position for the last choice that has one.
            loop {
                let (_, place, count) = choices.last_mut()?;
                *place += 1;
                if *place < *count {
                    break;
                }
                choices.pop();
            }
        }
        None
    }

    /// Adds atoms that are made true by operators which use up a member and add none, if this can
    /// be balanced.
    fn extend(&mut self, members: &mut Vec<u32>, choices: &mut Choices) {
        let mut next = 0;
        while let Some(&atom) = members.get(next) {
            next += 1;
            for position in 0..self.using[atom as usize].len() {
                let operator = self.using[atom as usize][position] as usize;
                let is_member = |atom: &u32| self.is_member[*atom as usize];
                if self.operators[operator].adds.iter().any(is_member) {
                    continue;
                }
                for candidate in self.operators[operator].adds.clone() {
                    let before = (members.len(), choices.len());
                    if self.grow(members, candidate, choices) {
                        break;
                    }
                    self.truncate_members(members, before.0);
                    choices.truncate(before.1);
                }
            }
        }
    }

    /// Removes all members beyond the first `count`.
    fn truncate_members(&mut self, members: &mut Vec<u32>, count: usize) {
        for member in members.drain(count..) {
            self.is_member[member as usize] = false;
        }
    }

    /// Adds a member, and others until every operator is balanced. Returns `true` if this succeeds.
    fn grow(&mut self, members: &mut Vec<u32>, seed: u32, choices: &mut Choices) -> bool {
        let mut next = members.len();
        members.push(seed);
        self.is_member[seed as usize] = true;
        let weights = members.iter().map(|&member| self.weight[member as usize]);
        let mut weight: u32 = weights.sum();
        if weight > 1 {
            return false;
        }
        let mut chosen: Map<u32, usize> = choices.iter().map(|&(k, place, _)| (k, place)).collect();
        while let Some(&atom) = members.get(next) {
            next += 1;
            for position in 0..self.adding[atom as usize].len() {
                let operator = &self.operators[self.adding[atom as usize][position] as usize];
                let size = operator.adds.len() + operator.uses_up.len() + operator.needs.len();
                self.work += 1 + size as u64;
                let is_member = |atom: &&u32| self.is_member[**atom as usize];
                let is_new = |atom: &&u32| !operator.needs.contains(*atom);
                let new = operator.adds.iter().filter(is_member).filter(is_new);
                match new.count() {
                    // An atom that always holds stays the only one.
                    0 => continue,
                    1 => {}
                    _ => return false,
                }
                if operator.uses_up.iter().any(|used| is_member(&used)) {
                    continue;
                }
                let Some(first) = operator.uses_up.first() else {
                    return false;
                };
                let place = *chosen.entry(operator.kind).or_insert_with(|| {
                    choices.push((operator.kind, 0, operator.uses_up.len()));
                    0
                });
                let member = *operator.uses_up.get(place).unwrap_or(first);
                self.is_member[member as usize] = true;
                members.push(member);
                weight += self.weight[member as usize];
                if weight > 1 {
                    return false;
                }
            }
        }
        true
    }
}

impl Operator {
    fn of(snap: &Snap, kind: u32) -> Self {
        let literals = snap.condition.literals.iter();
        let needs: Vec<u32> = literals
            .filter(|literal| literal.truth())
            .map(|literal| literal.fact())
            .collect();
        let mut adds = snap.adds.clone();
        adds.extend(
            snap.conditional
                .iter()
                .filter_map(|effect| match effect.change {
                    Change::Add(fact) => Some(fact),
                    _ => None,
                }),
        );
        adds.sort_unstable();
        adds.dedup();
        // An addition wins over a deletion.
        let is_used_up = |fact: &&u32| needs.contains(fact) && !adds.contains(fact);
        let uses_up = snap.deletes.iter().filter(is_used_up).copied().collect();
        Self {
            needs,
            adds,
            uses_up,
            kind,
        }
    }
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}

#[cfg(test)]
mod tests {
    use elbowroom_model::Task;
    use elbowroom_pddl::{Source, read_problem};
    use proptest::prelude::*;

    use super::*;
    use crate::embedded::apply::Stepper;
    use crate::embedded::h2::tests::drafts;
    use crate::embedded::root::root;
    use crate::embedded::testing::{choices, compiled};

    /// Returns the number of true atoms of a group in a state.
    fn weight(compiled: &Compiled, group: &[u32], state: &State) -> usize {
        let count = |&atom: &u32| match atom.checked_sub(narrow(compiled.facts.len())) {
            None => usize::from(is_set(&state.facts, atom)),
            Some(action) => state.open.iter().filter(|o| o.action == action).count(),
        };
        group.iter().map(count).sum()
    }

    /// Visits all states that at most `left` choices lead to.
    fn visit(compiled: &Compiled, state: &State, left: usize, see: &mut dyn FnMut(&State) -> bool) {
        if !see(state) || left == 0 {
            return;
        }
        for step in choices(compiled, state) {
            if let Some(next) = Stepper::new(compiled).apply(state, step) {
                visit(compiled, &next, left - 1, see);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

        #[test]
        fn no_state_breaks_a_group(draft in drafts()) {
            let task = draft.task();
            let compiled = compiled(&task);
            let root = root(&compiled);
            let mutexes = Mutexes::of(&compiled, &root, u64::MAX);
            let mut budget = 3_000;
            visit(&compiled, &root, 7, &mut |state| {
                budget -= 1;
                for group in &mutexes.groups {
                    assert!(weight(&compiled, group, state) <= 1, "{group:?} in {state:?}");
                }
                budget > 0
            });
        }
    }

    const BLOCKS: &str = "(define (domain blocks) (:requirements :typing :durative-actions)
        (:types block)
        (:predicates (on ?x ?y - block) (clear ?x - block) (table ?x - block) (held ?x - block) (free))
        (:durative-action take :parameters (?x - block) :duration (= ?duration 1)
          :condition (and (at start (clear ?x)) (at start (table ?x)) (at start (free)))
          :effect (and (at start (not (clear ?x))) (at start (not (table ?x))) (at start (not (free)))
                       (at end (held ?x))))
        (:durative-action stack :parameters (?x ?y - block) :duration (= ?duration 1)
          :condition (and (at start (held ?x)) (at start (clear ?y)))
          :effect (and (at start (not (held ?x))) (at start (not (clear ?y)))
                       (at end (clear ?x)) (at end (free)) (at end (on ?x ?y)))))";

    /// A block is on the table, held or below another block.
    #[test]
    fn states_of_block_are_mutex_group() {
        let problem = "(define (problem p) (:domain blocks) (:objects a b c - block)
            (:init (clear a) (clear b) (clear c) (table a) (table b) (table c) (free))
            (:goal (and (on a b) (on b c))))";
        let sources = [("domain", BLOCKS), ("problem", problem)]
            .map(|(name, text)| Source::new(name, text.to_owned()));
        let Ok((problem, _)) = read_problem(&sources[0], &sources[1]) else {
            panic!("a problem that can be read");
        };
        let task = Task::new(problem);
        let compiled = &compiled(&task);
        let root = root(compiled);
        let mutexes = Mutexes::of(compiled, &root, u64::MAX);
        let facts = |group: &Vec<u32>| {
            let facts = group
                .iter()
                .filter_map(|&atom| compiled.facts.get(atom as usize));
            let mut facts: Vec<String> = facts.map(|&fact| task.fact_name(fact)).collect();
            facts.sort();
            facts
        };
        let groups: Vec<Vec<String>> = mutexes.groups.iter().map(facts).collect();
        let around_b = ["(clear b)", "(held b)", "(on a b)"];
        assert!(groups.iter().any(|group| *group == around_b), "{groups:?}");
    }
}
