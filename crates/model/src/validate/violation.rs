//! Reasons why a plan is invalid, or cannot be decided.

use elbowroom_num::{Interval, Rational};

use crate::plan::TimeTriggeredPlan;
use crate::problem::Comparison;

/// First violation of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// The time.
    pub time: Rational,
    /// The responsible action; `None` for the goal.
    pub action: Option<ActionInstance>,
    /// Kind of violation.
    pub kind: ViolationKind,
}

/// One action of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionInstance {
    /// Its position in the plan's list of steps.
    pub step: usize,
    /// `(name arg …)`
    pub name: String,
    /// Its start time.
    pub start: Rational,
}

impl ActionInstance {
    pub(super) fn of(plan: &TimeTriggeredPlan, position: usize) -> Self {
        let step = &plan.steps[position];
        Self {
            step: position,
            name: step.action.name.clone(),
            start: step.start.clone(),
        }
    }
}

/// A kind of violation.
#[derive(Clone, Debug, PartialEq)]
pub enum ViolationKind {
    /// An action starts at this time, before the plan begins.
    TooEarly(Rational),
    /// The plan does not continue this action, which is running when the plan begins.
    Abandoned(String),
    /// An action that is running when the plan begins can no longer have this duration.
    Elapsed {
        /// The duration in the plan.
        duration: Rational,
        /// Possible durations, as far as they do not end before `now`.
        possible: Interval,
        /// The time at which the plan begins.
        now: Rational,
    },
    /// A durative action has no duration.
    NoDuration,
    /// A duration is below 0.
    NegativeDuration(Rational),
    /// A duration violates a bound of the domain.
    Duration {
        /// The duration in the plan.
        duration: Rational,
        /// Comparison of duration and bound that does not hold.
        comparison: Comparison,
        /// The bound in PDDL notation.
        bound: String,
        /// The bound's value.
        value: Rational,
    },
    /// A condition does not hold.
    Condition {
        /// Kind of condition.
        when: ConditionTime,
        /// The condition in PDDL notation.
        condition: String,
        /// `true` if it still holds at the given time, and fails right after it.
        is_after: bool,
        /// `true` if the given time is exact. Otherwise the true time is irrational, and the given
        /// one is within a millionth below it.
        is_exact: bool,
        /// Reasons why it is false.
        reasons: Vec<Reason>,
        /// Happenings at the same time that may make it true, but too late: conditions read the
        /// state before them.
        too_late: Vec<Occurrence>,
    },
    /// A trajectory constraint is violated.
    Constraint {
        /// The constraint in PDDL notation.
        constraint: String,
        /// Reason, in words.
        why: String,
        /// `true` if it is still satisfied at the given time, and violated right after it.
        is_after: bool,
        /// `true` if the given time is exact. Otherwise the true time is irrational, and the given
        /// one is within a millionth below it.
        is_exact: bool,
        /// Reasons why a required condition is false.
        reasons: Vec<Reason>,
    },
    /// Two happenings that interfere are too close to each other.
    Interference {
        /// The earlier one.
        first: Occurrence,
        /// The later one.
        second: Occurrence,
        /// The fact or fluent over which they interfere.
        over: String,
        /// Required separation; `None`: they must not be simultaneous.
        separation: Option<Rational>,
    },
    /// An event happens again at the same moment: its effects, or those of other events, leave its
    /// precondition true, or make it true again. This would not terminate.
    EndlessEvent {
        /// `(name arg …)`.
        event: String,
        /// `true` if no other event happened in between.
        is_alone: bool,
    },
    /// One happening gives a fluent several values at once.
    Conflict {
        /// The fluent.
        fluent: String,
    },
    /// A fluent without a value is read.
    Undefined {
        /// The fluent.
        fluent: String,
        /// The condition, effect or bound that reads it.
        within: String,
    },
    /// A number is divided by zero.
    DivisionByZero {
        /// The divisor.
        divisor: String,
        /// The condition, effect or bound that divides.
        within: String,
    },
}

/// Condition of an action, by its time specifier, or the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ConditionTime {
    /// Condition of an instantaneous action.
    Now,
    /// At start.
    Start,
    /// Over all.
    OverAll,
    /// At end.
    End,
    /// The goal.
    Goal,
    /// Trajectory constraint.
    Trajectory,
}

/// Reason why a condition is false: one of its parts.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// A fact has the wrong truth value.
    Fact {
        /// The fact.
        fact: String,
        /// Its truth value.
        is_true: bool,
        /// The last change of its truth value; `None` if it has not changed since the beginning, or
        /// is derived.
        since: Option<Occurrence>,
    },
    /// A comparison has the wrong truth value.
    Comparison {
        /// The comparison.
        comparison: String,
        /// Its operator.
        operator: Comparison,
        /// The values of the fluents (and of `?duration`) in it.
        values: Vec<(String, Rational)>,
        /// The value of its left side.
        left: Rational,
        /// The value of its right side.
        right: Rational,
        /// Its truth value.
        is_true: bool,
    },
}

/// A happening.
#[derive(Clone, Debug, PartialEq)]
pub struct Occurrence {
    /// The time.
    pub time: Rational,
    /// The point of the action at which it happens.
    pub point: Point,
    /// The action; `None` for timed initials and events.
    pub action: Option<ActionInstance>,
    /// `(name arg …)` of an event.
    pub event: Option<String>,
}

/// Part of an action at which a happening occurs: its start, its end, or all of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Point {
    /// The start of a durative action.
    Start,
    /// The end of a durative action.
    End,
    /// An action that takes no time.
    Instant,
    /// No action: timed initial literals and fluents.
    Timed,
    /// No action: an event of PDDL+.
    Event,
}

/// Reason why the validity of a plan cannot be decided.
#[derive(Clone, Debug, PartialEq)]
pub struct Undecided {
    /// Time at which the difficulty arises; `None` if it is before any happening.
    pub time: Option<Rational>,
    /// The difficulty.
    pub reason: UndecidedReason,
}

/// Reason why the validator cannot evaluate a condition.
#[derive(Clone, Debug, PartialEq)]
pub enum UndecidedReason {
    /// An open number is read.
    Open {
        /// Its name.
        unknown: String,
        /// Expression that reads it.
        within: String,
    },
    /// A fluent's rate of change depends on the fluent itself, so that its value is not a
    /// polynomial in time.
    Nonlinear {
        /// The fluent.
        fluent: String,
    },
    /// A number is divided by one that changes continuously.
    Quotient {
        /// The divisor.
        divisor: String,
        /// The expression that it occurs in.
        within: String,
    },
    /// `?duration` or `total-time` occurs where it has no meaning.
    Misplaced {
        /// The misplaced expression.
        expression: String,
        /// The expression that it occurs in.
        within: String,
    },
    /// A continuous effect depends on an over-all condition, whose truth value lies in the future.
    ContinuousGuard {
        /// The fluent that the effect changes.
        fluent: String,
    },
    /// A constraint on the whole course depends on states before the plan begins.
    PastStates,
    /// A constraint depends on the order of two times that are less than a millionth apart, one of
    /// them irrational.
    CloseTimes {
        /// The constraint.
        constraint: String,
    },
    /// A derived fact depends on its own negation.
    Unstratified,
    /// A fluent is read that stopped moving, or changed its rate, at an irrational moment, with an
    /// irrational value.
    Irrational {
        /// The fluent.
        fluent: String,
        /// Expression that reads it.
        within: String,
    },
    /// A process would start and stop without end at one moment: its condition is false while it is
    /// active, and true otherwise.
    Chattering {
        /// `(name arg …)`.
        process: String,
    },
    /// The number of events, starts and stops of processes between two happenings exceeds the
    /// limit.
    ManyChanges {
        /// The limit.
        most: usize,
    },
}
