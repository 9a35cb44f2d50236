//! Experiments that compare executors: those of the papers, and your own.
//!
//! In: an experiment file. Out: success rates and costs of each executor, as tables and plots. All
//! executors meet the same worlds (common random numbers). Trials run in parallel, on threads of
//! this crate; the results do not depend on how many there are, and the parts of an experiment that
//! were made on several machines add up.
//!
//! - [`answer`]: an experiment of either kind as one request with one answer.
//! - [`compare`]: temporal execution (`docs/experiments.md`).
//! - [`perturbed`]: worlds without time, in which starts and effects fail and facts change by
//!   themselves (`docs/perturbed-worlds.md`); the experiments of paper 2.
//! - [`record`]: what came of each trial, as a table for other programs.
//! - [`timed`]: what the best of all executors could reach on a clock, bounded from both sides.
//! - [`untimed`]: executors for worlds without time, and the rules of a trial.
//! - [`worlds`]: worlds without time.
//!
//! It stands above the library, so that programs which embed the library need neither its threads
//! nor what only experiments need.
//!
//! ```
//! use elbowroom_laboratory::perturbed::PerturbedExperiment;
//! use elbowroom_laboratory::untimed::EXECUTORS;
//!
//! assert!(!PerturbedExperiment::is_one("format = \"elbowroom-experiment\""));
//! assert!(EXECUTORS.iter().any(|executor| executor.name == "esterel"));
//! ```

pub mod answer;
pub mod compare;
pub mod perturbed;
pub mod record;
pub mod untimed;
pub mod worlds;

pub use elbowroom::timed;

/// Longer reading. Its code is compiled and run with the tests.
pub mod tutorial {
    #[doc = include_str!("../docs/tutorial/05-experiments.md")]
    pub mod t05_experiments {}
}
