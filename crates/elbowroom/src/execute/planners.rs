//! Planners behind the port of [`execution`](crate::execution).

use elbowroom_execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom_model::{Situation, Task};

/// A planner without a clock: a function from situations to answers.
pub struct Clockless<F>(pub F);

impl<F: FnMut(&mut Task, &Situation) -> PlanAnswer> Planner for Clockless<F> {
    fn plan(&mut self, task: &mut Task, situation: &Situation) -> PlannerAnswer {
        PlannerAnswer {
            answer: (self.0)(task, situation),
            seconds: None,
        }
    }
}
