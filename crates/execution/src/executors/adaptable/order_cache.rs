//! Order searches of plans, for executors that adopt the same plan repeatedly: [`OrderCache`].

use std::sync::{Arc, Mutex, PoisonError};

use elbowroom_model::{Step, Task};
use elbowroom_plan::PartialOrderPlan;
use elbowroom_probability::LayerDispatch;

/// Cache of `adaptable`'s order searches, by plan. It applies to one likelihood file and to
/// situations of one task that share a table of facts. Clones share the cache. It is optional and
/// does not change any decision; it avoids the same search in each sample of a world.
#[derive(Clone, Debug, Default)]
pub struct OrderCache(Arc<Mutex<Vec<CachedSearch>>>);

/// A plan, with its search before any step has begun.
#[derive(Debug)]
struct CachedSearch {
    task: Arc<Task>,
    plan: PartialOrderPlan,
    steps: Vec<Step>,
    dispatch: LayerDispatch,
}

/// Number of plans that are kept. A scene has fewer.
const MAX_PLANS: usize = 64;

impl OrderCache {
    /// Returns the search of this plan if the plan was adopted before.
    pub(super) fn get(
        &self,
        task: &Task,
        plan: &PartialOrderPlan,
        steps: &[Step],
    ) -> Option<LayerDispatch> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let own = known.iter().find(|known| {
            known.steps == steps && known.plan == *plan && is_same_remaining_task(&known.task, task)
        });
        own.map(|known| known.dispatch.clone())
    }

    /// Adds a plan.
    pub(super) fn put(
        &self,
        task: &Arc<Task>,
        plan: PartialOrderPlan,
        steps: &[Step],
        dispatch: &LayerDispatch,
    ) {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= MAX_PLANS {
            known.clear();
        }
        known.push(CachedSearch {
            task: Arc::clone(task),
            plan,
            steps: steps.to_vec(),
            dispatch: dispatch.clone(),
        });
    }
}

/// Returns `true` if two remaining tasks have the same problem, initial state, timed initials and
/// ε.
fn is_same_remaining_task(one: &Task, other: &Task) -> bool {
    std::ptr::eq(one, other)
        || std::ptr::eq(one.problem(), other.problem())
            && one.initial() == other.initial()
            && one.timed() == other.timed()
            && one.epsilon() == other.epsilon()
}
