//! Success probabilities of plans, and the most likely order of their actions (Olisipo).
//!
//! Input: a partially ordered plan, the likelihoods of failures and spontaneous changes, and the
//! belief about the present state. Output: the order most likely to succeed, and the next
//! happening.
//!
//! 1. [`Likelihoods`]: facts that change by themselves, starts, ends and effects that fail, and
//!    changes that failures leave behind; read from files by [`likelihoods`].
//! 2. [`Model`]: a plan's happenings as steps of a stochastic process.
//! 3. [`PrunedNetwork`]: P(A) and P(A ∩ G) of an order, happening by happening.
//! 4. [`OrderSearch`] (`PGen`): the best order, from [`SearchState`].
//! 5. [`LayerDispatch`] (`PExec`): the next happening, in the present state.
//! 6. [`loss_analysis`]: where an order's probability is lost, and the gains of certainty and retrying;
//!    [`search::Lattice`]: all orders of a short plan at once.
//! 7. [`optimum`]: the best that any executor can reach in a small world, and its
//!    [`optimum::PolicyTable`].
//!
//! `docs/research/probability.md` defines the computed values and explains why they are exact. The crate uses
//! no random numbers and no clock: time limits are callbacks, and the same input gives the same
//! result. Probabilities are `f64`. The temporal feasibility of an order is decided by the exact
//! temporal network.
//!
//! ```
//! use std::sync::Arc;
//!
//! use elbowroom_model::Task;
//! use elbowroom_pddl::{Source, read_plan, read_problem};
//! use elbowroom_plan::partial_order::partial_order;
//! use elbowroom_probability::dispatch::never_interrupt;
//! use elbowroom_probability::{
//!     SearchState, Likelihoods, Model, OrderSearch, SearchSettings, Semantics,
//! };
//!
//! let domain = Source::new(
//!     "lamp.pddl",
//!     "(define (domain lamp) (:predicates (whole) (lit))
//!        (:durative-action screw :parameters () :duration (= ?duration 5)
//!          :condition (over all (whole)) :effect (at end (lit))))",
//! );
//! let problem = Source::new(
//!     "evening.pddl",
//!     "(define (problem evening) (:domain lamp) (:init (whole)) (:goal (lit)))",
//! );
//! let (problem, _) = read_problem(&domain, &problem)?;
//! let task = Task::new(problem);
//! let (plan, _) = read_plan(&Source::new("plan", "0: (screw) [5]"), &task)?;
//! let plan = partial_order(&task, &plan);
//!
//! let text = "
//!     format = \"elbowroom-likelihoods\"
//!     version = 1
//!     defaults = { becomes_true = 0.0, becomes_false = 0.0, start = 0.5, effect = 0.9 }
//!     facts.whole.becomes_false = 0.25";
//! let likelihoods = elbowroom_probability::likelihoods::read(text.as_bytes(), &task)?;
//!
//! let initial = SearchState::initial(&task);
//! let model = Model::new(task, plan, &likelihoods, Semantics::Paper)?;
//! let mut search = OrderSearch::new(Arc::new(model), SearchSettings::default());
//! let found = search.best_order(&initial, &mut never_interrupt)?;
//! // It starts, the lamp stays whole for one step, and the effect takes place.
//! let order = found.order.ok_or("there is a way")?;
//! assert!((order.probability - 0.5 * 0.75 * 0.9).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod actions;
mod belief;
pub mod dispatch;
pub mod likelihoods;
pub mod loss_analysis;
mod model;
mod network;
pub mod optimum;
pub mod search;
mod search_state;
mod total_order;

pub use actions::{Unsupported, all_actions, all_actions_under};
pub use belief::Belief;
pub use dispatch::{Choice, LayerDispatch, NextHappening, Reconsider};
pub use likelihoods::{Likelihoods, Rate, SpontaneousChange};
pub use model::{Model, Semantics};
pub use network::{Happenings, Loss, LossCause, PrunedNetwork, Reading, TooCoupled};
pub use search::{Candidates, OrderSearch, SearchResult, SearchSettings, SearchStop};
pub use search_state::{Running, SearchState};
pub use total_order::{Layer, Slot, TotalOrderPlan};
