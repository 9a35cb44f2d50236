//! Whether a plan could end in a state, and what led there.

use super::super::apply::{Step, Stepper};
use super::super::state::State;
use super::{ROOT, Search};

impl Search<'_> {
    /// Whether the plan could end here.
    pub(super) fn is_goal(&self, state: &State) -> bool {
        let compiled = self.compiled;
        if !state.open.is_empty() {
            return false;
        }
        let holds = if state.symbolic.is_some() {
            let mut stepper = Stepper::new(compiled);
            stepper.reach_goal(&mut state.clone()).is_some()
        } else {
            let mut passes = |test| state.passes(compiled, test, None);
            compiled.goal.holds(&state.facts, &mut passes)
        };
        if !holds {
            return false;
        }
        // What happens by itself before the last happening counts.
        let end = state.earliest_end();
        compiled
            .goal_timed
            .iter()
            .filter(|&&timed| timed >= state.timed)
            .all(|&timed| compiled.timed[timed as usize].time > end)
    }

    /// The choices that lead to a state.
    pub(super) fn steps_to(&self, mut number: u32) -> Vec<Step> {
        let mut steps = Vec::new();
        while self.nodes[number as usize].parent != ROOT {
            let node = &self.nodes[number as usize];
            steps.push(node.step);
            number = node.parent;
        }
        steps.reverse();
        steps
    }

    /// Whether the metric of a state in which the goal holds may be within the limit. This is for
    /// metrics that do not only grow, and spares the judge.
    pub(super) fn may_be_better(&self, number: u32) -> bool {
        let (Some(limit), Some(metric)) = (&self.limit, &self.compiled.metric) else {
            return true;
        };
        let spent = self.nodes[number as usize].state.spent(metric);
        !metric.time.is_zero() || spent.is_none_or(|spent| spent <= limit.value)
    }
}
