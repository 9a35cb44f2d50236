//! Adopted plan in a snapshot.

use elbowroom_execution::run::{GivenGoal, Goals, KnownStart, PlanAdoption, Wait};
use elbowroom_execution::{ActionHandle, GoalTerms, Guards, PlanEvent};
use elbowroom_model::{RunningAction, Situation, State, Task};
use elbowroom_num::Interval;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::super::encode::steps;
use super::super::replay::read_plan;
use super::super::schema::{StepLine, TermsLine};
use super::starts::{action_of, exact};
use super::{fact, fluent};
use crate::exact::Exact;

/// An adopted plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanAdoptionLine {
    /// Its actions, on the world's clock; running ones come first.
    pub steps: Vec<StepLine>,
    /// Time of its initial state.
    pub time: Exact,
    /// True facts of its initial state.
    pub facts: Vec<String>,
    /// Numbers of its initial state.
    pub numbers: IndexMap<String, Exact>,
    /// Running actions of its initial state.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub under_way: Vec<SituationActionLine>,
    /// Tickets of the plan's actions that have been started since.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub begun: Vec<u64>,
    /// The goals of the plan.
    pub goals: Vec<GoalLine>,
    /// `true` if these are the goals of the problem.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub problem_goals: bool,
    /// Events that the plan does not account for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub news: Vec<NewsLine>,
    /// Change of the goals since the plan was requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<PendingGoalChangeLine>,
}

/// A running action in the initial state of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SituationActionLine {
    /// Ticket of its start.
    pub ticket: u64,
    /// The start time.
    pub start: Exact,
    /// Expected duration.
    pub duration: Exact,
    /// For each end effect of the action, `true` if it can still take place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub end_effects: Vec<bool>,
    /// For each continuous effect, `true` if it is active.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub continuous: Vec<bool>,
}

/// A goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalLine {
    /// Its name.
    pub name: String,
    /// The goal in PDDL, as given; `None` for the goal of the problem.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<String>,
    /// Its value, if it is not 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<Exact>,
    /// Its deadline on the world's clock, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deadline: Option<Exact>,
    /// The time before which it is not pursued, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub release: Option<Exact>,
    /// `true` for a goal to keep.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub keep: bool,
    /// Name of the client that has given it, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<String>,
    /// The time at which it was given, for clients; the run does not read it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub given: Option<Exact>,
    /// The reason for which it is set aside while others are pursued; `None` if it is pursued.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aside: Option<String>,
    /// Lateness in words; left out if its deadline is not known to be missed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub late: Option<String>,
    /// The reason for which it is queued; left out unless it is to be kept and was evaluated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waits: Option<WaitLine>,
}

/// Reason for which a goal to keep is queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WaitLine {
    /// It holds.
    Holds,
    /// It does not hold; other goals are pursued first.
    Others,
    /// No plan reaches it together with the other goals to keep.
    Conflict,
}

impl WaitLine {
    fn of(wait: Wait) -> Option<Self> {
        match wait {
            Wait::Release => None,
            Wait::Holds => Some(Self::Holds),
            Wait::Others => Some(Self::Others),
            Wait::Conflict => Some(Self::Conflict),
        }
    }

    fn wait(self) -> Wait {
        match self {
            Self::Holds => Wait::Holds,
            Self::Others => Wait::Others,
            Self::Conflict => Wait::Conflict,
        }
    }
}

/// A closed goal, for clients. The run does not read it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosedGoalLine {
    /// Its name.
    pub name: String,
    /// The goal in PDDL.
    pub goal: String,
    /// Its value.
    pub value: Exact,
    /// Its deadline on the world's clock, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deadline: Option<Exact>,
    /// Its release time, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub release: Option<Exact>,
    /// `true` for a goal to keep.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub keep: bool,
    /// Name of the client that has given it, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<String>,
    /// Its final state: `achieved`, `cancelled` or `failed`.
    pub state: String,
    /// The time at which it was given, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub given: Option<Exact>,
    /// The time at which it was closed.
    pub since: Exact,
    /// The reason for another state than `achieved`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// Event that a plan does not account for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NewsLine {
    /// A fact differs from the belief.
    Fact(String),
    /// A number differs from the belief.
    Number(String),
    /// Reports on this action contradict each other.
    Contradiction(String),
}

/// A change of the goals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PendingGoalChangeLine {
    /// Description of the change.
    pub words: String,
    /// `true` if goals were only added.
    pub only_more: bool,
}

pub(super) fn goal_lines(goals: &[GivenGoal]) -> Vec<GoalLine> {
    let lines = goals.iter().map(|given| {
        let TermsLine {
            value,
            deadline,
            release,
            keep,
            by,
        } = TermsLine::of(&given.terms);
        GoalLine {
            name: given.name.clone(),
            goal: given.text.clone(),
            value,
            deadline,
            release,
            keep,
            by,
            given: None,
            aside: given.set_aside.clone(),
            late: given.missed_deadline.clone(),
            waits: WaitLine::of(given.wait),
        }
    });
    lines.collect()
}

impl GoalLine {
    /// Returns the terms of the goal.
    pub fn terms(&self) -> GoalTerms {
        let terms = TermsLine {
            value: self.value.clone(),
            deadline: self.deadline.clone(),
            release: self.release.clone(),
            keep: self.keep,
            by: self.by.clone(),
        };
        terms.terms()
    }
}

pub(super) fn goals_of(lines: &[GoalLine]) -> Vec<GivenGoal> {
    let goals = lines.iter().map(|line| GivenGoal {
        name: line.name.clone(),
        text: line.goal.clone(),
        terms: line.terms(),
        set_aside: line.aside.clone(),
        missed_deadline: line.late.clone(),
        wait: line.waits.map(WaitLine::wait).unwrap_or_default(),
    });
    goals.collect()
}

impl PlanAdoptionLine {
    pub(super) fn of(task: &Task, it: &PlanAdoption, starts: &[KnownStart]) -> Option<Self> {
        let state = &it.situation.state;
        let under_way = it.situation.running.iter().zip(&it.running);
        let numbers = state.values.iter();
        Some(Self {
            steps: steps(&it.plan),
            time: exact(&it.situation.time),
            facts: state.facts.iter().map(|it| task.fact_name(*it)).collect(),
            numbers: numbers
                .map(|(fluent, value)| (task.fluent_name(*fluent), exact(value)))
                .collect(),
            under_way: under_way
                .map(|(running, ticket)| SituationActionLine::of(running, *ticket, starts))
                .collect::<Option<_>>()?,
            begun: it.begun_steps.iter().map(|it| it.0).collect(),
            goals: goal_lines(&it.goals.open),
            problem_goals: !it.goals.are_changed,
            news: it
                .plan_events
                .iter()
                .map(|it| NewsLine::of(task, it))
                .collect::<Option<_>>()?,
            turn: it
                .pending_goal_change
                .clone()
                .map(|(words, only_more)| PendingGoalChangeLine { words, only_more }),
        })
    }

    pub(super) fn to_plan_adoption(
        &self,
        task: &Task,
        starts: &[KnownStart],
    ) -> Result<PlanAdoption, String> {
        let facts = self.facts.iter().map(|name| fact(task, name));
        let values = self.numbers.iter();
        let values = values.map(|(name, value)| Ok((fluent(task, name)?, value.0.clone())));
        let running = self.under_way.iter().map(|it| it.running(starts));
        let situation = Situation {
            time: self.time.0.clone(),
            state: State {
                facts: facts.collect::<Result<_, _>>()?,
                values: values.collect::<Result<_, String>>()?,
            },
            running: running.collect::<Result<_, _>>()?,
        };
        let plan = read_plan(&self.steps, task, Some(&situation), 2);
        let news = self.news.iter().map(|it| it.news(task));
        Ok(PlanAdoption {
            plan: plan.map_err(|error| error.message)?,
            situation,
            running: self
                .under_way
                .iter()
                .map(|it| ActionHandle(it.ticket))
                .collect(),
            begun_steps: self.begun.iter().copied().map(ActionHandle).collect(),
            goals: Goals {
                open: goals_of(&self.goals),
                are_changed: !self.problem_goals,
            },
            plan_events: news.collect::<Result<_, _>>()?,
            pending_goal_change: self.turn.clone().map(|it| (it.words, it.only_more)),
        })
    }
}

impl SituationActionLine {
    fn of(running: &RunningAction, ticket: ActionHandle, starts: &[KnownStart]) -> Option<Self> {
        let guards = Guards::of(action_of(starts, ticket)?, running)?;
        let duration = running.duration.lower.value()?;
        let is_point = running.duration == Interval::point(duration.clone());
        is_point.then(|| Self {
            ticket: ticket.0,
            start: exact(&running.start),
            duration: exact(duration),
            end_effects: guards.at_end,
            continuous: guards.continuous,
        })
    }

    fn running(&self, starts: &[KnownStart]) -> Result<RunningAction, String> {
        let ticket = ActionHandle(self.ticket);
        let action = action_of(starts, ticket);
        let action =
            action.ok_or_else(|| format!("the plan continues {ticket}, which was not started"))?;
        let guards = Guards {
            at_end: self.end_effects.clone(),
            continuous: self.continuous.clone(),
        };
        let duration = Interval::point(self.duration.0.clone());
        Ok(guards.running(action, self.start.0.clone(), duration))
    }
}

impl NewsLine {
    fn of(task: &Task, news: &PlanEvent) -> Option<Self> {
        match news {
            PlanEvent::Fact(fact) => Some(Self::Fact(task.fact_name(*fact))),
            PlanEvent::Value(fluent) => Some(Self::Number(task.fluent_name(*fluent))),
            PlanEvent::Contradiction { action } => Some(Self::Contradiction(action.clone())),
            // Events about steps of an earlier plan are irrelevant for a new one.
            PlanEvent::Started { .. } | PlanEvent::Ended { .. } | PlanEvent::TimedOut { .. } => {
                None
            }
        }
    }

    fn news(&self, task: &Task) -> Result<PlanEvent, String> {
        Ok(match self {
            Self::Fact(name) => PlanEvent::Fact(fact(task, name)?),
            Self::Number(name) => PlanEvent::Value(fluent(task, name)?),
            Self::Contradiction(action) => {
                let action = action.clone();
                PlanEvent::Contradiction { action }
            }
        })
    }
}
