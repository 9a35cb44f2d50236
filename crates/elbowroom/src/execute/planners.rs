//! Planners behind the port of [`execution`](crate::execution).

use std::ops::ControlFlow;

use elbowroom_execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_planner::embedded;

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

/// The embedded planner, with a limit that does not depend on how fast the machine is: so many
/// states. Within it the best plan found is taken.
pub struct Embedded<'a> {
    /// How to plan.
    pub settings: embedded::Settings,
    /// How many states to look at.
    pub most_states: u64,
    /// What time it is, in seconds since whenever: where planning time is measured.
    pub clock: Option<&'a dyn Fn() -> Rational>,
}

impl Planner for Embedded<'_> {
    fn plan(&mut self, task: &mut Task, situation: &Situation) -> PlannerAnswer {
        let begun = self.clock.map(|clock| clock());
        let answer = embedded_answer(task, situation, &self.settings, self.most_states);
        let seconds = self.clock.map(|clock| clock() - begun.unwrap_or_default());
        PlannerAnswer { answer, seconds }
    }
}

fn embedded_answer(
    task: &mut Task,
    situation: &Situation,
    settings: &embedded::Settings,
    most_states: u64,
) -> PlanAnswer {
    let answer = embedded::plan(task, situation, settings, &mut |progress| {
        if progress.counts.evaluated >= most_states {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    match answer {
        embedded::Answer::Plan { found, .. } => PlanAnswer::Plan(found.plan),
        embedded::Answer::Unsolvable { .. } => PlanAnswer::Unsolvable,
        embedded::Answer::NoneFound { .. } => PlanAnswer::NotFound {
            why: format!("no plan was found among {most_states} states"),
        },
        embedded::Answer::Unsupported(unsupported) => PlanAnswer::NotFound {
            why: unsupported.to_string(),
        },
    }
}
