//! Executives: runs that continue after their goal is reached, with goals, facts and pauses from
//! outside.
//!
//! Each request arrives as an observation ([`Event::Asked`]). So it is recorded with everything
//! else, and replays and resumed runs receive it again.
//!
//! | request or observation | result |
//! | --- | --- |
//! | a goal | the goal is now the conjunction of all open goals, except those that are [set aside](super::goal_selection). If the remaining plan, started now, reaches it, the plan is kept; otherwise a new plan is made |
//! | a goal with the name of an open one | it replaces the earlier goal; a new plan is made |
//! | a goal with a release time in the future | it is [queued](super::queued_goals) until then, and then handled like a new goal |
//! | a goal to keep | it is pursued whenever it does [not hold](super::kept_goals) and no other goal is |
//! | a goal is abandoned | a plan is made for the others; without others, nothing more is started |
//! | a fact or value | believed; the plan continues if it is still feasible, otherwise a new one is made |
//! | an action is cancelled | the world receives the cancellation; its end is an outcome like any other |
//! | a pause | nothing is started or planned any more. Running actions continue and are monitored, and silent ones time out. Time passes, also for deadlines |
//! | the end of a pause | the plan continues if it is still feasible, otherwise a new one is made |
//!
//! Actions keep running in all of these cases: they are part of the situation from which the next
//! plan starts ([`RunningRule`](super::RunningRule)).
//!
//! Other runs end when the goals are reached, no plan reaches them, none was found, or the limit on
//! new plans is reached. An executive becomes *idle* instead ([`Entry::Resting`]): it starts
//! nothing, and records the reason. Running actions continue to their ends. A request ends the idle
//! state. While goals are open, so do news from the world and each timed initial, at most once in
//! [`SEARCH_PAUSE`] seconds.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan, problem};
use elbowroom_num::Rational;

use super::background_search::SearchResults;
use super::goal_selection::GoalSelection;
use super::goals::OpenGoal;
use super::observations::Remark;
use super::pending::PreparationFallback;
use super::plan_start::PlanStart;
use super::situation::{OverrunEstimate, remaining_plan_of};
use super::snapshot::Goals;
use super::work_queue::PendingStep;
use super::{Run, Stop, Verdict};
use crate::event::{ActionHandle, Request};
use crate::executor::PlanEvent;
use crate::reason::{Cause, Reason, Subject};
use crate::record::Entry;

/// Name of the problem's own goal.
pub const PROBLEM_GOAL_NAME: &str = "problem";

/// Time after an unsuccessful search during which no other one begins, whatever is reported, in
/// seconds of the world's clock.
const SEARCH_PAUSE: i64 = 1;

/// Length of the news during a pause above which repetitions are removed.
const MAX_NEWS: usize = 1000;

/// Reads the goals that are given to a run.
///
/// The result is the condition, or the error in words.
pub trait GoalReader: Send {
    /// Reads a goal of this task.
    ///
    /// # Errors
    /// If the text is not a condition of the task, in words.
    fn read(&self, task: &Task, text: &str) -> Result<problem::Condition, String>;
}

impl<F: Fn(&Task, &str) -> Result<problem::Condition, String> + Send> GoalReader for F {
    fn read(&self, task: &Task, text: &str) -> Result<problem::Condition, String> {
        self(task, text)
    }
}

/// State of an executive, or of an attended run.
pub(super) struct GoalManager<'a> {
    pub(super) reader: Box<dyn GoalReader + 'a>,
    /// The open goals.
    pub(super) goals: Vec<OpenGoal>,
    /// The goals whose release times have not come, and the goals to keep that are not pursued.
    pub(super) queued: Vec<OpenGoal>,
    /// `true` if the goals were ever changed.
    pub(super) have_goals_changed: bool,
    pub(super) is_paused: bool,
    /// The change of the goals since the present plan was made.
    pub(super) pending_change: Option<PendingGoalChange>,
    /// The selection among the goals, while it is in progress.
    pub(super) selection: Option<GoalSelection>,
    /// Conjuncts of goals that exclude each other, as proved by the planner's answers during the
    /// selection.
    pub(super) conflicts: Vec<Vec<String>>,
    /// The present plan, on the world's clock.
    pub(super) plan: Option<TimeTriggeredPlan>,
    /// The names of the plan's goals.
    pub(super) planned_goals: BTreeSet<String>,
    /// Start of the idle state.
    pub(super) idle_since: Option<Rational>,
    /// `true` if it is proved that no plan reaches the goals from there, including the effects of
    /// all coming timed initials.
    is_unsolvable: bool,
    idle_behaviour: IdleBehaviour,
}

/// Behaviour when another run would be over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum IdleBehaviour {
    /// It waits for the next request.
    Wait,
    /// It is also over. It accepts only pauses and the abandonment of its goal.
    End,
    /// Its goal was abandoned: it is over as soon as no action is running.
    GoalAbandoned,
}

/// A change of the goals.
pub(super) struct PendingGoalChange {
    pub(super) reason: Reason,
    /// `true` if goals were only added, so that the plan may also reach these.
    pub(super) are_goals_only_added: bool,
}

impl<'a> Run<'a> {
    /// Turns the run into an executive, which does not end when its goal is reached or unreachable.
    /// It waits for other goals ([`Event::Asked`](crate::Event::Asked)), which `reader` reads. It
    /// ends at the time limit, when the world fails, or when its end is requested.
    #[must_use]
    pub fn lasting(mut self, reader: impl GoalReader + 'a) -> Self {
        let goals = if self.task.problem().goal.is_trivial() {
            Vec::new()
        } else {
            vec![OpenGoal::problem_goal(&self.task)]
        };
        self.goal_manager = Some(GoalManager {
            reader: Box::new(reader),
            goals,
            queued: Vec::new(),
            have_goals_changed: false,
            is_paused: false,
            pending_change: None,
            selection: None,
            conflicts: Vec::new(),
            plan: None,
            planned_goals: BTreeSet::new(),
            idle_since: None,
            is_unsolvable: false,
            idle_behaviour: IdleBehaviour::Wait,
        });
        self
    }

    /// Makes the run accept pauses and the abandonment of its goal, but no other goals. When the
    /// goal is abandoned, nothing more is started, and the run is over ([`Verdict::Interrupted`])
    /// when the running actions have ended.
    #[must_use]
    pub fn interactive(self) -> Self {
        let reads_none = |_: &Task, _: &str| Err("this run has one goal".to_owned());
        let mut run = self.lasting(reads_none);
        if let Some(lasting) = &mut run.goal_manager {
            lasting.idle_behaviour = IdleBehaviour::End;
        }
        run
    }

    /// Processes a request.
    pub(super) fn process_request(&mut self, request: &Request) -> Remark {
        let Some(lasting) = &mut self.goal_manager else {
            return Some("this run accepts no requests; the request is ignored");
        };
        match request {
            Request::Pursue { .. } if lasting.idle_behaviour != IdleBehaviour::Wait => {
                Some("this run accepts no other goals; the goal is ignored")
            }
            Request::Pursue { terms, .. } if !terms.value.is_positive() => {
                Some("the value of a goal must be positive; the goal is ignored")
            }
            Request::Pursue { terms, .. } if terms.keep && terms.deadline.is_some() => {
                Some("a goal to keep cannot have a deadline; the goal is ignored")
            }
            Request::Pursue { name, goal, terms } => {
                let Ok(condition) = lasting.reader.read(&self.task, goal) else {
                    return Some("it is not a valid goal of this problem; it is ignored");
                };
                let text = Some(goal.clone());
                let mut given = OpenGoal::new(&self.task, name.clone(), text, condition);
                given.terms.clone_from(terms);
                self.add_goal(given)
            }
            Request::Abandon { name } => self.abandon_goal(name),
            Request::CancelAction { ticket } => self.cancel_on_request(*ticket),
            Request::Pause if lasting.is_paused => Some("the run is already paused"),
            Request::Resume if !lasting.is_paused => Some("the run is not paused"),
            Request::Pause | Request::Resume => {
                lasting.is_paused = *request == Request::Pause;
                None
            }
        }
    }

    fn cancel_on_request(&mut self, ticket: ActionHandle) -> Remark {
        if !self.action_log.open_tickets().any(|open| open == ticket) {
            return Some("no running action has this ticket");
        }
        self.cancel(vec![ticket]);
        None
    }

    /// Returns `true` if the goals are not, or no longer, those of the problem.
    pub(super) fn have_goals_changed(&self) -> bool {
        let lasting = self.goal_manager.as_ref();
        lasting.is_some_and(|lasting| lasting.have_goals_changed)
    }

    /// Returns `true` if nothing is to be started or planned for now.
    pub(super) fn is_paused(&self) -> bool {
        let lasting = self.goal_manager.as_ref();
        lasting.is_some_and(|lasting| lasting.is_paused)
    }

    /// Returns `true` if the goals have changed since a plan was requested.
    pub(super) fn is_goal_change_pending(&self) -> bool {
        let lasting = self.goal_manager.as_ref();
        lasting.is_some_and(|lasting| lasting.pending_change.is_some())
    }

    /// Handles pauses, changed goals and the idle state. Returns `true` if the executor is not to
    /// be asked.
    pub(super) fn handle_requests(&mut self) -> Result<bool, Stop> {
        let Some(lasting) = &mut self.goal_manager else {
            return Ok(false);
        };
        if lasting.is_paused {
            remove_repeated_news(&mut self.plan_events);
            self.wait_without_executor();
            return Ok(true);
        }
        if lasting.idle_behaviour == IdleBehaviour::GoalAbandoned {
            if self.action_log.open_tickets().next().is_none() {
                return Err(Stop::Ended(Verdict::Interrupted));
            }
            self.plan_events.clear();
            self.wait_without_executor();
            return Ok(true);
        }
        if self.search.is_none()
            && let Some(turn) = lasting.pending_change.take()
        {
            lasting.idle_since = None;
            self.search_results.failed_at = None;
            self.replans = 0;
            self.handle_goal_change(turn)?;
            return Ok(true);
        }
        if lasting.idle_since.is_none() {
            return Ok(false);
        }
        let has_goals = !lasting.goals.is_empty();
        if !has_goals && !self.has_conflicting_goals() {
            self.plan_events.clear();
        }
        if self.is_search_due() && !has_goals {
            self.plan_events.clear();
            self.pursue_kept_goals();
        } else if self.is_search_due() {
            self.wake();
            let reason = Reason::new(Cause::Surprise).about(Subject::AnyObservation);
            self.replan(&reason)?;
        } else {
            self.rotate_while_idle();
            self.wait_without_executor();
        }
        Ok(true)
    }

    /// Returns `true` if the run is idle although goals are open, and a timed initial may make them
    /// reachable.
    fn awaits_timed_initials(&self) -> bool {
        let lasting = self.goal_manager.as_ref();
        lasting
            .is_some_and(|it| it.idle_since.is_some() && !it.goals.is_empty() && !it.is_unsolvable)
    }

    /// Records the timed initials after the first `before` of them as news, if they may make open goals reachable.
    pub(super) fn record_timed_initials_while_idle(&mut self, before: usize) {
        if !self.awaits_timed_initials() {
            return;
        }
        let past = self
            .task
            .timed()
            .get(before..self.belief.past_timed_initials());
        let changes = past.unwrap_or_default().iter().flat_map(|it| &it.changes);
        self.plan_events.extend(changes.map(PlanEvent::from_change));
    }

    /// Returns the start of the idle state, if the run is idle, and `true` if no plan reaches the
    /// open goals from there.
    pub(super) fn idle_since_and_proof(&self) -> Option<(&Rational, bool)> {
        let lasting = self.goal_manager.as_ref()?;
        Some((lasting.idle_since.as_ref()?, lasting.is_unsolvable))
    }

    /// Sets the start of the idle state. `is_unsolvable` is `true` if no plan reaches the open
    /// goals from there.
    pub(super) fn set_idle_since(&mut self, since: Rational, is_unsolvable: bool) {
        if let Some(lasting) = &mut self.goal_manager {
            lasting.idle_since = Some(since);
            lasting.is_unsolvable = is_unsolvable;
        }
    }

    fn wake(&mut self) {
        if let Some(lasting) = &mut self.goal_manager {
            lasting.idle_since = None;
        }
        self.retry_conflicting_goals();
        self.pursue_all();
    }

    /// Keeps the remaining plan, or makes another one.
    fn handle_goal_change(&mut self, turn: PendingGoalChange) -> Result<(), Stop> {
        let has_goals = self
            .goal_manager
            .as_ref()
            .is_some_and(|it| !it.goals.is_empty());
        if !has_goals {
            self.drop_plan();
            match &mut self.goal_manager {
                Some(lasting) if lasting.idle_behaviour != IdleBehaviour::Wait => {
                    lasting.idle_behaviour = IdleBehaviour::GoalAbandoned;
                }
                _ => self.become_idle_because(None, &[]),
            }
            return Ok(());
        }
        let rest = if turn.are_goals_only_added {
            self.remaining_plan()
        } else {
            None
        };
        if let Some(rest) = rest {
            if self.plans_aside() && self.settings.readies_aside {
                self.prepare_remaining_plan(turn, rest);
                return Ok(());
            }
            let (plan, situation, running) = rest;
            let course = PlanStart::of(&plan, &situation, &running);
            let (task, goals) = (Arc::clone(&self.task), self.goals());
            self.await_preparation(
                &task,
                &goals,
                course,
                PreparationFallback::ReplanForGoals(turn),
            );
            return Ok(());
        }
        self.replan_for_changed_goals(&turn)
    }

    /// Makes another plan, because the goals have changed.
    pub(super) fn replan_for_changed_goals(
        &mut self,
        turn: &PendingGoalChange,
    ) -> Result<(), Stop> {
        if self.search_while_plan_continues(&turn.reason)? {
            return Ok(());
        }
        self.replan(&turn.reason)
    }

    /// Repeats a change of the goals, merged with later changes.
    pub(super) fn requeue_goal_change(&mut self, turn: PendingGoalChange) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        lasting.pending_change = Some(match lasting.pending_change.take() {
            None => turn,
            Some(later) => PendingGoalChange {
                are_goals_only_added: later.are_goals_only_added && turn.are_goals_only_added,
                ..later
            },
        });
    }

    /// Records that a plan for these goals begins.
    pub(super) fn note_plan(&mut self, plan: &TimeTriggeredPlan, goals: &Goals) {
        if let Some(lasting) = &mut self.goal_manager {
            lasting.plan = Some(plan.clone());
            lasting.idle_since = None;
            let pursued = goals.open.iter().filter(|it| it.set_aside.is_none());
            lasting.planned_goals = pursued.map(|it| it.name.clone()).collect();
            let planned = &lasting.planned_goals;
            let goals = lasting.goals.iter_mut();
            for goal in goals.filter(|goal| planned.contains(&goal.name)) {
                goal.missed_deadline = None;
            }
            self.select_after_success();
        }
    }

    /// Drops the plan. Running actions are no longer part of a plan.
    pub(super) fn drop_plan(&mut self) {
        self.action_log
            .begin_plan(&std::collections::BTreeMap::new());
        if let Some(lasting) = &mut self.goal_manager {
            lasting.plan = None;
            lasting.planned_goals.clear();
        }
    }

    /// Returns `true` if goals were abandoned or replaced, `false` if they were only added, and
    /// `None` if they have not changed.
    pub(super) fn has_abandoned_goals(&self) -> Option<bool> {
        let turn = self.goal_manager.as_ref()?.pending_change.as_ref()?;
        Some(!turn.are_goals_only_added)
    }

    /// Returns `true` if the goal of an attended run was abandoned.
    pub(super) fn is_goal_abandoned(&self) -> bool {
        let lasting = self.goal_manager.as_ref();
        lasting.is_some_and(|lasting| lasting.idle_behaviour == IdleBehaviour::GoalAbandoned)
    }

    /// Returns the present plan, on the world's clock, if there is one.
    pub(super) fn present_plan(&self) -> Option<&TimeTriggeredPlan> {
        self.goal_manager.as_ref()?.plan.as_ref()
    }

    /// Returns the remaining plan, started as soon as possible, if it reaches the goal. Running
    /// actions end as expected, and the remaining steps keep their planned distances.
    fn remaining_plan(&self) -> Option<(TimeTriggeredPlan, Situation, Vec<ActionHandle>)> {
        let plan = self.goal_manager.as_ref()?.plan.as_ref()?;
        if self.settings.readies_aside && self.search_results.is_plan_infeasible {
            return None;
        }
        let is_told = |ticket: &ActionHandle| self.belief.running().contains_key(ticket);
        if !self
            .action_log
            .open_tickets()
            .all(|ticket| is_told(&ticket))
        {
            return None;
        }
        let mut left: Vec<Step> = plan.steps.clone();
        for (_, started) in self.action_log.plan_starts() {
            let name = &started.action.name;
            let same = left
                .iter()
                .enumerate()
                .filter(|(_, it)| it.action.name == *name);
            let first = same.min_by(|(_, one), (_, other)| one.start.cmp(&other.start));
            let index = first.map(|(index, _)| index)?;
            left.remove(index);
        }
        let (situation, running) = self.situation(&Rational::ZERO, OverrunEstimate::QuarterLonger);
        let rest = remaining_plan_of(&self.task, &situation, left)?;
        Some((rest, situation, running))
    }

    /// Waits without asking the executor.
    pub(super) fn wait_without_executor(&mut self) {
        let timeout = self.next_timeout();
        let soon = self.goal_manager.as_ref().and_then(|lasting| {
            let since = lasting.idle_since.as_ref()?;
            let is_waiting = !lasting.is_paused && !self.plan_events.is_empty();
            is_waiting.then(|| since + Rational::from(SEARCH_PAUSE))
        });
        let timed = self.belief.next_timed().cloned();
        let timed = timed.filter(|_| self.awaits_timed_initials() || self.has_watched_goals());
        let until = timeout.into_iter().chain(soon).chain(timed).min();
        let until = until.unwrap_or_else(|| self.settings.time_limit.clone());
        self.work_queue.push(PendingStep::CheckTimeouts);
        self.work_queue
            .push(PendingStep::Wait(until.max(self.now.clone())));
    }

    /// Returns `true` if it is time to search for a plan again.
    fn is_search_due(&self) -> bool {
        let since = self
            .goal_manager
            .as_ref()
            .and_then(|it| it.idle_since.as_ref());
        since.is_some_and(|since| {
            !self.plan_events.is_empty() && self.now >= since + Rational::from(SEARCH_PAUSE)
        })
    }

    /// Returns `true` if the run becomes idle with this verdict, and is not over.
    pub(super) fn becomes_idle_after(&self, verdict: &Verdict) -> bool {
        self.goal_manager
            .as_ref()
            .is_some_and(|lasting| lasting.idle_behaviour == IdleBehaviour::Wait)
            && match verdict {
                Verdict::GoalReached
                | Verdict::Unsolvable
                | Verdict::NoPlan { .. }
                | Verdict::PlannerFailed { .. }
                | Verdict::ReplanLimit => true,
                Verdict::TimeLimit | Verdict::Interrupted | Verdict::WorldFailed { .. } => false,
            }
    }

    /// Makes the run idle after the goals were reached, or because they cannot be reached.
    pub(super) fn become_idle(&mut self, verdict: &Verdict) {
        if self.select_goals_after(verdict) {
            return;
        }
        self.announce_goals();
        let mut reasons = self.missed_deadlines();
        let is_explained = reasons.len() == self.pursued_goals();
        if *verdict == Verdict::Unsolvable && self.is_explaining && !is_explained {
            reasons.extend(self.dead_end());
        }
        self.drop_plan();
        self.become_idle_because(Some(verdict), &reasons);
    }

    fn become_idle_because(&mut self, verdict: Option<&Verdict>, dead_end: &[Reason]) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        lasting.idle_since = Some(self.now.clone());
        lasting.is_unsolvable = verdict == Some(&Verdict::Unsolvable);
        let goals: Vec<String> = lasting.goals.iter().map(|it| it.name.clone()).collect();
        let is_reached = verdict == Some(&Verdict::GoalReached);
        if is_reached {
            let achieved = std::mem::take(&mut lasting.goals);
            self.keep_achieved(achieved);
        }
        // Without goals, there is no verdict.
        let verdict = verdict.filter(|_| !goals.is_empty());
        self.ports.recorder.record(&Entry::Resting {
            now: &self.now,
            verdict,
            goals: &goals,
            dead_end,
        });
        if is_reached {
            self.set_goal();
            // The earlier history is not needed for explanations any more.
            self.history.clear();
            self.initial_belief = self.belief.clone();
        }
        self.plan_events.clear();
        self.reasons.clear();
        self.replans = 0;
        self.search_results = SearchResults::default();
        self.refusal_backoff.reset();
        self.clock_watchdog.begin_plan();
    }
}

/// Removes repeated news of the same fact or value, which accumulate in a long pause.
fn remove_repeated_news(news: &mut Vec<PlanEvent>) {
    if news.len() < MAX_NEWS {
        return;
    }
    let (mut facts, mut values) = Default::default();
    let mut is_first = |it: &PlanEvent| match it {
        PlanEvent::Fact(fact) => std::collections::BTreeSet::insert(&mut facts, *fact),
        PlanEvent::Value(fluent) => std::collections::BTreeSet::insert(&mut values, *fluent),
        _ => true,
    };
    news.retain(|it| is_first(it));
}
