//! Happenings at the same time, or nearly so.

use proptest::prelude::*;

use super::world::{World, number};
use crate::validate::{Settings, Verdict};

fn handover() -> World {
    World::new("")
        .instant("give", "", "(p)")
        .instant("take", "(p)", "(q)")
        .goal("(q)")
}

#[test]
fn interfering_happenings_keep_epsilon_apart() {
    assert_eq!(handover().judge("1: give\n1.001: take"), "valid");
    assert_eq!(
        handover().judge("1: give\n1.0009: take"),
        "at 1.0009: (take) interferes: (give) at 1.000 and (take) at 1.0009 both concern (p) \
         and must be at least 0.001 apart"
    );
}

#[test]
fn simultaneous_happenings_do_not_read_each_others_effects() {
    assert_eq!(
        handover().judge("1: give\n1: take"),
        "at 1.000: (take) needs (p): (p) is false; (give) at 1.000 changes this only after the \
         condition is read"
    );
}

#[test]
fn interfering_happenings_at_the_same_time_are_refused_even_when_both_could_happen() {
    let world = World::new("(p)")
        .instant("use", "(p)", "")
        .instant("spoil", "", "(not (p))");
    assert_eq!(
        world.judge("1: use\n1: spoil"),
        "at 1.000: (spoil) interferes: (use) at 1.000 and (spoil) at 1.000 both concern (p) and \
         must be at least 0.001 apart"
    );
}

#[test]
fn happenings_that_do_not_interfere_may_coincide() {
    let world = World::new("(p)")
        .instant("use", "(p)", "(q)")
        .instant("reuse", "(p)", "(q)");
    assert_eq!(world.judge("1: use\n1: reuse"), "valid");
}

#[test]
fn start_and_end_of_one_action_are_separated() {
    let world =
        World::new("").durative("a", &[("start effect", "(p)"), ("end effect", "(not (p))")]);
    assert_eq!(world.judge("1: a [0.001]"), "valid");
    assert_ne!(world.judge("1: a [0.0005]"), "valid");
}

#[test]
fn a_timed_initial_interferes_with_actions_and_not_with_other_timed_initials() {
    let world = World::new("")
        .timed("5", "(p)")
        .timed("5.0001", "(not (p))")
        .timed("9", "(p)")
        .instant("use", "(p)", "");
    assert_eq!(world.judge("10: use"), "valid");
    assert_eq!(
        world.judge("9.0001: use"),
        "at 9.0001: (use) interferes: a timed initial at 9.000 and (use) at 9.0001 both concern \
         (p) and must be at least 0.001 apart"
    );
}

#[test]
fn without_epsilon_interfering_happenings_only_must_not_coincide() {
    let world = handover().settings(Settings {
        needs_separation: false,
        ..Settings::default()
    });
    assert_eq!(world.judge("1: give\n1.0000001: take"), "valid");
    let world = World::new("(p)")
        .instant("use", "(p)", "")
        .instant("spoil", "", "(not (p))")
        .settings(Settings {
            needs_separation: false,
            ..Settings::default()
        });
    assert!(
        world
            .judge("1: use\n1: spoil")
            .ends_with("must not happen at the same time")
    );
}

/// Returns a world where the delivery only counts if the shop has not thrown it out at the end.
fn thrown_out() -> World {
    World::new("")
        .instant("deliver", "", "(p)")
        .timed("9", "(not (p))")
        .goal("(p)")
}

#[test]
fn the_goal_holds_after_timed_initials_that_come_after_the_plan() {
    let world = thrown_out;
    assert_eq!(
        world().judge("1: deliver"),
        "at 9.000: the goal (p) does not hold: (p) is false since a timed initial at 9.000"
    );
    assert_eq!(world().judge("10: deliver"), "valid");
    assert_eq!(world().timed("11", "(p)").judge("1: deliver"), "valid");
    // Timed initials count even without any action.
    let given = || World::new("").timed("5", "(q)").goal("(q)");
    assert_eq!(given().judge(""), "valid");
    // Timed initials interfere like other happenings.
    assert_eq!(
        world().judge("8.9999: deliver"),
        "at 9.000: (deliver) interferes: (deliver) at 8.9999 and a timed initial at 9.000 both \
         concern (p) and must be at least 0.001 apart"
    );
    // With this setting, the goal is read after the last action.
    let early = || Settings {
        counts_later_timed: false,
        ..Settings::default()
    };
    assert_eq!(world().settings(early()).judge("1: deliver"), "valid");
    assert_ne!(given().settings(early()).judge(""), "valid");
}

/// Times are in tenths. Timed initials make one of three facts true or false. Each step makes one
/// of them true or false and needs another one.
type Draft = (Vec<(u8, u8, bool)>, Vec<(u8, u8)>, u8);

fn drafts() -> impl Strategy<Value = Draft> {
    let timed = prop::collection::vec((0..9_u8, 0..3_u8, any::<bool>()), 0..4);
    let steps = prop::collection::vec((0..9_u8, 0..6_u8), 0..4);
    (timed, steps, 0..8_u8)
}

fn drafted((timed, _, goal): &Draft) -> World {
    const FACTS: [&str; 3] = ["(p)", "(q)", "(r)"];
    let literal = |fact: u8, truth: bool| {
        let fact = FACTS[usize::from(fact)];
        if truth {
            fact.to_owned()
        } else {
            format!("(not {fact})")
        }
    };
    let mut world = World::new("(p)").instant("nothing", "", "");
    let mut seen = std::collections::BTreeSet::new();
    for &(time, fact, truth) in timed
        .iter()
        .filter(|(time, fact, _)| seen.insert((*time, *fact)))
    {
        world = world.timed(&format!("{time}.5"), &literal(fact, truth));
    }
    for number in 0..6_u8 {
        let effect = literal(number % 3, number < 3);
        world = world.instant(
            &format!("step{number}"),
            &literal((number + 1) % 3, number % 2 == 0),
            &effect,
        );
    }
    let goal = (0..3).map(|fact| literal(fact, goal >> fact & 1 == 1));
    world.goal(&goal.collect::<Vec<_>>().join(" "))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn goal_is_read_by_a_virtual_final_action(draft in drafts()) {
        let plan = draft.1.iter().map(|(time, step)| format!("{time}: step{step}\n"));
        let plan: String = plan.collect();
        let verdict = drafted(&draft).verdict(&plan);
        let after_all = drafted(&draft).settings(Settings {
            counts_later_timed: false,
            ..Settings::default()
        });
        let longer = after_all.verdict(&format!("{plan}99: nothing"));
        prop_assert_eq!(verdict.is_valid(), longer.is_valid());
        let mistake = |verdict: &Verdict| verdict.violation().map(|found| found.kind.clone());
        prop_assert_eq!(mistake(&verdict), mistake(&longer));
    }
}

#[test]
fn simultaneous_read_and_write_is_allowed_only_by_setting() {
    let world = |settings| {
        World::new("(p)")
            .instant("use", "(p)", "(q)")
            .instant("spoil", "", "(not (p))")
            .instant("restore", "", "(p)")
            .goal("(q)")
            .settings(settings)
    };
    let judge = |plan| world(Settings::like_unified_planning()).judge(plan);
    assert_eq!(judge("1: use\n1: spoil"), "valid");
    assert_ne!(
        world(Settings::default()).judge("1: use\n1: spoil"),
        "valid"
    );
    // Contradictory writes are rejected under all settings, before their effects are visible.
    assert!(judge("1: use\n2: spoil\n2: restore").starts_with("at 2.000: (restore) interferes"));
    let handover = handover().settings(Settings::like_unified_planning());
    assert_eq!(
        handover.judge("1: give\n1: take"),
        "at 1.000: (take) needs (p): (p) is false; (give) at 1.000 changes this only after the \
         condition is read"
    );
}

#[test]
fn happenings_within_a_tenth_of_tolerance_are_merged() {
    let world = handover().settings(Settings::like_val(number("0.01")));
    assert_eq!(
        world.judge("1: give\n1.001: take"),
        "at 1.000: (take) needs (p): (p) is false; (give) at 1.000 changes this only after the \
         condition is read"
    );
    assert_eq!(world.judge("1: give\n1.0011: take"), "valid");
}

#[test]
fn a_group_does_not_grow_beyond_a_tenth_of_the_tolerance_after_its_first_happening() {
    let world = handover()
        .instant("idle", "", "")
        .settings(Settings::like_val(number("0.01")));
    assert_eq!(world.judge("1: idle\n1.0008: give\n1.0016: take"), "valid");
}
