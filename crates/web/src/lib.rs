//! The library for browsers: a question goes in as JSON, the answer comes out as JSON.
//!
//! Built for `wasm32-unknown-unknown`, this is a module with a plain C interface ([`abi`]) that
//! needs no generated bindings. A [`Question`] holds all that it is about, texts included, because
//! a browser has no files; a [`Reply`] holds the document that the command prints with `--json`,
//! byte for byte, and the exit code that the command would end with. This crate only translates:
//! what an answer *is* stands in `elbowroom`, and what a page shows in `elbowroom-page`.
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
mod question;
mod reply;
mod watch;

use std::time::Duration;

pub use question::{
    CheckQuestion, EnvelopeQuestion, PageQuestion, PlanQuestion, Question, RunQuestion,
    StnQuestion, Text,
};
pub use reply::Reply;

use reply::Failure;

/// The reply to a question, which is a [`Question`] as JSON. `clock` says how much time has passed
/// since some fixed moment.
///
/// A question that cannot be understood is replied to, too.
pub fn reply(question: &str, clock: &mut (dyn FnMut() -> Duration + Send)) -> Reply {
    let question: Question = match serde_json::from_str(question) {
        Ok(question) => question,
        Err(error) => return Failure::new(format!("the question cannot be read: {error}")).into(),
    };
    answer::answer(&question, clock).unwrap_or_else(Reply::from)
}
