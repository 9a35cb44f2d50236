//! Mutex pairs of forward and backward `h²`.
//!
//! Forward `h²` computes the pairs of atoms that a sequence of choices may make true together (Haslum & Geffner, AIPS
//! 2000, without costs). Backward `h²` computes the *live* pairs: a state with such a pair may lead to the goal. A state
//! with any other pair is a dead end. An action is *spurious* if each of its applications has such a pair before or after it.
//! (Alcázar & Torralba, "A reminder about the importance of computing and exploiting invariants in planning", ICAPS 2015.)
//!
//! Starts and ends are separate operators, as in [`mutex`](super::mutex). Example: robots paint tiles and cannot enter a
//! painted tile. A painted tile, and a clear tile that is reached only across it, are a pair without a plan.
//!
//! Only incomplete searches use these pairs. No proof depends on them.

mod model;
mod table;
#[cfg(test)]
mod tests;

use elbowroom_num::work;

use super::compile::{Compiled, NONE};
use super::state::State;
use model::{Model, Operator};
use table::{Table, is_subset};

/// Spurious actions, and pairs of atoms that make a state a dead end.
#[derive(Debug)]
pub(crate) struct MutexPairs {
    model: Model,
    /// Spurious actions, by action number.
    pub(crate) is_spurious: Vec<bool>,
    /// Reachable pairs that are not live.
    dead: Table,
    /// Atoms with at least one dead pair.
    with_dead: Vec<usize>,
}

impl MutexPairs {
    /// Computes the pairs from an initial state on. Returns `None` if that exceeds `most_work`, if nothing is
    /// spurious or dead, or once `may_continue` returns `false`.
    pub(crate) fn of(
        compiled: &Compiled,
        state: &State,
        most_work: u64,
        may_continue: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let model = Model::of(compiled, most_work)?;
        let mut finder = Finder::new(&model, most_work, may_continue);
        let reached = finder.forward(state)?;
        let live = finder.backward(&reached)?;
        let may_start = finder.is_live.iter().zip(&model.operators);
        let may_start = may_start.filter(|(is_live, operator)| **is_live && operator.is_start);
        let mut is_spurious: Vec<bool> = compiled
            .actions
            .iter()
            .map(|action| action.start != NONE)
            .collect();
        for (_, operator) in may_start {
            is_spurious[operator.action as usize] = false;
        }
        let dead = reached.without(&live);
        let atoms = 0..model.atom_count;
        let with_dead: Vec<usize> = atoms.filter(|&atom| !dead.is_row_empty(atom)).collect();
        let is_useful = !with_dead.is_empty() || is_spurious.contains(&true);
        is_useful.then_some(Self {
            model,
            is_spurious,
            dead,
            with_dead,
        })
    }

    /// Returns `true` if the state has a dead pair. No plan passes through it then.
    pub(crate) fn is_dead_end(&self, state: &State) -> bool {
        if self.with_dead.is_empty() {
            return false;
        }
        let held = self.model.atoms_of(state);
        self.with_dead.iter().any(|&atom| {
            table::contains(&held, atom) && table::intersects(self.dead.row(atom), &held)
        })
    }
}

/// Buffers and work budget of the two fixpoints.
struct Finder<'a> {
    model: &'a Model,
    /// Round of the last evaluation, by operator.
    evaluated: Vec<u32>,
    /// Operators after which the goal may be reachable.
    is_live: Vec<bool>,
    /// Buffer: atoms that may hold together with the preconditions of an operator.
    context: Vec<u64>,
    /// Buffer: atoms of the context that are compatible with its effects.
    retained: Vec<u64>,
    budget: work::Budget,
    should_continue: &'a mut dyn FnMut() -> bool,
    /// Work done before the last call of `may_continue`.
    work_at_last_call: u64,
}

/// Work between two calls of `may_continue`: some milliseconds.
const WORK_BETWEEN_CALLS: u64 = 2_000_000;

impl<'a> Finder<'a> {
    fn new(model: &'a Model, most_work: u64, may_continue: &'a mut dyn FnMut() -> bool) -> Self {
        let words = model.atom_count.div_ceil(64);
        Self {
            model,
            evaluated: vec![0; model.operators.len()],
            is_live: vec![false; model.operators.len()],
            context: vec![0; words],
            retained: vec![0; words],
            budget: work::Budget::new(most_work),
            should_continue: may_continue,
            work_at_last_call: 0,
        }
    }

    /// Computes the reachable pairs. Returns `None` if the budget is spent.
    fn forward(&mut self, state: &State) -> Option<Table> {
        let mut reached = Table::new(self.model.atom_count);
        let initial = self.model.atoms_of(state);
        for atom in table::bits(&initial) {
            reached.add(atom, &initial, 0);
        }
        self.fixpoint(&mut reached, |finder, reached, operator, round| {
            finder.progress(reached, operator, round)
        })?;
        Some(reached)
    }

    /// Computes the live pairs among the reachable ones. Returns `None` if the budget is spent.
    fn backward(&mut self, reached: &Table) -> Option<Table> {
        let model = self.model;
        let mut live = Table::new(model.atom_count);
        let mut ending = reached.all_of(&model.goal);
        model.clear_running(&mut ending);
        for atom in table::bits(&ending) {
            let with: Vec<u64> = and(reached.row(atom), &ending);
            live.add(atom, &with, 0);
        }
        self.evaluated.fill(0);
        self.fixpoint(&mut live, |finder, live, operator, round| {
            finder.regress(reached, live, operator, round)
        })?;
        Some(live)
    }

    /// Evaluates all operators in rounds until a fixpoint.
    fn fixpoint(
        &mut self,
        table: &mut Table,
        mut evaluate: impl FnMut(&mut Self, &mut Table, usize, u32) -> bool,
    ) -> Option<()> {
        let mut round = 0;
        loop {
            round += 1;
            let mut has_changed = false;
            for operator in 0..self.model.operators.len() {
                has_changed |= evaluate(self, table, operator, round);
                let used = self.budget.used();
                if used - self.work_at_last_call >= WORK_BETWEEN_CALLS {
                    self.work_at_last_call = used;
                    if !(self.should_continue)() {
                        return None;
                    }
                }
                if self.budget.is_spent() {
                    return None;
                }
            }
            if !has_changed {
                return Some(());
            }
        }
    }

    /// Returns `true` if a row of these atoms has changed since the last evaluation of the operator, on the first
    /// evaluation, and without atoms.
    fn is_due(&mut self, table: &Table, operator: usize, atoms: &[usize], round: u32) -> bool {
        let last = std::mem::replace(&mut self.evaluated[operator], round);
        let is_due =
            atoms.is_empty() || last == 0 || atoms.iter().any(|&atom| table.changed(atom) >= last);
        work::spend(1 + atoms.len() as u64);
        is_due
    }

    /// Adds the pairs that an operator may make true. Returns `true` if one is new.
    fn progress(&mut self, reached: &mut Table, number: usize, round: u32) -> bool {
        let model = self.model;
        let operator = &model.operators[number];
        if !self.is_due(reached, number, &operator.needs, round)
            || !self.find_context(reached, operator)
        {
            return false;
        }
        for &atom in &operator.deletes {
            table::remove(&mut self.context, atom);
        }
        if let Some(running) = operator.ends
            && !self.may_run_twice(reached, running, operator.action)
        {
            table::remove(&mut self.context, running);
        }
        for &atom in operator.adds.iter().chain(&operator.may_add) {
            table::insert(&mut self.context, atom);
        }
        let context = std::mem::take(&mut self.context);
        let mut has_changed = false;
        for &atom in operator.adds.iter().chain(&operator.may_add) {
            has_changed |= reached.add_consistent(atom, &context, model.opposite(atom), round);
        }
        spend(context.len() * (1 + operator.adds.len()));
        self.context = context;
        has_changed
    }

    /// Adds the pairs whose successors by an operator are live. Returns `true` if one is new.
    fn regress(&mut self, reached: &Table, live: &mut Table, number: usize, round: u32) -> bool {
        let model = self.model;
        let operator = &model.operators[number];
        let ended = operator.ends.map(|running| {
            (
                running,
                self.may_run_twice(reached, running, operator.action),
            )
        });
        let is_lost = |atom: usize| {
            operator.deletes.contains(&atom)
                || operator.may_delete.contains(&atom)
                || ended.is_some_and(|(running, _)| running == atom)
        };
        let needs = operator.needs.iter().copied();
        let mut after: Vec<usize> = needs.filter(|&atom| !is_lost(atom)).collect();
        after.extend(&operator.adds);
        if !self.is_due(live, number, &after, round) || !live.has_all_pairs(&after) {
            return false;
        }
        if !self.find_context(reached, operator) {
            return false;
        }
        self.is_live[number] = true;
        let with_after = live.all_of(&after);
        let kept = self
            .retained
            .iter_mut()
            .zip(self.context.iter().zip(&with_after));
        for (kept, (context, with_after)) in kept {
            *kept = context & with_after;
        }
        let mut lost = operator.deletes.clone();
        lost.extend(&operator.may_delete);
        lost.extend(ended.map(|(running, _)| running));
        lost.retain(|&atom| table::contains(&self.context, atom));
        for &atom in &lost {
            table::insert(&mut self.retained, atom);
        }
        let mut has_changed = false;
        for &atom in &lost {
            let with = and(reached.row(atom), &self.retained);
            has_changed |= live.add(atom, &with, round);
        }
        spend(self.context.len() * (2 + after.len() + 2 * lost.len()));
        has_changed
    }

    /// Computes the atoms that may hold together with the preconditions. Returns `false` if the operator is never
    /// applicable.
    fn find_context(&mut self, reached: &Table, operator: &Operator) -> bool {
        spend(self.context.len() * (1 + operator.needs.len()));
        if !reached.has_all_pairs(&operator.needs) {
            return false;
        }
        self.context = reached.all_of(&operator.needs);
        for &atom in &operator.breaks {
            table::remove(&mut self.context, atom);
        }
        true
    }

    /// Returns `true` if an action may start while an instance of it is running.
    fn may_run_twice(&self, reached: &Table, running: usize, action: u32) -> bool {
        let start = self.model.start_of(action);
        start.is_some_and(|start| {
            is_subset(&start.needs, reached.row(running)) && !start.excludes_itself
        })
    }
}

/// Counts accesses to words of tables.
fn spend(words: usize) {
    work::spend(words as u64);
}

fn and(one: &[u64], other: &[u64]) -> Vec<u64> {
    one.iter()
        .zip(other)
        .map(|(one, other)| one & other)
        .collect()
}
