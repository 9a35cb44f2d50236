//! Persistent execution of temporal plans: everything that an executive needs in addition to the
//! state machine of `elbowroom::execution`.
//!
//! [`Executive`] is the entry point for programs that embed an executive: it accepts goals, executes plans for them, and
//! resumes its run after a crash. The parts below are for programs that assemble a run themselves.
//!
//! - [`journal`], [`journaling`]: append-only record of a run that survives a crash
//!   (`docs/reference/formats/journal.md`), and the recorder and the world decorator that write it before
//!   each command is sent.
//! - [`request_queue`], [`operator`]: bounded queue of operators' requests, and the world decorator that adds them to
//!   the observations of the run.
//! - [`background_planner`], [`background_preparer`], [`completion_signal`]: planning during the run.
//! - [`process_world`], [`world_protocol`], [`belief_updates`]: a world that is a process
//!   (`docs/reference/formats/world-protocol.md`). [`world_check`]: conformance test of such a world. [`realtime`]: a simulated world on the wall clock.
//! - [`run`], [`resume`]: assembly of a run from its specification, and recovery from its journal.
//! - [`EmbeddedWorld`]: a world that is an object in the process of its executive.
//! - [`http`], [`api`], [`trace_buffer`]: HTTP server and client, the interface of an executive (`docs/reference/serve.md`), and
//!   the buffer of the trace for clients.
//! - [`interface`]: the requests and responses of an executive as types, its `OpenAPI` document, and the state of a
//!   run for clients.
//! - [`history`]: closed goals and ended actions from the segments of a journal.
//! - [`clock`], [`memory_limit`], [`messages`]: wall clock, memory limit, texts of messages.
//!
//! This crate makes threads, reads clocks and writes files. It prints nothing: warnings go to a
//! [`WarningSink`].

pub mod api;
pub mod background_planner;
pub mod background_preparer;
mod background_task;
pub mod belief_updates;
pub mod clock;
pub mod completion_signal;
mod decorators;
mod embedded_world;
mod error;
mod executive;
mod goal_request;
pub mod history;
pub mod http;
pub mod interface;
pub mod journal;
pub mod journaling;
pub mod learning;
pub mod memory_limit;
pub mod messages;
pub mod operator;
pub mod process_world;
pub mod realtime;
mod request_check;
pub mod request_queue;
mod restartable_world;
pub mod resume;
pub mod run;
mod running_actions;
pub mod trace_buffer;
mod what_if;
pub mod world_check;
mod world_connection;
pub mod world_protocol;

pub use embedded_world::{EmbeddedWorld, StartedAction};
pub use error::{Error, WarningSink};
pub use executive::{Executive, ExecutiveSettings, make_persistent};
