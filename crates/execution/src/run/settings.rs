//! Settings and results of runs.

mod timeout_rule;

use std::fmt;
use std::str::FromStr;

use elbowroom_num::Rational;

use super::action_log::ExecutedStep;
use crate::planning::PlanAnswer;
use crate::reason::Reason;

pub use timeout_rule::TimeoutRule;

/// Settings of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSettings {
    /// The treatment of running actions when a new plan is made.
    pub running: RunningRule,
    /// The planning time in the world.
    pub planning_time: PlanningTime,
    /// Maximum number of new plans until an action is completed. A run makes at most ten times as
    /// many.
    pub max_replans: usize,
    /// The rule that sets the time-out of each action.
    pub timeout: TimeoutRule,
    /// `true` if the slack of running actions is monitored. Then there is a warning before a late
    /// action makes a new plan necessary ([`Entry::Warning`](crate::Entry::Warning)). An action
    /// whose delay no plan tolerates any more is cancelled and counts as failed, and the next plan
    /// does without it. If `false`, such a delay ends the run.
    pub monitors_slack: bool,
    /// `true` if plans are made in the background ([`Planner::begin`](crate::Planner::begin)),
    /// while the run continues; [`Run`](super::Run) has the rules. The first plan of a run is
    /// awaited, unless the run is an executive.
    pub plans_in_background: bool,
    /// `true` if such plans are also prepared in the background
    /// ([`Preparer::begin`](crate::Preparer::begin)). Then a plan takes over as soon as it is
    /// prepared, and actions that the present plan starts until then are part of it.
    pub prepares_in_background: bool,
    /// The time limit of the run, on the world's clock.
    pub time_limit: Rational,
}

impl Default for RunSettings {
    /// Running actions continue, planning time is measured, at most 10 new plans as in paper 1's
    /// experiments, and a time limit of a million seconds.
    fn default() -> Self {
        Self {
            running: RunningRule::Keep,
            planning_time: PlanningTime::Measured,
            max_replans: 10,
            timeout: TimeoutRule::default(),
            monitors_slack: false,
            plans_in_background: false,
            prepares_in_background: false,
            time_limit: Rational::from(1_000_000),
        }
    }
}

/// The treatment of running actions when a new plan is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunningRule {
    /// They are cancelled, and the plan begins when they have stopped, as in `ROSPlan`.
    Cancel,
    /// They are awaited, and the plan begins when they have ended.
    Await,
    /// They continue, and are part of the plan. They are assumed to take as long as planned or, if
    /// they are overdue, a quarter longer than so far. Actions whose over-all condition has failed
    /// are cancelled, because no plan can continue with them. If slack is monitored
    /// ([`RunSettings::monitors_slack`]), overdue actions are also cancelled if no plan is found even
    /// for the case that they end at once.
    #[default]
    Keep,
}

impl RunningRule {
    /// All of them, with their names.
    pub const NAMES: &[(Self, &str)] = &[
        (Self::Cancel, "cancel"),
        (Self::Await, "await"),
        (Self::Keep, "keep"),
    ];
}

impl fmt::Display for RunningRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = Self::NAMES.iter().find(|(rule, _)| rule == self);
        f.write_str(found.map_or("unknown", |(_, name)| name))
    }
}

impl FromStr for RunningRule {
    type Err = UnknownSetting;

    fn from_str(text: &str) -> Result<Self, UnknownSetting> {
        let found = Self::NAMES.iter().find(|(_, name)| *name == text);
        found.map(|(rule, _)| *rule).ok_or_else(|| UnknownSetting {
            text: text.to_owned(),
            expected: "`cancel`, `await` or `keep`",
        })
    }
}

/// The planning time in the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PlanningTime {
    /// The planning time that the planner reports.
    Measured,
    /// A fixed number of seconds.
    Seconds(Rational),
}

impl PlanningTime {
    /// Text of [`Self::Measured`].
    const MEASURED: &str = "measured";
}

impl fmt::Display for PlanningTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measured => f.write_str(Self::MEASURED),
            Self::Seconds(seconds) => seconds.fmt(f),
        }
    }
}

impl FromStr for PlanningTime {
    type Err = UnknownSetting;

    /// Parses `measured`, or a non-negative number of seconds.
    fn from_str(text: &str) -> Result<Self, UnknownSetting> {
        if text == Self::MEASURED {
            return Ok(Self::Measured);
        }
        match text.parse::<Rational>() {
            Ok(seconds) if !seconds.is_negative() => Ok(Self::Seconds(seconds)),
            _ => Err(UnknownSetting {
                text: text.to_owned(),
                expected: "`measured` or a number of seconds",
            }),
        }
    }
}

/// Error: a text is not a value of a setting.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not {expected}")]
pub struct UnknownSetting {
    /// The text as written.
    pub text: String,
    /// The expected form.
    pub expected: &'static str,
}

/// The outcome of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The goal is reached.
    GoalReached,
    /// No plan reaches the goal from the end of the run, with a certificate
    /// ([`PlanAnswer::Unsolvable`](crate::PlanAnswer::Unsolvable)).
    Unsolvable,
    /// There may be a plan, but none was found or can be executed.
    NoPlan {
        /// The reason.
        why: String,
        /// The kind of the reason, which decides on the advice.
        missing: MissingPlan,
    },
    /// The planner has failed, so it is unknown whether there is a plan.
    PlannerFailed {
        /// The error.
        why: String,
    },
    /// The limit on new plans was reached.
    ReplanLimit,
    /// The time limit was reached.
    TimeLimit,
    /// The end of the run was requested.
    Interrupted,
    /// The outside world failed.
    WorldFailed {
        /// The reason.
        why: String,
    },
}

/// Reason for a run without a plan, if something else may provide one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingPlan {
    /// No planner was asked, or the given plan cannot be executed.
    NotSearched,
    /// A planner has found none. Another planner, or greater limits, may find one.
    NotFound,
    /// A plan may exist, or the goal may be reached, depending on facts and values in doubt.
    InDoubt,
    /// There is one, but the executor rejects it.
    Rejected,
}

impl MissingPlan {
    /// Returns the option or the report that may help, in words.
    pub fn advice(self) -> Option<&'static str> {
        match self {
            Self::NotSearched => None,
            Self::NotFound => Some("another planner may find one (--planner)"),
            Self::InDoubt => Some(
                "the doubt ends when the world reports these facts and numbers, or the action's \
                 end",
            ),
            Self::Rejected => Some("try another executor (--executor)"),
        }
    }
}

impl Verdict {
    /// Returns the name used in traces and tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::GoalReached => "goal-reached",
            Self::Unsolvable => "unsolvable-from-here",
            Self::NoPlan { .. } => "no-plan",
            Self::PlannerFailed { .. } => "planner-failed",
            Self::ReplanLimit => "replan-limit",
            Self::TimeLimit => "time-limit",
            Self::Interrupted => "interrupted",
            Self::WorldFailed { .. } => "world-failed",
        }
    }

    /// Returns the verdict of a run if the planner has given this answer, which is not a plan.
    pub(super) fn without_plan(answer: &PlanAnswer) -> Self {
        let why = answer.failure_reason().unwrap_or_default().to_owned();
        match answer {
            PlanAnswer::Unsolvable => Self::Unsolvable,
            PlanAnswer::Failed { .. } => Self::PlannerFailed { why },
            PlanAnswer::NoPlanner => Self::NoPlan {
                why,
                missing: MissingPlan::NotSearched,
            },
            PlanAnswer::NotFound { .. } | PlanAnswer::Plan(_) => Self::NoPlan {
                why,
                missing: MissingPlan::NotFound,
            },
        }
    }

    /// Returns details of the verdict, if there are any.
    pub fn why(&self) -> Option<&str> {
        match self {
            Self::NoPlan { why, .. } | Self::PlannerFailed { why } | Self::WorldFailed { why } => {
                Some(why)
            }
            _ => None,
        }
    }
}

/// The report on a finished run.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The outcome.
    pub verdict: Verdict,
    /// The time of the end, on the world's clock.
    pub time: Rational,
    /// The number of new plans that were requested.
    pub replans: usize,
    /// The reason.
    pub reasons: Vec<Reason>,
    /// If no plan reaches the goal any more: the parts of the goal that can never become true
    /// again, and since when, as far as that is known
    /// ([`Run::with_explanations`](super::Run::with_explanations)).
    pub dead_end: Vec<Reason>,
    /// The number of actions started.
    pub starts: usize,
    /// The executed steps, with the observed times and amounts: a plan for the validator.
    pub executed: Vec<ExecutedStep>,
}
