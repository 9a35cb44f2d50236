//! Elbowroom with `PlanSys2`, but for the network: two conversations as plain functions of what was heard and
//! what time it is.
//!
//! [`World`] is the side of Elbowroom: the [world protocol](https://github.com/elbowroom/elbowroom/blob/main/docs/formats/world-protocol.md),
//! JSON Lines. [`Hub`] is the side of the robots: the executor's part on `PlanSys2`'s topic `actions_hub`. The
//! program `elbowroom-plansys2` connects the two with standard input and output and with DDS; it is built
//! with the feature `dds`.
//!
//! [`Mirror`] is the side of `PlanSys2`'s problem expert: what a run changes is told there, and what others change there is
//! seen by the run. [`Goals`], [`Lifecycle`], [`Progress`] and [`sub_goal`] are what it takes to stand in for `PlanSys2`'s planner and executor.
//!
//! Nothing here has a clock, a thread or a socket: time comes in as an argument, and what is to be said
//! comes out as a value. `docs/plansys2.md` has the table of what happens when; each row is a test, and
//! the same scripts are played to the `Hub` of `examples/plansys2_world.py`, which must do the same.
//!
//! ```
//! use std::time::Duration;
//! use elbowroom_plansys2::message::{ActionExecution, kind};
//! use elbowroom_plansys2::{Action, Effect, Hub, Told};
//!
//! let mut hub = Hub::new("elbowroom");
//! let action = Action { ticket: 1, name: "beep".into(), arguments: vec![], is_instantaneous: false };
//! hub.begin(action, Duration::ZERO);
//! hub.effects(); // the request
//! let answer = ActionExecution { kind: kind::RESPONSE, node_id: "robot".into(), action: "beep".into(), ..Default::default() };
//! hub.message(&answer, Duration::from_millis(20));
//! assert!(hub.effects().contains(&Effect::Tell(1, Told::Started)));
//! ```

pub mod interface;
pub mod knowledge;
pub mod message;

mod census;
mod goals;
mod hub;
mod lifecycle;
mod mirror;
mod progress;
mod tree;
mod world;

pub use census::Census;
pub use goals::Goals;
pub use hub::{Action, Effect, Hub, Ticket, Told};
pub use lifecycle::Lifecycle;
pub use mirror::{Answer, Call, CallId, Key, Mirror, Seen};
pub use progress::{Progress, plan_text};
pub use tree::sub_goal;
pub use world::{Command, World};
