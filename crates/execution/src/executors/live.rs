//! `live`: the envelope is recomputed after each observation, with the observed values fixed.

mod alternative;
mod box_membership;
mod early_starts;
mod limits;
mod repetition;
mod without_guarantee;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use box_membership::BoxMembership;
use elbowroom_model::ground::{Action, Body, Change, Effect, Expression};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{Bound, InstanceId, ParameterId, ParametrizedPlan, Valuation};

use self::repetition::Repetition;
use self::without_guarantee::{ReductionClass, UnguaranteedPlan};
use super::{ExecutorEntry, Need, Needs, Role, esterel, guarantee_status};
use crate::dispatch::{Bounds, Dispatch, replan};
use crate::event::Measured;
use crate::executor::{
    Decided, Decision, DecisionContext, Executor, PlanEvent, PlanForm, Planned, PreparedPlan,
    StepId,
};
use crate::measured_amounts::{MeasuredAmounts, amount_locations, amounts, duration_parameters};
use crate::plan_comparison::{PlanComparator, RemainingPlan};
use crate::preparation::RegionOracle;
use crate::reason::{Cause, GuaranteeLevel, Reason, Subject};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "live",
    argument: Some("number of percentage points"),
    is_optional: true,
    summary: "Dispatches so that the remaining plan works for all values inside its envelope. When \
              a value leaves it, `live` computes the strongest guarantee that still holds for the \
              remaining plan, with the observed values fixed. It replans only when the remaining \
              plan fails even without further deviations. If time or a number is insufficient and \
              no other plan is found, it continues by the plan's orderings, without a guarantee, \
              as `esterel` does. It does the same if planning returns a plan that was already \
              abandoned twice because of durations. `live:X` also replans while no action is \
              running and another plan is more likely to succeed, by at least X percentage \
              points, in the world that the world file describes.",
    paper: "goes beyond Cashmore et al. (2020)",
    needs: Needs {
        odds: Need::WithArgument,
        ..Needs::plan(PlanForm::OpenNetwork)
    },
    roles: &[Role::Evaluation],
    make: |argument, means| {
        let advantage = argument.map(|points| points / Rational::from(100));
        Box::new(Live {
            region: means.region,
            comparator: means.comparator.zip(advantage),
            has_planner: means.has_planner,
            state: None,
            reduction: ReductionClass::Impossible,
            unguaranteed: None,
            repetition: Repetition::default(),
        })
    },
};

/// See [`REGISTERED`].
struct Live {
    region: Box<dyn RegionOracle>,
    /// The comparison of plans, and the advantage that another plan must have.
    comparator: Option<(Box<dyn PlanComparator>, Rational)>,
    /// `true` if the run can make new plans.
    has_planner: bool,
    state: Option<ExecutedPlan>,
    /// Reduction of the planned durations that the last abandoned plan needs to succeed.
    reduction: ReductionClass,
    /// A plan that is executed without a guarantee.
    unguaranteed: Option<UnguaranteedPlan>,
    repetition: Repetition,
}

/// A plan being executed, with the knowledge about its open parameters.
#[derive(Clone)]
struct ExecutedPlan {
    dispatch: Dispatch,
    /// The guarantee of the remaining plan.
    guarantee: GuaranteeLevel,
    /// The guarantee when a better plan was last searched for, or when the plan began.
    guarantee_at_last_search: GuaranteeLevel,
    prepared_plan: Arc<PreparedPlan>,
    /// The observed values, and nominal ones for the rest.
    values: Valuation,
    /// Duration parameters by instance, and the parameters that occur in constraints.
    durations: BTreeMap<InstanceId, ParameterId>,
    in_constraints: BTreeSet<ParameterId>,
    /// Observations, compared with the envelope.
    box_membership: BoxMembership,
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
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        let region = self.region.as_mut();
        self.repetition.note_adopted(&mission.time_triggered);
        let by_orderings = self.repetition.is_by_orderings();
        let by_orderings = by_orderings.then(|| ExecutedPlan::begin_by_orderings(mission, region));
        let (rest, carried_on) = match by_orderings.flatten() {
            Some((rest, carried_on)) => (rest, Some(carried_on)),
            None if self.has_planner => (ExecutedPlan::with_early_starts(mission, region)?, None),
            None => (ExecutedPlan::new(mission, region)?, None),
        };
        self.state = Some(rest);
        self.reduction = ReductionClass::Impossible;
        self.unguaranteed = carried_on;
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let rest = self.state.as_ref();
        if rest.is_some_and(|rest| rest.has_untimely_end(moment.plan_events)) {
            self.repetition.note_untimely_end();
        }
        let decided = match (&mut self.unguaranteed, &mut self.state) {
            (Some(carried_on), Some(rest)) => {
                rest.decide_without_guarantee(moment, carried_on, self.region.as_mut())
            }
            _ => self.decide_by_guarantee(moment),
        };
        let is_abandoned = decided.decision == Decision::Replan;
        if is_abandoned {
            self.repetition.note_abandoned(&decided.reason);
        }
        let rest = self.state.as_ref().filter(|_| is_abandoned);
        let hope = rest.map(|rest| rest.reduction_class(&decided.reason, moment.now));
        self.reduction = hope.unwrap_or_default();
        decided
    }

    fn may_carry_on(&self) -> bool {
        self.reduction == ReductionClass::AtMostHalf
    }

    fn carry_on(&mut self, now: &Rational) -> bool {
        let hope = self.reduction;
        let rest = self
            .state
            .as_mut()
            .filter(|_| hope > ReductionClass::Impossible);
        self.unguaranteed =
            rest.and_then(|rest| rest.continue_by_orderings(hope, now, self.region.as_mut()));
        self.unguaranteed.is_some()
    }

    fn seeks_better_plan(&mut self, now: &Rational) -> bool {
        if let Some(carried_on) = &self.unguaranteed {
            return carried_on.seeks_better_plan();
        }
        let rest = self.state.as_mut();
        rest.is_some_and(|rest| rest.seeks_better_plan(now))
    }

    fn prefers_plan(&self, mission: &PreparedPlan, now: &Rational) -> bool {
        if self.unguaranteed.is_some() {
            return guarantee_status::begin(mission)
                .is_ok_and(|(_, promise)| promise < GuaranteeLevel::Luck);
        }
        let rest = self.state.as_ref();
        rest.is_some_and(|rest| rest.is_worse_than(mission, now))
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        if let Some(carried_on) = &self.unguaranteed {
            return carried_on.executor().window(step, is_end);
        }
        self.state.as_ref()?.dispatch.planned(step, is_end)
    }

    fn latest_tolerated_end(&self, step: StepId, now: &Rational) -> Option<Rational> {
        let is_guaranteed = self.unguaranteed.is_none();
        let rest = self.state.as_ref().filter(|_| is_guaranteed)?;
        rest.latest_tolerated_end(step.instance(), now)
    }

    /// The copy does not compare plans.
    fn fork(&self) -> Option<Box<dyn Executor>> {
        let carried_on = match &self.unguaranteed {
            Some(carried_on) => Some(carried_on.fork()?),
            None => None,
        };
        Some(Box::new(Self {
            region: self.region.fork()?,
            comparator: None,
            has_planner: self.has_planner,
            state: self.state.clone(),
            reduction: self.reduction,
            unguaranteed: carried_on,
            repetition: self.repetition.clone(),
        }))
    }
}

impl Live {
    fn decide_by_guarantee(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let Some(rest) = &mut self.state else {
            return super::without_plan();
        };
        if !moment.plan_events.is_empty()
            && let Some(reason) = rest.learn(moment, self.region.as_mut())
        {
            return replan(*reason);
        }
        if let Some((odds, advantage)) = &mut self.comparator
            && let Some(reason) = rest.check_likelier_plan(moment, odds.as_mut(), advantage)
        {
            return replan(reason);
        }
        if let Some(reason) = rest.handle_reached_limits(moment.now, self.region.as_mut()) {
            return replan(*reason);
        }
        if let Some(reason) = rest.check_limits(moment.now) {
            return replan(reason);
        }
        if let Some(reason) = rest.dispatch.overdue_reason(moment)
            && let Err(reason) = rest.continue_with_strongest_guarantee(moment.now, reason, false)
        {
            return replan(*reason);
        }
        let decided = rest.dispatch.next(moment);
        let mut decided = rest.limit_wait(decided);
        decided.reason.guarantee = match decided.decision {
            Decision::Start(_) | Decision::Wait { .. } => Some(rest.guarantee),
            _ => None,
        };
        decided
    }
}

impl ExecutedPlan {
    /// Begins with a plan.
    fn new(mission: &PreparedPlan, region: &mut dyn RegionOracle) -> Result<Self, Box<Reason>> {
        let plan = &mission.plan;
        let (dispatch, promise) = guarantee_status::begin(mission)?;
        let reads_more_than_facts = plan.reads_more_than_facts(&mission.task);
        let mut rest = Self {
            dispatch,
            guarantee: promise,
            guarantee_at_last_search: promise,
            prepared_plan: Arc::new(mission.clone()),
            amounts: Vec::new(),
            reads_more_than_facts,
            durations_move_numbers: reads_more_than_facts && plan.durations_move_numbers(),
            limits: BTreeMap::new(),
            ignores_deadlines: false,
            box_membership: BoxMembership::default(),
            in_constraints: parameters_in_constraints(plan),
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
    fn continue_with_strongest_guarantee(
        &mut self,
        now: &Rational,
        reason: Reason,
        moves_times: bool,
    ) -> Result<(), Box<Reason>> {
        let rest = guarantee_status::RemainingPlan {
            prepared_plan: &self.prepared_plan,
            values: &self.values,
            is_inside: false,
            reads_more_than_facts: self.reads_more_than_facts,
            guarantee: self.guarantee,
            has_other_constraints: moves_times,
        };
        let weaker = guarantee_status::strongest_guarantee(&mut self.dispatch, &rest, now, reason)?;
        self.guarantee = self.guarantee.max(weaker);
        Ok(())
    }

    /// Returns the latest end of a running action, beyond its present window, if nothing else
    /// deviates any more. If numbers depend on durations, the result is `None` unless the limit of
    /// this duration was computed.
    fn latest_tolerated_end(&self, instance: InstanceId, now: &Rational) -> Option<Rational> {
        let limit = if self.durations_move_numbers {
            self.limits.get(&instance)?.as_ref()
        } else {
            None
        };
        let plan = (&*self.prepared_plan, &self.values);
        let latest = guarantee_status::latest_tolerated_end(&self.dispatch, plan, instance, now);
        let limit = limit.and_then(|limit| self.limit_time(instance, limit));
        let limit = limit.map(|limit| self.dispatch.to_world_time(&limit));
        latest.into_iter().chain(limit).min()
    }

    /// Processes the news, and checks whether the remaining plan is still guaranteed.
    fn learn(
        &mut self,
        moment: &DecisionContext<'_>,
        region: &mut dyn RegionOracle,
    ) -> Option<Box<Reason>> {
        let trouble = self.dispatch.process_news(moment);
        let moves_times = self.observe(moment);
        let has_trouble = trouble.is_some();
        if let Some(reason) = trouble {
            if !guarantee_status::is_time_violation(&reason) {
                return Some(reason);
            }
            if let Err(reason) =
                self.continue_with_strongest_guarantee(moment.now, *reason, moves_times)
            {
                return Some(reason);
            }
        } else if moves_times {
            let reason = Reason::new(Cause::GuaranteeLost).about(Subject::InsufficientTime);
            if let Err(reason) = self.continue_with_strongest_guarantee(
                moment.now,
                reason.since(moment.now.clone()),
                true,
            ) {
                return Some(reason);
            }
        }
        if has_trouble || moves_times {
            self.check_observed_times(moment.now);
        }
        if self.is_covered(moment.now, region) {
            return None;
        }
        // Only ends and measured amounts can move the remaining plan out of the known box. While an
        // action takes longer than the box permits, starts can too, because they need the slack
        // that the delay uses up.
        let is_beyond = self.has_running_action_left_box(moment.now);
        let mut instances =
            moment
                .plan_events
                .iter()
                .filter_map(|news| match step_that_may_leave_envelope(news) {
                    Some(step) => Some(step.instance()),
                    None => instance_of(news).filter(|_| is_beyond),
                });
        if let Some(instance) = instances.next()
            && let Some(reason) = self.query_region(instance, moment.now, region)
        {
            return Some(reason);
        }
        if region.is_asked_inside() || !self.has_box() {
            self.find_limits(moment.now, region);
        }
        None
    }

    /// Computes a box of values for the remaining plan. Returns the reason if the plan fails even
    /// when executed nominally. The reason names `instance`, whose news led to the query.
    fn query_region(
        &mut self,
        instance: InstanceId,
        now: &Rational,
        region: &mut dyn RegionOracle,
    ) -> Option<Box<Reason>> {
        if !self.reads_more_than_facts {
            return None;
        }
        let (plan, values) = self.remaining_plan(now);
        match region.surroundings(&self.prepared_plan.task, &plan, &values) {
            Ok(known) => {
                self.set_box(known);
                None
            }
            Err(why) => {
                let action = &self.dispatch.action(instance).name;
                let reason = Reason::new(Cause::GuaranteeLost)
                    .for_action(action)
                    .about(Subject::ExternalMessage(why));
                Some(Box::new(reason.since(now.clone())))
            }
        }
    }

    /// Returns the reason to prefer another plan, if there is one. Only evaluated when an action
    /// has ended and none is running, because a new plan does not interrupt anything then.
    fn check_likelier_plan(
        &self,
        moment: &DecisionContext<'_>,
        odds: &mut dyn PlanComparator,
        advantage: &Rational,
    ) -> Option<Reason> {
        let is_end = |news: &PlanEvent| matches!(news, PlanEvent::Ended { .. });
        if !moment.plan_events.iter().any(is_end) || !self.dispatch.running().is_empty() {
            return None;
        }
        let plan = self.dispatch.plan();
        let happened = plan
            .nodes()
            .map(|(node, _)| self.dispatch.execution_time(node));
        let is_over = |step: &InstanceId| {
            let [_, end] = self.dispatch.start_and_end_nodes(*step);
            self.dispatch.execution_time(end).is_some()
        };
        let mut steps = (0..plan.instances.len()).map(InstanceId::from);
        if steps.all(|step| is_over(&step)) {
            return None;
        }
        let compared = odds.compare(&RemainingPlan {
            prepared_plan: &self.prepared_plan,
            happened: happened.map(Option::<&Rational>::cloned).collect(),
            now: moment.now,
            belief: moment.belief,
        })?;
        let gain = &compared.other_plan - &compared.remaining_plan;
        if !gain.is_positive() || gain < *advantage {
            return None;
        }
        let about = Subject::SuccessProbabilities {
            present: compared.remaining_plan,
            other: compared.other_plan,
        };
        let reason = Reason::new(Cause::Likelier).about(about);
        Some(reason.since(moment.now.clone()))
    }

    /// Replaces planned values by observed ones. Returns `true` if an observed amount changes a
    /// constraint of the plan.
    fn observe(&mut self, moment: &DecisionContext<'_>) -> bool {
        for instance in moment.plan_events.iter().filter_map(instance_of) {
            self.observe_duration(instance);
        }
        for place in amount_locations(moment.plan_events) {
            let measured = place.amount.measured.clone();
            self.amounts.push((place.instance, place.is_end, measured));
        }
        self.observe_early_amounts(moment);
        let mut moves_times = false;
        let MeasuredAmounts {
            readings,
            deviations,
            unread,
        } = amounts(&self.prepared_plan.plan, moment);
        let is_told = readings.iter().all(|reading| reading.value().is_some());
        if unread > 0 || !deviations.is_empty() || !is_told {
            self.box_membership.mark_left();
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
    fn remaining_plan(&self, now: &Rational) -> (ParametrizedPlan, Valuation) {
        let mut plan = self.prepared_plan.plan.clone();
        let values = self.values_at(now);
        let now = self.dispatch.to_plan_time(now);
        for (instance, is_end, measured) in &self.amounts {
            let action = &mut plan.plan.instances[instance.index()].action;
            set_amount(Arc::make_mut(action), *is_end, measured);
        }
        for (parameter, instance) in duration_parameters(&self.prepared_plan.plan) {
            let [start, end] = self.dispatch.start_and_end_nodes(instance);
            let Some(start) = self.dispatch.execution_time(start) else {
                continue;
            };
            let range = &mut plan.parameters[parameter.index()].range;
            if self.dispatch.execution_time(end).is_some() {
                *range = Interval::point(values[parameter].clone());
            } else {
                // A running action takes at least the time that has elapsed.
                *range = range.intersection(&Interval::at_least(&now - start));
            }
        }
        plan.plan = plan
            .plan
            .remainder(&now, |node| self.dispatch.execution_time(node), |_| true);
        if self.ignores_deadlines {
            without_guarantee::remove_deadlines(&mut plan.plan);
        }
        (plan, values)
    }

    /// Returns the values if nothing deviates any more.
    fn values_at(&self, now: &Rational) -> Valuation {
        let mut values = self.values.clone();
        let now = self.dispatch.to_plan_time(now);
        for (parameter, instance) in duration_parameters(&self.prepared_plan.plan) {
            let [start, end] = self.dispatch.start_and_end_nodes(instance);
            if let (Some(start), None) = (
                self.dispatch.execution_time(start),
                self.dispatch.execution_time(end),
            ) {
                let elapsed = &now - start;
                values[parameter] = elapsed.max(values[parameter].clone());
            }
        }
        values
    }
}

/// Returns the parameters that occur in constraints of the plan.
fn parameters_in_constraints(plan: &ParametrizedPlan) -> BTreeSet<ParameterId> {
    let constraints = plan.plan.constraints.iter();
    let bounds = constraints.flat_map(|constraint| [&constraint.lower, &constraint.upper]);
    let parameters = bounds.filter_map(|bound| match bound {
        Bound::Parameter(parameter) => Some(*parameter),
        _ => None,
    });
    parameters.collect()
}

/// Returns the bounds of a parameter's values.
fn parameter_bounds(plan: &ParametrizedPlan, parameter: ParameterId) -> Bounds {
    let range = &plan.parameter(parameter).range;
    (range.lower.value().cloned(), range.upper.value().cloned())
}

/// Returns the instance whose start or end is reported.
fn instance_of(news: &PlanEvent) -> Option<InstanceId> {
    match news {
        PlanEvent::Started { step, .. } | PlanEvent::Ended { step, .. } => Some(step.instance()),
        _ => None,
    }
}

/// Returns the step of a news item that can move the remaining plan out of its envelope.
fn step_that_may_leave_envelope(news: &PlanEvent) -> Option<StepId> {
    match news {
        PlanEvent::Ended { step, .. } => Some(*step),
        PlanEvent::Started { step, measured, .. } => (!measured.is_empty()).then_some(*step),
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
