//! Compilation of ground actions and likelihoods to a [`Model`].

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurationConstraint, DurativeBody, Effect, Expression, FactId,
    FluentId, SnapAction,
};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;
use elbowroom_plan::{Node, PartialOrderPlan};

use super::requirement::{Requirement, is_derived, visit_facts};
use super::{CompiledOutcome, Event, FactEffect, Model, Semantics, Update};
use crate::likelihoods::{Likelihoods, Missing, Rate, SpontaneousChange};

pub(super) fn model(
    task: Arc<Task>,
    plan: PartialOrderPlan,
    likelihoods: &Likelihoods,
    semantics: Semantics,
) -> Result<Model, Missing> {
    let mut facts = BTreeSet::new();
    let mut fluents = BTreeSet::new();
    for (_, instance) in plan.instances() {
        collect(&task, &instance.action, &mut facts, &mut fluents);
    }
    visit_facts(&task, task.goal(), &mut |fact| {
        facts.insert(fact);
    });
    for timed in task.timed() {
        for change in &timed.changes {
            match change {
                Change::Add(fact) | Change::Delete(fact) => {
                    facts.insert(*fact);
                }
                Change::Update { fluent, .. } => {
                    fluents.insert(*fluent);
                }
            }
        }
    }
    // A derived fact without rules is false, and has no likelihood.
    facts.retain(|fact| !is_derived(&task, *fact));
    let flips = facts
        .iter()
        .map(|&fact| likelihoods.spontaneous_change(&task, fact));
    let flips = flips.collect::<Result<_, _>>()?;
    let rates = facts.iter().map(|&fact| likelihoods.rate(&task, fact));
    let rates = rates.collect();
    let mut compiler = Compiler {
        task: &task,
        likelihoods,
        facts: facts.into_iter().collect(),
        spontaneous_changes: flips,
        rates,
        fluents: fluents.into_iter().collect(),
    };
    let mut events = vec![Event::default(); plan.nodes.len()];
    for (id, instance) in plan.instances() {
        let node = |is_it: &dyn Fn(Node) -> bool| plan.nodes.iter().position(|&node| is_it(node));
        let start = node(&|node| matches!(node, Node::Start(i) | Node::Instant(i) if i == id));
        let end = node(&|node| matches!(node, Node::End(i) if i == id));
        match (&instance.action.body, start, end) {
            (Body::Durative(body), Some(start), Some(end)) => {
                let (mut first, mut second) = compiler.durative(&instance.action, body)?;
                let bounds = compiler.bounds(body, plan.planned[id.index()].as_ref());
                for (at_end, bound) in bounds {
                    let event = if at_end { &mut second } else { &mut first };
                    event.condition.numeric.push(bound);
                }
                let (least, greatest) = plan.duration(id);
                if greatest.as_ref() == Some(&least) {
                    first.duration = Some(least.clone());
                    second.duration = Some(least);
                }
                events[start] = first;
                events[end] = second;
            }
            (Body::Instantaneous(snap), Some(at), _) => {
                events[at] = compiler.snap(&instance.action, snap)?;
                events[at].success = likelihoods.start(&instance.action)?;
            }
            _ => {}
        }
    }
    for (at, node) in plan.nodes.iter().enumerate() {
        if let Node::Timed(index) = node {
            events[at] = compiler.timed(&task.timed()[*index].changes);
        }
    }
    let goal = compiler.requirement(task.goal());
    let Compiler {
        facts,
        spontaneous_changes: flips,
        rates,
        fluents,
        ..
    } = compiler;
    Ok(Model {
        nodes_of: Model::nodes_of(&plan),
        task,
        plan,
        semantics,
        facts,
        spontaneous_changes: flips,
        has_rates: rates.iter().any(|rate| *rate != Rate::NEVER)
            || events.iter().any(|event| event.failures_per_second > 0.0),
        rates,
        fluents,
        events,
        goal,
    })
}

/// Collects the facts and fluents that an action reads and writes.
fn collect(
    task: &Task,
    action: &Action,
    facts: &mut BTreeSet<FactId>,
    fluents: &mut BTreeSet<FluentId>,
) {
    let read = |condition: &Condition, facts: &mut BTreeSet<FactId>| {
        visit_facts(task, condition, &mut |fact| {
            facts.insert(fact);
        });
    };
    let mut snap = |snap: &SnapAction, facts: &mut BTreeSet<FactId>| {
        read(&snap.condition, facts);
        for effect in &snap.effects {
            read(&effect.guard.at_start, facts);
            read(&effect.guard.over_all, facts);
            read(&effect.guard.now, facts);
            match &effect.change {
                Change::Add(fact) | Change::Delete(fact) => {
                    facts.insert(*fact);
                }
                Change::Update { fluent, .. } => {
                    fluents.insert(*fluent);
                }
            }
        }
    };
    match &action.body {
        Body::Instantaneous(only) => snap(only, facts),
        Body::Durative(body) => {
            snap(&body.start, facts);
            snap(&body.end, facts);
            visit_facts(task, &body.over_all, &mut |fact| {
                facts.insert(fact);
            });
            for effect in &body.continuous {
                fluents.insert(effect.fluent);
            }
        }
    }
}

struct Compiler<'a> {
    task: &'a Task,
    likelihoods: &'a Likelihoods,
    facts: Vec<FactId>,
    spontaneous_changes: Vec<SpontaneousChange>,
    rates: Vec<Rate>,
    fluents: Vec<FluentId>,
}

impl Compiler<'_> {
    fn position(&self, fact: FactId) -> usize {
        let found = self.facts.binary_search(&fact);
        found.expect("every fact of the plan was collected")
    }

    fn requirement(&self, condition: &Condition) -> Requirement {
        Requirement::of(self.task, condition, &|fact| self.position(fact))
    }

    /// Adds a fact of the model that remembers whether a guard held.
    fn add_memory(&mut self) -> FactId {
        let last = self.facts.last().map_or(0, |fact| fact.0 + 1);
        let memory = FactId(last.max(FactId::FIRST_FREE.0));
        self.facts.push(memory);
        self.spontaneous_changes.push(SpontaneousChange::NEVER);
        self.rates.push(Rate::NEVER);
        memory
    }

    fn snap(&mut self, action: &Action, snap: &SnapAction) -> Result<Event, Missing> {
        let mut event = Event {
            condition: self.requirement(&snap.condition),
            success: 1.0,
            is_step: true,
            ..Event::default()
        };
        for effect in &snap.effects {
            self.effect(action, effect, &mut event)?;
        }
        event.effects.sort_by_key(|effect| effect.fact);
        Ok(event)
    }

    fn durative(
        &mut self,
        action: &Action,
        body: &DurativeBody,
    ) -> Result<(Event, Event), Missing> {
        let mut start = self.snap(action, &body.start)?;
        start.success = self.likelihoods.start(action)?;
        start.over_all = self.requirement(&body.over_all);
        let mut ending = SnapAction::clone(&body.end);
        for effect in &mut ending.effects {
            self.remember_guard(effect, &mut start);
        }
        start.effects.sort_by_key(|effect| effect.fact);
        let mut end = self.snap(action, &ending)?;
        start.failures_per_second = self.likelihoods.failure_rate(action);
        end.success = self.likelihoods.end(action);
        if end.success < 1.0 || start.failures_per_second > 0.0 {
            end.failure_outcomes = self.failure_outcomes(action);
        }
        for effect in &body.continuous {
            let Some(fluent) = self.fluents.binary_search(&effect.fluent).ok() else {
                continue;
            };
            // The truth of its condition is not tracked, so the number becomes unknown.
            let rate = if effect.guard.is_trivial() {
                effect.rate.clone()
            } else {
                elbowroom_model::ground::Expression::TotalTime
            };
            start.continuous.push((fluent, rate.clone()));
            end.continuous.push((fluent, rate));
        }
        Ok((start, end))
    }

    /// Returns, as conditions, the bounds on a planned duration that read numbers which the plan
    /// changes; `true` marks those that are read at the end. The other bounds are in the plan's
    /// links.
    fn bounds(&self, body: &DurativeBody, planned: Option<&Rational>) -> Vec<(bool, Condition)> {
        // A running action has already started.
        let Some(planned) = planned.filter(|_| !body.is_running) else {
            return Vec::new();
        };
        let changes = |bound: &Expression| {
            let mut changes = false;
            bound.visit_fluents(&mut |fluent| {
                changes |= self.fluents.binary_search(&fluent).is_ok();
            });
            changes
        };
        let bounds = body.duration.iter().filter(|it| changes(&it.bound));
        let condition = |it: &DurationConstraint| {
            let planned = Expression::Constant(planned.clone());
            let bound = Condition::Compare(it.comparison, planned, it.bound.clone());
            (it.at_end, bound)
        };
        bounds.map(condition).collect()
    }

    /// Returns the outcomes of a failed end, without facts that nothing in the model reads or
    /// writes.
    fn failure_outcomes(&self, action: &Action) -> Vec<CompiledOutcome> {
        let aftermaths = self
            .likelihoods
            .failure_outcomes(self.task, action)
            .into_iter();
        let leftover = |aftermath: crate::likelihoods::FailureOutcome| {
            // The last of several changes of a fact counts.
            let mut changes = BTreeMap::new();
            for (fact, becomes) in aftermath.changes {
                if let Ok(position) = self.facts.binary_search(&fact) {
                    changes.insert(position, becomes);
                }
            }
            CompiledOutcome {
                probability: aftermath.probability,
                changes: changes.into_iter().collect(),
            }
        };
        aftermaths.map(leftover).collect()
    }

    /// Replaces the parts of a guard about start and interval by a memory that the start sets.
    fn remember_guard(&mut self, effect: &mut Effect, start: &mut Event) {
        let guard = &mut effect.guard;
        if guard.at_start.is_trivial() && guard.over_all.is_trivial() {
            return;
        }
        let memory = self.add_memory();
        let fact = self.position(memory);
        let at_start = std::mem::replace(&mut guard.at_start, Condition::TRUE);
        let over_all = std::mem::replace(&mut guard.over_all, Condition::TRUE);
        start.effects.push(FactEffect {
            fact,
            makes_true: true,
            probability: 1.0,
            guard: Some(at_start).filter(|guard| !guard.is_trivial()),
            is_certain: true,
        });
        if !over_all.is_trivial() {
            start.guard_memories.push((fact, over_all));
        }
        let now = std::mem::replace(&mut guard.now, Condition::TRUE);
        guard.now = Condition::And(vec![Condition::Fact(memory), now]);
    }

    /// Adds a change of a fluent, if the fluent is one of the model's.
    fn update(
        &self,
        event: &mut Event,
        (operator, fluent, value): (UpdateOperator, FluentId, &Expression),
        guard: Option<Condition>,
    ) {
        if let Ok(fluent) = self.fluents.binary_search(&fluent) {
            event.updates.push(Update {
                fluent,
                operator,
                value: value.clone(),
                guard,
            });
        }
    }

    fn effect(&self, action: &Action, effect: &Effect, event: &mut Event) -> Result<(), Missing> {
        let guard = Some(effect.guard.now.clone()).filter(|guard| !guard.is_trivial());
        let (fact, makes_true) = match &effect.change {
            Change::Add(fact) => (*fact, true),
            Change::Delete(fact) => (*fact, false),
            Change::Update {
                operator,
                fluent,
                value,
            } => {
                self.update(event, (*operator, *fluent, value), guard);
                return Ok(());
            }
        };
        let compiled = FactEffect {
            fact: self.position(fact),
            makes_true,
            probability: self
                .likelihoods
                .effect(self.task, action, fact, makes_true)?,
            guard,
            is_certain: false,
        };
        // An effect that is stated twice happens only once.
        let is_same = |other: &FactEffect| {
            other.fact == compiled.fact
                && other.makes_true == makes_true
                && other.guard == compiled.guard
        };
        if !event.effects.iter().any(is_same) {
            event.effects.push(compiled);
        }
        Ok(())
    }

    fn timed(&self, changes: &[Change]) -> Event {
        let mut event = Event {
            success: 1.0,
            ..Event::default()
        };
        for change in changes {
            match change {
                Change::Add(fact) | Change::Delete(fact) => event.effects.push(FactEffect {
                    fact: self.position(*fact),
                    makes_true: matches!(change, Change::Add(_)),
                    probability: 1.0,
                    guard: None,
                    is_certain: true,
                }),
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => {
                    self.update(&mut event, (*operator, *fluent, value), None);
                }
            }
        }
        event.effects.sort_by_key(|effect| effect.fact);
        event
    }
}
