//! Better plans near the best one: as short as the optimum, the same in each run, and stopped on
//! request.

use std::ops::ControlFlow;

use elbowroom_model::validate::{self, Verdict, validate};
use elbowroom_model::{Situation, Task};
use elbowroom_planner::{Answer, FoundPlan, Member, Phase, Settings, Stopped, Technique, plan};

use crate::embedded::world::{describe, task};

/// Jobs of several operations, one after the other; `durations[job][machine]`. Each job visits the
/// machines in its own order, and each machine processes one job at a time. With `takes_hands`,
/// each operation takes one of many hands: a search that compresses actions makes operations wait
/// for each other because of that.
pub(crate) type Shop = Vec<Vec<(usize, i64)>>;

pub(crate) fn shop(jobs: &Shop, takes_hands: bool) -> Task {
    let mut domain =
        String::from("(:requirements :durative-actions :numeric-fluents) (:predicates");
    let (condition, effects) = if takes_hands {
        let effects = "(at start (decrease (hands) 1)) (at end (increase (hands) 1))";
        ("(at start (>= (hands) 1))", effects)
    } else {
        ("", "")
    };
    let (mut actions, mut init, mut goal) = (String::new(), String::new(), String::new());
    let machines = jobs.iter().flatten().map(|operation| operation.0);
    for machine in 0..=machines.max().unwrap_or(0) {
        domain += &format!(" (free{machine})");
        init += &format!(" (free{machine})");
    }
    for (job, operations) in jobs.iter().enumerate() {
        domain += &format!(" (at{job}-0)");
        init += &format!(" (at{job}-0)");
        for (number, (machine, duration)) in operations.iter().enumerate() {
            let next = number + 1;
            domain += &format!(" (at{job}-{next})");
            actions += &format!(
                "(:durative-action do{job}-{number} :parameters () :duration (= ?duration {duration})
                  :condition (and (at start (at{job}-{number})) (at start (free{machine}))
                    {condition})
                  :effect (and (at start (not (at{job}-{number}))) (at start (not (free{machine})))
                    {effects}
                    (at end (free{machine})) (at end (at{job}-{next}))))"
            );
        }
        goal += &format!(" (at{job}-{})", operations.len());
    }
    task(
        &format!("{domain}) (:functions (hands)) {actions}"),
        &format!("(:init (= (hands) 9) {init}) (:goal (and {goal}))"),
    )
}

/// Returns the shortest makespan over all orders of operations, each as early as its job and its
/// machine allow.
fn shortest(jobs: &Shop) -> i64 {
    fn best(
        jobs: &Shop,
        done: &mut [usize],
        ready: &mut [i64],
        free: &mut [i64],
        most: i64,
    ) -> i64 {
        let mut found = i64::MAX;
        let mut is_over = true;
        for job in 0..jobs.len() {
            let Some(&(machine, duration)) = jobs[job].get(done[job]) else {
                continue;
            };
            is_over = false;
            let before = (ready[job], free[machine]);
            let end = before.0.max(before.1) + duration;
            (ready[job], free[machine]) = (end, end);
            done[job] += 1;
            found = found.min(best(jobs, done, ready, free, most.max(end)));
            done[job] -= 1;
            (ready[job], free[machine]) = before;
        }
        if is_over { most } else { found }
    }
    best(
        jobs,
        &mut vec![0; jobs.len()],
        &mut vec![0; jobs.len()],
        &mut [0; 8],
        0,
    )
}

/// Returns the plans that are reported up to report `most`, and the answer.
fn run(task: &Task, settings: &Settings, most: usize) -> (Vec<FoundPlan>, Answer) {
    let situation = Situation::initial(task);
    let (mut plans, mut reports) = (Vec::new(), 0);
    let answer = plan(task, &situation, settings, &mut |progress| {
        plans.extend(progress.plan.clone());
        reports += 1;
        if reports < most {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    (plans, answer)
}

const NEAR_THE_BEST: [Technique; 2] = [Technique::Rescheduling, Technique::Repair];

/// Returns settings for a single search, with or without refinement.
fn settings(is_refining: bool) -> Settings {
    let mut settings = Settings::default();
    settings.tuning.only = Some(Member::Compressing);
    if !is_refining {
        settings.tuning.without = NEAR_THE_BEST.to_vec();
    }
    settings
}

/// Returns a shop generated from a seed.
pub(crate) fn made_up(seed: usize, jobs: usize, machines: usize) -> Shop {
    let job = |job: usize| {
        let operation = |number: usize| {
            let mixed = (seed * 31 + job * 17 + number * 7 + 3) * 2_654_435_761;
            let machine = (number * (1 + (job + seed) % 2) + job) % machines;
            (machine, 1 + i64::try_from(mixed >> 7 & 15).unwrap())
        };
        (0..machines).map(operation).collect()
    };
    (0..jobs).map(job).collect()
}

#[test]
fn small_shops_are_as_short_as_the_shortest_order() {
    for seed in 0..6 {
        let jobs = made_up(seed, 3, 3);
        let task = shop(&jobs, false);
        let (plans, answer) = run(&task, &settings(true), 150);
        let found = answer.found().expect("there is a plan");
        for better in &plans {
            let verdict = validate(&task, &better.plan, &validate::Settings::default());
            assert!(matches!(verdict, Verdict::Valid(_)), "{verdict:?}");
        }
        assert!(plans.is_sorted_by(|a, b| a.makespan > b.makespan));
        assert_eq!(
            found.makespan.floor(),
            shortest(&jobs).into(),
            "{jobs:?}\n{}",
            describe(&answer)
        );
    }
}

#[test]
fn sequential_choices_are_scheduled_concurrently() {
    for seed in 0..3 {
        let jobs = made_up(seed, 3, 3);
        let task = shop(&jobs, true);
        let makespan = |is_refining: bool| {
            let (_, answer) = run(&task, &settings(is_refining), 150);
            answer.found().expect("there is a plan").makespan.clone()
        };
        assert!(makespan(true) < makespan(false));
        assert!(makespan(true).floor() >= shortest(&jobs).into());
    }
}

#[test]
fn exhaustive_search_finds_no_better_plan() {
    // Two jobs: the whole space can be searched.
    for seed in 0..4 {
        let jobs = made_up(seed, 2, 2);
        let task = shop(&jobs, false);
        let refined = run(&task, &Settings::default(), 2000).1;
        let mut without = Settings::default();
        without.tuning.without = NEAR_THE_BEST.to_vec();
        let searched = run(&task, &without, 2000).1;
        let makespan = |answer: &Answer| answer.found().map(|found| found.makespan.clone());
        assert_eq!(makespan(&refined), makespan(&searched));
    }
}

#[test]
fn work_is_moved_to_idle_worker() {
    // Six jobs of four, for three workers. The choice of the first worker does not change the
    // number of steps.
    let task = task(
        "(:requirements :typing :durative-actions) (:types worker job)
         (:predicates (idle ?w - worker) (open ?j - job) (done ?j - job) (can ?w - worker ?j - job))
         (:durative-action work :parameters (?w - worker ?j - job) :duration (= ?duration 4)
           :condition (and (at start (idle ?w)) (at start (open ?j)) (at start (can ?w ?j)))
           :effect (and (at start (not (idle ?w))) (at end (idle ?w)) (at start (not (open ?j)))
                        (at end (done ?j))))",
        "(:objects a b c - worker j1 j2 j3 j4 j5 j6 - job)
         (:init (idle a) (idle b) (idle c)
           (open j1) (open j2) (open j3) (open j4) (open j5) (open j6)
           (can a j1) (can a j2) (can a j3) (can a j4) (can a j5) (can a j6)
           (can b j1) (can b j3) (can b j5) (can c j6) (can c j1))
         (:goal (and (done j1) (done j2) (done j3) (done j4) (done j5) (done j6)))",
    );
    let (_, answer) = run(&task, &settings(true), 100);
    let found = answer.found().expect("there is a plan");
    assert_eq!(found.makespan.floor(), 8.into(), "{}", describe(&answer));
}

#[test]
fn runs_are_deterministic() {
    let task = shop(&made_up(7, 4, 3), true);
    let (first, answer) = run(&task, &Settings::default(), 60);
    assert!(first.len() > 1, "{}", describe(&answer));
    assert_eq!(first, run(&task, &Settings::default(), 60).0);
}

#[test]
fn refinement_can_be_interrupted_at_each_report() {
    let task = shop(&made_up(5, 6, 3), true);
    let situation = Situation::initial(&task);
    for most in 3..40 {
        let mut phases = Vec::new();
        let answer = plan(&task, &situation, &settings(true), &mut |progress| {
            phases.push(progress.phase);
            if phases.len() < most {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
        assert!(answer.found().is_some() || !phases.contains(&Phase::Improving));
        assert!(phases.len() <= most);
    }
}

/// The same plan as without the clean-up, or a better one, for little more work.
#[test]
fn cleaned_up_plan_is_no_worse_within_work_share() {
    for seed in 0..6 {
        let task = shop(&made_up(seed, 6, 3), seed % 2 == 0);
        let run = |without: &[Technique]| {
            let mut settings = Settings {
                first_plan_only: true,
                ..Settings::default()
            };
            settings.tuning.without.extend(without);
            let situation = Situation::initial(&task);
            let mut plans = 0;
            let answer = plan(&task, &situation, &settings, &mut |progress| {
                plans += usize::from(progress.plan.is_some());
                ControlFlow::Continue(())
            });
            let Answer::Plan {
                found,
                stopped,
                counts,
            } = answer
            else {
                panic!("no plan");
            };
            assert_eq!((plans, stopped), (1, Stopped::FirstPlan));
            (found.makespan, counts.work)
        };
        let (first, cleaned) = (run(&[Technique::Cleanup]), run(&[]));
        assert!(cleaned.0 <= first.0);
        assert!(cleaned.1 <= 3 * first.1, "{} after {}", cleaned.1, first.1);
    }
}
