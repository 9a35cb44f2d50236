//! Reasons for the decisions of executors.

mod evidence;
mod subject;

use std::fmt;

use elbowroom_num::{Interval, Rational, terms};

pub use evidence::{Evidence, TimedChange};
pub use subject::Subject;

/// The reason for a decision of an executor: the observation, the allowed values, the constraints
/// and events that caused it, the amount of the violation, and the time since when it holds. Times
/// are on the world's clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Reason {
    /// The kind of reason.
    pub cause: Cause,
    /// The action it is about.
    pub action: Option<String>,
    /// The quantity, condition, moment or state of affairs that it is about.
    pub about: Option<Subject>,
    /// The observed value: a duration, an amount, or the time of a happening.
    pub observed: Option<Rational>,
    /// The interval that is allowed.
    pub allowed: Option<Interval>,
    /// The constraints or events that caused it, the origin of the chain first.
    pub evidence: Vec<Evidence>,
    /// The amount of the violation.
    pub by: Option<Rational>,
    /// The time since when it holds.
    pub since: Option<Rational>,
    /// The promise for the remaining plan, if the executor makes promises.
    pub guarantee: Option<GuaranteeLevel>,
}

terms! {
    /// Guarantee for the remaining plan, the strongest first. The meaning is the condition under which the plan works.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum GuaranteeLevel {
        Envelope = "envelope": "each quantity stays inside its interval",
        PartOfEnvelope = "part-of-envelope": "each quantity stays inside a part of its interval",
        Planned = "planned": "each action still to start takes as long as planned",
        Luck = "luck": "no condition is known",
    }
}

impl GuaranteeLevel {
    /// Returns the name for users: the guarantee, or `none` with the weaker promise.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Envelope | Self::PartOfEnvelope => self.name(),
            Self::Planned => "none, feasible at nominal durations",
            Self::Luck => "none, may still work",
        }
    }

    /// Returns the condition under which the plan works, if it is known.
    pub fn condition(self) -> Option<&'static str> {
        let found = Self::TERMS.iter().find(|(level, ..)| *level == self);
        found
            .filter(|_| self != Self::Luck)
            .map(|(.., condition)| *condition)
    }
}

terms! {
    /// Kinds of [`Reason`].
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum Cause {
        Due = "due": "all predecessors have been executed, and the window is open",
        NothingDue = "nothing-due": "an event must happen first",
        OutsideInterval = "outside-interval": "an observed quantity is not in its interval",
        Outlived = "outlived": "a running action has not ended by the upper end of its interval",
        Unreachable = "unreachable": "too little time is left for a time point",
        Condition = "condition": "a required condition does not hold",
        Failed = "failed": "an action failed",
        Contradiction = "contradiction": "reports on the end of an action contradict each other",
        Surprise = "surprise":
            "an observation differs from the belief, and the plan does not work with it",
        Silence = "silence": "an action has reached its time-out",
        GuaranteeLost = "guarantee-lost": "the remaining plan is no longer guaranteed to work",
        NoOrder = "no-order": "no order of the plan's actions leads to the goal",
        Likelier = "likelier": "another plan is more likely to succeed",
        MoreSlack = "more-slack":
            "the guarantee has become weaker, and another plan may have a stronger one or more slack",
        Late = "late": "the plan was finished too late to be started",
        PlanDone = "plan-done": "the plan is done, but the goal is not reached",
        GoalReached = "goal-reached": "the goal is reached",
        NewPlan = "new-plan": "a plan has been made",
        Asked = "asked": "the goals were changed from outside",
        NeverAgain = "never-again": "part of the goal can never become true again",
        NotTogether = "not-together":
            "each part of the goal could still become true, but not all of them",
        TooLate = "too-late": "a goal would be reached after its deadline",
        NoPlan = "no-plan": "no plan reaches a goal, or none was found",
    }
}

impl Reason {
    /// Creates a reason that contains only its kind.
    pub fn new(cause: Cause) -> Self {
        Self {
            cause,
            action: None,
            about: None,
            observed: None,
            allowed: None,
            evidence: Vec::new(),
            by: None,
            since: None,
            guarantee: None,
        }
    }

    /// Sets the action.
    #[must_use]
    pub fn for_action(mut self, action: &str) -> Self {
        self.action = Some(action.to_owned());
        self
    }

    /// Sets the subject.
    #[must_use]
    pub fn about(mut self, about: Subject) -> Self {
        self.about = Some(about);
        self
    }

    /// Sets the time since when it holds.
    #[must_use]
    pub fn since(mut self, time: Rational) -> Self {
        self.since = Some(time);
        self
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text_without_numbers())?;
        if let Some(observed) = &self.observed {
            write!(f, "; observed {}", observed.to_decimal(3))?;
        }
        if let Some(allowed) = &self.allowed {
            write!(f, ", allowed {}", format_interval(allowed))?;
        }
        if let Some(by) = &self.by {
            let digits = by.to_decimal(3);
            let by = if digits == "0" && by.is_positive() {
                "less than 0.001"
            } else {
                &digits
            };
            write!(f, ", missed by {by}")?;
        }
        if let Some(since) = &self.since {
            write!(f, ", since {}", since.to_decimal(3))?;
        }
        // The subject of the reason is not repeated as its explanation.
        let about = self.about.as_ref().map(ToString::to_string);
        let behind = self.evidence.iter().map(ToString::to_string);
        let behind: Vec<String> = behind.filter(|it| about.as_ref() != Some(it)).collect();
        if !behind.is_empty() {
            write!(f, " (cause: {})", behind.join("; "))?;
        }
        Ok(())
    }
}

impl Reason {
    /// Returns the text without numbers.
    fn text_without_numbers(&self) -> String {
        let action = self.action.as_deref().unwrap_or("the plan");
        let known = self.about.as_ref().map(ToString::to_string);
        let about = known.as_deref().unwrap_or("something");
        match self.cause {
            Cause::Due => format!("{action} is due"),
            Cause::NothingDue => format!("nothing is due before {about}"),
            Cause::OutsideInterval => format!("the {about} of {action} is not in its interval"),
            Cause::Outlived => format!("{action} has not ended in time"),
            Cause::Unreachable => format!("too little time is left for {about}"),
            Cause::Condition => format!("{action} needs {about}, which does not hold"),
            Cause::Failed => match known.as_deref() {
                Some(why) if !why.is_empty() => format!("{action} failed: {why}"),
                _ => format!("{action} failed"),
            },
            Cause::Contradiction => format!("reports on {action} contradict each other"),
            Cause::Surprise => {
                format!("{about} was not expected, and contradicts what {action} needs")
            }
            Cause::Silence => format!("{action} timed out"),
            Cause::GuaranteeLost => {
                format!("the rest of the plan is no longer guaranteed: {about}")
            }
            Cause::NoOrder => match known.as_deref() {
                Some(why) => format!("no order of the plan's actions can be chosen: {why}"),
                None => "no order of the plan's actions leads to the goal from here".to_owned(),
            },
            Cause::Likelier => format!("another plan is more likely to succeed: {about}"),
            Cause::MoreSlack => {
                "the guarantee has become weaker, and another plan is better".to_owned()
            }
            Cause::Late => format!("the plan came too late: {about}"),
            Cause::PlanDone => format!("the plan is done, but the goal is not reached: {about}"),
            Cause::GoalReached => "the goal is reached".to_owned(),
            Cause::NewPlan => "there is a new plan".to_owned(),
            Cause::Asked => format!("the goals have changed: {about}"),
            Cause::NeverAgain => match self.since {
                Some(_) => format!("{about} can never become true again"),
                None => format!("{about} could never become true"),
            },
            Cause::NotTogether if known.is_some() => format!("{about} exclude each other"),
            Cause::TooLate | Cause::NoPlan => about.to_owned(),
            Cause::NotTogether => {
                "each part of the goal is reachable if deletions and deadlines are ignored, but no \
                 plan reaches all of them"
                    .to_owned()
            }
        }
    }
}

/// Formats an interval with three digits.
fn format_interval(interval: &Interval) -> String {
    let end = |value: Option<&Rational>, infinity: &str| match value {
        Some(value) => value.to_decimal(3),
        None => infinity.to_owned(),
    };
    format!(
        "[{}, {}]",
        end(interval.lower.value(), "-inf"),
        end(interval.upper.value(), "inf")
    )
}

#[cfg(test)]
mod tests {
    use elbowroom_num::{Interval, Rational};

    use super::{Cause, Reason, Subject};

    fn missed_by(about: Subject, by: Rational) -> String {
        let reason = Reason {
            observed: Some(Rational::ZERO),
            allowed: Some(Interval::closed(Rational::ZERO, Rational::ONE)),
            by: Some(by),
            ..Reason::new(Cause::OutsideInterval)
                .for_action("(mill b m1)")
                .about(about)
        };
        reason.to_string()
    }

    #[test]
    fn remaining_duration_is_named_in_sentence() {
        assert_eq!(
            missed_by(Subject::RemainingDuration, Rational::ONE),
            "the remaining duration of (mill b m1) is not in its interval; observed 0, allowed \
             [0, 1], missed by 1"
        );
    }

    #[test]
    fn small_delay_is_not_rounded_to_zero() {
        let said = missed_by(Subject::Duration, Rational::new(1, 10_000));
        assert!(said.ends_with("missed by less than 0.001"), "{said}");
    }
}
