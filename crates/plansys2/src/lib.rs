//! Elbowroom with `PlanSys2`: both protocols as pure functions of messages and time, without the
//! network.
//!
//! [`World`] is Elbowroom's side, the [world
//! protocol](https://github.com/elbowroom/elbowroom/blob/main/docs/reference/formats/world-protocol.md) in
//! JSON Lines. [`Hub`] is the robots' side, the executor's part on `PlanSys2`'s topic
//! `actions_hub`. The program `elbowroom-plansys2` connects the two with standard input and output
//! and with DDS. It is built with the feature `dds`.
//!
//! [`ProblemSync`] synchronizes `PlanSys2`'s problem expert with a run, in both directions. [`Goals`],
//! [`Lifecycle`], [`Progress`] and [`sub_goal`] are for the replacement of `PlanSys2`'s planner and
//! executor.
//!
//! [`Claim`] keeps two executors from using the same performers.
//!
//! The library has no clock, no thread and no socket: time is an argument, and messages are return
//! values. `docs/reference/plansys2.md` has the table of events and reactions. Each row is a test, and the
//! same scripts are played to the `Hub` of `examples/plansys2_world.py`, which must react in the
//! same way.
//!
//! ```
//! use std::time::Duration;
//! use elbowroom_plansys2::message::{ActionExecution, kind};
//! use elbowroom_plansys2::{Action, Effect, Hub, ActionUpdate};
//!
//! let mut hub = Hub::new("elbowroom");
//! let action = Action { ticket: 1, name: "beep".into(), arguments: vec![], is_instantaneous: false };
//! hub.begin(action, Duration::ZERO);
//! hub.effects(); // the request
//! let answer = ActionExecution { kind: kind::RESPONSE, node_id: "robot".into(), action: "beep".into(), ..Default::default() };
//! hub.message(&answer, Duration::from_millis(20));
//! assert!(hub.effects().contains(&Effect::Report(1, ActionUpdate::Started)));
//! ```

pub mod interface;
pub mod knowledge;
pub mod message;

mod claim;
mod discovery;
mod goals;
mod hub;
mod lifecycle;
mod problem_sync;
mod progress;
mod tree;
mod world;

pub use claim::Claim;
pub use discovery::PerformerDiscovery;
pub use goals::Goals;
pub use hub::{Action, ActionHandle, ActionUpdate, Effect, Hub};
pub use lifecycle::Lifecycle;
pub use problem_sync::{Answer, Call, CallId, ExternalChange, Key, ProblemSync};
pub use progress::{Progress, plan_text};
pub use tree::sub_goal;
pub use world::{Command, World};
