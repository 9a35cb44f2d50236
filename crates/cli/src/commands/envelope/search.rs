//! The search for an envelope.

use elbowroom::envelope::{
    Growth, Limit, Oracle, Settings, StopReason, Widening, irr, limits, sharpen,
};
use elbowroom::num::Rational;
use elbowroom::plan::{BoxEnd, DecoupledEnvelope, ParameterId, Side};

use super::watch::{Stop, Watch};
use super::{Subject, document, fails, refused, text};
use crate::args;
use crate::clock::Clock;
use crate::exit::{Answer, Exit, Failure};
use crate::look::Look;
use crate::output;
use crate::progress::Progress;

/// By what part of the precision a sharpened end is moved to see what it touches.
const SHARP: i64 = 1_000_000_000;
/// How often the step is doubled to see what stops an end.
const FARTHER: usize = 3;

/// An envelope, and how it was found.
pub(super) struct Outcome {
    pub(super) envelope: DecoupledEnvelope,
    /// What keeps the lower and the upper end of each parameter's interval where they are.
    pub(super) limits: Vec<[Option<String>; 2]>,
    pub(super) widenings: Vec<Step>,
    pub(super) checks: usize,
    pub(super) seconds: f64,
    pub(super) stop: Stop,
}

/// One widening.
pub(super) struct Step {
    pub(super) end: BoxEnd,
    /// `None` for infinity.
    pub(super) value: Option<Rational>,
    pub(super) checks: usize,
    pub(super) seconds: f64,
}

/// Searches, and prints what was found.
pub(super) fn run(subject: &Subject<'_>, mut oracle: Oracle, watch: &Watch) -> Answer {
    if watch.flow().is_break() {
        return nothing_yet(subject, watch.stop());
    }
    let clock = Clock::start();
    let seconds = || clock.elapsed().as_secs_f64();
    let mut progress = Progress::new();
    let mut widenings = Vec::new();
    let mut on_step = |widening: Option<&Widening<'_>>| {
        if let Some(widening) = widening {
            widenings.push(Step {
                end: widening.end,
                value: value_of(widening.envelope, widening.end),
                checks: widening.checks,
                seconds: seconds(),
            });
        }
        progress.show(clock.elapsed(), || format!("{} widenings", widenings.len()));
        watch.flow()
    };
    let settings = Settings {
        precision: subject.arguments.precision.clone(),
        growth: match subject.arguments.growth {
            args::Growth::Doubling => Growth::Doubling,
            args::Growth::Constant => Growth::Constant,
        },
        most_checks: None,
    };
    let search = irr(&mut oracle, &settings, &mut on_step).map_err(|r| refused(&r))?;
    let mut stop = match search.stop {
        StopReason::Converged => Stop::Converged,
        StopReason::CheckLimit => Stop::CheckLimit,
        StopReason::Cancelled => watch.stop(),
        StopReason::Undecided => Stop::Undecided,
    };
    let mut envelope = match search.envelope {
        Ok(envelope) => envelope,
        Err(objection) => return fails::at_nominal(subject, &oracle, &objection),
    };
    if subject.arguments.sharpen && stop == Stop::Converged {
        let sharp = sharpen(&mut oracle, &envelope, &mut || watch.flow());
        envelope = sharp.map_err(|r| refused(&r))?.unwrap_or(envelope);
        if watch.flow().is_break() {
            stop = watch.stop();
        }
    }
    let seconds = seconds();
    let checks = oracle.checks();
    drop(progress);
    let outcome = Outcome {
        limits: what_limits(subject, &mut oracle, &envelope, watch),
        envelope,
        widenings,
        checks,
        seconds,
        stop,
    };
    if subject.arguments.json {
        output::print_json(&document::envelope(subject, &outcome))?;
    } else {
        output::print(&text::envelope(subject, &outcome, Look::of_stdout()))?;
    }
    Ok(Exit::Yes)
}

/// The search was stopped before its start point was checked.
fn nothing_yet(subject: &Subject<'_>, stop: Stop) -> Answer {
    if subject.arguments.json {
        output::print_json(&document::none(subject, stop))?;
    } else {
        output::print("nothing is known yet: the search was stopped before it began\n")?;
    }
    Ok(Exit::Limit)
}

/// What keeps the lower and the upper end of each interval from moving, in words; nothing if there
/// is no time left to ask.
fn what_limits(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    watch: &Watch,
) -> Vec<[Option<String>; 2]> {
    if watch.flow().is_break() {
        return vec![[None, None]; subject.plan.parameters.len()];
    }
    let precision = &subject.arguments.precision;
    // A sharpened end has no room at all, so the smallest step tells what it touches.
    let mut distance = if subject.arguments.sharpen {
        precision * &Rational::new(1, SHARP)
    } else {
        precision.clone()
    };
    let mut words = in_words(subject, &limits(oracle, envelope, &distance));
    for _ in 0..FARTHER {
        // An end that has room for this step may still be stopped by the next larger one.
        if watch.flow().is_break() || words.iter().flatten().all(Option::is_some) {
            break;
        }
        distance = &distance + &distance;
        let farther = in_words(subject, &limits(oracle, envelope, &distance));
        for (known, found) in words
            .iter_mut()
            .flatten()
            .zip(farther.into_iter().flatten())
        {
            if known.is_none() {
                *known = found;
            }
        }
    }
    words
}

fn in_words(subject: &Subject<'_>, limits: &[[Option<Limit>; 2]]) -> Vec<[Option<String>; 2]> {
    limits
        .iter()
        .enumerate()
        .map(|(index, [lower, upper])| {
            let id = ParameterId::from(index);
            let words = |side, limit: &Option<Limit>| {
                limit
                    .as_ref()
                    .and_then(|limit| subject.explainer.limit(id, side, limit))
            };
            [words(Side::Lower, lower), words(Side::Upper, upper)]
        })
        .collect()
}

fn value_of(envelope: &DecoupledEnvelope, end: BoxEnd) -> Option<Rational> {
    let interval = envelope.interval(end.parameter);
    end.side.of(interval).value().cloned()
}
