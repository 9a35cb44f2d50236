//! Incremental Rectangular Robustification.

mod conflict_split;
mod parameter_bounds;
mod speculative;

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::obligations::Refusal;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, Parameter, ParametrizedPlan};

use crate::frontier::{Frontier, Growth};
use crate::guarantee::Guarantee;
use crate::objection::Objection;
use crate::oracle::{Oracle, Probe};
use speculative::Speculation;

/// Settings of IRR.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The search ends when all steps are below this (β of Algorithm 1); positive. A step is halved
    /// when both ends of its parameter have been rejected, so an end may still have a slack of
    /// almost twice as much: [`sharpen`](crate::sharpen()) moves each end to its limit.
    pub precision: Rational,
    /// If present, each parameter's precision is this share of its nominal value instead, and its
    /// first step is the nominal value, so that the result does not depend on the unit of time.
    pub relative: Option<Rational>,
    /// Change of the step size after a success.
    pub growth: Growth,
    /// The limit on box checks.
    pub most_checks: Option<usize>,
    /// Work limit after which long conflicts (of many ends) are divided into conditions from one
    /// window to the next, counted in parameters over all checks with such conflicts; `None` never
    /// divides. The box of a long plan may become a little smaller, and is found far sooner.
    pub divide_after: Option<usize>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            precision: Rational::ONE,
            relative: None,
            growth: Growth::default(),
            most_checks: None,
            divide_after: None,
        }
    }
}

impl Settings {
    /// Returns the precision of each of a plan's parameters. For a nominal value of 0, the share
    /// refers to the smallest nominal value of the plan that is not 0.
    pub fn precisions(&self, plan: &ParametrizedPlan) -> Vec<Rational> {
        match &self.relative {
            None => vec![self.precision.clone(); plan.parameters.len()],
            Some(share) => scales(plan).iter().map(|scale| scale * share).collect(),
        }
    }
}

/// Returns the scale of each parameter: the size of its nominal value or, if that is 0, of the
/// smallest one of the plan that is not 0.
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

/// Step of the search that enlarged the box.
#[derive(Clone, Debug)]
pub struct Widening<'a> {
    /// The box.
    pub envelope: &'a DecoupledEnvelope,
    /// End that was moved.
    pub end: BoxEnd,
    /// The number of boxes checked so far.
    pub checks: usize,
}

/// Reason why a search for an envelope ended. The envelope is sound in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All steps are below the precision, or no end can move.
    Converged,
    /// The limit on box checks was reached.
    CheckLimit,
    /// The caller cancelled the search.
    Cancelled,
    /// Some wider boxes are undecided, because there are too many cases. The ends in question stay
    /// where they were.
    Undecided,
}

/// The number of undecided boxes after which a search ends, because each of them takes long.
const MAX_UNDECIDED: usize = 4;

/// Returns the greatest reach of an end that could move out without limit and is not infinite: a
/// thousand million times the nominal value, or 1.
pub(crate) fn max_reach(parameter: &Parameter) -> Rational {
    &Rational::from(1_000_000_000) * &parameter.nominal.abs().max(Rational::ONE)
}

/// The reason why one end of the final box cannot move.
#[derive(Clone, Debug, PartialEq)]
pub enum Limit {
    /// Nothing: the end is infinite.
    Unbounded,
    /// All finite values are possible, but no fixed schedule works for all of them.
    AnyFinite,
    /// The parameter's natural range.
    Range,
    /// The box with this end moved out is not inside the envelope, for this reason.
    Objection(Objection),
    /// The box with this end moved out is undecided.
    Undecided,
}

/// The result of [`irr`].
#[derive(Clone, Debug, PartialEq)]
pub struct IrrRun {
    /// The box; `Err` if the plan does not work at the nominal values.
    pub envelope: Result<DecoupledEnvelope, Objection>,
    /// Number of widenings.
    pub widenings: usize,
    /// The number of boxes checked.
    pub checks: usize,
    /// Reason why the search ended.
    pub stop: StopReason,
}

/// Incremental Rectangular Robustification: Algorithm 1 of Cashmore et al. (2020).
///
/// Invariant: the box lies inside the robustness envelope at every iteration, including the first:
/// the start point is checked like any other box. `on_step` is called with each wider box, and with
/// `None` at every rejection, so that it can end the search at any moment. The result found so far
/// is kept. An undecided wider box is treated as rejected.
///
/// The steps, their outcomes and their number are those of one check after the other, but boxes
/// with a known outcome are not checked. Many boxes are found inside by checking the last of them,
/// and many are rejected for a reason that already rejected another one. If long conflicts are
/// divided ([`Settings::divide_after`]), some steps are rejected that a check would accept.
///
/// # Errors
/// If the start point is undecided.
#[doc(alias = "Incremental Rectangular-Robustification")]
pub fn irr(
    oracle: &mut Oracle,
    settings: &Settings,
    on_step: &mut dyn FnMut(Option<&Widening<'_>>) -> ControlFlow<()>,
) -> Result<IrrRun, Refusal> {
    let plan = Arc::clone(oracle.plan());
    let already = oracle.checks();
    let envelope = DecoupledEnvelope::point(&plan.nominal());
    let scales = settings.relative.is_some().then(|| scales(&plan));
    let precisions = settings.precisions(&plan);
    let frontier = Frontier::new(&plan, precisions, scales.as_deref(), settings.growth);
    let mut widenings = 0;
    let mut count = |widening: Option<&Widening<'_>>| {
        widenings += usize::from(widening.is_some());
        on_step(widening)
    };
    let asks_little = oracle.is_wide_check_cheap();
    let mut search = Speculation::new(oracle, settings, frontier, envelope);
    // A box inside the envelope proves that the nominal values in it are inside as well.
    let at_once = asks_little
        .then(|| search.run_at_once(&mut count))
        .flatten();
    let stop = match at_once {
        Some(stop) => stop,
        None => match search.start()? {
            None => search.run(&mut count),
            Some(objection) => {
                return Ok(IrrRun {
                    envelope: Err(objection),
                    widenings: 0,
                    checks: oracle.checks() - already,
                    stop: StopReason::Converged,
                });
            }
        },
    };
    let (checks, envelope) = (search.checks(), search.finish());
    oracle.count_checks(already + checks);
    Ok(IrrRun {
        envelope: Ok(envelope),
        widenings,
        checks,
        stop,
    })
}

/// Returns the limit of each of these ends of a box, if there is one. For an end that can still
/// move by less than its parameter's `step`, the limit is the reason why it cannot move by `step`.
/// `flow` can end the computation at any end; later ends have no result. If the box is inside the
/// envelope, it is the oracle's accepted one afterwards.
pub fn limits(
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    (ends, steps): (&[BoxEnd], &[Rational]),
    flow: &mut dyn FnMut() -> ControlFlow<()>,
    on_limit: &mut dyn FnMut(BoxEnd, &Limit),
) {
    let plan = Arc::clone(oracle.plan());
    let mut probe = oracle.probe(envelope);
    for &end in ends {
        if flow().is_break() {
            break;
        }
        let (own, step) = (plan.parameter(end.parameter), &steps[end.parameter.index()]);
        if let Some(limit) = limit((oracle, &mut probe), envelope, own, end, step) {
            on_limit(end, &limit);
        }
    }
}

fn limit(
    (oracle, probe): (&mut Oracle, &mut Option<Probe>),
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
    let objection = match probe {
        Some(probe) => probe.objection(oracle, (end, &reach, &target)),
        None => oracle.objection_to_widening(envelope, end, Some(target)),
    };
    match objection {
        Ok(None) => {
            let is_far = &reach * &Rational::from(FAR_DIVISOR) > max_reach(parameter);
            if !is_far || oracle.guarantee() != Guarantee::Strong {
                return None;
            }
            let is_any = oracle.accepts_all_finite(envelope, end).unwrap_or(false);
            *probe = oracle.probe(envelope);
            is_any.then_some(Limit::AnyFinite)
        }
        Ok(Some(objection)) => Some(Limit::Objection(objection)),
        Err(_) => Some(Limit::Undecided),
    }
}

/// Divisor of [`max_reach`]: an end that can move beyond the quotient may have no limit.
const FAR_DIVISOR: i64 = 4;
