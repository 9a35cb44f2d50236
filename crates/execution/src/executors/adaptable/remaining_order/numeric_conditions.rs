//! Starts with unmet numeric conditions or duration bounds.
//!
//! The search for orders assumes that conditions hold if their numbers depend on times. They are
//! evaluated here before each start, in the believed state.

use elbowroom_model::ground::Condition;
use elbowroom_num::Rational;
use elbowroom_plan::InstanceId;
use elbowroom_probability::NextHappening;

use super::{RemainingOrder, wait};
use crate::dispatch::{in_words, replan};
use crate::executor::{Decided, DecisionContext};
use crate::reason::{Cause, Reason, Subject};

/// A start with unmet numeric conditions or duration bounds.
pub(super) struct UnmetStart {
    instance: InstanceId,
    condition: Condition,
    duration: Rational,
    /// `true` if continuous effects are changing a number that they read.
    is_moving: bool,
}

impl RemainingOrder {
    /// Returns the unmet conditions if this happening is a start that is due; `None` if the numbers
    /// allow the start.
    pub(super) fn unmet_start(
        &self,
        next: &NextHappening,
        moment: &DecisionContext<'_>,
        now: &Rational,
    ) -> Option<UnmetStart> {
        if next.slot.earliest > *now {
            return None;
        }
        self.actions_to_start(next)
            .into_iter()
            .find_map(|instance| {
                let step = &self.steps[instance.index()];
                let duration = step.duration.clone().unwrap_or_default();
                let condition = moment
                    .belief
                    .numeric_start_condition(&step.action, &duration);
                let held = moment.belief.holds_on_arrival(&condition, Some(&duration));
                (held != Ok(true)).then(|| UnmetStart {
                    is_moving: moment.belief.is_moving(&condition),
                    instance,
                    condition,
                    duration,
                })
            })
    }

    /// Returns `true` if the conditions will not become true by waiting, so that another order is
    /// needed.
    pub(super) fn is_permanently_unmet(
        &self,
        next: &NextHappening,
        moment: &DecisionContext<'_>,
        now: &Rational,
    ) -> bool {
        let lack = self.unmet_start(next, moment, now);
        lack.is_some_and(|lack| !lack.is_moving)
    }

    /// Waits for numbers that change with time, or for the end of a running action. If no action is
    /// running, the plan is abandoned.
    pub(super) fn await_numbers(
        &mut self,
        lack: &UnmetStart,
        next: &NextHappening,
        moment: &DecisionContext<'_>,
        now: &Rational,
    ) -> Decided {
        let name = &self.steps[lack.instance.index()].action.name;
        let belief = moment.belief;
        let unmet = belief.unmet_on_arrival(&lack.condition, Some(&lack.duration));
        let about = Subject::Conditions(in_words(belief, &unmet));
        if self.chooser.is_table() || !self.awaits_ends(now) {
            // A table does not contain numbers, so orders are executed from now on.
            self.is_table_cycling |= self.chooser.is_table();
            let reason = Reason::new(Cause::Condition).for_action(name).about(about);
            return replan(reason.since(moment.now.clone()));
        }
        let epsilon = self.prepared_plan.task.epsilon();
        let latest = next.slot.latest.as_ref();
        let latest = latest.map(|latest| self.to_world_time(&(latest + epsilon)));
        let overdue = self.first_overdue().map(|time| self.to_world_time(&time));
        let running = belief.running().values();
        let ends = running.map(|underway| &underway.start + &underway.planned);
        let times = latest.into_iter().chain(overdue).chain(ends);
        let times = times.chain(belief.next_timed().cloned());
        let until = times.filter(|time| time > moment.now).min();
        let until = until.map(|until| {
            let (condition, duration) = (&lack.condition, &lack.duration);
            let holds = belief.next_satisfying_time(condition, duration, &until, epsilon);
            holds.unwrap_or(until)
        });
        wait(until, about)
    }
}
