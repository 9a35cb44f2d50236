//! Snapshot of a run at the rotation of its record, as a line.

mod plan_adoption;
mod starts;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::run::{Goals, RefusalBackoff, RunPhase, RunSnapshot};
use elbowroom_execution::{ActionHandle, BeliefState, BeliefStateParts, Doubt};
use elbowroom_model::Task;
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::exact::Exact;

pub use plan_adoption::{
    ClosedGoalLine, GoalLine, NewsLine, PendingGoalChangeLine, PlanAdoptionLine,
    SituationActionLine, WaitLine,
};
pub use starts::{RunningActionLine, StartLine};

/// The second line of a rotated record, which replaces all earlier records. Rotation happens when a
/// persistent run is idle or adopts a plan: `docs/reference/formats/journal.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SnapshotLine {
    /// The time.
    pub now: Exact,
    /// Time since which the run has been idle, if it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<Exact>,
    /// `true` if the run is idle because no plan reaches the open goals from this state.
    #[serde(default, skip_serializing_if = "is_false")]
    pub unsolvable: bool,
    /// Number of started actions.
    pub started: usize,
    /// Expected duration of planning.
    pub allowance: Exact,
    /// Number of answers of the world since `answers_since`, to detect a clock that does not
    /// advance.
    pub answers: usize,
    /// Start of the count in `answers`.
    pub answers_since: Exact,
    /// Number of timed initials that have happened.
    pub timed: usize,
    /// Time of the last happening group.
    pub group: Exact,
    /// Truth values of all facts mentioned so far, in order of their first mention.
    pub facts: IndexMap<String, bool>,
    /// Values of all numbers mentioned so far, in order of their first mention.
    pub numbers: IndexMap<String, Option<Exact>>,
    /// Previous truth values of the facts changed by the last happening group.
    pub facts_before: IndexMap<String, bool>,
    /// Previous values of the numbers changed by the last happening group.
    pub numbers_before: IndexMap<String, Option<Exact>>,
    /// Facts that are in doubt; `facts` has their earlier truth values.
    pub doubtful_facts: Vec<DoubtLine>,
    /// Numbers that are in doubt.
    pub doubtful_numbers: Vec<DoubtLine>,
    /// The open goals.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub goals: Vec<GoalLine>,
    /// The goals whose release times have not come, and the goals to keep that are not pursued.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub queued: Vec<GoalLine>,
    /// The last closed goals, by time of closing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub closed: Vec<ClosedGoalLine>,
    /// `true` if the goals have always been those of the problem.
    #[serde(default, skip_serializing_if = "is_false")]
    pub problem_goals: bool,
    /// `true` if the run is paused.
    #[serde(default, skip_serializing_if = "is_false")]
    pub paused: bool,
    /// Number of new plans since the run was last idle.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub replans: usize,
    /// Number of refusals by the world, by action, since the last other event.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub refused: IndexMap<String, u32>,
    /// Time before which no plan is requested because of these refusals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused_until: Option<Exact>,
    /// Started actions that are running or have ended recently.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub starts: Vec<StartLine>,
    /// Actions that are believed to be running.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub under_way: Vec<RunningActionLine>,
    /// The adopted plan, if the run is not idle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<PlanAdoptionLine>,
}

/// A fact or a number that is in doubt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DoubtLine {
    /// Its name.
    pub name: String,
    /// Start of the doubt.
    pub since: Exact,
    /// Ticket of the action whose end was not reported.
    pub ticket: u64,
    /// The name of that action.
    pub action: String,
}

impl DoubtLine {
    fn all(name: &str, doubts: &[Doubt]) -> Vec<Self> {
        let line = |doubt: &Doubt| Self {
            name: name.to_owned(),
            since: Exact(doubt.since.clone()),
            ticket: doubt.ticket.0,
            action: doubt.action.clone(),
        };
        doubts.iter().map(line).collect()
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_false(truth: &bool) -> bool {
    !truth
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_zero(number: &usize) -> bool {
    *number == 0
}

impl SnapshotLine {
    /// Creates the line of a run of this task. Returns `None` if its plan cannot be written as a
    /// line.
    pub fn of(task: &Task, stand: &RunSnapshot) -> Option<Self> {
        let parts = stand.belief.parts();
        let plan = match &stand.phase {
            RunPhase::Idle { .. } => None,
            RunPhase::Adopting(it) => Some(PlanAdoptionLine::of(task, it, &stand.starts)?),
        };
        let since = match &stand.phase {
            RunPhase::Idle { since, .. } => Some(Exact(since.clone())),
            RunPhase::Adopting(_) => None,
        };
        let unsolvable = matches!(
            stand.phase,
            RunPhase::Idle {
                is_unsolvable: true,
                ..
            }
        );
        let facts = (0..task.fact_count()).map(|index| {
            let truth = parts.facts.get(index).copied().unwrap_or(false);
            (task.fact_name(FactId(to_u32(index))), truth)
        });
        let numbers = (0..task.fluent_count()).map(|index| {
            let value = parts.values.get(index).cloned().flatten();
            (task.fluent_name(FluentId(to_u32(index))), value.map(Exact))
        });
        let facts_before = parts.facts_on_arrival.iter();
        let numbers_before = parts.values_on_arrival.iter();
        let doubtful_facts = parts.doubtful_facts.iter();
        let doubtful_numbers = parts.doubtful_values.iter();
        let starts = stand.starts.iter();
        let under_way = parts.running.iter();
        let refused = stand.refusals.times.iter();
        Some(Self {
            now: Exact(parts.time.clone()),
            since,
            unsolvable,
            started: stand.started,
            allowance: Exact(stand.allowance.clone()),
            answers: stand.answers.1,
            answers_since: Exact(stand.answers.0.clone()),
            timed: parts.timed,
            group: Exact(parts.group.clone()),
            facts: facts.collect(),
            numbers: numbers.collect(),
            facts_before: facts_before
                .map(|(fact, truth)| (task.fact_name(*fact), *truth))
                .collect(),
            numbers_before: numbers_before
                .map(|(fluent, value)| (task.fluent_name(*fluent), value.clone().map(Exact)))
                .collect(),
            doubtful_facts: doubtful_facts
                .flat_map(|(fact, doubts)| DoubtLine::all(&task.fact_name(*fact), doubts))
                .collect(),
            doubtful_numbers: doubtful_numbers
                .flat_map(|(fluent, doubts)| DoubtLine::all(&task.fluent_name(*fluent), doubts))
                .collect(),
            goals: plan_adoption::goal_lines(&stand.goals.open),
            queued: plan_adoption::goal_lines(&stand.queued),
            closed: Vec::new(),
            problem_goals: !stand.goals.are_changed,
            paused: stand.is_paused,
            replans: stand.replans,
            refused: refused
                .map(|(name, times)| (name.clone(), *times))
                .collect(),
            refused_until: (!stand.refusals.times.is_empty())
                .then(|| Exact(stand.refusals.until.clone())),
            starts: starts.map(|it| StartLine::of(task, it)).collect(),
            under_way: under_way
                .map(|(ticket, it)| RunningActionLine::of(*ticket, it))
                .collect(),
            plan,
        })
    }

    /// Returns the state of the run. Facts and numbers get their former positions in the table of
    /// the task, so that decisions that depend on their order stay the same.
    ///
    /// # Errors
    /// A message if the task lacks some of these facts, numbers or actions, or has others before
    /// them.
    pub fn restored(&self, task: &Arc<Task>) -> Result<RunSnapshot, String> {
        for (index, name) in self.facts.keys().enumerate() {
            if fact(task, name)? != FactId(to_u32(index)) {
                return Err(position_error(name));
            }
        }
        for (index, name) in self.numbers.keys().enumerate() {
            if fluent(task, name)? != FluentId(to_u32(index)) {
                return Err(position_error(name));
            }
        }
        if self.timed > task.timed().len() {
            return Err("the problem has fewer timed initials".to_owned());
        }
        let value = |value: &Option<Exact>| value.as_ref().map(|it| it.0.clone());
        let facts_before = self.facts_before.iter();
        let numbers_before = self.numbers_before.iter();
        let starts = self.starts.iter().map(|it| it.start(task));
        let starts = starts.collect::<Result<Vec<_>, String>>()?;
        let parts = BeliefStateParts {
            time: self.now.0.clone(),
            group: self.group.0.clone(),
            facts: self.facts.values().copied().collect(),
            values: self.numbers.values().map(value).collect(),
            facts_on_arrival: facts_before
                .map(|(name, truth)| Ok((fact(task, name)?, *truth)))
                .collect::<Result<_, String>>()?,
            values_on_arrival: numbers_before
                .map(|(name, before)| Ok((fluent(task, name)?, value(before))))
                .collect::<Result<_, String>>()?,
            doubtful_facts: doubts(&self.doubtful_facts, |name| fact(task, name))?,
            doubtful_values: doubts(&self.doubtful_numbers, |name| fluent(task, name))?,
            timed: self.timed,
            running: self
                .under_way
                .iter()
                .map(RunningActionLine::parts)
                .collect(),
        };
        let doing = match (&self.plan, &self.since) {
            (Some(plan), _) => RunPhase::Adopting(Box::new(plan.to_plan_adoption(task, &starts)?)),
            (None, Some(since)) => RunPhase::Idle {
                since: since.0.clone(),
                is_unsolvable: self.unsolvable,
            },
            (None, None) => {
                return Err(
                    "it has neither a plan nor the time since which there is none".to_owned(),
                );
            }
        };
        let action = |ticket: ActionHandle| starts::action_of(&starts, ticket).cloned();
        for (ticket, running) in &parts.running {
            let action = action(*ticket)
                .ok_or_else(|| format!("{ticket} is running, but was not started"))?;
            if !running.guards.fit(&action) {
                return Err(format!(
                    "the effects of {ticket} differ from {}",
                    action.name
                ));
            }
        }
        let refused = self.refused.iter();
        Ok(RunSnapshot {
            belief: BeliefState::from_parts(Arc::clone(task), parts, action),
            started: self.started,
            starts,
            allowance: self.allowance.0.clone(),
            answers: (self.answers_since.0.clone(), self.answers),
            replans: self.replans,
            refusals: RefusalBackoff {
                times: refused
                    .map(|(name, times)| (name.clone(), *times))
                    .collect(),
                until: self
                    .refused_until
                    .as_ref()
                    .map(|it| it.0.clone())
                    .unwrap_or_default(),
            },
            goals: Goals {
                open: plan_adoption::goals_of(&self.goals),
                are_changed: !self.problem_goals,
            },
            queued: plan_adoption::goals_of(&self.queued),
            is_paused: self.paused,
            phase: doing,
        })
    }

    /// Returns the names of the goals.
    pub fn goal_names(&self) -> impl Iterator<Item = &str> {
        let open = self.goals.iter().chain(&self.queued);
        let open = open.map(|goal| goal.name.as_str());
        open.chain(self.closed.iter().map(|goal| goal.name.as_str()))
    }

    /// The time.
    pub fn now(&self) -> &Rational {
        &self.now.0
    }
}

fn fact(task: &Task, name: &str) -> Result<FactId, String> {
    let known = task.fact_named(name);
    known.ok_or_else(|| format!("the problem has no fact `{name}`"))
}

fn fluent(task: &Task, name: &str) -> Result<FluentId, String> {
    let known = task.fluent_named(name);
    known.ok_or_else(|| format!("the problem has no number `{name}`"))
}

fn doubts<T: Ord>(
    lines: &[DoubtLine],
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<BTreeMap<T, Vec<Doubt>>, String> {
    let mut doubts: BTreeMap<T, Vec<Doubt>> = BTreeMap::new();
    for line in lines {
        let doubt = Doubt {
            since: line.since.0.clone(),
            ticket: ActionHandle(line.ticket),
            action: line.action.clone(),
        };
        doubts.entry(read(&line.name)?).or_default().push(doubt);
    }
    Ok(doubts)
}

fn position_error(name: &str) -> String {
    format!("`{name}` has another position in the problem")
}

fn to_u32(index: usize) -> u32 {
    u32::try_from(index).expect("fewer than 2^32 facts and fluents")
}
