//! Conditions on numbers that change continuously.

use super::world::{World, number};

fn drain(condition: &str) -> World {
    World::new("(= x 10)").durative("a", &[("rate", "x -1"), ("over all", condition)])
}

#[test]
fn continuous_change_is_complete_on_arrival_at_end() {
    let world = World::new("(= x 0)")
        .durative("a", &[("rate", "x 2"), ("end", "(= x 6)")])
        .goal("(= x 6)");
    assert_eq!(world.judge("1: a [3]"), "valid");
}

#[test]
fn an_over_all_condition_fails_between_happenings() {
    assert_eq!(drain("(>= x 4)").judge("0: a [6]"), "valid");
    assert_eq!(
        drain("(>= x 4)").judge("0: a [7.5]"),
        "just after 6.000: (a) needs (>= (x) 4) over all: (x) = 2.5, short by 1.5"
    );
}

#[test]
fn at_the_ends_of_the_interval_a_strict_comparison_may_be_an_equality() {
    assert_eq!(drain("(> x 4)").judge("0: a [6]"), "valid");
    assert_eq!(drain("(< x 10)").judge("0: a [6]"), "valid");
    assert_eq!(
        drain("(> x 4)").judge("0: a [6.5]"),
        "at 6.000: (a) needs (> (x) 4) over all: (x) = 4, not strictly so"
    );
}

#[test]
fn at_a_happening_in_between_the_state_after_it_counts() {
    let world = drain("(> x 4)").instant("refill", "", "(increase x 5)");
    assert_eq!(world.judge("0: a [8]\n6: refill"), "valid");
    let world = drain("(> x 4)").instant("tick", "", "(p)");
    assert_eq!(
        world.judge("0: a [8]\n6: tick"),
        "at 6.000: (a) needs (> (x) 4) over all: (x) = 4, not strictly so"
    );
}

#[test]
fn equation_holds_only_while_numbers_are_constant() {
    assert_eq!(
        drain("(= x 10)").judge("0: a [1]"),
        "just after 0.000: (a) needs (= (x) 10) over all: (x) = 9, off by 1"
    );
    let world = World::new("(= x 1) (= y 1)")
        .durative("a", &[("rate", "x 2 y 2"), ("over all", "(= x y)")]);
    assert_eq!(world.judge("0: a [5]"), "valid");
}

#[test]
fn different_disjuncts_may_hold_at_different_times() {
    assert_eq!(drain("(or (>= x 6) (<= x 6))").judge("0: a [8]"), "valid");
    assert_eq!(
        drain("(or (> x 6) (< x 6))").judge("0: a [8]"),
        "at 4.000: (a) needs (or (> (x) 6) (< (x) 6)) over all: (x) = 6, not strictly so; \
         (x) = 6, not strictly so"
    );
    assert_eq!(
        drain("(or (>= x 6) (<= x 5))").judge("0: a [8]"),
        "just after 4.000: (a) needs (or (>= (x) 6) (<= (x) 5)) over all: (x) = 5.5, \
         short by 0.5; (x) = 5.5, short by 0.5"
    );
}

#[test]
fn rates_of_actions_that_overlap_add_up() {
    let world = World::new("(= x 10)")
        .durative("use", &[("rate", "x -2"), ("over all", "(>= x 0)")])
        .durative("fill", &[("rate", "x 3")]);
    assert_ne!(world.judge("0: use [10]"), "valid");
    assert_eq!(world.judge("0: use [10]\n5: fill [4]"), "valid");
}

#[test]
fn a_rate_may_read_a_fluent_that_jumps() {
    let world = World::new("(= x 0) (= speed 1)")
        .durative("a", &[("rate", "x speed")])
        .instant("faster", "", "(increase speed 1)")
        .goal("(= x 15)");
    assert_eq!(world.judge("0: a [10]\n5: faster"), "valid");
}

#[test]
fn rate_can_read_continuously_changing_fluent() {
    let world = World::new("(= x 0) (= v 0)")
        .durative("a", &[("rate", "x v v 2"), ("over all", "(< x 25)")])
        .goal("(= x 25)");
    assert_eq!(world.judge("0: a [5]"), "valid");
    assert_eq!(
        world.judge("0: a [6]"),
        "at 5.000: (a) needs (< (x) 25) over all: (x) = 25, not strictly so"
    );
}

#[test]
fn an_irrational_moment_is_found_to_within_a_millionth() {
    let world = World::new("(= x 0) (= v 0)")
        .durative("a", &[("rate", "x v v 2"), ("over all", "(<= x 2)")]);
    let text = world.judge("0: a [3]");
    assert!(text.starts_with("just after about 1.41421"), "{text}");
    assert_eq!(world.judge("0: a [1.414213]"), "valid");
    assert_ne!(world.judge("0: a [1.414214]"), "valid");
}

#[test]
fn product_of_changing_fluents_is_validated() {
    let world = World::new("(= x 0) (= y 4)")
        .durative("a", &[("rate", "x 1 y -1"), ("over all", "(<= (* x y) 4)")]);
    assert_eq!(world.judge("0: a [4]"), "valid");
    let world = World::new("(= x 0) (= y 4)")
        .durative("a", &[("rate", "x 1 y -1"), ("over all", "(< (* x y) 4)")]);
    assert_eq!(
        world.judge("0: a [4]"),
        "at 2.000: (a) needs (< (* (x) (y)) 4) over all: (x) = 2, (y) = 2, not strictly so"
    );
}

#[test]
fn exponential_change_is_undecided() {
    let world = World::new("(= x 1)").durative("a", &[("rate", "x x")]);
    assert_eq!(
        world.judge("2: a [4]"),
        "undecided: at 2.000: nonlinear change: the rate of (x) depends on (x) itself, so its \
         value is not a polynomial in time"
    );
}

#[test]
fn quotient_by_changing_number_is_undecided() {
    assert_eq!(
        drain("(< (/ 1 x) 1)").judge("0: a [4]"),
        "undecided: at 0.000: nonlinear change: (< (/ 1 (x)) 1) divides by (x), which changes \
         with time"
    );
}

#[test]
fn quotient_by_changing_number_is_ignored_if_other_parts_decide() {
    assert_eq!(
        drain("(or (< (/ 1 x) 1) (> x 3))").judge("0: a [6]"),
        "valid"
    );
}

#[test]
fn earliest_of_several_violations_is_reported() {
    let world = World::new("(= x 10)")
        .durative("keep", &[("over all", "(>= x 3)")])
        .durative("drain", &[("rate", "x -1"), ("over all", "(>= x 5)")]);
    assert_eq!(
        world.judge("0: keep [9]\n0: drain [9]"),
        "just after 5.000: (drain) needs (>= (x) 5) over all: (x) = 1, short by 4"
    );
}

#[test]
fn undefined_rate_is_reported_for_its_action() {
    let world = World::new("(= x 10)").durative("a", &[("rate", "x speed")]);
    assert_eq!(
        world.judge("2: a [5]"),
        "at 2.000: (a) reads (speed), which has no value, in a rate of continuous change"
    );
}

#[test]
fn derived_fact_can_depend_on_changing_number() {
    let world = drain("(ok)")
        .rule("ok", "(> x 4)")
        .rule("ok", "(p)")
        .instant("help", "", "(p)");
    assert_eq!(world.judge("0: a [6]"), "valid");
    assert_eq!(
        world.judge("0: a [8]"),
        "at 6.000: (a) needs (ok) over all: (ok) is false"
    );
    assert_eq!(world.judge("0: a [8]\n5: help"), "valid");
}

#[test]
fn a_continuous_effect_counts_at_both_ends_of_its_action() {
    let world = drain("").instant("look", "(> x 2)", "");
    assert_eq!(world.judge("0: a [6]\n3: look"), "valid");
    assert_ne!(world.judge("0: a [6]\n6: look"), "valid");
}

#[test]
fn report_contains_margin_of_each_numeric_condition() {
    let world = World::new("(= x 10)")
        .durative(
            "a",
            &[
                ("rate", "x -1"),
                ("over all", "(> x 1)"),
                ("start", "(>= x 9)"),
            ],
        )
        .instant("refill", "", "(increase x 3)")
        .goal("(<= x 8)");
    let report = world.report("0: a [8]\n4: refill");
    assert_eq!(report.makespan, number("8"));
    let lines: Vec<_> = report
        .margins
        .iter()
        .map(|m| {
            let strict = if m.is_strict { "strict" } else { "" };
            format!(
                "{} {} by {} at {} {strict}",
                m.when, m.condition, m.margin, m.time
            )
        })
        .collect();
    assert_eq!(
        lines,
        [
            "at start (>= (x) 9) by 1 at 0 ",
            "over all (> (x) 1) by 4 at 8 strict",
            "goal (<= (x) 8) by 3 at 8 ",
        ]
    );
}
