//! Checks on small random plans that the final order of the search ends as early as the earliest of
//! all orders, each replayed through the states of the planner.

use std::fmt::Write;

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};

use super::super::super::apply::Stepper;
use super::super::super::compile::{Compiled, NONE};
use super::super::super::search::is_goal;
use super::super::super::testing::compiled_with;
use super::super::super::time::{NEVER, Ticks};
use super::super::super::tuning::{Technique, Tuning};
use super::super::incumbent::Incumbent;
use super::super::random::Random;
use super::super::sequence::{Item, Kind, SequenceState};
use super::super::{WorkMeter, incumbent};
use super::Scheduling;

/// Elements of a random problem.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each may be there or not")]
struct Kinds {
    has_facts: bool,
    has_numbers: bool,
    has_timed: bool,
    /// Conditions on a fact that only timed initials change.
    has_calendar: bool,
    /// Over-all conditions on numbers.
    has_numbers_throughout: bool,
}

const ACTIONS: usize = 4;
const FACTS: usize = 3;

/// Adds some literals with this time specifier.
fn literals(random: &mut Random, when: &str, most: usize, text: &mut String) {
    for _ in 0..random.below(most + 1) {
        let fact = random.below(FACTS);
        let literal = if random.once_in(3) {
            format!("(not (p{fact}))")
        } else {
            format!("(p{fact})")
        };
        write!(text, " ({when} {literal})").expect("strings take all");
    }
}

fn numbers(random: &mut Random, kinds: Kinds, text: &mut (String, String)) {
    let (conditions, effects) = text;
    let amount = 1 + random.below(2);
    match random.below(4) {
        // A renewable resource.
        0 => {
            write!(conditions, " (at start (>= (n) {amount}))").expect("strings take all");
            write!(
                effects,
                " (at start (decrease (n) {amount})) (at end (increase (n) {amount}))"
            )
            .expect("strings take all");
        }
        // A producer, and a consumer that is at its limit before or after.
        1 => write!(effects, " (at end (increase (n) {amount}))").expect("strings take all"),
        2 => {
            write!(conditions, " (at end (>= (n) 1))").expect("strings take all");
            write!(effects, " (at end (decrease (n) {amount}))").expect("strings take all");
        }
        _ => {}
    }
    if random.once_in(4) {
        let most = 1 + random.below(3);
        write!(conditions, " (at start (<= (n) {most}))").expect("strings take all");
    }
    if kinds.has_numbers_throughout && random.once_in(2) {
        write!(conditions, " (over all (>= (n) 0))").expect("strings take all");
    }
}

fn random_task(random: &mut Random, kinds: Kinds) -> Task {
    let (mut predicates, mut actions, mut init) = (String::new(), String::new(), String::new());
    for fact in 0..FACTS {
        write!(predicates, " (p{fact})").expect("strings take all");
        if random.once_in(2) {
            write!(init, " (p{fact})").expect("strings take all");
        }
    }
    if kinds.has_timed {
        let fact = random.below(FACTS);
        let (first, second) = (1 + random.below(5), 7 + random.below(6));
        write!(
            init,
            " (at {first} (p{fact})) (at {second} (not (p{fact})))"
        )
        .expect("strings take all");
    }
    if kinds.has_calendar {
        predicates += " (c)";
        let mut time = 0;
        for change in 0..2 + random.below(5) {
            time += 1 + random.below(5);
            let literal = if change % 2 == 0 { "(c)" } else { "(not (c))" };
            write!(init, " (at {time} {literal})").expect("strings take all");
        }
        write!(init, " (at {} (c))", time + 3).expect("strings take all");
    }
    for action in 0..ACTIONS {
        let (mut conditions, mut effects) = (String::new(), String::new());
        if kinds.has_calendar && random.once_in(2) {
            let when = ["at start", "over all", "at end"][random.below(3)];
            write!(conditions, " ({when} (c))").expect("strings take all");
        }
        if kinds.has_facts {
            literals(random, "at start", 1, &mut conditions);
            literals(random, "over all", 1, &mut conditions);
            literals(random, "at end", 1, &mut conditions);
            literals(random, "at start", 1, &mut effects);
            literals(random, "at end", 2, &mut effects);
        }
        if kinds.has_numbers {
            let mut text = (conditions, effects);
            numbers(random, kinds, &mut text);
            (conditions, effects) = text;
        }
        let duration = 1 + random.below(5);
        write!(
            actions,
            "(:durative-action a{action} :parameters () :duration (= ?duration {duration})
               :condition (and{conditions}) :effect (and{effects} (at end (done{action}))))"
        )
        .expect("strings take all");
        write!(predicates, " (done{action})").expect("strings take all");
    }
    let number = 1 + random.below(3);
    let goal = if random.once_in(2) { "(p0)" } else { "" };
    let domain = format!(
        "(define (domain random) (:requirements :durative-actions :negative-preconditions
           :timed-initial-literals :numeric-fluents)
           (:predicates{predicates}) (:functions (n)) {actions})"
    );
    let problem = format!(
        "(define (problem one) (:domain random) (:init (= (n) {number}){init})
           (:goal (and (done0) {goal})))"
    );
    let source = |name: &str, text: &str| Source::new(name, text.to_owned());
    let read = read_problem(
        &source("domain.pddl", &domain),
        &source("problem.pddl", &problem),
    );
    Task::new(read.expect("it is right").0)
}

/// Returns the possible next items: all actions that have not been tried, the ends of running
/// actions, and the next timed initials.
fn next_items(compiled: &Compiled, scene: &SequenceState, rest: &[Item]) -> Vec<Item> {
    let is_open = |item: &Item| scene.open.contains(&item.block);
    let mut next: Vec<Item> = Vec::new();
    for item in rest {
        let is_next = match item.kind {
            Kind::End => is_open(item),
            Kind::Timed => !next.contains(item),
            Kind::Start | Kind::Whole => true,
        };
        if is_next
            && (item.kind != Kind::Timed || (scene.state.timed as usize) < compiled.timed.len())
        {
            next.push(*item);
        }
    }
    next
}

/// Returns a random plan: items in an applicable order.
fn random_plan(compiled: &Compiled, random: &mut Random) -> Option<Vec<Item>> {
    let mut rest = Vec::new();
    for (block, action) in (0..).zip(0..compiled.actions.len()) {
        let action = u32::try_from(action).expect("a few");
        let kind = match compiled.action(action).end {
            NONE => Kind::Whole,
            _ => Kind::Start,
        };
        rest.push(Item {
            kind,
            action,
            block,
        });
    }
    let starts = rest.clone();
    let ends = starts.iter().filter(|item| item.kind == Kind::Start);
    rest.extend(ends.map(|item| Item {
        kind: Kind::End,
        ..*item
    }));
    rest.extend(compiled.timed.iter().map(|_| Item::TIMED));
    let mut stepper = Stepper::new(compiled);
    let mut scene = SequenceState::initial(compiled);
    let mut items = Vec::new();
    for _ in 0..60 {
        let next = next_items(compiled, &scene, &rest);
        let Some(&item) = random.of(&next) else { break };
        if let Some(after) = scene.after(&mut stepper, item) {
            scene = after;
            items.push(item);
            let place = rest.iter().position(|other| *other == item)?;
            rest.remove(place);
        }
    }
    is_goal(compiled, &scene.state).then_some(items)
}

/// Computes the earliest end of all orders of these items.
fn earliest(compiled: &Compiled, scene: &SequenceState, rest: &mut Vec<Item>, best: &mut Ticks) {
    if scene.state.earliest_end() >= *best {
        return;
    }
    if rest.is_empty() {
        if is_goal(compiled, &scene.state) {
            *best = scene.state.earliest_end();
        }
        return;
    }
    let mut stepper = Stepper::new(compiled);
    for item in next_items(compiled, scene, rest) {
        if let Some(after) = scene.after(&mut stepper, item) {
            let place = rest
                .iter()
                .position(|other| *other == item)
                .expect("it is there");
            rest.remove(place);
            earliest(compiled, &after, rest, best);
            rest.insert(place, item);
        }
    }
}

/// Returns the end of the final order of scheduling, or `None` if it does not support the plan.
fn scheduled(compiled: &Compiled, incumbent: Incumbent, target: Ticks) -> Option<Ticks> {
    let mut ticker = WorkMeter {
        weight: 1,
        work: 0,
        evaluated: 0,
        should_continue: &mut |_, _| true,
        is_stopped: false,
    };
    let mut best = incumbent;
    let mut scheduling = Scheduling::of(compiled, &best.items, best.cost.end, &mut ticker)?;
    while !scheduling.is_over {
        let Some(items) = scheduling.next(1_000_000, &mut ticker) else {
            continue;
        };
        let better = Incumbent::of(compiled, &items).expect("an order is a plan");
        assert!(better.cost.end < best.cost.end, "{items:?}");
        assert!(better.cost.end >= target);
        scheduling.demand(&better.items, better.cost.end);
        best = better;
    }
    Some(best.cost.end)
}

/// Returns the number of plans compared, and the number of those with a better order.
fn compare(kinds: Kinds, seeds: std::ops::Range<u64>) -> (usize, usize) {
    let (mut compared, mut improved) = (0, 0);
    for seed in seeds {
        let mut random = Random::new(seed);
        let task = random_task(&mut random, kinds);
        let mut tuning = Tuning::default();
        tuning.without.push(Technique::Relevance);
        let Some(compiled) = compiled_with(&task, &tuning) else {
            continue;
        };
        let plans = (0..8).filter_map(|_| random_plan(&compiled, &mut random));
        let Some(items) = plans.max_by_key(Vec::len) else {
            continue;
        };
        let incumbent = incumbent::Incumbent::of(&compiled, &items).expect("it was played");
        let mut best = NEVER;
        let mut rest = incumbent.items.clone();
        earliest(
            &compiled,
            &SequenceState::initial(&compiled),
            &mut rest,
            &mut best,
        );
        let before = incumbent.cost.end;
        assert!(best <= before);
        let found = scheduled(&compiled, incumbent, best).expect("a plan that it takes");
        assert_eq!(found, best, "seed {seed} of {kinds:?}: {items:?}");
        compared += 1;
        improved += usize::from(best < before);
    }
    (compared, improved)
}

const FACTS_ALONE: Kinds = Kinds {
    has_facts: true,
    has_numbers: false,
    has_timed: false,
    has_calendar: false,
    has_numbers_throughout: false,
};

#[test]
fn schedule_with_facts_is_optimal() {
    let (compared, improved) = compare(FACTS_ALONE, 0..300);
    assert!(compared > 100 && improved > 30, "{compared} {improved}");
}

#[test]
fn schedule_with_timed_initials_is_optimal() {
    let kinds = Kinds {
        has_timed: true,
        ..FACTS_ALONE
    };
    let (compared, improved) = compare(kinds, 0..300);
    assert!(compared > 60 && improved > 20, "{compared} {improved}");
}

#[test]
fn schedule_with_calendars_is_optimal() {
    for has_timed in [false, true] {
        let kinds = Kinds {
            has_timed,
            has_calendar: true,
            ..FACTS_ALONE
        };
        let (compared, improved) = compare(kinds, 0..300);
        assert!(compared > 60 && improved > 20, "{compared} {improved}");
    }
}

#[test]
fn schedule_with_numbers_is_optimal() {
    for has_facts in [false, true] {
        let kinds = Kinds {
            has_facts,
            has_numbers: true,
            ..FACTS_ALONE
        };
        let (compared, improved) = compare(kinds, 0..200);
        assert!(compared > 50 && improved > 25, "{compared} {improved}");
    }
}

#[test]
fn schedule_with_over_all_numbers_is_optimal() {
    let kinds = Kinds {
        has_facts: false,
        has_numbers: true,
        has_numbers_throughout: true,
        ..FACTS_ALONE
    };
    let (compared, improved) = compare(kinds, 0..200);
    assert!(compared > 50 && improved > 25, "{compared} {improved}");
}
