//! The successors of a state: when their turn comes, and what they are.

use super::super::apply::Step;
use super::super::compile::NONE;
use super::super::relaxed::Estimate;
use super::super::state::State;
use super::{Aim, BOOST, Search};

impl Search<'_> {
    /// Lets the successors wait for their turn.
    pub(super) fn expand(&mut self, number: u32, estimate: &Estimate) {
        self.expanded += 1;
        if estimate.steps < self.best_steps {
            self.best_steps = estimate.steps;
            self.turns[0] -= BOOST;
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
        if self.style.haste.is_none() {
            let steps = estimate.applicable.iter();
            self.oldest.extend(steps.map(|&step| (number, step)));
            self.memory += 12 * estimate.applicable.len();
        }
    }

    /// When the successors of a state have their turn; lower ranks are earlier.
    fn rank(&self, number: u32, estimate: u32) -> i64 {
        let estimate = i64::from(estimate);
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
            if !data.excludes_itself && data.end != NONE {
                let most = usize::from(self.style.haste.is_none());
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
