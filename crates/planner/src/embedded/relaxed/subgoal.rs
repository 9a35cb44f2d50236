//! Estimates for a part of the goal.

use super::super::state::State;
use super::super::time::Ticks;
use super::{Estimate, Relaxed, UNREACHED};

/// The additional cost of an operator that can start only at the end of the present plan, where
/// work is spread.
const MAX_LATENESS: Ticks = 7;

/// A part of the goal, as propositions of the relaxed problem.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Subgoal {
    /// The goals that must hold.
    pub(crate) kept: Box<[u32]>,
    /// Alternative goals: at least one must hold.
    pub(crate) candidates: Box<[u32]>,
    /// The operators that are too late.
    pub(crate) late_operators: Box<[u32]>,
    /// The cost of each operator; empty if these are the usual ones.
    pub(crate) costs: Box<[u8]>,
}

impl Relaxed<'_> {
    /// As [`evaluate`](Self::evaluate), for a part of the goal. Only the operators that the subgoal
    /// names are too late.
    pub(crate) fn evaluate_subgoal(
        &mut self,
        state: &State,
        subgoal: &Subgoal,
    ) -> Option<Estimate> {
        if !subgoal.costs.is_empty() {
            self.subgoal_cost.clear();
            let costs = subgoal.costs.iter().copied();
            self.subgoal_cost.extend(costs.map(u32::from));
            std::mem::swap(&mut self.own_cost, &mut self.subgoal_cost);
        }
        let estimate = self.evaluate_goals(state, Some(subgoal));
        if !subgoal.costs.is_empty() {
            std::mem::swap(&mut self.own_cost, &mut self.subgoal_cost);
        }
        self.buckets.iter_mut().for_each(Vec::clear);
        estimate
    }

    /// Returns the propositions that a relaxed plan must reach: the goal, or the part of it with its
    /// cheapest candidate. Returns `None` if one is unreachable.
    pub(super) fn wanted_goals(&self, subgoal: Option<&Subgoal>) -> Option<Vec<u32>> {
        let cost = |goal: &&u32| self.cost[**goal as usize];
        let mut wanted = subgoal
            .map_or(&self.graph.goal[..], |subgoal| &subgoal.kept)
            .to_vec();
        if let Some(subgoal) = subgoal {
            wanted.extend(subgoal.candidates.iter().min_by_key(cost));
        }
        wanted
            .iter()
            .all(|goal| cost(&goal) < UNREACHED)
            .then_some(wanted)
    }

    /// Returns the operators that are too late from a state. If `has_costs`, also returns a cost for
    /// each operator: one, and more if it can start only towards the end of the present plan, since
    /// an object that it needs is busy or a window is closed.
    pub(crate) fn lateness(&mut self, state: &State, has_costs: bool) -> (Box<[u32]>, Box<[u8]>) {
        if self.graph.windows.is_empty() && !has_costs {
            return Default::default();
        }
        let missing = &mut self.graph.precondition_counts.clone();
        let (compiled, graph, horizon) = (self.compiled, &self.graph, self.horizon);
        let deadlines = &mut self.deadlines;
        deadlines.exclude_late_operators(compiled, graph, state, horizon, None, missing);
        let late = deadlines.late_operators();
        let elapsed = state.earliest_end() - compiled.now;
        if elapsed <= 0 || !has_costs {
            return (late, Box::default());
        }
        let starts = graph.operators.iter().zip(&deadlines.earliest_starts);
        let costs = starts.map(|(operator, &start)| {
            let wait = (start - compiled.now).clamp(0, elapsed);
            let cost = i64::from(operator.cost) * (1 + wait * MAX_LATENESS / elapsed);
            u8::try_from(cost).unwrap_or(u8::MAX)
        });
        (late, costs.collect())
    }
}
