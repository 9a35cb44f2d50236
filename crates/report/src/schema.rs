//! Lines of a trace, for writers and readers: `docs/reference/formats/trace.md`.

use elbowroom_num::Rational;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::exact::{self, Exact};

mod goal;
mod observed;
mod shortfall;

pub use goal::{GoalChangeLine, GoalState, TermsLine};
pub use observed::{ObservationLine, ObservedLine};
pub use shortfall::{LatenessLine, ShortfallLine};

/// A line of a trace, except the first one.
///
/// A number is [`Exact`]; its decimal is for people, and is ignored when read.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Line {
    /// The run adopted a plan.
    Plan(PlanLine),
    /// The executor made a decision.
    Decided(DecidedLine),
    /// A command was sent to the world.
    Command(CommandLine),
    /// Time has passed.
    Passed(TimeAdvanceLine),
    /// The world observed the facts and numbers of the goal on request.
    Looked(GoalLookLine),
    /// The world reported an observation.
    Observed(ObservedLine),
    /// Planning has started.
    Planning(PlanningLine),
    /// Planning has ended, with or without a plan.
    Planned(PlannedLine),
    /// An action has used most of the time that the plan tolerates, or most of its time-out.
    Warning(WarningLine),
    /// The goals have changed, and the rest of the plan is kept.
    Kept(KeptPlanLine),
    /// A goal is released, closed, set aside, or pursued again.
    Goal(GoalChangeLine),
    /// A persistent run is idle.
    Resting(IdleLine),
    /// The end of the run was requested.
    Interrupted(InterruptedLine),
    /// The world failed; running actions are cancelled.
    WorldFailed(WorldFailedLine),
    /// The run is over.
    Over(ReportLine),
}

/// Adoption of a plan. Its times are relative to `origin`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanLine {
    /// The time.
    pub now: Exact,
    /// The time on the world's clock when the plan's clock reads 0.
    pub origin: Exact,
    /// The actions.
    pub steps: Vec<StepLine>,
    /// The plan as an STN.
    pub network: NetworkLine,
    /// The parameters.
    pub parameters: Vec<ParameterLine>,
}

/// An action of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepLine {
    /// The start time.
    pub start: Exact,
    /// Its name: `(drive rover depot shelf)`.
    pub action: String,
    /// The duration; `None` for an instantaneous action.
    pub duration: Option<Exact>,
}

/// A plan as a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkLine {
    /// The actions.
    pub instances: Vec<InstanceLine>,
    /// Bounds on differences of times.
    pub constraints: Vec<ConstraintLine>,
}

/// An action of a network.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InstanceLine {
    /// Label of the action in the names of its nodes.
    pub label: String,
    /// Its name.
    pub action: String,
}

/// `lower <= to - from <= upper`; `None` where there is no bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstraintLine {
    /// The first node.
    pub from: String,
    /// The second node.
    pub to: String,
    /// Lower bound.
    pub lower: Option<BoundLine>,
    /// Upper bound.
    pub upper: Option<BoundLine>,
}

/// A bound of a constraint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum BoundLine {
    /// The value of a parameter.
    Parameter {
        /// Its name.
        parameter: String,
    },
    /// A number.
    Number(Exact),
}

/// A parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterLine {
    /// Its name.
    pub name: String,
    /// Its value in the plan.
    pub nominal: Exact,
    /// Values for which the plan is guaranteed to work.
    pub envelope: Option<IntervalLine>,
}

/// The lower and upper end of an interval; `None` if infinite.
pub type IntervalLine = (Option<Exact>, Option<Exact>);

/// A decision of the executor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecidedLine {
    /// The time.
    pub now: Exact,
    /// The decision.
    pub decision: DecisionLine,
    /// The reason.
    pub reason: ReasonLine,
}

/// A decision in a trace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum DecisionLine {
    /// Start actions.
    Start {
        /// The actions to start.
        orders: Vec<OrderLine>,
    },
    /// Wait.
    Wait {
        /// Time of the end of the wait, unless something is observed before; `None` if unlimited.
        until: Option<Exact>,
    },
    /// Cancel actions.
    Cancel {
        /// The steps to cancel.
        steps: Vec<u32>,
    },
    /// Abandon the plan.
    Replan,
    /// The goal is reached.
    GoalReached,
}

/// An action to start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrderLine {
    /// The step of the plan.
    pub step: u32,
    /// Its name.
    pub action: String,
    /// The planned duration; `None` for an instantaneous action.
    pub duration: Option<Exact>,
    /// Time window of its start.
    pub planned: WindowLine,
}

/// The time window of a happening.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindowLine {
    /// The earliest time; `None` if there is no lower bound.
    pub earliest: Option<Exact>,
    /// The latest time; `None` if there is no upper bound.
    pub latest: Option<Exact>,
}

/// A reason, as a sentence and in parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReasonLine {
    /// The kind of reason: [`Cause::name`](elbowroom_execution::Cause::name).
    pub cause: String,
    /// The reason as a sentence.
    pub words: String,
    /// The affected action.
    pub action: Option<String>,
    /// The affected quantity, condition or moment, in words.
    pub about: Option<String>,
    /// The observed value.
    pub observed: Option<Exact>,
    /// The allowed interval.
    pub allowed: Option<IntervalLine>,
    /// The constraints that cause the bound, in words.
    pub behind: Vec<String>,
    /// Distance of the observed value from the allowed interval.
    pub by: Option<Exact>,
    /// Time since which the reason has existed.
    pub since: Option<Exact>,
    /// Remaining guarantee of the plan, if the executor gives guarantees:
    /// [`GuaranteeLevel::name`](elbowroom_execution::GuaranteeLevel::name).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub promise: Option<String>,
}

/// A command to the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandLine {
    /// The time.
    pub now: Exact,
    /// The command.
    pub command: IssuedCommandLine,
    /// Planned time window of the command.
    pub planned: WindowLine,
    /// The duration that the plan expects; left out if it is that of the command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<Exact>,
    /// The time-out of an action that is started, in seconds from its start or its last progress;
    /// left out if time-outs are off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeout: Option<Exact>,
}

/// A command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum IssuedCommandLine {
    /// Start an action.
    Start {
        /// Identifier of the start in reports.
        ticket: u64,
        /// Its name.
        action: String,
        /// The planned duration.
        duration: Option<Exact>,
    },
    /// Cancel an action.
    Cancel {
        /// Ticket of its start.
        ticket: u64,
    },
}

/// Time has passed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeAdvanceLine {
    /// Latest time at which the world had to answer.
    pub until: Exact,
    /// The present time.
    pub now: Exact,
    /// The observations.
    pub observations: Vec<ObservationLine>,
}

/// Observation of the goal's facts and numbers on request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalLookLine {
    /// The time.
    pub now: Exact,
    /// The observations.
    pub observations: Vec<ObservationLine>,
}

/// Start of planning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanningLine {
    /// The time.
    pub now: Exact,
    /// The reason.
    pub reason: ReasonLine,
    /// Initial state of the new plan.
    pub situation: SituationLine,
}

/// Initial state of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SituationLine {
    /// The time.
    pub time: Exact,
    /// The true facts.
    pub facts: Vec<String>,
    /// The values of the fluents.
    pub values: IndexMap<String, Exact>,
    /// The running actions.
    pub running: Vec<RunningLine>,
}

/// An action that is running.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunningLine {
    /// Its name.
    pub action: String,
    /// The start time.
    pub start: Exact,
    /// The expected duration.
    pub duration: IntervalLine,
}

/// End of planning, with or without a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedLine {
    /// The time, planning time included.
    pub now: Exact,
    /// The duration of planning, by the world's clock.
    pub took: Exact,
    /// The plan, if one was found.
    pub plan: Option<Vec<StepLine>>,
    /// The reason why there is no plan.
    pub why_not: Option<String>,
    /// `true` if it is proved that there is no plan.
    #[serde(rename = "unsolvable")]
    pub is_unsolvable: bool,
    /// `true` if there is no plan because the planner failed; left out otherwise.
    #[serde(
        rename = "planner_failed",
        default,
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub has_failed: bool,
    /// Remark of the planner on its choice of the plan; left out if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// Known reasons for which the goals have no plan; left out if none is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shortfall: Option<ShortfallLine>,
}

/// Warning about an action that has used most of the time that the plan tolerates, or most of its
/// time-out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WarningLine {
    /// The time.
    pub now: Exact,
    /// Ticket of its start.
    pub ticket: u64,
    /// Its name.
    pub action: String,
    /// Time at which a new plan is needed, or the action times out, unless it ends before.
    pub until: Exact,
    /// `true` if the action times out then; left out where a new plan is needed.
    #[serde(
        rename = "timeout",
        default,
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub is_timeout: bool,
    /// The warning as a sentence.
    pub words: String,
}

/// The goals have changed, and the remaining plan reaches the new ones as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptPlanLine {
    /// The time.
    pub now: Exact,
    /// Description of the change.
    pub reason: ReasonLine,
}

/// A persistent run becomes idle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdleLine {
    /// The time.
    pub now: Exact,
    /// Outcome of the goals: [`Verdict::name`](elbowroom_execution::run::Verdict::name); `None` if
    /// there were none.
    pub verdict: Option<String>,
    /// A further explanation.
    pub why: Option<String>,
    /// Names of the reached goals, or else of the open ones.
    pub goals: Vec<String>,
    /// Conditions that can never become true again.
    pub dead_end: Vec<ReasonLine>,
    /// The open goals without a plan; traces of earlier versions do not have them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unreached: Option<Vec<UnreachedLine>>,
}

/// A goal without a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnreachedLine {
    /// Its name.
    pub name: String,
    /// `true` if a certificate proves that no plan reaches it.
    pub impossible: bool,
    /// The reasons about this goal.
    pub reasons: Vec<ReasonLine>,
}

/// Request to end the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterruptedLine {
    /// The time.
    pub now: Exact,
}

/// The world failed, but can still receive commands: running actions are cancelled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldFailedLine {
    /// The time.
    pub now: Exact,
    /// The error.
    pub why: String,
}

/// The report on a finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportLine {
    /// Outcome: [`Verdict::name`](elbowroom_execution::run::Verdict::name).
    pub verdict: String,
    /// A further explanation.
    pub why: Option<String>,
    /// The time, by the world's clock.
    #[serde(with = "exact")]
    pub time: Rational,
    /// The number of new plans made or requested.
    pub replans: usize,
    /// The reasons for new plans.
    pub reasons: Vec<ReasonLine>,
    /// Conditions that can never become true again, if no plan reaches the goal any more.
    pub dead_end: Vec<ReasonLine>,
    /// The number of actions started.
    pub starts: usize,
    /// The executed steps.
    pub executed: Vec<ExecutedLine>,
}

/// An executed action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExecutedLine {
    /// The start time.
    pub start: Exact,
    /// Its name.
    pub action: String,
    /// The observed duration; `None` for an instantaneous action.
    pub duration: Option<Exact>,
    /// Ticket of its start.
    pub ticket: u64,
    /// Outcome; `None` if it has not ended.
    pub outcome: Option<String>,
}

impl Line {
    /// Returns the line as text, without a line feed.
    pub fn text(&self) -> String {
        /// For compatibility, the event name is the last member of this line, and the first one of
        /// all others.
        #[derive(Serialize)]
        struct LegacyReportLine<'a> {
            #[serde(flatten)]
            report: &'a ReportLine,
            event: &'static str,
        }

        /// A line whose first member is its event name.
        #[derive(Serialize)]
        #[serde(tag = "event", rename_all = "kebab-case")]
        enum NamedLine<'a> {
            Plan(&'a PlanLine),
            Decided(&'a DecidedLine),
            Command(&'a CommandLine),
            Passed(&'a TimeAdvanceLine),
            Looked(&'a GoalLookLine),
            Observed(&'a ObservedLine),
            Planning(&'a PlanningLine),
            Planned(&'a PlannedLine),
            Warning(&'a WarningLine),
            Kept(&'a KeptPlanLine),
            Goal(&'a GoalChangeLine),
            Resting(&'a IdleLine),
            Interrupted(&'a InterruptedLine),
            WorldFailed(&'a WorldFailedLine),
        }

        let named = match self {
            Self::Over(report) => {
                let event = "over";
                return to_json(&LegacyReportLine { report, event });
            }
            Self::Plan(line) => NamedLine::Plan(line),
            Self::Decided(line) => NamedLine::Decided(line),
            Self::Command(line) => NamedLine::Command(line),
            Self::Passed(line) => NamedLine::Passed(line),
            Self::Looked(line) => NamedLine::Looked(line),
            Self::Observed(line) => NamedLine::Observed(line),
            Self::Planning(line) => NamedLine::Planning(line),
            Self::Planned(line) => NamedLine::Planned(line),
            Self::Warning(line) => NamedLine::Warning(line),
            Self::Kept(line) => NamedLine::Kept(line),
            Self::Goal(line) => NamedLine::Goal(line),
            Self::Resting(line) => NamedLine::Resting(line),
            Self::Interrupted(line) => NamedLine::Interrupted(line),
            Self::WorldFailed(line) => NamedLine::WorldFailed(line),
        };
        to_json(&named)
    }
}

fn to_json(line: &impl Serialize) -> String {
    serde_json::to_string(line).expect("all keys are texts, and decimals of rationals are finite")
}
