//! Interface of an executive to its clients: the documents of `elbowroom serve`, `docs/reference/serve.md`.
//!
//! - [`documents`]: requests and responses as types.
//! - [`Status`]: follows a run by its record, and answers requests at any time without accessing
//!   the run.
//! - [`openapi`]: the interface as an `OpenAPI` document, generated from those types.

pub mod documents;
mod openapi;
mod schema;
mod status;

pub use openapi::{METHODS, Method, openapi};
pub use schema::Described;
pub(crate) use status::SegmentHistory;
pub use status::{Status, goal_text};
