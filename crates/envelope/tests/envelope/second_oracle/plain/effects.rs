//! Changes made by a group of happenings.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Change, Condition, Effect, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_plan::Node;

use super::GaveUp;
use super::search::{Context, Running, Search, Step, Trouble, World};
use super::truth::Want;
use crate::second_oracle::polynomial::Polynomial;

/// Part of an effect's guard.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Part {
    Now,
    EndEffect,
    Continuous,
}

pub(super) type GuardKey = (usize, Part, usize);

pub(super) struct Guard<'a> {
    pub(super) key: GuardKey,
    pub(super) condition: &'a Condition,
    pub(super) duration: Option<Polynomial>,
}

impl<'a> Search<'a> {
    /// Returns the guards read at a node.
    pub(super) fn guards(&self, world: &World, node: usize) -> Result<Vec<Guard<'a>>, Trouble> {
        let mut guards = Vec::new();
        let duration = self.context(world, node).duration;
        let mut read = |part: Part, index: usize, condition: &'a Condition| {
            guards.push(Guard {
                key: (node, part, index),
                condition,
                duration: duration.clone(),
            });
        };
        let now = |effects: &'a [Effect]| effects.iter().map(|effect| &effect.guard.now);
        match self.node(node) {
            Node::Zero | Node::Timed(_) => {}
            Node::Instant(id) => {
                for (index, guard) in now(&self.snap(id).effects).enumerate() {
                    read(Part::Now, index, guard);
                }
            }
            Node::Start(id) => {
                let body = self.durative(id);
                let ends = body.end.effects.iter().map(|effect| &effect.guard);
                let all = ends.chain(body.continuous.iter().map(|effect| &effect.guard));
                if all.into_iter().any(|guard| !guard.over_all.is_trivial()) {
                    return Err(Trouble::GaveUp(GaveUp::NotCovered));
                }
                for (index, guard) in now(&body.start.effects).enumerate() {
                    read(Part::Now, index, guard);
                }
                for (index, effect) in body.end.effects.iter().enumerate() {
                    read(Part::EndEffect, index, &effect.guard.at_start);
                }
                for (index, effect) in body.continuous.iter().enumerate() {
                    read(Part::Continuous, index, &effect.guard.at_start);
                }
            }
            Node::End(id) => {
                let running = world.running.get(&id);
                for (index, guard) in now(&self.durative(id).end.effects).enumerate() {
                    if running.is_none_or(|running| running.end_guards[index]) {
                        read(Part::Now, index, guard);
                    }
                }
            }
        }
        Ok(guards)
    }

    /// Continues with each combination of the guards' outcomes.
    pub(super) fn decide(
        &mut self,
        world: &World,
        group: &[usize],
        guards: &[Guard<'_>],
        outcomes: &mut BTreeMap<GuardKey, bool>,
    ) -> Step {
        if self.found.is_some() {
            return Ok(());
        }
        let Some((guard, rest)) = guards.split_first() else {
            return self.apply(world.clone(), group, outcomes);
        };
        let context = Context {
            facts: world.facts.clone(),
            values: world.values.clone(),
            duration: guard.duration.clone(),
        };
        if mentions_undefined(guard.condition, &context) {
            return Err(Trouble::GaveUp(GaveUp::NotCovered));
        }
        for (want, outcome) in [(Want::True, true), (Want::False, false)] {
            self.ways(vec![(guard.condition, want)], &context, &mut |search| {
                outcomes.insert(guard.key, outcome);
                search.decide(world, group, rest, outcomes)?;
                outcomes.remove(&guard.key);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Applies the group's effects and continues with the next group, or checks the goal.
    fn apply(
        &mut self,
        mut world: World,
        group: &[usize],
        outcomes: &BTreeMap<GuardKey, bool>,
    ) -> Step {
        let (mut deletes, mut adds) = (Vec::new(), Vec::new());
        let mut updates: BTreeMap<FluentId, Vec<(UpdateOperator, Polynomial)>> = BTreeMap::new();
        for &node in group {
            let context = self.context(&world, node);
            for change in self.changes(node, outcomes) {
                match change {
                    Change::Add(fact) => adds.push(*fact),
                    Change::Delete(fact) => deletes.push(*fact),
                    Change::Update {
                        operator,
                        fluent,
                        value,
                    } => {
                        let value = self.value(value, &context)?;
                        let is_defined = *operator == UpdateOperator::Assign
                            || world.values[fluent.index()].is_some();
                        let (Some(value), true) = (value, is_defined) else {
                            self.report(format!("an effect of {:?} undefined", self.node(node)));
                            return Ok(());
                        };
                        updates.entry(*fluent).or_default().push((*operator, value));
                    }
                }
            }
        }
        for (fluent, updates) in updates {
            if updates.len() > 1 && updates.iter().any(|(operator, _)| !operator.is_additive()) {
                self.report("updates in conflict".to_owned());
                return Ok(());
            }
            for (operator, amount) in updates {
                let old = world.values[fluent.index()].take().unwrap_or_default();
                world.values[fluent.index()] = Some(match operator {
                    UpdateOperator::Assign => amount,
                    UpdateOperator::Increase => old.plus(&amount),
                    UpdateOperator::Decrease => old.minus(&amount),
                    UpdateOperator::ScaleUp => old.times(&amount),
                    UpdateOperator::ScaleDown => {
                        let divisor = amount.as_constant();
                        let divisor = divisor.ok_or(Trouble::GaveUp(GaveUp::NotCovered))?;
                        let Some(factor) = divisor.reciprocal() else {
                            self.report("division by zero".to_owned());
                            return Ok(());
                        };
                        old.times(&Polynomial::constant(&factor))
                    }
                });
            }
        }
        for fact in deletes {
            world.facts[fact.index()] = false;
        }
        for fact in adds {
            world.facts[fact.index()] = true;
        }
        self.start_and_stop(&mut world, group, outcomes);
        world.placed.extend(group);
        world.remaining.retain(|node| !group.contains(node));
        world.last = group.to_vec();
        if world.remaining.is_empty() {
            let context = Context {
                facts: world.facts.clone(),
                values: world.values.clone(),
                duration: None,
            };
            let goal = &self.plan.goal;
            return self.require(goal, &context, "goal");
        }
        self.next_groups(&world, &mut Vec::new(), 0)
    }

    fn start_and_stop(
        &self,
        world: &mut World,
        group: &[usize],
        outcomes: &BTreeMap<GuardKey, bool>,
    ) {
        for &node in group {
            if let Node::Start(id) = self.node(node) {
                let body = self.durative(id);
                let outcome = |part: Part, index: usize| outcomes[&(node, part, index)];
                let running = Running {
                    is_new: true,
                    end_guards: (0..body.end.effects.len())
                        .map(|index| outcome(Part::EndEffect, index))
                        .collect(),
                    continuous: (0..body.continuous.len())
                        .map(|index| outcome(Part::Continuous, index))
                        .collect(),
                };
                world.running.insert(id, running);
            }
        }
        for &node in group {
            if let Node::End(id) = self.node(node) {
                world.running.remove(&id);
            }
        }
    }

    /// Returns the changes of a node.
    fn changes(&self, node: usize, outcomes: &BTreeMap<GuardKey, bool>) -> Vec<&'a Change> {
        let effects = match self.node(node) {
            Node::Zero => return Vec::new(),
            Node::Timed(group) => return self.task.timed()[group].changes.iter().collect(),
            Node::Instant(id) => &self.snap(id).effects,
            Node::Start(id) => &self.durative(id).start.effects,
            Node::End(id) => &self.durative(id).end.effects,
        };
        // For an action with duration 0, the guards read at the start are in the same group.
        let is_off = |index: usize| match self.node(node) {
            Node::End(id) => {
                let start = self.plan.plan.start(id).index();
                outcomes.get(&(start, Part::EndEffect, index)) == Some(&false)
            }
            _ => false,
        };
        let happens =
            |index: usize| outcomes.get(&(node, Part::Now, index)) == Some(&true) && !is_off(index);
        let effects = effects.iter().enumerate();
        effects
            .filter(|(index, _)| happens(*index))
            .map(|(_, effect)| &effect.change)
            .collect()
    }
}

fn mentions_undefined(condition: &Condition, context: &Context) -> bool {
    let mut found = false;
    condition.visit_fluents(&mut |fluent| found |= context.values[fluent.index()].is_none());
    found
}
