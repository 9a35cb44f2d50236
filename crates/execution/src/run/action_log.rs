//! The starts of a run, and their outcomes.

mod executed;
mod known_start;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_model::ground::Action;
use elbowroom_num::Rational;

use super::start_dependencies::{StartDependency, StepEvent, start_dependencies};
use crate::belief_state::BeliefState;
use crate::event::{ActionHandle, Ending, Measured};
use crate::executor::{Order, PlanEvent, PreparedPlan, StepId};

pub use executed::ExecutedStep;
pub use known_start::KnownStart;

/// Number of steps in the report of an executive that were executed before it was last idle.
const MAX_REPORTED_STEPS: usize = 2000;

/// Number of ended starts, the latest ones, on which late reports are still processed after a plan
/// is adopted.
const MAX_REMEMBERED_STARTS: usize = 100;

/// The starts of a run, except for those that an executive has forgotten.
#[derive(Clone, Debug, Default)]
pub struct ActionLog {
    entries: BTreeMap<ActionHandle, StartEntry>,
    /// Number of starts. Tickets are issued in this order.
    started: usize,
    /// Number of entries after the last removal of old entries.
    kept_after_pruning: usize,
    /// The steps executed before the run was last idle, for its report.
    finished_steps: VecDeque<ExecutedStep>,
    /// The present plan.
    plan: PlanLog,
    /// Starts that have not ended.
    open: BTreeSet<ActionHandle>,
}

/// The executed part of a plan.
#[derive(Clone, Debug, Default)]
pub(super) struct PlanLog {
    /// The starts, by step.
    pub(super) steps: BTreeMap<StepId, ActionHandle>,
    /// All steps, on the world's clock, if they were recorded.
    planned: Vec<(StepId, Step)>,
    /// The predecessors that the starts of these steps wait for.
    waits: BTreeMap<StepId, Vec<StartDependency>>,
}

/// One start.
#[derive(Clone, Debug)]
pub(super) struct StartEntry {
    pub(super) action: Arc<Action>,
    pub(super) planned: Option<Rational>,
    /// Its step in the present plan, if any.
    pub(super) step: Option<StepId>,
    pub(super) commanded: Rational,
    pub(super) started: Option<Rational>,
    /// The time and the completion of its last reported progress after its start.
    pub(super) progress: Option<(Rational, Rational)>,
    pub(super) ended: Option<(Rational, Ending)>,
    pub(super) cancelled: Option<Rational>,
    /// Its time-out, if it has reached it.
    pub(super) timed_out: Option<Rational>,
    /// `true` if it is unknown whether its end has happened.
    pub(super) is_in_doubt: bool,
    /// The latest tolerable end according to the last warning of it.
    pub(super) warned: Option<Rational>,
    /// The time-out according to the last warning of it.
    pub(super) warned_timeout: Option<Rational>,
    /// The end of its window when its slack was last computed, and the latest tolerable end then.
    pub(super) latest_tolerable_end: Option<(Rational, Rational)>,
    pub(super) measured: [Vec<Measured>; 2],
    /// `true` if it had ended long before the present plan. Late reports on it are ignored.
    is_past: bool,
}

impl StartEntry {
    /// Creates the entry of a commanded start.
    fn new(action: &Arc<Action>, planned: Option<Rational>, commanded: Rational) -> Self {
        Self {
            action: Arc::clone(action),
            planned,
            step: None,
            commanded,
            started: None,
            progress: None,
            ended: None,
            cancelled: None,
            timed_out: None,
            is_in_doubt: false,
            warned: None,
            warned_timeout: None,
            latest_tolerable_end: None,
            measured: [Vec::new(), Vec::new()],
            is_past: false,
        }
    }
}

impl ActionLog {
    /// Creates the log of a run that begins in the middle of an execution. It contains only the
    /// running actions.
    pub(super) fn mid_execution(
        belief: &BeliefState,
        running: &BTreeMap<StepId, ActionHandle>,
    ) -> Self {
        let mut account = Self::default();
        for (ticket, underway) in belief.running() {
            let (planned, start) = (underway.planned.clone(), underway.start.clone());
            let opened = StartEntry {
                started: Some(start.clone()),
                ..StartEntry::new(&underway.action, Some(planned), start)
            };
            account.entries.insert(*ticket, opened);
            // Tickets in between belong to actions that have ended.
            let number = usize::try_from(ticket.0).unwrap_or(usize::MAX);
            account.started = account.started.max(number.saturating_add(1));
            account.open.insert(*ticket);
        }
        account.begin_plan(running);
        account
    }

    /// Returns the number of actions started.
    pub fn started(&self) -> usize {
        self.started
    }

    /// Marks ended starts as long past, except for the latest ones and those in `but_for`. Called
    /// when a plan is adopted, or when the run is idle.
    pub(super) fn mark_past(&mut self, but_for: &[ActionHandle]) {
        let ended = self.entries.iter_mut().rev();
        let ended = ended.filter(|(ticket, it)| it.ended.is_some() && !but_for.contains(ticket));
        for (_, it) in ended.skip(MAX_REMEMBERED_STARTS) {
            it.is_past = true;
        }
    }

    /// Forgets starts that are long past, also for the report.
    pub(super) fn forget_past_starts(&mut self) {
        self.entries.retain(|_, it| !it.is_past);
        self.forget_closed();
    }

    /// Clears the log when no action is running and there is no plan. The latest executed steps are
    /// kept for the report.
    pub(super) fn close(&mut self, now: &Rational) {
        if self.entries.is_empty() {
            return;
        }
        let done = self.executed_steps(now).collect::<Vec<_>>();
        self.finished_steps.extend(done);
        let surplus = self.finished_steps.len().saturating_sub(MAX_REPORTED_STEPS);
        self.finished_steps.drain(..surplus);
        self.entries.clear();
        self.plan.steps.clear();
        self.kept_after_pruning = 0;
    }

    /// Forgets the steps executed before the run was last idle.
    pub(super) fn forget_closed(&mut self) {
        self.finished_steps.clear();
    }

    /// Returns `true` if the ticket was issued, and its start is no longer known.
    pub(super) fn is_forgotten(&self, ticket: ActionHandle) -> bool {
        ticket.0 < self.started as u64 && self.recent(ticket).is_none()
    }

    /// Returns the start of this ticket, unless it is long past.
    pub(super) fn recent(&self, ticket: ActionHandle) -> Option<&StartEntry> {
        self.entries.get(&ticket).filter(|it| !it.is_past)
    }

    /// Forgets the earliest starts that have ended and do not belong to the present plan, so that
    /// at most `most` remain, if there are enough such starts. It can be called often: it does
    /// nothing until there are twice as many.
    pub(super) fn forget_earliest(&mut self, most: usize) {
        if self.entries.len() < 2 * most.max(self.kept_after_pruning) {
            return;
        }
        let mut surplus = self.entries.len() - most;
        self.entries.retain(|_, entry| {
            let is_past = surplus > 0 && entry.ended.is_some() && entry.step.is_none();
            surplus -= usize::from(is_past);
            !is_past
        });
        self.kept_after_pruning = self.entries.len();
    }

    /// Returns the tickets of actions that have not ended.
    pub fn open_tickets(&self) -> impl Iterator<Item = ActionHandle> + '_ {
        self.open.iter().copied()
    }

    pub(super) fn open(&mut self, order: &Order, now: &Rational) -> ActionHandle {
        let ticket = ActionHandle(self.started as u64);
        self.started += 1;
        let opened = StartEntry {
            step: Some(order.step),
            ..StartEntry::new(&order.action, order.duration.clone(), now.clone())
        };
        self.entries.insert(ticket, opened);
        self.plan.steps.insert(order.step, ticket);
        self.open.insert(ticket);
        ticket
    }

    /// Begins a plan: starts no longer belong to steps of earlier plans. `running` has the steps of
    /// the new plan that are running.
    pub(super) fn begin_plan(&mut self, running: &BTreeMap<StepId, ActionHandle>) {
        self.plan.planned.clear();
        self.plan.waits.clear();
        for ticket in std::mem::take(&mut self.plan.steps).into_values() {
            if let Some(entry) = self.entries.get_mut(&ticket) {
                entry.step = None;
            }
        }
        for (step, ticket) in running {
            if let Some(entry) = self.entries.get_mut(ticket) {
                entry.step = Some(*step);
            }
            self.plan.steps.insert(*step, *ticket);
        }
    }

    /// Returns the part of the present plan that has been started.
    pub(super) fn plan(&self) -> &PlanLog {
        &self.plan
    }

    /// Continues with an earlier plan.
    pub(super) fn resume_plan(&mut self, plan: PlanLog) {
        self.begin_plan(&plan.steps);
        self.plan = plan;
    }

    /// Returns the time at which a step of the present plan started (or was commanded, if no start
    /// was reported) or ended successfully.
    pub(super) fn time_of(&self, (step, is_end): StepEvent) -> Option<&Rational> {
        let entry = self.get(self.ticket(step)?)?;
        match &entry.ended {
            _ if !is_end => Some(entry.started.as_ref().unwrap_or(&entry.commanded)),
            Some((end, Ending::Succeeded)) => Some(end),
            _ => None,
        }
    }

    /// Records the steps of the plan that has begun.
    pub(super) fn note_steps(&mut self, mission: &PreparedPlan) {
        let steps = mission.instances.iter().zip(&mission.time_triggered.steps);
        let on_the_worlds_clock = steps.map(|(instance, step)| {
            let start = &mission.origin + &step.start;
            (
                StepId::from(*instance),
                Step {
                    start,
                    ..step.clone()
                },
            )
        });
        self.plan.planned = on_the_worlds_clock.collect();
        self.plan.waits = start_dependencies(mission);
    }

    /// Returns the predecessors that the start of a recorded step waits for.
    pub(super) fn waits(&self, step: StepId) -> &[StartDependency] {
        self.plan.waits.get(&step).map_or(&[], Vec::as_slice)
    }

    /// Returns the recorded steps.
    pub(super) fn plan_steps(&self) -> &[(StepId, Step)] {
        &self.plan.planned
    }

    /// Returns the actions of the present plan that were started, or were running when it began.
    pub(super) fn plan_starts(&self) -> impl Iterator<Item = (ActionHandle, &StartEntry)> + '_ {
        let tickets = self.plan.steps.values();
        tickets.filter_map(|ticket| Some((*ticket, self.get(*ticket)?)))
    }

    /// Returns the steps of the present plan that were started, or were running when it began.
    pub(super) fn steps(&self) -> &BTreeMap<StepId, ActionHandle> {
        &self.plan.steps
    }

    pub(super) fn ticket(&self, step: StepId) -> Option<ActionHandle> {
        self.plan.steps.get(&step).copied()
    }

    pub(super) fn get(&self, ticket: ActionHandle) -> Option<&StartEntry> {
        self.entries.get(&ticket)
    }

    pub(super) fn note_start(
        &mut self,
        ticket: ActionHandle,
        time: &Rational,
        measured: &[Measured],
    ) {
        let Some(entry) = self.entries.get_mut(&ticket) else {
            return;
        };
        entry.started = Some(time.clone());
        entry.measured[0] = measured.to_vec();
        if entry.planned.is_none() {
            entry.ended = Some((time.clone(), Ending::Succeeded));
            self.open.remove(&ticket);
        }
    }

    pub(super) fn note_end(
        &mut self,
        ticket: ActionHandle,
        time: &Rational,
        ending: &Ending,
        measured: &[Measured],
    ) {
        let Some(entry) = self.entries.get_mut(&ticket) else {
            return;
        };
        entry.ended = Some((time.clone(), ending.clone()));
        entry.measured[1] = measured.to_vec();
        self.open.remove(&ticket);
    }

    /// Records the completion of an action, if it has grown.
    pub(super) fn note_progress(&mut self, ticket: ActionHandle, time: &Rational, done: &Rational) {
        if let Some(entry) = self.entries.get_mut(&ticket) {
            let before = entry.progress.as_ref();
            if before.map_or(done.is_positive(), |(_, before)| done > before) {
                entry.progress = Some((time.clone(), done.clone()));
            }
        }
    }

    /// Records that an action has reached its time-out.
    pub(super) fn note_timeout(&mut self, ticket: ActionHandle, timeout: &Rational) {
        if let Some(entry) = self.entries.get_mut(&ticket) {
            entry.timed_out = Some(timeout.clone());
        }
    }

    /// Records whether it is unknown if an action's end has happened.
    pub(super) fn note_doubt(&mut self, ticket: ActionHandle, is_in_doubt: bool) {
        if let Some(entry) = self.entries.get_mut(&ticket) {
            entry.is_in_doubt = is_in_doubt;
        }
    }

    /// Records the latest tolerable end of an action, which its window does not show.
    pub(super) fn record_latest_tolerable_end(
        &mut self,
        ticket: ActionHandle,
        window: Rational,
        until: Rational,
    ) {
        if let Some(entry) = self.entries.get_mut(&ticket) {
            entry.latest_tolerable_end = Some((window, until));
        }
    }

    pub(super) fn note_warning(&mut self, ticket: ActionHandle, until: &Rational) {
        if let Some(entry) = self.entries.get_mut(&ticket) {
            entry.warned = Some(until.clone());
        }
    }

    pub(super) fn note_timeout_warning(&mut self, ticket: ActionHandle, until: &Rational) {
        if let Some(entry) = self.entries.get_mut(&ticket) {
            entry.warned_timeout = Some(until.clone());
        }
    }

    pub(super) fn is_cancelled(&self, ticket: ActionHandle) -> bool {
        self.get(ticket)
            .is_some_and(|entry| entry.cancelled.is_some())
    }

    pub(super) fn note_cancel(&mut self, ticket: ActionHandle, time: &Rational) {
        if let Some(entry) = self.entries.get_mut(&ticket) {
            entry.cancelled = Some(time.clone());
        }
    }

    /// Returns the steps of a plan to which these starts belong: of each action, the first ones
    /// that are not running when the plan begins. `None` if a start belongs to no step.
    pub(super) fn match_steps(
        &self,
        mission: &PreparedPlan,
        begun: &[ActionHandle],
    ) -> Option<BTreeMap<StepId, ActionHandle>> {
        if begun.is_empty() {
            return Some(BTreeMap::new());
        }
        let steps = mission.instances.iter().zip(&mission.time_triggered.steps);
        let steps = steps.map(|(instance, step)| (StepId::from(*instance), step));
        let mut left: Vec<_> = steps
            .filter(|(id, _)| !mission.running.contains_key(id))
            .collect();
        left.sort_by(|(_, one), (_, other)| one.start.cmp(&other.start));
        let step_of = |ticket: &ActionHandle| {
            let name = &self.get(*ticket)?.action.name;
            let index = left.iter().position(|(_, it)| it.action.name == *name)?;
            Some((left.remove(index).0, *ticket))
        };
        begun.iter().map(step_of).collect()
    }

    /// Returns the start of a step as news.
    pub(super) fn start_event(
        &self,
        step: StepId,
        ticket: ActionHandle,
    ) -> Option<(Rational, PlanEvent)> {
        let time = self.get(ticket)?.started.clone()?;
        let measured = Vec::new();
        let news = PlanEvent::Started {
            step,
            time: time.clone(),
            measured,
        };
        Some((time, news))
    }

    /// Returns the end of a step as news. An instantaneous action ends when it starts.
    pub(super) fn end_event(
        &self,
        step: StepId,
        ticket: ActionHandle,
    ) -> Option<(Rational, PlanEvent)> {
        let entry = self.get(ticket)?;
        let (time, ending) = entry.ended.clone()?;
        if entry.planned.is_none() && entry.started.is_some() {
            return None;
        }
        let measured = Vec::new();
        let news = PlanEvent::Ended {
            step,
            time: time.clone(),
            ending,
            measured,
        };
        Some((time, news))
    }
}
