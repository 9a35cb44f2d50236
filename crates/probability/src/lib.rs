//! How likely a plan is to succeed, and the order most likely to (Olisipo).
mod belief;
mod circumstances;
pub mod dispatch;
pub mod likelihoods;
mod lookahead;
mod model;
mod network;
pub mod optimum;
pub mod search;
mod total_order;

pub use belief::Belief;
pub use circumstances::{Circumstances, Running};
pub use dispatch::{Choice, LayerDispatch, NextHappening, Reconsider};
pub use likelihoods::{Flip, Likelihoods};
pub use lookahead::Lookahead;
pub use model::{Model, Semantics};
pub use network::{PrunedNetwork, TooCoupled};
pub use search::{Candidates, Found, OrderSearch, SearchSettings, SearchStop, Slot};
pub use total_order::{Layer, TotalOrderPlan};
