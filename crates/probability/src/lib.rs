//! How likely a plan is to succeed, and the order most likely to (Olisipo).
mod belief;
mod circumstances;
pub mod likelihoods;
mod model;
mod network;

pub use belief::Belief;
pub use circumstances::{Circumstances, Running};
pub use likelihoods::{Flip, Likelihoods};
pub use model::{Model, Semantics};
pub use network::{PrunedNetwork, TooCoupled};
