//! Each search of the portfolio by itself, and the portfolio without each technique.

use std::ops::ControlFlow;

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, Member, Settings, Technique, Tuning, plan};

use crate::embedded::world::{describe, task};

/// Returns a problem with a shelf that is one cell wide and `depth` deep, and a crane in front of
/// it. Boxes have to fill the shelf, so the deepest cell comes first: a box in a cell blocks the
/// cells behind it.
pub(crate) fn shelf(depth: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions)
        (:types place box) (:predicates (crane ?p - place) (next ?p ?q - place) (free ?p - place)
          (shelf ?p - place) (at ?b - box ?p - place) (held ?b - box) (empty) (stored ?b - box))
        (:durative-action move :parameters (?p ?q - place) :duration (= ?duration 1)
          :condition (and (at start (crane ?p)) (over all (next ?p ?q)) (at start (free ?q)))
          :effect (and (at start (not (crane ?p))) (at start (not (free ?q))) (at start (free ?p))
                       (at end (crane ?q))))
        (:durative-action lift :parameters (?b - box ?from ?p - place) :duration (= ?duration 2)
          :condition (and (over all (crane ?p)) (over all (next ?p ?from)) (at start (empty))
                          (at start (at ?b ?from)))
          :effect (and (at start (not (empty))) (at start (not (at ?b ?from)))
                       (at start (not (stored ?b))) (at end (free ?from)) (at end (held ?b))))
        (:durative-action drop :parameters (?b - box ?to ?p - place) :duration (= ?duration 2)
          :condition (and (over all (crane ?p)) (over all (next ?p ?to)) (at start (held ?b))
                          (at start (free ?to)) (over all (shelf ?to)))
          :effect (and (at start (not (held ?b))) (at start (not (free ?to))) (at end (at ?b ?to))
                       (at end (stored ?b)) (at end (empty))))";
    let cells: Vec<String> = (0..depth).map(|n| format!("c{n}")).collect();
    let boxes: Vec<String> = (0..depth).map(|n| format!("b{n}")).collect();
    let mut init = String::from("(crane gate) (empty) ");
    let mut row = vec!["gate".to_owned()];
    row.extend(cells.iter().cloned());
    for two in row.windows(2) {
        init += &format!("(next {0} {1})(next {1} {0})", two[0], two[1]);
    }
    for (cell, item) in cells.iter().zip(&boxes) {
        init += &format!("(free {cell})(shelf {cell})");
        init += &format!("(at {item} lot-{item})(next gate lot-{item})");
    }
    let lots: Vec<String> = boxes.iter().map(|item| format!("lot-{item}")).collect();
    let goal: String = boxes
        .iter()
        .map(|item| format!("(stored {item})"))
        .collect();
    let problem = format!(
        "(:objects gate {} {} - place {} - box) (:init {init}) (:goal (and {goal}))",
        cells.join(" "),
        lots.join(" "),
        boxes.join(" "),
    );
    (domain.to_owned(), problem)
}

/// Returns the first plan within `states` states.
fn found(domain: &str, problem: &str, tuning: Tuning, states: u64) -> Answer {
    let task = task(domain, problem);
    let situation = Situation::initial(&task);
    let settings = Settings {
        first_plan_only: true,
        tuning,
        ..Settings::default()
    };
    plan(&task, &situation, &settings, &mut |progress| {
        if progress.counts.evaluated > states {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

#[test]
fn each_search_finds_a_plan_by_itself() {
    let (domain, problem) = shelf(2);
    for &(member, name) in Member::ALL {
        let mut tuning = Tuning::default();
        tuning.only = Some(member);
        let answer = found(&domain, &problem, tuning, 20_000);
        assert!(answer.found().is_some(), "{name}: {}", describe(&answer));
    }
}

#[test]
fn plan_is_found_without_each_technique() {
    let (domain, problem) = shelf(3);
    for &(technique, name) in Technique::ALL {
        let mut tuning = Tuning::default();
        tuning.without.push(technique);
        let answer = found(&domain, &problem, tuning, 20_000);
        assert!(answer.found().is_some(), "{name}: {}", describe(&answer));
    }
}

/// The shelf must be filled from its end, which relaxed plans do not represent.
#[test]
fn novelty_search_fills_shelf_from_its_end() {
    let (domain, problem) = shelf(6);
    let mut tuning = Tuning::default();
    tuning.only = Some(Member::Width);
    let answer = found(&domain, &problem, tuning, 5_000);
    assert!(answer.found().is_some(), "{}", describe(&answer));
}

/// With any technique switched off, a full shelf holds no further box, and no plan is reported.
#[test]
fn overfull_shelf_is_unsolvable_without_any_technique() {
    let (domain, problem) = shelf(1);
    let more = problem
        .replace("b0 - box", "b0 spare - box")
        .replace("(:init ", "(:init (at spare lot-b0) ")
        .replace("(stored b0)", "(stored b0) (stored spare)");
    for &(technique, name) in Technique::ALL {
        let mut tuning = Tuning::default();
        tuning.without.push(technique);
        let answer = found(&domain, &more, tuning, 20_000);
        assert!(
            matches!(answer, Answer::Unsolvable { .. }),
            "{name}: {}",
            describe(&answer)
        );
    }
}

/// Relations that no action and no rule achieves stay false for all intervals.
#[test]
fn unachievable_goal_is_proved_unreachable() {
    let domain = "
        (:requirements :typing :durative-actions) (:types interval)
        (:predicates (started ?i - interval) (ended ?i - interval) (before ?i ?j - interval))
        (:functions (length ?i - interval))
        (:durative-action apply :parameters (?i - interval) :duration (= ?duration (length ?i))
          :effect (and (at start (started ?i)) (at end (ended ?i))))";
    let problem = "(:objects i j - interval) (:init (= (length i) 5) (= (length j) 5))
        (:goal (before i j))";
    let answer = found(domain, problem, Tuning::default(), 1_000);
    assert_eq!(
        describe(&answer),
        "no plan exists: `(before i j)` cannot become true"
    );
}
