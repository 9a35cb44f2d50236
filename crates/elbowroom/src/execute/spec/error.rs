//! Errors of specifications of runs.

use elbowroom_execution::PrepareError;
use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_external::PlannerError;
use elbowroom_text::Diagnostics;

use crate::{BoxTextError, DistributionError};

/// A specification that cannot be run.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SpecError {
    /// The domain or the problem cannot be read.
    #[error("{0}")]
    Problem(Diagnostics),
    /// The world file cannot be read.
    #[error("{0}")]
    World(Diagnostics),
    /// Another planner is unknown, or cannot be used with these settings.
    #[error(transparent)]
    Planner(#[from] PlannerError),
    /// The likelihood file cannot be read.
    #[error("{0}")]
    Likelihoods(Diagnostics),
    /// The problem has a part that executors do not support.
    #[error(
        "plans cannot be executed here: the domain has {0}, which executors do not support yet"
    )]
    UnsupportedFeature(&'static str),
    /// The time-outs name an action that the problem does not have.
    #[error("{0}")]
    Timeout(String),
    /// The executor compares plans in the world of a world file, but there is none.
    #[error("`{0}` needs a model of the world")]
    NeedsWorld(ExecutorSpec),
    /// Likelihoods are given to an executor that does not use them.
    #[error("`{0}` does not use likelihoods")]
    UnusedLikelihoods(ExecutorSpec),
    /// The executor compares plans of the embedded planner, but another planner is given.
    #[error("`{0}` needs the embedded planner, because it chooses among its plans")]
    NeedsEmbedded(ExecutorSpec),
    /// Self-overlap was allowed, but the plans come from another planner, or there is no planner.
    #[error(
        "only plans of the embedded planner can be allowed to have self-overlap, not plans of \
             `{0}`"
    )]
    SelfOverlap(String),
    /// The likeliest first plan was requested, but it cannot be chosen.
    #[error("the likeliest first plan cannot be chosen: {0}")]
    FirstPlan(FirstPlanError),
    /// A time limit was set for a planner that has none.
    #[error("`{0}` has no time limit for better plans; the embedded planner is limited by states")]
    NoTimeLimit(String),
    /// The most likely box was requested, but there is no model of the world.
    #[error(transparent)]
    Distribution(#[from] DistributionError),
    /// Plans were requested with the durations of a believed world, but there is no such world, or a planner that does
    /// not use it.
    #[error(
        "plans have believed durations only if there is a believed world and the embedded planner makes all plans"
    )]
    BelievedDurations,
    /// A simulation was requested, but the world is a process.
    #[error("the world is a process; it cannot be simulated")]
    Process,
    /// The adversarial world cannot be created.
    #[error(transparent)]
    Adversary(#[from] AdversaryError),
}

/// Reasons why the first plan cannot be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FirstPlanError {
    /// A plan was given.
    #[error("a plan is given")]
    Given,
    /// Another planner was named, whose plan is used without a choice.
    #[error("only plans of the embedded planner can be compared")]
    ExternalPlanner,
    /// There is no world file, and there are no likelihoods.
    #[error("there is no model of the world")]
    NoWorldKnowledge,
    /// Goals are given later.
    #[error("the goals are given later")]
    Persistent,
}

/// Reasons why an adversarial world cannot be created.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AdversaryError {
    /// There is no plan.
    #[error("the adversary needs a plan")]
    NoPlan,
    /// The plan cannot be prepared.
    #[error(transparent)]
    Unprepared(#[from] PrepareError),
    /// The box is not one of this plan.
    #[error(transparent)]
    Box(#[from] BoxTextError),
    /// The plan has no envelope, and no box was given.
    #[error("the plan has no envelope from which the adversary could choose values")]
    NoEnvelope,
    /// The plan's constraints are inconsistent.
    #[error("no values in this box satisfy the plan's constraints")]
    Empty,
}
