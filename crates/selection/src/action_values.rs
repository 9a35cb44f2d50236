//! Table of action values from a model of the world: [`action_values()`].

use std::sync::Arc;

use elbowroom_execution::ActionValues;
use elbowroom_mdp::{Policy, Settings};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_sim::WorldModel;

use crate::planners::Embedded;
use crate::relevant_actions::{ActionSets, check_support, names};

/// Computes the values of all moves in the world of `model`, for executors that use them
/// ([`Needs::action_values`](elbowroom_execution::executors::Needs::action_values)). `planner` makes the plans whose
/// actions bound the values. Without it, the bounds use all actions. `first` is the plan with which the run begins, if it is
/// known: if no table of its actions is possible, none is computed.
///
/// # Errors
/// The reason why there is no table, for users.
pub fn action_values(
    task: &Arc<Task>,
    model: &WorldModel,
    planner: Option<Embedded<'_>>,
    first: Option<&TimeTriggeredPlan>,
    settings: Settings,
    may_continue: &(dyn Fn() -> bool + Sync),
) -> Result<Arc<dyn ActionValues>, String> {
    if let Some(plan) = first {
        check_support(task, model, names(plan)).map_err(|error| error.what)?;
    }
    let sets = planner.map(|planner| ActionSets::for_policy(task, model, planner, may_continue));
    let sets = sets.unwrap_or_default();
    let settings = Settings {
        plans: sets.plans,
        fallbacks: sets.fallbacks,
        ..settings
    };
    let policy = Policy::if_near_optimal(task, model, &settings, may_continue);
    match policy.map_err(|error| error.what)? {
        Some(policy) => Ok(Arc::new(policy)),
        None if may_continue() => Err(
            "it would have too many states, or its bounds would stay more than 2 percentage \
             points apart"
                .to_owned(),
        ),
        None => Err("the planning budget is spent (`--planning-budget`)".to_owned()),
    }
}
