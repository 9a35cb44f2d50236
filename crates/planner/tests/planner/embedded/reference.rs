//! An exhaustive search over all sequences of happenings, each scheduled by Bellman and Ford and
//! validated, finds a plan exactly when the planner does, and the same best metric.

pub(crate) mod drafts;
mod exhaustive_search;

use std::ops::ControlFlow;

use elbowroom_model::validate::{Settings as Strictness, Verdict};
use elbowroom_model::{Situation, TimeTriggeredPlan, validate_from};
use elbowroom_planner::{Answer, Settings, Stopped, plan};
use proptest::prelude::*;

use crate::embedded::world::describe;
use drafts::{METRICS, drafts, thrifty_drafts};
use exhaustive_search::{MOST, ReferencePlanner};

fn happenings(plan: &TimeTriggeredPlan) -> usize {
    let steps = plan.steps.iter();
    steps
        .map(|step| 1 + usize::from(step.duration.is_some()))
        .sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn planner_and_reference_agree_on_solvability(
        draft in drafts(),
        self_overlap in any::<bool>(),
    ) {
        let task = draft.task();
        let situation = Situation::initial(&task);
        let mut turns = 0;
        let settings = Settings { first_plan_only: true, self_overlap, ..Settings::default() };
        let answer = plan(&task, &situation, &settings, &mut |_| {
            turns += 1;
            if turns > 200 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let actions = draft.ground(&task);
        let mut twin = ReferencePlanner::new(&task, actions, 1_200).with_self_overlap(self_overlap);
        let found = twin.finds();
        match &answer {
            Answer::Plan { found: ours, .. } => {
                let verdict =
                    validate_from(&task, &situation, &ours.plan, &Strictness::default());
                prop_assert!(matches!(verdict, Verdict::Valid(_)));
                prop_assert!(self_overlap || ours.plan.self_overlap().is_none());
                if happenings(&ours.plan) <= MOST {
                    prop_assert_ne!(found, Some(false), "{}", describe(&answer));
                }
            }
            Answer::Unsolvable { .. } => {
                prop_assert_ne!(found, Some(true), "{}", describe(&answer));
            }
            Answer::NoneFound { .. } | Answer::Unsupported(_) => {
                // The planner does not support ends of one time that use up the store together.
                let is_plain = draft.actions.iter().all(|action| !action.keeps_store_nonempty);
                prop_assert!(!is_plain || found != Some(true), "{}", describe(&answer));
            }
        }
    }

    #[test]
    fn exhausted_search_has_found_optimal_metric(
        draft in thrifty_drafts(),
        prices in prop::collection::vec((1..5_u8, 0..5_u8, 0..3_u8), 4),
        metric in 0..METRICS.len(),
        self_overlap in any::<bool>(),
    ) {
        let task = draft.task_with(&prices, METRICS[metric]);
        let situation = Situation::initial(&task);
        let mut turns = 0;
        // For some problems the search space is infinite.
        let settings = Settings { max_memory: 8 << 20, self_overlap, ..Settings::default() };
        let answer = plan(&task, &situation, &settings, &mut |_| {
            turns += 1;
            if turns > 100 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let Answer::Plan { found, stopped, .. } = &answer else { return Ok(()) };
        let verdict = validate_from(&task, &situation, &found.plan, &Strictness::default());
        let Verdict::Valid(report) = verdict else { panic!("an invalid plan") };
        prop_assert_eq!(&report.metric(&task), &found.metric);
        prop_assert!(self_overlap || found.plan.self_overlap().is_none());
        if *stopped != Stopped::Exhausted {
            return Ok(());
        }
        let actions = draft.ground(&task);
        let mut twin = ReferencePlanner::new(&task, actions, 1_500).with_self_overlap(self_overlap);
        if let Ok(Some(least)) = twin.least_metric() {
            let metric = found.metric.clone().expect("there is a metric");
            let ours = (metric, found.makespan.clone());
            prop_assert!(ours <= least, "{least:?}, not {ours:?}:\n{}", describe(&answer));
            if happenings(&found.plan) <= MOST {
                prop_assert_eq!(ours, least, "{}", describe(&answer));
            }
        }
    }
}
