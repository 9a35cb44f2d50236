//! Numbers that are used up, lent out, and replenished.

use std::ops::ControlFlow;

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, Settings, Technique, plan};

use crate::embedded::world::{
    answer, answer_with_self_overlap, answer_without_cleanup, describe, makespan, task,
};

/// A hand-truck pair is lent out for a while; moving the piano takes two of them at once.
#[test]
fn temporarily_lowered_number_is_no_proof_of_shortage() {
    let domain = "
        (:requirements :durative-actions :numeric-fluents)
        (:predicates (moved) (piano)) (:functions (stock) (lent))
        (:durative-action lend :parameters () :duration (= ?duration 9)
          :condition (at start (>= (stock) 1))
          :effect (and (at start (decrease (stock) 1)) (at start (increase (lent) 1))
                       (at end (decrease (lent) 1)) (at end (increase (stock) 1))))
        (:durative-action move :parameters () :duration (= ?duration 4)
          :condition (and (at start (piano)) (at start (>= (lent) 2)) (at end (>= (lent) 1)))
          :effect (at end (moved)))";
    let problem =
        |stock: u32| format!("(:init (piano) (= (stock) {stock}) (= (lent) 0)) (:goal (moved))");
    let together = answer_with_self_overlap(domain, &problem(2));
    assert_eq!(makespan(&together), "9001/1000");
    let alone = answer(domain, &problem(1));
    assert!(alone.found().is_none(), "{}", describe(&alone));
}

/// Returns a problem with a rover on a road of places in a row, with a battery for `capacity`
/// steps. It is charged by one step at a time, only at the rover's initial place in the middle.
/// There is a sample at each end.
fn road(length: usize, capacity: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions :numeric-fluents)
        (:types place) (:predicates (at ?p - place) (next ?p ?q - place) (plug ?p - place)
          (sample ?p - place) (taken ?p - place) (idle))
        (:functions (battery) (capacity))
        (:durative-action drive :parameters (?p ?q - place) :duration (= ?duration 2)
          :condition (and (at start (at ?p)) (at start (next ?p ?q)) (at start (>= (battery) 1)))
          :effect (and (at start (not (at ?p))) (at end (at ?q)) (at start (decrease (battery) 1))))
        (:durative-action charge :parameters (?p - place) :duration (= ?duration 3)
          :condition (and (over all (at ?p)) (at start (plug ?p)) (at start (idle))
            (at start (< (battery) (capacity))))
          :effect (and (at start (not (idle))) (at end (idle)) (at end (increase (battery) 1))))
        (:durative-action take :parameters (?p - place) :duration (= ?duration 1)
          :condition (and (over all (at ?p)) (at start (sample ?p)))
          :effect (and (at start (not (sample ?p))) (at end (taken ?p))))";
    let names: Vec<String> = (0..=2 * length).map(|n| format!("p{n}")).collect();
    let ways: String = names
        .windows(2)
        .map(|two| format!("(next {0} {1})(next {1} {0})", two[0], two[1]))
        .collect();
    let (first, middle, last) = (&names[0], &names[length], &names[2 * length]);
    let problem = format!(
        "(:objects {} - place) (:init (at {middle}) (idle) (plug {middle}) {ways}
          (sample {first}) (sample {last}) (= (battery) 1) (= (capacity) {capacity}))
         (:goal (and (taken {first}) (taken {last})))",
        names.join(" "),
    );
    (domain.to_owned(), problem)
}

#[test]
fn consumption_of_relaxed_plan_is_replenished_before() {
    let (domain, problem) = road(6, 12);
    let answer = answer_without_cleanup(&domain, &problem);
    let Answer::Plan { counts, .. } = &answer else {
        panic!("{}", describe(&answer));
    };
    // Only the accounting of consumption makes the rover charge before it is stranded. Without it,
    // the search takes ten times as many states.
    assert!(counts.evaluated < 150, "{} states", counts.evaluated);
}

/// Returns the number of states to the first plan, without clean-up.
fn states_to_first_plan(domain: &str, problem: &str, without: &[Technique]) -> u64 {
    let task = task(domain, problem);
    let mut settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    settings.tuning.without.push(Technique::Cleanup);
    settings.tuning.without.extend(without);
    let situation = Situation::initial(&task);
    let answer = plan(&task, &situation, &settings, &mut |_| {
        ControlFlow::Continue(())
    });
    let Answer::Plan { counts, .. } = &answer else {
        panic!("{}", describe(&answer));
    };
    counts.evaluated
}

/// The battery drains while the rover drives, and is charged for as long as it takes. Its actions exclude each
/// other.
#[test]
fn continuous_consumption_is_replenished_before() {
    let (domain, problem) = road(8, 20);
    let domain = domain
        .replace(
            "(at start (at ?p)) (at start (next",
            "(at start (idle)) (at start (at ?p)) (at start (next",
        )
        .replace("(at start (>= (battery) 1))", "(over all (>= (battery) 0))")
        .replace(
            "(at start (decrease (battery) 1))",
            "(at start (not (idle))) (at end (idle)) (decrease (battery) (* #t 0.5))",
        )
        .replace(
            ":duration (= ?duration 3)",
            ":duration (and (>= ?duration 1) (<= ?duration 30))",
        )
        .replace(
            "(at start (< (battery) (capacity)))",
            "(over all (<= (battery) (capacity)))",
        )
        .replace(
            "(at end (increase (battery) 1))",
            "(increase (battery) (* #t 1))",
        );
    let count = |without: &[Technique]| states_to_first_plan(&domain, &problem, without);
    let (with, without) = (count(&[]), count(&[Technique::ContinuousDrains]));
    assert!(4 * with < without, "{with} states, {without} without");
}

#[test]
fn too_small_battery_has_no_plan() {
    let (domain, problem) = road(4, 7);
    let answer = answer(&domain, &problem);
    assert!(
        matches!(answer, Answer::Unsolvable { .. }),
        "{}",
        describe(&answer)
    );
}

/// Returns a problem with a laboratory and two robots, which carry samples to benches and
/// instruments. People prepare samples and replenish reagents during shifts; samples are archived
/// at night.
fn laboratory(samples: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals)
        (:types robot place sample - object instrument - place)
        (:predicates (at ?r - robot ?p - place) (free ?r - robot) (staffed) (night) (idle ?i - instrument)
          (lies ?s - sample ?p - place) (holds ?r - robot ?s - sample) (prepared ?s - sample)
          (measured ?s - sample) (archived ?s - sample) (bench ?p - place) (shelf ?p - place))
        (:functions (reagent ?i - instrument) (uses ?s - sample))
        (:durative-action move :parameters (?r - robot ?a ?b - place) :duration (= ?duration 4)
          :condition (and (at start (at ?r ?a)) (at start (free ?r)))
          :effect (and (at start (not (at ?r ?a))) (at end (at ?r ?b))))
        (:durative-action carry :parameters (?r - robot ?s - sample ?a ?b - place) :duration (= ?duration 5)
          :condition (and (at start (at ?r ?a)) (at start (holds ?r ?s)))
          :effect (and (at start (not (at ?r ?a))) (at end (at ?r ?b))))
        (:durative-action pick :parameters (?r - robot ?s - sample ?p - place) :duration (= ?duration 2)
          :condition (and (over all (at ?r ?p)) (at start (free ?r)) (at start (lies ?s ?p)))
          :effect (and (at start (not (free ?r))) (at start (not (lies ?s ?p))) (at end (holds ?r ?s))))
        (:durative-action put :parameters (?r - robot ?s - sample ?p - place) :duration (= ?duration 2)
          :condition (and (over all (at ?r ?p)) (at start (holds ?r ?s)))
          :effect (and (at start (not (holds ?r ?s))) (at end (free ?r)) (at end (lies ?s ?p))))
        (:durative-action prepare :parameters (?s - sample ?p - place) :duration (= ?duration 6)
          :condition (and (over all (staffed)) (over all (lies ?s ?p)) (over all (bench ?p)))
          :effect (at end (prepared ?s)))
        (:durative-action measure :parameters (?s - sample ?i - instrument) :duration (= ?duration 12)
          :condition (and (over all (lies ?s ?i)) (at start (prepared ?s)) (at start (idle ?i))
            (at start (>= (reagent ?i) (uses ?s))))
          :effect (and (at start (not (idle ?i))) (at end (idle ?i)) (at end (measured ?s))
            (at start (decrease (reagent ?i) (uses ?s)))))
        (:durative-action refill :parameters (?i - instrument) :duration (= ?duration 8)
          :condition (and (over all (staffed)) (at start (idle ?i)))
          :effect (and (at start (not (idle ?i))) (at end (idle ?i)) (at end (assign (reagent ?i) 5))))
        (:durative-action archive :parameters (?r - robot ?s - sample ?p - place) :duration (= ?duration 3)
          :condition (and (over all (at ?r ?p)) (over all (shelf ?p)) (at start (holds ?r ?s))
            (at start (measured ?s)) (over all (night)))
          :effect (and (at start (not (holds ?r ?s))) (at end (free ?r)) (at end (archived ?s))))";
    let samples: Vec<String> = (0..samples).map(|n| format!("s{n}")).collect();
    let mut init = String::from("(bench bench) (shelf shelf) ");
    for robot in ["r0", "r1"] {
        init += &format!("(at {robot} entry) (free {robot}) ");
    }
    for (number, sample) in samples.iter().enumerate() {
        init += &format!(
            "(lies {sample} entry) (= (uses {sample}) {}) ",
            2 + number % 3
        );
    }
    for instrument in ["i0", "i1"] {
        init += &format!("(idle {instrument}) (= (reagent {instrument}) 1) ");
    }
    for begin in (0..30).map(|day| 80 * day) {
        let (end, dusk, dawn) = (begin + 41, begin + 31, begin + 79);
        init += &format!("(at {} (staffed)) (at {end} (not (staffed))) ", begin + 1);
        init += &format!("(at {dusk} (night)) (at {dawn} (not (night))) ");
    }
    let archived: String = samples.iter().map(|s| format!("(archived {s}) ")).collect();
    let problem = format!(
        "(:objects r0 r1 - robot entry bench shelf - place i0 i1 - instrument {} - sample) (:init {init})
         (:goal (and {archived} (at r0 entry) (at r1 entry)))",
        samples.join(" "),
    );
    (domain.to_owned(), problem)
}

/// Replenishing in estimates, and estimates alone, leave a search on plateaus here: without the
/// turns of BFWS(f₂) without replenishing, this takes more than 14,000 states.
#[test]
fn novelty_search_escapes_plateaus_without_replenishment() {
    let (domain, problem) = laboratory(10);
    let states = states_to_first_plan(&domain, &problem, &[]);
    assert!(states < 10_000, "{states} states");
}
