//! Requests about plans and their answers.
//!
//! An answer is plain data. It can be serialized with `serde`; its JSON is the document that
//! `docs/reference/formats` describes and that the command line prints. The front ends (the command, other
//! languages, reports) differ only in how they show it.
//!
//! A request that can take long is given an [`Observer`], which receives progress events and can end
//! the work early. The result found so far is the answer; for an envelope, it is sound at any time.
//!
//! | question | request | answer |
//! |---|---|---|
//! | is there a plan? | [`PlanRequest`] | [`PlanAnswer`] |
//! | is a plan valid? | [`CheckRequest`] | [`CheckAnswer`] |
//! | which orderings and bounds are necessary? | [`StnRequest`] | [`StnAnswer`] |
//! | how much may each quantity deviate? | [`EnvelopeRequest`] | [`EnvelopeAnswer`] |
//! | how many failures does it afford? | [`FaultsRequest`] | [`FaultsAnswer`] |
//! | for what values does it work? | [`EnvelopeRequest`] | [`RegionAnswer`] |
//! | which least change makes it work? | [`RepairRequest`] | [`RepairAnswer`] |
//! | how does its execution end? | [`RunInputs`](crate::execute::RunInputs) | [`RunAnswer`] |
//! | which world do the logs suggest? | [`LearnRequest`] | [`LearnAnswer`] |
//! | how likely is a plan to succeed? | [`OddsRequest`] | [`OddsAnswer`] |

pub mod check;
pub mod envelope;
pub mod faults;
mod format;
pub mod learn;
mod observer;
pub mod odds;
pub mod plan;
pub mod region;
pub mod repair;
pub mod run;
pub mod stn;
mod violation;

pub use check::{CheckAnswer, CheckRequest};
pub use elbowroom_report::exact::{self, Exact};
pub use envelope::{EnvelopeAnswer, EnvelopeOutcome, EnvelopeRequest};
pub use faults::{FaultsAnswer, FaultsRequest};
pub use format::Version;
pub use learn::{LearnAnswer, LearnRequest};
pub use observer::{
    EnvelopeProgress, Event, NoObserver, Observer, PlanProgress, StopRequest, TrialsProgress,
};
pub use odds::{OddsAnswer, OddsRequest};
pub use plan::{PlanAnswer, PlanOutcome, PlanRequest};
pub use region::{RegionAnswer, RegionOutcome};
pub use repair::{RepairAnswer, RepairOutcome, RepairRequest};
pub use run::{RunAnswer, RunOutcome, RunProgress};
pub use stn::{StnAnswer, StnOutcome, StnRequest};
pub use violation::ViolationAnswer;

use elbowroom_plan::box_text::BoxTextError;
use elbowroom_selection::DistributionError;
use elbowroom_selection::box_search::BoxSearchError;

use crate::pipeline::PipelineError;

/// A reason for a missing answer: the request cannot be understood, or exceeds the analysis.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RequestError {
    /// The plan has no order, the requested quantities cannot be left open, or the plan is beyond
    /// exact analysis.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The given box is not one of this plan.
    #[error(transparent)]
    Box(#[from] BoxTextError),
    /// The validator cannot decide on the plan, for this reason.
    #[error("it is undecided whether the plan is valid: {0}")]
    Undecided(String),
    /// The probability that the durations of the plan stay inside a box is unknown.
    #[error(transparent)]
    Distribution(#[from] DistributionError),
    /// The time-outs name an action that the problem does not have.
    #[error("{0}")]
    Timeout(String),
    /// The problem has this unsupported feature.
    #[error("{0}")]
    Unsupported(String),
}

impl From<BoxSearchError> for RequestError {
    fn from(error: BoxSearchError) -> Self {
        match error {
            BoxSearchError::Pipeline(error) => Self::Pipeline(error),
            BoxSearchError::Distribution(error) => Self::Distribution(error),
        }
    }
}
