//! The subject of a reason: [`Subject`], and its text.

use std::fmt;

use elbowroom_num::Rational;

/// The quantity, condition, moment or state of affairs that a [`Reason`](super::Reason) is about.
///
/// Only its [`Display`](fmt::Display) turns it into text. Cases that differ have different data.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Subject {
    /// The duration of the action.
    Duration,
    /// The remaining duration of an action that was running when the plan began.
    RemainingDuration,
    /// The change of this fluent by the action.
    Change(String),
    /// A parameter of the plan, by its name.
    Parameter(String),
    /// The start of this action.
    Start(String),
    /// The end of this action.
    End(String),
    /// A time point of the plan, as the plan describes it.
    TimePoint(String),
    /// The same, of a start that has failed `failures` times in a row and is tried again.
    Retry {
        /// The time point, if it is still to come.
        of: Option<String>,
        /// Number of failures.
        failures: u32,
    },
    /// These conditions, in the language of the problem.
    Conditions(Vec<String>),
    /// These conditions, which must hold throughout an action.
    OverAllConditions(Vec<String>),
    /// This observed fact or fluent.
    ObservedValue(String),
    /// An observation from the [look](crate::World::look) at the goal.
    GoalObservation,
    /// The next observation, of any kind.
    AnyObservation,
    /// The last timed initial that affects the goal.
    LastGoalTimedInitial,
    /// The end of the running actions.
    EndOfRunningActions,
    /// The start of the commanded actions.
    StartOfCommandedActions,
    /// The end of the cancelled actions.
    EndOfCancelledActions,
    /// The next start of the present order.
    NextStart,
    /// The next happening of that order, which the executor does not start.
    NextHappening,
    /// The choice is the best of all possible ones, with the success probability from here.
    BestChoice(f64),
    /// The next evaluation of moves, with the success probability from here.
    NextEvaluation(f64),
    /// The choice is first in the order most likely to succeed, with that probability.
    FirstInBestOrder(f64),
    /// The choice is next after the lattermost layer that fits.
    NextInOrder,
    /// Another plan succeeds with the probability `other`, the remaining plan with `present`.
    SuccessProbabilities {
        /// Of the remaining plan.
        present: Rational,
        /// Of another plan.
        other: Rational,
    },
    /// An order that does not wait for the end of this action.
    WithoutEndOf(String),
    /// It was cancelled.
    Cancelled,
    /// It has failed several times in a row, and its likelihoods do not explain that.
    RepeatedFailure {
        /// The world's explanation of the last failure; `None`: it was cancelled.
        why: Option<String>,
        /// The number of failures.
        failures: i32,
        /// The probability of a successful start.
        success: f64,
    },
    /// There is no plan.
    NoPlan,
    /// The plan has no envelope.
    NoEnvelope,
    /// The plan was prepared without its partial order.
    NoPartialOrder,
    /// No times satisfy the plan's constraints.
    NoSchedule,
    /// A constraint of the plan that cannot be satisfied.
    UnsatisfiableConstraint,
    /// The plan waits, nothing is running, and nothing is due.
    Nothing,
    /// Too little time is left even if nothing deviates any more.
    InsufficientTime,
    /// Numeric conditions of the remaining plan fail if the action takes longer.
    NumericConditionsWhenLonger,
    /// An external message: from the world about a failure, or from an oracle about its objection.
    ExternalMessage(String),
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match self {
            Self::Duration => "duration",
            Self::RemainingDuration => "remaining duration",
            Self::Change(fluent) => return write!(f, "change of {fluent}"),
            Self::Start(action) => return write!(f, "the start of {action}"),
            Self::End(action) => return write!(f, "the end of {action}"),
            Self::Parameter(words)
            | Self::TimePoint(words)
            | Self::ObservedValue(words)
            | Self::ExternalMessage(words) => words,
            Self::Retry { of, failures } => return format_retry(f, of.as_deref(), *failures),
            Self::Conditions(conditions) => return f.write_str(&conditions.join(" and ")),
            Self::OverAllConditions(conditions) => {
                return write!(f, "{} throughout", conditions.join(" and "));
            }
            Self::GoalObservation => "the observation of the final state",
            Self::AnyObservation => "something is observed",
            Self::LastGoalTimedInitial => "the last timed initial that the goal depends on",
            Self::EndOfRunningActions => "the running actions have ended",
            Self::StartOfCommandedActions => "the requested actions have started",
            Self::EndOfCancelledActions => "the cancelled actions have stopped",
            Self::NextStart => "the order's next start",
            Self::NextHappening => "the next step of the order has happened",
            Self::BestChoice(probability) => {
                return write!(f, "best of all moves (P = {probability:.4} from here)");
            }
            Self::NextEvaluation(probability) => {
                return write!(f, "the next decision time (P = {probability:.4} from here)");
            }
            Self::FirstInBestOrder(probability) => {
                return write!(
                    f,
                    "first of the order most likely to succeed (P = {probability:.4} from here)"
                );
            }
            Self::NextInOrder => "next after the lattermost layer that fits",
            Self::SuccessProbabilities { present, other } => {
                let percent = |share: &Rational| (share * Rational::from(100)).to_decimal(1);
                return write!(
                    f,
                    "another plan succeeds with a probability of {} %, the rest of this one with \
                     {} %",
                    percent(other),
                    percent(present)
                );
            }
            Self::WithoutEndOf(action) => {
                return write!(f, "one that does not wait for the end of {action}");
            }
            Self::Cancelled => "it was cancelled",
            Self::RepeatedFailure {
                why,
                failures,
                success,
            } => {
                let why = why.as_deref().unwrap_or("it was cancelled");
                return write!(
                    f,
                    "{why}; {failures} failures in a row, although it succeeds with \
                     probability {success}"
                );
            }
            Self::NoPlan => "there is no plan",
            Self::NoEnvelope => "the plan has no envelope",
            Self::NoPartialOrder => "the plan was prepared without its partial order",
            Self::NoSchedule => "no times satisfy the plan's constraints",
            Self::UnsatisfiableConstraint => "a constraint cannot be satisfied",
            Self::Nothing => "the plan waits for nothing",
            Self::InsufficientTime => "even without further deviations, too little time is left",
            Self::NumericConditionsWhenLonger => {
                "if it takes longer, numeric conditions of the remaining plan fail"
            }
        };
        f.write_str(words)
    }
}

fn format_retry(f: &mut fmt::Formatter<'_>, of: Option<&str>, failures: u32) -> fmt::Result {
    if let Some(of) = of {
        write!(f, "{of} is retried: ")?;
    }
    match failures {
        1 => f.write_str("its start has failed once"),
        many => write!(f, "its start has failed {many} times in a row"),
    }
}
