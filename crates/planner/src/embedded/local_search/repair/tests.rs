//! Memory accounting of a repair, and its limit.

use std::fmt::Write;

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};

use super::*;
use crate::embedded::testing::compiled;
use crate::embedded::time::NEVER;

/// Returns a task with `count` lamps that must all be lit; a relaxed plan lights each of them.
fn lamps(count: usize) -> Task {
    let domain = "(define (domain lamps) (:requirements :typing :durative-actions)
        (:types lamp) (:predicates (burns ?l - lamp))
        (:durative-action light :parameters (?l - lamp) :duration (= ?duration 2)
          :condition (and) :effect (at end (burns ?l))))";
    let (mut lamps, mut goal) = (String::new(), String::new());
    for lamp in 0..count {
        write!(lamps, " l{lamp}").expect("strings take all");
        write!(goal, " (burns l{lamp})").expect("strings take all");
    }
    let problem = format!(
        "(define (problem all) (:domain lamps) (:objects{lamps} - lamp) (:init) (:goal (and{goal})))"
    );
    let source = |name: &str, text: &str| Source::new(name, text.to_owned());
    let read = read_problem(
        &source("domain.pddl", domain),
        &source("problem.pddl", &problem),
    );
    Task::new(read.expect("it is right").0)
}

/// Searches for a plan without any remaining items under a memory limit. Returns the result and the
/// tree.
fn searched(task: &Task, most_memory: usize) -> (Option<Vec<Item>>, Tree) {
    let compiled = compiled(task);
    let compresses = Some(Compressibility::HoldsResource);
    let mut relaxed = Relaxed::new(&compiled, compresses);
    relaxed.serves_repairs = true;
    relaxed.lists_actions = true;
    let mut stepper = Stepper::new(&compiled);
    stepper.horizon = NEVER;
    let mut ticker = WorkMeter {
        weight: 1,
        work: 0,
        evaluated: 0,
        should_continue: &mut |_, _| true,
        is_stopped: false,
    };
    let mut tree = Tree::default();
    let found = Repair {
        compiled: &compiled,
        stepper: &mut stepper,
        relaxed: &mut relaxed,
        random: &mut Random::new(1),
        remaining: &[],
        costs: &vec![1; compiled.actions.len()],
        next_block: 0,
        compresses,
        most_states: 1000,
        most_memory,
        latest_end: &|_| Some(NEVER),
    }
    .search(&SequenceState::initial(&compiled), &mut tree, &mut ticker);
    (found, tree)
}

/// Recomputes the memory of the tree.
fn counted(tree: &Tree) -> usize {
    let waiting: usize = tree.queue.values().map(Node::size).sum();
    waiting + PLACE_SIZE * tree.nodes.len()
}

#[test]
fn repair_stops_at_memory_limit() {
    let task = lamps(60);
    let (found, whole) = searched(&task, usize::MAX);
    let found = found.expect("lamp by lamp");
    assert_eq!(found.len(), 60);
    assert_eq!(whole.memory, counted(&whole));
    // Each node has a successor for each lamp that is still dark.
    assert!(whole.queue.len() > 1000, "{}", whole.queue.len());
    let largest = whole.queue.values().map(Node::size).max().unwrap_or(0);
    for most in [0, 10_000, 100_000, whole.memory / 2] {
        let (found, tree) = searched(&task, most);
        assert_eq!(found, None, "with {most} bytes");
        assert_eq!(tree.memory, counted(&tree));
        assert!(tree.memory > most, "it went on for as long as it might");
        // One node beyond the limit, and the one that was being expanded.
        assert!(
            tree.memory <= most + 3 * largest,
            "{} of {most}",
            tree.memory
        );
    }
}
