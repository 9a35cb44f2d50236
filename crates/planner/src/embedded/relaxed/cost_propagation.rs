//! Propagation of costs from the propositions that hold to the reachable ones.

use super::super::state::State;
use super::graph::Kind;
use super::{MOST, Reaches, Relaxed, Subgoal};

impl Relaxed<'_> {
    /// Runs Dijkstra's algorithm from the propositions that hold. If `stops_early`, it stops once
    /// the goal, or the part of it, and the ends of all running actions are reached within the cost
    /// processed so far. Propositions up to this cost keep their cost and achiever, as do those
    /// that they depend on. So the relaxed plan is the same, except that the end of an action which
    /// nothing else needs may be missing.
    pub(super) fn propagate_costs(
        &mut self,
        state: &State,
        stops_early: bool,
        subgoal: Option<&Subgoal>,
    ) {
        self.fire_sources(state);
        self.propagated_cost = 0;
        let mut goals_met = 0;
        while self.propagated_cost < self.buckets.len() {
            let cost = self.propagated_cost;
            let Some(proposition) = self.buckets[cost].pop() else {
                if stops_early && self.is_goal_within(state, subgoal, cost, &mut goals_met) {
                    return;
                }
                self.propagated_cost += 1;
                continue;
            };
            self.reach(proposition, cost);
        }
    }

    /// Continues after an early stop.
    pub(super) fn propagate_remaining_costs(&mut self) {
        while self.propagated_cost < self.buckets.len() {
            match self.buckets[self.propagated_cost].pop() {
                Some(proposition) => self.reach(proposition, self.propagated_cost),
                None => self.propagated_cost += 1,
            }
        }
    }

    /// Returns `true` if each part of the goal costs at most `cost`, and the ends of all running
    /// actions are reached. The first `met` parts of the goal are known to be within the cost.
    fn is_goal_within(
        &self,
        state: &State,
        subgoal: Option<&Subgoal>,
        cost: usize,
        met: &mut usize,
    ) -> bool {
        let is_within = |goal: u32| self.cost[goal as usize] as usize <= cost;
        let goals = subgoal.map_or(&self.graph.goal[..], |subgoal| &subgoal.kept);
        while let Some(&goal) = goals.get(*met) {
            if !is_within(goal) {
                return false;
            }
            *met += 1;
        }
        if subgoal.is_some_and(|subgoal| !subgoal.candidates.iter().any(|&goal| is_within(goal))) {
            return false;
        }
        state.open.iter().all(|open| {
            let end = self.graph.end_of[open.action as usize];
            self.missing[end as usize] == 0
        })
    }

    /// As [`spread`](Self::spread), for the propositions that hold and their consequences by rules.
    pub(super) fn propagate_zero_costs(&mut self, state: &State) {
        self.fire_sources(state);
        while let Some(proposition) = self.buckets.first_mut().and_then(Vec::pop) {
            self.reach(proposition, 0);
        }
    }

    fn fire_sources(&mut self, state: &State) {
        for position in 0..self.graph.sources.len() {
            let operator = self.graph.sources[position];
            let is_past = matches!(
                self.graph.operators[operator as usize].kind,
                Kind::Timed(timed) if timed < state.timed
            );
            if !is_past && self.missing[operator as usize] == 0 {
                self.fire(operator);
            }
        }
    }

    /// Processes a proposition from the queue at that cost.
    fn reach(&mut self, proposition: u32, cost: usize) {
        #[allow(clippy::cast_possible_truncation, reason = "below MOST")]
        let reached = cost as u32;
        // Each cost of a proposition is queued once; only the last one counts.
        if self.cost[proposition as usize] != reached {
            return;
        }
        for position in self.graph.dependents(proposition) {
            let operator = self.graph.needing_list[position] as usize;
            self.operator_cost[operator] = self.operator_cost[operator]
                .saturating_add(reached)
                .min(MOST);
            self.missing[operator] -= 1;
            if self.missing[operator] == 0 {
                #[allow(clippy::cast_possible_truncation, reason = "counted by u32")]
                self.fire(operator as u32);
            }
        }
    }

    /// Processes an operator whose preconditions are reached.
    fn fire(&mut self, operator: u32) {
        let cost = self.operator_cost[operator as usize];
        let own = self.own_cost[operator as usize];
        if cost == own && self.graph.operators[operator as usize].is_step {
            self.applicable.push(operator);
        }
        let Reaches { effects, gains } = self.reaches[operator as usize];
        for position in Reaches::range(effects) {
            let proposition = self.graph.effects[position];
            Self::lower(
                &mut self.cost,
                &mut self.achiever,
                &mut self.repetitions,
                &mut self.buckets,
                (proposition, operator, cost, 1),
            );
        }
        for position in Reaches::range(gains) {
            let (test, gain) = self.graph.gains[position];
            let Some(times) = gain.repetitions(self.gaps[test as usize]) else {
                continue;
            };
            let total = cost
                .saturating_add((times - 1).saturating_mul(own))
                .min(MOST);
            Self::lower(
                &mut self.cost,
                &mut self.achiever,
                &mut self.repetitions,
                &mut self.buckets,
                (self.graph.test(test), operator, total, times),
            );
        }
    }

    fn lower(
        costs: &mut [u32],
        achievers: &mut [u32],
        repetitions: &mut [u32],
        buckets: &mut Vec<Vec<u32>>,
        (proposition, operator, cost, times): (u32, u32, u32, u32),
    ) {
        let index = proposition as usize;
        if cost < costs[index] {
            costs[index] = cost;
            achievers[index] = operator;
            repetitions[index] = times;
            if buckets.len() <= cost as usize {
                buckets.resize(cost as usize + 1, Vec::new());
            }
            buckets[cost as usize].push(proposition);
        }
    }
}
