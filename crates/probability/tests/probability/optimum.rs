//! Optimal values, compared with closed forms, a plain recursion, and the authors' worlds.

use crate::shared;
use std::sync::Arc;

use crate::reference::random::{Case, Taste, case, with_failing_ends, with_outcomes};
use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, SnapAction};
use elbowroom_plan::{InstanceId, PartialOrderPlan};
use elbowroom_probability::dispatch::never_interrupt;
use elbowroom_probability::likelihoods::FailureModel;
use elbowroom_probability::optimum::{DeadEnds, Horizon, Move, Perturbed, Settings};
use elbowroom_probability::{
    Choice, LayerDispatch, Likelihoods, Model, OrderSearch, Reconsider, SearchSettings,
    SearchState, Semantics, Slot,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn steps(count: usize) -> Settings {
    Settings {
        horizon: Horizon::Steps(count),
        dead_ends: DeadEnds::Harmless,
        ..Settings::default()
    }
}

#[test]
fn single_action_is_tried_until_horizon() {
    let domain = "(define (domain d) (:predicates (lit))
        (:durative-action light :parameters () :duration (= ?duration 1) :effect (at end (lit))))";
    let problem = "(define (problem p) (:domain d) (:init) (:goal (lit)))";
    let (task, plan) = shared::read_task(domain, problem, "0: (light) [1]");
    let mut likelihoods = Likelihoods::certain();
    likelihoods.defaults.start = Some(0.5);
    likelihoods.defaults.effect = Some(0.25);
    let initial = SearchState::initial(&task);
    let model = Model::new(task, plan, &likelihoods, Semantics::World).unwrap();
    let value = |settings| {
        let process = Perturbed::new(model.clone(), settings).unwrap();
        process.optimum().value(&process, &initial)
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    near(value(steps(1)), 0.0);
    near(value(steps(2)), 0.5 * 0.25);
    near(value(steps(3)), 0.75 * 0.25);
    // Two starts and two ends; or one more failed start.
    let once = 0.5 + 0.25 + 0.125;
    near(value(steps(4)), once * 0.25 + 0.25 * 0.75 * 0.25);
    near(value(Settings::default()), 1.0);
}

const SMALL: Taste = Taste {
    facts: 2,
    actions: 2,
    couples: false,
    negations: true,
    is_easy: true,
    timed: false,
    numbers: false,
};

#[test]
fn optimum_equals_plain_recursion() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut between, mut dead_ends_matter) = (0, 0);
    for round in 0..300 {
        let mut case = case(&mut rng, SMALL);
        if round >= 150 {
            case = with_failing_ends(&mut rng, case);
        }
        if round >= 220 {
            case = with_outcomes(&mut rng, case);
        }
        case.circumstances = SearchState::initial(&case.task);
        let model = Model::new(
            case.task.clone(),
            case.plan.clone(),
            &case.likelihoods,
            Semantics::World,
        );
        let model = model.unwrap();
        let is_true = |fact| case.circumstances.belief.probability(fact) > 0.5;
        let state: Vec<bool> = case.facts().map(is_true).collect();
        for count in 0..4 {
            let mut values = Vec::new();
            for patience in [None, Some(1), Some(2)] {
                let settings = Settings {
                    dead_ends: patience.map_or(DeadEnds::Harmless, DeadEnds::Patience),
                    ..steps(count)
                };
                let process = Perturbed::new(model.clone(), settings).unwrap();
                let optimum = process.optimum().value(&process, &case.circumstances);
                let left = Left {
                    steps: count,
                    patience,
                };
                let expected = best(&case, &state, &[], left);
                assert!(
                    (optimum - expected).abs() < 1e-12,
                    "{patience:?}: {optimum} {expected} {}",
                    case.text
                );
                values.push(optimum);
            }
            between += usize::from(values[0] > 0.0 && values[0] < 1.0);
            dead_ends_matter += usize::from(values[1] < values[2] - 1e-9);
        }
    }
    assert!(between > 100, "{between}");
    assert!(dead_ends_matter > 20, "{dead_ends_matter}");
}

/// Remaining resources of a run.
#[derive(Clone, Copy, Debug)]
struct Left {
    steps: usize,
    /// Number of steps into a dead end that lose the run; `None`: unlimited.
    patience: Option<usize>,
}

/// Returns `true` if the goal cannot be reached without failures, by an exhaustive search.
fn is_dead_end(case: &Case, state: &[bool], running: &[InstanceId]) -> bool {
    let mut open = vec![(state.to_vec(), running.to_vec())];
    let mut seen = open.clone();
    while let Some((state, running)) = open.pop() {
        // Running actions can be abandoned.
        if holds(case.task.goal(), &state) {
            return false;
        }
        let mut next = Vec::new();
        for &id in &running {
            next.push((state.clone(), without(&running, id)));
        }
        for (snap, _, after) in steps_from(case, &state, &running) {
            let mut changed = state.clone();
            for wanted in [false, true] {
                for effect in &snap.effects {
                    match effect.change {
                        Change::Add(fact) if wanted => changed[fact.index()] = true,
                        Change::Delete(fact) if !wanted => changed[fact.index()] = false,
                        _ => {}
                    }
                }
            }
            next.push((changed, after));
        }
        for place in next {
            if !seen.contains(&place) {
                seen.push(place.clone());
                open.push(place);
            }
        }
    }
    true
}

fn without(running: &[InstanceId], id: InstanceId) -> Vec<InstanceId> {
    let others = running.iter().copied().filter(|other| *other != id);
    others.collect()
}

/// Returns the best probability of success with these remaining resources.
fn best(case: &Case, state: &[bool], running: &[InstanceId], left: Left) -> f64 {
    if running.is_empty() && holds(case.task.goal(), state) {
        return 1.0;
    }
    let mut most: f64 = 0.0;
    for &id in running {
        most = most.max(best(case, state, &without(running, id), left));
    }
    if left.steps == 0 {
        return most;
    }
    let fewer = Left {
        steps: left.steps - 1,
        ..left
    };
    for (snap, id, next) in steps_from(case, state, running) {
        let action = &case.plan.instance(id).action;
        let failing = &case.likelihoods.schemas[&action.schema].failing;
        let is_end = running.contains(&id);
        let success = if is_end {
            failing.end.unwrap_or(1.0)
        } else {
            case.likelihoods.start(action).unwrap()
        };
        let mut value = 0.0;
        for (after, weight) in effects(case, action, snap, state) {
            value += success * weight * perturbed(case, &after, &next, fewer);
        }
        let failures = if is_end {
            failure_states(case, action, failing, state)
        } else {
            vec![(state.to_vec(), 1.0)]
        };
        let after_failure = if is_end { &next[..] } else { running };
        for (after, weight) in failures {
            value += (1.0 - success) * weight * perturbed(case, &after, after_failure, fewer);
        }
        most = most.max(value);
    }
    most
}

/// Returns the possible states after a failed end, by the definition of the file format.
fn failure_states(
    case: &Case,
    action: &Action,
    failing: &FailureModel,
    state: &[bool],
) -> Vec<(Vec<bool>, f64)> {
    let mut undone = state.to_vec();
    if failing.undone == Some(true) {
        let effects = || action.durative().unwrap().start.effects.iter();
        for effect in effects() {
            if let Change::Delete(fact) = effect.change {
                undone[fact.index()] = true;
            }
        }
        for effect in effects() {
            if let Change::Add(fact) = effect.change {
                undone[fact.index()] = false;
            }
        }
    }
    let mut left = 1.0;
    let mut states = Vec::new();
    for outcome in failing.outcomes.iter().flatten() {
        left -= outcome.probability;
        let mut after = undone.clone();
        for change in &outcome.changes {
            let name = &case.task.problem().predicates[change.predicate.index()].name;
            let fact = case.task.fact_named(&format!("({name})")).unwrap();
            after[fact.index()] = change.becomes;
        }
        states.push((after, outcome.probability));
    }
    states.push((undone, left));
    states
}

/// Returns the possible starts and ends: the snap action, its instance, and the running actions
/// after it.
fn steps_from<'c>(
    case: &'c Case,
    state: &[bool],
    running: &[InstanceId],
) -> Vec<(&'c SnapAction, InstanceId, Vec<InstanceId>)> {
    let mut steps = Vec::new();
    for (id, instance) in case.plan.instances() {
        let (snap, next) = match &instance.action.body {
            Body::Durative(body) if running.contains(&id) => (&*body.end, without(running, id)),
            Body::Durative(body) => {
                let more = running.iter().copied().chain([id]).collect();
                (&*body.start, more)
            }
            Body::Instantaneous(snap) => (snap, running.to_vec()),
        };
        if holds(&snap.condition, state) {
            steps.push((snap, id, next));
        }
    }
    steps
}

/// Returns the value after spontaneous changes of all facts.
fn perturbed(case: &Case, state: &[bool], running: &[InstanceId], left: Left) -> f64 {
    let mut worlds = vec![(Vec::new(), 1.0)];
    for (fact, &is_true) in case.facts().zip(state) {
        let flip = case
            .likelihoods
            .spontaneous_change(&case.task, fact)
            .unwrap();
        let p = flip.after(f64::from(u8::from(is_true)));
        worlds = worlds
            .into_iter()
            .flat_map(|(facts, weight): (Vec<bool>, f64)| {
                [(true, p), (false, 1.0 - p)]
                    .map(|(truth, p)| ([facts.clone(), vec![truth]].concat(), weight * p))
            })
            .filter(|(_, weight)| *weight > 0.0)
            .collect();
    }
    let value = |state: &[bool]| match left.patience {
        Some(patience) if is_dead_end(case, state, running) => {
            let patience = patience - 1;
            let left = Left {
                patience: Some(patience),
                ..left
            };
            if patience == 0 {
                0.0
            } else {
                best(case, state, running, left)
            }
        }
        _ => best(case, state, running, left),
    };
    let worlds = worlds.iter();
    worlds.map(|(state, weight)| weight * value(state)).sum()
}

fn effects(
    case: &Case,
    action: &elbowroom_model::ground::Action,
    snap: &SnapAction,
    state: &[bool],
) -> Vec<(Vec<bool>, f64)> {
    let mut outcomes = vec![(state.to_vec(), 1.0)];
    let mut done = Vec::new();
    for wanted in [false, true] {
        for (fact, makes_true, p) in case.fact_effects(action, snap) {
            if makes_true != wanted || done.contains(&(fact, makes_true)) {
                continue;
            }
            done.push((fact, makes_true));
            outcomes = outcomes
                .into_iter()
                .flat_map(|(state, weight)| {
                    let mut changed = state.clone();
                    changed[fact.index()] = makes_true;
                    [(changed, weight * p), (state, weight * (1.0 - p))]
                })
                .collect();
        }
    }
    outcomes
}

fn holds(condition: &Condition, state: &[bool]) -> bool {
    match condition {
        Condition::Fact(fact) => state[fact.index()],
        Condition::Compare(..) => unreachable!("not drawn"),
        Condition::Not(part) => !holds(part, state),
        Condition::And(parts) => parts.iter().all(|part| holds(part, state)),
        Condition::Or(parts) => parts.iter().any(|part| holds(part, state)),
    }
}

/// Returns all actions for which the likelihoods have an entry, without any order.
fn everything(task: &Arc<Task>, likelihoods: &Likelihoods) -> (Arc<Task>, PartialOrderPlan) {
    let task = (**task).clone();
    let actions: Vec<_> = likelihoods
        .actions
        .keys()
        .map(|(schema, arguments)| task.instantiate(*schema, arguments).unwrap())
        .collect();
    let plan = PartialOrderPlan::unordered(&task, actions);
    (Arc::new(task), plan)
}

/// Returns the move of an agent that searches the best order before each happening.
fn adaptable(dispatch: &mut LayerDispatch, circumstances: &SearchState) -> Move {
    as_move(
        &dispatch
            .choose(circumstances, &mut never_interrupt)
            .unwrap(),
    )
}

fn as_move(choice: &Choice) -> Move {
    match choice {
        Choice::Next(next) => Move::Try(next.node),
        Choice::Abandon(id) => Move::Abandon(*id),
        Choice::GoalReached | Choice::Replan => Move::Stop,
    }
}

#[test]
fn no_executor_beats_optimum_of_published_worlds() {
    for world in shared::sf3().iter().step_by(3).chain(shared::af3().get(5)) {
        let (task, plan) = everything(&world.task, &world.likelihoods);
        let model = Model::new(task, plan.clone(), &world.likelihoods, Semantics::World).unwrap();
        let settings = Settings {
            most_running: 1,
            ..Settings::default()
        };
        let process = Perturbed::new(model.clone(), settings).unwrap();
        let initial = SearchState::initial(&world.task);
        let optimum = process.optimum();
        let best = optimum.value(&process, &initial);
        let followed = process.success_of(&initial, &mut |now, _| optimum.choose(&process, now));
        assert!(
            (best - followed).abs() < 1e-9,
            "{}: {best} {followed}",
            world.name
        );
        let p = process.success_of(&initial, &mut |now, _| {
            let choice = optimum.choice(&process, now, |node| Slot {
                node,
                earliest: now.now.clone(),
                latest: None,
            });
            as_move(&choice)
        });
        assert!((best - p).abs() < 1e-9, "{}: {best} {p}", world.name);
        for semantics in [Semantics::Paper, Semantics::World] {
            let model = Model::new(
                model.task().clone(),
                plan.clone(),
                &world.likelihoods,
                semantics,
            );
            let search = OrderSearch::new(model.unwrap(), SearchSettings::default());
            let mut dispatch = LayerDispatch::new(search, Reconsider::Always);
            let p = process.success_of(&initial, &mut |now, _| adaptable(&mut dispatch, now));
            assert!(p <= best + 1e-9, "{}: {p} {best}", world.name);
            assert!(p > 0.8 * best, "{}: {p} {best}", world.name);
        }
    }
}
