//! Plans that are abandoned because of a lack of time or of violated numeric conditions, and
//! without an alternative plan.

use elbowroom::execution::Cause;
use elbowroom::execution::executors::DEFAULT_EXECUTOR;
use elbowroom::execution::run::{PlanningTime, Report, Verdict};
use elbowroom::num::Rational;
use elbowroom::pipeline;

use crate::execution::scene::Scene;

/// Two walks, one after the other, before a door closes.
const WALKS: &str = "(define (domain walks)
    (:requirements :durative-actions :timed-initial-literals)
    (:predicates (home) (half-way) (there) (open))
    (:durative-action go :parameters () :duration (= ?duration 10)
      :condition (and (at start (home)) (over all (open)))
      :effect (and (at start (not (home))) (at end (half-way))))
    (:durative-action go-on :parameters () :duration (= ?duration 10)
      :condition (and (at start (half-way)) (over all (open))) :effect (at end (there))))";

const DOOR: &str = "(define (problem p) (:domain walks)
    (:init (home) (open) (at 22 (not (open)))) (:goal (there)))";

const PLAN: &str = "0: (go) [10]\n10.001: (go-on) [10]";

/// Runs in a simulated world, with or without monitoring of slack as in real time.
fn outcome(executor: &str, watches_room: bool, world: &str) -> (Verdict, usize) {
    let mut scene = Scene::new(WALKS, DOOR, Some(PLAN));
    scene.settings.monitors_slack = watches_room;
    let report = scene.run(executor, &scene.world(world), 0);
    (report.verdict, report.replans)
}

#[test]
fn goal_is_reached_if_later_action_compensates_delay() {
    let world = "[[duration]]\naction = \"go\"\nconstant = 13\n[[duration]]\naction = \"go-on\"\nconstant = 8\n";
    for watches_room in [false, true] {
        let reached = |executor| outcome(executor, watches_room, world).0 == Verdict::GoalReached;
        // After 13 s, 9 s are left for an action of 10 s, so no plan exists; but it takes only 8 s.
        assert!(reached("live"), "{watches_room}");
        assert!(reached("esterel"), "{watches_room}");
        assert!(!reached("guarded"), "{watches_room}");
    }
}

#[test]
fn run_ends_if_continuing_cannot_reach_the_goal() {
    for (first, second) in [("13", "10"), ("23", "1"), ("30", "30")] {
        let world = format!(
            "[[duration]]\naction = \"go\"\nconstant = {first}\n[[duration]]\naction = \"go-on\"\nconstant = {second}\n"
        );
        for watches_room in [false, true] {
            let (verdict, replans) = outcome("live", watches_room, &world);
            assert_ne!(verdict, Verdict::GoalReached, "{first}, {second}");
            assert!(replans <= 3, "{first}, {second}: {replans}");
        }
    }
}

#[test]
fn plan_with_unmet_condition_is_not_continued() {
    let world = "[[failure]]\naction = \"go-on\"\nprobability = 1\n";
    let (verdict, _) = outcome("live", true, world);
    assert_ne!(verdict, Verdict::GoalReached);
}

/// Two hoses fill a tank, one after the other, each for 10 s.
#[test]
fn goal_is_reached_if_later_action_compensates_shortfall() {
    let domain = "(define (domain hoses)
        (:requirements :typing :durative-actions :fluents :continuous-effects) (:types hose)
        (:predicates (free) (new ?h - hose)) (:functions (water))
        (:durative-action pour :parameters (?h - hose) :duration (= ?duration 10)
          :condition (and (at start (free)) (at start (new ?h)))
          :effect (and (at start (not (free))) (at start (not (new ?h))) (at end (free))
            (increase (water) (* #t 1)))))";
    let problem = "(define (problem p) (:domain hoses) (:objects a b - hose)
        (:init (free) (new a) (new b) (= (water) 0)) (:goal (>= (water) 20)))";
    let plan = "0: (pour a) [10]\n10.001: (pour b) [10]";
    for (second, is_enough) in [("11.5", true), ("10.5", false)] {
        let world = format!(
            "[[duration]]\naction = \"(pour a)\"\nconstant = 9\n[[duration]]\naction = \"(pour b)\"\nconstant = {second}\n"
        );
        for watches_room in [false, true] {
            let mut scene = Scene::new(domain, problem, Some(plan));
            scene.settings.monitors_slack = watches_room;
            let model = scene.world(&world);
            for executor in ["live", "esterel"] {
                let report = scene.run(executor, &model, 0);
                let is_reached = report.verdict == Verdict::GoalReached;
                assert_eq!(is_reached, is_enough, "{executor}, {second}: {report:#?}");
            }
        }
    }
}

/// The bus cannot pass during a walk, and leaves from the start of the walk.
const BUS: &str = "(define (domain bus)
    (:requirements :durative-actions :timed-initial-literals)
    (:predicates (way-free) (at-stop) (half-way) (there) (open))
    (:durative-action walk :parameters () :duration (= ?duration 10)
      :condition (over all (way-free))
      :effect (and (at end (half-way)) (at end (not (at-stop)))))
    (:durative-action finish :parameters () :duration (= ?duration 10)
      :condition (and (at start (half-way)) (over all (open))) :effect (at end (there)))
    (:durative-action ride :parameters () :duration (= ?duration 5)
      :condition (and (at start (at-stop)) (over all (open)))
      :effect (and (at start (not (way-free))) (at end (there)))))";

#[test]
fn overdue_action_is_cancelled_if_there_is_a_plan_without_it() {
    let problem = "(define (problem p) (:domain bus)
        (:init (way-free) (at-stop) (open) (at 40 (not (open)))) (:goal (there)))";
    let mut scene = Scene::new(BUS, problem, Some("0: (walk) [10]\n10.001: (finish) [10]"));
    scene.settings.monitors_slack = true;
    let model = scene.world("[[duration]]\naction = \"walk\"\nconstant = 400\n");
    let report = scene.run("live", &model, 0);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    let esterel = scene.run("esterel", &model, 0);
    assert_ne!(esterel.verdict, Verdict::GoalReached);
}

/// A recharge of 1 to 45; 25 are needed and 40 planned. Then a drive before 75.
const RECHARGE: &str = "(define (domain recharge)
    (:requirements :durative-actions :fluents :duration-inequalities :timed-initial-literals)
    (:predicates (free) (home) (there) (day)) (:functions (charge))
    (:durative-action recharge :parameters () :duration (and (>= ?duration 1) (<= ?duration 45))
      :condition (at start (free))
      :effect (and (at start (not (free))) (at end (free)) (at end (increase (charge) ?duration))))
    (:durative-action drive :parameters () :duration (= ?duration 10)
      :condition (and (at start (free)) (at start (>= (charge) 25)) (over all (day)))
      :effect (and (at start (not (free))) (at end (there)))))";

const EVENING: &str = "(define (problem p) (:domain recharge)
    (:init (free) (day) (= (charge) 0) (at 75 (not (day)))) (:goal (there)))";

#[test]
fn open_duration_may_deviate_as_far_as_domain_and_plan_allow() {
    let plan = "0: (recharge) [40]\n40.001: (drive) [10]";
    let scene = Scene::new(RECHARGE, EVENING, Some(plan));
    for executor in ["live", "guarded"] {
        for takes in ["25", "39.999", "40", "40.001", "44.9"] {
            let world = format!("[[duration]]\naction = \"recharge\"\nconstant = {takes}\n");
            let report = scene.run(executor, &scene.world(&world), 0);
            assert_eq!(report.verdict, Verdict::GoalReached, "{executor}, {takes}");
            // Paper 1's algorithm gives the drive some of the slack.
            if executor == "live" || takes != "44.9" {
                assert_eq!(report.replans, 0, "{executor}, {takes}: {report:#?}");
            }
        }
    }
    let late = EVENING.replace("75", "500");
    let scene = Scene::new(RECHARGE, &late, Some(plan));
    let envelope = scene.prepared("guarded").envelope.expect("an envelope");
    let upper = envelope.intervals()[0].upper.value().cloned();
    assert!(
        upper.is_some_and(|upper| upper <= 45.into()),
        "the domain allows no more: {envelope:?}"
    );
}

/// The limit of the recharge comes from the deadline of the drive, whose condition is read at its end.
#[test]
fn drive_can_compensate_open_recharge_duration() {
    let domain = RECHARGE.replace("(over all (day))", "(at end (day))");
    let domain = domain.replace("(= ?duration 10)", "(= ?duration 34)");
    let scene = Scene::new(
        &domain,
        EVENING,
        Some("0: (recharge) [40]\n40.001: (drive) [34]"),
    );
    for executor in ["live", "esterel"] {
        for takes in ["41.5", "44"] {
            let world = format!(
                "[[duration]]\naction = \"recharge\"\nconstant = {takes}\n[[duration]]\naction = \"drive\"\nconstant = 28\n"
            );
            let report = scene.run(executor, &scene.world(&world), 0);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{executor}, {takes}: {report:#?}"
            );
        }
    }
}

#[test]
fn default_is_never_below_the_baselines_in_windows() {
    let domain = "(define (domain torch) (:requirements :typing :durative-actions)
        (:types job) (:predicates (lit) (fresh) (hand) (done ?j - job))
        (:durative-action burn :parameters () :duration (= ?duration 10) :condition (at start (fresh))
          :effect (and (at start (not (fresh))) (at start (lit)) (at end (not (lit)))))
        (:durative-action work :parameters (?j - job) :duration (= ?duration 3)
          :condition (and (at start (hand)) (over all (lit)))
          :effect (and (at start (not (hand))) (at end (hand)) (at end (done ?j)))))";
    let problem = "(define (problem p) (:domain torch) (:objects a b c - job)
        (:init (fresh) (hand)) (:goal (and (done a) (done b) (done c))))";
    let plan = "0: (burn) [10]\n0.001: (work a) [3]\n3.002: (work b) [3]\n6.003: (work c) [3]";
    let scene = Scene::new(domain, problem, Some(plan));
    let world =
        "[[duration]]\naction = \"*\"\nuniform = { from = 0.7, to = 1.3 }\nrelative = true\n";
    let model = scene.world(world);
    let reached = |executor: &str| {
        let seeds = 0..20;
        let reports = seeds.map(|seed| scene.run(executor, &model, seed).verdict);
        reports.filter(|it| *it == Verdict::GoalReached).count()
    };
    let default = reached(DEFAULT_EXECUTOR);
    assert!(default >= 10, "{default}");
    for baseline in ["esterel", "stn", "guarded"] {
        let baseline_reached = reached(baseline);
        assert!(
            default >= baseline_reached,
            "{baseline}: {baseline_reached} > {default}"
        );
    }
}

/// Glass is melted for a variable duration, at most until it is too hot, and formed in a shift. A
/// broken-off action loses the glass.
const GLASS: &str = "(define (domain glass)
    (:requirements :durative-actions :fluents :continuous-effects :duration-inequalities :timed-initial-literals)
    (:predicates (raw) (melted) (warm) (rested) (formed) (shift)) (:functions (heat))
    (:durative-action melt :parameters () :duration (and (>= ?duration 1) (<= ?duration 40))
      :condition (and (at start (raw)) (over all (<= (heat) 20)))
      :effect (and (at start (not (raw))) (at end (melted)) (increase (heat) (* #t 1))))
    (:durative-action rest :parameters () :duration (= ?duration 2)
      :condition (and (at start (melted)) (at start (>= (heat) 10)) (at start (warm)))
      :effect (and (at start (not (melted))) (at end (rested))))
    (:durative-action form :parameters () :duration (= ?duration 4)
      :condition (and (at start (rested)) (over all (shift)))
      :effect (and (at start (not (rested))) (at end (formed)))))";

/// Runs with this duration of melting. The glass is warm until `times.0`, and the first shift ends
/// at `times.1`.
fn form_glass(plan: &str, times: (u32, u32), world: &str, planning_time: Rational) -> Report {
    let (cold, shift) = times;
    let problem = format!(
        "(define (problem p) (:domain glass)
          (:init (raw) (warm) (shift) (= (heat) 0) (at {cold} (not (warm)))
            (at {shift} (not (shift))) (at 40 (shift)) (at 60 (not (shift))))
          (:goal (formed)))"
    );
    let mut scene = Scene::new(GLASS, &problem, Some(plan));
    scene.flow = pipeline::Settings::default();
    scene.settings.planning_time = PlanningTime::Seconds(planning_time);
    scene.run("live", &scene.world(world), 0)
}

const FORMED: &str = "0: (melt) [10]\n10.001: (rest) [2]\n12.002: (form) [4]";

#[test]
fn continued_plan_is_replaced_by_plan_found_later() {
    // From 14 on it is known that the first shift is too short. If melting took a quarter longer
    // than that, the glass would be cold. It ends in time, and can be formed in the second shift.
    let world = "[[duration]]\naction = \"melt\"\nconstant = 16\n";
    let report = form_glass(FORMED, (17, 21), world, Rational::ZERO);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    let last = report.reasons.last().map(|reason| reason.cause);
    assert_eq!(last, Some(Cause::MoreSlack), "{report:#?}");
}

#[test]
fn overdue_action_is_not_expected_to_break_its_own_condition() {
    // After 18 s, a quarter longer is too hot for the glass. Because planning takes time here,
    // there is no earlier search for a better plan.
    let world = "[[duration]]\naction = \"melt\"\nconstant = 19\n";
    let report = form_glass(FORMED, (35, 24), world, Rational::new(1, 10));
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    assert_eq!(report.replans, 1, "{report:#?}");
}

#[test]
fn open_duration_is_not_set_to_the_end_of_its_interval() {
    // The plan melts until the glass is nearly too hot.
    let plan = "0: (melt) [20]\n20.001: (rest) [2]\n22.002: (form) [4]";
    let world = "[[duration]]\naction = \"melt\"\nrelative = true\nconstant = 1.25\n";
    let report = form_glass(plan, (100, 100), world, Rational::ZERO);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    assert_eq!(report.replans, 0, "{report:#?}");
}

/// Three actions: the first one ends during the second, and the second during the third.
const NESTED: &str = "(define (domain nested)
    (:requirements :durative-actions :duration-inequalities)
    (:predicates (first) (second) (third) (first-done) (second-done) (third-done))
    (:durative-action a :parameters () :duration (and (>= ?duration 3) (<= ?duration 12))
      :condition (at end (second))
      :effect (and (at start (first)) (at end (not (first))) (at end (first-done))))
    (:durative-action b :parameters () :duration (and (>= ?duration 4) (<= ?duration 9))
      :condition (and (at start (first)) (at end (third)))
      :effect (and (at start (second)) (at end (not (second))) (at end (second-done))))
    (:durative-action c :parameters () :duration (and (>= ?duration 2) (<= ?duration 40))
      :condition (at start (second))
      :effect (and (at start (third)) (at end (not (third))) (at end (third-done)))))";

#[test]
fn plan_that_was_abandoned_twice_is_executed_by_its_orderings() {
    let problem = "(define (problem p) (:domain nested) (:init)
        (:goal (and (first-done) (second-done) (third-done))))";
    for plan in [
        "0: (a) [3]\n1: (b) [4]\n4.9: (c) [2]",
        "0: (a) [3]\n2.998: (b) [4]\n3.001: (c) [4]",
    ] {
        for watches_room in [false, true] {
            let mut scene = Scene::new(NESTED, problem, Some(plan));
            scene.settings.monitors_slack = watches_room;
            // All actions are shorter than the domain permits, so that the first one ends before the others begin.
            let world = "[[duration]]\naction = \"*\"\nconstant = 0.8\nrelative = true\n";
            let report = scene.run("live", &scene.world(world), 0);
            assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
            assert!(report.replans <= 6, "{report:#?}");
        }
    }
}
