//! From a task and a world file to facts as bits, actions and events.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, Effect, Expression, FactId, SnapAction,
};
use elbowroom_model::problem::{self, Comparison, TimedChange, TimedInitial};
use elbowroom_model::reachability::{self, Answer};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;
use elbowroom_sim::{Becoming, Distribution, ExogenousChange, Failure, WorldModel};

use super::world::{Act, Event, Facts, Needs, Occurs, Snap};
use super::{NotTabulated, Settings};

/// All actions that can start, whatever happens by itself, or those that are asked for. One that
/// can never end is in no plan, but what its start does may still be of use.
pub(super) fn actions(
    task: &Task,
    model: &WorldModel,
    settings: &Settings,
) -> Result<Vec<Action>, NotTabulated> {
    let mut problem = task.problem().clone();
    for event in &model.exogenous {
        if let ExogenousChange::Fact(name, truth) = &event.change
            && let Some(fact) = task.fact_named(name)
        {
            let (predicate, objects) = task.atom(fact);
            let change = if *truth {
                TimedChange::Add
            } else {
                TimedChange::Delete
            };
            problem.timed.push(TimedInitial {
                time: Rational::ONE,
                change: change(predicate, objects),
            });
        }
    }
    for (name, hazard) in model.hazardous(task.problem()) {
        let Some(fact) = task.fact_named(&name) else {
            continue;
        };
        let (predicate, objects) = task.atom(fact);
        let mut add = |change| {
            problem.timed.push(TimedInitial {
                time: Rational::ONE,
                change,
            });
        };
        if hazard.becomes_true > 0.0 {
            add(TimedChange::Add(predicate, objects.clone()));
        }
        if hazard.becomes_false > 0.0 {
            add(TimedChange::Delete(predicate, objects));
        }
    }
    for schema in &mut problem.schemas {
        if let problem::Body::Durative {
            over_all, at_end, ..
        } = &mut schema.body
        {
            *over_all = problem::Condition::TRUE;
            *at_end = problem::Condition::TRUE;
        }
    }
    // What failures leave behind may be what other actions need.
    let mut left: BTreeSet<(FactId, bool)> = BTreeSet::new();
    loop {
        let actions = grounded(task, &problem, settings)?;
        let mut is_news = false;
        for action in &actions {
            for (fact, truth) in left_by_failures(task, model, &action.name) {
                if left.insert((fact, truth)) {
                    is_news = true;
                    let (predicate, objects) = task.atom(fact);
                    let change = if truth {
                        TimedChange::Add
                    } else {
                        TimedChange::Delete
                    };
                    problem.timed.push(TimedInitial {
                        time: Rational::ONE,
                        change: change(predicate, objects),
                    });
                }
            }
        }
        if !is_news {
            return Ok(actions);
        }
    }
}

/// The actions of a task that can start if the problem is this one.
fn grounded(
    task: &Task,
    problem: &problem::Problem,
    settings: &Settings,
) -> Result<Vec<Action>, NotTabulated> {
    let wider = Task::new(problem.clone());
    let Answer::Complete(grounding) =
        reachability::ground(&wider, &reachability::Settings::default())
    else {
        return Err(NotTabulated::new(
            "there are more actions than can be listed",
        ));
    };
    if !grounding.rules.is_empty() {
        return Err(NotTabulated::new("the domain has derived predicates"));
    }
    let mut actions = Vec::new();
    for (schema, arguments) in grounding.instances() {
        let name = task.action_name(schema, &arguments);
        let only = settings.only.as_ref();
        if only.is_some_and(|only| !only.iter().any(|it| it.eq_ignore_ascii_case(&name))) {
            continue;
        }
        let action = task.instantiate(schema, &arguments);
        let refused = || NotTabulated::new(format!("{name} cannot be instantiated"));
        actions.push(action.map_err(|_| refused())?);
    }
    Ok(actions)
}

/// The facts that failures of an action may change, and what they become.
fn left_by_failures(task: &Task, model: &WorldModel, action: &str) -> Vec<(FactId, bool)> {
    let outcomes = model.failing(action).into_iter();
    let changes = outcomes
        .flat_map(|failing| &failing.outcomes)
        .flat_map(|outcome| &outcome.changes);
    let facts = changes.filter_map(|change| match change.becomes {
        Becoming::Truth(truth) => Some((task.fact_named(&change.what.of(action))?, truth)),
        Becoming::Value(_) | Becoming::Grown(_) => None,
    });
    facts.collect()
}

/// The facts on which the goal depends, through whatever actions and their failures.
pub(super) fn relevant(
    task: &Task,
    model: &WorldModel,
    actions: &[Action],
    goal: &Condition,
) -> Vec<FactId> {
    let left: Vec<Vec<FactId>> = actions
        .iter()
        .map(|action| {
            let left = left_by_failures(task, model, &action.name);
            left.into_iter().map(|(fact, _)| fact).collect()
        })
        .collect();
    let mut facts = BTreeSet::new();
    goal.visit_facts(&mut |fact| {
        facts.insert(fact);
    });
    loop {
        let before = facts.len();
        for (action, left) in actions.iter().zip(&left) {
            let snaps = snaps(action);
            let mut effects = snaps.iter().flat_map(|snap| &snap.effects);
            let matters = effects.any(|effect| match &effect.change {
                Change::Add(fact) | Change::Delete(fact) => facts.contains(fact),
                Change::Update { .. } => false,
            });
            if matters || left.iter().any(|fact| facts.contains(fact)) {
                let mut insert = |fact| {
                    facts.insert(fact);
                };
                for snap in snaps {
                    snap.condition.visit_facts(&mut insert);
                }
                if let Some(body) = action.durative() {
                    body.over_all.visit_facts(&mut insert);
                }
            }
        }
        if facts.len() == before {
            return facts.into_iter().collect();
        }
    }
}

fn snaps(action: &Action) -> Vec<&SnapAction> {
    match &action.body {
        Body::Instantaneous(snap) => vec![snap],
        Body::Durative(body) => vec![&body.start, &body.end],
    }
}

/// A task, with numbers for the facts that matter.
pub(super) struct Compiler<'t> {
    pub(super) task: &'t Task,
    /// Sorted.
    pub(super) facts: Vec<FactId>,
}

impl Compiler<'_> {
    /// 0 for what does not matter.
    pub(super) fn bit(&self, fact: FactId) -> Facts {
        self.facts
            .binary_search(&fact)
            .map_or(0, |place| 1 << place)
    }

    pub(super) fn needs(&self, condition: &Condition) -> Result<Needs, NotTabulated> {
        let all = |parts: &[Condition]| -> Result<Vec<Needs>, NotTabulated> {
            parts.iter().map(|part| self.needs(part)).collect()
        };
        Ok(match condition {
            Condition::Fact(fact) => Needs::Fact(self.bit(*fact)),
            Condition::Not(part) => Needs::Not(Box::new(self.needs(part)?)),
            Condition::And(parts) => Needs::All(all(parts)?),
            Condition::Or(parts) => Needs::Any(all(parts)?),
            // No action that is let in changes a number.
            Condition::Compare(comparison, left, right) => {
                let value = |side| self.value(side);
                let (Some(left), Some(right)) = (value(left), value(right)) else {
                    return Err(NotTabulated::new(
                        "a condition reads a number that has no value",
                    ));
                };
                if comparison.holds(&left, &right) {
                    Needs::All(Vec::new())
                } else {
                    Needs::Any(Vec::new())
                }
            }
        })
    }

    fn value(&self, expression: &Expression) -> Option<Rational> {
        expression.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent) => self.task.initial().values.get(fluent).cloned(),
            _ => None,
        })
    }

    fn snap(&self, snap: &SnapAction, name: &str) -> Result<Snap, NotTabulated> {
        let refuse = |what: &str| Err(NotTabulated::new(format!("{name} has {what}")));
        let (mut adds, mut deletes) = (0, 0);
        for Effect { guard, change } in &snap.effects {
            if !guard.is_trivial() {
                return refuse("conditional effects");
            }
            match change {
                Change::Add(fact) => adds |= self.bit(*fact),
                Change::Delete(fact) => deletes |= self.bit(*fact),
                Change::Update { .. } => return refuse("effects on numbers"),
            }
        }
        Ok(Snap {
            needs: self.needs(&snap.condition)?,
            adds,
            deletes,
        })
    }

    /// `None` for what cannot matter, or never starts.
    pub(super) fn act(
        &self,
        action: &Action,
        model: &WorldModel,
    ) -> Result<Option<Act>, NotTabulated> {
        let name = &action.name;
        let refuse = |what: &str| Err(NotTabulated::new(format!("{name} has {what}")));
        if model.delay_rule(name).is_some() {
            return refuse("a delay");
        }
        let (start, rest, planned) = match &action.body {
            Body::Instantaneous(snap) => (self.snap(snap, name)?, None, Rational::ZERO),
            Body::Durative(body) => {
                if !body.continuous.is_empty() {
                    return refuse("continuous effects");
                }
                let Some(planned) = self.duration(body) else {
                    return refuse("a duration that is to be chosen");
                };
                let rest = (self.needs(&body.over_all)?, self.snap(&body.end, name)?);
                (self.snap(&body.start, name)?, Some(rest), planned)
            }
        };
        let failures = self.failures(name, model, &start, rest.is_some())?;
        let end = rest.as_ref().map_or(0, |(_, end)| end.adds | end.deletes);
        let failed = failures.iter();
        let failed = failed.fold(0, |all, failed| all | failed.adds | failed.deletes);
        if start.adds | start.deletes | end | failed == 0 {
            return Ok(None);
        }
        let (mut midway, mut at_end) = (0.0, 0.0);
        if let Some(failing) = model.failing(name) {
            let is_at_start = failing.when == Failure::AtStart || rest.is_none();
            match failing.when {
                _ if is_at_start && failing.probability >= 1.0 => return Ok(None),
                // It can be tried again at once, until it starts.
                _ if is_at_start => {}
                Failure::Midway => midway = failing.probability,
                Failure::AtEnd | Failure::AtStart => at_end = failing.probability,
            }
        }
        Ok(Some(Act {
            name: name.clone(),
            action: Arc::new(action.clone()),
            start,
            rest,
            planned,
            midway,
            at_end,
            failures,
            may_be_cancelled: true,
            is_eager: false,
        }))
    }

    /// The one duration that the domain allows.
    fn duration(&self, body: &DurativeBody) -> Option<Rational> {
        let [only] = body.duration.as_slice() else {
            return None;
        };
        if only.comparison != Comparison::Equal {
            return None;
        }
        self.value(&only.bound).filter(|value| !value.is_negative())
    }

    pub(super) fn events(&self, model: &WorldModel) -> Result<Vec<Event>, NotTabulated> {
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
            if Footprint::of_timed(timed).writes_what_is_read_by(&goal) {
                return Err(NotTabulated::new(
                    "a timed initial changes what the goal reads, so that the goal is not reached \
                     as soon as it holds",
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
