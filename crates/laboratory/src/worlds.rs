//! Perturbed worlds: starts and effects fail, and facts change by themselves (paper 2).
//!
//! Two models of the same likelihoods, one file each:
//!
//! - [`SoundWorld`]: what the likelihoods say, all draws independent of each other;
//! - [`PublishedWorld`]: what the authors' programs did when the paper's results were made.

mod chances;
mod published;
mod rand_c;
mod sound;

pub use chances::Chances;
pub use published::{Perturbation, PerturbedFacts, PublishedWorld};
pub use sound::SoundWorld;
