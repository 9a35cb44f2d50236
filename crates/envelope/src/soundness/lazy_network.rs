//! The network of a box, built only when a new proof is needed.

use elbowroom_model::Task;

use super::proof::{Proof, ProofResult, Prover};
use super::scale::{ExactScale, IntegerScale, Numbers};
use super::violation_case::{Outcome, Schedules};
use crate::obligations::{BadCase, Obligations, OverAll, Refusal, ensure_not_stopped};
use crate::reduction::Reduction;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan};

/// Network of a box, built on first use.
pub(crate) enum LazyNetwork<'a> {
    Unbuilt(&'a Reduction, &'a DecoupledEnvelope, Option<&'a Numbers>),
    Built(AnySchedules<'a>),
    /// The box has no schedule, so none is bad.
    Empty,
}

impl<'a> LazyNetwork<'a> {
    /// Returns the network; `None` if the box has no schedule.
    ///
    /// # Errors
    /// After a stop request.
    pub(crate) fn get(&mut self) -> Result<Option<&mut AnySchedules<'a>>, Refusal> {
        ensure_not_stopped()?;
        if let Self::Unbuilt(reduction, envelope, numbers) = *self {
            *self =
                AnySchedules::new(reduction, envelope, numbers).map_or(Self::Empty, Self::Built);
        }
        Ok(match self {
            Self::Built(schedules) => Some(schedules),
            Self::Unbuilt(..) | Self::Empty => None,
        })
    }
}

/// Network of a box, with whole numbers as weights if they fit.
pub(crate) enum AnySchedules<'a> {
    Integer(Schedules<'a, IntegerScale>),
    Exact(Schedules<'a, ExactScale>),
}

impl<'a> AnySchedules<'a> {
    /// Builds the network; `None` if the box has no schedule.
    fn new(
        reduction: &'a Reduction,
        envelope: &'a DecoupledEnvelope,
        numbers: Option<&Numbers>,
    ) -> Option<Self> {
        match numbers.and_then(|numbers| IntegerScale::fitting(reduction, envelope, numbers)) {
            Some(scale) => Schedules::new(reduction, envelope, scale).map(Self::Integer),
            None => Schedules::new(reduction, envelope, ExactScale).map(Self::Exact),
        }
    }

    /// Like [`new`](Self::new), but proofs list the constraints that they add up.
    pub(crate) fn with_explanations(
        reduction: &'a Reduction,
        envelope: &'a DecoupledEnvelope,
        numbers: Option<&Numbers>,
    ) -> Option<Self> {
        let mut schedules = Self::new(reduction, envelope, numbers)?;
        match &mut schedules {
            Self::Integer(schedules) => schedules.enable_explanations(),
            Self::Exact(schedules) => schedules.enable_explanations(),
        }
        Some(schedules)
    }

    pub(crate) fn possible(&mut self, case: &BadCase) -> Outcome {
        match self {
            Self::Integer(schedules) => schedules.possible(case),
            Self::Exact(schedules) => schedules.possible(case),
        }
    }

    pub(crate) fn prove(
        &mut self,
        task: &'a Task,
        plan: &'a ParametrizedPlan,
        over_all: &'a OverAll,
        is_in_ranges: bool,
        (old, moved): (Option<&Proof>, Option<BoxEnd>),
    ) -> Result<ProofResult, Refusal> {
        match self {
            Self::Integer(schedules) => {
                Prover::new(task, plan, over_all, schedules, is_in_ranges).prove(old, moved)
            }
            Self::Exact(schedules) => {
                Prover::new(task, plan, over_all, schedules, is_in_ranges).prove(old, moved)
            }
        }
    }
}

/// Returns the numbers in bounds, except the ends of boxes; `None` if they are large.
pub(crate) fn numbers(reduction: &Reduction, obligations: &Obligations) -> Option<Numbers> {
    let mut numbers = Numbers::default();
    numbers.include_edges(reduction.edges())?;
    reduction
        .offsets()
        .try_for_each(|offset| numbers.include(offset))?;
    let cases = obligations.direct.iter().flat_map(|o| &o.bad_cases);
    cases
        .flat_map(|case| &case.differences)
        .try_for_each(|difference| numbers.include(&difference.bound))?;
    Some(numbers)
}
