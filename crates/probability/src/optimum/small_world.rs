//! Optimal policies of small worlds on a clock, as tables.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Change, Condition, DurativeBody, Expression, FactId};
use elbowroom_model::problem::Comparison;
use elbowroom_model::{Step, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{Instance, PartialOrderPlan};

use super::reachable::value_bounds;
use super::{Optimum, Perturbed, Settings, TabulationError, ValueBounds};
use crate::actions::all_actions_under;
use crate::dispatch::Choice;
use crate::likelihoods::Likelihoods;
use crate::model::{Model, Semantics};
use crate::search::{OrderSearch, SearchSettings};
use crate::search_state::SearchState;
use crate::total_order::Slot;

/// Largest number of actions that run at once.
const MAX_RUNNING: usize = 3;

/// Largest number of states to tabulate: states of facts times sets of running actions. A table of
/// this size takes some seconds.
const MAX_STATES: usize = 1 << 18;

/// Largest number of facts, even with few actions.
const MAX_FACTS: usize = 16;

/// Largest number of actions for which bounds on the optimal value are computed.
const MAX_ACTIONS: usize = 1000;

/// Limit on the number of explored nodes of a world with a smaller table.
const MIN_NODES: usize = 1000;

/// Limit on the number of explored nodes of a world that is too large for a table.
const MAX_NODES: usize = 200_000;

/// Optimal policy of a small world.
#[derive(Clone, Debug)]
pub struct PolicyTable {
    process: Perturbed,
    optimum: Optimum,
    /// Actions in the order of the model's instances, with the durations of the domain.
    steps: Vec<Step>,
}

impl PolicyTable {
    /// Creates the table of a world. Returns `None` if the world is too large, or if some happening
    /// cannot be chosen when it is due. This is the case if there are numbers, timed initials or
    /// negations, if an action's end, successful or failed, deletes a fact that another action or
    /// the goal needs, or if an end needs a fact that another action makes true while this one is
    /// running.
    pub fn new(task: &Task, likelihoods: &Likelihoods) -> Option<Self> {
        let task = task.clone();
        let likelihoods = without_luck(likelihoods);
        let actions = all_actions_under(&task, &likelihoods).ok()?;
        // The checks below compare all pairs of actions, which takes long in large worlds.
        if sets(actions.len()) > MAX_STATES {
            return None;
        }
        let failures = |action: &Action| likelihoods.failure_changes(&task, action);
        if ends_break_others(&actions, task.goal(), failures)
            || ends_await_others(&actions, failures)
            || has_negations(&task, &actions)
        {
            return None;
        }
        let plan = PartialOrderPlan::unordered(&task, actions);
        let steps = plan.instances().map(|(_, instance)| step(&task, instance));
        let steps = steps.collect::<Option<Vec<Step>>>()?;
        let model = Model::new(task, plan, &likelihoods, Semantics::World).ok()?;
        let facts = model.facts().count();
        if facts > MAX_FACTS || sets(steps.len()) << facts > MAX_STATES {
            return None;
        }
        let settings = Settings {
            most_running: MAX_RUNNING,
            // An action is abandoned when its over-all condition fails.
            enforces_over_all: true,
            ..Settings::default()
        };
        let process = Perturbed::new(model, settings).ok()?;
        if table_search(&process).has_couplings() {
            return None;
        }
        Some(Self {
            optimum: process.optimum(),
            process,
            steps,
        })
    }

    /// Returns the actions in the order of the model's instances.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Returns a search for the model, which computes the times of happenings.
    pub fn search(&self) -> OrderSearch {
        table_search(&self.process)
    }

    /// Returns the probability that the optimal policy reaches the goal from here.
    pub fn value(&self, circumstances: &SearchState) -> f64 {
        self.optimum.value(&self.process, circumstances)
    }

    /// Returns the best choice. A start is due as soon as no happening that interferes with it is
    /// recent.
    pub fn choose(&self, search: &OrderSearch, circumstances: &SearchState) -> Choice {
        self.optimum.choice(&self.process, circumstances, |node| {
            let slots = search.windows(circumstances, &[node]);
            let slot = slots.and_then(|slots| slots.into_iter().next());
            slot.unwrap_or_else(|| Slot {
                node,
                earliest: circumstances.now.clone(),
                latest: None,
            })
        })
    }
}

fn table_search(process: &Perturbed) -> OrderSearch {
    OrderSearch::new(Arc::clone(process.model()), SearchSettings::default())
}

/// Returns bounds on the probability that an optimal agent reaches the goal with these actions. It
/// may try them any number of times and observes the state. In a dead end, it has lost. At most
/// three actions run at once, and an action is abandoned when its over-all condition fails.
///
/// # Errors
/// When the world has too many actions or uncertain facts, or has other features than facts.
pub fn best_value(
    task: &Task,
    actions: Vec<Action>,
    likelihoods: &Likelihoods,
    circumstances: &SearchState,
) -> Result<ValueBounds, TabulationError> {
    if actions.len() > MAX_ACTIONS {
        return Err(TabulationError::TooManyActions {
            actions: actions.len(),
        });
    }
    let plan = PartialOrderPlan::unordered(task, actions);
    let model = Model::new(task.clone(), plan, likelihoods, Semantics::World);
    let model = model.map_err(|missing| TabulationError::Unsupported {
        what: missing.to_string(),
    })?;
    let model = Arc::new(model);
    if OrderSearch::new(Arc::clone(&model), SearchSettings::default()).has_couplings() {
        return Err(TabulationError::Unsupported {
            what: "actions need each other at the same time".to_owned(),
        });
    }
    let settings = Settings {
        most_running: MAX_RUNNING,
        enforces_over_all: true,
        ..Settings::default()
    };
    let (facts, actions) = (model.facts().count(), model.plan().instances.len());
    let table_size = (facts <= MAX_FACTS && actions <= 20)
        .then(|| sets(actions) << facts)
        .filter(|states| *states <= MAX_STATES);
    let max_nodes = table_size.map_or(MAX_NODES, |states| states.max(MIN_NODES));
    let bounds = value_bounds(&model, &settings, circumstances, max_nodes);
    let is_known = bounds.as_ref().is_ok_and(ValueBounds::is_exact);
    if is_known || table_size.is_none() {
        return bounds;
    }
    let process = Perturbed::new(model, settings)?;
    let value = process.optimum().value(&process, circumstances);
    Ok(ValueBounds::exact(value))
}

/// Removes spontaneous changes that make facts true. Otherwise every step would be a chance of such
/// a change, and if only the world's clock advances, the policy would repeat steps in vain forever.
fn without_luck(likelihoods: &Likelihoods) -> Likelihoods {
    let mut likelihoods = likelihoods.clone();
    let entries = likelihoods.predicates.values_mut();
    for entry in entries.chain(likelihoods.facts.values_mut()) {
        entry.becomes_true = entry.becomes_true.map(|_| 0.0);
    }
    let becomes_true = &mut likelihoods.defaults.becomes_true;
    *becomes_true = becomes_true.map(|_| 0.0);
    likelihoods
}

/// Returns `true` if some condition needs a fact to be false: losing a fact would then be a helpful
/// change.
fn has_negations(task: &Task, actions: &[Action]) -> bool {
    let needs = actions.iter().flat_map(conditions);
    needs.chain([task.goal()]).any(is_negative)
}

fn is_negative(condition: &Condition) -> bool {
    match condition {
        Condition::Fact(_) | Condition::Compare(..) => false,
        Condition::Not(_) => true,
        Condition::And(parts) | Condition::Or(parts) => parts.iter().any(is_negative),
    }
}

/// Returns the action with its shortest duration.
fn step(task: &Task, instance: &Instance) -> Option<Step> {
    let action = instance.action.clone();
    let duration = match action.durative() {
        Some(body) => Some(shortest(task, body)?),
        None => None,
    };
    Some(Step {
        start: Rational::ZERO,
        duration,
        action,
    })
}

/// Returns the shortest duration that the domain allows. In these worlds no action changes a
/// number, so it is the same in all states.
fn shortest(task: &Task, body: &DurativeBody) -> Option<Rational> {
    let values = &task.initial().values;
    let mut shortest: Option<Rational> = None;
    let mut longest: Option<Rational> = None;
    for constraint in &body.duration {
        let bound = constraint.bound.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent) => values.get(fluent).cloned(),
            _ => None,
        })?;
        match constraint.comparison {
            Comparison::AtMost => {
                longest = Some(longest.map_or(bound.clone(), |known| known.min(bound)));
            }
            Comparison::AtLeast | Comparison::Equal => {
                shortest = Some(shortest.map_or(bound.clone(), |known| known.max(bound)));
            }
            // With a strict bound there may be no shortest duration.
            Comparison::Greater | Comparison::Less => return None,
        }
    }
    shortest.or(longest).filter(Rational::is_positive)
}

/// Returns `true` if the end of an action, successful or failed, deletes a fact of the goal, or of
/// a condition of another action: at its start, at its end, or in between. `failures` has the facts
/// that a failure of an action sets.
///
/// The clock determines the order of ends, but the table assumes the best order. In the table, an
/// action that needs light would always start, or end, before the light goes out.
fn ends_break_others(
    actions: &[Action],
    goal: &Condition,
    failures: impl Fn(&Action) -> BTreeSet<(FactId, bool)>,
) -> bool {
    let all = || actions.iter().enumerate();
    let durative = all().filter_map(|(index, action)| Some((index, action.durative()?)));
    durative.into_iter().any(|(own, ending)| {
        let others = all().filter(|(other, _)| *other != own);
        let needed = others.flat_map(|(_, other)| conditions(other));
        let needed: Vec<&Condition> = needed.chain([goal]).collect();
        let failures = failures(&actions[own]).into_iter();
        let deleted = failures.filter(|(_, becomes)| !becomes);
        let deleted = deleted.map(|(fact, _)| Change::Delete(fact));
        let changes = ending.end.effects.iter();
        let mut changes = changes.map(|effect| effect.change.clone()).chain(deleted);
        changes.any(|change| needed.iter().any(|condition| breaks(&change, condition)))
    })
}

/// Returns `true` if the end of an action needs a fact that another action makes true, and that does not hold already
/// because of its condition over all, or because its start needs it and does not delete it. The table would delay such an
/// end until the fact holds. On the clock, the action fails.
fn ends_await_others(
    actions: &[Action],
    failures: impl Fn(&Action) -> BTreeSet<(FactId, bool)>,
) -> bool {
    let made_true_by = |action: &Action| {
        let effects = match &action.body {
            Body::Instantaneous(snap) => snap.effects.clone(),
            Body::Durative(body) => {
                let ends = body.end.effects.iter();
                body.start.effects.iter().chain(ends).cloned().collect()
            }
        };
        let added = effects
            .into_iter()
            .filter_map(|effect| match effect.change {
                Change::Add(fact) => Some(fact),
                Change::Delete(_) | Change::Update { .. } => None,
            });
        let left = failures(action).into_iter();
        let left = left.filter_map(|(fact, becomes)| becomes.then_some(fact));
        added.chain(left).collect::<BTreeSet<FactId>>()
    };
    let made_true: Vec<_> = actions.iter().map(made_true_by).collect();
    actions.iter().enumerate().any(|(own, action)| {
        let Some(body) = action.durative() else {
            return false;
        };
        let (before, throughout) = (body.start.condition.conjuncts(), body.over_all.conjuncts());
        let is_deleted = |part: &Condition| {
            let mut effects = body.start.effects.iter();
            effects.any(|effect| breaks(&effect.change, part))
        };
        let awaited = body.end.condition.conjuncts().into_iter();
        let awaited = awaited.filter(|part| !throughout.contains(part));
        let mut awaited = awaited.filter(|part| !before.contains(part) || is_deleted(part));
        awaited.any(|part| {
            let others = made_true.iter().enumerate();
            let mut others = others.filter(|(other, _)| *other != own);
            others.any(|(_, facts)| facts.iter().any(|fact| mentions(part, *fact)))
        })
    })
}

/// Returns `true` if a condition without negations reads the fact.
fn mentions(condition: &Condition, fact: FactId) -> bool {
    breaks(&Change::Delete(fact), condition)
}

/// Returns the conditions of an action.
fn conditions(action: &Action) -> Vec<&Condition> {
    match &action.body {
        Body::Instantaneous(snap) => vec![&snap.condition],
        Body::Durative(body) => vec![&body.start.condition, &body.over_all, &body.end.condition],
    }
}

/// Returns `true` if a change can make a condition without negations false.
fn breaks(change: &Change, condition: &Condition) -> bool {
    match condition {
        Condition::Fact(fact) => *change == Change::Delete(*fact),
        Condition::Compare(..) | Condition::Not(_) => false,
        Condition::And(parts) | Condition::Or(parts) => {
            parts.iter().any(|part| breaks(change, part))
        }
    }
}

/// Returns the number of sets of at most [`MAX_RUNNING`] of these actions.
fn sets(actions: usize) -> usize {
    let mut ways: usize = 1;
    let mut sum: usize = 1;
    for count in 1..=MAX_RUNNING.min(actions) {
        ways = ways.saturating_mul(actions + 1 - count) / count;
        sum = sum.saturating_add(ways);
    }
    sum
}

#[cfg(test)]
mod tests {
    use crate::likelihoods;
    use elbowroom_model::Task;
    use elbowroom_num::Rational;
    use elbowroom_pddl::{Source, read_problem};

    use super::{MAX_RUNNING, PolicyTable, sets};

    /// Returns the durations of the table's actions, if there is a table.
    fn durations(actions: &str, init: &str) -> Option<Vec<Rational>> {
        durations_under(actions, init, "")
    }

    /// Returns the durations of the table's actions with entries of a likelihood file, if there is
    /// a table.
    fn durations_under(actions: &str, init: &str, entries: &str) -> Option<Vec<Rational>> {
        let domain = format!(
            "(define (domain d) (:requirements :durative-actions :numeric-fluents)
               (:types place) (:predicates (light) (done ?p - place)) (:functions (far ?p - place))
               {actions})"
        );
        let problem = format!(
            "(define (problem p) (:domain d) (:objects here there - place)
               (:init (= (far here) 3) (= (far there) 5/2) {init})
               (:goal (and (done here) (done there))))"
        );
        let problem = problem.replace("5/2", "2.5");
        let source = |text: &str| Source::new("test", text);
        let (problem, _) = read_problem(&source(&domain), &source(&problem)).unwrap();
        let task = Task::new(problem);
        let text = format!(
            "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nbecomes_true = 0.0
             becomes_false = 0.0\nstart = 1.0\neffect = 1.0\n{entries}"
        );
        let likelihoods = likelihoods::read(text.as_str(), &task).unwrap();
        let table = PolicyTable::new(&task, &likelihoods)?;
        let durations = table.steps().iter().map(|step| step.duration.clone());
        durations.collect()
    }

    /// Returns an action at a place, with its duration, its condition, and its effect.
    fn action(name: &str, duration: &str, condition: &str, effect: &str) -> String {
        format!(
            "(:durative-action {name} :parameters (?p - place) :duration {duration}
               :condition {condition} :effect {effect})"
        )
    }

    #[test]
    fn actions_take_their_minimum_duration() {
        let look = |duration: &str| action("look", duration, "()", "(at end (done ?p))");
        let numbers = |text: &str| {
            let numbers = text.split(' ').map(str::parse::<Rational>);
            Some(numbers.collect::<Result<Vec<_>, _>>().unwrap())
        };
        let of = |duration: &str| durations(&look(duration), "");
        assert_eq!(of("(= ?duration (far ?p))"), numbers("3 5/2"));
        assert_eq!(
            of("(and (>= ?duration 2) (<= ?duration (far ?p)))"),
            numbers("2 2")
        );
        assert_eq!(of("(<= ?duration (far ?p))"), numbers("3 5/2"));
        assert_eq!(of("()"), None);
    }

    #[test]
    fn time_dependent_worlds_have_no_table() {
        let look = action(
            "look",
            "(= ?duration 2)",
            "(over all (light))",
            "(at end (done ?p))",
        );
        let burn = |effect: &str| {
            let effect = format!("(and (at start (light)) {effect})");
            action("burn", "(= ?duration 9)", "()", &effect)
        };
        assert!(durations(&look, "(light)").is_some());
        assert!(durations(&look, "(light) (at 5 (not (light)))").is_none());
        assert!(durations(&format!("{look}{}", burn("")), "").is_some());
        // The look has to end before the light goes out. Nor may a condition need darkness: losing
        // the light would then be a helpful change.
        let hide = look
            .replace("look", "hide")
            .replace("(light)", "(not (light))");
        assert!(durations(&hide, "").is_none());
        let goes_out = burn("(at end (not (light)))");
        assert!(durations(&format!("{look}{goes_out}"), "").is_none());
        // An action must not have to start before the light goes out either.
        let begin = look.replace("over all", "at start");
        assert!(durations(&format!("{begin}{}", burn("")), "").is_some());
        assert!(durations(&format!("{begin}{goes_out}"), "").is_none());
        // An end must not need a fact that another action makes true.
        let awaits_light = action(
            "look",
            "(= ?duration 2)",
            "(at end (light))",
            "(at end (done ?p))",
        );
        assert!(durations(&format!("{awaits_light}{}", burn("")), "").is_none());
        // An end must not delete a fact that the goal needs.
        let undoes = burn("(at end (not (done ?p)))");
        assert!(durations(&format!("{look}{}", burn("")), "(light)").is_some());
        assert!(durations(&format!("{look}{undoes}"), "(light)").is_none());
        let numbers = burn("(at end (increase (far ?p) 1))");
        assert!(durations(&format!("{look}{numbers}"), "").is_none());
    }

    #[test]
    fn failure_that_deletes_condition_of_another_action_leaves_no_table() {
        let look = action(
            "look",
            "(= ?duration 2)",
            "(at start (light))",
            "(at end (done ?p))",
        );
        let burn = action("burn", "(= ?duration 9)", "()", "(at start (light))");
        let both = format!("{look}{burn}");
        let fails = "[actions.burn]\nend = 0.5\n";
        assert!(durations_under(&both, "", fails).is_some());
        assert!(durations_under(&both, "", &format!("{fails}undone = true\n")).is_none());
        let outcome = |fact: &str| {
            format!(
                "{fails}[[actions.burn.outcome]]\nprobability = 0.5\nbecomes_false = [\"{fact}\"]\n"
            )
        };
        assert!(durations_under(&both, "", &outcome("(light)")).is_none());
        // The goal needs the fact.
        assert!(durations_under(&both, "", &outcome("(done here)")).is_none());
        let own = format!("{}end = 0.5\nundone = true\n", "[actions.look]\n");
        assert!(durations_under(&both, "", &own).is_some());
    }

    #[test]
    fn number_of_running_sets_matches_enumeration() {
        for actions in 0..10_u32 {
            let few = |set: &u32| set.count_ones() as usize <= MAX_RUNNING;
            let count = (0..1_u32 << actions).filter(few).count();
            assert_eq!(sets(actions as usize), count);
        }
    }
}
