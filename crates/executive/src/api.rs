//! HTTP interface of an executive: `docs/reference/serve.md`.

mod initial_problem;
mod monitoring;
mod mutations;
mod queries;
mod router;
mod server;
mod state_stream;

pub use initial_problem::{Client, GivenProblem, InitialProblem};
pub use router::{ApiError, ApiRouter};
pub use server::serve;
