//! Going on by the same network where something happened outside its bounds, or is overdue.

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId, network_node};

use super::Dispatch;
use crate::horizon::Missed;

/// What has happened outside the bounds of a network since it was last known to work.
#[derive(Clone, Debug, Default)]
pub(super) struct Strain {
    /// Ends outside the bounds of nothing but their own links.
    ends: Vec<NodeId>,
    /// Whether something else was missed.
    is_broken: bool,
}

impl Strain {
    /// A node happened at a time that its window does not allow.
    pub(super) fn missed(&mut self, node: NodeId, missed: &Missed) {
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
    /// When it began, on the plan's clock.
    pub(crate) begun: Rational,
    /// How long it was planned to take.
    pub(crate) planned: Rational,
}

/// A time by which an action that is overdue may be taken to end, on the plan's clock.
#[derive(Clone, Debug)]
pub(crate) enum Until {
    /// Whenever it likes.
    ForEver,
    /// By then.
    At(Rational),
    /// By then, or as much earlier as it takes.
    AtMost(Rational),
}

impl Dispatch {
    /// Goes on by the network as it is, if that works: with what has happened outside its bounds, and with each action
    /// that is overdue taken for one that ends by the first of these times that does.
    ///
    /// The time it takes does not depend on the length of the plan, but on what is next to what has happened. Where it
    /// says no, a look at the whole rest may still find that it works.
    pub(crate) fn bear(&mut self, now: &Rational, until: &dyn Fn(&Overdue) -> Vec<Until>) -> bool {
        if self.strain.is_broken {
            return false;
        }
        let running: Vec<InstanceId> = self.progress.running.iter().copied().collect();
        for id in running {
            let [start, end] = self.ends[id.index()];
            let Some(begun) = self.happened(start) else {
                continue;
            };
            let latest = self.horizon.window(network_node(end)).1;
            if latest.is_none_or(|latest| *now <= latest) {
                continue;
            }
            let overdue = Overdue {
                instance: id,
                begun: begun.clone(),
                planned: self.nominal_duration(id),
            };
            let end = network_node(end);
            let times = until(&overdue);
            let found = times.iter().find_map(|time| {
                let time = match time {
                    Until::ForEver => None,
                    Until::At(time) => Some(time.clone()),
                    Until::AtMost(time) => Some(self.horizon.prolongable(end, time, now)?),
                };
                let does = self.horizon.prolong(end, time.as_ref(), now);
                does.then_some(time)
            });
            let Some(found) = found else {
                return false;
            };
            let begun = &overdue.begun;
            self.durations[id.index()] = (Some(now - begun), found.map(|time| time - begun));
        }
        let mut ends = self.strain.ends.iter();
        if !ends.all(|end| self.horizon.bears(network_node(*end), now)) {
            return false;
        }
        if self.missing(now).is_some() {
            // Nobody was in time to decide on it.
            return false;
        }
        self.strain.ends.clear();
        true
    }

    /// The latest time, `most` at most, by which an action under way may end so that the network as it is still works; on
    /// the world's clock.
    pub(crate) fn prolongable(
        &self,
        id: InstanceId,
        most: &Rational,
        now: &Rational,
    ) -> Option<Rational> {
        if self.strain.is_broken || !self.strain.ends.is_empty() {
            return None;
        }
        let end = network_node(self.ends[id.index()][1]);
        let now = self.local(now);
        let last = self.horizon.prolongable(end, most, &now)?;
        Some(self.world(&last))
    }
}
