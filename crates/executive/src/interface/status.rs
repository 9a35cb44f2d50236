//! State of a run, for clients of an executive.

mod ended;
mod fork;
mod goals;
mod history;
mod idle;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom::execution::run::{PROBLEM_GOAL_NAME, TimeoutRule, Verdict};
use elbowroom::execution::{
    ActionHandle, BeliefState, Cause, Command, Decided, Decision, Doubt, Entry, Event, GoalTerms,
    GuaranteeLevel, Observation, PreparedPlan, Request, StepId, WarningCause,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::pddl::{ProblemText, write_problem};
use elbowroom::plan::{InstanceId, ParameterId, ParameterKind};
use elbowroom::report::exact::Exact;
use elbowroom::report::trace::SnapshotLine;

use super::documents::{
    Activity, GoalNow, GoalsNow, GuaranteeNow, InDoubt, LowerEnd, NextNow, NumberNow, PlanNow,
    Room, Running, State, StepNow, UpperEnd,
};
use ended::EndedActions;
use goals::GoalList;
pub(crate) use history::SegmentHistory;

/// Follows a persistent run by its record. Clones share the state. Requests are answered at once
/// and do not block the run, because names are computed from a copy of the belief state.
#[derive(Clone)]
pub struct Status(Arc<Mutex<StatusData>>);

#[derive(Clone, Default)]
struct StatusData {
    timeout: TimeoutRule,
    /// The source of the durations of plans: `domain` or `believed`.
    durations: &'static str,
    now: Rational,
    is_planning: bool,
    is_paused: bool,
    is_over: bool,
    /// The reason why the state is outdated, if it is.
    outdated_reason: Option<&'static str>,
    /// The reason why the executive is idle, if it is.
    idle_reason: Option<String>,
    /// The reason for making a plan.
    planning_reason: Option<String>,
    goals: GoalList,
    /// The goals at the beginning of the run.
    first_goals: GoalList,
    running: BTreeMap<u64, Running>,
    /// The tickets of running actions whose start was reported.
    started: BTreeSet<u64>,
    plans: usize,
    steps: Vec<StepNow>,
    ended: EndedActions,
    since: Option<Rational>,
    parameters: Vec<Room>,
    promise: Option<(GuaranteeLevel, Rational)>,
    deviation: Option<String>,
    decided: Option<(Rational, Decided)>,
    belief: Option<Arc<BeliefState>>,
}

impl Status {
    /// Creates the status of a run that has not begun. `timeout` is the rule for the time-outs of
    /// actions.
    pub fn new(task: &Task, timeout: TimeoutRule) -> Self {
        let mut goals = GoalList::default();
        if !task.problem().goal.is_trivial() {
            let goal = goal_text(task);
            goals.add(
                (PROBLEM_GOAL_NAME, &goal),
                &GoalTerms::default(),
                &Rational::ZERO,
            );
        }
        let durations = if task.has_expected_durations() {
            "believed"
        } else {
            "domain"
        };
        let known = StatusData {
            timeout,
            durations,
            first_goals: goals.clone(),
            goals,
            ..StatusData::default()
        };
        Self(Arc::new(Mutex::new(known)))
    }

    fn lock(&self) -> MutexGuard<'_, StatusData> {
        // Each update is complete or has no effect, so a poisoned lock is ignored.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Updates the state with an entry of the record.
    pub fn record(&self, entry: &Entry<'_>) {
        self.lock().record(entry);
    }

    /// Sets the state to the snapshot of an earlier run, which the run continues.
    pub fn begin_at(&self, snapshot: &SnapshotLine) {
        self.lock().begin_at(snapshot);
    }

    /// Updates the belief state.
    pub fn set_belief(&self, belief: &BeliefState) {
        let belief = Arc::new(belief.clone());
        self.lock().belief = Some(belief);
    }

    /// Returns the names of the open goals.
    pub fn goals(&self) -> Vec<String> {
        let goals = self.lock().goals.open();
        goals.into_iter().map(|goal| goal.name).collect()
    }

    /// Returns the open goals, and the most recently closed ones.
    pub fn all_goals(&self) -> GoalsNow {
        self.lock().goals.all()
    }

    /// Returns the open goal of that name, or otherwise the last closed one.
    pub fn goal(&self, name: &str) -> Option<GoalNow> {
        self.lock().goals.find(name)
    }

    /// Adds what only clients need to the snapshot of a new segment of the journal: the most recently closed goals, and
    /// the times at which the open ones were given.
    pub fn complete(&self, snapshot: &mut SnapshotLine) {
        self.lock().goals.complete(snapshot);
    }

    /// Returns the present state. Its facts and numbers include timed initials and continuous
    /// effects since the last entry of the record.
    pub fn state(&self) -> State {
        let (mut state, belief) = {
            let known = self.lock();
            (known.state(), known.belief.clone())
        };
        if let Some(belief) = belief {
            let mut belief = BeliefState::clone(&belief);
            // Timed initials and continuous effects since the last entry. A number that cannot be
            // computed keeps its value.
            let _ = belief.advance(&state.now.0);
            // Actions that have timed out are no longer running in the belief state.
            let runs = |ticket: u64| belief.running().contains_key(&ActionHandle(ticket));
            let started = self.lock().started.clone();
            state
                .running
                .retain(|it| runs(it.ticket) || !started.contains(&it.ticket));
            let task = belief.task();
            let facts = (0..).map(FactId).take(task.fact_count());
            let facts = facts.filter(|fact| belief.fact(*fact));
            state.facts = facts.map(|fact| task.fact_name(fact)).collect();
            let fluents = (0..).map(FluentId).take(task.fluent_count());
            let numbers = fluents.filter_map(|fluent| {
                let value = Exact(belief.value(fluent)?.clone());
                let fluent = task.fluent_name(fluent);
                Some(NumberNow { fluent, value })
            });
            state.numbers = numbers.collect();
            state.in_doubt = in_doubt(&belief);
        }
        state
    }

    /// Sets whether the run replays its journal. Its state is then outdated.
    pub fn set_replayed(&self, is_replayed: bool) {
        self.lock().outdated_reason = is_replayed.then_some("the journal is replayed");
    }

    /// Returns `true` if the run replays its journal.
    pub fn is_replayed(&self) -> bool {
        self.lock().outdated_reason.is_some()
    }

    /// Updates the time of the world's clock, without an event.
    pub fn set_time(&self, now: &Rational) {
        let mut known = self.lock();
        if *now > known.now {
            known.now.clone_from(now);
        }
    }

    /// Returns the time of the world's clock at its last message.
    pub fn now(&self) -> Rational {
        self.lock().now.clone()
    }

    /// Returns the current plan.
    pub fn plan(&self) -> PlanNow {
        let known = self.lock();
        PlanNow {
            steps: known.steps.clone(),
            since: known.since.clone().map(Exact),
            plans: known.plans,
            ended: known.ended.all(),
        }
    }

    /// Returns the guarantee.
    pub fn guarantee(&self) -> GuaranteeNow {
        let known = self.lock();
        let promise = known.promise.as_ref();
        let mut parameters = known.parameters.clone();
        if promise.is_none_or(|(promise, _)| *promise > GuaranteeLevel::PartOfEnvelope) {
            for room in &mut parameters {
                (room.least, room.most) = (None, None);
            }
        }
        GuaranteeNow {
            promise: promise.map(|(promise, _)| promise.name().to_owned()),
            since: promise.map(|(_, since)| Exact(since.clone())),
            deviation: known.deviation.clone(),
            durations: known.durations.to_owned(),
            timeout: known.timeout.to_string(),
            parameters,
        }
    }

    /// Returns the last decision and the next action.
    pub fn next(&self) -> NextNow {
        let known = self.lock();
        let decided = known.decided.as_ref();
        let until = decided.and_then(|(_, decided)| match &decided.decision {
            Decision::Wait { until } => until.clone().map(Exact),
            _ => None,
        });
        let to_come = known.steps.iter().find(|step| step.state == TO_COME);
        NextNow {
            decision: decided.map(|(_, it)| it.decision.name().to_owned()),
            decided: decided.map(|(time, _)| Exact(time.clone())),
            until,
            why: known
                .rest()
                .or_else(|| decided.map(|(_, it)| it.reason.to_string())),
            step: to_come.cloned(),
        }
    }
}

/// Reason of an idle run whose present segment of the journal does not contain the reason.
const EARLIER_SEGMENT: &str = "the reason is in an earlier segment of the journal";
/// Reason for making a plan at the beginning, and when a run continues after its end.
const NO_PLAN: &str = "there is no plan yet";
/// Reason of an idle run without goals.
const NO_GOAL: &str = "there is no goal";
const TO_COME: &str = "to-come";
const RUNNING: &str = "running";
const SUCCEEDED: &str = "succeeded";

/// Returns the goal of a problem, in PDDL, without `:goal`.
pub fn goal_text(task: &Task) -> String {
    let text = write_problem(task, &Situation::initial(task), &ProblemText::default());
    let text = text.unwrap_or_default();
    let goal = text.split("(:goal ").nth(1).unwrap_or_default();
    let line = goal.lines().next().unwrap_or_default();
    line.strip_suffix(')').unwrap_or(line).to_owned()
}

fn in_doubt(belief: &BeliefState) -> Vec<InDoubt> {
    let task = belief.task();
    let of = |name: &str, doubts: &[Doubt], settles: &str| {
        let one = |doubt: &Doubt| InDoubt {
            why: format!(
                "it is unknown whether {} has ended; set the value with `ctl {}`",
                doubt.action,
                settles.replace("NAME", &format!("'{name}'"))
            ),
            since: Exact(doubt.since.clone()),
            name: name.to_owned(),
        };
        doubts.iter().map(one).collect::<Vec<_>>()
    };
    let facts = belief.doubtful_facts().iter();
    let facts = facts.flat_map(|(fact, doubts)| of(&task.fact_name(*fact), doubts, "fact NAME"));
    let values = belief.doubtful_values().iter();
    let values = values
        .flat_map(|(fluent, doubts)| of(&task.fluent_name(*fluent), doubts, "number NAME VALUE"));
    facts.chain(values).collect()
}

impl StatusData {
    fn state(&self) -> State {
        let activity = match () {
            () if self.is_over => Activity::Over,
            () if self.outdated_reason.is_some() => Activity::Beginning,
            () if self.is_paused => Activity::Paused,
            () if self.idle_reason.is_some() => Activity::Resting,
            () if self.is_planning => Activity::Planning,
            () if self.plans == 0 => Activity::Beginning,
            () => Activity::Executing,
        };
        let past = self.outdated_reason.map(str::to_owned);
        let why = past.or_else(|| self.rest());
        State {
            now: Exact(self.now.clone()),
            unanswered: None,
            restarting: None,
            why: why.or_else(|| self.planning_reason.clone()),
            activity,
            goals: self.goals.open(),
            running: self.running.values().cloned().collect(),
            plans: self.plans,
            facts: Vec::new(),
            numbers: Vec::new(),
            in_doubt: Vec::new(),
        }
    }

    /// Returns the reason why the executive is idle, if it is.
    fn rest(&self) -> Option<String> {
        let rest = self.idle_reason.as_ref()?;
        if rest != NO_GOAL || self.goals.is_empty() {
            return Some(rest.clone());
        }
        match self.goals.next_release() {
            Some(release) => Some(format!(
                "the next goal is released at {}",
                release.to_decimal(3)
            )),
            None => Some("no open goal is pursued now".to_owned()),
        }
    }

    fn begin_at(&mut self, snapshot: &SnapshotLine) {
        self.now.clone_from(snapshot.now());
        self.is_paused = snapshot.paused;
        self.goals = self.goals.at(snapshot);
        if snapshot.plan.is_none() {
            let why = if snapshot.goals.is_empty() {
                NO_GOAL
            } else {
                EARLIER_SEGMENT
            };
            self.idle_reason = Some(why.to_owned());
        }
        for start in snapshot.starts.iter().filter(|it| it.is_open()) {
            if start.started.is_some() {
                self.started.insert(start.ticket);
            }
            let running = Running {
                ticket: start.ticket,
                action: start.action.clone(),
                since: start.ordered.clone(),
                planned: start.duration.clone(),
                needed: None,
                times_out: None,
                completion: None,
                note: None,
            };
            self.running.insert(start.ticket, running);
        }
    }

    fn record(&mut self, entry: &Entry<'_>) {
        match entry {
            Entry::PlanAdopted(mission) => self.adopt_plan(mission),
            Entry::Decided { now, decided } => self.decide(now, decided),
            Entry::Command {
                now,
                command,
                expected,
                ..
            } => self.command(now, command, *expected),
            Entry::Passed { now, .. } | Entry::Looked { now, .. } => self.now.clone_from(now),
            Entry::Taken {
                observation,
                remark,
                ..
            } => self.observe(observation, remark.is_some()),
            Entry::Planning { reason, .. } => {
                self.is_planning = true;
                self.goals.mark_pursued();
                self.idle_reason = None;
                self.planning_reason = Some(match reason.cause {
                    // The record of a run begins with the cause of a new plan.
                    Cause::NewPlan => NO_PLAN.to_owned(),
                    _ => reason.to_string(),
                });
            }
            Entry::Planned { .. } => self.is_planning = false,
            Entry::Warning {
                ticket,
                until,
                cause,
                ..
            } => {
                if let Some(running) = self.running.get_mut(&ticket.0) {
                    let until = Some(Exact((*until).clone()));
                    match cause {
                        WarningCause::Slack => running.needed = until,
                        WarningCause::Timeout => running.times_out = until,
                    }
                }
            }
            Entry::Kept { .. } | Entry::Interrupted { .. } | Entry::WorldFailed { .. } => {}
            Entry::Goal { now, name, change } => self.goals.change(name, *change, now),
            Entry::Resting {
                now,
                verdict,
                goals,
                dead_end,
                unreached,
            } => {
                self.now.clone_from(now);
                self.steps.clear();
                self.since = None;
                self.parameters.clear();
                self.promise = None;
                self.deviation = None;
                self.decided = None;
                let goals = goals.join(", ");
                self.idle_reason = Some(match verdict {
                    None => NO_GOAL.to_owned(),
                    Some(Verdict::GoalReached) => {
                        self.goals.close_all(now);
                        format!("reached: {goals}")
                    }
                    Some(verdict) => {
                        self.goals.mark_unplanned(unreached, now);
                        idle::unreached(verdict, &goals, dead_end, unreached)
                    }
                });
            }
            Entry::Over(report) => {
                self.is_over = true;
                self.now.clone_from(&report.time);
                let why = report
                    .verdict
                    .why()
                    .map_or(String::new(), |why| format!(": {why}"));
                self.idle_reason =
                    Some(format!("{}{why}", report.verdict.name().replace('-', " ")));
            }
        }
    }

    fn adopt_plan(&mut self, mission: &PreparedPlan) {
        self.plans += 1;
        (self.is_planning, self.idle_reason, self.planning_reason) = (false, None, None);
        self.since = Some(mission.now.clone());
        let parameters = mission.plan.parameters.iter();
        let durations: BTreeMap<InstanceId, &str> = parameters
            .filter_map(|parameter| match parameter.kind {
                ParameterKind::Duration(instance) => Some((instance, parameter.name.as_str())),
                _ => None,
            })
            .collect();
        let numbered = mission.time_triggered.steps.iter().zip(&mission.instances);
        let mut steps: Vec<StepNow> = numbered
            .map(|(step, instance)| {
                let id = StepId::from(*instance);
                let ticket = mission.running.get(&id).or_else(|| mission.begun.get(&id));
                let ticket = ticket.map(|it| it.0);
                let state = match ticket {
                    None => TO_COME,
                    Some(ticket) if self.running.contains_key(&ticket) => RUNNING,
                    Some(_) if mission.running.contains_key(&id) => RUNNING,
                    Some(_) => SUCCEEDED,
                };
                StepNow {
                    action: step.action.name.clone(),
                    start: Exact(&mission.origin + &step.start),
                    duration: step.duration.clone().map(Exact),
                    state: state.to_owned(),
                    ticket,
                    parameter: durations.get(instance).map(|it| (*it).to_owned()),
                }
            })
            .collect();
        steps.sort_by(|one, other| one.start.0.cmp(&other.start.0));
        self.steps = steps;
        let parameters = mission.plan.parameters.iter().enumerate();
        self.parameters = parameters
            .map(|(index, parameter)| {
                let allowed = mission.envelope.as_ref();
                let allowed = allowed.and_then(|envelope| envelope.intervals().get(index));
                Room {
                    name: parameter.name.clone(),
                    meaning: mission
                        .plan
                        .describe(&mission.task, ParameterId::from(index)),
                    nominal: Exact(parameter.nominal.clone()),
                    least: allowed.map(|interval| LowerEnd(interval.lower.clone())),
                    most: allowed.map(|interval| UpperEnd(interval.upper.clone())),
                    timeout: match parameter.kind {
                        ParameterKind::Duration(instance) => {
                            let action = &mission.plan.plan.instance(instance).action.name;
                            self.timeout.of(action, &parameter.nominal).map(Exact)
                        }
                        _ => None,
                    },
                }
            })
            .collect();
        self.promise = None;
        for running in self.running.values_mut() {
            running.needed = None;
        }
    }

    fn decide(&mut self, now: &Rational, decided: &Decided) {
        if let Some(promise) = decided.reason.guarantee
            && self
                .promise
                .as_ref()
                .is_none_or(|(known, _)| *known != promise)
        {
            self.promise = Some((promise, now.clone()));
        }
        if decided.decision == Decision::Replan {
            self.deviation = Some(decided.reason.to_string());
            self.promise = None;
        }
        self.decided = Some((now.clone(), decided.clone()));
    }

    /// Records a command; `expected` is the duration in the plan, if it differs from that of the command.
    fn command(&mut self, now: &Rational, command: &Command, expected: Option<&Rational>) {
        let (ticket, action, duration) = match command {
            Command::Start {
                ticket,
                action,
                duration,
            } => (ticket, action, expected.or(duration.as_ref())),
            Command::Cancel { ticket } => {
                // An action without a reported start may have no reported end.
                if !self.started.contains(&ticket.0) {
                    self.end(ticket.0, "cancelled", now);
                }
                return;
            }
        };
        let same = |step: &&mut StepNow| step.state == TO_COME && step.action == action.name;
        if let Some(step) = self.steps.iter_mut().find(same) {
            RUNNING.clone_into(&mut step.state);
            step.ticket = Some(ticket.0);
        }
        let running = Running {
            ticket: ticket.0,
            action: action.name.clone(),
            since: Exact(now.clone()),
            planned: duration.cloned().map(Exact),
            needed: None,
            times_out: None,
            completion: None,
            note: None,
        };
        self.running.insert(ticket.0, running);
    }

    fn end(&mut self, ticket: u64, how: &str, now: &Rational) {
        if let Some(running) = self.running.remove(&ticket) {
            self.ended.add(running, how, now);
        }
        self.started.remove(&ticket);
        let own = self
            .steps
            .iter_mut()
            .filter(|step| step.ticket == Some(ticket));
        for step in own.filter(|step| step.state == RUNNING) {
            how.clone_into(&mut step.state);
        }
    }

    fn observe(&mut self, observation: &Observation, is_remarkable: bool) {
        match &observation.event {
            Event::Started { ticket, .. } => {
                self.started.insert(ticket.0);
                let is_instantaneous = self
                    .running
                    .get(&ticket.0)
                    .is_some_and(|running| running.planned.is_none());
                if is_instantaneous {
                    self.end(ticket.0, SUCCEEDED, &observation.time);
                }
            }
            Event::Ended { ticket, ending, .. } => {
                self.end(ticket.0, ending.name(), &observation.time);
            }
            Event::Feedback {
                ticket,
                completion,
                note,
            } => {
                if let Some(running) = self.running.get_mut(&ticket.0) {
                    running.times_out = None;
                    running.completion = completion.clone().map(Exact);
                    running.note = Some(note.clone()).filter(|note| !note.is_empty());
                }
            }
            // Rejected requests have no effect.
            Event::Requested(request) if !is_remarkable => self.on_request(request),
            Event::Requested(_)
            | Event::Fact { .. }
            | Event::Value { .. }
            | Event::PlanMade
            | Event::PlanReady
            | Event::Unintelligible { .. } => {}
        }
    }

    fn on_request(&mut self, request: &Request) {
        match request {
            Request::Pursue { name, goal, terms } => {
                self.goals.cancel(name, "replaced", &self.now);
                self.goals.add((name, goal), terms, &self.now);
            }
            Request::Abandon { name } => self.goals.cancel(name, "abandoned", &self.now),
            Request::CancelAction { .. } => {}
            Request::Pause => self.is_paused = true,
            Request::Resume => self.is_paused = false,
        }
    }
}
