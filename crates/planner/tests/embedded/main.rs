//! The embedded planner: what it handles, what it proves, and a slow twin.

mod features;
mod situations;
mod twin;
mod world;
