//! Exhausted memory: searches are abandoned in favour of others.

use std::ops::ControlFlow;

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, Settings, Stopped, plan};

use crate::embedded::portfolio::shelf;
use crate::embedded::refinement::{made_up, shop};
use crate::embedded::world::{describe, task};

/// Deep shelves need a search by novelty; the others, which come first, would use up all memory.
#[test]
fn largest_search_is_dropped_at_memory_limit() {
    let (domain, problem) = shelf(6);
    let task = task(&domain, &problem);
    let run = |max_memory| {
        let settings = Settings {
            max_memory,
            first_plan_only: true,
            ..Settings::default()
        };
        let mut most = 0;
        let answer = plan(
            &task,
            &Situation::initial(&task),
            &settings,
            &mut |progress| {
                most = most.max(progress.counts.memory);
                ControlFlow::Continue(())
            },
        );
        (answer, most)
    };
    let (answer, needed) = run(usize::MAX);
    assert!(answer.found().is_some(), "{}", describe(&answer));
    for limit in [needed * 3 / 4, needed / 2, needed / 4] {
        let (answer, most) = run(limit);
        assert!(
            answer.found().is_some(),
            "{limit} of {needed}: {}",
            describe(&answer)
        );
        assert!(most > limit, "nothing had to give way at {limit}");
        assert!(most < limit + needed / 8, "{most} at {limit}");
    }
    let (answer, _) = run(needed / 100);
    let Answer::NoneFound { stopped, .. } = answer else {
        panic!("{}", describe(&answer));
    };
    assert_eq!(stopped, Stopped::OutOfMemory);
}

/// Maximum number of reports.
const MAX_REPORTS: usize = 200;

/// Returns the number of reports about better plans of a shop, the maximum memory of the searches,
/// and the reason for the end.
fn better_plans(max_memory: usize) -> (usize, usize, Stopped) {
    let task = shop(&made_up(1, 8, 4), true);
    let mut settings = Settings {
        max_memory,
        ..Settings::default()
    };
    settings.tuning.first_leg = 2_000;
    settings.tuning.leg = 20_000;
    // It would end some time after the last search has been abandoned.
    settings.tuning.improving_round = u64::MAX;
    let (mut reports, mut most) = (0, 0);
    let answer = plan(
        &task,
        &Situation::initial(&task),
        &settings,
        &mut |progress| {
            reports += 1;
            most = most.max(progress.counts.memory);
            if reports < MAX_REPORTS {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        },
    );
    let Answer::Plan { stopped, .. } = answer else {
        panic!("{}", describe(&answer));
    };
    (reports, most, stopped)
}

#[test]
fn local_search_continues_when_searches_are_out_of_memory() {
    let (reports, needed, stopped) = better_plans(usize::MAX);
    assert_eq!((reports, stopped), (MAX_REPORTS, Stopped::Interrupted));
    let limit = needed / 4;
    // It runs as long as with unlimited memory, and the searches use less memory.
    let (others, most, stopped) = better_plans(limit);
    assert_eq!((others, stopped), (reports, Stopped::Interrupted));
    assert!(most < needed / 2, "{most} of {limit}");
}
