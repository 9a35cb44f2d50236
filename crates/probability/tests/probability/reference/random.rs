//! Small random problems with all kinds of conditions and effects.

use std::fmt::Write;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Change, FactId, SnapAction};
use elbowroom_model::problem::{PredicateId, SchemaId};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId, PartialOrderPlan};
use elbowroom_probability::likelihoods::{
    FailureModel, Outcome, OutcomeChange, PartialChange, Success,
};
use elbowroom_probability::{Likelihoods, Running, SearchState};
use rand::Rng;
use rand::seq::IndexedRandom;

/// Features that may occur.
#[allow(clippy::struct_excessive_bools, reason = "each is a taste of its own")]
#[derive(Clone, Copy)]
pub(crate) struct Taste {
    pub(crate) facts: usize,
    pub(crate) actions: usize,
    /// Disjunctions, derived facts, conditional effects.
    pub(crate) couples: bool,
    pub(crate) negations: bool,
    /// Few conditions, so that many orders are possible.
    pub(crate) is_easy: bool,
    pub(crate) timed: bool,
    pub(crate) numbers: bool,
}

pub(crate) struct Case {
    pub(crate) text: String,
    pub(crate) task: Arc<Task>,
    pub(crate) plan: PartialOrderPlan,
    pub(crate) likelihoods: Likelihoods,
    pub(crate) circumstances: SearchState,
}

impl Case {
    /// Returns all facts.
    pub(crate) fn facts(&self) -> impl Iterator<Item = FactId> {
        let count = u32::try_from(self.task.fact_count()).expect("a small case");
        (0..count).map(FactId)
    }

    /// Returns the effects of a snap action on facts: the fact, `true` if it becomes true, and the
    /// probability that the effect takes place.
    pub(crate) fn fact_effects(
        &self,
        action: &Action,
        snap: &SnapAction,
    ) -> Vec<(FactId, bool, f64)> {
        let changes = snap
            .effects
            .iter()
            .filter_map(|effect| match effect.change {
                Change::Add(fact) => Some((fact, true)),
                Change::Delete(fact) => Some((fact, false)),
                Change::Update { .. } => None,
            });
        let likely = |(fact, makes_true)| {
            let likelihood = self
                .likelihoods
                .effect(&self.task, action, fact, makes_true);
            (
                fact,
                makes_true,
                likelihood.expect("a case has all of them"),
            )
        };
        changes.map(likely).collect()
    }
}

pub(crate) fn case(rng: &mut impl Rng, taste: Taste) -> Case {
    let (domain, problem, plan) = texts(rng, taste);
    let (task, plan) = crate::shared::read_task(&domain, &problem, &plan);
    let likelihoods = likelihoods(rng, &task);
    let circumstances = circumstances(rng, &task, &plan);
    Case {
        text: format!("{domain}\n{problem}"),
        task: Arc::new(task),
        plan,
        likelihoods,
        circumstances,
    }
}

fn texts(rng: &mut impl Rng, taste: Taste) -> (String, String, String) {
    let mut domain = "(define (domain d) (:predicates".to_owned();
    for fact in 0..taste.facts {
        let _ = write!(domain, " (f{fact})");
    }
    let derived = if taste.couples { " (d)" } else { "" };
    let _ = write!(domain, "{derived}) (:functions (n))");
    if taste.couples {
        let condition = condition(
            rng,
            Taste {
                couples: false,
                ..taste
            },
            2,
        );
        let other = literal(rng, taste);
        let _ = write!(domain, "\n(:derived (d) (or {condition} {other}))");
    }
    let mut plan = String::new();
    for action in 0..taste.actions {
        if rng.random_bool(0.2) {
            let (needs, does) = (condition(rng, taste, 2), effects(rng, taste));
            let _ = write!(
                domain,
                "\n(:action a{action} :precondition {needs} :effect (and {does}))"
            );
            let _ = writeln!(plan, "{action}: (a{action})");
            continue;
        }
        let duration = rng.random_range(1..4);
        let mut conditions = String::new();
        for when in ["at start", "over all", "at end"] {
            if rng.random_bool(if taste.is_easy { 0.3 } else { 0.6 }) {
                let _ = write!(conditions, "({when} {})", condition(rng, taste, 2));
            }
        }
        let mut does = String::new();
        for when in ["at start", "at end"] {
            let _ = write!(does, "({when} (and {}))", effects(rng, taste));
        }
        if taste.couples && rng.random_bool(0.5) {
            let guards = ["at start", "over all", "at end"];
            let guards = guards
                .choose_multiple(rng, 2)
                .fold(String::new(), |mut all, when| {
                    let _ = write!(all, "({when} {})", literal(rng, taste));
                    all
                });
            let effect = change(rng, taste);
            let _ = write!(does, "(when (and {guards}) (at end {effect}))");
        }
        let _ = write!(
            domain,
            "\n(:durative-action a{action} :parameters () :duration (= ?duration {duration})
              :condition (and {conditions}) :effect (and {does}))"
        );
        let _ = writeln!(plan, "{action}: (a{action}) [{duration}]");
    }
    domain.push(')');
    let mut init = format!("(= (n) {})", rng.random_range(0..3));
    for fact in 0..taste.facts {
        if rng.random_bool(0.6) {
            let _ = write!(init, "(f{fact})");
        }
    }
    if taste.timed {
        let (time, change) = (rng.random_range(1..8), change(rng, taste));
        let _ = write!(init, "(at {time} {change})");
    }
    let goal = if taste.is_easy {
        literal(rng, taste)
    } else {
        condition(rng, taste, 2)
    };
    let problem = format!("(define (problem p) (:domain d) (:init {init}) (:goal (and {goal})))");
    (domain, problem, plan)
}

fn literal(rng: &mut impl Rng, taste: Taste) -> String {
    let fact = rng.random_range(0..taste.facts);
    if taste.negations && rng.random_bool(0.3) {
        format!("(not (f{fact}))")
    } else {
        format!("(f{fact})")
    }
}

fn condition(rng: &mut impl Rng, taste: Taste, depth: usize) -> String {
    let kind = rng.random_range(0..10);
    if taste.couples && depth > 0 && kind < 3 {
        let (one, two) = (
            condition(rng, taste, depth - 1),
            condition(rng, taste, depth - 1),
        );
        return format!("(or {one} {two})");
    }
    if taste.couples && kind == 3 {
        return if rng.random_bool(0.5) {
            "(d)"
        } else {
            "(not (d))"
        }
        .to_owned();
    }
    if depth > 0 && kind < 6 {
        let (one, two) = (
            condition(rng, taste, depth - 1),
            condition(rng, taste, depth - 1),
        );
        return format!("(and {one} {two})");
    }
    if taste.numbers && kind == 9 {
        return format!("(>= (n) {})", rng.random_range(0..3));
    }
    literal(rng, taste)
}

fn change(rng: &mut impl Rng, taste: Taste) -> String {
    let fact = rng.random_range(0..taste.facts);
    if rng.random_bool(0.3) {
        format!("(not (f{fact}))")
    } else {
        format!("(f{fact})")
    }
}

fn effects(rng: &mut impl Rng, taste: Taste) -> String {
    let mut text = String::new();
    for _ in 0..rng.random_range(0..3) {
        let change = change(rng, taste);
        if taste.couples && rng.random_bool(0.3) {
            let _ = write!(text, "(when {} {change})", condition(rng, taste, 1));
        } else {
            text.push_str(&change);
        }
    }
    if taste.numbers && rng.random_bool(0.4) {
        let update = ["(increase (n) 1)", "(decrease (n) 1)", "(assign (n) 2)"];
        text.push_str(update.choose(rng).unwrap());
    }
    text
}

/// Generates a probability; the extremes are frequent.
fn probability(rng: &mut impl Rng) -> f64 {
    match rng.random_range(0..6) {
        0 => 0.0,
        1 => 1.0,
        _ => rng.random_range(0.0..1.0),
    }
}

fn likelihoods(rng: &mut impl Rng, task: &Task) -> Likelihoods {
    let mut likelihoods = Likelihoods::default();
    for index in 0..task.problem().predicates.len() {
        let flip = PartialChange {
            becomes_true: Some(probability(rng) * 0.5),
            becomes_false: Some(probability(rng) * 0.6),
            ..PartialChange::default()
        };
        likelihoods
            .predicates
            .insert(PredicateId::from(index), flip);
    }
    for index in 0..task.problem().schemas.len() {
        let mut success = Success {
            start: Some(rng.random_range(0.3..=1.0)),
            ..Success::default()
        };
        for predicate in 0..task.problem().predicates.len() {
            let predicate = PredicateId::from(predicate);
            success.effects.insert(predicate, probability(rng));
            if rng.random_bool(0.5) {
                success.deletions.insert(predicate, probability(rng));
            }
        }
        likelihoods.schemas.insert(SchemaId::from(index), success);
    }
    likelihoods
}

/// Returns the case with actions that fail at their ends.
pub(crate) fn with_failing_ends(rng: &mut impl Rng, mut case: Case) -> Case {
    for success in case.likelihoods.schemas.values_mut() {
        success.failing = FailureModel {
            end: Some(match rng.random_range(0..5) {
                0 => 1.0,
                1 => 0.0,
                _ => rng.random_range(0.3..1.0),
            }),
            undone: [None, Some(true), Some(false)]
                .choose(rng)
                .copied()
                .flatten(),
            ..FailureModel::default()
        };
    }
    case
}

/// Returns the case with one or two outcomes of each failure, if there are enough facts.
pub(crate) fn with_outcomes(rng: &mut impl Rng, mut case: Case) -> Case {
    let predicates: Vec<PredicateId> = (0..case.task.problem().predicates.len())
        .map(PredicateId::from)
        .filter(|predicate| !case.task.problem().predicates[predicate.index()].is_derived)
        .collect();
    for success in case.likelihoods.schemas.values_mut() {
        let mut left = 1.0;
        let count = rng.random_range(1..3);
        let outcomes = (0..count).map(|_| {
            let probability = left * [0.5, 0.7, 1.0].choose(rng).unwrap();
            left -= probability;
            let chosen: Vec<_> = predicates.choose_multiple(rng, 2).copied().collect();
            let changes = chosen.into_iter().map(|predicate| OutcomeChange {
                predicate,
                arguments: Vec::new(),
                becomes: rng.random_bool(0.5),
            });
            Outcome {
                probability,
                changes: changes.collect(),
            }
        });
        success.failing.outcomes = Some(outcomes.collect());
    }
    case
}

/// Returns the case with actions that fail while they are running.
pub(crate) fn failing_in_time(rng: &mut impl Rng, mut case: Case) -> Case {
    for success in case.likelihoods.schemas.values_mut() {
        success.failing.during_per_second = Some(probability(rng) * 0.2);
    }
    case
}

/// Returns the case with facts that also change with time.
pub(crate) fn in_time(rng: &mut impl Rng, mut case: Case) -> Case {
    for flip in case.likelihoods.predicates.values_mut() {
        flip.becomes_true_per_second = Some(probability(rng) * 0.2);
        flip.becomes_false_per_second = Some(probability(rng) * 0.3);
    }
    case
}

fn circumstances(rng: &mut impl Rng, task: &Task, plan: &PartialOrderPlan) -> SearchState {
    let mut circumstances = SearchState::initial(task);
    for index in 0..task.fact_count() {
        if rng.random_bool(0.2) {
            let fact = elbowroom_model::ground::FactId(u32::try_from(index).unwrap());
            if !task.is_derived(fact) {
                circumstances.belief.set(fact, rng.random_range(0.0..1.0));
            }
        }
    }
    for (id, instance) in plan.instances() {
        if instance.action.durative().is_some() && rng.random_bool(0.15) {
            circumstances.running.push(Running {
                instance: id,
                start: Rational::ZERO,
            });
        }
    }
    circumstances
}

/// Generates a random order with the ends of all running actions.
pub(crate) fn order(rng: &mut impl Rng, case: &Case) -> Vec<NodeId> {
    let mut running: Vec<InstanceId> = case
        .circumstances
        .running
        .iter()
        .map(|r| r.instance)
        .collect();
    let mut unused: Vec<InstanceId> = case
        .plan
        .instances()
        .map(|(id, _)| id)
        .filter(|id| !running.contains(id) && rng.random_bool(0.8))
        .collect();
    let node = |what: Node| {
        let place = case.plan.nodes.iter().position(|&node| node == what);
        place.map(NodeId::from)
    };
    let mut timed: Vec<usize> = (0..case.task.timed().len()).rev().collect();
    let mut order = Vec::new();
    while !running.is_empty() || !unused.is_empty() {
        if !timed.is_empty() && rng.random_bool(0.2) {
            order.extend(timed.pop().and_then(|index| node(Node::Timed(index))));
        }
        let is_start = running.is_empty() || (!unused.is_empty() && rng.random_bool(0.5));
        if is_start {
            let id = unused.remove(rng.random_range(0..unused.len()));
            match node(Node::Start(id)) {
                Some(start) => {
                    running.push(id);
                    order.push(start);
                }
                None => order.extend(node(Node::Instant(id))),
            }
        } else {
            let id = running.remove(rng.random_range(0..running.len()));
            order.extend(node(Node::End(id)));
        }
    }
    order
}
