//! The search for the box of a plan. `elbowroom envelope` and runs share it, so that a run starts
//! under exactly the box that the command reports.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::{
    BestRun, BestSettings, BestStep, Method, Objection, Objective, Oracle, StopReason, Widening,
    best, irr,
};
use elbowroom_plan::DecoupledEnvelope;
use elbowroom_sim::WorldModel;

use super::Search;
use crate::answers::RequestError;
use crate::duration_distributions::{DistributionError, duration_distributions};
use crate::pipeline::PipelineError;

/// A step of the search.
pub(crate) enum Step<'a> {
    /// IRR has tried to move an end; the widening if it did.
    Irr(Option<&'a Widening<'a>>),
    /// A step of the search for the best box.
    Best(&'a BestStep<'a>),
}

/// The result of a search.
pub(crate) struct SearchResult {
    /// The box, or the reason why the plan fails as planned.
    pub(crate) envelope: Result<DecoupledEnvelope, Objection>,
    /// The reason for the end of IRR.
    pub(crate) stop: StopReason,
    /// The search for the best box, with its settings, if there was one.
    pub(crate) best: Option<(BestSettings, BestRun)>,
}

/// Searches for a box inside the envelope of the plan of `oracle`, until `on_step` breaks.
///
/// # Errors
/// When there are too many cases to distinguish, or the probability of a box is unknown.
pub(crate) fn grow(
    oracle: &mut Oracle,
    (search, method): (&Search, Method),
    world: Option<&Arc<WorldModel>>,
    on_step: &mut dyn FnMut(&Step<'_>) -> ControlFlow<()>,
) -> Result<SearchResult, RequestError> {
    let plan = Arc::clone(oracle.plan());
    let run = irr(oracle, &search.settings(), &mut |widening| {
        on_step(&Step::Irr(widening))
    })
    .map_err(PipelineError::Refused)?;
    // Without parameters there is no largest box.
    let is_to_be_best =
        method == Method::Best && run.stop == StopReason::Converged && !plan.parameters.is_empty();
    let mut grown = SearchResult {
        envelope: run.envelope,
        stop: run.stop,
        best: None,
    };
    if !is_to_be_best {
        return Ok(grown);
    }
    let Ok(start) = &grown.envelope else {
        return Ok(grown);
    };
    let mut settings = search.best.clone();
    if settings.objective == Objective::Probability {
        settings.distributions =
            duration_distributions(&plan, world.ok_or(DistributionError::NoWorld)?)?;
    }
    let most_checks = search.most_checks.unwrap_or(usize::MAX);
    let mut has_checks = true;
    let run = best(oracle, &settings, Some(start), &mut |step| {
        has_checks = step.checks < most_checks;
        if has_checks {
            on_step(&Step::Best(step))
        } else {
            ControlFlow::Break(())
        }
    });
    let run = run.map_err(PipelineError::Refused)?;
    if run.is_cancelled && !has_checks {
        grown.stop = StopReason::CheckLimit;
    }
    grown.envelope.clone_from(&run.envelope);
    grown.best = Some((settings, run));
    Ok(grown)
}
