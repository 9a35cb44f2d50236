//! Continuation with the present network after violations of its bounds, and with overdue actions.

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId, network_node};

use super::Dispatch;
use crate::window_propagation::Missed;

/// Violations of a network's bounds since the network was last known to be executable.
#[derive(Clone, Debug, Default)]
pub(super) struct BoundViolations {
    /// Ends that violate only the bounds of their own links.
    ends: Vec<NodeId>,
    /// `true` if any other bound was violated.
    is_broken: bool,
}

impl BoundViolations {
    /// Records a node that was executed outside its window.
    pub(super) fn record_violation(&mut self, node: NodeId, missed: &Missed) {
        if missed.is_only_link {
            self.ends.push(node);
        } else {
            self.is_broken = true;
        }
    }
}

/// An action that should have ended by now.
pub(crate) struct Overdue {
    pub(crate) instance: InstanceId,
    /// Its start, on the plan's clock.
    pub(crate) started: Rational,
    /// The planned duration.
    pub(crate) planned: Rational,
}

/// Assumption about the end of an overdue action, on the plan's clock.
#[derive(Clone, Debug)]
pub(crate) enum EndAssumption {
    /// It ends at any time.
    AnyTime,
    /// It ends by this time.
    By(Rational),
    /// It ends by this time, or as much earlier as the network requires.
    ByOrEarlier(Rational),
}

impl Dispatch {
    /// Continues with the present network if it is still executable, despite the violations so far.
    /// Returns `true` if it is. For each overdue action, `until` lists assumptions about its end,
    /// and the first one with which the network works is adopted.
    ///
    /// The run time depends on the neighbours of the executed time points, not on the length of the
    /// plan. The check is incomplete: if it returns `false`, the remaining plan may still be
    /// feasible.
    pub(crate) fn continue_if_executable(
        &mut self,
        now: &Rational,
        until: &dyn Fn(&Overdue) -> Vec<EndAssumption>,
    ) -> bool {
        if self.bound_violations.is_broken {
            return false;
        }
        let running: Vec<InstanceId> = self.progress.running.iter().copied().collect();
        for id in running {
            let [start, end] = self.ends[id.index()];
            let Some(begun) = self.execution_time(start) else {
                continue;
            };
            let latest = self.horizon.window(network_node(end)).1;
            if latest.is_none_or(|latest| *now <= latest) {
                continue;
            }
            let overdue = Overdue {
                instance: id,
                started: begun.clone(),
                planned: self.nominal_duration(id),
            };
            let end = network_node(end);
            let times = until(&overdue);
            let found = times.iter().find_map(|time| {
                let time = match time {
                    EndAssumption::AnyTime => None,
                    EndAssumption::By(time) => Some(time.clone()),
                    EndAssumption::ByOrEarlier(time) => {
                        Some(self.horizon.latest_assumable_end(end, time, now)?)
                    }
                };
                let does = self.horizon.assume_end_by(end, time.as_ref(), now);
                does.then_some(time)
            });
            let Some(found) = found else {
                return false;
            };
            let begun = &overdue.started;
            self.durations[id.index()] = (Some(now - begun), found.map(|time| time - begun));
        }
        let mut ends = self.bound_violations.ends.iter();
        if !ends.all(|end| {
            self.horizon
                .remains_executable_after(network_node(*end), now)
        }) {
            return false;
        }
        if self.first_missed_time_point(now).is_some() {
            // The executor has missed a time point.
            return false;
        }
        self.bound_violations.ends.clear();
        true
    }

    /// Returns the latest end of a running action, at most `most`, for which the present network
    /// remains executable, on the world's clock.
    pub(crate) fn latest_tolerable_end(
        &self,
        id: InstanceId,
        most: &Rational,
        now: &Rational,
    ) -> Option<Rational> {
        if self.bound_violations.is_broken || !self.bound_violations.ends.is_empty() {
            return None;
        }
        let end = network_node(self.ends[id.index()][1]);
        let now = self.to_plan_time(now);
        let last = self.horizon.latest_assumable_end(end, most, &now)?;
        Some(self.to_world_time(&last))
    }
}
