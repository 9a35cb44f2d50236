//! Executors side by side: the experiments of the papers, and your own.
//!
//! In: an experiment file. Out: how often each executor succeeded, what it took, tables and plots.
//! All executors meet the same worlds (common random numbers). Trials run in parallel, on threads of
//! this crate; the results do not depend on how many there are, and the parts of an experiment that
//! were made on several machines add up.
//!
//! - [`answer`]: either of them as one request with one answer.
//! - [`compare`]: plans on a clock (`docs/experiments.md`).
//! - [`perturbed`]: worlds without time, in which starts and effects fail and facts change by
//!   themselves (`docs/perturbed-worlds.md`); the experiments of paper 2.
//! - [`untimed`]: who executes plans where there is no time, and by which rules a trial goes.
//! - [`worlds`]: worlds without time.
//!
//! It stands above the library, and nothing that goes on board knows it: it needs threads, and holds
//! what only an experiment asks for.
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
pub mod untimed;
pub mod worlds;

/// Longer reading. Its code is compiled and run with the tests.
pub mod tutorial {
    #[doc = include_str!("../docs/tutorial/05-experiments.md")]
    pub mod t05_experiments {}
}
