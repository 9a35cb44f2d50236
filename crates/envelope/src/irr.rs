//! Incremental Rectangular Robustification.

use std::ops::ControlFlow;

use elbowroom_num::{End, Rational};
use elbowroom_plan::obligations::Refusal;
use elbowroom_plan::reduction::{BoxEnd, Side};
use elbowroom_plan::{DecoupledEnvelope, Parameter, ParameterId};

use crate::frontier::{Frontier, Growth};
use crate::oracle::{Objection, Oracle};

/// How to search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The search ends when all steps are below this (β of Algorithm 1); positive. A step is halved
    /// when both ends of its parameter have refused it, so an end may still have room for almost
    /// twice as much: [`sharpen`](crate::sharpen()) moves each end onto its limit.
    pub precision: Rational,
    /// How steps change after a success.
    pub growth: Growth,
    /// The search ends after so many box checks.
    pub most_checks: Option<usize>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            precision: Rational::ONE,
            growth: Growth::default(),
            most_checks: None,
        }
    }
}

/// A larger box was found.
#[derive(Clone, Debug)]
pub struct Widening<'a> {
    /// The box.
    pub envelope: &'a DecoupledEnvelope,
    /// Which end moved.
    pub end: BoxEnd,
    /// How many boxes had been checked by then.
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
}

/// What keeps one end of the final box where it is.
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
        /// Why.
        objection: Objection,
    },
}

/// The result of [`irr`].
#[derive(Clone, Debug, PartialEq)]
pub struct IrrRun {
    /// The box; `Err` if the plan does not even work at the nominal values.
    pub envelope: Result<DecoupledEnvelope, Objection>,
    /// How many times the box grew.
    pub widenings: usize,
    /// How many boxes were checked.
    pub checks: usize,
    /// Why the search ended.
    pub stop: StopReason,
}

/// Incremental Rectangular Robustification: Algorithm 1 of Cashmore et al. (2020).
///
/// Invariant: the box lies inside the robustness envelope at every iteration, the first included:
/// the start point is checked like any other box. `on_widening` is called each time the box has
/// grown, and once more at every refusal with `None`, so that it can end the search at any moment.
///
/// # Errors
/// When there are too many cases to tell apart.
#[doc(alias = "Incremental Rectangular-Robustification")]
pub fn irr(
    oracle: &mut Oracle<'_>,
    settings: &Settings,
    on_step: &mut dyn FnMut(Option<&Widening<'_>>) -> ControlFlow<()>,
) -> Result<IrrRun, Refusal> {
    let plan = oracle.plan();
    let already = oracle.checks();
    let mut envelope = DecoupledEnvelope::point(&plan.nominal());
    let run = |envelope, widenings, checks, stop| {
        Ok(IrrRun {
            envelope,
            widenings,
            checks: checks - already,
            stop,
        })
    };
    if let Some(objection) = oracle.objection(&envelope)? {
        return run(Err(objection), 0, oracle.checks(), StopReason::Converged);
    }
    let mut frontier = Frontier::new(plan, &settings.precision, settings.growth);
    let mut widenings = 0;
    while let Some((end, step)) = frontier.next_end() {
        if settings
            .most_checks
            .is_some_and(|most| oracle.checks() - already >= most)
        {
            return run(
                Ok(envelope),
                widenings,
                oracle.checks(),
                StopReason::CheckLimit,
            );
        }
        let parameter = plan.parameter(end.parameter);
        let widened = match widened(&envelope, parameter, end, &step) {
            Some(candidate) if oracle.is_inside_after(&candidate, Some(end))? => Some(candidate),
            _ => None,
        };
        let flow = if let Some(candidate) = widened {
            envelope = candidate;
            frontier.accept(end);
            if let Some(farthest) = farthest(&envelope, parameter, end)
                && oracle.is_inside_after(&farthest, Some(end))?
            {
                envelope = farthest;
                frontier.finish(end);
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
            return run(
                Ok(envelope),
                widenings,
                oracle.checks(),
                StopReason::Cancelled,
            );
        }
    }
    run(
        Ok(envelope),
        widenings,
        oracle.checks(),
        StopReason::Converged,
    )
}

/// What keeps each end of a box where it is: lower and upper, parameter by parameter. An end that
/// can still move by less than `step` is asked what would stop it at `step`.
///
/// # Errors
/// When there are too many cases to tell apart.
pub fn limits(
    oracle: &mut Oracle<'_>,
    envelope: &DecoupledEnvelope,
    step: &Rational,
) -> Result<Vec<[Option<Limit>; 2]>, Refusal> {
    let plan = oracle.plan();
    let mut limits = Vec::with_capacity(plan.parameters.len());
    for (index, parameter) in plan.parameters.iter().enumerate() {
        let mut pair = [None, None];
        for (place, side) in [Side::Lower, Side::Upper].into_iter().enumerate() {
            let end = BoxEnd {
                parameter: ParameterId::from(index),
                side,
            };
            pair[place] = limit(oracle, envelope, parameter, end, step)?;
        }
        limits.push(pair);
    }
    Ok(limits)
}

fn limit(
    oracle: &mut Oracle<'_>,
    envelope: &DecoupledEnvelope,
    parameter: &Parameter,
    end: BoxEnd,
    step: &Rational,
) -> Result<Option<Limit>, Refusal> {
    let Some(reach) = end.reach(envelope) else {
        return Ok(Some(Limit::Unbounded));
    };
    let range = DecoupledEnvelope {
        intervals: vec![parameter.range.clone()],
    };
    let border = BoxEnd {
        parameter: ParameterId(0),
        ..end
    }
    .reach(&range);
    if border.as_ref().is_some_and(|border| reach >= *border) {
        return Ok(Some(Limit::Range));
    }
    let target = &reach + step;
    let target = border.map_or(target.clone(), |border| border.min(target));
    let refused = end.with_reach(envelope, Some(target));
    Ok(oracle
        .objection(&refused)?
        .map(|objection| Limit::Objection { refused, objection }))
}

/// The box with one end moved by a step; `None` if that would leave the parameter's range.
fn widened(
    envelope: &DecoupledEnvelope,
    parameter: &Parameter,
    end: BoxEnd,
    step: &Rational,
) -> Option<DecoupledEnvelope> {
    let reach = end.reach(envelope)? + step;
    let widened = end.with_reach(envelope, Some(reach));
    let interval = widened.interval(end.parameter);
    let moved = match end.side {
        Side::Lower => &interval.lower,
        Side::Upper => &interval.upper,
    };
    parameter.range.contains(moved.value()?).then_some(widened)
}

/// The box with one end as far out as the parameter's range goes, if that is infinitely far.
fn farthest(
    envelope: &DecoupledEnvelope,
    parameter: &Parameter,
    end: BoxEnd,
) -> Option<DecoupledEnvelope> {
    let border = match end.side {
        Side::Lower => &parameter.range.lower,
        Side::Upper => &parameter.range.upper,
    };
    matches!(border, End::Infinite).then(|| end.with_reach(envelope, None))
}
