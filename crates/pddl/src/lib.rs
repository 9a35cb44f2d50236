//! PDDL and plan text to the model, and back.

mod diagnostic;
mod feature;
mod lower;
mod plan_text;
mod render;
mod report;
mod source;
mod suggest;
mod syntax;

pub use diagnostic::{Diagnostic, Diagnostics, Label, Severity};
pub use feature::Feature;
pub use lower::read_problem;
pub use plan_text::{read_plan, write_plan};
pub use source::Source;
