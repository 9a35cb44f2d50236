//! Limits of numbers over time, from the conditions of actions.

use std::collections::BTreeMap;

use elbowroom::execution::{ActionHandle, BeliefState};
use elbowroom::model::expression::Comparison;
use elbowroom::model::ground::{Action, Body, Condition, Expression, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::decimal::nearest;

use crate::document::Limit;

/// Maximum number of limits shown for each number.
const MAX_LIMITS: usize = 2_000;

/// The limits of numbers during a run.
#[derive(Default)]
pub(super) struct NumericLimits {
    /// Limits whose time has passed, by number.
    by_fluent: BTreeMap<FluentId, Vec<LimitPeriod>>,
    /// Running actions: name, start time, over-all bounds, and condition at the end.
    running: BTreeMap<ActionHandle, RunningActionLimits>,
}

struct RunningActionLimits {
    name: String,
    since: Rational,
    over_all: Vec<(FluentId, Bound)>,
    at_end: Condition,
}

/// Limit of a number during an interval.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LimitPeriod {
    from: Rational,
    to: Rational,
    bound: Bound,
    /// `during (drive rover depot shelf)`.
    when: String,
    /// Value of the number, for a limit at one moment; the number may jump at that moment.
    value: Option<Rational>,
}

/// Time and value of a number, ordered by time. The number changes linearly between two points, and
/// jumps if they have the same time.
type Points = [(Rational, Rational)];

/// A bound of a number.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Bound {
    value: Rational,
    comparison: Comparison,
}

impl NumericLimits {
    /// Records the limits that the start of an action imposes in this state.
    pub(super) fn started(
        &mut self,
        ticket: ActionHandle,
        action: &Action,
        planned: Option<&Rational>,
        state: &BeliefState,
    ) {
        let at = state.time().clone();
        let name = action.name.clone();
        let body = match &action.body {
            Body::Instantaneous(snap) => {
                return self.add_momentary_limits(
                    &format!("at {name}"),
                    &snap.condition,
                    None,
                    state,
                );
            }
            Body::Durative(body) => body,
        };
        self.add_momentary_limits(
            &format!("at the start of {name}"),
            &body.start.condition,
            planned,
            state,
        );
        self.running.insert(
            ticket,
            RunningActionLimits {
                name,
                since: at,
                over_all: bounds(&body.over_all, planned, state),
                at_end: body.end.condition.clone(),
            },
        );
    }

    /// Records the limits of an action that has ended in this state.
    pub(super) fn ended(&mut self, ticket: ActionHandle, has_succeeded: bool, state: &BeliefState) {
        let Some(running) = self.running.remove(&ticket) else {
            return;
        };
        for (fluent, bound) in running.over_all {
            let allowed = LimitPeriod {
                from: running.since.clone(),
                to: state.time().clone(),
                bound,
                when: format!("during {}", running.name),
                value: None,
            };
            self.add(fluent, allowed);
        }
        if has_succeeded {
            let when = format!("at the end of {}", running.name);
            let took = state.time() - &running.since;
            self.add_momentary_limits(&when, &running.at_end, Some(&took), state);
        }
    }

    /// Returns all limits by number. Limits of running actions extend to the present.
    pub(super) fn finish(mut self, state: &BeliefState) -> BTreeMap<FluentId, Vec<LimitPeriod>> {
        let tickets: Vec<ActionHandle> = self.running.keys().copied().collect();
        for ticket in tickets {
            self.ended(ticket, false, state);
        }
        self.by_fluent
    }

    fn add_momentary_limits(
        &mut self,
        when: &str,
        condition: &Condition,
        duration: Option<&Rational>,
        state: &BeliefState,
    ) {
        for (fluent, bound) in bounds(condition, duration, state) {
            let allowed = LimitPeriod {
                from: state.time().clone(),
                to: state.time().clone(),
                bound,
                when: when.to_owned(),
                value: state.value(fluent).cloned(),
            };
            self.add(fluent, allowed);
        }
    }

    fn add(&mut self, fluent: FluentId, allowed: LimitPeriod) {
        let own = self.by_fluent.entry(fluent).or_default();
        if own.len() < MAX_LIMITS {
            own.push(allowed);
        }
    }
}

impl LimitPeriod {
    /// Converts the limit for drawing.
    pub(super) fn limit(&self) -> Limit {
        Limit {
            from: self.from.to_f64(),
            to: self.to.to_f64(),
            value: self.bound.value.to_f64(),
            side: self.bound.side(),
            words: self.describe(),
        }
    }

    fn describe(&self) -> String {
        let symbol = self.bound.comparison.symbol();
        format!("{symbol} {} {}", nearest(&self.bound.value), self.when)
    }

    /// Returns the smallest distance of the number from the limit, and its time. The distance is
    /// negative if the limit is violated.
    fn smallest_distance(&self, points: &Points) -> Option<(Rational, Rational)> {
        let distance = |value: &Rational| match self.bound.side() {
            0 => None,
            -1 => Some(value - &self.bound.value),
            _ => Some(&self.bound.value - value),
        };
        if let Some(value) = &self.value {
            return Some((distance(value)?, self.from.clone()));
        }
        // The extremes of a piecewise linear function: just after the start, just before the end,
        // and at the points in between.
        let after = points.partition_point(|(time, _)| *time <= self.from);
        let before = points.partition_point(|(time, _)| *time < self.to);
        let mut values = Vec::new();
        values.push((self.from.clone(), interpolate(points, after, &self.from)?));
        values.push((self.to.clone(), interpolate(points, before, &self.to)?));
        if after < before {
            values.extend_from_slice(&points[after..before]);
        }
        let distances = values
            .iter()
            .map(|(time, value)| Some((distance(value)?, time.clone())));
        distances.collect::<Option<Vec<_>>>()?.into_iter().min()
    }
}

/// Returns the value at `time`, interpolated between the points before and at `position`.
fn interpolate(points: &Points, position: usize, time: &Rational) -> Option<Rational> {
    let before = position
        .checked_sub(1)
        .and_then(|before| points.get(before));
    let (Some((from, low)), Some((to, high))) = (before, points.get(position)) else {
        return before
            .or(points.get(position))
            .map(|(_, value)| value.clone());
    };
    let share = (time - from).checked_div(&(to - from));
    Some(low + (high - low) * share.unwrap_or_default())
}

/// Describes the point at which a number is closest to a limit.
pub(super) fn describe_closest_point(limits: &[LimitPeriod], points: &Points) -> Option<String> {
    let distances = limits
        .iter()
        .filter_map(|own| Some((own.smallest_distance(points)?, own)));
    let ((distance, time), own) = distances.min_by(|(a, _), (b, _)| a.cmp(b))?;
    let (time, words) = (nearest(&time), own.describe());
    Some(if distance.is_negative() {
        format!(
            "Limit violated at {time} by {}: it had to be {words}.",
            nearest(&distance.abs())
        )
    } else {
        format!("Least slack at {time}: {} to {words}.", nearest(&distance))
    })
}

impl Bound {
    /// Returns -1 for a lower bound, 1 for an upper bound, and 0 for equality.
    fn side(&self) -> i8 {
        match self.comparison {
            Comparison::AtLeast | Comparison::Greater => -1,
            Comparison::Equal => 0,
            Comparison::AtMost | Comparison::Less => 1,
        }
    }
}

/// Returns the bounds that a condition imposes on each number while the others have their present
/// values. Ignores comparisons that do not contain the number exactly once and linearly, and
/// conditions that are part of a disjunction.
fn bounds(
    condition: &Condition,
    duration: Option<&Rational>,
    state: &BeliefState,
) -> Vec<(FluentId, Bound)> {
    let mut found = Vec::new();
    for part in condition.conjuncts() {
        let Condition::Compare(comparison, left, right) = part else {
            continue;
        };
        let mut fluents = Vec::new();
        for side in [left, right] {
            side.visit_fluents(&mut |fluent| fluents.push(fluent));
        }
        fluents.sort_unstable();
        fluents.dedup();
        for fluent in fluents {
            // The difference of both sides as a function of the number.
            let at = |value: i64| {
                let value = Rational::from(value);
                let mut leaf = |leaf: &Expression| match leaf {
                    Expression::Fluent(own) if *own == fluent => Some(value.clone()),
                    Expression::Fluent(own) => state.value(*own).cloned(),
                    Expression::Duration => duration.cloned(),
                    _ => None,
                };
                Some(left.evaluate(&mut leaf)? - right.evaluate(&mut leaf)?)
            };
            let (Some(zero), Some(one), Some(two)) = (at(0), at(1), at(2)) else {
                continue;
            };
            let slope = &one - &zero;
            if &two - &one != slope {
                continue;
            }
            let Some(value) = (-&zero).checked_div(&slope) else {
                continue;
            };
            let comparison = if slope.is_negative() {
                mirrored(*comparison)
            } else {
                *comparison
            };
            found.push((fluent, Bound { value, comparison }));
        }
    }
    found
}

fn mirrored(comparison: Comparison) -> Comparison {
    match comparison {
        Comparison::Less => Comparison::Greater,
        Comparison::AtMost => Comparison::AtLeast,
        Comparison::Equal => Comparison::Equal,
        Comparison::AtLeast => Comparison::AtMost,
        Comparison::Greater => Comparison::Less,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: i64) -> Rational {
        Rational::from(value)
    }

    fn allowed(from: i64, to: i64, comparison: Comparison, value: i64) -> LimitPeriod {
        LimitPeriod {
            from: number(from),
            to: number(to),
            bound: Bound {
                value: number(value),
                comparison,
            },
            when: "during (fly)".to_owned(),
            value: None,
        }
    }

    #[test]
    fn closest_point_is_extremum_or_end_of_limit() {
        // The number falls from 10 to 4 until time 3, jumps to 12, and falls to 0 until time 9.
        let points = [(0, 10), (3, 4), (3, 12), (9, 0)].map(|(a, b)| (number(a), number(b)));
        let distance = |limit: LimitPeriod| limit.smallest_distance(&points).expect("a distance");
        let least = |from, to| allowed(from, to, Comparison::AtLeast, 2);
        assert_eq!(
            distance(least(0, 3)),
            (number(2), number(3)),
            "just before it is filled"
        );
        assert_eq!(
            distance(least(3, 6)),
            (number(4), number(6)),
            "just after it was filled"
        );
        assert_eq!(distance(least(0, 9)), (number(-2), number(9)));
        assert_eq!(distance(least(1, 2)), (number(4), number(2)));
        let most = allowed(0, 9, Comparison::AtMost, 20);
        assert_eq!(distance(most), (number(8), number(3)));
        assert_eq!(
            allowed(0, 9, Comparison::Equal, 1).smallest_distance(&points),
            None
        );
        let words = describe_closest_point(&[least(3, 6), least(0, 3)], &points).expect("limits");
        assert_eq!(words, "Least slack at 3: 2 to >= 2 during (fly).");
        let words = describe_closest_point(&[least(0, 9)], &points).expect("limits");
        assert_eq!(
            words,
            "Limit violated at 9 by 2: it had to be >= 2 during (fly)."
        );
    }
}
