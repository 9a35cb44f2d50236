//! Simple reference implementations: the process of `docs/research/probability.md` with all worlds
//! enumerated, and the enumeration of all orders.
#![allow(dead_code, reason = "each test uses some of it")]

pub(crate) mod orders;
pub(crate) mod random;

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::ground::{
    Body, Change, Condition, Effect, Expression, FactId, FluentId, SnapAction,
};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId, PartialOrderPlan};
use elbowroom_probability::likelihoods::FailureModel;
use elbowroom_probability::{Likelihoods, SearchState, Semantics, SpontaneousChange};

/// A world: the true facts, and the end effects of running actions that will take place.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct World {
    facts: Vec<bool>,
    memories: BTreeMap<(InstanceId, usize), bool>,
}

/// All possible worlds after an order, with their probabilities.
#[derive(Clone, Debug)]
pub(crate) struct Worlds<'a> {
    task: &'a Task,
    plan: &'a PartialOrderPlan,
    likelihoods: &'a Likelihoods,
    semantics: Semantics,
    values: BTreeMap<FluentId, Rational>,
    running: Vec<InstanceId>,
    possible: Vec<(World, f64)>,
    /// Present time in seconds.
    now: f64,
    /// Ends of the running actions.
    ends: BTreeMap<InstanceId, f64>,
}

impl<'a> Worlds<'a> {
    pub(crate) fn new(
        task: &'a Task,
        plan: &'a PartialOrderPlan,
        likelihoods: &'a Likelihoods,
        semantics: Semantics,
        circumstances: &SearchState,
    ) -> Self {
        let mut memories = BTreeMap::new();
        for running in &circumstances.running {
            for (place, effect) in end_effects(plan, running.instance).iter().enumerate() {
                if has_memory(effect) {
                    memories.insert((running.instance, place), true);
                }
            }
        }
        let mut worlds = vec![(Vec::new(), 1.0)];
        for index in 0..task.fact_count() {
            let fact = FactId(u32::try_from(index).unwrap());
            let p = circumstances.belief.probability(fact);
            worlds = worlds
                .into_iter()
                .flat_map(|(facts, weight)| {
                    [(true, p), (false, 1.0 - p)].map(|(truth, p)| {
                        let mut facts = facts.clone();
                        facts.push(truth);
                        (facts, weight * p)
                    })
                })
                .filter(|(_, weight)| *weight > 0.0)
                .collect();
        }
        let world = |(facts, weight)| {
            let memories = memories.clone();
            (World { facts, memories }, weight)
        };
        let mut all = Self {
            task,
            plan,
            likelihoods,
            semantics,
            values: circumstances.values.clone(),
            running: circumstances.running.iter().map(|r| r.instance).collect(),
            possible: worlds.into_iter().map(world).collect(),
            now: circumstances.now.to_f64(),
            ends: BTreeMap::new(),
        };
        for running in &circumstances.running {
            let end = running.start.to_f64() + all.lasts(running.instance);
            all.ends.insert(running.instance, end);
        }
        all.look_throughout();
        all
    }

    /// Returns P(A).
    pub(crate) fn actions_probability(&self) -> f64 {
        self.possible.iter().map(|(_, weight)| weight).sum()
    }

    /// Returns P(A ∩ G).
    pub(crate) fn success_probability(&self) -> f64 {
        let goal = self.task.goal();
        let worlds = self.possible.iter();
        worlds
            .filter(|(world, _)| self.holds(goal, world))
            .map(|(_, weight)| weight)
            .sum()
    }

    pub(crate) fn running(&self) -> &[InstanceId] {
        &self.running
    }

    fn lasts(&self, id: InstanceId) -> f64 {
        self.plan.duration(id).0.to_f64()
    }

    /// Advances the time to the happening, which is as early as possible.
    fn pass(&mut self, node: NodeId) {
        let due = match self.plan.nodes[node.index()] {
            Node::End(id) => self.ends[&id],
            Node::Timed(index) => self.task.timed()[index].time.to_f64(),
            _ => self.now,
        };
        let seconds = (due - self.now).max(0.0);
        self.now += seconds;
        if seconds == 0.0 {
            return;
        }
        let mut held = Vec::new();
        for &id in &self.running {
            let failures = self.failing(id).during_per_second.unwrap_or(0.0);
            for (_, weight) in &mut self.possible {
                *weight *= (-failures * seconds).exp();
            }
            if let Body::Durative(body) = &self.plan.instance(id).action.body {
                self.literals(&body.over_all, &mut held);
            }
        }
        for index in 0..self.task.fact_count() {
            let fact = FactId(u32::try_from(index).unwrap());
            if self.task.is_derived(fact) {
                continue;
            }
            let rate = self.likelihoods.rate(self.task, fact);
            let sum = rate.becomes_true + rate.becomes_false;
            let mut after = BTreeMap::new();
            for (world, weight) in std::mem::take(&mut self.possible) {
                let truth = world.facts[index];
                let (away, back) = if truth {
                    (rate.becomes_false, rate.becomes_true)
                } else {
                    (rate.becomes_true, rate.becomes_false)
                };
                if held.contains(&(fact, truth)) {
                    // The fact must not change, not even temporarily.
                    *after.entry(world).or_insert(0.0) += weight * (-away * seconds).exp();
                    continue;
                }
                let stays = if sum > 0.0 {
                    (back + away * (-sum * seconds).exp()) / sum
                } else {
                    1.0
                };
                let mut other = world.clone();
                other.facts[index] = !truth;
                *after.entry(world).or_insert(0.0) += weight * stays;
                *after.entry(other).or_insert(0.0) += weight * (1.0 - stays);
            }
            self.possible = after
                .into_iter()
                .filter(|(_, weight)| *weight > 0.0)
                .collect();
        }
        self.look_throughout();
    }

    /// Collects the literals of a condition.
    fn literals(&self, condition: &Condition, all: &mut Vec<(FactId, bool)>) {
        match condition {
            Condition::And(parts) => parts.iter().for_each(|part| self.literals(part, all)),
            Condition::Fact(fact) if !self.task.is_derived(*fact) => all.push((*fact, true)),
            Condition::Not(part) => match &**part {
                Condition::Fact(fact) if !self.task.is_derived(*fact) => all.push((*fact, false)),
                _ => {}
            },
            _ => {}
        }
    }

    pub(crate) fn push(&mut self, node: NodeId) {
        self.push_as(node, (false, false));
    }

    /// Adds a happening that may come at the same moment as the previous one or the next one. No
    /// over-all condition is required in between.
    pub(crate) fn push_as(&mut self, node: NodeId, (is_joined, is_open): (bool, bool)) {
        if !is_joined {
            self.pass(node);
        }
        self.push_open(node);
        if !is_open {
            self.look_throughout();
        }
    }

    /// Returns `true` if all over-all conditions of running actions hold in all worlds.
    pub(crate) fn is_settled(&self) -> bool {
        let mut other = self.clone();
        other.look_throughout();
        other.possible == self.possible
    }

    /// Returns `true` if the over-all conditions of running actions hold in no world.
    pub(crate) fn is_broken(&self) -> bool {
        let mut other = self.clone();
        other.look_throughout();
        other.actions_probability() == 0.0
    }

    fn push_open(&mut self, node: NodeId) {
        match self.plan.nodes[node.index()] {
            Node::Zero => {}
            Node::Timed(index) => {
                for change in &self.task.timed()[index].changes {
                    for (world, _) in &mut self.possible {
                        match change {
                            Change::Add(fact) => world.facts[fact.index()] = true,
                            Change::Delete(fact) => world.facts[fact.index()] = false,
                            Change::Update { .. } => {}
                        }
                    }
                }
            }
            Node::Instant(id) | Node::Start(id) => {
                let action = &self.plan.instance(id).action;
                let success = self.likelihoods.start(action).unwrap();
                match &action.body {
                    Body::Instantaneous(snap) => self.do_snap(id, snap, success, &[]),
                    Body::Durative(body) => {
                        self.do_snap(id, &body.start, success, &body.end.effects);
                        self.running.push(id);
                        let end = self.now + self.lasts(id);
                        self.ends.insert(id, end);
                    }
                }
            }
            Node::End(id) => {
                if let Body::Durative(body) = &self.plan.instance(id).action.body {
                    let success = self.failing(id).end.unwrap_or(1.0);
                    self.do_snap(id, &body.end, success, &[]);
                }
                self.is_over(id);
            }
        }
    }

    fn failing(&self, id: InstanceId) -> FailureModel {
        let action = &self.plan.instance(id).action;
        let key = (action.schema, action.arguments.clone());
        let own = self.likelihoods.actions.get(&key);
        let success = own.or(self.likelihoods.schemas.get(&action.schema));
        success.map_or_else(FailureModel::default, |success| success.failing.clone())
    }

    /// Removes a running action.
    fn is_over(&mut self, id: InstanceId) {
        self.running.retain(|running| *running != id);
        for (world, _) in &mut self.possible {
            world.memories.retain(|(owner, _), _| *owner != id);
        }
    }

    /// Applies a failed end whose conditions hold; it is not pushed. Numbers only change if the end
    /// takes place.
    fn fail_at_end(&mut self, node: NodeId, id: InstanceId) {
        self.pass(node);
        let Body::Durative(body) = &self.plan.instance(id).action.body else {
            panic!("it has an end");
        };
        let failing = self.failing(id);
        assert_eq!(failing.outcomes, None, "one way in which things stand then");
        let mut left = Vec::new();
        if failing.undone == Some(true) {
            for effect in &body.start.effects {
                let is_added = |fact| {
                    let mut all = body.start.effects.iter();
                    all.any(|other| other.change == Change::Add(fact))
                };
                match effect.change {
                    _ if !effect.guard.is_trivial() => {}
                    Change::Add(fact) => left.push((fact, false)),
                    Change::Delete(fact) if !is_added(fact) => left.push((fact, true)),
                    Change::Delete(_) | Change::Update { .. } => {}
                }
            }
        }
        let mut after = BTreeMap::new();
        for (world, weight) in std::mem::take(&mut self.possible) {
            if !self.holds(&body.end.condition, &world) {
                continue;
            }
            let weight = weight * (1.0 - failing.end.unwrap_or(1.0));
            let mut worlds = vec![(world.clone(), weight)];
            for index in 0..self.task.fact_count() {
                let fact = FactId(u32::try_from(index).unwrap());
                if self.task.is_derived(fact) {
                    continue;
                }
                let set = left.iter().rev().find(|(own, _)| *own == fact);
                let was = set.map_or(world.facts[index], |(_, truth)| *truth);
                let flip = self
                    .likelihoods
                    .spontaneous_change(self.task, fact)
                    .unwrap();
                let p = f64::from(u8::from(was));
                // A set fact has an effect: in the paper's network it does not also change by
                // itself.
                let stays = set.is_some() && self.semantics == Semantics::Paper;
                let p = if stays { p } else { flip.after(p) };
                worlds = worlds
                    .into_iter()
                    .flat_map(|(world, weight)| {
                        [(true, p), (false, 1.0 - p)].map(|(truth, p)| {
                            let mut world = world.clone();
                            world.facts[index] = truth;
                            (world, weight * p)
                        })
                    })
                    .filter(|(_, weight)| *weight > 0.0)
                    .collect();
            }
            for (world, weight) in worlds {
                *after.entry(world).or_insert(0.0) += weight;
            }
        }
        self.possible = after.into_iter().collect();
        self.is_over(id);
        self.look_throughout();
    }

    /// Applies a failed start or end whose conditions hold; it is not pushed.
    pub(crate) fn fail(&mut self, node: NodeId) {
        if let Node::End(id) = self.plan.nodes[node.index()] {
            return self.fail_at_end(node, id);
        }
        let (Node::Instant(id) | Node::Start(id)) = self.plan.nodes[node.index()] else {
            panic!("only what somebody does fails");
        };
        let action = &self.plan.instance(id).action;
        let failure = 1.0 - self.likelihoods.start(action).unwrap();
        let snap = match &action.body {
            Body::Instantaneous(snap) => snap.clone(),
            Body::Durative(body) => SnapAction::clone(&body.start),
        };
        let nothing = SnapAction {
            condition: snap.condition,
            effects: Vec::new(),
        };
        self.do_snap(id, &nothing, failure, &[]);
        self.look_throughout();
    }

    fn do_snap(&mut self, id: InstanceId, snap: &SnapAction, success: f64, to_come: &[Effect]) {
        let arrived = std::mem::take(&mut self.possible);
        let mut after = BTreeMap::new();
        for (world, weight) in arrived {
            if !self.holds(&snap.condition, &world) {
                continue;
            }
            for (mut next, weight) in self.outcomes(id, snap, &world, weight * success) {
                for (place, effect) in to_come.iter().enumerate() {
                    if has_memory(effect) {
                        let remembered = self.holds(&effect.guard.at_start, &world);
                        next.memories.insert((id, place), remembered);
                    }
                }
                *after.entry(next).or_insert(0.0) += weight;
            }
        }
        self.possible = after.into_iter().collect();
        let arrival = self.values.clone();
        for effect in &snap.effects {
            if let Change::Update {
                operator,
                fluent,
                value,
            } = &effect.change
            {
                let amount = value.evaluate(&mut |leaf| number(leaf, &arrival)).unwrap();
                let old = self.values[fluent].clone();
                let new = match operator {
                    UpdateOperator::Assign => amount,
                    UpdateOperator::Increase => old + amount,
                    UpdateOperator::Decrease => old - amount,
                    _ => unreachable!("not drawn"),
                };
                self.values.insert(*fluent, new);
            }
        }
    }

    /// Returns the worlds after a snap action, with its effects and spontaneous changes.
    fn outcomes(
        &self,
        id: InstanceId,
        snap: &SnapAction,
        world: &World,
        weight: f64,
    ) -> Vec<(World, f64)> {
        let action = &self.plan.instance(id).action;
        let mut outcomes = vec![(world.clone(), weight)];
        for index in 0..self.task.fact_count() {
            let fact = FactId(u32::try_from(index).unwrap());
            if self.task.is_derived(fact) {
                continue;
            }
            let mut adds: Vec<f64> = Vec::new();
            let mut deletes: Vec<f64> = Vec::new();
            let mut seen: Vec<&Effect> = Vec::new();
            for (place, effect) in snap.effects.iter().enumerate() {
                let remembered = world.memories.get(&(id, place)).copied().unwrap_or(true);
                let is_repeated = seen.contains(&effect);
                if is_repeated || !remembered || !self.holds(&effect.guard.now, world) {
                    continue;
                }
                seen.push(effect);
                let chance = |makes_true| {
                    let chance = self.likelihoods.effect(self.task, action, fact, makes_true);
                    chance.unwrap()
                };
                match effect.change {
                    Change::Add(own) if own == fact => adds.push(chance(true)),
                    Change::Delete(own) if own == fact => deletes.push(chance(false)),
                    _ => {}
                }
            }
            let was = f64::from(u8::from(world.facts[index]));
            let flip = self
                .likelihoods
                .spontaneous_change(self.task, fact)
                .unwrap();
            let p = self.chance(was, &adds, &deletes, flip);
            outcomes = outcomes
                .into_iter()
                .flat_map(|(world, weight)| {
                    [(true, p), (false, 1.0 - p)].map(|(truth, p)| {
                        let mut world = world.clone();
                        world.facts[index] = truth;
                        (world, weight * p)
                    })
                })
                .filter(|(_, weight)| *weight > 0.0)
                .collect();
        }
        outcomes
    }

    /// Returns P(true afterwards) of a fact that was true with probability 0 or 1.
    fn chance(&self, was: f64, adds: &[f64], deletes: &[f64], flip: SpontaneousChange) -> f64 {
        let none = |of: &[f64]| of.iter().map(|p| 1.0 - p).product::<f64>();
        match self.semantics {
            Semantics::Paper => match (adds, deletes) {
                ([], []) => flip.after(was),
                (_, []) => 1.0 - none(adds),
                ([], _) => none(deletes),
                _ => (1.0 - none(adds)) + none(adds) * none(deletes),
            },
            Semantics::World => {
                let kept = was * none(deletes);
                let reached = kept + (1.0 - kept) * (1.0 - none(adds));
                flip.after(reached)
            }
        }
    }

    /// Applies over-all conditions, and updates end effects that depend on them.
    fn look_throughout(&mut self) {
        let mut worlds = std::mem::take(&mut self.possible);
        for &id in &self.running {
            let Body::Durative(body) = &self.plan.instance(id).action.body else {
                continue;
            };
            worlds.retain(|(world, _)| self.holds(&body.over_all, world));
            for (place, effect) in body.end.effects.iter().enumerate() {
                if has_memory(effect) {
                    for (world, _) in &mut worlds {
                        let held = self.holds(&effect.guard.over_all, world);
                        if let Some(memory) = world.memories.get_mut(&(id, place)) {
                            *memory &= held;
                        }
                    }
                }
            }
        }
        self.possible = worlds;
    }

    fn holds(&self, condition: &Condition, world: &World) -> bool {
        match condition {
            Condition::Fact(fact) if self.task.is_derived(*fact) => {
                // The rules of these tests do not depend on each other.
                let rules = self.task.rules();
                let mut rules = rules.of(*fact).iter();
                rules.any(|rule| self.holds(&rule.body, world))
            }
            Condition::Fact(fact) => world.facts[fact.index()],
            Condition::Compare(comparison, left, right) => {
                let value = |side: &Expression| {
                    side.evaluate(&mut |leaf| number(leaf, &self.values))
                        .unwrap()
                };
                comparison.holds(&value(left), &value(right))
            }
            Condition::Not(part) => !self.holds(part, world),
            Condition::And(parts) => parts.iter().all(|part| self.holds(part, world)),
            Condition::Or(parts) => parts.iter().any(|part| self.holds(part, world)),
        }
    }
}

fn end_effects(plan: &PartialOrderPlan, id: InstanceId) -> &[Effect] {
    match &plan.instance(id).action.body {
        Body::Durative(body) => &body.end.effects,
        Body::Instantaneous(_) => &[],
    }
}

fn has_memory(effect: &Effect) -> bool {
    !effect.guard.at_start.is_trivial() || !effect.guard.over_all.is_trivial()
}

fn number(leaf: &Expression, values: &BTreeMap<FluentId, Rational>) -> Option<Rational> {
    match leaf {
        Expression::Fluent(fluent) => values.get(fluent).cloned(),
        _ => None,
    }
}
