//! Comparison of `policy` with the timed optimum and with all other executors, in the worlds of
//! `experiments` and in small random ones.
//!
//! `ELBOWROOM_TRIALS=2000` sets the number of trials of each world, and the table is printed
//! (`--nocapture`).

#![allow(clippy::print_stdout, reason = "the table is worth seeing")]

mod failures;

use crate::twin;
use std::sync::Arc;

use elbowroom::execute::{Embedded, Execution};
use elbowroom::mdp::{Policy, Settings};
use elbowroom_execution::run::{Report, Verdict};
use elbowroom_execution::{ActionValues, PlanAnswer, Planner};
use elbowroom_laboratory::compare::TimedCounts;
use elbowroom_laboratory::results::Results;
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_sim::WorldModel;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::twin::SmallWorld;

fn trials() -> u64 {
    let told = std::env::var("ELBOWROOM_TRIALS").ok();
    told.map_or(200, |told| told.parse().expect("a number of trials"))
}

fn results(name: &str, jobs: usize, trials: u64) -> Results<TimedCounts> {
    let results = crate::shared::results(&crate::shared::experiment(name), jobs, trials);
    println!("{name}\n{}", results.records().csv());
    for optimum in &results.counts.optimum {
        println!("optimum: {:.4} to {:.4}", optimum.lower, optimum.upper);
    }
    results
}

/// Returns three standard errors of a share.
#[allow(clippy::cast_precision_loss, reason = "there are few trials")]
fn doubt(share: f64, trials: u64) -> f64 {
    let share = share.clamp(0.0, 1.0);
    3.0 * (share * (1.0 - share)).sqrt() / (trials as f64).sqrt()
}

#[allow(clippy::cast_precision_loss, reason = "there are few trials")]
fn is_near_the_optimum_and_above_all_others(name: &str) {
    let trials = trials();
    let results = results(name, 0, trials);
    let optimum = &results.counts.optimum[0];
    assert!(optimum.unknown.is_none(), "{optimum:?}");
    assert!(optimum.upper - optimum.lower <= 0.01, "{optimum:?}");
    assert_eq!(results.counts.rows[0], "policy");
    let share =
        results.counts.cells[0][0].successes as f64 / results.counts.cells[0][0].runs as f64;
    let doubt = doubt(optimum.lower, trials);
    assert!(
        share >= optimum.upper - 0.02 - doubt && share <= optimum.upper + doubt,
        "{name}: {share} beside {optimum:?}"
    );
    // In the same worlds, an executor that is not worse loses about as often as it wins.
    let rows = results.counts.rows.iter().enumerate();
    for (row, name) in rows.filter(|(_, name)| *name != "clairvoyant") {
        let pair = results.counts.pairs[row][0];
        let (lost, won) = (pair.only_this as f64, pair.only_first as f64);
        assert!(
            lost - won <= 3.0 * (lost + won).sqrt(),
            "{name} is better: {lost} against {won}"
        );
    }
}

#[test]
fn two_seams_are_welded_before_the_shift_ends() {
    is_near_the_optimum_and_above_all_others("weld");
}

#[test]
fn a_rover_is_back_before_it_gets_dark() {
    is_near_the_optimum_and_above_all_others("detour");
}

#[test]
fn two_robots_hand_over_a_box_before_the_ramp_closes() {
    is_near_the_optimum_and_above_all_others("rendezvous");
}

#[test]
fn a_key_is_fetched_from_behind_a_door() {
    is_near_the_optimum_and_above_all_others("door");
}

/// A slipping parcel falls or jams the gripper, which costs more than a careful grasp.
#[test]
fn a_parcel_that_may_fall_is_grasped_with_care() {
    is_near_the_optimum_and_above_all_others("spill");
}

#[test]
fn machines_are_maintained_concurrently() {
    is_near_the_optimum_and_above_all_others("machines");
}

/// The likelihoods are rates per second, so sequential execution has a cost.
#[test]
fn likelihood_executors_maintain_machines_in_parallel() {
    let results = results("machines", 0, 100);
    let won = |name: &str| {
        let row = results.counts.rows.iter().position(|row| row == name);
        results.counts.cells[row.expect("a row of the table")][0].successes
    };
    for executor in ["adaptable", "lookahead"] {
        for baseline in ["esterel", "stn", "guarded", "live"] {
            assert!(
                won(executor) >= won(baseline),
                "{executor} is below {baseline}"
            );
        }
    }
}

#[test]
fn runs_depend_on_seed_but_not_on_threads() {
    let one = results("weld", 1, 40);
    let two = results("weld", 2, 40);
    assert_eq!(one.json(), two.json());
}

/// World with a first plan, as text.
struct Small<'a> {
    domain: &'a str,
    problem: &'a str,
    world: &'a str,
    /// First plan; `None` for the planner's.
    plan: Option<&'a str>,
    ends: Rational,
}

/// Results of `policy` in a world: the bounds of its table, and the runs.
struct PolicyResults {
    lower: f64,
    upper: f64,
    reports: Vec<Report>,
    /// Runs of executors that do not evaluate moves, in the same worlds.
    others: Vec<Vec<Report>>,
}

/// Executors that do not use likelihoods.
const BASELINES: [&str; 5] = ["esterel", "stn", "guarded", "live", "fixed:100"];

/// Returns the results in a world, or `None` if there is no plan to begin with.
fn made_of(small: &Small<'_>, runs: u64) -> Option<PolicyResults> {
    let source = |text: &str| Source::new("test", text);
    let read = read_problem(&source(small.domain), &source(small.problem));
    let task = Arc::new(Task::new(read.expect("it is PDDL").0));
    let model = WorldModel::read(small.world, task.problem()).expect("a world");
    let plan = match small.plan {
        Some(text) => read_plan(&source(text), &task).expect("it is a plan").0,
        None => match Embedded::default()
            .plan(&task, &Situation::initial(&task))
            .answer
        {
            PlanAnswer::Plan(plan) => plan,
            _ => return None,
        },
    };
    let settings = Settings {
        most_states: 20_000,
        horizon: Some(small.ends.clone()),
        ..Settings::default()
    };
    let policy = Policy::new(&task, &model, &settings, &|| true);
    let policy = policy.expect("all of it is known to the process")?;
    let (lower, upper) = (policy.optimum().lower, policy.optimum().upper);
    let action_values: Arc<dyn ActionValues> = Arc::new(policy);
    let runs_of = |executor: &str| -> Vec<Report> {
        let runs = (0..runs).map(|seed| {
            let execution = Execution::of(&task)
                .by(executor.parse().expect("it is registered"))
                .beginning_with(plan.clone())
                .with_action_values(Some(Arc::clone(&action_values)));
            execution.run_in(&mut *model.world(&task, seed))
        });
        runs.collect()
    };
    Some(PolicyResults {
        lower,
        upper,
        reports: runs_of("policy"),
        others: BASELINES.map(runs_of).into(),
    })
}

/// In the world that it knows, `policy` succeeds as often as its table and the plain recursion
/// predict, up to sampling error. The worlds include deterministic and random ones, facts that
/// change at rates, and failures with outcomes and delays. The success rate lies between the bounds
/// of its table. No executor that does not evaluate moves is better in the same worlds, up to
/// sampling error and two points.
#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few runs")]
fn policy_matches_recursion_in_random_small_worlds() {
    const RUNS: u64 = 200;
    const OF_EACH_KIND: usize = 5;
    let mut tried = [0; 4];
    // Over all worlds, by baseline: the number of runs that only the baseline wins, and that only
    // `policy` wins.
    let mut pairs = [(0.0_f64, 0.0_f64); BASELINES.len()];
    for number in 0..800 {
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let asks_for_less = number % 2 == 0;
        let (world, kind) = match number {
            0..400 => (SmallWorld::random(&mut rng, asks_for_less), None),
            400..600 => (SmallWorld::with_rates(&mut rng, asks_for_less), Some(2)),
            _ => (SmallWorld::with_outcomes(&mut rng, asks_for_less), Some(3)),
        };
        if kind.is_some_and(|kind| tried[kind] == OF_EACH_KIND) {
            continue;
        }
        let (worst, best) = world.best();
        let kind = kind.unwrap_or(usize::from(worst < 0.99));
        if best == 0.0 || tried[kind] == OF_EACH_KIND {
            continue;
        }
        let small = Small {
            domain: &world.domain(),
            problem: &world.problem(),
            world: &world.world(),
            plan: None,
            ends: Rational::from(i64::from(twin::ENDS)),
        };
        let Some(made) = made_of(&small, RUNS) else {
            continue;
        };
        let PolicyResults {
            lower,
            upper,
            reports,
            others,
        } = made;
        // Successive happenings are ε apart, so that the end in the last second is slightly late.
        let ends = &small.ends + Rational::new(1, 10);
        let is_won =
            |report: &&Report| report.verdict == Verdict::GoalReached && report.time <= ends;
        let share = reports.iter().filter(is_won).count() as f64 / RUNS as f64;
        println!("{number}: table {lower:.3}, recursion {worst:.3} to {best:.3}, runs {share:.3}");
        let at_least = (worst - 0.02).max(lower - 0.001);
        let lost = reports.iter().find(|report| !is_won(report));
        assert!(
            share >= at_least - doubt(at_least, RUNS) && share <= best + doubt(best, RUNS),
            "{number}: {share} is not between {worst} and {best}, table {lower}\n{world:#?}\n{lost:#?}"
        );
        assert!(
            share <= upper + doubt(upper, RUNS),
            "{number}: {share} is more than {upper}, which nobody exceeds"
        );
        for (place, others) in others.iter().enumerate() {
            let both = reports.iter().zip(others);
            let only = |wins: bool| {
                let runs = both.clone();
                let runs =
                    runs.filter(|(own, other)| is_won(own) != is_won(other) && is_won(own) == wins);
                runs.count() as f64
            };
            let (lost, won) = (only(false), only(true));
            assert!(
                lost - won <= 3.0 * (lost + won).sqrt() + 0.02 * RUNS as f64,
                "{number}: {} is better: {lost} against {won}\n{world:#?}",
                BASELINES[place]
            );
            pairs[place].0 += lost;
            pairs[place].1 += won;
        }
        tried[kind] += 1;
    }
    assert_eq!(tried, [OF_EACH_KIND; 4], "too few worlds have a plan");
    for (name, (lost, won)) in BASELINES.iter().zip(pairs) {
        println!("only {name} {lost}, only policy {won}");
        assert!(
            won - lost > 3.0 * (lost + won).sqrt(),
            "{name}: {lost} against {won}: weighing moves should gain something"
        );
    }
}

/// A door closes once in ten seconds and opens again within five on average. After a failure, the
/// executor starts again as soon as the door is open, and never while it is closed.
#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few runs")]
fn door_with_rates_is_tried_while_time_remains() {
    const RUNS: u64 = 400;
    let small = Small {
        domain: "(define (domain d) (:requirements :durative-actions :timed-initial-literals)
            (:predicates (open) (day) (through))
            (:durative-action go :parameters () :duration (= ?duration 4)
              :condition (and (at start (open)) (over all (open)) (at end (day)))
              :effect (at end (through))))",
        problem: "(define (problem p) (:domain d) (:init (open) (day) (at 12 (not (day))))
            (:goal (through)))",
        world: "format = \"elbowroom-world\"\nversion = 1\n
            [[hazard]]\nfact = \"(open)\"
            becomes_true_per_second = 0.2\nbecomes_false_per_second = 0.1\n",
        plan: None,
        ends: Rational::from(12),
    };
    let made = made_of(&small, RUNS).expect("there is a plan");
    let is_won = |report: &&Report| report.verdict == Verdict::GoalReached;
    let share = made.reports.iter().filter(is_won).count() as f64 / RUNS as f64;
    println!("table {:.3}, runs {share:.3}", made.lower);
    // More than at the first attempt, which is exp(-0.4).
    assert!(made.lower > 0.75, "{}", made.lower);
    let doubt = doubt(made.lower, RUNS);
    assert!(
        (made.lower - doubt..made.lower + 0.02 + doubt).contains(&share),
        "{share}"
    );
}

/// The plan passes through the goal, loses it again, and fails half of the time on the way back.
#[test]
fn running_actions_are_cancelled_when_goal_holds() {
    let small = Small {
        domain: "(define (domain lamp) (:requirements :durative-actions)
            (:predicates (lit) (pressed) (wired))
            (:durative-action press :parameters () :duration (= ?duration 4)
              :condition () :effect (and (at start (lit)) (at end (not (lit))) (at end (pressed))))
            (:durative-action wire :parameters () :duration (= ?duration 4)
              :condition (at start (pressed)) :effect (at end (lit))))",
        problem: "(define (problem p) (:domain lamp) (:init) (:goal (lit)))",
        world: "format = \"elbowroom-world\"\nversion = 1\n
            [[failure]]\naction = \"wire\"\nprobability = 0.5\n",
        plan: Some("0: (press) [4]\n4.001: (wire) [4]\n"),
        ends: Rational::from(10),
    };
    let made = made_of(&small, 20).expect("there is a plan");
    assert!(made.lower > 0.99, "{}", made.lower);
    for report in made.reports {
        assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
        assert!(report.time < Rational::from(4), "{report:#?}");
    }
}

/// Six concurrent actions of random duration, and one after them. The full process has too many
/// states; that of these seven actions has few. The first plan has other actions; it is quicker,
/// and fails half of the time.
#[test]
fn nearly_certain_plan_uses_table_of_its_actions() {
    let names = ["a", "b", "c", "d", "e", "f"];
    let actions = names.map(|name| {
        format!(
            "(:durative-action do-{name} :parameters () :duration (= ?duration 4)
               :condition (at start (todo-{name}))
               :effect (and (at start (not (todo-{name}))) (at end (done-{name}))))"
        )
    });
    let domain = format!(
        "(define (domain d) (:requirements :durative-actions :timed-initial-literals)
           (:predicates (day) (fresh) (rushed) (finished) {}) {}
           (:durative-action finish :parameters () :duration (= ?duration 2)
             :condition (and (at end (day)) {}) :effect (at end (finished)))
           (:durative-action rush :parameters () :duration (= ?duration 1)
             :condition (at start (fresh)) :effect (and (at start (not (fresh))) (at end (rushed))))
           (:durative-action deliver :parameters () :duration (= ?duration 1)
             :condition (at start (rushed)) :effect (at end (finished))))",
        names
            .map(|name| format!("(todo-{name}) (done-{name})"))
            .join(" "),
        actions.join("\n"),
        names
            .map(|name| format!("(at start (done-{name}))"))
            .join(" ")
    );
    let problem = format!(
        "(define (problem p) (:domain d) (:init (day) (fresh) (at 14 (not (day))) {})
           (:goal (finished)))",
        names.map(|name| format!("(todo-{name})")).join(" ")
    );
    let world = "format = \"elbowroom-world\"\nversion = 1
        [[duration]]\naction = \"*\"\nuniform = { from = 0.2, to = 10.2 }
        [[duration]]\naction = \"finish\"\nconstant = 2
        [[failure]]\naction = \"rush\"\nprobability = 0.5";
    let source = |text: &str| Source::new("test", text);
    let read = read_problem(&source(&domain), &source(&problem));
    let task = Arc::new(Task::new(read.expect("it is PDDL").0));
    let model = WorldModel::read(world, task.problem()).expect("a world");
    let plan = names.map(|name| format!("(do-{name})")).into_iter();
    let settings = Settings {
        most_states: 400_000,
        ..Settings::default()
    };
    let of = |plans: Vec<Vec<String>>| {
        let settings = Settings {
            plans,
            ..settings.clone()
        };
        Policy::if_near_optimal(&task, &model, &settings, &|| true).expect("all of it is known")
    };
    assert!(of(Vec::new()).is_none(), "there are not too many states");
    let quick = vec!["(rush)".to_owned(), "(deliver)".to_owned()];
    assert!(
        of(vec![quick.clone()]).is_none(),
        "it fails half of the time"
    );
    let sure = plan.chain(["(finish)".to_owned()]).collect();
    let policy = of(vec![quick, sure]).expect("one of the plans nearly always succeeds");
    let optimum = policy.optimum();
    assert!(
        optimum.within.is_some() && optimum.lower > 0.99,
        "{optimum:?}"
    );
    let action_values: Arc<dyn ActionValues> = Arc::new(policy);
    let text = "0: (rush) [1]\n1.001: (deliver) [1]\n";
    let first = read_plan(&source(text), &task).expect("it is a plan").0;
    for seed in 0..50 {
        let execution = Execution::of(&task)
            .by("policy".parse().expect("it is registered"))
            .beginning_with(first.clone())
            .with_action_values(Some(Arc::clone(&action_values)));
        let report = execution.run_in(&mut *model.world(&task, seed));
        assert_eq!(report.verdict, Verdict::GoalReached, "{seed}: {report:#?}");
        // The planner was not called.
        assert_eq!(report.replans, 0, "{seed}: {report:#?}");
    }
}
