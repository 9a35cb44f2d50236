//! What is asked and answered, as JSON: `docs/serve.md`.

use std::fmt;

use elbowroom_num::{End, Rational};
use elbowroom_report::exact::{self, Exact};
use elbowroom_report::wire;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use serde_json::{Map, Value, json};

use super::Described;
use super::schema::documents;

/// A number that somebody gives: plain, as a text such as `"1/3"`, or as this program writes it.
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

/// What an executive is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activity {
    /// It has not begun.
    #[default]
    Beginning,
    /// It makes a plan.
    Planning,
    /// It executes one.
    Executing,
    /// It was asked to pause.
    Paused,
    /// It has nothing to do, or cannot do it, and waits for a change.
    Resting,
    /// It has ended.
    Over,
}

impl Activity {
    /// All of them, as documents write them.
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
    /// How things stand.
    pub struct State {
        /// The time by the world's clock when it was last heard, in seconds.
        pub now: Exact,
        /// For how many seconds the world has not answered what it was asked, by this machine's clock; none as long as
        /// it answers within a second. Until it does, nothing is started, and no request is taken in.
        pub unanswered: Option<u64>,
        /// What the executive is doing.
        pub activity: Activity,
        /// Why, in words, where there is something to say: why it rests, or makes a plan.
        pub why: Option<String>,
        /// The open goals.
        pub goals: Vec<OpenGoal>,
        /// What is under way.
        pub running: Vec<Running>,
        /// How many plans were taken up so far.
        pub plans: usize,
        /// The facts that are believed to be true.
        pub facts: Vec<String>,
        /// The numbers as they are believed to be.
        pub numbers: Vec<NumberNow>,
        /// Facts and numbers that are in doubt. Until they are known, such a fact counts as false, such a number keeps its
        /// value, and a goal that reads them is not reached.
        pub in_doubt: Vec<InDoubt>,
    }

    /// A fact or a number that is in doubt.
    pub struct InDoubt {
        /// The fact or the number.
        pub name: String,
        /// Since when.
        pub since: Exact,
        /// The reason, and how the doubt can be settled.
        pub why: String,
    }

    /// A goal that is to be reached.
    pub struct OpenGoal {
        /// Its name; that of the problem's own goal is `problem`.
        pub name: String,
        /// The goal, in PDDL.
        pub goal: String,
        /// The reason for which it is set aside while other goals are pursued; none if it is pursued.
        pub aside: Option<String>,
    }

    /// The goals: those that are open, and the last ones that were closed.
    pub struct GoalsNow {
        /// The goals: first those that were closed, then the open ones, each in their order.
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
        /// `pursued`; `set-aside` while others are pursued; `impossible` if no plan exists, or `unplanned` if none was found,
        /// from where the executive rests; `achieved`, `cancelled`, or `failed` if it was not achieved by its deadline.
        pub state: String,
        /// When it was given, by the world's clock; none if an earlier segment of the journal has it.
        pub given: Option<Exact>,
        /// Since when it is in this state.
        pub since: Exact,
        /// The reason for a state other than `pursued` and `achieved`, if it is known.
        pub why: Option<String>,
    }

    /// An action under way.
    pub struct Running {
        /// The number of its start.
        pub ticket: u64,
        /// The action.
        pub action: String,
        /// When it was started.
        pub since: Exact,
        /// How long it was planned to take.
        pub planned: Option<Exact>,
        /// From when on a new plan is needed if it has not ended, once that is near.
        pub needed: Option<Exact>,
        /// When it times out and is cancelled if it has made no progress by then, once that is near.
        pub times_out: Option<Exact>,
        /// The part that is done, from 0 to 1, if the world has said so.
        pub completion: Option<Exact>,
        /// What the world has said last about it.
        pub note: Option<String>,
    }

    /// A number of the problem.
    pub struct NumberNow {
        /// The fluent.
        pub fluent: String,
        /// Its value.
        pub value: Exact,
    }

    /// The plan that is executed.
    pub struct PlanNow {
        /// Its actions, by planned start; none if there is no plan.
        pub steps: Vec<StepNow>,
        /// When it was taken up, by the world's clock.
        pub since: Option<Exact>,
        /// How many plans were taken up so far.
        pub plans: usize,
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
    }

    /// What holds whatever the world does within limits.
    pub struct GuaranteeNow {
        /// The guarantee for the rest of the plan: `envelope`, `part-of-envelope`, `planned` or
        /// `luck`, if the executor makes one.
        pub promise: Option<String>,
        /// Since when.
        pub since: Option<Exact>,
        /// The last thing since it rested that deviated so much that a plan was given up for it.
        pub deviation: Option<String>,
        /// The rule that sets the time-out of each action: `10x,600` is 10 times the planned
        /// duration, at least 600 seconds; `none` if time-outs are off. The promise holds as long as each
        /// quantity stays inside its interval and each action ends before its time-out.
        pub timeout: String,
        /// The quantities that may deviate, and how far.
        pub parameters: Vec<Room>,
    }

    /// How far a quantity may deviate.
    pub struct Room {
        /// Its name.
        pub name: String,
        /// What it is, in words: `duration of (move a b)`.
        pub meaning: String,
        /// Its value if nothing deviates.
        pub nominal: Exact,
        /// The least value that is guaranteed to work; none if nothing is guaranteed: if the promise is neither
        /// `envelope` nor `part-of-envelope`.
        pub least: Option<LowerEnd>,
        /// The greatest one.
        pub most: Option<UpperEnd>,
        /// The time-out of the action whose duration it is; none if it is no duration, or if
        /// time-outs are off.
        pub timeout: Option<Exact>,
    }

    /// What is next, and why.
    pub struct NextNow {
        /// What was decided last: `start`, `wait`, `cancel`, `replan` or `goal-reached`.
        pub decision: Option<String>,
        /// When.
        pub decided: Option<Exact>,
        /// Until when it waits, if nothing happens before.
        pub until: Option<Exact>,
        /// Why, in words.
        pub why: Option<String>,
        /// The next action of the plan that has not been started.
        pub step: Option<StepNow>,
    }

    /// A goal that somebody gives.
    #[serde(deny_unknown_fields)]
    pub struct NewGoal {
        /// Its name; without one, it gets one. The goal of the same name is replaced.
        [optional serde(default)]
        pub name: Option<String>,
        /// The goal, in PDDL, as it stands behind `:goal`.
        pub goal: String,
        /// Its value, a positive number; 1 by default. If not all goals can be reached together, those with the greatest sum of
        /// values are pursued.
        [optional serde(default)]
        pub value: Option<GivenNumber>,
        /// Its deadline on the world's clock. Plans achieve it until then; otherwise it is closed as failed. By default
        /// there is none.
        [optional serde(default)]
        pub deadline: Option<GivenNumber>,
        /// The deadline in seconds from now, in place of `deadline`; a positive number.
        [optional serde(default)]
        pub within: Option<GivenNumber>,
    }

    /// The end of a running action.
    #[serde(deny_unknown_fields)]
    pub struct NewOutcome {
        /// The number of its start.
        pub ticket: u64,
        /// `done` or `failed`, as it was observed; `cancelled` to have the world cancel it.
        pub becomes: String,
    }

    /// A fact as it is from now on.
    #[serde(deny_unknown_fields)]
    pub struct NewFact {
        /// The fact, such as `(at rover depot)`.
        pub fact: String,
        /// Whether it is true.
        pub becomes: bool,
    }

    /// A number as it is from now on.
    #[serde(deny_unknown_fields)]
    pub struct NewNumber {
        /// The fluent, such as `(charge rover)`.
        pub fluent: String,
        /// Its value.
        pub value: GivenNumber,
    }

    /// A problem for the domain that the executive was started with.
    #[serde(deny_unknown_fields)]
    pub struct NewProblem {
        /// The text of the problem file, in PDDL.
        pub problem: String,
    }

    /// A request has come in.
    pub struct Taken {
        /// Whether the executive has taken it in: then it survives a crash if there is a journal.
        pub taken: bool,
        /// What it waits for, in words, if it has not been taken in.
        [optional serde(default, skip_serializing_if = "Option::is_none")]
        pub until: Option<String>,
        /// The name of the goal that the request is about.
        [optional serde(default, skip_serializing_if = "Option::is_none")]
        pub name: Option<String>,
    }

    /// Why a request is refused.
    pub struct Refusal {
        /// What is wrong, in one sentence.
        pub error: String,
        /// What to do about it.
        pub help: String,
    }
}
