//! Robustness envelopes: the deviations under which a plan still works (Cashmore et al., 2020).
//!
//! The input is a [`ParametrizedPlan`](elbowroom_plan::ParametrizedPlan). The output is a box of
//! parameter values, the *decoupled envelope*, for which the plan is guaranteed to work.
//!
//! - [`mod@obligations`]: the requirements on every schedule of a plan.
//! - [`mod@soundness`]: the check that every schedule for every value in a box satisfies them.
//! - [`Guarantee`]: the controllability that is required in a box: weak, dynamic or strong.
//! - [`Oracle`]: the exact box check (Algorithm 1's CHECKINENVELOPE), both together.
//! - [`irr`]: Incremental Rectangular Robustification (Algorithm 1), anytime.
//! - [`best()`]: the largest box by an objective, approached from outside, with a proof.
//! - [`exact()`]: all values for which a plan works, as a union of polyhedra.
//! - [`repair()`]: the cheapest change of quantities that makes a plan work.
//! - [`max_uniform_slack()`]: the deviation that all quantities tolerate at once.
//! - [`faults`]: the number of failed attempts that a plan affords.
//! - [`Objection`]: the reason why a box is not inside, with values and a schedule that show it.
//! - [`explain::Explainer`]: what limits a box, and why a plan fails, in words.
//! - [`mod@pipeline`]: from a plan with fixed times to a network with open quantities.
//! - [`pinning`]: fixes differences of times where numeric conditions need it.
//! - [`linear_form`]: all conditions on the schedules of a plan as linear inequalities.
//! - [`RoundingRule`], [`plan_text()`]: plans whose numbers were rounded, and such text for other
//!   tools.
//!
//! Linear programs and minimum cost flows are solved here. `elbowroom-execution` does not depend on
//! this crate, so that an executor can run without a solver.
//!
//! ```
//! use std::ops::ControlFlow;
//! use std::sync::Arc;
//!
//! use elbowroom_envelope::{Guarantee, Oracle, Settings, irr};
//! use elbowroom_model::Task;
//! use elbowroom_pddl::{Source, read_plan, read_problem};
//! use elbowroom_plan::deorder::deorder;
//! use elbowroom_plan::parametrize::parametrize;
//!
//! let domain = Source::new(
//!     "post.pddl",
//!     "(define (domain post)
//!        (:requirements :durative-actions :timed-initial-literals)
//!        (:predicates (open) (delivered))
//!        (:durative-action deliver :parameters () :duration (= ?duration 10)
//!          :condition (at end (open)) :effect (at end (delivered))))",
//! );
//! let problem = Source::new(
//!     "letter.pddl",
//!     "(define (problem letter) (:domain post)
//!        (:init (open) (at 30 (not (open)))) (:goal (delivered)))",
//! );
//! let (problem, _warnings) = read_problem(&domain, &problem)?;
//! let task = Task::new(problem);
//! let (plan, _warnings) = read_plan(&Source::new("plan", "0: (deliver) [10]"), &task)?;
//!
//! // The network of the plan, with the duration as its parameter.
//! let deordered = deorder(&task, &plan)?;
//! let plan = parametrize(&task, deordered.plan, &deordered.nominal, &[])?;
//!
//! let mut oracle = Oracle::new(&Arc::new(task), &Arc::new(plan), Guarantee::Dynamic)?;
//! let run = irr(&mut oracle, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;
//! let envelope = run.envelope.map_err(|objection| objection.to_string())?;
//! // The office closes at 30.
//! assert!(envelope.intervals()[0].contains(&28.into()));
//! assert!(!envelope.intervals()[0].contains(&30.into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod best;
mod control;
mod cut;
mod cut_generation;
mod cut_pool;
mod cycles;
mod enforce;
mod exact;
pub mod explain;
pub mod faults;
mod feasibility;
mod frontier;
mod guarantee;
mod irr;
mod line_search;
pub mod linear;
pub mod linear_form;
mod method;
mod objection;
pub mod obligations;
mod oracle;
pub mod pinning;
pub mod pipeline;
mod plan_text;
mod proof;
pub mod reduction;
mod repair;
mod rounding;
mod row;
mod sharpen;
pub mod soundness;
mod uniform_slack;

pub use best::{
    BestProof, BestRun, BestSettings, BestStep, BlockedVariable, BoundSource, BoxVariable,
    LOG_OF_ZERO, Objective, OptimalityProof, ProofCase, TangentPoint, best, volume_foot,
};
pub use control::{ControlConflict, ControlGround};
pub use cut::{Cut, Ground, ProofPart, ProofPath};
pub use enforce::with_obligations;
pub use exact::{
    BoundedRegion, Component, ExactError, Piece, Polygon, Region, RegionRow, RegionSource, exact,
};
pub use frontier::Growth;
pub use guarantee::Guarantee;
pub use irr::{IrrRun, Limit, Settings, StopReason, Widening, irr, limits};
pub use method::Method;
pub use objection::Objection;
pub use oracle::Oracle;
pub use plan_text::plan_text;
pub use proof::{
    ConditionProof, ControlProof, ImpossibilityProof, Refutation, RefutedCase, ScheduleCase,
    Strategy, Summand, TimeRule,
};
pub use repair::{BindingConstraint, Changeable, Repair, RepairLimits, RepairRun, repair};
pub use rounding::{Accepted, RoundingRule};
pub use row::Row;
pub use sharpen::sharpen;
pub use uniform_slack::{DeviationBounds, UniformSlack, max_uniform_slack};
