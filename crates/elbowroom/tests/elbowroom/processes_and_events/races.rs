//! Random plans with several changing numbers, whose relation triggers events.

use std::collections::BTreeMap;
use std::fmt::Write;

use elbowroom_num::Rational;
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::processes_and_events::{attack, number, worlds};

/// Returns a domain and a problem in which numbers increase independently from different times on.
/// The events depend on their relation.
fn race(rng: &mut ChaCha8Rng) -> (String, String) {
    let mut domain = "(define (domain d) (:predicates (on0) (on1) (on2) (done0) (done1) (seen))
        (:functions (x0) (x1) (x2)) (:action look :effect (seen))\n"
        .to_owned();
    for index in 0..3 {
        let rate = ["1", "2", "1/2"].choose(rng).expect("some");
        writeln!(
            domain,
            "(:action act{index} :effect (on{index}))
            (:process rise{index} :precondition (on{index})
             :effect (increase (x{index}) (* #t {rate})))"
        )
        .expect("text");
    }
    for index in 0..rng.random_range(1..3) {
        let early = rng.random_range(0..3);
        let late = (early + rng.random_range(1..3)) % 3;
        let (below, above) = (number(rng, 1..=10), number(rng, 1..=10));
        writeln!(
            domain,
            "(:event turn{index} :precondition (and (not (done{index})) (<= (x{early}) {below})
              (> (x{late}) {above})) :effect (done{index}))"
        )
        .expect("text");
    }
    let problem = "(define (problem p) (:domain d) (:init (= (x0) 0) (= (x1) 0) (= (x2) 0))
        (:goal (and (not (done0)) (not (done1)))))";
    (domain + ")", problem.to_owned())
}

/// Returns a plan for such a problem: the starts of the increases, and some happenings in between.
fn plan_of_a_race(rng: &mut ChaCha8Rng) -> (String, String) {
    let (mut fixed, mut open) = (String::new(), String::new());
    let mut starts: Vec<i64> = (0..=16).collect();
    starts.shuffle(rng);
    let actions = ["act0", "act1", "act2", "look", "look", "look"];
    for (index, (start, action)) in starts.into_iter().zip(actions).enumerate() {
        let start = Rational::new(start, 2);
        writeln!(fixed, "{start}: ({action})").expect("text");
        write!(
            open,
            "action instance n{index} : ({action});
            parameter s{index} default {start};
            c: n{index} - .zero in [s{index}, s{index}];\n"
        )
        .expect("text");
    }
    (fixed, open)
}

/// Between two happenings, an event's condition may become true and false again. Only the
/// requirements for the time in between exclude that from boxes.
#[test]
#[allow(clippy::print_stdout, reason = "says what was attacked")]
fn schedules_in_boxes_of_random_races_are_valid() {
    let mut rng = ChaCha8Rng::seed_from_u64(1871);
    let count = attack(worlds(60), &mut rng, race, plan_of_a_race);
    println!("{count:#?}");
    assert!(
        count.inside > count.valid,
        "few boxes are found to be inside"
    );
    assert!(count.broken * 4 > count.valid, "few boxes are too large");
    assert_eq!(count.refused, BTreeMap::new());
    assert_eq!(count.not_proved_at_nominal, 0);
}
