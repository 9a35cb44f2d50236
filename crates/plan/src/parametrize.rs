//! Selection of the quantities of a plan that become parameters: [`VarySpec`] and [`parametrize`].
//!
//! A specification names one quantity, or several of the same kind:
//!
//! | specification | leaves open |
//! | --- | --- |
//! | `durations` | the duration of every durative instance |
//! | `ACTIONS`, `duration ACTIONS` | the durations of these instances |
//! | `constant ACTIONS FUNCTION [VALUE] [shared]` | a number in their effects on the function |
//! | `condition ACTIONS FUNCTION [VALUE] [shared]` | a number that their conditions compare it with |
//! | `initial (FUNCTION object …)` | the value of a fluent at time 0 |
//! | `deadline (PREDICATE object …)` | when timed initials make the fact false |
//! | `timed (NAME object …)` | when timed initials change the fact or fluent in any way |
//! | `?s=VALUE`, `n0.?r=VALUE` | a `:synth-parameters` number, nominally `VALUE` |
//!
//! Without any specification, all durations are left open. If the domain gives an interval for a
//! duration, this is its range; otherwise its range is unlimited. Durations that the executor
//! chooses (`controllable ACTIONS`) are not left open.
//!
//! `ACTIONS` is the name of an action (all its instances), a label (that instance), or `(NAME
//! object …)`: every instance with these arguments; `_` matches any object. A number in effects is
//! the amount of an `increase`, `decrease` or `assign`, or a rate. If there are several, `VALUE`
//! selects one. There is one parameter for each instance, or a single one for all if `shared`.
//! `?r=VALUE` sets an action's number in all instances.
//!
//! Each specification may be followed by `weight W` (the weight in a search) and `in [LB, UB]` (the
//! range). A later specification of the same quantity overrides weight and range.
//!
//! ```
//! use elbowroom_plan::parametrize::VarySpec;
//!
//! let drives: VarySpec = "duration (goto _ depot) weight 2 in [0, 120]".parse()?;
//! let consumption: VarySpec = "constant produce_base_1 charge_level shared".parse()?;
//! # Ok::<(), elbowroom_plan::parametrize::ParametrizeError>(())
//! ```

mod builder;
mod constants;
mod error;
mod quantities;
mod select;
mod spec;

use elbowroom_model::Task;

pub use error::ParametrizeError;
pub use spec::{ConstantTarget, Selection, Target, VarySpec};

use crate::network::Schedule;
use crate::parameter::ParametrizedPlan;
use crate::stn_plan::StnPlan;
use builder::ParametrizationBuilder;

/// Replaces quantities of a plan by parameters.
///
/// Without specifications of quantities, these are all durations except those of
/// [`Target::Controllable`]. Numbers that the domain itself leaves open always become parameters.
/// `nominal` is a schedule of the plan. It determines the nominal durations.
///
/// # Errors
/// When a specification matches nothing, or is ambiguous, or a nominal value is missing.
pub fn parametrize(
    task: &Task,
    plan: StnPlan,
    nominal: &Schedule,
    specs: &[VarySpec],
) -> Result<ParametrizedPlan, ParametrizeError> {
    let plan = ParametrizedPlan::closed(task, plan);
    let durations: VarySpec = "durations".parse()?;
    let names_a_quantity = |spec: &VarySpec| {
        !matches!(
            spec.target,
            Target::Unknown { .. } | Target::Controllable(_)
        )
    };
    if specs.iter().any(names_a_quantity) {
        return vary(task, plan, nominal, specs);
    }
    let all = [durations].into_iter().chain(specs.iter().cloned());
    let mut opening = ParametrizationBuilder::new(task, plan, nominal)?;
    opening.apply_all(&all.collect::<Vec<_>>())?;
    opening.finish()
}

/// Replaces more quantities by parameters, in a plan that may have parameters already.
///
/// # Errors
/// As for [`parametrize`].
pub fn vary(
    task: &Task,
    plan: ParametrizedPlan,
    nominal: &Schedule,
    specs: &[VarySpec],
) -> Result<ParametrizedPlan, ParametrizeError> {
    let mut opening = ParametrizationBuilder::new(task, plan, nominal)?;
    opening.apply_all(specs)?;
    opening.finish()
}

fn nothing_matches(spec: &VarySpec, why: String) -> ParametrizeError {
    ParametrizeError::NothingMatches {
        spec: spec.text.clone(),
        why,
    }
}

#[cfg(test)]
mod tests;
