//! What a lasting run tells those who ask, and takes from those who want something else: the
//! documents of `elbowroom serve`, `docs/serve.md`.
//!
//! - [`documents`]: questions and answers as types.
//! - [`Status`]: follows a run by its record, and answers at any moment without asking it.
//! - [`openapi`]: the interface as an `OpenAPI` document, made from those types.

pub mod documents;
mod openapi;
mod schema;
mod status;

pub use openapi::{METHODS, Method, openapi};
pub use schema::Described;
pub use status::{Status, goal_text};
