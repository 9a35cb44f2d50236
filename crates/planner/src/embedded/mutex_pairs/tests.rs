//! The pairs equal those of a plain fixpoint. No plan visits a dead end or has a spurious action.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use proptest::prelude::*;

use super::model::{Model, Operator};
use super::{Finder, MutexPairs, table};
use crate::embedded::apply::{Step, Stepper};
use crate::embedded::compile::Compiled;
use crate::embedded::h2::tests::drafts;
use crate::embedded::root::root;
use crate::embedded::state::State;
use crate::embedded::testing::{choices, compiled};

type PairSet = BTreeSet<(usize, usize)>;

/// Fixpoints over all operators and all pairs, without change tracking.
struct ReferenceTable<'a> {
    model: &'a Model,
    reached: PairSet,
}

impl<'a> ReferenceTable<'a> {
    fn of(model: &'a Model, state: &State) -> Self {
        let initial: Vec<usize> = table::bits(&model.atoms_of(state)).collect();
        let mut twin = Self {
            model,
            reached: product(&initial, &initial),
        };
        loop {
            let before = twin.reached.len();
            for operator in &model.operators {
                let after = twin.after(operator);
                twin.reached.extend(after);
            }
            if twin.reached.len() == before {
                return twin;
            }
        }
    }

    fn holds(&self, one: usize, other: usize) -> bool {
        self.reached.contains(&(one, other))
    }

    /// Returns the atoms that may hold together with the preconditions of an applicable operator.
    fn context(&self, operator: &Operator) -> Vec<usize> {
        let needs = &operator.needs;
        if !needs
            .iter()
            .all(|&a| needs.iter().all(|&b| self.holds(a, b)))
        {
            return Vec::new();
        }
        let with_needs = |&atom: &usize| {
            self.holds(atom, atom)
                && needs.iter().all(|&need| self.holds(atom, need))
                && !operator.breaks.contains(&atom)
        };
        (0..self.model.atom_count).filter(with_needs).collect()
    }

    fn happens(&self, operator: &Operator) -> bool {
        let needs = &operator.needs;
        needs
            .iter()
            .all(|&a| needs.iter().all(|&b| self.holds(a, b)))
    }

    /// Returns `true` if the operator certainly makes a true atom false.
    fn is_removed(&self, operator: &Operator, atom: usize) -> bool {
        let runs_twice = || {
            let start = self.model.start_of(operator.action);
            start.is_some_and(|start| {
                !start.excludes_itself && start.needs.iter().all(|&need| self.holds(atom, need))
            })
        };
        operator.deletes.contains(&atom) || operator.ends == Some(atom) && !runs_twice()
    }

    /// Returns the pairs after the operator with at least one atom that it made true.
    fn after(&self, operator: &Operator) -> PairSet {
        if !self.happens(operator) {
            return PairSet::new();
        }
        let made: Vec<usize> = [&operator.adds[..], &operator.may_add].concat();
        let context = self.context(operator).into_iter();
        let mut others: Vec<usize> = context
            .filter(|&atom| !self.is_removed(operator, atom))
            .collect();
        others.extend(&made);
        let mut pairs = product(&made, &others);
        pairs.retain(|&(one, other)| self.model.opposite(one) != Some(other));
        pairs
    }

    /// Returns the live pairs.
    fn live(&self) -> PairSet {
        let goal = &self.model.goal;
        let mut held = vec![u64::MAX; self.model.atom_count.div_ceil(64)];
        self.model.clear_running(&mut held);
        let may_end = |&atom: &usize| {
            table::contains(&held, atom)
                && self.holds(atom, atom)
                && goal.iter().all(|&goal| self.holds(atom, goal))
        };
        let ending: Vec<usize> = (0..self.model.atom_count).filter(may_end).collect();
        let mut live = product(&ending, &ending);
        live.retain(|&(one, other)| self.holds(one, other));
        loop {
            let before = live.len();
            for operator in &self.model.operators {
                let found = self.before(operator, &live);
                live.extend(found);
            }
            if live.len() == before {
                return live;
            }
        }
    }

    fn is_live(&self, operator: &Operator, live: &PairSet) -> bool {
        let after = Self::sure_after(operator);
        self.happens(operator)
            && after
                .iter()
                .all(|&a| after.iter().all(|&b| live.contains(&(a, b))))
    }

    fn sure_after(operator: &Operator) -> Vec<usize> {
        let needs = operator.needs.iter().copied();
        let mut after: Vec<usize> = needs
            .filter(|&need| !can_be_removed(operator, need))
            .collect();
        after.extend(&operator.adds);
        after
    }

    /// Returns the pairs whose successors by the operator are live.
    fn before(&self, operator: &Operator, live: &PairSet) -> PairSet {
        if !self.is_live(operator, live) {
            return PairSet::new();
        }
        let after = Self::sure_after(operator);
        let is_left = |&atom: &usize| {
            can_be_removed(operator, atom)
                || live.contains(&(atom, atom)) && after.iter().all(|&b| live.contains(&(atom, b)))
        };
        let context: Vec<usize> = self.context(operator).into_iter().filter(is_left).collect();
        let gone = context.iter().copied();
        let gone: Vec<usize> = gone
            .filter(|&atom| can_be_removed(operator, atom))
            .collect();
        let mut pairs = product(&gone, &context);
        pairs.retain(|&(one, other)| self.holds(one, other));
        pairs
    }
}

fn can_be_removed(operator: &Operator, atom: usize) -> bool {
    operator.deletes.contains(&atom)
        || operator.may_delete.contains(&atom)
        || operator.ends == Some(atom)
}

fn product(one: &[usize], other: &[usize]) -> PairSet {
    let mut pairs = PairSet::new();
    for &one in one {
        for &other in other {
            pairs.extend([(one, other), (other, one)]);
        }
    }
    pairs
}

fn pairs_of(table: &table::Table, count: usize) -> PairSet {
    let rows =
        (0..count).flat_map(|one| table::bits(table.row(one)).map(move |other| (one, other)));
    rows.collect()
}

/// Returns `true` if a plan exists. Asserts that none of its states is a dead end, and none of its actions spurious.
fn leads_to_goal(
    compiled: &Compiled,
    mutex_pairs: &MutexPairs,
    state: &State,
    left: usize,
    budget: &mut u32,
) -> bool {
    let mut is_on_the_way =
        state.open.is_empty() && compiled.goal.holds(&state.facts, &mut |_| true);
    *budget = budget.saturating_sub(1);
    if left > 0 && *budget > 0 {
        let is_too_late = |step: &Step| matches!(step, Step::Start(_)) && state.open.len() >= left;
        for step in choices(compiled, state).filter(|step| !is_too_late(step)) {
            let Some(next) = Stepper::new(compiled).apply(state, step) else {
                continue;
            };
            if leads_to_goal(compiled, mutex_pairs, &next, left - 1, budget) {
                is_on_the_way = true;
                if let Step::Start(action) = step {
                    let is_spurious = mutex_pairs.is_spurious[action as usize];
                    assert!(!is_spurious, "action {action} in {state:?}");
                }
            }
        }
    }
    assert!(
        !is_on_the_way || !mutex_pairs.is_dead_end(state),
        "{state:?}"
    );
    is_on_the_way
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn pairs_equal_those_of_a_plain_fixpoint(draft in drafts()) {
        let task = draft.task();
        let compiled = compiled(&task);
        let state = root(&compiled);
        let model = Model::of(&compiled, u64::MAX).expect("no limit");
        let mut may_continue = || true;
        let mut finder = Finder::new(&model, u64::MAX, &mut may_continue);
        let reached = finder.forward(&state).expect("no limit");
        let twin = ReferenceTable::of(&model, &state);
        prop_assert_eq!(pairs_of(&reached, model.atom_count), twin.reached.clone());
        let live = finder.backward(&reached).expect("no limit");
        let expected = twin.live();
        let is_live: Vec<bool> =
            model.operators.iter().map(|operator| twin.is_live(operator, &expected)).collect();
        prop_assert_eq!(pairs_of(&live, model.atom_count), expected);
        prop_assert_eq!(finder.is_live, is_live);
    }

    #[test]
    fn valid_plans_avoid_dead_ends(draft in drafts()) {
        let task = draft.task();
        let compiled = compiled(&task);
        let start = root(&compiled);
        if let Some(mutex_pairs) = MutexPairs::of(&compiled, &start, u64::MAX, &mut || true) {
            leads_to_goal(&compiled, &mutex_pairs, &root(&compiled), 6, &mut 3_000);
        }
    }
}

/// Returns a task with a corridor of tiles. A robot paints the next tile in either direction and
/// cannot enter painted tiles.
fn corridor() -> Task {
    let domain = "(define (domain corridor) (:requirements :typing :durative-actions)
        (:types tile)
        (:predicates (at ?t - tile) (clear ?t - tile) (painted ?t - tile) (next ?a ?b - tile))
        (:durative-action move :parameters (?a ?b - tile) :duration (= ?duration 1)
          :condition (and (at start (at ?a)) (at start (clear ?b)) (at start (next ?a ?b)))
          :effect (and (at start (not (at ?a))) (at start (not (clear ?b)))
            (at end (at ?b)) (at end (clear ?a))))
        (:durative-action paint :parameters (?a ?b - tile) :duration (= ?duration 2)
          :condition (and (over all (at ?a)) (at start (clear ?b)) (at start (next ?a ?b)))
          :effect (and (at start (not (clear ?b))) (at end (painted ?b)))))";
    let problem = "(define (problem p) (:domain corridor) (:objects t0 t1 t2 t3 - tile)
        (:init (next t0 t1) (next t1 t0) (next t1 t2) (next t2 t1) (next t2 t3) (next t3 t2)
          (at t0) (clear t1) (clear t2) (clear t3))
        (:goal (and (painted t1) (painted t2) (painted t3))))";
    let sources = (
        Source::new("domain.pddl", domain.to_owned()),
        Source::new("problem.pddl", problem.to_owned()),
    );
    match read_problem(&sources.0, &sources.1) {
        Ok((problem, _)) => Task::new(problem),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

#[test]
fn painting_an_outer_tile_first_is_a_dead_end() {
    let compiled = compiled(&corridor());
    let start = root(&compiled);
    let mutex_pairs =
        MutexPairs::of(&compiled, &start, u64::MAX, &mut || true).expect("there are dead ends");
    // The spurious actions paint tiles 1 and 2 from the far side.
    let spurious = mutex_pairs
        .is_spurious
        .iter()
        .filter(|is_spurious| **is_spurious);
    let paints = compiled
        .actions
        .iter()
        .filter(|action| !action.over_all.literals.is_empty());
    assert_eq!((spurious.count(), paints.count()), (2, 6));
    assert!(!mutex_pairs.is_dead_end(&start));
    let dead = (0..).zip(&compiled.actions).filter_map(|(number, _)| {
        let next = Stepper::new(&compiled).apply(&start, Step::Compressed(number))?;
        Some(mutex_pairs.is_dead_end(&next))
    });
    // Of the two possible steps, painting the next tile is one too early.
    assert_eq!(dead.filter(|is_dead| *is_dead).count(), 1);
}
