//! Messages of the validator.

use std::fmt;

use elbowroom_num::Rational;

use super::violation::{
    ActionInstance, ConditionTime, Occurrence, Point, Reason, Undecided, UndecidedReason,
    Violation, ViolationKind,
};
use crate::describe::decimal;
use crate::problem::Comparison;

/// Formats a time as planners do, with at least three decimals if that is exact.
pub(super) fn clock(time: &Rational) -> String {
    let exact = decimal(time);
    if exact.contains('/') {
        return format!("about {}", time.to_decimal(6));
    }
    match exact.split_once('.') {
        None => format!("{exact}.000"),
        Some((whole, part)) => format!("{whole}.{part:0<3}"),
    }
}

impl fmt::Display for ActionInstance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl fmt::Display for Occurrence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.action, self.point) {
            (Some(action), Point::Start) => write!(f, "the start of {action}")?,
            (Some(action), Point::End) => write!(f, "the end of {action}")?,
            (Some(action), _) => write!(f, "{action}")?,
            (None, _) => match &self.event {
                Some(event) => write!(f, "the event {event}")?,
                None => write!(f, "a timed initial")?,
            },
        }
        write!(f, " at {}", clock(&self.time))
    }
}

impl fmt::Display for ConditionTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Now => "precondition",
            Self::Start => "at start",
            Self::OverAll => "over all",
            Self::End => "at end",
            Self::Goal => "goal",
            Self::Trajectory => "constraint",
        })
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let ViolationKind::Condition {
            is_after, is_exact, ..
        }
        | ViolationKind::Constraint {
            is_after, is_exact, ..
        } = &self.kind
        {
            let after = if *is_after { "just after" } else { "at" };
            if *is_exact {
                write!(f, "{after} {}: ", clock(&self.time))?;
            } else {
                write!(f, "{after} about {}: ", self.time.to_decimal(6))?;
            }
        } else {
            write!(f, "at {}: ", clock(&self.time))?;
        }
        if let Some(action) = &self.action {
            write!(f, "{action} ")?;
        }
        write!(f, "{}", self.kind)
    }
}

impl fmt::Display for ViolationKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooEarly(earliest) => write!(f, "starts before time {}", decimal(earliest)),
            Self::Abandoned(action) => write!(
                f,
                "the plan must begin by continuing {action}, which is running"
            ),
            Self::Elapsed {
                duration,
                possible,
                now,
            } => write!(
                f,
                "has the duration {}, but is running at time {} and can only have a duration in {possible}",
                decimal(duration),
                decimal(now)
            ),
            Self::NoDuration => write!(f, "has no duration"),
            Self::NegativeDuration(duration) => {
                write!(f, "has the duration {}, below 0", decimal(duration))
            }
            Self::Duration {
                duration,
                comparison,
                bound,
                value,
                ..
            } => {
                let (duration, number) = (decimal(duration), decimal(value));
                write!(
                    f,
                    "takes {duration}, but its duration must be {} ",
                    comparison.symbol()
                )?;
                if *bound == number {
                    write!(f, "{number}")
                } else {
                    write!(f, "{bound} = {number}")
                }
            }
            Self::Condition {
                when,
                condition,
                reasons,
                too_late,
                ..
            } => {
                match when {
                    ConditionTime::Goal => write!(f, "the goal {condition} does not hold")?,
                    ConditionTime::Trajectory => write!(f, "{condition} does not hold")?,
                    ConditionTime::Now => write!(f, "needs {condition}")?,
                    _ => write!(f, "needs {condition} {when}")?,
                }
                write_reasons(f, reasons)?;
                write_late_changes(f, too_late)
            }
            Self::Constraint {
                constraint,
                why,
                reasons,
                ..
            } => {
                write!(f, "the constraint {constraint} is violated: {why}")?;
                write_reasons(f, reasons)
            }
            Self::Interference {
                first,
                second,
                over,
                separation,
            } => {
                write!(
                    f,
                    "interferes: {first} and {second} both concern {over} and must "
                )?;
                match separation {
                    Some(least) => write!(f, "be at least {} apart", decimal(least)),
                    None => write!(f, "not happen at the same time"),
                }
            }
            Self::EndlessEvent { event, is_alone } => {
                write!(f, "the event {event} happens infinitely often: ")?;
                f.write_str(if *is_alone {
                    "its effects do not make its precondition false"
                } else {
                    "other events make its precondition true again at the same time"
                })
            }
            Self::Conflict { fluent } => {
                write!(f, "gives {fluent} several values at the same time")
            }
            Self::Undefined { fluent, within } => {
                write!(f, "reads {fluent}, which has no value, in {within}")
            }
            Self::DivisionByZero { divisor, within } => {
                write!(f, "divides by {divisor}, which is 0, in {within}")
            }
        }
    }
}

/// Writes the reasons why a condition or a constraint does not hold.
fn write_reasons(f: &mut fmt::Formatter<'_>, reasons: &[Reason]) -> fmt::Result {
    for (position, reason) in reasons.iter().enumerate() {
        write!(f, "{} {reason}", if position == 0 { ":" } else { ";" })?;
    }
    Ok(())
}

/// Writes the happenings that make a condition true after it is read.
fn write_late_changes(f: &mut fmt::Formatter<'_>, changes: &[Occurrence]) -> fmt::Result {
    for (position, change) in changes.iter().enumerate() {
        write!(f, "{} {change}", if position == 0 { ";" } else { " and" })?;
    }
    match changes.len() {
        0 => Ok(()),
        1 => write!(f, " changes this only after the condition is read"),
        _ => write!(f, " change this only after the condition is read"),
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fact {
                fact,
                is_true,
                since,
            } => {
                write!(f, "{fact} is {is_true}")?;
                match since {
                    Some(occurrence) => write!(f, " since {occurrence}"),
                    None => Ok(()),
                }
            }
            Self::Comparison {
                comparison,
                operator,
                values,
                left,
                right,
                is_true,
            } => {
                if values.is_empty() {
                    write!(f, "{comparison} is {is_true}")?;
                }
                for (position, (name, value)) in values.iter().enumerate() {
                    let separator = if position == 0 { "" } else { ", " };
                    write!(f, "{separator}{name} = {}", decimal(value))?;
                }
                let gap = (left - right).abs();
                match (is_true, gap.is_zero()) {
                    (false, false) if *operator == Comparison::Equal => {
                        write!(f, ", off by {}", decimal(&gap))
                    }
                    (false, false) => write!(f, ", short by {}", decimal(&gap)),
                    (false, true) => write!(f, ", not strictly so"),
                    (true, _) => write!(f, ", so that {comparison} is true"),
                }
            }
        }
    }
}

impl fmt::Display for Undecided {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(time) = &self.time {
            write!(f, "at {}: ", clock(time))?;
        }
        write!(f, "{}", self.reason)
    }
}

impl fmt::Display for UndecidedReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open { unknown, within } => {
                write!(
                    f,
                    "{within} reads the open number {unknown}: give it a value"
                )
            }
            Self::Nonlinear { fluent } => write!(
                f,
                "nonlinear change: the rate of {fluent} depends on {fluent} itself, so its value \
                 is not a polynomial in time"
            ),
            Self::Quotient { divisor, within } => {
                write!(
                    f,
                    "nonlinear change: {within} divides by {divisor}, which changes with time"
                )
            }
            Self::Misplaced { expression, within } => {
                write!(f, "{expression} is undefined in {within}")
            }
            Self::ContinuousGuard { fluent } => write!(
                f,
                "a continuous effect on {fluent} depends on an over-all condition, whose truth is \
                 not known before the end"
            ),
            Self::PastStates => write!(f, "a trajectory constraint depends on the states before"),
            Self::CloseTimes { constraint } => write!(
                f,
                "{constraint} depends on two times less than a millionth apart"
            ),
            Self::Irrational { fluent, within } => write!(
                f,
                "{within} reads {fluent}, whose value is irrational: its rate of change changed \
                 at an irrational time"
            ),
            Self::Chattering { process } => write!(
                f,
                "the process {process} would start and stop infinitely often: it makes its \
                 condition false while active, and the condition is true while it is inactive"
            ),
            Self::ManyChanges { most } => write!(
                f,
                "events happen, or processes start and stop, more than {most} times before the \
                 next happening of the plan"
            ),
            Self::Unstratified => write!(f, "a derived fact depends on its own negation"),
        }
    }
}
