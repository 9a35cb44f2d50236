//! Validation of a run from its record: [`Validation`].
//!
//! `model::validate` has no notion of executors, commands and reports. This module translates the entries of a record
//! into the events of an [`Execution`]. Reports that are late, repeated or contradictory follow the rules of
//! [`Run`](elbowroom_execution::run::Run). Each entry is processed when it is recorded, in a live run or in a replay.
//! The memory needed does not grow with the length of the run.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use elbowroom_execution::run::{GivenGoal, GoalReader, PROBLEM_GOAL_NAME, RunSnapshot, Verdict};
use elbowroom_execution::{
    ActionHandle, BeliefState, Command, Ending, Entry, Event, GoalChange, Measured, Observation,
    Request,
};
use elbowroom_model::ground::{Action, Body, Condition};
use elbowroom_model::validate::{Execution, MeasuredAmount, Violation};
use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::{Interval, Rational};

/// Findings beyond this number are only counted.
const MAX_LISTED_FINDINGS: usize = 20;

/// Number of ended starts that are remembered, to recognise contradictory reports about them.
const MAX_ENDED_STARTS: usize = 1000;

/// Reason for an invalid run: a bug of the executor, not a failure of the world.
#[derive(Clone, Debug, PartialEq)]
pub enum Invalid {
    /// A start whose conditions or duration bounds did not hold in the state at the command, or which interferes
    /// with a happening less than ε ago.
    Start(Violation),
    /// The run reports the goal as reached, but the goal does not hold at the end.
    NotReached {
        /// The time of the report.
        time: Rational,
        /// The parts of the goal that do not hold.
        unmet: Vec<String>,
    },
    /// The run reports the goal as reached while an action is running.
    StillRunning {
        /// The time of the report.
        time: Rational,
    },
    /// The run reports that no plan reaches the goal, but the goal holds.
    Reached {
        /// The time of the report.
        time: Rational,
    },
    /// The run reports that the deadline of a goal has passed, but it has not, or there is none.
    NotLate {
        /// The time of the report.
        time: Rational,
        /// The name of the goal.
        name: String,
    },
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = |time: &Rational| time.to_decimal(3);
        match self {
            Self::Start(violation) => write!(f, "{violation}"),
            Self::NotReached { time, unmet } => {
                let unmet = unmet.join(" and ");
                write!(
                    f,
                    "at {}: the run reports the goal as reached, but {unmet} does not hold",
                    at(time)
                )
            }
            Self::StillRunning { time } => {
                write!(
                    f,
                    "at {}: the run reports the goal as reached while an action is running",
                    at(time)
                )
            }
            Self::Reached { time } => {
                write!(
                    f,
                    "at {}: the run reports that no plan exists, but the goal holds",
                    at(time)
                )
            }
            Self::NotLate { time, name } => {
                write!(
                    f,
                    "at {}: the run reports that the deadline of `{name}` has passed, but it has not",
                    at(time)
                )
            }
        }
    }
}

/// Validates a run entry by entry.
pub struct Validation<'a> {
    task: Arc<Task>,
    execution: Execution,
    reader: Box<dyn GoalReader + 'a>,
    /// The open goals.
    goals: Vec<Goal>,
    starts: BTreeMap<ActionHandle, Start>,
    /// Number of starts that have ended.
    ended: usize,
    now: Rational,
    found: Vec<Invalid>,
    count: usize,
}

/// An open goal.
struct Goal {
    name: String,
    condition: Condition,
    deadline: Option<Rational>,
    /// `true` until its release time, and for a goal to keep that is not pursued.
    is_queued: bool,
    /// `true` if it is to be kept.
    is_to_keep: bool,
}

/// A start that was commanded.
#[derive(Clone, Debug)]
struct Start {
    action: Arc<Action>,
    commanded: Rational,
    has_started: bool,
    /// `Some(true)` if it ended with its end effects; `None` if it has not ended.
    ended: Option<bool>,
}

impl<'a> Validation<'a> {
    /// Creates the validation of a new run of `task`. `reader` reads goals that are given during the run.
    pub fn new(task: &Arc<Task>, reader: impl GoalReader + 'a) -> Self {
        let goal = Goal {
            name: PROBLEM_GOAL_NAME.to_owned(),
            condition: task.goal().clone(),
            deadline: None,
            is_queued: false,
            is_to_keep: false,
        };
        let goals = Some(goal).filter(|goal| !goal.condition.is_trivial());
        Self {
            execution: Execution::new(task),
            task: Arc::clone(task),
            reader: Box::new(reader),
            goals: goals.into_iter().collect(),
            starts: BTreeMap::new(),
            ended: 0,
            now: Rational::ZERO,
            found: Vec::new(),
            count: 0,
        }
    }

    /// Continues from `stand` instead of the beginning of the run.
    #[must_use]
    pub fn resume_from(mut self, stand: &RunSnapshot) -> Self {
        if stand.goals.are_changed {
            let open = stand.goals.open.iter();
            self.goals = open.filter_map(|it| self.goal(it, false)).collect();
        }
        let queued = stand.queued.iter();
        let queued: Vec<Goal> = queued.filter_map(|it| self.goal(it, true)).collect();
        self.goals.extend(queued);
        let (situation, running) = situation(&stand.belief);
        let numbers: Vec<u64> = running.iter().map(|ticket| ticket.0).collect();
        self.execution = Execution::from(&self.task, &situation, &numbers);
        self.now = situation.time;
        for known in &stand.starts {
            let is_running = stand.belief.running().contains_key(&known.ticket);
            let start = Start {
                action: Arc::clone(&known.action),
                commanded: known.commanded.clone(),
                has_started: known.started.is_some(),
                ended: (known.ended.as_ref()).map(|(_, ending)| *ending == Ending::Succeeded),
            };
            if start.ended.is_none() && !is_running {
                let planned = known.planned.clone();
                self.execution
                    .expect(known.ticket.0, &known.action, planned);
            }
            self.ended += usize::from(start.ended.is_some());
            self.starts.insert(known.ticket, start);
        }
        self
    }

    /// Returns the first findings in the run so far.
    pub fn findings(&self) -> &[Invalid] {
        &self.found
    }

    /// Returns the number of findings so far.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Processes the next entry of the record.
    pub fn process_entry(&mut self, entry: &Entry<'_>) {
        match entry {
            Entry::Passed { now, .. } | Entry::Looked { now, .. } => {
                // The reports about this period follow as entries. The execution advances after them.
                self.now = (*now).clone().max(self.now.clone());
            }
            Entry::Taken {
                now,
                observation,
                remark,
                ..
            } => {
                self.now = (*now).clone().max(self.now.clone());
                self.process_observation(observation, *remark);
            }
            Entry::Command { now, command, .. } => {
                self.advance(now);
                self.command(command);
            }
            Entry::Decided { now, .. }
            | Entry::Planning { now, .. }
            | Entry::Kept { now, .. }
            | Entry::Warning { now, .. }
            | Entry::WorldFailed { now, .. }
            | Entry::Interrupted { now } => self.advance(now),
            Entry::Goal { now, name, change } => {
                self.advance(now);
                self.change_goal(name, *change);
            }
            Entry::Resting { now, verdict, .. } => {
                self.advance(now);
                if let Some(verdict) = verdict {
                    self.check_verdict(verdict);
                }
            }
            Entry::Over(report) => {
                self.advance(&report.time);
                self.check_verdict(&report.verdict);
            }
            Entry::PlanAdopted(_) | Entry::Planned { .. } => {}
        }
    }

    fn advance(&mut self, now: &Rational) {
        self.now = now.clone().max(self.now.clone());
        let now = self.now.clone();
        self.execution.advance(&now);
    }

    fn record_finding(&mut self, invalid: Invalid) {
        self.count += 1;
        if self.found.len() < MAX_LISTED_FINDINGS {
            self.found.push(invalid);
        }
    }

    fn command(&mut self, command: &Command) {
        match command {
            Command::Start {
                ticket,
                action,
                duration,
            } => {
                let start = Start {
                    action: Arc::clone(action),
                    commanded: self.now.clone(),
                    has_started: false,
                    ended: None,
                };
                self.starts.insert(*ticket, start);
                let judged = self.execution.command(ticket.0, action, duration.as_ref());
                if let Err(violation) = judged {
                    self.record_finding(Invalid::Start(*violation));
                }
            }
            Command::Cancel { ticket } => self.execution.cancel(ticket.0),
        }
    }

    fn process_observation(&mut self, observation: &Observation, remark: Option<&str>) {
        let time = observation.time.clone().min(self.now.clone());
        match &observation.event {
            Event::Started { ticket, measured } => self.process_start(*ticket, &time, measured),
            Event::Ended {
                ticket,
                ending,
                measured,
            } => {
                self.process_end(*ticket, &time, *ending == Ending::Succeeded, measured);
            }
            Event::Fact { fact, truth } => self.execution.observe_fact(&time, *fact, *truth),
            Event::Value { fluent, value } => self.execution.observe_value(&time, *fluent, value),
            // A request with a remark was ignored.
            Event::Requested(request) if remark.is_none() => self.process_request(request),
            Event::Requested(_)
            | Event::Feedback { .. }
            | Event::PlanMade
            | Event::PlanReady
            | Event::Unintelligible { .. } => {}
        }
    }

    fn process_start(&mut self, ticket: ActionHandle, time: &Rational, measured: &[Measured]) {
        let Some(start) = self.starts.get_mut(&ticket) else {
            return;
        };
        if start.has_started || start.ended.is_some() {
            return;
        }
        start.has_started = true;
        let is_over = matches!(start.action.body, Body::Instantaneous(_));
        let time = time.clone().max(start.commanded.clone());
        self.execution.start(ticket.0, &time, &amounts(measured));
        if is_over {
            self.close(ticket, true);
        }
    }

    fn process_end(
        &mut self,
        ticket: ActionHandle,
        time: &Rational,
        succeeded: bool,
        measured: &[Measured],
    ) {
        let Some(start) = self.starts.get(&ticket) else {
            return;
        };
        if let Some(earlier) = start.ended {
            if earlier != succeeded {
                let action = Arc::clone(&start.action);
                self.execution.mark_contradicted(&action);
            }
            return;
        }
        let commanded = start.commanded.clone();
        if !start.has_started && succeeded {
            self.process_start(ticket, &commanded, &[]);
        }
        if self.starts.get(&ticket).is_none_or(|it| it.ended.is_some()) {
            return;
        }
        let time = time.clone().max(commanded);
        if succeeded {
            self.execution.end(ticket.0, &time, &amounts(measured));
        } else {
            self.execution.stop(ticket.0, &time);
        }
        self.close(ticket, succeeded);
    }

    /// Records the end of an action, and drops the earliest of too many ended ones.
    fn close(&mut self, ticket: ActionHandle, succeeded: bool) {
        if let Some(start) = self.starts.get_mut(&ticket) {
            start.ended = Some(succeeded);
            self.ended += 1;
        }
        if self.ended >= 2 * MAX_ENDED_STARTS {
            let mut surplus = self.ended - MAX_ENDED_STARTS;
            self.starts.retain(|_, start| {
                let is_forgotten = surplus > 0 && start.ended.is_some();
                surplus -= usize::from(is_forgotten);
                !is_forgotten
            });
            self.ended = MAX_ENDED_STARTS;
        }
    }

    fn process_request(&mut self, request: &Request) {
        match request {
            Request::Pursue { name, goal, terms } => {
                let Some(condition) = self.read(goal) else {
                    return;
                };
                let given = Goal {
                    name: name.clone(),
                    condition,
                    deadline: terms.deadline.clone(),
                    is_queued: terms.keep
                        || terms.release.as_ref().is_some_and(|it| *it > self.now),
                    is_to_keep: terms.keep,
                };
                match self.goals.iter_mut().find(|known| known.name == *name) {
                    Some(known) => *known = given,
                    None => self.goals.push(given),
                }
            }
            Request::Abandon { name } => self.goals.retain(|known| known.name != *name),
            Request::CancelAction { .. } | Request::Pause | Request::Resume => {}
        }
    }

    /// Returns a goal of a snapshot.
    fn goal(&self, given: &GivenGoal, is_queued: bool) -> Option<Goal> {
        Some(Goal {
            name: given.name.clone(),
            condition: match &given.text {
                None => self.task.goal().clone(),
                Some(text) => self.read(text)?,
            },
            deadline: given.terms.deadline.clone(),
            is_queued,
            is_to_keep: given.terms.keep,
        })
    }

    fn read(&self, goal: &str) -> Option<Condition> {
        let condition = self.reader.read(&self.task, goal).ok()?;
        Some(self.task.with_goal(condition).goal().clone())
    }

    /// Compares a change of a goal with the state.
    fn change_goal(&mut self, name: &str, change: GoalChange<'_>) {
        let Some(index) = self.goals.iter().position(|known| known.name == name) else {
            return;
        };
        match change {
            GoalChange::Achieved | GoalChange::Failed { .. } => {}
            GoalChange::SetAside { .. } => return,
            GoalChange::Pursued | GoalChange::Released => {
                self.goals[index].is_queued = false;
                return;
            }
            GoalChange::Queued { .. } | GoalChange::Kept => {
                self.goals[index].is_queued = true;
                let goals = [&self.goals[index].condition];
                let unmet = match change {
                    GoalChange::Kept => self.unmet(goals, Execution::holds),
                    _ => Vec::new(),
                };
                if !unmet.is_empty() {
                    let time = self.now.clone();
                    self.record_finding(Invalid::NotReached { time, unmet });
                }
                return;
            }
        }
        let goal = self.goals.remove(index);
        let time = self.now.clone();
        if change != GoalChange::Achieved {
            if goal.deadline.is_none_or(|deadline| time < deadline) {
                let name = goal.name;
                self.record_finding(Invalid::NotLate { time, name });
            }
            return;
        }
        let unmet = self.unmet([&goal.condition], Execution::holds);
        if !unmet.is_empty() {
            self.record_finding(Invalid::NotReached { time, unmet });
        }
    }

    /// Returns the parts of goals that do not hold, in words.
    fn unmet<'g>(
        &self,
        goals: impl IntoIterator<Item = &'g Condition>,
        holds: impl Fn(&Execution, &Condition) -> Option<bool>,
    ) -> Vec<String> {
        let parts = goals.into_iter().flat_map(Condition::conjuncts);
        let unmet = parts.filter(|part| holds(&self.execution, part) == Some(false));
        let unmet = unmet.map(|part| self.task.describe_condition(part));
        unmet.collect()
    }

    /// Compares a verdict of the run with the state. Goals that are reported as reached are closed.
    fn check_verdict(&mut self, verdict: &Verdict) {
        let time = self.now.clone();
        match verdict {
            Verdict::GoalReached => {
                let is_open = |goal: &mut Goal| !goal.is_queued;
                let goals: Vec<Goal> = self.goals.extract_if(.., is_open).collect();
                let unmet = self.unmet(
                    goals.iter().map(|goal| &goal.condition),
                    Execution::reaches_goal,
                );
                let kept = goals.into_iter().filter(|goal| goal.is_to_keep);
                self.goals.extend(kept.map(|goal| Goal {
                    is_queued: true,
                    ..goal
                }));
                if !unmet.is_empty() {
                    self.record_finding(Invalid::NotReached { time, unmet });
                } else if !self.execution.is_idle() {
                    self.record_finding(Invalid::StillRunning { time });
                }
            }
            Verdict::Unsolvable => {
                let mut goals = self.goals.iter().filter(|goal| !goal.is_queued).peekable();
                let has_goals = goals.peek().is_some();
                let holds =
                    goals.all(|goal| self.execution.reaches_goal(&goal.condition) == Some(true));
                if holds && has_goals && self.execution.is_idle() {
                    self.record_finding(Invalid::Reached { time });
                }
            }
            Verdict::NoPlan { .. }
            | Verdict::PlannerFailed { .. }
            | Verdict::ReplanLimit
            | Verdict::TimeLimit
            | Verdict::Interrupted
            | Verdict::WorldFailed { .. } => {}
        }
    }
}

/// Returns a belief as a situation, and the tickets of its running actions in the same order.
fn situation(belief: &BeliefState) -> (Situation, Vec<ActionHandle>) {
    let running = belief.running().iter();
    let running = running.map(|(ticket, underway)| {
        let planned = Interval::point(underway.planned.clone());
        (*ticket, belief.running_action(underway, planned))
    });
    let (tickets, running): (Vec<ActionHandle>, Vec<RunningAction>) = running.unzip();
    let situation = Situation {
        time: belief.time().clone(),
        state: belief.state(),
        running,
    };
    (situation, tickets)
}

fn amounts(measured: &[Measured]) -> Vec<MeasuredAmount> {
    let measured = measured.iter();
    measured.map(|it| (it.fluent, it.amount.clone())).collect()
}
