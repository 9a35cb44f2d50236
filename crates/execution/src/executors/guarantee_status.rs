//! The strongest promise that still holds for the remaining plan.

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::ConstraintRole;
use elbowroom_plan::{
    Bound, Constraint, DecoupledEnvelope, InstanceId, ParameterId, ParameterKind, ParametrizedPlan,
    Valuation,
};
use elbowroom_stn::ConsistentNetwork;

use crate::dispatch::{Dispatch, EndAssumption, Overdue};
use crate::executor::{PreparedPlan, StepId};
use crate::measured_amounts::duration_parameters;
use crate::reason::{Cause, GuaranteeLevel, Reason, Subject};

/// Shares of the envelope around the planned values that are tried, in sixteenths. On a real clock
/// each start is a little late; where the envelope has no slack to spare, a slightly smaller share
/// makes up for that.
const ENVELOPE_SHARES: [i64; 7] = [16, 15, 12, 8, 4, 2, 1];

/// The role of each constraint of a plan.
type Readings<'a> = dyn Fn(&Constraint) -> ConstraintRole + 'a;

/// Possible values of [`slack`] in sixteenths, the greatest first.
const SLACK_LEVELS: [i64; 5] = [16, 8, 4, 2, 1];

/// The assumption about the remaining duration of overdue actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Overrun {
    /// Unlimited.
    Unlimited,
    /// A quarter of the planned duration.
    QuarterLonger,
    /// They are assumed to end at the most favourable time.
    MostFavourable,
}

/// Creates the dispatch of a plan with the strongest promise.
///
/// # Errors
/// If no times satisfy the plan's constraints.
pub(super) fn begin(mission: &PreparedPlan) -> Result<(Dispatch, GuaranteeLevel), Box<Reason>> {
    let values = mission.plan.nominal();
    let runs = |instance: InstanceId| mission.running.contains_key(&StepId::from(instance));
    let mut attempt = |share: &Rational, overrun: Overrun| {
        let room = DurationAssumptions {
            prepared_plan: mission,
            envelope: mission.envelope.as_ref(),
            values: &values,
            share,
            overrun,
            is_inside: false,
            elapsed: &|instance| runs(instance).then_some(Rational::ZERO),
        };
        let reading = |constraint: &Constraint| room.reading(constraint);
        Dispatch::with_contingent_durations(mission, &reading)
    };
    // Without an envelope, numeric conditions are only known to hold for the planned values.
    let reads_more_than_facts = mission.plan.reads_more_than_facts(&mission.task);
    let knows_room = mission.envelope.is_some() || !reads_more_than_facts;
    strongest_success(reads_more_than_facts, knows_room, &mut attempt)
}

/// Returns `true` if the reason is that something happened outside the times that the plan permits.
pub(super) fn is_time_violation(reason: &Reason) -> bool {
    matches!(
        reason.cause,
        Cause::OutsideInterval | Cause::Outlived | Cause::Unreachable
    )
}

/// Returns `true` if a plan was abandoned because time is too short, so that it works if something
/// takes less time.
pub(super) fn lacks_time(reason: &Reason) -> bool {
    is_time_violation(reason) || matches!(reason.about, Some(Subject::InsufficientTime))
}

/// The remaining plan.
pub(super) struct RemainingPlan<'a> {
    pub(super) prepared_plan: &'a PreparedPlan,
    /// The observed values, and planned ones for the rest.
    pub(super) values: &'a Valuation,
    /// `true` if no quantity has left the envelope, including the durations of running actions.
    /// Then the numeric conditions are guaranteed in all of the envelope.
    pub(super) is_inside: bool,
    /// `true` if the plan's conditions are more than single facts, for example numeric.
    pub(super) reads_more_than_facts: bool,
    /// The promise so far.
    pub(super) guarantee: GuaranteeLevel,
    /// `true` if an observation has changed the plan's constraints.
    pub(super) has_other_constraints: bool,
}

/// Returns the strongest promise for the remaining plan that still holds after a deviation, and
/// dispatches accordingly.
///
/// # Errors
/// If the remaining plan fails even when executed nominally.
pub(super) fn strongest_guarantee(
    dispatch: &mut Dispatch,
    rest: &RemainingPlan<'_>,
    now: &Rational,
    reason: Reason,
) -> Result<GuaranteeLevel, Box<Reason>> {
    let RemainingPlan {
        prepared_plan: mission,
        values,
        is_inside,
        reads_more_than_facts,
        guarantee: before,
        has_other_constraints,
    } = *rest;
    let local = dispatch.to_plan_time(now);
    // Numeric conditions are only guaranteed while no quantity has left the envelope.
    let is_unknown = !is_inside && reads_more_than_facts;
    if !has_other_constraints
        && dispatch.continue_if_executable(&local, &|overdue| {
            overdue_end_assumptions(rest, overdue, &local)
        })
    {
        return Ok(if is_unknown {
            before.max(GuaranteeLevel::Planned)
        } else {
            before
        });
    }
    let elapsed: Vec<Option<Rational>> = (0..dispatch.plan().instances.len())
        .map(|index| elapsed(dispatch, InstanceId::from(index), &local))
        .collect();
    let mut behind = Vec::new();
    let mut attempt = |share: &Rational, overrun: Overrun| {
        let room = DurationAssumptions {
            prepared_plan: mission,
            envelope: mission.envelope.as_ref(),
            values,
            share,
            overrun,
            is_inside,
            elapsed: &|instance| elapsed[instance.index()].clone(),
        };
        let reading = |constraint: &Constraint| room.reading(constraint);
        dispatch
            .with_bounds(&local, &reading)
            .map_err(|against| behind = against)
    };
    if let Ok(((), promise)) = strongest_success(is_unknown, !is_unknown, &mut attempt) {
        return Ok(promise);
    }
    if reason.cause == Cause::Unreachable {
        // A missed time point explains more than the conflicting constraints.
        return Err(Box::new(reason));
    }
    let mut lost = Reason {
        cause: Cause::GuaranteeLost,
        ..reason
    };
    lost.about = Some(Subject::InsufficientTime);
    lost.evidence = behind;
    Err(Box::new(lost.since(now.clone())))
}

/// Returns the latest end of a running action for which the remaining plan works if nothing else
/// deviates any more, on the world's clock. `None` if there is none, or no limit. Takes time in
/// proportion to the plan.
pub(super) fn latest_tolerated_end(
    dispatch: &Dispatch,
    (mission, values): (&PreparedPlan, &Valuation),
    late: InstanceId,
    now: &Rational,
) -> Option<Rational> {
    let local = dispatch.to_plan_time(now);
    let elapsed = |instance: InstanceId| elapsed(dispatch, instance, &local);
    let room = DurationAssumptions {
        prepared_plan: mission,
        envelope: mission.envelope.as_ref(),
        values,
        share: &Rational::ZERO,
        overrun: Overrun::MostFavourable,
        is_inside: false,
        elapsed: &elapsed,
    };
    let reading = |constraint: &Constraint| {
        if dispatch.plan().duration_of(constraint) != Some(late) {
            return room.reading(constraint);
        }
        ConstraintRole::Requirement {
            lower: elapsed(late),
            upper: None,
        }
    };
    dispatch.latest_end(late, now, &reading)
}

/// Returns the schedules of the remaining plan if the actions that have not ended take at least
/// this share of their planned durations.
pub(super) fn schedules_if_faster(
    dispatch: &Dispatch,
    values: &Valuation,
    share: &Rational,
    now: &Rational,
) -> Option<ConsistentNetwork> {
    let local = dispatch.to_plan_time(now);
    let elapsed = |instance: InstanceId| elapsed(dispatch, instance, &local);
    let reading = |constraint: &Constraint| {
        let lower = constraint.lower.at(values);
        let Some(instance) = dispatch.plan().duration_of(constraint) else {
            return ConstraintRole::Requirement {
                lower,
                upper: constraint.upper.at(values),
            };
        };
        let planned = lower.unwrap_or_default() * share;
        ConstraintRole::Requirement {
            lower: Some(planned.max(elapsed(instance).unwrap_or_default())),
            upper: None,
        }
    };
    dispatch.possible_schedules(now, &reading)
}

/// Returns the time for which an action has been running, on the plan's clock; `None` if it is not
/// running.
fn elapsed(dispatch: &Dispatch, instance: InstanceId, now: &Rational) -> Option<Rational> {
    let [start, end] = dispatch.start_and_end_nodes(instance);
    let begun = dispatch.execution_time(start)?;
    dispatch.execution_time(end).is_none().then(|| now - begun)
}

/// Returns the slack of the remaining plan: see [`slack`].
pub(super) fn slack_of_remaining_plan(
    dispatch: &Dispatch,
    plan: (&PreparedPlan, &Valuation),
    now: &Rational,
) -> Rational {
    let local = dispatch.to_plan_time(now);
    let elapsed = |instance: InstanceId| elapsed(dispatch, instance, &local);
    slack(plan, &elapsed, &mut |reading| {
        dispatch.clone().with_bounds(&local, reading).is_ok()
    })
}

/// Returns the slack of a plan that is not executed yet: see [`slack`].
pub(super) fn slack_of_plan(mission: &PreparedPlan) -> Rational {
    let values = mission.plan.nominal();
    let runs = |instance: InstanceId| mission.running.contains_key(&StepId::from(instance));
    let elapsed = |instance: InstanceId| runs(instance).then_some(Rational::ZERO);
    slack((mission, &values), &elapsed, &mut |reading| {
        Dispatch::with_contingent_durations(mission, reading).is_ok()
    })
}

/// Returns the slack: the greatest share of the planned durations by which all durations may
/// deviate without missing a deadline. It is a power of 1/2, at most 1, or 0 if it is below 1/16.
/// Numeric conditions are ignored.
fn slack(
    (mission, values): (&PreparedPlan, &Valuation),
    elapsed: &dyn Fn(InstanceId) -> Option<Rational>,
    works: &mut dyn FnMut(&Readings<'_>) -> bool,
) -> Rational {
    let shares = SLACK_LEVELS.map(|sixteenths| Rational::new(sixteenths, 16));
    let greatest = shares.into_iter().find(|share| {
        let room = DurationAssumptions {
            prepared_plan: mission,
            envelope: None,
            values,
            share,
            overrun: Overrun::QuarterLonger,
            is_inside: false,
            elapsed,
        };
        works(&|constraint| room.reading(constraint))
    });
    greatest.unwrap_or_default()
}

/// Returns the assumptions about the end of an overdue action, on the plan's clock, the most
/// general one first.
fn overdue_end_assumptions(
    rest: &RemainingPlan<'_>,
    overdue: &Overdue,
    now: &Rational,
) -> Vec<EndAssumption> {
    let plan = &rest.prepared_plan.plan;
    if rest.is_inside
        && let Some(envelope) = &rest.prepared_plan.envelope
    {
        // The action may have exceeded its share and still be inside the envelope.
        let mut durations = duration_parameters(plan);
        let own = durations.find(|(_, instance)| *instance == overdue.instance);
        let upper = own.and_then(|(parameter, _)| envelope.interval(parameter).upper.value());
        if let Some(end) = upper.map(|upper| &overdue.started + upper)
            && end >= *now
        {
            return vec![EndAssumption::ByOrEarlier(end)];
        }
    }
    let quarter = now + quarter_of_planned(rest.prepared_plan, &overdue.planned);
    vec![EndAssumption::AnyTime, EndAssumption::By(quarter)]
}

/// Returns the additional time that an overdue action is assumed to take.
fn quarter_of_planned(mission: &PreparedPlan, planned: &Rational) -> Rational {
    (planned / Rational::from(4)).max(mission.task.epsilon().clone())
}

/// Returns the result of the first attempt that succeeds, with its promise, from the strongest
/// assumptions to the weakest. Numeric conditions are guaranteed in all of the envelope or, once a
/// quantity has left it (`knows_room` is `false`), only for the planned values.
fn strongest_success<T, E>(
    reads_more_than_facts: bool,
    knows_room: bool,
    attempt: &mut dyn FnMut(&Rational, Overrun) -> Result<T, E>,
) -> Result<(T, GuaranteeLevel), E> {
    for sixteenths in ENVELOPE_SHARES {
        let share = Rational::new(sixteenths, 16);
        for overrun in [Overrun::Unlimited, Overrun::QuarterLonger] {
            let promise = match sixteenths {
                _ if !knows_room => GuaranteeLevel::Planned,
                16 => GuaranteeLevel::Envelope,
                _ => GuaranteeLevel::PartOfEnvelope,
            };
            if let Ok(done) = attempt(&share, overrun) {
                return Ok((done, promise));
            }
        }
        if reads_more_than_facts {
            break;
        }
    }
    for overrun in [Overrun::Unlimited, Overrun::QuarterLonger] {
        if let Ok(done) = attempt(&Rational::ZERO, overrun) {
            return Ok((done, GuaranteeLevel::Planned));
        }
    }
    attempt(&Rational::ZERO, Overrun::MostFavourable).map(|done| (done, GuaranteeLevel::Luck))
}

/// Assumptions about the durations of the remaining plan.
struct DurationAssumptions<'a> {
    prepared_plan: &'a PreparedPlan,
    /// The box with the intervals of the durations. Without one, each duration may deviate by up to
    /// its planned value.
    envelope: Option<&'a DecoupledEnvelope>,
    /// The observed values, and nominal ones for the rest.
    values: &'a Valuation,
    /// The share of the envelope around the planned values; 1 is all of it.
    share: &'a Rational,
    overrun: Overrun,
    /// `true` if no quantity has left the envelope, including the durations of running actions.
    is_inside: bool,
    /// The time for which an instance has been running.
    elapsed: &'a dyn Fn(InstanceId) -> Option<Rational>,
}

impl DurationAssumptions<'_> {
    fn reading(&self, constraint: &Constraint) -> ConstraintRole {
        let plan = &self.prepared_plan.plan;
        // With share 0, no more deviations are assumed, and the executor may command other
        // durations.
        if let Some(planned) = plan.commanded_duration(constraint)
            && !self.share.is_zero()
        {
            return ConstraintRole::exactly(planned);
        }
        let Some(parameter) = duration_parameter(plan, constraint) else {
            return ConstraintRole::Requirement {
                lower: constraint.lower.at(self.values),
                upper: constraint.upper.at(self.values),
            };
        };
        let (lower, upper) = self.interval(parameter, self.share);
        let ParameterKind::Duration(instance) = plan.parameter(parameter).kind else {
            return ConstraintRole::Contingent { lower, upper };
        };
        let Some(elapsed) = (self.elapsed)(instance) else {
            return ConstraintRole::Contingent { lower, upper };
        };
        // An action may have exceeded its share and still be inside the envelope. Then the share
        // applies to the remaining part of its interval.
        let has_had_it = upper.as_ref().is_some_and(|upper| *upper < elapsed);
        let upper = if self.is_inside && has_had_it {
            let all = self.interval(parameter, &Rational::ONE).1;
            all.map(|all| &elapsed + (all - &elapsed).max(Rational::ZERO) * self.share)
        } else {
            upper
        };
        let has_room = |upper: &Rational| *upper > elapsed || self.is_inside && *upper == elapsed;
        let has_room = upper.as_ref().is_none_or(has_room);
        let lower = lower.max(elapsed.clone());
        match self.overrun {
            _ if has_room => ConstraintRole::Contingent { lower, upper },
            Overrun::Unlimited => ConstraintRole::Contingent { lower, upper: None },
            Overrun::QuarterLonger => {
                let quarter =
                    quarter_of_planned(self.prepared_plan, &plan.parameter(parameter).nominal);
                ConstraintRole::Contingent {
                    lower,
                    upper: Some(elapsed + quarter),
                }
            }
            Overrun::MostFavourable => ConstraintRole::Requirement {
                lower: Some(lower),
                upper: None,
            },
        }
    }

    /// Returns a share of a parameter's interval in the envelope, around the planned value.
    fn interval(&self, id: ParameterId, share: &Rational) -> (Rational, Option<Rational>) {
        let planned = &self.values[id];
        if share.is_zero() {
            return (planned.clone(), Some(planned.clone()));
        }
        let Some(envelope) = self.envelope else {
            let room = planned * share;
            return (planned - &room, Some(planned + room));
        };
        let interval = envelope.interval(id);
        let within = |end: &Rational| planned + (end - planned) * share;
        let lower = interval.lower.value().map_or(Rational::ZERO, within);
        let upper = match interval.upper.value() {
            Some(upper) => Some(within(upper)),
            // A share of an infinite interval is proportional to the planned value.
            None if *share == Rational::ONE => None,
            None => Some(planned + planned * share * Rational::from(16)),
        };
        (lower.max(Rational::ZERO), upper)
    }
}

/// Returns the parameter if the constraint sets a duration or the time of a timed initial to it.
fn duration_parameter(plan: &ParametrizedPlan, constraint: &Constraint) -> Option<ParameterId> {
    match (&constraint.lower, &constraint.upper) {
        (Bound::Parameter(lower), Bound::Parameter(upper))
            if lower == upper && plan.plan.is_controlled_by_world(constraint) =>
        {
            Some(*lower)
        }
        _ => None,
    }
}
