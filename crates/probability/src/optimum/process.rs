//! Markov decision process of a perturbed world: states, moves, and transitions.

use std::sync::Arc;

use elbowroom_plan::{InstanceId, Node, NodeId};

use super::table::{check, holds, table};
use super::{DeadEnds, Move, Settings, TabulationError};
use crate::model::{Event, Model, Requirement};
use crate::search_state::SearchState;

/// Largest number of states to tabulate.
const MAX_STATES: usize = 1 << 22;

/// Markov decision process; see [`optimum`](super).
#[derive(Clone, Debug)]
pub struct Perturbed {
    model: Arc<Model>,
    pub(super) settings: Settings,
    /// Possible sets of running actions, as bits, sorted by size.
    pub(super) sets: Vec<u32>,
    /// Position of each set.
    place: Vec<usize>,
    /// By node: `true` for the states where its condition holds.
    is_possible: Vec<Vec<bool>>,
    /// By instance: `true` for the states where its over-all condition holds.
    over_all_holds: Vec<Vec<bool>>,
    pub(super) goal: Vec<bool>,
    /// By set and state: `true` if a plan exists.
    is_solvable: Vec<Vec<bool>>,
    starts: Vec<NodeId>,
    ends: Vec<NodeId>,
}

impl Perturbed {
    /// Creates the world where the actions of the model's plan can be executed any number of times.
    ///
    /// # Errors
    /// When it is too large, or of an unsupported kind.
    pub fn new(model: impl Into<Arc<Model>>, settings: Settings) -> Result<Self, TabulationError> {
        let model: Arc<Model> = model.into();
        let instances = model.plan().instances.len();
        let facts = model.facts.len();
        check(&model)?;
        let too_many = || TabulationError::TooManyStates {
            facts,
            actions: instances,
        };
        if facts > 20 || instances > 20 {
            return Err(too_many());
        }
        let durative: u32 = model
            .plan()
            .instances()
            .filter(|(_, instance)| instance.action.durative().is_some())
            .map(|(id, _)| 1 << id.0)
            .sum();
        let fits =
            |set: &u32| set & !durative == 0 && set.count_ones() as usize <= settings.most_running;
        let mut sets: Vec<u32> = (0..1 << instances).filter(fits).collect();
        sets.sort_by_key(|set| (set.count_ones(), *set));
        if sets.len() << facts > MAX_STATES {
            return Err(too_many());
        }
        let mut place = vec![usize::MAX; 1 << instances];
        for (at, &set) in sets.iter().enumerate() {
            place[set as usize] = at;
        }
        let holds = |requirement: &Requirement| table(&model, requirement);
        let ids = || model.plan().instances().map(|(id, _)| id);
        let mut process = Self {
            settings,
            sets,
            place,
            is_possible: model
                .events
                .iter()
                .map(|event| holds(&event.condition))
                .collect(),
            over_all_holds: ids()
                .map(|id| holds(&model.event(model.start(id)).over_all))
                .collect(),
            goal: holds(&model.goal),
            is_solvable: Vec::new(),
            starts: ids().map(|id| model.start(id)).collect(),
            ends: ids().map(|id| model.end(id)).collect(),
            model: Arc::clone(&model),
        };
        process.is_solvable = process.solvable();
        Ok(process)
    }

    /// Returns the model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Returns the rules.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns the circumstances with the facts of a state and the running actions of a set.
    pub(super) fn circumstances(
        &self,
        set: usize,
        state: usize,
        like: &SearchState,
    ) -> SearchState {
        let mut circumstances = like.clone();
        for (place, &fact) in self.model.facts.iter().enumerate() {
            let truth = state & (1 << place) != 0;
            circumstances.belief.set(fact, f64::from(u8::from(truth)));
        }
        circumstances.running = self
            .members(set)
            .map(|instance| crate::Running {
                instance,
                start: like.now.clone(),
            })
            .collect();
        circumstances
    }

    /// Returns the possible states of a belief, with their probabilities.
    pub(super) fn weights(&self, circumstances: &SearchState) -> Vec<(usize, usize, f64)> {
        let running = circumstances.running.iter();
        let set = running.fold(0_u32, |set, running| set | 1 << running.instance.0);
        let Some(&set) = self
            .place
            .get(set as usize)
            .filter(|place| **place != usize::MAX)
        else {
            return Vec::new();
        };
        let mut weights = vec![(0, 1.0)];
        for (place, &fact) in self.model.facts.iter().enumerate() {
            let p = circumstances.belief.probability(fact);
            let split = |(state, weight): (usize, f64)| {
                [
                    (state | (1 << place), weight * p),
                    (state, weight * (1.0 - p)),
                ]
            };
            weights = weights.into_iter().flat_map(split).collect();
            weights.retain(|(_, weight)| *weight > 0.0);
        }
        weights
            .into_iter()
            .map(|(state, weight)| (set, state, weight))
            .collect()
    }

    /// Returns `true` in a final state: success, or a lost run.
    pub(super) fn is_over(&self, set: usize, state: usize) -> bool {
        (set == 0 && self.goal[state])
            || (self.settings.dead_ends == DeadEnds::Lost && self.is_dead_end(set, state))
    }

    /// Returns `true` if the goal is unreachable from here even without further failures.
    pub(super) fn is_dead_end(&self, set: usize, state: usize) -> bool {
        !self.is_solvable[set][state]
    }

    /// Returns `true` if a planner finds no plan from here: the facts are those of `state`, and the
    /// actions of these instances are running. Returns `false` for states outside of the table.
    pub fn is_dead_end_at(&self, state: &elbowroom_model::State, running: &[InstanceId]) -> bool {
        self.place(state, running)
            .is_some_and(|(set, state)| self.is_dead_end(set, state))
    }

    /// Returns the position of a state in the tables; `None` if more actions are running than they
    /// support.
    pub(super) fn place(
        &self,
        state: &elbowroom_model::State,
        running: &[InstanceId],
    ) -> Option<(usize, usize)> {
        let set = running
            .iter()
            .fold(0_u32, |set, instance| set | 1 << instance.0);
        let set = *self.place.get(set as usize)?;
        let facts = self.model.facts.iter().enumerate();
        let bits = facts.filter(|(_, fact)| state.facts.contains(fact));
        let bits = bits.map(|(place, _)| 1 << place).sum();
        (set != usize::MAX).then_some((set, bits))
    }

    pub(super) fn members(&self, set: usize) -> impl Iterator<Item = InstanceId> + '_ {
        let bits = self.sets[set];
        let ids = self.model.plan().instances().map(|(id, _)| id);
        ids.filter(move |id| bits & (1 << id.0) != 0)
    }

    pub(super) fn without(&self, set: usize, id: InstanceId) -> usize {
        self.place[(self.sets[set] & !(1 << id.0)) as usize]
    }

    /// Returns the possible moves, in the order of the plan.
    pub(super) fn options(&self, set: usize, state: usize) -> Vec<Move> {
        let mut options = Vec::new();
        let bits = self.sets[set];
        for (index, (&start, &end)) in self.starts.iter().zip(&self.ends).enumerate() {
            let own = 1 << index;
            if bits & own != 0 {
                if self.is_possible[end.index()][state] {
                    options.push(Move::Try(end));
                }
                options.push(Move::Abandon(InstanceId::from(index)));
            } else {
                let is_room = start == end || self.place[(bits | own) as usize] != usize::MAX;
                if is_room && self.is_possible[start.index()][state] {
                    options.push(Move::Try(start));
                }
            }
        }
        options
    }

    /// Returns the set of running actions after a successful happening.
    fn set_after(&self, set: usize, node: NodeId) -> usize {
        let bits = match self.model.plan().nodes[node.index()] {
            Node::Start(id) => self.sets[set] | (1 << id.0),
            Node::End(id) => self.sets[set] & !(1 << id.0),
            Node::Zero | Node::Instant(_) | Node::Timed(_) => self.sets[set],
        };
        self.place[bits as usize]
    }

    pub(super) fn value_of(
        &self,
        set: usize,
        state: usize,
        option: Move,
        flipped: &[Vec<f64>],
        values: &[Vec<f64>],
    ) -> f64 {
        match option {
            Move::Stop => 0.0,
            Move::Abandon(id) => values[self.without(set, id)][state],
            Move::Try(node) => {
                let event = self.model.event(node);
                let after = &flipped[self.set_after(set, node)];
                let success = self.expected(event, state, after);
                // A failed start changes nothing.
                let failure = if event.failure_outcomes.is_empty() {
                    flipped[set][state]
                } else {
                    expected_failure_outcome(event, state, after)
                };
                event.success * success + (1.0 - event.success) * failure
            }
        }
    }

    /// Returns the expected value after the effects of a happening.
    fn expected(&self, event: &Event, state: usize, after: &[f64]) -> f64 {
        let happening = |makes_true: bool| {
            event.effects.iter().filter(move |effect| {
                let guard = effect.guard.as_ref();
                effect.makes_true == makes_true
                    && guard.is_none_or(|guard| holds(&self.model, guard, state))
            })
        };
        let mut outcomes = vec![(state, 1.0)];
        for effect in happening(false).chain(happening(true)) {
            let bit = 1 << effect.fact;
            let p = effect.probability;
            let split = |(state, weight): (usize, f64)| {
                let done = if effect.makes_true {
                    state | bit
                } else {
                    state & !bit
                };
                [(done, weight * p), (state, weight * (1.0 - p))]
            };
            outcomes = outcomes.into_iter().flat_map(split).collect();
            outcomes.retain(|(_, weight)| *weight > 0.0);
        }
        outcomes
            .iter()
            .map(|(state, weight)| weight * after[*state])
            .sum()
    }

    /// Returns the expected values before spontaneous changes, computed fact by fact.
    pub(super) fn after_spontaneous_changes(&self, values: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut flipped: Vec<Vec<f64>> = values.to_vec();
        if self.settings.enforces_over_all {
            for (set, row) in flipped.iter_mut().enumerate() {
                for (state, value) in row.iter_mut().enumerate() {
                    let ended: u32 = self
                        .members(set)
                        .filter(|id| !self.over_all_holds[id.index()][state])
                        .map(|id| 1 << id.0)
                        .sum();
                    *value = values[self.place[(self.sets[set] & !ended) as usize]][state];
                }
            }
        }
        for row in &mut flipped {
            for (place, flip) in self.model.spontaneous_changes.iter().enumerate() {
                let bit = 1 << place;
                for state in (0..row.len()).filter(|state| state & bit == 0) {
                    let (if_false, if_true) = (row[state], row[state | bit]);
                    let p = flip.becomes_true;
                    row[state] = if_false * (1.0 - p) + if_true * p;
                    let p = flip.becomes_false;
                    row[state | bit] = if_true * (1.0 - p) + if_false * p;
                }
            }
        }
        flipped
    }

    /// Returns the states that reach the goal without failures.
    fn solvable(&self) -> Vec<Vec<bool>> {
        let states = self.goal.len();
        let mut solvable = vec![vec![false; states]; self.sets.len()];
        solvable[0].clone_from(&self.goal);
        loop {
            let mut is_changed = false;
            for set in 0..self.sets.len() {
                for state in 0..states {
                    if solvable[set][state] {
                        continue;
                    }
                    let leads_on =
                        self.options(set, state)
                            .into_iter()
                            .any(|option| match option {
                                Move::Try(node) => {
                                    let after = self.nominal(self.model.event(node), state);
                                    solvable[self.set_after(set, node)][after]
                                }
                                Move::Abandon(id) => solvable[self.without(set, id)][state],
                                Move::Stop => false,
                            });
                    solvable[set][state] = leads_on;
                    is_changed |= leads_on;
                }
            }
            if !is_changed {
                return solvable;
            }
        }
    }

    /// Returns the state after the effects of a happening, if all take place.
    fn nominal(&self, event: &Event, state: usize) -> usize {
        let mut after = state;
        for makes_true in [false, true] {
            for effect in event.effects.iter().filter(|e| e.makes_true == makes_true) {
                let guard = effect.guard.as_ref();
                if guard.is_none_or(|guard| holds(&self.model, guard, state)) {
                    let bit = 1 << effect.fact;
                    after = if makes_true {
                        after | bit
                    } else {
                        after & !bit
                    };
                }
            }
        }
        after
    }
}

/// Returns the expected value after a failed end.
fn expected_failure_outcome(event: &Event, state: usize, after: &[f64]) -> f64 {
    let values = event.failure_outcomes.iter().map(|aftermath| {
        let changes = aftermath.changes.iter();
        let state = changes.fold(state, |state, &(fact, becomes)| {
            if becomes {
                state | (1 << fact)
            } else {
                state & !(1 << fact)
            }
        });
        aftermath.probability * after[state]
    });
    values.sum()
}
