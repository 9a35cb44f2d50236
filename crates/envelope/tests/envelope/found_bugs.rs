//! Bugs of the box check, most of them found by the second oracle, and former limitations, each as
//! a small case.

use elbowroom_envelope::obligations::Refusal;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, NodeId, ParameterId, Side};

use crate::given::{Given, envelope, oracle};

#[test]
fn a_fact_deleted_and_added_at_once_stays_true_inside_an_action() {
    let given = Given {
        domain: "(:durative-action wait :parameters () :duration (>= ?duration 0)
                    :condition (over all (p)) :effect (and))
                 (:action renew :parameters () :precondition (and)
                    :effect (and (not (p)) (p)))",
        init: "(p)",
        plan: "durative-action instance n : (wait); action instance r : (renew);
               c: n.end - n.start in [3, inf]; c: r - n.start in [1, 2];",
        ..Given::default()
    };
    assert_eq!(given.answer(""), "inside");
}

#[test]
fn a_proof_about_a_multiplied_parameter_holds_for_its_own_box_only() {
    let given = Given {
        domain: "(:synth-parameters ?s)
                 (:durative-action fill :parameters () :duration (= ?duration 3)
                    :condition (over all (<= (x) 8)) :effect (increase (x) (* #t ?s)))",
        plan: "parameter ?s default 1; durative-action instance n : (fill);
               c: n.end - n.start in [3, 3];",
        ..Given::default()
    };
    assert_eq!(
        given.answers(&["[1, 1]", "[1, 2]"]),
        ["inside", "(fill) needs (<= (x) 8) throughout"]
    );
}

#[test]
fn parameter_on_two_constraints_may_be_unlimited() {
    let given = Given {
        domain: "(:action first :parameters () :precondition (and) :effect (and))
                 (:action second :parameters () :precondition (and) :effect (and))",
        plan: "parameter g default 5;
               action instance a : (first); action instance b : (second);
               c: b - a in [-inf, g]; c: b - .zero in [-inf, g];",
        ..Given::default()
    };
    assert_eq!(given.answer("[5, inf]"), "inside");
    assert_eq!(given.answer("[-inf, 5]"), "no schedule");
}

#[test]
fn a_counterexample_to_separation_has_the_happenings_close_together() {
    let given = Given {
        domain: "(:action set :parameters () :precondition (and) :effect (p))
                 (:action look :parameters () :precondition (or (p) (q)) :effect (and))",
        init: "(p)",
        plan: "action instance s : (set); action instance l : (look);
               c: s - .zero in [2, inf];",
        ..Given::default()
    };
    let found = given.counterexample("");
    assert!((&found.schedule[NodeId(1)] - &found.schedule[NodeId(2)]).abs() < Rational::new(1, 4));
}

#[test]
fn a_counterexample_at_an_infinite_end_has_a_value_far_enough_out() {
    let given = Given {
        domain: "(:synth-parameters ?s)
                 (:durative-action fill :parameters () :duration (= ?duration 3)
                    :condition (over all (<= (x) 8)) :effect (increase (x) (* #t ?s)))",
        plan: "parameter ?s default 1; durative-action instance n : (fill);
               c: n.end - n.start in [3, 3];",
        ..Given::default()
    };
    let found = given.counterexample("[1, inf]");
    let duration = &found.moment.unwrap() - &found.schedule[NodeId(1)];
    assert!(Rational::from(5) + &found.valuation[ParameterId(0)] * duration > Rational::from(8));
}

#[test]
fn parameter_in_bound_and_effect_is_one_quantity() {
    let given = Given {
        domain: "(:synth-parameters ?s)
                 (:durative-action burn :parameters () :duration (>= ?duration 0)
                    :effect (and (at start (increase (x) ?s))
                                 (at end (decrease (x) ?duration))))",
        goal: "(>= (x) 5)",
        plan: "parameter ?s default 3; durative-action instance n : (burn);
               c: n.end - n.start in [1, ?s];",
        ..Given::default()
    };
    assert_eq!(given.answer("[1, 4]"), "inside");
}

#[test]
fn two_numbers_that_a_parameter_multiplies_are_not_decided_at_corners() {
    // At the end (x) is 5 + 3s and (y) is 5 - 3s: the condition fails for s = 1, not for 0 and 2.
    let given = Given {
        domain: "(:synth-parameters ?s)
                 (:durative-action mix :parameters () :duration (= ?duration 3)
                    :condition (over all (not (and (> (x) 7.5) (> (y) 1.5))))
                    :effect (and (increase (x) (* #t ?s)) (decrease (y) (* #t ?s))))",
        plan: "parameter ?s default 0; durative-action instance n : (mix);
               c: n.end - n.start in [3, 3];",
        ..Given::default()
    };
    let (task, plan) = given.task_and_plan();
    let refusal = oracle(&task, &plan).unwrap_err();
    assert_eq!(
        refusal,
        Refusal::Coupled {
            name: "?s".to_owned()
        }
    );
}

#[test]
fn undefined_condition_and_its_negation_both_fail() {
    let with = |condition: &str| {
        let domain =
            format!("(:action look :parameters () :precondition {condition} :effect (and))");
        let given = Given {
            domain: &domain,
            init: "(p)",
            plan: "action instance l : (look);",
            ..Given::default()
        };
        given.answer("")
    };
    assert_eq!(with("(< (z) 1)"), "(look) needs (< (z) 1)");
    assert_eq!(with("(not (< (z) 1))"), "(look) needs (not (< (z) 1))");
    assert_eq!(with("(or (p) (< (z) 1))"), "inside");
    assert_eq!(with("(not (and (not (p)) (< (z) 1)))"), "inside");
}

#[test]
fn continuous_change_requires_defined_value() {
    let given = Given {
        domain: "(:durative-action fill :parameters () :duration (= ?duration 3)
                    :effect (increase (z) (* #t 1)))",
        plan: "durative-action instance n : (fill); c: n.end - n.start in [3, 3];",
        ..Given::default()
    };
    assert_eq!(
        given.answer(""),
        "start of (fill) needs a number that has no value"
    );
}

#[test]
fn happening_must_not_change_number_in_two_ways() {
    let given = Given {
        domain: "(:action set :parameters () :precondition (and)
                    :effect (and (assign (x) 3) (increase (x) 1)))",
        plan: "action instance s : (set);",
        ..Given::default()
    };
    assert_eq!(
        given.answer(""),
        "(set) must not change (x) in several ways at the same time"
    );
}

#[test]
fn a_box_away_from_the_nominal_values_may_have_its_own_order() {
    let given = Given {
        domain: "(:action set :parameters () :precondition (and) :effect (p))
                 (:action look :parameters () :precondition (or (p) (q)) :effect (and))",
        init: "(p)",
        plan: "parameter x default 0;
               action instance s : (set); action instance l : (look);
               c: s - .zero in [2, 2]; c: l - .zero in [x, x]; c: l - s in [-inf, 9];",
        ..Given::default()
    };
    let boxes = [
        "[0, 1]",
        "[9/4, 11]",
        "[0, 4]",
        "[0, 7/4]",
        "[10, 12]",
        "[12, 13]",
    ];
    assert_eq!(
        given.answers(&boxes),
        [
            "inside",
            "inside",
            "(set) must come before (look), by at least ε",
            "inside",
            "no schedule",
            "no schedule"
        ]
    );
}

#[test]
fn moved_timed_initials_may_swap() {
    let given = Given {
        domain: "(:action look :parameters () :precondition (and) :effect (and))",
        init: "(q) (at 2 (p)) (at 4 (not (q)))",
        goal: "(or (p) (q))",
        plan: "action instance l : (look); c: l - .zero in [5, 5];",
        vary: &["timed p"],
    };
    // The goal is evaluated after both, whichever is the last.
    assert_eq!(given.answer("[2, 6]"), "inside");
    // A condition is evaluated on arrival.
    let given = Given {
        domain: "(:action look :parameters () :precondition (or (p) (q)) :effect (and))",
        goal: "",
        ..given
    };
    assert_eq!(given.answer("[2, 4.75]"), "inside");
    assert_eq!(
        given.answer("[2, 6]"),
        "timed initials at 2 must come before (look), by at least ε"
    );
}

#[test]
fn proofs_of_refused_box_are_not_reused_for_accepted_box() {
    // The duration is at most the lesser of ?a and ?b, and must be at most 10.
    let given = Given {
        domain: "(:synth-parameters ?a ?b ?c)
                 (:durative-action wait :parameters () :duration (<= ?duration 10)
                    :effect (at end (increase (x) ?c)))",
        goal: "(<= (x) 10)",
        plan: "parameter ?a default 8; parameter ?b default 8; parameter ?c default 1;
               durative-action instance n : (wait);
               c: n.end - n.start in [1, ?a]; c: n.end - n.start in [1, ?b];",
        ..Given::default()
    };
    let (task, plan) = given.task_and_plan();
    let mut oracle = oracle(&task, &plan).unwrap();
    let accepted = envelope("[8, 8] [8, 20] [1, 1]");
    assert_eq!(oracle.start(&accepted), Ok(None));
    let elsewhere = envelope("[8, 20] [8, 8] [1, 30]");
    assert_ne!(oracle.objection(&elsewhere), Ok(None));
    let a = BoxEnd {
        parameter: plan.find("?a").unwrap(),
        side: Side::Upper,
    };
    assert_eq!(oracle.try_reach(a, Some(Rational::from(12))), Ok(false));
    assert_eq!(oracle.accepted(), Some(&accepted));
}

#[test]
fn order_may_change_in_box_without_nominal_values() {
    let given = Given {
        domain: "(:action set :parameters () :precondition (and) :effect (p))
                 (:action look :parameters () :precondition (or (p) (q)) :effect (and))",
        init: "(q)",
        plan: "parameter g default 5; action instance s : (set); action instance l : (look);
               c: s - .zero in [10, 10]; c: l - s in [g, g];",
        ..Given::default()
    };
    assert_eq!(
        given.answers(&["[5, 5]", "[-6, -5]", "[-6, 5]", "[1, 5]"]),
        [
            "inside",
            "inside",
            "(look) must come before (set), by at least ε",
            "inside"
        ]
    );
}

#[test]
fn timed_initials_may_be_close_to_each_other() {
    let given = Given {
        domain: "(:action look :parameters () :precondition (p) :effect (and))",
        init: "(at 2 (not (p))) (at 2.1 (p))",
        plan: "action instance l : (look); c: l - .zero in [5, 6];",
        ..Given::default()
    };
    assert_eq!(given.answer(""), "inside");
}

#[test]
fn a_parameter_times_itself_is_not_decided_at_corners() {
    // (x) becomes s²: 64 at both ends of [-8, 8], and 0 between. For "below 50", the ends decide.
    let squared = |condition: &str| {
        let domain = format!(
            "(:synth-parameters ?s)
             (:durative-action square :parameters () :duration (= ?duration 3)
                :condition (at end ({condition} (x) 50))
                :effect (at start (assign (x) (* ?s ?s))))"
        );
        let given = Given {
            domain: &domain,
            plan: "parameter ?s default 7; durative-action instance n : (square);
                   c: n.end - n.start in [3, 3];",
            ..Given::default()
        };
        let (task, plan) = given.task_and_plan();
        let oracle = oracle(&task, &plan);
        oracle.map(|_| given.answers(&["[-7, 7]", "[-8, 7]"]))
    };
    assert_eq!(
        squared(">=").unwrap_err(),
        Refusal::Coupled {
            name: "?s".to_owned()
        }
    );
    assert_eq!(
        squared("<=").unwrap(),
        ["inside", "end of (square) needs (<= (x) 50)"]
    );
}

#[test]
fn a_counterexample_to_separation_has_the_happenings_in_order() {
    // The reverse order with a large distance is harmless, so it is not a counterexample.
    let given = Given {
        domain: "(:action clear :parameters () :precondition (and) :effect (not (p)))",
        init: "(at 17/2 (p))",
        plan: "parameter g default 9; action instance c : (clear);
               c: c - .zero in [g, inf];",
        ..Given::default()
    };
    let found = given.counterexample("[8, 9]");
    let gap = &found.schedule[NodeId(1)] - Rational::new(17, 2);
    assert!(!gap.is_negative() && gap < Rational::new(1, 4));
}

#[test]
fn fixed_minimum_besides_open_duration_needs_no_corner_search() {
    // Twenty sequential actions, each at least 1 long, with a deadline for all: small and large
    // durations are violations, but each small one independently.
    let count = 20;
    let each = |line: &dyn Fn(usize) -> String| (0..count).map(line).collect::<Vec<_>>().concat();
    let text = [
        each(&|i| format!("parameter d{i} default 2; durative-action instance n{i} : (wait);")),
        each(&|i| format!("c: n{i}.end - n{i}.start in [d{i}, d{i}];")),
        each(&|i| format!("c: n{i}.end - n{i}.start in [1, inf];")),
        each(&|i| match i {
            0 => String::new(),
            _ => format!("c: n{i}.start - n{}.end in [0, inf];", i - 1),
        }),
        "c: n19.end - .zero in [-inf, 50];".to_owned(),
    ]
    .concat();
    let given = Given {
        domain: "(:durative-action wait :parameters () :duration (>= ?duration 0) :effect (and))",
        plan: &text,
        ..Given::default()
    };
    let all_but_first = |first: &str| format!("{first}{}", " [1, 2]".repeat(count - 1));
    let boxes = ["[1, 12]", "[1, 25/2]", "[1/2, 2]", "[1, inf]", "[-inf, 2]"].map(all_but_first);
    assert_eq!(
        given.answers(&boxes.each_ref().map(String::as_str)),
        [
            "inside",
            "no schedule",
            "no schedule",
            "no schedule",
            "no schedule"
        ]
    );
}

#[test]
fn thirty_durations_whose_sum_has_a_least_and_a_greatest_value() {
    // There would be 2^30 corners, but only two of them matter.
    let actions: Vec<String> = (0..30)
        .map(|index| {
            let follows = match index {
                0 => String::new(),
                _ => format!("c: a{index}.start - a{}.end in [0, 0];", index - 1),
            };
            format!(
                "parameter d{index} default 2; durative-action instance a{index} : (go);
                 c: a{index}.end - a{index}.start in [d{index}, d{index}]; {follows}"
            )
        })
        .collect();
    let plan = format!("{} c: a29.end - a0.start in [30, 90];", actions.concat());
    let given = Given {
        domain: "(:durative-action go :parameters () :duration (>= ?duration 0) :effect (and))",
        plan: &plan,
        ..Given::default()
    };
    let answers = given.answers(&[
        &"[1, 3] ".repeat(30),
        &format!("{}[1, 7/2]", "[1, 3] ".repeat(29)),
        &format!("[1/2, 3] {}", "[1, 3] ".repeat(29)),
        &format!("[1/2, 3] [3/2, 3] {}", "[1, 3] ".repeat(28)),
    ]);
    assert_eq!(answers, ["inside", "no schedule", "no schedule", "inside"]);
}
