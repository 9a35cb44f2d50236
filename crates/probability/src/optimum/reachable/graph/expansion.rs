//! Branches of a node: moves, their outcomes, and spontaneous changes.

use elbowroom_plan::{InstanceId, NodeId};

use super::{Bits, Branch, CHOICE, Graph, Node, number};
use crate::model::{Event, FactEffect, Model, Requirement};
use crate::optimum::Settings;
use crate::optimum::reachable::parts::Part;
use crate::optimum::table::{holds_in, is_satisfied};

/// The part's rules, in terms of bits.
#[derive(Debug)]
pub(super) struct Expansion<'m> {
    model: &'m Model,
    settings: &'m Settings,
    part: &'m Part,
    /// Position of the first bit of a running action.
    first_action: usize,
    /// Facts that may change by themselves.
    changing: Vec<usize>,
}

impl<'m> Expansion<'m> {
    pub(super) fn new(model: &'m Model, settings: &'m Settings, part: &'m Part) -> Self {
        let changes = |fact: &usize| {
            let flip = &model.spontaneous_changes[*fact];
            flip.becomes_true > 0.0 || flip.becomes_false > 0.0
        };
        Self {
            model,
            settings,
            part,
            first_action: model.facts.len(),
            changing: part.facts.iter().copied().filter(changes).collect(),
        }
    }

    /// Returns the bits of a state with these facts and no running action.
    pub(super) fn bits(&self, facts: &[usize]) -> Bits {
        let length = self.first_action + self.model.plan().instances.len();
        let mut bits = vec![0; length.div_ceil(64)].into_boxed_slice();
        for &fact in facts {
            set(&mut bits, fact, true);
        }
        bits
    }

    fn is_running(&self, bits: &[u64], instance: usize) -> bool {
        get(bits, self.first_action + instance)
    }

    fn with_running(&self, bits: &Bits, instance: usize, is_running: bool) -> Bits {
        let mut bits = bits.clone();
        set(&mut bits, self.first_action + instance, is_running);
        bits
    }

    fn running(&self, bits: &[u64]) -> usize {
        let own = self.part.instances.iter();
        own.filter(|it| self.is_running(bits, **it)).count()
    }

    fn is_satisfied(&self, requirement: &Requirement, bits: &[u64]) -> bool {
        is_satisfied(self.model, requirement, &|fact| get(bits, fact))
    }

    fn is_goal(&self, bits: &[u64]) -> bool {
        self.running(bits) == 0 && self.is_satisfied(&self.part.goal, bits)
    }

    /// Returns the state without the actions whose over-all conditions do not hold.
    fn enforced(&self, bits: &Bits) -> Bits {
        let mut after = bits.clone();
        if !self.settings.enforces_over_all {
            return after;
        }
        for &instance in &self.part.instances {
            let start = self.model.start(InstanceId::from(instance));
            let over_all = &self.model.event(start).over_all;
            if self.is_running(bits, instance) && !self.is_satisfied(over_all, bits) {
                set(&mut after, self.first_action + instance, false);
            }
        }
        after
    }

    /// Returns the next stage, from `stage` on, at which a fact may change, with the fact and the
    /// probability.
    fn next_change(&self, bits: &[u64], stage: usize) -> Option<(usize, usize, f64)> {
        let later = self.changing.iter().enumerate().skip(stage);
        let mut changes = later.map(|(stage, &fact)| {
            let flip = &self.model.spontaneous_changes[fact];
            let probability = if get(bits, fact) {
                flip.becomes_false
            } else {
                flip.becomes_true
            };
            (stage, fact, probability)
        });
        changes.find(|(.., probability)| *probability > 0.0)
    }

    /// Returns the possible states after a happening, before spontaneous changes. `after` has the
    /// actions that are running if the happening takes place.
    fn outcomes(&self, bits: &Bits, node: NodeId, after: &Bits) -> Vec<(Bits, f64)> {
        let event = self.model.event(node);
        let mut outcomes = vec![(after.clone(), event.success)];
        for effect in self.effects(event, bits) {
            let p = effect.probability;
            let split = |(state, weight): (Bits, f64)| {
                let mut done = state.clone();
                set(&mut done, effect.fact, effect.makes_true);
                [(done, weight * p), (state, weight * (1.0 - p))]
            };
            outcomes = outcomes.into_iter().flat_map(split).collect();
            outcomes.retain(|(_, weight)| *weight > 0.0);
        }
        let failure = 1.0 - event.success;
        if event.failure_outcomes.is_empty() {
            outcomes.push((bits.clone(), failure));
        }
        for outcome in &event.failure_outcomes {
            let mut state = after.clone();
            for &(fact, becomes) in &outcome.changes {
                set(&mut state, fact, becomes);
            }
            outcomes.push((state, failure * outcome.probability));
        }
        outcomes.retain(|(_, weight)| *weight > 0.0);
        outcomes
    }

    /// Returns the state after a happening if all effects take place.
    fn nominal(&self, bits: &[u64], node: NodeId, after: &Bits) -> Bits {
        let mut state = after.clone();
        for effect in self.effects(self.model.event(node), bits) {
            set(&mut state, effect.fact, effect.makes_true);
        }
        state
    }

    /// Returns the effects whose guards hold, deletions first.
    fn effects(&self, event: &'m Event, bits: &[u64]) -> Vec<&'m FactEffect> {
        let happens = |effect: &&FactEffect| {
            let guard = effect.guard.as_ref();
            guard.is_none_or(|it| holds_in(self.model, it, &|fact| get(bits, fact)))
        };
        let mut effects: Vec<_> = event.effects.iter().filter(happens).collect();
        effects.sort_by_key(|effect| effect.makes_true);
        effects
    }

    /// Returns the happenings that are possible in a state, each with the state that has the
    /// actions that are running after it.
    fn moves(&self, bits: &Bits) -> Vec<(NodeId, Bits)> {
        let is_startable = self.running(bits) < self.settings.most_running;
        let mut moves = Vec::new();
        for &instance in &self.part.instances {
            let id = InstanceId::from(instance);
            let (start, end) = (self.model.start(id), self.model.end(id));
            let is_running = self.is_running(bits, instance);
            let node = if is_running { end } else { start };
            let is_instantaneous = start == end;
            if !(is_running || is_instantaneous || is_startable)
                || !self.is_satisfied(&self.model.event(node).condition, bits)
            {
                continue;
            }
            let runs_after = !is_running && !is_instantaneous;
            moves.push((node, self.with_running(bits, instance, runs_after)));
        }
        moves
    }
}

impl Graph<'_> {
    /// Finds the branches of an open node.
    pub(super) fn expand(&mut self, node: u32) {
        if self.nodes[node as usize] != Node::Open {
            return;
        }
        let Some(key) = self.keys.get_index(node as usize).cloned() else {
            return;
        };
        if key.stage == CHOICE && self.expansion.is_goal(&key.bits) {
            self.nodes[node as usize] = Node::Goal;
            return;
        }
        let first = number(self.branches.len());
        if key.stage == CHOICE {
            self.add_moves(&key.bits);
        } else {
            self.add_change(node, &key.bits, key.stage as usize);
        }
        self.nodes[node as usize] = Node::Expanded(first, number(self.branches.len()));
    }

    /// Adds the spontaneous change of a stage.
    fn add_change(&mut self, node: u32, bits: &Bits, stage: usize) {
        let Some((stage, fact, p)) = self.expansion.next_change(bits, stage) else {
            return;
        };
        let mut changed = bits.clone();
        set(&mut changed, fact, !get(bits, fact));
        let mut edges = vec![(self.landing(&changed, stage + 1), p)];
        if p < 1.0 {
            edges.push((self.landing(bits, stage + 1), 1.0 - p));
        }
        self.add_branch(edges, node);
    }

    fn add_moves(&mut self, bits: &Bits) {
        for (happening, after) in self.expansion.moves(bits) {
            let nominal = self.expansion.nominal(bits, happening, &after);
            let nominal = self.node(nominal, CHOICE);
            let outcomes = self.expansion.outcomes(bits, happening, &after);
            let mut edges = Vec::with_capacity(outcomes.len());
            for (state, weight) in outcomes {
                edges.push((self.landing(&state, 0), weight));
            }
            self.add_branch(edges, nominal);
        }
        for &instance in &self.expansion.part.instances {
            if self.expansion.is_running(bits, instance) {
                let without = self.expansion.with_running(bits, instance, false);
                let target = self.node(without, CHOICE);
                self.add_branch(vec![(target, 1.0)], target);
            }
        }
    }

    /// Returns the node of a state before the spontaneous changes from this stage on.
    fn landing(&mut self, bits: &Bits, stage: usize) -> u32 {
        if let Some((stage, ..)) = self.expansion.next_change(bits, stage) {
            return self.node(bits.clone(), number(stage));
        }
        let enforced = self.expansion.enforced(bits);
        self.node(enforced, CHOICE)
    }

    fn add_branch(&mut self, edges: Vec<(u32, f64)>, nominal: u32) {
        let first = number(self.edges.len());
        self.edges.extend(edges);
        self.branches.push(Branch {
            edges: (first, number(self.edges.len())),
            nominal,
        });
    }
}

fn get(bits: &[u64], position: usize) -> bool {
    bits[position / 64] & (1 << (position % 64)) != 0
}

fn set(bits: &mut [u64], position: usize, value: bool) {
    let bit = 1 << (position % 64);
    if value {
        bits[position / 64] |= bit;
    } else {
        bits[position / 64] &= !bit;
    }
}
