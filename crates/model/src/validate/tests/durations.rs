//! Durations and start times.

use super::world::{World, number};
use crate::validate::Settings;

#[test]
fn a_duration_must_satisfy_all_bounds() {
    let world = World::new("(= x 3)").durative("a", &[("duration", "(>= x) (<= 7)")]);
    assert_eq!(world.judge("0: a [3]"), "valid");
    assert_eq!(world.judge("0: a [7]"), "valid");
    assert_eq!(
        world.judge("0: a [2.9]"),
        "at 0.000: (a) takes 2.9, but its duration must be >= (x) = 3"
    );
    assert_eq!(
        world.judge("0: a [7.1]"),
        "at 0.000: (a) takes 7.1, but its duration must be <= 7"
    );
}

#[test]
fn a_duration_bound_reads_the_state_on_arrival_at_the_start() {
    let world = World::new("(= x 3)")
        .instant("more", "", "(increase x 1)")
        .durative(
            "a",
            &[("duration", "(= x)"), ("start effect", "(increase x 5)")],
        );
    assert_eq!(world.judge("0: more\n1: a [4]"), "valid");
}

#[test]
fn a_duration_bound_at_end_reads_the_state_on_arrival_at_the_end() {
    let world = World::new("(= x 3)").durative(
        "a",
        &[
            ("duration", "(end (= x))"),
            ("start effect", "(increase x 5)"),
        ],
    );
    assert_eq!(world.judge("0: a [8]"), "valid");
    assert_eq!(
        world.judge("0: a [3]"),
        "at 3.000: (a) takes 3, but its duration must be = (x) = 8"
    );
}

#[test]
fn durations_and_start_times_are_not_negative() {
    let world = World::new("").durative("a", &[]).instant("go", "", "");
    assert_eq!(world.judge("0: a [0]"), "valid");
    assert_eq!(
        world.judge("1: a [-1]"),
        "at 1.000: (a) has the duration -1, below 0"
    );
    assert_eq!(
        world.judge("-1: go"),
        "at -1.000: (go) starts before time 0"
    );
    assert_eq!(world.judge("1: a"), "at 1.000: (a) has no duration");
}

#[test]
fn any_duration_is_valid_without_bounds() {
    let world = World::new("").durative("a", &[]);
    assert_eq!(world.judge("0: a [12345/7]"), "valid");
}

#[test]
fn tolerance_applies_to_durations_but_not_to_strict_bounds() {
    let tolerant = Settings {
        tolerance: number("0.1"),
        ..Settings::default()
    };
    let world = World::new("")
        .durative("most", &[("duration", "(<= 5)")])
        .durative("equal", &[("duration", "(= 5)")])
        .durative("less", &[("duration", "(< 5)")])
        .settings(tolerant);
    assert_eq!(world.judge("0: most [5.1]"), "valid");
    assert_ne!(world.judge("0: most [5.11]"), "valid");
    assert_eq!(world.judge("0: equal [4.9]"), "valid");
    assert_ne!(world.judge("0: equal [4.89]"), "valid");
    assert_ne!(world.judge("0: less [5]"), "valid");
}

#[test]
fn effects_and_conditions_read_the_duration() {
    let world = World::new("(= x 0)")
        .durative(
            "a",
            &[
                ("start", "(> ?duration 2)"),
                ("end effect", "(increase x (* 3 ?duration))"),
            ],
        )
        .goal("(= x 12)");
    assert_eq!(world.judge("0: a [4]"), "valid");
    assert_eq!(
        world.judge("0: a [1]"),
        "at 0.000: (a) needs (> ?duration 2) at start: ?duration = 1, short by 1"
    );
}
