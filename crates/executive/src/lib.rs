//! Persistent execution of temporal plans: everything that an executive needs beside the state machine
//! of `elbowroom::execution`.
//!
//! - [`journal`]: append-only record of a run that survives a crash (`docs/formats/journal.md`).
//! - [`request_queue`]: bounded queue of operators' requests, drained by the run.
//! - [`trace_buffer`]: in-memory buffer of the trace, for clients that read it during the run.
//! - [`world_protocol`]: messages and pipes of a world that is a process
//!   (`docs/formats/world-protocol.md`).
//! - [`http`]: HTTP/1.1 server with admission limits, access tokens, the page of a run, and a client.
//! - [`clock`], [`memory_limit`], [`messages`]: wall clock, memory limit, texts of messages.
//!
//! This crate makes threads, reads clocks and writes files. It prints nothing: warnings go to a
//! [`WarningSink`].

pub mod belief_updates;
pub mod clock;
mod error;
pub mod http;
pub mod journal;
pub mod journaling;
pub mod memory_limit;
pub mod messages;
pub mod process_world;
pub mod realtime;
pub mod request_queue;
pub mod trace_buffer;
pub mod world_protocol;

pub use error::{Error, WarningSink};
