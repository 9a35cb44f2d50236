//! Temporal plans on robots: planning, validation, robustness envelopes, execution.
//!
//! Elbowroom reads PDDL 2.1 problems with durative actions. It finds plans for them, computes how
//! far each duration, rate or deadline may deviate while a plan is still guaranteed to work, and
//! executes plans with dispatching, monitoring and replanning. All arithmetic that decides
//! something is exact.
//!
//! # Planning
//!
//! ```
//! use elbowroom::answers::NoObserver;
//! use elbowroom::answers::plan::{PlanRequest, plan};
//! # use elbowroom::model::Task;
//! # use elbowroom::pddl::{self, Source};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let domain = Source::new("domain", "
//!     (define (domain post)
//!       (:requirements :durative-actions :timed-initial-literals)
//!       (:predicates (open) (delivered))
//!       (:durative-action deliver :parameters ()
//!         :duration (= ?duration 10)
//!         :condition (at end (open))
//!         :effect (at end (delivered))))");
//! let problem = Source::new("problem", "
//!     (define (problem letter) (:domain post)
//!       (:init (open) (at 30 (not (open))))
//!       (:goal (delivered)))");
//! let (problem, _warnings) = pddl::read_problem(&domain, &problem)?;
//! let task = Task::new(problem);
//!
//! let mut request = PlanRequest { task: &task, first_plan_only: true, most_memory: None, self_overlap: false, threads: 1 };
//! let plan = plan(&mut request, &mut NoObserver)?.plan.expect("there is a plan");
//! assert_eq!(plan.steps.len(), 1);
//! # Ok(())
//! # }
//! ```
//!
//! # Envelopes
//!
//! ```
//! use std::sync::Arc;
//!
//! use elbowroom::pipeline::{Settings, robust_plan};
//! # use elbowroom::model::Task;
//! # use elbowroom::pddl::{self, Source};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let domain = Source::new("domain", "
//! #     (define (domain post)
//! #       (:requirements :durative-actions :timed-initial-literals)
//! #       (:predicates (open) (delivered))
//! #       (:durative-action deliver :parameters ()
//! #         :duration (= ?duration 10)
//! #         :condition (at end (open))
//! #         :effect (at end (delivered))))");
//! # let problem = Source::new("problem", "
//! #     (define (problem letter) (:domain post)
//! #       (:init (open) (at 30 (not (open))))
//! #       (:goal (delivered)))");
//! # let (problem, _warnings) = pddl::read_problem(&domain, &problem)?;
//! # let task = Task::new(problem);
//! // The same problem, and a plan from elsewhere.
//! let (plan, _warnings) = pddl::read_plan(&Source::new("plan", "0: (deliver) [10]"), &task)?;
//!
//! let robust = robust_plan(&Arc::new(task), &plan, &Settings::default())?;
//! let envelope = robust.envelope.expect("the plan works as it is");
//! // The office closes at 30, and delivering may not take longer than that.
//! assert!(envelope.intervals()[0].contains(&28.into()));
//! assert!(!envelope.intervals()[0].contains(&30.into()));
//! # Ok(())
//! # }
//! ```
//!
//! # Execution
//!
//! A world is anything that implements [`execution::World`]: a robot, or a simulation with seeds.
//! [`execute::Execution`] has all that can be chosen, and an example of an event loop that drives a
//! run step by step.
//!
//! ```
//! use std::sync::Arc;
//!
//! use elbowroom::execute::execute;
//! use elbowroom::execution::run::Verdict;
//! use elbowroom::sim::{SimWorld, WorldModel};
//! # use elbowroom::model::Task;
//! # use elbowroom::pddl::{self, Source};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let domain = Source::new("domain", "
//! #     (define (domain post)
//! #       (:requirements :durative-actions :timed-initial-literals)
//! #       (:predicates (open) (delivered))
//! #       (:durative-action deliver :parameters ()
//! #         :duration (= ?duration 10)
//! #         :condition (at end (open))
//! #         :effect (at end (delivered))))");
//! # let problem = Source::new("problem", "
//! #     (define (problem letter) (:domain post)
//! #       (:init (open) (at 30 (not (open))))
//! #       (:goal (delivered)))");
//! # let (problem, _warnings) = pddl::read_problem(&domain, &problem)?;
//! # let task = Task::new(problem);
//! # let (plan, _warnings) = pddl::read_plan(&Source::new("plan", "0: (deliver) [10]"), &task)?;
//! let text = r#"
//!     format = "elbowroom-world"
//!     version = 1
//!     [[duration]]
//!     action = "deliver"
//!     uniform = { from = 9, to = 20 }"#;
//! let task = Arc::new(task);
//! let model = WorldModel::read(text, task.problem())?;
//! let mut world = SimWorld::new(Arc::clone(&task), &model, 1);
//!
//! let report = execute(&task, &plan, "guarded", &mut world)?;
//! assert_eq!(report.verdict, Verdict::GoalReached);
//! # Ok(())
//! # }
//! ```
//!
//! # Contents
//!
//! The [`tutorial`] goes through planning, envelopes, execution and probability. Each question of
//! the command line is a request with an answer in [`answers`]; an answer is plain data, and its
//! JSON is the document that `docs/reference/formats` describes.
//!
//! - [`answers`]: the questions of the command line as requests, with progress and cancelling.
//! - [`pipeline`]: from a plan to its envelope in one call or step by step.
//! - [`execute`](mod@execute): executes plans.
//! - [`no_plan`]: certificates that no plan exists.
//! - [`dot`]: networks as graphs for Graphviz.
//! - [`Explainer`]: explains what limits an envelope, and why a plan fails ([`Explanation`],
//!   [`Shortfall`]).
//! - [`parse_box`], [`write_box`]: boxes as text ([`BoxTextError`]).
//! - [`AnyPlan`], [`PlanKind`]: a plan of either kind, with fixed times or as a network.
//! - [`earliest_end`]: the makespan of a plan's earliest schedule.
//!
//! The crates that it re-exports:
//!
//! - [`text`]: texts, source positions, diagnostics.
//! - [`num`]: exact rationals and intervals.
//! - [`model`]: problems, plans with fixed times, and validation ([`model::validate()`]).
//! - [`pddl`]: reads and writes PDDL and plans.
//! - [`stn`]: simple temporal networks, with and without uncertainty.
//! - [`network`]: reads the field's formats of temporal networks, and decides their
//!   controllability.
//! - [`plan`]: networks of plans, and their parameters.
//! - [`envelope`]: decides whether a box is inside the envelope, and searches for a large one.
//! - [`probability`]: success probabilities, and the best order of a plan's actions.
//! - [`mdp`]: bounds on the success probability of the best executor on a clock, and its policy.
//! - [`planner`]: the embedded planner; [`external`]: other planners, as supervised processes.
//! - [`execution`]: executors, and the run of a plan.
//! - [`sim`]: simulated worlds.
//! - [`report`]: traces, replays, statistics, tables and plots.
//!
//! Experiments that compare executors are a separate crate, `elbowroom-laboratory`, and so are
//! exports for other programs, `elbowroom-export`.
//!
//! The library reads no clock and no files, and prints nothing.

pub mod answers;
pub mod execute;
mod given_plan;
pub mod network;
pub mod pipeline;

pub use elbowroom_envelope as envelope;
pub use elbowroom_envelope::explain::{ANY_FINITE, Explainer, Explanation, Shortfall};
pub use elbowroom_envelope::{Accepted, RoundingRule, plan_text};
pub use elbowroom_execution as execution;
pub use elbowroom_external as external;
pub use elbowroom_learning as learning;
pub use elbowroom_mdp as mdp;
pub use elbowroom_model as model;
pub use elbowroom_num as num;
pub use elbowroom_pddl as pddl;
pub use elbowroom_plan as plan;
pub use elbowroom_plan::box_text::{BoxTextError, parse_box, write_box};
pub use elbowroom_plan::makespan::earliest_end;
pub use elbowroom_plan::{AnyPlan, PlanKind, dot};
pub use elbowroom_planner as planner;
pub use elbowroom_planner::no_plan;
pub use elbowroom_probability as probability;
pub use elbowroom_report as report;
pub use elbowroom_selection::{DistributionError, duration_distribution, duration_distributions};
pub use elbowroom_sim as sim;
pub use elbowroom_stn as stn;
pub use elbowroom_text as text;
pub use elbowroom_verify as verify;
pub use execute::execute;
pub use given_plan::given_plan;

/// The tutorial. Its code is compiled and run with the tests.
pub mod tutorial {
    #[doc = include_str!("../docs/tutorial/01-from-a-plan-to-an-envelope.md")]
    pub mod t01_from_a_plan_to_an_envelope {}

    #[doc = include_str!("../docs/tutorial/02-planning.md")]
    pub mod t02_planning {}

    #[doc = include_str!("../docs/tutorial/03-execution.md")]
    pub mod t03_execution {}

    #[doc = include_str!("../docs/tutorial/04-probability.md")]
    pub mod t04_probability {}
}
