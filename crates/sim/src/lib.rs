//! Seeded worlds to execute plans in.
//!
//! In: a world file (`docs/formats/world.md`) and a seed. Out: a [`World`](elbowroom_execution::World)
//! that does what it is told, but in its own time.
//!
//! - [`WorldModel`]: what a world file says: how long actions take, what they really change, how
//!   often they fail, what happens by itself, and how well the world reports.
//! - [`SimWorld`]: one trajectory of it. It is PDDL that happens: conditions are read in the true
//!   state, and an action whose conditions do not hold fails.
//! - [`Unreliable`]: loses, repeats, delays and contradicts the reports of another world.
//!
//! Randomness is keyed ([`draw`]): the duration of the second time that `(pick rover box)` starts
//! depends on the seed, on `(pick rover box)` and on 2, and on nothing else. Two executors that
//! meet the same seed therefore meet the same world, as far as they do the same (common random
//! numbers), and their results can be compared in pairs.
//!
//! ```
//! use elbowroom_model::Problem;
//! use elbowroom_sim::WorldModel;
//!
//! let text = r#"
//!     format = "elbowroom-world"
//!     version = 1
//!
//!     [[duration]]
//!     action = "*"
//!     normal = { mean = 1, deviation = 0.2, minimum = 0.5 }
//!     relative = true
//! "#;
//! let model = WorldModel::read(text, &Problem::default())?;
//! assert!(model.reports.is_perfect());
//! # Ok::<(), elbowroom_text::Diagnostics>(())
//! ```

pub mod draw;
mod model;
mod paced;
mod pattern;
mod sim;
mod unreliable;

pub use draw::{Distribution, Purpose};
pub use model::{Amount, Exogenous, ExogenousChange, Failing, Failure, Reports, Rule, WorldModel};
pub use paced::{Begun, Durations, Pace, Paced};
pub use pattern::ActionPattern;
pub use sim::SimWorld;
pub use unreliable::Unreliable;
