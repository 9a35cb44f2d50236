//! Facts and values in doubt, because it is unknown whether an action's end has happened.
//!
//! Such a fact counts as false, for planners and for executors, and a fluent keeps its value. The
//! world is asked about them before a plan is requested. A report on the action's end settles the
//! doubt, however late it comes, and so does any report on the facts and values themselves.

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, SnapAction};
use elbowroom_num::Rational;

use super::agenda::{Next, PendingStep};
use super::history::BelievedEventKind;
use super::observations::Remark;
use super::settings::{MissingPlan, Verdict};
use super::{Run, Stop};
use crate::belief_state::Doubt;
use crate::event::{ActionHandle, Ending, Measured};
use crate::executor::PlanEvent;
use crate::planning::PlanAnswer;
use crate::reason::Reason;

impl Run<'_> {
    /// Marks the effects of an action as doubtful: it is unknown whether it has ended, or whether
    /// it has started at all.
    pub(super) fn doubt(&mut self, ticket: ActionHandle, action: &Action, has_started: bool) {
        let doubt = Doubt {
            since: self.now.clone(),
            ticket,
            action: action.name.clone(),
        };
        for effects in unknown_effects(action, has_started) {
            self.belief.doubt(effects, &doubt);
        }
    }

    /// Processes a report on the end of an action that had timed out.
    pub(super) fn process_late_end(
        &mut self,
        ticket: ActionHandle,
        time: &Rational,
        ending: &Ending,
        measured: &[Measured],
    ) -> Remark {
        let entry = self.action_log.get(ticket)?;
        let (action, has_started) = (Arc::clone(&entry.action), entry.started.is_some());
        let started = entry.started.as_ref().unwrap_or(&entry.commanded).clone();
        let time = &started.clone().max(time.clone());
        self.action_log.note_doubt(ticket, false);
        self.advance_belief(time);
        let (facts, fluents) = if *ending == Ending::Succeeded {
            self.action_log.note_end(ticket, time, ending, measured);
            let effects = unknown_effects(&action, has_started);
            let duration = time - &started;
            let belief = &mut self.belief;
            belief.resolve_doubts_as_happened(ticket, &effects, &duration, measured)
        } else {
            self.belief.resolve_doubts(ticket)
        };
        for fact in facts {
            let truth = self.belief.fact(fact);
            self.record_believed_event(time, BelievedEventKind::Fact(fact, truth));
            self.plan_events.push(PlanEvent::Fact(fact));
        }
        for fluent in fluents {
            if let Some(value) = self.belief.value(fluent).cloned() {
                self.record_believed_event(time, BelievedEventKind::Value(fluent, value));
            }
            self.plan_events.push(PlanEvent::Value(fluent));
        }
        self.background.note_unexpected_event();
        Some("it had timed out; its effects are now known")
    }

    /// Asks the world about doubtful facts and values before a plan is requested, unless it was
    /// asked before. Returns `true` if it asks.
    pub(super) fn ask_about_doubts(&mut self, reason: &Reason) -> bool {
        let (facts, values) = (self.belief.doubtful_facts(), self.belief.doubtful_values());
        let doubts = facts.values().chain(values.values()).flatten();
        let latest = doubts.map(|doubt| &doubt.since).max();
        if !latest.is_some_and(|latest| self.search_results.begin_inquiry(latest)) {
            return false;
        }
        let look = Next::Look {
            facts: facts.keys().copied().collect(),
            fluents: values.keys().copied().collect(),
        };
        self.agenda.push(PendingStep::Plan(reason.clone()));
        self.agenda.ask(look);
        true
    }

    /// Ends the run if the goal holds, but only by the assumptions about doubtful facts. A plan
    /// would not change that.
    pub(super) fn stop_if_goal_is_in_doubt(&mut self) -> Result<(), Stop> {
        let is_idle = self.action_log.open_tickets().next().is_none();
        if !is_idle || !self.belief.is_goal_in_doubt() {
            return Ok(());
        }
        let why = format!(
            "whether the goal holds is in doubt: {}",
            self.describe_doubts()
        );
        Err(Stop::Ended(Verdict::NoPlan {
            why,
            missing: MissingPlan::InDoubt,
        }))
    }

    /// Continues with the present plan if the executor does; otherwise ends the run. While actions
    /// are running, doubts may be settled; a plan is then requested again when that happens, or
    /// when the actions have ended.
    pub(super) fn continue_or_stop_without_plan(
        &mut self,
        answer: &PlanAnswer,
        reason: Reason,
    ) -> Result<(), Stop> {
        let outcome = self.continue_abandoned_plan_or_stop(self.verdict_without_plan(answer));
        let running: Vec<ActionHandle> = self.action_log.open_tickets().collect();
        let doubts = self.belief.doubt_count();
        if outcome.is_err() && !running.is_empty() && doubts > 0 {
            self.agenda.push(PendingStep::Plan(reason));
            self.agenda
                .push(PendingStep::WaitForActions(running, doubts));
            return Ok(());
        }
        outcome
    }

    /// Returns the verdict if the planner has given this answer, which is not a plan. If anything
    /// is in doubt, the situation of the answer may not be the real one.
    fn verdict_without_plan(&self, answer: &PlanAnswer) -> Verdict {
        let verdict = Verdict::without_plan(answer);
        let doubts = self.describe_doubts();
        let why = match &verdict {
            _ if doubts.is_empty() => return verdict,
            Verdict::Unsolvable => answer.failure_reason().unwrap_or_default(),
            Verdict::NoPlan {
                why,
                missing: MissingPlan::NotFound,
            } => why,
            _ => return verdict,
        };
        Verdict::NoPlan {
            why: format!("{why}, but {doubts}"),
            missing: MissingPlan::InDoubt,
        }
    }

    /// Returns the facts and fluents in doubt, with the reasons; empty if there are none.
    fn describe_doubts(&self) -> String {
        let facts = self.belief.doubtful_facts().iter();
        let facts = facts.map(|(fact, doubts)| (self.task.fact_name(*fact), doubts));
        let values = self.belief.doubtful_values().iter();
        let values = values.map(|(fluent, doubts)| (self.task.fluent_name(*fluent), doubts));
        let mut by_doubt: Vec<(&Doubt, Vec<String>)> = Vec::new();
        for (name, doubts) in facts.chain(values) {
            for doubt in doubts {
                match by_doubt.iter_mut().find(|(known, _)| *known == doubt) {
                    Some((_, names)) => names.push(name.clone()),
                    None => by_doubt.push((doubt, vec![name.clone()])),
                }
            }
        }
        let doubts = by_doubt.iter().map(|(doubt, names)| {
            let (since, action) = (doubt.since.to_decimal(3), &doubt.action);
            let names = names.join(", ");
            format!(
                "since {since} it is unknown whether {action} has ended; therefore in doubt: \
                     {names}"
            )
        });
        doubts.collect::<Vec<_>>().join("; ")
    }
}

/// Returns the effects that may have happened if no end was reported.
fn unknown_effects(action: &Action, has_started: bool) -> Vec<&SnapAction> {
    match &action.body {
        Body::Instantaneous(snap) => vec![snap],
        Body::Durative(body) if has_started => vec![&body.end],
        Body::Durative(body) => vec![&body.start, &body.end],
    }
}
