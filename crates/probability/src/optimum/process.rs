//! The Markov decision process of a perturbed world, and dynamic programming over it.

use std::sync::Arc;

use elbowroom_plan::{InstanceId, Node, NodeId};

use super::table::{check, holds, table};
use super::{Horizon, Move, NotSmall, Optimum, Settings};
use crate::circumstances::Circumstances;
use crate::model::{Event, Model, Requirement};

/// More states than this are not tabulated.
const MOST_STATES: usize = 1 << 22;

/// See [`optimum`](super).
#[derive(Clone, Debug)]
pub struct Perturbed {
    model: Arc<Model>,
    settings: Settings,
    /// The sets of actions that can be under way, as bits, those with fewer actions first.
    sets: Vec<u32>,
    /// The position of each set.
    place: Vec<usize>,
    /// By node: in which states its condition holds.
    is_possible: Vec<Vec<bool>>,
    /// By instance: in which states its over-all condition holds.
    goes_on: Vec<Vec<bool>>,
    goal: Vec<bool>,
    /// By set and state: whether a plan exists.
    is_solvable: Vec<Vec<bool>>,
    starts: Vec<NodeId>,
    ends: Vec<NodeId>,
}

impl Perturbed {
    /// The world in which the actions of the model's plan can be done, again and again.
    ///
    /// # Errors
    /// When it is not small enough, or not of this kind.
    pub fn new(model: impl Into<Arc<Model>>, settings: Settings) -> Result<Self, NotSmall> {
        let model: Arc<Model> = model.into();
        let instances = model.plan().instances.len();
        let facts = model.facts.len();
        check(&model)?;
        let too_many = || NotSmall::TooManyStates {
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
        if sets.len() << facts > MOST_STATES {
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
            goes_on: ids()
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

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The rules.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The best that can be done, and how.
    pub fn optimum(&self) -> Optimum {
        let states = self.goal.len();
        let mut optimum = Optimum {
            values: vec![vec![0.0; states]; self.sets.len()],
            moves: vec![vec![Move::Stop; states]; self.sets.len()],
            sweeps: 0,
        };
        self.reward(&mut optimum.values);
        // Letting go takes no step, so it can be done when none is left.
        for set in 1..self.sets.len() {
            for state in (0..states).filter(|state| self.goal[*state]) {
                if let Some(id) = self.members(set).next() {
                    optimum.values[set][state] = 1.0;
                    optimum.moves[set][state] = Move::Abandon(id);
                }
            }
        }
        loop {
            if matches!(self.settings.horizon, Horizon::Steps(most) if optimum.sweeps >= most) {
                return optimum;
            }
            let flipped = self.flipped(&optimum.values);
            let mut greatest: f64 = 0.0;
            for set in 0..self.sets.len() {
                for state in 0..states {
                    if self.is_over(set, state) {
                        continue;
                    }
                    let mut best = optimum.values[set][state];
                    let mut chosen = None;
                    for option in self.options(set, state) {
                        let value = self.value_of(set, state, option, &flipped, &optimum.values);
                        // A move is kept until a better one is found, so that moves lead on.
                        if value > best + 1e-14 {
                            (best, chosen) = (value, Some(option));
                        }
                    }
                    if let Some(chosen) = chosen {
                        greatest = greatest.max(best - optimum.values[set][state]);
                        optimum.values[set][state] = best;
                        optimum.moves[set][state] = chosen;
                    }
                }
            }
            optimum.sweeps += 1;
            if greatest < 1e-12 {
                return optimum;
            }
        }
    }

    /// How likely an agent is to succeed that always does the same in the same state.
    ///
    /// `agent` is asked once for each state that is not over, with all its facts certain. A move
    /// that is not possible counts as stopping.
    pub fn success_of(
        &self,
        initial: &Circumstances,
        agent: &mut dyn FnMut(&Circumstances) -> Move,
    ) -> f64 {
        let states = self.goal.len();
        let mut moves = vec![vec![Move::Stop; states]; self.sets.len()];
        for (set, moves) in moves.iter_mut().enumerate() {
            for (state, chosen) in moves.iter_mut().enumerate() {
                if self.is_over(set, state) {
                    continue;
                }
                let wanted = agent(&self.circumstances(set, state, initial));
                if self.options(set, state).contains(&wanted) {
                    *chosen = wanted;
                }
            }
        }
        let mut values = vec![vec![0.0; states]; self.sets.len()];
        self.reward(&mut values);
        for set in 1..self.sets.len() {
            for state in 0..states {
                if let Move::Abandon(id) = moves[set][state] {
                    values[set][state] = values[self.without(set, id)][state];
                }
            }
        }
        let mut sweeps = 0;
        loop {
            if matches!(self.settings.horizon, Horizon::Steps(most) if sweeps >= most) {
                break;
            }
            let flipped = self.flipped(&values);
            let mut greatest: f64 = 0.0;
            for set in 0..self.sets.len() {
                for state in 0..states {
                    if self.is_over(set, state) || moves[set][state] == Move::Stop {
                        continue;
                    }
                    let chosen = moves[set][state];
                    let value = self.value_of(set, state, chosen, &flipped, &values);
                    greatest = greatest.max((value - values[set][state]).abs());
                    values[set][state] = value;
                }
            }
            sweeps += 1;
            if greatest < 1e-12 {
                break;
            }
        }
        let weights = self.weights(initial).into_iter();
        weights
            .map(|(set, state, weight)| weight * values[set][state])
            .sum()
    }

    /// The circumstances in which the facts are as in a state and a set of actions is under way.
    fn circumstances(&self, set: usize, state: usize, like: &Circumstances) -> Circumstances {
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

    /// The states that a belief may stand for, with how likely they are.
    pub(super) fn weights(&self, circumstances: &Circumstances) -> Vec<(usize, usize, f64)> {
        let running = circumstances.running.iter();
        let set: u32 = running.map(|running| 1 << running.instance.0).sum();
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

    fn reward(&self, values: &mut [Vec<f64>]) {
        for (state, value) in values[0].iter_mut().enumerate() {
            *value = f64::from(u8::from(self.goal[state]));
        }
    }

    /// Whether nothing is left to decide: success, or no way to it.
    fn is_over(&self, set: usize, state: usize) -> bool {
        (set == 0 && self.goal[state])
            || (self.settings.needs_plan && !self.is_solvable[set][state])
    }

    fn members(&self, set: usize) -> impl Iterator<Item = InstanceId> + '_ {
        let bits = self.sets[set];
        let ids = self.model.plan().instances().map(|(id, _)| id);
        ids.filter(move |id| bits & (1 << id.0) != 0)
    }

    fn without(&self, set: usize, id: InstanceId) -> usize {
        self.place[(self.sets[set] & !(1 << id.0)) as usize]
    }

    /// What can be done, in the order of the plan.
    fn options(&self, set: usize, state: usize) -> Vec<Move> {
        let mut options = Vec::new();
        let bits = self.sets[set];
        for (index, (&start, &end)) in self.starts.iter().zip(&self.ends).enumerate() {
            let own = 1 << index;
            if bits & own != 0 {
                if self.is_possible[end.index()][state] {
                    options.push(Move::Do(end));
                }
                options.push(Move::Abandon(InstanceId::from(index)));
            } else {
                let is_room = start == end || self.place[(bits | own) as usize] != usize::MAX;
                if is_room && self.is_possible[start.index()][state] {
                    options.push(Move::Do(start));
                }
            }
        }
        options
    }

    /// Where a happening leads if it succeeds.
    fn set_after(&self, set: usize, node: NodeId) -> usize {
        let bits = match self.model.plan().nodes[node.index()] {
            Node::Start(id) => self.sets[set] | (1 << id.0),
            Node::End(id) => self.sets[set] & !(1 << id.0),
            Node::Zero | Node::Instant(_) | Node::Timed(_) => self.sets[set],
        };
        self.place[bits as usize]
    }

    fn value_of(
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
            Move::Do(node) => {
                let event = self.model.event(node);
                let after = &flipped[self.set_after(set, node)];
                let success = self.expected(event, state, after);
                event.success * success + (1.0 - event.success) * flipped[set][state]
            }
        }
    }

    /// The expected value after the effects of a happening.
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

    /// The expected values before facts change by themselves, fact by fact.
    fn flipped(&self, values: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut flipped: Vec<Vec<f64>> = values.to_vec();
        if self.settings.enforces_over_all {
            for (set, row) in flipped.iter_mut().enumerate() {
                for (state, value) in row.iter_mut().enumerate() {
                    let ended: u32 = self
                        .members(set)
                        .filter(|id| !self.goes_on[id.index()][state])
                        .map(|id| 1 << id.0)
                        .sum();
                    *value = values[self.place[(self.sets[set] & !ended) as usize]][state];
                }
            }
        }
        for row in &mut flipped {
            for (place, flip) in self.model.flips.iter().enumerate() {
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

    /// From where the goal is reached if nothing goes wrong.
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
                                Move::Do(node) => {
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

    /// The state after the effects of a happening, if all take place.
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
