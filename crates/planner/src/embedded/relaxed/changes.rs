//! Amounts that actions add to fluents, where they do not depend on the state.
//!
//! A continuous effect adds its rate times the duration, as an effect at the end with `?duration`
//! does. If the duration is open, the amount is the greatest one that its bounds allow: the least
//! drain, or the longest charge.

use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::super::compile::{Action, Compiled, Macro, NONE, Snap};
use super::super::formula::{Formula, Numeric};
use super::super::tuning::Technique;
use super::graph::Kind;

/// A change of a fluent by an action.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    pub(super) fluent: u32,
    /// May be infinite.
    pub(super) amount: f64,
    pub(super) moment: Moment,
}

/// Time of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Moment {
    Start,
    /// Between start and end.
    Throughout,
    End,
}

impl Change {
    /// Returns the conditions that the action reads before the change, the latest first.
    pub(super) fn before<'c>(
        self,
        compiled: &'c Compiled,
        action: &Action,
    ) -> impl Iterator<Item = &'c Formula> {
        let snaps = match self.moment {
            Moment::Start | Moment::Throughout => [action.start, NONE],
            Moment::End => [action.end, action.start],
        };
        let snaps = snaps.into_iter().filter(|&snap| snap != NONE);
        snaps.map(|snap| &compiled.snap(snap).condition)
    }
}

/// Returns the changes of fluents by an action.
pub(super) fn changes<'c>(
    compiled: &'c Compiled,
    action: &'c Action,
) -> impl Iterator<Item = Change> + 'c {
    let snaps = [(action.start, Moment::Start), (action.end, Moment::End)];
    let snaps = snaps.into_iter().filter(|(snap, _)| *snap != NONE);
    let jumps = snaps.flat_map(move |(snap, moment)| {
        amounts(compiled, action, compiled.snap(snap)).map(move |(fluent, amount)| Change {
            fluent,
            amount,
            moment,
        })
    });
    let is_on = compiled.tuning.uses(Technique::ContinuousDrains);
    let flows = action.flows.iter().filter(move |_| is_on);
    let flows = flows.filter_map(|flow| {
        let amount = greatest(action, flow.rate.as_constant()?, &Rational::ZERO);
        // A drain under a condition may not take place.
        let is_sure = flow.guard.is_none() || amount > 0.0;
        is_sure.then_some(Change {
            fluent: flow.fluent,
            amount,
            moment: Moment::Throughout,
        })
    });
    jumps.chain(flows)
}

/// Returns the changes of fluents by an operator. Continuous changes belong to the start.
pub(super) fn changes_by(compiled: &Compiled, kind: Kind) -> Vec<(u32, f64)> {
    if let Kind::Macro(number) = kind {
        let Macro { envelope, content } = compiled.macros[number as usize];
        let whole = |action| changes_by(compiled, Kind::Compressed(action));
        return [whole(envelope), whole(content)].concat();
    }
    let (action, is_part): (u32, fn(Moment) -> bool) = match kind {
        Kind::Compressed(action) => (action, |_| true),
        Kind::Start(action) => (action, |moment| moment != Moment::End),
        Kind::End(action) => (action, |moment| moment == Moment::End),
        Kind::Macro(_) | Kind::Timed(_) | Kind::Axiom => return Vec::new(),
    };
    changes(compiled, compiled.action(action))
        .filter(|change| is_part(change.moment))
        .map(|change| (change.fluent, change.amount))
        .collect()
}

/// Returns the constants that an operator assigns to fluents.
pub(super) fn assignments(compiled: &Compiled, kind: Kind) -> Vec<(u32, f64)> {
    let snaps = match kind {
        Kind::Compressed(action) => {
            let action = compiled.action(action);
            [action.start, action.end]
        }
        Kind::Start(action) => [compiled.action(action).start, NONE],
        Kind::End(action) => [NONE, compiled.action(action).end],
        Kind::Macro(_) | Kind::Timed(_) | Kind::Axiom => [NONE, NONE],
    };
    let snaps = snaps.into_iter().filter(|&snap| snap != NONE);
    let updates = snaps.flat_map(|snap| &compiled.snap(snap).updates);
    let assigned = updates.filter(|update| update.operator == UpdateOperator::Assign);
    assigned
        .filter_map(|update| Some((update.fluent, update.value.as_constant()?.to_f64())))
        .collect()
}

/// Returns the amounts that a happening of an action adds to fluents.
fn amounts<'c>(
    compiled: &'c Compiled,
    action: &'c Action,
    snap: &'c Snap,
) -> impl Iterator<Item = (u32, f64)> + 'c {
    let is_on = compiled.tuning.uses(Technique::ContinuousDrains);
    snap.updates.iter().filter_map(move |update| {
        let Numeric::Linear(value) = &update.value else {
            return None;
        };
        if !value.terms.is_empty() || !is_on && !value.duration.is_zero() {
            return None;
        }
        let amount = match update.operator {
            UpdateOperator::Increase => greatest(action, &value.duration, &value.constant),
            UpdateOperator::Decrease => greatest(action, &-&value.duration, &-&value.constant),
            _ => return None,
        };
        Some((update.fluent, amount))
    })
}

/// Returns the greatest value of `factor · ?duration + constant`.
fn greatest(action: &Action, factor: &Rational, constant: &Rational) -> f64 {
    let duration = if factor.is_positive() {
        let most = action.duration.most.as_ref();
        most.map_or(f64::INFINITY, Rational::to_f64)
    } else {
        action.duration.least.to_f64()
    };
    let change = if factor.is_zero() {
        0.0
    } else {
        factor.to_f64() * duration
    };
    constant.to_f64() + change
}
