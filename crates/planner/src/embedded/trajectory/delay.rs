//! Plans that satisfy constraints only if they start later.
//!
//! A search that ignores the constraints schedules everything as early as possible. A constraint on given
//! times may need a later start: after `hold-during`, after the time of `hold-after`, after a timed initial.

use std::collections::BTreeSet;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::super::answer::Settings;
use super::validated_without_observers;

/// Maximum number of delays that are tried for one plan.
const MAX_DELAYS: usize = 32;

/// Returns a plan with the same steps that satisfies the constraints. The steps from some start on
/// are delayed by the same time, so that the first of them starts at, or just after, a time that a
/// constraint or a timed initial names.
pub(in super::super) fn delayed(
    task: &Task,
    situation: &Situation,
    settings: &Settings,
    plan: &TimeTriggeredPlan,
) -> Option<TimeTriggeredPlan> {
    let hard = &task.constraints().hard;
    let timed = task.timed().iter().map(|timed| &timed.time);
    let named: BTreeSet<&Rational> = hard
        .iter()
        .flat_map(|modal| modal.times())
        .chain(timed)
        .collect();
    let running = situation.running.len();
    let new = plan.new_steps(situation).iter();
    let starts: BTreeSet<&Rational> = new.map(|step| &step.start).collect();
    let delays = starts.iter().flat_map(|&start| {
        let moments = named
            .iter()
            .flat_map(|&time| [time.clone(), time + task.epsilon()]);
        moments.map(move |moment| (start, moment - start))
    });
    let positive = delays.filter(|(_, delay)| delay.is_positive());
    positive.take(MAX_DELAYS).find_map(|(from, delay)| {
        let mut later = plan.clone();
        for step in later.steps.iter_mut().skip(running) {
            if step.start >= *from {
                step.start += &delay;
            }
        }
        validated_without_observers(task, situation, settings, &later).map(|_| later)
    })
}
