//! The moves of `policy`: the times of evaluation, the value of the plan's decision, and the best
//! move.

use std::sync::Arc;

use elbowroom_num::Rational;

use super::{CommandedAction, MAX_COMMANDS_PER_TIME, NextEvaluation, Policy};
use crate::action_values::{ActionValues, DecisionState, Move, RankedMoves};
use crate::belief_state::BeliefState;
use crate::executor::{Decided, Decision, DecisionContext, Order, Planned, StepId};
use crate::reason::{Cause, Reason, Subject};

impl Policy {
    /// Returns the period for the next evaluation of moves: the present one, if it has just begun.
    pub(super) fn next_evaluation(&self, now: &Rational, period: &Rational) -> NextEvaluation {
        let number = count(&(now / period).floor());
        let is_over = now - period_start(number, period) > evaluation_tolerance(period);
        if is_over || self.waited == Some(number) {
            NextEvaluation::At(number + 1)
        } else {
            NextEvaluation::Now(number)
        }
    }

    pub(super) fn decision_state<'a>(
        &'a self,
        belief: &'a BeliefState,
        period: usize,
        action_values: &dyn ActionValues,
        started: Option<&'a str>,
    ) -> DecisionState<'a> {
        let length = action_values.period();
        let since = |start: &Rational| {
            let from = (start - evaluation_tolerance(length)).max(Rational::ZERO);
            count(&(from / length).ceil()).min(period)
        };
        let running = belief.running().values();
        DecisionState {
            period,
            belief,
            running: running
                .map(|it| (it.action.name.as_str(), since(&it.start)))
                .collect(),
            changed: &self.changed,
            started,
        }
    }

    /// Returns the success probability of the decision of the plan's executor.
    pub(super) fn plan_value(
        &self,
        kept: &Decided,
        weighed: &RankedMoves,
        belief: &BeliefState,
        period: usize,
        action_values: &dyn ActionValues,
    ) -> f64 {
        let after = |order: &Order| {
            let name = order.action.name.as_str();
            let standing = self.decision_state(belief, period, action_values, Some(name));
            action_values
                .evaluate(&standing)
                .map_or(0.0, |it| it.best())
        };
        match &kept.decision {
            Decision::Start(orders) => orders.iter().map(after).fold(1.0, f64::min),
            Decision::Wait { .. } => weighed.value_of_waiting(),
            _ => weighed.best(),
        }
    }

    /// Returns the decision of the plan's executor; a wait ends at the latest when moves are
    /// evaluated next.
    pub(super) fn limit_wait_to_next_period(
        &mut self,
        kept: Decided,
        now: &Rational,
        turn: &NextEvaluation,
        length: &Rational,
    ) -> Decided {
        let Decision::Wait { until } = &kept.decision else {
            return kept;
        };
        let next = match turn {
            NextEvaluation::Now(period) => {
                self.waited = Some(*period);
                period + 1
            }
            NextEvaluation::At(period) => *period,
        };
        let next = period_start(next, length);
        let until = until.clone().filter(|until| *until > *now);
        let until = until.map_or_else(|| next.clone(), |until| until.min(next.clone()));
        Decided {
            decision: Decision::Wait { until: Some(until) },
            ..kept
        }
    }

    /// Returns the decision for the best move.
    pub(super) fn best_decision(
        &mut self,
        moment: &DecisionContext<'_>,
        period: usize,
        weighed: &RankedMoves,
        length: &Rational,
    ) -> Decided {
        let now = moment.now;
        // An overdue action may be slightly late because it was started slightly late.
        let late = period_start(period, length) + evaluation_tolerance(length) / Rational::from(2);
        if weighed.is_action_overdue && *now < late {
            return wait(Some(late), Subject::EndOfRunningActions);
        }
        let Some((choice, value)) = weighed.moves.first() else {
            return self.request_new_plan(now);
        };
        let is_often = matches!(&self.last_command, Some((time, times)) if time == now && *times >= MAX_COMMANDS_PER_TIME);
        let names = |name: &str| {
            let steps = self
                .steps
                .iter()
                .filter(|(_, ordered)| ordered.name == name);
            steps.map(|(step, _)| *step).collect::<Vec<_>>()
        };
        match choice {
            Move::Start(action, planned) if !is_often => {
                if let Some(until) = self.separation_end(moment) {
                    return wait(Some(until), Subject::Start(action.name.clone()));
                }
                let step = StepId(self.next_step);
                self.next_step = self.next_step.saturating_add(1);
                let ordered = CommandedAction {
                    name: action.name.clone(),
                    is_of_plan: false,
                    has_started: false,
                    is_cancelled: false,
                };
                self.steps.insert(step, ordered);
                let order = Order {
                    step,
                    action: Arc::clone(action),
                    duration: planned.clone(),
                    planned: Planned {
                        earliest: Some(now.clone()),
                        latest: None,
                    },
                };
                Decided {
                    reason: Reason::new(Cause::Due)
                        .for_action(&action.name)
                        .about(Subject::BestChoice(*value)),
                    decision: Decision::Start(vec![order]),
                }
            }
            Move::Cancel(name) if !is_often && !names(name).is_empty() => Decided {
                decision: Decision::Cancel(names(name)),
                reason: Reason::new(Cause::Likelier)
                    .for_action(name)
                    .about(Subject::WithoutEndOf(name.clone())),
            },
            _ => {
                self.waited = Some(period);
                let until = period_start(period + 1, length);
                wait(Some(until), Subject::NextEvaluation(*value))
            }
        }
    }

    /// Returns the time until which a start has to wait, so that it is ε after the last happening.
    pub(super) fn separation_end(&self, moment: &DecisionContext<'_>) -> Option<Rational> {
        let task = moment.belief.task();
        let timed = task.timed().iter().map(|timed| &timed.time);
        let last = timed.filter(|time| *time <= moment.now).chain(&self.last);
        let until = last.max()? + task.epsilon();
        (until > *moment.now).then_some(until)
    }
}

/// Returns the beginning of a period.
pub(super) fn period_start(period: usize, length: &Rational) -> Rational {
    length * &Rational::from(i64::try_from(period).unwrap_or(i64::MAX))
}

/// Returns the time after the beginning of a period during which moves are still evaluated.
fn evaluation_tolerance(length: &Rational) -> Rational {
    length / Rational::from(4)
}

fn count(whole: &Rational) -> usize {
    let (number, _) = whole.as_small().unwrap_or_default();
    usize::try_from(number).unwrap_or_default()
}

pub(super) fn wait(until: Option<Rational>, why: Subject) -> Decided {
    Decided {
        decision: Decision::Wait { until },
        reason: Reason::new(Cause::NothingDue).about(why),
    }
}
