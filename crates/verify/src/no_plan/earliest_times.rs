//! Earliest times at which conditions can hold, by a list of facts.

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, DurativeBody, SnapAction};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::static_facts::{Span, StaticFacts, Value};
use super::{Fact, ReachedFacts};

/// Information that the check of a condition uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ConditionContext {
    /// The list of facts, and the problem.
    All,
    /// Only permanent information from the problem.
    StaticOnly,
}

/// Evaluates conditions against a list of facts.
#[derive(Clone, Copy, Debug)]
pub(super) struct EarliestTimes<'a> {
    pub(super) task: &'a Task,
    pub(super) static_facts: &'a StaticFacts,
    pub(super) reached: &'a ReachedFacts,
    /// Initial time.
    pub(super) now: &'a Rational,
}

impl EarliestTimes<'_> {
    /// Returns the earliest time, not before `time`, at which a condition can hold; `None` if it
    /// never can.
    pub(super) fn next(
        &self,
        condition: &Condition,
        time: &Rational,
        held_to: ConditionContext,
    ) -> Option<Rational> {
        self.earliest_interval(condition, time, &Rational::ZERO, held_to)
    }

    /// Returns the earliest start, not before `time`, of an interval of this length that the
    /// condition can hold for.
    fn earliest_interval(
        &self,
        condition: &Condition,
        time: &Rational,
        length: &Rational,
        held_to: ConditionContext,
    ) -> Option<Rational> {
        match condition {
            Condition::Fact(fact) => {
                let fact = self.task.atom(*fact);
                self.next_of_fact(&fact, time, length, held_to)
            }
            Condition::And(parts) => {
                let mut least = time.clone();
                loop {
                    let before = least.clone();
                    for part in parts {
                        least = self.earliest_interval(part, &least, length, held_to)?;
                    }
                    // Each round but the last advances to the beginning of some interval.
                    if least == before {
                        return Some(least);
                    }
                }
            }
            // Different parts may make it hold at different moments, so `length` is ignored.
            Condition::Or(parts) => {
                let times = parts
                    .iter()
                    .filter_map(|part| self.next(part, time, held_to));
                times.min()
            }
            Condition::Compare(..) => match self.spans_of_comparison(condition, true) {
                Some(spans) => first_fit(&spans, time, length),
                None => self.has_values(condition).then(|| time.clone()),
            },
            Condition::Not(part) => match self.spans_of_comparison(part, false) {
                Some(spans) => first_fit(&spans, time, length),
                None => (!self.is_always_true(part)).then(|| time.clone()),
            },
        }
    }

    fn next_of_fact(
        &self,
        fact: &Fact,
        time: &Rational,
        length: &Rational,
        held_to: ConditionContext,
    ) -> Option<Rational> {
        if let Some(spans) = self.static_facts.spans(fact) {
            return first_fit(spans, time, length);
        }
        match held_to {
            ConditionContext::StaticOnly => Some(time.clone()),
            ConditionContext::All => {
                let from = self.reached.get(fact)?;
                Some(Rational::max(from.clone(), time.clone()))
            }
        }
    }

    /// Returns the intervals in which a comparison of numbers may be true (or false, if `truth` is). `None` for other
    /// conditions, and for numbers that something other than timed initials changes.
    fn spans_of_comparison(&self, condition: &Condition, truth: bool) -> Option<Vec<Span>> {
        let Condition::Compare(comparison, left, right) = condition else {
            return None;
        };
        let compared = (*comparison, [left, right]);
        self.static_facts
            .spans_of_comparison(self.task, compared, truth)
    }

    /// Returns `true` unless the condition is a comparison with a side that never has a value.
    fn has_values(&self, condition: &Condition) -> bool {
        let Condition::Compare(_, left, right) = condition else {
            return true;
        };
        let is_undefined = |side| self.static_facts.value(self.task, side) == Value::Undefined;
        ![left, right].into_iter().any(is_undefined)
    }

    /// Returns `true` if a condition mentions facts that are true only at some times, by timed
    /// initials alone.
    pub(super) fn is_timed(&self, condition: &Condition) -> bool {
        let mut is_timed = false;
        condition.visit_facts(&mut |fact| {
            let spans = self.static_facts.spans(&self.task.atom(fact));
            is_timed |= spans.is_some_and(|spans| {
                let lasts = |span: &Span| span.0 <= *self.now && span.1.is_none();
                !spans.is_empty() && !spans.iter().any(lasts)
            });
        });
        is_timed
    }

    /// Returns `true` if a condition holds at all times by the problem itself.
    fn is_always_true(&self, condition: &Condition) -> bool {
        match condition {
            Condition::Fact(fact) => self
                .static_facts
                .is_always_true(self.task, &self.task.atom(*fact)),
            Condition::And(parts) => parts.iter().all(|part| self.is_always_true(part)),
            Condition::Or(parts) => parts.iter().any(|part| self.is_always_true(part)),
            Condition::Compare(comparison, left, right) => {
                let sides = [left, right].map(|side| self.static_facts.value(self.task, side));
                matches!(sides, [Value::Known(left), Value::Known(right)] if comparison.holds(&left, &right))
            }
            Condition::Not(part) => self.never_holds(part),
        }
    }

    /// Returns `true` if a condition holds at no time by the problem itself.
    fn never_holds(&self, condition: &Condition) -> bool {
        self.next(condition, self.now, ConditionContext::StaticOnly)
            .is_none()
    }

    /// Returns `true` if a condition can hold after all timed initials have happened.
    pub(super) fn can_hold_at_end(&self, condition: &Condition) -> bool {
        match condition {
            Condition::Fact(fact) => {
                let fact = self.task.atom(*fact);
                let spans = self.static_facts.spans(&fact);
                spans.map_or_else(|| self.reached.contains_key(&fact), holds_at_end)
            }
            Condition::And(parts) => parts.iter().all(|part| self.can_hold_at_end(part)),
            Condition::Or(parts) => parts.iter().any(|part| self.can_hold_at_end(part)),
            Condition::Compare(..) | Condition::Not(_) => {
                let spans = match condition {
                    Condition::Not(part) => self.spans_of_comparison(part, false),
                    _ => self.spans_of_comparison(condition, true),
                };
                let can_hold = || {
                    self.next(condition, self.now, ConditionContext::All)
                        .is_some()
                };
                spans.map_or_else(can_hold, |spans| holds_at_end(&spans))
            }
        }
    }

    /// Returns the earliest time of an instantaneous action.
    pub(super) fn instant(&self, snap: &SnapAction) -> Option<Rational> {
        self.next(&snap.condition, self.now, ConditionContext::All)
    }

    /// Returns the earliest start and end of a durative action. `later` limits its later
    /// conditions.
    pub(super) fn ends(
        &self,
        body: &DurativeBody,
        later: ConditionContext,
    ) -> Option<(Rational, Rational)> {
        self.starts(body, self.now, ConditionContext::All, later)
    }

    /// Returns the earliest start, not before `time`, and end of a durative action.
    pub(super) fn starts(
        &self,
        body: &DurativeBody,
        time: &Rational,
        first: ConditionContext,
        later: ConditionContext,
    ) -> Option<(Rational, Rational)> {
        let (least, most) = self.duration(body)?;
        let mut start = time.clone();
        loop {
            let before = start.clone();
            start = self.next(&body.start.condition, &start, first)?;
            // An action that may have duration 0 has no moment between its start and its end.
            if least > Rational::ZERO {
                start = self.earliest_interval(&body.over_all, &start, &least, later)?;
            }
            let end = self.next(&body.end.condition, &(&start + &least), later)?;
            if let Some(most) = &most {
                start = Rational::max(start, &end - most);
            }
            if start == before {
                return Some((start, end));
            }
        }
    }

    /// Returns the earliest end, not before `time`, of an action with this least duration. Its
    /// over-all condition has to hold during the last part of the action, which has that length.
    pub(super) fn end_from(
        &self,
        body: &DurativeBody,
        least: &Rational,
        time: &Rational,
        held_to: ConditionContext,
    ) -> Option<Rational> {
        let mut end = time.clone();
        loop {
            let before = end.clone();
            end = self.next(&body.end.condition, &end, held_to)?;
            if least.is_positive() {
                let start = Rational::max(&end - least, self.now.clone());
                let rest = &end - &start;
                end = self.earliest_interval(&body.over_all, &start, &rest, held_to)? + rest;
            }
            if end == before {
                return Some(end);
            }
        }
    }

    /// Returns the least and the greatest duration by bounds that do not change; `None` if no
    /// duration is allowed.
    pub(super) fn duration(&self, body: &DurativeBody) -> Option<(Rational, Option<Rational>)> {
        let (mut least, mut most) = (Rational::ZERO, None::<Rational>);
        for constraint in &body.duration {
            let bound = match self.static_facts.value(self.task, &constraint.bound) {
                Value::Known(bound) => bound,
                Value::Undefined => return None,
                Value::Unknown => continue,
            };
            if !matches!(constraint.comparison, Comparison::AtMost | Comparison::Less) {
                least = Rational::max(least, bound.clone());
            }
            if !matches!(
                constraint.comparison,
                Comparison::AtLeast | Comparison::Greater
            ) {
                most = Some(match most {
                    Some(most) => Rational::min(most, bound),
                    None => bound,
                });
            }
        }
        let is_possible = most.as_ref().is_none_or(|most| least <= *most);
        is_possible.then_some((least, most))
    }
}

/// Returns the earliest start, not before `time`, of an interval of this length in one of the spans.
fn first_fit(spans: &[Span], time: &Rational, length: &Rational) -> Option<Rational> {
    spans.iter().find_map(|(from, until)| {
        let least = Rational::max(from.clone(), time.clone());
        let end = &least + length;
        until
            .as_ref()
            .is_none_or(|until| end <= *until)
            .then_some(least)
    })
}

fn holds_at_end(spans: &[Span]) -> bool {
    spans.last().is_some_and(|span| span.1.is_none())
}
