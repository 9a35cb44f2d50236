//! Starts with unmet numeric conditions or duration bounds.
//!
//! The search for orders assumes that conditions hold if their numbers depend on times. They are
//! evaluated here before each start, in the believed state.

use elbowroom_model::ground::Condition;
use elbowroom_num::Rational;
use elbowroom_plan::InstanceId;
use elbowroom_probability::NextHappening;

use super::{Rest, wait};
use crate::dispatch::{in_words, replan};
use crate::executor::{Decided, Moment};
use crate::reason::{About, Cause, Reason};

/// A start with unmet numeric conditions or duration bounds.
pub(super) struct Lack {
    instance: InstanceId,
    condition: Condition,
    duration: Rational,
    /// `true` if continuous effects are changing a number that they read.
    is_moving: bool,
}

impl Rest {
    /// Returns the unmet conditions if this happening is a start that is due; `None` if the numbers
    /// allow the start.
    pub(super) fn lack(
        &self,
        next: &NextHappening,
        moment: &Moment<'_>,
        now: &Rational,
    ) -> Option<Lack> {
        if next.slot.earliest > *now {
            return None;
        }
        self.starting(next).into_iter().find_map(|instance| {
            let step = &self.steps[instance.index()];
            let duration = step.duration.clone().unwrap_or_default();
            let condition = moment.belief.start_on_numbers(&step.action, &duration);
            let held = moment.belief.held_on_arrival(&condition, Some(&duration));
            (held != Ok(true)).then(|| Lack {
                is_moving: moment.belief.is_moving(&condition),
                instance,
                condition,
                duration,
            })
        })
    }

    /// Returns `true` if the conditions will not become true by waiting, so that another order is
    /// needed.
    pub(super) fn is_lacking_for_good(
        &self,
        next: &NextHappening,
        moment: &Moment<'_>,
        now: &Rational,
    ) -> bool {
        let lack = self.lack(next, moment, now);
        lack.is_some_and(|lack| !lack.is_moving)
    }

    /// Waits for numbers that change with time, or for the end of a running action. If no action is
    /// running, the plan is abandoned.
    pub(super) fn await_numbers(
        &mut self,
        lack: &Lack,
        next: &NextHappening,
        moment: &Moment<'_>,
        now: &Rational,
    ) -> Decided {
        let name = &self.steps[lack.instance.index()].action.name;
        let belief = moment.belief;
        let unmet = belief.unmet_on_arrival(&lack.condition, Some(&lack.duration));
        let about = About::Conditions(in_words(belief, &unmet));
        if self.chooser.is_table() || !self.awaits_ends(now) {
            // A table does not contain numbers, so orders are executed from now on.
            self.is_table_circling |= self.chooser.is_table();
            let reason = Reason::new(Cause::Condition).of(name).about(about);
            return replan(reason.since(moment.now.clone()));
        }
        let epsilon = self.mission.task.epsilon();
        let latest = next.slot.latest.as_ref();
        let latest = latest.map(|latest| self.world(&(latest + epsilon)));
        let overdue = self.first_overdue().map(|time| self.world(&time));
        let running = belief.running().values();
        let ends = running.map(|underway| &underway.start + &underway.planned);
        let times = latest.into_iter().chain(overdue).chain(ends);
        let times = times.chain(belief.next_timed().cloned());
        let until = times.filter(|time| time > moment.now).min();
        let until = until.map(|until| {
            let (condition, duration) = (&lack.condition, &lack.duration);
            let holds = belief.next_hold(condition, duration, &until, epsilon);
            holds.unwrap_or(until)
        });
        wait(until, about)
    }
}
