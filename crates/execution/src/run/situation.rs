//! Present situation of a run: the start of a new plan, and the remaining plan.

use std::sync::Arc;

use elbowroom_model::validate::{Settings, validate_from};
use elbowroom_model::{RunningAction, Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};

use crate::belief_state::BeliefState;
use crate::event::ActionHandle;

/// Estimated end time of an overdue action, for replanning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverrunEstimate {
    /// After a quarter of the time that it has taken, or sooner if its own over-all conditions do
    /// not hold for that long. The estimate that it ends at any moment would lead to a new plan at
    /// each moment.
    QuarterLonger,
    /// As soon as possible. If there is no plan even then, there is none with this action.
    AsSoonAsPossible,
    /// Never: it is cancelled.
    Cancelled,
}

/// A plan, its initial situation, and the tickets of the actions that are running there.
pub type StartedPlan = (TimeTriggeredPlan, Situation, Vec<ActionHandle>);

/// Returns the situation at `time`, or ε after timed initials that come just before it, if no
/// action ends until then; and the tickets of the running actions, in the situation's order.
pub fn situation_at(
    belief: &BeliefState,
    mut time: Rational,
    guess: OverrunEstimate,
) -> (Situation, Vec<ActionHandle>) {
    let task = Arc::clone(belief.task());
    let epsilon = task.epsilon();
    let mut state = belief.clone();
    loop {
        let _ = state.advance(&time);
        let past = state.past_timed_initials().checked_sub(1);
        let last = past.map(|index| &task.timed()[index].time + epsilon);
        match last {
            Some(last) if last > time => time = last,
            _ => break,
        }
    }
    let running = state
        .running()
        .iter()
        .map(|(ticket, underway)| {
            let elapsed = &time - &underway.start;
            let expected = match guess {
                _ if underway.planned > elapsed => underway.planned.clone(),
                OverrunEstimate::QuarterLonger => {
                    quarter_longer_end(&state, *ticket, &time) - &underway.start
                }
                OverrunEstimate::AsSoonAsPossible | OverrunEstimate::Cancelled => elapsed + epsilon,
            };
            state.running_action(underway, Interval::point(expected))
        })
        .collect::<Vec<RunningAction>>();
    let tickets = state.running().keys().copied().collect();
    let situation = Situation {
        state: state.state(),
        time,
        running,
    };
    (situation, tickets)
}

/// Returns the expected end of a running action that is overdue now: after a quarter of the time
/// that it has taken. The quarter is halved until the action's over-all conditions hold until then,
/// if nothing else ends before. With a later end, no plan would be valid.
pub fn quarter_longer_end(belief: &BeliefState, ticket: ActionHandle, now: &Rational) -> Rational {
    let holds_until = |end: &Rational| {
        let mut state = belief.clone();
        let _ = state.advance(end);
        let underway = state.running().get(&ticket);
        underway.is_none_or(|it| it.violated_conjuncts().is_empty())
    };
    let start = belief.running().get(&ticket).map(|it| &it.start);
    let elapsed = now - start.unwrap_or(now);
    let mut longer = elapsed / Rational::from(4);
    if holds_until(now) {
        while longer > *belief.task().epsilon() && !holds_until(&(now + &longer)) {
            longer = longer / Rational::from(2);
        }
    }
    now + longer
}

/// Returns the plan that continues the running actions and then executes the remaining steps. All
/// steps are shifted by the greatest delay of any of them. `None` if the validator rejects the
/// plan.
pub fn remaining_plan_of(
    task: &Task,
    situation: &Situation,
    mut left: Vec<Step>,
) -> Option<TimeTriggeredPlan> {
    let delay = left.iter().map(|step| &situation.time - &step.start).max();
    let delay = delay.unwrap_or_default().max(Rational::ZERO);
    for step in &mut left {
        step.start = &step.start + &delay;
    }
    let expected = |it: &RunningAction| {
        let duration = it.duration.lower.value().cloned();
        duration.map(|duration| it.step(duration))
    };
    let under_way: Option<Vec<Step>> = situation.running.iter().map(expected).collect();
    let steps = under_way?.into_iter().chain(left).collect();
    let rest = TimeTriggeredPlan { steps };
    let verdict = validate_from(task, situation, &rest, &Settings::default());
    verdict.is_valid().then_some(rest)
}
