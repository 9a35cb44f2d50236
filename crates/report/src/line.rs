//! The lines of a trace, for those who write and those who read: `docs/formats/trace.md`.

use elbowroom_num::Rational;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::exact::{self, Exact};

mod goal;
mod observed;
mod shortfall;

pub(crate) use goal::members;
pub use goal::{GoalChangeLine, GoalState, terms};
pub use observed::{ObservationLine, ObservedLine};
pub use shortfall::{LatenessLine, ShortfallLine};

/// A line of a trace, but for its first one.
///
/// A number is [`Exact`]; the decimal beside it is for people, and is ignored when read.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Line {
    /// A plan is taken up.
    Plan(PlanLine),
    /// The executor decided.
    Decided(DecidedLine),
    /// The world was given a command.
    Command(CommandLine),
    /// Time has passed.
    Passed(PassedLine),
    /// The world was asked to look at the goal.
    Looked(LookedLine),
    /// An observation, and what was made of it.
    Observed(ObservedLine),
    /// A plan is being made.
    Planning(PlanningLine),
    /// A plan has been made, or not.
    Planned(PlannedLine),
    /// An action has used most of the time that the plan tolerates, or most of its time-out.
    Warning(WarningLine),
    /// The goals have changed, and the rest of the plan is kept.
    Kept(KeptLine),
    /// A goal is closed, set aside, or pursued again.
    Goal(GoalChangeLine),
    /// A lasting run waits for a change.
    Resting(RestingLine),
    /// Somebody asked the run to end.
    Interrupted(InterruptedLine),
    /// The world failed; running actions are cancelled.
    WorldFailed(WorldFailedLine),
    /// The run is over.
    Over(ReportLine),
}

/// A plan is taken up; its times count from its `origin`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanLine {
    /// The time.
    pub now: Exact,
    /// The time on the world's clock when the plan's clock reads 0.
    pub origin: Exact,
    /// The actions.
    pub steps: Vec<StepLine>,
    /// The plan with room.
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
    /// By which nodes are named.
    pub label: String,
    /// Its name.
    pub action: String,
}

/// `lower <= to - from <= upper`; `None` where there is no bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstraintLine {
    /// A node.
    pub from: String,
    /// A node.
    pub to: String,
    /// Not less.
    pub lower: Option<BoundLine>,
    /// Not more.
    pub upper: Option<BoundLine>,
}

/// A bound of a constraint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum BoundLine {
    /// The value of the parameter of that name.
    Parameter {
        /// The name.
        parameter: String,
    },
    /// A number.
    Number(Exact),
}

/// Something left open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterLine {
    /// Its name.
    pub name: String,
    /// Its value if nothing deviates.
    pub nominal: Exact,
    /// For which values the plan is guaranteed to work.
    pub envelope: Option<IntervalLine>,
}

/// The ends of an interval; `None` where it has none.
pub type IntervalLine = (Option<Exact>, Option<Exact>);

/// The executor decided.
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

/// A decision, as a trace has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum DecisionLine {
    /// To start actions.
    Start {
        /// The actions to start.
        orders: Vec<OrderLine>,
    },
    /// To wait.
    Wait {
        /// Until when, if nothing is observed earlier.
        until: Option<Exact>,
    },
    /// To stop actions.
    Cancel {
        /// The steps to cancel.
        steps: Vec<u32>,
    },
    /// To give up the plan.
    Replan,
    /// That the goal is reached.
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
    /// When it may start.
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

/// A reason: its words, and its parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReasonLine {
    /// The kind of reason: [`Cause::name`](elbowroom_execution::Cause::name).
    pub cause: String,
    /// The whole of it as a sentence.
    pub words: String,
    /// The action that it is about.
    pub action: Option<String>,
    /// The quantity, condition or moment that it is about, in words.
    pub about: Option<String>,
    /// The observed value.
    pub observed: Option<Exact>,
    /// The interval that is allowed.
    pub allowed: Option<IntervalLine>,
    /// The constraints behind that, in words.
    pub behind: Vec<String>,
    /// By how much it was missed.
    pub by: Option<Exact>,
    /// Since when this has been so.
    pub since: Option<Exact>,
    /// What is still promised of the rest of the plan, where the executor makes promises:
    /// [`Promise::name`](elbowroom_execution::Promise::name).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub promise: Option<String>,
}

/// The world was given a command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandLine {
    /// The time.
    pub now: Exact,
    /// The command.
    pub command: GivenLine,
    /// When that was planned.
    pub planned: WindowLine,
    /// The time-out of an action that is started, in seconds from its start or its last progress;
    /// left out if time-outs are off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeout: Option<Exact>,
}

/// A command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum GivenLine {
    /// Start an action.
    Start {
        /// By which reports refer to it.
        ticket: u64,
        /// Its name.
        action: String,
        /// The planned duration.
        duration: Option<Exact>,
    },
    /// Stop an action.
    Cancel {
        /// Which start.
        ticket: u64,
    },
}

/// Time has passed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassedLine {
    /// Until when the world was asked to wait at most.
    pub until: Exact,
    /// The present time.
    pub now: Exact,
    /// The observations.
    pub observations: Vec<ObservationLine>,
}

/// The world was asked to look at the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookedLine {
    /// The time.
    pub now: Exact,
    /// The observations.
    pub observations: Vec<ObservationLine>,
}

/// A plan is being made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanningLine {
    /// The time.
    pub now: Exact,
    /// The reason.
    pub reason: ReasonLine,
    /// From where.
    pub situation: SituationLine,
}

/// The state in which a plan begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SituationLine {
    /// The time.
    pub time: Exact,
    /// The true facts.
    pub facts: Vec<String>,
    /// The values of the fluents.
    pub values: IndexMap<String, Exact>,
    /// The actions under way.
    pub running: Vec<RunningLine>,
}

/// An action that is running.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunningLine {
    /// Its name.
    pub action: String,
    /// The time at which it has started.
    pub start: Exact,
    /// The expected duration.
    pub duration: IntervalLine,
}

/// A plan has been made, or not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedLine {
    /// The time, planning time included.
    pub now: Exact,
    /// The time that it took, by the world's clock.
    pub took: Exact,
    /// The plan.
    pub plan: Option<Vec<StepLine>>,
    /// Why there is none.
    pub why_not: Option<String>,
    /// Whether it is certain that there is none.
    #[serde(rename = "unsolvable")]
    pub is_unsolvable: bool,
    /// Whether there is none because the planner has failed; left out where it has not.
    #[serde(
        rename = "planner_failed",
        default,
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub has_failed: bool,
    /// What the planner has to say about it: why it is this plan; left out where it is nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// Known reasons for which the goals have no plan; left out if none is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shortfall: Option<ShortfallLine>,
}

/// An action has used most of the time that the plan tolerates, or most of its time-out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WarningLine {
    /// The time.
    pub now: Exact,
    /// Its start.
    pub ticket: u64,
    /// Its name.
    pub action: String,
    /// When a new plan is needed, or when the action times out, if it has not ended.
    pub until: Exact,
    /// `true` if the action times out then; left out where a new plan is needed.
    #[serde(
        rename = "timeout",
        default,
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub is_timeout: bool,
    /// The same in words.
    pub words: String,
}

/// The goals have changed, and the rest of the running plan reaches these, too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptLine {
    /// The time.
    pub now: Exact,
    /// How they have changed.
    pub reason: ReasonLine,
}

/// A lasting run waits for a change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RestingLine {
    /// The time.
    pub now: Exact,
    /// What came of the goals: [`Verdict::name`](elbowroom_execution::run::Verdict::name); `None` if
    /// there were none.
    pub verdict: Option<String>,
    /// A further explanation.
    pub why: Option<String>,
    /// The goals by name: those that were reached, or else those that are open.
    pub goals: Vec<String>,
    /// What can never become true again.
    pub dead_end: Vec<ReasonLine>,
}

/// Somebody asked the run to end.
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
    /// How it ended: [`Verdict::name`](elbowroom_execution::run::Verdict::name).
    pub verdict: String,
    /// A further explanation.
    pub why: Option<String>,
    /// The time, by the world's clock.
    #[serde(with = "exact")]
    pub time: Rational,
    /// The number of new plans made, or asked for.
    pub replans: usize,
    /// The reason.
    pub reasons: Vec<ReasonLine>,
    /// Facts and numbers that can never become true again, where no plan reaches the goal any more.
    pub dead_end: Vec<ReasonLine>,
    /// The number of actions started.
    pub starts: usize,
    /// The executed steps.
    pub executed: Vec<ExecutedLine>,
}

/// Something that was done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExecutedLine {
    /// The time at which it started.
    pub start: Exact,
    /// Its name.
    pub action: String,
    /// The time taken; `None` for an instantaneous action.
    pub duration: Option<Exact>,
    /// Which start it was.
    pub ticket: u64,
    /// How it ended; `None` if it had not.
    pub outcome: Option<String>,
}

impl Line {
    /// The line as it stands in a trace, without a line feed.
    pub fn text(&self) -> String {
        /// The last line has always ended with its name; all others begin with it.
        #[derive(Serialize)]
        struct Over<'a> {
            #[serde(flatten)]
            report: &'a ReportLine,
            event: &'static str,
        }

        /// A line that begins with its name.
        #[derive(Serialize)]
        #[serde(tag = "event", rename_all = "kebab-case")]
        enum Named<'a> {
            Plan(&'a PlanLine),
            Decided(&'a DecidedLine),
            Command(&'a CommandLine),
            Passed(&'a PassedLine),
            Looked(&'a LookedLine),
            Observed(&'a ObservedLine),
            Planning(&'a PlanningLine),
            Planned(&'a PlannedLine),
            Warning(&'a WarningLine),
            Kept(&'a KeptLine),
            Goal(&'a GoalChangeLine),
            Resting(&'a RestingLine),
            Interrupted(&'a InterruptedLine),
            WorldFailed(&'a WorldFailedLine),
        }

        let named = match self {
            Self::Over(report) => {
                let event = "over";
                return written(&Over { report, event });
            }
            Self::Plan(line) => Named::Plan(line),
            Self::Decided(line) => Named::Decided(line),
            Self::Command(line) => Named::Command(line),
            Self::Passed(line) => Named::Passed(line),
            Self::Looked(line) => Named::Looked(line),
            Self::Observed(line) => Named::Observed(line),
            Self::Planning(line) => Named::Planning(line),
            Self::Planned(line) => Named::Planned(line),
            Self::Warning(line) => Named::Warning(line),
            Self::Kept(line) => Named::Kept(line),
            Self::Goal(line) => Named::Goal(line),
            Self::Resting(line) => Named::Resting(line),
            Self::Interrupted(line) => Named::Interrupted(line),
            Self::WorldFailed(line) => Named::WorldFailed(line),
        };
        written(&named)
    }
}

fn written(line: &impl Serialize) -> String {
    serde_json::to_string(line).expect("all keys are texts, and decimals of rationals are finite")
}
