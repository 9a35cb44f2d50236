//! Planners behind the port of [`execution`](crate::execution).

use std::ops::ControlFlow;

use elbowroom_execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_planner::embedded;

/// A planner without a clock: a function from situations to answers.
pub struct Clockless<F>(pub F);

impl<F: FnMut(&Task, &Situation) -> PlanAnswer + Send> Planner for Clockless<F> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        PlannerAnswer::from((self.0)(task, situation))
    }
}

/// The embedded planner, with a limit that does not depend on how fast the machine is: so many
/// states. Within it the best plan found is taken.
pub struct Embedded<'a> {
    /// How to plan.
    pub settings: embedded::Settings,
    /// How many states to look at for a plan at all.
    pub most_states: u64,
    /// How many states to look at for a better plan than the first.
    pub improve_states: u64,
    /// The clock by which planning time is measured, in seconds since some fixed time.
    pub clock: Option<&'a (dyn Fn() -> Rational + Sync)>,
    /// Asked now and then whether to go on; without it, always.
    pub goes_on: Option<&'a (dyn Fn() -> bool + Sync)>,
}

impl Planner for Embedded<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let begun = self.clock.map(|clock| clock());
        let (answer, _) = self.counted(task, situation);
        let seconds = self.clock.map(|clock| clock() - begun.unwrap_or_default());
        PlannerAnswer {
            seconds,
            ..PlannerAnswer::from(answer)
        }
    }
}

impl Default for Embedded<'_> {
    /// 20,000 states, of which 2,000 for a better plan than the first; no clock.
    fn default() -> Self {
        Self {
            settings: embedded::Settings::default(),
            most_states: 20_000,
            improve_states: 2_000,
            clock: None,
            goes_on: None,
        }
    }
}

impl Embedded<'_> {
    /// The answer, and the number of states looked at for it.
    pub(crate) fn counted(&self, task: &Task, situation: &Situation) -> (PlanAnswer, u64) {
        let mut states = 0;
        let answer = self.answer(task, situation, &mut states);
        (answer, states)
    }

    fn answer(&self, task: &Task, situation: &Situation, states: &mut u64) -> PlanAnswer {
        let answer = embedded::plan(task, situation, &self.settings, &mut |progress| {
            let limit = match progress.best {
                Some(_) => self.improve_states.min(self.most_states),
                None => self.most_states,
            };
            *states = progress.counts.evaluated;
            let is_wanted = self.goes_on.is_none_or(|goes_on| goes_on());
            if progress.counts.evaluated >= limit || !is_wanted {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        match answer {
            embedded::Answer::Plan { found, .. } => PlanAnswer::Plan(found.plan),
            embedded::Answer::Unsolvable { .. } => PlanAnswer::Unsolvable,
            _ if !self.goes_on.is_none_or(|goes_on| goes_on()) => PlanAnswer::NotFound {
                why: "planning was interrupted".to_owned(),
            },
            embedded::Answer::NoneFound { .. } => PlanAnswer::NotFound {
                why: format!("no plan was found among {} states", self.most_states),
            },
            embedded::Answer::Unsupported(unsupported) => PlanAnswer::NotFound {
                why: unsupported.to_string(),
            },
        }
    }
}
