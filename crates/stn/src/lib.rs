//! Temporal networks: time points, bounds on their differences, and implied bounds.
//!
//! A simple temporal network (Dechter, Meiri & Pearl 1991) is a set of constraints `to - from <=
//! bound`. With constraints as edges `from --bound--> to`, all questions about it are questions
//! about shortest paths: the network is consistent unless it has a cycle of negative length, and
//! the tightest implied bound on `b - a` is the distance from `a` to `b`.
//!
//! A [`Network`] may be inconsistent. [`Network::consistency`] returns a [`Schedule`] or a
//! [`NegativeCycle`]. A [`ConsistentNetwork`] is a network together with a schedule that proves it
//! consistent. That schedule makes all queries cheap, because it turns all edges non-negative for
//! Dijkstra's algorithm:
//!
//! - [`ConsistentNetwork::add`] adds a constraint, or rejects it with a proof;
//!   [`ConsistentNetwork::undo_to`] removes constraints;
//! - [`ConsistentNetwork::windows`], [`ConsistentNetwork::earliest_schedule`],
//!   [`ConsistentNetwork::latest_schedule`]: the earliest and latest times of each point;
//! - [`ConsistentNetwork::shortest_paths_from`] and related methods: implied bounds, with the
//!   constraints that imply them;
//! - [`ConsistentNetwork::implied`]: the redundant constraints;
//! - [`ConsistentNetwork::minimal`]: all implied bounds at once, for small networks;
//! - [`IncrementalWindows`]: windows that are updated as times become known.
//!
//! [`uncertain`] has networks with uncertainty (STNUs), their controllability and dispatch;
//! [`corner_search`] decides whether there is a schedule for all values of quantities in the bounds
//! (weak controllability).
//!
//! Bounds are [`Rational`](elbowroom_num::Rational) by default. With
//! [`Delta`](elbowroom_num::Delta) a bound can be strict, and other exact numbers can also be a
//! [`Weight`]. Every result is exact, and the same on each run.
//!
//! This crate contains no actions and no plans.
//!
//! ```
//! use elbowroom_num::Rational;
//! use elbowroom_stn::{ConsistentNetwork, Constraint};
//!
//! let mut network = ConsistentNetwork::new();
//! let zero = network.add_node();
//! let arrival = network.add_node();
//! let minutes = |n: i64| Rational::from(n);
//! network.add(Constraint::at_least(zero, arrival, minutes(10)))?;
//! network.add(Constraint::at_most(zero, arrival, minutes(30)))?;
//! let windows = network.windows(zero);
//! assert_eq!(windows[arrival].earliest, Some(minutes(10)));
//! assert_eq!(windows[arrival].latest, Some(minutes(30)));
//!
//! let refused = network.add(Constraint::at_most(zero, arrival, minutes(5)));
//! assert_eq!(refused.unwrap_err().total, minutes(-5));
//! # Ok::<(), elbowroom_stn::NegativeCycle>(())
//! ```

mod bridges;
mod consistency;
mod consistent;
pub mod corner_search;
mod direction;
mod ids;
mod implied;
mod incremental_windows;
mod lists;
mod minimal;
mod network;
mod paths;
mod schedule;
mod small_map;
#[cfg(feature = "testing")]
pub mod testing;
pub mod uncertain;
mod weight;
mod windows;

pub use consistency::NegativeCycle;
pub use consistent::{Checkpoint, ConsistentNetwork};
pub use direction::Direction;
pub use ids::{ConstraintId, NodeId};
pub use incremental_windows::{Grounds, IncrementalWindows, OutOfWindow, WindowEnd};
pub use minimal::Minimal;
pub use network::{Constraint, Network};
pub use paths::ShortestPaths;
pub use schedule::Schedule;
pub use weight::Weight;
pub use windows::{Window, Windows};

/// Counts a step of a propagation.
fn count_step() {
    elbowroom_num::work::spend(STEP_WORK);
}

/// Work counted per step; a step visits the edges of a node.
const STEP_WORK: u64 = 200;
