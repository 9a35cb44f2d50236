//! Integration tests of calendars: texts, mistakes in them, and a slow reference computation.

mod minute_by_minute;
mod mistakes;
mod no_panic;
mod texts;
