//! Experiments that compare executors: those of the papers, and your own.
//!
//! The input is an experiment file. The output is the success rates and costs of each executor, as
//! tables and plots. All executors run in the same worlds (common random numbers). Trials run in
//! parallel on threads of this crate. The results do not depend on the number of threads, and parts
//! of an experiment from several machines add up.
//!
//! - [`answer`]: an experiment of either kind as one request with one answer.
//! - [`trials`]: the loop over the trials of either kind, in parallel and in parts.
//! - [`results`]: the results of either kind, and the sum of parts.
//! - [`failures`]: failed trials by kind, each with an example.
//! - [`error`]: errors of both kinds.
//! - [`compare`]: temporal execution (`docs/research/experiments.md`).
//! - [`perturbed`]: worlds without time, in which starts and effects fail and facts change
//!   spontaneously (`docs/research/perturbed-worlds.md`); the experiments of paper 2.
//! - [`record`]: the result of each trial, as a table for other programs.
//! - [`untimed`]: executors for worlds without time, and the rules of a trial.
//! - [`worlds`]: worlds without time.
//!
//! This crate depends on the library, and not vice versa, so programs that embed the library need
//! neither its threads nor its dependencies.
//!
//! ```
//! use elbowroom_laboratory::perturbed::PerturbedExperiment;
//! use elbowroom_laboratory::untimed::EXECUTORS;
//!
//! assert!(!PerturbedExperiment::is_experiment("format = \"elbowroom-experiment\""));
//! assert!(EXECUTORS.iter().any(|executor| executor.name == "esterel"));
//! ```

pub mod answer;
pub mod compare;
pub mod error;
pub mod failures;
pub mod perturbed;
pub mod record;
pub mod results;
pub mod trials;
pub mod untimed;
pub mod worlds;

/// Tutorial. Its code is compiled and run with the tests.
pub mod tutorial {
    #[doc = include_str!("../docs/tutorial/05-experiments.md")]
    pub mod t05_experiments {}
}
