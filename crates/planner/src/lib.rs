//! An embedded temporal planner.
//!
//! It reads no clock, no file and no random number. The caller decides, every few milliseconds,
//! whether to continue. The same task gives the same plan, for any number of threads
//! ([`Settings::threads`]). The crate `elbowroom-external` runs other planners. [`no_plan`] computes
//! certificates that no plan exists.
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use elbowroom_model::{Situation, Task};
//! use elbowroom_pddl::{Source, read_problem};
//! use elbowroom_planner::{Settings, plan};
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
//!
//! let settings = Settings {
//!     first_plan_only: true,
//!     ..Settings::default()
//! };
//! let begin = Situation::initial(&task);
//! let answer = plan(&task, &begin, &settings, &mut |_| ControlFlow::Continue(()));
//! let found = answer.found().ok_or("there is a plan")?;
//! assert_eq!(found.makespan, 10.into());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod embedded;
pub mod no_plan;

pub use embedded::{
    Answer, Counts, FoundPlan, Member, Objective, Phase, Progress, Proof, Settings, Stopped,
    Technique, Tuning, TuningError, Unsupported, plan,
};
