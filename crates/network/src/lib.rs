//! The field's formats for temporal networks, read as they are.
//!
//! [`read`] takes the bytes of a file in any of them and answers with a [`NetworkFile`]: time
//! points with names, requirements, contingent links, and how their durations are distributed.
//! Numbers are exact. What cannot be read is refused with the place in the text and what to do
//! ([`Diagnostics`]). [`write_json`], [`write_graphml`] and [`write_plain`] write networks so that
//! [`read()`] reads them back, [`NetworkFile::minimal`] and [`NetworkFile::dispatchable`] derive other forms, and
//! [`weak()`] decides whether there is a schedule for whatever the world does.
//!
//! This crate looks at no files, no clock and no random numbers.
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
mod file;
mod json;
mod mistake;
mod number;
mod read;
pub mod weak;
mod words;
mod write;
mod xml;

pub use elbowroom_text::{Diagnostics, Source};
pub use file::{Correlation, Duration, Format, GivenWait, NetworkFile};
pub use read::read;
pub use weak::{Weak, weak};
pub use words::number;
pub use write::{write_graphml, write_json, write_plain};
