//! The search for the box of a plan. `elbowroom envelope` and runs share it, so that a run starts
//! under exactly the box that the command reports.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::pipeline::PipelineError;
use elbowroom_envelope::{
    BestRun, BestSettings, BestStep, Growth, Guarantee, Method, Objection, Objective, Oracle,
    Settings as IrrSettings, StopReason, Widening, best, irr,
};
use elbowroom_execution::run::TimeoutRule;
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::DecoupledEnvelope;
use elbowroom_plan::parametrize::VarySpec;
use elbowroom_sim::WorldModel;

use crate::duration_distributions::{DistributionError, duration_distributions};

/// The quantities to vary, and the settings of the search.
#[derive(Clone, Debug)]
pub struct EnvelopeSettings {
    /// Quantities to leave open; if empty, all durations that the domain fixes.
    pub vary: Vec<VarySpec>,
    /// The guarantee inside the envelope.
    pub guarantee: Guarantee,
    /// The rule that sets the time-out of each action.
    pub timeout: TimeoutRule,
    /// Settings of the search for the box.
    pub search: Search,
    /// World whose distributions of durations
    /// [`Objective::Probability`] uses.
    pub world: Option<Arc<WorldModel>>,
}

impl Default for EnvelopeSettings {
    /// Returns settings with all durations open that the domain fixes, the dynamic guarantee, and
    /// the default search.
    fn default() -> Self {
        Self {
            vary: Vec::new(),
            guarantee: Guarantee::default(),
            timeout: TimeoutRule::default(),
            search: Search::default(),
            world: None,
        }
    }
}

/// Settings of the search for an envelope.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// The algorithm; by default the one that [`method_for`](Self::method_for) returns.
    pub method: Option<Method>,
    /// Step size below which the search ends; positive.
    pub precision: Rational,
    /// Alternative to `precision`: the precision of each parameter as a share of its nominal value.
    pub relative: Option<Rational>,
    /// Change of step sizes after a success.
    pub growth: Growth,
    /// `true` to move each end exactly onto its limit after the search.
    pub sharpen: bool,
    /// Maximum number of box checks.
    pub most_checks: Option<usize>,
    /// Settings of [`Method::Best`].
    pub best: BestSettings,
}

impl Default for Search {
    /// Returns the settings of the search for the box with the greatest least slack. The search
    /// begins with IRR: precision a hundredth of each nominal value, doubling steps, no sharpening
    /// and no limit.
    fn default() -> Self {
        let settings = IrrSettings::default();
        Self {
            method: None,
            precision: settings.precision,
            relative: Some(Rational::new(1, 100)),
            growth: settings.growth,
            sharpen: false,
            most_checks: settings.most_checks,
            best: BestSettings::default(),
        }
    }
}

impl Search {
    /// Returns the settings of the search for the largest box by this objective.
    pub fn best(objective: Objective) -> Self {
        let mut search = Self {
            method: Some(Method::Best),
            ..Self::default()
        };
        search.best.objective = objective;
        search
    }

    /// Returns the settings of IRR, the algorithm of paper 1.
    pub fn irr() -> Self {
        Self {
            method: Some(Method::Irr),
            ..Self::default()
        }
    }

    /// Sets this precision for all parameters, in the unit of the plan.
    #[must_use]
    pub fn with_precision(mut self, precision: Rational) -> Self {
        self.precision = precision;
        self.relative = None;
        self
    }

    /// Returns the method for the plans of a problem. The default is the largest box. It is IRR if
    /// the settings have a precision, steps that do not double, or sharpened ends, which only IRR
    /// supports, and for problems with processes or events, for whose boxes nothing can be proved.
    pub fn method_for(&self, task: &Task) -> Method {
        if let Some(method) = self.method {
            return method;
        }
        let usual = Self::default();
        let is_for_irr = self.relative != usual.relative
            || self.precision != usual.precision
            || self.growth != usual.growth
            || self.sharpen;
        if is_for_irr || task.unsupported_by_analysis().is_some() {
            Method::Irr
        } else {
            Method::Best
        }
    }

    /// Returns the settings of IRR.
    pub fn settings(&self) -> IrrSettings {
        IrrSettings {
            precision: self.precision.clone(),
            relative: self.relative.clone(),
            growth: self.growth,
            most_checks: self.most_checks,
            divide_after: Some(DIVIDE_AFTER),
        }
    }
}

/// Number of examined parameters before long conflicts are divided
/// ([`divide_after`](elbowroom_envelope::Settings::divide_after)). Plans of a thousand actions hardly reach it.
const DIVIDE_AFTER: usize = 50_000;

/// Reasons why a search finds no box.
#[derive(Debug, thiserror::Error)]
pub enum BoxSearchError {
    /// There are too many cases to distinguish.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The probability that the durations of the plan stay inside a box is unknown.
    #[error(transparent)]
    Distribution(#[from] DistributionError),
}

/// A step of the search.
pub enum Step<'a> {
    /// IRR has tried to move an end. Contains the widening if it was moved.
    Irr(Option<&'a Widening<'a>>),
    /// A step of the search for the best box.
    Best(&'a BestStep<'a>),
}

/// The result of a search.
pub struct SearchResult {
    /// The box, or the reason why the plan fails as planned.
    pub envelope: Result<DecoupledEnvelope, Objection>,
    /// The reason for the end of IRR.
    pub stop: StopReason,
    /// The search for the best box, with its settings, if there was one.
    pub best: Option<(BestSettings, BestRun)>,
}

/// Searches for a box inside the envelope of the plan of `oracle`, until `on_step` breaks.
///
/// # Errors
/// When there are too many cases to distinguish, or the probability of a box is unknown.
pub fn grow(
    oracle: &mut Oracle,
    (search, method): (&Search, Method),
    world: Option<&Arc<WorldModel>>,
    on_step: &mut dyn FnMut(&Step<'_>) -> ControlFlow<()>,
) -> Result<SearchResult, BoxSearchError> {
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
    let run = match run {
        Err(Refusal::Interrupted) => {
            grown.stop = StopReason::Cancelled;
            return Ok(grown);
        }
        run => run.map_err(PipelineError::Refused)?,
    };
    if run.is_cancelled && !has_checks {
        grown.stop = StopReason::CheckLimit;
    }
    grown.envelope.clone_from(&run.envelope);
    grown.best = Some((settings, run));
    Ok(grown)
}
