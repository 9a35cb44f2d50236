//! Continuation of a plan without a guarantee, if time is too short or numbers are insufficient and
//! no other plan was found.

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Node, NodeId, StnPlan};
use elbowroom_stn::ConsistentNetwork;

use super::{ExecutedPlan, esterel, guarantee_status};
use crate::dispatch::replan;
use crate::executor::{Decided, Decision, DecisionContext, Executor, PlanEvent};
use crate::preparation::RegionOracle;
use crate::reason::{Cause, GuaranteeLevel, Reason, Subject};

/// Class of the reduction of durations that the remaining plan needs to end in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum ReductionClass {
    /// No reduction suffices.
    #[default]
    Impossible,
    /// More than half.
    MoreThanHalf,
    /// At most half.
    AtMostHalf,
}

impl ReductionClass {
    /// Returns the least share of the planned durations that is assumed.
    fn least_duration_share(self) -> Rational {
        match self {
            Self::AtMostHalf => Rational::new(1, 2),
            Self::MoreThanHalf | Self::Impossible => Rational::ZERO,
        }
    }
}

/// A plan that is executed without a guarantee.
pub(super) struct UnguaranteedPlan {
    executor: Box<dyn Executor>,
    /// The plan is abandoned if a larger reduction of the planned durations becomes necessary.
    reduction: ReductionClass,
    /// Time until which that reduction is sufficient if no action ends before, on the world's
    /// clock.
    until: Option<Rational>,
    /// Start of the continuation. No other plan was found then.
    since: Rational,
    /// Observations that the executor has not received yet. Before it decides, another plan is
    /// searched for.
    pending_news: Vec<PlanEvent>,
}

impl UnguaranteedPlan {
    pub(super) fn executor(&self) -> &dyn Executor {
        self.executor.as_ref()
    }

    pub(super) fn fork(&self) -> Option<Self> {
        Some(Self {
            executor: self.executor.fork()?,
            reduction: self.reduction,
            until: self.until.clone(),
            since: self.since.clone(),
            pending_news: self.pending_news.clone(),
        })
    }

    /// Returns `true` if another plan is to be searched for, because an action has ended.
    pub(super) fn seeks_better_plan(&self) -> bool {
        !self.pending_news.is_empty()
    }

    /// Returns `true` if another plan may exist because an action has ended, and this plan
    /// continues meanwhile.
    fn may_be_replaced(&self, moment: &DecisionContext<'_>) -> bool {
        let has_ended = |news: &PlanEvent| matches!(news, PlanEvent::Ended { .. });
        let continues = || {
            let mut executor = self.executor.fork()?;
            Some(executor.decide(moment).decision != Decision::Replan)
        };
        self.since < *moment.now
            && moment.plan_events.iter().any(has_ended)
            && continues().unwrap_or_default()
    }

    /// Returns the decision of the executor, which receives all observations.
    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let mut news = std::mem::take(&mut self.pending_news);
        news.extend_from_slice(moment.plan_events);
        self.executor.decide(&DecisionContext {
            plan_events: &news,
            ..*moment
        })
    }
}

impl ExecutedPlan {
    /// Returns the reduction of planned durations that the remaining plan needs to succeed, after
    /// this reason to abandon it. Insufficient numbers may still suffice if durations deviate
    /// favourably.
    pub(super) fn reduction_class(&self, reason: &Reason, now: &Rational) -> ReductionClass {
        let lacks_numbers = matches!(
            (reason.cause, &reason.about),
            (
                Cause::Outlived | Cause::GuaranteeLost,
                Some(Subject::NumericConditionsWhenLonger | Subject::ExternalMessage(_)),
            )
        );
        if !lacks_numbers && !guarantee_status::lacks_time(reason) {
            return ReductionClass::Impossible;
        }
        let mut reductions = [ReductionClass::AtMostHalf, ReductionClass::MoreThanHalf].into_iter();
        let first = reductions.find(|hope| self.schedules_with_reduction(*hope, now).is_some());
        first.unwrap_or_default()
    }

    fn schedules_with_reduction(
        &self,
        hope: ReductionClass,
        now: &Rational,
    ) -> Option<ConsistentNetwork> {
        guarantee_status::schedules_if_faster(
            &self.dispatch,
            &self.values,
            &hope.least_duration_share(),
            now,
        )
    }

    /// Returns the time until which this reduction is sufficient if no action ends before; `Err` if
    /// it is not sufficient now.
    fn reduction_valid_until(
        &self,
        hope: ReductionClass,
        now: &Rational,
    ) -> Result<Option<Rational>, ()> {
        let times = self.schedules_with_reduction(hope, now).ok_or(())?;
        let running = self.dispatch.running().iter();
        let ends = running.filter_map(|it| self.dispatch.latest_end_in_network(&times, *it));
        Ok(ends.min())
    }

    fn is_feasible_without_deadlines(&self, now: &Rational, region: &mut dyn RegionOracle) -> bool {
        let rest = Self {
            ignores_deadlines: true,
            ..self.clone()
        };
        let (plan, values) = rest.remaining_plan(now);
        region.is_feasible(&self.prepared_plan.task, &plan, &values)
    }

    /// Continues by the plan's orderings. Deadlines are ignored from now on; numbers still limit running actions.
    pub(super) fn continue_by_orderings(
        &mut self,
        hope: ReductionClass,
        now: &Rational,
        region: &mut dyn RegionOracle,
    ) -> Option<UnguaranteedPlan> {
        let until = self.reduction_valid_until(hope, now).ok()?;
        let executor = esterel::continue_by_orderings(self.dispatch.clone(), now)?;
        self.ignores_deadlines = true;
        self.limit_by_numbers(now, region);
        Some(UnguaranteedPlan {
            executor,
            reduction: hope,
            until,
            since: now.clone(),
            pending_news: Vec::new(),
        })
    }

    /// Returns the decision of the executor without a guarantee, as long as the allowed reduction
    /// is sufficient.
    pub(super) fn decide_without_guarantee(
        &mut self,
        moment: &DecisionContext<'_>,
        carried_on: &mut UnguaranteedPlan,
        region: &mut dyn RegionOracle,
    ) -> Decided {
        let now = moment.now;
        let is_over = carried_on.until.as_ref().is_some_and(|until| until < now);
        if !moment.plan_events.is_empty() {
            // The other executor detects by itself whether the remaining plan is blocked.
            let _ = self.dispatch.process_news(moment);
            self.observe(moment);
            self.limit_by_numbers(now, region);
        }
        if !moment.plan_events.is_empty() || is_over {
            let Ok(until) = self.reduction_valid_until(carried_on.reduction, now) else {
                let reason = Reason::new(Cause::GuaranteeLost).about(Subject::InsufficientTime);
                return replan(reason.since(now.clone()));
            };
            carried_on.until = until;
        }
        if let Some(reason) = self.check_limits(now) {
            return replan(reason);
        }
        if carried_on.may_be_replaced(moment) {
            carried_on
                .pending_news
                .extend_from_slice(moment.plan_events);
            return Decided {
                decision: Decision::Wait {
                    until: Some(now.clone()),
                },
                reason: Reason::new(Cause::MoreSlack),
            };
        }
        let mut decided = carried_on.decide(moment);
        if let Decision::Wait { until } = &mut decided.decision {
            let epsilon = self.prepared_plan.task.epsilon();
            let hope = carried_on.until.as_ref().map(|until| until + epsilon);
            let others = self.time_after_first_limit().into_iter().chain(hope);
            *until = others.chain(until.take()).min();
        }
        decided.reason.guarantee = match decided.decision {
            Decision::Start(_) | Decision::Wait { .. } => Some(GuaranteeLevel::Luck),
            _ => None,
        };
        decided
    }

    /// Computes the numeric limits of running actions. If numbers are insufficient already, there
    /// are no limits.
    fn limit_by_numbers(&mut self, now: &Rational, region: &mut dyn RegionOracle) {
        self.limits.clear();
        if self.durations_move_numbers && self.is_feasible_without_deadlines(now, region) {
            self.find_limits(now, region);
        }
    }
}

/// Removes the deadlines of a plan: timed initials may come later.
pub(super) fn remove_deadlines(plan: &mut StnPlan) {
    let nodes = &plan.nodes;
    for constraint in &mut plan.constraints {
        let is_timed = matches!(nodes[constraint.to.index()], Node::Timed(_));
        if constraint.from == NodeId::ZERO && is_timed {
            constraint.upper = Bound::Infinite;
        }
    }
}
