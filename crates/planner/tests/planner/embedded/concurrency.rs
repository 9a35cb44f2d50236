//! Plans with required concurrency, including minimum durations of overlap.

use std::ops::ControlFlow;

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, Counts, Member, Settings, Technique, Tuning, plan};

use crate::embedded::world::{answer, answer_without_cleanup, describe, task};

/// Returns the answer with this tuning, within `states` states.
fn tuned(domain: &str, problem: &str, tuning: Tuning, states: u64) -> Answer {
    let task = task(domain, problem);
    let settings = Settings {
        first_plan_only: true,
        tuning,
        ..Settings::default()
    };
    plan(
        &task,
        &Situation::initial(&task),
        &settings,
        &mut |progress| {
            if progress.counts.evaluated > states {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    )
}

/// Returns the counts of a search that found a plan.
fn counts(answer: &Answer) -> Counts {
    match answer {
        Answer::Plan { counts, .. } => *counts,
        _ => panic!("{}", describe(answer)),
    }
}

fn names(letter: char, count: usize) -> Vec<String> {
    (0..count).map(|n| format!("{letter}{n}")).collect()
}

fn each(names: &[String], text: impl Fn(&str) -> String) -> String {
    names.iter().map(|name| text(name)).collect()
}

/// Sheets are pressed one at a time. A sheet is handed over hot, within a moment, and cools for
/// five minutes; before it is cold the same press must have begun to emboss it.
fn embossing(sheets: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions) (:types sheet)
        (:predicates (free) (blank ?s - sheet) (handed ?s - sheet) (pressed ?s - sheet)
          (cooling ?s - sheet) (begun ?s - sheet) (embossed ?s - sheet))
        (:durative-action press :parameters (?s - sheet) :duration (= ?duration 4)
          :condition (and (at start (free)) (at start (blank ?s)) (at end (handed ?s)))
          :effect (and (at start (not (free))) (at start (not (blank ?s)))
                       (at end (free)) (at end (pressed ?s))))
        (:durative-action hand :parameters (?s - sheet) :duration (= ?duration 0.01)
          :condition (and (over all (handed ?s)) (at end (pressed ?s)) (at end (cooling ?s)))
          :effect (and (at start (handed ?s)) (at end (not (handed ?s)))))
        (:durative-action cool :parameters (?s - sheet) :duration (= ?duration 5)
          :condition (and (at start (handed ?s)) (at end (begun ?s)))
          :effect (at start (cooling ?s)))
        (:durative-action emboss :parameters (?s - sheet) :duration (= ?duration 4)
          :condition (and (at start (free)) (at start (pressed ?s)))
          :effect (and (at start (not (free))) (at start (begun ?s))
                       (at end (free)) (at end (embossed ?s))))";
    let sheets = names('s', sheets);
    let problem = format!(
        "(:objects {} - sheet) (:init (free) {}) (:goal (and {}))",
        sheets.join(" "),
        each(&sheets, |s| format!("(blank {s})")),
        each(&sheets, |s| format!("(embossed {s})")),
    );
    (domain.to_owned(), problem)
}

#[test]
fn step_before_expiring_fact_is_not_postponed() {
    let (domain, problem) = embossing(9);
    let answer = answer_without_cleanup(&domain, &problem);
    let evaluated = counts(&answer).evaluated;
    assert!(evaluated < 4_000, "{evaluated} states");
}

/// Pots are glazed while they are fired; some take longer than the small fire burns. Two pots are
/// joined into a jug, any two, but few jugs are asked for.
fn pottery(pots: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions) (:types pot)
        (:predicates (hot) (firing ?p - pot) (fired ?p - pot) (glazed ?p - pot)
          (thick ?p - pot) (thin ?p - pot) (jug ?p ?q - pot))
        (:durative-action small-fire :parameters () :duration (= ?duration 8)
          :effect (and (at start (hot)) (at end (not (hot)))))
        (:durative-action large-fire :parameters () :duration (= ?duration 20)
          :effect (and (at start (hot)) (at end (not (hot)))))
        (:durative-action fire-thin :parameters (?p - pot) :duration (= ?duration 5)
          :condition (and (at start (thin ?p)) (over all (hot)))
          :effect (and (at start (firing ?p)) (at end (not (firing ?p))) (at end (fired ?p))))
        (:durative-action fire-thick :parameters (?p - pot) :duration (= ?duration 15)
          :condition (and (at start (thick ?p)) (over all (hot)))
          :effect (and (at start (firing ?p)) (at end (not (firing ?p))) (at end (fired ?p))))
        (:durative-action glaze :parameters (?p - pot) :duration (= ?duration 1)
          :condition (over all (firing ?p)) :effect (at end (glazed ?p)))
        (:durative-action join :parameters (?p ?q - pot) :duration (= ?duration 1)
          :condition (and (over all (fired ?p)) (over all (glazed ?p))
                          (over all (fired ?q)) (over all (glazed ?q)))
          :effect (at end (jug ?p ?q)))";
    let pots = names('p', pots);
    let (thin, thick) = pots.split_at(pots.len() / 2);
    let jugs = thin.iter().zip(thick);
    let problem = format!(
        "(:objects {} - pot) (:init {} {}) (:goal (and {}))",
        pots.join(" "),
        each(thin, |p| format!("(thin {p})")),
        each(thick, |p| format!("(thick {p})")),
        jugs.map(|(p, q)| format!("(jug {p} {q})"))
            .collect::<String>(),
    );
    (domain.to_owned(), problem)
}

#[test]
fn content_longer_than_envelope_is_not_nested() {
    let (domain, problem) = pottery(24);
    let answer = answer_without_cleanup(&domain, &problem);
    let evaluated = counts(&answer).evaluated;
    assert!(evaluated < 1_000, "{evaluated} states");
}

#[test]
fn unneeded_jugs_are_eliminated() {
    let (domain, problem) = pottery(24);
    let actions = counts(&answer(&domain, &problem)).actions;
    // Two fires; firing and glazing of each pot; twelve jugs.
    assert_eq!(actions, 2 + 24 + 24 + 12);
}

/// Jars with lids that stay open for some time are filled from cans, a cup at a time, and shipped.
/// Shipped jars, and jars that wait for shipping, are not opened again. All cans together hold just
/// enough.
fn filling(cans: &[usize], jars: &[usize]) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions :numeric-fluents :negative-preconditions)
        (:types vessel - object can jar - vessel)
        (:predicates (shut ?v - vessel) (shipped ?v - vessel) (waiting ?v - vessel))
        (:functions (cups ?v - vessel))
        (:durative-action open :parameters (?v - vessel) :duration (= ?duration 5)
          :condition (and (at start (shut ?v)) (at end (not (shut ?v))))
          :effect (and (at start (not (shut ?v))) (at end (shut ?v))))
        (:durative-action fill :parameters (?c - can ?j - jar) :duration (= ?duration 1)
          :condition (and (at start (>= (cups ?c) 1)) (at start (not (shipped ?c)))
            (at start (not (shipped ?j))) (over all (not (shut ?c))) (over all (not (shut ?j))))
          :effect (and (at start (decrease (cups ?c) 1)) (at end (increase (cups ?j) 1))))
        (:durative-action ship :parameters (?v - vessel) :duration (= ?duration 3)
          :condition (and (at start (shut ?v)) (at start (not (waiting ?v))) (over all (shut ?v)))
          :effect (and (at start (waiting ?v)) (at end (shipped ?v))))";
    let can_names = names('c', cans.len());
    let jar_names = names('j', jars.len());
    let cups = |names: &[String], cups: &[usize]| -> String {
        let pairs = names.iter().zip(cups);
        pairs
            .map(|(name, cups)| format!("(= (cups {name}) {cups})"))
            .collect()
    };
    let both: Vec<String> = can_names.iter().chain(&jar_names).cloned().collect();
    let problem = format!(
        "(:objects {} - can {} - jar) (:init {} {} {}) (:goal (and {} {}))",
        can_names.join(" "),
        jar_names.join(" "),
        each(&both, |v| format!("(shut {v})")),
        cups(&can_names, cans),
        each(&jar_names, |j| format!("(= (cups {j}) 0)")),
        cups(&jar_names, jars),
        each(&both, |v| format!("(shipped {v})")),
    );
    (domain.to_owned(), problem)
}

#[test]
fn a_can_that_is_still_needed_is_not_shipped() {
    let (domain, problem) = filling(&[4, 2, 5, 1], &[5, 2, 1, 4]);
    let answer = answer_without_cleanup(&domain, &problem);
    let evaluated = counts(&answer).evaluated;
    assert!(evaluated < 10_000, "{evaluated} states");
}

#[test]
fn compressing_search_keeps_needed_facts() {
    let cups: Vec<usize> = (0..8).map(|n| 1 + n % 3).collect();
    let (domain, problem) = filling(&cups, &cups);
    let mut tuning = Tuning::default();
    tuning.only = Some(Member::Compressing);
    let with = tuned(&domain, &problem, tuning.clone(), 1_000);
    assert!(with.found().is_some(), "{}", describe(&with));
    tuning.without.push(Technique::Consumables);
    let without = tuned(&domain, &problem, tuning, 1_000);
    assert!(without.found().is_none(), "{}", describe(&without));
}

/// One descent of a single search leads to the goal. If it is interrupted on the way, it has to
/// wait for all others.
#[test]
fn progressing_search_keeps_its_turn() {
    let (domain, problem) = pottery(40);
    let evaluated = |patience: u64| {
        let mut tuning = Tuning::default();
        tuning.without.push(Technique::Serialization);
        tuning.first_round_with_concurrency = 65;
        tuning.patience = patience;
        counts(&tuned(&domain, &problem, tuning, 50_000)).evaluated
    };
    let (with, without) = (evaluated(128), evaluated(0));
    assert!(2 * with < without, "{with} and {without} states");
}

#[test]
fn cans_that_hold_too_little_fill_no_jar() {
    let (domain, problem) = filling(&[2], &[3]);
    let answer = answer(&domain, &problem);
    assert!(answer.found().is_none(), "{}", describe(&answer));
}

/// Porters carry parcels from rooms to a hall. Each door can be held open at any time, for as long as two porters
/// need to pass one after the other.
fn doors(rooms: usize) -> (String, String) {
    let domain = "
        (:requirements :typing :durative-actions) (:types porter room door parcel)
        (:predicates (in ?p - porter ?r - room) (free ?p - porter) (joins ?d - door ?a ?b - room) (shut ?d - door)
          (open ?d - door) (lies ?x - parcel ?r - room) (carries ?p - porter ?x - parcel))
        (:durative-action hold :parameters (?d - door) :duration (= ?duration 5)
          :condition (at start (shut ?d))
          :effect (and (at start (not (shut ?d))) (at start (open ?d))
                       (at end (not (open ?d))) (at end (shut ?d))))
        (:durative-action pass :parameters (?p - porter ?d - door ?a ?b - room) :duration (= ?duration 2)
          :condition (and (at start (in ?p ?a)) (at start (free ?p)) (over all (open ?d)) (over all (joins ?d ?a ?b)))
          :effect (and (at start (not (in ?p ?a))) (at start (not (free ?p)))
                       (at end (in ?p ?b)) (at end (free ?p))))
        (:action take :parameters (?p - porter ?x - parcel ?r - room)
          :precondition (and (in ?p ?r) (free ?p) (lies ?x ?r) (not (exists (?y - parcel) (carries ?p ?y))))
          :effect (and (not (lies ?x ?r)) (carries ?p ?x)))
        (:action drop :parameters (?p - porter ?x - parcel ?r - room)
          :precondition (and (in ?p ?r) (free ?p) (carries ?p ?x))
          :effect (and (lies ?x ?r) (not (carries ?p ?x))))";
    let rooms: Vec<usize> = (0..rooms).collect();
    let each =
        |text: &dyn Fn(usize) -> String| -> String { rooms.iter().map(|&n| text(n)).collect() };
    let problem = format!(
        "(:objects p q - porter hall {} - room {} - door {} - parcel)
         (:init (in p hall) (in q hall) (free p) (free q) {})
         (:goal (and {}))",
        each(&|n| format!("r{n} ")),
        each(&|n| format!("d{n} ")),
        each(&|n| format!("x{n} ")),
        each(&|n| format!(
            "(shut d{n}) (joins d{n} hall r{n}) (joins d{n} r{n} hall) (lies x{n} r{n}) "
        )),
        each(&|n| format!("(lies x{n} hall) ")),
    );
    (domain.to_owned(), problem)
}

#[test]
fn envelope_starts_together_with_its_content() {
    let (domain, problem) = doors(6);
    let mut tuning = Tuning::default();
    tuning.only = Some(Member::Width);
    let with = tuned(&domain, &problem, tuning.clone(), 10_000);
    let with = counts(&with).evaluated;
    assert!(with < 500, "{with} states");
    tuning.without.push(Technique::Macros);
    let without = tuned(&domain, &problem, tuning, 20 * with);
    assert!(without.found().is_none(), "{}", describe(&without));
}

/// Two mends must share the light of one match, so that no envelope has a single content.
#[test]
fn contents_that_share_an_envelope_are_found() {
    let domain = "
        (:requirements :typing :durative-actions) (:types fuse)
        (:predicates (match) (light) (mended ?f - fuse))
        (:durative-action strike :parameters () :duration (= ?duration 8)
          :condition (at start (match))
          :effect (and (at start (not (match))) (at start (light)) (at end (not (light)))))
        (:durative-action mend :parameters (?f - fuse) :duration (= ?duration 5)
          :condition (over all (light))
          :effect (at end (mended ?f)))";
    let problem = "(:objects f g - fuse) (:init (match)) (:goal (and (mended f) (mended g)))";
    let answer = tuned(domain, problem, Tuning::default(), 10_000);
    assert!(answer.found().is_some(), "{}", describe(&answer));
    for member in [Member::Landmarks, Member::Width, Member::Serializing] {
        let mut tuning = Tuning::default();
        tuning.only = Some(member);
        let answer = tuned(domain, problem, tuning, 10_000);
        assert!(
            !matches!(answer, Answer::Unsolvable { .. }),
            "{}",
            describe(&answer)
        );
    }
}
