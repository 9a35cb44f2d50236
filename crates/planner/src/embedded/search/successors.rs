//! Generation and ordering of the successors of a state.

use super::super::apply::Step;
use super::super::compile;
use super::super::relaxed::{Estimate, OVERDRAWN};
use super::super::state::State;
use super::super::time::NEVER;
use super::node::NONE;
use super::novelty::Progress;
use super::successor_list::QueuedSuccessor;
use super::{Aim, NoveltyOf, ROOT, Search};

impl Search<'_> {
    /// Queues the successors.
    pub(super) fn expand(&mut self, number: u32, estimate: &Estimate) {
        self.expanded += 1;
        if self.strategy.novelty == Some(NoveltyOf::Successors) {
            self.expand_by_width(number, estimate);
            return;
        }
        let left = if self.strategy.ranks_remaining() {
            self.nodes[number as usize].remaining
        } else {
            0
        };
        if (left, estimate.steps) < self.best {
            self.best = (left, estimate.steps);
            self.idle = 0;
            self.turns[0] -= self.compiled.tuning.boost;
        }
        if self.nodes[number as usize].drift().penalty() > 0 {
            // The long turn of the preferred successors ends.
            self.turns[0] = self.turns[0].max(self.turns[1]);
        }
        if number == 0 {
            self.first_estimate = estimate.steps;
        }
        let rank = self.rank(number, estimate.steps);
        for &step in &estimate.preferred {
            self.memory += self
                .preferred
                .push(rank, QueuedSuccessor::step(number, step));
        }
        self.generated += estimate.applicable.len() as u64;
        if self.is_timeless && !estimate.applicable.is_empty() {
            // Most of them are never expanded, and the list is the same at any time.
            self.add_waiting(rank, QueuedSuccessor::all_of(number));
        } else {
            for &step in &estimate.applicable {
                self.add_waiting(rank, QueuedSuccessor::step(number, step));
            }
        }
    }

    fn add_waiting(&mut self, rank: i64, waiting: QueuedSuccessor) {
        self.memory += self.all.push(rank, waiting);
        if self.strategy.is_complete() {
            self.memory += self.oldest.push_back(waiting);
        }
    }

    /// Removes the successor with the lowest rank.
    pub(super) fn pop_any(&mut self) -> Option<(u32, Step)> {
        loop {
            let (rank, waiting) = self.all.pop()?;
            let parent = waiting.parent;
            if let Some(step) = waiting.next() {
                return Some((parent, step));
            }
            let steps = self.list(parent);
            self.all.push_first(rank, parent, &steps);
        }
    }

    /// Removes the successor that has waited longest.
    pub(super) fn pop_oldest(&mut self) -> Option<(u32, Step)> {
        loop {
            let waiting = self.oldest.pop_front()?;
            let parent = waiting.parent;
            if let Some(step) = waiting.next() {
                return Some((parent, step));
            }
            let steps = self.list(parent);
            for &step in steps.iter().rev() {
                self.oldest.push_front(QueuedSuccessor::step(parent, step));
            }
        }
    }

    /// Returns the successors of a state that was expanded when the search was timeless. They are
    /// the same as then.
    fn list(&mut self, number: u32) -> Vec<Step> {
        let state = self.states.get(number);
        self.relaxed.horizon = NEVER;
        let estimate = self.relaxed.list(&state);
        let mut steps = estimate.map_or_else(Vec::new, |estimate| estimate.applicable);
        let none = &mut Vec::new();
        self.symmetry.thin_out(&state, true, (&mut steps, none));
        steps
    }

    /// Queues the successors by their own novelty, and then by their number of remaining goals.
    /// They are generated for this, and generated again when they are expanded.
    fn expand_by_width(&mut self, number: u32, estimate: &Estimate) {
        let Some(mut novelty) = self.novelty.take() else {
            return;
        };
        let state = self.states.get(number);
        let node = &self.nodes[number as usize];
        let before = self.progress(node.origin.parent);
        let progress = novelty.progress(&state, node.remaining, before, &estimate.subgoals);
        self.novelty_evaluations += estimate.applicable.len() as u64;
        for &step in &estimate.applicable {
            let Some((_, next)) = self.generate(&state, step) else {
                continue;
            };
            let (_, left) = self.remaining_landmarks(number, &next);
            let worth = novelty.worth(&next, left, &progress);
            let (new, memory) = novelty.of(self.compiled, &next, worth);
            self.memory += memory;
            let rank = new << 48 | i64::from(worth.0) << 24;
            self.generated += 1;
            let waiting = QueuedSuccessor::step(number, step);
            if estimate.preferred.binary_search(&step).is_ok() {
                self.memory += self.preferred.push(rank, waiting);
            }
            self.memory += self.all.push(rank, waiting);
        }
        let size = progress.size();
        let (progress, memory) = self.shared.progress.number(progress, size);
        self.nodes[number as usize].progress = progress;
        self.memory += memory;
        self.novelty = Some(novelty);
    }

    /// Returns the estimate of a state, or only its applicable steps; the number of its agenda, and
    /// the number of remaining conjuncts or landmarks. Returns `None` for a dead end.
    pub(super) fn estimate(
        &mut self,
        parent: u32,
        state: &State,
        left: u32,
    ) -> Option<(Estimate, u32, u32)> {
        if self.strategy.serializes_goals {
            return self.estimate_subgoal(parent, state);
        }
        let estimate = if self.needs_estimate(parent, left) {
            self.relaxed.evaluate(state)
        } else {
            self.relaxed.list(state)
        };
        Some((estimate?, NONE, left))
    }

    /// Returns `true` if a state needs an estimate. Where the novelty of successors counts, only
    /// the first state and states with one more goal need one.
    fn needs_estimate(&self, parent: u32, left: u32) -> bool {
        if self.strategy.novelty != Some(NoveltyOf::Successors) {
            return true;
        }
        let progress = self.progress(parent);
        progress.is_none_or(|before| before.has_new_goal(left))
    }

    /// Returns the progress on the path to a node.
    fn progress(&self, number: u32) -> Option<&Progress> {
        let node = self.nodes.get(number as usize)?;
        self.shared.progress.get(node.progress)
    }

    /// Returns the number of steps that led to a node.
    fn depth(&self, number: u32) -> i64 {
        let parent = |node: &u32| {
            let parent = self.nodes[*node as usize].origin.parent;
            (parent != ROOT).then_some(parent)
        };
        let steps = std::iter::successors(Some(number), parent).skip(1);
        i64::try_from(steps.count()).unwrap_or(i64::MAX)
    }

    /// Returns the penalty for the consumables that a state has used up. A consumable that is used
    /// up completely counts as much as the first estimate.
    fn penalty(&mut self, number: u32) -> i64 {
        if self.consumables.is_empty() {
            return 0;
        }
        let state = self.states.get(number);
        let used = self
            .consumables
            .iter()
            .map(|consumable| consumable.used(&state));
        let most = used.fold(0.0, f64::max);
        #[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
        let penalty = (most * f64::from(self.first_estimate)).round() as i64;
        penalty
    }

    /// Returns the rank of a state in the queue of its search; lower ranks come first.
    fn rank(&mut self, number: u32, estimate: u32) -> i64 {
        if self.strategy.serializes_goals {
            return self.rank_of_subgoal(number, estimate);
        }
        if self.strategy.ranks_remaining() {
            let left = self.nodes[number as usize].remaining;
            let (overdrawn, estimate) = (estimate / OVERDRAWN, estimate % OVERDRAWN);
            return i64::from(overdrawn) << 48 | i64::from(left) << 24 | i64::from(estimate);
        }
        let drift = self.nodes[number as usize].drift().penalty();
        let mut estimate = i64::from(estimate) + self.penalty(number) + drift;
        if self.strategy.counts_steps {
            estimate += self.depth(number);
        }
        let (Aim::WeightedAStar(factor), Some(step_costs)) = (self.strategy.aim, &self.step_costs)
        else {
            return estimate;
        };
        step_costs.spent(self.compiled, &self.states.get(number)) + factor * estimate
    }

    /// Returns the rank of a state in a search that serializes the goal: states with fewer remaining
    /// conjuncts first, then novel ones. So the search leaves plateaus, and sequences of steps that
    /// only change numbers.
    fn rank_of_subgoal(&mut self, number: u32, estimate: u32) -> i64 {
        let left = self.nodes[number as usize].remaining;
        let (overdrawn, estimate) = (estimate / OVERDRAWN, estimate % OVERDRAWN);
        let mut is_old = false;
        if let Some(novelty) = &mut self.novelty {
            let state = self.states.get(number);
            let (new, memory) = novelty.of(self.compiled, &state, (0, estimate));
            self.memory += memory;
            is_old = new == 3;
        }
        let overdrawn = i64::from(overdrawn) << 56;
        overdrawn | i64::from(left) << 32 | i64::from(is_old) << 31 | i64::from(estimate)
    }

    /// Generates the successor. In a compressing search, the started action is also ended, if
    /// possible.
    pub(super) fn generate(&mut self, state: &State, step: Step) -> Option<(Step, State)> {
        if let Step::Start(action) | Step::Compressed(action) = step {
            let data = self.compiled.action(action);
            let runs_already = || {
                state
                    .open
                    .iter()
                    .filter(|open| open.action == action)
                    .count()
            };
            let may_run_twice = !(data.excludes_itself && self.strategy.is_complete());
            if data.end != compile::NONE && data.exclusion == compile::NONE && may_run_twice {
                let most = usize::from(self.strategy.is_complete());
                if runs_already() > most {
                    self.is_lossy = true;
                    return None;
                }
            }
            let is_compressed = self
                .strategy
                .compresses
                .is_some_and(|compresses| data.compressibility >= compresses);
            if is_compressed && data.end != compile::NONE {
                let whole = Step::Compressed(action);
                if let Some(next) = self.stepper.apply(state, whole) {
                    self.is_lossy = true;
                    return Some((whole, next));
                }
            }
        }
        if let Step::Macro(_) = step {
            self.is_lossy = true;
            return Some((step, self.stepper.apply(state, step)?));
        }
        let step = match step {
            Step::Compressed(action) => Step::Start(action),
            other => other,
        };
        let next = self.stepper.apply(state, step)?;
        if let Step::Start(action) = step
            && !self.strategy.is_chronological
            && !self.strategy.joins
            && self.compiled.action(action).is_compression_safe
            && state.symbolic.is_none()
            && self.relaxed.is_end_unavoidable(&next, action)
        {
            // No plan is lost: see `compile::compression`.
            let whole = Step::Compressed(action);
            return Some((whole, self.stepper.apply(state, whole)?));
        }
        Some((step, next))
    }
}
