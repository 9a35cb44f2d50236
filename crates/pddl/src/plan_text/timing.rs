//! Start times and durations of the actions of a plan, as its text gives them.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::form::Form;
use super::line::{RawStep, Word};
use super::step::span;
use crate::report::Report;

/// An action with the times that the text gives.
pub(super) struct TimedStep<'s> {
    pub(super) raw: RawStep<'s>,
    pub(super) start: Start,
    pub(super) duration: Duration,
    /// The printed time of the end, where the text gives the end instead of the duration.
    pub(super) end: Option<Word<'s>>,
}

/// The start of an action.
pub(super) enum Start {
    At(Rational),
    /// It starts when the action before it has ended.
    Next,
}

/// The duration of an action.
pub(super) enum Duration {
    Given(Rational),
    /// The text gives none.
    Missing,
    /// The action is instantaneous: the text gives both ends of durative actions.
    Instant,
}

/// Computes the time of each action. Actions whose times cannot be read are reported and dropped.
pub(super) fn timed<'s>(report: &mut Report, mut steps: Vec<RawStep<'s>>) -> Vec<TimedStep<'s>> {
    number_steps(&mut steps);
    let is_sequential = |step: &RawStep<'_>| step.form.is_sequential() || step.time.is_none();
    if steps.iter().all(is_sequential) {
        return sequence(report, steps);
    }
    for step in steps.iter().filter(|step| is_sequential(step)) {
        report
            .error(span(&step.range()), "an action without a time")
            .label("other actions of this plan have one")
            .advise("expected `time: (action argument …) [duration]`");
    }
    let (happenings, whole): (Vec<_>, Vec<_>) = steps
        .into_iter()
        .filter(|step| !is_sequential(step))
        .partition(|step| step.form.is_happening());
    let has_happenings = !happenings.is_empty();
    let mut timed: Vec<_> = whole
        .into_iter()
        .filter_map(|raw| {
            let start = raw.time.as_ref().map(|time| number(report, time));
            let duration = match raw.duration.as_ref().map(|word| number(report, word)) {
                Some(duration) => Duration::Given(duration?),
                None if has_happenings => Duration::Instant,
                None => Duration::Missing,
            };
            Some(TimedStep {
                start: Start::At(start.flatten()?),
                raw,
                duration,
                end: None,
            })
        })
        .collect();
    timed.extend(paired(report, happenings));
    timed
}

/// Marks the steps of FF, which writes `step` before its first number only.
fn number_steps(steps: &mut [RawStep<'_>]) {
    if !steps.iter().any(|step| step.form == Form::Ff) {
        return;
    }
    for step in steps.iter_mut().filter(|step| step.form == Form::Words) {
        let is_count = |word: &Word<'_>| word.text.bytes().all(|byte| byte.is_ascii_digit());
        if step.duration.is_none() && step.time.as_ref().is_some_and(is_count) {
            step.form = Form::Ff;
        }
    }
}

/// Returns sequential actions. The numbers before them must be consecutive, so that none is
/// missing.
fn sequence<'s>(report: &mut Report, steps: Vec<RawStep<'s>>) -> Vec<TimedStep<'s>> {
    let mut expected: Option<u64> = None;
    let mut timed = Vec::with_capacity(steps.len());
    for raw in steps {
        if let Some(word) = &raw.time {
            let number = word.text.parse::<u64>().ok();
            if let Some(expected) = expected.filter(|it| Some(*it) != number) {
                report
                    .error(span(&word.range), format!("expected step {expected} here"))
                    .advise("give all steps of the plan, in their order");
            }
            expected = number.and_then(|number| number.checked_add(1));
        }
        let duration = match raw.duration.as_ref().map(|word| number(report, word)) {
            Some(Some(duration)) => Duration::Given(duration),
            Some(None) => continue,
            None => Duration::Missing,
        };
        timed.push(TimedStep {
            raw,
            start: Start::Next,
            duration,
            end: None,
        });
    }
    timed
}

/// Pairs starts with their ends. Equal actions that overlap need counters.
fn paired<'s>(report: &mut Report, happenings: Vec<RawStep<'s>>) -> Vec<TimedStep<'s>> {
    type Ends<'s> = Vec<(Rational, RawStep<'s>)>;
    let mut actions: BTreeMap<Vec<String>, (Ends<'s>, Ends<'s>)> = BTreeMap::new();
    for step in happenings {
        let Some(time) = step.time.as_ref().and_then(|time| number(report, time)) else {
            continue;
        };
        let words = step.words.iter().chain(&step.counter);
        let name = words.map(|word| word.text.to_ascii_lowercase()).collect();
        let (starts, ends) = actions.entry(name).or_default();
        match step.form {
            Form::Start => starts.push((time, step)),
            _ => ends.push((time, step)),
        }
    }
    let mut timed = Vec::new();
    for (mut starts, mut ends) in actions.into_values() {
        starts.sort_by(|one, two| one.0.cmp(&two.0));
        ends.sort_by(|one, two| one.0.cmp(&two.0));
        let mut ends = ends.into_iter();
        let mut starts = starts.into_iter().peekable();
        while let Some((start, raw)) = starts.next() {
            let Some((end, last)) = ends.next().filter(|(end, _)| *end >= start) else {
                report
                    .error(span(&raw.range()), "this action starts, but does not end")
                    .advise("expected a line `time: end (action argument …)` after the start");
                return timed;
            };
            if let Some((_, next)) = starts.peek().filter(|(next, _)| *next < end) {
                report
                    .error(
                        span(&next.range()),
                        "this action starts again before it has ended",
                    )
                    .advise("add a counter to the starts and ends of each: `start (action) #1`");
                return timed;
            }
            timed.push(TimedStep {
                raw,
                duration: Duration::Given(&end - &start),
                start: Start::At(start),
                end: last.time,
            });
        }
        for (_, end) in ends {
            report
                .error(span(&end.range()), "this action ends, but does not start")
                .advise("expected a line `time: start (action argument …)` before the end");
        }
    }
    timed
}

/// Reads a time or duration, which must not be negative.
fn number(report: &mut Report, word: &Word<'_>) -> Option<Rational> {
    match word.text.parse::<Rational>() {
        Ok(time) if !time.is_negative() => Some(time),
        Ok(_) => {
            report
                .error(span(&word.range), "a negative time")
                .advise("times and durations are at least 0");
            None
        }
        Err(error) => {
            report.error(span(&word.range), error.to_string());
            None
        }
    }
}
