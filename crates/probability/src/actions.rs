//! Applicable actions of worlds without time: [`all_actions`].

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, FactId, SnapAction};
use elbowroom_model::problem::{self, ObjectId, PredicateId, SchemaId, TimedChange, TimedInitial};
use elbowroom_model::reachability::{self, Answer, Grounding};
use elbowroom_num::Rational;

use crate::likelihoods::Likelihoods;

/// The problem is not supported by worlds without time.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; worlds without time support only facts and unconditional effects on them")]
pub struct Unsupported {
    /// The unsupported feature.
    pub what: String,
}

/// Returns all reachable ground actions, schema by schema in the domain's order, and in the order
/// of the objects. Conditions that no action can violate are kept, because the world may violate
/// them.
///
/// # Errors
/// When there are numbers, conditional effects, derived facts or timed initials, or too many
/// actions.
pub fn all_actions(task: &Task) -> Result<Vec<Action>, Unsupported> {
    check(task)?;
    of(task, grounding(task)?.instances())
}

/// Limit on the number of facts that may change by themselves.
const MAX_SPONTANEOUS: usize = 100_000;

/// Returns all ground actions that can be started in the world of the likelihoods, in the same
/// order.
///
/// In contrast to [`all_actions`], the world may also change facts: by failures of actions, and
/// spontaneously. An action that can start and never end is included as well, because the agent may
/// abandon it after its start.
///
/// # Errors
/// As [`all_actions`], and when too many facts may change by themselves.
pub fn all_actions_under(
    task: &Task,
    likelihoods: &Likelihoods,
) -> Result<Vec<Action>, Unsupported> {
    check(task)?;
    let mut problem = task.problem().clone();
    for schema in &mut problem.schemas {
        if let problem::Body::Durative {
            over_all, at_end, ..
        } = &mut schema.body
        {
            *over_all = problem::Condition::TRUE;
            *at_end = problem::Condition::TRUE;
        }
    }
    // For reachability, a change by the world at any time is equivalent to a timed initial literal.
    let mut new = spontaneous(task, likelihoods)?;
    loop {
        let timed = |change| TimedInitial {
            time: Rational::ONE,
            change,
        };
        problem.timed.extend(new.into_iter().map(timed));
        let instances = grounding(&Task::new(problem.clone()))?.instances();
        let actions = of(task, instances)?;
        new = failure_changes(task, &actions, likelihoods);
        new.retain(|change| problem.timed.iter().all(|timed| timed.change != *change));
        if new.is_empty() {
            let world = problem.timed.iter().map(|timed| &timed.change);
            return Ok(startable(task, actions, world));
        }
    }
}

/// Returns the facts that change by themselves with positive probability.
fn spontaneous(task: &Task, likelihoods: &Likelihoods) -> Result<Vec<TimedChange>, Unsupported> {
    let problem = task.problem();
    let mut changes = Vec::new();
    for (index, predicate) in problem.predicates.iter().enumerate() {
        let id = PredicateId::from(index);
        let mut note = |objects: &[ObjectId]| {
            let (becomes_true, becomes_false) = likelihoods.may_change(id, objects);
            if becomes_true {
                changes.push(TimedChange::Add(id, objects.to_vec()));
            }
            if becomes_false {
                changes.push(TimedChange::Delete(id, objects.to_vec()));
            }
            changes.len() <= MAX_SPONTANEOUS
        };
        let is_within_limit = if likelihoods.may_change_any(id) {
            let domains = predicate.parameters.iter();
            let domains = domains.map(|it| problem.objects_of(&it.types).collect::<Vec<_>>());
            each_combination(&domains.collect::<Vec<_>>(), &mut note)
        } else {
            let own = likelihoods.facts.keys();
            let mut own = own.filter(|(predicate, _)| *predicate == id);
            own.all(|(_, objects)| note(objects))
        };
        if !is_within_limit {
            let name = &predicate.name;
            return Err(Unsupported {
                what: format!(
                    "more than {MAX_SPONTANEOUS} facts change by themselves, including those of \
                     `{name}`"
                ),
            });
        }
    }
    Ok(changes)
}

/// Calls `visit` for each choice of one object from each list, as long as it returns `true`. Returns the last
/// answer.
fn each_combination(lists: &[Vec<ObjectId>], visit: &mut dyn FnMut(&[ObjectId]) -> bool) -> bool {
    fn extend(
        lists: &[Vec<ObjectId>],
        chosen: &mut Vec<ObjectId>,
        visit: &mut dyn FnMut(&[ObjectId]) -> bool,
    ) -> bool {
        let Some(list) = lists.get(chosen.len()) else {
            return visit(chosen);
        };
        list.iter().all(|object| {
            chosen.push(*object);
            let may_continue = extend(lists, chosen, visit);
            chosen.pop();
            may_continue
        })
    }
    extend(lists, &mut Vec::new(), visit)
}

/// Returns the actions whose start condition is possible when each fact keeps every truth value
/// that it can ever have: initially, by the world, or by the start or end of such an action. An end
/// is possible under the same rule.
fn startable<'c>(
    task: &Task,
    actions: Vec<Action>,
    world: impl Iterator<Item = &'c TimedChange>,
) -> Vec<Action> {
    let mut seen = PossibleTruths {
        initially: &task.initial().facts,
        changed: BTreeSet::new(),
    };
    for change in world {
        let (fact, truth) = match change {
            TimedChange::Add(predicate, objects) => (task.find_fact(*predicate, objects), true),
            TimedChange::Delete(predicate, objects) => (task.find_fact(*predicate, objects), false),
            TimedChange::Assign(..) => continue,
        };
        // No action reads a fact without a number.
        seen.changed.extend(fact.map(|fact| (fact, truth)));
    }
    let mut starts = vec![false; actions.len()];
    loop {
        let before = (seen.changed.len(), starts.iter().filter(|it| **it).count());
        for (action, starts) in actions.iter().zip(&mut starts) {
            match &action.body {
                Body::Instantaneous(snap) => *starts |= seen.apply_if_possible(snap),
                Body::Durative(body) => {
                    *starts |= seen.apply_if_possible(&body.start);
                    if *starts {
                        seen.apply_if_possible(&body.end);
                    }
                }
            }
        }
        if before == (seen.changed.len(), starts.iter().filter(|it| **it).count()) {
            break;
        }
    }
    let mut starts = starts.into_iter();
    let mut actions = actions;
    actions.retain(|_| starts.next() == Some(true));
    actions
}

/// Possible truth values of facts.
struct PossibleTruths<'t> {
    initially: &'t BTreeSet<FactId>,
    changed: BTreeSet<(FactId, bool)>,
}

impl PossibleTruths<'_> {
    /// Adds the effects of a snap action if it is possible, and returns whether it is.
    fn apply_if_possible(&mut self, snap: &SnapAction) -> bool {
        let is_possible = self.allows(&snap.condition, true);
        if is_possible {
            let effects = snap.effects.iter();
            self.changed
                .extend(effects.filter_map(|it| match it.change {
                    Change::Add(fact) => Some((fact, true)),
                    Change::Delete(fact) => Some((fact, false)),
                    Change::Update { .. } => None,
                }));
        }
        is_possible
    }

    /// Returns `true` if a condition can have this truth value.
    fn allows(&self, condition: &Condition, truth: bool) -> bool {
        match condition {
            Condition::Fact(fact) => {
                self.initially.contains(fact) == truth || self.changed.contains(&(*fact, truth))
            }
            Condition::Compare(..) => true,
            Condition::Not(part) => self.allows(part, !truth),
            Condition::And(parts) if truth => parts.iter().all(|it| self.allows(it, true)),
            Condition::Or(parts) if !truth => parts.iter().all(|it| self.allows(it, false)),
            Condition::And(parts) | Condition::Or(parts) => {
                parts.iter().any(|it| self.allows(it, truth))
            }
        }
    }
}

/// Returns the possible changes of facts by failures of these actions.
fn failure_changes(task: &Task, actions: &[Action], likelihoods: &Likelihoods) -> Vec<TimedChange> {
    let mut left = Vec::new();
    for action in actions {
        if likelihoods.success_probability(action, 1.0) >= 1.0 {
            continue;
        }
        for aftermath in likelihoods.failure_outcomes(task, action) {
            for (fact, becomes) in aftermath.changes {
                let (predicate, objects) = task.atom(fact);
                let change = if becomes {
                    TimedChange::Add(predicate, objects)
                } else {
                    TimedChange::Delete(predicate, objects)
                };
                if !left.contains(&change) {
                    left.push(change);
                }
            }
        }
    }
    left
}

fn check(task: &Task) -> Result<(), Unsupported> {
    let refuse = |what: String| Err(Unsupported { what });
    if let Some(feature) = task.validator_only_feature() {
        return refuse(format!("the problem has {feature}"));
    }
    if !task.timed().is_empty() {
        return refuse("the problem has timed initials".to_owned());
    }
    Ok(())
}

fn grounding(task: &Task) -> Result<Grounding, Unsupported> {
    let refuse = |what: &str| {
        let what = what.to_owned();
        Err(Unsupported { what })
    };
    let Answer::Complete(grounding) =
        reachability::ground(task, &reachability::Settings::default())
    else {
        return refuse("there are too many instances of actions to list them");
    };
    if !grounding.rules.is_empty() {
        return refuse("the domain has derived predicates");
    }
    if has_numbers(task.goal()) {
        return refuse("the goal is about numbers");
    }
    Ok(grounding)
}

fn of(task: &Task, instances: Vec<(SchemaId, Vec<ObjectId>)>) -> Result<Vec<Action>, Unsupported> {
    let refuse = |what: String| Err(Unsupported { what });
    let mut actions = Vec::new();
    for (schema, arguments) in instances {
        let name = task.action_name(schema, &arguments);
        let Ok(action) = task.instantiate(schema, &arguments) else {
            return refuse(format!("{name} cannot be instantiated"));
        };
        if let Some(what) = unsupported(&action) {
            return refuse(format!("{name} has {what}"));
        }
        actions.push(action);
    }
    Ok(actions)
}

fn unsupported(action: &Action) -> Option<&'static str> {
    let snaps: Vec<&SnapAction> = match &action.body {
        Body::Instantaneous(snap) => vec![snap],
        Body::Durative(body) => vec![&body.start, &body.end],
    };
    let mut effects = snaps.iter().flat_map(|snap| &snap.effects);
    if effects.any(|effect| !effect.guard.is_trivial()) {
        return Some("conditional effects");
    }
    let mut effects = snaps.iter().flat_map(|snap| &snap.effects);
    let is_numeric = action
        .durative()
        .is_some_and(|body| !body.continuous.is_empty() || has_numbers(&body.over_all))
        || effects.any(|effect| matches!(effect.change, Change::Update { .. }))
        || snaps.iter().any(|snap| has_numbers(&snap.condition));
    is_numeric.then_some("conditions or effects on numbers")
}

fn has_numbers(condition: &Condition) -> bool {
    match condition {
        Condition::Fact(_) => false,
        Condition::Compare(..) => true,
        Condition::Not(part) => has_numbers(part),
        Condition::And(parts) | Condition::Or(parts) => parts.iter().any(has_numbers),
    }
}
