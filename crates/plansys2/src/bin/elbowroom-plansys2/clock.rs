//! The wall clock.

use std::time::Instant;

#[allow(
    clippy::disallowed_methods,
    reason = "robots are on the wall clock; the conversations get it as an argument"
)]
pub(super) fn now() -> Instant {
    Instant::now()
}
