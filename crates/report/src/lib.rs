//! What runs leave behind: traces, statistics, tables and plots. Text in and out; no files.
//!
//! - [`trace`]: the record of a run as JSON Lines (`docs/formats/trace.md`), and a world that plays
//!   a stored one back.
//! - [`wire`]: commands and observations as JSON, for traces and for worlds that are processes
//!   (`docs/formats/world-protocol.md`).
//! - [`statistics`]: proportions with Wilson's intervals, means.
//! - [`table`]: tables as Markdown, CSV, or text for a terminal.
//! - [`plot`]: plots as SVG.

mod names;
pub mod plot;
pub mod statistics;
pub mod table;
pub mod trace;
pub mod wire;

pub use names::Names;
