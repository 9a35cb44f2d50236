//! History of one fluent.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::super::precedence::{Around, Side};
use crate::linear::Linear;
use elbowroom_plan::NodeId;

/// Change of a fluent.
#[derive(Clone, Debug)]
pub(crate) enum FluentChange {
    /// It gets a value, or loses it (an effect whose right-hand side is undefined).
    Assign(Option<Linear>),
    /// It changes by an amount.
    Shift(Linear),
    /// A continuous change with this rate begins; no times occur in the rate.
    Drift(Linear),
    /// A continuous change that began at that node stops.
    DriftEnd(NodeId),
}

/// State of a fluent after some changes.
#[derive(Clone, Debug, Default)]
pub(super) struct FluentState {
    pub(super) base: Option<Linear>,
    drifts: Vec<Drift>,
}

/// Active continuous change.
#[derive(Clone, Debug)]
struct Drift {
    start: NodeId,
    /// The base of the fluent includes the change from `start` to this node.
    counted_until: NodeId,
    rate: Linear,
}

impl FluentState {
    /// Applies the next change.
    pub(super) fn apply(&mut self, node: NodeId, change: &FluentChange) {
        match change {
            FluentChange::Assign(value) => {
                self.base.clone_from(value);
                for drift in &mut self.drifts {
                    drift.counted_until = node;
                }
            }
            FluentChange::Shift(amount) => {
                if let Some(base) = &mut self.base {
                    base.add_scaled(amount, &Rational::ONE);
                }
            }
            FluentChange::Drift(rate) => {
                // It is nearly always the only one, and such states are stored for many moments.
                if self.drifts.is_empty() {
                    self.drifts.reserve_exact(1);
                }
                self.drifts.push(Drift {
                    start: node,
                    counted_until: node,
                    rate: rate.clone(),
                });
            }
            FluentChange::DriftEnd(since) => {
                let mut drifts = self.drifts.iter();
                if let Some(index) = drifts.position(|drift| drift.start == *since) {
                    let drift = self.drifts.remove(index);
                    self.base = drift.added_to(self.base.take(), node);
                }
            }
        }
    }

    /// Returns the value at a moment after these changes and before all others.
    pub(super) fn value(&self, moment: NodeId) -> Option<Linear> {
        let drifts = self.drifts.iter();
        drifts.fold(self.base.clone(), |base, drift| {
            drift.added_to(base, moment)
        })
    }

    /// Returns the rates of the active continuous changes.
    pub(super) fn rates(&self) -> impl Iterator<Item = &Linear> {
        self.drifts.iter().map(|drift| &drift.rate)
    }
}

impl Drift {
    /// Returns `base + rate * (until - counted)`. Rates contain no times, so the product can always
    /// be represented.
    fn added_to(&self, base: Option<Linear>, until: NodeId) -> Option<Linear> {
        let mut base = base?;
        let difference = Linear::difference(self.counted_until, until);
        base.add_scaled(&self.rate.times(&difference)?, &Rational::ONE);
        Some(base)
    }
}

/// Changes of a fluent along a plan.
#[derive(Clone, Debug, Default)]
pub(crate) struct FluentHistory {
    first: FluentState,
    pub(super) events: Vec<(NodeId, FluentChange)>,
    /// State after all events.
    last: FluentState,
    /// For each assignment: its position, and the state after it.
    assigned: Vec<(usize, FluentState)>,
}

impl FluentHistory {
    /// Sets the initial value.
    pub(super) fn set_initial(&mut self, value: Option<Linear>) {
        self.first.base.clone_from(&value);
        self.last.base = value;
    }

    /// Appends a change.
    pub(super) fn push(&mut self, node: NodeId, change: FluentChange) {
        self.last.apply(node, &change);
        if matches!(change, FluentChange::Assign(Some(_))) {
            self.assigned.push((self.events.len(), self.last.clone()));
        }
        self.events.push((node, change));
    }

    /// Returns the state after all events.
    pub(super) fn last(&self) -> &FluentState {
        &self.last
    }

    /// Returns the state after those events for which `cut` is true.
    pub(super) fn state_at(&self, cut: &dyn Fn(NodeId) -> bool) -> FluentState {
        let mut standing = self.first.clone();
        for (node, change) in self.events.iter().filter(|(node, _)| cut(*node)) {
            standing.apply(*node, change);
        }
        standing
    }

    /// Returns the part of the history that is relevant to a moment inside an action. Collects the
    /// events that may be on either side of the moment.
    ///
    /// Every change of a fluent interferes with its assignments. So all changes before a past
    /// assignment are past, and all changes after a future assignment are in the future.
    pub(super) fn relevant_part(
        &self,
        around: &mut Around<'_>,
        open: &mut BTreeSet<NodeId>,
    ) -> Self {
        let here = self
            .events
            .partition_point(|(node, _)| around.is_not_after_start(*node));
        let (mut first, mut kept) = (self.first.clone(), Vec::new());
        for index in (0..here).rev() {
            let node = self.events[index].0;
            if around.side(node) != Some(Side::Before) {
                open.insert(node);
            } else if let Ok(found) = self.assigned.binary_search_by_key(&index, |own| own.0) {
                first = self.assigned[found].1.clone();
                break;
            }
            kept.push(index);
        }
        kept.reverse();
        for (index, (node, change)) in self.events.iter().enumerate().skip(here) {
            if around.side(*node) != Some(Side::After) {
                open.insert(*node);
                kept.push(index);
            } else if matches!(change, FluentChange::Assign(Some(_))) {
                break;
            }
        }
        let mut near = Self {
            last: first.clone(),
            first,
            ..Self::default()
        };
        for index in kept {
            let (node, change) = &self.events[index];
            if near.events.is_empty() && !open.contains(node) {
                near.first.apply(*node, change);
                near.last.apply(*node, change);
            } else {
                near.push(*node, change.clone());
            }
        }
        near
    }
}
