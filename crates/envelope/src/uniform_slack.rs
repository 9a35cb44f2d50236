//! Greatest deviation that all parameters tolerate at once.

use std::ops::ControlFlow;

use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, Side};

use crate::line_search::LineSearch;
use crate::obligations::Refusal;
use crate::oracle::Oracle;

/// Greatest deviation that is searched, as a multiple of the nominal value.
const MAX_DEVIATION: i64 = 10;

/// Share of the nominal values by which all parameters may deviate at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviationBounds {
    /// Deviation that is guaranteed to work.
    pub lower_bound: Rational,
    /// Upper bound on the deviation; the same as `inside` if that is exact. `None` if the greatest
    /// searched deviation works.
    pub upper_bound: Option<Rational>,
}

/// Deviations that all parameters tolerate at once, relative to their nominal values, each within
/// its natural range. A parameter with nominal value 0 does not move.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UniformSlack {
    /// All upwards.
    pub increase: DeviationBounds,
    /// All downwards; a parameter that cannot be negative stops at a share of 1.
    pub decrease: DeviationBounds,
    /// Each in any direction.
    pub both_directions: DeviationBounds,
}

/// Computes the deviation that all parameters tolerate at once. Returns `None` if the plan does not
/// work at its nominal values, if no parameter is left open, or if `flow` ended the search.
///
/// # Errors
/// If there are too many cases to decide.
pub fn max_uniform_slack(
    oracle: &mut Oracle,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Option<UniformSlack>, Refusal> {
    let plan = std::sync::Arc::clone(oracle.plan());
    let nominal = DecoupledEnvelope::point(&plan.nominal());
    let is_open = plan.parameters.iter().any(|own| !own.nominal.is_zero());
    if !is_open || oracle.objection(&nominal)?.is_some() {
        return Ok(None);
    }
    let mut cuts = Vec::new();
    let mut share = |sides: &[Side]| -> Result<Option<DeviationBounds>, Refusal> {
        let mut ray = LineSearch::new(&plan);
        for (index, parameter) in plan.parameters.iter().enumerate() {
            for side in sides {
                ray.step[2 * index + side.index()] = parameter.nominal.abs();
            }
        }
        let most = Rational::from(MAX_DEVIATION);
        let zero = Rational::ZERO;
        let reached = ray.search(oracle, &zero, &most, &mut cuts, &mut |_, _| flow())?;
        Ok(flow().is_continue().then_some(DeviationBounds {
            upper_bound: (reached.lower_bound < most).then_some(reached.upper_bound),
            lower_bound: reached.lower_bound,
        }))
    };
    let Some(more) = share(&[Side::Upper])? else {
        return Ok(None);
    };
    let Some(less) = share(&[Side::Lower])? else {
        return Ok(None);
    };
    let either = share(&Side::BOTH)?;
    Ok(either.map(|either| UniformSlack {
        increase: more,
        decrease: less,
        both_directions: either,
    }))
}
