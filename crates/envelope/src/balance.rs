//! Greatest deviation that all parameters tolerate at once.

use std::ops::ControlFlow;

use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, Side};

use crate::obligations::Refusal;
use crate::oracle::Oracle;
use crate::ray::Ray;

/// Greatest deviation that is searched, as a multiple of the nominal value.
const MOST: i64 = 10;

/// Share of the nominal values by which all parameters may deviate at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// Deviation that is guaranteed to work.
    pub inside: Rational,
    /// Upper bound on the deviation; the same as `inside` if that is exact. `None` if the greatest
    /// searched deviation works.
    pub outside: Option<Rational>,
}

/// Deviations that all parameters tolerate at once, relative to their nominal values, each within
/// its natural range. A parameter with nominal value 0 does not move.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Balance {
    /// All upwards.
    pub more: Share,
    /// All downwards; a parameter that cannot be negative stops at a share of 1.
    pub less: Share,
    /// Each in any direction.
    pub either: Share,
}

/// Computes the deviation that all parameters tolerate at once. Returns `None` if the plan does not
/// work at its nominal values, if no parameter is left open, or if `flow` ended the search.
///
/// # Errors
/// If there are too many cases to decide.
pub fn balance(
    oracle: &mut Oracle,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Option<Balance>, Refusal> {
    let plan = std::sync::Arc::clone(oracle.plan());
    let nominal = DecoupledEnvelope::point(&plan.nominal());
    let is_open = plan.parameters.iter().any(|own| !own.nominal.is_zero());
    if !is_open || oracle.objection(&nominal)?.is_some() {
        return Ok(None);
    }
    let mut cuts = Vec::new();
    let mut share = |sides: &[Side]| -> Result<Option<Share>, Refusal> {
        let mut ray = Ray::new(&plan);
        for (index, parameter) in plan.parameters.iter().enumerate() {
            for side in sides {
                ray.step[2 * index + side.index()] = parameter.nominal.abs();
            }
        }
        let most = Rational::from(MOST);
        let zero = Rational::ZERO;
        let reached = ray.shoot(oracle, &zero, &most, &mut cuts, &mut |_, _| flow())?;
        Ok(flow().is_continue().then_some(Share {
            outside: (reached.inside < most).then_some(reached.outside),
            inside: reached.inside,
        }))
    };
    let Some(more) = share(&[Side::Upper])? else {
        return Ok(None);
    };
    let Some(less) = share(&[Side::Lower])? else {
        return Ok(None);
    };
    let either = share(&Side::BOTH)?;
    Ok(either.map(|either| Balance { more, less, either }))
}
