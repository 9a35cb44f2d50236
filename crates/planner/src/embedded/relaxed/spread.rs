//! The costs of propositions: from what holds to what can be reached.

use super::super::state::State;
use super::graph::Kind;
use super::{MOST, Reaches, Relaxed};

impl Relaxed<'_> {
    /// Dijkstra's algorithm from what holds. If it stops early, it ends once all of the goal, and of what is
    /// under way, is reached at no more than the cost that has been done: what has such a cost keeps it and
    /// its achiever, and so does all that they rest on. The relaxed plan is the same then, but that the end
    /// of an action which nothing else needs may be missing.
    pub(super) fn spread(&mut self, state: &State, stops_early: bool) {
        self.fire_sources(state);
        let mut cost = 0;
        let mut goals_met = 0;
        while cost < self.buckets.len() {
            let Some(proposition) = self.buckets[cost].pop() else {
                if stops_early && self.is_goal_within(state, cost, &mut goals_met) {
                    self.buckets.iter_mut().for_each(Vec::clear);
                    return;
                }
                cost += 1;
                continue;
            };
            self.reach(proposition, cost);
        }
    }

    /// Whether all of the goal costs no more than this, each part by itself, and all that is under
    /// way can end at no higher cost. Of the goal, the first `met` parts do.
    fn is_goal_within(&self, state: &State, cost: usize, met: &mut usize) -> bool {
        while let Some(&goal) = self.graph.goal.get(*met) {
            if self.cost[goal as usize] as usize > cost {
                return false;
            }
            *met += 1;
        }
        state.open.iter().all(|open| {
            let end = self.graph.end_of[open.action as usize];
            self.missing[end as usize] == 0
        })
    }

    /// The same for what holds and what follows from it by rules.
    pub(super) fn spread_at_cost_zero(&mut self, state: &State) {
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

    /// The proposition's turn has come, at that cost.
    fn reach(&mut self, proposition: u32, cost: usize) {
        #[allow(clippy::cast_possible_truncation, reason = "below MOST")]
        let reached = cost as u32;
        // Each cost that a proposition had is in the queue once; only the last one counts.
        if self.cost[proposition as usize] != reached {
            return;
        }
        for position in self.graph.needing(proposition) {
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

    /// The operator's preconditions are reached.
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
