//! Where a run stands: the situation for a plan from here, and what is left of the present plan.

use std::sync::Arc;

use elbowroom_model::validate::{Settings, validate_from};
use elbowroom_model::{RunningAction, Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};

use crate::event::Ticket;
use crate::progression::Progression;

/// When something will end that should have ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guess {
    /// After a quarter of the time that it has taken. Who guesses "any moment now" again and again
    /// plans again and again.
    AQuarterLonger,
    /// As soon as it can: if there is no plan even then, there is none with it.
    AnyMoment,
    /// It does not end: it is cancelled.
    Cancelled,
}

/// Where things will stand at `time` if nothing ends before that, or ε after the timed initials
/// that come just before it; and the tickets of what is under way, in the situation's order.
pub fn situation_at(
    belief: &Progression,
    mut time: Rational,
    guess: Guess,
) -> (Situation, Vec<Ticket>) {
    let task = Arc::clone(belief.task());
    let epsilon = task.epsilon();
    let mut state = belief.clone();
    loop {
        let _ = state.advance(&time);
        let past = state.timed_past().checked_sub(1);
        let last = past.map(|index| &task.timed()[index].time + epsilon);
        match last {
            Some(last) if last > time => time = last,
            _ => break,
        }
    }
    let running = state
        .running()
        .values()
        .map(|underway| {
            let elapsed = &time - &underway.start;
            let expected = match guess {
                _ if underway.planned > elapsed => underway.planned.clone(),
                Guess::AQuarterLonger => elapsed * Rational::new(5, 4),
                Guess::AnyMoment | Guess::Cancelled => elapsed + epsilon,
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

/// The plan that continues what is under way and then does what is left, all of it as much later as
/// the latest of it is late; `None` if the judge finds that it does not work.
pub fn rest_of(
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
