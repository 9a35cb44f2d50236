//! Plans in the notations of planners.

mod action_like_text;
mod duration;
mod form;
mod line;
mod lines;
mod printed;
mod read;
mod step;
mod timing;
mod vocabulary;
mod write;

pub use line::LineKind;
pub use printed::{PrintedPlan, PrintedStep};
pub use read::{read_plan, read_printed_plan};
pub use write::{write_plan, write_rounded_plan};
