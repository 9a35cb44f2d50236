//! Times at which conditions are read.

use super::world::{World, number};
use crate::validate::Settings;

#[test]
fn plan_that_achieves_goal_is_valid() {
    let world = World::new("(p)").instant("go", "(p)", "(q)").goal("(q)");
    assert_eq!(world.judge("1: go"), "valid");
}

#[test]
fn the_empty_plan_is_valid_if_the_goal_holds_already() {
    assert_eq!(World::new("(p)").goal("(p)").judge(""), "valid");
    assert_eq!(
        World::new("").goal("(p)").judge(""),
        "at 0.000: the goal (p) does not hold: (p) is false"
    );
}

#[test]
fn a_start_condition_reads_the_state_before_any_effect_at_that_time() {
    let world = World::new("").durative("a", &[("start", "(p)"), ("start effect", "(p)")]);
    assert_eq!(
        world.judge("1: a [2]"),
        "at 1.000: (a) needs (p) at start: (p) is false; the start of (a) at 1.000 changes this \
         only after the condition is read"
    );
}

#[test]
fn an_end_condition_reads_the_state_before_the_effects_of_the_end() {
    let world = World::new("").durative("a", &[("end", "(p)"), ("end effect", "(p)")]);
    assert_eq!(
        world.judge("1: a [2]"),
        "at 3.000: (a) needs (p) at end: (p) is false; the end of (a) at 3.000 changes this only \
         after the condition is read"
    );
}

#[test]
fn end_condition_can_be_satisfied_by_start_effect() {
    let world = World::new("").durative("a", &[("end", "(p)"), ("start effect", "(p)")]);
    assert_eq!(world.judge("1: a [2]"), "valid");
}

#[test]
fn an_over_all_condition_need_not_hold_before_the_start_effect_nor_after_the_end_effect() {
    let world = World::new("").durative(
        "a",
        &[
            ("over all", "(p)"),
            ("start effect", "(p)"),
            ("end effect", "(not (p))"),
        ],
    );
    assert_eq!(world.judge("1: a [2]"), "valid");
}

#[test]
fn an_over_all_condition_breaks_where_another_action_deletes_it() {
    let world = World::new("(p)")
        .durative("a", &[("over all", "(p)")])
        .instant("spoil", "", "(not (p))");
    assert_eq!(
        world.judge("0: a [10]\n4: spoil"),
        "at 4.000: (a) needs (p) over all: (p) is false since (spoil) at 4.000"
    );
    assert_eq!(world.judge("0: a [10]\n10: spoil"), "valid");
    assert_eq!(
        world.judge("1: a [10]\n1: spoil"),
        "just after 1.000: (a) needs (p) over all: (p) is false since (spoil) at 1.000"
    );
}

#[test]
fn over_all_condition_of_zero_duration_action_is_ignored() {
    let world = World::new("").durative("a", &[("over all", "(p)")]);
    assert_eq!(world.judge("1: a [0]"), "valid");
}

#[test]
fn a_negative_condition_needs_the_fact_to_be_false() {
    let world = World::new("(p)")
        .instant("go", "(not (p))", "")
        .instant("undo", "", "(not (p))");
    assert_eq!(
        world.judge("1: go"),
        "at 1.000: (go) needs (not (p)): (p) is true"
    );
    assert_eq!(world.judge("1: undo\n2: go"), "valid");
}

#[test]
fn disjunction_needs_one_disjunct_and_reports_all_if_false() {
    let world = World::new("(p) (= x 3)").instant("go", "(or (q) (>= x 5))", "");
    assert_eq!(
        world.judge("1: go"),
        "at 1.000: (go) needs (or (q) (>= (x) 5)): (q) is false; (x) = 3, short by 2"
    );
    let world = World::new("(q) (= x 3)").instant("go", "(or (q) (>= x 5))", "");
    assert_eq!(world.judge("1: go"), "valid");
}

#[test]
fn derived_facts_follow_from_their_rules() {
    let world = World::new("(link)")
        .rule("near", "(link)")
        .rule("linked", "(near)")
        .rule("apart", "(not (linked))")
        .instant("cut", "(linked)", "(not (link))")
        .instant("go", "(apart)", "");
    assert_eq!(world.judge("1: cut\n2: go"), "valid");
    assert_eq!(
        world.judge("2: go"),
        "at 2.000: (go) needs (apart): (apart) is false"
    );
}

#[test]
fn cyclically_supported_derived_facts_are_false() {
    let world = World::new("")
        .rule("a", "(b)")
        .rule("b", "(a)")
        .goal("(not (a))");
    assert_eq!(world.judge(""), "valid");
}

#[test]
fn derived_fact_that_depends_on_its_negation_is_undecided() {
    let world = World::new("")
        .rule("a", "(not (b))")
        .rule("b", "(a)")
        .goal("(a)");
    assert_eq!(
        world.judge(""),
        "undecided: a derived fact depends on its own negation"
    );
}

#[test]
fn the_goal_is_read_after_the_last_happening() {
    let world = World::new("(p)")
        .timed("5", "(not (p))")
        .instant("go", "", "")
        .goal("(p)");
    assert_eq!(
        world.judge("4: go"),
        "at 5.000: the goal (p) does not hold: (p) is false since a timed initial at 5.000"
    );
    assert_eq!(
        world.judge("6: go"),
        "at 6.000: the goal (p) does not hold: (p) is false since a timed initial at 5.000"
    );
}

#[test]
fn a_fluent_without_a_value_is_named() {
    let world = World::new("")
        .instant("go", "(> x 0)", "")
        .instant("more", "", "(increase x 1)");
    assert_eq!(
        world.judge("1: go"),
        "at 1.000: (go) reads (x), which has no value, in (> (x) 0)"
    );
    assert_eq!(
        world.judge("1: more"),
        "at 1.000: (more) reads (x), which has no value, in its effect increase (x)"
    );
}

#[test]
fn undefined_fluent_is_ignored_if_other_parts_decide() {
    let world = World::new("(p)").instant("go", "(or (> x 0) (p))", "");
    assert_eq!(world.judge("1: go"), "valid");
}

#[test]
fn a_division_by_zero_is_named() {
    let world = World::new("(= x 0)").instant("go", "(> (/ 1 x) 0)", "");
    assert_eq!(
        world.judge("1: go"),
        "at 1.000: (go) divides by (x), which is 0, in (> (/ 1 (x)) 0)"
    );
}

#[test]
fn open_number_is_undecided() {
    let world = World::new("(= x 0)").instant("go", "(> x ?open)", "");
    assert_eq!(
        world.judge("1: go"),
        "undecided: at 1.000: (> (x) ?parameter0) reads the open number ?parameter0: give it a value"
    );
}

/// Expected verdicts are those of VAL at `-t 0.001`, for x = 9.99995, 10, 10.00005.
#[test]
fn tolerance_applies_to_momentary_but_not_to_over_all_conditions() {
    let table = [
        ("(< x 10)", "+++", "+--"),
        ("(<= x 10)", "+++", "++-"),
        ("(> x 10)", "+++", "--+"),
        ("(>= x 10)", "+++", "-++"),
        ("(not (< x 10))", "---", "-++"),
        ("(not (<= x 10))", "---", "--+"),
        ("(not (> x 10))", "---", "++-"),
        ("(not (>= x 10))", "---", "+--"),
        ("(or (< x 10) (p))", "+++", "+--"),
    ];
    let judged = |when: &str, condition: &str| -> String {
        let values = ["9.99995", "10", "10.00005"];
        let verdicts = values.map(|value| {
            let world = World::new(&format!("(= x {value})"))
                .durative("a", &[(when, condition)])
                .settings(Settings::like_val(number("0.001")));
            match world.judge("0: a [20]").as_str() {
                "valid" => '+',
                reason => {
                    assert!(reason.contains("needs"), "{reason}");
                    // The message has a reason: `x is …`.
                    assert!(
                        reason.contains("= 10") || reason.contains("= 9"),
                        "{reason}"
                    );
                    '-'
                }
            }
        });
        verdicts.iter().collect()
    };
    for (condition, at_start, over_all) in table {
        assert_eq!(judged("start", condition), at_start, "at start {condition}");
        assert_eq!(judged("end", condition), at_start, "at end {condition}");
        assert_eq!(
            judged("over all", condition),
            over_all,
            "over all {condition}"
        );
    }
}
