//! Requests and responses as JSON: `docs/reference/serve.md`.

use std::fmt;

use elbowroom::num::{End, Rational};
use elbowroom::report::exact::{self, Exact};
use elbowroom::report::wire;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use serde_json::{Map, Value, json};

use super::Described;
use super::schema::documents;

/// A number in a request: a JSON number, a text such as `"1/3"`, or the form that this program
/// writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenNumber(pub Rational);

impl Serialize for GivenNumber {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Exact(self.0.clone()).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for GivenNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let given = Value::deserialize(deserializer)?;
        let number = wire::read_number(&given).map(Self);
        number.ok_or_else(|| de::Error::custom("expected a number such as 3.5 or \"7/2\""))
    }
}

impl Described for GivenNumber {
    fn schema(definitions: &mut Map<String, Value>) -> Value {
        let exact = Exact::schema(definitions);
        json!({ "anyOf": [{ "type": "number" }, { "type": "string" }, exact] })
    }
}

/// The lower end of an interval; infinity is `-inf`, without a decimal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct LowerEnd(#[serde(with = "exact::lower")] pub End);

/// The upper end of an interval; infinity is `inf`, without a decimal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct UpperEnd(#[serde(with = "exact::upper")] pub End);

impl Described for LowerEnd {
    fn schema(definitions: &mut Map<String, Value>) -> Value {
        end_schema(definitions)
    }
}

impl Described for UpperEnd {
    fn schema(definitions: &mut Map<String, Value>) -> Value {
        end_schema(definitions)
    }
}

fn end_schema(definitions: &mut Map<String, Value>) -> Value {
    let infinite = json!({
        "type": "object",
        "properties": {
            "exact": { "enum": [exact::INFINITY, exact::MINUS_INFINITY] },
            "decimal": { "type": "null" },
        },
        "required": ["exact"],
    });
    json!({ "anyOf": [Exact::schema(definitions), infinite] })
}

/// Activity of an executive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activity {
    /// The run has not begun.
    #[default]
    Beginning,
    /// The planner makes a plan.
    Planning,
    /// A plan is executed.
    Executing,
    /// The run is paused on request.
    Paused,
    /// The executive is idle: there is no goal, or no plan, and it waits for a change.
    Resting,
    /// The run has ended.
    Over,
}

impl Activity {
    /// All values with their names in documents.
    pub const NAMES: &[(Self, &str)] = &[
        (Self::Beginning, "beginning"),
        (Self::Planning, "planning"),
        (Self::Executing, "executing"),
        (Self::Paused, "paused"),
        (Self::Resting, "resting"),
        (Self::Over, "over"),
    ];
}

impl fmt::Display for Activity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = Self::NAMES.iter().find(|(activity, _)| activity == self);
        f.write_str(found.map_or("unknown", |(_, name)| name))
    }
}

impl Described for Activity {
    fn schema(_: &mut Map<String, Value>) -> Value {
        let names: Vec<&str> = Self::NAMES.iter().map(|(_, name)| *name).collect();
        json!({ "type": "string", "enum": names })
    }
}

documents! {
    /// The state of the run.
    pub struct State {
        /// The time of the world's clock at its last message, in seconds.
        pub now: Exact,
        /// Time for which the world has not answered a request, in seconds of this machine's clock;
        /// none if it answers within a second. Until it answers, no action is started, and no
        /// request is accepted.
        pub unanswered: Option<u64>,
        /// The reason why the world's program is being started again, in words; none if it runs.
        pub restarting: Option<String>,
        /// Activity of the executive.
        pub activity: Activity,
        /// The reason why it is idle or makes a plan, in words.
        pub why: Option<String>,
        /// The open goals.
        pub goals: Vec<OpenGoal>,
        /// The running actions.
        pub running: Vec<Running>,
        /// Number of plans adopted so far.
        pub plans: usize,
        /// The facts that are believed to be true.
        pub facts: Vec<String>,
        /// The believed values of numbers.
        pub numbers: Vec<NumberNow>,
        /// Facts and numbers in doubt. Until their values are known, such a fact counts as false,
        /// such a number keeps its value, and a goal that reads them is not reached.
        pub in_doubt: Vec<InDoubt>,
    }

    /// A fact or a number in doubt.
    pub struct InDoubt {
        /// The fact or the number.
        pub name: String,
        /// The start of the doubt.
        pub since: Exact,
        /// The reason, and the observations that settle the doubt.
        pub why: String,
    }

    /// An open goal.
    pub struct OpenGoal {
        /// Its name; that of the problem's own goal is `problem`.
        pub name: String,
        /// The goal, in PDDL.
        pub goal: String,
        /// The reason why it is set aside while other goals are pursued; none if it is pursued.
        pub aside: Option<String>,
        /// Its release time, if that has not come.
        pub release: Option<Exact>,
        /// The state of a goal to keep, as in the list of goals; none for another goal.
        pub keep: Option<String>,
    }

    /// The open goals, and the most recently closed ones.
    pub struct GoalsNow {
        /// The closed goals, by time of closing, followed by the open ones, oldest first.
        pub goals: Vec<GoalNow>,
    }

    /// A goal and its state.
    pub struct GoalNow {
        /// Its name; that of the problem's own goal is `problem`.
        pub name: String,
        /// The goal, in PDDL.
        pub goal: String,
        /// Its value, a positive number.
        pub value: Exact,
        /// Its deadline on the world's clock, if there is one.
        pub deadline: Option<Exact>,
        /// Its release time on the world's clock, if there is one.
        pub release: Option<Exact>,
        /// `true` for a goal to keep, which is closed only when it is cancelled.
        pub keep: bool,
        /// Name of the client that has given it, if it is known.
        pub by: Option<String>,
        /// `queued` until its release time; `kept` while a goal to keep holds, and `queued` while it does not and
        /// other goals are pursued; `pursued`; `set-aside` while others are pursued; `impossible` if no plan exists, or
        /// `unplanned` if none was found, when the executive is idle; `achieved`, `cancelled`, or
        /// `failed` if it was not achieved by its deadline.
        pub state: String,
        /// The time at which it was given, by the world's clock; none if an earlier segment of a journal of an earlier
        /// version contains it.
        pub given: Option<Exact>,
        /// The time of the change to this state.
        pub since: Exact,
        /// The reason for a state other than `pursued` and `achieved`, if it is known.
        pub why: Option<String>,
    }

    /// A running action.
    pub struct Running {
        /// The number of its start.
        pub ticket: u64,
        /// The action.
        pub action: String,
        /// The time of its start.
        pub since: Exact,
        /// Planned duration.
        pub planned: Option<Exact>,
        /// The time at which a new plan is needed if the action has not ended; given only shortly
        /// before.
        pub needed: Option<Exact>,
        /// The time at which the action times out and is cancelled unless it makes progress; given
        /// only shortly before.
        pub times_out: Option<Exact>,
        /// The completed part, from 0 to 1, if the world has reported it.
        pub completion: Option<Exact>,
        /// The world's last note about it.
        pub note: Option<String>,
    }

    /// A number of the problem.
    pub struct NumberNow {
        /// The fluent.
        pub fluent: String,
        /// Its value.
        pub value: Exact,
    }

    /// The current plan.
    pub struct PlanNow {
        /// Its actions, by planned start; none if there is no plan.
        pub steps: Vec<StepNow>,
        /// The time of its adoption, by the world's clock.
        pub since: Option<Exact>,
        /// Number of plans adopted so far.
        pub plans: usize,
        /// The last actions that ended, oldest first, including those of earlier plans.
        pub ended: Vec<EndedAction>,
    }

    /// An action that has ended.
    pub struct EndedAction {
        /// The number of its start.
        pub ticket: u64,
        /// The action.
        pub action: String,
        /// The time of its start.
        pub since: Exact,
        /// The time of its end.
        pub end: Exact,
        /// `succeeded`, `failed` or `cancelled`.
        pub state: String,
    }

    /// An action of a plan.
    pub struct StepNow {
        /// The action.
        pub action: String,
        /// The planned start, by the world's clock.
        pub start: Exact,
        /// The planned duration; none for an instantaneous action.
        pub duration: Option<Exact>,
        /// `to-come`, `running`, `succeeded`, `failed` or `cancelled`.
        pub state: String,
        /// The number of its start, if it was started.
        pub ticket: Option<u64>,
        /// The name of the quantity that is its duration, if the guarantee has an interval for it.
        pub parameter: Option<String>,
    }

    /// The guarantee for the remaining plan.
    pub struct GuaranteeNow {
        /// The guarantee for the remaining plan: `envelope`, `part-of-envelope`, `planned` or
        /// `luck`, if the executor makes one.
        pub promise: Option<String>,
        /// The time at which it was made.
        pub since: Option<Exact>,
        /// The last deviation that made the executor abandon a plan, since the executive was idle.
        pub deviation: Option<String>,
        /// The durations of plans: `believed` for the mean durations of the believed world in place of those that the
        /// domain fixes, otherwise `domain`.
        pub durations: String,
        /// The rule that sets the time-out of each action: `10x,600` is 10 times the planned
        /// duration, at least 600 seconds; `none` if time-outs are off. The promise holds as long as each
        /// quantity stays inside its interval and each action ends before its time-out.
        pub timeout: String,
        /// The quantities that may deviate, with their intervals.
        pub parameters: Vec<Room>,
    }

    /// A quantity and its guaranteed interval.
    pub struct Room {
        /// Its name.
        pub name: String,
        /// The quantity in words: `duration of (move a b)`.
        pub meaning: String,
        /// Its planned value.
        pub nominal: Exact,
        /// The lower end of the guaranteed interval; none if there is no guarantee, that is, if the
        /// promise is neither `envelope` nor `part-of-envelope`.
        pub least: Option<LowerEnd>,
        /// The upper end of the guaranteed interval.
        pub most: Option<UpperEnd>,
        /// The time-out of the action whose duration it is; none if it is not a duration, or if
        /// time-outs are off.
        pub timeout: Option<Exact>,
    }

    /// A page of the history: closed goals and ended actions, the latest first.
    pub struct HistoryNow {
        /// The goals; `since` is the time at which each was closed.
        pub goals: Vec<GoalNow>,
        /// The actions.
        pub actions: Vec<EndedAction>,
        /// The next page has the entries before this time (`?before=`); none if there are no more.
        pub next: Option<Exact>,
    }

    /// The last decision and the next action.
    pub struct NextNow {
        /// The last decision: `start`, `wait`, `cancel`, `replan` or `goal-reached`.
        pub decision: Option<String>,
        /// The time of the decision.
        pub decided: Option<Exact>,
        /// The end of the wait, if no event ends it before.
        pub until: Option<Exact>,
        /// The reason, in words.
        pub why: Option<String>,
        /// The next action of the plan to start.
        pub step: Option<StepNow>,
    }

    /// A goal given by a client.
    #[serde(deny_unknown_fields)]
    pub struct NewGoal {
        /// Its name; without one, a name is generated. A goal of the same name is replaced.
        [optional serde(default)]
        pub name: Option<String>,
        /// The goal, in PDDL, without `:goal`.
        pub goal: String,
        /// Its value, a positive number; 1 by default. If not all goals can be reached together, those with the greatest sum of
        /// values are pursued.
        [optional serde(default)]
        pub value: Option<GivenNumber>,
        /// Its deadline on the world's clock. Plans achieve the goal by then; otherwise it is
        /// closed as failed. By default there is none.
        [optional serde(default)]
        pub deadline: Option<GivenNumber>,
        /// The deadline in seconds from now, instead of `deadline`; a positive number.
        [optional serde(default)]
        pub within: Option<GivenNumber>,
        /// Its release time on the world's clock: it is not pursued before. By default it is pursued at once.
        [optional serde(default)]
        pub release: Option<GivenNumber>,
        /// The release time in seconds from now, instead of `release`; a positive number.
        [optional serde(default)]
        pub after: Option<GivenNumber>,
        /// `true` for a goal to keep: it is achieved again whenever it does not hold and no other goal is pursued. It has
        /// no deadline, and is closed only when it is cancelled.
        [optional serde(default)]
        pub keep: bool,
        /// Name of the client, for the records: up to 64 characters.
        [optional serde(default)]
        pub by: Option<String>,
    }

    /// The predicted outcome of a hypothetical goal, if everything goes as planned.
    pub struct WhatIf {
        /// The final state of the goal: `achieved`, `failed`, `impossible`, `unplanned` or `set-aside`, as in
        /// `GoalNow`; `undecided` if the limits of the simulation do not suffice.
        pub verdict: String,
        /// The time at which it is achieved, on the world's clock.
        pub done: Option<Exact>,
        /// The reason for another verdict, if it is known.
        pub why: Option<String>,
        /// The least slack of the present plan: the part of an interval that is left, from 0 to 1. None without a
        /// guarantee that limits a duration.
        pub slack_now: Option<Exact>,
        /// The same of the first plan for the goal.
        pub slack_then: Option<Exact>,
        /// The names of goals that are pursued now, and would be set aside or missed.
        pub missed: Vec<String>,
    }

    /// The end of a running action, reported or requested by a client.
    #[serde(deny_unknown_fields)]
    pub struct NewOutcome {
        /// The number of its start.
        pub ticket: u64,
        /// `done` or `failed` for an observed end; `cancelled` to have the world cancel the action.
        pub becomes: String,
    }

    /// A new value of a fact.
    #[serde(deny_unknown_fields)]
    pub struct NewFact {
        /// The fact, such as `(at rover depot)`.
        pub fact: String,
        /// `true` if the fact is true.
        pub becomes: bool,
    }

    /// A new value of a number.
    #[serde(deny_unknown_fields)]
    pub struct NewNumber {
        /// The fluent, such as `(charge rover)`.
        pub fluent: String,
        /// Its value.
        pub value: GivenNumber,
    }

    /// A new problem for the domain of the executive.
    #[serde(deny_unknown_fields)]
    pub struct NewProblem {
        /// The text of the problem file, in PDDL.
        pub problem: String,
    }

    /// Acknowledgement of a request.
    pub struct Taken {
        /// `true` if the executive has accepted the request. With a journal, an accepted request
        /// survives a crash.
        pub taken: bool,
        /// The event that the request waits for, in words, if it has not been accepted yet.
        [optional serde(default, skip_serializing_if = "Option::is_none")]
        pub until: Option<String>,
        /// The name of the goal in the request.
        [optional serde(default, skip_serializing_if = "Option::is_none")]
        pub name: Option<String>,
    }

    /// Rejection of a request.
    pub struct Refusal {
        /// The error, in one sentence.
        pub error: String,
        /// The remedy.
        pub help: String,
    }
}
