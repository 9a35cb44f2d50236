//! Why a plan is not valid, or why that cannot be decided.

use elbowroom_num::{Interval, Rational};

use crate::plan::TimeTriggeredPlan;
use crate::problem::Comparison;

/// The first thing that is wrong with a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// The time.
    pub time: Rational,
    /// The action to blame; `None` for the goal.
    pub action: Option<ActionInstance>,
    /// The mistake.
    pub mistake: Mistake,
}

/// One action of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionInstance {
    /// Its position in the plan's list of steps.
    pub step: usize,
    /// `(name arg …)`
    pub name: String,
    /// When it starts, or happens.
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
pub enum Mistake {
    /// An action starts before the plan begins, at this time.
    TooEarly(Rational),
    /// The plan does not go on with this action, which is running when it begins.
    Abandoned(String),
    /// An action that is running when the plan begins can no longer have this duration.
    Elapsed {
        /// The duration in the plan.
        duration: Rational,
        /// Those it may have, as far as they do not end before `now`.
        possible: Interval,
        /// The time at which the plan begins.
        now: Rational,
    },
    /// A durative action has no duration.
    NoDuration,
    /// A duration is below 0.
    NegativeDuration(Rational),
    /// A duration does not satisfy the domain.
    Duration {
        /// The duration in the plan.
        duration: Rational,
        /// How it should compare to the bound.
        comparison: Comparison,
        /// The bound as PDDL writes it.
        bound: String,
        /// The bound's value.
        value: Rational,
    },
    /// A condition does not hold.
    Condition {
        /// Which kind.
        when: When,
        /// As PDDL writes it.
        condition: String,
        /// Whether it still holds at the time given, and fails right after it.
        is_after: bool,
        /// Whether the time given is exact; else it is within a millionth below the true one,
        /// which is irrational.
        is_exact: bool,
        /// The reasons why it is false.
        reasons: Vec<Reason>,
        /// Happenings of the same time that may make it true, but too late: conditions read the
        /// state before them.
        too_late: Vec<Occurrence>,
    },
    /// A constraint on the course of the plan is not kept.
    Constraint {
        /// As PDDL writes it.
        constraint: String,
        /// Why, in words.
        why: String,
        /// Whether it is still kept at the time given, and broken right after it.
        is_after: bool,
        /// Whether the time given is exact; else it is within a millionth below the true one,
        /// which is irrational.
        is_exact: bool,
        /// The reasons why a condition that should hold is false.
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
        /// How far apart they would have to be; `None`: not at the same time.
        separation: Option<Rational>,
    },
    /// An event happens again at the moment at which it happened: its effects, or those of other
    /// events, leave its precondition true, or make it so again. There is no end to that.
    EndlessEvent {
        /// `(name arg …)`.
        event: String,
        /// Whether no other event happened in between.
        is_alone: bool,
    },
    /// One happening gives a fluent several values at once.
    Conflict {
        /// The fluent.
        fluent: String,
    },
    /// A fluent is read that has no value.
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

/// The condition of an action, by its time specifier, or the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum When {
    /// Of an instantaneous action.
    Now,
    /// At start.
    Start,
    /// Over all.
    OverAll,
    /// At end.
    End,
    /// The goal.
    Goal,
    /// Of a constraint on the course of the plan.
    Course,
}

/// Why a condition is false: one of its parts.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// A fact does not have the truth it should have.
    Fact {
        /// The fact.
        fact: String,
        /// Its truth.
        is_true: bool,
        /// The last change that made it so; `None` if it has been so from the beginning, or is
        /// derived.
        since: Option<Occurrence>,
    },
    /// A comparison does not have the truth it should have.
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
        /// Its truth.
        is_true: bool,
    },
}

/// Something that happens.
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

/// The part of an action that a happening is: its start, its end, or all of it.
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

/// Why it cannot be decided whether a plan is valid.
#[derive(Clone, Debug, PartialEq)]
pub struct Undecided {
    /// The time at which the difficulty arises; `None` if before anything happens.
    pub time: Option<Rational>,
    /// The difficulty.
    pub difficulty: Difficulty,
}

/// The reason why the validator cannot evaluate a condition.
#[derive(Clone, Debug, PartialEq)]
pub enum Difficulty {
    /// A number is left open.
    Open {
        /// Its name.
        unknown: String,
        /// Where it is read.
        within: String,
    },
    /// A fluent's rate of change depends on the fluent itself, so that its value is no
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
    /// `?duration` or `total-time` stands where it means nothing.
    Misplaced {
        /// Which of the two.
        expression: String,
        /// The expression that it occurs in.
        within: String,
    },
    /// A continuous effect depends on an over-all condition, whose truth lies in the future.
    ContinuousGuard {
        /// The fluent that the effect changes.
        fluent: String,
    },
    /// Whether a constraint on the whole course is kept depends on states before the plan begins.
    Past,
    /// Whether a constraint is kept depends on two times that are less than a millionth apart, one
    /// of them irrational.
    CloseTimes {
        /// The constraint.
        constraint: String,
    },
    /// A derived fact depends on its own negation.
    Unstratified,
    /// A fluent that is read stopped moving, or changed its course, at an irrational moment, where
    /// its value is irrational, too.
    Irrational {
        /// The fluent.
        fluent: String,
        /// Where it is read.
        within: String,
    },
    /// A process would start and stop without end at one moment: at work, it makes its condition
    /// false, and else it is true.
    Chattering {
        /// `(name arg …)`.
        process: String,
    },
    /// Events happen, or processes start and stop, more often between two happenings than is looked
    /// at.
    ManyChanges {
        /// How often.
        most: usize,
    },
}
