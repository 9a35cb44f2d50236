//! Integration tests of persistent runs, as a library.

mod in_process;
