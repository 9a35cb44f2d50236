//! The library for browsers: questions and answers are JSON.
//!
//! Built for `wasm32-unknown-unknown`, this crate is a module with a plain C interface ([`abi`])
//! that needs no generated bindings. A [`Question`] contains all its input, including texts,
//! because a browser has no files. A [`Reply`] contains the document that the command prints with
//! `--json`, byte for byte, and the command's exit code. This crate only translates: answers are
//! defined in `elbowroom`, and pages in `elbowroom-page`.
//!
//! ```
//! use elbowroom_web::reply;
//!
//! let question = r#"{ "ask": "check",
//!     "domain": { "name": "domain.pddl", "text": "(define (domain empty))" },
//!     "problem": { "name": "problem.pddl",
//!                  "text": "(define (problem none) (:domain empty) (:init) (:goal (and)))" } }"#;
//! let reply = reply(question, &mut || std::time::Duration::ZERO);
//! assert_eq!(reply.exit, 0);
//! assert!(reply.document.contains(r#""answer": "readable""#));
//! ```

pub mod abi;
mod answer;
mod deadline_observer;
mod question;
mod reply;

use std::time::Duration;

pub use question::{
    CheckQuestion, EnvelopeQuestion, PageQuestion, PlanQuestion, Question, RunQuestion,
    StnQuestion, Text,
};
pub use reply::Reply;

use reply::Failure;

/// Returns the reply to a question, which is a [`Question`] as JSON. `clock` returns the time since
/// a fixed moment.
///
/// The reply to an invalid question is an error document.
pub fn reply(question: &str, clock: &mut (dyn FnMut() -> Duration + Send)) -> Reply {
    let question: Question = match serde_json::from_str(question) {
        Ok(question) => question,
        Err(error) => return Failure::new(format!("the question cannot be read: {error}")).into(),
    };
    answer::answer(&question, clock).unwrap_or_else(Reply::from)
}
