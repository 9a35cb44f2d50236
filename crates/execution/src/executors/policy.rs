//! `policy`, on a clock: follows the plan while its guarantee costs no success probability, then
//! makes the most likely move.

mod moves;
mod rollout;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;

use super::{ExecutorEntry, Need, Needs, live};
use crate::action_values::ActionValues;
use crate::belief_state::GoalStatus as Prospect;
use crate::dispatch::replan;
use crate::executor::PlanForm;
use crate::executor::{
    Decided, Decision, DecisionContext, Executor, Order, PlanEvent, Planned, PreparedPlan, StepId,
};
use crate::reason::{Cause, Reason, Subject};

use moves::{period_start, wait};
use rollout::RolloutExecutor;

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "policy",
    argument: None,
    is_optional: false,
    summary: "Follows the plan as `live` does while that costs almost no probability of reaching \
              the goal in time, and then chooses the move with the highest success probability: to \
              start an action, to cancel one, or to wait, whether or not it is in the plan. It \
              computes these probabilities from the known distributions of durations, failures and \
              events, without knowledge of the future. If the world is too large for that, it \
              compares alternatives in samples of the world at each event: to continue, to hand the \
              remaining plan over to an executor that repeats or skips actions, to adopt another \
              plan, and to wait.",
    paper: "the policy of a semi-Markov decision process (Howard, 1971); without it, the rollout algorithm \
            (Bertsekas, Tsitsiklis & Wu, 1997); goes beyond both papers",
    needs: Needs {
        odds: Need::Always,
        action_values: true,
        rollouts: true,
        ..Needs::plan(PlanForm::OpenNetwork)
    },
    roles: &[],
    make: |_, mut means| {
        if means.action_values.is_none()
            && let Some(rehearsal) = means.rollout.take()
        {
            let keeper = (live::REGISTERED.make)(None, means);
            return Box::new(RolloutExecutor::new(rehearsal, keeper));
        }
        let action_values = means.action_values.clone();
        // An executor that evaluates moves does not need to compare plans.
        let compares = means.comparator.is_some() && action_values.is_none();
        let advantage = compares.then(|| Rational::from(5));
        Box::new(Policy {
            action_values,
            plan: (live::REGISTERED.make)(advantage, means),
            is_plan_followed: false,
            probability_loss: 0.0,
            steps: BTreeMap::new(),
            changed: Vec::new(),
            last: None,
            waited: None,
            last_command: None,
            next_step: 0,
            abandonment_reason: None,
        })
    },
};

/// Total loss of success probability that is accepted for following a plan with a guarantee.
const MAX_PROBABILITY_LOSS: f64 = 0.005;

/// Number of decisions to start or cancel actions at one time, after which the next period is
/// awaited.
const MAX_COMMANDS_PER_TIME: u32 = 50;

/// See [`REGISTERED`].
struct Policy {
    action_values: Option<Arc<dyn ActionValues>>,
    /// Executor of the plan.
    plan: Box<dyn Executor>,
    /// `true` while the plan is followed.
    is_plan_followed: bool,
    /// Loss of success probability by following the plan, in total.
    probability_loss: f64,
    /// Commanded actions that have not ended.
    steps: BTreeMap<StepId, CommandedAction>,
    /// Spontaneous changes of facts.
    changed: Vec<(FactId, bool)>,
    /// The time of the last happening.
    last: Option<Rational>,
    /// The last period at whose beginning the decision was to wait.
    waited: Option<usize>,
    /// The time of the last command, and the number of decisions with commands at that time.
    last_command: Option<(Rational, u32)>,
    /// The number of the next order.
    next_step: u32,
    /// Reason for which the plan is no longer followed.
    abandonment_reason: Option<Reason>,
}

#[derive(Clone, Debug)]
struct CommandedAction {
    name: String,
    is_of_plan: bool,
    has_started: bool,
    /// `true` if it was cancelled.
    is_cancelled: bool,
}

/// Time of the next evaluation of moves.
enum NextEvaluation {
    /// Now, in this period.
    Now(usize),
    /// At the beginning of this period.
    At(usize),
}

impl Executor for Policy {
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        let adopted = self.plan.adopt(mission);
        let instances = &mission.plan.plan.instances;
        self.steps = mission
            .running
            .keys()
            .filter_map(|step| {
                let instance = instances.get(step.instance().index())?;
                let ordered = CommandedAction {
                    name: instance.action.name.clone(),
                    is_of_plan: true,
                    has_started: true,
                    is_cancelled: false,
                };
                Some((*step, ordered))
            })
            .collect();
        self.next_step = u32::try_from(instances.len()).unwrap_or(u32::MAX);
        self.is_plan_followed = adopted.is_ok();
        self.abandonment_reason = adopted.as_ref().err().map(|reason| (**reason).clone());
        if self.action_values.is_some() {
            return Ok(());
        }
        adopted
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let (own, doubt) = self.learn(moment);
        if let Some(doubt) = doubt.filter(|_| !self.is_plan_followed) {
            return replan(doubt);
        }
        let kept = self.is_plan_followed.then(|| {
            self.plan.decide(&DecisionContext {
                plan_events: &own,
                ..*moment
            })
        });
        let action_values = self.action_values.clone();
        let decided = match (kept, action_values) {
            (Some(kept), None) => kept,
            (kept, Some(action_values)) => {
                self.decide_by_values(moment, kept, action_values.as_ref())
            }
            (None, None) => super::without_plan(),
        };
        self.record_commands(&decided, moment.now);
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let is_of_plan = self.steps.get(&step).is_some_and(|it| it.is_of_plan);
        (self.is_plan_followed && is_of_plan)
            .then(|| self.plan.window(step, is_end))
            .flatten()
    }
}

impl Policy {
    /// Processes the news. Returns the news that concern the plan, and the reason if the state has
    /// become uncertain.
    fn learn(&mut self, moment: &DecisionContext<'_>) -> (Vec<PlanEvent>, Option<Reason>) {
        let (mut own, mut doubt) = (Vec::new(), None);
        for news in moment.plan_events {
            let is_own = match news {
                PlanEvent::Started { step, time, .. } => {
                    self.last = self.last.take().max(Some(time.clone()));
                    match self.steps.get_mut(step) {
                        Some(ordered) => {
                            ordered.has_started = true;
                            ordered.is_of_plan
                        }
                        None => true,
                    }
                }
                PlanEvent::Ended { step, time, .. } => {
                    self.last = self.last.take().max(Some(time.clone()));
                    self.steps.remove(step).is_none_or(|it| it.is_of_plan)
                }
                PlanEvent::Fact(fact) => {
                    self.last = self.last.take().max(Some(moment.now.clone()));
                    self.changed.push((*fact, moment.belief.fact(*fact)));
                    true
                }
                PlanEvent::Value(_)
                | PlanEvent::Contradiction { .. }
                | PlanEvent::TimedOut { .. } => true,
            };
            if is_own {
                own.push(news.clone());
            }
            match news {
                PlanEvent::Contradiction { action } => {
                    doubt = Some(Reason::new(Cause::Contradiction).for_action(action));
                }
                PlanEvent::TimedOut { action, since } => {
                    doubt = Some(
                        Reason::new(Cause::Silence)
                            .for_action(action)
                            .since(since.clone()),
                    );
                }
                _ => {}
            }
        }
        // An instantaneous action is over when it has started.
        let running = moment.belief.running();
        self.steps.retain(|_, ordered| {
            let is_under_way = running.values().any(|it| it.action.name == ordered.name);
            !ordered.has_started || is_under_way
        });
        (own, doubt)
    }

    /// Records the commanded and cancelled actions.
    fn record_commands(&mut self, decided: &Decided, now: &Rational) {
        let orders: &[Order] = match &decided.decision {
            Decision::Start(orders) => orders,
            Decision::Cancel(steps) => {
                for step in steps {
                    if let Some(ordered) = self.steps.get_mut(step) {
                        ordered.is_cancelled = true;
                    }
                }
                &[]
            }
            _ => return,
        };
        for order in orders {
            self.steps
                .entry(order.step)
                .or_insert_with(|| CommandedAction {
                    name: order.action.name.clone(),
                    is_of_plan: true,
                    has_started: false,
                    is_cancelled: false,
                });
        }
        self.last_command = Some(match self.last_command.take() {
            Some((time, count)) if time == *now => (time, count.saturating_add(1)),
            _ => (now.clone(), 1),
        });
    }

    /// Returns the decision by the values of the moves. `kept` is the decision of the plan's
    /// executor.
    fn decide_by_values(
        &mut self,
        moment: &DecisionContext<'_>,
        kept: Option<Decided>,
        action_values: &dyn ActionValues,
    ) -> Decided {
        let kept = self.plan_decision(kept);
        // The goal holds, so the remaining steps of the plan are not needed.
        if moment.belief.goal_status() == Prospect::Reached {
            self.is_plan_followed = false;
            return self.end_if_goal_holds();
        }
        let starts = kept.as_ref().is_some_and(|kept| {
            matches!(
                kept.decision,
                Decision::Start(_) | Decision::Cancel(_) | Decision::GoalReached
            )
        });
        let mut steps = self.steps.values();
        let pending = steps.find(|ordered| !ordered.has_started || ordered.is_cancelled);
        if let Some(ordered) = pending
            && !starts
        {
            let about = if ordered.is_cancelled {
                Subject::EndOfCancelledActions
            } else {
                Subject::StartOfCommandedActions
            };
            return kept.unwrap_or_else(|| wait(None, about));
        }
        let turn = self.next_evaluation(moment.now, action_values.period());
        let period = match turn {
            NextEvaluation::Now(period) | NextEvaluation::At(period) => period,
        };
        let Some(weighed) = action_values.evaluate(&self.decision_state(
            moment.belief,
            period,
            action_values,
            None,
        )) else {
            return match (kept, turn) {
                (Some(kept), _) => kept,
                (None, NextEvaluation::Now(_)) => self.request_new_plan(moment.now),
                // Until it begins, an event may still help.
                (None, NextEvaluation::At(period)) => {
                    let until = period_start(period, action_values.period());
                    wait(Some(until), Subject::NextEvaluation(0.0))
                }
            };
        };
        if let Some(kept) = kept {
            let worth = self.plan_value(&kept, &weighed, moment.belief, period, action_values);
            let forgone = (weighed.best() - worth).max(0.0);
            let is_free = matches!(turn, NextEvaluation::At(_)) && !starts;
            if is_free || self.probability_loss + forgone <= MAX_PROBABILITY_LOSS {
                if !is_free {
                    self.probability_loss += forgone;
                }
                return self.limit_wait_to_next_period(
                    kept,
                    moment.now,
                    &turn,
                    action_values.period(),
                );
            }
            self.is_plan_followed = false;
            self.abandonment_reason = Some(Reason::new(Cause::Likelier));
        }
        match turn {
            NextEvaluation::At(period) => {
                let until = period_start(period, action_values.period());
                wait(Some(until), Subject::NextEvaluation(weighed.best()))
            }
            NextEvaluation::Now(period) => {
                self.best_decision(moment, period, &weighed, action_values.period())
            }
        }
    }

    /// Ends the run when the goal holds. Running actions are cancelled first, because the goal does
    /// not count as reached while an action is running.
    fn end_if_goal_holds(&self) -> Decided {
        let open = self.steps.iter();
        let open: Vec<StepId> = open
            .filter(|(_, ordered)| !ordered.is_cancelled)
            .map(|(step, _)| *step)
            .collect();
        if open.is_empty() && !self.steps.is_empty() {
            return wait(None, Subject::EndOfCancelledActions);
        }
        let decision = if open.is_empty() {
            Decision::GoalReached
        } else {
            Decision::Cancel(open)
        };
        Decided {
            decision,
            reason: Reason::new(Cause::GoalReached),
        }
    }

    /// Returns the decision of the plan's executor, or `None` if it requests a new plan.
    fn plan_decision(&mut self, kept: Option<Decided>) -> Option<Decided> {
        let kept = kept?;
        if kept.decision == Decision::Replan {
            self.is_plan_followed = false;
            self.abandonment_reason = Some(kept.reason);
            return None;
        }
        Some(kept)
    }

    /// Requests a new plan, because no move is known to lead to the goal.
    fn request_new_plan(&self, now: &Rational) -> Decided {
        let reason = self.abandonment_reason.clone();
        replan(reason.unwrap_or_else(|| Reason::new(Cause::NoOrder).since(now.clone())))
    }
}
