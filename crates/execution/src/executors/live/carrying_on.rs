//! Continuation of a plan without a guarantee, if time is too short or numbers are insufficient and
//! no other plan was found.

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Node, NodeId, StnPlan};
use elbowroom_stn::ConsistentNetwork;

use super::{Rest, esterel, promise};
use crate::dispatch::replan;
use crate::executor::{Decided, Decision, Executor, Moment, News};
use crate::preparation::Region;
use crate::reason::{About, Cause, Promise, Reason};

/// Class of the reduction of durations that the remaining plan needs to end in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Hope {
    /// No reduction suffices.
    #[default]
    None,
    /// More than half.
    Faint,
    /// At most half.
    Fair,
}

impl Hope {
    /// Returns the least share of the planned durations that is assumed.
    fn share(self) -> Rational {
        match self {
            Self::Fair => Rational::new(1, 2),
            Self::Faint | Self::None => Rational::ZERO,
        }
    }
}

/// A plan that is executed without a guarantee.
pub(super) struct CarriedOn {
    executor: Box<dyn Executor>,
    /// The plan is abandoned if the hope falls below this.
    hope: Hope,
    /// Time until which that hope holds if no action ends before, on the world's clock.
    until: Option<Rational>,
    /// Start of the continuation. No other plan was found then.
    since: Rational,
    /// Observations that the executor has not received yet. Before it decides, another plan is
    /// searched for.
    unread: Vec<News>,
}

impl CarriedOn {
    pub(super) fn executor(&self) -> &dyn Executor {
        self.executor.as_ref()
    }

    pub(super) fn fork(&self) -> Option<Self> {
        Some(Self {
            executor: self.executor.fork()?,
            hope: self.hope,
            until: self.until.clone(),
            since: self.since.clone(),
            unread: self.unread.clone(),
        })
    }

    /// Returns `true` if another plan is to be searched for, because an action has ended.
    pub(super) fn seeks_better_plan(&self) -> bool {
        !self.unread.is_empty()
    }

    /// Returns `true` if another plan may exist because an action has ended, and this plan
    /// continues meanwhile.
    fn may_be_replaced(&self, moment: &Moment<'_>) -> bool {
        let has_ended = |news: &News| matches!(news, News::Ended { .. });
        let continues = || {
            let mut executor = self.executor.fork()?;
            Some(executor.decide(moment).decision != Decision::Replan)
        };
        self.since < *moment.now
            && moment.news.iter().any(has_ended)
            && continues().unwrap_or_default()
    }

    /// Returns the decision of the executor, which receives all observations.
    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let mut news = std::mem::take(&mut self.unread);
        news.extend_from_slice(moment.news);
        self.executor.decide(&Moment {
            news: &news,
            ..*moment
        })
    }
}

impl Rest {
    /// Returns the hope for the remaining plan after this reason to abandon it. Insufficient
    /// numbers may still suffice if durations deviate favourably.
    pub(super) fn hope(&self, reason: &Reason, now: &Rational) -> Hope {
        let lacks_numbers = matches!(
            (reason.cause, &reason.about),
            (
                Cause::Outlived | Cause::GuaranteeLost,
                Some(About::LaterNumbers | About::Said(_)),
            )
        );
        if !lacks_numbers && !promise::lacks_time(reason) {
            return Hope::None;
        }
        let mut hopes = [Hope::Fair, Hope::Faint].into_iter();
        let first = hopes.find(|hope| self.times(*hope, now).is_some());
        first.unwrap_or_default()
    }

    fn times(&self, hope: Hope, now: &Rational) -> Option<ConsistentNetwork> {
        promise::times_if_faster(&self.dispatch, &self.values, &hope.share(), now)
    }

    /// Returns the time until which there is this much hope if no action ends before; `Err` if
    /// there is less.
    fn hopes_until(&self, hope: Hope, now: &Rational) -> Result<Option<Rational>, ()> {
        let times = self.times(hope, now).ok_or(())?;
        let running = self.dispatch.running().iter();
        let ends = running.filter_map(|it| self.dispatch.latest_end_in(&times, *it));
        Ok(ends.min())
    }

    fn works_without_deadlines(&self, now: &Rational, region: &mut dyn Region) -> bool {
        let rest = Self {
            ignores_deadlines: true,
            ..self.clone()
        };
        let (plan, values) = rest.remainder(now);
        region
            .objection(&self.mission.task, &plan, &values)
            .is_none()
    }

    /// Continues by the plan's orderings. Deadlines are ignored from now on; numbers still limit running actions.
    pub(super) fn carry_on(
        &mut self,
        hope: Hope,
        now: &Rational,
        region: &mut dyn Region,
    ) -> Option<CarriedOn> {
        let until = self.hopes_until(hope, now).ok()?;
        let executor = esterel::carry_on(self.dispatch.clone(), now)?;
        self.ignores_deadlines = true;
        self.limit_by_numbers(now, region);
        Some(CarriedOn {
            executor,
            hope,
            until,
            since: now.clone(),
            unread: Vec::new(),
        })
    }

    /// Returns the decision of the executor without a guarantee, as long as there is hope.
    pub(super) fn decide_carried_on(
        &mut self,
        moment: &Moment<'_>,
        carried_on: &mut CarriedOn,
        region: &mut dyn Region,
    ) -> Decided {
        let now = moment.now;
        let is_over = carried_on.until.as_ref().is_some_and(|until| until < now);
        if !moment.news.is_empty() {
            // The other executor detects by itself whether the remaining plan is blocked.
            let _ = self.dispatch.take(moment);
            self.observe(moment);
            self.limit_by_numbers(now, region);
        }
        if !moment.news.is_empty() || is_over {
            let Ok(until) = self.hopes_until(carried_on.hope, now) else {
                let reason = Reason::new(Cause::GuaranteeLost).about(About::TooLittleTime);
                return replan(reason.since(now.clone()));
            };
            carried_on.until = until;
        }
        if let Some(reason) = self.outlived(now) {
            return replan(reason);
        }
        if carried_on.may_be_replaced(moment) {
            carried_on.unread.extend_from_slice(moment.news);
            return Decided {
                decision: Decision::Wait {
                    until: Some(now.clone()),
                },
                reason: Reason::new(Cause::MoreSlack),
            };
        }
        let mut decided = carried_on.decide(moment);
        if let Decision::Wait { until } = &mut decided.decision {
            let epsilon = self.mission.task.epsilon();
            let hope = carried_on.until.as_ref().map(|until| until + epsilon);
            let others = self.after_limit().into_iter().chain(hope);
            *until = others.chain(until.take()).min();
        }
        decided.reason.promise = match decided.decision {
            Decision::Start(_) | Decision::Wait { .. } => Some(Promise::Luck),
            _ => None,
        };
        decided
    }

    /// Computes the numeric limits of running actions. If numbers are insufficient already, there
    /// are no limits.
    fn limit_by_numbers(&mut self, now: &Rational, region: &mut dyn Region) {
        self.limits.clear();
        if self.durations_move_numbers && self.works_without_deadlines(now, region) {
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
