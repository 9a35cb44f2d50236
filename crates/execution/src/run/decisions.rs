//! Decisions of the executor, and the commands that follow from them.

use std::sync::Arc;

use elbowroom_model::Footprint;
use elbowroom_model::ground::Action;
use elbowroom_num::{Rational, work};

use super::Run;
use super::Stop;
use super::agenda::{Next, PendingStep};
use super::search_results::AbandonedPlan;
use super::settings::Verdict;
use crate::belief_state::GoalStatus;
use crate::event::{ActionHandle, Command};
use crate::executor::{Decided, Decision, DecisionContext, Order, Planned};
use crate::reason::{Cause, Reason, Subject};
use crate::record::Entry;

/// Work units ([`elbowroom_num::work`]) of a decision, and of each step of the plan in it.
const DECISION_WORK: u64 = 10_000;
const STEP_WORK: u64 = 250;

impl Run<'_> {
    /// Lets the executor decide, and records the decision. After a stop request the decision is
    /// ignored: it may rest on incomplete computations.
    fn decide(&mut self) -> Result<Decided, Stop> {
        work::spend(DECISION_WORK + STEP_WORK.saturating_mul(self.steps as u64));
        let news = std::mem::take(&mut self.plan_events);
        let as_planned = self.background.belief_of_the_plan(&self.belief);
        let decided = self.ports.executor.decide(&DecisionContext {
            now: &self.now,
            plan_events: &news,
            belief: as_planned.as_ref().unwrap_or(&self.belief),
        });
        self.check_stop_request()?;
        self.ports.recorder.record(&Entry::Decided {
            now: &self.now,
            decided: &decided,
        });
        Ok(decided)
    }

    /// Makes a decision, and adds its consequences to the work queue.
    pub(super) fn decide_and_enqueue(&mut self) -> Result<(), Stop> {
        self.check_stop_request()?;
        self.with_goals(super::goals::GoalManager::close_momentary_goals);
        self.with_goals(super::goals::GoalManager::close_achieved_goals);
        self.with_goals(super::goals::GoalManager::tend_kept_goals);
        if self.poll_planner()? || self.handle_requests()? {
            return Ok(());
        }
        let decided = self.decide()?;
        let is_hindered = match &decided.decision {
            Decision::Start(orders) => !self.may_start(orders),
            decision => *decision == Decision::GoalReached,
        };
        if is_hindered {
            self.cancel_optional_search();
        }
        match decided.decision {
            // The plan that is being prepared could not continue these actions.
            Decision::Start(orders) if !self.may_start(&orders) => self.abandon_plan(),
            Decision::Start(orders) => {
                // Immediate starts are reported at once, and must be known before the next
                // decision.
                self.agenda.push(PendingStep::Wait(self.now.clone()));
                self.start(orders);
            }
            Decision::Cancel(steps) => {
                let tickets = steps.iter();
                let tickets = tickets.filter_map(|step| self.action_log.ticket(*step));
                self.cancel(tickets.collect());
            }
            Decision::Wait { .. } if self.seek_better_plan() => {}
            Decision::Wait { until } => self.wait(until)?,
            Decision::Replan => {
                self.cancel_search();
                let plan = AbandonedPlan::of(&self.action_log, &decided.reason);
                self.search_results.note_abandoned(plan);
                self.replan(&decided.reason)?;
            }
            // The plan has reached its goals, and another one is being made.
            Decision::GoalReached if self.background.search().is_some() => self.abandon_plan(),
            Decision::GoalReached => match self.belief.goal_status() {
                GoalStatus::Awaited(time) => self.wait(Some(self.next_goal_timed_initial(time)))?,
                GoalStatus::Reached | GoalStatus::Unmet => self.request_goal_look(),
            },
        }
        Ok(())
    }

    /// Records the starts of actions. The world receives the commands before anything else is done.
    fn start(&mut self, orders: Vec<Order>) {
        let mut commands = Vec::with_capacity(orders.len());
        for mut order in orders {
            order.action = self.whole_action(order.action);
            let ticket = self.action_log.open(&order, &self.now);
            let planned = order.duration.clone().unwrap_or_default();
            let timeout = self.settings.timeout.of(&order.action.name, &planned);
            let expected = self.domain.is_some().then(|| order.duration.clone());
            let (action, duration) = self.in_domain(order.action, order.duration);
            let expected = expected.filter(|expected| *expected != duration).flatten();
            let command = Command::Start {
                ticket,
                action,
                duration,
            };
            self.ports.recorder.record(&Entry::Command {
                now: &self.now,
                command: &command,
                planned: &order.planned,
                expected: expected.as_ref(),
                timeout: timeout.as_ref(),
            });
            commands.push(command);
        }
        self.send(commands);
    }

    /// Returns the action with all its effects. An action that was running when the plan was made has
    /// no other effects in the plan than those that could still take place. If it has to be started
    /// again, the others can take place as well.
    fn whole_action(&self, action: Arc<Action>) -> Arc<Action> {
        match self.task.instantiate(action.schema, &action.arguments) {
            Ok(whole) if whole != *action => Arc::new(whole),
            _ => action,
        }
    }

    /// Records the cancellation of actions. The world receives the commands before anything else is
    /// done.
    pub(super) fn cancel(&mut self, tickets: Vec<ActionHandle>) {
        let mut commands = Vec::with_capacity(tickets.len());
        for ticket in tickets {
            let command = Command::Cancel { ticket };
            self.ports.recorder.record(&Entry::Command {
                now: &self.now,
                command: &command,
                planned: &Planned::default(),
                expected: None,
                timeout: None,
            });
            self.action_log.note_cancel(ticket, &self.now);
            commands.push(command);
        }
        self.send(commands);
    }

    /// Sends recorded commands to the world.
    fn send(&mut self, commands: Vec<Command>) {
        self.ports.recorder.commit();
        self.agenda
            .extend(commands.into_iter().rev().map(PendingStep::Send));
    }

    /// Waits until the executor's next decision time, or until a warning or a time-out is due.
    fn wait(&mut self, until: Option<Rational>) -> Result<(), Stop> {
        let timeout = self.view().next_timeout();
        // More reports on the present moment may arrive; if none do, a condition has failed.
        let breaking = self.belief.is_over_all_failing();
        let breaking = breaking.then(|| &self.now + self.task.epsilon());
        let warning = self.warn_of_late_actions();
        let doubt = self.update_forecast();
        let until = until.into_iter().chain(timeout).chain(breaking);
        let taking_over = self.next_search_decision();
        let until = until.chain(warning).chain(doubt).chain(taking_over).min();
        let Some(until) = until else {
            // Nothing is running, nothing is due, and the plan is not done.
            return self.replan(&Reason::new(Cause::Late).about(Subject::Nothing));
        };
        self.wait_and_check_timeouts(until);
        Ok(())
    }

    /// Waits until this time, and checks the time-outs then.
    pub(super) fn wait_and_check_timeouts(&mut self, until: Rational) {
        self.agenda.push(PendingStep::CheckTimeouts);
        let until = until.max(self.now.clone());
        self.agenda.push(PendingStep::Wait(until));
    }

    /// Requests an observation of the goal, which the executor considers reached. The world's
    /// answer decides.
    pub(super) fn request_goal_look(&mut self) {
        let task = self.belief.task();
        let mut footprint = Footprint::of_condition(task, task.goal());
        self.agenda.ask(Next::Look {
            facts: std::mem::take(&mut footprint.reads).into_iter().collect(),
            fluents: footprint.reads_fluents.into_iter().collect(),
        });
    }

    pub(super) fn is_goal_certain(&self) -> bool {
        self.goal_status_without_plan() == Some(GoalStatus::Reached)
    }

    /// Returns the status of the goal if it holds, or will hold, without further actions.
    pub(super) fn goal_status_without_plan(&self) -> Option<GoalStatus> {
        let is_idle = self.action_log.open_tickets().next().is_none();
        let action_values = is_idle.then(|| self.belief.goal_status());
        action_values.filter(|action_values| *action_values != GoalStatus::Unmet)
    }

    /// Returns the next time at which timed initials may achieve a goal. If all goals must stay
    /// true, that is `time`; a goal with a deadline may already be achieved for a moment before.
    fn next_goal_timed_initial(&self, time: Rational) -> Rational {
        let next = self.belief.next_timed().cloned();
        let next = next.filter(|_| self.goals.next_deadline(&self.now).is_some());
        next.unwrap_or(time)
    }

    /// If no plan is needed, accepts the goal as reached, or waits for the timed initials that it
    /// depends on and then checks again. Returns `false` if a plan is needed.
    pub(super) fn finish_if_goal_holds(&mut self, reason: &Reason) -> bool {
        match self.goal_status_without_plan() {
            None | Some(GoalStatus::Unmet) => return false,
            Some(GoalStatus::Reached) => self.request_goal_look(),
            Some(GoalStatus::Awaited(time)) => {
                let until = self.next_goal_timed_initial(time);
                self.agenda.push(PendingStep::Replan(reason.clone()));
                self.agenda.push(PendingStep::Wait(until));
            }
        }
        self.plan_events.clear();
        true
    }

    /// Requests a plan from the present situation; see [`RunningRule`] for the running actions.
    pub(super) fn replan(&mut self, reason: &Reason) -> Result<(), Stop> {
        // The deviation may have been the end of the last step.
        if self.finish_if_goal_holds(reason) || self.wait_after_refusal(reason) {
            return Ok(());
        }
        let most = self.settings.max_replans;
        if reason.cause != Cause::NewPlan && !self.replans.try_count(reason, most) {
            let overdue = self.view().longer_than_planned();
            if overdue.is_empty() || most == 0 {
                return self.continue_abandoned_plan_or_stop(Verdict::ReplanLimit);
            }
            // Their ends may achieve the goal.
            self.replans.forget_last_reason();
            self.agenda.push(PendingStep::Replan(reason.clone()));
            let doubts = self.belief.doubt_count();
            self.agenda
                .push(PendingStep::WaitForActions(overdue, doubts));
            return Ok(());
        }
        self.search_results.note_infeasible_plan();
        self.agenda.push(PendingStep::Plan(reason.clone()));
        if self.replans.remaining(most) == 0 {
            // The last permitted plan is not requested while overdue actions are running.
            let overdue = self.view().longer_than_planned();
            let doubts = self.belief.doubt_count();
            self.agenda
                .push(PendingStep::WaitForActions(overdue, doubts));
        }
        self.settle_running_actions();
        Ok(())
    }
}
