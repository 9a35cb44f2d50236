//! Incremental Rectangular Robustification.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::obligations::Refusal;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, Parameter, ParameterId, ParametrizedPlan, Side};

use crate::frontier::{Frontier, Growth};
use crate::objection::Objection;
use crate::oracle::Oracle;

/// Settings of IRR.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The search ends when all steps are below this (β of Algorithm 1); positive. A step is halved
    /// when both ends of its parameter have refused it, so an end may still have room for almost
    /// twice as much: [`sharpen`](crate::sharpen()) moves each end onto its limit.
    pub precision: Rational,
    /// If there is one, each parameter's precision is this share of its nominal value instead, and
    /// its first step the nominal value, so that units of time do not matter.
    pub relative: Option<Rational>,
    /// How steps change after a success.
    pub growth: Growth,
    /// The limit on box checks.
    pub most_checks: Option<usize>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            precision: Rational::ONE,
            relative: None,
            growth: Growth::default(),
            most_checks: None,
        }
    }
}

impl Settings {
    /// The precision of each of a plan's parameters. A nominal value of 0 has no shares; there the
    /// smallest one of the plan's that is not counts.
    pub fn precisions(&self, plan: &ParametrizedPlan) -> Vec<Rational> {
        match &self.relative {
            None => vec![self.precision.clone(); plan.parameters.len()],
            Some(share) => scales(plan).iter().map(|scale| scale * share).collect(),
        }
    }
}

/// The size of each parameter: that of its nominal value, or of the smallest one of the plan's that
/// is not 0.
pub(crate) fn scales(plan: &ParametrizedPlan) -> Vec<Rational> {
    let sizes = plan.parameters.iter().map(|own| own.nominal.abs());
    let sizes: Vec<Rational> = sizes.collect();
    let other = sizes.iter().filter(|size| !size.is_zero()).min();
    let other = other.cloned().unwrap_or(Rational::ONE);
    let scales = sizes.into_iter();
    scales
        .map(|size| if size.is_zero() { other.clone() } else { size })
        .collect()
}

/// A larger box was found.
#[derive(Clone, Debug)]
pub struct Widening<'a> {
    /// The box.
    pub envelope: &'a DecoupledEnvelope,
    /// Which end moved.
    pub end: BoxEnd,
    /// The number of boxes checked by then.
    pub checks: usize,
}

/// Why a search for an envelope ended. The envelope is sound in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All steps are below the precision, or no end can move at all.
    Converged,
    /// The limit on box checks was reached.
    CheckLimit,
    /// The caller wanted no more.
    Cancelled,
    /// Of some wider boxes it cannot be told whether they are inside: there are too many cases to
    /// tell apart. The ends in question stay where they were.
    Undecided,
}

/// The number of boxes that may be undecided before a search ends: each took long.
const MOST_UNDECIDED: usize = 4;

/// How far out an end is moved at most that could go on for ever without being infinite: a thousand
/// million times the nominal value, or 1.
pub(crate) fn farthest(parameter: &Parameter) -> Rational {
    &Rational::from(1_000_000_000) * &parameter.nominal.abs().max(Rational::ONE)
}

/// The reason why one end of the final box cannot move.
#[derive(Clone, Debug, PartialEq)]
pub enum Limit {
    /// Nothing: the end is infinite.
    Unbounded,
    /// The parameter's natural range.
    Range,
    /// The box with this end moved out is not inside the envelope, because of this.
    Objection {
        /// The box that was refused.
        refused: DecoupledEnvelope,
        /// The reason.
        objection: Objection,
    },
    /// Whether the box with this end moved out is inside the envelope cannot be told.
    Undecided,
}

/// The result of [`irr`].
#[derive(Clone, Debug, PartialEq)]
pub struct IrrRun {
    /// The box; `Err` if the plan does not even work at the nominal values.
    pub envelope: Result<DecoupledEnvelope, Objection>,
    /// How many times the box grew.
    pub widenings: usize,
    /// The number of boxes checked.
    pub checks: usize,
    /// Why the search ended.
    pub stop: StopReason,
}

/// Incremental Rectangular Robustification: Algorithm 1 of Cashmore et al. (2020).
///
/// Invariant: the box lies inside the robustness envelope at every iteration, the first included:
/// the start point is checked like any other box. `on_step` is called each time the box has
/// grown, and once more at every refusal with `None`, so that it can end the search at any moment.
/// What was found stays found: a wider box of which nothing can be told is treated as refused.
///
/// # Errors
/// When nothing can be told of the start point.
#[doc(alias = "Incremental Rectangular-Robustification")]
pub fn irr(
    oracle: &mut Oracle,
    settings: &Settings,
    on_step: &mut dyn FnMut(Option<&Widening<'_>>) -> ControlFlow<()>,
) -> Result<IrrRun, Refusal> {
    let plan = Arc::clone(oracle.plan());
    let already = oracle.checks();
    let mut envelope = DecoupledEnvelope::point(&plan.nominal());
    if let Some(objection) = oracle.start(&envelope)? {
        return Ok(IrrRun {
            envelope: Err(objection),
            widenings: 0,
            checks: oracle.checks() - already,
            stop: StopReason::Converged,
        });
    }
    let mut frontier = Frontier::new(
        &plan,
        settings.precisions(&plan),
        settings
            .relative
            .is_some()
            .then(|| scales(&plan))
            .as_deref(),
        settings.growth,
    );
    let mut widenings = 0;
    let mut undecided = 0;
    let stop = loop {
        if undecided >= MOST_UNDECIDED {
            break StopReason::Undecided;
        }
        let Some((end, step)) = frontier.next_end() else {
            break match undecided {
                0 => StopReason::Converged,
                _ => StopReason::Undecided,
            };
        };
        let checks = oracle.checks() - already;
        if settings.most_checks.is_some_and(|most| checks >= most) {
            break StopReason::CheckLimit;
        }
        let range = &plan.parameter(end.parameter).range;
        let mut told = |answer: Result<bool, Refusal>| {
            undecided += usize::from(answer.is_err());
            answer.unwrap_or(false)
        };
        let flow = if told(widen(oracle, &envelope, range, end, &step)) {
            frontier.accept(end);
            let is_endless =
                matches!(end.side.of(range), End::Infinite) && told(oracle.try_reach(end, None));
            // Of a fixed schedule, any limit on a duration may be asked, but not none.
            let reach = oracle.accepted().and_then(|accepted| end.reach(accepted));
            let farthest = farthest(plan.parameter(end.parameter));
            if is_endless || reach.is_some_and(|reach| reach > farthest) {
                frontier.finish(end);
            }
            if let Some(accepted) = oracle.accepted() {
                envelope.clone_from(accepted);
            }
            widenings += 1;
            on_step(Some(&Widening {
                envelope: &envelope,
                end,
                checks: oracle.checks() - already,
            }))
        } else {
            frontier.reject(end);
            on_step(None)
        };
        if flow.is_break() {
            break StopReason::Cancelled;
        }
    };
    Ok(IrrRun {
        envelope: Ok(envelope),
        widenings,
        checks: oracle.checks() - already,
        stop,
    })
}

/// Moves one end of the accepted box, `envelope`, out by a step; whether it could be, within the
/// parameter's range.
fn widen(
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    range: &Interval,
    end: BoxEnd,
    step: &Rational,
) -> Result<bool, Refusal> {
    let Some(reach) = end.reach(envelope) else {
        return Ok(false);
    };
    let reach = reach + step;
    let value = match end.side {
        Side::Lower => -&reach,
        Side::Upper => reach.clone(),
    };
    Ok(range.contains(&value) && oracle.try_reach(end, Some(reach))?)
}

/// What keeps each end of a box where it is: lower and upper, parameter by parameter. An end that
/// can still move by less than its parameter's `step` is asked what would stop it there. `flow` can
/// end that at any end; nothing is known of those that come after.
pub fn limits(
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    steps: &[Rational],
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Vec<[Option<Limit>; 2]> {
    let plan = Arc::clone(oracle.plan());
    let mut limits = Vec::with_capacity(plan.parameters.len());
    for (index, parameter) in plan.parameters.iter().enumerate() {
        let mut pair = [None, None];
        for side in Side::BOTH {
            let end = BoxEnd {
                parameter: ParameterId::from(index),
                side,
            };
            if flow().is_continue() {
                pair[side.index()] = limit(oracle, envelope, parameter, end, &steps[index]);
            }
        }
        limits.push(pair);
    }
    limits
}

fn limit(
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    parameter: &Parameter,
    end: BoxEnd,
    step: &Rational,
) -> Option<Limit> {
    let Some(reach) = end.reach(envelope) else {
        return Some(Limit::Unbounded);
    };
    let border = end.side.reach(&parameter.range);
    if border.as_ref().is_some_and(|border| reach >= *border) {
        return Some(Limit::Range);
    }
    let target = &reach + step;
    let target = border.map_or(target.clone(), |border| border.min(target));
    let refused = end.with_reach(envelope, Some(target));
    match oracle.objection(&refused) {
        Ok(None) => None,
        Ok(Some(objection)) => Some(Limit::Objection { refused, objection }),
        Err(_) => Some(Limit::Undecided),
    }
}
