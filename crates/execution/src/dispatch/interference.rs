//! Separation of starts and planned ends from interfering happenings that the network does not
//! order.

use std::sync::Arc;

use elbowroom_model::Footprint;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use super::{Dispatch, is_instantaneous};
use crate::executor::StepId;
use crate::separation::Separation;

impl Dispatch {
    /// Keeps starts and planned ends at least ε away from all interfering happenings, also if the
    /// network does not order them. Past happenings count if they are less than ε before `now`, on
    /// the plan's clock.
    pub(crate) fn with_separation(mut self, now: &Rational) -> Self {
        let mut separation = Separation::new(&self.task, &self.origin);
        for (index, &[start, end]) in self.ends.iter().enumerate() {
            let id = InstanceId::from(index);
            let action = (&*self.task, &*self.actions[index]);
            let is_recent = |time: &&Rational| *time + &self.epsilon > *now;
            // The plan contains only the remainder of these actions, so their starts do not count
            // here.
            if let Some(time) = self.execution_time(start).filter(is_recent)
                && !self.resumed.contains(&id)
            {
                separation.note(Footprint::of_start(action.0, action.1), time);
            }
            if let Some(time) = self.execution_time(end).filter(is_recent)
                && start != end
            {
                separation.note(Footprint::of_end(action.0, action.1), time);
            }
            if self.progress.running.contains(&id) {
                // The remainder of a running action begins with the plan.
                let begun = self.execution_time(start).cloned().unwrap_or_default();
                let end = begun + self.nominal_duration(id);
                separation.expect_end(StepId::from(id).0, action, end);
            }
        }
        self.separation = Some(separation);
        self
    }

    /// Returns the time after `now` until which a start has to wait to keep its separation, or
    /// `None` if it may happen now. In that case it is recorded as happening now.
    pub(super) fn separation_end(&mut self, start: NodeId, now: &Rational) -> Option<Rational> {
        let (Node::Start(id) | Node::Instant(id)) = self.plan.nodes[start.index()] else {
            return None;
        };
        self.separation.as_ref()?;
        let action = Arc::clone(&self.actions[id.index()]);
        let duration = self.commanded_duration(id, now);
        let duration = (!is_instantaneous(&action)).then_some(&duration);
        let action = (&*self.task, &*action);
        let separation = self.separation.as_mut()?;
        let separated = separation.separated(action, duration, now);
        if separated.is_none() {
            separation.start(StepId::from(id).0, action, duration, now);
        }
        separated
    }
}
