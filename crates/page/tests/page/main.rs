//! Integration tests of pages. `browser` holds the tests that need a browser.

mod colours;
mod pages;
