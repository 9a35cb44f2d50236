//! Perturbed worlds: starts and effects fail, and facts change spontaneously (paper 2).
//!
//! There are two models of the same likelihoods, one file each:
//!
//! - [`SoundWorld`]: independent draws with the given likelihoods;
//! - [`PublishedWorld`]: the behaviour of the authors' programs that made the paper's results.

mod event_probabilities;
mod likelihood_world;
mod published;
mod rand_c;

pub use event_probabilities::EventProbabilities;
pub use likelihood_world::SoundWorld;
pub use published::{Perturbation, PerturbedFacts, PublishedWorld};
