//! The search for an envelope.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::envelope::{
    Growth, Limit, Oracle, Settings, StopReason, Widening, irr, limits, sharpen,
};
use elbowroom::num::Rational;
use elbowroom::plan::reduction::{BoxEnd, Side};
use elbowroom::plan::{DecoupledEnvelope, ParameterId};

use super::{Subject, document, fails, refused, text};
use crate::args;
use crate::clock::Clock;
use crate::exit::{Answer, Exit, Failure};
use crate::interrupt::Interrupt;
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

/// Why the search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    Converged,
    CheckLimit,
    TimeLimit,
    Cancelled,
}

impl Stop {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::CheckLimit => "check limit",
            Self::TimeLimit => "time limit",
            Self::Cancelled => "cancelled",
        }
    }
}

/// Searches, and prints what was found.
pub(super) fn run(subject: &Subject<'_>, mut oracle: Oracle<'_>) -> Answer {
    let watch = Watch::start(subject.arguments.time_limit.as_ref());
    let mut progress = Progress::new();
    let mut widenings = Vec::new();
    let mut on_step = |widening: Option<&Widening<'_>>| {
        if let Some(widening) = widening {
            widenings.push(Step {
                end: widening.end,
                value: value_of(widening.envelope, widening.end),
                checks: widening.checks,
                seconds: watch.seconds(),
            });
        }
        progress.show(watch.clock.elapsed(), || {
            format!("{} widenings", widenings.len())
        });
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
    let stop = match search.stop {
        StopReason::Converged => Stop::Converged,
        StopReason::CheckLimit => Stop::CheckLimit,
        StopReason::Cancelled => watch.stop(),
    };
    let mut envelope = match search.envelope {
        Ok(envelope) => envelope,
        Err(objection) => return fails::at_nominal(subject, &oracle, &objection),
    };
    if subject.arguments.sharpen && stop == Stop::Converged {
        envelope =
            sharpen(&mut oracle, &envelope, &mut || watch.flow()).map_err(|r| refused(&r))?;
    }
    let seconds = watch.seconds();
    let checks = oracle.checks();
    drop(progress);
    let outcome = Outcome {
        limits: what_limits(subject, &mut oracle, &envelope, stop)?,
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

/// What keeps the lower and the upper end of each interval from moving, in words.
fn what_limits(
    subject: &Subject<'_>,
    oracle: &mut Oracle<'_>,
    envelope: &DecoupledEnvelope,
    stop: Stop,
) -> Result<Vec<[Option<String>; 2]>, Failure> {
    let precision = &subject.arguments.precision;
    // A sharpened end has no room at all, so the smallest step tells what it touches.
    let mut step = if subject.arguments.sharpen && stop == Stop::Converged {
        precision * &Rational::new(1, SHARP)
    } else {
        precision.clone()
    };
    let mut words = in_words(
        subject,
        &limits(oracle, envelope, &step).map_err(|r| refused(&r))?,
    );
    for _ in 0..FARTHER {
        // An end that has room for this step may still be stopped by the next larger one.
        if words.iter().flatten().all(Option::is_some) {
            break;
        }
        step = &step + &step;
        let farther = in_words(
            subject,
            &limits(oracle, envelope, &step).map_err(|r| refused(&r))?,
        );
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
    Ok(words)
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
    match end.side {
        Side::Lower => interval.lower.value().cloned(),
        Side::Upper => interval.upper.value().cloned(),
    }
}

/// When to stop: never, at a time limit, or at Ctrl-C.
struct Watch {
    clock: Clock,
    limit: Option<Duration>,
    interrupt: Interrupt,
}

impl Watch {
    fn start(limit: Option<&Rational>) -> Self {
        Self {
            clock: Clock::start(),
            limit: limit.map(|seconds| {
                Duration::try_from_secs_f64(seconds.to_f64()).unwrap_or(Duration::MAX)
            }),
            interrupt: Interrupt::listen(),
        }
    }

    fn seconds(&self) -> f64 {
        self.clock.elapsed().as_secs_f64()
    }

    fn is_late(&self) -> bool {
        self.limit
            .is_some_and(|limit| self.clock.elapsed() >= limit)
    }

    fn flow(&self) -> ControlFlow<()> {
        if self.interrupt.is_requested() || self.is_late() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn stop(&self) -> Stop {
        if self.interrupt.is_requested() {
            Stop::Cancelled
        } else {
            Stop::TimeLimit
        }
    }
}
