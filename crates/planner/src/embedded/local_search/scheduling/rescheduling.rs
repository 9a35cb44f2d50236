//! Schedule of the search for better orders.

use super::super::super::compile::Metric;
use super::super::super::tuning::Technique;
use super::super::incumbent::Incumbent;
use super::super::sequence::Item;
use super::super::{Refiner, WorkMeter};
use super::Scheduling;

impl Refiner<'_> {
    /// Reacts to a new best plan: continues from it if it has the same actions.
    pub(in super::super) fn schedule_from_best(&mut self) {
        let Some((worth, items)) = self.best.as_ref() else {
            return;
        };
        // If only the order differs, the search continues.
        let of_these = |scheduling: &Scheduling<'_>| scheduling.is_of(items);
        self.scheduling = self.scheduling.take().filter(of_these);
        if let Some(scheduling) = &mut self.scheduling {
            scheduling.demand(items, worth.end);
            let burst = self.compiled.tuning.scheduling_burst;
            self.scheduling_patience = burst.max(2 * self.scheduled_for);
        } else {
            (self.is_scheduled, self.scheduling_patience) = (false, 0);
        }
        self.scheduled_for = 0;
    }

    /// Returns `true` if better orders of the best plan's actions are searched for next: some may
    /// exist, and the metric depends on time.
    pub(in super::super) fn is_turn_to_schedule(&self) -> bool {
        let tuning = &self.compiled.tuning;
        let is_timed = |metric: &Metric| !metric.time.is_zero();
        let may_find = if let Some(scheduling) = &self.scheduling {
            !scheduling.is_over
        } else {
            // If other actions are possible, wait until other methods no longer find better plans,
            // because a poor plan in its best order is hard to improve.
            let is_late = self.turns_since_best >= tuning.scheduling_late;
            !self.is_scheduled && (is_late || self.is_all_about_order())
        };
        let others = self.work.repair.saturating_add(self.work.rescheduling);
        let is_slow = self.scheduling.as_ref().is_some_and(Scheduling::is_slow);
        let patience = match self.scheduling_patience {
            _ if is_slow => 0,
            // Other methods still find better plans.
            0 if self.turns_since_best < tuning.scheduling_after => 0,
            patience => patience.max(tuning.scheduling_burst),
        };
        let spent = self.work.scheduling.saturating_mul(tuning.scheduling_share);
        tuning.uses(Technique::Scheduling)
            && may_find
            && self.compiled.metric.as_ref().is_none_or(is_timed)
            && (spent <= others || self.scheduled_for < patience)
    }

    /// Returns `true` if there are not many more actions than those of the best plan, as in a job
    /// shop.
    fn is_all_about_order(&self) -> bool {
        let items = self.best.as_ref().map_or(0, |(_, items)| items.len());
        2 * items >= self.compiled.actions.len()
    }

    /// Searches for a better order.
    pub(in super::super) fn schedule(&mut self, ticker: &mut WorkMeter<'_>) -> Option<Vec<Item>> {
        let (worth, items) = self.best.as_ref()?;
        if self.scheduling.is_none() {
            self.is_scheduled = true;
            self.scheduling = Scheduling::of(self.compiled, items, worth.end, ticker);
        }
        let scheduling = self.scheduling.as_mut()?;
        let found = scheduling.next(self.compiled.tuning.scheduling_work, ticker)?;
        // If the found order is not better, the model does not represent the plan correctly.
        let better = Incumbent::of(self.compiled, &found);
        scheduling.is_over = better.is_none_or(|better| better.cost.end >= worth.end);
        Some(found)
    }
}
