//! The successors of a state: when their turn comes, and what they are.

use super::super::apply::Step;
use super::super::compile::NONE;
use super::super::relaxed::Estimate;
use super::super::state::State;
use super::novelty::goals_left;
use super::{Aim, BOOST, Search};

impl Search<'_> {
    /// Lets the successors wait for their turn.
    pub(super) fn expand(&mut self, number: u32, estimate: &Estimate) {
        self.expanded += 1;
        if estimate.steps < self.best_steps {
            self.best_steps = estimate.steps;
            self.turns[0] -= BOOST;
        }
        if number == 0 {
            self.first_estimate = estimate.steps;
        }
        self.memory += 24 * (estimate.preferred.len() + estimate.applicable.len());
        let rank = self.rank(number, estimate.steps);
        for &step in &estimate.preferred {
            self.preferred.push(rank, number, step);
        }
        for &step in &estimate.applicable {
            self.generated += 1;
            self.all.push(rank, number, step);
        }
        if self.style.is_complete() {
            let steps = estimate.applicable.iter();
            self.oldest.extend(steps.map(|&step| (number, step)));
            self.memory += 12 * estimate.applicable.len();
        }
    }

    /// What a state has used up of what is not filled up, all of it counting as much as the way to
    /// the goal was long in the beginning.
    fn penalty(&self, number: u32) -> i64 {
        if self.stocks.is_empty() {
            return 0;
        }
        let state = &self.nodes[number as usize].state;
        let used = self.stocks.iter().map(|stock| stock.used(state));
        let most = used.fold(0.0, f64::max);
        #[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
        let penalty = (most * f64::from(self.first_estimate)).round() as i64;
        penalty
    }

    /// When the successors of a state have their turn; lower ranks are earlier.
    fn rank(&mut self, number: u32, estimate: u32) -> i64 {
        if let Some(novelty) = &mut self.novelty {
            let state = &self.nodes[number as usize].state;
            let left = goals_left(self.compiled, state);
            let (novelty, memory) = novelty.of(self.compiled, state, (left, estimate));
            self.memory += memory;
            return novelty << 48 | i64::from(left) << 24 | i64::from(estimate.min(1 << 23));
        }
        let estimate = i64::from(estimate) + self.penalty(number);
        let (Aim::CheapWhole(factor), Some(guide)) = (self.style.aim, &self.guide) else {
            return estimate;
        };
        guide.spent(self.compiled, &self.nodes[number as usize].state) + factor * estimate
    }

    /// The successor; in haste, one in which what has started is over, if possible.
    pub(super) fn make(&mut self, parent: u32, step: Step) -> Option<(Step, State)> {
        let state = &self.nodes[parent as usize].state;
        if let Step::Start(action) | Step::Whole(action) = step {
            let data = self.compiled.action(action);
            let runs_already = || {
                state
                    .open
                    .iter()
                    .filter(|open| open.action == action)
                    .count()
            };
            if data.end != NONE && !(data.excludes_itself && self.style.is_complete()) {
                let most = usize::from(self.style.is_complete());
                if runs_already() > most {
                    self.has_lost = true;
                    return None;
                }
            }
            let is_whole = self
                .style
                .haste
                .is_some_and(|haste| data.eagerness >= haste);
            if is_whole && data.end != NONE {
                let whole = Step::Whole(action);
                if let Some(next) = self.stepper.apply(state, whole) {
                    self.has_lost = true;
                    return Some((whole, next));
                }
            }
        }
        let step = match step {
            Step::Whole(action) => Step::Start(action),
            other => other,
        };
        let next = self.stepper.apply(state, step)?;
        if let Step::Start(action) = step
            && !self.style.is_chronological
            && self.compiled.action(action).only_adds_at_end
            && state.symbolic.is_none()
            && self.relaxed.is_end_the_only_way(&next, action)
        {
            // No plan is lost: see `compile::eager`.
            let whole = Step::Whole(action);
            return Some((whole, self.stepper.apply(state, whole)?));
        }
        Some((step, next))
    }
}
