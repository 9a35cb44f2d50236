//! Integration tests of calendars: texts, mistakes in them, and a slow reference computation.

mod mistakes;
mod no_panic;
mod slow_twin;
mod texts;
