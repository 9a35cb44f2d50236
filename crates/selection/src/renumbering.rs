//! Plans of one table of facts in another.

use std::sync::Arc;

use elbowroom_model::{Step, Task, TimeTriggeredPlan};

/// Returns the same plan with the fact numbers of this task; `None` if an action does not exist
/// there.
pub fn renumbered(task: &Task, plan: &TimeTriggeredPlan) -> Option<TimeTriggeredPlan> {
    let steps = plan.steps.iter().map(|step| {
        let action = task.instantiate(step.action.schema, &step.action.arguments);
        Some(Step {
            action: Arc::new(action.ok()?),
            start: step.start.clone(),
            duration: step.duration.clone(),
        })
    });
    let steps = steps.collect::<Option<Vec<_>>>()?;
    Some(TimeTriggeredPlan { steps })
}
