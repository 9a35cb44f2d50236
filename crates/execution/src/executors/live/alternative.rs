//! Search for a better plan while the present one is executed.

use elbowroom_num::Rational;
use elbowroom_plan::InstanceId;

use super::{ExecutedPlan, guarantee_status};
use crate::executor::PreparedPlan;

impl ExecutedPlan {
    /// Returns `true` if the executor should search for a better plan: the guarantee has become
    /// weaker than at the last search, and little slack is left for the actions that have not
    /// begun.
    pub(super) fn seeks_better_plan(&mut self, now: &Rational) -> bool {
        if self.guarantee <= self.guarantee_at_last_search || !self.has_actions_to_begin() {
            return false;
        }
        self.guarantee_at_last_search = self.guarantee;
        self.slack(now) < Rational::new(1, 4)
    }

    /// Returns `true` if another plan is better than the remaining present one: its guarantee is no
    /// weaker, and it has at least twice the slack.
    pub(super) fn is_worse_than(&self, mission: &PreparedPlan, now: &Rational) -> bool {
        let has_guarantee =
            guarantee_status::begin(mission).is_ok_and(|(_, promise)| promise <= self.guarantee);
        // Slack is rounded to powers of 1/2.
        has_guarantee && guarantee_status::slack_of_plan(mission) > self.slack(now)
    }

    fn slack(&self, now: &Rational) -> Rational {
        guarantee_status::slack_of_remaining_plan(
            &self.dispatch,
            (&self.prepared_plan, &self.values),
            now,
        )
    }

    fn has_actions_to_begin(&self) -> bool {
        let mut instances = (0..self.dispatch.plan().instances.len()).map(InstanceId::from);
        instances.any(|instance| {
            let [start, _] = self.dispatch.start_and_end_nodes(instance);
            self.dispatch.execution_time(start).is_none()
        })
    }
}
