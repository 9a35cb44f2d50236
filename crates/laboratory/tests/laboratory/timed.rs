//! Timed optimum of worlds computed by hand, and of small ones computed by a plain recursion.

mod enclosed;
mod sets;

use crate::twin;
use elbowroom::mdp::{Settings, Stop, TimedOptimum, optimum};
use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::WorldModel;

fn task(domain: &str, problem: &str) -> Task {
    let source = |text: &str| Source::new("test", text);
    let (problem, _) = read_problem(&source(domain), &source(problem)).expect("it is PDDL");
    Task::new(problem)
}

fn bounds(domain: &str, problem: &str, world: &str, settings: &Settings) -> TimedOptimum {
    let task = task(domain, problem);
    let model = WorldModel::read(world, task.problem()).expect("it is a world");
    optimum(&task, &model, settings, &|| true).expect("it can be tabulated")
}

fn experiment(name: &str, file: &str) -> String {
    let path = format!(
        "{}/../../experiments/{name}/{file}",
        env!("CARGO_MANIFEST_DIR")
    );
    std::fs::read_to_string(path).expect("it is there")
}

fn of_experiment(name: &str, settings: &Settings) -> TimedOptimum {
    bounds(
        &experiment(name, "domain.pddl"),
        &experiment(name, "problem.pddl"),
        &experiment(name, "world.toml"),
        settings,
    )
}

/// Sets the horizon, the only deadline in worlds without events.
fn until(horizon: i64) -> Settings {
    Settings {
        horizon: Some(horizon.into()),
        most_states: 20_000,
        ..Settings::default()
    }
}

#[track_caller]
fn assert_encloses(found: &TimedOptimum, value: f64) {
    assert!(
        found.lower <= value && value <= found.upper,
        "{value} is outside of {found:?}"
    );
}

#[test]
fn concurrent_maintenance_is_optimal() {
    let found = of_experiment(
        "machines",
        &Settings {
            most_states: 200_000,
            ..Settings::default()
        },
    );
    assert_encloses(&found, 0.9_f64.powi(3));
    assert_eq!(found.stop, Stop::Close);
}

/// Six concurrent actions of random duration, and one after them. Free start and cancel times have
/// too many states. Starting each action as soon as it is possible has few.
#[test]
fn many_concurrent_actions_have_lower_bound_within_a_plan() {
    let names = ["a", "b", "c", "d", "e", "f"];
    let predicates = names.map(|name| format!("(todo-{name}) (done-{name})"));
    let actions = names.map(|name| {
        format!(
            "(:durative-action do-{name} :parameters () :duration (= ?duration 4)
               :condition (at start (todo-{name}))
               :effect (and (at start (not (todo-{name}))) (at end (done-{name}))))"
        )
    });
    let needs = names.map(|name| format!("(at start (done-{name}))"));
    let domain = format!(
        "(define (domain d) (:requirements :durative-actions :timed-initial-literals)
           (:predicates (day) (finished) {}) {}
           (:durative-action finish :parameters () :duration (= ?duration 2)
             :condition (and (at end (day)) {}) :effect (at end (finished))))",
        predicates.join(" "),
        actions.join("\n"),
        needs.join(" ")
    );
    let todo = names.map(|name| format!("(todo-{name})"));
    let problem = format!(
        "(define (problem p) (:domain d) (:init (day) (at 12 (not (day))) {})
           (:goal (finished)))",
        todo.join(" ")
    );
    let world = "format = \"elbowroom-world\"\nversion = 1
        [[duration]]\naction = \"finish\"\nconstant = 2
        [[duration]]\naction = \"*\"\nuniform = { from = 0.2, to = 10.2 }
        [[duration]]\naction = \"finish\"\nconstant = 2";
    let plan = names.map(|name| format!("(do-{name})")).into_iter();
    let settings = Settings {
        most_states: 30_000,
        plans: vec![plan.chain(["(finish)".to_owned()]).collect()],
        ..Settings::default()
    };
    let found = bounds(&domain, &problem, world, &settings);
    // Each is done by 10 with probability 0.98, all six with its sixth power.
    let by_hand = 0.98_f64.powi(6);
    assert_encloses(&found, by_hand);
    assert!(found.within.is_some(), "{found:?}");
    assert!(found.lower > by_hand - 0.05, "{found:?}");
}

/// A vase is to be carried home before dark, and may be knocked over on the way if it is not
/// carried with care. If there are too many states, the upper bound is that of a world without this
/// failure.
#[test]
fn too_many_states_give_upper_bound_of_relaxed_world() {
    let domain = "(define (domain d) (:requirements :durative-actions :timed-initial-literals)
        (:predicates (day) (whole) (home))
        (:durative-action carry :parameters () :duration (= ?duration 6)
          :condition (and (over all (day)) (at end (whole))) :effect (at end (home))))";
    let problem = "(define (problem p) (:domain d) (:init (day) (whole) (at 8 (not (day))))
        (:goal (home)))";
    let world = "format = \"elbowroom-world\"\nversion = 1\n
        [[duration]]\naction = \"(carry)\"\nuniform = { from = 2, to = 10 }\n
        [[event]]\nfact = \"(whole)\"\nbecomes = false\nuniform = { from = 0, to = 16 }\nprobability = 0.5\n";
    let of = |most_states| {
        let settings = Settings {
            most_states,
            ..Settings::default()
        };
        bounds(domain, problem, world, &settings)
    };
    let known = of(2_000_000);
    assert_eq!(known.stop, Stop::Close);
    // In time with three quarters, and whole with 1 - t / 32 at t, which is 5 on average.
    let by_hand = 0.75 * (1.0 - 5.0 / 32.0);
    assert!(
        known.lower <= by_hand && by_hand <= known.upper,
        "{known:?}"
    );
    let found = (1..10_000)
        .map(of)
        .find(|found| found.grids.is_empty() && found.upper < 1.0);
    let found = found.expect("the kinder world has fewer states");
    assert_eq!(found.stop, Stop::TooManyStates);
    assert!(found.upper >= 0.75 && found.upper < 0.9, "{found:?}");
}

#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few steps")]
fn door_with_rates_matches_hand_computation() {
    // The door is open at first, closes once in ten seconds and opens once in five. Going through
    // takes 4, and the day is over at 12. After a failure, the best policy starts again as soon as
    // the door is open.
    let domain = "(define (domain d) (:requirements :durative-actions :timed-initial-literals)
        (:predicates (open) (day) (through))
        (:durative-action go :parameters () :duration (= ?duration 4)
          :condition (and (over all (open)) (at end (day))) :effect (at end (through))))";
    let problem = "(define (problem p) (:domain d)
        (:init (open) (day) (at 12 (not (day)))) (:goal (through)))";
    let world = "format = \"elbowroom-world\"\nversion = 1
        [[hazard]]\nfact = \"open\"\nbecomes_true_per_second = 0.2\nbecomes_false_per_second = 0.1";
    let settings = Settings {
        gap: 0.02,
        ..Settings::default()
    };
    let found = bounds(domain, problem, world, &settings);
    // With s seconds left and the door open: success with exp(-0.4), or else it closes after t, and
    // is open again after u more. Computed backwards on a fine grid by the midpoint rule.
    let steps_per_second = 200_u32;
    let step = 1.0 / f64::from(steps_per_second);
    let needed = 4 * steps_per_second as usize;
    let count = 12 * steps_per_second as usize;
    let (mut open, mut shut) = (vec![0.0; count + 1], vec![0.0; count + 1]);
    for left in 1..=count {
        open[left] = if left < needed {
            0.0
        } else {
            let closed = (0..needed).map(|after| {
                let p = (-0.1 * after as f64 * step).exp() * -(-0.1 * step).exp_m1();
                p * f64::midpoint(shut[left - after - 1], shut[left - after])
            });
            (-0.4_f64).exp() + closed.sum::<f64>()
        };
        let opens = -(-0.2 * step).exp_m1();
        shut[left] = opens * open[left - 1] + (1.0 - opens) * shut[left - 1];
    }
    let value = open[count];
    assert!((0.7..0.95).contains(&value), "{value}");
    assert!(
        found.lower - 1e-3 <= value && value <= found.upper + 1e-3,
        "{value} is outside of {found:?}"
    );
    assert_eq!(found.stop, Stop::Close, "{found:?}");
}

#[test]
fn fact_deleted_and_added_in_one_cell_holds_afterwards() {
    // The door closes at 2.5 and opens again at 3, and going through takes 4. On a coarse grid both
    // happen in one cell, in an unknown order.
    let domain = "(define (domain d) (:requirements :durative-actions :timed-initial-literals)
        (:predicates (open) (day) (through))
        (:durative-action go :parameters () :duration (= ?duration 4)
          :condition (and (over all (open)) (at end (day))) :effect (at end (through))))";
    let problem = "(define (problem p) (:domain d)
        (:init (open) (day) (at 2.5 (not (open))) (at 3 (open)) (at 8 (not (day)))) (:goal (through)))";
    let world = "format = \"elbowroom-world\"\nversion = 1";
    for first_cells in 1..=32 {
        let settings = Settings {
            first_cells,
            gap: 1.0,
            ..Settings::default()
        };
        assert_encloses(&bounds(domain, problem, world, &settings), 1.0);
    }
    assert_encloses(&bounds(domain, problem, world, &Settings::default()), 1.0);
}

#[test]
fn waiting_for_the_door_succeeds() {
    // The door opens at 3 for certain, and closes at a time in [5, 9]; going through takes 2. A
    // policy that waits at the door is through at 5.
    let domain = "(define (domain d) (:requirements :durative-actions)
        (:predicates (open) (through))
        (:durative-action go :parameters () :duration (= ?duration 2)
          :condition (over all (open)) :effect (at end (through))))";
    let problem = "(define (problem p) (:domain d) (:init (at 3 (open))) (:goal (through)))";
    let world = "format = \"elbowroom-world\"\nversion = 1
        [[event]]\nfact = \"(open)\"\nbecomes = false\nuniform = { from = 4, to = 8 }";
    let found = bounds(domain, problem, world, &Settings::default());
    assert_encloses(&found, 0.75);
    assert_eq!(found.stop, Stop::Close);
}

#[test]
fn early_darkness_does_not_raise_the_bound() {
    // A match burns 4 or 8, each half of the time, and mending takes 5 in its light. Rounding the
    // duration of the match down or that of mending up would both be wrong. There is one match, and
    // it must burn down: if it could be dropped, there would be light forever.
    let domain = "(define (domain d) (:requirements :durative-actions)
        (:predicates (unused) (light) (burnt) (mended) (day) (done))
        (:action finish :parameters () :precondition (and (mended) (burnt) (day)) :effect (done))
        (:durative-action burn :parameters () :duration (= ?duration 4)
          :condition (at start (unused))
          :effect (and (at start (light)) (at start (not (unused))) (at end (not (light))) (at end (burnt))))
        (:durative-action mend :parameters () :duration (= ?duration 5)
          :condition (over all (light)) :effect (at end (mended))))";
    let problem = "(define (problem p) (:domain d) (:init (unused) (day) (at 9 (not (day))))
        (:goal (done)))";
    let world = "format = \"elbowroom-world\"\nversion = 1
        [[duration]]\naction = \"burn\"\nvalues = [4, 8]";
    assert_encloses(&bounds(domain, problem, world, &Settings::default()), 0.5);
}

#[test]
fn unsupported_features_are_rejected_by_name() {
    let refused = |domain: &str, world: &str| {
        let task = task(
            &format!(
                "(define (domain d) (:requirements :durative-actions :fluents) (:predicates (a) (b)) (:functions (n)) {domain})"
            ),
            "(define (problem p) (:domain d) (:init (a) (at 9 (not (a)))) (:goal (b)))",
        );
        let world = format!("format = \"elbowroom-world\"\nversion = 1\n{world}");
        let model = WorldModel::read(world.as_str(), task.problem()).expect("it is a world");
        let found = optimum(&task, &model, &Settings::default(), &|| true);
        found.expect_err("it is refused").what
    };
    let go = "(:durative-action go :parameters () :duration (= ?duration 2)
        :condition () :effect (at end (b)))";
    let chosen = go.replace("(= ?duration 2)", "(<= ?duration 2)");
    assert_eq!(
        refused(&chosen, ""),
        "(go) has a duration that the plan chooses"
    );
    assert_eq!(
        refused(go, "[[delay]]\naction = \"*\"\nconstant = 1"),
        "(go) has a delay"
    );
    assert_eq!(
        refused(
            go,
            "[[hazard]]\nfact = \"a\"\nbecomes_false_per_second = 0.1\nreported = false"
        ),
        "the world has facts that change at a rate without being reported"
    );
    let outcome = |when: &str, rest: &str| {
        format!(
            "[[failure]]\naction = \"go\"\nprobability = 0.5\nwhen = \"{when}\"
            [[failure.outcome]]\nprobability = 1\n{rest}"
        )
    };
    assert_eq!(
        refused(go, &outcome("end", "increase = { \"(n)\" = 1 }")),
        "(go) has failures with outcomes that change numbers"
    );
    assert_eq!(
        refused(
            go,
            &outcome("midway", "becomes_true = [\"(b)\"]\nreported = false")
        ),
        "(go) has failures with outcomes that are not reported"
    );
    assert_eq!(
        refused(go, &outcome("start", "delay = 1")),
        "(go) has a start that fails with outcomes"
    );
    assert_eq!(
        refused(go, "[reports]\nlost = 0.5"),
        "the world's reports are not perfect"
    );
}

#[test]
fn a_goal_that_a_timed_initial_changes_is_refused() {
    let task = task(
        "(define (domain d) (:requirements :strips) (:predicates (a))
            (:action make :parameters () :precondition () :effect (a)))",
        "(define (problem p) (:domain d) (:init (at 9 (not (a)))) (:goal (a)))",
    );
    let world = "format = \"elbowroom-world\"\nversion = 1\n";
    let model = WorldModel::read(world, task.problem()).expect("it is a world");
    let found = optimum(&task, &model, &Settings::default(), &|| true);
    assert_eq!(
        found.expect_err("it is refused").what,
        "a timed initial changes a fact or number of the goal, so the goal is not yet reached when it holds"
    );
}

#[test]
fn failure_effects_match_hand_computation() {
    // A grasp takes 4 and fails half of the time. Then half of the parcels fall, and can be picked
    // up in 3; the others jam the gripper for 2 more. The counter closes at 10.5. At 4, half are
    // held, a quarter have fallen and are held at 7, and a quarter is on the shelf at 6, of which
    // half are held at 10.
    let domain = "(define (domain d) (:requirements :durative-actions :timed-initial-literals)
        (:predicates (shelf) (floor) (open) (held) (done))
        (:durative-action grasp :parameters () :duration (= ?duration 4)
          :condition (at start (shelf)) :effect (and (at start (not (shelf))) (at end (held))))
        (:durative-action pick-up :parameters () :duration (= ?duration 3)
          :condition (at start (floor)) :effect (and (at start (not (floor))) (at end (held))))
        (:action show :parameters () :precondition (and (held) (open)) :effect (done)))";
    let problem = "(define (problem p) (:domain d) (:init (shelf) (open) (at 10.5 (not (open))))
        (:goal (done)))";
    let world = "format = \"elbowroom-world\"\nversion = 1
        [[failure]]\naction = \"grasp\"\nprobability = 0.5\nundone = true
        [[failure.outcome]]\nprobability = 0.5
        becomes_true = [\"(floor)\"]\nbecomes_false = [\"(shelf)\"]
        [[failure.outcome]]\nprobability = 0.5\ndelay = 2";
    let found = bounds(domain, problem, world, &Settings::default());
    assert_encloses(&found, 0.5 + 0.25 + 0.125);
    assert_eq!(found.stop, Stop::Close);
    // With one more second, it is too late for another attempt.
    let late = world.replace("delay = 2", "delay = 3");
    let found = bounds(domain, problem, &late, &Settings::default());
    assert_encloses(&found, 0.75);
}

#[test]
fn careful_policy_beats_fast_policy() {
    let settings = Settings {
        most_states: 300_000,
        gap: 0.05,
        ..Settings::default()
    };
    let best = of_experiment("counter", &settings);
    let quick = [
        "(drive depot shelf)",
        "(drive shelf office)",
        "(grasp-quickly shelf)",
        "(hand-over-quickly office)",
    ];
    let only = Some(quick.map(str::to_owned).into());
    let shortest = of_experiment("counter", &Settings { only, ..settings });
    assert!(shortest.upper < best.lower, "{shortest:?} {best:?}");
}

/// A key lies where a step begins that can only be done at the press. The step leaves it behind
/// when it starts, and fails at once anywhere else.
#[test]
fn action_that_aborts_at_once_is_not_started() {
    let domain = |initial: &str| {
        let domain = "(define (domain d) (:requirements :durative-actions)
           (:predicates (at-press) (ready) (key) (open))
           (:durative-action press :parameters () :duration (= ?duration 2)
             :condition (and (at start (ready)) (over all (at-press)))
             :effect (and (at start (not (ready))) (at start (key))))
           (:durative-action unlock :parameters () :duration (= ?duration 1)
             :condition (at start (key)) :effect (at end (open))))";
        let problem =
            format!("(define (problem p) (:domain d) (:init (ready) {initial}) (:goal (open)))");
        bounds(
            domain,
            &problem,
            "format = \"elbowroom-world\"\nversion = 1\n",
            &until(20),
        )
    };
    assert_encloses(&domain("(at-press)"), 1.0);
    let found = domain("");
    assert!(found.upper < 1e-6, "{found:?}");
}

/// An amount between 0 and 80 is added twice, and 60 are enough. Two insufficient amounts may be
/// enough together.
#[test]
fn sum_of_two_draws_is_cut_at_half_thresholds() {
    let domain = "(define (domain d) (:requirements :durative-actions :fluents)
       (:predicates (first) (second) (last) (full)) (:functions (weight))
       (:durative-action once :parameters () :duration (= ?duration 2)
         :condition (at start (first))
         :effect (and (at start (not (first))) (at end (second))
                      (at end (increase (weight) 40))))
       (:durative-action again :parameters () :duration (= ?duration 2)
         :condition (at start (second))
         :effect (and (at start (not (second))) (at end (last))
                      (at end (increase (weight) 40))))
       (:durative-action close :parameters () :duration (= ?duration 1)
         :condition (and (at start (last)) (at start (>= (weight) 60)))
         :effect (at end (full))))";
    let problem = "(define (problem p) (:domain d) (:init (first) (= (weight) 0)) (:goal (full)))";
    let amount = |action: &str| {
        format!(
            "[[amount]]\naction = \"{action}\"\nfluent = \"weight\"\n\
             uniform = {{ from = 0, to = 80 }}\n"
        )
    };
    let world = format!(
        "format = \"elbowroom-world\"\nversion = 1\n{}{}",
        amount("once"),
        amount("again")
    );
    let found = bounds(domain, problem, &world, &until(20));
    assert_encloses(&found, 1.0 - 60.0 * 60.0 / 2.0 / (80.0 * 80.0));
    // Cut at 60 alone, only a draw of 60 or more is known to be enough.
    assert!(found.lower > 1.0 - 0.75 * 0.75 + 0.1, "{found:?}");
    assert!(found.upper < 0.9, "{found:?}");
}
