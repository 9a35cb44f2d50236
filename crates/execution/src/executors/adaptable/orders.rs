//! Searches for orders of plans, for who takes up the same plan more than once: [`Orders`].

use std::sync::{Arc, Mutex, PoisonError};

use elbowroom_model::{Step, Task};
use elbowroom_plan::PartialOrderPlan;
use elbowroom_probability::LayerDispatch;

/// What `adaptable` found out about plans, with one likelihood file, from situations of one task that
/// share a table of facts. Shared by clones. Nobody has to fill it, and it changes no decision: it
/// saves looking for the same orders in every sample of a world.
#[derive(Clone, Debug, Default)]
pub struct Orders(Arc<Mutex<Vec<Known>>>);

/// A plan, and where nothing of it has been begun.
#[derive(Debug)]
struct Known {
    task: Arc<Task>,
    plan: PartialOrderPlan,
    steps: Vec<Step>,
    dispatch: LayerDispatch,
}

/// How many plans are kept: those of one scene are fewer.
const MOST: usize = 64;

impl Orders {
    /// Who chooses happenings of this plan, if it was taken up before.
    pub(super) fn get(
        &self,
        task: &Task,
        plan: &PartialOrderPlan,
        steps: &[Step],
    ) -> Option<LayerDispatch> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let own = known.iter().find(|known| {
            known.steps == steps && known.plan == *plan && is_same(&known.task, task)
        });
        own.map(|known| known.dispatch.clone())
    }

    /// Keeps it.
    pub(super) fn put(
        &self,
        task: &Arc<Task>,
        plan: PartialOrderPlan,
        steps: &[Step],
        dispatch: &LayerDispatch,
    ) {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= MOST {
            known.clear();
        }
        known.push(Known {
            task: Arc::clone(task),
            plan,
            steps: steps.to_vec(),
            dispatch: dispatch.clone(),
        });
    }
}

/// Whether two rests of a task begin alike.
fn is_same(one: &Task, other: &Task) -> bool {
    std::ptr::eq(one, other)
        || std::ptr::eq(one.problem(), other.problem())
            && one.initial() == other.initial()
            && one.timed() == other.timed()
            && one.epsilon() == other.epsilon()
}
