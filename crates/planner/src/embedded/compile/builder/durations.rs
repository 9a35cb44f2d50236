//! Bounds of durations, and the actions that read `?duration`.

use elbowroom_model::ground::{self, Change as ModelChange, DurativeBody};
use elbowroom_model::problem::Comparison;

use super::super::{Bound, Duration};
use crate::embedded::formula::Numeric;

impl Duration {
    /// Adds a constraint.
    pub(super) fn constrain(&mut self, constraint: &ground::DurationConstraint, value: Numeric) {
        let Some(constant) = value.as_constant() else {
            self.bounds.push(Bound {
                comparison: constraint.comparison,
                value,
                at_end: constraint.at_end,
            });
            return;
        };
        if !matches!(constraint.comparison, Comparison::AtMost | Comparison::Less)
            && *constant > self.least
        {
            self.least = constant.clone();
        }
        if !matches!(
            constraint.comparison,
            Comparison::AtLeast | Comparison::Greater
        ) && self.most.as_ref().is_none_or(|most| constant < most)
        {
            self.most = Some(constant.clone());
        }
    }
}

/// Returns `true` if a condition or an effect of the action reads `?duration`.
pub(in crate::embedded::compile) fn reads_duration(body: &DurativeBody) -> bool {
    let mut reads = false;
    let mut look = |leaf: &ground::Expression| {
        reads |= *leaf == ground::Expression::Duration;
    };
    body.over_all
        .visit_expressions(&mut |e| e.visit_leaves(&mut look));
    for snap in [&body.start, &body.end] {
        snap.condition
            .visit_expressions(&mut |e| e.visit_leaves(&mut look));
        for effect in &snap.effects {
            effect
                .guard
                .now
                .visit_expressions(&mut |e| e.visit_leaves(&mut look));
            if let ModelChange::Update { value, .. } = &effect.change {
                value.visit_leaves(&mut look);
            }
        }
    }
    reads
}
