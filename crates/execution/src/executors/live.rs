//! `live`: the envelope is recomputed after each observation, with the observed values fixed.

mod alternative;
mod carrying_on;
mod inside;
mod limits;
mod repetition;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Change, Effect, Expression};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{Bound, InstanceId, ParameterId, ParametrizedPlan, Valuation};
use inside::Inside;

use self::carrying_on::{CarriedOn, Hope};
use self::repetition::Repetition;
use super::{Registered, esterel, promise};
use crate::dispatch::{Bounds, Dispatch, replan};
use crate::event::Measured;
use crate::executor::{CAN_HAVE_A_CLOCK, Need};
use crate::executor::{Decided, Decision, Executor, Mission, Moment, News, Planned, StepId};
use crate::odds::{Odds, Remainder};
use crate::preparation::Region;
use crate::quantities::{Amounts, amounts, duration_parameters, places};
use crate::reason::{About, Cause, Promise, Reason};

pub(super) const REGISTERED: Registered = Registered {
    name: "live",
    argument: Some("number of percentage points"),
    is_optional: true,
    summary: "Dispatches so that the rest of the plan works whatever happens within its envelope. \
              When a value leaves it, gives the strongest guarantee that still holds for the rest, \
              with the observed values fixed, and replans only when the rest does not work even if \
              nothing deviates any more. Where time is lacking or numbers fall short, and no other \
              plan is found, it carries on by the plan's orderings, without a guarantee, as \
              `esterel` does; likewise with a plan that is made again after durations have broken \
              it twice. With a \
              number, it also replans while no action is running and another plan is more likely \
              to succeed, by at least that number of percentage points, in the world that the \
              world file describes.",
    paper: "goes beyond Cashmore et al. (2020)",
    need: Need::OpenNetwork,
    make: |argument, means| {
        let advantage = argument.map(|points| points / Rational::from(100));
        Box::new(Live {
            region: means.region,
            odds: means.odds.zip(advantage),
            state: None,
            hope: Hope::None,
            carried_on: None,
            repetition: Repetition::default(),
        })
    },
};

/// See [`REGISTERED`].
struct Live {
    region: Box<dyn Region>,
    /// The comparison of plans, and the advantage that another plan must have.
    odds: Option<(Box<dyn Odds>, Rational)>,
    state: Option<Rest>,
    /// The hope for the plan that was abandoned last.
    hope: Hope,
    /// A plan that is executed without a guarantee.
    carried_on: Option<CarriedOn>,
    repetition: Repetition,
}

/// A plan being executed, with the knowledge about its open parameters.
#[derive(Clone)]
struct Rest {
    dispatch: Dispatch,
    /// The guarantee of the remaining plan.
    promise: Promise,
    /// The guarantee when a better plan was last searched for, or when the plan began.
    sought_at: Promise,
    mission: Arc<Mission>,
    /// The observed values, and nominal ones for the rest.
    values: Valuation,
    /// Duration parameters by instance, and the parameters that occur in constraints.
    durations: BTreeMap<InstanceId, ParameterId>,
    in_constraints: BTreeSet<ParameterId>,
    /// Observations, compared with the envelope.
    inside: Inside,
    /// Measured amounts: the instance, `true` for its end or `false` for its start, and the amount.
    amounts: Vec<(InstanceId, bool, Measured)>,
    /// `true` if the plan's conditions are more than single facts, and if any number depends on a
    /// duration.
    reads_more_than_facts: bool,
    durations_move_numbers: bool,
    /// Longest durations of running actions, as far as they were computed; `None` if numbers do not
    /// limit the duration. An action without an entry may take as long as the envelope permits.
    limits: BTreeMap<InstanceId, Option<Rational>>,
    /// `true` if the remaining plan is continued although it is too late for a deadline.
    ignores_deadlines: bool,
}

impl Executor for Live {
    fn need(&self) -> Need {
        REGISTERED.need
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        let region = self.region.as_mut();
        self.repetition.note_adopted(&mission.time_triggered);
        let by_orderings = self.repetition.is_by_orderings();
        let by_orderings = by_orderings.then(|| Rest::by_orderings(mission, region));
        let (rest, carried_on) = match by_orderings.flatten() {
            Some((rest, carried_on)) => (rest, Some(carried_on)),
            None => (Rest::new(mission, region)?, None),
        };
        self.state = Some(rest);
        self.hope = Hope::None;
        self.carried_on = carried_on;
        Ok(())
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let rest = self.state.as_ref();
        if rest.is_some_and(|rest| rest.has_untimely_end(moment.news)) {
            self.repetition.note_untimely_end();
        }
        let decided = match (&mut self.carried_on, &mut self.state) {
            (Some(carried_on), Some(rest)) => {
                rest.decide_carried_on(moment, carried_on, self.region.as_mut())
            }
            _ => self.decide_by_guarantee(moment),
        };
        let is_abandoned = decided.decision == Decision::Replan;
        if is_abandoned {
            self.repetition.note_abandoned(&decided.reason);
        }
        let rest = self.state.as_ref().filter(|_| is_abandoned);
        let hope = rest.map(|rest| rest.hope(&decided.reason, moment.now));
        self.hope = hope.unwrap_or_default();
        decided
    }

    fn may_carry_on(&self) -> bool {
        self.hope == Hope::Fair
    }

    fn carry_on(&mut self, now: &Rational) -> bool {
        let hope = self.hope;
        let rest = self.state.as_mut().filter(|_| hope > Hope::None);
        self.carried_on = rest.and_then(|rest| rest.carry_on(hope, now, self.region.as_mut()));
        self.carried_on.is_some()
    }

    fn seeks_better_plan(&mut self, now: &Rational) -> bool {
        if let Some(carried_on) = &self.carried_on {
            return carried_on.seeks_better_plan();
        }
        let rest = self.state.as_mut();
        rest.is_some_and(|rest| rest.seeks_better_plan(now))
    }

    fn prefers(&self, mission: &Mission, now: &Rational) -> bool {
        if self.carried_on.is_some() {
            return promise::begin(mission).is_ok_and(|(_, promise)| promise < Promise::Luck);
        }
        let rest = self.state.as_ref();
        rest.is_some_and(|rest| rest.is_worse_than(mission, now))
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        if let Some(carried_on) = &self.carried_on {
            return carried_on.executor().window(step, is_end);
        }
        self.state.as_ref()?.dispatch.planned(step, is_end)
    }

    fn bears_until(&self, step: StepId, now: &Rational) -> Option<Rational> {
        let is_guaranteed = self.carried_on.is_none();
        let rest = self
            .state
            .as_ref()
            .filter(|_| CAN_HAVE_A_CLOCK && is_guaranteed)?;
        rest.bears_until(step.instance(), now)
    }

    /// The copy does not compare plans.
    fn fork(&self) -> Option<Box<dyn Executor>> {
        let carried_on = match &self.carried_on {
            Some(carried_on) => Some(carried_on.fork()?),
            None => None,
        };
        Some(Box::new(Self {
            region: self.region.fork()?,
            odds: None,
            state: self.state.clone(),
            hope: self.hope,
            carried_on,
            repetition: self.repetition.clone(),
        }))
    }
}

impl Live {
    fn decide_by_guarantee(&mut self, moment: &Moment<'_>) -> Decided {
        let Some(rest) = &mut self.state else {
            return super::without_plan();
        };
        if !moment.news.is_empty()
            && let Some(reason) = rest.learn(moment, self.region.as_mut())
        {
            return replan(*reason);
        }
        if let Some((odds, advantage)) = &mut self.odds
            && let Some(reason) = rest.likelier(moment, odds.as_mut(), advantage)
        {
            return replan(reason);
        }
        if let Some(reason) = rest.come_to_limits(moment.now, self.region.as_mut()) {
            return replan(*reason);
        }
        if let Some(reason) = rest.outlived(moment.now) {
            return replan(reason);
        }
        if let Some(reason) = rest.dispatch.overdue(moment)
            && let Err(reason) = rest.weaken(moment.now, reason, false)
        {
            return replan(*reason);
        }
        let decided = rest.dispatch.next(moment);
        let mut decided = rest.waking(decided);
        decided.reason.promise = match decided.decision {
            Decision::Start(_) | Decision::Wait { .. } => Some(rest.promise),
            _ => None,
        };
        decided
    }
}

impl Rest {
    /// Begins with a plan.
    fn new(mission: &Mission, region: &mut dyn Region) -> Result<Self, Box<Reason>> {
        let plan = &mission.plan;
        let (dispatch, promise) = promise::begin(mission)?;
        let reads_more_than_facts = plan.reads_more_than_facts(&mission.task);
        let mut rest = Self {
            dispatch,
            promise,
            sought_at: promise,
            mission: Arc::new(mission.clone()),
            amounts: Vec::new(),
            reads_more_than_facts,
            durations_move_numbers: reads_more_than_facts && plan.durations_move_numbers(),
            limits: BTreeMap::new(),
            ignores_deadlines: false,
            inside: Inside::default(),
            in_constraints: in_constraints(plan),
            values: plan.nominal(),
            durations: duration_parameters(plan)
                .map(|(parameter, instance)| (instance, parameter))
                .collect(),
        };
        rest.begin(region);
        Ok(rest)
    }

    /// Continues with the strongest promise for the remaining plan that still holds, after a
    /// deviation or after an observation that changes the plan's times (`moves_times`).
    fn weaken(
        &mut self,
        now: &Rational,
        reason: Reason,
        moves_times: bool,
    ) -> Result<(), Box<Reason>> {
        let rest = promise::Rest {
            mission: &self.mission,
            values: &self.values,
            is_inside: false,
            reads_more_than_facts: self.reads_more_than_facts,
            promise: self.promise,
            has_other_constraints: moves_times,
        };
        let weaker = promise::weaken(&mut self.dispatch, &rest, now, reason)?;
        self.promise = self.promise.max(weaker);
        Ok(())
    }

    /// Returns the latest end of a running action, beyond its present window, if nothing else
    /// deviates any more. If numbers depend on durations, the result is `None` unless the limit of
    /// this duration was computed.
    fn bears_until(&self, instance: InstanceId, now: &Rational) -> Option<Rational> {
        let limit = if self.durations_move_numbers {
            self.limits.get(&instance)?.as_ref()
        } else {
            None
        };
        let plan = (&*self.mission, &self.values);
        let latest = promise::bears_until(&self.dispatch, plan, instance, now);
        let limit = limit.and_then(|limit| self.limit_of(instance, limit));
        let limit = limit.map(|limit| self.dispatch.world(&limit));
        latest.into_iter().chain(limit).min()
    }

    /// Processes the news, and checks whether the remaining plan is still guaranteed.
    fn learn(&mut self, moment: &Moment<'_>, region: &mut dyn Region) -> Option<Box<Reason>> {
        let trouble = self.dispatch.take(moment);
        let moves_times = self.observe(moment);
        let has_trouble = trouble.is_some();
        if let Some(reason) = trouble {
            if !promise::is_about_time(&reason) {
                return Some(reason);
            }
            if let Err(reason) = self.weaken(moment.now, *reason, moves_times) {
                return Some(reason);
            }
        } else if moves_times {
            let reason = Reason::new(Cause::GuaranteeLost).about(About::TooLittleTime);
            if let Err(reason) = self.weaken(moment.now, reason.since(moment.now.clone()), true) {
                return Some(reason);
            }
        }
        if has_trouble || moves_times {
            self.look_at_times(moment.now);
        }
        if self.is_covered(moment.now, region) {
            return None;
        }
        // Only ends and measured amounts can move the remaining plan out of the known box. While an
        // action takes longer than the box permits, starts can too, because they need the slack
        // that the delay uses up.
        let is_beyond = self.is_beyond(moment.now);
        let mut instances = moment
            .news
            .iter()
            .filter_map(|news| match may_matter(news) {
                Some(step) => Some(step.instance()),
                None => instance_of(news).filter(|_| is_beyond),
            });
        if let Some(instance) = instances.next()
            && let Some(reason) = self.ask(instance, moment.now, region)
        {
            return Some(reason);
        }
        if region.is_asked_inside() || !self.is_known() {
            self.find_limits(moment.now, region);
        }
        None
    }

    /// Computes a box of values for the remaining plan. Returns the reason if the plan fails even
    /// when executed nominally. The reason names `instance`, whose news led to the query.
    fn ask(
        &mut self,
        instance: InstanceId,
        now: &Rational,
        region: &mut dyn Region,
    ) -> Option<Box<Reason>> {
        if !self.reads_more_than_facts {
            return None;
        }
        let (plan, values) = self.remainder(now);
        match region.surroundings(&self.mission.task, &plan, &values) {
            Ok(known) => {
                self.enter(known);
                None
            }
            Err(why) => {
                let action = &self.dispatch.action(instance).name;
                let reason = Reason::new(Cause::GuaranteeLost)
                    .of(action)
                    .about(About::Said(why));
                Some(Box::new(reason.since(now.clone())))
            }
        }
    }

    /// Returns the reason to prefer another plan, if there is one. Only evaluated when an action
    /// has ended and none is running, because a new plan does not interrupt anything then.
    fn likelier(
        &self,
        moment: &Moment<'_>,
        odds: &mut dyn Odds,
        advantage: &Rational,
    ) -> Option<Reason> {
        let is_end = |news: &News| matches!(news, News::Ended { .. });
        if !moment.news.iter().any(is_end) || !self.dispatch.running().is_empty() {
            return None;
        }
        let plan = self.dispatch.plan();
        let happened = plan.nodes().map(|(node, _)| self.dispatch.happened(node));
        let is_over = |step: &InstanceId| {
            let [_, end] = self.dispatch.nodes_of(*step);
            self.dispatch.happened(end).is_some()
        };
        let mut steps = (0..plan.instances.len()).map(InstanceId::from);
        if steps.all(|step| is_over(&step)) {
            return None;
        }
        let compared = odds.compare(&Remainder {
            mission: &self.mission,
            happened: happened.map(Option::<&Rational>::cloned).collect(),
            now: moment.now,
            belief: moment.belief,
        })?;
        let gain = &compared.other - &compared.present;
        if !gain.is_positive() || gain < *advantage {
            return None;
        }
        let about = About::Odds {
            present: compared.present,
            other: compared.other,
        };
        let reason = Reason::new(Cause::Likelier).about(about);
        Some(reason.since(moment.now.clone()))
    }

    /// Replaces planned values by observed ones. Returns `true` if an observed amount changes a
    /// constraint of the plan.
    fn observe(&mut self, moment: &Moment<'_>) -> bool {
        for instance in moment.news.iter().filter_map(instance_of) {
            self.observe_duration(instance);
        }
        for place in places(moment.news) {
            let measured = place.amount.measured.clone();
            self.amounts.push((place.instance, place.is_end, measured));
        }
        self.observe_early_amounts(moment);
        let mut moves_times = false;
        let Amounts {
            readings,
            deviations,
            unread,
        } = amounts(&self.mission.plan, moment);
        let is_told = readings.iter().all(|reading| reading.value().is_some());
        if unread > 0 || !deviations.is_empty() || !is_told {
            self.inside.leave();
        }
        for reading in readings {
            // An amount that depends on several parameters does not determine their values.
            if let Some((parameter, value)) = reading.value() {
                self.observe_amount(parameter, &value);
                moves_times |=
                    self.values[parameter] != value && self.in_constraints.contains(&parameter);
                self.values[parameter] = value;
            }
        }
        moves_times
    }

    /// Returns the remaining plan, in which executed time points are fixed and others cannot happen
    /// before `now`, with the values if nothing deviates any more.
    fn remainder(&self, now: &Rational) -> (ParametrizedPlan, Valuation) {
        let mut plan = self.mission.plan.clone();
        let values = self.values_at(now);
        let now = self.dispatch.local(now);
        for (instance, is_end, measured) in &self.amounts {
            let action = &mut plan.plan.instances[instance.index()].action;
            set_amount(Arc::make_mut(action), *is_end, measured);
        }
        for (parameter, instance) in duration_parameters(&self.mission.plan) {
            let [start, end] = self.dispatch.nodes_of(instance);
            let Some(start) = self.dispatch.happened(start) else {
                continue;
            };
            let range = &mut plan.parameters[parameter.index()].range;
            if self.dispatch.happened(end).is_some() {
                *range = Interval::point(values[parameter].clone());
            } else {
                // A running action takes at least the time that has elapsed.
                *range = range.intersection(&Interval::at_least(&now - start));
            }
        }
        plan.plan = plan
            .plan
            .remainder(&now, |node| self.dispatch.happened(node), |_| true);
        if self.ignores_deadlines {
            carrying_on::remove_deadlines(&mut plan.plan);
        }
        (plan, values)
    }

    /// Returns the values if nothing deviates any more.
    fn values_at(&self, now: &Rational) -> Valuation {
        let mut values = self.values.clone();
        let now = self.dispatch.local(now);
        for (parameter, instance) in duration_parameters(&self.mission.plan) {
            let [start, end] = self.dispatch.nodes_of(instance);
            if let (Some(start), None) =
                (self.dispatch.happened(start), self.dispatch.happened(end))
            {
                let elapsed = &now - start;
                values[parameter] = elapsed.max(values[parameter].clone());
            }
        }
        values
    }
}

/// Returns the parameters that occur in constraints of the plan.
fn in_constraints(plan: &ParametrizedPlan) -> BTreeSet<ParameterId> {
    let constraints = plan.plan.constraints.iter();
    let bounds = constraints.flat_map(|constraint| [&constraint.lower, &constraint.upper]);
    let parameters = bounds.filter_map(|bound| match bound {
        Bound::Parameter(parameter) => Some(*parameter),
        _ => None,
    });
    parameters.collect()
}

/// Returns the bounds of a parameter's values.
fn range(plan: &ParametrizedPlan, parameter: ParameterId) -> Bounds {
    let range = &plan.parameter(parameter).range;
    (range.lower.value().cloned(), range.upper.value().cloned())
}

/// Returns the instance whose start or end is reported.
fn instance_of(news: &News) -> Option<InstanceId> {
    match news {
        News::Started { step, .. } | News::Ended { step, .. } => Some(step.instance()),
        _ => None,
    }
}

/// Returns the step of a news item that can move the remaining plan out of its envelope.
fn may_matter(news: &News) -> Option<StepId> {
    match news {
        News::Ended { step, .. } => Some(*step),
        News::Started { step, measured, .. } => (!measured.is_empty()).then_some(*step),
        _ => None,
    }
}

/// Replaces the amount of the domain by the measured one.
fn set_amount(action: &mut Action, is_end: bool, measured: &Measured) {
    let effects: &mut [Effect] = match &mut action.body {
        Body::Instantaneous(snap) => &mut snap.effects,
        Body::Durative(body) if is_end => &mut Arc::make_mut(&mut body.end).effects,
        Body::Durative(body) => &mut Arc::make_mut(&mut body.start).effects,
    };
    for effect in effects {
        if let Change::Update { fluent, value, .. } = &mut effect.change
            && *fluent == measured.fluent
        {
            *value = Expression::Constant(measured.amount.clone());
        }
    }
}
