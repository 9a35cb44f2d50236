//! Fluents without a value that can be the reason why no plan exists.

use std::collections::BTreeSet;

use elbowroom_model::Footprint;
use elbowroom_model::ground::{Action, Body, Condition, FactId, FluentId, SnapAction};

use super::earliest_times::ConditionContext;
use super::{Instances, ReachedFacts};

impl Instances {
    /// Returns the names of the fluents without a value that can be the reason why no plan exists. These
    /// instances assume values for them and reach `reached`; without assumed values, `stated` is reached.
    ///
    /// If the goal reads such fluents, they are the result. Otherwise the result is empty if values would
    /// not bring the goal within reach. A fluent counts if an instance reads it that contributes to a part
    /// of the goal that is out of reach, or to any part if the whole goal is within reach of `stated`.
    pub fn fluents_without_value(
        &self,
        reached: &ReachedFacts,
        stated: &ReachedFacts,
    ) -> Vec<String> {
        let goal = self.task.goal();
        let mut found = BTreeSet::new();
        self.static_facts
            .mentioned_by_condition(&self.task, goal, &mut found);
        if found.is_empty() && self.is_goal_in_reach(reached) {
            let is_open = !self.is_goal_in_reach(stated);
            let mut relevance = Relevance {
                instances: self,
                reached,
                listed: is_open.then_some(stated),
                facts: BTreeSet::new(),
                absences: BTreeSet::new(),
                fluents: BTreeSet::new(),
            };
            relevance.add_condition(goal);
            for action in relevance.contributors() {
                self.static_facts
                    .mentioned_by_action(&self.task, action, &mut found);
            }
        }
        let names = found.into_iter();
        names.map(|own| self.task.fluent_name(own)).collect()
    }
}

/// Facts and fluents that the goal depends on, found backwards from it.
struct Relevance<'a> {
    instances: &'a Instances,
    /// Facts that are within reach with assumed values.
    reached: &'a ReachedFacts,
    /// If present, only facts that are not listed here are needed: the others are within reach anyway.
    listed: Option<&'a ReachedFacts>,
    /// Facts that conditions mention.
    facts: BTreeSet<FactId>,
    /// Facts that negative conditions mention.
    absences: BTreeSet<FactId>,
    /// Fluents that are read.
    fluents: BTreeSet<FluentId>,
}

impl<'a> Relevance<'a> {
    /// Returns the instances that contribute to the needed facts and fluents, directly or through others.
    fn contributors(&mut self) -> Vec<&'a Action> {
        let task = &self.instances.task;
        let mut others: Vec<(&Action, Footprint)> = Vec::new();
        for action in self
            .instances
            .actions
            .iter()
            .filter(|own| self.can_end(own))
        {
            let mut footprint = Footprint::of_start(task, action);
            footprint.include(Footprint::of_end(task, action));
            others.push((action, without_restored(action, footprint)));
        }
        let mut contributors = Vec::new();
        loop {
            let (found, rest): (Vec<_>, Vec<_>) = others
                .into_iter()
                .partition(|own| self.is_served_by(&own.1));
            if found.is_empty() {
                return contributors;
            }
            for (action, footprint) in found {
                self.add_action(action);
                if self.listed.is_none() {
                    self.fluents.extend(footprint.reads_fluents);
                }
                contributors.push(action);
            }
            others = rest;
        }
    }

    /// Returns `true` unless the over-all condition can never hold. Some domains forbid a move from a place to itself
    /// in that way. The duration is assumed to be positive, so this does not exclude that a plan contains the action.
    fn can_end(&self, action: &Action) -> bool {
        let Body::Durative(body) = &action.body else {
            return true;
        };
        let times = self.instances.earliest_times(self.reached);
        let now = &self.instances.initial.now;
        times
            .next(&body.over_all, now, ConditionContext::All)
            .is_some()
    }

    /// Returns `true` if some needed fact or fluent is changed.
    fn is_served_by(&self, footprint: &Footprint) -> bool {
        !footprint.adds.is_disjoint(&self.facts)
            || !footprint.deletes.is_disjoint(&self.absences)
            || !footprint.shifts.is_disjoint(&self.fluents)
            || !footprint.assigns.is_disjoint(&self.fluents)
    }

    /// Adds the conditions of an action and of its effects.
    fn add_action(&mut self, action: &Action) {
        let mut need_snap = |snap: &SnapAction| {
            self.add_condition(&snap.condition);
            for effect in &snap.effects {
                let guard = &effect.guard;
                for condition in [&guard.at_start, &guard.over_all, &guard.now] {
                    self.add_condition(condition);
                }
            }
        };
        match &action.body {
            Body::Instantaneous(snap) => need_snap(snap),
            Body::Durative(body) => {
                need_snap(&body.start);
                need_snap(&body.end);
                self.add_condition(&body.over_all);
            }
        }
    }

    /// Adds the facts and fluents that a condition mentions.
    fn add_condition(&mut self, condition: &Condition) {
        let task = &self.instances.task;
        let is_open = |fact: FactId| {
            let fact = task.atom(fact);
            let is_fixed = self.instances.static_facts.spans(&fact).is_some();
            let is_stated = |stated: &ReachedFacts| stated.contains_key(&fact);
            !is_fixed && !self.listed.is_some_and(is_stated)
        };
        match condition {
            Condition::And(parts) | Condition::Or(parts) => {
                for part in parts {
                    self.add_condition(part);
                }
            }
            Condition::Fact(fact) if !task.is_derived(*fact) => {
                if is_open(*fact) {
                    self.facts.insert(*fact);
                }
            }
            // Comparisons and negations are within reach if nothing is lost. Rules may negate facts.
            _ => {
                let mut mentioned = Vec::new();
                task.visit_facts_of(condition, &mut |fact| mentioned.push(fact));
                mentioned.retain(|fact| is_open(*fact));
                self.facts.extend(&mentioned);
                if self.listed.is_none() {
                    self.absences.extend(mentioned);
                    let fluents = &mut self.fluents;
                    task.visit_fluents_of(condition, &mut |fluent| {
                        fluents.insert(fluent);
                    });
                }
            }
        }
    }
}

/// Leaves out the facts that the action only restores: it adds them, and starts where they are true.
fn without_restored(action: &Action, mut footprint: Footprint) -> Footprint {
    let condition = match &action.body {
        Body::Instantaneous(snap) => &snap.condition,
        Body::Durative(body) => &body.start.condition,
    };
    for part in condition.conjuncts() {
        if let Condition::Fact(fact) = part
            && footprint.adds.remove(fact)
        {
            footprint.deletes.remove(fact);
        }
    }
    footprint
}
