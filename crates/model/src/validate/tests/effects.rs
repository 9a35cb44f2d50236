//! Effects.

use super::world::World;

#[test]
fn addition_overrides_deletion_of_same_happening() {
    let world = World::new("")
        .instant("go", "", "(p) (not (p))")
        .goal("(p)");
    assert_eq!(world.judge("1: go"), "valid");
}

#[test]
fn effect_values_read_the_state_on_arrival() {
    let world = World::new("(= x 1) (= y 2)")
        .instant("swap", "", "(assign x y) (assign y x)")
        .goal("(= x 2) (= y 1)");
    assert_eq!(world.judge("1: swap"), "valid");
}

#[test]
fn increases_and_decreases_at_one_time_add_up() {
    let world = World::new("(= x 1)")
        .instant("more", "", "(increase x 5) (increase x 1)")
        .instant("less", "", "(decrease x 2)")
        .goal("(= x 5)");
    assert_eq!(world.judge("1: more\n1: less"), "valid");
}

#[test]
fn scaling_multiplies_and_divides() {
    let world = World::new("(= x 6)")
        .instant("up", "", "(scale-up x 4)")
        .instant("down", "", "(scale-down x 3)")
        .instant("crash", "", "(scale-down x 0)")
        .goal("(= x 8)");
    assert_eq!(world.judge("1: up\n2: down"), "valid");
    assert_eq!(
        world.judge("1: crash"),
        "at 1.000: (crash) divides by its value, which is 0, in its effect scale-down (x)"
    );
}

#[test]
fn conflicting_assignments_of_one_happening_are_refused() {
    let world = World::new("(= x 1)").instant("go", "", "(assign x 2) (increase x 1)");
    assert_eq!(
        world.judge("1: go"),
        "at 1.000: (go) gives (x) several values at the same time"
    );
}

#[test]
fn an_assignment_defines_a_fluent() {
    let world = World::new("")
        .instant("go", "", "(assign x 2)")
        .goal("(= x 2)");
    assert_eq!(world.judge("1: go"), "valid");
}

#[test]
fn a_conditional_effect_reads_the_state_on_arrival_at_its_own_time() {
    let world = World::new("")
        .durative(
            "a",
            &[
                ("start effect", "(p)"),
                ("end effect", "(when (p) (q)) (when (r) (s))"),
            ],
        )
        .goal("(q) (not (s))");
    assert_eq!(world.judge("1: a [2]"), "valid");
}

#[test]
fn conditional_effect_uses_condition_value_from_start() {
    let world = World::new("(p)")
        .durative(
            "a",
            &[(
                "end effect",
                "(when (start (p)) (q)) (when (start (r)) (s))",
            )],
        )
        .instant("undo", "(p)", "(not (p))")
        .instant("late", "", "(r)")
        .goal("(q) (not (s))");
    assert_eq!(world.judge("1: a [4]\n2: undo\n3: late"), "valid");
}

#[test]
fn a_conditional_effect_over_all_takes_place_only_if_its_condition_never_fails() {
    let world = World::new("(p)")
        .durative("a", &[("end effect", "(when (overall (p)) (q))")])
        .instant("undo", "", "(not (p))")
        .instant("redo", "", "(p)")
        .goal("(q)");
    assert_eq!(world.judge("1: a [4]"), "valid");
    assert_eq!(world.judge("0: undo\n1: redo\n1.5: a [4]"), "valid");
    assert_eq!(
        world.judge("1: a [4]\n2: undo\n3: redo"),
        "at 5.000: the goal (q) does not hold: (q) is false"
    );
}

#[test]
fn timed_initials_are_applied() {
    let world = World::new("(p) (= x 1)")
        .timed("5", "(not (p))")
        .timed("6", "(= x 9)")
        .instant("go", "(not (p)) (= x 9)", "");
    assert_eq!(world.judge("7: go"), "valid");
    assert_ne!(world.judge("5.5: go"), "valid");
}
