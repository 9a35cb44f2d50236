//! The moves of `policy`: the times of evaluation, the value of the plan's decision, and the best
//! move.

use std::sync::Arc;

use elbowroom_num::Rational;

use super::{MOST_AT_ONCE, Ordered, Policy, Turn};
use crate::executor::{Decided, Decision, Moment, Order, Planned, StepId};
use crate::outlook::{Move, Outlook, Standing, Weighed};
use crate::progression::Progression;
use crate::reason::{About, Cause, Reason};

impl Policy {
    /// Returns the period for the next evaluation of moves: the present one, if it has just begun.
    pub(super) fn turn(&self, now: &Rational, period: &Rational) -> Turn {
        let number = count(&(now / period).floor());
        let is_over = now - begins(number, period) > slack(period);
        if is_over || self.waited == Some(number) {
            Turn::At(number + 1)
        } else {
            Turn::Now(number)
        }
    }

    pub(super) fn standing<'a>(
        &'a self,
        belief: &'a Progression,
        period: usize,
        outlook: &dyn Outlook,
        started: Option<&'a str>,
    ) -> Standing<'a> {
        let length = outlook.period();
        let since = |start: &Rational| {
            let from = (start - slack(length)).max(Rational::ZERO);
            count(&(from / length).ceil()).min(period)
        };
        let running = belief.running().values();
        Standing {
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
    pub(super) fn worth(
        &self,
        kept: &Decided,
        weighed: &Weighed,
        belief: &Progression,
        period: usize,
        outlook: &dyn Outlook,
    ) -> f64 {
        let after = |order: &Order| {
            let name = order.action.name.as_str();
            let standing = self.standing(belief, period, outlook, Some(name));
            outlook.weigh(&standing).map_or(0.0, |it| it.best())
        };
        match &kept.decision {
            Decision::Start(orders) => orders.iter().map(after).fold(1.0, f64::min),
            Decision::Wait { .. } => weighed.by_waiting(),
            _ => weighed.best(),
        }
    }

    /// Returns the decision of the plan's executor; a wait ends at the latest when moves are
    /// evaluated next.
    pub(super) fn until_next(
        &mut self,
        kept: Decided,
        now: &Rational,
        turn: &Turn,
        length: &Rational,
    ) -> Decided {
        let Decision::Wait { until } = &kept.decision else {
            return kept;
        };
        let next = match turn {
            Turn::Now(period) => {
                self.waited = Some(*period);
                period + 1
            }
            Turn::At(period) => *period,
        };
        let next = begins(next, length);
        let until = until.clone().filter(|until| *until > *now);
        let until = until.map_or_else(|| next.clone(), |until| until.min(next.clone()));
        Decided {
            decision: Decision::Wait { until: Some(until) },
            ..kept
        }
    }

    /// Returns the decision for the best move.
    pub(super) fn best(
        &mut self,
        moment: &Moment<'_>,
        period: usize,
        weighed: &Weighed,
        length: &Rational,
    ) -> Decided {
        let now = moment.now;
        // An overdue action may be slightly late because it was started slightly late.
        let late = begins(period, length) + slack(length) / Rational::from(2);
        if weighed.is_overdue && *now < late {
            return wait(Some(late), About::EndOfRunning);
        }
        let Some((choice, value)) = weighed.moves.first() else {
            return self.hopeless(now);
        };
        let is_often =
            matches!(&self.ordered, Some((time, times)) if time == now && *times >= MOST_AT_ONCE);
        let names = |name: &str| {
            let steps = self
                .steps
                .iter()
                .filter(|(_, ordered)| ordered.name == name);
            steps.map(|(step, _)| *step).collect::<Vec<_>>()
        };
        match choice {
            Move::Start(action, planned) if !is_often => {
                if let Some(until) = self.apart(moment) {
                    return wait(Some(until), About::Start(action.name.clone()));
                }
                let step = StepId(self.next_step);
                self.next_step = self.next_step.saturating_add(1);
                let ordered = Ordered {
                    name: action.name.clone(),
                    is_of_plan: false,
                    has_started: false,
                    is_let_go: false,
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
                        .of(&action.name)
                        .about(About::BestOfAll(*value)),
                    decision: Decision::Start(vec![order]),
                }
            }
            Move::Cancel(name) if !is_often && !names(name).is_empty() => Decided {
                decision: Decision::Cancel(names(name)),
                reason: Reason::new(Cause::Likelier)
                    .of(name)
                    .about(About::WithoutEndOf(name.clone())),
            },
            _ => {
                self.waited = Some(period);
                let until = begins(period + 1, length);
                wait(Some(until), About::NextDecision(*value))
            }
        }
    }

    /// Returns the time until which a start has to wait, so that it is ε after the last happening.
    pub(super) fn apart(&self, moment: &Moment<'_>) -> Option<Rational> {
        let task = moment.belief.task();
        let timed = task.timed().iter().map(|timed| &timed.time);
        let last = timed.filter(|time| *time <= moment.now).chain(&self.last);
        let until = last.max()? + task.epsilon();
        (until > *moment.now).then_some(until)
    }
}

/// Returns the beginning of a period.
pub(super) fn begins(period: usize, length: &Rational) -> Rational {
    length * &Rational::from(i64::try_from(period).unwrap_or(i64::MAX))
}

/// Returns the time after the beginning of a period during which moves are still evaluated.
fn slack(length: &Rational) -> Rational {
    length / Rational::from(4)
}

fn count(whole: &Rational) -> usize {
    let (number, _) = whole.as_small().unwrap_or_default();
    usize::try_from(number).unwrap_or_default()
}

pub(super) fn wait(until: Option<Rational>, why: About) -> Decided {
    Decided {
        decision: Decision::Wait { until },
        reason: Reason::new(Cause::NothingDue).about(why),
    }
}
