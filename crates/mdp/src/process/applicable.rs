//! The available actions.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::problem::{self, TimedChange, TimedInitial};
use elbowroom_model::reachability::{self, Answer};
use elbowroom_num::Rational;
use elbowroom_sim::{ExogenousChange, FactOutcome, WorldModel};

use crate::settings::{NotTabulated, Settings};

/// Returns all requested actions that can start, under any events. An action that can never end is
/// in no plan, but the effects of its start may be useful.
pub(crate) fn actions(
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
    // Outcomes of failures may satisfy the conditions of other actions.
    let mut left: BTreeSet<(FactId, bool)> = BTreeSet::new();
    loop {
        let actions = grounded(task, &problem, settings)?;
        let mut is_news = false;
        for action in &actions {
            for (fact, truth) in facts_changed_by_failures(task, model, &action.name) {
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

/// Returns the actions of a task that can start in this problem.
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
            "there are too many instances of actions to list them",
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

/// Returns the facts that failures of an action may change, with their new values.
pub(crate) fn facts_changed_by_failures(
    task: &Task,
    model: &WorldModel,
    action: &str,
) -> Vec<(FactId, bool)> {
    let outcomes = model.failure_rule(action).into_iter();
    let changes = outcomes
        .flat_map(|failing| &failing.outcomes)
        .flat_map(|outcome| &outcome.changes);
    let facts = changes.filter_map(|change| match change.change {
        FactOutcome::Truth(truth) => {
            Some((task.fact_named(&change.target.instantiate(action))?, truth))
        }
        FactOutcome::Value(_) | FactOutcome::ChangedBy(_) => None,
    });
    facts.collect()
}
