//! Compiles a task and a world file to facts as bits, actions and events.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, Effect, Expression, FactId, FluentId, SnapAction,
};
use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;
use elbowroom_sim::{Distribution, ExogenousChange, FailureTime, WorldModel};

use super::action_model::{ActionModel, Event, Facts, Needs, Occurs, Snap};
use super::applicable::facts_changed_by_failures;
use super::value_intervals::{Amount, ChangeOperator, ChangeValue, Number, Test, units};
use crate::settings::NotTabulated;

/// Returns the facts and numbers that the goal depends on, through all actions and their failures.
fn relevant(
    task: &Task,
    model: &WorldModel,
    actions: &[Action],
    goal: &Condition,
) -> (BTreeSet<FactId>, BTreeSet<FluentId>) {
    let left: Vec<Vec<FactId>> = actions
        .iter()
        .map(|action| {
            let left = facts_changed_by_failures(task, model, &action.name);
            left.into_iter().map(|(fact, _)| fact).collect()
        })
        .collect();
    let (mut facts, mut numbers) = (BTreeSet::new(), BTreeSet::new());
    collect_reads(goal, &mut facts, &mut numbers);
    loop {
        let before = facts.len() + numbers.len();
        for (action, left) in actions.iter().zip(&left) {
            let snaps = snaps(action);
            let mut effects = snaps.iter().flat_map(|snap| &snap.effects);
            let matters = effects.any(|effect| match &effect.change {
                Change::Add(fact) | Change::Delete(fact) => facts.contains(fact),
                Change::Update { fluent, .. } => numbers.contains(fluent),
            });
            if matters || left.iter().any(|fact| facts.contains(fact)) {
                for snap in snaps {
                    collect_reads(&snap.condition, &mut facts, &mut numbers);
                }
                if let Some(body) = action.durative() {
                    collect_reads(&body.over_all, &mut facts, &mut numbers);
                }
            }
        }
        if facts.len() + numbers.len() == before {
            return (facts, numbers);
        }
    }
}

/// Adds the facts and fluents that a condition reads.
fn collect_reads(
    condition: &Condition,
    facts: &mut BTreeSet<FactId>,
    numbers: &mut BTreeSet<FluentId>,
) {
    condition.visit_facts(&mut |fact| {
        facts.insert(fact);
    });
    condition.visit_fluents(&mut |fluent| {
        numbers.insert(fluent);
    });
}

/// Returns the numbers that actions change.
fn changing(actions: &[Action]) -> BTreeSet<FluentId> {
    let snaps = actions.iter().flat_map(snaps);
    let effects = snaps.flat_map(|snap| &snap.effects);
    let changing = effects.filter_map(|effect| match &effect.change {
        Change::Update { fluent, .. } => Some(*fluent),
        Change::Add(_) | Change::Delete(_) => None,
    });
    changing.collect()
}

fn snaps(action: &Action) -> Vec<&SnapAction> {
    match &action.body {
        Body::Instantaneous(snap) => vec![snap],
        Body::Durative(body) => vec![&body.start, &body.end],
    }
}

/// A task, with bits for its relevant facts.
pub(crate) struct Compiler<'t> {
    pub(crate) task: &'t Task,
    model: &'t WorldModel,
    /// The relevant facts, sorted.
    pub(crate) facts: Vec<FactId>,
    /// The relevant numbers that change, sorted by fluent.
    pub(crate) numbers: Vec<Number>,
    /// All numbers that change.
    changing: BTreeSet<FluentId>,
    /// The comparisons found so far.
    pub(crate) tests: RefCell<Vec<Test>>,
}

impl<'t> Compiler<'t> {
    pub(crate) fn new(
        task: &'t Task,
        model: &'t WorldModel,
        actions: &[Action],
        goal: &Condition,
    ) -> Result<Self, NotTabulated> {
        let changing = changing(actions);
        let (facts, numbers) = relevant(task, model, actions, goal);
        let numbers = numbers.intersection(&changing).map(|fluent| {
            let value = task.initial().values.get(fluent);
            let initial = value.and_then(units).ok_or_else(|| {
                NotTabulated::new(format!(
                    "{} changes, and its initial value is missing or has more than six decimals",
                    task.fluent_name(*fluent)
                ))
            })?;
            Ok(Number::new(*fluent, initial))
        });
        let compiler = Self {
            task,
            model,
            facts: facts.into_iter().collect(),
            numbers: numbers.collect::<Result<_, _>>()?,
            changing,
            tests: RefCell::default(),
        };
        if compiler.facts.len() > 128 {
            return Err(NotTabulated::new(format!(
                "{} facts are relevant, more than the limit of 128",
                compiler.facts.len()
            )));
        }
        Ok(compiler)
    }
    /// Returns the bit of a fact; 0 if it is irrelevant.
    pub(crate) fn bit(&self, fact: FactId) -> Facts {
        self.facts
            .binary_search(&fact)
            .map_or(0, |place| 1 << place)
    }

    pub(crate) fn needs(&self, condition: &Condition) -> Result<Needs, NotTabulated> {
        let all = |parts: &[Condition]| -> Result<Vec<Needs>, NotTabulated> {
            parts.iter().map(|part| self.needs(part)).collect()
        };
        Ok(match condition {
            Condition::Fact(fact) => Needs::Fact(self.bit(*fact)),
            Condition::Not(part) => match &**part {
                Condition::Compare(comparison, left, right) => {
                    self.compare(*comparison, left, right, true)?
                }
                part => Needs::Not(Box::new(self.needs(part)?)),
            },
            Condition::And(parts) => Needs::All(all(parts)?),
            Condition::Or(parts) => Needs::Any(all(parts)?),
            Condition::Compare(comparison, left, right) => {
                self.compare(*comparison, left, right, false)?
            }
        })
    }

    /// Compiles a comparison of constants, or of a changing number with a constant.
    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
        is_negated: bool,
    ) -> Result<Needs, NotTabulated> {
        let (number, comparison, bound) = match (
            self.number(left),
            self.value(left),
            self.number(right),
            self.value(right),
        ) {
            (_, Some(left), _, Some(right)) => {
                let parts = Vec::new();
                return Ok(if comparison.holds(&left, &right) == is_negated {
                    Needs::Any(parts)
                } else {
                    Needs::All(parts)
                });
            }
            (Some(number), _, _, Some(bound)) => (number, comparison, bound),
            (_, Some(bound), Some(number), _) => (number, flipped(comparison), bound),
            _ => {
                return Err(NotTabulated::new(
                    "a condition is not a comparison of a changing number with a constant, or \
                     reads a number without a value",
                ));
            }
        };
        let bound = units(&bound).ok_or_else(too_fine)?;
        let test = Test::new(number, comparison, bound);
        let test = if is_negated { test.negated() } else { test };
        let mut tests = self.tests.borrow_mut();
        let place = tests.iter().position(|known| *known == test);
        let place = place.unwrap_or_else(|| {
            tests.push(test);
            tests.len() - 1
        });
        let bit = self.facts.len() + place;
        // The caller rejects worlds with more comparisons than bits.
        Ok(Needs::Fact(if bit < 128 { 1 << bit } else { 0 }))
    }

    /// Returns the position of a changing number.
    fn number(&self, expression: &Expression) -> Option<usize> {
        match expression {
            Expression::Fluent(fluent) => {
                let mut numbers = self.numbers.iter();
                numbers.position(|number| number.fluent == *fluent)
            }
            _ => None,
        }
    }

    /// Compiles an effect on a relevant number.
    fn amount(
        &self,
        name: &str,
        fluent: FluentId,
        operator: UpdateOperator,
        value: &Expression,
    ) -> Result<Option<Amount>, NotTabulated> {
        let refuse = |what: &str| Err(NotTabulated::new(format!("{name} has {what}")));
        let Some(number) = self.number(&Expression::Fluent(fluent)) else {
            return Ok(None);
        };
        let change = match operator {
            UpdateOperator::Assign => ChangeOperator::Set,
            UpdateOperator::Increase => ChangeOperator::Add,
            UpdateOperator::Decrease => ChangeOperator::Subtract,
            UpdateOperator::ScaleUp | UpdateOperator::ScaleDown => {
                return refuse("effects that scale numbers");
            }
        };
        let Some(planned) = self.value(value) else {
            return refuse("an amount that depends on changing numbers or on a duration");
        };
        let by = match self.model.amount(name, &self.task.fluent_name(fluent)) {
            Some(rule) => ChangeValue::Random {
                rule: rule.clone(),
                planned: planned.to_f64(),
            },
            None => ChangeValue::Constant(units(&planned).ok_or_else(too_fine)?),
        };
        if let ChangeValue::Random { rule, planned } = &by
            && rule.is_relative
            && *planned <= 0.0
        {
            return refuse("a random amount in proportion to a planned amount of 0 or less");
        }
        Ok(Some(Amount { number, change, by }))
    }

    fn value(&self, expression: &Expression) -> Option<Rational> {
        expression.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent) if self.changing.contains(fluent) => None,
            Expression::Fluent(fluent) => self.task.initial().values.get(fluent).cloned(),
            _ => None,
        })
    }

    fn snap(&self, snap: &SnapAction, name: &str) -> Result<Snap, NotTabulated> {
        let refuse = |what: &str| Err(NotTabulated::new(format!("{name} has {what}")));
        let (mut adds, mut deletes) = (0, 0);
        let mut amounts = Vec::new();
        for Effect { guard, change } in &snap.effects {
            if !guard.is_trivial() {
                return refuse("conditional effects");
            }
            match change {
                Change::Add(fact) => adds |= self.bit(*fact),
                Change::Delete(fact) => deletes |= self.bit(*fact),
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => amounts.extend(self.amount(name, *fluent, *operator, value)?),
            }
        }
        let mut changed: Vec<usize> = amounts.iter().map(|amount| amount.number).collect();
        changed.sort_unstable();
        changed.dedup();
        if changed.len() < amounts.len() {
            return refuse("several simultaneous effects on one number");
        }
        Ok(Snap {
            needs: self.needs(&snap.condition)?,
            adds,
            deletes,
            amounts,
            helped_tests: 0,
            draws: Vec::new(),
        })
    }

    /// Returns `true` if an action, or a failure of it, changes a relevant fact or number.
    fn is_relevant(&self, action: &Action) -> bool {
        let snaps = snaps(action).into_iter();
        let mut effects = snaps.flat_map(|snap| &snap.effects);
        let mut left = facts_changed_by_failures(self.task, self.model, &action.name).into_iter();
        let is_number = |fluent: &FluentId| {
            let mut numbers = self.numbers.iter();
            numbers.any(|number| number.fluent == *fluent)
        };
        effects.any(|effect| match &effect.change {
            Change::Add(fact) | Change::Delete(fact) => self.bit(*fact) != 0,
            Change::Update { fluent, .. } => is_number(fluent),
        }) || left.any(|(fact, _)| self.bit(fact) != 0)
    }

    /// Compiles an action; `None` if it is irrelevant, or never starts.
    pub(crate) fn act(
        &self,
        action: &Action,
        model: &WorldModel,
    ) -> Result<Option<ActionModel>, NotTabulated> {
        let name = &action.name;
        let refuse = |what: &str| Err(NotTabulated::new(format!("{name} has {what}")));
        if model.delay_rule(name).is_some() {
            return refuse("a delay");
        }
        if let Some(body) = action.durative()
            && !body.continuous.is_empty()
        {
            return refuse("continuous effects");
        }
        if !self.is_relevant(action) {
            return Ok(None);
        }
        let (start, rest, planned) = match &action.body {
            Body::Instantaneous(snap) => (self.snap(snap, name)?, None, Rational::ZERO),
            Body::Durative(body) => {
                let Some(planned) = self.duration(body) else {
                    return refuse("a duration that the plan chooses");
                };
                let rest = (self.needs(&body.over_all)?, self.snap(&body.end, name)?);
                (self.snap(&body.start, name)?, Some(rest), planned)
            }
        };
        if start.amounts.iter().any(Amount::is_drawn) {
            return refuse("a random amount at its start");
        }
        let failures = self.failures(name, model, &start, rest.is_some())?;
        let (mut midway, mut at_end) = (0.0, 0.0);
        if let Some(failing) = model.failure_rule(name) {
            let is_at_start = failing.when == FailureTime::AtStart || rest.is_none();
            match failing.when {
                _ if is_at_start && failing.probability >= 1.0 => return Ok(None),
                // The start can be retried at once until it succeeds.
                _ if is_at_start => {}
                FailureTime::Midway => midway = failing.probability,
                FailureTime::AtEnd | FailureTime::AtStart => at_end = failing.probability,
            }
        }
        Ok(Some(ActionModel {
            name: name.clone(),
            action: Arc::new(action.clone()),
            start,
            rest,
            planned,
            midway_failure: midway,
            end_failure: at_end,
            failures,
            may_be_cancelled: true,
            is_eager: false,
        }))
    }

    /// Returns the only duration that the domain allows.
    fn duration(&self, body: &DurativeBody) -> Option<Rational> {
        let [only] = body.duration.as_slice() else {
            return None;
        };
        if only.comparison != Comparison::Equal {
            return None;
        }
        self.value(&only.bound).filter(|value| !value.is_negative())
    }

    pub(crate) fn events(&self, model: &WorldModel) -> Result<Vec<Event>, NotTabulated> {
        let mut events = Vec::new();
        for exogenous in &model.exogenous {
            let ExogenousChange::Fact(name, truth) = &exogenous.change else {
                return Err(NotTabulated::new(
                    "the world has events that change numbers",
                ));
            };
            let bit = self.task.fact_named(name).map_or(0, |fact| self.bit(fact));
            events.push(Event {
                adds: if *truth { bit } else { 0 },
                deletes: if *truth { 0 } else { bit },
                occurs: Occurs::Once {
                    probability: exogenous.probability,
                    time: exogenous.time.clone(),
                },
            });
        }
        let goal = Footprint::of_condition(self.task, self.task.goal());
        for timed in self.task.timed() {
            if Footprint::of_timed(timed).writes_reads_of(&goal) {
                return Err(NotTabulated::new(
                    "a timed initial changes a fact or number of the goal, so the goal is not yet reached \
                     when it holds",
                ));
            }
            let (mut adds, mut deletes) = (0, 0);
            for change in &timed.changes {
                match change {
                    Change::Add(fact) => adds |= self.bit(*fact),
                    Change::Delete(fact) => deletes |= self.bit(*fact),
                    Change::Update { .. } => {
                        return Err(NotTabulated::new(
                            "the problem has timed initials on numbers",
                        ));
                    }
                }
            }
            events.push(Event {
                adds,
                deletes: deletes & !adds,
                occurs: Occurs::Once {
                    probability: 1.0,
                    time: Distribution::Constant(timed.time.to_f64()).into(),
                },
            });
        }
        for fact in &self.facts {
            let Some(hazard) = model.hazard(&self.task.fact_name(*fact)) else {
                continue;
            };
            let bit = self.bit(*fact);
            events.push(Event {
                adds: bit,
                deletes: 0,
                occurs: Occurs::Rate(hazard.becomes_true),
            });
            events.push(Event {
                adds: 0,
                deletes: bit,
                occurs: Occurs::Rate(hazard.becomes_false),
            });
        }
        let ever = |event: &Event| match event.occurs {
            Occurs::Once { probability, .. } => probability > 0.0,
            Occurs::Rate(rate) => rate > 0.0,
        };
        events.retain(|event| event.adds | event.deletes != 0 && ever(event));
        Ok(events)
    }
}

/// Returns the comparison with its sides exchanged.
fn flipped(comparison: Comparison) -> Comparison {
    match comparison {
        Comparison::Less => Comparison::Greater,
        Comparison::AtMost => Comparison::AtLeast,
        Comparison::Equal => Comparison::Equal,
        Comparison::AtLeast => Comparison::AtMost,
        Comparison::Greater => Comparison::Less,
    }
}

fn too_fine() -> NotTabulated {
    NotTabulated::new("a number has more than six decimals")
}
