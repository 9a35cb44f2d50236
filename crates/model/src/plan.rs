//! Plans with fixed times, as planners print them.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_num::Rational;

use crate::ground::Action;
use crate::problem::{ObjectId, SchemaId};

/// Actions with start times and durations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeTriggeredPlan {
    /// The steps, not necessarily sorted by time. The first steps of a remaining plan continue the
    /// running actions ([`Situation`](crate::Situation)).
    pub steps: Vec<Step>,
}

/// One action of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Start time.
    pub start: Rational,
    /// The action. A plan may contain it several times.
    pub action: Arc<Action>,
    /// The duration; `None` exactly for instantaneous actions.
    pub duration: Option<Rational>,
}

impl Step {
    /// Returns the steps sorted by start. The sort is stable.
    pub fn by_start(steps: &[Self]) -> Vec<&Self> {
        let mut steps: Vec<&Self> = steps.iter().collect();
        steps.sort_by(|one, other| one.start.cmp(&other.start));
        steps
    }

    /// Puts the steps [in order of start](Self::by_start).
    pub fn sort_by_start(steps: &mut [Self]) {
        steps.sort_by(|one, other| one.start.cmp(&other.start));
    }

    /// Compares two steps by start, then by name, then by duration.
    pub fn order(&self, other: &Self) -> Ordering {
        let by_start = self.start.cmp(&other.start);
        by_start
            .then_with(|| self.action.name.cmp(&other.action.name))
            .then_with(|| self.duration.cmp(&other.duration))
    }

    /// Returns the end time; the start time for an instantaneous action.
    pub fn end(&self) -> Rational {
        match &self.duration {
            Some(duration) => &self.start + duration,
            None => self.start.clone(),
        }
    }
}

impl TimeTriggeredPlan {
    /// Returns the plan with its steps in order of start, then by name and duration. The order in
    /// which a file lists simultaneous steps has no meaning.
    #[must_use]
    pub fn in_order(mut self) -> Self {
        self.steps.sort_by(Step::order);
        self
    }

    /// Returns two steps of one ground action that overlap, by position, or `None` if no action
    /// overlaps itself.
    ///
    /// Two steps overlap if each of them starts before the other one has ended. One that starts
    /// when the other one ends does not overlap it, and neither does an instantaneous action. If
    /// there are several such pairs, the result is the one whose later step starts first.
    pub fn self_overlap(&self) -> Option<[usize; 2]> {
        let mut order: Vec<usize> = (0..self.steps.len()).collect();
        order.sort_by(|&one, &other| self.steps[one].start.cmp(&self.steps[other].start));
        // For each action, the earlier step that ends last.
        let mut last: BTreeMap<(SchemaId, &[ObjectId]), usize> = BTreeMap::new();
        for later in order {
            let step = &self.steps[later];
            if step.duration.is_none() {
                continue;
            }
            let key = (step.action.schema, step.action.arguments.as_slice());
            let earlier = last.entry(key).or_insert(later);
            let other = &self.steps[*earlier];
            if *earlier != later && step.start < other.end() && other.start < step.end() {
                return Some([*earlier, later]);
            }
            if other.end() < step.end() {
                *earlier = later;
            }
        }
        None
    }

    /// Returns the time of the last happening of the plan's actions; 0 for an empty plan.
    pub fn makespan(&self) -> Rational {
        self.steps.iter().map(Step::end).max().unwrap_or_default()
    }
}
