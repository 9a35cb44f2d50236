//! Labels of parameters: names, kinds, actions and descriptions.

use super::*;

const DOMAIN: &str = "(define (domain harbour)
  (:requirements :strips :typing :durative-actions :fluents :timed-initial-literals)
  (:types boat) (:predicates (tide) (Clear ?b - boat) (clear_red) (moored ?b - boat))
  (:functions (fuel ?b - boat) (draught))
  (:durative-action sail :parameters (?b - boat) :duration (= ?duration 6)
    :condition (and (at start (>= (fuel ?b) 1)) (over all (tide)) (over all (clear ?b)) (over all (clear_red))
      (at start (<= (draught) 8)))
    :effect (at end (moored ?b))))";

const PROBLEM: &str = "(define (problem spring) (:domain harbour) (:objects red blue - boat)
  (:init (tide) (clear red) (clear blue) (clear_red) (= (fuel red) 4) (= (fuel blue) 5) (= (draught) 5)
    (at 20 (not (tide))) (at 30 (tide)) (at 40 (not (tide))) (at 41 (not (clear red))) (at 42 (not (clear_red)))
    (at 43 (not (clear blue))) (at 44 (not (clear blue))) (at 44 (= (draught) 4)))
  (:goal (and (moored red) (moored blue))))";

const PLAN: &str = "0: (sail red) [6]\n7: (sail blue) [6]\n";

const VARY: [&str; 8] = [
    "durations",
    "timed (tide)",
    "deadline (CLEAR red)",
    "deadline (clear_red)",
    "deadline (clear blue)",
    "initial (fuel red)",
    "initial (fuel blue)",
    "initial (draught)",
];

const LABELS: [&str; 4] = ["name", "kind", "action", "quantity"];

/// Sets the label of a parameter. The certificate also contains names.
fn set(answer: &mut Value, parameter: usize, label: &str, to: &Value) {
    answer["parameters"][parameter][label] = to.clone();
    if label == "name" {
        answer["best"]["certificate"]["parameters"][parameter]["name"] = to.clone();
    }
}

fn genuine(objective: Objective) -> (Arc<Task>, TimeTriggeredPlan, Value) {
    let (task, plan) = read(DOMAIN, PROBLEM, PLAN);
    let answer = answer_for(&task, &plan, (Guarantee::Dynamic, objective), &VARY).expect("a box");
    let verdict = verify_answer_of(&answer.to_string(), &task, &plan);
    verdict.unwrap_or_else(|wrong| panic!("{objective:?}: {wrong}"));
    (task, plan, answer)
}

#[test]
fn swapped_labels_are_refused() {
    for objective in OBJECTIVES {
        let (task, plan, answer) = genuine(objective);
        let own = |parameter: usize, label: &str| answer["parameters"][parameter][label].clone();
        let names: Vec<Value> = (0..12).map(|parameter| own(parameter, "name")).collect();
        assert!(names.contains(&json!("timed_tide_3")), "{names:?}");
        assert!(names.contains(&json!("deadline_clear_red_2")), "{names:?}");
        let (mut count, labels) = (0, LABELS.len());
        for one in 0..names.len() {
            for other in one + 1..names.len() {
                for chosen in 1..1_usize << labels {
                    let mut broken = answer.clone();
                    let chosen = (0..labels).filter(|label| chosen >> label & 1 == 1);
                    for label in chosen.map(|label| LABELS[label]) {
                        set(&mut broken, one, label, &own(other, label));
                        set(&mut broken, other, label, &own(one, label));
                    }
                    let is_same = |label: &str| own(one, label) == broken["parameters"][one][label];
                    if LABELS.iter().all(|label| is_same(label)) {
                        continue;
                    }
                    count += 1;
                    let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
                    let what = format!("{} and {}", names[one], names[other]);
                    assert!(verdict.is_err(), "{what}");
                }
            }
        }
        assert!(count > 500, "{count}");
    }
}

#[test]
fn false_labels_are_refused() {
    let (task, plan, answer) = genuine(Objective::LeastSlack);
    let words = [
        "dur_7",
        "dur_0",
        "timed_tide",
        "timed_clear_green",
        "initial_draught",
        "timed",
        "duration",
        "(sail red)",
        "duration of (sail red)",
        "initial (draught)",
    ];
    for parameter in 0..answer["parameters"].as_array().expect("a list").len() {
        for (label, word) in LABELS
            .iter()
            .flat_map(|label| words.map(|word| (label, json!(word))))
        {
            let mut broken = answer.clone();
            set(&mut broken, parameter, label, &word);
            if broken != answer {
                let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
                assert!(
                    verdict.is_err(),
                    "parameter {parameter} has the {label} {word}"
                );
            }
        }
    }
}

#[test]
fn inconsistent_weight_is_refused() {
    let (task, plan, answer) = genuine(Objective::LeastSlack);
    for (told, proved) in [("2", "1"), ("1", "2"), ("0", "0"), ("-1", "-1")] {
        let mut broken = answer.clone();
        broken["parameters"][0]["weight"] = json!({ "exact": told });
        broken["best"]["certificate"]["parameters"][0]["weight"] = json!(proved);
        let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
        assert!(verdict.is_err(), "{told} and {proved}");
    }
}

#[test]
fn symmetric_box_with_an_infinite_end_is_refused() {
    let (task, plan) = read(DOMAIN, PROBLEM, PLAN);
    for objective in [Objective::LeastSlack, Objective::Widths] {
        let mut request = request(&task, &plan, (Guarantee::Dynamic, objective));
        request.vary = vec!["initial (fuel blue)".parse().expect("a specification")];
        request.search.best.symmetric = true;
        request.search.best.max_deviation = elbowroom::num::Rational::new(1, 2);
        let answer = answered(&request).expect("a box");
        let verdict = verify_answer_of(&answer.to_string(), &task, &plan);
        verdict.unwrap_or_else(|wrong| panic!("{objective:?}: {wrong}"));
        let certificate = &answer["best"]["certificate"];
        assert_eq!(certificate["sound"]["endless"], json!([]));
        for ends in [&["lower"][..], &["upper"], &["lower", "upper"]] {
            let mut broken = answer.clone();
            for end in ends {
                let infinite = if *end == "upper" { "inf" } else { "-inf" };
                broken["parameters"][0][end] = json!({ "exact": infinite, "decimal": null });
            }
            let endless = ends.iter().map(|end| json!({ "parameter": 0, "end": end }));
            broken["best"]["certificate"]["sound"]["endless"] = endless.collect();
            let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
            assert!(
                matches!(verdict, Err(AnswerError::Flaw(_))),
                "{ends:?}: {verdict:?}"
            );
        }
    }
}
