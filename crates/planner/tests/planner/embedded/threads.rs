//! The reports and the answer do not depend on the number of threads.

use std::ops::ControlFlow;
use std::path::Path;

use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_planner::{Answer, Progress, Settings, plan};
use proptest::prelude::*;

use crate::embedded::portfolio::shelf;
use crate::embedded::reference::drafts::{METRICS, drafts, thrifty_drafts};
use crate::embedded::refinement::{made_up, shop};
use crate::embedded::world::{describe, task};

/// Returns settings with which strands start concurrently at once, and exchange their plans after
/// little work.
fn settings(threads: usize) -> Settings {
    let mut settings = Settings {
        threads,
        ..Settings::default()
    };
    let tuning = &mut settings.tuning;
    tuning.second_strand_after = 0;
    tuning.first_leg = 2_000;
    tuning.leg = 20_000;
    settings
}

/// Returns all reports until report `most`, and the answer. Each run creates its own task, since
/// planning adds facts to its table.
fn run(make: &dyn Fn() -> Task, settings: &Settings, most: usize) -> (Vec<Progress>, Answer) {
    let task = make();
    let situation = Situation::initial(&task);
    let mut reports = Vec::new();
    let answer = plan(&task, &situation, settings, &mut |progress| {
        reports.push(progress.clone());
        if reports.len() < most {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    (reports, answer)
}

/// Checks that the number of threads makes no difference. Returns the number of reported plans.
fn agree(make: &dyn Fn() -> Task, adapt: &dyn Fn(&mut Settings), most: usize) -> usize {
    let run = |threads| {
        let mut settings = settings(threads);
        adapt(&mut settings);
        run(make, &settings, most)
    };
    let (reports, answer) = run(1);
    for threads in [2, 4] {
        let (others, other) = run(threads);
        let place = reports.iter().zip(&others).position(|(a, b)| a != b);
        assert_eq!(place, None, "{threads} threads");
        assert_eq!(reports.len(), others.len(), "{threads} threads");
        assert_eq!(answer, other, "{threads} threads: {}", describe(&other));
    }
    let plans = reports.iter().filter(|report| report.plan.is_some());
    plans.count()
}

#[test]
fn better_plans_are_independent_of_thread_count() {
    let mut plans = 0;
    for seed in 0..3 {
        let make = || shop(&made_up(seed, 6, 3), seed % 2 == 0);
        plans += agree(&make, &|_| {}, 50);
    }
    assert!(plans > 3, "there are no better plans");
}

#[test]
fn run_can_be_interrupted_at_each_report() {
    let make = || shop(&made_up(3, 5, 3), true);
    for most in (1..40).step_by(5) {
        agree(&make, &|_| {}, most);
    }
}

#[test]
fn first_plans_are_the_same() {
    let (domain, problem) = shelf(5);
    let make = || task(&domain, &problem);
    let plans = agree(&make, &|settings| settings.first_plan_only = true, 400);
    assert_eq!(plans, 1);
}

#[test]
fn memory_limit_is_reached_at_same_state() {
    let (domain, problem) = shelf(4);
    let make = || task(&domain, &problem);
    for kilobytes in [20, 100, 300, 1000] {
        agree(
            &make,
            &|settings| settings.max_memory = kilobytes << 10,
            400,
        );
    }
}

#[test]
fn same_search_is_dropped_at_memory_limit() {
    let (domain, problem) = shelf(6);
    let make = || task(&domain, &problem);
    for megabytes in [2, 5] {
        let adapt = |settings: &mut Settings| {
            settings.max_memory = megabytes << 20;
            settings.first_plan_only = true;
        };
        assert_eq!(agree(&make, &adapt, usize::MAX), 1, "{megabytes} MB");
    }
    let make = || shop(&made_up(1, 8, 4), true);
    for megabytes in [1, 2] {
        let adapt = |settings: &mut Settings| settings.max_memory = megabytes << 20;
        assert!(agree(&make, &adapt, 60) > 0, "{megabytes} MB");
    }
}

#[test]
fn own_cases_give_same_plans() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let mut names: Vec<_> = std::fs::read_dir(cases)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.join("problem.pddl").exists())
        .collect();
    names.sort();
    assert!(names.len() > 5);
    for folder in names {
        let make = || {
            let source = |name: &str| {
                let text = std::fs::read_to_string(folder.join(name)).unwrap();
                Source::new(name, text)
            };
            let read = read_problem(&source("domain.pddl"), &source("problem.pddl"));
            Task::new(read.expect("our own cases can be read").0)
        };
        if make().unsupported_by_analysis().is_some() {
            continue;
        }
        assert!(agree(&make, &|_| {}, 40) > 0, "{}", folder.display());
    }
}

/// The second strand changes the result.
#[test]
fn second_strand_changes_reports() {
    let differ = (0..3).any(|seed| {
        let make = || shop(&made_up(seed, 6, 3), true);
        let mut alone = settings(1);
        alone.tuning.second_strand_after = u64::MAX;
        run(&make, &alone, 40).0 != run(&make, &settings(1), 40).0
    });
    assert!(differ);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    #[test]
    fn generated_problems_have_the_same_answers(draft in drafts()) {
        agree(&|| draft.task(), &|_| {}, 60);
    }

    #[test]
    fn generated_metrics_have_the_same_answers(
        draft in thrifty_drafts(),
        prices in prop::collection::vec((1..5_u8, 0..5_u8, 0..3_u8), 4),
        metric in 0..METRICS.len(),
    ) {
        let make = || draft.task_with(&prices, METRICS[metric]);
        agree(&make, &|settings| settings.max_memory = 8 << 20, 60);
    }
}
