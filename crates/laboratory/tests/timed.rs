//! The timed optimum: worlds worked by hand, and a plain recursion over small ones.

#[path = "timed/twin.rs"]
mod twin;

use elbowroom_laboratory::timed::{Settings, Stop, TimedOptimum, optimum};
use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::WorldModel;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use twin::SmallWorld;

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

#[track_caller]
fn assert_encloses(found: &TimedOptimum, value: f64) {
    assert!(
        found.lower <= value && value <= found.upper,
        "{value} is outside of {found:?}"
    );
}

#[test]
fn machines_are_best_maintained_all_at_once() {
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

/// The bounds of a small world on one grid, which enclose what the recursion found but for a `slack`.
fn enclosing(
    world: &SmallWorld,
    first_cells: u32,
    [worst, best]: [f64; 2],
    slack: f64,
) -> TimedOptimum {
    let settings = Settings {
        first_cells: first_cells as usize,
        horizon: Some(i64::from(twin::ENDS).into()),
        // One grid and no other.
        gap: 1.0,
        ..Settings::default()
    };
    let found = bounds(&world.domain(), &world.problem(), &world.world(), &settings);
    assert!(
        found.lower <= worst + slack && best <= found.upper + slack,
        "{worst} to {best} is outside of {found:?}\n{world:#?}"
    );
    found
}

#[test]
fn bounds_enclose_what_a_plain_recursion_finds() {
    let mut close = 0;
    for number in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let world = SmallWorld::random(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        for first_cells in [twin::ENDS / 2, twin::ENDS] {
            let found = enclosing(&world, first_cells, [worst, best], 1e-12);
            if first_cells == twin::ENDS && best > 0.0 && found.upper - found.lower < 0.1 {
                close += 1;
            }
        }
    }
    assert!(
        close >= 20,
        "only {close} worlds with close bounds: too few to mean something"
    );
}

/// Whoever keeps to some of the actions, and acts only when something has happened, is no better than the
/// best: never so in random worlds, and nearly as good in some.
#[test]
fn who_keeps_to_some_actions_is_never_better_than_the_best() {
    let mut near = 0;
    for number in 0..60 {
        let mut rng = ChaCha8Rng::seed_from_u64(4000 + number);
        let world = SmallWorld::random(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        let all = ["(a0)", "(a1)", "(a2)"].map(str::to_owned);
        let settings = Settings {
            first_cells: twin::ENDS as usize,
            horizon: Some(i64::from(twin::ENDS).into()),
            most_states: 1_000,
            gap: 0.0,
            plans: vec![all[..1].to_vec(), all[..2].to_vec(), all.to_vec()],
            ..Settings::default()
        };
        let found = bounds(&world.domain(), &world.problem(), &world.world(), &settings);
        let lower = found.within.map_or(0.0, |within| within.lower);
        assert!(
            lower <= best + 1e-9,
            "{lower} is more than {best}\n{world:#?}"
        );
        near += usize::from(worst > 0.0 && worst < 1.0 && lower > worst - 0.1);
    }
    assert!(
        near >= 5,
        "only {near} worlds in which that is nearly as good: too few to mean something"
    );
}

/// Six things at once, each of which takes as long as it likes, and one after them. Whoever may begin each
/// at any time, and let it go, has too many states; whoever begins all when that can be done has few.
#[test]
fn many_things_at_once_are_bounded_from_below_within_a_plan() {
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
    // Each is done by 10 with 0.98, all six with its sixth power.
    let by_hand = 0.98_f64.powi(6);
    assert_encloses(&found, by_hand);
    assert!(found.within.is_some(), "{found:?}");
    assert!(found.lower > by_hand - 0.05, "{found:?}");
}

/// A vase is to be carried home before dark, and may be knocked over on the way, if it is not carried with
/// care. Where there are too many states, the bound from above is that of a world in which nobody does so.
#[test]
fn with_too_many_states_the_bound_from_above_is_that_of_a_kinder_world() {
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
fn bounds_enclose_what_a_plain_recursion_finds_where_failures_leave_something_behind() {
    let (mut close, mut matters) = (0, 0);
    for number in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(2000 + number);
        let world = SmallWorld::with_outcomes(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        for first_cells in [twin::ENDS / 2, twin::ENDS] {
            let found = enclosing(&world, first_cells, [worst, best], 1e-12);
            let is_open = best > 0.0 && worst < 1.0;
            if first_cells == twin::ENDS && is_open && found.upper - found.lower < 0.3 {
                close += 1;
                let (plain, _) = world.without_outcomes().best();
                matters += usize::from((plain - worst).abs() > 0.01);
            }
        }
    }
    assert!(
        close >= 20 && matters >= 10,
        "only {close} worlds with close bounds, and in {matters} of them outcomes matter: too few \
         to mean something"
    );
}

/// With numbers that vary; in half of the worlds everything happens at known times.
#[test]
fn bounds_enclose_what_a_plain_recursion_finds_where_numbers_change() {
    let (mut close, mut matters) = ([0; 2], 0);
    for number in 0..worlds(200) {
        let mut rng = ChaCha8Rng::seed_from_u64(6000 + number);
        let world = SmallWorld::with_numbers(&mut rng, number % 2 == 0);
        let plain = world.without_numbers().best();
        for world in [world.clone(), world.with_known_times()] {
            let (worst, best) = world.best();
            for first_cells in [twin::ENDS / 2, twin::ENDS] {
                let found = enclosing(&world, first_cells, [worst, best], 1e-9);
                let is_open = best > 0.0 && worst < 1.0;
                if first_cells == twin::ENDS && is_open && found.upper - found.lower < 0.3 {
                    close[usize::from(world.has_known_times())] += 1;
                    matters += usize::from((plain.0 - worst).abs() > 0.01);
                }
            }
        }
    }
    assert!(
        close.iter().all(|close| *close >= 8) && matters >= 5,
        "only {close:?} worlds with close bounds, and in {matters} of them numbers matter: too few \
         to mean something"
    );
}

/// Facts and failures, where everything happens at known times.
#[test]
fn bounds_enclose_what_a_plain_recursion_finds_at_known_times() {
    let mut close = 0;
    for number in 0..worlds(200) {
        let mut rng = ChaCha8Rng::seed_from_u64(7000 + number);
        let asks_for_less = number % 2 == 0;
        let world = if number % 3 == 0 {
            SmallWorld::with_outcomes(&mut rng, asks_for_less)
        } else {
            SmallWorld::random(&mut rng, asks_for_less)
        };
        let world = world.with_known_times();
        let (worst, best) = world.best();
        let found = enclosing(&world, twin::ENDS, [worst, best], 1e-9);
        let is_open = best > 0.0 && worst < 1.0;
        close += usize::from(is_open && found.upper - found.lower < 0.2);
    }
    assert!(
        close >= 12,
        "only {close} worlds with close bounds: too few to mean something"
    );
}

/// So many worlds, or as many as the environment asks for.
fn worlds(count: u64) -> u64 {
    let asked_for = std::env::var("ELBOWROOM_WORLDS").ok();
    asked_for.map_or(count, |text| text.parse().expect("a number of worlds"))
}

#[test]
fn bounds_enclose_what_a_plain_recursion_finds_where_facts_change_at_rates() {
    // More than twice in a second, which the recursion leaves out.
    const LEFT_OUT: f64 = 5e-4;
    let mut close = 0;
    for number in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + number);
        let world = SmallWorld::with_rates(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        for first_cells in [twin::ENDS / 2, twin::ENDS] {
            let found = enclosing(&world, first_cells, [worst, best], LEFT_OUT);
            let is_open = best > 0.0 && worst < 1.0 - LEFT_OUT;
            if first_cells == twin::ENDS && is_open && found.upper - found.lower < 0.3 {
                close += 1;
            }
        }
    }
    assert!(
        close >= 10,
        "only {close} worlds with close bounds: too few to mean something"
    );
}

#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few steps")]
fn a_door_that_opens_and_closes_at_rates_is_gone_through_when_it_lets_one() {
    // It stands open at first, closes once in ten seconds and opens once in five; going through
    // takes 4, and at 12 the day is over. Whoever fails begins again as soon as it is open.
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
    // With s seconds left and the door open: through with exp(-0.4), or else it closes after t, and
    // is open again after u more. Backwards on a fine grid, by the midpoint rule.
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
fn what_is_taken_away_and_given_back_in_one_cell_is_there_after_it() {
    // The door closes at 2.5 and opens again at 3, and going through takes 4. Seen on a coarse
    // grid both happen in one cell, and nobody knows in which order.
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
fn who_waits_for_the_door_goes_through_it() {
    // The door opens at 3 for certain, and closes at a time in [5, 9]; going through takes 2. Who
    // waits at the door is through at 5.
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
fn light_that_goes_out_early_is_no_gain() {
    // A match burns 4 or 8, each half of the time, and mending takes 5 in its light: rounding the
    // match down or the mending up would both be wrong. There is one match, and it must burn down:
    // who could drop it would have light for ever.
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
fn what_the_process_does_not_know_is_refused_by_name() {
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
        "(go) has a duration that is to be chosen"
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
        "the world has facts that change at a rate and does not report it"
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
        "a timed initial changes what the goal reads, so that the goal is not reached as soon as it \
         holds"
    );
}

#[test]
fn what_a_failure_leaves_behind_and_costs_is_worth_what_hand_says() {
    // A grasp takes 4 and fails half of the time; then half of the parcels fall, from where they are
    // picked up in 3, and the others jam the gripper for 2 more. The counter closes at 10.5. At 4:
    // half are there; a quarter have fallen, and are there at 7; a quarter is on the shelf at 6, and
    // half of these are there at 10.
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
    // A second more, and it is too late for another attempt.
    let late = world.replace("delay = 2", "delay = 3");
    let found = bounds(domain, problem, &late, &Settings::default());
    assert_encloses(&found, 0.75);
}

#[test]
fn being_quick_at_everything_is_no_match_for_taking_care() {
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
