//! `policy` without a table: the possible choices are compared by rollouts.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;

use crate::belief_state::BeliefState;
use crate::dispatch::replan;
use crate::event::{ActionHandle, Ending};
use crate::executor::PlanForm;
use crate::executor::{
    Decided, Decision, DecisionContext, Executor, Order, PlanEvent, Planned, PreparedPlan, StepId,
};
use crate::reason::{Cause, Reason, Subject};
use crate::rollout::{DecisionPoint, ObservedChange, RolloutChoice, RolloutEvaluator};

use super::moves::wait;

/// Maximum number of hand-overs of an abandoned plan without a successful action in between. Beyond
/// it, a new plan is requested, and the number of new plans is limited.
const MAX_HAND_OVERS: usize = 10;

/// Number of evaluations by rollouts within the duration of a plan if nothing happens.
const ROLLOUTS_PER_PLAN: i64 = 8;

/// Executor that follows plans as `live` does, or hands them over to an executor that does better.
/// It abandons a plan if another one is more likely to succeed. Success probabilities are the
/// shares of samples of the world in which the goal is reached.
///
/// The step numbers of `live` are those of the run; those of other executors are translated.
pub(super) struct RolloutExecutor {
    rehearsal: Box<dyn RolloutEvaluator>,
    /// `live`, which adopts each new plan.
    live_executor: Box<dyn Executor>,
    /// The executor that has taken over the plan.
    takeover_executor: Option<Box<dyn Executor>>,
    /// Steps that have not ended, by the run's number: commanded ones, and those that were running
    /// when the plan was adopted.
    steps: BTreeMap<StepId, CommandedStep>,
    /// The next step number of the run.
    next_step: u32,
    /// The steps of the plan that have not begun, on the world's clock.
    remaining_steps: Vec<Step>,
    /// The number of hand-overs of an abandoned plan since an action last succeeded.
    hand_overs: usize,
    /// The watched facts with their last truth.
    watched: Option<BTreeMap<FactId, bool>>,
    observed_changes: Vec<ObservedChange>,
    /// Number of plans adopted.
    plans: usize,
    /// News that the present executor has not received, because the decision was to wait.
    pending_news: Vec<PlanEvent>,
    /// `true` if the plan is new.
    is_new: bool,
    /// `true` if an evaluation by rollouts is due that had to be postponed.
    is_rollout_due: bool,
    /// `true` if a rehearsal would have the same result as the last one: that one took place while
    /// no action was running, or found no need for alternatives, and nothing has been learnt about
    /// the world since.
    is_result_unchanged: bool,
    /// The time of the last rollouts, and the time between two evaluations by rollouts.
    last_rollout: Option<Rational>,
    period: Rational,
}

/// A step that has not ended.
#[derive(Clone, Debug)]
struct CommandedStep {
    /// The step number of the present executor; `None` if that executor does not know the step.
    inner: Option<StepId>,
    name: String,
    /// The ticket, if it is known.
    ticket: Option<ActionHandle>,
    /// The plan's step, which is repeated if it fails; `None` if it was running when the plan was
    /// adopted.
    step: Option<Step>,
    /// The time of its start.
    started: Option<Rational>,
    is_cancelled: bool,
}

impl RolloutExecutor {
    pub(super) fn new(rehearsal: Box<dyn RolloutEvaluator>, keeper: Box<dyn Executor>) -> Self {
        Self {
            rehearsal,
            live_executor: keeper,
            takeover_executor: None,
            steps: BTreeMap::new(),
            next_step: 0,
            remaining_steps: Vec::new(),
            hand_overs: 0,
            watched: None,
            observed_changes: Vec::new(),
            plans: 0,
            pending_news: Vec::new(),
            is_new: false,
            is_rollout_due: false,
            is_result_unchanged: false,
            last_rollout: None,
            period: Rational::ONE,
        }
    }

    fn present_executor(&mut self) -> &mut dyn Executor {
        match &mut self.takeover_executor {
            Some(other) => other.as_mut(),
            None => self.live_executor.as_mut(),
        }
    }

    /// Processes the news. Returns them with the step numbers of the present executor.
    fn learn(&mut self, moment: &DecisionContext<'_>) -> Vec<PlanEvent> {
        self.record_changes(moment);
        if moment
            .plan_events
            .iter()
            .any(|news| self.is_informative(news))
        {
            self.is_result_unchanged = false;
        }
        let mut told = Vec::with_capacity(moment.plan_events.len());
        for news in moment.plan_events {
            match news {
                PlanEvent::Started { step, .. } | PlanEvent::Ended { step, .. } => {
                    let inner = match self.steps.get(step) {
                        Some(commanded) => commanded.inner,
                        // A step of an earlier plan. `live` receives it unchanged.
                        None => self.takeover_executor.is_none().then_some(*step),
                    };
                    if let Some(inner) = inner {
                        told.push(renumber_news(news, inner));
                    }
                    self.record_news(*step, news);
                }
                _ => told.push(news.clone()),
            }
        }
        told
    }

    /// Returns `true` if the news item carries information about the world.
    fn is_informative(&self, news: &PlanEvent) -> bool {
        let of = |step| {
            let step: Option<&CommandedStep> = self.steps.get(step);
            step.map(|step| self.rehearsal.informativeness(&step.name))
        };
        match news {
            // If the time of the end is random, so is the time of the start.
            PlanEvent::Started { step, .. } => of(step).is_none_or(|tells| tells.while_running),
            PlanEvent::Ended { step, ending, .. } => {
                *ending != Ending::Succeeded || of(step).is_none_or(|tells| tells.on_end)
            }
            PlanEvent::Fact(_)
            | PlanEvent::Value(_)
            | PlanEvent::Contradiction { .. }
            | PlanEvent::TimedOut { .. } => true,
        }
    }

    /// Returns `true` if the passage of time carries information about the world.
    fn is_time_informative(&self) -> bool {
        let mut under_way = self.steps.values();
        self.rehearsal.is_time_informative()
            || under_way.any(|step| self.rehearsal.informativeness(&step.name).while_running)
    }

    fn record_news(&mut self, step: StepId, news: &PlanEvent) {
        match news {
            PlanEvent::Started { time, .. } => {
                if let Some(commanded) = self.steps.get_mut(&step) {
                    commanded.started = Some(time.clone());
                    let is_over = |step: &Step| step.duration.is_none();
                    if commanded.step.as_ref().is_some_and(is_over) {
                        self.steps.remove(&step);
                    }
                }
            }
            PlanEvent::Ended { ending, .. } => {
                if *ending == Ending::Succeeded {
                    self.hand_overs = 0;
                }
                if let Some(commanded) = self.steps.remove(&step)
                    && *ending != Ending::Succeeded
                {
                    self.remaining_steps.extend(commanded.step);
                }
            }
            _ => {}
        }
    }

    /// Records changes of the watched facts.
    fn record_changes(&mut self, moment: &DecisionContext<'_>) {
        let task = moment.belief.task();
        let rehearsal = &self.rehearsal;
        let watched = self.watched.get_or_insert_with(|| {
            let initially = |fact: &FactId| task.initial().facts.contains(fact);
            let facts = rehearsal.watched_facts(task).into_iter();
            facts.map(|fact| (fact, initially(&fact))).collect()
        });
        for (fact, known) in watched.iter_mut() {
            let truth = moment.belief.fact(*fact);
            if truth != *known {
                *known = truth;
                self.observed_changes.push(ObservedChange {
                    time: moment.now.clone(),
                    fact: *fact,
                    truth,
                    is_spontaneous: moment.plan_events.contains(&PlanEvent::Fact(*fact)),
                });
            }
        }
    }

    /// Returns `true` if rollouts are to be made now. `kept` is the decision of the present
    /// executor.
    fn is_rollout_needed(&mut self, moment: &DecisionContext<'_>, kept: &Decided) -> bool {
        let may_matter = |news: &PlanEvent| !matches!(news, PlanEvent::Started { .. });
        let is_due = |looked: &Rational| *moment.now >= looked + &self.period;
        let is_due = self.last_rollout.as_ref().is_none_or(is_due);
        // Rollouts with the same samples of an unchanged world have the same result.
        let may_differ = !self.is_result_unchanged || is_due && self.is_time_informative();
        let is_occasion = self.is_rollout_due
            || self.is_new
            || kept.decision == Decision::Replan
            || may_differ && (moment.plan_events.iter().any(may_matter) || is_due);
        let mut steps = self.steps.values();
        let is_busy = steps.any(|step| step.started.is_none() || step.is_cancelled);
        let is_over = matches!(kept.decision, Decision::GoalReached | Decision::Cancel(_));
        self.is_rollout_due = is_occasion && is_busy;
        is_occasion && !is_busy && !is_over
    }

    /// Returns the tickets of the running steps, by the step numbers of the present executor.
    fn running(&mut self, belief: &BeliefState) -> BTreeMap<StepId, ActionHandle> {
        for commanded in self.steps.values_mut() {
            let mut running = belief.running().iter();
            let own = running.find(|(_, it)| {
                it.action.name == commanded.name && Some(&it.start) == commanded.started.as_ref()
            });
            commanded.ticket = commanded.ticket.or(own.map(|(ticket, _)| *ticket));
        }
        let steps = self.steps.values();
        let known = steps.filter_map(|it| Some((it.inner?, it.ticket?)));
        known
            .filter(|(_, ticket)| belief.running().contains_key(ticket))
            .collect()
    }

    /// Returns the decision that is best in rollouts. `before` is the present executor before
    /// it decided `kept`.
    fn decide_by_rollout(
        &mut self,
        moment: &DecisionContext<'_>,
        news: &[PlanEvent],
        before: Box<dyn Executor>,
        kept: Decided,
    ) -> Decided {
        self.last_rollout = Some(moment.now.clone());
        let running = self.running(moment.belief);
        let is_new = std::mem::take(&mut self.is_new);
        let rehearsed = self.rehearsal.evaluate(&DecisionPoint {
            belief: moment.belief,
            observed_changes: &self.observed_changes,
            executor: before.as_ref(),
            plan_events: news,
            running: &running,
            is_plan_abandoned: kept.decision == Decision::Replan,
            is_plan_new: is_new,
            remaining_steps: &self.remaining_steps,
            replans: self.plans.saturating_sub(1),
        });
        self.is_result_unchanged = rehearsed.are_alternatives_skipped || running.is_empty();
        match rehearsed.choice {
            RolloutChoice::FollowExecutor => self.adapt_commands(kept, moment.now),
            RolloutChoice::Replan => {
                let about = Subject::SuccessProbabilities {
                    present: rehearsed.executor_value,
                    other: rehearsed.value,
                };
                let reason = Reason::new(Cause::Likelier).about(about);
                replan(reason.since(moment.now.clone()))
            }
            RolloutChoice::WaitUntil(until) => {
                self.is_result_unchanged = false;
                *self.present_executor_box() = before;
                self.pending_news = news.to_vec();
                self.last_rollout = None;
                let value = rehearsed.value.to_f64();
                wait(Some(until), Subject::NextEvaluation(value))
            }
            RolloutChoice::HandOver(..)
                if kept.decision == Decision::Replan && self.hand_overs >= MAX_HAND_OVERS =>
            {
                self.adapt_commands(kept, moment.now)
            }
            RolloutChoice::HandOver(executor, mission) => {
                if kept.decision == Decision::Replan {
                    self.hand_overs += 1;
                }
                match self.hand_over(moment, executor, &mission) {
                    Some(decided) => decided,
                    None => self.adapt_commands(kept, moment.now),
                }
            }
        }
    }

    fn present_executor_box(&mut self) -> &mut Box<dyn Executor> {
        match &mut self.takeover_executor {
            Some(other) => other,
            None => &mut self.live_executor,
        }
    }

    /// Hands the remaining plan over to another executor. Returns its decision, or `None` if it
    /// cannot adopt the plan.
    fn hand_over(
        &mut self,
        moment: &DecisionContext<'_>,
        mut executor: Box<dyn Executor>,
        mission: &PreparedPlan,
    ) -> Option<Decided> {
        executor.adopt(mission).ok()?;
        for commanded in self.steps.values_mut() {
            let mut running = mission.running.iter();
            let own = running.find(|(_, ticket)| commanded.ticket == Some(**ticket));
            commanded.inner = own.map(|(step, _)| *step);
        }
        let decided = executor.decide(&DecisionContext {
            plan_events: &[],
            ..*moment
        });
        self.takeover_executor = Some(executor);
        Some(self.adapt_commands(decided, moment.now))
    }

    /// Translates a decision of the present executor to the run's step numbers. A wait ends at the
    /// latest when the next rollouts are due.
    fn adapt_commands(&mut self, mut decided: Decided, now: &Rational) -> Decided {
        match &mut decided.decision {
            Decision::Start(orders) => {
                for order in orders {
                    self.renumber_order(order, now);
                }
            }
            Decision::Cancel(steps) => {
                for step in steps {
                    let mut own = self.steps.iter_mut();
                    if let Some((outer, commanded)) =
                        own.find(|(_, commanded)| commanded.inner == Some(*step))
                    {
                        commanded.is_cancelled = true;
                        *step = *outer;
                    }
                }
            }
            Decision::Wait { until } => {
                let next = self
                    .last_rollout
                    .as_ref()
                    .map(|looked| looked + &self.period);
                let next = next.filter(|next| next > now && !self.steps.is_empty());
                *until = until.take().into_iter().chain(next).min();
            }
            Decision::Replan | Decision::GoalReached => {}
        }
        decided
    }

    fn renumber_order(&mut self, order: &mut Order, now: &Rational) {
        let inner = order.step;
        if self.takeover_executor.is_some() {
            order.step = StepId(self.next_step);
            self.next_step = self.next_step.saturating_add(1);
        }
        let name = &order.action.name;
        let mut left = self.remaining_steps.iter().enumerate();
        let place = left.find(|(_, step)| step.action.name == *name);
        let step = match place.map(|(place, _)| place) {
            Some(place) => self.remaining_steps.remove(place),
            None => Step {
                start: now.clone(),
                action: Arc::clone(&order.action),
                duration: order.duration.clone(),
            },
        };
        let commanded = CommandedStep {
            inner: Some(inner),
            name: name.clone(),
            ticket: None,
            step: Some(step),
            started: None,
            is_cancelled: false,
        };
        self.steps.insert(order.step, commanded);
    }
}

fn renumber_news(news: &PlanEvent, inner: StepId) -> PlanEvent {
    let mut news = news.clone();
    if let PlanEvent::Started { step, .. } | PlanEvent::Ended { step, .. } = &mut news {
        *step = inner;
    }
    news
}

impl Executor for RolloutExecutor {
    fn need(&self) -> PlanForm {
        self.live_executor.need()
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        self.takeover_executor = None;
        self.pending_news.clear();
        let under_way = mission.time_triggered.steps.iter().zip(&mission.instances);
        let own = |step: &Step| Step {
            start: &step.start + &mission.origin,
            ..step.clone()
        };
        self.steps = under_way
            .filter_map(|(step, instance)| {
                let number = StepId::from(*instance);
                let commanded = CommandedStep {
                    inner: Some(number),
                    name: step.action.name.clone(),
                    ticket: Some(*mission.running.get(&number)?),
                    step: None,
                    started: Some(mission.now.clone()),
                    is_cancelled: false,
                };
                Some((number, commanded))
            })
            .collect();
        let steps = mission.time_triggered.steps.iter();
        self.remaining_steps = steps.skip(mission.running.len()).map(own).collect();
        self.next_step = u32::try_from(mission.plan.plan.instances.len()).unwrap_or(u32::MAX);
        self.plans += 1;
        self.is_new = true;
        self.hand_overs = 0;
        self.is_result_unchanged = false;
        let ends = mission.time_triggered.steps.iter().map(Step::end);
        let length = ends.max().unwrap_or_default();
        self.period = (length / Rational::from(ROLLOUTS_PER_PLAN)).max(Rational::ONE);
        self.live_executor.adopt(mission)
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let mut news = std::mem::take(&mut self.pending_news);
        news.extend(self.learn(moment));
        let before = self.present_executor().fork();
        let kept = self.present_executor().decide(&DecisionContext {
            plan_events: &news,
            ..*moment
        });
        match before {
            Some(before) if self.is_rollout_needed(moment, &kept) => {
                self.decide_by_rollout(moment, &news, before, kept)
            }
            _ => self.adapt_commands(kept, moment.now),
        }
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let inner = self.steps.get(&step)?.inner?;
        match &self.takeover_executor {
            Some(other) => other.window(inner, is_end),
            None => self.live_executor.window(inner, is_end),
        }
    }
}
