//! Sets of actions of different plans, for bounds from plans.

use std::sync::Arc;

use elbowroom_execution::executors::{self, Role};
use elbowroom_execution::run::{PlanningTime, RunSettings};
use elbowroom_mdp::{NotTabulated, Settings};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_sim::WorldModel;
use indexmap::IndexMap;

use crate::box_search::EnvelopeSettings;
use crate::candidates::{Candidates, Limits};
use crate::planners::Embedded;
use crate::rollouts::{Replanning, RolloutSession, Rollouts};

/// Maximum number of plans.
const MAX_PLANS: usize = 8;

/// Maximum number of variants of the problem, and of states for all plans but the first.
const MAX_SEARCHES: usize = 8;
const MAX_VARIANT_STATES: u64 = 10_000;

/// Number of samples of the first plan to find fallbacks; maximum number of states for all later
/// plans; maximum number of fallbacks.
const SAMPLES: u64 = 24;
const MAX_FALLBACK_STATES: u64 = 10_000;
const MAX_FALLBACKS: usize = 4;

/// Sets of actions for restricted policies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActionSets {
    /// Actions of different plans for the initial state, by the embedded planner, also for variants
    /// with long durations and small amounts: [`Settings::plans`].
    pub plans: Vec<Vec<String>>,
    /// If everything happens at known times: actions of new plans after a failure of the first plan
    /// in a sample of the world, with the supporting actions of the plans before:
    /// [`Settings::fallbacks`].
    pub fallbacks: Vec<Vec<String>>,
}

impl ActionSets {
    /// Computes the sets for bounds on the success probability ([`elbowroom_mdp`]).
    pub fn new(
        task: &Task,
        world: &WorldModel,
        embedded: Embedded<'_>,
        may_continue: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        Self::of(task, world, embedded, &|_| true, may_continue)
    }

    /// Computes the sets for a [policy](elbowroom_mdp::Policy); empty if there would be no table even for
    /// the first set.
    pub fn for_policy(
        task: &Task,
        world: &WorldModel,
        embedded: Embedded<'_>,
        may_continue: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        let is_of_use = |first: &[String]| check_support(task, world, first.to_vec()).is_ok();
        Self::of(task, world, embedded, &is_of_use, may_continue)
    }

    fn of(
        task: &Task,
        world: &WorldModel,
        embedded: Embedded<'_>,
        is_of_use: &dyn Fn(&[String]) -> bool,
        may_continue: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        let limits = Limits {
            most_states: embedded.most_states,
            improve_states: embedded.improve_states,
            other_states: MAX_VARIANT_STATES,
            searches: MAX_SEARCHES,
            work: embedded.work,
            first_plan_factor: embedded.first_plan_factor,
        };
        // Planning must not add facts to the task's own table.
        let thought = task.with_own_table();
        let situation = Situation::initial(&thought);
        let replanning = Replanning {
            all_states: MAX_FALLBACK_STATES,
            ..Replanning::within(&embedded)
        };
        let mut source =
            Candidates::new(&thought, &situation, Some(world), embedded.settings, limits);
        let mut next = || source.next(&mut |_| may_continue()).map(|found| found.plan);
        let Some(first) = next().filter(|first| is_of_use(&names(first))) else {
            return Self::default();
        };
        let others = std::iter::from_fn(next).take(MAX_PLANS - 1);
        let mut plans = vec![names(&first)];
        plans.extend(others.map(|plan| names(&plan)));
        let fallbacks = if elbowroom_mdp::has_known_times(task, world) {
            fallbacks(&thought, world, replanning, &first, may_continue)
        } else {
            Vec::new()
        };
        Self { plans, fallbacks }
    }
}

/// Checks whether a table of some actions is possible.
///
/// # Errors
/// When the process does not support them, or a feature of the world.
pub(crate) fn check_support(
    task: &Task,
    world: &WorldModel,
    actions: Vec<String>,
) -> Result<(), NotTabulated> {
    let settings = Settings {
        only: Some(actions),
        ..Settings::default()
    };
    elbowroom_mdp::check_support(task, world, &settings)
}

/// Returns [`ActionSets::fallbacks`], the most frequent first.
fn fallbacks(
    task: &Task,
    world: &WorldModel,
    replanning: Replanning,
    first: &TimeTriggeredPlan,
    may_continue: &(dyn Fn() -> bool + Sync),
) -> Vec<Vec<String>> {
    let work = replanning.work;
    let rollouts = Rollouts {
        world: Arc::new(world.clone()),
        executor: executors::with_role(Role::EarlyReplanning)
            .next()
            .unwrap_or_default(),
        settings: RunSettings {
            planning_time: PlanningTime::Seconds(Rational::ZERO),
            ..RunSettings::default()
        },
        flow: EnvelopeSettings::default(),
        likelihoods: Arc::default(),
        replanning: Some(replanning),
        is_ready: true,
    };
    let mut tryout = RolloutSession::new(task, rollouts, work, may_continue);
    let mut found: IndexMap<Vec<String>, usize> = IndexMap::new();
    for sample in 0..SAMPLES {
        if !may_continue() {
            break;
        }
        let mut before = names(first);
        for plan in tryout.new_plans(first, sample) {
            let own = names(&plan);
            // A plan without new actions only continues the earlier plans.
            if own.iter().any(|name| !before.contains(name))
                && let Ok(mut set) = elbowroom_mdp::supported(task, world, &own, &before)
            {
                set.sort_unstable();
                set.dedup();
                *found.entry(set).or_default() += 1;
            }
            before.extend(own);
        }
    }
    found.sort_by(|_, one, _, other| other.cmp(one));
    found.into_keys().take(MAX_FALLBACKS).collect()
}

/// Returns the names of a plan's actions.
pub(crate) fn names(plan: &TimeTriggeredPlan) -> Vec<String> {
    let steps = plan.steps.iter();
    steps.map(|step| step.action.name.clone()).collect()
}
