//! Dynamic programming over a perturbed world, sweep by sweep.

use super::{DeadEnds, Horizon, Move, Optimum, Perturbed};
use crate::search_state::SearchState;

/// By remaining patience, set of running actions, and state. Layer `i` is for `i` more steps that
/// may end in a dead end. Without [`DeadEnds::Patience`] there is one layer.
pub(super) type Values = Vec<Vec<Vec<f64>>>;

impl Perturbed {
    /// Computes the optimal values and policy.
    pub fn optimum(&self) -> Optimum {
        let mut optimum = Optimum {
            values: self.rewards(),
            moves: vec![vec![vec![Move::Stop; self.goal.len()]; self.sets.len()]; self.layers()],
            sweeps: 0,
        };
        // Abandoning is not a step, so it is possible when no step is left.
        for layer in 0..self.layers() {
            for set in 1..self.sets.len() {
                for state in (0..self.goal.len()).filter(|state| self.goal[*state]) {
                    if let Some(id) = self.members(set).next() {
                        optimum.values[layer][set][state] = 1.0;
                        optimum.moves[layer][set][state] = Move::Abandon(id);
                    }
                }
            }
        }
        let moves = &mut optimum.moves;
        optimum.sweeps = self.sweep(&mut optimum.values, &mut |here, before, after| {
            let mut best = before;
            for option in self.options(here.set, here.state) {
                let value = after(option);
                // A move is only replaced by a strictly better one, so that the policy makes
                // progress.
                if value > best + 1e-14 {
                    best = value;
                    moves[here.layer][here.set][here.state] = option;
                }
            }
            best
        });
        optimum
    }

    /// Returns the success probability of an agent with a fixed move in each state.
    ///
    /// `agent` is called once for each state that is not final, with certain facts, and with the
    /// number of further steps that may end in a dead end ([`DeadEnds::Patience`]; 0 otherwise). A
    /// move that is not possible counts as stopping.
    pub fn success_of(
        &self,
        initial: &SearchState,
        agent: &mut dyn FnMut(&SearchState, usize) -> Move,
    ) -> f64 {
        let mut values = self.rewards();
        let mut moves =
            vec![vec![vec![Move::Stop; self.goal.len()]; self.sets.len()]; self.layers()];
        for (layer, moves) in moves.iter_mut().enumerate() {
            for (set, moves) in moves.iter_mut().enumerate() {
                for (state, chosen) in moves.iter_mut().enumerate() {
                    if self.is_over(set, state) {
                        continue;
                    }
                    let wanted = agent(&self.circumstances(set, state, initial), layer);
                    if self.options(set, state).contains(&wanted) {
                        *chosen = wanted;
                    }
                    if let Move::Abandon(id) = *chosen {
                        values[layer][set][state] = values[layer][self.without(set, id)][state];
                    }
                }
            }
        }
        self.sweep(
            &mut values,
            &mut |here, before, after| match moves[here.layer][here.set][here.state] {
                Move::Stop => before,
                option => after(option),
            },
        );
        let weights = self.weights(initial).into_iter();
        let first = &values[self.layers() - 1];
        weights
            .map(|(set, state, weight)| weight * first[set][state])
            .sum()
    }

    /// Returns the number of tables.
    fn layers(&self) -> usize {
        match self.settings.dead_ends {
            DeadEnds::Harmless | DeadEnds::Lost => 1,
            DeadEnds::Patience(steps) => steps.max(1),
        }
    }

    /// Returns 1 for states where the goal holds and no action is running.
    fn rewards(&self) -> Values {
        let reached = self.goal.iter().map(|&goal| f64::from(u8::from(goal)));
        let mut sets = vec![vec![0.0; self.goal.len()]; self.sets.len()];
        sets[0] = reached.collect();
        vec![sets; self.layers()]
    }

    /// Updates the values, state by state, until the horizon is reached or nothing changes any
    /// more. Returns the number of sweeps. `update` computes the new value of a state from its old
    /// one and the values after each move.
    fn sweep(&self, values: &mut Values, update: &mut Update<'_>) -> usize {
        let mut sweeps = 0;
        let mut is_settled = vec![false; values.len()];
        loop {
            if matches!(self.settings.horizon, Horizon::Steps(most) if sweeps >= most) {
                return sweeps;
            }
            let was_settled = is_settled.clone();
            let landings: Vec<_> = (0..values.len())
                .map(|i| self.values_at_step_end(values, i))
                .collect();
            for (layer, landing) in landings.iter().enumerate() {
                if was_settled[layer] && layer.checked_sub(1).is_none_or(|i| was_settled[i]) {
                    continue;
                }
                let flipped = self.after_spontaneous_changes(landing);
                let mut greatest: f64 = 0.0;
                for set in 0..self.sets.len() {
                    for state in 0..self.goal.len() {
                        if self.is_over(set, state) {
                            continue;
                        }
                        let here = StateIndex { layer, set, state };
                        let before = values[layer][set][state];
                        let value = update(here, before, &|option| {
                            self.value_of(set, state, option, &flipped, &values[layer])
                        });
                        greatest = greatest.max((value - before).abs());
                        values[layer][set][state] = value;
                    }
                }
                is_settled[layer] = greatest < 1e-12;
            }
            sweeps += 1;
            if is_settled.iter().all(|&settled| settled) {
                return sweeps;
            }
        }
    }

    /// Returns the value of a state at the end of a step. A step into a dead end uses up patience.
    fn values_at_step_end(&self, values: &Values, layer: usize) -> Vec<Vec<f64>> {
        let mut landing = values[layer].clone();
        if !matches!(self.settings.dead_ends, DeadEnds::Patience(_)) {
            return landing;
        }
        for (set, row) in landing.iter_mut().enumerate() {
            for (state, value) in row.iter_mut().enumerate() {
                if self.is_dead_end(set, state) {
                    let below = layer.checked_sub(1).map(|below| &values[below]);
                    *value = below.map_or(0.0, |below| below[set][state]);
                }
            }
        }
        landing
    }
}

/// A state of the process.
#[derive(Clone, Copy, Debug)]
struct StateIndex {
    layer: usize,
    set: usize,
    state: usize,
}

type Update<'u> = dyn FnMut(StateIndex, f64, &dyn Fn(Move) -> f64) -> f64 + 'u;
