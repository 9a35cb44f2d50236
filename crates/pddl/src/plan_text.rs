//! Plans as planners print them.

mod duration;
mod line;
mod read;
mod write;

pub use line::LineKind;
pub use read::read_plan;
pub use write::write_plan;
