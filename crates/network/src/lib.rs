//! Readers and writers for the file formats of temporal networks.
//!
//! [`read`] parses the bytes of a file in any of these formats and returns a [`NetworkFile`]: time
//! points with names, requirements, contingent links, and the distributions of their durations.
//! Numbers are exact. Errors report the position in the text and a remedy ([`Diagnostics`]).
//! [`write_json`], [`write_graphml`] and [`write_plain`] write networks so that [`read()`] reads
//! them back, [`NetworkFile::minimal`] and [`NetworkFile::dispatchable`] derive other forms, and
//! [`weak()`] decides weak controllability.
//!
//! This crate uses no files, no clock and no random numbers.
//!
//! ```
//! use elbowroom_network::read;
//!
//! let text = r#"{ "format": "elbowroom-network", "version": 1,
//!     "points": ["start", "done", "late"],
//!     "requirements": [{ "from": "done", "to": "late", "upper": 2 }],
//!     "links": [{ "activation": "start", "end": "done", "lower": 5, "upper": 8 }] }"#;
//! let file = read("work.json", text.as_bytes())?;
//! assert_eq!(file.points, ["start", "done", "late"]);
//! assert!(file.network.dispatchable().is_ok());
//! # Ok::<(), elbowroom_network::Diagnostics>(())
//! ```

mod builder;
mod derive;
mod descriptions;
mod file;
mod json;
mod number;
mod read;
mod report;
pub mod weak;
mod write;
mod xml;

pub use descriptions::decimal;
pub use elbowroom_text::{Diagnostics, Source};
pub use file::{Correlation, Duration, Format, GivenWait, NetworkFile};
pub use read::read;
pub use weak::{WeakControllability, weak};
pub use write::{write_graphml, write_json, write_plain};
